"""From measurements to the adjustment: second methods, closed forms, simulation, properties."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import photographed
from surveyed import by_instruments, by_photographs, changed, known, places, table

from tankcal.errors import InputError, SolutionError
from tankcal.survey import adjust_survey, wall_points
from tankcal.survey.measurements import AdjustmentSettings, Instrument, Measurements, Targets
from tankcal.survey.network import adjust
from tankcal.survey.observations import ImageCoordinates
from tankcal.survey.points import move_to_wall
from tankcal.survey.readings import EARTH_RADIUS_M, average_readings, true_distance_m


@pytest.fixture(scope="module")
def photos():
    return by_photographs()


@pytest.fixture(scope="module")
def adjustment(photos):
    return adjust_survey(photos[0])


@pytest.mark.slow
def test_finds_the_truth_without_noise():
    """Property: measurements without error, and nothing known of photos, give the truth back."""
    measurements, truth = by_photographs(noise=0.0)
    found = adjust_survey(measurements)
    assert np.abs(places(found, truth)).max() < 1e-7
    assert found.sigma0 < 1e-5
    measurements, truth = by_instruments(noise=0.0)
    found = adjust_survey(measurements)
    assert np.abs(places(found, truth)).max() < 1e-8


@pytest.mark.slow
def test_same_as_the_network_adjustment(photos, adjustment):
    """Second method: the simulated survey adjusted directly, from its own start values."""
    survey, _ = photographed()
    tool = replace(adjustment.adjusted.survey.instruments[0])
    control, tapes = survey.observations
    tapes = replace(tapes, instrument=np.zeros(8, dtype=int))
    direct = adjust(replace(survey, observations=(control, tapes), instruments=(tool,)))
    order = [survey.points.index(name) for name in adjustment.names]
    assert adjustment.sigma0 == pytest.approx(direct.sigma0, rel=1e-9)
    assert adjustment.xyz_m == pytest.approx(direct.xyz_m[order], abs=1e-8)
    q = direct.covariance_m2(order)
    assert adjustment.full_covariance_m2() == pytest.approx(q, rel=1e-5, abs=1e-13)
    assert (adjustment.observations, adjustment.unknowns, adjustment.redundancy) == (
        direct.solution.rows, direct.solution.estimated, direct.dof,
    )  # fmt: skip


def test_every_value_has_its_row(photos, adjustment):
    """Property: as many readings as values adjusted, sum of redundancies, v = computed - read."""
    readings = adjustment.readings
    assert len(readings) == adjustment.observations
    assert sum(one.redundancy for one in readings) == pytest.approx(adjustment.redundancy, rel=1e-9)
    chi2 = sum((one.residual / one.sd) ** 2 for one in readings)
    assert chi2 == pytest.approx(adjustment.adjusted.solution.chi2, rel=1e-9)
    images = photos[0].image_points
    one = next(r for r in readings if r.file == "image_points.csv" and r.row == 12)
    assert one.ids == (images.photo[10], images.point[10])
    assert (one.element, one.unit, one.repeats) == ("x", "mm", 1)
    assert one.value == images.xy_mm[10, 0]
    assert one.tau == pytest.approx(one.w / adjustment.sigma0)
    tape = next(r for r in readings if r.file == "distances.csv")
    assert tape.ids == ("P0", "P36")
    assert tape.row == 2
    xyz = dict(zip(adjustment.names, adjustment.xyz_m, strict=True))
    scale = adjustment.adjusted.solution.unknowns.nuisance["scale"][0]
    computed = (1 + scale) * np.linalg.norm(xyz["P0"] - xyz["P36"])
    assert tape.residual == pytest.approx(computed - tape.value, abs=1e-9)
    known_before = next(r for r in readings if r.kind == "weighted unknown")
    assert (known_before.ids, known_before.element) == (("tape 1",), "scale")


def test_variance_factors_of_groups(adjustment):
    """Closed form: factor2 = v'Pv over redundancy, in each group."""
    names = [(one.kind, one.name) for one in adjustment.groups]
    assert ("image coordinate", "camera") in names
    assert ("distance", "tape 1") in names
    for group in adjustment.groups:
        mine = [one for one in adjustment.readings if one.kind == group.kind]
        square = sum((one.residual / one.sd) ** 2 for one in mine)
        assert group.count == len(mine)
        assert group.factor**2 * group.redundancy == pytest.approx(square, rel=1e-9)


