"""Gauss-Newton on the reduced normal equations; damped only when the cost rises."""

import numpy as np
import scipy.linalg

from tankcal.adjust import SMALLEST_PIVOT, Adjustment, find_determined
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.solver.cofactors import Cofactors, Factor
from tankcal.solver.elimination import back_substitute, eliminate
from tankcal.solver.exact import Conditions
from tankcal.solver.model import s_transform
from tankcal.solver.rank import diagnosis, weakness
from tankcal.solver.rows import Rows
from tankcal.solver.threads import threads_for

SMALL = 2e7  # rows times unknowns squared: below it a system without blocks is solved by QR
FIRST_DAMPING = 1e-4
STRONGEST_DAMPING = 1e12
NEARLY_THERE = 1e-2  # of the cost, still to be gained: from here on undamped
SHARP = 1e-13  # of the rows, gained by the last step: below it derivatives need no renewal


class UndeterminedError(SolutionError):
    """Some unknowns are not determined by the observations."""


def solve(model, state, *, max_iterations=100, tolerance=1e-4):
    """Minimise the sum of squared rows of a Model, starting from `state`.

    Parameters
    ----------
    tolerance : optional
        Of the last step: root of the sum of squares of what it changes in the rows, per root of the
        number of rows; the step itself is taken, so the error left is far smaller.

    Returns
    -------
    Adjustment

    Raises
    ------
    SolutionError
        When the observations do not determine the unknowns (the message names them) or when the
        iteration does not converge.
    """
    with threads_for(model.reduced):
        return _solved(_Work(model), state, max_iterations, tolerance)


def linearise(model, state):
    """The Adjustment of a Model with its derivatives at `state`: no step is made.

    Its cofactors are those of a survey whose observations are what `state` computes, so it tells
    how well the unknowns will be known before anything is measured.

    Parameters
    ----------
    model : Model
    state : object
        Values of all unknowns, as the model's groups understand them.

    Returns
    -------
    Adjustment

    Raises
    ------
    SolutionError
        When the observations do not determine the unknowns (the message names them).
    """
    with threads_for(model.reduced):
        work = _Work(model)
        cost, factor = work.rows.add(state), work.sound_factor(state)
        _refuse_untouched(model, factor)
        return work.adjustment(state, cost, 0, factor)


def _solved(work, state, max_iterations, tolerance):
    """The iteration of `solve`."""
    model, rows, state = work.model, work.rows, work.closed_start(state)
    cost = rows.add(state)
    damping, resting = 0.0, FIRST_DAMPING
    limit = tolerance**2 * max(rows.count, 1)
    for iteration in range(1, max_iterations + 1):
        factor, candidate = work.factor(state, damping), None
        if factor is not None:
            step, decrement = work.step(factor)
            candidate = work.closed(model.moved(state, step), factor)
        if candidate is None:
            cost, damping = rows.add(state), _stronger(damping, resting)
            continue
        if not damping and decrement < limit:
            _refuse_untouched(model, factor)
            if decrement < SHARP * max(rows.count, 1):
                return work.adjustment(candidate, rows.evaluate(candidate), iteration, factor)
            cost = rows.add(candidate)
            return work.adjustment(candidate, cost, iteration, work.sound_factor(candidate))
        before, most = cost, cost * (1 + 1e-12)
        cost = rows.add(candidate, most)
        if cost <= most:
            gain = 2 * (before - cost) / decrement
            damping *= max(1 / 3, 1 - (2 * gain - 1) ** 3)
            if damping and decrement < NEARLY_THERE * cost:
                damping, resting = 0.0, damping
            state = candidate
        else:
            cost, damping = rows.add(state), _stronger(damping, resting)
    raise SolutionError(
        message(
            "not_converged",
            "the adjustment did not converge in {most} iterations{weakness}",
            most=max_iterations,
            weakness=weakness(work, state),
        )
    )


def _refuse_untouched(model, factor):
    if len(factor.untouched):
        names = ", ".join(model.name_of(int(column)) for column in factor.untouched)
        raise UndeterminedError(
            message("says_nothing", "not observed by anything: {names}", names=names)
        )


def _stronger(damping, resting):
    damping = 10 * damping or resting
    if damping > STRONGEST_DAMPING:
        raise SolutionError(
            message("no_minimum", "the adjustment cannot be improved, and is not at a minimum")
        )
    return damping


