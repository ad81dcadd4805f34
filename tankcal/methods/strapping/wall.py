"""Wall measured by strapping, with or without reference lines.

A circumference is the mean radius of a level, except for the area term (`geometry.girth`): the
circle of the perimeter has a larger area than the wall. Each reading is therefore converted to the
radius of the circle of equal area. With straps alone the courses are cylinders of these radii, as
in the strapping standards. Form between the straps of a course (bulge, taper) is covered in the
uncertainty, with the prior size of the wall field. Offsets from reference lines transfer the radius
of the strapped course to the other courses. The wall is then a surface of revolution.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.geometry.girth import perimeter_excess
from tankcal.messages import message
from tankcal.pipeline.checks.size import radii_of_courses
from tankcal.pipeline.read_wall import (
    readings_of_offsets,
    readings_of_straps,
    readings_of_untold,
)
from tankcal.pipeline.tanks import insets_of, shell_zero
from tankcal.pipeline.wall.finding import joints_of
from tankcal.pipeline.wall_straps import (
    AreaTerm,
    TapedWall,
    UprightAxis,
    adjust_readings,
    courses_with_readings,
    gauged_plates,
    typical_shape_m,
)
from tankcal.survey.strapping import reduce_straps, tapes_used


@dataclass(frozen=True)
class StrappedWall(TapedWall):
    """Strapped wall of an upright tank."""

    surveyed_as = "strapping"
    shell = UprightAxis()
    without_inputs = ("offset",)  # the offset of points; a tape has its own offset

    def lowest_outline(self, azimuth_rad):
        """Position (x, y) of the axis and radii (n,) of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])


def find_strapped_wall(job, progress, amplitudes=None):
    """`StrappedWall` of a job with strapped circumferences.

    Parameters
    ----------
    job : Job
    progress : callable
        Called with a line of text when a step begins.
    amplitudes : Amplitudes, optional
        Known amplitudes of the wall components; None: estimated from the readings.
    """
    straps, lines = job.strapping, job.lines
    progress(
        message(
            "strapping",
            "reducing {count} readings of the tape to the courses of the shell",
            count=len(straps.straps),
        )
    )
    nominal, courses = job.tank.nominal_diameter_m / 2, [course.name for course in job.courses]
    reduced = reduce_straps(straps, job.survey.shell_temperature_c, 2 * nominal)
    places = [i for i, reduced_strap in enumerate(reduced) if not reduced_strap.strap.check]
    shape_m = typical_shape_m() if straps.shape_sd_m is None else straps.shape_sd_m
    term = AreaTerm(*perimeter_excess(shape_m, nominal))
    joints, zero = joints_of(job), shell_zero(job, None)
    readings = readings_of_straps([reduced[i] for i in places], courses, term)
    if lines is not None:
        progress(
            message(
                "plumbing",
                "adjusting {count} offsets from {lines} reference lines",
                count=len(lines.offsets),
                lines=len(lines.lines),
            )
        )
        adjusted_offsets = [i for i, offset in enumerate(lines.offsets) if not offset.check]
        adjusted = [lines.offsets[i] for i in adjusted_offsets]
        insets = insets_of(job, job.switches)
        readings += readings_of_offsets(lines, adjusted, courses, insets)
        places += adjusted_offsets
    unmeasured = readings_of_untold(job, courses_with_readings(job, set()), joints, zero)
    readings, places = readings + unmeasured, places + [-1] * len(unmeasured)
    readings, tested, field = adjust_readings(
        readings, (joints, zero, nominal), amplitudes, snooping=job.snooping
    )
    return StrappedWall(
        joints_m=joints,
        zero_m=zero,
        readings=tuple(readings),
        places=np.array(places),
        tested=tested,
        field=field,
        reduced=reduced,
        area_term=term,
        plate_sd_m=gauged_plates(job),
        tapes=tapes_used(straps),
        shape_sd_m=shape_m,
    )


def inside_radii(job, wall):
    """`InsideRadii` of a `StrappedWall`; its warnings compare single courses."""
    plates = np.array([course.thickness_m + course.paint_m for course in job.courses])
    inside = wall.radius_m - plates * (job.survey.side == "outside")
    return replace(radii_of_courses(job, inside), has_single_checks=False)
