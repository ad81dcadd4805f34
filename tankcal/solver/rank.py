"""Diagnosis of normal equations that cannot be factored: which unknowns are not determined.

A direction x counts as undetermined if the rows change by less than 1e-7 of its length, for columns
scaled to length one. The change is evaluated in the rows themselves. It stays far above this limit
for a valid survey with very different units or nearly equal parameters.
"""

import numpy as np

from tankcal.messages import message
from tankcal.solver.elimination import back_substitute, eliminate

NOTHING = 1e-7  # relative change of the rows below which a direction is undetermined
FAINT = 1e-9  # eigenvalue of the scaled reduced system below which a direction is a candidate
WEAK = 1e-6  # eigenvalue below which a direction may prevent convergence
NAMES_SHOWN = 8  # unknowns named in a message


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
