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
    found = []
    for before, one in pairwise(ordered):
        found += _of_pair(before, one)
    return found


def _of_pair(before, one):
    name, other = one.table.name, before.table.name
    if before.day == one.day:
        text = message(
            "history_same_day",
            "of {date}, as {other}: which of them came first is not known; is one of them to be "
            "left out?",
            date=one.day.isoformat(),
            other=other,
        )
        yield Problem(name, text)
    if None not in (before.tank, one.tank) and before.tank != one.tank:
        text = message(
            "history_other_id",
            "of tank {tank}, {other} of tank {other_tank}: taken as one tank, as asked",
            tank=one.tank,
            other=other,
            other_tank=before.tank,
        )
        yield Problem(name, text)
    yield from _sizes(name, other, _tank(before), _tank(one))
    heights = before.table.reference_height_m, one.table.reference_height_m
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
    zeros = _zero(before), _zero(one)
    if None not in zeros and zeros[0] != zeros[1]:
        text = message(
            "history_other_zero",
            "dips count from {new}, from {old} in {other}",
            new=zeros[1],
            old=zeros[0],
            other=other,
        )
        yield Problem(name, text)


def _tank(one):
    return {} if one.table.record is None else one.table.record["job"]


def _zero(one):
    return None if one.table.record is None else one.table.record["capacity"].get("zero")


def _sizes(name, other, was, now):
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
                other=other,
            )
            yield Problem(name, text)
    heights = [[one["height_m"] for one in job.get("courses") or ()] for job in (was, now)]
    if not all(heights):
        return
    same = len(heights[0]) == len(heights[1])
    if not same or np.abs(np.subtract(*heights)).max() > SAME_M:
        text = message(
            "history_other_courses",
            "courses of other heights than {other}: radii are compared by those of the newer one",
            other=other,
        )
        yield Problem(name, text)
