"""What the solver found, with the cofactors of anything that is asked for."""

from functools import cached_property

import numpy as np
import scipy.linalg

from tankcal.gauss_markov.loops import block_cofactors, leverage, roots


class Factor:
    """The factored reduced system: scale and Cholesky factor; eliminated parts in `normals`."""

    def __init__(self, normals, scale, lower, untouched, free):
        self.normals, self.scale, self.lower = normals, scale, lower
        self.untouched, self.free = untouched, free

    def whitened(self, columns):
        """L^-1 D columns, so that columns' S^-1 columns is a sum of squares; columns (nr, k)."""
        return scipy.linalg.solve_triangular(
            self.lower, columns * self.scale[:, None], lower=True, check_finite=False
        )

    def solved(self, columns):
        """S^-1 columns, columns (nr,) or (nr, k)."""
        scale = self.scale if columns.ndim == 1 else self.scale[:, None]
        return scale * scipy.linalg.cho_solve(
            (self.lower, True), scale * columns, check_finite=False
        )


class Solution:
    """A minimum of a Model.

    state        adjusted, as the model writes it
    cost         half the sum of squares of the rows
    misclosures  list of (n, m) whitened, computed minus observed, one array a group
    jacobians    list of (n, m, K) whitened, before the last (small) step
    iterations   until the last step was below the tolerance
    rows         number of rows that weigh anything
    unknowns     number of unknowns that are estimated
    rank_defect  number of directions that only the datum fixes
    """

    def __init__(self, model, plan, factor, state, misclosures, jacobians, cost, iterations):
        self.model, self.state, self.cost, self.iterations = model, state, cost, iterations
        self.misclosures, self.jacobians = misclosures, jacobians
        self._plan, self._factor = plan, factor
        self.rank_defect = 0 if factor.free is None else factor.free.shape[1]
        self.unknowns = model.unknowns
        self.rows = int(sum(np.count_nonzero(j.any(axis=2)) for j in jacobians))

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
        """(nr, nr) cofactor matrix of the reduced unknowns, in the datum of the factor."""
        inverse, info = scipy.linalg.lapack.dpotri(self._factor.lower, lower=1)
        if info:
            raise ValueError("a factor that was sound before cannot be inverted")
        inverse = np.tril(inverse)
        inverse += np.tril(inverse, -1).T
        inverse *= self._factor.scale
        inverse *= self._factor.scale[:, None]
        return inverse

    @cached_property
    def _of_blocks(self):
        return block_cofactors(self._plan, self._factor.normals, self.reduced_cofactors)

    @property
    def block_cofactors(self):
        """(nb, 3, 3) cofactor matrix of each eliminated block."""
        return self._of_blocks[0]

    def cofactors(self, columns):
        """Full cofactor matrix (k, k) of any unknowns, in the order given; columns (k,)."""
        columns, nr = np.asarray(columns), self._plan.reduced
        whitened = self._factor.whitened(self._through_reduced(columns))
        # whitened' whitened by syrk: half of the work of a product
        q = scipy.linalg.blas.dsyrk(1.0, whitened, trans=1, lower=1)
        q += np.tril(q, -1).T
        eliminated = np.flatnonzero(columns >= nr)
        if len(eliminated):
            block, axis = np.divmod(columns[eliminated] - nr, 3)
            self._add_own(q, eliminated, block, axis)
        return q

    def _through_reduced(self, columns):
        """How each unknown follows the reduced ones: (nr, k), d unknown / d reduced."""
        nr, starts = self._plan.reduced, self._plan.starts
        out = np.zeros((nr, len(columns)), order="F")
        own = np.flatnonzero(columns < nr)
        out[columns[own], own] = 1.0
        eliminated = np.flatnonzero(columns >= nr)
        block, axis = np.divmod(columns[eliminated] - nr, 3)
        count = starts[block + 1] - starts[block]
        to = np.repeat(eliminated, count)
        first = np.repeat(starts[block] - np.cumsum(count) + count, count)
        entry = first + np.arange(len(to))
        inverse = np.linalg.inv(roots(self._factor.normals))[block, :, axis]
        inverse = np.repeat(inverse, count, axis=0)
        wide = self._factor.normals.wide[entry]
        out[self._plan.columns[entry], to] = -np.einsum("ti,ti->t", wide, inverse)
        return out

    def _add_own(self, q, places, block, axis):
        """Add V^-1 between the unknowns at `places` that belong to one block."""
        inverse = np.linalg.inv(roots(self._factor.normals))
        inverse = inverse.transpose(0, 2, 1) @ inverse
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
        numbers = [np.ones(w.shape) for w in self.misclosures]
        cofactors, cross = self._of_blocks
        for batch in self._plan.batches:
            jac = batch.of(self.jacobians[batch.group])
            found = leverage(self._plan, batch, jac, self.reduced_cofactors, cross, cofactors)
            numbers[batch.group][batch.rows] -= found
        return numbers
