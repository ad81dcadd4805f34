"""Tanks drawn by lot: their volumes by a second method, and what the wall is where."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tankcal.products.intercomparison.site import request_table
from tankcal.products.intercomparison.tank import (
    FAMILIES,
    Band,
    Buckle,
    Course,
    Dent,
    Fitting,
    Flat,
    Floor,
    Oval,
    Seam,
    Tank,
    Wave,
    draw_tank,
    tank_of,
)
from tankcal.units import STANDARD_GRAVITY

LEVEL = Floor()


def make_tank(defects=(), *, floor=LEVEL, fittings=(), lean=(0.0, 0.0), plate_z_m=0.0):
    """Three courses, R = 7 m."""
    return Tank(
        name="T", family="test", radius_m=7.0, courses_m=(2.0, 2.0, 1.5),
        plates_m=(0.010, 0.008, 0.006), paint_m=3e-4, defects=tuple(defects), lean=lean,
        floor=floor, fittings=tuple(fittings), plate_z_m=plate_z_m, e_pa=206e9,
        expansion_per_k=1.1e-5,
    )  # fmt: skip


EVERYTHING = (
    Oval(0.0, 5.5, 2, 0.01, 0.02, 0.5, 1.0),
    Seam(0.0, 5.5, 1.0, -0.03, 0.1, 0.0),
    Seam(2.0, 4.0, 2.0, 0.01, 0.2, 0.3),
    Band(0.0, 5.5, 2.0, -0.004, 0.15),
    Course(2.0, 4.0, 0.002, 0.003, 0.005, 0.4),
    Dent(0.7, 1.9, 3.0, -0.025, 0.6),
    Flat(4.0, 5.5, 4.0, 0.5, 0.3),
    Buckle(2.0, 4.0, 5.0, -0.05, 0.9, 1.5),
)


def test_a_cylinder():
    """Closed form: a cylinder with a head is pi (R + w)^2, w linear in the depth of each course."""
    tank, rho, dip = make_tank(), 850.0, 5.0
    expected, soft = 0.0, rho * STANDARD_GRAVITY * 49.0 / 206e9
    for low, high, plate in ((0, 2, 0.010), (2, 4, 0.008), (4, 5, 0.006)):
        a, b = soft / plate * (dip - low), soft / plate * (dip - high)
        mean_square = (a * a + a * b + b * b) / 3
        expected += np.pi * (high - low) * (49.0 + 7.0 * (a + b) + mean_square)
    assert_allclose(tank.volumes_m3(dip, rho), expected, rtol=1e-13)
    assert_allclose(tank.volumes_m3([1.0, 5.5]), np.pi * 49.0 * np.array([1.0, 5.5]), rtol=1e-13)


def test_a_cone_below_and_above():
    """Closed form: a third of the cylinder's area times the depth, the dip plate on the foot."""
    for depth in (0.1, -0.08):
        tank = make_tank(floor=Floor(depth))
        assert_allclose(tank.volumes_m3(2.0), np.pi * 49.0 * (2.0 + depth / 3), rtol=1e-9)


def test_things_and_zero():
    """Closed form: a thing counts linearly between its heights, dips from the plate."""
    tank = make_tank(fittings=[Fitting("column", 0.0, 5.5, -1.1)], plate_z_m=0.05)
    assert_allclose(tank.volumes_m3(1.05), 1.1 * np.pi * 49.0 - 0.22, rtol=1e-13)


def test_a_warm_tank_holds_the_cube():
    """Property: similar bodies, but for the dip plate, which is at the foot here."""
    tank = make_tank(EVERYTHING)
    f = tank.expansion_factor(40.0)
    assert_allclose(tank.volumes_m3(3.0 * f, celsius=40.0), f**3 * tank.volumes_m3(3.0), rtol=1e-12)


def test_levels_that_leave_the_bottom_bare_are_refused():
    tank = make_tank(floor=Floor(-0.2))
    with pytest.raises(ValueError, match=r"levels from 0\.2"):
        tank.volumes_m3(0.1)


def test_plain_data_is_the_same_tank():
    tank = draw_tank(np.random.default_rng(3), "T1", "dented")
    assert tank_of(tank.plain()) == tank


