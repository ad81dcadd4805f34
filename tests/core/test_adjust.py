"""Least squares: closed forms, a second method, and what it must refuse."""

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import scipy.sparse
from jacobians import assert_derivative

from tankcal.adjust import CRITICAL, adjust, snoop
from tankcal.errors import SolutionError
from tankcal.geometry.circles import circle_conditions, own_columns


def mean_model(x, l):
    return x[0] - l, np.ones((len(l), 1)), None


def line_model(x, l):
    """Points (s, t) on t = x0 + x1 s, both coordinates observed."""
    s, t = l[0::2], l[1::2]
    b = scipy.sparse.block_diag([[[x[1], -1.0]]] * len(s), format="csr")
    return x[0] + x[1] * s - t, np.column_stack([np.ones_like(s), s]), b


def test_weighted_mean_closed_form():
    l, sd = np.array([10.0, 10.2, 9.7]), np.array([0.1, 0.2, 0.3])
    found = adjust(mean_model, [0.0], l, sd**2)
    weights = 1 / sd**2
    mean = weights @ l / weights.sum()  # closed form
    assert found.unknowns[0] == pytest.approx(mean, abs=1e-13)
    assert found.cofactor[0, 0] == pytest.approx(1 / weights.sum(), rel=1e-13)
    assert found.residuals == pytest.approx(mean - l, abs=1e-13)
    assert found.chi2 == pytest.approx(weights @ (mean - l) ** 2, rel=1e-12)
    assert found.redundancy == pytest.approx(1 - weights / weights.sum(), rel=1e-12)
    assert found.dof == 2


def test_redundancy_numbers_add_up_to_the_degrees_of_freedom():
    rng = np.random.default_rng(1)
    l = np.column_stack([np.arange(8.0), 2 + 0.5 * np.arange(8.0)]).ravel()
    found = adjust(line_model, [0.0, 0.0], l + rng.normal(0, 0.1, 16), np.full(16, 0.01))
    assert found.redundancy.sum() == pytest.approx(found.dof, rel=1e-12)


def test_combined_model_is_orthogonal_regression():
    """Second method: for equal variances the line is the principal axis of the points."""
    rng = np.random.default_rng(2)
    s = np.linspace(0, 10, 30)
    points = np.column_stack([s, 1 + 0.7 * s]) + rng.normal(0, 0.2, (30, 2))
    found = adjust(line_model, [0.0, 0.0], points.ravel(), np.full(60, 0.04))
    axis = np.linalg.svd(points - points.mean(axis=0))[2][0]
    slope = axis[1] / axis[0]
    assert found.unknowns[1] == pytest.approx(slope, abs=1e-9)
    assert found.unknowns[0] == pytest.approx(points[:, 1].mean() - slope * points[:, 0].mean())


def test_full_covariance_agrees_with_a_general_minimiser():
    """Second method: v' Q^-1 v under the conditions, minimised by scipy over the foot points."""
    rng = np.random.default_rng(3)
    azimuth = np.linspace(0, 2.5, 9)
    points = 5 + np.column_stack([2 * np.sin(azimuth), 2 * np.cos(azimuth)])
    root = np.eye(18) * 0.02 + rng.normal(0, 0.005, (18, 18))
    covariance = root @ root.T
    l = (points + rng.normal(0, 0.02, points.shape)).ravel()
    found = adjust(circle_conditions, [5.0, 5.0, 2.0], l, covariance)

    whiten = np.linalg.inv(np.linalg.cholesky(covariance))

    def on_circle(p):
        return (p[:2] + p[2] * np.column_stack([np.sin(p[3:]), np.cos(p[3:])])).ravel()

    other = scipy.optimize.least_squares(
        lambda p: whiten @ (on_circle(p) - l), [5, 5, 2, *azimuth], xtol=1e-15, ftol=1e-15
    )
    assert found.unknowns == pytest.approx(other.x[:3], abs=1e-7)
    assert found.chi2 == pytest.approx(2 * other.cost, rel=1e-8)
    assert np.abs(circle_conditions(found.unknowns, found.observations)[0]).max() < 1e-12


def test_normal_equations_agree_with_qr(monkeypatch):
    """Second method: the same by QR, which columns that nearly depend on each other take anyway."""
    rng = np.random.default_rng(6)
    rows = rng.normal(size=(40, 6)) * np.geomspace(1e-3, 1e3, 6)
    rows[:, 5] += 300 * rows[:, 4]
    l, sd = rng.normal(size=40), rng.uniform(0.1, 1, 40)
    problem = lambda x, l: (rows @ x - l, rows, None), np.zeros(6), l, sd**2
    by_qr = []
    qr = scipy.linalg.qr
    monkeypatch.setattr(scipy.linalg, "qr", lambda *a, **k: by_qr.append(1) or qr(*a, **k))
    found = adjust(*problem)
    assert not by_qr
    monkeypatch.setattr("tankcal.adjust.WELL_PLACED", np.inf)
    other = adjust(*problem)
    assert by_qr
    assert found.unknowns == pytest.approx(other.unknowns, rel=1e-11)
    assert found.redundancy == pytest.approx(other.redundancy, rel=1e-12)
    assert found.cofactor == pytest.approx(other.cofactor, rel=1e-11)


