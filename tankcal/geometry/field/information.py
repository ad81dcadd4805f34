"""Expected uncertainty of the amplitudes of a wall's components after a planned survey.

With V the covariance of the readings, P its inverse after elimination of the parameters without
prior, and K_i the part of V due to component i, the logarithms of the variances have the expected
information

    I_ij = tr(P K_i P K_j) / 2,

to which the information of their prior is added.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import replace

import numpy as np

from tankcal.geometry.field.blunders import restricted_precision
from tankcal.geometry.field.covariances import Covariances
from tankcal.geometry.field.sites import free_design

HELD = 1e-6  # prior sd of the logarithm of a given variance, which is not estimated


def expect_amplitudes(field):
    """Return the `Amplitudes` of a field with the uncertainty expected after its survey.

    Parameters
    ----------
    field : WallField
        Sites and noise of the planned survey; its readings are not used.

    Returns
    -------
    Amplitudes
        Unchanged variances, with the posterior covariance of their logarithms.
    """
    amplitudes, covariances = field.amplitudes, Covariances(field.sites, field.nominal_m)
    sizes = amplitudes.likely_m2
    # Linearise at the most likely variances, without the factor exp(s^2 / 2) of the mean.
    without_spread = replace(amplitudes, log_covariance=np.zeros_like(amplitudes.log_covariance))
    likely = replace(field, amplitudes=without_spread)
    precision = restricted_precision(likely.covariance_m2, free_design(field.sites)[0])
    shares = [
        precision @ covariances.total(size * (np.arange(len(sizes)) == i))
        for i, size in enumerate(sizes)
    ]
    information = np.array(
        [[0.5 * np.sum(first * second.T) for second in shares] for first in shares]
    )
    is_given = np.diag(amplitudes.log_covariance) == 0
    # Posterior information is prior information plus that of the readings; HELD avoids a singular
    # prior.
    prior_information = np.linalg.inv(amplitudes.log_covariance + HELD**2 * np.diag(is_given))
    return replace(amplitudes, log_covariance=np.linalg.inv(prior_information + information))
