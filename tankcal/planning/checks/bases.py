"""What cannot be meant of a stadia in a plan: who reads it, where it stands, how far off."""

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

WIDEST_RAD, NARROWEST_RAD = np.pi / 2, 2 * np.pi * LEAST  # angles that a job takes


def check_bases(plan, given, log):
    """Every base is between a set-up and another station that it sees, as far off as can be read.

    given  `given.Given`; what stands in instruments.toml is sound
    """
    if not has_rows(given.stadia):
        return
    setups = [one.name for one in plan.setups]
    stations = [name for name in plan.points if name not in plan.targets.names]
    for one in plan.bases:
        is_sound = True
        for column, name, known in (("setup", one.setup, setups), ("to", one.to, stations)):
            if name not in known:
                is_sound = False
                log.problem(STADIA_FILE, _no_such(column, name, known), one.row, column)
        if one.setup == one.to:
            refuse_itself(log, given.stadia, one.row, one.to)
        elif is_sound and (why := _out_of_reach(plan, one)):
            log.problem(STADIA_FILE, why, one.row, "to")


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


def _out_of_reach(plan, one):
    """Why the bar of a Base cannot be read; "" where it can."""
    length, base = plan.bars[one.bar], base_m(plan, one)
    least, most = distance_of_angle_m(np.array([WIDEST_RAD, NARROWEST_RAD]), length)
    if not least <= base <= most:
        return message(
            "plan_base_length",
            "a base of {base:.2f} m; expected {least:.2f} to {most:.0f} m: the bar is {length:g} m"
            " long",
            base=base,
            least=float(least),
            most=float(most),
            length=length,
        )
    here, there = plan.points[one.setup], plan.points[one.to]
    if not find_in_sight(plan, here, there[None], np.full((1, 3), np.nan))[0]:
        return line_cut(one.setup, one.to)
    ends = _ends(here, there, length)
    off = np.hypot(*(ends - plan.shell.axis_m).T) - plan.shell.radius_m
    is_level = plan.shell.low_m <= there[2] <= plan.shell.high_m
    if is_level and (off < GRAZE_M if plan.shell.outside else off > -GRAZE_M).any():
        return message(
            "plan_bar_in_wall",
            "the bar over {other}, square to the sight from {one}, would reach through the wall;"
            " expected a station further off it",
            one=one.setup,
            other=one.to,
        )
    return ""


def _ends(here, there, length_m):
    """(2, 2) places in plan of the ends of a bar over a station, square to the sight."""
    east, north = (there - here)[:2] / np.hypot(*(there - here)[:2])
    half = length_m / 2 * np.array([north, -east])
    return there[:2] + np.array([half, -half])
