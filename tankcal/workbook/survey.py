"""The sheets of an adjusted survey: Adjustment, Observations, Cameras and photos."""

from math import pi

from tankcal.uncertainty import decimals_for
from tankcal.words import (
    as_sentence,
    datum_sentences,
    global_test_sentence,
    group_name,
    observation_name,
    scale_sentence,
    snooping_sentence,
    verdict_sentences,
)
from tankcal.workbook.book import Column, in_mm

MOST_ROWS = 20_000  # of the sheet Observations: those with the largest |w|
_WIDTHS = (34, 12, 14, 13, 13, 13, 13, 13, 13, 13, 13, 18)
_HEAD_ROW = 3
_SMALL = {"mm": ("µm", 1e3), "m": ("mm", 1e3), "rad": ("″", 648000 / pi)}
_LARGE = {"rad": ("°", 180 / pi)}


def _of(rows, key, factor=1.0):
    """The values of one key, row by row, times a factor."""
    return [row[key] if row[key] is None or factor == 1.0 else factor * row[key] for row in rows]


def adjustment_sheet(book, record, words):
    """Statistics, groups, datum, instruments and check points of the adjustment."""
    a = record["adjustment"]
    sheet = book.sheet("Adjustment", "Adjustment of the survey", landscape=True)
    book.widths(sheet, *_WIDTHS)
    row = _facts(book, sheet, 3, _statistics(a, words), words)
    row = _sentences(book, sheet, row, words["headings"]["adjusted_datum"],
                     datum_sentences(words, a))  # fmt: skip
    row = _sentences(book, sheet, row, None, [as_sentence(one) for one in a["aside"][:50]])
    for title, name, columns in (
        ("adjusted_groups", "groups", _groups(a["groups"], words)),
        ("adjusted_instruments", "instruments", _instruments(a["instruments"], words)),
        ("adjusted_systems", "systems", _systems(a["systems"])),
        ("adjusted_checks", "check_points", _check_points(a["check_points"])),
    ):
        if columns[0].cells:
            book.heading(sheet, row, words["headings"][title], len(columns))
            row = book.table(sheet, row + 1, name, columns) + 2
        if name == "groups":
            row = _sentences(book, sheet, row, None, verdict_sentences(words, a))


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
        ("mean_sd", in_mm(p.get("mean_sd_m")), '0.00 "mm"'),
        ("spherical_sd", in_mm(p.get("spherical_sd_m")), '0.00 "mm"'),
        ("quadratic_sd", in_mm(p.get("quadratic_sd_m")), '0.00 "mm"'),
        ("extent", p.get("extent_m"), '0.0 "m"'),
        ("proportional", p.get("proportional"), '"1 : "0'),
        ("r_xyz", in_mm(checks.get("r_xyz_m")), '0.00 "mm"'),
        ("largest_difference", in_mm(checks.get("largest_m")), '0.00 "mm"'),
        ("mean_difference", in_mm(checks.get("mean_m")), '0.00 "mm"'),
    ]
    return [line for line in lines if line[1] is not None]


def _facts(book, sheet, row, lines, words):
    for label, value, shown in lines:
        book.put(sheet, row, 0, words["labels"][label])
        if shown is None:
            book.paragraph_in(sheet, row, 1, value, _WIDTHS[1:])
        else:
            book.put(sheet, row, 1, value, num_format=shown, align="left")
        row += 1
    return row + 1


def _sentences(book, sheet, row, title, sentences):
    if not sentences:
        return row
    if title:
        book.heading(sheet, row, title, len(_WIDTHS))
        row += 1
    for sentence in sentences:
        book.paragraph_in(sheet, row, 0, sentence, _WIDTHS)
        row += 1
    return row + 1


def _small(rows, key):
    """Values in their small unit, with the decimals that two digits need."""
    values = [
        None if row[key] is None else row[key] * _SMALL.get(row["unit"], ("", 1.0))[1]
        for row in rows
    ]
    return values, [decimals_for(abs(value)) if value else 1 for value in values]


