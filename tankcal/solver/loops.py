"""Building and eliminating the normal equations: plain loops, to be compiled.

For the rows of a batch with derivatives E by their block and F by reduced unknowns

    V += E'E,   wide += F'E,   S += F'F,   b += E'w,   g += F'w

and for each block, V = L L', the wide part becomes Y = wide L^-T and b becomes y = L^-1 b, so that
the reduced equations are S - Y Y' and g - Y y. S is kept as a matrix T in which each pair of
unknowns stands once: S = T + T' - diag T.

In the innermost loops places are counted without a sign (np.uintp): numba tests at each number
whether one that might be negative is counted from the end.
"""

import numpy as np

TOGETHER = 32  # blocks with the same columns that are eliminated at once
COMPILED = (
    "_is_alike",
    "_add_squares",
    "_add_blocks",
    "_root",
    "_forward",
    "_forward_all",
    "_leave",
    "_eliminate",
    "_back",
    "_cofactors",
    "_leverage",
)


def _add_squares(w, jac, skip, first, cuts, t, g):
    """S += F'F, g += F'w; F are the derivatives from number `skip` on, in runs of columns.

    Neighbouring rows with the same columns enter by one product.
    """
    n, m, width = jac.shape
    runs = len(cuts) - 1
    flat, errors = jac.reshape((n * m, width)), w.reshape(n * m)
    square, product = np.empty((width, width)), np.empty(width)
    end = 0
    while end < n:
        begin, end = end, end + 1
        while end < n and _is_alike(first, end, begin):
            end += 1
        f = flat[m * begin : m * end]
        np.dot(f.T, f, square)
        np.dot(f.T, errors[m * begin : m * end], product)
        for one in range(runs):
            to = first[begin, one] - cuts[one]
            for a in range(cuts[one], cuts[one + 1]):
                g[to + a] += product[skip + a]
                for other in range(one, runs):
                    by = first[begin, other] - cuts[other]
                    for q in range(max(a, cuts[other]), cuts[other + 1]):
                        t[to + a, by + q] += square[skip + a, skip + q]


def _is_alike(first, i, j):
    alike = True
    for run in range(first.shape[1]):
        alike = alike and first[i, run] == first[j, run]
    return alike


def _add_blocks(w, jac, block, place, cuts, v, wide, b):
    """V += E'E, wide += F'E, b += E'w; E are the first three derivatives, F those after them."""
    n, m, _ = jac.shape
    for i in range(n):
        o = block[i]
        for row in range(0, m, 2):  # two at a time: image coordinates, most of the work
            x = min(row + 1, m - 1)
            both = 1.0 if x > row else 0.0
            e0, e1, e2, r = jac[i, row, 0], jac[i, row, 1], jac[i, row, 2], w[i, row]
            d0, d1, d2, s = both * jac[i, x, 0], both * jac[i, x, 1], both * jac[i, x, 2], w[i, x]
            b[o, 0] += e0 * r + d0 * s
            b[o, 1] += e1 * r + d1 * s
            b[o, 2] += e2 * r + d2 * s
            v[o, 0] += e0 * e0 + d0 * d0
            v[o, 1] += e1 * e0 + d1 * d0
            v[o, 2] += e1 * e1 + d1 * d1
            v[o, 3] += e2 * e0 + d2 * d0
            v[o, 4] += e2 * e1 + d2 * d1
            v[o, 5] += e2 * e2 + d2 * d2
            for one in range(len(cuts) - 1):
                to = place[i, one] - cuts[one]
                for a in range(cuts[one], cuts[one + 1]):
                    f, h = jac[i, row, 3 + a], jac[i, x, 3 + a]
                    wide[to + a, 0] += f * e0 + h * d0
                    wide[to + a, 1] += f * e1 + h * d1
                    wide[to + a, 2] += f * e2 + h * d2


