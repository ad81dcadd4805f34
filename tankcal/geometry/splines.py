"""Periodic cubic splines: the smoothest closed curve through values at uneven knots.

Between two knots it is the cubic of Hermite by the values and slopes at both; the slopes are those
that leave the curvature without a jump at every knot.
Source: de Boor 1978, chapter IV.
"""

import numpy as np

# of the value at the start, at the end, of the slope at the start, at the end: powers of t
_HERMITE = np.array(
    [[1.0, 0.0, -3.0, 2.0], [0.0, 0.0, 3.0, -2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, -1.0, 1.0]]
)


def periodic_slopes(knots, period):
    """Slopes at the knots of the periodic cubic spline through values there: slopes @ values.

    s_i-1 / h_i-1 + 2 s_i (1 / h_i-1 + 1 / h_i) + s_i+1 / h_i
    = 3 (v_i - v_i-1) / h_i-1^2 + 3 (v_i+1 - v_i) / h_i^2

    Parameters
    ----------
    knots : ndarray, shape (n,)
        Ascending, within one period.
    period : float

    Returns
    -------
    ndarray, shape (n, n)
        In the inverse of the unit of the knots.

    Examples
    --------
    >>> slopes = periodic_slopes(np.linspace(0, 2 * np.pi, 32, endpoint=False), 2 * np.pi)
    >>> sine = np.sin(np.linspace(0, 2 * np.pi, 32, endpoint=False))
    >>> float(np.round(slopes @ sine, 4)[0])
    1.0
    """
    n = len(knots)
    here, after = np.arange(n), np.roll(np.arange(n), -1)
    step = np.diff(knots, append=knots[0] + period)
    left, right = np.zeros((n, n)), np.zeros((n, n))
    for row, other in ((here, after), (after, here)):  # both ends of each step
        np.add.at(left, (row, row), 2 / step)
        np.add.at(left, (row, other), 1 / step)
        np.add.at(right, (row, after), 3 / step**2)
        np.add.at(right, (row, here), -3 / step**2)
    return np.linalg.solve(left, right)


def cardinal_splines(knots, period, slopes, at, derivative=0):
    """Periodic cubic splines that are one at their own knot and zero at all others.

    Parameters
    ----------
    knots : ndarray, shape (n,)
        Ascending, within one period.
    period : float
    slopes : ndarray, shape (n, n)
        Of `periodic_slopes`.
    at : array_like, shape (m,)
        From the first knot to the same one a period later.
    derivative : int
        Order of the derivative.

    Returns
    -------
    ndarray, shape (m, n)
        What multiplies the values at the knots.

    Examples
    --------
    >>> knots = np.array([0.0, 1.0, 2.5, 4.0])
    >>> slopes = periodic_slopes(knots, 5.0)
    >>> bool(np.allclose(cardinal_splines(knots, 5.0, slopes, knots), np.eye(4)))
    True
    """
    at = np.asarray(at, dtype=float)
    start = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 1)
    end = (start + 1) % len(knots)
    step = np.diff(knots, append=knots[0] + period)[start]
    powers = np.polynomial.polynomial.polyder(_HERMITE.T, derivative)
    first, last, rise, fall = np.polynomial.polynomial.polyval((at - knots[start]) / step, powers)
    found = (step * rise)[:, None] * slopes[start] + (step * fall)[:, None] * slopes[end]
    rows = np.arange(len(at))
    found[rows, start] += first
    found[rows, end] += last
    return found / (step**derivative)[:, None]
