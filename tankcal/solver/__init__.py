"""Least squares without geometry, for many unknowns: Gauss-Markov model with blocks.

The rows are F(x) - l, whitened. Some unknowns form blocks of three, and no row depends on two
blocks. These blocks are eliminated (Schur complement), and the remaining system is solved as a
dense system:

    N = [V  W; W' R],   S = R - W' V^-1 W,   Q_xx = S^-1,   Q_bb = V^-1 + V^-1 W S^-1 W' V^-1

Small problems with conditions between observations are solved by tankcal.adjust.

Source: Brown 1958; Triggs et al. 2000, Bundle adjustment - a modern synthesis, sections 6, 9.

Gauss-Newton iteration on the reduced normal equations, damped only if the cost rises.

Diagnosis of normal equations that cannot be factored: which unknowns are not determined.

A direction x counts as undetermined if the rows change by less than 1e-7 of its length, for columns
scaled to length one. The change is evaluated in the rows themselves. It stays far above this limit
for a valid survey with very different units or nearly equal parameters.
"""

import numpy as np
import scipy.linalg

from tankcal.adjust import SMALLEST_PIVOT, Adjustment, find_determined
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.solver.cofactors import Cofactors, Factor
from tankcal.solver.compiled import threads_for
from tankcal.solver.elimination import Rows, back_substitute, eliminate
from tankcal.solver.exact import Conditions
from tankcal.solver.model import Group, Model, s_transform

__all__ = ["Group", "Model", "UndeterminedError", "linearise", "solve"]


NOTHING = 1e-7  # relative change of the rows below which a direction is undetermined
FAINT = 1e-9  # eigenvalue of the scaled reduced system below which a direction is a candidate
WEAK = 1e-6  # eigenvalue below which a direction may prevent convergence
NAMES_SHOWN = 8  # unknowns named in a message
SMALL = 2e7  # rows times unknowns squared, below which a system without blocks is solved by QR
FIRST_DAMPING = 1e-4  # relative to the unit diagonal of the scaled normal equations
STRONGEST_DAMPING = 1e12  # damping at which the iteration stops without a minimum
NEARLY_THERE = 1e-2  # expected relative reduction of the cost below which damping ends
SHARP = 1e-13  # decrement per row below which the derivatives are not evaluated again


# ---- diagnosis of normal equations that cannot be factored: which unknowns are not determined


def diagnosis(work, state, bad_block):
    """Name the unknowns that the observations do not determine.

    Parameters
    ----------
    work : object
        Model, rows and normal equations of the solution.
    state : object
        State at which the factorisation failed.
    bad_block : int or None
        Index of an undetermined block, if the elimination found one.

    Returns
    -------
    Message or None
        None if all unknowns are determined.
    """
    model = work.model
    if bad_block is not None:
        first = model.reduced + 3 * bad_block
        names = ", ".join(model.name_of(column) for column in range(first, first + 3))
        return message("undetermined", "not determined by the observations: {names}", names=names)
    directions, lengths = null_space(work, state)
    if model.null_space is not None:
        # A free network: the datum fixes the directions of its null space.
        directions = _remove_datum(directions, model.null_space(state) * lengths[:, None])
    if not directions.shape[1]:
        return None
    told = _describe_directions(model, directions)
    return message(
        "rank_defect",
        "rank defect {defect}: not determined by the observations: {told}",
        defect=directions.shape[1],
        told=told,
    )


def weakness(work, state):
    """Describe the direction in which the rows change least.

    Parameters
    ----------
    work : object
        Model, rows and normal equations of the solution.
    state : object
        State at which the iteration stopped.

    Returns
    -------
    Message or str
        "" if all directions are well determined.
    """
    model = work.model
    directions, lengths = null_space(work, state, WEAK, np.inf)
    if model.null_space is not None:
        directions = _remove_datum(directions, model.null_space(state) * lengths[:, None])
    if not directions.shape[1]:
        return ""
    return message(
        "hardly_felt",
        "; hardly determined by the observations: {unknowns}",
        unknowns=_describe_directions(model, directions[:, :1]),
    )


def _describe_directions(model, directions):
    """Names of the unknowns that take part in directions (unknowns, d)."""
    if model.describe_directions is not None:
        return model.describe_directions(directions)
    size = np.sqrt(np.sum(directions**2, axis=1))
    worst = np.argsort(-size)[:NAMES_SHOWN]
    # Small components are rounding, or follow from the large ones.
    worst = worst[size[worst] > 0.1 * size.max()]
    return ", ".join(model.name_of(int(column)) for column in worst)


