"""Outlines: their derivatives, their components and their coverage."""

from dataclasses import replace

import numpy as np
import pytest
from draws import draws
from jacobians import assert_derivative
from scipy.interpolate import CubicSpline
from shapes import azimuths, modes, ring

from tankcal.errors import SolutionError
from tankcal.geometry.outlines import HARMONICS, harmonics, mode_variances, polar, smooth_outline


def smooth_level(xy_m, noise_m2, form_m2):
    """The outline of one section whose points are level."""
    return smooth_outline(xy_m, 0.0, 0.0, noise_m2, form_m2, np.zeros(len(xy_m)), 0)


def outlines(seed=1):
    rng = np.random.default_rng(seed)
    shape, _ = modes(6.5, 2, rng.normal(0, 0.01, 4), rng.normal(0, 0.01, 4))
    even = ring(shape, azimuths(24, 0.2, rng))[:, :2]
    scattered = ring(shape, np.sort(rng.uniform(0, 2 * np.pi, 60)))[:, :2]
    return {
        "even": smooth_level(even, np.full(24, 1e-6), 1e-3),
        "scattered": smooth_level(scattered, np.full(60, 1e-6), 1e-3),
    }


@pytest.mark.parametrize("kind", ["even", "scattered"])
def test_the_derivative_by_azimuth(kind):
    outline = outlines()[kind]
    for azimuth in (0.3, 3.9, 6.2):
        slope = outline.radius_m([azimuth], derivative=1)
        assert_derivative(outline.radius_m, [azimuth], slope[:, None], tolerance=1e-6)


@pytest.mark.parametrize("kind", ["even", "scattered"])
def test_an_outline_closes(kind):
    outline = outlines()[kind]
    for derivative in (0, 1):
        start, end = outline.radius_m([1e-9, 2 * np.pi - 1e-9], derivative)
        assert start == pytest.approx(end, abs=1e-7)


def test_an_outline_goes_through_points_without_error():
    rng = np.random.default_rng(5)
    shape, _ = modes(6.5, 2, rng.normal(0, 0.01, 4), rng.normal(0, 0.01, 4))
    xy = ring(shape, azimuths(24, 0.2, rng))[:, :2]
    outline = smooth_level(xy, np.full(24, 1e-12), 1e-3)
    azimuth, radius = polar(xy, 0.0, 0.0)
    assert outline.radius_m(azimuth) == pytest.approx(radius, abs=1e-7)


def test_smoothing_recovers_low_modes_of_perfect_points():
    rng = np.random.default_rng(2)
    cosines, sines = rng.normal(0, 0.01, 4), rng.normal(0, 0.01, 4)
    shape, area = modes(6.5, 2, cosines, sines)
    xy = ring(shape, np.sort(rng.uniform(0, 2 * np.pi, 200)))[:, :2]
    outline = smooth_level(xy, np.full(200, 1e-10), 1e-3)
    assert outline.area_m2() == pytest.approx(area, rel=1e-6)
    assert outline.modes_m()[2:6] == pytest.approx(np.column_stack([cosines, sines]), abs=1e-5)


def test_modes_of_an_oval():
    """Closed form: 24 even points show modes 2, 22 and 26 alike; each has its share k^-3."""
    shape, _ = modes(6.5, 2, np.array([0.02]), np.array([-0.01]))
    outline = smooth_level(ring(shape, azimuths(24))[:, :2], np.full(24, 1e-10), 1e-3)
    assert outline.modes_m()[0, 0] == pytest.approx(6.5, abs=1e-7)
    share = 2.0**-3 / (2.0**-3 + 22.0**-3 + 26.0**-3)
    assert outline.modes_m()[2] == pytest.approx([0.02 * share, -0.01 * share], abs=1e-7)


@pytest.mark.parametrize("kind", ["even", "scattered"])
def test_unseen_form_equals_effect_of_one_mode(kind):
    """Second method: fit the same azimuths to a shape that holds the mode."""
    plain = outlines()[kind]
    grid = np.linspace(0, 6, 7)
    unseen = replace(plain, form_m2=1e-6).unseen_form_m(grid)
    for k, column in ((3, 2), (24, 44)):
        sd = 1e-3 * k**-1.5
        radius = 6.5 + sd * np.cos(k * plain.azimuth_rad)
        shown = plain.basis(grid) @ (plain.from_radii @ radius)
        assert shown - 6.5 - sd * np.cos(k * grid) == pytest.approx(unseen[:, column], abs=1e-8)


def test_taper_lean_and_barrel_of_a_course_are_free():
    """Closed form: whatever the prior of the form, they come out as they are."""
    rng = np.random.default_rng(6)
    azimuth, zeta = rng.uniform(0, 2 * np.pi, 60), rng.uniform(-1, 1, 60)
    radius = 6.5 + zeta * (0.003 + 0.002 * np.cos(azimuth)) + 0.004 * (1.5 * zeta**2 - 0.5)
    levels, noise = [-0.7, 0.0, 0.7], np.full(60, 4e-6)
    xy = ring(radius, azimuth)[:, :2]
    for level in levels:
        outline = smooth_outline(xy, 0.0, 0.0, noise, 1e-3, zeta - level, 2)
        expected = np.zeros(len(outline.parameters))
        expected[0] = 6.5 + 0.003 * level + 0.004 * (1.5 * level**2 - 0.5)
        expected[1] = 0.002 * level
        assert outline.parameters == pytest.approx(expected, abs=1e-12)


