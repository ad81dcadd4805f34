"""Data of a record for the calculator, its initial dips, and the lines of its two sheets.

Lines of the two sheets of the calculator, and the addresses in their formulas.

All formulas of the calculator are in column B and refer to column B, named ranges and constants. In
the texts of formulas, `[dip]` denotes the cell of the line "dip", and `#within` the number of this
sentence.
"""

import math
import re
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, zip_longest

from xlsxwriter.utility import quote_sheetname, xl_rowcol_to_cell

from tankcal.record.covariance_factor import combinations_of, factor_of
from tankcal.report.uncertainty.stated import critical_zone, groups_of, k_of_rows, stated_U_m3
from tankcal.report.workbook.capacity import digits_of_heights
from tankcal.report.workbook.look import Column, height_digits
from tankcal.text.digits import NOTHING, decimals_of_rows
from tankcal.text.words import name_of_input
from tankcal.uncertainty import coverage_factor

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


_FINER_DELIVERY = 2  # additional decimals of a delivery, whose U may be smaller than U of any row


class Table:
    """Capacity table of a record for the calculator.

    Attributes
    ----------
    at : int
        Row of the initial dip: the middle row, or the next row that may be used.
    low : int
        First row that may be used, the lower dip of the initial delivery.
    """

    def __init__(self, record):
        self.record = record
        self.capacity = record["capacity"]
        self.job = record["job"]
        self.height_m, self.volume_m3 = self.capacity["height_m"], self.capacity["volume_m3"]
        for_use = self.capacity["for_use"]
        middle = range(len(for_use) // 2, len(for_use))
        self.at = next((row for row in middle if for_use[row]), 0)
        self.low = next((row for row in range(len(for_use)) if for_use[row]), 0)
        self.U_m3, self.k = stated_U_m3(self.capacity), k_of_rows(self.capacity)
        self.digits = digits_of_heights(self.height_m)
        decimals = decimals_of_rows([*self.U_m3, *self.capacity["u_m3"]])
        self.coarse, self.finest = min(decimals), max(decimals) + _FINER_DELIVERY
        self.critical = critical_zone(record)
        self.reference_m = self.job["datum"]["reference_height_m"]
        self.has_interval = "interval" in self.capacity
        further = [entry["density_kg_m3"] for entry in record["densities"]]
        # kg/m3; the density of the table is the first.
        self.densities = [self.job["table"]["liquid_density_kg_m3"], *further]

    @property
    def rises(self):
        """Whether the volumes never decrease from row to row."""
        return all(low <= high for low, high in pairwise(self.volume_m3))

    def after(self, row):
        """Return the next row, or the last row."""
        return min(row + 1, len(self.height_m) - 1)

    def groups(self):
        """Return the sources of the columns of the factor (list of Group)."""
        return groups_of(self.capacity["input_kind"], self.record["budget"])

    @cached_property
    def differences(self):
        """Differences f(at) - f(low) of the columns of the factor for the initial delivery, m³."""
        factor = factor_of(self.capacity)
        return (factor[self.at] - factor[self.low]).tolist()

    def coverage(self, dof):
        """Return k for infinite and for `dof` degrees of freedom at the probability of the job."""
        probability = self.job["table"]["coverage_probability"]
        return tuple(float(k) for k in coverage_factor(probability, [math.inf, dof]))


# ---- covariance factor

_DIGITS = 6  # decimals of the factor in m³
_WIDTH = 15  # width of a column, letters


def column_names(book, capacity):
    """Return the heading of each column: the input, numbered if it has several columns."""
    kinds = capacity["input_kind"]
    counts, numbers, names = Counter(kinds), Counter(), []
    for kind in kinds:
        numbers[kind] += 1
        name = name_of_input(book.words, kind)
        names.append(name if counts[kind] == 1 else f"{name} {numbers[kind]}")
    return names


def factor_sheets(book, record):
    """Write the kept rows of the factor in m³, and the weights by which they give all rows.

    The covariance of two rows is the sum over the columns of the products of their factors. The
    sheets have a tenth of the cells of the whole factor, which they give to rounding.
    """
    capacity = record["capacity"]
    if not capacity["inputs"]:
        return

    def column(key, cells, digits=0, width=12, **values):
        heading = book.word(f"columns.{key}", of="calculator", **values)
        return Column(heading, cells, digits, width)

    kept, combinations = combinations_of(capacity)
    columns = [column("kept_row", [float(row) for row in range(1, len(kept) + 1)])]
    columns += [
        Column(name, cells, _DIGITS, _WIDTH)
        for name, cells in zip(column_names(book, capacity), zip(*kept, strict=True), strict=True)
    ]
    sheet = book.plain_sheet("covariance_factor", columns, landscape=True)
    book.name("covariance_factor", sheet, 1, len(kept), 1, len(columns) - 1)

    heights = capacity["height_m"]
    weights = list(zip_longest(*(weights for _, weights in combinations)))
    columns = [
        column("dip_m", heights, height_digits(heights)),
        column("first_kept", [first + 1.0 for first, _ in combinations]),
        column("last_kept", [float(first + len(row)) for first, row in combinations]),
        *(column("weight", cells, _DIGITS, _WIDTH, number=i) for i, cells in enumerate(weights, 1)),
    ]
    sheet = book.plain_sheet("covariance_weights", columns, landscape=True)
    for name, first, last in (("first", 1, 1), ("last", 2, 2), ("weights", 3, len(columns) - 1)):
        book.name(f"covariance_{name}", sheet, 1, len(heights), first, last)


def factor_formula(row, first=0, last=0):
    """Return the formula of columns `first` to `last` (0: all) of the factor at a row of the table.

    It multiplies the weights of the row by its kept rows; its result is a matrix of a single row.
    """
    kept_first, kept_last = (f"INDEX(covariance_{end},{row})" for end in ("first", "last"))
    count = f"{kept_last}-{kept_first}+1"
    return (
        f"MMULT(INDEX(covariance_weights,{row},1):INDEX(covariance_weights,{row},{count}),"
        f"INDEX(covariance_factor,{kept_first},{first}):INDEX(covariance_factor,{kept_last},{last}))"
    )
