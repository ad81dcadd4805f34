"""Grids of image points and random terrain for the comparison of calibrations of a camera.

The image coordinates of column C and line L, counted from the centre of the first pixel, are

    x = (C - (columns - 1) / 2) pixel      y = -(L - (lines - 1) / 2) pixel

Source: Pessoa 2017 (1, 2; grid of section 7 of its method: 46 x 35 points from (50, 50), 100 px
apart, on 4608 x 3456 px).

Random terrain for resections
-----------------------------

The camera looks down from a position. Each image point sees the terrain at a random height

    Z = low + U(0, 1) range

Only ratios of depths affect the residuals of a resection, not their size. Source: Pessoa 2017,
section of the method SPR: position (300, 300, 450) m, Z = 200 + U(0, 1) 100 (terrain I) or 20
(terrain II).
"""

import re
from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message

STEPS_ON_LONGEST_SIDE = 46.08  # Pessoa: 4608 px in steps of 100 px
MOST_POINTS = 250_000  # largest number of points of a grid
_NUMBER = r"([0-9]{1,6}(?:\.[0-9]{1,6})?)"
_FORM = re.compile(rf"([0-9]{{1,6}})[xX]([0-9]{{1,6}}),{_NUMBER},{_NUMBER},{_NUMBER}")
EXPECTED = message(
    "compare_grid_form",
    "expected COLUMNSxROWS,FIRST_COLUMN,FIRST_LINE,STEP in pixels, such as 46x35,50,50,100",
)
SEED = 1  # default seed of the heights
DRAWN = 10  # number of random terrains for one figure
_SIGNED_NUMBER = r"(-?[0-9]{1,6}(?:\.[0-9]{1,6})?)"
_PAIR = re.compile(rf"{_SIGNED_NUMBER},{_SIGNED_NUMBER}")


@dataclass(frozen=True)
class Grid:
    """Square grid of image points, row by row from the first line downwards.

    Attributes
    ----------
    columns, rows : int
        Number of points in each direction.
    start_px : tuple of float
        Column and line of the first point, px.
    step_px : float
        Distance between neighbours in both directions, px.
    """

    columns: int
    rows: int
    start_px: tuple[float, float]
    step_px: float

    @property
    def size(self):
        """Number of points."""
        return self.columns * self.rows

    @property
    def places_px(self):
        """Column and line of each point, shape (size, 2), px."""
        column = self.start_px[0] + self.step_px * np.arange(self.columns)
        line = self.start_px[1] + self.step_px * np.arange(self.rows)
        return np.column_stack([part.ravel() for part in np.meshgrid(column, line)])

    def image_points_mm(self, format_px, pixel_mm):
        """Image coordinates of the points from the centre, mm, x to the right and y upwards.

        Parameters
        ----------
        format_px : tuple of int
            Columns and lines of the frame.
        pixel_mm : ndarray, shape (2,)
            Sides of a pixel, mm.

        Returns
        -------
        ndarray, shape (size, 2)

        Raises
        ------
        InputError
            If a point is outside the frame.
        """
        first = np.array(self.start_px)
        last = first + self.step_px * np.array([self.columns - 1, self.rows - 1])
        size = np.array(format_px, dtype=float)
        if np.any(first < -0.5) or np.any(last > size - 0.5):
            raise InputError(
                Problem(
                    "--grid",
                    message(
                        "compare_grid_off",
                        "columns {first_column:g} to {last_column:g}, lines {first_line:g} "
                        "to {last_line:g}; expected the whole grid on the frame of "
                        "{columns:g} x {lines:g} px",
                        first_column=first[0],
                        last_column=last[0],
                        first_line=first[1],
                        last_line=last[1],
                        columns=size[0],
                        lines=size[1],
                    ),
                )
            )
        return (self.places_px - (size - 1) / 2) * pixel_mm * [1, -1]

    def __str__(self):
        x, y = self.start_px
        return f"{self.columns}x{self.rows},{x:.9g},{y:.9g},{self.step_px:.9g}"


