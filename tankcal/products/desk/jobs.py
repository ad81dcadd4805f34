"""Jobs of the user: lock, journal of unsaved edits, reviews, and state.

Lock of a job that a program has open, so that two programs do not edit it simultaneously.

A hidden file beside the job states the person, the machine and the process. The program renews its
time; without a renewal for `SILENT_S`, or if its process on this machine has ended, another program
may take the job over. Times are those of the file system, because clocks of machines differ.

Journal of the unsaved edits of a job, from which they are recovered after a crash.

The journal is a file in the state folder of the user: a header with the SHA-256 of the files of the
job, then a line of JSON for each edit, with its operations. Each line is on the disk before the
edit is answered, so that a killed process loses at most the edit that was being written. Save
begins a new journal, and writes the steps of Undo and Redo to a file beside it.

Review and approval of results: events in a file beside the job, with copies of the input.

The folder `review` (NAME-review beside a workbook) contains review.toml, to which events are only
appended, and a zip of the input for each submission and approval. An event holds for the record
whose SHA-256 it states: results that were computed again are neither submitted nor approved.
"""

import difflib
import getpass
import hashlib
import io
import json
import os
import platform
import re
import secrets
import shutil
import sys
import time
import tomllib
import unicodedata
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from itertools import zip_longest
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryDirectory

from tankcal.errors import InputError, Problem
from tankcal.job.loading import load
from tankcal.job.starter.writing import refuse_other_survey, write_starter
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import message
from tankcal.products.desk.tables import AmbiguousNumber
from tankcal.record.manifest import digest_of
from tankcal.report.folders import default_folder

SILENT_S = 300  # time without a renewal after which another program may take over
RENEWAL_S = 60  # interval of the renewals


@dataclass(frozen=True)
class Holder:
    """Program that has a job open.

    Attributes
    ----------
    user, machine : str
        Login name and name of the machine.
    is_silent : bool
        Whether it has not renewed its lock for `SILENT_S`.
    """

    user: str
    machine: str
    is_silent: bool


def lock_path(source):
    """Path of the lock of a job."""
    source = Path(source)
    if source.is_file():
        return source.with_name(f".{source.name}.open.json")
    return source / ".open.json"


