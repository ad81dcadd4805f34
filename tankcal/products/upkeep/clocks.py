"""Local times of logs to UTC, with the doubled hour of autumn."""

import numpy as np
import pandas as pd

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
