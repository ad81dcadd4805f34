"""Horizontal cylinders and spheres fitted to points.

Wall about a scanned horizontal cylinder or sphere: sizes, volumes and their uncertainty.

The deviation f from the fitted shape is one random field (`geometry.field.places`). Its functionals
are the volumes below levels from empty to full. Dips count from the wall itself below the dip
point. With w the wet part of the wall and A the area of the free surface,

    added volume = integral of f over w - A f(bottom).

The wall continues beyond the points of a cylinder; its middle is taken as the middle of the points.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.sparse

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.field.places import (
    DEGREES,
    MOST_SITES,
    CylinderFunctionals,
    OnCylinder,
    OnSphere,
    SolidField,
    cap_volumes,
    cells_along,
    cells_around,
    estimate_sizes,
    means_of_neighbours,
    wet_cells,
)
from tankcal.geometry.primitives import (
    FittedCylinder,
    cylinder_distances,
    fit_sphere,
    lying_cylinder,
    sphere_distances,
    unit_vectors,
)
from tankcal.messages import message
from tankcal.pipeline.checks import noise_is_estimated, origin_of
from tankcal.pipeline.checks.size import refuse_misfit
from tankcal.pipeline.overruling import decisions_of, refuse_kept
from tankcal.pipeline.tanks.solid import factor_of_unseen, solid_as_surveyed
from tankcal.pipeline.wall.surveyed import given_covariance
from tankcal.sections import LEAST_SD_M, coordinates_of
from tankcal.tank.budgets import Factor, survey_factors
from tankcal.tank.solids import NODES, SurveyedForm, node_levels
from tankcal.units import FULL_TURN

KINDS = ("bulge", "ovality", "oblateness", "seams")
MOST_ROUNDS = 10
NEIGHBOURS = 12
DENT_M = 0.02  # depth of a dent that a single point may show
FAR = 5.0  # standard deviations from the wall above which a point is rejected
MOST_SEARCHES = 30
KEPT_PART = 0.03  # largest distance of a kept point from the shape, as a share of the radius
# Largest distance of a wall point from the shape: a share of the radius, plus a length.
NEVER_PART, NEVER_M = 0.02, 0.01


# ---- wall about a scanned horizontal cylinder or sphere: sizes, volumes and their uncertainty


@dataclass(frozen=True)
class Fitted:
    """Fitted sphere or cylinder, with the names and values of the quantities of a solid.

    The array `by_shape` (names, p) contains the derivatives of the values by the fitted unknowns.
    """

    fit: object
    names: tuple[str, ...]
    values: list
    by_shape: np.ndarray


@dataclass(frozen=True)
class ScannedWall:
    """Values and factors of the sizes, form of the wall and foot_m, as in `scan.Scan`."""

    values: np.ndarray
    factors: tuple[Factor, ...]
    form: SurveyedForm
    foot_m: float | None


@dataclass(frozen=True)
class _Readings:
    """Distances of sites from the shape, with design, covariance and positions.

    The array `by_points` (sites, 3m) is the derivative of the distances by the accepted points.
    """

    places: object
    design: np.ndarray
    distance_m: np.ndarray
    noise_m2: np.ndarray
    by_points: scipy.sparse.csr_array


def scanned_wall(job, fitted, chosen, covariance_m2, dof):
    """`ScannedWall` of a job.

    Parameters
    ----------
    job : Job
    fitted : Fitted
    chosen : ndarray of int, shape (m,)
        Indices of the accepted points.
    covariance_m2 : PointCovariance
        Covariance of these points, m2.
    dof : float
        Degrees of freedom of the covariance.
    """
    solid = solid_as_surveyed(job, fitted.names, fitted.values)
    readings = _readings(job, fitted.fit, chosen, covariance_m2)
    estimated = noise_is_estimated(job)
    field = _field(readings, estimated)
    amplitudes = field.amplitudes
    levels = node_levels(solid.top_m)
    derivatives = solid.derivatives(levels)
    area = solid.area_m2(levels)
    functionals = _functionals(job, fitted, solid, readings.places, levels, area, chosen)
    by_sizes = np.column_stack([derivatives[name] for name in fitted.names])
    by_shape = np.vstack(
        [by_sizes @ fitted.by_shape, fitted.by_shape, np.zeros((2, fitted.by_shape.shape[1]))]
    )
    estimate = field.estimated(functionals, by_shape)
    rows, of_sizes = slice(NODES), slice(NODES, NODES + len(fitted.names))
    top, bottom = estimate.departing[-2:]
    # The mean of the field over the wall changes the sizes; the form keeps only the remainder.
    wider = estimate.departing[of_sizes]
    causes, index = job.points.causes, coordinates_of(chosen)
    moves = [readings.by_points @ cause.column_m[index] for cause in causes]
    dof = amplitudes.noise_dof if estimated else dof

    def of_points(part):
        weights = estimate.weights[part]
        covariance = amplitudes.noise * weights @ readings.noise_m2 @ weights.T
        return survey_factors(covariance, dof, causes, [weights @ column for column in moves])

    factors = (*of_points(rows), *_factors_of_unseen(field, estimate, rows))
    form = SurveyedForm.of_volumes(
        solid.volume_m3(levels),
        area,
        solid.top_m,
        estimate.departing[rows] - by_sizes @ wider,
        top + bottom - wider[0],
        factors,
    )
    values = np.array(fitted.values) + fitted.by_shape @ estimate.moved + wider
    foot_m = _nearest_to_foot(job, fitted.fit, solid, job.points.xyz_m[chosen])
    return ScannedWall(values, of_points(of_sizes), form, foot_m)


def _field(readings, estimated):
    arguments = readings.places, readings.design, readings.distance_m, readings.noise_m2
    return SolidField(*arguments, estimate_sizes(*arguments, estimate_noise=estimated))


def agreeing(job, fit, chosen, covariance_m2, limit, kept):
    """Mask (n,) of the chosen points that agree with the wall that the other points show.

    A point is rejected if it lies over `limit` standard deviations off and deeper than a dent that
    a single point may show. The worst points are rejected first, until all agree. If the points
    outnumber the sites of a field, each is compared with the median of its neighbours.

    Parameters
    ----------
    job : Job
    fit : sphere or cylinder
    chosen : ndarray of bool, shape (n,)
        Candidates.
    covariance_m2 : callable
        Gives the covariance of points by their indices, m2.
    limit : float
        Number of standard deviations.
    kept : ndarray of bool, shape (n,)
        Points that are never rejected.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    index = np.flatnonzero(chosen)
    for _ in range(MOST_ROUNDS):
        if len(index) > MOST_SITES:
            # Indices of points far from the median of their neighbours.
            xyz = job.points.xyz_m[index]
            distance = offsets(fit, xyz)
            neighbours = scipy.spatial.KDTree(xyz).query(xyz, NEIGHBOURS + 1)[1][:, 1:]
            deviation = np.abs(distance - np.median(distance[neighbours], axis=1))
            outliers = np.flatnonzero(
                deviation > max(limit * SD_OVER_MEDIAN * np.median(deviation), DENT_M)
            )
        else:
            readings = _readings(job, fit, index, covariance_m2(index))
            outliers = _field(readings, noise_is_estimated(job)).far_off(limit, DENT_M)
        outliers = outliers[~kept[index[outliers]]]
        if len(outliers) == 0:
            break
        index = np.delete(index, outliers)
    return np.isin(np.arange(len(chosen)), index)


