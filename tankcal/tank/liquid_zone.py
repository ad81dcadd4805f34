"""Lowest zone of a tank measured with liquid, and the contribution of other parts above it."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tankcal.errors import HeightError, SolutionError
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels
from tankcal.uncertainty import Source


@dataclass(frozen=True)
class MeasuredBottom(Part):
    """Lowest zone of a tank, measured with liquid; it replaces all parts in that zone.

    All other parts count only above `highest_m` (`PartAbove`). The measured volumes already contain
    shell, deadwood and head of that zone, and their uncertainty replaces that of these parts.

    levels_m    (n,) ascending
    volumes_m3  (n,) capacity below each level
    errors_m3   (n, n) factor of their covariance
    curve       (rows,) -> volume, monotone and smooth through the volumes
    """

    levels_m: np.ndarray
    volumes_m3: np.ndarray
    errors_m3: np.ndarray
    curve: "scipy.interpolate.PchipInterpolator"
    kind, moves_with_zero = "bottom", True

    @property
    def lowest_m(self):
        """Lowest measured level, or the highest level at which the tank is empty."""
        empty = self.levels_m[self.volumes_m3 == 0]
        return float(empty[-1] if len(empty) else self.levels_m[0])

    @property
    def highest_m(self):
        """Level above which the other parts count."""
        return float(self.levels_m[-1])

    @property
    def breakpoints_m(self):
        """Lower and upper limit of the zone."""
        return (self.lowest_m, self.highest_m)

    def volume_m3(self, levels_m):
        """Return the measured capacity (rows,), constant above `highest_m`.

        Interpolation between dips is by monotone cubics (Fritsch & Carlson 1980). Raises
        HeightError below the lowest dip, unless the tank is empty there.
        """
        return self.curve(self._limit_levels(levels_m))

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level; 0 from `highest_m` up."""
        inside = (as_levels(levels_m) >= self.levels_m[0]) & (as_levels(levels_m) < self.highest_m)
        return np.where(inside, self.curve(self._limit_levels(levels_m), 1), 0.0)

    def derivatives(self, levels_m):
        """Return no derivatives: volumes refer to dips, wherever the zero of the table is."""
        return {}

    def sources(self, levels_m):
        """Return the errors of the measured volumes, and of the curve between dips.

        Errors are linear between dips. The half-width of the curve is its distance from straight
        lines, with a rectangular distribution. Above `highest_m`, all rows share the error of the
        last volume.
        """
        levels = self._limit_levels(levels_m)
        errors = [np.interp(levels, self.levels_m, column) for column in self.errors_m3.T]
        # Distance of the curve from straight lines between the measured volumes.
        bend = self.curve(levels) - np.interp(levels, self.levels_m, self.volumes_m3)
        return (
            Source("bottom_liquid", np.column_stack(errors)),
            Source("bottom_curve", bend[:, None] / np.sqrt(3), distribution="rectangular"),
        )

    def _limit_levels(self, levels_m):
        """Return the levels limited to the zone."""
        levels, lowest = as_levels(levels_m), self.levels_m[0]
        if self.volumes_m3[0] > 0 and not np.all(levels >= lowest):
            raise HeightError(
                message(
                    "level_below_measured",
                    "level {level_m:g} m is below the lowest level measured by liquid "
                    "({lowest_m:g} m, {volume_m3:g} m3)",
                    level_m=levels.min(),
                    lowest_m=lowest,
                    volume_m3=self.volumes_m3[0],
                )
            )
        return np.clip(levels, lowest, self.highest_m)


