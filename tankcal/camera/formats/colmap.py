"""Cameras of COLMAP: models SIMPLE_PINHOLE to FULL_OPENCV, and cameras.txt.

    CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]

The models equal those of OpenCV, except for the origin: the corner of the first pixel is 0, 0, and
its centre 0.5, 0.5.

Source: COLMAP's documentation, camera models and output format.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.brown import Terms, convert_to_brown
from tankcal.camera.formats.opencv import OpenCV, convert_from_opencv
from tankcal.camera.formats.texts import exact_text, short_text
from tankcal.messages import message

MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
HALF = 0.5  # px, from the corner of a pixel to its centre
EXACT_PX = 1e-9  # error below which a conversion counts as exact


@dataclass(frozen=True)
class Colmap:
    """Camera of COLMAP.

    Attributes
    ----------
    model : str
        One of MODELS.
    size_px : tuple of int
        Columns and lines.
    params : tuple
        Parameters named in MODELS, px; distortion for rays.
    error_px : float
        Largest error of the conversion over the frame, px.
    """

    model: str
    size_px: tuple[int, int]
    params: tuple
    error_px: float = 0.0


def convert_from_colmap(camera, pixel_mm):
    """Convert to a FramedCamera in the plain Form().

    Parameters
    ----------
    camera : Colmap
        The camera.
    pixel_mm : float
        Height of a pixel, mm; the width follows from fx and fy.

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.
    """
    values = dict(zip(MODELS[camera.model], camera.params, strict=True))
    fx, fy = values.get("fx", values.get("f")), values.get("fy", values.get("f"))
    # COLMAP counts from the corner of the first pixel, OpenCV from its centre.
    matrix = [[fx, 0, values["cx"] - HALF], [0, fy, values["cy"] - HALF], [0, 0, 1]]
    coefficients = np.array([values.get(name, 0.0) for name in ORDER])
    return convert_from_opencv(OpenCV(np.array(matrix), coefficients), pixel_mm, camera.size_px)


def convert_to_colmap(camera, model=None):
    """Convert a FramedCamera, exactly if the model has all terms, else by a fit.

    Parameters
    ----------
    camera : FramedCamera
        The camera.
    model : str, optional
        One of MODELS. None: the simplest exact model, else FULL_OPENCV.

    Returns
    -------
    Colmap
    """
    if model is not None:
        return _convert_to_model(camera, model)
    # MODELS are ordered by complexity.
    for name in MODELS:
        converted = _convert_to_model(camera, name)
        if converted.error_px < EXACT_PX:
            break
    return converted


def _convert_to_model(camera, model):
    """Convert a FramedCamera to a model of COLMAP."""
    names = MODELS[model]
    terms = Terms(
        radial=sum(name in names for name in ("k1", "k2", "k3")),
        decentring=2 if "p1" in names else 0,
        two_focals="fx" in names,
        skew=False,
    )
    brown, error = convert_to_brown(camera, terms)
    values = {
        "f": brown.fy,
        "fx": brown.fx,
        "fy": brown.fy,
        "cx": brown.cx + HALF,
        "cy": brown.cy + HALF,
    }
    # COLMAP has no p3, p4 and k4; the rational terms are zero.
    values |= dict(zip(ORDER, (*brown.k[:2], *brown.p[:2], brown.k[2], 0.0, 0.0, 0.0), strict=True))
    return Colmap(model, camera.size_px, tuple(values[name] for name in names), error)


def parse(text, notes):
    """Cameras [(name, Colmap)] of a cameras.txt; problems are added to `notes`."""
    cameras = []
    for row, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        camera = _parse_camera(words, row, notes)
        if camera is None:
            continue
        name = notes.name(words[0], row, "CAMERA_ID")
        # A repeated camera is reported, but kept, so that all problems are found.
        if name in [other for other, _ in cameras]:
            notes.add(
                message(
                    "convert_colmap_twice",
                    "camera {name} is given twice; expected each camera once",
                    name=short_text(name),
                ),
                row,
                "CAMERA_ID",
            )
        cameras.append((name, camera))
    if not cameras and not notes.problems:
        notes.add(
            message(
                "convert_colmap_none",
                "no camera; expected lines such as 1 OPENCV 4000 3000 and its parameters",
            )
        )
    return cameras


def _parse_camera(words, row, notes):
    """Colmap from the words of a line, or None; problems are added to `notes`."""
    if len(words) < 4:
        notes.add(
            message(
                "convert_colmap_cut",
                "incomplete line; expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS",
            ),
            row,
        )
        return None
    model = words[1]
    if model not in MODELS:
        expected = message(
            "convert_colmap_model",
            "camera model {model}; those read are {models}",
            model=short_text(model),
            models=", ".join(MODELS),
        )
        notes.add(expected, row, "MODEL")
        return None
    names, texts = MODELS[model], words[4:]
    if len(texts) != len(names):
        expected = message(
            "convert_colmap_parameters",
            "{count} parameters of {model}; expected {expected}: {names}",
            count=len(texts),
            model=model,
            expected=len(names),
            names=" ".join(names),
        )
        notes.add(expected, row, "PARAMS")
        return None
    size = (notes.count(words[2], row, "WIDTH"), notes.count(words[3], row, "HEIGHT"))
    params = tuple(
        notes.number(text, row, name, above=0 if name[0] == "f" else None)
        for name, text in zip(names, texts, strict=True)
    )
    return Colmap(model, size, params)


def format_text(cameras):
    """Text of a cameras.txt for [(name, Colmap)]; names that are no numbers become numbers."""
    # Cameras are numbered unless every name is a number.
    are_numbers = all(name.isdecimal() and name.isascii() for name, _ in cameras)
    lines = ["# Camera list with one line of data per camera:"]
    lines += [
        "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
        f"# Number of cameras: {len(cameras)}",
    ]
    for number, (name, camera) in enumerate(cameras, 1):
        head = (name if are_numbers else str(number), camera.model, *map(str, camera.size_px))
        lines.append(" ".join((*head, *map(exact_text, camera.params))))
    return "\n".join(lines) + "\n"
