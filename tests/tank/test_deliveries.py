"""Deliveries: any pair of dips, and the worst of at least a height, against brute force."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from draws import draws

from tankcal.errors import HeightError
from tankcal.tank.capacity import Capacity
from tankcal.tank.deliveries import TOLERANCE, deliveries, least_delivery_m, worst_deliveries
from tankcal.uncertainty import Source, coverage_factor, effective_dof

K95 = 1.959963984540054  # closed form: the normal quantile of 0.975
MINIMA = (0.5, 1.5, 2.0, 3.0)


def courses(heights, n, seed):
    """(rows, n) columns that change their slope at six courses, as those of a shell do."""
    ends = np.linspace(0, heights[-1], 7)
    part = np.clip(heights[:, None] - ends[:-1], 0, np.diff(ends))
    return part @ np.random.default_rng(seed).normal(size=(6, n))


def tank(n=121, seed=0, few_dof=False, critical=None, rough=0.0):
    """A tank of 130 m2 and 9.5 m: points, form, scale, datum, bottom, head; 30 columns."""
    rng = np.random.default_rng(seed)
    h = np.linspace(0, 9.5, n)
    volume = 130 * h + 0.8
    dof = (9.0, 5.0, 12.0) if few_dof else (np.inf,) * 3
    bottom = np.minimum(h, 0.3)[:, None] * rng.normal(size=3) + 0.1
    sources = (
        Source("points", 0.1 * courses(h, 14, seed + 1), dof[0]),
        Source("form", 0.07 * courses(h, 8, seed + 2), dof[1]),
        Source("scale", 2e-4 * volume[:, None]),
        Source("datum", np.full((n, 1), 0.13)),
        Source("bottom", bottom, dof[2]),
        Source("head", np.outer(h**2, rng.normal(size=3)) / 800),
        Source("rough", rough * rng.normal(size=(n, 2))),
    )
    sources = tuple(one for one in sources if np.any(one.columns_m3))
    return Capacity(h, volume, np.full(n, 130.0), sources, 0.95, critical)


def candidates(table, minimum, refined=1):
    """(low, high) of all pairs of rows, and of all of the minimum height with one dip at a row."""
    h = table.height_m
    if table.critical_m is not None:
        h = np.union1d(h, [end for end in table.critical_m if h[0] < end < h[-1]])
    fine = np.interp(np.arange((len(h) - 1) * refined + 1) / refined, np.arange(len(h)), h)
    height = fine - fine[:, None]
    i, j = np.nonzero(height >= minimum - 1e-9)
    low = np.concatenate([fine[i], fine, fine - minimum])
    high = np.concatenate([fine[j], fine + minimum, fine])
    inside = (low >= h[0] - 1e-12) & (high <= h[-1] + 1e-12)
    low, high = np.clip(low[inside], h[0], h[-1]), np.clip(high[inside], h[0], h[-1])
    for_use = table.for_use(low) & table.for_use(high)
    return low[for_use], high[for_use]


def brute(table, minimum, refined=1):
    """(largest U, largest U/V) over all candidates, by interpolating each source by itself."""
    low, high = candidates(table, minimum, refined)
    parts = []
    for source in table.sources:
        ends = [
            np.column_stack([np.interp(dip, table.height_m, c) for c in source.columns_m3.T])
            for dip in (low, high)
        ]
        parts.append(np.sqrt(np.sum((ends[1] - ends[0]) ** 2, axis=1)))
    parts = np.column_stack(parts)
    dof = effective_dof(parts, [source.dof for source in table.sources])
    U = coverage_factor(table.probability, dof) * np.sqrt(np.sum(parts**2, axis=1))
    volume = np.interp(high, table.height_m, table.volume_m3)
    volume -= np.interp(low, table.height_m, table.volume_m3)
    return U.max(), (U / volume).max()


def test_pairs_are_those_of_the_table_one_by_one():
    """Second method: Capacity.delivery, through row weights, for dips at and between rows."""
    table = tank(few_dof=True, critical=(1.2, 2.1))
    rng = np.random.default_rng(1)
    low, high = np.sort(rng.uniform(0, 9.5, (2, 5000)), axis=0)
    found = deliveries(table, low, high)
    for i in range(0, 5000, 250):
        one = table.delivery(low[i], high[i])
        assert found.volume_m3[i] == pytest.approx(one.value_m3, rel=1e-12)
        assert found.u_m3[i] == pytest.approx(one.u_m3, rel=1e-11)
        assert found.dof[i] == pytest.approx(one.dof, rel=1e-9)
        assert found.U_m3[i] == pytest.approx(one.U_m3, rel=1e-9)
        assert found.for_use[i] == one.for_use
        assert found.relative[i] == pytest.approx(one.U_m3 / one.value_m3, rel=1e-9)


def test_a_pair_may_be_given_backwards_and_as_numbers():
    table = tank()
    up, down = deliveries(table, 1.0, 4.0), deliveries(table, 4.0, 1.0)
    assert up.volume_m3[0] == -down.volume_m3[0]
    assert up.U_m3[0] == down.U_m3[0]


@pytest.mark.parametrize("pair", [(-0.001, 3), (1, 9.501), (np.nan, 1)])
def test_a_dip_outside_the_table_is_refused(pair):
    with pytest.raises(HeightError, match="outside the capacity table"):
        deliveries(tank(), *pair)


def test_common_scale_is_equally_bad_everywhere():
    """Closed form: V = (1 + s) V0 has U/V = k s for each delivery, U = k s V for the largest."""
    table = replace(tank(), sources=tank().sources[2:3])
    found = worst_deliveries(table, 1.5)
    assert found.relative.relative == pytest.approx(K95 * 2e-4, rel=1e-12)
    assert found.absolute.U_m3 == pytest.approx(K95 * 2e-4 * 1235, rel=1e-12)
    assert (found.absolute.low_m, found.absolute.high_m) == (0.0, 9.5)


def test_common_errors_are_in_no_delivery():
    table = replace(tank(), sources=tank().sources[3:4])
    found = worst_deliveries(table, 1.5)
    assert found.absolute.U_m3 == 0
    assert found.relative.relative == 0
    assert found.U_bound_m3 == 0


def test_a_table_without_an_input_has_no_uncertainty():
    found = worst_deliveries(replace(tank(), sources=()), 1.5)
    assert (found.absolute.U_m3, found.relative.relative) == (0, 0)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("minimum", MINIMA)
@pytest.mark.parametrize(
    "critical", [None, (1.23, 2.1), (-1, 0.52), (9.0, 12.0), (3.0, 8.0), (4.75, 4.75)]
)
@pytest.mark.parametrize("few_dof", [False, True])
def test_the_worst_is_that_of_brute_force(minimum, critical, few_dof):
    """Every pair of rows, and every delivery of the minimum height with one dip at a row."""
    for seed in range(3):
        table = tank(60 + seed, seed, few_dof, critical, rough=0.02 * seed)
        found = worst_deliveries(table, minimum)
        U, relative = brute(table, minimum)
        assert found.absolute.U_m3 <= U * (1 + 1e-12)
        assert found.absolute.U_m3 == pytest.approx(U, rel=TOLERANCE)
        assert found.relative.relative <= relative * (1 + 1e-12)
        assert found.relative.relative == pytest.approx(relative, rel=TOLERANCE)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("minimum", MINIMA)
def test_no_dip_between_rows_is_worse(minimum):
    """The proof at work: seven dips in each step find nothing that rows and the cut do not have."""
    for seed in range(3):
        table = tank(40, seed, rough=0.05)
        found = worst_deliveries(table, minimum)
        U, relative = brute(table, minimum, refined=7)
        assert max(U, found.absolute.U_m3) == pytest.approx(found.absolute.U_m3, rel=TOLERANCE)
        assert relative <= found.relative.relative * (1 + TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("minimum", MINIMA)
def test_the_bound_holds_between_rows_where_k_changes(minimum, figure):
    excess = []
    for seed in range(3):
        table = tank(40, seed, few_dof=True, rough=0.05)
        found = worst_deliveries(table, minimum)
        U, relative = brute(table, minimum, refined=7)
        assert found.U_bound_m3 >= U
        assert relative <= found.relative_bound
        excess.append(relative / found.relative.relative - 1)
        excess.append(found.relative_bound / found.relative.relative - 1)
    figure(
        f"steps of 0.24 m, few degrees of freedom, {minimum:g} m: between rows, bound",
        f"{max(excess[::2]):.1e}, {max(excess[1::2]):.1e}",
    )


def test_bound_covers_worst_dip_between_rows():
    """Closed form: the sure input passes through 0 in mid-step, so there one dof is left.

    u = 1 of one dof throughout, and the other runs from 1 to -1: at the rows dof = (1 + 1)^2 = 4
    and U = 2.776 sqrt 2 = 3.926, in between dof = 1 and U = 12.71 (t table, 95 %).
    """
    h = np.array([0.0, 2.0, 3.0])
    few, sure = np.array([[0.0], [1.0], [1.0]]), np.array([[0.0], [1.0], [-1.0]])
    sources = (Source("few", few, 1.0), Source("sure", sure))
    table = Capacity(h, 10 * h, np.full(3, 10.0), sources, 0.95)
    found = worst_deliveries(table, 2.0)
    between = deliveries(table, 0.0, 2.5)
    assert found.absolute.U_m3 == pytest.approx(3.926, abs=1e-3)
    assert between.U_m3[0] == pytest.approx(12.706, abs=1e-3)
    assert found.U_bound_m3 >= between.U_m3[0]


def test_the_worst_of_a_minimum_height_may_lie_between_two_rows():
    """Rows every 0.4 m: 1.5 m is no difference of rows, and 1.6 m would be told too small."""
    h = np.arange(0, 8.1, 0.4)
    column = np.where(h < 4, 0.0, 1.0)[:, None]  # a jump of u at a seam
    table = Capacity(h, 100 * h, np.full(len(h), 100.0), (Source("seam", column),), 0.95)
    found = worst_deliveries(table, 1.5)
    # closed form: the whole jump in 1.5 m of 100 m2
    assert found.relative.relative == pytest.approx(K95 / 150, rel=1e-12)
    assert found.relative.high_m - found.relative.low_m == pytest.approx(1.5, abs=1e-12)
    assert found.at_minimum == found.relative


def test_larger_delivery_can_be_worse_than_minimum():
    """Closed form: columns of opposite slope cancel in 1.5 m from any dip, not in 2 m."""
    h = np.linspace(0, 4, 401)
    wave = np.sin(np.pi * h / 0.75)[:, None]  # period 1.5 m
    table = Capacity(h, 100 * h, np.full(401, 100.0), (Source("wave", wave),), 0.95)
    found = worst_deliveries(table, 1.5)
    assert found.at_minimum.relative == pytest.approx(0, abs=1e-12)
    assert found.relative.relative > 0.01
    assert found.absolute.U_m3 == pytest.approx(2 * K95, rel=1e-3)  # crest to trough


@pytest.mark.parametrize("critical", [(2.0, 3.0), (2.013, 2.987)])
def test_deliveries_that_end_in_the_critical_zone_are_left_out(critical):
    """A bump inside the zone is no delivery's; its ends and what passes through it are."""
    h = np.linspace(0, 8, 161)
    bump = np.exp(-(((h - 2.5) / 0.1) ** 2))[:, None] + 0.01 * h[:, None]
    table = Capacity(h, 100 * h, np.full(161, 100.0), (Source("bump", bump),), 0.95)
    open_, cut = (worst_deliveries(replace(table, critical_m=c), 1.5) for c in (None, critical))
    assert open_.absolute.U_m3 == pytest.approx(K95, rel=0.05)
    assert cut.absolute.U_m3 == pytest.approx(K95 * 0.08, rel=1e-6)  # closed form: 0.01 of 8 m
    for one in (cut.absolute, cut.relative):
        assert np.all(table.for_use([one.low_m, one.high_m]))
        assert np.all(replace(table, critical_m=critical).for_use([one.low_m, one.high_m]))


