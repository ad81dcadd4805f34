"""What the calculator needs of a record, and the dips that it opens with."""

import math
from functools import cached_property
from itertools import pairwise

from tankcal.record.covariance_factor import factor_of
from tankcal.report.uncertainty.sources import critical_zone, groups_of
from tankcal.report.uncertainty.stated import k_of_rows, stated_U_m3
from tankcal.report.workbook.capacity import digits_of_heights
from tankcal.text.digits import decimals_of_rows
from tankcal.uncertainty import coverage_factor

_FINER_DELIVERY = 2  # decimals by which a delivery may be better known than any row


class Table:
    """The capacity table of a record as the calculator reads it.

    at   number of the row that the calculator opens with: the middle one, or the next for use
    low  number of the first row for use, where the delivery begins
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
        others = [other["density_kg_m3"] for other in record["densities"]]
        self.densities = [self.job["table"]["liquid_density_kg_m3"], *others]  # kg/m3, own first

    @property
    def rises(self):
        """Whether no volume is below the one of the row before."""
        return all(low <= high for low, high in pairwise(self.volume_m3))

    def after(self, row):
        return min(row + 1, len(self.height_m) - 1)

    def groups(self):
        """`Group`s of the columns of the factor, in their order."""
        return groups_of(self.capacity["input_kind"], self.record["budget"])

    @cached_property
    def differences(self):
        """f(at) - f(low), column by column: what does not cancel in the first delivery."""
        factor = factor_of(self.capacity)
        return (factor[self.at] - factor[self.low]).tolist()

    def coverage(self, dof):
        """(k of infinite, k of `dof`) degrees of freedom, at the probability of the job."""
        probability = self.job["table"]["coverage_probability"]
        return tuple(float(k) for k in coverage_factor(probability, [math.inf, dof]))
