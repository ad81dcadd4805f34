"""Significance of parameters of a camera: tests against zero, components, effect of dropping.

    one parameter    F = x^2 / s^2                    against F(1 - alpha; 1, dof)
    a group of p     F = x' Q^-1 x / (p sigma0^2)     against F(1 - alpha; p, dof)

The covariance matrix is sigma0^2 Q. If sigma0 is not estimated, dof is infinite and p F has a
chi-square distribution. Groups are solved with the Cholesky factor of their correlations and not
inverted, because the units of K1 to K4 differ by many powers of ten.

Source: Pessoa 2017 (11-13); Koch 1999, section 4.2.

Principal components, as in the program ANALISE
-----------------------------------------------

C contains the eigenvectors and lambda the eigenvalues of the covariance or correlation matrix of
the parameters x:

    components  y = C' x        variance of y_j = lambda_j       share = lambda_j / sum of lambda
    loadings    corr(x_i, y_j) = c_ij sqrt(lambda_j) / sd(x_i)

For a correlation matrix, x is divided by its standard deviations, and sd(x_i) is 1.

Source: Silva 1995 (61-79). His program multiplied the eigenvectors of the correlation matrix by the
undivided values (`unscaled`), and did not sort the components.

Prediction of the effect of dropping parameters
-----------------------------------------------

A dropped parameter is held at zero. The parameters k that are kept then have

    values  x_k - C_kd C_dd^-1 (x_d - 0)        covariance  C_kk - C_kd C_dd^-1 C_dk

The prediction is exact for a linear model with unchanged sigma0. Source: Koch 1999, section 3.2.7.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.special import chdtrc, chdtri, fdtrc, fdtri

from tankcal.survey.network import correlations

ALPHA = 0.05  # significance level of the tests
GROUPS = (("x0", "y0"), ("P1", "P2"), ("A", "B"), ("K1", "K2", "K3", "K4"))
WITHOUT_DECISION = ("c",)  # no camera has c = 0, so that a test against 0 is meaningless
MATRICES = ("correlation", "covariance")


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


@dataclass(frozen=True)
class Components:
    """Principal components of k parameters, the largest first.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    of : str
        Matrix that was analysed, "correlation" or "covariance".
    positive_definite : bool
        Whether the matrix has a Cholesky factor.
    eigenvalues : ndarray, shape (k,)
        Eigenvalues in descending order; negative eigenvalues are kept.
    share_percent, cumulative_percent : ndarray, shape (k,)
        Share of each eigenvalue in their sum, and its cumulative sum, %.
    vectors : ndarray, shape (k, k)
        Eigenvectors C in the columns; the largest loading of each column is positive.
    loadings : ndarray, shape (k, k)
        Loadings, parameter by component; nan if an eigenvalue is not positive.
    values : ndarray, shape (k,)
        Values of the components; nan without values of the parameters.
    unscaled : bool
        Whether the parameters were not divided by their standard deviations (Silva's program).
    """

    names: tuple
    of: str
    positive_definite: bool
    eigenvalues: np.ndarray
    share_percent: np.ndarray
    cumulative_percent: np.ndarray
    vectors: np.ndarray
    loadings: np.ndarray
    values: np.ndarray
    unscaled: bool

    @property
    def smallest_eigenvalue(self):
        """Smallest eigenvalue."""
        return float(self.eigenvalues[-1])


def components(names, covariance, values=None, *, of="correlation", unscaled=False):
    """Compute the principal components of parameters.

    Parameters
    ----------
    names : sequence of str
        Names of the k parameters.
    covariance : array_like, shape (k, k)
        Covariance matrix in the units of the parameters, or a correlation matrix.
    values : array_like, shape (k,), optional
        Values of the parameters.
    of : str, optional
        Matrix to analyse, "correlation" or "covariance". The covariance depends on the units.
    unscaled : bool, optional
        Whether the eigenvectors of the correlation matrix multiply the undivided values.

    Returns
    -------
    Components

    Raises
    ------
    ValueError
        If the matrix is not symmetric or not finite, or if a variance is not positive.
    """
    if of not in MATRICES:
        raise ValueError(f"found of={of!r}; expected one of {', '.join(MATRICES)}")
    matrix = _check_matrix(names, covariance)
    sd = np.sqrt(np.diag(matrix))
    lower = factor_correlations(matrix)
    weight = np.ones_like(sd) if of == "correlation" else sd
    eigenvalues, vectors = _decompose(correlations(matrix), lower, weight)
    # Loadings c_ij sqrt(lambda_j) / sd(x_i)
    root = np.sqrt(np.where(eigenvalues > 0, eigenvalues, np.nan))
    loadings = vectors * root / weight[:, None]
    # The signs of vectors and loadings are chosen so that the largest loading is positive.
    largest = np.argmax(np.abs(vectors) / weight[:, None], axis=0)
    sign = np.where(vectors[largest, np.arange(len(weight))] < 0, -1.0, 1.0)
    vectors, loadings = vectors * sign, loadings * sign
    share = 100 * eigenvalues / eigenvalues.sum()
    x = np.full(len(sd), np.nan) if values is None else np.asarray(values, dtype=float)
    if of == "correlation" and not unscaled:
        x = x / sd
    return Components(
        names=tuple(names),
        of=of,
        positive_definite=lower is not None,
        eigenvalues=eigenvalues,
        share_percent=share,
        cumulative_percent=np.cumsum(share),
        vectors=vectors,
        loadings=loadings,
        values=vectors.T @ x,
        unscaled=unscaled,
    )


def _decompose(correlation, lower, weight):
    """Eigenvalues (k,), descending, and eigenvectors of W R W, R = L L', W = diag(weight).

    They follow from the singular values of W L. The eigenvalues of a covariance of K1 to K3 in mm
    span thirty powers of ten, and a decomposition of W R W would resolve only sixteen. Without L
    (matrix not positive definite), W R W is decomposed, and negative eigenvalues are returned.
    """
    if lower is None:
        values, vectors = np.linalg.eigh(weight[:, None] * correlation * weight)
        return values[::-1], vectors[:, ::-1]
    vectors, values, _ = scipy.linalg.svd(weight[:, None] * lower, lapack_driver="gesvd")
    return values**2, vectors


def _check_matrix(names, covariance):
    matrix = np.asarray(covariance, dtype=float)
    if matrix.shape != (len(names), len(names)) or not len(names):
        raise ValueError(f"a matrix of shape {matrix.shape} for {len(names)} parameters")
    if not np.isfinite(matrix).all() or not (np.diag(matrix) > 0).all():
        raise ValueError("a matrix with a variance that is not positive, or that is not finite")
    size = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    if (np.abs(matrix - matrix.T) > 1e-9 * size).any():
        raise ValueError("a matrix that is not symmetric")
    return matrix


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