def _groups(rows, words):
    judged = [row["verdict"] in ("as_declared", "better", "worse") for row in rows]
    intervals = {
        key: [row[key] if good else None for row, good in zip(rows, judged, strict=True)]
        for key in ("factor", "factor_low", "factor_high")
    }
    return [
        Column("Observations", [group_name(words, row) for row in rows], None, 34),
        Column("Values", _of(rows, "count"), 0),
        Column("Set aside", _of(rows, "removed"), 0),
        Column("Smallest sd declared", *_small(rows, "sd_smallest")),
        Column("Largest sd declared", *_small(rows, "sd_largest")),
        Column("Residual rms", *_small(rows, "rms")),
        Column("Unit", [_SMALL.get(row["unit"], ("", 1.0))[0] for row in rows], None),
        Column("Redundancy", _of(rows, "redundancy"), 1),
        Column("Factor: true sd over declared", intervals["factor"], 2),
        Column("95 % interval, low", intervals["factor_low"], 2),
        Column("95 % interval, high", intervals["factor_high"], 2),
        Column("Verdict", [words["verdicts"][row["verdict"]] for row in rows], None, 18),
    ]


def _instruments(rows, words):
    kinds = words["instruments"]
    return [
        Column("Instrument", _of(rows, "instrument"), None, 34),
        Column("Kind", [kinds.get(row["kind"], row["kind"] or "") for row in rows], None),
        Column("Certificate", [row["details"].get("certificate", "") for row in rows], None),
        Column("Scale declared (ppm)", _of(rows, "declared_scale_ppm"), 2),
        Column("sd declared (ppm)", _of(rows, "declared_scale_sd_ppm"), 2),
        Column("Scale estimated (ppm)", _of(rows, "scale_ppm"), 2),
        Column("sd estimated (ppm)", _of(rows, "scale_sd_ppm"), 2),
        Column("Offset declared (mm)", _of(rows, "declared_offset_mm"), 2),
        Column("sd declared (mm)", _of(rows, "declared_offset_sd_mm"), 2),
        Column("Offset estimated (mm)", _of(rows, "offset_mm"), 2),
        Column("sd estimated (mm)", _of(rows, "offset_sd_mm"), 2),
    ]


def _systems(rows):
    return [
        Column("System", _of(rows, "system"), None, 34),
        *(Column(f"{axis} (m)", _of(rows, f"{axis}_m"), 4) for axis in "xyz"),
        *(Column(f"{sign} (°)", _of(rows, f"{key}_deg"), 5) for sign, key in _ANGLES),
        Column("Scale (ppm)", _of(rows, "scale_ppm"), 1),
        Column("its sd (ppm)", _of(rows, "scale_sd_ppm"), 1),
    ]


_ANGLES = (("ω", "omega"), ("φ", "phi"), ("κ", "kappa"))


def _check_points(found):
    rows = found["points"] if found else []
    return [
        Column("Check point", _of(rows, "point"), None, 34),
        *(Column(f"Δ{axis} (mm)", _of(rows, f"d{axis}_m", 1e3), 2) for axis in "xyz"),
        Column("Magnitude (mm)", _of(rows, "size_m", 1e3), 2),
        *(Column(f"sd {axis} (mm)", _of(rows, f"s{axis}_m", 1e3), 2) for axis in "xyz"),
        Column("Largest w", _of(rows, "largest_w"), 1),
    ]


def observations_sheet(book, record, words):
    """One row a reading, to be filtered; those set aside stand back and say so."""
    readings = record["adjustment"]["residuals"]
    rows = readings
    if len(rows) > MOST_ROWS:
        worst = sorted(range(len(rows)), key=lambda i: _rank(rows[i]))[:MOST_ROWS]
        rows = [readings[i] for i in sorted(worst)]
    left = "" if len(rows) == len(readings) else (
        f"; {len(rows)} of {len(readings)} are here, those set aside and those with the largest "
        "test quantities; all are in residuals.csv"
    )  # fmt: skip
    sheet = book.sheet(
        "Observations",
        "Observations and residuals",
        f"residual: computed minus observed{left}",
        landscape=True,
    )
    columns = _reading_columns(rows, words)
    book.widths(sheet, *(column.width for column in columns))
    muted = [i for i, row in enumerate(rows) if row["removed"]]
    book.table(sheet, _HEAD_ROW, "observations", columns, muted=muted, autofilter=True)
    sheet.freeze_panes(_HEAD_ROW + 1, 1)
    sheet.repeat_rows(_HEAD_ROW)


def _rank(row):
    """Set aside first, then by test quantity, the largest first."""
    return (not row["removed"], -abs(row["w"] or 0.0))


def _use(row):
    return "set aside" if row["removed"] else "compared" if row["check"] else "adjusted"


