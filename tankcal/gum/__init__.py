"""The law of propagation of uncertainty for any model: JCGM 100:2008 and JCGM 102:2011.

inputs = Inputs([Input("d", within(0.01, mean=4.8), "m"), ...], {("d", "h"): 0.5})
result = propagate(lambda x: np.pi / 4 * x[0] ** 2 * x[1], inputs)
result.u, result.dof, result.expanded(0.95), result.covariance, result.delivered(...)
budget(result, row=0)
"""

from tankcal.gum.budget import BudgetRow, budget
from tankcal.gum.combination import Combination
from tankcal.gum.inputs import Input, Inputs, vector
from tankcal.gum.propagation import Propagation, propagate
from tankcal.gum.sensitivities import sensitivities_of

__all__ = [
    "BudgetRow",
    "Combination",
    "Input",
    "Inputs",
    "Propagation",
    "budget",
    "propagate",
    "sensitivities_of",
    "vector",
]
