"""Ranges of the inputs of a volume correction, and the iteration for the density at the base."""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message

DEGREES = message("unit_degc", "degC")
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


def refuse_outside(quantity, value, low, high, unit, source):
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
        return message(
            "outside_volume_correction",
            "found {value:g}; expected {low:g} to {high:g} {unit}, the range of {source}",
            value=float(values[place]),
            low=float(lows[place]),
            high=float(highs[place]),
            unit=DEGREES if unit == "degC" else unit,
            source=source,
        )

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
