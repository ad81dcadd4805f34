"""Planned runs of metered liquid: checks, their rows of liquid.csv, and their predicted effect.

The volumes in these rows are approximate; `nominal_filling` replaces them by the volumes that a
meter would show.

The predicted effect comprises U of rows and differences, detectable causes, and reliability.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.adjust import noncentrality
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.liquid import filled_range_m, join_body
from tankcal.planning.contract import PLAN_FILE, too_many_sections
from tankcal.planning.model import PlannedRun
from tankcal.tank.liquid import MOST_ROWS
from tankcal.uncertainty import combine

LEAST_STEP_M = 0.001  # smallest step between two dips
LEAST_BATCH_M3 = 1e-3  # replaces a batch volume that is zero or unknown
MOST_RUNS = 50
SAME_M = 1e-6  # largest difference of equal dips
LEAST_SHARE = 0.01  # smallest relative reduction of the u of a cause that is listed
UNCONTROLLED = 1e-4  # redundancy
OF_INSTRUMENTS = "instrument"  # part of the kinds of causes whose note names the instrument


def check_runs(plan_input, is_run_declared, log):
    """Check [[runs]] and [filling].

    Parameters
    ----------
    plan_input : PlanInput
    is_run_declared : bool
        Whether [liquid] has a run_ppm.
    log : Log
    """
    runs, filling = plan_input.sections["runs"], plan_input.sections["filling"]
    if filling.filled_keys and not runs:
        expected = message(
            "plan_filling_alone",
            "given without [[runs]]; expected runs of liquid from dip to dip",
        )
        log.problem(PLAN_FILE, expected, filling.row, "filling")
    if len(runs) > MOST_RUNS:
        log.problem(PLAN_FILE, too_many_sections(len(runs), MOST_RUNS), None, "runs")
    for entry in runs:
        _check_steps(entry, log)
    _check_run_effect(plan_input, is_run_declared, log)
    rows = sum(len(run.dips_m) + 1 for run in map(_make_run, runs) if run is not None)
    if rows > MOST_ROWS:
        expected = message(
            "plan_many_batches",
            "{count} dips; expected at most {most}",
            count=rows,
            most=MOST_ROWS,
        )
        log.problem(PLAN_FILE, expected, None, "runs")


def _check_steps(run, log):
    first, last, step, steps = (
        run[key] for key in ("first_dip_m", "last_dip_m", "step_m", "steps")
    )
    if {"step_m", "steps"} <= run.filled_keys or not {"step_m", "steps"} & run.filled_keys:
        expected = message(
            "plan_step_or_steps",
            "expected one of them: step_m, the way from dip to dip, or steps, how many",
        )
        run.report(log.problem, "step_m", expected)
        return
    if None in (first, last):
        return  # reported already
    if abs(last - first) < LEAST_STEP_M and not run["from_empty"]:
        expected = message(
            "plan_run_stands",
            "found {last:g}, which is the first dip; expected a dip above it, or below it where"
            " liquid is drawn off",
            last=last,
        )
        run.report(log.problem, "last_dip_m", expected)
        return
    way = abs(last - first) / steps if steps else step
    if way is not None and way < LEAST_STEP_M and last != first:
        expected = message(
            "plan_small_step",
            "steps of {step:g} mm; expected {least:g} mm or more",
            step=1000 * way,
            least=1000 * LEAST_STEP_M,
        )
        run.report(log.problem, "steps" if steps else "step_m", expected)


def _check_run_effect(plan_input, is_declared, log):
    """Check that the run effect is declared, or that at least two runs determine it."""
    runs, filling = plan_input.sections["runs"], plan_input.sections["filling"]
    expected_ppm = filling["expected_run_ppm"]
    if expected_ppm is not None and is_declared:
        expected = message(
            "plan_run_effect_twice",
            "given beside liquid.run_ppm; expected one of them: what is declared is not shown by"
            " the runs",
        )
        filling.report(log.problem, "expected_run_ppm", expected)
    if len(runs) > 1 and expected_ppm is None and not is_declared:
        expected = message(
            "plan_run_effect_missing",
            "missing; expected by how much whole runs will differ, ppm, or liquid.run_ppm where it"
            " is declared: before they are made, the runs show nothing",
        )
        row = filling.row or runs[0].row
        log.problem(PLAN_FILE, expected, row, "filling.expected_run_ppm")


def runs_of(entries, celsius):
    """Return the `PlannedRun`s of valid [[runs]], a tuple; celsius: temperature of the table."""
    return tuple(_make_run(entry, celsius) for entry in entries)


def _make_run(entry, celsius=None):
    """Return the PlannedRun of an Entry; None if the entry is invalid."""
    first, last = entry["first_dip_m"], entry["last_dip_m"]
    step, steps = entry["step_m"], entry["steps"]
    if None in (first, last) or step is steps:
        return None
    warm = celsius if entry["temperature_c"] is None else entry["temperature_c"]
    return PlannedRun(
        dips_m=_dips(first, last, step, steps),
        from_empty=bool(entry["from_empty"]),
        meter=entry["meter"],
        sd_m=None if entry["s_dip_mm"] is None else entry["s_dip_mm"] / 1000,
        celsius=None if entry["temperatures"] is False else warm,
    )


def _dips(first, last, step, steps):
    """Return dips by their step or by their number; the last step may be shorter."""
    if steps:
        dips = np.linspace(first, last, int(steps) + 1)
    else:
        whole = int(min((abs(last - first) + 1e-9) // max(step, LEAST_STEP_M), MOST_ROWS))
        dips = first + np.sign(last - first) * step * np.arange(whole + 1)
        if abs(last - dips[-1]) >= LEAST_STEP_M:
            dips = np.append(dips, last)
    return tuple(np.round(dips, 4).tolist())


def rows_of_runs(runs, volume_at):
    """Return the rows of liquid.csv, {column: value} each.

    volume_at: function of a dip, m, that returns the approximate volume, m3.
    """
    for number, run in enumerate(runs, 1):
        common = {"run": str(number), "meter": run.meter}
        warm = {"tank_temperature_c": run.celsius, "shell_temperature_c": run.celsius}
        at_meter = warm | {"meter_temperature_c": run.celsius}
        sd = {"s_dip_mm": None if run.sd_m is None else 1000 * run.sd_m}
        before = None
        if run.from_empty:
            yield common | {"volume_m3": 0.0}
            before = 0.0
        for dip in run.dips_m:
            below = volume_at(dip)
            if before is None:
                yield common | sd | warm | {"volume_m3": 0.0, "dip_m": dip}
            else:
                way = below - before
                way = np.copysign(max(abs(way), LEAST_BATCH_M3), run.dips_m[-1] - run.dips_m[0])
                yield common | sd | at_meter | {"volume_m3": float(way), "dip_m": dip}
            before = below


@dataclass(frozen=True)
class DipOutlook:
    """Predicted volume below a dip.

    Attributes
    ----------
    dip_m : float
        From the table's zero, m.
    volume_m3 : float
        Volume below the dip, m3.
    U_geometry_m3 : float
        Expanded uncertainty by geometry only, surveyed or declared, m3.
    U_liquid_m3 : float or None
        Expanded uncertainty by liquid only, m3. None outside its dips, or if liquid only does not
        determine the tank.
    U_m3 : float
        Expanded uncertainty by both, m3.
    """

    dip_m: float
    volume_m3: float
    U_geometry_m3: float
    U_liquid_m3: float | None
    U_m3: float


@dataclass(frozen=True)
class DifferenceOutlook:
    """Predicted volume between two dips (a delivery).

    Attributes
    ----------
    low_m, high_m : float
        Dips, m.
    volume_m3 : float
        Volume between the dips, m3.
    U_geometry_m3 : float
        As in `DipOutlook`.
    U_m3 : float
        Expanded uncertainty by geometry and liquid, m3.
    """

    low_m: float
    high_m: float
    volume_m3: float
    U_geometry_m3: float
    U_m3: float


@dataclass(frozen=True)
class CauseOutlook:
    """A meter, or a cause whose uncertainty liquid reduces.

    Attributes
    ----------
    kind : str
        As in the budget of a table.
    name : str
        Name of the meter or instrument; "" if the cause is common to all.
    unit : str
        Unit of both uncertainties.
    u_before : float
        Standard uncertainty without liquid.
    u_after : float
        Standard uncertainty with liquid.
    """

    kind: str
    name: str
    unit: str
    u_before: float
    u_after: float


@dataclass(frozen=True)
class LiquidReadings:
    """Reliability of batches or dips.

    Attributes
    ----------
    kind : str
        "batches" or "dips".
    count : int
        Number of readings.
    uncontrolled : int
        Number of readings that no other reading controls.
    redundancy : float
        Mean redundancy number.
    detectable : float or None
        Largest minimal detectable error, m3 for batches, m for dips; None if all are uncontrolled.
    """

    kind: str
    count: int
    uncontrolled: int
    redundancy: float
    detectable: float | None


@dataclass(frozen=True)
class FillingOutlook:
    """Predicted results of runs of liquid.

    Attributes
    ----------
    runs, batches : int
        Numbers of runs and batches.
    dips : tuple of DipOutlook
    differences : tuple of DifferenceOutlook
        Between neighbouring dips of `dips`.
    causes : tuple of CauseOutlook
    readings : tuple of LiquidReadings
    redundancy : int
        Degrees of freedom of the overall test: steps minus unknowns that only the steps determine.
    detectable_radius_m : float or None
        Smallest detectable common offset of all radii of the geometry, m.
    run_sd : float
        Relative standard deviation of the run effect.
    run_dof : float or None
        Its degrees of freedom; None if it is declared.
    """

    runs: int
    batches: int
    dips: tuple[DipOutlook, ...]
    differences: tuple[DifferenceOutlook, ...]
    causes: tuple[CauseOutlook, ...]
    readings: tuple[LiquidReadings, ...]
    redundancy: int
    detectable_radius_m: float | None
    run_sd: float
    run_dof: float | None


def outlook_of_filling(plan, metering, result, table):
    """Return the `FillingOutlook` of a WallPlan.

    Parameters
    ----------
    plan : WallPlan
    metering : Measured
    result : LiquidResult
    table : ComputedTable
    """
    dips = _dips_of(plan, table)
    joint = metering.joint.known
    bodies = {
        "geometry": joint.geometry.moved_to({}).body(),
        "liquid": None if metering.alone is None else join_body(metering.alone.known),
        "joint": join_body(joint),
    }
    rows = _predict_dips(plan, bodies, dips, table)
    dof = result.run_dof
    return FillingOutlook(
        runs=len(plan.design.runs),
        batches=len(result.steps.row),
        dips=rows,
        differences=_differences(bodies, dips, table),
        causes=_causes(metering.joint),
        readings=_readings(result),
        redundancy=result.dof,
        detectable_radius_m=None if plan.design.is_metered_alone else result.detectable_radius_m,
        run_sd=result.run_sd,
        run_dof=float(dof) if np.isfinite(dof) else None,
    )


def _dips_of(plan, table):
    """Return the listed dips: those of the plan, or else those of the runs and the full tank."""
    if plan.dips_m:
        return np.array(plan.dips_m)
    filled = np.clip(filled_range_m(plan.job.liquid), table.table.height_m[0], table.top_m)
    return np.unique(np.round([*filled, table.top_m], 4))


def refuse_other_dips(dips_m, table):
    """Raise InputError for dips outside a `ComputedTable`."""
    low, top = float(table.table.height_m[0]), table.top_m
    beyond = [dip for dip in dips_m if not low - SAME_M <= dip <= top + SAME_M]
    if beyond:
        expected = message(
            "plan_dips_beyond",
            "found {dip:g}; expected {low:.4g} to {high:.4g} m, the dips of the table",
            dip=beyond[0],
            low=low,
            high=top,
        )
        raise InputError(Problem(PLAN_FILE, expected, None, "filling.dips_m"))


def _compute_U(body, levels, table, weights=None):
    """U (n,) of volumes at levels, or of their weighted sums."""
    levels = np.clip(levels, body.lowest_m, body.highest_m)
    sources = body.sources(levels)
    if weights is not None:
        sources = [source.weighted(weights) for source in sources]
    return combine(sources, len(levels if weights is None else weights)).expanded(
        table.table.probability
    )


def _predict_dips(plan, bodies, dips, table):
    """`DipOutlook` of each dip: U by the wall, by the liquid and by both."""
    levels = dips + table.zero_m
    low, high = filled_range_m(plan.job.liquid)
    inside = (dips >= low - SAME_M) & (dips <= high + SAME_M)
    U_of = {
        name: np.full(len(dips), np.nan) if body is None else _compute_U(body, levels, table)
        for name, body in bodies.items()
    }
    liquid = np.where(inside, U_of["liquid"], np.nan)
    volumes = bodies["joint"].volume_m3(np.clip(levels, None, bodies["joint"].highest_m))
    columns = (dips, volumes, U_of["geometry"], liquid, U_of["joint"])
    return tuple(
        DipOutlook(
            float(dip),
            float(volume),
            float(by_geometry),
            float(by_liquid) if np.isfinite(by_liquid) else None,
            float(U),
        )
        for dip, volume, by_geometry, by_liquid, U in zip(*columns, strict=True)
    )


def _differences(bodies, dips, table):
    if len(dips) < 2:
        return ()
    levels, over = dips + table.zero_m, np.diff(np.eye(len(dips)), axis=0)
    joint, geometry = bodies["joint"], bodies["geometry"]
    volumes = over @ joint.volume_m3(np.clip(levels, None, joint.highest_m))
    before, expanded = (_compute_U(body, levels, table, over) for body in (geometry, joint))
    columns = (pairwise(dips), volumes, before, expanded)
    return tuple(
        DifferenceOutlook(float(low), float(high), float(volume), float(by_geometry), float(U))
        for (low, high), volume, by_geometry, U in zip(*columns, strict=True)
    )


def _causes(result):
    """Return the meters, and other scalar causes whose uncertainty liquid reduces."""
    adjusted, fill = result.adjusted, result.fill
    metering = result.known.geometry.job.liquid
    outlooks = []
    effects = (effect for effect in adjusted.effects if effect.kind == "meter_factor")
    columns = next((effect.columns.T for effect in effects), None)
    for number, name in enumerate(fill.meters):
        u = 1e6 * metering.meters[name].u_factor
        left = 1.0 if columns is None else _ratio_of_u(adjusted, columns[number])
        outlooks.append(CauseOutlook("meter_factor", name, "ppm", u, u * left))
    of_geometry = [source for source in result.known.sources if not source.parts]
    of_liquid = [cause for cause in result.known.liquid if cause.kind != "meter_factor"]
    for cause in (*of_geometry, *of_liquid):
        if cause.u and cause.unit and cause.columns_m3.shape[1] == 1:
            left = _ratio_of_u(adjusted, cause.columns_m3[:, 0])
            if left < 1 - LEAST_SHARE:
                name = cause.note if cause.kind.startswith(OF_INSTRUMENTS) else ""
                u = float(cause.u)
                outlooks.append(CauseOutlook(cause.kind, name, cause.unit, u, u * left))
    return tuple(outlooks)


def _ratio_of_u(adjusted, column):
    """Ratio of the u of a cause after to before.

    Column (n,): effect of one u on the misclosures.
    """
    # A cause with prior variance 1 has the posterior variance 1 - c' M c, with the weights M of
    # all tests (`tank.liquid.adjustment`).
    return float(np.sqrt(max(1.0 - column @ adjusted.weight @ column, 0.0)))


def _readings(result):
    delta, outlooks = noncentrality(), []
    for kind, readings in (("batches", result.steps), ("dips", result.dips)):
        shows = readings.redundancy > UNCONTROLLED
        detectable = None
        if shows.any():
            detectable = float(
                np.max(delta * readings.sd[shows] / np.sqrt(readings.redundancy[shows]))
            )
        mean = float(np.mean(readings.redundancy)) if len(shows) else 0.0
        outlooks.append(LiquidReadings(kind, len(shows), int(np.sum(~shows)), mean, detectable))
    return tuple(outlooks)
