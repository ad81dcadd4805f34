"""The starter job: an empty form that says what is missing, and a job when it is filled in."""

import re
import tomllib
from pathlib import Path

import openpyxl
import pytest
from filled_forms import fill_form
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
    columns_of,
)
from tankcal.job.fields import Field
from tankcal.job.rule_files import LIMITS, RULE, parse_rule, shipped_names
from tankcal.job.starter import write_input_workbook, write_starter
from tankcal.job.starter.texts import filled_page
from tankcal.job.starter.writing import OF_GREAT_CIRCLES, STRAPPED
from tankcal.job.tables import Log
from tankcal.tank.rules import TANKS
from tankcal.text.shipped import DEFAULT, LANGUAGES

OTHERS = [one for one in LANGUAGES if one != DEFAULT]
DOCS = Path(__file__).resolve().parents[2] / "docs" / "job-format.md"
OF_SURVEYS = ("shell", "strapping", "liquid", "radii", "change")
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


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", KINDS)
def test_forms_have_the_settings_of_their_kind(tmp_path, kind):
    write_starter(tmp_path / "starter", kind)
    assert_written(tmp_path / "starter", kind)


def assert_written(starter, kind):
    names = ["job.toml", *(f"{table}.csv" for table in TABLES_OF_KIND[kind])]
    assert sorted(path.name for path in starter.iterdir()) == sorted(names)
    text = (starter / "job.toml").read_text(encoding="utf-8")
    assert f'\nkind = "{kind}"' in text
    settings = tomllib.loads(text)
    for section, fields in KEYS.items():
        strapped = section in OF_SURVEYS  # of forms of surveys alone
        suiting = [
            field for field in fields if field.suits(kind) and not field.of_survey and not strapped
        ]
        suiting = [one for one in suiting if (section, one.name) not in OF_GREAT_CIRCLES]
        assert list(settings.get(section, {})) == [field.name for field in suiting]
        assert all(field.note in text for field in suiting)
    for table in TABLES_OF_KIND[kind]:
        heading = (starter / f"{table}.csv").read_text(encoding="utf-8").splitlines()[-1]
        assert heading.split(",") == [field.name for field in COLUMNS[table]]
    notes = (starter / "uncertainty.csv").read_text(encoding="utf-8")
    assert ("# barrel:" in notes, "# surface:" in notes) == (kind == "vertical", kind == "mesh")
    assert (
        "# shell_temperature: shell temperature during the survey, K; not declared: ± 2 K" in notes
    )


def test_another_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match="found 'cube'; expected one of vertical, horizontal"):
        write_starter(tmp_path / "starter", "cube")


@pytest.mark.slow
@pytest.mark.parametrize("survey", SURVEYS)
def test_a_starter_for_a_survey(tmp_path, survey):
    write_starter(tmp_path / "starter", survey=survey)
    starter = tmp_path / "starter"
    tables = [*SURVEYS[survey], *TABLES_OF_KIND["vertical"][1:]]
    registers = REGISTERS_OF_SURVEY.get(survey, ())
    names = ["job.toml", *(f"{table}.csv" for table in tables)]
    names += [f"{register}.toml" for register in registers]
    assert sorted(path.name for path in starter.iterdir()) == sorted(names)
    settings = tomllib.loads((starter / "job.toml").read_text(encoding="utf-8"))
    if survey in STRAPPED:
        assert "adjustment" not in settings
        assert settings["shell"] == {"shape_sd_mm": ""}
    elif survey == "radii":
        assert "adjustment" not in settings
        assert list(settings["radii"]) == [field.name for field in KEYS["radii"]]
    elif survey == "liquid":
        assert "adjustment" not in settings
        assert list(settings["liquid"]) == [field.name for field in KEYS["liquid"]]
    else:
        assert {"datum", "datum_points", "refraction"} <= settings["adjustment"].keys()
        has_photos = survey == "photos"
        assert ("camera" in settings["adjustment"]) == has_photos
        assert ("fixed_photo" in settings["adjustment"]) == has_photos
    for register in registers:
        text = (starter / f"{register}.toml").read_text(encoding="utf-8")
        fields = [field.name.partition(".")[0] for field in REGISTER_KEYS[register]]
        fields = list(dict.fromkeys(fields))
        assert list(tomllib.loads(text)[register]["NAME"]) == fields
    for table in SURVEYS[survey]:
        text = (starter / f"{table}.csv").read_text(encoding="utf-8")
        fields = columns_of(table, "vertical")
        assert text.splitlines()[-1].split(",") == [field.name for field in fields]
        assert all(f"# {field.name}: {field.note}" in text for field in fields)
    book = openpyxl.load_workbook(write_input_workbook(tmp_path / "job.xlsx", survey=survey))
    assert book.sheetnames == ["read me", "job", *registers, *tables, "# inputs"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["", "job.xlsx"])
