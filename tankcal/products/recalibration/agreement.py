"""Agreement of two tables, and the components of their difference.

The normalised errors of rows and deliveries depend on the correlation of the tables,

    E_n = d / sqrt(U_new^2 + U_old^2 - 2 c U_new U_old)

c is the correlation of the errors of the two tables. |E_n| = 1 at
c = (U_new^2 + U_old^2 - d^2) / (2 U_new U_old).
Source: ISO/IEC 17043:2010, B.3 (E_n, c = 0); with correlation JCGM 100:2008, 5.2.

Components of the difference
----------------------------

On one basis the difference of an upright tank is, above the highest point of the bottom,

    D(h) = h0 A(h) + sum over courses of dA_c o_c(h),     o_c the wet height of course c

A changed bottom adds a constant to these rows, as h0 A does. Volumes cannot separate the two. Tanks
that are one solid have dimensions instead of courses: a lying cylinder V = L D^2 f(h / D) has
dV/dL = V / L and dV/dD = (2 V - h A) / D, a sphere V = D^3 f(h / D) has dV/dD = (3 V - h A) / D.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from tankcal.products.recalibration.upright_shell import Rings, estimate_radii
from tankcal.record.recalibration import ComparedCourse

PROPORTIONAL = 0.01  # largest spread of U over V of a U stated in percent
SAME_M = 1e-9  # largest difference of equal dips
LEAST_WINDOW_M = 0.05  # shortest window of a slope
LEVEL_PARTS = 200  # smallest rise of the volume within a window, in last digits
ONE_CUT = 0.98  # share of the usual area; smaller areas belong to the bottom
SPARE_ROWS = 4
FINEST = 1e-12  # relative resolution of volumes in a record


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


@dataclass(frozen=True)
class Difference:
    """Adjusted difference of two tables.

    Attributes
    ----------
    zero_m, u_zero_m : float
        Remaining height of the new zero above the former one; u by scatter and rounding.
    areas_m2, u_areas_m2 : (courses,) ndarray
        New minus former areas of an upright tank with known courses; nan if no row reaches the
        course.
    """

    zero_m: float
    u_zero_m: float
    areas_m2: np.ndarray
    u_areas_m2: np.ndarray


def adjust_difference(facts, dips_m, difference_m3, volume_m3, sd_m3, usable):
    """Return the Difference of the rows of two tables, or None if too few rows determine it.

    Parameters
    ----------
    facts : TankFacts
    dips_m, difference_m3, volume_m3 : (rows,) ndarray
        Dips, differences and volumes at rows of the new table.
    sd_m3 : float
        Standard deviation of a difference, by rounding.
    usable : (rows,) ndarray of bool
        Rows outside of critical zones.
    """
    area = slopes_m2(dips_m, volume_m3, sd_m3)
    columns = _derivatives(facts, dips_m, volume_m3, area)
    rows = usable & _is_above_bottom(facts, dips_m, area)
    reached = (np.abs(columns[rows]) > 1e-9).any(axis=0)
    columns = columns[:, reached]
    if rows.sum() < columns.shape[1] + SPARE_ROWS:
        return None
    sd = max(sd_m3, FINEST * float(volume_m3[-1]))
    # Columns are scaled to 1, as areas and heights differ in magnitude.
    size = np.abs(columns[rows]).max(axis=0)
    design, value = columns[rows] / size, difference_m3[rows]
    normal = design.T @ design
    if np.linalg.cond(normal) > 1e12:
        return None
    inverse = np.linalg.inv(normal)
    solution = inverse @ (design.T @ value)
    left = value - design @ solution
    dof = len(value) - len(solution)
    # Residuals may exceed rounding, but u is never smaller than rounding requires.
    variance = max(sd**2, float(left @ left) / dof)
    u = np.sqrt(variance * np.diag(inverse)) / size
    areas = np.full((2, len(reached) - 1), np.nan)
    areas[:, reached[1:]] = solution[1:] / size[1:], u[1:]
    return Difference(
        zero_m=float(solution[0] / size[0]),
        u_zero_m=float(u[0]),
        areas_m2=areas[0],
        u_areas_m2=areas[1],
    )


def _derivatives(facts, dips, volume, area):
    """Derivatives (rows, 1 + parts) of the difference by the zero and by the tank dimensions."""
    if facts.is_shell:
        edges = facts.edges_m()
        wet = np.clip(dips[:, None], edges[:-1], edges[1:]) - edges[:-1]
        wet[:, -1] = np.maximum(dips - edges[-2], 0.0)  # the last course has no upper end
        return np.column_stack([area, wet])
    if facts.kind == "horizontal":
        return np.column_stack([area, volume, dips * area])
    if facts.kind == "sphere":
        return np.column_stack([area, 3 * volume - dips * area])
    return np.column_stack([area, volume])


def slopes_m2(dips_m, volume_m3, sd_m3=0.0):
    """Areas (rows,) of the cross section, m2, over windows with a rise of many last digits.

    A window has equal lengths below and above its row. Near the ends it is shorter; at the ends it
    is one step.

    Parameters
    ----------
    dips_m, volume_m3 : (rows,) ndarray
    sd_m3 : float, optional
        Standard deviation of a volume by rounding, which determines the length of the windows.
    """
    usual = (volume_m3[-1] - volume_m3[0]) / (dips_m[-1] - dips_m[0])
    half = max(LEAST_WINDOW_M, LEVEL_PARTS * sd_m3 / max(usual, 1e-9)) / 2
    # at least one step, at most a quarter of the range on each side
    half = min(max(half, float(np.median(np.diff(dips_m)))), (dips_m[-1] - dips_m[0]) / 4)
    room = np.minimum(dips_m - dips_m[0], dips_m[-1] - dips_m)
    half = np.minimum(half, np.maximum(room, float(np.diff(dips_m).min())))
    low = np.maximum(dips_m - half, dips_m[0])
    high = np.minimum(dips_m + half, dips_m[-1])
    rise = np.interp(high, dips_m, volume_m3) - np.interp(low, dips_m, volume_m3)
    return rise / (high - low)


def _is_above_bottom(facts, dips, area):
    """Whether the area at each row (rows,) of an upright tank is that of its wall."""
    if facts.kind != "vertical":
        return np.full(len(dips), True)
    is_lower = np.arange(len(dips)) < len(dips) // 2
    bottom = np.flatnonzero(is_lower & (area < ONE_CUT * np.median(area)))
    first = bottom[-1] + 1 if len(bottom) else 0
    return np.arange(len(dips)) >= first


# ---- radii of the courses


def compare_courses(facts, basis, former_U, new_U, c, sd_m3):
    """Return the `ComparedCourse` of each course within the rows; none if the courses are unknown.

    Parameters
    ----------
    facts : TankFacts
    basis : OneBasis
    former_U, new_U : TableUncertainty
    c : float
        Correlation of the errors of both tables.
    sd_m3 : float
        Standard deviation of a difference of rows, by rounding.
    """
    if not facts.is_shell:
        return []
    difference = basis.new_m3 - basis.on_basis_m3
    adjusted = adjust_difference(
        facts, basis.height_m, difference, basis.new_m3, sd_m3, basis.usable
    )
    if adjusted is None:
        return []
    new, edges = _radii(facts, basis), facts.edges_m()
    changes = adjusted.areas_m2 / (2 * np.pi * new)
    rounding = adjusted.u_areas_m2 / (2 * np.pi * new)
    courses = []
    for k in np.flatnonzero(np.isfinite(changes)):
        parts = _u_of_tables(basis, (former_U, new_U), edges[k : k + 2], new[k])
        u = None if None in parts else float(np.hypot(_u_of_change(*parts, c), rounding[k]))
        courses.append(
            ComparedCourse(
                course=int(k) + 1,
                bottom_m=float(edges[k]),
                top_m=float(edges[k + 1]),
                former_m=float(new[k] - changes[k]),
                new_m=float(new[k]),
                d_m=float(changes[k]),
                u_m=u,
                u_rounding_m=float(rounding[k]),
                w=float(changes[k] / u) if u else None,
                u_former_m=parts[0],
                u_new_m=parts[1],
            )
        )
    return courses


def _radii(facts, basis):
    """Radii (courses,) in the new table: from its record, else from the rise of its rows."""
    if facts.inside_m is not None:
        return facts.inside_m
    rings = Rings(facts.edges_m(), facts.thickness_m, facts.modulus_pa, is_first_order=False)
    density = basis.densities[1].kg_m3 or 0.0
    zone, afloat = None, np.flatnonzero(~basis.usable)
    if len(afloat):
        first, last = max(afloat[0] - 1, 0), min(afloat[-1] + 1, len(basis.height_m) - 1)
        zone = basis.height_m[first], basis.height_m[last]
    return estimate_radii(rings, basis.height_m, basis.new_m3, density, zone)


def _u_of_tables(basis, tables, ends, radius):
    """Standard uncertainty of a radius from the volume of its course in each table.

    None if unknown.

    u(r) = r u(V) / (2 V), V between the lowest and the highest row within the course.
    """
    dips = basis.height_m
    inside = np.flatnonzero((dips >= ends[0] - 1e-9) & (dips <= ends[1] + 1e-9) & basis.usable)
    if len(inside) < 2:
        return [None for _ in tables]
    low, high = inside[:1], inside[-1:]
    volume = basis.new_m3[high[0]] - basis.new_m3[low[0]]
    uncertainties = [
        radius / 2 * float(table.deliveries(low, high)[0]) / table.k / volume for table in tables
    ]
    return [None if np.isnan(u) else u for u in uncertainties]


def _u_of_change(former, new, c):
    """Standard uncertainty of the difference of two radii with correlation c."""
    return float(np.sqrt(max(former**2 + new**2 - 2 * c * former * new, 0.0)))
