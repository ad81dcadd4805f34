"""Obstacles to sight (boxes and vertical cylinders) and the lines of sight that they cut.

A box cuts a line of sight from S to X if the slabs of its three axes overlap along the line. A
vertical cylinder cuts it if a part within the radius lies between bottom and top.
"""

import numpy as np

from tankcal.messages import message
from tankcal.planning.model import Box, Pillar


def check_obstacles(plan_input, log):
    """Check the keys of boxes and cylinders in a `Given`."""
    needed = {"box": {"from_m": 3, "to_m": 3}, "cylinder": {"axis_m": 2}}
    numbers = {"box": (), "cylinder": ("radius_m", "low_m", "high_m")}
    for entry in plan_input.sections["obstacles"]:
        for key, count in needed.get(entry["kind"], {}).items():
            if not entry.is_refused(key) and len(entry[key] or ()) != count:
                expected = message(
                    "plan_numbers_metres", "expected {count} numbers, metres", count=count
                )
                entry.report(log.problem, key, expected)
        for key in numbers.get(entry["kind"], ()):
            if key not in entry.filled_keys:
                expected = message("plan_number_metres", "missing; expected a number, metres")
                entry.report(log.problem, key, expected)
        if None not in (entry["low_m"], entry["high_m"]) and entry["high_m"] <= entry["low_m"]:
            expected = message(
                "plan_high_low",
                "found {high:g}; expected more than low_m, {low:g}",
                high=entry["high_m"],
                low=entry["low_m"],
            )
            entry.report(log.problem, "high_m", expected)
        if any(a == b for a, b in zip(entry["from_m"] or (), entry["to_m"] or (), strict=False)):
            expected = message(
                "plan_flat_box",
                "in a plane with from_m; expected a corner that differs in x, y and z",
            )
            entry.report(log.problem, "to_m", expected)


def obstacles_of(plan_input):
    """Return the `Box`es and `Pillar`s of valid [[obstacles]], a tuple."""
    return tuple(map(_obstacle, plan_input.sections["obstacles"]))


def _obstacle(entry):
    if entry["kind"] == "box":
        corners = np.array([entry["from_m"], entry["to_m"]])
        return Box(corners.min(axis=0), corners.max(axis=0), entry["name"])
    return Pillar(
        np.array(entry["axis_m"]), entry["radius_m"], entry["low_m"], entry["high_m"],
        entry["name"],
    )  # fmt: skip


def message_of_obstacle_at(obstacles, xyz_m):
    """Return the message about a position (3,) within an obstacle; "" if it is in none."""
    for obstacle in obstacles:
        if _contains(obstacle, xyz_m):
            return message(
                "plan_in_an_obstacle", "stands in the obstacle {obstacle}", obstacle=obstacle.name
            )
    return ""


def _contains(obstacle, xyz):
    if hasattr(obstacle, "radius_m"):
        near = np.hypot(*(xyz[:2] - obstacle.axis_m)) < obstacle.radius_m
        return bool(near and obstacle.low_m < xyz[2] < obstacle.high_m)
    return bool(((xyz > obstacle.low_m) & (xyz < obstacle.high_m)).all())


def message_of_misplaced_station(station, why):
    """Return the message about a station at an impossible position."""
    return message("plan_misplaced", "station {station} {why}", station=station, why=why)


def message_of_cut_line(start, end):
    """Return the message about an obstructed line between two stations."""
    return message(
        "plan_base_hidden",
        "the line from {one} to {other} is cut by the tank or an obstacle; expected it free",
        one=start,
        other=end,
    )


def find_hidden(obstacle, place_m, xyz_m):
    """Find the points hidden by an obstacle.

    Parameters
    ----------
    obstacle : Box or Pillar
    place_m : ndarray, shape (3,)
        Position of the observer.
    xyz_m : ndarray, shape (n, 3)
        Points.

    Returns
    -------
    ndarray of bool, shape (n,)
        Whether the obstacle cuts the line from the position to each point.
    """
    along = xyz_m - place_m
    if isinstance(obstacle, Box):
        first, last = _clip_to_slabs(place_m, along, obstacle.low_m, obstacle.high_m)
    else:
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        low[2], high[2] = obstacle.low_m, obstacle.high_m
        first, last = _clip_to_slabs(place_m, along, low, high)
        near, far = _clip_to_circle(place_m[:2] - obstacle.axis_m, along[:, :2], obstacle.radius_m)
        first, last = np.maximum(first, near), np.minimum(last, far)
    # The line parameter is 0 at the observer and 1 at the point.
    return np.maximum(first, 0.0) < np.minimum(last, 1.0)


def _clip_to_slabs(place, along, low, high):
    """First and last line parameters (n,), (n,) within the slabs of three axes."""
    still = along == 0  # parallel to a slab: inside it everywhere or nowhere
    step = np.where(still, 1.0, along)
    to_low, to_high = (low - place) / step, (high - place) / step
    inside = (place > low) & (place < high)
    first = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(to_low, to_high))
    last = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(to_low, to_high))
    return first.max(axis=1), last.min(axis=1)


def _clip_to_circle(place, along, radius):
    """First and last line parameters within a circle: |place + t along| < radius."""
    # a t^2 + 2 b t + c < 0 between the roots; a vertical line (a = 0) is inside if c < 0
    a, b = np.einsum("ni,ni->n", along, along), along @ place
    c = place @ place - radius**2
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        near, far = (-b - root) / a, (-b + root) / a
    near = np.where(a > 0, near, -np.inf if c < 0 else np.inf)
    far = np.where(a > 0, far, np.inf if c < 0 else -np.inf)
    misses = np.isnan(near)
    return np.where(misses, np.inf, near), np.where(misses, -np.inf, far)
