"""Reading of an upkeep: upkeep.toml, meters.csv, the logs and the record of the tank."""

import hashlib
import os
import tomllib
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np

from tankcal import record as records
from tankcal.errors import InputError, Problem
from tankcal.job.contract.keys import CSV
from tankcal.job.entries import read_columns
from tankcal.job.fields import Field, choice, number, positive
from tankcal.job.folder import read_csv
from tankcal.job.tables import Log, read_bytes, shown
from tankcal.messages import message
from tankcal.products.quantity.table import read_table
from tankcal.products.settings import EmptyFiles, fill_blanks, read_sections
from tankcal.products.upkeep.causes import PRIORS, Meter, Operation, TableStock
from tankcal.products.upkeep.flows import quiet_windows, read_flows
from tankcal.products.upkeep.levels import MOST_OFFSET_S, LevelSums, compare_own_volumes, find_water
from tankcal.products.upkeep.logs import Findings, LogFile, read_log_profile
from tankcal.products.upkeep.saved import NO_STATE
from tankcal.products.upkeep.start import (
    DRAWING,
    SALES,
    WITHOUT_TABLE,
    LyingStock,
    check_drawing,
    open_start,
)
from tankcal.products.upkeep.steps import REASONS, StepRules, Tickets, build_steps
from tankcal.record.manifest import digest_of
from tankcal.text.shipped import LANGUAGES

FIXED = ("settings", "record")  # kinds of files that are no logs
SETTINGS, METERS = "upkeep.toml", "meters.csv"
LOGS = ("levels", "meters", "deliveries", "events", "air")
ASKED = {("upkeep", "record"), ("upkeep", "timezone"), ("levels", "files"), ("meters", "files")}
EVENTS = (
    "proving", "adjusted", "gauge_set", "dip", "water_drawn", "product_changed", "opened",
    "repaired", "clock_set", "table_changed",
)  # fmt: skip
BROKEN_BY = {  # events that no step may contain
    "gauge_set": "adjusted", "water_drawn": "water_drawn", "product_changed": "adjusted",
    "opened": "adjusted", "repaired": "adjusted", "table_changed": "adjusted",
}  # fmt: skip
NEW_OFFSET = ("gauge_set", "product_changed")  # events after which the gauge has another offset
SERVICES = {  # settle_s, rest_h, least_delivery_m3, noise_mm if upkeep.toml declares none
    "station": {"settle_s": 120.0, "rest_h": 2.0, "least_delivery_m3": 0.3, "noise_mm": 0.3},
    "terminal": {"settle_s": 1800.0, "rest_h": 12.0, "least_delivery_m3": 10.0, "noise_mm": 1.0},
}
UNTRACEABLE_PERCENT = 1.0  # u of the common factor of meters without a certificate
UNUSED_WARNED, UNUSED_REFUSED = 0.05, 0.30  # share of the readings of a level log


def _files(kind):
    """Keys of the section of a log."""
    return (
        Field("files", "names", "names of the files, or patterns such as levels-*.csv"),
        Field("profile", "text", "shipped profile, or a TOML file in the folder"),
        *((Field("net", "flag", "volumes are at the base temperature"),)
          if kind in ("meters", "deliveries") else ()),
    )  # fmt: skip


SECTIONS = {
    "upkeep": (
        Field("record", "text", "record.json of the tank, a table or a job"),
        Field("timezone", "text", "IANA name of local times"),
        choice("service", "", tuple(SERVICES), required=True),
        choice("language", "", LANGUAGES),
        number("coverage_probability", "", 0.5, 0.9999),
        *(Field(name, "text", "") for name in ("site", "by", "note", "notice")),
    ),
    "liquid": (
        Field("name", "text", ""),
        number("expansion_per_k", "cubic", 0, 0.01, required=True),
        number("base_c", "base temperature", -20, 60, required=True),
    ),
    "gauge": (
        positive("resolution_mm", "smallest step of the indication", 100, required=True),
        positive("noise_mm", "standard deviation of a reading", 20),
        positive("settle_s", "after a flow", 1e5),
        positive("rest_h", "after a delivery", 200),
        positive("least_delivery_m3", "", 1e4),
    ),
    "drawing": DRAWING,
    **{kind: _files(kind) for kind in ("levels", "meters", "deliveries", "events", "air")},
    "priors": tuple(number(name, "", 0, 1e6) for name in PRIORS["station"]),
    "watch": (number("false_alarm_per_year", "", 0.001, 1.0),),
    "csv": CSV,
}
METER_COLUMNS = (
    Field("meter", "name", "", required=True),
    positive("factor", "", 2),
    positive("u_factor_ppm", "", 1e5),
    number("walk_ppm", "per root of a year", 0, 1e5),
    number("wear_ppm", "per year", -1e5, 1e5),
    number("u_wear_ppm", "per year", 0, 1e5),
    Field("certificate", "text", ""),
)

