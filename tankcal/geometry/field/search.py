"""The lowest point of a smooth function of a dozen logarithms, by few evaluations of it.

Steps with an inverse curvature that each step improves (Broyden 1970, Fletcher 1970, Goldfarb 1970,
Shanno 1970), kept whole, and begun from how far each logarithm may go: not from the square of it,
or a size of which little is known beforehand takes the first step for all, also where another one
explains the wall as well.

Source: Nocedal & Wright 2006, chapter 6.
"""

import numpy as np

MOST_STEPS, LONGEST = 200, 2.0  # of a search; of a logarithm in one step
SHORTEN, SHORTEST = 0.4, 1e-3  # a step that leads up, and how short it may become
ENOUGH = 1e-4  # of the descent that the slope promises
BEGIN = 0.15  # of the reach: inverse curvature before anything is known


def descend(function, start, reach, bounds, tolerance):
    """Place near the lowest value of a function, and the slope there.

    Parameters
    ----------
    function : callable
        function(x) -> what has a `value`, and a `slope` (n,): it is asked where a step ends.
    start, reach : ndarray, shape (n,)
        Where the search begins, and how far about it the lowest place may be.
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
    here = function(x)
    value, slope = here.value, here.slope
    for _ in range(MOST_STEPS):
        free = ~((x <= low) & (slope > 0) | (x >= high) & (slope < 0))
        step = free * (inverse @ (free * -slope))
        step *= LONGEST / max(np.abs(step).max(initial=0.0), LONGEST)
        part = 1.0
        while True:
            there = np.clip(x + part * step, low, high)
            moved = there - x
            further = function(there)
            lower = further.value
            if lower <= value + ENOUGH * slope @ moved or part < SHORTEST:
                break
            part *= SHORTEN
        if not lower < value:
            break
        inverse = improved(inverse, moved, further.slope - slope)
        gained, x, value, slope = value - lower, there, lower, further.slope
        if gained < tolerance * max(abs(value), 1.0):
            break
    return x, slope


def improved(inverse, moved, turned):
    """The inverse curvature after a step along which the slope turned by so much."""
    bend = moved @ turned
    if bend <= 0.0:
        return inverse
    left = np.eye(len(moved)) - np.outer(moved, turned) / bend
    return left @ inverse @ left.T + np.outer(moved, moved) / bend
