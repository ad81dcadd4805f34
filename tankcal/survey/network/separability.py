"""What else would explain a blunder: readings without which the one set aside agrees again.

With a set-aside observation i back (residual e, whitened row J, S = 1 + J Q J') and B = J_j Q J',
the residuals of i and of another one j, and their covariances, are

    v_i = S^-1 e,   R_i = S^-1,   v_j = v - B S^-1 e,   R_j = (1 - J_j Q J_j') + B S^-1 B',
    R_ij = -S^-1 B'

Of values in a block of correlated ones, c the columns of L^-1 that a bias of j enters (see
`blocks`), v_j becomes c' v, R_j c' R c and R_ij R_i. c. An observation i of a block enters as its
difference to what the others of the block let expect, which is correlated with none of them; what
that expects of i is moved by a bias of j in the same block, d = -L_i^-1 S e_j, so that all three
have a further part: d' v_i, c' R_.i d and its transpose, d' R_i d, and R_i d.

Without j in its place, i is tested by

    T = u' M^-1 u,   u = v_i - R_ij R_j^-1 v_j,   M = R_i - R_ij R_j^-1 R_ji

and j may be the blunder as well when T is insignificant (0.1 %) and j itself is not. Image points
are pairs, here as in the search. Most j are told apart without J_j Q J_j', whose eigenvalues are
not negative and add up to m less the redundancy numbers of j. So none of R_j is below l = sum r -
(m - 1); M <= R_i; and by Cauchy and Schwarz

    sqrt T >= sqrt(v_i' S v_i) - sqrt(tr B S^-1 B') |v_j| / l

A coordinate that is held is released: with its reaction g and
square q (see `reactions`), and r = C_i + J X, both become g - r' S^-1 e and q + r' S^-1 r.
Source: Foerstner 1983, Reliability and discernability of extended Gauss-Markov models.
"""

from dataclasses import dataclass
from functools import reduce

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import chdtri

from tankcal.adjust import ALPHA, CRITICAL, UNCONTROLLED
from tankcal.solver.effects import cofactors_within
from tankcal.survey.network.blocks import (
    conditional_expectation,
    moves_of,
    observations_in_use,
    observations_of,
)
from tankcal.survey.network.reactions import HELD

# limits of T, by the number of values tested
LIMITS = (0.0, CRITICAL**2, *(float(chdtri(count, ALPHA)) for count in range(2, 7)))
WORTH = 0.5 * CRITICAL**2  # w^2 of a single value from which its observation is looked at
LOOKED_AT = 200  # observations of a group, the worst
FIRM = 0.05  # least eigenvalue of R_j with which the bound of T is asked


def alternatives(adjusted, source, row, held=None):
    """[(source, row)] of readings that may be the blunder in place of one that was set aside.

    held  Reactions of held coordinates, which may be wrong as well; None: they are not asked

    The likeliest first. Empty where the survey tells them apart.
    """
    problem, solution = adjusted.problem, adjusted.solution
    aside = _aside(problem, solution, source, row)
    if aside is None:
        return []  # its points are no longer adjusted
    found = []
    for k, table in enumerate(adjusted.residuals[: problem.ordinary]):
        if table.source == "known beforehand":
            continue
        columns = problem.model.groups[k].columns
        b = solution.cofactor.jacobians[k] @ np.take(aside.moves, columns, axis=0)
        for i, v, cofactors, b_i in _near(solution, table, k, b, aside):
            tests = _tests(v, cofactors, -aside.inverse @ b_i.T, aside)
            if tests is not None:
                found.append((*tests, table.source, int(table.rows[i])))
    for k, members in problem.blocks:
        found += _correlated(problem, solution, k, members, aside)
    found = [(own, *which) for own, instead, *which in found if instead]
    if held is not None and len(held.rows):
        place = aside.one.columns(held.layout)[0] - problem.model.unknowns
        c = np.zeros((len(aside.e), len(held.rows)))
        c[:, place[place >= 0]] = aside.jac[:, place >= 0]
        changes = np.vstack([held.changes, np.zeros((1, len(held.rows)))])
        found += _released(held, c + aside.jac @ changes[aside.columns], aside.inverse, aside.e)
    return [one[1:] for one in sorted(found, key=lambda one: -one[0])]


@dataclass(frozen=True)
class _Aside:
    """An observation that was set aside, m values, whitened.

    e, jac    (m,), (m, K) difference to what is expected of it, and derivatives
    columns   (K,) of the unknowns        moves    (unknowns + 1, m) Q J', a row of zeros below
    inverse   (m, m) S^-1                 back     (m,) its residual with it back, v_i
    one       the Observations            members  of its block, or None
    follows   (m, k) of a block: -L_i^-1 S, change of e by biases of the values that take part
    """

    e: np.ndarray
    jac: np.ndarray
    columns: np.ndarray
    moves: np.ndarray
    inverse: np.ndarray
    one: object
    members: object = None
    follows: np.ndarray | None = None

    @property
    def back(self):
        return self.inverse @ self.e


def _aside(problem, solution, source, row):
    """The _Aside of a row of a source, or None."""
    for number in range(len(problem.sources)):
        if problem.sources[number] == source and row in problem.rows_of[number]:
            mine = np.flatnonzero(problem.rows_of[number] == row)
            one = problem.observations[number].taken(mine).using(np.ones(1))
            columns = problem.model.groups[number].columns[mine]
            e, jac = np.empty((1, one.rows)), np.empty((1, one.rows, columns.shape[1]))
            one.fill(solution.unknowns, e, jac)
            return _made(solution, e[0], jac[0], columns, one)
    for number, members in problem.blocks:
        mine = np.flatnonzero((members.source == source) & (members.row == row))
        if not len(mine):
            continue
        v, jac = members.block.linearised(solution.unknowns)
        part = observations_in_use(problem, solution, number, members, v)
        off, away, unexplained, share = conditional_expectation(members, part, mine, v, jac)
        root = np.linalg.cholesky(unexplained)
        e, jac, share = (solve_triangular(root, one, lower=True) for one in (off, away, share))
        columns = members.block.columns(problem.layout)
        return _made(solution, e, jac, columns, members.block, members, -share)
    return None


