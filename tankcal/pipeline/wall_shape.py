"""The shape of an upright wall for an inspection: radii about the own centres, and the plumb.

At the levels that were surveyed, and 0.3 m above the bottom, the inside radius r about the own
centre of the level; between levels l and m, along the generatrix of azimuth t with n its direction,

    r_m(t) - r_l(t) + n(t) . (c_m - c_l),

c the centres of the levels. All with one covariance, by what the survey leaves uncertain and by
what it did not see of the wall, so that plates, offsets and scales drop out of differences.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tankcal.geometry.outlines import FULL_TURN
from tankcal.pipeline.shape_figures import Figures, Level, ShapeBase
from tankcal.pipeline.surveyed_wall import Wall

LOW_M = 0.3048  # a foot above the bottom weld, where the low radii are judged
SAME_LEVEL_M = 0.05  # a level as near as that to another is the same
MOST_AZIMUTHS, EVEN_AZIMUTHS = 72, 36  # of a level as measured; of one with more points
LEAST_HEIGHT = 0.2  # of a course: levels nearer than that tell nothing of its plumb
NEAR_M = 0.1  # from the wall: what stands there may be a dent


@dataclass(frozen=True)
class Plumb:
    """Departures of the upper of two levels from the plumb, outwards positive, by azimuth.

    low, high : int
        Which of the levels of the `WallShape`.
    azimuth_rad : ndarray, shape (g,)
    is_read : ndarray of bool, shape (g,)
        Whether there is a reading at both ends; else at least one end is estimated by its
        neighbours.
    """

    low: int
    high: int
    azimuth_rad: np.ndarray
    is_read: np.ndarray
    figures: Figures


@dataclass(frozen=True)
class SetAside:
    """A point near the wall that was not taken for it: of a fitting, a slip, or a dent.

    Attributes
    ----------
    point : str
        Name.
    height_m, azimuth_rad : float
        Where: above the bottom of the shell, about the axis.
    residual_m : float
        Outwards from the wall as all other points show it.
    """

    point: str
    height_m: float
    azimuth_rad: float
    residual_m: float


@dataclass(frozen=True)
class WallShape:
    """What an inspection asks of a wall.

    Attributes
    ----------
    set_aside : tuple of SetAside
        Points near the wall that were not taken for it.
    state : str
        "as_found": loaded as it was surveyed; "unloaded": the head of the survey's liquid taken
        off.
    levels : tuple of Level
        From the bottom up.
    radii : tuple of Figures
        Of each level at its azimuths: inside, about its own centre.
    centres_m : tuple
        (x, y) of each level in the frame of the survey; None where it is not known.
    plumbs : tuple of Plumb
        Of each level with a centre against the lowest of these; (): fewer than two.
    axis : Figures or None
        x and y of the highest centre less the lowest, then its length.
    courses : tuple of Plumb
        Of each course with two levels far enough apart, its highest against its lowest.
    """

    set_aside: tuple[SetAside, ...]
    state: str
    levels: tuple[Level, ...]
    radii: tuple[Figures, ...]
    centres_m: tuple
    plumbs: tuple[Plumb, ...]
    axis: Figures | None
    courses: tuple[Plumb, ...]


def wall_shape_of(job, wall):
    """The `WallShape` of a job's wall; None where no wall of points was surveyed."""
    if not isinstance(wall, Wall) or job.radii is not None:
        return None
    levels = _levels(job, wall)
    plumbed = [i for i, level in enumerate(levels) if level.ring >= 0]
    pairs = [(plumbed[0], number) for number in plumbed[1:]]
    of_courses = _pairs_of_courses(wall, levels, plumbed)
    base = ShapeBase(job, wall, levels, plumbed, (*pairs, *of_courses))
    rows = [base.radii(i, level.azimuth_rad) for i, level in enumerate(levels)]
    rows += [base.plumb(*pair) for pair in (*pairs, *of_courses)]
    if pairs:
        rows.append(base.axis(*pairs[-1]))
    whole = base.figures(np.vstack(rows))
    ends = np.cumsum([0, *map(len, rows)])
    found = [whole.part(*pair) for pair in pairwise(ends)]
    radii, others = found[: len(levels)], found[len(levels) :]
    plumbs = [
        Plumb(low, high, levels[low].azimuth_rad, base.is_read(low, high), part)
        for (low, high), part in zip((*pairs, *of_courses), others, strict=False)
    ]
    return WallShape(
        tuple(_set_aside(job, wall)),
        base.state,
        levels,
        tuple(radii),
        tuple(base.centre(i) if i in plumbed else None for i in range(len(levels))),
        tuple(plumbs[: len(pairs)]),
        others[-1] if pairs else None,
        tuple(plumbs[len(pairs) :]),
    )


