"""welds.csv: its columns; courses that are there, and each of their welds once."""

from itertools import combinations

from tankcal.job.contract.shorthand import number
from tankcal.job.fields import Field
from tankcal.messages import message

COLUMNS = (
    Field("course", "name", "course of courses.csv with the weld", required=True),
    number(
        "azimuth_deg",
        "azimuth of the vertical weld about the axis, clockwise from +y of the points, degrees",
        0,
        360,
        required=True,
    ),
)

APART_DEG = 0.1  # two welds that are nearer are one, given twice


def check_welds(table, courses, log):
    """Courses of courses.csv; no weld of a course twice.

    courses  courses.csv, or None: not there or unreadable
    """
    known = None if courses is None or courses.skipped else set(courses.of("course"))
    places = {}
    for row, course, azimuth in zip(
        table.rows, table.of("course"), table.of("azimuth_deg"), strict=True
    ):
        if None not in (course, known) and course not in known:
            expected = message(
                "weld_of_no_course",
                "found {course!r}; expected a course of {of}",
                course=course,
                of=courses.file,
            )
            log.problem(table.file, expected, row, "course")
        elif None not in (course, azimuth):
            places.setdefault(course, []).append((azimuth, row))
    for welds in places.values():
        for (one, first_row), (other, row) in combinations(welds, 2):
            if abs((one - other + 180) % 360 - 180) < APART_DEG:
                expected = message(
                    "weld_twice",
                    "a weld of this course at {azimuth_deg:g} degrees is already in row "
                    "{first_row}; expected once",
                    azimuth_deg=one,
                    first_row=first_row,
                )
                log.problem(table.file, expected, row, "azimuth_deg")
