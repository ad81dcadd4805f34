"""Photographs with targets: their reading, and the measured targets.

Reading of photographs: grey values in proportion to light, not rotated, of limited size.

OpenCV and its dictionaries of coded targets
--------------------------------------------

Only the measurement of photographs requires OpenCV.

Targets measured in a photograph, their names, and refused candidates with reasons.

A list of ids names coded targets; approximate positions name circles.
"""

import importlib
import os
import struct
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryFile
from types import SimpleNamespace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.field_values import read_value
from tankcal.job.fields import Field, Refused, is_blank
from tankcal.job.folder import read_csv
from tankcal.job.tables import MAX_FILE_BYTES, nearest, read_bytes, shown
from tankcal.messages import message
from tankcal.version import install_command

MOST_PIXELS = 250_000_000  # largest number of pixels of a picture
LEAST_SIDE_PX = 32  # least number of columns and of lines
MOST_BYTES = 1_000_000_000  # largest size of a picture file
KINDS = message("targets_kinds", "a JPEG, PNG, TIFF or BMP picture")
PHOTO = Field("photo", "name", "the photo")
ENCODINGS = ("by_file", "linear", "srgb")
JPEG_START = b"\xff\xd8"

# Size and orientation are read from the header alone, before the picture is decoded.
JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # start of frame
JPEG_ALONE = frozenset({0x01, *range(0xD0, 0xD9)})  # markers without a length
TIFF_WIDTH, TIFF_HEIGHT, TIFF_TURN = 256, 257, 274
MOST_ENTRIES = 1000  # largest number of directory entries that are read
BORDER_CELLS = 1  # width of the black border, cells
OLDEST = (4, 7)  # oldest supported version, the first with ArucoDetector


@dataclass(frozen=True)
class Header:
    """Size (columns, lines) as stored, and orientation from the EXIF or TIFF tag (1: as stored)."""

    size_px: tuple
    orientation: int = 1


def read_header(data):
    """Return the Header of a JPEG, PNG, TIFF or BMP file (bytes), or None for other files."""
    try:
        if data[:8] == b"\x89PNG\r\n\x1a\n" and data[12:16] == b"IHDR":
            return Header(struct.unpack(">II", data[16:24]))
        if data[:2] == b"\xff\xd8":
            return _read_jpeg_header(data)
        if data[:4] in (b"II*\0", b"MM\0*"):
            tags = _read_tags(data)
            if TIFF_WIDTH not in tags or TIFF_HEIGHT not in tags:
                return None
            return Header((tags[TIFF_WIDTH], tags[TIFF_HEIGHT]), tags.get(TIFF_TURN, 1))
        if data[:2] == b"BM":
            columns, lines = struct.unpack("<ii", data[18:26])
            return Header((abs(columns), abs(lines)))
    except (struct.error, IndexError):
        return None
    return None


def _read_jpeg_header(data):
    """Header of a JPEG file from its segments, or None without a start of frame."""
    place, turn = 2, 1
    while data[place] == 0xFF:
        kind = data[place + 1]
        if kind == 0xFF or kind in JPEG_ALONE:
            place += 1 if kind == 0xFF else 2
            continue
        (length,) = struct.unpack(">H", data[place + 2 : place + 4])
        if kind in JPEG_SIZES:
            lines, columns = struct.unpack(">HH", data[place + 5 : place + 9])
            return Header((columns, lines), turn)
        if kind == 0xE1 and data[place + 4 : place + 10] == b"Exif\0\0":
            turn = _read_tags(data[place + 10 : place + 2 + length]).get(TIFF_TURN, 1)
        place += 2 + length
    return None


def _read_tags(data):
    """Return {tag: number} of the first directory of a TIFF structure, for short and long tags."""
    order = {b"II": "<", b"MM": ">"}.get(data[:2])
    if order is None:
        return {}
    tags = {}
    try:
        (start,) = struct.unpack(order + "I", data[4:8])
        (count,) = struct.unpack(order + "H", data[start : start + 2])
        for entry in range(min(count, MOST_ENTRIES)):
            place = start + 2 + 12 * entry
            tag, kind = struct.unpack(order + "HH", data[place : place + 4])
            form, length = {3: ("H", 2), 4: ("I", 4)}.get(kind, (None, 0))
            if form:
                (tags[tag],) = struct.unpack(order + form, data[place + 8 : place + 8 + length])
    except struct.error:
        pass
    return tags


