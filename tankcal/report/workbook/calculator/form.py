"""The sheet Dip calculator with the form, and the sheet Workings with intermediate results.

The formulas use only functions of both Excel 2007 and LibreOffice, without macros and arrays.
Sentences and products are cells of the workings. Formulas refer to them by number and contain no
texts.
"""

from dataclasses import dataclass

from tankcal.report.workbook.calculator import delivery, reading, reverse, service
from tankcal.report.workbook.calculator.cells import VALUES, Line, Places, quoted
from tankcal.report.workbook.calculator.factor import column_names
from tankcal.report.workbook.calculator.inputs import inputs_of, write_input
from tankcal.report.workbook.calculator.products import CODES
from tankcal.report.workbook.calculator.sentences import KEYS, number, refused_word, sentences
from tankcal.report.workbook.calculator.table import Table
from tankcal.report.workbook.look import ACCENT, MUTED, number_format
from tankcal.text.digits import bound_of_decimals, shortest
from tankcal.text.words import marks_of, name_of_input

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
        Block("volume", reading.results(table, words)),
        Block("service", service.results(table)),
        Block("reverse", reverse.results(table)),
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
        Block("finding", _finding(table, "dip", table.at) + [reading.row_of_U(table)]),
        Block("checks", service.checks(number)),
        Block("product", service.product_lines()),
        Block("head", service.head_lines(table, number, density) + service.roof_lines(table)),
        Block("finding_volume", reverse.finding(table, number)),
    ]
    blocks[0].lines[:0] = reading.ends(table)
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
    return reading.finding(dip, table, row, number)


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
    for key in ("volume", "service", "product", "delivery", "hidden"):
        text = book.word(f"notes.{key}", of="calculator", **values)
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
