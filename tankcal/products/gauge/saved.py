"""Saved commissioning of a gauge: gauge.json."""

from pathlib import Path

from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Finite, Saved, WarningRecord, key
from tankcal.version import find_version

GAUGE = SavedFormat("tankcal-gauge", 1, "gauge.json", schemas=Path(__file__).with_name("schemas"))
VERDICTS = ("failed", "guard_band_beyond", "guard_band", "passed")  # the gravest first


class GaugeCertificate(Saved):
    """Facts of the certificate, as declared."""

    number: str | None = key("null: to be filled in")
    date: str = key("day of the comparison")
    by: str | None = key("person who made the comparison")
    place: str | None = key("place of the comparison")
    customer: str | None = key("owner or operator of the tank")
    note: str | None = key("remark")
    language: str | None = key("of all documents; null: not declared")


class GaugeInstrument(Saved):
    """The gauge, as declared."""

    maker: str | None = key("maker")
    model: str | None = key("model")
    serial: str | None = key("serial number")
    principle: str | None = key("principle of measurement")
    certificate: str | None = key("certificate of the gauge")
    resolution_mm: Finite = key("smallest step of the indication")
    supported_by: str = key('"bottom" (still pipe on the bottom) or "shell"')
    corrects_head: bool = key("whether the gauge applies HyTD itself")
    lowest_m: Finite = key("lowest level in use")
    highest_m: Finite = key("highest level in use")
    scale_ppm: float | None = key("scale error by its certificate; null: not known")
    u_scale_ppm: float | None = key("its standard uncertainty")


class GaugeTape(Saved):
    """Tape of the hand dips, and the corrections applied."""

    serial: str | None = key("serial number")
    certificate: str | None = key("certificate of the tape")
    zero_correction_mm: Finite = key("added to every reading")
    scale_correction_ppm: Finite = key("of the length")
    expansion_per_k: Finite = key("coefficient of linear expansion")
    reference_temperature_c: Finite = key("temperature at which the tape is correct")


class GaugeLevel(Saved):
    """Comparison at a level."""

    name: str = key("of the level")
    count: int = key("number of readings")
    dip_m: Finite = key("mean dip above the dip plate, corrected for the tape")
    gauge_m: Finite = key("mean indication of the gauge")
    movement_mm: Finite = key("modelled movement of the gauge by the head; 0: none")
    deviation_mm: Finite = key("indication less dip")
    U_mm: Finite = key("expanded, of the deviation")
    k: Finite = key("coverage factor of U")
    residual_mm: Finite = key("estimated less observed deviation")
    w: float | None = key("residual over its standard deviation; null: without redundancy")
    limit_mm: float | None = key("null: no limit is declared")
    probability: float | None = key("of conformity; null: no limit is declared")
    verdict: str | None = key(f"one of: {', '.join(VERDICTS)}; null: no limit is declared")


class GaugeLine(Saved):
    """Deviation of the gauge as a line of the level."""

    is_slope_estimated: bool = key("false: the slope is declared, for fewer than three levels")
    mean_level_m: Finite = key("level of the offset")
    offset_mm: Finite = key("deviation at that level, without the modelled movement")
    U_offset_mm: Finite = key("expanded")
    k_offset: Finite = key("coverage factor of U")
    slope_mm_per_m: Finite = key("change of the deviation per metre of level")
    U_slope_mm_per_m: Finite = key("expanded")
    k_slope: Finite = key("coverage factor of U")
    dof: int = key("degrees of freedom of the residuals")
    sigma0: float | None = key("scatter of the residuals over the declared scatter; null: dof is 0")
    probability: float | None = key("of a larger scatter, if the declaration is correct")
    is_scatter_estimated: bool = key("whether the scatter is of the residuals alone")
    pipe_mm_per_m: float | None = key("part of the slope by the measured tilt; null: not measured")
    U_pipe_mm_per_m: float | None = key("expanded")
    scale_mm_per_m: float | None = key("slope less the part of the tilt; null: not measured")
    U_scale_mm_per_m: float | None = key("expanded")
    tilt_deg: float | None = key(
        "angle of the pipe that explains the slope, or its part that the scale of the gauge does "
        "not explain; 0: the slope is negative"
    )
    tilt_is: str | None = key('"estimated": the scale is declared; "equivalent": it is not')
    U_tilt_low_deg: float | None = key("lower end of the coverage interval of the angle")
    U_tilt_high_deg: float | None = key("upper end of the coverage interval of the angle")


class GaugeZero(Saved):
    """A zero of levels, or the gauging reference, above the dip plate."""

    code: str = key('"dip_plate", "table", "gauge" or "reference"')
    z_mm: float | None = key("above the dip plate of today; null: not known")
    U_mm: float | None = key("expanded; null: not known")
    source: str = key('"definition", "levelled", "reference_heights", "line", "tape" or "unknown"')


