"""Quadrature: exact polynomials, known areas and volumes."""

import numpy as np
import pytest

from tankcal.quadrature import (
    height_basis,
    height_polynomials,
    panels,
    polar_products,
)


@pytest.mark.parametrize("nodes", [1, 2, 3, 4, 7])
def test_a_rule_is_exact_up_to_degree_2n_minus_1(nodes):
    x, w = panels([-1.0, 0.3, 2.0], nodes)
    for degree in range(2 * nodes):
        exact = (2.0 ** (degree + 1) - (-1.0) ** (degree + 1)) / (degree + 1)  # closed form
        assert w @ x**degree == pytest.approx(exact, rel=1e-13, abs=1e-13)
    degree = 2 * nodes
    exact = (2.0 ** (degree + 1) - (-1.0) ** (degree + 1)) / (degree + 1)
    assert abs(w @ x**degree - exact) > 1e-9  # and no further


def test_gauss_levels_of_a_course():
    """Published: two levels at 0.2113 and 0.7887 of a course, three at 0.1127, 0.5, 0.8873."""
    assert panels([0, 1], 2)[0] == pytest.approx([0.2113, 0.7887], abs=5e-5)
    assert panels([0, 1], 3)[0] == pytest.approx([0.1127, 0.5, 0.8873], abs=5e-5)


def test_polar_products_of_a_circle_and_an_ellipse():
    azimuth, weight = panels(np.linspace(0, 2 * np.pi, 41), 4)
    a, b = 6.5, 6.4
    ellipse = a * b / np.hypot(b * np.cos(azimuth), a * np.sin(azimuth))
    circle = np.full_like(azimuth, 3.0)
    products = polar_products([circle, ellipse], weight)
    assert products[0, 0] == pytest.approx(np.pi * 9, rel=1e-13)  # closed form
    assert products[1, 1] == pytest.approx(np.pi * a * b, rel=1e-12)  # closed form
    mixed = 0.7 * circle + 0.3 * ellipse
    share = np.array([0.7, 0.3])
    assert share @ products @ share == pytest.approx(polar_products(mixed, weight)[0, 0], rel=1e-13)


def test_height_basis_reproduces_polynomials_and_sums_to_one():
    levels, z = [0.2, 0.9, 1.7], np.array([0.0, 1.0, 1.9])
    for degree in (0, 1, 2):
        assert height_basis(levels, z, degree).sum(axis=1) == pytest.approx(1.0, abs=1e-13)
    parabola = 6.5 + 0.01 * np.array(levels) - 0.002 * np.array(levels) ** 2
    expected = 6.5 + 0.01 * z - 0.002 * z**2
    assert height_basis(levels, z, 2) @ parabola == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_height_polynomials_are_the_basis_in_powers(degree):
    levels, t = [0.1, 0.5, 0.7], np.linspace(0, 1, 5)
    basis = np.vander(t, degree + 1, increasing=True) @ height_polynomials(levels, degree)
    assert basis == pytest.approx(height_basis(levels, t, degree), abs=1e-13)
