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
    "directions.csv": "setup_ties",
    "zenith_angles.csv": "setup_ties",
    "slope_distances.csv": "setup_ties",
}


def told_of_plan(problems):
    """A tuple of Problems in words of the plan, each once."""
    found = []
    for problem in problems:
        one = problem
        if one.file in MADE:
            one = replace(one, file=PLAN_FILE, row=None, column=MADE[one.file], cell=None)
        elif one.file == SETTINGS_FILE:
            one = replace(one, file=PLAN_FILE)
        found.append(one)
    return tuple(dict.fromkeys(found))
