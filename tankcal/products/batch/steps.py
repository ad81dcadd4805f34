"""Steps of one job, run by a worker; each step writes all of its files or none."""

import errno
import json
import os
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError, problem_of, reason_of
from tankcal.job.folder import OF_INSPECTIONS
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.products.batch.finding import RECORD, SAVED, BatchJob, find_former, find_former_or_none
from tankcal.products.batch.journal import JOURNAL, Journal, compute_keys
from tankcal.products.batch.outcomes import (
    FOLDERS,
    MOST_REPORTED,
    Outcome,
    StepOutcome,
    job_folder,
    load_outcome,
    save_outcome,
)
from tankcal.record.inspection import VERDICTS

IN_THE_WAY = (errno.EEXIST, errno.EISDIR, errno.ENOTDIR)  # errors of a job, not of the batch
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
NEW_TABLE = "table"  # folder of the table that an upkeep has improved, for export
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
    path = error.filename2 or error.filename or job_folder(task.out, task.job.name)
    text = message(
        "batch_in_the_way",
        "is not a file or folder of a batch ({reason}); expected a free path: move it away",
        reason=reason_of(error),
    )
    return "failed", [problem_of(Problem(os.path.relpath(path, task.out), text))], 1


def _do_steps(task):
    """Run the steps of a job that have no current result, with an entry of each in the journal."""
    name, steps = task.job.name, task.job.options.steps
    outcome = load_outcome(task.out, name) or Outcome(name, task.job.source)
    if not outcome.is_complete(task.keys):  # settled if a worker died before its answer
        journal, clock = Journal(task.out, task.run), Clock()
        journal.note("begun", name)
        outcome = _run_steps(replace(outcome, source=task.job.source), task, clock)
        journal.note("ended", name, status=outcome.status(steps), cpu_s=clock.seconds())
    return outcome.result(steps)


def _run_steps(outcome, task, clock):
    """Run the steps without current result; save and return the `Outcome` after each step."""
    for step in task.job.options.steps:
        if not outcome.is_settled(step, task.keys[step]):
            settled = _run_step(step, task, clock)
            outcome = replace(outcome, steps={**outcome.steps, step: settled})
            save_outcome(task.out, outcome)
        if step in ("run", "upkeep") and outcome.steps[step].status != "done":
            break  # the other steps need its results
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


def _run_step(step, task, clock):
    """Run a step and return its `StepOutcome`, also for a step that fails."""
    key, name = task.keys[step], task.job.name
    try:
        with clock.step(step):
            written = _STEP_FUNCTIONS[step](task, clock)
        with clock.step("row"):
            values, warnings = read_values(job_folder(task.out, name) / FOLDERS[step])
        if compute_keys(task.job, find_former_or_none(task.job))[step] != key:
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
        warnings=warnings[:MOST_REPORTED],
        warning_count=len(warnings),
    )


def _make_failure(key, status, problems):
    """Return the `StepOutcome` of a step with problems."""
    plain_problems = [problem_of(problem) for problem in problems[:MOST_REPORTED]]
    return StepOutcome(key, status, problems=plain_problems, problem_count=len(problems))


# ---- steps: each writes its folder, complete or not, and returns the paths


def _run(task, clock):
    import tankcal
    from tankcal.report import outputs

    with clock.step("read"):
        job = tankcal.load(task.job.source)
    with clock.step("compute"):
        result = tankcal.run(job)
    options = task.job.options
    return outputs.write(
        result, _place(task, "run"), clock.progress, _letterhead(options), papers=options.papers
    )


def _report(task, clock):
    from tankcal.report import outputs
    from tankcal.report.saved_documents import find_document

    source, options = _record(task), task.job.options
    place, letterhead = _place(task, "report"), _letterhead(options)
    document, saved = find_document(source)
    if document is not None:
        return document.rebuild(saved, place, options.language, None, letterhead)
    return outputs.rebuild(source, place, clock.progress, options.language, letterhead)


