"""What the difference of two tables is made of: the zero of the dips, and areas of the courses.

On one basis the difference of an upright tank is, above the highest point of the bottom,

    D(h) = h0 A(h) + sum over courses of dA_c o_c(h),     o_c the wet height of course c

A bottom that has changed adds the same to all of these rows, as h0 A does: the two cannot be told
apart by volumes. Tanks that are one solid have their sizes in place of the courses: a lying
cylinder V = L D^2 f(h / D) has dV/dL = V / L and dV/dD = (2 V - h A) / D, a sphere
V = D^3 f(h / D) has dV/dD = (3 V - h A) / D.
"""

from dataclasses import dataclass

import numpy as np

LEAST_WINDOW_M = 0.05  # that slopes are taken over
LEVEL_PARTS = 200  # digits that a volume rises by within that window
ONE_CUT = 0.98  # of the usual area: what is below is bottom
SPARE_ROWS = 4
FINEST = 1e-12  # of the top volume: numbers of a record


@dataclass(frozen=True)
class Difference:
    """A difference of two tables, adjusted.

    Attributes
    ----------
    zero_m, u_zero_m : float
        Height of the new zero above the former one that is left in it; u by scatter and rounding.
    areas_m2, u_areas_m2 : (courses,) ndarray
        New less former, of an upright tank whose courses are known; nan: no row reaches it.
    lowest_m : float
        Dip of the lowest row that was taken.
    left_m3 : float
        Root mean square of what is left.
    """

    zero_m: float
    u_zero_m: float
    areas_m2: np.ndarray
    u_areas_m2: np.ndarray
    lowest_m: float
    left_m3: float


def adjust_difference(facts, dips_m, difference_m3, volume_m3, sd_m3, usable):
    """The Difference in rows of two tables, or None where too few rows determine it.

    Parameters
    ----------
    facts : TankFacts
    dips_m, difference_m3, volume_m3 : (rows,) ndarray
        Of the new table.
    sd_m3 : float
        Of a difference, by rounding.
    usable : (rows,) ndarray of bool
        Rows outside of critical zones.
    """
    area = slopes_m2(dips_m, volume_m3, sd_m3)
    columns = _columns(facts, dips_m, volume_m3, area)
    taken = usable & _above_bottom(facts, dips_m, area)
    reached = (np.abs(columns[taken]) > 1e-9).any(axis=0)
    columns = columns[:, reached]
    if taken.sum() < columns.shape[1] + SPARE_ROWS:
        return None
    sd = max(sd_m3, FINEST * float(volume_m3[-1]))
    size = np.abs(columns[taken]).max(axis=0)
    design, value = columns[taken] / size, difference_m3[taken]
    normal = design.T @ design
    if np.linalg.cond(normal) > 1e12:
        return None
    inverse = np.linalg.inv(normal)
    found = inverse @ (design.T @ value)
    left = value - design @ found
    dof = len(value) - len(found)
    variance = max(sd**2, float(left @ left) / dof)
    u = np.sqrt(variance * np.diag(inverse)) / size
    areas = np.full((2, len(reached) - 1), np.nan)
    areas[:, reached[1:]] = found[1:] / size[1:], u[1:]
    return Difference(
        zero_m=float(found[0] / size[0]),
        u_zero_m=float(u[0]),
        areas_m2=areas[0],
        u_areas_m2=areas[1],
        lowest_m=float(dips_m[taken][0]),
        left_m3=float(np.sqrt(np.mean(left**2))),
    )


def _columns(facts, dips, volume, area):
    """(rows, 1 + parts): what a zero adds, and what sizes of the tank add."""
    if facts.is_shell:
        edges = facts.edges_m()
        wet = np.clip(dips[:, None], edges[:-1], edges[1:]) - edges[:-1]
        wet[:, -1] = np.maximum(dips - edges[-2], 0.0)
        return np.column_stack([area, wet])
    if facts.kind == "horizontal":
        return np.column_stack([area, volume, dips * area])
    if facts.kind == "sphere":
        return np.column_stack([area, 3 * volume - dips * area])
    return np.column_stack([area, volume])


def slopes_m2(dips_m, volume_m3, sd_m3=0.0):
    """(rows,) areas of the cut, over windows in which a volume rises by many digits.

    A window is as long below a row as above it: shorter near the ends, there of one step.
    """
    usual = (volume_m3[-1] - volume_m3[0]) / (dips_m[-1] - dips_m[0])
    half = max(LEAST_WINDOW_M, LEVEL_PARTS * sd_m3 / max(usual, 1e-9)) / 2
    half = min(max(half, float(np.median(np.diff(dips_m)))), (dips_m[-1] - dips_m[0]) / 4)
    room = np.minimum(dips_m - dips_m[0], dips_m[-1] - dips_m)
    half = np.minimum(half, np.maximum(room, float(np.diff(dips_m).min())))
    low = np.maximum(dips_m - half, dips_m[0])
    high = np.minimum(dips_m + half, dips_m[-1])
    rise = np.interp(high, dips_m, volume_m3) - np.interp(low, dips_m, volume_m3)
    return rise / (high - low)


def _above_bottom(facts, dips, area):
    """(rows,) whether the cut at a row of an upright tank is that of its wall."""
    if facts.kind != "vertical":
        return np.full(len(dips), True)
    is_lower = np.arange(len(dips)) < len(dips) // 2
    bottom = np.flatnonzero(is_lower & (area < ONE_CUT * np.median(area)))
    first = bottom[-1] + 1 if len(bottom) else 0
    return np.arange(len(dips)) >= first
