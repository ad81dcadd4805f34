"""Monte Carlo simulation of a capacity table, with a verdict for each row.

The simulation uses the same inputs as the propagation, and the volumes of the tank itself. Sources:
JCGM 101:2008, clause 8 for the verdict; JCGM 102:2011, 7.
"""

from tankcal.pipeline.simulation.curvature import Intervals, gum_intervals
from tankcal.pipeline.simulation.table import TableSimulation, simulate_table

__all__ = ["Intervals", "TableSimulation", "gum_intervals", "simulate_table"]
