"""Which of two surfaces is the wall, where a screen hides a part of it.

No beam passes a wall. From inside, whatever lies outwards of the wall over more than the area of
nozzles and manholes shows that the surface found first is a screen, or a circle between a screen
and the wall; from outside, whatever lies inwards of it. The wall is then looked for among the
rearmost distances of coarse cells.
"""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message

FILE = "clouds.toml"

LEVELS, FEWEST_LEVELS, AROUND = 24, 6, 3  # rows of coarse cells; columns for each row
POINTS_OF_CELL = 20  # that a coarse cell gets, were they even over the wall
REACH_M, BIN_M = 2.0, 0.05  # of distances that are looked at, to both sides; their classes
BAND_M = 0.12  # from a surface: of the wall, as deep as its buckles, with noise
LEAST_SHARE, FEWEST = 0.15, 3  # of the points of a coarse cell, for a distance that counts
REAR_SHARE = 0.05  # of the cells: more than nozzles and manholes take up
LEAST_WALL_SHARE = 0.5  # of the cells: below it the wall cannot be distinguished from its screen
CLEAR_SHARE, BETTER_SHARE = 0.95, 0.02  # of the cells: no screen is looked for; gain of another fit
STEP_M = 0.11  # between neighbouring cells: a screen begins with a larger one
LEAVING_SHARE = 0.4  # of the rows: a wall does not leave the band without a step in so many
BAND_OF_RADIUS, LEAST_BAND_M = 0.01, 0.02  # of the first fit, narrower than BAND_M in small tanks
PENALTY = 2  # cells on a surface that one cell behind it outweighs
SAMPLES, REFITS = 1000, 5  # of five cells each: with half of them of the wall, 30 have no other


class CoarseCells:
    """Distances from a surface in coarse cells of a sample.

    Parameters
    ----------
    surface : CylinderSurface or SphereSurface
    xyz_m : ndarray, shape (n, 3)
        Seen from one side.
    outwards : ndarray of int, shape (n,)
        1 of points seen from inside, -1 from outside.
    ends_m : tuple of float
        u of the first and the last row.

    Attributes
    ----------
    seen, levels : int
        Cells with points, and rows of cells.
    rear_share, wall_share, leaving_share : float
        Of the cells with points, those with points behind the surface, and with points on it; of
        the rows, those in which one surface leads from the band of the wall to beyond it.
    cell : ndarray of int, shape (cells,)
        Of `distance_m`.
    distance_m : ndarray, shape (cells,)
        Rearmost distance of each cell, outwards of the surface, m.
    """

    def __init__(self, surface, xyz_m, outwards, ends_m):
        u, turn, distance = surface.places(xyz_m)
        self.xyz_m, self.outwards, self.ends_m = xyz_m, outwards, ends_m
        self.u, self.turn, self.distance = u, turn, distance
        self.radius_m = surface.radius_m
        kept = (u > ends_m[0]) & (u < ends_m[1]) & (np.abs(distance) < REACH_M)
        levels = int(np.sqrt(np.count_nonzero(kept) / POINTS_OF_CELL / AROUND))
        levels = self.levels = min(max(levels, FEWEST_LEVELS), LEVELS)
        around = AROUND * levels
        row = ((u[kept] - ends_m[0]) / (ends_m[1] - ends_m[0]) * levels).astype(np.int64)
        column = (turn[kept] * (around / FULL_TURN)).astype(np.int64) % around
        bins = int(2 * REACH_M / BIN_M)
        rearwards = distance[kept] * outwards[kept]
        level = ((rearwards + REACH_M) / BIN_M).astype(np.int64).clip(0, bins - 1)
        cell = np.minimum(row, levels - 1) * around + column
        count = np.bincount(cell * bins + level, minlength=around * levels * bins)
        count = count.reshape(-1, bins)
        total = count.sum(axis=1, keepdims=True)
        # a surface may lie on the edge of two classes: both count for either
        wide = count + np.pad(count, ((0, 0), (0, 1)))[:, 1:]
        occupied = (wide >= np.maximum(LEAST_SHARE * total, FEWEST)) & (count > 0)
        middle = (np.arange(bins) + 0.5) * BIN_M - REACH_M
        shown = occupied.any(axis=1)
        self.seen = max(int(np.count_nonzero(shown)), 1)
        rear = middle > BAND_M + BIN_M
        behind = occupied[:, rear].any(axis=1)
        self.rear_share = np.count_nonzero(behind) / self.seen
        self.wall_share = (
            np.count_nonzero(occupied[:, np.abs(middle) < BAND_M].any(axis=1)) / self.seen
        )
        self.cell = np.flatnonzero(shown)
        rearmost = bins - 1 - occupied[shown][:, ::-1].argmax(axis=1)
        self.side = 1 if np.mean(outwards) > 0 else -1
        self.distance_m = self.side * middle[rearmost]
        self.leaving_share = self._leaving_share()

    @property
    def is_clear(self):
        """Whether hardly any cell is behind the surface, and the wall leaves it nowhere."""
        return self.rear_share < REAR_SHARE and self.leaving_share < LEAVING_SHARE

    def _leaving_share(self):
        """Share of the rows in which one surface leads from within the band to beyond it."""
        rows = np.full(AROUND * self.levels**2, np.nan)
        rows[self.cell] = self.distance_m
        rows = rows.reshape(self.levels, -1)
        after = np.roll(rows, -1, axis=1)
        crosses = (np.abs(rows) < BAND_M) != (np.abs(after) < BAND_M)
        return float(np.mean(np.any(crosses & (np.abs(after - rows) < STEP_M), axis=1)))

    def near_rear(self):
        """(n,) points near the leaning circle that most of the rearmost distances support."""
        row, column = np.divmod(self.cell, AROUND * self.levels)
        turn = (column + 0.5) * (FULL_TURN / (AROUND * self.levels))
        design = _design(turn, (row + 0.5) / self.levels)
        band_m = min(BAND_OF_RADIUS * self.radius_m + LEAST_BAND_M, BAND_M)
        model = _consensus(design, self.distance_m, self.side, band_m)
        height = (self.u - self.ends_m[0]) / (self.ends_m[1] - self.ends_m[0])
        away = self.distance - _design(self.turn, height) @ model
        return (height > 0) & (height < 1) & (np.abs(away) < BAND_M)


