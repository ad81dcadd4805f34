"""Mean of the two faces of the instrument, and its collimation and index errors.

    c = (hz1 - hz2 + 180) / 2 . sin z        collimation error
    i = (v1 + v2 - 360) / 2                  index error of the vertical circle

The mean of both faces contains neither c nor i. A single reading on face 2 is converted to face 1.
Single readings are corrected with the mean c and i of the pairs of their set-up:

    hz = hz1 - c / sin z,    v = v1 - i
"""

import math
from dataclasses import dataclass, replace

from tankcal.fieldbooks.book import FULL_TURN, HALF_TURN
from tankcal.messages import message

NO_PAIR_DEG = 0.1  # largest difference of the two faces of one point
LARGE_DEG = 0.0045  # 0.005 gon: larger errors cause a warning (own choice)
LARGE_M = 0.005  # largest difference of the distances on both faces
DEGREE = math.pi / HALF_TURN


@dataclass(frozen=True)
class Pointing:
    """Result of pointings to one point on face 1: one face, or the mean of both.

    Attributes
    ----------
    shot : Shot
        Values of face 1.
    faces : str
        "1", "2" or "both".
    """

    shot: object
    faces: str


@dataclass(frozen=True)
class FaceReport:
    """Instrument errors from the pairs of a set-up; degrees, metres.

    Attributes
    ----------
    setup : int
    pairs : int
    single : tuple
        Number of single readings on face 1 and on face 2.
    collimation, index : tuple or None
        (mean, largest deviation from the mean); None without pairs.
    apart_m : float
        Largest difference of the distances of a pair.
    """

    setup: int
    pairs: int
    single: tuple
    collimation: tuple | None
    index: tuple | None
    apart_m: float


def reduce_faces(shots, log):
    """Return the pointings in the order of the shots, and a FaceReport for each set-up.

    The second face of a point is the next shot with its name on the other face of the same set-up.
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
        tally = errors.setdefault(shot.setup, {"pairs": [], "1": 0, "2": 0, "apart": 0.0})
        if place in seconds:
            continue
        if place in mates:
            pair = sorted((shot, shots[mates[place]]), key=lambda member: member.face)
            mean = _mean(*pair, tally, log)
            if mean is not None:
                readings.append(Pointing(replace(mean, row=shot.row, time=shot.time), "both"))
        else:
            tally[str(shot.face)] += 1
            readings.append(Pointing(_convert_to_face_1(shot), str(shot.face)))
    reports = {setup: _report(setup, tally) for setup, tally in errors.items()}
    return [_correct_single(reading, reports[reading.shot.setup]) for reading in readings], [
        *reports.values()
    ]


def _correct_single(reading, report):
    """Return a single reading corrected by the mean c and i of its set-up."""
    if reading.faces == "both":
        return reading
    # Readings of face 2 are already converted to face 1, which reverses the sign.
    sign = 1.0 if reading.faces == "1" else -1.0
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
    """Return the sine of a zenith angle in degrees, at least 0.001."""
    return max(math.sin(zenith * DEGREE), 1e-3)


def _convert_to_face_1(shot):
    """Return a shot converted to face 1."""
    if shot.face == 1:
        return shot
    direction, zenith = shot.direction_deg, shot.zenith_deg
    # The telescope is transited: half a turn of the circle, and the zenith angle counted back.
    return replace(
        shot,
        direction_deg=None if direction is None else (direction + HALF_TURN) % FULL_TURN,
        zenith_deg=None if zenith is None else FULL_TURN - zenith,
    )


def _mean(first, second, tally, log):
    """Return the mean of a pair on face 1, or None after reporting that the faces disagree."""
    turned, means = _convert_to_face_1(second), {}
    sine = 1.0
    collimation = index = None
    # Half the difference of the faces is i, and half their difference across is c / sin z.
    if None not in (first.zenith_deg, turned.zenith_deg):
        index = (first.zenith_deg - turned.zenith_deg) / 2
        means["zenith_deg"] = first.zenith_deg - index
        sine = _sine(means["zenith_deg"])
    if None not in (first.direction_deg, turned.direction_deg):
        apart = (first.direction_deg - turned.direction_deg + HALF_TURN) % FULL_TURN - HALF_TURN
        collimation = apart / 2 * sine
        means["direction_deg"] = (first.direction_deg - apart / 2) % FULL_TURN
    if any(abs(error) > NO_PAIR_DEG for error in (collimation, index) if error is not None):
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
    tally["pairs"].append((collimation, index))
    if None not in (first.distance_m, turned.distance_m):
        means["distance_m"] = (first.distance_m + turned.distance_m) / 2
        tally["apart"] = max(tally["apart"], abs(first.distance_m - turned.distance_m))
    # A value read on one face only is that of this face.
    merged = {
        key: getattr(turned, key) if getattr(first, key) is None else getattr(first, key)
        for key in ("direction_deg", "zenith_deg", "distance_m")
    }
    return replace(first, **(merged | means))


def _report(setup, tally):
    """Return the FaceReport of a set-up."""
    return FaceReport(
        setup,
        len(tally["pairs"]),
        (tally["1"], tally["2"]),
        _spread([collimation for collimation, _ in tally["pairs"] if collimation is not None]),
        _spread([index for _, index in tally["pairs"] if index is not None]),
        tally["apart"],
    )


def _spread(values):
    """Return (mean, largest deviation from the mean), or None without values."""
    if not values:
        return None
    mean = sum(values) / len(values)
    return mean, max(abs(value - mean) for value in values)
