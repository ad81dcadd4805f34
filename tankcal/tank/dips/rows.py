"""Rows of a table, and its reading: heights, rounding, ullage, and the dip of a volume.

Dips are metres above the zero of the table. Each row is computed from its own number, n * step, and
rounded from its own exact volume, so no rounding errors accumulate.

Units of volumes and dips
-------------------------

1 in = 0.0254 m and 1 bbl = 42 US gallons = 42 * 231 in3 = 0.158987294928 m3 are exact
(international yard and pound agreement of 1959; NIST Handbook 44, appendix C).
"""

import re
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tankcal.errors import HeightError, InputError, Problem
from tankcal.messages import message
from tankcal.text.digits import LITRE_DECIMALS, PROGRAM, decimals_of_height, fixed, format_with_u

MOST_ROWS = 25_000  # largest number of rows of a table
_PER_METRE = 1_000_000_000  # steps and rows are whole nanometres, so that rows are exact decimals
_LAST_STEP_M = 1e-6  # a shorter last step is omitted
NEAR_MARK_M = 0.0005  # a top within this distance of a mark is at the mark
METRES_PER_INCH = Fraction(254, 10_000)
INCHES_PER_FOOT = 12

VOLUME_UNITS_M3 = {
    "m3": Fraction(1),
    "L": Fraction(1, 1000),
    "hL": Fraction(1, 10),
    "bbl": 42 * 231 * METRES_PER_INCH**3,
    "US gal": 231 * METRES_PER_INCH**3,
    "imp gal": Fraction(454_609, 100_000_000),
}

# Least number of decimals of a row; a unit of the last digit is 10 L or less.
TABLE_DECIMALS = {"m3": LITRE_DECIMALS, "L": 0, "hL": 2, "bbl": 2, "US gal": 0, "imp gal": 0}

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


def table_heights(step_m, top_m, fine_step_m=None, fine_zones=()):
    """Return dips (rows,) at 0, step, 2 step, ... and the top, m, in ascending order.

    Parameters
    ----------
    step_m : float
        Row n is the number nearest to n * step.
    top_m : float
        Last row; a last step below a micrometre is omitted.
    fine_step_m : float, optional
        Step of the rows in `fine_zones`; a whole part of step_m.
    fine_zones : sequence of (float, float), optional
        (low_m, high_m) of each zone: it extends from the row at or below low_m to the row at or
        above high_m.

    Returns
    -------
    ndarray, shape (rows,)

    Raises
    ------
    InputError
        For inconsistent steps, and for more than MOST_ROWS rows.
    HeightError
        For a zone outside the table.

    Examples
    --------
    >>> table_heights(0.5, 1.2, 0.1, [(0.0, 0.2)])
    array([0. , 0.1, 0.2, 0.5, 1. , 1.2])
    """
    _check_steps(step_m, top_m, fine_step_m, fine_zones)
    pieces = [multiples_of(step_m, 0, int(np.floor(top_m / step_m + 1e-9)))]
    for low_m, high_m in fine_zones:
        first = int(np.floor(low_m / fine_step_m + 1e-9))
        last = int(np.ceil(min(high_m, top_m) / fine_step_m - 1e-9))
        pieces.append(multiples_of(fine_step_m, first, last))
    heights = np.unique(np.concatenate(pieces))
    # Rows beyond the top by more than rounding do not belong to the table.
    heights = heights[heights <= top_m + 2e-9 * step_m]
    if top_m - heights[-1] > _LAST_STEP_M:
        heights = np.append(heights, top_m)
    else:
        heights[-1] = min(heights[-1], top_m)
    return heights


