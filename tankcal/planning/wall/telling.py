"""Report problems of generated tables for the sections of plan.toml that generate them."""

from dataclasses import replace

from tankcal.job.tables import SETTINGS_FILE
from tankcal.planning.given import PLAN_FILE

MADE = {  # tables that a design generates, and the section that messages name
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
OF_TRAVERSE = {  # sections of tables if limbs are sighted from traverse stations
    "setups.csv": "tangents",
    "control.csv": "tangents",
    "directions.csv": "traverse",
    "zenith_angles.csv": "traverse",
    "slope_distances.csv": "traverse",
    "stadia.csv": "traverse",
}


def told_of_plan(problems, design, rows=None):
    """Return problems in terms of the plan, a tuple of Problem without duplicates.

    design: Design that generated the tables; rows: {section: row of plan.toml}.
    """
    section_of = MADE if design.tangents is None else MADE | OF_TRAVERSE
    problems_of_plan = []
    for problem in problems:
        translated = problem
        if translated.file in section_of:
            section = section_of[translated.file]
            row = (rows or {}).get(section)
            translated = replace(translated, file=PLAN_FILE, row=row, column=section, cell=None)
        elif translated.file == SETTINGS_FILE:
            translated = replace(translated, file=PLAN_FILE)
        problems_of_plan.append(translated)
    return tuple(dict.fromkeys(problems_of_plan))
