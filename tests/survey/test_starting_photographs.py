"""Approximate values of photographs from nothing: relative orientation, joints, bad values."""

import time
from dataclasses import replace

import numpy as np
import pytest
from networks import by_total_station, photographed, tank_points
from test_starting import unknown_photos
from test_starting_networks import control, sides, unknown

from tankcal.camera.model import Form, distort_image_points
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import apply_small_rotation, rotation_of_angles, rotation_of_view
from tankcal.survey.network import Camera, Photos, Survey, adjust
from tankcal.survey.observations import ImageCoordinates, State
from tankcal.survey.start.loose_frames import essential_matrices, relative_poses
from tankcal.survey.start.photographs import Wall, bearings
from tankcal.survey.start_values import approximate

IDEAL = np.where(np.arange(13) < 1, 100.0, 0.0)


def seen_from(xyz, stations, aim, noise_mm=0.0, seed=0):
    """A Survey of photos by an ideal camera that look at `aim`, without start values; the truth."""
    rng = np.random.default_rng(seed)
    d = np.asarray(aim) - stations
    rotation = rotation_of_view(
        np.arctan2(d[:, 0], d[:, 1]),
        np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1])),
        rng.normal(size=len(d)),
    )
    photo, point = (a.ravel() for a in np.mgrid[: len(d), : len(xyz)])
    u, v, w = np.einsum("nij,nj->in", rotation[photo], xyz[point] - stations[photo])
    xy = distort_image_points(100 * np.column_stack([-u / w, -v / w]), IDEAL, Form())
    xy = xy + noise_mm * rng.normal(size=xy.shape)
    nothing = np.full((len(d), 3), np.nan), np.full((len(d), 3, 3), np.nan)
    survey = Survey(
        tuple(f"P{i}" for i in range(len(xyz))),
        np.full(xyz.shape, np.nan),
        image_points=ImageCoordinates(xy, np.full(xy.shape, 0.005), point, photo),
        photos=Photos(tuple(f"S{i}" for i in range(len(d))), np.zeros(len(d), int), *nothing),
        cameras=(Camera(IDEAL, state=("fixed",) * 13),),
    )
    return survey, rotation


def cloud(seed=0, count=25):
    return np.random.default_rng(seed).uniform(-3, 3, (count, 3))


THREE = np.array([[-6.0, -14, 0], [5, -15, 2], [0, -13, 5]])


def test_five_points_give_the_true_essential_matrix():
    """Closed form: E = R [b]x of the truth is, up to its factor, among the solutions."""
    survey, rotation = seen_from(cloud(), THREE[:2], np.zeros(3))
    images = survey.image_points
    f1, f2 = (bearings(images.value[images.photo == i] / 100) for i in (0, 1))
    found = essential_matrices(f1[None, :5], f2[None, :5])
    assert 1 <= len(found) <= 10
    base = rotation[0] @ (THREE[1] - THREE[0])
    turn = rotation[1] @ rotation[0].T
    true = turn @ np.cross(np.eye(3), base).T
    true = true / np.linalg.norm(true)
    off = [min(np.abs(one - true).max(), np.abs(one + true).max()) for one in found]
    assert min(off) < 1e-8
    assert np.abs(np.einsum("kij,nj,ni->kn", found, f1[:5], f2[:5])).max() < 1e-9


@pytest.mark.parametrize("flat", [False, True])
def test_relative_orientation_with_blunders(flat):
    """Property: the true pose, 10 % of the points being wild in either photo."""
    xyz = cloud(1, 60) * ([1, 0.0, 1] if flat else 1)
    survey, rotation = seen_from(xyz, THREE[:2], np.zeros(3), 0.003)
    rng, images = np.random.default_rng(3), survey.image_points
    first, second = (images.value[images.photo == i] / 100 for i in (0, 1))
    for image in (first, second):
        wild = rng.choice(60, 6, replace=False)
        image[wild] += rng.uniform(-0.2, 0.2, (6, 2))
    poses = relative_poses(first, second, 0)
    base = rotation[0] @ (THREE[1] - THREE[0])
    off = [
        max(
            np.abs(pose.rotation - rotation[1] @ rotation[0].T).max(),
            np.abs(pose.base - base / np.linalg.norm(base)).max(),
        )
        for pose in poses
    ]
    assert min(off) < 0.01
    assert flat or len(poses) == 1


