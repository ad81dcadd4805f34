"""Cylinders of any direction through points, and the lying tank that they give.

The geometric fit of `primitives`; its start is found here, from parts of the circumference, too.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.geometry.primitives import (
    center_points,
    conditions_of,
    descend_distances,
    refuse_flat,
    spread_of,
    unit_vectors,
)
from tankcal.messages import message

DIRECTION_SD_LIMIT = 0.1  # rad: beyond, the direction of a cylinder is not determined
LEAST_THICKNESS = 2.0  # of points about their plane, in units of their scatter about the cylinder
SEARCH_DIRECTIONS, SEARCH_POINTS = 600, 2000
CANDIDATES, LEAST_ANGLE = 10, np.radians(8)  # directions that are followed, apart by it
FIRST_STEPS = 12  # along each of them


@dataclass(frozen=True)
class FittedCylinder:
    """Least-squares cylinder, of any direction, through n points.

    Attributes
    ----------
    point_m : ndarray, shape (3,)
        Point of the axis that is nearest to the mean of the points, m.
    direction : ndarray, shape (3,)
        Unit vector along the axis, upwards (eastwards when level).
    tangents : ndarray, shape (2, 3)
        Unit vectors square to the axis and to each other.
    radius_m : float
        Inside or outside, as the points are, m.
    cofactor : ndarray, shape (5, 5)
        Covariance of the point along both tangents (m), of the direction towards both (rad) and
        of the radius (m), for variance factor 1.
    residuals_m : ndarray, shape (n,)
        Distance of each point to the cylinder, outwards positive, m.
    variance_factor : float
        v' Q^-1 v / dof, nan without redundancy.
    dof : int
        Redundancy.
    """

    point_m: np.ndarray
    direction: np.ndarray
    tangents: np.ndarray
    radius_m: float
    cofactor: np.ndarray
    residuals_m: np.ndarray
    variance_factor: float
    dof: int


@dataclass(frozen=True)
class LyingCylinder:
    """Diameter and tilt of a lying tank from points of its cylinder.

    Attributes
    ----------
    diameter_m : float
        Inside or outside, as the points are, m.
    tilt : float
        tan of the angle by which the axis rises towards azimuth_rad.
    azimuth_rad : float
        Of the axis from A to B, clockwise from +y, 0 to 2 pi.
    cofactor : ndarray, shape (2, 2)
        Covariance of diameter (m) and tilt, for variance factor 1.
    cylinder : FittedCylinder
        The fit they come from.
    by_cylinder : ndarray, shape (2, 5)
        Derivative of diameter and tilt by the unknowns of that fit.
    towards_b : float
        1 where its direction is that from A to B, else -1.
    """

    diameter_m: float
    tilt: float
    azimuth_rad: float
    cofactor: np.ndarray
    cylinder: FittedCylinder
    by_cylinder: np.ndarray
    towards_b: float


def fit_cylinder(xyz_m, covariance_m2):
    """Geometric cylinder of any direction: hypot of what is square to the axis, minus R, is 0.

    Start, unasked: the sum of squared algebraic distances in closed form for directions all over
    the half sphere (Eberly 2019), the best of them by unweighted distances; parts of the
    circumference suffice.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
        Points, m.
    covariance_m2 : ndarray or sparse array, shape (3n, 3n) or (3n,)
        Their covariance, or variances, m2, in the order x1 y1 z1 x2 ...

    Returns
    -------
    FittedCylinder

    Raises
    ------
    SolutionError
        For fewer than 5 points, points in a plane (not thicker than twice their scatter), and
        points that do not determine the direction (its sd, by their scatter, above 0.1 rad).
    """
    mean, local = center_points(xyz_m, 5, "a cylinder")
    spread = spread_of(local, 3, "plane")
    frame, unknowns = _start_of_cylinder(local)
    refuse_flat(unknowns[4], spread, "a cylinder with a radius")
    for _ in range(2):  # the second time in the frame of the cylinder itself
        frame, unknowns = _upwards(frame, unknowns)
        model = conditions_of(cylinder_distances(frame))
        adjusted = adjust(model, unknowns, local.ravel(), covariance_m2)
        frame, unknowns = _turned(frame, adjusted.unknowns)
    x, y, *_, radius = unknowns
    residuals = cylinder_distances(frame)(unknowns, local)[0]
    _refuse_undetermined(adjusted, local, residuals)
    return FittedCylinder(
        point_m=mean + (x, y) @ frame[:2],
        direction=frame[2],
        tangents=frame[:2],
        radius_m=float(radius),
        cofactor=adjusted.cofactor,
        residuals_m=residuals,
        variance_factor=adjusted.variance_factor,
        dof=adjusted.dof,
    )


def cylinder_distances(frame):
    """Distances to cylinders near the third row of a frame (3, 3) of unit vectors.

    The function takes unknowns (x, y where the axis meets the plane of the first two rows, slopes
    of the axis along them, radius) and points (n, 3); it gives distances (n,), their derivatives
    by the unknowns (n, 5), and normals (n, 3).
    """

    def distances(unknowns, points):
        x, y, *slopes, radius = unknowns
        long = np.hypot(1.0, np.hypot(*slopes))
        axis = np.array([*slopes, 1.0]) / long
        d = points @ frame.T - (x, y, 0.0)
        along = d @ axis
        distance, normal = unit_vectors(d - along[:, None] * axis)
        moved = -normal[:, :2]
        by_slopes = moved * (along / long)[:, None]
        by_unknowns = np.column_stack([moved, by_slopes, -np.ones(len(d))])
        return distance - radius, by_unknowns, normal @ frame

    return distances


def lying_cylinder(xyz_m, covariance_m2, azimuth_rad):
    """Diameter and tilt of a lying tank, with their covariance, from points of its cylinder.

    Parameters
    ----------
    xyz_m, covariance_m2
        As for `fit_cylinder`.
    azimuth_rad : float
        Of the axis from A to B, clockwise from +y: it tells the ends apart and may be wrong by
        45 deg.

    Returns
    -------
    LyingCylinder

    Raises
    ------
    SolutionError
        When the fit does, when the axis is steeper than 45 deg, or when it runs elsewhere.

    Examples
    --------
    >>> angle = np.arange(8) * np.pi / 4
    >>> along = np.repeat(np.arange(4.0), 8)
    >>> across, up = np.tile(np.cos(angle), 4), np.tile(np.sin(angle), 4) + 0.01 * along
    >>> points = np.column_stack([along, across, up])
    >>> tank = lying_cylinder(points, np.full(96, 1e-6), np.pi / 2)
    >>> round(tank.diameter_m, 5), round(tank.tilt, 5)
    (1.99995, 0.01)
    """
    cylinder = fit_cylinder(xyz_m, covariance_m2)
    east, north, up = cylinder.direction
    level = np.hypot(east, north)
    if abs(up) > level:
        raise SolutionError(
            message(
                "cylinder_stands",
                "the cylinder stands: its axis leans {lean_deg:.1f} deg",
                lean_deg=np.degrees(np.arctan2(level, abs(up))),
            )
        )
    towards = (east * np.sin(azimuth_rad) + north * np.cos(azimuth_rad)) / level
    sign = 1.0 if towards > 0 else -1.0
    found = np.arctan2(sign * east, sign * north) % (2 * np.pi)
    if abs(towards) < np.cos(np.pi / 4):
        raise SolutionError(
            message(
                "axis_elsewhere",
                "the axis runs towards {found_deg:.1f} deg, not {expected_deg:.1f}",
                found_deg=np.degrees(found),
                expected_deg=np.degrees(azimuth_rad),
            )
        )
    outwards = cylinder.tangents @ np.array([east, north, 0.0]) / level
    by_direction = sign * (cylinder.tangents[:, 2] * level - up * outwards) / level**2
    transform = np.zeros((2, 5))
    transform[0, 4] = 2.0
    transform[1, 2:4] = by_direction
    return LyingCylinder(
        diameter_m=2 * cylinder.radius_m,
        tilt=float(sign * up / level),
        azimuth_rad=float(found),
        cofactor=transform @ cylinder.cofactor @ transform.T,
        cylinder=cylinder,
        by_cylinder=transform,
        towards_b=sign,
    )


def _refuse_undetermined(adjusted, local, residuals):
    """A ring of points in a plane has two leaning cylinders: linear sds alone do not show it."""
    thick = np.linalg.svd(local, compute_uv=False)[2] / np.sqrt(len(local))
    scatter = np.sqrt(np.mean(residuals**2))
    if thick < LEAST_THICKNESS * scatter:
        raise SolutionError(
            message(
                "points_in_a_plane",
                "the points lie in a plane: {thick_m:.3g} m thick, with a scatter of "
                "{scatter_m:.3g} m",
                thick_m=thick,
                scatter_m=scatter,
            )
        )
    factor = adjusted.variance_factor if adjusted.dof else 1.0
    sd = np.sqrt(factor * np.diag(adjusted.cofactor)[2:4].sum())
    if not sd < DIRECTION_SD_LIMIT:
        raise SolutionError(
            message(
                "cylinder_direction_undetermined",
                "the direction of the cylinder is not determined: sd {sd_rad:.3g} rad",
                sd_rad=sd,
            )
        )


def _start_of_cylinder(local):
    """Frame (third row: direction) and unknowns of the cylinder of least unweighted distances."""
    some = local[np.linspace(0, len(local) - 1, min(len(local), SEARCH_POINTS)).astype(int)]
    some = some - some.mean(axis=0)
    frames = _frames(
        np.vstack([np.linalg.svd(some, full_matrices=False)[2], _half_sphere(SEARCH_DIRECTIONS)])
    )
    errors, centres, radii = _algebraic_cylinders(some, frames)
    errors[:3] = -1.0  # the main directions of the points are tried whatever their errors
    best, tried = None, []
    for i in np.argsort(errors, kind="stable"):
        if any(abs(frames[i][2] @ frames[j][2]) > np.cos(LEAST_ANGLE) for j in tried):
            continue
        tried.append(i)
        distances = cylinder_distances(frames[i])
        found = descend_distances(distances, [*centres[i], 0.0, 0.0, radii[i]], some, FIRST_STEPS)
        cost = np.sum(distances(found, some)[0] ** 2)
        if np.isfinite(cost) and found[4] > 0 and (best is None or cost < best[0]):
            best = cost, *_turned(frames[i], found)
        if len(tried) == CANDIDATES:
            break
    if best is None:
        raise SolutionError(
            message(
                "cylinder_not_found",
                "no cylinder was found from {count} starting directions",
                count=len(tried),
            )
        )
    _, frame, found = best
    return _turned(frame, descend_distances(cylinder_distances(frame), found, some))


def _algebraic_cylinders(local, frames):
    """Mean squared distance, centre and radius of the algebraic circle seen along each frame.

    The circle |y|^2 = 2 c y + k of the points y in each plane, by their moments.
    """
    n = len(local)
    second = np.einsum("ni,nj->ij", local, local) / n
    third = np.einsum("ni,nj,nk->ijk", local, local, local, optimize=True) / n
    squares = np.einsum("ni,nj->nij", local, local).reshape(n, 9)
    fourth = (squares.T @ squares / n).reshape(3, 3, 3, 3)
    plane = frames[:, :2]
    across = np.einsum("fai,faj->fij", plane, plane)
    matrix = plane @ second @ plane.transpose(0, 2, 1)
    right = np.einsum("fai,ijk,fjk->fa", plane, third, across, optimize=True)
    mean = np.einsum("fij,ij->f", across, second)
    scatter = np.einsum("fij,ijkl,fkl->f", across, fourth, across, optimize=True) - mean**2
    centre = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    squared = mean + np.sum(centre**2, axis=1) / 4
    error = scatter - np.sum(centre * right, axis=1)
    return error / (4 * squared), centre / 2, np.sqrt(squared)


def _half_sphere(count):
    """(count, 3) even directions of a half sphere (Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    z, angle = i / count, i * np.pi * (1 + 5**0.5)
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


def _frames(directions):
    """(n, 3, 3) right-handed frames with the given third rows."""
    least = np.argmin(np.abs(directions), axis=1)
    first = np.cross(np.eye(3)[least], directions)
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(directions, first), directions], axis=1)


def _turned(frame, unknowns):
    """The frame turned until its third row is the found axis, and the unknowns in it."""
    x, y, *slopes, radius = unknowns
    axis = np.array([*slopes, 1.0]) @ frame
    axis = axis / np.linalg.norm(axis)
    first = frame[0] - (frame[0] @ axis) * axis
    first = first / np.linalg.norm(first)
    turned = np.array([first, np.cross(axis, first), axis])
    point = np.array([x, y]) @ frame[:2]
    return turned, np.array([*(turned[:2] @ point), 0.0, 0.0, radius])


def _upwards(frame, unknowns):
    if tuple(frame[2][[2, 0, 1]]) > (0.0, 0.0, 0.0):
        return frame, unknowns
    return frame * [[1.0], [-1.0], [-1.0]], unknowns * [1.0, -1.0, 0.0, 0.0, 1.0]
