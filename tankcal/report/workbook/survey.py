"""The sheet Adjustment of a survey: statistics, groups, datum, instruments and check points."""

from tankcal.report.tables.survey import CHECK_POINTS, GROUPS, INSTRUMENTS, SYSTEMS
from tankcal.report.workbook.look import in_mm, number_format
from tankcal.report.workbook.tables import columns_of, set_widths
from tankcal.text.digits import decimals_of
from tankcal.text.words import (
    as_sentence,
    datum_sentences,
    global_test_sentence,
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
        ("adjusted_groups", "groups", columns_of(book, GROUPS)),
        ("adjusted_instruments", "instruments", columns_of(book, INSTRUMENTS)),
        ("adjusted_systems", "systems", columns_of(book, SYSTEMS)),
        ("adjusted_checks", "check_points", columns_of(book, CHECK_POINTS)),
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
