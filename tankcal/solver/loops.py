"""Assembly and elimination of the normal equations, as plain loops that are compiled.

Rows of a batch have derivatives E by their block and F by the reduced unknowns:

    V += E'E,   wide += F'E,   S += F'F,   b += E'w,   g += F'w

For each block, V = L L'. The wide part becomes Y = wide L^-T, and b becomes y = L^-1 b. The reduced
equations are then S - Y Y' and g - Y y. Only the upper half T of S is stored.

The innermost loops use unsigned indices (np.uintp). For a signed index, numba tests at each access
whether the index counts from the end.
"""

import numpy as np

PANEL = 64  # left columns of a product computed together; even
WIDE = 264  # most right columns; no power of two, so that rows do not share cache lines
SIDE = 8  # columns multiplied by one vector instruction; WIDE is a multiple
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
    """Add rows of a Batch to the Normals; without blocks, `block` and `place` are ignored."""
    _add_squares(w, jac, 3 if has_block else 0, first, cuts, t, g)
    if has_block:
        _add_blocks(w, jac, block, place, cuts, starts, v, wide, b)


def _add_squares(w, jac, skip, first, cuts, t, g):
    """S += F'F and g += F'w; F are the derivatives from index `skip`, in runs of columns.

    Neighbouring rows with equal columns are added by one product.
    """
    n, m, width = jac.shape
    k, runs = width - skip, len(cuts) - 1
    flat, errors, flat_t = jac.reshape(jac.size), w.reshape(w.size), t.reshape(t.size)
    pack, square, product = np.zeros(12 * WIDE), np.empty((PANEL + 1) * WIDE), np.empty(k)
    end = n if runs == 0 else 0
    while end < n:
        begin, end = end, end + 1
        # Collect neighbouring rows with equal columns.
        while end < n and _is_alike(first, end, begin):
            end += 1
        start, columns = m * begin * width + skip, first[begin]
        rows = m * (end - begin)
        _add_square(1.0, flat, start, width, rows, columns, cuts, pack, square, flat_t, len(g))
        _product(flat, start, width, errors[m * begin : m * end], product)
        for run in range(runs):
            shift = first[begin, run] - cuts[run]
            for a in range(cuts[run], cuts[run + 1]):
                g[shift + a] += product[a]


def _is_alike(first, i, j):
    """Whether rows i and j have equal columns."""
    alike = True
    for run in range(first.shape[1]):
        alike = alike and first[i, run] == first[j, run]
    return alike


def _add_square(sign, flat, start, width, rows, first, cuts, pack, square, flat_t, width_t):
    """Add or subtract the upper half of Y'Y at the places of its columns in t.

    sign
        1 to add, -1 to subtract.
    flat, at, width
        Array that contains Y (rows, n): Y begins at index `at`, and its rows are `width` apart.
    first, cuts
        First column (s,) of each run, and begin (s + 1,) of each run within a row; the last cut is
        n.
    """
    # Panels on and above the diagonal, each small enough for the cache of the processor.
    n = cuts[-1]
    for low in range(0, n, PANEL):
        high = min(low + PANEL, n)
        for left in range(low, n, WIDE):
            right = min(left + WIDE, n)
            _square(flat, start, width, rows, low, high, left, right, pack, square)
            _spread(sign, first, cuts, low, high, left, right, square, flat_t, width_t)


def _spread(sign, first, cuts, low, high, left, right, square, flat, width):
    """Add or subtract a panel computed by _square to the upper half of t.

    first, cuts
        First column (s,) and begin (s + 1,) of the runs of columns, see Batch.
    flat, width
        t as a vector, and the length of a row of t.
    """
    for run in range(len(first)):
        shift = first[run] - cuts[run]
        begin, end = max(cuts[run], low), min(cuts[run + 1], high)
        for other_run in range(run, len(first)):
            other_shift = first[other_run] - cuts[other_run]
            start, stop = max(cuts[other_run], left), min(cuts[other_run + 1], right)
            # Stored as computed, or transposed, so that the element lies in the upper half of t.
            if other_shift + cuts[other_run] >= shift + cuts[run]:
                for a in range(begin, end):
                    start = max(a, start)
                    index = np.uintp((a - low) * WIDE + start - left)
                    target = np.uintp((shift + a) * width + other_shift + start)
                    for q in range(np.uintp(max(stop - start, 0))):
                        flat[target + q] += sign * square[index + q]
            else:
                for q in range(start, stop):
                    index = q - left - low * WIDE
                    for a in range(begin, end):
                        flat[(other_shift + q) * width + shift + a] += (
                            sign * square[index + a * WIDE]
                        )


