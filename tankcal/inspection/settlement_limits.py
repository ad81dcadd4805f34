"""Limits of a rule file for settlement, the edge of the bottom and bulges of the bottom.

The module contains the keys of the sections `[settlement]`, `[edge]` and `[bulge]` of a rule file
such as tankcal/inspection/rules/api_653.toml, and computes the limits for a tank.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.job.contract.shorthand import number, positive
from tankcal.job.fields import Field
from tankcal.record.inspection import InspectionLimit

SOURCE = (
    Field("clause", "text", "where it stands in the text"),
    Field("verified", "flag", "whether it was read in the text itself"),
)
SETTLEMENT = (
    positive("curvature_factor", "c of the largest curvature c Y / (E H)", 1e3, required=True),
    number("least_r2", "least share of the scatter that the plane explains", 0, 1),
    positive("de_beer", "n of the largest out-of-plane settlement L / n", 1e5),
    Field("de_beer_clause", "text", "where that stands"),
    number("least_points", "fewest points round the tank", 8, 1000, required=True),
    positive("diameter_per_point_m", "diameter that asks for one point, metres", 100),
    positive("largest_arc_m", "largest distance of two neighbours along the shell, metres", 1e3),
    positive("subset_arc_m", "distance of neighbours in the subset, metres", 1e3, required=True),
    number("highest_harmonic", "of the curvature; blank: a quarter of the points", 2, 1000),
    *SOURCE,
)
EDGE = (
    positive("drop_per_width_mm_m", "largest drop of the edge, mm per metre of its width", 1e3),
    Field(
        "curves",
        "rows",
        "diameter in metres, width in metres, largest drop in mm beside lap welds parallel to the"
        " shell, and beside those across it",
        width=4,
    ),
    *SOURCE,
)
BULGE = (
    positive("height_per_radius_mm_m", "largest height, mm per metre of the radius", 1e3),
    *SOURCE,
)


@dataclass(frozen=True)
class SettlementLimits:
    """Limits of `[settlement]`. The defaults, without a rule, are no limits and 30 ft spacing."""

    curvature_factor: float | None = None
    least_points: int = 8
    subset_arc_m: float = 9.144
    least_r2: float | None = None
    de_beer: float | None = None
    de_beer_clause: str = ""
    diameter_per_point_m: float | None = None
    largest_arc_m: float | None = None
    highest_harmonic: int | None = None
    clause: str = ""
    verified: bool = False

    def limit(self, name, value, clause=None):
        """`InspectionLimit` of a value, or None for None; by default with the section's clause."""
        if value is None:
            return None
        clause = self.clause if clause is None else clause
        return InspectionLimit(name, float(value), clause, self.verified)


@dataclass(frozen=True)
class EdgeLimits:
    """Limits of `[edge]`.

    The rows of `curves` have diameter, m, width, m, and the largest drops, mm, beside lap welds
    parallel to the shell and across it.
    """

    drop_per_width_mm_m: float | None = None
    curves: tuple = ()
    clause: str = ""
    verified: bool = False


@dataclass(frozen=True)
class BulgeLimits:
    """Limits of `[bulge]`."""

    height_per_radius_mm_m: float | None = None
    clause: str = ""
    verified: bool = False


def settlement_limits(section):
    """`SettlementLimits` of the section `[settlement]`, {key: value}, or of no rule for None.

    Examples
    --------
    >>> limits = settlement_limits({"curvature_factor": 11, "least_points": 8, "subset_arc_m": 9})
    >>> limits.curvature_factor, limits.de_beer
    (11, None)
    """
    given = _given_values(section)
    counts = {key: int(given[key]) for key in ("least_points", "highest_harmonic") if key in given}
    return SettlementLimits(**(given | counts))


def edge_limits(section):
    """`EdgeLimits` of the section `[edge]`, {key: value}, or of no rule for None."""
    return EdgeLimits(**_given_values(section))


def bulge_limits(section):
    """`BulgeLimits` of the section `[bulge]`, {key: value}, or of no rule for None."""
    return BulgeLimits(**_given_values(section))


