"""Register of certificates: a CSV file whose rows are only appended.

Each row is an event of a certificate. A number is issued once; a certificate that replaces another
certificate names its number first in `replaces` of the job.
"""

import csv
import hashlib
import io
import re
from dataclasses import dataclass, replace
from pathlib import Path

from tankcal import record as records
from tankcal.errors import InputError, Problem
from tankcal.job.certificate_entries import missing_entries
from tankcal.job.entries import read_columns
from tankcal.job.fields import Field, choice
from tankcal.job.folder import read_csv
from tankcal.job.tables import NOT_KNOWN, Log, nearest, read_bytes
from tankcal.messages import message
from tankcal.report.folders import lock_file
from tankcal.report.laboratory import LETTERHEAD_FILE
from tankcal.text.delimited import write_guarded

ISSUED, REPLACED, WITHDRAWN = STATES = ("issued", "replaced", "withdrawn")
COLUMNS = (
    choice("event", "", STATES, required=True),
    Field("date", "date", "", required=True),
    Field("number", "text", "", required=True),
    Field("tank", "text", ""),
    Field("survey_date", "date", ""),
    Field("record_sha256", "text", ""),
    Field("replaced_by", "text", ""),
    Field("reason", "text", ""),
    Field("approved_by", "text", ""),
)
_HEADINGS = tuple(field.name for field in COLUMNS)


@dataclass(frozen=True)
class RegisteredCertificate:
    """A certificate with its present state; dates are ISO texts.

    Attributes
    ----------
    state : str
        One of STATES.
    since : str
        Date of the state.
    record_sha256 : str
        SHA-256 of the record on which the certificate is based.
    replaced_by, reason, approved_by : str
        "" if not replaced, without a reason, or without an approval in the app.
    """

    number: str
    tank: str
    survey_date: str
    issued: str
    record_sha256: str
    state: str = ISSUED
    since: str = ""
    replaced_by: str = ""
    reason: str = ""
    approved_by: str = ""


def read_certificates(path):
    """Return the certificates of a register, {number: RegisteredCertificate}.

    Parameters
    ----------
    path : path
        CSV file; its content is checked event by event.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        With a line for each problem of the file.
    """
    path, log = Path(path), Log()
    data = read_bytes(path, log)
    certificates = {} if data is None else _certificates_of(path.name, data, log)
    log.stop_if_problems()
    return certificates


def _certificates_of(file, data, log):
    table = read_csv(file, data, ",", NOT_KNOWN, log)
    if table is None:
        return {}
    columns = read_columns(None, table, log, COLUMNS)
    if log.problems:
        return {}
    certificates = {}
    for row, event in zip(columns.rows, columns.records(), strict=True):
        event = {key: str(value or "") for key, value in event.items()}
        _add_event(certificates, event, lambda text, row=row: log.problem(file, text, row))
    return certificates


def _add_event(certificates, event, report):
    """Apply an event to the certificates so far, or report why it is impossible."""
    number, known = event["number"], certificates.get(event["number"])
    if event["event"] == ISSUED:
        if known:
            report(_message_of_repetition(number, known))
            return
        certificates[number] = RegisteredCertificate(
            number, event["tank"], event["survey_date"], event["date"], event["record_sha256"],
            since=event["date"], approved_by=event.get("approved_by", ""),
        )  # fmt: skip
    elif reason := _reason_against(known, event, certificates):
        report(reason)
    else:
        certificates[number] = replace(
            known,
            state=event["event"],
            since=event["date"],
            replaced_by=event["replaced_by"],
            reason=event["reason"],
        )


def _message_of_repetition(number, known):
    return message(
        "certificate_number_twice",
        "number {number} was issued on {day}; expected a number that no certificate has",
        number=number,
        day=known.issued,
    )


def _reason_against(known, event, certificates):
    """Return the message why a certificate cannot be replaced or withdrawn; None if it can."""
    number, day = event["number"], event["date"]
    if known is None:
        return message(
            "certificate_not_issued",
            "number {number} is not in the register; expected an issued number{hint}",
            number=number,
            hint=nearest(
                number, [other for other in certificates if other != event["replaced_by"]]
            ),
        )
    if known.state == REPLACED:
        return message(
            "certificate_already_replaced",
            "number {number} was already replaced on {day}; expected a certificate in force",
            number=number,
            day=known.since,
        )
    if known.state == WITHDRAWN:
        return message(
            "certificate_already_withdrawn",
            "number {number} was already withdrawn on {day}; expected a certificate in force",
            number=number,
            day=known.since,
        )
    if day < known.issued:
        return message(
            "certificate_event_too_early",
            "found the date {day}, before the day of issue {issued} of number {number}",
            day=day,
            issued=known.issued,
            number=number,
        )
    return None