@pytest.mark.slow
@settings(max_examples=30)
@given(
    st.lists(st.tuples(st.integers(0, 4), st.floats(-5, 5), st.floats(0.1, 3)), min_size=1),
    st.floats(-7, 7),
)
def test_averages_are_those_of_each_label(rows, turn):
    """Second method: one loop over the labels; a mean of angles does not mind whole turns."""
    label, value, sd = (np.array(column) for column in zip(*rows, strict=True))
    found = average_readings(label, value, sd)
    for i, first in enumerate(found.first):
        mine = label == label[first]
        p = 1 / sd[mine] ** 2
        mean = np.sum(p * value[mine]) / p.sum()
        assert found.value[i, 0] == pytest.approx(mean, abs=1e-9)
        assert found.sd[i, 0] == pytest.approx(p.sum() ** -0.5)
        assert found.repeats[i] == mine.sum()
        assert found.chi2[i, 0] == pytest.approx(np.sum(p * (value[mine] - mean) ** 2), abs=1e-9)
    small = value / 10
    turned = average_readings(
        label, small + 2 * np.pi * np.round(turn * np.arange(len(label))), sd, angle=True
    )
    straight = average_readings(label, small, sd)
    away = turned.value - straight.value
    assert away == pytest.approx(2 * np.pi * np.round(away / (2 * np.pi)), abs=1e-9)


def repeated(measurements, times, scatter, rng):
    """The measurements with each image point and distance read several times."""
    images = measurements.image_points
    rows = np.tile(np.arange(len(images.photo)), times)
    sd = images.sd_mm[rows] * rng.uniform(0.5, 2.0, (len(rows), 1))
    xy = images.xy_mm[rows] + scatter * sd * rng.normal(size=sd.shape)
    images = replace(
        images, photo=tuple(images.photo[i] for i in rows),
        point=tuple(images.point[i] for i in rows), xy_mm=xy, sd_mm=sd,
        check=np.zeros(len(rows), dtype=bool),
        rows=tuple(range(2, len(rows) + 2)),
    )  # fmt: skip
    one = measurements.readings[0]
    turn = np.arange(16) % 2 == 1
    start, end = np.array(one.start * 2), np.array(one.end * 2)
    tapes = table(
        "distances", np.tile(one.value, 2) + rng.normal(0, scatter * 0.001, 16), 0.001,
        np.where(turn, end, start).tolist(), np.where(turn, start, end).tolist(),
        instrument=("tape 1",) * 16,
    )  # fmt: skip
    return replace(measurements, image_points=images, readings=(tapes,))


@pytest.mark.slow
def test_averaging_is_adjusting_all_readings(photos):
    """Property: the same unknowns, covariance, sum of squares, redundancy and global test."""
    measurements = repeated(photos[0], 3, 1.0, np.random.default_rng(5))
    means = adjust_survey(replace(measurements, settings=AdjustmentSettings(snooping=False)))
    survey, images = means.adjusted.survey, measurements.image_points
    point = np.array([survey.points.index(name) for name in images.point])
    photo = np.array([survey.photos.names.index(name) for name in images.photo])
    tapes = measurements.readings[0]
    of = survey.observations[1]
    single = replace(
        survey,
        image_points=ImageCoordinates(images.xy_mm, images.sd_mm, point, photo),
        observations=(
            survey.observations[0],
            replace(
                of, trace=None, value=tapes.value, sd=tapes.sd, instrument=np.zeros(16, dtype=int),
                start=np.array([survey.points.index(name) for name in tapes.start]),
                end=np.array([survey.points.index(name) for name in tapes.end]),
            ),
        ),
    )  # fmt: skip
    alone = adjust(single)
    assert alone.xyz_m == pytest.approx(means.adjusted.xyz_m, abs=1e-8)
    assert alone.point_covariances_m2 == pytest.approx(means.covariance_m2, rel=1e-6, abs=1e-13)
    within = len(images.photo) * 2 * 2 // 3 + 8
    values = sum(one.size for one in means.adjusted.solution.normalised)
    assert values + within == alone.solution.rows
    assert means.adjusted.solution.dof == alone.dof == means.redundancy
    assert means.adjusted.chi2 == pytest.approx(alone.chi2, rel=1e-6)
    assert means.sigma0 == pytest.approx(alone.sigma0, rel=1e-6)
    assert means.observations == alone.solution.rows
    redundancy = sum(one.redundancy for one in means.groups)
    assert redundancy == pytest.approx(means.redundancy, abs=1e-6)
    first = next(one for one in means.readings if one.file == "distances.csv")
    assert (first.repeats, first.row) == (2, 2)
    assert not any("scatter" in problem.expected for problem in means.warnings)