def test_only_a_way_through_the_zone_may_be_left():
    table = replace(tank(), critical_m=(0.5, 9.3))
    found = worst_deliveries(table, 1.5)
    assert found.absolute.low_m <= 0.5
    assert found.absolute.high_m >= 9.3
    assert found.at_minimum is None


@pytest.mark.parametrize("critical", [None, (1.0, 9.6), (-1.0, 20.0)])
def test_without_a_delivery_there_is_no_worst(critical):
    table = replace(tank(), critical_m=critical)
    assert worst_deliveries(table, 9.6) is None
    if critical:
        assert worst_deliveries(table, 1.5) is None
        assert least_delivery_m(replace(tank(), critical_m=(-1.0, 20.0)), 1e-3) is None


def test_the_whole_table_is_a_delivery():
    found = worst_deliveries(tank(), 9.5)
    assert (found.absolute.low_m, found.absolute.high_m) == (0.0, 9.5)


@pytest.mark.parametrize("minimum", [0, -1.5, np.nan])
def test_a_minimum_height_is_above_0(minimum):
    with pytest.raises(ValueError, match="expected above 0"):
        worst_deliveries(tank(), minimum)


def test_empty_deliveries_hold_no_relative_limit():
    """Dips below the tank's lowest point: the first rows are 0, and a datum that is not sure."""
    h = np.linspace(0, 5, 51)
    volume = 100 * np.maximum(h - 2, 0)
    column = np.where(h < 1, 0.2, 0.1)[:, None]
    table = Capacity(h, volume, np.full(51, 100.0), (Source("datum", column),), 0.95)
    assert worst_deliveries(table, 1.5).relative.relative == np.inf
    assert worst_deliveries(table, 4.0).relative.relative == pytest.approx(K95 * 0.1 / 200)


