"""CSV files as programs of three countries write them: separator, decimal mark, encoding.

The truth is the same job, written with commas and decimal points in UTF-8.
"""

import re

import pytest
from job_builder import assert_same_job, job_parts, strapped_parts, write_folder

from tankcal.errors import InputError
from tankcal.job import load
from tankcal.job.field_values import has_two_meanings

ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252")


def rewritten(folder, separator, decimal, encoding):
    """Write the tables of a job anew, as another program would."""
    for path in folder.glob("*.csv"):
        lines = path.read_text(encoding="utf-8").splitlines()
        cells = [line.split(",") for line in lines]
        if decimal == ",":
            cells = [[re.sub(r"^(-?\d+)\.(\d+)$", r"\1,\2", one) for one in row] for row in cells]
        text = "\r\n".join(separator.join(row) for row in cells) + "\r\n"
        path.write_bytes(text.encode(encoding))
    return folder


@pytest.mark.slow(after=10)
@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize(
    ("separator", "decimal"), [(";", ","), (";", "."), ("\t", ","), (",", ".")]
)
@pytest.mark.parametrize("declared", [{}, {"csv.separator": ";", "csv.decimal": ","},
                                      {"csv.separator": ",", "csv.decimal": "."}])  # fmt: skip
def test_any_marks_and_encoding_give_the_same_job(tmp_path, separator, decimal, encoding, declared):
    known = load(write_folder(tmp_path / "known", job_parts()))
    folder = write_folder(tmp_path / "job", job_parts(settings={}))
    if declared:
        text = '\n[csv]\nseparator = "{csv.separator}"\ndecimal = "{csv.decimal}"\n'
        for key, value in declared.items():
            text = text.replace("{" + key + "}", value)
        with open(folder / "job.toml", "a", encoding="utf-8") as file:
            file.write(text)
    assert_same_job(load(rewritten(folder, separator, decimal, encoding)), known)


def test_the_tables_of_a_strapping_too(tmp_path):
    known = load(write_folder(tmp_path / "known", strapped_parts()))
    folder = write_folder(tmp_path / "job", strapped_parts())
    assert_same_job(load(rewritten(folder, ";", ",", "utf-16")), known)


def test_letters_of_windows_are_read_with_a_warning(tmp_path):
    folder = write_folder(tmp_path / "job", job_parts())
    text = (folder / "points.csv").read_text(encoding="utf-8").replace("\nP1,", "\nPosição 1,", 1)
    text = text if "Posição" in text else re.sub(r"\n(\w+-?\w*),", "\nPosição 1,", text, count=1)
    (folder / "points.csv").write_bytes(text.encode("cp1252"))
    job = load(folder)
    assert job.points.names[0] == "Posição 1"
    assert [str(one) for one in job.warnings] == [
        "points.csv: not UTF-8: read with the letters of Windows-1252"
    ]


def problems_of(folder):
    with pytest.raises(InputError) as refused:
        load(folder)
    return [str(one) for one in refused.value.problems]


@pytest.mark.parametrize("mark", [",", "."])
def test_numbers_with_two_meanings_are_refused_in_one_line(tmp_path, mark):
    """A wall in whole millimetres: no number of the file shows which mark it has."""
    folder = write_folder(tmp_path / "job", job_parts())
    rows = [f"P{i};{i + 1}{mark}234;{i + 2}{mark}345;1{mark}456" for i in range(9)]
    (folder / "points.csv").write_text("\n".join(["point;x_m;y_m;z_m", *rows]) + "\n")
    [problem] = [one for one in problems_of(folder) if one.startswith("points.csv")]
    assert f"points.csv, row 2, x_m: found '1{mark}234', which is 1.234 or 1234" in problem
    assert "set [csv] decimal" in problem


@pytest.mark.parametrize(("number", "others"), [("1,234", "12.5"), ("1.234", "12,5")])
def test_the_other_mark_is_read_where_it_has_one_meaning(tmp_path, number, others):
    folder = write_folder(tmp_path / "job", job_parts())
    (folder / "courses.csv").write_text(f"course;height_m\nC1;{others}\nC2;{number}\n")
    problems = problems_of(folder)
    assert [one for one in problems if "courses.csv, row 2" in one] == []
    assert len(
        [one for one in problems if f"courses.csv, row 3, height_m: found '{number}'" in one]
    )


def test_a_file_against_the_declared_mark_is_refused_in_one_line(tmp_path):
    parts = job_parts(settings={"csv.separator": ",", "csv.decimal": "."})
    folder = write_folder(tmp_path / "job", parts)
    (folder / "courses.csv").write_text("course;height_m;thickness_mm\nC1;1,900;8\nC2;1,900;8\n")
    [problem] = [one for one in problems_of(folder) if ", height_m: found" in one]
    assert "which is 1.900 or 1900" in problem
    assert "set [csv] decimal = ',' if it is 1.900" in problem


def test_bounds_of_a_column_decide_without_a_declared_mark(tmp_path):
    """1,900 is 1.9 m: no course is 1900 m high. A declared point still refuses it (above)."""
    folder = write_folder(tmp_path / "job", job_parts())
    heights = [one.height_m for one in load(folder).courses]
    rows = [f"{i};{h:.3f};8".replace(".", ",") for i, h in enumerate(heights, 1)]
    text = "\n".join(["course;height_m;thickness_mm", *rows]) + "\n"
    (folder / "courses.csv").write_text(text)
    assert [one.height_m for one in load(folder).courses] == pytest.approx(heights)


def test_one_number_that_shows_its_mark_decides_for_the_file(tmp_path):
    folder = write_folder(tmp_path / "job", job_parts())
    rows = [f"P{i};{i + 1},234;{i + 2},345;1,456" for i in range(9)]
    text = "\n".join(["point;x_m;y_m;z_m", *rows]) + "\n"
    (folder / "points.csv").write_text(text)
    [problem] = [one for one in problems_of(folder) if one.startswith("points.csv")]
    assert "which is" in problem
    (folder / "points.csv").write_text(text.replace("2,345", "2,34", 1))
    assert [one for one in problems_of(folder) if one.startswith("points.csv")] == []


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1,234", True), ("-999.000", True), ("+12,345", True), ("0,234", False), ("1234,567", False),
     ("1,2345", False), ("1.5", False), ("1234", False), ("01,234", False)],
)  # fmt: skip
def test_numbers_with_two_meanings(text, expected):
    assert has_two_meanings(text) is expected


@pytest.mark.parametrize(("heading", "said"), [
    ("Altura (mm)", "is z_m in mm; expected its own unit: tankcal import points.csv --replace"),
    ("Altura (kg)", "is z_m in kg, a unit that is not converted; expected the unit of z_m"),
])  # fmt: skip
def test_a_heading_in_another_unit_is_refused_with_its_remedy(tmp_path, heading, said):
    folder = write_folder(tmp_path / "job", job_parts())
    points = folder / "points.csv"
    points.write_text(points.read_text(encoding="utf-8").replace("z_m", heading, 1), "utf-8")
    with pytest.raises(InputError) as refused:
        load(folder)
    assert any(said in str(one) for one in refused.value.problems)
