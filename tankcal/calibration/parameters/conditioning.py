"""What dropping parameters would do, foretold by the Schur complement of their covariance.

A parameter that is dropped is held at zero. Of the parameters k that are kept:

    values  x_k - C_kd C_dd^-1 (x_d - 0)        covariance  C_kk - C_kd C_dd^-1 C_dk

Exact for a linear model at unchanged sigma0. Source: Koch 1999, section 3.2.7.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.calibration.parameters.significance import cholesky_of
from tankcal.survey.network import correlations


@dataclass(frozen=True)
class Without:
    """The parameters that are kept when others are held at zero.

    dropped, kept      names, in the order of the parameters
    values             (k,) of those kept; nan without values
    covariance         (k, k)
    positive_definite  False: the dropped ones cannot be told apart, all numbers are nan
    """

    dropped: tuple
    kept: tuple
    values: np.ndarray
    covariance: np.ndarray
    positive_definite: bool = True

    @property
    def sds(self):
        """(k,) standard deviations of those kept; nan for a variance that came out negative."""
        variance = np.diag(self.covariance)
        return np.sqrt(np.where(variance >= 0, variance, np.nan))

    @property
    def correlation(self):
        """(k, k) correlations of those kept."""
        if not self.positive_definite:
            return self.covariance
        return correlations(self.covariance)


def drop_parameters(names, covariance, dropped, values=None):
    """The Without of parameters.

    names       (n,)                  covariance  (n, n), in the units of the parameters
    dropped     names among them      values      (n,) or None

    Raises ValueError for a name that is not among them.
    """
    unknown = [name for name in dropped if name not in names]
    if unknown:
        raise ValueError(f"no adjusted parameter {', '.join(unknown)} among {', '.join(names)}")
    covariance = np.asarray(covariance, dtype=float)
    goes = np.array([name in dropped for name in names])
    x = np.full(len(names), np.nan) if values is None else np.asarray(values, dtype=float)
    gone = tuple(name for name, out in zip(names, goes, strict=True) if out)
    kept = tuple(name for name, out in zip(names, goes, strict=True) if not out)
    own, cross = covariance[np.ix_(goes, goes)], covariance[np.ix_(~goes, goes)]
    lower = cholesky_of(own)
    if lower is None:
        nothing = np.full((len(kept), len(kept)), np.nan)
        return Without(gone, kept, nothing.diagonal().copy(), nothing, positive_definite=False)
    sd = np.sqrt(np.diag(own))
    half = scipy.linalg.solve_triangular(lower, (cross / sd).T, lower=True)
    pull = scipy.linalg.solve_triangular(lower, x[goes] / sd, lower=True, check_finite=False)
    left = covariance[np.ix_(~goes, ~goes)] - half.T @ half
    return Without(gone, kept, x[~goes] - half.T @ pull, (left + left.T) / 2)