NO_VALUES = message("upkeep_no_values", "no row has a valid time and value; expected such rows")


@dataclass(frozen=True)
class LogSource:
    """File of a log: kind, name, SHA-256, number of rows, first and last time in ns UTC."""

    kind: str
    file: str
    sha256: str
    rows: int | None = None
    first_ns: int | None = None
    last_ns: int | None = None


@dataclass(frozen=True)
class Inputs:
    """Checked input of an upkeep.

    Attributes
    ----------
    sections : dict
        {section: {key: value}} of upkeep.toml.
    operation : causes.Operation
    steps : steps.Steps
    findings : logs.Findings
    sources : tuple of LogSource
        Files in the order of reading; the first two are upkeep.toml and record.json.
    pieces : int
        Number of quiet pieces.
    traceable : dict of {str: str}
        Certificates of the traceable meters.
    warnings : tuple of Problem
    folder : Path
        Folder of upkeep.toml, from which the names of the files lead.
    record_path : Path or None
        Record of the table in force; None: no calibration.
    start : str
        A value of saved.STARTS.
    former_upkeep : dict or None
        Everyday data that this table contains already.
    clock : tuple of (int, float) or None
        First time (ns) and largest offset in seconds of a wrong clock of the levels.
    """

    sections: dict
    operation: Operation
    steps: object
    findings: Findings
    sources: tuple
    pieces: int
    traceable: dict
    warnings: tuple
    folder: Path = None
    record_path: Path | None = None
    former_upkeep: dict | None = None
    start: str = SALES
    holder: object = None  # keeps the folder of a computed record
    clock: tuple | None = None

    def files(self):
        """`InputFile`s in the order of reading."""
        # Only a new record has them, and a month without one loads less.
        from tankcal.job.model import InputFile

        return [InputFile(source.file, source.sha256, (self.folder / source.file).stat().st_size)
                for source in self.sources]  # fmt: skip

    def operation_of_meters(self):
        """`Operation` whose common factor has the u of meters without a certificate, if so."""
        if self.traceable:
            return self.operation
        priors = self.operation.priors
        common = max(priors["meters_common_percent"], UNTRACEABLE_PERCENT)
        return replace(self.operation, priors=priors | {"meters_common_percent": common})

    @property
    def table(self):
        """Capacity table in force."""
        return self.operation.stock.table


def find_record(folder):
    """Record that upkeep.toml of a folder names; None if it cannot be found.

    Parameters
    ----------
    folder : path

    Returns
    -------
    Path or None
    """
    folder = Path(folder)
    try:
        settings = tomllib.loads((folder / SETTINGS).read_text(encoding="utf-8"))
        path = folder / settings["upkeep"]["record"]
    except (OSError, ValueError, LookupError, TypeError):
        return None  # `read_upkeep` reports it
    path = path / "record.json" if path.is_dir() else path
    return path if path.is_file() and path.suffix == ".json" else None


