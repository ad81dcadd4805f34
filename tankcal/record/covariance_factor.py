"""The factor of the covariance of a table's rows, as the record holds it: in blocks of rows.

Between joints the volumes are smooth in height, and so is what each input does to them: a few rows
of a block give all others, as sums of multiples. The record holds these few and the multiples,
which are a fifth of the numbers and less (interpolative decomposition [1]_). Of 25 000 rows and ten
courses the whole factor would be 155 MB, nine tenths of the record.

.. [1] H. Cheng, Z. Gimbutas, P. G. Martinsson, V. Rokhlin, On the compression of low rank matrices,
   SIAM J. Sci. Comput. 26 (2005), 1389-1404.
"""

from itertools import pairwise

import numpy as np
import scipy.linalg

from tankcal.record.schema import Finite, Saved, key

ROWS = 200  # of a block at most: of fewer more rows are kept in all, more pass over a joint
LEFT = 3e-15  # of a row's u, that may be left of it when no more rows are kept
LARGEST_ERROR = 1e-14  # of a row's u: a block that is not given back as well is kept as it is


class FactorBlock(Saved):
    """Rows of a table one after the other, and their factor: weights times factor_m3."""

    rows: int = key("how many, from where the block before it ends")
    weights: list[list[Finite]] | None = key(
        "rows x kept: by how much of each kept row; null: all are kept, one after the other"
    )
    factor_m3: list[list[Finite]] = key("kept x inputs")


def blocks_of(factor_m3):
    """The `FactorBlock`s of a factor; one ends where an input begins or ceases to have an effect.

    Parameters
    ----------
    factor_m3 : array_like, shape (rows, inputs)

    Examples
    --------
    >>> straight = np.outer(np.arange(1.0, 5.0), [0.3, 0.4])
    >>> [(block.rows, block.weights.shape, block.factor_m3.shape) for block in blocks_of(straight)]
    [(4, (4, 1), (1, 2))]
    """
    factor = np.asarray(factor_m3, dtype=float)
    idle = factor == 0
    changes = np.flatnonzero((idle[1:] != idle[:-1]).any(axis=1)) + 1
    starts = [
        start
        for first, last in pairwise([0, *changes.tolist(), len(factor)])
        for start in range(first, last, ROWS)
    ]
    return [_block_of(factor[first:last]) for first, last in pairwise([*starts, len(factor)])]


def factor_of(capacity):
    """The whole factor, (rows, inputs), of the part `capacity` of a record.

    It is summed kept row by kept row, which gives the same bits on every machine.

    Raises
    ------
    ValueError
        For blocks that are not those of the table's rows and inputs.
    """
    blocks, inputs = capacity["factor"], len(capacity["inputs"])
    parts = [np.empty((0, inputs)), *(_whole(block, inputs) for block in blocks)]
    factor = np.concatenate(parts)
    if len(factor) != len(capacity["height_m"]):
        raise ValueError(f"a factor of {len(factor)} rows, of {len(capacity['height_m'])}")
    return factor


def in_blocks(capacity):
    """The part `capacity` of a record that has its whole factor, `factor_m3`, with it as a block.

    Parameters
    ----------
    capacity : dict
        As records of version 1, and drafts of version 2, have it.
    """
    other = {name: value for name, value in capacity.items() if name != "factor_m3"}
    factor = capacity["factor_m3"]
    return other | {"factor": [{"rows": len(factor), "weights": None, "factor_m3": factor}]}


def _whole(block, inputs):
    """(rows, inputs): the factor of a block."""
    kept = np.array(block["factor_m3"], dtype=float).reshape(len(block["factor_m3"]), inputs)
    if block["weights"] is not None:
        weights = np.array(block["weights"], dtype=float).reshape(block["rows"], len(kept))
        kept = _product(weights, kept)
    if len(kept) != block["rows"]:
        raise ValueError(f"a block of {block['rows']} rows with {len(kept)}")
    return kept


def _product(weights, kept):
    """weights @ kept, each sum in its order: BLAS sums as threads and processor would have it."""
    found = np.zeros((len(weights), kept.shape[1]))
    for weight, row in zip(weights.T, kept, strict=True):
        found += weight[:, None] * row
    return found


def _block_of(factor):
    """The `FactorBlock` of the rows of a factor."""
    u = np.linalg.norm(factor, axis=1)
    scale = np.where(u > 0, u, 1.0)
    found = _weights(factor / scale[:, None])
    if found is not None:
        at, weights = found
        weights = weights * (scale[:, None] / scale[at])
        error = np.abs(_product(weights, factor[at]) - factor)
        if np.all(error <= LARGEST_ERROR * u[:, None]):
            return FactorBlock(len(factor), weights, factor[at])
    return FactorBlock(len(factor), None, factor)


def _weights(rows):
    """Which rows to keep, and the (rows, kept) weights by which they give all; None: too many.

    The row of which most is left is kept, until of none is, by Gram-Schmidt: rows = C Q with
    orthonormal rows of Q, so that rows = (C L^-1) rows[kept], L being the lower triangular C[kept].
    """
    count, inputs = rows.shape
    most = count * inputs // max(count + inputs, 1)  # with more there would be more numbers
    left, at, parts = rows.copy(), [], []
    while True:
        square = np.einsum("ij,ij->i", left, left)
        row = int(np.argmax(square))
        if square[row] <= LEFT**2:
            break
        if len(at) == most:
            return None
        direction = left[row] / np.sqrt(square[row])
        part = left @ direction
        left -= part[:, None] * direction
        at.append(row)
        parts.append(part)
    if not at:
        return None
    parts = np.column_stack(parts)
    lower = np.tril(parts[at])
    weights = scipy.linalg.solve_triangular(lower, parts.T, lower=True, trans=1).T
    weights[at] = np.eye(len(at))
    return at, weights
