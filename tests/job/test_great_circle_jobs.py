"""great_circles.csv: what is read, in a folder and in a workbook, and what is told of bad ones.

Truth: the files as they were written; of each slip the one line that names it.
"""

import numpy as np
import pytest
from conftest import EXAMPLE
from job_builder import assert_same_job, job_parts, write_book, write_folder
from strapped_spheres import FOUR, TAPE, sphere_parts

import tankcal
from tankcal.errors import InputError
from tankcal.job.starter import write_starter
from tankcal.text.shipped import LANGUAGES

FILE = "great_circles.csv"
READING, USE = 3, 5


def problems(tmp_path, parts):
    """(file, row, column, code) of all problems of a job; [] without one."""
    try:
        tankcal.load(write_folder(tmp_path / "job", parts))
    except InputError as refused:
        return [(one.file, one.row, one.column, one.expected.code) for one in refused.problems]
    return []


def spoilt(row, column, value):
    """Parts with a value in a row (2: the first below the headings) of great_circles.csv."""
    parts = sphere_parts()
    parts.tables["great_circles"][row - 1][column] = value
    return parts


def test_circles_are_read(tmp_path):
    job = tankcal.load(write_folder(tmp_path / "job", sphere_parts(repeats=2)))
    found = job.surveys["great_circles"]
    assert [one.name for one in found.strapping.straps] == [name for name in FOUR for _ in range(2)]
    assert found.strapping.straps[0].sd_m == 0.0005
    assert np.isnan(found.azimuth_rad["E"])
    assert found.azimuth_rad["M60"] == pytest.approx(np.pi / 3)
    assert job.strapping is None
    assert job.points is None


def test_folder_and_workbook_are_one_job(tmp_path):
    parts = sphere_parts()
    folder = tankcal.load(write_folder(tmp_path / "job", parts))
    book = tankcal.load(write_book(tmp_path / "job.xlsx", parts))
    assert_same_job(folder, book)


@pytest.mark.parametrize("language", LANGUAGES)
def test_starter_of_a_strapped_sphere(tmp_path, language):
    write_starter(tmp_path / "job", "sphere", "strapping", language)
    names = {path.name for path in (tmp_path / "job").iterdir()}
    assert {"great_circles.csv", "obstructions.csv", "tape_checks.csv"} <= names
    assert not {"circumferences.csv", "points.csv", "courses.csv"} & names
    assert "ovality_mm" in (tmp_path / "job" / "job.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["horizontal", "sphere"])
def test_only_upright_tanks_have_reference_lines(tmp_path, kind):
    with pytest.raises(ValueError, match="no survey"):
        write_starter(tmp_path / "job", kind, "reference-line")


@pytest.mark.parametrize(
    ("row", "column", "value", "place", "code"),
    [
        (3, 2, None, "azimuth_deg", "meridian_without_azimuth"),
        (2, 2, 10.0, "azimuth_deg", "equator_with_azimuth"),
        (5, 0, "M60", "circle", "circle_elsewhere"),
        (4, READING, 6.28287, "reading_m", "circle_of_other_size"),
        (4, READING, 58.0, "reading_m", "circle_of_other_size"),
        (4, READING, 62828.71, "reading_m", "outside_bounds"),
        (4, 1, "parallel", "kind", "expected_choice"),
        (4, 4, 0.0, "s_mm", "outside_bounds"),
    ],
)
def test_bad_rows_are_told(tmp_path, row, column, value, place, code):
    found = problems(tmp_path, spoilt(row, column, value))
    assert [one[:3] for one in found] == [(FILE, row, place)]
    assert found[0][3] == code or code in ("outside_bounds", "expected_choice")


def test_circles_unlike_the_drawing_are_told_once(tmp_path):
    parts = sphere_parts(settings={"tank.nominal_diameter_m": 200.0})
    assert problems(tmp_path, parts) == [(FILE, 2, "reading_m", "circle_of_other_size")]


def test_all_rows_checks(tmp_path):
    parts = sphere_parts()
    for row in parts.tables["great_circles"][1:]:
        row[USE] = "check"
    assert (FILE, None, None, "all_circles_checks") in problems(tmp_path, parts)


@pytest.mark.parametrize(
    ("settings", "column", "code"),
    [
        ({"sphere.diameter_m": 20.0}, "sphere.diameter_m", "size_beside_circles"),
        ({"survey.side": "inside"}, "survey.side", "strapped_inside"),
        ({"sphere.thickness_mm": None}, "sphere.thickness_mm", "thickness_missing"),
        ({"survey.shell_temperature_c": None}, "survey.shell_temperature_c",
         "tape_of_no_temperature"),
        ({"table.pressure_bar": 5.0}, "sphere.thickness_mm", "thickness_of_loaded_sphere"),
    ],
)  # fmt: skip
def test_bad_settings_are_told(tmp_path, settings, column, code):
    found = problems(tmp_path, sphere_parts(settings=settings))
    assert [one[2:] for one in found] == [(column, code)]


def test_bad_tapes_and_obstructions_are_told(tmp_path):
    parts = sphere_parts(tape={"thickness_mm": None})
    parts.tables["obstructions"] = [["circumference", "kind"], ["M99", "weld"]]
    codes = [one[3] for one in problems(tmp_path, parts)]
    assert "tape_thickness_missing" in codes
    assert "no_such_name" in codes
    assert codes.count("obstruction_incomplete") == 2


def test_points_beside_circles_are_refused(tmp_path):
    parts = sphere_parts()
    rows = [[f"P{i}", float(np.sin(i)), float(np.cos(i)), i / 20] for i in range(12)]
    parts.tables["points"] = [["point", "x_m", "y_m", "z_m"], *rows]
    assert (FILE, None, None, "circles_beside_points") in problems(tmp_path, parts)


def test_inputs_that_circles_tell_are_refused(tmp_path):
    parts = sphere_parts()
    rows = [["diameter", 1.0, "mm"], ["offset", 1.0, "mm"], ["pressure", 0.1, "bar"]]
    parts.tables["uncertainty"] = [["input", "u", "unit"], *rows]
    codes = [one[3] for one in problems(tmp_path, parts)]
    assert codes == ["useless_input"] * 3


@pytest.mark.parametrize("kind", ["vertical", "horizontal"])
def test_circles_are_of_spheres_alone(tmp_path, kind):
    parts = job_parts(kind=kind)
    parts.tables["great_circles"] = sphere_parts().tables["great_circles"]
    parts.registers["instruments"] = {"T": TAPE}
    codes = [one[3] for one in problems(tmp_path, parts)]
    assert "not_for_this_kind" in codes


def test_settings_without_circles_are_refused(tmp_path):
    parts = job_parts(kind="sphere", settings={"sphere.ovality_mm": 5.0})
    assert [one[3] for one in problems(tmp_path, parts)] == ["only_with_circles"]


def test_the_example_is_read():
    job = tankcal.load(EXAMPLE.parent / "sphere-straps")
    assert job.table.pressure_pa == 6e5
    assert len(job.surveys["great_circles"].strapping.straps) == 8
