"""Plans of walls by tape, lines and hits: the job that they foresee, what helps, what is refused.

Truth: the empty job filled in and run; jobs on generated walls that are no model of the package;
curvature of the likelihood over draws; monotony.
"""

import json
from dataclasses import replace

import numpy as np
import openpyxl
import pytest
from draws import draws
from generated_hits import hit_job
from generated_lines import plumbed_job
from generated_strapping import strapped_job
from generated_tangents import tangent_job
from generated_walls import make_wall
from messages_told import lines
from wall_plan_folders import HITS, LINES, TANGENTS, fill, plan_of

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.geometry.field.amplitudes import assumed_amplitudes, likelihood_of
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.sites import Sites
from tankcal.methods.tangents.wall import touch_wall
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.table import compute_table
from tankcal.planning import load_plan, predict, smallest, what_helps
from tankcal.planning.improvements import Effect, changes_of
from tankcal.planning.model import PlannedHits, PlannedStrap, even_radius_m, evenness_of_limbs
from tankcal.planning.wall.changes import instruments_in_use, wall_changes_of
from tankcal.planning.wall.design_tables import tangent_sight
from tankcal.planning.wall.nominal_readings import expect_amplitudes, set_nominal_readings
from tankcal.planning.wall.prediction import predict_wall_table
from tankcal.planning.wall.reading import change_plan, tables_of
from tankcal.record.plan import WALL_PLAN, plain_of_wall
from tankcal.report.planning import empty_job, figures, files
from tankcal.report.planning.empty_job import form_of_wall
from tankcal.report.planning.rows import field_tables_of_wall
from tankcal.report.planning.wall_paper import WallPaper, wall_outlook, wall_sheets

STRAPS_ALONE = (
    ('courses = ["1"]\nat_percent = [20]\nreadings = 3\n', ""),
    ("[lines]\ncount = 12\nat_percent = [20, 80]\ns_mm = 0.5\nfaces = 2\n", ""),
)


@pytest.fixture(scope="module", params=[LINES, HITS, TANGENTS], ids=["lines", "hits", "tangents"])
def prediction(request):
    return predict(load_plan(request.param))


@pytest.mark.slow(after=2)
def test_limbs_and_untied_setups_leave_sizes_that_tell_nothing_of_each_other(prediction):
    """As of the jobs, so that a plan foretells their U."""
    plan, covariance = prediction.plan, prediction.plan.amplitudes.log_covariance
    apart = np.all(covariance == np.diag(np.diag(covariance)))
    design = plan.design
    ring = PlannedHits(setups=3, radius_m=1.0, hits=8, at_percent=(50,), courses=("1",))
    assert apart == (design.tangents is not None) == design.is_smoothed
    assert replace(design, hits=(ring,), ties=None).is_smoothed
    assert replace(design, hits=(ring,), ties=(3, 0.6, 3.0)).is_smoothed == apart


@pytest.mark.slow
def test_the_empty_job_filled_in_is_the_plan(prediction, tmp_path):
    """Its U with the plan's amplitudes is the prediction's, in every row."""
    plan = prediction.plan
    empty_job.write_wall(prediction, tmp_path / "job")
    settings = {
        "date": '"2026-07-01"',
        "shell_temperature_c": plan.job.survey.shell_temperature_c,
        "bottom_z_m": 0.0,
    }
    fill(tmp_path / "job", plan.job, settings)
    job = tankcal.load(tmp_path / "job")
    found = predict_wall_table(job, plan.amplitudes).computed_table.table
    np.testing.assert_allclose(found.U_m3, prediction.table.U_m3, rtol=1e-8)
    np.testing.assert_allclose(found.volume_m3, prediction.table.volume_m3, rtol=1e-9)


def job_on(kind, wall, rng, folder):
    """A Job on a generated wall."""
    if kind == "straps":
        return strapped_job(rng, wall, straps=2, folder=folder, shape_sd_m=0.004)
    if kind == "lines":
        job = plumbed_job(rng, wall, lines=12, folder=folder)[0]
        return replace(job, strapping=replace(job.strapping, shape_sd_m=0.004))
    return hit_job(rng, wall, folder=folder, hits=16)


def about_its_axis(job, wall):
    """The job, the stations of its hits told from the axis of the tank that it found."""
    if job.hits is None:
        return job
    x, y = wall.shell.axis_m
    return replace(job, hits=replace(job.hits, stations={"SI": np.array([-x, -y, 0.0])}))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "most"), [("straps", 1e-3), ("lines", 1e-3), ("hits", 1e-2)])
