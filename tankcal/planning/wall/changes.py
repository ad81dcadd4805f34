"""Changes of a WallPlan by one item, such as a strap, line, level, set-up, run or certificate."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from tankcal.methods.base import count_readings, given_methods
from tankcal.planning.model import USUAL_AT, PlannedStrap, even_radius_m
from tankcal.planning.wall.filling import LEAST_STEP_M, SAME_M
from tankcal.planning.wall.reading import change_plan, least_ring_m, lengths_of_bars
from tankcal.survey.tangents import FEWEST_SETUPS
from tankcal.tank.liquid import MOST_ROWS

OF_FILLING = ("step", "top_of_run", "half_steps", "empty_start", "run")
SEARCHED = (
    *("strap", "line", "face", "level", "hit", "setup", "station", "bar", "ranging", "reading"),
    *OF_FILLING,
)
WALL_ITEMS = (  # all items; those not in SEARCHED are no part of a design
    *(*SEARCHED, "accuracy", "traverse", "certificate", "meter", "batches"),
)
NUMBERED = ("level", "station")  # items named by a number with a decimal point
MORE_LINES, BAR_SD_ARCSEC = 4, 1.0  # number of added lines; sd of an added angle to a stadia
BETTER = ("u_scale_ppm", "u_offset_mm", "u_collimation_arcsec", "u_incidence_mm", "u_mm")
MOST_FACES, MOST_READINGS, FEWEST_LINES = 2, 20, 4


def wall_changes_of(plan):
    """Return (action, item, name, function) of every change.

    The function returns the new WallPlan.
    """
    result = []
    for changes in (_straps, _lines, _hits, _tangents, _first_straps, _runs, _certificates):
        result += changes(plan)
    return result


def wall_count(plan):
    """Return {item: number of items in a WallPlan} of the items that have a cost."""
    design, job, ring = plan.design, plan.job, plan.design.tangents
    return {
        "strap": len(design.straps),
        "line": 0 if job.lines is None else len(job.lines.lines),
        "setup": sum(hit.setups for hit in design.hits) + (0 if ring is None else ring.stations),
        "base": 0 if ring is None or ring.bar is None else 2 * ring.stations,
        "reading": sum(by_course.total() for by_course in count_readings(job).values()),
        "run": len(design.runs),
        "batch": sum(run.batches for run in design.runs),
    }


def _change_parts(plan, **parts):
    """Return a function that returns the WallPlan with other parts of its design."""
    return lambda: change_plan(plan, replace(plan.design, **parts))


def _improve_instrument(plan, name, values, register="instruments"):
    """Return a function that returns the WallPlan with new values of an instrument or meter."""
    return lambda: change_plan(plan, raw=plan.with_instrument(name, values, register))


def _straps(plan):
    design = plan.design
    for planned in design.straps:
        others = tuple(strap for strap in design.straps if strap is not planned)
        if others or any(part.is_wall for part in design.parts):
            yield "drop", "strap", planned.name, _change_parts(plan, straps=others)
        if planned.readings < MOST_READINGS:
            again = replace(planned, readings=planned.readings + 1)
            straps = tuple(again if strap is planned else strap for strap in design.straps)
            yield "repeat", "strap", planned.name, _change_parts(plan, straps=straps)
    if not design.straps:
        return
    for course in plan.job.courses:
        taken = [strap.at_percent for strap in design.straps if strap.course == course.name]
        added = replace(
            design.straps[0], course=course.name, at_percent=middle_of_gap(taken), readings=1
        )
        yield "add", "strap", added.name, _change_parts(plan, straps=(*design.straps, added))
    finer = tuple(replace(strap, sd_mm=strap.sd_mm / 2) for strap in design.straps)
    yield "repeat", "accuracy", "straps", _change_parts(plan, straps=finer)


def middle_of_gap(heights):
    """Middle of the widest gap between heights, in percent, edges included.

    Examples
    --------
    >>> middle_of_gap([20, 80]), middle_of_gap([50]), middle_of_gap([])
    (50.0, 25.0, 50.0)
    """
    marks = [0.0, *sorted(heights), 100.0]
    gaps = [(high - low, -low) for low, high in pairwise(marks)]
    wide, low = max(gaps)
    return -low + wide / 2


def _lines(plan):
    lines = plan.design.lines
    if lines is None:
        return
    count = lines.count + MORE_LINES
    yield "add", "line", str(MORE_LINES), _change_parts(plan, lines=replace(lines, count=count))
    if lines.count - MORE_LINES >= FEWEST_LINES:
        fewer = replace(lines, count=lines.count - MORE_LINES)
        yield "drop", "line", str(MORE_LINES), _change_parts(plan, lines=fewer)
    other_faces = MOST_FACES + 1 - lines.faces
    action = "add" if other_faces == MOST_FACES else "drop"
    yield action, "face", "2", _change_parts(plan, lines=replace(lines, faces=other_faces))
    if lines.readings < MOST_READINGS:
        again = replace(lines, readings=lines.readings + 1)
        yield "repeat", "reading", "offsets", _change_parts(plan, lines=again)
    for action, name, at in _levels(lines.at_percent):
        yield action, "level", name, _change_parts(plan, lines=replace(lines, at_percent=at))


def _levels(at_percent):
    """Yield (action, percent, new heights) with a height added or removed in every course."""
    added = middle_of_gap(at_percent)
    yield "add", f"{added:g} %", tuple(sorted((*at_percent, added)))
    for percent in at_percent if len(at_percent) > 1 else ():
        yield "drop", f"{percent:g} %", tuple(at for at in at_percent if at != percent)


def _hits(plan):
    design = plan.design
    for number, ring in enumerate(design.hits, 1):

        def change_ring(ring=ring, **parts):
            rings = tuple(replace(hits, **parts) if hits is ring else hits for hits in design.hits)
            return _change_parts(plan, hits=rings)

        yield "add", "hit", str(number), change_ring(hits=ring.hits + max(1, ring.hits // 2))
        if ring.hits // 2 >= 1:
            yield "drop", "hit", str(number), change_ring(hits=ring.hits - ring.hits // 2)
        yield "add", "setup", str(number), change_ring(setups=ring.setups + 1)
        if ring.setups > 1:
            yield "drop", "setup", str(number), change_ring(setups=ring.setups - 1)
        for action, name, at in _levels(ring.at_percent):
            yield action, "level", f"{name} ({number})", change_ring(at_percent=at)


def _first_straps(plan):
    """Yield a first strapped course for sights of the wall, a tape and no strap."""
    tapes = plan.raw.registers.get("instruments")
    kinds = {} if tapes is None else {n: entry.get("kind") for n, entry in tapes.entries.items()}
    names = [name for name, kind in kinds.items() if kind and kind.raw == "tape"]
    is_sighted = any(method.is_sighted for method in given_methods(plan.job))
    if is_sighted and names and not plan.design.straps:
        first = plan.job.courses[0].name
        straps = tuple(
            PlannedStrap(first, at, 0.5, more=(("instrument", names[-1]),)) for at in USUAL_AT
        )
        yield "add", "strap", f"{first}-20, {first}-80", _change_parts(plan, straps=straps)


def _tangents(plan):
    ring = plan.design.tangents
    if ring is None:
        return

    def change_ring(**parts):
        return _change_parts(plan, tangents=replace(ring, **parts))

    for action, count in (("add", ring.stations + 1), ("drop", ring.stations - 1)):
        if count >= FEWEST_SETUPS:
            radius = _even_ring_m(plan, count)
            yield action, "station", f"{radius:g} m", change_ring(stations=count, radius_m=radius)
    if ring.readings < MOST_READINGS:
        yield "repeat", "reading", "tangents", change_ring(readings=ring.readings + 1)
    for action, name, at in _levels(ring.at_percent):
        yield action, "level", name, change_ring(at_percent=at)
    yield "repeat", "accuracy", "tangents", change_ring(sd_arcsec=ring.sd_arcsec / 2)
    s_mm, s_arcsec = ring.traverse
    finer = (None if s_mm is None else s_mm / 2), s_arcsec / 2
    bar = ring.bar and (ring.bar[0], ring.bar[1] / 2)
    yield "repeat", "traverse", "traverse", change_ring(traverse=finer, bar=bar)
    bars = tuple(lengths_of_bars(plan.raw))
    if ring.bar is None:
        for name in bars:
            yield "add", "bar", name, change_ring(bar=(name, BAR_SD_ARCSEC))
    elif s_mm is not None:
        yield "drop", "bar", ring.bar[0] or bars[0], change_ring(bar=None)
        yield "drop", "ranging", "", change_ring(traverse=(None, s_arcsec))


def _even_ring_m(plan, stations):
    """Radius of a ring of stations with evenly distributed limbs, if there is such a radius."""
    nominal, ring = plan.job.tank.nominal_diameter_m / 2, plan.design.tangents
    least = least_ring_m(stations, nominal)
    radius = even_radius_m(stations, max(ring.radius_m, least), nominal, least)
    return float(np.ceil(100 * (radius or max(ring.radius_m, least))) / 100)


def _certificates(plan):
    """Yield changes that halve the calibration uncertainty of an instrument in use."""
    register, used = plan.raw.registers.get("instruments"), instruments_in_use(plan.job)
    for name, entry in {} if register is None else register.entries.items():
        half = _halve(entry, BETTER)
        if half and name in used:
            yield "repeat", "certificate", name, _improve_instrument(plan, name, half)


def _halve(entry, keys):
    """Return {key: half its value} of the keys of a register entry with positive numbers."""
    values = {key: entry[key].raw for key in keys if key in entry}
    return {
        key: value / 2
        for key, value in values.items()
        if isinstance(value, int | float) and value > 0
    }


def instruments_in_use(job):
    """Names of the instruments that a Job uses, and of the masters of its tapes."""
    names = set().union(*(method.instruments_in_use(job) for method in given_methods(job)))
    for readings in job.network.readings:
        names |= set(readings.instrument or ())
    return names - {"", None}


# ---- runs of metered liquid


def _runs(plan):
    """Yield changes of the runs: more or smaller steps, better dips, better meters."""
    design, top = plan.design, top_m(plan)
    runs = design.runs
    for number, run in enumerate(runs, 1):
        name = str(number)

        def change_run(number=number, run=run, **parts):
            return _change_parts(plan, runs=_replace_run(runs, number, replace(run, **parts)))

        for action, dips in _ends(run.dips_m, top):
            yield action, "step", name, change_run(dips_m=dips)
        to_top = _extend_to_top(run.dips_m, top)
        if to_top is not None:
            yield "add", "top_of_run", name, change_run(dips_m=to_top)
        halves = _halves(run.dips_m)
        if len(halves) > len(run.dips_m) and _count_rows(runs) + len(halves) < MOST_ROWS:
            yield "add", "half_steps", name, change_run(dips_m=halves)
        if len(run.dips_m) > 2:
            kept = run.dips_m[: len(run.dips_m) - 1 : 2]  # every second dip, and the last dip
            yield "drop", "half_steps", name, change_run(dips_m=(*kept, run.dips_m[-1]))
        if not run.from_empty and run.dips_m[0] < run.dips_m[-1]:
            yield "add", "empty_start", name, change_run(from_empty=True)
        if _count_rows(runs) + len(run.dips_m) < MOST_ROWS:
            yield "add", "run", name, _change_parts(plan, runs=(*runs, run))
        if len(runs) > 1 or not design.is_metered_alone:
            yield "drop", "run", name, _change_parts(plan, runs=_replace_run(runs, number))
    if runs:
        finer = tuple(_halve_dip_sd(plan, number, run) for number, run in enumerate(runs, 1))
        yield "repeat", "accuracy", "dips", _change_parts(plan, runs=finer)
        yield from _meters(plan)


def top_m(plan):
    """Highest dip of the tank by its drawing, from the table's zero, m."""
    job = plan.job
    if job.courses:
        return sum(course.height_m for course in job.courses) - job.datum.plate_level_m
    size = job.sphere.diameter_m if job.sphere is not None else job.horizontal.height_m
    return size - (job.datum.dip_plate_z_m or 0.0)


