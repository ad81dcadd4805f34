"""Overruling the search for blunders: what is kept, what is left out, what that changes."""

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from generated_solids import job_of, make_lying, survey_lying
from job_builder import job_parts, write_folder
from numpy.testing import assert_allclose

import tankcal
from tankcal.errors import InputError
from tankcal.job.model import Overruling

pytestmark = pytest.mark.slow  # seconds of runs and papers

EXAMPLES = Path(__file__).parents[2] / "examples"
TURN = np.radians(7.5)  # between two points of a ring, 15 degrees apart
DENT = ("dent", 6.46 * np.sin(TURN), 6.46 * np.cos(TURN), 5.225)  # 40 mm inside the wall of 6.5 m
SOUND = ("a", 6.5, 0.0, 5.2)


def decision(point, how="keep", **more):
    return Overruling(point, None, None, how, "seen on site", row=2, **more)


def of_reading(table, row, how):
    return Overruling(None, table, row, how, "noted in the book", row=2)


def run(job, *decisions):
    return tankcal.run(replace(job, overrulings=decisions), simulated=False)


def top(result):
    return result.table.volume_m3[-1]


@pytest.fixture(scope="module")
def dented(tmp_path_factory):
    parts = job_parts(
        rings=2, noise_mm=1.0, extra_points=[DENT, SOUND], settings={"table.step_m": 1.9}
    )
    return tankcal.load(write_folder(tmp_path_factory.mktemp("dented") / "job", parts))


def state(result, point):
    return result.wall.shell.reason[result.job.points.names.index(point)]


def test_without_a_decision_nothing_is_computed_twice(dented):
    result = run(dented)
    assert state(result, "dent") == "snooping"
    assert result.overrulings is None


def test_a_kept_point_is_wall(dented):
    # property: the search alone says what it says, and the move is that between the two runs
    alone, result = run(dented), run(dented, decision("dent"))
    (one,) = result.overrulings.each
    place = dented.points.names.index("dent")
    assert state(result, "dent") == ""
    assert place in result.accepted
    assert one.searched == "snooping"
    assert_allclose(
        [one.off_m, one.w], [alone.wall.shell.residual_m[place], alone.wall.shell.w[place]]
    )
    assert_allclose(one.moved_m3, top(result) - top(alone), atol=1e-9)
    assert one.moved_m3 < 0  # the wall stands further inside there
    assert one.is_outrageous


def test_U_grows_with_what_a_kept_point_shows(dented, figure):
    # a wall that is 40 mm off at one place may be rough between all others, too
    alone, result = run(dented), run(dented, decision("dent"))
    U = alone.table.U_m3[-1], result.table.U_m3[-1]
    figure("U without and with a kept dent of 40 mm, m3", [round(float(one), 3) for one in U])
    figure("moved by it, m3", round(result.overrulings.moved_m3, 3))
    assert U[1] > U[0]
    assert abs(result.overrulings.moved_m3) < U[1]


def test_a_kept_point_may_drive_a_sound_one_out(tmp_path):
    # at a level where nothing else was read, its word against that of another one; it is told
    level = [("dent", 0.0, 6.46, 5.0), ("b", -6.5, 0.0, 5.0), ("c", 6.5, 0.0, 5.0)]
    parts = job_parts(rings=2, noise_mm=1.0, extra_points=level)
    job = tankcal.load(write_folder(tmp_path / "job", parts))
    result = run(job, decision("dent"))
    assert {"b", "c"} & {*result.overrulings.others}
    assert "others_changed" in [one.expected.code for one in result.warnings]
    assert result.table.U_m3[-1] > 2 * run(job).table.U_m3[-1]  # no longer known how it goes on


def test_the_outrageous_is_told(dented):
    codes = [one.expected.code for one in run(dented, decision("dent")).warnings]
    assert "kept_outrageous" in codes
    assert "kept_outrageous" not in [one.expected.code for one in run(dented).warnings]


def test_to_keep_what_is_kept_changes_nothing(dented):
    # property: a decision that agrees with the search is none
    alone, result = run(dented), run(dented, decision("a"))
    (one,) = result.overrulings.each
    assert (one.searched, one.is_outrageous, result.overrulings.others) == ("", False, ())
    assert_allclose(top(result), top(alone), rtol=1e-12)
    assert_allclose(result.table.u_m3, alone.table.u_m3, rtol=1e-9)


