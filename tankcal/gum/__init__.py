"""Uncertainty by the GUM: inputs and distributions, propagation, budgets, Monte Carlo.

`within`, `expanded` and `standard` create a distribution from the statement of a certificate.
`Combination` is the exact distribution of a linear combination. `tankcal.gum.monte_carlo`
simulates. The public interface to the law of propagation, degrees of freedom, k, U and budgets is
`tankcal.uncertainty`.
"""

from tankcal.gum.distributions import Combination, expanded, standard, vector, within

__all__ = ["Combination", "expanded", "standard", "vector", "within"]
