"""The starter job: an empty form that says what is missing, and a job when it is filled in."""

import tomllib
from pathlib import Path

import openpyxl
import pytest
from job_builder import SETTINGS, assert_same_job, job_parts, write_folder
from survey_builder import survey_parts

from tankcal.errors import InputError
from tankcal.job import load
from tankcal.job.contract import (
    COLUMNS,
    INPUTS,
    KEYS,
    KINDS,
    REGISTER_KEYS,
    REGISTERS_OF_SURVEY,
    SURVEYS,
    TABLES_OF_KIND,
)
from tankcal.starter import write_starter

DOCS = Path(__file__).resolve().parent.parent / "docs" / "job-format.md"
BLANKS = [
    "tank.id",
    "tank.nominal_diameter_m",
    "tank.nominal_height_m",
    "survey.side",
    "survey.date",
    "datum.bottom_z_m",
    "table.reference_temperature_c",
]


@pytest.fixture
def starter(tmp_path):
    write_starter(tmp_path / "new" / "starter")
    return tmp_path / "new" / "starter"


def test_what_is_written(starter):
    assert_written(starter, "vertical")


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_what_it_can_use(tmp_path, kind):
    write_starter(tmp_path / "starter", kind)
    assert_written(tmp_path / "starter", kind)


def assert_written(starter, kind):
    names = ["job.toml", "job.xlsx", *(f"{table}.csv" for table in TABLES_OF_KIND[kind])]
    assert sorted(path.name for path in starter.iterdir()) == sorted(names)
    text = (starter / "job.toml").read_text(encoding="utf-8")
    assert f'\nkind = "{kind}"' in text
    settings = tomllib.loads(text)
    for section, fields in KEYS.items():
        suiting = [field for field in fields if field.suits(kind) and not field.of_survey]
        assert list(settings.get(section, {})) == [field.name for field in suiting]
        assert all(field.note in text for field in suiting)
    for table in TABLES_OF_KIND[kind]:
        heading = (starter / f"{table}.csv").read_text(encoding="utf-8").splitlines()[-1]
        assert heading.split(",") == [field.name for field in COLUMNS[table]]
    notes = (starter / "uncertainty.csv").read_text(encoding="utf-8")
    assert ("# barrel:" in notes, "# surface:" in notes) == (kind == "vertical", kind == "mesh")


def test_another_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match="found 'cube'; expected one of vertical, horizontal"):
        write_starter(tmp_path / "starter", "cube")


@pytest.mark.parametrize("survey", SURVEYS)
def test_a_starter_for_a_survey(tmp_path, survey):
    write_starter(tmp_path / "starter", survey=survey)
    starter = tmp_path / "starter"
    tables = [*SURVEYS[survey], "courses", "bottom", "deadwood", "uncertainty"]
    registers = REGISTERS_OF_SURVEY[survey]
    names = ["job.toml", "job.xlsx", *(f"{table}.csv" for table in tables)]
    names += [f"{register}.toml" for register in registers]
    assert sorted(path.name for path in starter.iterdir()) == sorted(names)
    settings = tomllib.loads((starter / "job.toml").read_text(encoding="utf-8"))
    assert {"datum", "datum_points", "refraction"} <= settings["adjustment"].keys()
    has_photos = survey == "photos"
    assert ("camera" in settings["adjustment"]) == has_photos
    assert ("fixed_photo" in settings["adjustment"]) == has_photos
    for register in registers:
        text = (starter / f"{register}.toml").read_text(encoding="utf-8")
        fields = [field.name for field in REGISTER_KEYS[register]]
        assert list(tomllib.loads(text)[register]["NAME"]) == fields
    for table in SURVEYS[survey]:
        text = (starter / f"{table}.csv").read_text(encoding="utf-8")
        assert text.splitlines()[-1].split(",") == [field.name for field in COLUMNS[table]]
        assert all(f"# {field.name}: {field.note}" in text for field in COLUMNS[table])
    book = openpyxl.load_workbook(starter / "job.xlsx")
    assert book.sheetnames == ["read me", "job", *registers, *tables]