@pytest.mark.slow
@pytest.mark.parametrize("density", [0.0, 850.0])
def test_volume_by_many_points(density):
    """Second method: midpoints of a fine grid that knows nothing of kinks and edges."""
    tank = make_tank(EVERYTHING, lean=(0.004, -0.002))
    dip, count = 4.75, 475
    z = (np.arange(count) + 0.5) * dip / count
    azimuth = 2 * np.pi * (np.arange(2048) + 0.5) / 2048
    total = 0.0
    for one in z:
        plate = tank.plates_m[int(tank.course_at(one))]
        out = density * STANDARD_GRAVITY * (dip - one) * 49.0 / (206e9 * plate)
        total += np.mean((tank.radii_m(azimuth, one) + out) ** 2) * np.pi * dip / count
    assert_allclose(tank.volumes_m3(dip, density), total, rtol=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_volume_of_a_mesh(family):
    """Second method: the closed body of wall, bottom and level as triangles, by trimesh."""
    import trimesh

    tank = draw_tank(np.random.default_rng(11), "T1", family)
    tank = tank_of(tank.plain() | {"fittings": []})
    dip = 0.7 * tank.height_m
    level = dip + tank.plate_z_m
    across, up, rings = 1440, 240, 60
    azimuth = 2 * np.pi * np.arange(across) / across
    wall = [tank.places_m(azimuth, np.full(across, z)) for z in np.linspace(0, level, up + 1)]
    floor, foot = [], np.hypot(*wall[0][:, :2].T)
    for part in np.arange(rings - 1, 0, -1) / rings:
        x, y = part * foot * np.sin(azimuth), part * foot * np.cos(azimuth)
        floor.append(np.column_stack([x, y, tank.floor.height_m(x, y, tank.radius_m)]))
    middle = [[0.0, 0.0, float(tank.floor.height_m(0.0, 0.0, tank.radius_m))]]
    top = [[*tank.axis_m(level), level]]
    loops = [*floor[::-1], *wall]  # from the innermost ring of the bottom to the level
    places = np.vstack([*loops, middle, top])
    here = np.arange(across)
    beside = (here + 1) % across
    faces = []
    for k in range(len(loops) - 1):
        a, b = k * across + here, k * across + beside
        faces += [np.column_stack([a, a + across, b]), np.column_stack([b, a + across, b + across])]
    low, high = len(places) - 2, len(places) - 1
    last = (len(loops) - 1) * across
    faces.append(np.column_stack([here, beside, np.full(across, low)]))
    faces.append(np.column_stack([last + beside, last + here, np.full(across, high)]))
    mesh = trimesh.Trimesh(places, np.vstack(faces), process=False)
    assert mesh.is_watertight
    assert_allclose(tank.volumes_m3(dip), abs(mesh.volume), rtol=1e-5)  # chords: 3e-6 of an arc


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_more_nodes_change_nothing(family):
    """Property: converged to a part of 1e8, for every family."""
    tank = draw_tank(np.random.default_rng(5), "T1", family)
    asked = request_table(tank, 850.0)
    some = asked.dips_m[::9]
    assert tank.volume_error_m3(some, 850.0) < 1e-8 * tank.volumes_m3(some[-1])[0]


def test_rays_end_on_the_wall():
    """Property: a place at the range found is on the wall, and within its height."""
    tank = make_tank(EVERYTHING, lean=(0.003, 0.002))
    rng = np.random.default_rng(2)
    rays = rng.normal(size=(500, 3)) * [1, 1, 0.3]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    origin = np.array([1.0, -0.5, 2.0])
    found = tank.ranges_m(origin, rays)
    met = np.isfinite(found)
    places = origin + found[met, None] * rays[met]
    assert met.sum() > 350
    assert_allclose(tank.beyond_m(places), 0, atol=1e-6)


def test_what_is_asked():
    """Heights rise, are covered by liquid, and have the pairs of deliveries."""
    tank = draw_tank(np.random.default_rng(5), "T1", "coil")
    dips = np.array(request_table(tank, 0.0).dips_m)
    assert np.all(np.diff(dips) > 0.005)
    assert dips[0] + tank.plate_z_m >= tank.lowest_level_m
    assert dips[-1] + tank.plate_z_m < tank.height_m
    apart = np.round(dips[None, :] - dips[:, None], 3)
    assert min(np.sum(apart == step) for step in (0.01, 0.1, 2.0)) >= 5


def test_a_wave_of_the_bottom_counts():
    """Second method: the mean depth over a grid of the area."""
    floor = Floor(0.1, (Wave(0.004, 1.1, 0.7, 0.3), Wave(0.003, -0.4, 2.0, 1.0)))
    tank = make_tank(floor=floor)
    x, y = np.meshgrid(np.linspace(-7, 7, 701), np.linspace(-7, 7, 701))
    inside = np.hypot(x, y) < 7.0
    depth = -floor.height_m(x, y, 7.0)[inside].mean()
    assert_allclose(tank.volumes_m3(1.0), np.pi * 49.0 * (1.0 + depth), rtol=2e-5)


def part_missed(tank, parts=(0.2, 0.8)):
    """How far areas at these parts of each course are from the volume of the wall, in ppm."""
    azimuth, read = 2 * np.pi * (np.arange(512) + 0.5) / 512, 0.0
    for low, high in zip(tank.joints_m[:-1], tank.joints_m[1:], strict=True):
        squares = [np.mean(tank.radii_m(azimuth, low + one * (high - low)) ** 2) for one in parts]
        read += np.pi * np.mean(squares) * (high - low)
    bare = replace(tank, floor=LEVEL, fittings=(), plate_z_m=0.0)
    return 1e6 * (read / bare.volumes_m3([tank.height_m])[0] - 1)


@pytest.mark.parametrize(("bell", "missed"), [(1.0, 0.154508), (0.0, 0.026667)])
def test_readings_at_20_and_80_percent_miss_a_bulge(bell, missed):
    """Closed form: means of (1 + cos)/2 and 1 - zeta^2, 1/2 and 2/3, less those at zeta = 0.6."""
    joints = (0.0, 2.0, 4.0, 5.5)
    bulges = [Course(low, high, 0.0, 0.0, 0.004, bell) for low, high in pairwise(joints)]
    assert part_missed(make_tank(bulges)) == pytest.approx(-2e6 * 0.004 * missed / 7.0, rel=2e-3)


@pytest.mark.slow
def test_bulges_are_why_readings_at_20_and_80_percent_are_low():
    """The same drawn walls with and without their bulges."""
    for seed in range(3):
        tank = draw_tank(np.random.default_rng(seed), "T", "round")
        flat = [
            replace(one, bulge_m=0.0) if isinstance(one, Course) else one for one in tank.defects
        ]
        assert part_missed(tank) < -5
        assert abs(part_missed(replace(tank, defects=tuple(flat)))) < 0.5
        assert abs(part_missed(tank, (0.15, 0.5, 0.85))) < 0.25 * abs(part_missed(tank))
