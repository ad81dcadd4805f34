"""From measurements to the table: adjusted points, one covariance all the way, each cause once."""

from dataclasses import replace

import numpy as np
import pytest
from draws import draws
from networks import CONTROL_SD_M, photographed, tank_points
from photographed_jobs import between, by_tape, control_of, measurements, tank_job

from tankcal.covariance import PointCovariance
from tankcal.errors import InputError, SolutionError
from tankcal.job.model import DeclaredInput, Sphere
from tankcal.pipeline.chain import adjust_job, run
from tankcal.pipeline.checks import refuse_undetermined
from tankcal.pipeline.tanks import body_of, insets_of, shell_volume
from tankcal.pipeline.wall.finding import find_wall, fit_wall
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.sections import coordinates_of
from tankcal.survey import Cause, wall_points
from tankcal.survey.measurements import AdjustmentSettings, Instrument, Measurements
from tankcal.survey.results import DatumReport

LEVEL_SD_M, U_SCALE = 0.001, 1e-4
TAPE = Instrument("tape 1", "tape", u_scale=U_SCALE)
INNER = AdjustmentSettings(datum="inner", snooping=False)
CONTROL = tuple(f"P{i}" for i in range(1, 48, 6))


@pytest.fixture
def job(tmp_path):
    return tank_job(tmp_path)


@pytest.fixture(scope="module")
def survey():
    return photographed(3)[0]


def with_control(survey, **more):
    """Photographs, eight tape distances, and eight control points with 2 mm noise."""
    noisy = tank_points() + np.random.default_rng(5).normal(0, CONTROL_SD_M, (48, 3))
    control = control_of(survey, CONTROL, noisy, CONTROL_SD_M)
    return measurements(
        survey, by_tape(survey, "tape 1"), control=control, instruments=(TAPE,), **more
    )


def levelled(survey, rng=None):
    """Twelve height differences round the tank, of points that are level in truth."""
    start = np.arange(12)
    rise = (rng or np.random.default_rng(0)).normal(0, LEVEL_SD_M, 12)
    return between("height_differences", rise, LEVEL_SD_M, start, np.roll(start, 5), survey.points)


def without_control(survey, **more):
    return measurements(
        survey, by_tape(survey, "tape 1"), levelled(survey), instruments=(TAPE,), **more
    )


def contribution(result, kind):
    """Standard uncertainty of the full tank from the sources of a kind, m3."""
    found = [s.columns_m3[-1] for s in result.table.sources if s.kind == kind]
    return np.linalg.norm(np.concatenate(found))


@pytest.mark.slow
def test_wall_seen_from_wrong_side_is_refused(job, survey):
    job = replace(job, measurements=with_control(survey))
    assert job.survey.side == "outside"
    with pytest.raises(InputError, match=r"survey.side: found inside, but all 8 set-ups") as told:
        run(replace(job, survey=replace(job.survey, side="inside")), simulated=False)
    assert told.value.problems[0].expected.code == "stations_on_other_side"


@pytest.mark.slow
def test_a_survey_is_adjusted_first_and_its_points_go_on(job, survey):
    job = replace(job, measurements=with_control(survey))
    steps = []
    result = run(job, steps.append)
    alone = adjust_job(job)
    assert steps[0].startswith("finding approximate values")
    assert len(steps) == 8
    assert result.job.points.names == result.adjustment.names == alone.names
    assert result.job.points.xyz_m == pytest.approx(alone.xyz_m, abs=1e-9)
    assert result.job.points.from_adjustment
    assert len(result.accepted) == 48
    # simulation: the truth is the shell's own interpolated outline, from points without error
    exact = run(replace(job, measurements=None, points=_exact(result)))
    error = result.table.volume_m3[-1] - exact.table.volume_m3[-1]
    noise = np.hypot(contribution(result, "points"), contribution(result, "instrument_scale"))
    assert abs(error) < 3 * noise


def _numbers(points):
    return [int(name[1:]) for name in points.names]


def _exact(result):
    points = result.job.points
    xyz = tank_points()[_numbers(points)]
    return replace(points, xyz_m=xyz, covariance_m2=1e-8 * np.eye(144), causes=())


@pytest.mark.slow
def test_no_job_and_nothing_to_adjust(job, survey):
    with pytest.raises(TypeError, match="expected a Job: adjust"):
        adjust_job("examples/silva-1995")
    with pytest.raises(InputError, match="nothing to adjust"):
        adjust_job(job)
    surveyed = replace(job, measurements=with_control(survey), tank=None)
    assert len(adjust_job(surveyed).names) == 48
    with pytest.raises(InputError, match="no tank"):
        run(surveyed)
    again = run(replace(job, measurements=with_control(survey)))
    assert run(again.job).table.u_m3[-1] == pytest.approx(again.table.u_m3[-1], rel=1e-12)
    twice = replace(again.job, points=replace(again.job.points, from_adjustment=False))
    with pytest.raises(InputError, match=r"points\.csv: given together with a survey"):
        run(twice)