@pytest.mark.parametrize("name", ["", "job.xlsx"])
@pytest.mark.parametrize("survey", SURVEYS)
def test_an_empty_survey_is_told_like_missing_points(tmp_path, survey, name):
    write_starter(tmp_path / "starter", survey=survey)
    with pytest.raises(InputError) as caught:
        load(tmp_path / "starter" / name)
    told = [problem for problem in caught.value.problems if problem.column not in BLANKS]
    assert sorted(problem.file.split()[-1] for problem in told) == sorted(
        ["points.csv", "courses.csv"] if name == "" else ["points", "courses"]
    )


def test_a_starter_of_a_survey_filled_in(tmp_path):
    starter = tmp_path / "starter"
    write_starter(starter, survey="photos")
    job_of_points = write_folder(tmp_path / "job", job_parts())
    for name in ("job.toml", "courses.csv"):
        (starter / name).write_bytes((job_of_points / name).read_bytes())
    text = (starter / "cameras.toml").read_text(encoding="utf-8")
    text = text.replace('\nc_mm = ""', "\nc_mm = 100.0").replace("[cameras.NAME]", "[cameras.UMK]")
    text = text.replace('format_mm = ""', "format_mm = [180, 130]")
    text = text.replace('convention = ""', 'convention = "correction_added"')
    (starter / "cameras.toml").write_text(text, encoding="utf-8")
    rows = {
        "photos": ["F1,UMK" + "," * 16],
        "image_points": [f"F1,{name},{x},10.5,,,5,5,," for x, name in enumerate("ABCD")],
    }
    for table, lines in rows.items():
        with open(starter / f"{table}.csv", "a", encoding="utf-8") as file:
            width = len(COLUMNS[table])
            file.writelines(
                ",".join([*line.split(","), *[""] * width][:width]) + "\n" for line in lines
            )
    job = load(starter)
    assert (job.measurements.photos[0].camera, job.warnings) == ("UMK", ())
    assert job.measurements.image_points.point == tuple("ABCD")


def test_another_survey_is_refused(tmp_path):
    with pytest.raises(ValueError, match="found 'laser'; expected one of photos, total-station"):
        write_starter(tmp_path / "starter", survey="laser")
    with pytest.raises(ValueError, match="of kind mesh has no survey"):
        write_starter(tmp_path / "starter", "mesh", "photos")


def test_a_directory_that_holds_something_is_left_alone(starter, tmp_path):
    before = {path.name: path.read_bytes() for path in starter.iterdir()}
    with pytest.raises(InputError, match="starter: is not empty"):
        write_starter(starter)
    assert {path.name: path.read_bytes() for path in starter.iterdir()} == before
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="file: is a file"):
        write_starter(tmp_path / "file")


@pytest.mark.parametrize(("name", "kind"), [("", "job.toml"), ("job.xlsx", "sheet job")])
def test_the_empty_form_has_one_problem_for_each_blank(starter, name, kind):
    with pytest.raises(InputError) as caught:
        load(starter / name)
    problems = caught.value.problems
    blanks = [problem for problem in problems if problem.file == kind]
    assert [problem.column for problem in blanks] == BLANKS
    assert all(problem.expected.startswith("blank; expected ") for problem in blanks)
    others = [problem.expected.split(";")[0] for problem in problems if problem.file != kind]
    assert others == ["no rows", "no rows"]  # of points and courses


def fill_folder(folder):
    lines = (folder / "job.toml").read_text(encoding="utf-8").split("\n")
    section, filled = "", 0
    for number, line in enumerate(lines):
        if line.startswith("["):
            section = line.strip("[]")
        elif "FILL IN" in line and not line.startswith("#"):
            key = line.split(" = ")[0]
            value = SETTINGS[f"{section}.{key}"]
            text = f'"{value}"' if isinstance(value, str) else repr(value)
            lines[number] = line.replace('""', text, 1)
            filled += 1
    (folder / "job.toml").write_text("\n".join(lines), encoding="utf-8")
    for table, rows in filled_tables().items():
        with open(folder / f"{table}.csv", "a", encoding="utf-8") as file:
            file.writelines(",".join(map(str, row)) + "\n" for row in rows)
    return filled