def _count_rows(runs):
    """Number of rows of liquid.csv, with a start in the empty tank for every run."""
    return sum(len(run.dips_m) + 1 for run in runs)


def _replace_run(runs, number, run=None):
    """Return the runs with one run replaced, or removed if `run` is None."""
    replaced = (*runs[: number - 1], run, *runs[number:])
    return tuple(kept for kept in replaced if kept is not None)


def _ends(dips, top):
    """Yield (action, dips) with the last step of a run repeated, and with it removed."""
    if len(dips) > 1:
        way = dips[-1] - dips[-2]
        longer = dips[-1] + way
        if way > 0 and longer <= top + SAME_M:
            yield "add", (*dips, round(longer, 4))
        if len(dips) > 2:
            yield "drop", dips[:-1]


def _extend_to_top(dips, top):
    """Extend dips to the full tank in steps of the last size; None if full already or falling."""
    if len(dips) < 2 or dips[-1] < dips[-2] or top - dips[-1] < LEAST_STEP_M:
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


def _halve_dip_sd(plan, number, run):
    """Return a run with half the standard deviation of its dips; number: its name in the job."""
    sd = run.sd_m
    if sd is None:
        metering = plan.job.liquid
        sd = float(metering.s_dip_m[metering.runs[str(number)][-1]])
    return replace(run, sd_m=sd / 2)


def _meters(plan):
    """Yield changes that halve the uncertainty of a meter factor or of its batches."""
    for name, entry in plan.raw.registers["meters"].entries.items():
        factor = _halve(entry, ("u_factor_ppm",))
        if factor:
            yield "repeat", "meter", name, _improve_instrument(plan, name, factor, "meters")
        batches = _halve(entry, ("repeatability_ppm", "fixed_l"))
        if batches:
            yield "repeat", "batches", name, _improve_instrument(plan, name, batches, "meters")
