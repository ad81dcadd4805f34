"""Logs of gauges and meters: their profiles, their local times, and their rows in chunks.

A profile (TOML) declares the columns, units and times of a file. Rows are read from CSV files by a
profile, or from captures of TLS consoles. A chunk is a mapping {column: values} with the columns of
the profile only: numbers in SI units, times in nanoseconds UTC, also in the doubled hour of autumn.
Rows that cannot be used are counted by kind, with the first and the last time; no value is
corrected.
"""

import csv
import re
import struct
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd

from tankcal.job.entries import read_section
from tankcal.job.fields import Field, choice, number
from tankcal.job.folder import MAX_SETTINGS_BYTES, is_row, read_toml, separator_of_text
from tankcal.job.tables import Log, nearest, read_bytes, unreadable_file
from tankcal.messages import message
from tankcal.products.exports.profiles import LEVEL_UNITS_M, VOLUMES_M3
from tankcal.text.shipped import shipped_folder

MOST_OFFSET_S, OFFSET_STEP_S = 7200, 60  # searched offsets of two clocks
LEAST_SALES = 30  # for an offset
MOST_STEP_M3 = 0.3  # change of the stock in a row beyond it: a delivery
LARGEST_MISFIT = 0.6  # of a right offset, relative to that of an offset two hours away
SWITCH_NS = 900 * 10**9  # smallest fall of a local time that is the change of the clock
NOT_A_TIME = np.iinfo(np.int64).min  # NaT as an integer


class LocalClock:
    """Converts local times of a log to UTC, batch by batch in the order of its rows.

    An hour that occurs twice is resolved by the order of the rows: rows before a fall of the local
    time are in summer time, rows from the fall on in standard time.

    Parameters
    ----------
    zone : str
        IANA name of the time zone.

    Attributes
    ----------
    unresolved : int
        Number of rows in a doubled hour without a fall of the local time; they have no time.
    """

    def __init__(self, zone):
        self.zone, self.unresolved = zone, 0

    def convert(self, local_ns):
        """Convert local times to UTC.

        Parameters
        ----------
        local_ns : ndarray of int64, shape (n,)
            Nanoseconds since 1970 of the local clock; NOT_A_TIME: none.

        Returns
        -------
        utc_ns : ndarray of int64, shape (n,)
            NOT_A_TIME where the local time is missing, unresolved or does not exist.
        is_impossible : ndarray of bool, shape (n,)
            Local times in the hour that is skipped in spring.
        """
        times = pd.DatetimeIndex(local_ns.view("datetime64[ns]"))
        if len(times) == 0:
            return local_ns.copy(), np.zeros(0, dtype=bool)
        # A later offset is that of standard time; both offsets differ in a doubled hour only.
        early, late = (
            times.tz_localize(self.zone, ambiguous=np.full(len(times), is_summer),
                              nonexistent="NaT").asi8
            for is_summer in (True, False)
        )  # fmt: skip
        is_impossible = (early == NOT_A_TIME) & (local_ns != NOT_A_TIME)
        doubled = np.flatnonzero(early != late)
        utc = early.copy()
        # Stretches of rows in a doubled hour: the local times of a stretch are within 3 h.
        ends = np.flatnonzero(np.diff(local_ns[doubled]) > 3 * 3600 * 10**9) + 1
        for rows in np.split(doubled, ends) if len(doubled) else ():
            falls = np.flatnonzero(np.diff(local_ns[rows]) < -SWITCH_NS)
            if len(falls):
                utc[rows[falls[0] + 1 :]] = late[rows[falls[0] + 1 :]]
            else:
                self.unresolved += len(rows)
                utc[rows] = NOT_A_TIME
        return utc, is_impossible

    def is_doubled(self, local_ns):
        """Whether each local time (n,) occurs twice."""
        times = pd.DatetimeIndex(local_ns.view("datetime64[ns]"))
        marked = times.tz_localize(self.zone, ambiguous="NaT", nonexistent="shift_forward")
        return (marked.asi8 == NOT_A_TIME) & (local_ns != NOT_A_TIME)


