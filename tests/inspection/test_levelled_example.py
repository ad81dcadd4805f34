"""examples/inspection: simulated levellings against the truth that they were made of."""

import json
import subprocess
import sys
import tomllib

import numpy as np
import pytest

from tankcal.job.entries import read_section
from tankcal.job.folder import read_toml
from tankcal.job.tables import Log
from tankcal.products.inspection.edges import assess_edges
from tankcal.products.inspection.inspecting import Bottom, inspect_bottom
from tankcal.products.inspection.levelling import read_edge_profiles, read_settlement
from tankcal.products.inspection.rules import (
    BULGE,
    EDGE,
    SETTLEMENT,
    Strength,
    bulge_limits,
    edge_limits,
    settlement_limits,
)
from tankcal.products.inspection.settlement import assess_settlement
from tankcal.text.shipped import shipped_folder

FOLDER = shipped_folder("examples") / "inspection"
RULE = shipped_folder("products/inspection/rules") / "api_653.toml"
TANK = Strength(diameter_m=13.0, height_m=9.5, yield_pa=250e6, e_pa=206e9)


@pytest.fixture(scope="module")
def truth():
    return json.loads((FOLDER / "truth.json").read_text(encoding="utf-8"))


def section(name, fields):
    """{key: value} of a section of the shipped rule, as a rule file is read."""
    log = Log()
    settings, rows = read_toml(RULE.name, RULE.read_bytes(), log)
    values = read_section(RULE.name, name, fields, settings[name], rows[name], log)
    log.stop_if_problems()
    return values


def test_shipped_limits_are_not_said_to_be_verified():
    with RULE.open("rb") as file:
        rule = tomllib.load(file)
    for name in ("settlement", "edge", "bulge"):
        assert rule[name]["verified"] is False
        assert rule[name]["clause"]


@pytest.mark.slow
def test_settlement_of_the_example(truth):
    """Truth: the planted waves; each difference within U of it, none of the epochs alone."""
    log = Log()
    levelling = read_settlement(FOLDER / "settlement.csv", log)
    limits = settlement_limits(section("settlement", SETTLEMENT))
    saved, figures = assess_settlement(levelling, TANK, limits, log)
    assert (log.problems, log.warnings) == ([], [])
    change = saved[2]
    assert abs(change.b_mm - 30) <= change.U_b_mm
    assert abs(change.a_mm + 18) <= 1.96 * np.sqrt(2) * 0.7 / 4
    of_change = {one.code: one for one in figures if one.epoch == "2026-05-04 - 2019-03-11"}
    curvature = of_change["settlement_curvature"]
    assert abs(curvature.value - truth["curvature_of_settlement_per_m"]) <= curvature.U
    every, subset = of_change["settlement_all"], of_change["settlement_subset"]
    assert every.value < every.limit.value < every.value + every.U  # the guard band
    assert subset.value + subset.U < subset.limit.value
    assert curvature.value + curvature.U < curvature.limit.value


def test_edges_of_the_example(truth):
    """Truth: the planted edges and the bulge, each within its U."""
    log = Log()
    lines = read_edge_profiles(FOLDER / "edge_profiles.csv", log)
    limits = edge_limits(section("edge", EDGE)), bulge_limits(section("bulge", BULGE))
    profiles, figures = assess_edges(lines, 6.5, *limits, file="edge_profiles.csv", log=log)
    assert (log.problems, log.warnings) == ([], [])
    found = {f"{one.azimuth_deg}": one for one in profiles if one.drop_mm is not None}
    assert set(found) == set(truth["drop_of_edge_mm"])
    for azimuth, drop in truth["drop_of_edge_mm"].items():
        assert abs(found[azimuth].drop_mm - drop) <= found[azimuth].U_mm
    (bulge,) = (one for one in figures if one.code == "bottom_bulge")
    assert abs(bulge.value - truth["bulge_height_mm"]) <= bulge.U
    assert bulge.azimuth_deg == 200.0


@pytest.mark.slow
def test_both_files_by_one_door():
    """Second method: the same as each file by itself."""
    rule = {"settlement": section("settlement", SETTLEMENT), "edge": section("edge", EDGE)}
    files, log = (FOLDER / "settlement.csv", FOLDER / "edge_profiles.csv"), Log()
    found = inspect_bottom(*files, TANK, rule, log)
    assert (log.problems, log.warnings) == ([], [])
    levelling = read_settlement(files[0], log)
    saved, figures = assess_settlement(levelling, TANK, settlement_limits(rule["settlement"]), log)
    assert [*found.settlements] == saved
    assert [*found.figures[: len(figures)]] == figures
    assert [one.code for one in found.figures[len(figures) :]] == [
        "edge_settlement", "bottom_bulge"
    ]  # fmt: skip
    assert found.figures[-1].limit is None  # the rule has none
    assert found.as_built
    assert inspect_bottom(None, None, TANK, rule, log) == Bottom()


def test_problems_of_both_files_and_of_the_tank_come_together(tmp_path):
    wrong = tmp_path / "settlement.csv"
    wrong.write_text("point,azimuth_deg,elevation_m\nP,0,x\n")
    log = Log()
    no_size = Strength(None)
    assert inspect_bottom(wrong, tmp_path / "gone.csv", no_size, {}, log) == Bottom()
    assert [one.file for one in log.problems] == ["settlement.csv", "gone.csv", "settlement.csv"]
    assert log.problems[-1].expected.code == "bottom_no_diameter"


@pytest.mark.slow
def test_example_is_made_again(tmp_path):
    copy = tmp_path / "simulate.py"
    copy.write_bytes((FOLDER / "simulate.py").read_bytes())
    subprocess.run([sys.executable, str(copy)], check=True)
    for name in ("settlement.csv", "edge_profiles.csv", "truth.json"):
        assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes()
