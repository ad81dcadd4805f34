"""Bottom and things inside a tank from scans: rays against forms that are no model."""

from functools import cache

import numpy as np
import pytest
from generated_clouds import FULL_TURN, Scene, passes_of, take_scan
from numpy.testing import assert_allclose
from page_figures import figures_of

from tankcal.clouds.inside import bottom_points, find_cloud_bottom, find_things
from tankcal.clouds.inside.bottom import FloorCells, find_bottom_in_cells, floor_grid
from tankcal.clouds.wall import find_cloud_wall
from tankcal.clouds.wall.start import CylinderSurface
from tankcal.errors import InputError
from tankcal.tank.bottoms import Footprint, surveyed_bottom

R = 7.5
SURFACE = CylinderSurface(np.array([500.0, -20.0, 3.0]), 5.0, (0.004, -0.002))
GRID = floor_grid(SURFACE, 0.0, 6.0)


def _floor_points(form, count=150_000, seed=1, noise=0.002):
    """Points of a bottom at z = form(x, y) about the foot of SURFACE, and of the wall over it."""
    rng = np.random.default_rng(seed)
    r, turn = 5 * np.sqrt(rng.uniform(0, 1, count)), rng.uniform(0, FULL_TURN, count)
    x, y = r * np.sin(turn), r * np.cos(turn)
    z = form(x, y) + rng.normal(0, noise, count)
    foot = SURFACE.centre_m[:2] - 3 * np.array(SURFACE.slope)
    up, turn = rng.uniform(0, 6, count // 4), rng.uniform(0, FULL_TURN, count // 4)
    wall = SURFACE.points(up, turn, rng.normal(0, noise, count // 4))
    return np.vstack([np.column_stack([x + foot[0], y + foot[1], z]), wall])


def _sums(*pieces):
    cells = FloorCells(GRID)
    for xyz in pieces:
        cells.add(xyz)
    return cells


def _plate(x, y):
    return 0.02 * x / 5 + 0 * y


def test_sums_hang_on_the_points_alone():  # property
    xyz = _floor_points(_plate, 20_000)
    whole, order = _sums(xyz), np.random.default_rng(2).permutation(len(xyz))
    parts = _sums(xyz[order[:7000]]) + _sums(xyz[order[7000:]])
    for name in FloorCells.NAMES:
        assert getattr(parts, name).tobytes() == getattr(whole, name).tobytes(), name
    assert len(xyz) > whole.inside > 0


def test_means_are_those_of_the_points():  # closed form: a loop over the points
    xyz = _floor_points(_plate, 20_000)
    cell = np.floor((xyz[:, :2] - GRID.corner_m) / GRID.cell_m)
    mine = np.all(cell == (20, 25), axis=1) & (xyz[:, 2] < 1)
    cells = _sums(xyz)
    *means, _, count = cells.means(np.ones(cells.sums.shape, dtype=bool))
    assert count[20, 25] == mine.sum() > 5
    assert_allclose([one[20, 25] for one in means], xyz[mine].mean(axis=0), atol=1e-4)


@pytest.mark.slow
def test_plate_is_found_and_its_sd_holds():  # simulation: the truth is a leaning plate
    bottom = find_bottom_in_cells(_sums(_floor_points(_plate, noise=0.004)))
    shown = bottom.xyz_m[bottom.is_bottom]
    foot = SURFACE.centre_m[:2] - 3 * np.array(SURFACE.slope)
    error = shown[:, 2] - _plate(*(shown[:, :2] - foot).T)
    assert bottom.seen_share > 0.98
    assert not bottom.pits
    assert bottom.mirrored == 0
    assert 0.8 < np.std(error) / np.nanmedian(bottom.sd_m) < 1.25
    assert abs(error.mean()) < 1e-4


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda xyz: xyz[xyz[:, 0] > 501], "cloud_no_bottom"),
        (lambda xyz: xyz + [0, 0, 0.6], "cloud_bottom_elsewhere"),
        (lambda xyz: xyz[:0], "cloud_no_bottom"),
        (lambda xyz: xyz + [0, 0, 3.0], "cloud_no_bottom"),
    ],
)
def test_what_is_no_bottom_is_told(change, code):
    with pytest.raises(InputError) as raised:
        find_bottom_in_cells(_sums(change(_floor_points(_plate, 60_000))))
    assert raised.value.problems[0].expected.code == code


def _cone(x, y):
    return -0.25 + 0.25 * np.hypot(x, y) / R


def _dish(x, y):
    return -0.3 + 0.3 * (x * x + y * y) / R**2


def _buckled(x, y):
    inner = np.clip(1 - (np.hypot(x, y) / R) ** 4, 0, 1)
    waves = 0.05 * np.cos(1.1 * x + 0.3) * np.cos(0.9 * y + 1) + 0.03 * np.sin(2 * x - 1.3 * y)
    return waves * inner + 0.02 * x / R


def _flat(x, y):
    return 0.001 * x + 0 * y


