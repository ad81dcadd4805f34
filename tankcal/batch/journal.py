"""The folder of a batch: who may write to it, its journal, what an ended batch left behind.

DIR/batch.lock      held by the batch that runs; one that was killed holds nothing
DIR/journal.jsonl   a line each time that a job is begun or ended, with the time of the clock
DIR/jobs/NAME/      the results of a job, and its outcome.json
DIR/summary.*       of all jobs
"""

import json
import os
import socket
import time
import uuid
from contextlib import contextmanager
from pathlib import Path

from tankcal.batch.outcomes import JOBS
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.report import folders
from tankcal.report.batch import FILES as SUMMARY

LOCK, JOURNAL = "batch.lock", "journal.jsonl"
FILES = (LOCK, JOURNAL, JOBS, *SUMMARY)


@contextmanager
def opened_folder(out):
    """The folder of a batch, made when missing, for this process alone; gives its `Journal`.

    Raises
    ------
    InputError
        For a folder that holds anything else, or that another batch is writing to.
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
    """Put right what an ended batch was writing."""
    for place in (jobs, *(folder for folder in jobs.iterdir() if folder.is_dir())):
        folders.recover(place)
        for left in place.glob(".*.tmp"):
            left.unlink(missing_ok=True)


class Journal:
    """Lines about the jobs of a batch, by its process and its workers.

    out  folder of the batch        run  of the batch that writes now
    """

    def __init__(self, out, run):
        self.out, self.run = Path(out), run

    def note(self, event, job, **more):
        """Add one line, in one piece: workers write to the same file."""
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

    def deaths(self, job):
        """How many times this batch began a job and did not end it."""
        begun = ended = 0
        for line in self._lines():
            if line.get("run") == self.run and line.get("job") == job:
                begun += line.get("event") == "begun"
                ended += line.get("event") == "ended"
        return begun - ended

    def _lines(self):
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
