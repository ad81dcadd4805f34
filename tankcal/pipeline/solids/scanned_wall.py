"""Wall about a scanned horizontal cylinder or sphere: sizes, volumes and their uncertainty.

The deviation f from the fitted shape is one random field (`geometry.field.places`). Its functionals
are the volumes below levels from empty to full. Dips count from the wall itself below the dip
point. With w the wet part of the wall and A the area of the free surface,

    added volume = integral of f over w - A f(bottom).

The wall continues beyond the points of a cylinder; its middle is taken as the middle of the points.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.geometry.cylinders import FittedCylinder, cylinder_distances
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
from tankcal.geometry.primitives import sphere_distances, unit_vectors
from tankcal.pipeline.checks.survey import noise_is_estimated
from tankcal.pipeline.tanks.common import factor_of_unseen
from tankcal.pipeline.tanks.solid import solid_as_surveyed
from tankcal.sections import coordinates_of
from tankcal.tank.budgets import Factor, survey_factors
from tankcal.tank.solids import NODES, SurveyedForm, node_levels
from tankcal.units import FULL_TURN

KINDS = ("bulge", "ovality", "oblateness", "seams")
MOST_ROUNDS = 10
NEIGHBOURS = 12
DENT_M = 0.02  # depth of a dent that a single point may show


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
    covariance_m2 : ndarray, shape (3m, 3m) or (3m,)
        Covariance or variances of these points, m2.
    dof : float
        Degrees of freedom of the covariance.

    Returns
    -------
    ScannedWall
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
            outliers = _unlike_neighbours(job, fit, index, limit)
        else:
            readings = _readings(job, fit, index, covariance_m2(index))
            outliers = _field(readings, noise_is_estimated(job)).far_off(limit, DENT_M)
        outliers = outliers[~kept[index[outliers]]]
        if len(outliers) == 0:
            break
        index = np.delete(index, outliers)
    return np.isin(np.arange(len(chosen)), index)


def _unlike_neighbours(job, fit, index, limit):
    """Indices of points far from the median of their neighbours."""
    xyz = job.points.xyz_m[index]
    distance = offsets(fit, xyz)
    neighbours = scipy.spatial.KDTree(xyz).query(xyz, NEIGHBOURS + 1)[1][:, 1:]
    deviation = np.abs(distance - np.median(distance[neighbours], axis=1))
    return np.flatnonzero(deviation > max(limit * SD_OVER_MEDIAN * np.median(deviation), DENT_M))


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
    covariance_m2 : ndarray, shape (3m, 3m) or (3m,)
        Covariance or variances of these points, m2.

    Returns
    -------
    _Readings
    """
    xyz = job.points.xyz_m[chosen]
    means = means_of_neighbours(xyz)
    if isinstance(fit, FittedCylinder):
        local = xyz - fit.point_m
        frame = np.vstack([fit.tangents, fit.direction])
        unknowns = np.array([0.0, 0.0, 0.0, 0.0, fit.radius_m])
        distance, by_unknowns, normal = cylinder_distances(frame)(unknowns, local)
        angle, along = _on_cylinder(job, fit, means @ xyz)
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
    if np.ndim(covariance_m2) == 1:
        noise = (by_points * covariance_m2) @ by_points.T
        noise = noise.toarray()
    else:
        noise = by_points @ (covariance_m2 @ by_points.T.toarray())
    return _Readings(places, -(means @ by_unknowns), means @ distance, noise, by_points)


def _on_cylinder(job, fit, xyz_m):
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
    angle, along = _on_cylinder(job, fit, xyz_m)
    distance = np.hypot(fit.radius_m * angle, along - _dip_along(solid, along))
    return float(distance.min())


def _functionals(job, fitted, solid, places, levels_m, area_m2, chosen):
    """Functionals of the field: volumes at the nodes, sizes, and the wall at top and bottom."""
    if not isinstance(fitted.fit, FittedCylinder):
        volumes = cap_volumes(levels_m, area_m2, solid.diameter_m / 2)
        ends = np.array([(-1.0) ** DEGREES, np.ones(len(DEGREES))])
        return np.vstack([volumes, np.zeros((len(fitted.names), len(DEGREES))), ends])
    along = _on_cylinder(job, fitted.fit, job.points.xyz_m[chosen])[1]
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
