"""The folder of a batch: write lock, journal, and recovery after an interruption.

DIR/batch.lock      locked by the running batch; a killed process holds no lock
DIR/journal.jsonl   one line for the start and the end of each job, with the time
DIR/jobs/NAME/      the results of a job, and its outcome.json
DIR/summary.*       summary of all jobs
"""

import json
import os
import socket
import time
import uuid
from contextlib import contextmanager
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.batch.outcomes import JOBS
from tankcal.report import folders
from tankcal.report.batch import FILES as SUMMARY

LOCK, JOURNAL = "batch.lock", "journal.jsonl"
FILES = (LOCK, JOURNAL, JOBS, *SUMMARY)


@contextmanager
def open_folder(out):
    """Lock the folder of a batch for this process, create it if missing, and yield its `Journal`.

    Raises
    ------
    InputError
        The folder contains other files, or another batch is writing to it.
    """
    out = Path(out)
    folders.refuse_foreign(out, FILES)
    (out / JOBS).mkdir(parents=True, exist_ok=True)
    with open(out / LOCK, "a+", encoding="utf-8") as lock:
        if not folders.lock_file(lock):
            lock.seek(0)
            text = message(
                "batch_locked",
                "another batch is writing to this folder (process {holder}); expected it to end "
                "first, or another --out",
                holder=lock.read().strip()[:80] or "?",
            )
            raise InputError(Problem(str(out), text))
        lock.truncate(0)
        lock.write(f"{os.getpid()} on {socket.gethostname()}\n")
        lock.flush()
        _clear(out / JOBS)
        journal = Journal(out, uuid.uuid4().hex[:12])
        journal.note("opened", None)
        yield journal


def _clear(jobs):
    """Complete or remove the files that an interrupted batch was writing."""
    for place in (jobs, *(folder for folder in jobs.iterdir() if folder.is_dir())):
        folders.recover(place)
        for left in place.glob(".*.tmp"):
            left.unlink(missing_ok=True)


class Journal:
    """Journal of the jobs of a batch, written by its process and its workers.

    out  folder of the batch
    run  identifier of the current batch run
    """

    def __init__(self, out, run):
        self.out, self.run = Path(out), run

    def note(self, event, job, **more):
        """Append one line with a single write, because workers write to the same file."""
        line = {
            "at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "run": self.run,
            "event": event,
            "job": job,
            "worker": f"{socket.gethostname()}:{os.getpid()}",
            **more,
        }
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT
        file = os.open(self.out / JOURNAL, flags, 0o644)
        try:
            os.write(file, (json.dumps(line, ensure_ascii=False) + "\n").encode(errors="replace"))
        finally:
            os.close(file)

    def count_deaths(self, job):
        """Return how many times this batch started a job without ending it."""
        begun = ended = 0
        for line in self._lines():
            if line.get("run") == self.run and line.get("job") == job:
                begun += line.get("event") == "begun"
                ended += line.get("event") == "ended"
        return begun - ended

    def _lines(self):
        """Yield the entries of the journal; incomplete lines are skipped."""
        try:
            with open(self.out / JOURNAL, encoding="utf-8", errors="replace") as file:
                for line in file:
                    try:
                        entry = json.loads(line)
                    except ValueError:  # cut off by a kill
                        continue
                    if isinstance(entry, dict):
                        yield entry
        except OSError:
            return
