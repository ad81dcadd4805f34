"""Adjusted blocks for the comparison of calibrations, and the differences between two blocks.

Capacity at the top
-------------------

All adjustments of a survey use the points of the wall that the first adjustment accepted. Otherwise
a different set of points would appear as an effect of the camera.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.adjust import gauss_newton
from tankcal.calibration.product import ALPHA, ProductCheck, check_product
from tankcal.calibration.product.differences import collect_differences
from tankcal.camera.model import PARAMETERS, UNITS, Form
from tankcal.geometry.rotations import apply_small_rotation, rotation_vector
from tankcal.pipeline.chain import run
from tankcal.pipeline.checks import refuse_undetermined
from tankcal.pipeline.wall.finding import take_points
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.survey import wall_points
from tankcal.survey.network.adjustment import GlobalTest
from tankcal.survey.network.assembly import assemble
from tankcal.survey.network.datum import motion_derivatives, null_space

MAX_ITERATIONS = 20  # largest number of iterations of the alignment
CONVERGENCE = 1e-13  # largest last step of the alignment, relative to the size of the block
STEP_M = 0.1  # step of the table, m; only its top row is used


@dataclass(frozen=True)
class ImageResiduals:
    """Residuals of n image points of a camera.

    Attributes
    ----------
    n : int
        Number of image points.
    rms_mm, rms_px : ndarray, shape (2,)
        Root mean square of x and y, mm and px; `rms_px` is None if the pixel size is not known.
    largest_mm, largest_px : float
        Largest residual of a coordinate, mm and px (or None).
    largest_photo, largest_point : str
        Photo and point of the largest residual.
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
    """Interior parameter: value and sd (0 if fixed) after, start and start_sd before adjustment."""

    parameter: str
    unit: str
    value: float
    sd: float
    start: float
    start_sd: float


@dataclass(frozen=True)
class Block:
    """Results of an adjusted block for the comparison of calibrations.

    Attributes
    ----------
    points, photos : tuple of str
        Names of the n points and m photos.
    xyz_m : ndarray, shape (n, 3)
        Coordinates of the points, m; nan for coordinates fixed by control.
    place_m, rotation : ndarray, shapes (m, 3) and (m, 3, 3)
        Projection centres, m, and rotation matrices of the photos.
    sigma0, test : float, GlobalTest
        Standard deviation of unit weight and its test.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    interior : tuple of InteriorValue
        Interior parameters.
    images : ImageResiduals or None
        Residuals of the image points.
    check : ProductCheck or None
        Check points, or None if there are no check points.
    centre_m : ndarray, shape (3,)
        Centre of the rotations in `free_motions`, m.
    free_motions : ndarray, shape (7, d)
        Motions that the observations do not determine, as combinations of translation, rotation and
        scale.
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
    free_motions: np.ndarray


def make_block(adjustment, setup, alpha=ALPHA):
    """Create the Block of an adjustment.

    Parameters
    ----------
    adjustment : survey.Adjustment
        The adjusted survey.
    setup : job.CameraSetup
        Camera whose calibration is compared.
    alpha : float, optional
        Significance level of the tests at check points.
    """
    adjusted = adjustment.adjusted
    photos = adjusted.survey.photos
    place, _, _ = adjusted.photos
    check_points = adjustment.check_points
    differences = None if check_points is None else collect_differences(adjustment)
    free_motions, centre = _find_free_motions(adjustment)
    return Block(
        points=adjustment.names,
        xyz_m=np.where(adjustment.fixed & (not free_motions.size), np.nan, adjustment.xyz_m),
        photos=tuple(photos.names),
        place_m=place,
        rotation=adjusted.solution.unknowns.rotation,
        sigma0=adjustment.sigma0,
        test=adjusted.test(),
        form=setup.camera.form,
        interior=_interior_values(adjustment, setup),
        images=_image_residuals(adjustment, setup),
        check=None
        if differences is None
        else check_product(differences.difference_m, names=differences.names, alpha=alpha),
        centre_m=centre,
        free_motions=free_motions,
    )


def _find_free_motions(adjustment):
    """Motions (7, d) that the block can make without its datum, and their centre (3,), m.

    There is no such motion (d = 0) if control points define the frame, fixed or not.
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


def _photos_of_camera(adjustment, setup):
    survey = adjustment.adjusted.survey
    names = [survey.cameras[i].name for i in survey.photos.camera]
    return [i for i, name in enumerate(names) if name == setup.camera.name]


