"""Local times of logs to UTC, with the doubled hour of autumn."""

import numpy as np
import pandas as pd

MOST_OFFSET_S, OFFSET_STEP_S = 7200, 60  # searched offsets of two clocks
LEAST_SALES = 30  # for an offset
MOST_STEP_M3 = 0.3  # change of the stock in a row beyond it: a delivery
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


def find_offset_s(time_ns, stock_m3, flows):
    """Estimate how late the clock of a level log is, by falls of the level and metered volumes.

    Stock and metered volume have a constant sum between deliveries. The sum of the absolute changes
    from row to row is least at the right offset.

    Parameters
    ----------
    time_ns : ndarray of int64, shape (n,)
        Ascending.
    stock_m3 : ndarray, shape (n,)
    flows : sequence of flows.MeterFlow

    Returns
    -------
    float or None
        Seconds; None with too few sales.
    """
    offsets = np.arange(-MOST_OFFSET_S, MOST_OFFSET_S + 1, OFFSET_STEP_S)
    change, sums, sales = np.diff(stock_m3), np.zeros(len(offsets)), 0
    middles = []
    for flow in flows:
        middle = flow.begin_ns // 2 + flow.time_ns // 2
        sales += int(np.sum((middle > time_ns[0]) & (middle < time_ns[-1])))
        middles.append((np.sort(middle), flow.total_m3))
    if sales < LEAST_SALES:
        return None
    for place, offset in enumerate(offsets):
        at = time_ns - int(offset) * 10**9
        sold = sum(total[np.searchsorted(middle, at)] for middle, total in middles)
        sums[place] = np.minimum(np.abs(change + np.diff(sold)), MOST_STEP_M3).sum()
    return float(offsets[np.argmin(sums)])
