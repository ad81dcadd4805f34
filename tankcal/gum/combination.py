"""Exact distribution of a linear combination of independent inputs, by Fourier series.

Y = sum c_i (X_i - mean_i) has the characteristic function phi(t) = prod phi_i(c_i t). Within a
period P that contains (almost) the whole distribution:

    P(Y < y) = 1/2 + y/P + sum_k phi(w k) sin(w k y)/(pi k),   w = 2 pi/P

The series is exact if no probability lies outside P. For Student's t, a probability of 1e-10 lies
outside. The result serves as a reference for the law of propagation and for Monte Carlo.

Source: JCGM 101:2008 5.4.5, 9.2; Abate & Whitt 1992, Queueing Systems 10, 5.
"""

from functools import cached_property

import numpy as np
import scipy

from tankcal.errors import SolutionError

_OUTSIDE = 1e-10  # largest probability outside the period
_MOST_TERMS = 2**21  # largest number of terms of the series
_SMALL = 1e-12  # term of the series below which the remainder is neglected


class Combination:
    """Linear combination of independent inputs.

    Parameters
    ----------
    distributions : sequence of Distribution, length n
        Distributions of the inputs, of tankcal.gum.distributions.
    coefficients : array_like, shape (n,), optional
        Coefficients; None: all one.

    Attributes
    ----------
    mean, sd : float
        Mean and standard deviation.

    Raises
    ------
    ValueError
        If all inputs are constant.

    Examples
    --------
    The sum of two rectangular inputs is triangular:

    >>> from tankcal.gum import within
    >>> total = Combination([within(1.0), within(1.0)])
    >>> round(total.cdf(1.0), 6)
    0.875
    """

    def __init__(self, distributions, coefficients=None):
        self.distributions = tuple(distributions)
        ones = np.ones(len(self.distributions))
        self.coefficients = ones if coefficients is None else np.asarray(coefficients, dtype=float)
        pairs = list(zip(self.coefficients, self.distributions, strict=True))
        self.mean = float(sum(c * distribution.mean for c, distribution in pairs))
        self.sd = float(np.sqrt(sum((c * distribution.sd) ** 2 for c, distribution in pairs)))
        self._pairs = [(c, distribution) for c, distribution in pairs if c and distribution.u]
        if not self._pairs:
            raise ValueError("a combination of constants has no distribution")

    def cdf(self, y):
        """Probability of a value below y (float)."""
        y = float(y) - self.mean
        if abs(y) >= self._reach:
            return float(y > 0)
        # w k y, with the period P twice the reach.
        angles = 2 * np.pi / (2 * self._reach) * y * np.arange(1, len(self._terms) + 1)
        return float(0.5 + y / (2 * self._reach) + self._terms @ np.sin(angles))

    def quantile(self, p):
        """Value with probability p below it.

        Parameters
        ----------
        p : float
            Probability, 1e-9 to 1 - 1e-9.

        Returns
        -------
        float

        Raises
        ------
        ValueError
            For a probability outside this range.
        """
        if not 1e-9 < p < 1 - 1e-9:
            raise ValueError(f"probability {p}: expected between 1e-9 and 1 - 1e-9")
        ends = self.mean - self._reach, self.mean + self._reach
        return scipy.optimize.brentq(
            lambda y: self.cdf(y) - p, *ends, xtol=1e-13 * self._reach, rtol=1e-14
        )

    def half_width(self, probability):
        """Half-width of the symmetric interval with a given coverage probability.

        The interval about the mean is also the shortest interval.
        """
        return self.quantile((1 + probability) / 2) - self.mean

    @cached_property
    def _reach(self):
        """Half the period: at most a probability of 1e-10 lies farther from the mean."""
        # Bounded inputs have an exact reach; otherwise quantiles share the probability outside.
        farthest = [
            abs(c) * (distribution.quantile(1.0) - distribution.mean)
            for c, distribution in self._pairs
        ]
        if not np.all(np.isfinite(farthest)):
            probability = 1 - _OUTSIDE / len(self._pairs)
            farthest = [
                abs(c) * (distribution.quantile(probability) - distribution.mean)
                for c, distribution in self._pairs
            ]
        return float(np.sum(farthest))

    @cached_property
    def _terms(self):
        """Terms phi(w k)/(pi k) of the series; raises SolutionError if they decrease too slowly."""
        count = 2**10
        while count <= _MOST_TERMS:
            k = np.arange(1, count + 1)
            terms = 1 / (np.pi * k)
            for c, distribution in self._pairs:
                terms = terms * distribution.characteristic(c * np.pi / self._reach * k)
            # The last quarter represents the neglected terms, because single terms may vanish by
            # chance.
            if np.abs(terms[-count // 4 :]).max() < _SMALL:
                return terms
            count *= 4
        raise SolutionError("the distribution of this combination has too sharp edges or tails")