def top_mark(top_m, height_unit="m", *, closed=False):
    """Return the dip of the last row of a table, m: the mark of the tape at the top of the tank.

    An open shell ends at the nearest whole millimetre, since 9.49996 m (a leaning shell of 9.5 m)
    is measured as 9.5 m. A tank that closes at its top is full from the next millimetre on. In feet
    and inches, the top is a mark if the mark is within half a millimetre; otherwise it is
    unchanged.

    Parameters
    ----------
    top_m : float
        Dip of the full tank, m.
    height_unit : {"m", "ft-in-8", "ft-in-16"}
    closed : bool
        Whether the tank has no free surface at the top.

    Returns
    -------
    float

    Examples
    --------
    >>> top_mark(9.49996), top_mark(9.49946, closed=True)
    (9.5, 9.5)
    """
    step = float(HEIGHT_STEPS_M[height_unit])
    if height_unit == "m" and closed:
        # Round up, except for an excess below a micrometre.
        number = np.ceil(top_m / step - _LAST_STEP_M / step)
    else:
        number = np.round(top_m / step)
    mark = float(multiples_of(step, number, number)[0])
    on_a_mark = height_unit == "m" or abs(mark - top_m) <= NEAR_MARK_M
    return mark if number > 0 and on_a_mark else float(top_m)


def multiples_of(step_m, first, last):
    """Return first * step, ..., last * step, each rounded once from the exact product.

    Parameters
    ----------
    step_m : float
    first, last : int

    Returns
    -------
    ndarray, shape (last - first + 1,)
        m.
    """
    numbers = np.arange(first, last + 1, dtype=float)
    step = step_m * _PER_METRE
    # Steps of whole nanometres give exact products; rows of other steps are rounded.
    if abs(step - round(step)) < 1e-3:
        return numbers * round(step) / _PER_METRE  # exact integer product, a single rounding
    return np.round(numbers * step_m, 9)


def _check_steps(step_m, top_m, fine_step_m, fine_zones):
    """Raise an error for steps and zones that do not fit the table."""
    if not step_m > 0 or not top_m > 0:
        raise InputError(
            Problem(
                "table",
                message(
                    "steps_above_zero",
                    "step {step_m:g} m, top {top_m:g} m; expected above 0",
                    step_m=step_m,
                    top_m=top_m,
                ),
                None,
                "step",
            )
        )
    count = top_m / step_m
    if fine_zones:
        ratio = step_m / (fine_step_m or np.inf)
        if not ratio > 1.5 or abs(ratio - round(ratio)) > 1e-6:
            given_step = "no fine step" if fine_step_m is None else f"{fine_step_m:g} m"
            raise InputError(
                Problem(
                    "table",
                    f"{given_step}; expected a whole part of the step of {step_m:g} m",
                    None,
                    "fine_step_m",
                )
            )
        for low_m, high_m in fine_zones:
            if not 0 <= low_m < high_m or low_m >= top_m:
                raise HeightError(
                    message(
                        "fine_zone_outside",
                        "fine zone {low_m:g} to {high_m:g} m is outside the table (0 to "
                        "{top_m:g} m)",
                        low_m=low_m,
                        high_m=high_m,
                        top_m=top_m,
                    )
                )
            count += (min(high_m, top_m) - low_m) / fine_step_m
    if count > MOST_ROWS:
        raise InputError(
            Problem(
                "table",
                message(
                    "table_rows_too_many",
                    "{rows:.0f} rows, expected at most {most}",
                    rows=count,
                    most=MOST_ROWS,
                ),
                None,
                "step_m",
            )
        )


def round_each(values, decimals):
    """Return values (rows,), each rounded once to the nearest decimal (half to even).

    The rounding is correct for the stored number: 2.675, which is stored as slightly less, gives
    2.67.

    Examples
    --------
    >>> round_each([2.675, 0.125], 2)
    array([2.67, 0.12])
    """
    return np.array([round(float(value), decimals) for value in values])


@dataclass(frozen=True)
class Dips:
    """Dips of given volumes.

    Attributes
    ----------
    height_m : ndarray, shape (n,)
        Dips, m.
    u_m : ndarray, shape (n,)
        Standard uncertainties of the dips, m.
    """

    height_m: np.ndarray
    u_m: np.ndarray

    def __str__(self):
        """Return one line for each dip: "6.4213 m, u = 0.0021 m"."""
        return "\n".join(map(_line_of, self.height_m, self.u_m))

    def __repr__(self):
        """Return the lines of `str`, for interactive sessions."""
        return str(self)


def _line_of(height_m, u_m):
    """Return a dip and its standard uncertainty as text."""
    formatted = format_with_u(height_m, u_m, PROGRAM, least=3)
    return f"{formatted.value} m, u = {formatted.uncertainty} m"


