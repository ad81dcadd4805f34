"""Time of a table of 1 mm rows with all corrections and its covariance, once a job is computed.

    python benchmarks/table.py

The shipped example with every part that a vertical tank may have: plate, paint, temperature, tilt,
head of the liquid, cone bottom, deadwood, floating roof, and every input declared. The goal: 9 500
rows with their low-rank covariance in under 10 ms. 20 interleaved rounds on one core.
"""

import os
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measured import ROOT, Row, interleaved, tell

import tankcal
from tankcal.job import Bottom, Deadwood, DeclaredInput, Roof
from tankcal.tank.capacity import Capacity
from tankcal.tank.deliveries import worst_deliveries
from tankcal.tank.heads import End
from tankcal.tank.solids import LyingTank

ROUNDS, STEP_M = 20, 0.001


def furnished(job):
    """The job with everything in and under its tank, and every input declared."""
    furnished = replace(
        job,
        table=replace(job.table, liquid_density_kg_m3=850.0),
        bottom=Bottom("cone", centre_z_m=job.datum.bottom_z_m - 0.15),
        deadwood=(Deadwood("coil", 0.2, 0.6, -0.35, 0.02), Deadwood("manhole", 0.5, 1.1, 0.12)),
        roof=Roof(9000.0, 1.0, 1.3, 850.0, "air"),
    )
    undeclared = tankcal.run(furnished).body.undeclared()
    more = tuple(DeclaredInput(name, 1e-3, "", 1e-3) for name in undeclared)
    return replace(furnished, inputs=job.inputs + more)


def lying_tanks():
    """{name: task}: 2500 rows of lying tanks with torispherical ends."""
    dip = np.linspace(0, 2.4, 2500)
    end = End("torispherical", dish_radius_m=2.4, knuckle_radius_m=0.24)
    other = End("torispherical", dish_radius_m=2.4, knuckle_radius_m=0.2)
    tanks = {
        "equal ends": LyingTank(2.4, 2.4, 10.0, end, end),
        "unequal ends": LyingTank(2.4, 2.4, 10.0, end, other),
        "tilted": LyingTank(2.4, 2.4, 10.0, end, other, tilt=0.02, dip_from_a_m=5.0),
    }
    return {f"lying, {name}": lambda tank=tank: tank.volume_m3(dip) for name, tank in tanks.items()}


def main():
    """A row for each step."""
    result = tankcal.run(furnished(tankcal.load(ROOT / "examples" / "silva-1995")))
    body = result.body
    levels = np.arange(0, body.highest_m, STEP_M)
    table = Capacity(levels, *body.rows(levels), 0.95)
    tasks = {
        "volumes alone": lambda: body.volume_m3(levels),
        "volumes, areas, covariance": lambda: body.rows(levels),
        "worst delivery of 2 m or more": lambda: worst_deliveries(table, 2.0),
        **lying_tanks(),
    }
    sources = body.sources(levels)
    columns = sum(source.columns_m3.shape[1] for source in sources)
    print(f"{len(levels)} rows of {1000 * STEP_M:g} mm, {len(body.parts)} parts")
    print(f"{len(sources)} causes of uncertainty in {columns} columns")
    for name, seconds in interleaved(tasks, ROUNDS).items():
        size = "2500 rows" if "lying" in name else f"{len(levels)} rows, {columns} columns"
        tell(Row(f"table, {name}", size, seconds))


if __name__ == "__main__":
    main()
