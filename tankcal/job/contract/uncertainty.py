"""Columns of uncertainty.csv, correlations.csv and stated.csv, with their checks."""

from dataclasses import dataclass
from itertools import pairwise
from math import degrees, pi

from tankcal.gum.distributions import FAMILIES, Normal, expanded, within
from tankcal.job.checking import UNIT_FACTOR, refuse_repeated, tell
from tankcal.job.fields import (
    KINDS,
    LOADED,
    STRAPPED,
    VERTICAL,
    WITH_POINTS,
    Field,
    choice,
    number,
    positive,
)
from tankcal.messages import message
from tankcal.uncertainty import Input, Inputs

AS_READ = ("standard", "half_width", "expanded", "scale", "sd")  # meanings of u


@dataclass(frozen=True)
class Declarable:
    """Input whose uncertainty may be declared.

    Attributes
    ----------
    unit : str
        Unit, as written in uncertainty.csv.
    per_si : float
        Number of these units in the SI unit.
    largest : float
        Largest plausible standard uncertainty, in `unit`.
    note : str
        Description of the input.
    kinds : tuple of str
        Kinds of tank that the input affects.
    default : float or None
        Half-width, in `unit`, of the rectangular distribution assumed if the input affects a job
        and is not declared; None: no uncertainty is assumed.
    default_share : float or None
        Half-width as a fraction of the value of the input, in place of `default`.
    correlates : bool
        Whether the input may be correlated with other inputs; False for many independent errors.
    """

    unit: str
    per_si: float
    largest: float
    note: str
    kinds: tuple[str, ...] = KINDS
    default: float | None = None
    default_share: float | None = None
    correlates: bool = True

    def assumed_half_width(self, value):
        """Return the half-width of the default in `unit`, or None; value: value of the input."""
        return self.default if self.default_share is None else self.default_share * value

    @property
    def assumption(self):
        """Default as a text: "± 2 K", "± 1 % of its value"; "" without a default."""
        if self.default_share is not None:
            return f"± {100 * self.default_share:g} % of its value"
        number = f"{self.default or 0:g}".replace("e-0", "e-")
        return "" if self.default is None else f"± {number} {self.unit}"


def _vertical_input(unit, per_si, largest, note, **more):
    return Declarable(unit, per_si, largest, note, VERTICAL, **more)


def _ship_input(unit, per_si, largest, note, **more):
    return Declarable(unit, per_si, largest, note, ("mesh",), **more)


def _horizontal_input(unit, per_si, largest, note, **more):
    return Declarable(unit, per_si, largest, note, ("horizontal",), **more)


