"""The sheet Observations: one row a reading of an adjusted survey."""

from math import pi

from tankcal.record.plain_data import rows_of
from tankcal.report.workbook.look import values_of
from tankcal.report.workbook.tables import set_widths
from tankcal.text.words import observation_name

MOST_ROWS = 5_000  # of the sheet: those with the largest |w|
SMALL = {"mm": ("µm", 1e3), "m": ("mm", 1e3), "rad": ("″", 648000 / pi)}
_LARGE = {"rad": ("°", 180 / pi)}
_HEAD_ROW = 3


def observations_sheet(book, record):
    """One row a reading, to be filtered; those set aside stand back and say so."""
    readings = record["adjustment"]["residuals"]
    count = len(readings["w"])
    subtitle = book.word("texts.residuals_subtitle")
    if count > MOST_ROWS:
        subtitle = book.word("texts.worst_subtitle", shown=MOST_ROWS, all=count)
        readings = _worst(readings)
    rows = rows_of(readings)
    sheet = book.sheet("observations", subtitle, landscape=True)
    columns = _columns(book, rows)
    set_widths(book, sheet, columns)
    muted = [i for i, row in enumerate(rows) if row["removed"]]
    book.table(sheet, _HEAD_ROW, "observations", columns, muted=muted, autofilter=True)
    book.freeze(sheet, _HEAD_ROW, 1)


def _worst(readings):
    """The worst readings, in their order: those set aside first, then by test quantity."""
    rank = [
        (not removed, -abs(w or 0.0))
        for removed, w in zip(readings["removed"], readings["w"], strict=True)
    ]
    kept = sorted(sorted(range(len(rank)), key=rank.__getitem__)[:MOST_ROWS])
    return {key: [values[i] for i in kept] for key, values in readings.items()}


def _use(row):
    return "set_aside" if row["removed"] else "compared" if row["check"] else "adjusted"


def _columns(book, rows):
    words, elements = book.words, book.words["elements"]
    large = [_LARGE.get(row["unit"], (row["unit"], 1.0)) for row in rows]
    small = [SMALL.get(row["unit"], (row["unit"], 1.0)) for row in rows]

    def in_unit(key, units):
        return [
            None if row[key] is None else row[key] * unit[1]
            for row, unit in zip(rows, units, strict=True)
        ]

    decimals = [
        1 if row["unit"] in ("mm", "rad") else 2 if row["unit"] == "m" else 6 for row in rows
    ]
    uses = {use: book.word(f"uses.{use}") for use in ("set_aside", "compared", "adjusted")}
    rows_in_file = ["" if row["row"] is None else row["row"] for row in rows]
    return [
        book.column("observation", [observation_name(words, row) for row in rows], None, 20),
        book.column("between", [" – ".join(map(str, row["ids"])) for row in rows], None, 24),
        book.column("element", [elements.get(r["element"], r["element"]) for r in rows], None, 9),
        book.column("observed", in_unit("value", large), 4, 12),
        book.column("unit", [unit[0] for unit in large], None, 7),
        book.column("residual", in_unit("residual", small), decimals, 10),
        book.column("sd", in_unit("sd", small), decimals, 8),
        book.column("mdb", in_unit("mdb", small), decimals, 9),
        book.column("small_unit", [unit[0] for unit in small], None, 7),
        book.column("redundancy", values_of(rows, "redundancy"), 3, 9),
        book.column("w", values_of(rows, "w"), 2, 8),
        book.column("tau", values_of(rows, "tau"), 2, 8),
        book.column("effect_mm", values_of(rows, "effect_m", 1e3), 2, 9),
        book.column("use", [uses[_use(row)] for row in rows], None, 11),
        book.column("readings", values_of(rows, "repeats"), 0, 9),
        book.column("file", values_of(rows, "file"), None, 22),
        book.column("row", rows_in_file, 0, 7),
    ]
