"""Comparison of two tables of a tank: comparison.json.

Steps, verdict, reasons and limits are codes with numbers; the templates supply the sentences in
their language.
"""

from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, key
from tankcal.record.texts import WarningRecord
from tankcal.version import find_version

COMPARISON = SavedFormat("tankcal-comparison", 1, "comparison.json")

STEPS = ("zero", "temperature", "head", "roof", "rounding")  # in their order
VERDICTS = ("keep", "recompute", "recalibrate")


class RoofInTable(Saved):
    """The floating roof that a table deducts."""

    mass_kg: float = key("as weighed")
    density_kg_m3: float = key("of the liquid in which it floats")
    weighing: str = key('"air" or "vacuum"')
    critical_m: tuple[Finite, Finite] | None = key("dips between which it is partly afloat")


class ComparedTable(Saved):
    """Former or new table, as supplied."""

    name: str = key("of the file, and sheet")
    sha256: str = key("of the file")
    origin: str = key('"record" or "table"')
    laboratory: str | None = key("as declared, or by the record; null: not known")
    number: str | None = key("of the certificate; null: not known")
    date: str | None = key("of the calibration; null: not known")
    method: str | None = key("as declared; null: not known")
    kind: str | None = key('"vertical", "horizontal", "sphere" or "mesh"; null: not known')
    rows: int = key("number")
    low_m: float = key("lowest dip")
    high_m: float = key("highest dip")
    top_volume_m3: float = key("of the highest dip, as printed")
    height_quantum_m: float = key("value of the last digit of a dip; 0: not rounded")
    volume_quantum_m3: float = key("value of the last digit of a volume; 0: not rounded")
    reference_temperature_c: float | None = key("of the shell; null: not known")
    liquid_density_kg_m3: float | None = key("of the head; 0: without head; null: not known")
    roof: RoofInTable | None = key("null: none is known")
    reference_height_m: float | None = key("dip plate to reference point; null: not known")
    k: float | None = key("coverage factor of its U as declared; null: no U is known")
    U_top_m3: float | None = key("expanded, of the highest dip, as declared; null: not known")
    U_of_deliveries: str | None = key(
        '"record": by its covariance; "proportional": in percent of the delivery; '
        '"independent_rows": rows taken as independent; null: no U is known'
    )


class Material(Saved):
    """The shell's steel."""

    expansion_per_k: float = key("thermal expansion")
    modulus_pa: float = key("Young's modulus")
    source: str = key('"record" or "default"')


class BasisStep(Saved):
    """A step of the reduction of the former table to the basis of the new table."""

    code: str = key("zero, temperature, head, roof or rounding, in this order")
    state: str = key('"done"; "same": no difference; "not_declared", "not_possible": not done')
    source: str | None = key(
        'of its values: "declared", "fitted", "read" from a table; null: not done'
    )
    former: float | None = key("value of the former table in `unit`; null: not known")
    new: float | None = key("value of the new table in `unit`; null: not known")
    unit: str = key("C, kg/m3, m or m3")
    lacking: list[str] = key('missing declarations: "former.liquid_density_kg_m3" ...')
    top_m3: float = key("change of the highest row")
    largest_m3: float = key("largest change, with its sign")
    largest_at_m: float = key("dip of that row")


class ZeroShift(Saved):
    """Height of the new zero above the former zero."""

    height_m: float = key("as used; 0: none")
    u_m: float | None = key("standard; null: not known")
    source: str = key('"reference_heights", "fitted" or "none"')
    fitted_m: float | None = key("by the volumes; null: not determined")
    fitted_u_m: float | None = key("by the scatter of the rows and their rounding alone")
    volume_m3: float | None = key("equivalent volume at the lowest dip of the fit")


class ComparedRows(Saved):
    """Rows of the new table in the range of both."""

    height_m: list[Finite] = key("dips")
    former_m3: list[Finite] = key("as printed, between its rows interpolated")
    former_on_basis_m3: list[Finite] = key("on the basis of the new table")
    new_m3: list[Finite] = key("as printed")
    d_m3: list[Finite] = key("new less former on its basis")
    U_former_m3: list[float] = key("expanded, coverage of the new table; null: not known")
    U_new_m3: list[float] = key("expanded; null: not known")
    E_n: list[float] = key("with `correlation.c`, or 0 where that is null; null: a U is not known")
    c_limit: list[float] = key("correlation at which |E_n| is 1; null: below 1 for every c")
    for_use: list[bool] = key("false if a roof is partly afloat in a table")


class ComparedDelivery(Saved):
    """The worst delivery of at least a minimum height."""

    minimum_m: float = key("least height")
    by: str = key('worst by what: "relative": |d| over volume; "E_n"')
    low_m: float = key("dip")
    high_m: float = key("dip")
    former_m3: float = key("on the basis of the new table")
    new_m3: float = key("delivered")
    d_m3: float = key("new less former")
    relative: float = key("d over the former volume")
    U_former_m3: float | None = key("null: not known")
    U_new_m3: float | None = key("null: not known")
    E_n: float | None = key("as of rows; null: a U is not known")
    c_limit: float | None = key("as of rows")


