"""Predict the table of a surveyed tank: wall, volumes and U of every row, and the limit of a plan.

The covariance of many predicted points is an operator; the dense matrix is not formed. The volume
needs only products of the covariance with a few columns. Q M follows from the reduced normal
equations with 3n times d numbers instead of 3n times 3n.

Common translations and the common rotation about the vertical are removed with D and A of
`wall.s_transform`: C' = C - D A' - A D'.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.model import Job
from tankcal.messages import message
from tankcal.pipeline.checks.survey import refuse_undetermined
from tankcal.pipeline.statements import MINIMA_M, statements
from tankcal.pipeline.table import ComputedTable, compute_table
from tankcal.pipeline.tanks.vertical import volume_by_points
from tankcal.pipeline.wall.finding import find_wall
from tankcal.pipeline.wall.point_covariance import common_motions, s_transform_factors
from tankcal.pipeline.wall.surveyed import Wall
from tankcal.solver.effects import covariances
from tankcal.survey.points import Points
from tankcal.survey.results import causes_of
from tankcal.survey.wall import move_to_wall

MANY = 400  # largest number of points whose dense covariance weights the outlines


@dataclass(frozen=True)
class PredictedCovariance:
    """Covariance (3n, 3n) of selected points of a predicted network.

    adjusted: network.Adjusted; points: indices (n,) of the points in the network.
    """

    adjusted: object
    points: np.ndarray

    @property
    def shape(self):
        """Shape of the covariance, (3n, 3n)."""
        return (3 * len(self.points),) * 2

    def __matmul__(self, matrix):
        """Product of C' and a matrix, shape (3n, d)."""
        return (
            self._in_frame(matrix)
            - self._basis @ (self._across.T @ matrix)
            - (self._across @ (self._basis.T @ matrix))
        )

    def _in_frame(self, matrix):
        """Product of C, in the datum of the network, and a matrix."""
        columns = self.adjusted.problem.layout.points[self.points].ravel()
        product = covariances(self.adjusted.solution.cofactor, columns, matrix.T)
        return np.vstack([product, np.zeros((1, product.shape[1]))])[columns]

    @cached_property
    def _basis(self):
        return common_motions(self.adjusted.xyz_m[self.points])

    @cached_property
    def _across(self):
        trace = np.einsum("nii->", self.adjusted.point_covariances_m2[self.points])
        # The trace of C determines s2 of A = C D - D (D'C D + s2 I) / 2.
        return s_transform_factors(self._basis, self._in_frame(self._basis), trace)

    def remove_common_motions(self, column):
        """Effects (3n,) of one cause on the points, without the common motions."""
        return column - self._basis @ (self._basis.T @ column)

    def diagonal(self):
        """Variances, shape (3n,)."""
        return self.block_diagonal().diagonal()

    def dense(self):
        """Dense covariance (3n, 3n); for few points only."""
        cross = self._basis @ self._across.T  # D A'
        return self.adjusted.covariance_m2(self.points) - cross - cross.T

    def block_diagonal(self):
        """Sparse matrix (3n, 3n) of the covariance blocks of single points, no correlations."""
        n = len(self.points)
        basis, across = (part.reshape(n, 3, 4) for part in (self._basis, self._across))
        cross = basis @ np.swapaxes(across, 1, 2)
        block = self.adjusted.point_covariances_m2[self.points] - cross - np.swapaxes(cross, 1, 2)
        return scipy.sparse.bsr_array((block, np.arange(n), np.arange(n + 1))).tocsr()


@dataclass(frozen=True)
class PredictedTable:
    """Predicted wall, capacity table and statements.

    job is the plan's job with the points of the wall; covariance is the PredictedCovariance of the
    accepted points.
    """

    job: Job
    wall: Wall
    computed_table: ComputedTable
    covariance: PredictedCovariance

    @cached_property
    def stated(self):
        """Budgets and worst deliveries (`statements.Statements`)."""
        return statements(
            self.job, self.computed_table.table, self.computed_table.straightness.largest_m3
        )

    @property
    def by_points_m2(self):
        """Derivative (3n,) of the full tank's volume by coordinates of the accepted points."""
        return volume_by_points(self.job, self.wall, [self.computed_table.body.highest_m])[0]


def predict_table(plan, network):
    """Return the PredictedTable of a Plan and its surveys.Predicted.

    Raises SolutionError if the vertical or the scale is not determined, and InputError if a section
    or course keeps too few targets.
    """
    targets, covariance = _find_determined(plan, network)
    job = replace(plan.job, points=_points(plan, targets, covariance), measurements=None)
    wall = find_wall(job, lambda text: None, amplitudes=plan.amplitudes)
    if len(wall.accepted) < len(targets):
        covariance = PredictedCovariance(covariance.adjusted, covariance.points[wall.accepted])
    wall = replace(wall, covariance_m2=covariance)
    return PredictedTable(job, wall, compute_table(job, wall), covariance)