def _interior_values(adjustment, setup):
    """Return InteriorValue of the parameters in the model, from the first photo of the camera."""
    values, free, cofactors = adjustment.adjusted.camera(_photos_of_camera(adjustment, setup)[0])
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


def _image_residuals(adjustment, setup):
    """ImageResiduals of the photos of a camera, or None without image points in use."""
    names = adjustment.adjusted.survey.photos.names
    own_photos = {names[i] for i in _photos_of_camera(adjustment, setup)}
    readings = adjustment.readings
    readings = readings.where(
        readings.are("image coordinate") & ~readings.removed & ~readings.check
    )
    readings = readings.where(
        np.array([ids[0] in own_photos for ids in readings.columns["ids"]], dtype=bool)
    )
    if not len(readings):
        return None
    residual = readings.columns["residual"]
    is_x = readings.columns["element"] == "x"
    worst = readings[int(np.abs(residual).argmax())]
    rms = np.array([np.sqrt(np.mean(residual[rows] ** 2)) for rows in (is_x, ~is_x)])
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
class PositionChanges:
    """Differences of n positions, m; nan without positions.

    Attributes
    ----------
    n : int
        Number of positions.
    rms_m, largest_m : ndarray, shape (3,)
        Root mean square and largest magnitude along x, y and z, m.
    rms_xyz_m, largest_xyz_m : float
        Root mean square and largest length of the differences, m.
    largest_name : str or None
        Name of the position with the largest difference.
    """

    n: int
    rms_m: np.ndarray
    largest_m: np.ndarray
    rms_xyz_m: float
    largest_xyz_m: float
    largest_name: str | None


@dataclass(frozen=True)
class PhotoChanges(PositionChanges):
    """Differences of the positions and orientations of photos.

    Attributes
    ----------
    rms_rad : ndarray, shape (3,)
        Root mean square of the rotations about the axes of the image, rad.
    rms_turn_rad, largest_turn_rad : float
        Root mean square and largest angle of rotation, rad.
    largest_turn_name : str or None
        Photo with the largest rotation.
    """

    rms_rad: np.ndarray
    rms_turn_rad: float
    largest_turn_rad: float
    largest_turn_name: str | None


def compare_blocks(first, second):
    """Differences between two blocks, second minus first.

    Motions that the observations do not determine (`first.free_motions`) are first removed by a
    least-squares fit to the common points.

    Parameters
    ----------
    first, second : Block
        Blocks to compare.

    Returns
    -------
    points : PositionChanges
        Differences of the points.
    photos : PhotoChanges
        Differences of the photos.
    aligned : int
        Number of motions removed.
    """
    points = [name for name in first.points if name in set(second.points)]
    photos = [name for name in first.photos if name in set(second.photos)]
    a, b = (_select_rows(block.points, points, block.xyz_m) for block in (first, second))
    p, q = (_select_rows(block.photos, photos, block.place_m) for block in (first, second))
    r, s = (_select_rows(block.photos, photos, block.rotation) for block in (first, second))
    if first.free_motions.shape[1]:
        b, q, s = _align(first, a, b, q, s)
    turn = rotation_vector(s @ r.transpose(0, 2, 1)) if photos else np.zeros((0, 3))
    angle = np.linalg.norm(turn, axis=1)
    of_photos = _summarise(q - p, photos)
    return (
        _summarise(b - a, points),
        PhotoChanges(
            **vars(of_photos),
            rms_rad=_rms(turn),
            rms_turn_rad=float(_rms(angle)),
            largest_turn_rad=float(angle.max()) if photos else np.nan,
            largest_turn_name=photos[int(angle.argmax())] if photos else None,
        ),
        first.free_motions.shape[1],
    )


def _select_rows(names, wanted, values):
    index = {name: i for i, name in enumerate(names)}
    return values[[index[name] for name in wanted]]


def _rms(values):
    """Root mean square along the first axis, without nan; nan without values."""
    count = np.isfinite(values).sum(axis=0)
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.where(count > 0, np.nansum(values**2, axis=0) / count, np.nan))


