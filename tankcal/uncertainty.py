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

Source: JCGM 100:2008, 5.2.2 and G.4; JCGM 102:2011, 6.2.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.gum.budget import BudgetRow, Shares, budget
from tankcal.gum.components import (
    ROUNDING,
    Combined,
    Source,
    combine,
    declared_source,
    factor_of,
    group_correlated,
    scale_source,
    together_dof,
    triangular,
)
from tankcal.gum.coverage import coverage_factor, dof_of, effective_dof, least_of, sum_of_fourths
from tankcal.gum.inputs import Input, Inputs
from tankcal.gum.sensitivities import check_sensitivities, outputs_of, sensitivities_of

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
]


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
