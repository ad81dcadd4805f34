"""Cameras as text of a file of another program, or of cameras.toml.

Terms that a form does not contain are approximated by a fit over the frame. The error is returned
with the text.
"""

import re
from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats import balanced, colmap, metashape, opencv, pix4d
from tankcal.camera.formats.texts import NAME_IS, exact_text, short_text
from tankcal.camera.model import KEYS, PARAMETERS, UNITS
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.text.naming import is_name

# Every number in cameras.toml reads back without a change. Only the size of a pixel, which is
# converted to micrometres, may differ by its last bit.
NEIGHBOURS = 4  # neighbouring numbers tried for an exact text in micrometres


def cameras_toml_entry(name, interior, form, size_px, pixel_mm, sds=None, film_mm=None):
    """Entry [cameras.NAME] of cameras.toml, with a final line break.

    Parameters
    ----------
    name : str
        Name of the camera.
    interior : array_like, shape (13,)
        Interior parameters.
    form : Form
        Form of the distortion.
    size_px : sequence of two int
        Columns and lines.
    pixel_mm : float or array_like, shape (2,)
        Size of a pixel, or width and height, mm.
    sds : array_like, shape (13,), optional
        Standard deviations in the order of PARAMETERS; 0 for a held parameter, nan for none.
    film_mm : array_like, shape (2,), optional
        Width and height of a film, which has no pixels, mm.

    Returns
    -------
    str

    Raises
    ------
    InputError
        For an invalid name.

    Notes
    -----
    Parameters with the value 0 and without a standard deviation are omitted, except c, x0 and y0.
    """
    lines = [f"[cameras.{_quote_name(name)}]"]
    if film_mm is None:
        lines += _frame_lines(size_px, pixel_mm)
    else:
        lines.append(f"format_mm = [{', '.join(map(exact_text, film_mm))}]")
    for place, parameter in enumerate(PARAMETERS):
        sd = np.nan if sds is None else float(sds[place])
        # c, x0 and y0 are always written.
        if place < 3 or interior[place] or np.isfinite(sd):
            lines.append(f"{KEYS[parameter]} = {exact_text(interior[place])}")
        if np.isfinite(sd):
            lines.append(f"{make_sd_key(parameter)} = {exact_text(sd)}")
    lines.append(f'affinity = "{form.affinity}"')
    lines.append(f"radial_balance_mm = {exact_text(form.radial_balance_mm)}")
    lines.append(f'convention = "{form.convention}"')
    return "\n".join(lines) + "\n"


def _frame_lines(size_px, pixel_mm):
    """Lines that describe the frame of a camera with pixels."""
    width, height = np.broadcast_to(pixel_mm, 2)
    pixel = _format_micrometres(width)
    if width != height:
        pixel = f"[{pixel}, {_format_micrometres(height)}]"
    return [f"format_px = [{int(size_px[0])}, {int(size_px[1])}]", f"pixel_um = {pixel}"]


def make_sd_key(parameter):
    """Key of the standard deviation of a parameter in cameras.toml."""
    return f"s_{parameter}_mm" if UNITS[parameter] == "mm" else f"s_{parameter}"


def _format_micrometres(pixel_mm):
    """Text of a size in micrometres that gives the same number of millimetres when read."""
    value = float(pixel_mm) * 1e3
    low = high = value
    for _ in range(NEIGHBOURS):
        for candidate in (low, high):
            if candidate * 1e-3 == pixel_mm:
                return exact_text(candidate)
        # Rounding of the unit conversion is undone by trying neighbouring numbers.
        low, high = np.nextafter(low, 0), np.nextafter(high, np.inf)
    return exact_text(value)


def _quote_name(name):
    """Name as a TOML key; raises InputError for an invalid name."""
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
    # TOML requires quotes for names with spaces and other characters.
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else f'"{name}"'


@dataclass(frozen=True)
class CameraText:
    """Text of a camera file.

    Attributes
    ----------
    text : str
        Content of the file.
    error_px : tuple of float
        Largest error of each camera over the frame, px.
    """

    text: str
    error_px: tuple[float, ...]


def write_camera(kind, cameras, sds=None, radius_mm=0.0, file="cameras"):
    """Convert cameras to the text of a file.

    Parameters
    ----------
    kind : str
        One of KINDS; a file of a kind in SINGLE contains one camera.
    cameras : list of (str, FramedCamera)
        Names and cameras.
    sds : list of array_like (13,) or None, optional
        Standard deviations of each camera, written to cameras.toml only.
    radius_mm : float, optional
        R0 of "aicon", mm.
    file : str, optional
        Name of the source of the cameras, for messages.

    Returns
    -------
    CameraText

    Raises
    ------
    InputError
        For an unknown kind, a wrong number of cameras, or a film in a kind that requires pixels.
    SolutionError
        If the distortion folds the image within the frame.
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
    # The nominal pixels of a film must not be written as real pixels.
    if kind not in IN_MM:
        _refuse_film(kind, cameras, file)
    if kind == "cameras.toml":
        return _write_register(cameras, sds)
    if kind == "aicon":
        camera = cameras[0][1]
        converted = balanced.convert_to_balanced(camera, radius_mm)
        return CameraText(balanced.format_text(converted, camera), (converted.error_px,))
    return _write_in_pixels(kind, cameras)


def _refuse_film(kind, cameras, file):
    """Raise InputError for cameras on film, whose pixels are unknown."""
    expected = message(
        "convert_to_pixels",
        "missing; a file of kind {form} is in pixels: expected the size of a pixel, "
        "micrometres (--pixel-um)",
        form=kind,
    )
    problems = [
        Problem(file, expected, None, f"{name}.pixel_um")
        for name, camera in cameras
        if camera.film_mm is not None
    ]
    if problems:
        raise InputError(problems)


def _write_register(cameras, sds):
    """Text of cameras.toml."""
    sds = [None] * len(cameras) if sds is None else sds
    entries = [
        cameras_toml_entry(
            name, camera.interior, camera.form, camera.size_px, camera.pixel_mm, sd, camera.film_mm
        )
        for (name, camera), sd in zip(cameras, sds, strict=True)
    ]
    return CameraText("\n".join(entries), tuple(camera.error_px for _, camera in cameras))


def _write_in_pixels(kind, cameras):
    """Text of a file in pixels; a kind in SINGLE has one camera."""
    converted = [(name, _CONVERTERS[kind](camera)) for name, camera in cameras]
    first, size_px = converted[0][1], cameras[0][1].size_px
    if kind == "opencv":
        text = opencv.format_text(first, size_px)
    elif kind == "opencv-json":
        text = opencv.format_json(first, size_px)
    elif kind == "metashape":
        text = metashape.format_text(first)
    elif kind == "colmap":
        text = colmap.format_text(converted)
    else:
        text = pix4d.format_text(converted)
    return CameraText(text, tuple(camera.error_px for _, camera in converted))


_CONVERTERS = {
    "opencv": opencv.convert_to_opencv,
    "opencv-json": opencv.convert_to_opencv,
    "colmap": colmap.convert_to_colmap,
    "metashape": metashape.convert_to_metashape,
    "pix4d": pix4d.convert_to_pix4d,
}
SINGLE = ("opencv", "opencv-json", "metashape", "aicon")  # kinds with one camera in a file
IN_MM = ("cameras.toml", "aicon")  # kinds that do not require pixels
KINDS = ("cameras.toml", *_CONVERTERS, "aicon")
