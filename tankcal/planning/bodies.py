"""Set-ups that hang together: those that share two points, or that see one another."""

import numpy as np

from tankcal.messages import message

SHARED = 2  # points that two levelled set-ups need in common


def find_separate_bodies(plan, seen):
    """Tuples of names of set-ups: those of each body that hangs together with no other one.

    seen  visibility.Visibility

    A set-up is a body of the points that it sees and its own place; control is one of the points
    that are known in x, y and z. Bodies with two points in common are one.
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
    """Two bodies with enough points in common, or None."""
    for i, one in enumerate(bodies):
        for other in bodies[:i]:
            if len(one[1] & other[1]) >= SHARED:
                return other, one
    return None


def describe_separate_bodies(found):
    """What parts `find_separate_bodies` found, in a sentence."""
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
