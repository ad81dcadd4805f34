"""The dip calculator: a form with formulas, and the sheets that the formulas read.

The form computes the volume of a dip with U, in service and at the temperature of the product. It
also computes the dip of a volume, and a delivery between two dips with its U. Input outside the
table is refused with a message.

The sheet Dip calculator with the form, and the sheet Workings with intermediate results.

The formulas use only functions of both Excel 2007 and LibreOffice, without macros and arrays.
Sentences and products are cells of the workings. Formulas refer to them by number and contain no
texts.

Volume of a dip: lines that determine the row of the table, and lines of the result.

The last row of the table is the top of the shell, whose height the sheets print rounded. The
rounded height is accepted as input for this row. A dip above both heights is refused.
"""

from dataclasses import dataclass

from tankcal.report.uncertainty.capacity import ends_of_high_legs
from tankcal.report.workbook.calculator import delivery, service
from tankcal.report.workbook.calculator.service import (
    CODES,
    KEYS,
    SHELL_C,
    number,
    refused_word,
    sentences,
)
from tankcal.report.workbook.calculator.table import (
    NANOMETRE,
    VALUES,
    Line,
    Places,
    Table,
    column_names,
    factor_sheets,
    if_number,
    is_no_number,
    quoted,
)
from tankcal.report.workbook.look import ACCENT, INPUT, MUTED, number_format
from tankcal.text.digits import LITRE_DECIMALS, NOTHING, bound_of_decimals, fixed, shortest
from tankcal.text.words import marks_of, name_of_input

__all__ = ["calculator_sheets", "factor_sheets"]


FORM, WORKINGS = "dip_calculator", "workings"
_WIDTHS = (54, 30, 9, 62)  # widths of the columns, letters
_REMARKS = 3  # column D
_FIRST_ROW = 3
_WRONG = "#B00020"  # colour of refusals


@dataclass(frozen=True)
class Block:
    """Lines below a heading of [calculator.headings]."""

    heading: str
    lines: list


def calculator_sheets(book, record):
    """Write the form and its workings; the initial dip is the middle row of the table."""
    table = Table(record)
    inputs = inputs_of(table)
    results, workings = _results(book, table), _workings(book, table)
    first_results = _FIRST_ROW + len(inputs) + 2
    rows = {entry.key: (FORM, _FIRST_ROW + 1 + place) for place, entry in enumerate(inputs)}
    rows |= _rows(results, FORM, first_results) | _rows(workings, WORKINGS, _FIRST_ROW)
    places = Places(book, rows, KEYS)
    texts = sentences(book, table)
    sheet = book.sheet(FORM, _units(book, table), tab="input")
    book.widths(sheet, *_WIDTHS)
    book.heading(sheet, _FIRST_ROW, _heading(book, "inputs"), len(_WIDTHS))
    for entry in inputs:
        write_input(book, sheet, places.row(entry.key), entry)
    last = _Writer(book, sheet, FORM, places, table).blocks(results, first_results)
    remarks = [(entry.key, entry.check) for entry in inputs]
    remarks += [(line.key, line.remark) for block in results for line in block.lines if line.remark]
    numbers = {line.key: line.result for block in workings for line in block.lines}
    for key, check in remarks:
        _remark(book, sheet, places, key, check, texts[numbers[check] - 1])
    if table.reference_m is not None:
        row = places.row("reference_height")
        book.name("reference_height", sheet, row, row, VALUES)
    _notes(book, sheet, last, table)
    sheet.set_selection(places.row("dip"), VALUES, places.row("dip"), VALUES)
    sheet.fit_to_pages(1, 1)
    sheet.activate()
    _workings_sheet(book, workings, places, table, texts)


def _units(book, table):
    """Return the remark on units if the capacity table has other units than m and m³."""
    spec = table.job["table"]
    if (spec["height_unit"], spec["volume_unit"]) == ("m", "m3"):
        return ""
    return book.word("texts.units", of="calculator")