def test_u_is_that_of_a_job_but_for_the_amplitudes_that_it_learns(tmp_path, kind, most):
    """Jobs on generated walls: with the amplitudes that they learned the plan's U over volume is
    theirs; what is left is the real wall, its lean and its place, and a hit that was rejected (of
    six walls hit at most 0.65 %, mostly where the first few levels alone bear on a row).
    """
    for family in ("coil", "chord"):
        rng = np.random.default_rng(3)
        wall = make_wall(rng, family, radius_m=7.5, courses=6)
        job = job_on(kind, wall, rng, tmp_path / kind)
        found = find_survey(job, lambda text: None)
        table = compute_table(found.job, found.survey).table
        learned = found.survey.field.amplitudes
        nominal = set_nominal_readings(about_its_axis(job, found.survey), learned)
        same = find_survey(nominal, lambda text: None, learned)
        foreseen = compute_table(same.job, same.survey).table
        rows = slice(10, min(len(table.U_m3), len(foreseen.U_m3)))
        ours = table.U_m3[rows] / table.volume_m3[rows]
        theirs = foreseen.U_m3[rows] / foreseen.volume_m3[rows]
        np.testing.assert_allclose(ours, theirs, rtol=most)


def table_of_limbs(job, poses, tools, amplitudes=None):
    """The wall that limbs show, its table, and the `Touching`."""
    job, touching, wall = touch_wall(job, poses, tools, lambda text: None, amplitudes=amplitudes)
    return wall, compute_table(job, wall).table, touching


def seen_as_planned(job, poses, wall, touching):
    """The job with sights past a circle of the nominal size about the axis that it found, at the
    heights where they touched: those of a wall that is not round scatter about their levels.
    """
    tangents, (x, y) = job.tangents, wall.shell.axis_m
    place = poses.place_of(tangents)
    station = poses.xyz_m[place] - [x, y, 0]
    radius = job.tank.nominal_diameter_m / 2
    z = touching.points.xyz_m[:, 2]
    sights = [
        tangent_sight(*one)
        for one in zip(station, z, z * 0 + radius, tangents.is_right, strict=True)
    ]
    azimuth = np.radians([one["direction_deg"] for one in sights])
    zenith = np.radians([one["zenith_deg"] for one in sights])
    turned = azimuth - poses.orientation_rad[place]
    return replace(job, tangents=replace(tangents, direction_rad=turned, zenith_rad=zenith))


@pytest.mark.slow
def test_u_of_tangents_is_that_of_a_job_but_for_the_amplitudes_that_it_learns(tmp_path):
    """As of straps, lines and hits: generated walls, sights that just touch them."""
    for family in ("coil", "chord"):
        rng = np.random.default_rng(3)
        wall = make_wall(rng, family, radius_m=7.5, courses=6)
        job, *known = tangent_job(rng, wall, folder=tmp_path / "limbs", stations=8)
        found, table, touching = table_of_limbs(job, *known)
        planned = seen_as_planned(job, known[0], found, touching)
        _, foreseen, _ = table_of_limbs(planned, *known, found.field.amplitudes)
        rows = slice(10, min(len(table.U_m3), len(foreseen.U_m3)))
        ours = table.U_m3[rows] / table.volume_m3[rows]
        theirs = foreseen.U_m3[rows] / foreseen.volume_m3[rows]
        np.testing.assert_allclose(ours, theirs, rtol=2e-2)


def without_undecided(table):
    """The table without columns that may be a fitting: what a plan sights is a sound wall."""
    known = tuple(one for one in table.sources if one.kind != "undecided")
    return replace(table, sources=known)