@pytest.mark.slow
def test_no_capacity_without_a_vertical(job, survey):
    loose = measurements(survey, by_tape(survey), settings=INNER)
    with pytest.raises(SolutionError, match=r"the vertical is not determined.*plumb lines"):
        run(replace(job, measurements=loose))
    assert len(adjust_job(replace(job, measurements=loose)).names) == 48


def test_undetermined_unknowns_are_reported_at_once():
    report = DatumReport("inner", 3, "", ("all",), vertical=False, scale=False)
    with pytest.raises(
        SolutionError, match=r"(?s)vertical is not .*zenith.*scale is not .*distances"
    ):
        refuse_undetermined(report)
    refuse_undetermined(replace(report, vertical=True, scale=True))


@pytest.mark.slow
def test_heights_of_a_free_frame_are_warned_of(job, survey):
    result = run(replace(job, measurements=without_control(survey, settings=INNER)))
    told = [str(one) for one in result.warnings if one.column == "datum.bottom_z_m"]
    assert len(told) == 1
    assert "held by all" in told[0]


@pytest.mark.slow
def test_the_variances_of_the_causes_add_up_to_the_unsplit_one(job, survey):
    """Property: one covariance, whether its causes are named or not; row by row to rounding."""
    whole = run(replace(job, measurements=with_control(survey)))
    points = replace(whole.job.points, causes=())
    unsplit = run(replace(job, points=points))
    assert whole.table.u_m3 == pytest.approx(unsplit.table.u_m3, rel=2e-9)
    assert whole.table.volume_m3 == pytest.approx(unsplit.table.volume_m3, rel=1e-14)
    scale = next(s for s in whole.table.sources if s.kind == "instrument_scale")
    assert (scale.u, scale.unit, scale.note, scale.type) == (
        pytest.approx(100),
        "ppm",
        "tape 1",
        "B",
    )
    assert scale.columns_m3.shape[1] == 1
    assert "scale" not in whole.body.undeclared()
    assert "scale" in unsplit.body.undeclared()


@pytest.mark.slow
def test_the_scale_of_the_only_tape_is_the_scale_of_the_survey(job, survey):
    """Second method: the derivative by the declared input `scale`, times the tape's u."""
    job = replace(job, inputs=(DeclaredInput("scale", 1e-5, "ppm", 10.0),))
    result = run(replace(job, measurements=without_control(survey, settings=INNER)))
    by_scale = result.body.shell.derivatives(np.array([result.body.highest_m]))["scale"][0]
    assert contribution(result, "instrument_scale") == pytest.approx(U_SCALE * by_scale, rel=2e-4)
    assert contribution(result, "scale") == pytest.approx(1e-5 * by_scale, rel=1e-12)
    assert any("both count" in str(one) for one in result.warnings)


@pytest.mark.slow
def test_a_posteriori_scales_once(job, survey):
    before = run(replace(job, measurements=with_control(survey)))
    settings = AdjustmentSettings(snooping=False, scale="a_posteriori")
    after = run(
        replace(job, measurements=with_control(survey, settings=settings), scale="a_posteriori")
    )
    sigma0 = before.adjustment.sigma0
    for kind in ("points", "instrument_scale"):
        ratio = contribution(after, kind) / contribution(before, kind)
        assert ratio == pytest.approx(sigma0, rel=1e-4)
    points = after.table.sources[0]
    assert points.kind == "points"
    assert points.dof == before.adjustment.redundancy


@pytest.mark.slow
def test_the_volume_does_not_know_which_photo_is_held(job, survey, figure):
    """Property (Silva's tests 13 and 18): place and heading of each photo in turn, and inner.

    The vertical comes from levels, the scale from the tape; sds of coordinates are the datum's.
    """
    found, sds = [], []
    for held in (None, 0, 3, 6):
        settings = AdjustmentSettings(datum="inner" if held is None else "control", snooping=False)
        surveyed = without_control(survey, held=held, settings=settings)
        result = run(replace(job, measurements=surveyed))
        found.append((result.table.volume_m3[-1], u_of_points(result.job, result.wall)))
        sds.append(np.sqrt(np.einsum("nii->ni", result.adjustment.covariance_m2)).max())
    apart = np.ptp(found, axis=0) / found[0]
    figure("volume and u of points, whichever of 8 photos is held: largest relative change", apart)
    figure("largest sd of a coordinate, inner and 8 photos held, mm", np.round(1e3 * np.array(sds)))
    # the heights of the rings in their courses move with the frame, by millimetres
    assert np.all(apart < [2e-8, 1e-5])
    assert max(sds) > 2 * min(sds)


