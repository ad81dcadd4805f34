"""Best linear unbiased update of former radii by a survey of some courses.

The radii r of n courses were determined once with an error and may have changed since. The former
radii are r_f = r + p, with p of covariance P. A new survey measures some of them, y = H r + q, with
q of covariance R. Both errors share causes such as the scale of a tape, with C = cov(p, q). Then

    misclosure  v = y - H r_f,  S = H P H' + R - H C - C' H',
    G = (P H' - C) S^-1,        r = r_f + G v,
    error of r  (I - G H) p + G q,

so each cause of p and of q propagates under its own name. Source: Robinson 1991 (best linear
unbiased prediction). For one course and C = 0 this is recalibration by conditioning on one
observation.
"""

from dataclasses import dataclass

import numpy as np

LARGEST_W = 3.0  # |w| of a course above which its former radius is rejected


@dataclass(frozen=True)
class RadiiUpdate:
    """Update of former radii by a survey of some courses.

    Attributes
    ----------
    measured : ndarray of int, shape (k,)
        Indices of the courses measured again.
    misclosure_m, sd_m : ndarray, shape (k,)
        New minus former radius, m, and its prior standard deviation, m.
    gain : ndarray, shape (courses, k)
        Gain matrix G.
    """

    measured: np.ndarray
    misclosure_m: np.ndarray
    sd_m: np.ndarray
    gain: np.ndarray

    @property
    def w(self):
        """Misclosures divided by their standard deviations, shape (k,)."""
        return self.misclosure_m / self.sd_m

    @property
    def change_m(self):
        """Change G v of the former radii, m, shape (courses,)."""
        return self.gain @ self.misclosure_m

    @property
    def kept(self):
        """Derivative I - G H of the updated radii by the former radii, shape (courses, courses)."""
        derivative = np.eye(len(self.gain))
        derivative[:, self.measured] -= self.gain
        return derivative


def update_radii(prior_m2, measured, misclosure_m, noise_m2, shared_m=0.0):
    """`RadiiUpdate` of former radii.

    Parameters
    ----------
    prior_m2 : ndarray, shape (courses, courses)
        Covariance P of the former radii, including their possible change, m2.
    measured : ndarray of int, shape (k,)
        Indices of the courses measured again.
    misclosure_m : ndarray, shape (k,)
        New minus former radii, m.
    noise_m2 : ndarray, shape (k, k)
        Covariance R of the new radii, m2.
    shared_m : float
        Standard uncertainty common to all former and new radii, m: C = shared^2 1 1'.

    Returns
    -------
    RadiiUpdate

    Examples
    --------
    Six courses with uncertainties of 0.7 mm (common) and 0.3 mm (each), changes of 0.8 mm (common)
    and 0.3 mm (each), and one course measured again with 0.5 mm:

    >>> prior = 1.13 * np.ones((6, 6)) + 0.18 * np.eye(6)
    >>> found = update_radii(prior, np.array([0]), np.array([1.2]), np.array([[0.25]]))
    >>> [round(float(one), 2) for one in (found.w[0], *found.change_m[:2])]
    [0.96, 1.01, 0.87]
    """
    measured = np.asarray(measured, dtype=int)
    common = shared_m**2
    spread = prior_m2[np.ix_(measured, measured)] + noise_m2 - 2 * common
    # The transposed system: S is symmetric, and P H' - C = (H P - C')'.
    gain = np.linalg.solve(spread, prior_m2[measured] - common).T
    return RadiiUpdate(measured, misclosure_m, np.sqrt(np.diag(spread)), gain)
