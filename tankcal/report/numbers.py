"""Numbers as they are printed: one function for the digits, one for the units."""

from dataclasses import dataclass
from math import floor, isfinite, log10, pi

from tankcal.dips import TABLE_DECIMALS, VOLUME_UNITS_M3
from tankcal.errors import TankcalError

NOTHING = "–"
_MINUS = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class Unit:
    """How a value of the record (SI, or as its key says) is shown: its symbol, and the factor.

    least  decimals that rows of a capacity table have in it at least: litres
    """

    symbol: str
    factor: float = 1.0
    least: int = 0


UNITS = {
    "": Unit(""),
    "m": Unit("m"),
    "mm": Unit("mm", 1e3),
    "m2": Unit("m²"),
    "m3": Unit("m³", least=TABLE_DECIMALS["m3"]),
    "L": Unit("L", float(1 / VOLUME_UNITS_M3["L"])),
    "bbl": Unit("bbl", float(1 / VOLUME_UNITS_M3["bbl"]), TABLE_DECIMALS["bbl"]),
    "kg": Unit("kg"),
    "mm/m": Unit("mm/m", 1e3),
    "deg": Unit("°"),
    "degC": Unit("°C"),
    "kg/m3": Unit("kg/m³"),
    "GPa": Unit("GPa", 1e-9),
    "1/K": Unit("1/K"),
    "percent": Unit("%"),
    "share": Unit("%", 1e2),
    "ppm": Unit("ppm"),
    "um": Unit("µm"),
    "image mm": Unit("mm"),  # image coordinates are in millimetres in the record, too
    "image um": Unit("µm", 1e3),
    "rad deg": Unit("°", 180 / pi),
    "rad arcsec": Unit("″", 648000 / pi),
    "deg arcsec": Unit("″", 3600.0),
    "L/cm": Unit("L/cm", 10.0),  # an area of 1 m2 holds 10 litres per centimetre
}


def unit(name):
    """The unit called `name`; raises TankcalError when it is not one of UNITS."""
    if name not in UNITS:
        raise TankcalError(
            f"unit {name!r} is not known; there are: {', '.join(filter(None, UNITS))}"
        )
    return UNITS[name]


def symbol(text):
    """A unit as the record writes it, as it is printed: "m3/mm" is "m³/mm"."""
    return text and text.replace("m3", "m³").replace("m2", "m²")


def fixed(value, decimals, decimal_mark="."):
    """`value` with that many decimals, a true minus sign, and no minus before zero."""
    if value is None or not isfinite(value):
        return NOTHING
    text = f"{abs(value):.{decimals}f}"
    if value < 0 and any(digit in text for digit in "123456789"):
        text = _MINUS + text
    return text.replace(".", decimal_mark)


def significant(value, digits, decimal_mark="."):
    """`value` with that many significant digits; powers of ten outside 1e-4 .. 1e6."""
    if value is None or not isfinite(value):
        return NOTHING
    if value == 0:
        return "0"
    exponent = floor(log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= exponent < 6:
        return fixed(value, max(digits - 1 - exponent, 0), decimal_mark)
    mantissa = fixed(value / 10.0**exponent, digits - 1, decimal_mark)
    return f"{mantissa}·10{_superscript(exponent)}"


def _superscript(exponent):
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
