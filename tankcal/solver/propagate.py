"""Product A M A' of a symmetric M and a sparse A, as plain loops that are compiled.

A contains the derivatives of unknowns by the reduced unknowns. A point depends only on the
photographs that show it, so that most elements are zero. For the cofactors of many points, only the
non-zero products are computed, and only half of these because of symmetry.
"""

import sys

import numpy as np

from tankcal.solver.compiled import compile_functions

TILE = 512  # columns multiplied at a time; the data read repeatedly fit into the cache
SQUARE = 32  # columns mirrored at a time; both squares fit into the nearest cache
COMPILED = ("_gather", "_add_products", "_times", "_mirror", "_propagate")


def propagate_cofactors(a, m):
    """Compute A M A'.

    Parameters
    ----------
    a : ndarray, shape (k, n)
        A, in row order.
    m : ndarray, shape (n, n)
        M, symmetric, in row order.

    Returns
    -------
    ndarray, shape (k, k)
    """
    out = np.empty((len(a), len(a)))
    compile_functions(sys.modules[__name__], COMPILED)._propagate(a, m, out)
    return out


def _propagate(a, m, out):
    """Compute A M A' into `out`."""
    half = np.empty(a.shape)
    _times(a, m, False, half)
    # (A M)' = M A', because M is symmetric.
    _times(a, np.ascontiguousarray(half.T), True, out)
    _mirror(out)


def _times(a, dense, upper, out):
    """Multiply A by a dense matrix into `out`; with `upper`, only from the diagonal on."""
    k, n = a.shape
    width = dense.shape[1]
    place, factor = np.empty(n + 3, dtype=np.uintp), np.empty((3, n + 3))
    for left in range(0, width, TILE):
        right = min(left + TILE, width)
        # Three rows of A share the elements of the dense matrix that they read.
        for first in range(0, min(k, right) if upper else k, 3):
            count = _gather(a, first, width, place, factor)
            begin = max(first, left) if upper else left
            _add_products(place, factor, count, dense, begin, right - begin, first, out)


def _gather(a, first, width, place, factor):
    """Collect the columns in which three rows of A have non-zero elements.

    Writes the offsets of these columns as rows of the dense matrix into `place`, and the elements
    (3, count) into `factor`. Zeros extend the count to a multiple of four.
    """
    k, n = a.shape
    rows, count = min(3, k - first), 0
    for column in range(n):
        x = a[first, column]
        y = a[first + 1, column] if rows > 1 else 0.0
        z = a[first + 2, column] if rows > 2 else 0.0
        # Each column is written, and the next overwrites a column of zeros: a branch would be
        # predicted wrongly at each photograph.
        place[count] = column * width
        factor[0, count], factor[1, count], factor[2, count] = x, y, z
        count += (x != 0.0) | (y != 0.0) | (z != 0.0)
    # The loop over products processes four rows at a time.
    while count % 4:
        place[count] = 0
        factor[:, count] = 0.0
        count += 1
    return count


def _add_products(place, factor, count, dense, begin, length, first, out):
    """Compute three rows of `out`, `length` elements from column `begin`.

    Four rows of the dense matrix are read at a time. With fewer than three rows left, the last row
    is updated repeatedly, with zero factors.
    """
    flat, flat_out, last = dense.reshape(dense.size), out.reshape(out.size), len(out) - 1
    width = out.shape[1]
    p = np.uintp(first * width + begin)
    q = np.uintp(min(first + 1, last) * width + begin)
    r = np.uintp(min(first + 2, last) * width + begin)
    for s in range(np.uintp(length)):
        flat_out[p + s] = flat_out[q + s] = flat_out[r + s] = 0.0
    for c in range(0, count, 4):
        d0, d1 = place[c] + np.uintp(begin), place[c + 1] + np.uintp(begin)
        d2, d3 = place[c + 2] + np.uintp(begin), place[c + 3] + np.uintp(begin)
        x0, x1, x2, x3 = factor[0, c], factor[0, c + 1], factor[0, c + 2], factor[0, c + 3]
        y0, y1, y2, y3 = factor[1, c], factor[1, c + 1], factor[1, c + 2], factor[1, c + 3]
        z0, z1, z2, z3 = factor[2, c], factor[2, c + 1], factor[2, c + 2], factor[2, c + 3]
        for s in range(np.uintp(length)):
            e0, e1, e2, e3 = flat[d0 + s], flat[d1 + s], flat[d2 + s], flat[d3 + s]
            flat_out[p + s] += x0 * e0 + x1 * e1 + x2 * e2 + x3 * e3
            flat_out[q + s] += y0 * e0 + y1 * e1 + y2 * e2 + y3 * e3
            flat_out[r + s] += z0 * e0 + z1 * e1 + z2 * e2 + z3 * e3


def _mirror(q):
    """Copy the upper half to the lower half, in squares of SQUARE columns."""
    n, flat = len(q), q.reshape(q.size)
    for low in range(0, n, SQUARE):
        for left in range(0, low + 1, SQUARE):
            for i in range(low, min(low + SQUARE, n)):
                p, source = np.uintp(i * n + left), np.uintp(left * n + i)
                for j in range(np.uintp(max(min(left + SQUARE, i) - left, 0))):
                    flat[p + j] = flat[source + j * np.uintp(n)]