def null_space(work, state, faint=FAINT, nothing=NOTHING):
    """Directions in which the rows do not change.

    Parameters
    ----------
    work : object
        Model, rows and normal equations of the solution.
    state : object
        State at which the rows are evaluated.
    faint : float, optional
        Largest eigenvalue of a candidate, see FAINT.
    nothing : float, optional
        Largest relative change of the rows, see NOTHING.

    Returns
    -------
    directions : ndarray, shape (unknowns, d)
        Directions for columns of length one; they obey the exact conditions.
    lengths : ndarray, shape (unknowns,)
        Lengths of the columns.
    """
    normals, nr = work.normals, work.plan.reduced
    work.rows.add(state)
    # The diagonal contains the squared lengths of the columns; elimination overwrites it.
    diagonal = normals.t.diagonal()[:nr].copy(), normals.v[:, [0, 2, 5]].ravel()
    lengths = np.sqrt(np.concatenate(diagonal))
    scale = 1.0 / np.where(lengths > 0, lengths, 1.0)
    eliminate(work.plan, normals, 0.0, 0.0)
    s = np.triu(normals.t[:nr, :nr])
    s += np.triu(s, 1).T
    s = s * scale[:nr] * scale[:nr, None]
    tangent = work.conditions.tangent(state, scale[:nr]) if work.conditions else None
    # Only directions that obey the exact conditions are relevant.
    values, vectors = np.linalg.eigh(s if tangent is None else tangent.square(s)[0])
    if tangent is not None:
        vectors = tangent.from_null_space(vectors)
    # With a zero right-hand side, the back substitution gives the blocks that follow the reduced
    # unknowns.
    normals.b[:] = 0.0
    directions, derivatives = [], work.rows.derivatives(state)
    for vector in vectors[:, values < faint].T:
        reduced = vector * scale[:nr]
        direction = np.concatenate([reduced, -back_substitute(work.plan, normals, reduced).ravel()])
        # An eigenvalue of the squared system has lost half the digits; the rows themselves decide.
        length = np.linalg.norm(direction / scale)
        if _row_change(work.model, derivatives, direction) < nothing * length:
            directions.append(direction / scale / length)
    directions = np.array(directions).T if directions else np.zeros((work.model.unknowns, 0))
    return directions, lengths


def _remove_datum(directions, null_space):
    """Remove from directions (unknowns, d) the part that the datum fixes."""
    basis = np.linalg.qr(null_space)[0]
    vectors, sizes, _ = np.linalg.svd(
        directions - basis @ (basis.T @ directions), full_matrices=False
    )
    # Directions of length one keep less than 0.1 if the datum fixes them almost completely.
    return vectors[:, sizes > 0.1]


def _row_change(model, derivatives, direction):
    """Root of the sum of squared changes of the rows along a direction (unknowns,)."""
    # The additional element serves fixed unknowns, with column -1.
    direction = np.append(direction, 0.0)
    total = 0.0
    for group, jac in zip(model.groups, derivatives, strict=True):
        change = np.einsum("nmk,nk->nm", jac, direction[group.columns])
        total += float(np.vdot(change, change))
    return np.sqrt(total)


# ---- gauss-Newton iteration on the reduced normal equations, damped only if the cost rises


class UndeterminedError(SolutionError):
    """Unknowns that the observations do not determine."""


def solve(model, state, *, max_iterations=100, tolerance=1e-4):
    """Minimise the sum of squared rows of a Model.

    Parameters
    ----------
    model : Model
        The least-squares problem.
    state : object
        Start values of all unknowns, in the form used by the groups of the model.
    max_iterations : int, optional
        Largest number of iterations.
    tolerance : float, optional
        Limit for the last step: root of the sum of squared changes of the rows, divided by the root
        of the number of rows. The last step is applied, so that the remaining error is much
        smaller.

    Returns
    -------
    Adjustment

    Raises
    ------
    SolutionError
        If the observations do not determine the unknowns (the message names them), or if the
        iteration does not converge.

    Examples
    --------
    The mean of two observations with a standard uncertainty of 1:

    >>> import numpy as np
    >>> from tankcal.solver import Group, Model
    >>> def fill(x, w, jac):
    ...     w[:, 0] = x[0] - np.array([1.0, 3.0])
    ...     if len(jac):
    ...         jac[:] = 1.0
    >>> model = Model(1, 0, (Group(np.array([[0], [0]]), 1, fill),), lambda x, step: x + step)
    >>> result = solve(model, np.zeros(1))
    >>> result.unknowns.round(9).tolist(), result.dof
    ([2.0], 1)
    """
    with threads_for(model.reduced):
        return _iterate(_Solution(model), state, max_iterations, tolerance)


