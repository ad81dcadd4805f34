"""The part of the record that says what metered runs showed: steps, dips, causes, tables."""

import numpy as np

from tankcal.gum.coverage import coverage_factor
from tankcal.record.schema import Finite, Saved, fill_from, key


class MeterUsed(Saved):
    """A meter that the tank was filled or emptied through."""

    meter: str = key("name")
    certificate: str = key('its number; "": not given')
    prover: str = key('what it was proved against; "": not given')
    factor: float = key("of the certificate: true volume = factor x indicated")
    u_factor: float = key("its standard uncertainty")
    factor_found: float = key("by the adjustment with the geometry")
    u_factor_found: float = key("standard uncertainty of that")
    factor_after: float | None = key("as proved again afterwards; null: it was not")
    repeatability: float = key("standard deviation of a batch, relative")
    fixed_m3: float = key("part of it that does not grow with the batch")
    indicated_m3: float = key("all that it showed, drawn off counted as well")
    flow_lowest_m3_h: float | None = key("of its rows; null: not written down")
    flow_highest_m3_h: float | None = key("the same")
    flow_min_m3_h: float | None = key("that the factor was proved for; null: not given")
    flow_max_m3_h: float | None = key("the same")


class RunOfLiquid(Saved):
    """A run: one filling or emptying, and what all its steps are off by."""

    run: str = key("name")
    steps: int = key("between dips that count")
    from_dip_m: float | None = key("that it began at; null: the empty, dry tank")
    to_dip_m: float = key("that it ended at")
    indicated_m3: float = key("of its steps, by the meter")
    effect: float = key("of the run, relative, as adjusted")
    u_effect: float = key("its standard uncertainty")


class LiquidStep(Saved):
    """A step between two dips, brought to the reference, against the geometry."""

    row: int = key("of the file, at its end")
    run: str = key("name")
    meter: str = key("name")
    from_dip_m: float | None = key("null: from the empty, dry tank")
    to_dip_m: float = key("at its end")
    indicated_m3: float = key("as the meter showed it")
    by_factor_m3: float = key("correction by the meter's factor")
    by_meter_temperature_m3: float = key("by the liquid cooled or warmed on its way into the tank")
    by_tank_temperature_m3: float = key("by what was in the tank already and grew or shrank")
    by_shell_m3: float = key("by the shell's temperature, to that of the table")
    by_head_m3: float = key("by the load, from the calibrating liquid to that of the table")
    reference_m3: float = key("between the dips by liquid, at the reference: the sum of these")
    geometry_m3: float = key("the same by the geometry before the adjustment")
    misclosure_m3: float = key("the former less the latter")
    misclosure_u_m3: float = key("its standard uncertainty")
    misclosure_U_m3: float = key("expanded, by k of the normal distribution")
    misclosure_w: float = key("the misclosure over its standard uncertainty")
    residual_m3: float = key("to be added to the batch, by the adjustment with the geometry")
    sd_m3: float = key("of the batch, before")
    redundancy: float = key("share of an error of it that shows")
    w: float | None = key("test quantity of the batch; null: nothing controls it")
    detectable_m3: float | None = key("smallest error of it that shows; null: more than metered")


class LiquidDip(Saved):
    """A dip that counts."""

    row: int = key("of the file")
    run: str = key("name")
    dip_m: float = key("as read")
    residual_m: float = key("to be added to it, by the adjustment with the geometry")
    sd_m: float = key("of the reading, before")
    redundancy: float = key("share of an error of it that shows")
    w: float | None = key("test quantity of the reading; null: nothing controls it")


class LiquidCause(Saved):
    """A cause that misclosures may have, tested by itself: the likeliest of each kind."""

    kind: str = key("code of it: meter, radii, dip, dip_zero, batch, leak, bottom ...")
    of: str | None = key("which meter or run; null: none, or a row")
    row: int | None = key("which row of the file; null: none")
    unit: str = key('of its size, in SI: "1", "m", "m3", "m3/h"; "": it is so, or not')
    size: float = key("to be added to what was taken, to explain most; of a leak: lost")
    sd: float | None = key("standard deviation of that; null: the steps cannot show it")
    w: float = key("test quantity")
    detectable: float | None = key("smallest size that the test finds; null: beyond the tank's")
    named: bool = key("whether it is the likeliest, or cannot be told from that, and is told")


class LiquidControl(Saved):
    """How far the steps control an error that would change all volumes."""

    kind: str = key("meter or leak")
    of: str | None = key("which meter; null: of all runs")
    unit: str = key('of the size, in SI: "1", "m3/h", or "m3" in each step where times are blank')
    detectable: float | None = key("smallest size that the test finds; null: none")
    undetected_U: float | None = key(
        "largest change of a volume by an error of that size, over the U of the volume; null: any"
    )


