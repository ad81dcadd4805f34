"""The factored normal equations, and the cofactors of anything that is asked for."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.solver.compiled import is_worth_compiling
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
from tankcal.solver.threads import threads_for

DENSE = 4e6  # numbers


@dataclass(frozen=True)
class Factor:
    """The factored reduced system, at a state.

    normals        Normals, the blocks eliminated
    scale          (nr,) of the columns             lower  Cholesky factor of the scaled system
    untouched      reduced unknowns in no row       null_space, datum_basis  (unknowns, d) or None
    tangent        Tangent of the exact conditions, None where there are none
    reaction_part  Q1' S Q of these conditions, see Tangent.square
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
        """(nr, nr) inverse of the reduced system; in the null space, where conditions hold."""
        inverse, info = self.lower, 0
        if inverse.size:
            inverse, info = scipy.linalg.lapack.dpotri(self.lower, lower=1)
        if info:
            raise ValueError("a factor that was sound before cannot be inverted")
        inverse = np.triu(inverse.T)  # row by row
        inverse += np.triu(inverse, 1).T
        if self.tangent is not None:
            inverse = self.tangent.from_null_space(self.tangent.from_null_space(inverse).T)
        inverse *= self.scale
        inverse *= self.scale[:, None]
        return np.ascontiguousarray(inverse)

    def whitened(self, columns):
        """L^-1 D columns, so that columns' S^-1 columns is a sum of squares; columns (nr, k)."""
        scaled = np.multiply(columns, self.scale[:, None], order="F")
        if self.tangent is not None:
            scaled = self.tangent.in_null_space(scaled)
        if not scaled.size:
            return scaled
        return scipy.linalg.blas.dtrsm(1.0, self.lower, scaled, lower=1, overwrite_b=1)

    def solved(self, columns):
        """S^-1 columns, columns (nr,) or (nr, k)."""
        scale = self.scale if columns.ndim == 1 else self.scale[:, None]
        inner = scale * columns
        if self.tangent is not None:
            inner = self.tangent.in_null_space(inner)
        if inner.size:
            inner, _ = scipy.linalg.lapack.dpotrs(self.lower, inner, lower=1)
        return scale * (inner if self.tangent is None else self.tangent.from_null_space(inner))


