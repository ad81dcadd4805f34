"""What a wall says of the unknowns that its points share, and what these leave uncertain of them.

Free offsets and the poses of untied set-ups, u, are unknowns of the wall. Points p that move by
D (3m, s) with what was told of these, t = G y, y the radii, of which B = dy/dp, and C the
covariance of the points by themselves, have after it was taken off them the covariance

    C + D S D' - C B' G' D' - D G B C = C + D A' + A D',   A = D S / 2 - C B' G',

S that of t: its errors are those of the points in part, and of what was not seen of the wall.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.pipeline.untied_setups import offsets_then_poses, size_of
from tankcal.sections import circle_by_coordinates, coordinates_of


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
    moved_m : ndarray, shape (3m, s)
        D: derivative of the accepted points by what was told.
    with_points_m2 : ndarray, shape (3m, s)
        A.
    """

    offsets_m: dict
    poses: np.ndarray
    largest_m: float
    moved_m: np.ndarray
    with_points_m2: np.ndarray

    def spread_of(self, by_points, members):
        """(r, r) what it adds to the covariance of functions of some points.

        by_points  (r, 3k) their derivative by the coordinates of these, members (k,)
        """
        index = coordinates_of(members)
        moved, beside = (by_points @ one[index] for one in (self.moved_m, self.with_points_m2))
        return moved @ beside.T + beside @ moved.T


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
    ways = np.array([size_of(one) for one in shared])[:, None] * unbound.ways_of(field.sites)
    mine = slice(0, ways.shape[1])  # those of lines come after them
    told, spread = field.shared
    moved = np.column_stack([one.column_m[index] for one in shared]) @ ways
    own = covariance @ (by_points.T @ field.shared_by_readings[mine].T)
    values, count = -(ways @ told[mine]), unbound.offsets.shape[1]
    return ToldUnknowns(
        offsets_m={one.name: float(values[i]) for i, one in enumerate(shared[:count])},
        poses=values[count:].reshape(-1, 3),
        largest_m=float(np.abs(moved @ told[mine]).max(initial=0.0)),
        moved_m=moved,
        with_points_m2=moved @ spread[mine, mine] / 2 - own,
    )


def with_spread(told, section, fitted):
    """A section whose circle has the covariance by what was told, too.

    fitted  (group, xyz_m, covariance_m2, slope, z_m) that `fit_section` had
    """
    by = circle_by_coordinates(section, *fitted[1:])
    cofactor = section.circle.cofactor_m2 + told.spread_of(by, section.group.members)
    return replace(section, circle=replace(section.circle, cofactor_m2=cofactor))
