"""Checks of the stadia bases of a plan: end points, sight, and distance."""

import numpy as np

from tankcal.job.checking import has_rows
from tankcal.job.checks.survey.stadia import refuse_itself
from tankcal.job.contract.stadia import LEAST
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.planning.bases import STADIA_FILE, base_m
from tankcal.planning.obstacles import line_cut
from tankcal.planning.visibility import GRAZE_M, find_in_sight
from tankcal.survey.stadia import distance_of_angle_m

WIDEST_RAD, NARROWEST_RAD = np.pi / 2, 2 * np.pi * LEAST  # range of angles that a job accepts


def check_bases(plan, given, log):
    """Check that every base connects a set-up to a visible station at a measurable distance.

    given: valid `given.Given`.
    """
    if not has_rows(given.stadia):
        return
    setups = [setup.name for setup in plan.setups]
    stations = [name for name in plan.points if name not in plan.targets.names]
    for base in plan.bases:
        is_sound = True
        for column, name, known in (("setup", base.setup, setups), ("to", base.to, stations)):
            if name not in known:
                is_sound = False
                log.problem(STADIA_FILE, _no_such(column, name, known), base.row, column)
        if base.setup == base.to:
            refuse_itself(log, given.stadia, base.row, base.to)
        elif is_sound and (why := _out_of_reach(plan, base)):
            log.problem(STADIA_FILE, why, base.row, "to")


def _no_such(column, name, known):
    hint = nearest(name, known)
    if column == "setup":
        return message(
            "plan_no_such_setup",
            "found {found!r}; expected a set-up of the plan{hint}",
            found=name,
            hint=hint,
        )
    return message(
        "plan_no_such_station",
        "found {found!r}; expected a set-up of the plan or a point of control.csv{hint}",
        found=name,
        hint=hint,
    )


def _out_of_reach(plan, base):
    """Return the reason why the bar of a Base cannot be read; "" if it can."""
    length, distance = plan.bars[base.bar], base_m(plan, base)
    least, most = distance_of_angle_m(np.array([WIDEST_RAD, NARROWEST_RAD]), length)
    if not least <= distance <= most:
        return message(
            "plan_base_length",
            "a base of {base:.2f} m; expected {least:.2f} to {most:.0f} m: the bar is {length:g} m"
            " long",
            base=distance,
            least=float(least),
            most=float(most),
            length=length,
        )
    here, there = plan.points[base.setup], plan.points[base.to]
    if not find_in_sight(plan, here, there[None], np.full((1, 3), np.nan))[0]:
        return line_cut(base.setup, base.to)
    ends = _ends(here, there, length)
    off = np.hypot(*(ends - plan.shell.axis_m).T) - plan.shell.radius_m
    is_level = plan.shell.low_m <= there[2] <= plan.shell.high_m
    if is_level and (off < GRAZE_M if plan.shell.outside else off > -GRAZE_M).any():
        return message(
            "plan_bar_in_wall",
            "the bar over {other}, square to the sight from {one}, would reach through the wall;"
            " expected a station further off it",
            one=base.setup,
            other=base.to,
        )
    return ""


def _ends(here, there, length_m):
    """Horizontal positions (2, 2) of the ends of a bar over a station, square to the sight."""
    east, north = (there - here)[:2] / np.hypot(*(there - here)[:2])
    half = length_m / 2 * np.array([north, -east])
    return there[:2] + np.array([half, -half])
