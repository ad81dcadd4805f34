"""Conversion of a table of readings, with names, to observations, with arrays for the solver.

Weighted means of repeated readings, tests of their scatter, and rejection.

With weights p = 1/s2 of the readings of one value:   mean = sum(p l) / sum(p),   s2 = 1 / sum(p),
chi2 = sum(p (l - mean)2) with one degree of freedom fewer than readings. Adjusting the means gives
the same unknowns and covariance as adjusting all readings. Source: Koch 1999, section 3.

Repeated readings of image points are rejected if their scatter exceeds the limit of the job.
"""

from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy.special import chdtri

from tankcal.camera.comparator import group_readings
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.survey.measurements import RejectedReadings
from tankcal.survey.observations import KINDS, Source
from tankcal.survey.results import RepeatedReadings
from tankcal.survey.wall_hits import certified_distance_m

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


# ---- means of repeated readings

LEVEL = 0.001  # significance level of a test of scatter, for all readings of a file together
TOLD = 10  # warnings listed singly; further rejected points are only counted


@dataclass(frozen=True)
class Averages:
    """Means of n different values, in the order of their first readings.

    Attributes
    ----------
    value, sd : ndarray, shape (n, m)
    first : ndarray of int, shape (n,)
        Number of the first reading.
    repeats : ndarray of int, shape (n,)
        Number of readings.
    chi2 : ndarray, shape (n, m)
        Sum of squared deviations of the readings, each over its variance.
    group : ndarray of int, shape (readings,)
        Number of the value of each reading.
    away : ndarray, shape (readings, m)
        Reading minus mean, over the standard deviation of the reading.
    share : ndarray, shape (readings, m)
        Weight of a reading over the total weight of its value.
    """

    value: np.ndarray
    sd: np.ndarray
    first: np.ndarray
    repeats: np.ndarray
    chi2: np.ndarray
    group: np.ndarray
    away: np.ndarray
    share: np.ndarray


def average_readings(label, value, sd, *, angle=False):
    """Average readings with equal labels.

    Readings with standard deviation 0 are not averaged.

    Parameters
    ----------
    label : ndarray of int, shape (n,)
    value, sd : ndarray, shape (n,) or (n, m)
    angle : bool
        True: values that differ by a full turn (2 pi rad) are equal.

    Returns
    -------
    Averages
    """
    n = len(label)
    value, sd = (np.asarray(a, dtype=float).reshape(n, -1 if n else 1) for a in (value, sd))
    fixed = (sd == 0).any(axis=1)
    # A weight 1/0 is undefined: each fixed reading receives a label of its own.
    label = np.where(fixed, np.max(label, initial=0) + 1 + np.arange(n), label)
    _, first, group, repeats = np.unique(
        label, return_index=True, return_inverse=True, return_counts=True
    )
    # np.unique sorts by label; restore the order of first readings.
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first, group, repeats = first[order], rank[group], repeats[order]
    # Average differences from the first reading: they are small, which limits rounding and lets
    # angles be reduced to one turn.
    away = value - value[first][group]
    if angle:
        away -= 2 * np.pi * np.round(away / (2 * np.pi))
    weight = 1.0 / np.where(sd > 0, sd, 1.0) ** 2
    total, mean, chi2 = (np.zeros((len(first), value.shape[1])) for _ in range(3))
    np.add.at(total, group, weight)
    np.add.at(mean, group, weight * away)
    mean /= total
    off = np.sqrt(weight) * (away - mean[group])
    np.add.at(chi2, group, off**2)
    # A single reading keeps its standard deviation exactly.
    mean_sd = np.where((repeats == 1)[:, None], sd[first], 1.0 / np.sqrt(total))
    share = weight / total[group]
    return Averages(value[first] + mean, mean_sd, first, repeats, chi2, group, off, share)