@pytest.mark.parametrize("survey", SURVEYS)
def test_empty_survey_is_reported_as_missing(tmp_path, survey, name):
    (write_input_workbook if name else write_starter)(tmp_path / "starter", survey=survey)
    with pytest.raises(InputError) as caught:
        load(tmp_path / "starter" / name)
    told = [problem for problem in caught.value.problems if problem.column not in BLANKS]
    own = {"wall-hits": "wall_hits", "tangents": "tangents", "cloud": "clouds", "liquid": "liquid"}
    own["radii"] = "radii"
    measured = own.get(survey, "points")
    expected = ["courses", "circumferences" if survey in STRAPPED else measured]
    found = sorted(problem.file.split()[-1].partition(".")[0] for problem in told)
    assert found == sorted(expected)


@pytest.mark.slow
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
def test_the_empty_form_has_one_problem_for_each_blank(tmp_path, name, kind):
    starter = tmp_path / "starter"
    (write_input_workbook if name else write_starter)(starter)
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
    tables = {
        name: [[field.name for field in COLUMNS[name]], *rows]
        for name, rows in filled_tables().items()
    }
    fill_form(path, {key: SETTINGS[key] for key in BLANKS}, tables)


def filled_tables():
    """Rows in the order of the starter's columns, the optional ones left blank."""
    tables = job_parts(noise_mm=2.0).tables
    tables["uncertainty"] = [[], ["scale", 5, "ppm"], ["datum", 2, "mm", "expanded", 2]]
    tables["correlations"] = [[], ["datum", "scale", 0.5]]
    tables["stated"] = [[], [9, 2]]
    return {
        name: [[*row, *[""] * (len(COLUMNS[name]) - len(row))] for row in rows[1:]]
        for name, rows in tables.items()
    }


@pytest.mark.slow
def test_both_forms_filled_in_give_the_same_job(starter):
    assert fill_folder(starter) == len(BLANKS)
    book = write_input_workbook(starter.parent / "book.xlsx")
    fill_workbook(book)
    folder, workbook = load(starter), load(book)
    assert (folder.points.rows[0], workbook.points.rows[0]) == (12, 10)  # ten comments in the CSV
    assert (folder.tank.id, len(folder.points.names), len(folder.courses)) == ("T-1", 120, 5)
    assert [one.u for one in folder.inputs[:2]] == [5e-6, 1e-3]
    assert folder.correlations == (("datum", "scale", 0.5),)
    assert [(one.high_m, one.low_m) for one in folder.stated] == [(9.0, 2.0)]
    assert (folder.points.sd_m, folder.warnings) == (None, ())
    assert_same_job(folder, workbook)


@pytest.mark.slow
def test_the_workbook_helps_to_fill_it_in(tmp_path):
    book = openpyxl.load_workbook(write_input_workbook(tmp_path / "job.xlsx"))
    tables = ["points", "courses", "welds", "bottom", "deadwood", "uncertainty"]
    tables += ["correlations", "stated", "overrulings"]
    assert book.sheetnames == ["read me", "job", *tables, "# inputs"]
    lists = {rule.formula1 for rule in book["job"].data_validations.dataValidation}
    assert '"outside,inside"' in lists
    of_inputs = {rule.formula1 for rule in book["uncertainty"].data_validations.dataValidation}
    suiting = [name for name, one in INPUTS.items() if "vertical" in one.kinds]
    assert f'"{",".join(suiting)}"' in of_inputs
    name_style = book["points"].column_dimensions["B"].number_format
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
        assert (f"| `{name}` | {known.assumption} |" in text) == bool(known.assumption)


