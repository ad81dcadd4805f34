"""Propagation of uncertainty, coverage factors, and how many digits a value deserves.

Sources: JCGM 100:2008 (GUM) 5.1, 5.2, G.4, 7.2.6.
"""

from dataclasses import dataclass
from math import floor, log10

import numpy as np
from scipy.special import ndtri, stdtrit

# rows of a table in m3 keep their litres: differences of rows are far better known than the rows
LITRE_DECIMALS = 3


@dataclass(frozen=True)
class Source:
    """One cause of uncertainty, with one or more columns of the factor that belong together.

    kind        "points", "form", ... or the name of a declared input
    columns_m3  (rows, c) derivative of the volume times standard uncertainty
    u, unit     as declared; None for what was not declared but computed
    """

    kind: str
    columns_m3: np.ndarray
    dof: float = np.inf
    u: float | None = None
    unit: str | None = None
    type: str = "A"
    distribution: str = "normal"
    note: str = ""


def factor_of(covariance):
    """(n, r) factor L of a positive semidefinite covariance, covariance = L L', r its rank.

    Raises ValueError when the matrix has a negative eigenvalue beyond rounding.
    """
    values, vectors = np.linalg.eigh(covariance)
    largest = max(values.max(initial=0.0), 0.0)
    if values.min(initial=0.0) < -1e-9 * largest:
        raise ValueError(f"not a covariance: eigenvalue {values.min():.3g} against {largest:.3g}")
    keep = values > 1e-14 * largest
    return (vectors[:, keep] * np.sqrt(values[keep]))[:, ::-1]


def effective_dof(contributions, dof):
    """Welch-Satterthwaite: u^4 / sum(u_i^4 / dof_i) for each row (GUM G.2b).

    contributions  (rows, inputs) standard uncertainties by input; dof  (inputs,), may be inf.
    Returns (rows,); inf where no input with finite degrees of freedom contributes.
    """
    variance = np.asarray(contributions, dtype=float) ** 2
    share = np.sum(variance**2 / np.asarray(dof, dtype=float), axis=1)
    total = np.sum(variance, axis=1) ** 2
    return np.divide(total, share, out=np.full(len(total), np.inf), where=share > 0)


def coverage_factor(probability, dof):
    """k of a symmetric interval: Student's t for `dof` degrees of freedom, the normal for inf."""
    if not 0 < probability < 1:
        raise ValueError(f"coverage probability {probability}: expected between 0 and 1")
    dof = np.asarray(dof, dtype=float)
    upper = (1 + probability) / 2
    finite = np.where(np.isfinite(dof), dof, 1.0)
    return np.where(np.isfinite(dof), stdtrit(finite, upper), ndtri(upper))


def decimals_for(u, significant=2):
    """Number of decimals that shows u with `significant` digits (GUM 7.2.6); never negative.

    Zero and non-finite u give 6: a value without an uncertainty is not rounded to one.
    """
    if not np.isfinite(u) or u <= 0:
        return 6
    exponent = floor(log10(u))
    decimals = significant - 1 - exponent
    if decimals >= 0 and round(u, decimals) >= 10.0 ** (exponent + 1):  # 0.0996 -> 0.10
        decimals -= 1
    return max(decimals, 0)


def row_decimals(uncertainties, least=0):
    """Decimals of each row of a column, by its own uncertainty but never fewer than `least`.

    A row without an uncertainty (0 or None: the empty tank) is written as the next one is, else as
    the one before it.
    """
    decimals = [max(decimals_for(u), least) if u else None for u in uncertainties]
    following = next((d for d in reversed(decimals) if d is not None), decimals_for(0.0))
    for i in reversed(range(len(decimals))):
        following = decimals[i] = following if decimals[i] is None else decimals[i]
    return decimals


def height_decimals(height_m):
    """Decimals of a height: millimetres, and up to two more where it is no whole millimetre."""
    return next((d for d in (3, 4) if abs(height_m - round(height_m, d)) < 1e-9), 5)
