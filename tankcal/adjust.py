"""Least squares that knows no geometry: the combined (Gauss-Helmert) model.

Conditions f(x, l + v) = 0 between unknowns x and observations l with covariance Q, linearised in
each iteration at the adjusted observations:

    B v + A dx + w = 0,   M = B Q B',   dx = -(A' M^-1 A)^-1 A' M^-1 w,   v = -Q B' M^-1 (A dx + w)

A model without B is a Gauss-Markov model, f = F(x) - l and B = -I. Everything is whitened with a
Cholesky factor, and columns are scaled: those that are well apart are solved by normal equations,
others by QR, which judges the rank. Nothing else is inverted but the covariance. Source: Mikhail &
Ackermann 1976, Observations and Least Squares, ch. 9.
"""

from dataclasses import dataclass
from functools import cache
from itertools import count

import numpy as np
import scipy.linalg
import scipy.sparse
from scipy.special import ndtri

from tankcal.errors import SolutionError
from tankcal.messages import message

ALPHA, POWER = 0.001, 0.80  # of every test of single readings, and of the blunder it can show
CRITICAL = 3.29  # of a test statistic: ALPHA, two-sided normal, to the digits of the field
UNCONTROLLED = 1e-6  # a redundancy number below it is zero: the observation cannot be checked
WELL_PLACED = 1e-3  # pivot of those that loses three digits of sixteen: above it they will do
TIED = 9  # digits of test statistics: two readings that control each other alone differ by rounding
SMALLEST_PIVOT = 1e-12  # of normal equations with ones in the diagonal: below it is rounding


def noncentrality(alpha=ALPHA, power=POWER):
    """delta0 of a two-sided test of the normal distribution; 4.13 for 0.001 and 0.80."""
    return float(ndtri(1 - alpha / 2) + ndtri(power))


