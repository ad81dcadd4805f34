"""The part of the record on the capacity table: rows, uncertainty, and the choices behind them."""

from collections import Counter
from dataclasses import fields

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.methods.base import accompanying_methods, given_methods
from tankcal.pipeline.chain import PARTS
from tankcal.pipeline.table import undeclared_inputs
from tankcal.pipeline.tanks import as_surveyed
from tankcal.record.covariance_factor import FactorBlock, blocks_of
from tankcal.record.schema import Finite, Saved, fill_from, key
from tankcal.tank.budgets import budget
from tankcal.tank.dips import ProportionalParts, dip_label

LEAST_PART_M3 = 1e-4  # last printed digit of a proportional part; smaller errors do not show


class CapacityTable(Saved):
    """The capacity table, and its covariance: the factor, in blocks, times its transpose."""

    zero: str = key("code of the zero of the heights")
    zero_m: Finite = key("height of the zero above the bottom")
    height_m: list[Finite] = key("dips of the rows, above the zero")
    dip: list[str] = key("dips as text in the table's unit")
    volume_m3: list[Finite] = key("below the dip")
    u_m3: list[Finite] = key("standard uncertainty")
    U_m3: list[Finite] = key("expanded uncertainty")
    k: list[Finite] = key("coverage factor")
    dof: list[float] = key("degrees of freedom; null: infinite")
    area_m2: list[float] = key("derivative of the volume by the dip")
    for_use: list[bool] = key("false inside the critical zone of a floating roof")
    low_m3: list[Finite] = key("lower end of the stated interval")
    high_m3: list[Finite] = key("upper end of the stated interval")
    interval: list[str] = key('its source: "gum"; "monte_carlo" if the GUM is not validated')
    stated_U_m3: list[Finite] = key("as printed: the larger distance of the ends from the volume")
    inputs: list[str] = key("name of each column of the factor")
    input_kind: list[str] = key("kind of input, see below")
    factor: list[FactorBlock] = key("rows x inputs, in blocks of rows")


class InterpolationError(Saved):
    """The largest error of linear interpolation between two rows."""

    largest_m3: float = key("of a volume")
    at_m: float = key("dip of this error")


class PartsOfRows(Saved):
    """Volumes of 1 to 9 millimetres, to be added to a row of a centimetre table."""

    parts: int = key("of a row")
    zones: list[ProportionalParts] = key("between joints and edges; only those with a small error")
    largest_m3: float | None = key("largest error, at least the last printed digit")


DENSITY_STEP = 20.0  # kg/m3 between the densities of the roof correction


class RowOnHighLegs(Saved):
    """A row of the table with the legs of the floating roof in their high position."""

    height_m: float = key("dip above the zero of the table")
    volume_m3: float = key("below the dip")
    u_m3: float = key("standard uncertainty, by the law of propagation")
    U_m3: float = key("expanded uncertainty, by the law of propagation")
    k: float = key("coverage factor")
    for_use: bool = key("false inside the critical zone of this position")


class RoofCorrection(Saved):
    """Correction of a volume above the critical zone for another density of the liquid."""

    density_kg_m3: float = key("of the liquid")
    correction_m3: float = key("added to the volume of the table")


class VolumesOfDensity(Saved):
    """Volumes of the rows for a further density of the liquid."""

    density_kg_m3: float = key("of the liquid")
    volume_m3: list[Finite] = key("of each row")


class GrossShell(Saved):
    """The shell as surveyed, without any correction, over its full height."""

    volume_m3: float = key("of the shell")
    area_m2: float = key("mean")


def capacity_of(result):
    """Return the `CapacityTable` of a result, with a name for each column of the factor."""
    table = result.table
    kinds = [source.kind for source in table.sources for _ in range(source.columns_m3.shape[1])]
    counts = Counter(kinds)
    numbers = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
    return fill_from(
        CapacityTable,
        table,
        zero=zero_of(result),
        zero_m=result.zero_m,
        dip=[dip_label(height, result.job.table.height_unit) for height in table.height_m],
        for_use=table.for_use(table.height_m),
        **_row_intervals(result),
        inputs=[
            kind if counts[kind] == 1 else f"{kind} {number}"
            for kind, number in zip(kinds, numbers, strict=True)
        ],
        input_kind=kinds,
        factor=blocks_of(table.factor_m3),
    )


