"""Factored normal equations, and cofactors of unknowns and of functions of unknowns."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.covariance import PointCovariance
from tankcal.solver.compiled import is_worth_compiling, threads_for
from tankcal.solver.elimination import (
    add_own_cofactors,
    block_cofactors,
    block_rows,
    inverse_roots,
    leverage,
    roots,
    through_reduced,
)
from tankcal.solver.propagate import propagate_cofactors

DENSE = 4e6  # elements up to which the back substitution is stored as a dense matrix


@dataclass(frozen=True)
class Factor:
    """Factored reduced normal equations at a state.

    Attributes
    ----------
    normals : Normals
        Normal equations after elimination of the blocks.
    scale : ndarray, shape (nr,)
        Scale factors D of the columns.
    lower : ndarray, shape (r, r)
        Cholesky factor L of the scaled system; r is less than nr with exact conditions.
    untouched : ndarray of int
        Reduced unknowns that occur in no row.
    null_space, datum_basis : ndarray, shape (unknowns, d), or None
        Directions fixed only by the datum, and the part of the directions that defines the datum.
    tangent : Tangent or None
        Tangent of the exact conditions.
    reaction_part : ndarray, shape (rank, nr), or None
        Q1' S Q of the exact conditions, see Tangent.square.
    """

    normals: object
    scale: np.ndarray
    lower: np.ndarray
    untouched: np.ndarray
    null_space: np.ndarray | None
    datum_basis: np.ndarray | None
    tangent: object
    reaction_part: np.ndarray | None

    def inverse(self):
        """Inverse (nr, nr) of the reduced system; restricted to the null space of exact conditions.

        Raises
        ------
        ValueError
            If the factor is singular.
        """
        inverse, info = self.lower, 0
        if inverse.size:
            inverse, info = scipy.linalg.lapack.dpotri(self.lower, lower=1)
        if info:
            raise ValueError("a factor that was sound before cannot be inverted")
        # LAPACK fills the lower half in column order; its transpose is the upper half in row order.
        inverse = inverse.T
        np.copyto(inverse, inverse.T, where=np.tri(len(inverse), k=-1, dtype=bool))
        # Q2 (Q2'SQ2)^-1 Q2': each call multiplies by Q2 from the left.
        if self.tangent is not None:
            inverse = self.tangent.from_null_space(self.tangent.from_null_space(inverse).T)
        # S^-1 = D (D S D)^-1 D.
        inverse *= self.scale
        inverse *= self.scale[:, None]
        return np.ascontiguousarray(inverse)

    def whitened(self, columns):
        """Multiply columns (nr, k) by L^-1 D.

        The sum of squares of the result is columns' S^-1 columns.
        """
        scaled = np.multiply(columns, self.scale[:, None], order="F")
        if self.tangent is not None:
            scaled = self.tangent.in_null_space(scaled)
        if not scaled.size:
            return scaled
        return scipy.linalg.blas.dtrsm(1.0, self.lower, scaled, lower=1, overwrite_b=1)

    def solved(self, columns):
        """Multiply columns, (nr,) or (nr, k), by S^-1."""
        scale = self.scale if columns.ndim == 1 else self.scale[:, None]
        scaled = scale * columns
        if self.tangent is not None:
            scaled = self.tangent.in_null_space(scaled)
        if scaled.size:
            scaled, _ = scipy.linalg.lapack.dpotrs(self.lower, scaled, lower=1)
        return scale * (scaled if self.tangent is None else self.tangent.from_null_space(scaled))


class Cofactors:
    """Cofactors of the unknowns of a Model at its minimum, and of functions of the unknowns.

    Parameters
    ----------
    work : object
        Model, plan, exact conditions and rows of a solution.
    state : object
        The state at the minimum.
    factor : Factor
        Factored normal equations at the minimum.

    Attributes
    ----------
    model, plan, factor, conditions
        Of the solver.
    state, rows
        The state at the minimum, and the Rows evaluated at this state.
    """

    def __init__(self, work, state, factor):
        self.model, self.plan, self.conditions = work.model, work.plan, work.conditions
        self.factor, self.state, self.rows = factor, state, work.rows

    @property
    def misclosures(self):
        """Whitened misclosures (n, m) at the minimum, one array for each group."""
        return self.rows.misclosures

    @cached_property
    def jacobians(self):
        """Whitened derivatives (n, m, K) at the minimum, one array for each group."""
        return self.rows.derivatives(self.state)

    @cached_property
    def reduced_cofactors(self):
        """Cofactors (nr, nr) of the reduced unknowns, before the datum transformation."""
        with threads_for(self.plan.reduced):
            return self.factor.inverse()

    @cached_property
    def of_blocks(self):
        """Cofactors (nb, 3, 3) of the blocks, and (t, 3) between blocks and reduced unknowns."""
        return block_cofactors(self.plan, self.factor.normals, self.reduced_cofactors)

    @property
    def block_cofactors(self):
        """Cofactors (nb, 3, 3) of each eliminated block, in the datum."""
        cofactors = self.of_blocks[0]
        if self.datum is None:
            return cofactors
        columns = self.plan.reduced + np.arange(3 * self.plan.blocks).reshape(-1, 3)
        return self._transform_to_datum(cofactors, columns, columns)

    def reduced_blocks(self, columns):
        """Cofactors (n, k, k) of groups of reduced unknowns, in the datum.

        Parameters
        ----------
        columns : ndarray of int, shape (n, k)
            Reduced unknowns of each group; elements with a column of -1 are arbitrary.

        Returns
        -------
        ndarray, shape (n, k, k)
        """
        if not self.plan.reduced:
            return np.zeros((*columns.shape, columns.shape[1]))
        cofactors = self.reduced_cofactors[columns[:, :, None], columns[:, None, :]]
        return (
            cofactors
            if self.datum is None
            else self._transform_to_datum(cofactors, columns, columns)
        )

    def among(self, columns):
        """Cofactor matrix of selected unknowns, in the datum.

        Parameters
        ----------
        columns : array_like of int, shape (k,)
            Indices of the unknowns.

        Returns
        -------
        ndarray, shape (k, k)
            In the order of `columns`.
        """
        with threads_for(max(self.plan.reduced, len(columns))):
            return self._cofactors(np.asarray(columns))

    def _cofactors(self, columns):
        normals = self.factor.normals
        # The unknowns are functions of the reduced unknowns plus an independent part of their
        # block, so that Q = P S^-1 P' + V^-1 within a block.
        propagation = through_reduced(self.plan, normals, columns)
        # Many unknowns: the sparse product P S^-1 P'. Few unknowns: the sum of squares of
        # L^-1 D P', which needs no inverse.
        if len(columns) >= self.plan.reduced and is_worth_compiling(self.plan.rows):
            q = propagate_cofactors(np.ascontiguousarray(propagation.T), self.reduced_cofactors)
        else:
            whitened = self.factor.whitened(propagation)
            q = whitened.T @ whitened
        add_own_cofactors(self.plan, normals, columns, q)
        return q if self.datum is None else self._transform_to_datum(q, columns, columns)

    def point_covariance(self, columns):
        """`PointCovariance` of points, in the datum.

        Parameters
        ----------
        columns : ndarray of int, shape (k, 3)
            Unknowns of each point: a block, or reduced unknowns; -1 for a fixed coordinate.

        Returns
        -------
        PointCovariance

        Notes
        -----
        Q_bb = V^-1 + V^-1 W S^-1 W' V^-1: a point adds the block V^-1 and follows the
        reduced unknowns. A point of reduced unknowns adds no block.
        """
        nr = self.plan.reduced
        blocks = np.zeros((len(columns), 3, 3))
        eliminated = columns[:, 0] >= nr
        root = self.inverse_roots[(columns[eliminated, 0] - nr) // 3]
        blocks[eliminated] = root.transpose(0, 2, 1) @ root
        # The additional last row serves fixed coordinates.
        rows = np.where(columns < 0, nr + 3 * self.plan.blocks, columns).ravel()
        by_reduced = scipy.sparse.vstack(
            [
                scipy.sparse.eye_array(nr),
                scipy.sparse.csr_array(self.back_substitution),
                scipy.sparse.csr_array((1, nr)),
            ],
            format="csr",
        )
        by_reduced = by_reduced[rows]
        if len(rows) * nr < DENSE:
            by_reduced = by_reduced.toarray()
        covariance = PointCovariance(blocks, by_reduced, self.reduced_cofactors)
        if self.datum is None:
            return covariance
        null_space, h, m = (np.vstack([part, np.zeros(part.shape[1])]) for part in self.datum)
        eye = np.eye(len(m) - 1)
        joint = np.block([[m[:-1], -eye], [-eye, np.zeros_like(eye)]])
        return covariance.add_columns(np.hstack([null_space[rows], h[rows]]), joint)

    @cached_property
    def datum(self):
        """Matrices of the datum transformation (S-transformation); None without inner constraints.

        Notes
        -----
        With T = I - G B C' and B = (C'G)^-1:

            T Q T' = Q - G H' - H G' + G M G',   H = Q C B',   M = B C'H

        Returns G, H and M.
        """
        null_space, datum_basis = self.factor.null_space, self.factor.datum_basis
        if null_space is None:
            return None
        inverse = np.linalg.inv(datum_basis.T @ null_space)
        h = self.times(datum_basis) @ inverse.T
        return null_space, h, inverse @ (datum_basis.T @ h)

    def _transform_to_datum(self, q, rows, columns):
        """Transform cofactors (..., r, k) between unknowns (..., r) and (..., k) to the datum."""
        null_space, h, m = self.datum
        g = np.swapaxes(null_space[columns], -1, -2)
        # T Q T' = Q - G H' - H G' + G M G', only for the requested elements.
        return (
            q
            - null_space[rows] @ np.swapaxes(h[columns], -1, -2)
            - h[rows] @ g
            + null_space[rows] @ m @ g
        )

    def times(self, matrix):
        """Multiply the cofactor matrix by a matrix (unknowns, d), in the datum of the factor."""
        nr, plan, normals = self.plan.reduced, self.plan, self.factor.normals
        wide, root = block_rows(plan, normals.wide), roots(normals)
        block_shape, flat_shape = (
            (plan.blocks, 3, matrix.shape[1]),
            (3 * plan.blocks, matrix.shape[1]),
        )
        # Forward elimination of the blocks: L y = right-hand side.
        whitened = np.linalg.solve(root, matrix[nr:].reshape(block_shape)).reshape(flat_shape)
        # Reduced system S x = right-hand side - W' V^-1 right-hand side of the blocks.
        reduced = self.factor.solved(matrix[:nr] - wide.T @ whitened)
        # Back substitution into the blocks.
        whitened = (whitened - wide @ reduced).reshape(block_shape)
        blocks = np.linalg.solve(root.transpose(0, 2, 1), whitened)
        return np.concatenate([reduced, blocks.reshape(flat_shape)])

    def back_substitute_covariance(self, reduced):
        """Changes (unknowns, d) of all unknowns for changes (nr, d) of the reduced unknowns."""
        return np.concatenate([reduced, self.back_substitution @ reduced])

    @cached_property
    def back_substitution(self):
        """Derivatives -V^-1 W' (3 nb, nr) of the blocks by reduced unknowns; sparse if large."""
        plan, normals = self.plan, self.factor.normals
        if not plan.blocks:
            return np.zeros((0, plan.reduced))
        changes = -(self.block_diagonal @ block_rows(plan, normals.wide))
        return changes.toarray() if 3 * plan.blocks * plan.reduced < DENSE else changes.tocsr()

    @cached_property
    def block_diagonal(self):
        """L^-T of all blocks as a sparse matrix (3 nb, 3 nb)."""
        blocks = self.plan.blocks
        return scipy.sparse.bsr_array(
            (self.inverse_roots.transpose(0, 2, 1), np.arange(blocks), np.arange(blocks + 1)),
            shape=(3 * blocks, 3 * blocks),
        )

    @cached_property
    def inverse_roots(self):
        """L^-1 (nb, 3, 3) of each block."""
        return inverse_roots(self.factor.normals)

    def redundancy(self):
        """Redundancy numbers, a list of (n, m): the part of each error that its residual shows."""
        return [1.0 - self.leverage(g, jac) for g, jac in enumerate(self.jacobians)]

    def leverage(self, group, jac):
        """Leverage J Q J' of the rows of a group.

        Parameters
        ----------
        group : int
            Index of the group.
        jac : ndarray, shape (n, m, K)
            Derivatives, ordered as in the group.

        Returns
        -------
        ndarray, shape (n, m)
        """
        out = np.zeros(jac.shape[:2])
        cofactors, cross = self.of_blocks
        for batch in self.plan.batches:
            if batch.group == group:
                out[batch.rows] = leverage(
                    self.plan, batch, batch.of(jac), self.reduced_cofactors, cross, cofactors
                )
        return out

    def leverage_of_datum(self, columns, jac):
        """Contribution J (T Q T' - Q) J' of the datum to the leverage of rows.

        Parameters
        ----------
        columns : ndarray of int, shape (n, K)
            Unknown of each derivative, -1 for a fixed unknown.
        jac : ndarray, shape (n, m, K)
            Derivatives.

        Returns
        -------
        ndarray, shape (n, m)

        Notes
        -----
        The contribution is zero, except for rows that depend on a motion of the whole network to
        which no other row is sensitive.
        """
        if not len(columns) or self.datum is None:
            return np.zeros(jac.shape[:2])
        # T Q T' - Q is the transformation of a zero matrix.
        change = self._transform_to_datum(0.0, columns, columns)
        jac = np.where(columns[:, None] < 0, 0.0, jac)
        return np.einsum("nmk,nkl,nml->nm", jac, change, jac)
