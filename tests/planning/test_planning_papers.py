"""The papers of a plan: where things are, what is said of them, in every language."""

import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace

import numpy as np
import openpyxl
import pytest
from invented_language import bracketed, without_brackets
from plan_folders import PLAN, changed_plan, with_setups

import tankcal
from tankcal.geometry.rotations import rotation_of_view, view_of_rotation
from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import greedy, what_helps
from tankcal.planning.places import place_of, reference_rad
from tankcal.planning.simulations import simulate
from tankcal.report import planning as planning_papers
from tankcal.report.numbers import UNITS
from tankcal.report.pdf import pdf
from tankcal.report.planning import files, rows
from tankcal.report.planning import pages as papers
from tankcal.report.planning.pages import PlanPaper, outlook, sheets
from tankcal.report.planning.rows import field_tables
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words

NO_TEXT = {"kind", "align", "language", "decimal_mark", "part", "svg", "date"}
SVG_TEXT = "{http://www.w3.org/2000/svg}text"
OTHERS = [language for language in LANGUAGES if language != DEFAULT]
PROGRAM = {
    "tankcal",
    "run",
    "job",
    "xlsx",
    "csv",
    "toml",
    "points",
    "plan",
    "pattern",
    "form",
    "mm",
}


@pytest.fixture(scope="module")
def prediction():
    return predict(load_plan(PLAN))


@pytest.fixture(scope="module")
def tried(prediction):
    """Every change of the example, the best tape to add, two simulated surveys."""
    effects = what_helps(prediction.plan, before=prediction)
    design = greedy(prediction.plan, steps=1, items=("tape",))
    simulated = simulate(prediction, 2, blunders=0.001)
    return {"effects": effects, "design": design, "simulated": simulated}


@pytest.fixture(scope="module")
def poor(tmp_path_factory):
    """A plan that sees too little: a wall stands in the way; its form is not stated."""
    hidden = (
        'form_mm = 10.0 ', '# '), ("[limits]", (
        '[[obstacles]]\nname = "bund"\nkind = "box"\nfrom_m = [10.0, 24.0, 8.0]\n'
        "to_m = [22.0, 24.2, 14.0]\n\n[limits]"
    ))  # fmt: skip
    return predict(load_plan(changed_plan(tmp_path_factory.mktemp("poor"), *hidden)))


# ---- where things are


def test_the_place_of_a_target_leads_back_to_it(prediction):
    """Second method: weld, arc and heights of the field sheet, walked along the wall."""
    plan = prediction.plan
    shell = plan.shell
    below = dict(zip("12345", np.cumsum([0.0] + [1.9] * 4), strict=True))
    plates = {one.name: one.thickness_m + one.paint_m for one in plan.job.courses}
    for row, xyz in zip(rows.targets(prediction), plan.targets.xyz_m, strict=True):
        azimuth = row["arc_m"] / shell.radius_m  # the reference weld is north of the axis
        radius = shell.radius_m + plates[row["course"]] - plates["1"] + 0.001
        east, north = radius * np.array([np.sin(azimuth), np.cos(azimuth)])
        assert place_of(plan, xyz).off_m == pytest.approx(0.001, abs=1e-9)
        z = 10.0 + below[row["course"]] + row["height_in_course_m"]
        assert xyz == pytest.approx([*(shell.axis_m + [east, north]), z], abs=1e-9)
        assert row["height_m"] == pytest.approx(z - 10.0)


def test_places_by_closed_form(prediction):
    """Closed form: 2 m off the wall, east of the axis, 1 m above the bottom; from within, too."""
    plan, radius = prediction.plan, prediction.plan.shell.radius_m
    east = np.array([*(plan.shell.axis_m + [radius + 2.0, 0.0]), 11.0])
    place = place_of(plan, east)
    assert (place.arc_m, place.off_m) == pytest.approx((np.pi / 2 * radius, 2.0))
    assert (place.azimuth_rad, place.height_m) == pytest.approx((np.pi / 2, 1.0))
    inside = replace(plan, shell=replace(plan.shell, is_outside=False))
    assert place_of(inside, east).off_m == pytest.approx(-2.0)
    assert reference_rad(plan) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("angles", [(0.3, 0.1, -2.0), (-3.0, -0.7, 0.0), (1.0, 0.0, np.pi / 2)])
