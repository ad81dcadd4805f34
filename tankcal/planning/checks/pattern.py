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
        where = "above the shell" if height > top else "below the shell"
        expected = f"a row of targets at {height:g} m is {where}; expected 0 to {top:g} m"
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
        f"{names[one]} and {names[other]}"
        for one, other, off in zip(order, after, gap, strict=True)
        if off < TOUCH_M and one != other
    ]
    clearance = 1000 * targets.clearance_m
    if touching:
        expected = (
            f"lines {_first(touching)} are nearer than {1000 * TOUCH_M:g} mm to one another "
            f"where they keep {clearance:g} mm from welds; expected fewer generatrices, another "
            "first_azimuth_deg or a smaller weld_clearance_mm"
        )
        pattern.tell(log.problem, "generatrices", expected)
    welds = np.array(targets.welds_rad)
    off = np.abs(np.angle(np.exp(1j * (azimuth[:, None] - welds)))) * radius
    close = (off < targets.clearance_m - ROUNDING_M).any(axis=1)
    if close.any():
        near = _first([names[i] for i in np.flatnonzero(close)])
        expected = (
            f"lines {near} are as near as {1000 * off.min():.0f} mm to a weld, moved away from "
            f"another one; expected welds further apart, or a weld_clearance_mm below "
            f"{clearance:g}"
        )
        pattern.tell(log.problem, "weld_azimuths_deg", expected)


def _check_rows(plan, pattern, log):
    """Rows that touch; rows that were asked for on a horizontal weld, which may be meant."""
    if not pattern["heights_m"]:
        return
    rows = np.sort(pattern["heights_m"])
    touching = np.flatnonzero(np.diff(rows) < TOUCH_M)
    if len(touching):
        pairs = _first([f"{rows[i]:g} and {rows[i + 1]:g} m" for i in touching])
        expected = f"rows at {pairs}; expected rows at least {1000 * TOUCH_M:g} mm apart"
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
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
