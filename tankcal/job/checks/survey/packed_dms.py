"""Degrees, minutes and seconds that stand packed (12.3045 for 12° 30' 45") among decimal degrees.

The second pair of decimals of decimal degrees reaches 60 in four of ten readings, whatever is read;
packed seconds never do, nor packed minutes.
"""

import numpy as np

from tankcal.messages import message

OF_PAIR, BY_CHANCE = 0.6, 1e-6  # pairs of digits below 60; columns of decimal degrees without one
EACH = 1e-3  # degrees: readings that share so many decimals are one
DIGITS = 7  # beyond the decimals that any circle shows


def chance_of_packed(degrees):
    """Probability that decimal degrees look as packed as these; 1.0 where a pair reaches 60.

    Parameters
    ----------
    degrees : array_like, shape (n,)
        As written. Those of at most two decimals do not count, nor those that share three with
        another one.

    Returns
    -------
    float

    Examples
    --------
    >>> chance_of_packed([12.3045, 81.0015, 200.594]), chance_of_packed([12.3045, 81.0061])
    (0.216, 1.0)
    """
    values = np.abs(np.asarray(degrees, dtype=float))
    values = values[np.isfinite(values)]
    unit = 10**DIGITS
    part = np.rint(values % 1 * unit).astype(int) % unit
    minutes, seconds = part // 10 ** (DIGITS - 2), part // 10 ** (DIGITS - 4) % 100
    if np.any((minutes >= 60) | (seconds >= 60)):
        return 1.0
    fine = part % 10 ** (DIGITS - 2) > 0
    return round(OF_PAIR ** len(np.unique(np.floor(values[fine] / EACH + EACH))), 12)


def refuse_packed(table, column, log):
    """A problem for a column of degrees whose minutes and seconds are packed."""
    degrees = table.numbers(column)
    chance = chance_of_packed(degrees)
    if chance < BY_CHANCE:
        first = int(np.argmax(np.isfinite(degrees)))
        expected = message(
            "packed_dms",
            "no minutes or seconds of the {count} angles reach 60 if they are read as degrees,"
            " minutes and seconds (12.3045 for 12 30 45): expected decimal degrees, or such angles"
            " in the column {dms}, as 12 30 45",
            count=int(np.isfinite(degrees).sum()),
            dms=column.removesuffix("deg") + "dms",
        )
        log.problem(table.file, expected, table.rows[first], column)
