"""What was decided by hand about points of the wall and about readings, as the chain takes it."""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message


def decisions_of(job):
    """(n,) of the points of a job: 1 kept, -1 left out, 0 not decided.

    Raises InputError for a name that none of them has.
    """
    decided, problems = np.zeros(len(job.points.names), dtype=int), []
    place = {name: i for i, name in enumerate(job.points.names)}
    for one in _of_points(job):
        if one.point in place:
            decided[place[one.point]] = 1 if one.is_kept else -1
            continue
        text = message(
            "overruled_not_of_wall",
            "found {point!r}; expected a point of the wall: this one was not adjusted, or is only"
            " compared",
            point=one.point,
        )
        problems.append(Problem(one.file, text, one.row, "point"))
    if problems:
        raise InputError(problems)
    return decided


def refuse_kept(job, off_m, most_m, reason=None):
    """Raise InputError where a point was kept that no wall can have.

    off_m   (n,) of the points from the wall
    most_m  that a wall departs
    reason  (n,) code of `geometry.shell.Shell`; None: none is refused for its place alone
    """
    decided = decisions_of(job)
    reason = np.full(len(off_m), "", dtype=object) if reason is None else reason
    at_fault = {}
    for i in np.flatnonzero((decided > 0) & ((np.abs(off_m) > most_m) | (reason != ""))):
        at_fault[job.points.names[i]] = _why_not(reason[i], float(off_m[i]), most_m)
    if at_fault:
        raise InputError(
            Problem(one.file, at_fault[one.point], one.row, "point")
            for one in _of_points(job)
            if one.point in at_fault
        )


def _why_not(reason, off_m, most_m):
    """What is said of a kept point that no wall can have."""
    if reason == "above_shell":
        return message(
            "kept_above_shell",
            "found keep, but it stands above the top of the shell; expected a point between bottom"
            " and top: look at the heights of the courses",
        )
    if reason == "below_shell":
        return message(
            "kept_below_shell",
            "found keep, but it stands below the bottom of the shell; expected a point between"
            " bottom and top: look at datum.bottom_z_m",
        )
    if reason == "same_place":
        return message(
            "kept_same_place",
            "found keep, but another point stands at the same place; expected a point of its own:"
            " it would count twice",
        )
    return message(
        "kept_far_off",
        "found keep, but it stands {off_m:.3f} m off the wall; expected at most {most_m:.3f} m: no"
        " wall departs so far",
        off_m=off_m,
        most_m=most_m,
    )


def _of_points(job):
    return [one for one in job.overrulings if one.table is None]


def with_decided_readings(measurements, overrulings):
    """Measurements in which readings that are left out are only compared, and kept ones marked.

    Parameters
    ----------
    measurements : Measurements
    overrulings : tuple of Overruling
    """
    rows = {True: {}, False: {}}
    for one in overrulings:
        if one.table is not None:
            rows[one.is_kept].setdefault(one.table, set()).add(one.reading_row)
    if not (rows[True] or rows[False]):
        return measurements

    def compared(of, name):
        if of is None or not of.rows or name not in rows[False]:
            return of
        return replace(of, check=np.asarray(of.check) | np.isin(of.rows, [*rows[False][name]]))

    tables = [(one, one.table) for one in measurements.readings]
    tables.append((measurements.image_points, "image_points"))
    kept = {
        (one.file, row)
        for one, name in tables
        if one is not None and _is_own(one, name)
        for row in rows[True].get(name, ())
    }
    *readings, images = (compared(one, name) if _is_own(one, name) else one for one, name in tables)
    return replace(
        measurements, readings=tuple(readings), image_points=images, kept=frozenset(kept)
    )


def refuse_kept_readings(job, adjustment):
    """Raise InputError for kept readings that are none of their own in the adjustment, or whose
    point the search left without the others.
    """
    found = set(zip(*(adjustment.readings.columns[one] for one in ("file", "row")), strict=True))
    files = {one.table: one.file for one in job.measurements.readings if _is_own(one, one.table)}
    if job.measurements.image_points is not None:
        files["image_points"] = job.measurements.image_points.file
    problems = []
    for one in job.overrulings:
        place = files.get(one.table), one.reading_row
        if one.table is None or not one.is_kept or place in found:
            continue
        text = _not_adjusted(one, is_tried=place in _tried(adjustment.adjusted.survey))
        problems.append(Problem(one.file, text, one.row, "row"))
    if problems:
        raise InputError(problems)


def _tried(survey):
    """{(file, row)} of all readings that an adjustment began with."""
    traces = [one.trace for one in survey.tables.values() if one.trace is not None]
    return {(trace.file, row) for trace in traces for row in trace.rows}


def _not_adjusted(one, *, is_tried):
    """What is said of a kept reading that was not adjusted."""
    if is_tried:
        return message(
            "kept_point_lost",
            "found keep for row {row} of {table}, but the search set so many others of its point"
            " aside that it is no longer adjusted; expected to keep those, too, or not this one",
            row=one.reading_row,
            table=one.table,
        )
    return message(
        "kept_no_reading",
        "found row {row} of {table}; it was not adjusted by itself: expected the first of the"
        " readings that were averaged with it, of points that are adjusted",
        row=one.reading_row,
        table=one.table,
    )


def _is_own(of, name):
    """Do rows of the table of that name stand in it, and not those of a bar's readings?"""
    return of is None or name in of.file
