"""Interface to camera files of other programs: reading, writing, and cameras.toml.

kind       file
opencv     YAML and XML of FileStorage, JSON with K and dist; opencv-json has the same meaning
colmap     cameras.txt
metashape  XML of a calibration
pix4d      PROJECT_pix4d_calibrated_internal_camera_parameters.cam
aicon      lines of the balanced form, such as Ck -24.1

The files of OpenCV, COLMAP and Metashape do not contain the size of a pixel.

Terms that a form does not contain are approximated by a fit over the frame. The error is returned
with the text.
"""

import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from tankcal.camera.formats import (
    balanced,
    opencv,
    photogrammetry,
)
from tankcal.camera.formats.texts import (
    LONGEST,
    NAME_IS,
    Notes,
    exact_text,
    make_valid_name,
    short_text,
)
from tankcal.camera.model import KEYS, PARAMETERS, UNITS
from tankcal.errors import InputError, Problem, SolutionError, reason_of
from tankcal.messages import message
from tankcal.text.delimited import decode_text
from tankcal.text.naming import is_name

SAME_PIXEL = 0.01  # relative tolerance between the pixel in the file and the given pixel
PIXELS_UM = (0.1, 100.0)  # range of pixels of cameras and scanners
KINDS = ("opencv", "opencv-json", "colmap", "metashape", "pix4d", "aicon")


def read_camera(path, kind=None, pixel_um=None, size_px=None):
    """Read the cameras of a file of another program.

    Parameters
    ----------
    path : str or Path
        The file.
    kind : str, optional
        One of KINDS; by default recognised from the content.
    pixel_um : float, optional
        Height of a pixel, um. Required for OpenCV, COLMAP and Metashape; compared with the file for
        other kinds.
    size_px : sequence of two int, optional
        Columns and lines, if the file does not contain them (OpenCV, Pix4D, AICON).

    Returns
    -------
    list of (str, FramedCamera)

    Raises
    ------
    InputError
        With every problem of the file.
    """
    path = Path(path)
    notes = Notes(path.name or str(path))
    text = _read_text(path, notes)
    notes.raise_problems()
    return parse_cameras(text, notes.file, kind, pixel_um, size_px)


def parse_cameras(text, file, kind=None, pixel_um=None, size_px=None):
    """Read the cameras from the text of a file.

    Parameters
    ----------
    text : str
        Content of the file.
    file : str
        Name of the file, for messages.
    kind, pixel_um, size_px
        As in `read_camera`.

    Returns
    -------
    list of (str, FramedCamera)

    Raises
    ------
    InputError
        With every problem of the file.
    """
    notes = Notes(file)
    _check_arguments(kind, pixel_um, size_px, notes)
    kind = kind or _recognise_kind(text, notes)
    notes.raise_problems()
    parsed = _PARSERS[kind](text, notes, file, size_px)
    # Only files of Pix4D and AICON can determine the size of a pixel.
    needs_pixel = kind not in ("pix4d", "aicon")
    if needs_pixel and pixel_um is None:
        expected = message(
            "convert_pixel_missing",
            "missing; a file of kind {form} does not hold it: give it in micrometres",
            form=kind,
        )
        notes.add(expected, key="pixel_um")
    notes.raise_problems()
    pixel_mm = None if pixel_um is None else pixel_um * 1e-3
    # Conversion starts only after all problems of the text are known.
    cameras = []
    for name, convert in parsed:
        try:
            cameras.append((name, convert(pixel_mm)))
        except SolutionError as error:
            text = message(
                "convert_cannot",
                "camera {camera} cannot be converted: {error}",
                camera=short_text(name),
                error=error.texts[0],
            )
            notes.add(text)
    notes.raise_problems()
    return cameras


def _check_arguments(kind, pixel_um, size_px, notes):
    """Check kind, pixel and size; problems are added to `notes`."""
    if kind is not None and kind not in KINDS:
        notes.add(
            message(
                "convert_kind",
                "{found} as the kind of file; expected one of {known}",
                found=short_text(kind),
                known=", ".join(KINDS),
            )
        )
    if (
        pixel_um is not None
        and not PIXELS_UM[0] <= notes.number(pixel_um, key="pixel_um") <= PIXELS_UM[1]
    ):
        notes.add(
            message(
                "convert_pixel_range",
                "{found}; expected micrometres, 0.1 to 100",
                found=short_text(pixel_um),
            ),
            key="pixel_um",
        )
    if size_px is not None:
        for number, key in zip(size_px, ("columns", "lines"), strict=True):
            notes.count(number, key=key)


