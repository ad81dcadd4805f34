"""What stands in a tank off its wall, as proposals of deadwood that a person must confirm.

What is seen over the bottom is put together from cell to cell. Things that stand through most of
the height are held against a circle, height by height: a round column has a volume; of all else
the box round what is seen is told, which no face that no scan saw can pass.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.clouds.inside.bottom import level_everywhere
from tankcal.clouds.inside.floor_cells import STACK_M
from tankcal.clouds.wall.passes import Passes
from tankcal.clouds.wall.sampling import PointSample
from tankcal.errors import SolutionError
from tankcal.geometry.circles import fit_circle

LEAST_POINTS, LEAST_CELLS = 3, 3  # of a cell and level that is held, of a thing
CLEAR_M, ROOF_M, WALL_M = 0.05, 0.2, 0.2  # off the bottom, under the top, off the wall
STANDING, WIDEST_CELLS = 0.5, 6  # of the height; across a column
SAMPLE, SLAB_M, SLAB_POINTS, FEWEST = 40_000, 0.5, 600, 30
TRIES, BAND_M, THIN_M, THICK_M = 150, 0.006, 0.015, 1.0  # circles through three points
ROUND, ARC_RAD, SLABS, SAME = 0.6, 1.5, 4, 0.03  # of the points of a slab; seen; slabs; of r
LEAST_U_M = 0.0005
LEVEL_SHARE = 0.2  # of the plan: a roof or liquid, nothing that is deadwood


@dataclass(frozen=True)
class Thing:
    """Something that stands in the tank, off its wall.

    Attributes
    ----------
    kind : str
        "column" (round), "box" (anything else) or "level surface" (over a large part of the plan).
    low_m, high_m : tuple of float, (3,)
        Corners of the box round what is seen, in the frame of the points, m; of a column the box
        of the cylinder.
    radius_m, u_radius_m : float
        Of a column, nan of others, m.
    volume_m3, u_volume_m3 : float
        Of a column, nan of others, m3.
    box_m3 : float
        Volume of the box (of a column: of the cylinder), m3: a bound of what is seen, but sides
        that no scan saw may lie beyond.
    points : int
        That it was told by.
    """

    kind: str
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]
    radius_m: float
    u_radius_m: float
    volume_m3: float
    u_volume_m3: float
    box_m3: float
    points: int

    @property
    def deadwood_row(self):
        """name, bottom, top (heights in the frame of the points, m), volume (negative) and u, m3.

        nan where nothing tells the volume: a person measures it.
        """
        x, y = (np.add(self.low_m, self.high_m) / 2)[:2]
        name = f"{self.kind} {x:.2f} {y:.2f}"
        return name, self.low_m[2], self.high_m[2], -self.volume_m3, self.u_volume_m3


@dataclass(frozen=True)
class ThingCells:
    """Which thing is in which cell.

    Attributes
    ----------
    grid : FloorGrid
    label : ndarray of int, shape (across, across, levels)
        Its number, 0: none.
    clear_m : ndarray, shape (across, across)
        Height under which a point is of the bottom.
    from_inside : sequence of bool
        Whether each scan stood inside.
    """

    grid: object
    label: np.ndarray
    clear_m: np.ndarray
    from_inside: tuple

    @property
    def count(self):
        """Of the things."""
        return int(self.label.max(initial=0))


class ThingSamples:
    """A `PointSample` of each of so many things."""

    def __init__(self, count):
        self.samples = [PointSample(SAMPLE) for _ in range(count)]

    def merged(self, other):
        """Those of the points of both."""
        both = ThingSamples(0)
        pairs = zip(self.samples, other.samples, strict=True)
        both.samples = [one.merged(more) for one, more in pairs]
        for one in both.samples:
            one.reduce()
        return both


def things_of(points, cells):
    """`ThingSamples` of an iterator of (scan, points), by `ThingCells`."""
    found, label = ThingSamples(cells.count), cells.label
    for scan, xyz in points:
        if not cells.from_inside[scan]:
            continue
        place = _places(xyz, cells.grid)
        known = np.all((place >= 0) & (place < label.shape), axis=1)
        xyz, place = xyz[known], place[known]
        mine = label[tuple(place.T)]
        mine[xyz[:, 2] < cells.clear_m[place[:, 0], place[:, 1]]] = 0
        for one in np.unique(mine[mine > 0]):
            found.samples[one - 1].add(xyz[mine == one], scan)
    return found


def find_things(passes, bottom, sides=None):
    """`Thing` tuple of what stands off the wall, the tallest first.

    Parameters
    ----------
    passes : callable, or an object as `passes.Passes` is
        As for `find_cloud_wall`; read once more.
    bottom : CloudBottom
    sides : sequence of str, optional
        As for `find_cloud_bottom`.
    """
    grid = bottom.grid
    level = level_everywhere(bottom.xyz_m[..., 2], bottom.is_bottom)
    label, standing = _labels(bottom, level)
    inside = tuple(one != "outside" for one in sides or ["inside"] * bottom.cells.scans)
    passes = Passes(passes) if callable(passes) else passes
    cells = ThingCells(grid, label, level + CLEAR_M, inside)
    if not cells.count:
        return ()
    found = []
    for one, sample in enumerate(passes.gather(things_of, cells).samples, start=1):
        xyz = sample.points()
        if len(xyz) >= FEWEST:
            column = _column(xyz, level, grid) if one <= standing else None
            found.append(column or _box(xyz, label == one, level, bottom))
    return tuple(sorted(found, key=lambda thing: thing.low_m[2] - thing.high_m[2]))


def _places(xyz_m, grid):
    """(n, 3) cell along x, along y, and level of points."""
    plan = np.floor((xyz_m[:, :2] - grid.corner_m) / grid.cell_m)
    up = np.floor((xyz_m[:, 2] - grid.low_m) / STACK_M)
    return np.column_stack([plan, up]).astype(np.int64)


def _labels(bottom, level):
    """Number of the thing in each cell and level, 0: none, and how many of the first ones stand
    through most of the height.
    """
    grid = bottom.grid
    shape = grid.across, grid.across, grid.levels
    edge = grid.low_m + np.arange(grid.levels) * STACK_M
    open_ = (edge > (level + CLEAR_M)[..., None]) & (edge < grid.top_m - ROOF_M - STACK_M)
    middle = (np.arange(grid.across) + 0.5 - grid.across / 2) * grid.cell_m
    away = np.hypot(middle[:, None], middle[None, :])
    open_ &= (away < grid.surface.radius_m - WALL_M)[..., None]
    held = open_ & (bottom.cells.stack.reshape(shape) >= LEAST_POINTS)
    tall = held.sum(axis=2) > STANDING * open_.sum(axis=2).max(initial=1)
    upright, standing = scipy.ndimage.label(tall, np.ones((3, 3)))
    label = np.zeros(shape, dtype=np.int64)
    for one, where in enumerate(scipy.ndimage.find_objects(upright), start=1):
        if max(part.stop - part.start for part in where) > WIDEST_CELLS:
            continue
        near = scipy.ndimage.binary_dilation(upright == one, np.ones((3, 3)))
        label[near[..., None] & open_ & (label == 0)] = one
    rest, count = scipy.ndimage.label(held & (label == 0), np.ones((3, 3, 3)))
    sizes = np.bincount(rest.ravel(), minlength=count + 1)
    large = np.flatnonzero(sizes[1:] >= LEAST_CELLS) + 1
    number = np.zeros(count + 1, dtype=np.int64)
    number[large] = standing + 1 + np.arange(len(large))
    return label + number[rest], standing


def _box(xyz, where, level, bottom):
    """A `Thing` whose volume is not known: the box round its points, but for stray ones; down to
    the bottom where it is seen just above.
    """
    low, high = np.percentile(xyz, [0.2, 99.8], axis=0)
    flat = np.any(where, axis=2)
    floor = level[flat].min()
    low[2] = floor if low[2] - floor < 2 * STACK_M else low[2]
    part = np.count_nonzero(flat) / np.count_nonzero(bottom.in_plan)
    return Thing(
        "level surface" if part > LEVEL_SHARE else "box",
        tuple(low.tolist()),
        tuple(high.tolist()),
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        float(np.prod(high - low)),
        len(xyz),
    )


def _column(xyz, level, grid):
    """A `Thing` that is round in most of its slabs; None: it is not."""
    slab = np.floor((xyz[:, 2] - grid.low_m) / SLAB_M).astype(np.int64)
    fits = []
    used = [one for one in np.unique(slab) if np.count_nonzero(slab == one) >= FEWEST]
    for one in used:
        fit = _round(xyz[slab == one][:SLAB_POINTS, :2])
        if fit is not None:
            fits.append(fit)
    if len(fits) < max(SLABS, len(used) / 2):
        return None
    x, y, radius, rms = np.array(fits).T
    r = float(np.median(radius))
    scatter = float(SD_OVER_MEDIAN * np.median(np.abs(radius - r)))
    if scatter > max(BAND_M / 2, SAME * r):
        return None
    u = max(scatter, float(np.median(rms)) / 2, LEAST_U_M)
    middle = float(np.median(x)), float(np.median(y))
    low, high, u_tall = _ends(xyz, middle, level, grid)
    tall = high - low
    volume = float(np.pi * r**2 * tall)
    u_volume = float(np.hypot(2 * np.pi * r * u * tall, np.pi * r**2 * u_tall))
    corners = ((middle[0] + s * r, middle[1] + s * r, at) for s, at in ((-1, low), (1, high)))
    return Thing("column", *corners, r, u, volume, u_volume, volume, len(xyz))


def _ends(xyz, middle, level, grid):
    """Lower and upper end of a column and their u: it stands on the bottom and reaches the top
    where it is seen near them.
    """
    cell = ((np.array(middle) - grid.corner_m) / grid.cell_m).astype(np.int64)
    floor = float(level[tuple(np.clip(cell, 0, grid.across - 1))])
    low, high = (float(one) for one in np.percentile(xyz[:, 2], [0.2, 99.8]))
    low = floor if low - floor < SLAB_M else low
    high = grid.top_m if grid.top_m - high < SLAB_M + ROOF_M else high
    return low, high, STACK_M / np.sqrt(3)


def _round(xy):
    """x, y, radius and rms of the circle that most of the points of a slab lie on; None."""
    rng = np.random.default_rng(len(xy))
    best, chosen = 0, None
    for three in xy[rng.integers(len(xy), size=(TRIES, 3))]:
        a = 2 * (three[1:] - three[0])
        if abs(np.linalg.det(a)) < 1e-6:
            continue
        centre = np.linalg.solve(a, np.sum(three[1:] ** 2 - three[0] ** 2, axis=1))
        r = np.hypot(*(three[0] - centre))
        if THIN_M < r < THICK_M:
            on = np.abs(np.hypot(*(xy - centre).T) - r) < BAND_M
            if on.sum() > best:
                best, chosen = int(on.sum()), on
    if best < max(ROUND * len(xy), FEWEST / 2):
        return None
    try:
        circle = fit_circle(xy[chosen], scipy.sparse.eye_array(2 * best, format="csr"))
    except SolutionError:
        return None
    dx, dy = (xy[chosen] - (circle.x_m, circle.y_m)).T
    turns = np.sort(np.arctan2(dx, dy))
    arc = 2 * np.pi - np.diff(np.append(turns, turns[0] + 2 * np.pi)).max()
    if arc < ARC_RAD:
        return None
    return circle.x_m, circle.y_m, circle.radius_m, float(np.std(circle.residuals_m))
