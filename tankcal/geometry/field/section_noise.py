"""Noise of each section of a wall, separated from the form of the wall.

With V the covariance of the readings due to the wall and the noise, and X the columns without
prior,

    P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1,  e = P y:

The estimated noise of the readings S of a section is N_SS e_S, with N_SS the covariance of their
noise. If that covariance is correct, the square q = e_S' N_SS e_S has the expectation r = tr(N_SS
P_SS). It is distributed as sum(l_i z_i^2), with z standard normal and l the eigenvalues of N_SS
P_SS. The variance factor q / r then has 2 r^2 / var(q) = sum(l)^2 / sum(l^2) degrees of freedom.
Departures that the form of the wall may explain are excluded from r, so form does not count as
noise.

Source: Foerstner 1979 (variance components); Satterthwaite 1946; Bartlett 1937.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.special import chdtrc

from tankcal.geometry.field.likelihood import LEAST_NOISE_M

LEAST_FACTOR = 1e-6  # variance ratio: a scatter below a thousandth of the stated sd is rounding


@dataclass(frozen=True)
class SectionNoise:
    """Variance factor of the noise of a section.

    Attributes
    ----------
    factor : float
        Ratio of estimated to stated variance.
    dof : float
        Degrees of freedom of the factor.
    redundancy : float
        Expectation of the square of the estimated noise, in units of the stated variance.
    """

    factor: float
    dof: float
    redundancy: float

    @property
    def upper_p(self):
        """Probability of a larger factor if the stated variance is correct."""
        return float(chdtrc(self.dof, self.dof * self.factor))


def noise_of_sections(field, sections):
    """Return the variance factor of the noise of each section.

    Parameters
    ----------
    field : WallField
    sections : sequence of ndarray of int
        Indices of the readings of each section.

    Returns
    -------
    tuple of SectionNoise
    """
    (lower, _), by_columns, normal = field._factors
    explained, results = field._weighted_residuals, []
    for members in sections:
        noise = field.noise_m2[np.ix_(members, members)]
        root = np.linalg.cholesky(noise + LEAST_NOISE_M**2 * np.eye(len(members)))
        # With N_SS = L L', the symmetric matrix L' P_SS L has the eigenvalues of N_SS P_SS.
        whitened = np.zeros((len(explained), len(members)))
        whitened[members] = root
        whitened = scipy.linalg.solve_triangular(lower, whitened, lower=True, check_finite=False)
        by_free_columns = root.T @ by_columns[members]
        inner = whitened.T @ whitened - by_free_columns @ scipy.linalg.cho_solve(
            normal, by_free_columns.T
        )
        shares = np.clip(np.linalg.eigvalsh(inner), 0.0, 1.0)
        redundancy = shares.sum()
        square = np.sum((root.T @ explained[members]) ** 2)
        results.append(
            SectionNoise(
                factor=max(float(square / redundancy), LEAST_FACTOR),
                dof=float(redundancy**2 / (shares @ shares)),
                redundancy=float(redundancy),
            )
        )
    return tuple(results)


def bartlett(factors, dofs):
    """Test the equality of variances (Bartlett's test).

    Parameters
    ----------
    factors, dofs : array_like, shape (k,)
        Estimated variances, up to a common factor, and their degrees of freedom; k of 2 or more.

    Returns
    -------
    statistic : float
        Distributed as chi-square if the variances are equal.
    dof : int
        k - 1.
    p : float
        Probability of a larger statistic.

    Examples
    --------
    >>> statistic, dof, p = bartlett([1.0, 1.0, 1.0], [10, 20, 30])
    >>> round(statistic, 12), dof, round(p, 12)
    (0.0, 2, 1.0)
    """
    factors, dofs = np.asarray(factors, dtype=float), np.asarray(dofs, dtype=float)
    total, count = dofs.sum(), len(factors)
    pooled = dofs @ factors / total
    statistic = total * np.log(pooled) - dofs @ np.log(factors)
    # Bartlett's second-order correction for few degrees of freedom.
    statistic /= 1 + (np.sum(1 / dofs) - 1 / total) / (3 * (count - 1))
    return float(statistic), count - 1, float(chdtrc(count - 1, statistic))
