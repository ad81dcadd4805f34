"""Gauss-Newton on the reduced normal equations; damped only when the cost rises."""

import numpy as np
import scipy.linalg

from tankcal.errors import SolutionError
from tankcal.gauss_markov.loops import add_rows, back_substitute, eliminate
from tankcal.gauss_markov.model import Normals
from tankcal.gauss_markov.plan import plan
from tankcal.gauss_markov.rank import diagnosis
from tankcal.gauss_markov.solution import Factor, Solution

SMALLEST_PIVOT = 1e-12  # of a scaled normal matrix; below it the rank is looked at
FIRST_DAMPING = 1e-4
STRONGEST_DAMPING = 1e12
NEARLY_THERE = 1e-2  # of the cost, still to be gained: from here on undamped
SHARP = 1e-13  # of the rows, gained by the last step: below it derivatives need no renewal


class UndeterminedError(SolutionError):
    """Some unknowns are not determined by the observations."""


def solve(model, state, *, max_iterations=100, tolerance=1e-4):
    """Minimise the sum of squared rows of a Model, starting from `state`.

    tolerance  of the last step: root of the sum of squares of what it changes in the rows, per root
               of the number of rows; the step itself is taken, so the error left is far smaller

    Returns a Solution. Raises SolutionError when the observations do not determine the unknowns
    (the message names them) or when the iteration does not converge.
    """
    work = _Work(model)
    cost = work.evaluate(state)
    damping, limit = 0.0, tolerance**2 * max(work.rows, 1)
    for iteration in range(1, max_iterations + 1):
        factor = work.factor(state, damping)
        if factor is None:
            damping = _stronger(damping)
            continue
        step, decrement = work.step(factor)
        candidate = model.moved(state, step)
        if not damping and decrement < limit:
            _refuse_untouched(model, factor)
            cost = work.evaluate(candidate, derivatives=False)
            sharp = decrement < SHARP * max(work.rows, 1)
            return Solution(work, candidate, cost, iteration, factor if sharp else None)
        before, cost = cost, work.evaluate(candidate)
        if cost <= before * (1 + 1e-12):
            gain = 2 * (before - cost) / decrement
            nearly_there = decrement < NEARLY_THERE * cost
            damping = 0.0 if nearly_there else damping * max(1 / 3, 1 - (2 * gain - 1) ** 3)
            state = candidate
        else:
            cost, damping = work.evaluate(state), _stronger(damping)
    raise SolutionError(f"the adjustment did not converge in {max_iterations} iterations")


def _refuse_untouched(model, factor):
    if len(factor.untouched):
        names = ", ".join(model.name_of(int(column)) for column in factor.untouched)
        raise UndeterminedError(f"no observation says anything about: {names}")


def _stronger(damping):
    damping = max(10 * damping, FIRST_DAMPING)
    if damping > STRONGEST_DAMPING:
        raise SolutionError("the adjustment cannot be improved, and is not at a minimum")
    return damping


class _Work:
    """Plan and buffers of one solve."""

    def __init__(self, model):
        self.model = model
        self.plan = plan(model.reduced, model.blocks, model.groups)
        self.w = [np.zeros((len(group.columns), group.rows)) for group in model.groups]
        self.jac = [
            np.zeros((len(group.columns), group.rows, group.columns.shape[1]))
            for group in model.groups
        ]
        self.normals = Normals.zero(self.plan)
        self.rows = sum(w.size for w in self.w)

    def evaluate(self, state, derivatives=True):
        """Fill misclosures (and derivatives) at a state; half the sum of squares."""
        cost = 0.0
        for group, w, jac in zip(self.model.groups, self.w, self.jac, strict=True):
            group.fill(state, w, jac if derivatives else jac[:0])
            cost += 0.5 * float(np.vdot(w, w))
        return cost if np.isfinite(cost) else np.inf

    def factor(self, state, damping):
        """Normal equations at the evaluated state, eliminated and factored; None: damp more."""
        normals, nr = self.normals, self.plan.reduced
        normals.clear()
        for batch in self.plan.batches:
            add_rows(batch, batch.of(self.w[batch.group]), batch.of(self.jac[batch.group]), normals)
        diagonal = normals.t.diagonal()[:nr].copy()
        untouched = diagonal == 0.0
        if untouched.any():
            diagonal[untouched] = 1.0
        bad = eliminate(self.plan, normals, damping, SMALLEST_PIVOT)
        if bad >= 0:
            return self._look(state, damping, bad)
        scale = 1.0 / np.sqrt(diagonal)
        s = normals.t[:nr, :nr] + normals.t[:nr, :nr].T
        corner = np.einsum("ii->i", s)
        corner *= 0.5
        corner[untouched] = 1.0
        s *= scale
        s *= scale[:, None]
        free = ties = None
        if damping:
            corner += damping
        elif self.model.free is not None:
            free = self.model.free(state)
            ties = free * self.model.inner[:, None]
            held = np.linalg.qr(free[:nr] / scale[:, None])[0]
            s += held @ held.T
        lower, info = scipy.linalg.lapack.dpotrf(s.T, lower=1, clean=0, overwrite_a=1)
        if info or (nr and lower.diagonal().min() ** 2 < SMALLEST_PIVOT):
            return self._look(state, damping, None)
        return Factor(normals, scale, lower, np.flatnonzero(untouched), free, ties)

    def _look(self, state, damping, bad_block):
        """A factor that could not be had: raise when it is the survey's fault."""
        found = None if damping else diagnosis(self, state, bad_block)
        if found:
            raise UndeterminedError(found)

    def step(self, factor):
        """Gauss-Newton step (unknowns,) and the squared size of what it changes in the rows."""
        n = factor.normals
        reduced = -factor.solved(n.g[:-1])
        blocks = -back_substitute(self.plan, n, reduced)
        step = np.concatenate([reduced, blocks.ravel()])
        if factor.free is not None:
            step -= factor.free @ np.linalg.solve(factor.ties.T @ factor.free, factor.ties.T @ step)
        decrement = -float(n.g[:-1] @ reduced) + float(np.vdot(n.b, n.b))
        return step, decrement
