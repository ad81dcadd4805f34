"""Build a WallPlan from the sections of a plan: design, tables, and the job that reads them."""

from dataclasses import replace

from tankcal.errors import InputError
from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.job.building import job_of
from tankcal.job.checking import zero_z
from tankcal.job.checks.sized_volumes import volume_by_sizes
from tankcal.job.checks.survey.stadia import is_bar
from tankcal.job.tables import Log, Value
from tankcal.planning.obstacles import obstacles_of
from tankcal.planning.wall.checks import percents_of
from tankcal.planning.wall.contract import MEASURING
from tankcal.planning.wall.filling import runs_of
from tankcal.planning.wall.foreseen_tables import Foreseen
from tankcal.planning.wall.model import (
    Design,
    PlannedControl,
    PlannedHits,
    PlannedLines,
    PlannedStrap,
    PlannedTangents,
    WallPlan,
)
from tankcal.planning.wall.nominal_readings import with_nominal_readings
from tankcal.planning.wall.obstructed import refuse_cut, warnings_of_obstacles
from tankcal.planning.wall.telling import told_of_plan

USUAL_HEIGHT_M = 1.6  # default height of an instrument above the bottom


def is_wall_plan(sections):
    """Return whether a plan measures the bare wall or uses metered liquid.

    sections: {section: content}.
    """
    return any(name in sections for name in MEASURING)


def design_of(given, courses, celsius=None):
    """Return the `Design` of valid sections for the given courses.

    celsius: temperature of the table.
    """
    straps = (
        PlannedStrap(course, percent, entry["s_mm"], int(entry["readings"] or 1), _more(entry))
        for entry in given.repeated["straps"]
        for course in entry["courses"] or courses
        for percent in percents_of(entry)
    )
    return Design(
        straps=tuple(straps),
        lines=_lines(given.single["lines"]),
        hits=tuple(_hits(entry, courses) for entry in given.repeated["hits"]),
        ties=_ties(given.single["setup_ties"]),
        control=_control(given.single["control_targets"]),
        tangents=_tangents(given.single["tangents"], given.single["traverse"]),
        runs=runs_of(given.repeated["runs"], celsius),
    )


def _more(entry):
    keys = ("instrument", "temperature_c", "tension_n", "pulls")
    return tuple((key, entry[key]) for key in keys if entry[key] is not None)


def _lines(entry):
    if not entry.filled:
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


def _hits(entry, courses):
    return PlannedHits(
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


def _ties(entry):
    if not entry.filled:
        return None
    return int(entry["targets"]), entry["s_mm"], entry["s_arcsec"]


def _control(entry):
    values = {"targets": entry["targets"], "every_min": entry["every_min"]}
    values = {key: value for key, value in values.items() if value is not None}
    if "targets" in values:
        values["targets"] = int(values["targets"])
    return PlannedControl(**values, minutes=entry["minutes"])


def _tangents(entry, traverse):
    if not entry.filled:
        return None
    return PlannedTangents(
        stations=int(entry["stations"]),
        radius_m=entry["radius_m"],
        at_percent=percents_of(entry),
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
    """Return the WallPlan of valid sections; its job is read like any other job.

    Raises InputError. Problems of generated tables are reported for the sections that generate
    them.
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
    amplitudes = assumed_amplitudes(*sizes, smoothed=design.is_smoothed)
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
    """Return {section: first row in plan.toml}."""
    rows = {name: entry.row for name, entry in given.single.items()}
    return rows | {name: entries[0].row for name, entries in given.repeated.items() if entries}


def changed(plan, design=None, raw=None):
    """Return the WallPlan with another Design or other instruments."""
    design, raw = design or plan.design, raw or plan.given
    expected = plan.amplitudes, plan.expected_run
    job = job_of_design(raw, design, _tank_of(plan), expected)
    return replace(plan, job=job, design=design, given=raw)


def tables_of(plan):
    """Return {name: Table} of all readings; their values are not defined."""
    bars = lengths_of_bars(plan.given)
    return Foreseen(plan.design, *_tank_of(plan), bars=bars).tables()


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
    return courses, radius, bottom, zero, plan.holds, plan.obstacles


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
    tables = Foreseen(design, *tank, bars=lengths_of_bars(raw)).tables()
    settings = dict(raw.settings)
    datum = datum_of(design)
    if datum is not None:
        settings["adjustment"] = {"datum": Value(datum)} | settings.get("adjustment", {})
    whole = replace(raw, tables=raw.tables | tables, settings=settings)
    try:
        job = job_of(whole, Log())
    except InputError as error:
        raise InputError(told_of_plan(error.problems, design, rows)) from error
    job = with_nominal_readings(job, *expected)
    return replace(job, warnings=told_of_plan(job.warnings, design, rows))


def datum_of(design):
    """Default of `adjustment.datum` for the network of a `Design`; None without a network."""
    if design.tangents is not None:
        return "minimal"
    return None if design.ties is None else "inner"
