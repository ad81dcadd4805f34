"""A bottom from scans in a job: its volume, what its heights share with the wall, what is proposed.

Truth: rays against a cone and things that are no model of the package, volumes by integration;
finite differences of whole jobs; rigid motions of scans.
"""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from generated_clouds import FULL_TURN, Scene
from job_builder import write_folder
from page_figures import figures_of
from scipy.spatial.transform import Rotation
from test_walls_in_clouds import scene_parts

import tankcal
from tankcal.clouds.inside import bottom_points
from tankcal.clouds.inside.bottom import FloorCells, find_bottom_in_cells, floor_grid
from tankcal.clouds.wall.start import CylinderSurface
from tankcal.job.model import Bottom
from tankcal.methods.clouds.bottom import CloudInside, with_bottom
from tankcal.record import record_of
from tankcal.record.schema import check_data
from tankcal.record.versions import RECORD
from tankcal.survey.registration import ScanSetup, register
from tankcal.survey.wall_hits import RangingInstrument
from tankcal.tank.bottoms import Footprint, surveyed_bottom
from tankcal.tank.budgets import cause_factors

R, DEPTH_M, POST = 4.0, 0.2, (1.2, 0.9, 0.15)


def cone(x, y):
    return -DEPTH_M * (1 - np.hypot(x, y) / R)


def scanned(folder, rays=150_000, scans=2, given=None, **changes):
    """Result of a tank with a cone and a post, scanned from inside; given: keys of its clouds."""
    x, y, radius = POST
    post = (x, y, -1.0), (x, y, 4.0), radius
    scene = Scene(radius_m=R, courses=2, buckle=None, seams=(), floor=cone, rods=[post], **changes)
    parts = scene_parts(scene, np.random.default_rng(2), rays)
    parts.settings["bottom.form"] = "cloud"
    clouds = parts.registers["clouds"]
    for name in list(clouds)[scans:]:
        del clouds[name]
    for one in clouds.values():
        one |= {"u_incidence_mm": 0.0} | (given or {})
    return scene, parts, tankcal.run(tankcal.load(write_folder(folder, parts)), simulated=False)


def true_volume_m3(scene):
    """Of the wall over azimuth and height, and of the cone under the first course."""
    azimuth, z = FULL_TURN * (np.arange(2000) + 0.5) / 2000, (np.arange(400) + 0.5) / 100
    radii = scene.radius(*(one.ravel() for one in np.meshgrid(azimuth, z)))
    foot = scene.radius(azimuth, np.full(2000, 1e-6))
    out = (np.arange(400)[:, None] + 0.5) / 400 * foot
    under = -np.sum(cone(out * np.sin(azimuth), out * np.cos(azimuth)) * out * foot) / 400
    return np.pi * np.mean(radii**2) * scene.height_m + under * FULL_TURN / 2000


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return scanned(tmp_path_factory.mktemp("bottom") / "job")


@pytest.mark.slow
def test_the_cone_is_in_the_table(run, figure):
    """Simulation by rays; the post, as nobody has confirmed it, is not taken off."""
    scene, _, found = run
    top = found.at(scene.height_m)
    off = top.value_m3 - true_volume_m3(scene)
    figure("a cone in a cloud, whole table: m3 off, U", f"{off:.4f} {top.U_m3:.4f}")
    assert abs(off) < top.U_m3
    assert found.body.lowest_m == pytest.approx(-DEPTH_M, abs=0.01)
    names = {one.name for one in found.budget().lines}
    assert {"bottom_points", "bottom_form"} <= names
    assert "bottom" not in found.body.undeclared()


@pytest.mark.slow
def test_a_post_and_the_roof_are_told_and_not_taken_off(run, tmp_path):
    scene, parts, found = run
    told = [str(one) for one in found.warnings]
    assert any("1 things are seen in the tank" in one and "column 1.2" in one for one in told)
    assert any(one.startswith("clouds.toml: a roof is seen") for one in told)
    assert not any("as in a mirror" in one for one in told)
    record = record_of(found)
    assert check_data(record, RECORD.schema(), "record.json") == ([], [])
    (post,) = record["clouds"]["inside"]["things"]
    height = scene.height_m - cone(*POST[:2])
    assert post["volume_m3"] == pytest.approx(-np.pi * POST[2] ** 2 * height, abs=2 * post["u_m3"])
    assert not post["confirmed"]
    keys = ("name", "bottom_m", "top_m", "volume_m3", "u_m3")
    row = [post[key] if key == "name" else round(post[key], 4) for key in keys]
    parts.tables["deadwood"] = [list(keys), row]
    again = tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)), simulated=False)
    assert not any("things are seen" in str(one) for one in again.warnings)
    less = found.at(scene.height_m).value_m3 - again.at(scene.height_m).value_m3
    assert less == pytest.approx(-row[3], abs=1e-6)
    assert json.loads(json.dumps(record))["bottom"][0]["value"] == "cloud"


