"""Ties and control: names that are there, lines that nothing cuts, control at its place."""

import numpy as np

from tankcal.job.tables import nearest
from tankcal.messages import joined, message
from tankcal.planning.model import Pillar
from tankcal.planning.rings import plate_m
from tankcal.planning.visibility import GRAZE_M, cut

THINNER_M = 0.02  # by which the tank is taken thinner, so that what lies on the wall passes
OFF_M = 0.5  # between control and the place that the plan gives the same point
OUT_OF_PLUMB_M = 0.5  # between the ends of a plumb line, in plan


def check_tied(plan, given, log):
    """Every end of a tie is a point, no tape runs through the tank, control is where it stands."""
    points = plan.points
    for table in given.tables.values():
        for end in ("from", "to") if table is not None else ():
            for row, name in zip(table.rows, table.of(end), strict=True):
                if name not in points:
                    expected = message(
                        "plan_no_such_end",
                        "found {found!r}; expected a target, or a point of control.csv{hint}",
                        found=name,
                        hint=nearest(name, points),
                    )
                    log.problem(table.file, expected, row, end)
    _check_distances(plan, given, log)
    _check_plumb_lines(plan, given, log)
    if given.control is not None:
        _check_control(plan, given.control, log)


def _rows(plan, table):
    """(row, names of both ends, (2, 3) their places) of a table, where both are points."""
    points = plan.points
    rows = () if table is None else zip(table.rows, table.of("from"), table.of("to"), strict=True)
    for row, *ends in rows:
        if all(name in points for name in ends):
            yield row, ends, np.array([points[name] for name in ends])


def _check_distances(plan, given, log):
    for row, ends, xyz in _rows(plan, given.tables["distances"]):
        if why := _through(plan, ends, xyz):
            log.problem("distances.csv", why, row, "to")
    for entry in given.repeated["tapes"]:
        ends = [f"{entry['name']}{end}" for end in "ab"]
        if why := _through(plan, ends, np.array([plan.extra[name] for name in ends])):
            entry.tell(log.problem, "length_m", why)


def _through(plan, ends, xyz):
    """Why no tape can be stretched between two places (2, 3); "" where one can."""
    shell, (one, other) = plan.shell, ends
    if shell.outside:
        plates = [plate_m(course, True) for course in plan.job.courses]
        radius = shell.radius_m + min(plates) - plates[0] - THINNER_M
        tank = Pillar(shell.axis_m, radius, shell.low_m, shell.high_m, "tank")
        if cut(tank, xyz[0], xyz[1:])[0]:
            return message(
                "plan_line_through_tank",
                "the line from {one} to {other} runs through the tank; expected it outside",
                one=one,
                other=other,
            )
        return ""
    away = np.hypot(*(xyz[:, :2] - shell.axis_m).T)
    beyond = [name for name, off in zip(ends, away, strict=True) if off > shell.radius_m + GRAZE_M]
    if beyond:
        return message(
            "plan_tape_beyond_wall",
            "{ends} beyond the wall of the tank; expected both ends within it",
            ends=joined(beyond),
        )
    return ""


def _check_plumb_lines(plan, given, log):
    for row, (one, other), xyz in _rows(plan, given.tables["plumb_lines"]):
        off = np.hypot(*(xyz[1, :2] - xyz[0, :2]))
        if off > OUT_OF_PLUMB_M:
            expected = message(
                "plan_out_of_plumb",
                "{one} and {other} are {off:.3f} m apart in plan; a plumb line hangs: "
                "expected at most {most:g} m",
                one=one,
                other=other,
                off=off,
                most=OUT_OF_PLUMB_M,
            )
            log.problem("plumb_lines.csv", expected, row, "to")


def _check_control(plan, control, log):
    """Control that the plan places itself is there; what only control places has all of x, y, z."""
    points, setups = plan.points, [one.name for one in plan.setups]
    own = {name: points[name] for name in (*plan.targets.names, *plan.facing, *setups)}
    acting = {one.name for one in plan.known}
    given = np.column_stack([control.numbers(f"{axis}_m") for axis in "xyz"])
    for row, name, xyz in zip(control.rows, control.of("point"), given, strict=True):
        if name in own:
            off = np.nan_to_num(xyz - own[name])
            if np.linalg.norm(off) > OFF_M:
                where = ", ".join(f"{value:.3f}" for value in own[name])
                expected = message(
                    "plan_control_off",
                    "{point} is given {off:.3f} m from its place in the plan ({where}); "
                    "expected it within {most:g} m, or blank",
                    point=name,
                    off=np.linalg.norm(off),
                    where=where,
                    most=OFF_M,
                )
                column = f"{'xyz'[np.argmax(np.abs(off))]}_m"
                log.problem(control.file, expected, row, column)
        elif name in acting and np.isnan(xyz).any():
            expected = message(
                "plan_control_no_target",
                "{point} is no target of the plan; expected all its coordinates",
                point=name,
            )
            log.problem(control.file, expected, row, "point")