def read_upkeep(folder, state=NO_STATE, source=None):
    """Read the settings and all logs of a tank, clean them and build its steps.

    Parameters
    ----------
    folder : path
        Folder with upkeep.toml, or its upkeep.toml.
    state : state.State, optional
        Results of earlier runs; sums of known files are taken from there.
    source : str, optional
        In place of `record` of upkeep.toml, from the folder on: a record, a table of another
        laboratory, a job, or WITHOUT_TABLE.

    Returns
    -------
    Inputs

    Raises
    ------
    InputError
        With every problem of the files.
    """
    folder, log = Path(folder).absolute(), Log()
    settings = folder if folder.suffix == ".toml" else folder / SETTINGS
    folder = settings.parent
    if not settings.is_file():
        text = message("upkeep_no_settings", "no {file}; expected it in this folder: tankcal "
                       "upkeep {name} --new writes empty input files", file=settings.name,
                       name=folder.name)  # fmt: skip
        raise InputError(Problem(folder.name, text))
    sections, places, marks = read_sections(settings, SECTIONS, log)

    def tell(key, text):
        log.problem(settings.name, text, places.get(key), key)

    zone = sections["upkeep"]["timezone"]
    try:
        if zone is None:
            tell("upkeep.timezone", message("upkeep_no_zone", "missing; expected the IANA time "
                 "zone of local times, such as America/Sao_Paulo, or UTC"))  # fmt: skip
        ZoneInfo(zone or "UTC")
    except (ZoneInfoNotFoundError, ValueError):
        tell("upkeep.timezone", message("upkeep_zone", "no time zone {name}; expected an IANA name "
             "such as America/Sao_Paulo", name=shown(zone)))  # fmt: skip
    for kind in ("levels", "meters"):
        if not sections[kind]["files"]:
            tell(f"{kind}.files", message("upkeep_no_files", "missing; expected the files of the "
                 "log"))  # fmt: skip
    log.stop_if_problems()
    start, record = _open_source(source, folder, sections, tell, log)
    findings, sources = Findings(), [LogSource("settings", settings.name, digest_of(settings))]
    for path in () if start is None else start.files:
        name = Path(os.path.relpath(path, folder)).as_posix()
        kind = "record" if path == start.files[0] else "settings"
        sources.append(LogSource(kind, name, digest_of(path)))
    files = {
        kind: _log_files(kind, sections, folder, zone, findings, log, sources)
        for kind in ("events", "meters", "deliveries", "air", "levels")
    }
    meters = _read_meters(folder, marks, log, sources)
    former = record and record.get("upkeep")
    known = {source.sha256: source.file for source in sources if source.kind not in FIXED}
    for digest in sorted(known.keys() & set(former["logs"] if former else ())):
        log.problem(known[digest], message(
            "upkeep_known_log", "the table in force contains this log; expected logs of a later "
            "time: it would count twice"))  # fmt: skip
    _stop_at_problems(files, log)
    expansion, base = (sections["liquid"][key] for key in ("expansion_per_k", "base_c"))
    stock = (
        LyingStock(sections["drawing"], expansion, base)
        if start is None
        else TableStock(read_table(start.path, record), expansion, base)
    )
    for text in () if start is None else start.warnings:
        log.warning(start.files[0].name, text)
    inputs = _build(sections, stock, meters, files, findings, sources, log, state)
    first = np.datetime64(int(inputs.steps.marks.time_ns[0]), "ns").astype("datetime64[D]")
    if former and first < np.datetime64(former["last"]):
        text = message("upkeep_overlap", "steps from {first} on; the table in force contains data "
                       "until {last}; expected later data: they would count twice",
                       first=str(first), last=former["last"])  # fmt: skip
        raise InputError(Problem(files["levels"][0].path.name, text))
    inputs = replace(inputs, folder=folder, former_upkeep=former)
    if start is None:
        return inputs
    return replace(inputs, record_path=start.path, start=start.kind, holder=start.holder)


def _open_source(source, folder, sections, report, log):
    """(`StartTable` or None, its record or None) of a source, or of `record` of upkeep.toml."""
    source = source or sections["upkeep"]["record"]
    sections["upkeep"]["record"] = source
    if source is None:
        report("upkeep.record", message("upkeep_no_source", "missing; expected record.json of the "
             "tank, a table, a job, or {word}", word=WITHOUT_TABLE))  # fmt: skip
    elif source == WITHOUT_TABLE:
        check_drawing(sections["drawing"], report)
    else:
        try:
            start = open_start(folder / source)
            if start is not None:
                return start, records.load(start.path)
        except InputError as error:
            log.problems.extend(error.problems)
        else:
            report("upkeep.record", message("upkeep_no_record", "found {name}, where no record, "
                 "table or job is; expected record.json of the tank, a table, or a job folder",
                 name=shown(source)))  # fmt: skip
    return None, None


