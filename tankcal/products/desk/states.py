"""State of a job, determined from its files alone."""

import hashlib
import json
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from tankcal.errors import InputError
from tankcal.job.loading import load
from tankcal.products.desk.review import find_decision, read_events, record_digest
from tankcal.report.folders import default_folder

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
