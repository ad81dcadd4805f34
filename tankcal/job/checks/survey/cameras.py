"""Checks of cameras.toml and [adjustment.camera]: format and pixels, names, block parameters."""

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

SAME_SIZE = 0.01  # largest relative difference of two statements of the format
SMALLEST_PIXEL_UM, LARGEST_FORMAT_MM = 0.1, 1000  # limits of plausible units
PART_OF_PIXEL = 0.1  # largest difference of a format from whole pixels, in pixels


def check_cameras(files):
    """Check each camera alone and with the settings of [adjustment.camera]."""
    settings = None if files.values is None else files.values["adjustment.camera"]
    if settings is not None:
        _refuse_two_names(files, settings)
        _refuse_two_blocks(files, settings)
    for name, given in files.registers["cameras"].items():
        is_valid = _check_format(files, name, given)
        check_affinity(files, name, given)
        check_focus(files, name, given)
        if settings is not None:
            parameters = parameters_of(given, settings)
            check_convention(files, name, given, parameters)
            check_states(files, name, parameters)
        if is_valid:
            check_sizes(files, name, given)


def check_calibrations(files, in_pixels=True):
    """Check each camera of a file that belongs to no job.

    in_pixels is True if the size of a pixel is required.
    """
    none_adjusted = dict.fromkeys((*PARAMETER_KEYS, *SECOND_NAMES.values())) | {"default": "off"}
    for name, given in files.registers["cameras"].items():
        is_valid = _check_format(files, name, given)
        check_affinity(files, name, given)
        check_focus(files, name, given)
        check_convention(files, name, given, parameters_of(given, none_adjusted))
        if is_valid:
            _check_pixels(files, name, given, in_pixels)
            check_sizes(files, name, given)


def _check_pixels(files, name, given, in_pixels):
    """Require the size of a pixel, and a format of whole pixels."""
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
    """Refuse different values of a parameter that is common to the whole block."""
    cameras = {
        name: parameters_of(given, settings) for name, given in files.registers["cameras"].items()
    }
    for same_parameters in zip(*cameras.values(), strict=True):
        if same_parameters[0].scope != "block" or same_parameters[0].state != "weighted":
            continue
        for name, parameter in zip(cameras, same_parameters, strict=True):
            if (parameter.value or 0.0, parameter.sd) != (
                same_parameters[0].value or 0.0,
                same_parameters[0].sd,
            ):
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
    """Check the keys of the format; returns True if the format is known."""

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
        return False  # reported already
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
    """Return True if the size of a pixel is plausible in micrometres."""
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
