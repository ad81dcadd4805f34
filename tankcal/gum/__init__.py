"""Distributions of the inputs of any model, and what they make of its outputs.

`within`, `expanded` and `standard` make a distribution of what a certificate says; `Combination` is
the exact one of a sum; `tankcal.gum.monte_carlo` draws. The law of propagation is
`tankcal.uncertainty`.
"""

from tankcal.gum.combination import Combination
from tankcal.gum.distributions import expanded, standard, vector, within

__all__ = ["Combination", "expanded", "standard", "vector", "within"]
