"""Functions of the unknowns: their variances, and what an error in a row does to the unknowns.

A row's error e (whitened, observed side) changes the unknowns by Q J' e, with J the row. Where
conditions hold exactly, an error d in condition i changes the reduced unknowns by

    D [Q1 Q2] [y; -S22^-1 S21 y],   y = R^-T d,   d in the condition's own unit

and C'k = -g gives what pulls at it, with cofactors R^-1 (S11 - S12 S22^-1 S21) R^-T.
"""

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.solver.model import s_transform
from tankcal.solver.threads import threads_for

UNTESTED = 1e-10  # share of a pull that others cannot take: below it is rounding
AT_ONCE = 4e6  # numbers of a dense part that is worked on at a time


def variances(cofactors, columns, jac):
    """J Q J' of each row (n, m) of any functions of the unknowns, those not in the model too.

    columns  (n, K) unknown of each derivative, -1 where it is fixed
    jac      (n, m, K)
    """
    n, m, _ = jac.shape
    rows, found = sparse_rows(cofactors.model.unknowns, columns, jac), []
    with threads_for(cofactors.plan.reduced):
        for part in _parts(n * m, cofactors.plan.reduced + 3):
            found.append(_variances(cofactors, rows[part]))
    return np.concatenate(found).reshape(n, m) if found else np.zeros((n, m))


def _variances(cofactors, rows):
    own, reduced = _through(cofactors, rows)
    whitened = cofactors.factor.whitened(reduced.T)
    found = np.sum(whitened**2, axis=0) + np.asarray(own.multiply(own).sum(axis=1)).ravel()
    if cofactors.datum is not None:
        free, h, m = cofactors.datum
        by_free, by_h = rows @ free, rows @ h
        found += np.einsum("nd,nd->n", by_free @ m - 2 * by_h, by_free)
    return np.maximum(found, 0.0)


def _through(cofactors, rows):
    """A matrix of rows in whitened blocks (sparse) and, with the blocks eliminated, (k, nr)."""
    plan = cofactors.plan
    reduced = rows[:, : plan.reduced].toarray()
    if not plan.blocks:
        return scipy.sparse.csr_array((rows.shape[0], 0)), reduced
    of_blocks = rows[:, plan.reduced :]
    own = scipy.sparse.csr_array(of_blocks @ cofactors.block_diagonal)
    return own, reduced + of_blocks @ cofactors.back_substitution


def responses(cofactors, columns, jac):
    """Parts (slice of the n m rows, Q J' (unknowns, k)), one after the other; see variances."""
    n, m, _ = jac.shape
    rows = sparse_rows(cofactors.model.unknowns, columns, jac)
    for part in _parts(n * m, cofactors.model.unknowns):
        found = _response(cofactors, rows[part])
        if cofactors.datum is not None:
            free, h, _ = cofactors.datum
            found -= free @ (rows[part] @ h).T
        yield part, found


def covariances(cofactors, columns, jac):
    """Covariance (unknowns, m) of all unknowns with m functions of some of them, Q J'.

    columns  (K,) unknowns, -1 where fixed         jac  (m, K)

    Other than in `responses` the functions may be any, not only what observations can see: where a
    datum is chosen they may change with it.
    """
    rows, found = sparse_rows(cofactors.model.unknowns, columns[None], jac[None]), []
    with threads_for(cofactors.plan.reduced):
        for part in _parts(len(jac), cofactors.model.unknowns):
            found.append(_response(cofactors, rows[part]))
    found = np.hstack(found)
    if cofactors.datum is not None:
        free, h, m = cofactors.datum
        by_free = rows @ free
        found += free @ (m @ by_free.T - (rows @ h).T) - h @ by_free.T
    return found


def _response(cofactors, rows):
    """Q J' (unknowns, k) of a sparse matrix of rows (k, unknowns), in the datum of the factor."""
    own, reduced = _through(cofactors, rows)
    found = cofactors.back_substitute_covariance(cofactors.factor.solved(reduced.T))
    if cofactors.plan.blocks:
        found[cofactors.plan.reduced :] += (cofactors.block_diagonal @ own.T).toarray()
    return found


def cofactors_within(cofactors, columns, jac):
    """Cofactors J Q J' (n, m, m) of the rows of each observation among themselves; see variances.

    For a few observations: the cofactors of all their unknowns are worked out at once.
    """
    free = columns >= 0
    unknowns, place = np.unique(columns[free], return_inverse=True)
    places = np.full(columns.shape, len(unknowns))
    places[free] = place
    q = np.pad(cofactors.among(unknowns), (0, 1))
    return jac @ q[places[:, :, None], places[:, None, :]] @ jac.transpose(0, 2, 1)


