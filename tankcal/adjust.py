"""Least-squares adjustment without geometry: the combined (Gauss-Helmert) model.

The conditions f(x, l + v) = 0 relate the unknowns x to the observations l with covariance Q. Each
iteration linearises them at the adjusted observations:

    B v + A dx + w = 0,   M = B Q B',   dx = -(A' M^-1 A)^-1 A' M^-1 w,   v = -Q B' M^-1 (A dx + w)

A model without B is a Gauss-Markov model: f = F(x) - l and B = -I. All rows are whitened with a
Cholesky factor, and the columns are scaled to length one. Well-conditioned columns are solved by
normal equations. All other systems are solved by QR, which also determines the rank. Only the
covariance is inverted.

Source: Mikhail & Ackermann 1976, Observations and Least Squares, ch. 9.
"""

from dataclasses import dataclass
from functools import cache
from itertools import count

import numpy as np
import scipy.linalg
import scipy.sparse
from scipy.special import ndtri

from tankcal.covariance import PointCovariance
from tankcal.errors import SolutionError
from tankcal.messages import message

ALPHA, POWER = 0.001, 0.80  # of the test of a single reading, and of its detectable blunder
CRITICAL = 3.29  # two-sided normal value of ALPHA, rounded as in practice: change both together
UNCONTROLLED = 1e-6  # redundancy number below which an observation counts as uncontrolled
WELL_PLACED = 1e-3  # squared pivot, scaled columns: normal equations lose three of sixteen digits
TIED = 9  # decimals of compared statistics: equal ones differ by rounding only
SD_OVER_MEDIAN = 1.4826  # standard deviation of normal errors over their median absolute value
SMALLEST_PIVOT = 1e-12  # squared pivot of normal equations with unit diagonal; rounding below it


def noncentrality(alpha=ALPHA, power=POWER):
    """Noncentrality delta0 of a two-sided test of the normal distribution.

    Parameters
    ----------
    alpha : float, optional
        Probability of rejecting a valid observation.
    power : float, optional
        Probability of detecting a blunder of size delta0.

    Returns
    -------
    float
        delta0, in standard deviations of the tested quantity.

    Notes
    -----
    delta0 = z(1 - alpha/2) + z(power), with z the quantile of the standard normal distribution.

    Examples
    --------
    >>> round(noncentrality(0.001, 0.80), 2)
    4.13
    """
    return float(ndtri(1 - alpha / 2) + ndtri(power))


@dataclass(frozen=True)
class Adjustment:
    """Result of an adjustment, by `adjust` or with eliminated blocks (tankcal.solver).

    Attributes
    ----------
    unknowns : ndarray, shape (u,)
        Estimates, in the units of the model. For a solver.Model, its state.
    cofactor : ndarray, shape (u, u)
        Covariance of the unknowns for variance factor 1. For a solver.Model, a solver.Cofactors,
        which computes the covariance of any unknowns and of functions of the unknowns.
    normalised : ndarray, shape (m,)
        Whitened residual of each condition. For a solver.Model, a tuple with an array (n, rows) for
        each group, computed minus observed.
    chi2 : float
        Weighted sum of squared residuals, v' Q^-1 v.
    rows : int
        Number of conditions with a weight.
    estimated : int
        Number of unknowns, less the number fixed by exact conditions.
    iterations : int
        Number of iterations until the last step was below the tolerance.
    rank_defect : int
        Number of directions of the unknowns that only the datum fixes.
    observations, residuals : ndarray, shape (n,), or None
        Adjusted observations l + v and residuals v, in the units of the observations. None for a
        solver.Model, which keeps its own observations.
    redundancy : ndarray, shape (m,), or None
        Redundancy number of each condition, 0 to 1: the part of an error that appears in its
        residual. None for a solver.Model, see Cofactors.redundancy.
    """

    unknowns: object
    cofactor: object
    normalised: object
    chi2: float
    rows: int
    estimated: int
    iterations: int
    rank_defect: int = 0
    observations: np.ndarray | None = None
    residuals: np.ndarray | None = None
    redundancy: np.ndarray | None = None

    @property
    def dof(self):
        """Degrees of freedom: rows minus estimated unknowns plus rank defect."""
        return self.rows - self.estimated + self.rank_defect

    @property
    def variance_factor(self):
        """A-posteriori variance factor chi2 / dof; nan without redundancy."""
        return self.chi2 / self.dof if self.dof > 0 else np.nan

    @property
    def sigma0(self):
        """Square root of the a-posteriori variance factor."""
        return float(np.sqrt(self.variance_factor))


