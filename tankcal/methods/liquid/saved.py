"""The part of the record on metered runs: meters, steps, dips, causes, tables."""

import numpy as np

from tankcal.gum.coverage import coverage_factor
from tankcal.record.schema import Finite, Saved, fill_from, key
from tankcal.record.table import bottom_choice, roof_choice, top_choice


class MeterUsed(Saved):
    """A meter through which the tank was filled or emptied."""

    meter: str = key("name")
    certificate: str = key('its number; "": not given')
    prover: str = key('against which it was proved; "": not given')
    factor: float = key("of the certificate: true volume = factor x indicated")
    u_factor: float = key("its standard uncertainty")
    factor_found: float = key("by the adjustment with the geometry")
    u_factor_found: float = key("standard uncertainty of factor_found")
    factor_after: float | None = key("as proved afterwards; null: not proved again")
    repeatability: float = key("standard deviation of a batch, relative")
    fixed_m3: float = key("part of it that does not grow with the batch")
    indicated_m3: float = key("sum of its indications, including withdrawals")
    flow_lowest_m3_h: float | None = key("of its rows; null: not recorded")
    flow_highest_m3_h: float | None = key("of its rows; null: not recorded")
    flow_min_m3_h: float | None = key("for which the factor was proved; null: not given")
    flow_max_m3_h: float | None = key("for which the factor was proved; null: not given")


class RunOfLiquid(Saved):
    """A run: a filling or emptying, with the common error of its steps."""

    run: str = key("name")
    steps: int = key("between valid dips")
    from_dip_m: float | None = key("at its beginning; null: the empty, dry tank")
    to_dip_m: float = key("at its end")
    indicated_m3: float = key("of its steps, by the meter")
    effect: float = key("of the run, relative, as adjusted")
    u_effect: float = key("its standard uncertainty")


class LiquidStep(Saved):
    """A step between two dips, at reference conditions, compared with the geometry."""

    row: int = key("of the file, at its end")
    run: str = key("name")
    meter: str = key("name")
    from_dip_m: float | None = key("null: from the empty, dry tank")
    to_dip_m: float = key("at its end")
    indicated_m3: float = key("by the meter")
    by_factor_m3: float = key("correction by the meter's factor")
    by_meter_temperature_m3: float = key(
        "correction for liquid cooled or warmed on its way into the tank"
    )
    by_tank_temperature_m3: float = key("correction for expansion of the liquid in the tank")
    by_shell_m3: float = key("correction from the shell's temperature to that of the table")
    by_head_m3: float = key("correction from the calibrating liquid to that of the table")
    reference_m3: float = key("between the dips by liquid, at the reference: the sum of these")
    geometry_m3: float = key("between the dips by the geometry before the adjustment")
    misclosure_m3: float = key("reference_m3 less geometry_m3")
    misclosure_u_m3: float = key("its standard uncertainty")
    misclosure_U_m3: float = key("its expanded uncertainty, k of the normal distribution")
    misclosure_w: float = key("the misclosure over its standard uncertainty")
    residual_m3: float = key("to be added to the batch, by the adjustment with the geometry")
    sd_m3: float = key("of the batch, before the adjustment")
    redundancy: float = key("share of an error that the residual shows")
    w: float | None = key("test quantity of the batch; null: not controlled")
    detectable_m3: float | None = key("smallest detectable error; null: larger than all metered")


class LiquidDip(Saved):
    """A dip of the adjustment."""

    row: int = key("of the file")
    run: str = key("name")
    dip_m: float = key("as read")
    residual_m: float = key("to be added to it, by the adjustment with the geometry")
    sd_m: float = key("of the reading, before the adjustment")
    redundancy: float = key("share of an error that the residual shows")
    w: float | None = key("test quantity of the reading; null: not controlled")


class LiquidCause(Saved):
    """A possible cause of misclosures, tested alone: the likeliest of each kind."""

    kind: str = key("code of it: meter, radii, dip, dip_zero, batch, leak, bottom ...")
    of: str | None = key("meter or run; null: none, or a row")
    row: int | None = key("of the file; null: none")
    unit: str = key('of its size, in SI: "1", "m", "m3", "m3/h"; "": a cause without size')
    size: float = key("correction that explains most of the misclosures; of a leak: loss")
    sd: float | None = key("standard deviation of the size; null: not estimable from the steps")
    w: float = key("test quantity")
    detectable: float | None = key("smallest detectable size; null: beyond the tank's")
    named: bool = key("whether it is the likeliest cause, or not separable from it")


class LiquidControl(Saved):
    """Control, by the steps, of an error that would change all volumes."""

    kind: str = key("meter or leak")
    of: str | None = key("meter; null: all runs")
    unit: str = key('of the size, in SI: "1", "m3/h", or "m3" in each step where times are blank')
    detectable: float | None = key("smallest detectable size; null: none")
    undetected_U: float | None = key(
        "largest change of a volume by an undetected error, over U of the volume; null: unlimited"
    )


