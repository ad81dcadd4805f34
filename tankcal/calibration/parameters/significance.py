"""Is a parameter, or a group of them, different from zero?

    one parameter    F = x^2 / s^2                    against F(1 - alpha; 1, dof)
    a group of p     F = x' Q^-1 x / (p sigma0^2)     against F(1 - alpha; p, dof)

The covariance that goes in is sigma0^2 Q. Where sigma0 is not estimated, dof is infinite and p F is
chi-square. Groups are solved through the Cholesky factor of their correlations, never inverted: the
units of K1 to K4 differ by many powers of ten.

Source: Pessoa 2017 (11-13); Koch 1999, section 4.2.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.special import chdtrc, chdtri, fdtrc, fdtri

ALPHA = 0.05
GROUPS = (("x0", "y0"), ("P1", "P2"), ("A", "B"), ("K1", "K2", "K3", "K4"))
WITHOUT_DECISION = ("c",)  # no camera is without it: 0 is nothing to test it against


@dataclass(frozen=True)
class AgainstZero:
    """A parameter (names of length 1) or a group against zero.

    names              as given
    f                  F; nan for a group that is not positive definite
    critical           F(1 - alpha; p, dof)
    p_value            probability of an F as large by chance
    positive_definite  False: some combination of the group has no variance, no test is possible
    """

    names: tuple
    f: float
    critical: float
    p_value: float
    positive_definite: bool = True

    @property
    def significant(self):
        """True when F is above its critical value; None when there is no F."""
        return None if np.isnan(self.f) else bool(self.f > self.critical)

    @property
    def decides(self):
        """False when the test says nothing about whether the parameters belong."""
        return not set(self.names) <= set(WITHOUT_DECISION)


def critical_f(parameters, dof, alpha=ALPHA):
    """Quantile F(1 - alpha; parameters, dof); dof may be infinite."""
    _refuse_level(alpha)
    if np.isinf(dof):
        return float(chdtri(parameters, alpha) / parameters)
    return float(fdtri(parameters, dof, 1 - alpha))


def f_of_group(values, covariance):
    """x' C^-1 x / p of values (p,) and their covariance (p, p); nan: not positive definite."""
    values, covariance = np.asarray(values, dtype=float), np.asarray(covariance, dtype=float)
    lower = cholesky_of(covariance)
    if lower is None:
        return np.nan
    scaled = values / np.sqrt(np.diag(covariance))
    half = scipy.linalg.solve_triangular(lower, scaled, lower=True)
    return float(half @ half / len(values))


def cholesky_of(covariance):
    """Lower Cholesky factor of the correlations of (p, p); None: not positive definite."""
    variance = np.diag(covariance)
    if not (np.isfinite(covariance).all() and (variance > 0).all()):
        return None
    sd = np.sqrt(variance)
    try:
        lower = np.linalg.cholesky(covariance / np.outer(sd, sd))
    except np.linalg.LinAlgError:
        return None
    rounding = len(sd) * np.finfo(float).eps
    return lower if (np.diag(lower) ** 2 > rounding).all() else None


def against_zero(names, chosen, values, covariance, dof, alpha=ALPHA):
    """The AgainstZero of the parameters `chosen` among names (k,); covariance (k, k)."""
    rows = [names.index(name) for name in chosen]
    f = f_of_group(np.asarray(values)[rows], np.asarray(covariance)[np.ix_(rows, rows)])
    p, critical = len(rows), critical_f(len(rows), dof, alpha)
    if np.isnan(f):
        return AgainstZero(tuple(chosen), f, critical, np.nan, positive_definite=False)
    tail = chdtrc(p, p * f) if np.isinf(dof) else fdtrc(p, dof, f)
    return AgainstZero(tuple(chosen), f, critical, float(tail))


def single_tests(names, values, covariance, dof, alpha=ALPHA):
    """A tuple of AgainstZero, one for each parameter."""
    return tuple(against_zero(names, (name,), values, covariance, dof, alpha) for name in names)


def group_tests(names, values, covariance, dof, alpha=ALPHA, groups=None):
    """A tuple of AgainstZero of groups; None: those of GROUPS with two or more names there.

    groups  names that are not among the parameters raise ValueError
    """
    if groups is None:
        groups = groups_among(names)
    unknown = {name for group in groups for name in group} - set(names)
    if unknown:
        raise ValueError(
            f"no adjusted parameter {', '.join(sorted(unknown))}; expected some of "
            + ", ".join(names)
        )
    return tuple(against_zero(names, group, values, covariance, dof, alpha) for group in groups)


def groups_among(names):
    """The groups of GROUPS with two or more of these names."""
    found = (tuple(name for name in group if name in names) for group in GROUPS)
    return tuple(group for group in found if len(group) > 1)


def _refuse_level(alpha):
    if not 0 < alpha < 1:
        raise ValueError(f"alpha {alpha}: expected a probability between 0 and 1")
