"""Separability of blunders: other readings that may be wrong in place of a rejected one.

With a rejected observation i restored (residual e, whitened row J, S = 1 + J Q J') and B = J_j Q
J', the residuals of i and of another observation j, and their covariances, are

    v_i = S^-1 e,   R_i = S^-1,   v_j = v - B S^-1 e,   R_j = (1 - J_j Q J_j') + B S^-1 B',
    R_ij = -S^-1 B'

For values in a block of correlated ones, with c the columns of L^-1 that a bias of j enters (see
`blocks`), v_j becomes c' v, R_j becomes c' R c and R_ij becomes R_i. c. An observation i of a block
enters as its difference from the expectation given the other values, which is uncorrelated with
them. A bias of j in the same block changes that expectation, d = -L_i^-1 S e_j. The three
quantities then have a further part: d' v_i; c' R_.i d, its transpose, and d' R_i d; and R_i d.

Without j, observation i is tested by

    T = u' M^-1 u,   u = v_i - R_ij R_j^-1 v_j,   M = R_i - R_ij R_j^-1 R_ji

and j may be the blunder if T is insignificant (0.1 %) and j itself is significant. Image points are
pairs, as in data snooping. Most j are excluded without J_j Q J_j', whose eigenvalues are not
negative and add up to m less the redundancy numbers of j. No eigenvalue of R_j is therefore below l
= sum r - (m - 1), M <= R_i, and by Cauchy and Schwarz

    sqrt T >= sqrt(v_i' S v_i) - sqrt(tr B S^-1 B') |v_j| / l

A held coordinate is released: with its reaction g and square q (see `reactions`), and r = C_i + J
X, they become g - r' S^-1 e and q + r' S^-1 r. Source: Foerstner 1983, Reliability and
discernability of extended Gauss-Markov models.
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
from tankcal.survey.network.reliability import HELD

# Critical values of T, by the number of values tested.
LIMITS = (0.0, CRITICAL**2, *(float(chdtri(count, ALPHA)) for count in range(2, 7)))
WORTH = 0.5 * CRITICAL**2  # w^2 of a value above which its observation is examined
LOOKED_AT = 200  # observations of a group examined, the worst first
FIRM = 0.05  # smallest eigenvalue of R_j for which the bound of T is used


def alternatives(adjusted, source, row, held=None):
    """Find readings that may be the blunder in place of a rejected one.

    Parameters
    ----------
    adjusted : Adjusted
    source : object
    row : int
        Source and row of the rejected reading.
    held : Reactions, optional
        Held coordinates, which may also be wrong; None: not tested.

    Returns
    -------
    list of (source, row)
        The most likely first; empty if the blunder is identified.
    """
    problem, solution = adjusted.problem, adjusted.solution
    aside = _aside(problem, solution, source, row)
    if aside is None:
        return []  # its points are no longer adjusted
    candidates = []
    for k, table in enumerate(adjusted.residuals[: problem.ordinary]):
        if table.source == "known beforehand":
            continue
        columns = problem.model.groups[k].columns
        b = solution.cofactor.jacobians[k] @ np.take(aside.moves, columns, axis=0)
        for i, v, cofactors, b_i in _near(solution, table, k, b, aside):
            tests = _tests(v, cofactors, -aside.inverse @ b_i.T, aside)
            if tests is not None:
                candidates.append((*tests, table.source, int(table.rows[i])))
    for k, members in problem.blocks:
        candidates += _correlated_moves(problem, solution, k, members, aside)
    candidates = [(significance, *which) for significance, instead, *which in candidates if instead]
    if held is not None and len(held.rows):
        place = aside.one.columns(held.layout)[0] - problem.model.unknowns
        c = np.zeros((len(aside.e), len(held.rows)))
        # Derivatives of the rejected reading by the held coordinates.
        c[:, place[place >= 0]] = aside.jac[:, place >= 0]
        changes = np.vstack([held.changes, np.zeros((1, len(held.rows)))])
        candidates += _release_moves(
            held, c + aside.jac @ changes[aside.columns], aside.inverse, aside.e
        )
    return [one[1:] for one in sorted(candidates, key=lambda one: -one[0])]


@dataclass(frozen=True)
class _Aside:
    """A rejected observation with m values, whitened.

    Attributes
    ----------
    e : ndarray, shape (m,)
        Difference from its expectation.
    jac : ndarray, shape (m, K)
        Derivatives.
    columns : ndarray of int, shape (K,)
        Columns of the unknowns.
    moves : ndarray, shape (unknowns + 1, m)
        Q J', with a final row of zeros.
    inverse : ndarray, shape (m, m)
        S^-1.
    one : Observations
    members : Members or None
        Block of the observation.
    follows : ndarray, shape (m, k), or None
        -L_i^-1 S, change of e by biases of the adjusted values of the block.
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
            indices = np.flatnonzero(problem.rows_of[number] == row)
            one = problem.observations[number].taken(indices).using(np.ones(1))
            columns = problem.model.groups[number].columns[indices]
            e, jac = np.empty((1, one.rows)), np.empty((1, one.rows, columns.shape[1]))
            one.fill(solution.unknowns, e, jac)
            return _make_aside(solution, e[0], jac[0], columns, one)
    for number, members in problem.blocks:
        indices = np.flatnonzero((members.source == source) & (members.row == row))
        if not len(indices):
            continue
        v, jac = members.block.linearised(solution.unknowns)
        part = observations_in_use(problem, solution, number, members, v)
        off, away, unexplained, share = conditional_expectation(members, part, indices, v, jac)
        # Whiten the difference, so that its covariance without the unknowns is I.
        root = np.linalg.cholesky(unexplained)
        e, jac, share = (solve_triangular(root, one, lower=True) for one in (off, away, share))
        columns = members.block.columns(problem.layout)
        return _make_aside(solution, e, jac, columns, members.block, members, -share)
    return None


