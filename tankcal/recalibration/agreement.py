"""Agreement of two tables: normalised errors of rows and deliveries, with correlation.

    E_n = d / sqrt(U_new^2 + U_old^2 - 2 c U_new U_old)

c is the correlation of the errors of the two tables. |E_n| = 1 at
c = (U_new^2 + U_old^2 - d^2) / (2 U_new U_old).
Source: ISO/IEC 17043:2010, B.3 (E_n, c = 0); with correlation JCGM 100:2008, 5.2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

PROPORTIONAL = 0.01  # largest spread of U over V of a U stated in percent
SAME_M = 1e-9  # largest difference of equal dips


def normalized_error(d, U_new, U_former, c=0.0):
    """Normalised error E_n of differences; nan if a U is unknown, inf if the denominator is zero.

    Parameters
    ----------
    d, U_new, U_former : array_like
        Difference, and expanded uncertainties of equal coverage, in one unit.
    c : float
        Correlation of the errors of the two tables.

    Examples
    --------
    >>> [round(float(normalized_error(0.70, 0.46, 0.60, c)), 2) for c in (0, 0.5)]
    [0.93, 1.29]
    """
    d, new, former = np.broadcast_arrays(
        *(np.asarray(x, dtype=float) for x in (d, U_new, U_former))
    )
    variance = new**2 + former**2 - 2 * c * new * former
    least = 1e-12 * (new**2 + former**2)
    U = np.sqrt(np.where(variance > least, variance, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(d == 0, 0.0, d / U)
    return np.where(np.isnan(new) | np.isnan(former), np.nan, ratio)


def critical_correlation(d, U_new, U_former):
    """Correlation at which |E_n| is 1.

    The result is nan if |E_n| is below 1 for every correlation, if a U is unknown, or if the
    difference is zero. It is -1 if |E_n| exceeds 1 for every correlation.

    Parameters
    ----------
    d, U_new, U_former : array_like
        Difference, and expanded uncertainties of equal coverage, in one unit.
    """
    d, new, former = np.broadcast_arrays(
        *(np.asarray(x, dtype=float) for x in (d, U_new, U_former))
    )
    product = 2 * new * former
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = (new**2 + former**2 - d**2) / product
    correlation = np.where(correlation > 1, np.nan, np.maximum(correlation, -1.0))
    return np.where((product > 0) & (d != 0), correlation, np.nan)


@dataclass(frozen=True)
class TableUncertainty:
    """Expanded uncertainties of a table at some dips, all of one coverage.

    Attributes
    ----------
    k : float
        Coverage factor.
    volume_m3 : (rows,) ndarray
        Volumes at the dips.
    U_m3 : (rows,) ndarray or None
        Expanded uncertainties, rounding included; None if unknown.
    rounding_m3 : float
        Contribution of the last digit to U.
    factor_m3 : (rows, inputs) ndarray or None
        Factor of the covariance of a record, scaled such that U of a difference is the norm of the
        difference of its rows.
    deliveries_by : {"record", "proportional", "independent_rows"} or None
        Method for U of a delivery.
    """

    k: float
    volume_m3: np.ndarray
    U_m3: np.ndarray | None
    rounding_m3: float
    factor_m3: np.ndarray | None
    deliveries_by: str | None

    def rows(self):
        """U of the rows, shape (rows,); nan if unknown."""
        return np.full(len(self.volume_m3), np.nan) if self.U_m3 is None else self.U_m3

    def deliveries(self, low, high):
        """U (n,) of deliveries between rows, given by their indices; nan if unknown."""
        if self.deliveries_by is None:
            return np.full(len(low), np.nan)
        if self.deliveries_by == "record":
            # covariance = factor factor', so U of a difference is the norm of the difference
            apart = self.factor_m3[high] - self.factor_m3[low]
            U = np.sqrt(np.einsum("ij,ij->i", apart, apart))
        elif self.deliveries_by == "proportional":
            # errors proportional to the volume are fully correlated between rows
            part = self.U_m3[-1] / self.volume_m3[-1]
            U = part * np.abs(self.volume_m3[high] - self.volume_m3[low])
        else:
            return np.hypot(self.U_m3[low], self.U_m3[high])
        # both rows of a delivery are rounded independently
        return np.hypot(U, np.sqrt(2) * self.rounding_m3)


def coverage_factor(table):
    """Coverage factor of a normal distribution for the coverage of a table's U."""
    if table.record is None:
        return table.k
    probability = table.record["job"]["table"].get("coverage_probability") or 0.95
    return float(ndtri(0.5 + probability / 2))


