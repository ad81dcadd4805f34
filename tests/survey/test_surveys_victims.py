"""What is wrong and was kept: held control, a scale; and a search that keeps what it found."""

from dataclasses import replace

import numpy as np
import pytest
from surveyed import by_instruments, by_photographs, changed, known, table, told

from tankcal.adjust import CRITICAL
from tankcal.cli import main
from tankcal.errors import SolutionError
from tankcal.record.adjustment import adjustment_of
from tankcal.record.schema import to_plain
from tankcal.survey import adjust_survey
from tankcal.survey.measurements import Measurements
from tankcal.survey.network import adjust
from tankcal.survey.network.reliability import HELD, alternatives, reactions
from tankcal.survey.network.snooping import set_use
from tankcal.survey.readings import average_readings, contradictory_labels

TRUTH = by_photographs(photos=6)[1].xyz_m, by_instruments()[1].xyz_m


@pytest.fixture(scope="module")
def stations():
    return by_instruments()[0]


@pytest.fixture(scope="module")
def photos():
    return by_photographs(photos=6)[0]


def held(measurements, number=0, error_m=0.0, sd_m=0.0):
    """Measurements with control held fixed, x of one point wrong."""
    control = measurements.control
    xyz = TRUTH[measurements.image_points is None][[int(name[1:]) for name in control.point]]
    xyz[number, 0] += error_m
    sd = np.full_like(control.sd_m, sd_m)
    return replace(measurements, control=replace(control, xyz_m=xyz, sd_m=sd))


@pytest.mark.slow
@pytest.mark.parametrize("error_m", [0.1, pytest.param(2.0, marks=pytest.mark.study)])
def test_a_station_held_at_a_wrong_place_is_named(stations, error_m):
    """Good readings are rejected until the rest agrees with it: sigma0 alone would pass."""
    text = told(held(stations, error_m=error_m))
    name = stations.control.point[0]
    given = TRUTH[1][int(name[1:]), 0]
    assert f"x of {name} is held fixed at {given + error_m:.4f}" in text
    there = float(text.split("but the readings give ")[1].split(";")[0])
    assert there == pytest.approx(given, abs=0.02)  # the station then hangs on few readings


@pytest.mark.slow
def test_held_stations_two_centimetres_apart_from_the_readings(stations):
    """Too little to say which of the three it is: it is said that one of them may be wrong."""
    text = told(held(stations, error_m=0.02))
    assert "held fixed at" in text
    assert "this value, or another one that is held, may be wrong" in text


@pytest.mark.slow
def test_a_control_point_of_photographs_held_at_a_wrong_place(photos):
    """Fixed control 50 mm off: its rays are rejected, and it is said whose they are."""
    name = photos.control.point[0]
    text = told(held(photos, error_m=0.05))
    assert f"values measured to point {name} were rejected" in text
    assert f"x of {name} is held fixed" in text


@pytest.mark.slow
def test_sound_control_is_not_doubted(stations, photos):
    for measurements in (stations, photos):
        text = told(held(measurements))
        assert "held fixed" not in text
        assert "rejected" not in text


@pytest.mark.slow
def test_blunders_alone_do_not_bring_control_into_doubt(stations):
    """One reading in ten wrong by twenty sds, the control right: only the readings are listed."""
    slopes = next(one for one in stations.readings if one.table == "slope_distances")
    value = slopes.value.copy()
    value[::10] += 20 * slopes.sd[::10]
    found = adjust_survey(changed(held(stations), "slope_distances", value=value))
    assert {one.row for one in found.removed} == set(range(2, len(value) + 2, 10))
    assert not [str(one) for one in found.warnings if "held" in str(one)]


@pytest.mark.slow
def test_weighted_control_that_gives_way_to_a_tape_is_reported(stations):
    """The only scale is that of a tape 0.2 % long: coordinates of control go; both are named."""
    plan = next(one for one in stations.readings if one.table == "directions")
    slopes = next(one for one in stations.readings if one.table == "slope_distances")
    places = {one.name: one.station for one in stations.setups}
    truth = by_instruments(noise=0.0)[1].xyz_m
    start = [places[name] for name in slopes.setup][::3]
    end = list(slopes.end)[::3]
    a, b = (truth[[int(name[1:]) for name in names]] for names in (start, end))
    length = 1.002 * np.linalg.norm(b - a, axis=1)
    length += np.random.default_rng(3).normal(0, 0.001, len(length))
    tapes = table("distances", length, 0.001, start, end, instrument=(None,) * len(end))
    zeniths = next(one for one in stations.readings if one.table == "zenith_angles")
    found = adjust_survey(replace(stations, readings=(plan, zeniths, tapes)))
    text = "\n".join(map(str, found.warnings))
    assert "was rejected: given as" in text
    scale = float(text.split("fit if all of them are ")[1].split(" ppm")[0])
    assert scale == pytest.approx(2000, abs=150)


