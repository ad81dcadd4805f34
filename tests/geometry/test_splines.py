"""Periodic cubic splines against those of scipy, and a closed form."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tankcal.geometry.splines import cardinal_splines, periodic_slopes

TURN = 2 * np.pi


def uneven_knots(count):
    """Knots of one turn, neighbours up to four times as far apart as others."""
    step = np.random.default_rng(count).uniform(0.5, 2.0, count)
    return 0.3 + TURN * np.cumsum(step) / step.sum() * 0.999


@pytest.mark.parametrize("count", [2, 3, 5, 24, 200])
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_cardinal_splines_are_those_of_scipy(count, derivative):
    """Another program, by second derivatives instead of slopes."""
    knots = uneven_knots(count)
    at = np.linspace(knots[0], knots[0] + TURN, 301)[:-1]
    found = cardinal_splines(knots, TURN, periodic_slopes(knots, TURN), at, derivative)
    closed = np.vstack([np.eye(count), np.eye(count)[:1]])
    spline = CubicSpline(np.append(knots, knots[0] + TURN), closed, bc_type="periodic")
    expected = spline(at, derivative)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_spline_of_even_knots_keeps_a_wave():
    """Closed form: the slope of cos(k a) at even knots is -k sin(k a) by a known factor."""
    knots, mode = np.arange(16) * TURN / 16, 3
    step = TURN / 16
    factor = 3 * np.sin(mode * step) / (mode * step * (2 + np.cos(mode * step)))
    found = periodic_slopes(knots, TURN) @ np.cos(mode * knots)
    np.testing.assert_allclose(found, -mode * factor * np.sin(mode * knots), rtol=0, atol=1e-13)