def issue(path, sources, approved_by=""):
    """Register the certificates of results as issued, and those that they replace as replaced.

    Parameters
    ----------
    path : path
        Register; a new file is created.
    sources : sequence of path
        Folders of results, or record.json.
    approved_by : str, optional
        Name of the person who approved the results.

    Returns
    -------
    list of RegisteredCertificate
        The certificates issued.

    Raises
    ------
    InputError
        No row is written: a draft, a number already given, an unknown replaced certificate.
    """
    files = [source / "record.json" if source.is_dir() else source for source in map(Path, sources)]
    problems, events = [], []
    for file in files:
        events += _events_of(file, problems)
    if problems:
        raise InputError(problems)
    for event in events:
        if event["event"] == ISSUED:
            event["approved_by"] = approved_by
    return [
        certificate
        for certificate in _append(path, events)
        if certificate.number in {event["number"] for event in events if event["event"] == ISSUED}
    ]


def _events_of(file, problems):
    """Return the events (list of dict) of the certificate of a record; [] with a problem."""
    record = records.load(file)
    job = record["job"]
    certificate, tank = job["certificate"], job["tank"]
    has_letterhead = (file.parent / LETTERHEAD_FILE).is_file()
    if record["capacity"] is None:
        text = message(
            "register_no_table", "no capacity table; expected results with a certificate"
        )
        problems.append(Problem(str(file), text))
        return []
    missing = missing_entries(certificate, tank["details"].get("location"), has_letterhead)
    if missing:
        text = message(
            "register_draft",
            "the certificate is a draft: {missing} not given in [certificate]; expected a complete "
            "certificate",
            missing=", ".join(missing),
        )
        problems.append(Problem(str(file), text))
        return []
    event = dict.fromkeys(_HEADINGS, "") | {
        "event": ISSUED,
        "date": str(certificate["date_of_issue"]),
        "number": str(certificate["number"]).strip(),
        "tank": tank["id"],
        "survey_date": str(job["survey"]["date"]),
        "record_sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
    }
    events = [event]
    if certificate.get("replaces"):
        earlier, reason = _split_number(str(certificate["replaces"]))
        events.append(
            dict.fromkeys(_HEADINGS, "")
            | {
                "event": REPLACED,
                "date": event["date"],
                "number": earlier,
                "tank": tank["id"],
                "replaced_by": event["number"],
                "reason": reason,
            }
        )
    return events


def _split_number(text):
    """Return the number at the beginning of a text, and the rest: "2024-7: owner" -> 2024-7."""
    number, *rest = re.split(r"[:;,\s]+", text.strip(), maxsplit=1)
    return number, "".join(rest)


def withdraw(path, number, reason, day):
    """Register a certificate as withdrawn on an ISO day, and return it (RegisteredCertificate)."""
    event = dict.fromkeys(_HEADINGS, "") | {
        "event": WITHDRAWN,
        "date": day,
        "number": number,
        "reason": reason,
    }
    [certificate] = [
        certificate for certificate in _append(path, [event], new=False)
        if certificate.number == number
    ]  # fmt: skip
    return certificate


def _append(path, events, new=True):
    """Append all events to a register, or none; return its certificates.

    The file stays locked between reading and writing, so that two programs cannot give a number
    twice.
    """
    path = Path(path)
    if not path.exists() and not new:
        raise InputError(Problem(str(path), message("no_register", "no such register")))
    with path.open("a+b") as file:
        if not lock_file(file):
            text = message("register_in_use", "in use by another program; try again")
            raise InputError(Problem(str(path), text))
        file.seek(0)
        data, log = file.read(), Log()
        certificates = _certificates_of(path.name, data, log) if data.strip() else {}
        log.stop_if_problems()
        for event in events:
            _add_event(certificates, event, lambda text: log.problem(path.name, text))
        log.stop_if_problems()
        file.write(_format_rows(events, data).encode())
    return list(certificates.values())


def _format_rows(events, data):
    """Return the text of new rows, in the order of the columns of the file."""
    head = data.decode("utf-8-sig", errors="replace").partition("\n")[0]
    separator = ";" if head.count(";") > head.count(",") else ","
    headings = next(csv.reader([head.strip()], delimiter=separator), []) or _HEADINGS
    stream = io.StringIO()
    if not data.strip():
        write_guarded(stream, [headings], separator)
    elif not data.endswith(b"\n"):
        stream.write("\n")
    rows = [[event.get(heading.strip(), "") for heading in headings] for event in events]
    write_guarded(stream, rows, separator)
    return stream.getvalue()
