"""The interval that each volume is stated with, whichever method found it.

Whoever states a volume states it with one of these. What holds of every one is checked where it is
made, not hoped for where it is printed:

    low <= V <= high,  low < high wherever the law of propagation gives a u above 0

Source: JCGM 101:2008 clause 8.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import ProgramError
from tankcal.uncertainty import ROUNDING


@dataclass(frozen=True)
class Intervals:
    """The interval of each volume that counts, (rows,), and the U that it is stated with.

    by_gum  True: volume +- k u; False: Monte Carlo's, where it does not validate that
    U_m3    of the law of propagation, or the larger distance of Monte Carlo's ends from the volume
    """

    low_m3: np.ndarray
    high_m3: np.ndarray
    by_gum: np.ndarray
    U_m3: np.ndarray


def gum_intervals(volume_m3, u_m3, U_m3):
    """`Intervals` V +- U of volumes that were not simulated; each (rows,).

    Raises ProgramError for an interval that contradicts itself.
    """
    found = Intervals(volume_m3 - U_m3, volume_m3 + U_m3, np.full(len(U_m3), True), U_m3)
    return check_intervals(found, volume_m3, u_m3)


def judged_intervals(judged, volume_m3, u_m3, U_m3, least_m3=-np.inf):
    """`Intervals` of simulated volumes: V +- U where that is validated, else Monte Carlo's.

    A strong curvature moves the distribution away from the volume at the estimates. Where Monte
    Carlo's interval leaves that volume out it is made longer up to it: the volume is what is
    stated, and a longer interval holds the true one no less often.

    judged    `monte_carlo.Verdict` of them
    least_m3  what Monte Carlo's interval does not go below: no tank holds less than nothing
    Raises ProgramError for an interval that contradicts itself.
    """
    by_gum = judged.validated
    low = np.where(by_gum, judged.low, np.maximum(judged.low, least_m3))
    found = Intervals(low, judged.high, by_gum, judged.stated(volume_m3, U_m3))
    _refuse_without_width(found, volume_m3, u_m3)  # before an end is moved to where it belongs
    low, high = np.minimum(low, volume_m3), np.maximum(judged.high, volume_m3)
    return check_intervals(Intervals(low, high, by_gum, found.U_m3), volume_m3, u_m3)


def check_intervals(intervals, volume_m3, u_m3):
    """The same `Intervals`; raises ProgramError for one that does not hold its volume."""
    low, high = intervals.low_m3, intervals.high_m3
    outside = ~((low <= volume_m3) & (volume_m3 <= high))
    _refuse(outside, intervals, volume_m3, u_m3)
    _refuse_without_width(intervals, volume_m3, u_m3)
    return intervals


def _refuse_without_width(intervals, volume_m3, u_m3):
    # of the largest volume: the empty tank's is a difference of volumes, and has their rounding
    varies = u_m3 > ROUNDING * np.max(np.abs(volume_m3), initial=0.0)
    _refuse(varies & ~(intervals.low_m3 < intervals.high_m3), intervals, volume_m3, u_m3)


def _refuse(wrong, intervals, volume_m3, u_m3):
    if np.any(wrong):
        row = int(np.argmax(wrong))
        low, high = intervals.low_m3[row], intervals.high_m3[row]
        raise ProgramError(
            f"volume {row + 1} of {len(wrong)}, {volume_m3[row]:.6f} m3 with u = {u_m3[row]:.2g} "
            f"m3, has the interval from {low:.6f} to {high:.6f} m3"
        )