@pytest.mark.study
def test_u_of_tangents_on_generated_walls_study(tmp_path, figure):
    """How far U of a job by tangents is from that of its plan, by what it learns of its wall: where
    that is rougher than walls are assumed to be, U is larger, for hulls stand out farther. A ridge
    that one column of limbs alone meets may be a pipe, and widens U beyond that: seldom.
    """
    ratios, same, widened = [], [], []
    for family in ("coil", "brick", "dents", "buckle", "chord"):
        for seed in range(draws(1, 6)):
            rng = np.random.default_rng(seed)
            wall = make_wall(rng, family, radius_m=7.5, courses=6)
            job, *known = tangent_job(rng, wall, folder=tmp_path / "limbs", stations=8)
            found, table, touching = table_of_limbs(job, *known)
            planned, amplitudes = (
                seen_as_planned(job, known[0], found, touching),
                assumed_amplitudes(smoothed=True),
            )
            first, _, _ = table_of_limbs(planned, *known, amplitudes)
            expected = expect_amplitudes(first.field)
            _, foreseen, _ = table_of_limbs(planned, *known, expected)
            ratios.append(table.U_m3[-1] / foreseen.U_m3[-1])
            _, learned, _ = table_of_limbs(planned, *known, found.field.amplitudes)
            decided = without_undecided(table).U_m3[-1]
            same.append(decided / learned.U_m3[-1])
            widened.append(table.U_m3[-1] / decided)
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
    figure("U of jobs by tangents over that of their plans", np.round([low, middle, high], 2))
    figure("the same with the amplitudes that they learned, largest", np.round(np.max(same), 4))
    figure("U of jobs by tangents, by undecided columns, largest", np.round(np.max(widened), 4))
    assert 0.6 < middle < 1.1  # these walls have less seams than are assumed before a survey
    # a job bends its levels by what its limbs show of the form, which a plan does not foresee
    np.testing.assert_allclose(np.median(same), 1, atol=0.005)
    np.testing.assert_allclose(same, 1, atol=0.05)
    assert np.mean(np.array(widened) > 1.02) < 0.1


@pytest.mark.study
def test_u_of_jobs_on_generated_walls_study(tmp_path, figure):
    """How far U of a job is from that of its plan, by what it learns of its wall."""
    for kind in ("straps", "lines", "hits"):
        ratios = []
        for family in ("coil", "brick", "dents", "buckle", "chord"):
            for seed in range(draws(2, 6)):
                rng = np.random.default_rng(seed)
                wall = make_wall(rng, family, radius_m=7.5, courses=6)
                job = job_on(kind, wall, rng, tmp_path / kind)
                found = find_survey(job, lambda text: None)
                u = compute_table(found.job, found.survey).table.U_m3[-1]
                amplitudes = assumed_amplitudes()
                nominal = set_nominal_readings(about_its_axis(job, found.survey), amplitudes)
                ratios.append(
                    u / predict_wall_table(nominal, amplitudes).computed_table.table.U_m3[-1]
                )
        figure(f"U of jobs by {kind} over that of their plans", np.round(np.median(ratios), 2))
        assert 0.7 < np.median(ratios) < 1.1
        # by hits of one set-up on a wall with 7 mm of ovality, which a plan does not assume: 1.53;
        # 1.25 before the wall had settlement, which shares that ovality until a fit of it is sure
        assert np.max(ratios) < 1.6


@pytest.mark.slow
def test_expected_information_is_the_mean_curvature():
    """Simulation: walls drawn with the assumed sizes, curvature of their likelihood."""
    azimuth = np.tile(2 * np.pi * np.arange(10) / 10, 6)
    course, zeta = np.repeat([0, 0, 1, 1, 2, 2], 10), np.repeat([-0.6, 0.6] * 3, 10)
    ring = np.repeat(np.arange(6), 10)
    sites = Sites(course, ring, zeta, azimuth, np.zeros(60, dtype=bool))
    noise, amplitudes = 1e-6 * np.eye(60), assumed_amplitudes()
    field = WallField(sites, np.full(60, 7.0), noise, amplitudes, 7.0)
    sure = replace(amplitudes, log_covariance=np.zeros_like(amplitudes.log_covariance))
    likely = replace(field, amplitudes=sure)
    root, rng = np.linalg.cholesky(likely.covariance_m2), np.random.default_rng(1)
    logs, step, found = np.log(amplitudes.likely_m2), 0.05, 0.0
    draws = 400
    for _ in range(draws):
        drawn = likelihood_of(sites, 7.0 + root @ rng.normal(size=60), noise, 7.0, False)
        slopes = [
            (drawn.misfit(logs + step * one)[1] - drawn.misfit(logs - step * one)[1]) / step / 4
            for one in np.eye(len(logs))
        ]
        found = found + np.array(slopes) / draws
    told = np.linalg.inv(expect_amplitudes(field).log_covariance)
    np.testing.assert_allclose(found, told, atol=0.15 * np.sqrt(np.diag(told)).max())


