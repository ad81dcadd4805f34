"""The text of an entry of cameras.toml: every number reads back as the same number.

The size of a pixel, which changes its unit on the way, may differ by its last bit.
"""

import re

import numpy as np

from tankcal.camera.formats.texts import NAME_IS, exactly, shown
from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.text.naming import is_name

NEIGHBOURS = 4


def as_cameras_toml(name, interior, form, size_px, pixel_mm, sds=None, film_mm=None):
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
            lines.append(f"{value_key(parameter)} = {exactly(interior[place])}")
        if np.isfinite(sd):
            lines.append(f"{sd_key_of(parameter)} = {exactly(sd)}")
    lines.append(f'affinity = "{form.affinity}"')
    lines.append(f"radial_balance_mm = {exactly(form.radial_balance_mm)}")
    lines.append(f'convention = "{form.convention}"')
    return "\n".join(lines) + "\n"


def _pixels(size_px, pixel_mm):
    """Lines of the frame of a camera with pixels."""
    width, height = np.broadcast_to(pixel_mm, 2)
    sizes = [_micrometres(width)] if width == height else list(map(_micrometres, (width, height)))
    pixel = sizes[0] if len(sizes) == 1 else f"[{', '.join(sizes)}]"
    return [f"format_px = [{int(size_px[0])}, {int(size_px[1])}]", f"pixel_um = {pixel}"]


def _pair(values):
    return f"[{', '.join(map(exactly, values))}]"


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
                return exactly(one)
        low, high = np.nextafter(low, 0), np.nextafter(high, np.inf)
    return exactly(value)


def _quoted(name):
    if not is_name(name) or name != name.strip():
        raise InputError(
            Problem(
                "cameras.toml",
                message(
                    "convert_register_name",
                    "{found}; expected {expected}",
                    found=shown(name),
                    expected=NAME_IS,
                ),
            )
        )
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else f'"{name}"'
