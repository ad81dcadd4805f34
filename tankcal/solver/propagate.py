"""A M A' of a symmetric M and an A of which most numbers are zeros: plain loops, to be compiled.

How unknowns follow the reduced ones is such an A: a point follows the photographs that show it. So
of cofactors of many points a part of all products counts, and half of these for symmetry.
"""

import sys

import numpy as np

from tankcal.solver.compiled import compile_functions

TILE = 512  # columns that are multiplied at a time: what is read again stays in the cache
COMPILED = ("_gather", "_add_products", "_times", "_mirror", "_propagate")


def propagate_cofactors(a, m):
    """A M A' (k, k); a (k, n) and m (n, n) row by row, m symmetric."""
    out = np.empty((len(a), len(a)))
    compile_functions(sys.modules[__name__], COMPILED)._propagate(a, m, out)
    return out


def _propagate(a, m, out):
    half = np.empty(a.shape)
    _times(a, m, False, half)
    _times(a, np.ascontiguousarray(half.T), True, out)
    _mirror(out)


def _times(a, dense, upper, out):
    """A times a dense matrix into out; upper: from the diagonal on alone."""
    k, n = a.shape
    width = dense.shape[1]
    place, factor = np.empty(n + 3, dtype=np.uintp), np.empty((3, n + 3))
    for left in range(0, width, TILE):
        right = min(left + TILE, width)
        for first in range(0, min(k, right) if upper else k, 3):
            count = _gather(a, first, width, place, factor)
            begin = max(first, left) if upper else left
            _add_products(place, factor, count, dense, begin, right - begin, first, out)


def _gather(a, first, width, place, factor):
    """Where three rows of A have numbers, as places of these rows of what they multiply.

    With the numbers themselves (3, count); zeros until four go into the count.
    """
    k, n = a.shape
    rows, count = min(3, k - first), 0
    for column in range(n):
        found = False
        for row in range(rows):
            found = found or a[first + row, column] != 0.0
        if found:
            place[count] = column * width
            for row in range(3):
                factor[row, count] = a[first + row, column] if row < rows else 0.0
            count += 1
    while count % 4:
        place[count] = 0
        factor[:, count] = 0.0
        count += 1
    return count


def _add_products(place, factor, count, dense, begin, length, first, out):
    """Three rows of out, `length` numbers from column `begin` on: four rows of dense at a time.

    Where there are fewer rows the last is added to three times, twice nothing.
    """
    flat, into, last = dense.reshape(dense.size), out.reshape(out.size), len(out) - 1
    width = out.shape[1]
    p = np.uintp(first * width + begin)
    q = np.uintp(min(first + 1, last) * width + begin)
    r = np.uintp(min(first + 2, last) * width + begin)
    for s in range(np.uintp(length)):
        into[p + s] = into[q + s] = into[r + s] = 0.0
    for c in range(0, count, 4):
        d0, d1 = place[c] + np.uintp(begin), place[c + 1] + np.uintp(begin)
        d2, d3 = place[c + 2] + np.uintp(begin), place[c + 3] + np.uintp(begin)
        x0, x1, x2, x3 = factor[0, c], factor[0, c + 1], factor[0, c + 2], factor[0, c + 3]
        y0, y1, y2, y3 = factor[1, c], factor[1, c + 1], factor[1, c + 2], factor[1, c + 3]
        z0, z1, z2, z3 = factor[2, c], factor[2, c + 1], factor[2, c + 2], factor[2, c + 3]
        for s in range(np.uintp(length)):
            e0, e1, e2, e3 = flat[d0 + s], flat[d1 + s], flat[d2 + s], flat[d3 + s]
            into[p + s] += x0 * e0 + x1 * e1 + x2 * e2 + x3 * e3
            into[q + s] += y0 * e0 + y1 * e1 + y2 * e2 + y3 * e3
            into[r + s] += z0 * e0 + z1 * e1 + z2 * e2 + z3 * e3


def _mirror(q):
    """The lower half from the upper one, sixteen columns by sixteen."""
    n = len(q)
    for low in range(0, n, 16):
        for left in range(0, low + 1, 16):
            for i in range(low, min(low + 16, n)):
                for j in range(left, min(left + 16, i)):
                    q[i, j] = q[j, i]
