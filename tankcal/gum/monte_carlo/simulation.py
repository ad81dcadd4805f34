"""Monte Carlo simulation of a model with many rows, adaptive to a numerical tolerance.

Sources: JCGM 101:2008 7.2 to 7.9; JCGM 102:2011 7 for several rows from the same draws.
"""

import numpy as np

from tankcal.gum.monte_carlo.batches import (
    FEWEST,
    Batches,
    Control,
    batch_size,
    estimates_of,
    nodes_of,
)
from tankcal.gum.monte_carlo.goal import Goal, may_stop, simulation
from tankcal.gum.monte_carlo.inputs import inputs_of
from tankcal.gum.monte_carlo.linear import linear_law, shapes_of
from tankcal.gum.monte_carlo.quadratic import QuadraticRows
from tankcal.gum.monte_carlo.quadratic_rows import table_estimates
from tankcal.gum.monte_carlo.sobol import sobol_points

DIFFERENCE = 1e-3  # step of the numerical derivatives, in scales of the input


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
