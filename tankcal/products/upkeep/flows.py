"""Metered flow: running totals and transactions of meters as volumes between any two times."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from tankcal.messages import message
from tankcal.products.upkeep.logs import NOT_A_TIME

TOTAL_M3 = 1e-4  # largest difference of a rise of a counter from its transaction
ROLLOVER = 0.01  # a total that falls from above 99 % to below 1 % of a power of ten rolled over
SECOND_NS = 10**9


@dataclass(frozen=True)
class MeterFlow:
    """Flow through a meter.

    Attributes
    ----------
    name : str
    time_ns : ndarray of int64, shape (n,)
        End of each metered interval, ascending.
    begin_ns : ndarray of int64, shape (n,)
        Begin of each metered interval.
    total_m3 : ndarray, shape (n + 1,)
        Sum of the volumes before each interval, and of all.
    heat : ndarray, shape (n + 1,)
        Sum of volume times temperature of the liquid at the meter, m3 degC; nan: not measured.
    breaks_ns : ndarray of int64, shape (b, 2)
        Times between which the metered volume is unknown.
    """

    name: str
    time_ns: np.ndarray
    begin_ns: np.ndarray
    total_m3: np.ndarray
    heat: np.ndarray
    breaks_ns: np.ndarray

    def volume_m3(self, time_ns):
        """Volume metered until each time (k,), m3."""
        return self.total_m3[np.searchsorted(self.time_ns, time_ns, side="right")]

    def is_broken(self, start_ns, end_ns):
        """Whether the volume between two times is unknown, shape (k,)."""
        if not len(self.breaks_ns):
            return np.zeros(len(start_ns), dtype=bool)
        low, high = self.breaks_ns.T
        # Breaks are in order of time: the first that ends after the start decides.
        place = np.searchsorted(high, start_ns, side="right")
        inside = place < len(high)
        return inside & (low[np.minimum(place, len(low) - 1)] < end_ns)


def read_flows(files, adjusted=()):
    """Read the flow of every meter from its log files.

    Parameters
    ----------
    files : sequence of logs.LogFile
    adjusted : sequence of (str, int)
        Meter (None: all) and time of an adjustment or a replacement, at which a total may fall.

    Returns
    -------
    list of MeterFlow
        In the order of their names.
    """
    parts = {}
    for file in files:
        last = NOT_A_TIME
        for chunk in file.chunks():
            last = _count_late(file, chunk["time"], last)
            names = pd.Series(chunk.get("meter", np.full(len(chunk["time"]), "meter")))
            names = names.fillna("").astype(str).str.strip().to_numpy()
            for name in np.unique(names):
                rows = names == name
                parts.setdefault(name, []).append(
                    {key: values[rows] for key, values in chunk.items()} | {"file": file}
                )
    flows = []
    for name in sorted(parts):
        moments = sorted(moment for meter, moment in adjusted if meter in (None, name))
        flows += _divide(_join(name, parts[name], adjusted), moments)
    return flows


def _divide(flow, moments):
    """Divide a `MeterFlow` at adjustments: the meter has a new factor, drift and name then."""
    if not moments:
        return [flow]
    *earlier, moment = moments
    place = int(np.searchsorted(flow.time_ns, moment, side="right"))
    if not 0 < place < len(flow.time_ns):
        return _divide(flow, earlier)
    day = np.datetime64(moment, "ns").astype("datetime64[D]")
    before = replace(flow, time_ns=flow.time_ns[:place], begin_ns=flow.begin_ns[:place],
                     total_m3=flow.total_m3[: place + 1], heat=flow.heat[: place + 1])  # fmt: skip
    later = MeterFlow(
        f"{flow.name} {day}", flow.time_ns[place:], flow.begin_ns[place:],
        flow.total_m3[place:] - flow.total_m3[place], flow.heat[place:] - flow.heat[place],
        np.zeros((0, 2), dtype=np.int64),
    )  # fmt: skip
    return [*_divide(before, earlier), later]


def _count_late(file, times, last):
    """Count the rows that are earlier than a row above them; the latest time so far."""
    if not len(times):
        return last
    latest = np.maximum.accumulate(np.append(last, times))
    file.findings.add(file.kind, "late", times[times < latest[:-1]])
    return int(latest[-1])


def _join(name, parts, adjusted):
    """`MeterFlow` of the chunks of a meter."""
    file = parts[0]["file"]
    keys = [key for key in ("time", "begin", "total", "volume", "temperature", "row")
            if all(key in part for part in parts)]  # fmt: skip
    rows = pd.DataFrame({key: np.concatenate([part[key] for part in parts]) for key in keys})
    value = "total" if "total" in keys else "volume"
    rows = rows[np.isfinite(rows[value].to_numpy())].sort_values("time", kind="stable")
    is_repeated = rows.duplicated([key for key in keys if key not in ("row",)]).to_numpy()
    file.findings.add("meters", "duplicate", rows["time"].to_numpy()[is_repeated])
    rows = rows[~is_repeated]
    time = rows["time"].to_numpy()
    same = np.flatnonzero(np.diff(time) == 0) if value == "total" else ()
    for place in same[:3]:
        text = message("upkeep_other_value", "the total of meter {meter} is {second:g} m3 here, "
                       "and {first:g} m3 in another row of this time; expected a single value",
                       meter=name, first=rows[value].iloc[place],
                       second=rows[value].iloc[place + 1])  # fmt: skip
        file.log.problem(file.path.name, text, int(rows["row"].iloc[place + 1]), "total")
    if value == "total":
        return _sum_totals(name, rows, file, adjusted)
    volume = rows["volume"].to_numpy()
    begin = rows["begin"].to_numpy() if "begin" in keys else time - 600 * SECOND_NS
    begin = np.where(begin == NOT_A_TIME, time, begin)
    heat = volume * rows["temperature"].to_numpy() if "temperature" in keys else volume * np.nan
    return MeterFlow(name, time, np.minimum(begin, time), _sums(volume), _sums(heat),
                     np.zeros((0, 2), dtype=np.int64))  # fmt: skip


def _sum_totals(name, rows, file, adjusted):
    """`MeterFlow` of running totals: rollovers are added, other falls break the flow."""
    time, total = rows["time"].to_numpy(), rows["total"].to_numpy()
    if "volume" in rows:
        # A removed transaction: the counter rises by more than the volume of its row.
        volumes = rows["volume"].to_numpy()[1:]
        differs = np.abs(np.diff(total) - volumes) > np.maximum(1e-3 * volumes, TOTAL_M3)
        file.findings.add("meters", "total_unlike_sum", time[1:][differs & (np.diff(total) >= 0)])
    volume = np.diff(total)
    # Powers of ten apply to the unit of the counter, such as 999 999.9 L.
    unit = file.profile.to_si("total", 1.0)
    before, after = total[:-1] / unit, total[1:] / unit
    size = 10.0 ** np.ceil(np.log10(np.maximum(before, 1.0)))
    is_rollover = (volume < 0) & (before > (1 - ROLLOVER) * size) & (after < ROLLOVER * size)
    is_rollover &= size > 100
    volume = np.where(is_rollover, volume + size * unit, volume)
    is_reset = volume < 0
    for meter, moment in adjusted:
        if meter in (None, name) and len(time) > 1:
            place = np.clip(np.searchsorted(time, moment) - 1, 0, len(time) - 2)
            is_reset[place] = True
    file.findings.add("meters", "rollover", time[1:][is_rollover])
    file.findings.add("meters", "reset", time[1:][is_reset])
    volume = np.where(is_reset, 0.0, volume)
    runs = (volume > 0) | is_reset
    breaks = np.stack([time[:-1], time[1:]], axis=1)[is_reset]
    heat = volume * np.nan
    if "temperature" in rows:
        heat = volume * rows["temperature"].to_numpy()[1:]
    return MeterFlow(name, time[1:][runs], time[:-1][runs], _sums(volume[runs]),
                     _sums(heat[runs]), breaks)  # fmt: skip


def _sums(values):
    """Cumulative sums (n + 1,) that begin at 0."""
    return np.append(0.0, np.cumsum(values))


def quiet_windows(flows, settle_s, first_ns, last_ns):
    """Windows (w, 2) without flow, from `settle_s` after the last flow, in nanoseconds UTC.

    Parameters
    ----------
    flows : sequence of MeterFlow
    settle_s : float
    first_ns, last_ns : int
        Times of the first and the last reading.

    Returns
    -------
    ndarray of int64, shape (w, 2)
    """
    begin = np.concatenate([flow.begin_ns for flow in flows])
    end = np.concatenate([flow.time_ns for flow in flows])
    order = np.argsort(begin, kind="stable")
    begin, latest = begin[order], np.maximum.accumulate(end[order])
    starts = np.append(first_ns, latest + int(settle_s * SECOND_NS))
    ends = np.append(begin, last_ns)
    is_window = ends > starts
    return np.stack([starts, ends], axis=1)[is_window]
