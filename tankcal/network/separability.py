"""What else would explain a blunder: readings without which the one set aside agrees again.

With a set-aside observation i back (residual e, whitened row J, S = 1 + J Q J') and B = J_j Q J',
the residuals of i and of another one j, and their covariances, are

    v_i = S^-1 e,   R_i = S^-1,   v_j = v - B S^-1 e,   R_j = (1 - J_j Q J_j') + B S^-1 B',
    R_ij = -S^-1 B'

Without j in its place, i is tested by

    T = u' M^-1 u,   u = v_i - R_ij R_j^-1 v_j,   M = R_i - R_ij R_j^-1 R_ji

and j may be the blunder as well when T is insignificant (0.1 %) and j itself is not. Image points
are pairs, here as in the search. A coordinate that is held is released: with its reaction g and
square q (see `reactions`), and r = C_i + J X, both become g - r' S^-1 e and q + r' S^-1 r.
Source: Foerstner 1983, Reliability and discernability of extended Gauss-Markov models.
"""

import numpy as np
from scipy.special import chdtri

from tankcal.gauss_markov.effects import cofactors_within, responses
from tankcal.network.cleaning import CRITICAL
from tankcal.network.reactions import HELD
from tankcal.network.reliability import UNCONTROLLED

LIMITS = (0.0, CRITICAL**2, float(chdtri(2, 0.001)))  # of T, by the number of values tested
WORTH = 0.5 * CRITICAL**2  # w^2 of a single value from which its observation is looked at
LOOKED_AT = 200  # observations of a group, the worst


def alternatives(adjusted, source, row, held=None):
    """[(source, row)] of readings that may be the blunder in place of one that was set aside.

    held  Reactions of held coordinates, which may be wrong as well; None: they are not asked

    The likeliest first. Empty where the survey tells them apart.
    """
    problem, solution = adjusted.problem, adjusted.solution
    of_source = [k for k, one in enumerate(problem.sources) if one == source]
    number = next((k for k in of_source if row in problem.rows_of[k]), None)
    if number is None:
        return []  # its points are no longer adjusted, or it is correlated with others
    mine = np.flatnonzero(problem.rows_of[number] == row)
    whole = problem.observations[number].taken(mine)
    whole = whole.using(np.ones(1))
    e = np.empty((1, whole.rows))
    jac = np.empty((1, whole.rows, problem.model.groups[number].columns.shape[1]))
    whole.fill(solution.state, e, jac)
    columns = problem.model.groups[number].columns[mine]
    moves = np.hstack([part for _, part in responses(solution, columns, jac)])
    moves = np.vstack([moves, np.zeros((1, moves.shape[1]))])
    inverse = np.linalg.inv(np.eye(whole.rows) + jac[0] @ moves[columns[0]])
    back, found = inverse @ e[0], []
    for k, table in enumerate(adjusted.residuals[: len(problem.sources) - len(problem.blocks)]):
        if table.source == "known beforehand":
            continue
        b = solution.jacobians[k] @ np.take(moves, problem.model.groups[k].columns, axis=0)
        for i, blocks in _near(solution, problem, table, k, b, inverse, back):
            own, instead = _tests(*blocks, inverse, back)
            if own is not None and instead is not None:
                found.append((own, table.source, int(table.rows[i])))
    if held is not None and len(held.rows):
        c = np.zeros((whole.rows, len(held.rows)))
        place = whole.columns(held.layout)[0] - problem.model.unknowns
        c[:, place[place >= 0]] = jac[0][:, place >= 0]
        found += _released(held, c + jac[0] @ np.vstack([held.changes, 0 * c[:1]])[columns[0]],
                           inverse, e[0])  # fmt: skip
    return [one[1:] for one in sorted(found, key=lambda one: -one[0])]


def _near(solution, problem, table, number, b, inverse, back):
    """Observations that stand out with i back: place, (v_j, R_j, B)."""
    v = table.residual / table.sd - b @ back
    r = table.redundancy + np.einsum("nmd,nmd->nm", b @ inverse, b)
    square = np.where(r > UNCONTROLLED, v**2 / np.maximum(r, UNCONTROLLED), 0.0).max(axis=1)
    near = np.flatnonzero(table.used & (square > WORTH) & (b != 0).any(axis=(1, 2)))
    near = near[np.argsort(-square[near], kind="stable")][:LOOKED_AT]
    if not len(near):
        return
    columns, jac = problem.model.groups[number].columns[near], solution.jacobians[number][near]
    for j, own in zip(near, cofactors_within(solution, columns, jac), strict=True):
        yield j, (v[j], np.eye(len(own)) - own + b[j] @ inverse @ b[j].T, b[j])


def _tests(v, cofactors, b, inverse, back):
    """T of j with i back, None: insignificant; T of i without j, None: significant."""
    own = _square(v, cofactors)
    if own[0] <= LIMITS[own[1]]:
        return None, None
    cross = -inverse @ b.T
    by_j = cross @ np.linalg.pinv(cofactors, rcond=UNCONTROLLED, hermitian=True)
    instead = _square(back - by_j @ v, inverse - by_j @ cross.T)
    return own[0], instead[0] if instead[0] <= LIMITS[instead[1]] else None


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
