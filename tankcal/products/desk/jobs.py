"""Jobs of the user: new, recent, copied, packed. Existing files are never replaced."""

import io
import json
import re
import shutil
import time
import unicodedata
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tankcal.job.starter.writing import refuse_other_survey, write_starter
from tankcal.job.tables import SETTINGS_FILE
from tankcal.products.desk.journal import find_state_folder
from tankcal.products.desk.review import FILE as REVIEW
from tankcal.products.desk.review import folder_of
from tankcal.products.desk.states import JobState, State, state_of
from tankcal.report.folders import default_folder

RECENT_FILE = "recent.json"
MOST_RECENT = 200
JOB_FILES = SETTINGS_FILE, "job.xlsx"  # a job folder has either file
NOT_COPIED = (
    *(
        "results",
        "*-results",
        "review",
        "*-review",
        "published",
        ".*",
        "*.ipynb",
        "*.py",
        "*.md",
        "__pycache__",
    ),
)
MOST_LETTERS = 60  # longest name of a new folder
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)  # names of Windows devices


def folder_name(tank):
    """Name of a folder for a tank, valid on all systems.

    Examples
    --------
    >>> folder_name("TQ/21: água "), folder_name("con"), folder_name("..")
    ('TQ-21-água', 'tank-con', 'tank')
    """
    text = unicodedata.normalize("NFC", tank)
    name = re.sub(r"[^\w.() -]+", "-", text)[:MOST_LETTERS]
    name = re.sub(r"\s+", "-", re.sub(r"-\s+|\s+-", "-", name)).strip(".- ")
    return f"tank-{name}" if name and _RESERVED.fullmatch(name) else name or "tank"


def free_folder(workspace, tank):
    """New folder for a tank in the workspace, with a number if its name exists (Path)."""
    name, number = folder_name(tank), 1
    path = workspace / name
    while path.exists():
        number += 1
        path = workspace / f"{name}-{number}"
    return path


def create_job(workspace, tank, kind, survey, language):
    """Create a job for a tank, and return its folder; its name gets the permitted characters.

    Raises
    ------
    InputError
        If the kind of tank has no such survey, or if the folder cannot be written.
    """
    refuse_other_survey(kind, survey, language)
    folder = free_folder(Path(workspace), tank)
    folder.parent.mkdir(parents=True, exist_ok=True)
    write_starter(folder, kind, survey, language)
    from tankcal.products.desk.draft import Draft

    name = re.sub(r"\.{2,}", ".", re.sub(r"[^\w .()-]+", "-", tank)).strip(" .-")
    if name:
        draft = Draft(folder)
        draft.set_value("job", "tank", "id", name)
        draft.save()
    return folder


def copy_job(source, workspace, tank):
    """Copy the input files of a job to a new folder of the workspace, and return its path."""
    folder = free_folder(Path(workspace), tank)
    folder.parent.mkdir(parents=True, exist_ok=True)
    ignored = shutil.ignore_patterns(*NOT_COPIED)
    if source.is_file():
        folder.mkdir()
        shutil.copy2(source, folder / source.name)
        return folder / source.name
    shutil.copytree(source, folder, ignore=ignored)
    return folder


def pack(paths, root):
    """Bytes of a zip archive with files, named relative to the folder `root`."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in paths:
            archive.write(path, path.relative_to(root))
    return buffer.getvalue()


@dataclass(frozen=True)
class RecentJob:
    """A job in the list of recent jobs."""

    source: Path
    state: JobState
    opened_s: float


class RecentJobs:
    """List of recent jobs of the user, with their states.

    A state is determined again if a file of the job or its results have changed.

    Parameters
    ----------
    folder : Path, optional
        State folder; by default that of the user.
    """

    def __init__(self, folder=None):
        self.path = Path(folder or find_state_folder()) / RECENT_FILE
        self._states = {}

    def _read(self):
        """Read {path: time of opening}."""
        with suppress(OSError, ValueError, AttributeError):
            content = json.loads(self.path.read_bytes())
            return {str(path): float(opened) for path, opened in content.items()}
        return {}

    def _write(self, opened):
        self.path.parent.mkdir(parents=True, exist_ok=True)
        kept = sorted(opened.items(), key=lambda item: -item[1])[:MOST_RECENT]
        temporary = self.path.with_name(f".{self.path.name}.part")
        temporary.write_text(json.dumps(dict(kept), ensure_ascii=False), encoding="utf-8")
        temporary.replace(self.path)

    def add(self, source):
        """Note that a job was opened."""
        self._write(self._read() | {str(Path(source).resolve()): time.time()})

    def remove(self, source):
        """Remove a job from the list; its files remain."""
        opened = self._read()
        opened.pop(str(source), None)
        self._write(opened)

    def list(self):
        """List of `RecentJob`, the last opened first."""
        items = sorted(self._read().items(), key=lambda item: -item[1])
        return [RecentJob(Path(path), self._state(Path(path)), opened) for path, opened in items]

    def _state(self, source):
        """State of a job, kept until a file of the job changes."""
        stamp = _stamp(source)
        if stamp is None:
            return JobState(State.GONE)
        known = self._states.get(source)
        if known is None or known[0] != stamp:
            known = self._states[source] = stamp, state_of(source)
        return known[1]


def _stamp(source):
    """Times and sizes of the files of a job and its record; None if the job is gone."""
    try:
        files = [source] if source.is_file() else [
            path for path in source.iterdir() if not path.name.startswith(".")
        ]  # fmt: skip
        if source.is_dir() and not any(path.name in JOB_FILES for path in files):
            return None
        files += [default_folder(source) / "record.json", folder_of(source) / REVIEW]
        stats = [(path.name, path.stat()) for path in sorted(files) if path.is_file()]
    except OSError:
        return None
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats) or None
