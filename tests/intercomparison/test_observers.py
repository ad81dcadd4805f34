"""Crews without errors: what they read is the tank, by formulas of its own here."""

import io
import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tankcal.camera.model import PARAMETERS, Form, distort_image_points
from tankcal.products.intercomparison import observers
from tankcal.products.intercomparison.observers import (
    METHODS,
    camera_rotation,
    observe_cloud,
    photograph,
)
from tankcal.products.intercomparison.site import Chance, observe_site, request_table
from tankcal.products.intercomparison.tank import draw_tank

U_READ_M = 2e-5  # files have hundredths of a millimetre


@pytest.fixture(scope="module")
def tank():
    return draw_tank(np.random.default_rng(8), "T1", "dented")


def perfect(tank, method, seed=1):
    """The parts of a job of a crew without errors."""
    chance = Chance(np.random.default_rng(seed), size=0.0)
    return METHODS[method](tank, chance, request_table(tank, 0.0))


def columns(parts, table, *names):
    """Columns of numbers."""
    heads, *rows = parts.tables[table]
    return [np.array([float(row[heads.index(name)]) for row in rows]) for name in names]


def cool(parts, tank, xyz, origin=(0.0, 0.0)):
    """Places in the frame of a job as places of the tank when it is cool."""
    foot = np.array([*origin, parts.settings["datum.bottom_z_m"]])
    return (xyz - foot) / tank.expansion_factor(parts.settings["survey.shell_temperature_c"])


def on_wall(parts, tank, xyz, origin=(0.0, 0.0)):
    """(n,) how far places lie off the wall, plate and paint as declared."""
    outside = parts.settings["survey.side"] == "outside"
    return tank.beyond_m(cool(parts, tank, xyz, origin), outside)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_points_lie_on_the_wall(tank, seed):
    parts = perfect(tank, "points", seed)
    xyz = np.column_stack(columns(parts, "points", "x_m", "y_m", "z_m"))
    assert_allclose(on_wall(parts, tank, xyz, (512.0, 347.0)), 0, atol=U_READ_M)


def test_hits_lie_on_the_wall(tank):
    parts = perfect(tank, "total-station")
    read = columns(parts, "wall_hits", "direction_deg", "zenith_deg", "distance_m")
    direction, zenith, distance = np.radians(read[0]), np.radians(read[1]), read[2]
    level = np.sin(zenith)
    rays = np.column_stack([level * np.sin(direction), level * np.cos(direction), np.cos(zenith)])
    (height,) = columns(parts, "setups", "instrument_height_m")
    middle = np.array(
        parts.tables["bottom"][1][:2], float
    )  # the first levelled point is the middle
    places = [0, 0, height[0]] + distance[:, None] * rays
    assert_allclose(on_wall(parts, tank, places, middle), 0, atol=U_READ_M)


@pytest.mark.slow
def test_a_tape_reads_the_mean_width_of_the_hull(tank):
    """Second method: Cauchy's formula, the perimeter of a hull is the integral of its support."""
    z = 0.2 * tank.courses_m[0]
    azimuth = 2 * np.pi * np.arange(6000) / 6000
    xy = tank.places_m(azimuth, np.full(6000, z), outside=True)[:, :2]
    turn = 2 * np.pi * np.arange(1500) / 1500
    support = np.max(np.column_stack([np.sin(turn), np.cos(turn)]) @ xy.T, axis=1)
    assert_allclose(observers.girth_m(tank, z), 2 * np.pi * support.mean(), atol=2e-4)
    parts = perfect(tank, "tape")
    shell_c = parts.settings["survey.shell_temperature_c"]
    reading, pull = columns(parts, "circumferences", "reading_m", "tension_n")
    tape_unit = (1 + 1.15e-5 * (shell_c - 20)) * (1 + (pull[0] - 50) / 5.15e5)
    expected = tank.expansion_factor(shell_c) * observers.girth_m(tank, z) + np.pi * 2e-4
    assert_allclose(reading[0] * tape_unit, expected, atol=U_READ_M)