class SizeByLiquid(Saved):
    """A declared size of the geometry that the liquid changed."""

    input: str = key("name")
    unit: str = key('of the numbers: "m", "m/m" of a slope, "1" of a scale')
    change: float = key("adjusted less declared")
    u_before: float = key("standard uncertainty before the adjustment")
    u_after: float = key("standard uncertainty after the adjustment")


class VolumesBeside(Saved):
    """Volumes of the rows of the table, by one source; null: not determined."""

    volume_m3: list[float] = key("below each dip")
    u_m3: list[float] = key("standard uncertainty")
    U_m3: list[float] = key("expanded uncertainty, by the law of propagation")


class LiquidRecord(Saved):
    """Metered runs, their adjustment with the geometry, and the three resulting tables."""

    certified: str = key('printed table: "joint", "liquid" or "geometry"')
    geometry: str = key('source of the geometry: "survey", "drawing" or "sizes"')
    density_kg_m3: float = key("of the calibrating liquid, at density_c")
    u_density_kg_m3: float = key("its standard uncertainty")
    density_c: float = key("temperature of the density")
    expansion_per_k: float = key("of the liquid's volume")
    u_expansion_per_k: float = key("its standard uncertainty")
    u_temperature_c: Finite = key("standard deviation of one temperature")
    u_dip_zero_m: float = key("standard uncertainty of the common error of all dips")
    lowest_dip_m: Finite = key("of the adjustment")
    highest_dip_m: Finite = key("of the adjustment")
    meters: list[MeterUsed] = key("in the order of their rows")
    runs: list[RunOfLiquid] = key("in their order")
    run_sd: float = key("standard deviation of the effect of a run, relative")
    run_dof: float = key("its degrees of freedom; null: it was declared")
    steps: list[LiquidStep] = key("in the order of the file")
    dips: list[LiquidDip] = key("in the order of the file")
    bottom_flex_sd: float | None = key("declared for the bottom, m3 per m of head; null: none")
    bottom_flex: float | None = key("as adjusted; null: none was declared")
    u_bottom_flex: float | None = key("its standard uncertainty")
    below_first_dip_m3: float | None = key("less that of the geometry; null: not requested")
    u_below_first_dip_m3: float | None = key("its standard uncertainty")
    sizes: list[SizeByLiquid] = key("changed declared sizes")
    chi2: float = key("of all misclosures together")
    dof: int = key("of chi2")
    probability: float = key("of a larger chi-square")
    detectable_radius_m: float | None = key(
        "smallest common offset of all radii that the liquid detects; null: not applicable"
    )
    causes: list[LiquidCause] = key("the likeliest of each kind, the likeliest first")
    by_geometry: VolumesBeside = key("rows of the table by the geometry alone")
    by_liquid: VolumesBeside | None = key("by the liquid alone; null: not determined")
    joint: VolumesBeside = key("by both")
    controls: list[LiquidControl] | None = key(
        "errors that change all volumes; left out for a table of geometry alone, and in older"
        " versions",
        optional=True,
    )


RATIOS = {"tilt": "m/m", "scale": "1"}  # units of sizes that are no lengths


def save_liquid(result):
    """Return the `LiquidRecord` of a result."""
    liquid, metering = result.liquid, result.job.liquid
    low_m, high_m = liquid.filled_m
    flex, below = liquid.bottom_flex, liquid.bottom_m3
    return fill_from(
        LiquidRecord,
        liquid,
        geometry=geometry_beside(result),
        **{
            name: getattr(metering, name)
            for name in (
                *("density_kg_m3", "u_density_kg_m3", "density_c", "expansion_per_k"),
                *("u_expansion_per_k", "u_temperature_c", "u_dip_zero_m"),
            )
        },
        lowest_dip_m=low_m,
        highest_dip_m=high_m,
        meters=_meters(liquid, metering),
        runs=_runs(liquid),
        steps=_steps(liquid, result.job.table.coverage_probability),
        dips=_make_rows(LiquidDip, liquid.dips, w=_controlled_w(liquid.dips)),
        bottom_flex_sd=flex and flex.u_before,
        bottom_flex=flex and flex.after,
        u_bottom_flex=flex and flex.u_after,
        below_first_dip_m3=below and below.after,
        u_below_first_dip_m3=below and below.u_after,
        sizes=[
            SizeByLiquid(
                input=size.name,
                unit=RATIOS.get(size.name, "m"),
                change=size.after,
                u_before=size.u_before,
                u_after=size.u_after,
            )
            for size in liquid.sizes
        ],
        causes=_causes(liquid),
        by_geometry=fill_from(VolumesBeside, liquid.tables["geometry"]),
        by_liquid=fill_from(VolumesBeside, liquid.tables["liquid"]),
        joint=fill_from(VolumesBeside, liquid.tables["joint"]),
        controls=_controls(liquid),
    )