@pytest.mark.slow
def test_photographs_alone_give_the_shape():
    """Property: the same free network as from good start values, scale from the tapes."""
    survey, truth = photographed()
    survey = replace(survey, observations=survey.observations[1:])
    found = approximate(unknown(survey))
    assert sides(found.xyz_m) == pytest.approx(sides(truth.xyz_m), abs=0.05)
    ours, theirs = adjust(found, datum="inner"), adjust(survey, datum="inner")
    assert sides(ours.xyz_m) == pytest.approx(sides(theirs.xyz_m), abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_control_observations_and_images_are_enough(share):
    survey, truth = photographed(photos=12, seed=5)
    images, rng = survey.image_points, np.random.default_rng(8)
    wild = rng.choice(len(images.point), int(share * len(images.point)), replace=False)
    xy = images.value.copy()
    xy[wild] += rng.uniform(-20, 20, (len(wild), 2))
    found = approximate(unknown(replace(survey, image_points=replace(images, value=xy))))
    assert np.median(np.abs(found.xyz_m - truth.xyz_m)) < 0.02
    assert np.abs(found.photos.xyz_m - truth.photo_xyz_m).max() < 0.5
    adjusted = adjust(replace(found, image_points=images))
    assert adjusted.xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-7)


@pytest.mark.slow
def test_a_fixed_photo_anchors_the_frame():
    survey, truth = photographed()
    start = unknown(replace(survey, observations=survey.observations[1:]))
    fixed = np.zeros((8, 4), dtype=bool)
    fixed[3] = True
    place, rotation = start.photos.xyz_m.copy(), start.photos.rotation.copy()
    place[3], rotation[3] = truth.photo_xyz_m[3], truth.rotation[3]
    photos = replace(start.photos, xyz_m=place, rotation=rotation, fixed=fixed)
    found = approximate(replace(start, photos=photos))
    assert (found.photos.xyz_m[3] == truth.photo_xyz_m[3]).all()
    assert (found.photos.rotation[3] == truth.rotation[3]).all()
    assert found.photos.xyz_m == pytest.approx(truth.photo_xyz_m, abs=0.1)
    assert found.xyz_m == pytest.approx(truth.xyz_m, abs=0.1)
    assert adjust(found).xyz_m == pytest.approx(truth.xyz_m, abs=0.02)


@pytest.mark.slow
def test_two_points_and_two_heights_are_enough():
    """x, y, z of two points and z of two more (with one, two rotations about the line would do)."""
    survey, rotation = seen_from(cloud(2), THREE, np.zeros(3))
    xyz = cloud(2)
    known = (control(xyz, [0, 1]), control(xyz, [2, 3], axes=(2,)))
    found = approximate(replace(survey, observations=known))
    assert found.xyz_m == pytest.approx(xyz, abs=1e-5)
    assert found.photos.rotation == pytest.approx(rotation, abs=1e-5)


@pytest.mark.slow
def test_plumb_lines_and_an_azimuth_turn_a_free_piece():
    from test_starting_networks import azimuths, distances

    from tankcal.survey.observations import PlumbLines

    xyz = cloud(3)
    xyz[1, :2], xyz[3, :2] = xyz[0, :2], xyz[2, :2]
    survey, _ = seen_from(xyz, THREE, np.zeros(3))
    plumb = PlumbLines(np.zeros((2, 2)), np.full((2, 2), 1e-3), np.array([0, 2]), np.array([1, 3]))
    survey = replace(
        survey,
        observations=(plumb, azimuths(xyz, [(0, 2)]), distances(xyz, [(4, 5), (0, 5)])),
    )
    found = approximate(survey).xyz_m
    off = (found - found[0]) - (xyz - xyz[0])
    mirrored = (found - found[0]) - (xyz - xyz[0]) * [1, 1, -1]
    assert sides(found) == pytest.approx(sides(xyz), abs=1e-5)
    plumb_off = np.abs(found[[1, 3], :2] - found[[0, 2], :2]).max()
    assert plumb_off < 1e-4
    assert np.abs(off).max() < 1e-4 or np.abs(mirrored[:2]).max() < 1e-4  # up or upside down


@pytest.mark.slow
def test_three_photos_of_a_plane():
    xyz = cloud(4) * [1, 0, 1]
    survey, _ = seen_from(xyz, THREE, np.zeros(3), 0.003)
    found = approximate(replace(survey, observations=(control(xyz, [0, 1, 2, 3]),)))
    assert found.xyz_m == pytest.approx(xyz, abs=0.01)


