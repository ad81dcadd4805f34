"""Results of the measurement of a photograph: targets, and refused candidates with reasons."""

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
    """Coded square target.

    Attributes
    ----------
    id : int
        Id in the dictionary.
    corners_px : ndarray, shape (4, 2)
        Column and line of the corners, px, clockwise from the top left as printed. The centre of
        the first pixel of the photo is (0, 0).
    sd_px : ndarray, shape (4,)
        Standard deviation of each coordinate of each corner, px.
    bit_errors : int
        Number of cells that differ from the code, including the border.
    side_px : float
        Mean length of the four sides, px.
    blur_px : float
        Mean blur of the edges as a standard deviation, px.
    clarity : float
        Correlation of the cells with the code; 1 as printed, 0 if all cells have the same grey.
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
        """Intersection of the diagonals (2,), the image of the centre in any perspective, px."""
        return _diagonals(self.corners_px)[0]

    @property
    def centre_sd_px(self):
        """Standard deviation of each coordinate of the centre, px, for independent corners."""
        by_corner = _diagonals(self.corners_px)[1]
        return float(np.sqrt(((by_corner * self.sd_px[:, None, None]) ** 2).sum() / 2))


def _diagonals(corners):
    """Intersection of the diagonals of corners (4, 2), and its derivatives (4, 2, 2) by them."""
    first, second = corners[2] - corners[0], corners[3] - corners[1]
    # corner 0 + s first = corner 1 + t second
    matrix = np.column_stack([first, -second])
    s, t = np.linalg.solve(matrix, corners[1] - corners[0])
    place = corners[0] + s * first
    # A change of a corner moves its diagonal; the intersection then moves along the other diagonal.
    normals = np.array([[-first[1], first[0]], [-second[1], second[0]]])
    spread = np.linalg.inv(normals)
    shares = ((1 - s, 0), (1 - t, 1), (s, 0), (t, 1))
    return place, np.array([share * np.outer(spread[:, k], normals[k]) for share, k in shares])


@dataclass(frozen=True)
class Circle:
    """White circle on a dark background.

    Attributes
    ----------
    centre_px : ndarray, shape (2,)
        Centre of the ellipse, px. The image of the centre of the circle differs slightly; see
        eccentricity_px.
    sd_px : float
        Standard deviation of each coordinate, px.
    semi_axes_px : ndarray, shape (2,)
        Major and minor semi-axis, px.
    turn_rad : float
        Direction of the major axis, from the columns towards the lines, rad.
    blur_px : float
        Blur of the edge, px.
    contrast : float
        White minus black, grey values.
    rms_grey : float
        Root mean square of the residuals of the fit, grey values.
    """

    centre_px: np.ndarray
    sd_px: float
    semi_axes_px: np.ndarray
    turn_rad: float
    blur_px: float
    contrast: float
    rms_grey: float


@dataclass(frozen=True)
class RefusedTarget:
    """Candidate for a target that was refused.

    Attributes
    ----------
    code : str
        Reason, one of REASONS.
    place_px : ndarray, shape (2,)
        Centre of the candidate, px.
    id : int or None
        Id in the dictionary, or None.
    detail : dict
        {quantity: number} that explains the reason.
    """

    code: str
    place_px: np.ndarray
    id: int | None = None
    detail: dict = field(default_factory=dict)


@dataclass(frozen=True)
class PhotoTargets:
    """Targets of one photograph.

    Attributes
    ----------
    targets : tuple of Marker or of Circle
        Markers in the order of their ids, or circles from top to bottom.
    refused : tuple of RefusedTarget
        RefusedTarget candidates.
    size_px : tuple of int
        Columns and lines of the photo.
    doubtful : tuple of int
        Ids whose mirror image is also a code of the dictionary. These targets do not reveal a
        mirrored photo.
    """

    targets: tuple
    refused: tuple
    size_px: tuple
    doubtful: tuple = ()
