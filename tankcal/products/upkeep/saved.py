"""Saved upkeep of a tank: upkeep.json, and results of earlier runs.

A month computes the new data only. Each kept result is a file with its key as its name: the SHA-256
of all data on which it depends. A file is complete or absent, so a run that is stopped loses only
the part in work. Files contain plain arrays, and a damaged file counts as absent.
"""

import hashlib
import os
import tempfile
import zipfile
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from tankcal.record.covariance_factor import FactorBlock
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, WarningRecord, key
from tankcal.version import find_version

UPKEEP = SavedFormat(
    "tankcal-upkeep", 1, "upkeep.json", schemas=Path(__file__).with_name("schemas")
)
MODES = ("improved", "deliveries", "watched")
STARTS = ("record", "table", "job", "drawing", "sales")
STEP_KINDS = ("rest", "sales", "delivery")
VERDICTS = ("pass", "fail", "inconclusive", "gain")
SUFFIX = ".npz"  # of the results of earlier runs


class UpkeepPeriod(Saved):
    """Time and steps."""

    first: str = key("day of the first quiet mark, UTC")
    last: str = key("day of the last quiet mark, UTC")
    days: Finite = key("duration")
    pieces: int = key("quiet pieces of the level log")
    steps: int = key("steps between quiet marks")
    used: int = key("steps of the estimate")
    rejected: int = key("steps rejected as outliers")
    lowest_m: Finite = key("lowest level of the used steps")
    highest_m: Finite = key("highest level of the used steps")
    sold_m3: Finite = key("metered volume")
    delivered_m3: Finite = key("volume of the tickets")


class UpkeepFit(Saved):
    """Agreement of the steps with the model."""

    chi2: Finite = key("weighted sum of squares")
    dof: int = key("its degrees of freedom")
    probability: Finite = key("of a larger sum, if the model is right")
    passes: int = key("linearisations until the adjusted levels were steady")
    scale: Finite = key("factor on all U: 1, or the root of chi2 over dof if larger")


class UpkeepRow(Saved):
    """A row of the table."""

    height_m: Finite = key("dip")
    former_m3: Finite = key("volume of the former table")
    former_U_m3: Finite = key("expanded")
    volume_m3: Finite = key("volume of the new table")
    U_m3: Finite = key("expanded")
    En: float | None = key("change over the root of the difference of squared U; null: no change")
    is_seen: bool = key("whether the level is within the levels of the steps")


class UpkeepDelivery(Saved):
    """A delivery between two dips."""

    low_m: Finite = key("lower dip")
    high_m: Finite = key("upper dip")
    former_m3: Finite = key("by the former table")
    former_U_m3: Finite = key("expanded")
    volume_m3: Finite = key("by the new table")
    U_m3: Finite = key("expanded")


class UpkeepMeter(Saved):
    """A meter by the tank."""

    name: str = key("of the meter")
    volume_m3: Finite = key("metered volume")
    certificate: str | None = key("null: not traceable")
    prior_percent: Finite = key("U of the factor before, at the coverage of all U")
    deviation_percent: Finite = key("deviation of the factor from its certificate, or from 1")
    U_percent: Finite = key("expanded")
    correlation: Finite = key("with the volume between the lowest and highest level of the steps")


class UpkeepCause(Saved):
    """A cause of the model."""

    name: str = key("of the cause")
    kind: str = key("group of causes")
    unit: str = key("of prior, estimate and u")
    mean: Finite = key("prior")
    prior_u: Finite = key("standard uncertainty before")
    estimate: Finite = key("after the steps")
    u: Finite = key("standard uncertainty after")


class UpkeepSolution(Saved):
    """Sizes of a tank without a calibration, at a minimum of chi-squared."""

    chi2: Finite = key("above the smallest minimum")
    sizes: list[UpkeepCause] = key("diameter, length, depth of the ends, tilt, zero")
    correlation: list[list[Finite]] = key("of the sizes")


class UpkeepStart(Saved):
    """Table with which the upkeep began."""

    kind: str = key(", ".join(STARTS))
    is_stock_control: bool = key("whether the table serves stock control only, without certificate")
    solutions: list[UpkeepSolution] = key("without a calibration: the smallest chi-squared first")


