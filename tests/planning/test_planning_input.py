"""Plans that cannot be meant: each thing told in words, with file, row and column, all at once."""

import datetime
import json
import re

import pytest
from conftest import EXAMPLE
from messages_told import lines
from plan_folders import with_setups

from tankcal import cli
from tankcal.cli import main
from tankcal.errors import InputError, SolutionError
from tankcal.planning import improvements as helping
from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import changes_of
from tankcal.report.planning import FILES, JOB

PLAN = EXAMPLE.parent / "plan-silva"


@pytest.fixture
def changed(tmp_path):
    """Function: the folder of the example's plan with texts replaced in one of its files."""

    def make(*pairs, file="plan.toml", without=()):
        for path in PLAN.iterdir():
            if path.name not in without:
                (tmp_path / path.name).write_text(path.read_text())
        text = (tmp_path / file).read_text()
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / file).write_text(text)
        return tmp_path

    return make


def told(folder):
    with pytest.raises(InputError) as error:
        predict(load_plan(folder))
    return lines(error.value.problems)


def test_a_station_inside_the_wall(changed):
    (line,) = told(changed(("distance_m = 10.0", "distance_m = 0.01")))
    assert "photo_rings[1]" in line
    assert "stands inside the wall: 6.518 m from the axis, the wall is at 6.508 m" in line


def test_a_station_on_the_wrong_side(changed):
    (line,) = told(changed(("distance_m = 10.0", "radius_m = 3.0")))
    assert "stands inside the tank" in line
    folder = changed(('side = "outside"', 'side = "inside"'), ("distance_m", "radius_m"))
    (folder / "uncertainty.csv").unlink()  # plates bear on an outside survey only
    (line,) = told(folder)
    assert "stands outside the tank, 10.000 m from its axis" in line


def test_a_station_in_an_obstacle(changed):
    box = '[[obstacles]]\nname = "pump house"\nkind = "box"\n'
    box += "from_m = [15, 30, 9]\nto_m = [17, 32, 13]"
    (line,) = told(changed(("[limits]", f"{box}\n\n[limits]")))
    assert "station R1-1 stands in the obstacle pump house" in line


def test_a_camera_that_sees_nothing(changed):
    (line,) = told(changed(("aim_height_m = 3.2", "directions_deg = [180.0]")))
    assert "photograph R1-1 sees nothing, and 10 more of this ring" in line
    assert "expected it to see 3 points or more" in line


def test_targets_above_the_shell(changed):
    (line,) = told(changed(("levels = 1", "heights_m = [1.0, 3.0, 5.0, 7.0, 9.0, 9.7]\n#")))
    assert "a row of targets at 9.7 m is above the shell; expected 0 to 9.5 m" in line
    assert "pattern.heights_m" in line


def test_an_accuracy_of_zero_for_everything(changed):
    lines = told(changed(("rolls_deg = [0]", "s_um = 0")))
    assert any("an image point cannot be exact" in line for line in lines)
    ring = (
        '[[setup_rings]]\ninstrument = "TS"\nstations = 6\ndistance_m = 8.0\nheights_m = [1.5]\n'
        "s_direction_arcsec = 0\ns_zenith_arcsec = 0\ns_mm = 0\n\n[limits]"
    )
    folder = changed(("[limits]", ring))
    with open(folder / "instruments.toml", "a") as file:
        file.write('\n[instruments.TS]\nkind = "total_station"\n')
    (line,) = told(folder)
    assert "an accuracy of zero for everything: expected standard deviations above 0" in line


def test_undefined_names(changed):
    lines = told(
        changed(
            ('camera = "UMK"', 'camera = "UMX"'),
            (
                'name = "V1"\nkind = "vertical"\nazimuth_deg = 37\n',
                'name = "V1"\nkind = "vertical"\n',
            ),
            ("generatrices = 24", "generatrix = 24"),
        )
    )
    assert any("found 'UMX'" in line and "did you mean UMK?" in line for line in lines)
    assert any("tapes[1].azimuth_deg: missing" in line for line in lines)
    assert any(
        "pattern.generatrix: unknown key (did you mean generatrices?)" in one for one in lines
    )
    assert any("pattern.generatrices: missing" in line for line in lines)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["plan-silva", "plan-tangents"])
