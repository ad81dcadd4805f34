"""The shared check of analytic derivatives against differences."""

import numpy as np


def assert_derivative(function, x, analytic, *, step=1e-6, tolerance=1e-7):
    """Compare `analytic` (m, n) with central differences of `function` (n,) -> (m,) at x.

    step       of each variable, in its own unit
    tolerance  of the difference, relative to the largest derivative
    """
    x = np.asarray(x, dtype=float)
    analytic = analytic.toarray() if hasattr(analytic, "toarray") else np.asarray(analytic)
    differences = np.empty_like(analytic, dtype=float)
    for i in range(len(x)):
        move = np.zeros_like(x)
        move[i] = step
        differences[:, i] = (function(x + move) - function(x - move)) / (2 * step)
    largest = np.abs(analytic).max()
    worst = np.abs(differences - analytic).max() / largest
    assert worst < tolerance, f"derivative off by {worst:.3g} of its largest element"
