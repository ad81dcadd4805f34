"""Great ellipses of an upright ellipsoid: closed forms, published figures, second methods."""

import numpy as np
import pytest
from jacobians import assert_derivative
from page_figures import agree, figures_of
from scipy.special import ellipe

from tankcal.geometry.great_ellipses import (
    FormPrior,
    ellipse_length,
    fit_ellipsoid,
    great_circle_lengths,
    horizontal_axes,
)

EQUATOR = np.nan
PRIOR = FormPrior(0.01, 0.01)
THREE = np.radians([EQUATOR, 0.0, 90.0])
FOUR = np.radians([EQUATOR, 0.0, 60.0, 120.0])
MILLIMETRE2 = 1e-6


def fitted(azimuths, lengths, sd_m=0.0005):
    return fit_ellipsoid(azimuths, lengths, sd_m**2 * np.eye(len(lengths)), PRIOR)


def volume(axes):
    return 4 / 3 * np.pi * np.prod(axes)


def test_length_of_an_ellipse_by_legendre():
    """Second method: 4 p E(1 - q^2 / p^2) in Legendre's form."""
    for p, q in ((2.0, 1.0), (10.0, 9.99), (5.0, 0.1)):
        assert ellipse_length(p, q)[0] == pytest.approx(4 * p * ellipe(1 - q**2 / p**2), rel=1e-14)


def test_length_of_an_ellipse_is_homogeneous():
    """Property: Euler's theorem, of degree one."""
    length, by_p, by_q = ellipse_length(3.0, 2.0)
    assert 3 * by_p + 2 * by_q == pytest.approx(length, rel=1e-14)


def test_lengths_by_a_chain_of_chords():
    """Second method: a polygon of the plane's cut through x' M x = 1, by the general ellipsoid."""
    unknowns = np.array([10.0, 0.3, -0.2, 9.5])
    a, b, azimuth = horizontal_axes(unknowns)
    turn = np.linspace(0, 2 * np.pi, 200_001)
    along = np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
    across = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    form = (np.outer(along, along) / a**2 + np.outer(across, across) / b**2
            + np.outer(up, up) / unknowns[3] ** 2)  # fmt: skip

    def by_chords(first, second):
        way = np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second)
        places = way / np.sqrt(np.einsum("ki,ij,kj->k", way, form, way))[:, None]
        return np.linalg.norm(np.diff(places, axis=0), axis=1).sum()

    found, _ = great_circle_lengths(unknowns, np.radians([EQUATOR, 20.0, 110.0]))
    expected = [by_chords(along, across)]
    for degrees in (20.0, 110.0):
        u = np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees)), 0.0])
        expected.append(by_chords(u, up))
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("unknowns", [[10.0, 0.3, -0.2, 9.5], [10.0, 1e-4, 0.0, 10.0]])
def test_derivatives_of_lengths(unknowns):
    azimuths = np.radians([EQUATOR, 0.0, 37.0, 90.0])
    assert_derivative(
        lambda x: great_circle_lengths(x, azimuths)[0],
        unknowns,
        great_circle_lengths(unknowns, azimuths)[1],
        step=1e-5,
    )


def test_a_true_sphere_has_no_ovality():
    """Closed form: equal lengths are a sphere, and no derivative is undefined there."""
    found = fitted(FOUR, np.full(4, 20 * np.pi))
    assert found.axes_m == pytest.approx([10.0, 10.0, 10.0], abs=1e-12)
    assert np.all(np.isfinite(found.weights))


def test_published_ellipsoid_through_three_circles():
    """Published example: 62.8512 round the equator, 62.8431 and 62.8467 over the poles."""
    lengths = np.array([62.8512, 62.8431, 62.8467])
    found = fitted(THREE, lengths)
    a, b, c = found.axes_m
    assert [round(one, 6) for one in (b, a, c)] == [10.002506, 10.003652, 10.001074]
    assert np.degrees(horizontal_axes(found.unknowns)[2]) == pytest.approx(90.0)
    assert volume(found.axes_m) == pytest.approx(4191.8202, abs=1e-4)
    radii = lengths / (2 * np.pi)
    meridians = radii[1:].mean()
    assert volume([radii.mean()] * 3) == pytest.approx(4191.8203, abs=1e-4)
    wrong = volume([radii[0], radii[0], meridians])  # the meridian taken for the polar axis
    assert wrong == pytest.approx(4192.2405, abs=1e-4)
    assert wrong / volume(found.axes_m) - 1 == pytest.approx(1.0e-4, abs=5e-6)
    equator = volume([radii[0]] * 3)
    assert equator == pytest.approx(4192.6608, abs=1e-4)
    assert equator / volume(found.axes_m) - 1 == pytest.approx(2.0e-4, abs=5e-6)


def test_published_ellipsoid_of_equator_and_three_meridians():
    """Published example: a = b = 10.003, c = 9.996; equal weights of four circles are biased."""
    lengths, _ = great_circle_lengths([10.003, 0.0, 0.0, 9.996], FOUR)
    assert [round(one, 5) for one in lengths] == [62.85070, 62.82871, 62.82871, 62.82871]
    found = fitted(FOUR, lengths)
    assert found.axes_m == pytest.approx([10.003, 10.003, 9.996], abs=1e-8)
    assert volume(found.axes_m) == pytest.approx(4189.6273, abs=1e-4)
    radii = lengths / (2 * np.pi)
    first_order = volume([(radii[0] + 2 * radii[1]) / 3] * 3)
    assert first_order == pytest.approx(4189.6283, abs=1e-4)
    equal = volume([radii.mean()] * 3)
    assert equal == pytest.approx(4189.2618, abs=1e-4)
    assert equal / volume(found.axes_m) - 1 == pytest.approx(-8.7e-5, abs=5e-7)
    equator = volume([radii[0]] * 3)
    assert equator == pytest.approx(4192.5612, abs=1e-4)
    assert equator / volume(found.axes_m) - 1 == pytest.approx(7.0e-4, abs=5e-7)


