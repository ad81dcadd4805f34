"""Both faces of the instrument: what they show of it, and their means.

    c = (hz1 - hz2 + 180) / 2 . sin z        collimation error
    i = (v1 + v2 - 360) / 2                  index error of the vertical circle

The mean of both faces is free of c and i. A reading of face 2 alone is turned to face 1. What is
read on one face alone is freed of the c and i that the pairs of its set-up show, as

    hz = hz1 - c / sin z,    v = v1 - i
"""

import math
from dataclasses import dataclass, replace

from tankcal.fieldbooks.book import FULL_TURN, HALF_TURN
from tankcal.messages import message

NO_PAIR_DEG = 0.1  # the two faces of one point do not differ by more
LARGE_DEG = 0.0045  # 0.005 gon: an instrument to be adjusted (own choice)
LARGE_M = 0.005  # between the distances of both faces
DEGREE = math.pi / HALF_TURN


@dataclass(frozen=True)
class Reading:
    """What one pointing makes on face 1: one face, or the mean of both.

    shot   the Shot with values of face 1
    faces  "1", "2" or "both"
    """

    shot: object
    faces: str


@dataclass(frozen=True)
class FaceReport:
    """What the pairs of a set-up show of its instrument; degrees, metres.

    collimation, index  (mean, largest distance from the mean) or None without pairs
    """

    setup: int
    pairs: int
    single: tuple
    collimation: tuple | None
    index: tuple | None
    apart_m: float


def reduce_faces(shots, log):
    """(Readings in the order of the shots, FaceReport of each set-up).

    The second face of a point is the next shot of its name on the other face in the same set-up.
    """
    mates, waiting = {}, {}
    for place, shot in enumerate(shots):
        stack = waiting.setdefault((shot.setup, shot.point), [])
        if stack and shots[stack[-1]].face != shot.face:
            mates[stack.pop()] = place
        else:
            stack.append(place)
    readings, errors, seconds = [], {}, set(mates.values())
    for place, shot in enumerate(shots):
        mine = errors.setdefault(shot.setup, {"pairs": [], "1": 0, "2": 0, "apart": 0.0})
        if place in seconds:
            continue
        if place in mates:
            pair = sorted((shot, shots[mates[place]]), key=lambda one: one.face)
            found = _mean(*pair, mine, log)
            if found is not None:
                readings.append(Reading(replace(found, row=shot.row, time=shot.time), "both"))
        else:
            mine[str(shot.face)] += 1
            readings.append(Reading(_on_face_1(shot), str(shot.face)))
    reports = {setup: _report(setup, one) for setup, one in errors.items()}
    return [_freed(one, reports[one.shot.setup]) for one in readings], [*reports.values()]


def _freed(reading, report):
    """A reading of one face without the mean c and i of its set-up; others as they are."""
    if reading.faces == "both":
        return reading
    sign = 1.0 if reading.faces == "1" else -1.0  # face 2 is turned already
    shot, sine = reading.shot, 1.0
    if shot.zenith_deg is not None and report.index is not None:
        shot = replace(shot, zenith_deg=shot.zenith_deg - sign * report.index[0])
    if shot.zenith_deg is not None:
        sine = _sine(shot.zenith_deg)
    if shot.direction_deg is not None and report.collimation is not None:
        direction = shot.direction_deg - sign * report.collimation[0] / sine
        shot = replace(shot, direction_deg=direction % FULL_TURN)
    return replace(reading, shot=shot)


def _sine(zenith):
    return max(math.sin(zenith * DEGREE), 1e-3)


def _on_face_1(shot):
    if shot.face == 1:
        return shot
    return replace(
        shot,
        direction_deg=None if shot.direction_deg is None else _turned(shot.direction_deg),
        zenith_deg=None if shot.zenith_deg is None else FULL_TURN - shot.zenith_deg,
    )


def _turned(direction):
    return (direction + HALF_TURN) % FULL_TURN


def _mean(first, second, mine, log):
    """The mean of a pair on face 1; None after telling that they are none."""
    turned, found = _on_face_1(second), {}
    sine = 1.0
    collimation = index = None
    if None not in (first.zenith_deg, turned.zenith_deg):
        index = (first.zenith_deg - turned.zenith_deg) / 2
        found["zenith_deg"] = first.zenith_deg - index
        sine = _sine(found["zenith_deg"])
    if None not in (first.direction_deg, turned.direction_deg):
        apart = (first.direction_deg - turned.direction_deg + HALF_TURN) % FULL_TURN - HALF_TURN
        collimation = apart / 2 * sine
        found["direction_deg"] = (first.direction_deg - apart / 2) % FULL_TURN
    if any(abs(one) > NO_PAIR_DEG for one in (collimation, index) if one is not None):
        text = message(
            "no_pair_of_faces",
            "point {point!r}: face 2 differs from face 1 (row {row}) by {across_deg:+.4f} "
            "degrees across and {up_deg:+.4f} degrees up; expected less than {most:g}: if two "
            "points have one name, change a name in the file; otherwise correct the unit of the "
            "angles",
            point=first.point,
            across_deg=-2 * (collimation or 0.0),
            up_deg=2 * (index or 0.0),
            row=str(first.row),
            most=2 * NO_PAIR_DEG,
        )
        log.problem(second.file, text, second.row)
        return None
    mine["pairs"].append((collimation, index))
    if None not in (first.distance_m, turned.distance_m):
        found["distance_m"] = (first.distance_m + turned.distance_m) / 2
        mine["apart"] = max(mine["apart"], abs(first.distance_m - turned.distance_m))
    one = {key: getattr(first, key) for key in ("direction_deg", "zenith_deg", "distance_m")}
    other = {key: getattr(turned, key) for key in one}
    merged = {key: other[key] if value is None else value for key, value in one.items()}
    return replace(first, **(merged | found))


def _report(setup, mine):
    return FaceReport(
        setup,
        len(mine["pairs"]),
        (mine["1"], mine["2"]),
        _spread([one for one, _ in mine["pairs"] if one is not None]),
        _spread([one for _, one in mine["pairs"] if one is not None]),
        mine["apart"],
    )


def _spread(values):
    if not values:
        return None
    mean = sum(values) / len(values)
    return mean, max(abs(one - mean) for one in values)
