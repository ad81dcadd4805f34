"""Monte Carlo of a capacity table: the same inputs, the tank's own answer, a verdict for each row.

Sources: JCGM 101:2008, clause 8 for the verdict; JCGM 102:2011, 7.
"""

from tankcal.pipeline.simulation.intervals import Intervals, gum_intervals
from tankcal.pipeline.simulation.table import TableSimulation, simulate_table

__all__ = ["Intervals", "TableSimulation", "gum_intervals", "simulate_table"]