def own_responses(cofactors, group, jac):
    """Change (n, m, 3) of the three unknowns that a group's rows name first, by an error of one.

    group  number of a group whose first three columns are the point that a row is about
    jac    (n, m, K) of all its rows
    """
    plan, out = cofactors.plan, np.zeros((*jac.shape[:2], 3))
    of_block, cross = cofactors.of_blocks
    inverse = np.pad(cofactors.reduced_cofactors, (0, 1))
    for batch in plan.batches:
        if batch.group != group:
            continue
        mine = batch.of(jac)
        if batch.block is None:
            q = inverse[batch.columns[:, :3, None], batch.columns[:, None, :]]
            out[batch.rows] = np.einsum("nab,nmb->nma", q, mine)
            continue
        found = np.einsum("nab,nmb->nma", of_block[batch.block], mine[:, :, :3])
        found += np.einsum("nka,nmk->nma", cross[batch.places], mine[:, :, 3:])
        out[batch.rows] = found
    if cofactors.datum is not None:
        columns = cofactors.model.groups[group].columns
        free, h, _ = (np.vstack([part, np.zeros((1, part.shape[1]))]) for part in cofactors.datum)
        by_h = np.einsum("nmk,nkd->nmd", jac, h[columns])
        out -= np.einsum("nad,nmd->nma", free[columns[:, :3]], by_h)
    return out


def own_leverage(cofactors, group, jac):
    """E V^-1 E' of each row (n, m): the part of its leverage that stays within its block."""
    out = np.zeros(jac.shape[:2])
    for batch in cofactors.plan.batches:
        if batch.group == group and batch.block is not None:
            e = batch.of(jac)[:, :, :3]
            whitened = np.einsum("nab,nmb->nma", cofactors.inverse_roots[batch.block], e)
            out[batch.rows] = np.sum(whitened**2, axis=2)
    return out


def constraint_reactions(cofactors):
    """What pulls at the exact conditions: k (m,), its sd (m,), and changes (unknowns, m).

    The changes are those of all unknowns when a condition's value changes by one. Conditions that
    follow from others have k and sd 0 and change nothing.
    """
    factor, conditions = cofactors.factor, cofactors.conditions
    tangent, rank = factor.tangent, factor.tangent.rank
    k, sd = np.zeros(conditions.rows), np.zeros(conditions.rows)
    changes = np.zeros((cofactors.model.unknowns, conditions.rows))
    first, _ = tangent.split(factor.scale * _gradient(cofactors))
    s11, s12 = factor.reaction_part[:, :rank], factor.reaction_part[:, rank:]
    follow = scipy.linalg.cho_solve((factor.lower, True), s12.T)
    back = scipy.linalg.solve_triangular(tangent.r, np.eye(rank))  # R^-1
    q = back @ (s11 - s12 @ follow) @ back.T
    length, which = tangent.lengths[tangent.independent], tangent.independent
    k[which] = -(back @ first) / length
    variance, alone = np.diag(q), np.diag(back @ s11 @ back.T)
    sd[which] = np.sqrt(np.where(variance > UNTESTED * alone, variance, 0.0)) / length
    y = back.T / length
    reduced = factor.scale[:, None] * tangent.from_null_space(-follow @ y, y)
    changes[:, which] = cofactors.back_substitute_covariance(reduced)
    if cofactors.datum is not None:
        changes = s_transform(changes, factor.null_space, factor.datum_basis)
    return k, sd, changes


def _gradient(cofactors):
    """Gradient (nr,) of half the sum of squares by the reduced unknowns, at the minimum."""
    gradient = np.zeros(cofactors.model.unknowns + 1)
    jacobians = cofactors.jacobians
    for group, w, jac in zip(cofactors.model.groups, cofactors.misclosures, jacobians, strict=True):
        np.add.at(gradient, group.columns, np.einsum("nmk,nm->nk", jac, w))
    return gradient[: cofactors.plan.reduced]


def sparse_rows(unknowns, columns, jac):
    """All rows (n m, unknowns) as one sparse matrix; columns (n, K), -1 where fixed."""
    n, m, k = jac.shape
    place = np.broadcast_to(columns[:, None, :], jac.shape).reshape(n * m, k)
    row = np.broadcast_to(np.arange(n * m)[:, None], (n * m, k))
    free = place >= 0
    return scipy.sparse.csr_array(
        (jac.reshape(n * m, k)[free], (row[free], place[free])), shape=(n * m, unknowns)
    )


def _parts(rows, width):
    """Slices of so many rows that a dense array of that width stays small."""
    step = max(1, int(AT_ONCE / max(width, 1)))
    return [slice(first, min(first + step, rows)) for first in range(0, rows, step)]
