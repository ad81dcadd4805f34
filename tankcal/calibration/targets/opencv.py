"""Import of OpenCV (extra `tankcal[images]`), required only to measure photographs."""

import importlib

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.version import install_command

OLDEST = (4, 7)  # oldest supported version, the first with ArucoDetector


def opencv():
    """Return the module cv2; raise InputError if it is missing or too old."""
    try:
        cv2 = importlib.import_module("cv2")
        is_usable = tuple(int(part) for part in cv2.__version__.split(".")[:2]) >= OLDEST
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
    if not (is_usable and hasattr(cv2, "aruco")):
        expected = message(
            "targets_old_opencv",
            "found version {version}; expected 4.7 or later: {command}",
            version=cv2.__version__,
            command=install_command("images"),
        )
        raise InputError(Problem("OpenCV", expected))
    return cv2
