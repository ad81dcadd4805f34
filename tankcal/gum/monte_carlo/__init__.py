"""Monte Carlo simulation of models with many rows: JCGM 101:2008 and JCGM 102:2011.

`simulate` draws, and `verdict` validates the GUM intervals. Capacity tables are `QuadraticRows`.
"""

from tankcal.gum.monte_carlo.goal import NAMES as ESTIMATES
from tankcal.gum.monte_carlo.goal import Goal, Simulation, Verdict, numerical_tolerance, verdict
from tankcal.gum.monte_carlo.quadratic import QuadraticRows
from tankcal.gum.monte_carlo.simulation import simulate, simulate_quadratic

__all__ = [
    "ESTIMATES",
    "Goal",
    "QuadraticRows",
    "Simulation",
    "Verdict",
    "numerical_tolerance",
    "simulate",
    "simulate_quadratic",
    "verdict",
]
