"""Components of the difference of two tables: zero of the dips, areas and radii of the courses.

On one basis the difference of an upright tank is, above the highest point of the bottom,

    D(h) = h0 A(h) + sum over courses of dA_c o_c(h),     o_c the wet height of course c

A changed bottom adds a constant to these rows, as h0 A does. Volumes cannot separate the two. Tanks
that are one solid have dimensions instead of courses: a lying cylinder V = L D^2 f(h / D) has
dV/dL = V / L and dV/dD = (2 V - h A) / D, a sphere V = D^3 f(h / D) has dV/dD = (3 V - h A) / D.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.recalibration.upright_shell import Rings, estimate_radii
from tankcal.record.comparison import ComparedCourse

LEAST_WINDOW_M = 0.05  # shortest window of a slope
LEVEL_PARTS = 200  # smallest rise of the volume within a window, in last digits
ONE_CUT = 0.98  # share of the usual area; smaller areas belong to the bottom
SPARE_ROWS = 4
FINEST = 1e-12  # relative resolution of volumes in a record


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
    rows = usable & _above_bottom(facts, dips_m, area)
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


def _above_bottom(facts, dips, area):
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