def _given_values(section):
    """Keys of a section that have a value."""
    return {key: value for key, value in (section or {}).items() if value is not None}


def largest_curvature(limits, strength):
    """Limit of the curvature of the shell's foot, c Y / (E H), 1/m.

    For points at a distance L, it is equivalent to |S| <= c L^2 Y / (2 E H) in consistent units.

    Parameters
    ----------
    limits : SettlementLimits
        Limits with the factor c.
    strength : Strength
        Yield stress Y, Young's modulus E and height H.

    Returns
    -------
    float or None
        None if c, Y, E or H is not given.

    Examples
    --------
    >>> limits = settlement_limits({"curvature_factor": 11, "least_points": 8, "subset_arc_m": 9})
    >>> round(largest_curvature(limits, Strength(21.3, 11.9, yield_pa=160e6, e_pa=206e9)), 8)
    0.00071796
    """
    if None in (limits.curvature_factor, strength.height_m, strength.yield_pa, strength.e_pa):
        return None
    return limits.curvature_factor * strength.yield_pa / (strength.e_pa * strength.height_m)


@dataclass(frozen=True)
class Strength:
    """Sizes and steel of a tank for the limits of settlement; None for an unknown value.

    Attributes
    ----------
    diameter_m, height_m : float
        Diameter and height of the shell, m.
    yield_pa, e_pa : float
        Yield stress and Young's modulus of the shell's steel, Pa.
    """

    diameter_m: float | None
    height_m: float | None = None
    yield_pa: float | None = None
    e_pa: float | None = None


def largest_drop_mm(limits, width_m, diameter_m, weld_deg=None):
    """Limit of the drop of the bottom's edge.

    Curves are interpolated between their widths and diameters, without extrapolation. Beside a lap
    weld at an angle a to the radial line, the limit is B_across - (B_across - B_parallel) sin a.

    Parameters
    ----------
    limits : EdgeLimits
        Curves, or the drop per width.
    width_m, diameter_m : float
        Width of the settled edge, and diameter of the tank, m.
    weld_deg : float, optional
        Angle between lap weld and radial line, degrees. By default the weld is parallel to the
        shell, which gives the stricter limit.

    Returns
    -------
    float or None
        Limit, mm; None if the rule has no limit for this width and diameter.

    Examples
    --------
    >>> curves = ((30, 0.5, 40, 60), (30, 1.5, 80, 100), (40, 0.5, 50, 70), (40, 1.5, 90, 110))
    >>> largest_drop_mm(EdgeLimits(curves=curves), 1.0, 35.0)
    65.0
    >>> round(largest_drop_mm(EdgeLimits(curves=curves), 1.0, 35.0, weld_deg=30.0), 1)
    75.0
    """
    if not limits.curves:
        slope = limits.drop_per_width_mm_m
        return None if slope is None else slope * width_m
    rows = np.array(limits.curves, dtype=float)
    diameters = np.unique(rows[:, 0])
    if not diameters[0] <= diameter_m <= diameters[-1]:
        return None
    # Interpolate in the width on both neighbouring diameters, then between these diameters.
    above = np.searchsorted(diameters, diameter_m)
    pair = diameters[[max(above - 1, 0), above]]
    drops = [
        _drops_of_curve(rows[rows[:, 0] == curve_diameter], width_m) for curve_diameter in pair
    ]
    if None in (drops[0], drops[1]):
        return None
    share = 0.0 if pair[0] == pair[1] else (diameter_m - pair[0]) / (pair[1] - pair[0])
    parallel, across = (1 - share) * np.array(drops[0]) + share * np.array(drops[1])
    angle = np.pi / 2 if weld_deg is None else np.radians(weld_deg)
    return float(across - (across - parallel) * np.sin(angle))


def _drops_of_curve(rows, width_m):
    """Drops beside parallel and across welds for one diameter, mm, or None outside its widths."""
    rows = rows[np.argsort(rows[:, 1])]
    if not rows[0, 1] <= width_m <= rows[-1, 1]:
        return None
    return tuple(np.interp(width_m, rows[:, 1], rows[:, column]) for column in (2, 3))
