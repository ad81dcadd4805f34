"""The normal equations of a plan: compiled loops where they can be had, else whole arrays.

Both forms give the same numbers but for rounding; see tankcal.solver.loops for the equations.
"""

import numpy as np
import scipy.sparse

from tankcal.solver import loops
from tankcal.solver.compiled import compile_functions, is_worth_compiling


def add_rows(plan, batch, w, jac, normals):
    """Add rows of a Batch of a Plan, w (n, m) and jac (n, m, K), to the Normals."""
    if is_worth_compiling():
        has = batch.block is not None
        block, place = (batch.block, batch.place) if has else (batch.first, batch.first)
        compile_functions(loops, loops.COMPILED)._add_rows(
            w, jac, has, block.ravel(), batch.first, place, batch.cuts, plan.starts,
            normals.v, normals.wide, normals.b, normals.t, normals.g,
        )  # fmt: skip
        return
    f, columns = jac, batch.columns
    if batch.block is not None:
        e, f = jac[:, :, :3], jac[:, :, 3:]
        square = np.einsum("nma,nmb->nab", e, e)
        np.add.at(normals.v, batch.block, square[:, *np.tril_indices(3)])
        np.add.at(normals.b, batch.block, np.einsum("nma,nm->na", e, w))
        np.add.at(normals.wide, plan.entries[batch.places], np.einsum("nmk,nma->nka", f, e))
    np.add.at(normals.g, columns, np.einsum("nmk,nm->nk", f, w))
    once = np.triu(np.ones((f.shape[2],) * 2)) * np.einsum("nma,nmb->nab", f, f)
    np.add.at(normals.t, (columns[:, :, None], columns[:, None, :]), once)


def eliminate(plan, normals, damping, smallest):
    """Eliminate the blocks in place; the first block that is not determined, or -1."""
    if is_worth_compiling(plan.rows):
        return compile_functions(loops, loops.COMPILED)._eliminate(
            normals.v, normals.wide, normals.b, plan.starts, plan.columns, plan.runs, plan.ends,
            plan.alike, normals.t, normals.g, damping, smallest,
        )  # fmt: skip
    below = np.tril(normals.t, -1)  # add_rows has put each pair somewhere: into the upper half
    normals.t += below.T - below
    v = np.zeros((plan.blocks, 3, 3))
    v[:, *np.tril_indices(3)] = normals.v
    v += np.tril(v, -1).transpose(0, 2, 1)
    diagonal = np.einsum("nii->ni", v)
    before = diagonal.copy()
    diagonal *= 1 + damping
    scale = np.sqrt(np.where(before > 0, before, 1.0))
    values = np.linalg.eigvalsh(v / (scale[:, :, None] * scale[:, None, :]))
    bad = np.flatnonzero(~(values[:, 0] > smallest))
    if len(bad):
        return int(bad[0])
    root = np.linalg.cholesky(v)
    normals.v[:] = root[:, *np.tril_indices(3)]
    normals.b[:] = np.linalg.solve(root, normals.b[:, :, None])[:, :, 0]
    owner = np.repeat(np.arange(plan.blocks), np.diff(plan.starts))
    entries = plan.entries[:-1]
    normals.wide[entries] = np.linalg.solve(root[owner], normals.wide[entries, None])[:, :, 0]
    y = block_rows(plan, normals.wide)
    normals.t[:-1, :-1] -= np.triu((y.T @ y).toarray())
    normals.g[:-1] -= y.T @ normals.b.ravel()
    return -1


def block_rows(plan, wide):
    """The wide part as a sparse matrix (3 nb, nr)."""
    ends = np.cumsum(np.repeat(np.diff(plan.starts), 3))
    columns = np.empty(3 * len(plan.columns), dtype=plan.columns.dtype)
    columns[plan.entries[:-1]] = plan.columns[:, None]
    return scipy.sparse.csr_array(
        (wide[:-1], columns, np.append(0, ends)), shape=(3 * plan.blocks, plan.reduced)
    )


def back_substitute(plan, normals, reduced):
    """L^-T (y + Y' reduced) of each block (nb, 3); the blocks' step is this with the other sign."""
    if is_worth_compiling(plan.rows):
        out = np.empty((plan.blocks, 3))
        compile_functions(loops, loops.COMPILED)._back(
            normals.v, normals.wide, normals.b, plan.starts, plan.columns, plan.alike, reduced, out
        )
        return out
    right = normals.b + (block_rows(plan, normals.wide) @ reduced).reshape(-1, 3)
    return np.linalg.solve(roots(normals).transpose(0, 2, 1), right[:, :, None])[:, :, 0]


def roots(normals):
    """The Cholesky factors L (nb, 3, 3) of eliminated blocks."""
    v = np.zeros((len(normals.v), 3, 3))
    v[:, *np.tril_indices(3)] = normals.v
    return v


