"""The sheet Dip calculator: a dip in m gives the volume, by formulas that live in the workbook.

Only functions that Excel 2007 and LibreOffice both know. All formulas stand in column B, and all
refer to column B or to the named ranges of the sheet Capacity.

The last row of the table is the shell's top, any number of metres; the sheets print it rounded.
Whoever types what is printed there gets that row; anything above both is refused.
"""

from tankcal.uncertainty import LITRE_DECIMALS, row_decimals
from tankcal.workbook.book import ACCENT, INPUT, MUTED, NONE, number_format
from tankcal.workbook.capacity import digits_of_heights

SHEET = "Dip calculator"
REFUSED = "Refused"
WITHIN = "Within the table."
_NANOMETRE = "1E-9"  # so that 0.35 typed finds the row 0.35, whatever its last bit is
_WIDTHS = (38, 18, 8, 44)

# rows of the sheet, as Excel counts them
_DIP, _MESSAGE = 5, 6
_VOLUME, _EXPANDED, _K, _STANDARD, _ULLAGE = 9, 10, 11, 12, 13
_ROW, _NEXT, _HEIGHT_0, _HEIGHT_1, _VOLUME_0, _VOLUME_1 = range(16, 22)
_PART, _ROW_OF_U, _REFERENCE = range(22, 25)
_SHELL, _CTSH, _IN_SERVICE = 28, 29, 30


def _critical_zone(record):
    """(low, high) dips between which a floating roof forbids the table, or None."""
    if not record["roof"] or not record["job"]["corrections"]["roof"]:
        return None
    roof = {line["code"]: line["value"] for line in record["roof"]}
    return roof["roof_critical_bottom"], roof["roof_critical_top"]


def _formulas(digits_of_height, critical=None):
    """{row of the sheet: formula}; a refused dip leaves no row number and so no result."""
    dip, row, next_row, part = f"B{_DIP}", f"B{_ROW}", f"B{_NEXT}", f"B{_PART}"
    low = f"MIN(capacity_height)-{_NANOMETRE}"
    top = "MAX(capacity_height)"
    high = f"MAX({top},ROUND({top},{digits_of_height}))+{_NANOMETRE}"

    afloat, or_afloat = f'"{WITHIN}"', ""
    if critical is not None:
        zone = f"AND({dip}>{critical[0]!r}+{_NANOMETRE},{dip}<{critical[1]!r}-{_NANOMETRE})"
        afloat = f'IF({zone},"{REFUSED}: critical zone of the roof, not for use.","{WITHIN}")'
        or_afloat = f",{zone}"

    def when_found(expression):
        return f'=IF(ISNUMBER({row}),{expression},"{NONE}")'

    def of_table(name, at):
        return when_found(f"INDEX({name},{at})")

    return {
        _MESSAGE: (
            f'=IF(ISBLANK({dip}),"{REFUSED}: type a dip height in metres.",'
            f'IF(OR(ISLOGICAL({dip}),NOT(ISNUMBER({dip}))),"{REFUSED}: this is not a number.",'
            f'IF({dip}<{low},"{REFUSED}: below the table, which begins at "'
            f'&FIXED(MIN(capacity_height),{digits_of_height},TRUE)&" m.",'
            f'IF({dip}>{high},"{REFUSED}: above the table, which ends at "'
            f'&FIXED({top},{digits_of_height},TRUE)&" m.",{afloat}))))'
        ),
        _ROW: (
            f"=IF(OR(ISLOGICAL({dip}),NOT(ISNUMBER({dip}))),"
            f'"{NONE}",IF(OR({dip}<{low},{dip}>{high}{or_afloat}),"{NONE}",'
            f"MATCH(MAX({dip},MIN(capacity_height))+{_NANOMETRE},capacity_height,1)))"
        ),
        _NEXT: when_found(f"MIN({row}+1,ROWS(capacity_height))"),
        _HEIGHT_0: of_table("capacity_height", row),
        _HEIGHT_1: of_table("capacity_height", next_row),
        _VOLUME_0: of_table("capacity_volume", row),
        _VOLUME_1: of_table("capacity_volume", next_row),
        _PART: when_found(
            f"IF(OR({next_row}={row},{dip}-B{_HEIGHT_0}<{_NANOMETRE}),0,"
            f"({dip}-B{_HEIGHT_0})/(B{_HEIGHT_1}-B{_HEIGHT_0}))"
        ),
        _ROW_OF_U: when_found(
            f"IF({part}=0,{row},"
            f"IF(INDEX(capacity_U,{row})>INDEX(capacity_U,{next_row}),{row},{next_row}))"
        ),
        _VOLUME: when_found(f"B{_VOLUME_0}+{part}*(B{_VOLUME_1}-B{_VOLUME_0})"),
        _EXPANDED: of_table("capacity_U", f"B{_ROW_OF_U}"),
        _K: of_table("capacity_k", f"B{_ROW_OF_U}"),
        _STANDARD: of_table("capacity_standard_u", f"B{_ROW_OF_U}"),
        _ULLAGE: when_found(f"B{_REFERENCE}-{dip}"),
    }


