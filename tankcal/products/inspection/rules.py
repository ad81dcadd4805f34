"""Rules of an inspection: shipped rule files, rule files of the user, and the limits they contain.

A rule is a TOML file (docs/inspection.md). [rule] describes the rule, and every other section
contains the limits of one kind of check. Each of these sections is optional. A check without a
limit yields a value without a verdict.

Figure of an inspection, and the decision on it by `tankcal.gum.conformity`.

The limit of the magnitude of a value and the guard band U determine the verdict. Without U no
figure passes or fails. If the value estimates the largest of many true values, the largest reading
plus its U must also be within the limit.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.gum.conformity import RuleSet, probability_of, verdict_of
from tankcal.job.fields import Field, number, positive
from tankcal.job.rule_files import HEAD, SOURCE, RuleFiles
from tankcal.record.inspection import InspectionCheck, InspectionLimit

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
PROBABILITY = 0.95  # coverage probability of U


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
    given = _values_of_section(section)
    counts = {key: int(given[key]) for key in ("least_points", "highest_harmonic") if key in given}
    return SettlementLimits(**(given | counts))


def edge_limits(section):
    """`EdgeLimits` of the section `[edge]`, {key: value}, or of no rule for None."""
    return EdgeLimits(**_values_of_section(section))


def bulge_limits(section):
    """`BulgeLimits` of the section `[bulge]`, {key: value}, or of no rule for None."""
    return BulgeLimits(**_values_of_section(section))


def _values_of_section(section):
    """Keys of a section that have a value."""
    return {key: value for key, value in (section or {}).items() if value is not None}


def compute_curvature_limit(limits, strength):
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
    >>> round(compute_curvature_limit(limits, Strength(21.3, 11.9, yield_pa=160e6, e_pa=206e9)), 8)
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


DEFAULT = "api_653"  # rule of an inspection that names no rule
_OF_HEIGHT = positive("part_of_height", "limit as a part of the height", 1, required=True)
_MOST = positive("most_mm", "largest size, mm", 1e4, required=True)
SECTIONS = {
    "plumbness": (_OF_HEIGHT, positive("most_mm", "and at most, mm", 1e4), *SOURCE),
    "plumbness_course": (_OF_HEIGHT, *SOURCE),
    "roundness": (
        Field("by_diameter", "rows", "diameter in m below which a limit in mm holds", width=2,
              low=0, above_low=True),
        positive("above_mm", "limit of larger diameters, mm", 1e4, required=True),
        positive("times_higher", "factor of the limit higher up; blank: no limit there", 100),
        *SOURCE,
    ),
    "peaking": (_MOST, *SOURCE),
    "banding": (_MOST, *SOURCE),
    "settlement": SETTLEMENT,
    "edge": EDGE,
    "bulge": BULGE,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Rule(RuleSet):
    """Limits of an inspection, as read from a rule file.

    Attributes
    ----------
    file : str
        Name of the rule file.
    sections : dict
        Limits, {section: {key: value or None}}. Each section has a value of `verified`.
    name, source, verified, remark
        As for a RuleSet.
    """

    file: str
    sections: dict


def _make_rule(head, limits, file):
    """`Rule` of the sections of a file."""
    return Rule(
        name=head["name"],
        source=head["source"],
        verified=all(values["verified"] for _, _, values in limits),
        remark=head["remark"],
        file=file,
        sections={section: values for section, _, values in limits},
    )


_FILES = RuleFiles("products/inspection/rules", HEAD, SECTIONS, _make_rule, "roundness")
parse_rule, shipped_names, shipped_rule = _FILES.parse, _FILES.names, _FILES.rule


def find_rule(name, log):
    """Read a shipped `Rule` by its name, or a rule file by its path.

    The name is such as "api_653" or "rules/house.toml". If the rule is missing or invalid, `log`
    receives the problems, and None is returned.
    """
    rules = _FILES.named(name, log)
    return None if rules is None else rules[0]


def limit_of(rule, code, *, diameter_m=None, height_m=None):
    """Compute the `InspectionLimit` of a check of the wall.

    Parameters
    ----------
    rule : Rule or None
        Rule with the limits; None for no limits.
    code : str
        "plumbness_axis", "plumbness_generatrix", "plumbness_course", "roundness_low",
        "roundness_high", "peaking" or "banding".
    diameter_m : float, optional
        Nominal diameter of the tank, m; required for the roundness.
    height_m : float, optional
        Height of the shell or of a course, m; required for the plumbness.

    Returns
    -------
    InspectionLimit or None
        None if the rule has no limit of the check, or if a required size is not given.

    Examples
    --------
    >>> rule = shipped_rule("api_653")
    >>> [limit_of(rule, "plumbness_axis", height_m=height).value for height in (9.5, 14.0)]
    [95.0, 127.0]
    >>> [limit_of(rule, "roundness_low", diameter_m=size).value for size in (11, 12, 80)]
    [13.0, 19.0, 32.0]
    """
    section = _SECTIONS_BY_CODE.get(code, code)
    limits = None if rule is None else rule.sections.get(section)
    if limits is None:
        return None
    if section == "roundness":
        value = _diameter_limit_mm(limits, code, diameter_m)
    elif section in ("plumbness", "plumbness_course"):
        value = _height_limit_mm(limits, height_m)
    else:
        value = limits["most_mm"]  # a gap at a weld is limited whatever the size of the tank
    if value is None:
        return None
    return InspectionLimit(code, float(value), limits["clause"], limits["verified"])


# Section of a rule for each check whose code is not the name of its section.
_SECTIONS_BY_CODE = {
    "plumbness_axis": "plumbness",
    "plumbness_generatrix": "plumbness",
    "roundness_low": "roundness",
    "roundness_high": "roundness",
}


def _height_limit_mm(limits, height_m):
    """Limit in mm, a share of the height up to `most_mm`; None without a height."""
    if height_m is None:
        return None
    most = limits.get("most_mm")
    value = 1000 * limits["part_of_height"] * height_m
    return value if most is None else min(value, most)


def _diameter_limit_mm(limits, code, diameter_m):
    """Limit in mm by steps of the diameter; None without a diameter or a limit higher up."""
    factor = 1.0 if code == "roundness_low" else limits["times_higher"]
    if diameter_m is None or factor is None:
        return None
    steps = sorted(limits["by_diameter"] or ())
    return factor * next((most for below, most in steps if diameter_m < below), limits["above_mm"])


# ---- figure of an inspection, and the decision on it by `tankcal.gum.conformity`


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A measured value with at most one limit, in the terms of `InspectionCheck`.

    Attributes
    ----------
    code : str
        One of tankcal.record.inspection.CHECKS.
    unit : str
        "mm", "1/m" or "" (a ratio).
    value : float or None
        Value with its sign; None if not determined.
    U : float or None
        Expanded uncertainty for PROBABILITY; None if no standard deviation is known.
    k : float or None
        Coverage factor of U.
    dof : float
        Degrees of freedom of U; may be inf.
    limit : InspectionLimit or None
        None if the rule has no limit, or if the limit requires data that are not given.
    at_least : bool
        Whether the limit is a lower limit of the value; if not, an upper limit of its magnitude.
    course, height_m, azimuth_deg, epoch : optional
        Place of the value, and its epoch or difference of two epochs.
    used : int
        Number of places that the largest value was selected from.
    reading, U_reading : float or None
        Largest single reading and its expanded uncertainty if the value estimates the largest true
        value; None if the value is a reading.
    remark, remark_values
        Code of a remark on the value, and the numbers of the remark.
    """

    code: str
    unit: str
    value: float | None
    U: float | None
    k: float | None
    dof: float
    limit: InspectionLimit | None
    at_least: bool = False
    course: int | None = None
    height_m: float | None = None
    azimuth_deg: float | None = None
    epoch: str | None = None
    used: int = 0
    reading: float | None = None
    U_reading: float | None = None
    remark: str | None = None
    remark_values: dict = field(default_factory=dict)


def make_check(figure):
    """`InspectionCheck` of a `Figure`, with its verdict and probability of conformity."""
    limit = None if figure.limit is None else figure.limit.value
    u = figure.U / figure.k if figure.U is not None and figure.k else None
    return InspectionCheck(
        code=figure.code,
        unit=figure.unit,
        value=figure.value,
        U=figure.U,
        k=figure.k,
        course=figure.course,
        height_m=figure.height_m,
        azimuth_deg=figure.azimuth_deg,
        epoch=figure.epoch,
        used=figure.used,
        limit=figure.limit,
        probability=probability_of(figure.value, u, limit, figure.dof, at_least=figure.at_least),
        verdict=verdict_of(
            figure.value,
            figure.U,
            limit,
            at_least=figure.at_least,
            reading=figure.reading,
            U_reading=figure.U_reading,
        ),
        reading=figure.reading,
        U_reading=figure.U_reading,
        remark=figure.remark,
        remark_values=figure.remark_values,
    )