def offsets(fit, xyz_m):
    """Distances (n,) of points from a fitted sphere or cylinder, outwards positive, m."""
    if isinstance(fit, FittedCylinder):
        return np.hypot(*((xyz_m - fit.point_m) @ fit.tangents.T).T) - fit.radius_m
    return np.linalg.norm(xyz_m - fit.centre_m, axis=1) - fit.radius_m


def _factors_of_unseen(field, estimated, rows):
    """`Factor`s of each kind of deviation that the points do not fully determine."""
    assumed, factors = field.amplitudes.assumed_share(), []
    for kind in KINDS:
        indices = [
            i for i, departure in enumerate(field.places.departures) if departure.kind == kind
        ]
        if not indices:
            continue
        parts = [estimated.unseen[i][rows, rows] for i in indices]
        sizes = [np.trace(part) for part in parts]
        factors.append(factor_of_unseen(kind, parts, sizes, assumed[indices]))
    return tuple(factor for factor in factors if factor.columns.shape[1])


def _readings(job, fit, chosen, covariance_m2):
    """`_Readings` of the accepted points, as means of neighbours.

    Parameters
    ----------
    job : Job
    fit : sphere or cylinder
    chosen : ndarray of int, shape (m,)
        Indices of the accepted points.
    covariance_m2 : PointCovariance
        Covariance of these points, m2.
    """
    xyz = job.points.xyz_m[chosen]
    means = means_of_neighbours(xyz)
    if isinstance(fit, FittedCylinder):
        local = xyz - fit.point_m
        frame = np.vstack([fit.tangents, fit.direction])
        unknowns = np.array([0.0, 0.0, 0.0, 0.0, fit.radius_m])
        distance, by_unknowns, normal = cylinder_distances(frame)(unknowns, local)
        angle, along = _cylinder_coordinates(job, fit, means @ xyz)
        places = OnCylinder(fit.radius_m, angle, along)
    else:
        unknowns = np.append(fit.centre_m, fit.radius_m)
        distance, by_unknowns, normal = sphere_distances(unknowns, xyz)
        places = OnSphere(fit.radius_m, unit_vectors(means @ normal)[1])
    ends = np.arange(0, normal.size + 1, 3)
    normals = scipy.sparse.csr_array(
        (normal.ravel(), np.arange(normal.size), ends), shape=(len(normal), normal.size)
    )
    by_points = means @ normals
    noise = covariance_m2.propagate(by_points)
    return _Readings(places, -(means @ by_unknowns), means @ distance, noise, by_points)


