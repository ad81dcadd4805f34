"""Camera calibrations without a job: read a cameras.toml alone, with the checks of a job."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.cameras import make_camera
from tankcal.job.checks.survey.cameras import check_calibrations
from tankcal.job.checks.survey.readings import SurveyFiles
from tankcal.job.contract.registers import PARAMETER_KEYS, SECOND_NAMES
from tankcal.job.entries import read_register
from tankcal.job.folder import MAX_SETTINGS_BYTES
from tankcal.job.folder import read_register as raw_register
from tankcal.job.tables import Log, RawJob, nearest, read_bytes, shown
from tankcal.messages import list_some, message

CAMERAS_FILE = "cameras.toml"
# Every key of [adjustment.camera], without a value.
NO_SETTINGS = dict.fromkeys((*PARAMETER_KEYS, *SECOND_NAMES.values(), "default"))


def read_cameras(path, warn=None, in_pixels=True):
    """Read the camera calibrations of a cameras.toml.

    The keys are the same as in a job (docs/job-format.md). The size of a pixel is required:
    format_px with pixel_um, format_px with format_mm, or format_mm with pixel_um.

    Parameters
    ----------
    path : str or PathLike
        The file, or a folder with a cameras.toml.
    warn : callable, optional
        Called with each warning (a Problem); None: warnings are dropped.
    in_pixels : bool, optional
        False: format_mm alone is sufficient, as for film.

    Returns
    -------
    tuple of CameraSetup
        One for each [cameras.NAME], in the order of the file.

    Raises
    ------
    InputError
        With every problem of the file.
    """
    path, log = Path(path), Log()
    missing = path.name or "."
    if path.is_dir():
        path = path / CAMERAS_FILE
        missing = str(path)
    if not path.exists():
        log.problem(
            missing, message("no_cameras_file", "not found; expected a file with [cameras.NAME]")
        )
    log.stop_if_problems()
    values = _read_entries(path, log, in_pixels)
    log.stop_if_problems()
    for warning in log.warnings if warn else ():
        warn(warning)
    return tuple(
        make_camera(name, _with_frame(given), NO_SETTINGS) for name, given in values.items()
    )


def with_pixels(setups, pixel_um):
    """Give the cameras with film a pixel size; the format is rounded to a whole number of pixels.

    pixel_um is the side of a pixel; None returns the cameras unchanged.
    """
    if pixel_um is None:
        return tuple(setups)
    pixel = np.full(2, pixel_um / 1000)
    return tuple(
        replace(setup, pixel_mm=pixel, format_mm=np.round(setup.format_mm / pixel) * pixel)
        if setup.pixel_mm is None
        else setup
        for setup in setups
    )


def choose(setups, names, file=CAMERAS_FILE):
    """Select cameras by name.

    Parameters
    ----------
    setups : sequence of CameraSetup
        Cameras of the file.
    names : sequence of str
        Names in the order required; empty: all cameras, in the order of `setups`.
    file : str, optional
        Name of the file in messages.

    Returns
    -------
    tuple of CameraSetup

    Raises
    ------
    InputError
        For unknown and repeated names.
    """
    known = [setup.camera.name for setup in setups]
    problems = []
    for place, name in enumerate(names):
        if name not in known:
            expected = message(
                "no_such_camera",
                "found {found}; expected a camera of this file{hint}: {listed}",
                found=shown(name),
                hint=nearest(name, known),
                listed=list_some(known, 20),
            )
            problems.append(Problem(file, expected))
        elif name in names[:place]:
            problems.append(
                Problem(
                    file,
                    message(
                        "camera_named_twice",
                        "{found} was named twice; expected once",
                        found=shown(name),
                    ),
                )
            )
    if problems:
        raise InputError(problems)
    return tuple(setups[known.index(name)] for name in names) or tuple(setups)


def _read_entries(path, log, in_pixels):
    """{name: {key: value}} of the file; problems go to `log`."""
    data = read_bytes(path, log, MAX_SETTINGS_BYTES)
    register = None if data is None else raw_register(path.name, data, log, "cameras")
    if register is None:
        return {}
    raw = RawJob(path.stem, path.parent, path.name, {}, {}, {}, registers={"cameras": register})
    values = read_register(raw, "cameras", log)
    check_calibrations(SurveyFiles(None, {}, {"cameras": values}, raw, log), in_pixels)
    if not values and not log.problems:
        log.problem(
            path.name, message("no_camera_sections", "no camera; expected sections [cameras.NAME]")
        )
    return values


def _with_frame(given):
    """Add the format in pixels, computed from format_mm and pixel_um, to the keys of a camera."""
    if given["format_px"] is not None or given["pixel_um"] is None:
        return given
    pixels = np.array(given["format_mm"]) / np.broadcast_to(given["pixel_um"], 2) * 1000
    return given | {"format_px": tuple(np.round(pixels))}
