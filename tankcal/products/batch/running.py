"""A batch: compute all jobs without current results, by dask workers or in this process.

Only a few jobs at a time are submitted to the scheduler, and each returns one small row. Neither
the scheduler nor this process therefore holds the results of many jobs.

Summary of a batch: one row per job with the changes since the last batch, and its files.

It contains no time and no worker: the same jobs give the same bytes for any number of workers and
interruptions.
"""

import contextlib
import json
import os
import queue
import tempfile
import uuid
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import tankcal
from tankcal.errors import Problem, problem_of, reason_of
from tankcal.messages import message
from tankcal.methods.clouds.cluster import (
    Watch,
    count_cores,
    is_installed,
    open_client,
    report_failures,
)
from tankcal.products.batch.finding import find_former_or_none, find_jobs
from tankcal.products.batch.journal import compute_keys, open_folder
from tankcal.products.batch.outcomes import (
    FOLDERS,
    JOBS,
    Outcome,
    StepOutcome,
    is_summary_row,
    load_outcome,
    read_known_names,
    refuse_incomplete,
    refuse_unreadable,
    save_outcome,
)
from tankcal.products.batch.steps import Task, do_job
from tankcal.report.batch import JSON, summary_files

TRIES = 3  # attempts for a job whose worker dies during the computation
MOST_DEATHS = 12  # dead workers with this job in their queue, computed or not
AHEAD = 2  # submitted jobs per worker
LOOK_S = 1.0  # seconds between checks for workers
WORKER_BYTES = 2 << 30
ALLOWED_FAILURES = "distributed.scheduler.allowed-failures"
VALUES = (
    *("tank", "kind", "date", "height_m", "volume_m3", "U_m3", "global_test", "rule"),
    *("rule_verdict", "comparison_verdict", "inspection_verdict", "alarm_verdict", "alarm"),
    *("causes", "leak_l_h", "leak_U_l_h", "false_alarms"),
)
VERDICTS = (
    *("global_test", "rule_verdict", "comparison_verdict", "inspection_verdict"),
    "alarm_verdict",
)
COMPARED = ("status", *VERDICTS, "height_m", "volume_m3", "U_m3")  # with the last batch
PAPERS = (  # in order of priority: the summary links to the first
    *("certificate.pdf", "report.pdf", "comparison.pdf", "inspection.pdf", "upkeep.pdf"),
    "capacity.xlsx",
    *("capacity.csv", "record.json"),
)
MOST_REPORTED = 1  # problems and warnings of a job in the summary


@dataclass(frozen=True)
class Callbacks:
    """Callbacks for the progress of a batch.

    Attributes
    ----------
    step : callable
        step(text), as in `tankcal.run`.
    part : callable
        part(text, done, total), as in `tankcal.run`.
    ended : callable
        ended(name, status, problems, count), for each job that is not done.
    """

    step: object = lambda text: None
    part: object = lambda text, done, total: None
    ended: object = lambda name, status, problems, count: None


@dataclass
class Batch:
    """Result of a batch.

    Attributes
    ----------
    counts : Counter
        Number of jobs by status.
    total, skipped : int
        Number of jobs, and of jobs with current results from an earlier batch.
    rows : list of dict
        Rows of the summary.
    files : list of Path
        Files of the summary.
    """

    counts: Counter = field(default_factory=Counter)
    total: int = 0
    skipped: int = 0
    rows: list = field(default_factory=list)
    files: list = field(default_factory=list)

    @property
    def exit_status(self):
        """Exit status 0: all done; 2: some refused or failed; 3: some without valid solution."""
        if self.counts["refused"] or self.counts["failed"]:
            return 2
        return 3 if self.counts["unsound"] else 0


def run_batch(arguments, options, out, *, workers="local", worker_bytes=WORKER_BYTES,
              language="en", callbacks=None):  # fmt: skip
    """Run the steps of each job without current result, and write the summary of all jobs.

    Parameters
    ----------
    arguments : sequence of str
        See `finding.find_jobs`.
    options : options.Options
    out : path
        Folder of the batch.
    workers : "local", int or str
        One worker per core, a number of workers (0: this process), or the address of a dask
        scheduler.
    worker_bytes : int
        Memory limit of a worker on this machine.
    language : str
        Language of the summary.
    callbacks : Callbacks, optional

    Returns
    -------
    Batch

    Raises
    ------
    InputError
        Arguments that name no job, invalid options, a folder with other files or in use by a
        running batch, or a cluster that does not answer. Finished results are kept.
    OSError
        The folder cannot be written to. Finished results are kept.
    """
    callbacks, out = callbacks or Callbacks(), os.path.abspath(out)
    refuse_unreadable(options)
    callbacks.step(message("batch_looking", "looking for jobs"))
    jobs = find_jobs(arguments, options, out, read_known_names(out))
    refuse_incomplete(options, jobs)
    with open_folder(out) as journal:
        batch = Batch(total=len(jobs))
        waiting = list(_select_tasks(jobs, journal, batch, callbacks))
        if waiting:
            _run_tasks(
                waiting, journal, batch, callbacks, _choose_workers(workers, waiting), worker_bytes
            )
        batch.rows, batch.files = write_summary(out, jobs, language)
        return batch


