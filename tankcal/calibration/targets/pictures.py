"""Photographs from files: grey values as stored, never turned, never of a size that bursts."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal.calibration.targets.headers import header_of
from tankcal.calibration.targets.opencv import opencv
from tankcal.job.fields import Field, read_value
from tankcal.job.tables import read_bytes
from tankcal.messages import message

MOST_PIXELS = 250_000_000
LEAST_SIDE_PX = 32
MOST_BYTES = 1_000_000_000
KINDS = message("targets_kinds", "a JPEG, PNG, TIFF or BMP picture")
PHOTO = Field("photo", "name", "the photo")
ENCODINGS = ("by_file", "linear", "srgb")
JPEG_START = b"\xff\xd8"


@dataclass(frozen=True)
class Picture:
    """A photograph.

    image        (lines, columns) float32, 0 to 255, in proportion to light
    encoding     how its grey values were taken: "linear" or "srgb"
    orientation  what the file says about turning it, 1: nothing; never applied
    """

    image: np.ndarray
    encoding: str
    orientation: int


def photo_name(path):
    """Name of the photo: that of its file without the ending. Raises Refused."""
    return read_value(PHOTO, Path(path).stem)


def read_picture(path, log, encoding="by_file"):
    """Picture of a file, or None after telling `log`.

    encoding  "linear": grey values as stored; "srgb": brought back to amounts of light first;
              "by_file": srgb for JPEG, as cameras write it, else linear
    """
    path = Path(path)
    data = read_bytes(path, log, MOST_BYTES)
    if data is None:
        return None
    header = header_of(data)
    if header is None:
        return log.problem(
            path.name,
            message(
                "targets_no_picture", "no picture that can be read; expected {kinds}", kinds=KINDS
            ),
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
    image = _decoded(data)
    if image is None or image.shape != (lines, columns):
        return log.problem(
            path.name,
            message("targets_damaged", "damaged: it cannot be decoded as its header says"),
        )
    if encoding == "by_file":
        encoding = "srgb" if data.startswith(JPEG_START) else "linear"
    return Picture(_light(image, encoding), encoding, header.orientation)


def _decoded(data):
    cv2 = opencv()
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        return cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error:
        return None


def _light(image, encoding):
    """Grey values 0 to 255, float32; of 16-bit pictures the range that is used."""
    most = {"uint8": 255.0, "uint16": 65535.0}.get(str(image.dtype))
    light = image.astype(np.float32)
    if most is None:
        light = np.nan_to_num(light, nan=0.0, posinf=0.0, neginf=0.0)
        most = max(float(light.max()), 1e-9)
    elif most > 255:
        most = max(float(light.max()), 1.0)  # 12-bit cameras store 16 bits
    light *= np.float32(1 / most)
    if encoding == "srgb":
        light = np.where(light <= 0.04045, light / 12.92, ((light + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32) * np.float32(255)