@pytest.mark.slow
def test_held_heights_that_contradict_a_line_of_levels():
    """Closed form: 0 and 1.05 m are held, 1.000 m was levelled between them."""
    start, end = ["A", "A", "A", "M"], ["B", "B", "M", "B"]
    nowhere = [[np.nan, np.nan, 0.0], [np.nan, np.nan, 1.05]]
    text = told(
        Measurements(
            control=known(["A", "B"], nowhere, 0.0),
            readings=(table("height_differences", [1.0, 1.001, 0.5, 0.5], 0.001, start, end),),
        )
    )
    assert "z of A is held fixed at 0.0000" in text
    assert "z of B is held fixed at 1.0500" in text


@pytest.mark.slow
def test_a_search_keeps_what_it_found_when_a_step_fails(photos):
    """Without the only two distances nothing gives the scale: one of them stays, and is named."""
    settings = replace(photos.settings, datum="fixed_photo", fixed_photo=photos.photos[0].name)
    table_of = photos.readings[0]
    value = table_of.value.copy()
    value[1] += 0.5
    few = {name: getattr(table_of, name)[:2] for name in ("start", "end", "rows", "instrument")} | {
        "sd": table_of.sd[:2],
        "check": table_of.check[:2],
        "value": value[:2],
    }
    images = photos.image_points
    points = np.array(images.point)
    rays = {name: int(np.sum(points == name)) for name in images.point}
    wrong = [i for i, name in enumerate(images.point) if rays[name] > 3][::20]
    xy = images.xy_mm.copy()
    xy[wrong] += 0.5
    blundered = replace(
        changed(photos, "distances", **few),
        control=None,
        image_points=replace(images, xy_mm=xy),
        settings=settings,
    )
    found = adjust_survey(blundered)
    gone = {one.row for one in found.removed if one.file == "image_points.csv"}
    assert gone == {i + 2 for i in wrong}
    assert sum(one.file == "distances.csv" for one in found.removed) == 1
    assert not [str(one) for one in found.warnings if "nothing was rejected" in str(one)]


@pytest.mark.slow
def test_one_bad_reading_of_three_is_found_without_any_other():
    """Closed form: two distances fix a point, each read three times, one of the six 1 m off."""
    xyz = {"A": (0.0, 0.0), "B": (10.0, 0.0), "C": (5.0, 8.0)}
    start, end = ["A", "A", "A", "B", "B", "B"], ["C"] * 6
    value = [np.hypot(5, 8) + e for e in (1.0, 1e-4, -1e-4, 0.0, 2e-4, -2e-4)]
    control = known(
        ["A", "B", "C"], [[*xyz["A"], 0], [*xyz["B"], 0], [5.0, 7.9, 0]],
        [[0, 0, 0], [0, 0, 0], [np.nan, np.nan, 0]],
    )  # fmt: skip
    tapes = table("distances", value, 0.001, start, end, horizontal=np.ones(6, dtype=bool))
    found = adjust_survey(
        Measurements(control=control, readings=(replace(tapes, instrument=(None,) * 6),))
    )
    assert [one.row for one in found.removed] == [2]
    assert found.xyz_m[found.names.index("C")] == pytest.approx([5, 8, 0], abs=3e-4)
    assert any("the 3 readings of A-C scatter" in str(one) for one in found.warnings)


def test_only_values_that_one_reading_contradicts_are_torn_apart():
    """Closed form: of four values one has a wild reading, one scatters, one is a pair apart."""
    value = [0, 1, -1, 0, 0, 90, 0, 30, -30, 0, 50]
    label = np.array([0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3])
    means = average_readings(label, np.array(value, dtype=float), np.ones(11))
    torn = contradictory_labels(label, means)
    assert len(set(torn[3:6].tolist())) == 3
    assert torn[9] != torn[10]
    assert np.array_equal(torn[:3], label[:3])
    assert np.array_equal(torn[6:9], label[6:9])


