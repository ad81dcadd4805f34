"""Effective degrees of freedom and coverage factors: what makes U of u.

Source: JCGM 100:2008 (GUM) G.4.
"""

from functools import cache

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import cheb2poly
from scipy.special import ndtr, ndtri, stdtrit

_SMOOTH_DOF, _DEGREE = 3.0, 20  # from where on, and of what degree, k is a polynomial in 1/dof
_MANY, _SQUARE, _OF_SQUARES = 500, 56.0, 28  # tails, largest z^2 and degree of that of a fixed dof


def effective_dof(contributions, dof):
    """Effective degrees of freedom by Welch-Satterthwaite, u^4 / sum(u_i^4 / dof_i).

    Parameters
    ----------
    contributions : (rows, inputs) array
        Standard uncertainty that each input brings, in the unit of the output.
    dof : (inputs,) array
        Degrees of freedom of each; may be inf.

    Returns
    -------
    (rows,) array
        Inf where no input with finite degrees of freedom contributes.

    Notes
    -----
    JCGM 100:2008 G.4.1, equation G.2b.

    Examples
    --------
    >>> effective_dof([[3.0, 4.0]], [9.0, np.inf]).round(2).tolist()
    [69.44]
    """
    variance = np.asarray(contributions, dtype=float) ** 2
    dof = np.asarray(dof, dtype=float)
    return dof_of(np.sum(variance, axis=1), sum_of_fourths(variance, dof), least_of(dof))


def sum_of_fourths(variance, dof):
    """Sum of u_i^4 / dof_i.

    This and the variance itself are all that the rule needs: what searches or writes formulas takes
    both from here, and `dof_of` brings them together.

    Parameters
    ----------
    variance : ndarray, shape (..., components)
        u_i^2 of each component.
    dof : array_like, shape (components,)
        Degrees of freedom; may be inf.

    Returns
    -------
    ndarray, shape (...,)

    Examples
    --------
    >>> float(sum_of_fourths(np.array([9.0, 16.0]), [9.0, np.inf]))
    9.0
    """
    dof = np.asarray(dof, dtype=float)
    finite = np.isfinite(dof)
    return variance[..., finite] ** 2 @ (1 / dof[finite])


def dof_of(variance, fourths, least=0.0):
    """Effective degrees of freedom u^4 / sum of u_i^4 / dof_i.

    Parameters
    ----------
    variance : array_like, shape (...,)
        u^2.
    fourths : array_like, shape (...,)
        The sum, of `sum_of_fourths`.
    least : float, optional
        Of any component: the effective ones are never fewer, and rounding makes them none.

    Returns
    -------
    ndarray, shape (...,)
        Inf where no component with finite degrees of freedom contributes.

    Examples
    --------
    >>> round(float(dof_of(25.0, 9.0)), 2)
    69.44
    """
    variance, fourths = np.asarray(variance, dtype=float), np.asarray(fourths, dtype=float)
    dof = np.full(variance.shape, np.inf)
    np.divide(variance**2, fourths, out=dof, where=fourths > 0)
    return np.maximum(dof, least)


def least_of(dof):
    """The least of finite degrees of freedom; 0 without any.

    Parameters
    ----------
    dof : array_like, shape (n,)

    Returns
    -------
    float

    Examples
    --------
    >>> least_of([np.inf, 7.0, 9.0]), least_of([np.inf])
    (7.0, 0.0)
    """
    dof = np.asarray(dof, dtype=float)
    return float(np.min(dof[np.isfinite(dof)], initial=np.inf)) if np.isfinite(dof).any() else 0.0


def coverage_factor(probability, dof):
    """Coverage factor k of a symmetric interval: of Student's t, of the normal for infinite dof.

    Parameters
    ----------
    probability : float
        Of the interval, between 0 and 1.
    dof : (...) array
        Degrees of freedom; may be inf.

    Returns
    -------
    (...) array
        k, without a unit.

    Raises
    ------
    ValueError
        For a probability that is not between 0 and 1.

    Examples
    --------
    >>> coverage_factor(0.95, [8, np.inf]).round(3).tolist()
    [2.306, 1.96]
    """
    if not 0 < probability < 1:
        raise ValueError(f"coverage probability {probability}: expected between 0 and 1")
    dof = np.asarray(dof, dtype=float)
    upper = (1 + probability) / 2
    k = np.full(dof.shape, ndtri(upper))
    finite = np.isfinite(dof)
    k[finite] = _student(upper, dof[finite])
    return k


def _student(upper, dof):
    """(n,) quantiles of t; of many from 3 degrees of freedom on by a polynomial in 1/dof.

    The quantile is smooth in 1/dof: the Chebyshev polynomial of degree 20 has it to 1e-14 of
    itself (probabilities 0.1 to 0.9999), in a tenth of the time.
    """
    smooth = dof >= _SMOOTH_DOF
    if np.count_nonzero(smooth) <= _DEGREE:
        return stdtrit(dof, upper)
    k = np.empty(len(dof))
    k[smooth], k[~smooth] = _by_polynomial(upper, dof[smooth]), stdtrit(dof[~smooth], upper)
    return k


def _by_polynomial(upper, dof):
    """(n,) quantiles of t, in x = 2 * _SMOOTH_DOF / dof - 1 from -1 to 1, by Horner in place."""
    return _horner(_powers_of(upper), 2 * _SMOOTH_DOF / dof - 1)


@cache
def _powers_of(upper):
    """Coefficients by the powers of x of the Chebyshev polynomial."""
    at = Chebyshev.interpolate(lambda x: stdtrit(2 * _SMOOTH_DOF / (x + 1), upper), _DEGREE)
    return tuple(cheb2poly(at.coef))


def student_quantile(tail, dof):
    """Quantiles of Student's t at many probabilities.

    log(t/z) is smooth in z^2, z the quantile of a normal. From 3 degrees of freedom on its
    Chebyshev polynomial of degree 28 gives t to 3e-12 of itself, in a fourth of the time.

    Parameters
    ----------
    tail : array_like, shape (...,)
        Probabilities, 0.5 at most.
    dof : float
        Degrees of freedom, finite.

    Returns
    -------
    ndarray, shape (...,)
        0 or less.

    Examples
    --------
    >>> student_quantile([0.025, 0.5], 8).round(3).tolist()
    [-2.306, 0.0]
    """
    tail = np.asarray(tail, dtype=float)
    if tail.size < _MANY or dof < _SMOOTH_DOF:
        return _one_by_one(tail, dof)
    z = ndtri(tail)
    x = z * z
    x *= 2 / _SQUARE
    x -= 1.0
    beyond = ~(x <= 1.0)
    x[beyond] = 1.0
    t = _horner(_powers_of_squares(dof), x)
    np.exp(t, out=t)
    t *= z
    t[beyond] = _one_by_one(tail[beyond], dof)
    return t


def _one_by_one(tail, dof):
    return 0.0 - np.abs(stdtrit(dof, tail))  # of probability 0 scipy says inf for some dof


@cache
def _powers_of_squares(dof):
    """Coefficients by the powers of x = 2 z^2 / _SQUARE - 1 of the polynomial of log(t/z)."""

    def logarithm(x):
        z = np.sqrt((x + 1) * _SQUARE / 2)
        return np.log(stdtrit(dof, ndtr(-z)) / -z)

    return tuple(cheb2poly(Chebyshev.interpolate(logarithm, _OF_SQUARES).coef))


def _horner(powers, x):
    """The polynomial of these coefficients, the constant first, at (...) x."""
    last, *others = reversed(powers)
    found = np.full(x.shape, last)
    for coefficient in others:
        found *= x
        found += coefficient
    return found
