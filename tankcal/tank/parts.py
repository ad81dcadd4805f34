"""Part of a tank: the interface of shells, heads, bottoms, solids and fittings.

A tank is the sum of its parts (`body.Body`). A part therefore provides, below any level, its
volume, the free surface, the derivatives by every input that changes it, and its own causes of
uncertainty.
"""

from abc import abstractmethod
from typing import Protocol

import numpy as np

from tankcal.uncertainty import Source


class Part(Protocol):
    """Part of a tank; classes implement it as their base class.

    Levels count from the bottom of the first course of a vertical tank, or from the lowest inside
    point of another tank, in metres. A part may have a negative volume: deadwood.

    Attributes
    ----------
    kind : str
        Category for the user: "wall", "bottom", "deadwood" or "roof".
    moves_with_zero : bool
        Whether the part was declared by dips. It then has no derivative by "datum": equal dips have
        equal volumes wherever the zero of the table is.
    has_own_height : bool
        For a bottom: whether its sources contain the uncertainty of its height, as for a bottom
        from scans; the input "bottom" is then not required.
    """

    kind: str = "wall"
    moves_with_zero: bool = False
    has_own_height: bool = False

    @abstractmethod
    def volume_m3(self, levels_m) -> np.ndarray:
        """Return the volume below each level.

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
        """Return the derivative of the volume by the level, (rows,) m2; at a jump, that above."""

    @abstractmethod
    def derivatives(self, levels_m) -> dict[str, np.ndarray]:
        """Return the derivatives of the volume by each input, with other inputs fixed.

        Returns
        -------
        dict of str to (rows,) or (rows, c) array
            By the name of the input, m3 per SI unit; c columns if each course has its own input.
        """

    def sources(self, levels_m) -> tuple[Source, ...]:
        """Return causes of uncertainty of this part alone, `Source`s of (rows, c) columns."""
        return ()

    @property
    def lowest_m(self) -> float:
        """Level of an empty tank with this part; inf for a part that never contains liquid."""
        return 0.0

    @property
    def breakpoints_m(self) -> tuple[float, ...]:
        """Levels at which the area jumps or, for a bottom, ends."""
        return ()

    def area_by(self, derivatives, levels_m):
        """Return `area_m2` from known derivatives: that by "datum", if there is one."""
        return derivatives["datum"] if "datum" in derivatives else self.area_m2(levels_m)

    def moved_m3(self, levels_m, step_m, lowest_m, highest_m):
        """Return volumes with the zero of the table raised, in a tank between two levels.

        Volumes are never below empty; above the top, the part continues with the area at the top.

        Parameters
        ----------
        levels_m : ndarray, shape (rows,)
            Levels of the dips before the change, m.
        step_m : float or ndarray, shape (rows,)
            Rise of the zero, m.
        lowest_m, highest_m : float
            Levels of the empty and of the full tank, m.

        Returns
        -------
        ndarray, shape (rows,)
            m3.
        """
        # The volume belongs to the dip, not to the level in the tank.
        if self.moves_with_zero:
            return self.volume_m3(levels_m)
        # A higher zero adds step_m to the level of each dip.
        moved_levels = levels_m + step_m
        volume = self.volume_m3(np.clip(moved_levels, lowest_m, highest_m))
        excess = np.maximum(moved_levels - highest_m, 0.0)
        if not np.any(excess):
            return volume
        return volume + excess * self.area_m2(np.array([highest_m]))[0]


class Solid(Part):
    """Part that is a whole tank; its highest dip is `top_m`."""

    def height_share(self, levels_m):
        """Return levels (rows,) as fractions of the highest level, and the derivative."""
        return np.asarray(levels_m, dtype=float) / self.top_m, 1 / self.top_m


def as_levels(levels_m):
    """Return levels (rows,) as floats, from an array or a single number."""
    return np.atleast_1d(np.asarray(levels_m, dtype=float))


def sum_derivatives(derivatives):
    """Sum the derivatives of several parts by each input.

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
    for part_derivatives in derivatives:
        for name, derivative in part_derivatives.items():
            total[name] = total[name] + derivative if name in total else derivative
    return total
