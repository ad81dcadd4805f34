"""Lines of the calculator's two sheets, and the addresses by which their formulas call each other.

All formulas stand in column B and refer to column B, to named ranges and to constants. In a text
here `[dip]` stands for the cell of the line "dip", `#within` for the number of that sentence.
"""

import re
from dataclasses import dataclass

from xlsxwriter.utility import quote_sheetname

from tankcal.text.digits import NOTHING

VALUES = 1  # column B
NANOMETRE = "1E-9"  # so that 0.35 typed finds the row 0.35, whatever its last bit is
_CELL, _NUMBER = re.compile(r"\[(\w+)\]"), re.compile(r"#(\w+)")


@dataclass(frozen=True)
class Line:
    """One formula with its label, and the result for the dips that the workbook opens with.

    Without a formula it is a value of the record.

    key      of its cell; its label is that of [calculator.labels] unless `label` is given
    formula  without "=", in the terms of this module
    digits   decimals, or a number format, or None: text
    by       key of the U whose size gives more decimals, or None
    remark   key of the line whose sentence stands beside it, or None
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
    """A formula with a result only where a cell or product of cells is a number."""
    return f'IF(ISNUMBER({condition}),{expression},"{NOTHING}")'


def is_no_number(cell):
    """A condition: LibreOffice takes a truth value for a number, Excel does not."""
    return f"OR(ISLOGICAL({cell}),NOT(ISNUMBER({cell})))"


def quoted(text):
    """A text of the words as it stands inside the quotes of a formula."""
    return text.replace('"', '""')


class Places:
    """Where each line stands: addresses for formulas, numbers for sentences.

    rows       {key: (code of the sheet, row from 0)}
    sentences  keys of the sentences, the first has number 1
    """

    def __init__(self, book, rows, sentences):
        self._names = {code: book.sheet_name(code) for code in {code for code, _ in rows.values()}}
        self._rows = rows
        self._numbers = {key: number for number, key in enumerate(sentences, start=1)}

    def number(self, sentence):
        return self._numbers[sentence]

    def row(self, key):
        return self._rows[key][1]

    def formula(self, text, sheet):
        """The formula as it stands on a sheet (by its code)."""

        def cell(found):
            code, row = self._rows[found[1]]
            place = "" if code == sheet else quote_sheetname(self._names[code]) + "!"
            return f"{place}B{row + 1}"

        numbered = _NUMBER.sub(lambda found: str(self._numbers[found[1]]), text)
        return "=" + _CELL.sub(cell, numbered)
