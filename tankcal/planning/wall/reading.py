"""Build a WallPlan from the checked sections of a plan."""

import math
from copy import copy
from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.job.building import job_of
from tankcal.job.checking import zero_z
from tankcal.job.checks.extent import volume_by_sizes
from tankcal.job.checks.survey.readings import is_bar
from tankcal.job.tables import SETTINGS_FILE, Log, Value
from tankcal.messages import list_some, message
from tankcal.planning.contract import (
    MEASURING,
    PLAN_FILE,
    check_form,
    forms_m,
    no_such_name,
    too_many_sections,
)
from tankcal.planning.model import (
    USUAL_AT,
    Design,
    PlannedControl,
    PlannedHits,
    PlannedLines,
    PlannedStrap,
    PlannedTangents,
    WallPlan,
    even_radius_m,
    evenness_of_limbs,
)
from tankcal.planning.places import (
    check_obstacles,
    message_of_cut_line,
    message_of_misplaced_station,
    message_of_obstacle_at,
    obstacles_of,
)
from tankcal.planning.wall.design_tables import DesignTables
from tankcal.planning.wall.filling import check_runs, runs_of
from tankcal.planning.wall.nominal_readings import set_nominal_readings
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
        _require(ties, ("s_mm", "s_arcsec"), log)


def _require(entry, keys, log):
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
        _require(traverse, ("s_bar_arcsec",), log)
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


USUAL_HEIGHT_M = 1.6  # default height of an instrument above the bottom
SECTION_OF_TABLE = {  # tables that a design generates, and the section that messages name
    "circumferences.csv": "straps",
    "lines.csv": "lines",
    "offsets.csv": "lines",
    "wall_hits.csv": "hits",
    "setups.csv": "hits",
    "control.csv": "hits",
    "control_readings.csv": "control_targets",
    "directions.csv": "setup_ties",
    "zenith_angles.csv": "setup_ties",
    "slope_distances.csv": "setup_ties",
    "tangents.csv": "tangents",
    "liquid.csv": "runs",
}


def is_wall_plan(sections):
    """Return whether a plan measures the bare wall or uses metered liquid.

    sections: {section: content}.
    """
    return any(name in sections for name in MEASURING)


def design_of(plan_input, courses, celsius=None):
    """Return the `Design` of valid sections.

    Parameters
    ----------
    plan_input : PlanInput
    courses : tuple of str
        Names of the courses, from the bottom up.
    celsius : float, optional
        Temperature of the table.
    """
    more = ("instrument", "temperature_c", "tension_n", "pulls")
    straps = (
        PlannedStrap(
            course,
            percent,
            entry["s_mm"],
            int(entry["readings"] or 1),
            tuple((key, entry[key]) for key in more if entry[key] is not None),
        )
        for entry in plan_input.sections["straps"]
        for course in entry["courses"] or courses
        for percent in percents_of(entry)
    )
    ties = plan_input.sections["setup_ties"]
    return Design(
        straps=tuple(straps),
        lines=_lines(plan_input.sections["lines"]),
        hits=tuple(
            PlannedHits(
                setups=int(entry["setups"]),
                radius_m=entry["radius_m"],
                hits=int(entry["hits"]),
                at_percent=percents_of(entry),
                courses=entry["courses"] or courses,
                start_deg=entry["start_azimuth_deg"] or 0.0,
                height_m=USUAL_HEIGHT_M if entry["height_m"] is None else entry["height_m"],
                spread_deg=entry["spread_deg"],
                instrument=entry["instrument"],
            )
            for entry in plan_input.sections["hits"]
        ),
        ties=(int(ties["targets"]), ties["s_mm"], ties["s_arcsec"]) if ties.filled_keys else None,
        control=_control(plan_input.sections["control_targets"]),
        tangents=_tangents(plan_input.sections["tangents"], plan_input.sections["traverse"]),
        runs=runs_of(plan_input.sections["runs"], celsius),
    )


def _lines(entry):
    if not entry.filled_keys:
        return None
    return PlannedLines(
        count=int(entry["count"]),
        at_percent=percents_of(entry),
        sd_mm=entry["s_mm"],
        faces=int(entry["faces"] or 2),
        readings=int(entry["readings"] or 1),
        instrument=entry["instrument"],
        side=entry["side"] or "outside",
        first_deg=entry["first_azimuth_deg"] or 0.0,
    )


def _control(entry):
    values = {"targets": entry["targets"], "every_min": entry["every_min"]}
    values = {key: value for key, value in values.items() if value is not None}
    if "targets" in values:
        values["targets"] = int(values["targets"])
    return PlannedControl(**values, minutes=entry["minutes"])


def _tangents(entry, traverse):
    if not entry.filled_keys:
        return None
    bar_sd = traverse["s_bar_arcsec"]
    return PlannedTangents(
        stations=int(entry["stations"]),
        radius_m=entry["radius_m"],
        at_percent=percents_of(entry),
        sd_arcsec=entry["s_arcsec"],
        traverse=(traverse["s_mm"], traverse["s_arcsec"]),
        bar=None if bar_sd is None else (traverse["bar"], bar_sd),
        start_deg=entry["start_azimuth_deg"] or 0.0,
        height_m=USUAL_HEIGHT_M if entry["height_m"] is None else entry["height_m"],
        readings=int(entry["readings"] or 1),
        instrument=entry["instrument"],
    )


