"""The capacity table in the record, with what stands beside its rows."""

from dataclasses import fields

import numpy as np

from tankcal.pipeline.chain import PARTS
from tankcal.record.covariance_factor import FactorBlock, blocks_of
from tankcal.record.schema import Finite, Saved, filled_from, key
from tankcal.tank.budgets import budget
from tankcal.tank.dips import ProportionalParts, dip_label

LEAST_PART_M3 = 1e-4  # last place of a printed part: an error below it is not told apart


class CapacityTable(Saved):
    """The capacity table and its covariance: its factor, in blocks, times the transpose of that."""

    zero: str = key("what heights count from, a code")
    zero_m: Finite = key("height of the zero above the bottom")
    height_m: list[Finite] = key("dips of the rows, above the zero")
    dip: list[str] = key("the same as text in the table's unit")
    volume_m3: list[Finite] = key("below the dip")
    u_m3: list[Finite] = key("standard uncertainty")
    U_m3: list[Finite] = key("expanded uncertainty")
    k: list[Finite] = key("coverage factor")
    dof: list[float] = key("degrees of freedom; null: infinite")
    area_m2: list[float] = key("derivative of the volume by the dip")
    for_use: list[bool] = key("false inside the critical zone of a floating roof")
    low_m3: list[Finite] = key("interval that counts")
    high_m3: list[Finite] = key("interval that counts")
    interval: list[str] = key('where it comes from: "gum", or "monte_carlo", which does not agree')
    stated_U_m3: list[Finite] = key("as printed: the larger distance of the ends from the volume")
    inputs: list[str] = key("name of each column of the factor")
    input_kind: list[str] = key("kind of input, see below")
    factor: list[FactorBlock] = key("rows x inputs, in blocks of rows")


class InterpolationError(Saved):
    """The largest error of linear interpolation between two rows."""

    largest_m3: float = key("of a volume")
    at_m: float = key("dip where it is")


class PartsOfRows(Saved):
    """What 1 to 9 millimetres add to a row of a centimetre table."""

    parts: int = key("of a row")
    zones: list[ProportionalParts] = key("between joints and edges; only where the error is small")
    largest_m3: float | None = key("largest error, at least the last place that is printed")


class VolumesOfDensity(Saved):
    """The volumes of the same rows for a further density of the liquid."""

    density_kg_m3: float = key("of the liquid")
    volume_m3: list[Finite] = key("of each row")


class GrossShell(Saved):
    """The shell as surveyed, without any correction, over its full height."""

    volume_m3: float = key("of the shell")
    area_m2: float = key("mean")


def capacity_of(result):
    """The `CapacityTable` of a result, each column of the factor named."""
    table = result.table
    kinds = [source.kind for source in table.sources for _ in range(source.columns_m3.shape[1])]
    counts = {kind: kinds.count(kind) for kind in kinds}
    numbers = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
    return filled_from(
        CapacityTable,
        table,
        zero=zero_of(result),
        zero_m=result.zero_m,
        dip=[dip_label(height, result.job.table.height_unit) for height in table.height_m],
        for_use=table.for_use(table.height_m),
        **intervals_of(result),
        inputs=[
            kind if counts[kind] == 1 else f"{kind} {number}"
            for kind, number in zip(kinds, numbers, strict=True)
        ],
        input_kind=kinds,
        factor=blocks_of(table.factor_m3),
    )


def proportional_parts_of(result):
    """`PartsOfRows`: what the millimetres of a dip add to a row, zone by zone."""
    zones = result.proportional_parts
    largest_m3 = max((_printed_error_m3(zone) for zone in zones), default=None)
    return PartsOfRows(PARTS, zones, largest_m3)


def _printed_error_m3(zone):
    return max(abs(zone.deviation_m3), LEAST_PART_M3)


def densities_of(result):
    """The `VolumesOfDensity` of each further density of the liquid."""
    return [VolumesOfDensity(*one) for one in result.by_density.items()]


