"""Checks of the heights of a table: readable, equal steps, missing, doubled or misplaced rows."""

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from tankcal.messages import message

FEWEST_ROWS = 3
_EXACT = 1e-6  # tolerance of exact heights, relative to a step
_SHORTEST_ZONE = 3  # fewest equal steps of a zone
_MOST_MISPLACED = 100  # largest number of rows out of order that are reported separately


@dataclass(frozen=True)
class Series:
    """The rows of a table in the order of rising volumes.

    Attributes
    ----------
    entries : list of Entry
        Entries of the table, without doubled rows.
    height : ndarray, shape (rows,)
        Strictly rising, in the unit of the table, with corrections applied.
    direction : int
        1, or -1 for ullages with changed sign.
    step : float
        Usual step.
    rounding : ndarray, shape (rows,)
        Largest rounding error of each height; 0 if the steps are even.
    """

    entries: tuple
    height: np.ndarray
    direction: int
    step: float
    rounding: np.ndarray


def check_heights(table, log, even_steps=True):
    """Return the `Series` of a table; None after reporting to `log` that it has too few rows.

    even_steps False: the rows are breakpoints, so that uneven steps do not show missing rows.
    """
    entries = [entry for entry in table.entries if _is_readable(table, entry, log)]
    if len(entries) < FEWEST_ROWS:
        expected = message(
            "lint_few_rows",
            "{count} rows of heights and volumes; expected {fewest} or more",
            count=len(entries),
            fewest=FEWEST_ROWS,
        )
        log.problem(table.name, expected)
        return None
    volumes = [entry.volume.value for entry in entries if entry.volume.value is not None]
    if _trend(volumes) < 0:
        entries.reverse()
    direction = _trend([entry.height.value for entry in entries])
    height = direction * np.array([entry.height.value for entry in entries])
    if table.has_heading and table.is_ullage != (direction < 0):
        expected = message(
            "lint_heights_fall", "heights fall while volumes rise; expected the other way round"
        )
        if table.is_ullage:
            expected = message(
                "lint_ullages_rise", "ullages rise while volumes rise; expected the other way round"
            )
        log.problem(table.name, expected)
    step, tolerance = _usual_step(height, entries)
    if step is None:
        log.problem(
            table.name,
            message("lint_no_rise", "the heights do not rise; expected rising heights, row by row"),
        )
        return None
    reporter = _HeightReporter(table, entries, height, direction, log)
    height, keep = _correct_order(reporter, step, tolerance)
    order = _sort_rows(height, np.flatnonzero(keep), tolerance)
    entries, height = [entries[k] for k in order], height[order]
    if len(entries) < FEWEST_ROWS:
        log.problem(
            table.name,
            message(
                "lint_few_rising",
                "{count} heights that rise; expected {fewest} or more",
                count=len(entries),
                fewest=FEWEST_ROWS,
            ),
        )
        return None
    reporter = _HeightReporter(table, entries, height, direction, log)
    if even_steps:
        height = _even_steps(reporter, step, tolerance)
    rounding = _rounding(entries, height, tolerance)
    return Series(tuple(entries), height, direction, step, rounding)


def _is_readable(table, entry, log):
    """Whether an entry has a height; an unreadable height is reported."""
    reading = entry.height
    if reading.value is None and reading.complaint:
        log.problem(table.name, reading.complaint, entry.row, entry.height_column)
    return reading.value is not None


def _trend(values):
    """Return 1 if most values rise, -1 if most fall."""
    steps = np.sign(np.diff(values))
    return 1 if steps.sum() >= 0 else -1


def _usual_step(height, entries):
    """Return (usual step, tolerance of steps); heights may be rounded multiples of a step."""
    steps = np.diff(height)
    rising = steps[steps > 0]
    if len(rising) == 0:
        return None, 0.0
    usual = float(np.median(rising))
    exact = np.abs(rising - usual) < _EXACT * usual
    if exact.mean() > 0.7 or all(entry.height.decimals > 8 for entry in entries):
        return usual, max(_EXACT * usual, 1e-12 * float(np.abs(height).max()))
    quantum = 10.0 ** -max(entry.height.decimals for entry in entries)
    near = rising[np.abs(rising - usual) <= 1.01 * quantum]
    if len(near) > 0.7 * len(rising) and quantum < 0.5 * usual:
        return float(near.mean()), 1.01 * quantum
    return usual, _EXACT * usual


class _HeightReporter:
    """Reports problems of heights, with the heights and rows of the file."""

    def __init__(self, table, entries, height, direction, log):
        self.table, self.entries, self.log = table, entries, log
        self.height, self.direction = height, direction

    def shown(self, height):
        """Text of a height, with the sign of the file."""
        return f"{self.direction * height:.9g}"

    def row(self, k):
        """Row number in the file."""
        return self.entries[k].row

    def problem(self, k, text):
        """Report a problem of a height."""
        entry = self.entries[k]
        self.log.problem(self.table.name, text, entry.row, entry.height_column)