def _results(record, at):
    """{row of the sheet: result} for a dip on row `at` of the table: the record's own values."""
    capacity = record["capacity"]
    after = min(at + 1, len(capacity["height_m"]) - 1)
    height = capacity["height_m"][at]
    results = {
        _MESSAGE: WITHIN,
        _ROW: at + 1,
        _NEXT: after + 1,
        _HEIGHT_0: height,
        _HEIGHT_1: capacity["height_m"][after],
        _VOLUME_0: capacity["volume_m3"][at],
        _VOLUME_1: capacity["volume_m3"][after],
        _PART: 0,
        _ROW_OF_U: at + 1,
        _VOLUME: capacity["volume_m3"][at],
        _EXPANDED: capacity["U_m3"][at],
        _K: capacity["k"][at],
        _STANDARD: capacity["u_m3"][at],
    }
    reference = record["job"]["datum"]["reference_height_m"]
    if reference is not None:
        results[_ULLAGE] = reference - height
    return results


def _lines(digits_of_height, has_reference):
    """(row, label, unit, decimals, whether U sets finer ones) of the lines with a result."""
    lines = [
        (_VOLUME, "Volume", "m³", LITRE_DECIMALS, True),
        (_EXPANDED, "Expanded uncertainty U", "m³", 0, True),
        (_K, "Coverage factor k", "", 2, False),
        (_STANDARD, "Standard uncertainty u", "m³", 0, True),
        (_ROW, "Row of the table at or below the dip", "", 0, False),
        (_NEXT, "Next row", "", 0, False),
        (_HEIGHT_0, "Height of that row", "m", digits_of_height, False),
        (_HEIGHT_1, "Height of the next row", "m", digits_of_height, False),
        (_VOLUME_0, "Volume of that row", "m³", LITRE_DECIMALS, True),
        (_VOLUME_1, "Volume of the next row", "m³", LITRE_DECIMALS, True),
        (_PART, "Part of the way to the next row", "", 4, False),
        (_ROW_OF_U, "Row whose U and k are taken", "", 0, False),
    ]
    if has_reference:
        lines.append((_ULLAGE, "Ullage (reference height less dip)", "m", digits_of_height, False))
    return lines


