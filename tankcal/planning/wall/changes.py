"""Changes of a WallPlan by one item, such as a strap, line, level, set-up, run or certificate."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from tankcal.planning.wall.checks import least_ring_m
from tankcal.planning.wall.filling_changes import changes_of_runs
from tankcal.planning.wall.model import USUAL_AT, PlannedStrap, even_radius_m
from tankcal.planning.wall.reading import changed, lengths_of_bars
from tankcal.survey.tangents import FEWEST_SETUPS

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
MOST_FACES, MOST_READINGS, FEWEST_LINES, FEWEST_HITS = 2, 20, 4, 5


def wall_changes_of(plan):
    """Return (action, item, name, function) of every change.

    The function returns the new WallPlan.
    """
    result = []
    for changes in (_straps, _lines, _hits, _tangents, _filling, _certificates):
        result += changes(plan)
    return result


def _filling(plan):
    def certified(*better):
        return lambda: changed(plan, raw=plan.with_instrument(*better))

    return changes_of_runs(plan, lambda **parts: _change_parts(plan, **parts), certified)


def wall_count(plan):
    """Return {item: number of items in a WallPlan} of the items that have a cost."""
    design, job, ring = plan.design, plan.job, plan.design.tangents
    read = (
        job.strapping and job.strapping.straps,
        job.lines and job.lines.offsets,
        job.hits,
        job.tangents,
    )
    return {
        "strap": len(design.straps),
        "line": 0 if job.lines is None else len(job.lines.lines),
        "setup": sum(hit.setups for hit in design.hits) + (0 if ring is None else ring.stations),
        "base": 0 if ring is None or ring.bar is None else 2 * ring.stations,
        "reading": sum(len(course) for course in read if course is not None),
        "run": len(design.runs),
        "batch": sum(run.batches for run in design.runs),
    }


def _change_parts(plan, **parts):
    return lambda: changed(plan, replace(plan.design, **parts))


def _straps(plan):
    design = plan.design
    for planned in design.straps:
        others = tuple(strap for strap in design.straps if strap is not planned)
        if others or design.hits or design.tangents is not None or design.runs:
            yield "drop", "strap", planned.name, _change_parts(plan, straps=others)
        if planned.readings < MOST_READINGS:
            again = replace(planned, readings=planned.readings + 1)
            straps = tuple(again if strap is planned else strap for strap in design.straps)
            yield "repeat", "strap", planned.name, _change_parts(plan, straps=straps)
    if not design.straps:
        return
    for course in plan.job.courses:
        taken = [strap.at_percent for strap in design.straps if strap.course == course.name]
        added = replace(design.straps[0], course=course.name, at_percent=between(taken), readings=1)
        yield "add", "strap", added.name, _change_parts(plan, straps=(*design.straps, added))
    finer = tuple(replace(strap, sd_mm=strap.sd_mm / 2) for strap in design.straps)
    yield "repeat", "accuracy", "straps", _change_parts(plan, straps=finer)


def between(heights):
    """Middle of the widest gap between heights, in percent, edges included.

    Examples
    --------
    >>> between([20, 80]), between([50]), between([])
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
    added = between(at_percent)
    yield "add", f"{added:g} %", tuple(sorted((*at_percent, added)))
    for percent in at_percent if len(at_percent) > 1 else ():
        yield "drop", f"{percent:g} %", tuple(at for at in at_percent if at != percent)


