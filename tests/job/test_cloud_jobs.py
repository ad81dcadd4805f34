"""clouds.toml and scan_targets.csv: what is read, and what is told of bad ones.

Truth: the files as they were written.
"""

import shutil

import numpy as np
import pytest
from conftest import EXAMPLE
from job_builder import assert_same_job, job_parts, write_book, write_folder
from scanned_tanks import SCANS, scanned_parts
from written_clouds import some_wall, write_e57

import tankcal
from tankcal.errors import InputError
from tankcal.job.starter import write_input_workbook, write_starter
from tankcal.methods.clouds.columns import ASSUMED


def small(**given):
    """Parts of two scans of a few points; given: keys of both files."""
    return scanned_parts(np.random.default_rng(1), columns=6, rows=3, clouds=given)


def told(tmp_path, parts):
    """Lines of all problems of a job."""
    with pytest.raises(InputError) as refused:
        tankcal.load(write_folder(tmp_path / "job", parts))
    return [str(one) for one in refused.value.problems]


def test_clouds_are_read_in_si(tmp_path):
    parts = small(offset_mm=1.5, scale_ppm=-20.0, leave_out=[[0, 0, 0, 1, 2, 3]], surface="rust")
    parts.registers["clouds"]["B"] |= {"unit": "mm", "scanner_xyz": [1000, 0, 500]}
    clouds = tankcal.load(write_folder(tmp_path / "job", parts)).clouds
    assert [one.name for one in clouds.scans] == ["A", "B"]
    tool, offset_assumed, scale_assumed = clouds.tools["S"]
    assert (tool.correction_m, tool.correction) == (0.0015, -2e-5)
    assert (tool.u_offset_m, tool.u_scale, tool.u_incidence_m) == (5e-4, 1e-5, 1e-3)
    assert not offset_assumed
    assert not scale_assumed
    assert clouds.files[1].unit_m == 0.001
    np.testing.assert_array_equal(clouds.scans[1].beam_from_m, [1.0, 0.0, 0.5])
    np.testing.assert_array_equal(clouds.files[0].leave_out_m, [[0, 0, 0, 1, 2, 3]])
    assert len(clouds.targets) == 10
    assert clouds.targets[0].sd_m == 5e-4
    np.testing.assert_allclose(clouds.control.covariance_m2, 9e-8 * np.eye(15))


def test_an_empty_register_beside_its_survey_is_told(tmp_path):
    folder = shutil.copytree(EXAMPLE.parent / "cloud", tmp_path / "job")
    (folder / "clouds.toml").write_text("")
    with pytest.raises(InputError) as refused:
        tankcal.load(folder)
    (line,) = [str(one) for one in refused.value.problems]
    assert line.startswith("clouds.toml: ")


def test_pose_is_in_the_unit_of_the_file(tmp_path):
    pose = [[0, -1, 0, 2000], [1, 0, 0, -500], [0, 0, 1, 1500], [0, 0, 0, 1]]
    parts = small(unit="mm", pose=pose)
    scan = tankcal.load(write_folder(tmp_path / "job", parts)).clouds.scans[0]
    np.testing.assert_array_equal(scan.pose[:3, 3], [2.0, -0.5, 1.5])
    np.testing.assert_array_equal(scan.pose[:3, :3], np.array(pose)[:3, :3])


def test_workbook_and_folder_are_the_same_job(tmp_path):
    pose = "0 -1 0 2; 1 0 0 -0.5; 0 0 1 1.5; 0 0 0 1"
    parts = small(pose=pose, leave_out="0 0 0 1 1 1; 2 2 0 3 3 1", s_translation_mm=1.0)
    parts.beside, parts.extra_files = (
        {name: text.encode() for name, text in parts.extra_files.items()},
        {},
    )
    folder = write_folder(tmp_path / "job", parts)
    (tmp_path / "book").mkdir()
    book = write_book(tmp_path / "book" / "job.xlsx", parts)
    one, other = tankcal.load(folder), tankcal.load(book)
    assert [f.header.bytes for f in one.clouds.files] == [
        f.header.bytes for f in other.clouds.files
    ]
    strip = {"clouds": None}
    from dataclasses import replace

    assert_same_job(replace(one, **strip), replace(other, **strip))
    for a, b in zip(one.clouds.scans, other.clouds.scans, strict=True):
        np.testing.assert_array_equal(a.pose, b.pose)


