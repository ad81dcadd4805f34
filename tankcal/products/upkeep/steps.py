"""From quiet levels to steps: the balance of a tank between two quiet marks.

A mark is a quiet piece of the level log. A step leads from a mark to the next: sold by meters,
delivered by tickets, hours and temperatures. Steps that cannot be balanced keep their place and a
reason, because causes that drift continue through them.
"""

from dataclasses import dataclass, replace

import numpy as np

HOUR_NS = 3600 * 10**9
FULL_STEP, FULL_SHARE = 20, 0.01  # quanta, and share of the table: shorter steps are joined
MOST_REST_H = 4.0  # a longer rest is divided, so that a leak shows
JOIN_H = 12.0  # largest distance of a ticket from its rise of the level
JOIN_SHARE = 0.05  # largest difference of a ticket from its rise, relative
NOISE_OF_QUANTUM = 1 / 3  # in quanta; a smaller noise leaves the error of the quantum in a mean
REASONS = ("", "meter_broken", "no_ticket", "ticket_unlike_rise", "water_drawn", "adjusted")


@dataclass(frozen=True)
class Marks:
    """Quiet marks, (m,) each.

    Attributes
    ----------
    time_ns : ndarray of int64
    level_m, sd_m : ndarray
        Level of the gauge and its standard deviation by its readings and the quantum.
    temperature_c : ndarray
        nan: not measured.
    """

    time_ns: np.ndarray
    level_m: np.ndarray
    sd_m: np.ndarray
    temperature_c: np.ndarray


@dataclass(frozen=True)
class Steps:
    """Steps between successive marks; step k leads from mark k to mark k + 1.

    Attributes
    ----------
    marks : Marks
    meters : tuple of str
    sold_m3 : ndarray, shape (n, meters)
        Indication of each meter.
    meter_c : ndarray, shape (n, meters)
        Mean temperature at the meter, weighted by volume; nan: not measured.
    delivered_m3 : ndarray, shape (n,)
        Sum of the tickets.
    delivered_c : ndarray, shape (n,)
        Temperature of the delivered liquid; nan: not measured.
    tickets : ndarray of int, shape (n,)
        Number of tickets.
    reason : ndarray of int, shape (n,)
        Index of REASONS; 0: the step is used.
    """

    marks: Marks
    meters: tuple
    sold_m3: np.ndarray
    meter_c: np.ndarray
    delivered_m3: np.ndarray
    delivered_c: np.ndarray
    tickets: np.ndarray
    reason: np.ndarray

    def __len__(self):
        """Number of steps."""
        return len(self.reason)

    def part(self, first, last):
        """Steps first to last - 1, with their marks."""
        marks = Marks(
            **{name: values[first : last + 1] for name, values in vars(self.marks).items()}
        )
        return replace(self, marks=marks, **{
            name: values[first:last] for name, values in vars(self).items()
            if name not in ("marks", "meters")
        })  # fmt: skip

    @property
    def seconds(self):
        """Duration of each step, shape (n,)."""
        return np.diff(self.marks.time_ns) * 1e-9

    def day(self, at_s):
        """ISO date, UTC, of a time in seconds after the first mark."""
        time = np.datetime64(int(self.marks.time_ns[0] + at_s * 1e9), "ns")
        return str(time.astype("datetime64[D]"))

    @property
    def is_used(self):
        """Whether each step is balanced, shape (n,)."""
        return self.reason == 0

    def select(self, first, last):
        """Steps first to last - 1, with their marks."""
        marks = Marks(*(getattr(self.marks, name)[first : last + 1]
                        for name in Marks.__dataclass_fields__))  # fmt: skip
        others = (getattr(self, name)[first:last]
                  for name in list(Steps.__dataclass_fields__)[2:])  # fmt: skip
        return Steps(marks, self.meters, *others)


