"""Conversion of a table of readings, with names, to observations, with arrays for the solver."""

from dataclasses import dataclass, field, fields, replace

import numpy as np

from tankcal.survey.means import average_repeated
from tankcal.survey.observations import KINDS, Source

EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True)
class Numbers:
    """Numbers of points, instruments and sets of directions by the user's names.

    Attributes
    ----------
    points : dict
        {name: number}.
    setups : dict
        {name: measurements.Setup}.
    instruments : dict
        {name: number}.
    tools : dict
        {name: measurements.Instrument}.
    sets : dict
        {(set-up, set): number}.
    """

    points: dict
    setups: dict
    instruments: dict
    tools: dict
    sets: dict = field(default_factory=dict)


def bend_per_m(refraction):
    """Earth curvature less refraction, (1 - k) / (2 R), 1/m; multiply by the distance squared."""
    return 0.0 if refraction is None else (1.0 - refraction) / (2.0 * EARTH_RADIUS_M)


def certified_distance_m(reading_m, tool):
    """Distance after an instrument's certificate: (reading + correction_m) (1 + correction), m."""
    return (np.asarray(reading_m) + tool.correction_m) * (1.0 + tool.correction)


def true_distance_m(reading_m, tool, temperature_c):
    """Distance after correction for the certificate of an instrument and its temperature.

        true = (reading + correction_m) (1 + correction) (1 + expansion (T - T_certified))

    `strapping.reduce_strap` corrects a tape round the tank.

    Parameters
    ----------
    reading_m : ndarray, shape (n,)
    tool : Instrument
        measurements.Instrument.
    temperature_c : ndarray, shape (n,)
        nan: not given, no correction.

    Returns
    -------
    ndarray, shape (n,)
    """
    certified = certified_distance_m(reading_m, tool)
    if tool.certified_temperature_c is None or not tool.expansion_per_k:
        return certified
    warmer = np.nan_to_num(np.asarray(temperature_c) - tool.certified_temperature_c)
    return certified * (1.0 + tool.expansion_per_k * warmer)


def read_distance_m(true_m, tool):
    """Reading of an instrument at a true distance, at the temperature of its certificate, m.

    Examples
    --------
    >>> from tankcal.survey.measurements import Instrument
    >>> tape = Instrument("T", "tape", correction=1e-4, correction_m=0.002)
    >>> float(true_distance_m(read_distance_m(7.0, tape), tape, np.nan))
    7.0
    """
    # The correction is linear in the reading, so two values invert it.
    at_zero, at_unit = true_distance_m(np.array([0.0, 1.0]), tool, np.full(2, np.nan))
    return (true_m - at_zero) / (at_unit - at_zero)


def observations_of_readings(readings, numbers, *, bend, warnings, correlated=frozenset()):
    """Convert a table of readings to adjusted and compared observations.

    Distances are corrected by the certificates of their instruments; repeated readings are
    averaged.

    Parameters
    ----------
    readings : Readings
        By the user's names, in SI.
    numbers : Numbers
        Readings between points without a number are omitted.
    bend : float
        Curvature of the lines of sight, see `bend_per_m`, 1/m.
    warnings : list of Problem
        Receives warnings of excessive scatter.
    correlated : frozenset of int
        Rows of the file that are correlated with other rows; they are not averaged.

    Returns
    -------
    adjusted, compared : list of Observations
        Each with the Trace of its readings; horizontal and spatial distances are separate.
    """
    single, averaged, compared = [], [], []
    kind = KINDS[readings.table]
    if not len(readings.value):
        return [], []
    for observations in _collect_observations(readings, numbers, kind, bend):
        check = np.asarray(readings.check, dtype=bool)[observations.trace.reading]
        # Vectors have correlated components, so a weighted mean by components would be wrong.
        alone = np.full(len(observations), np.ndim(readings.value) > 1)
        alone |= np.isin(observations.trace.rows, list(correlated)) if correlated else False
        compared.append(observations.taken(check))
        single.append(observations.taken(~check & alone))
        rest = observations.taken(~check & ~alone)
        averaged.append(average_repeated(rest, _labels(rest, kind), warnings, apart=True))
    return [observations for observations in single + averaged if len(observations)], [
        observations for observations in compared if len(observations)
    ]


