"""Manual decisions against the outlier search: their effect on points and on the result."""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message

# ---- manual decisions about points of the wall and about readings, applied to the data of a job


def decisions_of(job):
    """Decision about each point of a job, shape (n,): 1 kept, -1 left out, 0 undecided.

    Raises InputError for a decision about an unknown point.
    """
    decided, problems = np.zeros(len(job.points.names), dtype=int), []
    place = {name: i for i, name in enumerate(job.points.names)}
    for decision in _point_decisions(job):
        if decision.point in place:
            decided[place[decision.point]] = 1 if decision.is_kept else -1
            continue
        text = message(
            "overruled_not_of_wall",
            "found {point!r}; expected a point of the wall: this one was not adjusted, or is only"
            " compared",
            point=decision.point,
        )
        problems.append(Problem(decision.file, text, decision.row, "point"))
    if problems:
        raise InputError(problems)
    return decided


def refuse_kept(job, off_m, most_m, reason=None):
    """Raise InputError for kept points that cannot belong to a wall.

    Parameters
    ----------
    job : Job
    off_m : ndarray, shape (n,)
        Distances of the points from the wall, m.
    most_m : float
        Largest possible distance of a wall point, m.
    reason : ndarray of str, shape (n,), optional
        Codes of `geometry.shell.Shell`; None: refuse points for their distance only.
    """
    decided = decisions_of(job)
    reason = np.full(len(off_m), "", dtype=object) if reason is None else reason
    reasons_by_name = {}
    for i in np.flatnonzero((decided > 0) & ((np.abs(off_m) > most_m) | (reason != ""))):
        reasons_by_name[job.points.names[i]] = _why_not(reason[i], float(off_m[i]), most_m)
    if reasons_by_name:
        raise InputError(
            Problem(decision.file, reasons_by_name[decision.point], decision.row, "point")
            for decision in _point_decisions(job)
            if decision.point in reasons_by_name
        )


def _why_not(code, off_m, most_m):
    """Message about a kept point that cannot belong to a wall."""
    if code == "above_shell":
        return message(
            "kept_above_shell",
            "found keep, but it stands above the top of the shell; expected a point between bottom"
            " and top: look at the heights of the courses",
        )
    if code == "below_shell":
        return message(
            "kept_below_shell",
            "found keep, but it stands below the bottom of the shell; expected a point between"
            " bottom and top: look at datum.bottom_z_m",
        )
    if code == "same_place":
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


def _point_decisions(job):
    """Decisions of a job about points, not readings."""
    return [decision for decision in job.overrulings if decision.table is None]


def with_decided_readings(measurements, overrulings):
    """Mark excluded readings as check readings and record kept readings.

    Parameters
    ----------
    measurements : Measurements
    overrulings : tuple of Overruling

    Returns
    -------
    Measurements
        With the check flags set, and the kept readings as pairs (file, row).
    """
    rows = {True: {}, False: {}}
    for decision in overrulings:
        if decision.table is not None:
            rows[decision.is_kept].setdefault(decision.table, set()).add(decision.reading_row)
    if not (rows[True] or rows[False]):
        return measurements

    def compared(readings, name):
        if readings is None or not readings.rows or name not in rows[False]:
            return readings
        return replace(
            readings,
            check=np.asarray(readings.check) | np.isin(readings.rows, [*rows[False][name]]),
        )

    tables = [(reading, reading.table) for reading in measurements.readings]
    tables.append((measurements.image_points, "image_points"))
    kept_keys = {
        (readings.file, row)
        for readings, name in tables
        if readings is not None and _is_from_table(readings, name)
        for row in rows[True].get(name, ())
    }
    *readings, images = (
        compared(readings, name) if _is_from_table(readings, name) else readings
        for readings, name in tables
    )
    return replace(
        measurements, readings=tuple(readings), image_points=images, kept=frozenset(kept_keys)
    )


def refuse_kept_readings(job, adjustment):
    """Raise InputError for kept readings that do not appear in the adjustment.

    Either the reading was averaged with others, or the search rejected so many readings of its
    point that the point is not adjusted.
    """
    adjusted = set(
        zip(*(adjustment.readings.columns[column] for column in ("file", "row")), strict=True)
    )
    files = {
        reading.table: reading.file
        for reading in job.measurements.readings
        if _is_from_table(reading, reading.table)
    }
    if job.measurements.image_points is not None:
        files["image_points"] = job.measurements.image_points.file
    problems = []
    for decision in job.overrulings:
        reading_key = files.get(decision.table), decision.reading_row
        if decision.table is None or not decision.is_kept or reading_key in adjusted:
            continue
        tables = adjustment.adjusted.survey.tables.values()
        traces = [table.trace for table in tables if table.trace is not None]
        tried = {(trace.file, row) for trace in traces for row in trace.rows}
        text = _not_adjusted(decision, is_tried=reading_key in tried)
        problems.append(Problem(decision.file, text, decision.row, "row"))
    if problems:
        raise InputError(problems)


def _not_adjusted(decision, *, is_tried):
    """Message about a kept reading that was not adjusted."""
    if is_tried:
        return message(
            "kept_point_lost",
            "found keep for row {row} of {table}, but the search set so many others of its point"
            " aside that it is no longer adjusted; expected to keep those, too, or not this one",
            row=decision.reading_row,
            table=decision.table,
        )
    return message(
        "kept_no_reading",
        "found row {row} of {table}; it was not adjusted by itself: expected the first of the"
        " readings that were averaged with it, of points that are adjusted",
        row=decision.reading_row,
        table=decision.table,
    )


def _is_from_table(readings, name):
    """Whether readings come from the file of that table, not from the readings of a bar."""
    return readings is None or name in readings.file
