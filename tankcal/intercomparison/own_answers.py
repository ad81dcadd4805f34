"""Our own answers: tankcal on every survey of a package, in the format of any participant."""

import datetime
import math
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError
from tankcal.messages import message
from tankcal.record.intercomparison import Answer, AnswersFile, Participant, version


def answer_package(folder, manifest, progress=None, run=None):
    """Compute every survey of a package.

    Parameters
    ----------
    folder : path
        Of the package.
    manifest : dict
        Its manifest, checked.
    progress : callable, optional
        progress(text, done, total).
    run : callable, optional
        run(folder of a job) gives what has `at(height)`; None: tankcal.

    Returns
    -------
    tuple of (AnswersFile, tuple of Problem)
        A survey that has no sound solution, or that is refused, is told and left out.
    """
    progress = progress or (lambda *_: None)
    run = run or _run
    heights = {one["tank"]: one["heights_m"] for one in manifest["tanks"]}
    answers, told = [], []
    step = message("ic_answering", "computing the surveys")
    for place, job in enumerate(manifest["jobs"]):
        progress(step, place, len(manifest["jobs"]))
        asked = heights[job["tank"]]
        try:
            table = run(Path(folder) / job["folder"])
            volumes = [table.at(height) for height in asked]
        except InputError as error:
            told += [_of_job(job, one) for one in error.problems]
            continue
        except TankcalError as error:
            told += [Problem(job["folder"], text) for text in error.texts]
            continue
        U = [one.U_m3 if one.U_m3 > 0 else math.nan for one in volumes]
        k = [math.nan if one.k is None else one.k for one in volumes]
        values = [one.value_m3 for one in volumes]
        answers.append(Answer(job["tank"], job["method"], list(asked), values, U, k))
    progress(step, len(manifest["jobs"]), len(manifest["jobs"]))
    who = Participant(
        name="tankcal",
        software="tankcal",
        version=version(),
        date=datetime.date.today().isoformat(),
        contact=None,
        remarks=None,
        package=manifest["truth_sha256"],
    )
    return AnswersFile(who, answers), tuple(told)


def _run(folder):
    import tankcal

    return tankcal.run(tankcal.load(folder))


def _of_job(job, problem):
    from dataclasses import replace

    return replace(problem, file=f"{job['folder']}/{problem.file}")
