"""Normal equations of a plan: compiled loops if available, otherwise array operations.

Both forms give equal numbers except for rounding. See tankcal.solver.loops for the equations.

Rows of a Model, evaluated and added to the normal equations in parts.

Only the misclosures of all rows are stored. The derivatives of a part remain in the cache of the
processor until they are added. The next part overwrites them. In a large network, all derivatives
would need more memory than all other data.
"""

from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
import scipy.sparse

from tankcal.solver import loops
from tankcal.solver.compiled import compile_functions, is_worth_compiling, problem_of
from tankcal.solver.model import Normals, plan

PART = 4096  # observations evaluated together


def add_rows(plan, batch, w, jac, normals):
    """Add rows of a batch to the normal equations.

    Parameters
    ----------
    plan : Plan
        Structure of the normal equations.
    batch : Batch
        Description of the rows.
    w : ndarray, shape (n, m)
        Whitened misclosures.
    jac : ndarray, shape (n, m, K)
        Whitened derivatives; with a block, its three derivatives come first.
    normals : Normals
        Changed in place.
    """
    if is_worth_compiling():
        has_block = batch.block is not None
        block, place = (batch.block, batch.place) if has_block else (batch.first, batch.first)
        compile_functions(loops, loops.COMPILED)._add_rows(
            w, jac, has_block, block.ravel(), batch.first, place, batch.cuts, plan.starts,
            normals.v, normals.wide, normals.b, normals.t, normals.g,
        )  # fmt: skip
        return
    # E: derivatives by the block, F: derivatives by the reduced unknowns.
    f, columns = jac, batch.columns
    if batch.block is not None:
        e, f = jac[:, :, :3], jac[:, :, 3:]
        square = np.einsum("nma,nmb->nab", e, e)
        np.add.at(normals.v, batch.block, square[:, *np.tril_indices(3)])
        np.add.at(normals.b, batch.block, np.einsum("nma,nm->na", e, w))
        np.add.at(normals.wide, plan.entries[batch.places], np.einsum("nmk,nma->nka", f, e))
    # g += F'w. Fixed unknowns accumulate in the spare column and are ignored later.
    np.add.at(normals.g, columns, np.einsum("nmk,nm->nk", f, w))
    # S += F'F: each product once, since only the upper half of S is stored.
    once = np.triu(np.ones((f.shape[2],) * 2)) * np.einsum("nma,nmb->nab", f, f)
    np.add.at(normals.t, (columns[:, :, None], columns[:, None, :]), once)


def eliminate(plan, normals, damping, smallest):
    """Eliminate the blocks from the normal equations, in place.

    Parameters
    ----------
    plan : Plan
        Structure of the normal equations.
    normals : Normals
        Changed in place.
    damping : float
        Relative increase of the diagonal of each block.
    smallest : float
        Smallest eigenvalue of a scaled block that counts as determined.

    Returns
    -------
    int
        Index of the first undetermined block, or -1.
    """
    if is_worth_compiling(plan.rows):
        return compile_functions(loops, loops.COMPILED)._eliminate(
            normals.v, normals.wide, normals.b, plan.starts, plan.columns, plan.runs, plan.ends,
            plan.alike, normals.t, normals.g, damping, smallest,
        )  # fmt: skip
    # add_rows may have stored a product below the diagonal: move it to the upper half.
    lower_half = np.tril(normals.t, -1)
    normals.t += lower_half.T - lower_half
    v = np.zeros((plan.blocks, 3, 3))
    v[:, *np.tril_indices(3)] = normals.v
    v += np.tril(v, -1).transpose(0, 2, 1)
    diagonal = np.einsum("nii->ni", v)
    previous_diagonal = diagonal.copy()
    diagonal *= 1 + damping
    # The rank of a block is judged with unit diagonal, independent of the units.
    scale = np.sqrt(np.where(previous_diagonal > 0, previous_diagonal, 1.0))
    values = np.linalg.eigvalsh(v / (scale[:, :, None] * scale[:, None, :]))
    undetermined = np.flatnonzero(~(values[:, 0] > smallest))
    if len(undetermined):
        return int(undetermined[0])
    # V = L L', y = L^-1 b, Y = wide L^-T.
    root = np.linalg.cholesky(v)
    normals.v[:] = root[:, *np.tril_indices(3)]
    normals.b[:] = np.linalg.solve(root, normals.b[:, :, None])[:, :, 0]
    owner = np.repeat(np.arange(plan.blocks), np.diff(plan.starts))
    entries = plan.entries[:-1]
    normals.wide[entries] = np.linalg.solve(root[owner], normals.wide[entries, None])[:, :, 0]
    # Schur complement: S - Y Y' and g - Y y; here y holds Y' in the rows of the blocks.
    y = block_rows(plan, normals.wide)
    normals.t[:-1, :-1] -= np.triu((y.T @ y).toarray())
    normals.g[:-1] -= y.T @ normals.b.ravel()
    return -1


