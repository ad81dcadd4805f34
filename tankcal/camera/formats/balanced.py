"""Cameras in the balanced form of AICON and Zeiss: Ck, Xh, Yh, A1, A2, R0, A3, B1, B2, C1, C2.

With x, y from the principal point, to the right and up, r2 = x2 + y2:

    dx = x (A1 (r2 - R0^2) + A2 (r4 - R0^4) + A3 (r6 - R0^6))
         + B1 (r2 + 2 x2) + 2 B2 x y + C1 x + C2 y
    dy = y (A1 (r2 - R0^2) + ...)          + B2 (r2 + 2 y2) + 2 B1 x y
    measured x = Xh + Ck u/w + dx,   y = Yh + Ck v/w + dy          (Ck is negative)

dx and dy are evaluated at the ideal point. For a protocol that evaluates them at the measured
point, state the convention correction_subtracted. All lengths are in mm.

Source: Luhmann, Robson, Kyle & Boehm, Close-Range Photogrammetry and 3D Imaging, ch. 3.3.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.frame import USUAL, make_film_camera, make_framed_camera
from tankcal.camera.formats.published import convert_camera
from tankcal.camera.formats.texts import duplicate_message, exact_text, short_text
from tankcal.camera.model import Form
from tankcal.messages import message

KEYS = ("Ck", "Xh", "Yh", "A1", "A2", "R0", "A3", "B1", "B2", "C1", "C2")
FILM_KEYS = ("format_width", "format_height")
LARGEST_FILM_MM = 1000
FRAME_KEYS = ("columns", "lines", "pixel_width", "pixel_height", *FILM_KEYS)
CONVENTIONS_OF = ("distortion_of_ideal", "correction_subtracted")
# Indices in camera.PARAMETERS of the KEYS, except R0.
PLACES = {"Ck": 0, "Xh": 1, "Yh": 2, "A1": 3, "A2": 4, "A3": 5}
PLACES |= {"B1": 7, "B2": 8, "C1": 11, "C2": 12}


@dataclass(frozen=True)
class Balanced:
    """Camera of the balanced form.

    Attributes
    ----------
    values : dict of {str: float}
        Values of KEYS, mm.
    convention : str
        One of CONVENTIONS_OF: the point at which the terms are evaluated.
    error_px : float
        Largest error of the conversion over the frame, px.
    covariance : ndarray, shape (13, 13), or None
        Covariance in the order of camera.PARAMETERS; the first row refers to -Ck.
    """

    values: dict
    convention: str = "distortion_of_ideal"
    error_px: float = 0.0
    covariance: np.ndarray | None = None


def convert_from_balanced(camera, pixel_mm, size_px):
    """Convert to a FramedCamera with equal numbers, except for the sign of Ck.

    Parameters
    ----------
    camera : Balanced
        The camera.
    pixel_mm : float or array_like, shape (2,)
        Size of a pixel, or width and height, mm.
    size_px : sequence of two int
        Columns and lines.
    """
    # The balanced form is a form of tankcal, so that no fit is necessary.
    return make_framed_camera(*_interior_of(camera), pixel_mm, size_px)


def convert_film_from_balanced(camera, format_mm):
    """Convert to a FramedCamera on film of a given width and height (2,), mm."""
    return make_film_camera(*_interior_of(camera), format_mm)


def _interior_of(camera):
    """Interior parameters (13,) and Form."""
    interior = np.zeros(13)
    for key, place in PLACES.items():
        interior[place] = camera.values[key]
    # Ck is negative, c positive.
    interior[0] = abs(interior[0])
    return interior, Form(camera.convention, "b1_b2", float(camera.values["R0"]))


def convert_to_balanced(camera, radius_mm, covariance=None):
    """Convert a FramedCamera, exactly for K4 = P3 = P4 = 0 and a suitable convention.

    Parameters
    ----------
    camera : FramedCamera
        The camera.
    radius_mm : float
        R0, mm; 0 without a balance.
    covariance : array_like, shape (13, 13), optional
        Covariance of camera.interior.

    Returns
    -------
    Balanced
    """
    convention = "distortion_of_ideal"
    form = Form(convention, "b1_b2", float(radius_mm))
    converted = convert_camera(
        camera.interior, camera.form, form, camera.size_px, camera.pixel_mm, USUAL, covariance
    )
    values = {key: float(converted.interior[place]) for key, place in PLACES.items()}
    # The radius is not part of the fitted parameters.
    values |= {"Ck": -values["Ck"], "R0": float(radius_mm)}
    ordered = {key: values[key] for key in KEYS}
    return Balanced(ordered, convention, converted.error_px, converted.covariance)


def parse(text, notes):
    """Read a camera from lines such as "Ck -24.1"; problems are added to `notes`.

    The convention and the frame are optional. A # begins a remark.

    Parameters
    ----------
    text : str
        Content of the file.
    notes : Notes
        Receives the problems.

    Returns
    -------
    camera : Balanced
    frame : dict of {str: float}
        Values of FRAME_KEYS in the file.
    """
    values, convention = {}, "distortion_of_ideal"
    for row, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        key = words[0]
        if len(words) != 2:
            notes.add(
                message("convert_key_and_number", "expected a key and one number"),
                row,
                short_text(key),
            )
        elif key in values:
            notes.add(duplicate_message(), row, key)
        elif key == "convention":
            convention = words[1]
            if convention not in CONVENTIONS_OF:
                notes.add(
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
            lower_limit = 0 if key in FRAME_KEYS else None
            values[key] = notes.number(words[1], row, key, above=lower_limit)
        else:
            notes.add(
                message(
                    "convert_balanced_unknown",
                    "unknown; expected {known}",
                    known=", ".join((*KEYS, *FRAME_KEYS)),
                ),
                row,
                short_text(key),
            )
    # The camera is created even with problems, so that a single run reports all problems.
    _check_values(values, notes)
    camera = Balanced({key: values.get(key, 0.0) for key in KEYS}, convention)
    return camera, {key: values[key] for key in FRAME_KEYS if key in values}


def _check_values(values, notes):
    """Check required keys and signs; problems are added to `notes`."""
    for key in ("Ck", "R0"):
        if key not in values:
            notes.add(
                message(
                    "convert_balanced_missing",
                    "missing; expected a number (R0 is 0 when not balanced)",
                ),
                key=key,
            )
    if values.get("Ck", -1) >= 0:
        notes.add(
            message(
                "convert_balanced_ck",
                "found {found:g}; expected a negative number, mm",
                found=values["Ck"],
            ),
            key="Ck",
        )
    for key in FILM_KEYS:
        if values.get(key, 0) > LARGEST_FILM_MM:
            notes.add(
                message(
                    "convert_balanced_film",
                    "found {found:g}; expected mm, at most {most}",
                    found=values[key],
                    most=LARGEST_FILM_MM,
                ),
                key=key,
            )
    if values.get("R0", 0) < 0:
        notes.add(message("convert_balanced_radius", "below 0; expected a radius in mm"), key="R0")


def format_text(camera, framed_camera):
    """Text of a Balanced camera and of its frame."""
    lines = ["# camera in the balanced form: mm, x to the right, y up"]
    lines += [f"{key} {exact_text(value)}" for key, value in camera.values.items()]
    lines += [f"convention {camera.convention}"]
    # A film has a format; a digital camera has columns, lines and pixels.
    keys, frame = FILM_KEYS, framed_camera.film_mm
    if frame is None:
        keys = [key for key in FRAME_KEYS if key not in FILM_KEYS]
        frame = (*framed_camera.size_px, *framed_camera.pixel_mm)
    for key, value in zip(keys, frame, strict=True):
        lines.append(f"{key} {value if isinstance(value, int) else exact_text(value)}")
    return "\n".join(lines) + "\n"