def _row_intervals(result):
    """Return the keys of the stated interval of each row and of its U."""
    intervals = result.intervals
    return {
        "low_m3": intervals.low_m3,
        "high_m3": intervals.high_m3,
        "interval": np.where(intervals.by_gum, "gum", "monte_carlo"),
        "stated_U_m3": intervals.U_m3,
    }


def proportional_parts_of(result):
    """Return the `PartsOfRows` of a result."""
    zones = result.proportional_parts
    errors_m3 = [max(abs(zone.deviation_m3), LEAST_PART_M3) for zone in zones]
    return PartsOfRows(PARTS, zones, max(errors_m3, default=None))


def densities_of(result):
    """Return the `VolumesOfDensity` of each further density of the liquid."""
    return [VolumesOfDensity(*volumes) for volumes in result.by_density.items()]


def rows_on_high_legs(result):
    """Return the `RowOnHighLegs`s between the rows where both positions agree; None: no table.

    Below the usual and above the high critical zone both tables agree.
    """
    table, roof = result.on_high_legs, result.job.roof
    if table is None:
        return None
    heights = table.height_m
    first = int(np.searchsorted(heights, roof.critical_bottom_m, side="right")) - 1
    end = int(np.searchsorted(heights, max(roof.high_critical_top_m, roof.critical_top_m))) + 1
    rows = slice(max(first, 0), end)
    columns = (heights, table.volume_m3, table.u_m3, table.U_m3, table.k, table.for_use(heights))
    return [
        RowOnHighLegs(*map(float, row[:-1]), bool(row[-1]))
        for row in zip(*(np.asarray(column)[rows] for column in columns), strict=True)
    ]


def roof_corrections_of(result):
    """Return the `RoofCorrection`s within 15 % of the density of the table; None without a roof."""
    roof = next((part for part in result.body.parts if part.kind == "roof"), None)
    if roof is None:
        return None
    reference = roof.reference_density_kg_m3
    grid = DENSITY_STEP * np.arange(
        np.ceil(0.85 * reference / DENSITY_STEP), np.floor(1.15 * reference / DENSITY_STEP) + 1
    )
    return [RoofCorrection(float(x), float(roof.density_correction_m3(x))) for x in grid]


def zero_of(result):
    """Return the code of the zero of the heights of the table."""
    for method in given_methods(result.job):
        if zero := method.zero(result.job):
            return zero
    if result.job.datum.dip_plate_z_m is not None:
        return "dip_plate"
    return "bottom" if result.job.tank.kind == "vertical" else f"{result.job.tank.kind}_bottom"


def gross_of(result):
    """Return the `GrossShell` of a tank; None for a tank without courses."""
    shell = result.gross
    if shell is None:
        return None
    # Up to the top row, as the corrections, so that gross volume and corrections add up.
    top_row_m = result.table.height_m[-1] + result.zero_m
    over_m = top_row_m - result.body.highest_m
    area = float(shell.area_m2(shell.height_m)[0])
    volume = float(shell.volume_m3(shell.height_m)[0]) + over_m * area
    return GrossShell(volume, volume / (shell.height_m + over_m))


# ---- budgets, deliveries, Monte Carlo, decision rule


class BudgetLine(Saved):
    """Contribution of an input to the uncertainty of a volume; null: no such quantity."""

    input: str = key("name", of="name")
    kind: str = key("of input, see below", of="name")
    estimate: float | None = key("in `unit`")
    u: float | None = key("standard uncertainty, in `unit`")
    unit: str | None = key("of estimate and u")
    type: str = key('"A" or "B"')
    distribution: str = key("normal, rectangular, ...")
    dof: float | None = key("degrees of freedom; null: infinite")
    sensitivity: float | None = key("change of the volume by one unit")
    sensitivity_unit: str | None = key("of the sensitivity")
    contribution_m3: float = key("sensitivity times u", of="contribution")
    share: float = key("of the variance; all shares add up to 1; negative by a correlation")
    halved: float | None = key("factor of U if u were half as large")
    is_default: bool | None = key("whether the input was not declared")
    correlations: list = key("[input, r] of correlated inputs")
    note: str = key("as declared; of the wall: learned, half_learned or assumed")