def zero_of(result):
    """What heights of the table count from, as a code."""
    if result.job.ship is not None:
        return "pipe_bottom"
    if result.job.datum.dip_plate_z_m is not None:
        return "dip_plate"
    return "bottom" if result.job.tank.kind == "vertical" else f"{result.job.tank.kind}_bottom"


def gross_of(result):
    """`GrossShell` of a tank; None for a tank without courses."""
    shell = result.gross
    if shell is None:
        return None
    top_row_m = result.table.height_m[-1] + result.zero_m
    over_m = top_row_m - result.body.highest_m  # as the corrections, so that they add up
    area = float(shell.area_m2(shell.height_m)[0])
    volume = float(shell.volume_m3(shell.height_m)[0]) + over_m * area
    return GrossShell(volume, volume / (shell.height_m + over_m))


# ---- budgets, deliveries, Monte Carlo, decision rule


class BudgetLine(Saved):
    """What an input contributes to the uncertainty of a volume; null: it does not have that."""

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
    share: float = key("of the variance; they add up to 1, correlations may take away")
    halved: float | None = key("factor of U if u were half as large")
    is_default: bool | None = key("whether nobody declared the input")
    correlations: list = key("[input, r] of the inputs that it is correlated with")
    note: str = key("as declared; of the wall: learned, half_learned or assumed")


class VolumeJudged(Saved):
    """The comparison of the intervals of one volume, GUM and Monte Carlo."""

    d_low: float = key("distance of the lower ends, m3")
    d_high: float = key("distance of the upper ends, m3")
    tolerance: float = key("numerical tolerance of u, m3")
    validated: bool = key("whether both distances are within it")
    sure: bool = key("whether two standard errors would not change that")
    low: float = key("interval that counts, m3")
    high: float = key("interval that counts, m3")


class StatedBudget(Saved):
    """A volume or a delivery that the report states, with its budget and its interval."""

    low_m: float | None = key("lower dip of a delivery; null: the volume below high_m")
    high_m: float = key("dip")
    volume_m3: Finite = key("of the table")
    table_u_m3: float = key("standard uncertainty without what reading the table adds")
    u_m3: Finite = key("with it")
    dof: float = key("degrees of freedom; null: infinite")
    k: Finite = key("coverage factor")
    U_m3: Finite = key("expanded uncertainty")
    for_use: bool = key("whether the dips are outside the critical zone of a roof")
    stated_U_m3: Finite = key("that counts: the larger distance of the ends from the volume")
    low_m3: Finite = key("interval that counts")
    high_m3: Finite = key("interval that counts")
    interval: str = key('where it comes from: "gum" or "monte_carlo"')
    stated_m3: float | None = key("as in stated.csv")
    note: str = key("as in stated.csv")
    monte_carlo: VolumeJudged | None = key("of a delivery")
    lines: list[BudgetLine] = key("of its budget")


class DipColumns(Saved):
    """Dips of deliveries."""

    low_m: list[float] = key("lower dips")
    high_m: list[float] = key("upper dips")


class SimulatedVolumes(Saved):
    """Monte Carlo by volume, m3: estimates, their standard errors, the comparison with the GUM."""

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
    validated: list[bool] = key("whether the GUM interval stands")
    sure: list[bool] = key("whether two standard errors would not change that")


class SimulatedRows(SimulatedVolumes):
    """Monte Carlo of the rows."""

    bent: list[bool] = key("whether the tank's own volumes were drawn, not a parabola")


class SimulatedDeliveries(SimulatedVolumes, DipColumns):
    """Monte Carlo of the deliveries."""


class MonteCarlo(Saved):
    """The simulation of every row, and whether the GUM interval stands."""

    seed: int = key("of all draws")
    probability: float = key("of the intervals", of="found.probability")
    digits: int = key("of u that the verdict counts")
    curved: list[list[str]] = key("pairs of inputs whose second derivatives count")
    drawn: int = key("rows; the others of a long table follow their neighbours")
    validated: int = key("rows whose GUM interval stands")
    rows: SimulatedRows = key("of the table")
    deliveries: SimulatedDeliveries = key("that the report states")


