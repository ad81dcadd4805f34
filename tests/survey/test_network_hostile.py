"""Surveys that determine less than they seem to: told in words, never a number without meaning."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from networks import photographed, tank_points

from tankcal.camera.model import Form, distort_image_points
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import rotation_of_view
from tankcal.survey.network import Camera, Photos, Survey, adjust
from tankcal.survey.network.adjustment import find_hardly_determined
from tankcal.survey.network.assembly import describe_directions
from tankcal.survey.observations import ControlCoordinates, Distances, ImageCoordinates

SQUARE = np.column_stack(
    [*(a.ravel() for a in np.meshgrid(np.linspace(-4, 4, 5), [0.0], np.linspace(0, 6, 4)))]
)
TANK = tank_points(8, 3)
FOUR = np.array([[-3.0, -15, 2], [3, -15, 3], [0, -15, 5], [1, -15, 1]])
CONVERGENT = {"azimuth": [0.2, -0.2, 0, 0], "tilt": [0, 0, 0.1, 0], "roll": [0, 0, 1.5, 0]}
LEVEL = {"azimuth": [0] * 4, "tilt": [0] * 4, "roll": [0] * 4}
SPREAD = [0, 3, 7, 12, 19]


def scene(xyz, stations, azimuth, tilt, roll, free=(), control=(), tapes=(), noise=1.0):
    """A Survey of points seen in all photos, with a camera of c = 100 mm named UMK."""
    rng, n = np.random.default_rng(1), len(stations)
    rotation = rotation_of_view(
        *(np.array(angle[:n], dtype=float) for angle in (azimuth, tilt, roll))
    )
    photo, point = (a.ravel() for a in np.mgrid[:n, : len(xyz)])
    u, v, w = np.einsum("nij,nj->in", rotation[photo], xyz[point] - stations[photo])
    values = np.where(np.arange(13) == 0, 100.0, 0.0)
    xy = distort_image_points(100 * np.column_stack([-u / w, -v / w]), values, Form())
    xy += noise * rng.normal(0, 0.005, xy.shape)
    observations = []
    if len(control):
        k, axis = np.repeat(control, 3), np.tile([0, 1, 2], len(control))
        value = xyz[k, axis] + noise * rng.normal(0, 0.002, len(k))
        observations.append(ControlCoordinates(value, np.full(len(k), 0.002), k, axis))
    if len(tapes):
        a, b = np.array(tapes).T
        length = np.linalg.norm(xyz[a] - xyz[b], axis=1)
        observations.append(
            Distances(length, np.full(len(a), 1e-3), a, b, instrument=np.full(len(a), -1))
        )
    camera = Camera(
        values,
        scope=tuple("block" if i in free or i == 0 else "off" for i in range(13)),
        state=tuple("free" if i in free else "fixed" for i in range(13)),
        name="UMK",
    )
    return Survey(
        points=tuple(f"P{i}" for i in range(len(xyz))),
        xyz_m=xyz + noise * rng.normal(0, 0.02, xyz.shape),
        image_points=ImageCoordinates(xy, np.full(xy.shape, 0.005), point, photo),
        photos=Photos(
            tuple(f"S{i}" for i in range(n)),
            np.zeros(n, dtype=int),
            stations + noise * rng.normal(0, 0.02, stations.shape),
            rotation,
        ),
        cameras=(camera,),
        observations=tuple(observations),
    )


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_plane_at_right_angles_does_not_determine_c(noise):
    """Closed form: a photo of a plane at right angles knows c over the distance only."""
    survey = scene(SQUARE, FOUR, **LEVEL, free={0}, control=SPREAD, noise=noise)
    with pytest.raises(
        SolutionError,
        match=r"determined by the observations: c of UMK and the positions of all photos cannot be "
        r"told apart; fix c of UMK or give it a standard deviation",
    ):
        adjust(survey)
    known = adjust(scene(SQUARE, FOUR, **LEVEL, control=SPREAD, noise=noise))
    assert known.point_sd_m.max() < 0.01


@pytest.mark.parametrize(
    ("count", "which"),
    [
        (2, "the position of photo S0, the position of photo S1"),
        (5, "the positions of 5 photos (S0, S1, S2, S3, S4)"),
        (7, "the positions of 7 photos (S0, S1, S2, S3, S4 and 2 more)"),
        (9, "the positions of all photos"),
    ],
)
def test_photos_that_nothing_determines_are_named(count, which):
    """Some of nine photos move, and a point with them."""
    columns = np.arange(9 * 6 + 3)
    layout = SimpleNamespace(photos=columns[3:].reshape(9, 6), points=columns[None, :3])
    photos = SimpleNamespace(names=tuple(f"S{i}" for i in range(9)))
    moving = np.zeros((len(columns), 1))
    moving[layout.photos[:count, :3].ravel()] = moving[:3] = 1.0
    told = describe_directions(SimpleNamespace(points=("P",), photos=photos), layout, None, moving)
    assert told == f"{which} and the place of point P cannot be told apart"


def test_the_principal_point_of_photos_that_are_all_upright():
    survey = scene(SQUARE, FOUR, **LEVEL, free={0, 1, 2}, control=SPREAD, noise=0.0)
    with pytest.raises(SolutionError, match=r"defect 3: .* c of UMK, x0 of UMK, y0 of UMK and"):
        adjust(survey)


def test_two_photos_are_enough_for_points_and_not_for_a_camera():
    two = scene(TANK, FOUR[:2], **CONVERGENT, control=SPREAD)
    found = adjust(two)
    assert found.test(0.999).passed
    assert found.point_sd_m.max() < 0.02
    bare = scene(TANK, FOUR[:2], **CONVERGENT, free={0, 1, 2, 3, 4, 11, 12}, tapes=[(0, 12)])
    with pytest.raises(SolutionError, match=r"c of UMK"):
        adjust(bare, datum="inner")


@pytest.mark.slow
def test_control_on_a_line():
    """The rotation about it stays open; the points that it leaves in place are named."""
    oblique = np.vstack([TANK, [[1 + z, 2 + z, z] for z in range(3)]])
    survey = scene(oblique, FOUR, **CONVERGENT, control=[24, 25, 26], noise=0.0)
    with pytest.raises(
        SolutionError,
        match="datum defect 1: the rotation about the line through points P24, P25, P26 is not",
    ):
        adjust(survey)
    noisy = scene(oblique, FOUR, **CONVERGENT, control=[24, 25, 26])
    with pytest.raises(
        SolutionError, match=r"did not converge .* datum defect 1: .* rotation|about"
    ):
        adjust(noisy)


def test_two_points_of_control_leave_a_rotation_open():
    survey = scene(TANK, FOUR, **CONVERGENT, control=[3, 11])
    with pytest.raises(SolutionError, match="the rotation about the line through points P3, P11"):
        adjust(survey)


@pytest.mark.slow
def test_a_camera_from_very_far_away():
    """A narrow bundle tells c and distance apart by noise only: no sd of metres is given."""
    far = scene(TANK, FOUR * [1, 200, 1], **LEVEL, free={0}, control=SPREAD)
    with pytest.raises(SolutionError, match="c of UMK"):
        adjust(far)


def test_photos_from_one_place_place_no_points():
    """All rays of a point along one line but for 2 cm: the points are named as doubtful."""
    survey = scene(TANK, FOUR[[0, 0, 0]], [0.2, 0.1, 0.15], [0, 0.05, 0.1], [0, 0, 1],
                   control=SPREAD)  # fmt: skip
    try:
        found = adjust(survey)
    except SolutionError:
        return
    assert "point P1 is hardly determined" in " ".join(find_hardly_determined(found))


def test_a_camera_that_took_no_photo_has_no_unknowns():
    """Property: nothing changes; its free parameters were refused, by a traceback."""
    survey = photographed()[0]
    spare = replace(survey.cameras[0], name="spare", scope=("camera",) * 13)
    more = replace(survey, cameras=(*survey.cameras, spare))
    assert adjust(more).xyz_m.tolist() == adjust(survey).xyz_m.tolist()


def test_a_camera_without_c_is_refused():
    survey = scene(TANK, FOUR, **CONVERGENT, control=SPREAD)
    camera = replace(survey.cameras[0], scope=("off",) * 13)
    with pytest.raises(SolutionError, match="UMK has no principal distance c"):
        adjust(replace(survey, cameras=(camera,)))