@pytest.mark.slow
def test_detectable_bias_of_reading_set_aside(stations):
    """Property: nearly the figure that the sound reading has in the adjustment with it."""
    sound = {(one.file, one.row): one for one in adjust_survey(stations).readings}
    slopes = next(one for one in stations.readings if one.table == "slope_distances")
    i = max(range(len(slopes.value)), key=lambda i: sound[slopes.file, i + 2].redundancy)
    value = slopes.value.copy()
    value[i] += 0.2
    other = adjust_survey(changed(stations, "slope_distances", value=value)).removed
    assert [one.row for one in other] == [i + 2]
    assert other[0].mdb == pytest.approx(sound[slopes.file, i + 2].mdb, rel=1e-3)


def intersection(stations):
    """A point (5, 4) seen by azimuths from fixed stations, the first azimuth 20 mgon wrong."""
    places = {"A": (0, 0), "B": (10, 0), "C": (5, 12), "D": (-4, 9), "E": (15, 9), "F": (5, -7)}
    xy = np.array([places[name] for name in stations], dtype=float)
    east, north = ([5, 4] - xy).T
    value = np.arctan2(east, north) + np.random.default_rng(1).normal(0, 1e-5, len(xy))
    value[0] += 3e-4
    control = known([*stations, "P"], [*np.pad(xy, ((0, 0), (0, 1))), [5, 4.1, 0]], 0.0)
    control.sd_m[-1] = np.nan
    azimuths = table("azimuths", value, 1e-5, stations, ["P"] * len(xy))
    return adjust_survey(Measurements(control=control, readings=(azimuths,)))


@pytest.mark.slow
def test_wrong_ray_of_three_cannot_be_identified():
    """Closed form: with one redundant ray all three have the same |w|."""
    found = intersection("ABC")
    assert len(found.removed) == 1
    mine = found.removed[0].row - 2
    assert {row for _, row in alternatives(found.adjusted, 0, mine)} == {0, 1, 2} - {mine}
    text = "\n".join(map(str, found.warnings))
    assert any("may equally be" in str(one) for one in found.doubts)
    named = f"azimuth {'ABC'[mine]}-P (row {mine + 2})"
    assert f"{named} was rejected, but the error may equally be in azimuth" in text


@pytest.mark.slow
def test_whatever_may_be_wrong_instead_explains_it_as_well():
    """Second method: each reading in turn is left out in place of the one that was."""
    for stations in ("ABCD", "ABCDEF"):
        found = intersection(stations)
        assert [one.row for one in found.removed] == [2]
        likely = alternatives(found.adjusted, 0, 0)
        size = len(stations)
        whole = adjust(set_use(found.adjusted.survey, {0: np.ones(size)}))
        for row in range(1, size):
            uses = np.ones(size)
            uses[row] = 0.0
            again = adjust(set_use(found.adjusted.survey, {0: uses}))
            agrees = again.residuals[0].test_statistic[0] <= CRITICAL
            assert ((0, row) in likely) == (agrees and whole.chi2 - again.chi2 > CRITICAL**2)
    assert not any("may equally be" in str(one) for one in found.warnings)


@pytest.mark.slow
def test_strict_refuses_what_is_in_doubt(tmp_path, capsys):
    """The first of two readings of a line, or the second: nobody knows."""
    (tmp_path / "job.toml").write_text("[adjustment]\n")
    (tmp_path / "control.csv").write_text(
        "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\nA,0,0,0,0,0,0\nB,10,0,0,0,0,0\nC,5,7.9,0,,,0\n"
    )
    (tmp_path / "distances.csv").write_text(
        "from,to,distance_m,s_mm,kind\nA,C,9.434,1,horizontal\nB,C,9.434,1,horizontal\n"
        "B,C,9.734,1,horizontal\n"
    )
    command = ["run", str(tmp_path), "--only", "adjustment", "--quiet", "--strict"]
    assert main(command) == 3
    error = capsys.readouterr().err
    assert "the error may equally be in distance B-C" in error
    assert "no file was written (--strict)" in error
    assert not (tmp_path / "results").exists()


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.97, pytest.param(1.4, marks=pytest.mark.study)])
def test_a_fixed_principal_distance_that_is_wrong_is_named(photos, factor):
    """A dense net of control on the wall: c follows from the images."""
    setup = photos.cameras[0]
    truth = setup.camera.values[0]
    values = setup.camera.values.copy()
    values[0] *= factor
    fixed = replace(setup.camera, values=values, state=("fixed", *setup.camera.state[1:]))
    cameras = (replace(setup, camera=fixed),)
    text = told(replace(photos, cameras=cameras, photos=photos.photos))
    found = float(text.split("the images fit if c is ")[1].split(" mm")[0])
    assert found == pytest.approx(truth, rel=2e-3)
    assert f"instead of {values[0]:.3f} mm" in text