@pytest.mark.slow
@pytest.mark.parametrize("what", ["z of the scan", "offset", "scale"])
def test_what_is_shared_moves_bottom_and_wall_at_once(what, tmp_path):
    """Finite differences: the column of each cause is what it does to the whole table."""
    exact = {"s_translation_mm": 0.0, "s_rotation_arcsec": 0.0, "u_offset_mm": 0.0}
    declared, kind = {
        "z of the scan": ({"s_translation_mm": 2.0}, "registration"),
        "offset": ({"u_offset_mm": 2.0}, "instrument_offset"),
        "scale": ({"u_scale_ppm": 400.0}, "instrument_scale"),
    }[what]
    given = exact | declared
    _, parts, found = scanned(tmp_path / "job", scans=1, rays=60_000, given=given)
    (cloud,) = parts.registers["clouds"].values()
    if what == "z of the scan":
        cloud["pose"][2][3] += 0.002
    else:
        cloud |= {"offset_mm": 2.0} if what == "offset" else {"scale_ppm": 400.0}
    moved = tankcal.run(tankcal.load(write_folder(tmp_path / "moved", parts)), simulated=False)
    (source,) = [one for one in found.table.sources if one.kind == kind]
    change = moved.table.volume_m3 - found.table.volume_m3
    inside = found.table.height_m > 0.05
    told = np.linalg.norm(source.columns_m3, axis=1)
    assert told[-1] == pytest.approx(abs(change[-1]), rel=0.03)
    np.testing.assert_allclose(told[inside], np.abs(change[inside]), rtol=0.1)
    if what == "z of the scan":
        assert change[-1] == pytest.approx(-np.pi * R**2 * 0.002, rel=0.03)


@pytest.mark.study
def test_volumes_scatter_as_their_shared_columns_say(figure):
    """Simulation: floors of three scans that are moved as rigid bodies, 200 times."""
    rng, sd_m, sd_rad = np.random.default_rng(7), 0.002, 1e-4
    tool = RangingInstrument("S", u_offset_m=0.0)
    surface = CylinderSurface(np.array([0.0, 0.0, 2.0]), R)
    grid = floor_grid(surface, 0.0, 4.0)
    foot = Footprint(0.0, 0.0, np.full(360, R))
    stood = [(1.5 * np.sin(a), 1.5 * np.cos(a), 1.5) for a in (0.3, 2.4, 4.5)]
    setups = []
    for i, place in enumerate(stood):
        pose = np.eye(4)
        pose[:3, 3] = place
        setups.append(
            ScanSetup(f"A{i}", "S", pose=pose, s_translation_m=sd_m, s_rotation_rad=sd_rad)
        )
    registration = register(setups, {"S": tool})
    r, turn = R * np.sqrt(rng.uniform(0, 1, 60_000)), rng.uniform(0, FULL_TURN, 60_000)
    x, y = r * np.sin(turn), r * np.cos(turn)
    whole = np.column_stack([x, y, cone(x, y) + 0.0005 * rng.normal(size=len(x))])
    away = np.array([np.hypot(x - at[0], y - at[1]) for at in stood])
    seen = rng.uniform(size=away.shape) < 0.15 + 0.8 * (away == away.min(axis=0))

    def volume(motions):
        cells = FloorCells(grid, 3)
        for i, (shift, turned) in enumerate(motions):
            cells.add((whole[seen[i]] - stood[i]) @ turned.T + stood[i] + shift, i)
        bottom = find_bottom_in_cells(cells)
        points = bottom_points(bottom, 150)
        part = surveyed_bottom(foot, points.xyz_m, points.sd_m)
        return part.volume_m3([0.5])[0], CloudInside(bottom, points, ())

    _, inside = volume([(np.zeros(3), np.eye(3))] * 3)
    job = tankcal.load("examples/silva-1995")
    clouds = SimpleNamespace(tools={"S": (tool, False, False)})
    made = with_bottom(replace(job, clouds=clouds, bottom=Bottom("cloud")), inside, registration)
    shared = cause_factors(made.bottom.shared, [one.column_m for one in made.bottom.shared])
    part = surveyed_bottom(foot, made.bottom.xyz_m, made.bottom.sd_m, shared=shared)
    own = [one.columns_m3 for one in part.sources([0.5]) if one.kind == "registration"]
    predicted = np.sqrt(np.sum(np.hstack(own) ** 2))

    def moved():
        turned = Rotation.from_rotvec(sd_rad * rng.normal(size=3)).as_matrix()
        return sd_m * rng.normal(size=3), turned

    drawn = [volume([moved() for _ in range(3)])[0] for _ in range(200)]
    figure("u of a bottom by three moved scans, said / scatter", f"{predicted / np.std(drawn):.3f}")
    count, percent = figures_of(
        "docs/studies/clouds-wall.md", "u agrees with the scatter of () draws within () %"
    )
    assert len(drawn) == int(count)
    assert predicted == pytest.approx(np.std(drawn), rel=float(percent) / 100)