def interpolate_uncertainty(table, dips_m, volume_m3, k, error_m3=0.0):
    """Return the TableUncertainty of a FormerTable at dips.

    Parameters
    ----------
    table : FormerTable
    dips_m : (rows,) ndarray
        Dips within the range of the table.
    volume_m3 : (rows,) ndarray
        Volumes at the dips.
    k : float
        Coverage factor of a normal distribution for the required coverage.
    error_m3 : float
        Largest interpolation error, included as a rectangular distribution.
    """
    # rectangular distributions: width of one digit, half width of the interpolation error
    spread = np.hypot(table.volume_quantum_m3 / np.sqrt(12), error_m3 / np.sqrt(3))
    rounding = float(k * spread)
    if table.U_m3 is None:
        return TableUncertainty(k, volume_m3, None, rounding, None, None)
    scale = k / coverage_factor(table)
    stated = scale * np.interp(dips_m, table.height_m, table.U_m3)
    factor, by = None, "independent_rows"
    if table.factor_m3 is not None:
        factor, by = _interpolate_factor(table, dips_m, stated), "record"
    elif _is_in_percent(table):
        by = "proportional"
    return TableUncertainty(k, volume_m3, np.hypot(stated, rounding), rounding, factor, by)


def _interpolate_factor(table, dips, stated):
    """Covariance factor (rows, inputs) at dips; each row has the norm of the stated U."""
    upper = np.clip(np.searchsorted(table.height_m, dips), 1, len(table.height_m) - 1)
    below = table.height_m[upper - 1]
    part = ((dips - below) / (table.height_m[upper] - below))[:, None]
    factor = (1 - part) * table.factor_m3[upper - 1] + part * table.factor_m3[upper]
    length = np.sqrt(np.einsum("ij,ij->i", factor, factor))
    # one scale for all rows, so that the factor remains that of one covariance
    usual = np.median(stated[length > 0] / length[length > 0]) if (length > 0).any() else 1.0
    return usual * factor


def _is_in_percent(table):
    above = table.volume_m3 > 0.05 * table.volume_m3[-1]
    part = table.U_m3[above] / table.volume_m3[above]
    return bool(len(part) and np.ptp(part) <= PROPORTIONAL * part.max())


@dataclass(frozen=True)
class Deliveries:
    """Differences of deliveries between rows; each field has shape (n,)."""

    low: np.ndarray
    high: np.ndarray
    d_m3: np.ndarray
    former_m3: np.ndarray
    U_new_m3: np.ndarray
    U_former_m3: np.ndarray
    E_n: np.ndarray
    c_limit: np.ndarray


def compare_deliveries(basis, former_U, new_U, c, low, high):
    """Return the `Deliveries` between rows of a OneBasis.

    Parameters
    ----------
    basis : OneBasis
    former_U, new_U : TableUncertainty
    c : float
        Correlation of the errors of the two tables.
    low, high : array_like of int, shape (n,)
        Indices of the rows.
    """
    low, high = np.atleast_1d(low), np.atleast_1d(high)
    new = basis.new_m3[high] - basis.new_m3[low]
    former = basis.on_basis_m3[high] - basis.on_basis_m3[low]
    U_new, U_former = new_U.deliveries(low, high), former_U.deliveries(low, high)
    d = new - former
    return Deliveries(
        low, high, d, former, U_new, U_former,
        normalized_error(d, U_new, U_former, c), critical_correlation(d, U_new, U_former),
    )  # fmt: skip


def find_worst_by_share(basis, minimum_m):
    """Rows (low, high) of the delivery of at least `minimum_m` with the largest |d| / V, or None.

    A delivery of at least twice the minimum consists of two shorter ones, one of which has at least
    the same |d| / V. So only shorter deliveries are examined. No delivery begins or ends in a zone
    that is not for use.
    """
    dips, use = basis.height_m, np.flatnonzero(basis.usable)
    dips, d = dips[use], (basis.new_m3 - basis.on_basis_m3)[use]
    volume = basis.on_basis_m3[use]
    if len(use) < 2:
        return None
    step = float(np.diff(dips).max())
    first = np.searchsorted(dips, dips + minimum_m - SAME_M)
    last = np.searchsorted(dips, dips + 2 * minimum_m + step + SAME_M)
    best, pair = -1.0, None
    for i in np.flatnonzero(first < len(dips)):
        j = slice(first[i], max(last[i], first[i] + 1))
        delivered = volume[j] - volume[i]
        share = np.abs(d[j] - d[i]) / np.where(delivered > 0, delivered, np.inf)
        place = int(np.argmax(share))
        if share[place] > best:
            best, pair = float(share[place]), (int(use[i]), int(use[first[i] + place]))
    return pair


def find_worst_by_error(basis, former_U, new_U, c, minimum_m, also=()):
    """Return the one-row Deliveries of minimum height with the largest |E_n|, or None.

    `also` lists further pairs of rows. The result is None if a U is unknown, or no delivery is high
    enough.
    """
    use = np.flatnonzero(basis.usable)
    dips = basis.height_m[use]
    first = np.searchsorted(dips, dips + minimum_m - SAME_M)
    starts = np.flatnonzero(first < len(dips))
    low, high = use[starts], use[first[starts]]
    for pair in also:
        low, high = np.append(low, pair[0]), np.append(high, pair[1])
    if not len(low) or former_U.deliveries_by is None or new_U.deliveries_by is None:
        return None
    deliveries = compare_deliveries(basis, former_U, new_U, c, low.astype(int), high.astype(int))
    place = int(np.argmax(np.abs(deliveries.E_n)))
    return compare_deliveries(
        basis, former_U, new_U, c, deliveries.low[place], deliveries.high[place]
    )