@pytest.mark.slow
def test_a_further_strap_never_widens_u(prediction):
    plan, rng = prediction.plan, np.random.default_rng(0)
    for _ in range(3):
        course = str(rng.integers(1, len(plan.job.courses) + 1))
        one = PlannedStrap(course, float(rng.integers(2, 98)), 0.5, more=(("instrument", "T-12"),))
        design = replace(plan.design, straps=(*plan.design.straps, one))
        after = predict(change_plan(plan, design)).table
        assert after.U_m3[-1] < prediction.table.U_m3[-1]
        assert np.all(after.U_m3[1:] <= prediction.table.U_m3[1:] * (1 + 1e-6))


@pytest.mark.slow
def test_a_further_strap_of_a_tank_that_is_strapped_alone(tmp_path):
    """U of the full tank never widens; below, a course is a cylinder of the mean of its straps,
    which is not the best estimate at each height: there U may widen, by little.
    """
    plan = load_plan(plan_of(tmp_path, LINES, *STRAPS_ALONE))
    before, rng = predict(plan).table.U_m3, np.random.default_rng(0)
    for _ in range(6):
        course = str(rng.integers(1, 7))
        one = PlannedStrap(course, float(rng.integers(2, 98)), 0.5, more=(("instrument", "T-12"),))
        design = replace(plan.design, straps=(*plan.design.straps, one))
        after = predict(change_plan(plan, design)).table.U_m3
        assert after[-1] < before[-1]
        assert np.all(after[1:] < 1.03 * before[1:])


def kinds_of(prediction):
    """Inputs of the predicted table."""
    return {source.kind for source in prediction.table.sources}


@pytest.mark.slow
def test_what_helps_is_ranked_and_says_what_it_costs(prediction):
    effects = what_helps(prediction.plan, before=prediction)
    works = [one for one in effects if not one.why]
    assert [one.relative_u for one in works] == sorted(one.relative_u for one in works)
    adds = [one for one in works if one.change.action in ("add", "repeat")]
    assert all(one.difference <= 1e-9 for one in adds)
    # The excess of the hull is the mean of random walls: other seeds change U of this plan by 0.2
    # to 1.7 %, so a dropped station that hardly matters may seem to lower it.
    drawn = 0.002 * prediction.relative_u if "tangent_excess" in kinds_of(prediction) else 1e-9
    assert all(one.difference >= -drawn for one in works if one.change.action == "drop")
    strap = next(one for one in works if (one.change.action, one.change.item) == ("add", "strap"))
    assert strap.change.cost == pytest.approx(15.5 * strap.change.name.count("-"))


@pytest.mark.slow
def test_the_second_face_replaces_a_certificate(tmp_path):
    """With one face and a certificate the plummet's lean is a line of the budget."""
    folder = plan_of(tmp_path, LINES, ("faces = 2", "faces = 1"))
    with pytest.raises(InputError, match="u_collimation_arcsec"):
        load_plan(folder)
    path = folder / "instruments.toml"
    path.write_text(path.read_text() + "u_collimation_arcsec = 10\n")
    plan = load_plan(folder)
    found = predict(plan)
    assert "collimation" in {one.kind for one in found.table.sources}
    effects = what_helps(plan, before=found)
    face = next(one for one in effects if one.change.item == "face")
    better = next(one for one in effects if one.change.name == "ZL-3")
    assert face.change.action == "add"
    assert face.relative_u < better.relative_u < found.relative_u


@pytest.mark.slow
def test_the_smallest_design_meets_its_limit(tmp_path):
    plan = load_plan(plan_of(tmp_path, LINES, ("relative_u = 0.0004", "relative_u = 0.00047")))
    path = smallest(plan)
    assert path.prediction.meets
    assert path.steps
    assert path.relative_u <= 0.00047 < path.start_u


@pytest.mark.slow
def test_set_ups_round_the_tank_that_share_targets(tmp_path):
    """Tied set-ups need no strap where the offset is known; untied ones that see a part do less."""
    pairs = (
        ('side = "inside"', 'side = "outside"'),
        ("setups = 1\nradius_m = 1.5 ", "setups = 4\nradius_m = 14 "),
        ("hits = 20 ", "hits = 9 "),
    )
    loose = predict(load_plan(plan_of(tmp_path / "loose", HITS, *pairs)))
    ties = ("[limits]", "[setup_ties]\ntargets = 3\ns_mm = 1\ns_arcsec = 3\n\n[limits]")
    tied = predict(load_plan(plan_of(tmp_path / "tied", HITS, *pairs, ties)))
    assert {*loose.result.sighting.poses.ties} == {"wall"}
    assert {*tied.result.sighting.poses.ties} == {"network"}
    assert tied.relative_u < loose.relative_u


