"""The part of the record on the adjustment of the survey: adjusted quantities and quality."""

from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
from scipy.special import fdtri, gammaincinv

from tankcal.adjust import ALPHA, CRITICAL, POWER, UNCONTROLLED, noncentrality
from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.geometry.rotations import angle_derivatives, angles_of
from tankcal.record.columns import ArrayColumns, ArrayRows, Texts, plain_if_short
from tankcal.record.schema import Columns, Finite, Saved, Text, fill_from, key, text_of
from tankcal.survey.network.quality import ellipsoid_factor, ellipsoids, precision
from tankcal.survey.results import DatumReport, GroupOfReadings, Reading, Readings

ELLIPSE = 0.95  # probability of the saved ellipses and ellipsoids
PROBABILITIES = (0.20, 0.90, 0.95, 0.99)  # of further factors; 0.20 is the standard ellipsoid
UM_PER_MM = 1000.0


class AdjustedPoint(Saved):
    """A point after the adjustment, with its error ellipsoid and its ellipse in plan of 95 %."""

    point: str = key("name")
    kind: str = key('"point", "control", "check" or "station"')
    rays: int = key("photos in which it was measured and not rejected")
    fixed: list[bool] = key("x, y, z: whether the coordinate was held")
    spherical_sd_m: float = key("(sx + sy + sz) / 3")
    quadratic_sd_m: float = key("sqrt(sx² + sy² + sz²)")
    ellipsoid_m: list[float] = key("three semi-axes, the largest first")
    ellipsoid_azimuth_deg: float = key("of the first")
    ellipsoid_elevation_deg: float = key("of the first")
    ellipse_m: list[float] = key("two semi-axes in plan, the largest first")
    ellipse_azimuth_deg: float = key("of the first")


class EllipsoidFactor(Saved):
    """Semi-axes of an ellipsoid relative to the standard ellipsoid."""

    probability: Finite = key("that it contains the point")
    factor: Finite = key("times the standard ellipsoid")


class PointPrecision(Saved):
    """Precision of all points that are not fixed."""

    points: int = key("that are not fixed")
    mean_sd_m: float = key("sqrt(trace / 3n)")
    axis_sd_m: list[float] = key("mean sd along x, y, z")
    smallest_sd_m: list[float] = key("along x, y, z")
    largest_sd_m: list[float] = key("along x, y, z")
    range_m: list[float] = key("largest minus smallest sd along x, y, z")
    spherical_sd_m: float = key("mean of the points")
    quadratic_sd_m: float = key("mean of the points")
    extent_m: float = key("diagonal of the box around the points")
    proportional: float = key("precision is 1 : this value")
    ellipsoid_factors: list[EllipsoidFactor] = key("for other probabilities")
    ellipse_probability: Finite = key("of the listed ellipses and ellipsoids")


class AdjustedPhoto(Saved):
    """A photo: projection centre, angles, their sds, and residuals of its points."""

    photo: str = key("name")
    camera: str = key("name")
    x_m: Finite = key("projection centre")
    y_m: Finite = key("projection centre")
    z_m: Finite = key("projection centre")
    omega_deg: Finite = key("angle about x")
    phi_deg: Finite = key("angle about y")
    kappa_deg: Finite = key("angle about z")
    sx_m: float = key("sd")
    sy_m: float = key("sd")
    sz_m: float = key("sd")
    s_omega_deg: float = key("sd")
    s_phi_deg: float = key("sd")
    s_kappa_deg: float = key("sd")
    points: int = key("used")
    rms_mm: float = key("root mean square residual of an image coordinate")


