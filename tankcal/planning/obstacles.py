"""What stands in the way of a survey: boxes and upright cylinders, and the lines that they cut.

A line of sight from S to X is cut by a box when the slabs of its three axes overlap along it, by an
upright cylinder when a part of it within the radius lies between bottom and top.
"""

import numpy as np

from tankcal.messages import message
from tankcal.planning.model import Box, Pillar


def check_obstacles(given, log):
    """What boxes and cylinders need; `Given` of any plan."""
    needed = {"box": {"from_m": 3, "to_m": 3}, "cylinder": {"axis_m": 2}}
    numbers = {"box": (), "cylinder": ("radius_m", "low_m", "high_m")}
    for one in given.repeated["obstacles"]:
        for key, count in needed.get(one["kind"], {}).items():
            if not one.is_refused(key) and len(one[key] or ()) != count:
                one.tell(
                    log.problem,
                    key,
                    message("plan_numbers_metres", "expected {count} numbers, metres", count=count),
                )
        for key in numbers.get(one["kind"], ()):
            if key not in one.filled:
                one.tell(
                    log.problem,
                    key,
                    message("plan_number_metres", "missing; expected a number, metres"),
                )
        if None not in (one["low_m"], one["high_m"]) and one["high_m"] <= one["low_m"]:
            expected = message(
                "plan_high_low",
                "found {high:g}; expected more than low_m, {low:g}",
                high=one["high_m"],
                low=one["low_m"],
            )
            one.tell(log.problem, "high_m", expected)
        if any(a == b for a, b in zip(one["from_m"] or (), one["to_m"] or (), strict=False)):
            expected = message(
                "plan_flat_box",
                "in a plane with from_m; expected a corner that differs in x, y and z",
            )
            one.tell(log.problem, "to_m", expected)


def obstacles_of(given):
    """A tuple of the `Box`es and `Pillar`s of sound [[obstacles]]."""
    return tuple(map(_obstacle, given.repeated["obstacles"]))


def _obstacle(given):
    if given["kind"] == "box":
        corners = np.array([given["from_m"], given["to_m"]])
        return Box(corners.min(axis=0), corners.max(axis=0), given["name"])
    return Pillar(
        np.array(given["axis_m"]), given["radius_m"], given["low_m"], given["high_m"],
        given["name"],
    )  # fmt: skip


def in_an_obstacle(obstacles, xyz_m):
    """What is said of a place (3,) within one of them; "" where it is in none."""
    for one in obstacles:
        if _within(one, xyz_m):
            return message(
                "plan_in_an_obstacle", "stands in the obstacle {obstacle}", obstacle=one.name
            )
    return ""


def _within(obstacle, xyz):
    if hasattr(obstacle, "radius_m"):
        near = np.hypot(*(xyz[:2] - obstacle.axis_m)) < obstacle.radius_m
        return bool(near and obstacle.low_m < xyz[2] < obstacle.high_m)
    return bool(((xyz > obstacle.low_m) & (xyz < obstacle.high_m)).all())


def misplaced(station, why):
    """What is said of a station that cannot stand where it is planned."""
    return message("plan_misplaced", "station {station} {why}", station=station, why=why)


def line_cut(start, end):
    """What is said of a line between two stations that something is in the way of."""
    return message(
        "plan_base_hidden",
        "the line from {one} to {other} is cut by the tank or an obstacle; expected it free",
        one=start,
        other=end,
    )


def find_hidden(obstacle, place_m, xyz_m):
    """(n,) True where the line from a place (3,) to a point (n, 3) meets a Box or a Pillar."""
    along = xyz_m - place_m
    if isinstance(obstacle, Box):
        first, last = _in_slabs(place_m, along, obstacle.low_m, obstacle.high_m)
    else:
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        low[2], high[2] = obstacle.low_m, obstacle.high_m
        first, last = _in_slabs(place_m, along, low, high)
        near, far = _in_round(place_m[:2] - obstacle.axis_m, along[:, :2], obstacle.radius_m)
        first, last = np.maximum(first, near), np.minimum(last, far)
    return np.maximum(first, 0.0) < np.minimum(last, 1.0)


def _in_slabs(place, along, low, high):
    """Parts of the line (n,), (n,) between which it is within the slabs of three axes."""
    still = along == 0
    step = np.where(still, 1.0, along)
    one, two = (low - place) / step, (high - place) / step
    inside = (place > low) & (place < high)
    first = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(one, two))
    last = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(one, two))
    return first.max(axis=1), last.min(axis=1)


def _in_round(place, along, radius):
    """The same within a circle: |place + t along| < radius."""
    a, b = np.einsum("ni,ni->n", along, along), along @ place
    c = place @ place - radius**2
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        near, far = (-b - root) / a, (-b + root) / a
    near = np.where(a > 0, near, -np.inf if c < 0 else np.inf)
    far = np.where(a > 0, far, np.inf if c < 0 else -np.inf)
    misses = np.isnan(near)
    return np.where(misses, np.inf, near), np.where(misses, -np.inf, far)