@pytest.mark.slow
def test_scatter_that_contradicts_its_sds_is_reported(photos):
    rng = np.random.default_rng(6)
    measurements = repeated(photos[0], 3, 1.0, rng)
    xy = measurements.image_points.xy_mm.copy()
    xy[20, 1] += 0.08
    wild = replace(measurements, image_points=replace(measurements.image_points, xy_mm=xy))
    told = [str(one) for one in adjust_survey(wild).warnings]
    images = measurements.image_points
    name = f"image_points.csv, row 22: the 3 readings of point {images.point[20]} in photo "
    assert any(text.startswith(name) for text in told)
    rough = adjust_survey(repeated(photos[0], 3, 2.5, rng))
    assert any("all repeated readings together scatter" in str(one) or "scatter" in str(one)
               for one in rough.warnings)  # fmt: skip


@pytest.mark.slow
def test_check_rows_change_nothing(photos, adjustment):
    """Property: with readings and points to compare, every adjusted number stays, and the
    differences are those of the geometry."""
    measurements, truth = photos
    images, control = measurements.image_points, measurements.control
    names = ("P4", "P20")
    extra = replace(
        images, photo=(*images.photo, images.photo[3]), point=(*images.point, images.point[3]),
        xy_mm=np.vstack([images.xy_mm, images.xy_mm[3] + 0.02]),
        sd_mm=np.vstack([images.sd_mm, [0.005, 0.005]]),
        check=np.append(images.check, True), rows=(*images.rows, 900),
    )  # fmt: skip
    tapes = table(
        "distances", [12.0], 0.002, ["P4"], ["P20"], check=np.array([True]), instrument=("tape 1",)
    )
    with_checks = replace(
        measurements,
        image_points=extra,
        check=known(names, truth.xyz_m[[4, 20]] + [[0.01, 0, 0]], 0.001, file="check.csv"),
        readings=(*measurements.readings, tapes),
        control=replace(control),
    )
    found = adjust_survey(with_checks)
    assert found.xyz_m == pytest.approx(adjustment.xyz_m, abs=1e-11)
    assert found.covariance_m2 == pytest.approx(adjustment.covariance_m2, rel=1e-8, abs=1e-15)
    assert found.redundancy == adjustment.redundancy
    checks = [one for one in found.readings if one.check]
    assert {one.kind for one in checks} == {"image coordinate", "distance"}
    distance = next(one for one in checks if one.kind == "distance")
    xyz = dict(zip(found.names, found.xyz_m, strict=True))
    scale = found.adjusted.solution.unknowns.nuisance["scale"][0]
    length = (1 + scale) * np.linalg.norm(xyz["P4"] - xyz["P20"])
    assert distance.residual == pytest.approx(length - 12.0, abs=1e-9)
    assert abs(distance.w) > 100
    used = next(r for r in found.readings if r.row == 5 and r.kind == "image coordinate")
    image = next(one for one in checks if one.kind == "image coordinate")
    assert image.residual == pytest.approx(used.residual - 0.02, abs=1e-9)
    points = found.check_points
    difference = np.array([xyz[name] for name in names]) - truth.xyz_m[[4, 20]] - [[0.01, 0, 0]]
    assert points.names == names
    assert points.difference_m == pytest.approx(difference, abs=1e-12)
    size = np.linalg.norm(difference, axis=1)
    assert points.r_xyz_m == pytest.approx(np.sqrt(np.mean(size**2)))
    assert (points.largest_m, points.mean_m) == pytest.approx((size.max(), size.mean()))