@dataclass(frozen=True)
class Picture:
    """Photograph.

    Attributes
    ----------
    image : ndarray of float32, shape (lines, columns)
        Grey values in proportion to light, 0 to 255.
    encoding : str
        Interpretation of the stored grey values: "linear" or "srgb".
    orientation : int
        Orientation tag of the file (1: no rotation). It is not applied.
    """

    image: np.ndarray
    encoding: str
    orientation: int


def photo_name(path):
    """Return the name of a photo, its file name without extension; raise Refused if invalid."""
    return read_value(PHOTO, Path(path).stem)


def read_picture(path, log, encoding="by_file"):
    """Read a picture from a file.

    Parameters
    ----------
    path : path-like
        Path of the file.
    log : Log
        Receives problems and warnings.
    encoding : str, optional
        "linear" for grey values as stored; "srgb" for conversion from sRGB to amounts of light;
        "by_file" for sRGB in JPEG files, as cameras write them, and linear in other files.

    Returns
    -------
    Picture or None
        None after a problem.
    """
    path = Path(path)
    data = read_bytes(path, log, MOST_BYTES)
    if data is None:
        return None
    header = read_header(data)
    if header is None:
        return log.problem(
            path.name,
            message("targets_no_picture", "not a readable picture; expected {kinds}", kinds=KINDS),
        )
    columns, lines = header.size_px
    if columns * lines > MOST_PIXELS:
        expected = message(
            "targets_large_picture",
            "{columns} x {lines} pixels; expected at most {most} in all",
            columns=columns,
            lines=lines,
            most=MOST_PIXELS,
        )
        return log.problem(path.name, expected)
    if min(columns, lines) < LEAST_SIDE_PX:
        expected = message(
            "targets_small_picture",
            "{columns} x {lines} pixels; expected {least} each way at least",
            columns=columns,
            lines=lines,
            least=LEAST_SIDE_PX,
        )
        return log.problem(path.name, expected)
    image, report = _decode(data)
    if image is None or image.shape != (lines, columns) or "error" in report.lower():
        return log.problem(
            path.name,
            message(
                "targets_damaged",
                "damaged: the picture cannot be decoded as its header describes it",
            ),
        )
    if "Corrupt JPEG data" in report:
        template = "perhaps damaged: the JPEG decoder reports {report!r}; open it and look at it"
        log.warning(path.name, message("targets_doubtful_jpeg", template, report=report.strip()))
    if encoding == "by_file":
        encoding = "srgb" if data.startswith(JPEG_START) else "linear"
    return Picture(_convert_to_light(image, encoding), encoding, header.orientation)


def _decode(data):
    """Decode a picture: (grey values or None, the lines that the decoder printed).

    A decoder may return a picture although the file is damaged, and then only prints an error.
    """
    cv2 = opencv()
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    image = None
    with _capture_error_stream() as printed, suppress(cv2.error):
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    return image, printed.text


@contextmanager
def _capture_error_stream():
    """Collect in `text` what C libraries print to the standard error stream of the process."""
    printed = SimpleNamespace(text="")
    with TemporaryFile() as file:
        try:
            stream = os.dup(2)
        except OSError:  # a process without this stream
            yield printed
            return
        try:
            os.dup2(file.fileno(), 2)
            yield printed
        finally:
            os.dup2(stream, 2)
            os.close(stream)
            file.seek(0)
            printed.text = file.read().decode("utf-8", "replace")


