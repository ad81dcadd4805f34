"""A lowest zone of a tank that was measured by liquid, and what the other parts add above it."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tankcal.errors import HeightError, SolutionError
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels
from tankcal.uncertainty import Source


@dataclass(frozen=True)
class MeasuredBottom(Part):
    """The lowest zone of a tank, measured by liquid; it stands for all that is in that zone.

    All other parts count from `highest_m` up only (`Above`): the measured volumes hold shell,
    deadwood and head of that zone already, and its uncertainty replaces theirs.

    levels_m    (n,) ascending
    volumes_m3  (n,) capacity below each
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
        """Level below which nothing was measured, or the highest at which the tank is empty."""
        empty = self.levels_m[self.volumes_m3 == 0]
        return float(empty[-1] if len(empty) else self.levels_m[0])

    @property
    def highest_m(self):
        """Level above which the other parts count."""
        return float(self.levels_m[-1])

    @property
    def breakpoints_m(self):
        """Both ends of the zone."""
        return (self.lowest_m, self.highest_m)

    def volume_m3(self, levels_m):
        """(rows,) the measured capacity, above `highest_m` that of `highest_m`.

        Between dips by monotone cubics (Fritsch & Carlson 1980). Raises HeightError below the
        lowest dip, unless the tank is empty there.
        """
        return self.curve(self._measured(levels_m))

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level; 0 from `highest_m` up."""
        inside = (as_levels(levels_m) >= self.levels_m[0]) & (as_levels(levels_m) < self.highest_m)
        return np.where(inside, self.curve(self._measured(levels_m), 1), 0.0)

    def derivatives(self, levels_m):
        """None: volumes were measured by dips, from wherever the table's zero is."""
        return {}

    def sources(self, levels_m):
        """Errors of the measured volumes, linear between dips, and of the curve between them.

        The curve's half-width is its distance from straight lines, rectangular. Above `highest_m`
        all rows have the error of the last volume in common.
        """
        levels = self._measured(levels_m)
        errors = [np.interp(levels, self.levels_m, column) for column in self.errors_m3.T]
        bend = self.curve(levels) - np.interp(levels, self.levels_m, self.volumes_m3)
        return (
            Source("bottom_liquid", np.column_stack(errors), type="B"),
            Source(
                "bottom_curve", bend[:, None] / np.sqrt(3), type="B", distribution="rectangular"
            ),
        )

    def _measured(self, levels_m):
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
    """A bottom that was measured by liquid.

    Where u grows from one dip to the next, its growth is the independent error of what was added
    between them; where it does not, both dips have one error: a delivery within the zone is as
    uncertain as what was metered between.

    Parameters
    ----------
    levels_m : array_like, shape (n,)
        Rising dips, two or more, m.
    volumes_m3 : array_like, shape (n,)
        Volume below each, cumulative, m3.
    u_m3 : array_like, shape (n,), optional
        Standard uncertainty of each, m3; None: exact.

    Returns
    -------
    MeasuredBottom

    Raises
    ------
    SolutionError
        With the number of the row, when levels do not rise or volumes fall, or one is negative.

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
    follows = np.append(True, (np.diff(levels) > 0) & (np.diff(volumes) >= 0))
    wrong = np.flatnonzero(~(finite & follows & (volumes >= 0) & (u >= 0)))
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
        before = u[row - 1] if row else 0.0
        common = min(1.0, u[row] / before) if before > 0 else 0.0
        errors[row] = common * errors[row - 1]
        errors[row, row] = np.sqrt(max(u[row] ** 2 - (common * before) ** 2, 0.0))
    return MeasuredBottom(
        levels, volumes, errors, scipy.interpolate.PchipInterpolator(levels, volumes)
    )


@dataclass(frozen=True)
class Above(Part):
    """Another part of the tank, counted from a level up: P(L) - P(level) for L above it, else 0.

    Its derivatives and sources likewise, so that what a measured zone replaced cancels.

    Attributes
    ----------
    part : Part
        The part that is counted.
    level_m : float
        The level from which it counts, m.
    """

    part: Part
    level_m: float

    @property
    def kind(self):
        """That of the part."""
        return self.part.kind

    @property
    def moves_with_zero(self):
        """That of the part."""
        return self.part.moves_with_zero

    @property
    def breakpoints_m(self):
        """Those of the part."""
        return self.part.breakpoints_m

    def volume_m3(self, levels_m):
        """(rows,) contribution above the level."""
        volume = self.part.volume_m3(self._and_own(levels_m))
        return volume[:-1] - volume[-1]

    def area_m2(self, levels_m):
        """(rows,) derivative of `volume_m3` by the level."""
        levels = as_levels(levels_m)
        area = self.part.area_m2(np.maximum(levels, self.level_m))
        return np.where(levels >= self.level_m, area, 0.0)

    def derivatives(self, levels_m):
        """{input: (rows,)} those of the part, less the same at `level_m`."""
        levels = self._and_own(levels_m)
        found = self.part.derivatives(levels)
        return {name: column[:-1] - column[-1] for name, column in found.items()}

    def sources(self, levels_m):
        """Those of the part, less the same at `level_m`."""
        return tuple(
            replace(source, columns_m3=source.columns_m3[:-1] - source.columns_m3[-1])
            for source in self.part.sources(self._and_own(levels_m))
        )

    def area_by(self, derivatives, levels_m):
        """`area_m2`: the derivative by "datum" is not it, for the level goes with the zero."""
        return self.area_m2(levels_m)

    def moved_m3(self, levels_m, step_m, lowest_m, highest_m):
        """Those of the part, less the same at `level_m`, which goes with the zero."""
        if self.moves_with_zero:
            return self.volume_m3(levels_m)
        upper = np.maximum(levels_m, self.level_m)
        lower = np.full(len(levels_m), self.level_m)
        above, below = (
            self.part.moved_m3(ends, step_m, lowest_m, highest_m) for ends in (upper, lower)
        )
        return above - below

    def _and_own(self, levels_m):
        return np.append(np.maximum(as_levels(levels_m), self.level_m), self.level_m)