def adjust(model, unknowns, observations, covariance, *, max_iterations=50, tolerance=1e-8):
    """Adjust observations so that the conditions of a model hold.

    Parameters
    ----------
    model : callable
        model(x, l) -> (w, A, B): misclosures (m,), Jacobian by the unknowns (m, u) and Jacobian by
        the observations (m, n). B is dense, scipy.sparse, or None for a Gauss-Markov model (w =
        F(x) - l). If each condition concerns a single point with d coordinates, n = m d, B has the
        shape (m, d).
    unknowns : array_like, shape (u,)
        Start values, in the units of the model.
    observations : array_like, shape (n,)
        Observations, in the units of the model.
    covariance : ndarray, sparse matrix or PointCovariance
        Variances (n,), covariances (m, d, d) of independent points, or covariance (n, n).
    max_iterations : int, optional
        Largest number of iterations.
    tolerance : float, optional
        Limit for the last step of each unknown and residual, in standard deviations. A step that no
        longer shrinks is accepted up to 1e4 times the tolerance, as rounding.

    Returns
    -------
    Adjustment

    Raises
    ------
    SolutionError
        If the conditions do not determine the unknowns, if there are fewer conditions than
        unknowns, or if the iteration does not converge.

    Examples
    --------
    Three levelled height differences with a standard uncertainty of 1 mm, from a bench mark over
    two points and back:

    >>> rows = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    >>> loop = lambda x, l: (rows @ x - l, rows, None)
    >>> result = adjust(loop, [0.0, 0.0], [1.002, 0.499, -1.507], [1e-6] * 3)
    >>> result.unknowns.round(6)
    array([1.004, 1.505])
    >>> result.residuals.round(6)
    array([0.002, 0.002, 0.002])
    >>> result.dof, round(result.sigma0, 3)
    (1, 3.464)
    """
    x = np.array(unknowns, dtype=float)
    l = np.asarray(observations, dtype=float)
    v, largest_step = np.zeros_like(l), np.inf
    q = scipy.sparse.diags_array(covariance) if np.ndim(covariance) == 1 else covariance
    # M = Q in a Gauss-Markov model, so that a single factor serves all iterations.
    weight_whitener = cache(lambda: whitener(q))
    for iteration in range(1, max_iterations + 1):
        w, a, b = model(x, l + v)
        if len(w) < len(x):
            raise SolutionError(
                message(
                    "too_few_conditions",
                    "{conditions} conditions for {unknowns} unknowns: too few observations",
                    conditions=len(w),
                    unknowns=len(x),
                )
            )
        if iteration == 1:
            if isinstance(b, np.ndarray) and b.shape[1] < len(l):  # points, each in one condition
                q = PointCovariance.convert(covariance, b.shape[1])
            # A fixed observation has the variance 0; the smallest float avoids a division by zero.
            sd = np.sqrt(np.maximum(q.diagonal(), np.finfo(float).tiny))
        # The misclosures refer to the original observations: w(l + v) - B v, with B = -I or the
        # Jacobian of the conditions.
        if b is None:  # B = -I
            correct, whiten, misclosures = q.__matmul__, weight_whitener(), w + v
        else:
            correct, whiten, bv = _propagate_conditions(q, b, v)
            misclosures = w - bv
        aw, ww = whiten(a), whiten(misclosures)
        # dx = -(A'M^-1 A)^-1 A'M^-1 w, from the whitened rows.
        step, inverse, basis = _solve(aw, ww)
        x = x + step
        normalised = ww + aw @ step
        # v = -Q B' M^-1 (A dx + w), with M^-1 applied as L^-T L^-1.
        previous_v, v = v, correct(whiten(normalised, transposed=True))
        # The length of a whitened column is the inverse of the standard deviation that the unknown
        # would have on its own.
        unknown_steps = np.abs(step) * np.linalg.norm(aw, axis=0)
        steps_in_sd = np.concatenate([unknown_steps, np.abs(v - previous_v) / sd])
        previous_step, largest_step = largest_step, steps_in_sd.max(initial=0.0)
        # The length of a column grows with the square root of the number of rows.
        limit = tolerance * len(w) ** 0.5
        only_rounding_left = largest_step > previous_step / 2 and largest_step < 1e4 * limit
        if largest_step <= limit or only_rounding_left:
            basis = aw @ inverse if basis is None else basis
            return Adjustment(
                unknowns=x,
                cofactor=inverse @ inverse.T,
                normalised=normalised,
                chi2=float(normalised @ normalised),
                rows=len(w),
                estimated=len(x),
                iterations=iteration,
                observations=l + v,
                residuals=v,
                redundancy=1.0 - np.sum(basis**2, axis=1),
            )
    raise SolutionError(
        message(
            "adjustment_unconverged",
            "the adjustment did not converge in {iterations} iterations",
            iterations=max_iterations,
        )
    )


