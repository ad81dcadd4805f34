"""The sheet Adjustment of a survey: statistics, groups, datum, instruments and check points."""

from tankcal.report.workbook.look import ANGLES, in_mm, number_format, values_of
from tankcal.report.workbook.observations import SMALL
from tankcal.report.workbook.tables import set_widths
from tankcal.text.digits import decimals_of, decimals_of_rows
from tankcal.text.words import (
    as_sentence,
    datum_sentences,
    global_test_sentence,
    group_name,
    scale_sentence,
    snooping_sentence,
    verdict_sentences,
)

_LEAST = (34, 12)  # widths of the first columns, where labels and values stand
_HEAD_ROW = 3
_MOST_ASIDE = 50  # sentences on points that were set aside


def adjustment_sheet(book, record):
    """Statistics, groups, datum, instruments and check points of the adjustment."""
    a, words = record["adjustment"], book.words
    tables = [
        ("adjusted_groups", "groups", _groups(book, a["groups"])),
        ("adjusted_instruments", "instruments", _instruments(book, a["instruments"])),
        ("adjusted_systems", "systems", _systems(book, a["systems"])),
        ("adjusted_checks", "check_points", _check_points(book, a["check_points"])),
    ]
    sheet = book.sheet("adjustment", landscape=True)
    widths = set_widths(book, sheet, *(columns for _, _, columns in tables), least=_LEAST)
    row = _facts(book, sheet, _HEAD_ROW, _statistics(a, words), widths)
    book.heading(sheet, row, words["headings"]["adjusted_datum"], len(widths))
    row = _sentences(book, sheet, row + 1, datum_sentences(words, a), widths)
    aside = [as_sentence(one) for one in a["aside"][:_MOST_ASIDE]]
    row = _sentences(book, sheet, row, aside, widths)
    for title, name, columns in tables:
        if columns[0].cells:
            book.heading(sheet, row, words["headings"][title], len(columns))
            row = book.table(sheet, row + 1, name, columns, widths=widths) + 2
        if name == "groups":
            row = _sentences(book, sheet, row, verdict_sentences(words, a), widths)


def _statistics(a, words):
    """(label key, value, number format or None)."""
    p, checks = a["precision"] or {}, a["check_points"] or {}
    lines = [
        ("adjusted_points", len(a["points"]), "0"),
        ("observations", a["observations"], "0"),
        ("unknowns", a["unknowns"], "0"),
        ("redundancy", a["redundancy"], "0"),
        ("iterations", a["iterations"], "0"),
        ("snooping", snooping_sentence(words, a), None),
        ("sigma0", a["sigma0"], "0.000"),
        ("global_test", global_test_sentence(words, a), None),
        ("cov_scale", scale_sentence(words, a), None),
        _millimetres("mean_sd", p.get("mean_sd_m")),
        _millimetres("spherical_sd", p.get("spherical_sd_m")),
        _millimetres("quadratic_sd", p.get("quadratic_sd_m")),
        ("extent", p.get("extent_m"), '0.0 "m"'),
        ("proportional", p.get("proportional"), '"1 : "0'),
        _millimetres("r_xyz", checks.get("r_xyz_m")),
        _millimetres("largest_difference", checks.get("largest_m")),
        _millimetres("mean_difference", checks.get("mean_m")),
    ]
    return [line for line in lines if line[1] is not None]


def _millimetres(label, size_m):
    """A line with a size in mm, with three digits as in the working papers."""
    size = in_mm(size_m)
    return label, size, number_format(decimals_of(size, significant=3), unit="mm")


def _facts(book, sheet, row, lines, widths):
    """A line for each label and value; texts over the columns at the right of the labels."""
    for label, value, shown in lines:
        if shown is None:
            book.paragraph_in(sheet, row, 1, value, widths[1:])
        else:
            book.put(sheet, row, 1, value, num_format=shown, align="left", valign="top")
        book.label(sheet, row, book.words["labels"][label], widths[0])
        row += 1
    return row + 1


