"""Review and approval of results: events in a file beside the job, with copies of the input.

The folder `review` (NAME-review beside a workbook) contains review.toml, to which events are only
appended, and a zip of the input for each submission and approval. An event holds for the record
whose SHA-256 it states: results that were computed again are neither submitted nor approved.
"""

import difflib
import io
import json
import re
import tomllib
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.record.manifest import digest_of
from tankcal.report.folders import default_folder

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
    events, name = read_events(draft.source), _plain(name)
    text = _plain(text)[:MOST_TEXT]
    _refuse_event(events, act, name, record_sha256, text, number)
    entries = {
        "act": str(act), "name": name, "record_sha256": record_sha256, "text": text,
        "place": _plain(place),
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


def _plain(text):
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
