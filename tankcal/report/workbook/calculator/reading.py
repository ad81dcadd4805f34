"""Volume of a dip: lines that determine the row of the table, and lines of the result.

The last row of the table is the top of the shell, whose height the sheets print rounded. The
rounded height is accepted as input for this row. A dip above both heights is refused.
"""

from tankcal.report.workbook.calculator.cells import (
    NANOMETRE,
    Line,
    if_number,
    is_no_number,
    quoted,
)
from tankcal.text.digits import LITRE_DECIMALS, NOTHING


def ends(table):
    """Return the lines of the smallest and largest permissible dip (list of Line)."""
    first, last = table.height_m[0], table.height_m[-1]
    top = f"MAX(MAX(capacity_height),ROUND(MAX(capacity_height),{table.digits}))"
    return [
        Line("first", "MIN(capacity_height)", first, table.digits, "m"),
        Line("last", top, max(last, round(last, table.digits)), table.digits, "m"),
    ]


def finding(dip, table, row, number):
    """Return the lines that determine the row of a dip and its volume.

    Parameters
    ----------
    dip : str
        Key of the input.
    table : Table
        Capacity table.
    row : int
        Row of the initial dip.
    number : callable
        number(key) returns the number of a sentence.

    Returns
    -------
    list of Line
        State, row, next row, fraction between them, and volume. A refused dip has no row.
    """
    inside = "#within"
    if table.critical is not None:
        low, high = table.critical
        zone = f"AND([{dip}]>{low!r}+{NANOMETRE},[{dip}]<{high!r}-{NANOMETRE})"
        inside = f"IF({zone},#critical,#within)"
    state = (
        f"IF(ISBLANK([{dip}]),#dip_blank,IF({is_no_number(f'[{dip}]')},#no_number,"
        f"IF([{dip}]<[first]-{NANOMETRE},#below,IF([{dip}]>[last]+{NANOMETRE},#above,{inside}))))"
    )
    where = f"MATCH(MAX([{dip}],[first])+{NANOMETRE},capacity_height,1)"
    below, above = f"INDEX(capacity_height,[{dip}_row])", f"INDEX(capacity_height,[{dip}_next])"
    low, high = f"INDEX(capacity_volume,[{dip}_row])", f"INDEX(capacity_volume,[{dip}_next])"
    row_cell = f"[{dip}_row]"
    return [
        Line(f"{dip}_state", state, number("within"), 0),
        Line(f"{dip}_row", f'IF([{dip}_state]=#within,{where},"{NOTHING}")', row + 1, 0),
        Line(
            f"{dip}_next",
            if_number(row_cell, f"MIN({row_cell}+1,ROWS(capacity_height))"),
            table.after(row) + 1,
            0,
        ),
        Line(
            f"{dip}_part",
            if_number(
                row_cell,
                f"IF(OR([{dip}_next]={row_cell},[{dip}]-{below}<{NANOMETRE}),0,"
                f"([{dip}]-{below})/({above}-{below}))",
            ),
            0,
            6,
        ),
        Line(
            f"{dip}_volume",
            if_number(row_cell, f"{low}+[{dip}_part]*({high}-{low})"),
            table.volume_m3[row],
            LITRE_DECIMALS,
            "m³",
        ),
    ]


def row_of_U(table):
    """Return the line with the row of the stated U, k and u: the row with the larger U."""
    larger = "IF(INDEX(capacity_U,[dip_row])>INDEX(capacity_U,[dip_next]),[dip_row],[dip_next])"
    formula = if_number("[dip_row]", f"IF([dip_part]=0,[dip_row],{larger})")
    return Line("row_of_U", formula, table.at + 1, 0)


def results(table, words):
    """Return the lines of the result of a dip (list of Line)."""
    simulated = words["intervals"]["monte_carlo"]
    row_cell, capacity, at = "[dip_row]", table.capacity, table.at
    k = "INDEX(capacity_k,[row_of_U])"
    if table.has_interval:
        k = f'IF([interval]="{quoted(simulated)}","{NOTHING}",{k})'
    u_of_row = if_number(row_cell, "INDEX(capacity_standard_u,[row_of_U])")
    lines = [
        Line("volume", "[dip_volume]", table.volume_m3[at], LITRE_DECIMALS, "m³", True, "expanded"),
        Line(
            "expanded",
            if_number(row_cell, "INDEX(capacity_U,[row_of_U])"),
            table.U_m3[at],
            0,
            "m³",
            True,
            "expanded",
        ),
        Line("k", if_number(row_cell, k), NOTHING if table.k[at] is None else table.k[at], 2),
        Line("standard", u_of_row, capacity["u_m3"][at], 0, "m³", by="standard"),
    ]
    if table.has_interval:
        lines += _interval(table, words)
    if table.reference_m is not None:
        ullage = table.reference_m - table.height_m[at]
        formula = if_number(row_cell, "[reference_height]-[dip]")
        lines.append(Line("ullage", formula, ullage, table.digits, "m"))
        lines.append(Line("reference_height", "", table.reference_m, table.digits, "m"))
    return lines


def _interval(table, words):
    """Return the lines of the coverage interval and its method (list of Line).

    Between two rows of the table, the interval is volume ± U.
    """
    capacity, at = table.capacity, table.at

    def end(name, sign):
        end_of_row, volume_and_U = f"INDEX(capacity_{name},[dip_row])", f"[volume]{sign}[expanded]"
        return if_number("[dip_row]", f"IF([dip_part]=0,{end_of_row},{volume_and_U})")

    looks = {"digits": LITRE_DECIMALS, "unit": "m³", "by": "expanded"}
    return [
        Line("low", end("low", "-"), capacity["low_m3"][at], **looks),
        Line("high", end("high", "+"), capacity["high_m3"][at], **looks),
        Line(
            "interval",
            if_number("[dip_row]", "INDEX(capacity_interval,[row_of_U])"),
            words["intervals"][capacity["interval"][at]],
        ),
    ]
