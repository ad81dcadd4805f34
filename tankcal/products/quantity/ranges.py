"""Ranges of the inputs of a volume correction."""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message


class OutsideRangeError(InputError):
    """A value outside the range of a volume correction.

    Attributes
    ----------
    quantity : str
        Name of the input, such as "temperature_c".
    is_outside : ndarray of bool
        Values outside the range.
    expected : Message
        Text for the first of them.
    """

    def __init__(self, quantity, is_outside, expected):
        super().__init__(Problem(quantity, expected))
        self.quantity, self.is_outside, self.expected = quantity, is_outside, expected


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
    place = tuple(np.argwhere(is_outside)[0])
    expected = message(
        "outside_volume_correction",
        "found {value:g}; expected {low:g} to {high:g} {unit}, the range of {source}",
        value=float(values[place]),
        low=float(lows[place]),
        high=float(highs[place]),
        unit=unit,
        source=source,
    )
    raise OutsideRangeError(quantity, is_outside, expected)
