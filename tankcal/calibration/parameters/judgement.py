"""Analysis of one set of interior parameters: significance, and update by new adjustments.

Significance of parameters of a camera: tests against zero, components, effect of dropping.

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

Tests, components, predictions and rules follow from the covariance of the set. Trials add the
effect of dropping parameters on points and volume, which updates the recommendation.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy.special import chdtrc, chdtri, fdtrc, fdtri

from tankcal.calibration.interiors import Interior, Shift, left_shifts, own_shift
from tankcal.calibration.parameters.recommendation import (
    CORRELATED,
    LIMIT_PX,
    Advice,
    Evidence,
    Limit,
    PessoaRule,
    SilvaRule,
    changes_product,
    make_joint_reasons,
    pessoa_rule,
    recommend,
    silva_rule,
)
from tankcal.camera.model import PARAMETERS
from tankcal.messages import message
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


IMAGE = "image coordinate"


@dataclass(frozen=True)
class Choices:
    """Choices of the user.

    Attributes
    ----------
    alpha : float
        Significance level of the tests.
    groups : tuple of tuple of str, or None
        Groups of parameters to test, or None for the usual groups.
    of : str
        Matrix of the principal components: "correlation" or "covariance".
    unscaled : bool
        Whether the values of the components are computed as in Silva's program.
    limit_px, limit_um : float or None
        Image accuracy for comparison with the effect of a parameter, px or um. By default 0.5 px in
        Pessoa's rule, and the accuracy from the residuals in the recommendation.
    """

    alpha: float = ALPHA
    groups: tuple | None = None
    of: str = "correlation"
    unscaled: bool = False
    limit_px: float | None = None
    limit_um: float | None = None


@dataclass(frozen=True)
class Trial:
    """Set of parameters that could be dropped.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    because : tuple of str
        Reasons of the trial: "single", "group", "silva", "pessoa", "advised".
    predicted : Prediction
        Predicted values and covariance of the kept parameters.
    comparable : bool
        Whether dropping the parameters changes only this set of parameters.
    outcome : Outcome or None
        Result of a new adjustment, or None without a new adjustment.
    after : tuple or None
        Names, values (k,) and covariance (k, k) after the new adjustment, scaled as `predicted`.
    """

    names: tuple
    because: tuple
    predicted: Prediction
    comparable: bool
    outcome: object = None
    after: tuple | None = None


@dataclass(frozen=True)
class CameraParameters:
    """Analysis of one set of interior parameters.

    Attributes
    ----------
    interior : Interior
        Set of interior parameters.
    source : str
        "job" or "record".
    choices : Choices
        Choices of the user.
    names : tuple of str
        Names of the k adjusted parameters.
    values : ndarray, shape (k,)
        Values of the adjusted parameters.
    covariance : ndarray, shape (k, k)
        Covariance matrix, multiplied by sigma0^2 if `scale` is "a_posteriori".
    scale : str
        "a_posteriori" or "a_priori".
    dof, sigma0 : float
        Degrees of freedom and value of sigma0; inf and nan if sigma0 is not estimated.
    limit : Limit
        Image accuracy.
    tests, groups : tuple of ZeroTest
        Tests of single parameters and of groups.
    components : Components
        Principal components.
    own : dict
        {name: Shift or None}, shift by the value of the parameter.
    left : dict
        {name: (Shift, Shift after rotation)}, remaining shift if the parameter is dropped.
    trials : tuple of Trial
        Sets of parameters that could be dropped.
    silva, pessoa : SilvaRule, PessoaRule
        Results of the two rules.
    recommendation : tuple of Advice
        Recommendation for each parameter.
    held_back : tuple of str
        Parameters that can be dropped alone, but not together with the others.
    base : tuple or None
        TopVolume with all parameters or None, and reason of a failure or None; None for a record.
    """

    interior: Interior
    source: str
    choices: Choices
    names: tuple
    values: np.ndarray
    covariance: np.ndarray
    scale: str
    dof: float
    sigma0: float
    limit: Limit
    tests: tuple[ZeroTest, ...]
    groups: tuple[ZeroTest, ...]
    components: Components
    own: dict[str, Shift | None]
    left: dict[str, tuple[Shift, Shift]]
    trials: tuple[Trial, ...]
    silva: SilvaRule
    pessoa: PessoaRule
    recommendation: tuple[Advice, ...]
    held_back: tuple = ()
    base: tuple | None = None

    @property
    def sds(self):
        """Standard deviations (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self):
        """Correlation matrix (k, k)."""
        return correlations(self.covariance)


