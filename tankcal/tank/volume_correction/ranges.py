"""Ranges of the inputs of a volume correction, and the iteration for the density at the base."""

import math

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message

DEGREES = message("unit_degc", "degC")
FAHRENHEIT = message("unit_degf", "degF")
RELATIVE = message("unit_relative_density", "relative density at 60 degF")
SIGNIFICANT = 6  # digits of printed limits
_BINARY = 1e-12  # relative error of a decimal limit in binary, and of a conversion
MOST_ROUNDS = 200  # of the fixed-point iteration for a density at the base
ROUNDS_OF_GROUPS = 30  # later rounds keep the group or class, so that it cannot alternate
CONVERGED = 1e-13  # relative change of the density


class OutsideRangeError(InputError):
    """A value outside the range of a volume correction.

    Attributes
    ----------
    quantity : str
        Name of the input, such as "temperature_c".
    is_outside : ndarray of bool
        Values outside the range.
    expected_at : callable
        Text for a place of `is_outside`.
    """

    def __init__(self, quantity, is_outside, expected_at):
        first = np.argwhere(is_outside)[0]
        super().__init__(Problem(quantity, expected_at(tuple(first))))
        self.quantity, self.is_outside, self.expected_at = quantity, is_outside, expected_at

    def __reduce__(self):  # the text of each place is a function, which cannot be pickled
        return InputError, (self.problems,)


def inside(low, high, decimals=None):
    """Round the limits of a range for print; the printed range is never wider than the range.

    Parameters
    ----------
    low, high : float
    decimals : int, optional
        None: six significant digits.

    Returns
    -------
    tuple of float
    """
    return _round(low, math.ceil, decimals), _round(high, math.floor, decimals)


def _round(limit, whole, decimals):
    """Limit rounded by `whole`, `math.ceil` or `math.floor`."""
    if decimals is None:
        decimals = (
            SIGNIFICANT if limit == 0 else SIGNIFICANT - 1 - math.floor(math.log10(abs(limit)))
        )
    nearest = round(limit, decimals)
    if math.isclose(nearest, limit, rel_tol=_BINARY):
        return nearest
    return whole(limit * 10.0**decimals) / 10.0**decimals


def refuse_outside(quantity, value, low, high, unit, source, original=None):
    """Raise OutsideRangeError if a value is outside the range of a volume correction.

    Parameters
    ----------
    quantity : str
        Name of the input, such as "temperature_c".
    value : float or ndarray
        Real, or complex in a derivative.
    low, high : float or ndarray
        Limits, both allowed.
    unit : str
    source : str
        Volume correction with this range.
    original : tuple, optional
        (low, high, unit) of the source, if its range is in another unit.

    Raises
    ------
    OutsideRangeError
        For a value that is not finite or outside the range. A value is never moved to a limit.
    """
    values, lows, highs = np.broadcast_arrays(np.real(value), low, high)
    is_outside = ~((values >= lows) & (values <= highs))
    if not np.any(is_outside):
        return

    def expected_at(place):
        # Converted limits have many digits: the range of the source is printed beside them.
        is_converted = original is not None and unit == "degC"
        low_shown, high_shown = inside(lows[place], highs[place], 2 if is_converted else None)
        shown = {
            "value": float(values[place]),
            "low": low_shown,
            "high": high_shown,
            "unit": DEGREES if unit == "degC" else unit,
            "source": source,
        }
        if original is None:
            return message(
                "outside_volume_correction",
                "found {value:g}; expected {low:g} to {high:g} {unit}, the range of {source}",
                **shown,
            )
        least, most = inside(*(float(np.broadcast_to(limit, values.shape)[place])
                               for limit in original[:2]))  # fmt: skip
        return message(
            "outside_volume_correction_of",
            "found {value:g}; expected {low:g} to {high:g} {unit} ({least:g} to {most:g} "
            "{source_unit}), the range of {source}",
            least=least, most=most, source_unit=original[2], **shown,
        )  # fmt: skip

    raise OutsideRangeError(quantity, is_outside, expected_at)


def iterate_density(density, next_density, source):
    """Density at the base by fixed-point iteration from an observed density.

    The density at the base changes the correction slowly, so each round gains one digit or more.

    Parameters
    ----------
    density : float or ndarray
        Start value, real, or complex in a derivative.
    next_density : callable
        next_density(base, bound) returns the density at the base by the correction at the density
        `base`. `bound` is the density that decides the group of products; None: `base`.
    source : str
        Volume correction.

    Returns
    -------
    float or ndarray

    Raises
    ------
    OutsideRangeError
        If the iteration does not converge.
    """
    base, bound = density, None
    for rounds in range(MOST_ROUNDS):
        before = base
        with np.errstate(all="ignore"):  # far outside the range; the caller refuses the result
            base = next_density(before, bound)
            is_converged = np.abs(base - before) <= CONVERGED * np.abs(base)
        if rounds == ROUNDS_OF_GROUPS:
            bound = np.real(base)
        if np.all(is_converged):
            break
    refuse_not_converged(is_converged, source)
    return base


def refuse_not_converged(is_converged, source):
    """Raise OutsideRangeError if no density at the base was determined for an observed density.

    Parameters
    ----------
    is_converged : ndarray of bool
    source : str
        Volume correction.

    Raises
    ------
    OutsideRangeError
    """
    if np.all(is_converged):
        return

    def expected_at(_):
        return message(
            "no_density_at_base",
            "{source} gives no density at the base temperature for this observed density; expected "
            "another density or temperature of the sample",
            source=source,
        )

    raise OutsideRangeError("density_kg_m3", ~is_converged, expected_at)
