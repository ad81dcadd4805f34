"""The simulation of all rows of a table, and of deliveries between its dips."""

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
    """What Monte Carlo says of a table and of deliveries from it.

    found, judged  `monte_carlo.Simulation` and `Verdict` of the rows
    delivered      the `deliveries.Deliveries` that were simulated, too
    of_deliveries  (Simulation, Verdict) of them
    smooth         (deliveries,) whether a parabola by the datum follows their volumes
    curved         pairs of inputs whose second derivatives were kept
    bent           (rows,) whether the row was simulated with the tank's own volumes, not a parabola
    drawn          rows that were drawn for; the others of a long table follow their neighbours
    seed, digits   of all draws; of u that the verdict counts
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
        """`Intervals` of the rows of the table that was simulated."""
        return judged_intervals(self.judged, table.volume_m3, table.u_m3, table.U_m3, least_m3=0.0)

    @property
    def of_delivered(self):
        """`Intervals` of the deliveries that were simulated."""
        one = self.delivered
        return judged_intervals(self.of_deliveries[1], one.volume_m3, one.u_m3, one.U_m3)


def simulate_table(job, survey, body, zero_m, table, pairs=(), *, goal=None, progress=None):
    """`TableSimulation` of a `Capacity`.

    job, survey, body, zero_m  what the table was made of, as in `result.Result`
    pairs   of dips whose deliveries are simulated as well
    goal    `monte_carlo.Goal`; the probability is the table's
    progress  called as progress(text, done, total)
    Raises HeightError for a dip outside the table.
    """
    goal = replace(goal or Goal(), probability=table.probability)
    shown = progress and (lambda text, done, total: progress(SIMULATING, done, total))
    low, high = np.array(pairs, dtype=float).reshape(-1, 2).T
    model = Model(job, survey, body, zero_m, table, table.weights(high) - table.weights(low))
    found, drawn = model.simulated(goal, shown)
    rows, others = (_part(found, part) for part in model.parts)
    delivered = deliveries(table, low, high)
    of_delivered = delivered.volume_m3, delivered.u_m3, delivered.dof
    return TableSimulation(
        found=rows,
        judged=verdict(rows, table.volume_m3, table.u_m3, table.dof, digits=goal.digits),
        delivered=delivered,
        of_deliveries=(others, verdict(others, *of_delivered, digits=goal.digits)),
        smooth=~model.bent[model.parts[1]],
        curved=model.curved.pairs,
        bent=model.bent[model.parts[0]],
        drawn=drawn,
        seed=goal.seed,
        digits=goal.digits,
    )


def _part(found, part):
    return replace(found, **{name: values[part] for name, values in found.by_volume.items()})
