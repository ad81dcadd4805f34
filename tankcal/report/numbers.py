"""Printed units, and values rounded to their standard deviations."""

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
from tankcal.units import ARCSEC_PER_DEG, ARCSEC_PER_RAD

_SHORT = range(-2, 6)  # exponents of values that are written without a power of ten
_MOST_DEGREES = 10_000  # degrees of freedom above which k agrees with the normal k to 0.03 %


@dataclass(frozen=True)
class Unit:
    """Printed unit of a quantity of the record.

    Attributes
    ----------
    symbol : str
        Printed symbol.
    factor : float
        Printed value divided by the value in the record.
    least : int
        Smallest number of decimals of volumes in a capacity table.
    """

    symbol: str
    factor: float = 1.0
    least: int = 0


SPACE = "\N{NO-BREAK SPACE}"
ANGLES = ("°", "′", "″")  # symbols without a space before them, SI Brochure 5.4.3
UNITS = {
    "": Unit(""),
    "m": Unit("m"),
    "mm": Unit("mm", 1e3),
    "m2": Unit("m²"),
    "m3": Unit("m³", least=TABLE_DECIMALS["m3"]),
    "m3/unit": Unit("m³/unit"),
    "m3/h": Unit("m³/h"),
    "L/h": Unit("L/h", 1e3),
    "L/m": Unit("L/m", 1e3),
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
    "image mm": Unit("mm"),  # the record has image coordinates in millimetres
    "image um": Unit("µm", 1e3),
    "px": Unit("px"),
    "arcsec": Unit("″"),
    "rad deg": Unit("°", 180 / pi),
    "rad arcsec": Unit("″", ARCSEC_PER_RAD),
    "deg arcsec": Unit("″", ARCSEC_PER_DEG),
    "L/cm": Unit("L/cm", 10.0),  # an area of 1 m2 holds 10 litres per centimetre
    "cm": Unit("cm", 1e2),
}
for _name, _size in VOLUME_UNITS_M3.items():
    if _name != "m3":
        UNITS[_name] = Unit(_name, float(1 / _size), TABLE_DECIMALS[_name])
        UNITS[f"{_name}/unit"] = Unit(f"{_name}/unit", float(1 / _size))


# Units of readings and of their residuals: {unit in the record: (printed unit, factor)}.
_LARGE = {"mm": ("image mm", 1.0), "m": ("m", 1.0), "rad": ("deg", 180 / pi)}
_SMALL = {"mm": ("um", 1e3), "m": ("image mm", 1e3), "rad": ("arcsec", ARCSEC_PER_RAD)}


def large_unit(name):
    """Return (unit, factor) for printed readings; ("", 1.0) for an unknown unit."""
    return _LARGE.get(name, ("", 1.0))


def small_unit(name):
    """Return (unit, factor) for printed residuals and standard deviations of a unit."""
    return _SMALL.get(name, ("", 1.0))


def spelled(name):
    """Return a unit of `large_unit` or `small_unit` in ASCII, for programs."""
    return name.removeprefix("image ")


def unit(name):
    """Return the Unit of a name; raise VocabularyError for a name that is not in UNITS."""
    if name not in UNITS:
        raise VocabularyError(
            f"unit {name!r} is not known; there are: {', '.join(filter(None, UNITS))}"
        )
    return UNITS[name]


def symbol(text):
    """Return the printed form of a unit of the record: "m3/kg/m3" gives "m³/(kg/m³)"."""
    if not text or text == "1":  # a ratio has no unit
        return None
    text = text.replace("m3", "m³").replace("m2", "m²").replace("degC", "°C").replace("deg", "°")
    above, _, below = text.partition("/")
    return f"{above}/({below})" if "/" in below else f"{above}/{below}" if below else above


def join_unit(text, symbol):
    """Return a number with its unit; degrees, minutes and seconds of angle follow without a space.

    Examples
    --------
    >>> join_unit("90.0", "°") + join_unit("2.5", "")
    '90.0°2.5'
    """
    return f"{text}{'' if symbol in ANGLES else SPACE}{symbol}" if symbol else text


def like_its_sd(value, sd, marks=ENGLISH):
    """Round a value to two digits of its standard deviation, or to four digits without it.

    Parameters
    ----------
    value, sd : float
        Value and standard deviation in equal units; sd 0 or None: without.
    marks : Marks, optional
        Decimal mark and separators of the language.

    Returns
    -------
    str
    """
    if not sd:
        return format_significant(value, 4, marks)
    rounded = format_with_u(value, sd, marks, least=0, written_out=WITHOUT_U)
    return rounded.value + rounded.power


def concise(value, sd, marks=ENGLISH):
    """Format a value with two digits of its standard deviation in brackets: "4.3816(13)".

    Without a standard deviation the value has seven digits and no brackets.

    Parameters
    ----------
    value, sd : float
        Value and standard deviation in equal units; sd 0 or None: without.
    marks : Marks, optional
        Decimal mark and separators of the language.

    Returns
    -------
    str
    """
    if not sd:
        return format_significant(value, 7, marks)
    return format_with_u(value, sd, marks, least=0, written_out=_SHORT).concise


def powers(unit):
    """Return the printed form of a unit with exponents: "mm-2" gives "mm⁻²"."""
    return superscript(unit)


def degrees_of_freedom(value, marks=ENGLISH):
    """Format effective degrees of freedom; None and values above 10 000 are printed as ∞.

    >>> degrees_of_freedom(2321.4), degrees_of_freedom(5.05e16)
    ('2321', '∞')
    """
    dof = inf if value is None else value
    return "∞" if dof > _MOST_DEGREES else shortest(dof, marks, digits=3)