@dataclass(frozen=True)
class StepRules:
    """What makes a quiet piece a mark, and a rise of the level a delivery.

    Attributes
    ----------
    quantum_m : float
        Smallest step of the indication.
    noise_m : float
        Standard deviation of a reading; pieces with three times this are not quiet.
    rest_h : float
        Time after a delivery without marks.
    least_delivery_m3 : float
        Smallest rise that is a delivery.
    height_m : float
        Height of the table.
    """

    quantum_m: float
    noise_m: float
    rest_h: float
    least_delivery_m3: float
    height_m: float


@dataclass(frozen=True)
class Tickets:
    """Delivery tickets in order of time, (d,) each.

    Attributes
    ----------
    time_ns : ndarray of int64
    volume_m3 : ndarray
    temperature_c : ndarray
        nan: not measured.
    row : ndarray of int
    """

    time_ns: np.ndarray
    volume_m3: np.ndarray
    temperature_c: np.ndarray
    row: np.ndarray


def mean_sd_m(sd_m, count, quantum_m):
    """Standard deviation of the mean of readings of a gauge with a quantum.

    Readings with little noise fall on a single step, so that the error of the quantum stays in
    their mean.

    Parameters
    ----------
    sd_m : ndarray, shape (n,)
        Standard deviation of a reading.
    count : ndarray of int, shape (n,)
    quantum_m : float

    Returns
    -------
    ndarray, shape (n,)
    """
    by_quantum = quantum_m / np.sqrt(12)
    is_fine = sd_m > NOISE_OF_QUANTUM * quantum_m
    return np.hypot(
        sd_m / np.sqrt(count), np.where(is_fine, by_quantum / np.sqrt(count), by_quantum)
    )


def build_steps(pieces, flows, tickets, volume_m3, rules, findings, events=()):
    """Choose marks among quiet pieces and balance the steps between them.

    Parameters
    ----------
    pieces : levels.Pieces
    flows : sequence of flows.MeterFlow
    tickets : Tickets
    volume_m3 : callable
        Volume of the table at levels.
    rules : StepRules
    findings : logs.Findings
    events : sequence of (int, int)
        Time and index of REASONS of events that no step may contain.

    Returns
    -------
    Steps
    """
    # An offset of a piece from its neighbours, such as a wave, shows in its readings.
    is_quiet = pieces.sd_m <= 3 * max(rules.noise_m, rules.quantum_m / np.sqrt(12))
    findings.add("levels", "not_quiet", pieces.time_ns[~is_quiet], pieces.count[~is_quiet].sum())
    pieces = pieces.select(is_quiet)
    sold = np.array([flow.volume_m3(pieces.time_ns) for flow in flows]).reshape(
        len(flows), len(pieces)
    )
    stock = volume_m3(pieces.level_m)
    # Book less gauge: a rise without enough sale is a delivery.
    gain = np.diff(stock) + np.diff(sold.sum(axis=0))
    is_rise = gain > rules.least_delivery_m3
    after = pieces.time_ns[1:][is_rise]
    place = np.searchsorted(after, pieces.time_ns, side="right") - 1
    since = pieces.time_ns - after[np.maximum(place, 0)] if len(after) else pieces.time_ns
    rests = (place >= 0) & (since < rules.rest_h * HOUR_NS)
    findings.add("levels", "after_delivery", pieces.time_ns[rests], pieces.count[rests].sum())
    chosen = _choose(pieces, ~rests, rules)
    pieces = pieces.select(chosen)
    marks = Marks(pieces.time_ns, pieces.level_m,
                  mean_sd_m(pieces.sd_m, pieces.count, rules.quantum_m),
                  pieces.temperature_c)  # fmt: skip
    return _balance(marks, flows, tickets, volume_m3, rules, findings, events)


