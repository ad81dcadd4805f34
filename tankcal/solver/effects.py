"""Functions of the unknowns: their variances, and what an error in a row does to the unknowns.

A row's error e (whitened, observed side) changes the unknowns by Q J' e, with J the row. Where
conditions hold exactly, an error d in condition i changes the reduced unknowns by

    D [Q1 Q2] [y; -S22^-1 S21 y],   y = R^-T d,   d in the condition's own unit

and C'k = -g gives what pulls at it, with cofactors R^-1 (S11 - S12 S22^-1 S21) R^-T.
"""

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.solver.elimination import leverage
from tankcal.solver.model import s_transform
from tankcal.solver.threads import threads_for

UNTESTED = 1e-10  # share of a pull that others cannot take: below it is rounding
AT_ONCE = 4e6  # numbers of a dense part that is worked on at a time


def variances(cofactors, columns, jac):
    """Variances of functions of the unknowns, also of functions that are not observed.

        s2 = J Q J'

    Parameters
    ----------
    cofactors : Cofactors
        Of the adjustment: `Adjustment.cofactor`.
    columns : ndarray, shape (n, K)
        Number of the unknown of each derivative, -1 where it is fixed.
    jac : ndarray, shape (n, m, K)
        Derivatives of n times m functions, unit of the function per unit of the unknown.

    Returns
    -------
    ndarray, shape (n, m)
        Variance of each function for variance factor 1, its unit squared.

    Examples
    --------
    The sum of two unknowns, each observed once with a standard deviation of 1:

    >>> import numpy as np
    >>> from tankcal.solver import Group, Model, solve
    >>> def fill(x, w, jac):
    ...     w[:, 0] = x - [1.0, 3.0]
    ...     if len(jac):
    ...         jac[:] = 1.0
    >>> each = Group(np.array([[0], [1]]), 1, fill)
    >>> found = solve(Model(2, 0, (each,), lambda x, step: x + step), np.zeros(2))
    >>> variances(found.cofactor, np.array([[0, 1]]), np.ones((1, 1, 2)))
    array([[2.]])
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
    """What an error of one in each row changes in all unknowns, Q J', part by part.

    Parameters
    ----------
    cofactors : Cofactors
        Of the adjustment.
    columns : ndarray, shape (n, K)
        Number of the unknown of each derivative, -1 where it is fixed.
    jac : ndarray, shape (n, m, K)
        Whitened rows of observations; for any other functions see `covariances`.

    Yields
    ------
    part : slice
        Which of the n times m rows.
    change : ndarray, shape (unknowns, k)
        Change of the unknowns by each of these k rows.
    """
    n, m, _ = jac.shape
    rows = sparse_rows(cofactors.model.unknowns, columns, jac)
    for part in _parts(n * m, cofactors.model.unknowns):
        found = _response(cofactors, rows[part])
        if cofactors.datum is not None:
            free, h, _ = cofactors.datum
            found -= free @ (rows[part] @ h).T
        yield part, found


def covariances(cofactors, columns, jac):
    """Covariances of all unknowns with functions of some of them, Q J'.

    Unlike in `responses` the functions may be any, not only what observations determine: where a
    datum is chosen they may change with it.

    Parameters
    ----------
    cofactors : Cofactors
        Of the adjustment.
    columns : ndarray, shape (K,)
        Number of the unknown of each derivative, -1 where it is fixed.
    jac : ndarray, shape (m, K)
        Derivatives of the functions.

    Returns
    -------
    ndarray, shape (unknowns, m)
        For variance factor 1.
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


