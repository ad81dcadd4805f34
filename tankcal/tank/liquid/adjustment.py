"""Adjustment of metered steps: estimates of all causes of their misclosures.

The misclosure y of a step (metered volume less the increment of the geometry) is a sum of causes.
Each cause has a column in m3 for one standard deviation:

    y = A z + F b + N e,      z, e ~ N(0, I),   b free

z are causes with a prior (geometry, meters, runs), b causes without a prior (the volume below the
first dip), e errors of single readings (batches, dips). With R = N N' whitened by W, W R W' = I,
least squares of

    [W A  W F] [z]   [W y]
    [ I    0 ] [b] = [ 0 ]

gives z and b = G y. The rows Q of its orthonormal basis that belong to the steps give the weights
M = W' (I - Q Q') W of all tests: for any cause with the column c (m3 per unit of the cause)

    size = c' M y / c' M c,   sd = 1 / sqrt(c' M c),   w = size / sd.

This is the best linear prediction: G y = A' S^-1 y with S = A A' + R, without inversion of S, so
that a prior may be arbitrarily wide. Source: Koch 1999, Parameter estimation and hypothesis
testing, 3.5; Baarda 1968.

Cause of misclosures
--------------------

The statistic of an alternative of free size is w of its column. For an alternative of known size
(temperatures in Fahrenheit), it is the square root of the reduction of chi-square. Alternatives
whose chi-square is not significantly larger than that of the most likely alternative are named with
it. Of a kind with many members (a dip, a batch), one member is more often large by chance. All
kinds have equal prior probability, shared among their members, which subtracts 2 ln(members) from
w^2.

Run effect
----------

With M the weights of all known effects without the run effect, and Z the misclosures for a run
effect of one,

    Z' M Z = Q diag(l) Q',   d = Q' Z' M y / l  ~  N(0, diag(theta + 1/l)),

independent of one another. The restricted likelihood of theta, the variance of the run effect, is
thus that of these few normal variables. Source: Patterson & Thompson 1971 (REML); Searle, Casella &
McCulloch 1992, 6.6.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.adjust import noncentrality
from tankcal.errors import SolutionError
from tankcal.messages import message

UNOBSERVED = 1e-10  # relative to the largest pivot: a free cause with a smaller pivot is unobserved
UNTESTABLE = 1e-12  # relative to c' R^-1 c: a cause with a smaller c' M c cannot be tested
ALIKE = 3.84  # chi-square at 5 %: a smaller difference between two causes is not significant
LEAST = 4.0  # least |w| of a named cause
UNDETERMINED = 1e-9  # relative to the largest l: directions with a smaller l are not determined
GRID = 400  # log-spaced variances, from 1e-3 of the mean noise variance to 1e4 of the largest


@dataclass(frozen=True)
class Effect:
    """Cause of misclosures, or several causes of one kind.

    Attributes
    ----------
    kind : str
    columns : ndarray or scipy.sparse.csr_array, shape (n, c)
        Change of the misclosures for one standard deviation of each cause, m3; for a free cause:
        for one unit. Columns of single readings are sparse.
    is_free : bool
        True: no prior.
    """

    kind: str
    columns: np.ndarray
    is_free: bool = False


class StepWeights:
    """Weights M = W' (I - Q Q') W of n steps, as an operator: M c is computed without M.

    Parameters
    ----------
    lower : ndarray, shape (width + 1, n)
        Cholesky factor of the covariance of the readings, banded.
    rotation : ndarray, shape (n + priors, c)
        Orthonormal basis of the whitened design, with the rows of the priors below those of the
        steps.
    """

    __array_ufunc__ = None  # numpy leaves `array @ weights` to __rmatmul__

    def __init__(self, lower, rotation):
        self._lower, self._rotation = lower, rotation

    def __matmul__(self, columns):
        """M c, shape (n,) or (n, k)."""
        projected = self._project(columns)[: self._lower.shape[1]]
        return _whiten(self._lower, projected, is_transposed=True)

    def __rmatmul__(self, rows):
        """Products c' M, shape (n,) or (k, n)."""
        return (self @ rows.T).T

    def quadratic_forms(self, columns):
        """Return c' M c and c' R^-1 c of columns (n, k), each (k,)."""
        if scipy.sparse.issparse(columns):
            columns = columns.toarray()
        largest = np.sum(_whiten(self._lower, columns) ** 2, axis=0)
        # The projection is orthogonal with the rows of the priors, so that its squared length is
        # the form itself. The difference of two large forms would lose digits.
        return np.sum(self._project(columns) ** 2, axis=0), largest

    def _project(self, columns):
        """Part of (W c, 0) orthogonal to the design, with the rows of the priors."""
        white = _whiten(self._lower, columns)
        projected = -self._rotation @ (self._rotation[: len(white)].T @ white)
        projected[: len(white)] += white
        return projected


