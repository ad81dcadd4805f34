"""The covariance of many predicted points, as it acts and not as a matrix that is written out.

What a volume needs of all points together are products with a few columns: Q M comes from the
reduced normal equations, 3n times d numbers and not 3n times 3n.

Shifts and the turn about the vertical are taken out as `wall.s_transform` takes them out,
by its D and A: C' = C - D A' - A D'.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

from tankcal.pipeline.point_covariance import common_motions, s_transform_factors
from tankcal.solver.effects import covariances


@dataclass(frozen=True)
class PredictedCovariance:
    """Covariance (3n, 3n) of chosen points of a predicted network, among themselves.

    adjusted  network.Adjusted        points  (n,) numbers of the points there
    """

    adjusted: object
    points: np.ndarray

    @property
    def shape(self):
        """(3n, 3n)."""
        return (3 * len(self.points),) * 2

    def __matmul__(self, matrix):
        """C' matrix, (3n, d)."""
        return (
            self._in_frame(matrix)
            - self._basis @ (self._across.T @ matrix)
            - (self._across @ (self._basis.T @ matrix))
        )

    def _in_frame(self, matrix):
        """C matrix in the datum of the network."""
        columns = self.adjusted.problem.layout.points[self.points].ravel()
        found = covariances(self.adjusted.solution.cofactor, columns, matrix.T)
        return np.vstack([found, np.zeros((1, found.shape[1]))])[columns]

    @cached_property
    def _basis(self):
        return common_motions(self.adjusted.xyz_m[self.points])

    @cached_property
    def _across(self):
        trace = np.einsum("nii->", self.adjusted.point_covariances_m2[self.points])
        return s_transform_factors(self._basis, self._in_frame(self._basis), trace)

    def among(self, column):
        """A column (3n,) of one cause, without the common motions."""
        return column - self._basis @ (self._basis.T @ column)

    def diagonal(self):
        """(3n,) variances."""
        return self.of_each_point().diagonal()

    def written_out(self):
        """(3n, 3n) dense, for few points."""
        cross = self._basis @ self._across.T
        return self.adjusted.covariance_m2(self.points) - cross - cross.T

    def of_each_point(self):
        """Sparse (3n, 3n): the block of each point, nothing between them."""
        n = len(self.points)
        basis, across = (part.reshape(n, 3, 4) for part in (self._basis, self._across))
        cross = basis @ np.swapaxes(across, 1, 2)
        block = self.adjusted.point_covariances_m2[self.points] - cross - np.swapaxes(cross, 1, 2)
        return scipy.sparse.bsr_array((block, np.arange(n), np.arange(n + 1))).tocsr()
