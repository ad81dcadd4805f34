"""Tests of single parameters and of groups of parameters against zero.

    one parameter    F = x^2 / s^2                    against F(1 - alpha; 1, dof)
    a group of p     F = x' Q^-1 x / (p sigma0^2)     against F(1 - alpha; p, dof)

The covariance matrix is sigma0^2 Q. If sigma0 is not estimated, dof is infinite and p F has a
chi-square distribution. Groups are solved with the Cholesky factor of their correlations and not
inverted, because the units of K1 to K4 differ by many powers of ten.

Source: Pessoa 2017 (11-13); Koch 1999, section 4.2.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.special import chdtrc, chdtri, fdtrc, fdtri

ALPHA = 0.05  # significance level of the tests
GROUPS = (("x0", "y0"), ("P1", "P2"), ("A", "B"), ("K1", "K2", "K3", "K4"))
WITHOUT_DECISION = ("c",)  # no camera has c = 0, so that a test against 0 is meaningless


@dataclass(frozen=True)
class ZeroTest:
    """Test of a parameter or of a group against zero.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters; one name for a single parameter.
    f : float
        Statistic F; nan if the covariance is not positive definite.
    critical : float
        Critical value F(1 - alpha; p, dof).
    p_value : float
        Probability of a larger F under the hypothesis of zero.
    positive_definite : bool
        Whether the covariance is positive definite; if not, no test is possible.
    """

    names: tuple
    f: float
    critical: float
    p_value: float
    positive_definite: bool = True

    @property
    def significant(self):
        """Whether F exceeds its critical value; None without F."""
        return None if np.isnan(self.f) else bool(self.f > self.critical)

    @property
    def decides(self):
        """Whether the test is relevant to the choice of the parameters."""
        return not set(self.names) <= set(WITHOUT_DECISION)


def critical_f(parameters, dof, alpha=ALPHA):
    """Critical value F(1 - alpha; parameters, dof).

    Parameters
    ----------
    parameters : int
        Number of parameters p.
    dof : float
        Degrees of freedom of sigma0; infinite if it is not estimated.
    alpha : float, optional
        Significance level.

    Returns
    -------
    float
    """
    if not 0 < alpha < 1:
        raise ValueError(f"alpha {alpha}: expected a probability between 0 and 1")
    if np.isinf(dof):
        return float(chdtri(parameters, alpha) / parameters)
    return float(fdtri(parameters, dof, 1 - alpha))


def compute_f(values, covariance):
    """Statistic x' C^-1 x / p of values (p,) and covariance (p, p); nan if C is not definite."""
    values, covariance = np.asarray(values, dtype=float), np.asarray(covariance, dtype=float)
    lower = factor_correlations(covariance)
    if lower is None:
        return np.nan
    scaled = values / np.sqrt(np.diag(covariance))
    whitened = scipy.linalg.solve_triangular(lower, scaled, lower=True)
    return float(whitened @ whitened / len(values))


def factor_correlations(covariance):
    """Lower Cholesky factor (p, p) of the correlations, or None if not positive definite."""
    variance = np.diag(covariance)
    if not (np.isfinite(covariance).all() and (variance > 0).all()):
        return None
    sd = np.sqrt(variance)
    try:
        lower = np.linalg.cholesky(covariance / np.outer(sd, sd))
    except np.linalg.LinAlgError:
        return None
    # A pivot of the size of rounding errors is treated as zero.
    rounding = len(sd) * np.finfo(float).eps
    return lower if (np.diag(lower) ** 2 > rounding).all() else None


def run_zero_test(names, chosen, values, covariance, dof, alpha=ALPHA):
    """Test some parameters together against zero.

    Parameters
    ----------
    names : sequence of str
        Names of the k parameters.
    chosen : sequence of str
        Names of the parameters to test.
    values, covariance : array_like, shapes (k,) and (k, k)
        Values and covariance matrix of all parameters.
    dof : float
        Degrees of freedom of sigma0; infinite if it is not estimated.
    alpha : float, optional
        Significance level.

    Returns
    -------
    ZeroTest
    """
    rows = [names.index(name) for name in chosen]
    f = compute_f(np.asarray(values)[rows], np.asarray(covariance)[np.ix_(rows, rows)])
    p, critical = len(rows), critical_f(len(rows), dof, alpha)
    if np.isnan(f):
        return ZeroTest(tuple(chosen), f, critical, np.nan, positive_definite=False)
    tail = chdtrc(p, p * f) if np.isinf(dof) else fdtrc(p, dof, f)
    return ZeroTest(tuple(chosen), f, critical, float(tail))


def single_tests(names, values, covariance, dof, alpha=ALPHA):
    """Test each parameter alone against zero, with the arguments of `run_zero_test`."""
    return tuple(run_zero_test(names, (name,), values, covariance, dof, alpha) for name in names)


def group_tests(names, values, covariance, dof, alpha=ALPHA, groups=None):
    """Test groups of parameters against zero, with the arguments of `run_zero_test`.

    By default the groups of GROUPS with two or more of the parameters are tested. Unknown names in
    `groups` raise ValueError.
    """
    if groups is None:
        groups = select_groups(names)
    unknown = {name for group in groups for name in group} - set(names)
    if unknown:
        raise ValueError(
            f"no adjusted parameter {', '.join(sorted(unknown))}; expected some of "
            + ", ".join(names)
        )
    return tuple(run_zero_test(names, group, values, covariance, dof, alpha) for group in groups)


def select_groups(names):
    """Return the groups of GROUPS with two or more of these names."""
    present = (tuple(name for name in group if name in names) for group in GROUPS)
    return tuple(group for group in present if len(group) > 1)
