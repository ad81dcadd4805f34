"""What `tankcal history` leaves behind: papers, page, workbook, CSV files, made again alike."""

import csv
import json
import shutil

import openpyxl
import pytest
from histories import HOSTILE, hostile, plain, single
from paper_pages import lone_headings, pages_of, sparse_pages

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.report.history import HistoryPaper, rebuild, write_history
from tankcal.report.history.pages import MOST_ROWS, limited_checks, pages
from tankcal.report.history.tables import check_rows, radius_rows, volume_rows
from tankcal.report.verification import verify
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words

KINDS = {"plain": plain, "single": single, "hostile": hostile}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """{kind: its folder}, each in another language."""
    folder = tmp_path_factory.mktemp("histories")
    for kind, language in zip(KINDS, LANGUAGES, strict=True):
        write_history(KINDS[kind](), folder / kind, language)
    return folder


@pytest.mark.parametrize("language", [one for one in LANGUAGES if one != DEFAULT])
def test_languages_have_the_same_words(language):
    def keys(words):
        return {k: keys(v) if isinstance(v, dict) else None for k, v in words.items()}

    assert keys(load_words(language)["history"]) == keys(load_words(DEFAULT)["history"])


def test_rows_are_by_dip_and_by_course():
    found = plain()
    rows = volume_rows(found)
    assert [one["certificate"] for one in rows[:5]] == [1, 2, 3, 4, 5]
    assert rows[0]["height_m"] == max(found["dips_m"])
    assert len(rows) == len(found["volumes"])
    assert len(check_rows(found)) == 4
    assert radius_rows(found) == []  # no course is known of bare tables


def test_only_dated_checks_with_a_limit_are_drawn():
    drawn = limited_checks(plain())
    assert {code: len(rows) for code, rows in drawn.items()} == {"plumbness_axis": 2}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_pages_are_filled(written, kind):
    shown = pages_of(written / kind / "history.pdf")
    language = dict(zip(KINDS, LANGUAGES, strict=True))[kind]
    headings = set(load_words(language)["history"]["headings"].values())
    assert 1 <= len(shown) <= 5
    assert sparse_pages(shown) == []
    assert lone_headings(shown, headings) == []


@pytest.mark.slow
def test_csv_files_are_what_was_saved(written):
    found = plain()
    with open(written / "plain" / "volumes.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(one["d_m3"]) for one in rows] == pytest.approx(
        [one["d_m3"] for one in volume_rows(found)], rel=1e-10
    )
    assert not (written / "single" / "changes.csv").exists()


@pytest.mark.slow
def test_a_workbook_has_every_row_as_numbers(written):
    book = openpyxl.load_workbook(written / "plain" / "history.xlsx")
    names = [load_words(LANGUAGES[0])["history"]["workbook"]["sheets"][one]
             for one in ("certificates", "volumes", "changes", "inspections", "origins",
                         "warnings")]  # fmt: skip
    assert book.sheetnames == names
    _, *rows = list(book[names[1]].iter_rows(min_row=4, values_only=True))
    assert [row[3] for row in rows] == pytest.approx(
        [one["volume_m3"] for one in volume_rows(plain())], rel=1e-13
    )


@pytest.mark.slow
def test_no_text_of_a_user_is_a_formula_or_a_script(written):
    cells = [
        cell
        for sheet in openpyxl.load_workbook(written / "hostile" / "history.xlsx")
        for row in sheet
        for cell in row
    ]
    assert [cell.value for cell in cells if cell.data_type == "f"] == []
    assert any(str(cell.value).startswith(HOSTILE[:12]) for cell in cells)
    page = (written / "hostile" / "history.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page


@pytest.mark.slow
def test_papers_are_made_again_from_the_file_alone(written, tmp_path):
    """The same bytes in the same language; `tankcal verify` says so, and sees a change."""
    folder = shutil.copytree(written / "plain", tmp_path / "h")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert main(["report", str(folder), "--language", LANGUAGES[0], "--quiet"]) == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    found = verify(folder)
    assert (found.problems, found.papers_again) == ([], True)
    (folder / "volumes.csv").write_bytes(before["volumes.csv"] + b"\n")
    assert [one.expected.code for one in verify(folder).problems] == ["verify_other_paper"]


@pytest.mark.slow
def test_a_long_history_has_its_first_rows_in_the_pdf():
    found = plain()
    found["volumes"] = 20 * found["volumes"]
    said = [block.data for block in pages(HistoryPaper(found))]
    texts = [one["text"] for one in said if one["kind"] == "paragraph"]
    assert any(f"{MOST_ROWS} of 500 rows" in one for one in texts)


def test_a_folder_of_others_stays(tmp_path):
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="mine"):
        write_history(plain(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    ("text", "said"),
    [("{", "cannot be read"), ("[]", "format"), ('{"format": "tankcal-history/1"}', "without")],
)
def test_what_is_no_history_is_refused(tmp_path, text, said):
    path = tmp_path / "history.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        rebuild(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("change", [{"certificates": []}, {"tank": 7}])
def test_a_damaged_history_is_told_in_one_line(tmp_path, change):
    path = tmp_path / "history.json"
    path.write_text(json.dumps(plain() | change), encoding="utf-8")
    with pytest.raises(InputError) as told:
        rebuild(path, tmp_path / "out")
    assert len(told.value.problems) == 1
    assert [one.name for one in tmp_path.iterdir()] == ["history.json"]