def _read_text(path, notes):
    """Text of a file, or None; problems are added to `notes`."""
    try:
        if not path.is_file():
            notes.add(message("convert_not_found", "not found; expected a file of cameras"))
            return None
        with path.open("rb") as stream:
            data = stream.read(LONGEST + 1)
    except (OSError, ValueError) as error:
        notes.add(
            message(
                "convert_not_readable",
                "cannot be read ({reason})",
                reason=reason_of(error),
            )
        )
        return None
    # One byte more than the limit is read, to detect a longer file.
    if len(data) > LONGEST:
        notes.add(
            message(
                "convert_too_long",
                "more than {most} bytes; expected a file of cameras",
                most=LONGEST,
            )
        )
        return None
    try:
        text = decode_text(data)
    except UnicodeDecodeError as error:
        notes.add(
            message("convert_no_utf8", "a letter that is not UTF-8"),
            data[: error.start].count(b"\n") + 1,
        )
        return None
    if "\0" in text:
        notes.add(message("convert_no_text", "not text; expected a text file (UTF-8)"))
        return None
    return text


def _recognise_kind(text, notes):
    """Kind of a text, or None; a problem is added to `notes`."""
    # The beginning of the file is sufficient, and limits the search.
    start = text.lstrip()[:2000]
    lines = [line.split() for line in text.splitlines()[:200]]
    words = [line[0] for line in lines if line and not line[0].startswith("#")]
    if start.startswith("<"):
        return "opencv" if f"<{opencv.XML_ROOT}" in text else "metashape"
    if start.startswith(("%YAML", "{")) or "opencv-matrix" in text or "camera_matrix:" in text:
        return "opencv"
    if "camera calibration file" in start.lower() or "camera_calibration_file" in start.lower():
        return "pix4d"
    if "Ck" in words:
        return "aicon"
    # A line of cameras.txt: CAMERA_ID MODEL WIDTH ...
    if any(len(line) > 3 and line[1].isupper() and line[2].isdecimal() for line in lines) or (
        "CAMERA_ID" in start
    ):
        return "colmap"
    notes.add(
        message(
            "convert_not_known",
            "not a known kind of camera file; expected one of {known}",
            known=", ".join(KINDS),
        )
    )
    return None


def _read_opencv(text, notes, file, size_px):
    """Name and converter of an OpenCV camera, as a list."""
    parsed = opencv.parse(text, notes)
    if parsed is None:
        return []
    camera, size = parsed
    size = _resolve_size(size, size_px, notes)
    return [(_name_from_file(file), partial(opencv.convert_from_opencv, camera, size_px=size))]


def _read_colmap(text, notes, _file, _size):
    """Names and converters of the cameras of a cameras.txt."""
    return [
        (name, partial(opencv.convert_from_colmap, camera))
        for name, camera in opencv.parse_colmap(text, notes)
    ]


def _read_metashape(text, notes, file, _size):
    """Name and converter of a Metashape camera, as a list."""
    camera = photogrammetry.parse(text, notes)
    if camera is None:
        return []
    return [(_name_from_file(file), partial(photogrammetry.convert_from_metashape, camera))]


def _read_pix4d(text, notes, _file, size_px):
    """Names and converters of the cameras of a .cam file."""

    cameras = photogrammetry.parse_pix4d(text, notes)
    # The file contains the sensor in mm, but no columns and lines.
    if size_px is None:
        _resolve_size(None, None, notes)
    for name, camera in cameras:
        if (
            size_px is not None
            and not notes.problems
            and not photogrammetry.frame_fits_sensor(camera, size_px)
        ):
            width, height = camera.sensor_mm
            expected = message(
                "convert_proportions",
                "{columns} x {lines} px beside a sensor of {width:g} x {height:g} mm (camera "
                "{camera}); expected the same proportions",
                columns=size_px[0],
                lines=size_px[1],
                width=width,
                height=height,
                camera=name,
            )
            notes.add(expected, key="columns")
    return [(name, partial(_convert_pix4d, camera, size_px)) for name, camera in cameras]


def _convert_pix4d(camera, size_px, pixel_mm):
    """FramedCamera of a Pix4D camera; a given size of a pixel is compared with the file."""
    _refuse_other_pixel(camera.sensor_mm[1] / size_px[1], pixel_mm)
    return photogrammetry.convert_from_pix4d(camera, size_px)