def _make_aside(solution, e, jac, columns, *more):
    """The _Aside with Q J' and S^-1."""
    moves = moves_of(solution, columns, jac)
    # S = I + J Q J' is the covariance of the whitened difference.
    inverse = np.linalg.inv(np.eye(len(e)) + jac @ moves[columns[0]])
    return _Aside(e, jac, columns[0], moves, inverse, *more)


def _correlated_moves(problem, solution, number, members, aside):
    """Yield (T of j, whether i agrees without it, source, row) of observations j of a block."""
    if number is None:
        return
    v, _ = members.block.linearised(solution.unknowns)
    part = observations_in_use(problem, solution, number, members, v)
    b = part.a @ aside.moves[part.columns]
    t = part.t - b @ aside.back
    spread = part.spread + b @ aside.inverse @ b.T
    to_aside = -aside.inverse @ b.T
    shift = aside.follows if members is aside.members else np.zeros((len(aside.e), len(part.own)))
    for rows_of_observation in observations_of(members):
        if not members.share[rows_of_observation[0]] > 0:
            continue
        place = np.searchsorted(part.own, rows_of_observation)
        size = np.sqrt(np.sum(part.back[:, place] ** 2, axis=0) + np.sum(shift[:, place] ** 2, 0))
        # Normalize each bias, so that thresholds on eigenvalues are comparable.
        c, d = part.back[:, place] / size, shift[:, place] / size
        cross = to_aside @ c + aside.inverse @ d
        right = c.T @ t + d.T @ aside.back
        cofactors = c.T @ spread @ c + d.T @ to_aside @ c + (to_aside @ c).T @ d
        tests = _tests(right, cofactors + d.T @ aside.inverse @ d, cross, aside)
        if tests is not None:
            yield (
                *tests,
                int(members.source[rows_of_observation[0]]),
                int(members.row[rows_of_observation[0]]),
            )