def test_day_of_the_survey_lies_ahead(tmp_path, source):
    """Nobody plans what has been measured; ten years ahead are enough."""
    for path in (EXAMPLE.parent / source).iterdir():
        (tmp_path / path.name).write_text(path.read_text())
    text = (tmp_path / "plan.toml").read_text()
    day = datetime.date.today() + datetime.timedelta(days=400)
    for date in (day, day.replace(year=day.year + 900, day=1)):
        dated = re.sub(r"(?m)^date = \S+", f"date = {date}", text)
        (tmp_path / "plan.toml").write_text(dated)
        if date is day:
            assert load_plan(tmp_path).job.survey.date == date.isoformat()
    with pytest.raises(InputError) as error:
        load_plan(tmp_path)
    assert {(one.column, one.expected.code) for one in error.value.problems} == {
        ("survey.date", "survey_date_far")
    }


def test_distance_or_radius(changed):
    lines = told(changed(("distance_m = 10.0", "")))
    assert any("expected one of distance_m (from the wall) and radius_m" in line for line in lines)


def test_tapes_between_points_that_are_not_there(changed):
    folder = changed()
    (folder / "distances.csv").write_text("from,to,s_mm\n1-1,99-9,1.0\n")
    (line,) = told(folder)
    assert "distances.csv" in line
    assert "found '99-9'; expected a target, or a point of control.csv" in line


def test_a_tie_from_a_point_to_itself(changed):
    folder = changed()
    (folder / "distances.csv").write_text("from,to,s_mm\n1-1,2-1,0\n1-1,1-1,1\n")
    (line,) = told(folder)
    assert line == "distances.csv, row 3, to: found '1-1' on both sides; expected two points"


def test_control_given_twice_or_in_another_frame(changed):
    """A row again would count as another observation of the same coordinates."""
    folder = changed()
    heading = "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm,system\n"
    rows = "1-1,,,,2,2,2,\n9-5,,,,2,2,2,\n1-1,,,,2,2,2,\nP,1,,3,2,2,2,\n17-1,,,,2,2,2,UTM\n"
    (folder / "control.csv").write_text(heading + rows)
    twice, foreign = told(folder)
    assert twice == "control.csv, row 4, point: '1-1' is already in row 2; expected once"
    assert foreign.startswith("control.csv, row 6, system: found 'UTM'; expected a blank")
    (folder / "control.csv").write_text(heading + "1-1,,,,2,2,2,\nP,1,,3,2,2,2,\n")
    (line,) = told(folder)
    assert line.startswith("control.csv, row 3, point: P is no target of the plan")


def test_control_that_is_only_compared_holds_nothing(changed):
    folder = changed()
    heading = "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm,use\n"
    (folder / "control.csv").write_text(heading + "1-1,,,,2,2,2,\n9-5,,,,2,2,2,check\n")
    plan = load_plan(folder)
    assert [one.name for one in plan.known] == ["1-1"]


def test_counts_that_are_not_whole(changed):
    folder = changed(
        ("generatrices = 24", "generatrices = 3.5"), ("stations = 11", "stations = 1.5")
    )
    (folder / "distances.csv").write_text("from,to,s_mm,readings\n1-1,2-1,1,2.5\n")
    lines = told(folder)
    assert [line.partition("; ")[2] for line in lines] == [
        f"expected a whole number from 1 to {most}" for most in (2000, 500, 100)
    ]
    assert ["3.5" in lines[0], "1.5" in lines[1], "2.5" in lines[2]] == [True] * 3


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("distance_m = 10.0", "distance_m = 0", "photo_rings[1].distance_m"),
        ("distance_m = 10.0", "radius_m = -1", "photo_rings[1].radius_m"),
        ("image_sd_um = 5.0", "image_sd_um = 0", "adjustment.image_sd_um"),
        ("rolls_deg = [0]", "s_um = -1", "photo_rings[1].s_um"),
        ("rolls_deg = [0]", "s_um = 0", "photo_rings[1].s_um"),
        ("levels = 1 ", "heights_m = [1.0, 3.0, 5.0, 7.0, 99.0] #", "pattern.heights_m"),
        ("distance_m = 10.0", 'distance_m = "7,5"', "photo_rings[1].distance_m"),
    ],
)
def test_one_problem_is_one_line_with_the_row_of_its_key(changed, old, new, key):
    folder = changed((old, new))
    lines = (folder / "plan.toml").read_text().splitlines()
    row = next(number for number, line in enumerate(lines, 1) if new in line)
    (line,) = told(folder)
    assert line.startswith(f"plan.toml, row {row}, {key}: ")
    if "7,5" in new:
        assert line.endswith("write 7.5 without quotation marks")


