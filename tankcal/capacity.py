"""The capacity table: volumes at dip heights with a factor of their covariance, and what follows.

The covariance of all rows is factor @ factor.T with one column for each uncertain input, so rows,
differences of rows (deliveries) and the budget all come from the same few columns.
Source: JCGM 100:2008 5.2, JCGM 102:2011 6.2; degrees of freedom by Welch-Satterthwaite.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError
from tankcal.uncertainty import Source, coverage_factor, effective_dof
from tankcal.volumes import ShellVolume


@dataclass(frozen=True)
class Quantity:
    """A volume with its uncertainty: value, standard u, effective dof, factor k, expanded U."""

    value_m3: float
    u_m3: float
    dof: float
    k: float
    U_m3: float


@dataclass(frozen=True)
class Propagation:
    """What is uncertain about a shell, ready for any heights above its bottom.

    points_m2, form_m2  (f, c) factors of the covariance of the shell's features
    declared            inputs with name, u (SI), u_as_read, unit, type, distribution, dof, note
    scale               of horizontal lengths, by temperature; expansion_per_k its coefficient
    """

    volume: ShellVolume
    points_m2: np.ndarray
    points_dof: float
    form_m2: np.ndarray
    declared: tuple
    scale: float
    expansion_per_k: float

    def sources(self, levels_m):
        """One `Source` for each input, with a row for each height above the bottom.

        A height below the bottom (a dip plate that lies lower) has no volume and no uncertainty.
        """
        weights = self.volume.weights_m(np.maximum(levels_m, 0.0))
        sources = [Source("points", weights @ self.points_m2, self.points_dof)]
        if self.form_m2.shape[1]:
            sources.append(Source("form", weights @ self.form_m2))
        for one in self.declared:
            column = self.derivative(one.name, levels_m) * one.u
            sources.append(
                Source(
                    one.name,
                    column[:, None],
                    one.dof,
                    one.u_as_read,
                    one.unit,
                    one.type,
                    one.distribution,
                    one.note,
                )
            )
        return tuple(sources)

    def derivative(self, name, levels_m):
        """(rows,) derivative of the volumes by a declared input, m3 per SI unit of the input.

        "scale" multiplies the surveyed lengths square to the axis, "datum" lifts the table's zero.
        """
        wet = np.asarray(levels_m) >= 0
        levels = np.maximum(levels_m, 0.0)
        by_length = 2 * self.volume.volume_m3(levels) / self.scale
        return {
            "scale": lambda: self.volume.by_scale_m3(levels),
            "datum": lambda: self.volume.area_m2(levels) * wet,
            "plate_thickness": lambda: -self.volume.inset_m2(levels),
            "paint": lambda: -self.volume.inset_m2(levels),
            "shell_temperature": lambda: -self.expansion_per_k * by_length,
            "expansion": lambda: (self.scale - 1) / self.expansion_per_k * by_length,
        }[name]()


@dataclass(frozen=True)
class Capacity:
    """The table: (rows,) dip heights from the table's zero, volumes, and areas of the cut."""

    height_m: np.ndarray
    volume_m3: np.ndarray
    area_m2: np.ndarray
    sources: tuple[Source, ...]
    probability: float

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

    def _combined(self, terms):
        weights = sum(sign * self._row_weights(height) for height, sign in terms)
        columns = [(weights @ source.columns_m3)[None, :] for source in self.sources]
        u = float(np.sqrt(sum(np.sum(column**2) for column in columns)))
        dof = float(self._dof_of(columns)[0])
        k = float(coverage_factor(self.probability, dof))
        return Quantity(float(weights @ self.volume_m3), u, dof, k, k * u)

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


def table_heights(step_m, top_m):
    """Rows at 0, step, 2 step, ... and the top itself, m; a last step under a micron is dropped."""
    count = int(np.floor(top_m / step_m + 1e-9))
    heights = np.round(np.arange(count + 1) * step_m, 9)
    if top_m - heights[-1] > 1e-6:
        return np.append(heights, top_m)
    heights[-1] = min(heights[-1], top_m)
    return heights
