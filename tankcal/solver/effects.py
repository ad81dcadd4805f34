"""Functions of the unknowns: their variances, and the effect of an error in a row.

An error e of a row J (whitened, in the observation) changes the unknowns by Q J' e. For exact
conditions, an error d in condition i, in the unit of the condition, changes the reduced unknowns by

    D [Q1 Q2] [y; -S22^-1 S21 y],   y = R^-T d

The reactions k of the conditions follow from C'k = -g. Their cofactors are R^-1 (S11 - S12 S22^-1
S21) R^-T.
"""

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.solver.compiled import threads_for
from tankcal.solver.elimination import leverage
from tankcal.solver.model import s_transform

UNTESTED = 1e-10  # relative variance of a reaction below which only rounding remains
AT_ONCE = 4e6  # elements of a dense matrix processed at a time


def variances(cofactors, columns, jac):
    """Variances of functions of the unknowns, including functions that are not observed.

        s2 = J Q J'

    Parameters
    ----------
    cofactors : Cofactors
        Result of the adjustment: `Adjustment.cofactor`.
    columns : ndarray of int, shape (n, K)
        Unknown of each derivative, -1 for a fixed unknown.
    jac : ndarray, shape (n, m, K)
        Derivatives of n times m functions, in the unit of the function per unit of the unknown.

    Returns
    -------
    ndarray, shape (n, m)
        Variance of each function for variance factor 1, in its unit squared.

    Examples
    --------
    The sum of two unknowns, each observed once with a standard uncertainty of 1:

    >>> import numpy as np
    >>> from tankcal.solver import Group, Model, solve
    >>> def fill(x, w, jac):
    ...     w[:, 0] = x - [1.0, 3.0]
    ...     if len(jac):
    ...         jac[:] = 1.0
    >>> group = Group(np.array([[0], [1]]), 1, fill)
    >>> result = solve(Model(2, 0, (group,), lambda x, step: x + step), np.zeros(2))
    >>> variances(result.cofactor, np.array([[0, 1]]), np.ones((1, 1, 2)))
    array([[2.]])
    """
    n, m, _ = jac.shape
    rows, results = sparse_rows(cofactors.model.unknowns, columns, jac), []
    with threads_for(cofactors.plan.reduced):
        for part in _split_rows(n * m, cofactors.plan.reduced + 3):
            results.append(_row_variances(cofactors, rows[part]))
    return np.concatenate(results).reshape(n, m) if results else np.zeros((n, m))


def _row_variances(cofactors, rows):
    """Variances (k,) of sparse rows (k, unknowns)."""
    block_part, reduced = _reduce_rows(cofactors, rows)
    whitened = cofactors.factor.whitened(reduced.T)
    # J Q J' = |E L^-T|^2 + |L_S^-1 D (F - E V^-1 W')'|^2.
    result = (
        np.sum(whitened**2, axis=0)
        + np.asarray(block_part.multiply(block_part).sum(axis=1)).ravel()
    )
    # Datum transformation: J (G M G' - 2 H G') J'.
    if cofactors.datum is not None:
        free, h, m = cofactors.datum
        rows_free, rows_h = rows @ free, rows @ h
        result += np.einsum("nd,nd->n", rows_free @ m - 2 * rows_h, rows_free)
    # Rounding may leave a small negative variance.
    return np.maximum(result, 0.0)


def _reduce_rows(cofactors, rows):
    """Split sparse rows into whitened block parts (sparse) and reduced parts (k, nr)."""
    plan = cofactors.plan
    reduced = rows[:, : plan.reduced].toarray()
    if not plan.blocks:
        return scipy.sparse.csr_array((rows.shape[0], 0)), reduced
    block_rows = rows[:, plan.reduced :]
    # E L^-T, and F - E V^-1 W'.
    whitened_blocks = scipy.sparse.csr_array(block_rows @ cofactors.block_diagonal)
    return whitened_blocks, reduced + block_rows @ cofactors.back_substitution


def responses(cofactors, columns, jac):
    """Iterate over the changes Q J' of all unknowns caused by a unit error in each row.

    Parameters
    ----------
    cofactors : Cofactors
        Result of the adjustment.
    columns : ndarray of int, shape (n, K)
        Unknown of each derivative, -1 for a fixed unknown.
    jac : ndarray, shape (n, m, K)
        Whitened rows of observations; for other functions see `covariances`.

    Yields
    ------
    part : slice
        Range within the n times m rows.
    change : ndarray, shape (unknowns, k)
        Change of the unknowns for each of the k rows in this range.
    """
    n, m, _ = jac.shape
    rows = sparse_rows(cofactors.model.unknowns, columns, jac)
    for part in _split_rows(n * m, cofactors.model.unknowns):
        change = _row_responses(cofactors, rows[part])
        # Observations do not depend on the datum (J G = 0), so that T Q T' J' = Q J' - G H'J'.
        if cofactors.datum is not None:
            free, h, _ = cofactors.datum
            change -= free @ (rows[part] @ h).T
        yield part, change