@dataclass(frozen=True)
class Adjustment:
    """What any adjustment found: of `adjust` here, or with blocks eliminated (tankcal.solver).

    Attributes
    ----------
    unknowns : ndarray, shape (u,)
        Estimates, in the model's units; of a solver.Model its state.
    cofactor : ndarray, shape (u, u)
        Covariance of the unknowns for variance factor 1; of a solver.Model the solver.Cofactors
        that works it out for any unknowns and any functions of them.
    normalised : ndarray, shape (m,)
        Whitened residual of each condition; of a solver.Model a tuple of (n, rows), computed minus
        observed, one array a group.
    chi2 : float
        v' Q^-1 v.
    rows : int
        Conditions that weigh anything.
    estimated : int
        Unknowns, less those that exact conditions take.
    iterations : int
        Until the last step was below the tolerance.
    rank_defect : int
        Directions of the unknowns that only the datum fixes.
    observations, residuals : ndarray, shape (n,), or None
        Adjusted observations l + v and v, in the units of the observations; None: the solver.Model
        keeps its own.
    redundancy : ndarray, shape (m,), or None
        Part of each condition's error that shows in its residual, 0 to 1; None:
        Cofactors.redundancy works it out.
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
        """Degrees of freedom: rows minus unknowns, plus what the datum takes up."""
        return self.rows - self.estimated + self.rank_defect

    @property
    def variance_factor(self):
        """A-posteriori variance factor chi2 / dof; nan when nothing is redundant."""
        return self.chi2 / self.dof if self.dof > 0 else np.nan

    @property
    def sigma0(self):
        """Root of the a-posteriori variance factor."""
        return float(np.sqrt(self.variance_factor))


def adjust(model, unknowns, observations, covariance, *, max_iterations=50, tolerance=1e-8):
    """Adjust observations so that the conditions of `model` hold.

    Parameters
    ----------
    model : callable
        model(x, l) -> (w, A, B): misclosures (m,), Jacobian by unknowns (m, u) and by observations
        (m, n), the last dense, scipy.sparse, or None for a Gauss-Markov model (w = F(x) - l).
    unknowns : (u,) array
        Start values.
    observations : (n,) array
    covariance : array or sparse matrix
        (n,) variances, or (n, n) dense or sparse; or (m, d, d) of points, n = m d, that nothing
        has in common: then each condition is of one of them, and the last Jacobian is (m, d).
    max_iterations : int
    tolerance : float
        The largest last step of an unknown or residual, in standard deviations; a step that no
        longer shrinks is accepted up to 1e4 times it (rounding).

    Returns
    -------
    Adjustment

    Raises
    ------
    SolutionError
        When the conditions do not determine the unknowns, when there are fewer conditions than
        unknowns, or when the iteration does not converge.

    Examples
    --------
    Three levelled height differences, from a bench mark by two points and back, 1 mm each:

    >>> rows = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    >>> loop = lambda x, l: (rows @ x - l, rows, None)
    >>> done = adjust(loop, [0.0, 0.0], [1.002, 0.499, -1.507], [1e-6] * 3)
    >>> done.unknowns.round(6)
    array([1.004, 1.505])
    >>> done.residuals.round(6)
    array([0.002, 0.002, 0.002])
    >>> done.dof, round(done.sigma0, 3)
    (1, 3.464)
    """
    x = np.array(unknowns, dtype=float)
    l = np.asarray(observations, dtype=float)
    v, size = np.zeros_like(l), np.inf
    q = scipy.sparse.diags_array(covariance) if np.ndim(covariance) == 1 else covariance
    variances = np.einsum("kii->ki", q).ravel() if np.ndim(q) == 3 else q.diagonal()
    sd = np.sqrt(np.maximum(variances, np.finfo(float).tiny))
    by_weights = cache(lambda: _whitener(q))
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
        if b is None:  # B = -I
            minus_qb, whiten, w_there = q, by_weights(), w + v
        else:
            minus_qb, whiten, bv = _of_conditions(q, b, v)
            w_there = w - bv
        aw, ww = whiten(a), whiten(w_there)
        step, inverse, basis = _solve(aw, ww)
        x = x + step
        normalised = ww + aw @ step
        v_before, v = v, minus_qb @ whiten(normalised, transposed=True)
        of_unknowns = np.abs(step) * np.linalg.norm(aw, axis=0)
        moved = np.concatenate([of_unknowns, np.abs(v - v_before) / sd])
        before, size = size, moved.max(initial=0.0)
        limit = tolerance * len(w) ** 0.5
        only_rounding_left = size > before / 2 and size < 1e4 * limit
        if size <= limit or only_rounding_left:
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
class Snooped:
    """What data snooping left of k candidates.

    Attributes
    ----------
    adjustment : Adjustment
        The last one.
    statistic : ndarray, shape (k,)
        The last test statistic of each; nan: never tested.
    needed : ndarray of bool, shape (k,)
        Disagrees, and was kept because something would not be determined without it.
    rounds : int
        Readjustments that were made or tried.
    """

    adjustment: object
    statistic: np.ndarray
    needed: np.ndarray
    rounds: int


def snoop(adjustment, tests, readjust, *, at_once, returns, choose=None, keep=False, rounds=None):
    """Data snooping: set aside what disagrees, the worst first; take back what agrees after all.

    Parameters
    ----------
    adjustment : object
        The first one, whatever `tests` and `readjust` understand.
    tests : callable
        tests(adjustment) -> used (k,) bool, absolute test statistic (k,) of the candidates, nan
        where one is not tested, and the critical value.
    readjust : callable
        readjust(adjustment, goes, comes) -> the adjustment when these (k,) masks are followed.
    at_once : float
        Candidates whose statistic is above this share of the largest go together.
    returns : int
        Times that a candidate may come back: all that agree the first time, later one by one.
    choose : callable, optional
        choose(adjustment, goes, share) -> (k,) bool, those of `goes` that do go; None: all. share
        (k,) is that of the largest statistic, rounded so that a tie is a tie on every machine.
    keep : bool, optional
        Whether a candidate without which a readjustment fails is kept from then on.
    rounds : int, optional
        At most so many; None: no limit.

    Returns
    -------
    Snooped

    Raises
    ------
    SolutionError
        When a readjustment does (unless `keep`), or when the search does not come to rest.

    References
    ----------
    Baarda 1968, A testing procedure for use in geodetic networks.

    Examples
    --------
    The mean of five readings of 1 mm, one of them wrong by 20 mm; rejected ones get no weight:

    >>> readings = np.array([4.001, 4.000, 3.999, 4.020, 4.000])
    >>> def mean(used):
    ...     sd = np.where(used, 0.001, 1.0)
    ...     return used, adjust(lambda x, l: (x - l, np.ones((5, 1)), None), [4.0], readings, sd**2)
    >>> def tests(found):
    ...     used, fit = found
    ...     without = np.sqrt(np.maximum(fit.redundancy, 1e-9))
    ...     return used, np.abs(fit.residuals) / (0.001 * without), CRITICAL
    >>> def again(found, goes, comes):
    ...     return mean(found[0] & ~goes | comes)
    >>> snoop(mean(np.ones(5, bool)), tests, again, at_once=0.9, returns=1).adjustment[0].tolist()
    [True, True, True, False, True]
    """
    few = False
    statistic = back = needed = None
    for tried in range(rounds) if rounds else count():
        used, now, critical = tests(adjustment)
        if statistic is None:
            statistic = np.full(len(now), np.nan)
            back, needed = np.zeros(len(now), dtype=int), np.zeros(len(now), dtype=bool)
        statistic = np.where(np.isnan(now), statistic, now)
        off = np.where(used & ~needed & ~np.isnan(now), now, 0.0)
        worst = off.max(initial=0.0)
        share = np.round(off / worst, TIED) if worst > 0 else off
        goes = (off > critical) & (share >= at_once)
        if few:  # the first of the worst alone
            goes &= np.arange(len(off)) == np.argmax(share)
        comes = np.zeros(len(now), dtype=bool)
        if goes.any():
            goes = goes if choose is None else choose(adjustment, goes, share)
        else:
            comes = _coming_back(~used & (now < critical), now, back, returns)
            back[comes] += 1
        if not (goes.any() or comes.any()):
            return Snooped(adjustment, statistic, needed, tried)
        try:
            adjustment, few = readjust(adjustment, goes, comes), False
        except SolutionError:
            if not keep:
                raise
            if few or np.count_nonzero(goes) == 1:
                needed |= goes
            few = True
    raise SolutionError(
        message(
            "snooping_unsteady",
            "data snooping did not settle within {rounds} rounds",
            rounds=rounds,
        )
    )


def _coming_back(agrees, statistic, back, returns):
    """Mask of what comes back: all that agrees the first time, later the one that agrees best."""
    first = agrees & (back == 0)
    again = np.where(agrees & (back < returns), statistic, np.inf)
    if first.any() or not np.isfinite(again).any():
        return first
    return again == again.min()


def find_determined(pivots, rows, of_normals=False):
    """Which unknowns are determined, by the pivots of a factor that are more than rounding.

    The one rule about rank, here and in tankcal.solver: columns are scaled to length one first;
    then a pivot of the rows themselves (QR) must be above max(rows, k) eps of the largest, a
    squared pivot of normal equations (Cholesky), which have lost half the digits, above 1e-12.

    Parameters
    ----------
    pivots : array_like, shape (k,)
        Diagonal of R or of the Cholesky factor, not squared.
    rows : int
        Number of rows.
    of_normals : bool, optional
        True for a Cholesky factor.

    Returns
    -------
    ndarray of bool, shape (k,)

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


