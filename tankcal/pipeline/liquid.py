"""Calibration by liquid in a job: its steps, what they say of the tank, and which body is printed.

measured = measure_by_liquid(job, survey)     None: nothing was metered
measured.body                                  the one that the table is made of
result = measured.result(levels_m)             `LiquidResult`, beside the rows of the table
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import gammaincc

from tankcal.adjust import noncentrality
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.pipeline.liquid_adjustment import (
    BOTTOM,
    FLEX,
    RUNS,
    LiquidFound,
    adjust_liquid,
    adjusted_at,
)
from tankcal.pipeline.liquid_alone import filled_range_m, geometry_alone, geometry_beside
from tankcal.pipeline.liquid_body import join_body
from tankcal.pipeline.liquid_geometry import filled_with
from tankcal.pipeline.liquid_naming import alternatives_of, causes_in_words
from tankcal.pipeline.liquid_result import (
    Estimate,
    LiquidChecks,
    LiquidDips,
    LiquidResult,
    LiquidSteps,
)
from tankcal.pipeline.liquid_tables import beside_table, or_none
from tankcal.pipeline.tanks import body_of, zero_height
from tankcal.tank.liquid import fill_of, name_causes
from tankcal.tank.liquid.readings import batch_sd_m3

OF_NO_WEIGHT_M = 1.0  # standard deviation of a dip that does not count
CONTROLLED = ("meter", "leak")  # causes that change all volumes: what hides of them is stated


@dataclass(frozen=True)
class Measured:
    """A tank that liquid measured, before its table is made.

    Attributes
    ----------
    job : Job
    survey : object
    joint : LiquidFound
    alone : LiquidFound or None
        None where liquid alone does not tell the tank.
    """

    job: object
    survey: object
    joint: LiquidFound
    alone: LiquidFound | None

    @cached_property
    def joint_body(self):
        """`JointBody` of geometry and liquid."""
        return join_body(self.joint.known)

    @cached_property
    def body_alone(self):
        """`JointBody` of liquid alone; None where it does not tell the tank."""
        return self.alone and join_body(self.alone.known)

    @property
    def body(self):
        """`Body` of the table that is printed."""
        certified = self.job.liquid.certified
        if certified == "geometry":
            return body_of(self.job, self.survey)
        return self.body_alone if certified == "liquid" else self.joint_body

    def body_for(self, density_kg_m3):
        """The same for another liquid of the table."""
        certified = self.job.liquid.certified
        if certified == "geometry":
            return body_of(filled_with(self.job, density_kg_m3), self.survey)
        printed = self.alone if certified == "liquid" else self.joint
        return join_body(printed.known, density_kg_m3)

    def result(self, levels_m):
        """`LiquidResult` beside the rows of a table."""
        return _result(self, np.asarray(levels_m, dtype=float))


def measure_by_liquid(job, survey):
    """`Measured` tank of a job; None where nothing was metered.

    Raises
    ------
    InputError, SolutionError
        As `liquid_adjustment.adjust_liquid`.
    """
    if job.liquid is None:
        return None
    joint = _settled(adjust_liquid(geometry_beside(job, survey)))

    def adjust_alone():
        return _settled(adjust_liquid(geometry_alone(job, survey)))

    alone = adjust_alone() if job.liquid.certified == "liquid" else or_none(adjust_alone)
    return Measured(job, survey, joint, alone)


def _settled(found):
    """What settled; SolutionError, with the likely cause, where liquid and sizes do not meet."""
    if found.is_settled:
        return found
    named = [one for one in name_causes(found.adjusted, alternatives_of(found)) if one.is_named]
    if not named:
        raise SolutionError(
            message(
                "liquid_does_not_settle",
                "the sizes of the tank do not settle with the runs by liquid: check the sizes in "
                "job.toml, their uncertainty, and the units of volumes and dips",
            )
        )
    raise SolutionError(
        message(
            "liquid_does_not_settle_because",
            "the sizes of the tank do not settle with the runs by liquid; the likeliest cause is "
            "{cause}",
            cause=causes_in_words(named),
        )
    )


def _result(measured, levels):
    job, found = measured.job, measured.joint
    adjusted, run = found.adjusted, found.run_effect
    tables = _tables(measured, levels)
    causes = _with_reliability(
        measured, name_causes(adjusted, alternatives_of(found)), tables, levels
    )
    radii = next((one for one in causes if one.cause.kind == "radii"), None)
    detectable = radii.detectable if radii and np.isfinite(radii.detectable) else None
    return LiquidResult(
        certified=job.liquid.certified,
        steps=_steps(found),
        dips=_dips(found),
        checks=_checks(found),
        runs=_runs(found),
        run_sd=run.sd,
        run_dof=run.dof,
        factors=_factors(found),
        bottom_flex=_one(found, FLEX, found.known.flex_sd),
        bottom_m3=_one(found, BOTTOM, 1.0, is_free=True),
        sizes=_sizes(found),
        chi2=adjusted.chi2,
        dof=adjusted.dof,
        probability=float(gammaincc(adjusted.dof / 2, adjusted.chi2 / 2)) if adjusted.dof else 1.0,
        detectable_radius_m=detectable,
        causes=causes,
        filled_m=filled_range_m(job.liquid),
        tables=tables,
    )


def _with_reliability(measured, causes, tables, levels):
    """The `Verdict`s with `undetected_U`: what an error that no test shows does to the table."""
    certified = measured.job.liquid.certified
    if certified == "geometry":  # no reading of the liquid moves it
        return causes
    body, U = measured.body, tables[certified].U_m3
    known = np.isfinite(U) & (U > 0)
    by_y = body.by_misclosures(np.clip(levels[known], body.lowest_m, body.highest_m))

    def undetected(one):
        if one.cause.kind not in CONTROLLED or not np.any(known):
            return None
        if not np.isfinite(one.detectable):
            return np.inf
        return float(one.detectable * np.max(np.abs(by_y @ one.cause.column) / U[known]))

    return tuple(replace(one, undetected_U=undetected(one)) for one in causes)


def _tables(measured, levels):
    job, probability = measured.job, measured.job.table.coverage_probability
    low, high = filled_range_m(job.liquid)
    dips = levels - zero_height(job, measured.survey)
    inside = (dips >= low - 1e-9) & (dips <= high + 1e-9)
    alone = measured.body_alone
    if alone is not None:
        alone = beside_table("liquid", alone, levels, probability, inside)
    geometry = measured.joint.known.geometry.moved_to({}).body()
    return {
        "geometry": beside_table("geometry", geometry, levels, probability),
        "liquid": alone,
        "joint": beside_table("joint", measured.joint_body, levels, probability),
    }


def _steps(found):
    metering, fill, before = found.known.geometry.job.liquid, found.fill, found.before
    rows = metering.row[fill.dip_row]
    dips = metering.dip_m[fill.dip_row]
    by_head = _by_head(found)
    sd = batch_sd_m3(metering, fill)
    size, sd_of_size, w = found.adjusted.test(-np.eye(len(fill)))
    return LiquidSteps(
        row=rows[fill.end],
        run=tuple(fill.runs[i] for i in fill.run),
        meter=tuple(metering.meter[fill.dip_row[i]] for i in fill.end),
        from_dip_m=np.where(fill.from_empty, np.nan, dips[fill.start]),
        to_dip_m=dips[fill.end],
        indicated_m3=before.indicated_m3,
        by_factor_m3=before.by_factor_m3,
        by_meter_temperature_m3=before.by_meter_temperature_m3,
        by_shell_m3=before.by_shell_m3,
        by_tank_temperature_m3=before.by_tank_temperature_m3,
        by_head_m3=by_head,
        reference_m3=before.increment_m3 + by_head,
        misclosure_m3=before.misclosure_m3,
        misclosure_sd_m3=found.before_sd_m3,
        misclosure_w=before.misclosure_m3 / found.before_sd_m3,
        residual_m3=size * (sd / sd_of_size) ** 2,
        sd_m3=sd,
        redundancy=(sd / sd_of_size) ** 2,
        w=w,
        detectable_m3=noncentrality() * sd_of_size,
    )


def _by_head(found):
    """(n,) what the geometry's increments gain from the calibrating liquid to the table's."""
    geometry, fill = found.known.geometry, found.fill
    volumes = geometry.body().volume_m3(found.loaded.level_m)
    return fill.differences() @ (volumes - found.loaded.volume_m3)


def _dips(found):
    metering, fill = found.known.geometry.job.liquid, found.fill
    rows = fill.dip_row
    sd = metering.s_dip_m[rows]
    effect = next((one for one in found.adjusted.noise if one.kind == "dip_readings"), None)
    nothing = np.zeros(len(rows))
    deviates, redundancy, w = nothing, nothing, nothing
    if effect is not None:
        deviates, redundancy, w = found.adjusted.residuals(effect)
    return LiquidDips(
        row=metering.row[rows],
        run=tuple(metering.run[i] for i in rows),
        dip_m=metering.dip_m[rows],
        residual_m=deviates * sd,
        sd_m=sd,
        redundancy=redundancy,
        w=w,
    )


def _checks(found):
    """What a dip that does not count would have been: one that counts, of no weight."""
    geometry = found.known.geometry
    metering = geometry.job.liquid
    compared = ~metering.used & np.isfinite(metering.dip_m)
    if not np.any(compared):
        return None
    loose = replace(
        metering,
        used=np.full(len(metering), True),
        s_dip_m=np.where(compared, OF_NO_WEIGHT_M, metering.s_dip_m),
    )
    geometry = replace(geometry, job=replace(geometry.job, liquid=loose))
    again = adjusted_at(geometry, fill_of(loose), lambda *_: found.run_effect, found.corrections_m)
    effect = next(one for one in again.adjusted.noise if one.kind == "dip_readings")
    deviates, redundancy, _ = again.adjusted.residuals(effect)
    mine = compared[again.fill.dip_row]
    places = again.fill.dip_row[mine]
    left = OF_NO_WEIGHT_M * np.sqrt(np.maximum(1 - redundancy[mine], 0.0))
    sd = np.hypot(left, metering.s_dip_m[places])
    difference = -OF_NO_WEIGHT_M * deviates[mine]
    return LiquidChecks(
        row=metering.row[places],
        run=tuple(metering.run[i] for i in places),
        dip_m=metering.dip_m[places],
        difference_m=difference,
        sd_m=sd,
        w=difference / sd,
    )


def _runs(found):
    place, run = found.adjusted.place(RUNS), found.run_effect
    if place.stop == place.start:
        return tuple(Estimate(name, 0.0, 0.0, 0.0, 0.0) for name in found.fill.runs)
    pairs = zip(found.adjusted.estimate[place], found.adjusted.sd[place], strict=True)
    return tuple(
        Estimate(name, 0.0, run.sd, float(run.sd * z), float(run.sd * sd))
        for name, (z, sd) in zip(found.fill.runs, pairs, strict=True)
    )


def _factors(found):
    metering, place = found.known.geometry.job.liquid, found.adjusted.place("meter_factor")
    z, sd = found.adjusted.estimate[place], found.adjusted.sd[place]
    told = []
    for number, name in enumerate(found.fill.meters):
        meter = metering.meters[name]
        after, left = (z[number], sd[number]) if len(z) else (0.0, 1.0)
        told.append(
            Estimate(
                name,
                meter.factor,
                meter.u_factor * meter.factor,
                float(meter.factor * (1 + meter.u_factor * after)),
                float(meter.u_factor * meter.factor * left),
            )
        )
    return tuple(told)


def _one(found, kind, u, *, is_free=False):
    place = found.adjusted.place(kind)
    if place.stop == place.start:
        return None
    z, sd = found.adjusted.estimate[place][0], found.adjusted.sd[place][0]
    return Estimate(kind, 0.0, np.inf if is_free else u, float(u * z), float(u * sd))


def _sizes(found):
    """Inputs that were moved: by how much, with their u."""
    adjusted, told = found.adjusted, []
    columns = adjusted.effects[0].columns
    for place, deviate in found.known.moved:
        seen = columns @ place.row
        left = float(place.row @ place.row - seen @ adjusted.weight @ seen)
        u = place.u * np.sqrt(max(left, 0.0))
        told.append(Estimate(place.name, 0.0, place.u, float(place.u * deviate), float(u)))
    return tuple(told)
