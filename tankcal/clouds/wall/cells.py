"""Cells of a wall: histograms of the distances in each cell, and their reduction to readings.

A histogram for each cell and scan contains integer sums, which are identical for any order and
division of the points. Distances are counted in units of 1/256 of a bin, so that means do not
depend on the width of a bin.

No beam passes a wall. Points behind a surface, over more than the area of nozzles and manholes,
show that the surface is a screen, or a circle between screen and wall. For a scan from inside,
behind means outwards of the surface; for a scan from outside, inwards. The wall is then searched
among the rearmost distances of coarse cells.

A reading is the mean of the cells of one scan in a sector of a few rows; a limited number of
readings is evenly spread. The standard deviation of a reading is that of a single cell and does not
decrease with the number of cells or points. Neighbouring cells share errors (mixed pixels, noise
along a scan line), which do not average out.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.units import FULL_TURN

PIECE = 1 << 15  # points added at a time, so that their arrays fit into the processor cache
FINE_BITS = 8  # a bin is 2**8 units wide
FINE = 1 << FINE_BITS  # units in a bin
COUNT = 1 << 32  # one int64 has the count in its upper half, the sum of units in its lower half
MOST_IN_BIN = 1 << 24  # with more points the sum of units could overflow into the count
PLACE = 1 << 16  # units of a position within a cell, per width or height of the cell
FAR_M, FAR_BINS = 1.2, 48  # range on both sides of the wall for obstructions, m; number of bins
GRID_LIMIT = 1 << 20  # largest size of the table of rows; above it, rows are found by bisection
SUMMED = ("sums", "turn", "along", "far", "delivered", "outside", "beyond")
FILE = "clouds.toml"
LEVELS, FEWEST_LEVELS, AROUND = 24, 6, 3  # most and fewest rows of coarse cells; columns per row
POINTS_OF_CELL = 20  # points of a coarse cell, for points spread evenly over the wall
REACH_M, BIN_M = 2.0, 0.05  # range of the distances on both sides; width of a bin, m
BAND_M = 0.12  # distance from a surface within which points belong to it, m: buckles and noise
LEAST_SHARE, FEWEST = 0.15, 3  # least share and number of the points of a cell in an occupied bin
REAR_SHARE = 0.05  # share of the cells with points behind that nozzles and manholes do not reach
LEAST_WALL_SHARE = 0.5  # share of the cells below which wall and screen cannot be distinguished
# Share of the cells on the surface above which no screen is searched; least gain of another fit
CLEAR_SHARE, BETTER_SHARE = 0.95, 0.02
STEP_M = 0.11  # largest step between neighbouring cells of a surface, m; a screen has a larger one
LEAVING_SHARE = 0.4  # share of the rows in which a wall does not leave the band without a step
# Band of the first fit, as a share of the radius, plus m; narrower than BAND_M in small tanks
BAND_OF_RADIUS, LEAST_BAND_M = 0.01, 0.02
PENALTY = 2  # weight of a cell behind the surface, relative to a cell on the surface
# Random samples of five cells; if half of the cells are wall, about 30 samples contain only wall
SAMPLES, REFITS = 1000, 5


@dataclass(frozen=True)
class CellGrid:
    """Rows and columns of cells, and the bins of their distances.

    Attributes
    ----------
    edges_m : ndarray, shape (rows + 1,)
        Coordinate u of the edges of the rows, ascending, m. A row contains its lower edge; the last
        row also contains its upper edge.
    columns : int
        Number of cells around a row; the first begins at azimuth 0.
    band_m : float
        Half-width of the band of distances, inwards and outwards, m.
    bins : int
        Number of bins over the whole band.
    """

    edges_m: np.ndarray
    columns: int
    band_m: float = 0.1
    bins: int = 50

    @property
    def rows(self):
        """Number of rows."""
        return len(self.edges_m) - 1

    @property
    def middles_m(self):
        """Coordinate u of the centres of the rows, m."""
        return (self.edges_m[:-1] + self.edges_m[1:]) / 2

    @property
    def unit_m(self):
        """Unit of the sums of distances, m."""
        return 2 * self.band_m / self.bins / FINE

    @property
    def bin_m(self):
        """Width of a bin, m."""
        return 2 * self.band_m / self.bins

    def count_bytes(self, scans):
        """Memory of the sums of `scans` scans, bytes."""
        cells = self.rows * self.columns
        return cells * (scans * (self.bins + 2) * 8 + FAR_BINS * 4)


class WallCells:
    """Sums over the points of some scans in the cells of a grid.

    Parameters
    ----------
    surface : CylinderSurface or SphereSurface
        Approximate surface of the wall, from which distances are measured.
    grid : CellGrid
    scans : int
        Number of scans.

    Attributes
    ----------
    sums : ndarray of int64, shape (scans, rows * columns, bins)
        Count times 2**32, plus the sum of the units within the bin.
    turn, along : ndarray of int64, shape (scans, rows * columns)
        Sums of the positions within the cell, in 1/2**16 of its width and height.
    far : ndarray of uint32, shape (rows * columns, FAR_BINS)
        Counts outside the band, within FAR_M of the surface, of all scans together.
    delivered, outside, beyond : ndarray of int64, shape (scans,)
        Number of points received; above, below or more than FAR_M from the surface; within FAR_M,
        but outside the band.

    Examples
    --------
    >>> from tankcal.clouds.wall.start import CylinderSurface
    >>> surface = CylinderSurface(np.zeros(3), 5.0)
    >>> grid = CellGrid(np.array([0.0, 1.0, 2.0]), 4)
    >>> cells = WallCells(surface, grid, 1)
    >>> cells.add(np.array([[3.0, 4.003, 0.5], [3.0, 4.003, 0.6], [5.0, 5.0, 0.5]]), 0)
    >>> cells.counts(0)[0].sum(axis=1), cells.outside
    (array([2, 0, 0, 0]), array([1]))
    """

    def __init__(self, surface, grid, scans):
        self.surface, self.grid, self.scans = surface, grid, scans
        cells = grid.rows * grid.columns
        self.sums = np.zeros((scans, cells, grid.bins), dtype=np.int64)
        self.turn = np.zeros((scans, cells), dtype=np.int64)
        self.along = np.zeros((scans, cells), dtype=np.int64)
        self.far = np.zeros((cells, FAR_BINS), dtype=np.uint32)
        self.delivered, self.outside, self.beyond = np.zeros((3, scans), dtype=np.int64)
        self._row_of = _row_finder(grid.edges_m)
        self._heights = np.diff(grid.edges_m)

    def add(self, xyz_m, scan):
        """Add points (n, 3) of one scan."""
        self.delivered[scan] += len(xyz_m)
        for start in range(0, len(xyz_m), PIECE):
            self._add(xyz_m[start : start + PIECE], scan)

    def pack_sums(self):
        """Sums in sparse form, {name: (indices, values)}; a piece of a file fills few bins."""
        packed = {}
        for name in SUMMED:
            flat = getattr(self, name).ravel()
            indices = np.flatnonzero(flat)
            packed[name] = (
                indices.astype(np.uint32 if len(flat) <= 1 << 32 else np.int64),
                flat[indices],
            )
        return packed

    def add_packed(self, packed):
        """Add sums in the form of `pack_sums`, of the same surface, grid and number of scans."""
        for name, (indices, values) in packed.items():
            getattr(self, name).reshape(-1)[indices] += values

    def merge(self, other):
        """Return the sums of both sets of points, of the same surface, grid and number of scans."""
        both = WallCells(self.surface, self.grid, self.scans)
        for name in SUMMED:
            np.add(getattr(self, name), getattr(other, name), out=getattr(both, name))
        return both

    __add__ = merge

    def counts(self, scan):
        """Number of points of one scan in each bin, shape (rows, columns, bins)."""
        self._check_counts(scan)
        return (self.sums[scan] >> 32).reshape(self.grid.rows, self.grid.columns, -1)

    def units(self, scan):
        """Sum of units of one scan within each bin, shape (rows, columns, bins)."""
        return (self.sums[scan] & (COUNT - 1)).reshape(self.grid.rows, self.grid.columns, -1)

    def _add(self, xyz_m, scan):
        grid = self.grid
        u, turn, distance = self.surface.places(xyz_m)
        inside = (u >= grid.edges_m[0]) & (u <= grid.edges_m[-1]) & (np.abs(distance) < FAR_M)
        if not inside.all():
            self.outside[scan] += len(u) - np.count_nonzero(inside)
            u, turn, distance = u[inside], turn[inside], distance[inside]
        row = self._row_of(u)
        around = turn * (grid.columns / FULL_TURN)  # azimuth in widths of a cell
        column = np.minimum(around.astype(np.int64), grid.columns - 1)
        cell = row * grid.columns + column
        # Points outside the band are only counted, to show obstructions.
        near = np.abs(distance) < grid.band_m
        is_far = ~near
        if is_far.any():
            self.beyond[scan] += np.count_nonzero(is_far)
            bins = ((distance[is_far] + FAR_M) * (FAR_BINS / (2 * FAR_M))).astype(np.int64)
            np.add.at(self.far.ravel(), cell[is_far] * FAR_BINS + bins, np.uint32(1))
            u, around, distance = u[near], around[near], distance[near]
            row, column, cell = row[near], column[near], cell[near]
        # One addition adds both the count (upper half) and the units (lower half).
        fine = ((distance + grid.band_m) / grid.unit_m).astype(np.int64)
        np.clip(fine, 0, grid.bins * FINE - 1, out=fine)
        np.add.at(
            self.sums[scan].ravel(),
            cell * grid.bins + (fine >> FINE_BITS),
            COUNT + (fine & (FINE - 1)),
        )
        within = (u - grid.edges_m[row]) * (PLACE / self._heights[row])
        np.add.at(self.turn[scan], cell, ((around - column) * PLACE).astype(np.int64))
        np.add.at(self.along[scan], cell, within.astype(np.int64))

    def _check_counts(self, scan):
        most = int(self.sums[scan].max(initial=0) >> 32)
        if most >= MOST_IN_BIN:
            text = message(
                "cloud_too_dense",
                "found {count} points of scan {scan} in one cell of the wall; expected fewer than "
                "{most}: thin the cloud",
                count=most,
                scan=scan + 1,
                most=MOST_IN_BIN,
            )
            raise InputError(Problem("clouds.toml", text))


def _row_finder(edges):
    """Create a function that returns the index of the row of u, between first and last edge.

    A table over an even grid, with two or more entries in the narrowest row, is wrong by at most
    one row; two comparisons correct it.
    """
    last, span = len(edges) - 2, edges[-1] - edges[0]
    narrowest = np.diff(edges).min()
    if 2.5 * span > GRID_LIMIT * narrowest:
        return lambda u: np.minimum(np.searchsorted(edges, u, side="right") - 1, last)
    entries = np.ceil(2.5 * span / narrowest)
    grid = edges[0] + np.arange(int(entries) + 1) / entries * span
    table = np.clip(np.searchsorted(edges, grid, side="right") - 1, 0, last)
    lower, upper = edges[:-1].copy(), edges[1:].copy()
    upper[-1] = np.inf

    def row_of(u):
        row = table.take(((u - edges[0]) / span * entries).astype(np.int64))
        row += u >= upper.take(row)
        row -= u < lower.take(row)
        return row

    return row_of


# ---- distinction of the wall from a screen that hides a part of it


class CoarseCells:
    """Distances from a surface in coarse cells of a sample.

    Parameters
    ----------
    surface : CylinderSurface or SphereSurface
        Surface to test.
    xyz_m : ndarray, shape (n, 3)
        Points seen from one side, m.
    outwards : ndarray of int, shape (n,)
        1 for points seen from inside, -1 for points seen from outside.
    ends_m : tuple of float
        Coordinate u of the ends of the shell, m.

    Attributes
    ----------
    seen, levels : int
        Number of cells with points, and number of rows of cells.
    rear_share, wall_share : float
        Share of the cells with points behind the surface, and on the surface.
    leaving_share : float
        Share of the rows in which one surface continues from the band of the wall beyond the band.
    cell : ndarray of int, shape (cells,)
        Index of each cell of `distance_m`.
    distance_m : ndarray, shape (cells,)
        Rearmost distance in each cell, positive outwards of the surface, m.
    """

    def __init__(self, surface, xyz_m, outwards, ends_m):
        u, turn, distance = surface.places(xyz_m)
        self.xyz_m, self.outwards, self.ends_m = xyz_m, outwards, ends_m
        self.u, self.turn, self.distance = u, turn, distance
        self.radius_m = surface.radius_m
        in_reach = (u > ends_m[0]) & (u < ends_m[1]) & (np.abs(distance) < REACH_M)
        levels = int(np.sqrt(np.count_nonzero(in_reach) / POINTS_OF_CELL / AROUND))
        levels = self.levels = min(max(levels, FEWEST_LEVELS), LEVELS)
        around = AROUND * levels
        row = ((u[in_reach] - ends_m[0]) / (ends_m[1] - ends_m[0]) * levels).astype(np.int64)
        column = (turn[in_reach] * (around / FULL_TURN)).astype(np.int64) % around
        bins = int(2 * REACH_M / BIN_M)
        rearwards = distance[in_reach] * outwards[in_reach]
        level = ((rearwards + REACH_M) / BIN_M).astype(np.int64).clip(0, bins - 1)
        cell = np.minimum(row, levels - 1) * around + column
        count = np.bincount(cell * bins + level, minlength=around * levels * bins)
        count = count.reshape(-1, bins)
        total = count.sum(axis=1, keepdims=True)
        # A surface may lie on the edge of two bins; their counts are therefore added.
        wide = count + np.pad(count, ((0, 0), (0, 1)))[:, 1:]
        occupied = (wide >= np.maximum(LEAST_SHARE * total, FEWEST)) & (count > 0)
        middle = (np.arange(bins) + 0.5) * BIN_M - REACH_M
        has_points = occupied.any(axis=1)
        self.seen = max(int(np.count_nonzero(has_points)), 1)
        rear = middle > BAND_M + BIN_M
        behind = occupied[:, rear].any(axis=1)
        self.rear_share = np.count_nonzero(behind) / self.seen
        self.wall_share = (
            np.count_nonzero(occupied[:, np.abs(middle) < BAND_M].any(axis=1)) / self.seen
        )
        self.cell = np.flatnonzero(has_points)
        rearmost = bins - 1 - occupied[has_points][:, ::-1].argmax(axis=1)
        self.side = 1 if np.mean(outwards) > 0 else -1
        self.distance_m = self.side * middle[rearmost]
        self.leaving_share = self._leaving_share()

    @property
    def is_clear(self):
        """Whether few cells have points behind the surface and few rows leave its band."""
        return self.rear_share < REAR_SHARE and self.leaving_share < LEAVING_SHARE

    def _leaving_share(self):
        """Share of the rows in which one surface continues from the band beyond the band."""
        rows = np.full(AROUND * self.levels**2, np.nan)
        rows[self.cell] = self.distance_m
        rows = rows.reshape(self.levels, -1)
        after = np.roll(rows, -1, axis=1)
        crosses = (np.abs(rows) < BAND_M) != (np.abs(after) < BAND_M)
        return float(np.mean(np.any(crosses & (np.abs(after - rows) < STEP_M), axis=1)))

    def find_near_rear(self):
        """Whether each point (n,) is near the cylinder that fits most rearmost distances."""
        row, column = np.divmod(self.cell, AROUND * self.levels)
        turn = (column + 0.5) * (FULL_TURN / (AROUND * self.levels))
        design = _design(turn, (row + 0.5) / self.levels)
        band_m = min(BAND_OF_RADIUS * self.radius_m + LEAST_BAND_M, BAND_M)
        model = _fit_consensus(design, self.distance_m, self.side, band_m)
        height = (self.u - self.ends_m[0]) / (self.ends_m[1] - self.ends_m[0])
        deviation = self.distance - _design(self.turn, height) @ model
        return (height > 0) & (height < 1) & (np.abs(deviation) < BAND_M)


def _design(turn, height):
    """Derivatives (n, 5) of the distance by radius, shift (2) and inclination (2) of a cylinder."""
    sine, cosine = np.sin(turn), np.cos(turn)
    h = height - 0.5
    return np.column_stack([np.ones(len(turn)), sine, cosine, h * sine, h * cosine])


def _fit_consensus(design, distance_m, side, band_m):
    """Fit a cylinder to many of the distances, with few of them behind it.

    Returns the changes (5,) of radius, shift (2) and inclination (2), m.
    """
    rng = np.random.default_rng(20_11)
    five = rng.integers(len(distance_m), size=(SAMPLES, 5))
    is_regular = np.abs(np.linalg.det(design[five])) > 1e-3
    models = np.linalg.solve(design[five][is_regular], distance_m[five][is_regular][..., None])[
        ..., 0
    ]
    if not len(models):
        return np.zeros(design.shape[1])
    deviation = side * (distance_m - models @ design.T)
    # A circle between screen and wall is near many cells of both, but has the wall behind it.
    support = np.count_nonzero(np.abs(deviation) < band_m, axis=1)
    support -= PENALTY * np.count_nonzero(deviation >= band_m, axis=1)
    chosen = np.abs(deviation[np.argmax(support)]) < band_m
    for _ in range(REFITS):
        model = np.linalg.lstsq(design[chosen], distance_m[chosen])[0]
        chosen = np.abs(design @ model - distance_m) < band_m
    return model


def two_surfaces_error(first_m, first, second_m, second):
    """Create the InputError for two surfaces, from their radii (m) and shares of the cells."""
    text = message(
        "cloud_two_surfaces",
        "found two surfaces where one was expected: {first_m:.3f} m in {first:.0f} % of the cells "
        "and {second_m:.3f} m in {second:.0f} %: insulation, a double wall, or scans of both sides "
        "told as one (side)",
        first_m=first_m,
        first=100 * first,
        second_m=second_m,
        second=100 * second,
    )
    return InputError(Problem(FILE, text))


def hidden_wall_error(cells):
    """Create the InputError for a wall that cannot be distinguished from a screen."""
    low, high = np.percentile(cells.distance_m, [5, 95])
    text = message(
        "cloud_wall_hidden",
        "the points lie on surfaces up to about {apart_m:.1f} m apart, and the wall cannot be "
        "distinguished from a screen before it: expected scans that show more than half of the "
        "wall; leave the screen out with a box (leave_out), or scan behind it",
        apart_m=high - low,
    )
    return InputError(Problem(FILE, text))


LEVELS_OF_READINGS = 5  # levels of readings in a course
TALLEST = 0.1  # largest height of a level as a share of its course
ENOUGH_SECTORS = 24  # least number of sectors before several scans are kept at one position
LEVELS_OF_BODY = 24  # levels of readings of a lying cylinder or a sphere
MOST_CELLS = 20_000  # largest number of coarse cells: about 80 kB in a record
LEAST_SHOWN = 0.5  # smallest share of fine cells with wall in a coarse cell that is shown
TENTHS_PER_M = 1e4  # tenths of a millimetre per metre


@dataclass(frozen=True)
class CloudReadings:
    """Readings of the wall, each the mean of cells of one scan.

    Attributes
    ----------
    scan : ndarray of int, shape (n,)
        Scan of each reading.
    xyz_m : ndarray, shape (n, 3)
        Point at the mean radius, in the frame of the tank, m.
    sd_m : ndarray, shape (n,)
        Standard deviation of the radius, from errors independent between readings, m.
    course, level, sector : ndarray of int, shape (n,)
        Course, level and sector of each reading; levels count from the bottom of the shell.
    cells : ndarray of int, shape (n,)
        Number of cells in the mean.
    """

    scan: np.ndarray
    xyz_m: np.ndarray
    sd_m: np.ndarray
    course: np.ndarray
    level: np.ndarray
    sector: np.ndarray
    cells: np.ndarray


def readings_of(cloud_wall, most=1200):
    """Reduce a `CloudWall` to at most `most` readings (`CloudReadings`).

    Levels are spread evenly over each course. If `most` does not suffice for all scans at a
    position, the scans with the most cells at that position are kept.
    """
    level, course = _assign_levels(cloud_wall)
    columns, scans = cloud_wall.grid.columns, len(cloud_wall.sides)
    levels = level.max() + 1
    is_used = cloud_wall.is_wall & (level >= 0)[None, :, None]
    scan, row, column = np.nonzero(is_used)
    for ranked in range(scans, 0, -1):
        sectors = _most_sectors(scan, level[row], column, columns, levels, ranked, most)
        if sectors >= ENOUGH_SECTORS or ranked == 1:
            break
    group = _group_numbers(scan, level[row], column, columns, levels, sectors)
    groups, cells = _keep_largest(*np.unique(group, return_counts=True), levels * sectors, ranked)
    groups, cells = groups[:most], cells[:most]
    place = np.searchsorted(groups, group)
    in_reading = (place < len(groups)) & (groups[np.minimum(place, len(groups) - 1)] == group)
    return _mean_readings(
        cloud_wall,
        (scan[in_reading], row[in_reading], column[in_reading]),
        place[in_reading],
        groups,
        cells,
        level,
        course,
        sectors,
    )


def _assign_levels(cloud_wall):
    """Level of each row (rows,), -1 for none, and course of each level (levels,)."""
    middle, joints = cloud_wall.grid.middles_m, np.array(cloud_wall.joints_m)
    level, course = np.full(len(middle), -1), []
    count_per_course = (
        LEVELS_OF_READINGS
        if len(joints) > 2 or cloud_wall.grid.rows < LEVELS_OF_BODY
        else LEVELS_OF_BODY
    )
    tallest = TALLEST if count_per_course == LEVELS_OF_READINGS else 1 / count_per_course
    for course_number, (low, high) in enumerate(pairwise(joints)):
        rows = np.flatnonzero((middle > low) & (middle < high))
        height = (high - low) / len(rows)
        rows_of_level = max(1, int(tallest * (high - low) / height + 1e-9))
        count = min(count_per_course, len(rows) // rows_of_level)
        for k in range(count):
            begin = round((k + 0.5) * len(rows) / count - rows_of_level / 2)
            begin = min(max(begin, 0), len(rows) - rows_of_level)
            level[rows[begin : begin + rows_of_level]] = len(course)
            course.append(course_number)
    return level, np.array(course)


def _group_numbers(scan, level, column, columns, levels, sectors):
    """Number of the reading to which each cell belongs, unique for scan, level and sector."""
    return (scan * levels + level) * sectors + column * sectors // columns


def _keep_largest(groups, cells, places, ranked):
    """Keep at each position the `ranked` groups with the most cells; return groups and cells."""
    if not len(groups):
        return groups, cells
    order = np.lexsort((groups, -cells, groups % places))
    place = groups[order] % places
    first = np.flatnonzero(np.append(True, place[1:] != place[:-1]))
    rank = np.arange(len(order)) - np.repeat(first, np.diff(np.append(first, len(order))))
    chosen = np.sort(order[rank < ranked])
    return groups[chosen], cells[chosen]


def _most_sectors(scan, level, column, columns, levels, ranked, most):
    """Largest number of sectors, at least 3, that gives at most `most` readings, by bisection."""
    low, high = 3, columns
    while low < high:
        sectors = (low + high + 1) // 2
        groups = _group_numbers(scan, level, column, columns, levels, sectors)
        group_cells = np.unique(groups, return_counts=True)
        count = len(_keep_largest(*group_cells, levels * sectors, ranked)[0])
        low, high = (sectors, high) if count <= most else (low, sectors - 1)
    return low


def _mean_readings(wall, index, place, groups, cells, level, course, sectors):
    """Average the cells of each reading; `place` is the reading of each cell."""
    turn, along = wall.turn_rad[index], wall.along_m[index]
    distance = wall.radius_m[index] - wall.surface.radius_m
    places, levels = len(groups), len(course)

    def mean(values):
        return np.bincount(place, values, places) / cells

    first = np.full(places, 0.0)
    first[place] = turn  # azimuths relative to the first cell; no sector crosses azimuth 0
    u, azimuth = mean(along), first + mean(turn - first[place])
    scan, rest = np.divmod(groups, levels * sectors)
    row, sector = np.divmod(rest, sectors)
    return CloudReadings(
        scan=scan,
        xyz_m=wall.surface.points(u, azimuth, mean(distance)),
        sd_m=np.sqrt(mean(wall.sd_m[index] ** 2)),
        course=course[row],
        level=row,
        sector=sector,
        cells=cells,
    )


# ---- the wall of a cloud unrolled into coarse cells, small enough for a record and a web page


@dataclass(frozen=True)
class UnrolledWall:
    """Mean deviations of the wall in coarse cells.

    Attributes
    ----------
    height_edges_m : ndarray, shape (rows + 1,)
        Coordinate u of the edges of the rows, ascending, m.
    azimuth_edges_deg : ndarray, shape (columns + 1,)
        Azimuths of the edges of the columns, from 0 to 360, clockwise.
    departure_tenths_mm : ndarray of int, shape (rows, columns)
        Mean deviation outwards from the mean of the course, in tenths of a millimetre.
    is_shown : ndarray of bool, shape (rows, columns)
        Whether enough of the cell is wall; the deviation of other cells has no meaning.
    """

    height_edges_m: np.ndarray
    azimuth_edges_deg: np.ndarray
    departure_tenths_mm: np.ndarray
    is_shown: np.ndarray


def unroll_wall(cells, most=MOST_CELLS):
    """Average the cells of a wall over blocks that do not pass a joint between courses.

    Parameters
    ----------
    cells : CloudWall
        Wall in fine cells.
    most : int, optional
        Largest number of coarse cells.

    Returns
    -------
    UnrolledWall
    """
    grid = cells.grid
    course = np.searchsorted(np.array(cells.joints_m)[1:-1], grid.middles_m, side="right")
    departure_m = _average_scans(cells, course)
    is_wall = np.isfinite(departure_m)
    row_edges, column_edges = _block_edges(course, grid.columns, most)
    row = np.searchsorted(row_edges, np.arange(grid.rows), side="right") - 1
    column = np.searchsorted(column_edges, np.arange(grid.columns), side="right") - 1
    shape = len(row_edges) - 1, len(column_edges) - 1
    block = (row[:, None] * shape[1] + column).ravel()
    size = shape[0] * shape[1]
    count = np.bincount(block, minlength=size)
    wall_count = np.bincount(block, is_wall.ravel(), size)
    sums_m = np.bincount(block, np.nan_to_num(departure_m).ravel(), size)
    tenths = np.rint(TENTHS_PER_M * sums_m / np.maximum(wall_count, 1)).astype(int)
    return UnrolledWall(
        height_edges_m=grid.edges_m[row_edges],
        azimuth_edges_deg=column_edges * 360 / grid.columns,
        departure_tenths_mm=tenths.reshape(shape),
        is_shown=(wall_count >= LEAST_SHOWN * count).reshape(shape),
    )


def _average_scans(cells, course):
    """Mean deviation of the cells over the scans, m, shape (rows, columns); nan without wall.

    The deviation of a scan refers to the mean radius of its side of the plate in the course.
    """
    total, count = np.zeros((2, *cells.is_wall.shape[1:]))
    sides = np.array(cells.sides)
    for side in dict.fromkeys(cells.sides):
        radius_m = np.where(cells.is_wall, cells.radius_m, np.nan)[sides == side]
        for number in np.unique(course):
            part = radius_m[:, course == number]
            if np.isfinite(part).any():
                departure_m = part - np.nanmean(part)
                total[course == number] += np.nansum(departure_m, axis=0)
                count[course == number] += np.isfinite(departure_m).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _block_edges(course, columns, most):
    """Edges of the blocks along the rows and along the columns, as numbers of fine cells.

    A block has up to `side` rows and columns. `side` grows until at most `most` blocks remain.
    """
    rows_of_course = np.unique(course, return_counts=True)[1]
    side = 1
    while True:
        column_edges = _split_evenly(columns, side)
        row_edges = [0]
        for rows in rows_of_course.tolist():
            row_edges += (_split_evenly(rows, side)[1:] + row_edges[-1]).tolist()
        if (len(row_edges) - 1) * (len(column_edges) - 1) <= most or side > columns:
            return np.array(row_edges), column_edges
        side += 1


def _split_evenly(count, largest):
    """Edges of parts of up to `largest` cells, of nearly equal size."""
    parts = -(-count // largest)
    return np.arange(parts + 1) * count // parts