def _choose(pieces, is_free, rules):
    """Indices of the pieces that become marks: ends of full steps and of long rests."""
    least = max(FULL_STEP * rules.quantum_m, FULL_SHARE * rules.height_m)
    free = np.flatnonzero(is_free)
    if not len(free):
        return free
    levels, times, windows = pieces.level_m[free], pieces.time_ns[free], pieces.window[free]
    # A long rest has marks at its first and last piece and between them, so that a leak shows.
    is_first = np.append(True, windows[1:] != windows[:-1])
    is_last = np.append(is_first[1:], True)
    rest = np.cumsum(is_first) - 1
    long_rest = (times[is_last] - times[is_first])[rest] >= MOST_REST_H * HOUR_NS
    chosen, last = [], None
    for i in range(len(free)):
        is_edge = long_rest[i] and (is_first[i] or is_last[i])
        if (
            last is None
            or is_edge
            or abs(levels[i] - levels[last]) >= least
            or (long_rest[i] and times[i] - times[last] >= MOST_REST_H * HOUR_NS)
        ):
            chosen.append(i)
            last = i
    return free[chosen]


def _balance(marks, flows, tickets, volume_m3, rules, findings, events):
    """`Steps` between marks."""
    count, time = max(len(marks.time_ns) - 1, 0), marks.time_ns
    sold, meter_c = np.zeros((count, len(flows))), np.full((count, len(flows)), np.nan)
    reason = np.zeros(count, dtype=int)
    for column, flow in enumerate(flows):
        place = np.searchsorted(flow.time_ns, time, side="right")
        sold[:, column] = np.diff(flow.total_m3[place])
        with np.errstate(invalid="ignore", divide="ignore"):
            meter_c[:, column] = np.diff(flow.heat[place]) / sold[:, column]
        reason[flow.is_broken(time[:-1], time[1:])] = REASONS.index("meter_broken")
    gain = np.diff(volume_m3(marks.level_m)) + sold.sum(axis=1)
    delivered, heat, number = np.zeros(count), np.zeros(count), np.zeros(count, dtype=int)
    joined = _join_tickets(time, gain, tickets, rules)
    for ticket, step in enumerate(joined):
        if step >= 0:
            delivered[step] += tickets.volume_m3[ticket]
            heat[step] += tickets.volume_m3[ticket] * tickets.temperature_c[ticket]
            number[step] += 1
    findings.add("deliveries", "no_rise", tickets.time_ns[joined < 0])
    is_rise = gain > rules.least_delivery_m3
    lacks = is_rise & (number == 0)
    findings.add("deliveries", "no_ticket", time[1:][lacks])
    reason[lacks & (reason == 0)] = REASONS.index("no_ticket")
    is_unlike = (number > 0) & (np.abs(delivered - gain) > JOIN_SHARE * delivered)
    reason[is_unlike & (reason == 0)] = REASONS.index("ticket_unlike_rise")
    for moment, code in events:
        step = np.searchsorted(time, moment, side="right") - 1
        if 0 <= step < count:
            reason[step] = code
    with np.errstate(invalid="ignore", divide="ignore"):
        delivered_c = heat / delivered
    return Steps(marks, tuple(flow.name for flow in flows), sold, meter_c, delivered, delivered_c,
                 number, reason)  # fmt: skip


def _join_tickets(time, gain, tickets, rules):
    """Step of each ticket (d,), -1: none; a rise takes the tickets that fit it best together."""
    joined = np.full(len(tickets.time_ns), -1)
    rises = np.flatnonzero(gain > rules.least_delivery_m3)
    margin = int(JOIN_H * HOUR_NS)
    for step in rises:
        near = np.flatnonzero(
            (joined < 0)
            & (tickets.time_ns >= time[step] - margin)
            & (tickets.time_ns <= time[step + 1] + margin)
        )
        if not len(near):
            continue
        inside = (tickets.time_ns[near] > time[step]) & (tickets.time_ns[near] <= time[step + 1])
        # Tickets within the step, all tickets nearby, and each single ticket: the best sum.
        groups = [near[inside], near, *([ticket] for ticket in near)]
        groups = [np.asarray(group) for group in groups if len(group)]
        misses = [abs(tickets.volume_m3[group].sum() - gain[step]) for group in groups]
        best = groups[int(np.argmin(misses))]
        if min(misses) <= max(JOIN_SHARE * gain[step], rules.least_delivery_m3):
            joined[best] = step
        elif inside.any():
            joined[near[inside]] = step
    return joined
