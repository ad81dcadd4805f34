"""Folders of answers and a truth file, checked together and scored."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.intercomparison.answers import PARTICIPANT, read_answers
from tankcal.intercomparison.package import load_package, load_truth
from tankcal.intercomparison.scoring import score
from tankcal.job.tables import Log
from tankcal.record.intercomparison import ANSWERS, PACKAGE


def score_folders(folders, truth, package=None):
    """The `ScoresFile` of folders of answers.

    Parameters
    ----------
    folders : sequence of path
    truth : path
        Of truth.json, or its folder.
    package : path, optional
        Of the package, whose manifest must name this truth, too.

    Raises
    ------
    InputError
        With every problem of all folders, the truth and the package: also where answers or
        manifest name another truth.
    """
    log, committed = Log(), []
    coverage = 0.95
    if package is not None:
        manifest = load_package(package, log)
        if manifest is not None:
            committed.append((PACKAGE.file, manifest["truth_sha256"]))
            coverage = manifest["coverage_probability"]
    opened = load_truth(truth, committed, log)
    if opened is None:
        log.stop_if_problems()
    found, own = opened
    asked = {one["tank"]: (one["heights_m"], set(found["methods"])) for one in found["tanks"]}
    problems, participants = list(log.problems), []
    for folder in folders:
        mine = Log()
        answers = read_answers(folder, asked, mine)
        if answers is not None and answers.saved.participant.package != own:
            mine.problem(_source(folder), _other_package(answers.saved.participant.package, own))
        problems += [_placed(folder, one, folders) for one in mine.problems]
        if answers is not None:
            told = [_placed(folder, one, folders) for one in answers.warnings]
            participants.append(_with_warnings(answers, told))
    if problems:
        raise InputError(problems)
    return score(participants, found, own, coverage)


def _other_package(promised, own):
    from tankcal.messages import message

    return message(
        "ic_other_package",
        "the answers are to the package with truth_sha256 {promised}, the truth has {own}: it was "
        "changed, or belongs to another package",
        promised=promised,
        own=own,
    )


def _source(folder):
    """The file of a folder that says whose answers they are."""
    return ANSWERS.file if (Path(folder) / ANSWERS.file).is_file() else PARTICIPANT


def _placed(folder, problem, folders):
    """A problem with the folder before its file, where there are several."""
    from dataclasses import replace

    if len(folders) < 2:
        return problem
    return replace(problem, file=f"{Path(folder).resolve().name}/{problem.file}")


def _with_warnings(answers, told: list[Problem]):
    from dataclasses import replace

    return replace(answers, warnings=tuple(told))
