"""The wall about a scanned lying cylinder or sphere: its sizes, its volumes, and their doubt.

What departs from the fitted shape is one random field (`geometry.field.solids`). Functionals of it
are the volumes below levels from empty to full, for dips that count from the wall itself under the
dip's place: with w the wet part of the wall and A the free surface,

    volume added = integral of f over w - A f(bottom).

Where the points of a cylinder end the wall goes on; its middle is taken for that of the points.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.geometry.cylinders import FittedCylinder, cylinder_distances
from tankcal.geometry.field.places import (
    DEGREES,
    MOST_SITES,
    CylinderFunctionals,
    OnCylinder,
    OnSphere,
    cap_volumes,
    cells_along,
    cells_around,
    means_of_neighbours,
    wet_cells,
)
from tankcal.geometry.field.solids import SolidField, estimate_sizes
from tankcal.geometry.outlines import FULL_TURN
from tankcal.geometry.primitives import sphere_distances, unit_vectors
from tankcal.pipeline.survey_warnings import noise_is_estimated
from tankcal.pipeline.tanks.common import factor_of_unseen
from tankcal.pipeline.tanks.solid import solid_as_surveyed
from tankcal.sections import coordinates_of
from tankcal.tank.factors import Factor, survey_factors
from tankcal.tank.surveyed_form import NODES, SurveyedForm, node_levels

KINDS = ("bulge", "ovality", "oblateness", "seams")
MOST_ROUNDS = 10
NEIGHBOURS = 12
DENT_M = 0.02  # depth of a dent that one point alone may show
SCALE_OF_MEDIAN = 1.4826  # standard deviation over median absolute deviation, normal noise


@dataclass(frozen=True)
class Fitted:
    """A fitted sphere or cylinder, the names and values of what it gives of a solid, and the
    derivative (names, p) of these by its unknowns.
    """

    fit: object
    names: tuple[str, ...]
    values: list
    by_shape: np.ndarray


@dataclass(frozen=True)
class ScannedWall:
    """values and factors of the sizes as `scan.Scan` has them; the form of the wall; foot_m."""

    values: np.ndarray
    factors: tuple[Factor, ...]
    form: SurveyedForm
    foot_m: float | None


@dataclass(frozen=True)
class _Readings:
    """Distances of sites to the shape, their design and covariance, and where they are.

    by_points (sites, 3 m) derivative of the distances by the points that were used
    """

    places: object
    design: np.ndarray
    distance_m: np.ndarray
    noise_m2: np.ndarray
    by_points: scipy.sparse.csr_array


def scanned_wall(job, fitted, chosen, covariance_m2, dof):
    """`ScannedWall` of a job.

    chosen         indices of the points that are used
    covariance_m2  of these, (3m, 3m) or variances (3m,), with dof degrees of freedom
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
    found = field.estimated(functionals, by_shape)
    rows, own = slice(NODES), slice(NODES, NODES + len(fitted.names))
    top, bottom = found.departing[-2:]
    wider = found.departing[own]
    causes, index = job.points.causes, coordinates_of(chosen)
    moves = [readings.by_points @ cause.column_m[index] for cause in causes]
    dof = amplitudes.noise_dof if estimated else dof

    def of_points(part):
        weights = found.weights[part]
        covariance = amplitudes.noise * weights @ readings.noise_m2 @ weights.T
        return survey_factors(covariance, dof, causes, [weights @ column for column in moves])

    factors = (*of_points(rows), *_of_the_unseen(field, found, rows))
    form = SurveyedForm.of_volumes(
        solid.volume_m3(levels),
        area,
        solid.top_m,
        found.departing[rows] - by_sizes @ wider,
        top + bottom - wider[0],
        factors,
    )
    values = np.array(fitted.values) + fitted.by_shape @ found.moved + wider
    foot_m = _nearest_to_foot(job, fitted.fit, solid, job.points.xyz_m[chosen])
    return ScannedWall(values, of_points(own), form, foot_m)


def _field(readings, estimated):
    given = readings.places, readings.design, readings.distance_m, readings.noise_m2
    return SolidField(*given, estimate_sizes(*given, estimate_noise=estimated))


def agreeing(job, fit, chosen, covariance_m2, limit, kept):
    """(n,) which of the chosen points agree with the wall that the others show.

    One over limit standard deviations off, and deeper than a dent that one point alone may show,
    is left out, the worst first, until none is. Of more points than a field is estimated from,
    each is held against the median of its neighbours. Those that are kept (n,) stay.
    """
    index = np.flatnonzero(chosen)
    for _ in range(MOST_ROUNDS):
        if len(index) > MOST_SITES:
            off = _unlike_neighbours(job, fit, index, limit)
        else:
            readings = _readings(job, fit, index, covariance_m2(index))
            off = _field(readings, noise_is_estimated(job)).far_off(limit, DENT_M)
        off = off[~kept[index[off]]]
        if len(off) == 0:
            break
        index = np.delete(index, off)
    return np.isin(np.arange(len(chosen)), index)


