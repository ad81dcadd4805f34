"""Units as they are printed, and values with powers of ten beside their standard deviations."""

from dataclasses import dataclass
from math import inf, pi

from tankcal.errors import VocabularyError
from tankcal.tank.dips import TABLE_DECIMALS, VOLUME_UNITS_M3
from tankcal.text.digits import (
    ENGLISH,
    WITHOUT_U,
    format_significant,
    format_with_u,
    shortest,
    superscript,
)

_SHORT = range(-2, 6)  # powers of ten written out in a narrow column
_MOST_DEGREES = 10_000  # of freedom: from there k is that of the normal distribution, to 0.03 %


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
    "m3/unit": Unit("m³/unit"),
    "L/unit": Unit("L/unit", float(1 / VOLUME_UNITS_M3["L"])),
    "bbl/unit": Unit("bbl/unit", float(1 / VOLUME_UNITS_M3["bbl"])),
    "L": Unit("L", float(1 / VOLUME_UNITS_M3["L"])),
    "m3/h": Unit("m³/h"),
    "L/h": Unit("L/h", 1e3),
    "L/m": Unit("L/m", 1e3),
    "bbl": Unit("bbl", float(1 / VOLUME_UNITS_M3["bbl"]), TABLE_DECIMALS["bbl"]),
    "kg": Unit("kg"),
    "mm/m": Unit("mm/m", 1e3),
    "deg": Unit("°"),
    "degC": Unit("°C"),
    "kg/m3": Unit("kg/m³"),
    "GPa": Unit("GPa", 1e-9),
    "bar": Unit("bar", 1e-5),
    "1/K": Unit("1/K"),
    "percent": Unit("%"),
    "share": Unit("%", 1e2),
    "ppm": Unit("ppm"),
    "share ppm": Unit("ppm", 1e6),
    "um": Unit("µm"),
    "image mm": Unit("mm"),  # image coordinates are in millimetres in the record, too
    "image um": Unit("µm", 1e3),
    "px": Unit("px"),
    "arcsec": Unit("″"),
    "rad deg": Unit("°", 180 / pi),
    "rad arcsec": Unit("″", 648000 / pi),
    "deg arcsec": Unit("″", 3600.0),
    "L/cm": Unit("L/cm", 10.0),  # an area of 1 m2 holds 10 litres per centimetre
}


# Of what was observed and of its residuals: {unit in the record: (unit shown, factor)}.
_LARGE = {"mm": ("image mm", 1.0), "m": ("m", 1.0), "rad": ("deg", 180 / pi)}
_SMALL = {"mm": ("um", 1e3), "m": ("image mm", 1e3), "rad": ("arcsec", 648000 / pi)}


def large_unit(name):
    """(unit, factor) in which readings of a unit are shown; ("", 1.0) where it has no such."""
    return _LARGE.get(name, ("", 1.0))


def small_unit(name):
    """The same of residuals and sds: micrometres, millimetres, arc seconds."""
    return _SMALL.get(name, ("", 1.0))


def spelled(name):
    """A unit of large_unit or small_unit in ASCII, for programs."""
    return name.removeprefix("image ")


def unit(name):
    """The unit called `name`; raises VocabularyError when it is not one of UNITS."""
    if name not in UNITS:
        raise VocabularyError(
            f"unit {name!r} is not known; there are: {', '.join(filter(None, UNITS))}"
        )
    return UNITS[name]


def symbol(text):
    """A unit as the record writes it, as it is printed: "m3/kg/m3" is "m³/(kg/m³)", "deg" "°"."""
    if not text or text == "1":  # of a ratio
        return None
    text = text.replace("m3", "m³").replace("m2", "m²").replace("degC", "°C").replace("deg", "°")
    above, _, below = text.partition("/")
    return f"{above}/({below})" if "/" in below else f"{above}/{below}" if below else above


def like_its_sd(value, sd, marks=ENGLISH):
    """`value` down to two digits of its standard deviation; four digits when it has none."""
    if not sd:
        return format_significant(value, 4, marks)
    found = format_with_u(value, sd, marks, least=0, written_out=WITHOUT_U)
    return found.value + found.power


def concise(value, sd, marks=ENGLISH):
    """A value with two digits of its standard deviation in brackets: "4.3816(13)".

    Without a standard deviation seven digits and no bracket.
    """
    if not sd:
        return format_significant(value, 7, marks)
    return format_with_u(value, sd, marks, least=0, written_out=_SHORT).concise


def powers(unit):
    """A unit with powers as it is printed: "mm-2" is "mm⁻²"."""
    return superscript(unit)


def degrees_of_freedom(value, marks=ENGLISH):
    """Effective degrees of freedom; so many that nobody can tell, or None, are written as ∞.

    >>> degrees_of_freedom(2321.4), degrees_of_freedom(5.05e16)
    ('2321', '∞')
    """
    many = inf if value is None else value
    return "∞" if many > _MOST_DEGREES else shortest(many, marks, digits=3)
