"""The sheet Capacity mm: two plain columns, dip in mm and volume in L, for gauging systems."""

from bisect import bisect_right
from math import ceil, floor

from tankcal.report.uncertainty.sources import critical_zone
from tankcal.report.uncertainty.stated import stated_U_m3
from tankcal.report.workbook.look import Column
from tankcal.text.digits import LITRE_DECIMALS, decimals_of_rows

_SAME_MM = 1e-6  # a row this near to a whole millimetre is that millimetre


def millimetres_sheet(book, record):
    """Every whole millimetre of the table by its own straight lines; blank in a critical zone."""
    capacity = record["capacity"]
    dips, litres, digits = _rows(capacity, critical_zone(record))
    columns = [
        Column(book.word("columns.dip_mm", of="calculator"), dips, 0, 14),
        Column(book.word("columns.volume_l", of="calculator"), litres, digits, 18),
    ]
    book.plain_sheet("capacity_mm", columns, tab="result")


def _rows(capacity, critical):
    """(dips mm, volumes L or None, decimals) of the rows.

    The last row of the table, which is the shell's top, stands at its rounded millimetre, as the
    calculator takes it.
    """
    heights, volumes = capacity["height_m"], capacity["volume_m3"]
    first = ceil(1000 * heights[0] - _SAME_MM)
    last = max(floor(1000 * heights[-1] + _SAME_MM), round(1000 * heights[-1]))
    of_rows = decimals_of_rows(stated_U_m3(capacity), least=LITRE_DECIMALS)
    dips = list(range(first, last + 1))
    litres, digits = [], []
    for dip in dips:
        height = min(dip / 1000, heights[-1])
        row = min(bisect_right(heights, height + _SAME_MM / 1000) - 1, len(heights) - 1)
        after = min(row + 1, len(heights) - 1)
        part = 0.0
        if after > row and height - heights[row] > _SAME_MM / 1000:
            part = (height - heights[row]) / (heights[after] - heights[row])
        volume = volumes[row] + part * (volumes[after] - volumes[row])
        litres.append(None if _is_critical(height, critical) else 1000 * volume)
        digits.append(max(of_rows[row] - LITRE_DECIMALS, 0))
    return dips, litres, digits


def _is_critical(height_m, critical):
    same = _SAME_MM / 1000
    return critical is not None and critical[0] + same < height_m < critical[1] - same
