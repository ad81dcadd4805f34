"""Planned runs of metered liquid: checks, and their rows of liquid.csv.

The volumes in these rows are approximate; `nominal_filling` replaces them by the volumes that a
meter would show.
"""

import numpy as np

from tankcal.messages import message
from tankcal.planning.entries import PLAN_FILE, too_many_sections
from tankcal.planning.wall.model import PlannedRun
from tankcal.tank.liquid.reduction import MOST_ROWS

LEAST_STEP_M = 0.001  # smallest step between two dips
LEAST_BATCH_M3 = 1e-3  # replaces a batch volume that is zero or unknown
MOST_RUNS = 50
SAME_M = 1e-6  # largest difference of equal dips


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
    rows = sum(len(run.dips_m) + 1 for run in map(_planned, runs) if run is not None)
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
    return tuple(_planned(entry, celsius) for entry in entries)


def _planned(entry, celsius=None):
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
