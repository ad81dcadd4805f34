"""Coarse cells of an unrolled wall: means within courses, hidden cells."""

from types import SimpleNamespace

import numpy as np
import pytest

from tankcal.clouds.wall.cells import CellGrid, unroll_wall


def make_wall(radius_m, joints_m, sides=("inside",)):
    """Cells of a wall whose radius (scans, rows, columns) is nan where it is hidden."""
    rows, columns = radius_m.shape[1:]
    edges = np.linspace(joints_m[0], joints_m[-1], rows + 1)
    return SimpleNamespace(
        grid=CellGrid(edges, columns),
        joints_m=joints_m,
        sides=sides,
        radius_m=radius_m,
        is_wall=np.isfinite(radius_m),
    )


def test_cells_of_a_small_wall_are_not_merged():
    """Closed form: deviations from the mean of each course, in tenths of a millimetre."""
    radius = np.array([[[5.001, 4.999, 5.0], [5.011, np.nan, 5.009]]])
    unrolled = unroll_wall(make_wall(radius, (1.0, 2.0, 3.0)))
    assert unrolled.is_shown.tolist() == [[True, True, True], [True, False, True]]
    assert unrolled.departure_tenths_mm[unrolled.is_shown].tolist() == [10, -10, 0, 10, -10]
    assert unrolled.height_edges_m == pytest.approx([1, 2, 3])
    assert unrolled.azimuth_edges_deg == pytest.approx([0, 120, 240, 360])


def test_cells_of_a_large_wall_are_merged_within_their_courses():
    """Closed form: means of blocks of a plane in azimuth; no block passes a joint."""
    turn = (np.arange(300) + 0.5) / 300
    radius = np.tile(0.006 * (turn - 0.5), (1, 130, 1)) + 5.0
    radius[0, 70:] += 0.02
    unrolled = unroll_wall(make_wall(radius, (0.0, 7.0, 13.0)), most=1000)
    rows, columns = unrolled.is_shown.shape
    assert rows * columns <= 1000 < 2 * rows * columns
    assert 7.0 in np.round(unrolled.height_edges_m, 9)
    edges = unrolled.azimuth_edges_deg
    expected = 60 * ((edges[1:] + edges[:-1]) / 720 - 0.5)
    np.testing.assert_allclose(unrolled.departure_tenths_mm, np.tile(expected, (rows, 1)), atol=1)


def test_scans_of_each_side_are_compared_with_the_mean_of_their_side():
    """Property: both faces of the plate give one deviation."""
    form = 0.002 * np.sin(np.arange(8) * np.pi / 4)
    radius = np.array([[5.0 + form], [5.01 + form]])
    unrolled = unroll_wall(make_wall(radius, (0.0, 1.0), ("inside", "outside")))
    assert unrolled.departure_tenths_mm.tolist() == [np.rint(1e4 * form).astype(int).tolist()]


def test_a_block_with_less_than_half_of_its_cells_is_hidden():
    radius = np.full((1, 2, 4), 5.0)
    radius[0, :, 0] = radius[0, 0, 1] = np.nan
    unrolled = unroll_wall(make_wall(radius, (0.0, 1.0)), most=2)
    assert unrolled.is_shown.tolist() == [[False, True]]
    assert unrolled.departure_tenths_mm[0, 1] == 0
