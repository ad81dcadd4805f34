"""The capacity of a tank at the top of its table: what a camera is worth in the end.

All adjustments of one survey go through the same points of the wall, those that the first of them
accepted: else a point more or less would look like an effect of the camera.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.pipeline.chain import run
from tankcal.pipeline.point_covariance import s_transform
from tankcal.pipeline.survey_warnings import refuse_undetermined
from tankcal.survey import wall_points

STEP_M = 0.1  # of the table: only its top row is wanted


@dataclass(frozen=True)
class TopVolume:
    """Volume of the tank at the top of its table.

    value_m3, u_m3  with its standard uncertainty       U_m3, k  expanded, and its factor
    height_m        dip of the top                      points   of the wall; None: not surveyed
    """

    value_m3: float
    u_m3: float
    U_m3: float
    k: float
    height_m: float
    points: int | None


class TopOfTank:
    """Volumes at the top of a job's tank, by different adjustments of its survey."""

    def __init__(self, job):
        self.job, self._wall = job, None

    def of(self, adjustment):
        """The TopVolume by a survey.Adjustment; the first one finds the points of the wall.

        Raises SolutionError or InputError where there is no capacity.
        """
        refuse_undetermined(adjustment.datum)
        if self._wall is None:
            accepted = self._result(adjustment)
            points = accepted.job.points.names
            if accepted.accepted is not None:
                self._wall = frozenset(points[i] for i in accepted.accepted)
        return _top_of(self._result(adjustment))

    def _result(self, adjustment):
        job = self.job
        points = wall_points(adjustment, job.measurements, job.survey.side)
        points, snooping = s_transform(points), job.snooping
        if self._wall is not None:
            points, snooping = _chosen(points, self._wall), False
        table = replace(
            job.table, step_m=STEP_M, height_unit="m", fine_step_m=None, fine_zones=(),
            max_interpolation_error_m3=None, other_densities_kg_m3=(),
        )  # fmt: skip
        job = replace(job, points=points, table=table, measurements=None, snooping=snooping)
        return run(job, simulated=False)


def _top_of(result):
    height_m = float(result.table.height_m[-1])
    top, accepted = result.at(height_m), result.accepted
    points = None if accepted is None else len(accepted)
    values = (float(value) for value in (top.value_m3, top.u_m3, top.U_m3, top.k))
    return TopVolume(*values, height_m, points)


def _chosen(points, names):
    """The job.Points with these names, in their order."""
    rows = np.array([i for i, name in enumerate(points.names) if name in names], dtype=int)
    columns = (3 * rows[:, None] + np.arange(3)).ravel()
    return replace(
        points,
        names=tuple(points.names[i] for i in rows),
        xyz_m=points.xyz_m[rows],
        covariance_m2=points.covariance_m2[np.ix_(columns, columns)],
        section=tuple(points.section[i] for i in rows),
        generatrix=tuple(points.generatrix[i] for i in rows),
        rows=tuple(points.rows[i] for i in rows),
        causes=tuple(replace(one, column_m=one.column_m[columns]) for one in points.causes),
    )