@dataclass(frozen=True)
class Statistics:
    """Statistics of an adjustment; groups are (kind, name, count, redundancy, rms in mm)."""

    sigma0: float
    dof: int
    cov_scale: float
    groups: list

    @property
    def is_estimated(self):
        """Whether sigma0 was estimated."""
        return self.dof > 0 and np.isfinite(self.sigma0) and self.sigma0 > 0


def find_adjusted_rows(interior):
    """Rows of the covariance with a positive variance; exact conditions can make it zero."""
    return np.flatnonzero(np.diag(interior.covariance) > 0)


def judge_parameters(interior, statistics, choices, source):
    """Analyse one set of interior parameters.

    Parameters
    ----------
    interior : Interior
        Set of interior parameters.
    statistics : Statistics
        Statistics of the adjustment.
    choices : Choices
        Choices of the user.
    source : str
        "job" or "record".

    Returns
    -------
    CameraParameters
    """
    rows = find_adjusted_rows(interior)
    names = tuple(interior.free[i] for i in rows)
    values = np.array([interior.values[PARAMETERS.index(name)] for name in names])
    # Scale the covariance with the estimated sigma0^2, in place of the scale of the adjustment.
    factor = statistics.sigma0**2 / statistics.cov_scale if statistics.is_estimated else 1.0
    covariance = factor * interior.covariance[np.ix_(rows, rows)]
    dof = float(statistics.dof) if statistics.is_estimated else np.inf
    tests = single_tests(names, values, covariance, dof, choices.alpha)
    groups = group_tests(names, values, covariance, dof, choices.alpha, choices.groups)
    parts = components(names, covariance, values, of=choices.of, unscaled=choices.unscaled)
    limit = _accuracy_limit(interior, statistics, choices)
    own = {
        name: own_shift(name, interior.values, interior.form, interior.frame)
        for name, scope in zip(PARAMETERS, interior.scope, strict=True)
        if scope != "off"
    }
    silva = silva_rule(parts)
    limit_px = LIMIT_PX if choices.limit_px is None else choices.limit_px
    pessoa = pessoa_rule(tests, own, limit_px=limit_px, limit_um=limit.um)
    trials = _make_trials(interior, names, values, covariance, choices.groups, silva, pessoa)
    left = {
        t.names[0]: _remaining_shifts(interior, t.predicted)
        for t in trials
        if "single" in t.because
    }
    analysis = CameraParameters(
        interior, source, choices, names, values, covariance,
        "a_posteriori" if statistics.is_estimated else "a_priori", dof, statistics.sigma0,
        limit, tests, groups, parts, own, left, trials, silva, pessoa, (),
    )  # fmt: skip
    return add_joint_trial(advise(analysis))


def _remaining_shifts(interior, predicted):
    """Remaining shifts if parameters are dropped (left_shifts); None without a prediction."""
    if not predicted.positive_definite:
        return None
    others = np.array(interior.values)
    others[[PARAMETERS.index(name) for name in predicted.dropped]] = 0.0
    others[[PARAMETERS.index(name) for name in predicted.kept]] = predicted.values
    if not others[0] > 0:
        return None
    return left_shifts(interior.values, others, interior.form, interior.frame)


def _accuracy_limit(interior, statistics, choices):
    """Return the Limit of the user, or the standard deviation of an image coordinate.

    The standard deviation is estimated from the residuals of the camera, or of all cameras.
    """
    pixel_mm = interior.frame.pixel_mm
    pixel_um = np.nan if pixel_mm is None else 1e3 * float(np.mean(pixel_mm))
    if choices.limit_um is not None:
        return Limit(choices.limit_um, choices.limit_um / pixel_um, "given")
    if choices.limit_px is not None:
        if pixel_mm is None:
            raise ValueError(
                message(
                    "camera_no_pixels",
                    "the size of a pixel of {camera} is not known; expected the limit in "
                    "micrometres",
                    camera=interior.camera,
                )
            )
        return Limit(choices.limit_px * pixel_um, choices.limit_px, "given")
    images = [group for group in statistics.groups if group[0] == IMAGE and group[4] is not None]
    images = [group for group in images if group[1] == interior.camera] or images
    redundancy = sum(redundancy for _, _, _, redundancy, _ in images)
    if redundancy <= 0:
        return Limit(np.nan, np.nan, "residuals")
    um = 1e3 * np.sqrt(sum(count * rms**2 for _, _, count, _, rms in images) / redundancy)
    return Limit(float(um), float(um / pixel_um), "residuals")


def _make_trials(interior, names, values, covariance, groups, silva, pessoa):
    """Create the Trials: single parameters, groups, and the sets of the two rules."""
    groups = select_groups(names) if groups is None else groups
    wanted = [((name,), "single") for name in names] + [(group, "group") for group in groups]
    wanted += [(silva.drop, "silva"), (pessoa.drop, "pessoa")]
    because = {}
    for chosen, why in wanted:
        key = tuple(name for name in names if name in chosen)
        if key and "c" not in key and len(key) < len(names):
            because.setdefault(key, []).append(why)
    return tuple(
        Trial(
            key, tuple(why), drop_parameters(names, covariance, key, values), not interior.is_shared
        )
        for key, why in because.items()
    )


