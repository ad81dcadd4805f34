"""The gap of a board over a weld, and its uncertainty, from a profile of the wall."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tankcal.products.inspection.weld_gaps import BOARD_M, bead_height, board_gap, profile_gaps

CELL_M = 0.0125
CELLS_M = CELL_M * np.arange(-42, 43)
MIDDLE = 42


def _means_of_cusp(wide_m, size=1.0):
    """Means of size exp(-|s| / wide) over the cells: closed form."""
    low, high = CELLS_M - CELL_M / 2, CELLS_M + CELL_M / 2

    def below(s):
        return np.sign(s) * wide_m * (1 - np.exp(-np.abs(s) / wide_m))

    return size * (below(high) - below(low)) / CELL_M


# Truth: the example of the specification, to its last digit.
@pytest.mark.parametrize(("wide_m", "gap"), [(0.10, 7.92), (0.15, 7.62), (0.30, 6.26)])
def test_gap_of_the_example(wide_m, gap):
    s = np.linspace(-0.5, 0.5, 2001)
    found = board_gap(s, 8 * np.exp(-np.abs(s) / wide_m))
    assert round(float(np.nanmax(found)), 2) == gap
    assert s[np.nanargmax(found)] == pytest.approx(0, abs=1e-9)


def test_gap_is_signed_and_ends_with_the_board():  # property: a mirror of the example
    s = np.linspace(-0.5, 0.5, 2001)
    e = 8 * np.exp(-np.abs(s) / 0.15)
    assert_allclose(board_gap(s, -e), -board_gap(s, e))
    assert np.all(np.isnan(board_gap(s, e)) == (np.abs(s) > BOARD_M / 2))


def test_shift_and_lean_drop_out():  # property: exact, of formula and of cells
    e, sd = 0.008 * np.exp(-np.abs(CELLS_M) / 0.1), np.full(len(CELLS_M), 2e-4)
    moved = e + 0.013 - 0.02 * CELLS_M
    assert_allclose(board_gap(CELLS_M, moved), board_gap(CELLS_M, e), atol=1e-15)
    one, other = (profile_gaps(CELLS_M, each, sd) for each in (e, moved))
    assert_allclose(one.gap_m, other.gap_m, atol=1e-15)
    assert_allclose(one.noise_m2, other.noise_m2)


def test_another_centre_drops_out_to_first_order():  # closed form: a (1 - cos(b / 2R))
    radius, away = 6.5, 0.005
    e = away * np.cos(CELLS_M / radius)
    gap = board_gap(CELLS_M, e)[MIDDLE]
    assert gap == pytest.approx(away * (1 - np.cos(BOARD_M / 2 / radius)), rel=1e-3)
    assert gap < 1.3e-5


# Truth: the means of the cells by closed form, the gap by that of the page.
@pytest.mark.parametrize("wide_m", [0.1, 0.15, 0.3])
def test_what_cells_miss_of_a_cusp_is_told(wide_m):
    found = profile_gaps(CELLS_M, _means_of_cusp(wide_m, 0.008), np.full(len(CELLS_M), 1e-7))
    truth = 0.008 * (1 - np.exp(-BOARD_M / 2 / wide_m))
    missed = truth - found.gap_m[MIDDLE]
    assert 0 < missed < 3e-4
    assert missed < 1.96 * np.sqrt(found.missed_m2[MIDDLE])


@pytest.mark.slow
def test_noise_of_a_gap():  # truth: the spread of 4000 simulated profiles
    rng = np.random.default_rng(1)
    e, sd = _means_of_cusp(0.15, 0.008), rng.uniform(1e-4, 4e-4, len(CELLS_M))
    noisy = e + sd * rng.normal(size=(4000, len(e)))
    for has_bead in (False, True):
        gaps = np.array([profile_gaps(CELLS_M, one, sd, has_bead=has_bead).gap_m for one in noisy])
        told = profile_gaps(CELLS_M, e, sd, has_bead=has_bead)
        inner = slice(MIDDLE - 12, MIDDLE + 13)
        assert_allclose(gaps[:, inner].mean(axis=0), told.gap_m[inner], atol=4 * 5e-4 / 63)
        assert_allclose(gaps[:, inner].var(axis=0), told.noise_m2[inner], rtol=0.12)


# Truth: the form without its bead. What a ridge of 0.1 m rises under the bead is told for less.
@pytest.mark.parametrize(("wide_m", "short_m"), [(0.1, 4.5e-4), (0.15, 2.5e-4), (0.3, 1e-4)])
def test_bead_is_no_peak(wide_m, short_m):
    e = _means_of_cusp(wide_m, 0.008)
    truth = 0.008 * (1 - np.exp(-BOARD_M / 2 / wide_m))
    bead = 0.0025 * (np.abs(CELLS_M) < 0.01)
    sd = np.full(len(e), 1e-5)
    bare, seen = (profile_gaps(CELLS_M, one, sd) for one in (e, e + bead))
    assert bead_height(CELLS_M, bare.gap_m) < 0.001 < bead_height(CELLS_M, seen.gap_m)
    found = profile_gaps(CELLS_M, e + bead, sd, has_bead=True)
    short = truth - found.gap_m[MIDDLE]
    assert 0 <= short < short_m
    assert short < 1.96 * np.sqrt((found.noise_m2 + found.missed_m2)[MIDDLE])


def _without(hidden):
    e = np.where(hidden, np.nan, 0.008 * np.exp(-np.abs(CELLS_M) / 0.1))
    return profile_gaps(CELLS_M, e, np.full(len(e), 2e-4))


def test_profile_that_bears_no_board():  # property
    assert _without(np.zeros(len(CELLS_M), dtype=bool)) is not None
    assert _without(np.abs(CELLS_M - 0.3) < 0.05) is not None  # nothing hangs on it
    assert _without(np.abs(CELLS_M - 0.05) < 0.05) is None  # the peak may lie there
    assert _without(CELLS_M > 0.44) is None
    assert _without(CELLS_M < -0.44) is None
    assert _without(np.ones(len(CELLS_M), dtype=bool)) is None


@pytest.mark.parametrize("radius_m", [2.5, 6.5, 40.0])
def test_points_24_a_section_bear_no_board(radius_m):  # wherever the first of them is
    away = 2 * np.pi * radius_m / 24
    for first in np.linspace(0, away, 13)[:-1]:
        points = first + away * np.arange(-12, 12)
        hit = np.array([np.any(np.abs(points - s) <= CELL_M / 2) for s in CELLS_M])
        assert _without(~hit) is None
