"""Distributions of inputs: closed forms, scipy.stats as another program, quadrature."""

from itertools import pairwise

import numpy as np
import pytest
from page_figures import figures_of
from scipy import stats
from scipy.integrate import quad

from tankcal.gum.coverage import student_quantile
from tankcal.gum.distributions import (
    FAMILIES,
    CurvilinearTrapezoid,
    Normal,
    Rectangular,
    StudentT,
    Triangular,
    UShaped,
    expanded,
    standard,
    within,
)
from tankcal.gum.monte_carlo import Goal, simulate
from tankcal.uncertainty import Input, Inputs, propagate

P = np.array([1e-12, 1e-6, 0.025, 0.3, 0.5, 0.501, 0.7, 0.975, 1 - 1e-6])
ALL = [
    Normal(0.7, mean=3.0),
    StudentT(0.7, mean=3.0, dof=5),
    StudentT(0.7, mean=3.0, dof=2.4),
    Rectangular(0.7, mean=3.0),
    Triangular(0.7, mean=3.0),
    UShaped(0.7, mean=3.0),
    CurvilinearTrapezoid(0.7, 0.07, mean=3.0),
    CurvilinearTrapezoid(0.7, 0.69, mean=3.0),
]
named = pytest.mark.parametrize("one", ALL, ids=lambda one: f"{one.name}-{one.dof:g}")
OTHER_PROGRAM = {
    Normal: lambda one: stats.norm(3.0, 0.7),
    StudentT: lambda one: stats.t(one.dof, 3.0, 0.7),
    Rectangular: lambda one: stats.uniform(2.3, 1.4),
    Triangular: lambda one: stats.triang(0.5, 2.3, 1.4),
    UShaped: lambda one: stats.arcsine(2.3, 1.4),
}


def test_students_t_has_no_ends():
    """Closed form: for any number of degrees of freedom, among few probabilities and many."""
    for dof in (0.5, 1, 2, 3, 4, 5, 8, 30, 31, 1e6):
        assert StudentT(1.0, dof=dof).quantile([0.0, 0.5, 1.0]).tolist() == [-np.inf, 0.0, np.inf]
        assert (student_quantile(np.zeros(1000), dof) == -np.inf).all()


@pytest.mark.parametrize("one", ALL[:6], ids=lambda one: f"{one.name}-{one.dof:g}")
def test_quantiles_and_sd_are_those_of_scipy(one):
    """Truth: another program, on the lower half, where its quantiles keep their digits."""
    other = OTHER_PROGRAM[type(one)](one)
    low = P[P <= 0.5]
    assert one.quantile(low) == pytest.approx(other.ppf(low), rel=1e-12)
    assert one.sd == pytest.approx(other.std(), rel=1e-12)


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("dof", [1.5, 3.0, 3.7, 5.0, 30.0, 1e5])
def test_many_quantiles_of_students_t(dof):
    """Property: many at once are those one by one, to the last tail, and the cdf undoes them."""
    tail = np.concatenate([np.geomspace(1e-15, 0.4, 2000), np.linspace(0.4, 0.499, 500), [0.5]])
    found = student_quantile(tail, dof)
    assert found == pytest.approx(np.array([student_quantile(p, dof) for p in tail]), rel=3e-12)
    assert stats.t.cdf(found[:-1], dof) == pytest.approx(tail[:-1], rel=1e-10)


def trapezoid_density(x, w, d):
    """JCGM 101:2008 equation 4, about the middle."""
    return np.log((w + d) / max(abs(x), w - d)) / (4 * d) if abs(x) < w + d else 0.0


@pytest.mark.parametrize(("w", "d"), [(0.7, 0.07), (0.7, 0.69), (2e-6, 1e-6)])
def test_a_curvilinear_trapezoid_has_its_published_density(w, d):
    """Second method: the quantile put back through quadrature of the published density."""
    one = CurvilinearTrapezoid(w, d)
    for p in (1e-6, 0.02, 0.06, 0.3, 0.5, 0.8):
        x = one.quantile(p)
        edges = [-w - d, *(edge for edge in (d - w, w - d) if edge < x), x]
        total = sum(
            quad(trapezoid_density, a, b, args=(w, d), epsabs=0, epsrel=1e-12)[0]
            for a, b in pairwise(edges)
        )
        assert total == pytest.approx(p, rel=1e-9)


def test_a_curvilinear_trapezoid_is_a_rectangle_of_unsure_limits():
    """Truth: JCGM 101:2008 6.4.3.4, the recipe to draw from it; standard error of 1e6 draws."""
    rng = np.random.default_rng(3)
    limit = rng.uniform(0.6, 1.0, 1_000_000)
    drawn = limit * rng.uniform(-1, 1, limit.size)
    one = CurvilinearTrapezoid(0.8, 0.2)
    assert drawn.std() == pytest.approx(one.sd, abs=4 * one.sd / np.sqrt(2e6))
    for p in (0.01, 0.05, 0.4):
        assert np.mean(drawn < one.quantile(p)) == pytest.approx(p, abs=4 * np.sqrt(p / 1e6))


