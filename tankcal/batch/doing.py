"""Steps of one job, run by a worker; each step writes all of its files or none."""

import errno
import os
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from tankcal.batch import reading
from tankcal.batch.asked import FOLDERS
from tankcal.batch.finding import RECORD, BatchJob
from tankcal.batch.fingerprints import keys_of
from tankcal.batch.formers import former_of, former_or_none
from tankcal.batch.journal import JOURNAL, Journal
from tankcal.batch.outcomes import (
    MOST_TOLD,
    Outcome,
    StepOutcome,
    folder_of,
    load_outcome,
    save_outcome,
)
from tankcal.errors import InputError, Problem, TankcalError, problem_of, reason_of
from tankcal.messages import message

IN_THE_WAY = (errno.EEXIST, errno.EISDIR, errno.ENOTDIR)  # errors of one job, not of the batch
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
STATUS_OF_EXIT = {2: "refused", 3: "unsound"}


@dataclass(frozen=True)
class Task:
    """A job submitted to a worker.

    Attributes
    ----------
    job : BatchJob
    keys : dict
        {step: SHA-256} of all its steps.
    out : str
        Absolute path of the folder of the batch.
    run : str
        Identifier of the batch run in the journal.
    """

    job: BatchJob
    keys: dict
    out: str
    run: str


def do_job(task):
    """Run the steps of a job that have no current result.

    Returns
    -------
    status : str
    problems : list of dict
        The first problem, or an empty list.
    count : int
        Number of problems.

    Raises
    ------
    InputError
        This machine does not find the folder of the batch, or cannot write to it. This stops the
        batch, because every other job would fail in the same way.
    """
    _check_folder(task)
    try:
        return _do_steps(task)
    except OSError as error:
        if error.errno in IN_THE_WAY:
            return _report_obstacle(task, error)
        text = message(
            "batch_no_room",
            "no more data can be written there ({reason}); expected space for the results: make "
            "space and repeat the command to continue",
            reason=reason_of(error),
        )
        raise InputError(Problem(task.out, text)) from error


def _report_obstacle(task, error):
    """Return the result of `do_job` if another object occupies the path of a folder or outcome."""
    path = error.filename2 or error.filename or folder_of(task.out, task.job.name)
    text = message(
        "batch_in_the_way",
        "is not a file or folder of a batch ({reason}); expected a free path: move it away",
        reason=reason_of(error),
    )
    return "failed", [problem_of(Problem(os.path.relpath(path, task.out), text))], 1


def _do_steps(task):
    """Return the result of `do_job`."""
    name, steps = task.job.name, task.job.asked.do
    outcome = load_outcome(task.out, name) or Outcome(name, task.job.source)
    if not outcome.is_settled_for(task.keys):  # settled if a worker died before its answer
        journal, clock = Journal(task.out, task.run), Clock()
        journal.note("begun", name)
        outcome = _after_steps(replace(outcome, source=task.job.source), task, clock)
        journal.note("ended", name, status=outcome.status(steps), cpu_s=clock.seconds())
    done, status = (
        [outcome.steps[step] for step in steps if step in outcome.steps],
        outcome.status(steps),
    )
    problems = [problem for step in done for problem in step.problems]
    return status, problems[:1], sum(step.problem_count for step in done)


def _after_steps(outcome, task, clock):
    """Run the steps without current result; save and return the `Outcome` after each step."""
    for step in task.job.asked.do:
        if not outcome.is_settled(step, task.keys[step]):
            outcome = replace(
                outcome, steps={**outcome.steps, step: _outcome_of(step, task, clock)}
            )
            save_outcome(task.out, outcome)
        if step == "run" and outcome.steps[step].status != "done":
            break
    return outcome


def _check_folder(task):
    """Raise InputError if this machine does not find the folder of the batch."""
    if not os.path.exists(os.path.join(task.out, JOURNAL)):
        import socket

        text = message(
            "batch_folder_not_seen",
            "not found as {path} by the worker on {machine}; expected the folder of the batch "
            "under the same path on all machines of the cluster",
            machine=socket.gethostname(),
            path=task.out,
        )
        raise InputError(Problem("--out", text))


def _outcome_of(step, task, clock):
    """Run a step and return its `StepOutcome`, also for a step that fails."""
    key, name = task.keys[step], task.job.name
    try:
        with clock.step(step):
            written = _DOING[step](task, clock)
        with clock.step("row"):
            values, warnings = reading.values_of(step, folder_of(task.out, name) / FOLDERS[step])
        if keys_of(task.job, former_or_none(task.job))[step] != key:
            text = message(
                "batch_changed",
                "input files changed during the computation; the next batch computes the job again",
            )
            return _make_failure(key, "failed", [Problem(name, text)])
    except TankcalError as error:
        status = STATUS_OF_EXIT.get(error.exit_status, "failed")
        problems = getattr(error, "problems", None)
        return _make_failure(key, status, problems or [Problem(name, text) for text in error.texts])
    except MemoryError:
        text = message("batch_no_memory", "not enough memory")
        return _make_failure(key, "failed", [Problem(name, text)])
    except OSError as error:
        if error.errno in NO_ROOM:
            raise
        place = os.path.basename(str(error.filename or "")) or name
        return _make_failure(key, "failed", [Problem(place, reason_of(error))])
    except Exception as error:  # an internal error must not stop the other jobs
        text = message(
            "batch_mistake",
            "internal error of tankcal; please report it with the job ({name}: {error})",
            name=type(error).__name__,
            error=" ".join(str(error).split())[:300],
        )
        return _make_failure(key, "failed", [Problem(name, text)])
    return StepOutcome(
        key,
        "done",
        files=sorted(Path(path).name for path in written),
        values=values,
        warnings=warnings[:MOST_TOLD],
        warning_count=len(warnings),
    )