class JobLock:
    """Lock of a job for a program.

    Parameters
    ----------
    source : Path
        Folder or workbook of the job.
    owner : str
        Identifier of the program, as of `new_owner`.
    """

    def __init__(self, source, owner):
        self.path, self.owner = lock_path(source), owner

    def acquire(self, *, by_force=False):
        """Lock the job unless another program has it open.

        Parameters
        ----------
        by_force : bool, optional
            Whether to take the job over from a silent program.

        Returns
        -------
        Holder or None
            The other program; None: this program has the lock, or no lock can be written here.
        """
        content = self._read()
        if content is None:
            return self._create()
        if content.get("owner") == self.owner:
            return None
        is_silent = self._age_s() > SILENT_S
        if _has_ended(content) or (is_silent and by_force):
            with suppress(OSError):
                self.path.unlink()
            return self._create()
        named = [str(content.get(key) or "?") for key in ("user", "machine")]
        return Holder(*named, is_silent)

    def _create(self):
        """Write the lock, unless another program writes it at this moment."""
        content = {"owner": self.owner, "user": _user(), "machine": platform.node(),
                   "process": os.getpid()}  # fmt: skip
        try:
            handle = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except FileExistsError:
            other = self._read() or {}
            return Holder(str(other.get("user") or "?"), str(other.get("machine") or "?"), False)
        except OSError:
            return None  # a folder without write access cannot be edited anyway
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(content, file)
        return None

    def renew(self):
        """Renew the time of the lock if this program has it."""
        if (self._read() or {}).get("owner") == self.owner:
            with suppress(OSError):
                os.utime(self.path)

    def release(self):
        """Remove the lock if this program has it."""
        if (self._read() or {}).get("owner") == self.owner:
            with suppress(OSError):
                self.path.unlink()

    def _read(self):
        """Content of the lock; {} if it cannot be read, None if there is none."""
        try:
            content = json.loads(self.path.read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    def _age_s(self):
        """Time since the last renewal by the clock of the file system."""
        try:
            with NamedTemporaryFile(dir=self.path.parent, prefix=".clock-") as file:
                now = os.fstat(file.fileno()).st_mtime
            return now - self.path.stat().st_mtime
        except OSError:
            return 0.0


def new_owner():
    """New identifier of a program."""
    return secrets.token_hex(8)


def _user():
    """Login name, or "" if it is not known."""
    with suppress(Exception):  # getpass raises several, by system
        return getpass.getuser()
    return ""


def _has_ended(content):
    """Whether the process of a lock of this machine has ended."""
    process = content.get("process")
    if content.get("machine") != platform.node() or not isinstance(process, int) or process < 1:
        return False
    if os.name != "posix":  # a signal 0 would stop the process there
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False


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


FILE, FORMAT = "review.toml", "tankcal-review 1"
MOST_TEXT = 2000  # letters of a remark or a reason


class Act(StrEnum):
    """Kind of an event; the values are keys of the words."""

    SUBMITTED = "submitted"
    REMARK = "remark"
    RESOLVED = "resolved"
    RETURNED = "returned"
    REVIEWED = "reviewed"
    APPROVED = "approved"
    REVISED = "revised"


DECISIONS = (Act.SUBMITTED, Act.RETURNED, Act.REVIEWED, Act.APPROVED, Act.REVISED)
WITH_INPUT = (Act.SUBMITTED, Act.APPROVED)  # events with a copy of the input
# Decisions that may follow a decision about a record; None: no decision.
NEXT = {
    None: (Act.SUBMITTED,),
    Act.SUBMITTED: (Act.RETURNED, Act.REVIEWED, Act.APPROVED),
    Act.REVIEWED: (Act.RETURNED, Act.APPROVED),
    Act.RETURNED: (Act.SUBMITTED,),
    Act.APPROVED: (Act.REVISED,),
}


@dataclass(frozen=True)
class Event:
    """An event of a review.

    Attributes
    ----------
    act : Act
        Kind.
    name : str
        Name of the person.
    time : datetime
        Time, UTC.
    record_sha256 : str
        SHA-256 of the record to which the event belongs.
    text, place : str
        Remark or reason, and the cell to which a remark belongs ("points.csv, 17, x_m").
    number : int
        Place in the file from 1; of a resolved remark, the number of the remark.
    """

    act: Act
    name: str
    time: datetime
    record_sha256: str
    text: str = ""
    place: str = ""
    number: int = 0


def folder_of(source):
    """Folder of the review of a job (Path): `review`, or NAME-review beside a workbook."""
    results = default_folder(Path(source))
    return results.with_name(re.sub("results$", "review", results.name))


def read_events(source):
    """Read the events of the review of a job, in their order.

    Parameters
    ----------
    source : Path
        Folder or workbook of the job.

    Returns
    -------
    tuple of Event

    Raises
    ------
    InputError
        If the file is not as this module writes it.
    """
    try:
        content = tomllib.loads((folder_of(source) / FILE).read_text(encoding="utf-8"))
        if content["format"] != FORMAT:
            raise ValueError(content["format"])
        return tuple(
            Event(
                Act(item["act"]), str(item["name"]), item["time"].astimezone(UTC),
                str(item["record_sha256"]), str(item.get("text", "")), str(item.get("place", "")),
                int(item.get("number", number)),
            )
            for number, item in enumerate(content.get("event", ()), 1)
        )  # fmt: skip
    except FileNotFoundError:
        return ()
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        text = message("review_unreadable", "cannot be read; restore it from a backup")
        raise InputError(Problem(FILE, text)) from error


def find_decision(events, record_sha256):
    """Last decision about a record, or None; after a revision, there is none."""
    last = None
    for event in events:
        if event.record_sha256 == record_sha256 and event.act in DECISIONS:
            last = None if event.act is Act.REVISED else event
    return last


def list_submitters(events, record_sha256):
    """Names of the persons who submitted a record."""
    names = {
        event.name for event in events
        if event.act is Act.SUBMITTED and event.record_sha256 == record_sha256
    }  # fmt: skip
    return sorted(names)


def list_remarks(events):
    """List of (remark, event that resolved it or None)."""
    resolved = {event.number: event for event in events if event.act is Act.RESOLVED}
    return [(event, resolved.get(event.number)) for event in events if event.act is Act.REMARK]


def add_event(draft, act, name, record_sha256, text="", place="", number=0):
    """Append an event to the review of a job; submission and approval copy the input.

    Parameters
    ----------
    draft : Draft
        Saved job.
    act : Act
    name, record_sha256, text, place : str
        As in `Event`.
    number : int, optional
        Number of the remark that is resolved.

    Raises
    ------
    InputError
        If the decision may not follow the last decision, if a name or a reason is missing, or if
        no remark has the number.
    """
    events, name = read_events(draft.source), _plain_review(name)
    text = _plain_review(text)[:MOST_TEXT]
    _refuse_event(events, act, name, record_sha256, text, number)
    entries = {
        "act": str(act), "name": name, "record_sha256": record_sha256, "text": text,
        "place": _plain_review(place),
    }  # fmt: skip
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}"
             for key, value in entries.items() if value]  # fmt: skip
    lines.append(f"time = {datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}")
    if number:
        lines.append(f"number = {number}")
    folder = folder_of(draft.source)
    folder.mkdir(exist_ok=True)
    if act in WITH_INPUT:
        copy = f"{len(events) + 1}-{record_sha256[:12]}.zip"
        (folder / copy).write_bytes(_pack_input(draft))
    path = folder / FILE
    head = "" if path.exists() else f'format = "{FORMAT}"\n'
    with path.open("a", encoding="utf-8", newline="\n") as file:
        file.write(head + "\n".join(["", "[[event]]", *lines]) + "\n")


