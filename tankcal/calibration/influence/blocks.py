"""An adjusted block as the comparison of calibrations needs it, and how two of them differ."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.calibration.product.check import ALPHA, ProductCheck, check_product
from tankcal.calibration.product.differences import differences_of
from tankcal.camera.model import PARAMETERS, UNITS, Form
from tankcal.geometry.rotations import apply_small_rotation, rotation_vector
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.datum import null_space
from tankcal.survey.network.results import GlobalTest

ROUNDS = 20
SETTLED = 1e-13


@dataclass(frozen=True)
class ImageResiduals:
    """Residuals of n images of the camera, mm and px (None: the pixel is not known), x and y.

    largest  of a single coordinate, with its photo and point
    """

    n: int
    rms_mm: np.ndarray
    largest_mm: float
    largest_photo: str
    largest_point: str
    rms_px: np.ndarray | None
    largest_px: float | None


@dataclass(frozen=True)
class InteriorValue:
    """A parameter of the camera: value and sd (0: held) after, start and start_sd before."""

    parameter: str
    unit: str
    value: float
    sd: float
    start: float
    start_sd: float


@dataclass(frozen=True)
class Block:
    """An adjusted block: what calibrations are compared by.

    points    (n,) names                 xyz_m     (n, 3), nan: held fixed by control
    photos    (m,) names                 place_m   (m, 3)       rotation  (m, 3, 3)
    form      camera.Form of the interior parameters
    interior  tuple of InteriorValue     images    ImageResiduals or None
    check     ProductCheck of the check points, or None: there are none
    centre_m  (3,) of the rotations of `ways`
    ways      (7, d) combinations of translation, rotation and scale that no observation feels
    """

    points: tuple
    xyz_m: np.ndarray
    photos: tuple
    place_m: np.ndarray
    rotation: np.ndarray
    sigma0: float
    test: GlobalTest
    form: Form
    interior: tuple[InteriorValue, ...]
    images: ImageResiduals | None
    check: ProductCheck | None
    centre_m: np.ndarray
    ways: np.ndarray


def block_of(adjustment, setup, alpha=ALPHA):
    """The Block of a survey.Adjustment with the job.CameraSetup that it was made with."""
    adjusted = adjustment.adjusted
    photos = adjusted.survey.photos
    place, _, _ = adjusted.photos
    found = adjustment.check_points
    differences = None if found is None else differences_of(adjustment)
    ways, centre = _ways(adjustment)
    return Block(
        points=adjustment.names,
        xyz_m=np.where(adjustment.fixed & (not ways.size), np.nan, adjustment.xyz_m),
        photos=tuple(photos.names),
        place_m=place,
        rotation=adjusted.solution.unknowns.rotation,
        sigma0=adjustment.sigma0,
        test=adjusted.test(),
        form=setup.camera.form,
        interior=_interior(adjustment, setup),
        images=_images(adjustment, setup),
        check=None
        if differences is None
        else check_product(differences.difference_m, names=differences.names, alpha=alpha),
        centre_m=centre,
        ways=ways,
    )


def _ways(adjustment):
    """Ways (7, d) in which the block can move without its datum, and their centre (3,), m.

    None where control acts: then it is the frame, fixed or not.
    """
    datum, survey = adjustment.datum, adjustment.adjusted.survey
    if datum.choice == "control" or not datum.defect:
        return np.zeros((7, 0)), adjustment.adjusted.problem.centre_m
    fixed = survey.photos.fixed.copy()
    if datum.choice == "fixed_photo":
        fixed[[name in datum.held for name in survey.photos.names]] = False
    photos = replace(survey.photos, fixed=fixed)
    loose = assemble(replace(survey, fixed=None, photos=photos))
    return null_space(loose), loose.centre_m


def _own_photos(adjustment, setup):
    survey = adjustment.adjusted.survey
    names = [survey.cameras[i].name for i in survey.photos.camera]
    return [i for i, name in enumerate(names) if name == setup.camera.name]


def _interior(adjustment, setup):
    """InteriorValue of the parameters that are not left out, as the first photo has them."""
    values, free, cofactors = adjustment.adjusted.camera(_own_photos(adjustment, setup)[0])
    variance = adjustment.cov_scale * np.diag(cofactors)
    sds = dict(zip(free, np.sqrt(np.maximum(variance, 0.0)).tolist(), strict=True))
    camera = setup.camera
    return tuple(
        InteriorValue(name, UNITS[name], values[name], sds.get(name, 0.0), float(start), float(sd))
        for name, scope, start, sd in zip(
            PARAMETERS, camera.scope, camera.values, camera.sd, strict=True
        )
        if scope != "off"
    )


def _images(adjustment, setup):
    names = adjustment.adjusted.survey.photos.names
    own = {names[i] for i in _own_photos(adjustment, setup)}
    readings = adjustment.readings
    readings = readings.where(
        readings.are("image coordinate") & ~readings.removed & ~readings.check
    )
    readings = readings.where(
        np.array([ids[0] in own for ids in readings.columns["ids"]], dtype=bool)
    )
    if not len(readings):
        return None
    residual = readings.columns["residual"]
    is_x = readings.columns["element"] == "x"
    worst = readings[int(np.abs(residual).argmax())]
    rms = np.array([np.sqrt(np.mean(residual[one] ** 2)) for one in (is_x, ~is_x)])
    pixel = None if setup.pixel_mm is None else np.broadcast_to(setup.pixel_mm, 2)
    in_px = None if pixel is None else np.abs(residual) / np.where(is_x, *pixel)
    return ImageResiduals(
        n=len(readings) // 2,
        rms_mm=rms,
        largest_mm=float(np.abs(residual).max()),
        largest_photo=worst.ids[0],
        largest_point=worst.ids[1],
        rms_px=None if pixel is None else rms / pixel,
        largest_px=None if in_px is None else float(in_px.max()),
    )


@dataclass(frozen=True)
class Moved:
    """Differences of n places, m: (3,) rms and largest magnitude along x, y, z, and of all three.

    nan where there are none; largest_name  of the place that differs most
    """

    n: int
    rms_m: np.ndarray
    largest_m: np.ndarray
    rms_xyz_m: float
    largest_xyz_m: float
    largest_name: str | None


@dataclass(frozen=True)
class PhotosMoved(Moved):
    """The same of photos, and their turns, rad: (3,) rms about the image's axes, and of the whole.

    largest_turn_name  of the photo that turns most
    """

    rms_rad: np.ndarray
    rms_turn_rad: float
    largest_turn_rad: float
    largest_turn_name: str | None


def differences(one, other):
    """Moved of points and PhotosMoved of photos, other minus one, and the ways taken out before.

    one, other  Block; where no observation feels the whole block move, the other is brought onto
                the one first, in those ways only, by least squares over the common points
    """
    points = [name for name in one.points if name in set(other.points)]
    photos = [name for name in one.photos if name in set(other.photos)]
    a, b = (_rows(block.points, points, block.xyz_m) for block in (one, other))
    p, q = (_rows(block.photos, photos, block.place_m) for block in (one, other))
    r, s = (_rows(block.photos, photos, block.rotation) for block in (one, other))
    if one.ways.shape[1]:
        b, q, s = _brought(one, a, b, q, s)
    turn = rotation_vector(s @ r.transpose(0, 2, 1)) if photos else np.zeros((0, 3))
    angle = np.linalg.norm(turn, axis=1)
    of_photos = _moved(q - p, photos)
    return (
        _moved(b - a, points),
        PhotosMoved(
            **vars(of_photos),
            rms_rad=_rms(turn),
            rms_turn_rad=float(_rms(angle)),
            largest_turn_rad=float(angle.max()) if photos else np.nan,
            largest_turn_name=photos[int(angle.argmax())] if photos else None,
        ),
        one.ways.shape[1],
    )


def _rows(names, wanted, values):
    place = {name: i for i, name in enumerate(names)}
    return values[[place[name] for name in wanted]]


def _rms(values):
    """Root mean square along the first axis, without nan; nan where there is nothing."""
    count = np.isfinite(values).sum(axis=0)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.where(count > 0, np.nansum(values**2, axis=0) / count, np.nan))


def _moved(difference_m, names):
    """The Moved of differences (n, 3); nan: held fixed."""
    there = np.isfinite(difference_m)
    known = np.flatnonzero(there.any(axis=1))
    nan = np.full(3, np.nan)
    if not len(known):
        return Moved(0, nan, nan, np.nan, np.nan, None)
    away = np.where(there, np.abs(difference_m), 0.0)
    size = np.linalg.norm(away[known], axis=1)
    largest = np.where(there.any(axis=0), away.max(axis=0), np.nan)
    worst = names[known[int(size.argmax())]]
    return Moved(
        len(known), _rms(difference_m), largest, float(_rms(size)), float(size.max()), worst
    )


def _brought(one, target, xyz, place, rotation):
    """Points, places and rotations of a block after the motion, in one.ways, onto the target.

    Gauss-Newton: dX = t + r x X + s X about the centre, with (t, r, s) = ways coefficients.
    """
    centre, there = one.centre_m, np.isfinite(target) & np.isfinite(xyz)
    if not there.any():
        return xyz, place, rotation
    xyz, place = xyz - centre, place - centre
    size = max(float(np.nanmax(np.abs(target - centre))), 1e-9)
    scale = np.array([1, 1, 1, *(1 / size,) * 4])
    ways = one.ways / np.linalg.norm(one.ways / scale[:, None], axis=0)
    for _ in range(ROUNDS):
        moving = _derivatives(xyz) @ ways
        left = (target - centre - xyz)[there]
        step = ways @ np.linalg.lstsq(moving[there], left, rcond=None)[0]
        turn = apply_small_rotation(np.eye(3)[None], step[None, 3:6])[0]
        xyz, place = (step[:3] + (1 + step[6]) * a @ turn.T for a in (xyz, place))
        rotation = rotation @ turn.T
        if np.abs(step / scale).max() < SETTLED * size:
            break
    return xyz + centre, place + centre, rotation


def _derivatives(xyz):
    """Derivatives (n, 3, 7) of places by translation, small rotation and scale."""
    x, y, z = xyz.T
    found = np.zeros((len(xyz), 3, 7))
    found[:, :, :3] = np.eye(3)
    found[:, 0, 4], found[:, 0, 5] = z, -y
    found[:, 1, 3], found[:, 1, 5] = -z, x
    found[:, 2, 3], found[:, 2, 4] = y, -x
    found[:, :, 6] = xyz
    return found
