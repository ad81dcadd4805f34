"""Monte Carlo of models with many rows: JCGM 101:2008 and JCGM 102:2011.

`simulate` draws, `verdict` says whether the GUM intervals may stand; tables are `QuadraticRows`.
"""

from tankcal.monte_carlo.goal import NAMES as ESTIMATES
from tankcal.monte_carlo.goal import Goal, Simulation, numerical_tolerance
from tankcal.monte_carlo.judging import Verdict, verdict
from tankcal.monte_carlo.quadratic import QuadraticRows
from tankcal.monte_carlo.running import simulate

__all__ = [
    "ESTIMATES",
    "Goal",
    "QuadraticRows",
    "Simulation",
    "Verdict",
    "numerical_tolerance",
    "simulate",
    "verdict",
]
