"""Our own answers, and the papers of the scores."""

import json
import re

import pytest
from packages import answers_of, write_answers, written_package

from tankcal.cli import main
from tankcal.errors import SolutionError
from tankcal.products.intercomparison.answers import answer_package
from tankcal.tank.capacity import Quantity
from tankcal.text.shipped import LANGUAGES


class Table:
    """A table of 10 m3 a metre."""

    def at(self, height):
        return Quantity(10.0 * height, 0.05, float("inf"), 2.0, 0.1)


def test_a_survey_without_a_solution_is_left_out_and_told(tmp_path):
    package, _, manifest, _ = written_package(tmp_path)

    def run(folder):
        if folder.parent.name == "T02" and folder.name == "points":
            raise SolutionError("no sound solution")
        return Table()

    saved, told = answer_package(package, manifest, run=run)
    assert [str(one) for one in told] == ["T02/points: no sound solution"]
    assert [(one.tank, one.method) for one in saved.answers] == [
        ("T01", "points"), ("T01", "total-station"), ("T02", "total-station"),
    ]  # fmt: skip
    assert saved.answers[0].volume_m3[0] == 10.0 * manifest["tanks"][0]["heights_m"][0]
    assert set(saved.answers[0].k) == {2.0}


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_papers_of_several_participants(tmp_path, capsys, language):
    """Page, workbook and data, in each language; the same again, and nothing foreign replaced."""
    import openpyxl

    package, truth, manifest, content = written_package(tmp_path)
    folders = []
    for name, factor, U in (("a", 1.0002, 5e-4), ("b", 0.9993, 5e-4), ("c", 1.0001, None)):
        saved = answers_of(manifest, content, factor=factor, U_part=U)
        folders.append(str(write_answers(tmp_path / name, saved)))
    out = tmp_path / "scores"
    command = ["intercomparison", "score", *folders, "--truth", str(truth), "--package",
               str(package), "--out", str(out), "--language", language, "--quiet"]  # fmt: skip
    assert main(command) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len([one for one in lines if "Lab" in one]) == 9
    page = (out / "scores.html").read_text("utf-8")
    assert page.count("data:image/svg+xml") == 3
    assert not re.search(r"\{[a-z_]+\}", re.sub(r"<(style|script).*?</\1>", "", page, flags=re.S))
    scores = json.loads((out / "scores.json").read_text("utf-8"))
    within = [one["tops_within"] for one in scores["methods"] if one["method"] == "*"]
    assert within == [4, 0, 0]
    book = openpyxl.load_workbook(out / "scores.xlsx")
    assert len(book.sheetnames) == 4
    rows = book.worksheets[2].max_row
    assert rows >= 3 * 2 * sum(len(one["heights_m"]) for one in content["tanks"])
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert main(command) == 0
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    (out / "mine.txt").write_text("x", "utf-8")
    assert main(command) == 2
    assert {"mine.txt", *before} == {path.name for path in out.iterdir()}


@pytest.mark.slow
def test_from_package_to_scores(tmp_path, capsys):
    """The commands as the docs print them, by two quick methods."""
    made = str(tmp_path / "made")
    command = ["intercomparison", "make", made, "--tanks", "1", "--methods", "liquid", "tape"]
    assert main([*command, "--seed", "3", "--quiet"]) == 0
    assert main([*command, "--quiet"]) == 2  # it is there already
    package, answers, out = f"{made}/practice", str(tmp_path / "answers"), str(tmp_path / "out")
    assert main(["intercomparison", "answer", package, "--out", answers, "--quiet"]) == 0
    score = ["intercomparison", "score", answers, "--truth", package, "--out", out, "--quiet"]
    assert main(score) == 0
    assert main([*score[:-3], "--truth", f"{made}/sealed", "--quiet"]) == 2
    capsys.readouterr()
    assert main([*score[:-3], "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one["method"] for one in found["methods"]] == ["tape", "liquid", "*"]
    assert all(abs(one["top_error_ppm"]) < 3000 for one in found["tables"])
    assert all(one["missing"] == 0 for one in found["tables"])


@pytest.mark.parametrize(
    "options",
    [
        ["--tanks", "0"], ["--tanks", "101"], ["--tanks", "x"], ["--practice", "-1"],
        ["--secret", "abc"], ["--seed", "1.5"], ["--methods", "sonar"],
    ],
)  # fmt: skip
def test_bad_options_are_refused(tmp_path, capsys, options):
    with pytest.raises(SystemExit) as stop:
        main(["intercomparison", "make", str(tmp_path / "x"), *options])
    assert stop.value.code == 2
    assert not (tmp_path / "x").exists()