@pytest.mark.slow
def test_the_common_motion_of_points_is_taken_out(job, survey):
    """Closed form: a covariance of nothing but shifts and turns leaves nothing but its own size."""
    points = run(replace(job, measurements=with_control(survey))).job.points
    x, y, _ = points.xyz_m.T
    motion = np.zeros((48, 3, 4))
    motion[:, :, :3], motion[:, 0, 3], motion[:, 1, 3] = np.eye(3), -y, x
    motion = motion.reshape(-1, 4)
    away = Cause("tape", "instrument_scale", 1.0, "ppm", motion @ [1e-3, 0, 0, 1e-5])
    noise = 1e-6 * np.eye(144)
    moved = replace(points, covariance_m2=noise + 25.0 * motion @ motion.T, causes=(away,))
    left = s_transform(moved)
    assert left.covariance_m2.dense() == pytest.approx(noise, abs=1e-11)
    assert left.causes[0].column_m == pytest.approx(np.zeros(144), abs=1e-15)


@pytest.mark.slow
def test_points_that_are_not_on_the_wall_are_no_clutter(job, survey):
    """Pillars of the control stand far off: rejected, and no warning about outliers."""
    away = survey.points + ("A", "B", "C")
    xyz = np.vstack([tank_points(), [[20, 0, 1.0], [0, 20, 2.0], [-20, 0, 1.5]]])
    wider = replace(survey, points=away)
    control = control_of(wider, (*CONTROL, "A", "B", "C"), xyz, CONTROL_SD_M)
    start, end = np.arange(3), np.arange(48, 51)
    to_pillars = between(
        "distances", np.linalg.norm(xyz[start] - xyz[end], axis=1), 0.01, start, end, away
    )
    surveyed = measurements(survey, by_tape(survey), to_pillars, control=control)
    result = run(replace(job, measurements=surveyed))
    assert len(result.job.points.names) == 51
    assert len(result.accepted) == 48
    assert not any("outliers" in str(one) for one in result.warnings)


@pytest.mark.slow
def test_a_vague_point_and_a_vague_wall_are_named(job, survey):
    result = run(replace(job, measurements=with_control(survey)))
    points = result.job.points
    poor = points.covariance_m2.dense()
    poor[15:18, 15:18] += 4e-4 * np.eye(3)
    told = run(replace(job, points=replace(points, covariance_m2=poor, causes=())))
    assert any(f"{points.names[5]} (2" in str(one) for one in told.warnings)
    poor = points.covariance_m2.dense() + 4e-4 * np.eye(144)
    told = run(replace(job, points=replace(points, covariance_m2=poor, causes=())))
    assert any("cannot be told from noise" in str(one) for one in told.warnings)


@pytest.mark.slow
def test_weak_vertical_is_reported(job, survey):
    points = run(replace(job, measurements=with_control(survey))).job.points
    x, _, z = (points.xyz_m - points.xyz_m.mean(axis=0)).T
    lean = 0.005 * np.column_stack([z, np.zeros(48), -x]).ravel()
    spread = points.covariance_m2.dense() + np.outer(lean, lean)
    leaning = replace(points, covariance_m2=spread, causes=())
    told = [str(one) for one in run(replace(job, points=leaning)).warnings]
    assert any("is known only to 5.0 mm/m" in one for one in told)


