"""Checks of the sections of plan.toml for a bare wall, and of obstacles to its sights."""

import math
from copy import copy

import numpy as np

from tankcal.errors import Problem
from tankcal.job.tables import Log
from tankcal.messages import list_some, message
from tankcal.planning.contract import PLAN_FILE, check_form, no_such_name, too_many_sections
from tankcal.planning.visibility import (
    check_obstacles,
    message_of_cut_line,
    message_of_misplaced_station,
    message_of_obstacle_at,
)
from tankcal.planning.wall.filling import check_runs
from tankcal.planning.wall.model import USUAL_AT, even_radius_m, evenness_of_limbs
from tankcal.survey.reference_line import MOST_OFFSETS, too_many_offsets
from tankcal.survey.strapping import MOST_STRAPS, too_many_straps
from tankcal.survey.tangents import FEWEST_SETUPS, MOST_TANGENTS, too_many_tangents
from tankcal.survey.wall_hits import FEWEST_HITS, MOST_HITS, too_many_hits

CLEAR_M, MOST_SECTIONS = 0.5, 50
LIMBS = ("left", "right")
UNEVEN = 0.15  # smallest evenness of limbs (`evenness_of_limbs`); below it, limbs coincide
SELDOM_MIN = 30.0  # longest interval between readings of control targets, minutes
FEWEST_AZIMUTHS = 3  # fewest azimuths that determine a circle
OF_POINTS = ("pattern", "photo_rings", "setup_rings", "tapes")
SHOWN = 5  # largest number of obstacles listed in a message
SIGHTS = {  # tables of sights that obstacles hide, and the sections that make them
    "offsets": ("lines", message("plan_sights_offsets", "offsets")),
    "wall_hits": ("hits", message("plan_sights_hits", "hits")),
    "tangents": ("tangents", message("plan_sights_tangents", "tangents")),
}


def check_sections(plan_input, courses, nominal_m, raw, log):
    """Check the sections of a plan of a bare wall.

    Parameters
    ----------
    plan_input : PlanInput
    courses : sequence of str or None
        Names of the courses; None if unreadable.
    nominal_m : float or None
        Nominal radius of the tank; None if unreadable.
    raw : RawJob
        Content of the plan's folder.
    log : Log
    """
    for name in OF_POINTS:
        for section in plan_input.entries(name):
            if section.filled_keys:
                expected = message(
                    "plan_points_and_wall",
                    "given together with straps, lines, hits, tangents or runs of liquid; expected"
                    " only one of them: a plan is of targets or of the bare wall",
                )
                log.problem(PLAN_FILE, expected, section.row, section.name)
    for entry in (*plan_input.sections["straps"], *plan_input.sections["hits"]):
        for course in entry["courses"] or ():
            if courses and course not in courses:
                entry.report(log.problem, "courses", no_such_name(course, "courses.csv"))
    _check_rings(plan_input, nominal_m, log)
    if courses:
        _check_hits(plan_input.sections["hits"], courses, log)
    check_form(plan_input.sections["wall"], log)
    check_obstacles(plan_input, log)
    _check_lines_and_ties(plan_input, log)
    _check_tangents(plan_input, nominal_m, log)
    check_runs(plan_input, raw.settings.get("liquid", {}).get("run_ppm") is not None, log)
    if courses:
        _check_totals(plan_input, courses, log)


def _check_rings(plan_input, nominal_m, log):
    """Check the number of sections, and that set-ups stand clear of the wall."""
    for name in ("straps", "hits"):
        if len(plan_input.sections[name]) > MOST_SECTIONS:
            expected = too_many_sections(len(plan_input.sections[name]), MOST_SECTIONS)
            log.problem(PLAN_FILE, expected, None, name)
    for entry in plan_input.sections["hits"]:
        radius = entry["radius_m"]
        if None not in (radius, nominal_m) and abs(radius - nominal_m) < CLEAR_M:
            expected = message(
                "plan_setup_at_wall",
                "found {radius:g} m; expected {clear:g} m or more from the wall, which is at"
                " {nominal:g} m",
                radius=radius,
                clear=CLEAR_M,
                nominal=nominal_m,
            )
            entry.report(log.problem, "radius_m", expected)