INPUTS = {
    "scale": Declarable("ppm", 1e6, 1e4, "scale of the survey"),
    "offset": Declarable(
        "mm",
        1e3,
        100,
        "offset of instrument or target perpendicular to the wall, common to all points",
        WITH_POINTS,
    ),
    "datum": Declarable("mm", 1e3, 100, "height of the table's zero relative to the tank"),
    "course_heights": _vertical_input(
        "mm", 1e3, 100, "height of each course, independent of the others", correlates=False
    ),
    "plate_thickness": Declarable(
        "mm", 1e3, 10, "plate thickness, error common to all plates", WITH_POINTS, default=0.2
    ),
    "paint": Declarable(
        "mm", 1e3, 5, "paint thickness, error common to all courses", STRAPPED, default=0.05
    ),
    "shell_temperature": Declarable("K", 1, 50, "shell temperature during the survey", default=2.0),
    "expansion": Declarable("1/K", 1, 1e-4, "coefficient of thermal expansion", default=1e-6),
    "youngs_modulus": Declarable(
        "GPa", 1e-9, 100, "Young's modulus of the shell", LOADED, default=6.0
    ),
    "liquid_density": Declarable("kg/m3", 1, 500, "density of the liquid for the table", LOADED),
    "survey_level": Declarable(
        "mm", 1e3, 1000, "level of the liquid on the survey day", LOADED, default=5.0
    ),
    "survey_density": Declarable(
        "kg/m3", 1, 500, "density of the liquid on the survey day", LOADED, default=5.0
    ),
    "pressure": Declarable(
        "bar", 1e-5, 10, "gauge pressure in the sphere for the table", ("sphere",)
    ),
    "survey_pressure": Declarable(
        "bar",
        1e-5,
        10,
        "gauge pressure in the sphere on the survey day",
        ("sphere",),
        default=0.1,
    ),
    "bottom": _vertical_input(
        "mm", 1e3, 500, "height of the bottom surface, error common to all of it"
    ),
    "barrel": _vertical_input("mm", 1e3, 100, "bulge of a course between its sections"),
    "taper": _vertical_input(
        "mm",
        1e3,
        100,
        "excess of the radius at one end of a course over its middle, common to all courses",
    ),
    "roof_mass": _vertical_input("kg", 1, 1e6, "mass of the floating roof", default_share=0.01),
    "deadwood": Declarable(
        "%",
        100,
        50,
        "volume of the deadwood without u_m3, common relative error",
        default=5.0,
    ),
    "diameter": Declarable(
        "mm", 1e3, 200, "diameter of the cylinder or sphere", ("horizontal", "sphere")
    ),
    "length": _horizontal_input("mm", 1e3, 500, "length of the horizontal cylinder"),
    "end_depth": _horizontal_input("mm", 1e3, 500, "depth of both ends, common error"),
    "dish": Declarable(
        "mm",
        1e3,
        500,
        "radius of the dish of torispherical ends and heads, where given, common error",
        ("vertical", "horizontal"),
    ),
    "knuckle": Declarable(
        "mm",
        1e3,
        200,
        "radius of the knuckle of torispherical ends and heads, where given, common error",
        ("vertical", "horizontal"),
    ),
    "bottom_depth": _vertical_input(
        "mm", 1e3, 500, "depth of a shaped bottom from its edge to its centre"
    ),
    "top_depth": _vertical_input("mm", 1e3, 500, "height of the head above the shell"),
    "tilt": Declarable(
        "mm/m",
        1e3,
        50,
        "tilt of the axis; for a vertical tank such as settlement since the survey",
        ("vertical", "horizontal"),
    ),
    "dip_position": _horizontal_input("mm", 1e3, 2000, "position of the dip point along the axis"),
    "ring_lengths": _horizontal_input(
        "mm", 1e3, 100, "length of each ring, independent of the others", correlates=False
    ),
    "ring_axes": _horizontal_input(
        "mm",
        1e3,
        50,
        "height of the axis of each ring above the common axis, independent of the others",
        correlates=False,
    ),
    "tube_angle": _horizontal_input(
        "deg", 180 / pi, 10, "angle of the gauge tube from the vertical"
    ),
    "tube_offset": _horizontal_input("mm", 1e3, 500, "position of the gauge tube across the axis"),
    "surface": Declarable("mm", 1e3, 200, "offset of the mesh's surface from the wall", ("mesh",)),
    "trim": _ship_input("mm", 1e3, 1000, "trim of a ship: draught aft minus draught forward"),
    "list": _ship_input("deg", degrees(1), 5, "list of a ship"),
    "pipe_x": _ship_input("mm", 1e3, 1000, "position of the sounding pipe fore and aft"),
    "pipe_y": _ship_input("mm", 1e3, 1000, "position of the sounding pipe athwart"),
    "pipe_lean": _ship_input(
        "mm/m", 1e3, 50, "lean of the sounding pipe, fore and aft and athwart", correlates=False
    ),
    "contraction": _ship_input("%", 100, 0.5, "uniform contraction of all lengths"),
    "interpolation": Declarable(
        "m3", 1, 100, "linear interpolation between two rows, for each reading", correlates=False
    ),
    "rounding": Declarable(
        "m3", 1, 10, "last digit of a printed volume, for each reading", correlates=False
    ),
}
UNITS = tuple(dict.fromkeys(declarable.unit for declarable in INPUTS.values()))

COLUMNS = (
    choice("input", "uncertain input: " + ", ".join(INPUTS), tuple(INPUTS), required=True),
    number(
        "u", "standard uncertainty of the input, or the quantity that u_is states", 0, required=True
    ),
    choice(
        "unit",
        "; ".join(f"{name}: {declarable.unit}" for name, declarable in INPUTS.items()),
        UNITS,
        required=True,
    ),
    choice(
        "u_is",
        "meaning of u: standard; half_width of a bounded distribution; expanded, with its k;"
        " scale or sd of a t distribution; blank: standard",
        AS_READ,
    ),
    number("k", "coverage factor of an expanded uncertainty", 1, 20),
    choice("type", "A (statistics) or B; blank: B", ("A", "B")),
    choice("distribution", "distribution of the input; blank: normal", ("normal", *FAMILIES, "t")),
    number("dof", "degrees of freedom, 1 or more; blank: infinite", 1),
    Field("note", "text", "source of the value"),
)