def _made(solution, e, jac, columns, *more):
    moves = moves_of(solution, columns, jac)
    inverse = np.linalg.inv(np.eye(len(e)) + jac @ moves[columns[0]])
    return _Aside(e, jac, columns[0], moves, inverse, *more)


def _correlated(problem, solution, number, members, aside):
    """(T of j, whether i agrees without it, source, row) of observations j of a block."""
    if number is None:
        return
    v, _ = members.block.linearised(solution.unknowns)
    part = observations_in_use(problem, solution, number, members, v)
    b = part.a @ aside.moves[part.columns]
    t = part.t - b @ aside.back
    spread = part.spread + b @ aside.inverse @ b.T
    to_aside = -aside.inverse @ b.T
    shift = aside.follows if members is aside.members else np.zeros((len(aside.e), len(part.own)))
    for mine in observations_of(members):
        if not members.share[mine[0]] > 0:
            continue
        place = np.searchsorted(part.own, mine)
        size = np.sqrt(np.sum(part.back[:, place] ** 2, axis=0) + np.sum(shift[:, place] ** 2, 0))
        c, d = part.back[:, place] / size, shift[:, place] / size
        cross = to_aside @ c + aside.inverse @ d
        right = c.T @ t + d.T @ aside.back
        cofactors = c.T @ spread @ c + d.T @ to_aside @ c + (to_aside @ c).T @ d
        tests = _tests(right, cofactors + d.T @ aside.inverse @ d, cross, aside)
        if tests is not None:
            yield (*tests, int(members.source[mine[0]]), int(members.row[mine[0]]))


def _near(solution, table, number, b, aside):
    """Observations that stand out with i back: place, v_j, R_j, B."""
    inverse, back = aside.inverse, aside.back
    flat = b.reshape(-1, b.shape[-1])  # one product of all rows takes a third of many small ones
    v = table.residual / table.sd - (flat @ back).reshape(b.shape[:2])
    shared = np.einsum("rd,rd->r", flat @ inverse, flat).reshape(b.shape[:2])
    r = table.redundancy + shared
    squares = np.where(r > UNCONTROLLED, v**2 / np.maximum(r, UNCONTROLLED), 0.0)
    square = reduce(np.maximum, squares.T)  # of few values each: sooner than a maximum by rows
    near = np.flatnonzero(table.used & (square > WORTH))
    near = near[(b[near] != 0).any(axis=(1, 2))]
    near = near[np.argsort(-square[near], kind="stable")][:LOOKED_AT]
    near = near[_may_explain(v[near], table.redundancy[near], shared[near].sum(axis=1), aside)]
    if not len(near):
        return
    for j, own in zip(near, cofactors_within(solution.cofactor, number, near), strict=True):
        yield j, v[j], np.eye(len(own)) - own + b[j] @ inverse @ b[j].T, b[j]


def _may_explain(v, redundancy, shared, aside):
    """(n,) whether T of the observation aside without these (n, m) may be small, by its bound.

    shared  (n,) tr B S^-1 B'
    """
    least = redundancy.sum(axis=1) - (redundancy.shape[1] - 1)
    # where j shares no more than half of what i has left, all values of i stay controlled
    told = (least >= FIRM) & (2 * shared <= least)
    if np.linalg.eigvalsh(aside.inverse)[0] <= 2 * UNCONTROLLED:
        told[:] = False
    moved = np.sqrt(shared) * np.linalg.norm(v, axis=1) / np.where(told, least, 1.0)
    return ~told | (moved >= np.sqrt(aside.e @ aside.back) - np.sqrt(LIMITS[len(aside.e)]))


def _tests(v, cofactors, cross, aside):
    """T of j with i back, and whether i agrees without j; None where j does not stand out."""
    own, values = _square(v, cofactors)
    if own <= LIMITS[values]:
        return None
    by_j = cross @ np.linalg.pinv(cofactors, rcond=UNCONTROLLED, hermitian=True)
    instead, values = _square(aside.back - by_j @ v, aside.inverse - by_j @ cross.T)
    return own, instead <= LIMITS[values]


def _square(v, cofactors):
    """v' R^-1 v and the number of values in it: what nothing controls is left out."""
    size, ways = np.linalg.eigh(cofactors)
    controlled = size > UNCONTROLLED
    part = ways[:, controlled].T @ v
    return float(np.sum(part**2 / size[controlled])), int(controlled.sum())


def _released(held, r, inverse, e):
    """(T, source, row) of held coordinates with whose release a reading i agrees again.

    r (m, k) change of the rows of i by each release, e (m,) of them
    """
    before = held.w**2
    square = held.square + np.einsum("mk,mn,nk->k", r, inverse, r)
    reaction = held.reaction - r.T @ inverse @ e
    own = np.where(held.square > 0, reaction**2 / np.where(square > 0, square, 1.0), 0.0)
    instead = e @ inverse @ e + before - own
    near = np.flatnonzero((own > CRITICAL**2) & (instead <= LIMITS[len(e)]))
    return [(own[i], HELD, int(held.rows[i])) for i in near]
