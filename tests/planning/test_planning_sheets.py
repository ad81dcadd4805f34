"""What the papers of a plan must say to whoever goes there, and to whoever decides."""

import csv
from dataclasses import replace

import numpy as np
import openpyxl
import pytest
from matplotlib.colors import to_hex
from plan_folders import PLAN, changed_plan, with_setups

from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import what_helps
from tankcal.planning.model import Pillar, Tie
from tankcal.planning.places import full_turn, place_of
from tankcal.report.planning import figures, files, rows
from tankcal.report.planning import figures as sketches
from tankcal.report.planning.figures import stands
from tankcal.report.planning.pages import PlanPaper, outlook, sheets
from tankcal.report.plots.style import INK, RED

OBSTACLE = (
    '[[obstacles]]\nname = "bund"\nkind = "box"\nfrom_m = [10.0, 24.0, 8.0]\n'
    "to_m = [22.0, 24.2, 14.0]\n\n[limits]"
)


@pytest.fixture(scope="module")
def prediction():
    return predict(load_plan(PLAN))


@pytest.fixture(scope="module")
def hidden(tmp_path_factory):
    """The example behind a bund wall, with a plumb line between two of its targets."""
    folder = changed_plan(tmp_path_factory.mktemp("hidden"), ("[limits]", OBSTACLE))
    (folder / "plumb_lines.csv").write_text("from,to,s_mm\n3-1,3-5,2\n")
    return predict(load_plan(folder))


@pytest.fixture(scope="module")
def stationed(tmp_path_factory):
    return predict(load_plan(with_setups(tmp_path_factory.mktemp("setups"))))


@pytest.fixture(scope="module")
def effects(prediction):
    return what_helps(prediction.plan, before=prediction)


def texts_of(found):
    return " ".join(str(block.data) for block in found)


def labels_of(figure):
    (ax, *_) = figure.axes
    return {text.get_text() for text in ax.get_legend().get_texts()}


def names_in(figure):
    return {text.get_text().strip() for text in figure.axes[0].texts}


# ---- where things are


@pytest.mark.slow
def test_arc_is_zero_on_the_reference_weld(prediction):
    """Rounding just short of a full turn is none: 0.000 m, not once around."""
    assert float(full_turn(-1e-17)) == 0.0
    assert float(full_turn(-0.25)) == pytest.approx(2 * np.pi - 0.25)
    plan = prediction.plan
    assert rows.stations(plan)[0]["arc_m"] == pytest.approx(0.0, abs=1e-6)
    north = np.array([*(plan.shell.axis_m + [-1e-15, plan.shell.radius_m]), 11.0])
    assert place_of(plan, north).arc_m == 0.0


@pytest.mark.slow
def test_unseen_targets_are_marked(hidden):
    """In lists, sheets, sketch and counts: a target that the prediction does not determine."""
    lost = {one.name for one in hidden.undetermined}
    marked = {one["point"] for one in rows.targets(hidden) if one["done"] == "unseen"}
    assert marked == lost & set(hidden.plan.targets.names) != set()
    ties = {one["tape"] for one in rows.ties(hidden) if one["value"] == "unseen_end"}
    assert ties == rows.lost_ties(hidden) != set()
    paper = PlanPaper(hidden)
    text = texts_of(sheets(paper))
    assert "Targets not visible" in text
    assert "Without effect, because an end is not visible" in text
    assert "end not visible" in text
    assert "not visible" in labels_of(sketches.wall(paper))


@pytest.mark.slow
def test_where_all_is_seen_nothing_is_said_of_it(prediction):
    assert "not visible" not in texts_of(sheets(PlanPaper(prediction)))


def test_only_set_ups_that_can_be_seen_are_to_be_sighted(stationed):
    seen = stationed.visibility
    on_setup = seen.on_setup.copy()
    on_setup[0, seen.points.index("T1-2")] = False
    found = rows.setups(replace(stationed, visibility=replace(seen, on_setup=on_setup)))
    assert found[0]["sights"] == ["T1-6"]


