"""Tables of a tank by geometry, by liquid, and by both, for comparison."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, SolutionError
from tankcal.uncertainty import combine


@dataclass(frozen=True)
class BesideTable:
    """Volumes at the rows of the printed table, according to one kind of information.

    Attributes
    ----------
    kind : {"geometry", "liquid", "joint"}
    volume_m3, u_m3, U_m3 : ndarray, shape (rows,)
        Volume, its standard and expanded uncertainty; nan where liquid alone has no dips.
    """

    kind: str
    volume_m3: np.ndarray
    u_m3: np.ndarray
    U_m3: np.ndarray


def beside_table(kind, body, levels_m, probability, known=None):
    """Compute the `BesideTable` of a body.

    Parameters
    ----------
    kind : str
        "geometry", "liquid" or "joint".
    body : Body
    levels_m : array_like, shape (rows,)
        Levels of the rows.
    probability : float
        Coverage probability of U.
    known : ndarray of bool, shape (rows,), optional
        Rows with information; None: all rows.

    Returns
    -------
    BesideTable
    """
    levels = np.asarray(levels_m, dtype=float)
    known = np.full(len(levels), True) if known is None else known
    columns = {name: np.full(len(levels), np.nan) for name in ("volume_m3", "u_m3", "U_m3")}
    inside = np.clip(levels[known], body.lowest_m, body.highest_m)
    if len(inside):
        combined = combine(body.sources(inside), len(inside))
        columns["volume_m3"][known] = body.volume_m3(inside)
        columns["u_m3"][known] = combined.u
        columns["U_m3"][known] = combined.expanded(probability)
    return BesideTable(kind, **columns)


def or_none(compute):
    """Return `compute()`, or None if liquid alone does not determine the tank."""
    try:
        return compute()
    except (SolutionError, InputError):
        return None
