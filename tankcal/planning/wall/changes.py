"""Changes of a WallPlan by one item: strap, lines, level, hits, set-up, station, run of liquid, a
better instrument.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from tankcal.job.checks.tangents import FEWEST_SETUPS
from tankcal.planning.wall.checks import least_ring_m
from tankcal.planning.wall.filling_changes import changes_of_runs
from tankcal.planning.wall.model import USUAL_AT, PlannedStrap, even_radius_m
from tankcal.planning.wall.reading import changed, lengths_of_bars

OF_FILLING = ("step", "top_of_run", "half_steps", "empty_start", "run")
SEARCHED = (
    *("strap", "line", "face", "level", "hit", "setup", "station", "bar", "ranging", "reading"),
    *OF_FILLING,
)
WALL_ITEMS = (  # the last are no part of a design
    *(*SEARCHED, "accuracy", "traverse", "certificate", "meter", "batches"),
)
NUMBERED = ("level", "station")  # items that are named by a number, with a decimal point
MORE_LINES, BAR_SD_ARCSEC = 4, 1.0  # of what is added
BETTER = ("u_scale_ppm", "u_offset_mm", "u_collimation_arcsec", "u_incidence_mm", "u_mm")
MOST_FACES, MOST_READINGS, FEWEST_LINES, FEWEST_HITS = 2, 20, 4, 5


def wall_changes_of(plan):
    """(action, item, name, how) of every change; how() is the WallPlan after it."""
    found = []
    for changes in (_straps, _lines, _hits, _tangents, _filling, _certificates):
        found += changes(plan)
    return found


def _filling(plan):
    def certified(*better):
        return lambda: changed(plan, raw=plan.with_instrument(*better))

    return changes_of_runs(plan, lambda **parts: _made(plan, **parts), certified)


def wall_count(plan):
    """{item: how many of it a WallPlan has}, of those that cost."""
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
        "setup": sum(one.setups for one in design.hits) + (0 if ring is None else ring.stations),
        "base": 0 if ring is None or ring.bar is None else 2 * ring.stations,
        "reading": sum(len(one) for one in read if one is not None),
        "run": len(design.runs),
        "batch": sum(one.batches for one in design.runs),
    }


def _made(plan, **parts):
    return lambda: changed(plan, replace(plan.design, **parts))


def _straps(plan):
    design = plan.design
    for one in design.straps:
        others = tuple(strap for strap in design.straps if strap is not one)
        if others or design.hits or design.tangents is not None or design.runs:
            yield "drop", "strap", one.name, _made(plan, straps=others)
        if one.readings < MOST_READINGS:
            again = replace(one, readings=one.readings + 1)
            straps = tuple(again if strap is one else strap for strap in design.straps)
            yield "repeat", "strap", one.name, _made(plan, straps=straps)
    if not design.straps:
        return
    for course in plan.job.courses:
        taken = [one.at_percent for one in design.straps if one.course == course.name]
        added = replace(design.straps[0], course=course.name, at_percent=between(taken), readings=1)
        yield "add", "strap", added.name, _made(plan, straps=(*design.straps, added))
    finer = tuple(replace(one, sd_mm=one.sd_mm / 2) for one in design.straps)
    yield "repeat", "accuracy", "straps", _made(plan, straps=finer)


def between(taken):
    """The middle of the widest gap between heights, percent, as far from an edge as from another.

    Examples
    --------
    >>> between([20, 80]), between([50]), between([])
    (50.0, 25.0, 50.0)
    """
    marks = [0.0, *sorted(taken), 100.0]
    gaps = [(high - low, -low) for low, high in pairwise(marks)]
    wide, low = max(gaps)
    return -low + wide / 2


def _lines(plan):
    lines = plan.design.lines
    if lines is None:
        return
    count = lines.count + MORE_LINES
    yield "add", "line", str(MORE_LINES), _made(plan, lines=replace(lines, count=count))
    if lines.count - MORE_LINES >= FEWEST_LINES:
        fewer = replace(lines, count=lines.count - MORE_LINES)
        yield "drop", "line", str(MORE_LINES), _made(plan, lines=fewer)
    other = MOST_FACES + 1 - lines.faces
    action = "add" if other == MOST_FACES else "drop"
    yield action, "face", "2", _made(plan, lines=replace(lines, faces=other))
    if lines.readings < MOST_READINGS:
        again = replace(lines, readings=lines.readings + 1)
        yield "repeat", "reading", "offsets", _made(plan, lines=again)
    for action, name, at in _levels(lines.at_percent):
        yield action, "level", name, _made(plan, lines=replace(lines, at_percent=at))


def _levels(at_percent):
    """(action, percent, heights after it) of a height more or less in every course."""
    added = between(at_percent)
    yield "add", f"{added:g} %", tuple(sorted((*at_percent, added)))
    for one in at_percent if len(at_percent) > 1 else ():
        yield "drop", f"{one:g} %", tuple(at for at in at_percent if at != one)


def _hits(plan):
    design = plan.design
    for number, ring in enumerate(design.hits, 1):

        def made(ring=ring, **parts):
            rings = tuple(replace(one, **parts) if one is ring else one for one in design.hits)
            return _made(plan, hits=rings)

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
    """A strapped course beside points, where there is a tape and no strap yet."""
    tapes = plan.given.registers.get("instruments")
    kinds = {} if tapes is None else {n: one.get("kind") for n, one in tapes.entries.items()}
    names = [name for name, kind in kinds.items() if kind and kind.raw == "tape"]
    if names and not plan.design.straps:
        first = plan.job.courses[0].name
        straps = tuple(
            PlannedStrap(first, at, 0.5, more=(("instrument", names[-1]),)) for at in USUAL_AT
        )
        yield "add", "strap", f"{first}-20, {first}-80", _made(plan, straps=straps)


def _tangents(plan):
    ring = plan.design.tangents
    if ring is None:
        return

    def made(**parts):
        return _made(plan, tangents=replace(ring, **parts))

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
    """Radius of the ring with so many stations, whose limbs lie evenly where they can."""
    nominal, ring = plan.job.tank.nominal_diameter_m / 2, plan.design.tangents
    least = least_ring_m(stations, nominal)
    found = even_radius_m(stations, max(ring.radius_m, least), nominal, least)
    return float(np.ceil(100 * (found or max(ring.radius_m, least))) / 100)


def _certificates(plan):
    """Instruments that read something whose certificate would be twice as good."""
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
    """Names of the instruments of a Job that read something, and of the masters of its tapes."""
    found = set()
    if job.strapping is not None:
        read = {one.tape for one in job.strapping.straps}
        found |= read | {one.master for one in job.strapping.tapes if one.name in read}
    if job.lines is not None:
        found |= {one.instrument for one in job.lines.lines.values()}
    for sighted in (job.hits, job.tangents):
        if sighted is not None:
            found |= set(sighted.instrument)
    for given in () if job.measurements is None else job.measurements.readings:
        found |= set(given.instrument or ())
    return found - {"", None}