@dataclass(frozen=True)
class LiquidAdjustment:
    """Result of the adjustment of n steps.

    Attributes
    ----------
    misclosure_m3 : ndarray, shape (n,)
    noise : tuple of Effect
        Errors of the readings: batches, dips, temperatures.
    effects : tuple of Effect
        All other effects, with free effects last.
    gain : ndarray, shape (c, n)
        Estimates of all effects by the misclosures, 1/m3; rows in the order of the effects.
    sd : ndarray, shape (c,)
        Standard deviations of the estimates, in standard deviations of the effects (for a free
        effect: in its unit).
    weight : StepWeights
        M, 1/m6.
    """

    misclosure_m3: np.ndarray
    noise: tuple[Effect, ...]
    effects: tuple[Effect, ...]
    gain: np.ndarray
    sd: np.ndarray
    weight: StepWeights

    @cached_property
    def estimate(self):
        """Estimates (c,) of all effects, in the order of `gain`."""
        return self.gain @ self.misclosure_m3

    @cached_property
    def pulled(self):
        """M y, shape (n,)."""
        return self.weight @ self.misclosure_m3

    @property
    def chi2(self):
        """y' M y, chi-square with n less the number of free effects as degrees of freedom."""
        return float(self.misclosure_m3 @ self.pulled)

    @property
    def dof(self):
        """Degrees of freedom of `chi2`."""
        free = sum(effect.columns.shape[1] for effect in self.effects if effect.is_free)
        return len(self.misclosure_m3) - free

    def place(self, kind):
        """Return the slice of the rows of `gain` for the effects of a kind; empty if none."""
        start = 0
        for effect in self.effects:
            end = start + effect.columns.shape[1]
            if effect.kind == kind:
                return slice(start, end)
            start = end
        return slice(0, 0)

    def test(self, columns):
        """Test causes with columns (n, k), each separately, and return (size, sd, w), each (k,).

        size is in the unit of the cause. If the steps cannot determine it, sd is infinite and w is
        0.
        """
        columns = np.asarray(columns, dtype=float)
        information, largest = self.weight.quadratic_forms(columns)
        # c' M c relative to its largest possible value c' R^-1 c: below, the remainder is rounding.
        is_determined = information > UNTESTABLE * largest
        divisor = np.where(is_determined, information, 1.0)
        size = np.where(is_determined, columns.T @ self.pulled / divisor, 0.0)
        sd = np.where(is_determined, 1 / np.sqrt(divisor), np.inf)
        return size, sd, np.where(is_determined, size / np.where(is_determined, sd, 1.0), 0.0)

    def residuals(self, effect):
        """Return (deviates, redundancy, w), each (c,), of an effect with a prior.

        The prior is an observation of 0 with one standard deviation. The deviate is its residual in
        standard deviations, the redundancy is the fraction of an error that appears in the
        residual, and w is the test statistic.
        """
        deviates = effect.columns.T @ self.pulled
        redundancy, _ = self.weight.quadratic_forms(effect.columns)
        divisor = np.sqrt(np.maximum(redundancy, 1e-30))
        return deviates, redundancy, np.where(redundancy > UNTESTABLE, deviates / divisor, 0.0)


def adjust_steps(misclosure_m3, noise, effects):
    """Adjust metered steps together with all causes of their misclosures.

    Parameters
    ----------
    misclosure_m3 : array_like, shape (n,)
        Metered volume less the volume of the geometry, m3.
    noise : sequence of Effect
        Errors of the readings; each step must have an error of its own.
    effects : sequence of Effect
        All other causes.

    Returns
    -------
    LiquidAdjustment

    Raises
    ------
    SolutionError
        If steps have no error of their own, or if a free effect is not observed.

    Examples
    --------
    A batch of 10 m3 +- 0.003 where the geometry has 9.99 +- 0.004: a misclosure of 0.01.

    >>> batch, wall = Effect("batch", np.array([[0.003]])), Effect("wall", np.array([[0.004]]))
    >>> fit = adjust_steps([0.01], [batch], [wall])
    >>> round(float(9.99 + 0.004 * fit.estimate[0]), 4), round(float(0.004 * fit.sd[0]), 4)
    (9.9964, 0.0024)
    """
    y = np.asarray(misclosure_m3, dtype=float)
    effects = tuple(sorted(effects, key=lambda effect: effect.is_free))
    priors = _stack_columns([effect for effect in effects if not effect.is_free], len(y))
    free = _stack_columns([effect for effect in effects if effect.is_free], len(y))
    lower = _factor_noise(noise, len(y))
    prior_count = priors.shape[1]
    design = np.zeros((len(y) + prior_count, prior_count + free.shape[1]))
    design[: len(y)] = _whiten(lower, np.hstack([priors, free]))
    design[len(y) :, :prior_count] = np.eye(prior_count)
    rotation, upper, order = scipy.linalg.qr(design, mode="economic", pivoting=True)
    count = design.shape[1]
    _refuse_unobserved(upper, free.shape[1])
    inverse = np.empty_like(upper)
    inverse[order] = scipy.linalg.solve_triangular(upper, np.eye(count))
    return LiquidAdjustment(
        misclosure_m3=y,
        noise=tuple(noise),
        effects=effects,
        gain=_whiten(lower, rotation[: len(y)] @ inverse.T, is_transposed=True).T,
        sd=np.linalg.norm(inverse, axis=1),
        weight=StepWeights(lower, rotation),
    )


