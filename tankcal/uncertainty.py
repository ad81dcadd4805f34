"""Public interface to uncertainty: u, degrees of freedom, k, U and budgets.

Tables, budgets, deliveries and plans combine `Source`s with `combine`, which gives u, degrees of
freedom, k and U. Searches that store sums for speed use `sum_of_fourths` and `dof_of`. For any
other model, `propagate` produces the same sources:

    inputs = Inputs([Input("d", within(0.01, mean=4.8), "m"), ...], {("d", "h"): 0.5})
    result = propagate(lambda x: np.pi / 4 * x[0] ** 2 * x[1], inputs)
    result.u, result.dof, result.expanded(0.95), result.covariance
    budget(result, row=0)

`tankcal.gum` contains the distributions (`within`, ...).

Source: JCGM 100:2008; JCGM 102:2011.
"""

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
from tankcal.gum.propagation import Propagation, propagate
from tankcal.gum.sensitivities import sensitivities_of

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