def test_all_problems_come_in_one_run(tmp_path):
    parts = small()
    clouds = parts.registers["clouds"]
    clouds["A"] |= {
        "file": "no.xyz",
        "pose": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]],
        "leave_out": [[1, 0, 0, 0, 1, 1]],
        "scanner_xyz": [1, 2],
        "u_offset_mm": "free",
    }
    clouds["B"] |= {"pose": [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]}
    del clouds["B"]["u_scale_ppm"]
    parts.tables["scan_targets"] += [
        ["C", "T1", 0.0, 0.0, 0.0, 1.0],
        ["B", "T1", 0.0, 0.0, 0.0, 1.0],
    ]
    said = "\n".join(told(tmp_path, parts))
    for part in (
        "clouds.toml, row 2, A.file: no.xyz not found",
        "A.leave_out: box 1 holds nothing",
        "A.scanner_xyz: 2 numbers; expected x, y and z",
        "A.u_offset_mm: found free; expected its standard uncertainty, or a circumference by tape",
        "B.pose: the pose of scan 1 is no rotation and shift",
        "B.u_scale_ppm: missing; expected its value, 0 where it is exact",
        "B.u_offset_mm: not what 'A' has, but both are of one scanner",
        "scan_targets.csv, row 13, target: 'T1' is already in row 7",
    ):
        assert part in said, part


def test_rows_of_a_pose_are_counted(tmp_path):
    pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    assert (
        "A.pose: 3 rows; expected 4, four for each of the 1 scans"
        in told(tmp_path, small(pose=pose))[0]
    )


ZEROS, UNIT = (0, 0, 0, 0), (1, 0, 0, 0)
FOUR = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("poses", "given", "code"),
    [
        ([(ZEROS, (0, 0, 0))], None, None),
        ([(ZEROS, (1, 2, 3))], None, None),
        ([(ZEROS, (1, 2, 3))], "file", "file_without_pose"),
        ([(ZEROS, (0, 0, 0))] * 2, None, None),
        ([(ZEROS, (1, 2, 3))] * 2, None, "pose_without_rotation"),
        ([(ZEROS, (1, 2, 3))] * 2, FOUR * 2, None),
        ([(ZEROS, (1, 2, 3)), (UNIT, (1, 2, 3))], "file", "file_without_pose"),
        ([(ZEROS, (1, 2, 3)), (UNIT, (1, 2, 3))], None, "pose_of_scans_missing"),
        ([(UNIT, (1, 2, 3))] * 2, "file", None),
    ],
)
def test_a_quaternion_of_zeros_in_a_job(tmp_path, poses, given, code):
    """No pose: a warning where the key is blank; refused where a pose is necessary."""
    parts = small()
    parts.registers["clouds"]["A"]["file"] = "zeros.e57"
    if given is not None:
        parts.registers["clouds"]["A"]["pose"] = given
    folder = write_folder(tmp_path / "job", parts)
    write_e57(folder / "zeros.e57", [some_wall(200)] * len(poses), poses=poses)
    try:
        found = tankcal.load(folder).warnings
        problems = []
    except InputError as error:
        problems = [one.expected.code for one in error.problems if one.column == "A.pose"]
    assert problems == ([] if code is None else [code])
    if code is None and len(poses) == 1:
        assert [one.expected.code for one in found].count("cloud_file_e57_zero_pose") == 1


