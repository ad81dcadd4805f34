"""Effect of obstacles on a survey of the bare wall: hidden sights are left out."""

from copy import copy

from tankcal.errors import Problem
from tankcal.job.tables import Log
from tankcal.messages import list_some, message
from tankcal.planning.given import PLAN_FILE
from tankcal.planning.obstacles import in_an_obstacle, line_cut, misplaced

SHOWN = 5  # largest number of obstacles listed in a message
SIGHTS = {  # tables of sights that obstacles hide, and the sections that make them
    "offsets": ("lines", message("plan_sights_offsets", "offsets")),
    "wall_hits": ("hits", message("plan_sights_hits", "hits")),
    "tangents": ("tangents", message("plan_sights_tangents", "tangents")),
}


def refuse_cut(foreseen, rows):
    """Raise InputError for stations in obstacles, cut lines between stations, and no sights left.

    foreseen: Foreseen; rows: {section: row of plan.toml}.
    """
    log = Log()
    section = "hits" if foreseen.design.hits else "tangents"
    for name, place in foreseen.stands():
        why = in_an_obstacle(foreseen.obstacles, place)
        if why:
            log.problem(PLAN_FILE, misplaced(name, why), rows.get(section), section)
    log.stop_if_problems()
    for ends in foreseen.lines_cut():
        log.problem(PLAN_FILE, line_cut(*ends), rows.get("traverse"), "traverse")
    every = _sights(foreseen, ())
    for name, count in _sights(foreseen, foreseen.obstacles).items():
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


def warnings_of_obstacles(foreseen, rows):
    """Warn of the number of sights left out, and of obstacles that hide none; a tuple of Problem.

    Parameters are those of `refuse_cut`.
    """
    every, problems = _sights(foreseen, ()), []
    for name, count in _sights(foreseen, foreseen.obstacles).items():
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
        obstacle.name for obstacle in foreseen.obstacles if _sights(foreseen, (obstacle,)) == every
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


def _sights(foreseen, obstacles):
    """Return {table: number of sights} with given obstacles."""
    without = copy(foreseen)
    without.obstacles = obstacles
    return {name: len(table.rows) for name, table in without.tables().items() if name in SIGHTS}
