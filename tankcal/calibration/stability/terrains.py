"""Random terrain for the comparison of two calibrations by resections.

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

SEED = 1  # default seed of the heights
DRAWN = 10  # number of random terrains for one figure
_NUMBER = r"(-?[0-9]{1,6}(?:\.[0-9]{1,6})?)"
_PAIR = re.compile(rf"{_NUMBER},{_NUMBER}")


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