@pytest.mark.parametrize("stations", [5, 8, 9, 12])
def test_an_even_ring_touches_the_wall_evenly(stations):
    """Closed form: all normals of the limbs are as far apart as those of twice as many stations."""
    radius = even_radius_m(stations, 12.0, 6.0, 6.0)
    place = 2 * np.pi * np.arange(stations) / stations
    normals = np.concatenate([place - np.arccos(6.0 / radius), place + np.arccos(6.0 / radius)])
    gaps = np.diff(np.sort(normals % (2 * np.pi)))
    np.testing.assert_allclose(gaps, np.pi / stations, rtol=1e-9)
    assert evenness_of_limbs(stations, radius, 6.0) == pytest.approx(0.5)


@pytest.mark.slow
def test_limbs_on_the_same_places_are_told(tmp_path):
    """Nine stations at 12.5 m see nine places of this wall, and U is wider than of eight."""
    folder = plan_of(tmp_path / "plan", TANGENTS, ("stations = 8", "stations = 9"))
    told = lines(load_plan(folder).warnings)
    assert any("tangents.radius_m" in one and "9.49 m they lie evenly" in one for one in told)
    assert not load_plan(TANGENTS).warnings


@pytest.mark.slow
def test_a_shorter_certificate_of_the_ranger_is_the_radius(tmp_path):
    """Closed form: 1e-4 of the distances of a traverse is 1e-4 of the radius, 2e-4 of U."""
    text = (TANGENTS / "instruments.toml").read_text(encoding="utf-8")
    folder = plan_of(tmp_path / "plan", TANGENTS)
    text = text.replace("u_scale_ppm = 5.0", "u_scale_ppm = 100\ncorrection = 3e-4")
    (folder / "instruments.toml").write_text(text, encoding="utf-8")
    found = predict(load_plan(folder))
    scale = next(one for one in found.table.sources if one.kind == "instrument_scale")
    volume = found.table.volume_m3[-1]
    assert np.linalg.norm(scale.columns_m3[-1]) / volume == pytest.approx(2e-4, rel=0.02)
    np.testing.assert_allclose(volume, predict(load_plan(TANGENTS)).table.volume_m3[-1], rtol=2e-6)


BAD = {
    "no s": (LINES, "s_mm = 0.4\n", "", ("plan.toml", "straps[1].s_mm")),
    "course": (LINES, 'courses = ["1"]', 'courses = ["9"]', ("plan.toml", "straps[1].courses")),
    "percent": (LINES, "at_percent = [20]", "at_percent = [120]", None),
    "few lines": (LINES, "count = 12", "count = 3", ("plan.toml", "lines")),
    "tape": (LINES, 'instrument = "T-12"', 'instrument = "T-99"', ("plan.toml", "straps")),
    "targets, too": (LINES, "[lines]", "[pattern]\ngeneratrices = 8\n[lines]", None),
    "no strap": (LINES, "[[straps]]", "[[hits]]", None),
    "key": (LINES, "faces = 2", "face = 2", ("plan.toml", "lines.face")),
    "half": (LINES, "count = 12", "count = 12.5", ("plan.toml", "lines.count")),
    "many": (
        HITS,
        "hits = 20                          # at each height\nat_percent = [20, 80]",
        "hits = 400\nat_percent = [5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80]",
        ("plan.toml", "hits"),
    ),
    "on the wall": (HITS, "radius_m = 1.5 ", "radius_m = 7.0 ", ("plan.toml", "hits[1].radius_m")),
    "no traverse": (
        TANGENTS,
        "[traverse]\ns_mm = 0.5\ns_arcsec = 2\n",
        "",
        ("plan.toml", "tangents"),
    ),
    "traverse alone": (
        LINES,
        "[limits]",
        "[traverse]\ns_mm = 1\ns_arcsec = 3\n[limits]",
        ("plan.toml", "traverse"),
    ),
    "no limb": (TANGENTS, "stations = 8", "stations = 2", ("plan.toml", "tangents.stations")),
    "blind": (TANGENTS, "radius_m = 12.5", "radius_m = 6.3", ("plan.toml", "tangents.radius_m")),
    "level": (TANGENTS, "[20, 80]", "[20, 180]", ("plan.toml", "tangents.at_percent")),
    "inside": (TANGENTS, '"outside"', '"inside"', ("uncertainty.csv", "input")),
    "tangents and lines": (LINES, "[limits]", "[tangents]\nstations = 8\n[limits]", None),
    "ranger": (TANGENTS, 'instrument = "TS"', 'instrument = "TX"', ("plan.toml", "tangents")),
    "ties alone": (
        LINES,
        "[limits]",
        "[setup_ties]\ntargets = 3\ns_mm = 1\ns_arcsec = 3\n[limits]",
        ("plan.toml", "setup_ties"),
    ),
}


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_each(tmp_path, name, capsys):
    source, old, new, place = BAD[name]
    folder = plan_of(tmp_path / "plan", source, (old, new))
    status = main(["plan", str(folder), "--quiet"])
    told = capsys.readouterr().err
    assert status in (2, 3)
    assert "Traceback" not in told
    if place is not None:
        with pytest.raises(InputError) as error:
            load_plan(folder)
        assert place in {(one.file, one.column) for one in error.value.problems}


