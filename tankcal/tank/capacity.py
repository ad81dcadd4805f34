"""Capacity table: volumes at dip heights, with a factor of their covariance.

The covariance of all rows is factor @ factor.T, with one column for each uncertain input. Rows,
differences of rows (deliveries) and the budget thus follow from a few common columns. Source: JCGM
100:2008 5.2, JCGM 102:2011 6.2; u, degrees of freedom and k by `uncertainty.Combined`.

A capacity that falls is an error; `refuse_falling` identifies the part that takes more than the
tank holds there.
"""

from dataclasses import dataclass
from functools import cached_property
from html import escape

import numpy as np

from tankcal.errors import HeightError, InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.text.display import volume_text
from tankcal.uncertainty import Source, combine

SAME_ROW = 1e-9  # a smaller weight is rounding: the dip coincides with the other row
SAME_M = 1e-9  # dips with a smaller difference are equal
ROUNDING = 1e-9  # relative to the capacity: a smaller fall is rounding


@dataclass(frozen=True)
class Quantity:
    """Volume with its uncertainty: value, standard u, effective dof, factor k, expanded U.

    Attributes
    ----------
    k : float or None
        None if U is the result of Monte Carlo instead of k u.
    for_use : bool
        False if a dip is in a zone in which the table must not be used.
    interval : str
        Method of U: "gum", "monte_carlo", or "gum_not_simulated" for a delivery that Monte Carlo
        did not include, although it simulated the table.
    ends_m3 : tuple[float, float] or None
        (low, high) of the Monte Carlo interval; None: value - U and value + U.
    """

    value_m3: float
    u_m3: float
    dof: float
    k: float | None
    U_m3: float
    for_use: bool = True
    interval: str = "gum"
    ends_m3: tuple[float, float] | None = None

    @property
    def low_m3(self) -> float:
        """Lower end of the interval."""
        return self.value_m3 - self.U_m3 if self.ends_m3 is None else self.ends_m3[0]

    @property
    def high_m3(self) -> float:
        """Upper end of the interval."""
        return self.value_m3 + self.U_m3 if self.ends_m3 is None else self.ends_m3[1]

    def __str__(self) -> str:
        return volume_text(self.value_m3, self.U_m3, self.k)

    def _repr_html_(self) -> str:
        return f"<p>{escape(str(self))}{'' if self.for_use else ', not for use'}</p>"