@pytest.mark.slow
def test_a_check_point_that_disagrees_is_reported(stations):
    name, place = "P0", TRUTH[1][0] + [0.0, 0.05, 0.0]
    text = told(replace(stations, check=known([name], [place], 0.001, file="check.csv")))
    assert "check.csv, row 2, y_m: y of P0 differs by -" in text
    sound = replace(stations, check=known([name], [TRUTH[1][0]], 0.001, file="check.csv"))
    assert "check.csv" not in told(sound)


def test_two_sets_of_one_station_are_one_ray(stations):
    """Property: a point seen twice from one station only is left out by name, not adjusted."""
    plan = next(one for one in stations.readings if one.table == "directions")
    height = next(one for one in stations.readings if one.table == "zenith_angles")
    twice = replace(
        plan,
        value=np.append(plan.value, plan.value + 1e-6),
        sd=np.tile(plan.sd, 2),
        start=plan.start * 2,
        end=plan.end * 2,
        setup=plan.setup * 2,
        set=("1",) * len(plan.end) + ("2",) * len(plan.end),
        check=np.tile(plan.check, 2),
        rows=tuple(range(2, 2 * len(plan.end) + 2)),
    )
    lone = [name for name in plan.end if plan.end.count(name) == 1]
    assert lone
    found = adjust_survey(replace(stations, readings=(twice, height)))
    assert not set(lone) & set(found.names)
    text = "\n".join(map(str, found.warnings))
    assert f"point {lone[0]} has too few observations" in text


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_agreeing_reading_is_taken_back(seed):
    """Property: six rays to one point, two of them wrong; whatever is out disagrees in the end."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-20, 20, (6, 2))
    names = [f"S{i}" for i in range(6)]
    value = np.arctan2(*(-xy).T) + rng.normal(0, 1e-4, 6)
    value[:2] += [8e-4, -6e-4]
    control = known([*names, "P"], np.pad([*xy, [0.0, 0.1]], ((0, 0), (0, 1))), 0.0)
    control.sd_m[-1] = np.nan
    azimuths = table("azimuths", value, 1e-4, names, ["P"] * 6)
    found = adjust_survey(Measurements(control=control, readings=(azimuths,)))
    assert all(abs(one.w) > 3.29 for one in found.removed)


@pytest.mark.slow
def test_every_held_coordinate_has_a_row_with_its_test(stations):
    """Property: the row of a held coordinate says what adjusting without it says."""
    measurements = held(stations, error_m=0.004)
    measurements = replace(measurements, settings=replace(measurements.settings, snooping=False))
    found = adjust_survey(measurements)
    rows = [one for one in found.readings if one.kind == "control coordinate"]
    assert [(one.ids[0], one.element) for one in rows] == [
        (name, axis) for name in stations.control.point for axis in "xyz"
    ]
    record = to_plain(adjustment_of(found, measurements))
    assert [row["ids"] for row in record["held"]] == [list(one.ids) for one in rows]
    assert all(row["controlled"] for row in record["held"])
    control = measurements.control
    free = replace(control, sd_m=control.sd_m.copy())
    free.sd_m[0, 0] = np.nan
    again = adjust_survey(replace(measurements, control=free))
    place = again.names.index(control.point[0])
    released, sd = again.xyz_m[place, 0], np.sqrt(again.covariance_m2[place, 0, 0])
    assert record["held"][0]["released"] == pytest.approx(released, abs=2e-6)
    assert record["held"][0]["sd"] == pytest.approx(sd, rel=1e-3)
    assert rows[0].w == pytest.approx((released - control.xyz_m[0, 0]) / sd, rel=1e-3)
    assert not [one for one in found.groups if one.kind == "control coordinate"]


@pytest.mark.slow
def test_wrong_held_coordinate_does_not_cost_sound_readings():
    """A point of many rays held 20 mm off: all its rays would go; it is asked, not gone on."""
    measurements, truth = by_photographs(photos=16)
    control = measurements.control
    xyz = truth.xyz_m[[int(name[1:]) for name in control.point]]
    xyz[3, 0] += 0.02
    wrong = replace(control, xyz_m=xyz, sd_m=np.zeros_like(xyz))
    with pytest.raises(SolutionError) as told_so:
        adjust_survey(replace(measurements, control=wrong))
    first, *causes = str(told_so.value).splitlines()
    rays = 2 * measurements.image_points.point.count(control.point[3])
    assert rays > 8
    gone, left = (int(text.split()[0]) for text in (first.split("would set ")[1],
                                                    first.split("but at most ")[1]))  # fmt: skip
    assert gone >= rays > left
    held_at = [line for line in causes if "is held fixed at" in line]
    assert len(held_at) == 1
    assert f"x of {control.point[3]} is held fixed at {xyz[3, 0]:.4f}" in held_at[0]


def corners(error_m, seed=6):
    """Four held corners, four points between them by 3 mm distances; x of one corner is wrong."""
    rng = np.random.default_rng(seed)
    outer = np.array([[0.0, 0], [100, 0], [100, 80], [0, 80]])
    xy = np.vstack([outer, rng.uniform(15, 65, (4, 2))])
    names = [*"ABCD", "P", "Q", "R", "S"]
    pairs = [(i, j) for j in range(4, 8) for i in range(j)]
    length = [np.linalg.norm(xy[i] - xy[j]) + rng.normal(0, 0.003) for i, j in pairs]
    tapes = table(
        "distances", length, 0.003, [names[i] for i, _ in pairs], [names[j] for _, j in pairs],
        instrument=(None,) * len(pairs), horizontal=np.ones(len(pairs), dtype=bool),
    )  # fmt: skip
    control = known(names, np.pad(xy, ((0, 0), (0, 1))), 0.0)
    control.sd_m[4:, :2] = np.nan
    control.xyz_m[1, 0] += error_m
    return Measurements(control=control, readings=(tapes,))


@pytest.mark.slow
@pytest.mark.parametrize("error_m", [0.015, 0.025, 0.06])
def test_every_held_coordinate_that_explains_as_much_is_named(error_m):
    """Second method: each of the eight is released by hand, and what fits within 10.8 is named."""
    measurements = corners(error_m)
    off = replace(measurements.settings, snooping=False)
    control, fits = measurements.control, {}
    for i, name in enumerate("ABCD"):
        for k, axis in enumerate("xy"):
            sd = control.sd_m.copy()
            sd[i, k] = np.nan
            free = replace(measurements, control=replace(control, sd_m=sd), settings=off)
            fits[f"{axis} of {name}"] = adjust_survey(free).adjusted.chi2
    best = min(fits.values())
    expected = {name for name, chi2 in fits.items() if chi2 - best < CRITICAL**2}
    assert "x of B" in expected
    text = told(replace(measurements, settings=off))
    named = {name for name in fits if f"{name} is held fixed at" in text}
    assert named == expected


@pytest.mark.slow
def test_wrong_corner_that_costs_readings_is_questioned():
    text = told(corners(0.2))
    assert text.startswith("the search for blunders would set ")
    assert "x of B is held fixed at 100.2000, but the readings give " in text


@pytest.mark.slow
def test_held_point_may_be_wrong_instead_of_its_reading():
    """Property: what was rejected is told with the held coordinates that explain it as well."""
    measurements = corners(0.0)
    tapes = measurements.readings[0]
    value = tapes.value.copy()
    place = next(i for i, ends in enumerate(zip(tapes.start, tapes.end, strict=True))
                 if ends == ("B", "P"))  # fmt: skip
    value[place] += 0.03
    found = adjust_survey(changed(measurements, "distances", value=value))
    held_too = reactions(
        found.adjusted.problem, found.adjusted.solution, found.adjusted.survey.fixed
    )
    for one in found.removed:
        for source, row in alternatives(found.adjusted, 0, one.row - 2, held_too):
            survey = found.adjusted.survey
            uses = np.ones(len(tapes.value))
            uses[[other.row - 2 for other in found.removed if other is not one]] = 0.0
            fixed = survey.fixed.copy()
            if source == HELD:
                fixed.flat[row] = False
            else:
                uses[row] = 0.0
            again = adjust(set_use(replace(survey, fixed=fixed), {0: uses})).residuals[0]
            assert again.test_statistic[again.rows == one.row - 2] < CRITICAL * 1.01
