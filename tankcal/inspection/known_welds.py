"""Welds of a shell: vertical welds that are given or detected, and horizontal welds."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.inspection.weld_cells import turned

PEAKING, BANDING = "peaking", "banding"
APART_M = 0.3  # distance beyond which a detected weld differs from a given weld
LOOSE_M = 0.12  # largest error of the place of a weld that was detected in coarse cells


@dataclass(frozen=True)
class KnownWeld:
    """Place of a weld for the gaps of boards.

    Attributes
    ----------
    kind : str
        "peaking" for a vertical weld, "banding" for a horizontal weld.
    course : int
        Course, counted from 0 at the bottom; for a horizontal weld, the course below it.
    low_m, high_m : float
        Heights of the ends of a vertical weld above the bottom of the shell, m; for a horizontal
        weld, both are its height.
    azimuth_rad : float
        Azimuth, clockwise from +y, rad; 0 for a horizontal weld.
    loose_m : float
        Largest error of the place, m; 0 for a given weld.
    """

    kind: str
    course: int
    low_m: float
    high_m: float
    azimuth_rad: float = 0.0
    loose_m: float = 0.0


def known_welds(course_heights_m, given_rad=(), detected=(), radius_m=np.inf):
    """List the welds of a shell: vertical welds, then horizontal welds, from the bottom up.

    Parameters
    ----------
    course_heights_m : sequence of float
        Heights of the courses between joints, from the bottom up, m.
    given_rad : sequence of sequence of float or None, optional
        Given azimuths of the vertical welds of each course, rad; None if unknown.
    detected : sequence of tankcal.clouds.wall.features.Weld, optional
        Welds detected in a cloud. A weld near a given weld of its course is ignored.
    radius_m : float, optional
        Radius of the shell, m.

    Returns
    -------
    tuple of KnownWeld

    Examples
    --------
    >>> [(weld.kind, weld.course, weld.high_m) for weld in known_welds([2.0, 1.5], [[0.5], None])]
    [('peaking', 0, 2.0), ('banding', 0, 2.0)]
    """
    joints = np.concatenate([[0.0], np.cumsum(course_heights_m)]).tolist()
    welds = []
    for course, (low, high) in enumerate(pairwise(joints)):
        given = list((given_rad[course] or ()) if course < len(given_rad) else ())
        welds += [KnownWeld(PEAKING, course, low, high, float(weld)) for weld in given]
        for weld in detected:
            if weld.course == course and _is_apart(weld.azimuth_rad, given, radius_m):
                at = float(weld.azimuth_rad)
                welds.append(KnownWeld(PEAKING, course, low, high, at, LOOSE_M))
    rounds = [KnownWeld(BANDING, course, at, at) for course, at in enumerate(joints[1:-1])]
    return (*welds, *rounds)


def _is_apart(azimuth, given, radius_m):
    """Whether an azimuth differs from all given azimuths by more than APART_M along the shell."""
    return all(abs(turned(azimuth - known)) * radius_m > APART_M for known in given)
