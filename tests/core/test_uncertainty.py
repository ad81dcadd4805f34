"""Propagation: closed forms and tables of the GUM."""

import numpy as np
import pytest

from tankcal.uncertainty import coverage_factor, effective_dof, factor_of


def test_a_factor_gives_its_covariance_back_with_its_rank():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 3))
    factor = factor_of(root @ root.T)
    assert factor.shape == (6, 3)
    assert factor @ factor.T == pytest.approx(root @ root.T, rel=1e-12, abs=1e-12)


def test_no_covariance_no_factor():
    assert factor_of(np.zeros((4, 4))).shape == (4, 0)


def test_a_negative_variance_is_refused():
    with pytest.raises(ValueError, match="not a covariance"):
        factor_of(np.diag([1.0, -0.1]))


def test_welch_satterthwaite_closed_form():
    """Two equal contributions of 4 and 9 dof: (2 u^2)^2 / (u^4/4 + u^4/9) = 144/13."""
    assert effective_dof([[3.0, 3.0]], [4, 9])[0] == pytest.approx(144 / 13)
    assert np.isinf(effective_dof([[3.0, 0.0]], [np.inf, 4])[0])
    assert effective_dof([[0.0, 2.0]], [np.inf, 4])[0] == pytest.approx(4)


@pytest.mark.parametrize(
    ("probability", "dof", "k"),
    [  # published: JCGM 100:2008 table G.2
        (0.95, 1, 12.71),
        (0.95, 6, 2.45),
        (0.95, 50, 2.01),
        (0.9545, 10, 2.28),
        (0.95, np.inf, 1.960),
        (0.9973, np.inf, 3.000),
    ],
)
def test_coverage_factor(probability, dof, k):
    assert float(coverage_factor(probability, dof)) == pytest.approx(k, abs=5.1e-3)


@pytest.mark.parametrize("probability", [0.1, 0.5, 0.95, 0.9973, 0.9999])
def test_k_of_many_rows_is_that_of_each(probability):
    """Second method: row by row without the polynomial, from 1 degree of freedom to 1e18."""
    dof = np.concatenate([np.linspace(1, 4, 200), np.geomspace(4, 1e18, 500), [np.inf]])
    rows = coverage_factor(probability, dof)
    each = [float(coverage_factor(probability, one)) for one in dof]
    assert rows == pytest.approx(each, rel=1e-14)
    assert np.array_equal(coverage_factor(probability, dof[:, None]), rows[:, None])


def test_a_coverage_probability_must_be_one():
    with pytest.raises(ValueError, match="between 0 and 1"):
        coverage_factor(95, np.inf)
