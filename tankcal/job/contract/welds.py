"""Columns of welds.csv, and checks of its courses and azimuths."""

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

APART_DEG = 0.1  # welds closer than this are considered as repeated


def check_welds(table, courses, log):
    """Check that each weld is in a course of courses.csv and is given once.

    Parameters
    ----------
    table : ColumnValues
        Rows of welds.csv.
    courses : ColumnValues or None
        Rows of courses.csv; None if missing or unreadable.
    log
        Log of the problems.
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
        for (first, first_row), (second, row) in combinations(welds, 2):
            if abs((first - second + 180) % 360 - 180) < APART_DEG:
                expected = message(
                    "weld_twice",
                    "a weld of this course at {azimuth_deg:g} degrees is already in row "
                    "{first_row}; expected once",
                    azimuth_deg=first,
                    first_row=first_row,
                )
                log.problem(table.file, expected, row, "azimuth_deg")