def _of_conditions(q, b, v):
    """-Q B', the function that multiplies by L^-1 with L L' = B Q B', and B v."""
    if np.ndim(q) == 3:
        own = _OwnBlocks(-np.einsum("kij,kj->ki", q, b))
        return (
            own,
            _diagonal_whitener(-np.sum(b * own.rows, axis=1)),
            np.sum(b * v.reshape(b.shape), axis=1),
        )
    minus_qb = -(q @ b.T)
    return minus_qb, _whitener(-(b @ minus_qb)), b @ v


@dataclass(frozen=True)
class _OwnBlocks:
    """A matrix (k d, k) that is zero but for d rows of each column, as (k, d)."""

    rows: np.ndarray

    def __matmul__(self, vector):
        return (self.rows * vector[:, None]).ravel()


def _whitener(m):
    """A function that multiplies by L^-1 (or L^-T), where L L' = m."""
    diagonal = m.diagonal()
    if scipy.sparse.issparse(m):
        m = m.tocsr()
        m.eliminate_zeros()
        if m.nnz <= len(diagonal):
            return _diagonal_whitener(diagonal)
        m = m.toarray()
    try:
        factor = scipy.linalg.cholesky(m, lower=True)
    except scipy.linalg.LinAlgError as error:
        raise SolutionError(
            message(
                "covariance_indefinite",
                "the observations' covariance is not positive definite",
            )
        ) from error

    def whiten(array, transposed=False):
        return scipy.linalg.solve_triangular(
            factor, array, lower=True, trans=1 if transposed else 0, check_finite=False
        )

    return whiten


def _diagonal_whitener(diagonal):
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
    """Step, R^-1 whose square is the cofactor matrix, and A R^-1, an orthonormal basis.

    By the Cholesky factor of the normal equations where columns of length one are far from
    depending on each other (the basis is None then: it is quickly had), else by QR.
    """
    scale = np.linalg.norm(a, axis=0)
    if not np.all(np.isfinite(scale)):
        raise SolutionError(
            message(
                "derivative_not_finite",
                "the adjustment diverged: a derivative is not finite",
            )
        )
    scale[scale == 0] = 1.0
    scaled = a / scale
    root, wrong = scipy.linalg.lapack.dpotrf(scaled.T @ scaled, lower=True)
    if not wrong and np.diag(root).min(initial=1.0) ** 2 > WELL_PLACED:
        inverse = scipy.linalg.lapack.dtrtri(root, lower=True)[0].T / scale[:, None]
        return -inverse @ (inverse.T @ (a.T @ w)), inverse, None
    basis, r, order = scipy.linalg.qr(scaled, mode="economic", pivoting=True, check_finite=False)
    rank = int(np.sum(find_determined(np.diag(r), len(a))))
    if rank < a.shape[1]:
        raise SolutionError(
            f"rank {rank} of {a.shape[1]}: the observations do not determine unknown(s) "
            + ", ".join(str(i) for i in sorted(order[rank:]))
        )
    inverse = np.empty_like(r)
    inverse[order] = scipy.linalg.solve_triangular(r, np.eye(len(r)), check_finite=False)
    inverse /= scale[:, None]
    return -inverse @ (basis.T @ w), inverse, basis