def _set_aside(job, wall):
    """Points near the wall that were not taken for it."""
    shell, xyz = wall.shell, job.points.xyz_m
    near = (shell.reason != "") & (np.abs(shell.residual_m) <= NEAR_M)
    for i in np.flatnonzero(near):
        axis = np.array(shell.axis_m) + (xyz[i, 2] - shell.z_m) * np.array(shell.slope)
        x, y = xyz[i, :2] - axis
        yield SetAside(
            job.points.names[i],
            float(xyz[i, 2] - job.datum.bottom_z_m),
            float(np.arctan2(x, y) % FULL_TURN),
            float(shell.residual_m[i]),
        )


def _levels(job, wall):
    """Levels of the sections, and the low one; a section that is not level has two."""
    found = []
    for ring, section in enumerate(wall.sections):
        group, chosen = section.group, _readings_of(wall.field.sites, ring)
        azimuth = wall.field.sites.azimuth_rad[chosen] % FULL_TURN
        if group.degree == 0:
            height, zeta = group.height_m, float(group.zeta(group.height_m))
            found.append(Level(height, group.course, zeta, azimuth, ring, chosen))
            continue
        points = wall.accepted[group.members]
        heights = job.points.xyz_m[points, 2] - job.datum.bottom_z_m
        for one in np.quantile(heights, [0.1, 0.9]).tolist():
            zeta = float(group.zeta(one))
            found.append(Level(one, group.course, zeta, azimuth, ring, np.full(len(chosen), -1)))
    found.sort(key=lambda one: one.height_m)
    return _with_low(found, wall.joints_m[1])


def _with_low(levels, top_m):
    """The levels with the low one marked, or added where none is near; first course to top_m."""
    place = min(range(len(levels)), key=lambda i: abs(levels[i].height_m - LOW_M))
    nearest = levels[place]
    if abs(nearest.height_m - LOW_M) <= SAME_LEVEL_M:
        levels[place] = replace(nearest, is_low=True)
    elif top_m > LOW_M:
        low = replace(
            levels[0],
            height_m=LOW_M,
            course=0,
            zeta=2 * LOW_M / top_m - 1,
            ring=-1,
            site=np.full(len(levels[0].site), -1),
            is_low=True,
        )
        levels = sorted([*levels, low], key=lambda one: one.height_m)
    return tuple(levels)


def _readings_of(sites, ring):
    """Readings of a ring by azimuth; of many some that are about evenly spread."""
    own = np.flatnonzero(sites.ring == ring)
    azimuth = sites.azimuth_rad[own] % FULL_TURN
    own = own[np.argsort(azimuth, kind="stable")]
    if len(own) <= MOST_AZIMUTHS:
        return own
    even = np.arange(EVEN_AZIMUTHS) * FULL_TURN / EVEN_AZIMUTHS
    away = np.abs((np.sort(azimuth)[:, None] - even + np.pi) % FULL_TURN - np.pi)
    return own[np.unique(np.argmin(away, axis=0))]


def _pairs_of_courses(wall, levels, plumbed):
    """(lowest, highest) level of each course in which two stand far enough apart."""
    pairs = []
    for course, tall in enumerate(np.diff(wall.joints_m)):
        own = [i for i in plumbed if levels[i].course == course]
        if own and levels[own[-1]].height_m - levels[own[0]].height_m >= LEAST_HEIGHT * tall:
            pairs.append((own[0], own[-1]))
    return pairs