def ullage_m(reference_height_m, dip_m):
    """Return the ullage, reference height - dip, or the dip from the ullage.

    Both conversions are the same subtraction. Raises HeightError for a dip (ullage) below 0 or
    above the reference height.
    """
    dips = np.asarray(dip_m, dtype=float)
    outside = ~((dips >= 0) & (dips <= reference_height_m))
    if np.any(outside):
        raise HeightError(
            message(
                "dip_beyond_reference",
                "dip {dip_m:g} m is outside 0 to the reference height, {reference_m:g} m",
                dip_m=np.atleast_1d(dips)[np.atleast_1d(outside)][0],
                reference_m=reference_height_m,
            )
        )
    return reference_height_m - dips


def dips_of(height_m, volume_m3, factor_m3, wanted_m3):
    """Return the `Dips` at which the table, interpolated linearly, gives the wanted volumes.

    h = h_a + (V - V_a) (h_b - h_a) / (V_b - V_a),   u(h) = u(V) / ((V_b - V_a) / (h_b - h_a))

    At a row, the slope is that of the interval below, as in the reading of the table.

    Parameters
    ----------
    height_m, volume_m3 : array_like, shape (rows,)
        Dips, ascending, m, and volumes, m3.
    factor_m3 : array_like, shape (rows, inputs)
        Factor of the covariance of the rows, which gives u(V) of the table at h.
    wanted_m3 : float or array_like, shape (n,)
        Volumes, m3.

    Raises
    ------
    HeightError
        For a volume outside the table, or with more than one height (rows of equal volume, or a
        volume that falls).

    Examples
    --------
    >>> dips = dips_of([0.0, 1.0, 2.0], [0.0, 50.0, 100.0], [[0.1], [0.1], [0.1]], 75.0)
    >>> dips
    1.5000 m, u = 0.0020 m
    >>> dips.height_m, dips.u_m
    (array([1.5]), array([0.002]))
    """
    heights, volumes = np.asarray(height_m, dtype=float), np.asarray(volume_m3, dtype=float)
    wanted = np.atleast_1d(np.asarray(wanted_m3, dtype=float))
    upper = _row_above(heights, volumes, wanted)
    lower = upper - 1
    step = heights[upper] - heights[lower]
    slope = (volumes[upper] - volumes[lower]) / step
    part = (wanted - volumes[lower]) / (volumes[upper] - volumes[lower])
    factor = np.asarray(factor_m3, dtype=float)
    # The factor at the dip is interpolated like the volume.
    columns = (1 - part)[:, None] * factor[lower] + part[:, None] * factor[upper]
    from_below, from_above = heights[lower] + part * step, heights[upper] - (1 - part) * step
    dips = np.where(part < 0.5, from_below, from_above)  # exact at both rows
    return Dips(dips, np.sqrt(np.sum(columns**2, axis=1)) / slope)


def _row_above(heights, volumes, wanted):
    """Return the first row (n,) not below each volume (1 for the first row).

    Raises HeightError if no such row exists, or if the volume occurs at several heights.
    """
    # Envelopes of the volumes from below and above: they differ where the table is not ascending.
    rising = np.maximum.accumulate(volumes)
    falling = np.minimum.accumulate(volumes[::-1])[::-1]
    outside = ~((wanted >= falling[0]) & (wanted <= rising[-1]))
    if np.any(outside):
        raise HeightError(
            message(
                "volume_outside_table",
                "volume {volume_m3:g} m3 is outside the capacity table ({first_m3:g} to "
                "{last_m3:g} m3)",
                volume_m3=wanted[outside][0],
                first_m3=falling[0],
                last_m3=rising[-1],
            )
        )
    first = np.searchsorted(rising, wanted, side="left")  # first row not below the volume
    last = np.searchsorted(falling, wanted, side="right") - 1  # last row not above it
    unclear = last > first
    if np.any(unclear):
        low, high = heights[first[unclear][0]], heights[last[unclear][0]]
        raise HeightError(
            message(
                "volume_without_dip",
                "volume {volume_m3:g} m3 has no single dip: the table has it from "
                "{low_m:g} to {high_m:g} m",
                volume_m3=wanted[unclear][0],
                low_m=low,
                high_m=high,
            )
        )
    return np.clip(first, 1, len(heights) - 1)


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