def _results(book, table):
    words = book.words
    blocks = [
        Block("volume", results(table, words)),
        Block("service", service.results(table)),
        Block("reverse", delivery.reverse_results(table)),
    ]
    if table.capacity["inputs"]:
        blocks.append(Block("delivery", delivery.results(table, words)))
    return blocks


def _workings(book, table):
    """Return the blocks of intermediate results (list of Block)."""
    marks = marks_of(book.words)

    def density(value):
        return book.word("texts.at_density", of="calculator", density=shortest(value, marks))

    def group(source):
        dof = shortest(source.dof, marks)
        name = name_of_input(book.words, source.name)
        return book.word("texts.variance", of="calculator", input=name, dof=dof)

    blocks = [
        Block("finding", _finding(table, "dip", table.at) + [row_of_U(table)]),
        Block("checks", service.checks(number)),
        Block("product", service.product_lines()),
        Block("head", service.head_lines(table, number, density) + service.roof_lines(table)),
        Block("finding_volume", delivery.finding(table, number)),
    ]
    blocks[0].lines[:0] = ends(table)
    if table.capacity["inputs"]:
        names = column_names(book, table.capacity)
        blocks += [
            Block("finding_low", _finding(table, "low_dip", table.low)),
            Block("finding_high", _finding(table, "high_dip", table.at)),
            Block(
                "differences",
                [delivery.state(table, number), *delivery.differences(table, names)],
            ),
            Block("combining", delivery.combining(table, group)),
        ]
    return blocks


def _finding(table, dip, row):
    return finding(dip, table, row, number)


def _rows(blocks, sheet, row):
    """Return {key: (sheet, row)} of the lines of blocks with heading and empty row."""
    places = {}
    for block in blocks:
        for place, line in enumerate(block.lines, start=row + 1):
            places[line.key] = (sheet, place)
        row += len(block.lines) + 2
    return places


def _heading(book, key):
    return book.word(f"headings.{key}", of="calculator")


class _Writer:
    """Writer of lines: label, formula with result, unit; more decimals for a small U."""

    def __init__(self, book, sheet, code, places, table):
        self._book, self._sheet, self._code = book, sheet, code
        self._places, self._table = places, table

    def blocks(self, blocks, row):
        """Write blocks below each other; return the next row."""
        for block in blocks:
            self._book.heading(self._sheet, row, _heading(self._book, block.heading), len(_WIDTHS))
            for line in block.lines:
                self.line(line)
            row += len(block.lines) + 2
        return row

    def line(self, line: Line):
        """Write a line."""
        row, book = self._places.row(line.key), self._book
        label = line.label or book.word(f"labels.{line.key}", of="calculator")
        strong = {"bold": True, "font_size": 13} if line.strong else {}
        if line.strong:
            self._sheet.set_row(row, 21)
        book.put(self._sheet, row, 0, label, **({"bold": True} if line.strong else {}))
        digits = line.digits
        if line.by and isinstance(digits, int):
            digits = max(digits, self._table.coarse)
        shown = {} if digits is None else {"num_format": number_format(digits)}
        look = book.format(align="right", **shown, **strong)
        if line.formula:
            formula = self._places.formula(line.formula, self._code)
            self._sheet.write_formula(row, VALUES, formula, look, line.result)
        else:
            self._sheet.write_number(row, VALUES, line.result, look)
        book.put(self._sheet, row, 2, line.unit, indent=1)
        if line.by:
            self._add_decimals(row, line.by, range(digits + 1, self._table.finest + 1))

    def _add_decimals(self, row, U_key, finer):
        """Add conditional formats with more decimals for smaller values of the U of a line."""
        for digits in reversed(finer):
            bound = f"{bound_of_decimals(digits):.10g}"
            cell = f"$B${self._places.row(U_key) + 1}"
            self._sheet.conditional_format(
                row,
                VALUES,
                row,
                VALUES,
                {
                    "type": "formula",
                    "criteria": f"=AND(ISNUMBER({cell}),{cell}<{bound})",
                    "format": self._book.format(num_format=number_format(digits)),
                    "stop_if_true": True,
                },
            )


