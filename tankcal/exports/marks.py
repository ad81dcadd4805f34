"""Rows of a table as a profile writes them: whole numbers of quanta, each rounded once."""

from dataclasses import dataclass
from fractions import Fraction
from math import floor

import numpy as np

from tankcal.exports.profiles import INCREMENTS_M

ON_THE_MARK_M = 1e-8
_MOSTLY = 0.5  # share of rows on marks of the profile above which only these are permitted


@dataclass(frozen=True)
class Marks:
    """Rows of a table as whole numbers of the profile's last digits.

    Attributes
    ----------
    level, volume : (rows,) list of int
        Quanta of the leading column of levels, and of volumes, offsets subtracted.
    at_m, written_m3 : (rows,) ndarray
        Dip and volume as a system interprets them.
    permitted : (rows,) ndarray of bool
        Permitted rows: on a mark if most rows are, and only one row per level.
    """

    level: list
    volume: list
    at_m: np.ndarray
    written_m3: np.ndarray
    permitted: np.ndarray


def to_quanta(value, quantum):
    """Whole number of quanta nearest to a number, exact; halves are rounded up.

    Examples
    --------
    >>> to_quanta(5.5, Fraction(1, 100)), to_quanta(0.0004999, Fraction(1, 1000))
    (550, 0)
    """
    over, under = float(value).as_integer_ratio()
    over, under = over * quantum.denominator, under * quantum.numerator
    return (2 * over + under) // (2 * under)


def count_increments(height_m, increment):
    """Height as a whole number of increments, such as "1/16 in".

    Examples
    --------
    >>> from tankcal.tank.dips import parse_dip
    >>> count_increments(parse_dip("5 ft 3 3/16 in", "ft-in-16"), "1/16 in")
    1011
    >>> count_increments(5.5, "1/100 m")
    550
    """
    return to_quanta(height_m, INCREMENTS_M[increment])


def make_marks(height_m, volume_m3, profile, reference_m=None, required=()):
    """Return the `Marks` of a table in a profile.

    Parameters
    ----------
    height_m, volume_m3 : (rows,) ndarray
    profile : Profile
    reference_m : float, optional
        Reference height of ullages.
    required : sequence of int, optional
        Rows that take precedence over other rows of equal level.
    """
    quantum, volume_quantum = profile.level_quantum_m, profile.volume_quantum_m3
    is_ullage = profile.leading == "ullage"
    level_offset = Fraction(str(profile.level_offset_m))
    volume_offset = Fraction(str(profile.volume_offset_m3))
    levels = reference_m - height_m if is_ullage else height_m
    level = _quanta(levels, quantum, level_offset)
    volume = _quanta(volume_m3, volume_quantum, volume_offset)
    at = np.array([float(n * quantum + level_offset) for n in level])
    at = reference_m - at if is_ullage else at
    written = np.array([float(n * volume_quantum + volume_offset) for n in volume])
    return Marks(level, volume, at, written, _find_permitted(height_m, at, level, required))


def _quanta(values, quantum, offset):
    if offset == 0:
        return [to_quanta(value, quantum) for value in values.tolist()]
    half = Fraction(1, 2)
    return [floor((Fraction(value) - offset) / quantum + half) for value in values.tolist()]


def _find_permitted(height_m, at_m, level, required):
    """Mask (rows,) of the permitted rows."""
    off = np.abs(at_m - height_m)
    on_mark = off <= ON_THE_MARK_M
    permitted = on_mark.copy() if on_mark.mean() >= _MOSTLY else np.ones(len(off), dtype=bool)
    permitted[list(required)] = True
    off[list(required)] = -1.0  # takes precedence over other rows of its level
    best = {}
    for row in np.flatnonzero(permitted):
        n = level[row]
        if n not in best or off[row] < off[best[n]]:
            best[n] = row
    kept = np.zeros(len(off), dtype=bool)
    kept[list(best.values())] = True
    return kept
