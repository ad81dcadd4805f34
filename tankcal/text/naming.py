"""Permitted names of user-defined objects, patterns of numbers, and units in endings of keys.

Numbers in tables and on command lines are plain digits without groups.
"""

import re

from tankcal.text.digits import superscript

MAX_NAME = 64  # characters
_NAME = re.compile(r"\w[\w .()/#-]*")
NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
WHOLE_NUMBER = re.compile(r"[+-]?[0-9]{1,18}")
_UNITS = {
    "_mm_per_m": "mm/m",
    "_m3_per_m": "m³/m",
    "_m3_h": "m³/h",
    "_kg_m3": "kg/m³",
    "_per_k": "1/K",
    "_arcsec": "″",
    "_deg": "°",
    "_gon": "gon",
    "_dms": "° ′ ″",
    "_ppm": "ppm",
    "_gpa": "GPa",
    "_m3": "m³",
    "_bar": "bar",
    "_mm2": "mm²",
    "_mm": "mm",
    "_um": "µm",
    "_px": "px",
    "_kg": "kg",
    "_c": "°C",
    "_n": "N",
    "_l": "L",
    "_m": "m",
}


def is_name(text):
    """Return whether a text is a name: a letter, digit or _, then also spaces and - . ( ) / #"""
    return len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None


def file_name(text, otherwise):
    """Convert a text to part of a file name; invalid characters become _.

    Returns `otherwise` if no character remains.

    >>> file_name("T-1 / north", "tank")
    'T-1_north'
    """
    return re.sub(r"[^\w.()-]+", "_", text).strip("._")[:MAX_NAME] or otherwise


def split_unit(name):
    """Split a name into (name, unit): ("height", "m") for height_m, ("K1", "mm⁻²") for K1_mm-2."""
    stem, power = name.rpartition("_mm-")[::2]
    if stem:
        return stem, f"mm{superscript('-' + power)}"
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending), unit
    return name, ""