def _remark(book, sheet, places, key, check, text):
    """Write the sentence on a line into column D; refusals are red."""
    row = places.row(key)
    formula = places.formula(f"INDEX(calculator_sentences,[{check}])", FORM)
    look = book.format(font_color=ACCENT, text_wrap=True, align="left")
    sheet.write_formula(row, _REMARKS, formula, look, text)
    refused = refused_word(book)
    criteria = f'=LEFT($D${row + 1},{len(refused)})="{quoted(refused)}"'
    wrong = book.format(font_color=_WRONG, bold=True)
    rule = {"type": "formula", "criteria": criteria, "format": wrong}
    sheet.conditional_format(row, _REMARKS, row, _REMARKS, rule)


def _notes(book, sheet, row, table):
    """Write the notes below the results."""
    values = {
        "temperature": shortest(
            table.job["table"]["reference_temperature_c"], marks_of(book.words)
        ),
        "capacity": book.sheet_name("capacity"),
        "deliveries": book.sheet_name("deliveries"),
        "factor": book.sheet_name("covariance_factor"),
        "workings": book.sheet_name(WORKINGS),
        "budget": book.sheet_name("budget"),
        "corrections": book.sheet_name("corrections"),
        "capacity_mm": book.sheet_name("capacity_mm"),
    }
    keys = ("volume", "service", "product", "delivery", "hidden")
    texts = [book.word(f"notes.{key}", of="calculator", **values) for key in keys]
    if book.paper.record.get("on_high_legs"):
        texts.insert(0, book.paper.word("texts.high_legs", **ends_of_high_legs(book.paper)))
    for text in texts:
        book.paragraph(sheet, row, text, _WIDTHS, font_color=MUTED)
        row += 1


def _workings_sheet(book, blocks, places, table, messages):
    """Write the workings, and the sentences and products to which formulas refer by number."""
    sheet = book.sheet(WORKINGS, book.word("texts.workings", of="calculator"), tab="origin")
    book.widths(sheet, 64, 24, 9, 30)
    writer = _Writer(book, sheet, WORKINGS, places, table)
    row = writer.blocks(blocks, _FIRST_ROW)
    products = [book.word(f"products.{code}", of="calculator") for code in CODES]
    for heading, name, texts in (
        ("products", "product_groups", products),
        ("sentences", "calculator_sentences", messages),
    ):
        book.heading(sheet, row, _heading(book, heading), len(_WIDTHS))
        for place, text in enumerate(texts, start=row + 1):
            book.put(sheet, place, 0, text)
        book.name(name, sheet, row + 1, row + len(texts), 0)
        row += len(texts) + 2


# ---- volume of a dip


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


# ---- input cells


@dataclass(frozen=True)
class Input:
    """Input cell of the form.

    Attributes
    ----------
    key : str
        Key of the cell and of its label.
    value : float or None
        Initial value; None: blank.
    digits : int
        Decimals.
    unit : str
        Printed unit.
    low, high : float or None
        Limits of a number; None: a choice from the list of products.
    check : str
        Key of the line with the sentence beside the cell.
    name : str
        Name of the cell, which does not depend on the language.
    """

    key: str
    value: float | None
    digits: int
    unit: str
    low: float | None
    high: float | None
    check: str
    name: str


