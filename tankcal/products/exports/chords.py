"""Loops over the chords of a table: rows at which a straight line from a row may end.

A chord from row i is within eps of every row k that it passes if its slope lies between the
largest of (V_k - eps - W_i) / (h_k - g_i) and the smallest of (V_k + eps - W_i) / (h_k - g_i). One
pass from i tests the chords to all rows, until the range of slopes is empty. (g, W) are the rows as
written, (h, V) those of the table.

The code is plain Python; `tankcal.products.exports.breakpoints` compiles it for large tables.
"""

COMPILED = ("fewest_chords", "longest_chords", "largest_error")
NEVER = 1 << 30  # number of chords to an unreachable row, above any number of rows
FAR = float("inf")


def fewest_chords(height, volume, at, written, last, is_open, eps, most, fewest, before):
    """Compute the fewest chords within eps to each row, and the row before it, in place.

    Parameters
    ----------
    height, volume : (rows,)
        The table.
    at, written : (rows,)
        Heights and volumes as written.
    last : (rows,)
        Last row at which a chord from each row may end: the next required row.
    is_open : (rows,)
        Whether a chord may begin or end at the row.
    eps : float
        Largest permitted error.
    most : int
        Largest number of chords.
    fewest, before : (rows,)
        Results; NEVER and -1 initially.
    """
    count = len(height)
    fewest[0] = 0
    for i in range(count - 1):
        if not is_open[i] or fewest[i] >= most:
            continue
        low, high = -FAR, FAR
        here, start, chords = at[i], written[i], fewest[i] + 1
        for k in range(i + 1, last[i] + 1):
            if is_open[k] and chords < fewest[k]:
                slope = (written[k] - start) / (at[k] - here)
                if low <= slope and slope <= high:
                    fewest[k] = chords
                    before[k] = i
            run = height[k] - here
            if run > 0.0:
                inverse = 1.0 / run
                rise, half = (volume[k] - start) * inverse, eps * inverse
                if rise - half > low:
                    low = rise - half
                if rise + half < high:
                    high = rise + half
                if low > high:
                    break


def longest_chords(height, volume, at, written, last, is_open, eps, rows):
    """Return the number of rows on the path of longest chords within eps; 0 if there is none.

    rows (rows,) receives the rows of the path.
    """
    count = len(height)
    rows[0] = 0
    size, i = 1, 0
    while i < count - 1:
        low, high = -FAR, FAR
        here, start, best = at[i], written[i], -1
        for k in range(i + 1, last[i] + 1):
            if is_open[k]:
                slope = (written[k] - start) / (at[k] - here)
                if low <= slope and slope <= high:
                    best = k
            run = height[k] - here
            if run > 0.0:
                inverse = 1.0 / run
                rise, half = (volume[k] - start) * inverse, eps * inverse
                if rise - half > low:
                    low = rise - half
                if rise + half < high:
                    high = rise + half
                if low > high:
                    break
        if best < 0:
            return 0
        i = best
        rows[size] = i
        size += 1
    return size


def largest_error(height, volume, at, written, rows):
    """Largest distance of the chords through the given rows from the rows that they pass.

    Parameters
    ----------
    height, volume : (rows,)
        The table.
    at, written : (rows,)
        Heights and volumes as written.
    rows : sequence of int
        Rows of the chords.
    """
    largest = 0.0
    for n in range(len(rows) - 1):
        i, j = rows[n], rows[n + 1]
        slope = (written[j] - written[i]) / (at[j] - at[i])
        for k in range(i + 1, j):
            error = abs(written[i] + slope * (height[k] - at[i]) - volume[k])
            largest = max(largest, error)
    return largest
