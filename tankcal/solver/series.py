"""Which columns the blocks of a plan meet: plain loops, to be compiled.

The marks (blocks, pieces) say where rows with a block have reduced columns, the spare one of fixed
unknowns left out. A piece is of neighbouring columns that all rows have together or not at all: of
photographs the six of each. A series is of neighbouring blocks that have the same columns.
"""

import numpy as np

TOGETHER = 32  # blocks with the same columns that are eliminated at once, or fewer
LEAVING = 4  # blocks whose products take as long as spreading those of a series over the columns
COMPILED = (
    "_find_breaks",
    "_mark",
    "_list_series",
    "_join_series",
    "_list_columns",
    "_find_places",
)


def _mark(block, first, cuts, piece_of, together):
    """Mark (blocks, pieces) where rows with a block have columns: first (n, s) of runs.

    piece_of  (columns,) number of the piece of each column
    """
    for i in range(len(block)):
        for run in range(len(cuts) - 1):
            last = first[i, run] + cuts[run + 1] - cuts[run] - 1
            for piece in range(piece_of[first[i, run]], piece_of[last] + 1):
                together[block[i], piece] = True


def _find_breaks(columns, spare, begins):
    """begins (k + 1,) turns True where a column of a row (n, k) is not the one after its left."""
    n, k = columns.shape
    for i in range(n):
        for a in range(1, k):
            right = columns[i, a]
            begins[a] |= (right != columns[i, a - 1] + 1) | (right == spare)


def _list_series(together):
    """alike of a Plan, by the marks (blocks, pieces)."""
    blocks = len(together)
    alike, series = np.zeros(blocks + 1, dtype=np.int64), 0
    for o in range(blocks):
        differing = 0
        if o > 0:
            for c in range(together.shape[1]):
                differing += together[o, c] != together[o - 1, c]
        if o == 0 or differing > 0:
            alike[series] = o
            series += 1
    alike[series] = blocks
    return alike[: series + 1].copy()


def _join_series(together, alike, widths):
    """alike of a Plan, of series that may be longer; the marks (blocks, pieces) are changed.

    Neighbours of at most TOGETHER blocks all get the columns of each other where one series is less
    work than two: zeros are multiplied sooner than many small products are spread.

    widths  (pieces,) columns of each
    """
    joined, last = np.zeros(len(together) + 1, dtype=np.int64), 0
    for k in range(len(alike) - 1):
        for begin in range(alike[k], alike[k + 1], TOGETHER):
            end, first = min(begin + TOGETHER, alike[k + 1]), joined[last]
            both = together[first] | together[begin]
            work = (end - first + LEAVING) * (both * widths).sum() ** 2
            apart = (begin - first + LEAVING) * (together[first] * widths).sum() ** 2
            apart += (end - begin + LEAVING) * (together[begin] * widths).sum() ** 2
            if begin == 0 or (end - first <= TOGETHER and work <= apart):
                together[first] = both
            else:
                last += 1
                joined[last] = begin
    joined = joined[: last + 2].copy()
    joined[-1] = len(together)
    for k in range(len(joined) - 1):
        together[joined[k] : joined[k + 1]] = together[joined[k]]
    return joined


def _list_columns(together, edges, alike, starts):
    """columns and ends of a Plan, by the marks (blocks, pieces); starts is filled.

    edges  (pieces + 1,) where they begin, and the end
    """
    pieces = len(edges) - 1
    for k in range(len(alike) - 1):
        count = 0
        for piece in range(pieces):
            if together[alike[k], piece]:
                count += edges[piece + 1] - edges[piece]
        for o in range(alike[k], alike[k + 1]):
            starts[o + 1] = starts[o] + count
    columns, runs = np.empty(starts[-1], dtype=np.int32), 0
    ends = np.empty(starts[-1] + 1, dtype=np.int64)
    for k in range(len(alike) - 1):
        first, others = starts[alike[k]], alike[k + 1] - alike[k] - 1
        at, last, before = first, -2, runs
        for piece in range(pieces):
            if not together[alike[k], piece]:
                continue
            if edges[piece] != last + 1:
                ends[runs] = at
                runs += 1
            for c in range(edges[piece], edges[piece + 1]):
                columns[at] = c
                at, last = at + 1, c
        length, count = at - first, runs - before
        for a in range(at, at + others * length):
            columns[a] = columns[a - length]
        for run in range(runs, runs + others * count):
            ends[run] = ends[run - count] + length
        runs += others * count
    ends[runs] = starts[-1]
    return columns, ends[: runs + 1].copy()


def _find_places(block, first, reduced, starts, columns, place):
    """Where the first column of each run and the block meet in the wide part; see Batch.place."""
    for i in range(len(block)):
        for run in range(first.shape[1]):
            c = first[i, run]
            low, high = starts[block[i]], starts[block[i] + 1]
            while low < high:  # the first that is not below it
                middle = (low + high) // 2
                if columns[middle] < c:
                    low = middle + 1
                else:
                    high = middle
            place[i, run] = starts[-1] if c == reduced else low
