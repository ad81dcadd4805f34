"""The welds of a shell: vertical ones that are given or found, horizontal ones of the courses."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.inspection.weld_cells import turned

PEAKING, BANDING = "peaking", "banding"
APART_M = 0.3  # a weld that is found is another than one given from there on
LOOSE_M = 0.12  # by which a weld found in coarse cells may lie beside its place


@dataclass(frozen=True)
class KnownWeld:
    """A weld that a board is laid over.

    Attributes
    ----------
    kind : str
        "peaking": a vertical weld; "banding": a horizontal one.
    course : int
        From the bottom, 0 first; of a horizontal weld that below it.
    low_m, high_m : float
        Ends of a vertical weld above the bottom of the shell, m; of a horizontal one its height.
    azimuth_rad : float
        Clockwise from +y, rad; of a horizontal weld 0.
    loose_m : float
        By how much its place may be off, m: 0 where it was given.
    """

    kind: str
    course: int
    low_m: float
    high_m: float
    azimuth_rad: float = 0.0
    loose_m: float = 0.0


def known_welds(course_heights_m, given_rad=(), found=(), radius_m=np.inf):
    """`KnownWeld` tuple of a shell, from the bottom up, vertical ones first.

    Parameters
    ----------
    course_heights_m : sequence of float
        From joint to joint, from the bottom up, m.
    given_rad : sequence of sequence of float or None, optional
        Azimuths of the vertical welds of each course as they are given, rad; None: not known.
    found : sequence of tankcal.clouds.wall.features.Weld, optional
        As a cloud shows them; one near a given weld of its course is that.
    radius_m : float, optional
        Of the shell, m.

    Examples
    --------
    >>> [(one.kind, one.course, one.high_m) for one in known_welds([2.0, 1.5], [[0.5], None])]
    [('peaking', 0, 2.0), ('banding', 0, 2.0)]
    """
    joints = np.concatenate([[0.0], np.cumsum(course_heights_m)]).tolist()
    welds = []
    for course, (low, high) in enumerate(pairwise(joints)):
        given = list((given_rad[course] or ()) if course < len(given_rad) else ())
        welds += [KnownWeld(PEAKING, course, low, high, float(one)) for one in given]
        for one in found:
            if one.course == course and _is_apart(one.azimuth_rad, given, radius_m):
                at = float(one.azimuth_rad)
                welds.append(KnownWeld(PEAKING, course, low, high, at, LOOSE_M))
    rounds = [KnownWeld(BANDING, course, at, at) for course, at in enumerate(joints[1:-1])]
    return (*welds, *rounds)


def _is_apart(azimuth, given, radius_m):
    return all(abs(turned(azimuth - one)) * radius_m > APART_M for one in given)
