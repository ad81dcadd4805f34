"""Wall of an upright tank known from its drawing alone: nominal courses with large uncertainty.

Such a wall interpolates between the dips of a calibration by liquid. Each course is a cylinder. Its
radius differs from the nominal radius by the standard uncertainty in the job. Bulge and taper of a
course are covered by prior components, as in a strapped wall.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.messages import message
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.tanks import insets_of, shell_zero
from tankcal.pipeline.tanks.vertical import nominal_inside_m
from tankcal.pipeline.taped_wall import UprightAxis, field_of_readings
from tankcal.pipeline.wall.finding import joints_of
from tankcal.pipeline.wall_readings import (
    WallReading,
    factors_of_readings,
    noise_of,
    settle_readings,
    sites_of,
)
from tankcal.pipeline.wall_straps import mean_radii

COMMON = 0.8  # share of the variance of a radius that is common to all courses


@dataclass(frozen=True)
class NominalWall(ReadWall):
    """Wall from the drawing; a `ReadWall` whose readings are the nominal radii."""

    surveyed_as = "nominal"
    shell = UprightAxis()
    without_inputs = ("offset",)
    straps = None

    @cached_property
    def radius_m(self):
        """Radius of each course on the side of the survey, m, shape (courses,)."""
        return mean_radii(self.field)

    def lowest_outline(self, azimuth_rad):
        """Position (x, y) of the axis and radii (n,) of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of the uncertainty of the drawing: common to all courses and of each."""
        return factors_of_readings(self.accepted, weights)

    def read_with(self, weights):
        """Return no derivatives: no instrument input affects a nominal wall."""
        return {}


def find_nominal_wall(job, progress=lambda text: None):
    """`NominalWall` of an upright job from its nominal diameter and courses.

    The job's liquid section gives the standard uncertainty of a radius. Most of its variance is
    common to all courses, because an error of the nominal diameter affects all courses.

    Parameters
    ----------
    job : Job
    progress : callable
        Called with a line of text when the step begins.

    Returns
    -------
    NominalWall
    """
    progress(message("nominal_wall", "taking the wall of the drawing, which liquid will measure"))
    joints, zero, sd = joints_of(job), shell_zero(job, None), job.liquid.u_radius_m
    insets = insets_of(job, job.switches)
    inside = [nominal_inside_m(job, course) for course in job.courses]
    common = sd * np.sqrt(COMMON)
    readings = [
        WallReading(
            "nominal_radius",
            number,
            (joints[number] + joints[number + 1]) / 2 - zero,
            radius + inset,
            sd * np.sqrt(1 - COMMON),
            effects={("nominal_radius_of_all", ""): (1000 * common, "mm", common)},
        )
        for number, (radius, inset) in enumerate(zip(inside, insets, strict=True))
    ]
    sites, noise = sites_of(readings, joints, zero), noise_of(readings)

    def field_of(accepted):
        return field_of_readings(sites, readings, noise, job.tank.nominal_diameter_m / 2)

    none_rejected = np.zeros(len(readings), dtype=bool)
    radius = np.array([reading.radius_m for reading in readings])
    field, tested = settle_readings(
        field_of(none_rejected), field_of, (sites, radius, noise), none_rejected
    )
    return NominalWall(joints, zero, tuple(readings), np.arange(len(readings)), tested, field)
