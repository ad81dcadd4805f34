"""What a blunder could do that the planned survey would not notice.

The smallest blunder that is found has the size delta0 s / sqrt(r); below it a reading shifts the
volume of the full tank by up to

    dV = g Q j' delta0 / sqrt(r)        g = dV/dx, j the whitened row of the reading

All numbers are of one reading: of those that are repeated see `repeated`.

Source: Baarda 1968, as in tankcal.survey.network.reliability.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.planning.repeated import single_readings
from tankcal.solver.effects import covariances
from tankcal.survey.network.reliability import UNCONTROLLED, noncentrality


@dataclass(frozen=True)
class GroupReliability:
    """How far the readings of one kind control one another.

    kind, name    such as "distance", "tape"      unit   of the blunder
    count         values that are read            uncontrolled  of them nothing controls
    redundancy    mean redundancy number
    blunder       largest undetectable one of a controlled value; nan: none is controlled
    of            names of the reading that it is of
    volume_m3     largest effect of an undetected blunder on the volume of the full tank; nan alike
    volume_of     names of the reading that has it
    per_unit_m3   largest effect on it of a blunder of one unit in an uncontrolled value; nan: none
    per_unit_of   names of the reading that has it
    """

    kind: str
    name: str
    unit: str
    count: int
    uncontrolled: int
    redundancy: float
    blunder: float
    of: tuple
    volume_m3: float
    volume_of: tuple
    per_unit_m3: float
    per_unit_of: tuple


def reliability(plan, predicted, covariance, by_points_m2):
    """A GroupReliability for each kind and name of readings (alpha 0.001, power 0.80).

    plan         Plan                        predicted     surveys.Predicted of it
    covariance   PredictedCovariance         by_points_m2  (3n,) see PredictedTable
                 of these n points
    """
    adjusted = predicted.adjusted
    problem, solution = adjusted.problem, adjusted.solution
    pull = _pull(solution, problem.layout.points[covariance.points].ravel(), by_points_m2)
    found = []
    parts = zip(problem.observations, problem.sources, problem.rows_of, strict=True)
    for number, (one, source, rows) in enumerate(parts):
        if source not in predicted.gathered.traces:
            continue
        trace, jac = predicted.gathered.traces[source], solution.jacobians[number]
        r = 1.0 - solution.leverage(number, jac)
        columns = problem.model.groups[number].columns
        effect = np.abs(np.einsum("nmk,nk->nm", jac, pull[columns]))
        single = single_readings(plan, one, trace, rows)
        found += _by_name(one, trace, rows, single, single.redundancy(r), effect)
    return tuple(found)


def _pull(solution, columns, gradient):
    """(unknowns + 1,) Q g' of a gradient by some unknowns; the last is 0, for the fixed ones."""
    return np.append(covariances(solution, columns, gradient[None])[:, 0], 0.0)


def _by_name(one, trace, rows, single, redundancy, effect):
    """The groups of one table of observations.

    single  SingleReadings (k)      redundancy  (k, m) of these     effect  (n, m) of the rows
    """
    rows = rows[single.of]
    names = np.array([trace.group[i] for i in rows.tolist()], dtype=object)
    controlled = redundancy > UNCONTROLLED
    size = np.where(controlled, noncentrality() / np.sqrt(np.where(controlled, redundancy, 1)), 0)
    weight = one.using(np.ones(len(one))).weight[single.of] * single.root()
    effect = effect[single.of] * single.root()
    blunder, volume = size / weight, size * effect
    per_unit = np.where(controlled, -1.0, effect * weight)
    for name in dict.fromkeys(names):
        mine = np.flatnonzero(names == name)
        worst, moves, alone = (
            mine[np.argmax(part[mine].max(axis=1))] for part in (blunder, volume, per_unit)
        )
        known, is_bare = controlled[mine].any(), bool((~controlled[mine]).any())
        count = single.count[mine]
        yield GroupReliability(
            kind=one.kind, name=str(name), unit=one.unit,
            count=int(count.sum() * redundancy.shape[1]),
            uncontrolled=int(count @ np.sum(~controlled[mine], axis=1)),
            redundancy=float(count @ redundancy[mine].mean(axis=1) / count.sum()),
            blunder=float(blunder[worst].max()) if known else float("nan"),
            of=trace.ids[rows[worst]],
            volume_m3=float(volume[moves].max()) if known else float("nan"),
            volume_of=trace.ids[rows[moves]],
            per_unit_m3=float(per_unit[alone].max()) if is_bare else float("nan"),
            per_unit_of=trace.ids[rows[alone]] if is_bare else (),
        )  # fmt: skip
