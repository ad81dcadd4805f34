"""Scores against values worked out by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom

from tankcal.products.intercomparison.answers import (
    exact_bounds,
    form_of,
    score_method,
    score_table,
    share_within,
)
from tankcal.record.intercomparison import Answer
from tankcal.record.schema import to_plain

HEIGHTS = [1.0, 1.01, 1.1, 3.0]
TRUE = {
    "tank": "T01",
    "heights_m": HEIGHTS,
    "volume_m3": [100.0, 101.0, 110.0, 300.0],
    "numerical_error_m3": 0.0,
}


def answer(volumes, U=None, k=None, heights=HEIGHTS, tank="T01"):
    count = len(volumes)
    U, k = U or [None] * count, k or [None] * count
    return Answer(tank, "tape", heights, volumes, U, k)


def test_errors_and_E_n_by_hand():
    given = answer([100.3, 101.3, 110.2, 300.6], [0.2, 0.4, 0.4, 0.8], [2.0, 2.0, None, 2.0])
    one = score_table(0, given, TRUE)
    assert_allclose(one.rows.error_m3, [0.3, 0.3, 0.2, 0.6])
    assert_allclose(one.rows.E_n, [1.5, 0.75, 0.5, 0.75])
    assert_allclose(one.rows.zeta, [3.0, 1.5, np.nan, 1.5])
    assert (one.within, one.judged, one.missing) == (3, 4, 0)
    assert_allclose(one.top_error_ppm, 2000.0)
    assert_allclose(one.rms_ppm, 1e6 * np.sqrt((0.09 + 0.09 + 0.04 + 0.36) / 4) / 300)
    assert_allclose(one.mean_U_ppm, 1e6 * 0.45 / 300)
    assert_allclose(one.rms_zeta, np.sqrt((9 + 2.25 + 2.25) / 3))


def test_the_numerical_error_of_the_truth_counts():
    one = score_table(0, answer([100.5], [0.3], [2.0], [1.0]), TRUE | {"numerical_error_m3": 0.4})
    assert_allclose(one.rows.E_n, [0.5 / np.hypot(0.3, 0.4)])
    assert_allclose(one.rows.zeta, [0.5 / np.hypot(0.15, 0.4)])


def test_without_U_there_is_an_error_alone():
    one = score_table(0, answer([100.1, 300.3], heights=[1.0, 3.0]), TRUE)
    assert one.judged == 0
    assert (one.rms_zeta, one.mean_U_ppm, one.top_E_n) == (None, None, None)
    assert one.missing == 2
    assert_allclose(one.top_error_ppm, 1000.0)


def test_order_of_the_rows_is_free():
    first = score_table(0, answer([100.3, 101.3, 110.2, 300.6]), TRUE)
    other = score_table(
        0, answer([300.6, 110.2, 100.3, 101.3], heights=[3.0, 1.1, 1.0, 1.01]), TRUE
    )
    assert to_plain(first) == to_plain(other)


def test_form_by_hand():
    """A zero of 0.5 and a scale of 100 ppm leave no form; deliveries have the scale alone."""
    exact = np.array(TRUE["volume_m3"])
    form = form_of(np.array(HEIGHTS), exact * (1 + 1e-4) + 0.5, exact, 300.0)
    assert_allclose([form.zero_m3, form.scale_ppm], [0.5, 100.0], rtol=1e-9)
    assert form.form_ppm < 1e-6
    assert_allclose(form.delivery_1cm_percent, 0.01, rtol=1e-9)
    assert_allclose(form.delivery_10cm_percent, 0.01, rtol=1e-9)
    assert_allclose([form.delivery_2m_ppm, form.worst_2m_ppm], 100.0, rtol=1e-9)
    assert form.falling_rows == 0


def test_form_counts_rows_that_do_not_rise():
    exact = np.array(TRUE["volume_m3"])
    form = form_of(np.array(HEIGHTS), np.array([100.0, 100.0, 99.0, 300.0]), exact, 300.0)
    assert form.falling_rows == 2
    assert_allclose(form.delivery_1cm_percent, 100.0)
    assert_allclose(form.delivery_10cm_percent, 110.0)  # -1 in place of 10


def test_share_of_rows_counts_tables():
    """By hand: p = 15/20, s2 = 2/1 ((10 - 7.5)^2 + (5 - 7.5)^2) / 400."""
    share, sd = share_within(np.array([10, 5, 0]), np.array([10, 10, 0]))
    assert_allclose([share, sd], [0.75, 0.25])
    assert share_within(np.array([4]), np.array([5])) == (0.8, None)
    assert share_within(np.array([0]), np.array([0])) == (None, None)


@pytest.mark.parametrize(("good", "count"), [(0, 7), (3, 10), (10, 10)])
def test_exact_bounds(good, count):
    """Definition: at the bounds so many or more, or fewer, have a probability of 2.5 %."""
    low, high = exact_bounds(good, count)
    if good:
        assert_allclose(binom.sf(good - 1, count, low), 0.025)
    if good < count:
        assert_allclose(binom.cdf(good, count, high), 0.025)
    assert low <= good / count <= high


def test_method_by_hand():
    tables = [
        score_table(0, answer([300.3], [0.6], [2.0], [3.0]), TRUE),
        score_table(0, answer([300.9], [0.6], [2.0], [3.0], "T02"), TRUE),
    ]
    one = score_method(0, "tape", tables, 3)
    assert_allclose([one.bias_ppm, one.u_bias_ppm], [2000.0, 1000.0])
    assert_allclose(one.rms_top_ppm, np.sqrt((1000.0**2 + 3000.0**2) / 2))
    assert_allclose(one.rms_zeta, np.sqrt((1.0 + 9.0) / 2))
    assert (one.tops_within, one.tops_judged, one.tables, one.asked) == (1, 2, 2, 3)
    assert_allclose(one.share_within, 0.5)
