"""Whether bare hits or tangents are enough, level by level and course by course."""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import list_some, message
from tankcal.pipeline.cross_checks import is_size_declared
from tankcal.pipeline.nominal_size import allowed_departure_m, inside_radii, nominal_radius_m

SHOWN = 5  # names in a message


def levels_with_few(wall, least):
    """Names of the sections with fewer points, the first of them; None: there are none."""
    few = [one.group.name for one in wall.sections if len(one.group.members) < least]
    return list_some(few, SHOWN) if few else None


def courses_with_few(job, wall, least, *, slopes_count=False):
    """Names of courses with fewer levels, the first of them; None: there are none.

    A course without any is not among them: straps or lines tell it.

    slopes_count  a section that bears a slope shows a taper by itself
    """
    groups = [one.group for one in wall.sections]
    courses = [one.course for one in groups]
    sloped = {one.course for one in groups if slopes_count and one.degree}
    short = [
        course.name
        for index, course in enumerate(job.courses)
        if 0 < courses.count(index) < least and index not in sloped
    ]
    return list_some(short, SHOWN) if short else None


def girth_m(job):
    """Nominal circumference, by which a level asks for so many hits or tangents."""
    return np.pi * job.tank.nominal_diameter_m


def check_nominal(job, wall, file):
    """`Problem`s of a shell that is not as large as on its drawing, in hits or tangents of a file.

    An offset or a scale that nothing else controls goes into the radius, and shows here alone.
    """
    found = inside_radii(job, wall)
    miss = float(np.median(found.radius_m)) - nominal_radius_m(job, float(found.plate_m[0]))
    if abs(miss) > allowed_departure_m(job):
        text = message(
            "wall_unlike_nominal",
            "the courses come out {miss_mm:+.0f} mm of radius from the nominal one: is the offset"
            " or the scale of the instrument wrong, or the length of the bar?",
            miss_mm=1000 * miss,
        )
        yield Problem(file, text)


def check_size_told(job, instruments):
    """`Problem`s of a wall whose size the distances of instruments alone tell.

    A constant or a scale that is wrong in all of them goes into every radius, and nothing else in
    the readings shows it: up to 1 in 500 of the nominal radius passes, many times U.

    instruments  their names
    """
    if job.strapping is not None or is_size_declared(job):
        return
    text = message(
        "size_told_by_distances",
        "blank, and nothing but the distances of {instruments} tells how large the tank is: the"
        " constant of a prism or a wrong scale would not show; say what the nominal diameter is on"
        " the drawing, or strap a course",
        instruments=list_some(instruments, SHOWN),
    )
    yield Problem("job.toml", text, column="checks.diameter_is")