def _compare(task, clock):
    from tankcal.products.recalibration.comparison import Asked, compare_files
    from tankcal.record.schema import to_plain
    from tankcal.report.comparison import write_comparison

    record, options = _record(task), task.job.options
    comparison = compare_files(Asked(find_former(task.job), record, rule=options.compare_by))
    return write_comparison(
        to_plain(comparison), _place(task, "compare"), _language(task, record), None,
        _letterhead(options),
    )  # fmt: skip


def _inspect(task, clock):
    from tankcal.products.inspection.inspecting import Asked, inspect_files
    from tankcal.record.schema import to_plain
    from tankcal.report.inspection import write_inspection

    options = task.job.options
    source, rule, levelled = find_inspection_source(task.job, _place(task, "run"))
    inspection = inspect_files(Asked(source, rule=options.inspect_by or rule, **levelled))
    plain = to_plain(inspection)
    language = options.language or read_language(source)
    return write_inspection(plain, _place(task, "inspect"), language, None, _letterhead(options))


def _export(task, clock):
    from tankcal.products.exports.exporting import default_name, export_record, write_export
    from tankcal.products.exports.profiles import find_profile
    from tankcal.report import folders

    record = _record(task)
    language = _language(task, record)
    export = export_record(record, find_profile(task.job.options.profile), language=language)
    with folders.replace_folder(_place(task, "export")) as temporary:
        return write_export(export, temporary / default_name(export), language)


def _upkeep(task, clock):
    from tankcal.products.upkeep.paper import DOCUMENT
    from tankcal.products.upkeep.reading import read_upkeep
    from tankcal.products.upkeep.saved import State
    from tankcal.products.upkeep.upkeep import keep_up
    from tankcal.record import save
    from tankcal.record.schema import to_plain
    from tankcal.report import folders

    options, place = task.job.options, _place(task, "upkeep")
    # Results of earlier months, so that a batch each month computes the new month only.
    state = State(place.with_name("state"))
    with clock.step("read"):
        inputs = read_upkeep(task.job.source, state)
    with clock.step("compute"):
        result = keep_up(inputs, state)
    upkeep, language = to_plain(result), options.language or inputs.sections["upkeep"]["language"]
    if "export" in options.steps and result.mode == "improved":
        from tankcal.products.upkeep.new_record import make_record, write_record

        write_record(make_record(inputs, result, state), place.with_name(NEW_TABLE), language)
    if options.papers:
        return DOCUMENT.write(upkeep, place, language, None, _letterhead(options))
    DOCUMENT.refuse_foreign(place)
    with folders.replace_folder(place, language) as temporary:
        save(upkeep, temporary / DOCUMENT.saved_format.file)
    return [place / DOCUMENT.saved_format.file]


_STEP_FUNCTIONS = {
    "run": _run, "report": _report, "compare": _compare, "inspect": _inspect, "export": _export,
    "upkeep": _upkeep,
}  # fmt: skip


def _place(task, step):
    """Return the folder of a step."""
    return job_folder(task.out, task.job.name) / FOLDERS[step]


def _record(task):
    """Return the input file of a step: the record of this batch, or of the job."""
    steps = task.job.options.steps
    if "upkeep" in steps:
        return _table_in_force(task)
    return _place(task, "run") / RECORD if "run" in steps else Path(task.job.source)


def _table_in_force(task):
    """Return the record of the improved table of an upkeep, or that of the former table."""
    from tankcal.products.upkeep.reading import find_record

    place = _place(task, "upkeep")
    mode = json.loads((place / "upkeep.json").read_bytes())["mode"]
    former = find_record(task.job.source)
    record = place.with_name(NEW_TABLE) / RECORD if mode == "improved" else former
    if record is None:
        text = message("batch_no_table_in_force", "no table in force; expected record.json as "
                       "record of upkeep.toml for export")  # fmt: skip
        raise InputError(Problem("upkeep.toml", text))
    return record


def _language(task, record):
    """Return the language of the output of a step."""
    return task.job.options.language or read_language(record)


