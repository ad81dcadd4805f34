"""Set-ups most of whose hits were rejected, and what would bring these to the wall.

A circle that counts anticlockwise or from another zero, hits under the name of another set-up: each
is tried with the poses as they are, and told where the hits come to lie on the wall of all others.
"""

import numpy as np

from tankcal.errors import Problem
from tankcal.geometry.circles import taubin_circle
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message
from tankcal.survey.sighting import certified_m, rays

MANY, MOST, FEWEST = 0.2, 0.5, 5  # of the hits of a set-up, rejected: with a cause, without; hits
OFF_M = 0.01  # from the wall, by which they are at least
CLOSER = 0.2  # distance from the wall, of that as it is read, from which on a cause is told
TURNS = 720  # zeros of a circle that are tried


def check_lost_setups(job, wall, sighting):
    """`Problem`s of set-ups most of whose hits were rejected."""
    counted = np.flatnonzero(~job.hits.check)
    kept = wall.accepted[wall.accepted < len(counted)]  # targets come after the hits
    lost = np.ones(len(counted), dtype=bool)
    lost[kept] = False
    if lost.all():
        return
    names = np.array(job.hits.setup)[counted]
    for name in dict.fromkeys(names.tolist()):
        mine = names == name
        count, every = int((mine & lost).sum()), int(mine.sum())
        if count < max(FEWEST, MANY * every):
            continue
        off, as_read = _distance_off(job.hits, sighting, counted[mine & lost], counted[~lost])
        cause = _cause(job.hits, sighting, off, as_read, name)
        if off(*as_read) < OFF_M or (cause is None and count < MOST * every):
            continue
        text = message(
            "setup_set_aside",
            "{count} of {all} hits of set-up {name!r} lie off the wall of all others and were set"
            " aside: {cause}",
            count=count,
            all=every,
            name=name,
            cause=cause
            or message(
                "setup_elsewhere",
                "is its station, its instrument or the zero of its circle another one?",
            ),
        )
        yield Problem(job.hits.file, text, job.hits.rows[counted[mine & lost][0]], "setup")


def _distance_off(hits, sighting, lost, kept):
    """off(pose, zero of its circle, sense): median distance (m) of the lost hits from the circle of
    those that were kept; and the first two as they are.
    """
    xy = sighting.points.xyz_m[kept, :2]
    middle = xy.mean(axis=0)
    x, y, radius = taubin_circle(xy - middle)
    poses, pose = sighting.poses, int(sighting.pose[lost[0]])
    distance = certified_m(hits)[lost, None]

    def off(place, zero, sense=1.0):
        ray = rays(zero + sense * hits.direction_rad[lost], hits.zenith_rad[lost])[0]
        away = poses.xyz_m[place, :2] + (distance * ray)[:, :2] - middle - (x, y)
        return float(np.median(np.abs(np.hypot(*away.T) - radius)))

    return off, (pose, poses.orientation_rad[pose])


def _cause(hits, sighting, off, as_read, name):
    """What brings the hits to the wall, in words; None: nothing."""
    pose, zero = as_read
    most = CLOSER * off(pose, zero)
    if off(pose, zero, -1.0) < most:
        return message("setup_anticlockwise", "do its directions grow anticlockwise?")
    for key, other in dict.fromkeys(zip(hits.setup, sighting.pose.tolist(), strict=True)):
        if key != name and off(other, sighting.poses.orientation_rad[other]) < most:
            return message("setup_of_other", "are they those of set-up {other!r}?", other=key)
    turns = np.arange(TURNS) * FULL_TURN / TURNS
    turn = min(turns, key=lambda one: off(pose, zero + one))
    if off(pose, zero + turn) < most:
        return message(
            "setup_turned",
            "turned by {degrees:+.0f} degrees they lie on it; has the circle another zero?",
            degrees=180 - (180 - np.degrees(turn)) % 360,
        )
    return None
