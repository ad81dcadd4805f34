"""The starter job: an empty form that says what is missing, and a job when it is filled in."""

import tomllib
from pathlib import Path

import openpyxl
import pytest
from job_builder import SETTINGS, assert_same_job, job_parts, write_folder

from tankcal.errors import InputError
from tankcal.job import load
from tankcal.job.contract import COLUMNS, INPUTS, KEYS, KINDS, TABLES_OF_KIND
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
        suiting = [field for field in fields if field.suits(kind)]
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


def documented(language):
    return DOCS.read_text(encoding="utf-8").split(f"```{language}\n")[1].split("```")[0]


def test_the_example_of_the_documentation_is_a_job(tmp_path):
    folder = write_folder(tmp_path / "job", job_parts())
    (folder / "job.toml").write_text(documented("toml"), encoding="utf-8")
    (folder / "courses.csv").write_text(documented("csv"), encoding="utf-8")
    job = load(folder)
    assert (job.tank.id, len(job.courses), job.warnings) == ("T-17", 5, ())
