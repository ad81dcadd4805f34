"""Corrections of soundings for trim and list: what brings a sounding to the table at even keel.

The correction c of a sounding s at a trim and list is that for which

    V(s + c; even keel) = V(s; trim, list).

What is uncertain of it: with the derivatives D of both volumes by an input, and A = dV/ds of the
table at even keel, c changes by (D(s; trim, list) - D(s + c; even keel)) / A. What both have in
common, such as a scale, nearly cancels; trim and list move the first volume alone, for even keel
is even keel.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message

GRID = 257  # soundings that bracket a volume first
CLOSE = 1e-13  # of the capacity: a volume met
ROUNDS = 60
READABLE, BELOW, FULL = "", "below", "full"  # states of a sounding


@dataclass(frozen=True)
class CellCorrections:
    """Corrections at one trim and list.

    Attributes
    ----------
    volume_m3 : ndarray, shape (rows,)
        At each sounding, no more than the capacity.
    state : ndarray of str, shape (rows,)
        "" where the sounding has a correction; "full" where the tank is, or the table at even keel
        ends with less; "below" where it begins with more.
    even_m : ndarray, shape (rows,)
        Soundings at even keel of the same volume; nan where there is none.
    dry_m3 : float
        Volume at which the pipe becomes dry.
    full_m : float
        Sounding at which the tank becomes full.
    interpolated_m : float
        Largest error of a correction that is interpolated half way between two soundings.
    """

    volume_m3: np.ndarray
    state: np.ndarray
    even_m: np.ndarray
    dry_m3: float
    full_m: float
    interpolated_m: float


def corrections_of(parts, even, soundings_m, top_m=np.inf):
    """`CellCorrections` of each trim and list, their volumes inverted all at once.

    Parameters
    ----------
    parts : sequence of PipedMesh
        One for each trim and list.
    even : PipedMesh
        At even keel.
    soundings_m : ndarray, shape (rows,)
        From the pipe's lower end, 0 first, ascending.
    top_m : float, optional
        Sounding that the table at even keel ends at, a whole millimetre: what is above it counts
        as full.

    Returns
    -------
    list of CellCorrections
    """
    soundings = np.asarray(soundings_m, dtype=float)
    middles = (soundings[:-1] + soundings[1:]) / 2
    every = np.concatenate([soundings, middles])
    volumes = np.array([one.volume_m3(np.minimum(every, one.top_m)) for one in parts])
    full = every >= np.array([one.top_m for one in parts])[:, None]
    below = ~full & (volumes < even.dry_m3)
    even_m = np.full(volumes.shape, np.nan)
    even_m[~full & ~below] = soundings_of_volumes(even, volumes[~full & ~below])
    full |= even_m > top_m
    even_m[full] = np.nan
    state = np.where(full, FULL, np.where(below, BELOW, READABLE))
    rows = len(soundings)
    return [
        CellCorrections(
            volumes[i, :rows],
            state[i, :rows],
            even_m[i, :rows],
            float(volumes[i, 0]),
            part.top_m,
            _interpolated(even_m[i, :rows] - soundings, even_m[i, rows:] - middles),
        )
        for i, part in enumerate(parts)
    ]


def _interpolated(correction, exact):
    between = (correction[:-1] + correction[1:]) / 2
    return float(np.nanmax(np.abs(between - exact), initial=0.0))


def soundings_of_volumes(part, volumes_m3):
    """(n,) soundings of a `PipedMesh` at which it holds given volumes: the exact inverse.

    Newton's method, kept in a bracket that each round makes smaller.

    Raises
    ------
    SolutionError
        For a volume that the tank does not hold between its lowest sounding and the full tank.
    """
    volumes = np.asarray(volumes_m3, dtype=float)
    capacity = part.capacity_m3
    slack = CLOSE * capacity
    outside = ~((volumes >= part.dry_m3 - slack) & (volumes <= capacity + slack))
    if outside.any():
        raise SolutionError(
            message(
                "volume_not_in_ship_tank",
                "{volume_m3:g} m3 is not between the volumes of the table, {least_m3:g} and "
                "{most_m3:g} m3",
                volume_m3=volumes[outside][0],
                least_m3=part.dry_m3,
                most_m3=capacity,
            )
        )
    grid = np.linspace(0.0, part.top_m, GRID)
    held = np.maximum.accumulate(part.volume_m3(grid))
    upper = np.clip(np.searchsorted(held, volumes), 1, GRID - 1)
    low, high = grid[upper - 1].copy(), grid[upper].copy()
    share = (volumes - held[upper - 1]) / np.maximum(held[upper] - held[upper - 1], slack)
    found = low + np.clip(share, 0.0, 1.0) * (high - low)
    todo = np.arange(len(volumes))
    for _ in range(ROUNDS):
        over = part.volume_m3(found[todo]) - volumes[todo]
        high[todo[over >= 0]] = found[todo[over >= 0]]
        low[todo[over < 0]] = found[todo[over < 0]]
        wide = high[todo] - low[todo] > 4 * np.finfo(float).eps * part.top_m
        left = (np.abs(over) > slack) & wide
        todo, over = todo[left], over[left]
        if len(todo) == 0:
            break
        area = part.area_m2(found[todo])
        step = np.divide(over, area, out=np.full(len(todo), np.inf), where=area > 0)
        newton = found[todo] - step
        inside = (newton > low[todo]) & (newton < high[todo])
        found[todo] = np.where(inside, newton, (low[todo] + high[todo]) / 2)
    return found