OF_T = ("scale", "sd")
NORMAL = "normal"
SPREAD_COLUMNS = ("u", "u_is", "k", "distribution", "dof")


def check_inputs(inputs, useless, log):
    """Check that each input is declared once, in its unit, of plausible size, and has an effect.

    Parameters
    ----------
    inputs : ColumnValues
        Rows of uncertainty.csv.
    useless : dict
        Reason by name of the inputs without effect on the job.
    log
        Log of the problems.
    """
    reported_rows = {problem.row for problem in log.problems if problem.file == inputs.file}
    refuse_repeated(inputs, "input", log)
    units = inputs.of("unit")
    rows = zip(inputs.rows, inputs.of("input"), units, spreads(inputs), strict=True)
    for row, name, unit, spread in rows:
        if name in useless:
            why = useless[name]
            expected = message("useless_input", "found {name}; {why}", name=name, why=why)
            log.problem(inputs.file, expected, row, "input")
        if None in (name, unit):
            continue
        if unit != INPUTS[name].unit:
            expected = message(
                "other_unit",
                "found {unit!r}; expected {unit_of_input!r} for {name}",
                unit=unit,
                unit_of_input=INPUTS[name].unit,
                name=name,
            )
            log.problem(inputs.file, expected, row, "unit")
        if row not in reported_rows and spread[0] is not None:
            _check_spread(inputs.file, row, name, unit, spread, log)


def spreads(inputs):
    """Return (u, u_is, k, distribution, dof) of each row of uncertainty.csv, None for a blank."""
    return [*zip(*(inputs.of(column) for column in SPREAD_COLUMNS), strict=True)]


def standard_u(u, u_is, k, distribution, dof):
    """Return the standard uncertainty of a valid row, in its unit.

    For a t distribution, u is returned, scale or standard deviation as stated by `u_is`.
    """
    if u_is == "half_width":
        return within(u, distribution).u
    if u_is == "expanded":
        return expanded(u, k=k).u
    return u


def _check_spread(file, row, name, unit, spread, log):
    """Check that the cells of a row agree, and the standard uncertainty is of plausible size."""
    contradictions = _find_contradictions(*spread[1:])
    for column, expected in contradictions:
        log.problem(file, expected, row, column)
    known = INPUTS[name]
    if contradictions or unit != known.unit:
        return
    u = standard_u(*spread)
    if u > known.largest:
        expected = message(
            "input_too_large",
            "found {u:g} {unit} for {name}; expected at most {largest:g} {unit}",
            u=u,
            unit=unit,
            name=name,
            largest=known.largest,
        )
        if u != spread[0]:
            expected = message(
                "spread_too_large",
                "found {spread:g}, a standard uncertainty of {u:g} {unit} for {name}; expected "
                "at most {largest:g} {unit}",
                spread=spread[0],
                u=u,
                unit=unit,
                name=name,
                largest=known.largest,
            )
        log.problem(file, expected, row, "u")


def _find_contradictions(u_is, k, distribution, dof):
    """Return [(column, message)] for contradictions of u_is, coverage factor and distribution."""
    name = distribution or NORMAL
    problems = [*_check_t(u_is, dof)] if name == "t" else [*_check_other(u_is, name)]
    if u_is == "expanded" and k is None:
        problems.append(
            (
                "k",
                message(
                    "coverage_factor_missing",
                    "blank; expected the coverage factor, because u_is = expanded",
                ),
            )
        )
    if u_is != "expanded" and k is not None:
        problems.append(
            (
                "k",
                message(
                    "coverage_factor_unused",
                    "found {k:g}; expected a blank, or u_is = expanded with it",
                    k=k,
                ),
            )
        )
    return problems