class ComparedCourse(Saved):
    """The radius of a course in both tables, unloaded, at the temperature of the new table."""

    course: int = key("from the bottom, 1 first")
    bottom_m: float = key("above the zero of the new table")
    top_m: float = key("above the zero of the new table")
    former_m: float | None = key("radius; null: not determined")
    new_m: float | None = key("radius; null: not determined")
    d_m: float | None = key("new less former")
    u_m: float | None = key("standard uncertainty of d, of both tables; null: not known")
    u_rounding_m: float | None = key("part of u_m from scatter and rounding of rows")
    w: float | None = key("d over u_m; null: not known")
    u_former_m: float | None = key(
        "standard uncertainty of the former radius, by U of the volume of the course; left out if "
        "not known",
        optional=True,
        default=None,
    )
    u_new_m: float | None = key(
        "standard uncertainty of the new radius; left out if not known", optional=True, default=None
    )


class Waterfall(Saved):
    """Steps from the former to the new volume at a dip; the volumes before new_m3 add up to it."""

    height_m: float = key("dip")
    former_m3: float = key("as printed")
    zero_m3: float = key("of the dips")
    temperature_m3: float = key("of the shell")
    head_m3: float = key("of the liquid")
    roof_m3: float = key("floating roof")
    rounding_m3: float = key("to the last digit of the new table")
    tank_m3: float = key("remainder: change of the tank, or of its measurement")
    new_m3: float = key("as printed; the sum")


class Correlation(Saved):
    """Correlation of the errors of both tables."""

    c: float | None = key("null: not declared; E_n is then that for c = 0")
    source: str = key('"declared" or "not_declared"')
    worst_E_n: float | None = key("the largest |E_n| of rows and deliveries judged, with its sign")
    worst_E_n_at_half: float | None = key("of this row or delivery for c = 0.5")
    c_limit: float | None = key("smallest correlation at which some |E_n| is 1")
    coverage_k: float | None = key("factor of a normal distribution to which both U were converted")


class LegalNumber(Saved):
    """A value limited by a rule: at the top, over the range, reference height, or worst row."""

    code: str = key('"top", "range", "reference_height"; "row": the worst row')
    limit: float = key("in `unit`")
    unit: str = key("%, m3 or mm")
    value: float | None = key("on one basis; null: not known")
    as_printed: float | None = key("of the tables as printed; null: not known")
    at_m: list[Finite] = key("dips to which it refers")
    verdict: str = key('"conforms", "guard_band", "fails" or "not_judged"')
    clause: str = key("of the rule")
    verified: bool = key("whether it was read in the clause")


class TableAge(Saved):
    """Largest age of the former table."""

    name: str = key("of the period in the rule")
    of: str = key('"all" or "bottom_course"')
    years: float = key("at most")
    age_years: float | None = key("at the date of the new table; null: a date is not known")
    verdict: str = key('"conforms", "fails" or "not_judged"')
    clause: str = key("of the rule")
    verified: bool = key("whether it was read in the clause")


class ComparisonRule(Saved):
    """Rule of the comparison."""

    name: str = key("of the rule")
    file: str = key("name of its file")
    source: str = key("of its values")
    verified: bool = key("whether every value was read in the text itself")
    remark: str = key("to be printed with the rule")
    is_default: bool = key("whether it was not requested")


class Reason(Saved):
    """A reason of the verdict."""

    code: str = key("such as tank_differs: see docs/compare.md")
    values: dict = key("numbers and texts of the sentence")


class ReadOut(Saved):
    """A value read from a table because it was not declared."""

    table: str = key('"former" or "new"')
    code: str = key(
        '"head_with", "head_without", "head_undecided" (density of the head, by its rows), '
        '"zero", "rounding_volume"'
    )
    value: float | None = key("in `unit`")
    u: float | None = key("standard; null: not known")
    unit: str = key("kg/m3, m or m3")
    sure: str = key('"sure" or "doubtful"')
    used: bool = key("whether a step uses it")


class ComparisonFile(Saved, kw_only=True):
    """A former and a new table of a tank, reduced to a common basis and judged."""

    format: str = key("see Versions", default=COMPARISON.format)
    tankcal: str = key("version of tankcal", default_factory=find_version)
    tank: str | None = key("its id in a record; null: not known")
    notice: str = key("on every page of the reports of a record, such as EXAMPLE")
    former: ComparedTable = key("the former table")
    new: ComparedTable = key("the new table")
    material: Material = key("of the steps")
    low_m: float = key("lowest compared dip")
    high_m: float = key("highest compared dip")
    interpolation_m3: float = key("largest error of interpolation in the former table")
    steps: list[BasisStep] = key("five, in their order")
    zero: ZeroShift = key("of the dips")
    rows: ComparedRows = key("of the new table")
    waterfall: list[Waterfall] = key("at some dips, the highest last")
    deliveries: list[ComparedDelivery] = key("of 1.5, 2 and 3 m")
    courses: list[ComparedCourse] = key("from the bottom up; empty: not known")
    correlation: Correlation = key("of the errors")
    judged_from_m: float = key("lowest dip whose row E_n is judged; deliveries: every dip")
    legal: list[LegalNumber] = key("numbers limited by the rule")
    ages: list[TableAge] = key("periods of the rule")
    rule: ComparisonRule | None = key("null: none requested")
    verdict: str | None = key('"keep", "recompute" or "recalibrate"; null: no criterion')
    verified: bool = key("whether every value of the verdict was read in the text itself")
    reasons: list[Reason] = key("of the verdict, the gravest first")
    read: list[ReadOut] = key("from the tables")
    warnings: list[WarningRecord] = key("on the comparison")