def _square(flat, first, width, rows, low, high, left, right, pack, out):
    """Compute rows low to high and columns left to right of Y'Y, on and above its diagonal.

    The rows of Y begin at index `first` and are `width` apart. `left` equals `low`, or is at least
    `high`. `out` receives WIDE elements for each row, and has one additional row.

    Six rows of Y are copied to `pack`, and two columns are multiplied at a time. Each element is
    therefore used several times after it is read. All distances are constant, so that the compiler
    can exclude overlaps of input and output. The loops cover whole groups of SIDE columns. Elements
    left of the diagonal and right of the last column are never used.
    """
    n, offset = np.uintp(right - left), 0
    whole = np.uintp((right - left + SIDE - 1) // SIDE * SIDE)
    for a in range(np.uintp(high - low)):
        for q in range(whole):
            out[a * np.uintp(WIDE) + q] = 0.0
    for row in range(0, rows, 6):
        index = first + row * width
        _pack(flat, index + left, width, rows - row, n, 0, pack)
        if left > low:
            # The left columns are packed separately if they do not begin with the right columns.
            offset = 6 * WIDE
            _pack(flat, index + low, width, rows - row, np.uintp(high - low), offset, pack)
        for a in range(low, high, 2):
            i = np.uintp(offset + a - low)
            # Two left columns a, b, each with six rows.
            a0, b0 = pack[i], pack[i + np.uintp(1)]
            a1, b1 = pack[i + np.uintp(WIDE)], pack[i + np.uintp(WIDE + 1)]
            a2, b2 = pack[i + np.uintp(2 * WIDE)], pack[i + np.uintp(2 * WIDE + 1)]
            a3, b3 = pack[i + np.uintp(3 * WIDE)], pack[i + np.uintp(3 * WIDE + 1)]
            a4, b4 = pack[i + np.uintp(4 * WIDE)], pack[i + np.uintp(4 * WIDE + 1)]
            a5, b5 = pack[i + np.uintp(5 * WIDE)], pack[i + np.uintp(5 * WIDE + 1)]
            target = np.uintp((a - low) * WIDE)
            for q in range(np.uintp(max(a - left, 0) // SIDE * SIDE), whole):
                q0, q1 = pack[q], pack[q + np.uintp(WIDE)]
                q2, q3 = pack[q + np.uintp(2 * WIDE)], pack[q + np.uintp(3 * WIDE)]
                q4, q5 = pack[q + np.uintp(4 * WIDE)], pack[q + np.uintp(5 * WIDE)]
                out[target + q] += a0 * q0 + a1 * q1 + a2 * q2 + a3 * q3 + a4 * q4 + a5 * q5
                out[target + q + np.uintp(WIDE)] += (
                    b0 * q0 + b1 * q1 + b2 * q2 + b3 * q3 + b4 * q4 + b5 * q5
                )


def _pack(flat, first, width, rows, n, target, pack):
    """Copy n elements of six rows to places WIDE apart; missing rows are zero."""
    for row in range(6):
        i, index = np.uintp(target + row * WIDE), np.uintp(first + row * width)
        if row < rows:
            for q in range(n):
                pack[i + q] = flat[index + q]
        else:
            for q in range(n):
                pack[i + q] = 0.0


def _product(flat, first, width, errors, out):
    """Compute F'e into `out`; the rows of F begin at index `first` and are `width` apart."""
    out[:] = 0.0
    for row in range(len(errors)):
        index, error = np.uintp(first + row * width), errors[row]
        for a in range(np.uintp(len(out))):
            out[a] += flat[index + a] * error


def _add_blocks(w, jac, block, place, cuts, starts, v, wide, b):
    """V += E'E, wide += F'E, b += E'w; E are the first three derivatives, F the others."""
    n, m, _ = jac.shape
    spare = starts[-1]
    for i in range(n):
        o = block[i]
        wide_start, length = 2 * starts[o], np.uintp(starts[o + 1] - starts[o])
        for row in range(0, m, 2):  # two rows: the coordinates of an image point, most of the work
            x = min(row + 1, m - 1)
            # An odd number of rows: the last row is paired with itself, with weight zero.
            pair_weight = 1.0 if x > row else 0.0
            e0, e1, e2, r = jac[i, row, 0], jac[i, row, 1], jac[i, row, 2], w[i, row]
            d0, d1, d2, s = (
                pair_weight * jac[i, x, 0],
                pair_weight * jac[i, x, 1],
                pair_weight * jac[i, x, 2],
                w[i, x],
            )
            b[o, 0] += e0 * r + d0 * s
            b[o, 1] += e1 * r + d1 * s
            b[o, 2] += e2 * r + d2 * s
            v[o, 0] += e0 * e0 + d0 * d0
            v[o, 1] += e1 * e0 + d1 * d0
            v[o, 2] += e1 * e1 + d1 * d1
            v[o, 3] += e2 * e0 + d2 * d0
            v[o, 4] += e2 * e1 + d2 * d1
            v[o, 5] += e2 * e2 + d2 * d2
            for run in range(len(cuts) - 1):
                # A fixed unknown has no place in the wide part.
                if place[i, run] == spare:
                    continue
                index = np.uintp(wide_start + place[i, run])
                for a in range(cuts[run], cuts[run + 1]):
                    f, h = jac[i, row, 3 + a], jac[i, x, 3 + a]
                    wide[index] += f * e0 + h * d0
                    wide[index + length] += f * e1 + h * d1
                    wide[index + length + length] += f * e2 + h * d2
                    index += np.uintp(1)


def _root(v, damping, smallest):
    """Cholesky factor of a block (six elements), in place; False for an undetermined block."""
    d1, d2, growth = v[2], v[5], 1.0 + damping
    q0 = v[0] * growth
    l00 = np.sqrt(q0)
    l10, l20 = v[1] / l00, v[3] / l00
    q1 = d1 * growth - l10 * l10
    # max avoids the root of a negative pivot, which the test below rejects.
    l11 = np.sqrt(max(q1, 0.0))
    l21 = (v[4] - l20 * l10) / l11
    q2 = d2 * growth - l20 * l20 - l21 * l21
    # Pivots relative to their diagonal element; NaN also fails.
    if not (q0 > 0.0 and q1 > smallest * d1 and q2 > smallest * d2):
        return False
    v[0], v[1], v[2], v[3], v[4], v[5] = l00, l10, l11, l20, l21, np.sqrt(q2)
    return True


def _forward(v, b, o, wide, first, n, right):
    """Forward substitution of block o: b becomes y and its wide part Y; `right` (n,) gains Y y.

    The wide part has 3 n elements from index `first`.
    """
    l10, l20, l21 = v[o, 1], v[o, 3], v[o, 4]
    i0, i1, i2 = 1.0 / v[o, 0], 1.0 / v[o, 2], 1.0 / v[o, 5]
    b0 = b[o, 0] * i0
    b1 = (b[o, 1] - l10 * b0) * i1
    b2 = (b[o, 2] - l20 * b0 - l21 * b1) * i2
    b[o, 0], b[o, 1], b[o, 2] = b0, b1, b2
    row0 = np.uintp(first)
    row1, row2 = row0 + np.uintp(n), row0 + np.uintp(2 * n)
    for a in range(np.uintp(n)):
        y0 = wide[row0 + a] * i0
        y1 = (wide[row1 + a] - l10 * y0) * i1
        y2 = (wide[row2 + a] - l20 * y0 - l21 * y1) * i2
        wide[row0 + a], wide[row1 + a], wide[row2 + a] = y0, y1, y2
        right[a] += y0 * b0 + y1 * b1 + y2 * b2


def _eliminate(v, wide, b, starts, columns, runs, ends, alike, t, g, damping, smallest):
    """Eliminate all blocks; return the index of the first undetermined block, or -1.

    Blocks alike[k] to alike[k + 1] have equal columns, so that a single product subtracts them from
    t.
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
        # Runs of neighbouring columns, relative to the first column of the block.
        edges = ends[runs[begin] : runs[begin + 1] + 1]
        for run in range(len(edges) - 1):
            heads[run] = columns[edges[run]]
        for run in range(len(edges)):
            cuts[run] = edges[run] - first
        first_columns, run_cuts = heads[: len(edges) - 1], cuts[: len(edges)]
        rows = 3 * (end - begin)
        # S - Y Y'.
        _add_square(
            -1.0, wide, 3 * first, n, rows, first_columns, run_cuts, pack, square, flat, len(g)
        )
        # g - Y y.
        for a in range(n):
            g[columns[first + a]] -= right[a]
    return -1


def _sizes(starts, alike):
    """Largest number of columns of a block, and largest number of blocks of a series."""
    longest, most = 0, 0
    for k in range(len(alike) - 1):
        longest = max(longest, starts[alike[k] + 1] - starts[alike[k]])
        most = max(most, alike[k + 1] - alike[k])
    return longest, most


def _back(v, wide, b, starts, columns, alike, reduced, out):
    """Compute L^-T (b + Y' reduced) of each block into out (nb, 3)."""
    store = np.empty(_sizes(starts, alike)[0])
    for k in range(len(alike) - 1):
        first = starts[alike[k]]
        n = starts[alike[k] + 1] - first
        local_step = store[:n]
        # The blocks of a series share their columns, so that the step is collected once.
        for a in range(n):
            local_step[a] = reduced[columns[first + a]]
        for o in range(alike[k], alike[k + 1]):
            index, length = np.uintp(3 * starts[o]), np.uintp(n)
            x0, x1, x2 = b[o, 0], b[o, 1], b[o, 2]
            for a in range(length):
                x0 += wide[index + a] * local_step[a]
                x1 += wide[index + length + a] * local_step[a]
                x2 += wide[index + length + length + a] * local_step[a]
            # Back substitution with L', from the last unknown to the first.
            x2 = x2 / v[o, 5]
            x1 = (x1 - v[o, 4] * x2) / v[o, 2]
            x0 = (x0 - v[o, 1] * x1 - v[o, 3] * x2) / v[o, 0]
            out[o, 0], out[o, 1], out[o, 2] = x0, x1, x2


def _inverse_root(v, root):
    """Compute L^-1 of a block into the lower half of root (3, 3)."""
    root[0, 0], root[1, 1], root[2, 2] = 1.0 / v[0], 1.0 / v[2], 1.0 / v[5]
    root[1, 0], root[2, 1] = -v[1] * root[0, 0] * root[1, 1], -v[4] * root[1, 1] * root[2, 2]
    root[2, 0] = -(v[3] * root[0, 0] + v[4] * root[1, 0]) * root[2, 2]


def _through(v, wide, starts, columns, unknowns, reduced, out):
    """Compute d unknown / d reduced of unknowns (k,) into out (k, nr), which is initially zero."""
    root = np.zeros((3, 3))
    for i in range(len(unknowns)):
        if unknowns[i] < reduced:
            out[i, unknowns[i]] = 1.0
            continue
        o, axis = divmod(unknowns[i] - reduced, 3)
        _inverse_root(v[o], root)
        # Column of L^-1: the unknown is -(L^-T Y') times the reduced unknowns.
        r0, r1, r2 = root[0, axis], root[1, axis], root[2, axis]
        first, n = starts[o], starts[o + 1] - starts[o]
        for a in range(n):
            index = 3 * first + a
            change = r0 * wide[index] + r1 * wide[index + n] + r2 * wide[index + 2 * n]
            out[i, columns[first + a]] = -change


def _add_own(v, block, axis, places, q):
    """Add V^-1 between unknowns (k,), sorted by block, at their places in q."""
    root = np.zeros((3, 3))
    for i in range(len(block)):
        _inverse_root(v[block[i]], root)
        j = i
        while j < len(block) and block[j] == block[i]:
            value = 0.0
            # V^-1 = L^-T L^-1.
            for e in range(3):
                value += root[e, axis[i]] * root[e, axis[j]]
            q[places[i], places[j]] += value
            if j > i:
                q[places[j], places[i]] += value
            j += 1


def _among(inverse, columns, runs, first, q):
    """Copy the part q (n, n) of a matrix for columns (n,), given in runs of neighbours."""
    for a in range(len(columns)):
        line = inverse[columns[a]]
        for run in range(len(runs) - 1):
            target, source = runs[run] - first, columns[runs[run] - first]
            for step in range(runs[run + 1] - runs[run]):
                q[a, target + step] = line[source + step]


def _cofactors(v, wide, starts, columns, runs, ends, alike, inverse, cross, out):
    """Cofactors of the blocks, with Z = Y L^-1 and Q = `inverse`.

    -Q Z is written to `cross`, L^-T L^-1 + Z'Q Z to `out`.
    """
    longest, most = _sizes(starts, alike)
    square, root = np.empty(longest * longest), np.zeros((3, 3))
    z_store, x_store = np.empty(3 * most * longest), np.empty(3 * most * longest)
    for k in range(len(alike) - 1):
        begin, end, first = alike[k], alike[k + 1], starts[alike[k]]
        n, rows = starts[begin + 1] - first, 3 * (end - begin)
        q = square[: n * n].reshape((n, n))
        z, x = z_store[: rows * n].reshape((rows, n)), x_store[: rows * n].reshape((rows, n))
        edges = ends[runs[begin] : runs[begin + 1] + 1]
        _among(inverse, columns[first : first + n], edges, first, q)
        # Z' of all blocks of the series, so that a single product with Q is sufficient.
        for o in range(begin, end):
            _inverse_root(v[o], root)
            i, index = 3 * (o - begin), 3 * starts[o]
            for a in range(n):
                y0, y1, y2 = wide[index + a], wide[index + n + a], wide[index + 2 * n + a]
                z[i, a] = root[0, 0] * y0 + root[1, 0] * y1 + root[2, 0] * y2
                z[i + 1, a] = root[1, 1] * y1 + root[2, 1] * y2
                z[i + 2, a] = root[2, 2] * y2
        np.dot(z, q, x)
        for o in range(begin, end):
            _inverse_root(v[o], root)
            i = 3 * (o - begin)
            _own_cofactors(root, z[i : i + 3], x[i : i + 3], cross[starts[o] :], out[o])


def _own_cofactors(root, z, x, cross, out):
    """Write the results of _cofactors for one block; z and x (3, n) are Z' and Z'Q."""
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
    """Compute the leverage J Q J' of each row (n, m) into `out`, by runs of columns."""
    n, m, _ = jac.shape
    runs = len(cuts) - 1
    for i in range(n):
        q = cofactors[block[i]]
        for row in range(m):
            e0, e1, e2 = jac[i, row, 0], jac[i, row, 1], jac[i, row, 2]
            # E Q_bb E'.
            total = (
                e0 * e0 * q[0, 0] + e1 * e1 * q[1, 1] + e2 * e2 * q[2, 2]
                + 2.0 * (e0 * e1 * q[0, 1] + e0 * e2 * q[0, 2] + e1 * e2 * q[1, 2])
            )  # fmt: skip
            for run in range(runs):
                if first[i, run] == spare:
                    continue
                for a in range(cuts[run], cuts[run + 1]):
                    f, step = jac[i, row, 3 + a], a - cuts[run]
                    line, x = cross[place[i, run] + step], inverse[first[i, run] + step]
                    # F Q_rr F' by symmetry: half the diagonal and the products right of it, then
                    # twice.
                    half = 0.5 * f * x[first[i, run] + step]
                    # E Q_br F'.
                    half += e0 * line[0] + e1 * line[1] + e2 * line[2]
                    for other_run in range(run, runs):
                        if first[i, other_run] == spare:
                            continue
                        shift = first[i, other_run] - cuts[other_run]
                        for c in range(max(a + 1, cuts[other_run]), cuts[other_run + 1]):
                            half += jac[i, row, 3 + c] * x[shift + c]
                    total += 2.0 * f * half
            out[i, row] = total