def _plain_review(text):
    """Text in one line without control characters."""
    return " ".join(re.sub(r"[\x00-\x1f\x7f\ud800-\udfff]", " ", text).split())


def _refuse_event(events, act, name, record_sha256, text, number):
    """Raise InputError for an event that cannot follow."""
    last = find_decision(events, record_sha256)
    if not name:
        expected = message("review_no_name", "missing; expected the name of the person")
        raise InputError(Problem("name", expected))
    if act in DECISIONS and act not in NEXT[last and last.act]:
        expected = message(
            "review_not_now", "not possible now; the results were decided on meanwhile. Read the "
            "page again",
        )  # fmt: skip
        raise InputError(Problem(FILE, expected))
    if act in (Act.RETURNED, Act.REVISED, Act.REMARK) and not text:
        expected = message("review_no_reason", "missing; expected a reason or a remark")
        raise InputError(Problem("text", expected))
    if act is Act.RESOLVED and number not in {
        remark.number for remark, resolved in list_remarks(events) if resolved is None
    }:
        expected = message("review_no_remark", "no open remark has this number")
        raise InputError(Problem("number", expected))


def _pack_input(draft):
    """Zip with the files of a draft."""
    folder, buffer = draft.source.parent if draft.is_book else draft.source, io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in draft.digests():
            with suppress(FileNotFoundError):
                archive.writestr(name, (folder / name).read_bytes())
    return buffer.getvalue()


# ---- changes since an earlier record


@dataclass(frozen=True)
class Change:
    """A changed cell, setting or row.

    Attributes
    ----------
    name : str
        Table, list, or "job".
    row : int or str
        Row from 1 in the present table (in the earlier table for a removed row); section of a key.
    column : str
        Column or key; "" for a whole row.
    before, after : str or None
        Texts; None: the row or key does not exist.
    """

    name: str
    row: int | str
    column: str
    before: str | None
    after: str | None


def find_copy(source, events, record_sha256):
    """Event and path of the last copy of the input of another record; (None, None) without any.

    An approved copy has precedence, because its table may be in use.
    """
    others = [event for event in events
              if event.act in WITH_INPUT and event.record_sha256 != record_sha256]  # fmt: skip
    approved = [event for event in others if event.act is Act.APPROVED]
    for event in reversed(approved or others):
        path = folder_of(source) / f"{event.number}-{event.record_sha256[:12]}.zip"
        if path.is_file():
            return event, path
    return None, None


def list_changes(path, draft):
    """List the changes of a draft since a copy of its input.

    Parameters
    ----------
    path : Path
        Zip that `add_event` wrote.
    draft : Draft

    Returns
    -------
    list of Change
    """
    from tankcal.products.desk.draft import Draft

    with TemporaryDirectory() as folder, zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            if Path(name).name == name:
                (Path(folder) / name).write_bytes(archive.read(name))
        source = Path(folder) / draft.source.name if draft.is_book else Path(folder)
        earlier = Draft.open(source)
    changes = []
    for name in dict.fromkeys([*earlier.keys, *draft.keys]):
        changes += _compare_keys(name, earlier.keys.get(name), draft.keys.get(name))
    for name in dict.fromkeys([*earlier.tables, *draft.tables]):
        changes += _compare_rows(name, earlier.tables.get(name), draft.tables.get(name))
    return changes


def _compare_keys(name, earlier, present):
    before, after = (
        {} if keys is None else {(entry.owner, entry.key): entry.text for entry in keys.entries}
        for keys in (earlier, present)
    )
    return [
        Change(name, *place, before.get(place), after.get(place))
        for place in dict.fromkeys([*before, *after])
        if (before.get(place) or "") != (after.get(place) or "")
    ]


