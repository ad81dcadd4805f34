"""Surfaces of triangles: closed forms, and sampling as the second method."""

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.tank.bottoms import Footprint, surface

ROUND = Footprint(3.0, 1.0, np.full(360, 6.5))


def oval(n=360):
    azimuth = np.arange(n) * 2 * np.pi / n
    return Footprint(3.0, 1.0, 6.5 + 0.04 * np.cos(2 * azimuth) + 0.01 * np.sin(5 * azimuth))


def uneven(footprint, rings=6, azimuths=24):
    """A surface with heights in all directions, some of them alike."""
    plan, faces = footprint.mesh(rings, azimuths)
    return plan, surface(plan, faces, np.round(0.05 * np.sin(plan[:, 0]) + 0.02 * plan[:, 1], 2))


def test_the_area_of_an_oval_closed_form():
    exact = np.pi * (6.5**2 + (0.04**2 + 0.01**2) / 2)
    assert oval().area_m2 == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("mesh", [(1, 720), (5, 36), (48, 144)])
def test_a_mesh_has_the_area_of_its_footprint(mesh):
    plan, faces = oval().mesh(*mesh)
    assert surface(plan, faces, plan[:, 0]).areas_m2.sum() == pytest.approx(
        oval().area_m2, rel=1e-13
    )


def test_a_plane_across_one_triangle_closed_form():
    """z = x over the corners (0, 0), (1, 0), (0, 1): below L area L - L^2 / 2, moment so on."""
    plan = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    one = surface(plan, np.array([[0, 1, 2]]), plan[:, 0])
    levels = np.array([-0.1, 0.0, 0.25, 0.5, 1.0, 2.0])
    kept = np.clip(levels, 0, 1)
    volume, area = one.volume_and_area(levels)
    assert area == pytest.approx(kept - kept**2 / 2, abs=1e-15)
    expected = kept**2 / 2 - kept**3 / 6 + (levels - kept) * 0.5 * (levels > 1)
    assert volume == pytest.approx(expected, abs=1e-15)


def middles(k):
    """(k^2, 3) barycentric middles of the k^2 equal triangles that a triangle divides into."""
    i, j = np.divmod(np.arange(k * k), k)
    upright = i + j < k
    part = np.where(upright, 1, 2)[:, None] / 3
    a, b = np.where(upright, i, k - 1 - i), np.where(upright, j, k - 1 - j)
    a, b = (np.column_stack([a, b]) + part).T / k
    return np.column_stack([a, b, 1 - a - b])


def test_below_a_level_second_method():
    """Against the middles of 1600 equal parts of every triangle."""
    _, found = uneven(oval())
    heights = found.heights_m[found.faces] @ middles(40).T
    weight = found.areas_m2[:, None] / 1600
    levels = np.array([-0.103, -0.021, 0.002, 0.033, 0.121])
    volume, area = found.volume_and_area(levels)
    for level, v, a in zip(levels, volume, area, strict=True):
        assert v == pytest.approx(np.sum(weight * np.maximum(level - heights, 0)), rel=2e-4)
        assert a == pytest.approx(np.sum(weight * (heights <= level)), rel=2e-3)


def test_a_cone_below_every_level_closed_form():
    """The mesh of a cone drawn out to its outline is exact: A d^3 / (3 H^2)."""
    footprint = oval()
    plan, faces = footprint.mesh(24, 72)
    ring = np.append(0.0, np.repeat(np.arange(1, 25) / 24, 72))
    cone = surface(plan, faces, -0.15 * (1 - ring))
    depth = np.array([0.01, 0.06, 0.1, 0.15])
    volume, area = cone.volume_and_area(depth - 0.15)
    assert volume == pytest.approx(footprint.area_m2 * depth**3 / (3 * 0.15**2), rel=1e-12)
    assert area == pytest.approx(footprint.area_m2 * (depth / 0.15) ** 2, rel=1e-12)


def test_the_area_is_the_derivative_of_the_volume():
    _, found = uneven(ROUND)
    levels = np.array([-0.0843, -0.0212, 0.0051, 0.0834])
    assert_derivative(
        lambda x: found.volume_and_area(levels + x[0])[0],
        [0.0],
        found.volume_and_area(levels)[1][:, None],
        step=1e-5,
        tolerance=1e-6,
    )


def test_wet_weights_are_derivatives_by_vertex_heights():
    plan, faces = ROUND.mesh(3, 12)
    heights = 0.05 * np.sin(plan[:, 0]) + 0.02 * plan[:, 1]
    levels = np.array([-0.05, 0.013, 0.3])
    weights = surface(plan, faces, heights).wet_weights(levels)
    assert_derivative(
        lambda x: surface(plan, faces, x).volume_and_area(levels)[0].ravel(),
        heights,
        -weights,
        step=1e-6,
    )


def test_the_order_of_the_levels_does_not_matter():
    _, found = uneven(oval())
    levels = np.linspace(-0.2, 0.2, 41)
    mixed = np.random.default_rng(2).permutation(41)
    volume, area = found.volume_and_area(levels)
    volume_mixed, area_mixed = found.volume_and_area(levels[mixed])
    assert volume_mixed == pytest.approx(volume[mixed], rel=1e-13, abs=1e-14)
    assert area_mixed == pytest.approx(area[mixed], rel=1e-13, abs=1e-14)


def test_a_level_plate_is_wet_from_its_level_on():
    plan, faces = ROUND.mesh(3, 12)
    plate = surface(plan, faces, np.full(len(plan), 0.02))
    volume, area = plate.volume_and_area([0.019999, 0.02, 0.05])
    assert volume == pytest.approx([0, 0, 0.03 * ROUND.area_m2], abs=1e-13)
    assert area == pytest.approx([0, ROUND.area_m2, ROUND.area_m2], rel=1e-13)