def test_side_that_no_set_up_is_on_is_told_of_the_plan(tmp_path):
    """What the chain says of settings is said of plan.toml: a plan has no job.toml."""
    text = (HITS / "plan.toml").read_text(encoding="utf-8")
    side, other = ("inside", "outside") if 'side = "inside"' in text else ("outside", "inside")
    folder = plan_of(tmp_path / "plan", HITS, (f'side = "{side}"', f'side = "{other}"'))
    with pytest.raises(InputError) as error:
        predict(load_plan(folder))
    assert {one.file for one in error.value.problems} <= {"plan.toml", "uncertainty.csv"}


CONTROL = "[control_targets]\nevery_min = 45\n[limits]"
TOLD = [  # of a plan, what is changed in it, the whole line in the column
    (HITS, "hits = 20 ", "hits = 2 ", "hits[1].hits: found 2; expected 3 or more"),
    (HITS, "hits = 20 ", "hits = 600 ", "expected a whole number from 1 to 500"),
    (LINES, "at_percent = [20]", "at_percent = [180]", "such as 20; 80 (in"),
    (TANGENTS, "radius_m = 12.5", "radius_m = 6.6", "expected 7.11 m or more: the lines between 8"),
    (
        TANGENTS,
        "stations = 8\nradius_m = 12.5                    # from the axis of the tank\n"
        "height_m = 1.5\nat_percent = [20, 80]",
        "stations = 60\nradius_m = 12.5\nheight_m = 1.5\nreadings = 20\nat_percent = [20, 50, 80]",
        "36000 tangents; expected at most",
    ),
    (LINES, "count = 12", "count = 200", "lines: 4800 offsets; expected at most 2000"),
    (LINES, "count = 12", "count = 1", "plan.toml, row"),
    (LINES, "[[straps]]", "[[strap]]", "[[strap]]: unknown section (did you mean straps?)"),
    (HITS, "hits = 20 ", "spread_deg = 0\nhits = 20 ", "found 0; expected a number above 0"),
    (LINES, "[limits]", CONTROL, "control_targets: given without [[hits]]; expected set-ups of"),
    (HITS, "[limits]", CONTROL.replace("45", "0"), "found 0; expected a number from 5 to 240"),
]


@pytest.mark.parametrize(("source", "old", "new", "words"), TOLD)
def test_what_is_told_names_the_key_and_what_it_may_be(tmp_path, source, old, new, words):
    folder = plan_of(tmp_path / "plan", source, (old, new))
    with pytest.raises(InputError) as error:
        load_plan(folder)
    told = lines(error.value.problems)
    assert any(words in one for one in told), told


def test_a_plan_without_any_section_is_told_of_all_kinds(tmp_path):
    folder = plan_of(tmp_path / "plan", LINES)
    text = (folder / "plan.toml").read_text(encoding="utf-8")
    for section in ("[[straps]]", "[lines]"):
        start = text.index(section)
        text = text[:start] + text[text.index("\n[", start) + 1 :]
    while "[[straps]]" in text:
        start = text.index("[[straps]]")
        text = text[:start] + text[text.index("\n[", start) + 1 :]
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_plan(folder)
    (nothing,) = lines(error.value.problems)
    assert nothing.startswith("plan.toml: nothing is measured; expected a [pattern] of targets, or")


MISSPELT = [  # of a plan, sections, how they are spelt
    (LINES, {"[[straps]]": "[[strap]]", "[lines]": "[line]"}),
    (HITS, {"[[hits]]": "[[hit]]", "[limits]": "[limit]", "[datum]": "[dattum]"}),
    (TANGENTS, {"[tangents]": "[tangent]", "[traverse]": "[travers]", "[costs]": "[cost]"}),
]