def test_a_point_left_out_is_as_one_that_is_not_there(dented):
    # second method: the same job without that point
    result, names = run(dented, decision("a", "leave_out")), dented.points.names
    chosen = [i for i, name in enumerate(names) if name != "a"]
    fewer = replace(
        dented.points,
        names=tuple(names[i] for i in chosen),
        xyz_m=dented.points.xyz_m[chosen],
        section=tuple(dented.points.section[i] for i in chosen),
        generatrix=tuple(dented.points.generatrix[i] for i in chosen),
        rows=tuple(dented.points.rows[i] for i in chosen),
    )
    without = run(replace(dented, points=fewer))
    assert state(result, "a") == "overruled"
    assert_allclose(result.table.volume_m3, without.table.volume_m3, rtol=1e-6)
    assert_allclose(result.table.u_m3, without.table.u_m3, rtol=0.02)


def test_several_decisions_are_told_one_by_one(dented):
    both = decision("dent"), decision("a", "leave_out")
    result, only_one = run(dented, *both), run(dented, both[0])
    kept, left = result.overrulings.each
    assert_allclose(left.moved_m3, top(result) - top(only_one), atol=1e-9)
    assert_allclose(result.overrulings.moved_m3, top(result) - top(run(dented)), atol=1e-9)
    assert kept.moved_m3 != left.moved_m3


def test_more_than_ten_are_told_together(dented):
    names = [name for name in dented.points.names if name.startswith("C1")][:11]
    found = run(dented, *(decision(name, "leave_out") for name in names)).overrulings
    assert np.isnan([one.moved_m3 for one in found.each]).all()
    assert np.isfinite(found.moved_m3)


def test_without_snooping_a_point_can_be_left_out(dented):
    loose = replace(dented, snooping=False)
    assert state(run(loose), "dent") == ""
    assert state(run(loose, decision("dent", "leave_out")), "dent") == "overruled"


@pytest.mark.parametrize(
    ("point", "code"),
    [
        (("far", 0.0, 6.2, 5.0), "kept_far_off"),  # 300 mm, more than 3 % of 6.5 m
        (("high", 0.0, 6.5, 9.7), "kept_above_shell"),
        (("deep", 0.0, 6.5, -0.3), "kept_below_shell"),
        (("twin", 6.5, 0.0, 5.2), "kept_same_place"),
    ],
)
def test_what_no_wall_can_have_cannot_be_kept(tmp_path, point, code):
    parts = job_parts(rings=2, noise_mm=1.0, extra_points=[SOUND, point])
    job = tankcal.load(write_folder(tmp_path / "job", parts))
    with pytest.raises(InputError) as caught:
        run(job, decision(point[0]))
    (problem,) = caught.value.problems
    assert (problem.file, problem.row, problem.column) == ("overrulings.csv", 2, "point")
    assert problem.expected.code == code
    assert state(run(job, decision(point[0], "leave_out")), point[0]) == "overruled"


def test_a_name_that_no_point_has_is_refused(dented):
    with pytest.raises(InputError) as caught:
        run(dented, decision("nobody"))
    assert caught.value.problems[0].expected.code == "overruled_not_of_wall"


def test_without_a_point_there_may_be_no_solution(dented):
    # what a course needs: with all but four of its points left out there is none, and it is said
    names = [name for name in dented.points.names if name.startswith("C1")]
    with pytest.raises(InputError):
        run(dented, *(decision(name, "leave_out") for name in names[4:]))


@pytest.mark.slow
def test_a_scanned_lying_tank(tmp_path):
    rng = np.random.default_rng(5)
    shell = make_lying(rng, "dents")
    xyz = survey_lying(rng, shell, points=150, noise_m=0.001, layout="even")
    middle = xyz.mean(axis=0)
    xyz[7, 1:] = middle[1:] + 0.975 * (xyz[7, 1:] - middle[1:])  # one stands before the wall
    job = job_of(shell, xyz, 0.001, tmp_path)
    name = job.points.names[7]
    alone = run(job)
    assert 7 not in alone.accepted
    result = run(job, decision(name))
    assert 7 in result.accepted
    (one,) = result.overrulings.each
    assert one.searched == "far_off"
    assert_allclose(one.moved_m3, top(result) - top(alone), atol=1e-9)
    left = run(job, decision(job.points.names[20], "leave_out"))
    assert 20 not in left.accepted
    assert 20 in alone.accepted