@pytest.mark.slow
def test_blunders_are_set_aside_and_listed(photos):
    """Simulation: blunders of 30 sds and more are removed, named with their rows, worst first."""
    measurements, truth = photos
    images = measurements.image_points
    xy = images.xy_mm.copy()
    xy[30] += [0.3, 0.0]
    xy[77] += [0.0, -0.2]
    spoilt = replace(measurements, image_points=replace(images, xy_mm=xy))
    value = measurements.readings[0].value.copy()
    value[2] += 0.05
    found = adjust_survey(changed(spoilt, "distances", value=value))
    rows = {(one.file, one.row) for one in found.removed}
    assert {("image_points.csv", 32), ("image_points.csv", 79), ("distances.csv", 4)} <= rows
    sizes = [abs(one.w) for one in found.removed]
    assert sizes == sorted(sizes, reverse=True)
    assert {one.row for one in found.readings if one.removed and one.kind == "distance"} == {4}
    assert np.abs(places(found, truth)).max() < 0.006
    kept = adjust_survey(replace(spoilt, settings=AdjustmentSettings(snooping=False)))
    assert kept.removed == ()
    assert kept.rounds == 1
    assert any("the global test fails: sigma0" in str(one) for one in kept.warnings)


@pytest.mark.slow
def test_tapes_are_corrected_by_their_certificate(photos, adjustment):
    """Closed form: (10 + 0.002)(1 + 50e-6)(1 + 11.5e-6 x 12) m; and in a whole survey."""
    tool = Instrument("tape 1", "tape", 50e-6, 0.002, 20.0, 11.5e-6, 2e-5)
    expected = 10.002 * 1.00005 * (1 + 11.5e-6 * 12)
    assert true_distance_m(np.array([10.0]), tool, np.array([32.0])) == pytest.approx(
        expected, abs=1e-12
    )
    assert true_distance_m(np.array([10.0]), tool, np.array([np.nan])) == pytest.approx(
        10.002 * 1.00005, abs=1e-12
    )
    measurements = photos[0]
    read = measurements.readings[0].value / (1.00005 * (1 + 11.5e-6 * 12)) - 0.002
    as_read = changed(measurements, "distances", value=read, temperature_c=np.full(8, 32.0))
    found = adjust_survey(replace(as_read, instruments=(tool,)))
    assert found.xyz_m == pytest.approx(adjustment.xyz_m, abs=1e-9)
    value = next(one.value for one in found.readings if one.file == "distances.csv")
    assert value == pytest.approx(measurements.readings[0].value[0], abs=1e-12)


@pytest.mark.slow
def test_causes_are_effects_of_one_instrument_sd(photos):
    """Second method: adjusted again with the a-priori value shifted by one standard uncertainty."""
    tool = Instrument("tape 1", "tape", u_scale=2e-4, u_offset_m=5e-4)
    measurements = replace(photos[0], instruments=(tool,))
    found = adjust_survey(measurements)
    assert [(c.what, c.unit) for c in found.causes] == [
        ("instrument_scale", "ppm"),
        ("instrument_offset", "mm"),
    ]
    assert [c.u for c in found.causes] == pytest.approx([200.0, 0.5])
    survey = found.adjusted.survey
    for cause, shift in zip(found.causes, ({"scale": 2e-4}, {"offset_m": 5e-4}), strict=True):
        other = adjust(
            replace(survey, instruments=(replace(survey.instruments[0], **shift),)), tolerance=1e-8
        )
        moved = (other.xyz_m - found.adjusted.xyz_m).ravel()
        assert np.abs(moved).max() > 1e-5
        assert np.abs(moved - cause.column_m).max() < 1e-3 * np.abs(moved).max()
    rest = found.full_covariance_m2() - sum(np.outer(c.column_m, c.column_m) for c in found.causes)
    assert np.linalg.eigvalsh(rest).min() > -1e-12