FORMS = {"cone down": _cone, "dish": _dish, "buckled plates": _buckled}
FILMS = {  # x, y, radius and height of water, shares of no return and of mirror images
    "film": (4.0, 0.0, 3.6, 0.001, 0.5, 0.3),
    "film that gives no points": (2.0, 0.0, 5.4, 0.001, 0.5, 0.5),
}
PIT, ROUND, SQUARE = (3.0, -2.5, 0.5, 0.45), (2.0, 0.0, 0.15), (-1.0, 5.0, 0.15)
THIN = (-2.0, 3.0, 0.12)
PIPE = (7.25 * np.sin(0.5), 7.25 * np.cos(0.5), 0.15)  # 0.1 m before the wall
COIL = ((-4.0, -5.0, 0.15), (4.0, -5.0, 0.15), 0.04), ((-4.0, -4.6, 0.15), (4.0, -4.6, 0.15), 0.04)
DEBRIS = (-3.0, -3.0, -0.4), (-2.6, -2.0, 0.25)


@cache
def _scene(name):
    """Scene, wall, bottom and things of scans of a tank with all that stands in one."""
    rng = np.random.default_rng(3)
    posts = [((x, y, -1.0), (x, y, 8.0), r) for x, y, r in (ROUND, THIN)]
    x, y, half = SQUARE
    scene = Scene(
        floor=FORMS.get(name, _flat),
        stairs=(4.0, 2.0, 0.5, 0.25),
        pipes=[(0.5, 0.1, 0.15, 0.0, 8.0)],
        rods=[*posts, *COIL],
        boxes=[DEBRIS, ((x - half, y - half, -1.0), (x + half, y + half, 8.0))],
        pits=[PIT] * (name in FORMS),
        film=FILMS.get(name),
    )
    places = ((2.3, 0.7, 1.6), (-2.2, -1.5, 1.6), (0.7, -3.0, 4.0))
    scans = [take_scan(rng, scene, place, 250_000)[0] for place in places]
    passes = passes_of(scans)
    wall = find_cloud_wall(passes, radius_m=R, joints_m=scene.joints_m)
    bottom = find_cloud_bottom(passes, wall)
    return scene, wall, bottom, find_things(passes, bottom)


def _volumes(scene, bottom):
    """Volume under the foot of the shell by the points, its U, and the truth."""
    azimuth = np.arange(720) / 720 * FULL_TURN
    foot = Footprint(0.0, 0.0, scene.radius(azimuth, np.full(720, 1e-6)))
    points = bottom_points(bottom)
    part = surveyed_bottom(foot, points.xyz_m, points.sd_m, scene.lean)
    out = (np.arange(400)[:, None] + 0.5) / 400 * foot.radius_m
    z = scene.floor(out * np.sin(azimuth), out * np.cos(azimuth))
    truth = -np.sum(z * out * foot.radius_m) / 400 * FULL_TURN / 720
    u = np.sqrt(sum(np.sum(one.columns_m3**2) for one in part.sources([0.5])))
    return part.volume_m3([0.5])[0], 2 * u, truth


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FORMS, *FILMS])
def test_volume_under_the_first_course(name, figure):  # simulation: rays
    scene, wall, bottom, _ = _scene(name)
    volume, expanded, truth = _volumes(scene, bottom)
    tank = np.pi * R**2 * scene.height_m
    share = 100 * abs(volume - truth) / tank
    figure(f"bottom of a cloud, {name}: volume off", f"{share:.4f} % of the tank")
    (percent,) = figures_of(
        "docs/studies/clouds-wall.md",
        "the error of the volume under the first course and its U are each less than () % of the "
        "volume of the tank",
    )
    assert abs(volume - truth) < float(percent) / 100 * tank
    assert expanded < float(percent) / 100 * tank
    assert bottom.seen_share > (0.6 if "gives no" in name else 0.95)
    assert (bottom.mirrored > 500) == (name in FILMS)
    assert len(bottom.pits) == (name in FORMS)
    assert np.abs(np.nanmean(wall.radius_m) - R) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cone down", "buckled plates"])
def test_what_stands_in_the_tank(name):  # simulation: rays
    scene, _, bottom, things = _scene(name)
    columns = [one for one in things if one.kind == "column"]
    boxes = [one for one in things if one.kind == "box"]
    assert len(columns) == 3
    for x, y, radius in (ROUND, THIN, PIPE):
        one = min(columns, key=lambda it: np.hypot(it.low_m[0] - x, it.low_m[1] - y))
        tall = 8.0 - float(scene.floor(x, y))
        assert abs(one.radius_m - radius) < 2 * one.u_radius_m < 0.004
        assert abs(one.volume_m3 - np.pi * radius**2 * tall) < 2 * one.u_volume_m3
        assert one.deadwood_row[3] == -one.volume_m3
    for low, high in (((-4, -5.04, 0.11), (4, -4.56, 0.19)), DEBRIS):
        inner = [
            one
            for one in boxes
            if all(np.array(one.low_m)[:2] < np.array(low)[:2] + 0.12)
            and all(np.array(one.high_m) > np.array(high) - 0.12)
            and one.high_m[2] < 1
        ]
        assert inner
        assert np.isnan(inner[0].volume_m3)
    (pit,) = bottom.pits
    assert np.hypot(pit.x_m - PIT[0], pit.y_m - PIT[1]) < 0.2
    assert abs(pit.area_m2 - np.pi * PIT[2] ** 2) < 2 * pit.u_area_m2
    assert abs(pit.top_m - pit.bottom_m - PIT[3]) < 0.02
