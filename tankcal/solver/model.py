"""What a problem hands to the solver, and what stays the same in all iterations of it.

The unknowns are numbered so that the reduced ones come first and the eliminated blocks, three
unknowns each, come last. No row touches two blocks. For each block the plan keeps the sorted list
of reduced columns that occur together with it: its part of the normal matrix is stored for these
columns only, in three rows, one an unknown of the block ("wide"). Neighbouring blocks whose columns
are nearly the same are given those of each other, too, so that they are eliminated together.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.solver import series
from tankcal.solver.compiled import compile_functions, is_worth_compiling


@dataclass(frozen=True)
class Group:
    """Observations of one kind, n of them with m rows each; every row is one whitened equation.

    Attributes
    ----------
    columns : ndarray, shape (n, K)
        Unknown of each derivative, -1 where that one is fixed.
    rows : int
        m.
    fill : callable
        fill(state, w, jac) writes misclosures (computed minus observed, over the sd) into w (n, m)
        and derivatives into jac (n, m, K); a jac of length 0 is left out.
    part : callable
        part(slice) -> what fills these observations alone; None: they are always filled together.
    """

    columns: np.ndarray
    rows: int
    fill: Callable
    part: Callable = None


@dataclass(frozen=True)
class Model:
    """A least-squares problem: minimise the sum of squares of all rows.

    Attributes
    ----------
    reduced : int
        Number of unknowns of the reduced system; they come first.
    blocks : int
        Number of eliminated blocks of three unknowns; they come last.
    groups : tuple
        Tuple of Group; no row touches two eliminated blocks.
    moved : callable
        moved(state, step) -> state, step (reduced + 3 blocks,).
    null_space : callable
        null_space(state) -> (unknowns, d) directions in which nothing is observed (a datum to be
        chosen), or None when the observations give the datum.
    name_of : callable
        name_of(column) -> what the user calls that unknown.
    in_words : callable
        in_words(directions) -> the unknowns that take part in directions (unknowns, d), all columns
        of length one, in words; None: their names.
    inner : ndarray, shape (unknowns,)
        1 where an unknown takes part in the inner constraints that choose the datum of the free
        directions, else 0.
    exact : tuple
        Tuple of Group: rows that are zero exactly, between reduced unknowns only.
    name_of_exact : callable
        name_of_exact(row) -> what the user calls that row, all rows of `exact` counted.
    """

    reduced: int
    blocks: int
    groups: tuple
    moved: Callable
    null_space: Callable = None
    name_of: Callable = str
    in_words: Callable = None
    inner: np.ndarray = None
    exact: tuple = ()
    name_of_exact: Callable = str

    def in_datum(self, state, step):
        """A step (unknowns,) without what the inner constraints forbid; there may be none."""
        if self.null_space is None:
            return step
        null_space = self.null_space(state)
        return s_transform(step, null_space, null_space * self.inner[:, None])

    @property
    def unknowns(self):
        """Number of unknowns."""
        return self.reduced + 3 * self.blocks


def s_transform(change, null_space, datum_basis):
    """A change (unknowns,) or (unknowns, k) brought into the datum: datum_basis' change = 0."""
    return change - null_space @ np.linalg.solve(datum_basis.T @ null_space, datum_basis.T @ change)


@dataclass
class Normals:
    """Normal equations while they are built and eliminated (see tankcal.solver.loops).

    v (nb, 6), b (nb, 3), wide (3 t + 1,), t (nr + 1, nr + 1), g (nr + 1,)
    wide of each block is three rows, one a unknown of it; see Plan.entries
    """

    v: np.ndarray
    b: np.ndarray
    wide: np.ndarray
    t: np.ndarray
    g: np.ndarray

    @classmethod
    def empty(cls, plan):
        """Room for them, to be cleared before anything is added."""
        return cls(
            np.empty((plan.blocks, 6)),
            np.empty((plan.blocks, 3)),
            np.empty(3 * len(plan.columns) + 1),
            np.empty((plan.reduced + 1, plan.reduced + 1)),
            np.empty(plan.reduced + 1),
        )

    def clear(self):
        """Start again without asking for memory; of the wide part the spare number alone."""
        for array in (self.v, self.b, self.t, self.g, self.wide[-1:]):
            array.fill(0.0)