def default_grid(format_px):
    """Create the grid of Pessoa in the proportions of a frame (columns, lines).

    On 4608 x 3456 px it equals his grid. The step is the longest side / 46.08, and the first point
    is half a step from the corner. A frame narrower than one step has one row along its middle.
    """
    size = np.array(format_px, dtype=float)
    step = float(size.max()) / STEPS_ON_LONGEST_SIDE
    start = np.minimum(step / 2, (size - 1) / 2)
    columns, rows = np.floor((size - 1 - start) / step + 1e-9).astype(int) + 1
    return Grid(int(columns), int(rows), tuple(start.tolist()), step)


def parse_grid(text):
    """Parse a grid from a text such as 46x35,50,50,100.

    Raises
    ------
    InputError
        If the text has another form.

    Examples
    --------
    >>> print(parse_grid("46x35,50,50,100"))
    46x35,50,50,100
    """
    match = _FORM.fullmatch(text.replace(" ", "")) if len(text) <= 80 else None
    if match is None:
        expected = message(
            "compare_no_grid", "found {found!r}; {expected}", found=text[:60], expected=EXPECTED
        )
        raise InputError(Problem("--grid", expected))
    columns, rows = int(match[1]), int(match[2])
    x, y, step = (float(part) for part in match.groups()[2:])
    if columns * rows == 0 or columns * rows > MOST_POINTS or step == 0:
        expected = message(
            "compare_grid_size",
            "found {found!r}; expected 1 to {most} points and a step above 0",
            found=text[:60],
            most=MOST_POINTS,
        )
        raise InputError(Problem("--grid", expected))
    return Grid(columns, rows, (x, y), step)


@dataclass(frozen=True)
class Terrain:
    """Random terrain below a camera that looks down.

    Attributes
    ----------
    position_m : tuple of float
        Projection centre (x, y, z) of the first bundle, m.
    low_m, range_m : float
        Lowest height, and range of the heights above it, m; a range of 0 is flat.
    """

    position_m: tuple[float, float, float] = (300.0, 300.0, 450.0)
    low_m: float = 200.0
    range_m: float = 100.0

    @property
    def drawn(self):
        """Number of random terrains for one figure; one for flat terrain."""
        return DRAWN if self.range_m else 1

    def depths_m(self, points, seed, number=0):
        """Random depths of the terrain below the camera.

        Parameters
        ----------
        points : int
            Number of points.
        seed, number : int
            Seed, and number of the terrain; they reproduce the depths.

        Returns
        -------
        ndarray, shape (points,)
            Depths, m.
        """
        rng = np.random.default_rng((seed, number) if number else seed)
        return self.position_m[2] - self.low_m - rng.random(points) * self.range_m

    def object_points_m(self, ideal_mm, c_mm, depth_m):
        """Object points on the rays of image points.

        Parameters
        ----------
        ideal_mm : ndarray, shape (n, 2)
            Ideal image points, mm.
        c_mm : float
            Focal length, mm.
        depth_m : ndarray, shape (n,)
            Depths below the camera, m.

        Returns
        -------
        ndarray, shape (n, 3)
            Object points, m.
        """
        along = np.column_stack([ideal_mm / c_mm, np.full(len(ideal_mm), -1.0)])
        return np.asarray(self.position_m) + along * depth_m[:, None]


TERRAINS = {"I": Terrain(), "II": Terrain(range_m=20.0)}


def parse_terrain(text):
    """Parse a terrain from a text: I, II, or LOW,RANGE in metres.

    Raises
    ------
    InputError
        If the text has another form.

    Examples
    --------
    >>> terrain = parse_terrain("100,20")
    >>> terrain.low_m, terrain.range_m
    (100.0, 20.0)
    """
    plain = text.strip()
    if plain.upper() in TERRAINS:
        return TERRAINS[plain.upper()]
    match = _PAIR.fullmatch(plain.replace(" ", "")) if len(plain) <= 40 else None
    camera_m = Terrain().position_m[2]
    if match is not None:
        low, extent = (float(part) for part in match.groups())
        if extent >= 0 and low + extent < camera_m:
            return Terrain(low_m=low, range_m=extent)
    raise InputError(
        Problem(
            "--terrain",
            message(
                "compare_terrain",
                "found {found!r}; expected I, II, or LOW,RANGE in metres with a range of 0 or more "
                "and all of it below the camera at {height:g} m, such as 200,100",
                found=text[:60],
                height=camera_m,
            ),
        )
    )