def _stack_columns(effects, rows):
    """Return the columns of effects side by side, shape (rows, c)."""
    return np.hstack([np.zeros((rows, 0)), *(effect.columns for effect in effects)])


def _factor_noise(noise, rows):
    """Return the lower Cholesky factor of R = N N' in banded form, shape (width + 1, rows).

    A reading belongs to neighbouring steps, so R has few diagonals.
    """
    columns = scipy.sparse.hstack(
        [scipy.sparse.csr_array((rows, 0)), *(effect.columns for effect in noise)], format="csr"
    )
    covariance = (columns @ columns.T).tocoo()
    below = covariance.row >= covariance.col
    row, column, value = (part[below] for part in (covariance.row, covariance.col, covariance.data))
    bands = np.zeros((np.max(row - column, initial=0) + 1, rows))
    bands[row - column, column] = value
    try:
        lower = scipy.linalg.cholesky_banded(bands, lower=True)
    except np.linalg.LinAlgError:
        lower = None
    if lower is None or np.min(lower[0]) < 1e-9 * np.max(lower[0], initial=0.0):
        raise SolutionError(
            message(
                "steps_without_error",
                "a step by liquid has no error of its own, neither of its batch nor of its dips: "
                "expected a repeatability of the meter, or a standard deviation of the dips, "
                "above 0",
            )
        )
    return lower


def _whiten(lower, columns, *, is_transposed=False):
    """Return W c of columns (n, c), or W' c, with W the inverse of the banded factor."""
    width = len(lower) - 1
    if not is_transposed:
        return scipy.linalg.solve_banded((width, 0), lower, columns)
    upper = np.zeros_like(lower)  # row i of the transposed bands is moved right by its distance
    for distance, band in enumerate(lower):
        upper[width - distance, distance:] = band[: band.size - distance]
    return scipy.linalg.solve_banded((0, width), upper, columns)


def _refuse_unobserved(upper, free):
    """Raise SolutionError if a free effect is not observed."""
    pivots = np.abs(np.diag(upper))
    if free and np.min(pivots) < UNOBSERVED * min(1.0, np.max(pivots)):
        raise SolutionError(
            message(
                "liquid_unobserved",
                "the steps by liquid do not tell all that was left free: expected a run that "
                "begins in the empty tank, or dips that differ",
            )
        )


@dataclass(frozen=True)
class Alternative:
    """Possible cause of misclosures.

    Attributes
    ----------
    kind : str
        "meter", "radii", "dip", "dip_zero", "batch", "leak", "bottom", "fahrenheit", "swapped".
    column : ndarray, shape (n,)
        Change of the misclosures for one unit of the cause, m3.
    of : str or int or None
        Member of the kind: a meter, a row.
    unit : str
        Unit of the size: "1", "m", "m3"; "" for a cause that either applies or not.
    is_whole : bool
        True: the size is either one or zero.
    most : float
        Largest possible size; a cause with a larger estimate is not named.
    """

    kind: str
    column: np.ndarray
    of: object = None
    unit: str = "1"
    is_whole: bool = False
    most: float = np.inf


@dataclass(frozen=True)
class Verdict:
    """Result of the test of an alternative.

    Attributes
    ----------
    cause : Alternative
    size, sd, w : float
        Estimate, in its unit; its standard deviation (inf: the steps cannot determine it); signed
        w.
    detectable : float
        Smallest size detected with a power of 0.8 at 0.1 %.
    is_named : bool
        Whether the cause is the most likely, with a sufficiently large |w|, or is not significantly
        less likely.
    undetected_U : float or None
        External reliability: largest change of a volume of the table by an error of the size
        `detectable`, over the U of that volume; None: not computed for causes of this kind.
    """

    cause: Alternative
    size: float
    sd: float
    w: float
    detectable: float
    is_named: bool = False
    undetected_U: float | None = None


