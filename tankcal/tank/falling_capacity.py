"""Check for a falling capacity: identify the part that takes more than the tank holds there."""

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message

ROUNDING = 1e-9  # relative to the capacity: a smaller fall is rounding


def refuse_falling(job, body, zero_m, heights_m, volumes_m3):
    """Refuse a table whose volumes fall with rising dips, and name the likely cause.

    Parameters
    ----------
    job : Job
    body : Body
        Tank as the sum of its parts.
    zero_m : float
        Level of the zero of the table in the frame of the parts, m.
    heights_m, volumes_m3 : ndarray, shape (n,)
        Ascending dips, m, and the volumes there, m3.

    Raises
    ------
    InputError
        If deadwood, the floating roof or the bottom takes more than the tank holds there.
    SolutionError
        If the volume of the wall itself falls.
    """
    # Report the largest fall; rounding of large volumes is no fall.
    rise = np.diff(volumes_m3)
    falls = np.flatnonzero(rise < -ROUNDING * np.abs(volumes_m3).max())
    if len(falls) == 0:
        return
    worst = int(falls[np.argmin(rise[falls])])
    interval = np.array(heights_m)[[worst, worst + 1]]
    file, column, what = _find_cause(job, body, interval, zero_m)
    text = message(
        "table_falls",
        "the capacity falls from {from_m3:.6g} to {to_m3:.6g} m3 between the dips of "
        "{low_m:g} and {high_m:g} m, and {count} times in all; the likely cause is {what}, "
        "which takes up more than the tank holds there",
        from_m3=float(volumes_m3[worst]),
        to_m3=float(volumes_m3[worst + 1]),
        low_m=float(interval[0]),
        high_m=float(interval[1]),
        count=len(falls),
        what=what,
    )
    if file is None:
        raise SolutionError(str(text))
    raise InputError(Problem(file, text, None, column))


def _find_cause(job, body, dips_m, zero_m):
    """Return (file, column, words) of the part with the largest loss between two dips.

    The file is None if the wall is the cause.
    """
    gains = []
    for part in body.parts:
        low, high = part.volume_m3(dips_m + zero_m)
        gains.append((float(high - low), part.kind))
    # The part with the most negative change of volume is the likely cause.
    _, kind = min(gains)
    if kind == "deadwood":
        low, high = dips_m
        deepest = min(job.deadwood, key=lambda item: _volume_between(item, low, high))
        named = message("deadwood_named", "deadwood {name}", name=deepest.name)
        return "deadwood.csv", "volume_m3", named
    if kind == "roof":
        return "job.toml", "roof.mass_kg", message("floating_roof", "the floating roof")
    if kind == "wall":
        return None, None, message("wall_itself", "the wall itself")
    return "job.toml", "bottom", message("its_bottom", "the bottom")


def _volume_between(item, low_m, high_m):
    """Return the volume of deadwood between two dips, linear in height.

    Deadwood without height counts completely at its level.
    """
    height = item.top_m - item.bottom_m
    if height <= 0:
        return item.volume_m3 if low_m < item.bottom_m <= high_m else 0.0
    return item.volume_m3 * max(min(item.top_m, high_m) - max(item.bottom_m, low_m), 0.0) / height
