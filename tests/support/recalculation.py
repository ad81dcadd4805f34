"""Workbooks recalculated by LibreOffice: all of their formulas, or their calculator many times."""

import re
import shutil
import subprocess

import openpyxl
import pytest
from openpyxl.utils import get_column_letter

from tankcal.report.workbook.book import Book
from tankcal.report.workbook.calculator import calculator_sheets, factor_sheets
from tankcal.report.workbook.capacity import capacity_sheet, densities_sheet
from tankcal.text.words import translate_record

FIRST_COLUMN = 6  # of the copies of the calculator: F and on, its own is B
_CELL = re.compile(r"\bB(\d+)\b")
_WITH_FORMULAS = ("dip_calculator", "workings")
_READ = (
    *("capacity", "other_densities", "covariance_factor", "covariance_weights", "quantity"),
    "quantity_workings",
    *_WITH_FORMULAS,
)


def recalculated(sources, folder):
    """Workbooks as LibreOffice calculates them, in one start of it; skips without soffice.

    They have results and no formulas; `sources` have different names.
    """
    soffice = shutil.which("soffice") or shutil.which("libreoffice")
    if soffice is None:
        pytest.skip("LibreOffice (soffice) is not installed: the formulas cannot be recalculated")
    out = folder / "recalculated"
    out.mkdir()
    profile = f"-env:UserInstallation={(folder / 'profile').as_uri()}"
    arguments = ["--convert-to", "xlsx", "--outdir", str(out), *map(str, sources)]
    subprocess.run(
        [soffice, profile, "--headless", *arguments], check=True, capture_output=True, timeout=200
    )
    return [openpyxl.load_workbook(out / source.name, data_only=True) for source in sources]


def without_results(path, words):
    """(path of a copy, {(sheet, address): stored result} of every formula).

    The copy has the formulas but nothing to show for them, and of the other sheets those that
    formulas read.
    """
    stored, book = openpyxl.load_workbook(path, data_only=True), openpyxl.load_workbook(path)
    found = {
        (sheet.title, cell.coordinate): stored[sheet.title][cell.coordinate].value
        for sheet in book
        for row in sheet
        for cell in row
        if cell.data_type == "f"
    }
    read = {words["workbook"]["sheets"][code] for code in _READ}
    for name in set(book.sheetnames) - read - {sheet for sheet, _ in found}:
        del book[name]
    copy = path.with_name(f"without-results-{path.name}")
    book.save(copy)
    return copy, found


class Calculator:
    """The calculator of a recalculated workbook, as it was copied for some cases.

    words    of its language
    columns  those of the cases, a slice from 0
    """

    def __init__(self, book, words, columns):
        self._book, self._words, self._columns = book, words, columns

    def line(self, key):
        """Results of one line of the form, or of the workings, case by case."""
        label = self._words["calculator"]["labels"][key]
        for code in _WITH_FORMULAS:
            for row in self._book[self._words["workbook"]["sheets"][code]].iter_rows(min_row=5):
                if row[0].value == label:
                    return [cell.value for cell in row[self._columns]]
        raise KeyError(label)

    def sentences(self, key):
        """What is said of one input, case by case."""
        ((sheet, cells),) = self._book.defined_names["calculator_sentences"].destinations
        said = [row[0].value for row in self._book[sheet][cells]]
        return [said[number - 1] for number in self.line(key)]


def calculators(groups, words, folder):
    """{name: Calculator} of groups of cases, all recalculated in one start of LibreOffice.

    words   of the language of the workbooks
    groups  {name: (record, cases)}, cases [{name of an input cell: what is typed}]; what a case
            does not name stays as it is; groups of one record share a workbook
    """
    records = {id(record): record for record, _ in groups.values()}
    places, sources = {}, []
    for number, (key, record) in enumerate(records.items()):
        cases = []
        for name, (of, own) in groups.items():
            if id(of) == key:
                first = FIRST_COLUMN - 1 + len(cases)
                places[name] = number, slice(first, first + len(own))
                cases += own
        path, source = folder / f"written-{number}.xlsx", folder / f"cases-{number}.xlsx"
        _write(translate_record(words, record), words, path)
        _copied(path, words, cases, source)
        sources.append(source)
    books = recalculated(sources, folder)
    return {
        name: Calculator(books[number], words, columns)
        for name, (number, columns) in places.items()
    }


def _write(record, words, path):
    """Only the calculator and what it reads, of a whole workbook."""
    with Book(path, record, words) as book:
        for sheet in (capacity_sheet, densities_sheet, calculator_sheets, factor_sheets):
            sheet(book, record)


def _copied(path, words, cases, out):
    """Save a workbook with the column of its calculator copied for each case."""
    book = openpyxl.load_workbook(path)
    form, workings = (words["workbook"]["sheets"][code] for code in _WITH_FORMULAS)
    inputs = {}
    for name, defined in book.defined_names.items():
        ((sheet, cell),) = defined.destinations
        if sheet == form and ":" not in cell:
            inputs[cell.replace("$", "")] = name
    for sheet in (form, workings):
        column = [row[1] for row in book[sheet].iter_rows(min_row=5) if row[1].value is not None]
        blank = [book[sheet][cell] for cell in inputs if sheet == form]
        for cell in {cell.coordinate: cell for cell in [*column, *blank]}.values():
            name = inputs.get(cell.coordinate) if sheet == form else None
            for place, case in enumerate(cases, start=FIRST_COLUMN):
                value, letter = cell.value, get_column_letter(place)
                if name in case:
                    value = case[name]
                elif cell.data_type == "f":
                    value = _CELL.sub(rf"{letter}\1", value)
                book[sheet].cell(cell.row, place).value = value
    book.save(out)