@pytest.mark.parametrize(("source", "names"), MISSPELT)
def test_a_misspelt_section_is_told_once_and_read_as_it_was_meant(tmp_path, source, names):
    """What is wrong within it is told in the same run, in its row."""
    folder = plan_of(tmp_path / "plan", source, *names.items())
    with pytest.raises(InputError) as error:
        load_plan(folder)
    assert len(error.value.problems) == len(names)
    assert {one.partition("mean ")[2] for one in lines(error.value.problems)} == {
        f"{name.strip('[]')}?)" for name in names
    }
    path = folder / "plan.toml"
    text = path.read_text(encoding="utf-8").replace("at_percent = [20, 80]", "at_percent = [200]")
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_plan(folder)
    rows = {one.row for one in error.value.problems if "at_percent" in (one.column or "")}
    wanted = [n for n, line in enumerate(text.splitlines(), 1) if line == "at_percent = [200]"]
    assert rows == set(wanted)


@pytest.mark.parametrize(("more", "times"), [
    ("", [0, 17, 34]),
    ("[control_targets]\ntargets = 3\nevery_min = 15\nminutes = 40\n", [0, 13, 26, 40]),
])  # fmt: skip
def test_control_targets_are_read_at_the_start_again_and_at_the_end(tmp_path, more, times):
    """Closed form: 200 hits of 10 s are 34 minutes; no two rounds are further apart than asked."""
    folder = plan_of(tmp_path / "plan", HITS, ("[limits]", more + "[limits]"))
    plan = load_plan(folder)
    table = tables_of(plan)["control_readings"]
    at = {column: [row[k] for row in table.rows] for k, column in enumerate(table.headings)}
    targets = 3 if more else 2
    assert len(set(at["target"])) == targets
    assert [60 * int(one[11:13]) + int(one[14:16]) for one in at["time"][::targets]] == times
    assert len(plan.job.hits.control) == targets * len(times)
    (rows, _) = field_tables_of_wall(plan)["control_targets"]
    assert [one["after_min"] for one in rows[::targets]] == times
    (empty,) = (form_of_wall(plan).given[name] for name in ("control_readings",))
    assert {one["time"] for one in empty} == {one["distance_m"] for one in empty} == {""}


@pytest.mark.slow
def test_three_hits_at_two_heights_are_enough(tmp_path):
    """The least that is accepted does give a prediction."""
    folder = plan_of(tmp_path / "plan", HITS, ("hits = 20 ", "hits = 3 "))
    assert predict(load_plan(folder)).relative_u > 0


@pytest.mark.slow
def test_files_of_a_plan(tmp_path, capsys):
    """Papers in the asked language, plan.json by its schema; a filled job is never replaced."""
    out = tmp_path / "out"
    assert main(["plan", str(LINES), "--out", str(out), "--language", "es", "--quiet"]) == 0
    assert "anillo 1: u del radio medio" in capsys.readouterr().out
    saved = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    assert WALL_PLAN.migrated(saved, "plan.json")["survey"]["offsets"] == 288
    assert {one.name for one in out.iterdir()} >= {
        *("prediction.pdf", "field-sheets.pdf", "field-sheets.xlsx", "job")
    }
    assert main(["plan", str(LINES), "--out", str(out), "--quiet"]) == 0
    path = out / "job" / "circumferences.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("1-20,1,0.36,,", "1-20,1,0.36,47.9,"))
    assert main(["plan", str(LINES), "--out", str(out), "--quiet"]) == 2


@pytest.mark.slow
def test_plain_data_have_what_the_prediction_has(prediction):
    found = plain_of_wall(prediction)
    assert found["table"]["U_m3"] == prediction.table.U_m3.tolist()
    assert [one["name"] for one in found["courses"]] == [
        one.name for one in prediction.plan.job.courses
    ]


