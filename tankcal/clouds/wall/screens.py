"""Distinction of the wall from a screen that hides a part of it.

No beam passes a wall. Points behind a surface, over more than the area of nozzles and manholes,
show that the surface is a screen, or a circle between screen and wall. For a scan from inside,
behind means outwards of the surface; for a scan from outside, inwards. The wall is then searched
among the rearmost distances of coarse cells.
"""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.units import FULL_TURN

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