def remove_joint_trial(analysis):
    """Remove the Trial of all parameters that are recommended to be dropped together."""
    trials = (
        replace(trial, because=tuple(why for why in trial.because if why != "advised"))
        for trial in analysis.trials
    )
    return replace(analysis, trials=tuple(trial for trial in trials if trial.because))


def add_joint_trial(analysis):
    """Add a Trial of all parameters that are recommended to be dropped, together."""
    dropped = tuple(item.name for item in analysis.recommendation if not item.keep)
    trials = list(remove_joint_trial(analysis).trials)
    if dropped and dropped not in [item.names for item in trials]:
        predicted = drop_parameters(analysis.names, analysis.covariance, dropped, analysis.values)
        trials.append(Trial(dropped, (), predicted, not analysis.interior.is_shared))
    return replace(
        analysis,
        trials=tuple(
            replace(item, because=(*item.because, "advised")) if item.names == dropped else item
            for item in trials
        ),
    )


def hold_back_worst(analysis):
    """Hold back one parameter if dropping all recommended parameters changes the product.

    The parameter with the largest effect alone is held back. If the product does not change, the
    same object is returned.
    """
    joint = _find_joint_trial(analysis)
    if joint is None:
        return analysis
    product = _product_change(analysis, joint)
    if product is not None and not changes_product(product):
        return analysis
    alone = {
        trial.names[0]: _product_change(analysis, trial)
        for trial in analysis.trials
        if len(trial.names) == 1
    }
    # A parameter without a trial of its own counts as the worst.
    worst = max(joint.names, key=lambda name: (alone.get(name) or {}).get("largest_sds", np.inf))
    return replace(analysis, held_back=(*analysis.held_back, worst))


def _find_joint_trial(analysis):
    """Trial of two or more parameters that are recommended to be dropped together, or None."""
    trial = next((trial for trial in analysis.trials if "advised" in trial.because), None)
    return None if trial is None or len(trial.names) < 2 else trial


def advise_together(analysis):
    """Add the effect of dropping all recommended parameters together to the reasons."""
    joint = _find_joint_trial(analysis)
    if joint is None:
        return analysis
    reason = make_joint_reasons(joint.names, _product_change(analysis, joint), _failure(joint))
    return replace(
        analysis,
        recommendation=tuple(
            item if item.keep else replace(item, reasons=(*item.reasons, *reason))
            for item in analysis.recommendation
        ),
    )


def advise(analysis):
    """Update the recommendation of a CameraParameters from its trials."""
    singles = {t.names[0]: t for t in analysis.trials if "single" in t.because and t.comparable}
    evidence = tuple(
        Evidence(
            test=test,
            own=analysis.own.get(name),
            left=(analysis.left.get(name) or (None,))[0],
            state=analysis.interior.state[PARAMETERS.index(name)],
            groups=tuple(group for group in analysis.groups if name in group.names),
            correlated=_find_correlated(analysis, name),
            product=_product_change(analysis, singles.get(name)),
            failed=_failure(singles.get(name)),
        )
        for name, test in zip(analysis.names, analysis.tests, strict=True)
    )
    recommendation = recommend(
        evidence, analysis.limit, analysis.interior.frame, analysis.held_back
    )
    return replace(analysis, recommendation=recommendation)


def _find_correlated(analysis, name):
    """Other parameters with a high correlation: ((name, correlation), ...)."""
    row = analysis.correlation[analysis.names.index(name)].tolist()
    return tuple(
        (other, r)
        for other, r in zip(analysis.names, row, strict=True)
        if other != name and abs(r) > CORRELATED
    )


def _failure(trial):
    """Reason why the survey cannot be adjusted without the parameters of a trial, or None."""
    if trial is None or trial.outcome is None or trial.outcome.changes is not None:
        return None
    return trial.outcome.failed


def _product_change(analysis, trial):
    """Effect of a trial on points and volume as a dict, or None if it is not known."""
    if trial is None or trial.outcome is None or trial.outcome.changes is None:
        return None
    points, after = trial.outcome.changes, trial.outcome.volume
    before = None if analysis.base is None else analysis.base[0]
    both = before is not None and after is not None
    return {
        "largest_sds": points.largest_sds,
        "largest_mm": 1e3 * points.largest_m,
        "volume_change_m3": after.value_m3 - before.value_m3 if both else None,
        "volume_u_m3": before.u_m3 if both else None,
    }
