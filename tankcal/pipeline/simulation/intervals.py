"""Stated interval of each volume, whichever method determined it.

Each interval is checked when it is created, not when it is printed:

    low <= V <= high,  low < high wherever the law of propagation gives u > 0

Source: JCGM 101:2008 clause 8.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import ProgramError
from tankcal.uncertainty import ROUNDING


@dataclass(frozen=True)
class Intervals:
    """Stated interval and U of each volume, shape (rows,).

    Attributes
    ----------
    low_m3, high_m3 : ndarray
        Ends of the interval, m3.
    by_gum : ndarray of bool
        True: volume +- k u. False: Monte Carlo interval, where the propagation is not validated.
    U_m3 : ndarray
        U of the law of propagation, or the larger distance of the Monte Carlo ends from the volume,
        m3.
    """

    low_m3: np.ndarray
    high_m3: np.ndarray
    by_gum: np.ndarray
    U_m3: np.ndarray


def gum_intervals(volume_m3, u_m3, U_m3):
    """`Intervals` V +- U of volumes that were not simulated, from arrays of shape (rows,), m3.

    Raises ProgramError for an inconsistent interval.
    """
    intervals = Intervals(volume_m3 - U_m3, volume_m3 + U_m3, np.full(len(U_m3), True), U_m3)
    return check_intervals(intervals, volume_m3, u_m3)


def judged_intervals(judged, volume_m3, u_m3, U_m3, least_m3=-np.inf):
    """`Intervals` of simulated volumes: V +- U if validated, otherwise the Monte Carlo interval.

    A strong curvature moves the distribution away from the volume at the estimates. If the Monte
    Carlo interval excludes that volume, the interval is extended to it. The stated value is then
    inside, and a longer interval does not reduce the coverage.

    Parameters
    ----------
    judged : monte_carlo.Verdict
        Verdict on the volumes.
    volume_m3, u_m3, U_m3 : ndarray, shape (rows,)
        Volumes, standard and expanded uncertainties, m3.
    least_m3 : float
        Lower bound of a Monte Carlo interval, m3; the volume of a tank is not negative.

    Returns
    -------
    Intervals

    Raises
    ------
    ProgramError
        For an inconsistent interval.
    """
    by_gum = judged.validated
    low = np.where(by_gum, judged.low, np.maximum(judged.low, least_m3))
    intervals = Intervals(low, judged.high, by_gum, judged.stated(volume_m3, U_m3))
    _refuse_without_width(intervals, volume_m3, u_m3)  # check before an end is moved
    low, high = np.minimum(low, volume_m3), np.maximum(judged.high, volume_m3)
    return check_intervals(Intervals(low, high, by_gum, intervals.U_m3), volume_m3, u_m3)


def check_intervals(intervals, volume_m3, u_m3):
    """Return the `Intervals`; raise ProgramError for an interval that excludes its volume."""
    low, high = intervals.low_m3, intervals.high_m3
    outside = ~((low <= volume_m3) & (volume_m3 <= high))
    _refuse(outside, intervals, volume_m3, u_m3)
    _refuse_without_width(intervals, volume_m3, u_m3)
    return intervals


def _refuse_without_width(intervals, volume_m3, u_m3):
    # Relative to the largest volume: that of the empty tank is a difference with rounding errors.
    """Raise ProgramError for intervals of zero width with a significant standard uncertainty."""
    varies = u_m3 > ROUNDING * np.max(np.abs(volume_m3), initial=0.0)
    _refuse(varies & ~(intervals.low_m3 < intervals.high_m3), intervals, volume_m3, u_m3)


def _refuse(wrong, intervals, volume_m3, u_m3):
    """Raise ProgramError for the first wrong interval."""
    if np.any(wrong):
        row = int(np.argmax(wrong))
        low, high = intervals.low_m3[row], intervals.high_m3[row]
        raise ProgramError(
            f"volume {row + 1} of {len(wrong)}, {volume_m3[row]:.6f} m3 with u = {u_m3[row]:.2g} "
            f"m3, has the interval from {low:.6f} to {high:.6f} m3"
        )
