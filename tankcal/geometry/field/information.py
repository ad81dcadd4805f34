"""How well a survey that is not made yet will tell the sizes of a wall's components.

With V the covariance of the readings, P what is left of its inverse when what no prior binds has
been taken out, and K_i the part of V by component i, the logarithms of the variances have the
expected information

    I_ij = tr(P K_i P K_j) / 2,

to which their prior adds its own.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import replace

import numpy as np

from tankcal.geometry.field.blunders import restricted_precision
from tankcal.geometry.field.covariances import Covariances
from tankcal.geometry.field.sites import free_design

HELD = 1e-6  # of a logarithm: a size that is given and not learned


def expect_amplitudes(field):
    """The `Amplitudes` of a field, as well known as its readings will tell them.

    Parameters
    ----------
    field : WallField
        Of the sites and the noise that the survey will have; its readings are not asked.

    Returns
    -------
    Amplitudes
        The same sizes, with the covariance of their logarithms after the survey.
    """
    amplitudes, covariances = field.amplitudes, Covariances(field.sites, field.nominal_m)
    sizes = amplitudes.likely_m2
    sure = replace(amplitudes, log_covariance=np.zeros_like(amplitudes.log_covariance))
    likely = replace(field, amplitudes=sure)
    precision = restricted_precision(likely.covariance_m2, free_design(field.sites)[0])
    shares = [
        precision @ covariances.total(size * (np.arange(len(sizes)) == i))
        for i, size in enumerate(sizes)
    ]
    told = np.array([[0.5 * np.sum(one * other.T) for other in shares] for one in shares])
    held = np.diag(amplitudes.log_covariance) == 0
    before = np.linalg.inv(amplitudes.log_covariance + HELD**2 * np.diag(held))
    return replace(amplitudes, log_covariance=np.linalg.inv(before + told))
