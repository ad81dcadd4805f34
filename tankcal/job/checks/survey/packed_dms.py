"""Detection of packed degrees, minutes and seconds (12.3045 for 12° 30' 45") among decimal degrees.

In decimal degrees, the second pair of decimals reaches 60 in four of ten readings. Packed minutes
and seconds never reach 60.
"""

import numpy as np

from tankcal.messages import message

OF_PAIR, BY_CHANCE = 0.6, 1e-6  # probability of a pair below 60; smallest probability of a column
EACH = 1e-3  # readings that agree to this interval count once, degrees
DIGITS = 7  # number of decimals, more than any circle shows


def chance_of_packed(degrees):
    """Probability that decimal degrees look as packed as these; 1.0 if a pair reaches 60.

    Parameters
    ----------
    degrees : array_like, shape (n,)
        Values as written. Values with at most two decimals, and repetitions to three decimals, do
        not count.

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
    decimals = np.rint(values % 1 * unit).astype(int) % unit
    minutes, seconds = decimals // 10 ** (DIGITS - 2), decimals // 10 ** (DIGITS - 4) % 100
    if np.any((minutes >= 60) | (seconds >= 60)):
        return 1.0
    has_seconds = decimals % 10 ** (DIGITS - 2) > 0
    return round(OF_PAIR ** len(np.unique(np.floor(values[has_seconds] / EACH + EACH))), 12)


def refuse_packed(table, column, log):
    """Report a column of degrees with packed minutes and seconds."""
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
