"""Building and eliminating the normal equations: plain loops, to be compiled.

For the rows of a batch with derivatives E by their block and F by reduced unknowns

    V += E'E,   wide += F'E,   S += F'F,   b += E'w,   g += F'w

and for each block, V = L L', the wide part becomes Y = wide L^-T and b becomes y = L^-1 b, so that
the reduced equations are S - Y Y' and g - Y y. Of S the upper half is kept, T.

In the innermost loops places are counted without a sign (np.uintp): numba tests at each number
whether one that might be negative is counted from the end.
"""

import numpy as np

PANEL = 64  # columns whose products with those after them are taken at once; an even number
WIDE = 264  # of those after them, at most, and no power of two: rows share no lines of the cache
SIDE = 8  # columns that the processor multiplies side by side; WIDE is a multiple of it
COMPILED = (
    "_is_alike",
    "_spread",
    "_pack",
    "_square",
    "_add_square",
    "_product",
    "_add_squares",
    "_add_blocks",
    "_add_rows",
    "_root",
    "_forward",
    "_sizes",
    "_eliminate",
    "_back",
    "_inverse_root",
    "_through",
    "_add_own",
    "_among",
    "_own_cofactors",
    "_cofactors",
    "_leverage",
)


def _add_rows(w, jac, has_block, block, first, place, cuts, starts, v, wide, b, t, g):
    """Add rows of a Batch to the Normals; without blocks anything stands for block and place."""
    _add_squares(w, jac, 3 if has_block else 0, first, cuts, t, g)
    if has_block:
        _add_blocks(w, jac, block, place, cuts, starts, v, wide, b)


def _add_squares(w, jac, skip, first, cuts, t, g):
    """S += F'F, g += F'w; F are the derivatives from number `skip` on, in runs of columns.

    Neighbouring rows with the same columns enter by one product.
    """
    n, m, width = jac.shape
    k, runs = width - skip, len(cuts) - 1
    flat, errors, flat_t = jac.reshape(jac.size), w.reshape(w.size), t.reshape(t.size)
    pack, square, product = np.zeros(12 * WIDE), np.empty((PANEL + 1) * WIDE), np.empty(k)
    end = n if runs == 0 else 0
    while end < n:
        begin, end = end, end + 1
        while end < n and _is_alike(first, end, begin):
            end += 1
        at, own = m * begin * width + skip, first[begin]
        rows = m * (end - begin)
        _add_square(1.0, flat, at, width, rows, own, cuts, pack, square, flat_t, len(g))
        _product(flat, at, width, errors[m * begin : m * end], product)
        for one in range(runs):
            to = first[begin, one] - cuts[one]
            for a in range(cuts[one], cuts[one + 1]):
                g[to + a] += product[a]


def _is_alike(first, i, j):
    alike = True
    for run in range(first.shape[1]):
        alike = alike and first[i, run] == first[j, run]
    return alike


def _add_square(sign, flat, at, width, rows, first, cuts, pack, square, flat_t, width_t):
    """Add Y'Y, its upper half, to the places of its columns in t, or take it from there.

    sign   1 or -1
    flat   numbers of which Y (rows, n) begins at `at`, each row width after the one before
    first  (s,) place of the first column of each run, cuts (s + 1,) where the runs begin, n last
    """
    n = cuts[-1]
    for low in range(0, n, PANEL):
        high = min(low + PANEL, n)
        for left in range(low, n, WIDE):
            right = min(left + WIDE, n)
            _square(flat, at, width, rows, low, high, left, right, pack, square)
            _spread(sign, first, cuts, low, high, left, right, square, flat_t, width_t)