class VolumeJudged(Saved):
    """Comparison of the intervals of a volume by GUM and by Monte Carlo."""

    d_low: float = key("distance of the lower ends, m3")
    d_high: float = key("distance of the upper ends, m3")
    tolerance: float = key("numerical tolerance of u, m3")
    validated: bool = key("whether both distances are within it")
    sure: bool = key("whether two standard errors would not change the verdict")
    low: float = key("lower end of the stated interval, m3")
    high: float = key("upper end of the stated interval, m3")


class StatedBudget(Saved):
    """A volume or a delivery stated in the report, with its budget and its interval."""

    low_m: float | None = key("lower dip of a delivery; null: the volume below high_m")
    high_m: float = key("dip")
    volume_m3: Finite = key("of the table")
    table_u_m3: float = key("standard uncertainty without the reading of the table")
    u_m3: Finite = key("standard uncertainty with the reading of the table")
    dof: float = key("degrees of freedom; null: infinite")
    k: Finite = key("coverage factor")
    U_m3: Finite = key("expanded uncertainty")
    for_use: bool = key("whether the dips are outside the critical zone of a roof")
    stated_U_m3: Finite = key("the larger distance of the ends from the volume")
    low_m3: Finite = key("lower end of the stated interval")
    high_m3: Finite = key("upper end of the stated interval")
    interval: str = key('its source: "gum" or "monte_carlo"')
    stated_m3: float | None = key("as in stated.csv")
    note: str = key("as in stated.csv")
    monte_carlo: VolumeJudged | None = key("of a delivery")
    lines: list[BudgetLine] = key("of its budget")


class LimitOfTank(Saved):
    """Volume below an operating level or between two; the entry of budgets with its dips has U."""

    code: str = key(
        "full, maximum, minimum, pump_suction, below_table, working_capacity, pumpable or reserve"
    )
    low_m: float | None = key("lower dip; null: the volume below high_m")
    high_m: float = key("dip")


class DipColumns(Saved):
    """Dips of deliveries."""

    low_m: list[float] = key("lower dips")
    high_m: list[float] = key("upper dips")


class SimulatedVolumes(Saved):
    """Monte Carlo by volume, m3: estimates, standard errors, and comparison with the GUM."""

    value: list[float] = key("mean")
    u: list[float] = key("standard deviation")
    low: list[float] = key("probabilistically symmetric interval")
    high: list[float] = key("probabilistically symmetric interval")
    shortest_low: list[float] = key("shortest interval")
    shortest_high: list[float] = key("shortest interval")
    se_value: list[float] = key("standard error")
    se_u: list[float] = key("standard error")
    se_low: list[float] = key("standard error")
    se_high: list[float] = key("standard error")
    se_shortest_low: list[float] = key("standard error")
    se_shortest_high: list[float] = key("standard error")
    tolerance: list[float] = key("numerical tolerance of u")
    reached: list[bool] = key("whether two standard errors are within it")
    draws: list[int] = key("evaluations of the model")
    controlled: list[bool] = key("whether the linear part was the control variate")
    d_low: list[float] = key("distance of the lower ends of both intervals")
    d_high: list[float] = key("distance of the upper ends of both intervals")
    validated: list[bool] = key("whether the GUM interval is validated")
    sure: list[bool] = key("whether two standard errors would not change the verdict")


class SimulatedRows(SimulatedVolumes):
    """Monte Carlo of the rows."""

    bent: list[bool] = key("whether volumes of the tank were drawn, not of a parabola")


class SimulatedDeliveries(SimulatedVolumes, DipColumns):
    """Monte Carlo of the deliveries."""