@pytest.mark.slow
def test_bare_hits_go_by_setup_and_row():
    job = tankcal.load(EXAMPLES / "wall-hits")
    result = run(job, decision("I 77"), decision("I 12", "leave_out"))
    assert [one.searched for one in result.overrulings.each] == ["snooping", ""]
    assert (state(result, "I 77"), state(result, "I 12")) == ("", "overruled")


# ---- readings of a survey


def spoilt_survey(folder, row, by_gon):
    shutil.copytree(EXAMPLES / "total-station", folder)
    path = folder / "directions.csv"
    rows = list(csv.reader(path.open(encoding="utf-8")))
    place = rows[0].index("direction_gon")
    rows[row - 1][place] = str(float(rows[row - 1][place]) + by_gon)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    return tankcal.load(folder)


def reading(result, table, row):
    found = result.adjustment.readings
    return next(one for one in found if (one.file, one.row) == (f"{table}.csv", row))


@pytest.mark.slow
def test_a_reading_that_the_search_sets_aside_is_kept(tmp_path):
    job = spoilt_survey(tmp_path / "job", 7, 0.05)
    alone, result = run(job), run(job, of_reading("directions", 7, "keep"))
    assert reading(alone, "directions", 7).removed
    assert not reading(result, "directions", 7).removed
    (one,) = result.overrulings.each
    assert one.searched == "removed"
    assert_allclose(one.w, reading(alone, "directions", 7).w)
    assert result.overrulings.others  # another one of the same line of sight went in its place


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [7, 189])
def test_of_two_faces_of_one_sight_the_first_is_set_aside(tmp_path, wrong):
    """They control each other alone; which is wrong nobody can tell, and the report says so."""
    alone = run(spoilt_survey(tmp_path / "job", wrong, 0.05))
    assert reading(alone, "directions", 7).removed
    assert not reading(alone, "directions", 189).removed
    (told,) = (one for one in alone.warnings if one.expected.code == "undecided")
    assert "(row 189)" in str(told)


@pytest.mark.slow
def test_a_reading_left_out_is_only_compared(tmp_path):
    # second method: the same job with use = check in that row
    job = tankcal.load(EXAMPLES / "total-station")
    result = run(job, of_reading("directions", 7, "leave_out"))
    (table,) = [one for one in job.measurements.readings if one.table == "directions"]
    check = np.asarray(table.check) | (np.asarray(table.rows) == 7)
    tables = tuple(
        replace(one, check=check) if one is table else one for one in job.measurements.readings
    )
    marked = run(replace(job, measurements=replace(job.measurements, readings=tables)))
    assert_allclose(result.table.volume_m3, marked.table.volume_m3, rtol=1e-13)
    assert_allclose(result.table.u_m3, marked.table.u_m3, rtol=1e-12)


@pytest.mark.slow
def test_a_kept_reading_that_was_not_adjusted_is_refused():
    job = tankcal.load(EXAMPLES / "total-station")
    with pytest.raises(InputError) as caught:
        tankcal.adjust_job(replace(job, overrulings=(of_reading("directions", 9999, "keep"),)))
    assert caught.value.problems[0].expected.code == "kept_no_reading"


@pytest.mark.slow
def test_a_kept_reading_whose_point_is_lost_by_it_is_refused():
    # 0.3 mm in the image: the other rays of its point go, one after another
    job = tankcal.load(EXAMPLES / "silva-1995-photos", only="adjustment")
    images = job.measurements.image_points
    spoilt = images.xy_mm.copy()
    spoilt[25, 0] += 0.3
    measured = replace(job.measurements, image_points=replace(images, xy_mm=spoilt))
    kept = of_reading("image_points", images.rows[25], "keep")
    with pytest.raises(InputError) as caught:
        tankcal.adjust_job(replace(job, measurements=measured, overrulings=(kept,)))
    assert caught.value.problems[0].expected.code == "kept_point_lost"
