"""What a rule file says of settlement, of the bottom's edge and of its bulges.

`[settlement]`, `[edge]` and `[bulge]` of tankcal/inspection/rules/api_653.toml: the keys of each,
and the limits that they make for a tank.
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
    """Limits of `[settlement]`; without a rule there are none, and the subset is 30 ft apart."""

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
        """InspectionLimit of a value; None of None."""
        if value is None:
            return None
        clause = self.clause if clause is None else clause
        return InspectionLimit(name, float(value), clause, self.verified)


@dataclass(frozen=True)
class EdgeLimits:
    """Limits of `[edge]`; `curves` has rows (diameter m, width m, parallel mm, across mm)."""

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
    """SettlementLimits of {key: value} of a rule's `[settlement]`; of None those of no rule.

    Examples
    --------
    >>> limits = settlement_limits({"curvature_factor": 11, "least_points": 8, "subset_arc_m": 9})
    >>> limits.curvature_factor, limits.de_beer
    (11, None)
    """
    given = _given(section)
    counts = {key: int(given[key]) for key in ("least_points", "highest_harmonic") if key in given}
    return SettlementLimits(**(given | counts))


def edge_limits(section):
    """EdgeLimits of {key: value} of a rule's `[edge]`; of None those of no rule."""
    return EdgeLimits(**_given(section))


def bulge_limits(section):
    """BulgeLimits of {key: value} of a rule's `[bulge]`; of None those of no rule."""
    return BulgeLimits(**_given(section))


def _given(section):
    return {key: one for key, one in (section or {}).items() if one is not None}


def largest_curvature(limits, strength):
    """Largest curvature of the shell's foot, c Y / (E H), 1/m; None where one is not given.

    In any one system of units it is |S| <= c L^2 Y / (2 E H) of points L apart.

    Parameters
    ----------
    limits : SettlementLimits
        For c.
    strength : Strength

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
    """What the limits of settlement need of a tank; what is not known is None.

    Attributes
    ----------
    diameter_m, height_m : float
        Of the shell.
    yield_pa, e_pa : float
        Yield stress and Young's modulus of its steel.
    """

    diameter_m: float | None
    height_m: float | None = None
    yield_pa: float | None = None
    e_pa: float | None = None


def largest_drop_mm(limits, width_m, diameter_m, weld_deg=None):
    """Largest drop of the bottom's edge, mm, or None: the rule has none for this width.

    Curves are interpolated between their widths and diameters, never beyond. Beside a lap weld at
    an angle a to the radial line it is B_across - (B_across - B_parallel) sin a.

    Parameters
    ----------
    limits : EdgeLimits
    width_m, diameter_m : float
        Of the settled edge; of the tank.
    weld_deg : float, optional
        Between lap weld and radial line, degrees; None: parallel to the shell, the stricter.

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
    above = np.searchsorted(diameters, diameter_m)
    pair = diameters[[max(above - 1, 0), above]]
    of_pair = [_of_curve(rows[rows[:, 0] == one], width_m) for one in pair]
    if None in (of_pair[0], of_pair[1]):
        return None
    share = 0.0 if pair[0] == pair[1] else (diameter_m - pair[0]) / (pair[1] - pair[0])
    parallel, across = (1 - share) * np.array(of_pair[0]) + share * np.array(of_pair[1])
    angle = np.pi / 2 if weld_deg is None else np.radians(weld_deg)
    return float(across - (across - parallel) * np.sin(angle))


def _of_curve(rows, width_m):
    """(parallel, across) of the curve of one diameter, or None outside of its widths."""
    rows = rows[np.argsort(rows[:, 1])]
    if not rows[0, 1] <= width_m <= rows[-1, 1]:
        return None
    return tuple(np.interp(width_m, rows[:, 1], rows[:, column]) for column in (2, 3))
