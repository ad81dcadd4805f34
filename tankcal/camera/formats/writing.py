"""Cameras as the text of a file of another program, or of cameras.toml.

What a form cannot express is fitted over the frame and stated with the text.
"""

import re
from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats import balanced, colmap, filestorage, metashape, pix4d
from tankcal.camera.formats.opencv import to_opencv
from tankcal.camera.formats.texts import NAME_IS, exact_text, short_text
from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.text.naming import is_name

# The text of an entry of cameras.toml: every number reads back as the same number.
#
# The size of a pixel, which changes its unit on the way, may differ by its last bit.

NEIGHBOURS = 4


def cameras_toml_entry(name, interior, form, size_px, pixel_mm, sds=None, film_mm=None):
    """An entry [cameras.NAME] of cameras.toml, with its final line break.

    name      of the camera                 interior  (13,)        form  its Form
    size_px   (2,) columns, lines           pixel_mm  one number, or width and height
    sds       (13,) standard deviations in the order of PARAMETERS, 0: held; nan: none
    film_mm   (2,) width and height of a film, which has no pixels, or None

    What is 0 and has no standard deviation is left out, but for c, x0 and y0.

    Raises InputError for a name that no camera can have.
    """
    frame = _pixels(size_px, pixel_mm) if film_mm is None else [f"format_mm = {_pair(film_mm)}"]
    lines = [f"[cameras.{_quoted(name)}]", *frame]
    for place, parameter in enumerate(PARAMETERS):
        sd = np.nan if sds is None else float(sds[place])
        if place < 3 or interior[place] or np.isfinite(sd):
            lines.append(f"{value_key(parameter)} = {exact_text(interior[place])}")
        if np.isfinite(sd):
            lines.append(f"{sd_key_of(parameter)} = {exact_text(sd)}")
    lines.append(f'affinity = "{form.affinity}"')
    lines.append(f"radial_balance_mm = {exact_text(form.radial_balance_mm)}")
    lines.append(f'convention = "{form.convention}"')
    return "\n".join(lines) + "\n"


def _pixels(size_px, pixel_mm):
    """Lines of the frame of a camera with pixels."""
    width, height = np.broadcast_to(pixel_mm, 2)
    sizes = [_micrometres(width)] if width == height else list(map(_micrometres, (width, height)))
    pixel = sizes[0] if len(sizes) == 1 else f"[{', '.join(sizes)}]"
    return [f"format_px = [{int(size_px[0])}, {int(size_px[1])}]", f"pixel_um = {pixel}"]


def _pair(values):
    return f"[{', '.join(map(exact_text, values))}]"


def value_key(parameter):
    """Key of a parameter in cameras.toml: its name and its unit."""
    unit = UNITS[parameter]
    return f"{parameter}_{unit}" if unit else parameter


def sd_key_of(parameter):
    """Key of the standard deviation of a parameter in cameras.toml."""
    return f"s_{parameter}_mm" if UNITS[parameter] == "mm" else f"s_{parameter}"


def _micrometres(pixel_mm):
    """Text of a size that, read as micrometres, gives the same number of millimetres again."""
    value = float(pixel_mm) * 1e3
    low = high = value
    for _ in range(NEIGHBOURS):
        for one in (low, high):
            if one * 1e-3 == pixel_mm:
                return exact_text(one)
        low, high = np.nextafter(low, 0), np.nextafter(high, np.inf)
    return exact_text(value)


def _quoted(name):
    if not is_name(name) or name != name.strip():
        raise InputError(
            Problem(
                "cameras.toml",
                message(
                    "convert_register_name",
                    "{found}; expected {expected}",
                    found=short_text(name),
                    expected=NAME_IS,
                ),
            )
        )
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else f'"{name}"'


@dataclass(frozen=True)
class Written:
    """The text of a camera file.

    text      its content
    error_px  of each camera, the largest distance of an image point over the frame
    """

    text: str
    error_px: tuple[float, ...]


