"""Targets above the shell, on one another, on welds."""

import numpy as np

from tankcal.messages import listed, message
from tankcal.planning.places import joints_m
from tankcal.planning.rings import TOUCH_M

SHOWN = 5  # lines and rows in a message
ROUNDING_M = 1e-6


def check_targets(plan, pattern, log):
    """Rows within the shell, lines and rows apart from one another and from welds."""
    heights = plan.targets.height_m
    top = plan.shell.high_m - plan.shell.low_m
    for height in np.unique(heights[(heights > top) | (heights < 0)]):
        where = message("plan_below_shell", "below the shell")
        if height > top:
            where = message("plan_above_shell", "above the shell")
        expected = message(
            "plan_row_off_shell",
            "a row of targets at {height:g} m is {where}; expected 0 to {top:g} m",
            height=height,
            where=where,
            top=top,
        )
        pattern.tell(log.problem, "heights_m", expected)
    _check_lines(plan, pattern, log)
    _check_rows(plan, pattern, log)


def _check_lines(plan, pattern, log):
    """Lines that touch, and lines beside a weld that were moved onto another one."""
    targets, radius = plan.targets, plan.shell.radius_m
    first = [name == targets.section[0] for name in targets.section]
    names = [name for name, is_first in zip(targets.generatrix, first, strict=True) if is_first]
    east, north, _ = targets.outwards[first].T * (1.0 if plan.shell.outside else -1.0)
    azimuth = np.arctan2(east, north)
    order = np.argsort(azimuth)
    gap = np.diff(azimuth[order], append=azimuth[order[0]] + 2 * np.pi) * radius
    after = np.roll(order, -1)
    touching = [
        message("plan_two_lines", "{one} and {other}", one=names[one], other=names[other])
        for one, other, off in zip(order, after, gap, strict=True)
        if off < TOUCH_M and one != other
    ]
    clearance = 1000 * targets.clearance_m
    if touching:
        expected = message(
            "plan_lines_touch",
            "lines {names} are nearer than {touch_mm:g} mm to one another where they "
            "keep {clearance:g} mm from welds; expected fewer generatrices, another "
            "first_azimuth_deg or a smaller weld_clearance_mm",
            names=_first(touching),
            touch_mm=1000 * TOUCH_M,
            clearance=clearance,
        )
        pattern.tell(log.problem, "generatrices", expected)
    welds = np.array(targets.welds_rad)
    off = np.abs(np.angle(np.exp(1j * (azimuth[:, None] - welds)))) * radius
    close = (off < targets.clearance_m - ROUNDING_M).any(axis=1)
    if close.any():
        near = _first([names[i] for i in np.flatnonzero(close)])
        expected = message(
            "plan_lines_on_weld",
            "lines {names} are as near as {off_mm:.0f} mm to a weld, moved away from "
            "another one; expected welds further apart, or a weld_clearance_mm below "
            "{clearance:g}",
            names=near,
            off_mm=1000 * off.min(),
            clearance=clearance,
        )
        pattern.tell(log.problem, "weld_azimuths_deg", expected)


def _check_rows(plan, pattern, log):
    """Rows that touch; rows that were asked for on a horizontal weld, which may be meant."""
    if not pattern["heights_m"]:
        return
    rows = np.sort(pattern["heights_m"])
    touching = np.flatnonzero(np.diff(rows) < TOUCH_M)
    if len(touching):
        pairs = _first(
            [
                message("plan_two_rows", "{low:g} and {high:g} m", low=rows[i], high=rows[i + 1])
                for i in touching
            ]
        )
        expected = message(
            "plan_rows_touch",
            "rows at {pairs}; expected rows at least {touch_mm:g} mm apart",
            pairs=pairs,
            touch_mm=1000 * TOUCH_M,
        )
        pattern.tell(log.problem, "heights_m", expected)
    clearance = plan.targets.clearance_m
    off = np.abs(rows[:, None] - joints_m(plan)).min(axis=1)
    close = rows[off < clearance - ROUNDING_M]
    if len(close):
        text = message(
            "plan_targets_on_welds",
            "{count} rows of targets are nearer than {clearance_mm:g} mm to a horizontal weld:"
            " {heights} m; are they meant there?",
            count=len(close),
            clearance_mm=1000 * clearance,
            heights=listed([f"{height:g}" for height in close], SHOWN),
        )
        pattern.tell(log.warning, "heights_m", text)


def _first(names):
    """The first names in a row, and how many more there are."""
    return message("plan_first", "{names}", names=listed(names, SHOWN))