def linearise(model, state):
    """Adjustment of a Model with derivatives at a given state, without a step.

    Parameters
    ----------
    model : Model
        The least-squares problem.
    state : object
        Values of all unknowns, in the form used by the groups of the model.

    Returns
    -------
    Adjustment

    Raises
    ------
    SolutionError
        If the observations do not determine the unknowns (the message names them).

    Notes
    -----
    The cofactors are valid for a survey whose observations agree with the state. They predict the
    uncertainty of the unknowns before any measurement.
    """
    with threads_for(model.reduced):
        work = _Solution(model)
        cost, factor = work.rows.add(state), work.sound_factor(state)
        _refuse_untouched(model, factor)
        return work.adjustment(state, cost, 0, factor)


def _iterate(work, state, max_iterations, tolerance):
    """Run the iteration of `solve`."""
    model, rows, state = work.model, work.rows, work.closed_start(state)
    cost = rows.add(state)
    damping, resting = 0.0, FIRST_DAMPING
    # The decrement is a sum of squares over all rows.
    limit = tolerance**2 * max(rows.count, 1)
    for iteration in range(1, max_iterations + 1):
        factor, candidate = work.factor(state, damping), None
        if factor is not None:
            step, decrement = work.step(factor)
            candidate = work.closed(model.moved(state, step), factor)
        # No factor, or the exact conditions cannot be closed: add the rows again and damp more.
        if candidate is None:
            cost, damping = rows.add(state), _increase_damping(damping, resting)
            continue
        # Converged. Only an undamped step is a Gauss-Newton step, whose decrement measures the
        # distance from the minimum.
        if not damping and decrement < limit:
            _refuse_untouched(model, factor)
            # The step is so small that the present factor is also valid at the minimum.
            if decrement < SHARP * max(rows.count, 1):
                return work.adjustment(candidate, rows.evaluate(candidate), iteration, factor)
            cost = rows.add(candidate)
            return work.adjustment(candidate, cost, iteration, work.sound_factor(candidate))
        # Rounding must not count as a rise of the cost.
        previous_cost, most = cost, cost * (1 + 1e-12)
        cost = rows.add(candidate, most)
        if cost <= most:
            # Ratio of actual to predicted reduction; a high ratio reduces the damping.
            gain = 2 * (previous_cost - cost) / decrement
            damping *= max(1 / 3, 1 - (2 * gain - 1) ** 3)
            # Close to the minimum, undamped steps converge faster.
            if damping and decrement < NEARLY_THERE * cost:
                damping, resting = 0.0, damping
            state = candidate
        else:
            cost, damping = rows.add(state), _increase_damping(damping, resting)
    raise SolutionError(
        message(
            "not_converged",
            "the adjustment did not converge in {most} iterations{weakness}",
            most=max_iterations,
            weakness=weakness(work, state),
        )
    )


def _refuse_untouched(model, factor):
    """Raise UndeterminedError if an unknown occurs in no row."""
    if len(factor.untouched):
        names = ", ".join(model.name_of(int(column)) for column in factor.untouched)
        raise UndeterminedError(
            message("says_nothing", "not observed by anything: {names}", names=names)
        )


def _increase_damping(damping, resting):
    """Increase the damping tenfold, starting from `resting`; raise SolutionError at the limit."""
    damping = 10 * damping or resting
    if damping > STRONGEST_DAMPING:
        raise SolutionError(
            message("no_minimum", "the adjustment cannot be improved, and is not at a minimum")
        )
    return damping