class RuleOfTable(Saved):
    """The decision rule."""

    name: str = key("as shipped or written")
    source: str = key("where its values were read")
    verified: bool = key("whether all of them were read in the legal text itself")
    remark: str = key("what is to stand beside it")
    largest_capacity_m3: float | None = key("tanks up to which it is for; null: all")


class UncertaintyJudged(Saved):
    """A limit of the expanded uncertainty U, and what became of it."""

    name: str = key("of the limit", of="limit.name")
    of: str = key('"volumes", "capacity" or "deliveries"', of="limit.of")
    limit: float | None = key("part of relative_to; null: only stated", of="limit.limit")
    relative_to: str = key('"itself" or "capacity"', of="limit.relative_to")
    minimum_height_m: float | None = key("of a delivery", of="limit.minimum_height_m")
    clause: str = key("where it stands", of="limit.clause")
    verified: bool = key("whether it was read there", of="limit.verified")
    code: str = key("of the verdict")
    passed: bool | None = key("null: nothing is limited, or nothing was judged")
    from_m: float | None = key("dip from which the limit is kept")
    from_m3: float | None = key("volume there")
    worst_low_m: float | None = key("lower dip of the worst delivery")
    worst_m: float | None = key("dip of the worst volume")
    worst_m3: float | None = key("the worst volume")
    worst_U_m3: float | None = key("its expanded uncertainty")
    worst_ratio: float | None = key("U over what it is relative to; null: also infinite")


class DeviationJudged(Saved):
    """A limit of the deviation from a stated volume, and what became of it."""

    name: str = key("of the limit", of="limit.name")
    of: str = key('"volumes", "capacity" or "deliveries"', of="limit.of")
    limit: float | None = key("part of the stated volume", of="limit.limit")
    limit_m3: float | None = key("or an amount", of="limit.limit_m3")
    side: str = key('"both", "upper" or "lower"', of="limit.side")
    guard: str = key('guard band: "none" or "U"', of="limit.guard")
    clause: str = key("where it stands", of="limit.clause")
    verified: bool = key("whether it was read there", of="limit.verified")
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
    tank: str = key("kind of tank that it was asked for")
    code: str = key("of the verdict, see below")
    verified: bool = key("whether every value that was used was read in the legal text itself")
    capacity_m3: float = key("of the highest row for use; null: no row is")
    uncertainty: list[UncertaintyJudged] = key("limits of U")
    deviation: list[DeviationJudged] = key("limits of the deviation from stated volumes")
    unjudged: list[str] = key("names of limits that nothing was held against")


def budget_of(result):
    """The `BudgetLine`s of the top row, by the table alone."""
    return budget_lines(budget(result.table, result.table.height_m[-1]).lines)


def budget_lines(rows):
    """The `BudgetLine` of each `gum.BudgetRow`."""
    return [
        filled_from(
            BudgetLine,
            one,
            unit=one.unit or None,
            sensitivity_unit=_sensitivity_unit(one.unit),
        )
        for one in rows
    ]


def _sensitivity_unit(unit):
    """Cubic metres by the unit of the input; that of an input in cubic metres is 1."""
    if not unit:
        return None
    return {"1/K": "m3 K", "m3": "1"}.get(unit, f"m3/{unit}")


def budgets_of(result):
    """The `StatedBudget` of each volume and delivery that the report states."""
    simulation = result.simulation
    asked = {(one.low_m, one.high_m): one for one in result.job.stated}
    found = [_budget_of(one, asked, None, _of_volume(one, result)) for one in result.stated.volumes]
    delivered = simulation and simulation.of_delivered
    for number, one in enumerate(result.stated.deliveries):
        judged = simulation and _of_place(simulation.of_deliveries[1], number)
        interval = simulation and _of_place(delivered, number)
        found.append(_budget_of(one, asked, judged, _of_delivery(one, interval)))
    return found