@pytest.mark.slow
def test_a_posteriori_scale_is_that_of_sigma0(photos, adjustment):
    """Closed form: covariances and causes times sigma0 squared and sigma0."""
    found = adjust_survey(replace(photos[0], settings=AdjustmentSettings(scale="a_posteriori")))
    assert found.cov_scale == pytest.approx(adjustment.sigma0**2)
    assert found.covariance_m2 == pytest.approx(found.cov_scale * adjustment.covariance_m2)
    assert found.full_covariance_m2(["P3"]) == pytest.approx(
        found.covariance_m2[found.names.index("P3")], rel=1e-6
    )
    assert found.full_covariance_m2([]).shape == (0, 0)  # no target of a scan was surveyed
    assert found.causes[0].column_m == pytest.approx(
        adjustment.sigma0 * adjustment.causes[0].column_m
    )


def test_points_of_the_wall(photos, adjustment):
    """Closed form: 10 mm off a circle's radius, outside and inside; covariance as adjusted."""
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.column_stack([7 * np.sin(angle) + 3, 7 * np.cos(angle) - 2, angle])
    for side in (1.0, -1.0):
        moved = move_to_wall(ring, np.full(12, 0.01 * side))
        assert np.hypot(*(moved[:, :2] - [3, -2]).T) == pytest.approx(7 - 0.01 * side, abs=1e-9)
        assert moved[:, 2] == pytest.approx(ring[:, 2])
    measurements = photos[0]
    some = Targets(
        ("P5", "P1", "P30", "P9", "absent"), ("1", "1", "3", "1", "1"), ("6", "2", "7", "10", "1"),
        np.full(5, np.nan), np.array([0.004, 0.004, 0.004, 0.004, 0.0]), (2, 3, 4, 5, 6),
    )  # fmt: skip
    points = wall_points(adjustment, replace(measurements, targets=some), "outside")
    assert points.names == ("P5", "P1", "P30", "P9")
    assert points.generatrix == ("6", "2", "7", "10")
    assert points.rows == (2, 3, 4, 5)
    assert points.from_adjustment
    place = [adjustment.names.index(name) for name in points.names]
    away = points.xyz_m - adjustment.xyz_m[place]
    assert np.linalg.norm(away, axis=1) == pytest.approx(0.004)
    full = adjustment.full_covariance_m2(points.names)
    assert points.covariance_m2.dense() == pytest.approx(full)
    column = adjustment.causes[0].column_m.reshape(-1, 3)[place].ravel()
    assert points.causes[0].column_m == pytest.approx(column)
    inside = wall_points(adjustment, replace(measurements, targets=some), "inside")
    assert inside.xyz_m - adjustment.xyz_m[place] == pytest.approx(-away)
    with pytest.raises(SolutionError, match=r"no target of targets.csv was adjusted"):
        wall_points(
            adjustment, replace(measurements, targets=replace(some, point=("a",) * 5)), "inside"
        )


def test_too_many_points_of_the_wall_are_refused(photos, adjustment, monkeypatch):
    monkeypatch.setattr("tankcal.survey.points.LARGEST", 20)
    with pytest.raises(
        SolutionError, match="48 points of the wall were adjusted; expected at most 20"
    ):
        wall_points(adjustment, photos[0], "outside")


def test_stations_are_not_of_the_wall():
    measurements, _ = by_instruments()
    points = wall_points(adjust_survey(measurements), measurements, "outside")
    assert len(points.names) == 24
    assert not {one.station for one in measurements.setups} & set(points.names)