def _unlike_neighbours(job, fit, index, limit):
    """Indices of points that are far from the median of their neighbours."""
    xyz = job.points.xyz_m[index]
    distance = offsets(fit, xyz)
    near = scipy.spatial.KDTree(xyz).query(xyz, NEIGHBOURS + 1)[1][:, 1:]
    away = np.abs(distance - np.median(distance[near], axis=1))
    return np.flatnonzero(away > max(limit * SCALE_OF_MEDIAN * np.median(away), DENT_M))


def offsets(fit, xyz_m):
    """(n,) distance of points to a fitted sphere or cylinder, outwards positive."""
    if isinstance(fit, FittedCylinder):
        return np.hypot(*((xyz_m - fit.point_m) @ fit.tangents.T).T) - fit.radius_m
    return np.linalg.norm(xyz_m - fit.centre_m, axis=1) - fit.radius_m


def _of_the_unseen(field, found, rows):
    """A `Factor` of each kind of departure that the points did not see all of."""
    assumed, factors = field.amplitudes.assumed_share(), []
    for kind in KINDS:
        chosen = [
            i for i, departure in enumerate(field.places.departures) if departure.kind == kind
        ]
        if not chosen:
            continue
        parts = [found.unseen[i][rows, rows] for i in chosen]
        sizes = [np.trace(part) for part in parts]
        factors.append(factor_of_unseen(kind, parts, sizes, assumed[chosen]))
    return tuple(factor for factor in factors if factor.columns.shape[1])


def _readings(job, fit, chosen, covariance_m2):
    xyz = job.points.xyz_m[chosen]
    means = means_of_neighbours(xyz)
    if isinstance(fit, FittedCylinder):
        local = xyz - fit.point_m
        frame = np.vstack([fit.tangents, fit.direction])
        unknowns = np.array([0.0, 0.0, 0.0, 0.0, fit.radius_m])
        distance, by_unknowns, normal = cylinder_distances(frame)(unknowns, local)
        turn, along = _on_cylinder(job, fit, means @ xyz)
        places = OnCylinder(fit.radius_m, turn, along)
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
    """(n,) turns about the axis, 0 at the bottom, and places along it from A's side to B's."""
    azimuth = job.horizontal.azimuth_rad
    sign = np.sign(fit.direction[:2] @ (np.sin(azimuth), np.cos(azimuth)))
    d = xyz_m - fit.point_m
    up = np.array([0.0, 0.0, 1.0]) - fit.direction[2] * fit.direction
    up = up / np.linalg.norm(up)
    across = np.cross(fit.direction, up)
    return np.arctan2(d @ across, -(d @ up)), sign * (d @ fit.direction)


def _dip_along(solid, along_m):
    """Place of the dip along the axis; the middle of the cylinder is that of points (n,) there."""
    return (along_m.min() + along_m.max() - solid.length_m) / 2 + solid.dip_from_a_m


def _nearest_to_foot(job, fit, solid, xyz_m):
    """How far from the place where the dip meets the bottom the nearest point is; of spheres None,
    whose bottom is told by the wall about it.
    """
    if not isinstance(fit, FittedCylinder):
        return None
    turn, along = _on_cylinder(job, fit, xyz_m)
    away = np.hypot(fit.radius_m * turn, along - _dip_along(solid, along))
    return float(away.min())


def _functionals(job, fitted, solid, places, levels_m, area_m2, chosen):
    """Of the volumes at the nodes, the sizes, and the wall at the top and at the bottom."""
    if not isinstance(fitted.fit, FittedCylinder):
        volumes = cap_volumes(levels_m, area_m2, solid.diameter_m / 2)
        ends = np.array([(-1.0) ** DEGREES, np.ones(len(DEGREES))])
        return np.vstack([volumes, np.zeros((len(fitted.names), len(DEGREES))), ends])
    along = _on_cylinder(job, fitted.fit, job.points.xyz_m[chosen])[1]
    dip = _dip_along(solid, along)
    begin = dip - solid.dip_from_a_m
    radius, cells, around = solid.width_m / 2, cells_along(begin, solid.length_m), cells_around()
    rise = np.hypot(1.0, solid.tilt) if solid.dip_direction == "plumb" else 1.0
    axis = rise * levels_m[:, None] - radius - solid.tilt * (cells - dip)
    cell = radius * FULL_TURN / len(around) * solid.length_m / len(cells)
    volumes = cell * wet_cells(axis, radius).transpose(0, 2, 1)
    shape = len(around), len(cells)
    mean, top = np.full(shape, 1 / (shape[0] * shape[1])), np.zeros(shape)
    last = np.sqrt(np.maximum(radius**2 - axis[-2] ** 2, 1e-12))  # the free surface near the top
    top[len(around) // 2] = last / last.sum()
    none = np.zeros(shape)
    weights = np.concatenate([volumes, [2 * mean, none, top, none]])
    at_point = np.concatenate([-area_m2, [0.0, 0.0, 0.0, 1.0]])
    return CylinderFunctionals(around, cells, weights, dip, at_point)
