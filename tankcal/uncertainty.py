"""Law of propagation of uncertainty; u, degrees of freedom, k, U and budgets.

    y = f(x),  J = dy/dx (rows x inputs),  U_x = L L',  U_y = (J L)(J L)'

For outputs y of inputs x with covariance U_x, `propagate` keeps the factor J L, with few columns.
No matrix rows x rows is computed, except by `Propagation.covariance`. Correlated inputs form one
`Source`, and one component of u:

    inputs = Inputs([Input("d", within(0.01, mean=4.8), "m"), ...], {("d", "h"): 0.5})
    result = propagate(lambda x: np.pi / 4 * x[0] ** 2 * x[1], inputs)
    result.u, result.dof, result.expanded(0.95), result.covariance
    budget(result, row=0)

Tables, deliveries and plans supply their `Source`s themselves: the columns J L of each group of
errors. `combine` gives

    u^2 = sum of u_i^2,  dof = u^4 / sum of u_i^4 / dof_i,  U = k u

with k of Student's t for dof (`coverage_factor`). Searches that store sums for speed use
`sum_of_fourths` and `dof_of`. `tankcal.gum` contains the distributions (`within`, ...).

`sensitivities_of` determines dy/dx of a model by numerical differentiation, and checks it. The
complex step Im f(x + i h)/h has no cancellation, but requires an analytic model. Its result is used
only if it agrees with central differences. The differences use the steps u(x)/4 and u(x)/8,
extrapolated to a step of zero (Richardson). If both steps disagree, an eighth and a 64th of these
steps are tried. Without agreement of the complex step, the differences are the result.

A kink or a jump at the estimate is rejected. A kink beside the estimate, or a strong curvature
within u, is accepted; Monte Carlo shows whether the law of propagation is valid.

Sources: JCGM 100:2008, 5.1.3, 5.2.2 and G.4; JCGM 102:2011, 6.2; Squire & Trapp 1998, SIAM Review
40, 110 (complex step).
"""

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.gum.components import (
    ROUNDING,
    BudgetRow,
    Combined,
    Shares,
    Source,
    budget,
    combine,
    declared_source,
    factor_of,
    group_correlated,
    scale_source,
    together_dof,
    triangular,
    type_of,
)
from tankcal.gum.coverage import coverage_factor, dof_of, effective_dof, least_of, sum_of_fourths
from tankcal.gum.inputs import Input, Inputs

__all__ = [
    "ROUNDING",
    "BudgetRow",
    "Combined",
    "Input",
    "Inputs",
    "Propagation",
    "Shares",
    "Source",
    "budget",
    "combine",
    "coverage_factor",
    "declared_source",
    "dof_of",
    "effective_dof",
    "factor_of",
    "group_correlated",
    "least_of",
    "propagate",
    "scale_source",
    "sensitivities_of",
    "sum_of_fourths",
    "together_dof",
    "triangular",
    "type_of",
]
_COMPLEX_STEP = 1e-30  # without cancellation, the step can be arbitrarily small
_AGREEMENT = 1e-3  # relative to u of the output, and to a sensitivity: the digits of a budget
_ROUNDING = 64 * np.finfo(float).eps  # relative rounding error of an output
_SHARES = (1.0, 1 / 8, 1 / 64)  # of the first step, tried in this order