@named
def test_quantiles_are_symmetric_and_rise(one):
    assert one.quantile(P) - one.mean == pytest.approx(one.mean - one.quantile(1 - P), rel=1e-4)
    assert np.all(np.diff(one.quantile(np.linspace(0.001, 0.999, 999))) > 0)
    assert one.quantile(0.5) == one.mean
    assert one.quantile(np.full((2, 3), 0.5)).shape == (2, 3)


@pytest.mark.parametrize("one", ALL[6:])
def test_sd_of_a_curvilinear_trapezoid(one):
    """Second method: the integral of squared quantiles over the probability."""
    edges = [0, one.inexactness / (2 * one.half_width), 0.5]
    halves = sum(quad(lambda p: (one.quantile(p) - 3.0) ** 2, *ends)[0] for ends in pairwise(edges))
    assert np.sqrt(2 * halves) == pytest.approx(one.sd, rel=1e-7)


def test_hardly_inexact_limits_are_exact_ones():
    """Limit d -> 0: the quantiles of a rectangle."""
    difference = CurvilinearTrapezoid(1.0, 1e-9).quantile(P) - Rectangular(1.0).quantile(P)
    assert np.abs(difference).max() < 1e-9


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("one", [one for one in ALL if not isinstance(one, StudentT)])
def test_the_characteristic_function_is_the_mean_cosine(one):
    """Second method: the mean of cos(t x) over evenly spread quantiles, 2e5 of them."""
    x = one.quantile((np.arange(200_000) + 0.5) / 200_000) - one.mean
    t = np.array([0.0, 1e-12, 0.3, 1.0, 4.0, 11.0])
    assert one.characteristic(t) == pytest.approx(np.cos(t[:, None] * x).mean(axis=1), abs=3e-5)
    assert one.characteristic(-4.0) == one.characteristic(4.0)


@pytest.mark.slow
@pytest.mark.parametrize("dof", [1, 2.4, 5, 40, 1e4])
def test_the_characteristic_function_of_students_t(dof):
    """Second method: Fourier integral of the density by quadrature; exp(-|t|) for one dof."""
    one = StudentT(0.7, dof=dof, mean=3.0)
    density = stats.t(dof, 0.0, 0.7).pdf
    for t in (0.3, 1.0, 4.0):
        half = quad(density, 0, np.inf, weight="cos", wvar=t, epsabs=1e-10, limlst=200)[0]
        assert one.characteristic(t) == pytest.approx(2 * half, abs=1e-9)
    assert one.characteristic(0.0) == 1.0


def test_standard_uncertainties_of_half_widths():
    """Closed form: a/sqrt(3), a/sqrt(6), a/sqrt(2) (JCGM 100 4.3.7, 4.3.9; JCGM 101 table 1)."""
    assert within(3.0).u == pytest.approx(np.sqrt(3))
    assert within(6.0, "triangular").u == pytest.approx(np.sqrt(6))
    assert within(2.0, "u-shaped").u == pytest.approx(np.sqrt(2))
    assert within(1.0, inexactness=0.3).u == pytest.approx(np.sqrt(1 / 3 + 0.01))


@pytest.mark.parametrize("name", ["normal", *FAMILIES])
def test_a_standard_uncertainty_is_kept(name):
    one = standard(0.2, name, mean=7.0)
    assert (one.u, one.sd, one.mean) == pytest.approx((0.2, 0.2, 7.0))
    assert one.name == name


def test_a_normal_whose_u_was_estimated_is_a_t():
    """JCGM 101:2008 6.4.9.7; the law of propagation uses the scale, Monte Carlo the shape."""
    one = standard(0.3, dof=4, mean=1.0)
    assert one == StudentT(0.3, dof=4, mean=1.0)
    assert (one.u, one.dof) == (0.3, 4)
    assert one.sd == pytest.approx(0.3 * np.sqrt(2))


def test_u_of_t_distribution_is_declared_one():
    by_scale = standard(0.3, "t", dof=4)
    by_sd = standard(by_scale.sd, "t", dof=4, u_is="sd")
    assert by_scale.u == 0.3
    assert by_sd.u == pytest.approx(by_scale.sd, rel=1e-15)  # 30 mm stay 30 mm
    assert by_sd.sd == pytest.approx(by_scale.sd, rel=1e-15)
    assert by_sd.quantile(0.9) == pytest.approx(by_scale.quantile(0.9), rel=1e-15)  # one shape
    assert (by_scale.u_dof, by_sd.u_dof) == (4, np.inf)


