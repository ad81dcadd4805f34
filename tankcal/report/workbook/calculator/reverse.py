"""From a volume back to its dip: a straight line between two rows, as the table is read.

A volume that stands in the table at more than one dip (rows of equal volume) has none.
"""

from bisect import bisect_left, bisect_right

from tankcal.report.workbook.calculator.cells import NANOMETRE, Line, is_no_number
from tankcal.text.digits import NOTHING

_CUBIC_MICROMETRE = "1E-12"


def finding(table, number):
    """Lines that find the volume of the input `wanted` in the table."""
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
    """(last, first) row of the volume that the workbook opens with."""
    volume = table.volume_m3[table.at]
    last = bisect_right(table.volume_m3, volume) - 1
    return last, min(bisect_left(table.volume_m3, volume), last)


def _state(table):
    """What is said of that volume."""
    row, first = _rows(table)
    if not table.rises:
        return "volumes_fall"
    return "no_single_dip" if first < row else "wanted_within"


def _when_typed(key, expression, result, digits=0, unit="", otherwise='"–"'):
    formula = f"IF([wanted_typed]=#wanted_within,{expression},{otherwise})"
    return Line(key, formula, result, digits, unit)


def results(table):
    """The line of the dip that holds the volume."""
    formula = 'IF([wanted_state]=#wanted_within,[wanted_dip],"–")'
    found = table.height_m[table.at] if _state(table) == "wanted_within" else NOTHING
    return [Line("dip_of_volume", formula, found, table.digits + 1, "m", strong=True)]
