"""Can these calibrations be compared? One frame, one pixel, points enough, a method that is one."""

import numpy as np

from tankcal.errors import InputError, Problem

SAME_PIXEL = 2e-3  # programs with two focal lengths give calibrations pixels that differ a little
MOST_DIFFERENCES = 20_000_000  # pairs times grid points


def check_options(method, methods, threshold_px, seed):
    """Raises InputError for a method, a threshold or a seed that is none."""
    problems = []
    if method not in methods:
        expected = f"found {str(method)[:60]!r}; expected {', '.join(methods)}"
        problems.append(Problem("--method", expected))
    if not (np.isfinite(threshold_px) and threshold_px > 0):
        expected = f"found {threshold_px}; expected pixels above 0, such as 0.5 or 0.33"
        problems.append(Problem("--threshold", expected))
    if seed < 0:
        problems.append(Problem("--seed", f"found {seed}; expected a whole number, 0 or more"))
    if problems:
        raise InputError(problems)


def check_size(cameras, grid, unknowns, file):
    """Neither too few points for the unknowns nor more differences than memory holds."""
    if 2 * grid.size <= unknowns:
        expected = f"{grid.size} points; expected more than {unknowns // 2} for this method"
        raise InputError(Problem("--grid", expected))
    count = cameras * (cameras - 1) // 2
    if count * grid.size > MOST_DIFFERENCES:
        expected = f"{count} pairs of {grid.size} points; expected fewer calibrations or points"
        raise InputError(Problem(file, expected))


def common_frame(setups, file):
    """(columns, lines) of all the setups; raises InputError where they are not of one frame."""
    if len(setups) < 2:
        expected = f"{len(setups) or 'no'} calibration; expected two or more to compare"
        raise InputError(Problem(file, expected))
    lacking = [setup.camera.name for setup in setups if setup.pixel_mm is None]
    if lacking:
        expected = "the size of a pixel is not known; expected format_px with pixel_um"
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
        return f"a frame of {_sides(one.format_px)} px; expected {_sides(frame)} as of {of_first}"
    if np.all(np.abs(one.pixel_mm / first.pixel_mm - 1) <= SAME_PIXEL):
        return None
    return (
        f"a pixel of {_sides(1000 * one.pixel_mm)} micrometres; expected that of {of_first},"
        f" {_sides(1000 * first.pixel_mm)}, within {100 * SAME_PIXEL:g} %"
    )


def _sides(two):
    return f"{two[0]:.8g} x {two[1]:.8g}"
