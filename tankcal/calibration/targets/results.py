"""Targets measured in a photograph, their names, and refused candidates with reasons.

A list of ids names coded targets; approximate positions name circles.
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.job.field_values import read_value
from tankcal.job.fields import Field, Refused, is_blank
from tankcal.job.folder import read_csv
from tankcal.job.tables import MAX_FILE_BYTES, nearest, read_bytes, shown
from tankcal.messages import message

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
ID = Field(
    "id", "number", message("targets_note_id", "number of the code"), required=True, low=0, high=1e6
)
POINT = Field("point", "name", message("targets_note_point", "name of the point"), required=True)
NAMES = (ID, POINT)
PLACES = (
    Field(
        "photo",
        "name",
        message("targets_note_photo", "the photo, its file without the ending"),
        required=True,
    ),
    POINT,
    Field(
        "column_px",
        "number",
        message("targets_note_column", "approximate column, pixels"),
        required=True,
        low=-1e6,
        high=1e6,
    ),
    Field(
        "line_px",
        "number",
        message("targets_note_line", "approximate line, pixels"),
        required=True,
        low=-1e6,
        high=1e6,
    ),
)
CORNERS = ("-1", "-2", "-3", "-4")  # top left of the marker as printed, then clockwise


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


def read_names(path, log, suffixes=()):
    """Read {id: name} from a CSV file with the columns id and point; problems are logged.

    Parameters
    ----------
    path : Path
        Path of the file.
    log : Log
        Receives the problems.
    suffixes : sequence of str, optional
        Suffixes with which each name must also be valid.

    Returns
    -------
    dict
    """
    names, first = {}, {}
    for file, row, (number, point) in _rows(path, NAMES, log):
        if number != int(number):
            log.problem(
                file,
                message(
                    "targets_not_whole", "found {found:g}; expected a whole number", found=number
                ),
                row,
                "id",
            )
            continue
        for value, column in ((int(number), "id"), (point, "point")):
            if (column, value) in first:
                expected = message(
                    "targets_twice",
                    "{found!r} is already in row {row}; expected once",
                    found=value,
                    row=first[column, value],
                )
                log.problem(file, expected, row, column)
            first.setdefault((column, value), row)
        try:
            for suffix in suffixes:
                read_value(POINT, point + suffix)
        except Refused as refusal:
            log.problem(
                file,
                message(
                    "targets_with_corner",
                    "with the ending of a corner: {refusal}",
                    refusal=refusal.text,
                ),
                row,
                "point",
            )
        names[int(number)] = point
    return names


@dataclass(frozen=True)
class Place:
    """Approximate position of a point in a photo, px, and its row in the file."""

    point: str
    place_px: np.ndarray
    row: int


def read_places(path, log):
    """Read {photo: [Place]} from a CSV file with photo, point, column_px, line_px."""
    places, first = {}, {}
    for file, row, (photo, point, column, line) in _rows(path, PLACES, log):
        if (photo, point) in first:
            expected = message(
                "targets_place_twice",
                "{point!r} is already in row {first_row}; expected once in photo {photo!r}",
                point=point,
                first_row=first[photo, point],
                photo=photo,
            )
            log.problem(file, expected, row, "point")
        first.setdefault((photo, point), row)
        places.setdefault(photo, []).append(Place(point, np.array([column, line]), row))
    return places


def warn_of_unused(places, photos, file, log):
    """Log a warning for each photo of `places` that is not among the given photos.

    Parameters
    ----------
    places : dict
        {photo: [Place]} from `read_places`.
    photos : sequence of str
        Names of the given photos.
    file : str
        Name of the file of the positions.
    log : Log
        Receives the warnings.
    """
    for photo in places:
        if photo not in photos:
            hint = nearest(photo, photos)
            expected = message(
                "targets_unused_photo",
                "found {found}; expected one of the photos given{hint}; the row is not used",
                found=shown(photo),
                hint=hint,
            )
            log.warning(file, expected, places[photo][0].row, "photo")


def _rows(path, fields, log):
    """Yield (file, row, values) of the valid rows; problems are logged."""
    data = read_bytes(path, log, MAX_FILE_BYTES)
    table = None if data is None else read_csv(path.name, data, ",", ".", log)
    if table is None:
        return
    missing = [column for column in fields if column.name not in table.headings]
    for column in missing:
        expected = message(
            "targets_missing_column", "missing column; expected {wanted}", wanted=column.wanted()
        )
        log.problem(table.file, expected, table.heading_row, column.name)
    if missing:
        return
    places = [table.headings.index(column.name) for column in fields]
    for row, cells in zip(table.row_numbers, table.rows, strict=True):
        values = []
        for column, place in zip(fields, places, strict=True):
            try:
                if is_blank(cells[place]):
                    raise Refused(
                        message(
                            "targets_blank",
                            "blank; expected {expected}",
                            expected=column.expectation(),
                        )
                    )
                values.append(read_value(column, cells[place], table.decimal))
            except Refused as refusal:
                log.problem(table.file, refusal.text, row, column.name)
        if len(values) == len(fields):
            yield table.file, row, values


def match_circles_to_places(circles, places, reach_px):
    """Assign circles to approximate positions, each at most once.

    A position with two circles within reach, or a circle with two positions, is ambiguous.

    Parameters
    ----------
    circles : sequence of Circle
        Circles of a photo.
    places : sequence of Place
        Approximate positions in the photo.
    reach_px : float
        Largest distance of a circle from its approximate position, px.

    Returns
    -------
    named : list of (str, Circle)
        Point and circle.
    refused : list of (str, Circle)
        Code of the reason and circle.
    missing : list of str
        Points without a circle.
    """
    if not circles or not places:
        return [], [("unnamed", circle) for circle in circles], [place.point for place in places]
    middles = np.array([circle.centre_px for circle in circles])
    approximate = np.array([place.place_px for place in places])
    near = np.hypot(*(middles[:, None] - approximate).transpose(2, 0, 1)) <= reach_px
    per_circle, per_place = near.sum(axis=1), near.sum(axis=0)
    named, refused = [], []
    for i, circle in enumerate(circles):
        if per_circle[i] == 0:
            refused.append(("unnamed", circle))
        elif per_circle[i] > 1 or per_place[near[i]].max() > 1:
            refused.append(("ambiguous", circle))
        else:
            named.append((places[int(np.argmax(near[i]))].point, circle))
    missing = [place.point for place, count in zip(places, per_place, strict=True) if not count]
    return named, refused, missing