def _convert_to_light(image, encoding):
    """Grey values from 0 to 255, float32; pictures of 16 bits are scaled to their maximum."""
    most = {"uint8": 255.0, "uint16": 65535.0}.get(str(image.dtype))
    light = image.astype(np.float32)
    if most is None:
        light = np.nan_to_num(light, nan=0.0, posinf=0.0, neginf=0.0)
        most = max(float(light.max()), 1e-9)
    elif most > 255:
        most = max(float(light.max()), 1.0)  # 12-bit cameras store 16 bits
    light *= np.float32(1 / most)
    if encoding == "srgb":
        # Inverse of the sRGB transfer function
        light = np.where(light <= 0.04045, light / 12.92, ((light + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32) * np.float32(255)


def opencv():
    """Return the module cv2; raise InputError if it is missing or too old."""
    try:
        cv2 = importlib.import_module("cv2")
        is_usable = tuple(int(part) for part in cv2.__version__.split(".")[:2]) >= OLDEST
    except ImportError:
        raise InputError(
            Problem(
                "OpenCV",
                message(
                    "targets_no_opencv",
                    "not installed; expected: {command}",
                    command=install_command("images"),
                ),
            )
        ) from None
    if not (is_usable and hasattr(cv2, "aruco")):
        expected = message(
            "targets_old_opencv",
            "found version {version}; expected 4.7 or later: {command}",
            version=cv2.__version__,
            command=install_command("images"),
        )
        raise InputError(Problem("OpenCV", expected))
    return cv2


@dataclass(frozen=True)
class Dictionary:
    """Codes of a dictionary.

    Attributes
    ----------
    name : str
        Name in OpenCV.
    cells : ndarray, shape (codes, n, n)
        Cells as printed, including the black border: 0 black, 1 white.
    mirrored : frozenset
        Ids whose mirror image is also a code.
    turning : frozenset
        Ids that are unchanged by a rotation of 90 or 180 degrees.
    chance : float
        Probability that random cells inside a black border form a code.
    """

    name: str
    cells: np.ndarray
    mirrored: frozenset
    turning: frozenset
    chance: float


def _full_name(name):
    """Name of a dictionary in OpenCV; raises InputError for an unknown dictionary."""
    known = sorted({key.upper() for key in dir(opencv().aruco) if key.startswith("DICT_")})
    wanted = str(name).upper()
    wanted = wanted if wanted.startswith("DICT_") else f"DICT_{wanted}"
    if wanted not in known:
        expected = message(
            "targets_dictionary",
            "found {found!r}; expected one of {known}",
            found=str(name)[:60],
            known=", ".join(known),
        )
        raise InputError(Problem("dictionary", expected))
    return wanted


@lru_cache(maxsize=4)
def load_dictionary(name):
    """Return the Dictionary of a name, with or without "DICT_"; raise InputError if unknown."""
    aruco = opencv().aruco
    full = _full_name(name)
    codes = aruco.getPredefinedDictionary(getattr(aruco, full))
    inside = int(codes.markerSize)
    n = inside + 2 * BORDER_CELLS
    cells = np.array(
        [
            codes.generateImageMarker(number, n, borderBits=BORDER_CELLS) > 127
            for number in range(len(codes.bytesList))
        ]
    ).astype(np.uint8)
    known_codes = {code.tobytes() for code in cells}
    flipped, turned = set(), set()
    for number, code in enumerate(cells):
        if any(np.rot90(code[:, ::-1], k).tobytes() in known_codes for k in range(4)):
            flipped.add(number)
        if any(np.array_equal(np.rot90(code, k), code) for k in (1, 2, 3)):
            turned.add(number)
    chance = min(4.0 * len(cells) / 2.0 ** (inside**2), 1.0)
    return Dictionary(full, cells, frozenset(flipped), frozenset(turned), chance)


def target_image(dictionary, number, side_px, quiet_cells=1):
    """Create the image of a target for printing, with a white zone around it.

    Parameters
    ----------
    dictionary : str
        Name of the dictionary.
    number : int
        Id of the target.
    side_px : float
        Side of the black square, px, rounded up to a multiple of the number of cells.
    quiet_cells : int, optional
        Width of the white zone, cells.

    Returns
    -------
    ndarray of uint8, shape (m, m)
        Grey values.
    """
    known = load_dictionary(dictionary)
    if not 0 <= number < len(known.cells):
        expected = f"found {number}; expected 0 to {len(known.cells) - 1} of {known.name}"
        raise InputError(Problem("target", expected))
    cells = np.pad(known.cells[number], quiet_cells, constant_values=1)
    pixels = max(1, -(-int(side_px) // known.cells.shape[1]))
    return np.kron(cells * np.uint8(255), np.ones((pixels, pixels), dtype=np.uint8))


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
    for file, row, (number, point) in _read_rows(path, NAMES, log):
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
    for file, row, (photo, point, column, line) in _read_rows(path, PLACES, log):
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


def _read_rows(path, fields, log):
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
                            expected=column.expectation,
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