@pytest.mark.slow
def test_two_groups_of_photos_that_share_nothing():
    survey, _ = seen_from(
        np.vstack([cloud(5), cloud(6) + 100]), np.vstack([THREE, THREE + 100]), np.zeros(3)
    )
    images = survey.image_points
    own = (images.photo < 3) == (images.point < 25)
    apart = np.vstack([cloud(5), cloud(6)])
    single, _ = seen_from(apart, np.vstack([THREE, THREE]), np.zeros(3))
    survey = replace(single, image_points=replace(single.image_points, use=own * 1.0))
    with pytest.raises(
        SolutionError, match=r"photos S., S., S. are connected to each other, but share only 0"
    ):
        approximate(survey)


@pytest.mark.slow
def test_bad_start_values_of_all_photos_are_replaced():
    """1 m and 20 deg of error in every photo, and decimetres in the points: the same answer."""
    survey, truth = photographed(photos=12)
    rng = np.random.default_rng(4)
    photos, n = survey.photos, len(survey.photos.names)
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    bad = replace(
        photos,
        xyz_m=photos.xyz_m + rng.uniform(-1, 1, (n, 3)),
        rotation=apply_small_rotation(photos.rotation, np.deg2rad(20) * axis),
    )
    xyz = survey.xyz_m + rng.normal(0, 0.2, survey.xyz_m.shape)
    found = approximate(replace(survey, photos=bad, xyz_m=xyz))
    off = np.linalg.norm(found.photos.xyz_m - truth.photo_xyz_m, axis=1)
    before = np.linalg.norm(bad.xyz_m - truth.photo_xyz_m, axis=1)
    assert np.median(off) < 0.5 * np.median(before)
    assert adjust(found).xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-7)
    fewer = np.where(np.arange(len(xyz))[:, None] % 6 == 1, xyz, np.nan)
    found = approximate(replace(survey, photos=bad, xyz_m=fewer))
    assert adjust(found).xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("turn_deg", [0, 40, 180])
def test_nominal_coordinates_in_another_frame_than_control(turn_deg):
    """Nominal places are decimetres off and turned against the control, which decides."""
    survey, truth = photographed(photos=12)
    rng = np.random.default_rng(6)
    turn = rotation_of_angles(0.0, 0.0, np.deg2rad(turn_deg))
    nominal = tank_points() @ turn.T + [3.0, -2, 0.5] + rng.normal(0, 0.15, truth.xyz_m.shape)
    nominal[1::6] = survey.xyz_m[1::6]  # control points start at their control coordinates
    found = approximate(replace(unknown_photos(survey), xyz_m=nominal))
    assert adjust(found).xyz_m == pytest.approx(adjust(survey).xyz_m, abs=1e-7)


@pytest.mark.slow
def test_the_wall_decides_between_the_poses_of_three_points():
    survey, truth = photographed(noise=0.0, form=Form())
    images = survey.image_points
    decided = 0
    for photo in range(8):
        seen = images.point[images.photo == photo]
        three = seen[[0, 1, -1]]
        known = np.full_like(truth.xyz_m, np.nan)
        known[three] = truth.xyz_m[three]
        use = (images.photo == photo) & np.isin(images.point, three)
        alone = replace(
            unknown_photos(survey),
            points=survey.points,
            xyz_m=known,
            observations=(),
            image_points=replace(
                images,
                point=images.point[use], photo=images.photo[use] * 0, value=images.value[use],
                sd=images.sd[use],
            ),
            photos=Photos(
                ("S",), np.zeros(1, int), np.full((1, 3), np.nan), np.full((1, 3, 3), np.nan)
            ),
            cameras=(replace(survey.cameras[0], values=truth.interior),),
        )  # fmt: skip
        with pytest.raises(SolutionError, match=r"photo S \(3 known points, which several"):
            approximate(alone)
        try:
            found = approximate(alone, wall=Wall(np.zeros(2), 6.5))
        except SolutionError:
            continue
        decided += 1
        away = np.abs(found.photos.xyz_m[0] - truth.photo_xyz_m[photo]).max()
        assert away < 0.05
    assert decided >= 4


