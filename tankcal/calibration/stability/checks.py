"""Can these calibrations be compared? One frame, one pixel, points enough, a method that is one."""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message

SAME_PIXEL = 2e-3  # programs with two focal lengths give calibrations pixels that differ a little
MOST_DIFFERENCES = 20_000_000  # pairs times grid points


def check_options(method, methods, threshold_px, seed):
    """Raises InputError for a method, a threshold or a seed that is none."""
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
    """Neither too few points for the unknowns nor more differences than memory holds."""
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
    """(columns, lines) of all the setups; raises InputError where they are not of one frame."""
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
    for one in setups[1:]:
        complaint = _complaint(one, first, frame)
        if complaint:
            problems.append(Problem(file, complaint, None, one.camera.name))
    if problems:
        raise InputError(problems)
    return int(frame[0]), int(frame[1])


def _complaint(one, first, frame):
    """What keeps a setup from being compared with the first, in words; None: nothing."""
    of_first = first.camera.name
    if np.any(one.format_px != frame):
        return message(
            "compare_frame",
            "a frame of {found} px; expected {frame}, as {first} has",
            found=_sides(one.format_px),
            frame=_sides(frame),
            first=of_first,
        )
    if np.all(np.abs(one.pixel_mm / first.pixel_mm - 1) <= SAME_PIXEL):
        return None
    return message(
        "compare_pixel",
        "a pixel of {found} micrometres; expected that of {first}, {pixel}, within {percent:g} %",
        found=_sides(1000 * one.pixel_mm),
        first=of_first,
        pixel=_sides(1000 * first.pixel_mm),
        percent=100 * SAME_PIXEL,
    )


def _sides(two):
    return f"{two[0]:.8g} x {two[1]:.8g}"
