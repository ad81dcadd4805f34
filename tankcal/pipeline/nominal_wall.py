"""An upright tank of which only the drawing is known: its courses, nominal, with wide doubt.

Between the dips of a calibration by liquid it says how the wall goes on, and no more: each course
is a cylinder whose radius departs from the nominal one by the sd that the job has, and what a
course does besides (bulge, taper) is in the doubt, as of a strapped wall.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.messages import message
from tankcal.pipeline.read_wall import ReadWall
from tankcal.pipeline.strapped_wall import UprightAxis, field_of_readings
from tankcal.pipeline.tanks import insets_of, shell_zero
from tankcal.pipeline.tanks.vertical import nominal_inside_m
from tankcal.pipeline.wall import joints_of
from tankcal.pipeline.wall_readings import (
    WallReading,
    factors_of_readings,
    noise_of,
    settle_readings,
    sites_of,
)
from tankcal.pipeline.wall_straps import mean_radii

COMMON = 0.8  # share of the variance of a course's radius that all courses have in common


@dataclass(frozen=True)
class NominalWall(ReadWall):
    """The wall by its drawing, with what a `ReadWall` has; its readings are the nominal radii."""

    surveyed_as = "nominal"
    shell = UprightAxis()
    without_inputs = ("offset",)
    straps = None

    @cached_property
    def radius_m(self):
        """(courses,) radius of each course, on the side of the survey."""
        return mean_radii(self.field)

    def lowest_outline(self, azimuth_rad):
        """(x, y) of the axis, and (n,) radii of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of what the drawing leaves uncertain: all courses together, and each."""
        return tuple(replace(one, type="B") for one in factors_of_readings(self.accepted, weights))

    def read_with(self, weights):
        """Nothing was read with anything."""
        return {}


def find_nominal_wall(job, progress=lambda text: None):
    """`NominalWall` of an upright job by its nominal diameter and courses.

    The sd of a radius is that of the job's liquid; all courses have most of it in common, for what
    is wrong of a nominal diameter is wrong of all.
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

    all_of_them = np.zeros(len(readings), dtype=bool)
    radius = np.array([one.radius_m for one in readings])
    field, tested = settle_readings(
        field_of(all_of_them), field_of, (sites, radius, noise), all_of_them
    )
    return NominalWall(joints, zero, tuple(readings), np.arange(len(readings)), tested, field)