def _hits(plan):
    design = plan.design
    for number, ring in enumerate(design.hits, 1):

        def made(ring=ring, **parts):
            rings = tuple(replace(hits, **parts) if hits is ring else hits for hits in design.hits)
            return _change_parts(plan, hits=rings)

        yield "add", "hit", str(number), made(hits=ring.hits + max(1, ring.hits // 2))
        if ring.hits // 2 >= 1:
            yield "drop", "hit", str(number), made(hits=ring.hits - ring.hits // 2)
        yield "add", "setup", str(number), made(setups=ring.setups + 1)
        if ring.setups > 1:
            yield "drop", "setup", str(number), made(setups=ring.setups - 1)
        for action, name, at in _levels(ring.at_percent):
            yield action, "level", f"{name} ({number})", made(at_percent=at)
    if design.hits:
        yield from _first_straps(plan)


def _first_straps(plan):
    """Yield a first strapped course for a plan with a tape and no strap."""
    tapes = plan.given.registers.get("instruments")
    kinds = {} if tapes is None else {n: entry.get("kind") for n, entry in tapes.entries.items()}
    names = [name for name, kind in kinds.items() if kind and kind.raw == "tape"]
    if names and not plan.design.straps:
        first = plan.job.courses[0].name
        straps = tuple(
            PlannedStrap(first, at, 0.5, more=(("instrument", names[-1]),)) for at in USUAL_AT
        )
        yield "add", "strap", f"{first}-20, {first}-80", _change_parts(plan, straps=straps)


def _tangents(plan):
    ring = plan.design.tangents
    if ring is None:
        return

    def made(**parts):
        return _change_parts(plan, tangents=replace(ring, **parts))

    for action, count in (("add", ring.stations + 1), ("drop", ring.stations - 1)):
        if count >= FEWEST_SETUPS:
            radius = _even_ring_m(plan, count)
            yield action, "station", f"{radius:g} m", made(stations=count, radius_m=radius)
    if ring.readings < MOST_READINGS:
        yield "repeat", "reading", "tangents", made(readings=ring.readings + 1)
    for action, name, at in _levels(ring.at_percent):
        yield action, "level", name, made(at_percent=at)
    yield "repeat", "accuracy", "tangents", made(sd_arcsec=ring.sd_arcsec / 2)
    s_mm, s_arcsec = ring.traverse
    finer = (None if s_mm is None else s_mm / 2), s_arcsec / 2
    bar = ring.bar and (ring.bar[0], ring.bar[1] / 2)
    yield "repeat", "traverse", "traverse", made(traverse=finer, bar=bar)
    bars = tuple(lengths_of_bars(plan.given))
    if ring.bar is None:
        for name in bars:
            yield "add", "bar", name, made(bar=(name, BAR_SD_ARCSEC))
    elif s_mm is not None:
        yield "drop", "bar", ring.bar[0] or bars[0], made(bar=None)
        yield "drop", "ranging", "", made(traverse=(None, s_arcsec))
    yield from _first_straps(plan)


def _even_ring_m(plan, stations):
    """Radius of a ring of stations with evenly distributed limbs, if there is such a radius."""
    nominal, ring = plan.job.tank.nominal_diameter_m / 2, plan.design.tangents
    least = least_ring_m(stations, nominal)
    radius = even_radius_m(stations, max(ring.radius_m, least), nominal, least)
    return float(np.ceil(100 * (radius or max(ring.radius_m, least))) / 100)


def _certificates(plan):
    """Yield changes that halve the calibration uncertainty of an instrument in use."""
    register, used = plan.given.registers.get("instruments"), instruments_read(plan.job)
    for name, entry in {} if register is None else register.entries.items():
        given = {
            key: entry[key].raw / 2
            for key in BETTER
            if key in entry and isinstance(entry[key].raw, int | float) and entry[key].raw > 0
        }
        if given and name in used:
            yield (
                "repeat",
                "certificate",
                name,
                lambda name=name, given=given: changed(plan, raw=plan.with_instrument(name, given)),
            )


def instruments_read(job):
    """Names of the instruments that a Job uses, and of the masters of its tapes."""
    names = set()
    if job.strapping is not None:
        read = {strap.tape for strap in job.strapping.straps}
        names |= read | {tape.master for tape in job.strapping.tapes if tape.name in read}
    if job.lines is not None:
        names |= {line.instrument for line in job.lines.lines.values()}
    for sighted in (job.hits, job.tangents):
        if sighted is not None:
            names |= set(sighted.instrument)
    for readings in () if job.measurements is None else job.measurements.readings:
        names |= set(readings.instrument or ())
    return names - {"", None}
