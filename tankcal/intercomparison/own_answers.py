"""Answers of tankcal to all surveys of a package, in the format for all participants."""

import datetime
import math
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError
from tankcal.messages import message
from tankcal.record.intercomparison import Answer, AnswersFile, Participant
from tankcal.version import find_version


def answer_package(folder, manifest, progress=None, run=None):
    """Compute every survey of a package.

    Parameters
    ----------
    folder : path
        Folder of the package.
    manifest : dict
        Checked manifest of the package.
    progress : callable, optional
        Function progress(text, done, total).
    run : callable, optional
        Function run(folder of a job) that returns an object with a method `at(height)`; by default
        tankcal.

    Returns
    -------
    AnswersFile
        Answers to all surveys with a valid solution.
    tuple of Problem
        Problems of the other surveys.
    """
    progress = progress or (lambda *_: None)
    run = run or _run
    heights = {item["tank"]: item["heights_m"] for item in manifest["tanks"]}
    answers, problems = [], []
    step = message("ic_answering", "computing the surveys")
    for number, job in enumerate(manifest["jobs"]):
        progress(step, number, len(manifest["jobs"]))
        asked = heights[job["tank"]]
        try:
            table = run(Path(folder) / job["folder"])
            volumes = [table.at(height) for height in asked]
        except InputError as error:
            problems += [_problem_of_job(job, item) for item in error.problems]
            continue
        except TankcalError as error:
            problems += [Problem(job["folder"], text) for text in error.texts]
            continue
        U = [item.U_m3 if item.U_m3 > 0 else math.nan for item in volumes]
        k = [math.nan if item.k is None else item.k for item in volumes]
        values = [item.value_m3 for item in volumes]
        answers.append(Answer(job["tank"], job["method"], list(asked), values, U, k))
    progress(step, len(manifest["jobs"]), len(manifest["jobs"]))
    participant = Participant(
        name="tankcal",
        software="tankcal",
        version=find_version(),
        date=datetime.date.today().isoformat(),
        contact=None,
        remarks=None,
        package=manifest["truth_sha256"],
    )
    return AnswersFile(participant, answers), tuple(problems)


def _run(folder):
    """Capacity table of a job by tankcal."""
    import tankcal

    return tankcal.run(tankcal.load(folder))


def _problem_of_job(job, problem):
    """Problem with the folder of its job before the file name."""
    from dataclasses import replace

    return replace(problem, file=f"{job['folder']}/{problem.file}")
