"""Build a WallPlan from the sections of a plan: design, tables, and the job that reads them."""

from dataclasses import replace

from tankcal.errors import InputError
from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.job.building import job_of
from tankcal.job.checking import zero_z
from tankcal.job.checks.extent import volume_by_sizes
from tankcal.job.checks.survey.readings import is_bar
from tankcal.job.tables import SETTINGS_FILE, Log, Value
from tankcal.planning.contract import MEASURING, PLAN_FILE, forms_m
from tankcal.planning.visibility import obstacles_of
from tankcal.planning.wall.checks import percents_of, refuse_cut, warnings_of_obstacles
from tankcal.planning.wall.design_tables import DesignTables
from tankcal.planning.wall.filling import runs_of
from tankcal.planning.wall.model import (
    Design,
    PlannedControl,
    PlannedHits,
    PlannedLines,
    PlannedStrap,
    PlannedTangents,
    WallPlan,
)
from tankcal.planning.wall.nominal_readings import set_nominal_readings

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
    straps = (
        PlannedStrap(course, percent, entry["s_mm"], int(entry["readings"] or 1), _more(entry))
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


def _more(entry):
    keys = ("instrument", "temperature_c", "tension_n", "pulls")
    return tuple((key, entry[key]) for key in keys if entry[key] is not None)


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