def _reading_columns(rows, words):
    elements = words["elements"]
    large = [_LARGE.get(row["unit"], (row["unit"], 1.0)) for row in rows]
    small = [_SMALL.get(row["unit"], (row["unit"], 1.0)) for row in rows]

    def in_unit(key, units):
        return [
            None if row[key] is None else row[key] * unit[1]
            for row, unit in zip(rows, units, strict=True)
        ]

    decimals = [1 if row["unit"] in ("mm", "rad") else 2 if row["unit"] == "m" else 6
                for row in rows]  # fmt: skip
    return [
        Column("Observation", [observation_name(words, row) for row in rows], None, 20),
        Column("Of", [" – ".join(map(str, row["ids"])) for row in rows], None, 24),
        Column("Element", [elements.get(r["element"], r["element"]) for r in rows], None, 9),
        Column("Observed", in_unit("value", large), 4, 14),
        Column("Unit", [unit[0] for unit in large], None, 7),
        Column("Residual", in_unit("residual", small), decimals, 11),
        Column("sd", in_unit("sd", small), decimals, 10),
        Column("MDB", in_unit("mdb", small), decimals, 11),
        Column("Small unit", [unit[0] for unit in small], None, 7),
        Column("Redundancy", _of(rows, "redundancy"), 3, 11),
        Column("w", _of(rows, "w"), 2, 9),
        Column("tau", _of(rows, "tau"), 2, 9),
        Column("Effect (mm)", _of(rows, "effect_m", 1e3), 2, 10),
        Column("Use", [_use(row) for row in rows], None, 11),
        Column("Readings", _of(rows, "repeats"), 0, 9),
        Column("File", _of(rows, "file"), None, 22),
        Column("Row", ["" if row["row"] is None else row["row"] for row in rows], 0, 8),
    ]


def cameras_sheet(book, record, words):
    """Interior orientation with correlations, and the photographs; no sheet without any."""
    a = record["adjustment"]
    if not a["photos"]:
        return
    sheet = book.sheet("Cameras and photos", "Cameras and photographs", landscape=True)
    columns = _photos(a["photos"])
    book.widths(sheet, *(column.width for column in columns))
    book.heading(sheet, _HEAD_ROW, words["headings"]["adjusted_photos"], len(columns))
    row = book.table(sheet, _HEAD_ROW + 1, "photos", columns, autofilter=True) + 2
    for number, camera in enumerate(a["cameras"], 1):
        name = camera["camera"]
        if camera["photos"] is not None:
            name = f"{name}: {', '.join(map(str, camera['photos']))}"[:200]
        book.heading(sheet, row, name, len(columns))
        convention = words["conventions"][camera["convention"]]
        book.put(sheet, row + 1, 0, f"{convention}; affinity {camera['affinity']}")
        row = book.table(sheet, row + 2, f"camera_{number}", _camera(camera, words)) + 2


def _photos(rows):
    return [
        Column("Photo", _of(rows, "photo"), None, 16),
        Column("Camera", _of(rows, "camera"), None, 16),
        *(Column(f"{axis} (m)", _of(rows, f"{axis}_m"), 4, 12) for axis in "xyz"),
        *(Column(f"{sign} (°)", _of(rows, f"{key}_deg"), 5, 12) for sign, key in _ANGLES),
        *(Column(f"sd {axis} (mm)", _of(rows, f"s{axis}_m", 1e3), 2, 10) for axis in "xyz"),
        *(Column(f"sd {s} (″)", _of(rows, f"s_{key}_deg", 3600.0), 1, 10) for s, key in _ANGLES),
        Column("Points", _of(rows, "points"), 0, 9),
        Column("rms (µm)", _of(rows, "rms_mm", 1e3), 1, 9),
    ]


def _camera(camera, words):
    names = words["parameters"]
    parameters = camera["parameters"]
    shown = [names.get(one, one) for one in parameters]
    scientific = [not name.startswith(("c", "x0", "y0")) for name in parameters]
    form = ["0.00E+00" if one else "0.0000" for one in scientific]
    columns = [
        Column("Parameter", shown, None, 12),
        Column("Unit", camera["units"], None, 8),
        Column("Estimated", camera["values"], form, 14),
        Column("sd", [sd or None for sd in camera["sds"]], form, 12),
        Column("One value for", [words["scopes"][one] for one in camera["scopes"]], None, 14),
        Column("State", [words["states"][one] for one in camera["states"]], None, 10),
        Column("Effect at the edge (µm)", camera["edge_um"], 1, 12),
    ]
    for place, name in enumerate(camera["free"]):
        r = [
            camera["correlation"][camera["free"].index(one)][place] if one in camera["free"]
            else None for one in parameters
        ]  # fmt: skip
        columns.append(Column(f"r with {names.get(name, name)}", r, 2, 10))
    return columns