def contradictory_labels(label, averages):
    """Give readings of a contradictory value labels of their own.

    A value is contradictory if its readings fail the test of scatter, but pass it without the worst
    reading. Each reading is then adjusted separately, so that data snooping can identify the worst.

    Parameters
    ----------
    label : ndarray of int, shape (readings,)
    averages : Averages

    Returns
    -------
    ndarray of int, shape (readings,)
    """
    dof = averages.repeats - 1
    # Bounds with n - 1 degrees of freedom for all readings, n - 2 without one of them.
    limit, without = (
        chdtri(np.maximum(dof - i, 1), LEVEL / max(np.count_nonzero(dof), 1))[:, None]
        for i in (0, 1)
    )
    single = np.minimum(averages.share, 0.999)
    # Removing reading i lowers chi2 by d_i^2 / (1 - p_i / sum p), as its mean moves too.
    chi2_without = averages.chi2[averages.group] - averages.away**2 / (1 - single)
    agree = (chi2_without <= without[averages.group]).all(axis=1)
    torn = (averages.chi2 > limit).any(axis=1) & (dof > 0)
    torn &= np.bincount(averages.group, weights=agree, minlength=len(dof)) > 0
    if not torn.any():
        return label
    separate = np.max(label, initial=0) + 1 + np.arange(len(label))
    return np.where(torn[averages.group], separate, label)


def average_repeated(observations, label, warnings, *, name_of=None, apart=False):
    """Replace repeated observations by their weighted means.

    Parameters
    ----------
    observations : Observations
        Single readings with their Trace.
    label : ndarray of int, shape (n,)
        Equal for readings of the same value.
    warnings : list of Problem
        Receives warnings of excessive scatter.
    name_of : callable, optional
        name_of(ids, element) names a value in warnings; default: its names joined by hyphens.
    apart : bool
        True: values contradicted by a single reading are not averaged.

    Returns
    -------
    Observations
        In the order of their first readings; the Trace has number and scatter of the readings.
    """
    if not len(observations):
        return observations
    angle = observations.unit == "rad"
    means = average_readings(label, observations.value, observations.sd, angle=angle)
    warnings += _scatter_warnings(means, observations.trace, name_of or _join)
    torn = contradictory_labels(label, means) if apart else label
    if torn is not label:
        means = average_readings(torn, observations.value, observations.sd, angle=angle)
    first = observations.taken(means.first)
    value, sd = (np.reshape(column, np.shape(first.value)) for column in (means.value, means.sd))
    trace = replace(first.trace, repeats=means.repeats, scatter=means.chi2.sum(axis=1))
    return replace(first, value=value, sd=sd, trace=trace)


def _join(ids, element):
    return "-".join(ids)


def _scatter_warnings(averages, trace, name_of):
    """Problem rows for repeated readings whose scatter contradicts their standard deviations.

    Each value is tested at a level that gives one false alarm in a thousand files. A second test
    uses all values together.

    Parameters
    ----------
    averages : Averages
    trace : Trace
        Trace of the readings.
    name_of : callable
        See `average_repeated`.
    """
    dof = (averages.repeats - 1)[:, None] * np.ones(averages.chi2.shape[1], dtype=int)
    tested = int(np.count_nonzero(dof))
    if not tested:
        return []
    # Bonferroni: dividing the level by the number of tests keeps the level of the whole file.
    limit = chdtri(np.maximum(dof, 1), LEVEL / tested)
    ratio = np.where(dof > 0, averages.chi2 / limit, 0.0).max(axis=1)
    problems = []
    # The five worst values represent a file; more lines would repeat the finding.
    for i in np.argsort(-ratio)[:5]:
        if ratio[i] > 1:
            share, first = np.sqrt((averages.chi2[i] / dof[i]).max()), averages.first[i]
            text = message(
                "readings_scatter",
                "the {count} readings of {what} scatter {times:.1f} times as much as their standard"
                " deviations say",
                count=averages.repeats[i],
                what=name_of(trace.ids[first], trace.element[first]),
                times=share,
            )
            problems.append(Problem(trace.file, text, trace.rows[first]))
    return problems + _test_all(averages.chi2.sum(), int(dof.sum()), trace.file, bool(problems))