@dataclass(frozen=True)
class Batch:
    """Rows of one group that are treated alike.

    The reduced columns of a row come in runs of neighbours, cut alike in all rows.

    group  number of the group
    rows   which observations of the group: a slice, or (n,)
    order  (n, K) place in the group's derivatives of each of this batch's, or None (as they are)
    block  (n,) block whose derivatives come first, or None
    cuts   (s + 1,) where the runs begin among the k further derivatives; and k at the end
    first  (n, s) column of the first of each run; a fixed unknown is a run, in the spare column
    place  (n, s) where that column and the block meet in the wide part; a spare place for the fixed
    """

    group: int
    rows: object
    order: object
    block: object
    cuts: np.ndarray
    first: np.ndarray
    place: object

    @property
    def columns(self):
        """(n, k) reduced column of each further derivative."""
        return self._spread(self.first)

    @property
    def places(self):
        """(n, k) where each column and the block meet in the wide part."""
        return self._spread(self.place)

    def _spread(self, first):
        lengths = np.diff(self.cuts)
        within = np.arange(self.cuts[-1]) - np.repeat(self.cuts[:-1], lengths)
        return np.repeat(first, lengths, axis=1) + within

    def of(self, array):
        """This batch's part of an array (n, m) of misclosures or (n, m, K) of derivatives."""
        part = array[self.rows]
        if self.order is not None and part.ndim == 3:
            part = np.take_along_axis(part, self.order[:, None, :], axis=2)
        return part

    def taken(self, rows, count):
        """Which of the rows (k,) of its group, which has `count`, are in it; and a Batch of these.

        That Batch has its rows one after the other, in the order given.
        """
        own = np.arange(count)[self.rows]
        place = np.searchsorted(own, rows)
        inside = np.append(own, count)[place] == rows
        place = place[inside]
        order, block, of_wide = (
            None if one is None else one[place] for one in (self.order, self.block, self.place)
        )
        alone = Batch(self.group, slice(None), order, block, self.cuts, self.first[place], of_wide)
        return inside, alone


@dataclass(frozen=True)
class Plan:
    """Structure of the normal equations: nr reduced unknowns, nb blocks of three.

    reduced, blocks   nr, nb
    rows              observations of the largest group
    batches           tuple of Batch
    starts            (nb + 1,) where each block's reduced columns start in `columns`
    columns           (t,) reduced columns of all blocks, ascending in each
    ends              (s + 1,) where in `columns` runs of neighbouring columns begin, t at the end
    runs              (nb + 1,) where in `ends` each block begins
    alike             where series of blocks with the same columns begin, see series; nb at the end
    """

    reduced: int
    blocks: int
    batches: tuple
    starts: np.ndarray
    columns: np.ndarray
    ends: np.ndarray
    runs: np.ndarray
    alike: np.ndarray
    rows: int

    @cached_property
    def entries(self):
        """(t + 1, 3) where in the wide part each of `columns` meets its block; a spare place."""
        length = np.diff(self.starts)
        first = 2 * np.repeat(self.starts[:-1], length) + np.arange(len(self.columns))
        found = first[:, None] + np.repeat(length, length)[:, None] * np.arange(3)
        return np.append(found, np.full((1, 3), 3 * len(self.columns)), axis=0)


def plan(reduced, blocks, groups):
    """The Plan of groups of observations (see tankcal.solver.Group)."""
    raw = []
    for g, group in enumerate(groups):
        for rows, order, block, columns in _split(group.columns, reduced, blocks):
            cuts = _cuts(columns, reduced)
            first = np.ascontiguousarray(columns[:, cuts[:-1]], dtype=np.int32)
            raw.append((g, rows, order, block, cuts, first))
    rows = max((len(group.columns) for group in groups), default=0)
    structure = _structure_by_loops if is_worth_compiling(rows) else _structure
    starts, columns, ends, alike, places = structure(reduced, blocks, raw)
    batches = tuple(Batch(*fields, place) for fields, place in zip(raw, places, strict=True))
    runs = np.searchsorted(ends, starts)
    return Plan(reduced, blocks, batches, starts, columns, ends, runs, alike, rows)


def _structure(reduced, blocks, raw):
    """starts, columns, ends, alike of a Plan, and the places of each Batch."""
    together = np.zeros((blocks, reduced + 1), dtype=bool)
    for _, _, _, block, cuts, first in raw:
        if block is not None:
            _mark(together, block, cuts, first)
    together[:, reduced] = False
    changes = np.flatnonzero((together[1:] != together[:-1]).any(axis=1)) + 1
    alike = np.concatenate([[0], changes, [blocks]]) if blocks else np.zeros(1, dtype=int)
    alike = series._join_series(together, alike, np.ones(reduced + 1, dtype=np.int64))
    met = np.flatnonzero(together)
    starts = np.searchsorted(met, np.arange(blocks + 1) * (reduced + 1))
    owner = np.repeat(np.arange(blocks, dtype=np.int32), np.diff(starts))
    columns = (met - owner * np.int64(reduced + 1)).astype(np.int32)
    place = np.full((blocks, reduced + 1), len(met), dtype=np.int32)
    place.ravel()[met] = np.arange(len(met), dtype=np.int32)
    places = [None if one[3] is None else place[one[3][:, None], one[-1]] for one in raw]
    ends = np.flatnonzero(np.diff(met, prepend=-2, append=-2) != 1)
    return starts, columns, ends, alike, places


