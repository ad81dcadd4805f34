"""What a part of a tank is: the contract that shells, heads, bottoms, solids and fittings fulfil.

A tank is the sum of its parts (`body.Body`), so a part has to give, below any level, its volume,
the free surface, the derivatives by every input that moves it, and its own causes of uncertainty.
"""

from abc import abstractmethod
from typing import Protocol

import numpy as np

from tankcal.uncertainty import Source


class Part(Protocol):
    """A part of a tank; classes fulfil it by naming it as their base.

    Levels count from the bottom of a vertical tank's first course, of another tank from its lowest
    inside point, in metres. A part may take away: deadwood has a negative volume.

    Attributes
    ----------
    kind : str
        What it is to who measured the tank: "wall", "bottom", "deadwood" or "roof".
    moves_with_zero : bool
        Whether it was declared by dips. It then has no derivative by "datum": wherever the table's
        zero is, the same dips have the same volume.
    has_own_height : bool
        Of a bottom: whether its sources say how well its height is known, as those of one in scans
        do; the input "bottom" is not missed then.
    """

    kind: str = "wall"
    moves_with_zero: bool = False
    has_own_height: bool = False

    @abstractmethod
    def volume_m3(self, levels_m) -> np.ndarray:
        """Volume below each level.

        Parameters
        ----------
        levels_m : (rows,) array
            Levels, m.

        Returns
        -------
        (rows,) array
            Volumes, m3.

        Raises
        ------
        HeightError
            For a level that the part does not reach.
        """

    @abstractmethod
    def area_m2(self, levels_m) -> np.ndarray:
        """Derivative of the volume by the level, (rows,) m2; above the level where it jumps."""

    @abstractmethod
    def derivatives(self, levels_m) -> dict[str, np.ndarray]:
        """Derivatives of the volume by the inputs that move it, others held.

        Returns
        -------
        dict of str to (rows,) or (rows, c) array
            By the name of the input, m3 per SI unit; c columns where each course has its own.
        """

    def sources(self, levels_m) -> tuple[Source, ...]:
        """Causes of uncertainty that belong to this part alone, `Source`s of (rows, c) columns."""
        return ()

    @property
    def lowest_m(self) -> float:
        """Level at which a tank with this part is empty; inf for one that never holds liquid."""
        return 0.0

    @property
    def breakpoints_m(self) -> tuple[float, ...]:
        """Levels at which the area jumps or, as that of a bottom, ends."""
        return ()

    def area_by(self, derivatives, levels_m):
        """`area_m2` of levels whose derivatives are known: that by "datum", where there is one."""
        return derivatives["datum"] if "datum" in derivatives else self.area_m2(levels_m)

    def moved_m3(self, levels_m, step_m, lowest_m, highest_m):
        """Volumes when the table's zero stands step_m higher in a tank between two levels.

        Never below empty; above the top the part goes on as wide as it is there.
        """
        if self.moves_with_zero:
            return self.volume_m3(levels_m)
        moved = levels_m + step_m
        volume = self.volume_m3(np.clip(moved, lowest_m, highest_m))
        over = np.maximum(moved - highest_m, 0.0)
        if not np.any(over):
            return volume
        return volume + over * self.area_m2(np.array([highest_m]))[0]


class Solid(Part):
    """A part that is a whole tank; its highest dip is `top_m`."""

    def height_share(self, levels_m):
        """(rows,) levels as a share of the highest one, and its slope."""
        return np.asarray(levels_m, dtype=float) / self.top_m, 1 / self.top_m


def as_levels(levels_m):
    """(rows,) levels as floats, of an array or of one number."""
    return np.atleast_1d(np.asarray(levels_m, dtype=float))


def sum_derivatives(derivatives):
    """Sum what several parts give by each input.

    Parameters
    ----------
    derivatives : iterable of dict
        {input: derivative} of each part.

    Returns
    -------
    dict
        {input: sum}.

    Examples
    --------
    >>> sum_derivatives([{"datum": 2.0, "scale": 1.0}, {"datum": 3.0}])
    {'datum': 5.0, 'scale': 1.0}
    """
    total = {}
    for found in derivatives:
        for name, by in found.items():
            total[name] = total[name] + by if name in total else by
    return total
