"""Small jobs for batches, and what workers do in their tests (importable by them)."""

import json
import os
import signal
import time
from pathlib import Path

from job_builder import write_job

from tankcal.products.batch import steps

QUICK = {"table.step_m": 0.5, "certificate.number": "1"}
DEADLY = "deadly"  # label of a job that ends its worker
SLOW_S = 1.0


def write_jobs(folder, count, **more):
    """Job folders T-0, T-1 ... of tanks of different radii."""
    for number in range(count):
        settings = {**QUICK, "tank.id": f"T-{number}"}
        write_job(folder / f"T-{number}", radius=6.5 + 0.001 * number, settings=settings, **more)
    return folder


def spoil(folder):
    """Make a job one that is refused."""
    path = folder / "job.toml"
    path.write_text(path.read_text(encoding="utf-8").replace('"vertical"', '"cube"'), "utf-8")


def do_or_die(task):
    """`do_job`, but a job called DEADLY ends its worker once it has been begun."""
    if task.job.label == DEADLY:
        steps._STEP_FUNCTIONS = {**steps._STEP_FUNCTIONS, "run": _end_worker}
    return steps.do_job(task)


def do_slowly(task):
    """`do_job` after a while: so that a batch can be ended in the middle."""
    steps._STEP_FUNCTIONS = {**steps._STEP_FUNCTIONS, "run": _run_slowly}
    return steps.do_job(task)


_RUN = steps._run


def _run_slowly(task, clock):
    time.sleep(SLOW_S)
    return _RUN(task, clock)


def _end_worker(task, clock):
    os.kill(os.getpid(), signal.SIGKILL)


def journal_of(out, event=None):
    """The lines of a batch's journal, of an event."""
    lines = (Path(out) / "journal.jsonl").read_text(encoding="utf-8").splitlines()
    found = [json.loads(one) for one in lines]
    return [one for one in found if event in (None, one["event"])]


def jobs_in(out, event):
    """The jobs of the lines of an event, in their order."""
    return [one["job"] for one in journal_of(out, event)]


def bytes_of(out):
    """{name: bytes} of all that a batch wrote, but its journal and lock."""
    out = Path(out)
    return {
        str(one.relative_to(out)): one.read_bytes()
        for one in sorted(out.rglob("*"))
        if one.is_file() and one.name not in ("journal.jsonl", "batch.lock")
    }


def wait_until(is_so, seconds=90):
    """Wait until something is so; fails after a time."""
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.05)