@dataclass(frozen=True)
class Propagation:
    """Outputs with their uncertainty; each row is an output.

    Attributes
    ----------
    inputs : Inputs
        The n inputs.
    values : ndarray, shape (rows,)
        Outputs at the estimates, in the unit of the output.
    sensitivities : ndarray, shape (rows, n)
        Sensitivity coefficients J, unit of the output per unit of the input.
    """

    inputs: Inputs
    values: np.ndarray
    sensitivities: np.ndarray

    @cached_property
    def sources(self):
        """One `Source` for each group of correlated inputs, with the columns J L of the group."""
        names = self.inputs.names
        return tuple(
            Source(
                " & ".join(names[i] for i in group),
                self.sensitivities[:, group] @ block,
                together_dof(self.inputs.dof[group]),
            )
            for group, block in zip(self.inputs.groups, self.inputs.blocks, strict=True)
        )

    @cached_property
    def combination(self):
        """Combined uncertainty of the sources."""
        return combine(self.sources, len(self.values))

    @property
    def factor(self):
        """Factor J L (rows, c); the covariance of the outputs is factor factor'."""
        # The empty column serves a propagation without sources.
        columns = [source.columns_m3 for source in self.sources]
        return np.hstack([np.empty((len(self.values), 0)), *columns])

    @property
    def u(self):
        """Combined standard uncertainty (rows,)."""
        return self.combination.u

    @property
    def covariance(self):
        """Covariance (rows, rows) of the outputs; for few rows only."""
        factor = self.factor
        return factor @ factor.T

    @property
    def correlation(self):
        """Correlation (rows, rows) of the outputs; 0 for an output without uncertainty."""
        u = self.u
        inverse = np.divide(1, u, out=np.zeros_like(u), where=u > 0)
        # Rounding may exceed 1.
        return np.clip(self.covariance * np.outer(inverse, inverse), -1, 1)

    @property
    def dof(self):
        """Effective degrees of freedom (rows,); inf if all contributing inputs have inf."""
        return self.combination.effective_dof

    def k(self, probability):
        """Coverage factor (rows,) of Student's t for a coverage probability."""
        return self.combination.k(probability)

    def expanded(self, probability):
        """Expanded uncertainty (rows,), U = k u."""
        return self.combination.expanded(probability)

    def shares(self):
        """Share (rows, n) of each input in the variance, with half of each covariance.

        The shares c_i u_i sum_j r_ij c_j u_j / u^2 have the sum 1. A share can be negative for
        correlated inputs. A row without uncertainty has zero shares.
        """
        parts = np.empty_like(self.sensitivities)
        groups = zip(self.inputs.groups, self.inputs.blocks, self.sources, strict=True)
        for group, block, source in groups:
            # c_i u_i sum_j r_ij c_j u_j = c_i (L (L'c'))_i, with the columns J L of the source.
            parts[:, group] = self.sensitivities[:, group] * (source.columns_m3 @ block.T)
        variance = np.sum(self.combination.variances, axis=1, keepdims=True)
        return np.divide(parts, variance, out=np.zeros_like(parts), where=variance > 0)

    def combine(self, weights):
        """Propagation of linear combinations of the outputs: sums, differences, deliveries.

        Common errors of the outputs cancel or add up correctly.

        Parameters
        ----------
        weights : array_like, shape (new rows, rows)
            Coefficients of the outputs.

        Returns
        -------
        Propagation
        """
        weights = np.atleast_2d(weights)
        return Propagation(self.inputs, weights @ self.values, weights @ self.sensitivities)

    def rows(self, chosen):
        """Propagation of selected rows, given by indices or by a mask."""
        return Propagation(self.inputs, self.values[chosen], self.sensitivities[chosen])

    def scaled(self, name, factor):
        """Propagation with u of all inputs of the budget line `name` multiplied by `factor`."""
        in_line = [item.line == name for item in self.inputs.inputs]
        # Scaling the sensitivity has the effect of scaling u.
        factors = np.where(in_line, factor, 1.0)
        return Propagation(self.inputs, self.values, self.sensitivities * factors)


def propagate(model, inputs, sensitivities=None):
    """Propagate uncertainty through a model at the estimates of its inputs, u^2 = J U_x J'.

    Parameters
    ----------
    model : callable
        model(x) -> a number or outputs (rows,), for inputs x (n,) in the order of `inputs`.
    inputs : Inputs
        Inputs with distributions and correlations.
    sensitivities : ndarray, shape (rows, n), or callable, optional
        dy/dx, or a function of the inputs (n,) that returns it. By default, dy/dx is computed by
        complex step or by differences. A function is checked against differences, an array is not.

    Returns
    -------
    Propagation

    Raises
    ------
    SolutionError
        If an output is not finite, if the model has a kink or a jump at the estimates, or if a
        sensitivity is wrong.
    ValueError
        For arrays of the wrong shape.

    Examples
    --------
    >>> from tankcal.gum import within
    >>> from tankcal.uncertainty import Input, Inputs, propagate
    >>> sizes = [Input("d", within(0.01, mean=4.8), "m"), Input("h", within(0.004, mean=6.0), "m")]
    >>> volume = propagate(lambda x: np.pi / 4 * x[0] ** 2 * x[1], Inputs(sizes))
    >>> volume.values.round(2).tolist(), volume.u.round(3).tolist()
    ([108.57], [0.265])
    """
    if not len(inputs):
        raise ValueError("a measurement without inputs has no uncertainty to propagate")
    x, u, names = inputs.estimates, inputs.u, inputs.names
    # The estimates of the outputs, JCGM 100 4.1.4.
    values = outputs_of(model, x)
    if sensitivities is None:
        jacobian = sensitivities_of(model, x, u, names)
    elif callable(sensitivities):
        jacobian = np.atleast_2d(np.asarray(sensitivities(x), dtype=float))
        check_sensitivities(model, x, u, jacobian, names)
    else:
        jacobian = np.atleast_2d(np.asarray(sensitivities, dtype=float))
    if jacobian.shape != (len(values), len(inputs)):
        raise ValueError(f"sensitivities {jacobian.shape}, expected {(len(values), len(inputs))}")
    if not np.all(np.isfinite(jacobian)):
        raise ValueError("a sensitivity is not a finite number")
    return Propagation(inputs, values, jacobian)


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
    wrong = (deviation - estimates.doubt) * u > _AGREEMENT * _combine_without_correlations(
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
    allowed = _AGREEMENT * np.maximum(_combine_without_correlations(slopes, u), reach)
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


def _combine_without_correlations(slopes, u):
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
