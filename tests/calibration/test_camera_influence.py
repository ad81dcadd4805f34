"""One block with several calibrations: known truth, predicted signs, the same observations for all.

The first block is a stereo flight with known stations: there a wrong c and a wrong K1 have closed
forms. The second is a tank photographed from all around.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from networks import CONTROL_SD_M, INTERIOR, photographed, tank_points
from photographed_jobs import by_tape, control_of, measurements, tank_job

import tankcal
from tankcal.calibration.influence.blocks import compare_blocks, make_block
from tankcal.calibration.influence.runs import (
    add_pixel_size,
    exchange_calibration,
    influence,
    leave_out_readings,
    select_free_parameters,
)
from tankcal.calibration.product.differences import collect_differences
from tankcal.camera.model import PARAMETERS, Form, distort_image_points
from tankcal.errors import InputError
from tankcal.geometry.rotations import rotation_of_angles, rotation_vector
from tankcal.job.model import Job, Material
from tankcal.record.adjustment import adjustment_of
from tankcal.record.camera import plain_influence
from tankcal.record.schema import to_plain
from tankcal.survey.measurements import (
    AdjustmentSettings,
    CameraSetup,
    ImageReadings,
    Instrument,
    KnownPoints,
    Measurements,
    Photo,
    Readings,
)
from tankcal.survey.network import Camera
from tankcal.survey.results import Reading
from tankcal.text.shipped import shipped_folder

HEIGHT_M, BASE_M, IMAGE_SD_MM = 200.0, 60.0, 0.0005
SLOW_FIXTURES = {"tank"}  # seconds each
FLIGHT = np.array([4.38, 0.01, -0.02, -4e-3, 2e-4, 0, 0, 1e-4, -5e-5, 0, 0, 1e-4, 2e-4])
LENS = Form("correction_subtracted", "both_x")
GROUND = (9, 13, 20, 25, 29)
HALF_FRAME_MM = (3.0, 2.2)
SD = np.where(FLIGHT != 0, np.maximum(np.abs(FLIGHT) * 1e-3, 1e-7), np.nan)
CONTROL = tuple(f"P{i}" for i in range(1, 48, 6))


def flight(noise=0.0, held=True, control=()):
    """A Job: six vertical photos in two strips, check points, control among them by number.

    held  True: stations and rotations are known exactly; else stations to 1 cm
    """
    rng = np.random.default_rng(4)
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-100, 220, 8), np.linspace(-60, 180, 5)))
    ground = np.column_stack([x, y, 30.0 * rng.random(len(x))])
    places = np.array([[i * BASE_M, j * 120.0, HEIGHT_M] for j in (0, 1) for i in range(3)])
    names, photos, points, xy = tuple(f"G{i}" for i in range(len(ground))), [], [], []
    for i, place in enumerate(places):
        u, v, w = (ground - place).T
        ideal = FLIGHT[0] * np.column_stack([-u / w, -v / w])
        inside = np.flatnonzero((np.abs(ideal) < HALF_FRAME_MM).all(axis=1))
        seen = np.full_like(ideal, np.nan)
        seen[inside] = distort_image_points(ideal[inside], FLIGHT, LENS)
        photos += [f"F{i}"] * len(inside)
        points += [names[k] for k in inside]
        xy.append(seen[inside])
    xy = np.vstack(xy)
    sd = np.zeros(6) if held else np.array([0.01, 0.01, 0.01, np.nan, np.nan, np.nan])

    def known(chosen, sd_m, file):
        n = len(chosen)
        return KnownPoints(
            tuple(names[i] for i in chosen), ground[chosen], np.full((n, 3), sd_m), (None,) * n,
            np.zeros(n, dtype=bool), file=file,
        )  # fmt: skip

    checks = [i for i in range(len(names)) if i not in control]
    return Job(
        None, None, None, None, Material(), (), None,
        measurements=Measurements(
            settings=AdjustmentSettings(snooping=False),
            cameras=(setup_of(FLIGHT, "own", LENS),),
            photos=tuple(
                Photo(f"F{i}", "own", np.concatenate([place, np.zeros(3)]), sd)
                for i, place in enumerate(places)
            ),
            image_points=ImageReadings(
                tuple(photos), tuple(points), xy + noise * rng.normal(0, IMAGE_SD_MM, xy.shape),
                np.full(xy.shape, IMAGE_SD_MM), np.zeros(len(points), dtype=bool),
            ),
            control=known(list(control), 0.02, "control.csv") if control else None,
            check=known(checks, 0.001, "check.csv"),
        ),
    )  # fmt: skip


def setup_of(values, name, form=LENS, sd=SD, **more):
    """A CameraSetup that holds all its parameters."""
    used = [
        value != 0 or parameter == "c" for parameter, value in zip(PARAMETERS, values, strict=True)
    ]
    scope = tuple("camera" if one else "off" for one in used)
    camera = Camera(np.array(values, dtype=float), form, sd, scope, ("fixed",) * 13, name)
    return CameraSetup(camera, np.array([6.17, 4.63]), np.full(2, 6.17 / 4608), **more)


def changed(name, **by):
    """The calibration of the flight with some parameters changed."""
    values = FLIGHT.copy()
    for parameter, change in by.items():
        values[PARAMETERS.index(parameter)] += change
    return setup_of(values, name)


def depths_at(job, run):
    """(n,) depths below the stations of the check points of a run."""
    known = dict(zip(job.measurements.check.point, job.measurements.check.xyz_m, strict=True))
    return np.array([HEIGHT_M - known[name][2] for name in run.block.check.names])


def differences_at(run):
    """Names and differences (n, 3) at the check points of a run, product minus truth."""
    return run.block.check.names, run.block.check.difference_m


def test_the_camera_that_made_the_images_changes_nothing():
    found = influence(flight(), (setup_of(FLIGHT, "same"),), ("fixed",))
    run, pair = found.runs[1], found.pairs[0]
    assert np.abs(differences_at(run)[1]).max() < 1e-8
    assert run.block.images.largest_mm < 1e-9
    assert (pair.points.largest_xyz_m, pair.photos.largest_xyz_m) == (0, 0)
    assert pair.photos.largest_turn_rad == 0


@pytest.mark.slow
def test_a_wrong_principal_distance_stretches_the_depth(figure):
    # closed form: stations held, vertical photos: depths are c'/c times the true ones, plan is
    # right, and no image tells: the corrections are of the measured coordinate, without c
    share = 0.01
    job = flight()
    found = influence(job, (changed("long", c=share * FLIGHT[0]),), ("fixed",)).runs[1]
    d = differences_at(found)[1]
    depth = depths_at(job, found)
    assert np.abs(d[:, :2]).max() < 1e-7
    assert d[:, 2] == pytest.approx(-share * depth, abs=1e-7)
    assert found.block.images.largest_mm < 1e-8
    check = found.block.check.checks[2]
    assert check.biased
    assert check.rmse_m == pytest.approx(np.sqrt(np.mean((share * depth) ** 2)), abs=1e-7)
    assert check.rmse_unbiased_m == pytest.approx(np.std(share * depth), abs=1e-7)
    figure("bias of z by c one percent too long, 200 m above ground, m", round(check.mean_m, 3))


@pytest.mark.slow
def test_the_check_points_are_those_of_the_record():
    # second method: the record of the same adjustment
    job = flight(1.0, False, GROUND)
    adjustment = tankcal.adjust_job(job)
    record = to_plain(adjustment_of(adjustment, job.measurements))
    found = influence(job, (setup_of(FLIGHT, "same"),), ("fixed",)).runs[0]
    names, d = differences_at(found)
    for source in (record, adjustment):
        expected = collect_differences(source)
        assert expected.names == names
        assert expected.difference_m == pytest.approx(d, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("side", [1, -1])
def test_a_wrong_k1_lifts_or_sinks_the_points(side):
    # the correction is subtracted: a larger K1 makes rays steeper, parallaxes smaller, points lower
    found = influence(flight(), (changed("k", K1=side * 2e-4),), ("fixed",)).runs[1]
    d = differences_at(found)[1]
    assert (np.sign(d[:, 2]) == -side).mean() > 0.9
    assert np.sign(found.block.check.checks[2].mean_m) == -side
    assert found.block.images.largest_mm > 1e-6


def test_a_small_wrong_k1_has_the_depth_of_its_parallax():
    # closed form: two rays in one strip, x and y alike scaled by 1 - dK r^2: dz/depth = d(p)/p
    job, dk = flight(), 1e-5
    images = job.measurements.image_points
    of = {}
    for photo, point, xy in zip(images.photo, images.point, images.xy_mm, strict=True):
        of.setdefault(point, {})[photo] = xy
    two = [name for name, rays in of.items() if set(rays) == {"F0", "F1"}]
    found = influence(job, (changed("k", K1=dk),), ("fixed",)).runs[1]
    names, d = differences_at(found)
    assert two
    for name in two:
        i = names.index(name)
        depth = depths_at(job, found)[i]
        left, right = (of[name][photo] - FLIGHT[1:3] for photo in ("F0", "F1"))
        change = -dk * (left[0] * (left @ left) - right[0] * (right @ right))
        parallax = FLIGHT[0] * BASE_M / depth
        assert d[i, 2] == pytest.approx(depth * change / parallax, rel=0.05, abs=2e-4)


@pytest.mark.slow
def test_free_is_the_same_from_every_start():
    # property: start values do not matter; here stations are known to 1 cm, rotations free
    starts = (changed("near", c=0.002, K1=1e-4), changed("far", c=-0.05, x0=0.02, K1=-1e-3))
    found = influence(flight(1.0, False, GROUND), starts, ("free",))
    assert [run.outcome for run in found.runs[1:]] == ["adjusted"] * 2
    near, far = (run.block for run in found.runs[1:])
    assert near.sigma0 == pytest.approx(far.sigma0, abs=1e-6)
    pair = next(one for one in found.pairs if (one.one, one.other) == (1, 2))
    assert pair.points.largest_xyz_m < 1e-5
    assert pair.photos.largest_xyz_m < 1e-5
    for one, other in zip(near.interior, far.interior, strict=True):
        assert one.value == pytest.approx(other.value, abs=0.02 * one.sd)
        assert one.start != other.start or one.parameter not in ("c", "K1", "x0")


@pytest.mark.slow
def test_weighted_lies_between_fixed_and_free():
    # property: the tighter the sds the nearer to fixed, the looser the nearer to free
    wrong = changed("wrong", c=0.02)
    job = flight(1.0, False, GROUND)

    weighted = tuple(
        replace(wrong, camera=replace(wrong.camera, sd=SD * factor, name=f"times {factor:g}"))
        for factor in (1e-4, 1.0, 1e6)
    )
    runs = (
        *influence(job, weighted, ("weighted",)).runs[1:],
        influence(job, (wrong,), ("free",)).runs[1],
    )
    tight, between, loose, free = (run.block.interior[0].value for run in runs)
    assert tight == pytest.approx(FLIGHT[0] + 0.02, abs=1e-5)
    assert loose == pytest.approx(free, abs=1e-5)
    assert free < between < FLIGHT[0] + 0.02


@pytest.mark.slow
def test_a_calibration_without_sds_is_not_weighted():
    bare = setup_of(FLIGHT, "bare", sd=np.full(13, np.nan))
    some = setup_of(FLIGHT, "some", sd=np.where(np.arange(13) < 3, 0.001, np.nan))
    found = influence(flight(), (bare, some), ("fixed", "weighted"))
    assert [run.outcome for run in found.runs] == [
        *("adjusted", "adjusted", "skipped", "adjusted", "adjusted")
    ]
    assert found.runs[2].skipped == "no_sds"
    assert found.runs[4].held == ("K1", "K2", "P1", "P2", "A", "B")
    assert plain_influence(found)["runs"][2]["skipped"] == {"code": "no_sds"}


@pytest.mark.slow
def test_a_run_that_fails_is_a_result():
    # vertical photos of known stations over unknown ground: c and the heights stand for one another
    found = influence(flight(1.0, held=False), (setup_of(FLIGHT, "same"),), ("fixed", "free"))
    assert [run.outcome for run in found.runs] == ["adjusted", "adjusted", "failed"]
    assert "c of own and the places of" in found.runs[2].message
    assert [(one.one, one.other) for one in found.pairs] == [(0, 1)]
    written = plain_influence(found)
    json.dumps(written, allow_nan=False)
    assert written["runs"][2]["message"] == found.runs[2].message
    assert written["runs"][2]["shifts"] is None


# what is refused


def test_unfit_calibrations_are_reported_at_once():
    own = setup_of(FLIGHT, "a")
    others = (
        own,
        own,
        replace(own, camera=replace(own.camera, name="b"), format_mm=np.array([6.0, 4.63])),
        replace(own, camera=replace(own.camera, name="c"), pixel_mm=np.full(2, 0.0013)),
        setup_of(np.where(np.arange(13) == 3, np.nan, FLIGHT), "d"),
        replace(own, camera=replace(own.camera, name="e"), format_mm=None, pixel_mm=None),
    )
    with pytest.raises(InputError) as caught:
        influence(flight(), others)
    told = [(one.column, one.expected) for one in caught.value.problems]
    assert [name for name, _ in told] == ["a", "b", "c", "d"]
    for (_, text), part in zip(
        told, ("twice", "format is 6 x 4.63", "pixel", "finite"), strict=True
    ):
        assert part in text


@pytest.mark.slow
def test_one_of_several_cameras_must_be_named():
    job = flight()
    one, *photos = job.measurements.photos
    second = setup_of(FLIGHT, "second")
    both = replace(
        job.measurements,
        cameras=(*job.measurements.cameras, second),
        photos=(replace(one, camera="second"), *photos),
    )
    job = replace(job, measurements=both)
    calibrations = (changed("long", c=0.04),)
    with pytest.raises(InputError, match="several cameras"):
        influence(job, calibrations)
    with pytest.raises(InputError, match="no photos of a camera third"):
        influence(job, calibrations, camera="third")
    found = influence(job, calibrations, ("fixed",), camera="second")
    assert found.camera == "second"
    images = found.runs[1].block.images
    assert images.largest_photo == "F0"
    assert images.n < len(both.image_points.photo) / 3
    assert found.runs[1].block.interior[0].value == FLIGHT[0] + 0.04


def test_nothing_to_replace():
    with pytest.raises(InputError, match="no photographs"):
        influence(replace(flight(), measurements=None), (setup_of(FLIGHT, "a"),))
    with pytest.raises(InputError, match="no calibrations"):
        influence(flight(), ())
    for states in ((), ("loose",)):
        with pytest.raises(ValueError, match="states"):
            influence(flight(), (setup_of(FLIGHT, "a"),), states)


# the tank


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    """A whole job of a tank, photographed with INTERIOR, with eight control points and tapes."""
    survey = photographed(3)[0]
    control = control_of(survey, CONTROL, tank_points(), CONTROL_SD_M)
    settings = AdjustmentSettings(snooping=True)
    made = measurements(
        survey, by_tape(survey, "tape 1"), control=control, settings=settings,
        instruments=(Instrument("tape 1", "tape", u_scale=1e-4),),
    )  # fmt: skip
    return replace(tank_job(tmp_path_factory.mktemp("tank")), measurements=made)


def calibration(job, name, values=INTERIOR, **by):
    own = job.measurements.cameras[0]
    values = np.array(values)
    for parameter, change in by.items():
        values[PARAMETERS.index(parameter)] += change
    return replace(own, camera=replace(own.camera, name=name, values=values, sd=np.full(13, 0.01)))


@pytest.fixture(scope="module")
def of_tank(tank):
    calibrations = (calibration(tank, "true"), calibration(tank, "long", c=0.2))
    heard = []
    found = influence(
        tank, calibrations, ("fixed", "free"), progress=lambda *one: heard.append(one)
    )
    return found, heard


def test_every_run_is_reported(of_tank):
    _, heard = of_tank
    assert heard == [
        ("reference", 0, 5), ("true, fixed", 1, 5), ("true, free", 2, 5), ("long, fixed", 3, 5),
        ("long, free", 4, 5), ("done", 5, 5),
    ]  # fmt: skip


def test_volumes_come_with_their_differences(of_tank, tank, figure):
    found, _ = of_tank
    volume = [run.volume.value_m3 for run in found.runs]
    assert [run.volume_failed for run in found.runs] == [None] * 5
    for pair in found.pairs:
        assert pair.volume_m3 == pytest.approx(volume[pair.other] - volume[pair.one])
        assert pair.volume_percent == pytest.approx(100 * pair.volume_m3 / volume[pair.one])
    # second method: the job with that camera, computed as any other
    own = calibration(tank, "camera", c=0.2)
    scope = tuple("camera" if value else "off" for value in own.camera.values)
    camera = replace(own.camera, scope=scope, state=("fixed",) * 13)
    settings = AdjustmentSettings(snooping=False)
    with_it = replace(tank.measurements, cameras=(replace(own, camera=camera),), settings=settings)
    alone = tankcal.run(replace(tank, measurements=with_it))
    assert volume[3] == pytest.approx(alone.table.volume_m3[-1], abs=1e-6)
    assert volume[1] == pytest.approx(volume[0], abs=found.runs[0].volume.U_m3)
    assert volume[4] == pytest.approx(volume[2], abs=1e-4)
    assert found.runs[0].volume.height_m == pytest.approx(9.3, abs=1e-3)
    figure("volume of 1234 m3 by c 0.2 % too long, held, m3", round(volume[3] - volume[1], 3))


def test_a_long_camera_moves_back(of_tank):
    # closed form, first order: stations go away from the wall by the share of their distance
    found, _ = of_tank
    true, long = found.runs[1].block, found.runs[3].block
    away = np.linalg.norm(long.place_m[:, :2], axis=1) - np.linalg.norm(true.place_m[:, :2], axis=1)
    share = 0.2 / INTERIOR[0]
    distance = np.linalg.norm(true.place_m[:, :2], axis=1) - 6.5
    assert (away > 0.5 * share * distance).all()
    assert (away < 2.5 * share * distance).all()
    assert long.sigma0 > true.sigma0


def test_the_json_holds_every_run_and_pair(of_tank):
    found = plain_influence(of_tank[0])
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert (found["kind"], len(found["runs"]), len(found["pairs"])) == ("influence", 5, 10)
    assert found["runs"][0]["shifts"] is None
    assert found["runs"][3]["shifts"]["points"]["n"] == 48
    assert found["free"] == ["c", "x0", "y0", "K1", "K2", "P1", "P2", "A", "B"]
    assert found["search"] == {"searched": True, "removed": []}


def test_pairs_add_up(of_tank):
    # property: a to b and b to c is a to c, point by point
    runs = of_tank[0].runs
    xyz = [run.block.xyz_m for run in runs]
    moved = compare_blocks(runs[1].block, runs[3].block)[0]
    assert moved.rms_m == pytest.approx(np.sqrt(np.mean((xyz[3] - xyz[1]) ** 2, axis=0)))
    assert moved.largest_m == pytest.approx(np.abs(xyz[3] - xyz[1]).max(axis=0))
    size = np.linalg.norm(xyz[3] - xyz[1], axis=1)
    assert moved.largest_name == runs[1].block.points[int(size.argmax())]
    assert moved.rms_xyz_m == pytest.approx(np.sqrt(np.mean(size**2)))


@pytest.mark.slow
@pytest.mark.parametrize("datum", ["inner", "minimal", "fixed_photo"])
def test_a_block_that_floats_is_brought_back_first(tank, datum):
    # the datum is free and starts differ; shapes are the same, and so must be what is compared
    settings = AdjustmentSettings(datum=datum, snooping=False)
    control = None if datum == "inner" else tank.measurements.control
    floating = replace(tank.measurements, settings=settings, control=control)
    job = replace(tank, measurements=floating)
    starts = (calibration(tank, "a"), calibration(tank, "b", c=-0.4))
    found = influence(job, starts, ("free",), volume=datum != "fixed_photo")
    pair = next(one for one in found.pairs if (one.one, one.other) == (1, 2))
    assert (pair.aligned, pair.points.n) == (6, 48)
    assert pair.points.largest_xyz_m < 1e-6
    assert pair.photos.largest_xyz_m < 1e-5
    assert pair.photos.largest_turn_rad < 1e-6
    if datum == "minimal":  # held at control: its vertical is known
        assert abs(pair.volume_m3) < 1e-4
    elif datum == "inner":
        assert found.runs[1].volume is None
        assert "vertical" in found.runs[1].volume_failed


def test_control_that_is_held_is_a_frame_not_a_choice(tank):
    # property: with control held exactly nothing is taken out, and held points do not count
    control = tank.measurements.control
    held = replace(control, sd_m=np.zeros_like(control.sd_m))
    settings = AdjustmentSettings(snooping=False)
    job = replace(tank, measurements=replace(tank.measurements, control=held, settings=settings))
    found = influence(job, (calibration(tank, "long", c=0.2),), ("fixed",), volume=False)
    assert (found.pairs[0].aligned, found.pairs[0].points.n) == (0, 40)
    assert found.pairs[0].photos.rms_xyz_m > 0.01
    assert [run.volume for run in found.runs] == [None, None]


def test_a_motion_that_nothing_observes_is_taken_out_exactly(of_tank):
    # closed form: a block turned by 10 degrees, shifted by 3 m and stretched is the same block
    one = of_tank[0].runs[1].block
    turn = rotation_of_angles(0.1, -0.05, np.radians(10))
    shift = np.array([3.0, -2.0, 1.0])
    other = replace(
        one,
        xyz_m=1.01 * one.xyz_m @ turn.T + shift,
        place_m=1.01 * one.place_m @ turn.T + shift,
        rotation=one.rotation @ turn.T,
    )
    points, photos, ways = compare_blocks(replace(one, free_motions=np.eye(7)), other)
    assert ways == 7
    assert points.largest_xyz_m < 1e-11
    assert photos.largest_xyz_m < 1e-11
    assert photos.largest_turn_rad < 1e-11
    # only what is not observed goes: a shift stays when the turns alone are free
    stays = compare_blocks(
        replace(one, free_motions=np.eye(7)[:, 3:6]), replace(one, xyz_m=one.xyz_m + shift)
    )
    assert stays[0].rms_m == pytest.approx(np.abs(shift), rel=0.2)
    still = compare_blocks(one, other)
    size = np.linalg.norm(other.xyz_m - one.xyz_m, axis=1)
    assert still[0].largest_xyz_m == pytest.approx(size.max())
    assert still[1].rms_turn_rad == pytest.approx(np.linalg.norm(rotation_vector(turn[None])))


# the same observations for all


@pytest.fixture(scope="module")
def with_blunders():
    """The shipped survey, for its adjustment, with a blunder in an image and one in a distance."""
    job = tankcal.load(shipped_folder("examples") / "silva-1995-photos", only="adjustment")
    images = job.measurements.image_points
    xy = images.xy_mm.copy()
    xy[100] += [0.3, -0.2]
    tape = job.measurements.readings[0]
    value = tape.value.copy()
    value[2] += 0.05
    return replace(
        job,
        measurements=replace(
            job.measurements,
            image_points=replace(images, xy_mm=xy),
            readings=(replace(tape, value=value), *job.measurements.readings[1:]),
        ),
    )


@pytest.mark.slow
def test_blunders_are_searched_once(with_blunders):
    job = with_blunders
    own = job.measurements.cameras[0]
    bad = replace(own, camera=replace(own.camera, name="bad", values=own.camera.values * 1.002))
    found = influence(job, (bad,), ("fixed", "free"), volume=False)
    reference, fixed, free = found.runs
    files = {(one.file, one.row) for one in found.removed}
    assert files == {
        ("image_points.csv", job.measurements.image_points.rows[100]),
        ("distances.csv", job.measurements.readings[0].rows[2]),
    }
    alone = tankcal.adjust_job(job)
    assert reference.block.sigma0 == pytest.approx(alone.sigma0, abs=1e-8)
    assert reference.block.xyz_m == pytest.approx(alone.xyz_m, abs=1e-8, nan_ok=True)
    assert fixed.block.test.dof == reference.block.test.dof + len(found.free)
    assert free.block.test.dof == reference.block.test.dof
    assert {run.block.images.n for run in found.runs} == {
        len(job.measurements.image_points.rows) - 1
    }
    assert not fixed.block.test.passed
    assert reference.volume is None
    assert len(plain_influence(found)["search"]["removed"]) == 3
    json.dumps(plain_influence(found), allow_nan=False)


def removed(ids, file, row, repeats=1, element=""):
    """A Reading that was rejected."""
    return Reading("", ids, element, file, row, repeats, "m", *(0.0,) * 8, True)


def taped(rows=(2, 3, 4, 5)):
    return Readings(
        "distances", np.ones(4), np.ones(4), ("A", "B", "A", "A"), ("B", "A", "C", "B"),
        np.zeros(4, dtype=bool), instrument=("t", "t", "t", "u"), rows=rows,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "row", "repeats", "expected"),
    [
        ((2, 3, 4, 5), 2, 2, [True, True, False, False]),  # the mean of both ways
        ((2, 3, 4, 5), 2, 1, [True, False, False, False]),
        ((2, 3, 4, 5), 5, 1, [False, False, False, True]),
    ],
)
def test_all_readings_of_a_mean_go_together(rows, row, repeats, expected):
    one = removed(("A", "B"), "distances.csv", row, repeats)
    found = leave_out_readings(Measurements(readings=(taped(rows),)), (one,))
    assert found.readings[0].check.tolist() == expected
    assert not found.settings.snooping


def test_known_coordinates_become_approximations():
    control = KnownPoints(
        ("A", "A", "B"), np.zeros((3, 3)), np.ones((3, 3)), (None, "plant", None),
        np.zeros(3, dtype=bool), (2, 3, 4),
    )  # fmt: skip
    photo = Photo("F", "own", np.zeros(6), np.ones(6))
    found = leave_out_readings(
        Measurements(control=control, photos=(photo, replace(photo, name="G"))),
        (
            removed(("A",), "control.csv", 3, element="y"),
            removed(("B",), "control.csv", 4, element="z"),
            removed(("F",), "photos.csv", 2, element="z"),
            removed(("G",), "photos.csv", 3, element="about y"),
        ),
    )
    gone = np.isnan(found.control.sd_m)
    assert gone.tolist() == [[False] * 3, [False, True, False], [False, False, True]]
    assert np.isnan(found.photos[0].sd).tolist() == [False, False, True, False, False, False]
    assert np.isnan(found.photos[1].sd).tolist() == [False] * 3 + [True] * 3


def test_parameter_of_calibration_only_is_free_in_all_runs():
    setup = setup_of(FLIGHT, "job")
    names = select_free_parameters(setup, (changed("a"), changed("b", K4=1e-9)))
    assert "K4" in names
    assert "K4" not in select_free_parameters(setup, (changed("a"),))


def test_film_stays_in_millimetres_without_pixels():
    film = replace(setup_of(FLIGHT, "job"), pixel_mm=None)
    measured = Measurements(cameras=(film,))
    for pixel_mm in (None, np.array([0.002, 0.003])):
        other = replace(changed("a"), pixel_mm=pixel_mm)
        found, own, _ = exchange_calibration(measured, film, other, "fixed", ("c",))
        assert found.cameras == (own,)
        assert own.pixel_mm is pixel_mm
    digital = setup_of(FLIGHT, "job")
    _, own, _ = exchange_calibration(
        Measurements(cameras=(digital,)), digital, other, "fixed", ("c",)
    )
    assert own.pixel_mm is digital.pixel_mm


def test_film_takes_the_pixel_of_the_calibrations():
    film = replace(setup_of(FLIGHT, "job"), pixel_mm=None)
    fine, same, coarse = (
        replace(changed(name), pixel_mm=np.full(2, size))
        for name, size in (("a", 0.002), ("b", 0.002), ("c", 0.003))
    )
    assert add_pixel_size(film, (film, fine, same)).pixel_mm is fine.pixel_mm
    assert add_pixel_size(film, (film,)) is film
    assert add_pixel_size(film, (fine, coarse)) is film
    assert add_pixel_size(coarse, (fine, same)) is coarse


@pytest.mark.slow
def test_residuals_in_pixels_that_are_not_square(with_blunders):
    """Closed form: a residual of x counts in widths of a pixel, one of y in heights."""
    adjustment = tankcal.adjust_job(with_blunders)
    setup = replace(with_blunders.measurements.cameras[0], pixel_mm=np.array([0.001, 0.004]))
    found = make_block(adjustment, setup).images
    kept = [
        one
        for one in adjustment.readings
        if one.kind == "image coordinate" and not (one.removed or one.check)
    ]
    sizes = [abs(one.residual) / {"x": 0.001, "y": 0.004}[one.element] for one in kept]
    assert found.largest_px == pytest.approx(max(sizes), rel=1e-12)
