"""Minimum of a smooth function of about a dozen logarithms, with few evaluations.

The steps use an approximate inverse curvature, improved after each step (Broyden 1970, Fletcher
1970, Goldfarb 1970, Shanno 1970) and stored as a full matrix. Its start value is proportional to
the reach of each logarithm, not to the square of the reach. Otherwise a component with a vague
prior would take the whole first step, even if another component explains the wall equally well.

Source: Nocedal & Wright 2006, chapter 6.
"""

import numpy as np

MOST_STEPS, LONGEST = 200, 2.0  # number of steps; longest change of a logarithm in a step
SHORTEN, SHORTEST = 0.4, 1e-3  # factor on a step that increases the value; shortest fraction
ENOUGH = 1e-4  # least share of the descent predicted by the slope (Armijo condition)
BEGIN = 0.15  # start value of the inverse curvature, relative to the reach


def descend(function, start, reach, bounds, tolerance):
    """Return a place near the minimum of a function, and the slope there.

    Parameters
    ----------
    function : callable
        function(x) -> object with `value` and `slope` (n,). The slope is evaluated only at the end
        of a step.
    start, reach : ndarray, shape (n,)
        Start values, and approximate distances of the minimum from them.
    bounds : ndarray, shape (n, 2)
    tolerance : float
        Relative change of the value that ends the search.

    Returns
    -------
    place, slope : ndarray, shape (n,)

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> def bowl(x):
    ...     value, slope = np.sum((x - 1) ** 2 * [1, 9]), 2 * (x - 1) * [1, 9]
    ...     return SimpleNamespace(value=value, slope=slope)
    >>> descend(bowl, np.zeros(2), np.ones(2), np.array([[-5, 5], [-5, 0.5]]), 1e-12)[0].round(6)
    array([1. , 0.5])
    """
    low, high = np.transpose(bounds)
    x, inverse = np.clip(start, low, high), np.diag(BEGIN * np.asarray(reach))
    start_state = function(x)
    value, slope = start_state.value, start_state.slope
    for _ in range(MOST_STEPS):
        # Coordinates at a bound stay there as long as the descent points outwards.
        free = ~((x <= low) & (slope > 0) | (x >= high) & (slope < 0))
        step = free * (inverse @ (free * -slope))
        step *= LONGEST / max(np.abs(step).max(initial=0.0), LONGEST)
        fraction = 1.0
        # Backtracking line search along the projected step.
        while True:
            place = np.clip(x + fraction * step, low, high)
            change = place - x
            candidate = function(place)
            new_value = candidate.value
            if new_value <= value + ENOUGH * slope @ change or fraction < SHORTEST:
                break
            fraction *= SHORTEN
        if not new_value < value:
            break
        inverse = improved(inverse, change, candidate.slope - slope)
        gain, x, value, slope = value - new_value, place, new_value, candidate.slope
        if gain < tolerance * max(abs(value), 1.0):
            break
    return x, slope


def improved(inverse, step, slope_change):
    """Return the inverse curvature after a step (BFGS update).

    Parameters
    ----------
    inverse : ndarray, shape (n, n)
        Inverse curvature before the step.
    step : ndarray, shape (n,)
    slope_change : ndarray, shape (n,)
        Change of the slope over the step.

    Returns
    -------
    ndarray, shape (n, n)
    """
    curvature = step @ slope_change
    # No update for negative curvature: the matrix remains positive definite.
    if curvature <= 0.0:
        return inverse
    projector = np.eye(len(step)) - np.outer(step, slope_change) / curvature
    return projector @ inverse @ projector.T + np.outer(step, step) / curvature
