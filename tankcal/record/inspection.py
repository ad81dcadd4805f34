"""Inspection of a tank: inspection.json.

Each value has an expanded uncertainty, each limit a source. Checks, verdicts and remarks are codes
with numbers; the templates supply the sentences.
"""

from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, WarningRecord, key
from tankcal.version import find_version


def _migrate_1(saved):
    """Convert version 1 to 2; values of version 1 are readings, and fail beyond the limit."""
    checks = [check | {"reading": None, "U_reading": None} for check in saved["checks"]]
    return saved | {"format": "tankcal-inspection/2", "decision": "simple_beyond", "checks": checks}


INSPECTION = SavedFormat("tankcal-inspection", 2, "inspection.json", {1: _migrate_1})
DECISIONS = ("guarded", "simple_beyond")

CHECKS = (  # in the order of the report
    "plumbness_axis", "plumbness_generatrix", "plumbness_course", "roundness_low",
    "roundness_high", "peaking", "banding", "settlement_cosine", "settlement_all",
    "settlement_subset", "settlement_curvature", "settlement_de_beer", "edge_settlement",
    "bottom_bulge",
)  # fmt: skip
VERDICTS = (  # the gravest first
    "failed", "guard_band_beyond", "guard_band", "not_determined", "passed",
)  # fmt: skip
_VERDICT_KEY = ", ".join(f'"{verdict}"' for verdict in VERDICTS)


class InspectedTank(Saved):
    """The inspected tank."""

    id: str = key("of the tank")
    name: str = key("of the job")
    source: str = key('"job" or "record"')
    file: str = key("name of the job or of the record")
    sha256: str | None = key("of the record; null: a job")
    survey_date: str | None = key("null: not known")
    survey_side: str | None = key('"inside" or "outside"; null: no wall was surveyed')
    methods: list[str] = key(
        "of the survey of the wall: points, straps, lines, hits, tangents, scan"
    )
    nominal_diameter_m: float | None = key("null: not given")
    nominal_source: str = key('"drawing": as given; "mean": of the surveyed wall; "none"')
    height_m: float | None = key("of the shell; null: not known")
    state: str = key('"as_found": loaded as it was surveyed; "unloaded": head taken off')


class InspectionRule(Saved):
    """Rule of the inspection."""

    name: str = key("of the rule")
    file: str = key("name of its file")
    source: str = key("of its values")
    verified: bool = key("whether every value was read in the text itself")
    remark: str = key("to be printed with the rule")


class InspectionLimit(Saved):
    """A limit of the rule, for this tank."""

    name: str = key("of the limit in its rule file")
    value: Finite = key("in the unit of the check")
    clause: str = key("of the rule")
    verified: bool = key("whether it was read in the clause")


class InspectionCheck(Saved):
    """A value compared with a limit."""

    code: str = key("such as plumbness_generatrix, see docs/inspection.md")
    unit: str = key('"mm", "mm/m", "1/m" or "" (a ratio)')
    value: float | None = key("the largest, with its sign; null: not determined")
    reading: float | None = key(
        "largest single reading, if the value is an estimate without the bias of the largest of "
        "many; null: the value is a reading"
    )
    U_reading: float | None = key("expanded, of `reading`; null: no such reading, or not known")
    U: float | None = key("expanded; null: not known")
    k: float | None = key("coverage factor of U")
    course: int | None = key("from the bottom, 1 first; null: of no single course")
    height_m: float | None = key("above the bottom of the shell; null: of no single height")
    azimuth_deg: float | None = key("null: of no single azimuth")
    epoch: str | None = key("of a settlement; null: of the survey")
    used: int = key("number of places from which the largest was taken")
    limit: InspectionLimit | None = key("null: the rule has none")
    probability: float | None = key("of conformity; null: no limit, or not determined")
    verdict: str = key(f"one of: {_VERDICT_KEY}")
    remark: str | None = key("code of the remark; null: none")
    remark_values: dict = key("numbers and texts of the remark")


class Generatrices(Saved):
    """Deviations of the wall from the vertical, along generatrices; outwards positive."""

    azimuth_deg: list[Finite] = key("of each generatrix")
    height_m: list[Finite] = key("above the bottom of the shell")
    course: list[int] = key("of each height")
    departure_mm: list[list[Finite]] = key("heights x azimuths, from the lowest height")
    U_mm: list[list[Finite]] = key("expanded, of each")


class InspectedLevel(Saved):
    """A section of the wall."""

    height_m: Finite = key("above the bottom of the shell")
    course: int = key("from the bottom, 1 first")
    mean_radius_m: Finite = key("inside, of the section about its own centre")
    centre_x_m: float | None = key("in the frame of the survey; null: the level is estimated")
    centre_y_m: float | None = key("in the frame of the survey; null: the level is estimated")
    azimuth_deg: list[Finite] = key("of each place")
    departure_mm: list[Finite] = key("radius about its own centre less the nominal radius")
    U_mm: list[Finite] = key("expanded, of each")


