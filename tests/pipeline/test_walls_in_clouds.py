"""Clouds of a job: registered, found, and their wall with all that they share.

Truth: tanks that are no model of the package, scanned by `scanned_tanks`; their volume by
integration of the surface.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from generated_clouds import FULL_TURN, Scene, take_scan
from generated_hits import Tool
from job_builder import SETTINGS, Parts, job_parts, write_folder
from scanned_tanks import (
    COURSE_M,
    COURSES,
    SCANS,
    ScannerAt,
    scanned_parts,
    xyz_text,
)
from scipy.spatial.transform import Rotation
from written_clouds import write_cloud

import tankcal
from tankcal.errors import InputError
from tankcal.methods.clouds import wall as cloud_checks
from tankcal.methods.clouds import wall as cloud_wall
from tankcal.methods.clouds.overlaps import RegistrationTest, overlap_test, overlaps_of
from tankcal.record import record_of
from tankcal.record.schema import check_data
from tankcal.record.versions import RECORD

TOOL = Tool(offset_m=3e-4, scale=5e-6, bias_m=5e-4, sd_m=1e-3, sd_rad=5e-5)


def with_tool(tool):
    return {name: replace(one, tool=tool) for name, one in SCANS.items()}


def true_volume_m3():
    """Of the surface of `scanned_tanks`: mean of r^2 by closed form in azimuth, then over z."""
    z = np.linspace(0, COURSE_M * COURSES, 401)
    mean = 3.0 + 0.0005 * z
    return np.trapezoid(np.pi * (mean**2 + 0.004**2 / 2), z)


def warnings_of(result):
    return [str(one) for one in result.warnings]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    parts = scanned_parts(np.random.default_rng(3), with_tool(TOOL))
    return write_folder(tmp_path_factory.mktemp("scanned") / "job", parts)


@pytest.fixture(scope="module")
def result(folder):
    return tankcal.run(tankcal.load(folder))


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(cloud_wall, "MOST_READINGS", 400)


@pytest.mark.slow
def test_volume_is_that_of_the_surface(result):
    top = result.at(COURSE_M * COURSES)
    assert abs(top.value_m3 - true_volume_m3()) < top.U_m3
    assert top.U_m3 / top.value_m3 < 1e-3


@pytest.mark.slow
def test_scans_stand_where_their_targets_say(result):
    found = result.clouded.registration
    assert found.ties == ("network", "network")
    for place, at in zip(found.place_m, SCANS.values(), strict=True):
        np.testing.assert_allclose(place, at.place_m, atol=2e-3)
    assert len(warnings_of(result)) == 2  # inputs not declared, certificate: none of the clouds


@pytest.mark.slow
def test_budget_names_what_is_shared(result):
    lines = {(one.name, one.note) for one in result.budget().lines}
    names = {name for name, _ in lines}
    assert {"registration", "instrument_offset", "instrument_scale", "incidence"} <= names
    assert ("registration", "A") in lines
    shares = {one.name: one.share for one in result.budget().lines}
    assert shares["instrument_offset"] > 0.3  # 0.5 mm of each radius


@pytest.mark.slow
def test_record_tells_files_scans_and_what_is_hidden(result):
    record = record_of(result)
    assert check_data(record, RECORD.schema(), "record.json") == ([], [])
    clouds = record["clouds"]
    assert [one["declared"] for one in clouds["files"]] == [None, None]
    assert [one["tie"] for one in clouds["scans"]] == ["network", "network"]
    assert sum(one["readings"] for one in clouds["scans"]) == len(result.job.points.names)
    assert len(clouds["targets"]) == 10
    assert all(0 < one["mdb_m"] < 0.01 for one in clouds["targets"])
    assert [one["masked"] for one in clouds["courses"]] == [0.0, 0.0]
    assert {one["sha256"] for one in clouds["files"]} <= {one["sha256"] for one in record["files"]}


@pytest.mark.slow
def test_more_points_do_not_make_the_shared_part_smaller(tmp_path, few, result):
    """Property: half of the points, the same u but for the noise of its cells."""
    parts = scanned_parts(np.random.default_rng(3), with_tool(TOOL), rows=30)
    thin = tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)))
    assert thin.table.u_m3[-1] == pytest.approx(result.table.u_m3[-1], rel=0.05)


@pytest.mark.slow
def test_scans_that_do_not_meet_are_named(tmp_path, few):
    """Without targets, a pose that is 6 mm off where 1 mm was declared."""
    parts = scanned_parts(np.random.default_rng(5), with_tool(TOOL), targets=False)
    for name, at in SCANS.items():
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = at.rotation, at.place_m
        pose[0, 3] += 0.006 if name == "B" else 0.0
        given = parts.registers["clouds"][name]
        given |= {"pose": pose.tolist(), "s_translation_mm": 1.0, "s_rotation_arcsec": 10.0}
    job = tankcal.load(write_folder(tmp_path / "job", parts))
    found = tankcal.run(job)
    said = [one for one in warnings_of(found) if "apart where both show" in one]
    assert len(said) == 1
    assert "scans 'A' and 'B'" in said[0]
    (overlap,) = overlaps_of(found.job, found.clouded.cells, found.clouded.registration)
    assert overlap.apart_m == pytest.approx(0.006 / np.sqrt(2), rel=0.1)


@pytest.mark.slow
def test_what_is_assumed_is_warned_of_and_marked(tmp_path, few):
    scans = {"A": ScannerAt((0.2, 0.3, 1.4), tool=TOOL)}
    parts = scanned_parts(np.random.default_rng(6), scans, targets=False)
    given = {"file": "A.xyz", "unit": "m", "scanner": "S", "assume": "documented"}
    pose = np.eye(4)
    pose[:3, 3] = scans["A"].place_m
    parts.registers["clouds"] = {"A": {**given, "pose": pose.tolist()}}
    found = tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)))
    marked = {one.name for one in found.budget().lines if one.is_default}
    assert {"registration", "instrument_offset", "instrument_scale"} <= marked
    said = "\n".join(warnings_of(found))
    assert "an offset of 2.0 mm and a scale of 20 ppm" in said
    assert "registration of scans A is assumed: 3.0 mm and 20''" in said
    assert found.table.u_m3[-1] / found.table.volume_m3[-1] == pytest.approx(2 * 2e-3 / 3, rel=0.1)


@pytest.mark.slow
def test_a_box_leaves_a_cupboard_out(tmp_path, few):
    parts = scanned_parts(np.random.default_rng(6), with_tool(TOOL))
    box = [[1.5, -0.5, 0.5, 2.5, 0.5, 1.5]]  # nothing of the wall, but much of a cupboard
    at = SCANS["A"]
    cupboard = np.random.default_rng(1).uniform([1.6, -0.4, 0.6], [2.4, 0.4, 1.4], (2000, 3))
    parts.extra_files["A.xyz"] += xyz_text(at.own(cupboard))
    parts.registers["clouds"]["A"]["leave_out"] = box
    found = tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)))
    assert found.clouded.left_out.tolist() == [2000, 0]


@pytest.mark.slow
def test_a_scanner_on_the_other_side_and_one_far_away_are_refused(tmp_path, few):
    parts = scanned_parts(np.random.default_rng(6), with_tool(TOOL))
    parts.registers["clouds"]["A"]["side"] = "outside"
    parts.registers["clouds"]["B"]["side"] = "outside"
    with pytest.raises(InputError) as refused:
        tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)))
    said = [str(one) for one in refused.value.problems]
    assert len(said) == 2
    assert all("on the other side of the wall" in one for one in said)


@pytest.mark.slow
def test_exchanged_targets_are_refused_by_name(tmp_path):
    parts = scanned_parts(np.random.default_rng(6), with_tool(TOOL), columns=8, rows=2)
    rows = parts.tables["scan_targets"]
    rows[2][1], rows[3][1] = rows[3][1], rows[2][1]
    with pytest.raises(InputError, match="names exchanged"):
        tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)))


@pytest.mark.slow
def test_the_example_is_the_wall_that_it_was_made_of():
    """Simulation: the true volume, by quadrature, is within U; the pipe is where it stands."""
    truth = json.loads(Path("examples/cloud/truth.json").read_text(encoding="utf-8"))
    found = tankcal.run(tankcal.load("examples/cloud"), simulated=False)
    top = found.at(3.2)
    assert abs(top.value_m3 - truth["volume_m3"]) < top.U_m3
    assert found.clouded.registration.ties == ("network", "network")
    np.testing.assert_allclose(found.clouded.registration.place_m[0], [0.55, 0.2, 1.3], atol=1.5e-3)
    clouds = record_of(found)["clouds"]
    for file, scan in zip(clouds["files"], clouds["scans"], strict=True):
        assert file["declared"] == scan["delivered"] + scan["left_out"]
        assert file["of_wall"] == scan["of_wall"] < scan["delivered"]
    assert not any(one["removed"] for one in clouds["targets"])
    seen = {one["guess"]: one for one in clouds["obstructions"]}
    pipe, neck = seen["pipe"], seen["nozzle"]
    assert pipe["azimuth_from_deg"] < truth["pipe"]["azimuth_deg"] < pipe["azimuth_to_deg"]
    assert neck["azimuth_from_deg"] < truth["neck"]["azimuth_deg"] < neck["azimuth_to_deg"]
    assert neck["bottom_m"] < truth["neck"]["z_m"] < neck["top_m"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("declared", "true", "size"),
    [("m", "mm", 1e3), ("mm", "m", 1e-3), ("m", "ft", 1 / 0.3048), ("m", "in", 1 / 0.0254),
     ("ft", "m", 0.3048), ("in", "mm", 25.4)],
)  # fmt: skip
def test_a_file_in_another_unit_is_named(tmp_path, declared, true, size):
    """Property: both files are written in a unit of their own, one of them is declared wrongly."""
    parts = scanned_parts(np.random.default_rng(6), with_tool(TOOL), columns=120, rows=25)
    metres = {"m": 1.0, "mm": 1e-3, "ft": 0.3048, "in": 0.0254}
    for name in SCANS:
        own = np.array([line.split() for line in parts.extra_files[f"{name}.xyz"].split("\n")[:-1]])
        unit = true if name == "A" else "mm"
        parts.extra_files[f"{name}.xyz"] = xyz_text(own.astype(float) / metres[unit])
        parts.registers["clouds"][name]["unit"] = declared if name == "A" else "mm"
    assert metres[declared] / metres[true] == pytest.approx(size)
    with pytest.raises(InputError) as refused:
        tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)))
    said = [str(one) for one in refused.value.problems]
    assert len(said) == 1
    assert f"if the coordinates of A.xyz are {true}: found {declared}" in said[0]


def _scanned_solid(folder, kind, xyz, **settings):
    """Result of a solid that was scanned once from near its middle."""
    parts = job_parts(kind=kind, settings={"survey.side": "inside", **settings})
    at = np.array([0.3, -0.2, 0.4])
    pose = np.eye(4)
    pose[:3, 3] = at
    parts.extra_files["a.xyz"] = xyz_text(xyz - at)
    exact = {"s_translation_mm": 0.0, "s_rotation_arcsec": 0.0}
    given = {"file": "a.xyz", "unit": "m", "u_offset_mm": 0.5, "u_scale_ppm": 0.0, **exact}
    parts.registers["clouds"] = {"A": {**given, "pose": pose.tolist()}}
    return tankcal.run(tankcal.load(write_folder(folder / "job", parts)))


@pytest.mark.slow
def test_a_sphere_and_a_lying_cylinder(tmp_path, few):
    """Closed form: diameters and volumes of exact solids with noise."""
    rng = np.random.default_rng(4)
    turn, along = rng.uniform(0, 2 * np.pi, 60_000), rng.uniform(-5, 5, 60_000)
    r = 1.2 + 1e-3 * rng.normal(size=len(turn))
    lying = np.column_stack([r * np.cos(turn), along, r * np.sin(turn)])
    settings = {"horizontal.diameter_m": None, "horizontal.azimuth_deg": 0.0}
    settings |= {"horizontal.dip_from_a_m": 5.0, "tank.nominal_diameter_m": 2.4}
    found = _scanned_solid(tmp_path / "lying", "horizontal", lying, **settings)
    assert found.scan.values[0] == pytest.approx(2.4, abs=3e-4)
    (tmp_path / "ball").mkdir()
    ray = rng.normal(size=(200_000, 3))
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    ball = ray * (5 + 1e-3 * rng.normal(size=(len(ray), 1)))
    settings = {"sphere.diameter_m": None, "tank.nominal_diameter_m": 10.0}
    found = _scanned_solid(tmp_path / "ball", "sphere", ball, **settings)
    assert found.scan.values[0] == pytest.approx(10.0, abs=3e-4)
    offset = next(one for one in found.budget().lines if one.name == "instrument_offset")
    own = np.sqrt(offset.share) * found.table.u_m3[-1]
    assert own == pytest.approx(np.pi * 10**2 * 5e-4, rel=0.02)  # area times 0.5 mm


def scene_parts(scene, rng, rays):
    """Parts of a tank that was scanned twice, from known places inside."""
    settings = {**SETTINGS, "survey.side": "inside", "table.step_m": 0.1}
    settings |= {"tank.nominal_diameter_m": 2 * scene.radius_m}
    settings |= {"tank.nominal_height_m": scene.height_m}
    rows = [[str(i + 1), scene.course_m, 8.0] for i in range(scene.courses)]
    parts = Parts(settings, {"courses": [["course", "height_m", "thickness_mm"], *rows]})
    parts.registers["clouds"] = {}
    exact = {"u_offset_mm": 0.01, "u_scale_ppm": 0.0}
    exact |= {"s_translation_mm": 0.01, "s_rotation_arcsec": 0.01}
    for name, place in (("A", (1.0, -0.5, 1.6)), ("B", (-1.2, 0.8, 1.7))):
        at, pose = np.array([*np.add(scene.axis(place[2]), place[:2]), place[2]]), np.eye(4)
        pose[:3, 3] = at
        parts.extra_files[f"{name}.xyz"] = xyz_text(take_scan(rng, scene, place, rays)[0] - at)
        given = {"file": f"{name}.xyz", "unit": "m", "scanner": "S", "pose": pose.tolist()}
        parts.registers["clouds"][name] = given | exact
    return parts


@pytest.mark.slow
def test_a_scan_that_shows_no_wall_is_warned_of(tmp_path, few):
    """One of two files in feet, declared as metres: the other shows the wall, this one nothing."""
    parts = scanned_parts(np.random.default_rng(6), with_tool(TOOL))
    own = np.array([line.split() for line in parts.extra_files["A.xyz"].split("\n")[:-1]])
    parts.extra_files["A.xyz"] = xyz_text(own.astype(float) * 0.3048)
    found = tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)), simulated=False)
    said = [one for one in warnings_of(found) if "are of the wall; expected 1.0 % or more" in one]
    assert len(said) == 1
    assert "scan 'A'" in said[0]


@pytest.mark.slow
def test_a_course_that_few_points_are_of_is_named(tmp_path):
    """60 000 rays each from two places: the top course has some four points in a cell of a scan."""
    parts = scene_parts(Scene(), np.random.default_rng(1), 60_000)
    with pytest.raises(InputError) as refused:
        tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)))
    (said,) = [str(one) for one in refused.value.problems]
    assert "nothing of the wall of course '4' can be used" in said
    assert "of its cells have fewer than 6 points" in said


@pytest.mark.slow
def test_narrow_seams_and_a_buckle_of_a_cloud_are_in_its_table(tmp_path, figure):
    """Simulation by rays; seams of 40 mm, 0.2 m wide, a buckle of 60 mm; volume by integration."""
    seams, buckle = ((1.0, -0.04, 0.2), (3.7, -0.04, 0.2)), (3.0, 5.0, 0.06, 2.0)
    scene = Scene(seams=seams, buckle=buckle)
    parts = scene_parts(scene, np.random.default_rng(1), 300_000)
    found = tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)), simulated=False)
    xyz, rejected = found.job.points.xyz_m, found.wall.shell.reason != ""
    turn = np.arctan2(xyz[:, 0], xyz[:, 1])
    away = [np.abs((turn - at + np.pi) % FULL_TURN - np.pi) for at in (1.0, 3.7, 3.0)]
    mine = 7.5 * np.minimum(away[0], away[1]) < 0.4
    mine |= np.hypot(7.5 * away[2], xyz[:, 2] - 5.0) < 0.8
    assert mine.sum() > 40
    assert not np.any(rejected[mine])
    azimuth, z = FULL_TURN * (np.arange(4000) + 0.5) / 4000, (np.arange(400) + 0.5) / 50
    radii = scene.radius(*(one.ravel() for one in np.meshgrid(azimuth, z)))
    truth, top = np.pi * np.mean(radii**2) * scene.height_m, found.at(scene.height_m)
    off, expanded = 1e6 * (top.value_m3 / truth - 1), 1e6 * top.U_m3 / truth
    figure("seams and a buckle in a cloud: ppm off, U", f"{off:.1f} {expanded:.1f}")
    assert abs(off) < expanded


CORNERS = ((0.9, 0.8), (-0.9, 0.8), (-0.8, -0.9), (0.8, -0.8))


def _registered_badly(folder, seed, factor):
    """`RegistrationTest` of four scans whose poses are `factor` times as bad as declared."""
    rng = np.random.default_rng(seed)
    scans = {f"S{i}": ScannerAt((*at, 1.6), tool=TOOL) for i, at in enumerate(CORNERS)}
    parts = scanned_parts(rng, scans, targets=False, columns=240, rows=40)
    for name, at in scans.items():
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_rotvec(factor * rng.normal(0, 10 / 206265, 3)).as_matrix()
        pose[:3, 3] = at.place_m + factor * rng.normal(0, 1e-3, 3)
        given = parts.registers["clouds"][name]
        given |= {"pose": pose.tolist(), "s_translation_mm": 1.0, "s_rotation_arcsec": 10.0}
    job = tankcal.load(write_folder(folder, parts))
    job, clouded = cloud_wall.points_of_clouds(job, None, lambda _: None)
    return overlap_test(job, clouded.cells, clouded.registration)


@pytest.mark.slow
def test_registration_worse_than_declared_is_found(tmp_path):
    """Simulation: the mean of chi2 over its degrees of freedom is the square of the factor."""
    found = {1: [], 3: []}
    for factor, tests in found.items():
        for seed in range(3):
            folder = tmp_path / f"{factor}-{seed}"
            tests.append(_registered_badly(folder, seed, factor))
    assert min(one.dof for one in found[1]) >= 6
    ratio = {k: np.mean([one.factor**2 for one in tests]) for k, tests in found.items()}
    assert 0.3 < ratio[1] < 2.0
    assert ratio[3] == pytest.approx(9 * ratio[1], rel=0.35)
    assert sum(one.chi2 > one.limit for one in found[3]) >= 2
    assert not any(one.chi2 > one.limit for one in found[1])


@pytest.mark.slow
def test_bad_registration_is_warned_of(tmp_path, few, monkeypatch):
    """Property: the warning names the factor; no pair of scans shows it."""
    monkeypatch.setattr(cloud_checks, "overlaps_of", lambda *_: ())
    monkeypatch.setattr(cloud_checks, "overlap_test", lambda *_: RegistrationTest(48.0, 12))
    parts = scanned_parts(np.random.default_rng(5), with_tool(TOOL), columns=240, rows=40)
    found = tankcal.run(tankcal.load(write_folder(tmp_path / "job", parts)), simulated=False)
    (text,) = [one for one in warnings_of(found) if "where scans overlap" in one]
    assert "differ 2.0 times as much" in text
    assert "expected at most 26.2 with 12 degrees of freedom" in text


@pytest.mark.slow
def test_a_format_that_defines_its_unit_has_no_other(tmp_path):
    """Points of a wall in feet: text is asked for its unit, E57 is in metres by its standard."""
    parts = scanned_parts(np.random.default_rng(6), with_tool(TOOL), columns=120, rows=25)
    expected = {"xyz": "cloud_file_unit", "e57": "no_circle"}
    for ending, code in expected.items():
        folder = write_folder(tmp_path / ending, parts)
        for name in SCANS:
            own = np.loadtxt(folder / f"{name}.xyz")
            write_cloud(folder / f"{name}.{ending}", own / 0.3048)
        text = (folder / "clouds.toml").read_text(encoding="utf-8")
        (folder / "clouds.toml").write_text(text.replace(".xyz", f".{ending}"), encoding="utf-8")
        with pytest.raises(InputError) as refused:
            tankcal.run(tankcal.load(folder))
        assert {one.expected.code for one in refused.value.problems} == {code}
