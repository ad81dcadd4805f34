"""Corrections of soundings for trim and list, relative to the table at even keel.

The correction c of a sounding s at a trim and list is defined by

    V(s + c; even keel) = V(s; trim, list).

With the derivatives D of both volumes by an input, and A = dV/ds of the table at even keel, the
input changes c by (D(s; trim, list) - D(s + c; even keel)) / A. Common effects of both volumes,
such as a scale, nearly cancel. Trim and list change the first volume alone, since even keel is
exact.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message

GRID = 257  # number of soundings of the first bracket of a volume
CLOSE = 1e-13  # tolerance of a volume, relative to the capacity
ROUNDS = 60  # largest number of iterations
READABLE, BELOW, FULL = "", "below", "full"  # states of a sounding


@dataclass(frozen=True)
class CellCorrections:
    """Corrections at a trim and list.

    Attributes
    ----------
    volume_m3 : ndarray, shape (rows,)
        Volume at each sounding, at most the capacity.
    state : ndarray of str, shape (rows,)
        "" for a sounding with a correction; "full" if the tank is full, or the table at even keel
        ends at a smaller volume; "below" if that table begins at a larger volume.
    even_m : ndarray, shape (rows,)
        Soundings of equal volume at even keel; nan if there is none.
    dry_m3 : float
        Volume at which the pipe becomes dry.
    full_m : float
        Sounding at which the tank becomes full.
    interpolated_m : float
        Largest error of a correction interpolated half way between two soundings.
    """

    volume_m3: np.ndarray
    state: np.ndarray
    even_m: np.ndarray
    dry_m3: float
    full_m: float
    interpolated_m: float


def corrections_of(parts, even, soundings_m, top_m=np.inf):
    """Return the `CellCorrections` of each trim and list.

    Parameters
    ----------
    parts : sequence of PipedMesh
        One for each trim and list.
    even : PipedMesh
        Mesh at even keel.
    soundings_m : ndarray, shape (rows,)
        Soundings from the lower end of the pipe, ascending from 0.
    top_m : float, optional
        Last sounding of the table at even keel, a whole millimetre: larger soundings count as full.

    Returns
    -------
    list of CellCorrections
    """
    soundings = np.asarray(soundings_m, dtype=float)
    midpoints = (soundings[:-1] + soundings[1:]) / 2
    all_soundings = np.concatenate([soundings, midpoints])
    volumes = np.array([mesh.volume_m3(np.minimum(all_soundings, mesh.top_m)) for mesh in parts])
    is_full = all_soundings >= np.array([mesh.top_m for mesh in parts])[:, None]
    is_below = ~is_full & (volumes < even.dry_m3)
    even_m = np.full(volumes.shape, np.nan)
    # The volumes of all trims and lists are inverted at once.
    even_m[~is_full & ~is_below] = soundings_of_volumes(even, volumes[~is_full & ~is_below])
    is_full |= even_m > top_m
    even_m[is_full] = np.nan
    state = np.where(is_full, FULL, np.where(is_below, BELOW, READABLE))
    rows = len(soundings)
    return [
        CellCorrections(
            volumes[i, :rows],
            state[i, :rows],
            even_m[i, :rows],
            float(volumes[i, 0]),
            part.top_m,
            _interpolation_error(even_m[i, :rows] - soundings, even_m[i, rows:] - midpoints),
        )
        for i, part in enumerate(parts)
    ]


def _interpolation_error(correction, exact):
    """Return the largest error of corrections interpolated half way between soundings."""
    interpolated = (correction[:-1] + correction[1:]) / 2
    return float(np.nanmax(np.abs(interpolated - exact), initial=0.0))


def soundings_of_volumes(part, volumes_m3):
    """Return soundings (n,) of a `PipedMesh` for given volumes: the exact inverse.

    Newton's method, safeguarded by a bracket that each iteration reduces.

    Parameters
    ----------
    part : PipedMesh
    volumes_m3 : array_like, shape (n,)

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    SolutionError
        For a volume that is not between the volumes at the lowest sounding and of the full tank.
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
    # Rounding may make the volumes fall slightly; the bracket requires ascending values.
    volumes_on_grid = np.maximum.accumulate(part.volume_m3(grid))
    upper = np.clip(np.searchsorted(volumes_on_grid, volumes), 1, GRID - 1)
    low, high = grid[upper - 1].copy(), grid[upper].copy()
    share = (volumes - volumes_on_grid[upper - 1]) / np.maximum(
        volumes_on_grid[upper] - volumes_on_grid[upper - 1], slack
    )
    soundings = low + np.clip(share, 0.0, 1.0) * (high - low)
    open_indices = np.arange(len(volumes))
    for _ in range(ROUNDS):
        excess = part.volume_m3(soundings[open_indices]) - volumes[open_indices]
        high[open_indices[excess >= 0]] = soundings[open_indices[excess >= 0]]
        low[open_indices[excess < 0]] = soundings[open_indices[excess < 0]]
        is_wide = high[open_indices] - low[open_indices] > 4 * np.finfo(float).eps * part.top_m
        unfinished = (np.abs(excess) > slack) & is_wide
        open_indices, excess = open_indices[unfinished], excess[unfinished]
        if len(open_indices) == 0:
            break
        area = part.area_m2(soundings[open_indices])
        step = np.divide(excess, area, out=np.full(len(open_indices), np.inf), where=area > 0)
        newton = soundings[open_indices] - step
        # A Newton step outside the bracket is replaced by bisection.
        inside = (newton > low[open_indices]) & (newton < high[open_indices])
        soundings[open_indices] = np.where(
            inside, newton, (low[open_indices] + high[open_indices]) / 2
        )
    return soundings
