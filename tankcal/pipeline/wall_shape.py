"""Shape of an upright wall for an inspection: radii about the level centres, and plumb.

At each surveyed level, and 0.3 m above the bottom, the shape is the inside radius r about the
centre of that level. Between levels l and m, along the generatrix at azimuth t with direction n, it
is

    r_m(t) - r_l(t) + n(t) . (c_m - c_l),

with c the centres of the levels. All values have one covariance, from the survey and from form that
the survey did not see. Common plates, offsets and scales therefore cancel in differences.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tankcal.methods.base import completing_method
from tankcal.pipeline.shape_figures import Figures, Level, ShapeBase
from tankcal.pipeline.surveyed_wall import Wall
from tankcal.units import FOOT_M, FULL_TURN

LOW_M = FOOT_M  # height of the low radii: one foot above the bottom weld
SAME_LEVEL_M = 0.05  # largest height difference of equal levels
# Largest number of measured azimuths of a level; number after thinning.
MOST_AZIMUTHS, EVEN_AZIMUTHS = 72, 36
LEAST_HEIGHT = 0.2  # least distance of two levels for a plumb, relative to the course height
NEAR_M = 0.1  # largest distance from the wall of a point that may be a dent


@dataclass(frozen=True)
class Plumb:
    """Deviations of the upper of two levels from the plumb, outwards positive, by azimuth.

    Attributes
    ----------
    low, high : int
        Indices of the levels in the `WallShape`.
    azimuth_rad : ndarray, shape (g,)
    is_read : ndarray of bool, shape (g,)
        Whether both ends were measured; otherwise at least one end is estimated from neighbours.
    figures : Figures
        Deviations with their uncertainty.
    """

    low: int
    high: int
    azimuth_rad: np.ndarray
    is_read: np.ndarray
    figures: Figures


@dataclass(frozen=True)
class SetAside:
    """Rejected point near the wall: a fitting, a mistake or a dent.

    Attributes
    ----------
    point : str
        Name.
    height_m, azimuth_rad : float
        Height above the bottom of the shell, m, and azimuth about the axis.
    residual_m : float
        Outward distance from the wall of the accepted points, m.
    """

    point: str
    height_m: float
    azimuth_rad: float
    residual_m: float


@dataclass(frozen=True)
class WallShape:
    """Shape of a wall for an inspection.

    Attributes
    ----------
    set_aside : tuple of SetAside
        Rejected points near the wall.
    state : str
        "as_found": loaded as during the survey; "unloaded": without the head of the survey's
        liquid.
    levels : tuple of Level
        From the bottom up.
    radii : tuple of Figures
        Inside radii of each level about its centre, at its azimuths.
    centres_m : tuple
        (x, y) of each level in the frame of the survey; None if unknown.
    plumbs : tuple of Plumb
        Each level with a centre against the lowest such level; () for fewer than two.
    axis : Figures or None
        x and y of the highest centre minus the lowest, then the length of this difference.
    courses : tuple of Plumb
        Highest against lowest level of each course with two levels sufficiently far apart.
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
    """`WallShape` of a job's wall; None unless the wall was surveyed by points."""
    if not isinstance(wall, Wall) or completing_method(job) is not None:
        return None
    levels = _levels(job, wall)
    plumbed = [i for i, level in enumerate(levels) if level.ring >= 0]
    pairs = [(plumbed[0], upper) for upper in plumbed[1:]]
    of_courses = _pairs_of_courses(wall, levels, plumbed)
    base = ShapeBase(job, wall, levels, plumbed, (*pairs, *of_courses))
    rows = [base.radii(i, level.azimuth_rad) for i, level in enumerate(levels)]
    rows += [base.plumb(*pair) for pair in (*pairs, *of_courses)]
    if pairs:
        rows.append(base.axis(*pairs[-1]))
    all_figures = base.figures(np.vstack(rows))
    ends = np.cumsum([0, *map(len, rows)])
    figures = [all_figures.part(*pair) for pair in pairwise(ends)]
    radii, differences = figures[: len(levels)], figures[len(levels) :]
    plumbs = [
        Plumb(low, high, levels[low].azimuth_rad, base.is_read(low, high), part)
        for (low, high), part in zip((*pairs, *of_courses), differences, strict=False)
    ]
    return WallShape(
        tuple(_set_aside(job, wall)),
        base.state,
        levels,
        tuple(radii),
        tuple(base.centre(i) if i in plumbed else None for i in range(len(levels))),
        tuple(plumbs[: len(pairs)]),
        differences[-1] if pairs else None,
        tuple(plumbs[len(pairs) :]),
    )


def _set_aside(job, wall):
    """Rejected points near the wall."""
    shell, xyz = wall.shell, job.points.xyz_m
    is_near = (shell.reason != "") & (np.abs(shell.residual_m) <= NEAR_M)
    for i in np.flatnonzero(is_near):
        axis = np.array(shell.axis_m) + (xyz[i, 2] - shell.z_m) * np.array(shell.slope)
        x, y = xyz[i, :2] - axis
        yield SetAside(
            job.points.names[i],
            float(xyz[i, 2] - job.datum.bottom_z_m),
            float(np.arctan2(x, y) % FULL_TURN),
            float(shell.residual_m[i]),
        )


def _levels(job, wall):
    """Levels of the sections, and the low level; an inclined section has two levels."""
    levels = []
    for ring, section in enumerate(wall.sections):
        group, sites_of_ring = section.group, _readings_of(wall.field.sites, ring)
        azimuth = wall.field.sites.azimuth_rad[sites_of_ring] % FULL_TURN
        if group.degree == 0:
            height, zeta = group.height_m, float(group.zeta(group.height_m))
            levels.append(Level(height, group.course, zeta, azimuth, ring, sites_of_ring))
            continue
        points = wall.accepted[group.members]
        heights = job.points.xyz_m[points, 2] - job.datum.bottom_z_m
        for height_m in np.quantile(heights, [0.1, 0.9]).tolist():
            zeta = float(group.zeta(height_m))
            levels.append(
                Level(height_m, group.course, zeta, azimuth, ring, np.full(len(sites_of_ring), -1))
            )
    levels.sort(key=lambda level: level.height_m)
    return _with_low(levels, wall.joints_m[1])


def _with_low(levels, top_m):
    """Levels with the low level marked, or added; `top_m` is the top of the first course."""
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
        levels = sorted([*levels, low], key=lambda level: level.height_m)
    return tuple(levels)


def _readings_of(sites, ring):
    """Readings of a ring by azimuth, thinned to an even spacing if numerous."""
    of_ring = np.flatnonzero(sites.ring == ring)
    azimuth = sites.azimuth_rad[of_ring] % FULL_TURN
    of_ring = of_ring[np.argsort(azimuth, kind="stable")]
    if len(of_ring) <= MOST_AZIMUTHS:
        return of_ring
    targets = np.arange(EVEN_AZIMUTHS) * FULL_TURN / EVEN_AZIMUTHS
    distance = np.abs((np.sort(azimuth)[:, None] - targets + np.pi) % FULL_TURN - np.pi)
    return of_ring[np.unique(np.argmin(distance, axis=0))]


def _pairs_of_courses(wall, levels, plumbed):
    """(Lowest, highest) level of each course in which two levels are sufficiently far apart."""
    pairs = []
    for course, height in enumerate(np.diff(wall.joints_m)):
        of_course = [i for i in plumbed if levels[i].course == course]
        if (
            of_course
            and levels[of_course[-1]].height_m - levels[of_course[0]].height_m
            >= LEAST_HEIGHT * height
        ):
            pairs.append((of_course[0], of_course[-1]))
    return pairs