def find_offset_s(time_ns, stock_m3, flows, last_s=None):
    """Estimate how late the clock of a level log is, by falls of the level and metered volumes.

    Stock and metered volume have a constant sum between deliveries. The sum of the absolute changes
    from row to row is least at the right offset.

    Parameters
    ----------
    time_ns : ndarray of int64, shape (n,)
        Ascending.
    stock_m3 : ndarray, shape (n,)
    flows : sequence of flows.MeterFlow
    last_s : float, optional
        Offset of earlier rows. It is kept without a search if it fits better than its neighbours.

    Returns
    -------
    float or None
        Seconds; None with too few sales.
    """
    change, middles, volumes, margin = np.diff(stock_m3), [], [], MOST_OFFSET_S * 10**9
    for flow in flows:
        low = np.searchsorted(flow.time_ns, time_ns[0] - margin)
        high = np.searchsorted(flow.time_ns, time_ns[-1] + 2 * margin)
        middles.append(flow.begin_ns[low:high] // 2 + flow.time_ns[low:high] // 2)
        volumes.append(np.diff(flow.total_m3[low : high + 1]))
    middle = np.concatenate([np.zeros(0, dtype=np.int64), *middles])
    if np.sum((middle > time_ns[0]) & (middle < time_ns[-1])) < LEAST_SALES:
        return None
    order = np.argsort(middle, kind="stable")
    middle, total = middle[order], np.append(0.0, np.cumsum(np.concatenate(volumes)[order]))

    def misfit(offset):
        at = time_ns - int(offset) * 10**9
        sold = total[np.searchsorted(middle, at)]
        return np.minimum(np.abs(change + np.diff(sold)), MOST_STEP_M3).sum()

    if last_s is not None:
        best, *near = (misfit(last_s + OFFSET_STEP_S * step) for step in (0, -2, -1, 1, 2))
        # A wrong offset may be better than its neighbours by chance, but not than all sales.
        if best < min(near) and best < LARGEST_MISFIT * misfit(last_s + MOST_OFFSET_S):
            return last_s
    offsets = np.arange(-MOST_OFFSET_S, MOST_OFFSET_S + 1, OFFSET_STEP_S)
    return float(offsets[np.argmin([misfit(offset) for offset in offsets])])


LENGTHS_M = {name: float(LEVEL_UNITS_M[name]) for name in ("m", "cm", "mm", "ft", "in")}
LITRES_M3 = {name: float(size) for name, size in VOLUMES_M3.items()}
FORMATS = ("csv", "tls-inventory", "tls-delivery")
QUANTITIES = {  # column: quantity that decides its unit
    "time": None, "begin": "time", "end": "time", "level": "length", "water": "length",
    "volume": "volume", "total": "volume", "temperature": "temperature",
    "start_volume": "volume", "end_volume": "volume", "offset": "number", "value": "number",
    "tank": None, "meter": None, "ticket": None, "kind": None, "quality": None, "tag": None,
}  # fmt: skip
KINDS = {  # log: needed columns, of each group any
    "levels": (("time",), ("level", "tag")),
    "meters": (("time",), ("total", "volume")),
    "deliveries": (("time",), ("volume", "start_volume")),
    "events": (("time",), ("kind",)),
    "air": (("time",), ("temperature",)),
}
FIELDS = {
    "profile": (
        Field("source", "text", "where the format was read"),
        choice("format", "of the file", FORMATS),
    ),
    "columns": tuple(Field(name, "text", "heading") for name in QUANTITIES),
    "units": (
        choice("length", "of levels", tuple(LENGTHS_M)),
        choice("volume", "of volumes", tuple(LITRES_M3)),
        choice("temperature", "of temperatures", ("c", "f")),
    ),
    "file": (
        choice("separator", "between the columns", (",", ";", "\t", "|")),
        choice("decimal", "mark of decimals", (".", ",")),
        Field("time_format", "text", "as for strftime; blank: ISO 8601"),
        Field("encoding", "text", "of the text"),
        Field("headings", "names", "headings in order, of a file without a heading"),
        number("skip_rows", "rows above the heading", 0, 1000),
        Field("missing", "names", "words in place of a number"),
        Field("good", "names", "words of the column quality for valid readings"),
    ),
    "tags": tuple(Field(name, "text", "tag") for name in ("level", "temperature", "water")),
    "only": (Field("tank", "text", "value of the column tank"),),
}
_FOLDER = "products/upkeep/shipped_profiles"


@dataclass(frozen=True)
class LogProfile:
    """Description of the files of a log.

    Attributes
    ----------
    format : str
        A value of FORMATS.
    columns : dict
        {key of QUANTITIES: heading}.
    units : dict
        {"length", "volume" or "temperature": unit}.
    file : dict
        Keys of the section [file], without blanks.
    tags : dict
        {"level", "temperature" or "water": tag} of a file with a tag in each row.
    only : dict
        {"tank": text} of the rows to be read.
    """

    format: str
    columns: dict
    units: dict
    file: dict = field(default_factory=dict)
    tags: dict = field(default_factory=dict)
    only: dict = field(default_factory=dict)

    def to_si(self, column, values):
        """Values of a column in m, m3 or degC."""
        quantity = QUANTITIES[column]
        if quantity == "length":
            return values * LENGTHS_M[self.units["length"]]
        if quantity == "volume":
            return values * LITRES_M3[self.units["volume"]]
        if quantity == "temperature" and self.units.get("temperature") == "f":
            return (values - 32) / 1.8
        return values


def list_profiles():
    """Shipped profiles, {name: path}."""
    return {path.stem: path for path in sorted(Path(str(shipped_folder(_FOLDER))).glob("*.toml"))}


def read_log_profile(name, kind, folder, log):
    """Read a profile.

    Parameters
    ----------
    name : str or None
        Name of a shipped profile, or of a TOML file in the folder; None: the profile "plain".
    kind : str
        A key of KINDS.
    folder : Path
    log : Log

    Returns
    -------
    LogProfile or None
        None after a problem, which is in the log.
    """
    name = name or "plain"
    shipped = list_profiles()
    path = folder / name if name.endswith(".toml") else shipped.get(name)
    if path is None:
        text = message("upkeep_no_profile", "no profile {name}; expected a TOML file, or a name of "
                       "{names}{guess}", name=name, names=", ".join(sorted(shipped)),
                       guess=nearest(name, shipped))  # fmt: skip
        return log.problem("upkeep.toml", text, None, f"{kind}.profile")
    problems_here = Log()
    data = read_bytes(path, problems_here, MAX_SETTINGS_BYTES)
    content, rows = ({}, {}) if data is None else read_toml(path.name, data, problems_here)
    values = {
        section: {
            key: value
            for key, value in read_section(
                path.name,
                section,
                fields,
                content.get(section, {}),
                rows.get(section),
                problems_here,
            ).items()
            if value is not None
        }
        for section, fields in FIELDS.items()
    }
    profile = LogProfile(
        values["profile"].get("format", "csv"), values["columns"],
        {"temperature": "c"} | values["units"], values["file"], values["tags"], values["only"],
    )  # fmt: skip
    if profile.format == "csv" and not problems_here.problems:
        _check_columns(path.name, profile, kind, name == "plain", problems_here)
    log.problems.extend(problems_here.problems)
    return None if problems_here.problems else profile


def _check_columns(file, profile, kind, is_plain, log):
    """Report missing columns and units of a profile."""
    for group in KINDS[kind]:
        if not is_plain and not any(column in profile.columns for column in group):
            text = message("upkeep_profile_column", "missing; expected the heading of this column "
                           "for {kind}", kind=kind)  # fmt: skip
            log.problem(file, text, None, f"columns.{group[0]}")
    for column in profile.columns:
        quantity = QUANTITIES[column]
        if quantity in ("length", "volume") and quantity not in profile.units:
            text = message("upkeep_profile_unit", "missing; expected the unit of column {column}",
                           column=column)  # fmt: skip
            log.problem(file, text, None, f"units.{quantity}")


CHUNK = 200_000  # rows
MOST_BAD_ROWS = 3  # rows named in messages of a file
MOST_CAPTURE_BYTES = 200_000_000  # read as a whole
MOST_LOG_BYTES = 4_000_000_000  # of a CSV file, read in chunks
HEAD_BYTES, LAYOUT_ROWS = 65_536, 50  # by which the layout of a file is found
COMMA_NUMBER = re.compile(r"(?:^|[;\t|\"])\s*-?\d+,\d+\s*(?:$|[;\t|\"])")
TIMES = ("time", "begin", "end")
TEXTS = ("tank", "meter", "ticket", "kind", "quality", "tag")
HAS_OFFSET = re.compile(r"(?:Z|[+-]\d\d:?\d\d)$")
# Block of a console: code, time, data, check sum. The control characters may be missing.
TLS_BLOCK = re.compile(rb"(\x01?)i20([12])\d\d(\d{10})([^&]*)&&([0-9A-Fa-f]{4})")


@dataclass
class Findings:
    """Rows of a log by kind, with their number and times.

    Attributes
    ----------
    counts : dict
        {(log, kind): [number, first time, last time]}, times in nanoseconds UTC or None.
    """

    counts: dict = field(default_factory=lambda: defaultdict(lambda: [0, None, None]))

    def add(self, log, kind, times=(), count=None):
        """Count rows of a kind, with their times (n,)."""
        count = len(times) if count is None else count
        if not count:
            return
        add_span(self.counts[log, kind], times, count)

    def number(self, log, kind):
        """Number of rows of a kind."""
        return self.counts[log, kind][0] if (log, kind) in self.counts else 0


def add_span(entry, times, count=None):
    """Add rows to [number, first time, last time], with their times (n,)."""
    known = np.asarray(times, dtype=np.int64)
    known = known[known != NOT_A_TIME]
    entry[0] += int(len(known) if count is None else count)
    if len(known):
        low, high = int(known.min()), int(known.max())
        entry[1] = low if entry[1] is None else min(entry[1], low)
        entry[2] = high if entry[2] is None else max(entry[2], high)


@dataclass(frozen=True)
class Layout:
    """Layout of a CSV file.

    Attributes
    ----------
    encoding, separator, decimal : str
    rows_above : int
        Rows above the first row of data.
    headings : list of str
    has_comments : bool
        Whether lines that begin with # are comments.
    """

    encoding: str
    separator: str
    decimal: str
    rows_above: int
    headings: list
    has_comments: bool


@dataclass
class LogFile:
    """A file of a log.

    Attributes
    ----------
    path : Path
    kind : str
        A key of profiles.KINDS.
    profile : LogProfile
    zone : str
        IANA name of the time zone of local times.
    findings : Findings
    log : Log
        Receives problems.
    digest : str
        SHA-256.
    span : list
        Number of rows with a time, and their first and last time: [int, ns or None, ns or None].
    """

    path: object
    kind: str
    profile: LogProfile
    zone: str
    findings: Findings
    log: Log
    digest: str = ""
    span: list = field(default_factory=lambda: [0, None, None])

    def chunks(self):
        """Yield chunks {column: values (n,)}; "row" is the row in the file.

        Rows without a valid time are left out.
        """
        try:
            reader = self._csv if self.profile.format == "csv" else self._captures
            yield from self._add_times(reader())
        except (OSError, ValueError, pd.errors.ParserError) as error:
            text = unreadable_file(error if isinstance(error, OSError) else OSError(str(error)))
            self.log.problem(self.path.name, text)

    def _csv(self):
        """Yield chunks of texts of a CSV file: a data frame with the columns of the profile."""
        if self._is_too_large(MOST_LOG_BYTES):
            return
        options, columns = self.profile.file, self.profile.columns
        layout = self._find_layout()
        if not layout.headings:
            text = message("upkeep_empty_log", "the file is empty; expected the rows of the log")
            return self.log.problem(self.path.name, text)
        present = list(options["headings"]) if options.get("headings") else layout.headings
        used = {present.index(heading): column
                for column, heading in columns.items() if heading in present}  # fmt: skip
        for group in KINDS[self.kind]:
            if not any(column in used.values() for column in group):
                headings = [columns[column] for column in group if column in columns]
                text = message("upkeep_no_column", "no column {headings}; the file has {present}",
                               headings=", ".join(headings),
                               present=", ".join(present)[:200])  # fmt: skip
                self.log.problem(self.path.name, text, layout.rows_above or 1)
                return
        texts = [place for place, column in used.items() if column in (*TIMES, *TEXTS)]
        frames = pd.read_csv(
            self.path, names=range(len(present)), header=None, index_col=False,
            usecols=sorted(used), dtype=dict.fromkeys(texts, str), chunksize=CHUNK,
            sep=layout.separator, decimal=layout.decimal, encoding=layout.encoding,
            skiprows=layout.rows_above, comment="#" if layout.has_comments else None,
            na_values=list(options.get("missing", ())), skipinitialspace=True,
        )  # fmt: skip
        row = layout.rows_above + 1
        for chunk in frames:
            frame = chunk.rename(columns=used)
            # The heading again, such as in joined files, is no row.
            is_heading = (frame["time"].str.strip() == columns["time"]).to_numpy()
            for place in np.flatnonzero(is_heading):
                cells = {column: str(frame[column].iloc[place]).strip() for column in frame}
                if any(cell != columns[column] for column, cell in cells.items()):
                    text = message("upkeep_other_heading", "the heading changes to {headings}; "
                                   "expected files with a single heading: divide the file",
                                   headings=", ".join(cells.values())[:200])  # fmt: skip
                    self.log.problem(self.path.name, text, int(row + place))
                    return
            frame = frame[~is_heading]
            yield row, self._numbers(frame, layout.decimal)
            row += len(chunk)

    def has_column(self, column):
        """Whether a CSV file has a column of the profile."""
        heading = self.profile.columns.get(column)
        if heading is None:
            return False
        return heading in (self.profile.file.get("headings") or self._find_layout().headings)

    def _is_too_large(self, most):
        """Whether the file has more bytes than allowed, which is then reported."""
        size = self.path.stat().st_size
        if size > most:
            self.log.problem(self.path.name, message(
                "upkeep_capture_too_large", "{size:.0f} MB; expected at most {most:.0f} MB",
                size=size / 1e6, most=most / 1e6))  # fmt: skip
        return size > most

    def _find_layout(self):
        """`Layout` of the file: as declared in the profile, or by its first rows."""
        options = self.profile.file
        with open(self.path, "rb") as stream:
            data = stream.read(HEAD_BYTES)
        encoding = options.get("encoding")
        if encoding is None:
            # In UTF-16 every second byte of a latin text is 0.
            marks = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
            by_zeros = {data[1:2]: "utf-16-le", data[:1]: "utf-16-be"}
            encoding = marks.get(data[:2]) or by_zeros.get(b"\0", "utf-8-sig")
            try:
                data[: len(data) // 2 * 2].decode(encoding)
            except UnicodeDecodeError as error:
                if error.start < len(data) - 4:
                    encoding = "cp1252"
        lines = data.decode(encoding, errors="replace").splitlines()
        first = int(options.get("skip_rows") or 0)
        while first < len(lines) and not is_row(lines[first]):
            first += 1
        rows = list(islice((line for line in lines[first:] if is_row(line)), LAYOUT_ROWS))
        separator = options.get("separator") or separator_of_text("\n".join(rows), ",")
        decimal = options.get("decimal")
        if decimal is None:
            has_comma = any(COMMA_NUMBER.search(line) for line in rows[1:])
            decimal = "," if separator != "," and has_comma else "."
        cells = next(csv.reader(rows[:1], delimiter=separator), [])
        return Layout(
            encoding, separator, decimal, first + (0 if options.get("headings") else 1),
            [cell.strip() for cell in cells], any(line.startswith("#") for line in lines[first:]),
        )  # fmt: skip

    def _numbers(self, frame, decimal):
        """{column: values} with numbers in SI; words in place of numbers are nan, and counted."""
        result = {}
        for column in frame:
            values = frame[column]
            if column in TIMES or column in TEXTS:
                result[column] = values.to_numpy(dtype=object)
                continue
            if not pd.api.types.is_numeric_dtype(values):
                words = values.astype(str).str.strip().str.replace(decimal, ".", regex=False)
                numbers = pd.to_numeric(words, errors="coerce")
                is_word = (numbers.isna() & values.notna()).to_numpy()
                self.findings.add(self.kind, "not_a_number", count=int(is_word.sum()))
                values = numbers
            result[column] = self.profile.to_si(column, values.to_numpy(dtype=float))
        return result

    def _captures(self):
        """Yield the blocks of a TLS capture as a chunk; a wrong check sum leaves a block out."""
        if self._is_too_large(MOST_CAPTURE_BYTES):
            return
        data = self.path.read_bytes()
        is_inventory = self.profile.format == "tls-inventory"
        rows, blocks = [], 0
        for block in TLS_BLOCK.finditer(data):
            if block[2] != (b"1" if is_inventory else b"2"):
                continue
            blocks += 1
            # The sum of all characters up to && and of the check sum is 0 modulo 65536. The first
            # character, SOH (1), belongs to the sum even if the capture has lost it.
            total = sum(block[0][:-4]) + (0 if block[1] else 1) + int(block[5], 16)
            if total % 65536:
                self.findings.add(self.kind, "wrong_check_sum", count=1)
                continue
            read = read_inventory if is_inventory else read_deliveries
            rows += read(block[3].decode(), "".join(block[4].decode("latin-1").split()))
        if not blocks:
            text = message("upkeep_no_block", "no block of this format; expected a capture of the "
                           "computer format {name}",
                           name="i201" if is_inventory else "i202")  # fmt: skip
            self.log.problem(self.path.name, text)
        frame = pd.DataFrame(rows)
        if len(frame):
            texts = (*TIMES, *TEXTS)
            yield (
                1,
                {
                    column: frame[column].to_numpy(dtype=object)
                    if column in texts
                    else self.profile.to_si(column, frame[column].to_numpy(dtype=float))
                    for column in frame
                    if column in QUANTITIES
                },
            )

    def _add_times(self, chunks):
        """Chunks with times in UTC, of the selected tank and without rows of bad quality."""
        clock, held = LocalClock(self.zone), None
        for first_row, chunk in chunks:
            count = len(chunk["time"])
            chunk["row"] = first_row + np.arange(count)
            for name, words in (("tank", self.profile.only.get("tank")),
                                ("quality", self.profile.file.get("good"))):  # fmt: skip
                if words and name in chunk:
                    words = (words,) if isinstance(words, str) else words
                    texts = pd.Series(chunk[name]).astype(str).str.strip()
                    is_kept = texts.isin(words).to_numpy()
                    if name == "quality":
                        self.findings.add(self.kind, "bad_quality", count=int((~is_kept).sum()))
                    chunk = {key: values[is_kept] for key, values in chunk.items()}
            if held is not None:
                chunk = {key: np.concatenate([held[key], chunk[key]]) for key in chunk}
                held = None
            local, is_local = self._parse_times(chunk["time"])
            if is_local and count == CHUNK and len(local):
                # A doubled hour that the chunk cuts is resolved with the next chunk.
                doubled = clock.is_doubled(local)
                last = int(np.argmin(doubled[::-1])) if not doubled.all() else len(local)
                if last:
                    cut = len(local) - last
                    held = {key: values[cut:] for key, values in chunk.items()}
                    chunk = {key: values[:cut] for key, values in chunk.items()}
                    local = local[:cut]
            yield from self._finish(chunk, local, is_local, clock)
        if held is not None:
            local, is_local = self._parse_times(held["time"])
            yield from self._finish(held, local, is_local, clock)
        self.findings.add(self.kind, "doubled_hour", count=clock.unresolved)

    def _finish(self, chunk, local, is_local, clock):
        """Yield the chunk with UTC times, without the rows that have none."""
        times = {"time": local}
        times |= {name: self._parse_times(chunk[name])[0] for name in TIMES[1:] if name in chunk}
        for name, values in times.items():
            utc, is_impossible = (
                clock.convert(values) if is_local else (values, np.zeros(len(values), dtype=bool))
            )
            for place in np.flatnonzero(is_impossible)[:MOST_BAD_ROWS]:
                text = message("upkeep_skipped_hour", "found {time}, in an hour that {zone} skips; "
                               "expected a local time, or the right time zone",
                               time=str(chunk[name][place]), zone=self.zone)  # fmt: skip
                self.log.problem(self.path.name, text, int(chunk["row"][place]), name)
            times[name] = utc
        is_unread = times["time"] == NOT_A_TIME
        self.findings.add(
            self.kind, "no_time", count=int((is_unread & (local == NOT_A_TIME)).sum())
        )
        add_span(self.span, times["time"][~is_unread])
        yield {key: values[~is_unread] for key, values in (chunk | times).items()}

    def _parse_times(self, texts):
        """(nanoseconds (n,), whether they are local) of texts."""
        if len(texts) == 0:
            return np.zeros(0, dtype=np.int64), True
        known = next((text for text in texts if isinstance(text, str)), "")
        has_offset = bool(HAS_OFFSET.search(known.strip()))
        layout = self.profile.file.get("time_format")
        parsed = pd.to_datetime(
            pd.Series(texts, dtype=object), format=layout or "ISO8601", errors="coerce",
            utc=has_offset,
        )  # fmt: skip
        values = parsed.to_numpy(dtype="datetime64[ns]").astype(np.int64)
        return values, not has_offset


def read_inventory(stamp, data):
    """Rows of an i201 block: tank, product, status, count, then floats of 8 hex digits.

    Parameters
    ----------
    stamp : str
        yymmddHHMM of the console.
    data : str
        Records of the tanks, without spaces.

    Returns
    -------
    list of dict
    """
    rows, place, time = [], 0, console_time(stamp)
    while place + 9 <= len(data):
        tank, count = data[place : place + 2], int(data[place + 7 : place + 9], 16)
        values = read_floats(data[place + 9 : place + 9 + 8 * count])
        place += 9 + 8 * count
        names = ("volume", "corrected", "ullage", "level", "water", "temperature")
        rows.append(
            {"time": time, "tank": str(int(tank)), **dict(zip(names, values, strict=False))}
        )
    return rows


def read_deliveries(stamp, data):
    """Rows of an i202 block: for each delivery its begin, end, and volumes before and after.

    Parameters
    ----------
    stamp : str
        yymmddHHMM of the console; the deliveries have times of their own.
    data : str
        Records of the tanks, without spaces.

    Returns
    -------
    list of dict
    """
    rows, place = [], 0
    while place + 5 <= len(data):
        tank, number = str(int(data[place : place + 2])), int(data[place + 3 : place + 5])
        place += 5
        for _ in range(number):
            begin, end = data[place : place + 10], data[place + 10 : place + 20]
            count = int(data[place + 20 : place + 22], 16)
            values = read_floats(data[place + 22 : place + 22 + 8 * count])
            place += 22 + 8 * count
            rows.append(
                {"time": console_time(end), "begin": console_time(begin), "tank": tank,
                 "start_volume": values[0], "end_volume": values[4],
                 "volume": values[4] - values[0]}
            )  # fmt: skip
    return rows


def read_floats(text):
    """Numbers of IEEE floats of 8 hex digits each."""
    return [struct.unpack(">f", bytes.fromhex(text[i : i + 8]))[0] for i in range(0, len(text), 8)]


def console_time(stamp):
    """ISO time of yymmddHHMM; years 80 to 99 are of the last century."""
    century = "19" if stamp[:2] >= "80" else "20"
    return f"{century}{stamp[:2]}-{stamp[2:4]}-{stamp[4:6]}T{stamp[6:8]}:{stamp[8:10]}:00"