class AdjustedCamera(Saved):
    """A set of interior parameters, common to several photos."""

    camera: str = key("name")
    photos: list[str] | None = key("with these parameters; null: all photos of the camera")
    convention: str = key("sign of the distortion's terms", of="form.convention")
    affinity: str = key("form of the affinity terms", of="form.affinity")
    radial_balance_mm: float = key("0: not balanced", of="form.radial_balance_mm")
    format_mm: list[Finite] | None = key("width and height of the image")
    pixel_mm: list[float] | None = key("sides of a pixel", of="frame.pixel_mm")
    edge_mm: list[Finite] = key(
        "half width and half height at which edge_um is", of="frame.half_mm"
    )
    edge_known: bool = key("false: estimated from the image points", of="frame_known")
    reach_mm: float = key("of the farthest image point from the middle", of="frame.reach_mm")
    parameters: list[str] = key("names in the model, in the order of the following lists")
    units: list[str] = key("of the values")
    values: list[float] = key("as adjusted")
    sds: list[float] = key("0: fixed")
    scopes: list[str] = key('"block", "camera" or "photo"')
    states: list[str] = key('"free", "weighted" or "fixed"')
    edge_um: list[float] = key("shift of a corner of the image by the value; c: null")
    free: list[str] = key("names of the adjusted parameters")
    covariance: list[list[float]] = key("of the free parameters")
    correlation: list[list[float]] = key("of the free parameters")


class AdjustedInstrument(Saved):
    """Scale and offset of an instrument: reading = true (1 + scale) + offset."""

    instrument: str = key("name")
    kind: str | None = key('"tape", "edm", ...')
    details: dict[str, str] = key("as declared")
    scale_ppm: float = key("as adjusted")
    scale_sd_ppm: float = key("its sd")
    declared_scale_ppm: float = key("before the adjustment")
    declared_scale_sd_ppm: float = key("before the adjustment")
    offset_mm: float = key("as adjusted")
    offset_sd_mm: float = key("its sd")
    declared_offset_mm: float = key("before the adjustment")
    declared_offset_sd_mm: float = key("before the adjustment")


class ControlSystem(Saved):
    """A further system of control: X_system = (1 + scale) R X + shift."""

    system: str = key("name")
    x_m: Finite = key("shift")
    y_m: Finite = key("shift")
    z_m: Finite = key("shift")
    omega_deg: Finite = key("of R")
    phi_deg: Finite = key("of R")
    kappa_deg: Finite = key("of R")
    s_omega_deg: float = key("sd")
    s_phi_deg: float = key("sd")
    s_kappa_deg: float = key("sd")
    scale_ppm: float = key("of lengths")
    scale_sd_ppm: float = key("its sd")


def point_results_of(adjustment, measurements=None):
    """Return the adjusted points as rows with the keys of `AdjustedPoint`, in their order."""
    covariance, dof = np.asarray(adjustment.covariance_m2), adjustment.dof
    sd = np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0))
    axes, directions = ellipsoids(covariance, ELLIPSE, dof)
    azimuth, elevation = _upward_direction(directions[:, :, 0])
    plan, plan_azimuth = _ellipses(covariance[:, :2, :2], dof)
    rays = _count_rays(adjustment)
    spherical, quadratic = sd.mean(axis=1), np.sqrt(np.sum(sd**2, axis=1))
    columns = (
        list(adjustment.names),
        _kinds(adjustment, measurements),
        [rays.get(name, 0) for name in adjustment.names],
        np.asarray(adjustment.fixed),
        *(spherical, quadratic, axes, azimuth, elevation, plan, plan_azimuth),
    )
    keys = (field.name for field in fields(AdjustedPoint))
    return plain_if_short(ArrayRows(ArrayColumns(dict(zip(keys, columns, strict=True)))))


def _upward_direction(vectors):
    """Return azimuth in [0, 360) and elevation in [0, 90], degrees, of axes (n, 3)."""
    up = vectors * np.where(vectors[:, 2:] < 0, -1.0, 1.0)
    azimuth = np.degrees(np.arctan2(up[:, 0], up[:, 1])) % 360
    return azimuth, np.degrees(np.arcsin(np.clip(up[:, 2], 0, 1)))