def _choose_workers(workers, waiting):
    """Return the number of workers on this machine (0: none), or an address."""
    if workers == "local":
        return min(count_cores(), len(waiting)) if is_installed() and len(waiting) > 1 else 0
    return workers


def _select_tasks(jobs, journal, batch, callbacks):
    """Yield a `Task` for each job with steps to run; count the other jobs."""
    looking = message("batch_comparing", "checking for finished jobs")
    for number, job in enumerate(jobs):
        callbacks.part(looking, number, len(jobs))
        task = Task(job, {}, str(journal.out), journal.run)
        try:
            task = replace(task, keys=compute_keys(job, find_former_or_none(job)))
        except OSError as error:
            text = message("batch_input_unreadable", "cannot be read ({reason})",
                           reason=reason_of(error))  # fmt: skip
            failure = fail_job(task, Problem(str(error.filename or job.source), text))
            batch.counts[failure[0]] += 1
            callbacks.ended(job.name, *failure)
            continue
        known = load_outcome(journal.out, job.name)
        if known is not None and known.is_complete(task.keys):
            status, problems, count = known.result(job.options.steps)
            batch.skipped += 1
            batch.counts[status] += 1
            if status != "done":
                callbacks.ended(job.name, status, problems, count)
        else:
            yield task


def _run_tasks(waiting, journal, batch, callbacks, workers, worker_bytes):
    """Run all tasks, one after the other or by workers."""
    text = message("batch_doing", "jobs done")

    def ended(task, status, problems, count):
        batch.counts[status] += 1
        if status != "done":
            callbacks.ended(task.job.name, status, problems, count)
        callbacks.part(text, sum(batch.counts.values()), batch.total)

    callbacks.part(text, sum(batch.counts.values()), batch.total)
    if workers == 0:
        for task in waiting:
            ended(task, *do_job(task))
        return
    settings = {ALLOWED_FAILURES: 0}  # TRIES limits the attempts instead
    with open_client(workers, worker_bytes=worker_bytes, settings=settings) as client:
        _WorkerRuns(client, journal, ended).do(waiting)


class _WorkerRuns:
    """Execution of tasks by workers: a few are submitted at a time."""

    def __init__(self, client, journal, ended):
        self._client, self._journal, self._report_ended = client, journal, ended
        self._watch, self._running, self._ended = Watch(client), {}, queue.SimpleQueue()
        self._deaths = Counter()

    def do(self, waiting):
        """Run all tasks; raise errors that stop the whole batch."""
        left = iter(waiting)
        try:
            self._fill(left)
            while self._running:
                try:
                    future = self._ended.get(timeout=LOOK_S)
                except queue.Empty:
                    self._fill(left)  # the number of workers may have changed
                else:
                    self._take(future)
                    self._submit_some(left, 1)
        finally:
            with contextlib.suppress(Exception):  # the scheduler may have ended
                self._client.cancel(list(self._running))

    def _fill(self, left):
        with report_failures():
            workers = max(self._watch.look(), 1)
        self._submit_some(left, AHEAD * workers - len(self._running))

    def _submit_some(self, left, most):
        for _ in range(most):
            if (task := next(left, None)) is not None:
                self._submit(task)

    def _submit(self, task):
        key = f"tankcal_job-{uuid.uuid4().hex}"  # one task group for all jobs
        with report_failures():
            future = self._client.submit(do_job, task, key=key, pure=False)
        self._running[future] = task
        future.add_done_callback(self._ended.put)

    def _take(self, future):
        """Report a finished task; submit it again if its worker died."""
        from distributed.scheduler import KilledWorker

        task = self._running.pop(future)
        with report_failures():
            error, result = future.exception(), None
            if error is not None and not isinstance(error, KilledWorker):
                raise error
            if error is None:
                with suppress(KilledWorker):  # the worker may die before its result is fetched
                    result = future.result()
            future.release()
        if result is not None:
            self._report_ended(task, *result)
        elif self._may_try_again(task):
            self._submit(task)
        else:
            text = message(
                "batch_killer",
                "its worker ended {count} times during the computation (out of memory? Use a "
                "larger --worker-memory)",
                count=TRIES,
            )
            self._report_ended(task, *fail_job(task, Problem(task.job.name, text)))

    def _may_try_again(self, task):
        """Return whether a job may have been on a dead worker without causing its death."""
        self._deaths[task.job.name] += 1
        return (
            self._journal.count_deaths(task.job.name) < TRIES
            and self._deaths[task.job.name] < MOST_DEATHS
        )


