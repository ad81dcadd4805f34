"""OpenCV, which only reading photographs needs: the extra `tankcal[images]`."""

import importlib

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.version import install_command

OLDEST = (4, 7)  # the first one with ArucoDetector


def opencv():
    """The module cv2. Raises InputError where it is missing or too old."""
    try:
        found = importlib.import_module("cv2")
        is_usable = tuple(int(part) for part in found.__version__.split(".")[:2]) >= OLDEST
    except ImportError:
        raise InputError(
            Problem(
                "OpenCV",
                message(
                    "targets_no_opencv",
                    "not installed; expected: {command}",
                    command=install_command("images"),
                ),
            )
        ) from None
    if not (is_usable and hasattr(found, "aruco")):
        expected = message(
            "targets_old_opencv",
            "found version {version}; expected 4.7 or later: {command}",
            version=found.__version__,
            command=install_command("images"),
        )
        raise InputError(Problem("OpenCV", expected))
    return found
