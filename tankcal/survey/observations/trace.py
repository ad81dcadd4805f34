"""Sources of observations: rows of a file, by the user's names."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Source:
    """The N readings of a file, by the user's names.

    Attributes
    ----------
    file : str
    rows : tuple
        (N,) rows of the file; (): no rows.
    ids : tuple
        (N,) tuples of names.
    element : tuple
        (N,) tuples of value names: ("x", "y"); ("",) for a single value.
    group : tuple
        (N,) names of the groups whose standard deviations are tested together, "tape 1"; (): none.
    table : str
        As in `Readings`; "" for all other observations.
    """

    file: str
    rows: tuple
    ids: tuple
    element: tuple
    group: tuple = ()
    table: str = ""

    @cached_property
    def values(self):
        """Number (N,) of values of each reading."""
        return np.array([len(names) for names in self.element], dtype=int)

    def trace(self):
        """The Trace of observations that are these readings, without averaging."""
        n = len(self.ids)
        return Trace(self, np.arange(n), np.ones(n, dtype=int))


@dataclass(frozen=True)
class Trace:
    """Readings from which n observations were made; selected together with them.

    Attributes
    ----------
    source : Source
    reading : ndarray of int, shape (n,)
        Number in the source of the first reading of each observation.
    repeats : ndarray of int, shape (n,)
        Number of readings averaged.
    scatter : ndarray, shape (n,)
        Chi-square of the readings about their mean; None: no averaging.
    """

    source: Source
    reading: np.ndarray
    repeats: np.ndarray
    scatter: np.ndarray | None = None

    def taken(self, keep):
        """The Trace of selected observations (indices or a mask)."""
        scatter = None if self.scatter is None else self.scatter[keep]
        return Trace(self.source, self.reading[keep], self.repeats[keep], scatter)

    @property
    def file(self):
        """Name of the file."""
        return self.source.file

    @property
    def table(self):
        """See Source."""
        return self.source.table

    @cached_property
    def rows(self):
        """Row (n,) of the first reading of each observation, or None."""
        return self._each(self.source.rows, None)

    @cached_property
    def ids(self):
        """Tuples (n,) of names."""
        return self._each(self.source.ids)

    @cached_property
    def element(self):
        """Tuples (n,) of value names."""
        return self._each(self.source.element)

    @cached_property
    def group(self):
        """Names (n,) of groups."""
        return self._each(self.source.group, "")

    def _each(self, names, missing=None):
        """Names (n,) of the first reading of each observation."""
        if not names:
            return (missing,) * len(self.reading)
        return tuple(names[i] for i in self.reading.tolist())

    @property
    def repeated(self):
        """Chi-square (n,) and degrees of freedom (n,) of the averaged readings."""
        scatter = np.zeros(len(self.reading)) if self.scatter is None else self.scatter
        # k readings about their mean have k - 1 degrees of freedom per value.
        return scatter, (self.repeats - 1) * self.source.values[self.reading]