@pytest.mark.slow
def test_a_point_with_one_ray_is_set_aside(photos):
    images = photos[0].image_points
    keep = np.ones(len(images.photo), dtype=bool)
    mine = [i for i, name in enumerate(images.point) if name == "P20"]
    keep[mine[1:]] = False
    rows = np.flatnonzero(keep)
    fewer = replace(
        images, photo=tuple(images.photo[i] for i in rows),
        point=tuple(images.point[i] for i in rows), xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows], check=images.check[rows],
        rows=tuple(images.rows[i] for i in rows),
    )  # fmt: skip
    found = adjust_survey(replace(photos[0], image_points=fewer))
    assert "point P20 has only one ray" in found.aside
    assert "P20" not in found.names
    told = [str(one) for one in found.warnings]
    assert f"image_points.csv, row {images.rows[mine[0]]}: point P20 has only one ray" in told


def test_a_photo_with_too_few_points_is_refused(photos):
    images = photos[0].image_points
    of = [i for i, name in enumerate(images.photo) if name == "S3"][2:]
    check = images.check.copy()
    check[of] = True
    with pytest.raises(InputError, match=r"photos.csv, row 5: photo S3 has 2 image points; at lea"):
        adjust_survey(replace(photos[0], image_points=replace(images, check=check)))


@pytest.mark.slow
def test_image_points_need_an_sd(photos):
    images = replace(
        photos[0].image_points, sd_mm=np.full_like(photos[0].image_points.sd_mm, np.nan)
    )
    bare = replace(photos[0], image_points=images)
    with pytest.raises(InputError, match="image points have no standard deviation"):
        adjust_survey(bare)
    given_sd = replace(bare, settings=AdjustmentSettings(image_sd_mm=0.005))
    assert adjust_survey(given_sd).sigma0 == pytest.approx(
        adjust_survey(photos[0]).sigma0, rel=1e-6
    )


def test_a_levelled_line_alone():
    """Closed form: two ways from A to B, weights by their sds; x and y are nobody's business."""
    control = known(["A", "B"], [[0, 0, 10.0], [50, 0, np.nan]], [[np.nan, np.nan, 0.0]])
    levels = table(
        "height_differences", [1.0, 2.0, 3.03], [0.01, 0.01, 0.01], ["A", "C", "A"], ["C", "B", "B"]
    )
    found = adjust_survey(Measurements(control=control, readings=(levels,)))
    z = dict(zip(found.names, found.xyz_m[:, 2], strict=True))
    assert z["A"] == 10.0
    assert z["B"] == pytest.approx(13.02)
    assert z["C"] == pytest.approx(11.01)
    assert found.redundancy == 1
    assert found.fixed[:, :2].all()
    assert any("nothing about x and y" in str(one) or "x and y of" in str(one)
               for one in found.warnings)  # fmt: skip


@pytest.mark.slow
def test_the_bend_of_the_earth_less_refraction():
    """Simulation: over 2 km targets seem (1 - k) s2 / 2R = 0.27 m lower; k = 0.13 helps."""
    rng = np.random.default_rng(1)
    xyz = np.array([[0, 0, 0], [2000, 0, 30], [900, 1700, 60], [-800, 1500, 10], [400, 800, 25.0]])
    names = ("A", "B", "C", "D", "E")
    pairs = [(i, j) for i in range(5) for j in range(5) if i != j]
    start, end = (np.array(a) for a in zip(*pairs, strict=True))
    d = xyz[end] - xyz[start]
    p2 = np.sum(d[:, :2] ** 2, axis=1)
    z = d[:, 2] - (1 - 0.13) / (2 * EARTH_RADIUS_M) * p2
    vertical = np.arctan2(z, np.sqrt(p2)) + rng.normal(0, 1e-9, len(z))
    length, azimuth = np.sqrt(p2 + d[:, 2] ** 2), np.arctan2(d[:, 0], d[:, 1])
    who = [names[i] for i in start], [names[i] for i in end]
    measured = Measurements(
        settings=AdjustmentSettings(refraction=0.13),
        control=known(["A"], [[0, 0, 0.0]], 0.0),
        readings=(
            table("vertical_angles", vertical, 5e-6, *who),
            table("distances", length, 0.005, *who, instrument=(None,) * len(length)),
            table("azimuths", azimuth, 5e-6, *who),
        ),
    )
    found = adjust_survey(measured)
    order = [names.index(name) for name in found.names]
    assert found.xyz_m == pytest.approx(xyz[order], abs=1e-4)
    flat = adjust_survey(replace(measured, settings=AdjustmentSettings(snooping=False)))
    assert np.abs(flat.xyz_m - xyz[[names.index(n) for n in flat.names]]).max() < 0.3
    assert flat.sigma0 > 5


