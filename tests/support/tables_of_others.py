"""Texts of tables as other laboratories write them, of an upright cylinder of known area.

The truth is the closed form A h, so that every reading of the same tank has the same volumes.
"""

from fractions import Fraction
from math import pi

AREA_M2 = pi * 2.0**2
INCH_M = Fraction(254, 10_000)
FOOT_M = 12 * INCH_M
# exact sizes: international inch of 1959; NIST Handbook 44, appendix C (US gallon, barrel)
LITRE = Fraction(1, 1000)
US_GALLON = 231 * INCH_M**3
IMPERIAL_GALLON = Fraction("4.54609") * LITRE
BARREL = 42 * US_GALLON


def litres(height_m, decimals=2):
    return f"{AREA_M2 * 1000 * float(height_m):.{decimals}f}"


def volumes(heights_m, unit=LITRE, decimals=9):
    """Volumes as text, in a unit of m3."""
    return [f"{AREA_M2 * float(h) / float(unit):.{decimals}f}" for h in heights_m]


def columns(heading, *cells, separator=","):
    """Text of a table of columns under a heading."""
    lines = (separator.join(map(str, row)) for row in zip(*cells, strict=True))
    return "\n".join([heading, *lines]) + "\n"


def wide(heading, bases, labels_m, base_m, separator=","):
    """Text of a table whose rows are bases (in base_m) and whose columns add labels_m."""
    lines = [
        separator.join([str(base), *(litres(base * base_m + label) for label in labels_m)])
        for base in bases
    ]
    return "\n".join([heading, *lines]) + "\n"