def fail_job(task, problem):
    """Save in the outcome of a job why it failed; return a result in the form of `do_job`."""
    plain = problem_of(problem)
    known = load_outcome(task.out, task.job.name) or Outcome(task.job.name, task.job.source)
    step = next(
        unsettled
        for unsettled in task.job.options.steps
        if not known.is_settled(unsettled, task.keys.get(unsettled, ""))
    )
    outcome = StepOutcome(task.keys.get(step, ""), "failed", problems=[plain], problem_count=1)
    save_outcome(task.out, replace(known, steps={**known.steps, step: outcome}))
    return "failed", [plain], 1


# ---- summary of a batch: one row per job with the changes since the last batch, and its files


def write_summary(out, jobs, language):
    """Write the summary of the jobs into the folder of their batch.

    Parameters
    ----------
    out : path
    jobs : list of finding.BatchJob
    language : str

    Returns
    -------
    rows : list of dict
    files : list of Path
    """
    out = Path(out)
    former = _former_rows(out / JSON)
    rows = []
    for job in jobs:
        row = _row(out, job)
        row["changes"] = None if former is None else find_changes(row, former.get(job.name))
        rows.append(row)
    names = {row["name"] for row in rows}
    steps = dict.fromkeys(step for job in jobs for step in job.options.steps)
    summary = {
        "format": "tankcal-batch/1",
        "tankcal": tankcal.__version__,
        "do": [*steps],
        "rows": rows,
        "gone": sorted(set(former or ()) - names),
    }
    with tempfile.TemporaryDirectory(prefix=".tankcal-", dir=out / JOBS) as folder:
        files = summary_files(summary, language, Path(folder))
        for name in files:
            (Path(folder) / name).replace(out / name)
    return rows, [out / name for name in files]


def _former_rows(path):
    """Return {name: values COMPARED} of the last summary; None if it is missing or invalid."""
    try:
        rows = json.loads(path.read_bytes())["rows"]
        if not all(map(is_summary_row, rows)):
            return None
        return {row["name"]: {key: row.get(key) for key in COMPARED} for row in rows}
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None


def _row(out, job):
    """Return the summary row of a job, from its outcome only."""
    outcome, steps = load_outcome(out, job.name, is_verified=False), job.options.steps
    row = {"name": job.name, "source": job.source, "status": "failed", **dict.fromkeys(VALUES)}
    problems, warnings, papers, counts = [], [], [], [0, 0]
    for step in () if outcome is None else steps:
        done = outcome.steps.get(step)
        if done is None:
            continue
        row |= {key: done.values[key] for key in VALUES if done.values.get(key) is not None}
        problems += done.problems[:MOST_REPORTED]
        warnings += done.warnings[:MOST_REPORTED]
        counts[0] += done.problem_count
        counts[1] += done.warning_count
        papers += [f"{JOBS}/{job.name}/{FOLDERS[step]}/{name}" for name in done.files]
    if outcome is not None:
        row["status"] = outcome.status(steps)
    best = [paper for name in PAPERS for paper in papers if paper.endswith(f"/{name}")]
    return row | {
        "problems": problems[:MOST_REPORTED],
        "problem_count": counts[0],
        "warnings": warnings[:MOST_REPORTED],
        "warning_count": counts[1],
        "papers": [*best, *(paper for paper in papers if paper not in best)][:1],
    }


def find_changes(row, former):
    """Return the differences from the row of the last batch.

    Parameters
    ----------
    row, former : dict
        former None: the last batch did not contain the job.

    Returns
    -------
    list of dict
        {"code", ...}: "first"; "status" and verdicts with "old" and "new"; "height_m"; "volume_m3"
        with "by_m3" and "U_m3", the larger of the two U.

    Examples
    --------
    >>> from tankcal.products.batch.running import find_changes
    >>> row = {"status": "done", "height_m": 9.5, "volume_m3": 100.5, "U_m3": 0.2}
    >>> find_changes(row, row | {"volume_m3": 100.25})
    [{'code': 'volume_m3', 'by_m3': 0.25, 'U_m3': 0.2}]
    """
    if former is None:
        return [{"code": "first"}]
    changes = []
    for key in ("status", *VERDICTS):
        old, new = former.get(key), row.get(key)
        if old != new:
            changes.append({"code": key, "old": old, "new": new})
    if former.get("height_m") != row.get("height_m"):
        changes.append({"code": "height_m"})
    volumes = [summary_row.get("volume_m3") for summary_row in (former, row)]
    if None not in volumes and volumes[0] != volumes[1]:
        most = max(former.get("U_m3") or 0.0, row.get("U_m3") or 0.0)
        changes.append({"code": "volume_m3", "by_m3": volumes[1] - volumes[0], "U_m3": most})
    return changes
