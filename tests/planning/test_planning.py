"""A plan answered: against the adjustment, the chain and closed forms, all of the same survey."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from conftest import EXAMPLE
from plan_folders import with_setups

import tankcal
from tankcal.geometry.rotations import rotation_of_angles
from tankcal.pipeline.table import compute_table
from tankcal.pipeline.wall.finding import find_wall
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.planning import load_plan, predict
from tankcal.planning.measurements import draw_measurements
from tankcal.planning.table import recompute_table
from tankcal.record.plan import plain_of
from tankcal.survey import Nominal, adjust_survey, predict_survey, wall_points

PLAN, PHOTOS = EXAMPLE.parent / "plan-silva", EXAMPLE.parent / "silva-1995-photos"


@pytest.fixture(scope="module")
def plan():
    return load_plan(PLAN)


@pytest.fixture(scope="module")
def prediction(plan):
    return predict(plan)


@pytest.fixture(scope="module")
def filled(prediction):
    """The measurements of the plan with the values that they would have, without errors."""
    return draw_measurements(prediction.plan, prediction.measurements, prediction.network)


def test_the_plan_is_the_network_of_the_dissertation(prediction):
    """Published: 11 stations, 137 points, 8 distances, 487 unknowns; three rays or more."""
    assert len(prediction.plan.stations) == 11
    assert len(prediction.points) == 137
    assert len(prediction.plan.ties) == 8
    assert prediction.network.adjusted.solution.estimated == 487
    assert prediction.visibility.rays.min() >= 3
    assert not prediction.undetermined
    assert not prediction.weak


@pytest.mark.slow
def test_filled_job_adjusts_as_predicted(prediction, filled):
    """Second method: the whole adjustment of the survey, from readings without errors."""
    adjustment = adjust_survey(filled)
    assert adjustment.sigma0 < 1e-6
    assert not adjustment.removed
    known = dict(zip(adjustment.names, adjustment.covariance_m2, strict=True))
    places = prediction.plan.points
    for one in prediction.points:
        assert one.sd_m == pytest.approx(np.sqrt(np.diag(known[one.name])), rel=1e-8)
    assert adjustment.xyz_m == pytest.approx(
        np.array([places[name] for name in adjustment.names]), abs=1e-8
    )


@pytest.mark.slow
def test_the_table_is_that_of_the_chain(prediction, filled, figure):
    """Second method: points with their full covariance, wall and table, as a job goes."""
    plan = prediction.plan
    adjustment = adjust_survey(filled)
    points = s_transform(wall_points(adjustment, filled, "outside"))
    job = replace(plan.job, points=points, measurements=None)
    table = compute_table(job, find_wall(job, lambda text: None, amplitudes=plan.amplitudes)).table
    off = np.abs(prediction.table.U_m3 / table.U_m3 - 1).max()
    figure("largest relative difference of a row's U to the chain", off)
    assert prediction.table.U_m3 == pytest.approx(table.U_m3, rel=1e-8)
    assert prediction.table.volume_m3 == pytest.approx(table.volume_m3, rel=1e-9)
    names = [one.kind for one in prediction.table.sources]
    assert names == [one.kind for one in table.sources]


def test_a_wall_of_another_prediction(plan, prediction):
    """Second method: the sections of the same network keep their weights."""
    again = recompute_table(plan, prediction.network, prediction.result)
    assert again.computed_table.table.U_m3 == pytest.approx(prediction.table.U_m3, rel=1e-9)


@pytest.mark.slow
def test_a_free_network(plan, figure):
    """Second method: inner constraints over the control, whose covariance is singular; products
    with it against the matrix as it is written out."""
    settings = replace(plan.job.measurements.settings, datum="inner")
    job = replace(plan.job, measurements=replace(plan.job.measurements, settings=settings))
    rolled = tuple(
        replace(one, name=f"{one.name}r", rotation=np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
                @ one.rotation)
        for one in plan.photos
    )  # fmt: skip
    found = predict(replace(plan, job=job, photos=(*plan.photos, *rolled)))
    points, adjusted = found.result.job.points, found.network.adjusted
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    whole = adjusted.covariance_m2([number[name] for name in points.names])
    written = s_transform(replace(points, covariance_m2=whole, causes=()))
    covariance, written = points.covariance_m2, written.covariance_m2.dense()
    np.testing.assert_allclose(covariance.dense(), written, atol=1e-15)
    columns = np.random.default_rng(1).standard_normal((covariance.shape[0], 3))
    np.testing.assert_allclose(covariance @ columns, written @ columns, atol=1e-13)


@pytest.mark.slow
def test_nominal_places_are_good_enough(figure):
    """The issue's number: within 1 % of the adjustment of the example, with nominal targets on a
    true circle, stations and tapes rounded to 0.1 m and directions to 1 deg."""
    job = tankcal.load(PHOTOS)
    adjusted = tankcal.adjust_job(job).adjusted
    predicted = predict_survey(job.measurements, rough_places()).adjusted
    ratio = predicted.point_sd_m / adjusted.point_sd_m
    figure("largest relative difference of an sd at nominal places", np.abs(ratio - 1).max())
    assert ratio == pytest.approx(1.0, abs=0.01)


def rough_places():
    """Where a planner would have put the points and stations of the example."""
    points = {row["point"]: rounded(row) for row in rows("truth/points.csv")}
    for row in rows("targets.csv"):
        azimuth = np.radians(15 * (int(row["generatrix"]) - 1) - 7.5)
        plan = [15.782 + 6.5 * np.sin(azimuth), 14.150 + 6.5 * np.cos(azimuth)]
        points[row["point"]] = np.array([*plan, float(row["z_m"])])
    photos = {}
    for row in rows("truth/photos.csv"):
        angles = [round(float(row[f"{one}_deg"])) for one in ("omega", "phi", "kappa")]
        photos[row["photo"]] = rounded(row), rotation_of_angles(*np.radians(angles))
    return Nominal(points, photos)


def rounded(row):
    return np.array([round(float(row[f"{axis}_m"]), 1) for axis in "xyz"])


def rows(name):
    with open(PHOTOS / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_sections_of_independent_points(prediction):
    """Closed form: n evenly spread points of sd s give s/sqrt(n) for the radius and s sqrt(2/n)
    for the centre; neighbours that share their errors are worse by a small factor."""
    adjusted = prediction.network.adjusted
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    for section in prediction.sections:
        names = [f"{g}-{section.name}" for g in range(1, 25)]
        sds = adjusted.point_sd_m[[number[name] for name in names], :2]
        alone = np.sqrt(np.mean(sds**2) / section.targets)
        assert section.targets == 24
        assert 0.5 * alone < section.radius_sd_m < 5 * alone
        assert (section.centre_sd_m < 10 * alone).all()


def test_sections_against_the_written_covariance(prediction):
    """Second method: the radius of a section by its derivative and the full covariance."""
    tabled_, adjusted = prediction.result, prediction.network.adjusted
    section = prediction.sections[2]
    members = tabled_.wall.sections[2].group.members
    points = tabled_.points[members]
    away = adjusted.xyz_m[points, :2] - prediction.plan.shell.axis_m
    unit = away / np.linalg.norm(away, axis=1)[:, None]
    slope = np.column_stack([unit, np.zeros(len(unit))]).ravel() / len(unit)
    sd = np.sqrt(slope @ adjusted.covariance_m2(points) @ slope)
    assert section.radius_sd_m == pytest.approx(sd, rel=1e-2)  # targets moved away from welds


@pytest.mark.slow
def test_effect_of_blunder_on_volume(prediction, filled, figure):
    """Second method: the tape that is told to be worst misread by its undetectable blunder, and the
    survey adjusted without a search."""
    group = next(one for one in prediction.reliability if one.kind == "distance")
    readings = filled.readings[0]
    at = [*zip(readings.start, readings.end, strict=True)].index(group.volume_of)
    sizes = residual_sizes(prediction, group)
    value = readings.value.copy()
    value[at] += sizes[at]
    spoilt = replace(
        filled,
        readings=(replace(readings, value=value), *filled.readings[1:]),
        settings=replace(filled.settings, snooping=False, explain=False),
    )
    change = volume_of(prediction.plan, spoilt) - volume_of(prediction.plan, filled)
    figure("undetectable blunder of a tape, effect on the volume (m3)", group.volume_m3)
    assert abs(change) == pytest.approx(group.volume_m3, rel=0.02)


def residual_sizes(prediction, group):
    """Minimal detectable biases of the distances, as the adjustment itself tells them."""
    table = next(one for one in prediction.network.adjusted.residuals if one.kind == group.kind)
    assert group.blunder == pytest.approx(table.mdb.max(), rel=1e-9)
    sizes = np.zeros(len(table.rows))
    sizes[table.rows] = table.mdb[:, 0]
    return sizes


def volume_of(plan, measurements):
    adjustment = adjust_survey(measurements)
    points = s_transform(wall_points(adjustment, measurements, "outside"))
    job = replace(plan.job, points=points, measurements=None)
    return compute_table(
        job, find_wall(job, lambda text: None, amplitudes=plan.amplitudes)
    ).table.volume_m3[-1]


@pytest.mark.slow
def test_a_bad_point_is_weak_and_a_hidden_one_is_not_determined(plan):
    """Property: fewer stations leave points with two rays, one, none; each is told by name."""
    few = replace(plan, photos=plan.photos[:7])
    found = predict(few)
    rays = {one.name: one.rays for one in found.points}
    told = {one.name: one.undetermined for one in found.undetermined}
    assert {rays[name] for name in told} == {0, 1}
    assert all("ray" in why for name, why in told.items() if rays[name] == 1)
    nothing = {why for name, why in told.items() if rays[name] == 0}
    assert nothing == {"is seen from nowhere", "is not measured"}  # the second: a control point
    held = {one.name for one in plan.known}
    assert {rays[one.name] for one in found.weak if one.name not in held} == {2}
    assert all(np.isfinite(one.sd_m).all() for one in found.weak)


@pytest.mark.slow
def test_more_precise_images_make_the_points_more_precise(plan, prediction):
    """Property: where all readings are twice as good, all sds are halved."""
    halved = replace(
        plan,
        photos=tuple(replace(one, readings=4) for one in plan.photos),
        ties=tuple(replace(one, readings=4) for one in plan.ties),
        known=tuple(replace(one, sd_m=one.sd_m / 2) for one in plan.known),
    )
    found = predict(halved)
    for one, other in zip(found.points, prediction.points, strict=True):
        assert one.sd_m == pytest.approx(other.sd_m / 2, rel=1e-9)


@pytest.mark.slow
def test_a_total_station_plan(tmp_path):
    """Simulation: set-ups that sight one another; the job filled with errors adjusts to what was
    predicted, but for what the errors move."""
    folder = with_setups(tmp_path)
    found = predict(load_plan(folder))
    assert len(found.plan.setups) == 6
    assert not found.undetermined
    drawn = draw_measurements(
        found.plan, found.measurements, found.network, np.random.default_rng(5)
    )
    adjustment = adjust_survey(drawn)
    assert not adjustment.removed
    assert 0.85 < adjustment.sigma0 < 1.15  # 195 degrees of freedom: sd 0.05
    known = dict(zip(adjustment.names, adjustment.covariance_m2, strict=True))
    for one in found.points:
        assert one.sd_m == pytest.approx(np.sqrt(np.diag(known[one.name])), rel=0.01)
    kinds = {(one.kind, one.name) for one in found.reliability}
    assert ("direction", "") in kinds


@pytest.mark.slow
def test_an_inside_plan(tmp_path):
    """Stations within the tank see the wall all around; nothing is taken off for plates."""
    text = (PLAN / "plan.toml").read_text()
    text = text.replace('side = "outside"', 'side = "inside"')
    text = text.replace("distance_m = 10.0 ", "radius_m = 5.0 ").replace("aim_height_m = 3.2", "")
    text = text.replace("heights_m = [1.4]", "heights_m = [1.4, 8.0]")
    for name in ("courses.csv", "uncertainty.csv", "cameras.toml", "instruments.toml"):
        (tmp_path / name).write_text((PLAN / name).read_text())
    (tmp_path / "control.csv").write_text(
        "\n".join((PLAN / "control.csv").read_text().splitlines()[:-1]) + "\n"
    )
    (tmp_path / "uncertainty.csv").write_text(
        "input,u,unit\nscale,20,ppm\ndatum,1,mm\nshell_temperature,2,K\n"
    )
    (tmp_path / "plan.toml").write_text(text)
    found = predict(load_plan(tmp_path))
    assert found.plan.shell.radius_m == 6.5
    assert not found.undetermined
    assert found.meets


def test_json_of_a_prediction(prediction):
    found = plain_of(prediction)
    assert found["survey"]["unknowns"] == 487
    assert found["survey"]["datum"]["defect"] == 6
    assert found["limit"] == {
        "relative_u": 0.002, "of": "top", "predicted": prediction.relative_u, "met": True,
    }  # fmt: skip
    assert len(found["table"]["U_m3"]) == len(prediction.table.height_m)
    assert [one["minimum_m"] for one in found["worst_deliveries"]] == [1.5, 2.0, 3.0]
    assert {one["kind"] for one in found["reliability"]} == {
        "control coordinate", "distance", "image coordinate",
    }  # fmt: skip
