"""Units of volumes, and dips in metres or in feet and inches, as numbers and as text.

1 in = 0.0254 m and 1 bbl = 42 US gallons = 42 * 231 in3 = 0.158987294928 m3 are exact
(international yard and pound agreement of 1959; NIST Handbook 44, appendix C).
"""

import re
from fractions import Fraction

import numpy as np

from tankcal.errors import HeightError
from tankcal.messages import message
from tankcal.text.digits import LITRE_DECIMALS, PROGRAM, decimals_of_height, fixed

METRES_PER_INCH = Fraction(254, 10_000)
INCHES_PER_FOOT = 12

VOLUME_UNITS_M3 = {
    "m3": Fraction(1),
    "L": Fraction(1, 1000),
    "bbl": 42 * 231 * METRES_PER_INCH**3,
}

TABLE_DECIMALS = {"m3": LITRE_DECIMALS, "L": 0, "bbl": 2}  # least number of decimals of a row

# Smallest step of a table in each unit of heights, as a fraction of a metre.
HEIGHT_STEPS_M = {
    "m": Fraction(1, 1000),
    "ft-in-8": METRES_PER_INCH / 8,
    "ft-in-16": METRES_PER_INCH / 16,
}

_ON_THE_MARK_M = 1e-8  # a dip within this distance of a mark is at the mark
_FEET_AND_INCHES = re.compile(
    r"(?:(?P<feet>\d+)\s*(?:'|ft\.?|feet|-))?[\s-]*"
    r"(?:(?P<inches>\d+(?:\.\d+)?)(?:[\s-]+(?P<n>\d+)/(?P<d>\d+))?|(?P<n1>\d+)/(?P<d1>\d+))?"
    r"\s*(?P<mark>\"|''|in\.?|inches)?",
    re.ASCII,
)
_TYPED_MARKS = str.maketrans("′’″”", "''\"\"")


def volume_from_m3(volume_m3, unit):
    """Return volumes in `unit` ("m3", "L", "bbl") from volumes in m3, with a single rounding.

    Parameters
    ----------
    volume_m3 : array_like
        Volumes of any shape, m3.
    unit : str

    Raises
    ------
    KeyError
        For an unknown unit.

    Examples
    --------
    >>> float(volume_from_m3(1.5, "L"))
    1500.0
    """
    return np.asarray(volume_m3, dtype=float) * float(1 / VOLUME_UNITS_M3[unit])


def volume_to_m3(volume, unit):
    """Return volumes in m3 from volumes in `unit`, the inverse of `volume_from_m3`.

    Examples
    --------
    >>> float(volume_to_m3(100.0, "bbl").round(7))
    15.8987295
    """
    return np.asarray(volume, dtype=float) / float(1 / VOLUME_UNITS_M3[unit])


def dip_label(height_m, height_unit="m"):
    """Return a dip as printed in the table: '1.035', or 3' 4 5/8" with the fraction reduced.

    A height between the marks of the tape (the top of a shell) has decimals instead: as many as
    required for metres, three for inches.

    Parameters
    ----------
    height_m : float
        Dip, m.
    height_unit : {"m", "ft-in-8", "ft-in-16"}

    Returns
    -------
    str

    Raises
    ------
    HeightError
        For a negative height in feet.

    Examples
    --------
    >>> print(dip_label(1.035), "or", dip_label(1.031875, "ft-in-8"))
    1.035 or 3' 4 5/8"
    """
    if height_unit == "m":
        return fixed(height_m, decimals_of_height(height_m), PROGRAM)
    if height_m < 0:
        raise HeightError(
            message(
                "negative_in_feet",
                "height {height_m:g} m: feet and inches count from zero upwards",
                height_m=height_m,
            )
        )
    step = HEIGHT_STEPS_M[height_unit]
    marks = round(height_m / float(step))
    if abs(height_m - float(marks * step)) <= _ON_THE_MARK_M:
        feet, inches = divmod(marks * step / METRES_PER_INCH, INCHES_PER_FOOT)
        whole_inches, part = divmod(inches, 1)
        fraction = f" {part.numerator}/{part.denominator}" if part else ""
        return f"{feet}' {whole_inches}{fraction}\""
    # Between marks: round once to thousandths of an inch, so that 12 inches become a foot.
    thousandths = round(height_m / float(METRES_PER_INCH) * 1000)
    feet, inches = divmod(Fraction(thousandths, 1000), INCHES_PER_FOOT)
    return f"{feet}' {float(inches):.3f}\""


def parse_dip(text, height_unit="m"):
    """Return the metres of a dip given as text.

    Feet and inches may have the forms 3' 4 5/8", 3-4 5/8, 3-04-5/8 and 3 ft 4.625 in. The value is
    exact up to the last division: the number nearest to n * 0.0254 / 16 m, as in `table_heights`.

    Parameters
    ----------
    text : str
    height_unit : {"m", "ft-in-8", "ft-in-16"}

    Returns
    -------
    float

    Raises
    ------
    HeightError
        For any other text.

    Examples
    --------
    >>> parse_dip("1.035"), parse_dip("3-4 5/8", "ft-in-8")
    (1.035, 1.031875)
    """
    text = text.strip()
    if height_unit == "m":
        if re.fullmatch(r"\d+(\.\d*)?|\.\d+", text, re.ASCII):
            return float(text)
        raise HeightError(
            message(
                "no_dip_in_metres",
                "{text!r} is not a dip; expected metres, such as 1.035",
                text=text[:40],
            )
        )
    match = _FEET_AND_INCHES.fullmatch(text.translate(_TYPED_MARKS))
    inches = _inches(match) if match else None
    if inches is None:
        raise HeightError(
            message(
                "no_dip_in_feet",
                "{text!r} is not a dip; expected feet and inches, such as 3' 4 5/8\"",
                text=text[:40],
            )
        )
    return float(inches * METRES_PER_INCH)


def _inches(match):
    """Return inches as a fraction; None if a part is missing or too large for its place."""
    feet, inches = match["feet"], match["inches"]
    numerator = match["n"] or match["n1"]
    denominator = match["d"] or match["d1"]
    if feet is None and inches is None and numerator is None:
        return None
    if inches is None and numerator is None and match["mark"]:
        return None
    fraction = Fraction(0)
    if numerator is not None:
        # Only binary fractions below one inch are marks of a tape.
        if int(denominator) not in (2, 4, 8, 16, 32, 64) or int(numerator) >= int(denominator):
            return None
        if "." in (inches or ""):
            return None
        fraction = Fraction(int(numerator), int(denominator))
    fraction += Fraction(inches or 0)
    if feet is not None and fraction >= INCHES_PER_FOOT:
        return None
    return int(feet or 0) * INCHES_PER_FOOT + fraction
