"""Cameras in the balanced form of AICON (and Zeiss): Ck, Xh, Yh, A1, A2, R0, A3, B1, B2, C1, C2.

With x, y from the principal point, to the right and up, r2 = x2 + y2,

    dx = x (A1 (r2 - R0^2) + A2 (r4 - R0^4) + A3 (r6 - R0^6))
         + B1 (r2 + 2 x2) + 2 B2 x y + C1 x + C2 y
    dy = y (A1 (r2 - R0^2) + ...)          + B2 (r2 + 2 y2) + 2 B1 x y
    measured x = Xh + Ck u/w + dx,   y = Yh + Ck v/w + dy          (Ck is negative)

dx, dy are those of the ideal point; where a protocol takes them at the measured one, name the
convention correction_subtracted. mm.

Source: Luhmann, Robson, Kyle & Boehm, Close-Range Photogrammetry and 3D Imaging, ch. 3.3.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.fitting import USUAL
from tankcal.camera.formats.frame import make_film_camera, make_framed_camera
from tankcal.camera.formats.published import convert_camera
from tankcal.camera.formats.texts import exact_text, given_twice, short_text
from tankcal.camera.model import Form
from tankcal.messages import message

KEYS = ("Ck", "Xh", "Yh", "A1", "A2", "R0", "A3", "B1", "B2", "C1", "C2")
FILM_KEYS = ("format_width", "format_height")
LARGEST_FILM_MM = 1000
FRAME_KEYS = ("columns", "lines", "pixel_width", "pixel_height", *FILM_KEYS)
CONVENTIONS_OF = ("distortion_of_ideal", "correction_subtracted")
# places of KEYS, R0 apart, in the order of camera.PARAMETERS
PLACES = {"Ck": 0, "Xh": 1, "Yh": 2, "A1": 3, "A2": 4, "A3": 5}
PLACES |= {"B1": 7, "B2": 8, "C1": 11, "C2": 12}


@dataclass(frozen=True)
class Balanced:
    """A camera of the balanced form.

    values      {key: number} of KEYS, mm
    convention  at which point the terms are taken, see above
    error_px    largest distance of an image point over the frame from the camera that was converted
    covariance  (13, 13) in the order of camera.PARAMETERS (its first row is that of -Ck), or None
    """

    values: dict
    convention: str = "distortion_of_ideal"
    error_px: float = 0.0
    covariance: np.ndarray | None = None


def from_balanced(camera, pixel_mm, size_px):
    """FramedCamera: the same numbers, but for the sign of Ck.

    pixel_mm  one number, or width and height        size_px  (columns, lines)
    """
    return make_framed_camera(*_interior_of(camera), pixel_mm, size_px)


def film_from_balanced(camera, format_mm):
    """FramedCamera of a film (2,) width and height, mm; see from_balanced."""
    return make_film_camera(*_interior_of(camera), format_mm)


def _interior_of(camera):
    """(13,) and Form."""
    interior = np.zeros(13)
    for key, place in PLACES.items():
        interior[place] = camera.values[key]
    interior[0] = abs(interior[0])
    return interior, Form(camera.convention, "b1_b2", float(camera.values["R0"]))


def to_balanced(camera, radius_mm, convention="distortion_of_ideal", covariance=None):
    """Balanced of a FramedCamera: exact where K4, P3, P4 are 0 and the convention suits.

    radius_mm   R0, 0: not balanced
    covariance  (13, 13) of camera.interior, or None
    """
    form = Form(convention, "b1_b2", float(radius_mm))
    found = convert_camera(
        camera.interior, camera.form, form, camera.size_px, camera.pixel_mm, USUAL, covariance
    )
    values = {key: float(found.interior[place]) for key, place in PLACES.items()}
    values |= {"Ck": -values["Ck"], "R0": float(radius_mm)}
    ordered = {key: values[key] for key in KEYS}
    return Balanced(ordered, convention, found.error_px, found.covariance)


def parse(text, notes):
    """(Balanced, {frame key: number}) of lines such as Ck -24.1, or None; problems go to notes.

    The convention and the frame may be left out. A # begins a remark.
    """
    values, convention = {}, "distortion_of_ideal"
    for row, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        key = words[0]
        if len(words) != 2:
            notes.tell(
                message("convert_key_and_number", "expected a key and one number"),
                row,
                short_text(key),
            )
        elif key in values:
            notes.tell(given_twice(), row, key)
        elif key == "convention":
            convention = words[1]
            if convention not in CONVENTIONS_OF:
                notes.tell(
                    message(
                        "convert_conventions",
                        "expected one of {names}",
                        names=", ".join(CONVENTIONS_OF),
                    ),
                    row,
                    key,
                )
        elif key in ("columns", "lines"):
            values[key] = notes.count(words[1], row, key)
        elif key in KEYS or key in FRAME_KEYS:
            low = 0 if key in FRAME_KEYS else None
            values[key] = notes.number(words[1], row, key, above=low)
        else:
            notes.tell(
                message(
                    "convert_balanced_unknown",
                    "unknown; expected {known}",
                    known=", ".join((*KEYS, *FRAME_KEYS)),
                ),
                row,
                short_text(key),
            )
    _check(values, notes)
    camera = Balanced({key: values.get(key, 0.0) for key in KEYS}, convention)
    return camera, {key: values[key] for key in FRAME_KEYS if key in values}


def _check(values, notes):
    for key in ("Ck", "R0"):
        if key not in values:
            notes.tell(
                message(
                    "convert_balanced_missing",
                    "missing; expected a number (R0 is 0 when not balanced)",
                ),
                key=key,
            )
    if values.get("Ck", -1) >= 0:
        notes.tell(
            message(
                "convert_balanced_ck",
                "found {found:g}; expected a negative number, mm",
                found=values["Ck"],
            ),
            key="Ck",
        )
    for key in FILM_KEYS:
        if values.get(key, 0) > LARGEST_FILM_MM:
            notes.tell(
                message(
                    "convert_balanced_film",
                    "found {found:g}; expected mm, at most {most}",
                    found=values[key],
                    most=LARGEST_FILM_MM,
                ),
                key=key,
            )
    if values.get("R0", 0) < 0:
        notes.tell(message("convert_balanced_radius", "below 0; expected a radius in mm"), key="R0")


def _written(value):
    return str(value) if isinstance(value, int) else exact_text(value)


def text_of(camera, framed_camera):
    """The lines of a Balanced camera and of its frame."""
    lines = ["# camera in the balanced form: mm, x to the right, y up"]
    lines += [f"{key} {exact_text(value)}" for key, value in camera.values.items()]
    lines += [f"convention {camera.convention}"]
    keys, frame = FILM_KEYS, framed_camera.film_mm
    if frame is None:
        keys = [key for key in FRAME_KEYS if key not in FILM_KEYS]
        frame = (*framed_camera.size_px, *framed_camera.pixel_mm)
    lines += [f"{key} {_written(value)}" for key, value in zip(keys, frame, strict=True)]
    return "\n".join(lines) + "\n"