@pytest.mark.slow
def test_one_ray_is_enough_from_a_set_up(stationed, prediction):
    """Bars are red for want of rays where photographs are taken, not where set-ups measure."""

    def colours(found, fewest):
        limits = replace(found.plan.limits, rays=fewest)
        found = replace(found, plan=replace(found.plan, limits=limits))
        bars = figures.rays(PlanPaper(found)).axes[0].patches
        return {to_hex(one.get_facecolor()) for one in bars[1:]}

    assert colours(stationed, 50) == {INK}
    assert colours(prediction, 50) == {RED}


# ---- tapes, plumb lines, photographs


@pytest.mark.slow
def test_a_plumb_line_is_no_tape(hidden):
    (line,) = (one for one in rows.ties(hidden) if one["what"] == "plumb_lines")
    assert line["value"] in ("on_one_line", "unseen_end")
    assert line["temperature"] == ""
    paper = PlanPaper(hidden)
    assert "mark both its targets on a freely hanging line" in texts_of(sheets(paper))
    tie = Tie("1-1-1-5", "plumb_lines", "1-1", "1-5", 0.002)
    plan = replace(hidden.plan, ties=(tie,))
    paper = PlanPaper(replace(hidden, plan=plan))
    found = {paper.describe_change(one.change) for one in _changes(plan, "tape")}
    assert {"without plumb line 1-1-1-5", "plumb line 1-1-1-5 hung twice as often"} <= found
    assert "plumb lines" in labels_of(sketches.wall(paper))


def _changes(plan, item):
    from tankcal.planning.improvements import Effect, changes_of

    return [Effect(one, 0.0, 0.0, 0.0, 0) for one in changes_of(plan, items=(item,))]


@pytest.mark.slow
def test_field_readings_have_a_column(prediction):
    text = texts_of(sheets(PlanPaper(prediction)))
    assert "Temp. °C" in text
    assert "'heading': 'File'" in text
    assert "these names are used in image_points.csv" in text


@pytest.mark.slow
def test_an_accuracy_that_is_not_given_is_not_zero(prediction):
    (tape,) = rows.instruments(prediction.plan)
    assert tape["u_scale"] is None


@pytest.mark.slow
def test_headings_are_on_the_page_of_their_tables(prediction):
    data = [block.data for block in sheets(PlanPaper(prediction))]
    for number, one in enumerate(data):
        if one.get("text") in ("Tapes, heights and plumb lines", "Control points"):
            assert data[number + 1]["kind"] == "table"


# ---- sketches


@pytest.mark.slow
def test_the_sketch_of_the_stations_shows_all_of_a_neighbour(prediction):
    east = prediction.plan.shell.axis_m + [24.0, 0.0]
    plan = replace(prediction.plan, obstacles=(Pillar(east, 6.5, 10.0, 20.0, "TQ-2"),))
    figure = stands(PlanPaper(replace(prediction, plan=plan)))
    (left, right), (ax,) = figure.axes[0].get_xlim(), figure.axes
    assert left < east[0] - 6.5 < east[0] + 6.5 < right
    assert {"TQ-2", "V1", "H1", "M1", "10\N{NO-BREAK SPACE}m", "R1-1"} <= names_in(figure)
    assert labels_of(figure) == {
        *("reference weld", "tapes", "marks", "directions of photographs", "photo stations"),
    }
    assert ax.get_aspect() == 1.0


@pytest.mark.slow
def test_the_unrolled_wall_shows_welds_and_the_names_of_tapes(prediction):
    figure = sketches.wall(PlanPaper(prediction))
    assert {"V1", "H1", "M1"} <= names_in(figure)
    assert {"reference weld", "other vertical welds", "tapes", "marks"} <= labels_of(figure)


# ---- the prediction