def cofactors_within(cofactors, group, rows):
    """Cofactors of the values of each observation with one another, J Q J'.

    Two values by those of each and of their sum: 2 q_ab = q_(a+b)(a+b) - q_aa - q_bb.

    Parameters
    ----------
    cofactors : Cofactors
        Of the adjustment.
    group : int
        Number of the group.
    rows : ndarray, shape (n,)
        Numbers of its observations, each once, in any order.

    Returns
    -------
    ndarray, shape (n, m, m)
        For variance factor 1.
    """
    jac, plan = cofactors.jacobians[group], cofactors.plan
    values = np.arange(jac.shape[1])
    found = np.zeros((len(rows), len(values), len(values)))
    of_block, cross = cofactors.of_blocks
    for batch in plan.batches:
        if batch.group != group:
            continue
        inside, batch = batch.taken(rows, len(jac))
        if not inside.any():
            continue
        mine, q = batch.of(jac[rows[inside]]), np.zeros((len(batch.first), *found.shape[1:]))
        for shift in range(len(values) // 2 + 1):
            other = (values + shift) % len(values)
            both = mine + mine[:, other] if shift else mine
            q_both = leverage(plan, batch, both, cofactors.reduced_cofactors, cross, of_block)
            if shift:
                own = q[:, values, values]
                q_both = (q_both - own - own[:, other]) / 2
            q[:, values, other] = q[:, other, values] = q_both
        found[inside] = q
    return found


def own_responses(cofactors, group, jac):
    """What an error of one in a row changes in the point that the row is about.

    Parameters
    ----------
    cofactors : Cofactors
        Of the adjustment.
    group : int
        Number of a group whose first three columns are that point.
    jac : ndarray, shape (n, m, K)
        All rows of the group, whitened.

    Returns
    -------
    ndarray, shape (n, m, 3)
        Change of the three unknowns, in their unit.
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
    """The part of each row's leverage that stays within its own block, E V^-1 E'.

    Parameters
    ----------
    cofactors : Cofactors
        Of the adjustment.
    group : int
        Number of the group.
    jac : ndarray, shape (n, m, K)
        All rows of the group, whitened.

    Returns
    -------
    ndarray, shape (n, m)
        Without unit, 0 to 1; 0 for a row without a block.
    """
    out = np.zeros(jac.shape[:2])
    for batch in cofactors.plan.batches:
        if batch.group == group and batch.block is not None:
            e = batch.of(jac)[:, :, :3]
            whitened = np.einsum("nab,nmb->nma", cofactors.inverse_roots[batch.block], e)
            out[batch.rows] = np.sum(whitened**2, axis=2)
    return out


def constraint_reactions(cofactors):
    """Reactions (Lagrange multipliers) of the exact conditions, and what each condition moves.

        C'k = -g,   g the gradient of half the sum of squares at the minimum

    Parameters
    ----------
    cofactors : Cofactors
        Of the adjustment of a Model with `exact` conditions.

    Returns
    -------
    k : ndarray, shape (m,)
        Reaction of each condition, per unit of the condition.
    sd : ndarray, shape (m,)
        Its standard deviation for variance factor 1; 0, as k, for a condition that follows from
        others.
    changes : ndarray, shape (unknowns, m)
        Change of all unknowns when the value of a condition changes by one.

    Examples
    --------
    Two unknowns, observed as 1 and 3 with a standard deviation of 1, that must be equal:

    >>> import numpy as np
    >>> from tankcal.solver import Group, Model, solve
    >>> def fill(x, w, jac):
    ...     w[:, 0] = x - [1.0, 3.0]
    ...     if len(jac):
    ...         jac[:] = 1.0
    >>> def difference(x, w, jac):
    ...     w[0, 0] = x[0] - x[1]
    ...     if len(jac):
    ...         jac[:] = [1.0, -1.0]
    >>> each, equal = Group(np.array([[0], [1]]), 1, fill), Group(np.array([[0, 1]]), 1, difference)
    >>> model = Model(2, 0, (each,), lambda x, step: x + step, exact=(equal,))
    >>> found = solve(model, np.zeros(2))
    >>> found.unknowns.round(9).tolist()
    [2.0, 2.0]
    >>> k, sd, changes = constraint_reactions(found.cofactor)
    >>> k.round(3).tolist(), sd.round(3).tolist(), changes.round(3).tolist()
    ([-1.0], [0.707], [[0.5], [-0.5]])
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
    """All rows as one sparse matrix over the unknowns.

    Parameters
    ----------
    unknowns : int
        Number of unknowns.
    columns : ndarray, shape (n, K)
        Number of the unknown of each derivative, -1 where it is fixed.
    jac : ndarray, shape (n, m, K)
        Derivatives.

    Returns
    -------
    csr_array, shape (n m, unknowns)

    Examples
    --------
    >>> import numpy as np
    >>> sparse_rows(3, np.array([[0, 2]]), np.array([[[5.0, 7.0]]])).toarray()
    array([[5., 0., 7.]])
    """
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