class UpkeepMonth(Saved):
    """Watching of a month."""

    month: str = key("year-month")
    steps: int = key("used steps")
    leak_l_h: Finite = key("loss by time in this month; positive: out of the tank")
    U_l_h: Finite = key("expanded")
    detectable_l_h: float | None = key(
        "smallest rate detected with 95 % at 5 % of false alarms; null: not determined"
    )
    verdict: str = key(", ".join(VERDICTS))
    throughput_percent: Finite = key(
        "deviation of causes proportional to the metered volume from the mean of all months"
    )
    U_percent: Finite = key("expanded")


class UpkeepSuspect(Saved):
    """A cause that may have begun."""

    kind: str = key("of the cause")
    member: str | None = key("meter")
    unit: str = key("of size and sd")
    day: str = key("most likely beginning, UTC")
    size: Finite = key("estimate")
    sd: Finite = key("standard uncertainty; with the unknown beginning after an alarm")
    w: Finite = key("size over its standard deviation, for this beginning")
    is_possible: bool = key("whether the data do not distinguish it from the most likely cause")


class UpkeepWatch(Saved):
    """Watching of the whole period."""

    rate_per_year: Finite = key("declared false alarms per year")
    limit: Finite = key("of |w|")
    limit_of_model: Finite = key("for innovations drawn by the model")
    limit_of_tank: float | None = key("for the innovations of the tank; null: under 180 days")
    is_provisional: bool = key("whether the limit is 1.5 times that of the model")
    false_alarms: float | None = key(
        "probability of an alarm without fault, by the innovations of the tank"
    )
    largest: Finite = key("largest |w|")
    alarm: str | None = key("day of the first alarm, UTC; null: none")
    is_named: bool = key("whether a single cause explains the alarm")
    suspects: list[UpkeepSuspect] = key("the most likely first")


class UpkeepStep(Saved):
    """A single step, which is saved only on demand."""

    first: str = key("time of the first mark, UTC")
    last: str = key("time of the last mark, UTC")
    kind: str = key(", ".join(STEP_KINDS))
    by_table_m3: Finite = key("change of the stock by the table in force, at the base temperature")
    by_meters_m3: Finite = key("metered volume at the base temperature, with expected wear")
    by_tickets_m3: Finite = key("delivered volume at the base temperature")
    losses_m3: Finite = key("expected losses")
    misclosure_m3: Finite = key("by tickets less by meters, losses and by table")
    u_m3: Finite = key("standard uncertainty of the misclosure by all causes")
    w: float | None = key(
        "misclosure less its prediction by earlier steps, over its standard deviation; null: unused"
    )
    left_out: str | None = key("reason why the step is unused; null: used")


class UpkeepCount(Saved):
    """Rows of a log of a kind."""

    log: str = key("levels, meters, deliveries ...")
    kind: str = key("duplicate, late, stuck ...")
    count: int = key("number")
    first: str | None = key("first time, UTC, to the hour")
    last: str | None = key("last time, UTC, to the hour")


class UpkeepSource(Saved):
    """A file of the upkeep."""

    kind: str = key("settings, record, levels ...")
    file: str = key("name")
    sha256: str = key("of its bytes")
    rows: int | None = key("rows with a time; null: no log")
    first: str | None = key("first time, UTC, to the hour")
    last: str | None = key("last time, UTC, to the hour")
    chain: str = key("SHA-256 of the chain before and of this file")


