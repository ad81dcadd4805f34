"""What the solver found, with the cofactors of anything that is asked for."""

from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.solver.effects import back_substitute_covariance, back_substitution, times
from tankcal.solver.elimination import block_cofactors, leverage
from tankcal.solver.threads import threads_for


class Factor:
    """The factored reduced system: scale and Cholesky factor; eliminated parts in `normals`.

    tangent, reaction_part  where conditions hold exactly: their Tangent, and Q1' S Q, see there
    """

    def __init__(
        self, normals, scale, lower, untouched, null_space, datum_basis, tangent, reaction_part
    ):
        self.normals, self.scale, self.lower = normals, scale, lower
        self.untouched, self.null_space, self.datum_basis = untouched, null_space, datum_basis
        self.tangent, self.reaction_part = tangent, reaction_part

    def inverse(self):
        """(nr, nr) inverse of the reduced system; in the null space, where conditions hold."""
        inverse, info = self.lower, 0
        if inverse.size:
            inverse, info = scipy.linalg.lapack.dpotri(self.lower, lower=1)
        if info:
            raise ValueError("a factor that was sound before cannot be inverted")
        inverse = np.tril(inverse)
        inverse += np.tril(inverse, -1).T
        if self.tangent is not None:
            inverse = self.tangent.from_null_space(self.tangent.from_null_space(inverse).T)
        inverse *= self.scale
        inverse *= self.scale[:, None]
        return inverse

    def whitened(self, columns):
        """L^-1 D columns, so that columns' S^-1 columns is a sum of squares; columns (nr, k)."""
        scaled = columns * self.scale[:, None]
        if self.tangent is not None:
            scaled = self.tangent.in_null_space(scaled)
        return scipy.linalg.solve_triangular(self.lower, scaled, lower=True, check_finite=False)

    def solved(self, columns):
        """S^-1 columns, columns (nr,) or (nr, k)."""
        scale = self.scale if columns.ndim == 1 else self.scale[:, None]
        inner = scale * columns
        if self.tangent is not None:
            inner = self.tangent.in_null_space(inner)
        inner = scipy.linalg.cho_solve((self.lower, True), inner, check_finite=False)
        return scale * (inner if self.tangent is None else self.tangent.from_null_space(inner))


class Solution:
    """A minimum of a Model.

    state        adjusted, as the model writes it
    cost         half the sum of squares of the rows
    misclosures  list of (n, m) whitened, computed minus observed, one array a group
    iterations   until the last step was below the tolerance
    rows         number of rows that weigh anything
    unknowns     number of unknowns that are estimated, less those that exact conditions take
    nearly       Factor before the last step
    plan, factor, conditions  of the solver, for tankcal.solver.effects
    rank_defect  number of directions that only the datum fixes
    """

    def __init__(self, work, state, cost, iterations, factor, nearly):
        self.model, self.state, self.cost, self.iterations = work.model, state, cost, iterations
        self.misclosures = work.w
        self.plan, self._work, self._last = work.plan, work, factor
        self.conditions = work.conditions
        self.nearly = nearly
        self.rank_defect = 0
        if self.model.null_space is not None:
            self.rank_defect = self.model.null_space(state).shape[1]
        self.unknowns = self.model.unknowns
        if self.conditions:
            self.unknowns -= self.factor.tangent.rank
        self.rows = int(sum(np.count_nonzero(j.any(axis=2)) for j in work.jac))

    @cached_property
    def factor(self):
        """Normal equations at the solution itself, not before the last step."""
        if self._last is not None:
            return self._last
        self._work.evaluate(self.state)
        return self._work.factor(self.state, 0.0)

    @property
    def jacobians(self):
        """List of (n, m, K) whitened derivatives at the solution, one array a group."""
        return self.factor and self._work.jac

    @property
    def dof(self):
        """Rows minus unknowns, plus what the datum takes up."""
        return self.rows - self.unknowns + self.rank_defect

    @property
    def chi2(self):
        """Sum of squares of the rows, v'Pv."""
        return 2.0 * self.cost

    @property
    def variance_factor(self):
        """A-posteriori variance factor chi2 / dof; nan when nothing is redundant."""
        return self.chi2 / self.dof if self.dof > 0 else np.nan

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

    def cofactors(self, columns):
        """Full cofactor matrix (k, k) of any unknowns, in the order given; columns (k,)."""
        with threads_for(max(self.plan.reduced, len(columns))):
            return self._cofactors(np.asarray(columns))

    def _cofactors(self, columns):
        nr = self.plan.reduced
        whitened = self.factor.whitened(self._through_reduced(columns))
        q = whitened.T @ whitened
        eliminated = np.flatnonzero(columns >= nr)
        if len(eliminated):
            block, axis = np.divmod(columns[eliminated] - nr, 3)
            self._add_own(q, eliminated, block, axis)
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
        return times(self, matrix)

    def back_substitute_covariance(self, reduced):
        """Changes (unknowns, d) of all unknowns, when the reduced ones change by (nr, d)."""
        return back_substitute_covariance(self, reduced)

    @cached_property
    def back_substitution(self):
        """-V^-1 W' (3 nb, nr), how the blocks follow the reduced unknowns; dense or sparse."""
        return back_substitution(self)

    def _through_reduced(self, columns):
        """How each unknown follows the reduced ones: (nr, k), d unknown / d reduced."""
        nr, starts = self.plan.reduced, self.plan.starts
        out = np.zeros((nr, len(columns)), order="F")
        own = np.flatnonzero(columns < nr)
        out[columns[own], own] = 1.0
        eliminated = np.flatnonzero(columns >= nr)
        block, axis = np.divmod(columns[eliminated] - nr, 3)
        count = starts[block + 1] - starts[block]
        to = np.repeat(eliminated, count)
        first = np.repeat(starts[block] - np.cumsum(count) + count, count)
        entry = first + np.arange(len(to))
        inverse = np.repeat(self.inverse_roots[block, :, axis], count, axis=0)
        wide = self.factor.normals.wide[entry]
        out[self.plan.columns[entry], to] = -np.einsum("ti,ti->t", wide, inverse)
        return out

    @cached_property
    def inverse_roots(self):
        """L^-1 (nb, 3, 3) of each block."""
        a, b, c, d, e, f = self.factor.normals.v.T
        inverse = np.zeros((self.plan.blocks, 3, 3))
        inverse[:, 0, 0], inverse[:, 1, 1], inverse[:, 2, 2] = 1 / a, 1 / c, 1 / f
        inverse[:, 1, 0], inverse[:, 2, 1] = -b / (a * c), -e / (c * f)
        inverse[:, 2, 0] = (b * e / c - d) / (a * f)
        return inverse

    def _add_own(self, q, places, block, axis):
        """Add V^-1 between the unknowns at `places` that belong to one block."""
        inverse = self.inverse_roots.transpose(0, 2, 1) @ self.inverse_roots
        order = np.argsort(block, kind="stable")
        for shift in range(3):  # pairs that lie 0, 1 or 2 apart once sorted by block
            i, j = order[: len(order) - shift], order[shift:]
            same = block[i] == block[j]
            i, j = i[same], j[same]
            value = inverse[block[i], axis[i], axis[j]]
            q[places[i], places[j]] += value
            if shift:
                q[places[j], places[i]] += value

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
