"""Cells of a wall: sums that do not hang on order or pieces, surfaces, samples."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tankcal.clouds.wall.cells import CellGrid, WallCells
from tankcal.clouds.wall.passes import PointSample
from tankcal.clouds.wall.start import CylinderSurface, SphereSurface

UPRIGHT = CylinderSurface(np.array([500.0, -20.0, 3.0]), 5.0, (0.004, -0.002))
LYING = CylinderSurface(
    np.array([1.0, 2.0, 3.0]),
    1.5,
    (0.001, 0.01),
    np.array([[0.6, -0.8, 0.0], [0.0, 0.0, -1.0], [0.8, 0.6, 0.0]]),
)
SPHERE = SphereSurface(np.array([1.0, 2.0, 10.0]), 6.0)
GRID = CellGrid(np.array([0.0, 0.5, 1.1, 2.0, 4.0]), 37)


def _points(count=5000, seed=1):
    rng = np.random.default_rng(seed)
    u, turn = rng.uniform(-0.2, 4.2, count), rng.uniform(0, 2 * np.pi, count)
    return UPRIGHT.points(u, turn, rng.normal(0, 0.05, count))


def _sums(pieces):
    cells = WallCells(UPRIGHT, GRID, 2)
    for scan, xyz in pieces:
        cells.add(xyz, scan)
    return cells


def _assert_same_bytes(one, other):
    for name in ("sums", "turn", "along", "far", "delivered", "outside", "beyond"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


@pytest.mark.slow
@pytest.mark.parametrize("size", [1, 7, 1000, 4999])
def test_pieces_and_order_change_nothing(size):  # property
    xyz = _points()
    order = np.random.default_rng(2).permutation(len(xyz))
    whole = _sums([(0, xyz), (1, xyz[:100])])
    pieces = [(0, xyz[order[i : i + size]]) for i in range(0, len(xyz), size)]
    _assert_same_bytes(_sums([(1, xyz[:100]), *pieces]), whole)


def test_merged_sums_are_those_of_all():  # property
    xyz = _points()
    whole = _sums([(0, xyz), (1, xyz[:100])])
    first, second = _sums([(0, xyz[:3000])]), _sums([(0, xyz[3000:]), (1, xyz[:100])])
    _assert_same_bytes(first + second, whole)
    _assert_same_bytes(second.merge(first), whole)


def test_every_point_is_counted_once():  # property
    cells = _sums([(0, _points())])
    near = int(cells.counts(0).sum())
    assert near + cells.beyond[0] + cells.outside[0] == cells.delivered[0] == 5000
    assert cells.far.sum() == cells.beyond[0]


def test_sums_of_units_are_those_of_the_distances():  # closed form: a loop over the points
    xyz = _points()
    u, turn, distance = UPRIGHT.places(xyz)
    row = np.searchsorted(GRID.edges_m, u, side="right") - 1
    column = (turn * GRID.columns / (2 * np.pi)).astype(int)
    mine = (row == 2) & (column == 11) & (np.abs(distance) < GRID.band_m)
    cells = _sums([(0, xyz)])
    counts, units = cells.counts(0)[2, 11], cells.units(0)[2, 11]
    total = units.sum() + counts @ (np.arange(GRID.bins) * 256)
    mean = (total / counts.sum() + 0.5) * GRID.unit_m - GRID.band_m
    assert counts.sum() == mine.sum() > 10
    assert_allclose(mean, distance[mine].mean(), atol=GRID.unit_m)


@pytest.mark.parametrize("surface", [UPRIGHT, LYING, SPHERE])
def test_places_and_points_are_inverse(surface):  # closed form
    rng = np.random.default_rng(3)
    u, turn, off = rng.uniform(5, 14, 50), rng.uniform(0, 6.28, 50), rng.normal(0, 0.03, 50)
    assert_allclose(surface.places(surface.points(u, turn, off)), (u, turn, off), atol=1e-12)


def test_azimuth_of_an_upright_tank_is_clockwise_from_north():  # closed form
    surface = CylinderSurface(np.zeros(3), 5.0)
    xyz = np.array([[0.0, 5.0, 1.0], [5.0, 0.0, 2.0], [0.0, -5.1, 3.0]])
    u, turn, off = surface.places(xyz)
    assert_allclose([u, turn, off], [[1, 2, 3], [0, np.pi / 2, np.pi], [0, 0, 0.1]], atol=1e-12)


def test_zones_of_a_sphere_have_equal_areas():  # closed form: Archimedes
    directions = np.random.default_rng(4).normal(size=(200_000, 3))
    xyz = SPHERE.centre_m + 6 * directions / np.linalg.norm(directions, axis=1)[:, None]
    cells = WallCells(SPHERE, CellGrid(np.linspace(4, 16, 11), 8), 1)
    cells.add(xyz, 0)
    counts = cells.counts(0).sum(axis=2)
    assert np.abs(counts - 2500).max() < 5 * 50


def test_sample_hangs_on_the_points_alone():  # property
    xyz = _points(20_000)
    samples = [PointSample(900) for _ in range(4)]
    samples[0].add(xyz, 0)
    for i in range(0, len(xyz), 777):
        samples[1].add(xyz[::-1][i : i + 777], 0)
    samples[2].add(xyz[:5000], 0)
    samples[3].add(xyz[5000:], 0)
    both = samples[3].merge(samples[2])
    assert both.delivered == {0: 20_000}
    assert_array_equal(samples[1].points(), samples[0].points())
    assert_array_equal(both.points(), samples[0].points())
    assert len(both.points()) == 900


def test_sample_is_fair():  # simulation: halves of the wall have their part, within 4 sd
    xyz = _points(50_000)
    sample = PointSample(10_000)
    sample.add(xyz, 0)
    upper = np.mean(sample.points()[:, 2] > np.median(xyz[:, 2]))
    assert abs(upper - 0.5) < 4 * 0.5 / np.sqrt(10_000)