def _check_t(u_is, dof):
    """Yield (column, message) for each problem of a t distribution."""
    if u_is not in OF_T:
        if u_is is None:
            yield (
                "u_is",
                message("t_blank", "blank; expected scale or sd for a t distribution"),
            )
        else:
            yield (
                "u_is",
                message(
                    "t_other",
                    "found {u_is}; expected scale or sd for a t distribution",
                    u_is=u_is,
                ),
            )
    if dof is None:
        yield (
            "dof",
            message("dof_missing", "blank; expected the degrees of freedom of the t distribution"),
        )
    elif u_is == "sd" and dof <= 2:
        yield (
            "dof",
            message(
                "dof_too_few",
                "found {dof:g}; expected above 2: with fewer a t distribution has no sd",
                dof=dof,
            ),
        )


def _check_other(u_is, name):
    """Yield (column, message) for each problem of another distribution."""
    if u_is in OF_T:
        yield (
            "u_is",
            message(
                "only_beside_t",
                "found {u_is}; expected only with distribution = t; the distribution is {name}",
                u_is=u_is,
                name=name,
            ),
        )
    if u_is == "half_width" and name not in FAMILIES:
        bounded = ", ".join(FAMILIES)
        yield (
            "distribution",
            message(
                "no_half_width",
                "{name} has no half-width; expected {bounded} with it",
                name=name,
                bounded=bounded,
            ),
        )
    if u_is == "expanded" and name != NORMAL:
        yield (
            "distribution",
            message(
                "not_normal",
                "found {name}; expected {normal} or a blank with u_is = expanded",
                name=name,
                normal=NORMAL,
            ),
        )


CORRELATED = tuple(name for name, declarable in INPUTS.items() if declarable.correlates)

CORRELATION_COLUMNS = (
    choice("input", "an input of uncertainty.csv", CORRELATED, required=True),
    choice("with", "another input, correlated with the first", CORRELATED, required=True),
    number("r", "coefficient of correlation of the two inputs", -1, 1, required=True),
)


def check_correlations(table, inputs, raw, log):
    """Check that each pair is declared once and that the correlation matrix is valid.

    Parameters
    ----------
    table : ColumnValues
        Rows of correlations.csv.
    inputs : ColumnValues or None
        Rows of uncertainty.csv; None if missing or unreadable.
    raw, log
        Raw job, and log of its problems.
    """
    before = len(log.problems)
    known = _declared_names(inputs, raw)
    pairs, first_row = {}, {}
    for row, first, second, r in zip(
        table.rows, *map(table.of, ("input", "with", "r")), strict=True
    ):
        for column, name in (("input", first), ("with", second)):
            if None not in (known, name) and name not in known:
                expected = message(
                    "correlation_unknown",
                    "found {name}; expected an input of {of}",
                    name=name,
                    of=raw.file_of("uncertainty"),
                )
                log.problem(table.file, expected, row, column)
        if first is not None and first == second:
            expected = message(
                "correlation_with_itself", "found {one} again; expected another input", one=first
            )
            log.problem(table.file, expected, row, "with")
        pair = frozenset((first, second))
        if None not in pair and pair in first_row:
            expected = message(
                "correlation_twice",
                "{one} and {other} are already in row {first_row}; expected once",
                one=first,
                other=second,
                first_row=first_row[pair],
            )
            log.problem(table.file, expected, row, "with")
        first_row.setdefault(pair, row)
        pairs[first, second] = r
    if len(log.problems) == before and not (
        table.skipped or None in [*(name for pair in pairs for name in pair), *pairs.values()]
    ):
        _check_together(table, pairs, log)


def _declared_names(inputs, raw):
    """Return the names of the declared inputs; None if some of them could not be read."""
    if inputs is None:
        is_there = "uncertainty" in raw.tables
        return None if is_there else ()
    names = inputs.of("input")
    return None if inputs.skipped or None in names else names


def _check_together(table, pairs, log):
    """Check that the matrix of all coefficients is positive semidefinite."""
    names = dict.fromkeys(name for pair in pairs for name in pair)
    try:
        Inputs([Input(name, Normal(1.0)) for name in names], pairs)
    except ValueError as error:
        expected = message(
            "correlations_impossible",
            "{error}; expected coefficients that are possible together",
            error=str(error),
        )
        log.problem(table.file, expected, None, "r")