def test_the_order_of_observations_changes_nothing():
    rng = np.random.default_rng(4)
    l, sd = rng.normal(10, 1, 6), rng.uniform(0.1, 1, 6)
    order = rng.permutation(6)
    one, other = (
        adjust(mean_model, [0], l, sd**2),
        adjust(mean_model, [0], l[order], sd[order] ** 2),
    )
    assert one.unknowns == pytest.approx(other.unknowns, rel=1e-14)
    assert one.residuals[order] == pytest.approx(other.residuals, abs=1e-14)


def test_circle_conditions_have_the_right_derivatives():
    x = np.array([1.0, -2.0, 5.0])
    l = np.array([6.1, -2.2, 1.0, 3.1, -4.0, -1.9])
    _, by_unknowns, by_points = circle_conditions(x, l)
    assert_derivative(lambda y: circle_conditions(y, l)[0], x, by_unknowns)
    assert_derivative(lambda y: circle_conditions(x, y)[0], l, own_columns(by_points).toarray())


def test_undetermined_unknowns_are_named():
    def model(x, l):
        return x[0] + x[1] - l, np.ones((len(l), 2)), None

    with pytest.raises(SolutionError, match=r"rank 1 of 2"):
        adjust(model, [0.0, 0.0], np.zeros(4), np.ones(4))


def test_badly_scaled_columns_are_no_rank_defect():
    """K1..K3 in raw millimetres differ by twelve decades; the columns are scaled first."""
    r = np.linspace(1, 60, 50)
    design = np.column_stack([r**3, r**5, r**7])
    truth = np.array([2e-8, -1e-12, 4e-17])
    found = adjust(
        lambda x, l: (design @ x - l, design, None), np.zeros(3), design @ truth, r * 0 + 1
    )
    assert found.unknowns == pytest.approx(truth, rel=1e-9)


@pytest.mark.parametrize(
    ("l", "variances", "message"),
    [
        ([1.0], [1.0, 1.0], "too few"),
        ([1.0, 2.0, 3.0], [1.0, 0.0, 1.0], "no variance"),
    ],
)
def test_unsound_problems_are_refused(l, variances, message):
    def model(x, l):
        return x[0] + x[1] * np.arange(len(l)) - l, np.vander(np.arange(len(l)), 2)[:, ::-1], None

    with pytest.raises(SolutionError, match=message):
        adjust(model, [0.0, 0.0], np.array(l), np.array(variances[: len(l)]))


def test_an_indefinite_covariance_is_refused():
    covariance = np.array([[1.0, 2.0], [2.0, 1.0]])
    with pytest.raises(SolutionError, match="not positive definite"):
        adjust(mean_model, [0.0], np.array([1.0, 2.0]), covariance)


@pytest.mark.parametrize("rounding", [1e-13, -1e-13, 0.0])
def test_readings_that_control_each_other_alone_are_a_tie_on_every_machine(rounding):
    """Two faces of one sight: |w| is the same but for rounding, and must not decide."""
    size = np.array([1.0, 18.5 + rounding, 18.5, 1.0])

    def tests(used):
        return used, np.where(used[1] & used[2], size, 1.0), CRITICAL

    def choose(used, goes, share):
        assert share[1] == share[2]
        return goes & (np.arange(4) == np.argmax(share))

    start = np.ones(4, dtype=bool)
    found = snoop(
        start, tests, lambda used, goes, comes: used & ~goes, at_once=0.6, returns=0, choose=choose
    )
    assert found.adjustment.tolist() == [True, False, True, True]


def test_of_a_tie_one_goes_where_both_would_be_too_many():
    """Without both nothing is determined; the first goes, the second is kept for it."""
    size = np.array([1.0, 20.0, 20.0 - 1e-12])

    def tests(used):
        return used, np.where(used[1] & used[2], size, 0.0), CRITICAL

    def readjust(used, goes, comes):
        if goes[1] and goes[2]:
            raise SolutionError("nothing is left of that point")
        return used & ~goes

    found = snoop(np.ones(3, bool), tests, readjust, at_once=0.6, returns=0, keep=True)
    assert found.adjustment.tolist() == [True, False, True]
    assert not found.needed.any()
