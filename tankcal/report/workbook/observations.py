"""The sheet Observations: one row a reading of an adjusted survey."""

from tankcal.record.plain_data import rows_of
from tankcal.report.tables.survey import READINGS, in_their_units
from tankcal.report.workbook.tables import columns_of, set_widths

MOST_ROWS = 5_000  # of the sheet: those with the largest |w|
_HEAD_ROW = 3


def observations_sheet(book, record):
    """One row a reading, to be filtered; those set aside stand back and say so."""
    readings = record["adjustment"]["residuals"]
    count = len(readings["w"])
    subtitle = book.word("texts.residuals_subtitle")
    if count > MOST_ROWS:
        subtitle = book.word("texts.worst_subtitle", shown=MOST_ROWS, all=count)
        readings = _worst(readings)
    rows = rows_of(in_their_units(readings))
    sheet = book.sheet("observations", subtitle, landscape=True)
    columns = columns_of(book, READINGS, rows)
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
