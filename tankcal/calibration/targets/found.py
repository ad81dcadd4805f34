"""What reading a photograph gives: targets, and what was refused with the reason."""

from dataclasses import dataclass, field

import numpy as np

REASONS = {
    "bit_errors": "cells of the code that differ from every code of the dictionary",
    "unclear_cells": "cells that are neither black nor white",
    "duplicate": "the same id or name more than once in this photo",
    "not_listed": "an id that is not in the list of names",
    "too_small": "fewer pixels than the code or the fit needs",
    "shape": "not the image of a square, or of a circle",
    "at_border": "cut by the edge of the photo, or next to it",
    "edges": "edges that could not be fitted",
    "contrast": "too little difference of black and white",
    "mirrored": "a code that reads from behind, or a photo that was flipped",
    "mirror_doubt": "a code that is its own mirror image, in a photo with mirrored ones",
    "turn_doubt": "a code that looks the same upside down: its corners have no names",
    "overlap": "two targets in one place",
    "ambiguous": "more than one circle near one approximate place, or the other way round",
    "unnamed": "no approximate place near it",
}


@dataclass(frozen=True)
class Marker:
    """A coded square.

    Attributes
    ----------
    id : int
        Of the dictionary.
    corners_px : ndarray, shape (4, 2)
        Column and line, clockwise from the top left of the marker as printed; the centre of the
        photo's first pixel is (0, 0).
    sd_px : ndarray, shape (4,)
        Standard deviation of both coordinates of each corner.
    bit_errors : int
        Cells that differ from the code, border included.
    side_px : float
        Mean length of the four sides.
    blur_px : float
        Mean blur of the edges, as a standard deviation.
    clarity : float
        How black and white the cells are: 1, as printed; 0, all of the same grey.
    """

    id: int
    corners_px: np.ndarray
    sd_px: np.ndarray
    bit_errors: int
    side_px: float
    blur_px: float
    clarity: float

    @property
    def centre_px(self):
        """(2,) where the diagonals meet: the image of the centre, whatever the perspective."""
        return _diagonals(self.corners_px)[0]

    @property
    def centre_sd_px(self):
        """Standard deviation of both coordinates of the centre, corners taken as independent."""
        by_corner = _diagonals(self.corners_px)[1]
        return float(np.sqrt(((by_corner * self.sd_px[:, None, None]) ** 2).sum() / 2))


def _diagonals(corners):
    """Where the diagonals of (4, 2) meet, and its derivatives (4, 2, 2) by the corners."""
    one, other = corners[2] - corners[0], corners[3] - corners[1]
    matrix = np.column_stack([one, -other])
    s, t = np.linalg.solve(matrix, corners[1] - corners[0])
    place = corners[0] + s * one
    # moving a corner moves its diagonal across itself; the other diagonal is where we stay
    normals = np.array([[-one[1], one[0]], [-other[1], other[0]]])
    spread = np.linalg.inv(normals)
    shares = ((1 - s, 0), (1 - t, 1), (s, 0), (t, 1))
    return place, np.array([share * np.outer(spread[:, k], normals[k]) for share, k in shares])


@dataclass(frozen=True)
class Circle:
    """A white circle on a dark ground.

    Attributes
    ----------
    centre_px : ndarray, shape (2,)
        Of the ellipse; the circle's own centre is a little beside it, see eccentricity_px.
    sd_px : float
        Standard deviation of both coordinates.
    semi_axes_px : ndarray, shape (2,)
        Larger and smaller half axis.
    turn_rad : float
        Of the larger one, from the columns towards the lines.
    blur_px : float
        Blur of the edge.
    contrast : float
        White minus black, grey values.
    rms_grey : float
        Of the residuals of the fit.
    """

    centre_px: np.ndarray
    sd_px: float
    semi_axes_px: np.ndarray
    turn_rad: float
    blur_px: float
    contrast: float
    rms_grey: float


@dataclass(frozen=True)
class Refused:
    """Something that looks like a target and was not accepted.

    Attributes
    ----------
    code : str
        One of REASONS.
    place_px : ndarray, shape (2,)
        Its middle.
    id : int or None
        Of the dictionary, or None.
    detail : dict
        {what: number} that the reason rests on.
    """

    code: str
    place_px: np.ndarray
    id: int | None = None
    detail: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Found:
    """What one photograph holds.

    Attributes
    ----------
    targets : tuple
        Markers in the order of their ids, or Circles from top to bottom.
    refused : tuple
        Refused.
    size_px : tuple
        (columns, lines).
    doubtful : tuple
        Ids among the targets whose mirror image is a code of the same dictionary: a flipped
        photo would not be noticed by them.
    """

    targets: tuple
    refused: tuple
    size_px: tuple
    doubtful: tuple = ()