def inverse_roots(normals):
    """L^-1 (nb, 3, 3) of eliminated blocks."""
    a, b, c, d, e, f = normals.v.T
    inverse = np.zeros((len(normals.v), 3, 3))
    inverse[:, 0, 0], inverse[:, 1, 1], inverse[:, 2, 2] = 1 / a, 1 / c, 1 / f
    inverse[:, 1, 0], inverse[:, 2, 1] = -b / (a * c), -e / (c * f)
    inverse[:, 2, 0] = (b * e / c - d) / (a * f)
    return inverse


def through_reduced(plan, normals, unknowns):
    """How each of some unknowns (k,) follows the reduced ones: (nr, k), d unknown / d reduced."""
    nr = plan.reduced
    out = np.zeros((len(unknowns), nr))
    if is_worth_compiling(plan.rows):
        compile_functions(loops, loops.COMPILED)._through(
            normals.v, normals.wide, plan.starts, plan.columns, unknowns, nr, out
        )
        return out.T
    own, eliminated = np.flatnonzero(unknowns < nr), np.flatnonzero(unknowns >= nr)
    out[own, unknowns[own]] = 1.0
    block, axis = np.divmod(unknowns[eliminated] - nr, 3)
    first, count = plan.starts[block], np.diff(plan.starts)[block]
    entry = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    length, place = np.repeat(count, count), np.repeat(2 * first, count) + entry
    change = np.zeros(len(entry))
    for root in inverse_roots(normals)[block, :, axis].T:  # one for each row of the wide part
        change -= np.repeat(root, count) * normals.wide[place]
        place += length
    out[np.repeat(eliminated, count), plan.columns[entry]] = change
    return out.T


def add_own_cofactors(plan, normals, unknowns, q):
    """Add V^-1 between those of some unknowns (k,) that belong to one block to q (k, k)."""
    places = np.flatnonzero(unknowns >= plan.reduced)
    block, axis = np.divmod(unknowns[places] - plan.reduced, 3)
    order = np.argsort(block, kind="stable")
    block, axis, places = block[order], axis[order], places[order]
    if is_worth_compiling(plan.rows):
        run = compile_functions(loops, loops.COMPILED)
        run._add_own(normals.v, block, axis, places, q)
        return
    root = inverse_roots(normals)
    inverse = root.transpose(0, 2, 1) @ root
    for shift in range(3):  # pairs that lie 0, 1 or 2 apart once sorted by block
        i = np.flatnonzero(block[shift:] == block[: len(block) - shift])
        j = i + shift
        value = inverse[block[i], axis[i], axis[j]]
        q[places[i], places[j]] += value
        if shift:
            q[places[j], places[i]] += value


def block_cofactors(plan, normals, inverse):
    """Cofactors (nb, 3, 3) of all blocks, and (t, 3) of each block with its reduced columns.

    inverse  (nr, nr) cofactor matrix of the reduced unknowns, row by row
    """
    cross, out = np.empty((len(plan.columns) + 1, 3)), np.empty((plan.blocks, 3, 3))
    cross[-1] = 0.0
    if is_worth_compiling(plan.rows):
        compile_functions(loops, loops.COMPILED)._cofactors(
            normals.v, normals.wide, plan.starts, plan.columns, plan.runs, plan.ends, plan.alike,
            inverse, cross, out,
        )  # fmt: skip
        return out, cross
    root = np.linalg.inv(roots(normals))
    for o in range(plan.blocks):
        here = slice(plan.starts[o], plan.starts[o + 1])
        z = normals.wide[plan.entries[here]] @ root[o]
        columns = plan.columns[here]
        cross[here] = -inverse[np.ix_(columns, columns)] @ z
        out[o] = root[o].T @ root[o] - z.T @ cross[here]
    return out, cross


def leverage(plan, batch, jac, inverse, cross, cofactors):
    """J Q J' of each row (n, m): one minus the redundancy number.

    inverse, cross, cofactors  of the reduced unknowns, and as block_cofactors gives them
    """
    spare = plan.reduced
    if batch.block is not None and is_worth_compiling(plan.rows):
        out = np.empty(jac.shape[:2])
        compile_functions(loops, loops.COMPILED)._leverage(
            jac, batch.block, batch.first, batch.place, batch.cuts,
            inverse, cross, cofactors, spare, out,
        )  # fmt: skip
        return out
    padded = np.pad(inverse, (0, 1))
    f = jac if batch.block is None else jac[:, :, 3:]
    columns = batch.columns
    q = padded[columns[:, :, None], columns[:, None, :]]
    out = np.einsum("nma,nab,nmb->nm", f, q, f)
    if batch.block is not None:
        e, mixed = jac[:, :, :3], cross[batch.places]
        out += np.einsum("nma,nab,nmb->nm", e, cofactors[batch.block], e)
        out += 2 * np.einsum("nma,nka,nmk->nm", e, mixed, f)
    return out