STATED_COLUMNS = (
    positive(
        "high_m",
        "dip from the table's zero, metres; the report states its volume, uncertainty and budget",
        100,
        required=True,
    ),
    number("low_m", "for a delivery: dip at its end, metres; blank: volume below high_m", 0, 100),
    positive(
        "volume_m3",
        "volume stated by an earlier table or a contract, cubic metres; for decision rules that"
        " limit deviations",
        1e6,
    ),
    Field("note", "text", "description of the volume"),
)
_ROUNDING_M = 1e-9  # tolerance of comparisons
_MOST_M = 100
KEYS = (
    positive("full_m", "dip of the full tank, such as the overflow, metres", _MOST_M),
    positive("maximum_m", "dip of the safe fill, metres", _MOST_M),
    positive("minimum_m", "lowest dip in operation, metres", _MOST_M),
    positive("pump_suction_m", "lowest dip that can be pumped, metres", _MOST_M),
)
_FROM_THE_TOP = tuple(key.name for key in KEYS)


def check_stated(table, extent, log):
    """Check that dips lie within the tank, pairs are unique, and volumes are in cubic metres."""
    first_row = {}
    columns = (table.of(name) for name in ("high_m", "low_m", "volume_m3"))
    for row, high, low, volume in zip(table.rows, *columns, strict=True):
        _check_within(table, row, high, low, extent, log)
        if high is None:
            continue
        if low is not None and low >= high:
            expected = message(
                "stated_upside_down",
                "found {low:g}; expected a dip below high_m = {high:g}",
                low=low,
                high=high,
            )
            log.problem(table.file, expected, row, "low_m")
        elif (high, low) in first_row:
            expected = message(
                "stated_twice",
                "this dip is already in row {first_row}; expected once",
                first_row=first_row[high, low],
            )
            log.problem(table.file, expected, row, "high_m")
        elif volume is not None:
            _check_volume(table, row, high, low, volume, extent, log)
        first_row.setdefault((high, low), row)


def _check_within(table, row, high, low, extent, log):
    """Check that the dips do not exceed the top of the tank."""
    for column, dip in (("high_m", high), ("low_m", low)):
        expected = dip_above_top(dip, extent)
        if expected:
            log.problem(table.file, expected, row, column)


def dip_above_top(dip, extent):
    """Return the message that a dip exceeds the top of the tank; "" if not, or if unknown."""
    top = extent.height_m if extent.top_m is None else extent.top_m
    if None in (dip, top) or dip <= top + _ROUNDING_M:
        return ""
    return message(
        "stated_above_top",
        "found {dip:g}; expected at most {top:.5g}, the top of the tank, in metres",
        dip=dip,
        top=top,
    )


def _check_volume(table, row, high, low, volume, extent, log):
    """Refuse volumes far larger than the tank or the delivery, which are in another unit."""
    height = extent.height_m if low is None else high - low
    if None in (height, extent.area_m2):
        return
    full = extent.area_m2 * height
    if volume > UNIT_FACTOR * full:
        expected = message(
            "stated_too_much",
            "found {volume:g}; the whole tank holds about {full:.4g} m3, expected m3: is it "
            "in litres?",
            volume=volume,
            full=full,
        )
        if low is not None:
            expected = message(
                "delivered_too_much",
                "found {volume:g}; the tank between low_m and high_m holds about {full:.4g} "
                "m3, expected m3: is it in litres?",
                volume=volume,
                full=full,
            )
        log.problem(table.file, expected, row, "volume_m3")


# ---- keys of [levels], the operating levels of a tank, and checks of their order


def check_levels(levels, extent, raw, log):
    """Check that the levels lie within the tank, in their order.

    The lowest dip in operation may be the lowest that can be pumped, and the safe fill may be the
    full tank. The maximum must be above both lower levels, because volumes between them are stated.
    """
    given = [(name, levels[name]) for name in _FROM_THE_TOP if levels[name] is not None]
    for name, dip in given:
        expected = dip_above_top(dip, extent)
        if expected:
            tell(log.problem, raw, "levels", name, expected)
    for (name, dip), (lower, low) in pairwise(given):
        if dip < low or (dip == low and name == "maximum_m"):
            expected = message(
                "level_below_lower_level",
                "found {level:g}; expected a dip above {lower} = {low:g}",
                level=dip,
                lower=lower,
                low=low,
            )
            tell(log.problem, raw, "levels", name, expected)