class MonteCarlo(Saved):
    """Simulation of the rows, and validation of their GUM intervals."""

    seed: int = key("of all draws")
    probability: float = key("of the intervals", of="found.probability")
    digits: int = key("significant digits of u in the verdict")
    curved: list[list[str]] = key("pairs of inputs with relevant second derivatives")
    drawn: int = key("rows; further rows of a long table follow their neighbours")
    validated: int = key("rows with a validated GUM interval")
    rows: SimulatedRows = key("of the table")
    deliveries: SimulatedDeliveries = key("stated in the report")


class RuleOfTable(Saved):
    """The decision rule."""

    name: str = key("as shipped or written")
    source: str = key("where its values were read")
    verified: bool = key("whether all values were read in the legal text itself")
    remark: str = key("to be printed with the rule")
    largest_capacity_m3: float | None = key("of tanks to which it applies; null: all")
    statements: list[str] | None = key(
        "required in a certificate, as written there", optional=True, default=None
    )
    plate: list[str] | None = key(
        "entries of the identification plate, in their order", optional=True, default=None
    )


class UncertaintyJudged(Saved):
    """A limit of the expanded uncertainty U, and its verdict."""

    name: str = key("of the limit", of="limit.name")
    of: str = key('"volumes", "capacity" or "deliveries"', of="limit.of")
    limit: float | None = key("part of relative_to; null: only stated", of="limit.limit")
    relative_to: str = key('"itself" or "capacity"', of="limit.relative_to")
    minimum_height_m: float | None = key("of a delivery", of="limit.minimum_height_m")
    clause: str = key("of the rule", of="limit.clause")
    verified: bool = key("whether it was read in the clause", of="limit.verified")
    code: str = key("of the verdict")
    passed: bool | None = key("null: no limit, or not evaluated")
    from_m: float | None = key("dip from which the limit is met")
    from_m3: float | None = key("volume at this dip")
    worst_low_m: float | None = key("lower dip of the worst delivery")
    worst_m: float | None = key("dip of the worst volume")
    worst_m3: float | None = key("the worst volume")
    worst_U_m3: float | None = key("its expanded uncertainty")
    worst_ratio: float | None = key("U over its reference; null: also infinite")


class DeviationJudged(Saved):
    """A limit of the deviation from a stated volume, and its verdict."""

    name: str = key("of the limit", of="limit.name")
    of: str = key('"volumes", "capacity" or "deliveries"', of="limit.of")
    limit: float | None = key("part of the stated volume", of="limit.limit")
    limit_m3: float | None = key("or an amount", of="limit.limit_m3")
    side: str = key('"both", "upper" or "lower"', of="limit.side")
    guard: str = key('guard band: "none" or "U"', of="limit.guard")
    clause: str = key("of the rule", of="limit.clause")
    verified: bool = key("whether it was read in the clause", of="limit.verified")
    stated_m3: float = key("stated volume", of="stated.volume_m3")
    low_m: float | None = key("lower dip of a delivery", of="stated.low_m")
    high_m: float = key("dip", of="stated.high_m")
    code: str = key("of the verdict")
    passed: bool | None = key("null: the dip is not for use")
    volume_m3: float = key("of the table")
    u_m3: float = key("as printed")
    U_m3: float = key("as printed")
    k: float = key("of the table")
    dof: float = key("of the table; null: infinite")
    deviation_m3: float = key("table less stated")
    tolerance_m3: list[float] = key("T_L and T_U of the volume; null: not limited")
    accepted_m3: list[float] = key("A_L and A_U; null: not limited")
    guard_m3: float = key("guard band w")
    probability: float = key("of conformity")


class TableJudged(Saved):
    """The verdict of the job's decision rule on the table."""

    rule: RuleOfTable = key("the rule")
    tank: str = key("kind of tank to which it was applied")
    code: str = key("of the verdict, see below")
    verified: bool = key("whether all used values were read in the legal text itself")
    capacity_m3: float = key("of the highest row for use; null: no such row")
    uncertainty: list[UncertaintyJudged] = key("limits of U")
    deviation: list[DeviationJudged] = key("limits of the deviation from stated volumes")
    unjudged: list[str] = key("names of limits without a value to compare")


