"""Set-ups with mostly rejected hits, and the probable cause.

Possible causes are an anticlockwise circle, another zero of the circle, or hits under the name of
another set-up. Each cause is tried with the given poses. It is reported if it brings the hits to
the wall of all others.
"""

import numpy as np

from tankcal.errors import Problem
from tankcal.geometry.circles import taubin_circle
from tankcal.messages import message
from tankcal.survey.sighting import certified_m, rays
from tankcal.units import FULL_TURN

# Smallest shares of rejected hits for a warning, with and without a known cause; smallest number.
MANY, MOST, FEWEST = 0.2, 0.5, 5
OFF_M = 0.01  # smallest median distance of the rejected hits from the wall
CLOSER = 0.2  # largest distance under an accepted cause, relative to the distance as read
TURNS = 720  # number of tried zeros of a circle


def check_lost_setups(job, wall, sighting):
    """Yield warnings of set-ups with mostly rejected hits.

    Parameters
    ----------
    job : Job
    wall : Wall
    sighting : Sighting

    Yields
    ------
    Problem
    """
    used = np.flatnonzero(~job.hits.check)
    kept = wall.accepted[wall.accepted < len(used)]  # the points list targets after hits
    is_rejected = np.ones(len(used), dtype=bool)
    is_rejected[kept] = False
    if is_rejected.all():
        return
    names = np.array(job.hits.setup)[used]
    for name in dict.fromkeys(names.tolist()):
        is_of_setup = names == name
        count, total = int((is_of_setup & is_rejected).sum()), int(is_of_setup.sum())
        if count < max(FEWEST, MANY * total):
            continue
        distance_off, pose_and_zero = _make_distance(
            job.hits, sighting, used[is_of_setup & is_rejected], used[~is_rejected]
        )
        cause = _find_cause(job.hits, sighting, distance_off, pose_and_zero, name)
        if distance_off(*pose_and_zero) < OFF_M or (cause is None and count < MOST * total):
            continue
        text = message(
            "setup_set_aside",
            "{count} of {all} hits of set-up {name!r} lie off the wall of all others and were set"
            " aside: {cause}",
            count=count,
            all=total,
            name=name,
            cause=cause
            or message(
                "setup_elsewhere",
                "is its station, its instrument or the zero of its circle another one?",
            ),
        )
        yield Problem(
            job.hits.file, text, job.hits.rows[used[is_of_setup & is_rejected][0]], "setup"
        )


def _make_distance(hits, sighting, rejected, accepted):
    """Function for the distance of the rejected hits of a set-up, and its present arguments.

    Parameters
    ----------
    hits : Hits
    sighting : Sighting
    rejected, accepted : ndarray of int
        Rejected hits of the set-up, and accepted hits of all set-ups.

    Returns
    -------
    callable
        off(pose, zero of the circle, sense of the circle): median distance (m) of the rejected hits
        from the circle through the accepted hits.
    (int, float)
        Pose and zero of the circle as adjusted.
    """
    xy = sighting.points.xyz_m[accepted, :2]
    middle = xy.mean(axis=0)
    x, y, radius = taubin_circle(xy - middle)
    poses, pose = sighting.poses, int(sighting.pose[rejected[0]])
    distance = certified_m(hits)[rejected, None]

    def off(place, zero, sense=1.0):
        ray = rays(zero + sense * hits.direction_rad[rejected], hits.zenith_rad[rejected])[0]
        away = poses.xyz_m[place, :2] + (distance * ray)[:, :2] - middle - (x, y)
        return float(np.median(np.abs(np.hypot(*away.T) - radius)))

    return off, (pose, poses.orientation_rad[pose])


def _find_cause(hits, sighting, distance_off, pose_and_zero, name):
    """Cause that brings the hits to the wall, in words, or None."""
    pose, zero = pose_and_zero
    largest_m = CLOSER * distance_off(pose, zero)
    if distance_off(pose, zero, -1.0) < largest_m:
        return message("setup_anticlockwise", "do its directions grow anticlockwise?")
    for key, other in dict.fromkeys(zip(hits.setup, sighting.pose.tolist(), strict=True)):
        if key != name and distance_off(other, sighting.poses.orientation_rad[other]) < largest_m:
            return message("setup_of_other", "are they those of set-up {other!r}?", other=key)
    turns = np.arange(TURNS) * FULL_TURN / TURNS
    turn = min(turns, key=lambda change: distance_off(pose, zero + change))
    if distance_off(pose, zero + turn) < largest_m:
        return message(
            "setup_turned",
            "turned by {degrees:+.0f} degrees they lie on it; has the circle another zero?",
            degrees=180 - (180 - np.degrees(turn)) % 360,
        )
    return None