def _opening_row(record):
    """The middle row of the table, or the next one that may be used."""
    for_use = record["capacity"]["for_use"]
    return next((row for row in range(len(for_use) // 2, len(for_use)) if for_use[row]), 0)


def dip_sheet(book, record):
    """Write the calculator; it opens with the dip on the middle row of the table."""
    height_m = record["capacity"]["height_m"]
    reference = record["job"]["datum"]["reference_height_m"]
    at = _opening_row(record)
    digits = digits_of_heights(height_m)
    sheet = book.sheet(SHEET, "Dip calculator")
    book.widths(sheet, *_WIDTHS)
    book.heading(sheet, _DIP - 2, "Dip", len(_WIDTHS))
    _input_cell(book, sheet, height_m, at, digits)
    book.heading(sheet, _VOLUME - 2, "Result", len(_WIDTHS))
    book.heading(sheet, _ROW - 2, "How it is found", len(_WIDTHS))

    formulas, results = _formulas(digits, _critical_zone(record)), _results(record, at)
    decimals_by_u = row_decimals(record["capacity"]["U_m3"])
    coarse, fine = min(decimals_by_u), max(decimals_by_u)
    for row, label, unit, decimals, set_by_u in _lines(digits, reference is not None):
        strong = {"bold": True} if row in (_VOLUME, _EXPANDED) else {}
        book.put(sheet, row - 1, 0, label, **strong)
        shown = max(decimals, coarse) if set_by_u else decimals
        look = book.format(align="right", num_format=number_format(shown), **strong)
        sheet.write_formula(row - 1, 1, formulas[row], look, results[row])
        book.put(sheet, row - 1, 2, unit, indent=1)
        if set_by_u:
            _digits_by_u(book, sheet, row, range(shown + 1, fine + 1))
    if reference is not None:
        book.put(sheet, _REFERENCE - 1, 0, "Reference height")
        book.put(sheet, _REFERENCE - 1, 1, reference, num_format=number_format(digits))
        book.put(sheet, _REFERENCE - 1, 2, "m", indent=1)
        book.name("reference_height", sheet, _REFERENCE - 1, _REFERENCE - 1, 1)
    book.put(sheet, _MESSAGE - 1, 0, "Check")
    message = book.format(font_color=ACCENT)
    sheet.write_formula(_MESSAGE - 1, 1, formulas[_MESSAGE], message, results[_MESSAGE])
    refused = {"type": "formula", "criteria": f'=LEFT($B${_MESSAGE},{len(REFUSED)})="{REFUSED}"'}
    warning = book.format(font_color="#B00020", bold=True)
    sheet.conditional_format(_MESSAGE - 1, 1, _MESSAGE - 1, 1, {**refused, "format": warning})
    _service(book, sheet, record, coarse, fine)
    _notes(book, sheet, record)


def _service(book, sheet, record, coarse, fine):
    """What the tank holds when its shell is at another temperature: CTSh times the volume."""
    base = record["job"]["table"]["reference_temperature_c"]
    expansion = record["job"]["material"]["expansion_per_k"]
    book.heading(sheet, _SHELL - 2, "In service, at another temperature of the shell", len(_WIDTHS))
    book.put(sheet, _SHELL - 1, 0, "Temperature of the shell: type it", bold=True)
    look = {"bg_color": INPUT, "border": 1, "border_color": ACCENT, "locked": False, "bold": True}
    book.put(sheet, _SHELL - 1, 1, base, num_format="0.0", **look)
    book.put(sheet, _SHELL - 1, 2, "°C", indent=1)
    book.put(sheet, _SHELL - 1, 3, "(7 liquid + ambient)/8 when not insulated")
    book.name("shell_temperature", sheet, _SHELL - 1, _SHELL - 1, 1)
    step = f"{expansion!r}*(B{_SHELL}-{base!r})"
    factor = f'=IF(ISNUMBER(B{_SHELL}),1+2*{step}+({step})^2,"{NONE}")'
    book.put(sheet, _CTSH - 1, 0, "Factor CTSh = 1 + 2 a dT + (a dT)²")
    sheet.write_formula(_CTSH - 1, 1, factor, book.format(num_format="0.000000"), 1.0)
    warm = f'=IF(ISNUMBER(B{_VOLUME}*B{_CTSH}),B{_VOLUME}*B{_CTSH},"{NONE}")'
    shown = max(LITRE_DECIMALS, coarse)
    book.put(sheet, _IN_SERVICE - 1, 0, "Volume at that temperature", bold=True)
    strong = book.format(align="right", num_format=number_format(shown), bold=True)
    at = _opening_row(record)
    sheet.write_formula(_IN_SERVICE - 1, 1, warm, strong, record["capacity"]["volume_m3"][at])
    book.put(sheet, _IN_SERVICE - 1, 2, "m³", indent=1)
    _digits_by_u(book, sheet, _IN_SERVICE, range(shown + 1, fine + 1))


def _input_cell(book, sheet, height_m, at, digits):
    low, high = (f"{height:.{digits}f}" for height in (height_m[0], height_m[-1]))
    book.put(sheet, _DIP - 1, 0, "Dip height: type it in the coloured cell", bold=True)
    look = {"bg_color": INPUT, "border": 1, "border_color": ACCENT, "locked": False, "bold": True}
    book.put(sheet, _DIP - 1, 1, height_m[at], num_format=number_format(digits), **look)
    book.put(sheet, _DIP - 1, 2, "m", indent=1)
    book.put(sheet, _DIP - 1, 3, f"from {low} m to {high} m")
    book.name("dip_m", sheet, _DIP - 1, _DIP - 1, 1)
    sheet.data_validation(
        _DIP - 1,
        1,
        _DIP - 1,
        1,
        {
            "validate": "decimal",
            "criteria": "between",
            "minimum": height_m[0],
            "maximum": max(height_m[-1], round(height_m[-1], digits)),
            "ignore_blank": True,
            "input_title": "Dip height",
            "input_message": f"In metres, from {low} to {high}.",
            "error_title": "Outside the table",
            "error_message": f"The table goes from {low} m to {high} m and is not extended. "
            "Type the dip height in metres, as a number.",
        },
    )
    sheet.set_selection(_DIP - 1, 1, _DIP - 1, 1)


def _digits_by_u(book, sheet, row, finer):
    """Show more decimals where U is small, as the sheet Capacity does."""
    for digits in reversed(finer):
        sheet.conditional_format(
            row - 1,
            1,
            row - 1,
            1,
            {
                "type": "formula",
                "criteria": f"=$B${_EXPANDED}<{0.995 * 10.0 ** (2 - digits):.10g}",
                "format": book.format(num_format=number_format(digits)),
                "stop_if_true": True,
            },
        )


def _notes(book, sheet, record):
    """What the reader has to know about the result, under it."""
    temperature = record["job"]["table"]["reference_temperature_c"]
    notes = (
        "Between two rows of the table the volume follows a straight line. U, k and u are those of "
        "the row with the larger U.",
        f"The volume is that of the tank at {temperature:g} °C, as the sheet Capacity gives it. "
        "A height outside the table is refused, never extrapolated.",
    )
    for row, text in enumerate(notes, start=_IN_SERVICE + 1):
        book.paragraph(sheet, row, text, _WIDTHS, font_color=MUTED)
