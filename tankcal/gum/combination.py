"""The exact distribution of a linear combination of independent inputs, by Fourier series.

Y = sum c_i (X_i - mean_i) has the characteristic function phi(t) = prod phi_i(c_i t), and within a
period P that holds (almost) all of it

    P(Y < y) = 1/2 + y/P + sum_k phi(w k) sin(w k y)/(pi k),   w = 2 pi/P

With nothing outside of P the series is exact; Student's t leaves out 1e-10. A truth for the law of
propagation and Monte Carlo. Source: JCGM 101:2008 5.4.5, 9.2; Abate & Whitt 1992, Queueing
Systems 10, 5.
"""

from functools import cached_property

import numpy as np
import scipy

from tankcal.errors import SolutionError

_OUTSIDE = 1e-10  # probability that may lie outside of the period
_MOST_TERMS = 2**21
_SMALL = 1e-12  # of a term of the series, below it the rest is left out


class Combination:
    """sum of coefficient times distribution, all independent.

    distributions  of tankcal.gum.distributions; coefficients  (n,) or None for ones
    """

    def __init__(self, distributions, coefficients=None):
        self.distributions = tuple(distributions)
        ones = np.ones(len(self.distributions))
        self.coefficients = ones if coefficients is None else np.asarray(coefficients, dtype=float)
        pairs = list(zip(self.coefficients, self.distributions, strict=True))
        self.mean = float(sum(c * one.mean for c, one in pairs))
        self.sd = float(np.sqrt(sum((c * one.sd) ** 2 for c, one in pairs)))
        self._pairs = [(c, one) for c, one in pairs if c and one.u]
        if not self._pairs:
            raise ValueError("a combination of constants has no distribution")

    def cdf(self, y):
        """Probability of a value below y, a number."""
        y = float(y) - self.mean
        if abs(y) >= self._reach:
            return float(y > 0)
        angles = 2 * np.pi / (2 * self._reach) * y * np.arange(1, len(self._terms) + 1)
        return float(0.5 + y / (2 * self._reach) + self._terms @ np.sin(angles))

    def quantile(self, p):
        """Value below which it lies with probability p; ValueError outside 1e-9 to 1 - 1e-9."""
        if not 1e-9 < p < 1 - 1e-9:
            raise ValueError(f"probability {p}: expected between 1e-9 and 1 - 1e-9")
        ends = self.mean - self._reach, self.mean + self._reach
        return scipy.optimize.brentq(
            lambda y: self.cdf(y) - p, *ends, xtol=1e-13 * self._reach, rtol=1e-14
        )

    def half_width(self, probability):
        """Half-width of the interval about the mean that holds that probability, the shortest."""
        return self.quantile((1 + probability) / 2) - self.mean

    @cached_property
    def _reach(self):
        """Half the period: nothing, or 1e-10, lies further from the mean."""
        farthest = [abs(c) * (one.quantile(1.0) - one.mean) for c, one in self._pairs]
        if not np.all(np.isfinite(farthest)):
            each = 1 - _OUTSIDE / len(self._pairs)
            farthest = [abs(c) * (one.quantile(each) - one.mean) for c, one in self._pairs]
        return float(np.sum(farthest))

    @cached_property
    def _terms(self):
        """(terms,) phi(w k)/(pi k); raises SolutionError when they fade too slowly."""
        count = 2**10
        while count <= _MOST_TERMS:
            k = np.arange(1, count + 1)
            terms = 1 / (np.pi * k)
            for c, one in self._pairs:
                terms = terms * one.characteristic(c * np.pi / self._reach * k)
            if np.abs(terms[-count // 4 :]).max() < _SMALL:
                return terms
            count *= 4
        raise SolutionError("the distribution of this combination has too sharp edges or tails")
