"""Estimates of the offsets and scales that the readings of a wall share, and their correlation
with the mean radius.

A cause z with prior standard deviation 1 moves the readings y by c z. V is the full covariance of
the readings, which includes the cause. P is the precision after elimination of the parameters
without a prior. A is the derivative of the mean radius by the readings. Then

    z = c' P y,   variance 1 - c' P c,   covariance with the radius -A c.

A cause without a prior is one of the unknowns of the field.

A single set-up in the middle of a tank cannot separate the offset from the radius: their
correlation is -1.

Source: Koch 1999, section 3.2.

Unknowns shared by the points of a wall, as estimated with the wall, and their uncertainty.

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

Unknowns without a prior that readings of a wall share: free offsets and poses of set-ups.

They are estimated together with the radii and the centres of the rings. Some displacements of
set-ups act like a change of radii or centres (all lines outwards give a larger tank). Others hardly
change any radius. Only the remaining displacements are unknowns.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError
from tankcal.geometry.field.blunders import restricted_precision
from tankcal.geometry.field.components import COMPONENTS
from tankcal.geometry.field.estimate import LEVELS
from tankcal.geometry.field.sites import free_design
from tankcal.messages import message
from tankcal.quadrature import panels
from tankcal.sections import circle_by_coordinates, coordinates_of

IN_SI = {"mm": 1e-3, "ppm": 1e-6}
SURE = 0.1  # largest standard deviation of a determined combination, in its prior range
MOVED_M, TURNED_RAD = 0.3, 0.05  # prior range of position and orientation of an untied set-up
LEAST_MOTION_M = 0.005  # least joint change of all radii, over the prior range, of an unknown


@dataclass(frozen=True)
class EstimatedCause:
    """A cause that readings share, before and after the adjustment of the wall.

    Lengths are in m; a scale is relative.

    Attributes
    ----------
    name, what : str
        Name of the instrument, and "instrument_offset" or "instrument_scale".
    u_before : float
        Standard uncertainty before the adjustment; inf: no prior information.
    value : float
        Estimate, beyond the correction already applied.
    u_after : float
        Standard uncertainty after the adjustment.
    correlation : float
        Correlation with the mean radius of the tank.
    """

    name: str
    what: str
    u_before: float
    value: float
    u_after: float
    correlation: float


def estimate_causes(job, wall):
    """Return an `EstimatedCause` for each offset and scale that points of a wall share.

    Returns
    -------
    tuple of EstimatedCause
        Causes with a prior first, then causes without a prior.
    """
    kinds = ("instrument_offset", "instrument_scale")
    bound = [cause for cause in job.points.causes if cause.what in kinds]
    unbound = [cause for cause in job.points.unbound if cause.what in kinds]
    if not bound and not unbound:
        return ()
    # The mean radius of all courses is a linear function of the readings: weight of the levels
    # times the weights of the readings at each level.
    field, weight = wall.field, _mean_radius_weights(wall.field)
    along = weight @ field.means.weights
    precision = None
    estimates, noise = [], noise_of_wall(wall)
    # Variance of the mean radius due to the parts of the wall without readings.
    unseen_m2 = sum(weight @ field.means.unseen(i) @ weight for i in range(len(COMPONENTS)))
    u_radius = np.sqrt(along @ noise @ along + unseen_m2)
    # P eliminates the radii of the courses; subtracting the mean first only limits rounding.
    deviations = field.radius_m - field.radius_m.mean()
    coordinates = coordinates_of(wall.accepted)
    for cause in bound:
        if precision is None:
            # The field holds its own noise; replace it by the noise of the readings of this wall.
            covariance_m2 = field.covariance_m2 + noise - field.noise_m2
            precision = restricted_precision(covariance_m2, free_design(field.sites)[0])
        u = cause.u * IN_SI[cause.unit]
        # Effect of distances too long by one u.
        column = -(wall.radii_by_points @ cause.column_m[coordinates])
        # Posterior variance of the cause; rounding must not make it zero or negative.
        variance = max(1 - column @ precision @ column, 1e-12)
        shift, u_after = u * (column @ precision @ deviations), u * np.sqrt(variance)
        # The covariance with the radius is -A c.
        correlation = -(along @ column) / np.sqrt(variance) / u_radius
        estimates.append(
            EstimatedCause(
                cause.name,
                cause.what,
                u,
                float(shift),
                float(u_after),
                _limit_correlation(correlation),
            )
        )
    if unbound and field.sites.shared is not None:  # unbound causes are the first shared unknowns
        values, shared_covariance = field.shared
        covariance_with_radius = weight @ field.means.with_free[:, -len(values) :]
        for number, cause in enumerate(unbound):
            u_after = float(np.sqrt(shared_covariance[number, number]))
            correlation = -covariance_with_radius[number] / u_after / u_radius
            value = -float(values[number])
            estimates.append(
                EstimatedCause(
                    cause.name, cause.what, np.inf, value, u_after, _limit_correlation(correlation)
                )
            )
    return tuple(estimates)


def _limit_correlation(correlation):
    """Correlation limited to [-1, 1] against rounding."""
    return float(np.clip(correlation, -1, 1))


def noise_of_wall(wall):
    """Return the covariance of the noise of the readings of a wall, shape (n, n), m2.

    A field of points alone has only the covariance of each section; the wall has the full
    covariance.
    """
    return wall.points_m2 if wall.read is None else wall.field.noise_m2


def _mean_radius_weights(field):
    """Derivative (f,) of the mean radius of all courses by the radii at each course and level."""
    courses = len(field.outlines_m)
    return np.tile(panels([0.0, 1.0], LEVELS)[1], courses) / courses


# ---- unknowns shared by the points of a wall, as estimated with the wall, and their uncertainty


@dataclass(frozen=True)
class EstimatedUnknowns:
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


def estimate_unknowns(points, unbound, field, parts):
    """`EstimatedUnknowns` of a field whose points have unknowns in common.

    Parameters
    ----------
    points : Points
    unbound : Unbound
        Derivatives of the field's readings by the unknowns.
    field : WallField
    parts : tuple
        accepted (m,), radii_by_points (n, 3m), covariance_m2 (3m, 3m), as in `Wall`.
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
    return EstimatedUnknowns(
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


def add_spread(unknowns, section, fitted):
    """Section whose circle also has the covariance of the estimated unknowns.

    Parameters
    ----------
    unknowns : EstimatedUnknowns
    section : Section
    fitted : tuple
        (group, xyz_m, covariance_m2, slope, z_m), the arguments of `fit_section`.

    Returns
    -------
    Section
    """
    derivative = circle_by_coordinates(section, *fitted[1:])
    cofactor = section.circle.cofactor_m2 + unknowns.spread_of(derivative, section.group.members)
    return replace(section, circle=replace(section.circle, cofactor_m2=cofactor))


# ---- unknowns without a prior that readings of a wall share: free offsets and poses of set-ups


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
    """
    index = coordinates_of(accepted)
    none = np.zeros((by_points.shape[0], 0))
    columns = {False: [none], True: [none]}
    for cause in offsets_then_poses(points):
        columns[cause.what == "pose"].append(size_of(cause) * (by_points @ cause.column_m[index]))
    return Unbound(*(np.column_stack(columns[is_pose]) for is_pose in (False, True)))


def offsets_then_poses(points):
    """Unknowns of points without a prior, in the order of the shared columns of a field."""
    return sorted(points.unbound, key=lambda cause: cause.what == "pose")


def size_of(cause):
    """Prior range of a pose, m or rad; the unit for an offset."""
    if cause.what != "pose":
        return 1.0
    return MOVED_M if cause.unit == "m" else TURNED_RAD
