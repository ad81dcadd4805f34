"""The capacity table: volumes at dip heights with a factor of their covariance, and what follows.

The covariance of all rows is factor @ factor.T with one column for each uncertain input, so rows,
differences of rows (deliveries) and the budget all come from the same few columns.
Source: JCGM 100:2008 5.2, JCGM 102:2011 6.2; degrees of freedom by Welch-Satterthwaite.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError
from tankcal.uncertainty import Source, coverage_factor, effective_dof


@dataclass(frozen=True)
class Quantity:
    """A volume with its uncertainty: value, standard u, effective dof, factor k, expanded U.

    for_use  False where a dip stands in a zone in which the table must not be used
    """

    value_m3: float
    u_m3: float
    dof: float
    k: float
    U_m3: float
    for_use: bool = True


@dataclass(frozen=True)
class Capacity:
    """The table: (rows,) dip heights from the table's zero, volumes, and areas of the cut.

    critical_m  (low, high) dips between which the table is not for use, or None: a floating roof
                that is partly afloat
    """

    height_m: np.ndarray
    volume_m3: np.ndarray
    area_m2: np.ndarray
    sources: tuple[Source, ...]
    probability: float
    critical_m: tuple[float, float] | None = None

    @property
    def factor_m3(self):
        """(rows, inputs) factor of the covariance of all rows."""
        return np.hstack([np.empty((len(self.height_m), 0)), *(s.columns_m3 for s in self.sources)])

    @property
    def u_m3(self):
        """(rows,) standard uncertainty of each volume."""
        return np.sqrt(np.sum(self.factor_m3**2, axis=1))

    @property
    def dof(self):
        """(rows,) effective degrees of freedom, inf where only such inputs contribute."""
        return self._dof_of([source.columns_m3 for source in self.sources])

    @property
    def k(self):
        """(rows,) coverage factor."""
        return coverage_factor(self.probability, self.dof)

    @property
    def U_m3(self):
        """(rows,) expanded uncertainty k u."""
        return self.k * self.u_m3

    def at(self, height_m):
        """The volume at a dip, interpolated linearly between rows as a gauge does.

        The top of the shell rounded to a millimetre counts as the top. Raises HeightError outside
        the table.
        """
        return self._combined([(height_m, 1.0)])

    def delivery(self, low_m, high_m):
        """The volume between two dips; what both have in common cancels.

        Raises HeightError outside the table.
        """
        return self._combined([(high_m, 1.0), (low_m, -1.0)])

    def for_use(self, height_m):
        """Whether the table may be used at each height: not inside the critical zone of a roof."""
        height_m = np.asarray(height_m, dtype=float)
        if self.critical_m is None:
            return np.full(height_m.shape, True)
        low, high = self.critical_m
        return (height_m <= low) | (height_m >= high)

    def _combined(self, terms):
        weights = sum(sign * self._row_weights(height) for height, sign in terms)
        columns = [(weights @ source.columns_m3)[None, :] for source in self.sources]
        u = float(np.sqrt(sum(np.sum(column**2) for column in columns)))
        dof = float(self._dof_of(columns)[0])
        k = float(coverage_factor(self.probability, dof))
        for_use = bool(np.all(self.for_use([height for height, _ in terms])))
        return Quantity(float(weights @ self.volume_m3), u, dof, k, k * u, for_use)

    def _row_weights(self, height_m):
        first, last = self.height_m[0], self.height_m[-1]
        if last < height_m <= round(last, 3):
            height_m = last  # a dip is read to the millimetre, the shell ends a little below it
        if not first <= height_m <= last:
            raise HeightError(
                f"height {height_m:g} m is outside the capacity table ({first:g} to {last:g} m)"
            )
        upper = min(max(int(np.searchsorted(self.height_m, height_m)), 1), len(self.height_m) - 1)
        below, above = self.height_m[upper - 1], self.height_m[upper]
        part = (height_m - below) / (above - below)
        weights = np.zeros(len(self.height_m))
        weights[upper - 1], weights[upper] = 1 - part, part
        return weights

    def _dof_of(self, columns):
        if not columns:
            return np.full(len(self.height_m), np.inf)
        by_source = np.column_stack([np.sqrt(np.sum(c**2, axis=1)) for c in columns])
        return effective_dof(by_source, [source.dof for source in self.sources])
