"""Units in the endings of keys and columns."""

from tankcal.text.digits import superscript

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


def split_unit(name):
    """Split a name into (name, unit): ("height", "m") for height_m, ("K1", "mm⁻²") for K1_mm-2."""
    stem, power = name.rpartition("_mm-")[::2]
    if stem:
        return stem, f"mm{superscript('-' + power)}"
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending), unit
    return name, ""