class WeldGap(Saved):
    """The gap of a board at a weld."""

    kind: str = key('"peaking" (vertical weld) or "banding" (horizontal)')
    course: int = key("of a vertical weld; below a horizontal weld")
    height_m: Finite = key("of the middle of the board, above the bottom of the shell")
    azimuth_deg: Finite = key("of the middle of the board")
    gap_mm: float | None = key("largest within reach of the weld, outwards positive")
    U_mm: float | None = key("expanded; null: not determined")
    along_mm: list[float] = key("places on the board of the profile, 0 at the weld")
    profile_mm: list[float] = key("gap at each")


class SettlementPoint(Saved):
    """A point of the bottom's edge in one epoch, or in the difference of two."""

    point: str = key("name")
    azimuth_deg: Finite = key("clockwise from +y")
    z_mm: Finite = key("elevation, or its change")
    s_mm: float | None = key("standard deviation; null: not given")
    fitted_mm: Finite = key("a + p cos t + q sin t")
    U_i_mm: Finite = key("out of the tilted plane: z less fitted")
    S_i_mm: float | None = key("less the mean of its neighbours; null: too few points")
    U_S_mm: float | None = key("expanded uncertainty of S_i; null: no sd is known")
    in_subset: bool = key("whether the spaced subset takes it")
    limit_mm: float | None = key(
        "of S_i, by the arcs to its neighbours; null: yield or height not given", default=None
    )


class Settlement(Saved):
    """Settlement of one epoch, or between two."""

    epoch: str = key("name")
    since: str | None = key("the earlier epoch; null: deviations include how it was built")
    a_mm: Finite = key("mean of the plane")
    p_mm: Finite = key("cosine term")
    q_mm: Finite = key("sine term")
    b_mm: Finite = key("hypot(p, q)")
    U_b_mm: float | None = key("expanded")
    highest_azimuth_deg: Finite = key("of the plane")
    tilt_mm_per_m: Finite = key("b over the radius")
    R2: Finite = key("share of the scatter that the plane explains")
    sd_known: bool = key("whether standard deviations were given; else from the repeats, or none")
    arc_m: Finite = key("between neighbours, mean")
    limit_mm: float | None = key(
        "of S_i with all points, where it is nearest its limit; null: yield or height not given"
    )
    limit_half_mm: float | None = key(
        "of S_i with every second point, where it is nearest its limit"
    )
    subset_arc_m: float | None = key("between neighbours of the subset")
    subset_limit_mm: float | None = key("of S_i of the subset, where it is nearest its limit")
    harmonics: int | None = key("highest that was fitted for the curvature")
    curvature_per_m: float | None = key("largest |d2U/ds2| of the harmonics")
    U_curvature_per_m: float | None = key("expanded")
    curvature_limit_per_m: float | None = key("11 Y / (E H)")
    points: list[SettlementPoint] = key("by azimuth")


class EdgeProfile(Saved):
    """Edge settlement along a radial line of the bottom."""

    azimuth_deg: Finite = key("clockwise from +y")
    radius_m: list[Finite] = key("of each reading")
    z_mm: list[Finite] = key("of each reading")
    break_radius_m: float | None = key("where the bottom bends down; null: not found")
    width_m: float | None = key("from there to the shell")
    drop_mm: float | None = key("B, over that width; positive: the edge is lower")
    U_mm: float | None = key("expanded")
    limit_mm: float | None = key("null: the rule has none")


class InspectionFile(Saved, kw_only=True):
    """State of a tank by its survey, judged by a rule."""

    format: str = key("see Versions", default=INSPECTION.format)
    tankcal: str = key("version of tankcal", default_factory=find_version)
    notice: str = key("on every page, such as EXAMPLE")
    tank: InspectedTank = key("the inspected tank")
    rule: InspectionRule | None = key("null: values without limits")
    decision: str = key(
        '"guarded": guard bands on both sides of a limit; "simple_beyond" (version 1): each value '
        "beyond its limit has failed",
        default=DECISIONS[0],
    )
    as_built: bool = key("whether an earlier epoch removes deviations of construction")
    checks: list[InspectionCheck] = key("in the order of docs/inspection.md")
    generatrices: Generatrices | None = key("null: the wall was not surveyed")
    levels: list[InspectedLevel] = key("from the bottom up; none: no wall")
    gaps: list[WeldGap] = key("of every weld; none: no weld is known, or no cloud")
    settlements: list[Settlement] = key("each epoch, then differences; none: not levelled")
    edges: list[EdgeProfile] = key("none: not levelled")
    warnings: list[WarningRecord] = key("on the inspection")