class _Solution:
    """Rows, plan and exact conditions during a solution."""

    def __init__(self, model):
        self.model, self.rows = model, Rows(model)
        self.plan, self.normals = self.rows.plan, self.rows.normals
        self.conditions = Conditions(model)

    def closed_start(self, state):
        """Move the start state to the nearest state that meets the exact conditions."""
        if not self.conditions:
            return state
        lengths = np.zeros(self.model.unknowns + 1)
        for group, jac in zip(self.model.groups, self.rows.derivatives(state), strict=True):
            np.add.at(lengths, group.columns, np.einsum("nmk,nmk->nk", jac, jac))
        lengths = lengths[: self.plan.reduced]
        # Lengths of the columns define the distance in which the nearest state is sought.
        scale = 1.0 / np.sqrt(np.where(lengths > 0, lengths, 1.0))
        return self.conditions.closed(state, scale, strict=True)

    def closed(self, state, factor):
        """Restore the exact conditions after a step; None requires more damping."""
        return self.conditions.closed(state, factor.scale) if self.conditions else state

    def adjustment(self, state, cost, iterations, factor):
        """Assemble the Adjustment at a minimum from its factored normal equations."""
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
        """Factor of the rows just added, without damping.

        Raises
        ------
        SolutionError
            If the normal equations cannot be factored.
        """
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
        """Eliminate and factor the normal equations just added; None requires more damping."""
        normals, nr = self.normals, self.plan.reduced
        diagonal = normals.t.diagonal()[:nr].copy()
        if not np.isfinite(diagonal).all():
            return None  # the derivatives are not finite at this state
        # An unknown without rows gets a unit diagonal, so that the system can be factored; it is
        # reported later.
        untouched = diagonal == 0.0
        if untouched.any():
            diagonal[untouched] = 1.0
        # An unknown that occurs only in a condition is determined by this condition.
        tangent = None
        if self.conditions:
            tangent = self.conditions.tangent(state, 1.0 / np.sqrt(diagonal))
            untouched &= ~tangent.touched
        undetermined_block = eliminate(self.plan, normals, damping, SMALLEST_PIVOT)
        if undetermined_block >= 0:
            return self._raise_if_undetermined(state, damping, undetermined_block)
        scale = 1.0 / np.sqrt(diagonal)
        null_space = datum_basis = datum_rows = None
        # A free network: the null space is fixed by adding rows with full weight. Damping makes
        # these rows unnecessary.
        if self.model.null_space is not None and not damping:
            null_space = self.model.null_space(state)
            datum_basis = null_space * self.model.inner[:, None]
            if np.linalg.matrix_rank(datum_basis.T @ null_space) < null_space.shape[1]:
                raise SolutionError(
                    message(
                        "datum_not_fixed", "the coordinates chosen to hold the datum do not fix it"
                    )
                )
            datum_rows = np.linalg.qr(null_space[:nr] / scale[:, None])[0]
        # QR of small systems does not square the condition number.
        if self.plan.blocks == 0 and self.rows.count * nr * nr < SMALL:
            lower, is_regular, reaction_part = self._factor_by_qr(
                scale, untouched, damping, datum_rows, tangent
            )
        else:
            lower, is_regular, reaction_part = self._factor_by_cholesky(
                scale, untouched, damping, datum_rows, tangent
            )
        if not is_regular:
            return self._raise_if_undetermined(state, damping, None)
        untouched = untouched.nonzero()[0]
        return Factor(
            normals, scale, lower, untouched, null_space, datum_basis, tangent, reaction_part
        )

    def _factor_by_cholesky(self, scale, untouched, damping, datum_rows, tangent):
        """Cholesky factor of the scaled reduced system.

        Returns the factor, whether its pivots exceed rounding, and the reaction part of the exact
        conditions, see Tangent.square.
        """
        nr = self.plan.reduced
        s = self.normals.t[:nr, :nr] * scale  # upper half
        s *= scale[:, None]
        # A view of the diagonal.
        corner = np.einsum("ii->i", s)
        corner[untouched] = 1.0
        corner += damping
        # S + N N' is regular, and gives equal results after the datum transformation.
        if datum_rows is not None:
            s += datum_rows @ datum_rows.T
        reaction_part = None
        if tangent is not None:
            s, reaction_part = tangent.square(np.triu(s) + np.triu(s, 1).T)
        lower, info = scipy.linalg.lapack.dpotrf(s.T, lower=1, clean=0, overwrite_a=1)
        is_regular = (
            not info and find_determined(lower.diagonal(), self.rows.count, of_normals=True).all()
        )
        return lower, is_regular, reaction_part

    def _factor_by_qr(self, scale, untouched, damping, datum_rows, tangent):
        """Factor like `_factor_by_cholesky`, but from the rows, without normal equations."""
        nr = self.plan.reduced
        # Rows for unknowns without observations, for the damping and for the datum.
        rows = [np.diag(untouched.astype(float)), np.sqrt(damping) * np.eye(nr)]
        if datum_rows is not None:
            rows.append(datum_rows.T)
        for part in self.rows.parts:  # without blocks, each group is a single part
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
        # R' with positive pivots is the Cholesky factor of the normal equations.
        lower = np.asfortranarray((r * np.sign(r.diagonal())[:, None]).T)
        return lower, find_determined(lower.diagonal(), self.rows.count).all(), reaction_part

    def _raise_if_undetermined(self, state, damping, bad_block):
        """Raise UndeterminedError if an undamped factorisation failed for lack of observations."""
        reason = None if damping else diagnosis(self, state, bad_block)
        if reason:
            raise UndeterminedError(reason)

    def step(self, factor):
        """Gauss-Newton step (unknowns,), and the squared norm of its effect on the rows."""
        n = factor.normals
        reduced = -factor.solved(n.g[:-1])
        blocks = -back_substitute(self.plan, n, reduced)
        step = np.concatenate([reduced, blocks.ravel()])
        if factor.null_space is not None:
            step = s_transform(step, factor.null_space, factor.datum_basis)
        # g'S^-1 g + y'y: the reduction of the sum of squares predicted by the linear model.
        decrement = -float(n.g[:-1] @ reduced) + float(np.vdot(n.b, n.b))
        return step, decrement