@pytest.mark.parametrize(
    ("value", "found"),
    [("1 2 3", "'1 2 3'"), ([[1, 2, 3, "x"]], "the text"), (7, "7"), ([[1, 2], 3], "a list")],
)
def test_bad_rows_are_told(tmp_path, value, found):
    said = told(tmp_path, small(pose=value))
    assert len(said) == 2
    assert f"found {found}" in said[0]
    assert "expected rows of 4 numbers, such as 1 2 3 4; 1 2 3 4" in said[0]


@pytest.mark.parametrize("file", ["../a.xyz", "/etc/a.xyz", "a.exe", "C:/a.xyz"])
def test_files_elsewhere_and_of_another_kind_are_refused(tmp_path, file):
    parts = small()
    parts.registers["clouds"]["A"]["file"] = file
    said = told(tmp_path, parts)
    assert "A.file: found" in said[0]


@pytest.mark.parametrize(
    "key", ["u_offset_mm", "u_scale_ppm", "s_translation_mm", "s_rotation_arcsec"]
)
def test_shared_errors_are_mandatory_or_assumed(tmp_path, key):
    scans = {"A": SCANS["A"]}
    given = {"s_translation_mm": 0.0, "s_rotation_arcsec": 0.0, "u_offset_mm": 0.0}
    rng = np.random.default_rng(1)
    parts = scanned_parts(rng, scans, clouds=given, targets=False, columns=6, rows=3)
    assert tankcal.load(write_folder(tmp_path / "whole", parts)).clouds is not None
    del parts.registers["clouds"]["A"][key]
    said = told(tmp_path, parts)
    assert len(said) == 1
    assert f"A.{key}: missing; expected its value, 0 where it is exact" in said[0]
    parts.registers["clouds"]["A"]["assume"] = "documented"
    clouds = tankcal.load(write_folder(tmp_path / "assumed", parts)).clouds
    scan, (tool, offset, scale) = clouds.scans[0], clouds.tools["S"]
    assert (offset, scale) == (key == "u_offset_mm", key == "u_scale_ppm")
    assert scan.is_assumed == key.startswith("s_")
    taken = {
        "u_offset_mm": 1e3 * tool.u_offset_m,
        "u_scale_ppm": 1e6 * tool.u_scale,
        "s_translation_mm": 1e3 * scan.s_translation_m,
        "s_rotation_arcsec": np.degrees(scan.s_rotation_rad) * 3600,
    }
    assert taken[key] == pytest.approx(ASSUMED[key])


def test_clouds_stand_for_points(tmp_path):
    parts = small()
    parts.tables["points"] = [["point", "x_m", "y_m", "z_m"], ["P", 1.0, 2.0, 3.0]]
    said = "\n".join(told(tmp_path, parts))
    assert "points.csv: given together with a cloud" in said


@pytest.mark.parametrize("side", [None, "outside"])
def test_a_bottom_of_a_cloud_needs_a_scan_from_inside(tmp_path, side):
    parts = small() if side is None else small(side=side)
    if side is None:
        parts = job_parts()
    parts.settings["bottom.form"] = "cloud"
    said = told(tmp_path, parts)
    assert any("bottom.form: found cloud; expected a scan from inside" in one for one in said)


def test_targets_without_clouds_and_lonely_targets_are_warned_of(tmp_path):
    parts = small()
    parts.tables["scan_targets"].append(["A", "T9", 1.0, 1.0, 1.0, 1.0])
    job = tankcal.load(write_folder(tmp_path / "job", parts))
    assert ["'T9' is on this scan alone" in str(one) for one in job.warnings].count(True) == 1


@pytest.mark.slow
def test_starter_job_of_a_cloud_only_lacks_values(tmp_path):
    for language in ("en", "pt-BR", "es"):
        folder = tmp_path / language
        write_starter(folder, "vertical", "cloud", language)
        assert (folder / "clouds.toml").exists()
        assert (folder / "scan_targets.csv").exists()
        book = write_input_workbook(tmp_path / f"{language}.xlsx", "vertical", "cloud", language)
        for source in (folder, book):
            with pytest.raises(InputError) as refused:
                tankcal.load(source)
            assert not any("unknown" in str(one) for one in refused.value.problems)