def write_camera(kind, cameras, sds=None, radius_mm=0.0, file="cameras"):
    """Written: the text of a file of cameras.

    kind       one of KINDS; files of SINGLE hold one camera
    cameras    [(name, FramedCamera)]
    sds        [(13,) or None] of each camera, which only cameras.toml has a place for; or None
    radius_mm  R0 of "aicon"
    file       what messages call the place where the cameras are from

    Raises InputError for another kind or number of cameras and for a film in a form of pixels,
    SolutionError where the distortion folds the image within the frame.
    """
    if kind not in KINDS:
        expected = message(
            "convert_to_kind",
            "{found} as the kind of file; expected one of {known}",
            found=short_text(kind),
            known=", ".join(KINDS),
        )
        raise InputError(Problem("cameras", expected))
    if not cameras or (kind in SINGLE and len(cameras) > 1):
        expected = message(
            "convert_none_to_write",
            "{count} cameras; expected one or more in a file of kind {form}",
            count=len(cameras),
            form=kind,
        )
        if kind in SINGLE:
            expected = message(
                "convert_one_to_write",
                "{count} cameras; expected one in a file of kind {form}",
                count=len(cameras),
                form=kind,
            )
        raise InputError(Problem("cameras", expected))
    if kind not in IN_MM:
        _refuse_film(kind, cameras, file)
    if kind == "cameras.toml":
        return _register(cameras, sds)
    if kind == "aicon":
        return _aicon(cameras, radius_mm)
    return _WRITERS[kind](cameras)


def _refuse_film(kind, cameras, file):
    """Raise InputError for cameras whose pixels are not known."""
    expected = message(
        "convert_to_pixels",
        "missing; a file of kind {form} is in pixels: expected the size of a pixel, "
        "micrometres (--pixel-um)",
        form=kind,
    )
    problems = [
        Problem(file, expected, None, f"{name}.pixel_um")
        for name, one in cameras
        if one.film_mm is not None
    ]
    if problems:
        raise InputError(problems)


def _register(cameras, sds):
    sds = [None] * len(cameras) if sds is None else sds
    entries = [
        cameras_toml_entry(name, one.interior, one.form, one.size_px, one.pixel_mm, sd, one.film_mm)
        for (name, one), sd in zip(cameras, sds, strict=True)
    ]
    return Written("\n".join(entries), tuple(one.error_px for _, one in cameras))


def _aicon(cameras, radius_mm):
    camera = cameras[0][1]
    found = balanced.to_balanced(camera, radius_mm)
    return Written(balanced.text_of(found, camera), (found.error_px,))


def _opencv(cameras):
    camera = cameras[0][1]
    found = to_opencv(camera)
    return Written(filestorage.text_of(found, camera.size_px), (found.error_px,))


def _opencv_json(cameras):
    camera = cameras[0][1]
    found = to_opencv(camera)
    return Written(filestorage.json_of(found, camera.size_px), (found.error_px,))


def _metashape(cameras):
    found = metashape.to_metashape(cameras[0][1])
    return Written(metashape.text_of(found), (found.error_px,))


def _colmap(cameras):
    found = [(name, colmap.to_colmap(camera)) for name, camera in cameras]
    return Written(colmap.text_of(found), tuple(camera.error_px for _, camera in found))


def _pix4d(cameras):
    found = [(name, pix4d.to_pix4d(camera)) for name, camera in cameras]
    return Written(pix4d.text_of(found), tuple(camera.error_px for _, camera in found))


_WRITERS = {
    "opencv": _opencv,
    "opencv-json": _opencv_json,
    "colmap": _colmap,
    "metashape": _metashape,
    "pix4d": _pix4d,
}
SINGLE = ("opencv", "opencv-json", "metashape", "aicon")  # one camera a file
IN_MM = ("cameras.toml", "aicon")  # forms that need no pixels
KINDS = ("cameras.toml", *_WRITERS, "aicon")
