"""Control targets that a set-up reads again: by how much instrument and tripod moved meanwhile."""

from dataclasses import dataclass

import numpy as np

from tankcal.geometry.outlines import FULL_TURN

HOUR_S = 3600.0


@dataclass(frozen=True)
class RepeatedTarget:
    """A control target as a set-up read it again and again; k readings, in the order of their time.

    Attributes
    ----------
    setup, target : str
    rows : tuple of int or None, length k
        In their file.
    elapsed_s : ndarray, shape (k,)
        Since the first reading of the set-up.
    direction_rad, zenith_rad, distance_m : ndarray, shape (k,)
        Less those of the first reading that has them; nan where this was not read.
    """

    setup: str
    target: str
    rows: tuple
    elapsed_s: np.ndarray
    direction_rad: np.ndarray
    zenith_rad: np.ndarray
    distance_m: np.ndarray


@dataclass(frozen=True)
class Drift:
    """A linear drift of a set-up, by all its control targets; nan where nothing tells it.

    Attributes
    ----------
    setup : str
    direction_rad_s, zenith_rad_s : float
        Of the zero of the circle and of the zenith angle.
    hours : float
        Between its first and its last reading.
    """

    setup: str
    direction_rad_s: float
    zenith_rad_s: float
    hours: float


def repeats_of(control):
    """`RepeatedTarget` of each target of each set-up, in the order of their first rows.

    control  sequence of ControlReading
    """
    start, groups = {}, {}
    for one in control:
        start[one.setup] = min(one.time_s, start.get(one.setup, np.inf))
        groups.setdefault((one.setup, one.target), []).append(one)
    found = []
    for (setup, target), read in groups.items():
        read = sorted(read, key=lambda one: one.time_s)
        values = np.array([[one.direction_rad, one.zenith_rad, one.distance_m] for one in read])
        direction, zenith, distance = (_since_first(column) for column in values.T)
        found.append(
            RepeatedTarget(
                setup,
                target,
                tuple(one.row for one in read),
                np.array([one.time_s for one in read]) - start[setup],
                direction - FULL_TURN * np.round(direction / FULL_TURN),
                zenith,
                distance,
            )
        )
    return tuple(found)


def _since_first(values):
    there = np.flatnonzero(np.isfinite(values))
    return values - (values[there[0]] if len(there) else 0.0)


def drifts_of(repeats):
    """`Drift` of each set-up: a slope common to its targets, each with a constant of its own.

    Examples
    --------
    >>> from tankcal.survey.wall_hits import ControlReading
    >>> control = [ControlReading("I", "A", 1e-5 * t, 1.5, 9.0, 3600.0 * t) for t in (0, 1, 2)]
    >>> drift, = drifts_of(repeats_of(control))
    >>> round(3600 * drift.direction_rad_s, 9), drift.hours
    (1e-05, 2.0)
    """
    found = []
    for setup in dict.fromkeys(one.setup for one in repeats):
        mine = [one for one in repeats if one.setup == setup]
        hours = max(float(one.elapsed_s.max()) for one in mine) / HOUR_S
        slopes = (
            _slope([(one.elapsed_s, getattr(one, name)) for one in mine])
            for name in ("direction_rad", "zenith_rad")
        )
        found.append(Drift(setup, *slopes, hours))
    return tuple(found)


def _slope(series):
    """Slope common to series of times and values, each with a constant; nan: none tells it."""
    above = below = 0.0
    for times, values in series:
        there = np.isfinite(values)
        if there.sum() > 1:
            time = times[there] - times[there].mean()
            above, below = above + time @ values[there], below + time @ time
    return float(above / below) if below > 0 else float("nan")
