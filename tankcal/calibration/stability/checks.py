"""Checks before a comparison of calibrations: options, common frame and pixel, number of points."""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message

# Largest relative difference of pixel sizes; programs with two focal lengths give slightly
# different pixels for each calibration
SAME_PIXEL = 2e-3
MOST_DIFFERENCES = 20_000_000  # largest number of pairs times grid points


def check_options(method, methods, threshold_px, seed):
    """Raise InputError for an invalid method, threshold (px) or seed."""
    problems = []
    if method not in methods:
        expected = message(
            "compare_method",
            "found {found!r}; expected {methods}",
            found=str(method)[:60],
            methods=", ".join(methods),
        )
        problems.append(Problem("--method", expected))
    if not (np.isfinite(threshold_px) and threshold_px > 0):
        expected = message(
            "compare_threshold",
            "found {found}; expected pixels above 0, such as 0.5 or 0.33",
            found=threshold_px,
        )
        problems.append(Problem("--threshold", expected))
    if seed < 0:
        problems.append(
            Problem(
                "--seed",
                message(
                    "compare_seed", "found {seed}; expected a whole number, 0 or more", seed=seed
                ),
            )
        )
    if problems:
        raise InputError(problems)


def check_size(cameras, grid, unknowns, file):
    """Raise InputError for too few points for the unknowns, or too many differences for memory.

    Parameters
    ----------
    cameras : int
        Number of calibrations.
    grid : Grid
        Grid of image points.
    unknowns : int
        Number of unknowns of the method.
    file : str
        Name of the file of the calibrations in messages.
    """
    if 2 * grid.size <= unknowns:
        expected = message(
            "compare_few_points",
            "{count} points; expected more than {least} for this method",
            count=grid.size,
            least=unknowns // 2,
        )
        raise InputError(Problem("--grid", expected))
    count = cameras * (cameras - 1) // 2
    if count * grid.size > MOST_DIFFERENCES:
        expected = message(
            "compare_too_many",
            "{count} pairs of {points} points; expected fewer calibrations or points",
            count=count,
            points=grid.size,
        )
        raise InputError(Problem(file, expected))


def common_frame(setups, file):
    """Return the common frame (columns, lines); raise InputError if the frames differ."""
    if len(setups) < 2:
        expected = message(
            "compare_too_few",
            "{count} calibration; expected two or more to compare",
            count=len(setups) or message("compare_none", "no"),
        )
        raise InputError(Problem(file, expected))
    lacking = [setup.camera.name for setup in setups if setup.pixel_mm is None]
    if lacking:
        expected = message(
            "compare_no_pixel", "the size of a pixel is not known; expected format_px with pixel_um"
        )
        raise InputError([Problem(file, expected, None, name) for name in lacking])
    first, frame = setups[0], setups[0].format_px
    problems = []
    for setup_to_check in setups[1:]:
        complaint = _why_not_comparable(setup_to_check, first, frame)
        if complaint:
            problems.append(Problem(file, complaint, None, setup_to_check.camera.name))
    if problems:
        raise InputError(problems)
    return int(frame[0]), int(frame[1])


def _why_not_comparable(setup, first, frame):
    """Message why a setup cannot be compared with the first, or None."""
    first_name = first.camera.name
    if np.any(setup.format_px != frame):
        return message(
            "compare_frame",
            "a frame of {found} px; expected {frame}, as {first} has",
            found=_format_sides(setup.format_px),
            frame=_format_sides(frame),
            first=first_name,
        )
    if np.all(np.abs(setup.pixel_mm / first.pixel_mm - 1) <= SAME_PIXEL):
        return None
    return message(
        "compare_pixel",
        "a pixel of {found} micrometres; expected that of {first}, {pixel}, within {percent:g} %",
        found=_format_sides(1000 * setup.pixel_mm),
        first=first_name,
        pixel=_format_sides(1000 * first.pixel_mm),
        percent=100 * SAME_PIXEL,
    )


def _format_sides(pair):
    return f"{pair[0]:.8g} x {pair[1]:.8g}"