@dataclass(frozen=True, repr=False)
class Capacity:
    """Capacity table: dip heights from the zero of the table, volumes, and areas.

    Attributes
    ----------
    height_m, volume_m3, area_m2 : ndarray, shape (rows,)
        Dips, m, volumes, m3, and free surfaces, m2.
    sources : tuple of Source
        Sources of uncertainty of the volumes.
    probability : float
        Coverage probability.
    critical_m : tuple[float, float] or None
        (low, high) dips between which the table must not be used, because a floating roof is partly
        afloat; None: no such zone.
    """

    height_m: np.ndarray
    volume_m3: np.ndarray
    area_m2: np.ndarray
    sources: tuple[Source, ...]
    probability: float
    critical_m: tuple[float, float] | None = None

    def __repr__(self) -> str:
        top_m = self.height_m[-1]
        return f"<Capacity of {len(self.height_m)} rows to {top_m:g} m: {self.at(top_m)}>"

    @cached_property
    def factor_m3(self):
        """Factor (rows, inputs) of the covariance of all rows."""
        return np.hstack([np.empty((len(self.height_m), 0)), *(s.columns_m3 for s in self.sources)])

    @cached_property
    def u_m3(self):
        """Standard uncertainty (rows,) of each volume."""
        return self._combined_rows.u

    @cached_property
    def dof(self):
        """Effective degrees of freedom (rows,); inf if only such inputs contribute."""
        return self._combined_rows.effective_dof

    @cached_property
    def k(self):
        """Coverage factor (rows,)."""
        return self._combined_rows.k(self.probability)

    @cached_property
    def U_m3(self):
        """Expanded uncertainty (rows,), k u."""
        return self.k * self.u_m3

    @cached_property
    def _combined_rows(self):
        """`uncertainty.Combined` of all rows."""
        return combine(self.sources, len(self.height_m))

    def at(self, height_m):
        """Return the volume at a dip, interpolated linearly between rows as in a gauge.

        Parameters
        ----------
        height_m : float
            Dip, m; the top of the shell rounded to a millimetre counts as the top.

        Returns
        -------
        Quantity

        Raises
        ------
        HeightError
            For a dip outside the table.

        Examples
        --------
        >>> form = Source("form", np.array([[0.0], [0.2]]))
        >>> table = Capacity(np.array([0, 1.0]), np.array([0, 100.0]), np.ones(2), (form,), 0.95)
        >>> table.at(0.5).value_m3, table.at(0.5).u_m3
        (50.0, 0.1)
        """
        return self._combined([(height_m, 1.0)])

    def delivery(self, low_m, high_m):
        """Return the volume between two dips; their common errors cancel.

        Parameters
        ----------
        low_m, high_m : float
            Dips, m.

        Returns
        -------
        Quantity

        Raises
        ------
        HeightError
            For a dip outside the table.
        """
        return self._combined([(high_m, 1.0), (low_m, -1.0)])

    def covariance_m6(self, heights_m):
        """Return the covariance matrix of the volumes at n dips.

        Parameters
        ----------
        heights_m : array_like, shape (n,)
            Dips, m.

        Returns
        -------
        ndarray, shape (n, n)
            W F F' W', m6, with the factor F of the covariance of all rows and the weights W of the
            rows in the volumes at the dips.

        Raises
        ------
        HeightError
            For a dip outside the table.

        Examples
        --------
        >>> form = Source("form", np.array([[0.0], [0.2]]))
        >>> table = Capacity(np.array([0, 1.0]), np.array([0, 100.0]), np.ones(2), (form,), 0.95)
        >>> table.covariance_m6([0.5, 1.0]).round(4).tolist()
        [[0.01, 0.02], [0.02, 0.04]]
        """
        factor = self.weights(heights_m) @ self.factor_m3
        return factor @ factor.T

    def for_use(self, height_m):
        """Return whether the table may be used at each height."""
        height_m = np.asarray(height_m, dtype=float)
        if self.critical_m is None:
            return np.full(height_m.shape, True)
        low, high = self.critical_m
        return (height_m <= low) | (height_m >= high)

    def _combined(self, terms):
        """Return the `Quantity` of a sum of (height, sign) terms."""
        # A linear combination of rows: the covariance of the rows includes common errors exactly.
        weights = sum(sign * self.weights([height])[0] for height, sign in terms)
        combined = combine([source.weighted(weights[None, :]) for source in self.sources], 1)
        u, dof = float(combined.u[0]), float(combined.effective_dof[0])
        k = float(combined.k(self.probability)[0])
        for_use = bool(np.all(self.for_use([height for height, _ in terms])))
        return Quantity(float(weights @ self.volume_m3), u, dof, k, k * u, for_use)

    def inside(self, heights_m):
        """Return the dips (n,), with dips beyond the ends of the table by rounding set to the ends.

        The top of the shell rounded to a millimetre counts as the top. Raises HeightError for other
        dips outside the table.
        """
        dips = np.atleast_1d(np.asarray(heights_m, dtype=float))
        first, last = self.height_m[0], self.height_m[-1]
        # The negated form also refuses nan.
        outside = ~((dips >= first - SAME_M) & (dips <= max(round(last, 3), last + SAME_M)))
        if np.any(outside):
            raise HeightError(
                message(
                    "dip_outside_table",
                    "dip {dip_m:g} m is outside the capacity table ({first_m:g} to {last_m:g} m)",
                    dip_m=dips[outside][0],
                    first_m=first,
                    last_m=last,
                )
            )
        return np.clip(dips, first, last)

    def weights(self, heights_m):
        """Return the weights (n, rows) of the rows in the volumes at n dips.

        The interpolation is linear between two rows. The top of the shell rounded to a millimetre
        counts as the top. Raises HeightError outside the table.
        """
        dips = self.inside(heights_m)
        # Linear interpolation in the interval below the row, as in a gauge.
        upper = np.clip(np.searchsorted(self.height_m, dips), 1, len(self.height_m) - 1)
        below, above = self.height_m[upper - 1], self.height_m[upper]
        part = (dips - below) / (above - below)
        weights = np.zeros((len(dips), len(self.height_m)))
        row = np.arange(len(dips))
        weights[row, upper - 1], weights[row, upper] = 1 - part, part
        return weights

    def rows_of(self, height_m):
        """Return the numbers of the rows from which a dip is read, one or two."""
        return np.flatnonzero(self.weights([height_m])[0] > SAME_ROW)


