"""SHA-256 of all data that affect a step of a job: inputs, version and options.

For a job folder, all files that the job could read count; for a workbook, the files beside it that
it names. An unnecessary file only repeats a computation; a missing file would hide a change.
"""

import json
import os
import zipfile
from functools import lru_cache
from hashlib import sha256
from html import unescape
from pathlib import Path

import tankcal
from tankcal.job.folder import OF_INSPECTIONS
from tankcal.job.tables import COVARIANCE_FILE, SETTINGS_FILE
from tankcal.products.batch.finding import BOOK
from tankcal.record import long_tables
from tankcal.record.manifest import digest_of

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
}
FILES_OF_STEP = {
    "run": ("letterhead",),
    "report": ("letterhead",),
    "compare": ("compare_by", "letterhead"),
    "inspect": ("inspect_by", "letterhead"),
    "export": ("profile",),
}


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
    for place, folders, names in os.walk(folder):
        if place != folder and not RESULTS.isdisjoint(names):
            folders.clear()
            continue
        folders[:] = [folder_name for folder_name in folders if not folder_name.startswith(".")]
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
