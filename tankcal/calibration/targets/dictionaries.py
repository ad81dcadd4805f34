"""Dictionaries of coded targets: their cells, and what can be mistaken for what."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tankcal.calibration.targets.opencv import opencv
from tankcal.errors import InputError, Problem
from tankcal.messages import message

BORDER_CELLS = 1


@dataclass(frozen=True)
class Dictionary:
    """The codes of a dictionary.

    Attributes
    ----------
    name : str
        As OpenCV has it.
    cells : ndarray, shape (codes, n, n)
        0 and 1, as printed, the black border included.
    mirrored : frozenset
        Ids whose mirror image is a code, too.
    turning : frozenset
        Ids that look the same after a quarter or half turn.
    chance : float
        Probability that random cells inside a black border are one of the codes.
    """

    name: str
    cells: np.ndarray
    mirrored: frozenset
    turning: frozenset
    chance: float


def names_of_dictionaries():
    """Names that `dictionary` takes; raises InputError without OpenCV."""
    names = {name.upper() for name in dir(opencv().aruco) if name.startswith("DICT_")}
    return tuple(sorted(names))


def _name(name):
    known = names_of_dictionaries()
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
def dictionary_of(name):
    """Dictionary by its name, with or without "DICT_". Raises InputError."""
    aruco = opencv().aruco
    full = _name(name)
    codes = aruco.getPredefinedDictionary(getattr(aruco, full))
    inside = int(codes.markerSize)
    n = inside + 2 * BORDER_CELLS
    cells = np.array(
        [
            codes.generateImageMarker(number, n, borderBits=BORDER_CELLS) > 127
            for number in range(len(codes.bytesList))
        ]
    ).astype(np.uint8)
    plain = {one.tobytes() for one in cells}
    flipped, turned = set(), set()
    for number, one in enumerate(cells):
        if any(np.rot90(one[:, ::-1], k).tobytes() in plain for k in range(4)):
            flipped.add(number)
        if any(np.array_equal(np.rot90(one, k), one) for k in (1, 2, 3)):
            turned.add(number)
    chance = min(4.0 * len(cells) / 2.0 ** (inside**2), 1.0)
    return Dictionary(full, cells, frozenset(flipped), frozenset(turned), chance)


def target_image(dictionary, number, side_px, quiet_cells=1):
    """Grey values (m, m) uint8 of a target to print, whole pixels a cell, white zone around it.

    Parameters
    ----------
    side_px
        Of the black square; the next multiple of the number of cells is taken.
    """
    known = dictionary_of(dictionary)
    if not 0 <= number < len(known.cells):
        expected = f"found {number}; expected 0 to {len(known.cells) - 1} of {known.name}"
        raise InputError(Problem("target", expected))
    cells = np.pad(known.cells[number], quiet_cells, constant_values=1)
    pixels = max(1, -(-int(side_px) // known.cells.shape[1]))
    return np.kron(cells * np.uint8(255), np.ones((pixels, pixels), dtype=np.uint8))