def refuse_falling(job, body, zero_m, heights_m, volumes_m3):
    """Refuse a table whose volumes fall with rising dips, and name the likely cause.

    Parameters
    ----------
    job : Job
    body : Body
        Tank as the sum of its parts.
    zero_m : float
        Level of the zero of the table in the frame of the parts, m.
    heights_m, volumes_m3 : ndarray, shape (n,)
        Ascending dips, m, and the volumes there, m3.

    Raises
    ------
    InputError
        If deadwood, the floating roof or the bottom takes more than the tank holds there.
    SolutionError
        If the volume of the wall itself falls.
    """
    # Report the largest fall; rounding of large volumes is no fall.
    rise = np.diff(volumes_m3)
    falls = np.flatnonzero(rise < -ROUNDING * np.abs(volumes_m3).max())
    if len(falls) == 0:
        return
    worst = int(falls[np.argmin(rise[falls])])
    interval = np.array(heights_m)[[worst, worst + 1]]
    file, column, what = _find_cause(job, body, interval, zero_m)
    text = message(
        "table_falls",
        "the capacity falls from {from_m3:.6g} to {to_m3:.6g} m3 between the dips of "
        "{low_m:g} and {high_m:g} m, and {count} times in all; the likely cause is {what}, "
        "which takes up more than the tank holds there",
        from_m3=float(volumes_m3[worst]),
        to_m3=float(volumes_m3[worst + 1]),
        low_m=float(interval[0]),
        high_m=float(interval[1]),
        count=len(falls),
        what=what,
    )
    if file is None:
        raise SolutionError(str(text))
    raise InputError(Problem(file, text, None, column))


def _find_cause(job, body, dips_m, zero_m):
    """Return (file, column, words) of the part with the largest loss between two dips.

    The file is None if the wall is the cause.
    """
    gains = []
    for part in body.parts:
        low, high = part.volume_m3(dips_m + zero_m)
        gains.append((float(high - low), part.kind))
    # The part with the most negative change of volume is the likely cause.
    _, kind = min(gains)
    if kind == "deadwood":
        low, high = dips_m
        deepest = min(job.deadwood, key=lambda item: _volume_between(item, low, high))
        named = message("deadwood_named", "deadwood {name}", name=deepest.name)
        return "deadwood.csv", "volume_m3", named
    if kind == "roof":
        return "job.toml", "roof.mass_kg", message("floating_roof", "the floating roof")
    if kind == "wall":
        return None, None, message("wall_itself", "the wall itself")
    return "job.toml", "bottom", message("its_bottom", "the bottom")


def _volume_between(item, low_m, high_m):
    """Return the volume of deadwood between two dips, linear in height.

    Deadwood without height counts completely at its level.
    """
    height = item.top_m - item.bottom_m
    if height <= 0:
        return item.volume_m3 if low_m < item.bottom_m <= high_m else 0.0
    return item.volume_m3 * max(min(item.top_m, high_m) - max(item.bottom_m, low_m), 0.0) / height
