"""Connected groups of set-ups: set-ups that share two points or sight each other."""

import numpy as np

from tankcal.messages import message

SHARED = 2  # fewest common points that connect two levelled set-ups


def find_separate_bodies(plan, seen):
    """Return the groups of connected set-ups, each a tuple of names.

    Parameters
    ----------
    plan : Plan
    seen : Visibility

    Notes
    -----
    A set-up is a body: the points that it sees and its own position. Points known in x, y and z are
    another body. Bodies with two common points are merged.
    """
    bodies = [([], {one.name for one in plan.known if np.isfinite(one.sd_m).all()})]
    for k, setup in enumerate(plan.setups):
        seen_there = {seen.points[i] for i in np.flatnonzero(seen.on_setup[k])}
        bodies.append(([setup.name], seen_there | {setup.name}))
    while (pair := _linked(bodies)) is not None:
        one, other = pair
        bodies = [body for body in bodies if body is not one and body is not other]
        bodies.append((one[0] + other[0], one[1] | other[1]))
    return tuple(tuple(names) for names, _ in bodies if names)


def _linked(bodies):
    """Return two bodies with enough common points, or None."""
    for i, one in enumerate(bodies):
        for other in bodies[:i]:
            if len(one[1] & other[1]) >= SHARED:
                return other, one
    return None


def describe_separate_bodies(found):
    """Return the message about the groups that `find_separate_bodies` returns."""
    told = "; ".join(", ".join(names) for names in found)
    return message(
        "plan_apart",
        "{count} groups of set-ups are not connected to the others: {told}; they share fewer "
        "than {shared} points and do not see each other: add marks or control points that "
        "neighbours both see, or set-ups between them",
        count=len(found),
        told=told,
        shared=SHARED,
    )
