"""Upright tank defined by the radii of its courses.

The radii come from a former table or record, or are declared. They are used alone, or updated by a
survey of some courses (`update`).

Each radius is that of the circle of the mean area of a course, inside, shell empty, at its own
reference temperature. The volume up to a joint therefore depends on the radii alone. Between joints
the uncertainty includes the possible form of a course (`geometry.field.estimate`).
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tankcal.geometry.field.estimate import MeanField
from tankcal.messages import message
from tankcal.pipeline.tanks import shell_zero
from tankcal.pipeline.taped_wall import UprightAxis
from tankcal.pipeline.wall.finding import joints_of
from tankcal.tank.budgets import Factor
from tankcal.uncertainty import factor_of

if TYPE_CHECKING:
    from tankcal.methods.radii.update import Updated

OWN, COMMON = "course_radii", "course_radii_common"  # names of the causes in a budget


@dataclass(frozen=True)
class RadiiWall:
    """Wall of declared radii.

    Attributes
    ----------
    joints_m : ndarray, shape (courses + 1,)
        Heights of the joints above the bottom, m.
    zero_m : float
        Height of the table's zero above the bottom, m.
    radius_m : ndarray, shape (courses,)
        Radii, m.
    causes : tuple of Factor
        Causes of uncertainty of the radii, with columns (courses, c), m.
    by_inputs : dict
        {declared input: derivative (courses,) of the radii}, if a survey contributed.
    updated : Updated or None
        Survey of some courses.
    """

    joints_m: np.ndarray
    zero_m: float
    radius_m: np.ndarray
    causes: tuple[Factor, ...]
    by_inputs: dict
    updated: "Updated | None" = None
    surveyed_as = "radii"
    shell = UprightAxis()
    without_inputs = ("offset", "scale")  # of surveyed lengths
    has_applied_inputs = True
    straps = None

    @property
    def field(self):
        """`MeanField` of the radii."""
        return MeanField(self.radius_m)

    @property
    def surveyed(self):
        """Wall of the survey of some courses, or None without a survey."""
        return None if self.updated is None else self.updated.surveyed

    @property
    def covariance_m2(self):
        """Covariance of the radii without declared inputs, m2, shape (courses, courses)."""
        zero = np.zeros((len(self.radius_m), len(self.radius_m)))
        return sum((cause.columns @ cause.columns.T for cause in self.causes), start=zero)

    def covariance_with(self, inputs):
        """Covariance of the radii with declared inputs, m2, shape (courses, courses)."""
        u_of_inputs = {declared_input.name: declared_input.u for declared_input in inputs}
        covariance_m2 = self.covariance_m2
        for name, column in self.by_inputs.items():
            covariance_m2 = covariance_m2 + u_of_inputs.get(name, 0.0) ** 2 * np.outer(
                column, column
            )
        return covariance_m2

    def lowest_outline(self, azimuth_rad):
        """Position (x, y) of the axis and radii (n,) of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of the uncertainty of features, with weights (f, courses) of the radii."""
        return tuple(cause.mapped(lambda columns: weights @ columns) for cause in self.causes)

    def read_with(self, weights):
        """Derivatives (f,) of features by the inputs that affect a survey of some courses."""
        return {name: weights @ column for name, column in self.by_inputs.items()}


def find_radii_wall(job, progress):
    """`RadiiWall` of a job with declared radii and no survey."""
    progress(message("taking_radii", "taking the radii of {file}", file=job.radii.file))
    return wall_of_radii(job, job.radii.radius_m, causes_of(job.radii))


def wall_of_radii(job, radius_m, causes, by_inputs=None):
    """`RadiiWall` of radii (courses,), m, with causes and derivatives as in `RadiiWall`."""
    nonzero_causes = tuple(cause for cause in causes if np.any(cause.columns))
    return RadiiWall(
        joints_of(job), shell_zero(job, None), radius_m, nonzero_causes, by_inputs or {}
    )


def causes_of(radii):
    """`Factor`s of the uncertainty of `Radii`: common to all courses, and separate for each."""
    common = np.full((len(radii.radius_m), 1), radii.u_common_m)
    return (
        Factor(COMMON, common, u=1000 * radii.u_common_m, unit="mm"),
        Factor(OWN, factor_of(radii.covariance_m2)),
    )


def job_as_declared(job):
    """Job whose survey has the conditions of its radii: inside, empty, at their temperature."""
    temperature = job.radii.temperature_c
    if temperature == job.table.reference_temperature_c:
        temperature = None
    survey = replace(
        job.survey,
        side="inside",
        shell_temperature_c=temperature,
        liquid_level_m=None,
        liquid_density_kg_m3=None,
    )
    return replace(job, survey=survey)