def _sentences(book, sheet, row, sentences, widths):
    """A paragraph each; returns the next row, after an empty one where there is any."""
    for sentence in sentences:
        book.paragraph(sheet, row, sentence, widths)
        row += 1
    return row + bool(sentences)


def _small(rows, key):
    """Values in their small unit, with the decimals that two digits need."""
    values = [
        None if row[key] is None else row[key] * SMALL.get(row["unit"], ("", 1.0))[1]
        for row in rows
    ]
    return values, [decimals_of(value) if value else 1 for value in values]


def _groups(book, rows):
    words = book.words
    judged = [row["verdict"] in ("as_declared", "better", "worse") for row in rows]
    intervals = {
        key: [row[key] if good else None for row, good in zip(rows, judged, strict=True)]
        for key in ("factor", "factor_low", "factor_high")
    }
    units = [SMALL.get(row["unit"], ("", 1.0))[0] for row in rows]
    verdicts = [words["verdicts"][row["verdict"]] for row in rows]
    return [
        book.column("observations", [group_name(words, row) for row in rows], None, 34),
        book.column("values", values_of(rows, "count"), 0, 10),
        book.column("set_aside", values_of(rows, "removed"), 0, 10),
        book.column("sd_smallest", *_small(rows, "sd_smallest"), 11),
        book.column("sd_largest", *_small(rows, "sd_largest"), 11),
        book.column("rms", *_small(rows, "rms"), 11),
        book.column("unit", units, None, 8),
        book.column("redundancy", values_of(rows, "redundancy"), 1, 11),
        book.column("factor", intervals["factor"], 2, 12),
        book.column("factor_low", intervals["factor_low"], 2, 11),
        book.column("factor_high", intervals["factor_high"], 2, 11),
        book.column("verdict", verdicts, None, 16),
    ]


def _instruments(book, rows):
    kinds = book.words["instruments"]
    certificates = [row["details"].get("certificate", "") for row in rows]
    estimates = [
        column
        for code, key, unit in (
            ("scale_declared", "declared_scale", "ppm"),
            ("scale_estimated", "scale", "ppm"),
            ("offset_declared", "declared_offset", "mm"),
            ("offset_estimated", "offset", "mm"),
        )
        for column in _beside_sd(book, rows, code, key, unit)
    ]
    return [
        book.column("instrument", values_of(rows, "instrument"), None, 34),
        book.column("kind", [kinds.get(row["kind"], row["kind"] or "") for row in rows]),
        book.column("certificate", certificates),
        *estimates,
    ]


def _beside_sd(book, rows, code, key, unit):
    """A column of values and one of their sds, both to two digits of the sd."""
    values, sds = (values_of(rows, f"{key}{part}_{unit}") for part in ("", "_sd"))
    digits = decimals_of_rows(sds, most=3, unknown=2)
    return [book.column(code, values, digits), book.column(f"sd_{code}", sds, digits)]


def _systems(book, rows):
    return [
        book.column("system", values_of(rows, "system"), None, 34),
        *(book.column("of_m", values_of(rows, f"{axis}_m"), 4, axis=axis) for axis in "xyz"),
        *(
            book.column("of_deg", values_of(rows, f"{key}_deg"), 5, axis=sign)
            for sign, key in ANGLES
        ),
        *_beside_sd(book, rows, "scale", "scale", "ppm"),
    ]


def _check_points(book, found):
    rows = found["points"] if found else []
    sds = {axis: values_of(rows, f"s{axis}_m", 1e3) for axis in "xyz"}
    digits = {axis: decimals_of_rows(sd, most=3, unknown=2) for axis, sd in sds.items()}
    differences = [
        book.column("difference_mm", values_of(rows, f"d{axis}_m", 1e3), digits[axis], axis=axis)
        for axis in "xyz"
    ]
    return [
        book.column("check_point", values_of(rows, "point"), None, 34),
        *differences,
        book.column("magnitude_mm", values_of(rows, "size_m", 1e3), 2),
        *(book.column("sd_of_mm", sds[axis], digits[axis], axis=axis) for axis in "xyz"),
        book.column("largest_w", values_of(rows, "largest_w"), 1),
    ]