def recompute_table(plan, network, before):
    """Return the PredictedTable of a Plan with the wall of another plan.

    Outlines keep their weights; uncertainties are propagated with the new covariance.

    Parameters
    ----------
    plan : Plan
    network : Predicted
        Predicted network of the plan.
    before : PredictedTable
        Prediction of a plan with the same targets and tank.

    Returns
    -------
    PredictedTable or None
        None if the walls differ.
    """
    targets, covariance = _find_determined(plan, network)
    known = before.job.points
    names = tuple(plan.targets.names[i] for i in targets)
    if names != known.names or len(before.wall.accepted) < len(names):
        return None
    points = replace(known, causes=_causes(covariance))
    job = replace(before.job, points=points)
    wall = replace(before.wall, covariance_m2=covariance)
    return PredictedTable(job, wall, compute_table(job, wall), covariance)


def _find_determined(plan, network):
    """Return the indices of the determined targets, and their PredictedCovariance."""
    refuse_undetermined(network.frame.report)
    adjusted = network.adjusted
    place = {name: i for i, name in enumerate(adjusted.survey.points)}
    indices = [i for i, name in enumerate(plan.targets.names) if name in place]
    indices = [i for i in indices if not adjusted.problem.set_aside[place[plan.targets.names[i]]]]
    if not indices:
        raise SolutionError(
            message("plan_no_target_determined", "no target of the wall would be determined")
        )
    points = np.array([place[plan.targets.names[i]] for i in indices])
    return indices, PredictedCovariance(adjusted, points)


def _causes(covariance):
    """Return the common causes of error of the wall points, without their common motions."""
    causes = causes_of(covariance.adjusted, covariance.points, 1.0)
    return tuple(
        replace(cause, column_m=covariance.remove_common_motions(cause.column_m))
        for cause in causes
    )


def _points(plan, indices, covariance):
    """Return job.Points of the wall.

    A smoothed outline weights its points with their covariance. With more than MANY points, it uses
    the covariance of single points. The weights change slightly; the propagation does not.
    """
    targets, adjusted = plan.targets, covariance.adjusted
    section = tuple(targets.section[i] for i in indices)
    is_small = len(indices) <= MANY
    written = covariance.dense() if is_small else covariance.block_diagonal()
    outwards = targets.offset_m * (1.0 if plan.shell.is_outside else -1.0)
    return Points(
        names=tuple(targets.names[i] for i in indices),
        xyz_m=move_to_wall(adjusted.xyz_m[covariance.points], np.full(len(indices), outwards)),
        sd_m=None,
        covariance_m2=written,
        section=section,
        generatrix=tuple(targets.generatrix[i] for i in indices),
        rows=(None,) * len(indices),
        causes=_causes(covariance),
        from_adjustment=True,
    )


# ---- the limit of a plan


def relative_u_of(result, limits):
    """U over volume of the full tank, or of the worst delivery of the smallest minimum."""
    if limits.quantity == "delivery":
        return float(result.stated.worst[0].relative.relative)
    table = result.computed_table.table
    return float(table.U_m3[-1] / table.volume_m3[-1])


class TableResults:
    """Mixin: properties of a prediction from its table (`tabled`) and its plan (`plan`)."""

    @property
    def table(self):
        """Capacity table with U of every row (`capacity.Capacity`)."""
        return self.result.computed_table.table

    @property
    def relative_u(self):
        """U over volume of the limited quantity: the full tank or the worst delivery."""
        return relative_u_of(self.result, self.plan.limits)

    @property
    def meets(self):
        """Whether the limit is met; None if the plan has no limit."""
        limit = self.plan.limits.relative_u
        return None if limit is None else bool(self.relative_u <= limit)


def refuse_without_delivery(plan, result, tall):
    """Raise InputError if the limit is for deliveries and no delivery of the table is long enough.

    Parameters
    ----------
    plan : Plan or WallPlan
    result : PredictedTable or WallTable
    tall : float
        Height of the shell, m.
    """
    if plan.limits.quantity == "delivery" and not result.stated.worst:
        least = min(plan.job.table.minimum_delivery_m or MINIMA_M)
        file, row, name = plan.limits.place
        expected = message(
            "plan_no_delivery",
            "no delivery of {least:g} m or more in a shell of {tall:g} m; expected "
            "top, or a smaller table.minimum_delivery_m",
            least=least,
            tall=tall,
        )
        raise InputError(Problem(file, expected, row, name))