def _cylinder_coordinates(job, fit, xyz_m):
    """Angles (n,) about the axis, 0 at the bottom, and positions from end A towards end B."""
    azimuth = job.horizontal.azimuth_rad
    sign = np.sign(fit.direction[:2] @ (np.sin(azimuth), np.cos(azimuth)))
    relative = xyz_m - fit.point_m
    upward = np.array([0.0, 0.0, 1.0]) - fit.direction[2] * fit.direction
    upward = upward / np.linalg.norm(upward)
    across = np.cross(fit.direction, upward)
    return np.arctan2(relative @ across, -(relative @ upward)), sign * (relative @ fit.direction)


def _dip_along(solid, along_m):
    """Position of the dip along the axis, if the middle of the cylinder is that of the points."""
    return (along_m.min() + along_m.max() - solid.length_m) / 2 + solid.dip_from_a_m


def _nearest_to_foot(job, fit, solid, xyz_m):
    """Distance from the bottom at the dip to the nearest point, m; None for spheres.

    The bottom of a sphere is determined by the wall about it.
    """
    if not isinstance(fit, FittedCylinder):
        return None
    angle, along = _cylinder_coordinates(job, fit, xyz_m)
    distance = np.hypot(fit.radius_m * angle, along - _dip_along(solid, along))
    return float(distance.min())