def _correct_order(reporter, step, tolerance):
    """Return (heights, mask of kept rows); rows that break the order are reported and corrected."""
    height = reporter.height.copy()
    keep = np.ones(len(height), dtype=bool)
    chain = _longest_rise(height)
    misplaced = sorted(set(range(len(height))) - set(chain))
    if len(misplaced) > _MOST_MISPLACED:
        keep[misplaced] = False
        expected = message(
            "lint_many_astray",
            "{count} of {all} heights are out of order; expected heights that rise row by row",
            count=len(misplaced),
            all=len(height),
        )
        reporter.problem(misplaced[0], expected)
        return height, keep
    expected = {k: _interpolate_height(k, chain, height, step, tolerance) for k in misplaced}
    done = set()
    for k in misplaced:
        if k in done:
            continue
        partner = _find_partner(k, misplaced, expected, height, tolerance)
        twin = _find_twin(height[k], chain, reporter.height, tolerance)
        shown = reporter.shown(height[k])
        if partner is not None:
            done.add(partner)
            reporter.problem(k, _swap_message(reporter, height, k, k, partner))
        elif twin is not None and expected[k] is None:
            keep[k] = False
            _report_twin(reporter, k, twin)
        elif expected[k] is not None:
            reporter.problem(k, _expectation(shown, reporter.shown(expected[k])))
            height[k] = expected[k]
        else:
            _report_misplaced(reporter, k, height)
    return height, keep


def _sort_rows(height, rows, tolerance):
    """Return the rows sorted by height; of rows corrected to equal heights, keep the first."""
    order = sorted(rows, key=lambda k: height[k])
    return [
        k for n, k in enumerate(order) if n == 0 or height[k] - height[order[n - 1]] > tolerance
    ]


def _longest_rise(height):
    """Indices of the longest strictly rising subsequence."""
    ends, tails, before = [], [], np.full(len(height), -1)
    for k, value in enumerate(height):
        place = bisect_left(tails, value)
        if place:
            before[k] = ends[place - 1]
        if place == len(tails):
            tails.append(value)
            ends.append(k)
        else:
            tails[place], ends[place] = value, k
    chain, k = [], ends[-1]
    while k >= 0:
        chain.append(int(k))
        k = before[k]
    return chain[::-1]


def _interpolate_height(k, chain, height, step, tolerance):
    """Height that a misplaced row should have at its position; None if no row is missing there."""
    place = bisect_left(chain, k)
    left = chain[place - 1] if place else None
    right = chain[place] if place < len(chain) else None
    if left is None:
        return height[right] - step if k == right - 1 else None
    if right is None:
        return None
    between = right - left
    if abs(height[right] - height[left] - between * step) <= between * tolerance:
        return height[left] + (k - left) * step
    return None


def _find_twin(value, chain, height, tolerance):
    """Return the row in order with a given height, or None."""
    place = bisect_left(chain, value - tolerance, key=lambda c: height[c])
    is_twin = place < len(chain) and abs(height[chain[place]] - value) <= tolerance
    return chain[place] if is_twin else None


def _find_partner(k, misplaced, expected, height, tolerance):
    """Return the misplaced row with which this row is swapped, or None."""
    for candidate in misplaced:
        if candidate > k and expected[k] is not None and expected[candidate] is not None:
            here = abs(expected[k] - height[candidate]) <= tolerance
            is_expected = abs(expected[candidate] - height[k]) <= tolerance
            if here and is_expected:
                return candidate
    return None


def _report_twin(reporter, k, twin):
    """Report a row whose height is also in another row."""
    first, second = reporter.entries[twin].volume, reporter.entries[k].volume
    text = message(
        "lint_height_twice",
        "height {height} is also in row {row}",
        height=reporter.shown(reporter.height[k]),
        row=reporter.row(twin),
    )
    if first.value == second.value:
        reporter.problem(
            k, message("lint_row_twice", "{found}: the row is given twice", found=text)
        )
        return
    expected = message(
        "lint_two_volumes",
        "{found}, with volume {there}, here {here}",
        found=text,
        there=first.text,
        here=second.text or message("lint_none", "none"),
    )
    reporter.problem(k, expected)


def _expectation(text, expected):
    """Message with the expected height."""
    return message(
        "lint_rather", "found {found}; expected {expected}", found=text, expected=expected
    )


def _swap_message(reporter, height, k, first_row, second_row):
    """Message about two swapped rows."""
    return message(
        "lint_rows_swapped",
        "found {found}; rows {row} and {other_row} are swapped",
        found=reporter.shown(height[k]),
        row=reporter.row(first_row),
        other_row=reporter.row(second_row),
    )