@pytest.mark.slow
def test_nothing_is_said_of_costs_that_nobody_gave(tmp_path, capsys):
    costs = "[costs]\nstrap = 15\nsetup = 40\nreading = 0.5\n"
    folder = plan_of(tmp_path / "plan", TANGENTS, (costs, ""))
    assert main(["plan", str(folder), "--changes", "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "ppm)" in said
    assert "cost" not in said


SHEETS = {  # of a plan: sheets of its workbook, and how many rows they have
    LINES: {"Circumferences": 3, "Lines": 12, "Levels": 12, "Offsets": 144, "Instruments": 2},
    HITS: {"Circumferences": 6, "Set-ups of hits": 1, "Levels of hits": 10, "Control targets": 6},
    TANGENTS: {"Stations of tangents": 8, "Traverse": 16, "Tangents": 160, "Instruments": 1},
    LINES.parent / "plan-liquid": {"Circumferences": 12, "Runs": 28, "Instruments": 1},
}


@pytest.mark.slow
@pytest.mark.parametrize("folder", SHEETS, ids=lambda one: one.name)
def test_field_sheets_as_a_workbook(folder, tmp_path):
    """A sheet for each table of the paper, a row for each reading."""
    files.write_wall_sheets(WallPaper(predict(load_plan(folder)), "en"), tmp_path / "x.xlsx")
    book = openpyxl.load_workbook(tmp_path / "x.xlsx")
    for name, rows in SHEETS[folder].items():
        (table,) = book[name].tables.values()
        first, last = (int("".join(filter(str.isdigit, one))) for one in table.ref.split(":"))
        assert last - first == rows
        headings = [one.value for one in book[name][first]]
        assert len(set(headings)) == len(headings)


@pytest.mark.slow
def test_a_workbook_of_the_same_plan_has_the_same_bytes(tmp_path):
    paper = WallPaper(predict(load_plan(HITS)), "pt-BR")
    for name in ("one.xlsx", "two.xlsx"):
        files.write_wall_sheets(paper, tmp_path / name)
    assert (tmp_path / "one.xlsx").read_bytes() == (tmp_path / "two.xlsx").read_bytes()


def test_offsets_have_a_row_for_each_level_of_each_line(tmp_path):
    """A column for each face; readings of one face are numbered where there are more."""
    folder = plan_of(
        tmp_path / "plan",
        LINES,
        ("faces = 2", "faces = 1\nreadings = 2"),
    )
    path = folder / "instruments.toml"
    path.write_text(path.read_text(encoding="utf-8") + "u_collimation_arcsec = 10\n")
    rows, columns = field_tables_of_wall(load_plan(folder))["offset_readings"]
    assert len(rows) == 12 * 12 * 2
    keys = [one.key for one in columns]
    assert "face_1" in keys
    assert "face_2" not in keys
    assert "reading" in keys
    rows, columns = field_tables_of_wall(load_plan(LINES))["offset_readings"]
    assert len(rows) * 2 == len(load_plan(LINES).job.lines.offsets)
    assert {"face_1", "face_2"} <= {one.key for one in columns}


@pytest.mark.slow
def test_only_instruments_that_read_something_are_certified_anew(tmp_path):
    """A tape that nothing is strapped with would not help; a master does, and is taken along."""
    plan = load_plan(TANGENTS)  # its instruments.toml has a tape, too
    named = {name for _, item, name, _ in wall_changes_of(plan) if item == "certificate"}
    assert named == {"TS"}
    assert instruments_in_use(plan.job) == {"TS"}
    assert instruments_in_use(load_plan(LINES).job) == {"T-12", "ZL-3"}
    tape = replace(load_plan(LINES).job.strapping.tapes[0], master="M-1")
    job = load_plan(LINES).job
    job = replace(job, strapping=replace(job.strapping, tapes=(tape,)))
    assert instruments_in_use(job) == {"T-12", "ZL-3", "M-1"}


@pytest.mark.slow
@pytest.mark.parametrize(("faces", "told"), [(2, True), (1, False)])
def test_field_sheets_tell_of_the_other_face_where_it_is_read(tmp_path, faces, told):
    folder = plan_of(tmp_path / "plan", LINES, ("faces = 2", f"faces = {faces}"))
    path = folder / "instruments.toml"
    path.write_text(path.read_text(encoding="utf-8") + "u_collimation_arcsec = 10\n")
    paper = WallPaper(predict(load_plan(folder)), "en")
    text = " ".join(str(block.data) for block in wall_sheets(paper))
    assert ("second face" in text) == told
    assert "Hits" not in str([block.data for block in wall_outlook(paper)])


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "pt-BR", "es"])
def test_names_of_bars_are_on_the_picture(language):
    """Also that of a change with a long name: matplotlib says how wide it is drawn."""
    prediction = predict(load_plan(TANGENTS))
    wanted = changes_of(prediction.plan, items=("station", "traverse"))
    effects = tuple(Effect(one, 0.001, 1e-6 * k, 1.0, 0) for k, one in enumerate(wanted))
    figure = figures.changes(WallPaper(prediction, language, effects))
    figure.canvas.draw()
    edges = [one.get_window_extent().x0 for one in figure.axes[0].get_yticklabels()]
    assert min(edges) >= 0