def test_where_a_camera_points_to(angles):
    """Property: pointing is the inverse of looking."""
    assert view_of_rotation(rotation_of_view(*angles)) == pytest.approx(np.array(angles), abs=1e-12)


@pytest.mark.slow
def test_turns_and_rolls_are_those_of_the_plan(tmp_path):
    pairs = ("rolls_deg = [0]", "rolls_deg = [0, 90]\ndirections_deg = [-10, 10]")
    found = predict(load_plan(changed_plan(tmp_path, pairs)))
    listed = rows.photographs(found)[:4]
    turns = [(np.degrees(one["turn_rad"]), np.degrees(one["roll_rad"])) for one in listed]
    expected = [(-10, 0), (-10, 90), (10, 0), (10, 90)]
    assert np.array(turns) == pytest.approx(np.array(expected, dtype=float), abs=1e-9)
    (first, *_) = rows.stations(found.plan)
    assert (first["photographs"], first["rolls"]) == (4, "0°, 90°")


def test_kinds_and_lengths_of_tapes(prediction):
    listed = {one["tape"]: one for one in rows.ties(prediction)}
    assert (listed["V1"]["what"], listed["H1"]["what"]) == ("upright", "level")
    assert listed["V1"]["expected_m"] == pytest.approx(9.0)
    assert listed["H1"]["expected_m"] == pytest.approx(6.9)


@pytest.mark.slow
def test_a_field_sheet_of_set_ups(tmp_path):
    found = predict(load_plan(with_setups(tmp_path)))
    tables = field_tables(found)
    assert {"setups", "control"} <= tables.keys()
    assert not {"stations", "photographs", "ties", "cameras"} & tables.keys()
    (first, *_) = tables["setups"][0]
    assert first["sights"] == ["T1-6", "T1-2"]
    assert first["off_m"] == pytest.approx(8.0)
    text = " ".join(texts_of(sheets(PlanPaper(found))))
    assert "Set-ups sighted" in text


@pytest.mark.slow
def test_lines_side_by_side_are_read_down(prediction):
    (block,) = [one.data for one in sheets(PlanPaper(prediction))
                if one.data.get("caption") == "Lines of targets"]  # fmt: skip
    assert [row[0] for row in block["rows"]] == ["2", "3", "4", "5", "6", "7"]
    assert block["rows"][0][::2] == ["2", "8", "14", "20"]
    assert len(block["align"]) == len(block["columns"]) == 8
    assert block["rows"][-1][-2:] == ["1", "40.041"]


# ---- what is said


@pytest.mark.slow
def test_weak_and_lost_points_are_reported(poor):
    assert poor.undetermined
    assert poor.weak
    text = " ".join(texts_of(outlook(PlanPaper(poor))))
    assert "rays only" in text
    assert "a single ray" in text or "not visible" in text


@pytest.mark.slow
def test_limits_are_judged_in_words(prediction):
    def told(**limits):
        plan = replace(prediction.plan, limits=replace(prediction.plan.limits, **limits))
        return " ".join(texts_of(outlook(PlanPaper(replace(prediction, plan=plan)))))

    assert "The limit of 0.200 % for the full tank is met." in told().replace("\xa0", " ")
    assert "for the full tank is NOT met" in told(relative_u=1e-5)
    assert "for the worst delivery is met" in told(quantity="delivery")
    assert "for the worst delivery is NOT met" in told(quantity="delivery", relative_u=1e-5)
    assert "The limit of" not in told(relative_u=None)


# ---- in every language


def texts_of(found):
    """Every text of blocks that a reader sees, those of figures too."""
    return [text for block in found for text in _texts(block.data)]


def _texts(data):
    texts = list(_in({key: value for key, value in data.items() if key not in NO_TEXT}))
    if data.get("svg"):
        texts += ["".join(one.itertext()) for one in ET.fromstring(data["svg"]).iter(SVG_TEXT)]
    return texts


def _in(value):
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from _in(one)
    elif isinstance(value, str):
        yield value


def letters_in(texts):
    """Runs of two letters or more."""
    parts = "".join(c if c.isalpha() else " " for text in texts for c in f"{text} ").split()
    return {part for part in parts if len(part) > 1}