def _functionals(job, fitted, solid, places, levels_m, area_m2, chosen):
    """Functionals of the field: volumes at the nodes, sizes, and the wall at top and bottom."""
    if not isinstance(fitted.fit, FittedCylinder):
        volumes = cap_volumes(levels_m, area_m2, solid.diameter_m / 2)
        ends = np.array([(-1.0) ** DEGREES, np.ones(len(DEGREES))])
        return np.vstack([volumes, np.zeros((len(fitted.names), len(DEGREES))), ends])
    along = _cylinder_coordinates(job, fitted.fit, job.points.xyz_m[chosen])[1]
    dip = _dip_along(solid, along)
    begin = dip - solid.dip_from_a_m
    radius, cells, around = solid.width_m / 2, cells_along(begin, solid.length_m), cells_around()
    rise = np.hypot(1.0, solid.tilt) if solid.dip_direction == "plumb" else 1.0
    # Height of the free surface above the axis at each cell of a tilted cylinder.
    axis = rise * levels_m[:, None] - radius - solid.tilt * (cells - dip)
    cell = radius * FULL_TURN / len(around) * solid.length_m / len(cells)
    volumes = cell * wet_cells(axis, radius).transpose(0, 2, 1)
    shape = len(around), len(cells)
    mean, top = np.full(shape, 1 / (shape[0] * shape[1])), np.zeros(shape)
    # The free surface near the top.
    half_chord = np.sqrt(np.maximum(radius**2 - axis[-2] ** 2, 1e-12))
    # The wall at the top is its mean along the crown, weighted by the width of the free surface.
    top[len(around) // 2] = half_chord / half_chord.sum()
    zero = np.zeros(shape)
    weights = np.concatenate([volumes, [2 * mean, zero, top, zero]])
    at_point = np.concatenate([-area_m2, [0.0, 0.0, 0.0, 1.0]])
    return CylinderFunctionals(around, cells, weights, dip, at_point)


# ---- scanned horizontal cylinder or sphere: the fitted shape and the wall about it


@dataclass(frozen=True)
class Scan:
    """Solid fitted to the points of a wall.

    Attributes
    ----------
    names : tuple of str
        Inputs that the points determine: "diameter", and "tilt" for a horizontal cylinder.
    values : ndarray, shape (names,)
        Values of the surface as surveyed.
    factors : tuple of Factor
        Uncertainty of the values from the points (`body.Factor`).
    form : SurveyedForm
        Deviation of the wall from the solid, with the uncertainty of its volumes.
    accepted : ndarray of int, shape (m,)
        Indices of the accepted points.
    residuals_m : ndarray, shape (n,)
        Residuals of all points, outwards positive, m.
    noise_m : float
        Standard deviation of the residuals, m.
    fit : sphere or cylinder
    reach_m : (float, float)
        Range of the accepted points along the axis of a cylinder, m.
    foot_m : float or None
        Distance of the nearest accepted point from the bottom at the dip of a cylinder, m.
    """

    names: tuple[str, ...]
    values: np.ndarray
    factors: tuple[Factor, ...]
    form: SurveyedForm
    accepted: np.ndarray
    residuals_m: np.ndarray
    noise_m: float
    fit: object
    reach_m: tuple[float, float] = (-np.inf, np.inf)
    foot_m: float | None = None
    surveyed_as = "scan"

    def is_within(self, places_m):
        """Whether positions (n, 3) lie inside the wall and between the ends of the survey."""
        along = _axial_positions(self.fit, places_m)
        low, high = self.reach_m
        return (offsets(self.fit, places_m) < 0) & (along > low) & (along < high)


def fit_scan(job, dof=np.inf):
    """`Scan` of the points of a horizontal cylinder or a sphere.

    Repeated fits reject points over 5 robust standard deviations off, until the selection is
    stable. All points within 2 % of the radius plus 10 mm of that shape are then compared with the
    wall that the other points show (`scanned_wall.agreeing`). Points in a dent thus remain. Without
    snooping all points are used. A full covariance serves as weight and for propagation. Points
    kept by decision stay, and excluded points take no part.

    Parameters
    ----------
    job : Job
    dof : float
        Degrees of freedom of the covariance of the points, if supplied.

    Raises
    ------
    InputError
        If the points do not form such a solid.
    """
    decided = decisions_of(job)
    is_used, is_kept = decided >= 0, decided > 0
    for _ in range(MOST_SEARCHES):
        fit, names, values, by_shape, residuals = _fit_or_refuse(job, is_used)
        is_near = is_used
        if job.snooping:
            robust_sd = SD_OVER_MEDIAN * np.median(np.abs(residuals[is_used]))
            is_near = np.abs(residuals) <= FAR * max(robust_sd, 1e-6)
            is_near = (is_near | is_kept) & (decided >= 0)
        if np.array_equal(is_near, is_used):
            break
        is_used = is_near
    # Before points in groups can define a wall of their own.
    _refuse_scatter(job, fit, values, residuals[is_used])
    if job.snooping:
        is_candidate = is_used | (np.abs(residuals) <= NEVER_PART * fit.radius_m + NEVER_M)
        is_candidate &= decided >= 0
        covariance_of_points = partial(_covariance, job.points)
        is_used = agreeing(job, fit, is_candidate, covariance_of_points, FAR, is_kept)
        fit, names, values, by_shape, residuals = _fit_or_refuse(job, is_used)
    refuse_kept(job, residuals, KEPT_PART * fit.radius_m)
    index = np.flatnonzero(is_used)
    noise = _refuse_scatter(job, fit, values, residuals[is_used])
    fitted = Fitted(fit, names, values, by_shape)
    wall = scanned_wall(job, fitted, index, _covariance(job.points, index), dof)
    return Scan(
        names,
        wall.values,
        wall.factors,
        wall.form,
        index,
        residuals,
        noise,
        fit,
        _reach(fit, job.points.xyz_m[is_used]),
        wall.foot_m,
    )


def _refuse_scatter(job, fit, values, residuals):
    """Standard deviation of the accepted points about the shape, m; InputError if excessive."""
    noise = float(np.sqrt(residuals @ residuals / max(fit.dof, 1)))
    refuse_misfit(job.points, noise, float(values[0]))
    return noise


def _axial_positions(fit, xyz_m):
    """Positions (n,) along the axis of a cylinder, m; 0 for a sphere."""
    if isinstance(fit, FittedCylinder):
        return (xyz_m - fit.point_m) @ fit.direction
    return np.zeros(len(xyz_m))


def _reach(fit, xyz_m):
    """Smallest and largest position along a cylinder, m; infinite for a sphere."""
    if not isinstance(fit, FittedCylinder):
        return -np.inf, np.inf
    along = _axial_positions(fit, xyz_m)
    return float(along.min()), float(along.max())


def _fit_or_refuse(job, is_used):
    """`_fitted`, with InputError in place of SolutionError."""
    try:
        return _fit_points(job, is_used)
    except SolutionError as error:
        problem = Problem(
            origin_of(job.points),
            message("no_wall", "no wall was found in the points: {error}", error=error.args[0]),
        )
        raise InputError(problem) from error


def _covariance(points, index):
    """Positive definite `PointCovariance` of points (m,)."""
    return given_covariance(points, index).definite(LEAST_SD_M)


def _fit_points(job, is_used):
    """Fit, names, values, their derivatives by the unknowns, and residuals of all points."""
    covariance, xyz = _covariance(job.points, np.flatnonzero(is_used)), job.points.xyz_m
    if job.sphere is not None:
        ball = fit_sphere(xyz[is_used], covariance)
        by_shape = np.array([[0.0, 0.0, 0.0, 2.0]])
        return ball, ("diameter",), [2 * ball.radius_m], by_shape, offsets(ball, xyz)
    lying = lying_cylinder(xyz[is_used], covariance, job.horizontal.azimuth_rad)
    fit, values = lying.cylinder, [lying.diameter_m, lying.tilt]
    return fit, ("diameter", "tilt"), values, lying.by_cylinder, offsets(fit, xyz)