def inputs_of(table):
    """Return the inputs from the top: dip and product, a volume, a delivery (list of Input)."""
    heights, volumes = table.height_m, table.volume_m3
    ends = heights[0], max(heights[-1], round(heights[-1], table.digits))
    base = table.job["table"]["reference_temperature_c"]
    liquid_c = service.LEAST_C, service.MOST_C
    densities = service.LEAST_KG_M3, service.MOST_KG_M3
    factors = service.LEAST_FACTOR, service.MOST_FACTOR
    most_m3 = max(max(volumes), round(max(volumes), 3))

    def dip(key, row, name):
        return Input(key, heights[row], table.digits, "m", *ends, f"{key}_state", name)

    inputs = [
        dip("dip", table.at, "dip_m"),
        Input("shell", base, 1, "°C", *SHELL_C, "shell_state", "shell_temperature"),
        Input("product", None, 0, "", None, None, "product_state", "product_chosen"),
        Input("density", None, 1, "kg/m³", *densities, "density_state", "density_at_base"),
        Input("liquid", base, 1, "°C", *liquid_c, "liquid_state", "liquid_temperature"),
        Input("factor", None, 5, "", *factors, "factor_state", "own_factor"),
        Input(
            "wanted",
            volumes[table.at],
            3,
            "m³",
            min(volumes),
            most_m3,
            "wanted_state",
            "wanted_volume",
        ),
    ]
    if table.capacity["inputs"]:
        inputs += [
            dip("low_dip", table.low, "delivery_low_dip"),
            dip("high_dip", table.at, "delivery_high_dip"),
        ]
    return inputs


def write_input(book, sheet, row, entry):
    """Write an input into column B, with label, unit, name and validation.

    Parameters
    ----------
    book : Book
        Workbook.
    sheet : Sheet
        Sheet of the form.
    row : int
        Row of the cell, from 0.
    entry : Input
        Input to write.
    """
    look = {"bg_color": INPUT, "border": 1, "border_color": ACCENT, "locked": False, "bold": True}
    look |= {"align": "right" if entry.low is not None else "left", "font_size": 11}
    sheet.set_row(row, 18)
    book.put(sheet, row, 0, book.word(f"inputs.{entry.key}", of="calculator"), bold=True)
    if entry.value is None:
        shown = {} if entry.low is None else {"num_format": number_format(entry.digits)}
        sheet.write_blank(row, 1, None, book.format(**look, **shown))
    else:
        book.put(sheet, row, 1, entry.value, num_format=number_format(entry.digits), **look)
    book.put(sheet, row, 2, entry.unit, indent=1)
    book.name(entry.name, sheet, row, row, 1)
    rule = (
        {
            "validate": "list",
            "source": "=product_groups",
            "input_title": book.word("short.product", of="calculator"),
            "input_message": book.word("prompts.product", of="calculator"),
            "error_title": book.word("texts.error_title", of="calculator"),
            "error_message": book.word("errors.product", of="calculator"),
        }
        if entry.low is None
        else _numbers(book, entry)
    )
    sheet.data_validation(row, 1, row, 1, {**rule, "ignore_blank": True})


def _numbers(book, entry):
    marks = marks_of(book.words)
    low, high = _ends(entry, marks)
    values = {"low": low, "high": high, "unit": entry.unit}
    return {
        "validate": "decimal",
        "criteria": "between",
        "minimum": entry.low,
        "maximum": entry.high,
        "input_title": book.word(f"short.{entry.key}", of="calculator"),
        "input_message": book.word(f"prompts.{entry.key}", of="calculator", **values),
        "error_title": book.word("texts.error_title", of="calculator"),
        "error_message": book.word(f"errors.{_kind(entry)}", of="calculator", **values),
    }


def _kind(entry):
    """Return the key of the error message of an input."""
    if entry.check.endswith("dip_state"):
        return "dip"
    return "wanted" if entry.key == "wanted" else "number"


def _ends(entry, marks):
    """Return the smallest and largest value as texts."""
    if entry.unit in ("m", "m³"):
        return fixed(entry.low, entry.digits, marks), fixed(entry.high, entry.digits, marks)
    return shortest(entry.low, marks), shortest(entry.high, marks)