def _near(solution, table, number, b, aside):
    """Yield observations that are significant with i restored: position, v_j, R_j, B."""
    inverse, back = aside.inverse, aside.back
    # one product of all rows takes a third of the time of many small ones
    flat = b.reshape(-1, b.shape[-1])
    v = table.residual / table.sd - (flat @ back).reshape(b.shape[:2])
    # Diagonal of B S^-1 B': increase of the redundancy of j when i is restored.
    shared = np.einsum("rd,rd->r", flat @ inverse, flat).reshape(b.shape[:2])
    r = table.redundancy + shared
    squares = np.where(r > UNCONTROLLED, v**2 / np.maximum(r, UNCONTROLLED), 0.0)
    square = reduce(np.maximum, squares.T)  # of few values each: faster than a maximum by rows
    near = np.flatnonzero(table.used & (square > WORTH))
    near = near[(b[near] != 0).any(axis=(1, 2))]
    near = near[np.argsort(-square[near], kind="stable")][:LOOKED_AT]
    # The bound is cheap; exact covariances are computed for the remaining observations only.
    near = near[_may_explain(v[near], table.redundancy[near], shared[near].sum(axis=1), aside)]
    if not len(near):
        return
    for j, cofactors in zip(near, cofactors_within(solution.cofactor, number, near), strict=True):
        yield j, v[j], np.eye(len(cofactors)) - cofactors + b[j] @ inverse @ b[j].T, b[j]


def _may_explain(v, redundancy, shared, aside):
    """Mask (n,) of observations without which T may be small, by its lower bound.

    Parameters
    ----------
    v, redundancy : ndarray, shape (n, m)
    shared : ndarray, shape (n,)
        tr B S^-1 B'.
    aside : _Aside
    """
    least = redundancy.sum(axis=1) - (redundancy.shape[1] - 1)
    # If j shares at most half of the remaining redundancy of i, all values of i stay controlled.
    has_bound = (least >= FIRM) & (2 * shared <= least)
    if np.linalg.eigvalsh(aside.inverse)[0] <= 2 * UNCONTROLLED:
        has_bound[:] = False
    moved = np.sqrt(shared) * np.linalg.norm(v, axis=1) / np.where(has_bound, least, 1.0)
    return ~has_bound | (moved >= np.sqrt(aside.e @ aside.back) - np.sqrt(LIMITS[len(aside.e)]))


def _tests(v, cofactors, cross, aside):
    """T of j with i restored, and whether i agrees without j; None if j is not significant."""
    statistic, values = _square(v, cofactors)
    if statistic <= LIMITS[values]:
        return None
    # The pseudo-inverse omits directions of j without redundancy.
    by_j = cross @ np.linalg.pinv(cofactors, rcond=UNCONTROLLED, hermitian=True)
    instead, values = _square(aside.back - by_j @ v, aside.inverse - by_j @ cross.T)
    return statistic, instead <= LIMITS[values]


def _square(v, cofactors):
    """v' R^-1 v and the number of its values, without uncontrolled directions."""
    size, ways = np.linalg.eigh(cofactors)
    # Eigenvectors with an eigenvalue near 0 are combinations without redundancy.
    controlled = size > UNCONTROLLED
    part = ways[:, controlled].T @ v
    return float(np.sum(part**2 / size[controlled])), int(controlled.sum())


def _release_moves(held, r, inverse, e):
    """(T, source, row) of held coordinates whose release makes reading i agree.

    Parameters
    ----------
    held : Reactions
    r : ndarray, shape (m, k)
        Change of the rows of i by each release.
    inverse : ndarray, shape (m, m)
        S^-1.
    e : ndarray, shape (m,)
    """
    before = held.w**2
    square = held.square + np.einsum("mk,mn,nk->k", r, inverse, r)
    reaction = held.reaction - r.T @ inverse @ e
    significance = np.where(held.square > 0, reaction**2 / np.where(square > 0, square, 1.0), 0.0)
    instead = e @ inverse @ e + before - significance
    near = np.flatnonzero((significance > CRITICAL**2) & (instead <= LIMITS[len(e)]))
    return [(significance[i], HELD, int(held.rows[i])) for i in near]
