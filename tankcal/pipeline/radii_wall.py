"""An upright tank whose wall is the radii of its courses: out of a former table, of a record, or
declared; alone, or brought up to date by a survey of some courses (`partial_survey`).

A radius is that of the circle of a course's mean area, inside, the shell empty, at a temperature of
its own. So the volume up to a joint is by the radii alone; between joints the doubt has what a
course may do besides (`geometry.field.mean_field`).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.geometry.field.mean_field import MeanField
from tankcal.messages import message
from tankcal.pipeline.radii_update import RadiiUpdate
from tankcal.pipeline.strapped_wall import UprightAxis
from tankcal.pipeline.tanks import shell_zero
from tankcal.pipeline.wall import joints_of
from tankcal.tank.factors import Factor
from tankcal.uncertainty import factor_of

OWN, COMMON = "course_radii", "course_radii_common"  # their names in a budget


@dataclass(frozen=True)
class Updated:
    """What brought former radii up to date.

    Attributes
    ----------
    surveyed : Wall or StrappedWall
        Of the survey of some courses.
    update : RadiiUpdate
    found_m, u_found_m : ndarray, shape (k,)
        Radii of the measured courses by the survey alone, and their standard uncertainties.
    u_before_m : ndarray, shape (courses,)
        Of the former radii, with the change that was declared.
    """

    surveyed: object
    update: RadiiUpdate
    found_m: np.ndarray
    u_found_m: np.ndarray
    u_before_m: np.ndarray


@dataclass(frozen=True)
class RadiiWall:
    """A wall of declared radii.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    zero_m : float
        Of the table's zero above it.
    radius_m : ndarray, shape (courses,)
    causes : tuple of Factor
        What is uncertain of these radii, (courses, c) m.
    by_inputs : dict
        {input of an uncertainty budget: (courses,) derivative of the radii}, of a survey.
    updated : Updated or None
        By a survey of some courses.
    """

    joints_m: np.ndarray
    zero_m: float
    radius_m: np.ndarray
    causes: tuple[Factor, ...]
    by_inputs: dict
    updated: Updated | None = None
    surveyed_as = "radii"
    shell = UprightAxis()
    without_inputs = ("offset", "scale", "tilt")  # of surveyed lengths
    straps = None

    @property
    def field(self):
        """`MeanField` of the radii."""
        return MeanField(self.radius_m)

    @property
    def surveyed(self):
        """The wall of the survey beside the radii; None: there was none."""
        return None if self.updated is None else self.updated.surveyed

    @property
    def covariance_m2(self):
        """(courses, courses) of the radii, without what declared inputs add."""
        nothing = np.zeros((len(self.radius_m), len(self.radius_m)))
        return sum((cause.columns @ cause.columns.T for cause in self.causes), start=nothing)

    def covariance_with(self, inputs):
        """(courses, courses) of the radii, with what declared inputs add, m2."""
        known = {declared_input.name: declared_input.u for declared_input in inputs}
        found = self.covariance_m2
        for name, column in self.by_inputs.items():
            found = found + known.get(name, 0.0) ** 2 * np.outer(column, column)
        return found

    def lowest_outline(self, azimuth_rad):
        """(x, y) of the axis, and (n,) radii of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of what the radii leave uncertain about features, (f, courses) by them."""
        return tuple(cause.mapped(lambda columns: weights @ columns) for cause in self.causes)

    def read_with(self, weights):
        """{input: (f,) derivative of features}: of what a survey of some courses depends on."""
        return {name: weights @ column for name, column in self.by_inputs.items()}


def find_radii_wall(job, progress):
    """`RadiiWall` of a job whose courses have declared radii, and no survey beside them."""
    progress(message("taking_radii", "taking the radii of {file}", file=job.radii.file))
    return wall_of_radii(job, job.radii.radius_m, causes_of(job.radii))


def wall_of_radii(job, radius_m, causes, by_inputs=None):
    """`RadiiWall` of radii (courses,); causes and by_inputs as there."""
    found = tuple(cause for cause in causes if np.any(cause.columns))
    return RadiiWall(joints_of(job), shell_zero(job, None), radius_m, found, by_inputs or {})


def causes_of(radii):
    """`Factor`s of what is uncertain of `Radii`: what all have in common, and each for itself."""
    common = np.full((len(radii.radius_m), 1), radii.u_common_m)
    return (
        Factor(COMMON, common, u=1000 * radii.u_common_m, unit="mm", type="B"),
        Factor(OWN, factor_of(radii.covariance_m2), type="B"),
    )