def budget_of(result):
    """Return the `BudgetLine`s of the top row, of the table alone."""
    return budget_lines(budget(result.table, result.table.height_m[-1]).lines)


def budget_lines(rows):
    """Return the `BudgetLine` of each `components.BudgetRow`."""
    return [
        fill_from(
            BudgetLine,
            row,
            unit=row.unit or None,
            sensitivity_unit=_sensitivity_unit(row.unit),
        )
        for row in rows
    ]


def _sensitivity_unit(unit):
    """Return the unit of cubic metres per unit of the input; "1" for an input in cubic metres."""
    if not unit:
        return None
    return {"1/K": "m3 K", "m3": "1"}.get(unit, f"m3/{unit}")


def budgets_of(result):
    """Return the `StatedBudget` of each volume, then of each delivery, stated in the report."""
    simulation = result.simulation
    declared = {(stated.low_m, stated.high_m): stated for stated in result.job.stated}
    budgets = [
        _stated_budget(volume, declared, None, _volume_interval(volume, result))
        for volume in result.stated.volumes
    ]
    for index, delivery in enumerate(result.stated.deliveries):
        judged = interval = None
        if simulation:
            judged = VolumeJudged(**_values_at(simulation.of_deliveries[1], index))
            interval = _values_at(simulation.of_delivered, index)
        budgets.append(
            _stated_budget(delivery, declared, judged, _delivery_interval(delivery, interval))
        )
    return budgets


def _volume_interval(volume, result):
    """Return the stated interval of a volume: of its row; between rows, with their largest U."""
    rows = result.table.rows_of(volume.high_m)
    intervals = result.intervals
    if np.all(intervals.by_gum[rows]):
        return _symmetric_interval(volume, volume.U_m3, "gum")
    if len(rows) > 1:
        U_m3 = float(np.hypot(intervals.U_m3[rows].max(), volume.reading_U_m3))
        source = "gum" if volume.U_m3 >= U_m3 else "monte_carlo"
        return _symmetric_interval(volume, max(volume.U_m3, U_m3), source)
    (row,) = rows
    return _add_reading(volume, intervals.low_m3[row], intervals.high_m3[row])


def _delivery_interval(delivery, interval):
    """Return the stated interval of a delivery, from its interval by the table alone, or None."""
    if interval is None or interval["by_gum"]:
        return _symmetric_interval(delivery, delivery.U_m3, "gum")
    return _add_reading(delivery, interval["low_m3"], interval["high_m3"])


def _add_reading(volume, low_m3, high_m3):
    """Return the Monte Carlo interval of the table, each side extended by U of the reading.

    Errors of reading are independent and symmetric, hence the sum of squares. The volume below a
    dip is not negative.
    """
    down_m3 = float(np.hypot(volume.volume_m3 - low_m3, volume.reading_U_m3))
    up_m3 = float(np.hypot(high_m3 - volume.volume_m3, volume.reading_U_m3))
    low_m3 = volume.volume_m3 - down_m3
    low_m3 = max(low_m3, 0.0) if volume.low_m is None else low_m3
    return {
        "stated_U_m3": max(down_m3, up_m3),
        "low_m3": low_m3,
        "high_m3": volume.volume_m3 + up_m3,
        "interval": "monte_carlo",
    }


def _symmetric_interval(volume, U_m3, source):
    return {
        "stated_U_m3": U_m3,
        "low_m3": volume.volume_m3 - U_m3,
        "high_m3": volume.volume_m3 + U_m3,
        "interval": source,
    }


def _stated_budget(volume, declared, judged, interval):
    stated = declared.get((volume.low_m, volume.high_m))
    return fill_from(
        StatedBudget,
        volume,
        **interval,
        stated_m3=stated and stated.volume_m3,
        note=stated.note if stated else "",
        monte_carlo=judged,
        lines=budget_lines(volume.lines),
    )


