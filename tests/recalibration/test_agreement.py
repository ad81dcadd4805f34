"""E_n with the correlation of two tables: published values, simulation, second methods."""

from types import SimpleNamespace

import numpy as np
import pytest
from page_figures import agree, figures_of, value_of
from tables_of_s1 import RADII, new_s1, rings_m3

from tankcal.products.recalibration.agreement import (
    compare_deliveries,
    coverage_factor,
    critical_correlation,
    find_worst_by_error,
    find_worst_by_share,
    interpolate_uncertainty,
    normalized_error,
)

K95 = 1.959963984540054


@pytest.mark.parametrize(("c", "published"), [(0.0, 0.93), (0.5, 1.29)])
def test_the_published_errors(c, published):
    assert normalized_error(0.70, 0.46, 0.60, c) == pytest.approx(published, abs=0.005)


def test_the_correlation_at_which_tables_just_agree():
    """Property: put in, it gives 1."""
    rng = np.random.default_rng(4)
    d, one, two = rng.uniform(0.05, 1.0, (3, 200))
    c = critical_correlation(d, one, two)
    assert (np.isnan(c) == (d < np.abs(one - two))).all()
    inside = (c > -1) & (c < 1)
    assert np.abs(normalized_error(d, one, two, c)[inside]) == pytest.approx(1, abs=1e-9)
    assert inside.sum() > 50
    assert (np.abs(normalized_error(d, one, two, -0.999999))[c == -1] > 0.999).all()


def test_what_is_not_known_or_not_there():
    assert np.isnan(normalized_error(0.1, np.nan, 1.0))
    assert normalized_error(0.0, 0.0, 0.0) == 0
    assert np.isinf(normalized_error(0.1, 0.5, 0.5, 1.0))
    assert np.isnan(critical_correlation(0.0, 0.4, 0.4))


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9])
def test_one_table_in_twenty_is_beyond_one(share, figure):
    """Simulation: a strapped shell twice, with a tape of its own and a master tape of both.

    Truth: circumferences of all courses times tapes that are off by normal errors; volumes by the
    sum of rings, not by U. c = (what the master gives) / (both u).
    """
    rng = np.random.default_rng(21)
    count, tape, own_mm = 40_000, 60e-6, 0.3
    master = np.sqrt(share) * tape * rng.normal(size=(count, 1, 1))
    tapes = np.sqrt(1 - share) * tape * rng.normal(size=(count, 2, 1))
    radii = RADII * (1 + master + tapes) + own_mm / 1000 * rng.normal(size=(count, 2, 5))
    heights = np.array([1.8, 1.8, 1.8, 1.5, 1.5])
    volumes = np.pi * (radii**2 * heights).sum(axis=2)
    areas = 2 * np.pi * RADII * heights
    of_tape, of_own = (areas * RADII).sum() * tape, np.linalg.norm(areas) * own_mm / 1000
    u = np.hypot(of_tape, of_own)
    c = share * of_tape**2 / u**2
    E_n = normalized_error(volumes[:, 1] - volumes[:, 0], K95 * u, K95 * u, c)
    rate = 100 * np.mean(np.abs(E_n) > 1)
    figure(f"|E_n| > 1, c = {c:.2f}", f"{rate:.2f} % of {count}")
    pairs, *stated = figures_of(
        "docs/studies/compare.md",
        "For () pairs of strapped shells with tapes of a common master, |E_n| > 1 occurred in (), "
        "() and () % (c (), (), ())",
    )
    assert value_of(pairs) == count
    number = (0.0, 0.5, 0.9).index(share)
    assert agree([rate, c], [stated[number], stated[3 + number]])
    assert 4.5 < rate < 5.5


@pytest.mark.parametrize("c", [0.0, 0.5])
def test_without_its_correlation_it_does_not_hold(c):
    """Errors that are correlated by 0.8: c = 0 finds far fewer than one in twenty."""
    rng = np.random.default_rng(5)
    errors = rng.multivariate_normal([0, 0], [[1, 0.8], [0.8, 1]], 20_000)
    E_n = normalized_error(errors[:, 1] - errors[:, 0], K95, K95, c)
    assert np.mean(np.abs(E_n) > 1) < 0.015


# ---- U for one coverage


def test_other_coverage_factors():
    """U with k = 3 counts two thirds of itself beside k = 2; of a record by its probability."""
    dips = np.linspace(0.0, 8.0, 81)
    table = new_s1(dips, k=3.0, U_m3=np.full(81, 0.9), volume_quantum_m3=0.0)
    assert interpolate_uncertainty(table, dips, table.volume_m3, 2.0).rows() == pytest.approx(0.6)
    record = {"job": {"table": {"coverage_probability": 0.95}}}
    assert coverage_factor(SimpleNamespace(record=record)) == pytest.approx(K95)