def measured_bottom(levels_m, volumes_m3, u_m3=None):
    """Return a bottom measured with liquid.

    Where u increases from one dip to the next, the increase is the independent error of the added
    volume. Where u does not increase, both dips have a common error. The uncertainty of a delivery
    within the zone is thus that of the metered volume.

    Parameters
    ----------
    levels_m : array_like, shape (n,)
        Ascending dips, two or more, m.
    volumes_m3 : array_like, shape (n,)
        Cumulative volume below each dip, m3.
    u_m3 : array_like, shape (n,), optional
        Standard uncertainty of each volume, m3; None: exact.

    Returns
    -------
    MeasuredBottom

    Raises
    ------
    SolutionError
        With the number of the row, if levels do not rise, volumes fall, or a volume or uncertainty
        is negative.

    Examples
    --------
    >>> bottom = measured_bottom([0.0, 0.1, 0.2], [0.0, 5.0, 10.0], [0.0, 0.03, 0.05])
    >>> float(bottom.volume_m3([0.1])[0])
    5.0
    >>> bottom.errors_m3.round(3).tolist()
    [[0.0, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.03, 0.04]]
    """
    levels, volumes = np.asarray(levels_m, dtype=float), np.asarray(volumes_m3, dtype=float)
    u = np.zeros(len(levels)) if u_m3 is None else np.asarray(u_m3, dtype=float)
    if len(levels) < 2:
        raise SolutionError(
            message(
                "too_few_measured_volumes",
                "{count} volumes measured by liquid; expected two or more",
                count=len(levels),
            )
        )
    finite = np.isfinite(levels) & np.isfinite(volumes) & np.isfinite(u)
    is_ascending = np.append(True, (np.diff(levels) > 0) & (np.diff(volumes) >= 0))
    wrong = np.flatnonzero(~(finite & is_ascending & (volumes >= 0) & (u >= 0)))
    if len(wrong):
        row = wrong[0]
        raise SolutionError(
            message(
                "measured_volume_wrong",
                "volume {number} measured by liquid: level {level_m:g} m, {volume_m3:g} m3, u "
                "{u_m3:g} m3; expected rising levels, volumes that do not fall, none negative",
                number=row + 1,
                level_m=levels[row],
                volume_m3=volumes[row],
                u_m3=u[row],
            )
        )
    errors = np.zeros((len(u), len(u)))
    for row in range(len(u)):
        previous_u = u[row - 1] if row else 0.0
        common = min(1.0, u[row] / previous_u) if previous_u > 0 else 0.0
        # Row of the Cholesky factor: the common part of the previous row, plus an independent part.
        errors[row] = common * errors[row - 1]
        errors[row, row] = np.sqrt(max(u[row] ** 2 - (common * previous_u) ** 2, 0.0))
    return MeasuredBottom(
        levels, volumes, errors, scipy.interpolate.PchipInterpolator(levels, volumes)
    )


@dataclass(frozen=True)
class PartAbove(Part):
    """Another part of the tank above a level: P(L) - P(level) for L above the level, else 0.

    Its derivatives and sources are reduced likewise, so that errors of the replaced zone cancel.

    Attributes
    ----------
    part : Part
        Original part.
    level_m : float
        Level above which the part counts, m.
    """

    part: Part
    level_m: float

    @property
    def kind(self):
        """Kind of the part."""
        return self.part.kind

    @property
    def moves_with_zero(self):
        """As for the part."""
        return self.part.moves_with_zero

    @property
    def breakpoints_m(self):
        """Breakpoints of the part."""
        return self.part.breakpoints_m

    def volume_m3(self, levels_m):
        """Return the contribution (rows,) above the level."""
        volume = self.part.volume_m3(self._and_own(levels_m))
        # The last element is the volume at `level_m`, appended by `_and_own`.
        return volume[:-1] - volume[-1]

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of `volume_m3` by the level."""
        levels = as_levels(levels_m)
        area = self.part.area_m2(np.maximum(levels, self.level_m))
        return np.where(levels >= self.level_m, area, 0.0)

    def derivatives(self, levels_m):
        """Return {input: (rows,)} of the part, less the derivative at `level_m`."""
        levels = self._and_own(levels_m)
        derivatives_of_part = self.part.derivatives(levels)
        return {name: column[:-1] - column[-1] for name, column in derivatives_of_part.items()}

    def sources(self, levels_m):
        """Return the sources of the part, less their columns at `level_m`."""
        return tuple(
            replace(source, columns_m3=source.columns_m3[:-1] - source.columns_m3[-1])
            for source in self.part.sources(self._and_own(levels_m))
        )

    def area_by(self, derivatives, levels_m):
        """Return `area_m2`, which differs from "datum", since the level moves with the zero."""
        return self.area_m2(levels_m)

    def moved_m3(self, levels_m, step_m, lowest_m, highest_m):
        """Return the volume of the part, less that at `level_m`, which moves with the zero.

        Parameters
        ----------
        levels_m, step_m, lowest_m, highest_m
            As for `Part.moved_m3`.

        Returns
        -------
        ndarray, shape (rows,)
        """
        if self.moves_with_zero:
            return self.volume_m3(levels_m)
        # The lower limit moves with the zero as well, so both ends are moved.
        upper = np.maximum(levels_m, self.level_m)
        lower = np.full(len(levels_m), self.level_m)
        above, below = (
            self.part.moved_m3(ends, step_m, lowest_m, highest_m) for ends in (upper, lower)
        )
        return above - below

    def _and_own(self, levels_m):
        """Return the levels, at least `level_m`, followed by `level_m`."""
        return np.append(np.maximum(as_levels(levels_m), self.level_m), self.level_m)