def _make_failure(key, status, problems):
    """Return the `StepOutcome` of a step with problems."""
    plain_problems = [problem_of(problem) for problem in problems[:MOST_TOLD]]
    return StepOutcome(key, status, problems=plain_problems, problem_count=len(problems))


# ---- steps: each writes its folder, all or nothing, and returns the paths


def _run(task, clock):
    import tankcal
    from tankcal.report import outputs

    with clock.step("read"):
        job = tankcal.load(task.job.source)
    with clock.step("compute"):
        result = tankcal.run(job)
    asked = task.job.asked
    return outputs.write(
        result, _place(task, "run"), clock.progress, _letterhead(asked), papers=asked.papers
    )


def _report(task, clock):
    from tankcal.report import outputs
    from tankcal.report.saved_rooms import room_of

    source, asked = _record(task), task.job.asked
    place, letterhead = _place(task, "report"), _letterhead(asked)
    room, saved = room_of(source)
    if room is not None:
        return room.rebuild(saved, place, asked.language, None, letterhead)
    return outputs.rebuild(source, place, clock.progress, asked.language, letterhead)


def _compare(task, clock):
    from tankcal.recalibration.inputs import Asked, compare_files
    from tankcal.record.schema import to_plain
    from tankcal.report.comparison import write_comparison

    record, asked = _record(task), task.job.asked
    comparison = compare_files(Asked(former_of(task.job), record, rule=asked.compare_by))
    return write_comparison(
        to_plain(comparison), _place(task, "compare"), _language(task, record), None,
        _letterhead(asked),
    )  # fmt: skip


def _inspect(task, clock):
    from tankcal.inspection.inspecting import Asked, inspect_files
    from tankcal.record.schema import to_plain
    from tankcal.report.inspection import write_inspection

    asked = task.job.asked
    source, rule, levelled = reading.source_of_inspection(task.job, _place(task, "run"))
    inspection = inspect_files(Asked(source, rule=asked.inspect_by or rule, **levelled))
    plain = to_plain(inspection)
    language = asked.language or reading.language_of(source)
    return write_inspection(plain, _place(task, "inspect"), language, None, _letterhead(asked))


def _export(task, clock):
    from tankcal.exports.exporting import default_name, export_record, write_export
    from tankcal.exports.profiles import find_profile
    from tankcal.report import folders

    record = _record(task)
    language = _language(task, record)
    export = export_record(record, find_profile(task.job.asked.profile), language=language)
    with folders.replaced(_place(task, "export")) as temporary:
        return write_export(export, temporary / default_name(export), language)


_DOING = {
    "run": _run, "report": _report, "compare": _compare, "inspect": _inspect, "export": _export,
}  # fmt: skip


def _place(task, step):
    """Return the folder of a step."""
    return folder_of(task.out, task.job.name) / FOLDERS[step]


def _record(task):
    """Return the input file of a step: the record of this batch, or of the job."""
    record = _place(task, "run") / RECORD
    return record if "run" in task.job.asked.do else Path(task.job.source)


def _language(task, record):
    """Return the language of the output of a step."""
    return task.job.asked.language or reading.language_of(record)


def _letterhead(asked):
    """Return the letterhead, or None."""
    if asked.letterhead is None:
        return None
    from tankcal.report.letterhead import load

    return load(asked.letterhead)


class Clock:
    """Processor time of this process and its ended child processes, by part of a job."""

    PARTS = {  # noqa: RUF012
        "writing_record": "record",
        "writing_workbook": "workbook",
        "writing_report": "papers",
    }

    def __init__(self):
        self._spent, self._part, self._since = {}, None, _processor_s()

    @contextmanager
    def step(self, part):
        """Add the processor time of the block to this part."""
        before = self._to(part)
        try:
            yield
        finally:
            self._to(before)

    def progress(self, text, done, total):
        """Take the progress messages of `outputs.write`."""
        self._to(self.PARTS.get(getattr(text, "code", None), self._part))

    def seconds(self):
        """Return {part: seconds}."""
        self._to(None)
        return {part: round(spent, 3) for part, spent in self._spent.items() if part}

    def _to(self, part):
        """Start timing a part; return the previous part."""
        now, before = _processor_s(), self._part
        self._spent[before] = self._spent.get(before, 0.0) + now - self._since
        self._part, self._since = part, now
        return before


def _processor_s():
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
