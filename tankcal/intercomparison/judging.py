"""Check and score folders of answers against a truth file."""

from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.intercomparison.answers import PARTICIPANT, read_answers
from tankcal.intercomparison.package import load_package, load_truth
from tankcal.intercomparison.scoring import score
from tankcal.job.tables import Log
from tankcal.record.intercomparison import ANSWERS, PACKAGE


def score_folders(folders, truth, package=None):
    """Score folders of answers.

    Parameters
    ----------
    folders : sequence of path
        Folders of answers, one for each participant.
    truth : path
        The file truth.json, or its folder.
    package : path, optional
        The package; its manifest must also state the SHA-256 of this truth.

    Returns
    -------
    ScoresFile

    Raises
    ------
    InputError
        If the folders, the truth or the package have problems, or if answers or manifest refer to
        another truth. The error lists all problems.
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
    truth_data, truth_sha256 = opened
    asked = {
        item["tank"]: (item["heights_m"], set(truth_data["methods"]))
        for item in truth_data["tanks"]
    }
    problems, participants = list(log.problems), []
    for folder in folders:
        folder_log = Log()
        answers = read_answers(folder, asked, folder_log)
        if answers is not None and answers.saved.participant.package != truth_sha256:
            folder_log.problem(
                _source(folder), _other_package(answers.saved.participant.package, truth_sha256)
            )
        problems += [_placed(folder, item, folders) for item in folder_log.problems]
        if answers is not None:
            warnings = [_placed(folder, item, folders) for item in answers.warnings]
            participants.append(_with_warnings(answers, warnings))
    if problems:
        raise InputError(problems)
    return score(participants, truth_data, truth_sha256, coverage)


def _other_package(promised, own):
    """Message that answers refer to another package."""
    from tankcal.messages import message

    return message(
        "ic_other_package",
        "the answers are to the package with truth_sha256 {promised}, the truth has {own}: it was "
        "changed, or belongs to another package",
        promised=promised,
        own=own,
    )


def _source(folder):
    """Name of the file of a folder that identifies the participant."""
    return ANSWERS.file if (Path(folder) / ANSWERS.file).is_file() else PARTICIPANT


def _placed(folder, problem, folders):
    """Problem with the folder before its file name if several folders are scored."""
    from dataclasses import replace

    if len(folders) < 2:
        return problem
    return replace(problem, file=f"{Path(folder).resolve().name}/{problem.file}")


def _with_warnings(answers, warnings: list[Problem]):
    """Answers with other warnings."""
    from dataclasses import replace

    return replace(answers, warnings=tuple(warnings))
