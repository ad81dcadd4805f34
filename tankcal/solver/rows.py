"""Rows of a Model, evaluated and added to the normal equations in parts.

Only the misclosures of all rows are stored. The derivatives of a part remain in the cache of the
processor until they are added. The next part overwrites them. In a large network, all derivatives
would need more memory than all other data.
"""

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from tankcal.solver.compiled import problem_of
from tankcal.solver.elimination import add_rows
from tankcal.solver.model import Normals, plan

PART = 4096  # observations evaluated together


@dataclass(frozen=True)
class Part:
    """Observations of one group that are evaluated together.

    Attributes
    ----------
    fill : callable
        As in Group, for these observations.
    batches : tuple of Batch
        Batches with rows counted within the part.
    w, jac : ndarray, shape (n, m) and (n, m, K)
        Filled by `fill`; the parts of a group share their jac.
    """

    fill: object
    batches: tuple
    w: np.ndarray
    jac: np.ndarray


class Rows:
    """Rows of a Model and their normal equations.

    Parameters
    ----------
    model : Model
        The model.

    Attributes
    ----------
    plan : Plan
        Structure of the normal equations.
    normals : Normals
        Normal equations of the last evaluation.
    misclosures : tuple of ndarray, shape (n, m)
        Whitened misclosures of the last evaluation, one array for each group.
    parts : tuple of Part
        All parts.
    reach : tuple of int
        Length of the wide part used by each part and the parts before it.
    count : int
        Number of rows.
    weighing : int or None
        Number of rows with a non-zero derivative.
    """

    def __init__(self, model):
        self.model = model
        self.plan = plan(model.reduced, model.blocks, model.groups)
        self.normals = Normals.empty(self.plan)
        self.misclosures = tuple(np.zeros((len(g.columns), g.rows)) for g in model.groups)
        self.parts = tuple(part for g in range(len(model.groups)) for part in self._parts(g))
        self.reach = tuple(accumulate((self._reach(part) for part in self.parts), max))
        self.count = sum(w.size for w in self.misclosures)
        self.weighing = None

    def _parts(self, number):
        group, w = self.model.groups[number], self.misclosures[number]
        batches = [batch for batch in self.plan.batches if batch.group == number]
        n, width = group.columns.shape
        divided = self.plan.blocks and group.part and n > PART
        if not divided or not all(isinstance(batch.rows, slice) for batch in batches):
            return [Part(group.fill, tuple(batches), w, np.zeros((n, group.rows, width)))]
        # The parts share one array for their derivatives, which stays in the cache.
        jac, parts = np.zeros((PART, group.rows, width)), []
        for start in range(0, n, PART):
            rows = slice(start, min(start + PART, n))
            batches_within = (_restrict_batch(batch, rows, n) for batch in batches)
            batches_within = tuple(batch for batch in batches_within if len(batch.first))
            parts.append(Part(group.part(rows), batches_within, w[rows], jac[: rows.stop - start]))
        return parts

    def _reach(self, part):
        blocks = [batch.block for batch in part.batches if batch.block is not None]
        last = max((block.max(initial=-1) for block in blocks), default=-1)
        return 3 * self.plan.starts[last + 1]

    def add(self, state, most=np.inf):
        """Evaluate all rows at a state and add them to new normal equations.

        Parameters
        ----------
        state : object
            The state.
        most : float, optional
            Limit of the cost: the evaluation stops as soon as the cost exceeds it.

        Returns
        -------
        float
            Cost: half the sum of squares; infinite above the limit, or if it is not finite.
        """
        with problem_of(self.plan.rows):
            return self._add(state, most)

    def _add(self, state, most):
        self.normals.clear()
        wide, cleared = self.normals.wide, 0
        cost, weighing = 0.0, 0
        for part, reach in zip(self.parts, self.reach, strict=True):
            # Cleared immediately before use, so that it stays in the cache.
            wide[cleared:reach] = 0.0
            cleared = reach
            part.fill(state, part.w, part.jac)
            cost += 0.5 * float(np.vdot(part.w, part.w))
            if most < np.inf and not cost <= most:
                return np.inf
            for batch in part.batches:
                add_rows(self.plan, batch, batch.of(part.w), batch.of(part.jac), self.normals)
            # Derivatives that are zero at the start may become non-zero later; count until all rows
            # have one.
            if self.weighing != self.count:
                weighing += int(np.count_nonzero(part.jac.any(axis=2)))
        wide[cleared:] = 0.0
        if self.weighing != self.count:
            self.weighing = weighing
        return cost if np.isfinite(cost) else np.inf

    def evaluate(self, state):
        """Evaluate the misclosures at a state, without derivatives.

        Parameters
        ----------
        state : object
            The state.

        Returns
        -------
        float
            Half the sum of squares.
        """
        with problem_of(self.plan.rows):
            for part in self.parts:
                part.fill(state, part.w, part.jac[:0])
        return 0.5 * sum(float(np.vdot(w, w)) for w in self.misclosures)

    def derivatives(self, state):
        """Whitened derivatives (n, m, K) at a state, one array for each group."""
        jacobians = []
        for group in self.model.groups:
            n, width = group.columns.shape
            w, jac = np.empty((n, group.rows)), np.zeros((n, group.rows, width))
            with problem_of(self.plan.rows):
                group.fill(state, w, jac)
            jacobians.append(jac)
        return tuple(jacobians)


def _restrict_batch(batch, part, n):
    """Restrict a Batch, whose rows are a slice of n observations, to a part of the rows."""
    first, end, _ = batch.rows.indices(n)
    begin, stop = max(first, part.start), min(end, part.stop)
    # Relative to the batch; the rows of the result are relative to the part.
    selection = slice(begin - first, max(begin, stop) - first)
    return replace(
        batch,
        rows=slice(begin - part.start, stop - part.start),
        block=None if batch.block is None else batch.block[selection],
        first=batch.first[selection],
        place=None if batch.place is None else batch.place[selection],
    )
