"""Sobol points against those of scipy, to the last bit, and what makes them a net."""

import numpy as np
import pytest
from scipy.stats import qmc

from tankcal.gum.monte_carlo.inputs import COORDINATES, sobol_points


@pytest.mark.parametrize("inputs", [0, 1, 2, 15, COORDINATES, COORDINATES + 1])
def test_points_are_those_of_scipy(inputs):
    """Another program: direction numbers, scrambling and order, bit by bit."""
    seed = np.random.SeedSequence(7).spawn(1)[0].generate_state(1)[0]
    found = sobol_points(512, inputs, seed)
    expected = qmc.Sobol(inputs, rng=np.random.default_rng(seed)).random(512)
    np.testing.assert_array_equal(found, expected)


def test_each_interval_holds_one_point():
    """Property of a net: of 2^m points one lies in each 2^-m of every coordinate."""
    for count in (1, 2, 64, 1024):
        cells = np.sort(np.floor(count * sobol_points(count, 5, 3)), axis=0)
        np.testing.assert_array_equal(cells, np.arange(count)[:, None].repeat(5, axis=1))
