"""Deliveries between arbitrary pairs of dips, each with its own degrees of freedom."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.uncertainty import coverage_factor, dof_of, least_of, sum_of_fourths

CHUNK = 2048  # pairs in an array operation: limits the memory


@dataclass(frozen=True)
class Deliveries:
    """Volumes between pairs of dips; each field has the shape (n,).

    Attributes
    ----------
    low_m, high_m : ndarray
        Dips before and after, as given, m.
    volume_m3 : ndarray
        V(high) - V(low), m3.
    u_m3, dof : ndarray
        Standard uncertainty, m3, and effective degrees of freedom.
    k, U_m3 : ndarray
        Coverage factor, and k u, m3.
    for_use : ndarray of bool
        False if a dip is in the critical zone of a floating roof.
    """

    low_m: np.ndarray
    high_m: np.ndarray
    volume_m3: np.ndarray
    u_m3: np.ndarray
    dof: np.ndarray
    k: np.ndarray
    U_m3: np.ndarray
    for_use: np.ndarray

    @property
    def relative(self):
        """U (n,) over the volume; inf for a volume of 0 with U above 0."""
        return ratio_of(self.U_m3, self.volume_m3)


def deliveries(table, low_m, high_m):
    """Return deliveries between pairs of dips, with k by Welch-Satterthwaite.

    u^2 = |f(high) - f(low)|^2, with f the rows of the factor.

    Parameters
    ----------
    table : tankcal.tank.capacity.Capacity
    low_m, high_m : (n,) arrays or floats
        Dips before and after, m.

    Returns
    -------
    Deliveries

    Raises
    ------
    HeightError
        For a dip outside the table (`Capacity.inside`).
    """
    low_m, high_m = np.broadcast_arrays(*np.atleast_1d(low_m, high_m))
    low_m, high_m = low_m.astype(float), high_m.astype(float)
    low, high = table.inside(low_m), table.inside(high_m)
    rows = Rows(table.height_m, table.volume_m3, table.factor_m3, Groups(table.sources))
    for_use = table.for_use(low) & table.for_use(high)
    result = deliveries_between(rows, table.probability, low, high, for_use)
    return replace(result, low_m=low_m, high_m=high_m)


def deliveries_between(rows, probability, low, high, for_use):
    """Return deliveries between dips inside the table, in chunks of pairs.

    Parameters
    ----------
    rows : Rows
    probability : float
        Coverage probability.
    low, high : ndarray, shape (n,)
        Dips, m.
    for_use : ndarray of bool, shape (n,)

    Returns
    -------
    Deliveries
    """
    volume, u, w = np.empty((3, len(low)))
    for start in range(0, len(low), CHUNK):
        chunk = slice(start, start + CHUNK)
        (volume_low, f_low), (volume_high, f_high) = rows.at(low[chunk]), rows.at(high[chunk])
        volume[chunk] = volume_high - volume_low
        u[chunk], w[chunk] = rows.groups.norms(f_high - f_low)
    dof = rows.groups.effective(u, w)
    k = coverage_factor(probability, dof)
    return Deliveries(low, high, volume, u, dof, k, k * u, for_use)


def ratio_of(U, volume):
    """Return U over volume; inf if U is above 0 and the volume is not."""
    # Replace zero volumes before the division, which numpy evaluates for all elements.
    safe = np.where(volume > 0, volume, 1.0)
    return np.where(volume > 0, U / safe, np.where(U > 0, np.inf, 0.0))


class Groups:
    """Columns of the factor by source, and two norms that determine the degrees of freedom.

    u and w, with w^4 = sum of u_s^4 / dof_s, are norms of a difference of columns. The triangle
    inequality thus bounds both in the search for the worst delivery. The effective degrees of
    freedom are (u/w)^4.
    """

    def __init__(self, sources):
        widths = [source.columns_m3.shape[1] for source in sources]
        owner = np.repeat(np.arange(len(sources)), widths)
        dof = np.array([source.u_dof for source in sources], dtype=float)
        finite = np.flatnonzero(np.isfinite(dof) & (np.array(widths, dtype=int) > 0))
        self.columns = np.flatnonzero(np.isin(owner, finite))
        self.members = (owner[self.columns, None] == finite).astype(float)
        self.dof = dof[finite]
        self.least_dof = least_of(self.dof)

    def norms(self, difference):
        """Return (u, w) of columns (..., c): u^2 = sum of squares, w^4 = sum of u_s^4 / dof_s."""
        squares = difference**2
        u = np.sqrt(squares.sum(axis=-1))
        if not len(self.dof):
            return u, np.zeros_like(u)
        # Only sources with finite degrees of freedom contribute to w.
        by_source = squares[..., self.columns] @ self.members
        return u, sum_of_fourths(by_source, self.dof) ** 0.25

    def effective(self, u, w):
        """Return effective degrees of freedom (u/w)^4 (`uncertainty.dof_of`)."""
        return dof_of(u**2, w**4, self.least_dof)


@dataclass(frozen=True)
class Rows:
    """Dips (n,), volumes (n,), factor (n, c) and its groups of sources."""

    height_m: np.ndarray
    volume_m3: np.ndarray
    factor_m3: np.ndarray
    groups: Groups

    def at(self, dip):
        """Return (volume, factor) at dips, linear between rows."""
        upper = np.clip(np.searchsorted(self.height_m, dip), 1, len(self.height_m) - 1)
        below = self.height_m[upper - 1]
        part = np.clip((dip - below) / (self.height_m[upper] - below), 0, 1)
        volume = (1 - part) * self.volume_m3[upper - 1] + part * self.volume_m3[upper]
        part = part[:, None]
        return volume, (1 - part) * self.factor_m3[upper - 1] + part * self.factor_m3[upper]