@pytest.mark.slow
def test_photographs_hang_on_a_total_station_without_control():
    """Set-ups give frame, scale and vertical; the photos follow from the points that both see."""
    shot, truth = photographed(photos=12)
    sighted, other = by_total_station()
    near = [int(np.argmin(np.linalg.norm(truth.xyz_m - p, axis=1))) for p in other.xyz_m[:24]]
    place = np.array([*near, *range(48, 52)])
    xyz = np.vstack([truth.xyz_m, other.xyz_m[24:]])
    state, observations = State(xyz_m=xyz, nuisance={"orientation_rad": sighted.sets}), []
    for one in sighted.observations:
        again = replace(one, start=place[one.start], end=place[one.end])
        value = again.computed(state, False)[0][:, 0]
        observations.append(replace(again, value=value))
    survey = replace(
        unknown(shot),
        points=tuple(f"P{i}" for i in range(52)),
        xyz_m=np.full((52, 3), np.nan),
        observations=tuple(observations),
        sets=np.full(4, np.nan),
    )
    found = approximate(survey)
    assert sides(found.xyz_m) == pytest.approx(sides(xyz), abs=0.05)
    level = found.xyz_m[:, 2] - found.xyz_m[48, 2]
    assert level == pytest.approx(xyz[:, 2] - xyz[48, 2], abs=0.05)


def many(photos, points, blunders=0.0):
    """Photos about a wall of many points, eight of them known, and the truth."""
    rng = np.random.default_rng(0)
    turn, z = rng.uniform(0, 2 * np.pi, points), rng.uniform(0, 12, points)
    r = 10 + 0.03 * np.cos(2 * turn)
    xyz = np.column_stack([r * np.sin(turn), r * np.cos(turn), z])
    around = np.arange(photos) * 2 * np.pi / photos
    stations = 24 * np.column_stack([np.sin(around), np.cos(around), 0 * around])
    stations[:, 2] = 1.5 + 6 * (np.arange(photos) % 3)
    survey, _ = seen_from(xyz, stations, [0.0, 0, 6], 0.005)
    images = survey.image_points
    facing = np.sum((stations[images.photo] - xyz[images.point]) * xyz[images.point] * [1, 1, 0], 1)
    keep = (facing > 1) & (np.abs(images.value) < 90).all(axis=1)
    xy, point, photo = images.value[keep], images.point[keep], images.photo[keep]
    wild = rng.choice(len(xy), int(blunders * len(xy)), replace=False)
    xy[wild] += rng.uniform(-20, 20, (len(wild), 2))
    images = ImageCoordinates(xy, np.full(xy.shape, 0.005), point, photo)
    known = control(xyz, rng.choice(points, 8, replace=False))
    return replace(survey, image_points=images, observations=(known,)), xyz, stations


@pytest.mark.slow
@pytest.mark.parametrize(
    ("photos", "points", "blunders"),
    [
        (12, 300, 0.0),
        (12, 300, 0.1),
        pytest.param(60, 3000, 0.0, marks=pytest.mark.study),
        pytest.param(200, 20000, 0.1, marks=pytest.mark.study),
    ],
)
def test_large_surveys_start_from_nothing(photos, points, blunders, figure):
    """Simulation: points to 5 cm (the middle one to 1 cm), photos to 10 cm; no n x n array.

    The largest, with blunders, is the hardest; the same without them takes as long.
    """
    survey, xyz, stations = many(photos, points, blunders)
    start = time.process_time()
    found = approximate(survey)
    what = f"start of {photos} photos x {points} points, {blunders:.0%} blunders, s"
    figure(what, time.process_time() - start)
    off = np.linalg.norm(found.xyz_m - xyz, axis=1)
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.98) < 0.05
    assert np.abs(found.photos.xyz_m - stations).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.0, 10.0, 40.0])
def test_one_oriented_photo_and_a_coordinate_of_another(scale):
    """Simulation: the other photo's x alone says how large all is, whatever unit it comes in."""
    survey, truth = photographed(3, photos=6)
    place, photos = scale * truth.photo_xyz_m, survey.photos
    fixed = np.zeros((6, 4), dtype=bool)
    fixed[0], fixed[2, 0] = True, True
    known = np.where(fixed[:, :3], place, np.nan)
    rotation = np.where(fixed[:, 3, None, None], truth.rotation, np.nan)
    found = approximate(
        replace(
            survey,
            xyz_m=np.full_like(truth.xyz_m, np.nan),
            observations=(),
            instruments=(),
            photos=replace(photos, xyz_m=known, rotation=rotation, fixed=fixed),
        )
    )
    off = np.linalg.norm(found.xyz_m - scale * truth.xyz_m, axis=1)
    assert off.max() < 0.03 * scale * 6.5
    assert (found.photos.xyz_m[fixed[:, :3]] == known[fixed[:, :3]]).all()
