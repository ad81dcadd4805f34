"""Simulation of all rows of a table and of deliveries between its dips."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.gum.monte_carlo import Goal, Simulation, Verdict, verdict
from tankcal.messages import message
from tankcal.pipeline.simulation.intervals import judged_intervals
from tankcal.pipeline.simulation.model import Model
from tankcal.tank.deliveries import Deliveries, deliveries

SIMULATING = message("simulating", "simulating the table")


@dataclass(frozen=True)
class TableSimulation:
    """Monte Carlo simulation of a table and of deliveries.

    Attributes
    ----------
    found, judged : monte_carlo.Simulation, Verdict
        Results for the rows.
    delivered : deliveries.Deliveries
        Simulated deliveries.
    of_deliveries : (Simulation, Verdict)
        Results for the deliveries.
    smooth : ndarray of bool, shape (deliveries,)
        Whether a parabola in the datum approximates the volumes.
    curved : tuple of (str, str)
        Pairs of inputs with a significant second derivative.
    bent : ndarray of bool, shape (rows,)
        Whether the row was simulated with the volumes of the tank instead of a parabola.
    drawn : int
        Number of rows with draws; other rows of a long table are interpolated.
    seed, digits : int
        Seed of the draws, and significant digits of u for the verdict.
    """

    found: Simulation
    judged: Verdict
    delivered: Deliveries
    of_deliveries: tuple[Simulation, Verdict]
    smooth: np.ndarray
    curved: tuple[tuple[str, str], ...]
    bent: np.ndarray
    drawn: int
    seed: int
    digits: int

    def intervals(self, table):
        """`Intervals` of the rows of the simulated table."""
        return judged_intervals(self.judged, table.volume_m3, table.u_m3, table.U_m3, least_m3=0.0)

    @property
    def of_delivered(self):
        """`Intervals` of the simulated deliveries."""
        delivered = self.delivered
        return judged_intervals(
            self.of_deliveries[1], delivered.volume_m3, delivered.u_m3, delivered.U_m3
        )


def simulate_table(job, survey, body, zero_m, table, pairs=(), *, goal=None, progress=None):
    """`TableSimulation` of a `Capacity`.

    Parameters
    ----------
    job, survey, body, zero_m
        Origin of the table, as in `result.Result`.
    table : Capacity
    pairs : sequence of (float, float)
        Dips of deliveries to simulate, m.
    goal : monte_carlo.Goal, optional
        Its probability is replaced by that of the table.
    progress : callable, optional
        Called as progress(text, done, total).

    Returns
    -------
    TableSimulation

    Raises
    ------
    HeightError
        For a dip outside the table.
    """
    goal = replace(goal or Goal(), probability=table.probability)
    report = progress and (lambda text, done, total: progress(SIMULATING, done, total))
    low, high = np.array(pairs, dtype=float).reshape(-1, 2).T
    model = Model(job, survey, body, zero_m, table, table.weights(high) - table.weights(low))
    simulation, drawn = model.simulated(goal, report)
    rows, of_deliveries = (
        replace(simulation, **{name: values[part] for name, values in simulation.by_volume.items()})
        for part in model.parts
    )
    delivered = deliveries(table, low, high)
    of_delivered = delivered.volume_m3, delivered.u_m3, delivered.dof
    return TableSimulation(
        found=rows,
        judged=verdict(rows, table.volume_m3, table.u_m3, table.dof, digits=goal.digits),
        delivered=delivered,
        of_deliveries=(of_deliveries, verdict(of_deliveries, *of_delivered, digits=goal.digits)),
        smooth=~model.bent[model.parts[1]],
        curved=model.curved.pairs,
        bent=model.bent[model.parts[0]],
        drawn=drawn,
        seed=goal.seed,
        digits=goal.digits,
    )
