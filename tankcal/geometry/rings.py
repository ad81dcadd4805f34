"""Millions of wall points into ring sections: a circle and azimuth cells for each ring.

One pass over the points, a chunk at a time, keeps sums only; memory does not grow with the points.
With u, v the offsets from an approximate axis at the point's own height over an approximate radius,
and w = u^2 + v^2 - 1, the circle of a ring follows from the means and covariances of u, v and w.
No job reads a cloud yet; benchmarks/rings.py holds the time and the memory.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.outlines import FULL_TURN

CHUNK = 1 << 15  # points at a time: their arrays stay in the cache
GRID_LIMIT = 1 << 20  # places of the table that looks rings up by height; beyond, by bisection
COARSEST_M = 1e-4  # the next float32 after a coordinate may lie this far off
LEAST_SPREAD = 1e-7  # of the points of a circle, to the largest: below, they lie on a line


@dataclass(frozen=True)
class Axis:
    """Approximate axis and radius of the wall, to a few centimetres.

    Attributes
    ----------
    x_m, y_m : float
        Of the axis at height z_m of the frame of the points, m.
    radius_m : float
        Of the wall, m.
    z_m : float
        This height, m.
    slope : tuple of float
        dx/dz and dy/dz of the axis: points are slid along it into a horizontal plane.
    """

    x_m: float
    y_m: float
    radius_m: float
    z_m: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)

    def at(self, z_m):
        """x and y of the axis at heights z_m (any shape)."""
        rise = np.asarray(z_m) - self.z_m
        return self.x_m + self.slope[0] * rise, self.y_m + self.slope[1] * rise


@dataclass(frozen=True)
class Rings:
    """The rings from the bottom up, n of them with c azimuth cells each.

    What no point determines is nan: circles of `undetermined` rings, cells without points, the sd
    of a cell with one point.

    Attributes
    ----------
    axis : Axis
        The approximate axis that azimuths and radii of cells are about.
    edges_m : ndarray, shape (n + 1,)
        Heights between the rings, in the frame of the points, m.
    count : ndarray of int, shape (n,)
        Points of each ring.
    z_m : ndarray, shape (n,)
        Mean height of the points, m.
    x_m, y_m, radius_m : ndarray, shape (n,)
        Centre and radius of the circle through the points slid to height z_m, m.
    residual_sd_m : ndarray, shape (n,)
        Sd of the points about the circle, n - 3 degrees of freedom; below 1e-8 of the radius it is
        rounding, m.
    cell_count : ndarray of int, shape (n, c)
        Points of each cell; cell 0 begins at azimuth 0.
    cell_azimuth_rad : ndarray, shape (n, c)
        Mean azimuth of its points, 0 to 2 pi.
    cell_radius_m : ndarray, shape (n, c)
        Their mean distance from the axis, m.
    cell_sd_m : ndarray, shape (n, c)
        Sd of a single point about that mean, n - 1 degrees of freedom, m.
    outside : int
        Points below the first or above the last edge.
    beyond : ndarray of int, shape (n,)
        Points farther than the band from the approximate radius, left out.
    """

    axis: Axis
    edges_m: np.ndarray
    count: np.ndarray
    z_m: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    radius_m: np.ndarray
    residual_sd_m: np.ndarray
    cell_count: np.ndarray
    cell_azimuth_rad: np.ndarray
    cell_radius_m: np.ndarray
    cell_sd_m: np.ndarray
    outside: int
    beyond: np.ndarray

    @property
    def empty(self):
        """Indices of the rings without any point."""
        return np.flatnonzero(self.count == 0)

    @property
    def undetermined(self):
        """Indices of the rings without a circle: fewer than 3 points, or points on a line."""
        return np.flatnonzero(np.isnan(self.radius_m))

    def section_points(self, ring, fewest=2):
        """Cells of one ring as evenly spread points: xyz (k, 3) and sd of each mean radius (k,).

        sd = cell_sd / sqrt(count), the points of a cell being independent of each other. A cell
        of `fewest` points or more counts, at least two: one point alone has no sd. The mean over
        a cell of width d shows a mode of order k times 1 - (k d)^2 / 24.
        """
        counts = self.cell_count[ring]
        full = counts >= max(fewest, 2)
        azimuth, radius = self.cell_azimuth_rad[ring][full], self.cell_radius_m[ring][full]
        x, y = self.axis.at(self.z_m[ring])
        xyz = np.column_stack(
            [
                x + radius * np.sin(azimuth),
                y + radius * np.cos(azimuth),
                np.full(len(radius), self.z_m[ring]),
            ]
        )
        return xyz, self.cell_sd_m[ring][full] / np.sqrt(counts[full])


def ring_sections(points_m, edges_m, axis, *, cells=72, band_m=np.inf, chunk=CHUNK):
    """Sort wall points into rings by height, and sum up each ring: circle and azimuth cells.

    The circle is Taubin's (1991): least sum F^2 / sum |grad F|^2 with F = a (x^2 + y^2) + b x +
    c y + d. It has none of Kasa's bias on arcs; isotropic noise s makes its radius s^2 / R too long
    (Al-Sharadqah & Chernov 2009), twice as much as the geometric circle's.

    Parameters
    ----------
    points_m : ndarray, shape (n, 3)
        Array or memmap of float64 or float32, or an iterable of such arrays, of ten thousand points
        each or more (smaller ones are right, but slow).
    edges_m : ndarray, shape (rings + 1,)
        Ascending; a ring holds its lower edge, the last one also its upper.
    axis
        `Axis`: approximate axis and radius.
    cells : optional
        Of equal width in azimuth.
    band_m : optional
        Points farther than this from the approximate radius are left out and counted.
    chunk : optional
        Points worked on at a time.

    Raises
    ------
    InputError
        For edges that do not ascend, for points of another shape, that are not finite, or whose
        float32 cannot tell a tenth of a millimetre.
    """
    edges = _checked_edges(edges_m)
    _check_settings(axis, cells, band_m)
    sums = _Sums(edges, axis, int(cells), band_m)
    for start, part in _chunks(points_m, chunk):
        sums.add(_columns(part, start))
    return sums.rings()


def _checked_edges(edges_m):
    edges = np.asarray(edges_m, dtype=float)
    if edges.ndim != 1 or len(edges) < 2 or not np.all(np.isfinite(edges)):
        raise _problem("edges", f"found shape {edges.shape}; expected two heights or more")
    falling = np.flatnonzero(np.diff(edges) <= 0)
    if len(falling):
        i = int(falling[0])
        raise _problem(
            "edges", f"{edges[i + 1]:g} m follows {edges[i]:g} m; expected ascending heights"
        )
    return edges


def _check_settings(axis, cells, band_m):
    numbers = [axis.x_m, axis.y_m, axis.z_m, axis.radius_m, *axis.slope]
    if not np.all(np.isfinite(numbers)) or axis.radius_m <= 0:
        raise _problem("axis", f"found {axis}; expected finite numbers and a radius above 0")
    if cells < 1:
        raise _problem("cells", f"found {cells}; expected 1 or more")
    if not band_m > 0:
        raise _problem("band_m", f"found {band_m}; expected a width above 0")


def _chunks(points_m, chunk):
    """Pairs of the index of the first point and an array of at most `chunk` points."""
    start = 0
    for block in [points_m] if hasattr(points_m, "ndim") else points_m:
        block = np.asanyarray(block)
        if block.ndim != 2 or block.shape[1] != 3 or block.dtype.kind not in "fiu":
            raise _problem(
                "points",
                f"found {block.dtype} of shape {block.shape}; expected numbers of shape (n, 3)",
            )
        for first in range(0, len(block), chunk):
            yield start + first, block[first : first + chunk]
        start += len(block)


def _columns(part, start):
    """(3, k) float64 of a chunk that is fit for use."""
    columns = np.array(part.T, dtype=float, order="C")
    with np.errstate(invalid="ignore"):
        total = columns.sum()
    if not np.isfinite(total):
        bad = np.flatnonzero(~np.isfinite(columns).all(axis=0))
        if len(bad):
            x, y, z = columns[:, bad[0]]
            raise _problem(
                "points", f"point {start + bad[0] + 1} is ({x}, {y}, {z}); expected finite numbers"
            )
    if part.dtype.itemsize < 8 and part.dtype.kind == "f":
        largest = np.abs(columns).max()
        if np.spacing(part.dtype.type(largest)) > COARSEST_M:
            raise _problem(
                "points",
                f"{part.dtype} holds {largest:.0f} m to {np.spacing(part.dtype.type(largest)):g} m"
                " only; expected float64, or coordinates from a nearby origin",
            )
    return columns


def _problem(what, expected):
    return InputError(Problem(what, expected))


class _Sums:
    """Sums of powers of u, v, w by ring and by cell, in units of the approximate radius."""

    def __init__(self, edges, axis, cells, band_m):
        self.edges, self.axis, self.cells = edges, axis, cells
        self.band = band_m / axis.radius_m
        self.ring_of = _ring_finder(edges)
        self.n = len(edges) - 1
        self.outside, self.beyond = 0, np.zeros(self.n, dtype=np.int64)
        self.by_ring = np.zeros((6, self.n))  # uu, uv, uw, vw, ww, z above the first edge
        self.by_cell = np.zeros((4, self.n * cells))  # u, v, d, d^2
        self.cell_count = np.zeros(self.n * cells, dtype=np.int64)

    def add(self, columns):
        """Add a chunk of points (3, k)."""
        z = columns[2]
        inside = (z >= self.edges[0]) & (z <= self.edges[-1])
        if not inside.all():
            self.outside += int(len(z) - inside.sum())
            columns = columns[:, inside]
        x, y, z = columns
        centre_x, centre_y = self.axis.at(z)
        u, v = (x - centre_x) / self.axis.radius_m, (y - centre_y) / self.axis.radius_m
        ring, d = self.ring_of(z), np.sqrt(u * u + v * v) - 1
        near = np.abs(d) <= self.band
        if not near.all():
            self.beyond += np.bincount(ring[~near], minlength=self.n)
            u, v, d, z, ring = u[near], v[near], d[near], z[near], ring[near]
        w = d * (2 + d)
        for total, values in zip(
            self.by_ring, (u * u, u * v, u * w, v * w, w * w, z - self.edges[0]), strict=True
        ):
            total += np.bincount(ring, weights=values, minlength=self.n)
        cell = ring * self.cells + self._cell_of(u, v)
        self.cell_count += np.bincount(cell, minlength=len(self.cell_count))
        for total, values in zip(self.by_cell, (u, v, d, d * d), strict=True):
            total += np.bincount(cell, weights=values, minlength=len(total))

    def _cell_of(self, u, v):
        turn = np.arctan2(u, v) * (self.cells / FULL_TURN)
        turn[turn < 0] += self.cells
        return np.minimum(turn.astype(np.int64), self.cells - 1)

    def rings(self):
        """The sums as `Rings`."""
        shape, radius = (self.n, self.cells), self.axis.radius_m
        cell_count = self.cell_count.reshape(shape)
        u, v, d, dd = (total.reshape(shape) for total in self.by_cell)
        count = cell_count.sum(axis=1)
        sums = [total.sum(axis=1) for total in (u, v, d, dd)]
        centre_u, centre_v, circle_radius, sd = _taubin(count, *sums, *self.by_ring[:5])
        with np.errstate(invalid="ignore", divide="ignore"):
            z = self.edges[0] + self.by_ring[5] / count
            mean = d / cell_count
            spread = np.maximum(dd - cell_count * mean**2, 0) / (cell_count - 1)
            spread[cell_count < 2] = np.nan
        axis_x, axis_y = self.axis.at(z)
        azimuth = np.where(cell_count > 0, np.arctan2(u, v) % FULL_TURN, np.nan)
        return Rings(
            axis=self.axis,
            edges_m=self.edges,
            count=count,
            z_m=z,
            x_m=axis_x + radius * centre_u,
            y_m=axis_y + radius * centre_v,
            radius_m=radius * circle_radius,
            residual_sd_m=radius * sd,
            cell_count=cell_count,
            cell_azimuth_rad=azimuth,
            cell_radius_m=radius * (1 + mean),
            cell_sd_m=radius * np.sqrt(spread),
            outside=self.outside,
            beyond=self.beyond,
        )


def _ring_finder(edges):
    """A function from heights between the first and the last edge to the index of their ring.

    A table over an even grid, two places or more in the narrowest ring, is off by one at most.
    """
    last, span = len(edges) - 2, edges[-1] - edges[0]
    narrowest = np.diff(edges).min()
    if 2.5 * span > GRID_LIMIT * narrowest:
        return lambda z: np.minimum(np.searchsorted(edges, z, side="right") - 1, last)
    places = np.ceil(2.5 * span / narrowest)
    grid = edges[0] + np.arange(int(places) + 1) / places * span
    table = np.clip(np.searchsorted(edges, grid, side="right") - 1, 0, last)
    lower, upper = edges[:-1].copy(), edges[1:].copy()
    upper[-1] = np.inf

    def ring_of(z):
        ring = table.take(((z - edges[0]) / span * places).astype(np.int64))
        ring += z >= upper.take(ring)
        ring -= z < lower.take(ring)
        return ring

    return ring_of


def _taubin(count, u, v, d, dd, uu, uv, uw, vw, ww):
    """Centres (n,), (n,), radii and residual sds of circles from sums over their points.

    nan where there are fewer than 3 points or they lie on a line. sd^2 is the least mean of
    F^2 / |grad F|^2 times n / (n - 3).
    """
    found = np.full((4, len(count)), np.nan)
    enough = np.flatnonzero(count >= 3)
    n = count[enough].astype(float)
    u, v, d, dd, uu, uv, uw, vw, ww = (
        total[enough] / n for total in (u, v, d, dd, uu, uv, uw, vw, ww)
    )
    w = 2 * d + dd
    vv = w + 1 - uu
    moments = np.array([[ww, uw, vw], [uw, uu, uv], [vw, uv, vv]]).transpose(2, 0, 1)
    mean = np.column_stack([w, u, v])
    about = moments - mean[:, :, None] * mean[:, None, :]
    # from w about the axis to z = u^2 + v^2 about the mean point: a linear change of variables
    change = np.tile(np.eye(3), (len(n), 1, 1))
    change[:, 0, 1], change[:, 0, 2] = -2 * u, -2 * v
    about = change @ about @ change.transpose(0, 2, 1)
    size = np.maximum(about[:, 1, 1] + about[:, 2, 2], np.finfo(float).tiny)  # the mean of z
    about[:, 0, :] /= 2 * np.sqrt(size)[:, None]
    about[:, :, 0] /= 2 * np.sqrt(size)[:, None]
    values, vectors = np.linalg.eigh(about)
    least = vectors[:, :, 0]
    sound = (values[:, 1] > LEAST_SPREAD**2 * values[:, 2]) & (np.abs(least[:, 0]) > LEAST_SPREAD)
    a = np.where(sound, least[:, 0], 1.0) / (2 * np.sqrt(size))
    x, y = -least[:, 1] / (2 * a), -least[:, 2] / (2 * a)
    variance = np.maximum(values[:, 0], 0) * n / np.maximum(n - 3, 1)
    result = np.array([u + x, v + y, np.sqrt(x**2 + y**2 + size), np.sqrt(variance)])
    result[3, n == 3] = np.nan
    found[:, enough] = np.where(sound, result, np.nan)
    return found