def test_the_documentation_is_filled_in():
    text = DOCS.read_text(encoding="utf-8")
    assert filled_page(text) == text, "stale: make job-format"


def test_a_new_column_gets_a_row_and_an_old_one_loses_it(monkeypatch):
    added = Field("ladder_m", "number", "width of the ladder", required=True, low=0, high=2)
    fields = (COLUMNS["courses"][0], added, *COLUMNS["courses"][1:-1])  # without paint_mm
    monkeypatch.setitem(COLUMNS, "courses", fields)
    text = filled_page(DOCS.read_text(encoding="utf-8"))
    assert "\n| **`ladder_m`** | width of the ladder | 0 to 2 |\n| **`height_m`** |" in text
    assert "`paint_mm` | paint thickness" not in text
    assert filled_page(text) == text


def test_the_documentation_names_the_keys_and_choices_of_a_rule():
    text = DOCS.read_text(encoding="utf-8")
    for part, fields in {"rule": RULE, **LIMITS}.items():
        assert f"[{part}" in text
        for field in fields:
            assert f"`{field.name}`" in text, field.name
            assert all(f"`{choice}`" in text for choice in field.choices)
    assert all(f"`{name}`" in text for name in (*shipped_names(), *TANKS))


def test_the_rule_of_the_documentation_is_one():
    text = DOCS.read_text(encoding="utf-8").split("```toml\n")[2].split("```")[0]
    log = Log()
    rule = parse_rule("house.toml", text.encode(), log)
    assert (log.problems, rule.name, rule.verified) == ([], "House rule", True)
    assert (len(rule.uncertainty), len(rule.deviation)) == (1, 1)


def test_the_inputs_of_the_documentation_are_declared(tmp_path):
    text = DOCS.read_text(encoding="utf-8").split("    input,u,unit,u_is")[1].split("\n\n")[0]
    folder = write_folder(tmp_path / "job", job_parts())
    lines = [line.strip() for line in f"input,u,unit,u_is{text}".splitlines()]
    (folder / "uncertainty.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    declared = [one.name for one in load(folder).inputs if not one.is_default]
    assert declared == ["scale", "offset", "datum"]


def test_docs_name_keys_of_cameras_and_instruments():
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


# ---- in other languages


@pytest.mark.slow
@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("survey", [None, "photos", "total-station"])
def test_every_comment_of_the_text_files_is_in_the_language(tmp_path, language, survey):
    """Second method: the same form in both languages shares no comment but names and numbers."""
    english = comments(write_starter_in(tmp_path / "en", "vertical", survey, "en"))
    other = comments(write_starter_in(tmp_path / language, "vertical", survey, language))
    assert len(other) == len(english) > 150
    shared = [one for one in other if one in english and re.search("[a-z]{4}", one)]
    assert shared == ["tankcal run ."]


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("kind", KINDS)
def test_forms_have_the_sizes_of_the_drawing(tmp_path, language, kind):
    """What tells a slip of the hand: diameter, height and volume, in text and in the workbook."""
    folder = write_starter_in(tmp_path / "job", kind, None, language)
    settings = tomllib.loads((folder / "job.toml").read_text(encoding="utf-8"))
    book = write_input_workbook(tmp_path / "job.xlsx", kind, None, language)
    sheet = openpyxl.load_workbook(book, read_only=True)["job"]
    in_book = {cell for row in sheet.iter_rows(values_only=True) for cell in row}
    for key in ("nominal_diameter_m", "nominal_height_m", "nominal_volume_m3"):
        assert key in settings["tank"]
        assert key in in_book


def write_starter_in(folder, kind, survey, language):
    write_starter(folder, kind, survey, language)
    return folder


def comments(folder):
    """Every comment of the text files, without the key that it explains."""
    lines = [
        line
        for path in sorted(folder.iterdir())
        if path.suffix in (".toml", ".csv")
        for line in path.read_text(encoding="utf-8").splitlines()
        if "# " in line
    ]
    return [re.sub(r"^\w+: ", "", line.partition("# ")[2]).strip() for line in lines]