def _root(v, damping, smallest):
    """Cholesky factor of a block, in place (six numbers); False when it is not determined."""
    d1, d2, more = v[2], v[5], 1.0 + damping
    q0 = v[0] * more
    l00 = np.sqrt(q0)
    l10, l20 = v[1] / l00, v[3] / l00
    q1 = d1 * more - l10 * l10
    l11 = np.sqrt(max(q1, 0.0))
    l21 = (v[4] - l20 * l10) / l11
    q2 = d2 * more - l20 * l20 - l21 * l21
    if not (q0 > 0.0 and q1 > smallest * d1 and q2 > smallest * d2):
        return False
    v[0], v[1], v[2], v[3], v[4], v[5] = l00, l10, l11, l20, l21, np.sqrt(q2)
    return True


def _forward(v, b):
    """b becomes L^-1 b."""
    b[0] = b[0] / v[0]
    b[1] = (b[1] - v[1] * b[0]) / v[2]
    b[2] = (b[2] - v[3] * b[0] - v[4] * b[1]) / v[5]


def _forward_all(v, part, b, y, g, columns):
    """The wide part of a block becomes Y, also in three rows of y; g loses Y b."""
    l10, l20, l21 = v[1], v[3], v[4]
    i0, i1, i2 = 1.0 / v[0], 1.0 / v[2], 1.0 / v[5]
    b0, b1, b2 = b[0], b[1], b[2]
    for a in range(len(columns)):
        w0 = part[a, 0] * i0
        w1 = (part[a, 1] - l10 * w0) * i1
        w2 = (part[a, 2] - l20 * w0 - l21 * w1) * i2
        part[a, 0], part[a, 1], part[a, 2] = w0, w1, w2
        y[0, a], y[1, a], y[2, a] = w0, w1, w2
        g[columns[a]] -= w0 * b0 + w1 * b1 + w2 * b2


def _leave(t, columns, runs, first, y, product):
    """Take Y'Y, its upper half, from the places of its columns in t; y (3 blocks, n)."""
    np.dot(y.T, y, product)
    n, width = len(columns), t.shape[1]
    flat, part = t.reshape(t.size), product.reshape(product.size)
    for one in range(len(runs) - 1):
        edge = runs[one] - first
        for a in range(runs[one + 1] - runs[one]):
            for other in range(one, len(runs) - 1):
                begin = max(edge + a, runs[other] - first)
                to = np.uintp((columns[edge] + a) * width + columns[begin])
                of = np.uintp((edge + a) * n + begin)
                for q in range(np.uintp(runs[other + 1] - first - begin)):
                    flat[to + q] -= part[of + q]


def _eliminate(v, wide, b, starts, columns, runs, ends, alike, t, g, damping, smallest):
    """Returns the number of the first block that is not determined, or -1.

    Blocks alike[k] to alike[k + 1] have the same columns: they leave t together.
    """
    longest = 0
    for o in range(len(b)):
        longest = max(longest, starts[o + 1] - starts[o])
    store, square = np.empty(3 * TOGETHER * longest), np.empty(longest * longest)
    for k in range(len(alike) - 1):
        first = starts[alike[k]]
        n = starts[alike[k] + 1] - first
        mine = columns[first : first + n]
        edges = ends[runs[alike[k]] : runs[alike[k] + 1] + 1]
        for begin in range(alike[k], alike[k + 1], TOGETHER):
            count = min(TOGETHER, alike[k + 1] - begin)
            y = store[: 3 * count * n].reshape((3 * count, n))
            for o in range(begin, begin + count):
                if not _root(v[o], damping, smallest):
                    return o
                _forward(v[o], b[o])
                row = 3 * (o - begin)
                part = wide[starts[o] : starts[o] + n]
                _forward_all(v[o], part, b[o], y[row : row + 3], g, mine)
            _leave(t, mine, edges, first, y, square[: n * n].reshape((n, n)))
    return -1


def _back(v, wide, b, starts, columns, reduced, out):
    flat, one, two, three = wide.reshape(wide.size), np.uintp(1), np.uintp(2), np.uintp(3)
    for o in range(len(b)):
        x0, x1, x2 = b[o, 0], b[o, 1], b[o, 2]
        first = np.uintp(starts[o])
        for a in range(np.uintp(starts[o + 1] - starts[o])):
            r, at = reduced[np.uintp(columns[first + a])], three * (first + a)
            x0 += flat[at] * r
            x1 += flat[at + one] * r
            x2 += flat[at + two] * r
        x2 = x2 / v[o, 5]
        x1 = (x1 - v[o, 4] * x2) / v[o, 2]
        x0 = (x0 - v[o, 1] * x1 - v[o, 3] * x2) / v[o, 0]
        out[o, 0], out[o, 1], out[o, 2] = x0, x1, x2