def covariances(cofactors, columns, jac):
    """Covariances Q J' of all unknowns with functions of the unknowns.

    Unlike `responses`, this function also accepts functions that the observations do not determine.
    Such functions may depend on the datum.

    Parameters
    ----------
    cofactors : Cofactors
        Result of the adjustment.
    columns : ndarray of int, shape (K,)
        Unknown of each derivative, -1 for a fixed unknown.
    jac : ndarray, shape (m, K)
        Derivatives of the functions.

    Returns
    -------
    ndarray, shape (unknowns, m)
        Covariances for variance factor 1.
    """
    rows, result = sparse_rows(cofactors.model.unknowns, columns[None], jac[None]), []
    with threads_for(cofactors.plan.reduced):
        for part in _split_rows(len(jac), cofactors.model.unknowns):
            result.append(_row_responses(cofactors, rows[part]))
    result = np.hstack(result)
    if cofactors.datum is not None:
        free, h, m = cofactors.datum
        # T Q T' J' = Q J' + G (M G'J' - H'J') - H G'J'.
        rows_free = rows @ free
        result += free @ (m @ rows_free.T - (rows @ h).T) - h @ rows_free.T
    return result


def _row_responses(cofactors, rows):
    """Q J' (unknowns, k) of sparse rows (k, unknowns), in the datum of the factor."""
    block_part, reduced = _reduce_rows(cofactors, rows)
    changes = cofactors.back_substitute_covariance(cofactors.factor.solved(reduced.T))
    if cofactors.plan.blocks:
        changes[cofactors.plan.reduced :] += (cofactors.block_diagonal @ block_part.T).toarray()
    return changes