PIPE = '[[obstacles]]\nname = "pipe"\nkind = "cylinder"\naxis_m = [15.0, 24.5]\nradius_m = 0.15\n'


@pytest.mark.parametrize(
    ("obstacle", "key"),
    [
        (f"{PIPE}low_m = 10.0\nhigh_m = 9.0\n", "high_m: found 9; expected more than low_m, 10"),
        (f"{PIPE}low_m = 10.0\n", "high_m: missing"),
        (f"{PIPE}low_m = 10.0\nhigh_m = 1e9\n", "high_m: found 1000000000"),
        (
            '[[obstacles]]\nname = "wall"\nkind = "box"\nfrom_m = [1, 2, 3]\nto_m = [4, 2, 6]\n',
            "to_m: in a plane with from_m",
        ),
    ],
)
def test_an_obstacle_without_a_body(changed, obstacle, key):
    (line,) = told(changed(("[limits]", f"{obstacle}\n[limits]")))
    assert f"obstacles[1].{key}" in line


def test_decimal_commas_and_semicolons(changed):
    """The plan is the same, and its empty job, with points and commas, says nothing of marks."""
    folder = changed(("[tank]", '[csv]\nseparator = ";"\ndecimal = ","\n\n[tank]'))
    for name in ("courses", "control", "uncertainty"):
        path = folder / f"{name}.csv"
        path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    plan, same = load_plan(folder), load_plan(PLAN)
    assert plan.job.courses == same.job.courses
    assert [one.sd_m.tolist() for one in plan.known] == [one.sd_m.tolist() for one in same.known]
    assert "csv" not in plan.raw.settings
    assert plan.raw.tables["courses"].rows == same.raw.tables["courses"].rows


def test_measured_values_do_not_belong_into_a_plan(changed):
    folder = changed()
    (folder / "distances.csv").write_text("from,to,distance_m,s_mm\n1-1,2-1,1.7,1.0\n")
    (folder / "image_points.csv").write_text("photo,point,x_mm,y_mm\n")
    lines = told(folder)
    assert any("distances.csv" in line and "unknown column" in line for line in lines)
    assert any("image_points.csv" in line and "unknown file" in line for line in lines)


def test_no_station_at_all(changed):
    text = (PLAN / "plan.toml").read_text()
    ring = text[text.index("[[photo_rings]]") : text.index("[[tapes]]")]
    (line,) = told(changed((ring, "")))
    assert "no station; expected [[photo_rings]] or [[setup_rings]]" in line


def test_a_plan_without_a_datum(changed):
    folder = changed(without=("control.csv",))
    with pytest.raises(SolutionError, match="datum defect 6: three translations"):
        predict(load_plan(folder))


@pytest.mark.slow
def test_a_plan_without_a_vertical_or_scale(changed):
    folder = changed(('datum = "control"', 'datum = "inner"'), ("[0]", "[0, 90]"))
    (folder / "control.csv").write_text(control_without_sds())
    with pytest.raises(SolutionError, match="the vertical is not determined"):
        predict(load_plan(folder))
    text = (folder / "plan.toml").read_text()
    tapes = text[text.index("[[tapes]]") : text.index("# What stands in the way")]
    (folder / "plan.toml").write_text(text.replace(tapes, ""))
    with pytest.raises(SolutionError, match="the scale is not determined"):
        predict(load_plan(folder))


def control_without_sds():
    """The points of control.csv off the wall: approximations only."""
    lines = (PLAN / "control.csv").read_text().splitlines()
    return "\n".join([lines[0], lines[-1]]) + "\n"