@dataclass(frozen=True)
class Damping:
    """Levenberg-Marquardt damping of `gauss_newton`: the weight of a term that shortens steps.

    Attributes
    ----------
    start : float
        Damping of the first step. With 0, the search ends at the first rejected step.
    relax : float
        Divisor after an accepted step. A rejected step multiplies the damping by 10.
    least, most : float
        Smallest damping, and the damping above which the search ends.
    """

    start: float = 1e-3
    relax: float = 10.0
    least: float = 1e-9
    most: float = np.inf


UNDAMPED = Damping(start=0.0, least=0.0)


def gauss_newton(step_at, state, *, move, is_small, most_steps, is_better=None, damping=UNDAMPED):
    """Improve a state by Gauss-Newton steps until a step is small, or no step is accepted.

    This function controls the steps of small nonlinear fits without covariance, such as start
    values. The caller linearises the problem and solves for each step.

    Parameters
    ----------
    step_at : callable
        step_at(state, damping) -> step. Undamped searches may ignore the damping.
    state : object
        Start values, in any form accepted by `step_at` and `move`.
    move : callable
        move(state, step) -> state after the step.
    is_small : callable
        is_small(step) -> bool: an accepted step that ends the search.
    most_steps : int
        Largest number of steps, including rejected steps.
    is_better : callable, optional
        is_better(candidate, state) -> bool: whether a step is accepted. None accepts every step.
    damping : Damping, optional

    Returns
    -------
    object
        The last accepted state.

    Examples
    --------
    Position on a line whose distance to a point at height 3 is 5:

    >>> x = gauss_newton(
    ...     lambda x, damping: (5.0 - np.hypot(x, 3.0)) * np.hypot(x, 3.0) / x,
    ...     1.0,
    ...     move=lambda x, step: x + step,
    ...     is_small=lambda step: abs(step) < 1e-9,
    ...     most_steps=20,
    ... )
    >>> round(float(x), 9)
    4.0
    """
    weight = damping.start
    for _ in range(most_steps):
        step = step_at(state, weight)
        candidate = move(state, step)
        if is_better is None or is_better(candidate, state):
            state = candidate
            if is_small(step):
                break
            # Close to the minimum, a weakly damped step converges fastest.
            weight = max(weight / damping.relax, damping.least)
        else:
            # A strongly damped step is short and follows the gradient, so it reduces the cost.
            weight *= 10
            if not 0 < weight <= damping.most:
                break
    return state