def cofactors_within(cofactors, group, rows):
    """Cofactors J Q J' of the values of each observation with each other.

    Parameters
    ----------
    cofactors : Cofactors
        Result of the adjustment.
    group : int
        Index of the group.
    rows : ndarray of int, shape (n,)
        Indices of distinct observations of the group, in any order.

    Returns
    -------
    ndarray, shape (n, m, m)
        Cofactors for variance factor 1.

    Notes
    -----
    The cofactor of two values follows from the cofactor of their sum: 2 q_ab = q_(a+b)(a+b) - q_aa
    - q_bb.
    """
    jac, plan = cofactors.jacobians[group], cofactors.plan
    values = np.arange(jac.shape[1])
    result = np.zeros((len(rows), len(values), len(values)))
    block_cofactors, cross = cofactors.of_blocks
    for batch in plan.batches:
        if batch.group != group:
            continue
        members, batch = batch.taken(rows, len(jac))
        if not members.any():
            continue
        derivatives, q = (
            batch.of(jac[rows[members]]),
            np.zeros((len(batch.first), *result.shape[1:])),
        )
        # Shift 0 gives the diagonal; each further shift pairs every value with another value.
        for shift in range(len(values) // 2 + 1):
            shifted = (values + shift) % len(values)
            summed = derivatives + derivatives[:, shifted] if shift else derivatives
            q_summed = leverage(
                plan, batch, summed, cofactors.reduced_cofactors, cross, block_cofactors
            )
            if shift:
                diagonal = q[:, values, values]
                q_summed = (q_summed - diagonal - diagonal[:, shifted]) / 2
            q[:, values, shifted] = q[:, shifted, values] = q_summed
        result[members] = q
    return result


def own_responses(cofactors, group, jac):
    """Change of the observed point caused by a unit error in each row.

    Parameters
    ----------
    cofactors : Cofactors
        Result of the adjustment.
    group : int
        Index of a group whose first three columns are the observed point.
    jac : ndarray, shape (n, m, K)
        All rows of the group, whitened.

    Returns
    -------
    ndarray, shape (n, m, 3)
        Change of the three coordinates, in their unit.
    """
    plan, out = cofactors.plan, np.zeros((*jac.shape[:2], 3))
    block_cofactors, cross = cofactors.of_blocks
    # The additional zero row and column stand for fixed unknowns.
    inverse = np.pad(cofactors.reduced_cofactors, (0, 1))
    for batch in plan.batches:
        if batch.group != group:
            continue
        derivatives = batch.of(jac)
        if batch.block is None:
            q = inverse[batch.columns[:, :3, None], batch.columns[:, None, :]]
            out[batch.rows] = np.einsum("nab,nmb->nma", q, derivatives)
            continue
        # Q_bb E' + Q_br F'.
        changes = np.einsum("nab,nmb->nma", block_cofactors[batch.block], derivatives[:, :, :3])
        changes += np.einsum("nka,nmk->nma", cross[batch.places], derivatives[:, :, 3:])
        out[batch.rows] = changes
    # As in `responses`: an observation does not depend on the datum.
    if cofactors.datum is not None:
        columns = cofactors.model.groups[group].columns
        free, h, _ = (np.vstack([part, np.zeros((1, part.shape[1]))]) for part in cofactors.datum)
        rows_h = np.einsum("nmk,nkd->nmd", jac, h[columns])
        out -= np.einsum("nad,nmd->nma", free[columns[:, :3]], rows_h)
    return out


def own_leverage(cofactors, group, jac):
    """Part E V^-1 E' of the leverage of each row that arises within its block.

    Parameters
    ----------
    cofactors : Cofactors
        Result of the adjustment.
    group : int
        Index of the group.
    jac : ndarray, shape (n, m, K)
        All rows of the group, whitened.

    Returns
    -------
    ndarray, shape (n, m)
        Leverage, 0 to 1; 0 for a row without a block.
    """
    out = np.zeros(jac.shape[:2])
    for batch in cofactors.plan.batches:
        if batch.group == group and batch.block is not None:
            e = batch.of(jac)[:, :, :3]
            whitened = np.einsum("nab,nmb->nma", cofactors.inverse_roots[batch.block], e)
            out[batch.rows] = np.sum(whitened**2, axis=2)
    return out


def constraint_reactions(cofactors):
    """Reactions (Lagrange multipliers) of the exact conditions, and their effects.

        C'k = -g,   g the gradient of half the sum of squares at the minimum

    Parameters
    ----------
    cofactors : Cofactors
        Result of the adjustment of a Model with `exact` conditions.

    Returns
    -------
    k : ndarray, shape (m,)
        Reaction of each condition, per unit of the condition.
    sd : ndarray, shape (m,)
        Standard deviation of the reaction for variance factor 1. Like k, it is 0 for a condition
        that follows from other conditions.
    changes : ndarray, shape (unknowns, m)
        Change of all unknowns for a unit change in the value of a condition.

    Examples
    --------
    Two unknowns, observed as 1 and 3 with a standard uncertainty of 1, that must be equal:

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
    >>> observed = Group(np.array([[0], [1]]), 1, fill)
    >>> equal = Group(np.array([[0, 1]]), 1, difference)
    >>> model = Model(2, 0, (observed,), lambda x, step: x + step, exact=(equal,))
    >>> result = solve(model, np.zeros(2))
    >>> result.unknowns.round(9).tolist()
    [2.0, 2.0]
    >>> k, sd, changes = constraint_reactions(result.cofactor)
    >>> k.round(3).tolist(), sd.round(3).tolist(), changes.round(3).tolist()
    ([-1.0], [0.707], [[0.5], [-0.5]])
    """
    factor, conditions = cofactors.factor, cofactors.conditions
    tangent, rank = factor.tangent, factor.tangent.rank
    k, sd = np.zeros(conditions.rows), np.zeros(conditions.rows)
    changes = np.zeros((cofactors.model.unknowns, conditions.rows))
    # Q1' D g: at the minimum the gradient lies in the span of the conditions.
    gradient, _ = tangent.split(factor.scale * _gradient(cofactors))
    s11, s12 = factor.reaction_part[:, :rank], factor.reaction_part[:, rank:]
    # S22^-1 S21: response of the null space to a displacement across the conditions.
    response = scipy.linalg.cho_solve((factor.lower, True), s12.T)
    r_inverse = scipy.linalg.solve_triangular(tangent.r, np.eye(rank))  # R^-1
    q = r_inverse @ (s11 - s12 @ response) @ r_inverse.T
    length, independent_rows = tangent.lengths[tangent.independent], tangent.independent
    k[independent_rows] = -(r_inverse @ gradient) / length
    # A variance that is small against S11 alone is rounding: the observations do not test this
    # condition.
    variance, unreduced = np.diag(q), np.diag(r_inverse @ s11 @ r_inverse.T)
    sd[independent_rows] = (
        np.sqrt(np.where(variance > UNTESTED * unreduced, variance, 0.0)) / length
    )
    # R^-T for a unit change of each condition, whose row was scaled to length one.
    y = r_inverse.T / length
    reduced = factor.scale[:, None] * tangent.from_null_space(-response @ y, y)
    changes[:, independent_rows] = cofactors.back_substitute_covariance(reduced)
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
    """Assemble rows as a sparse matrix over all unknowns.

    Parameters
    ----------
    unknowns : int
        Number of unknowns.
    columns : ndarray of int, shape (n, K)
        Unknown of each derivative, -1 for a fixed unknown.
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


def _split_rows(rows, width):
    """Split rows into slices, so that a dense array of this width stays within AT_ONCE."""
    step = max(1, int(AT_ONCE / max(width, 1)))
    return [slice(first, min(first + step, rows)) for first in range(0, rows, step)]
