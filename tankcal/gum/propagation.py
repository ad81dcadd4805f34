"""The law of propagation for several outputs, with few columns: U_y = (J L)(J L)'.

    y = f(x),  J = dy/dx (rows x inputs),  U_x = L L'  (JCGM 100:2008 5.2.2, JCGM 102:2011 6.2)

Nothing of rows x rows is formed unless `covariance` is asked for.

Inputs that are correlated are one `Source`, and one component of u (`components.together_dof`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.gum.components import Source, combine, together_dof
from tankcal.gum.inputs import Inputs
from tankcal.gum.sensitivities import check_sensitivities, outputs_of, sensitivities_of


@dataclass(frozen=True)
class Propagation:
    """Outputs with their uncertainty; one row an output.

    Attributes
    ----------
    inputs : Inputs
        What went in, n of them.
    values : ndarray, shape (rows,)
        Outputs at the estimates, in the unit of the output.
    sensitivities : ndarray, shape (rows, n)
        J, unit of the output by unit of the input.
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
        """`Combined` of the sources."""
        return combine(self.sources, len(self.values))

    @property
    def factor(self):
        """(rows, c) J L: the covariance of the outputs is factor factor'."""
        columns = [source.columns_m3 for source in self.sources]
        return np.hstack([np.empty((len(self.values), 0)), *columns])

    @property
    def u(self):
        """(rows,) combined standard uncertainty."""
        return self.combination.u

    @property
    def covariance(self):
        """(rows, rows) covariance of the outputs; for a few rows."""
        factor = self.factor
        return factor @ factor.T

    @property
    def correlation(self):
        """(rows, rows) correlation of the outputs, 0 for an output without uncertainty."""
        u = self.u
        inverse = np.divide(1, u, out=np.zeros_like(u), where=u > 0)
        return np.clip(self.covariance * np.outer(inverse, inverse), -1, 1)

    @property
    def dof(self):
        """(rows,) effective degrees of freedom; inf where only such inputs contribute."""
        return self.combination.effective_dof

    def k(self, probability):
        """(rows,) coverage factor for that coverage probability, of Student's t."""
        return self.combination.k(probability)

    def expanded(self, probability):
        """(rows,) expanded uncertainty U = k u."""
        return self.combination.expanded(probability)

    def shares(self):
        """(rows, n) part of the variance that each input brings, its covariances halved.

        c_i u_i sum_j r_ij c_j u_j / u^2: they add up to 1, and can be negative where inputs are
        correlated; 0 in a row without uncertainty.
        """
        parts = np.empty_like(self.sensitivities)
        of_groups = zip(self.inputs.groups, self.inputs.blocks, self.sources, strict=True)
        for group, block, source in of_groups:
            parts[:, group] = self.sensitivities[:, group] * (source.columns_m3 @ block.T)
        variance = np.sum(self.combination.variances, axis=1, keepdims=True)
        return np.divide(parts, variance, out=np.zeros_like(parts), where=variance > 0)

    def combine(self, weights):
        """The propagation of weights @ outputs, (new rows, rows): sums, differences, deliveries.

        What the outputs have in common cancels or adds up as it must.
        """
        weights = np.atleast_2d(weights)
        return Propagation(self.inputs, weights @ self.values, weights @ self.sensitivities)

    def rows(self, chosen):
        """The propagation of the chosen rows alone, an index or mask of them."""
        return Propagation(self.inputs, self.values[chosen], self.sensitivities[chosen])

    def scaled(self, name, factor):
        """The same with u of every input of the budget line `name` times `factor`."""
        of_line = [one.line == name for one in self.inputs.inputs]
        by_input = np.where(of_line, factor, 1.0)
        return Propagation(self.inputs, self.values, self.sensitivities * by_input)


def propagate(model, inputs, sensitivities=None):
    """Outputs of `model` at the estimates with their uncertainty, u^2 = J U_x J'.

    Parameters
    ----------
    model : callable
        Takes the (n,) inputs in the order of `inputs`, gives a number or (rows,) outputs.
    inputs : Inputs
        Each quantity once, with its distribution and correlations.
    sensitivities : (rows, n) array or callable, optional
        dy/dx, or a function of the (n,) inputs that gives it; found by complex step or differences
        where nothing is given. A function is held against differences, an array is not.

    Returns
    -------
    Propagation

    Raises
    ------
    SolutionError
        When an output is not finite, the model has a kink or a jump at the estimates, or a
        sensitivity is wrong.
    ValueError
        For shapes that do not fit.

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
    values = outputs_of(model, x)
    if sensitivities is None:
        found = sensitivities_of(model, x, u, names)
    elif callable(sensitivities):
        found = np.atleast_2d(np.asarray(sensitivities(x), dtype=float))
        check_sensitivities(model, x, u, found, names)
    else:
        found = np.atleast_2d(np.asarray(sensitivities, dtype=float))
    if found.shape != (len(values), len(inputs)):
        raise ValueError(f"sensitivities {found.shape}, expected {(len(values), len(inputs))}")
    if not np.all(np.isfinite(found)):
        raise ValueError("a sensitivity is not a finite number")
    return Propagation(inputs, values, found)