def _test_all(chi2, dof, file, is_reported):
    """Problem rows of the two-sided chi-square test of all repeated readings together."""
    share = np.sqrt(chi2 / dof)
    high, low = chdtri(dof, [LEVEL / 2, 1 - LEVEL / 2])
    # Too large a scatter has been reported for single values already.
    if low <= chi2 <= high or (is_reported and chi2 > high):
        return []
    text = message(
        "all_readings_scatter",
        "all repeated readings together scatter {times:.2f} times as much as their standard"
        " deviations say ({dof} degrees of freedom)",
        times=share,
        dof=dof,
    )
    return [Problem(file, text)]


def reject_scattered(measurements):
    """Reject repeated readings of image points that scatter beyond the limit.

    If the sample standard deviation in x or y exceeds settings.reading_limit_mm, all readings of
    the point in that photo are rejected. The scatter does not show which reading is wrong (Silva).

    Returns
    -------
    measurements : Measurements
        Without the rejected readings.
    repeated : RepeatedReadings or None
        None: no point was read repeatedly.
    warnings : list of Problem
    """
    images, limit = measurements.image_points, measurements.settings.reading_limit_mm
    if images is None:
        return measurements, None, []
    names = list(zip(images.photo, images.point, images.check.tolist(), strict=True))
    groups = group_readings(names, images.xy_mm)
    several, bad = np.flatnonzero(groups.count > 1), groups.exceeds(limit)
    if not len(several):
        return measurements, None, []
    # The first reading represents its group in messages.
    rejected = tuple(
        RejectedReadings(
            *names[groups.first[i]][:2], int(groups.count[i]), groups.sd[i],
            images.rows[groups.first[i]] if images.rows else None,
        )
        for i in np.flatnonzero(bad)
    )  # fmt: skip
    repeated = RepeatedReadings(
        photo=tuple(names[groups.first[i]][0] for i in several),
        point=tuple(names[groups.first[i]][1] for i in several),
        count=groups.count[several],
        mean_mm=groups.mean[several],
        sd_mm=groups.sd[several],
        limit_mm=limit,
        rejected=rejected,
    )
    if rejected:
        measurements = replace(
            measurements, image_points=select_readings(images, ~bad[groups.group])
        )
    return measurements, repeated, _rejection_warnings(rejected, limit, images.file)


def select_readings(images, keep):
    """ImageReadings of the rows where a mask (n,) is True."""
    rows = np.flatnonzero(keep)

    def select(values):
        return tuple(values[i] for i in rows)

    shared = images.shared_sd_mm
    return replace(
        images,
        photo=select(images.photo),
        point=select(images.point),
        xy_mm=images.xy_mm[rows],
        sd_mm=images.sd_mm[rows],
        check=images.check[rows],
        rows=select(images.rows) if images.rows else (),
        shared_sd_mm=None if shared is None else shared[rows],
    )


def _rejection_warnings(rejected, limit, file):
    """Problem rows of rejected readings: the first ones, and the number of the others."""
    problems = [
        Problem(
            file,
            message(
                "readings_rejected",
                "the {count} readings of point {point} in photo {photo} are rejected: their"
                " standard deviation of {sd_um:.1f} um exceeds reading_limit_um = {limit_um:g}",
                count=rejected_point.count,
                point=rejected_point.name,
                photo=rejected_point.photo,
                sd_um=1e3 * np.nanmax(rejected_point.sd_mm),
                limit_um=1e3 * limit,
            ),
            rejected_point.row,
        )
        for rejected_point in rejected
    ]
    if len(problems) <= TOLD:
        return problems
    more = len(problems) - TOLD + 1
    text = message(
        "more_rejected",
        "the readings of {more} more points exceed reading_limit_um and are rejected",
        more=more,
    )
    return [*problems[: TOLD - 1], Problem(file, text)]
