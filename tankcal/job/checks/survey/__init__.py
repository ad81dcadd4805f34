"""Checks of the files of a survey before its adjustment.

The adjustment detects further faults: a swapped or undetermined point, a missing or redundant
datum.
"""

from tankcal.job.checking import has_rows, tell
from tankcal.job.checks.extent import has_survey, is_sighted
from tankcal.job.contract import KEYS
from tankcal.job.tables import SURVEY_TABLES
from tankcal.messages import message

__all__ = ["check_survey"]


def check_survey(values, tables, registers, raw, is_whole, log):
    """Run all checks of the files of the survey that the readable parts allow.

    Parameters
    ----------
    values, tables, registers, raw, log
        As for `checks.check_all`.
    is_whole : bool
        False: the job is only adjusted, so that a survey is required.
    """
    if not has_survey(tables):
        if not (is_whole and is_sighted(tables)):
            _tell_nothing_to_adjust(values, tables, raw, is_whole, log)
        return
    if is_whole and has_rows(tables["points"]):
        expected = message(
            "points_and_survey",
            "given together with a survey; expected only one of them: the points of a survey "
            "come from its adjustment",
        )
        log.problem(tables["points"].file, expected)
    reported = frozenset((problem.file, problem.row) for problem in log.problems)
    from tankcal.job.checks.survey.whole import check_files

    check_files(values, tables, registers, raw, log, reported)


def _tell_nothing_to_adjust(values, tables, raw, is_whole, log):
    is_unreadable = any(name in raw.tables and raw.tables[name] is None for name in SURVEY_TABLES)
    if is_unreadable:
        return
    if not is_whole:
        expected = message(
            "no_survey",
            "there is nothing to adjust; expected image points, distances or other observations",
        )
        log.problem(raw.settings_file, expected)
        return
    expected = message(
        "nothing_to_adjust", "without effect: the job has no observations that could be adjusted"
    )
    for name in SURVEY_TABLES:
        if tables[name] is not None:
            log.warning(tables[name].file, expected)
    for section in ("adjustment", "adjustment.camera"):
        for field in KEYS[section]:
            if field.of_survey and values is not None and values[section][field.name] is not None:
                tell(log.warning, raw, section, field.name, expected)
