"""Lines of the two sheets of the calculator, and the addresses in their formulas.

All formulas of the calculator are in column B and refer to column B, named ranges and constants. In
the texts of formulas, `[dip]` denotes the cell of the line "dip", and `#within` the number of this
sentence.
"""

import re
from dataclasses import dataclass

from xlsxwriter.utility import quote_sheetname, xl_rowcol_to_cell

from tankcal.text.digits import NOTHING

VALUES = 1  # column B
NANOMETRE = "1E-9"  # m; tolerance for rounding, so that the input 0.35 finds the row 0.35
_CELL, _NUMBER = re.compile(r"\[(\w+)\]"), re.compile(r"#(\w+)")


@dataclass(frozen=True)
class Line:
    """Line with label and formula.

    Attributes
    ----------
    key : str
        Key of the cell, and of its label in [calculator.labels].
    formula : str
        Formula without "=", in the notation of this module; "": the line is a value of the record.
    result : float or str
        Result of the formula for the initial dips.
    digits : int, str or None
        Decimals, or a number format; None: text.
    unit : str
        Printed unit.
    strong : bool
        Whether the line is a main result.
    by : str or None
        Key of the U that determines additional decimals.
    remark : str or None
        Key of the line with the sentence beside this line.
    label : str or None
        Label that replaces the label of the key.
    """

    key: str
    formula: str
    result: float | str
    digits: int | str | None = None
    unit: str = ""
    strong: bool = False
    by: str | None = None
    remark: str | None = None
    label: str | None = None


def if_number(condition, expression):
    """Return a formula with a result only if a cell or product of cells is a number."""
    return f'IF(ISNUMBER({condition}),{expression},"{NOTHING}")'


def is_no_number(cell):
    """Return the condition "no number"; LibreOffice, unlike Excel, treats booleans as numbers."""
    return f"OR(ISLOGICAL({cell}),NOT(ISNUMBER({cell})))"


def quoted(text):
    """Escape a text for the quotation marks of a formula."""
    return text.replace('"', '""')


class Places:
    """Addresses of the lines and numbers of the sentences.

    Parameters
    ----------
    book : Book
        Workbook.
    rows : dict
        {key: (code of the sheet, row from 0)}, or with the column as third value.
    sentences : sequence of str
        Keys of the sentences; the first sentence has the number 1.
    """

    def __init__(self, book, rows, sentences):
        self._names = {
            code: book.sheet_name(code) for code in {place[0] for place in rows.values()}
        }
        self._rows = rows
        self._numbers = {key: number for number, key in enumerate(sentences, start=1)}

    def number(self, sentence):
        """Return the number of a sentence."""
        return self._numbers[sentence]

    def place(self, key):
        """Return sheet, row and, unless it is column B, the column of a cell, from 0."""
        return self._rows[key]

    def row(self, key):
        """Return the row of a line, from 0."""
        return self._rows[key][1]

    def formula(self, text, sheet):
        """Return a formula with addresses for the sheet with a code."""

        def cell(match):
            code, row, *column = self._rows[match[1]]
            place = "" if code == sheet else quote_sheetname(self._names[code]) + "!"
            return place + xl_rowcol_to_cell(row, *(column or (VALUES,)))

        numbered = _NUMBER.sub(lambda match: str(self._numbers[match[1]]), text)
        return "=" + _CELL.sub(cell, numbered)
