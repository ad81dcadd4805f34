"""Scrambled Sobol points: a net in base 2 with randomly permuted digits.

The points equal those of `scipy.stats.qmc.Sobol` with the same seed, to the last bit. This module
exists because loading scipy.stats takes longer than computing a capacity table.

Sources: Joe, Kuo 2008 (direction numbers); Matousek 1998 (scrambling); Antonov, Saleev 1979
(order).
"""

from functools import cache
from pathlib import Path

import numpy as np

BITS = 30  # binary digits of a coordinate
COORDINATES = 128  # number of coordinates in the table of direction numbers
WEIGHTS = 2.0 ** np.arange(BITS - 1, -1, -1)  # weights of the digits, the largest first


def sobol_points(count, inputs, seed):
    """Scrambled Sobol points: each coordinate is uniform, and the points are evenly spread.

    Parameters
    ----------
    count, inputs : int
        Numbers of points and of coordinates; a power of two gives the most even spread.
    seed : int or SeedSequence
        Seed of the scrambling; equal seeds give equal points.

    Returns
    -------
    ndarray, shape (count, inputs)
        In [0, 1).

    References
    ----------
    Owen 1998.

    Examples
    --------
    One point in each quarter of both coordinates:

    >>> points = sobol_points(4, 2, seed=1)
    >>> np.sort(np.floor(4 * points), axis=0)
    array([[0., 0.],
           [1., 1.],
           [2., 2.],
           [3., 3.]])
    """
    if inputs > COORDINATES:
        from scipy.stats import qmc  # slow to load; few jobs have this number of inputs

        return qmc.Sobol(inputs, rng=np.random.default_rng(seed)).random(count)
    random = np.random.default_rng(seed).spawn(1)[0]  # like SciPy
    shift = random.integers(2, size=(inputs, BITS), dtype=np.uint32) @ WEIGHTS[::-1]
    lower_triangle = np.tril(random.integers(2, size=(inputs, BITS, BITS), dtype=np.uint32), -1)
    # Matousek's scrambling: each digit plus a random sum of the digits before it.
    scrambled = ((lower_triangle + np.eye(BITS)) @ _directions(inputs)).astype(np.int64) & 1
    numbers = np.vstack([shift, (WEIGHTS @ scrambled).T]).astype(np.int64)
    # In the order of the Gray code, neighbouring points differ by one direction number.
    place = np.arange(1, count)
    steps = np.log2(place & -place).astype(int) + 1
    return np.bitwise_xor.accumulate(numbers[np.append(0, steps)]) / 2.0**BITS


@cache
def _directions(inputs):
    """Digits (inputs, BITS, BITS) of the direction numbers, one number in each column."""
    lines = Path(__file__).with_name("joe_kuo.txt").read_text("ascii").splitlines()
    rows = [[int(word) for word in line.split()] for line in lines if not line.startswith("#")]
    numbers = np.array([_extend_directions(*row) for row in rows[:inputs]], dtype=np.int64)
    digits = numbers.reshape(inputs, 1, BITS) >> np.arange(BITS - 1, -1, -1)[:, None]
    return (digits & 1).astype(float)


def _extend_directions(polynomial, *initial):
    """BITS direction numbers from the first numbers m, by the recurrence of a primitive polynomial.

    m_k = 2 a_1 m_k-1 xor 4 a_2 m_k-2 xor ... xor 2^s m_k-s xor m_k-s (Joe, Kuo 2008, equation 2)
    """
    degree, numbers = polynomial.bit_length() - 1, list(initial)
    while len(numbers) < BITS:
        # The term m_k-s of the recurrence; the first coordinate has degree 0 and all m = 1.
        value = numbers[-degree] if degree else 1
        for lag in range(1, degree + 1):
            if polynomial >> (degree - lag) & 1:
                value ^= numbers[-lag] << lag
        numbers.append(value)
    return [m << (BITS - 1 - k) for k, m in enumerate(numbers)]