def _report_misplaced(reporter, k, height):
    """Report a row out of order: swapped with a neighbour, or without an explanation."""
    neighbours = [n for n in (k - 1, k + 1) if 0 <= n < len(height)]
    for n in neighbours:
        swapped = height.copy()
        swapped[[k, n]] = swapped[[n, k]]
        around = swapped[max(min(k, n) - 1, 0) : max(k, n) + 2]
        if np.all(np.diff(around) > 0):
            low, high = sorted((k, n))
            reporter.problem(low, _swap_message(reporter, height, low, low, high))
            return
    expected = message(
        "lint_astray",
        "found {found}; expected heights that rise row by row",
        found=reporter.shown(height[k]),
    )
    reporter.problem(k, expected)


def _even_steps(reporter, step, tolerance):
    """Return heights with single odd ones corrected; missing rows are reported."""
    height = reporter.height.copy()
    for k in range(1, len(height) - 1):
        low, high = height[k] - height[k - 1], height[k + 1] - height[k]
        is_odd = abs(low - step) > tolerance and abs(high - step) > tolerance
        before = k < 2 or abs(height[k - 1] - height[k - 2] - step) <= tolerance
        after = k + 2 >= len(height) or abs(height[k + 2] - height[k + 1] - step) <= tolerance
        if is_odd and before and after and abs(low + high - 2 * step) <= 2 * tolerance:
            expected = height[k - 1] + step
            reporter.problem(k, _expectation(reporter.shown(height[k]), reporter.shown(expected)))
            height[k] = expected
    _report_gaps(reporter, height, tolerance)
    return height


def _report_gaps(reporter, height, tolerance):
    """Report steps that are larger than the steps around: missing rows or an odd step."""
    steps = np.diff(height)
    zone = _zone_steps(steps, tolerance)
    last = len(steps) - 1
    for k in np.flatnonzero(np.isnan(zone)):
        nearest = _nearest_zone(zone, k, -1), _nearest_zone(zone, k, 1)
        around = [zone[n] for n in nearest if n is not None]
        if not around:
            continue
        is_same = abs(around[0] - around[-1]) <= tolerance
        largest = max(around)
        is_odd = steps[k] > largest + tolerance
        if k not in (0, last) and is_same:
            is_odd = True
        if not is_odd:
            continue
        missing = round(steps[k] / largest) - 1
        fits = missing > 0 and abs(steps[k] - (missing + 1) * largest) <= 2 * tolerance
        order = message(
            "lint_follows",
            "{after} follows {before}",
            after=reporter.shown(height[k + 1]),
            before=reporter.shown(height[k]),
        )
        if fits or k == last:
            count = max(missing, 1)
            rows = message("lint_a_row_missing", "a row is missing")
            if count > 1:
                rows = message("lint_rows_missing", "{count} rows are missing", count=count)
            expected = message(
                "lint_next",
                "{next} next: {rows}",
                next=reporter.shown(height[k] + largest),
                rows=rows,
            )
        else:
            expected = message(
                "lint_a_step", "a step of {step}, as in the other rows", step=f"{largest:.9g}"
            )
        text = message(
            "lint_gap", "found that {found}; expected {expected}", found=order, expected=expected
        )
        reporter.problem(k + 1, text)


def _rounding(entries, height, tolerance):
    """Half of the last decimal, shape (rows,), of heights outside runs of even steps; 0 inside.

    The last row, the top of the tank, may be rounded to its position in such a run.
    """
    is_even = ~np.isnan(_zone_steps(np.diff(height), tolerance))
    is_exact = np.append(is_even, False) | np.append(False, is_even)
    half = np.array([0.5 * 10.0**-entry.height.decimals for entry in entries])
    if tolerance > 0.5 * half.max():  # the step is not a whole number of last decimals
        return half
    is_exact[-1] &= 10.0 ** -entries[-1].height.decimals > 0.05 * np.diff(height).min()
    return np.where(is_exact, 0.0, half)


def _zone_steps(steps, tolerance):
    """Step (steps,) of the zone of each step; nan for single odd steps.

    A zone has at least three equal steps, or one in a shorter table.
    """
    zone = np.full(len(steps), np.nan)
    start = 0
    for k in range(1, len(steps) + 1):
        if k == len(steps) or abs(steps[k] - steps[k - 1]) > tolerance:
            if k - start >= min(_SHORTEST_ZONE, len(steps) // 2):
                zone[start:k] = steps[start:k].mean()
            start = k
    return zone


def _nearest_zone(zone, k, direction):
    """Index of the nearest step of a zone in a direction (-1 or 1), or None."""
    while 0 <= k < len(zone):
        if not np.isnan(zone[k]):
            return k
        k += direction
    return None
