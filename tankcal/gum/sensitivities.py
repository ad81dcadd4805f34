"""Sensitivities of a model, dy/dx, where nobody derived them, and a check where somebody did.

Complex step: Im f(x + i h)/h, without cancellation, for models that are analytic. It is believed
only where it agrees with central differences over u(x)/4 and u(x)/8, extrapolated to a step of
zero (Richardson), over an eighth and a 64th of these steps where the first disagree; else the
differences are taken. A kink or a jump at the estimate is refused. One beside it, or a curve that
is strong within u, is not: that the law of propagation does not hold there shows in Monte Carlo.
Source: JCGM 100:2008 5.1.3; Squire & Trapp 1998, SIAM Review 40, 110.
"""

import warnings
from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError

_COMPLEX_STEP = 1e-30
_AGREEMENT = 1e-3  # of u of the output, and of a sensitivity: the digits of a budget
_ROUNDING = 64 * np.finfo(float).eps
_SHARES = (1.0, 1 / 8, 1 / 64)


@dataclass(frozen=True)
class _Differences:
    """(rows, n) extrapolated differences, by how much they may be wrong, and which are sound.

    reach  how far the first steps say that an output moves within u, whatever its slope is
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
        Takes (n,) estimates, gives a number or (rows,); a complex x too if it can.
    x, u : array_like, shape (n,)
        Estimates and standard uncertainties, in the units of the inputs.
    names : sequence of str, length n, optional
        Of the inputs, for the message.

    Returns
    -------
    ndarray, shape (rows, n)

    Raises
    ------
    SolutionError
        Naming an input at whose estimate the model has a kink or a jump, or when an output is not
        finite.

    Examples
    --------
    >>> sensitivities_of(lambda x: x[0] ** 2 * x[1], [3.0, 2.0], [0.1, 0.1]).round(9).tolist()
    [[12.0, 9.0]]
    """
    x, u = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    found = _differences(model, x, u)
    _refuse(~found.sound, found.doubt, names, "not smooth at the estimate of")
    analytic = _complex_step(model, x, found.slopes.shape)
    if analytic is None:
        return found.slopes
    off = np.abs(analytic - found.slopes)
    return np.where(off <= found.doubt + _AGREEMENT * np.abs(found.slopes), analytic, found.slopes)


def check_sensitivities(model, x, u, sensitivities, names=None):
    """Hold given (rows, n) sensitivities against central differences.

    Raises SolutionError naming the input whose contribution to u differs by over a thousandth of u
    of that output, and ValueError for a wrong shape.
    """
    x, u = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    found = _differences(model, x, u)
    if sensitivities.shape != found.slopes.shape:
        raise ValueError(f"sensitivities {sensitivities.shape}, expected {found.slopes.shape}")
    off = np.abs(sensitivities - found.slopes)
    wrong = (off - found.doubt) * u > _AGREEMENT * _total(found.slopes, u)
    _refuse(wrong, off, names, "contradicted by differences over")


def outputs_of(model, x):
    """(rows,) outputs at x; raises SolutionError when one is not finite."""
    values = np.atleast_1d(np.asarray(model(x), dtype=float))
    if values.ndim != 1:
        raise ValueError(f"the model gives {values.shape}: expected a number or (rows,)")
    if not np.all(np.isfinite(values)):
        raise SolutionError(f"output {int(np.argmin(np.isfinite(values))) + 1} is not finite")
    return values


def _differences(model, x, u):
    """The first sound differences of each sensitivity, over ever smaller steps."""
    middle = outputs_of(model, x)
    chosen = None
    for share in _SHARES:
        reach = None if chosen is None else chosen.reach
        now = _differences_over(model, x, u, middle, _steps(x, u) * share, reach)
        if chosen is None:
            chosen = now
        better = now.sound & ~chosen.sound
        chosen = _Differences(
            np.where(better, now.slopes, chosen.slopes),
            np.where(better, now.doubt, chosen.doubt),
            chosen.sound | now.sound,
            reach=chosen.reach,
        )
        if np.all(chosen.sound):
            break
    return chosen


def _differences_over(model, x, u, middle, steps, reach=None):
    coarse, bend = _central(model, x, middle, steps)
    if reach is None:
        reach = (np.abs(coarse) + np.abs(bend) / 2) * u
    fine, finer_bend = _central(model, x, middle, steps / 2)
    slopes = fine + (fine - coarse) / 3
    rounding = _ROUNDING * np.abs(middle)[:, None] / steps
    allowed = _AGREEMENT * np.maximum(_total(slopes, u), reach)
    curved = np.abs(fine - coarse)
    # twice the mean slope of a kink stays when the step is halved; that of a curve is halved
    kink = (np.abs(finer_bend) > 0.75 * np.abs(bend)) & (
        (np.abs(finer_bend) - rounding) * u > allowed
    )
    sound = ((curved - rounding) * u <= allowed) & ~kink
    return _Differences(slopes, curved + rounding, sound, reach)


def _central(model, x, middle, steps):
    """(rows, n) slopes over +- steps, and by how much the slopes of both sides differ."""
    slopes, bends = [], []
    for i, step in enumerate(steps):
        up, down = x.copy(), x.copy()
        up[i], down[i] = x[i] + step, x[i] - step
        above, below = outputs_of(model, up), outputs_of(model, down)
        slopes.append((above - below) / (up[i] - down[i]))
        bends.append((above - middle) / (up[i] - x[i]) - (middle - below) / (x[i] - down[i]))
    return np.stack(slopes, axis=1), np.stack(bends, axis=1)


def _steps(x, u):
    least = np.finfo(float).eps ** (1 / 3) * np.maximum(np.abs(x), 1e-3)
    return np.where(u > 0, np.maximum(u / 4, 2**14 * np.spacing(np.abs(x))), least)


def _total(slopes, u):
    """(rows, 1) u of each output without correlations."""
    return np.sqrt(np.sum((slopes * u) ** 2, axis=1, keepdims=True))


def _complex_step(model, x, shape):
    """(rows, n) by complex step, or None where the model takes no complex numbers."""
    columns = []
    for i in range(len(x)):
        moved = x.astype(complex)
        moved[i] += 1j * _COMPLEX_STEP
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", np.exceptions.ComplexWarning)
                values = np.atleast_1d(np.asarray(model(moved)))
        except (TypeError, ValueError, ArithmeticError, np.exceptions.ComplexWarning):
            return None
        if not np.iscomplexobj(values) or values.shape != shape[:1]:
            return None
        columns.append(values.imag / _COMPLEX_STEP)
    found = np.stack(columns, axis=1)
    return found if np.all(np.isfinite(found)) else None


def _refuse(wrong, sizes, names, what):
    if np.any(wrong):
        row, column = np.argwhere(wrong)[0]
        name = names[column] if names else f"input {column + 1}"
        size = sizes[row, column]
        raise SolutionError(f"sensitivity of output {row + 1} {what} {name}: {size:.3g} apart")