def test_fixed_and_weighted_orientation_of_photos(photos):
    """Property: x, y, z and all angles fixed stay; weighted elements come out within their sds."""
    measurements, truth = photos
    from tankcal.geometry.rotations import angles_of

    angles = angles_of(truth.rotation)
    sds = {
        0: np.zeros(6),
        2: np.array([0.001] * 3 + [1e-4] * 3),
        4: np.array([0.01, np.nan, 0] + [np.nan] * 3),
    }
    pictures = tuple(
        replace(one, values=np.append(truth.photo_xyz_m[i], angles[i]), sd=sds.get(i, one.sd))
        for i, one in enumerate(measurements.photos)
    )
    found = adjust_survey(replace(measurements, photos=pictures))
    xyz, turned, covariance = found.adjusted.photos
    assert xyz[0] == pytest.approx(truth.photo_xyz_m[0], abs=1e-12)
    assert np.abs(covariance[0]).max() == 0
    assert xyz[4, 2] == pytest.approx(truth.photo_xyz_m[4, 2], abs=1e-12)
    assert np.abs(xyz[2] - truth.photo_xyz_m[2]).max() < 0.005
    kinds = {(one.kind, one.ids, one.element) for one in found.readings if one.file == "photos.csv"}
    assert ("exterior orientation", ("S2",), "x") in kinds
    assert ("exterior orientation", ("S4",), "x") in kinds
    assert ("photo rotation", ("S2",), "about x") in kinds
    assert turned[0] == pytest.approx(angles[0], abs=1e-9)


@pytest.mark.slow
def test_a_second_system_of_control(photos):
    """Simulation: control in a turned and shifted system helps, and its transformation is found."""
    measurements, truth = photos
    from tankcal.geometry.rotations import rotation_of_angles

    rotation, shift = rotation_of_angles(0.02, -0.03, 1.1), np.array([1000.0, 2000.0, 50.0])
    rng = np.random.default_rng(3)
    names = ["P2", "P8", "P22", "P28", "P40", "P46"]
    own = truth.xyz_m[[int(name[1:]) for name in names]]
    theirs = own @ rotation.T + shift + rng.normal(0, 0.001, (6, 3))
    control = measurements.control
    both = replace(
        control, point=(*control.point, *names), xyz_m=np.vstack([control.xyz_m, theirs]),
        sd_m=np.vstack([control.sd_m, np.full((6, 3), 0.001)]),
        system=(*control.system, *["site"] * 6), check=np.zeros(14, dtype=bool),
        rows=tuple(range(2, 16)),
    )  # fmt: skip
    found = adjust_survey(replace(measurements, control=both))
    state = found.adjusted.solution.unknowns
    assert state.system[0] == pytest.approx(rotation, abs=1e-3)
    assert found.redundancy == adjust_survey(measurements).redundancy + 18 - 6
    assert 0.7 < found.sigma0 < 1.3
    group = next(
        one for one in found.groups if one.kind == "control coordinate of a further system"
    )
    assert (group.name, group.count) == ("site", 18)


def test_nothing_to_adjust_is_refused():
    with pytest.raises(InputError, match="the survey has no observations"):
        adjust_survey(Measurements())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_statistics_of_simulated_surveys(seed):
    """Simulation: points within their sds, chi-square of 144 coordinates in its 99.9 % bounds."""
    measurements, truth = by_photographs(seed + 10)
    found = adjust_survey(measurements)
    away = places(found, truth).ravel()
    square = away @ np.linalg.solve(found.full_covariance_m2(), away)
    low, high = scipy.stats.chi2.ppf([0.0005, 0.9995], len(away))
    assert low < square < high