def _ellipses(covariance_m2, dof):
    """Return semi-axes (n, 2), largest first, and azimuth of the first, of ellipses in plan."""
    # Quantile of chi-square with 2 degrees of freedom, or of 2 F(2, dof) if sigma0 is estimated.
    if np.isinf(dof):
        factor = np.sqrt(2 * gammaincinv(1.0, ELLIPSE))
    else:
        factor = np.sqrt(2 * fdtri(2, dof, ELLIPSE))
    values, vectors = np.linalg.eigh(covariance_m2)
    axes = factor * np.sqrt(np.maximum(values[:, ::-1], 0.0))
    return axes, np.degrees(np.arctan2(vectors[:, 0, 1], vectors[:, 1, 1])) % 180


def _count_rays(adjustment):
    """Return {point: number of photos in which it was measured and not rejected}."""
    survey = adjustment.adjusted.survey
    images = survey.image_points
    if images is None:
        return {}
    counts = np.bincount(images.point[images.in_use], minlength=len(survey.points)).tolist()
    return dict(zip(survey.points, counts, strict=True))


def _kinds(adjustment, measurements):
    """Return the kind of each adjusted point: "station", "control", "check" or "point"."""
    roles = {}
    for role, table in (("check", "check"), ("control", "control")):
        points = getattr(measurements, table, None)
        roles |= dict.fromkeys(points.point if points is not None else (), role)
    roles |= dict.fromkeys(
        (setup.station for setup in getattr(measurements, "setups", ())), "station"
    )
    return [roles.get(name, "point") for name in adjustment.names]


def precision_of(adjustment):
    """Return the `PointPrecision` of an adjustment; None if all points are fixed."""
    free = ~np.asarray(adjustment.fixed).all(axis=1)
    if not free.any():
        return None
    xyz, dof = np.asarray(adjustment.xyz_m)[free], adjustment.dof
    estimate = precision(xyz, np.asarray(adjustment.covariance_m2)[free])
    sd = np.sqrt(np.einsum("nii->ni", np.asarray(adjustment.covariance_m2)[free]))
    return fill_from(
        PointPrecision,
        estimate,
        points=int(free.sum()),
        smallest_sd_m=sd.min(axis=0),
        largest_sd_m=sd.max(axis=0),
        spherical_sd_m=estimate.spherical_sd_m.mean(),
        quadratic_sd_m=estimate.quadratic_sd_m.mean(),
        extent_m=float(np.linalg.norm(np.ptp(xyz, axis=0))),
        ellipsoid_factors=[
            EllipsoidFactor(p, 1.0 if p == PROBABILITIES[0] else ellipsoid_factor(p, dof))
            for p in PROBABILITIES
        ],
        ellipse_probability=ELLIPSE,
    )


def photos_of(adjustment):
    """Return the `AdjustedPhoto` of each photo."""
    survey = adjustment.adjusted.survey
    if survey.photos is None or not len(survey.photos.names):
        return []
    xyz, angles, covariance = adjustment.adjusted.photos
    sd = np.sqrt(adjustment.cov_scale * np.maximum(np.einsum("nii->ni", covariance), 0.0))
    fit = _photo_residuals(adjustment)
    degrees, sd_deg = np.degrees(angles), np.degrees(sd[:, 3:])
    return [
        AdjustedPhoto(
            name,
            survey.cameras[survey.photos.camera[i]].name,
            *(*xyz[i], *degrees[i], *sd[i, :3], *sd_deg[i]),
            *fit.get(name, (0, None)),
        )
        for i, name in enumerate(survey.photos.names)
    ]


