"""Building and eliminating the normal equations: plain loops, to be compiled.

For the rows of a batch with derivatives E by their block and F by reduced unknowns

    V += E'E,   wide += F'E,   S += F'F,   b += E'w,   g += F'w

and for each block, V = L L', the wide part becomes Y = wide L^-T and b becomes y = L^-1 b, so that
the reduced equations are S - Y Y' and g - Y y. Of S the upper half is kept, T.

In the innermost loops places are counted without a sign (np.uintp): numba tests at each number
whether one that might be negative is counted from the end.
"""

import numpy as np

PANEL = 64  # columns of Y whose products with those after them are taken at once
TOGETHER = 32  # blocks with the same columns that are eliminated at once
LEAVING = 4  # blocks whose products take as long as spreading those of a series over the columns
COMPILED = (
    "_follow",
    "_mark",
    "_list_series",
    "_work",
    "_join_series",
    "_list_columns",
    "_find_places",
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


def _mark(block, first, cuts, together):
    """Mark (blocks, columns) where rows with a block have columns: first (n, s) of runs."""
    for i in range(len(block)):
        for run in range(len(cuts) - 1):
            for step in range(cuts[run + 1] - cuts[run]):
                together[block[i], first[i, run] + step] = True


def _follow(columns, spare, follows):
    """follows (k - 1,) stays True where in all rows (n, k) a column is the one after its left."""
    for i in range(len(columns)):
        for a in range(len(follows)):
            right = columns[i, a + 1]
            follows[a] &= (right == columns[i, a] + 1) & (right != spare)


def _list_series(together):
    """alike of a Plan, by the marks (blocks, columns)."""
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


def _join_series(together, alike):
    """Neighbouring series get the columns of both where one series is less work than two.

    The marks (blocks, columns) are changed; returns alike of what there is then. The columns that a
    block gets hold zeros: these are multiplied sooner than many small products are spread.
    """
    joined, series = alike.copy(), 0
    for k in range(1, len(alike) - 1):
        first, begin, end = joined[series], alike[k], alike[k + 1]
        both = together[first] | together[begin]
        apart = _work(begin - first, together[first].sum())
        apart += _work(end - begin, together[begin].sum())
        if _work(end - first, both.sum()) <= apart:
            together[first], together[begin] = both, both
        else:
            series += 1
            joined[series] = begin
    joined = joined[: min(series + 2, len(alike))].copy()
    joined[-1] = alike[-1]
    for k in range(len(joined) - 1):
        together[joined[k] : joined[k + 1]] = together[joined[k]]
    return joined


def _work(blocks, columns):
    """What a series of blocks costs in _eliminate, in products of numbers for a third of a row."""
    return columns * columns * (blocks + LEAVING * ((blocks + TOGETHER - 1) // TOGETHER))


def _list_columns(together, reduced, alike, starts):
    """columns and ends of a Plan, by the marks (blocks, columns); starts is filled."""
    for k in range(len(alike) - 1):
        count = 0
        for c in range(reduced):
            count += together[alike[k], c]
        for o in range(alike[k], alike[k + 1]):
            starts[o + 1] = starts[o] + count
    columns, runs = np.empty(starts[-1], dtype=np.int32), 0
    ends = np.empty(starts[-1] + 1, dtype=np.int64)
    for k in range(len(alike) - 1):
        first, others = starts[alike[k]], alike[k + 1] - alike[k] - 1
        at, last, before = first, -2, runs
        for c in range(reduced):
            if together[alike[k], c]:
                if c != last + 1:
                    ends[runs] = at
                    runs += 1
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
                    if first[begin, other] >= first[begin, one]:
                        for q in range(max(a, cuts[other]), cuts[other + 1]):
                            t[to + a, by + q] += square[skip + a, skip + q]
                    else:
                        for q in range(cuts[other], cuts[other + 1]):
                            t[by + q, to + a] += square[skip + a, skip + q]


def _is_alike(first, i, j):
    alike = True
    for run in range(first.shape[1]):
        alike = alike and first[i, run] == first[j, run]
    return alike


def _add_blocks(w, jac, block, place, cuts, starts, v, wide, b):
    """V += E'E, wide += F'E, b += E'w; E are the first three derivatives, F those after them."""
    n, m, _ = jac.shape
    spare = starts[-1]
    for i in range(n):
        o = block[i]
        before, length = 2 * starts[o], np.uintp(starts[o + 1] - starts[o])
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
                if place[i, one] == spare:
                    continue
                to = np.uintp(before + place[i, one])
                for a in range(cuts[one], cuts[one + 1]):
                    f, h = jac[i, row, 3 + a], jac[i, x, 3 + a]
                    wide[to] += f * e0 + h * d0
                    wide[to + length] += f * e1 + h * d1
                    wide[to + length + length] += f * e2 + h * d2
                    to += np.uintp(1)


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


def _forward_all(v, b, o, wide, first, n, right):
    """The wide part of block o, 3 n numbers from `first` on, becomes Y; right (n,) gains Y b."""
    l10, l20, l21 = v[o, 1], v[o, 3], v[o, 4]
    i0, i1, i2 = 1.0 / v[o, 0], 1.0 / v[o, 2], 1.0 / v[o, 5]
    b0, b1, b2 = b[o, 0], b[o, 1], b[o, 2]
    one = np.uintp(first)
    two, three = one + np.uintp(n), one + np.uintp(2 * n)
    for a in range(np.uintp(n)):
        y0 = wide[one + a] * i0
        y1 = (wide[two + a] - l10 * y0) * i1
        y2 = (wide[three + a] - l20 * y0 - l21 * y1) * i2
        wide[one + a], wide[two + a], wide[three + a] = y0, y1, y2
        right[a] += y0 * b0 + y1 * b1 + y2 * b2


def _leave(t, columns, runs, first, y, store):
    """Take Y'Y, its upper half, from the places of its columns in t; y (3 blocks, n).

    Of many columns PANEL at a time are multiplied by themselves and those after them.
    """
    rows, n = y.shape
    width, one = t.shape[1], 0
    flat = t.reshape(t.size)
    for low in range(0, n, PANEL):
        high = min(low + PANEL, n)
        if n <= PANEL:
            part = store[: n * n]
            np.dot(y.T, y, part.reshape((n, n)))
        else:
            wide, tall = (high - low) * (n - low), (high - low) * rows
            part = store[:wide]
            left = store[wide : wide + tall].reshape((rows, high - low))
            right = store[wide + tall : wide + tall + rows * (n - low)].reshape((rows, n - low))
            for i in range(rows):
                for a in range(low, high):
                    left[i, a - low] = y[i, a]
                for a in range(low, n):
                    right[i, a - low] = y[i, a]
            np.dot(left.T, right, part.reshape((high - low, n - low)))
        for a in range(low, high):
            if runs[one + 1] - first == a:
                one += 1
            line = columns[a] * width
            of = np.uintp((a - low) * (n - low))
            for other in range(one, len(runs) - 1):
                begin = max(a, runs[other] - first)
                to = np.uintp(line + columns[begin])
                at = of + np.uintp(begin - low)
                for q in range(np.uintp(runs[other + 1] - first - begin)):
                    flat[to + q] -= part[at + q]


def _eliminate(v, wide, b, starts, columns, runs, ends, alike, t, g, damping, smallest):
    """Returns the number of the first block that is not determined, or -1.

    Blocks alike[k] to alike[k + 1] have the same columns: they leave t together.
    """
    longest = 0
    for o in range(len(b)):
        longest = max(longest, starts[o + 1] - starts[o])
    store, square = np.empty(longest), np.empty((longest + 6 * TOGETHER) * longest)
    for k in range(len(alike) - 1):
        first = starts[alike[k]]
        n = starts[alike[k] + 1] - first
        mine, right = columns[first : first + n], store[:n]
        edges = ends[runs[alike[k]] : runs[alike[k] + 1] + 1]
        right[:] = 0.0
        for begin in range(alike[k], alike[k + 1], TOGETHER):
            end = min(begin + TOGETHER, alike[k + 1])
            y = wide[3 * starts[begin] : 3 * starts[end]].reshape((3 * (end - begin), n))
            for o in range(begin, end):
                if not _root(v[o], damping, smallest):
                    return o
                _forward(v[o], b[o])
                _forward_all(v, b, o, wide, 3 * starts[o], n, right)
            _leave(t, mine, edges, first, y, square)
        for a in range(n):
            g[mine[a]] -= right[a]
    return -1


def _back(v, wide, b, starts, columns, alike, reduced, out):
    """L^-T (b + Y' reduced) of each block into out (nb, 3)."""
    longest = 0
    for o in range(len(b)):
        longest = max(longest, starts[o + 1] - starts[o])
    store = np.empty(longest)
    for k in range(len(alike) - 1):
        first = starts[alike[k]]
        n = starts[alike[k] + 1] - first
        own = store[:n]
        for a in range(n):
            own[a] = reduced[columns[first + a]]
        for o in range(alike[k], alike[k + 1]):
            at, length = np.uintp(3 * starts[o]), np.uintp(n)
            x0, x1, x2 = b[o, 0], b[o, 1], b[o, 2]
            for a in range(length):
                x0 += wide[at + a] * own[a]
                x1 += wide[at + length + a] * own[a]
                x2 += wide[at + length + length + a] * own[a]
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
            at = 3 * first + a
            y0, y1, y2 = wide[at], wide[at + n], wide[at + 2 * n]
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