def test_points_at_one_height_do_not_determine_a_taper():
    xy = ring(6.5, azimuths(24))[:, :2]
    with pytest.raises(SolutionError, match="do not determine"):
        smooth_outline(xy, 0.0, 0.0, np.full(24, 1e-6), 1e-3, np.full(24, 0.3), 1)


def coverage(tanks):
    """Part of simulated sections whose true area lies within 1.96 u: noise, form and a gap."""
    rng = np.random.default_rng(6)
    inside = 0
    for _ in range(tanks):
        azimuth = np.sort(rng.uniform(0.6, 2 * np.pi, 60))  # a gap of 34 deg
        coefficients = np.concatenate([[6.5, 0, 0], np.sqrt(0.02**2 * mode_variances(HARMONICS))])
        coefficients[3:] *= rng.normal(size=len(coefficients) - 3)
        area = np.pi * 6.5**2 + np.pi / 2 * np.sum(coefficients[3:] ** 2)
        radius = harmonics(azimuth, HARMONICS) @ coefficients + rng.normal(0, 0.003, 60)
        outline = smooth_level(ring(radius, azimuth)[:, :2], np.full(60, 0.003**2), 0.02**2)
        nodes, weight = outline.nodes()
        gradient = (outline.radius_m(nodes) * weight) @ outline.basis(nodes)
        variance = 0.003**2 * np.sum((gradient @ outline.from_radii) ** 2)
        even = np.arange(720) * np.pi / 360
        form = outline.radius_m(even) @ outline.unseen_form_m(even) * np.pi / 360
        variance += np.sum(form**2)
        inside += abs(outline.area_m2() - area) < 1.96 * np.sqrt(variance)
    return inside / tanks


@pytest.mark.slow
@pytest.mark.twentieth
def test_a_smoothed_area_is_covered_by_its_uncertainty(figure):
    """Simulation, 95 % within 3 binomial standard errors of 200 tanks."""
    part = coverage(200)
    figure("coverage of 95 % intervals, smoothed area with a gap, 200 tanks", f"{part:.3f}")
    assert abs(part - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 200)


@pytest.mark.study
def test_a_smoothed_area_is_covered_by_its_uncertainty_study(figure):
    """Simulation, 95 % within 3 binomial standard errors: 0.6 % of 1200 tanks, 0.3 % of 4000."""
    tanks = draws(600, 4000)
    part = coverage(tanks)
    figure(f"coverage of 95 % intervals, smoothed area with a gap, {tanks} tanks", f"{part:.4f}")
    assert abs(part - 0.95) < 3 * np.sqrt(0.95 * 0.05 / tanks)


def area_of_spline(azimuth, radius):
    """Area within the periodic cubic spline through points of ascending azimuths."""
    around = np.append(azimuth, azimuth[0] + 2 * np.pi)
    spline = CubicSpline(around, np.append(radius, radius[0]), bc_type="periodic")
    even = azimuth[0] + np.arange(7200) * np.pi / 3600
    return np.pi * np.mean(spline(even) ** 2)


def bridged(sections, noise):
    """Area errors of 23 of 24 generatrices: by the spline, and by the spectrum of the form."""
    rng = np.random.default_rng(9)
    form_m2 = 0.02**2 / np.sum(np.arange(2.0, 201) ** -3)
    sd = np.sqrt(form_m2 * np.repeat(np.arange(2.0, 201) ** -3, 2))
    azimuth, errors = np.delete(azimuths(24), 7), []
    waves = harmonics(azimuth, 200)[:, 3:]
    for _ in range(sections):
        wave = rng.normal(size=398) * sd
        xy = ring(6.5 + waves @ wave + rng.normal(0, noise, 23), azimuth)[:, :2]
        spline = area_of_spline(*polar(xy, 0.0, 0.0))
        smooth = smooth_level(xy, np.full(23, noise**2), form_m2)
        truth = np.pi * 6.5**2 + np.pi / 2 * wave @ wave
        errors.append([spline - truth, smooth.area_m2() - truth])
    return np.array(errors)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.001, 0.014])
def test_a_missing_generatrix_is_bridged_better_by_the_spectrum(noise, figure):
    """Simulation, 400 sections with form of 20 mm rms: the reason why no outline is a spline."""
    errors = bridged(400, noise)
    rms = 1e6 * np.sqrt(np.mean(errors**2, axis=0)) / (np.pi * 6.5**2)
    figure(
        f"area with a generatrix missing, noise {noise} m: rms ppm by spline, spectrum",
        rms.round(1),
    )
    assert rms[1] < rms[0]


def test_azimuths_count_clockwise_from_y():
    azimuth, radius = polar([[0, 2], [3, 0], [0, -4], [-5, 0]], 0.0, 0.0)
    assert np.degrees(azimuth) == pytest.approx([0, 90, 180, 270])
    assert radius == pytest.approx([2, 3, 4, 5])
