"""Monte Carlo simulation of models with many rows: JCGM 101:2008 and JCGM 102:2011.

`simulate` draws, and `verdict` validates the GUM intervals. Capacity tables are `QuadraticRows`.

The linear part L of the model is the control variate of each batch of draws. L has known quantiles
L_p. The error of the draws for L corrects the quantiles of the output: V_p is the sample quantile
at p + beta (F_L,sample(L_p) - p). Likewise u^2 = s_V^2 - b (s_L^2 - u_L^2). Regression within the
batch gives beta and b. They vanish if the linear part is unknown or uncorrelated, which leaves
plain draws.

Sources: JCGM 101:2008 7.2 to 7.9; JCGM 102:2011 7 for several rows from the same draws;
control variates: Owen 2013 8.9.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtr, ndtri

from tankcal.gum.monte_carlo.goal import NAMES as ESTIMATES
from tankcal.gum.monte_carlo.goal import (
    Goal,
    Simulation,
    Verdict,
    may_stop,
    numerical_tolerance,
    simulation,
    verdict,
)
from tankcal.gum.monte_carlo.inputs import inputs_of, sobol_points
from tankcal.gum.monte_carlo.quadratic import QuadraticRows, linear_law, shapes_of, table_estimates

__all__ = [
    "ESTIMATES",
    "Goal",
    "QuadraticRows",
    "Simulation",
    "Verdict",
    "numerical_tolerance",
    "simulate",
    "simulate_quadratic",
    "verdict",
]


DIFFERENCE = 1e-3  # step of the numerical derivatives, in scales of the input
LEVELS = 501  # lower ends tried for the shortest interval
WINDOW = 51  # levels over which the length is averaged, against chance gaps between draws
NODES = 33  # levels at which the distribution of the linear part is tabulated
FEWEST = 10  # least number of batches for a standard error
LEAST, MOST = 10, 16  # limits of log2 of the draws in a batch


def simulate(model, inputs, correlation=None, *, goal=None, sensitivities=None, progress=None):
    """Mean, u and coverage intervals of every row of a model by Monte Carlo.

    Parameters
    ----------
    model : callable or QuadraticRows
        model(x) -> (draws, rows), for x (draws, n). For QuadraticRows, the matrix draws x rows is
        only computed in blocks.
    inputs : sequence, length n
        Distributions with mean, sd and quantile(p). If each has characteristic(t), the function E
        cos(t (X - mean)) of a symmetric input, the linear part of the model is a control variate.
    correlation : array_like, shape (n, n), optional
        Correlation of the inputs; of their normal scores for inputs that are not normal.
    goal : Goal, optional
        Coverage probability, tolerance, seed and memory.
    sensitivities : array_like, shape (rows, n), optional
        Derivatives at the means; by default from differences.
    progress : callable, optional
        progress(text, done, total), called after every batch.

    Returns
    -------
    Simulation

    Raises
    ------
    ValueError
        For an invalid correlation, or arrays of the wrong shape.

    Examples
    --------
    >>> from tankcal.gum.distributions import Normal
    >>> from tankcal.gum.monte_carlo import Goal
    >>> goal = Goal(plain_draws=10_000)
    >>> model = lambda x: x @ np.array([[3.0], [4.0]])
    >>> result = simulate(model, [Normal(1.0), Normal(1.0)], goal=goal)
    >>> result.u.round(2).tolist(), result.high.round(1).tolist()
    ([5.0], [9.8])
    """
    goal = goal or Goal()
    if isinstance(model, QuadraticRows):
        return simulate_quadratic(model, inputs, correlation, goal=goal, progress=progress)[0]
    progress = progress or (lambda text, done, total: None)
    ready = inputs_of(inputs, correlation)
    control = None
    # Without independent coordinates, the distribution of the linear part is unknown.
    if ready.transform is not None:
        slopes = differences(model, ready) if sensitivities is None else sensitivities
        control = control_of(np.asarray(slopes, dtype=float), ready, goal)
    return simulation(goal, *simulate_in_batches(model, ready, control, goal, progress))


def simulate_quadratic(rows, inputs, correlation=None, *, goal, progress=None, choose=None):
    """Simulation of quadratic rows.

    Parameters
    ----------
    rows : QuadraticRows
        The model.
    inputs, correlation, goal, progress
        As in `simulate`.
    choose : callable, optional
        choose(places) -> selected places. The argument contains the rows that need plain draws,
        about a second for each row, because few points do not determine their intervals. Rows that
        are not selected are omitted. By default, all rows are selected.

    Returns
    -------
    simulation : Simulation
        Result for the rows with an estimate.
    places : ndarray of int
        Indices of these rows.

    Raises
    ------
    ValueError
        As in `simulate`.
    """
    progress = progress or (lambda text, done, total: None)
    ready = inputs_of(inputs, correlation)
    if rows.jacobian.shape[1] != len(ready.mean):
        raise ValueError(f"{len(ready.mean)} inputs, {rows.jacobian.shape[1]} columns of the model")
    # Without a control variate, all rows need plain draws.
    if ready.transform is None or not _symmetric(ready):
        result = simulate_in_batches(rows, ready, None, goal, progress)
        return simulation(goal, *result), np.arange(len(rows.value))
    estimates, errors, draws, controlled, sound = table_estimates(rows, ready, goal, progress)
    # Rows for which point sets give no valid interval.
    hard = np.flatnonzero(~sound)
    if choose is not None:
        hard = choose(hard)
    if len(hard):
        part = rows.subset(hard)
        control = control_of(part.jacobian, ready, goal)
        result = simulate_in_batches(part, ready, control, goal, progress)
        estimates[:, hard], errors[:, hard], draws[hard], controlled[hard] = result
    selected = np.union1d(np.flatnonzero(sound), hard)
    result = (estimates[:, selected], errors[:, selected], draws[selected], controlled[selected])
    return simulation(goal, *result), selected


def differences(model, ready):
    """Derivatives (rows, n) of a model at the means of its inputs, by central differences."""
    step = DIFFERENCE * ready.scale
    ends = np.concatenate([ready.mean + np.diag(step), ready.mean - np.diag(step)])
    upper, lower = np.split(np.asarray(model(ends), dtype=float), 2)
    # A constant input has the step 0 and the derivative 0.
    divisor = np.where(step > 0, 2 * step, 1.0)
    return ((upper - lower) / divisor[:, None]).T


def control_of(sensitivities, ready, goal):
    """Control variate from sensitivities (rows, n).

    Returns
    -------
    Control or None
        None if an input has no characteristic function.
    """
    if not _symmetric(ready):
        return None
    # L = J T e in the independent coordinates.
    coefficients = sensitivities @ ready.transform
    by_scale = coefficients * ready.coordinate_scale
    law = linear_law(by_scale, ready.normal, shapes_of(ready), nodes_of(goal.probability))
    with np.errstate(invalid="ignore"):
        # A zero coefficient removes an input with infinite standard deviation.
        parts = np.where(coefficients == 0, 0.0, coefficients * ready.coordinate_sd)
    return Control(coefficients, law.quantile, np.sqrt(np.sum(parts**2, axis=1)), law.known)


def _symmetric(ready):
    """Whether every input is normal or has a characteristic function."""
    pairs = zip(ready.distributions, ready.normal, strict=True)
    return all(normal or hasattr(distribution, "characteristic") for distribution, normal in pairs)


def simulate_in_batches(model, ready, control, goal, progress):
    """Simulate a model in batches of draws until the goal is reached.

    Parameters
    ----------
    model : callable
        model(x) -> (draws, rows).
    ready : Inputs
        Prepared inputs.
    control : Control or None
        Linear parts as control variate.
    goal : Goal
        The goal.
    progress : callable
        progress(text, done, total).

    Returns
    -------
    estimates, errors : ndarray, shape (6, rows)
        In the order of goal.NAMES.
    draws : ndarray, shape (rows,)
        Number of draws.
    controlled : ndarray of bool, shape (rows,)
        True if the linear part served as control variate.

    Raises
    ------
    ValueError
        If the model returns an array of the wrong shape.
    """
    shape = np.shape(model(ready.mean[None, :]))
    if len(shape) != 2 or shape[0] != 1:
        raise ValueError(f"the model gives {shape} for one draw: expected (1, rows)")
    rows = shape[1]
    size = batch_size(rows, len(ready.mean), goal)
    total = max(FEWEST, -(-goal.plain_draws // size))
    batches = Batches(rows)
    # Independently scrambled points in each batch give independent estimates.
    for number, seed in enumerate(np.random.SeedSequence(goal.seed).spawn(total)):
        x, coordinates = ready.draws(sobol_points(size, len(ready.mean), seed))
        values = np.asarray(model(x), dtype=float)
        batches.add(*estimates_of(values, coordinates, control, goal.probability))
        progress("Monte Carlo", number + 1, total)
        # A standard error needs FEWEST batches.
        has_enough = batches.count >= FEWEST
        if has_enough and np.all(may_stop(goal, batches.mean, batches.errors, batches.plain)):
            break
    used = np.zeros(rows, dtype=bool) if control is None else control.known.copy()
    return batches.estimates, batches.errors, np.full(rows, batches.count * size), used


class Batches:
    """Mean and standard error of estimates over independent batches.

    Parameters
    ----------
    rows : int
        Number of rows of the model.

    Attributes
    ----------
    count : int
        Number of batches.
    plain, mean, squares : ndarray
        Errors of a plain draw (3, rows), means (6, rows), and sums of squares about the means.
    """

    def __init__(self, rows):
        self.count = 0
        self.plain = np.zeros((3, rows))
        self.mean = np.zeros((6, rows))
        self.squares = np.zeros((6, rows))

    def add(self, estimates, plain):
        """Add the estimates (6, rows) of a batch, and the errors (3, rows) of a plain draw."""
        self.count += 1
        self.plain += (plain - self.plain) / self.count
        # u is infinite for Student's t with two degrees of freedom.
        finite = np.isfinite(estimates)
        # Welford's update of the mean and of the sum of squares.
        change = np.where(finite, estimates, 0.0) - np.where(finite, self.mean, 0.0)
        self.mean = np.where(finite, self.mean + change / self.count, estimates)
        self.squares += change**2 * (1 - 1 / self.count)

    @property
    def estimates(self):
        """Means (6, rows) over the batches; u refers to the common mean of all batches.

        u^2 is the mean of the squares about the means of the batches plus the variance of these
        means.
        """
        estimates = self.mean.copy()
        estimates[1] = np.sqrt(estimates[1] ** 2 + self.squares[0] / max(self.count - 1, 1))
        return estimates

    @property
    def errors(self):
        """Standard errors (6, rows) of the means."""
        return np.sqrt(self.squares / (self.count * max(self.count - 1, 1)))


def batch_size(rows, inputs, goal):
    """Number of draws in a batch, within the memory of the goal.

    Parameters
    ----------
    rows, inputs : int
        Numbers of rows and of inputs.
    goal : Goal
        Memory and number of draws.

    Returns
    -------
    int
        Power of two, at least 1024.
    """
    # Four arrays of rows and six of inputs, 8 bytes each; at least FEWEST batches.
    fitting = min(goal.memory / (8 * (4 * rows + 6 * inputs)), goal.plain_draws / FEWEST)
    return 1 << int(np.clip(np.floor(np.log2(max(fitting, 1))), LEAST, MOST))


@dataclass(frozen=True)
class Control:
    """Known properties of the linear parts, which are symmetric about 0.

    Attributes
    ----------
    coefficients : ndarray, shape (rows, n)
        Coefficients of the coordinates of the inputs.
    quantile : ndarray, shape (rows, NODES)
        Quantiles at nodes_of(probability).
    u : ndarray, shape (rows,)
        Standard deviation.
    known : ndarray of bool, shape (rows,)
        False without a linear part, or if its distribution was not found.
    """

    coefficients: np.ndarray
    quantile: np.ndarray
    u: np.ndarray
    known: np.ndarray


def nodes_of(probability):
    """Levels (NODES,) at which the distribution of the linear part is tabulated.

    The levels are equidistant in the normal score.
    """
    widest = 1 - probability
    return ndtr(np.linspace(ndtri(widest / 100), ndtri(widest), NODES))


def estimates_of(values, coordinates, control, probability):
    """Estimates from one batch.

    Parameters
    ----------
    values : ndarray, shape (draws, rows)
        Outputs of the model.
    coordinates : ndarray, shape (draws, n), or None
        Independent coordinates behind the inputs.
    control : Control or None
        Linear parts; None for plain draws.
    probability : float
        Coverage probability.

    Returns
    -------
    estimates : ndarray, shape (6, rows)
        In the order of goal.NAMES.
    plain : ndarray, shape (3, rows)
        Standard errors of a single plain draw.
    """
    estimates, plain = np.empty((6, values.shape[1])), np.empty((3, values.shape[1]))
    # Each row of the model is read many times: its draws lie together in memory.
    for row, column in enumerate(np.ascontiguousarray(values.T)):
        control_sample = None
        if control is not None and control.known[row]:
            linear = coordinates @ control.coefficients[row]
            control_sample = (linear, control.quantile[row], control.u[row])
        estimates[:, row], plain[:, row] = _row_estimates(column, control_sample, probability)
    return estimates, plain


def _row_estimates(values, control_sample, probability):
    """Estimates of one row, and the standard errors of a plain draw."""
    mean, deviation = np.mean(values), np.std(values)
    lower = np.linspace(0, 1 - probability, LEVELS)
    levels = np.stack([lower, lower + probability])
    ordered = np.sort(values)
    if control_sample is not None:
        linear, _, u = control_sample
        mean, deviation = _moments(values, linear, u, mean, deviation)
        levels = _correct_levels(values, ordered, control_sample, levels, probability)
    count = len(ordered)
    # Plotting positions (i - 1/3)/(n + 1/3) of the ordered draws.
    probabilities = (np.arange(1, count + 1) - 1 / 3) / (count + 1 / 3)
    ends = np.interp(levels, probabilities, ordered)
    # The middle level is the probabilistically symmetric interval.
    middle = ends[:, (LEVELS - 1) // 2]
    length = scipy.ndimage.uniform_filter1d(ends[1] - ends[0], WINDOW, mode="nearest")
    shortest = ends[:, np.argmin(length)]
    return (mean, deviation, *middle, *shortest), _plain_errors(
        values, probabilities, ordered, probability
    )


def _plain_errors(values, probabilities, ordered, probability):
    """Standard errors of u and of both ends for a single plain draw.

    For u: sqrt((m4/m2^2 - 1)/4) u. For the ends: sqrt(p (1 - p)) dV_p/dp, with the slope over +-
    p/5.
    """
    squares = (values - np.mean(values)) ** 2
    spread = np.mean(squares)
    tail = (1 - probability) / 2
    reach = tail / 5
    levels = np.array([tail - reach, tail + reach, 1 - tail - reach, 1 - tail + reach])
    ends = np.interp(levels, probabilities, ordered)
    slopes = (ends[1::2] - ends[::2]) / (2 * reach)
    error_of_u = np.std(squares) / (2 * np.sqrt(spread)) if spread > 0 else 0.0
    return error_of_u, *(np.sqrt(tail * (1 - tail)) * slopes)


def _moments(values, linear, u, mean, deviation):
    """Mean and standard deviation, corrected by the error of the draws for the linear part."""
    centred, linear_centred = values - mean, linear - np.mean(linear)
    spread = np.mean(linear_centred**2)
    if not spread > 0:
        return mean, deviation
    # The linear part has the mean 0; its sample mean is an error of the draws.
    mean = mean - np.mean(centred * linear_centred) / spread * np.mean(linear)
    if not np.isfinite(u):
        return mean, np.inf
    first, second = centred**2, linear_centred**2
    second_centred = second - spread
    # b: regression of the squares of the output on the squares of the linear part.
    factor = np.mean(first * second_centred) / np.mean(second_centred**2)
    variance = deviation**2 - factor * (np.var(linear) - u**2)
    # The correction can exceed a very small variance.
    return mean, np.sqrt(max(variance, 0.0))


def _correct_levels(values, ordered, control_sample, levels, probability):
    """Levels, shifted by the error of the draws at the quantiles of the linear part."""
    linear, quantiles, _ = control_sample
    nodes = nodes_of(probability)
    ordered_linear = np.sort(linear)
    ends = np.quantile(ordered, levels[:, (LEVELS - 1) // 2])
    corrected = np.empty_like(levels)
    # The upper quantiles follow by symmetry.
    for side, sign in ((0, 1), (1, -1)):
        tails = levels[side] if side == 0 else 1 - levels[side]
        # Levels beyond the table are not corrected.
        inside = tails >= nodes[0] * (1 - 1e-9)
        quantile_values = sign * np.interp(ndtri(tails[inside]), ndtri(nodes), quantiles)
        observed = (np.searchsorted(ordered_linear, quantile_values, side="right") + 1 / 6) / (
            len(linear) + 1 / 3
        )
        middle = np.argmin(np.abs(tails[inside] - (1 - probability) / 2))
        is_below = values <= ends[side]
        linear_below = linear <= quantile_values[middle]
        spread = observed[middle] * (1 - observed[middle])
        joint = np.mean(is_below & linear_below) - np.mean(is_below) * observed[middle]
        # beta: regression of the indicator V <= V_p on the indicator L <= L_p.
        factor = joint / spread if spread > 0 else 0.0
        corrected[side] = levels[side]
        corrected[side][inside] += factor * (observed - levels[side][inside])
    return np.clip(corrected, 0, 1)
