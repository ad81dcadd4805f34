"""control.csv, check.csv and targets.csv: each point once, sds of what is given."""

import numpy as np

from tankcal.job.checks.common import has_rows, refuse_repeated
from tankcal.job.checks.survey.files import tell_rows
from tankcal.job.checks.survey.names import observed_names

MOST_NAMED = 5


def check_known(files):
    """Points known beforehand, and where targets sit."""
    seen = observed_names(files)
    for name in ("control", "check"):
        table = files.tables[name]
        if has_rows(table):
            _refuse_point_twice(files, table)
            _check_coordinates(files, table)
            what = "are observed nowhere; they bear on nothing"
            _warn_unobserved(files, table, seen, what)
    targets = files.tables["targets"]
    if has_rows(targets):
        refuse_repeated(targets, "point", files.log)
        _warn_unobserved(files, targets, seen, "are observed nowhere; they are left out")
    _warn_control_that_checks(files)


def _refuse_point_twice(files, table):
    first = {}
    for row, point, system in zip(table.rows, table.of("point"), table.of("system"), strict=True):
        before = first.setdefault((point, system), row)
        if point is not None and before != row:
            within = "" if system is None else f" in system {system!r}"
            expected = f"{point!r} is there already{within}, in row {before}; expected once"
            files.log.problem(table.file, expected, row, "point")


def _check_coordinates(files, table):
    sound, known = files.sound(table), np.zeros(len(table.rows), dtype=bool)
    for axis in "xyz":
        value, sd = (~np.isnan(table.numbers(name)) for name in (f"{axis}_m", f"s{axis}_mm"))
        known |= value
        expected = f"given without {axis}_m; expected both, or no standard deviation"
        tell_rows(files.log.problem, table, sound & sd & ~value, f"s{axis}_mm", expected)
    expected = "no coordinate; expected one at least"
    tell_rows(files.log.problem, table, sound & ~known, "x_m", expected)


def _warn_unobserved(files, table, seen, what):
    if any(files.is_unreadable(name) for name in ("image_points", "setups", "directions")):
        return
    lacking = [
        (row, point)
        for row, point in zip(table.rows, table.of("point"), strict=True)
        if point is not None and point not in seen
    ]
    if lacking:
        named = ", ".join(repr(point) for _, point in lacking[:MOST_NAMED])
        more = " ..." if len(lacking) > MOST_NAMED else ""
        plural = "points" if len(lacking) > 1 else "point"
        what = what if len(lacking) > 1 else what.replace("are", "is").replace("they is", "it is")
        what = what.replace("they bear", "it bears") if len(lacking) == 1 else what
        expected = f"{len(lacking)} {plural} ({named}{more}) {what}"
        files.log.warning(table.file, expected, lacking[0][0], "point")


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
            expected = f"{point!r} is a control point, too; it is no independent check"
            files.log.warning(check.file, expected, row, "point")
