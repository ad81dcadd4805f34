"""Wall of a tank surveyed by points, with additional straps and reference lines."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse

from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.section_noise import noise_of_sections
from tankcal.geometry.shell import Shell
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.wall.told_unknowns import ToldUnknowns
from tankcal.pipeline.wall.undecided_columns import factors_of_undecided
from tankcal.pipeline.wall_readings import (
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    names_of,
)
from tankcal.pipeline.wall_straps import Straps
from tankcal.sections import Section, coordinates_of
from tankcal.tank.budgets import survey_factors


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
    covariance_m2 : ndarray, sparse array or `PredictedCovariance`, shape (3 m, 3 m)
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
    told : ToldUnknowns or None
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
    told: ToldUnknowns | None = None
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
        index = coordinates_of(members)
        covariance = by_points @ (self.covariance_m2[index][:, index] @ by_points.T)
        return (
            covariance
            if self.told is None
            else covariance + self.told.spread_of(by_points, members)
        )

    def point_covariances_m2(self):
        """Covariance (m, 3, 3) of the coordinates of each accepted point, m2; see `spread_of`."""
        covariances = np.empty((len(self.accepted), 3, 3))
        for row, column in np.ndindex(3, 3):
            along = self.covariance_m2.diagonal(column - row)
            covariances[:, row, column] = along[min(row, column) :: 3][: len(covariances)]
        return covariances if self.told is None else covariances + self.told.spread_alone()

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
        covariance, index = self._covariance_of(weights), coordinates_of(self.accepted)
        effects = [weights @ (self.radii_by_points @ cause.column_m[index]) for cause in causes]
        return survey_factors(covariance, self.noise_dof, causes, effects)

    def _covariance_of(self, weights):
        """Covariance (f, f) of features due to the points.

        The covariance of a plan with many points is applied to few columns and never formed.
        """
        if isinstance(self.covariance_m2, np.ndarray) or scipy.sparse.issparse(self.covariance_m2):
            return weights @ self.points_m2 @ weights.T
        by_points = weights @ self.radii_by_points
        return by_points @ (self.covariance_m2 @ by_points.T)

    @cached_property
    def points_m2(self):
        """Covariance (n, n) of the readings due to the points, also between sections, m2."""
        covariance = self.radii_by_points @ (self.radii_by_points @ self.covariance_m2).T
        return covariance.toarray() if scipy.sparse.issparse(covariance) else covariance

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
