"""The wall of a tank that points show, with straps and lines beside them."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse

from tankcal.geometry.field.estimate import WallField
from tankcal.geometry.field.section_noise import noise_of_sections
from tankcal.geometry.shell import Shell
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.told_unknowns import ToldUnknowns
from tankcal.pipeline.undecided_columns import factors_of_undecided
from tankcal.pipeline.wall_readings import (
    factors_of_plates,
    factors_of_readings,
    inputs_read_with,
    names_of,
)
from tankcal.pipeline.wall_straps import Straps
from tankcal.sections import Section, coordinates_of
from tankcal.tank.factors import survey_factors


@dataclass(frozen=True)
class Wall:
    """The wall of a tank as surveyed.

    Attributes
    ----------
    shell : Shell
        Axis, tilt, and what became of every point.
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, along the vertical, m.
    accepted : ndarray, shape (m,)
        Indices of the accepted points in job.points.
    covariance_m2 : ndarray, sparse array or `PredictedCovariance`, shape (3 m, 3 m)
        Of the accepted points, m2.
    noise_dof : float
        Degrees of freedom of that covariance's scale.
    field : WallField
        The wall itself, between the points too: what the table is made of.
    radii_by_points : sparse array, shape (n, 3 m)
        Derivative of the field's readings, in their order, by x, y, z of the accepted points.
    undecided_m : ndarray, shape (n, columns)
        By how much the field's readings were moved towards the wall without each column of points
        that may be of a fitting: half of what they depart from it.
    sections : tuple of Section
        Circles and outlines through the points, from the bottom up.
    straps : Straps or None
        Circumferences by tape that are among the readings, after the points.
    read : ReadWall or None
        What of the readings names no point: straps and offsets from reference lines.
    by_inputs : dict
        {input of the budget: (n,) derivative of the field's readings}, of what points depend on.
    without_inputs : tuple of str
        Inputs that have no meaning for these points.
    origins_m : ndarray, shape (sections, 2)
        x and y that the radii of each section were taken about, in the frame of the points: the
        field's centres count from there.
    told : ToldUnknowns or None
        Of offsets and poses that nothing binds beforehand; None: there are none.
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

    def lowest_outline(self, azimuth_rad):
        """(x, y) of the axis at the bottom, and (n,) radii of the lowest section, m."""
        outline, height = self.sections[0].outline, self.sections[0].group.height_m
        x, y = np.array([outline.x_m, outline.y_m]) - height * np.array(self.shell.slope)
        return x, y, outline.radius_m(azimuth_rad)

    def spread_of(self, by_points, members):
        """(r, r) covariance of functions of some accepted points, with what was told of poses and
        offsets.

        by_points  (r, 3k) their derivative by the coordinates of these, members (k,)
        """
        index = coordinates_of(members)
        own = by_points @ (self.covariance_m2[index][:, index] @ by_points.T)
        return own if self.told is None else own + self.told.spread_of(by_points, members)

    def point_covariances_m2(self):
        """(m, 3, 3) covariance of each accepted point with itself, as `spread_of` has it."""
        found = np.empty((len(self.accepted), 3, 3))
        for row, column in np.ndindex(3, 3):
            along = self.covariance_m2.diagonal(column - row)
            found[:, row, column] = along[min(row, column) :: 3][: len(found)]
        return found if self.told is None else found + self.told.spread_alone()

    def factors(self, job, weights):
        """`Factor`s of what the points leave uncertain about features, (f, m) by the readings."""
        found = self._factors_of_points(job.points.causes, weights)
        found = (*found, *factors_of_undecided(weights @ self.undecided_m))
        if self.read is None:
            return found
        outside = job.survey.side == "outside"  # a reading sees a plate that is not taken off it
        taken = [reading.by_inputs.get("plate_thickness", 0.0) for reading in self.readings]
        sees = np.append(np.full(self.points_read, outside), outside - np.array(taken))
        gauged = {} if self.straps is None else self.straps.plate_sd_m
        plates = factors_of_plates(names_of(job.courses), self.field, weights * sees, gauged)
        return (
            *found,
            *factors_of_readings(self.readings, weights[:, self.points_read :]),
            *plates,
        )

    def _factors_of_points(self, causes, weights):
        """Those of the points: of the features, or of the readings where these are fewer, and of
        the features by them, which is the same.
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
        """(f, f) covariance of features by the points; that of a plan of many points acts on few
        columns, and is not written out.
        """
        if isinstance(self.covariance_m2, np.ndarray) or scipy.sparse.issparse(self.covariance_m2):
            return weights @ self.points_m2 @ weights.T
        by_points = weights @ self.radii_by_points
        return by_points @ (self.covariance_m2 @ by_points.T)

    @cached_property
    def points_m2(self):
        """(n, n) covariance of the field's readings by the points, between sections as well."""
        found = self.radii_by_points @ (self.radii_by_points @ self.covariance_m2).T
        return found.toarray() if scipy.sparse.issparse(found) else found

    def read_with(self, weights):
        """{input: (f,) derivative of features}: plates that points on the other side were moved
        through; the temperature that a tape has of the shell, plates that points inside do not see.
        """
        found = inputs_read_with(self.readings, weights[:, self.points_read :])
        for name, column in self.by_inputs.items():
            found[name] = found.get(name, 0.0) + weights @ column
        return found

    @cached_property
    def section_noise(self):
        """`SectionNoise` of each section, by the points of the field."""
        ring = self.field.sites.ring[: self.points_read]
        members = [np.flatnonzero(ring == number) for number in range(len(self.sections))]
        return noise_of_sections(self.field, members)

    @property
    def readings(self):
        """Readings of the field that name no point, and were accepted."""
        return [] if self.read is None else self.read.accepted

    @property
    def points_read(self):
        """How many readings of the field are of points."""
        return len(self.field.radius_m) - len(self.readings)
