"""Unknowns shared by the points of a wall, as estimated with the wall, and their uncertainty.

Offsets without a prior and the poses of untied set-ups, u, are unknowns of the wall. Their
estimates are t = G y, with y the radii of the wall. Let B = dy/dp be the derivative of the radii by
the points p, and C the covariance of the points alone. Let D (3m, s) be the derivative of the
points by t. After subtraction of t the points have the covariance

    C + D S D' - C B' G' D' - D G B C = C + D A' + A D',   A = D S / 2 - C B' G',

with S the covariance of t. The errors of t are partly those of the points, and partly due to form
of the wall that was not seen.

Some displacements of set-ups hardly change any radius, for example a rotation about the axis of the
tank. They are estimated to decimetres only, and no result depends on them. Such displacements keep
their initial values and are not part of t.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from tankcal.pipeline.wall.untied_setups import offsets_then_poses, size_of
from tankcal.sections import circle_by_coordinates, coordinates_of

SURE = 0.1  # largest standard deviation of a determined combination, in its prior range


@dataclass(frozen=True)
class ToldUnknowns:
    """Estimates of offsets and poses without a prior.

    Attributes
    ----------
    offsets_m : dict
        {instrument: estimated minus assumed offset}, m.
    poses : ndarray, shape (p, 3)
        Estimated minus initial x and y (m) and orientation (rad) of each pose tied by the wall
        alone.
    largest_m : float
        Largest resulting displacement of an accepted point, m.
    by_readings : ndarray, shape (s, n)
        G: derivative of the estimates by the readings of the wall.
    moved_m : ndarray, shape (3m, s)
        D: derivative of the accepted points by the estimates.
    with_points_m2 : ndarray, shape (3m, s)
        A.
    """

    offsets_m: dict
    poses: np.ndarray
    largest_m: float
    by_readings: np.ndarray
    moved_m: np.ndarray
    with_points_m2: np.ndarray

    def spread_of(self, by_points, members):
        """Contribution (r, r) to the covariance of functions of some points.

        Parameters
        ----------
        by_points : ndarray, shape (r, 3k)
            Derivative of the functions by the coordinates of the points.
        members : ndarray of int, shape (k,)
            Indices of the points among the accepted points.

        Returns
        -------
        ndarray, shape (r, r)
        """
        index = coordinates_of(members)
        moved, with_points = (
            by_points @ matrix[index] for matrix in (self.moved_m, self.with_points_m2)
        )
        return moved @ with_points.T + with_points @ moved.T

    def spread_alone(self):
        """Contribution (m, 3, 3) to the covariance of each point, m2."""
        matrices = (
            matrix.reshape(-1, 3, matrix.shape[1]) for matrix in (self.moved_m, self.with_points_m2)
        )
        half = np.einsum("mis,mjs->mij", *matrices)
        return half + half.transpose(0, 2, 1)


def told_unknowns(points, unbound, field, parts):
    """`ToldUnknowns` of a field whose points have unknowns in common.

    Parameters
    ----------
    points : Points
    unbound : Unbound
        Derivatives of the field's readings by the unknowns.
    field : WallField
    parts : tuple
        accepted (m,), radii_by_points (n, 3m), covariance_m2 (3m, 3m), as in `Wall`.

    Returns
    -------
    ToldUnknowns
    """
    accepted, by_points, covariance = parts
    shared, index = offsets_then_poses(points), coordinates_of(accepted)
    sizes, count = np.array([size_of(effect) for effect in shared]), unbound.offsets.shape[1]
    ways = sizes[:, None] * unbound.ways_of(field.sites)
    of_points = slice(0, ways.shape[1])  # unknowns of reference lines follow
    # The field already estimates the unknowns together with the form of the wall.
    values, spread = field.shared
    determined = _determined_combinations(spread[of_points, of_points], count)
    ways, spread = ways @ determined, determined.T @ spread[of_points, of_points] @ determined
    by_readings, values = (
        determined.T @ field.shared_by_readings[of_points],
        determined.T @ values[of_points],
    )
    moved = np.column_stack([effect.column_m[index] for effect in shared]) @ ways
    correction = -(ways @ values)
    return ToldUnknowns(
        offsets_m={effect.name: float(correction[i]) for i, effect in enumerate(shared[:count])},
        poses=correction[count:].reshape(-1, 3),
        largest_m=float(np.abs(moved @ values).max(initial=0.0)),
        by_readings=by_readings,
        moved_m=moved,
        # D S D' is split into two halves, one in each of D A' and A D'.
        with_points_m2=moved @ spread / 2 - covariance @ (by_points.T @ by_readings.T),
    )


def _determined_combinations(spread, count):
    """Columns (s, q): offsets, and well-determined combinations of the displacements of poses.

    The combinations are conditional on the estimated offsets, since both can be strongly
    correlated.

    Parameters
    ----------
    spread : ndarray, shape (s, s)
        Covariance of the estimates.
    count : int
        Number of offsets, which come first.

    Returns
    -------
    ndarray, shape (s, q)
    """
    across, of_offsets = spread[count:, :count], spread[:count, :count]
    # Schur complement: covariance of the poses for given offsets.
    variances, axes = np.linalg.eigh(
        spread[count:, count:] - across @ np.linalg.pinv(of_offsets) @ across.T
    )
    return scipy.linalg.block_diag(np.eye(count), axes[:, variances < SURE**2])


def with_spread(told, section, fitted):
    """Section whose circle also has the covariance of the estimated unknowns.

    Parameters
    ----------
    told : ToldUnknowns
    section : Section
    fitted : tuple
        (group, xyz_m, covariance_m2, slope, z_m), the arguments of `fit_section`.

    Returns
    -------
    Section
    """
    derivative = circle_by_coordinates(section, *fitted[1:])
    cofactor = section.circle.cofactor_m2 + told.spread_of(derivative, section.group.members)
    return replace(section, circle=replace(section.circle, cofactor_m2=cofactor))
