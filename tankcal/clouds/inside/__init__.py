"""Scans from inside the tank: points of the bottom, and objects that may be deadwood.

Objects in a tank, proposed as deadwood; a person must confirm each of them.

Occupied cells above the bottom that connect form an object. An object over most of the height is
compared with a circle at each level. A round column has a volume. For other objects the result is
the box around the points; faces that no scan has seen may lie outside this box.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from tankcal.adjust import SD_OVER_MEDIAN
from tankcal.clouds.inside.bottom import (
    STACK_M,
    BottomPoints,
    CloudBottom,
    bottom_points,
    extend_level,
    find_cloud_bottom,
)
from tankcal.clouds.wall.passes import Passes, PointSample
from tankcal.errors import SolutionError
from tankcal.geometry.circles import fit_circle

__all__ = [
    "BottomPoints",
    "CloudBottom",
    "Thing",
    "bottom_points",
    "find_cloud_bottom",
    "find_things",
]


# ---- objects in a tank

LEAST_POINTS, LEAST_CELLS = 3, 3  # least points of an occupied cell; least cells of an object
CLEAR_M, ROOF_M, WALL_M = 0.05, 0.2, 0.2  # least distance from bottom, top of the shell and wall, m
STANDING, WIDEST_CELLS = 0.5, 6  # least share of the height, largest width in cells, of a column
# Points sampled of an object; height of a slab, m; points used and least points of a slab
SAMPLE, SLAB_M, SLAB_POINTS, FEWEST = 40_000, 0.5, 600, 30
# Random circles through three points; tolerance of a point, least and largest radius, m
TRIES, BAND_M, THIN_M, THICK_M = 150, 0.006, 0.015, 1.0
# Least share of the points of a slab on the circle; least arc; least number of round slabs; largest
# scatter of their radii as a share of the radius
ROUND, ARC_RAD, SLABS, SAME = 0.6, 1.5, 4, 0.03
LEAST_U_M = 0.0005  # least standard uncertainty of the radius of a column, m
LEVEL_SHARE = 0.2  # share of the plan above which an object is a roof or liquid, not deadwood


@dataclass(frozen=True)
class Thing:
    """Object in the tank, apart from its wall.

    Attributes
    ----------
    kind : str
        "column" (round), "box" (anything else) or "level surface" (over a large part of the plan).
    low_m, high_m : tuple of float, (3,)
        Corners of the box around the points, or around the cylinder of a column, in the frame of
        the points, m.
    radius_m, u_radius_m : float
        Radius of a column and its standard uncertainty, m; nan for other objects.
    volume_m3, u_volume_m3 : float
        Volume of a column and its standard uncertainty, m3; nan for other objects.
    box_m3 : float
        Volume of the box (of a column: of the cylinder), m3. It bounds the visible part; faces that
        no scan has seen may lie outside the box.
    points : int
        Number of points from which the object was found.
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
        """Row of deadwood: name, heights of bottom and top (m), volume (negative) and its u (m3).

        Volume and u are nan if the points do not determine them; the volume must be measured.
        """
        x, y = (np.add(self.low_m, self.high_m) / 2)[:2]
        name = f"{self.kind} {x:.2f} {y:.2f}"
        return name, self.low_m[2], self.high_m[2], -self.volume_m3, self.u_volume_m3


@dataclass(frozen=True)
class ThingCells:
    """Assignment of cells to objects.

    Attributes
    ----------
    grid : FloorGrid
        Cells of the plan.
    label : ndarray of int, shape (across, across, levels)
        Number of the object in each cell and level; 0 for none.
    clear_m : ndarray, shape (across, across)
        Height below which a point belongs to the bottom, m.
    from_inside : sequence of bool
        Whether each scan was made from inside.
    """

    grid: object
    label: np.ndarray
    clear_m: np.ndarray
    from_inside: tuple

    @property
    def count(self):
        """Number of objects."""
        return int(self.label.max(initial=0))


class ThingSamples:
    """One `PointSample` for each of `count` objects."""

    def __init__(self, count):
        self.samples = [PointSample(SAMPLE) for _ in range(count)]

    def merge(self, other):
        """Return the samples of both sets of points."""
        both = ThingSamples(0)
        pairs = zip(self.samples, other.samples, strict=True)
        both.samples = [sample.merge(other_sample) for sample, other_sample in pairs]
        for sample in both.samples:
            sample.reduce()
        return both


