"""Cells of a wall: histogram of the distances in each cell, for each scan, as integer sums.

Distances are counted in units of 1/256 of a bin, so that means do not depend on the width of a bin.
Integer sums are identical for any order and division of the points.
"""

from dataclasses import dataclass

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
    >>> from tankcal.clouds.wall.surfaces import CylinderSurface
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