def data_of(found):
    """Letters of what the plan itself names."""
    plan = found.plan
    names = [*plan.points, *plan.stations, *(one.name for one in plan.photos), plan.job.tank.id]
    names += [one.name for one in (*plan.ties, *plan.obstacles, *plan.job.measurements.cameras)
              if hasattr(one, "name")]  # fmt: skip
    names += [str(text) for one in plan.job.measurements.instruments for text in
              (one.name, *one.details.values())]  # fmt: skip
    names += [one.camera.name for one in plan.job.measurements.cameras]
    names.append(tankcal.__version__)
    return letters_in(names) | letters_in(unit.symbol for unit in UNITS.values()) | PROGRAM


def papers_of(found, language=None, **more):
    paper = PlanPaper(found, language, **more)
    return texts_of(sheets(paper)) + texts_of(outlook(paper))


def book_of(found, path, language=None):
    files.write_sheets(PlanPaper(found, language), path)
    book = openpyxl.load_workbook(path)
    return [str(cell.value) for sheet in book for row in sheet for cell in row if cell.value] + [
        *book.sheetnames, *(book[name].oddFooter.right.text for name in book.sheetnames)
    ]  # fmt: skip


@pytest.mark.slow
def test_every_text_is_of_the_words(prediction, tried, poor, tmp_path, monkeypatch):
    english = load_words()
    words = bracketed(english) | {"language": english["language"]}
    monkeypatch.setattr(papers, "load_words", lambda _: dict(words))
    months = letters_in(english["language"]["dates"].values())
    for found, more in ((prediction, tried), (poor, {})):
        of_codes = letters_in([*map(str, found.warnings), found.datum.words])
        shown = papers_of(found, **more) + book_of(found, tmp_path / "x.xlsx")
        outside = letters_in(map(without_brackets, shown))
        assert not outside - data_of(found) - of_codes - months


@pytest.mark.slow
@pytest.mark.parametrize(
    "language", [OTHERS[0], *(pytest.param(one, marks=pytest.mark.study) for one in OTHERS[1:])]
)
def test_no_word_of_english_is_left(prediction, tried, poor, language, tmp_path):
    own = letters_in(_in(load_words(language)))
    for found, more in ((prediction, tried), (poor, {})):
        english = letters_in(_in(load_words())) - own - data_of(found)
        shown = papers_of(found, language, **more) + book_of(found, tmp_path / "x.xlsx", language)
        assert not letters_in(shown) & english


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_papers_are_set(poor, language, tmp_path):
    """The page is set in each language, and the same plan gives the same bytes."""
    paper = PlanPaper(poor, language)
    data = [block.data for block in sheets(paper)]
    first = pdf(data, tmp_path)
    assert first.startswith(b"%PDF")
    assert pdf([block.data for block in sheets(PlanPaper(poor, language))], tmp_path) == first


@pytest.mark.slow
def test_the_same_plan_gives_the_same_files(prediction, tmp_path):
    found = [tmp_path / name for name in ("one", "two")]
    for folder in found:
        written = planning_papers.write(prediction, folder)
        assert {path.name for path in written} == {path.name for path in folder.iterdir()}
    for path in (path for path in found[0].rglob("*") if path.is_file()):
        assert path.read_bytes() == (found[1] / path.relative_to(found[0])).read_bytes(), path


@pytest.mark.slow
def test_the_workbook_has_the_targets_and_a_sketch(prediction, tmp_path):
    texts = book_of(prediction, tmp_path / "x.xlsx")
    assert {"24-5", "R1-11", "V4b", "Targets"} <= set(texts)
    sheet = openpyxl.load_workbook(tmp_path / "x.xlsx")["Targets"]
    row = next(row for row in sheet.iter_rows(values_only=True) if row[0] == "24-5")
    assert row[1:7] == pytest.approx((24, 5, 5, 0.95, 8.55, 38.337), abs=5e-4)
    with zipfile.ZipFile(tmp_path / "x.xlsx") as archive:
        pictures = [name for name in archive.namelist() if name.startswith("xl/media/")]
        assert len(pictures) == 2
        assert archive.read(pictures[0]).startswith(b"\x89PNG")
