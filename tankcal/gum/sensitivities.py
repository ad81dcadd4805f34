"""Sensitivity coefficients dy/dx of a model by numerical differentiation, and their check.

The complex step Im f(x + i h)/h has no cancellation, but requires an analytic model. Its result is
used only if it agrees with central differences. The differences use the steps u(x)/4 and u(x)/8,
extrapolated to a step of zero (Richardson). If both steps disagree, an eighth and a 64th of these
steps are tried. Without agreement of the complex step, the differences are the result.

A kink or a jump at the estimate is rejected. A kink beside the estimate, or a strong curvature
within u, is accepted; Monte Carlo shows whether the law of propagation is valid.

Source: JCGM 100:2008 5.1.3; Squire & Trapp 1998, SIAM Review 40, 110.
"""

import warnings
from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError

_COMPLEX_STEP = 1e-30  # without cancellation, the step can be arbitrarily small
_AGREEMENT = 1e-3  # relative to u of the output, and to a sensitivity: the digits of a budget
_ROUNDING = 64 * np.finfo(float).eps  # relative rounding error of an output
_SHARES = (1.0, 1 / 8, 1 / 64)  # of the first step, tried in this order


@dataclass(frozen=True)
class _Differences:
    """Extrapolated differences (rows, n).

    Attributes
    ----------
    slopes : ndarray
        Derivatives.
    doubt : ndarray
        Largest error of each derivative.
    sound : ndarray of bool
        True for a derivative with agreeing steps and without a kink.
    reach : ndarray
        Change of the output within u according to the first steps, whatever its slope.
    """

    slopes: np.ndarray
    doubt: np.ndarray
    sound: np.ndarray
    reach: np.ndarray


def sensitivities_of(model, x, u, names=None):
    """Derivatives of a model at the estimates of its inputs.

    Parameters
    ----------
    model : callable
        model(x) -> a number or outputs (rows,), for estimates x (n,); preferably also for complex
        x.
    x, u : array_like, shape (n,)
        Estimates and standard uncertainties, in the units of the inputs.
    names : sequence of str, length n, optional
        Names of the inputs, for error messages.

    Returns
    -------
    ndarray, shape (rows, n)

    Raises
    ------
    SolutionError
        If an output is not finite, or if the model has a kink or a jump at an estimate; the message
        names the input.

    Examples
    --------
    >>> sensitivities_of(lambda x: x[0] ** 2 * x[1], [3.0, 2.0], [0.1, 0.1]).round(9).tolist()
    [[12.0, 9.0]]
    """
    x, u = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    estimates = _differences(model, x, u)
    _refuse(~estimates.sound, estimates.doubt, names, "not smooth at the estimate of")
    analytic = _complex_step(model, x, estimates.slopes.shape)
    if analytic is None:
        return estimates.slopes
    deviation = np.abs(analytic - estimates.slopes)
    # The complex step is used element by element, where it agrees with the differences.
    return np.where(
        deviation <= estimates.doubt + _AGREEMENT * np.abs(estimates.slopes),
        analytic,
        estimates.slopes,
    )


def check_sensitivities(model, x, u, sensitivities, names=None):
    """Check given sensitivities against central differences.

    Parameters
    ----------
    model : callable
        The model.
    x, u : array_like, shape (n,)
        Estimates and standard uncertainties.
    sensitivities : ndarray, shape (rows, n)
        Sensitivities to check.
    names : sequence of str, length n, optional
        Names of the inputs, for error messages.

    Raises
    ------
    SolutionError
        If a contribution to u differs by more than a thousandth of u of the output; the message
        names the input.
    ValueError
        For an array of the wrong shape.
    """
    x, u = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    estimates = _differences(model, x, u)
    if sensitivities.shape != estimates.slopes.shape:
        raise ValueError(f"sensitivities {sensitivities.shape}, expected {estimates.slopes.shape}")
    deviation = np.abs(sensitivities - estimates.slopes)
    # The deviation counts only beyond the error of the differences.
    wrong = (deviation - estimates.doubt) * u > _AGREEMENT * _combined_uncertainty(
        estimates.slopes, u
    )
    _refuse(wrong, deviation, names, "contradicted by differences over")


def outputs_of(model, x):
    """Outputs (rows,) of a model at x.

    Raises
    ------
    SolutionError
        If an output is not finite.
    ValueError
        If the model returns an array of another shape.
    """
    values = np.atleast_1d(np.asarray(model(x), dtype=float))
    if values.ndim != 1:
        raise ValueError(f"the model gives {values.shape}: expected a number or (rows,)")
    if not np.all(np.isfinite(values)):
        raise SolutionError(f"output {int(np.argmin(np.isfinite(values))) + 1} is not finite")
    return values


