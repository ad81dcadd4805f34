"""Unknowns without a prior that readings of a wall share: free offsets and poses of set-ups.

They are estimated together with the radii and the centres of the rings. Some displacements of
set-ups act like a change of radii or centres (all lines outwards give a larger tank). Others hardly
change any radius. Only the remaining displacements are unknowns.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError
from tankcal.geometry.field.sites import free_design
from tankcal.messages import message
from tankcal.sections import coordinates_of

MOVED_M, TURNED_RAD = 0.3, 0.05  # prior range of position and orientation of an untied set-up
LEAST_MOTION_M = 0.005  # least joint change of all radii, over the prior range, of an unknown


@dataclass(frozen=True)
class Unbound:
    """Derivatives of n radii by unknowns without a prior.

    Attributes
    ----------
    offsets : ndarray, shape (n, k)
        By free offsets and scales, in their order.
    poses : ndarray, shape (n, m)
        By x, y and orientation of set-ups, each multiplied by its prior range.
    """

    offsets: np.ndarray
    poses: np.ndarray

    @property
    def first_apart(self):
        """Number of the first ring whose centre is not part of an outline, or None.

        It is 0 if set-ups may move, because a common shift of centres and set-ups then belongs to
        neither.
        """
        return 0 if self.poses.shape[1] else None

    def padded(self, more):
        """Copy with `more` rows of zeros for readings that do not depend on the unknowns."""
        return Unbound(
            *(np.pad(columns, ((0, more), (0, 0))) for columns in (self.offsets, self.poses))
        )

    def shared_by(self, sites):
        """`Sites` with these unknowns as shared columns, offsets first.

        Raises SolutionError if set-ups may move like all radii together, so that the size is
        undetermined.
        """
        if not self.offsets.shape[1] + self.poses.shape[1]:
            return sites
        design, radii = free_design(replace(sites, shared=None))
        absorbing = np.hstack([design, self.offsets])
        absorbed = np.linalg.lstsq(absorbing, self.poses, rcond=None)[0]
        # Singular values measure how much a displacement changes radii beyond sizes and centres.
        _, size, directions = np.linalg.svd(self.poses - absorbing @ absorbed, full_matrices=False)
        radius_change = absorbed[radii] @ directions[size <= LEAST_MOTION_M].T
        if np.abs(radius_change).max(initial=0.0) > LEAST_MOTION_M:
            raise SolutionError(
                message(
                    "radius_of_lines",
                    "no capacity: the set-ups are tied to nothing but the wall and see lines of it"
                    " alone, which tell differences of radii; strap a course"
                    " (circumferences.csv), or tie them by targets",
                )
            )
        # Full columns, not residuals: the radii keep their meaning.
        columns = self.poses @ directions[size > LEAST_MOTION_M].T
        return replace(sites, shared=np.hstack([self.offsets, columns]))

    def ways_of(self, sites):
        """Matrix (k + m, s) from the shared columns of `sites` to the offsets and poses.

        Columns of reference lines are excluded, because they move no point.
        """
        count, k = self.offsets.shape
        columns = sites.shared[:count]
        of_poses = columns[:, columns.any(axis=0)][:, k:]
        ways = np.linalg.lstsq(self.poses, of_poses, rcond=None)[0]
        return scipy.linalg.block_diag(np.eye(k), ways)


def unbound_of(points, by_points, accepted):
    """`Unbound` of the radii of a wall.

    Parameters
    ----------
    points : Points
    by_points : ndarray, shape (n, 3 m)
        Derivative of the radii by the coordinates of the accepted points.
    accepted : ndarray of int, shape (m,)

    Returns
    -------
    Unbound
    """
    index = coordinates_of(accepted)
    columns = {False: [], True: []}
    for cause in offsets_then_poses(points):
        columns[cause.what == "pose"].append(size_of(cause) * (by_points @ cause.column_m[index]))
    return Unbound(*(_stacked(columns[is_pose], by_points.shape[0]) for is_pose in (False, True)))


def offsets_then_poses(points):
    """Unknowns of points without a prior, in the order of the shared columns of a field."""
    return sorted(points.unbound, key=lambda cause: cause.what == "pose")


def size_of(cause):
    """Prior range of a pose, m or rad; the unit for an offset."""
    if cause.what != "pose":
        return 1.0
    return MOVED_M if cause.unit == "m" else TURNED_RAD


def _stacked(columns, count):
    return np.column_stack(columns) if columns else np.zeros((count, 0))
