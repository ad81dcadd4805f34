"""No capacity falls: of a table that does, what takes more than the tank holds there."""

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message

ROUNDING = 1e-9  # of the capacity: a table that falls by less does not


def refuse_falling(job, body, zero_m, heights_m, volumes_m3):
    """Refuse a table whose volumes fall with rising dips, and name the likely cause.

    Parameters
    ----------
    job : Job
    body : Body
        The tank as the sum of its parts.
    zero_m : float
        Level of the table's zero in the frame of the parts, m.
    heights_m, volumes_m3 : ndarray, shape (n,)
        Ascending dips, m, and the volumes there, m3.

    Raises
    ------
    InputError
        When deadwood, the floating roof or the bottom takes more than the tank holds there.
    SolutionError
        When the wall itself does.
    """
    rise = np.diff(volumes_m3)
    falls = np.flatnonzero(rise < -ROUNDING * np.abs(volumes_m3).max())
    if len(falls) == 0:
        return
    worst = int(falls[np.argmin(rise[falls])])
    between = np.array(heights_m)[[worst, worst + 1]]
    file, column, what = _cause(job, body, between, zero_m)
    text = message(
        "table_falls",
        "the capacity falls from {from_m3:.6g} to {to_m3:.6g} m3 between the dips of "
        "{low_m:g} and {high_m:g} m, and {count} times in all; the likely cause is {what}, "
        "which takes up more than the tank holds there",
        from_m3=float(volumes_m3[worst]),
        to_m3=float(volumes_m3[worst + 1]),
        low_m=float(between[0]),
        high_m=float(between[1]),
        count=len(falls),
        what=what,
    )
    if file is None:
        raise SolutionError(str(text))
    raise InputError(Problem(file, text, None, column))


def _cause(job, body, dips_m, zero_m):
    """(file, column, words) of what takes most between two dips; no file: the wall itself."""
    takes = []
    for part in body.parts:
        low, high = part.volume_m3(dips_m + zero_m)
        takes.append((float(high - low), part.kind))
    _, kind = min(takes)
    if kind == "deadwood":
        low, high = dips_m
        deepest = min(job.deadwood, key=lambda one: _between(one, low, high))
        named = message("deadwood_named", "deadwood {name}", name=deepest.name)
        return "deadwood.csv", "volume_m3", named
    if kind == "roof":
        return "job.toml", "roof.mass_kg", message("floating_roof", "the floating roof")
    if kind == "wall":
        return None, None, message("wall_itself", "the wall itself")
    return "job.toml", "bottom", message("its_bottom", "the bottom")


def _between(item, low_m, high_m):
    """Volume of deadwood between two dips, linear in height; at one height: all of it."""
    height = item.top_m - item.bottom_m
    if height <= 0:
        return item.volume_m3 if low_m < item.bottom_m <= high_m else 0.0
    return item.volume_m3 * max(min(item.top_m, high_m) - max(item.bottom_m, low_m), 0.0) / height