class SizeByLiquid(Saved):
    """A declared size of the geometry that the liquid moved."""

    input: str = key("name")
    unit: str = key('of the numbers: "m", "m/m" of a slope, "1" of a scale')
    change: float = key("by how much it was moved")
    u_before: float = key("standard uncertainty before")
    u_after: float = key("the same after")


class VolumesBeside(Saved):
    """Volumes of the rows of the table, by one kind of knowledge; null where it says nothing."""

    volume_m3: list[float] = key("below each dip")
    u_m3: list[float] = key("standard uncertainty")
    U_m3: list[float] = key("expanded uncertainty, by the law of propagation")


class LiquidRecord(Saved):
    """Metered runs, their adjustment with the geometry, and the three tables that follow."""

    certified: str = key('whose table is printed: "joint", "liquid" or "geometry"')
    geometry: str = key('what stood beside the liquid: "survey", "drawing" or "sizes"')
    density_kg_m3: float = key("of the calibrating liquid, at density_c")
    u_density_kg_m3: float = key("its standard uncertainty")
    density_c: float = key("temperature of that")
    expansion_per_k: float = key("of the liquid's volume")
    u_expansion_per_k: float = key("its standard uncertainty")
    u_temperature_c: Finite = key("standard deviation of one temperature")
    u_dip_zero_m: float = key("standard uncertainty of what all dips have in common")
    lowest_dip_m: Finite = key("that counts")
    highest_dip_m: Finite = key("that counts")
    meters: list[MeterUsed] = key("in the order of their rows")
    runs: list[RunOfLiquid] = key("in their order")
    run_sd: float = key("standard deviation of the effect of a run, relative")
    run_dof: float = key("its degrees of freedom; null: it was declared")
    steps: list[LiquidStep] = key("in the order of the file")
    dips: list[LiquidDip] = key("in the order of the file")
    bottom_flex_sd: float | None = key("declared for the bottom, m3 per m of head; null: none")
    bottom_flex: float | None = key("as adjusted; null: none was declared")
    u_bottom_flex: float | None = key("its standard uncertainty")
    below_first_dip_m3: float | None = key("beyond what the geometry has there; null: not asked")
    u_below_first_dip_m3: float | None = key("its standard uncertainty")
    sizes: list[SizeByLiquid] = key("declared sizes that were moved")
    chi2: float = key("of all misclosures together")
    dof: int = key("of that")
    probability: float = key("of a larger chi-square")
    detectable_radius_m: float | None = key(
        "smallest offset of all radii that the liquid would have shown; null: it has no meaning"
    )
    causes: list[LiquidCause] = key("the likeliest of each kind, the likeliest first")
    by_geometry: VolumesBeside = key("rows of the table by the geometry alone")
    by_liquid: VolumesBeside | None = key("by the liquid alone; null: it does not tell the tank")
    joint: VolumesBeside = key("by both")
    controls: list[LiquidControl] | None = key(
        "errors that change all volumes; not there: the table is of geometry alone, or of older"
        " versions",
        optional=True,
    )


def liquid_of(result):
    """`LiquidRecord` of a result; None where nothing was metered."""
    found, metering = result.liquid, result.job.liquid
    if found is None:
        return None
    low, high = found.filled_m
    flex, bottom = found.bottom_flex, found.bottom_m3
    return fill_from(
        LiquidRecord,
        found,
        geometry=geometry_beside(result),
        **{
            name: getattr(metering, name)
            for name in (
                *("density_kg_m3", "u_density_kg_m3", "density_c", "expansion_per_k"),
                *("u_expansion_per_k", "u_temperature_c", "u_dip_zero_m"),
            )
        },
        lowest_dip_m=low,
        highest_dip_m=high,
        meters=_meters(found, metering),
        runs=_runs(found),
        steps=_steps(found, result.job.table.coverage_probability),
        dips=_rows_of(
            LiquidDip,
            found.dips,
            w=_tests(found.dips),
        ),
        bottom_flex_sd=flex and flex.u_before,
        bottom_flex=flex and flex.after,
        u_bottom_flex=flex and flex.u_after,
        below_first_dip_m3=bottom and bottom.after,
        u_below_first_dip_m3=bottom and bottom.u_after,
        sizes=_sizes(found),
        causes=_causes(found),
        by_geometry=_volumes(found.tables["geometry"]),
        by_liquid=_volumes(found.tables["liquid"]),
        joint=_volumes(found.tables["joint"]),
        controls=_controls(found),
    )


