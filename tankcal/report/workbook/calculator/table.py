"""Data of a record for the calculator, and its initial dips."""

import math
from collections import Counter
from functools import cached_property
from itertools import pairwise, zip_longest

from tankcal.record.covariance_factor import combinations_of, factor_of
from tankcal.report.uncertainty.sources import critical_zone, groups_of
from tankcal.report.uncertainty.stated import k_of_rows, stated_U_m3
from tankcal.report.workbook.capacity import digits_of_heights
from tankcal.report.workbook.look import Column, height_digits
from tankcal.text.digits import decimals_of_rows
from tankcal.text.words import name_of_input
from tankcal.uncertainty import coverage_factor

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
