"""Watching of a tank in service: when did a cause begin, which cause, and how certain is it?

For a cause that began at t0, with e = L^-1 y the innovations and c = L^-1 (its column),

    w(T, t0) = sum_T c e / sqrt(sum_T c^2),   size = sum c e / sum c^2,   sd = 1 / sqrt(sum c^2).

The largest |w| over kinds and beginnings is compared with a limit (generalised likelihood ratio).
The limit is the larger of two quantiles of the largest |w| without any fault: for innovations drawn
by the model, and for blocks of fourteen days drawn from the innovations of the tank. A model that
is nearly right has slow errors that the first limit does not know.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.products.upkeep.filtering import total_innovations, whiten_steps
from tankcal.tank.liquid.adjustment import ALIKE

DAY_S = 86400.0
STARTS_DAYS = 7.0  # between two beginnings of a cause
BLOCK_DAYS = 14.0  # of the innovations of the tank
LEAST_TANK_DAYS = 180.0  # for a limit by the innovations of the tank
PROVISIONAL = 1.5  # factor on the limit of the model before
NAMED_AFTER_DAYS = 7.0  # from the alarm to the earliest name
JUMPS = ("zero", "batch")  # causes that a single step shows
LEAST_DAYS = 2.0  # of data after a beginning, before a cause is tested
DRAWS, SEED = 2000, 20250106
MOST_JUMPS = 20  # steps with the largest innovations, in which a jump is tested
SIR_SD = 3.29  # probability of detection 95 % at 5 % of false alarms: 2 x 1.645 sd


@dataclass(frozen=True)
class Suspect:
    """Cause that may have begun.

    Attributes
    ----------
    kind : str
    member : str or None
        Meter.
    unit : str
    start_s : float
        Beginning, seconds after the first mark.
    size, sd, w : float
        By all steps.
    """

    kind: str
    member: str | None
    unit: str
    start_s: float
    size: float
    sd: float
    w: float


@dataclass(frozen=True)
class Watch:
    """Result of watching.

    Attributes
    ----------
    limit : float
        Limit of |w|.
    limit_of_model : float
    limit_of_tank : float or None
        None: too few days.
    is_provisional : bool
    largest : float
        Largest |w| so far.
    alarm_s : float or None
        Time of the first alarm, seconds after the first mark.
    suspects : tuple of Suspect
        Best beginning of each kind, the most likely first.
    names : tuple of Suspect
        Suspects that the data do not distinguish from the most likely; () without an alarm.
    is_named : bool
        Whether a single cause is left, and a week has passed since the alarm.
    rate : float
        Promised false alarms per year.
    false_alarms : float
        Probability of an alarm without fault over the time watched, by the innovations of the tank.
    """

    limit: float
    limit_of_model: float
    limit_of_tank: float | None
    is_provisional: bool
    largest: float
    alarm_s: float | None
    suspects: tuple
    names: tuple
    is_named: bool
    rate: float
    false_alarms: float | None


def watch(estimation, false_alarm_per_year=0.05):
    """Search for causes that began during the steps of an estimation.

    Parameters
    ----------
    estimation : estimation.Estimation
    false_alarm_per_year : float

    Returns
    -------
    Watch
    """
    seconds = np.append(0.0, np.cumsum(estimation.steps.seconds))
    end = seconds[1:]
    # Rejected steps are watched as well: a withdrawal, or a jump of the gauge, is a single step.
    balance, is_used = estimation.balance, estimation.steps.is_used
    drift = replace(balance.drift, is_used=is_used)
    rows = whiten_steps(drift, np.column_stack([balance.misclosure_m3, balance.columns_m3])).rows
    jumps = _find_jumps(estimation.innovations, total_innovations(rows, is_used)[:, 0])
    kinds, columns = _columns(estimation, end, jumps)
    both = total_innovations(rows, is_used, whiten_steps(drift, columns).rows)
    innovations, effects = both[:, 0], both[:, 1:]
    day = np.floor(end / DAY_S).astype(int)
    edges = np.flatnonzero(np.append(day[1:] != day[:-1], True)) + 1
    days = max(seconds[-1] / DAY_S, 1.0)
    information = _sums(effects**2, edges)
    starts = np.array([start for _, _, _, start in kinds])
    waits = np.where([kind in JUMPS for kind, *_ in kinds], -1.0, LEAST_DAYS * DAY_S)
    is_tested = (end[edges - 1][:, None] > starts + waits) & (
        information > 1e-6 * np.max(information, initial=1e-300)
    )
    root = np.sqrt(np.where(is_tested, information, np.inf))
    w = _sums(effects * innovations[:, None], edges) / root
    share = 1 - min(false_alarm_per_year * days / 365.25, 0.5)
    rng = np.random.default_rng(SEED)
    by_model = _largest(effects, root, edges, rng.normal(size=(DRAWS, len(end))) * is_used)
    limit = limit_of_model = float(np.quantile(by_model, share))
    limit_of_tank, false_alarms, size_of = None, None, np.abs(w).max(axis=1)
    # A fault must not raise its limit: after a |w| that no valid tank has, only the innovations
    # before the first suspicion are drawn.
    pool = len(end)
    if np.any(size_of > PROVISIONAL * limit_of_model):
        pool = int(edges[np.argmax(size_of > limit_of_model)])
    if end[pool - 1] >= LEAST_TANK_DAYS * DAY_S:
        blocks = _draw_blocks(innovations, end, pool, rng, DRAWS // 4)
        by_tank = _largest(effects, root, edges, blocks)
        limit_of_tank = float(np.quantile(by_tank, share))
        limit = max(limit, limit_of_tank)
        false_alarms = float(np.mean(by_tank > limit))
    else:
        limit = PROVISIONAL * limit
    alarms = np.flatnonzero(size_of > limit)
    alarm_s = float(end[edges[alarms[0]] - 1]) if len(alarms) else None
    suspects = _suspects(kinds, w[-1], root[-1])
    names, is_named = (), False
    if alarm_s is not None:
        best = suspects[0].w ** 2
        names = tuple(cause for cause in suspects if best - cause.w**2 < ALIKE)
        is_named = len(names) == 1 and seconds[-1] - alarm_s >= NAMED_AFTER_DAYS * DAY_S
    return Watch(limit, limit_of_model, limit_of_tank, limit_of_tank is None,
                 float(size_of.max(initial=0.0)), alarm_s, suspects, names, is_named,
                 false_alarm_per_year, false_alarms)  # fmt: skip


def _find_jumps(robust, innovations):
    """Steps with a large innovation, of all steps and without the rejected steps, at most 20."""
    size = np.maximum(np.abs(innovations), np.abs(robust))
    return np.sort(np.argsort(-size)[:MOST_JUMPS])


def _columns(estimation, end, jumps):
    """([(kind, member, unit, start)], columns (n, q)) of every kind and beginning."""
    balance, steps = estimation.balance, estimation.steps
    drift, metered = balance.drift, balance.drift.metered_m3
    starts = np.arange(0.0, max(end[-1] - LEAST_DAYS * DAY_S, 1.0), STARTS_DAYS * DAY_S)
    # A cause that changes a level or a temperature acts on the increase of the stock.
    constant = [
        ("leak", None, "L/h", drift.seconds / 3.6e6),
        ("throughput", None, "%", metered.sum(axis=1) / 100),
    ]
    if len(steps.meters) > 1:
        constant += [("meter", name, "%", metered[:, place] / 100)
                     for place, name in enumerate(steps.meters)]  # fmt: skip
    if np.any(steps.tickets):
        constant.append(("ticket", None, "%", -steps.delivered_m3 / 100))
    at_marks = [
        ("gauge_scale", None, "mm/m", -drift.area_m2 * balance.level_m / 1000),
        ("temperature", None, "K", drift.by_degree_m3),
    ]
    kinds, columns = [], []
    start_of_step = end - drift.seconds
    for start in starts:
        begun = start_of_step >= start
        for kind, member, unit, column in constant:
            if np.any(column[begun]):
                kinds.append((kind, member, unit, start))
                columns.append(np.where(begun, column, 0.0))
        marks_begun = np.append(0.0, end) > start
        for kind, member, unit, stock in at_marks:
            # A change at the first mark is no change: it is the prior's cause itself.
            if start > 0 and np.any(stock):
                kinds.append((kind, member, unit, start))
                columns.append(np.diff(np.where(marks_begun, stock, 0.0)))
    stock = -drift.area_m2 / 1000
    for step in jumps:
        kinds += [("zero", None, "mm", end[step]), ("batch", None, "L", end[step])]
        marks_begun = np.arange(len(stock)) > step
        columns.append(np.diff(np.where(marks_begun, stock, 0.0)))
        columns.append(np.where(np.arange(len(end)) == step, 1e-3, 0.0))
    return kinds, np.stack(columns, axis=1)


def _sums(values, edges):
    """Cumulative sums (days, q) at the last step of each day."""
    return np.cumsum(values, axis=0)[edges - 1]


def _largest(effects, root, edges, draws):
    """Largest |w| (d,) over days and causes for innovations (d, n)."""
    total = np.zeros((len(draws), effects.shape[1]))
    largest, first = np.zeros(len(draws)), 0
    for row, last in enumerate(edges):
        total += draws[:, first:last] @ effects[first:last]
        first = last
        largest = np.maximum(largest, np.max(np.abs(total) / root[row], axis=1))
    # A jump is searched in the step with the largest innovation.
    return np.maximum(largest, np.max(np.abs(draws), axis=1, initial=0.0))


def _draw_blocks(innovations, end, pool, rng, count):
    """Innovations (count, n) of random blocks of fourteen days of the first `pool` steps."""
    length = np.searchsorted(end, end[0] + BLOCK_DAYS * DAY_S)
    blocks = int(np.ceil(len(innovations) / length))
    begin = rng.integers(0, pool - length + 1, size=(count, blocks))
    sign = rng.choice([-1.0, 1.0], size=(count, blocks))
    drawn = innovations[begin[:, :, None] + np.arange(length)] * sign[:, :, None]
    return drawn.reshape(count, -1)[:, : len(innovations)]


def _suspects(kinds, w, root):
    """Best beginning of each kind and member, the most likely first."""
    best = {}
    for place, (kind, member, unit, start) in enumerate(kinds):
        if np.isfinite(root[place]):
            suspect = Suspect(kind, member, unit, float(start), float(w[place] / root[place]),
                              float(1 / root[place]), float(w[place]))  # fmt: skip
            known = best.get((kind, member))
            if known is None or abs(suspect.w) > abs(known.w):
                best[kind, member] = suspect
    return tuple(sorted(best.values(), key=lambda suspect: -abs(suspect.w)))
