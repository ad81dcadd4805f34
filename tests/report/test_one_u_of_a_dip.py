"""Volume and delivery of a dip state one U, by one method, in the certificates of all examples."""

import numpy as np
import pytest
from example_certificates import EXAMPLES, ROOT
from scipy import stats

import tankcal
from tankcal.record import record_of
from tankcal.report.uncertainty.stated import limit_rows, stated_rows

LARGEST_RATIO = 1.15  # of both U of an emptied tank, from the closed form below: 1.144
SMALLEST_RATIO = 0.95


def emptied(shared, own):
    """Coverage of the larger U, and U by Monte Carlo over it, of own W + shared B - max(0, B)."""
    zero = np.linspace(-8, 8, 4001)
    weights = stats.norm.pdf(zero) / stats.norm.pdf(zero).sum()
    lack = shared * zero - np.maximum(0, zero)
    U = stats.norm.ppf(0.975) * max(np.hypot(own, shared), np.hypot(own, 1 - shared))

    def below(value):
        return weights @ stats.norm.cdf((value - lack) / own)

    ends = np.linspace(-3 * U, 3 * U, 6001)
    low, high = np.interp((0.025, 0.975), [below(end) for end in ends], ends)
    return below(U) - below(-U), max(-low, high) / U


@pytest.mark.slow
def test_the_larger_U_covers_the_delivery_down_to_the_empty_tank():
    """B is the error of the volume below the zero, of which no tank holds less than nothing."""
    found = [emptied(a, w) for a in (0, 0.25, 0.5, 0.75, 1) for w in (0.05, 0.5, 1, 2, 4, 10)]
    coverage, ratio = np.transpose(found)
    assert coverage.min() >= 0.95 - 1e-4
    assert ratio.max() <= LARGEST_RATIO


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_volumes_and_deliveries_do_not_contradict_each_other(name):
    result = tankcal.run(tankcal.load(ROOT / name))
    record, table = record_of(result), result.table
    capacity = record["capacity"]
    shown = [*stated_rows(record), *limit_rows(record)]
    assert shown
    for row in shown:
        near = np.flatnonzero(np.isclose(capacity["height_m"], row["high_m"], atol=1e-9))
        if row["low_m"] is None and len(near):  # the volume at a row: U and method of the row
            U = capacity["stated_U_m3"][near[0]]
            assert row["simulated"] == (capacity["interval"][near[0]] == "monte_carlo")
            assert U * (1 - 1e-9) <= row["U_m3"] <= U + 0.001  # with the rounding to litres
        if row["low_m"] is not None and table.at(row["low_m"]).value_m3 == 0:
            larger = max(
                result.at(row["high_m"]).U_m3, table.delivery(row["low_m"], row["high_m"]).U_m3
            )
            assert SMALLEST_RATIO <= row["U_m3"] / larger <= LARGEST_RATIO
    if table.volume_m3[0] == 0:
        for high_m in table.height_m[5::97]:
            found = result.delivery(table.height_m[0], high_m)
            between = table.delivery(table.height_m[0], high_m)
            assert found.U_m3 >= SMALLEST_RATIO * max(result.at(high_m).U_m3, between.U_m3)
