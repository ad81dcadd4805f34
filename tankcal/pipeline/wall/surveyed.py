"""Upright wall surveyed by points, with additional straps and reference lines.

Some columns of points belong either to the wall or to a fitting. The table lies midway between the
wall with such a column and the wall without it. Half of the difference is the standard uncertainty,
as for a quantity with two equally probable values. U is about twice this half and covers both.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse

from tankcal.covariance import PointCovariance
from tankcal.geometry.field.amplitudes import noise_of_sections
from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.shell import UNDECIDED, Shell
from tankcal.messages import list_some, message
from tankcal.pipeline.read_wall import (
    ReadWall,
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    names_of,
)
from tankcal.pipeline.wall.shared_unknowns import EstimatedUnknowns
from tankcal.pipeline.wall_straps import Straps
from tankcal.sections import Section, coordinates_of
from tankcal.tank.body import Factor
from tankcal.tank.budgets import survey_factors

ALIKE = 1 / 3  # correlation of two columns, for a share of wall uniform from 0 to 1


# ---- columns of points that belong either to the wall or to a fitting, and their uncertainty


def undecided_halves(shell, accepted, groups):
    """Half of the deviation of points in undecided columns from the wall without them.

    Parameters
    ----------
    shell : Shell
    accepted : ndarray of int, shape (m,)
        Points on the wall, or in such columns.
    groups : sequence of Group
        Groups of indices into `accepted`.

    Returns
    -------
    ndarray, shape (m, columns)
        In the order of the groups' members, m.
    """
    order = accepted[np.concatenate([group.members for group in groups])]
    columns = np.arange(shell.column.max(initial=-1) + 1)
    return 0.5 * shell.residual_m[order, None] * np.equal.outer(shell.column[order], columns)


def factors_of_undecided(halves):
    """`Factor`s of the uncertainty due to undecided columns; () without any.

    Parameters
    ----------
    halves : ndarray, shape (f, columns)
        Half of the change of the features due to each column.

    Returns
    -------
    tuple of Factor

    Notes
    -----
    Column i belongs to the wall with an unknown probability p. For p uniform from 0 to 1 its
    variance is 1/4. The covariance of two columns is the variance of p, 1/12. Therefore many seams
    or many pipes of a tank do not average out.

    Examples
    --------
    >>> factor, = factors_of_undecided(np.array([[3.0, 3.0]]))
    >>> round(float(np.sum(factor.columns**2)), 9)  # 9 + 9, and twice 9 / 3
    24.0
    """
    if not np.any(halves):
        return ()
    # One part per column and one common part give equal correlations `ALIKE`.
    separate, common = (
        np.sqrt(1 - ALIKE) * halves,
        np.sqrt(ALIKE) * halves.sum(axis=1, keepdims=True),
    )
    return (Factor("undecided", np.hstack([separate, common])),)


def tell_undecided(names, shell, most):
    """Text of a warning that names the points in undecided columns, in a tuple; () without any.

    Parameters
    ----------
    names : sequence of str, length n
        Names of the points.
    shell : Shell
    most : int
        Largest number of names in the text.
    """
    undecided = np.flatnonzero(shell.reason == UNDECIDED)
    if not len(undecided):
        return ()
    return (
        message(
            "undecided_columns",
            "{count} points one above another, up to {deep_mm:.0f} mm off the wall, may be a seam "
            "of it, or a pipe or bracket before it ({points}): the table lies halfway, and U has "
            "the difference; take out the points of fittings, or keep all with snooping = false",
            count=len(undecided),
            deep_mm=1000 * np.abs(shell.residual_m[undecided]).max(),
            points=list_some([names[i] for i in undecided], most),
        ),
    )


# ---- wall of a tank surveyed by points, with additional straps and reference lines


@dataclass(frozen=True)
class Wall:
    """Surveyed wall of a tank.

    Attributes
    ----------
    shell : Shell
        Axis, tilt and classification of all points.
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, along the vertical, m.
    accepted : ndarray, shape (m,)
        Indices of the accepted points in job.points.
    covariance_m2 : PointCovariance
        Covariance of the accepted points, m2.
    noise_dof : float
        Degrees of freedom of the scale of that covariance.
    field : WallField
        Wall at and between the points, from which the table is computed.
    radii_by_points : sparse array, shape (n, 3 m)
        Derivative of the field's readings, in their order, by x, y, z of the accepted points.
    undecided_m : ndarray, shape (n, columns)
        Shift of the readings towards the wall without each column of points that may belong to a
        fitting: half of their deviation from that wall, m.
    sections : tuple of Section
        Circles and outlines fitted to the points, from the bottom up.
    straps : Straps or None
        Circumferences by tape, which follow the points in the readings.
    read : ReadWall or None
        Readings without a point: straps and offsets from reference lines.
    by_inputs : dict
        {input of the budget: derivative (n,) of the readings}, for inputs that affect points.
    without_inputs : tuple of str
        Inputs that do not apply to these points.
    origins_m : ndarray, shape (sections, 2)
        Origin x, y of the radii of each section and of the field's centres, in the frame of the
        points, m.
    estimated_unknowns : EstimatedUnknowns or None
        Estimates of offsets and poses without a prior; None if there are none.
    """

    shell: Shell
    joints_m: np.ndarray
    accepted: np.ndarray
    covariance_m2: object
    noise_dof: float
    field: WallField
    radii_by_points: scipy.sparse.csr_array
    undecided_m: np.ndarray
    sections: tuple[Section, ...]
    straps: Straps | None = None
    read: ReadWall | None = None
    by_inputs: dict = field(default_factory=dict)
    without_inputs: tuple = ()
    origins_m: np.ndarray | None = None
    estimated_unknowns: EstimatedUnknowns | None = None
    surveyed_as = "wall"
    has_applied_inputs = False

    def lowest_outline(self, azimuth_rad):
        """Position (x, y) of the axis at the bottom and radii (n,) of the lowest section, m."""
        outline, height = self.sections[0].outline, self.sections[0].group.height_m
        x, y = np.array([outline.x_m, outline.y_m]) - height * np.array(self.shell.slope)
        return x, y, outline.radius_m(azimuth_rad)

    def spread_of(self, by_points, members):
        """Covariance (r, r) of functions of some points, with that of estimated poses and offsets.

        Parameters
        ----------
        by_points : ndarray, shape (r, 3 k)
            Derivative of the functions by the coordinates of the points.
        members : ndarray of int, shape (k,)
            Indices of the points among the accepted points.

        Returns
        -------
        ndarray, shape (r, r)
        """
        covariance = self.covariance_m2.take(members).propagate(by_points)
        return (
            covariance
            if self.estimated_unknowns is None
            else covariance + self.estimated_unknowns.spread_of(by_points, members)
        )

    def point_covariances_m2(self):
        """Covariance (m, 3, 3) of the coordinates of each accepted point, m2; see `spread_of`."""
        covariances = self.covariance_m2.point_blocks
        return (
            covariances
            if self.estimated_unknowns is None
            else covariances + self.estimated_unknowns.spread_alone()
        )

    def factors(self, job, weights):
        """`Factor`s of the uncertainty of features, with derivatives (f, n) by the readings."""
        factors = self._factors_of_points(job.points.causes, weights)
        factors = (*factors, *factors_of_undecided(weights @ self.undecided_m))
        if self.read is None:
            return factors
        outside = job.survey.side == "outside"  # a reading contains a plate that is not subtracted
        plate_removed = [reading.by_inputs.get("plate_thickness", 0.0) for reading in self.readings]
        sees = np.append(np.full(self.points_read, outside), outside - np.array(plate_removed))
        gauged = {} if self.straps is None else self.straps.plate_sd_m
        plates = factors_of_plates(names_of(job.courses), self.field, weights * sees, gauged)
        return (
            *factors,
            *factors_of_readings(self.readings, weights[:, self.points_read :]),
            *plates,
        )

    def _factors_of_points(self, causes, weights):
        """`Factor`s of the points for features.

        If features outnumber readings, the factors of the readings are computed first and mapped to
        the features. The result is the same.
        """
        if len(weights) > weights.shape[1]:
            of_readings = self._factors_of_points(causes, np.eye(weights.shape[1]))
            return tuple(
                reading.mapped(lambda columns: weights @ columns) for reading in of_readings
            )
        covariance = weights @ self.points_m2 @ weights.T
        index = coordinates_of(self.accepted)
        effects = [weights @ (self.radii_by_points @ cause.column_m[index]) for cause in causes]
        return survey_factors(covariance, self.noise_dof, causes, effects)

    @cached_property
    def points_m2(self):
        """Covariance (n, n) of the readings due to the points, also between sections, m2."""
        return self.covariance_m2.propagate(self.radii_by_points)

    def read_with(self, weights):
        """Derivatives (f,) of features by inputs on which points and readings depend.

        The inputs are plates between the points and the other side, and the temperature that a tape
        shares with the shell. Inside points do not see plates.
        """
        derivatives = inputs_read_with(self.readings, weights[:, self.points_read :])
        for name, column in self.by_inputs.items():
            derivatives[name] = derivatives.get(name, 0.0) + weights @ column
        return derivatives

    @cached_property
    def section_noise(self):
        """`SectionNoise` of each section from the points of the field."""
        ring = self.field.sites.ring[: self.points_read]
        members = [np.flatnonzero(ring == number) for number in range(len(self.sections))]
        return noise_of_sections(self.field, members)

    @property
    def readings(self):
        """Accepted readings of the field without a point."""
        return [] if self.read is None else self.read.accepted

    @property
    def points_read(self):
        """Number of readings of the field that are points."""
        return len(self.field.radius_m) - len(self.readings)


# ---- covariance of surveyed points: as given, by S-transformation, and as scatter in plan


def s_transform(points):
    """Adjusted points with the covariance of their relative positions (S-transformation).

        C' = S C S + s2 D D',   S = I - D D'

    D is an orthonormal basis of the common shift and rotation about the vertical, and s2 is the
    mean remaining variance. No volume depends on these four parameters. A datum fixed by one photo
    or one point would give them an arbitrary variance, on which the fitted sections would depend.

    Parameters
    ----------
    points : Points
        n points with a `PointCovariance`, m2.

    Returns
    -------
    Points
        With C', and with the columns of their causes projected by S.
    """
    basis = common_motions(points.xyz_m)
    covariance = PointCovariance.convert(points.covariance_m2, 3)
    across = s_transform_factors(basis, covariance @ basis, covariance.diagonal().sum())
    # C' = C - D A' - A D': the columns D and A, and what joins them.
    joint = -np.kron([[0, 1], [1, 0]], np.eye(4))
    covariance = covariance.add_columns(np.hstack([basis, across]), joint)
    causes = tuple(
        replace(cause, column_m=cause.column_m - basis @ (basis.T @ cause.column_m))
        for cause in points.causes
    )
    return replace(points, covariance_m2=covariance, causes=causes)


def common_motions(xyz_m):
    """Orthonormal basis of the shifts of points and of their rotation about the vertical.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        Coordinates, m.

    Returns
    -------
    ndarray, shape (3 n, 4)
        Orthonormal columns, in the order x, y, z of each point.

    Examples
    --------
    >>> basis = common_motions(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 1]]))
    >>> bool(np.allclose(basis.T @ basis, np.eye(4)))
    True
    """
    x, y, _ = (xyz_m - xyz_m.mean(axis=0)).T
    motions = np.zeros((len(x), 3, 4))
    motions[:, :, :3] = np.eye(3)
    motions[:, 0, 3], motions[:, 1, 3] = -y, x
    return np.linalg.qr(motions.reshape(-1, 4))[0]


def s_transform_factors(basis, spread, trace):
    """Matrix A of C' = C - D A' - A D', the covariance of `s_transform`, without forming S C S.

        A = C D - D (D'C D + s2 I) / 2

    Parameters
    ----------
    basis : ndarray, shape (3 n, 4)
        D, from `common_motions`.
    spread : ndarray, shape (3 n, 4)
        C D, m2.
    trace : float
        Trace of C, m2.

    Returns
    -------
    ndarray, shape (3 n, 4)
        A, m2.

    Examples
    --------
    >>> basis = common_motions(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 1]]))
    >>> a = s_transform_factors(basis, basis, trace=9.0)  # of C = I nothing changes
    >>> bool(np.allclose(a, 0))
    True
    """
    across = spread - 0.5 * basis @ (basis.T @ spread)
    remaining_trace = trace - 2 * np.sum(basis * across)
    # The trace of C' shared equally by the 3n - 4 remaining parameters gives s2.
    return across - 0.5 * max(remaining_trace, 0.0) / (len(basis) - 4) * basis


def radial_sds(points):
    """Standard deviations (n,) of the points in plan, m; None if the file gives none."""
    if points.covariance_m2 is not None:
        variances = points.covariance_m2.diagonal().reshape(-1, 3)
    elif points.sd_m is not None:
        variances = points.sd_m**2
    else:
        return None
    return np.sqrt(variances[:, :2].mean(axis=1))


def median_sd(sds):
    """Median standard deviation of the points in plan, m; 1 m if the file gives none."""
    return 1.0 if sds is None else float(np.median(sds))


def given_covariance(points, wall):
    """`PointCovariance` of points (m,), m2; 1 m for each coordinate if the file gives none."""
    if points.covariance_m2 is not None:
        return PointCovariance.convert(points.covariance_m2, 3).take(wall)
    sd = np.ones((len(wall), 3)) if points.sd_m is None else points.sd_m[wall]
    return PointCovariance.convert(sd.ravel() ** 2, 3)
