"""The covariance factor of the rows of a table, in blocks of rows, as saved in the record.

Between joints the volumes, and the effects of the inputs on them, are smooth in height. All rows of
a block are therefore linear combinations of a few rows. The record contains these rows and the
weights of the combinations, at most a fifth of the numbers (interpolative decomposition [1]_). For
25 000 rows and ten courses the whole factor would be 155 MB, nine tenths of the record.

.. [1] H. Cheng, Z. Gimbutas, P. G. Martinsson, V. Rokhlin, On the compression of low rank matrices,
   SIAM J. Sci. Comput. 26 (2005), 1389-1404.
"""

from itertools import pairwise

import numpy as np
import scipy.linalg

from tankcal.record.schema import Finite, Saved, key

# Largest number of rows of a block. Smaller blocks keep more rows in total; larger blocks are less
# smooth, since they reach over a joint.
ROWS = 200
_PIECE = 1000  # rows of a step of array operations: 2 MB for 276 inputs, less than a cache
RESIDUAL = 3e-15  # largest remainder of a row after the kept rows, relative to its u
LARGEST_ERROR = 1e-14  # largest error of a combined row, relative to its u; otherwise all are kept


class FactorBlock(Saved):
    """Successive rows of a table, and their factor: weights times factor_m3."""

    rows: int = key("number of rows, from the end of the previous block")
    weights: list[list[Finite]] | None = key(
        "rows x kept: weight of each kept row; null: all rows are kept, in their order"
    )
    factor_m3: list[list[Finite]] = key("kept x inputs")


def blocks_of(factor_m3):
    """Divide a factor into blocks; a block ends where an input gains or loses its effect.

    Parameters
    ----------
    factor_m3 : array_like, shape (rows, inputs)
        Covariance factor, m3.

    Returns
    -------
    list of FactorBlock

    Examples
    --------
    >>> straight = np.outer(np.arange(1.0, 5.0), [0.3, 0.4])
    >>> [(block.rows, block.weights.shape, block.factor_m3.shape) for block in blocks_of(straight)]
    [(4, (4, 1), (1, 2))]
    """
    factor = np.asarray(factor_m3, dtype=float)
    is_zero = factor == 0
    changes = np.flatnonzero((is_zero[1:] != is_zero[:-1]).any(axis=1)) + 1
    starts = [
        start
        for first, last in pairwise([0, *changes.tolist(), len(factor)])
        for start in range(first, last, ROWS)
    ]
    return [_make_block(factor[first:last]) for first, last in pairwise([*starts, len(factor)])]


def factor_of(capacity):
    """Compute the whole factor of the part `capacity` of a record.

    The kept rows are added in their order, so that all machines give the same bits.

    Returns
    -------
    ndarray, shape (rows, inputs)
        Covariance factor, m3.

    Raises
    ------
    ValueError
        If the blocks do not match the rows and inputs of the table.
    """
    blocks, inputs = capacity["factor"], len(capacity["inputs"])
    factor, last = np.empty((len(capacity["height_m"]), inputs)), 0
    for part in (_expand_block(block, inputs) for block in blocks):
        first, last = last, last + len(part)
        if last <= len(factor):
            factor[first:last] = part
    if last != len(factor):
        raise ValueError(f"a factor of {last} rows, of {len(factor)}")
    return factor


def norms_of_rows(rows_of, count):
    """Return the norm of each row of rows_of(slice), of `count` rows, by pieces."""
    pieces = (slice(start, min(start + _PIECE, count)) for start in range(0, count, _PIECE))
    norms = [np.linalg.norm(rows_of(rows), axis=1) for rows in pieces]
    return np.concatenate([np.empty(0), *norms])


def combinations_of(capacity):
    """Return the kept rows of all blocks, and the combination that gives each row of the table.

    Parameters
    ----------
    capacity : dict
        Part of a record.

    Returns
    -------
    kept_m3 : list of list of float
        Kept rows, from the lowest block up, m3.
    combinations : list of (int, list of float)
        For each row of the table, the index of its first kept row, and the weights of the kept
        rows from there.
    """
    kept_m3, combinations = [], []
    for block in capacity["factor"]:
        first = len(kept_m3)
        kept_m3 += block["factor_m3"]
        if block["weights"] is None:
            combinations += [(row, [1.0]) for row in range(first, len(kept_m3))]
        else:
            combinations += [(first, weights) for weights in block["weights"]]
    return kept_m3, combinations


def wrap_factor(capacity):
    """Return the part `capacity` of version 1 or a draft of 2 with its whole factor as a block."""
    other = {name: value for name, value in capacity.items() if name != "factor_m3"}
    factor = capacity["factor_m3"]
    return other | {"factor": [{"rows": len(factor), "weights": None, "factor_m3": factor}]}


def _expand_block(block, inputs):
    """Return the factor of a block, shape (rows, inputs)."""
    kept = np.array(block["factor_m3"], dtype=float).reshape(len(block["factor_m3"]), inputs)
    if block["weights"] is not None:
        weights = np.array(block["weights"], dtype=float).reshape(block["rows"], len(kept))
        kept = _multiply(weights, kept)
    if len(kept) != block["rows"]:
        raise ValueError(f"a block of {block['rows']} rows with {len(kept)}")
    return kept


def _multiply(weights, kept):
    """Return weights @ kept, summed in a fixed order.

    In BLAS the order depends on the processor and on the number of threads.
    """
    product = np.zeros((len(weights), kept.shape[1]))
    for weight, row in zip(weights.T, kept, strict=True):
        product += weight[:, None] * row
    return product


def _make_block(factor):
    """Return the `FactorBlock` of some rows of a factor."""
    u = np.linalg.norm(factor, axis=1)
    scale = np.where(u > 0, u, 1.0)  # rows of norm 1, so that errors are relative to u
    decomposition = _decompose_rows(factor / scale[:, None])
    if decomposition is not None:
        kept, weights = decomposition
        weights = weights * (scale[:, None] / scale[kept])
        error = np.abs(_multiply(weights, factor[kept]) - factor)
        if np.all(error <= LARGEST_ERROR * u[:, None]):
            return FactorBlock(len(factor), weights, factor[kept])
    return FactorBlock(len(factor), None, factor)


def _decompose_rows(rows):
    """Select rows whose linear combinations give all rows.

    The row with the largest remainder is kept next, until no remainder is left (Gram-Schmidt). With
    orthonormal rows of Q, rows = C Q. Hence rows = (C L^-1) rows[kept], with L = C[kept], which is
    lower triangular.

    Parameters
    ----------
    rows : ndarray, shape (n, m)

    Returns
    -------
    kept : list of int, length k
        Indices of the kept rows.
    weights : ndarray, shape (n, k)
        Weights of the combinations. None instead of both if they save no numbers.
    """
    count, inputs = rows.shape
    most = count * inputs // max(count + inputs, 1)  # more kept rows would need more numbers
    remainder, kept, columns = rows.copy(), [], []
    while True:
        square = np.einsum("ij,ij->i", remainder, remainder)
        row = int(np.argmax(square))
        if square[row] <= RESIDUAL**2:
            break
        if len(kept) == most:
            return None
        direction = remainder[row] / np.sqrt(square[row])
        column = remainder @ direction
        remainder -= column[:, None] * direction
        kept.append(row)
        columns.append(column)
    if not kept:
        return None
    C = np.column_stack(columns)
    lower = np.tril(C[kept])  # removes the rounding errors above the diagonal
    weights = scipy.linalg.solve_triangular(lower, C.T, lower=True, trans=1).T
    weights[kept] = np.eye(len(kept))
    return kept, weights
