"""Journal of the unsaved edits of a job, from which they are recovered after a crash.

The journal is a file in the state folder of the user: a header with the SHA-256 of the files of the
job, then a line of JSON for each edit, with its operations. Each line is on the disk before the
edit is answered, so that a killed process loses at most the edit that was being written. Save
begins a new journal, and writes the steps of Undo and Redo to a file beside it.
"""

import hashlib
import json
import os
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tankcal.products.desk.tables import AmbiguousNumber

VARIABLE = "TANKCAL_STATE"  # environment variable with another state folder
AMBIGUOUS = "ambiguous"  # key of an ambiguous number in a line


def find_state_folder():
    """Return the folder of the user for journals and the list of recent jobs (Path)."""
    if os.environ.get(VARIABLE):
        return Path(os.environ[VARIABLE])
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home()) / "tankcal"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "tankcal"
    state = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state) / "tankcal"


@dataclass(frozen=True)
class Unsaved:
    """Edits of an earlier session that are not in the files of the job.

    Attributes
    ----------
    edits : list of list
        Operations of each edit.
    when : float
        Time of the last edit, seconds since 1970.
    is_applicable : bool
        Whether the files are still those to which the edits apply.
    """

    edits: list
    when: float
    is_applicable: bool


class Journal:
    """Journal of a job.

    Parameters
    ----------
    source : Path
        Folder or workbook of the job.
    folder : Path, optional
        State folder; by default that of the user.
    """

    def __init__(self, source, folder=None):
        self.source = Path(source).resolve()
        name = hashlib.sha256(str(self.source).encode("utf-8", "surrogateescape")).hexdigest()[:24]
        self.path = Path(folder or find_state_folder()) / "journals" / f"{name}.jsonl"
        self.history = self.path.with_suffix(".history.json")
        self._digests = None

    def keep_history(self, digests, history):
        """Write the steps of Undo and Redo that belong to saved files."""
        content = json.dumps({"files": digests} | _plain(history), ensure_ascii=False)
        temporary = self.history.with_suffix(".part")
        with suppress(OSError):
            temporary.parent.mkdir(parents=True, exist_ok=True)
            temporary.write_text(content, encoding="utf-8", errors="surrogateescape")
            temporary.replace(self.history)

    def read_history(self, digests):
        """Read the steps of `keep_history`; None if another program has changed the files."""
        with suppress(OSError, ValueError, LookupError, TypeError):
            text = self.history.read_text(encoding="utf-8", errors="surrogateescape")
            content = json.loads(text, object_hook=_decode)
            return content if content["files"] == digests else None
        return None

    def read(self, digests):
        """Read the edits of an earlier session.

        Parameters
        ----------
        digests : dict
            SHA-256 of the present files, {file: digest or None}.

        Returns
        -------
        Unsaved or None
            None if there are no edits.
        """
        try:
            lines = self.path.read_bytes().split(b"\n")[:-1]  # without an incomplete last line
            header, *edits = [json.loads(line, object_hook=_decode) for line in lines]
            unsaved = Unsaved(edits, self.path.stat().st_mtime, header["files"] == digests)
        except (OSError, ValueError, LookupError, TypeError):
            return None
        is_valid = all(isinstance(edit, list) for edit in edits)
        return unsaved if edits and is_valid else None

    def begin(self, digests):
        """Begin a new journal for files with these digests, with the next edit."""
        self._digests = digests
        with suppress(OSError):
            self.path.unlink(missing_ok=True)

    def append(self, operations):
        """Append an edit; the line is on the disk when the function returns."""
        lines = [json.dumps(_plain(operations), ensure_ascii=False)]
        if not self.path.exists():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            header = {"source": str(self.source), "files": self._digests, "began": time.time()}
            lines.insert(0, json.dumps(header))
        data = "".join(f"{line}\n" for line in lines).encode("utf-8", "surrogateescape")
        with self.path.open("ab") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())


def _plain(value):
    """Value for JSON; an ambiguous number is marked, because it is not written to a file."""
    if isinstance(value, AmbiguousNumber):
        return {AMBIGUOUS: str(value)}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value


def _decode(content):
    """Object of a line; an ambiguous number gets its type again."""
    if content.keys() == {AMBIGUOUS}:
        return AmbiguousNumber(content[AMBIGUOUS])
    return content