def _cofactors(v, wide, starts, columns, runs, ends, inverse, cross, out):
    longest = 0
    for o in range(len(v)):
        longest = max(longest, starts[o + 1] - starts[o])
    z = np.empty((3, longest))
    for o in range(len(v)):
        first, n = starts[o], starts[o + 1] - starts[o]
        c = columns[first : first + n]
        i00, i11, i22 = 1.0 / v[o, 0], 1.0 / v[o, 2], 1.0 / v[o, 5]
        i10 = -v[o, 1] * i00 * i11
        i21 = -v[o, 4] * i11 * i22
        i20 = -(v[o, 3] * i00 + v[o, 4] * i10) * i22
        for a in range(n):
            y0, y1, y2 = wide[first + a, 0], wide[first + a, 1], wide[first + a, 2]
            z[0, a] = i00 * y0 + i10 * y1 + i20 * y2
            z[1, a] = i11 * y1 + i21 * y2
            z[2, a] = i22 * y2
        s00, s10, s11, s20, s21, s22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(n):
            x0, x1, x2 = 0.0, 0.0, 0.0
            for one in range(runs[o], runs[o + 1]):
                begin, end = ends[one], ends[one + 1]
                line = inverse[c[a], columns[begin] : columns[begin] + end - begin]
                z0 = z[0, begin - first : end - first]
                z1 = z[1, begin - first : end - first]
                z2 = z[2, begin - first : end - first]
                for q in range(end - begin):
                    x0 += line[q] * z0[q]
                    x1 += line[q] * z1[q]
                    x2 += line[q] * z2[q]
            cross[first + a, 0], cross[first + a, 1], cross[first + a, 2] = -x0, -x1, -x2
            s00 += z[0, a] * x0
            s10 += z[1, a] * x0
            s11 += z[1, a] * x1
            s20 += z[2, a] * x0
            s21 += z[2, a] * x1
            s22 += z[2, a] * x2
        out[o, 0, 0] = s00 + i00 * i00 + i10 * i10 + i20 * i20
        out[o, 1, 0] = s10 + i10 * i11 + i20 * i21
        out[o, 1, 1] = s11 + i11 * i11 + i21 * i21
        out[o, 2, 0] = s20 + i20 * i22
        out[o, 2, 1] = s21 + i21 * i22
        out[o, 2, 2] = s22 + i22 * i22
        out[o, 0, 1], out[o, 0, 2], out[o, 1, 2] = out[o, 1, 0], out[o, 2, 0], out[o, 2, 1]


def _leverage(jac, block, first, place, cuts, inverse, cross, cofactors, spare, out):
    n, m, _ = jac.shape
    runs = len(cuts) - 1
    for i in range(n):
        q = cofactors[block[i]]
        for row in range(m):
            e0, e1, e2 = jac[i, row, 0], jac[i, row, 1], jac[i, row, 2]
            total = (
                e0 * e0 * q[0, 0] + e1 * e1 * q[1, 1] + e2 * e2 * q[2, 2]
                + 2.0 * (e0 * e1 * q[0, 1] + e0 * e2 * q[0, 2] + e1 * e2 * q[1, 2])
            )  # fmt: skip
            for one in range(runs):
                if first[i, one] == spare:
                    continue
                for a in range(cuts[one], cuts[one + 1]):
                    f, step = jac[i, row, 3 + a], a - cuts[one]
                    line, x = cross[place[i, one] + step], inverse[first[i, one] + step]
                    half = 0.5 * f * x[first[i, one] + step]
                    half += e0 * line[0] + e1 * line[1] + e2 * line[2]
                    for other in range(one, runs):
                        if first[i, other] == spare:
                            continue
                        by = first[i, other] - cuts[other]
                        for c in range(max(a + 1, cuts[other]), cuts[other + 1]):
                            half += jac[i, row, 3 + c] * x[by + c]
                    total += 2.0 * f * half
            out[i, row] = total
