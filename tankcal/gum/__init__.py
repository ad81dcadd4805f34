"""The GUM: inputs and their distributions, the law of propagation, budgets, Monte Carlo.

`within`, `expanded` and `standard` make a distribution of what a certificate says; `Combination` is
the exact one of a sum; `tankcal.gum.monte_carlo` draws. The door to the law of propagation, to
degrees of freedom, k, U and budgets is `tankcal.uncertainty`.
"""

from tankcal.gum.combination import Combination
from tankcal.gum.distributions import expanded, standard, vector, within

__all__ = ["Combination", "expanded", "standard", "vector", "within"]