class _Work:
    """Rows, plan and exact conditions of one solve."""

    def __init__(self, model):
        self.model, self.rows = model, Rows(model)
        self.plan, self.normals = self.rows.plan, self.rows.normals
        self.conditions = Conditions(model)

    def closed_start(self, state):
        """The start state, brought to where the exact conditions hold."""
        if not self.conditions:
            return state
        lengths = np.zeros(self.model.unknowns + 1)
        for group, jac in zip(self.model.groups, self.rows.derivatives(state), strict=True):
            np.add.at(lengths, group.columns, np.einsum("nmk,nmk->nk", jac, jac))
        lengths = lengths[: self.plan.reduced]
        scale = 1.0 / np.sqrt(np.where(lengths > 0, lengths, 1.0))
        return self.conditions.closed(state, scale, strict=True)

    def closed(self, state, factor):
        """The state after a step, brought back to the exact conditions; None: damp more."""
        return self.conditions.closed(state, factor.scale) if self.conditions else state

    def adjustment(self, state, cost, iterations, factor):
        """The Adjustment at a minimum; factor  that of its normal equations."""
        return Adjustment(
            unknowns=state,
            cofactor=Cofactors(self, state, factor),
            normalised=self.rows.misclosures,
            chi2=2.0 * cost,
            rows=self.rows.weighing,
            estimated=self.model.unknowns - (factor.tangent.rank if self.conditions else 0),
            iterations=iterations,
            rank_defect=0 if factor.null_space is None else factor.null_space.shape[1],
        )

    def sound_factor(self, state):
        """The Factor of the rows just added; a SolutionError when there is none."""
        factor = self.factor(state, 0.0)
        if factor is None:
            raise SolutionError(
                message(
                    "no_factor",
                    "the normal equations cannot be factorised{weakness}",
                    weakness=weakness(self, state),
                )
            )
        return factor

    def factor(self, state, damping):
        """Normal equations of the rows just added, eliminated, factored; None: damp more."""
        normals, nr = self.normals, self.plan.reduced
        diagonal = normals.t.diagonal()[:nr].copy()
        if not np.isfinite(diagonal).all():
            return None  # no derivative exists at this state
        untouched = diagonal == 0.0
        if untouched.any():
            diagonal[untouched] = 1.0
        tangent = None
        if self.conditions:
            tangent = self.conditions.tangent(state, 1.0 / np.sqrt(diagonal))
            untouched &= ~tangent.touched
        bad = eliminate(self.plan, normals, damping, SMALLEST_PIVOT)
        if bad >= 0:
            return self._look(state, damping, bad)
        scale = 1.0 / np.sqrt(diagonal)
        null_space = datum_basis = held = None
        if self.model.null_space is not None and not damping:
            null_space = self.model.null_space(state)
            datum_basis = null_space * self.model.inner[:, None]
            if np.linalg.matrix_rank(datum_basis.T @ null_space) < null_space.shape[1]:
                raise SolutionError(
                    message(
                        "datum_not_fixed", "the coordinates chosen to hold the datum do not fix it"
                    )
                )
            held = np.linalg.qr(null_space[:nr] / scale[:, None])[0]
        if self.plan.blocks == 0 and self.rows.count * nr * nr < SMALL:
            lower, sound, reaction_part = self._dense_root(scale, untouched, damping, held, tangent)
        else:
            lower, sound, reaction_part = self._root(scale, untouched, damping, held, tangent)
        if not sound:
            return self._look(state, damping, None)
        untouched = untouched.nonzero()[0]
        return Factor(
            normals, scale, lower, untouched, null_space, datum_basis, tangent, reaction_part
        )

    def _root(self, scale, untouched, damping, held, tangent):
        """Cholesky factor of the scaled reduced system, and whether its pivots are sound.

        And what the conditions hold against: see Tangent.square.
        """
        nr = self.plan.reduced
        s = self.normals.t[:nr, :nr] * scale  # its upper half
        s *= scale[:, None]
        corner = np.einsum("ii->i", s)
        corner[untouched] = 1.0
        corner += damping
        if held is not None:
            s += held @ held.T
        reaction_part = None
        if tangent is not None:
            s, reaction_part = tangent.square(np.triu(s) + np.triu(s, 1).T)
        lower, info = scipy.linalg.lapack.dpotrf(s.T, lower=1, clean=0, overwrite_a=1)
        sound = (
            not info and find_determined(lower.diagonal(), self.rows.count, of_normals=True).all()
        )
        return lower, sound, reaction_part

    def _dense_root(self, scale, untouched, damping, held, tangent):
        """The same factor by QR of the rows themselves: nothing is squared."""
        nr = self.plan.reduced
        rows = [np.diag(untouched.astype(float)), np.sqrt(damping) * np.eye(nr)]
        if held is not None:
            rows.append(held.T)
        for part in self.rows.parts:  # without blocks a group is one part
            for batch in part.batches:
                jac = batch.of(part.jac)
                n, m, _ = jac.shape
                dense = np.zeros((n, m, nr + 1))
                columns = np.broadcast_to(batch.columns[:, None, :], jac.shape)
                dense[np.arange(n)[:, None, None], np.arange(m)[:, None], columns] = jac
                rows.append(dense.reshape(n * m, dense.shape[-1])[:, :nr] * scale)
        rows, reaction_part = np.vstack(rows), None
        if tangent is not None:
            outer, rows = tangent.split(rows.T)
            reaction_part, rows = outer @ np.vstack([outer, rows]).T, rows.T
        r = np.linalg.qr(rows, mode="r")
        lower = np.asfortranarray((r * np.sign(r.diagonal())[:, None]).T)
        return lower, find_determined(lower.diagonal(), self.rows.count).all(), reaction_part

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
        if factor.null_space is not None:
            step = s_transform(step, factor.null_space, factor.datum_basis)
        decrement = -float(n.g[:-1] @ reduced) + float(np.vdot(n.b, n.b))
        return step, decrement