def _collect_observations(readings, numbers, kind, bend):
    """Observations of all readings between numbered points, not averaged.

    Distances give a spatial and a horizontal table; other kinds give one table.
    """
    n = len(readings.value)
    setups = [numbers.setups[name] for name in readings.setup]
    start = [occupation.station for occupation in setups] if setups else readings.start
    tools = [occupation.instrument for occupation in setups] if setups else readings.instrument
    tools = tools if kind.has("instrument") and len(tools) else (None,) * n
    heights = np.array([occupation.height_m for occupation in setups]) if setups else np.zeros(n)
    target = readings.target_height_m
    sets = readings.set or (None,) * n
    # Heights of instrument and target reduce the sight to the marks.
    rise = heights - (0.0 if target is None else np.nan_to_num(target))
    columns = {
        "start": _numbers_of(start, numbers.points),
        "end": _numbers_of(readings.end, numbers.points),
        "origin": _numbers_of(readings.origin or start, numbers.points),
        "instrument": _numbers_of(tools, numbers.instruments),
        "set": _numbers_of(zip(readings.setup or sets, sets, strict=True), numbers.sets),
        "rise_m": rise if rise.any() else None,
        "bend_per_m": bend,
    }
    columns = {name: column for name, column in columns.items() if kind.has(name)} | kind.options
    value = np.array(readings.value, dtype=float)
    if kind.has("instrument"):
        value = _correct_distances(value, tools, readings.temperature_c, numbers.tools)
    value, sd = (_reshape_rows(of, n, kind.observes.rows) for of in (value, readings.sd))
    trace = _source(readings, kind, tools).trace()
    observations = kind.observes(value, sd, **columns, trace=trace)
    numbered = (*observations.ties, "set") if kind.has("set") else observations.ties
    known = np.all([getattr(observations, name) >= 0 for name in numbered], axis=0)
    if readings.horizontal is None:
        return [observations.taken(known)]
    flat = np.asarray(readings.horizontal, dtype=bool)
    return [
        replace(observations.taken(known & (flat == horizontal)), horizontal=horizontal)
        for horizontal in (False, True)
    ]


def _reshape_rows(values, n, m):
    """Reshape to (n,) or, with several values per row, (n, m); a single value applies to all m."""
    values = np.array(np.broadcast_to(np.asarray(values, dtype=float).reshape(n, -1), (n, m)))
    return values[:, 0] if m == 1 else values


def _source(readings, kind, tools):
    """Source of the readings, with the names of set-up or start, origin and end."""
    names = readings.setup or readings.start, readings.origin, readings.end
    return Source(
        file=readings.file,
        rows=tuple(readings.rows),
        ids=tuple(zip(*(column for column in names if column), strict=True)),
        element=(kind.elements,) * len(readings.value),
        group=tuple(tool or kind.group for tool in tools),
        table=readings.table,
    )


def _numbers_of(names, numbers):
    """Numbers (n,) of the names; -1: without a number."""
    return np.array([numbers.get(name, -1) for name in names], dtype=int)


def _correct_distances(value, tools, temperature_c, known):
    """Distances (n,) after correction by the instruments, m."""
    temperature = np.full(len(value), np.nan) if temperature_c is None else temperature_c
    for name in set(tools) - {None}:
        is_of_tool = np.array([tool == name for tool in tools])
        value[is_of_tool] = true_distance_m(value[is_of_tool], known[name], temperature[is_of_tool])
    return value


def _labels(one, kind):
    """Labels (n,), equal for readings of the same value; taped lines have no direction."""
    columns = {field.name: getattr(one, field.name) for field in fields(one)}
    for name in ("value", "sd", "use"):
        del columns[name]
    columns = {name: of for name, of in columns.items() if isinstance(of, np.ndarray)}
    if kind.either_way:
        ends = columns["start"], columns["end"]
        columns |= {"start": np.minimum(*ends), "end": np.maximum(*ends)}
    else:
        # Two set-ups on one station are distinct, as their instrument heights differ.
        columns["from"] = np.array([names[0] for names in one.trace.ids], dtype=object)
    known = {}
    keys = zip(*(column.tolist() for column in columns.values()), strict=True)
    return np.array([known.setdefault(key, len(known)) for key in keys], dtype=int)
