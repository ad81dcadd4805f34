"""Three tables of one tank beside each other: by geometry, by liquid, and by both."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, SolutionError
from tankcal.uncertainty import combine


@dataclass(frozen=True)
class BesideTable:
    """Volumes at the rows of the table that is printed, as one kind of knowledge has them.

    Attributes
    ----------
    kind : {"geometry", "liquid", "joint"}
    volume_m3, u_m3, U_m3 : ndarray, shape (rows,)
        nan where it says nothing: liquid alone beyond its dips.
    """

    kind: str
    volume_m3: np.ndarray
    u_m3: np.ndarray
    U_m3: np.ndarray


def beside_table(kind, body, levels_m, probability, known=None):
    """`BesideTable` of a body.

    known  (rows,) bool: where it says something; None: everywhere
    """
    levels = np.asarray(levels_m, dtype=float)
    known = np.full(len(levels), True) if known is None else known
    columns = {name: np.full(len(levels), np.nan) for name in ("volume_m3", "u_m3", "U_m3")}
    inside = np.clip(levels[known], body.lowest_m, body.highest_m)
    if len(inside):
        found = combine(body.sources(inside), len(inside))
        columns["volume_m3"][known] = body.volume_m3(inside)
        columns["u_m3"][known] = found.u
        columns["U_m3"][known] = found.expanded(probability)
    return BesideTable(kind, **columns)


def or_none(compute):
    """What `compute()` gives; None where liquid alone does not tell the tank."""
    try:
        return compute()
    except (SolutionError, InputError):
        return None