def geometry_beside(result):
    """What stood beside the liquid: "survey", "drawing" (of an upright tank) or "sizes"."""
    if result.wall is not None or result.strapped is not None or result.scan is not None:
        return "survey"
    return "drawing" if result.job.tank.kind == "vertical" else "sizes"


def _meters(found, metering):
    of, flow, volume = np.array(metering.meter), metering.flow_m3_h, metering.volume_m3
    told = []
    for one in found.factors:
        meter, mine = metering.meters[one.name], of == one.name
        flows = flow[mine & np.isfinite(flow)]
        told.append(
            fill_from(
                MeterUsed,
                meter,
                meter=one.name,
                u_factor=one.u_before,
                factor_found=one.after,
                u_factor_found=one.u_after,
                indicated_m3=np.sum(np.abs(volume[mine])),
                flow_lowest_m3_h=flows.min() if len(flows) else None,
                flow_highest_m3_h=flows.max() if len(flows) else None,
            )
        )
    return told


def _runs(found):
    steps, run = found.steps, np.array(found.steps.run)
    told = []
    for one in found.runs:
        mine = np.flatnonzero(run == one.name)
        if len(mine):
            told.append(
                RunOfLiquid(
                    run=one.name,
                    steps=len(mine),
                    from_dip_m=steps.from_dip_m[mine[0]],
                    to_dip_m=steps.to_dip_m[mine[-1]],
                    indicated_m3=steps.indicated_m3[mine].sum(),
                    effect=one.after,
                    u_effect=one.u_after,
                )
            )
    return told


def _steps(found, probability):
    steps, k = found.steps, float(coverage_factor(probability, np.inf))
    filled = np.abs(steps.indicated_m3).sum()
    return _rows_of(
        LiquidStep,
        steps,
        geometry_m3=steps.reference_m3 - steps.misclosure_m3,
        misclosure_u_m3=steps.misclosure_sd_m3,
        misclosure_U_m3=k * steps.misclosure_sd_m3,
        w=_tests(steps),
        detectable_m3=np.where(steps.detectable_m3 < filled, steps.detectable_m3, np.nan),
    )


def _tests(tested):
    """Test quantities; nan where only rounding errors are left of a reading."""
    from tankcal.pipeline.liquid_checks import CONTROLLED

    return np.where(tested.redundancy > CONTROLLED, tested.w, np.nan)


def _rows_of(cls, columns, **more):
    """An object of `cls` for each place of columns, attributes of an object or given here."""
    names = cls.__annotations__
    values = [more[name] if name in more else getattr(columns, name) for name in names]
    return [cls(*row) for row in zip(*values, strict=True)]


def _sizes(found):
    return [
        SizeByLiquid(
            input=one.name,
            unit=RATIOS.get(one.name, "m"),
            change=one.after,
            u_before=one.u_before,
            u_after=one.u_after,
        )
        for one in found.sizes
    ]


RATIOS = {"tilt": "m/m", "scale": "1"}


def _causes(found):
    """The likeliest of each kind, and whatever is named beside it."""
    told, kinds = [], set()
    filled = float(np.abs(found.steps.indicated_m3).sum())
    most = {"m": found.filled_m[1], "1": 1.0, "": 0.0}
    for one in found.causes:
        kind, of = one.cause.kind, one.cause.of
        if kind in kinds and not one.is_named:
            continue
        kinds.add(kind)
        is_row, unit = isinstance(of, int), one.cause.unit
        told.append(
            LiquidCause(
                kind=kind,
                of=None if is_row else of,
                row=of if is_row else None,
                unit=unit,
                size=one.size,
                sd=one.sd,
                w=one.w,
                detectable=one.detectable if one.detectable < most.get(unit, filled) else None,
                named=one.is_named,
            )
        )
    return told


def _controls(found):
    """Of each meter, and of a steady leak in all runs; None where no reading moves the table."""
    from tankcal.pipeline.liquid_naming import is_steady_leak

    told = [
        LiquidControl(
            kind=one.cause.kind,
            of=one.cause.of,
            unit=one.cause.unit,
            detectable=one.detectable if np.isfinite(one.detectable) else None,
            undetected_U=one.undetected_U if np.isfinite(one.undetected_U) else None,
        )
        for one in found.causes
        if one.undetected_U is not None and (one.cause.kind == "meter" or is_steady_leak(one))
    ]
    return sorted(told, key=lambda one: (one.kind == "leak", one.of or "")) or None


def _volumes(table):
    return fill_from(VolumesBeside, table)
