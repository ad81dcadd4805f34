"""From a dip to its volume: the lines that find the row, and the results that are read there.

The last row of the table is the shell's top, any number of metres; the sheets print it rounded.
Whoever types what is printed there gets that row; anything above both is refused.
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
    """Lines: where the table begins and ends, as dips may be typed."""
    first, last = table.height_m[0], table.height_m[-1]
    top = f"MAX(MAX(capacity_height),ROUND(MAX(capacity_height),{table.digits}))"
    return [
        Line("first", "MIN(capacity_height)", first, table.digits, "m"),
        Line("last", top, max(last, round(last, table.digits)), table.digits, "m"),
    ]


def finding(dip, table, row, number):
    """Lines that find the dip of the input `dip` in the table; refused, there is no row.

    row     number of the row that the workbook opens with
    number  of a sentence, by its key
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
    found = f"[{dip}_row]"
    return [
        Line(f"{dip}_state", state, number("within"), 0),
        Line(f"{dip}_row", f'IF([{dip}_state]=#within,{where},"{NOTHING}")', row + 1, 0),
        Line(
            f"{dip}_next",
            if_number(found, f"MIN({found}+1,ROWS(capacity_height))"),
            table.after(row) + 1,
            0,
        ),
        Line(
            f"{dip}_part",
            if_number(
                found,
                f"IF(OR([{dip}_next]={found},[{dip}]-{below}<{NANOMETRE}),0,"
                f"([{dip}]-{below})/({above}-{below}))",
            ),
            0,
            6,
        ),
        Line(
            f"{dip}_volume",
            if_number(found, f"{low}+[{dip}_part]*({high}-{low})"),
            table.volume_m3[row],
            LITRE_DECIMALS,
            "m³",
        ),
    ]


def row_of_U(table):
    """The line with the number of the row whose U, k and u are shown: the one with the larger U."""
    larger = "IF(INDEX(capacity_U,[dip_row])>INDEX(capacity_U,[dip_next]),[dip_row],[dip_next])"
    formula = if_number("[dip_row]", f"IF([dip_part]=0,[dip_row],{larger})")
    return Line("row_of_U", formula, table.at + 1, 0)


def results(table, words):
    """Lines of the result of a dip."""
    simulated = words["intervals"]["monte_carlo"]
    found, capacity, at = "[dip_row]", table.capacity, table.at
    k = "INDEX(capacity_k,[row_of_U])"
    if table.has_interval:
        k = f'IF([interval]="{quoted(simulated)}","{NOTHING}",{k})'
    u_of_row = if_number(found, "INDEX(capacity_standard_u,[row_of_U])")
    lines = [
        Line("volume", "[dip_volume]", table.volume_m3[at], LITRE_DECIMALS, "m³", True, "expanded"),
        Line(
            "expanded",
            if_number(found, "INDEX(capacity_U,[row_of_U])"),
            table.U_m3[at],
            0,
            "m³",
            True,
            "expanded",
        ),
        Line("k", if_number(found, k), NOTHING if table.k[at] is None else table.k[at], 2),
        Line("standard", u_of_row, capacity["u_m3"][at], 0, "m³", by="standard"),
    ]
    if table.has_interval:
        lines += _interval(table, words)
    if table.reference_m is not None:
        ullage = table.reference_m - table.height_m[at]
        formula = if_number(found, "[reference_height]-[dip]")
        lines.append(Line("ullage", formula, ullage, table.digits, "m"))
        lines.append(Line("reference_height", "", table.reference_m, table.digits, "m"))
    return lines


def _interval(table, words):
    """Lines: the ends of the interval that counts, of a row its own, and where it comes from."""
    capacity, at = table.capacity, table.at

    def end(name, sign):
        own, beside = f"INDEX(capacity_{name},[dip_row])", f"[volume]{sign}[expanded]"
        return if_number("[dip_row]", f"IF([dip_part]=0,{own},{beside})")

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