def volume_columns(found):
    """(n,) relative derivative of the volume by the lengths: of a b c by m, A, B, c."""
    mean, cos, sin, pole = found.unknowns
    product = mean**2 - cos**2 - sin**2
    by = np.array([2 * mean, -2 * cos, -2 * sin, 0.0]) / product
    by[3] = 1 / pole
    return by @ found.weights


def test_published_uncertainty_of_three_circles():
    """Published: 5 mm on each of three circles is 0.014 % of the volume."""
    found = fitted(THREE, np.full(3, 20 * np.pi), sd_m=0.005)
    u = 0.005 * np.linalg.norm(volume_columns(found))
    assert u == pytest.approx(1.4e-4, abs=5e-6)
    closed = np.sqrt(3) * 0.005 / (20 * np.pi)  # V ~ (r_e + r_1 + r_2)^3: 3 u(r) sqrt(3) / (3 r)
    assert u == pytest.approx(closed, rel=1e-3)


def test_meridian_tells_no_axis_alone():
    """Property: without an equator the prior of the oblateness counts, with one it does not."""
    alone = fitted(np.radians([0.0, 60.0, 120.0]), np.full(3, 62.8))
    both = fitted(FOUR, np.full(4, 62.8))
    assert alone.by_prior.shape[1] == 3
    assert both.by_prior.shape[1] == 2
    mean, pole = alone.by_prior[[0, 3], 2]
    assert mean == pytest.approx(-pole, rel=1e-6)  # r + c is held, their difference is not
    assert mean == pytest.approx(0.005, rel=1e-3)


def test_uneven_meridians_lean_on_the_prior():
    """Property: meridians close together leave the polar axis to what is assumed of ovality."""
    even = fitted(FOUR, np.full(4, 62.8))
    near = fitted(np.radians([EQUATOR, 0.0, 5.0, 10.0]), np.full(4, 62.8))
    assert np.linalg.norm(even.by_prior[3]) < 1e-9
    assert np.linalg.norm(near.by_prior[3]) > 0.5 * PRIOR.ovality_m


def random_intervals(rng, azimuths, count, sd_m):
    """(count,) whether 95 % intervals of V hold, of random ellipsoids with axes within 0.1 %."""
    held = []
    for _ in range(count):
        a, b, c = 10 * (1 + rng.uniform(-1e-3, 1e-3, 3))
        azimuth = rng.uniform(0, np.pi)
        mean, half = (a + b) / 2, (a - b) / 2
        truth = [mean, half * np.cos(2 * azimuth), half * np.sin(2 * azimuth), c]
        lengths = great_circle_lengths(truth, azimuths)[0] + sd_m * rng.normal(size=len(azimuths))
        found = fitted(azimuths, lengths, sd_m)
        columns = np.append(sd_m * volume_columns(found), _of_prior(found))
        error = np.log(volume(found.axes_m) / volume([a, b, c]))
        held.append(abs(error) <= 1.959964 * np.linalg.norm(columns))
    return np.array(held)


def _of_prior(found):
    mean, cos, sin, pole = found.unknowns
    product = mean**2 - cos**2 - sin**2
    return np.array([2 * mean / product, -2 * cos / product, -2 * sin / product, 1 / pole]) @ (
        found.by_prior
    )


@pytest.mark.slow
def test_intervals_of_random_ellipsoids(figure):
    """Simulation: three perpendicular circles with 5 mm; a part of the study."""
    held = random_intervals(np.random.default_rng(7), THREE, 400, 0.005).mean()
    figure("three circles of 400 random ellipsoids: held", f"{held:.4f}")
    assert abs(held - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 400)


@pytest.mark.study
def test_intervals_of_ten_thousand_random_ellipsoids(figure):
    held = random_intervals(np.random.default_rng(2552), THREE, 10_000, 0.005).mean()
    axes, sd_mm, stated = figures_of(
        "docs/studies/spheres.md",
        "(axes within () %), with three perpendicular circles and () mm, 95 % intervals held () %",
    )
    assert (axes, sd_mm) == ("0.1", "5")
    assert agree([100 * held], [stated])
    figure("three circles of 10 000 random ellipsoids: held", f"{held:.4f}")
    assert 0.945 <= held <= 0.955


def test_equal_weights_of_four_circles_are_biased(figure):
    """Simulation: ten oblate spheres; the mean circle is low by half the oblateness over four."""
    rng = np.random.default_rng(3)
    equal, adjusted = [], []
    for _ in range(50):
        lengths = great_circle_lengths([10.0, 0.0, 0.0, 9.99], FOUR)[0] + 1e-3 * rng.normal(size=4)
        truth = volume([10.0, 10.0, 9.99])
        equal.append(volume([lengths.mean() / (2 * np.pi)] * 3) / truth - 1)
        adjusted.append(volume(fitted(FOUR, lengths, 1e-3).axes_m) / truth - 1)
    figure("oblate by 0.1 %: bias of equal weights, of the ellipsoid",
           f"{np.mean(equal):.2e} {np.mean(adjusted):.2e}")  # fmt: skip
    assert np.mean(equal) == pytest.approx(-1.25e-4, abs=2e-5)
    assert abs(np.mean(adjusted)) < 2e-5