def _spread(sign, first, cuts, low, high, left, right, square, flat, width):
    """Add a part of a square, as _square leaves it, or take it, to the upper half of t.

    first (s,) and cuts (s + 1,) of the runs of its columns, see Batch; sign 1 or -1
    flat, width  t as one row, and how many numbers it has in a row
    """
    for one in range(len(first)):
        to = first[one] - cuts[one]
        begin, end = max(cuts[one], low), min(cuts[one + 1], high)
        for other in range(one, len(first)):
            by = first[other] - cuts[other]
            start, stop = max(cuts[other], left), min(cuts[other + 1], right)
            if by + cuts[other] >= to + cuts[one]:
                for a in range(begin, end):
                    start = max(a, start)
                    at = np.uintp((a - low) * WIDE + start - left)
                    into = np.uintp((to + a) * width + by + start)
                    for q in range(np.uintp(max(stop - start, 0))):
                        flat[into + q] += sign * square[at + q]
            else:
                for q in range(start, stop):
                    at = q - left - low * WIDE
                    for a in range(begin, end):
                        flat[(by + q) * width + to + a] += sign * square[at + a * WIDE]


def _square(flat, first, width, rows, low, high, left, right, pack, out):
    """The part of Y'Y on and above its diagonal, rows low to high and columns left to right.

    The numbers of a row of Y begin at first, those of the next after width. left is low, or after
    high. Out gets WIDE numbers a row, and a row more. Six rows of Y are copied to pack and
    multiplied two columns at a time: what is read is used often, and as all distances are known
    the compiler need not ask whether what it writes lies where it reads. It is done in whole groups
    of SIDE columns: nobody reads what comes out left of the diagonal and right of the last one.
    """
    n, own = np.uintp(right - left), 0
    whole = np.uintp((right - left + SIDE - 1) // SIDE * SIDE)
    for a in range(np.uintp(high - low)):
        for q in range(whole):
            out[a * np.uintp(WIDE) + q] = 0.0
    for row in range(0, rows, 6):
        at = first + row * width
        _pack(flat, at + left, width, rows - row, n, 0, pack)
        if left > low:
            own = 6 * WIDE
            _pack(flat, at + low, width, rows - row, np.uintp(high - low), own, pack)
        for a in range(low, high, 2):
            i = np.uintp(own + a - low)
            a0, b0 = pack[i], pack[i + np.uintp(1)]
            a1, b1 = pack[i + np.uintp(WIDE)], pack[i + np.uintp(WIDE + 1)]
            a2, b2 = pack[i + np.uintp(2 * WIDE)], pack[i + np.uintp(2 * WIDE + 1)]
            a3, b3 = pack[i + np.uintp(3 * WIDE)], pack[i + np.uintp(3 * WIDE + 1)]
            a4, b4 = pack[i + np.uintp(4 * WIDE)], pack[i + np.uintp(4 * WIDE + 1)]
            a5, b5 = pack[i + np.uintp(5 * WIDE)], pack[i + np.uintp(5 * WIDE + 1)]
            to = np.uintp((a - low) * WIDE)
            for q in range(np.uintp(max(a - left, 0) // SIDE * SIDE), whole):
                q0, q1 = pack[q], pack[q + np.uintp(WIDE)]
                q2, q3 = pack[q + np.uintp(2 * WIDE)], pack[q + np.uintp(3 * WIDE)]
                q4, q5 = pack[q + np.uintp(4 * WIDE)], pack[q + np.uintp(5 * WIDE)]
                out[to + q] += a0 * q0 + a1 * q1 + a2 * q2 + a3 * q3 + a4 * q4 + a5 * q5
                out[to + q + np.uintp(WIDE)] += (
                    b0 * q0 + b1 * q1 + b2 * q2 + b3 * q3 + b4 * q4 + b5 * q5
                )


def _pack(flat, first, width, rows, n, to, pack):
    """Copy n numbers of each of six rows, zeros where there are fewer, to WIDE apart."""
    for row in range(6):
        i, at = np.uintp(to + row * WIDE), np.uintp(first + row * width)
        if row < rows:
            for q in range(n):
                pack[i + q] = flat[at + q]
        else:
            for q in range(n):
                pack[i + q] = 0.0


def _product(flat, first, width, errors, out):
    """F'e into out, of rows F that begin at first, those of the next after width."""
    out[:] = 0.0
    for row in range(len(errors)):
        at, error = np.uintp(first + row * width), errors[row]
        for a in range(np.uintp(len(out))):
            out[a] += flat[at + a] * error


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


def _forward(v, b, o, wide, first, n, right):
    """b of block o becomes y, its wide part, 3 n numbers from first on, Y; right (n,) gains Y y."""
    l10, l20, l21 = v[o, 1], v[o, 3], v[o, 4]
    i0, i1, i2 = 1.0 / v[o, 0], 1.0 / v[o, 2], 1.0 / v[o, 5]
    b0 = b[o, 0] * i0
    b1 = (b[o, 1] - l10 * b0) * i1
    b2 = (b[o, 2] - l20 * b0 - l21 * b1) * i2
    b[o, 0], b[o, 1], b[o, 2] = b0, b1, b2
    one = np.uintp(first)
    two, three = one + np.uintp(n), one + np.uintp(2 * n)
    for a in range(np.uintp(n)):
        y0 = wide[one + a] * i0
        y1 = (wide[two + a] - l10 * y0) * i1
        y2 = (wide[three + a] - l20 * y0 - l21 * y1) * i2
        wide[one + a], wide[two + a], wide[three + a] = y0, y1, y2
        right[a] += y0 * b0 + y1 * b1 + y2 * b2


def _eliminate(v, wide, b, starts, columns, runs, ends, alike, t, g, damping, smallest):
    """Returns the number of the first block that is not determined, or -1.

    Blocks alike[k] to alike[k + 1] have the same columns: they leave t together.
    """
    longest, _ = _sizes(starts, alike)
    right, pack, square = np.empty(longest), np.zeros(12 * WIDE), np.empty((PANEL + 1) * WIDE)
    heads, cuts = np.empty(longest, dtype=np.int64), np.empty(longest + 1, dtype=np.int64)
    flat = t.reshape(t.size)
    for k in range(len(alike) - 1):
        begin, end, first = alike[k], alike[k + 1], starts[alike[k]]
        n = starts[begin + 1] - first
        right[:n] = 0.0
        for o in range(begin, end):
            if not _root(v[o], damping, smallest):
                return o
            _forward(v, b, o, wide, 3 * starts[o], n, right)
        edges = ends[runs[begin] : runs[begin + 1] + 1]
        for run in range(len(edges) - 1):
            heads[run] = columns[edges[run]]
        for run in range(len(edges)):
            cuts[run] = edges[run] - first
        own, at = heads[: len(edges) - 1], cuts[: len(edges)]
        rows = 3 * (end - begin)
        _add_square(-1.0, wide, 3 * first, n, rows, own, at, pack, square, flat, len(g))
        for a in range(n):
            g[columns[first + a]] -= right[a]
    return -1


def _sizes(starts, alike):
    """The most columns of a block, and the most blocks of a series."""
    longest, most = 0, 0
    for k in range(len(alike) - 1):
        longest = max(longest, starts[alike[k] + 1] - starts[alike[k]])
        most = max(most, alike[k + 1] - alike[k])
    return longest, most


def _back(v, wide, b, starts, columns, alike, reduced, out):
    """L^-T (b + Y' reduced) of each block into out (nb, 3)."""
    store = np.empty(_sizes(starts, alike)[0])
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


def _inverse_root(v, root):
    """L^-1 of a block into the lower half of root (3, 3)."""
    root[0, 0], root[1, 1], root[2, 2] = 1.0 / v[0], 1.0 / v[2], 1.0 / v[5]
    root[1, 0], root[2, 1] = -v[1] * root[0, 0] * root[1, 1], -v[4] * root[1, 1] * root[2, 2]
    root[2, 0] = -(v[3] * root[0, 0] + v[4] * root[1, 0]) * root[2, 2]


def _through(v, wide, starts, columns, unknowns, reduced, out):
    """d unknown / d reduced of some unknowns (k,) into out (k, nr), which is zero before."""
    root = np.zeros((3, 3))
    for i in range(len(unknowns)):
        if unknowns[i] < reduced:
            out[i, unknowns[i]] = 1.0
            continue
        o, axis = divmod(unknowns[i] - reduced, 3)
        _inverse_root(v[o], root)
        r0, r1, r2 = root[0, axis], root[1, axis], root[2, axis]
        first, n = starts[o], starts[o + 1] - starts[o]
        for a in range(n):
            at = 3 * first + a
            change = r0 * wide[at] + r1 * wide[at + n] + r2 * wide[at + 2 * n]
            out[i, columns[first + a]] = -change


def _add_own(v, block, axis, places, q):
    """Add V^-1 between unknowns (k,), sorted by block, to their places in q."""
    root = np.zeros((3, 3))
    for i in range(len(block)):
        _inverse_root(v[block[i]], root)
        j = i
        while j < len(block) and block[j] == block[i]:
            value = 0.0
            for e in range(3):
                value += root[e, axis[i]] * root[e, axis[j]]
            q[places[i], places[j]] += value
            if j > i:
                q[places[j], places[i]] += value
            j += 1


def _among(inverse, columns, runs, first, q):
    """The part q (n, n) of a matrix of some columns (n,), in runs of neighbours."""
    for a in range(len(columns)):
        line = inverse[columns[a]]
        for run in range(len(runs) - 1):
            to, by = runs[run] - first, columns[runs[run] - first]
            for step in range(runs[run + 1] - runs[run]):
                q[a, to + step] = line[by + step]


def _cofactors(v, wide, starts, columns, runs, ends, alike, inverse, cross, out):
    """With Z = Y L^-1 and Q from inverse: -Q Z into cross, L^-T L^-1 + Z'Q Z into out."""
    longest, most = _sizes(starts, alike)
    square, root = np.empty(longest * longest), np.zeros((3, 3))
    left, right = np.empty(3 * most * longest), np.empty(3 * most * longest)
    for k in range(len(alike) - 1):
        begin, end, first = alike[k], alike[k + 1], starts[alike[k]]
        n, rows = starts[begin + 1] - first, 3 * (end - begin)
        q = square[: n * n].reshape((n, n))
        z, x = left[: rows * n].reshape((rows, n)), right[: rows * n].reshape((rows, n))
        edges = ends[runs[begin] : runs[begin + 1] + 1]
        _among(inverse, columns[first : first + n], edges, first, q)
        for o in range(begin, end):
            _inverse_root(v[o], root)
            i, at = 3 * (o - begin), 3 * starts[o]
            for a in range(n):
                y0, y1, y2 = wide[at + a], wide[at + n + a], wide[at + 2 * n + a]
                z[i, a] = root[0, 0] * y0 + root[1, 0] * y1 + root[2, 0] * y2
                z[i + 1, a] = root[1, 1] * y1 + root[2, 1] * y2
                z[i + 2, a] = root[2, 2] * y2
        np.dot(z, q, x)
        for o in range(begin, end):
            _inverse_root(v[o], root)
            i = 3 * (o - begin)
            _own_cofactors(root, z[i : i + 3], x[i : i + 3], cross[starts[o] :], out[o])


def _own_cofactors(root, z, x, cross, out):
    """What _cofactors writes of one block; z and x (3, n) are Z' and Z'Q."""
    n = z.shape[1]
    for c in range(3):
        for a in range(n):
            cross[a, c] = -x[c, a]
        for d in range(c + 1):
            total = 0.0
            for a in range(n):
                total += z[c, a] * x[d, a]
            for e in range(c, 3):
                total += root[e, c] * root[e, d]
            out[c, d] = out[d, c] = total


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