@dataclass(frozen=True)
class SnoopingResult:
    """Result of data snooping among k candidates.

    Attributes
    ----------
    adjustment : Adjustment
        The final adjustment.
    statistic : ndarray, shape (k,)
        Last test statistic of each candidate; nan for an untested candidate.
    needed : ndarray of bool, shape (k,)
        True for a candidate that fails the test but is kept, because another quantity would not be
        determined without it.
    rounds : int
        Number of readjustments, including failed attempts.
    """

    adjustment: object
    statistic: np.ndarray
    needed: np.ndarray
    rounds: int


def snoop(adjustment, tests, readjust, *, at_once, returns, choose=None, keep=False, rounds=None):
    """Search for outliers by data snooping, and readmit candidates that pass the test later.

    The candidate with the largest test statistic is rejected first.

    Parameters
    ----------
    adjustment : object
        The first adjustment, of any type accepted by `tests` and `readjust`.
    tests : callable
        tests(adjustment) -> mask (k,) of the candidates in use, absolute test statistics (k,), and
        the critical value. An untested candidate has the statistic nan.
    readjust : callable
        readjust(adjustment, rejected, readmitted) -> the adjustment after the changes in both masks
        (k,).
    at_once : float
        Share of the largest statistic: candidates above this share are rejected together.
    returns : int
        Largest number of times that a candidate may be readmitted. The first time, all candidates
        that pass the test are readmitted together, later only one at a time.
    choose : callable, optional
        choose(adjustment, rejected, share) -> mask (k,) of the candidates that are rejected. None:
        all candidates in `rejected`. `share` (k,) is the share of the largest statistic. It is
        rounded, so that equal statistics compare as equal on every machine.
    keep : bool, optional
        If True, a candidate is kept from then on when the readjustment fails without it.
    rounds : int, optional
        Largest number of rounds; None: no limit.

    Returns
    -------
    SnoopingResult

    Raises
    ------
    SolutionError
        If a readjustment fails (unless `keep`), or if the search does not settle within `rounds`.

    References
    ----------
    Baarda 1968, A testing procedure for use in geodetic networks.

    Examples
    --------
    The mean of five readings with a standard uncertainty of 1 mm, one of them wrong by 20 mm.
    Rejected readings get no weight:

    >>> readings = np.array([4.001, 4.000, 3.999, 4.020, 4.000])
    >>> def mean(used):
    ...     sd = np.where(used, 0.001, 1.0)
    ...     return used, adjust(lambda x, l: (x - l, np.ones((5, 1)), None), [4.0], readings, sd**2)
    >>> def tests(result):
    ...     used, fit = result
    ...     factor = np.sqrt(np.maximum(fit.redundancy, 1e-9))
    ...     return used, np.abs(fit.residuals) / (0.001 * factor), CRITICAL
    >>> def readjust(result, rejected, readmitted):
    ...     return mean(result[0] & ~rejected | readmitted)
    >>> first = mean(np.ones(5, bool))
    >>> snoop(first, tests, readjust, at_once=0.9, returns=1).adjustment[0].tolist()
    [True, True, True, False, True]
    """
    only_worst = False
    statistic = return_counts = needed = None
    for round_number in range(rounds) if rounds else count():
        used, current, critical = tests(adjustment)
        if statistic is None:
            statistic = np.full(len(current), np.nan)
            return_counts, needed = (
                np.zeros(len(current), dtype=int),
                np.zeros(len(current), dtype=bool),
            )
        # A candidate that is not tested in this round keeps its last statistic.
        statistic = np.where(np.isnan(current), statistic, current)
        tested = np.where(used & ~needed & ~np.isnan(current), current, 0.0)
        largest = tested.max(initial=0.0)
        # Rounded, so that a tie does not depend on the machine.
        share = np.round(tested / largest, TIED) if largest > 0 else tested
        rejected = (tested > critical) & (share >= at_once)
        # After a failed readjustment only the first candidate with the largest statistic is
        # rejected.
        if only_worst:
            rejected &= np.arange(len(tested)) == np.argmax(share)
        # Candidates are readmitted only in a round without rejections: a remaining outlier distorts
        # the statistics.
        readmitted = np.zeros(len(current), dtype=bool)
        if rejected.any():
            rejected = rejected if choose is None else choose(adjustment, rejected, share)
        else:
            readmitted = _select_readmitted(
                ~used & (current < critical), current, return_counts, returns
            )
            return_counts[readmitted] += 1
        if not (rejected.any() or readmitted.any()):
            return SnoopingResult(adjustment, statistic, needed, round_number)
        try:
            adjustment, only_worst = readjust(adjustment, rejected, readmitted), False
        except SolutionError:
            if not keep:
                raise
            # A single rejection that fails identifies the candidate without which the unknowns are
            # not determined.
            if only_worst or np.count_nonzero(rejected) == 1:
                needed |= rejected
            only_worst = True
    raise SolutionError(
        message(
            "snooping_unsteady",
            "data snooping did not settle within {rounds} rounds",
            rounds=rounds,
        )
    )


