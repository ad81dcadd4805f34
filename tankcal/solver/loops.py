"""Building and eliminating the normal equations: plain loops, to be compiled.

For the rows of a batch with derivatives E by their block and F by reduced unknowns

    V += E'E,   wide += F'E,   S += F'F,   b += E'w,   g += F'w

and for each block, V = L L', the wide part becomes Y = wide L^-T and b becomes y = L^-1 b, so that
the reduced equations are S - Y Y' and g - Y y. S is kept as a matrix T in which each pair of
unknowns stands once: S = T + T' - diag T.
"""

import numpy as np

TOGETHER = 32  # blocks with the same columns that are eliminated at once
BY_HAND = 500  # elements; above it a product is worth a call of BLAS
COMPILED = (
    "_add_rows",
    "_add_plain_rows",
    "_root",
    "_forward",
    "_forward_all",
    "_subtract",
    "_leave",
    "_eliminate",
    "_back",
    "_cofactors",
    "_leverage",
)


def _add_plain_rows(w, jac, columns, t, g):
    n, m, k = jac.shape
    for i in range(n):
        c = columns[i]
        for row in range(m):
            f, r = jac[i, row], w[i, row]
            for a in range(k):
                g[c[a]] += f[a] * r
                for b in range(a, k):
                    t[c[a], c[b]] += f[a] * f[b]


def _add_rows(w, jac, block, columns, places, cuts, v, wide, b, t, g):
    n, m, k = jac.shape
    for i in range(n):
        c, p, o = columns[i], places[i], block[i]
        for row in range(m):
            e, f, r = jac[i, row, :3], jac[i, row, 3:], w[i, row]
            e0, e1, e2 = e[0], e[1], e[2]
            b[o, 0] += e0 * r
            b[o, 1] += e1 * r
            b[o, 2] += e2 * r
            v[o, 0] += e0 * e0
            v[o, 1] += e1 * e0
            v[o, 2] += e1 * e1
            v[o, 3] += e2 * e0
            v[o, 4] += e2 * e1
            v[o, 5] += e2 * e2
            for a in range(k - 3):
                fa = f[a]
                wide[p[a], 0] += fa * e0
                wide[p[a], 1] += fa * e1
                wide[p[a], 2] += fa * e2
                g[c[a]] += fa * r
        if m == 2:  # image coordinates: most of the work
            f, h = jac[i, 0, 3:], jac[i, 1, 3:]
            for one in range(len(cuts) - 1):
                for a in range(cuts[one], cuts[one + 1]):
                    fa, ha = f[a], h[a]
                    for other in range(one, len(cuts) - 1):
                        begin, end = max(a, cuts[other]), cuts[other + 1]
                        line = t[c[a], c[begin] : c[begin] + end - begin]
                        f1, h1 = f[begin:end], h[begin:end]
                        for q in range(end - begin):
                            line[q] += fa * f1[q] + ha * h1[q]
        else:
            for row in range(m):
                f = jac[i, row, 3:]
                for a in range(k - 3):
                    for q in range(a, k - 3):
                        t[c[a], c[q]] += f[a] * f[q]


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


def _subtract(t, columns, runs, first, product):
    """Take a product (n, n), its upper half, from the places of its columns in t."""
    for one in range(len(runs) - 1):
        for a in range(runs[one] - first, runs[one + 1] - first):
            for other in range(one, len(runs) - 1):
                begin, end = max(a, runs[other] - first), runs[other + 1] - first
                to = columns[begin]
                line, part = t[columns[a], to : to + end - begin], product[a, begin:end]
                for q in range(end - begin):
                    line[q] -= part[q]


def _leave(t, columns, runs, first, y, product):
    """Take Y'Y, its upper half, from the places of its columns in t; y (3 blocks, n)."""
    n = len(columns)
    if y.size > BY_HAND:
        np.dot(y.T, y, product)
        _subtract(t, columns, runs, first, product)
    elif len(y) == 3:
        for a in range(n):
            w0, w1, w2, line = -y[0, a], -y[1, a], -y[2, a], t[columns[a]]
            for q in range(a, n):
                line[columns[q]] += w0 * y[0, q] + w1 * y[1, q] + w2 * y[2, q]
    else:
        product[:] = 0.0
        for row in range(0, len(y), 3):
            y0, y1, y2 = y[row], y[row + 1], y[row + 2]
            for a in range(n):
                w0, w1, w2, line = y0[a], y1[a], y2[a], product[a]
                for q in range(a, n):
                    line[q] += w0 * y0[q] + w1 * y1[q] + w2 * y2[q]
        _subtract(t, columns, runs, first, product)


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
    for o in range(len(b)):
        x0, x1, x2 = b[o, 0], b[o, 1], b[o, 2]
        for a in range(starts[o], starts[o + 1]):
            line, r = wide[a], reduced[columns[a]]
            x0 += line[0] * r
            x1 += line[1] * r
            x2 += line[2] * r
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


def _leverage(jac, block, columns, places, inverse, cross, cofactors, spare, out):
    n, m, k = jac.shape
    for i in range(n):
        o, c, p = block[i], columns[i], places[i]
        for row in range(m):
            e, f = jac[i, row, :3], jac[i, row, 3:]
            q = cofactors[o]
            total = (
                e[0] * e[0] * q[0, 0] + e[1] * e[1] * q[1, 1] + e[2] * e[2] * q[2, 2]
                + 2.0 * (e[0] * e[1] * q[0, 1] + e[0] * e[2] * q[0, 2] + e[1] * e[2] * q[1, 2])
            )  # fmt: skip
            for a in range(k - 3):
                if c[a] == spare:
                    continue
                line, x = cross[p[a]], inverse[c[a]]
                half = 0.5 * f[a] * x[c[a]] + e[0] * line[0] + e[1] * line[1] + e[2] * line[2]
                for b in range(a + 1, k - 3):
                    if c[b] != spare:
                        half += f[b] * x[c[b]]
                total += 2.0 * f[a] * half
            out[i, row] = total
