"""Watching of a tank in service: when did a cause begin, which cause, and how certain is it?

For a cause that began at t0, with e = L^-1 y the innovations and c = L^-1 (its column),

    w(T, t0) = sum_T c e / sqrt(sum_T c^2),   size = sum c e / sum c^2,   sd = 1 / sqrt(sum c^2).

The largest |w| over kinds and beginnings is compared with a limit (generalised likelihood ratio).
The limit is the larger of two quantiles of the largest |w| without any fault: for innovations drawn
by the model, and for blocks of fourteen days drawn from the innovations of the tank. A model that
is nearly right has slow errors that the first limit does not know.

Causes are searched in windows: a period of the estimation and a quarter of a year before it. Each
cause is therefore tested for a quarter of a year at least, after which its sd hardly falls.

The search has weekly beginnings. After an alarm, the beginning of each suspect is any mark. Its
size is the mean over all beginnings t, with weights by their profile likelihood, and its variance
contains the unknown beginning:

    p_t ~ exp(w_t^2 / 2),   size = sum p_t size_t,   u^2 = sum p_t (sd_t^2 + (size_t - size)^2).

The refined beginnings do not enter the alarm, so that its limit needs no further draws.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.products.upkeep.filtering import (
    FilterState,
    add_rows,
    start_triangle,
    total_innovations,
    whiten_steps,
)
from tankcal.products.upkeep.logs import OFFSET_STEP_S
from tankcal.products.upkeep.saved import NO_STATE, UpkeepSuspect, UpkeepWatch
from tankcal.tank.liquid.adjustment import ALIKE

DAY_S = 86400.0
STARTS_DAYS = 7.0  # between two beginnings of a cause
BLOCK_DAYS = 14.0  # of the innovations of the tank
LEAST_TANK_DAYS = 180.0  # for a limit by the innovations of the tank
PROVISIONAL = 1.5  # factor on the limit of the model before
NAMED_AFTER_DAYS = 7.0  # from the alarm to the earliest name
JUMPS = ("zero", "batch")  # causes that a single step shows
LEAST_DAYS = 2.0  # of data after a beginning, before a cause is tested
DRAWS, SEED = 600, 20250106
OVERLAP_S = 91 * DAY_S  # of a window with the period before
MOST_JUMPS = 20  # steps with the largest innovations, in which a jump is tested
JUMP_STEPS = 8  # steps in which a jump shows, for its limit
MOST_SUSPECTS = 8  # of which the beginnings are refined
UNLIKELY = 12.0  # less in w^2 than the best beginning: a weight of 0.0025
MOST_BEGINNINGS = 150  # refined beginnings of a suspect
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
        Most likely beginning, seconds after the first mark.
    size, sd : float
        Estimate and its standard uncertainty by all steps; with the unknown beginning if refined.
    w : float
        Of the most likely beginning.
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
    suspects: tuple[Suspect, ...]
    names: tuple[Suspect, ...]
    is_named: bool
    rate: float
    false_alarms: float | None

    def to_save(self, day):
        """Return the saved.UpkeepWatch; day(seconds) is the date of a time after the first mark."""
        suspects = [
            UpkeepSuspect(suspect.kind, suspect.member, suspect.unit, day(suspect.start_s),
                          suspect.size, suspect.sd, suspect.w, suspect in self.names)
            for suspect in self.suspects[:MOST_SUSPECTS]
        ]  # fmt: skip
        return UpkeepWatch(
            self.rate, self.limit, self.limit_of_model, self.limit_of_tank, self.is_provisional,
            self.false_alarms, self.largest, None if self.alarm_s is None else day(self.alarm_s),
            self.is_named, suspects,
        )  # fmt: skip


def watch(estimation, false_alarm_per_year=0.05, state=NO_STATE):
    """Search for causes that began during the steps of an estimation.

    Parameters
    ----------
    estimation : estimation.Estimation
    false_alarm_per_year : float
    state : state.State, optional
        Results of earlier runs; they are used for windows with equal steps.

    Returns
    -------
    Watch
        Of the last window, with the first alarm of all windows. If only an earlier window has an
        alarm, its suspects.
    """
    seconds = np.append(0.0, np.cumsum(estimation.steps.seconds))
    windows = []
    for first, last, key in estimation.periods:
        begin = int(np.searchsorted(seconds, seconds[first] - OVERLAP_S)) if first else 0
        key = state.key(key, false_alarm_per_year)
        window = state.load(key, Watch)
        if window is None:
            window = _watch_window(estimation, begin, first, last, false_alarm_per_year)
            state.save(key, window)
        windows.append(window)
    alarms = [window for window in windows if window.alarm_s is not None]
    is_old = alarms and windows[-1].alarm_s is None
    shown = alarms[-1] if is_old else windows[-1]
    return replace(
        shown, largest=max(window.largest for window in windows),
        alarm_s=min((window.alarm_s for window in alarms), default=None),
    )  # fmt: skip


def suspect_clock(watched, start_s, offset_s):
    """Make a wrong clock of the levels a possible cause of an alarm, beside all others.

    Levels at the wrong time are read during sales, so that each other cause may only seem to have
    begun.

    Parameters
    ----------
    watched : Watch
        With an alarm.
    start_s : float
        First rows with an offset, seconds after the first mark.
    offset_s : float

    Returns
    -------
    Watch
    """
    sd = OFFSET_STEP_S / np.sqrt(12)
    clock = Suspect("clock", None, "s", max(start_s, 0.0), offset_s, sd, offset_s / sd)
    return replace(watched, suspects=(clock, *watched.suspects), names=(clock, *watched.names),
                   is_named=False)  # fmt: skip


def _watch_window(estimation, begin, first, last, rate):
    """`Watch` of causes that began in the steps begin to last - 1 of the period from `first` on."""
    seconds = np.append(0.0, np.cumsum(estimation.steps.seconds[:last]))
    # Rejected steps are watched as well: a withdrawal, or a jump of the gauge, is a single step.
    balance, is_used = estimation.balance, estimation.steps.is_used[:last]
    drift = replace(balance.drift.part(0, last), is_used=is_used)
    data = np.column_stack([balance.misclosure_m3, balance.columns_m3])[:last]
    white, upper = None, None
    if begin:
        before = whiten_steps(drift.part(0, begin), data[:begin])
        white = before.end
        upper = add_rows(start_triangle(data.shape[1] - 1), before.rows, is_used[:begin]).upper
    drift, data, is_used = drift.part(begin, last), data[begin:], is_used[begin:]
    rows = whiten_steps(drift, data, white).rows
    robust, end = estimation.innovations[begin:last], seconds[begin + 1 :]
    jumps = _find_jumps(robust, total_innovations(rows, is_used, upper=upper)[:, 0])
    causes = _list_causes(estimation.steps, balance.level_m[begin : last + 1], drift,
                          estimation.steps.delivered_m3[begin:last])  # fmt: skip

    def find_effects(trials):
        """Innovations (n, 1 + q) of the misclosures, and of causes with their beginnings."""
        columns = np.stack([cause.column(seconds[begin:], at) for cause, at in trials], axis=1)
        start = white and FilterState(np.zeros((len(white.mean), len(trials))), white.covariance)
        effects = whiten_steps(drift, columns, start).rows
        return total_innovations(rows, is_used, effects, upper=upper)

    trials = _list_trials(causes, seconds[begin:], jumps)
    both = find_effects(trials)
    innovations, effects = both[:, 0], both[:, 1:]
    day = np.floor(end / DAY_S).astype(int)
    edges = np.flatnonzero(np.append(day[1:] != day[:-1], True)) + 1
    days = max((seconds[-1] - seconds[first]) / DAY_S, 1.0)
    information = _sums(effects**2, edges)
    starts = np.array([at for _, at in trials])
    waits = np.where([cause.kind in JUMPS for cause, _ in trials], -1.0, LEAST_DAYS * DAY_S)
    is_tested = (end[edges - 1][:, None] > starts + waits) & (
        information > 1e-6 * np.max(information, initial=1e-300)
    )
    root = np.sqrt(np.where(is_tested, information, np.inf))
    w = _sums(effects * innovations[:, None], edges) / root
    share = 1 - min(rate * days / 365.25, 0.5)
    rng = np.random.default_rng(SEED)
    kernels = _find_kernels(trials, effects, seconds[begin + 1 :])
    by_model = _largest(effects, root, edges, kernels,
                        rng.normal(size=(DRAWS, len(end))) * is_used)  # fmt: skip
    limit = limit_of_model = float(np.quantile(by_model, share))
    limit_of_tank, false_alarms, size_of = None, None, np.abs(w).max(axis=1)
    # The innovations of all periods are drawn. A fault must not raise its limit: after a |w| that
    # no valid tank has, only the innovations before the first suspicion are drawn.
    pool = np.append(estimation.innovations[:begin], innovations)
    if np.any(size_of > PROVISIONAL * limit_of_model):
        # Without the day of the suspicion: a jump is a single large innovation.
        day = np.argmax(size_of > limit_of_model)
        pool = pool[: begin + (edges[day - 1] if day else 0)]
    if seconds[len(pool)] >= LEAST_TANK_DAYS * DAY_S:
        blocks = _draw_blocks(pool, seconds, len(end), rng, DRAWS)
        by_tank = _largest(effects, root, edges, kernels, blocks)
        limit_of_tank = float(np.quantile(by_tank, share))
        limit = max(limit, limit_of_tank)
        false_alarms = float(np.mean(by_tank > limit))
    else:
        limit = PROVISIONAL * limit
    alarms = np.flatnonzero(size_of > limit)
    alarm_s = float(end[edges[alarms[0]] - 1]) if len(alarms) else None
    suspects = _find_suspects(trials, w[-1], root[-1])
    names, is_named = (), False
    if alarm_s is not None:
        suspects = _refine_beginnings(suspects, trials, w[-1], seconds[begin:], find_effects)
    suspects = tuple(replace(cause, kind="gain") if cause.kind == "leak" and cause.size < 0 else
                     cause for cause in suspects)  # fmt: skip
    if alarm_s is not None:
        best = suspects[0].w ** 2
        names = tuple(cause for cause in suspects if best - cause.w**2 < ALIKE)
        is_named = len(names) == 1 and seconds[-1] - alarm_s >= NAMED_AFTER_DAYS * DAY_S
    return Watch(limit, limit_of_model, limit_of_tank, limit_of_tank is None,
                 float(size_of.max(initial=0.0)), alarm_s, suspects, names, is_named,
                 rate, false_alarms)  # fmt: skip


def _find_jumps(robust, innovations):
    """Steps with a large innovation, of all steps and without the rejected steps, at most 20."""
    size = np.maximum(np.abs(innovations), np.abs(robust))
    return np.sort(np.argsort(-size)[:MOST_JUMPS])


@dataclass(frozen=True)
class Cause:
    """Cause that can begin at any mark.

    Attributes
    ----------
    kind, member, unit : str or None
    unit_m3 : ndarray
        Effect of a unit on each step, shape (n,), or on the stock at each mark, shape (n + 1,).
    """

    kind: str
    member: str | None
    unit: str
    unit_m3: np.ndarray

    def column(self, seconds, start_s):
        """Effect (n,) of a unit from `start_s` on; `seconds` (n + 1,) are the times of the marks.

        A single volume belongs to the step that ends at `start_s`.
        """
        if self.kind == "batch":
            return np.where(seconds[1:] == start_s, self.unit_m3, 0.0)
        if len(self.unit_m3) == len(seconds):
            return np.diff(np.where(seconds >= start_s, self.unit_m3, 0.0))
        return np.where(seconds[:-1] >= start_s, self.unit_m3, 0.0)


def _list_causes(steps, level_m, drift, delivered_m3):
    """`Cause` of every kind and member."""
    metered = drift.metered_m3
    causes = [
        Cause("leak", None, "L/h", drift.seconds / 3.6e6),
        Cause("throughput", None, "%", metered.sum(axis=1) / 100),
    ]
    if len(steps.meters) > 1:
        causes += [Cause("meter", name, "%", metered[:, place] / 100)
                   for place, name in enumerate(steps.meters)]  # fmt: skip
    # A cause that changes a level or a temperature acts on the increase of the stock.
    return [
        *causes,
        Cause("ticket", None, "%", -delivered_m3 / 100),
        Cause("gauge_scale", None, "mm/m", -drift.area_m2 * level_m / 1000),
        Cause("temperature", None, "K", drift.by_degree_m3),
        Cause("zero", None, "mm", -drift.area_m2 / 1000),
        Cause("batch", None, "L", np.full(len(drift), 1e-3)),
    ]


def _list_trials(causes, seconds, jumps):
    """[(`Cause`, beginning)] of the search: weekly, and in the steps `jumps`."""
    starts = np.arange(seconds[0], max(seconds[-1] - LEAST_DAYS * DAY_S, seconds[0] + 1.0),
                       STARTS_DAYS * DAY_S)  # fmt: skip
    trials = []
    for start in starts:
        for cause in causes:
            # A change at the first mark is no change: it is the prior's cause itself.
            is_late = start > seconds[0] or len(cause.unit_m3) < len(seconds)
            if cause.kind not in JUMPS and is_late and np.any(cause.column(seconds, start)):
                trials.append((cause, float(start)))
    return trials + [(cause, float(seconds[step + 1])) for step in jumps for cause in causes
                     if cause.kind in JUMPS]  # fmt: skip


def _sums(values, edges):
    """Cumulative sums (days, q) at the last step of each day."""
    return np.cumsum(values, axis=0)[edges - 1]


def _find_kernels(trials, effects, end):
    """Mean effects of jumps on their own step and the steps after it, a unit vector per kind."""
    kernels = []
    for kind in JUMPS:
        columns = [
            effects[step : step + JUMP_STEPS, place]
            for place, (cause, at) in enumerate(trials)
            if cause.kind == kind
            for step in [int(np.searchsorted(end, at))]
            if step + JUMP_STEPS <= len(effects) and effects[step, place] != 0
        ]
        if columns:
            mean = np.sum([column / (column[0] * np.linalg.norm(column / column[0]))
                           for column in columns], axis=0)  # fmt: skip
            kernels.append(mean / np.linalg.norm(mean))
    return kernels


def _largest(effects, root, edges, kernels, draws):
    """Largest |w| (d,) over days and causes for innovations (d, n)."""
    # Single precision halves the time, and is far below the scatter of the draws.
    effects, scale, draws = (values.astype(np.float32) for values in (effects, 1 / root, draws))
    total = np.zeros((len(draws), effects.shape[1]), dtype=np.float32)
    largest, first = np.zeros(len(draws), dtype=np.float32), 0
    order = np.argsort(np.argmax(scale > 0, axis=0), kind="stable")  # in the order of testing
    effects, scale = effects[:, order], scale[:, order]
    scaled = np.empty_like(total)
    for row, last in enumerate(edges):
        begun = np.flatnonzero(np.any(effects[first:last] != 0, axis=0)).max(initial=-1) + 1
        total[:, :begun] += draws[:, first:last] @ effects[first:last, :begun]
        first = last
        tested = int(np.flatnonzero(scale[row]).max(initial=-1)) + 1
        if tested:
            np.multiply(total[:, :tested], scale[row, :tested], out=scaled[:, :tested])
            np.maximum(largest, scaled[:, :tested].max(axis=1), out=largest)
            np.maximum(largest, -scaled[:, :tested].min(axis=1), out=largest)
    # A jump is searched in the steps with the largest innovations of this draw. It shows in its own
    # step, and more clearly with the steps after it.
    largest = np.maximum(largest, np.max(np.abs(draws), axis=1, initial=0.0))
    count = draws.shape[1] - JUMP_STEPS + 1
    for kernel in kernels:
        jump = sum(share * draws[:, lag : lag + count]
                   for lag, share in enumerate(kernel.astype(np.float32)))  # fmt: skip
        largest = np.maximum(largest, np.max(np.abs(jump), axis=1, initial=0.0))
    return largest.astype(float)


def _draw_blocks(pool, seconds, count, rng, draws):
    """Innovations (draws, count) of random blocks of fourteen days of the innovations `pool`."""
    length = min(int(np.searchsorted(seconds, BLOCK_DAYS * DAY_S)), len(pool))
    blocks = int(np.ceil(count / length))
    begin = rng.integers(0, len(pool) - length + 1, size=(draws, blocks))
    sign = rng.choice([-1.0, 1.0], size=(draws, blocks))
    drawn = pool[begin[:, :, None] + np.arange(length)] * sign[:, :, None]
    return drawn.reshape(draws, -1)[:, :count]


def _find_suspects(trials, w, root):
    """Best beginning of each kind and member, the most likely first."""
    best = {}
    for place, (cause, at) in enumerate(trials):
        if np.isfinite(root[place]):
            suspect = Suspect(cause.kind, cause.member, cause.unit, at,
                              float(w[place] / root[place]), float(1 / root[place]),
                              float(w[place]))  # fmt: skip
            known = best.get((cause.kind, cause.member))
            if known is None or abs(suspect.w) > abs(known.w):
                best[cause.kind, cause.member] = suspect
    return _sort_suspects(best.values())


def _sort_suspects(suspects):
    """Suspects, the most likely first."""
    return tuple(sorted(suspects, key=lambda suspect: -abs(suspect.w)))


def _refine_beginnings(suspects, trials, w, seconds, find_effects):
    """Suspects with beginnings at any mark, and the unknown beginning in their uncertainty."""
    refined, week = list(suspects), STARTS_DAYS * DAY_S
    for place, suspect in enumerate(suspects[:MOST_SUSPECTS]):
        if suspect.kind == "batch":
            continue
        same = [number for number, (cause, _) in enumerate(trials)
               if (cause.kind, cause.member) == (suspect.kind, suspect.member)]  # fmt: skip
        cause, squares = trials[same[0]][0], w[same] ** 2
        near = np.array([trials[number][1] for number in same])[squares > squares.max() - UNLIKELY]
        last = seconds[-1] - (0 if cause.kind in JUMPS else LEAST_DAYS * DAY_S)
        is_near = (seconds > near.min() - week) & (seconds < near.max() + week)
        starts = seconds[is_near & (seconds > seconds[0]) & (seconds <= last)]
        starts = starts[:: len(starts) // MOST_BEGINNINGS + 1]
        both = find_effects([(cause, start) for start in starts])
        information = np.sum(both[:, 1:] ** 2, axis=0)
        is_determined = information > 0
        starts, information = starts[is_determined], information[is_determined]
        sizes = (both[:, 0] @ both[:, 1:])[is_determined] / information
        w_at = sizes * np.sqrt(information)
        best = int(np.argmax(np.abs(w_at)))
        weights = np.exp((w_at**2 - w_at[best] ** 2) / 2)
        weights /= weights.sum()
        size = float(weights @ sizes)
        sd = float(np.sqrt(weights @ (1 / information + (sizes - size) ** 2)))
        refined[place] = replace(suspect, start_s=float(starts[best]), size=size, sd=sd,
                                 w=float(w_at[best]))  # fmt: skip
    return _sort_suspects(refined)
