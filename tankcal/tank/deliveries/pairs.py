"""Deliveries between any pairs of dips, each with its own degrees of freedom."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.uncertainty import coverage_factor, dof_of, least_of, sum_of_fourths

CHUNK = 2048


@dataclass(frozen=True)
class Deliveries:
    """Volumes between pairs of dips, each field (n,).

    Attributes
    ----------
    low_m, high_m : ndarray
        Dips before and after, as asked, m.
    volume_m3 : ndarray
        V(high) - V(low), m3.
    u_m3, dof : ndarray
        Standard uncertainty, m3, and effective degrees of freedom.
    k, U_m3 : ndarray
        Coverage factor, and k u, m3.
    for_use : ndarray of bool
        False where one of the dips is in the critical zone of a floating roof.
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
        """(n,) U over the volume; inf where nothing is delivered and U is not 0."""
        return ratio_of(self.U_m3, self.volume_m3)


def deliveries(table, low_m, high_m):
    """Deliveries between pairs of dips: u^2 = |f(high) - f(low)|^2, k by Welch-Satterthwaite.

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
    found = deliveries_between(rows, table.probability, low, high, for_use)
    return replace(found, low_m=low_m, high_m=high_m)


def deliveries_between(rows, probability, low, high, for_use):
    """Deliveries between dips inside the table, some thousands of pairs at a time."""
    volume, u, w = np.empty((3, len(low)))
    for start in range(0, len(low), CHUNK):
        some = slice(start, start + CHUNK)
        (volume_low, f_low), (volume_high, f_high) = rows.at(low[some]), rows.at(high[some])
        volume[some] = volume_high - volume_low
        u[some], w[some] = rows.groups.norms(f_high - f_low)
    dof = rows.groups.effective(u, w)
    k = coverage_factor(probability, dof)
    return Deliveries(low, high, volume, u, dof, k, k * u, for_use)


def ratio_of(U, volume):
    """U over volume; inf where the volume is not above 0 but U is."""
    safe = np.where(volume > 0, volume, 1.0)
    return np.where(volume > 0, U / safe, np.where(U > 0, np.inf, 0.0))


class Groups:
    """Columns of the factor by source, and two norms of them from which degrees of freedom follow.

    u and w, w^4 = sum of u_s^4 / dof_s, are norms of a difference of columns, so that the search
    for the worst delivery bounds both by the triangle inequality; (u/w)^4 is the one rule.
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
        """(u, w) of (..., c) columns: u^2 = sum of squares, w^4 = sum of u_s^4 / dof_s."""
        squares = difference**2
        u = np.sqrt(squares.sum(axis=-1))
        if not len(self.dof):
            return u, np.zeros_like(u)
        by_source = squares[..., self.columns] @ self.members
        return u, sum_of_fourths(by_source, self.dof) ** 0.25

    def effective(self, u, w):
        """Effective degrees of freedom (u/w)^4, by the one rule (`uncertainty.dof_of`)."""
        return dof_of(u**2, w**4, self.least_dof)


@dataclass(frozen=True)
class Rows:
    """Dips (n,), volumes (n,), factor (n, c) and its sources."""

    height_m: np.ndarray
    volume_m3: np.ndarray
    factor_m3: np.ndarray
    groups: Groups

    def at(self, dip):
        """(volume, factor) at dips, linear between rows."""
        upper = np.clip(np.searchsorted(self.height_m, dip), 1, len(self.height_m) - 1)
        below = self.height_m[upper - 1]
        part = np.clip((dip - below) / (self.height_m[upper] - below), 0, 1)
        volume = (1 - part) * self.volume_m3[upper - 1] + part * self.volume_m3[upper]
        part = part[:, None]
        return volume, (1 - part) * self.factor_m3[upper - 1] + part * self.factor_m3[upper]
