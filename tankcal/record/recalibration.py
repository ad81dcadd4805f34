"""Saved comparison of two tables and saved history of a tank: comparison.json, history.json.

Comparison of two tables of a tank: comparison.json.

Steps, verdict, reasons and limits are codes with numbers; the templates supply the sentences in
their language.

History of the certificates of a tank: history.json.

Volumes and radii of all tables are on the basis of the newest table, by the steps of `tankcal
compare`. The verdicts between two tables are verdicts of this command.
"""

import tankcal
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, WarningRecord, key
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


HISTORY = SavedFormat("tankcal-history", 1, "history.json")


class CertificateInHistory(Saved):
    """A capacity table with the data of its certificate."""

    certificate: int = key("from the oldest, 1 first")
    file: str = key("path of the file")
    sha256: str = key("of the file")
    origin: str = key('"record" or "table"')
    tank: str | None = key("id of the tank in it; null: not known")
    date: str = key("of the calibration, ISO")
    superseded: str | None = key("date of the next certificate; null: it is the newest")
    number: str | None = key("of the certificate; null: not given")
    laboratory: str | None = key("null: not given")
    method: str | None = key("by the certificate, or kind of survey; null: not known")
    tankcal: str | None = key("version that computed it; null: a table of others")
    nominal_diameter_m: float | None = key("null: not known")
    nominal_height_m: float | None = key("null: not known")
    reference_temperature_c: float | None = key("of the shell; null: not known")
    liquid_density_kg_m3: float | None = key("of the head; 0: without head; null: not known")
    reference_height_m: float | None = key("dip plate to reference point; null: not known")
    zero: str | None = key("code of the zero in the record; null: not known")
    top_dip_m: float = key("of its last row")
    top_volume_m3: float = key("of its last row, as printed")
    U_top_m3: float | None = key("expanded, of its last row, as stated; null: not known")
    k: float | None = key("coverage factor of U_top_m3; null: not known")
    rule: str | None = key("decision rule; null: none")
    rule_verdict: str | None = key("code of the verdict, as `rule.code` of a record; null: none")
    sigma0: float | None = key("of its adjusted survey; null: none, or no redundancy")
    global_test_passed: bool | None = key("of the adjustment; null: not tested")
    state: str | None = key(
        'in the register: "issued", "replaced", "withdrawn" or "not_registered"; left out without '
        "a register",
        default=None,
        optional=True,
    )
    state_since: str | None = key(
        "date of the state, ISO; left out if not registered", default=None, optional=True
    )


class RadiusInHistory(Saved):
    """The radius of a course by a table, empty, on the basis of the newest table."""

    certificate: int = key("see certificates")
    course: int = key("from the bottom, 1 first")
    bottom_m: float = key("above the zero of the newest table")
    top_m: float = key("above the zero of the newest table")
    radius_m: float = key("inside")
    U_m: float | None = key("expanded, by U of the volume of the course; null: not known")


class VolumeInHistory(Saved):
    """The volume of a table at a dip of the newest table, on the basis of the latter."""

    certificate: int = key("see certificates")
    height_m: float = key("dip in the newest table")
    volume_m3: float = key("on the basis of the newest table")
    U_m3: float | None = key("expanded; null: not known")
    d_m3: float = key("less that of the newest table")
    E_n: float | None = key("of d, with the correlation of the comparison; null: a U is not known")


class RadiusChange(Saved):
    """Change of the radius of a course between successive tables."""

    course: int = key("from the bottom, 1 first")
    d_m: float = key("newer less older")
    U_m: float | None = key("expanded, of d, rounding included; null: not known")
    E_n: float | None = key("d over U_m; null: not known")


class TableChange(Saved):
    """Comparison of a table with the preceding table."""

    former: int = key("number of the older certificate")
    new: int = key("number of the newer certificate")
    years: float = key("between their dates")
    low_m: float = key("lowest compared dip")
    high_m: float = key("highest compared dip")
    top_d_m3: float = key("newer less older at the highest dip, on the basis of the newer table")
    U_top_m3: float | None = key("expanded, of top_d_m3; null: not known")
    worst_E_n: float | None = key("largest |E_n| of rows and deliveries judged, with its sign")
    c: float | None = key("correlation declared of both tables; null: none, 0 is taken")
    zero_m: float = key("height of the newer above the older zero, which was corrected")
    zero_source: str = key('"reference_heights", "fitted" or "none"')
    not_made: list[str] = key("missing steps to a common basis: not declared, not possible")
    verdict: str | None = key('"keep", "recompute" or "recalibrate"; null: no criterion')
    rule: str = key("of the verdict")
    radii: list[RadiusChange] = key("from the bottom up; empty: courses are not known")


class CheckInHistory(Saved):
    """The worst value of a check of an inspection."""

    code: str = key("such as plumbness_generatrix")
    unit: str = key('"mm", "mm/m", "1/m" or ""')
    value: float | None = key("with its sign; null: not determined")
    U: float | None = key("expanded; null: not known")
    limit: float | None = key("in `unit`; null: none")
    verdict: str = key('"passed", "guard_band", "guard_band_beyond", "failed" or "not_determined"')


class InspectionInHistory(Saved):
    """An inspection of the tank."""

    file: str = key("path of the file")
    sha256: str = key("of the file")
    tank: str = key("id of the tank in it")
    date: str | None = key("of its survey, ISO; null: not known")
    rule: str | None = key("name; null: values without limits")
    checks: list[CheckInHistory] = key("in their order, the worst of each")


class MonthInHistory(Saved):
    """A month of an upkeep by everyday data."""

    file: str = key("path of upkeep.json")
    month: str = key("year-month")
    table_sha256: str = key("of the record of the table in force")
    leak_l_h: Finite = key("loss by time")
    leak_U_l_h: Finite = key("expanded")
    throughput_percent: Finite = key("causes proportional to throughput, less their mean")
    throughput_U_percent: Finite = key("expanded")
    verdict: str = key('"pass", "fail" or "inconclusive"')
    alarm: str | None = key("day of the first alarm, if it is in this month")


class HistoryFile(Saved, kw_only=True):
    """History of the certificates of a tank."""

    format: str = key("see Versions", default=HISTORY.format)
    tankcal: str = key("version of tankcal", default=tankcal.__version__)
    notice: str = key("on every page of the reports of the newest record, such as EXAMPLE")
    tank: str | None = key("its id, of the newest record; null: not known")
    kind: str | None = key('"vertical", "horizontal", "sphere" or "mesh"; null: not known')
    coverage_k: float = key("factor of a normal distribution to which all U were converted")
    certificates: list[CertificateInHistory] = key("from the oldest to the newest")
    dips_m: list[Finite] = key("of the shown volumes")
    volumes: list[VolumeInHistory] = key("of each certificate, at each dip")
    radii: list[RadiusInHistory] = key("of each certificate and course; none: not known")
    changes: list[TableChange] = key("between successive certificates")
    inspections: list[InspectionInHistory] = key("by their dates; without date last")
    months: list[MonthInHistory] | None = key(
        "of upkeeps, in their order; left out if there are none", default=None, optional=True
    )
    left_out: list[WarningRecord] = key("excluded files, with the reason")
    warnings: list[WarningRecord] = key("on the history")