def _of_volume(one, result):
    """The interval of a volume that counts: that of its row; U between rows is the largest."""
    rows = result.table.rows_of(one.high_m)
    intervals = result.intervals
    if np.all(intervals.by_gum[rows]):
        return _even(one.volume_m3, one.U_m3, "gum")
    if len(rows) > 1:
        U = float(np.hypot(intervals.U_m3[rows].max(), one.reading_U_m3))
        return _even(one.volume_m3, max(one.U_m3, U), "gum" if one.U_m3 >= U else "monte_carlo")
    (row,) = rows
    return _with_reading(one, intervals.low_m3[row], intervals.high_m3[row])


def _of_delivery(one, interval):
    """The same of a delivery, by its own interval of the table, or None."""
    if interval is None or interval["by_gum"]:
        return _even(one.volume_m3, one.U_m3, "gum")
    return _with_reading(one, interval["low_m3"], interval["high_m3"])


def _with_reading(one, low_m3, high_m3):
    """Monte Carlo's interval of the table, each side made longer by what reading adds, in squares.

    The errors of reading are each reading's own and as likely up as down; but no tank holds less
    than nothing.
    """
    down = float(np.hypot(one.volume_m3 - low_m3, one.reading_U_m3))
    up = float(np.hypot(high_m3 - one.volume_m3, one.reading_U_m3))
    low = one.volume_m3 - down
    low = max(low, 0.0) if one.low_m is None else low
    return _interval(max(down, up), low, one.volume_m3 + up, "monte_carlo")


def _even(volume_m3, U_m3, source):
    return _interval(U_m3, volume_m3 - U_m3, volume_m3 + U_m3, source)


def _interval(U_m3, low_m3, high_m3, source):
    return {"stated_U_m3": U_m3, "low_m3": low_m3, "high_m3": high_m3, "interval": source}


def _budget_of(one, asked, judged, interval):
    stated = asked.get((one.low_m, one.high_m))
    return filled_from(
        StatedBudget,
        one,
        **interval,
        stated_m3=stated and stated.volume_m3,
        note=stated.note if stated else "",
        monte_carlo=judged and VolumeJudged(**judged),
        lines=budget_lines(one.lines),
    )


def _of_place(columns, number):
    """What a `Verdict` or `Intervals` say of one volume."""
    return {one.name: getattr(columns, one.name)[number] for one in fields(columns)}


def monte_carlo_of(result):
    """`MonteCarlo` of the table; None where it is off."""
    simulation = result.simulation
    if simulation is None:
        return None
    rows = _of_volumes(simulation.found, simulation.judged)
    return filled_from(
        MonteCarlo,
        simulation,
        validated=int(np.sum(simulation.judged.validated)),
        rows=SimulatedRows(**rows, bent=simulation.bent),
        deliveries=SimulatedDeliveries(
            low_m=simulation.delivered.low_m,
            high_m=simulation.delivered.high_m,
            **_of_volumes(*simulation.of_deliveries),
        ),
    )


def _of_volumes(found, judged):
    names = ("d_low", "d_high", "tolerance", "validated", "sure")
    return {**found.by_volume, **{name: getattr(judged, name) for name in names}}


def intervals_of(result):
    """{key: (rows,)} the interval of each row that counts, and the U that it is stated with."""
    found = result.intervals
    return {
        "low_m3": found.low_m3,
        "high_m3": found.high_m3,
        "interval": np.where(found.by_gum, "gum", "monte_carlo"),
        "stated_U_m3": found.U_m3,
    }


def rule_of(verdict):
    """`TableJudged` of a `RuleVerdict`; None without one."""
    return verdict and filled_from(
        TableJudged,
        verdict,
        rule=filled_from(RuleOfTable, verdict.rule),
        uncertainty=[filled_from(UncertaintyJudged, one) for one in verdict.uncertainty],
        deviation=[filled_from(DeviationJudged, one) for one in verdict.deviation],
    )
