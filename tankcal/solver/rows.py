"""The rows of a Model: evaluated and added to the normal equations one part after the other.

Only the misclosures of all rows are kept. The derivatives of a part stay in the processor's cache
until they have been added, and are written over by those of the next: of a large network they
would take more memory than everything else together.
"""

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from tankcal.solver.compiled import problem_of
from tankcal.solver.elimination import add_rows
from tankcal.solver.model import Normals, plan

PART = 4096  # observations that are evaluated at a time


@dataclass(frozen=True)
class Part:
    """Observations of one group that are evaluated together.

    fill     see Group, of these alone       batches  their Batches, rows counted within the part
    w, jac   (n, m) and (n, m, K), filled; the jac of a part is that of others of its group, too
    """

    fill: object
    batches: tuple
    w: np.ndarray
    jac: np.ndarray


class Rows:
    """The rows of a Model and their normal equations.

    plan         Plan of all groups                   normals  Normals, as they were added last
    misclosures  tuple of (n, m) whitened, one array a group, as they were evaluated last
    parts        tuple of Part
    reach        how far into the wide part of the normal equations each or those before it reach
    count        number of rows                       weighing  of those with any derivative
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
        jac, parts = np.zeros((PART, group.rows, width)), []
        for start in range(0, n, PART):
            rows = slice(start, min(start + PART, n))
            mine = (_within(batch, rows, n) for batch in batches)
            mine = tuple(batch for batch in mine if len(batch.first))
            parts.append(Part(group.part(rows), mine, w[rows], jac[: rows.stop - start]))
        return parts

    def _reach(self, part):
        blocks = [batch.block for batch in part.batches if batch.block is not None]
        last = max((block.max(initial=-1) for block in blocks), default=-1)
        return 3 * self.plan.starts[last + 1]

    def add(self, state, most=np.inf):
        """Evaluate all rows at a state, add them to new normal equations; see `evaluate`.

        Where half the sum of squares comes out above `most` the rest is left out: infinity.
        """
        with problem_of(self.plan.rows):
            return self._add(state, most)

    def _add(self, state, most):
        self.normals.clear()
        wide, cleared = self.normals.wide, 0
        cost, weighing = 0.0, 0
        for part, reach in zip(self.parts, self.reach, strict=True):
            wide[cleared:reach] = 0.0  # just before it is added to: so it stays in the cache
            cleared = reach
            part.fill(state, part.w, part.jac)
            cost += 0.5 * float(np.vdot(part.w, part.w))
            if most < np.inf and not cost <= most:
                return np.inf
            for batch in part.batches:
                add_rows(self.plan, batch, batch.of(part.w), batch.of(part.jac), self.normals)
            if self.weighing != self.count:
                weighing += int(np.count_nonzero(part.jac.any(axis=2)))
        wide[cleared:] = 0.0
        if self.weighing != self.count:  # a row may have none at the start alone
            self.weighing = weighing
        return cost if np.isfinite(cost) else np.inf

    def evaluate(self, state):
        """Misclosures at a state without derivatives; half their sum of squares."""
        with problem_of(self.plan.rows):
            for part in self.parts:
                part.fill(state, part.w, part.jac[:0])
        return 0.5 * sum(float(np.vdot(w, w)) for w in self.misclosures)

    def derivatives(self, state):
        """Derivatives (n, m, K) of each group at a state, whitened: a tuple."""
        found = []
        for group in self.model.groups:
            n, width = group.columns.shape
            w, jac = np.empty((n, group.rows)), np.zeros((n, group.rows, width))
            with problem_of(self.plan.rows):
                group.fill(state, w, jac)
            found.append(jac)
        return tuple(found)


def _within(batch, part, n):
    """What of a Batch, whose rows are a slice of n observations, lies in a part of them."""
    first, end, _ = batch.rows.indices(n)
    begin, stop = max(first, part.start), min(end, part.stop)
    mine = slice(begin - first, max(begin, stop) - first)
    return replace(
        batch,
        rows=slice(begin - part.start, stop - part.start),
        block=None if batch.block is None else batch.block[mine],
        first=batch.first[mine],
        place=None if batch.place is None else batch.place[mine],
    )
