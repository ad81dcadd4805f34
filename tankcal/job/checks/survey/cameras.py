"""cameras.toml and [adjustment.camera]: format and pixels of a camera, its names and blocks."""

import numpy as np

from tankcal.job.cameras import format_of, parameters_of
from tankcal.job.checking import same_parameter, tell
from tankcal.job.checks.survey.focus import check_focus
from tankcal.job.checks.survey.lens import (
    check_affinity,
    check_convention,
    check_sizes,
    check_states,
)
from tankcal.job.contract.registers import PARAMETER_KEYS, SECOND_NAMES
from tankcal.messages import message

SAME_SIZE = 0.01
SMALLEST_PIXEL_UM, LARGEST_FORMAT_MM = 0.1, 1000
PART_OF_PIXEL = 0.1  # by which a format in mm may miss a whole number of pixels


def check_cameras(files):
    """Each camera by itself, and with the settings of [adjustment.camera]."""
    settings = None if files.values is None else files.values["adjustment.camera"]
    if settings is not None:
        _refuse_two_names(files, settings)
        _refuse_two_blocks(files, settings)
    for name, given in files.registers["cameras"].items():
        is_sound = _check_format(files, name, given)
        check_affinity(files, name, given)
        check_focus(files, name, given)
        if settings is not None:
            parameters = parameters_of(given, settings)
            check_convention(files, name, given, parameters)
            check_states(files, name, parameters)
        if is_sound:
            check_sizes(files, name, given)


def check_calibrations(files, in_pixels=True):
    """Each camera by itself, of a file of cameras that belongs to no job.

    in_pixels  whether the size of a pixel must be known
    """
    none_adjusted = dict.fromkeys((*PARAMETER_KEYS, *SECOND_NAMES.values())) | {"default": "off"}
    for name, given in files.registers["cameras"].items():
        is_sound = _check_format(files, name, given)
        check_affinity(files, name, given)
        check_focus(files, name, given)
        check_convention(files, name, given, parameters_of(given, none_adjusted))
        if is_sound:
            _check_pixels(files, name, given, in_pixels)
            check_sizes(files, name, given)


def _check_pixels(files, name, given, in_pixels):
    """The size of a pixel is known, and the format is a whole number of them."""
    if given["format_px"] is not None:
        return
    if given["pixel_um"] is None:
        if in_pixels and not files.is_given("cameras", name, "pixel_um"):
            expected = message(
                "pixel_missing",
                "missing, but format_mm is given; expected the size of a pixel, or format_px",
            )
            files.tell_key(files.log.problem, "cameras", name, "pixel_um", expected)
        return
    pixels = np.array(given["format_mm"]) / np.broadcast_to(given["pixel_um"], 2) * 1000
    if np.any(np.abs(pixels - np.round(pixels)) > PART_OF_PIXEL):
        columns, lines = pixels
        expected = message(
            "pixels_not_whole",
            "of {columns:.8g} x {lines:.8g} pixels; expected whole ones, or format_px",
            columns=columns,
            lines=lines,
        )
        files.tell_key(files.log.problem, "cameras", name, "format_mm", expected)


def _refuse_two_names(files, settings):
    for name, second in SECOND_NAMES.items():
        if settings[name] is not None and settings[second] is not None:
            expected = same_parameter(name)
            tell(files.log.problem, files.raw, "adjustment.camera", second, expected)


def _refuse_two_blocks(files, settings):
    """One unknown of the whole block cannot be declared with two values."""
    cameras = {
        name: parameters_of(given, settings) for name, given in files.registers["cameras"].items()
    }
    for same in zip(*cameras.values(), strict=True):
        if same[0].scope != "block" or same[0].state != "weighted":
            continue
        for name, parameter in zip(cameras, same, strict=True):
            if (parameter.value or 0.0, parameter.sd) != (same[0].value or 0.0, same[0].sd):
                first = next(iter(cameras))
                expected = message(
                    "block_of_two_values",
                    "its value or standard deviation is not that of {first!r}; expected the "
                    "same: adjustment.camera.{setting} is block weighted",
                    first=first,
                    setting=parameter.setting,
                )
                files.tell_key(files.log.problem, "cameras", name, parameter.key, expected)


def _check_format(files, name, given):
    """Returns whether the format is known."""

    def problem(key, expected):
        files.tell_key(files.log.problem, "cameras", name, key, expected)

    for key, allowed in (("format_mm", (2,)), ("format_px", (2,)), ("pixel_um", (1, 2))):
        if given[key] is not None and len(given[key]) not in allowed:
            expected = message(
                "format_of_two",
                "{count} numbers; expected two, such as [6000, 4000]",
                count=len(given[key]),
            )
            problem(key, expected)
            return False
    has_mm, has_px, has_pixel = (
        files.is_given("cameras", name, key) for key in ("format_mm", "format_px", "pixel_um")
    )
    if not has_mm and not has_px:
        problem(
            "format_mm",
            message(
                "format_missing", "missing; expected [width, height], or format_px with pixel_um"
            ),
        )
        return False
    if has_px and not has_mm and not has_pixel:
        problem(
            "pixel_um",
            message(
                "pixel_missing_beside_px",
                "missing, but format_px is given; expected the size of a pixel, micrometres",
            ),
        )
        return False
    size = format_of(given)[0]
    if size is None:
        return False  # what is wrong is told
    in_px, in_mm = given["format_px"], given["format_mm"]
    if in_px is not None and any(number != round(number) for number in in_px):
        problem("format_px", message("whole_pixels", "expected whole numbers of pixels"))
    if in_px is not None and in_mm is not None and np.any(np.abs(size / in_mm - 1) > SAME_SIZE):
        width, height = size
        expected = message(
            "two_formats",
            "format_px times pixel_um is {width:g} x {height:g} mm; expected the same, or one of "
            "the three left out",
            width=width,
            height=height,
        )
        problem("format_mm", expected)
        return False
    return _check_unit(files, name, given, size)


def _check_unit(files, name, given, size_mm):
    """Is a pixel as large as micrometres make it? Returns whether it is."""
    pixel = given["pixel_um"]
    if pixel is None or (min(pixel) >= SMALLEST_PIXEL_UM and max(size_mm) <= LARGEST_FORMAT_MM):
        return True
    side_um, (width, height) = min(pixel), size_mm
    expected = message(
        "pixel_in_other_unit",
        "found {side_um:g} micrometres makes a format of {width:.4g} x {height:.4g} mm; expected "
        "micrometres: is it in another unit?",
        side_um=side_um,
        width=width,
        height=height,
    )
    if side_um < SMALLEST_PIXEL_UM:
        expected = message(
            "pixel_in_millimetres",
            "found {side_um:g} micrometres makes a format of {width:.4g} x {height:.4g} mm; "
            "expected micrometres: is it in millimetres?",
            side_um=side_um,
            width=width,
            height=height,
        )
    files.tell_key(files.log.problem, "cameras", name, "pixel_um", expected)
    return False