def test_offsets_end_on_the_wall(tank):
    """The line of each offset is upright: where all of its offsets begin is one place."""
    parts = perfect(tank, "reference-line")
    rows = parts.tables["offsets"][1:]
    f = tank.expansion_factor(parts.settings["survey.shell_temperature_c"])
    zero = parts.settings["datum.dip_plate_z_m"]
    angles = {row[0]: np.radians(row[1]) for row in parts.tables["lines"][1:]}
    for name, at in list(angles.items())[::5]:
        mine = [row for row in rows if row[0] == name and row[5] == 1]
        z = (np.array([row[2] for row in mine]) + zero) / f
        offset = np.array([row[3] for row in mine]) / 1000
        ray = np.array([np.sin(at), np.cos(at)])
        foot = f * tank.places_m([at], [z[0]], outside=True)[0, :2] + offset[0] * ray
        there = (foot - offset[:, None] * ray) / f
        miss = tank.beyond_m(np.column_stack([there, z]), outside=True)
        assert_allclose(miss, 0, atol=3e-5)


def las_points(data):
    """(n, 3) of a LAS file, read by its header."""
    offset, count = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<I", data, 107)[0]
    scale = struct.unpack_from("<3d", data, 131)
    rows = np.frombuffer(data, dtype=[("xyz", "<i4", 3), ("rest", "u1", 8)], offset=offset)
    assert len(rows) == count
    return rows["xyz"] * np.array(scale)


def test_scans_lie_on_wall_bottom_and_columns(tank):
    """Pose by the targets of both files, here by the SVD of their coordinates."""
    chance = Chance(np.random.default_rng(1), size=0.0)
    parts = observe_cloud(tank, chance, request_table(tank, 0.0), points=6000)
    station = np.array([0.1, 0.15, 1.5])
    names = [row[1] for row in parts.tables["directions"][1:]]
    read = [columns(parts, *pair)[0] for pair in (
        ("directions", "direction_deg"), ("zenith_angles", "zenith_deg"),
        ("slope_distances", "distance_m"))]  # fmt: skip
    mark = np.array([float(one) for one in parts.tables["control"][2][1:4]]) - station
    turned = np.arctan2(*mark[:2]) - np.radians(read[0][names.index("R1")])
    a, v = np.radians(read[0]) + turned, np.radians(read[1])
    rays = np.column_stack([np.sin(v) * np.sin(a), np.sin(v) * np.cos(a), np.cos(v)])
    there = dict(zip(names, station + read[2][:, None] * rays, strict=True))
    for scan in "AB":
        rows = [row for row in parts.tables["scan_targets"][1:] if row[0] == scan]
        own = np.array([row[2:5] for row in rows])
        to = np.array([there[row[1]] for row in rows])
        u, _, vt = np.linalg.svd((own - own.mean(0)).T @ (to - to.mean(0)))
        turn = vt.T @ np.diag([1, 1, np.linalg.det(vt.T @ u.T)]) @ u.T
        xyz = (las_points(parts.files[f"scans/{scan.lower()}.las"]) - own.mean(0)) @ turn.T
        places = cool(parts, tank, xyz + to.mean(0))
        floor = tank.floor.height_m(*places[:, :2].T, tank.radius_m)
        off = np.minimum(np.abs(tank.beyond_m(places)), np.abs(places[:, 2] - floor))
        for one in tank.fittings:
            away = np.hypot(places[:, 0] - one.x_m, places[:, 1] - one.y_m) - one.width_m / 2
            off = np.minimum(off, np.abs(away)) if one.width_m else off
        assert np.quantile(off, 0.99) < 3e-4


def test_laspy_reads_the_scans(tank):
    """Other program."""
    laspy = pytest.importorskip("laspy")
    chance = Chance(np.random.default_rng(1), size=0.0)
    data = observe_cloud(tank, chance, request_table(tank, 0.0), points=2000).files["scans/a.las"]
    read = laspy.read(io.BytesIO(data))
    assert_allclose(read.xyz, las_points(data), atol=1e-9)
    assert_allclose([read.header.mins, read.header.maxs], [read.xyz.min(0), read.xyz.max(0)])


