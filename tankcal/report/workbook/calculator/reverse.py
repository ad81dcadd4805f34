"""Dip of a volume, by linear interpolation between two rows of the table.

A volume with more than one dip (rows of equal volume) has no result.
"""

from bisect import bisect_left, bisect_right

from tankcal.report.workbook.calculator.cells import NANOMETRE, Line, is_no_number
from tankcal.text.digits import NOTHING

_CUBIC_MICROMETRE = "1E-12"  # m³; tolerance for rounding


def finding(table, number):
    """Return the lines that determine the dip of the input `wanted` (list of Line)."""
    top = "MAX(MAX(capacity_volume),ROUND(MAX(capacity_volume),3))"
    inside = "IF([wanted_first]<[wanted_row],#no_single_dip,#wanted_within)"
    if table.critical is not None:
        low, high = table.critical
        zone = f"AND([wanted_dip]>{low!r}+{NANOMETRE},[wanted_dip]<{high!r}-{NANOMETRE})"
        inside = f"IF({zone},#wanted_critical,{inside})"
    if not table.rises:
        inside = "#volumes_fall"
    low, high = "INDEX(capacity_volume,[wanted_row])", "INDEX(capacity_volume,[wanted_next])"
    below, above = "INDEX(capacity_height,[wanted_row])", "INDEX(capacity_height,[wanted_next])"
    row, first = _rows(table)
    return [
        Line(
            "wanted_typed",
            f"IF(ISBLANK([wanted]),#wanted_blank,IF({is_no_number('[wanted]')},#no_number,"
            f"IF([wanted]<MIN(capacity_volume)-{_CUBIC_MICROMETRE},#wanted_below,"
            f"IF([wanted]>{top}+{_CUBIC_MICROMETRE},#wanted_above,#wanted_within))))",
            number("wanted_within"),
            0,
        ),
        _when_typed(
            "wanted_row",
            "MATCH(MAX([wanted],MIN(capacity_volume)),capacity_volume,1)",
            row + 1,
        ),
        _when_typed(
            "wanted_next", "MIN([wanted_row]+1,ROWS(capacity_volume))", table.after(row) + 1
        ),
        _when_typed(
            "wanted_first",
            f"IF([wanted]-{low}<={_CUBIC_MICROMETRE},MATCH({low},capacity_volume,0),[wanted_row])",
            first + 1,
        ),
        _when_typed(
            "wanted_dip",
            f"IF(OR([wanted_next]=[wanted_row],[wanted]<={low}),{below},"
            f"{below}+([wanted]-{low})/({high}-{low})*({above}-{below}))",
            table.height_m[row],
            6,
            "m",
        ),
        _when_typed("wanted_state", inside, number(_state(table)), otherwise="[wanted_typed]"),
    ]


def _rows(table):
    """Return (last, first) row with the initial volume."""
    volume = table.volume_m3[table.at]
    last = bisect_right(table.volume_m3, volume) - 1
    return last, min(bisect_left(table.volume_m3, volume), last)


def _state(table):
    """Return the key of the sentence on the initial volume."""
    row, first = _rows(table)
    if not table.rises:
        return "volumes_fall"
    return "no_single_dip" if first < row else "wanted_within"


def _when_typed(key, expression, result, digits=0, unit="", otherwise='"–"'):
    formula = f"IF([wanted_typed]=#wanted_within,{expression},{otherwise})"
    return Line(key, formula, result, digits, unit)


def results(table):
    """Return the line of the dip of the volume, in a list."""
    formula = 'IF([wanted_state]=#wanted_within,[wanted_dip],"–")'
    result = table.height_m[table.at] if _state(table) == "wanted_within" else NOTHING
    return [Line("dip_of_volume", formula, result, table.digits + 1, "m", strong=True)]
