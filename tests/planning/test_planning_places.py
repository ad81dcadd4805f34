"""Where a plan puts things: on the side of the survey, on its own course, where a camera looks."""

from dataclasses import replace

import numpy as np
import pytest
from plan_folders import PLAN, changed_plan, with_setups

from tankcal.errors import InputError
from tankcal.geometry.rotations import view_of_rotation
from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import changes_of
from tankcal.planning.places import find_visible, row_heights_m


@pytest.fixture(scope="module")
def plan():
    return load_plan(PLAN)


def from_within(folder, *pairs):
    """The example surveyed from within: stations half-way to the axis, tapes inside."""
    changes = [
        ('side = "outside"', 'side = "inside"'),
        ("distance_m = 10.0", "radius_m = 3.0"),
        *pairs,
    ]
    changed_plan(folder, *changes)
    (folder / "uncertainty.csv").unlink()  # plates and paint, which are not between
    return load_plan(folder)


@pytest.mark.slow
def test_the_volume_is_that_of_the_nominal_tank_from_either_side(plan, tmp_path):
    """Second method: plates are 8.0 to 6.3 mm, so the courses differ outside and not inside."""
    inside = from_within(tmp_path)
    away = np.hypot(*(plan.targets.xyz_m[:, :2] - plan.shell.axis_m).T)
    plates = np.array([course.thickness_m for course in plan.job.courses])[plan.targets.course]
    assert away == pytest.approx(6.5 + plates + 0.00025 + 0.001)
    volumes = [predict(one).table.volume_m3[-1] for one in (plan, inside)]
    assert volumes[0] == pytest.approx(volumes[1], rel=2e-7)


def test_a_camera_points_to_the_height_on_the_wall(plan, tmp_path):
    """Closed form: 10 m from the wall, 1.8 m higher; within, 9.5 m from the wall opposite."""
    for one, away in ((plan, 10.0), (from_within(tmp_path), 9.5)):
        _, tilt, _ = view_of_rotation(one.photos[0].rotation)
        assert np.tan(tilt) == pytest.approx(1.8 / away)


def test_tape_ends_face_as_the_tape_does(plan, tmp_path):
    """Closed form: an end is not seen from more than the limit beside the normal of its tape."""
    seen, normals = find_visible(plan), plan.facing
    assert len(normals) == 16
    for name, out in normals.items():
        point = seen.points.index(name)
        back = np.array([one.xyz_m for one in plan.photos]) - plan.points[name]
        cosine = back @ out / np.linalg.norm(back, axis=1)
        too_flat = cosine < np.cos(plan.limits.incidence_rad)
        assert too_flat.any()
        assert not seen.on_photo[too_flat, point].any()


def test_a_level_tape_within_is_a_chord(tmp_path):
    """Property: both ends are as far off the wall as the plan says; what is beyond it is unseen."""
    plan = from_within(tmp_path)
    (tape,) = (one for one in plan.ties if one.name == "H1")
    ends = np.array([plan.points[name] for name in (tape.start, tape.end)])
    away = np.hypot(*(ends[:, :2] - plan.shell.axis_m).T)
    assert away == pytest.approx(plan.shell.radius_m - 0.15)
    assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(6.9)
    seen = find_visible(plan)
    beyond = np.hypot(*(plan.points["M1"][:2] - plan.shell.axis_m)) > plan.shell.radius_m
    assert beyond
    assert not seen.on_photo[:, seen.points.index("M1")].any()
    assert seen.on_photo[:, seen.points.index("H1a")].any()


def test_the_order_of_control_changes_nothing(tmp_path):
    """Property: control on a set-up may stand before or after other control."""
    folder = with_setups(tmp_path)
    lines = (folder / "control.csv").read_text().splitlines()
    found = []
    for rows in (["M9,10,10,12,1,1,1", "T1-1,15.9,28.6,11.5,1,1,1"],) * 2:
        rows = rows[:: 1 if not found else -1]
        (folder / "control.csv").write_text("\n".join([*lines, *rows]) + "\n")
        plan = load_plan(folder)
        places = {name: plan.points[name] for name in ("M9", "T1-1")}
        assert places["M9"] == pytest.approx([10, 10, 12])
        seen = find_visible(plan)
        found.append({name: seen.on_setup[:, seen.points.index(name)].tolist() for name in places})
    assert found[0] == found[1]
    neighbours = [one.name in ("T1-2", "T1-6") for one in plan.setups]
    assert not any(np.array(found[0]["T1-1"]) & ~np.array(neighbours))


def test_photographs_show_no_instruments(plan, tmp_path):
    surveyed = load_plan(with_setups(tmp_path))
    both = replace(surveyed, photos=plan.photos, job=plan.job)
    seen = find_visible(both)
    at = [seen.points.index(one.name) for one in both.setups]
    assert not seen.on_photo[:, at].any()
    assert seen.on_photo.any()


def test_a_row_takes_its_tapes_along(plan):
    """A tape between targets of a row goes with the row."""
    rows = plan.targets.append(
        replace(
            plan.targets,
            names=tuple(f"{name}b" for name in plan.targets.names),
            section=tuple(f"{name}b" for name in plan.targets.section),
            xyz_m=plan.targets.xyz_m + [0, 0, 0.5],
            height_m=plan.targets.height_m + 0.5,
        )
    )
    tie = replace(plan.ties[0], name="X", start="1-1b", end="1-2")
    tied = replace(plan, targets=rows, ties=(*plan.ties, tie))
    dropped = {one.name: one.plan for one in changes_of(tied, ("drop",), ("target_row",))}
    assert tie not in dropped["row 1b"].ties
    assert tie in dropped["row 3b"].ties
    assert len(dropped["row 1b"].ties) == len(plan.ties)