def _log_files(kind, sections, folder, zone, findings, log, sources):
    """`LogFile`s of a section, in the order of their names; a file that comes twice is refused."""
    section, files = sections[kind], []
    if not section["files"]:
        return []
    profile = read_log_profile(section["profile"], kind, folder, log)
    for pattern in section["files"]:
        paths = sorted(folder.glob(pattern)) if set(pattern) & set("*?[") else [folder / pattern]
        if not paths or not all(path.is_file() for path in paths):
            text = message("upkeep_no_file", "no file {name}; expected a file in the folder",
                           name=shown(pattern))  # fmt: skip
            log.problem(SETTINGS, text, None, f"{kind}.files")
            continue
        for path in paths:
            digest = hash_file(path)
            twin = next((source.file for source in sources if source.sha256 == digest), None)
            if twin is not None and path.stat().st_size:  # an empty file is no copy
                text = message("upkeep_file_twice", "content equal to that of {twin}; expected "
                               "each log once: it would count twice", twin=twin)  # fmt: skip
                log.problem(path.name, text)
                continue
            sources.append(LogSource(kind, path.relative_to(folder).as_posix(), digest))
            files.append(LogFile(path, kind, profile, zone, findings, log, digest))
    return files if profile is not None else []


def hash_file(path):
    """SHA-256 of a file, read in pieces."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _read_meters(folder, marks, log, sources):
    """{name: (`Meter`, certificate or None)} of meters.csv; empty without the file."""
    path = folder / METERS
    if not path.is_file():
        return {}
    data = read_bytes(path, log)
    raw = None if data is None else read_csv(METERS, data, *marks, log, SETTINGS)
    table = None if raw is None else read_columns(None, raw, log, METER_COLUMNS)
    if table is None:
        return {}
    sources.append(LogSource("settings", METERS, hash_file(path)))

    def ppm(row, name):
        value = row[name]
        return None if value is None or np.isnan(value) else 1e-6 * value

    meters = {}
    for row in table.records():
        factor = row["factor"]
        has_factor = factor is not None and not np.isnan(factor)
        meter = Meter(row["meter"], factor if has_factor else 1.0, ppm(row, "u_factor_ppm"),
                      ppm(row, "walk_ppm"), ppm(row, "wear_ppm"), ppm(row,
                      "u_wear_ppm"))  # fmt: skip
        meters[row["meter"]] = meter, row["certificate"] or None
    return meters


def _build(sections, stock, meters, files, findings, sources, log, state):
    """`Inputs` of the opened files."""
    table = stock.table
    service = sections["upkeep"]["service"]
    rules = fill_blanks(sections["gauge"], SERVICES[service])
    quantum = sections["gauge"]["resolution_mm"] / 1000
    priors = fill_blanks(sections["priors"], PRIORS[service])
    events = _read_events(files["events"], log)
    adjusted = [(event["meter"], event["time"]) for event in events if event["kind"] == "adjusted"]
    flows = read_flows(files["meters"], adjusted)
    tickets = _read_tickets(files["deliveries"], findings)
    air = _read_air(files["air"], log)
    if not log.problems and not any(len(flow.time_ns) for flow in flows):
        text = message("upkeep_no_flow", "no metered volume; expected sales or receipts")
        log.problem(files["meters"][0].path.name, text)
    _stop_at_problems({"events": (), "levels": files["levels"]}, log)
    _refuse_copies(files["meters"] + files["deliveries"], log)
    span = 400 * 86400 * 10**9
    first = min(flow.begin_ns.min() for flow in flows if len(flow.time_ns)) - span
    last = max(flow.time_ns.max() for flow in flows if len(flow.time_ns)) + span
    windows = quiet_windows(flows, rules["settle_s"], first, last)
    sums = LevelSums(windows, quantum, flows, table.volume)
    sums.read(files["levels"], state)
    for file in files["levels"]:
        compare_own_volumes(file, table, findings, events, log)
    if not log.problems and not findings.number("levels", "row"):
        log.problem(files["levels"][0].path.name, NO_VALUES)
    log.stop_if_problems()
    pieces = sums.means(findings)
    inside = ~table.is_outside(pieces.level_m)
    findings.add("levels", "outside_table", pieces.time_ns[~inside], pieces.count[~inside].sum())
    pieces = pieces.select(inside)
    find_water(pieces, table, events, files["levels"][0].path.name, log)
    rules = StepRules(quantum, rules["noise_mm"] / 1000, rules["rest_h"],
                      rules["least_delivery_m3"], float(np.ptp(table.height_m)))  # fmt: skip
    broken = [(event["time"], REASONS.index(BROKEN_BY[event["kind"]]))
              for event in events if event["kind"] in BROKEN_BY]  # fmt: skip
    steps = build_steps(pieces, flows, tickets, table.volume, rules, findings, broken)
    if not len(steps):
        text = message("upkeep_no_steps", "no step between two quiet levels; expected levels "
                       "before and after sales, in a common time zone")  # fmt: skip
        raise InputError(Problem(files["levels"][0].path.name, text))
    clock = None
    if findings.number("levels", "clock_offset"):
        offset = max((offset for _, offset in sums.offsets), key=abs)
        text = message("upkeep_clock", "the clock of the levels is {offset:.0f} s late against the "
                       "meters (negative: early); expected at most {most:.0f} s", offset=offset,
                       most=MOST_OFFSET_S)  # fmt: skip
        log.warning(files["levels"][0].path.name, text, column="time")
        clock = int(findings.counts["levels", "clock_offset"][1]), float(offset)
    _judge_cleaning(findings, sums.interpolated_share(), files["levels"][0].path.name, log)
    log.stop_if_problems()
    operation = Operation(
        stock, {name: meter for name, (meter, _) in meters.items()}, priors, air,
        {kind: bool(sections[kind]["net"]) for kind in ("meters", "deliveries")},
        int(steps.marks.time_ns[0]),
        tuple(sorted({event["time"] for event in events if event["kind"] in NEW_OFFSET})),
    )  # fmt: skip
    traceable = {name: number for name, (_, number) in meters.items() if number}
    for flow in flows:
        if meters and flow.name not in meters:
            log.warning(METERS, message("upkeep_meter_unlisted", "meter {name} of the log is not "
                        "listed; its factor is taken as 1 with the prior u",
                        name=flow.name))  # fmt: skip
    spans = {file.digest: file.span for kind in files.values() for file in kind}
    sources = [replace(source, **dict(zip(("rows", "first_ns", "last_ns"),
                                          spans.get(source.sha256, ()), strict=False)))
               for source in sources]  # fmt: skip
    return Inputs(sections, operation, steps, findings, tuple(sources), len(pieces), traceable,
                  tuple(log.warnings), clock=clock)  # fmt: skip


def _stop_at_problems(unread, log):
    """Raise InputError with the problems of the log, and of the logs {kind: files} not yet read."""
    if log.problems:
        _read_events(unread["events"], log)
        for kind in [kind for kind in unread if kind != "events"]:
            for file in unread[kind]:
                deque(file.chunks(), maxlen=0)  # each chunk reports its problems
    log.stop_if_problems()


def _refuse_copies(files, log):
    """Report files with the rows and times of another file, such as a copy with other line ends."""
    known = {}
    for file in files:
        twin = known.setdefault((file.kind, *file.span), file)
        if twin is not file and file.span[0]:
            log.problem(file.path.name, message(
                "upkeep_rows_twice", "as many rows as {twin}, with equal first and last time; "
                "expected each log once: it would count twice", twin=twin.path.name))  # fmt: skip


def _judge_cleaning(findings, interpolated, file, log):
    """Warn of, or refuse, a level log of which too many rows are unused or interpolated."""
    if interpolated > UNUSED_WARNED:
        text = message("upkeep_interpolated", "in {share:.0f} % of the long rests the levels are "
                       "on sloping lines of a historian that interpolates; expected readings "
                       "without compression, at most {most:.0f} %", share=100 * interpolated,
                       most=100 * UNUSED_REFUSED)  # fmt: skip
        (log.problem if interpolated > UNUSED_REFUSED else log.warning)(file, text)
    rows = findings.number("levels", "row")
    unused = sum(findings.number("levels", kind)
                 for kind in ("stuck", "interpolated", "bad_quality", "not_a_number",
                              "other_value", "doubled_hour", "no_time"))  # fmt: skip
    share = unused / max(rows, 1)
    if share > UNUSED_WARNED:
        text = message("upkeep_much_unused", "{share:.0f} % of the levels are unused (see "
                       "cleaning.csv); expected at most {most:.0f} %", share=100 * share,
                       most=100 * UNUSED_REFUSED)  # fmt: skip
        (log.problem if share > UNUSED_REFUSED else log.warning)(file, text)


def _read_events(files, log):
    """Events in order of time: dicts with time, kind, meter, value."""
    events = []
    for file in files:
        for chunk in file.chunks():
            for place, kind in enumerate(chunk["kind"]):
                kind = str(kind).strip()
                if kind not in EVENTS:
                    text = message("upkeep_event", "found {kind}; expected a kind of {kinds}",
                                   kind=shown(kind), kinds=", ".join(EVENTS))  # fmt: skip
                    log.problem(file.path.name, text, int(chunk["row"][place]), "kind")
                if kind == "product_changed":
                    text = message("upkeep_product_changed", "the product changed: another density "
                                   "moves the float, so the gauge has a new offset; the expansion "
                                   "is that of [liquid] throughout. Expected an upkeep for each "
                                   "product")  # fmt: skip
                    log.warning(file.path.name, text, int(chunk["row"][place]), "kind")
                meter = chunk["meter"][place] if "meter" in chunk else None
                events.append(
                    {"time": int(chunk["time"][place]), "kind": kind,
                     "meter": meter if isinstance(meter, str) else None}
                )  # fmt: skip
    return sorted(events, key=lambda event: event["time"])


def _read_tickets(files, findings):
    """`Tickets` in order of time, each once."""
    parts = [chunk for file in files for chunk in file.chunks()]
    if not parts:
        empty = np.zeros(0)
        return Tickets(empty.astype(np.int64), empty, empty, empty.astype(int))

    def column(name):
        return np.concatenate(
            [part.get(name, np.full(len(part["time"]), np.nan)) for part in parts]
        )

    time, volume, temperature, row = map(column, ("time", "volume", "temperature", "row"))
    is_known = np.isfinite(volume.astype(float)) & (volume.astype(float) > 0)
    findings.add("deliveries", "no_volume", time[~is_known])
    _, first = np.unique(np.stack([time, volume]), axis=1, return_index=True)
    is_first = np.isin(np.arange(len(time)), first)
    findings.add("deliveries", "duplicate", time[is_known & ~is_first])
    kept = np.flatnonzero(is_known & is_first)
    kept = kept[np.argsort(time[kept], kind="stable")]
    return Tickets(time[kept].astype(np.int64), volume[kept].astype(float),
                   temperature[kept].astype(float), row[kept])  # fmt: skip


def _read_air(files, log):
    """(times, temperatures) of the air; None without files, or after a problem."""
    parts = [(chunk["time"], chunk["temperature"]) for file in files for chunk in file.chunks()]
    if not parts:
        return None
    time, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    if not np.isfinite(values).any():
        return log.problem(files[0].path.name, NO_VALUES)
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(values[order])]
    return time[order].astype(float), values[order]


EMPTY_FILES = EmptyFiles(
    "upkeep",
    (SETTINGS, SECTIONS),
    (METERS, METER_COLUMNS, "meter", "meters"),
    message("upkeep_exists", "exists already; expected a folder without it"),
    ASKED,
    dict.fromkeys(LOGS, "logs"),
)
