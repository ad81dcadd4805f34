"""From the readings of a table, with names, to observations, with arrays for the solver."""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.survey.means import average_readings, contradictory_labels, scatter_warnings
from tankcal.survey.observations import KINDS

EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True)
class Trace:
    """Where n observations of one kind come from.

    file     name                   rows     (n,) first row of each, or None
    ids      (n,) tuples of names   repeats  (n,) readings that were averaged
    group    (n,) names of the groups whose sds are judged together ("tape 1")
    element  (n,) tuples, a name for each value: ("x", "y"); ("",) where there is only one
    table    as job.Readings name it; "" for everything else
    scatter  (n,) chi-square of the readings that were averaged, about their mean; None: none were
    """

    file: str
    rows: tuple
    ids: tuple
    repeats: np.ndarray
    group: tuple
    element: tuple
    table: str = ""
    scatter: np.ndarray | None = None

    @property
    def repeated(self):
        """(chi-square (n,), degrees of freedom (n,)) of the readings that were averaged."""
        scatter = np.zeros(len(self.rows)) if self.scatter is None else self.scatter
        values = np.array([len(one) for one in self.element], dtype=int)
        return scatter, (np.asarray(self.repeats) - 1) * values


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


def true_distance_m(reading_m, tool, temperature_c):
    """Distance after the certificate of an instrument and its temperature.

        true = (reading + correction_m) (1 + correction) (1 + expansion (T - T_certified))

    reading_m, temperature_c  (n,), nan: not given        tool  job.Instrument
    """
    found = (np.asarray(reading_m) + tool.correction_m) * (1.0 + tool.correction)
    if tool.certified_temperature_c is None or not tool.expansion_per_k:
        return found
    warmer = np.nan_to_num(np.asarray(temperature_c) - tool.certified_temperature_c)
    return found * (1.0 + tool.expansion_per_k * warmer)


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
    adjusted, compared : list of (Observations, Trace)
    """
    table = _numbered_table(readings, numbers, correlated)
    use = _between_known(table)
    adjusted = list(_adjusted(table, use & ~table.check, bend, warnings))
    use &= table.check
    if table.kind.has("set"):
        use &= table.set >= 0
    return adjusted, list(_one_by_one(table, np.flatnonzero(use), bend))


@dataclass(frozen=True)
class _Table:
    """Readings with numbers in place of names; arrays (n,), -1: no such number."""

    table: str
    file: str
    rows: tuple
    value: np.ndarray
    sd: np.ndarray
    start: np.ndarray
    end: np.ndarray
    origin: np.ndarray
    rise_m: np.ndarray
    set: np.ndarray
    instrument: np.ndarray
    tools: tuple
    horizontal: np.ndarray
    check: np.ndarray
    ids: tuple
    correlated: frozenset  # rows of the file that are correlated with others

    @property
    def kind(self):
        """observations.Kind of its rows."""
        return KINDS[self.table]


def _numbered_table(readings, numbers, correlated):
    n = len(readings.value)
    setups = [numbers.setups[name] for name in readings.setup]
    start = [one.station for one in setups] if setups else readings.start
    tools = [one.instrument for one in setups] if setups else readings.instrument
    of_distances = KINDS[readings.table].has("instrument")
    tools = tuple(tools) if of_distances and len(tools) else (None,) * n
    heights = np.array([one.height_m for one in setups]) if setups else np.zeros(n)
    target = readings.target_height_m
    rise = heights - (0.0 if target is None else np.nan_to_num(target))
    value = np.array(readings.value, dtype=float)
    if of_distances:
        value = _corrected(value, tools, readings.temperature_c, numbers.tools)
    sets = readings.set or (None,) * n
    horizontal = np.zeros(n, dtype=bool) if readings.horizontal is None else readings.horizontal
    from_names = readings.setup or readings.start
    ids = zip(from_names, readings.end, strict=True)
    if readings.origin:
        ids = zip(from_names, readings.origin, readings.end, strict=True)
    return _Table(
        table=readings.table, file=readings.file, rows=tuple(readings.rows), value=value,
        sd=np.asarray(readings.sd, dtype=float),
        start=_numbered(start, numbers.points), end=_numbered(readings.end, numbers.points),
        origin=_numbered(readings.origin or start, numbers.points), rise_m=rise,
        set=_numbered(zip(readings.setup or sets, sets, strict=True), numbers.sets),
        instrument=_numbered(tools, numbers.instruments), tools=tools,
        horizontal=np.asarray(horizontal, dtype=bool),
        check=np.asarray(readings.check, dtype=bool), ids=tuple(ids), correlated=correlated,
    )  # fmt: skip


def _numbered(names, numbers):
    return np.array([numbers.get(name, -1) for name in names], dtype=int)


def _corrected(value, tools, temperature_c, known):
    temperature = np.full(len(value), np.nan) if temperature_c is None else temperature_c
    for name in set(tools) - {None}:
        mine = np.array([tool == name for tool in tools])
        value[mine] = true_distance_m(value[mine], known[name], temperature[mine])
    return value


def _adjusted(table, use, bend, warnings):
    """Pairs (observations, Trace) of the rows (n,) bool that are adjusted, repeated ones as one."""
    if table.value.ndim > 1:
        yield from _one_by_one(table, np.flatnonzero(use), bend)
        return
    alone = np.isin(table.rows, list(table.correlated)) if table.rows else use & False
    yield from _one_by_one(table, np.flatnonzero(use & alone), bend)
    use &= ~alone
    for horizontal in (False, True):
        rows = np.flatnonzero(use & (table.horizontal == horizontal))
        if len(rows):
            label, angle = _labels(table, rows), table.kind.is_angle
            value, sd = _values(table, rows)
            means = average_readings(label, value, sd, angle=angle)
            warnings += scatter_warnings(
                means, lambda k, r=rows: "-".join(table.ids[r[k]]), table.file,
                [table.rows[i] for i in rows] if table.rows else (),
            )  # fmt: skip
            apart = contradictory_labels(label, means)
            if apart is not label:
                means = average_readings(apart, value, sd, angle=angle)
            first = rows[means.first]
            yield (
                _made(table, first, means.value, means.sd, bend),
                replace(_trace(table, first, means.repeats), scatter=means.chi2.sum(axis=1)),
            )


def _one_by_one(table, rows, bend):
    """Pairs (observations, Trace) of rows (k,) that are not averaged with others."""
    for horizontal in (False, True):
        mine = rows[table.horizontal[rows] == horizontal]
        if len(mine):
            trace = _trace(table, mine, np.ones(len(mine), dtype=int))
            yield _made(table, mine, *_values(table, mine), bend), trace


def _values(table, rows):
    """Values and sds (k, m) of rows (k,); a column holds for all m values where there is one."""
    shape = len(rows), table.kind.observes.rows
    columns = (a[rows].reshape(len(rows), -1) for a in (table.value, table.sd))
    return (np.array(np.broadcast_to(column, shape)) for column in columns)


def _between_known(table):
    return (table.start >= 0) & (table.end >= 0) & (table.origin >= 0)


def _labels(table, rows):
    """(n,) the same number for readings of the same value; taped lines go either way."""
    start, end = table.start[rows], table.end[rows]
    source = [table.ids[i][0] for i in rows]
    if table.kind.either_way:
        start, end = np.minimum(start, end), np.maximum(start, end)
        source = [None] * len(rows)
    back = table.origin[rows].tolist() if table.kind.has("origin") else source
    known = {}
    keys = zip(
        start.tolist(), end.tolist(), back,
        table.rise_m[rows].tolist(), table.set[rows].tolist(), [table.tools[i] for i in rows],
        source, strict=True,
    )  # fmt: skip
    return np.array([known.setdefault(key, len(known)) for key in keys])


def _made(table, rows, value, sd, bend):
    """The observations of some rows, with values and sds (n, m)."""
    kind, rise = table.kind, table.rise_m[rows]
    known = {
        "instrument": table.instrument[rows],
        "set": table.set[rows],
        "origin": table.origin[rows],
        "horizontal": bool(table.horizontal[rows[0]]),
        "rise_m": rise if rise.any() else None,
        "bend_per_m": bend,
    }
    more = {name: given for name, given in known.items() if kind.has(name)} | kind.options
    if kind.observes.rows == 1:
        value, sd = value[:, 0], sd[:, 0]
    return kind.observes(value, sd, start=table.start[rows], end=table.end[rows], **more)


def _trace(table, rows, repeats):
    group = tuple(table.tools[i] or table.kind.group for i in rows)
    return Trace(
        table.file,
        tuple(table.rows[i] for i in rows) if table.rows else (None,) * len(rows),
        tuple(table.ids[i] for i in rows),
        repeats,
        group,
        (table.kind.elements,) * len(rows),
        table.table,
    )
