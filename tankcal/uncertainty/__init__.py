"""The one engine of uncertainty: u, degrees of freedom, k and U of anything, and its budget.

A table, a budget, a delivery and a plan are made of `Source`s and take u, degrees of freedom, k and
U from `combined`; searches that keep sums for speed from `sum_of_fourths` and `dof_of`. Any other
model goes through `propagate`, which makes the same sources:

    inputs = Inputs([Input("d", within(0.01, mean=4.8), "m"), ...], {("d", "h"): 0.5})
    result = propagate(lambda x: np.pi / 4 * x[0] ** 2 * x[1], inputs)
    result.u, result.dof, result.expanded(0.95), result.covariance
    budget(result, row=0)

Distributions (`within`, ...) are in `tankcal.gum`. Source: JCGM 100:2008; JCGM 102:2011.
"""

from tankcal.uncertainty.budget import BudgetRow, Shares, budget
from tankcal.uncertainty.components import (
    ROUNDING,
    Combined,
    Source,
    combined,
    coverage_factor,
    declared_source,
    dof_of,
    effective_dof,
    factor_of,
    grouped,
    least_of,
    sum_of_fourths,
    together_dof,
    triangular,
)
from tankcal.uncertainty.inputs import Input, Inputs
from tankcal.uncertainty.propagation import Propagation, propagate
from tankcal.uncertainty.sensitivities import sensitivities_of

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
    "combined",
    "coverage_factor",
    "declared_source",
    "dof_of",
    "effective_dof",
    "factor_of",
    "grouped",
    "least_of",
    "propagate",
    "sensitivities_of",
    "sum_of_fourths",
    "together_dof",
    "triangular",
]
