"""Columns that occur together with each block of a plan, as plain loops that are compiled.

Marks (blocks, pieces) indicate where rows with a block have reduced columns; the spare column of
fixed unknowns is excluded. A piece consists of neighbouring columns that every row contains either
completely or not at all, for example the six of a photograph. A series consists of neighbouring
blocks with equal columns.
"""

import numpy as np

TOGETHER = 32  # most blocks with equal columns that are eliminated together
LEAVING = 4  # cost of adding a series to the columns, in products of a block
COMPILED = (
    "_find_breaks",
    "_mark",
    "_list_series",
    "_join_series",
    "_list_columns",
    "_find_places",
)


def _mark(block, first, cuts, piece_of, occurrence):
    """Mark (blocks, pieces) where rows with a block have columns; first (n, s) of the runs.

    `piece_of` (columns,) contains the piece of each column.
    """
    for i in range(len(block)):
        for run in range(len(cuts) - 1):
            last = first[i, run] + cuts[run + 1] - cuts[run] - 1
            for piece in range(piece_of[first[i, run]], piece_of[last] + 1):
                occurrence[block[i], piece] = True


def _find_breaks(columns, spare, begins):
    """Set begins (k + 1,) to True where a column of a row does not follow its left neighbour."""
    n, k = columns.shape
    for i in range(n):
        for a in range(1, k):
            right = columns[i, a]
            begins[a] |= (right != columns[i, a - 1] + 1) | (right == spare)


def _list_series(occurrence):
    """Begins of the series (`alike` of a Plan), from the marks (blocks, pieces)."""
    blocks = len(occurrence)
    alike, series = np.zeros(blocks + 1, dtype=np.int64), 0
    for o in range(blocks):
        differing = 0
        if o > 0:
            for c in range(occurrence.shape[1]):
                differing += occurrence[o, c] != occurrence[o - 1, c]
        if o == 0 or differing > 0:
            alike[series] = o
            series += 1
    alike[series] = blocks
    return alike[: series + 1].copy()


def _join_series(occurrence, alike, widths):
    """Join series to longer series if this saves work; return their begins (`alike` of a Plan).

    At most TOGETHER neighbouring blocks receive the union of their columns. The additional zeros
    cost less than adding many small products to the normal equations. The marks (blocks, pieces)
    are changed in place; `widths` (pieces,) contains the number of columns of each piece.
    """
    joined, last = np.zeros(len(occurrence) + 1, dtype=np.int64), 0
    for k in range(len(alike) - 1):
        for begin in range(alike[k], alike[k + 1], TOGETHER):
            end, first = min(begin + TOGETHER, alike[k + 1]), joined[last]
            union = occurrence[first] | occurrence[begin]
            # Products of a series cost its blocks times its columns squared; adding the result to
            # the normal equations costs as much as LEAVING blocks.
            work = (end - first + LEAVING) * (union * widths).sum() ** 2
            apart = (begin - first + LEAVING) * (occurrence[first] * widths).sum() ** 2
            apart += (end - begin + LEAVING) * (occurrence[begin] * widths).sum() ** 2
            if begin == 0 or (end - first <= TOGETHER and work <= apart):
                occurrence[first] = union
            else:
                last += 1
                joined[last] = begin
    joined = joined[: last + 2].copy()
    joined[-1] = len(occurrence)
    # All blocks of a series receive its columns.
    for k in range(len(joined) - 1):
        occurrence[joined[k] : joined[k + 1]] = occurrence[joined[k]]
    return joined


def _list_columns(occurrence, edges, alike, starts):
    """Return `columns` and `ends` of a Plan from the marks (blocks, pieces); fill `starts`.

    `edges` (pieces + 1,) contains the first column of each piece, and the end.
    """
    pieces = len(edges) - 1
    # First pass: number of columns of each block.
    for k in range(len(alike) - 1):
        count = 0
        for piece in range(pieces):
            if occurrence[alike[k], piece]:
                count += edges[piece + 1] - edges[piece]
        for o in range(alike[k], alike[k + 1]):
            starts[o + 1] = starts[o] + count
    columns, runs = np.empty(starts[-1], dtype=np.int32), 0
    ends = np.empty(starts[-1] + 1, dtype=np.int64)
    # Second pass: the columns and runs of the first block of a series are repeated for its other
    # blocks.
    for k in range(len(alike) - 1):
        first, repeats = starts[alike[k]], alike[k + 1] - alike[k] - 1
        index, last, first_run = first, -2, runs
        for piece in range(pieces):
            if not occurrence[alike[k], piece]:
                continue
            if edges[piece] != last + 1:
                ends[runs] = index
                runs += 1
            for c in range(edges[piece], edges[piece + 1]):
                columns[index] = c
                index, last = index + 1, c
        length, count = index - first, runs - first_run
        for a in range(index, index + repeats * length):
            columns[a] = columns[a - length]
        for run in range(runs, runs + repeats * count):
            ends[run] = ends[run - count] + length
        runs += repeats * count
    ends[runs] = starts[-1]
    return columns, ends[: runs + 1].copy()


def _find_places(block, first, reduced, starts, columns, place):
    """Find the place of the first column of each run in the wide part, see Batch.place."""
    for i in range(len(block)):
        for run in range(first.shape[1]):
            c = first[i, run]
            low, high = starts[block[i]], starts[block[i] + 1]
            while low < high:  # binary search for the column
                middle = (low + high) // 2
                if columns[middle] < c:
                    low = middle + 1
                else:
                    high = middle
            place[i, run] = starts[-1] if c == reduced else low