def _differences(model, x, u):
    """Differences with decreasing steps; the first valid result of each sensitivity is kept."""
    middle = outputs_of(model, x)
    chosen = None
    for share in _SHARES:
        # All steps are judged by the reach of the first, largest step.
        reach = None if chosen is None else chosen.reach
        current = _differences_over(model, x, u, middle, _choose_steps(x, u) * share, reach)
        if chosen is None:
            chosen = current
        better = current.sound & ~chosen.sound
        chosen = _Differences(
            np.where(better, current.slopes, chosen.slopes),
            np.where(better, current.doubt, chosen.doubt),
            chosen.sound | current.sound,
            reach=chosen.reach,
        )
        if np.all(chosen.sound):
            break
    return chosen


def _differences_over(model, x, u, middle, steps, reach=None):
    """Differences over given steps (n,), extrapolated, with their validity."""
    coarse, bend = _central_differences(model, x, middle, steps)
    if reach is None:
        reach = (np.abs(coarse) + np.abs(bend) / 2) * u
    fine, finer_bend = _central_differences(model, x, middle, steps / 2)
    # Richardson: the error is quadratic in the step.
    slopes = fine + (fine - coarse) / 3
    rounding = _ROUNDING * np.abs(middle)[:, None] / steps
    allowed = _AGREEMENT * np.maximum(_combined_uncertainty(slopes, u), reach)
    curved = np.abs(fine - coarse)
    # Halving the step halves the difference of both slopes for a curve, but not for a kink.
    kink = (np.abs(finer_bend) > 0.75 * np.abs(bend)) & (
        (np.abs(finer_bend) - rounding) * u > allowed
    )
    sound = ((curved - rounding) * u <= allowed) & ~kink
    return _Differences(slopes, curved + rounding, sound, reach)


def _central_differences(model, x, middle, steps):
    """Slopes (rows, n) over +- steps, and difference of the slopes on both sides."""
    slopes, bends = [], []
    for i, step in enumerate(steps):
        x_up, x_down = x.copy(), x.copy()
        x_up[i], x_down[i] = x[i] + step, x[i] - step
        y_up, y_down = outputs_of(model, x_up), outputs_of(model, x_down)
        # Divided by the step as stored, which rounding may have changed.
        slopes.append((y_up - y_down) / (x_up[i] - x_down[i]))
        bends.append((y_up - middle) / (x_up[i] - x[i]) - (middle - y_down) / (x[i] - x_down[i]))
    return np.stack(slopes, axis=1), np.stack(bends, axis=1)


def _choose_steps(x, u):
    """Steps (n,): a quarter of u, but large enough to exceed rounding of x."""
    # For an input without uncertainty: the step that balances rounding and truncation.
    least = np.finfo(float).eps ** (1 / 3) * np.maximum(np.abs(x), 1e-3)
    return np.where(u > 0, np.maximum(u / 4, 2**14 * np.spacing(np.abs(x))), least)


def _combined_uncertainty(slopes, u):
    """Standard uncertainty (rows, 1) of each output, without correlations."""
    return np.sqrt(np.sum((slopes * u) ** 2, axis=1, keepdims=True))


def _complex_step(model, x, shape):
    """Derivatives (rows, n) by complex step; None if the model does not accept complex numbers."""
    columns = []
    for i in range(len(x)):
        shifted = x.astype(complex)
        shifted[i] += 1j * _COMPLEX_STEP
        try:
            with warnings.catch_warnings():
                # A discarded imaginary part would give a zero derivative.
                warnings.simplefilter("error", np.exceptions.ComplexWarning)
                values = np.atleast_1d(np.asarray(model(shifted)))
        except (TypeError, ValueError, ArithmeticError, np.exceptions.ComplexWarning):
            return None
        # A real result has lost the imaginary part.
        if not np.iscomplexobj(values) or values.shape != shape[:1]:
            return None
        columns.append(values.imag / _COMPLEX_STEP)
    jacobian = np.stack(columns, axis=1)
    return jacobian if np.all(np.isfinite(jacobian)) else None


def _refuse(wrong, sizes, names, reason):
    """Raise SolutionError for the first wrong sensitivity."""
    if np.any(wrong):
        row, column = np.argwhere(wrong)[0]
        name = names[column] if names else f"input {column + 1}"
        size = sizes[row, column]
        raise SolutionError(f"sensitivity of output {row + 1} {reason} {name}: {size:.3g} apart")