def refused(folder):
    """Lines about a plan that cannot be meant."""
    with pytest.raises(InputError) as error:
        load_plan(folder)
    return [str(one) for one in error.value.problems]


def test_targets_on_one_another(tmp_path):
    """Lines 1 deg apart, moved 300 mm from a weld, meet; so do equal rows."""
    rows = "heights_m = [1.0, 1.01, 3.0, 5.0, 7.0, 9.0] #"
    lines = refused(
        changed_plan(tmp_path, ("generatrices = 24", "generatrices = 360"), ("levels = 1 ", rows))
    )
    assert [line.partition(": ")[0].partition(", ")[2].partition(", ")[2] for line in lines] == [
        "pattern.generatrices",
        "pattern.heights_m",
    ]
    assert "nearer than 20 mm to one another when they are kept 300 mm from welds" in lines[0]
    assert lines[0].count(" and ") == 6
    assert "and 7 more" in lines[0]
    assert "rows at 1 and 1.01 m; expected rows at least 20 mm apart" in lines[1]


def test_a_target_moved_onto_another_weld(tmp_path):
    (line,) = refused(
        changed_plan(
            tmp_path, ("weld_azimuths_deg = [0.0, 120.0, 240.0]", "weld_azimuths_deg = [7.0, 10.6]")
        )
    )
    assert "pattern.weld_azimuths_deg: lines 2 are as near as" in line
    assert "expected welds further apart" in line


def test_control_that_is_not_where_the_plan_has_it(tmp_path):
    """Targets and tape ends, each in its row; what is near, or blank, passes."""
    folder = changed_plan(tmp_path)
    heading = "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\n"
    place = load_plan(PLAN).points["9-1"] + [0.1, -0.2, 0.1]
    near = ",".join(f"{value:.3f}" for value in place)
    rows = f"1-1,0,0,0,0,0,0\n9-1,{near},2,2,2\n17-1,,,,2,2,2\n5-1,,,99,2,2,2\nV1a,1,2,3,,,\n"
    (folder / "control.csv").write_text(heading + rows)
    found = refused(folder)
    starts = ("row 2, y_m: 1-1", "row 5, z_m: 5-1", "row 6, y_m: V1a")
    assert [line.startswith(f"control.csv, {one}") for line, one in zip(found, starts, strict=True)]
    assert "5-1 is given 88.050 m from its place in the plan (" in found[1]
    assert all(line.endswith("expected it within 0.5 m, or blank") for line in found)


def test_a_tape_through_the_tank(tmp_path):
    """Along the wall from bottom to top it passes, though the upper plates are thinner."""
    folder = changed_plan(tmp_path)
    (folder / "distances.csv").write_text("from,to,s_mm\n1-1,1-5,1.0\n1-1,13-1,1.0\n")
    (line,) = refused(folder)
    assert line.startswith("distances.csv, row 3, to: the line from 1-1 to 13-1 runs through the")


def test_a_tape_beyond_the_wall(tmp_path):
    inside = (('side = "outside"', 'side = "inside"'), ("distance_m = 10.0", "radius_m = 3.0"))
    folder = changed_plan(
        tmp_path, *inside, ("azimuth_deg = 20\nlength_m = 6.9", "azimuth_deg = 20\nlength_m = 14")
    )
    (folder / "uncertainty.csv").unlink()
    (folder / "distances.csv").write_text("from,to,s_mm\n1-1,M1,1.0\n1-1,13-1,1.0\n")
    within, wide = sorted(refused(folder))
    assert within.startswith("distances.csv, row 2, to: M1 beyond the wall of the tank")
    assert "tapes[4].length_m: H1a and H1b beyond the wall" in wide


def test_a_plumb_line_that_does_not_hang(tmp_path):
    folder = changed_plan(tmp_path)
    (folder / "plumb_lines.csv").write_text("from,to,s_mm\n1-1,1-5,1.0\n1-1,3-5,1.0\n")
    (line,) = refused(folder)
    assert line.startswith("plumb_lines.csv, row 3, to: 1-1 and 3-5 are 3.3")


def test_a_station_under_the_floor(tmp_path):
    (line,) = refused(
        changed_plan(tmp_path, ("distance_m = 10.0", "radius_m = 3.0"), ("[1.4]", "[-2.0]"))
    )
    assert "station R1-1 stands under the floor of the tank, 3.000 m from its axis" in line


def test_rows_that_touch_are_one(plan):
    """A course a little higher than twice its clearance keeps one row, not two 1 mm apart."""
    first = plan.job.courses[0]
    rows, course = row_heights_m([replace(first, height_m=0.601), first], 2, 0.3)
    assert course.tolist() == [0, 1, 1]
    assert np.diff(rows).min() > 0.02


def test_a_set_up_whose_place_is_left_blank(tmp_path):
    """Its coordinates are the nominal ones, as those of targets."""
    folder = with_setups(tmp_path)
    (folder / "control.csv").write_text("point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\nT1-1,,,,1,1,1\n")
    plan = load_plan(folder)
    (known,) = plan.known
    assert known.xyz_m == pytest.approx(plan.setups[0].xyz_m)
    (folder / "control.csv").write_text(
        "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\nT1-1,500,500,11.5,1,1,1\n"
    )
    (line,) = refused(folder)
    assert line.startswith("control.csv, row 2, x_m: T1-1 is given 67")