def _photo_residuals(adjustment):
    """Return {photo: (number of used points, rms residual of a coordinate in mm)}."""
    readings = adjustment.readings
    used = readings.where(readings.are("image coordinate") & ~readings.removed & ~readings.check)
    photos = Texts.of([ids[0] for ids in used.columns["ids"]])
    count = np.bincount(photos.codes, minlength=len(photos.texts))
    square = np.bincount(photos.codes, used.columns["residual"] ** 2, len(photos.texts))
    rms = np.sqrt(square / count).tolist()
    return dict(zip(photos.texts, zip((count // 2).tolist(), rms, strict=True), strict=True))


def cameras_of(adjustment, measurements=None):
    """Return the `AdjustedCamera` of each set of interior parameters."""
    from tankcal.calibration.interiors import collect_interiors

    return [_camera(interior) for interior in collect_interiors(adjustment, measurements)]


def _camera(interior):
    from tankcal.survey.network import correlations

    values = dict(zip(PARAMETERS, interior.values.tolist(), strict=True))
    sds = dict(
        zip(interior.free, np.sqrt(np.maximum(np.diag(interior.covariance), 0.0)), strict=True)
    )
    scope = dict(zip(PARAMETERS, interior.scope, strict=True))
    state = dict(zip(PARAMETERS, interior.state, strict=True))
    names = [name for name in PARAMETERS if scope[name] != "off"]
    return fill_from(
        AdjustedCamera,
        interior,
        parameters=names,
        units=[UNITS[name] for name in names],
        values=[values[name] for name in names],
        sds=[sds.get(name, 0.0) for name in names],
        scopes=[scope[name] for name in names],
        states=[state[name] for name in names],
        edge_um=[
            _edge_effect(name, values, interior.form, interior.frame.half_mm) for name in names
        ],
        free=list(interior.free),
        correlation=correlations(interior.covariance),
    )


def _edge_effect(name, values, form, corner_mm):
    """Return the largest shift of a corner of the image by a parameter, um; None for c."""
    from tankcal.calibration.interiors import Frame, own_shift

    q = np.array([values[parameter] for parameter in PARAMETERS])
    shift = own_shift(name, q, form, Frame(np.asarray(corner_mm, dtype=float)))
    return None if shift is None else shift.corner_um


def instruments_of(adjustment, measurements=None):
    """Return the `AdjustedInstrument` of each instrument."""
    adjusted = adjustment.adjusted
    nuisance, layout = adjusted.solution.unknowns.nuisance, adjusted.problem.layout.nuisance
    declared = {source.name: source for source in getattr(measurements, "instruments", ())}
    rows = []
    for i, tool in enumerate(adjusted.survey.instruments):
        source = declared.get(tool.name)
        scale_sd, offset_sd_m = (
            _sd_of(adjustment, layout[name][i]) for name in ("scale", "offset_m")
        )
        rows.append(
            AdjustedInstrument(
                instrument=tool.name,
                kind=getattr(source, "kind", None),
                details={
                    name: str(value) for name, value in getattr(source, "details", {}).items()
                },
                scale_ppm=1e6 * nuisance["scale"][i],
                scale_sd_ppm=1e6 * scale_sd,
                declared_scale_ppm=1e6 * tool.scale,
                declared_scale_sd_ppm=1e6 * tool.scale_sd,
                offset_mm=1e3 * nuisance["offset_m"][i],
                offset_sd_mm=1e3 * offset_sd_m,
                declared_offset_mm=1e3 * tool.offset_m,
                declared_offset_sd_mm=1e3 * tool.offset_sd_m,
            )
        )
    return rows


def _sd_of(adjustment, column):
    """Return the standard deviation of an unknown; 0 if it is held."""
    if column < 0:
        return 0.0
    q = adjustment.adjusted.solution.cofactor.among(np.array([column]))[0, 0]
    return float(np.sqrt(adjustment.cov_scale * max(q, 0.0)))


def systems_of(adjustment):
    """Return the `ControlSystem` of each further system of control."""
    adjusted = adjustment.adjusted
    state, problem = adjusted.solution.unknowns, adjusted.problem
    rows = []
    for i, system in enumerate(adjusted.survey.systems):
        # The unknown shift refers to the centre of the points, the saved shift to the origin.
        rotation, scale = state.system[i], float(state.system_scale[i])
        shift = state.system_shift_m[i] - (1 + scale) * (rotation @ problem.centre_m)
        angles = np.degrees(angles_of(rotation))
        turn = angle_derivatives(rotation[None])[0]
        q = adjusted.solution.cofactor.among(problem.layout.system[i, :3])
        sd = np.degrees(np.sqrt(adjustment.cov_scale * np.diag(turn @ q @ turn.T)))
        scale_sd = _sd_of(adjustment, problem.layout.system[i, 6])
        rows.append(ControlSystem(system.name, *shift, *angles, *sd, 1e6 * scale, 1e6 * scale_sd))
    return rows


# ---- image coordinates: repeated readings, fiducial marks, depth of field


class RejectedPointReading(Saved):
    """Readings of a point that scatter beyond the limit."""

    photo: str = key("name")
    point: str = key("name")
    n: int = key("readings")
    sd_x_um: float = key("of one reading")
    sd_y_um: float = key("of one reading")
    row: int | None = key("of the first, in the file")


class RejectedMarkReading(Saved):
    """Readings of a mark that scatter beyond the limit."""

    photo: str = key("name")
    mark: str = key("name")
    n: int = key("readings")
    sd_x_um: float = key("of one reading")
    sd_y_um: float = key("of one reading")
    row: int | None = key("of the first, in the file")


class MeanOfReadings(Saved):
    """An image point with several readings."""

    photo: str = key("name")
    point: str = key("name")
    n: int = key("readings")
    x_mm: float = key("mean")
    y_mm: float = key("mean")
    sd_x_um: float = key("of one reading")
    sd_y_um: float = key("of one reading")


class ImageReadings(Saved):
    """Repeated readings of image points."""

    points: int = key("with several readings")
    readings: int = key("of these points")
    mean_sd_x_um: float = key("mean of the sds")
    mean_sd_y_um: float = key("mean of the sds")
    pooled_sd_x_um: float = key("of one reading of any point")
    pooled_sd_y_um: float = key("of one reading of any point")
    limit_um: float | None = key("sd above which they are rejected", of="limit_mm", times=UM_PER_MM)
    rejected: list[RejectedPointReading] = key("beyond the limit")
    means: list[MeanOfReadings] = key("each point in each photo")


class MarkFit(Saved):
    """A fiducial mark: its readings, and their residuals at its calibrated coordinates."""

    mark: str = key("name")
    n: int = key("readings")
    x_mm: float = key("mean")
    y_mm: float = key("mean")
    sd_x_um: float = key("of one reading")
    sd_y_um: float = key("of one reading")
    calibrated_x_mm: float = key("as declared")
    calibrated_y_mm: float = key("as declared")
    residual_x_um: float = key("transformed minus calibrated")
    residual_y_um: float = key("transformed minus calibrated")


class FiducialTransformation(Saved):
    """A photo read on a comparator: its transformation, and the residuals of its marks."""

    photo: str = key("name")
    camera: str = key("name")
    transformation: str = key("kind", of="transformation.kind")
    parameters: list[str] = key("names")
    values: list[float] = key("of the parameters")
    sds: list[float] = key("of the parameters")
    mirrored: bool = key("whether the plate was read from behind", of="transformation.is_mirrored")
    sigma0: float = key("of the fit", of="transformation.sigma0")
    redundancy: int = key("of the fit", of="transformation.dof")
    largest_um: float = key("largest residual")
    growth: float = key("of the image's errors by the transformation")
    marks: list[MarkFit] = key("each mark")
    rejected: list[RejectedMarkReading] = key("beyond the limit")


class DepthCorrection(Saved):
    """The outer iteration that corrects image points for the depth of field."""

    rounds: int = key("adjustments made")
    last_change_um: float = key("of the last correction", of="last_change_mm", times=UM_PER_MM)
    largest_um: float = key("largest correction, x or y", of="largest_mm", times=UM_PER_MM)
    rms_um: float = key("of all corrections", of="rms_mm", times=UM_PER_MM)
    left: int = key("readings left uncorrected: the point is not in front of the lens")


def image_readings_of(repeats):
    """Return the `ImageReadings` of `RepeatedReadings`; None if each point was read once."""
    if repeats is None:
        return None
    return fill_from(
        ImageReadings,
        repeats,
        points=len(repeats.point),
        readings=int(np.sum(repeats.count)),
        **_pair("mean_sd", repeats.mean_sd_mm),
        **_pair("pooled_sd", repeats.pooled_sd_mm),
        rejected=[_rejection(RejectedPointReading, reading) for reading in repeats.rejected],
        means=[
            MeanOfReadings(photo, point, int(count), *mean, *_um(sd))
            for photo, point, count, mean, sd in zip(
                repeats.photo,
                repeats.point,
                repeats.count,
                repeats.mean_mm,
                repeats.sd_mm,
                strict=True,
            )
        ],
    )


def fiducials_of(fits):
    """Return the `FiducialTransformation` of each photo that was read on a comparator."""
    return [_fit(fit) for fit in fits]


def _fit(fit):
    transformation = fit.transformation
    return fill_from(
        FiducialTransformation,
        fit,
        parameters=list(transformation.parameters),
        values=list(transformation.parameters.values()),
        sds=list(transformation.parameter_sds.values()),
        largest_um=UM_PER_MM * float(np.abs(fit.residual_mm).max()),
        marks=[
            MarkFit(mark, int(count), *mean, *_um(sd), *place, *_um(residual))
            for mark, count, mean, sd, place, residual in zip(
                fit.marks,
                fit.count,
                fit.mean_mm,
                fit.sd_mm,
                fit.calibrated_mm,
                fit.residual_mm,
                strict=True,
            )
        ],
        rejected=[_rejection(RejectedMarkReading, reading) for reading in fit.rejected],
    )


def depth_of(depth):
    """Return the `DepthCorrection` of a `DepthOfField`; None if it was not requested."""
    return fill_from(DepthCorrection, depth)


def _rejection(cls, reading):
    return cls(reading.photo, reading.name, reading.count, *_um(reading.sd_mm), reading.row)


def _um(values_mm):
    return [UM_PER_MM * float(value) for value in values_mm]


def _pair(name, values_mm):
    """Return {name_x_um, name_y_um} of two lengths in mm."""
    return dict(zip((f"{name}_x_um", f"{name}_y_um"), _um(values_mm), strict=True))


CONFIDENCE = 0.95  # of the global test and of the intervals of variance factors
CHECKABLE = 1.0  # least redundancy of a group whose variance factor is judged


@dataclass(frozen=True, kw_only=True)
class AdjustedReading(Reading):
    """A value of an observation: the keys of `Reading`; infinite or unknown values are null."""

    controlled: bool = key("whether other readings would show an error of it")


@dataclass(frozen=True, kw_only=True)
class AdjustedGroup(GroupOfReadings):
    """A group of readings: the keys of `GroupOfReadings`, and the 95 % interval of its factor."""

    factor_low: float | None = key("lower end of the interval of `factor`")
    factor_high: float | None = key("upper end")
    verdict: str = key("a code: as_declared, worse, better, hardly_controlled, not_controlled")


class HeldValue(Saved):
    """A value that is held exactly, and the result of its release."""

    kind: str = key("of observation")
    ids: list[str] = key("names")
    element: str = key('"x", "omega", ...')
    file: str = key("where it was read")
    row: int | None = key("of the file")
    unit: str = key("of value, change, sd and mdb")
    value: float = key("held value")
    released: float | None = key("value estimated from the other readings")
    change: float | None = key("released minus value")
    sd: float | None = key("of the change")
    w: float | None = key("change over its sd")
    mdb: float = key("minimal detectable bias")
    effect_m: float = key("of a bias of the size mdb on a point")
    controlled: bool = key("whether other readings would show an error of it")


class CheckPoint(Saved):
    """A check point: adjusted minus known."""

    point: str = key("name")
    dx_m: float = key("adjusted minus known")
    dy_m: float = key("adjusted minus known")
    dz_m: float = key("adjusted minus known")
    sx_m: float = key("sd of the difference")
    sy_m: float = key("sd of the difference")
    sz_m: float = key("sd of the difference")
    size_m: float = key("of the difference")
    largest_w: float | None = key("largest difference over its sd")


class CheckedPoints(Saved):
    """Check points against the adjustment."""

    points: list[CheckPoint] = key("each of them")
    r_xyz_m: float = key("root of the mean squared magnitude")
    largest_m: float = key("magnitude")
    mean_m: float = key("magnitude")


class SharedCause(Saved):
    """A shared cause of uncertainty, named in the budget."""

    name: str = key("of the instrument")
    what: str = key('"instrument_scale" or "instrument_offset"')
    u: float = key("standard uncertainty")
    unit: str = key("ppm or mm")


class AdjustedSetup(Saved):
    """A set-up of an instrument on a station."""

    setup: str = key("name", of="name")
    station: str = key("name")
    instrument: str | None = key("name")
    height_m: float | None = key("of the instrument")


class AdjustmentRecord(Saved):
    """The adjustment of the survey and its quality."""

    sigma0: float = key("a posteriori; null: no redundancy")
    observations: int = key("values adjusted")
    unknowns: int = key("number")
    redundancy: int = key("of the whole adjustment")
    iterations: int = key("of the last adjustment")
    rounds: int = key("number of adjustments in the search for blunders")
    chi2: float = key("v'Pv")
    chi2_bounds: list[float] | None = key("two-sided bounds of chi2; null: no redundancy")
    confidence: Finite = key("of these bounds")
    passed: bool | None = key("whether chi2 lies between them")
    cov_scale: float = key("factor of every covariance of the record: 1, or sigma0 squared")
    scale: str = key('"a_priori" or "a_posteriori"')
    snooping: bool = key("whether blunders were searched for")
    critical_w: float = key("value of |w| above which a reading is rejected")
    critical_tau: float | None = key("of tau")
    alpha: Finite = key("level of the tests of single readings")
    power: Finite = key("of these tests, for the mdb")
    datum: DatumReport = key("definition of the frame")
    groups: list[AdjustedGroup] = key("kinds of observations and instruments")
    held: list[HeldValue] = key("values held exactly: sd 0")
    removed: list[AdjustedReading] = key("readings rejected, the worst first")
    residuals: Annotated[dict, Columns(AdjustedReading)] | None = key(
        "all readings, a list for each key; null: they are in the file of `long_tables`"
    )
    cameras: list[AdjustedCamera] = key("sets of interior parameters")
    photos: list[AdjustedPhoto] = key("each photo")
    image_readings: ImageReadings | None = key("repeated readings; null: each point was read once")
    fiducials: list[FiducialTransformation] = key("photos read on a comparator")
    depth_of_field: DepthCorrection | None = key("null: not requested")
    instruments: list[AdjustedInstrument] = key("each instrument")
    systems: list[ControlSystem] = key("further systems of control")
    setups: list[AdjustedSetup] = key("each set-up")
    points: list[AdjustedPoint] | None = key(
        "in the order of `points` of the record; null: they are in the file of `long_tables`"
    )
    precision: PointPrecision | None = key("null: every point is fixed")
    check_points: CheckedPoints | None = key("null: there are none")
    causes: list[SharedCause] = key("common to several points")
    aside: list[str] = key("sentences: points that could not be adjusted, with the reason")
    left_out: list[Text] = key("these sentences with their codes")


def adjustment_of(adjustment, measurements=None):
    """Return the `AdjustmentRecord` of an `Adjustment`.

    `measurements` are the `survey.measurements.Measurements` of the adjustment, with settings and
    image formats.
    """
    from tankcal.survey.network.reliability import tau_limit

    settings = getattr(measurements, "settings", None)
    test = adjustment.adjusted.test(CONFIDENCE)
    dof = adjustment.redundancy
    held = adjustment.readings.where(adjustment.readings.hold)
    return fill_from(
        AdjustmentRecord,
        adjustment,
        chi2=test.chi2,
        chi2_bounds=[test.low, test.high] if dof > 0 else None,
        confidence=CONFIDENCE,
        passed=bool(test.passed) if dof > 0 else None,
        scale=getattr(settings, "scale", "a_priori"),
        snooping=getattr(settings, "snooping", True),
        critical_w=CRITICAL,
        critical_tau=tau_limit(ALPHA, dof) if dof > 1 else None,
        alpha=ALPHA,
        power=POWER,
        groups=[_group(group) for group in adjustment.groups],
        held=list(map(_make_held_value, held, _are_controlled(held).tolist())),
        removed=_list_rejected(Readings.of(adjustment.removed)),
        residuals=_columns(adjustment.readings),
        cameras=cameras_of(adjustment, measurements),
        photos=photos_of(adjustment),
        image_readings=image_readings_of(adjustment.repeats),
        fiducials=fiducials_of(getattr(measurements, "fiducials", ())),
        depth_of_field=depth_of(adjustment.depth),
        instruments=instruments_of(adjustment, measurements),
        systems=systems_of(adjustment),
        setups=[fill_from(AdjustedSetup, setup) for setup in getattr(measurements, "setups", ())],
        points=point_results_of(adjustment, measurements),
        precision=precision_of(adjustment),
        check_points=_check_points(adjustment.check_points),
        causes=[fill_from(SharedCause, cause) for cause in adjustment.causes],
        left_out=[text_of(sentence) for sentence in adjustment.aside],
    )


def _list_rejected(readings):
    """Return the `AdjustedReading` of each rejected reading."""
    rows = zip(readings, _are_controlled(readings).tolist(), strict=True)
    return [AdjustedReading(**vars(reading), controlled=controlled) for reading, controlled in rows]


def _columns(readings):
    """Return the columns of all readings, up to 200 000, with the keys of `AdjustedReading`."""
    arrays = readings.columns | {"controlled": _are_controlled(readings)}
    columns = {
        name: column.tolist() if column.dtype == object else column
        for name, column in arrays.items()
    }
    return plain_if_short(ArrayColumns(columns))


def _are_controlled(readings):
    """Return whether other readings would show an error of each reading or held value, (n,)."""
    columns = readings.columns
    of_readings = readings.check | (columns["redundancy"] > UNCONTROLLED)
    return np.where(readings.hold, np.isfinite(columns["mdb"]), of_readings)


def _make_held_value(reading, controlled):
    # mdb = delta0 sd for a value that is released: the others determine it with sd.
    sd = reading.mdb / noncentrality(ALPHA, POWER) if controlled else None
    return fill_from(
        HeldValue,
        reading,
        released=reading.value + reading.w * sd if controlled else None,
        change=reading.w * sd if controlled else None,
        sd=sd,
        w=reading.w if controlled else None,
        controlled=controlled,
    )


def _group(group):
    """Return the `AdjustedGroup` of a group, with the interval of true over declared sd."""
    low = high = None
    if group.redundancy > UNCONTROLLED and np.isfinite(group.factor):
        # factor^2 redundancy / (true factor)^2 has a chi-square distribution.
        tail = (1 - CONFIDENCE) / 2
        square = group.factor**2 * group.redundancy
        bounds = 2 * gammaincinv(group.redundancy / 2, [1 - tail, tail])
        low, high = (float(np.sqrt(square / bound)) if bound > 0 else None for bound in bounds)
    verdict = _judge_group(group, low, high)
    return AdjustedGroup(**vars(group), factor_low=low, factor_high=high, verdict=verdict)


def _judge_group(group, low, high):
    if low is None and high is None:
        return "not_controlled"
    if group.redundancy < CHECKABLE:
        return "hardly_controlled"
    if low > 1:
        return "worse"
    return "better" if high < 1 else "as_declared"


def _check_points(check):
    if check is None:
        return None
    rows = zip(check.names, check.difference_m, check.sd_m, strict=True)
    points = [
        CheckPoint(
            name,
            *difference,
            *sd,
            size_m=float(np.sqrt(np.nansum(np.square(difference)))),
            largest_w=_largest_w(difference, sd),
        )
        for name, difference, sd in rows
    ]
    return fill_from(CheckedPoints, check, points=points)


def _largest_w(difference, sd):
    """Return the largest difference over its sd; None if no sd is known."""
    known = np.isfinite(difference) & np.isfinite(sd) & (np.asarray(sd) > 0)
    return float(np.max(np.abs(difference[known] / sd[known]))) if known.any() else None