def _check_hits(rings, courses, log):
    """Check that each course has enough hits for its sections, and not too many."""
    if any(None in (ring["setups"], ring["hits"]) for ring in rings):
        return  # reported already
    total = 0
    few = []  # rings
    for course in courses:
        here = [ring for ring in rings if course in (ring["courses"] or courses)]
        aims = [int(ring["setups"] * ring["hits"]) for ring in here]
        hits = sum(aim * len(percents_of(ring)) for aim, ring in zip(aims, here, strict=True))
        total += hits
        if sum(aims) < FEWEST_AZIMUTHS or hits < FEWEST_HITS:
            few += [ring for ring in here if ring not in few]
    for ring in few:
        fewest = max(FEWEST_AZIMUTHS, math.ceil(FEWEST_HITS / len(percents_of(ring))))
        expected = message(
            "plan_few_hits",
            "found {found:g}; expected {fewest} or more: the sections of a course need {hits} hits"
            " at {azimuths} azimuths at least",
            found=ring["hits"],
            fewest=math.ceil(fewest / ring["setups"]),
            hits=FEWEST_HITS,
            azimuths=FEWEST_AZIMUTHS,
        )
        ring.report(log.problem, "hits", expected)
    if total > MOST_HITS:
        log.problem(PLAN_FILE, too_many_hits(total), None, "hits")


def _check_lines_and_ties(plan_input, log):
    lines = plan_input.sections["lines"]
    if lines.filled_keys and not plan_input.sections["straps"]:
        expected = message(
            "plan_lines_alone",
            "given without [[straps]]; expected a circumference of one course at least: lines tell"
            " differences of radii alone",
        )
        log.problem(PLAN_FILE, expected, lines.row, "lines")
    ties = plan_input.sections["setup_ties"]
    if ties.filled_keys and not plan_input.sections["hits"]:
        expected = message("plan_ties_alone", "given without [[hits]]; expected set-ups to be tied")
        log.problem(PLAN_FILE, expected, ties.row, "setup_ties")
    _check_control(plan_input, log)
    if ties.filled_keys:
        _need(ties, ("s_mm", "s_arcsec"), log)


def _need(entry, keys, log):
    """Report missing numbers that a section needs."""
    for key in keys:
        if key not in entry.filled_keys:
            expected = message("plan_number_missing", "missing; expected a number above 0")
            entry.report(log.problem, key, expected)


def _check_control(plan_input, log):
    control = plan_input.sections["control_targets"]
    if control.filled_keys and not plan_input.sections["hits"]:
        expected = message(
            "plan_control_alone",
            "given without [[hits]]; expected set-ups of hits that read control targets",
        )
        log.problem(PLAN_FILE, expected, control.row, "control_targets")
    elif control["every_min"] is not None and control["every_min"] > SELDOM_MIN:
        expected = message(
            "plan_control_seldom",
            "control targets every {every:g} minutes; expected 15 to {most:g}: a tripod that sinks"
            " in between is seen late",
            every=control["every_min"],
            most=SELDOM_MIN,
        )
        control.report(log.warning, "every_min", expected)


def _check_tangents(plan_input, nominal_m, log):
    """Check that neighbouring stations see each other, and that no other sights exist."""
    ring, traverse = plan_input.sections["tangents"], plan_input.sections["traverse"]
    if traverse.filled_keys and not ring.filled_keys:
        expected = message(
            "plan_traverse_alone",
            "given without [tangents]; expected limbs that are sighted from it",
        )
        log.problem(PLAN_FILE, expected, traverse.row, "traverse")
    if not ring.filled_keys:
        return
    if not traverse.filled_keys:
        expected = message(
            "plan_tangents_untied",
            "given without [traverse]; expected s_mm and s_arcsec of the readings between its"
            " stations: they tie the sights",
        )
        log.problem(PLAN_FILE, expected, ring.row, "tangents")
    elif not traverse.filled_keys & {"s_mm", "s_bar_arcsec"}:
        expected = message(
            "plan_traverse_without_scale",
            "no distance is measured; expected s_mm, or s_bar_arcsec of a stadia: nothing else"
            " tells the scale",
        )
        traverse.report(log.problem, "s_mm", expected)
    elif "bar" in traverse.filled_keys:
        _need(traverse, ("s_bar_arcsec",), log)
    for name in ("lines", "hits"):
        other_section = next(iter(plan_input.entries(name)), None)
        if other_section is not None and other_section.filled_keys:
            expected = message(
                "plan_tangents_beside",
                "given together with [tangents]; expected only one of them: tankcal does not join"
                " them yet",
            )
            log.problem(PLAN_FILE, expected, other_section.row, name)
    count, radius = ring["stations"], ring["radius_m"]
    if count is not None and count < FEWEST_SETUPS:
        expected = message(
            "plan_few_stations",
            "found {found:g}; expected {fewest} or more: each level is sighted from so many",
            found=count,
            fewest=FEWEST_SETUPS,
        )
        ring.report(log.problem, "stations", expected)
        return
    if None in (count, radius, nominal_m):
        return
    least = least_ring_m(count, nominal_m)
    if radius < least:
        expected = message(
            "plan_stations_blind",
            "found {radius:g} m; expected {least:.2f} m or more: the lines between {count:g}"
            " stations must pass the wall, which is at {nominal:g} m, by {clear:g} m",
            radius=radius,
            least=np.ceil(100 * least) / 100,
            count=count,
            clear=CLEAR_M,
            nominal=nominal_m,
        )
        ring.report(log.problem, "radius_m", expected)
    elif evenness_of_limbs(count, radius, nominal_m) < UNEVEN:
        better = even_radius_m(int(count), radius, nominal_m, least)
        expected = message(
            "plan_limbs_coincide",
            "at {radius:g} m the limbs of {count:g} stations fall on nearly the same places of the"
            " wall, two by two; at {better:.2f} m they lie evenly",
            radius=radius,
            count=count,
            better=better or 2 * radius,
        )
        ring.report(log.warning, "radius_m", expected)


