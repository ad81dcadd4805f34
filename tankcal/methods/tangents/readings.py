"""Tangents of an adjusted traverse: checks of their tables as a whole, and `Tangents` in SI."""

import numpy as np

from tankcal.job.checking import has_rows, tell
from tankcal.job.checks.extent import has_survey
from tankcal.job.checks.survey.readings import (
    SurveyFiles,
    check_angle,
    refuse_undefined,
    warn_copies,
)
from tankcal.job.checks.tapes import check_levels, refuse_others
from tankcal.job.measuring import setups_of
from tankcal.job.structure import angle_in_rad
from tankcal.messages import message
from tankcal.survey.tangents import (
    FEWEST_SETUPS,
    MOST_LEVELS,
    MOST_TANGENTS,
    Tangents,
    too_many_levels,
    too_many_tangents,
)
from tankcal.units import ARCSEC


def check_tangents(values, tables, registers, raw, log):
    """Check sights to both limbs from a network of set-ups outside; as for `Method.check`."""
    table = tables["tangents"]
    if len(table.rows) > MOST_TANGENTS:
        log.problem(table.file, too_many_tangents(len(table.rows)))
        return
    levels = len(set(zip(table.of("course"), table.of("level_m"), strict=True)))
    if levels > MOST_LEVELS:
        log.problem(table.file, too_many_levels(levels))
    for name in ("points", "targets", "wall_hits"):
        if has_rows(tables[name]):
            expected = message(
                "beside_tangents",
                "given together with tangents; expected only one of them: tankcal does not join"
                " them yet",
            )
            log.problem(tables[name].file, expected)
    if not has_survey(tables):
        expected = message(
            "tangents_without_network",
            "the set-ups of the tangents are tied by nothing; expected a traverse: directions and"
            " distances between their stations (directions.csv, slope_distances.csv)",
        )
        log.problem(table.file, expected)
    reported = frozenset((problem.file, problem.row) for problem in log.problems)
    files = SurveyFiles(values, tables, registers, raw, log, reported)
    setups = tables["setups"]
    defined = () if setups is None else dict.fromkeys(setups.of("setup"))
    refuse_undefined(files, table, "setup", defined, "setups")
    check_angle(files, table, "direction")
    check_angle(files, table, "zenith", is_needed=False)
    warn_copies(files, table, are_sights=True)
    courses = tables["courses"]
    if courses is not None:
        refuse_others(table, "course", tuple(courses.of("course")), log)
    if values is None:
        return
    if values["survey"]["side"] == "inside":
        expected = message(
            "tangents_inside",
            "found inside; expected outside: tangents are sighted from outside the tank",
        )
        tell(log.problem, raw, "survey", "side", expected)
    check_levels(table, courses, values, log)
    if not table.skipped:
        _check_limbs(table, () if courses is None else courses.of("course"), log)


def _check_limbs(table, courses, log):
    """Require enough set-ups for each level of a known course."""
    columns = (table.of(name) for name in ("course", "level_m", "setup", "side", "use"))
    levels, first = {}, {}
    for row, (course, level, setup, side, use) in zip(
        table.rows, zip(*columns, strict=True), strict=True
    ):
        if None in (level, setup, side) or course not in courses or use == "check":
            continue
        levels.setdefault((course, level), {}).setdefault(setup, set()).add(side)
        first.setdefault((course, level), row)
    if not levels and not np.any([use is None for use in table.of("use")]):
        expected = message(
            "only_compared_tangents",
            "all tangents are only compared; expected some that the wall is taken from",
        )
        log.problem(table.file, expected)
    for key, setups in levels.items():
        if len(setups) < FEWEST_SETUPS:
            expected = message(
                "level_of_few_setups",
                "{level:g} m of course {course!r} is sighted from {count} set-ups; expected"
                " {fewest} at least",
                level=key[1],
                course=key[0],
                count=len(setups),
                fewest=FEWEST_SETUPS,
            )
            log.problem(table.file, expected, first[key], "level_m")


def make_tangents(tables, registers):
    """Build `Tangents` from tables and registers without problems."""
    table = tables["tangents"]
    return Tangents(
        setup=tuple(table.of("setup")),
        set=tuple(table.of("set")),
        course=tuple(table.of("course")),
        level_m=table.numbers("level_m"),
        is_right=np.array([side == "right" for side in table.of("side")], dtype=bool),
        direction_rad=angle_in_rad(table, "direction"),
        zenith_rad=angle_in_rad(table, "zenith"),
        sd_rad=table.numbers("s_arcsec") * ARCSEC,
        check=np.array([use == "check" for use in table.of("use")], dtype=bool),
        setups={setup.name: setup for setup in setups_of(tables["setups"])},
        certificates={
            name: given["certificate"] or "" for name, given in registers["instruments"].items()
        },
        rows=table.rows,
        file=table.file,
    )