def _mark(together, block, cuts, first):
    """Mark (blocks, columns) where rows with a block have columns: first (n, s) of runs."""
    for run, length in enumerate(np.diff(cuts)):
        mine = np.zeros_like(together)
        mine[block, first[:, run]] = True
        reach = 1
        while reach < length:  # each mark spreads to as many neighbours as the run has
            more = min(reach, length - reach)
            mine[:, more:] |= mine[:, :-more]
            reach += more
        together |= mine


def _structure_by_loops(reduced, blocks, raw):
    """The same by compiled loops."""
    run = compile_functions(series, series.COMPILED)
    edges = _edges(reduced, raw)
    widths = edges[1:] - edges[:-1]
    piece_of = np.arange(len(widths)).repeat(widths)
    together = np.zeros((blocks, len(widths)), dtype=bool)
    for _, _, _, block, cuts, first in raw:
        if block is not None:
            run._mark(block, first, cuts, piece_of, together)
    together[:, -1] = False  # the spare column
    alike = run._join_series(together, run._list_series(together), widths)
    starts = np.zeros(blocks + 1, dtype=int)
    columns, ends = run._list_columns(together, edges, alike, starts)
    places = []
    for _, _, _, block, _, first in raw:
        place = None if block is None else np.empty(first.shape, dtype=np.int32)
        if block is not None:
            run._find_places(block, first, reduced, starts, columns, place)
        places.append(place)
    return starts, columns, ends, alike, places


def _edges(reduced, raw):
    """Where pieces of columns begin that rows with a block have together; the spare one is last."""
    begins = np.zeros(reduced + 2, dtype=bool)
    begins[[0, reduced, reduced + 1]] = True
    for _, _, _, block, cuts, first in raw:
        if block is not None:
            begins[first] = True
            begins[first + (cuts[1:] - cuts[:-1])] = True
    return begins.nonzero()[0]


AT_ONCE = 50_000  # rows whose columns are compared at a time


def _cuts(columns, spare):
    """Where runs begin: places at which some row's column is not the one after its neighbour."""
    n, k = columns.shape
    if k == 0 or n == 0:
        return np.arange(k + 1)
    begins = np.zeros(k + 1, dtype=bool)
    begins[0] = begins[k] = True
    if is_worth_compiling(n):
        run = compile_functions(series, series.COMPILED)
        run._find_breaks(np.ascontiguousarray(columns), spare, begins)
    else:
        for start in range(0, n, AT_ONCE):
            part = columns[start : start + AT_ONCE]
            begins[1:k] |= ((np.diff(part, axis=1) != 1) | (part[:, 1:] == spare)).any(axis=0)
    return begins.nonzero()[0]


def _split(columns, reduced, blocks):
    """The rows of a group with a block and those without, the block's derivatives first."""
    spare = columns
    if (columns < 0).any():
        spare = np.where(columns < 0, reduced, columns)
    if blocks == 0 or columns.size == 0:
        return [(slice(None), None, None, spare)]
    eliminated = columns >= reduced
    if eliminated.shape[1] >= 3 and not eliminated[:, 3:].any():
        with_block = np.count_nonzero(eliminated[:, 0])
        if eliminated[:with_block, :3].all():  # rows with a block come first, block first
            first, rest = slice(0, with_block), slice(with_block, None)
            parts = [(rest, None, None, spare[rest])] if with_block < len(spare) else []
            if with_block:
                block = (columns[first, 0] - reduced) // 3
                parts.append((first, None, block, spare[first, 3:]))
            return parts
    order = np.argsort(~eliminated, axis=1, kind="stable")
    has = eliminated.any(axis=1)
    parts = [(np.flatnonzero(~has), None, None, spare[~has])] if not has.all() else []
    if not has.any():
        return parts
    order = order[has]
    moved = np.take_along_axis(spare[has], order, axis=1)
    block = (moved[:, 0] - reduced) // 3
    if (eliminated.sum(axis=1)[has] != 3).any() or (np.diff(moved[:, :3], axis=1) != 1).any():
        raise ValueError("a row touches two eliminated blocks, or a part of one")
    return [*parts, (np.flatnonzero(has), order, block, moved[:, 3:])]