def least_ring_m(stations, nominal_m):
    """Smallest radius of a ring of stations that see each other past the wall, m."""
    return float(nominal_m / np.cos(np.pi / stations) + CLEAR_M)


def _check_totals(plan_input, courses, log):
    """Check that no kind has too many readings."""
    straps = sum(
        len(entry["courses"] or courses) * len(percents_of(entry)) * int(entry["readings"] or 1)
        for entry in plan_input.sections["straps"]
    )
    if straps > MOST_STRAPS:
        log.problem(PLAN_FILE, too_many_straps(straps), None, "straps")
    lines, ring = plan_input.sections["lines"], plan_input.sections["tangents"]
    levels = len(courses) * len(percents_of(lines))
    offsets = int((lines["count"] or 0) * (lines["faces"] or 2) * (lines["readings"] or 1)) * levels
    if lines.filled_keys and offsets > MOST_OFFSETS:
        log.problem(PLAN_FILE, too_many_offsets(offsets), lines.row, "lines")
    levels = len(courses) * len(percents_of(ring))
    tangents = int((ring["stations"] or 0) * (ring["readings"] or 1)) * levels * len(LIMBS)
    if ring.filled_keys and tangents > MOST_TANGENTS:
        log.problem(PLAN_FILE, too_many_tangents(tangents), ring.row, "tangents")


def percents_of(entry):
    """Heights of the readings in each course, percent of its height, from the bottom up."""
    return tuple(sorted(set(entry["at_percent"] or USUAL_AT)))


# ---- obstacles: hidden sights are left out


def refuse_cut(design_tables, rows):
    """Raise InputError for stations in obstacles, cut lines between stations, and no sights left.

    design_tables: DesignTables; rows: {section: row of plan.toml}.
    """
    log = Log()
    section = design_tables.design.parts[0].section
    for name, place in design_tables.instrument_positions():
        why = message_of_obstacle_at(design_tables.obstacles, place)
        if why:
            log.problem(
                PLAN_FILE, message_of_misplaced_station(name, why), rows.get(section), section
            )
    log.stop_if_problems()
    for ends in design_tables.cut_lines():
        log.problem(PLAN_FILE, message_of_cut_line(*ends), rows.get("traverse"), "traverse")
    every = _sights(design_tables, ())
    for name, count in _sights(design_tables, design_tables.obstacles).items():
        if not count:
            section, sights = SIGHTS[name]
            text = message(
                "plan_all_hidden",
                "obstacles hide all of the {all} {sights}; expected some in sight",
                all=every[name],
                sights=sights,
            )
            log.problem(PLAN_FILE, text, rows.get(section), section)
    log.stop_if_problems()


def warnings_of_obstacles(design_tables, rows):
    """Warn of the number of sights left out, and of obstacles that hide none; a tuple of Problem.

    Parameters are those of `refuse_cut`.
    """
    every, problems = _sights(design_tables, ()), []
    for name, count in _sights(design_tables, design_tables.obstacles).items():
        section, sights = SIGHTS[name]
        if count < every[name]:
            text = message(
                "plan_hidden_sights",
                "obstacles hide {hidden} of {all} {sights}: they are left out",
                hidden=every[name] - count,
                all=every[name],
                sights=sights,
            )
            problems.append(Problem(PLAN_FILE, text, rows.get(section), section))
    idle = [
        obstacle.name
        for obstacle in design_tables.obstacles
        if _sights(design_tables, (obstacle,)) == every
    ]
    if idle:
        text = message(
            "plan_obstacles_idle",
            "without any effect on what is sighted: {obstacles}; are they in the frame of the"
            " survey, in metres, the axis of the tank at x = 0, y = 0?",
            obstacles=list_some(idle, SHOWN),
        )
        problems.append(Problem(PLAN_FILE, text, rows.get("obstacles"), "obstacles"))
    return tuple(problems)


def _sights(design_tables, obstacles):
    """Return {table: number of sights} with given obstacles."""
    without = copy(design_tables)
    without.obstacles = obstacles
    return {name: len(table.rows) for name, table in without.tables().items() if name in SIGHTS}
