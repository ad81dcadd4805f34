"""Loops over the chords of a table: which rows a straight line from a row may end at.

A chord from row i is within eps of every row k that it passes when its slope lies between the
largest of (V_k - eps - W_i) / (h_k - g_i) and the smallest of (V_k + eps - W_i) / (h_k - g_i): one
walk from i judges the chords to all rows, until no slope is left. (g, W) are the rows as written,
(h, V) as they are.

Plain Python here; `tankcal.exports.breakpoints` has them compiled where there is enough to do.
"""

COMPILED = ("fewest_chords", "longest_chords", "largest_error")
NEVER = 1 << 30  # more chords than any table has rows
FAR = float("inf")


def fewest_chords(height, volume, at, written, last, is_open, eps, most, fewest, before):
    """Fill in the fewest chords to each row, and the row before it, of chords within eps.

    height, volume  (rows,) of the table         at, written  (rows,) the same as they are written
    last            (rows,) row that a chord from each may end at: the next one that has to stand
    is_open         (rows,) whether a chord may begin or end there
    most            chords; longer ways are not followed
    fewest, before  (rows,) what is filled in: NEVER and -1 at first
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
    """How many rows the way of the longest chords within eps has; 0: none leads on.

    rows  (rows,) where its rows are filled in
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
    """The largest distance of the chords through these rows from the rows that they pass."""
    largest = 0.0
    for n in range(len(rows) - 1):
        i, j = rows[n], rows[n + 1]
        slope = (written[j] - written[i]) / (at[j] - at[i])
        for k in range(i + 1, j):
            error = abs(written[i] + slope * (height[k] - at[i]) - volume[k])
            largest = max(largest, error)
    return largest
