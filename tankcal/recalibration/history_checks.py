"""Checks of the tables of one tank: dates, tank names, dimensions, zeros."""

from itertools import pairwise

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message

SAME_M = 1e-3  # largest difference of equal dimensions and reference heights


def warnings_of_tables(ordered):
    """Compare each table (DatedTable, oldest first) with the one before it; return Problems.

    Examples
    --------
    >>> from datetime import date
    >>> from tankcal.recalibration.former import FormerTable
    >>> from tankcal.recalibration.history import DatedTable
    >>> tables = [
    ...     DatedTable(FormerTable("a.csv", [0, 1], [0, 1], reference_height_m=x), "", date.min)
    ...     for x in (9.1, 9.2)
    ... ]
    >>> [problem.expected.code for problem in warnings_of_tables(tables)]
    ['history_same_day', 'history_reference_height']
    """
    problems = []
    for before, after in pairwise(ordered):
        problems += _of_pair(before, after)
    return problems


def _of_pair(before, after):
    name, other = after.table.name, before.table.name
    if before.day == after.day:
        text = message(
            "history_same_day",
            "of {date}, as {other}: which of them came first is not known; is one of them to be "
            "left out?",
            date=after.day.isoformat(),
            other=other,
        )
        yield Problem(name, text)
    if None not in (before.tank, after.tank) and before.tank != after.tank:
        text = message(
            "history_other_id",
            "of tank {tank}, {other} of tank {other_tank}: taken as one tank, as asked",
            tank=after.tank,
            other=other,
            other_tank=before.tank,
        )
        yield Problem(name, text)
    yield from _sizes(name, other, _tank(before), _tank(after))
    heights = before.table.reference_height_m, after.table.reference_height_m
    if None not in heights and abs(heights[1] - heights[0]) > SAME_M:
        text = message(
            "history_reference_height",
            "reference height {new:.4f} m, {old:.4f} m in {other}: the volumes are brought to one "
            "zero by these; has the dip plate or the reference point been moved?",
            new=heights[1],
            old=heights[0],
            other=other,
        )
        yield Problem(name, text)
    zeros = _zero(before), _zero(after)
    if None not in zeros and zeros[0] != zeros[1]:
        text = message(
            "history_other_zero",
            "dips count from {new}, from {old} in {other}",
            new=zeros[1],
            old=zeros[0],
            other=other,
        )
        yield Problem(name, text)


def _tank(table):
    return {} if table.table.record is None else table.table.record["job"]


def _zero(table):
    return None if table.table.record is None else table.table.record["capacity"].get("zero")


def _sizes(name, former_name, was, now):
    """Report changed nominal dimensions or courses."""
    for key in ("nominal_diameter_m", "nominal_height_m"):
        sizes = [(job.get("tank") or {}).get(key) for job in (was, now)]
        if None not in sizes and abs(sizes[1] - sizes[0]) > SAME_M:
            text = message(
                "history_other_size",
                "{key} {new:g}, {old:g} in {other}; expected the sizes of one tank",
                key=key,
                new=sizes[1],
                old=sizes[0],
                other=former_name,
            )
            yield Problem(name, text)
    heights = [[course["height_m"] for course in job.get("courses") or ()] for job in (was, now)]
    if not all(heights):
        return
    same = len(heights[0]) == len(heights[1])
    if not same or np.abs(np.subtract(*heights)).max() > SAME_M:
        text = message(
            "history_other_courses",
            "courses of other heights than {other}: radii are compared by those of the newer one",
            other=former_name,
        )
        yield Problem(name, text)
