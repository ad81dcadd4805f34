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
    bodies = [
        (
            [],
            {
                control_point.name
                for control_point in plan.known
                if np.isfinite(control_point.sd_m).all()
            },
        )
    ]
    for k, setup in enumerate(plan.setups):
        seen_there = {seen.points[i] for i in np.flatnonzero(seen.on_setup[k])}
        bodies.append(([setup.name], seen_there | {setup.name}))
    while (pair := _find_linked(bodies)) is not None:
        first, second = pair
        bodies = [body for body in bodies if body is not first and body is not second]
        bodies.append((first[0] + second[0], first[1] | second[1]))
    return tuple(tuple(names) for names, _ in bodies if names)


def _find_linked(bodies):
    """Return two bodies with enough common points, or None."""
    for i, body in enumerate(bodies):
        for earlier in bodies[:i]:
            if len(body[1] & earlier[1]) >= SHARED:
                return earlier, body
    return None


def describe_separate_bodies(groups):
    """Return the message about the groups that `find_separate_bodies` returns."""
    listed = "; ".join(", ".join(names) for names in groups)
    return message(
        "plan_apart",
        "{count} groups of set-ups are not connected to the others: {told}; they share fewer "
        "than {shared} points and do not see each other: add marks or control points that "
        "neighbours both see, or set-ups between them",
        count=len(groups),
        told=listed,
        shared=SHARED,
    )