@pytest.mark.slow
def test_thermal_expansion_of_nist():
    """Published: NIST TN 1900, example E13, by the NIST Uncertainty Machine.

    Its figures, as the tests of Sandia's Suncal quote them: GUM 1.7266e-5, u 1.76e-6; Monte Carlo
    1.7268e-5, u 1.74e-6, 1/K. The inputs are Student's t with 3 degrees of freedom, by their sds.
    """
    declared = {
        "L0": (1.4999, 1e-4),
        "L1": (1.5021, 2e-4),
        "T0": (288.15, 0.02),
        "T1": (373.1, 0.05),
    }
    ts = [standard(u, "t", dof=3, mean=x, u_is="sd") for x, u in declared.values()]

    def alpha(x):
        l0, l1, t0, t1 = x
        return (l1 - l0) / (l0 * (t1 - t0))

    by_gum = propagate(alpha, Inputs([Input(n, t) for n, t in zip(declared, ts, strict=True)]))
    printed = figures_of(
        "docs/studies/propagation.md",
        "example E13 of NIST TN 1900: u = ()·10⁻⁶ 1/K by the law of propagation and ()·10⁻⁶ 1/K by "
        "Monte Carlo",
    )
    assert printed == ("1.76", "1.74")
    assert by_gum.values[0] == pytest.approx(1.7266e-5, abs=0.5e-9)
    assert by_gum.u[0] == pytest.approx(1.76e-6, abs=0.005e-6)
    drawn = simulate(lambda x: alpha(x.T)[:, None], ts, goal=Goal(plain_draws=200_000))
    assert drawn.value[0] == pytest.approx(1.7268e-5, rel=1e-3)
    assert drawn.u[0] == pytest.approx(1.74e-6, rel=1e-2)  # few draws have so heavy tails


def test_an_expanded_uncertainty():
    """Published: JCGM 100 H.1.3.1, U = 0.075 um with k = 3 is u = 25 nm, 18 dof; table G.2."""
    assert expanded(0.075, k=3, dof=18).u == pytest.approx(0.025)
    assert isinstance(expanded(0.075, k=3), Normal)
    assert expanded(2.45, probability=0.95, dof=6).u == pytest.approx(1.0, abs=2e-3)
    assert expanded(1.96, probability=0.95).u == pytest.approx(1.0, abs=2e-5)


def test_no_uncertainty_is_a_constant():
    for one in (standard(0.0, mean=2.0), within(0.0, mean=2.0), standard(0.0, dof=3, mean=2.0)):
        assert one.u == one.sd == 0
        assert np.all(one.quantile([0.0, 0.3, 1.0]) == 2.0)
        assert np.all(one.characteristic([0.0, 5.0]) == 1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: standard(-1.0), "sd -1"),
        (lambda: standard(np.nan), "finite"),
        (lambda: standard(np.inf), "finite"),
        (lambda: standard(1.0, mean=np.nan), "mean"),
        (lambda: standard(1.0, dof=0), "degrees of freedom 0"),
        (lambda: standard(1.0, dof=np.nan), "degrees of freedom nan"),
        (lambda: standard(1.0, dof=-np.inf), "degrees of freedom -inf"),
        (lambda: standard(1.0, "gaussian"), "expected one of normal"),
        (lambda: standard(1.0, "t"), "finite degrees of freedom"),
        (lambda: standard(1.0, "t", dof=2, u_is="sd"), "no standard deviation"),
        (lambda: standard(1.0, "t", dof=9, u_is="width"), "expected 'scale'"),
        (lambda: within(-1.0), "half_width -1"),
        (lambda: within(np.inf), "finite"),
        (lambda: within(1.0, "normal"), "no limits"),
        (lambda: within(1.0, inexactness=1.0), "inexactness < half-width"),
        (lambda: within(1.0, inexactness=-0.1), "inexactness -0.1"),
        (lambda: within(1.0, "triangular", inexactness=0.1), "expected rectangular"),
        (lambda: expanded(1.0), "its k or"),
        (lambda: expanded(1.0, k=2, probability=0.95), "its k or"),
        (lambda: expanded(1.0, k=0), "coverage factor 0"),
        (lambda: expanded(1.0, probability=95), "between 0 and 1"),
        (lambda: expanded(1.0, probability=0.95, dof=-1), "degrees of freedom -1"),
        (lambda: expanded(-1.0, k=2), "sd -0.5"),
        (lambda: standard(1.0).quantile(1.5), "outside 0 to 1"),
        (lambda: standard(1.0).quantile([0.5, np.nan]), "outside 0 to 1"),
    ],
)
def test_nonsense_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