def _values_at(columns, index):
    """Return the fields of a `Verdict` or `Intervals` for one volume, {name: value}."""
    return {column.name: getattr(columns, column.name)[index] for column in fields(columns)}


def monte_carlo_of(result):
    """Return the `MonteCarlo` of the table; None if it is off."""
    simulation = result.simulation
    if simulation is None:
        return None
    return fill_from(
        MonteCarlo,
        simulation,
        validated=int(np.sum(simulation.judged.validated)),
        rows=SimulatedRows(
            **_simulated_volumes(simulation.found, simulation.judged), bent=simulation.bent
        ),
        deliveries=SimulatedDeliveries(
            low_m=simulation.delivered.low_m,
            high_m=simulation.delivered.high_m,
            **_simulated_volumes(*simulation.of_deliveries),
        ),
    )


def _simulated_volumes(simulated, judged):
    names = ("d_low", "d_high", "tolerance", "validated", "sure")
    return {**simulated.by_volume, **{name: getattr(judged, name) for name in names}}


def rule_of(verdict):
    """Return the `TableJudged` of a `RuleVerdict`; None without rule."""
    return verdict and fill_from(
        TableJudged,
        verdict,
        rule=fill_from(
            RuleOfTable,
            verdict.rule,
            statements=verdict.rule.statements or None,
            plate=verdict.rule.plate or None,
        ),
        uncertainty=[fill_from(UncertaintyJudged, judged) for judged in verdict.uncertainty],
        deviation=[fill_from(DeviationJudged, judged) for judged in verdict.deviation],
    )


SIGHTS = {  # kinds of readings of instruments; a tape used with photographs is no sight
    "direction", "horizontal angle", "vertical angle", "zenith angle", "azimuth",
    "height difference", "slope distance",
}  # fmt: skip
_OF_EVERY_TANK = ("thickness", "temperature")


class Choice(Saved):
    """An assumption; the template supplies the sentence in its language."""

    code: str = key("see below")
    value: str | float | bool | list | None = key("of the choice")


def choices_of(result):
    """Return the `Choice`s of a result: all its assumptions."""
    job, survey = result.job, next(iter(result.surveys.values()), None)
    of_methods, of_solids = {}, {}
    is_early = job.tank.kind in ("vertical", "horizontal")
    for method in given_methods(job):
        # A record of a sphere has the choices on its survey after those on its temperature.
        choices = of_methods if is_early or method.is_supplement else of_solids
        choices |= method.choices(result)
    # A record states these choices after those on the wall.
    later = {code: of_methods.pop(code) for code in _OF_EVERY_TANK if code in of_methods}
    values = {
        "zero": zero_of(result),
        **(_shell_choices(job, result) if result.wall is not None else {}),
        **of_methods,
        **({"form": "learned"} if result.scan is not None and job.horizontal is not None else {}),
        "thickness": _thickness_choice(job, result),
        "temperature": _temperature_choice(job),
        **of_solids,
        **_sphere_choices(job),
        "height_expansion": "yes" if job.table.height_expansion else "no",
        "head": _head_choice(as_surveyed(job, survey)),
        "deadwood": _switch_choice(job.switches.deadwood, job.deadwood),
        "interpolation": "linear",
        "coverage": job.table.coverage_probability,
        "k": "normal" if np.all(np.isinf(result.table.dof)) else "student",
        "expansion": "given" if job.material.expansion_given else "default",
        "not_in_budget": list(undeclared_inputs(job, survey, result.body)),
    } | later
    if result.adjustment is not None:
        adjustment = _adjustment_values(result.adjustment, getattr(job, "measurements", None))
        values = adjustment | values
    return [Choice(*choice) for choice in values.items()]


def adjustment_choices(adjustment, measurements):
    """Return the `Choice`s of an adjustment of a survey."""
    return [Choice(*choice) for choice in _adjustment_values(adjustment, measurements).items()]