@pytest.mark.slow
@pytest.mark.parametrize("few_dof", [False, True])
def test_least_delivery_height_is_where_limit_holds(few_dof):
    table = tank(70, 1, few_dof)
    limit = worst_deliveries(table, 2.345).relative.relative
    height = least_delivery_m(table, limit)
    assert worst_deliveries(table, height).relative.relative <= limit
    assert worst_deliveries(table, height - 0.001).relative.relative > limit
    assert least_delivery_m(table, 1e-9) is None
    assert least_delivery_m(table, 1e9) == 0.001
    U = worst_deliveries(table, 9.5).absolute.U_m3
    assert least_delivery_m(table, 1.01 * worst_deliveries(table, 1).U_bound_m3, False) <= 1
    assert (least_delivery_m(table, 0.99 * U, False) is None) == (U > 0)


@pytest.mark.slow
def test_a_full_table_takes_no_matrix(figure):
    """9 501 rows of 30 columns: a matrix of all pairs would be 722 MB."""
    for few_dof in (False, True):
        table = tank(9501, 3, few_dof)
        assert table.factor_m3.shape == (9501, 30)
        tracemalloc.start()
        worst_deliveries(table, 2.0)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        figure(
            f"worst delivery, 9 501 x 30, {'few' if few_dof else 'many'} degrees of freedom",
            f"{peak:.0f} MB",
        )
        assert peak < 100


