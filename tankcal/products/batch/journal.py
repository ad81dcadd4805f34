"""The folder of a batch: write lock, journal, and recovery after an interruption.

DIR/batch.lock      locked by the running batch; a killed process holds no lock
DIR/journal.jsonl   one line for the start and the end of each job, with the time
DIR/jobs/NAME/      the results of a job, and its outcome.json
DIR/summary.*       summary of all jobs

SHA-256 of all data that affect a step of a job: inputs, version and options.

For a job folder, all files that the job could read count; for a workbook, the files beside it that
it names. An unnecessary file only repeats a computation; a missing file would hide a change.
"""

import json
import os
import socket
import time
import uuid
import zipfile
from contextlib import contextmanager
from functools import lru_cache
from hashlib import sha256
from html import unescape
from pathlib import Path

import tankcal
from tankcal.errors import InputError, Problem
from tankcal.job.folder import OF_INSPECTIONS
from tankcal.job.tables import COVARIANCE_FILE, SETTINGS_FILE
from tankcal.messages import message
from tankcal.products.batch.finding import BOOK
from tankcal.products.batch.outcomes import JOBS
from tankcal.record import long_tables
from tankcal.record.manifest import digest_of
from tankcal.report import folders
from tankcal.report.batch import FILES as SUMMARY

LOCK, JOURNAL = "batch.lock", "journal.jsonl"
FILES = (LOCK, JOURNAL, JOBS, *SUMMARY)
NEVER_READ = (  # endings of files that no job reads
    *(".jpg", ".jpeg", ".png", ".tif", ".tiff", ".gif", ".bmp", ".dng", ".raw", ".heic"),
    *(".mp4", ".mov", ".avi", ".pdf", ".doc", ".docx", ".odt", ".zip", ".html"),
)
RESULTS = frozenset(("record.json", "comparison.json", "inspection.json", SETTINGS_FILE))
MOST_UNPACKED_BYTES = 300_000_000  # largest unpacked workbook to search for names
OF_STEP = {  # attributes of `Options` that affect a step
    "run": ("papers",),
    "report": ("language",),
    "compare": ("language",),
    "inspect": ("language",),
    "export": ("language",),
    "upkeep": ("language", "papers"),
}
FILES_OF_STEP = {
    "run": ("letterhead",),
    "report": ("letterhead",),
    "compare": ("compare_by", "letterhead"),
    "inspect": ("inspect_by", "letterhead"),
    "export": ("profile",),
    "upkeep": ("letterhead",),
}


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
        for line in self._lines(json.dumps(job, ensure_ascii=False)):
            if line.get("run") == self.run and line.get("job") == job:
                begun += line.get("event") == "begun"
                ended += line.get("event") == "ended"
        return begun - ended

    def _lines(self, text):
        """Yield the entries of lines that contain a text; incomplete lines are skipped."""
        try:
            with open(self.out / JOURNAL, encoding="utf-8", errors="replace") as file:
                for line in file:
                    if text not in line:  # parsing of 200 000 lines takes a second
                        continue
                    try:
                        entry = json.loads(line)
                    except ValueError:  # cut off by a kill
                        continue
                    if isinstance(entry, dict):
                        yield entry
        except OSError:
            return


# ---- SHA-256 of all data that affect a step of a job: inputs, version and options


def compute_keys(job, former=None):
    """Return {step: SHA-256} of all data that affect each step of a job.

    Parameters
    ----------
    job : finding.BatchJob
    former : Path, optional
        Its former table.

    Raises
    ------
    OSError
        An input cannot be read.
    """
    inputs, options = digest_inputs(job.source), job.options
    keys = {}
    for step in options.steps:
        bears = {
            "tankcal": tankcal.__version__,
            "step": step,
            "inputs": inputs,
            **{name: getattr(options, name) for name in OF_STEP[step]},
            **{name: _digest_content(getattr(options, name)) for name in FILES_OF_STEP[step]},
        }
        if step == "run" and not options.papers:
            bears.pop("letterhead")
        if step == "compare":
            bears["former"] = None if former is None else digest_inputs(former)
        if "upkeep" in options.steps:
            from tankcal.products.upkeep.reading import find_record

            record = find_record(job.source)
            bears["former"] = None if record is None else digest_inputs(record)
            if "export" in options.steps:
                bears["exports"] = True  # the upkeep then writes its table
        text = json.dumps(bears, sort_keys=True)
        keys[step] = sha256(text.encode()).hexdigest()
    return keys


def digest_inputs(source):
    """Return [[name, SHA-256]] of the input files of a job; [] if there are none."""
    path = Path(source)
    if path.is_dir():
        return [[name, _digest(path / name)] for name in _files_below(str(path))]
    if not path.is_file():
        return []
    names = [path.name]
    if path.suffix.lower() == BOOK:
        names += _files_of_workbook(path)
    elif path.suffix.lower() == ".toml":
        names += _files_of_former(path)
    elif path.name == "record.json":
        beside = (COVARIANCE_FILE, long_tables.FILE)
        names += [file for file in beside if path.with_name(file).is_file()]
    return [[name, _digest(path.parent / name)] for name in names]


def _files_below(folder):
    """Return the sorted names of the files below a folder that a job in it could read."""
    paths = []
    for place, below, names in os.walk(folder):
        if place != folder and not RESULTS.isdisjoint(names):
            below.clear()
            continue
        below[:] = [folder_name for folder_name in below if not folder_name.startswith(".")]
        for name in names:
            if name[0] in ".~" or os.path.splitext(name)[1].lower() in NEVER_READ:
                continue
            path = os.path.join(place, name)
            if os.path.isfile(path):
                paths.append(os.path.relpath(path, folder).replace(os.sep, "/"))
    return sorted(paths)


_files_beside = lru_cache(maxsize=64)(_files_below)  # cached for folders with many workbooks


def _files_of_workbook(path):
    """Return the sorted files named in a workbook, and the tables of an inspection beside it."""
    beside = [name for name in _files_beside(str(path.parent)) if not name.lower().endswith(BOOK)]
    if not beside:
        return []
    try:
        with zipfile.ZipFile(path) as book:
            parts = [part.filename for part in book.infolist() if part.filename.endswith(".xml")]
            if sum(part.file_size for part in book.infolist()) > MOST_UNPACKED_BYTES:
                return []
            text = unescape(" ".join(book.read(part).decode(errors="replace") for part in parts))
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError, RuntimeError):
        return []
    return [name for name in beside if name in text or name in OF_INSPECTIONS]


def _files_of_former(path):
    """Return the table named in a former.toml, if it is beside this file."""
    from tankcal.products.recalibration.comparison import rows_file

    try:
        table = rows_file(path)
        return [table.name] if table.is_file() else []
    except (OSError, ValueError, LookupError, TypeError):
        return []


def _digest_content(named):
    """Return the digest of a file; any other text is returned unchanged."""
    path = None if named is None else Path(named)
    return named if path is None or not path.is_file() else _digest(path)


def _digest(path):
    """Return the SHA-256 of a file, cached by size and modification time."""
    status = os.stat(path)
    return _cached_digest(str(path), status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=4096)
def _cached_digest(path, size, mtime_ns):
    return digest_of(path)
