"""Prediction of the effect of dropping parameters, by the Schur complement of their covariance.

A dropped parameter is held at zero. The parameters k that are kept then have

    values  x_k - C_kd C_dd^-1 (x_d - 0)        covariance  C_kk - C_kd C_dd^-1 C_dk

The prediction is exact for a linear model with unchanged sigma0. Source: Koch 1999, section 3.2.7.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.calibration.parameters.significance import factor_correlations
from tankcal.survey.network import correlations


@dataclass(frozen=True)
class Prediction:
    """Parameters that are kept when others are held at zero.

    Attributes
    ----------
    dropped, kept : tuple of str
        Names in the order of the parameters.
    values : ndarray, shape (k,)
        Predicted values of the kept parameters; nan without values.
    covariance : ndarray, shape (k, k)
        Predicted covariance matrix of the kept parameters.
    positive_definite : bool
        Whether the dropped parameters can be separated. If not, all numbers are nan.
    """

    dropped: tuple
    kept: tuple
    values: np.ndarray
    covariance: np.ndarray
    positive_definite: bool = True

    @property
    def sds(self):
        """Standard deviations (k,) of the kept parameters; nan for a negative variance."""
        variance = np.diag(self.covariance)
        return np.sqrt(np.where(variance >= 0, variance, np.nan))

    @property
    def correlation(self):
        """Correlation matrix (k, k) of the kept parameters."""
        if not self.positive_definite:
            return self.covariance
        return correlations(self.covariance)


def drop_parameters(names, covariance, dropped, values=None):
    """Predict values and covariance of the kept parameters when others are dropped.

    Parameters
    ----------
    names : sequence of str
        Names of the n parameters.
    covariance : array_like, shape (n, n)
        Covariance matrix in the units of the parameters.
    dropped : sequence of str
        Names of the parameters to drop.
    values : array_like, shape (n,), optional
        Values of the parameters.

    Returns
    -------
    Prediction

    Raises
    ------
    ValueError
        If a dropped name is unknown.
    """
    unknown = [name for name in dropped if name not in names]
    if unknown:
        raise ValueError(f"no adjusted parameter {', '.join(unknown)} among {', '.join(names)}")
    covariance = np.asarray(covariance, dtype=float)
    is_dropped = np.array([name in dropped for name in names])
    x = np.full(len(names), np.nan) if values is None else np.asarray(values, dtype=float)
    dropped_names = tuple(name for name, out in zip(names, is_dropped, strict=True) if out)
    kept = tuple(name for name, out in zip(names, is_dropped, strict=True) if not out)
    c_dd, cross = (
        covariance[np.ix_(is_dropped, is_dropped)],
        covariance[np.ix_(~is_dropped, is_dropped)],
    )
    lower = factor_correlations(c_dd)
    if lower is None:
        unknown_values = np.full((len(kept), len(kept)), np.nan)
        return Prediction(
            dropped_names,
            kept,
            unknown_values.diagonal().copy(),
            unknown_values,
            positive_definite=False,
        )
    sd = np.sqrt(np.diag(c_dd))
    # With C_dd = S L L' S, S = diag(sd), the products with C_dd^-1 need two triangular solutions.
    half = scipy.linalg.solve_triangular(lower, (cross / sd).T, lower=True)
    pull = scipy.linalg.solve_triangular(lower, x[is_dropped] / sd, lower=True, check_finite=False)
    c_kept = covariance[np.ix_(~is_dropped, ~is_dropped)] - half.T @ half
    return Prediction(dropped_names, kept, x[~is_dropped] - half.T @ pull, (c_kept + c_kept.T) / 2)
