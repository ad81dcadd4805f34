"""From the sections of a plan to a WallPlan: a design, its tables, and the job that reads them."""

import math
from dataclasses import replace

import numpy as np

from tankcal.errors import InputError
from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.job.building import job_of
from tankcal.job.checking import zero_z
from tankcal.job.checks.hits import FEWEST_HITS, MOST_HITS, too_many_hits
from tankcal.job.checks.lines import MOST_OFFSETS, too_many_offsets
from tankcal.job.checks.sized_volumes import volume_by_sizes
from tankcal.job.checks.strapping import MOST_STRAPS, too_many_straps
from tankcal.job.checks.survey.stadia import is_bar
from tankcal.job.checks.tangents import FEWEST_SETUPS, MOST_TANGENTS, too_many_tangents
from tankcal.job.tables import Log, Value
from tankcal.messages import message
from tankcal.planning.fields import check_form, no_such_name, too_many_sections
from tankcal.planning.given import PLAN_FILE
from tankcal.planning.obstacles import check_obstacles, obstacles_of
from tankcal.planning.wall.contract import MEASURING
from tankcal.planning.wall.filling import check_runs, runs_of
from tankcal.planning.wall.foreseen_tables import Foreseen
from tankcal.planning.wall.model import (
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
from tankcal.planning.wall.nominal_readings import with_nominal_readings
from tankcal.planning.wall.obstructed import refuse_cut, warnings_of_obstacles
from tankcal.planning.wall.telling import told_of_plan

CLEAR_M, MOST_SECTIONS = 0.5, 50
LIMBS = ("left", "right")
UNEVEN = 0.15  # of limbs: nearer to each other than that, they are the same place, about
USUAL_HEIGHT_M = 1.6  # of an instrument above the bottom
SELDOM_MIN = 30.0  # between readings of control targets
FEWEST_AZIMUTHS = 3  # that a circle goes through
OF_POINTS = ("pattern", "photo_rings", "setup_rings", "tapes")


def is_wall_plan(own):
    """Does a plan say how its wall is strapped, read from lines, hit, sighted by its limbs, or
    filled by meter?

    own  {section: what stands there}
    """
    return any(name in own for name in MEASURING)


def check_sections(given, courses, nominal_m, raw, log):
    """What the sections of a plan say that cannot be meant.

    courses  names, None: unreadable       nominal_m  radius of the tank, None: unreadable
    raw      RawJob of the plan
    """
    for name in OF_POINTS:
        entries = given.repeated[name] if name in given.repeated else [given.single[name]]
        for one in entries:
            if one.filled:
                expected = message(
                    "plan_points_and_wall",
                    "given together with straps, lines, hits, tangents or runs of liquid; expected"
                    " only one of them: a plan is of targets or of the bare wall",
                )
                log.problem(PLAN_FILE, expected, one.row, one.name)
    for one in (*given.repeated["straps"], *given.repeated["hits"]):
        for course in one["courses"] or ():
            if courses and course not in courses:
                one.tell(log.problem, "courses", no_such_name(course, "courses.csv"))
    _check_rings(given, nominal_m, log)
    if courses:
        _check_hits(given.repeated["hits"], courses, log)
    check_form(given.single["wall"], log)
    check_obstacles(given, log)
    _check_lines_and_ties(given, log)
    _check_tangents(given, nominal_m, log)
    check_runs(given, raw.settings.get("liquid", {}).get("run_ppm") is not None, log)
    if courses:
        _check_totals(given, courses, log)


def _check_rings(given, nominal_m, log):
    """Not too many sections; set-ups that stand clear of the wall."""
    for name in ("straps", "hits"):
        if len(given.repeated[name]) > MOST_SECTIONS:
            expected = too_many_sections(len(given.repeated[name]), MOST_SECTIONS)
            log.problem(PLAN_FILE, expected, None, name)
    for one in given.repeated["hits"]:
        radius = one["radius_m"]
        if None not in (radius, nominal_m) and abs(radius - nominal_m) < CLEAR_M:
            expected = message(
                "plan_setup_at_wall",
                "found {radius:g} m; expected {clear:g} m or more from the wall, which is at"
                " {nominal:g} m",
                radius=radius,
                clear=CLEAR_M,
                nominal=nominal_m,
            )
            one.tell(log.problem, "radius_m", expected)


def _check_hits(rings, courses, log):
    """Enough hits for the sections of each course, and not more than can be used."""
    if any(None in (ring["setups"], ring["hits"]) for ring in rings):
        return  # told already
    total = 0
    few = []  # rings
    for course in courses:
        here = [ring for ring in rings if course in (ring["courses"] or courses)]
        aims = [int(ring["setups"] * ring["hits"]) for ring in here]
        hits = sum(aim * len(_at(ring)) for aim, ring in zip(aims, here, strict=True))
        total += hits
        if sum(aims) < FEWEST_AZIMUTHS or hits < FEWEST_HITS:
            few += [ring for ring in here if ring not in few]
    for ring in few:
        fewest = max(FEWEST_AZIMUTHS, math.ceil(FEWEST_HITS / len(_at(ring))))
        expected = message(
            "plan_few_hits",
            "found {found:g}; expected {fewest} or more: the sections of a course need {hits} hits"
            " at {azimuths} azimuths at least",
            found=ring["hits"],
            fewest=math.ceil(fewest / ring["setups"]),
            hits=FEWEST_HITS,
            azimuths=FEWEST_AZIMUTHS,
        )
        ring.tell(log.problem, "hits", expected)
    if total > MOST_HITS:
        log.problem(PLAN_FILE, too_many_hits(total), None, "hits")


def _check_lines_and_ties(given, log):
    lines = given.single["lines"]
    if lines.filled and not given.repeated["straps"]:
        expected = message(
            "plan_lines_alone",
            "given without [[straps]]; expected a circumference of one course at least: lines tell"
            " differences of radii alone",
        )
        log.problem(PLAN_FILE, expected, lines.row, "lines")
    ties = given.single["setup_ties"]
    if ties.filled and not given.repeated["hits"]:
        expected = message("plan_ties_alone", "given without [[hits]]; expected set-ups to be tied")
        log.problem(PLAN_FILE, expected, ties.row, "setup_ties")
    _check_control(given, log)
    if ties.filled:
        _need(ties, ("s_mm", "s_arcsec"), log)


def _need(entry, keys, log):
    """Numbers without which a section says nothing."""
    for key in keys:
        if key not in entry.filled:
            expected = message("plan_number_missing", "missing; expected a number above 0")
            entry.tell(log.problem, key, expected)


def _check_control(given, log):
    control = given.single["control_targets"]
    if control.filled and not given.repeated["hits"]:
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
        control.tell(log.warning, "every_min", expected)


def _check_tangents(given, nominal_m, log):
    """A traverse whose stations see each other past the tank, and no other sights beside it."""
    ring, traverse = given.single["tangents"], given.single["traverse"]
    if traverse.filled and not ring.filled:
        expected = message(
            "plan_traverse_alone",
            "given without [tangents]; expected limbs that are sighted from it",
        )
        log.problem(PLAN_FILE, expected, traverse.row, "traverse")
    if not ring.filled:
        return
    if not traverse.filled:
        expected = message(
            "plan_tangents_untied",
            "given without [traverse]; expected s_mm and s_arcsec of the readings between its"
            " stations: they tie the sights",
        )
        log.problem(PLAN_FILE, expected, ring.row, "tangents")
    elif not traverse.filled & {"s_mm", "s_bar_arcsec"}:
        expected = message(
            "plan_traverse_without_scale",
            "no distance is measured; expected s_mm, or s_bar_arcsec of a stadia: nothing else"
            " tells the scale",
        )
        traverse.tell(log.problem, "s_mm", expected)
    elif "bar" in traverse.filled:
        _need(traverse, ("s_bar_arcsec",), log)
    for name in ("lines", "hits"):
        other = given.single.get(name) or next(iter(given.repeated.get(name, ())), None)
        if other is not None and other.filled:
            expected = message(
                "plan_tangents_beside",
                "given together with [tangents]; expected only one of them: tankcal does not join"
                " them yet",
            )
            log.problem(PLAN_FILE, expected, other.row, name)
    count, radius = ring["stations"], ring["radius_m"]
    if count is not None and count < FEWEST_SETUPS:
        expected = message(
            "plan_few_stations",
            "found {found:g}; expected {fewest} or more: each level is sighted from so many",
            found=count,
            fewest=FEWEST_SETUPS,
        )
        ring.tell(log.problem, "stations", expected)
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
        ring.tell(log.problem, "radius_m", expected)
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
        ring.tell(log.warning, "radius_m", expected)


def least_ring_m(stations, nominal_m):
    """Radius of a ring whose stations see each other past the wall."""
    return float(nominal_m / np.cos(np.pi / stations) + CLEAR_M)


def _check_totals(given, courses, log):
    """Not more readings of a kind than can be used."""
    straps = sum(
        len(one["courses"] or courses) * len(_at(one)) * int(one["readings"] or 1)
        for one in given.repeated["straps"]
    )
    if straps > MOST_STRAPS:
        log.problem(PLAN_FILE, too_many_straps(straps), None, "straps")
    lines, ring = given.single["lines"], given.single["tangents"]
    levels = len(courses) * len(_at(lines))
    offsets = int((lines["count"] or 0) * (lines["faces"] or 2) * (lines["readings"] or 1)) * levels
    if lines.filled and offsets > MOST_OFFSETS:
        log.problem(PLAN_FILE, too_many_offsets(offsets), lines.row, "lines")
    levels = len(courses) * len(_at(ring))
    tangents = int((ring["stations"] or 0) * (ring["readings"] or 1)) * levels * len(LIMBS)
    if ring.filled and tangents > MOST_TANGENTS:
        log.problem(PLAN_FILE, too_many_tangents(tangents), ring.row, "tangents")


def design_of(given, courses, celsius=None):
    """The `Design` of sound sections on a tank of these courses.

    celsius  temperature of the table
    """
    straps = (
        PlannedStrap(course, percent, one["s_mm"], int(one["readings"] or 1), _more(one))
        for one in given.repeated["straps"]
        for course in one["courses"] or courses
        for percent in _at(one)
    )
    return Design(
        straps=tuple(straps),
        lines=_lines(given.single["lines"]),
        hits=tuple(_hits(one, courses) for one in given.repeated["hits"]),
        ties=_ties(given.single["setup_ties"]),
        control=_control(given.single["control_targets"]),
        tangents=_tangents(given.single["tangents"], given.single["traverse"]),
        runs=runs_of(given.repeated["runs"], celsius),
    )


def _at(entry):
    return tuple(sorted(set(entry["at_percent"] or USUAL_AT)))


def _more(entry):
    keys = ("instrument", "temperature_c", "tension_n", "pulls")
    return tuple((key, entry[key]) for key in keys if entry[key] is not None)


def _lines(entry):
    if not entry.filled:
        return None
    return PlannedLines(
        count=int(entry["count"]),
        at_percent=_at(entry),
        sd_mm=entry["s_mm"],
        faces=int(entry["faces"] or 2),
        readings=int(entry["readings"] or 1),
        instrument=entry["instrument"],
        side=entry["side"] or "outside",
        first_deg=entry["first_azimuth_deg"] or 0.0,
    )


def _hits(entry, courses):
    return PlannedHits(
        setups=int(entry["setups"]),
        radius_m=entry["radius_m"],
        hits=int(entry["hits"]),
        at_percent=_at(entry),
        courses=entry["courses"] or courses,
        start_deg=entry["start_azimuth_deg"] or 0.0,
        height_m=USUAL_HEIGHT_M if entry["height_m"] is None else entry["height_m"],
        spread_deg=entry["spread_deg"],
        instrument=entry["instrument"],
    )


def _ties(entry):
    if not entry.filled:
        return None
    return int(entry["targets"]), entry["s_mm"], entry["s_arcsec"]


def _control(entry):
    given = {"targets": entry["targets"], "every_min": entry["every_min"]}
    given = {key: value for key, value in given.items() if value is not None}
    if "targets" in given:
        given["targets"] = int(given["targets"])
    return PlannedControl(**given, minutes=entry["minutes"])


def _tangents(entry, traverse):
    if not entry.filled:
        return None
    return PlannedTangents(
        stations=int(entry["stations"]),
        radius_m=entry["radius_m"],
        at_percent=_at(entry),
        sd_arcsec=entry["s_arcsec"],
        traverse=(traverse["s_mm"], traverse["s_arcsec"]),
        bar=_bar(traverse),
        start_deg=entry["start_azimuth_deg"] or 0.0,
        height_m=USUAL_HEIGHT_M if entry["height_m"] is None else entry["height_m"],
        readings=int(entry["readings"] or 1),
        instrument=entry["instrument"],
    )


def _bar(traverse):
    sd = traverse["s_bar_arcsec"]
    return None if sd is None else (traverse["bar"], sd)


def wall_plan_of(raw, values, tables, given, limits, folder):
    """The WallPlan of sound sections, its job being read as any job is.

    Raises InputError: what the job says of its tables is told of the section that makes them.
    """
    table, holds = tables["courses"], volume_by_sizes(values, raw)
    courses = ()
    if table is not None:
        courses = tuple(zip(table.of("course"), table.of("height_m"), strict=True))
    celsius = values["table"]["reference_temperature_c"]
    design = design_of(given, tuple(name for name, _ in courses), celsius)
    wall, filling = given.single["wall"], given.single["filling"]
    sizes = (
        None if wall[key] is None else wall[key] / 1000 for key in ("form_mm", "common_form_mm")
    )
    amplitudes = assumed_amplitudes(*sizes, limbs=design.tangents is not None)
    bottom, diameter = values["datum"]["bottom_z_m"], values["tank"]["nominal_diameter_m"]
    zero = 0.0 if bottom is None else zero_z(values) - bottom
    obstacles = () if bottom is None else obstacles_of(given)
    tank = (courses, diameter and diameter / 2, bottom, zero, holds, obstacles)
    warnings = ()
    if obstacles:
        foreseen = Foreseen(design, *tank, bars=lengths_of_bars(raw))
        refuse_cut(foreseen, _rows_of(given))
        warnings = warnings_of_obstacles(foreseen, _rows_of(given))
    ppm = filling["expected_run_ppm"]
    expected = None if ppm is None else ppm / 1e6
    return WallPlan(
        job=job_of_design(raw, design, tank, (amplitudes, expected), _rows_of(given)),
        design=design,
        limits=limits,
        amplitudes=amplitudes,
        costs={key: value or 0.0 for key, value in given.single["costs"].values.items()},
        dips_m=tuple(sorted(set(filling["dips_m"] or ()))),
        expected_run=expected,
        holds=holds,
        obstacles=obstacles,
        folder=folder,
        given=raw,
        warnings=warnings,
    )


def _rows_of(given):
    """{section: row of plan.toml where it begins}."""
    rows = {name: one.row for name, one in given.single.items()}
    return rows | {name: found[0].row for name, found in given.repeated.items() if found}


def changed(plan, design=None, raw=None):
    """The WallPlan with another Design, or with other instruments."""
    design, raw = design or plan.design, raw or plan.given
    expected = plan.amplitudes, plan.expected_run
    job = job_of_design(raw, design, _tank_of(plan), expected)
    return replace(plan, job=job, design=design, given=raw)


def tables_of(plan):
    """{name: Table} of what will be read, whatever stands as its value."""
    bars = lengths_of_bars(plan.given)
    return Foreseen(plan.design, *_tank_of(plan), bars=bars).tables()


def lengths_of_bars(raw):
    """{name: length, m} of the stadias of a RawJob whose instruments.toml tells it."""
    register = raw.registers.get("instruments")
    found = {}
    for name, entry in {} if register is None else register.entries.items():
        given = {key: one.raw for key, one in entry.items()}
        length = given.get("length_m")
        if is_bar(str(given.get("kind"))) and isinstance(length, int | float) and length > 0:
            found[name] = float(length)
    return found


def _tank_of(plan):
    """Of a WallPlan, as `Foreseen` takes it."""
    job = plan.job
    courses = tuple((one.name, one.height_m) for one in job.courses)
    datum, diameter = job.datum, job.tank.nominal_diameter_m
    radius, bottom = diameter and diameter / 2, datum.bottom_z_m
    zero = 0.0 if bottom is None else datum.plate_level_m
    return courses, radius, bottom, zero, plan.holds, plan.obstacles


def job_of_design(raw, design, tank, expected, rows=None):
    """The Job of a RawJob and the tables that a `Design` makes, with the readings foreseen.

    tank      courses, radius, z of the bottom, zero of the table above it, what it holds, what
              stands in the way: as `Foreseen` takes them
    expected  amplitudes of the wall, and the run effect, as `with_nominal_readings` takes them
    rows      {section: row of plan.toml}, for what is told
    """
    made = Foreseen(design, *tank, bars=lengths_of_bars(raw)).tables()
    settings = dict(raw.settings)
    datum = datum_of(design)
    if datum is not None:
        settings["adjustment"] = {"datum": Value(datum)} | settings.get("adjustment", {})
    whole = replace(raw, tables=raw.tables | made, settings=settings)
    try:
        job = job_of(whole, Log())
    except InputError as error:
        raise InputError(told_of_plan(error.problems, design, rows)) from error
    job = with_nominal_readings(job, *expected)
    return replace(job, warnings=told_of_plan(job.warnings, design, rows))


def datum_of(design):
    """`adjustment.datum` of the network of a `Design`, where a plan does not say it; None: none."""
    if design.tangents is not None:
        return "minimal"
    return None if design.ties is None else "inner"
