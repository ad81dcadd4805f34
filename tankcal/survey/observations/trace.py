"""Where observations come from: rows of a file, by the names that the user gave."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Source:
    """What a user calls the N readings of a file.

    Attributes
    ----------
    file : str
    rows : tuple
        (N,) rows of the file; (): they stand in no row.
    ids : tuple
        (N,) tuples of names.
    element : tuple
        (N,) tuples, a name for each value: ("x", "y"); ("",) where there is only one.
    group : tuple
        (N,) names of the groups whose sds are judged together, "tape 1"; (): of no group.
    table : str
        As `Readings` name it; "" for everything else.
    """

    file: str
    rows: tuple
    ids: tuple
    element: tuple
    group: tuple = ()
    table: str = ""

    @cached_property
    def values(self):
        """(N,) how many values each reading has."""
        return np.array([len(one) for one in self.element], dtype=int)

    def trace(self):
        """The Trace of observations that are these readings, each on its own."""
        n = len(self.ids)
        return Trace(self, np.arange(n), np.ones(n, dtype=int))


@dataclass(frozen=True)
class Trace:
    """Of which readings n observations were made; it rides along on them.

    Attributes
    ----------
    source : Source
    reading : ndarray of int, shape (n,)
        Number there of the first reading of each observation.
    repeats : ndarray of int, shape (n,)
        Readings that were averaged.
    scatter : ndarray, shape (n,)
        Chi-square of these about their mean; None: none were averaged.
    """

    source: Source
    reading: np.ndarray
    repeats: np.ndarray
    scatter: np.ndarray | None = None

    def taken(self, keep):
        """The Trace of the observations `keep` (indices or a mask)."""
        scatter = None if self.scatter is None else self.scatter[keep]
        return Trace(self.source, self.reading[keep], self.repeats[keep], scatter)

    @property
    def file(self):
        """Its name."""
        return self.source.file

    @property
    def table(self):
        """See Source."""
        return self.source.table

    @cached_property
    def rows(self):
        """(n,) row of the first reading of each observation, or None."""
        return self._each(self.source.rows, None)

    @cached_property
    def ids(self):
        """(n,) tuples of names."""
        return self._each(self.source.ids)

    @cached_property
    def element(self):
        """(n,) tuples of the names of the values."""
        return self._each(self.source.element)

    @cached_property
    def group(self):
        """(n,) names of groups."""
        return self._each(self.source.group, "")

    def _each(self, names, missing=None):
        if not names:
            return (missing,) * len(self.reading)
        return tuple(names[i] for i in self.reading.tolist())

    @property
    def repeated(self):
        """(chi-square (n,), degrees of freedom (n,)) of the readings that were averaged."""
        scatter = np.zeros(len(self.reading)) if self.scatter is None else self.scatter
        return scatter, (self.repeats - 1) * self.source.values[self.reading]