def choices_of(result):
    """Choices on the printed table, and on the geometry used with the liquid: {code: value}."""
    job, geometry = result.job, geometry_beside(result)
    choices = {"liquid": result.liquid.certified, "liquid_beside": geometry}
    if geometry == "drawing":
        choices |= {
            "bottom": bottom_choice(job),
            **top_choice(job),
            "tilt": "not_measured",
            "course_heights": "along_axis",
            "roof": roof_choice(job),
            "thickness": "drawing",
        }
    return choices


def geometry_beside(result):
    """Return the source of the geometry: "survey", "drawing" (of an upright tank) or "sizes"."""
    if result.wall is not None or result.strapped is not None or result.scan is not None:
        return "survey"
    return "drawing" if result.job.tank.kind == "vertical" else "sizes"


def _meters(liquid, metering):
    """Return `MeterUsed` of each meter, in the order of their rows."""
    meter_of_row, flow, volume = np.array(metering.meter), metering.flow_m3_h, metering.volume_m3
    rows = []
    for factor in liquid.factors:
        is_row = meter_of_row == factor.name
        flows = flow[is_row & np.isfinite(flow)]
        rows.append(
            fill_from(
                MeterUsed,
                metering.meters[factor.name],
                meter=factor.name,
                u_factor=factor.u_before,
                factor_found=factor.after,
                u_factor_found=factor.u_after,
                indicated_m3=np.sum(np.abs(volume[is_row])),
                flow_lowest_m3_h=flows.min() if len(flows) else None,
                flow_highest_m3_h=flows.max() if len(flows) else None,
            )
        )
    return rows


def _runs(liquid):
    """Return `RunOfLiquid` of each run with steps."""
    steps, run_of_step = liquid.steps, np.array(liquid.steps.run)
    rows = []
    for run in liquid.runs:
        indices = np.flatnonzero(run_of_step == run.name)
        if len(indices):
            rows.append(
                RunOfLiquid(
                    run=run.name,
                    steps=len(indices),
                    from_dip_m=steps.from_dip_m[indices[0]],
                    to_dip_m=steps.to_dip_m[indices[-1]],
                    indicated_m3=steps.indicated_m3[indices].sum(),
                    effect=run.after,
                    u_effect=run.u_after,
                )
            )
    return rows


def _steps(liquid, probability):
    """Return `LiquidStep` of each step."""
    steps, k = liquid.steps, float(coverage_factor(probability, np.inf))
    metered_m3 = np.abs(steps.indicated_m3).sum()
    return _make_rows(
        LiquidStep,
        steps,
        geometry_m3=steps.reference_m3 - steps.misclosure_m3,
        misclosure_u_m3=steps.misclosure_sd_m3,
        misclosure_U_m3=k * steps.misclosure_sd_m3,
        w=_controlled_w(steps),
        detectable_m3=np.where(steps.detectable_m3 < metered_m3, steps.detectable_m3, np.nan),
    )


def _controlled_w(readings):
    """Return the test quantities; nan for readings whose redundancy is a rounding error."""
    from tankcal.methods.liquid.warnings import CONTROLLED

    return np.where(readings.redundancy > CONTROLLED, readings.w, np.nan)


def _make_rows(cls, source, **columns):
    """Return an object of `cls` for each row of columns: the given ones, or attributes."""
    names = cls.__annotations__
    values = [columns[name] if name in columns else getattr(source, name) for name in names]
    return [cls(*row) for row in zip(*values, strict=True)]


def _causes(liquid):
    """Return `LiquidCause` of the likeliest cause of each kind, and of all named causes."""
    rows, kinds = [], set()
    metered_m3 = float(np.abs(liquid.steps.indicated_m3).sum())
    largest = {"m": liquid.filled_m[1], "1": 1.0, "": 0.0}  # largest detectable size by unit
    for test in liquid.causes:
        kind, of, unit = test.cause.kind, test.cause.of, test.cause.unit
        if kind in kinds and not test.is_named:
            continue
        kinds.add(kind)
        is_row = isinstance(of, int)
        is_detectable = test.detectable < largest.get(unit, metered_m3)
        rows.append(
            LiquidCause(
                kind=kind,
                of=None if is_row else of,
                row=of if is_row else None,
                unit=unit,
                size=test.size,
                sd=test.sd,
                w=test.w,
                detectable=test.detectable if is_detectable else None,
                named=test.is_named,
            )
        )
    return rows


def _controls(liquid):
    """Return `LiquidControl` of each meter and of a steady leak; None if the table ignores them."""
    from tankcal.pipeline.liquid.measuring import is_steady_leak

    rows = [
        LiquidControl(
            kind=test.cause.kind,
            of=test.cause.of,
            unit=test.cause.unit,
            detectable=test.detectable if np.isfinite(test.detectable) else None,
            undetected_U=test.undetected_U if np.isfinite(test.undetected_U) else None,
        )
        for test in liquid.causes
        if test.undetected_U is not None and (test.cause.kind == "meter" or is_steady_leak(test))
    ]
    return sorted(rows, key=lambda row: (row.kind == "leak", row.of or "")) or None
