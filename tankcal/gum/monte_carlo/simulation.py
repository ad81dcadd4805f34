"""Monte Carlo of a model of many rows, adaptive to a stated numerical tolerance.

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

DIFFERENCE = 1e-3  # step of the derivatives, in scales of the input


def simulate(model, inputs, correlation=None, *, goal=None, sensitivities=None, progress=None):
    """Mean, u and 95 % intervals of every row of a model, by Monte Carlo.

    Parameters
    ----------
    model
        model(x) -> (draws, rows) for x (draws, n), or QuadraticRows: then no matrix of draws by
        rows is formed but in blocks.
    inputs : ndarray, shape (n,)
        Distributions: mean, sd, quantile(p); with characteristic(t), E cos(t (X - mean)) of a
        symmetric input, the linear part of the model serves as control.
    correlation : ndarray, shape (n, n), optional
        Of the inputs, of their normal scores where they are not normal.
    goal : optional
        Goal: probability, tolerance, seed, memory.
    sensitivities : ndarray, shape (rows, n), optional
        Derivatives at the means; by default by differences.
    progress : optional
        progress(text, done, total) is called after every batch.

    Returns
    -------
    Simulation

    Raises
    ------
    ValueError
        For what cannot be a correlation or has other shapes.
    """
    goal = goal or Goal()
    if isinstance(model, QuadraticRows):
        return simulate_quadratic(model, inputs, correlation, goal=goal, progress=progress)[0]
    progress = progress or (lambda text, done, total: None)
    ready = inputs_of(inputs, correlation)
    control = None
    if ready.transform is not None:
        slopes = differences(model, ready) if sensitivities is None else sensitivities
        control = control_of(np.asarray(slopes, dtype=float), ready, goal)
    return simulation(goal, *simulate_in_batches(model, ready, control, goal, progress))


def simulate_quadratic(rows, inputs, correlation=None, *, goal, progress=None, choose=None):
    """The `Simulation` of quadratic rows, and the places of its rows among them.

    choose  choose(places) -> some of these places: the rows there need plain draws, a second each,
            because few points do not determine their intervals. By default all are drawn for;
            rows that are not chosen are left out
    Raises ValueError as `simulate`.
    """
    progress = progress or (lambda text, done, total: None)
    ready = inputs_of(inputs, correlation)
    if rows.jacobian.shape[1] != len(ready.mean):
        raise ValueError(f"{len(ready.mean)} inputs, {rows.jacobian.shape[1]} columns of the model")
    if ready.transform is None or not _symmetric(ready):
        found = simulate_in_batches(rows, ready, None, goal, progress)
        return simulation(goal, *found), np.arange(len(rows.value))
    estimates, errors, draws, controlled, sound = table_estimates(rows, ready, goal, progress)
    hard = np.flatnonzero(~sound)
    if choose is not None:
        hard = choose(hard)
    if len(hard):
        part = rows.subset(hard)
        control = control_of(part.jacobian, ready, goal)
        found = simulate_in_batches(part, ready, control, goal, progress)
        estimates[:, hard], errors[:, hard], draws[hard], controlled[hard] = found
    kept = np.union1d(np.flatnonzero(sound), hard)
    found = (estimates[:, kept], errors[:, kept], draws[kept], controlled[kept])
    return simulation(goal, *found), kept


def differences(model, ready):
    """(rows, n) derivatives of a model at the means of its inputs, by central differences."""
    step = DIFFERENCE * ready.scale
    ends = np.concatenate([ready.mean + np.diag(step), ready.mean - np.diag(step)])
    upper, lower = np.split(np.asarray(model(ends), dtype=float), 2)
    divisor = np.where(step > 0, 2 * step, 1.0)
    return ((upper - lower) / divisor[:, None]).T


def control_of(sensitivities, ready, goal):
    """The linear parts of rows (rows, n), or None when an input has no characteristic function."""
    if not _symmetric(ready):
        return None
    coefficients = sensitivities @ ready.transform
    by_scale = coefficients * ready.coordinate_scale
    law = linear_law(by_scale, ready.normal, shapes_of(ready), nodes_of(goal.probability))
    with np.errstate(invalid="ignore"):
        parts = np.where(coefficients == 0, 0.0, coefficients * ready.coordinate_sd)
    return Control(coefficients, law.quantile, np.sqrt(np.sum(parts**2, axis=1)), law.known)


def _symmetric(ready):
    pairs = zip(ready.distributions, ready.normal, strict=True)
    return all(normal or hasattr(one, "characteristic") for one, normal in pairs)


def simulate_in_batches(model, ready, control, goal, progress):
    """Estimates, errors (6, rows), draws and use of the control (rows,), by batches of draws."""
    shape = np.shape(model(ready.mean[None, :]))
    if len(shape) != 2 or shape[0] != 1:
        raise ValueError(f"the model gives {shape} for one draw: expected (1, rows)")
    rows = shape[1]
    size = batch_size(rows, len(ready.mean), goal)
    total = max(FEWEST, -(-goal.plain_draws // size))
    batches = Batches(rows)
    for number, seed in enumerate(np.random.SeedSequence(goal.seed).spawn(total)):
        x, coordinates = ready.draws(sobol_points(size, len(ready.mean), seed))
        values = np.asarray(model(x), dtype=float)
        batches.add(*estimates_of(values, coordinates, control, goal.probability))
        progress("Monte Carlo", number + 1, total)
        done = batches.count >= FEWEST
        if done and np.all(may_stop(goal, batches.mean, batches.errors, batches.plain)):
            break
    used = np.zeros(rows, dtype=bool) if control is None else control.known.copy()
    return batches.estimates, batches.errors, np.full(rows, batches.count * size), used