def fill_workbook(path):
    book = openpyxl.load_workbook(path)
    filled = 0
    for row in book["job"].iter_rows(min_row=2):
        if (row[3].value or "").startswith("FILL IN"):
            row[2].value = SETTINGS[f"{row[0].value}.{row[1].value}"]
            filled += 1
    for table, rows in filled_tables().items():
        for number, row in enumerate(rows, 2):
            for column, value in enumerate(row, 1):
                book[table].cell(number, column).value = value
    book.save(path)
    return filled


def filled_tables():
    """Rows in the order of the starter's columns, the optional ones left blank."""
    tables = job_parts(noise_mm=2.0).tables
    tables["uncertainty"] = [[], ["scale", 5, "ppm", "", "", "", ""]]
    return {
        name: [[*row, *[""] * (len(COLUMNS[name]) - len(row))] for row in rows[1:]]
        for name, rows in tables.items()
    }


def test_both_forms_filled_in_give_the_same_job(starter):
    assert fill_folder(starter) == len(BLANKS)
    assert fill_workbook(starter / "job.xlsx") == len(BLANKS)
    folder, workbook = load(starter), load(starter / "job.xlsx")
    assert (folder.points.rows[0], workbook.points.rows[0]) == (12, 2)  # ten comments in the CSV
    assert (folder.tank.id, len(folder.points.names), len(folder.courses)) == ("T-1", 120, 5)
    assert folder.inputs[0].u == 5e-6
    assert (folder.points.sd_m, folder.warnings) == (None, ())
    assert_same_job(folder, workbook)


def test_the_workbook_helps_to_fill_it_in(starter):
    book = openpyxl.load_workbook(starter / "job.xlsx")
    tables = ["points", "courses", "bottom", "deadwood", "uncertainty"]
    assert book.sheetnames == ["read me", "job", *tables]
    lists = {rule.formula1 for rule in book["job"].data_validations.dataValidation}
    assert '"outside,inside"' in lists
    assert book["points"]["B1"].comment.text == "coordinate x, metres."
    name_style = book["points"].column_dimensions["A"].number_format
    assert name_style == "@"  # a name such as 1-2 stays a text and becomes no date


def test_the_documentation_names_every_key_column_and_choice():
    text = DOCS.read_text(encoding="utf-8")
    for section, fields in KEYS.items():
        assert f"[{section}]" in text
        for field in fields:
            assert f"`{field.name}`" in text, field.name
    for table, fields in COLUMNS.items():
        assert f"{table}.csv" in text
        for field in fields:
            assert f"`{field.name}`" in text, field.name
            for choice in field.choices:
                assert choice in text
    for name, known in INPUTS.items():
        assert f"| `{name}` | `{known.unit}` |" in text


def test_the_documentation_names_the_keys_of_cameras_and_instruments():
    text = DOCS.read_text(encoding="utf-8")
    for register, fields in REGISTER_KEYS.items():
        assert f"{register}.toml" in text
        for field in fields:
            assert f"`{field.name}`" in text, field.name
            assert all(choice in text for choice in field.choices)


def test_the_camera_of_the_documentation_is_one(tmp_path):
    text = DOCS.read_text(encoding="utf-8").split('```\n[cameras."UMK 10/1318"]')[1].split("```")[0]
    folder = write_folder(tmp_path / "job", survey_parts(tank=False))
    (folder / "cameras.toml").write_text(
        '[cameras."UMK 10/1318"]' + text + "s_K1 = 1e-9\n[cameras.D]" + text + "s_K1 = 1e-9\n"
        "pixel_um = 25.0\n",
        encoding="utf-8",
    )
    camera = load(folder, only="adjustment").measurements.cameras[0].camera
    assert (camera.name, camera.values[3]) == ("UMK 10/1318", 1.1e-7)


def documented(language):
    return DOCS.read_text(encoding="utf-8").split(f"```{language}\n")[1].split("```")[0]


def test_the_example_of_the_documentation_is_a_job(tmp_path):
    folder = write_folder(tmp_path / "job", job_parts())
    (folder / "job.toml").write_text(documented("toml"), encoding="utf-8")
    (folder / "courses.csv").write_text(documented("csv"), encoding="utf-8")
    job = load(folder)
    assert (job.tank.id, len(job.courses), job.warnings) == ("T-17", 5, ())
