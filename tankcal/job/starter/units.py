"""The unit that the name of a key or column ends with, and what is a number."""

from tankcal.text.digits import superscript
from tankcal.text.numerals import NUMBER

_UNITS = {
    "_mm_per_m": "mm/m",
    "_kg_m3": "kg/m³",
    "_per_k": "1/K",
    "_arcsec": "″",
    "_deg": "°",
    "_gon": "gon",
    "_dms": "° ′ ″",
    "_ppm": "ppm",
    "_gpa": "GPa",
    "_m3": "m³",
    "_mm": "mm",
    "_um": "µm",
    "_px": "px",
    "_kg": "kg",
    "_c": "°C",
    "_n": "N",
    "_l": "L",
    "_m": "m",
}


def parted(name):
    """(name without its unit, unit): ("height", "m") of height_m, ("K1", "mm⁻²") of K1_mm-2."""
    stem, power = name.rpartition("_mm-")[::2]
    if stem:
        return stem, f"mm{superscript('-' + power)}"
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending), unit
    return name, ""


def is_number(text):
    """Is it a number, as TOML and a spreadsheet would take it?"""
    return NUMBER.fullmatch(text) is not None
