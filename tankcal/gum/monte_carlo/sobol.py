"""Scrambled Sobol points: a net in base 2 whose coordinates are shuffled digit by digit.

The same points as `scipy.stats.qmc.Sobol` draws with the same seed, to the last bit; loading
scipy.stats takes longer than computing a capacity table.
Sources: Joe, Kuo 2008 (direction numbers); Matousek 1998 (scrambling); Antonov, Saleev 1979
(order).
"""

from functools import cache
from pathlib import Path

import numpy as np

BITS = 30  # binary digits of a coordinate
COORDINATES = 128  # in the table of direction numbers
WEIGHTS = 2.0 ** np.arange(BITS - 1, -1, -1)  # of the digits, the first is the greatest


def sobol_points(count, inputs, seed):
    """Scrambled Sobol points: each coordinate uniform, together evenly spread.

    Parameters
    ----------
    count, inputs : int
        Numbers of points and of coordinates; a power of two spreads the points best.
    seed : int or SeedSequence
        Of the scrambling: the same seed gives the same points.

    Returns
    -------
    ndarray, shape (count, inputs)
        In [0, 1).

    References
    ----------
    Owen 1998.

    Examples
    --------
    >>> points = sobol_points(4, 2, seed=1)
    >>> np.sort(np.floor(4 * points), axis=0)  # one in each quarter, of both coordinates
    array([[0., 0.],
           [1., 1.],
           [2., 2.],
           [3., 3.]])
    """
    if inputs > COORDINATES:
        from scipy.stats import qmc  # takes long to load, and hardly a job has as many inputs

        return qmc.Sobol(inputs, rng=np.random.default_rng(seed)).random(count)
    random = np.random.default_rng(seed).spawn(1)[0]  # as scipy draws
    shift = random.integers(2, size=(inputs, BITS), dtype=np.uint32) @ WEIGHTS[::-1]
    below = np.tril(random.integers(2, size=(inputs, BITS, BITS), dtype=np.uint32), -1)
    # each digit of a direction number plus a random sum of the digits before it
    scrambled = ((below + np.eye(BITS)) @ _directions(inputs)).astype(np.int64) & 1
    numbers = np.vstack([shift, (WEIGHTS @ scrambled).T]).astype(np.int64)
    # in the order of Gray code a point differs from the one before by one direction number
    place = np.arange(1, count)
    steps = np.log2(place & -place).astype(int) + 1
    return np.bitwise_xor.accumulate(numbers[np.append(0, steps)]) / 2.0**BITS


@cache
def _directions(inputs):
    """(inputs, BITS, BITS) digits of direction numbers, a column each."""
    lines = Path(__file__).with_name("joe_kuo.txt").read_text("ascii").splitlines()
    rows = [[int(one) for one in line.split()] for line in lines if not line.startswith("#")]
    numbers = np.array([_continued(*row) for row in rows[:inputs]], dtype=np.int64)
    digits = numbers.reshape(inputs, 1, BITS) >> np.arange(BITS - 1, -1, -1)[:, None]
    return (digits & 1).astype(float)


def _continued(polynomial, *first):
    """BITS direction numbers by the recurrence of a primitive polynomial, from the first m.

    m_k = 2 a_1 m_k-1 xor 4 a_2 m_k-2 xor ... xor 2^s m_k-s xor m_k-s (Joe, Kuo 2008, equation 2)
    """
    degree, found = polynomial.bit_length() - 1, list(first)
    while len(found) < BITS:
        following = found[-degree] if degree else 1
        for back in range(1, degree + 1):
            if polynomial >> (degree - back) & 1:
                following ^= found[-back] << back
        found.append(following)
    return [m << (BITS - 1 - k) for k, m in enumerate(found)]
