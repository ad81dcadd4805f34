"""The amplitudes of the form: simulation with known truth, and the slope of the likelihood."""

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.errors import SolutionError
from tankcal.geometry.form import Sample, free_columns, harmonics, mode_variances
from tankcal.geometry.spectrum import _evidence, _misfit, estimate_form


def simulated(rng, common, own=0.0, rising=0.0, *, courses=8, n=150, noise=0.003, level=False):
    """Samples of courses of radius 6.5 m with form of these amplitudes, in m2."""
    waves = np.sqrt(mode_variances(200))
    shared, samples = rng.normal(size=398) * waves * np.sqrt(common), []
    for course in range(courses):
        azimuth = np.arange(n) * 2 * np.pi / n if level else rng.uniform(0, 2 * np.pi, n)
        zeta = np.zeros(n) if level else rng.uniform(-1, 1, n)
        one = shared + rng.normal(size=398) * waves * np.sqrt(own)
        other = rng.normal(size=398) * waves * np.sqrt(rising)
        form = harmonics(azimuth, 200)[:, 3:] @ np.column_stack([one, other])
        radius = 6.5 + form[:, 0] + zeta * form[:, 1] + rng.normal(0, noise, n)
        samples.append(Sample(azimuth, radius, np.full(n, noise**2), course, zeta, 2 - 2 * level))
    return samples


TOTAL = 0.030**2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("common", "own", "rising"),
    [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.5, 0.5, 0.0), (0.5, 0.3, 0.2)],
)
def test_the_parts_of_the_form_are_separated(common, own, rising):
    """Four shells of 6 scanned courses: the mean within 25 %, what is not there under 5 %."""
    truth = TOTAL * np.array([common, own, rising])
    found = []
    for seed in range(4):
        form = estimate_form(simulated(np.random.default_rng(seed), *truth, courses=6, n=100))
        found.append([form.common_m2, form.own_m2, form.rising_m2])
    mean = np.mean(found, axis=0)
    assert mean == pytest.approx(truth, rel=0.25, abs=0.05 * TOTAL)


@pytest.mark.slow
def test_common_form_is_unbiased_for_equal_azimuths(figure):
    """Simulation, 24 targets a course, modes to 200 aliased: mean of 60 shells of about 21 dof."""
    rng = np.random.default_rng(3)
    options = {"courses": 5, "n": 24, "noise": 0.001, "level": True}
    found = [estimate_form(simulated(rng, TOTAL, **options)) for _ in range(60)]
    ratio = np.mean([form.common_m2 for form in found]) / TOTAL
    figure("estimated over true amplitude of a common form, 60 shells", f"{ratio:.3f}")
    assert ratio == pytest.approx(1.0, abs=3 * np.sqrt(2 / 21 / 60))
    assert np.mean([form.own_m2 for form in found]) < 0.01 * TOTAL
    assert np.mean([form.common_dof for form in found]) == pytest.approx(21.0, abs=1.5)


@pytest.mark.slow
def test_the_degrees_of_freedom_are_those_of_the_scatter(figure):
    """2 A^2 / var(A) of the amplitude, over 60 shells of independent courses."""
    rng = np.random.default_rng(4)
    options = {"courses": 5, "n": 24, "noise": 0.001, "level": True}
    found = [estimate_form(simulated(rng, 0.0, TOTAL, **options)) for _ in range(60)]
    own = np.array([form.own_m2 for form in found])
    scatter = 2 * np.mean(own) ** 2 / np.var(own, ddof=1)
    stated = np.mean([form.own_dof for form in found])
    figure(
        "dof of the own form: by the scatter of 60 shells, stated", f"{scatter:.0f} {stated:.0f}"
    )
    assert scatter / stated == pytest.approx(1.0, abs=3 * np.sqrt(2 / 60))


@pytest.mark.slow
def test_a_round_tank_has_no_form():
    """Simulation: the amplitude is far below what 3 mm of noise could hide in a mode."""
    form = estimate_form(simulated(np.random.default_rng(4), 0.0))
    assert np.sqrt(form.level_m2) < 0.001


def test_one_course_has_no_form_of_its_own():
    form = estimate_form(simulated(np.random.default_rng(5), TOTAL, courses=1, level=True))
    assert form.own_m2 == 0.0
    assert form.rising_m2 == 0.0
    assert form.common_m2 == pytest.approx(TOTAL, rel=0.5)


def test_perfect_points_have_a_form_too():
    samples = simulated(np.random.default_rng(6), TOTAL, courses=3, n=24, noise=1e-9, level=True)
    assert estimate_form(samples).common_m2 == pytest.approx(TOTAL, rel=0.8)


def test_full_covariance_and_its_factor_agree_with_variances():
    samples = simulated(np.random.default_rng(7), TOTAL, courses=2, n=40)
    full = [
        Sample(s.azimuth_rad, s.radius_m, np.diag(s.covariance_m2) / 4, s.course, s.zeta, s.degree)
        for s in samples
    ]
    plain, other = estimate_form(samples), estimate_form(full, 4.0)
    assert other.common_m2 == pytest.approx(plain.common_m2, rel=1e-3)


def test_the_slope_of_the_likelihood():
    """Courses of different numbers of points and degrees, one of them with more than columns."""
    rng = np.random.default_rng(8)
    samples = simulated(rng, TOTAL, TOTAL, TOTAL / 5, courses=2, n=160)
    samples += [
        Sample(s.azimuth_rad, s.radius_m, s.covariance_m2, 2, s.zeta, 0)
        for s in simulated(rng, TOTAL, courses=2, n=24, level=True)
    ]
    evidence = _evidence([[s for s in samples if s.course == c] for c in range(3)], 1.0)
    amplitudes = TOTAL * np.array([1.3, 0.7, 0.1])
    slopes = _misfit(evidence, amplitudes)[1]
    assert_derivative(
        lambda logs: np.array([_misfit(evidence, np.exp(logs))[0]]),
        np.log(amplitudes),
        (amplitudes * slopes)[None, :],
        step=1e-4,
    )


def test_free_columns():
    """Closed form: radius and centre, taper and lean, barrel."""
    columns = free_columns(np.array([0.3]), np.array([0.5]), 2)[0]
    cos, sin = np.cos(0.3), np.sin(0.3)
    expected = [1, cos, sin, 0.5, 0.5 * cos, 0.5 * sin, 1.5 * 0.25 - 0.5]
    assert columns == pytest.approx(expected)


def test_points_on_half_a_line_tell_nothing():
    place = np.full(6, 0.4)
    with pytest.raises(SolutionError, match="do not determine"):
        estimate_form([Sample(place, place + 6.5, np.full(6, 1e-6), 0, np.zeros(6))])
