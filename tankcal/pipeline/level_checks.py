"""Whether bare hits or tangents are enough, level by level and course by course."""

import numpy as np

from tankcal.messages import list_some

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
