"""Description of a problem for the solver, and the structure shared by all iterations.

The reduced unknowns come first. The eliminated blocks, with three unknowns each, come last. No row
depends on two blocks. For each block, the plan stores the sorted list of reduced columns that occur
together with the block. The block's part of the normal matrix is stored for these columns only, in
three rows, one for each unknown of the block ("wide"). Neighbouring blocks with nearly equal
columns receive the union of their columns, so that they are eliminated together.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.solver import series
from tankcal.solver.compiled import compile_functions, is_worth_compiling


@dataclass(frozen=True)
class Group:
    """Observations of one kind: n observations with m rows each, every row a whitened equation.

    Attributes
    ----------
    columns : ndarray of int, shape (n, K)
        Unknown of each derivative, -1 for a fixed unknown.
    rows : int
        Number m of rows of an observation.
    fill : callable
        fill(state, w, jac) writes the misclosures (computed minus observed, divided by the standard
        deviation) into w (n, m) and the derivatives into jac (n, m, K). A jac of length 0 is not
        filled.
    part : callable, optional
        part(slice) -> a `fill` for these observations only. None: the observations are always
        evaluated together.
    """

    columns: np.ndarray
    rows: int
    fill: Callable
    part: Callable = None


@dataclass(frozen=True)
class Model:
    """Least-squares problem: minimise the sum of squares of all rows.

    Attributes
    ----------
    reduced : int
        Number of unknowns of the reduced system; they come first.
    blocks : int
        Number of eliminated blocks of three unknowns; they come last.
    groups : tuple of Group
        Observations; no row depends on two eliminated blocks.
    moved : callable
        moved(state, step) -> the new state, for a step (reduced + 3 blocks,).
    null_space : callable, optional
        null_space(state) -> directions (unknowns, d) in which the observations contain no
        information and a datum is chosen. None: the observations determine the datum.
    name_of : callable
        name_of(column) -> name of the unknown for the user.
    describe_directions : callable, optional
        describe_directions(directions) -> description of the unknowns in directions (unknowns, d),
        given for columns of length one. None: their names.
    inner : ndarray, shape (unknowns,)
        1 for an unknown in the inner constraints that define the datum, else 0.
    exact : tuple of Group
        Rows that are exactly zero, between reduced unknowns only.
    name_of_exact : callable
        name_of_exact(row) -> name of a row of `exact` for the user, counted over all groups.
    """

    reduced: int
    blocks: int
    groups: tuple
    moved: Callable
    null_space: Callable = None
    name_of: Callable = str
    describe_directions: Callable = None
    inner: np.ndarray = None
    exact: tuple = ()
    name_of_exact: Callable = str

    def in_datum(self, state, step):
        """Project a step (unknowns,) onto the inner constraints, if any."""
        if self.null_space is None:
            return step
        null_space = self.null_space(state)
        return s_transform(step, null_space, null_space * self.inner[:, None])

    @property
    def unknowns(self):
        """Number of unknowns."""
        return self.reduced + 3 * self.blocks


def s_transform(change, null_space, datum_basis):
    """Transform changes of the unknowns to a datum (S-transformation).

    Parameters
    ----------
    change : ndarray, shape (unknowns,) or (unknowns, k)
        Changes in any datum.
    null_space : ndarray, shape (unknowns, d)
        Directions G that only the datum fixes.
    datum_basis : ndarray, shape (unknowns, d)
        Inner constraints C: C' change = 0 in the new datum.

    Returns
    -------
    ndarray, shape of `change`

    Notes
    -----
    change - G (C'G)^-1 C' change.

    Examples
    --------
    Three heights, of which only differences are observed, with the mean as datum:

    >>> ones = np.ones((3, 1))
    >>> s_transform(np.array([0.0, 1.0, 5.0]), ones, ones).tolist()
    [-2.0, -1.0, 3.0]
    """
    # Removes the component in the null space that violates C' change = 0.
    return change - null_space @ np.linalg.solve(datum_basis.T @ null_space, datum_basis.T @ change)


@dataclass
class Normals:
    """Normal equations during assembly and elimination, see tankcal.solver.loops.

    Attributes
    ----------
    v : ndarray, shape (nb, 6)
        Lower half of each block V, later of L.
    b : ndarray, shape (nb, 3)
        Right-hand side of each block.
    wide : ndarray, shape (3 t + 1,)
        Wide part: three rows for each block, see Plan.entries; the last element is spare.
    t : ndarray, shape (nr + 1, nr + 1)
        Upper half of the reduced matrix; the last row and column are spare.
    g : ndarray, shape (nr + 1,)
        Right-hand side of the reduced system; the last element is spare.
    """

    v: np.ndarray
    b: np.ndarray
    wide: np.ndarray
    t: np.ndarray
    g: np.ndarray

    @classmethod
    def empty(cls, plan):
        """Allocate normal equations without clearing them."""
        return cls(
            np.empty((plan.blocks, 6)),
            np.empty((plan.blocks, 3)),
            np.empty(3 * len(plan.columns) + 1),
            np.empty((plan.reduced + 1, plan.reduced + 1)),
            np.empty(plan.reduced + 1),
        )

    def clear(self):
        """Set the normal equations to zero; of the wide part, only the spare element."""
        for array in (self.v, self.b, self.t, self.g, self.wide[-1:]):
            array.fill(0.0)


@dataclass(frozen=True)
class Batch:
    """Rows of one group with a common layout.

    The reduced columns of a row consist of runs of neighbours, with equal cuts in all rows.

    Attributes
    ----------
    group : int
        Index of the group.
    rows : slice or ndarray of int, shape (n,)
        Observations of the group.
    order : ndarray of int, shape (n, K), or None
        Index of each derivative of the batch within the derivatives of the group; None: equal
        order.
    block : ndarray of int, shape (n,), or None
        Block whose derivatives come first.
    cuts : ndarray of int, shape (s + 1,)
        Begin of each run among the k further derivatives, and k.
    first : ndarray of int, shape (n, s)
        First column of each run; a fixed unknown is a run in the spare column.
    place : ndarray of int, shape (n, s), or None
        Place of this column and of the block in the wide part; the spare place for a fixed unknown.
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
        """Reduced column (n, k) of each further derivative."""
        return self._spread(self.first)

    @property
    def places(self):
        """Place (n, k) of each column and of the block in the wide part."""
        return self._spread(self.place)

    def _spread(self, first):
        """Expand values (n, s) for the first columns of the runs to all columns (n, k)."""
        lengths = np.diff(self.cuts)
        # Number of each column within its run: 0, 1, 2, ...
        offsets = np.arange(self.cuts[-1]) - np.repeat(self.cuts[:-1], lengths)
        return np.repeat(first, lengths, axis=1) + offsets

    def of(self, array):
        """Part of an array (n, m) of misclosures or (n, m, K) of derivatives in this batch."""
        part = array[self.rows]
        if self.order is not None and part.ndim == 3:
            part = np.take_along_axis(part, self.order[:, None, :], axis=2)
        return part

    def taken(self, rows, count):
        """Select rows of the group that belong to this batch.

        Parameters
        ----------
        rows : ndarray of int, shape (k,)
            Rows of the group.
        count : int
            Number of rows of the group.

        Returns
        -------
        members : ndarray of bool, shape (k,)
            True for a row of this batch.
        subset : Batch
            Batch of these rows, one after the other, in the given order.
        """
        numbers = np.arange(count)[self.rows]
        # The rows of a batch are ascending, so that a binary search finds them.
        place = np.searchsorted(numbers, rows)
        members = np.append(numbers, count)[place] == rows
        place = place[members]
        order, block, wide_place = (
            None if array is None else array[place]
            for array in (self.order, self.block, self.place)
        )
        subset = Batch(
            self.group, slice(None), order, block, self.cuts, self.first[place], wide_place
        )
        return members, subset


@dataclass(frozen=True)
class Plan:
    """Structure of the normal equations: nr reduced unknowns and nb blocks of three unknowns.

    Attributes
    ----------
    reduced, blocks : int
        nr and nb.
    batches : tuple of Batch
        The rows.
    starts : ndarray of int, shape (nb + 1,)
        Begin of the reduced columns of each block in `columns`.
    columns : ndarray of int, shape (t,)
        Reduced columns of all blocks, ascending for each block.
    ends : ndarray of int, shape (s + 1,)
        Begin of each run of neighbouring columns in `columns`, and t.
    runs : ndarray of int, shape (nb + 1,)
        Begin of each block in `ends`.
    alike : ndarray of int
        Begin of each series of blocks with equal columns, see tankcal.solver.series, and nb.
    rows : int
        Number of observations of the largest group.
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
        """Places (t + 1, 3) of each of `columns` in the wide part, for the three rows of its block.

        The last row contains the spare place.
        """
        length = np.diff(self.starts)
        # The blocks before it occupy three rows each: 3 starts + (index - starts).
        first = 2 * np.repeat(self.starts[:-1], length) + np.arange(len(self.columns))
        places = first[:, None] + np.repeat(length, length)[:, None] * np.arange(3)
        return np.append(places, np.full((1, 3), 3 * len(self.columns)), axis=0)


def plan(reduced, blocks, groups):
    """Plan of the normal equations for groups of observations.

    Parameters
    ----------
    reduced : int
        Number of reduced unknowns.
    blocks : int
        Number of eliminated blocks.
    groups : sequence of Group
        Observations.

    Returns
    -------
    Plan

    Raises
    ------
    ValueError
        If a row depends on two blocks or on a part of a block.
    """
    parts = []
    for g, group in enumerate(groups):
        for rows, order, block, columns in _split_group(group.columns, reduced, blocks):
            # All rows of a batch share their cuts, so that loops run over the runs and not over the
            # columns.
            cuts = _find_cuts(columns, reduced)
            first = np.ascontiguousarray(columns[:, cuts[:-1]], dtype=np.int32)
            parts.append((g, rows, order, block, cuts, first))
    rows = max((len(group.columns) for group in groups), default=0)
    structure = _structure_by_loops if is_worth_compiling(rows) else _structure
    starts, columns, ends, alike, places = structure(reduced, blocks, parts)
    batches = tuple(Batch(*fields, place) for fields, place in zip(parts, places, strict=True))
    runs = np.searchsorted(ends, starts)
    return Plan(reduced, blocks, batches, starts, columns, ends, runs, alike, rows)


def _structure(reduced, blocks, parts):
    """starts, columns, ends and alike of a Plan, and the places of each Batch."""
    # Mark the reduced columns that occur together with each block.
    occurrence = np.zeros((blocks, reduced + 1), dtype=bool)
    for _, _, _, block, cuts, first in parts:
        if block is not None:
            _mark_columns(occurrence, block, cuts, first)
    occurrence[:, reduced] = False
    # Neighbouring blocks with equal columns form a series; series are joined where this saves work.
    changes = np.flatnonzero((occurrence[1:] != occurrence[:-1]).any(axis=1)) + 1
    alike = np.concatenate([[0], changes, [blocks]]) if blocks else np.zeros(1, dtype=int)
    alike = series._join_series(occurrence, alike, np.ones(reduced + 1, dtype=np.int64))
    # Row-major positions of the marks, from which owner and column follow by division.
    met = np.flatnonzero(occurrence)
    starts = np.searchsorted(met, np.arange(blocks + 1) * (reduced + 1))
    owner = np.repeat(np.arange(blocks, dtype=np.int32), np.diff(starts))
    columns = (met - owner * np.int64(reduced + 1)).astype(np.int32)
    # Place of each marked pair of block and column; unmarked pairs have the spare place.
    place = np.full((blocks, reduced + 1), len(met), dtype=np.int32)
    place.ravel()[met] = np.arange(len(met), dtype=np.int32)
    places = [None if item[3] is None else place[item[3][:, None], item[-1]] for item in parts]
    ends = np.flatnonzero(np.diff(met, prepend=-2, append=-2) != 1)
    return starts, columns, ends, alike, places


def _mark_columns(occurrence, block, cuts, first):
    """Mark (blocks, columns) where rows with a block have columns; first (n, s) of the runs."""
    for run, length in enumerate(np.diff(cuts)):
        marks = np.zeros_like(occurrence)
        marks[block, first[:, run]] = True
        reach = 1
        while reach < length:  # doubles the marked width until the run is complete
            width = min(reach, length - reach)
            marks[:, width:] |= marks[:, :-width]
            reach += width
        occurrence |= marks


def _structure_by_loops(reduced, blocks, parts):
    """Compute the result of _structure by compiled loops."""
    loops = compile_functions(series, series.COMPILED)
    edges = _find_edges(reduced, parts)
    # Columns that always occur together form a piece, which shortens the marks.
    widths = edges[1:] - edges[:-1]
    piece_of = np.arange(len(widths)).repeat(widths)
    occurrence = np.zeros((blocks, len(widths)), dtype=bool)
    for _, _, _, block, cuts, first in parts:
        if block is not None:
            loops._mark(block, first, cuts, piece_of, occurrence)
    occurrence[:, -1] = False  # the spare column
    alike = loops._join_series(occurrence, loops._list_series(occurrence), widths)
    starts = np.zeros(blocks + 1, dtype=int)
    columns, ends = loops._list_columns(occurrence, edges, alike, starts)
    places = []
    for _, _, _, block, _, first in parts:
        place = None if block is None else np.empty(first.shape, dtype=np.int32)
        if block is not None:
            loops._find_places(block, first, reduced, starts, columns, place)
        places.append(place)
    return starts, columns, ends, alike, places


def _find_edges(reduced, parts):
    """First columns of the pieces that rows with a block share; the spare column comes last."""
    begins = np.zeros(reduced + 2, dtype=bool)
    begins[[0, reduced, reduced + 1]] = True
    for _, _, _, block, cuts, first in parts:
        if block is not None:
            # A piece begins at the first column of each run and after its last column.
            begins[first] = True
            begins[first + (cuts[1:] - cuts[:-1])] = True
    return begins.nonzero()[0]


AT_ONCE = 50_000  # rows compared at a time


def _find_cuts(columns, spare):
    """Begins of the runs: places where the column of a row does not follow its left neighbour."""
    n, k = columns.shape
    if k == 0 or n == 0:
        return np.arange(k + 1)
    begins = np.zeros(k + 1, dtype=bool)
    begins[0] = begins[k] = True
    if is_worth_compiling(n):
        loops = compile_functions(series, series.COMPILED)
        loops._find_breaks(np.ascontiguousarray(columns), spare, begins)
    else:
        for start in range(0, n, AT_ONCE):
            part = columns[start : start + AT_ONCE]
            begins[1:k] |= ((np.diff(part, axis=1) != 1) | (part[:, 1:] == spare)).any(axis=0)
    return begins.nonzero()[0]


def _split_group(columns, reduced, blocks):
    """Split the rows of a group into rows without and with a block, the block first."""
    spare = columns
    # A fixed unknown gets the spare column.
    if (columns < 0).any():
        spare = np.where(columns < 0, reduced, columns)
    if blocks == 0 or columns.size == 0:
        return [(slice(None), None, None, spare)]
    eliminated = columns >= reduced
    if eliminated.shape[1] >= 3 and not eliminated[:, 3:].any():
        with_block = np.count_nonzero(eliminated[:, 0])
        if eliminated[:with_block, :3].all():  # the rows already have the required order
            block_rows, without_block = slice(0, with_block), slice(with_block, None)
            parts = (
                [(without_block, None, None, spare[without_block])]
                if with_block < len(spare)
                else []
            )
            if with_block:
                block = (columns[block_rows, 0] - reduced) // 3
                parts.append((block_rows, None, block, spare[block_rows, 3:]))
            return parts
    # A stable sort moves the three columns of the block to the front.
    order = np.argsort(~eliminated, axis=1, kind="stable")
    has_block = eliminated.any(axis=1)
    parts = (
        [(np.flatnonzero(~has_block), None, None, spare[~has_block])] if not has_block.all() else []
    )
    if not has_block.any():
        return parts
    order = order[has_block]
    sorted_columns = np.take_along_axis(spare[has_block], order, axis=1)
    block = (sorted_columns[:, 0] - reduced) // 3
    if (eliminated.sum(axis=1)[has_block] != 3).any() or (
        np.diff(sorted_columns[:, :3], axis=1) != 1
    ).any():
        raise ValueError("a row touches two eliminated blocks, or a part of one")
    return [*parts, (np.flatnonzero(has_block), order, block, sorted_columns[:, 3:])]