def _summarise(difference_m, names):
    """Summarise differences (n, 3) as PositionChanges; nan for fixed coordinates."""
    is_known = np.isfinite(difference_m)
    known = np.flatnonzero(is_known.any(axis=1))
    nan = np.full(3, np.nan)
    if not len(known):
        return PositionChanges(0, nan, nan, np.nan, np.nan, None)
    magnitude = np.where(is_known, np.abs(difference_m), 0.0)
    size = np.linalg.norm(magnitude[known], axis=1)
    largest = np.where(is_known.any(axis=0), magnitude.max(axis=0), np.nan)
    worst = names[known[int(size.argmax())]]
    return PositionChanges(
        len(known), _rms(difference_m), largest, float(_rms(size)), float(size.max()), worst
    )


def _align(reference, target, xyz, place, rotation):
    """Align points, projection centres and rotations of a block with the target.

    Only the motions `reference.free_motions` are allowed. The Gauss-Newton step is
    dX = t + r x X + s X about the centre, where (t, r, s) is a combination of these motions.
    """
    centre, is_known = reference.centre_m, np.isfinite(target) & np.isfinite(xyz)
    if not is_known.any():
        return xyz, place, rotation
    xyz, place = xyz - centre, place - centre
    # Rotations and scale are multiplied by the size of the block, so that all steps are lengths.
    size = max(float(np.nanmax(np.abs(target - centre))), 1e-9)
    scale = np.array([1, 1, 1, *(1 / size,) * 4])
    motions = reference.free_motions
    motions = motions / np.linalg.norm(motions / scale[:, None], axis=0)

    def step_at(block, _):
        design = motion_derivatives(block[0]) @ motions
        misclosure = (target - centre - block[0])[is_known]
        return motions @ np.linalg.lstsq(design[is_known], misclosure, rcond=None)[0]

    def move(block, step):
        xyz, place, rotation = block
        turn = apply_small_rotation(np.eye(3)[None], step[None, 3:6])[0]
        xyz, place = (step[:3] + (1 + step[6]) * a @ turn.T for a in (xyz, place))
        return xyz, place, rotation @ turn.T

    xyz, place, rotation = gauss_newton(
        step_at,
        (xyz, place, rotation),
        move=move,
        is_small=lambda step: np.abs(step / scale).max() < CONVERGENCE * size,
        most_steps=MAX_ITERATIONS,
    )
    return xyz + centre, place + centre, rotation


@dataclass(frozen=True)
class TopVolume:
    """Volume of the tank at the top of its table.

    Attributes
    ----------
    value_m3, u_m3 : float
        Volume and its standard uncertainty, m3.
    U_m3, k : float
        Expanded uncertainty, m3, and coverage factor.
    height_m : float
        Dip at the top of the table, m.
    points : int or None
        Number of points of the wall, or None if the wall was not surveyed.
    """

    value_m3: float
    u_m3: float
    U_m3: float
    k: float
    height_m: float
    points: int | None


class TopOfTank:
    """Volumes at the top of the tank of a job, from different adjustments of its survey."""

    def __init__(self, job):
        self.job, self._wall = job, None

    def compute_volume(self, adjustment):
        """Compute the TopVolume from a survey.Adjustment.

        The first call selects the points of the wall for all calls. Raises SolutionError or
        InputError if the capacity cannot be computed.
        """
        refuse_undetermined(adjustment.datum)
        if self._wall is None:
            accepted = self._run(adjustment)
            points = accepted.job.points.names
            if accepted.accepted is not None:
                self._wall = frozenset(points[i] for i in accepted.accepted)
        return _read_top_volume(self._run(adjustment))

    def _run(self, adjustment):
        """Compute the table of the job, which needs only its top row, from an adjustment."""
        job = self.job
        points = wall_points(adjustment, job.measurements, job.survey.side)
        points, snooping = s_transform(points), job.snooping
        # The selected points are not tested again: they are common to all runs.
        if self._wall is not None:
            chosen = [row for row, name in enumerate(points.names) if name in self._wall]
            points, snooping = take_points(points, np.array(chosen, dtype=int)), False
        table = replace(
            job.table, step_m=STEP_M, height_unit="m", fine_step_m=None, fine_zones=(),
            max_interpolation_error_m3=None, other_densities_kg_m3=(),
        )  # fmt: skip
        job = replace(job, points=points, table=table, measurements=None, snooping=snooping)
        return run(job, simulated=False)


def _read_top_volume(result):
    """TopVolume of the result of a run."""
    height_m = float(result.table.height_m[-1])
    top, accepted = result.at(height_m), result.accepted
    points = None if accepted is None else len(accepted)
    values = (float(value) for value in (top.value_m3, top.u_m3, top.U_m3, top.k))
    return TopVolume(*values, height_m, points)
