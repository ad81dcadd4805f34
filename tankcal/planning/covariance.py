"""Covariance of many predicted points as an operator, without forming the dense matrix.

The volume needs only products of the covariance with a few columns. Q M follows from the reduced
normal equations with 3n times d numbers instead of 3n times 3n.

Common translations and the common rotation about the vertical are removed with D and A of
`wall.s_transform`: C' = C - D A' - A D'.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

from tankcal.pipeline.point_covariance import common_motions, s_transform_factors
from tankcal.solver.effects import covariances


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

    def among(self, column):
        """Effects (3n,) of one cause on the points, without the common motions."""
        return column - self._basis @ (self._basis.T @ column)

    def diagonal(self):
        """Variances, shape (3n,)."""
        return self.of_each_point().diagonal()

    def written_out(self):
        """Dense covariance (3n, 3n); for few points only."""
        cross = self._basis @ self._across.T  # D A'
        return self.adjusted.covariance_m2(self.points) - cross - cross.T

    def of_each_point(self):
        """Sparse matrix (3n, 3n) of the covariance blocks of single points, no correlations."""
        n = len(self.points)
        basis, across = (part.reshape(n, 3, 4) for part in (self._basis, self._across))
        cross = basis @ np.swapaxes(across, 1, 2)
        block = self.adjusted.point_covariances_m2[self.points] - cross - np.swapaxes(cross, 1, 2)
        return scipy.sparse.bsr_array((block, np.arange(n), np.arange(n + 1))).tocsr()
