"""The noise of sections apart from the form of the wall, and Bartlett's test."""

import numpy as np
import pytest
import scipy.linalg
import scipy.stats

from tankcal.geometry.field.amplitudes import assumed_amplitudes, bartlett, noise_of_sections
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import Sites, free_design

RADIUS_M, POINTS, COURSES = 7.0, 18, 4


def field_of(radius_m=None, noise_m2=None):
    """A field of one ring in each course, or of the radii (n,) and noise (n, n) given."""
    ring = np.repeat(np.arange(COURSES), POINTS)
    sites = Sites(
        course=ring,
        ring=ring,
        zeta=np.zeros(len(ring)),
        azimuth_rad=np.tile(np.arange(POINTS) * 2 * np.pi / POINTS, COURSES),
        leans=np.zeros(len(ring), dtype=bool),
        welds_rad=(),
    )
    radius_m = np.full(len(ring), RADIUS_M) if radius_m is None else radius_m
    noise_m2 = 0.005**2 * np.eye(len(ring)) if noise_m2 is None else noise_m2
    return WallField(sites, radius_m, noise_m2, assumed_amplitudes(), RADIUS_M)


def members():
    return np.split(np.arange(COURSES * POINTS), COURSES)


def shared_noise(seed=5):
    """(n, n) covariance in which the points of each section share an error, and their scale."""
    rng = np.random.default_rng(seed)
    blocks = [
        0.004**2 * np.eye(POINTS) + 0.002**2 * np.outer(*2 * [rng.normal(size=POINTS)])
        for _ in range(COURSES)
    ]
    return scipy.linalg.block_diag(*blocks)


@pytest.mark.parametrize("noise", [None, shared_noise()], ids=["independent", "shared"])
def test_factors_and_dofs_by_the_null_space(noise):
    """Second method: P by the null space of X, dense; the square and its moments by traces."""
    plain = field_of(noise_m2=noise)
    rng = np.random.default_rng(8)
    whole = plain.covariance_m2
    radius = RADIUS_M + np.linalg.cholesky(whole) @ rng.normal(size=len(whole))
    field = field_of(radius, plain.noise_m2)
    design = free_design(field.sites)[0]
    left = scipy.linalg.null_space(design.T)
    precision = left @ np.linalg.solve(left.T @ whole @ left, left.T)
    pull = precision @ radius
    for found, own in zip(noise_of_sections(field, members()), members(), strict=True):
        block = np.ix_(own, own)
        product = field.noise_m2[block] @ precision[block]
        square = pull[own] @ field.noise_m2[block] @ pull[own]
        assert found.redundancy == pytest.approx(np.trace(product), rel=1e-6)
        assert found.factor == pytest.approx(square / np.trace(product), rel=1e-5)
        dof = np.trace(product) ** 2 / np.trace(product @ product)
        assert found.dof == pytest.approx(dof, rel=1e-6)


def drawn_factors(count, seed):
    """(count, courses) factors of walls and noise that are drawn from the model."""
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(field_of().covariance_m2)
    return np.array([
        [one.factor for one in noise_of_sections(
            field_of(RADIUS_M + root @ rng.normal(size=len(root))), members())]
        for _ in range(count)
    ])  # fmt: skip


@pytest.mark.slow
def test_factors_are_distributed_as_stated(figure):
    """Simulation: mean 1, and uniform probabilities by their degrees of freedom."""
    (first, *_) = noise_of_sections(field_of(), members())
    factors = drawn_factors(150, 4)
    figure("mean factor of the noise of 600 sections", f"{factors.mean():.3f}")
    assert factors.mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / first.dof / factors.size))
    p = scipy.stats.chi2.sf(factors[:, 0] * first.dof, first.dof)
    assert scipy.stats.kstest(p, "uniform").pvalue > 0.001


def test_noise_of_one_section_alone_shows_in_its_factor():
    """Closed form: ten times the departures of a section make a hundred times its square."""
    rng = np.random.default_rng(3)
    departures = 0.005 * rng.normal(size=COURSES * POINTS)
    first = noise_of_sections(field_of(RADIUS_M + departures), members())
    tenfold = noise_of_sections(field_of(RADIUS_M + 10 * departures), members())
    for before, after in zip(first, tenfold, strict=True):
        assert after.factor == pytest.approx(100 * before.factor, rel=1e-9)
        assert after.dof == pytest.approx(before.dof, rel=1e-12)


def test_a_scatter_of_rounding_errors_is_no_variance():
    factors = [one.factor for one in noise_of_sections(field_of(), members())]
    assert factors == [1e-6] * COURSES


@pytest.mark.parametrize("counts", [(5, 5, 5), (4, 11, 30, 7)])
def test_bartlett_is_that_of_scipy(counts):
    """Another program, on the samples themselves."""
    rng = np.random.default_rng(len(counts))
    samples = [rng.normal(0, 1 + 0.5 * i, n) for i, n in enumerate(counts)]
    expected = scipy.stats.bartlett(*samples)
    variances = [np.var(one, ddof=1) for one in samples]
    statistic, dof, p = bartlett(variances, [n - 1 for n in counts])
    assert (statistic, p) == pytest.approx((expected.statistic, expected.pvalue), rel=1e-12)
    assert dof == len(counts) - 1
