"""control.csv, check.csv and targets.csv: each point once, sds of what is given."""

import numpy as np

from tankcal.job.checks.common import has_rows, refuse_repeated
from tankcal.job.checks.survey.files import tell_rows
from tankcal.job.checks.survey.names import observed_names
from tankcal.messages import listed, message

MOST_NAMED = 5


def check_known(files):
    """Points known beforehand, and where targets sit."""
    seen = observed_names(files)
    for name in ("control", "check"):
        table = files.tables[name]
        if has_rows(table):
            _refuse_point_twice(files, table)
            _check_coordinates(files, table)
            _warn_unobserved(files, table, seen, _bear_on_nothing)
    targets = files.tables["targets"]
    if has_rows(targets):
        refuse_repeated(targets, "point", files.log)
        _warn_unobserved(files, targets, seen, _left_out)
    _warn_control_that_checks(files)


def _refuse_point_twice(files, table):
    first = {}
    for row, point, system in zip(table.rows, table.of("point"), table.of("system"), strict=True):
        before = first.setdefault((point, system), row)
        if point is not None and before != row:
            within = (
                ""
                if system is None
                else message("within_system", " in system {system!r}", system=system)
            )
            expected = message(
                "known_twice",
                "{point!r} is there already{within}, in row {row}; expected once",
                point=point,
                within=within,
                row=before,
            )
            files.log.problem(table.file, expected, row, "point")


def _check_coordinates(files, table):
    sound, known = files.sound(table), np.zeros(len(table.rows), dtype=bool)
    for axis in "xyz":
        value, sd = (~np.isnan(table.numbers(name)) for name in (f"{axis}_m", f"s{axis}_mm"))
        known |= value
        expected = message(
            "known_sd_without_value",
            "given without {axis}_m; expected both, or no standard deviation",
            axis=axis,
        )
        tell_rows(files.log.problem, table, sound & sd & ~value, f"s{axis}_mm", expected)
    expected = message("no_coordinate", "no coordinate; expected one at least")
    tell_rows(files.log.problem, table, sound & ~known, "x_m", expected)


def _bear_on_nothing(names):
    return message(
        "known_unobserved", "observed nowhere, so that they bear on nothing: {points}", points=names
    )


def _left_out(names):
    return message("targets_unobserved", "observed nowhere and left out: {points}", points=names)


def _warn_unobserved(files, table, seen, told):
    """told: told(names) -> the Message of points that nothing observes"""
    if any(files.is_unreadable(name) for name in ("image_points", "setups", "directions")):
        return
    lacking = [
        (row, point)
        for row, point in zip(table.rows, table.of("point"), strict=True)
        if point is not None and point not in seen
    ]
    if lacking:
        names = listed([point for _, point in lacking], MOST_NAMED)
        files.log.warning(table.file, told(names), lacking[0][0], "point")


def _warn_control_that_checks(files):
    """A control point that is a check point, too, is compared with itself."""
    control, check = files.tables["control"], files.tables["check"]
    if not has_rows(control) or not has_rows(check):
        return
    used = {
        (point, system)
        for point, system, use in zip(
            control.of("point"), control.of("system"), control.of("use"), strict=True
        )
        if use != "check"
    }
    for row, point, system in zip(check.rows, check.of("point"), check.of("system"), strict=True):
        if (point, system) in used:
            expected = message(
                "check_is_control",
                "{point!r} is a control point, too; it is no independent check",
                point=point,
            )
            files.log.warning(check.file, expected, row, "point")