def _letterhead(options):
    """Return the letterhead, or None."""
    if options.letterhead is None:
        return None
    from tankcal.report.laboratory import load

    return load(options.letterhead)


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


# ---- results of the steps


def read_values(folder):
    """Return ({name: value} for the summary, warnings as plain data) from the folder of a step."""
    saved = next((folder / name for name in SAVED if (folder / name).is_file()), None)
    if saved is None:
        return {}, []
    results = json.loads(saved.read_bytes())
    return _READERS[saved.name](results), results["warnings"]


def _read_record(record):
    job, table, adjustment = record["job"], record["capacity"], record["adjustment"]
    tank = job["tank"] or {}
    values = {
        "tank": tank.get("id"),
        "kind": tank.get("kind"),
        "date": (job["survey"] or {}).get("date"),
        "global_test": adjustment["passed"] if adjustment else None,
        "rule": record["rule"]["rule"]["name"] if record.get("rule") else None,
        "rule_verdict": record["rule"]["code"] if record.get("rule") else None,
    }
    if table:
        values |= {
            "height_m": table["height_m"][-1],
            "volume_m3": table["volume_m3"][-1],
            "U_m3": table["stated_U_m3"][-1],
        }
    return values


def _read_comparison(comparison):
    last = comparison["waterfall"][-1] if comparison["waterfall"] else None
    return {
        "comparison_verdict": comparison["verdict"] or "none",
        "former_m3": last and last["former_m3"],
        "of_tank_m3": last and last["tank_m3"],
    }


def _read_inspection(inspection):
    counts = Counter(check["verdict"] for check in inspection["checks"])
    worst = next((verdict for verdict in VERDICTS if counts[verdict]), None)
    return {"tank": inspection["tank"]["id"], "inspection_verdict": worst}


def _read_upkeep(upkeep):
    watch, month = upkeep["watch"], upkeep["months"][-1]
    is_named = watch["alarm"] is not None and watch["is_named"]
    possible = [suspect for suspect in watch["suspects"] if suspect["is_possible"]]
    return {
        "tank": upkeep["tank"],
        "date": upkeep["period"]["last"],
        "alarm_verdict": "named" if is_named else "open" if watch["alarm"] else "none",
        "alarm": watch["alarm"],
        "causes": list(dict.fromkeys(suspect["kind"] for suspect in possible)) or None,
        "leak_l_h": month["leak_l_h"],
        "leak_U_l_h": month["U_l_h"],
        "false_alarms": watch["rate_per_year"] * upkeep["period"]["days"] / 365.25,
    }


_READERS = dict(
    zip(SAVED, (_read_record, _read_comparison, _read_inspection, _read_upkeep), strict=True)
)


def find_inspection_source(job, results):
    """Return the input of the inspection of a job: (source, rule or None, {settlement, edges}).

    An inspection uses the record computed by this batch in the folder `results`, with the levelling
    tables and the rule beside the job. For clouds it uses the job, because a record contains no
    welds.
    """
    record = results / RECORD
    if "run" not in job.options.steps:
        return job.source, None, {}
    saved = json.loads(record.read_bytes())
    if saved.get("clouds"):
        return job.source, None, {}
    path = Path(job.source)
    folder = path if path.is_dir() else path.parent
    levelled = {
        name: folder / file if (folder / file).is_file() else None
        for name, file in zip(("settlement", "edges"), OF_INSPECTIONS, strict=True)
    }
    rule = (saved["job"].get("inspection") or {}).get("rule")
    is_file = rule is not None and rule.lower().endswith(".toml")
    return record, str(folder / rule) if is_file else None, levelled


def read_language(source):
    """Return the language of a job, or of the job of a record; None if it cannot be read."""
    path = Path(source)
    if path.name in SAVED:
        try:
            return json.loads(path.read_bytes())["job"]["table"]["language"]
        except (OSError, ValueError, LookupError, TypeError):
            return None
    import tankcal

    job = tankcal.load(path.parent if path.name == SETTINGS_FILE else path)
    return job.table.language
