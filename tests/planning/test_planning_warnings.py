"""What the run of a planned survey will warn of, told by its plan."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import EXAMPLE
from messages_told import lines
from plan_folders import changed_plan, with_setups

import tankcal
from tankcal.cli import main
from tankcal.errors import SolutionError
from tankcal.pipeline.checks.wall import OF_SCATTER
from tankcal.planning import load_plan, predict
from tankcal.planning.measurements import draw_measurements
from tankcal.planning.model import Box

PLAN = EXAMPLE.parent / "plan-silva"


@pytest.fixture(scope="module")
def prediction():
    return predict(load_plan(PLAN))


def codes(prediction):
    return [one.expected.code for one in prediction.warnings]


def told(folder):
    return lines(predict(load_plan(folder)).warnings)


@pytest.mark.slow
def test_plan_gives_the_warnings_of_its_run(prediction):
    """Second method: the chain itself, of the job with the values that the plan computes.

    The first warning is of the certificate, the others are of readings without errors.
    """
    measurements = draw_measurements(prediction.plan, prediction.measurements, prediction.network)
    job = replace(prediction.plan.job, measurements=measurements)
    of_run = [one.expected for one in tankcal.run(job, simulated=False).warnings]
    of_values = ("certificate_incomplete", "test_and_cause", *OF_SCATTER)
    of_run = [one for one in of_run if one.code not in of_values]
    assert [one.expected for one in prediction.warnings] == of_run
    assert codes(prediction) == ["undeclared"]


@pytest.mark.slow
def test_on_the_terminal_on_paper_and_in_plan_json(prediction, tmp_path, capsys):
    assert main(["plan", str(PLAN), "--quiet", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said == [f"tankcal: warning: {one}" for one in lines(prediction.warnings)]
    found = json.loads((tmp_path / "out" / "plan.json").read_text(encoding="utf-8"))["warnings"]
    assert [(one["code"], one["file"]) for one in found] == [("undeclared", "uncertainty.csv")]
    assert found[0]["text"] in said[0]


@pytest.mark.slow
def test_unseen_targets_and_undetermined_heights(tmp_path):
    """Four of six set-ups leave a part of the turn unseen; nothing measured holds the frame."""
    folder = with_setups(tmp_path)
    (folder / "control.csv").unlink()
    text = (folder / "plan.toml").read_text().replace('datum = "control"', 'datum = "inner"')
    (folder / "plan.toml").write_text(text)
    plan = load_plan(folder)
    once = tuple(replace(one, sights=(), sets=1) for one in plan.setups[:4])
    found = predict(replace(plan, setups=once))
    told = codes(found)
    assert {"plan_targets_lost", "heights_not_fixed", "plan_uncontrolled"} <= {*told}
    (gaps,) = (one for one in found.warnings if one.expected.code == "sections_gap")
    assert gaps.expected.values["all"] == len(found.sections)
    (lost,) = (one for one in found.warnings if one.expected.code == "plan_targets_lost")
    assert lost.expected.values["count"] == len(found.undetermined)
    (heights,) = (one for one in found.warnings if one.expected.code == "heights_not_fixed")
    assert (heights.file, heights.column) == ("plan.toml", "datum.bottom_z_m")


@pytest.mark.slow
def test_a_tape_with_a_hidden_end(prediction):
    """It counts for nothing, and says so."""
    plan = prediction.plan
    box = np.array([plan.extra["H1a"] - 0.03, plan.extra["H1a"] + 0.03])
    found = predict(replace(plan, obstacles=(Box(*box, "sign"),)))
    assert "one of their ends is not determined: 1 of 8" in lines(found.warnings)[0]
    assert "H1 (H1a)" in lines(found.warnings)[0]


@pytest.fixture(scope="module")
def afloat(prediction):
    """A plan without control: photographs rolled as well, two plumb lines, and no tape."""
    plan = prediction.plan
    settings = replace(plan.job.measurements.settings, datum="inner")
    turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rolled = tuple(
        replace(one, name=f"{one.name}r", rotation=turned @ one.rotation) for one in plan.photos
    )
    line = replace(plan.ties[0], name="plumb", table="plumb_lines", start="1-1", end="1-5")
    return replace(
        plan,
        job=replace(plan.job, measurements=replace(plan.job.measurements, settings=settings)),
        photos=(*plan.photos, *rolled),
        known=(),
        ties=(line, replace(line, start="9-1", end="9-5")),
    )


@pytest.mark.slow
def test_a_tape_that_nothing_controls(prediction, afloat):
    found = predict(replace(afloat, ties=(*afloat.ties, prediction.plan.ties[0])))
    (told,) = (one for one in lines(found.warnings) if "no other observation checks" in one)
    assert "the only value of distance (V1a-V1b)" in told


def test_ties_that_leave_the_scale_open(prediction, afloat):
    """The reason stands beside what is missing."""
    places = {"Aa": np.array([500.0, 0.0, 10.0]), "Ab": np.array([510.0, 0.0, 10.0])}
    lost = replace(prediction.plan.ties[0], name="A", start="Aa", end="Ab")
    plan = replace(afloat, ties=(*afloat.ties, lost), extra=afloat.extra | places)
    with pytest.raises(SolutionError, match=r"(?s)the scale is not determined.*A \(Aa, Ab\)"):
        predict(plan)


def test_units_that_are_mistaken(tmp_path):
    folder = changed_plan(
        tmp_path,
        ("image_sd_um = 5.0", "image_sd_um = 0.005"),
        ("relative_u = 0.002", "relative_u = 0.2"),
        ("s_mm = 1.0\ninstrument", "s_mm = 0.001\ninstrument"),
    )
    said = lines(load_plan(folder).warnings)
    assert "adjustment.image_sd_um: at most 0.005; expected micrometres" in said[0]
    assert sum("s_mm: at most 0.001; expected millimetres" in one for one in said) == 8
    assert "limits.relative_u: found 0.2, which is 20 % of the volume" in said[-1]


BOX = '[[obstacles]]\nname = "{}"\nkind = "box"\nfrom_m = {}\nto_m = {}\n\n'


def test_obstacles_that_are_nowhere_near(tmp_path):
    boxes = BOX.format("stairs", [22.6, 13.6, 10.0], [23.6, 14.8, 13.0])
    boxes += BOX.format("far", [9000.0, 0.0, 10.0], [9001.0, 1.0, 13.0])
    boxes += BOX.format("deep", [22.6, 13.6, 0.01], [23.6, 14.8, 0.013])
    (said,) = lines(load_plan(changed_plan(tmp_path, ("[limits]", f"{boxes}[limits]"))).warnings)
    assert "far (8977.7 m from the wall, z 10 to 13 m), deep (" in said
    assert "stairs" not in said


def test_tapes_that_can_hardly_hang_there(tmp_path):
    folder = changed_plan(
        tmp_path,
        ('name = "V1"\nkind = "vertical"\nazimuth_deg = 37\nlength_m = 9.0',
         'name = "V1"\nkind = "vertical"\nazimuth_deg = 37\nlength_m = 12.0'),
        ("azimuth_deg = 20\nlength_m = 6.9", "azimuth_deg = 20\nlength_m = 60"),
    )  # fmt: skip
    up, wide = lines(load_plan(folder).warnings)
    assert "tapes[1]: the ends of V1 are up to 0.1 m from the wall and +2.8 m from the top" in up
    assert "tapes[4]: the ends of H1 are up to 24" in wide


def test_set_ups_that_share_no_points(tmp_path):
    folder = with_setups(tmp_path)
    (folder / "control.csv").unlink()
    text = (folder / "plan.toml").read_text().replace('datum = "control"', 'datum = "inner"')
    (folder / "plan.toml").write_text(text)
    plan = load_plan(folder)
    alone = tuple(replace(one, sights=()) for one in plan.setups[::3])
    with pytest.raises(
        SolutionError, match="2 groups of set-ups are not connected to the others: T1-1"
    ):
        predict(replace(plan, setups=alone))


def test_missing_and_strange_camera_values_are_reported(tmp_path, capsys):
    folder = changed_plan(tmp_path)
    text = (folder / "cameras.toml").read_text()
    assert "c_mm = " in text
    changed = "\n".join(
        "c_mm = 0.1" if one.startswith("c_mm = ") else one for one in text.splitlines()
    )
    (folder / "cameras.toml").write_text(changed)
    assert main(["plan", str(folder), "--quiet"]) in (2, 3)
    assert "c_mm: found 0.1 with a format of" in capsys.readouterr().err


def test_rows_on_horizontal_welds(tmp_path):
    rows = "heights_m = [1.0, 1.9, 2.8, 4.0, 5.0, 7.0, 9.0] #"
    (said,) = lines(load_plan(changed_plan(tmp_path, ("levels = 1 ", rows))).warnings)
    assert "pattern.heights_m: rows of targets nearer than 300 mm" in said
    assert "weld (2): 1.9, 4 m; is that intended?" in said