def wall_plan_of(raw, values, tables, plan_input, limits, folder):
    """Return the WallPlan of valid sections; its job is read like any other job.

    Parameters
    ----------
    raw : RawJob
        Content of the plan's folder.
    values : dict
        {section: {key: value}} of the settings of the job.
    tables : dict
        {name: ColumnValues or None} of the tables of the job.
    plan_input : PlanInput
    limits : Limits
    folder : str
        Name of the folder.

    Raises
    ------
    InputError
        Problems of generated tables are reported for the sections that generate them.
    """
    table, volume_at = tables["courses"], volume_by_sizes(values, raw)
    courses = ()
    if table is not None:
        courses = tuple(zip(table.of("course"), table.of("height_m"), strict=True))
    celsius = values["table"]["reference_temperature_c"]
    design = design_of(plan_input, tuple(name for name, _ in courses), celsius)
    wall, filling = plan_input.sections["wall"], plan_input.sections["filling"]
    amplitudes = assumed_amplitudes(*forms_m(wall), smoothed=design.is_smoothed)
    bottom, diameter = values["datum"]["bottom_z_m"], values["tank"]["nominal_diameter_m"]
    zero = 0.0 if bottom is None else zero_z(values) - bottom
    obstacles = () if bottom is None else obstacles_of(plan_input)
    tank = (courses, diameter and diameter / 2, bottom, zero, volume_at, obstacles)
    warnings = ()
    if obstacles:
        design_tables = DesignTables(design, *tank, bars=lengths_of_bars(raw))
        refuse_cut(design_tables, _rows_of(plan_input))
        warnings = warnings_of_obstacles(design_tables, _rows_of(plan_input))
    ppm = filling["expected_run_ppm"]
    expected = None if ppm is None else ppm / 1e6
    return WallPlan(
        job=job_of_design(raw, design, tank, (amplitudes, expected), _rows_of(plan_input)),
        design=design,
        limits=limits,
        amplitudes=amplitudes,
        costs={key: value or 0.0 for key, value in plan_input.sections["costs"].values.items()},
        dips_m=tuple(sorted(set(filling["dips_m"] or ()))),
        expected_run=expected,
        volume_at=volume_at,
        obstacles=obstacles,
        folder=folder,
        raw=raw,
        warnings=warnings,
    )


def _rows_of(plan_input):
    """Return {section: first row in plan.toml}."""
    first = {name: plan_input.entries(name)[:1] for name in plan_input.sections}
    return {name: entries[0].row for name, entries in first.items() if entries}


def change_plan(plan, design=None, raw=None):
    """Return the WallPlan with another design or other instruments, and its new job.

    Parameters
    ----------
    plan : WallPlan
    design : Design, optional
    raw : RawJob, optional
        Content of the folder with other instruments.

    Raises
    ------
    InputError
        If the readings of the new design are no valid job.
    """
    design, raw = design or plan.design, raw or plan.raw
    expected = plan.amplitudes, plan.expected_run
    job = job_of_design(raw, design, _tank_of(plan), expected)
    return replace(plan, job=job, design=design, raw=raw)


def tables_of(plan):
    """Return {name: Table} of all readings; their values are not defined."""
    bars = lengths_of_bars(plan.raw)
    return DesignTables(plan.design, *_tank_of(plan), bars=bars).tables()


def lengths_of_bars(raw):
    """Return {name: length, m} of the stadias in instruments.toml of a RawJob."""
    register = raw.registers.get("instruments")
    lengths = {}
    for name, entry in {} if register is None else register.entries.items():
        values = {key: value.raw for key, value in entry.items()}
        length = values.get("length_m")
        if is_bar(str(values.get("kind"))) and isinstance(length, int | float) and length > 0:
            lengths[name] = float(length)
    return lengths


def _tank_of(plan):
    """Return the arguments of `Foreseen` that describe the tank of a WallPlan."""
    job = plan.job
    courses = tuple((course.name, course.height_m) for course in job.courses)
    datum, diameter = job.datum, job.tank.nominal_diameter_m
    radius, bottom = diameter and diameter / 2, datum.bottom_z_m
    zero = 0.0 if bottom is None else datum.plate_level_m
    return courses, radius, bottom, zero, plan.volume_at, plan.obstacles


def job_of_design(raw, design, tank, expected, rows=None):
    """Return the Job of a RawJob and of the tables of a `Design`, with nominal readings.

    Parameters
    ----------
    raw : RawJob
    design : Design
    tank : tuple
        Courses, radius, z of the bottom, zero of the table, content function and obstacles, as for
        `Foreseen`.
    expected : tuple
        Amplitudes of the wall and run effect, as for `with_nominal_readings`.
    rows : dict, optional
        {section: row of plan.toml}, for messages.
    """
    tables = DesignTables(design, *tank, bars=lengths_of_bars(raw)).tables()
    settings = dict(raw.settings)
    if design.datum is not None:
        settings["adjustment"] = {"datum": Value(design.datum)} | settings.get("adjustment", {})
    whole = replace(raw, tables=raw.tables | tables, settings=settings)
    try:
        job = job_of(whole, Log())
    except InputError as error:
        raise InputError(locate_in_plan(error.problems, design, rows)) from error
    job = set_nominal_readings(job, *expected)
    return replace(job, warnings=locate_in_plan(job.warnings, design, rows))


def locate_in_plan(problems, design, rows=None):
    """Return problems of generated tables as problems of the sections that generate them.

    Parameters
    ----------
    problems : iterable of Problem
    design : Design
        Design that generated the tables.
    rows : dict, optional
        {section: row of plan.toml}.

    Returns
    -------
    tuple of Problem
        Without duplicates.
    """
    section_of = SECTION_OF_TABLE | design.parts[0].sections
    located = []
    for problem in problems:
        if problem.file in section_of:
            section = section_of[problem.file]
            row = (rows or {}).get(section)
            problem = replace(problem, file=PLAN_FILE, row=row, column=section, cell=None)
        elif problem.file == SETTINGS_FILE:
            problem = replace(problem, file=PLAN_FILE)
        located.append(problem)
    return tuple(dict.fromkeys(located))
