"""Which unknowns are not determined, when the normal equations cannot be factored.

A direction x counts as not determined when the rows, with all columns scaled to length one, change
by less than 1e-7 of its length: measured in the rows themselves, where a sound survey with very
different units or nearly equal parameters stays far above it.
"""

import numpy as np

from tankcal.messages import message
from tankcal.solver.elimination import back_substitute, eliminate

NOTHING = 1e-7
FAINT = 1e-9  # eigenvalue of the scaled reduced system that makes a direction a candidate
WEAK = 1e-6  # eigenvalue of a direction along which an iteration may stray
NAMES_SHOWN = 8


def diagnosis(work, state, bad_block):
    """One line that names the unknowns that are not determined, or None when all are."""
    model = work.model
    if bad_block is not None:
        first = model.reduced + 3 * bad_block
        names = ", ".join(model.name_of(column) for column in range(first, first + 3))
        return message("undetermined", "not determined by the observations: {names}", names=names)
    directions, lengths = null_space(work, state)
    if model.null_space is not None:
        directions = _without(directions, model.null_space(state) * lengths[:, None])
    if not directions.shape[1]:
        return None
    told = _in_words(model, directions)
    return message(
        "rank_defect",
        "rank defect {defect}: not determined by the observations: {told}",
        defect=directions.shape[1],
        told=told,
    )


def weakness(work, state):
    """Words on the direction that the rows feel least, or "" when they feel all."""
    model = work.model
    directions, lengths = null_space(work, state, WEAK, np.inf)
    if model.null_space is not None:
        directions = _without(directions, model.null_space(state) * lengths[:, None])
    if not directions.shape[1]:
        return ""
    return message(
        "hardly_felt",
        "; hardly determined by the observations: {unknowns}",
        unknowns=_in_words(model, directions[:, :1]),
    )


def _in_words(model, directions):
    """The unknowns that take part in directions (unknowns, d)."""
    if model.in_words is not None:
        return model.in_words(directions)
    size = np.sqrt(np.sum(directions**2, axis=1))
    worst = np.argsort(-size)[:NAMES_SHOWN]
    worst = worst[size[worst] > 0.1 * size.max()]
    return ", ".join(model.name_of(int(column)) for column in worst)


def null_space(work, state, faint=FAINT, nothing=NOTHING):
    """Directions (unknowns, d) that the rows do not feel, and the columns' lengths (unknowns,).

    The directions are in units of columns of length one, and obey the exact conditions.
    faint  eigenvalue, see FAINT      nothing  see NOTHING
    """
    normals, nr = work.normals, work.plan.reduced
    work.rows.add(state)
    diagonal = normals.t.diagonal()[:nr].copy(), normals.v[:, [0, 2, 5]].ravel()
    lengths = np.sqrt(np.concatenate(diagonal))
    scale = 1.0 / np.where(lengths > 0, lengths, 1.0)
    eliminate(work.plan, normals, 0.0, 0.0)
    s = np.triu(normals.t[:nr, :nr])
    s += np.triu(s, 1).T
    s = s * scale[:nr] * scale[:nr, None]
    tangent = work.conditions.tangent(state, scale[:nr]) if work.conditions else None
    values, vectors = np.linalg.eigh(s if tangent is None else tangent.square(s)[0])
    if tangent is not None:
        vectors = tangent.from_null_space(vectors)
    normals.b[:] = 0.0
    found, derivatives = [], work.rows.derivatives(state)
    for vector in vectors[:, values < faint].T:
        reduced = vector * scale[:nr]
        direction = np.concatenate([reduced, -back_substitute(work.plan, normals, reduced).ravel()])
        length = np.linalg.norm(direction / scale)
        if _felt(work.model, derivatives, direction) < nothing * length:
            found.append(direction / scale / length)
    found = np.array(found).T if found else np.zeros((work.model.unknowns, 0))
    return found, lengths


def _without(directions, null_space):
    """The directions that are left when those that the datum fixes are taken out."""
    basis = np.linalg.qr(null_space)[0]
    vectors, sizes, _ = np.linalg.svd(
        directions - basis @ (basis.T @ directions), full_matrices=False
    )
    return vectors[:, sizes > 0.1]


def _felt(model, derivatives, direction):
    """Root of the sum of squares of what a direction (unknowns,) changes in the rows."""
    direction = np.append(direction, 0.0)
    total = 0.0
    for group, jac in zip(model.groups, derivatives, strict=True):
        change = np.einsum("nmk,nk->nm", jac, direction[group.columns])
        total += float(np.vdot(change, change))
    return np.sqrt(total)