def _adjustment_values(adjustment, measurements):
    settings = getattr(measurements, "settings", None)
    kinds = {group.kind for group in adjustment.groups}
    photographs = "image coordinate" in kinds
    sights = kinds & SIGHTS
    test = "none"
    if adjustment.redundancy > 0:
        test = "passed" if adjustment.adjusted.test().passed else "failed"
    weights = getattr(settings, "image_weights", "measured")
    return {
        **({"image_weights": weights} if photographs else {}),
        "survey": "both" if photographs and sights else "photographs" if photographs else "sights",
        "adjustment_datum": adjustment.datum.choice,
        "adjustment_snooping": CRITICAL if getattr(settings, "snooping", True) else "off",
        "adjustment_test": test,
        "adjustment_scale": getattr(settings, "scale", "a_priori"),
    }


# ---- choices of each kind of wall


def _shell_choices(job, result):
    """Return the choices on a shell with surveyed points, and on the use of its points."""
    wall = result.wall
    return {
        "bottom": bottom_choice(job),
        **_survey_choices(job, result),
        "course_of_points": "section" if any(job.points.section) else "height",
        "shape": "smoothed",
        "between_sections": "field",
        "tilt": _tilt_choice(job, wall.shell),
        "course_heights": "along_axis",
        **top_choice(job),
        "roof": roof_choice(job),
        "snooping": CRITICAL if job.snooping else "off",
        "form": "learned",
        "covariance_sd_mm": 1000 * np.sqrt(np.median(wall.covariance_m2.diagonal())),
    }


def _survey_choices(job, result):
    """Return the choices on the origin of the points and of their covariance."""
    choices = {"covariance": _covariance_choice(job) if result.adjustment is None else "adjusted"}
    for method in given_methods(job):
        choices = method.choices(result) if method.is_sighted else choices
    for method in accompanying_methods(job):
        choices |= method.choices(result)
    return choices


def _sphere_choices(job):
    """Pressure of the table of a sphere, bar."""
    if job.sphere is not None and job.switches.head and job.table.pressure_pa:
        return {"pressure": job.table.pressure_pa / 1e5}
    return {}


# ---- single choices


def bottom_choice(job):
    """Form of the bottom of an upright tank; "off" if it is not corrected."""
    return job.bottom.form if job.switches.bottom else "off"


def top_choice(job):
    """Return the choice on the head on top; {} without head."""
    return {} if job.top is None else {"top": job.top.form if job.switches.top else "off"}


def roof_choice(job):
    """Weighing of a floating roof; "off" or "none" without a correction."""
    weighing = job.roof and job.roof.weighing
    return _switch_choice(job.switches.roof, weighing, weighing)


def _tilt_choice(job, shell):
    if not shell.tilt_known:
        return "not_determined"
    return "horizontal_cut" if job.switches.tilt else "off"


def _temperature_choice(job):
    if job.survey.shell_temperature_c is None:
        return "not_applied"
    return "applied" if job.switches.temperature else "off"


def _head_choice(job):
    """Return the density of the liquid of the table; "unloaded": only that of the survey."""
    if not job.switches.head:
        return "off"
    if job.table.liquid_density_kg_m3:
        return job.table.liquid_density_kg_m3
    return "unloaded" if job.survey.liquid_density_kg_m3 else "none"


def _switch_choice(is_on, declared, value="declared"):
    """Return `value`, "off" if the correction is off, or "none" if nothing is declared."""
    if not declared:
        return "none"
    return value if is_on else "off"


def _covariance_choice(job):
    if job.points.sd_m is None and job.points.covariance_m2 is None:
        return "estimated"
    code = "given_sd" if job.points.covariance_m2 is None else "given_full"
    return code + "_scaled" if job.scale == "a_posteriori" else code


def _thickness_choice(job, result):
    if job.survey.side == "inside":
        is_surveyed = any(not method.is_supplement for method in given_methods(job))
        return "inside" if is_surveyed or job.courses else "dimensions"
    solid = job.horizontal or job.sphere
    parts = job.courses or job.rings
    has_thickness = any(c.thickness_m + c.paint_m for c in parts) or (solid and solid.thickness_m)
    if not has_thickness:
        return "none"
    return "subtracted" if job.switches.plate and job.switches.paint else "off"
