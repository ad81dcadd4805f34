"""Changes of the runs of a WallPlan: more or smaller steps, better dips, better meters."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from tankcal.job.checks.liquid import MOST_ROWS
from tankcal.planning.wall.filling import LEAST_STEP_M

TOP, HALF, EMPTY = "top", "half", "empty"
SAME_M = 1e-6  # largest difference of equal dips


def changes_of_runs(plan, made, certified):
    """Return (action, item, name, function) of every change of the runs of a WallPlan.

    made is a function {part of the design: value} -> function; certified is a function (name, {key:
    value}, register) -> function.
    """
    runs, top = plan.design.runs, top_m(plan)
    for number, run in enumerate(runs, 1):
        name = str(number)

        def changed(number=number, **parts):
            return made(runs=_with(runs, number, replace(runs[number - 1], **parts)))

        for action, dips in _ends(run.dips_m, top):
            yield action, "step", name, changed(dips_m=dips)
        to_top = _to_top(run.dips_m, top)
        if to_top is not None:
            yield "add", "top_of_run", name, changed(dips_m=to_top)
        halves = _halves(run.dips_m)
        if len(halves) > len(run.dips_m) and _rows(runs) + len(halves) < MOST_ROWS:
            yield "add", "half_steps", name, changed(dips_m=halves)
        if len(run.dips_m) > 2:
            yield "drop", "half_steps", name, changed(dips_m=_every_second(run.dips_m))
        if not run.from_empty and run.dips_m[0] < run.dips_m[-1]:
            yield "add", "empty_start", name, changed(from_empty=True)
        if _rows(runs) + len(run.dips_m) < MOST_ROWS:
            yield "add", "run", name, made(runs=(*runs, run))
        if len(runs) > 1 or _is_surveyed(plan.design):
            yield "drop", "run", name, made(runs=_with(runs, number))
    if runs:
        yield "repeat", "accuracy", "dips", made(runs=tuple(map(_finer(plan), runs)))
        yield from _meters(plan, certified)


def top_m(plan):
    """Highest dip of the tank by its drawing, from the table's zero, m; None if unknown."""
    job = plan.job
    if job.courses:
        return sum(course.height_m for course in job.courses) - job.datum.plate_level_m
    size = job.sphere.diameter_m if job.sphere is not None else job.horizontal.height_m
    return size - (job.datum.dip_plate_z_m or 0.0)


def _is_surveyed(design):
    return not design.is_metered_alone


def _rows(runs):
    return sum(len(run.dips_m) + 1 for run in runs)


def _with(runs, number, run=None):
    """Return the runs with one run replaced, or removed if `run` is None."""
    changed = [run if place == number else old_run for place, old_run in enumerate(runs, 1)]
    return tuple(old_run for old_run in changed if old_run is not None)


def _ends(dips, top):
    """Yield (action, dips) with a last step repeated at the end of a run, or one removed."""
    if len(dips) > 1:
        way = dips[-1] - dips[-2]
        longer = dips[-1] + way
        if way > 0 and (top is None or longer <= top + SAME_M):
            yield "add", (*dips, round(longer, 4))
        if len(dips) > 2:
            yield "drop", dips[:-1]


def _to_top(dips, top):
    """Extend dips to the full tank in steps of the last size; None if full already or falling."""
    if top is None or len(dips) < 2 or dips[-1] < dips[-2] or top - dips[-1] < LEAST_STEP_M:
        return None
    way = dips[-1] - dips[-2]
    more = np.arange(dips[-1] + way, top - LEAST_STEP_M, way)
    return (*dips, *np.round(more, 4).tolist(), round(top, 4))


def _halves(dips):
    """Return dips with another dip in the middle of every step."""
    halved = [dips[0]]
    for low, high in pairwise(dips):
        middle = round((low + high) / 2, 4)
        if abs(high - low) >= 2 * LEAST_STEP_M:
            halved.append(middle)
        halved.append(high)
    return tuple(halved)


def _every_second(dips):
    """Return every second dip and the last dip."""
    kept = dips[::2]
    return kept if kept[-1] == dips[-1] else (*kept, dips[-1])


def _finer(plan):
    usual = plan.job.liquid.s_dip_m
    rows = plan.job.liquid.runs

    def finer(run):
        sd = run.sd_m
        if sd is None:
            number = next(k for k, planned in enumerate(plan.design.runs, 1) if planned is run)
            sd = float(usual[rows[str(number)][-1]])
        return replace(run, sd_m=sd / 2)

    return finer


def _meters(plan, certified):
    """Yield changes that halve the uncertainty of a meter factor or of its batches."""
    for name, entry in plan.given.registers["meters"].entries.items():
        given = {key: value.raw for key, value in entry.items()}
        u = given.get("u_factor_ppm")
        if isinstance(u, int | float) and u > 0:
            yield "repeat", "meter", name, certified(name, {"u_factor_ppm": u / 2}, "meters")
        better = {
            key: given[key] / 2
            for key in ("repeatability_ppm", "fixed_l")
            if isinstance(given.get(key), int | float) and given[key] > 0
        }
        if better:
            yield "repeat", "batches", name, certified(name, better, "meters")
