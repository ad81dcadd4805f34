"""What is said of tables that a design makes, told of the section of plan.toml that makes them."""

from dataclasses import replace

from tankcal.job.tables import SETTINGS_FILE
from tankcal.planning.given import PLAN_FILE

MADE = {  # tables that a design makes, and the section that they are told of
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
OF_TRAVERSE = {  # where limbs are sighted from its stations
    "setups.csv": "tangents",
    "control.csv": "tangents",
    "directions.csv": "traverse",
    "zenith_angles.csv": "traverse",
    "slope_distances.csv": "traverse",
    "stadia.csv": "traverse",
}


def told_of_plan(problems, design, rows=None):
    """A tuple of Problems in words of the plan, each once.

    design  Design that made the tables        rows  {section: row of plan.toml}
    """
    made = MADE if design.tangents is None else MADE | OF_TRAVERSE
    found = []
    for problem in problems:
        one = problem
        if one.file in made:
            section = made[one.file]
            row = (rows or {}).get(section)
            one = replace(one, file=PLAN_FILE, row=row, column=section, cell=None)
        elif one.file == SETTINGS_FILE:
            one = replace(one, file=PLAN_FILE)
        found.append(one)
    return tuple(dict.fromkeys(found))