def test_the_last_digit_counts():
    """Closed form: U of 0.1 and k q / sqrt(12)."""
    dips = np.linspace(0.0, 8.0, 81)
    table = new_s1(dips, U_m3=np.full(81, 0.1), volume_quantum_m3=0.1)
    U = interpolate_uncertainty(table, dips, table.volume_m3, 2.0)
    assert U.rows() == pytest.approx(np.hypot(0.1, 2 * 0.1 / np.sqrt(12)))


def test_U_of_a_delivery_by_what_is_known():
    dips = np.linspace(0.0, 8.0, 81)
    low, high = np.array([10]), np.array([50])
    volumes = rings_m3(dips, RADII)
    delivered = volumes[50] - volumes[10]
    in_percent = interpolate_uncertainty(new_s1(dips, U_m3=0.002 * volumes), dips, volumes, 2.0)
    assert in_percent.deliveries_by == "proportional"
    assert in_percent.deliveries(low, high) == pytest.approx(0.002 * delivered)
    same = interpolate_uncertainty(new_s1(dips, U_m3=np.full(81, 0.3)), dips, volumes, 2.0)
    assert same.deliveries_by == "independent_rows"
    assert same.deliveries(low, high) == pytest.approx(0.3 * np.sqrt(2))
    factor = np.column_stack([0.1 * np.ones(81), 1e-3 * volumes])
    u = np.linalg.norm(factor, axis=1)
    known = interpolate_uncertainty(
        new_s1(dips, U_m3=2 * u, factor_m3=factor), dips, volumes, 2.0
    )  # fmt: skip
    assert known.deliveries_by == "record"
    assert known.deliveries(low, high) == pytest.approx(2e-3 * delivered)  # the zero cancels
    nothing = interpolate_uncertainty(new_s1(dips, U_m3=None), dips, volumes, 2.0)
    assert np.isnan(nothing.deliveries(low, high)).all()


# ---- the worst delivery


def uneven(seed, rows=70):
    """A OneBasis of rows at uneven dips, some not for use, with U of both."""
    rng = np.random.default_rng(seed)
    dips = np.cumsum(rng.uniform(0.02, 0.2, rows))
    volumes = 120 * dips + 3 * np.sin(dips)
    new = volumes + 0.02 * np.cumsum(rng.normal(size=rows))
    use = (dips < 1.1) | (dips > 1.5)
    basis = SimpleNamespace(height_m=dips, on_basis_m3=volumes, new_m3=new, usable=use)
    table = new_s1(dips, U_m3=np.full(rows, 0.2))
    return (
        basis,
        interpolate_uncertainty(table, dips, volumes, 2.0),
        interpolate_uncertainty(table, dips, new, 2.0),
    )


def all_pairs(basis, minimum):
    use = np.flatnonzero(basis.usable)
    return [
        (i, j) for i in use for j in use if basis.height_m[j] - basis.height_m[i] >= minimum - 1e-9
    ]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("minimum", [0.5, 1.5, 3.0])
def test_the_worst_delivery_is_that_of_all_pairs(seed, minimum):
    """Second method: every pair of rows."""
    basis, *_ = uneven(seed)
    d = basis.new_m3 - basis.on_basis_m3

    def share(pair):
        i, j = pair
        return abs(d[j] - d[i]) / (basis.on_basis_m3[j] - basis.on_basis_m3[i])

    expected = max(all_pairs(basis, minimum), key=share)
    assert share(find_worst_by_share(basis, minimum)) == pytest.approx(share(expected), rel=1e-12)


def test_the_worst_error_is_no_smaller_than_that_of_the_pairs_asked_for():
    basis, one, two = uneven(1)
    pair = find_worst_by_share(basis, 1.5)
    asked = compare_deliveries(basis, one, two, 0.3, *pair)
    found = find_worst_by_error(basis, one, two, 0.3, 1.5, also=(pair,))
    assert abs(found.E_n[0]) >= abs(asked.E_n[0])
    assert basis.height_m[found.high[0]] - basis.height_m[found.low[0]] >= 1.5 - 1e-9


def test_a_tank_lower_than_the_delivery():
    basis, one, two = uneven(2)
    assert find_worst_by_share(basis, 99.0) is None
    assert find_worst_by_error(basis, one, two, 0.0, 99.0) is None