def block_rows(plan, wide):
    """Wide part of the normal equations as a sparse matrix (3 nb, nr)."""
    # Each block has three rows with the same columns.
    ends = np.cumsum(np.repeat(np.diff(plan.starts), 3))
    columns = np.empty(3 * len(plan.columns), dtype=plan.columns.dtype)
    columns[plan.entries[:-1]] = plan.columns[:, None]
    return scipy.sparse.csr_array(
        (wide[:-1], columns, np.append(0, ends)), shape=(3 * plan.blocks, plan.reduced)
    )


def back_substitute(plan, normals, reduced):
    """Solve the blocks for given reduced unknowns: L^-T (y + Y' reduced), shape (nb, 3).

    Parameters
    ----------
    plan : Plan
        Structure of the normal equations.
    normals : Normals
        Eliminated normal equations.
    reduced : ndarray, shape (nr,)
        Step of the reduced unknowns.

    Returns
    -------
    ndarray, shape (nb, 3)
        Step of the blocks with the opposite sign.
    """
    if is_worth_compiling(plan.rows):
        out = np.empty((plan.blocks, 3))
        compile_functions(loops, loops.COMPILED)._back(
            normals.v, normals.wide, normals.b, plan.starts, plan.columns, plan.alike, reduced, out
        )
        return out
    right = normals.b + (block_rows(plan, normals.wide) @ reduced).reshape(-1, 3)
    return np.linalg.solve(roots(normals).transpose(0, 2, 1), right[:, :, None])[:, :, 0]


def roots(normals):
    """Cholesky factors L (nb, 3, 3) of eliminated blocks."""
    v = np.zeros((len(normals.v), 3, 3))
    v[:, *np.tril_indices(3)] = normals.v
    return v


def inverse_roots(normals):
    """Inverse Cholesky factors L^-1 (nb, 3, 3) of eliminated blocks."""
    # L = [a 0 0; b c 0; d e f], inverted in closed form.
    a, b, c, d, e, f = normals.v.T
    inverse = np.zeros((len(normals.v), 3, 3))
    inverse[:, 0, 0], inverse[:, 1, 1], inverse[:, 2, 2] = 1 / a, 1 / c, 1 / f
    inverse[:, 1, 0], inverse[:, 2, 1] = -b / (a * c), -e / (c * f)
    inverse[:, 2, 0] = (b * e / c - d) / (a * f)
    return inverse


def through_reduced(plan, normals, unknowns):
    """Derivatives (nr, k) of selected unknowns (k,) by the reduced unknowns."""
    nr = plan.reduced
    out = np.zeros((len(unknowns), nr))
    if is_worth_compiling(plan.rows):
        compile_functions(loops, loops.COMPILED)._through(
            normals.v, normals.wide, plan.starts, plan.columns, unknowns, nr, out
        )
        return out.T
    reduced_places, eliminated = np.flatnonzero(unknowns < nr), np.flatnonzero(unknowns >= nr)
    out[reduced_places, unknowns[reduced_places]] = 1.0
    # A reduced unknown follows itself; an eliminated unknown follows -V^-1 W' = -L^-T Y'.
    block, axis = np.divmod(unknowns[eliminated] - nr, 3)
    first, count = plan.starts[block], np.diff(plan.starts)[block]
    # Entries of all blocks in one vector: start of each block plus a running number.
    entry = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    length, place = np.repeat(count, count), np.repeat(2 * first, count) + entry
    change = np.zeros(len(entry))
    for root in inverse_roots(normals)[block, :, axis].T:  # each row of the wide part
        change -= np.repeat(root, count) * normals.wide[place]
        place += length
    out[np.repeat(eliminated, count), plan.columns[entry]] = change
    return out.T


