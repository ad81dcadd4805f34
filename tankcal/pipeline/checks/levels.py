"""Checks of the number of bare hits or tangents per level and course, and of the wall's size."""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import list_some, message
from tankcal.pipeline.checks.cross_checks import is_size_declared
from tankcal.pipeline.checks.nominal_size import allowed_departure_m, inside_radii, nominal_radius_m

SHOWN = 5  # largest number of names in a message


def levels_with_few(wall, least):
    """Return the names of the first sections with fewer than `least` points, or None."""
    names = [section.group.name for section in wall.sections if len(section.group.members) < least]
    return list_some(names, SHOWN) if names else None


def courses_with_few(job, wall, least, *, slopes_count=False):
    """Return the names of the first courses with fewer than `least` levels, or None.

    A course without any level is not listed: straps or lines determine it.

    Parameters
    ----------
    job : Job
    wall : Wall
    least : int
        Smallest number of levels.
    slopes_count : bool, optional
        Whether a section with a slope counts as evidence of a taper.

    Returns
    -------
    Message or None
    """
    groups = [section.group for section in wall.sections]
    courses = [group.course for group in groups]
    sloped = {group.course for group in groups if slopes_count and group.degree}
    names = [
        course.name
        for index, course in enumerate(job.courses)
        if 0 < courses.count(index) < least and index not in sloped
    ]
    return list_some(names, SHOWN) if names else None


def girth_m(job):
    """Return the nominal circumference, m, on which the number of hits or tangents depends."""
    return np.pi * job.tank.nominal_diameter_m


def check_nominal(job, wall, file):
    """Yield a warning of a shell whose radius differs from the drawing.

    An offset or a scale without other control changes the radius, and only this check can detect
    it.

    Parameters
    ----------
    job : Job
    wall : Wall
    file : str
        File of the hits or tangents.

    Yields
    ------
    Problem
    """
    radii = inside_radii(job, wall)
    deviation_m = float(np.median(radii.radius_m)) - nominal_radius_m(job, float(radii.plate_m[0]))
    if abs(deviation_m) > allowed_departure_m(job):
        text = message(
            "wall_unlike_nominal",
            "the courses come out {miss_mm:+.0f} mm of radius from the nominal one: is the offset"
            " or the scale of the instrument wrong, or the length of the bar?",
            miss_mm=1000 * deviation_m,
        )
        yield Problem(file, text)


def check_size_told(job, instruments):
    """Yield a warning of a wall whose size only the distances of instruments determine.

    A wrong constant or scale in all of them changes every radius without any contradiction in the
    readings. An error up to 1 in 500 of the nominal radius, many times U, remains undetected.

    Parameters
    ----------
    job : Job
    instruments : sequence of str
        Names of the instruments.

    Yields
    ------
    Problem
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
