"""OpenCV, which only reading photographs needs: the extra `tankcal[images]`."""

import importlib

from tankcal.errors import InputError, Problem

OLDEST = (4, 7)  # the first one with ArucoDetector


def opencv():
    """The module cv2. Raises InputError where it is missing or too old."""
    try:
        found = importlib.import_module("cv2")
        is_usable = tuple(int(part) for part in found.__version__.split(".")[:2]) >= OLDEST
    except ImportError:
        raise InputError(
            Problem("OpenCV", "not installed; expected: pip install 'tankcal[images]'")
        ) from None
    if not (is_usable and hasattr(found, "aruco")):
        expected = "expected 4.7 or later: pip install 'tankcal[images]'"
        raise InputError(Problem("OpenCV", f"found version {found.__version__}; {expected}"))
    return found