class UpkeepFile(Saved, kw_only=True):
    """A calibration kept up by everyday data."""

    format: str = key("see Versions", default=UPKEEP.format)
    tankcal: str = key("version of tankcal", default_factory=find_version)
    notice: str = key("on every page, such as EXAMPLE", default="")
    tank: str = key("name of the tank")
    record_sha256: str = key("of the record of the former table, or of the drawing")
    coverage_probability: Finite = key("of all U")
    k: Finite = key("coverage factor of all U")
    site: str | None = key("as declared")
    by: str | None = key("person who made the upkeep")
    note: str | None = key("remark")
    service: str = key('"station" or "terminal"')
    liquid: str | None = key("name of the liquid")
    start: UpkeepStart = key("table with which the upkeep began")
    mode: str = key(", ".join(MODES))
    reasons: list[str] = key(
        "why a result is not stated, or quantities that the steps do not determine"
    )
    period: UpkeepPeriod = key("time and steps")
    fit: UpkeepFit = key("agreement with the model")
    rows: list[UpkeepRow] = key("former and new table; empty: only deliveries are stated")
    factor: list[FactorBlock] = key("covariance factor of the rows")
    deliveries: list[UpkeepDelivery] = key("between dips within the levels of the steps")
    meters: list[UpkeepMeter] = key("meters by the tank")
    causes: list[UpkeepCause] = key("without those of the table")
    months: list[UpkeepMonth] = key("in order")
    watch: UpkeepWatch = key("search for causes that began")
    cleaning: list[UpkeepCount] = key("rows by kind")
    left_out: list[UpkeepCount] = key("steps without use, by reason")
    inputs: dict = key("upkeep.toml as {section: {key: value}}, without blank keys")
    files: list[UpkeepSource] = key("input files in the order of reading")
    warnings: list[WarningRecord] = key("on the upkeep")
    steps: list[UpkeepStep] | None = key(
        "each step, only with --steps", default=None, optional=True
    )


def hash_arrays(*values):
    """SHA-256 of arrays, texts, numbers and dataclasses of these, as hexadecimal text."""
    digest = hashlib.sha256()
    for name, value in _flatten("", values):
        digest.update(f"{name}:".encode())
        is_plain = isinstance(value, np.ndarray) and value.dtype != object
        content = value if is_plain else repr(np.asarray(value).tolist())
        digest.update(np.ascontiguousarray(content).data if is_plain else content.encode())
    return digest.hexdigest()


class State:
    """Folder with results of earlier runs.

    Parameters
    ----------
    folder : path or None
        Created if missing; None: results are not kept.
    """

    def __init__(self, folder=None):
        self.folder = None if folder is None else Path(folder)
        self.read_count = self.written_count = 0

    def key(self, *parts):
        """Key of a result that depends on these parts and on the version of tankcal."""
        return "" if self.folder is None else hash_arrays(find_version(), *parts)

    def load(self, key, kind, **unsaved):
        """Result of a key, an object of the dataclass `kind`; None if it was not kept.

        `unsaved` are the values of fields that were not saved.
        """
        if self.folder is None:
            return None
        try:
            with np.load(self.folder / f"{key}{SUFFIX}", allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            result = _build(kind, arrays, "", unsaved)
        except (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError):
            return None
        self.read_count += 1
        return result

    def save(self, key, result):
        """Keep a result; fields with steps are omitted."""
        self.written_count += 1
        if self.folder is None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=self.folder, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, **{name: np.asarray(value) for name, value in _flatten("", result)
                                  if not name.startswith("steps.")})  # fmt: skip
            os.replace(name, self.folder / f"{key}{SUFFIX}")
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise


NO_STATE = State()


def _flatten(place, value):
    """Yield (name, value) of all parts of nested dataclasses and sequences; None has no part."""
    if is_dataclass(value):
        for item in fields(value):
            yield from _flatten(f"{place}{item.name}.", getattr(value, item.name))
    elif isinstance(value, tuple | list) and any(is_dataclass(item) or isinstance(item, np.ndarray)
                                                 for item in value):  # fmt: skip
        for number, item in enumerate(value):
            yield from _flatten(f"{place}{number}.", item)
    elif value is not None:
        yield place, value


def _build(kind, arrays, place, unsaved):
    """Object of a dataclass from its saved parts."""
    values = dict(unsaved)
    for item in fields(kind):
        if item.name not in values:
            values[item.name] = _build_field(item.type, arrays, f"{place}{item.name}.")
    return kind(**values)


def _build_field(kind, arrays, name):
    """Value of a field: a number, text, array, tuple, dataclass, or None without saved parts."""
    entries = [entry for entry in get_args(kind) if is_dataclass(entry)]
    if entries:  # a tuple of dataclasses
        count = len({key[len(name) :].partition(".")[0] for key in arrays
                     if key.startswith(name) and key != name})  # fmt: skip
        return tuple(_build(entries[0], arrays, f"{name}{i}.", {}) for i in range(count))
    if is_dataclass(kind):
        return _build(kind, arrays, name, {})
    if name not in arrays:
        return None
    value = arrays[name]
    if kind is tuple:
        return tuple(value.tolist())
    return value.item() if value.ndim == 0 else value
