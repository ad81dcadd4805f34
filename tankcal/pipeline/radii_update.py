"""Former radii brought up to date by a survey of some courses: linear, and least in variance.

The radii r of n courses were found once with an error, and changed since. So the former ones are
r_f = r + p, p of covariance P; a new survey finds some of them, y = H r + q, q of covariance R.
What both share (one tape) is C = cov(p, q). Then

    misclosure  v = y - H r_f,  S = H P H' + R - H C - C' H',
    G = (P H' - C) S^-1,        r = r_f + G v,
    its error   (I - G H) p + G q,

so that each cause of p and of q goes on with its own name. Source: Robinson 1991 (best linear
unbiased prediction); of one course, without C, recalibration by conditioning on one observation.
"""

from dataclasses import dataclass

import numpy as np

LARGEST_W = 3.0  # of a course: beyond it the former radius does not explain what was found


@dataclass(frozen=True)
class RadiiUpdate:
    """What a survey of some courses makes of former radii.

    Attributes
    ----------
    measured : ndarray of int, shape (k,)
        Courses that were measured again.
    misclosure_m, sd_m : ndarray, shape (k,)
        Found less former, and the standard deviation that it was expected with.
    gain : ndarray, shape (courses, k)
        G.
    """

    measured: np.ndarray
    misclosure_m: np.ndarray
    sd_m: np.ndarray
    gain: np.ndarray

    @property
    def w(self):
        """(k,) misclosures over their standard deviations."""
        return self.misclosure_m / self.sd_m

    @property
    def change_m(self):
        """(courses,) by which the radii are other than the former ones: G v."""
        return self.gain @ self.misclosure_m

    @property
    def kept(self):
        """(courses, courses) I - G H: derivative of the radii by the former ones."""
        found = np.eye(len(self.gain))
        found[:, self.measured] -= self.gain
        return found


def update_radii(prior_m2, measured, misclosure_m, noise_m2, shared_m=0.0):
    """`RadiiUpdate` of former radii.

    Parameters
    ----------
    prior_m2 : ndarray, shape (courses, courses)
        P: of the former radii and of how they may have changed, m2.
    measured : ndarray of int, shape (k,)
    misclosure_m : ndarray, shape (k,)
        Found less former, m.
    noise_m2 : ndarray, shape (k, k)
        R: of what was found, m2.
    shared_m : float
        Standard uncertainty that all of them share, the former and the new: C = shared^2 1 1'.

    Returns
    -------
    RadiiUpdate

    Examples
    --------
    Six courses, 0.7 and 0.3 mm as they were, 0.8 and 0.3 mm of change, one found with 0.5 mm:

    >>> prior = 1.13 * np.ones((6, 6)) + 0.18 * np.eye(6)
    >>> found = update_radii(prior, np.array([0]), np.array([1.2]), np.array([[0.25]]))
    >>> [round(float(one), 2) for one in (found.w[0], *found.change_m[:2])]
    [0.96, 1.01, 0.87]
    """
    measured = np.asarray(measured, dtype=int)
    common = shared_m**2
    spread = prior_m2[np.ix_(measured, measured)] + noise_m2 - 2 * common
    gain = np.linalg.solve(spread, prior_m2[measured] - common).T
    return RadiiUpdate(measured, misclosure_m, np.sqrt(np.diag(spread)), gain)