@pytest.mark.slow
def test_additions_have_a_place(prediction, effects, tmp_path):
    placed = {"photo_station", "tape", "control_point"}
    for one in effects:
        has_place = one.change.action == "add" and one.change.item in placed
        assert bool(rows.place_of_change(one.change)) == has_place
    tape = next(one.change for one in effects if one.change.name == "N-V1")
    place = rows.place_of_change(tape)
    east_of_weld = np.radians(22.5) * prediction.plan.shell.radius_m
    assert place["arc_m"] == pytest.approx(east_of_weld, abs=1e-9)
    assert place["height_m"] == pytest.approx(0.05 * 9.5)
    paper = PlanPaper(prediction, effects=effects)
    assert paper.describe_change(tape) == "additional vertical tape of 8.6\N{NO-BREAK SPACE}m, N-V1"
    files.write_files(paper, tmp_path, [])
    with open(tmp_path / "changes.csv", encoding="utf-8") as file:
        listed = {row["name"]: row for row in csv.DictReader(file) if row["action"] == "add"}
    assert float(listed["N-V1"]["arc_m"]) == pytest.approx(east_of_weld, abs=1e-3)


@pytest.mark.slow
def test_spared_items_are_listed_with_helpful_ones(prediction, effects):
    drop, add = (
        next(one for one in effects if one.change.action == action) for action in ("drop", "add")
    )
    needed = replace(drop, why="rank defect 1: not determined by the observations")
    idle = replace(add, why="plan.toml, row 48, photo_rings[1]: photograph N-R1-1 sees nothing")
    paper = PlanPaper(prediction, effects=(*effects, needed, idle))
    tables = {one.data.get("caption"): one.data for one in outlook(paper)}
    drops = [one for one in effects if one.change.action == "drop"]
    assert len(tables["Effect of omissions"]["rows"]) == min(30, len(drops))
    assert len(tables["Effect of additions"]["rows"]) == min(30, len(effects) - len(drops))
    text = texts_of(outlook(paper))
    dropped = paper.describe_change(drop.change)
    assert f"{dropped}: the remaining observations would not determine all unknowns" in text
    assert f"{paper.describe_change(add.change)}: see changes.csv" not in text
    assert "Weak or lost" in text


@pytest.mark.slow
def test_effect_of_uncontrolled_error(tmp_path):
    """Closed form: a scale that hangs on one tape of length L turns dL into 2 V dL / L."""
    rolled = ("rolls_deg = [0]", "rolls_deg = [0, 90]")
    folder = changed_plan(tmp_path, ('datum = "control"', 'datum = "inner"'), rolled)
    (folder / "control.csv").unlink()
    (folder / "plumb_lines.csv").write_text("from,to,s_mm\n3-1,3-5,2\n9-1,9-5,2\n15-1,15-5,2\n")
    plan = load_plan(folder)
    left = tuple(one for one in plan.ties if one.name == "H1" or one.table == "plumb_lines")
    found = predict(replace(plan, ties=left))
    (tape,) = (one for one in found.reliability if one.per_unit_of == ("H1a", "H1b"))
    volume = found.table.volume_m3[-1]
    assert tape.per_unit_m3 == pytest.approx(2 * volume / 6.9, rel=0.02)
    text = texts_of(outlook(PlanPaper(found)))
    assert "Uncontrolled readings" in text
    assert "'0.37', 'mm', 'H1a – H1b'" in text


# ---- the workbook


@pytest.mark.slow
def test_every_printed_page_has_its_headings(hidden, tmp_path):
    files.write_sheets(PlanPaper(hidden), tmp_path / "x.xlsx")
    book = openpyxl.load_workbook(tmp_path / "x.xlsx")
    assert book.sheetnames[:3] == ["Sketches", "Targets", "Marks"]
    for sheet in book.worksheets[1:-1]:
        assert sheet.print_title_rows == "$4:$4"
        assert len(sheet.tables) == 1
    headings = [cell.value for cell in book["Targets"][4]]
    assert headings[:3] == ["Point", "Line", "Row"]
    done = {row[0].value: row[-1].value for row in book["Targets"].iter_rows(min_row=5)}
    assert {name for name, mark in done.items() if mark == "not visible"} == {
        one["point"] for one in rows.targets(hidden) if one["done"]
    }
