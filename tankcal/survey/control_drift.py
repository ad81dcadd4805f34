"""Repeated readings of control targets from one set-up: motion of instrument and tripod."""

from dataclasses import dataclass

import numpy as np

from tankcal.units import FULL_TURN, HOUR_S


@dataclass(frozen=True)
class RepeatedTarget:
    """A control target with k readings from one set-up, in the order of time.

    Attributes
    ----------
    setup, target : str
    rows : tuple of int or None, length k
        Rows of the file.
    elapsed_s : ndarray, shape (k,)
        Time since the first reading of the set-up, s.
    direction_rad, zenith_rad, distance_m : ndarray, shape (k,)
        Differences from the first reading of the same quantity; nan where it was not read.
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
    """Linear drift of a set-up, estimated from all its control targets; nan: not determined.

    Attributes
    ----------
    setup : str
    direction_rad_s, zenith_rad_s : float
        Drift of the circle zero and of the zenith angle, rad/s.
    hours : float
        Time between the first and the last reading, h.
    """

    setup: str
    direction_rad_s: float
    zenith_rad_s: float
    hours: float


def repeats_of(control):
    """Return a `RepeatedTarget` for each target of each set-up, in the order of their first rows.

    Parameters
    ----------
    control : sequence of ControlReading
    """
    start, groups = {}, {}
    for reading in control:
        start[reading.setup] = min(reading.time_s, start.get(reading.setup, np.inf))
        groups.setdefault((reading.setup, reading.target), []).append(reading)
    repeated = []
    for (setup, target), sequence in groups.items():
        sequence = sorted(sequence, key=lambda reading: reading.time_s)
        values = np.array(
            [
                [reading.direction_rad, reading.zenith_rad, reading.distance_m]
                for reading in sequence
            ]
        )
        direction, zenith, distance = (_since_first(column) for column in values.T)
        repeated.append(
            RepeatedTarget(
                setup,
                target,
                tuple(reading.row for reading in sequence),
                np.array([reading.time_s for reading in sequence]) - start[setup],
                # Reduce the difference to (-pi, pi]: a reading may cross the zero of the circle.
                direction - FULL_TURN * np.round(direction / FULL_TURN),
                zenith,
                distance,
            )
        )
    return tuple(repeated)


def _since_first(values):
    """Differences (k,) from the first finite value."""
    finite = np.flatnonzero(np.isfinite(values))
    return values - (values[finite[0]] if len(finite) else 0.0)


def drifts_of(repeats):
    """Return the `Drift` of each set-up: one slope for all targets, one constant for each target.

    Examples
    --------
    >>> from tankcal.survey.wall_hits import ControlReading
    >>> control = [ControlReading("I", "A", 1e-5 * t, 1.5, 9.0, 3600.0 * t) for t in (0, 1, 2)]
    >>> drift, = drifts_of(repeats_of(control))
    >>> round(3600 * drift.direction_rad_s, 9), drift.hours
    (1e-05, 2.0)
    """
    drifts = []
    for setup in dict.fromkeys(target.setup for target in repeats):
        targets = [target for target in repeats if target.setup == setup]
        hours = max(float(target.elapsed_s.max()) for target in targets) / HOUR_S
        slopes = (
            _slope([(target.elapsed_s, getattr(target, name)) for target in targets])
            for name in ("direction_rad", "zenith_rad")
        )
        drifts.append(Drift(setup, *slopes, hours))
    return tuple(drifts)


def _slope(series):
    """Common slope of several series (times, values), each with its own constant; nan: not
    determined."""
    numerator = denominator = 0.0
    for times, values in series:
        finite = np.isfinite(values)
        if finite.sum() > 1:
            # Centring the times eliminates the constant of the series from the normal equation of
            # the slope.
            time = times[finite] - times[finite].mean()
            numerator, denominator = numerator + time @ values[finite], denominator + time @ time
    return float(numerator / denominator) if denominator > 0 else float("nan")