def _select_readmitted(agrees, statistic, return_counts, returns):
    """Mask of readmitted candidates: all at their first pass, later only the best."""
    first = agrees & (return_counts == 0)
    # Readmitting one candidate at a time prevents an endless exchange of two candidates.
    candidates = np.where(agrees & (return_counts < returns), statistic, np.inf)
    if first.any() or not np.isfinite(candidates).any():
        return first
    return candidates == candidates.min()


def find_determined(pivots, rows, of_normals=False):
    """Determine which unknowns are determined, from the pivots of a factorisation.

    Parameters
    ----------
    pivots : array_like, shape (k,)
        Diagonal of R or of the Cholesky factor, not squared.
    rows : int
        Number of rows.
    of_normals : bool, optional
        True for a Cholesky factor of normal equations.

    Returns
    -------
    ndarray of bool, shape (k,)
        True for a pivot above rounding.

    Notes
    -----
    This is the only rule for the rank, here and in tankcal.solver. The columns are scaled to length
    one. A pivot of the rows (QR) must exceed max(rows, k) eps times the largest pivot. A
    squared pivot of normal equations (Cholesky) must reach 1e-12, because squaring loses half the
    digits.

    Examples
    --------
    >>> find_determined([2.0, 0.5, 1e-17], rows=10).tolist()
    [True, True, False]
    """
    pivots = np.abs(pivots)
    if of_normals:
        return pivots**2 >= SMALLEST_PIVOT
    limit = max(rows, len(pivots)) * np.finfo(float).eps
    return pivots > limit * pivots.max(initial=0.0)


def _propagate_conditions(q, b, v):
    """Return functions that multiply by -Q B' and by L^-1, with L L' = B Q B', and B v."""
    if isinstance(q, PointCovariance):
        # Each row of B has the d coordinates of its own point.
        bv = np.sum(b * v.reshape(b.shape), axis=1)
        return lambda y: -(q @ (b * y[:, None]).ravel()), whitener(q.mapped(b[:, None])), bv
    qb = q @ b.T
    return lambda y: -(qb @ y), whitener(b @ qb), b @ v