def _design(turn, height):
    """(n, 5) derivative of the distance by radius, shift and lean of a cylinder."""
    sine, cosine = np.sin(turn), np.cos(turn)
    h = height - 0.5
    return np.column_stack([np.ones(len(turn)), sine, cosine, h * sine, h * cosine])


def _consensus(design, distance_m, side, band_m):
    """(5,) radius, shift and lean of a cylinder near many distances and in front of few of them."""
    rng = np.random.default_rng(20_11)
    five = rng.integers(len(distance_m), size=(SAMPLES, 5))
    square = np.abs(np.linalg.det(design[five])) > 1e-3
    models = np.linalg.solve(design[five][square], distance_m[five][square][..., None])[..., 0]
    if not len(models):
        return np.zeros(design.shape[1])
    away = side * (distance_m - models @ design.T)
    # a circle between screen and wall is near many cells of both, but has the wall behind it
    support = np.count_nonzero(np.abs(away) < band_m, axis=1)
    support -= PENALTY * np.count_nonzero(away >= band_m, axis=1)
    chosen = np.abs(away[np.argmax(support)]) < band_m
    for _ in range(REFITS):
        model = np.linalg.lstsq(design[chosen], distance_m[chosen])[0]
        chosen = np.abs(design @ model - distance_m) < band_m
    return model


def two_surfaces(first_m, first, second_m, second):
    """InputError for two surfaces of radii (m) that are seen in two shares of the cells."""
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


def undecided(cells):
    """InputError for a wall that cannot be distinguished from what hides it in `CoarseCells`."""
    low, high = np.percentile(cells.distance_m, [5, 95])
    text = message(
        "cloud_wall_hidden",
        "the points lie on surfaces up to about {apart_m:.1f} m apart, and the wall cannot be "
        "distinguished from a screen before it: expected scans that show more than half of the "
        "wall; leave the screen out with a box (leave_out), or scan behind it",
        apart_m=high - low,
    )
    return InputError(Problem(FILE, text))