@pytest.mark.slow
def test_the_command_line(changed, tmp_path, capsys):
    assert main(["plan", str(PLAN), "--quiet", "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert "SILVA-1995: 11 photographs, 8 ties, 11 control points, 120 targets" in shown
    assert "limit 0.200 %: met" in shown
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {*FILES, JOB} - {"changes.csv", "changes.png", "design.csv"}


@pytest.mark.study
def test_the_command_line_with_changes(changed, tmp_path, capsys):
    few = changed(('name = "H6"', 'name = "H9"'), ("generatrices = 24", "generatrices = 12"))
    (few / "control.csv").write_text(
        "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\n1-5,,,,2,2,2\n5-1,,,,2,2,2\n9-5,,,,2,2,2\n"
    )
    out = tmp_path / "out"
    assert main(["plan", str(few), "--quiet", "--changes", "--out", str(out)]) == 0
    assert "more changes" in capsys.readouterr().out
    assert {"changes.csv", "changes.png"} <= {path.name for path in out.iterdir()}
    rows = (out / "changes.csv").read_text().splitlines()
    assert rows[0] == "action,item,name,arc_m,off_m,height_m,cost,relative_u,difference,U_m3,why"
    assert (out / "changes.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_line_with_a_bad_plan(changed, capsys):
    folder = changed(("distance_m = 10.0", "distance_m = 0.01"))
    assert main(["plan", str(folder), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("tankcal: plan.toml, row ")
    assert error.count("\n") == 1
    assert main(["plan", str(folder / "nothing")]) == 2
    assert "expected a plan's folder" in capsys.readouterr().err
    limitless = changed(("relative_u = 0.002\n", ""))
    assert main(["plan", str(limitless), "--smallest", "--quiet"]) == 2
    assert "limits.relative_u" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_line_with_a_limit_that_nothing_meets(changed, capsys, monkeypatch):
    monkeypatch.setattr(helping, "changes_of", lambda *of: ())
    folder = changed(("relative_u = 0.002", "relative_u = 0.0001"))
    assert main(["plan", str(folder), "--smallest", "--quiet"]) == 0
    told = capsys.readouterr().out
    assert "NOT met" in told
    assert "no evaluated plan meets the limit" in told


@pytest.mark.slow
def test_the_command_line_with_simulated_surveys(tmp_path, capsys):
    """One image point of nearly a thousand is off now and then; the same seed, the same surveys."""
    out = tmp_path / "out"
    asked = ["plan", str(PLAN), "--quiet", "--simulate", "3", "--blunders", "0.002", "--seed", "7"]
    assert main([*asked, "--out", str(out)]) == 0
    told = capsys.readouterr().out
    found = json.loads((out / "plan.json").read_text(encoding="utf-8"))["simulated"]
    assert (found["runs"], found["failed"], found["seed"]) == (3, [], 7)
    assert f"coordinates {found['coordinates_scatter_over_predicted']:.3f}" in told
    assert found["volume_scatter_over_predicted_sd"] == pytest.approx(0.5)
    assert len(found["volumes_m3"]) == 3
    assert main(asked) == 0
    assert capsys.readouterr().out.splitlines()[-1] in told
    assert main(["plan", str(PLAN), "--quiet", "--blunders", "0.1"]) == 2
    assert "expected --simulate N as well" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["1", "2.5", "many", "1e400"])
def test_a_number_of_surveys_that_is_none(text, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["plan", str(PLAN), "--simulate", text])
    assert stopped.value.code == 2
    assert "expected a whole number from 2 to 1000000" in capsys.readouterr().err


def test_slope_distances_without_zenith_angles(tmp_path):
    folder = with_setups(tmp_path)
    text = (folder / "plan.toml").read_text().replace("s_zenith_arcsec = 3.0\n", "")
    (folder / "plan.toml").write_text(text)
    (line,) = told(folder)
    assert "setup_rings[1].s_zenith_arcsec: missing; expected zenith angles" in line


def test_deliveries_that_are_longer_than_the_shell(changed):
    folder = changed(
        ("nominal_height_m = 9.5", "nominal_height_m = 1.2"),
        ("aim_height_m = 3.2", "aim_height_m = 0.6"),
        ("length_m = 9.0", "length_m = 0.9"),
        ("low_m = 1.5", "low_m = 0.5"),
        ("relative_u = 0.002", 'relative_u = 0.002\nof = "delivery"'),
    )
    (folder / "courses.csv").write_text("course,height_m,thickness_mm,paint_mm\n1,1.2,8.0,0.25\n")
    lines = (PLAN / "control.csv").read_text().splitlines()
    low = [line for line in lines if "-5" not in line]
    (folder / "control.csv").write_text("\n".join(low) + "\n")
    (line,) = told(folder)
    row = (folder / "plan.toml").read_text().splitlines().index('of = "delivery"') + 1
    assert line.startswith(f"plan.toml, row {row}, limits.of: no delivery of 1.5 m or more")


def test_keys_that_do_not_belong_together(changed):
    rows = "levels = 1\nheights_m = [1.0, 3.0, 5.0, 7.0, 9.0] #"
    folder = changed(
        ("levels = 1 ", rows), ("form_mm = 10.0", "form_mm = 10.0\ncommon_form_mm = 11")
    )
    levels, common = told(folder)
    assert "pattern.levels: given together with heights_m; expected one of the two" in levels
    assert "pattern.common_form_mm: found 11" in common
    assert common.endswith("expected at most 10")


def test_instruments_that_do_not_do_that(tmp_path):
    folder = with_setups(tmp_path)
    text = (folder / "plan.toml").read_text().replace('instrument = "TS"', 'instrument = "tape"')
    tape = (PLAN / "plan.toml").read_text()
    tape = tape[tape.index("[[tapes]]") : tape.index('[[tapes]]\nname = "V3"')]
    tape = tape.replace('instrument = "tape"', 'instrument = "TS"')
    (folder / "plan.toml").write_text(text.replace("[limits]", f"{tape}[limits]"))
    with open(folder / "instruments.toml", "a") as file:
        file.write('\n[instruments.tape]\nkind = "tape"\n')
    setup, hung = told(folder)
    assert "setup_rings[1].instrument: tape is a tape; expected a total station" in setup
    assert "tapes[1].instrument: TS is a total station; expected a tape" in hung


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ('datum = "fixed_photo"', "fixed_photo: missing; expected a photograph of the plan"),
        ('datum = "fixed_photo"\nfixed_photo = "R1-99"', "fixed_photo: found 'R1-99'; expected a"),
        ('fixed_photo = "R1-1"', "fixed_photo: given with datum = control; expected only with"),
    ],
)
def test_a_fixed_photograph_of_the_plan(changed, lines, expected):
    (line,) = told(changed(('datum = "control"', lines)))
    assert line.startswith("plan.toml")
    assert f"adjustment.{expected}" in line


def test_a_fixed_photograph_without_photographs(tmp_path):
    folder = with_setups(tmp_path)
    text = (folder / "plan.toml").read_text()
    (folder / "plan.toml").write_text(text.replace('datum = "control"', 'datum = "fixed_photo"'))
    (line,) = told(folder)
    assert line.startswith("plan.toml, row ")
    assert "adjustment.datum: found 'fixed_photo' in a plan without photographs" in line


def test_a_camera_that_sees_no_target(changed):
    """Marks off the wall are seen at any angle, targets under the limit only."""
    folder = changed(("incidence_deg = 74.0", "incidence_deg = 0"))
    with open(folder / "control.csv", "a") as file:
        file.writelines(f"M{k},{14.8 + k / 2},21.5,12.0,,,\n" for k in (2, 3, 4))
    (line,) = told(folder)
    assert "photograph R1-1 sees no target (other points: 3), and 10 more of this ring" in line


def test_decimal_commas_are_reported_with_their_rows(changed):
    lines = told(changed(("length_m = 9.0", "length_m = 9,0")))
    assert len(lines) == 3
    assert all("found 'length_m = 9,0'; expected a decimal point" in line for line in lines)
    (line,) = told(changed(("c_mm = 100.0", "c_mm = 100,0"), file="cameras.toml"))
    assert line.startswith("cameras.toml, row ")
    assert "found 'c_mm = 100,0'; expected a decimal point" in line


def test_names_of_changes_on_the_terminal(changed):
    """Rows of targets have theirs in their names, in changes.csv as well."""
    plan = load_plan(changed(("levels = 1 ", "levels = 2 ")))
    rows = changes_of(plan, ("add", "drop"), ("target_row",))
    found = {cli.planning.describe_change(one) for one in rows}
    assert {"add target row in course 1", "drop target row 1"} <= found
    tape = next(one for one in changes_of(plan, ("drop",), ("tape",)))
    assert cli.planning.describe_change(tape) == "drop tape V1"


def test_too_few_generatrices(changed):
    """Each section of the wall needs as many points as in a job; told once, not by the section."""
    (line,) = told(changed(("generatrices = 24", "generatrices = 4")))
    assert line == (
        "plan.toml, row 30, pattern.generatrices: found 4 points in each section of the wall; "
        "expected at least 5 (10 or more are advised)"
    )
