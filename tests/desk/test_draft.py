"""A job under edit: checked as it would be after saving, marked by cell, saved all or nothing."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from job_builder import write_job, write_workbook
from openpyxl import load_workbook

import tankcal
from tankcal.errors import InputError
from tankcal.products.desk import draft as drafts
from tankcal.products.desk import keys
from tankcal.products.desk.draft import BAD, DOUBTFUL, Draft
from tankcal.products.desk.tables import AmbiguousNumber

EXAMPLES = Path(__file__).parents[2] / "examples"
FOLDERS = sorted(path.parent.name for path in EXAMPLES.glob("*/job.toml"))


@pytest.fixture
def folder(tmp_path):
    return write_job(tmp_path / "job", rings=2)


@pytest.fixture
def book(tmp_path):
    return write_workbook(tmp_path / "job.xlsx", rings=2)


def contents(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


@pytest.mark.parametrize("name", FOLDERS)
def test_opening_an_example_changes_nothing(name):
    draft = Draft.open(EXAMPLES / name)
    assert not draft.is_changed
    assert draft.edited_files()[0] == {}
    for state in (*draft.tables.values(), *draft.keys.values()):
        assert state.render()[0] == (EXAMPLES / name / state.file).read_bytes()


def test_a_bad_cell_is_marked_with_its_reason(folder):
    draft = Draft.open(folder)
    draft.set_cells("points", [(3, "x_m", "abc")])
    check = draft.check()
    assert [one.row for one in check.problems] == [draft.tables["points"].render()[1][3]]
    (mark,) = check.marks["points"][3, "x_m"]
    assert mark.level == BAD
    assert "'abc'" in mark.problem.expected
    draft.undo()
    assert draft.check().is_valid


def test_a_problem_follows_its_row(folder):
    draft = Draft.open(folder)
    draft.set_cells("points", [(3, "x_m", "abc")])
    draft.insert_rows("points", 0, 2)
    assert list(draft.check().marks["points"]) == [(5, "x_m")]
    draft.remove_rows("points", [2])
    assert list(draft.check().marks["points"]) == [(4, "x_m")]


def test_warnings_are_marked_as_doubtful(folder):
    draft = Draft.open(folder)
    x, y, z = (draft.tables["points"].rows[0].cells[i] for i in (1, 2, 3))
    draft.set_cells("points", [(1, "x_m", x), (1, "y_m", y), (1, "z_m", z)])
    assert draft.check().marks["points"][1, "x_m"][0].level == DOUBTFUL


@pytest.mark.parametrize(
    ("owner", "key", "text"),
    [("tank", "nominal_height_m", "high"), ("survey", "side", ""), ("table", "step_m", "-1")],
)
def test_a_bad_setting_is_marked(folder, owner, key, text):
    draft = Draft.open(folder)
    draft.set_value("job", owner, key, text)
    assert draft.check().marks["job"][owner, key][0].level == BAD


def test_saving_writes_what_was_edited_and_nothing_else(folder):
    before = contents(folder)
    draft = Draft.open(folder)
    draft.set_cells("courses", [(0, "height_m", "1.8"), (1, "height_m", "2.0")])
    assert [path.name for path in draft.save()] == ["courses.csv"]
    after = contents(folder)
    assert {name for name in after if after[name] != before[name]} == {"courses.csv"}
    assert np.allclose([one.height_m for one in tankcal.load(folder).courses][:2], [1.8, 2.0])
    assert not draft.is_changed
    assert draft.save() == []


def test_a_draft_goes_on_after_saving(folder):
    draft = Draft.open(folder)
    draft.insert_rows("courses", 0)
    draft.set_cells("courses", [(0, "course", "9")])
    draft.save()
    draft.undo()
    draft.undo()
    draft.save()
    assert tankcal.load(folder).courses[0].height_m == 1.9


def test_separator_and_decimal_of_the_job_stay(tmp_path):
    folder = write_job(tmp_path / "job", rings=2)
    settings = (folder / "job.toml").read_text()
    (folder / "job.toml").write_text(settings + '\n[csv]\nseparator = ";"\ndecimal = ","\n')
    for path in folder.glob("*.csv"):
        path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    draft = Draft.open(folder)
    assert draft.check().is_valid
    draft.set_cells("courses", [(0, "height_m", "1,95")])
    draft.save()
    assert ";1,95;" in (folder / "courses.csv").read_text()
    with pytest.raises(InputError, match="edit the file itself"):
        draft.set_value("job", "csv", "decimal", ".")


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16", "utf-8-sig"])
def test_an_edited_table_is_saved_in_utf_8_with_its_letters(folder, encoding):
    path = folder / "points.csv"
    text = "# medição\n" + path.read_text()
    path.write_bytes(text.encode(encoding))
    draft = Draft.open(folder)
    first = draft.tables["points"].rows[0].cells[0]
    draft.set_cells("points", [(0, "point", "A-ção")])
    draft.save()
    expected = text.replace(f"\n{first},", "\nA-ção,", 1)
    assert path.read_bytes() == expected.encode("utf-8-sig")


def test_nothing_is_written_over_the_work_of_another(folder):
    draft = Draft.open(folder)
    draft.set_cells("courses", [(0, "height_m", "1.8")])
    draft.set_value("job", "tank", "owner", "Somebody")
    other = (folder / "courses.csv").read_text() + "# looked at by another\n"
    (folder / "courses.csv").write_text(other)
    before = contents(folder)
    with pytest.raises(InputError, match="another program") as error:
        draft.save()
    assert [one.file for one in error.value.problems] == ["courses.csv"]
    assert contents(folder) == before


def test_saving_is_all_or_nothing(folder, monkeypatch):
    draft = Draft.open(folder)
    draft.set_cells("courses", [(0, "height_m", "1.8")])
    draft.set_value("job", "tank", "owner", "Somebody")
    before, calls = contents(folder), []
    replace = Path.replace

    def fails_at_second(path, target):
        calls.append(target)
        if len(calls) == 2:
            raise OSError(28, "No space left on device")
        return replace(path, target)

    monkeypatch.setattr(drafts.Path, "replace", fails_at_second)
    with pytest.raises(OSError, match="No space left"):
        draft.save()
    assert contents(folder) == before
    assert draft.is_changed


def test_permissions_and_links_stay(folder):
    kept = folder / "kept" / "courses.csv"
    kept.parent.mkdir()
    shutil.move(folder / "courses.csv", kept)
    kept.chmod(0o640)
    (folder / "courses.csv").symlink_to(kept)
    draft = Draft.open(folder)
    draft.set_cells("courses", [(0, "height_m", "1.8")])
    draft.save()
    assert (folder / "courses.csv").is_symlink()
    assert os.stat(kept).st_mode & 0o777 == 0o640
    assert "1.8" in kept.read_text()


def test_a_table_is_added(folder):
    draft = Draft.open(folder)
    draft.add_table("deadwood")
    draft.insert_rows("deadwood", 0)
    row = {"name": "coil", "bottom_m": "0.5", "top_m": "1.0", "volume_m3": "-0.2"}
    draft.set_cells("deadwood", [(0, name, text) for name, text in row.items()])
    assert draft.check().is_valid
    draft.save()
    (found,) = tankcal.load(folder).deadwood
    assert (found.name, found.volume_m3) == ("coil", -0.2)


def test_a_row_that_becomes_a_comment_is_told(folder):
    draft = Draft.open(folder)
    draft.set_cells("points", [(0, "point", "#1")])
    check = draft.check()
    assert (0, "point") in check.marks["points"]
    assert len(check.job.points.names) == len(draft.tables["points"].rows) - 1


def test_an_entry_that_may_be_two_numbers_stops_everything(folder):
    draft = Draft.open(folder)
    draft.set_cells("points", [(0, "x_m", AmbiguousNumber("1.234"))])
    draft.set_value("job", "tank", "nominal_height_m", AmbiguousNumber("9.500"))
    check = draft.check()
    assert {(one.file, one.column) for one in check.problems} == {
        ("points.csv", "x_m"), ("job.toml", "tank.nominal_height_m"),
    }  # fmt: skip
    with pytest.raises(InputError):
        draft.save()


@pytest.mark.slow(after=10)
@pytest.mark.parametrize(
    "spoil",
    [
        lambda f: (f / "job.toml").write_text("[tank\n"),
        lambda f: (f / "job.toml").write_bytes(b"\xff\xfe\0"),
        lambda f: (f / "points.csv").write_bytes(b"point,x_m\n\xff"),
        lambda f: (f / "points.csv").write_text(""),
        lambda f: (f / "points.csv").write_text("point;x_m\n1;2\n"),
        lambda f: (f / "points.csv").write_text('point,x_m\n"1,2\n'),
        lambda f: (f / "strange.csv").write_text("a"),
        lambda f: (f / "job.toml").write_text("tank = 1\n"),
        lambda f: (f / "job.toml").write_text('[csv]\nseparator = ","\ndecimal = ","\n'),
        lambda f: (f / "instruments.toml").write_text("instruments = 3\n"),
        lambda f: (f / "courses.csv").unlink(),
    ],
)
def test_spoilt_files_are_told_as_the_loader_tells_them(folder, spoil):
    spoil(folder)
    with pytest.raises(InputError) as error:
        tankcal.load(folder)
    check = Draft.open(folder).check()
    assert check.problems == error.value.problems


@pytest.mark.parametrize("name", ["nothing", "empty", "text.txt", "new.xlsx"])
def test_no_job_is_told_in_one_line(tmp_path, name):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("a")
    with pytest.raises(InputError, match="tankcal new"):
        Draft.open(tmp_path / name)


# ---- workbooks


def test_a_workbook_is_the_same_job(book, folder):
    draft, other = Draft.open(book), Draft.open(folder)
    assert draft.edited_files()[0] == {}
    assert set(draft.tables) == set(other.tables)
    cells = [row.cells for row in draft.tables["courses"].rows]
    assert [cells[0][1], len(cells)] == ["1.9", 5]


@pytest.mark.slow
def test_a_cell_of_a_workbook_is_saved_and_the_rest_stays(book):
    before = load_workbook(book)
    before.create_sheet("# notes")["B2"] = "=1+1"
    before["courses"]["B2"].number_format = "0.000"
    before.save(book)
    draft = Draft.open(book)
    draft.set_cells("courses", [(0, "height_m", "1.8"), (1, "height_m", "abc")])
    draft.set_value("job", "tank", "owner", "Somebody")
    check = draft.check()
    assert check.marks["courses"][1, "height_m"][0].level == BAD
    draft.set_cells("courses", [(1, "height_m", "2.0")])
    assert draft.save() == [book]
    job = tankcal.load(book)
    assert [one.height_m for one in job.courses][:3] == [1.8, 2.0, 1.9]
    assert job.tank.details["owner"] == "Somebody"
    after = load_workbook(book)
    assert after["# notes"]["B2"].value == "=1+1"
    assert after["courses"]["B2"].number_format == "0.000"
    for sheet in before.worksheets:
        differing = [
            cell.coordinate for row in sheet for cell in row
            if after[sheet.title][cell.coordinate].value != cell.value
        ]  # fmt: skip
        assert len(differing) == {"courses": 2, "job": 0}.get(sheet.title, 0)


@pytest.mark.slow
def test_rows_of_a_workbook_come_and_go(book):
    count = len(tankcal.load(book).points.names)
    draft = Draft.open(book)
    draft.remove_rows("points", [0, 5])
    draft.insert_rows("points", 3)
    first = draft.tables["points"].rows[0].cells
    named = dict(zip(draft.tables["points"].headings, first, strict=True)) | {"point": "NEW"}
    named["z_m"] = "9.1"
    draft.set_cells("points", [(3, name, text) for name, text in named.items()])
    assert draft.check().is_valid
    draft.save()
    names = tankcal.load(book).points.names
    assert len(names) == count - 1
    assert names[3] == "NEW"


def test_a_text_like_a_formula_stays_a_text(book):
    draft = Draft.open(book)
    draft.set_value("job", "tank", "owner", "=1+1")
    draft.save()
    assert tankcal.load(book).tank.details["owner"] == "=1+1"


def test_a_workbook_with_formulas_is_only_looked_at(book):
    workbook = load_workbook(book)
    workbook["courses"]["B2"] = "=1+0.9"
    workbook.save(book)
    draft = Draft.open(book)
    with pytest.raises(InputError, match="formulas"):
        draft.set_cells("points", [(0, "x_m", "1")])
    assert draft.tables["points"].rows


def test_a_sheet_is_added(book):
    draft = Draft.open(book)
    draft.add_table("stated")
    draft.insert_rows("stated", 0)
    heading = draft.tables["stated"].headings[0]
    draft.set_cells("stated", [(0, heading, "2.5")])
    draft.save()
    assert "stated" in load_workbook(book).sheetnames


def test_a_damaged_workbook_is_told(tmp_path):
    path = tmp_path / "job.xlsx"
    path.write_bytes(b"PK nothing")
    with pytest.raises(InputError) as error:
        tankcal.load(path)
    assert Draft.open(path).check().problems == error.value.problems


def test_pasted_cells_are_checked_without_parsing_the_settings_for_each(folder, monkeypatch):
    """5000 pasted rows took five seconds when job.toml was parsed for each cell."""
    draft, parsed = Draft.open(folder), []
    loads = keys.tomllib.loads
    monkeypatch.setattr(keys.tomllib, "loads", lambda text: parsed.append(text) or loads(text))
    places = [(row, heading) for row in range(10) for heading in ("x_m", "y_m", "z_m")]
    draft.set_cells("points", [(3, "y_m", "1x")])
    marks = draft.quick_check("points", places)
    assert list(marks) == [(3, "y_m")]
    assert len(parsed) <= 1