@pytest.mark.slow
def test_a_sphere_of_adjusted_points_has_its_causes_too(tmp_path):
    """Closed form: a scale of u changes the diameter by D u, whatever else is uncertain."""
    rng = np.random.default_rng(4)
    way = rng.normal(size=(60, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    xyz = 10.0 * way + rng.normal(0, 0.002, way.shape)
    job = tank_job(tmp_path, kind="sphere", settings={"sphere.diameter_m": 20.0})
    job = replace(job, sphere=Sphere(None))
    network = replace(photographed(3)[0], points=tuple(f"P{i}" for i in range(60)))
    start = np.tile(np.arange(60), 4)
    end = np.concatenate([np.roll(np.arange(60), shift) for shift in (1, 7, 11, 23)])
    lengths = np.linalg.norm(xyz[start] - xyz[end], axis=1)
    result = run(
        replace(
            job,
            measurements=Measurements(
                settings=AdjustmentSettings(snooping=False),
                control=control_of(network, network.points, xyz, 0.002),
                readings=(between("distances", lengths, 1.0, start, end, network.points),),
            ),
        )
    )
    (alone,) = result.scan.factors
    assert alone.columns[0, 0] == pytest.approx(2 * 0.002 / np.sqrt(60), rel=0.05)
    column = (U_SCALE * xyz[_numbers(result.job.points)]).ravel()
    cause = Cause("tape 1", "instrument_scale", 1e6 * U_SCALE, "ppm", column)
    covariance = 4e-6 * np.eye(180) + np.outer(column, column)
    points = replace(result.job.points, covariance_m2=covariance, causes=(cause,))
    noise, scale = run(replace(job, points=points)).scan.factors
    assert abs(scale.columns[0, 0]) == pytest.approx(20.0 * U_SCALE, rel=1e-3)
    assert np.linalg.norm(noise.columns) == pytest.approx(2 * 0.002 / np.sqrt(60), rel=0.05)


def surveys_of_one_tank(job, count):
    """What `count` surveys say of the same tank, each with its own noise and its own tape.

    Rows: error of the total volume, its u by points and tape; errors and sds of the four radii. The
    truth is what the same fit makes of the true points: the wall between the points is the same in
    all surveys and is left out. Also u over that without covariance between courses, of the last.
    """
    rng, rows = np.random.default_rng(20_26), []
    for number in range(count):
        survey = photographed(1000 + number)[0]
        tape = by_tape(survey, "tape 1", 1 + U_SCALE * rng.normal())
        readings = tape, levelled(survey, rng)
        surveyed = measurements(survey, *readings, settings=INNER, instruments=(TAPE,))
        adjustment = adjust_job(replace(job, measurements=surveyed))
        points = s_transform(wall_points(adjustment, surveyed, "outside"))
        one = replace(job, points=replace(points, causes=()))
        wall = find_wall(one, lambda text: None)
        true = true_wall(one, wall)
        error = total(one, wall) - total(one, true)
        pairs = zip(wall.sections, true.sections, strict=True)
        radii = [found.circle.radius_m - exact.circle.radius_m for found, exact in pairs]
        sds = [np.sqrt(section.circle.cofactor_m2[2, 2]) for section in wall.sections]
        rows.append([error, u_of_points(one, wall), *radii, *sds])
    apart = replace(wall, covariance_m2=without_covariance_between_courses(wall))
    return np.array(rows), rows[-1][1] / u_of_points(one, apart)


def u_of_points(job, wall):
    """Standard uncertainty of the total volume by the covariance of the points, m3."""
    shell = body_of(job, wall).shell
    points = shell.sources(np.array([shell.volume.height_m]))[0]
    return np.linalg.norm(points.columns_m3)


def total(job, wall):
    volume = shell_volume(wall, insets_of(job, job.switches))
    return volume.volume_m3(volume.height_m)[0]


def true_wall(job, wall):
    """What the same fit makes of the true points, with the covariance of the survey."""
    xyz = job.points.xyz_m.copy()
    xyz[wall.accepted] = tank_points()[_numbers(job.points)][wall.accepted]
    points = replace(job.points, xyz_m=xyz)
    return fit_wall(replace(job, points=points), wall.shell, amplitudes=wall.field.amplitudes)


def without_covariance_between_courses(wall):
    whole = wall.covariance_m2.dense()
    apart = np.zeros_like(whole)
    for section in wall.sections:
        index = np.ix_(*[coordinates_of(section.group.members)] * 2)
        apart[index] = whole[index]
    return PointCovariance.convert(apart, 3)


def check_surveys(job, count, figure):
    """Scatter over u within 3.3 standard errors of one; 93.5 to 96.5 %, as far as `count` tells.

    Of 100 surveys the ratio has a standard error of 7.1 %, each part that holds 2.2 %; of 1000 2.2
    and 0.7 %. Without the covariance between courses the ratio would be 1.5 or more.
    """
    found, together = surveys_of_one_tank(job, count)
    (error, u), (radii, sds) = found[:, :2].T, np.split(found[:, 2:], 2, axis=1)
    ratio = np.sqrt(np.mean((error / u) ** 2))
    held = np.mean(np.abs(np.column_stack([error / u, radii / sds])) < 1.96, axis=0)
    figure(f"{count} surveys of a tank: rms error of the volume over u", f"{ratio:.3f}")
    figure(f"{count} surveys: 95 % intervals that hold the volume, four radii", held.round(3))
    figure("u of a volume over that without covariance of its courses", f"{together:.2f}")
    assert abs(ratio - 1) < 3.3 / np.sqrt(2 * count)
    assert np.all(np.abs(held - 0.95) < max(0.015, 3.3 * np.sqrt(0.95 * 0.05 / count)))
    assert together > 1.5  # photos and tape move all courses at once


@pytest.mark.slow
@pytest.mark.twentieth
def test_surveys_scatter_as_one_of_them_says(job, figure):
    check_surveys(job, 20, figure)


@pytest.mark.study
def test_surveys_scatter_as_predicted_study(job, figure):
    check_surveys(job, draws(30, 1000), figure)