@pytest.mark.slow
def test_batches_are_the_mass_in_the_tank(tank):
    """The masses of all batches, by the declared water and meter, fill the tank to its dips."""
    parts = perfect(tank, "liquid")
    heads, *rows = parts.tables["liquid"]
    at = {name: place for place, name in enumerate(heads)}
    mass = 0.0

    def density(celsius):
        return 998.6 * (1 - 1.86e-4 * (celsius - 18.0))

    for row in rows:
        if row[at["dip_m"]] == "":
            mass = 0.0
            continue
        mass += 1.0004 * row[at["volume_m3"]] * density(row[at["meter_temperature_c"]])
        warm, shell = row[at["tank_temperature_c"]], row[at["shell_temperature_c"]]
        held = tank.volumes_m3(row[at["dip_m"]], density(warm), celsius=shell)[0]
        assert_allclose(mass / density(warm), held, atol=3e-3)


def test_photographs_are_those_of_the_camera(tank):
    """Second method: the package's own camera in the convention that the job names."""
    chance = Chance(np.random.default_rng(1), size=0.0)
    site = observe_site(
        tank, chance, request_table(tank, 0.0), outside=True, frame_m=(100.0, 200.0, 50.0)
    )
    azimuth = np.linspace(0, 2 * np.pi, 60)
    places = site.places(azimuth, np.full(60, 2.0))
    centre = np.array([100.0 + tank.radius_m + 9.0, 203.0, 52.0])
    rotation = camera_rotation(centre, site.frame_m + [0, 0, 3.0], 0.4)
    interior = {
        "c": 20.1,
        "x0": 0.02,
        "y0": -0.03,
        "K1": 3e-5,
        "K2": -2e-8,
        "P1": 2e-6,
        "P2": -1e-6,
    }
    image, seen = photograph(places, site, centre, rotation, interior)
    assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert 5 < seen.sum() < 40
    u, v, w = rotation @ (places[seen] - centre).T
    ideal = -interior["c"] * np.column_stack([u, v]) / w[:, None]
    values = np.array([interior.get(name, 0.0) for name in PARAMETERS])
    expected = distort_image_points(ideal, values, Form("distortion_of_ideal", "b1_b2"))
    assert_allclose(image[seen], expected, atol=1e-9)


@pytest.mark.slow
def test_what_is_declared_holds_the_errors():
    """Simulation: zero and heights of courses of many crews scatter as uncertainty.csv says."""
    tank = draw_tank(np.random.default_rng(8), "T1", "round")
    rng, zeros, heights = np.random.default_rng(1), [], []
    for _ in range(300):
        site = observe_site(tank, Chance(rng), request_table(tank, 0.0), outside=False)
        zeros.append(site.zero_m - site.expansion_factor * tank.plate_z_m)
        heights += [row[1] for row in site.parts.tables["courses"][1:]]
    along = np.hypot(1, np.hypot(*tank.lean))
    off = np.reshape(heights, (300, -1)) - along * np.array(tank.courses_m)
    assert_allclose(np.std(zeros), 1e-3, rtol=0.15)
    assert_allclose(np.std(off), 1e-3, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_tankcal_finds_the_tank(method, tmp_path, figure):
    """A perfect crew: what is left is the wall that no reading shows, well within U."""
    import tankcal
    from tankcal.products.intercomparison.package import job_files, write_files

    tank = draw_tank(np.random.default_rng(1), "T1", "coil")
    asked = request_table(tank, 850.0)
    parts = METHODS[method](tank, Chance(np.random.default_rng(2), size=0.0), asked)
    write_files(tmp_path, job_files(parts))
    result = tankcal.run(tankcal.load(tmp_path))
    true = tank.volumes_m3(asked.dips_m, 850.0)
    found = [result.at(dip) for dip in asked.dips_m]
    error = np.array([one.value_m3 for one in found]) - true
    figure(f"perfect crew, {method}: error at the top", f"{1e6 * error[-1] / true[-1]:+.0f} ppm")
    assert np.all(np.abs(error) < 0.7 * np.array([one.U_m3 for one in found]))