class GaugeHead(Saved):
    """Movement of a gauge that the shell carries, by the head of the liquid."""

    is_modelled: bool = key("whether the movement is part of the deviation")
    density_kg_m3: Finite = key("of the liquid")
    top_mm: Finite = key("movement at the highest level in use")
    U_top_mm: Finite = key("expanded")
    start_m: Finite = key("L_0 of the line C = -(L - L_0) D")
    factor_mm_per_m: Finite = key("D of this line")
    off_mm: Finite = key("largest distance of the line from the movement")


class GaugeCorrection(Saved):
    """Correction at an indication of the gauge."""

    gauge_m: Finite = key("indication")
    correction_mm: Finite = key("to the level above the dip plate, to be added")
    U_mm: Finite = key("expanded")
    k: Finite = key("coverage factor of U")
    table_correction_mm: float | None = key("to the level above the zero of the table, to be added")
    U_table_mm: float | None = key("expanded; null: the zero of the table is not known")
    is_outside: bool = key("whether the level is outside the compared levels")


class GaugeContribution(Saved):
    """A source of uncertainty of the deviation at three levels."""

    source: str = key("scatter, tape zero, tape scale ...")
    low_mm: Finite = key("contribution to u at the lowest compared level")
    middle_mm: Finite = key("at the mean level")
    high_mm: Finite = key("at the highest compared level")
    dof: float | None = key("degrees of freedom; null: infinite")


class GaugeInput(Saved):
    """An assumed or declared standard uncertainty."""

    name: str = key("of the input")
    value: Finite = key("in the unit of its name")
    is_assumed: bool = key("whether it is an assumption of tankcal")


class GaugeDecision(Saved):
    """Decision of the whole comparison."""

    source: str = key("document and clause of the limit, as declared")
    rule: str = key('"guarded" (guard band U) or "simple"')
    absolute_mm: float | None = key("limit; null: none")
    relative_percent: float | None = key("limit in percent of the level; null: none")
    verdict: str = key("the gravest of the levels")


class GaugeSource(Saved):
    """A file of the comparison."""

    file: str = key("name")
    sha256: str = key("of its bytes")


class GaugeCourse(Saved):
    """A course of the tank, from its record."""

    height_m: Finite = key("of the course")
    thickness_m: Finite = key("of the plate")
    radius_m: Finite = key("inside radius")


class GaugeRecord(Saved):
    """Facts of the tank from its record."""

    sha256: str = key("of record.json")
    tank: str = key("name of the tank")
    reference_height_m: float | None = key("above the zero of the table; null: not known")
    zero_m: Finite = key("height of the zero of the table above the bottom")
    courses: list[GaugeCourse] = key("from the bottom up; none: plates not known")
    e_pa: Finite = key("Young's modulus of the shell")
    notice: str = key('on every page of its certificate; "": none')


class GaugeReading(Saved):
    """A row of readings.csv."""

    row: int = key("in the file")
    level: str = key("name of the level")
    dip_m: float | None = key("tape reading at the liquid, before corrections")
    ullage_m: float | None = key("tape reading from the reference point, before corrections")
    gauge_m: Finite = key("indication of the gauge")
    tape_c: float | None = key("temperature of the tape; null: not measured")


class GaugeFile(Saved, kw_only=True):
    """Comparison of a level gauge with hand dips."""

    format: str = key("see Versions", default=GAUGE.format)
    tankcal: str = key("version of tankcal", default_factory=find_version)
    notice: str = key("on every page, such as EXAMPLE", default="")
    tank: str = key("name of the tank")
    coverage_probability: Finite = key("of all U")
    certificate: GaugeCertificate = key("facts of the certificate")
    gauge: GaugeInstrument = key("the gauge")
    tape: GaugeTape = key("the tape")
    liquid: str | None = key("liquid in the tank")
    reference_height_m: float | None = key("measured on the day of the comparison")
    U_reference_mm: float | None = key("expanded")
    table_reference_height_m: float | None = key("of the capacity table")
    levels: list[GaugeLevel] = key("from the lowest")
    line: GaugeLine = key("the estimated line")
    zeros: list[GaugeZero] = key("dip plate, table, gauge, reference")
    head: GaugeHead | None = key("null: the shell does not carry the gauge, or no record")
    corrections: list[GaugeCorrection] = key("by indication")
    budget: list[GaugeContribution] = key("of the deviation")
    uncertainties: list[GaugeInput] = key("declared and assumed standard uncertainties")
    decision: GaugeDecision | None = key("null: no limit is declared")
    record: GaugeRecord | None = key("facts of the tank; null: no record")
    inputs: dict = key("gauge.toml as {section: {key: value}}, without blank keys")
    readings: list[GaugeReading] = key("rows of readings.csv")
    files: list[GaugeSource] = key("gauge.toml and readings.csv")
    warnings: list[WarningRecord] = key("on the comparison")
