"""What a wall says of the unknowns that its points share, and what these leave uncertain of them.

Free offsets and the poses of untied set-ups, u, are unknowns of the wall. Points p that move by
D (3m, s) with what was told of these, t = G y, y the radii, of which B = dy/dp, and C the
covariance of the points by themselves, have after it was taken off them the covariance

    C + D S D' - C B' G' D' - D G B C = C + D A' + A D',   A = D S / 2 - C B' G',

S that of t: its errors are those of the points in part, and of what was not seen of the wall.

A way to move set-ups that hardly moves any radius, as a turn about the axis of the tank, is told to
decimetres only, and nothing hangs on it: these stay where they were put, and are no part of t.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from tankcal.pipeline.untied_setups import offsets_then_poses, size_of
from tankcal.sections import circle_by_coordinates, coordinates_of

SURE = 0.1  # sd of a way, as a part of how far poses may be off: less is told well


@dataclass(frozen=True)
class ToldUnknowns:
    """What a wall says of offsets and poses that nothing binds beforehand.

    Attributes
    ----------
    offsets_m : dict
        {instrument: by how much its offset is more than was taken}, m.
    poses : ndarray, shape (p, 3)
        The same of x and y (m) and orientation (rad) of each pose that the wall alone ties.
    largest_m : float
        By how much that moves an accepted point at most.
    by_readings : ndarray, shape (s, n)
        G: derivative of what was told by the readings of the wall.
    moved_m : ndarray, shape (3m, s)
        D: derivative of the accepted points by what was told.
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
        """(r, r) what it adds to the covariance of functions of some points.

        by_points  (r, 3k) their derivative by the coordinates of these, members (k,)
        """
        index = coordinates_of(members)
        moved, beside = (by_points @ one[index] for one in (self.moved_m, self.with_points_m2))
        return moved @ beside.T + beside @ moved.T

    def spread_alone(self):
        """(m, 3, 3) what it adds to the covariance of each point with itself."""
        each = (one.reshape(-1, 3, one.shape[1]) for one in (self.moved_m, self.with_points_m2))
        half = np.einsum("mis,mjs->mij", *each)
        return half + half.transpose(0, 2, 1)


def told_unknowns(points, unbound, field, parts):
    """`ToldUnknowns` of a field whose points have unknowns in common.

    Parameters
    ----------
    points : Points
    unbound : Unbound
        Of the field's readings.
    field : WallField
    parts : tuple
        accepted (m,), radii_by_points (n, 3m), covariance_m2 (3m, 3m), as a `Wall` has them.
    """
    accepted, by_points, covariance = parts
    shared, index = offsets_then_poses(points), coordinates_of(accepted)
    sizes, count = np.array([size_of(effect) for effect in shared]), unbound.offsets.shape[1]
    ways = sizes[:, None] * unbound.ways_of(field.sites)
    mine = slice(0, ways.shape[1])  # those of lines come after them
    values, spread = field.shared
    sure = _surely_told(spread[mine, mine], count)
    ways, spread = ways @ sure, sure.T @ spread[mine, mine] @ sure
    by_readings, values = sure.T @ field.shared_by_readings[mine], sure.T @ values[mine]
    moved = np.column_stack([effect.column_m[index] for effect in shared]) @ ways
    off = -(ways @ values)
    return ToldUnknowns(
        offsets_m={effect.name: float(off[i]) for i, effect in enumerate(shared[:count])},
        poses=off[count:].reshape(-1, 3),
        largest_m=float(np.abs(moved @ values).max(initial=0.0)),
        by_readings=by_readings,
        moved_m=moved,
        with_points_m2=moved @ spread / 2 - covariance @ (by_points.T @ by_readings.T),
    )


def _surely_told(spread, count):
    """(s, q) offsets, and directions of the ways of poses that are told well.

    Where offsets are as they were found: the two may well hang together.

    spread  (s, s) covariance of what was told
    count   of offsets, the first of it
    """
    across, own = spread[count:, :count], spread[:count, :count]
    variances, axes = np.linalg.eigh(
        spread[count:, count:] - across @ np.linalg.pinv(own) @ across.T
    )
    return scipy.linalg.block_diag(np.eye(count), axes[:, variances < SURE**2])


def with_spread(told, section, fitted):
    """A section whose circle has the covariance by what was told, too.

    fitted  (group, xyz_m, covariance_m2, slope, z_m) that `fit_section` had
    """
    by = circle_by_coordinates(section, *fitted[1:])
    cofactor = section.circle.cofactor_m2 + told.spread_of(by, section.group.members)
    return replace(section, circle=replace(section.circle, cofactor_m2=cofactor))