def _compare_rows(name, earlier, present):
    """Changes of a table; rows are matched by their content."""
    tables = [table for table in (earlier, present) if table is not None]
    shared = list(dict.fromkeys(heading for table in tables for heading in table.headings))
    before, after = (_list_rows(table, shared) for table in (earlier, present))
    changes = []
    matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
    for _, low, high, start, stop in matcher.get_opcodes():
        if before[low:high] == after[start:stop]:
            continue
        pairs = zip_longest(before[low:high], after[start:stop])
        for step, (old, new) in enumerate(pairs):
            if old is None or new is None:
                row = (low if new is None else start) + step + 1
                texts = (None if item is None else "; ".join(filter(None, item))
                         for item in (old, new))  # fmt: skip
                changes.append(Change(name, row, "", *texts))
                continue
            changes += [
                Change(name, start + step + 1, heading, first, second)
                for heading, first, second in zip(shared, old, new, strict=True)
                if first != second
            ]
    return changes


def _list_rows(table, headings):
    """Rows of a table that are not blank, with the cells of these headings."""
    if table is None:
        return []
    rows = [dict(zip(table.headings, row.cells, strict=False)) for row in table.rows
            if not row.is_blank]  # fmt: skip
    return [tuple(row.get(heading, "") for heading in headings) for row in rows]


def record_digest(out):
    """SHA-256 of the record in a folder of results; "" without a record."""
    with suppress(OSError):
        return digest_of(Path(out) / "record.json")
    return ""


RECORD = "record.json"
HASHED_BYTES = 50_000_000  # larger files are compared by size and time of the last change


class State(StrEnum):
    """State of a job; the values are keys of the words."""

    GONE = "gone"  # neither folder nor workbook
    DRAFT = "draft"  # with problems
    READY = "ready"  # without problems and without results
    COMPUTED = "computed"  # the results belong to the files
    STALE = "stale"  # the files were changed after the computation
    SUBMITTED = "submitted"  # in review
    REVIEWED = "reviewed"  # to be approved
    RETURNED = "returned"  # by the reviewer
    APPROVED = "approved"
    ISSUED = "issued"  # in the register, as the two that follow
    REPLACED = "replaced"
    WITHDRAWN = "withdrawn"


@dataclass(frozen=True)
class JobState:
    """State of a job.

    Attributes
    ----------
    state : State
        State.
    problems : int
        Number of problems of a draft.
    tank, kind : str
        Name and kind of the tank; "" if the settings do not state them.
    changed_s : float
        Time of the last change of a file, seconds since 1970.
    person : str
        Name of the person who decided on the results; "" without a decision.
    record_sha256 : str
        SHA-256 of results that belong to the files.
    number : str
        Number of the certificate in the register.
    """

    state: State
    problems: int = 0
    tank: str = ""
    kind: str = ""
    changed_s: float = 0.0
    person: str = ""
    record_sha256: str = ""
    number: str = ""


def state_of(source, out=None):
    """Determine the state of a job from its files.

    Parameters
    ----------
    source : Path
        Folder or workbook of the job.
    out : Path, optional
        Folder of the results; by default that of `tankcal run`.

    Returns
    -------
    JobState
    """
    from tankcal.products.desk.draft import Draft

    source = Path(source)
    out = default_folder(source) if out is None else Path(out)
    try:
        draft = Draft.open(source)
    except InputError:
        return JobState(State.GONE)
    named = draft.value("tank", "id"), draft.kind or ""
    folder = source.parent if source.is_file() else source
    paths = [folder / name for name in draft.digests()]
    changed = max((path.stat().st_mtime for path in paths if path.is_file()), default=0.0)
    results = state_of_results(folder, out)
    if results is State.COMPUTED:
        digest, decision = record_digest(out), None
        with suppress(InputError):  # the page of the review shows why it cannot be read
            decision = find_decision(read_events(source), digest)
        if decision is not None:
            results, person = State(decision.act), decision.name
            return JobState(results, 0, *named, changed, person, digest)
        return JobState(results, 0, *named, changed, "", digest)
    if results is not None:
        return JobState(results, 0, *named, changed)
    try:
        load(source)
    except InputError as error:
        return JobState(State.DRAFT, len(error.problems), *named, changed)
    return JobState(State.READY, 0, *named, changed)


def state_of_results(folder, out):
    """Return COMPUTED or STALE for results in a folder; None without results."""
    record = out / RECORD
    try:
        files = json.loads(record.read_bytes())["files"]
        computed_s = record.stat().st_mtime
        for file in files:
            path = folder / file["file"]
            if not path.is_file() or path.stat().st_size != file["bytes"]:
                return State.STALE
            if file["bytes"] > HASHED_BYTES:
                is_unchanged = path.stat().st_mtime <= computed_s
            else:
                digest = hashlib.sha256(path.read_bytes()).hexdigest()
                is_unchanged = digest == file["sha256"]
            if not is_unchanged:
                return State.STALE
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return State.COMPUTED


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
        files += [default_folder(source) / "record.json", folder_of(source) / FILE]
        stats = [(path.name, path.stat()) for path in sorted(files) if path.is_file()]
    except OSError:
        return None
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats) or None