def sample_things(points, cells):
    """Sample the points of each object of `ThingCells` from an iterator of (scan, points)."""
    samples, label = ThingSamples(cells.count), cells.label
    for scan, xyz in points:
        if not cells.from_inside[scan]:
            continue
        # Indices (n, 3) of points: cell along x, cell along y, and level.
        plan = np.floor((xyz[:, :2] - cells.grid.corner_m) / cells.grid.cell_m)
        up = np.floor((xyz[:, 2] - cells.grid.low_m) / STACK_M)
        cell_index = np.column_stack([plan, up]).astype(np.int64)
        in_grid = np.all((cell_index >= 0) & (cell_index < label.shape), axis=1)
        xyz, cell_index = xyz[in_grid], cell_index[in_grid]
        thing_of_point = label[tuple(cell_index.T)]
        thing_of_point[xyz[:, 2] < cells.clear_m[cell_index[:, 0], cell_index[:, 1]]] = 0
        for number in np.unique(thing_of_point[thing_of_point > 0]):
            samples.samples[number - 1].add(xyz[thing_of_point == number], scan)
    return samples


def find_things(passes, bottom, sides=None):
    """Find the objects in a tank, apart from its wall.

    Parameters
    ----------
    passes : callable or Passes
        As for `find_cloud_wall`; all points are read once more.
    bottom : CloudBottom
        Bottom of the tank.
    sides : sequence of str, optional
        As for `find_cloud_bottom`.

    Returns
    -------
    tuple of Thing
        The tallest object first.
    """
    grid = bottom.grid
    level = extend_level(bottom.xyz_m[..., 2], bottom.is_bottom)
    label, standing = _label_objects(bottom, level)
    inside = tuple(number != "outside" for number in sides or ["inside"] * bottom.cells.scans)
    passes = Passes(passes) if callable(passes) else passes
    cells = ThingCells(grid, label, level + CLEAR_M, inside)
    if not cells.count:
        return ()
    things = []
    for number, sample in enumerate(passes.gather(sample_things, cells).samples, start=1):
        xyz = sample.points()
        if len(xyz) >= FEWEST:
            column = _fit_column(xyz, level, grid) if number <= standing else None
            things.append(column or _make_box(xyz, label == number, level, bottom))
    return tuple(sorted(things, key=lambda thing: thing.low_m[2] - thing.high_m[2]))


def _label_objects(bottom, level):
    """Number the objects in cells and levels.

    Returns
    -------
    label : ndarray of int, shape (across, across, levels)
        Number of the object, 0 for none. Objects over most of the height have the first numbers.
    standing : int
        Number of objects over most of the height.
    """
    grid = bottom.grid
    shape = grid.across, grid.across, grid.levels
    # Only cells clear of bottom, roof and wall can belong to an object.
    edge = grid.low_m + np.arange(grid.levels) * STACK_M
    is_free = (edge > (level + CLEAR_M)[..., None]) & (edge < grid.top_m - ROOF_M - STACK_M)
    is_free &= (grid.distance_m < grid.surface.radius_m - WALL_M)[..., None]
    occupied = is_free & (bottom.cells.stack.reshape(shape) >= LEAST_POINTS)
    tall = occupied.sum(axis=2) > STANDING * is_free.sum(axis=2).max(initial=1)
    # A column includes the cells around it, which may show its edges.
    upright, standing = scipy.ndimage.label(tall, np.ones((3, 3)))
    label = np.zeros(shape, dtype=np.int64)
    for column, where in enumerate(scipy.ndimage.find_objects(upright), start=1):
        if max(part.stop - part.start for part in where) > WIDEST_CELLS:
            continue
        near = scipy.ndimage.binary_dilation(upright == column, np.ones((3, 3)))
        label[near[..., None] & is_free & (label == 0)] = column
    # The remaining occupied cells form objects by connection in three dimensions.
    parts, count = scipy.ndimage.label(occupied & (label == 0), np.ones((3, 3, 3)))
    sizes = np.bincount(parts.ravel(), minlength=count + 1)
    large = np.flatnonzero(sizes[1:] >= LEAST_CELLS) + 1
    number = np.zeros(count + 1, dtype=np.int64)
    number[large] = standing + 1 + np.arange(len(large))
    return label + number[parts], standing