class Cofactors:
    """Cofactors of the unknowns of a Model, at its minimum, and of anything that hangs on them.

    model, plan, factor, conditions   of the solver; the Factor is that at the minimum
    state, rows                       the minimum, and the Rows as evaluated there
    """

    def __init__(self, work, state, factor):
        self.model, self.plan, self.conditions = work.model, work.plan, work.conditions
        self.factor, self.state, self.rows = factor, state, work.rows

    @property
    def misclosures(self):
        """Whitened misclosures (n, m) at the minimum, one array a group."""
        return self.rows.misclosures

    @cached_property
    def jacobians(self):
        """Whitened derivatives (n, m, K) at the minimum, one array a group."""
        return self.rows.derivatives(self.state)

    @cached_property
    def reduced_cofactors(self):
        """(nr, nr) cofactors of the reduced unknowns, before any inner constraints."""
        with threads_for(self.plan.reduced):
            return self.factor.inverse()

    @cached_property
    def of_blocks(self):
        """Cofactors (nb, 3, 3) of the blocks and (t, 3) of each with its reduced columns."""
        return block_cofactors(self.plan, self.factor.normals, self.reduced_cofactors)

    @property
    def block_cofactors(self):
        """(nb, 3, 3) cofactor matrix of each eliminated block."""
        own = self.of_blocks[0]
        if self.datum is None:
            return own
        columns = self.plan.reduced + np.arange(3 * self.plan.blocks).reshape(-1, 3)
        return self._in_datum(own, columns, columns)

    def reduced_blocks(self, columns):
        """Cofactors (n, k, k) of groups (n, k) of reduced unknowns; anything where one is -1."""
        if not self.plan.reduced:
            return np.zeros((*columns.shape, columns.shape[1]))
        own = self.reduced_cofactors[columns[:, :, None], columns[:, None, :]]
        return own if self.datum is None else self._in_datum(own, columns, columns)

    def among(self, columns):
        """Full cofactor matrix (k, k) of any unknowns, in the order given; columns (k,)."""
        with threads_for(max(self.plan.reduced, len(columns))):
            return self._cofactors(np.asarray(columns))

    def _cofactors(self, columns):
        normals = self.factor.normals
        through = through_reduced(self.plan, normals, columns)
        if len(columns) >= self.plan.reduced and is_worth_compiling(self.plan.rows):
            q = propagate_cofactors(np.ascontiguousarray(through.T), self.reduced_cofactors)
        else:
            whitened = self.factor.whitened(through)
            q = whitened.T @ whitened
        add_own_cofactors(self.plan, normals, columns, q)
        return q if self.datum is None else self._in_datum(q, columns, columns)

    @cached_property
    def datum(self):
        """What brings cofactors into the datum of the inner constraints, None when there are none.

        With T = I - G B C', B = (C'G)^-1: T Q T' = Q - G H' - H G' + G M G', H = Q C B', M = B C'H.
        """
        null_space, datum_basis = self.factor.null_space, self.factor.datum_basis
        if null_space is None:
            return None
        inverse = np.linalg.inv(datum_basis.T @ null_space)
        h = self.times(datum_basis) @ inverse.T
        return null_space, h, inverse @ (datum_basis.T @ h)

    def _in_datum(self, q, rows, columns):
        """Cofactors (..., r, k) between unknowns (..., r) and (..., k), brought into the datum."""
        null_space, h, m = self.datum
        g = np.swapaxes(null_space[columns], -1, -2)
        return (
            q
            - null_space[rows] @ np.swapaxes(h[columns], -1, -2)
            - h[rows] @ g
            + null_space[rows] @ m @ g
        )

    def times(self, matrix):
        """Cofactor matrix times a matrix (unknowns, d), in the datum of the factor."""
        nr, plan, normals = self.plan.reduced, self.plan, self.factor.normals
        wide, root = block_rows(plan, normals.wide), roots(normals)
        one_by_one, in_all = (plan.blocks, 3, matrix.shape[1]), (3 * plan.blocks, matrix.shape[1])
        own = np.linalg.solve(root, matrix[nr:].reshape(one_by_one)).reshape(in_all)
        reduced = self.factor.solved(matrix[:nr] - wide.T @ own)
        own = (own - wide @ reduced).reshape(one_by_one)
        blocks = np.linalg.solve(root.transpose(0, 2, 1), own)
        return np.concatenate([reduced, blocks.reshape(in_all)])

    def back_substitute_covariance(self, reduced):
        """Changes (unknowns, d) of all unknowns, when the reduced ones change by (nr, d)."""
        return np.concatenate([reduced, self.back_substitution @ reduced])

    @cached_property
    def back_substitution(self):
        """-V^-1 W' (3 nb, nr): how the blocks follow the reduced unknowns; sparse if large."""
        plan, normals = self.plan, self.factor.normals
        if not plan.blocks:
            return np.zeros((0, plan.reduced))
        found = -(self.block_diagonal @ block_rows(plan, normals.wide))
        return found.toarray() if 3 * plan.blocks * plan.reduced < DENSE else found.tocsr()

    @cached_property
    def block_diagonal(self):
        """L^-T of all blocks as one sparse matrix (3 nb, 3 nb)."""
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
        """J Q J' of each row (n, m) of a group; jac (n, m, K) ordered as the group's."""
        out = np.zeros(jac.shape[:2])
        cofactors, cross = self.of_blocks
        for batch in self.plan.batches:
            if batch.group == group:
                out[batch.rows] = leverage(
                    self.plan, batch, batch.of(jac), self.reduced_cofactors, cross, cofactors
                )
        return out

    def leverage_of_datum(self, columns, jac):
        """What the datum adds to J Q J' of rows (n, m), columns (n, K): J (T Q T' - Q) J'.

        It is nothing but for rows that feel a motion of the whole that no other row holds.
        """
        if not len(columns) or self.datum is None:
            return np.zeros(jac.shape[:2])
        change = self._in_datum(0.0, columns, columns)
        jac = np.where(columns[:, None] < 0, 0.0, jac)
        return np.einsum("nmk,nkl,nml->nm", jac, change, jac)