def name_causes(adjusted, alternatives):
    """Return the `Verdict`s of all alternatives, the most likely first.

    Parameters
    ----------
    adjusted : LiquidAdjustment
    alternatives : sequence of Alternative

    Returns
    -------
    tuple of Verdict
    """
    if not alternatives:
        return ()
    columns = np.stack([alternative.column for alternative in alternatives], axis=1)
    size, sd, w = adjusted.test(columns)
    for place, alternative in enumerate(alternatives):
        if alternative.is_whole and np.isfinite(sd[place]):
            # Reduction of chi-square for the fixed size one: (size^2 - (size - 1)^2) / sd^2.
            reduction = (2 * size[place] - 1) / sd[place] ** 2
            w[place] = np.sqrt(max(reduction, 0.0))
    kinds = [alternative.kind for alternative in alternatives]
    score = w**2 - 2 * np.log([kinds.count(kind) for kind in kinds])
    order = np.argsort(-score, kind="stable")
    large = (np.abs(w) > LEAST) & (
        np.abs(size) <= [alternative.most for alternative in alternatives]
    )
    best = np.max(score[large], initial=-np.inf)
    # Score: w^2 less the penalty for the number of members of the kind.
    named = large & (best - score < ALIKE)
    delta = noncentrality()
    return tuple(
        Verdict(
            alternatives[i],
            float(size[i]),
            float(sd[i]),
            float(w[i]),
            float(delta * sd[i]),
            bool(named[i]),
        )
        for i in order
    )


@dataclass(frozen=True)
class RunEffect:
    """Standard deviation of the run effect, relative, with its degrees of freedom.

    Attributes
    ----------
    sd : float
    dof : float
        inf for a declared run effect.
    restricted_sd : float
        Maximum of the restricted likelihood; 0 if the readings explain all differences of runs.
    """

    sd: float
    dof: float
    restricted_sd: float


def estimate_run_effect(weight, misclosure_m3, run_m3):
    """Return the `RunEffect` of two or more runs; None if they do not determine it.

    The likelihood of few runs is flat, and its maximum is often 0, which is no proof that runs do
    not differ. sd and dof are therefore those of the variance averaged over the restricted
    likelihood. With tau = theta + s, s the (harmonic) mean noise of a run, they follow from the
    mean and the variance of 1/tau, for 1/tau distributed as chi-square over its dof:

        1/tau = E[1/tau],   dof = 2 E[1/tau]^2 / Var[1/tau],   sd^2 = tau - s,

    under the scale prior 1/tau; the dof of theta alone is multiplied by ((tau - s) / tau)^2. For
    runs that differ much more than their noise, the result is the usual mean square with its dof.

    Parameters
    ----------
    weight : StepWeights
        M without a run effect.
    misclosure_m3 : ndarray, shape (n,)
    run_m3 : ndarray, shape (n, runs)
        Misclosures for a run effect of one in each run.
    """
    differences, noise = run_differences(weight, misclosure_m3, run_m3)
    if run_m3.shape[1] < 2 or len(noise) < 2:
        return None
    return averaged(differences, noise)


def run_differences(weight, misclosure_m3, run_m3):
    """Return independent variables of mean 0 and variances theta + s, and s.

    A common change of all runs acts like the factor of the meter. This direction has a large s, due
    to the uncertainty of the meter certificate and of the geometry, and hence little weight.

    Parameters
    ----------
    weight, misclosure_m3, run_m3
        As for `estimate_run_effect`.

    Returns
    -------
    d, s : ndarray
    """
    information = run_m3.T @ weight @ run_m3
    size, turn = np.linalg.eigh(information)
    determined = size > UNDETERMINED * size[-1]
    d = turn.T @ (run_m3.T @ (weight @ misclosure_m3))
    return d[determined] / size[determined], 1 / size[determined]


def averaged(d, s):
    """Return the `RunEffect` of independent variables d of variances theta + s."""
    mean_noise, largest = 1 / np.mean(1 / s), max(np.max(d**2), np.max(s))
    theta = np.concatenate([[0.0], np.geomspace(1e-3 * mean_noise, 1e4 * largest, GRID)])
    variance = theta[:, None] + s
    restricted = -0.5 * np.sum(np.log(variance) + d**2 / variance, axis=1)
    tau = theta + mean_noise
    # Subtract the maximum before the exponential, which would underflow otherwise.
    density = np.exp(restricted - restricted.max()) / tau
    mass = np.sum(np.diff(theta) * (density[1:] + density[:-1]) / 2)

    def mean(values):
        integrand = density * values
        return np.sum(np.diff(theta) * (integrand[1:] + integrand[:-1]) / 2) / mass

    precision = mean(1 / tau)
    # A lower bound of the variance limits the dof to a finite number.
    spread = max(mean(1 / tau**2) - precision**2, 1e-12 * precision**2)
    mean_tau = 1 / precision
    theta_mean = max(mean_tau - mean_noise, 0.0)
    dof = 2 * precision**2 / spread * (theta_mean / mean_tau) ** 2
    return RunEffect(
        float(np.sqrt(theta_mean)), float(dof), float(np.sqrt(theta[restricted.argmax()]))
    )