def _make_box(xyz, where, level, bottom):
    """Create a `Thing` of unknown volume: the box around its points, without stray points.

    The box extends to the bottom if the lowest points lie just above the bottom.
    """
    low, high = np.percentile(xyz, [0.2, 99.8], axis=0)
    flat = np.any(where, axis=2)
    floor = level[flat].min()
    low[2] = floor if low[2] - floor < 2 * STACK_M else low[2]
    share = np.count_nonzero(flat) / np.count_nonzero(bottom.in_plan)
    return Thing(
        "level surface" if share > LEVEL_SHARE else "box",
        tuple(low.tolist()),
        tuple(high.tolist()),
        np.nan,
        np.nan,
        np.nan,
        np.nan,
        float(np.prod(high - low)),
        len(xyz),
    )


def _fit_column(xyz, level, grid):
    """Create a `Thing` that is round in most of its slabs, or return None."""
    slab = np.floor((xyz[:, 2] - grid.low_m) / SLAB_M).astype(np.int64)
    fits = []
    used = [
        slab_number
        for slab_number in np.unique(slab)
        if np.count_nonzero(slab == slab_number) >= FEWEST
    ]
    for slab_number in used:
        fit = _fit_round_slab(xyz[slab == slab_number][:SLAB_POINTS, :2])
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
    low, high, u_tall = _find_ends(xyz, middle, level, grid)
    tall = high - low
    # V = pi r^2 h; propagation of u(r) and u(h)
    volume = float(np.pi * r**2 * tall)
    u_volume = float(np.hypot(2 * np.pi * r * u * tall, np.pi * r**2 * u_tall))
    corners = ((middle[0] + s * r, middle[1] + s * r, at) for s, at in ((-1, low), (1, high)))
    return Thing("column", *corners, r, u, volume, u_volume, volume, len(xyz))


def _find_ends(xyz, middle, level, grid):
    """Heights of the lower and upper end of a column and the standard uncertainty of its length, m.

    An end near the bottom or the top of the shell is taken to reach it.
    """
    cell = ((np.array(middle) - grid.corner_m) / grid.cell_m).astype(np.int64)
    floor = float(level[tuple(np.clip(cell, 0, grid.across - 1))])
    low, high = (float(height) for height in np.percentile(xyz[:, 2], [0.2, 99.8]))
    low = floor if low - floor < SLAB_M else low
    high = grid.top_m if grid.top_m - high < SLAB_M + ROOF_M else high
    return low, high, STACK_M / np.sqrt(3)  # rectangular distribution of half-width STACK_M


def _fit_round_slab(xy):
    """Fit a circle to the points (n, 2) of a slab, first by consensus, then by least squares.

    Returns x, y, radius and standard deviation of the residuals (m), or None if too few points lie
    on a circle or their arc is too short.
    """
    rng = np.random.default_rng(len(xy))
    best, chosen = 0, None
    for three in xy[rng.integers(len(xy), size=(TRIES, 3))]:
        # |p - c|^2 = r^2 for three points; differences give linear equations for the centre c.
        a = 2 * (three[1:] - three[0])
        if abs(np.linalg.det(a)) < 1e-6:
            continue
        centre = np.linalg.solve(a, np.sum(three[1:] ** 2 - three[0] ** 2, axis=1))
        r = np.hypot(*(three[0] - centre))
        if THIN_M < r < THICK_M:
            is_on_circle = np.abs(np.hypot(*(xy - centre).T) - r) < BAND_M
            if is_on_circle.sum() > best:
                best, chosen = int(is_on_circle.sum()), is_on_circle
    if best < max(ROUND * len(xy), FEWEST / 2):
        return None
    try:
        circle = fit_circle(xy[chosen], np.ones(2 * best))
    except SolutionError:
        return None
    # The arc is the full turn less the largest gap between azimuths.
    dx, dy = (xy[chosen] - (circle.x_m, circle.y_m)).T
    azimuths = np.sort(np.arctan2(dx, dy))
    arc = 2 * np.pi - np.diff(np.append(azimuths, azimuths[0] + 2 * np.pi)).max()
    if arc < ARC_RAD:
        return None
    return circle.x_m, circle.y_m, circle.radius_m, float(np.std(circle.residuals_m))
