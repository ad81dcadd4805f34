"""Cells of a wall: for each scan and cell a histogram of the distances, in integers that add.

Distances are counted in units of a 256th of a bin, so that means know nothing of the bins' width,
and sums are the same to the last bit in whatever order and pieces the points come.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message

PIECE = 1 << 15  # points at a time: their arrays stay in the cache
FINE_BITS = 8  # a bin is 2**8 units wide
FINE = 1 << FINE_BITS
COUNT = 1 << 32  # in one int64: the count above, the sum of units within the bin below
MOST_IN_BIN = 1 << 24  # beyond, the sum of units would run into the count
PLACE = 1 << 16  # parts of a cell that places in it are counted in
FAR_M, FAR_BINS = 1.2, 48  # what stands before and behind the wall: reach and number of bins
GRID_LIMIT = 1 << 20  # places of the table that looks rows up; beyond, by bisection
SUMMED = ("sums", "turn", "along", "far", "delivered", "outside", "beyond")


@dataclass(frozen=True)
class CellGrid:
    """Rows and columns of cells, and the bins of their distances.

    Attributes
    ----------
    edges_m : ndarray, shape (rows + 1,)
        u between the rows, ascending; a row holds its lower edge, the last one also its upper, m.
    columns : int
        Cells round a row; the first begins at turn 0.
    band_m : float
        Distances up to this, inwards and outwards, are told apart, m.
    bins : int
        Over the whole band.
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
    def unit_m(self):
        """The unit that distances are counted in, m."""
        return 2 * self.band_m / self.bins / FINE

    @property
    def bin_m(self):
        """Width of a bin, m."""
        return 2 * self.band_m / self.bins

    def bytes_of(self, scans):
        """Memory that so many scans need in these cells."""
        cells = self.rows * self.columns
        return cells * (scans * (self.bins + 2) * 8 + FAR_BINS * 4)


class WallCells:
    """Sums over the points of some scans in the cells of a grid.

    Parameters
    ----------
    surface : CylinderSurface or SphereSurface
        What the cells lie about.
    grid : CellGrid
    scans : int
        Number of scans.

    Attributes
    ----------
    sums : ndarray of int64, shape (scans, rows * columns, bins)
        Count times 2**32, plus the sum of the units within the bin.
    turn, along : ndarray of int64, shape (scans, rows * columns)
        Sums of the places within the cell, in 2**16th of its width and height.
    far : ndarray of uint32, shape (rows * columns, FAR_BINS)
        Counts within FAR_M of the surface, of all scans.
    delivered, outside, beyond : ndarray of int64, shape (scans,)
        Points that came; above, below or over FAR_M off; within FAR_M, but not in the band.

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

    def packed(self):
        """{name: places and values of what is not 0}: a piece of a file fills few of the bins."""
        found = {}
        for name in SUMMED:
            flat = getattr(self, name).ravel()
            places = np.flatnonzero(flat)
            found[name] = (
                places.astype(np.uint32 if len(flat) <= 1 << 32 else np.int64),
                flat[places],
            )
        return found

    def add_packed(self, packed):
        """Add what `packed` gave of the sums of other points: same surface, grid and scans."""
        for name, (places, values) in packed.items():
            getattr(self, name).reshape(-1)[places] += values

    def merged(self, other):
        """The sums of the points of both: same surface, grid and scans."""
        both = WallCells(self.surface, self.grid, self.scans)
        for name in SUMMED:
            np.add(getattr(self, name), getattr(other, name), out=getattr(both, name))
        return both

    __add__ = merged

    def counts(self, scan):
        """(rows, columns, bins) points of one scan."""
        self._check_counts(scan)
        return (self.sums[scan] >> 32).reshape(self.grid.rows, self.grid.columns, -1)

    def units(self, scan):
        """(rows, columns, bins) sums of units within each bin, of one scan."""
        return (self.sums[scan] & (COUNT - 1)).reshape(self.grid.rows, self.grid.columns, -1)

    def _add(self, xyz_m, scan):
        grid = self.grid
        u, turn, distance = self.surface.places(xyz_m)
        inside = (u >= grid.edges_m[0]) & (u <= grid.edges_m[-1]) & (np.abs(distance) < FAR_M)
        if not inside.all():
            self.outside[scan] += len(u) - np.count_nonzero(inside)
            u, turn, distance = u[inside], turn[inside], distance[inside]
        row = self._row_of(u)
        around = turn * (grid.columns / FULL_TURN)
        column = np.minimum(around.astype(np.int64), grid.columns - 1)
        cell = row * grid.columns + column
        near = np.abs(distance) < grid.band_m
        away = ~near
        if away.any():
            self.beyond[scan] += np.count_nonzero(away)
            bins = ((distance[away] + FAR_M) * (FAR_BINS / (2 * FAR_M))).astype(np.int64)
            np.add.at(self.far.ravel(), cell[away] * FAR_BINS + bins, np.uint32(1))
            u, around, distance = u[near], around[near], distance[near]
            row, column, cell = row[near], column[near], cell[near]
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
    """A function from u between the first and the last edge to the index of its row.

    A table over an even grid, two places or more in the narrowest row, is off by one at most.
    """
    last, span = len(edges) - 2, edges[-1] - edges[0]
    narrowest = np.diff(edges).min()
    if 2.5 * span > GRID_LIMIT * narrowest:
        return lambda u: np.minimum(np.searchsorted(edges, u, side="right") - 1, last)
    places = np.ceil(2.5 * span / narrowest)
    grid = edges[0] + np.arange(int(places) + 1) / places * span
    table = np.clip(np.searchsorted(edges, grid, side="right") - 1, 0, last)
    lower, upper = edges[:-1].copy(), edges[1:].copy()
    upper[-1] = np.inf

    def row_of(u):
        row = table.take(((u - edges[0]) / span * places).astype(np.int64))
        row += u >= upper.take(row)
        row -= u < lower.take(row)
        return row

    return row_of
