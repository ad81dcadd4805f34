"""Capacity of a tank at the top of its table, for the comparison of camera models.

All adjustments of a survey use the points of the wall that the first adjustment accepted. Otherwise
a different set of points would appear as an effect of the camera.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.pipeline.chain import run
from tankcal.pipeline.checks.survey import refuse_undetermined
from tankcal.pipeline.wall.point_covariance import s_transform
from tankcal.survey import wall_points

STEP_M = 0.1  # step of the table, m; only its top row is used


@dataclass(frozen=True)
class TopVolume:
    """Volume of the tank at the top of its table.

    Attributes
    ----------
    value_m3, u_m3 : float
        Volume and its standard uncertainty, m3.
    U_m3, k : float
        Expanded uncertainty, m3, and coverage factor.
    height_m : float
        Dip at the top of the table, m.
    points : int or None
        Number of points of the wall, or None if the wall was not surveyed.
    """

    value_m3: float
    u_m3: float
    U_m3: float
    k: float
    height_m: float
    points: int | None


class TopOfTank:
    """Volumes at the top of the tank of a job, from different adjustments of its survey."""

    def __init__(self, job):
        self.job, self._wall = job, None

    def compute_volume(self, adjustment):
        """Compute the TopVolume from a survey.Adjustment.

        The first call selects the points of the wall for all calls. Raises SolutionError or
        InputError if the capacity cannot be computed.
        """
        refuse_undetermined(adjustment.datum)
        if self._wall is None:
            accepted = self._run(adjustment)
            points = accepted.job.points.names
            if accepted.accepted is not None:
                self._wall = frozenset(points[i] for i in accepted.accepted)
        return _read_top_volume(self._run(adjustment))

    def _run(self, adjustment):
        """Compute the table of the job, which needs only its top row, from an adjustment."""
        job = self.job
        points = wall_points(adjustment, job.measurements, job.survey.side)
        points, snooping = s_transform(points), job.snooping
        # The selected points are not tested again: they are common to all runs.
        if self._wall is not None:
            points, snooping = _select_points(points, self._wall), False
        table = replace(
            job.table, step_m=STEP_M, height_unit="m", fine_step_m=None, fine_zones=(),
            max_interpolation_error_m3=None, other_densities_kg_m3=(),
        )  # fmt: skip
        job = replace(job, points=points, table=table, measurements=None, snooping=snooping)
        return run(job, simulated=False)


def _read_top_volume(result):
    """TopVolume of the result of a run."""
    height_m = float(result.table.height_m[-1])
    top, accepted = result.at(height_m), result.accepted
    points = None if accepted is None else len(accepted)
    values = (float(value) for value in (top.value_m3, top.u_m3, top.U_m3, top.k))
    return TopVolume(*values, height_m, points)


def _select_points(points, names):
    """Select the points with these names from a job.Points."""
    rows = np.array([i for i, name in enumerate(points.names) if name in names], dtype=int)
    # Columns x, y and z of each point in the covariance matrix
    columns = (3 * rows[:, None] + np.arange(3)).ravel()
    return replace(
        points,
        names=tuple(points.names[i] for i in rows),
        xyz_m=points.xyz_m[rows],
        covariance_m2=points.covariance_m2[np.ix_(columns, columns)],
        section=tuple(points.section[i] for i in rows),
        generatrix=tuple(points.generatrix[i] for i in rows),
        rows=tuple(points.rows[i] for i in rows),
        causes=tuple(replace(cause, column_m=cause.column_m[columns]) for cause in points.causes),
    )
