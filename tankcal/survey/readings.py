"""From the readings of a table, with names, to observations, with arrays for the solver."""

from dataclasses import dataclass, field, fields, replace

import numpy as np

from tankcal.survey.means import average_repeated
from tankcal.survey.observations import KINDS, Source

EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True)
class Numbers:
    """Numbers of points, instruments and sets of directions by the user's names.

    points       {name: number}                  setups  {name: job.Setup}
    instruments  {name: number}                  tools   {name: job.Instrument}
    sets         {(set-up, set): number}
    """

    points: dict
    setups: dict
    instruments: dict
    tools: dict
    sets: dict = field(default_factory=dict)


def bend_per_m(refraction):
    """(1 - k) / (2 R): how far the earth bends away, less what the line of sight does."""
    return 0.0 if refraction is None else (1.0 - refraction) / (2.0 * EARTH_RADIUS_M)


def certified_distance_m(reading_m, tool):
    """Distance after an instrument's certificate: (reading + correction_m) (1 + correction)."""
    return (np.asarray(reading_m) + tool.correction_m) * (1.0 + tool.correction)


def true_distance_m(reading_m, tool, temperature_c):
    """Distance after the certificate of an instrument and its temperature.

    Of a tape round the tank see `strapping.reduce_strap`.

        true = (reading + correction_m) (1 + correction) (1 + expansion (T - T_certified))

    reading_m, temperature_c  (n,), nan: not given        tool  job.Instrument
    """
    found = certified_distance_m(reading_m, tool)
    if tool.certified_temperature_c is None or not tool.expansion_per_k:
        return found
    warmer = np.nan_to_num(np.asarray(temperature_c) - tool.certified_temperature_c)
    return found * (1.0 + tool.expansion_per_k * warmer)


def read_distance_m(true_m, tool):
    """What an instrument reads of a true distance, at the temperature of its certificate.

    Examples
    --------
    >>> from tankcal.survey.measurements import Instrument
    >>> tape = Instrument("T", "tape", correction=1e-4, correction_m=0.002)
    >>> float(true_distance_m(read_distance_m(7.0, tape), tape, np.nan))
    7.0
    """
    zero, one = true_distance_m(np.array([0.0, 1.0]), tool, np.full(2, np.nan))
    return (true_m - zero) / (one - zero)


def observations_of_readings(readings, numbers, *, bend, warnings, correlated=frozenset()):
    """The observations of a table of readings: those that are adjusted, those that are compared.

    Distances are corrected by the certificates of their instruments; repeated readings become one.

    Parameters
    ----------
    readings : Readings
        By the user's names, in SI.
    numbers : Numbers
        Readings between points that have no number are left out.
    bend : float
        Of the lines of sight, `bend_per_m`, 1/m.
    warnings : list of Problem
        To which warnings of scatter are added.
    correlated : frozenset of int
        Rows of the file that are correlated with others: they are not averaged.

    Returns
    -------
    adjusted, compared : list of Observations
        Each with the Trace of its readings; horizontal distances stand apart from spatial ones.
    """
    single, averaged, compared = [], [], []
    kind = KINDS[readings.table]
    if not len(readings.value):
        return [], []
    for one in _observed(readings, numbers, kind, bend):
        check = np.asarray(readings.check, dtype=bool)[one.trace.reading]
        alone = np.full(len(one), np.ndim(readings.value) > 1)  # correlated with one another
        alone |= np.isin(one.trace.rows, list(correlated)) if correlated else False
        compared.append(one.taken(check))
        single.append(one.taken(~check & alone))
        rest = one.taken(~check & ~alone)
        averaged.append(average_repeated(rest, _labels(rest, kind), warnings, apart=True))
    return [one for one in single + averaged if len(one)], [one for one in compared if len(one)]


def _observed(readings, numbers, kind, bend):
    """Observations of all readings between points that have numbers, one by one.

    A table for spatial, one for horizontal distances; other kinds are one.
    """
    n = len(readings.value)
    setups = [numbers.setups[name] for name in readings.setup]
    start = [one.station for one in setups] if setups else readings.start
    tools = [one.instrument for one in setups] if setups else readings.instrument
    tools = tools if kind.has("instrument") and len(tools) else (None,) * n
    heights = np.array([one.height_m for one in setups]) if setups else np.zeros(n)
    target = readings.target_height_m
    sets = readings.set or (None,) * n
    rise = heights - (0.0 if target is None else np.nan_to_num(target))
    columns = {
        "start": _numbered(start, numbers.points),
        "end": _numbered(readings.end, numbers.points),
        "origin": _numbered(readings.origin or start, numbers.points),
        "instrument": _numbered(tools, numbers.instruments),
        "set": _numbered(zip(readings.setup or sets, sets, strict=True), numbers.sets),
        "rise_m": rise if rise.any() else None,
        "bend_per_m": bend,
    }
    columns = {name: given for name, given in columns.items() if kind.has(name)} | kind.options
    value = np.array(readings.value, dtype=float)
    if kind.has("instrument"):
        value = _corrected(value, tools, readings.temperature_c, numbers.tools)
    value, sd = (_of_rows(of, n, kind.observes.rows) for of in (value, readings.sd))
    trace = _source(readings, kind, tools).trace()
    whole = kind.observes(value, sd, **columns, trace=trace)
    numbered = (*whole.ties, "set") if kind.has("set") else whole.ties
    known = np.all([getattr(whole, name) >= 0 for name in numbered], axis=0)
    if readings.horizontal is None:
        return [whole.taken(known)]
    flat = np.asarray(readings.horizontal, dtype=bool)
    return [
        replace(whole.taken(known & (flat == horizontal)), horizontal=horizontal)
        for horizontal in (False, True)
    ]


def _of_rows(of, n, m):
    """(n,) or, of several values a row, (n, m); one for all m where one is given."""
    of = np.array(np.broadcast_to(np.asarray(of, dtype=float).reshape(n, -1), (n, m)))
    return of[:, 0] if m == 1 else of


def _source(readings, kind, tools):
    names = readings.setup or readings.start, readings.origin, readings.end
    return Source(
        file=readings.file,
        rows=tuple(readings.rows),
        ids=tuple(zip(*(one for one in names if one), strict=True)),
        element=(kind.elements,) * len(readings.value),
        group=tuple(tool or kind.group for tool in tools),
        table=readings.table,
    )


def _numbered(names, numbers):
    return np.array([numbers.get(name, -1) for name in names], dtype=int)


def _corrected(value, tools, temperature_c, known):
    temperature = np.full(len(value), np.nan) if temperature_c is None else temperature_c
    for name in set(tools) - {None}:
        mine = np.array([tool == name for tool in tools])
        value[mine] = true_distance_m(value[mine], known[name], temperature[mine])
    return value


def _labels(one, kind):
    """(n,) the same number for readings of the same value; taped lines go either way."""
    columns = {field.name: getattr(one, field.name) for field in fields(one)}
    for name in ("value", "sd", "use"):
        del columns[name]
    columns = {name: of for name, of in columns.items() if isinstance(of, np.ndarray)}
    if kind.either_way:
        ends = columns["start"], columns["end"]
        columns |= {"start": np.minimum(*ends), "end": np.maximum(*ends)}
    else:  # two set-ups on one station see the same value twice
        columns["from"] = np.array([names[0] for names in one.trace.ids], dtype=object)
    known = {}
    keys = zip(*(column.tolist() for column in columns.values()), strict=True)
    return np.array([known.setdefault(key, len(known)) for key in keys], dtype=int)