def brute_by_rows(table, minimum):
    """As brute, of pairs of rows only, one lower dip at a time."""
    h, best = table.height_m, np.zeros(2)
    for i in range(len(h)):
        j = np.flatnonzero(h - h[i] >= minimum - 1e-9)
        if not len(j):
            break
        step = [np.linalg.norm(s.columns_m3[j] - s.columns_m3[i], axis=1) for s in table.sources]
        parts = np.column_stack(step)
        dof = effective_dof(parts, [source.dof for source in table.sources])
        U = coverage_factor(table.probability, dof) * np.sqrt(np.sum(parts**2, axis=1))
        best = np.maximum(best, [U.max(), (U / (table.volume_m3[j] - table.volume_m3[i])).max()])
    return best


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("n", [476, pytest.param(draws(3801, 9501), marks=pytest.mark.study)])
@pytest.mark.parametrize("few_dof", [False, True])
def test_a_large_table_agrees_with_all_its_pairs_of_rows(n, few_dof, figure):
    """2 m is a whole number of steps, so rows alone have the worst delivery."""
    table = tank(n, 4, few_dof)
    found = worst_deliveries(table, 2.0)
    U, relative = brute_by_rows(table, 2.0)
    assert found.absolute.U_m3 == pytest.approx(U, rel=TOLERANCE)
    assert found.relative.relative == pytest.approx(relative, rel=TOLERANCE)
    excess = found.relative_bound / found.relative.relative - 1
    if few_dof:  # k changes within a step: first order in the step
        figure(f"{n} rows, few degrees of freedom: bound beyond the worst", f"{excess:.1e}")
    else:
        assert excess == pytest.approx(TOLERANCE, rel=1e-6)
