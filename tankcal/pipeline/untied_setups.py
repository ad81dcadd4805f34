"""What the readings of a wall share that nothing binds beforehand: free offsets, poses of set-ups.

They are unknowns of the wall beside its radii and the centres of its rings. A pose moves radii in
ways that these can take up (all lines outwards is a larger tank) and in ways that hardly move any:
only the rest of its ways are unknowns.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError
from tankcal.geometry.field.sites import free_design
from tankcal.messages import message
from tankcal.sections import coordinates_of

MOVED_M, TURNED_RAD = 0.3, 0.05  # how far off a pose that the wall alone ties may be
LEAST_MOTION_M = 0.005  # of all its radii together by that: less is no unknown of the wall


@dataclass(frozen=True)
class Unbound:
    """Derivatives of n radii by what nothing binds.

    Attributes
    ----------
    offsets : ndarray, shape (n, k)
        By free offsets and scales, in their order.
    poses : ndarray, shape (n, m)
        By x, y and orientation of set-ups, each as far as it may be off.
    """

    offsets: np.ndarray
    poses: np.ndarray

    @property
    def first_apart(self):
        """Number of the first ring whose centre is no part of an outline: 0 where set-ups may move,
        for then a common shift of centres and set-ups is of neither; None: there is no such ring.
        """
        return 0 if self.poses.shape[1] else None

    def padded(self, more):
        """The same with more readings, which nothing of it moves."""
        return Unbound(*(np.pad(one, ((0, more), (0, 0))) for one in (self.offsets, self.poses)))

    def shared_by(self, sites):
        """The `Sites` with it as what their readings share, offsets first.

        Raises SolutionError where set-ups may move as all radii do, and nothing tells them apart.
        """
        if not self.offsets.shape[1] + self.poses.shape[1]:
            return sites
        design, radii = free_design(replace(sites, shared=None))
        others = np.hstack([design, self.offsets])
        taken = np.linalg.lstsq(others, self.poses, rcond=None)[0]
        _, size, ways = np.linalg.svd(self.poses - others @ taken, full_matrices=False)
        alike = taken[radii] @ ways[size <= LEAST_MOTION_M].T
        if np.abs(alike).max(initial=0.0) > LEAST_MOTION_M:
            raise SolutionError(
                message(
                    "radius_of_lines",
                    "no capacity: the set-ups are tied to nothing but the wall and see lines of it"
                    " alone, which tell differences of radii; strap a course"
                    " (circumferences.csv), or tie them by targets",
                )
            )
        chosen = self.poses @ ways[size > LEAST_MOTION_M].T  # not `left`: radii stay what they are
        return replace(sites, shared=np.hstack([self.offsets, chosen]))

    def ways_of(self, sites):
        """(k + m, s) by what of each of these the columns move that sites share, but for those of
        lines: they move no point.
        """
        count, k = self.offsets.shape
        columns = sites.shared[:count]
        chosen = columns[:, columns.any(axis=0)][:, k:]
        ways = np.linalg.lstsq(self.poses, chosen, rcond=None)[0]
        return scipy.linalg.block_diag(np.eye(k), ways)


def unbound_of(points, by_points, accepted):
    """`Unbound` of the radii of a wall.

    by_points  (n, 3 m) their derivative by the coordinates of the accepted points (m,)
    """
    index = coordinates_of(accepted)
    columns = {False: [], True: []}
    for one in offsets_then_poses(points):
        columns[one.what == "pose"].append(size_of(one) * (by_points @ one.column_m[index]))
    return Unbound(*(_stacked(columns[is_pose], by_points.shape[0]) for is_pose in (False, True)))


def offsets_then_poses(points):
    """What nothing binds of points, in the order of the columns that a field shares."""
    return sorted(points.unbound, key=lambda one: one.what == "pose")


def size_of(cause):
    """How far off it may be, m or rad; of an offset the unit."""
    if cause.what != "pose":
        return 1.0
    return MOVED_M if cause.unit == "m" else TURNED_RAD


def _stacked(columns, count):
    return np.column_stack(columns) if columns else np.zeros((count, 0))
