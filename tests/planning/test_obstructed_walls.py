"""Obstacles in plans of the bare wall: sights that they cut are not planned.

Truth: closed form (angles of what hides, tangents of a pillar), properties.
"""

import numpy as np
import pytest
from messages_told import lines
from wall_plan_folders import HITS, LINES, TANGENTS, plan_of

from tankcal.errors import InputError
from tankcal.planning import load_plan, predict
from tankcal.planning.wall.changes import wall_count
from tankcal.report.planning.rows import field_tables_of_wall

BOX = '[[obstacles]]\nname = "stair"\nkind = "box"\nfrom_m = {}\nto_m = {}\n\n[limits]'
PILLAR = (
    '[[obstacles]]\nname = "pillar"\nkind = "cylinder"\naxis_m = {}\nradius_m = {}\nlow_m = {}\n'
    "high_m = {}\n\n[limits]"
)


def planned(folder, source, text):
    return load_plan(plan_of(folder, source, ("[limits]", text)))


def warnings_of(plan):
    return lines(plan.warnings)


@pytest.mark.slow
def test_a_pillar_hides_hits_behind_it(tmp_path):
    """Closed form: the angle that it is seen under, from the set-up at (0, 1.5)."""
    plan = planned(tmp_path, HITS, PILLAR.format([0.0, 0.0], 0.5, -1, 20))
    hits = plan.job.hits
    assert len(hits) == 170
    off = np.degrees(hits.direction_rad) % 360 - 180  # from the sight to the axis
    assert np.abs(off).min() > np.degrees(np.arcsin(0.5 / 1.5))
    (told,) = warnings_of(plan)
    assert told == "plan.toml, row 33, hits: obstacles hide 30 of 200 hits: they are left out"


@pytest.mark.slow
def test_what_is_hidden_widens_u(tmp_path):
    plan = planned(tmp_path, HITS, PILLAR.format([0.0, 0.0], 0.5, -1, 20))
    assert predict(plan).table.U_m3[-1] > predict(load_plan(HITS)).table.U_m3[-1]


@pytest.mark.slow
def test_a_stair_hides_upper_levels_of_a_line(tmp_path):
    """Closed form: line 4 stands at x = R + 0.2; from 2 m on nothing is seen along it."""
    plan = planned(tmp_path, LINES, BOX.format([7.0, -0.5, 2.0], [9.0, 0.5, 4.0]))
    levels = {one.level_m for one in plan.job.lines.offsets if one.line == "4"}
    assert max(levels) < 2.0
    assert {one.level_m for one in plan.job.lines.offsets if one.line == "3"} > levels
    assert len(plan.job.lines.lines) == 12
    (rows, _) = field_tables_of_wall(plan)["offset_readings"]
    assert len(rows) * 2 == len(plan.job.lines.offsets) == 268
    assert wall_count(plan)["reading"] == 268 + 3


def test_a_line_without_its_reference_level_is_left_out(tmp_path):
    plan = planned(tmp_path, LINES, BOX.format([7.0, -0.5, -1.0], [9.0, 0.5, 0.2]))
    assert set(plan.job.lines.lines) == {str(k) for k in range(1, 13)} - {"4"}
    assert wall_count(plan)["line"] == 11


@pytest.mark.slow
def test_limbs_behind_a_bund(tmp_path):
    """A wall round the tank hides the lowest level from all stations, and nothing above."""
    plan = planned(tmp_path, TANGENTS, PILLAR.format([0.0, 0.0], 8.0, 0.0, 1.2))
    assert len(plan.job.tangents) == 144
    assert plan.job.tangents.level_m.min() > 0.5


TOLD = [
    (TANGENTS, BOX.format([11.4, -1, 0], [13.6, 1, 3]), "tangents: station 3 stands in the"),
    (TANGENTS, BOX.format([9.4, 3.2, 0], [11.2, 6.1, 3]), "traverse: the line from 2 to 3 is cut"),
    (TANGENTS, PILLAR.format([0, 0], 8, 0, 20), "obstacles hide all of the 160 tangents"),
    (LINES, PILLAR.format([0, 0], 9, -1, 20), "obstacles hide all of the 288 offsets"),
    (HITS, BOX.format([1, 2], [2, 3, 4]), "obstacles[1].from_m: expected 3 numbers, metres"),
    (HITS, PILLAR.format([0, 3], -1, 0, 3), "obstacles[1].radius_m: found -1; expected"),
]


@pytest.mark.parametrize(("source", "text", "words"), TOLD)
def test_what_cannot_be_is_told_in_one_line(tmp_path, source, text, words):
    with pytest.raises(InputError) as error:
        planned(tmp_path, source, text)
    (told,) = lines(error.value.problems)
    assert words in told


def test_an_obstacle_that_hides_nothing_is_named(tmp_path):
    plan = planned(tmp_path, HITS, BOX.format([100, 100, 0], [101, 101, 2]))
    (told,) = warnings_of(plan)
    assert "without any effect on what is sighted: stair" in told
    assert len(plan.job.hits) == 200