def _read_balanced(text, notes, file, size_px):
    """Name and converter of a camera in the balanced form, as a list."""
    camera, frame = balanced.parse(text, notes)
    film_mm = [frame[key] for key in balanced.FILM_KEYS if key in frame]
    if len(film_mm) == 1:
        notes.add(
            message(
                "convert_one_side_of_film",
                "only one side of a film; expected format_width and format_height",
            ),
            key="format_width",
        )
    # A film has no pixels, so that both statements contradict each other.
    if len(film_mm) == 2 and len(frame) > 2:
        notes.add(
            message(
                "convert_film_and_pixels",
                "given together with pixels; expected a format, or pixels",
            ),
            key="format_width",
        )
    if film_mm:
        return [(_name_from_file(file), partial(_convert_film, camera, film_mm))]
    size_in_file = (
        (frame["columns"], frame["lines"]) if {"columns", "lines"} <= set(frame) else None
    )
    size = _resolve_size(size_in_file, size_px, notes)
    # A single side of a pixel leaves the other side undefined.
    sides = [frame[key] for key in ("pixel_width", "pixel_height") if key in frame]
    if len(sides) == 1:
        notes.add(
            message(
                "convert_one_side_of_pixel",
                "only one side of a pixel; expected pixel_width and pixel_height",
            ),
            key="pixel_width",
        )
    return [(_name_from_file(file), partial(_convert_balanced, camera, sides, size))]


def _convert_balanced(camera, sides, size_px, pixel_mm):
    """FramedCamera of a Balanced camera with the sides of a pixel in the file, or given."""
    if sides:
        _refuse_other_pixel(sides[-1], pixel_mm)
    elif pixel_mm is None:
        raise SolutionError(
            message("convert_no_pixel", "the size of a pixel is missing; give it in micrometres")
        )
    return balanced.convert_from_balanced(camera, sides or pixel_mm, size_px)


def _convert_film(camera, film_mm, pixel_mm):
    """FramedCamera of a Balanced camera on film; without a size of a pixel, it has no pixels."""
    if pixel_mm is None:
        return balanced.convert_film_from_balanced(camera, film_mm)
    # Scanned film: the number of pixels follows from the format.
    size_px = [max(2, round(side / pixel_mm)) for side in film_mm]
    return balanced.convert_from_balanced(camera, pixel_mm, size_px)


def _resolve_size(size_in_file, given_size, notes):
    """Columns and lines of the file, or as given; both may not be missing or differ."""
    if size_in_file is None and given_size is None:
        notes.add(
            message(
                "convert_no_size", "missing; the file does not hold it: give columns and lines"
            ),
            key="format_px",
        )
    elif (
        size_in_file is not None
        and given_size is not None
        and tuple(size_in_file) != tuple(given_size)
    ):
        expected = message(
            "convert_other_size",
            "{columns} x {lines} px; expected {given_columns} x {given_lines}, as given",
            columns=size_in_file[0],
            lines=size_in_file[1],
            given_columns=given_size[0],
            given_lines=given_size[1],
        )
        notes.add(expected, key="format_px")
    return size_in_file or given_size


def _refuse_other_pixel(of_file_mm, given_mm):
    """Raise SolutionError if the pixel in the file and the given pixel differ."""
    # A given pixel only confirms the value in the file.
    if given_mm is not None and abs(of_file_mm / given_mm - 1) > SAME_PIXEL:
        raise SolutionError(
            message(
                "convert_other_pixel",
                "a pixel of {found:.5g} um in the file; expected {given:.5g} um, as given",
                found=of_file_mm * 1e3,
                given=given_mm * 1e3,
            )
        )


def _name_from_file(file):
    return make_valid_name(Path(file).stem)


_PARSERS = {
    "opencv": _read_opencv,
    "opencv-json": _read_opencv,
    "colmap": _read_colmap,
    "metashape": _read_metashape,
    "pix4d": _read_pix4d,
    "aicon": _read_balanced,
}


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
    if kind not in WRITING_KINDS:
        expected = message(
            "convert_to_kind",
            "{found} as the kind of file; expected one of {known}",
            found=short_text(kind),
            known=", ".join(WRITING_KINDS),
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
        text = photogrammetry.format_text(first)
    elif kind == "colmap":
        text = opencv.format_colmap(converted)
    else:
        text = photogrammetry.format_pix4d(converted)
    return CameraText(text, tuple(camera.error_px for _, camera in converted))


_CONVERTERS = {
    "opencv": opencv.convert_to_opencv,
    "opencv-json": opencv.convert_to_opencv,
    "colmap": opencv.convert_to_colmap,
    "metashape": photogrammetry.convert_to_metashape,
    "pix4d": photogrammetry.convert_to_pix4d,
}
SINGLE = ("opencv", "opencv-json", "metashape", "aicon")  # kinds with one camera in a file
IN_MM = ("cameras.toml", "aicon")  # kinds that do not require pixels
WRITING_KINDS = ("cameras.toml", *_CONVERTERS, "aicon")