def whitener(covariance):
    """Return a function that multiplies by L^-1, where L L' is a covariance (n, n).

    Parameters
    ----------
    covariance : ndarray, sparse array or PointCovariance
        Or variances (n,).

    Returns
    -------
    callable
        whiten(array, transposed=False) -> L^-1 array or L^-T array, for an array (n,) or (n, k). L
        is triangular or, for a PointCovariance with few shared unknowns, another root.

    Raises
    ------
    SolutionError
        If the covariance is not positive definite.

    Examples
    --------
    >>> whitener(np.array([4.0, 9.0]))(np.array([[2.0], [6.0]])).ravel()
    array([1., 2.])
    """
    m = covariance
    if np.ndim(m) == 1:
        return _diagonal_whitener(m)
    if isinstance(m, PointCovariance):
        if m.is_diagonal:
            return _diagonal_whitener(m.independent.ravel())
        try:
            whiten = m.whitener()
        except np.linalg.LinAlgError as error:
            raise _indefinite() from error
        if whiten is not None:
            return whiten
        m = m.dense()
    if scipy.sparse.issparse(m):
        # A sparse matrix that is diagonal needs no factorisation.
        diagonal, m = m.diagonal(), m.tocsr()
        m.eliminate_zeros()
        if m.nnz <= len(diagonal):
            return _diagonal_whitener(diagonal)
        m = m.toarray()
    try:
        factor = scipy.linalg.cholesky(m, lower=True)
    except scipy.linalg.LinAlgError as error:
        raise _indefinite() from error

    def whiten(array, transposed=False):
        return scipy.linalg.solve_triangular(
            factor, array, lower=True, trans=1 if transposed else 0, check_finite=False
        )

    return whiten


def _indefinite():
    """SolutionError of a covariance that is not positive definite."""
    return SolutionError(
        message(
            "covariance_indefinite",
            "the observations' covariance is not positive definite",
        )
    )


def _diagonal_whitener(diagonal):
    """Return a function that divides by the square roots of a diagonal covariance (n,)."""
    if not np.all(diagonal > 0):
        raise SolutionError(
            message(
                "observation_without_variance",
                "an observation has no variance: its sd must be above zero",
            )
        )
    root = np.sqrt(diagonal)

    def whiten(array, transposed=False):
        return array / (root if np.ndim(array) == 1 else root[:, None])

    return whiten


def _solve(a, w):
    """Solve whitened rows a (m, u), w (m,) for the step of the unknowns.

    Returns the step (u,), R^-1 (u, u) with cofactor matrix R^-1 R^-T, and the orthonormal basis A
    R^-1. The basis is None after a solution by normal equations, where it is cheap to compute
    later.
    """
    scale = np.linalg.norm(a, axis=0)
    if not np.all(np.isfinite(scale)):
        raise SolutionError(
            message(
                "derivative_not_finite",
                "the adjustment diverged: a derivative is not finite",
            )
        )
    # A zero column stays zero, and the rank test below rejects it.
    scale[scale == 0] = 1.0
    scaled = a / scale
    # Normal equations are used only if each squared pivot exceeds WELL_PLACED; otherwise QR
    # preserves the digits.
    root, info = scipy.linalg.lapack.dpotrf(scaled.T @ scaled, lower=True)
    if not info and np.diag(root).min(initial=1.0) ** 2 > WELL_PLACED:
        inverse = scipy.linalg.lapack.dtrtri(root, lower=True)[0].T / scale[:, None]
        return -inverse @ (inverse.T @ (a.T @ w)), inverse, None
    # Column pivoting sorts the pivots, so that the last ones reveal the rank.
    basis, r, order = scipy.linalg.qr(scaled, mode="economic", pivoting=True, check_finite=False)
    rank = int(np.sum(find_determined(np.diag(r), len(a))))
    if rank < a.shape[1]:
        raise SolutionError(
            f"rank {rank} of {a.shape[1]}: the observations do not determine unknown(s) "
            + ", ".join(str(i) for i in sorted(order[rank:]))
        )
    # R^-1 with its rows in the original order of the unknowns, and without the column scale.
    inverse = np.empty_like(r)
    inverse[order] = scipy.linalg.solve_triangular(r, np.eye(len(r)), check_finite=False)
    inverse /= scale[:, None]
    return -inverse @ (basis.T @ w), inverse, basis
