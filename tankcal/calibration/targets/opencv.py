"""OpenCV (extra `tankcal[images]`), and its dictionaries of coded targets.

Only the measurement of photographs requires OpenCV.
"""

import importlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.version import install_command

BORDER_CELLS = 1  # width of the black border, cells
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


@dataclass(frozen=True)
class Dictionary:
    """Codes of a dictionary.

    Attributes
    ----------
    name : str
        Name in OpenCV.
    cells : ndarray, shape (codes, n, n)
        Cells as printed, including the black border: 0 black, 1 white.
    mirrored : frozenset
        Ids whose mirror image is also a code.
    turning : frozenset
        Ids that are unchanged by a rotation of 90 or 180 degrees.
    chance : float
        Probability that random cells inside a black border form a code.
    """

    name: str
    cells: np.ndarray
    mirrored: frozenset
    turning: frozenset
    chance: float


def _full_name(name):
    """Name of a dictionary in OpenCV; raises InputError for an unknown dictionary."""
    known = sorted({key.upper() for key in dir(opencv().aruco) if key.startswith("DICT_")})
    wanted = str(name).upper()
    wanted = wanted if wanted.startswith("DICT_") else f"DICT_{wanted}"
    if wanted not in known:
        expected = message(
            "targets_dictionary",
            "found {found!r}; expected one of {known}",
            found=str(name)[:60],
            known=", ".join(known),
        )
        raise InputError(Problem("dictionary", expected))
    return wanted


@lru_cache(maxsize=4)
def load_dictionary(name):
    """Return the Dictionary of a name, with or without "DICT_"; raise InputError if unknown."""
    aruco = opencv().aruco
    full = _full_name(name)
    codes = aruco.getPredefinedDictionary(getattr(aruco, full))
    inside = int(codes.markerSize)
    n = inside + 2 * BORDER_CELLS
    cells = np.array(
        [
            codes.generateImageMarker(number, n, borderBits=BORDER_CELLS) > 127
            for number in range(len(codes.bytesList))
        ]
    ).astype(np.uint8)
    known_codes = {code.tobytes() for code in cells}
    flipped, turned = set(), set()
    for number, code in enumerate(cells):
        if any(np.rot90(code[:, ::-1], k).tobytes() in known_codes for k in range(4)):
            flipped.add(number)
        if any(np.array_equal(np.rot90(code, k), code) for k in (1, 2, 3)):
            turned.add(number)
    chance = min(4.0 * len(cells) / 2.0 ** (inside**2), 1.0)
    return Dictionary(full, cells, frozenset(flipped), frozenset(turned), chance)


def target_image(dictionary, number, side_px, quiet_cells=1):
    """Create the image of a target for printing, with a white zone around it.

    Parameters
    ----------
    dictionary : str
        Name of the dictionary.
    number : int
        Id of the target.
    side_px : float
        Side of the black square, px, rounded up to a multiple of the number of cells.
    quiet_cells : int, optional
        Width of the white zone, cells.

    Returns
    -------
    ndarray of uint8, shape (m, m)
        Grey values.
    """
    known = load_dictionary(dictionary)
    if not 0 <= number < len(known.cells):
        expected = f"found {number}; expected 0 to {len(known.cells) - 1} of {known.name}"
        raise InputError(Problem("target", expected))
    cells = np.pad(known.cells[number], quiet_cells, constant_values=1)
    pixels = max(1, -(-int(side_px) // known.cells.shape[1]))
    return np.kron(cells * np.uint8(255), np.ones((pixels, pixels), dtype=np.uint8))