def add_own_cofactors(plan, normals, unknowns, q):
    """Add V^-1 to the cofactors q (k, k) of selected unknowns (k,) that share a block."""
    places = np.flatnonzero(unknowns >= plan.reduced)
    block, axis = np.divmod(unknowns[places] - plan.reduced, 3)
    # Sorting by block makes the unknowns of a block neighbours, at most two places apart.
    order = np.argsort(block, kind="stable")
    block, axis, places = block[order], axis[order], places[order]
    if is_worth_compiling(plan.rows):
        run = compile_functions(loops, loops.COMPILED)
        run._add_own(normals.v, block, axis, places, q)
        return
    root = inverse_roots(normals)
    inverse = root.transpose(0, 2, 1) @ root
    for shift in range(3):  # pairs at a distance of 0, 1 or 2 after sorting by block
        i = np.flatnonzero(block[shift:] == block[: len(block) - shift])
        j = i + shift
        value = inverse[block[i], axis[i], axis[j]]
        q[places[i], places[j]] += value
        if shift:
            q[places[j], places[i]] += value


def block_cofactors(plan, normals, inverse):
    """Cofactors of all blocks, and of each block with its reduced unknowns.

    Parameters
    ----------
    plan : Plan
        Structure of the normal equations.
    normals : Normals
        Eliminated normal equations.
    inverse : ndarray, shape (nr, nr)
        Cofactor matrix of the reduced unknowns, in row order.

    Returns
    -------
    cofactors : ndarray, shape (nb, 3, 3)
        Cofactors of the blocks.
    cross : ndarray, shape (t + 1, 3)
        Cofactors of each block with its reduced columns; the last row is spare.
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
    # With Z = Y L^-1: Q_rb = -S^-1 Z and Q_bb = V^-1 + Z'S^-1 Z.
    for o in range(plan.blocks):
        block_entries = slice(plan.starts[o], plan.starts[o + 1])
        z = normals.wide[plan.entries[block_entries]] @ root[o]
        columns = plan.columns[block_entries]
        cross[block_entries] = -inverse[np.ix_(columns, columns)] @ z
        out[o] = root[o].T @ root[o] - z.T @ cross[block_entries]
    return out, cross


def leverage(plan, batch, jac, inverse, cross, cofactors):
    """Leverage J Q J' of each row: one minus its redundancy number.

    Parameters
    ----------
    plan : Plan
        Structure of the normal equations.
    batch : Batch
        Description of the rows.
    jac : ndarray, shape (n, m, K)
        Whitened derivatives; with a block, its three derivatives come first.
    inverse : ndarray, shape (nr, nr)
        Cofactors of the reduced unknowns.
    cross, cofactors : ndarray
        As returned by `block_cofactors`.

    Returns
    -------
    ndarray, shape (n, m)
    """
    spare = plan.reduced
    if batch.block is not None and is_worth_compiling(plan.rows):
        out = np.empty(jac.shape[:2])
        compile_functions(loops, loops.COMPILED)._leverage(
            jac, batch.block, batch.first, batch.place, batch.cuts,
            inverse, cross, cofactors, spare, out,
        )  # fmt: skip
        return out
    # The spare column of fixed unknowns has zero cofactors.
    padded = np.pad(inverse, (0, 1))
    f = jac if batch.block is None else jac[:, :, 3:]
    columns = batch.columns
    q = padded[columns[:, :, None], columns[:, None, :]]
    out = np.einsum("nma,nab,nmb->nm", f, q, f)
    # F Q_rr F' + E Q_bb E' + 2 E Q_br F'.
    if batch.block is not None:
        e, cross_cofactors = jac[:, :, :3], cross[batch.places]
        out += np.einsum("nma,nab,nmb->nm", e, cofactors[batch.block], e)
        out += 2 * np.einsum("nma,nka,nmk->nm", e, cross_cofactors, f)
    return out


# ---- rows of a Model, evaluated and added to the normal equations in parts


@dataclass(frozen=True)
class Part:
    """Observations of one group that are evaluated together.

    Attributes
    ----------
    fill : callable
        As in Group, for these observations.
    batches : tuple of Batch
        Batches with rows counted within the part.
    w, jac : ndarray, shape (n, m) and (n, m, K)
        Filled by `fill`; the parts of a group share their jac.
    """

    fill: object
    batches: tuple
    w: np.ndarray
    jac: np.ndarray


class Rows:
    """Rows of a Model and their normal equations.

    Parameters
    ----------
    model : Model
        The model.

    Attributes
    ----------
    plan : Plan
        Structure of the normal equations.
    normals : Normals
        Normal equations of the last evaluation.
    misclosures : tuple of ndarray, shape (n, m)
        Whitened misclosures of the last evaluation, one array for each group.
    parts : tuple of Part
        All parts.
    reach : tuple of int
        Length of the wide part used by each part and the parts before it.
    count : int
        Number of rows.
    weighing : int or None
        Number of rows with a non-zero derivative.
    """

    def __init__(self, model):
        self.model = model
        self.plan = plan(model.reduced, model.blocks, model.groups)
        self.normals = Normals.empty(self.plan)
        self.misclosures = tuple(np.zeros((len(g.columns), g.rows)) for g in model.groups)
        self.parts = tuple(part for g in range(len(model.groups)) for part in self._parts(g))
        self.reach = tuple(accumulate((self._reach(part) for part in self.parts), max))
        self.count = sum(w.size for w in self.misclosures)
        self.weighing = None

    def _parts(self, number):
        group, w = self.model.groups[number], self.misclosures[number]
        batches = [batch for batch in self.plan.batches if batch.group == number]
        n, width = group.columns.shape
        divided = self.plan.blocks and group.part and n > PART
        if not divided or not all(isinstance(batch.rows, slice) for batch in batches):
            return [Part(group.fill, tuple(batches), w, np.zeros((n, group.rows, width)))]
        # The parts share one array for their derivatives, which stays in the cache.
        jac, parts = np.zeros((PART, group.rows, width)), []
        for start in range(0, n, PART):
            rows = slice(start, min(start + PART, n))
            batches_within = (_restrict_batch(batch, rows, n) for batch in batches)
            batches_within = tuple(batch for batch in batches_within if len(batch.first))
            parts.append(Part(group.part(rows), batches_within, w[rows], jac[: rows.stop - start]))
        return parts

    def _reach(self, part):
        blocks = [batch.block for batch in part.batches if batch.block is not None]
        last = max((block.max(initial=-1) for block in blocks), default=-1)
        return 3 * self.plan.starts[last + 1]

    def add(self, state, most=np.inf):
        """Evaluate all rows at a state and add them to new normal equations.

        Parameters
        ----------
        state : object
            The state.
        most : float, optional
            Limit of the cost: the evaluation stops as soon as the cost exceeds it.

        Returns
        -------
        float
            Cost: half the sum of squares; infinite above the limit, or if it is not finite.
        """
        with problem_of(self.plan.rows):
            return self._add(state, most)

    def _add(self, state, most):
        self.normals.clear()
        wide, cleared = self.normals.wide, 0
        cost, weighing = 0.0, 0
        for part, reach in zip(self.parts, self.reach, strict=True):
            # Cleared immediately before use, so that it stays in the cache.
            wide[cleared:reach] = 0.0
            cleared = reach
            part.fill(state, part.w, part.jac)
            cost += 0.5 * float(np.vdot(part.w, part.w))
            if most < np.inf and not cost <= most:
                return np.inf
            for batch in part.batches:
                add_rows(self.plan, batch, batch.of(part.w), batch.of(part.jac), self.normals)
            # Derivatives that are zero at the start may become non-zero later; count until all rows
            # have one.
            if self.weighing != self.count:
                weighing += int(np.count_nonzero(part.jac.any(axis=2)))
        wide[cleared:] = 0.0
        if self.weighing != self.count:
            self.weighing = weighing
        return cost if np.isfinite(cost) else np.inf

    def evaluate(self, state):
        """Evaluate the misclosures at a state, without derivatives.

        Parameters
        ----------
        state : object
            The state.

        Returns
        -------
        float
            Half the sum of squares.
        """
        with problem_of(self.plan.rows):
            for part in self.parts:
                part.fill(state, part.w, part.jac[:0])
        return 0.5 * sum(float(np.vdot(w, w)) for w in self.misclosures)

    def derivatives(self, state):
        """Whitened derivatives (n, m, K) at a state, one array for each group."""
        jacobians = []
        for group in self.model.groups:
            n, width = group.columns.shape
            w, jac = np.empty((n, group.rows)), np.zeros((n, group.rows, width))
            with problem_of(self.plan.rows):
                group.fill(state, w, jac)
            jacobians.append(jac)
        return tuple(jacobians)


def _restrict_batch(batch, part, n):
    """Restrict a Batch, whose rows are a slice of n observations, to a part of the rows."""
    first, end, _ = batch.rows.indices(n)
    begin, stop = max(first, part.start), min(end, part.stop)
    # Relative to the batch; the rows of the result are relative to the part.
    selection = slice(begin - first, max(begin, stop) - first)
    return replace(
        batch,
        rows=slice(begin - part.start, stop - part.start),
        block=None if batch.block is None else batch.block[selection],
        first=batch.first[selection],
        place=None if batch.place is None else batch.place[selection],
    )
