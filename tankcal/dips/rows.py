"""Rows of a table: their heights, their rounding, and the parts for the digits between them.

Dips are metres above the table's zero. Every row is computed from its own number, n * step, and
rounded from its own exact volume: nothing is added up row by row.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError, InputError, Problem

MOST_ROWS = 25_000
_PER_METRE = 1_000_000_000  # steps and rows are whole nanometres, so that rows are exact decimals
_LAST_STEP_M = 1e-6


def table_heights(step_m, top_m, fine_step_m=None, fine_zones=()):
    """(rows,) dips at 0, step, 2 step, ... and the top itself, m; each once, ascending.

    step_m       row n is the number nearest to n * step
    top_m        last row; a last step under a micron is dropped
    fine_step_m  step of the rows from the one at or below `low` to the one at or above `high` of
                 each (low_m, high_m) of `fine_zones`; a whole part of step_m
    Raises InputError for steps that do not fit, and for more than MOST_ROWS rows; HeightError for
    a zone outside the table.
    """
    _check_steps(step_m, top_m, fine_step_m, fine_zones)
    pieces = [_multiples(step_m, 0, int(np.floor(top_m / step_m + 1e-9)))]
    for low_m, high_m in fine_zones:
        first = int(np.floor(low_m / fine_step_m + 1e-9))
        last = int(np.ceil(min(high_m, top_m) / fine_step_m - 1e-9))
        pieces.append(_multiples(fine_step_m, first, last))
    heights = np.unique(np.concatenate(pieces))
    heights = heights[heights <= top_m + 2e-9 * step_m]
    if top_m - heights[-1] > _LAST_STEP_M:
        heights = np.append(heights, top_m)
    else:
        heights[-1] = min(heights[-1], top_m)
    return heights


def _multiples(step_m, first, last):
    """first * step, ..., last * step, each the nearest number to the exact product."""
    numbers = np.arange(first, last + 1, dtype=float)
    step = step_m * _PER_METRE
    if abs(step - round(step)) < 1e-3:
        return numbers * round(step) / _PER_METRE  # exact integer product, one rounding
    return np.round(numbers * step_m, 9)


def _check_steps(step_m, top_m, fine_step_m, fine_zones):
    if not step_m > 0 or not top_m > 0:
        raise InputError(
            Problem("table", f"step {step_m:g} m, top {top_m:g} m; expected above 0", None, "step")
        )
    count = top_m / step_m
    if fine_zones:
        ratio = step_m / (fine_step_m or np.inf)
        if not ratio > 1.5 or abs(ratio - round(ratio)) > 1e-6:
            found = "no fine step" if fine_step_m is None else f"{fine_step_m:g} m"
            raise InputError(
                Problem(
                    "table",
                    f"{found}; expected a whole part of the step of {step_m:g} m",
                    None,
                    "fine_step_m",
                )
            )
        for low_m, high_m in fine_zones:
            if not 0 <= low_m < high_m or low_m >= top_m:
                raise HeightError(
                    f"fine zone {low_m:g} to {high_m:g} m is outside the table (0 to {top_m:g} m)"
                )
            count += (min(high_m, top_m) - low_m) / fine_step_m
    if count > MOST_ROWS:
        raise InputError(
            Problem("table", f"{count:.0f} rows, expected at most {MOST_ROWS}", None, "step_m")
        )


def rounded(values, decimals):
    """(rows,) each value rounded by itself, once, to the nearest decimal (a tie to the even one).

    Correct for the number as stored: 2.675, which is stored a little below, gives 2.67.
    """
    return np.array([round(float(value), decimals) for value in values])


@dataclass(frozen=True)
class ProportionalParts:
    """Mean volumes of 1, 2, ... parts of a step between two heights (a course), and their price.

    part_m3       (parts - 1,) to be added to the row below a dip
    deviation_m3  largest, by size, of (row + part - exact volume), with its sign
    at_m          the dip where it is
    """

    bottom_m: float
    top_m: float
    part_m3: np.ndarray
    deviation_m3: float
    at_m: float


def proportional_parts(volume_m3, edges_m, row_step_m=0.01, parts=10):
    """Tuple of `ProportionalParts`, one for each stretch between neighbouring edges.

    part j = j / parts * row_step * (V(top) - V(bottom)) / (top - bottom)

    volume_m3   function of (n,) dips, m, to (n,) volumes, m3
    edges_m     (k + 1,) dips of bottom, joints and top, ascending
    row_step_m  of the table; parts  of a step (10: millimetres of a cm table, 8: eighths of inches)
    The deviation is taken at every mark between rows of the stretch, against the exact volume.
    Raises HeightError for edges that do not ascend from 0 or higher.
    """
    edges = np.asarray(edges_m, dtype=float)
    if len(edges) < 2 or edges[0] < 0 or not np.all(np.diff(edges) > 0):
        raise HeightError(f"edges of courses {edges.tolist()}: expected ascending, from 0")
    at_edges = volume_m3(edges)
    return tuple(
        _parts_of_stretch(volume_m3, edges[i : i + 2], at_edges[i : i + 2], row_step_m, parts)
        for i in range(len(edges) - 1)
    )


def _parts_of_stretch(volume_m3, edges, at_edges, row_step_m, parts):
    mark_m = row_step_m / parts
    mean_m3 = mark_m * np.diff(at_edges)[0] / np.diff(edges)[0]
    first, last = int(np.ceil(edges[0] / mark_m - 1e-9)), int(np.floor(edges[1] / mark_m + 1e-9))
    number = np.arange(first, last + 1)
    marks = np.clip(_multiples(mark_m, first, last), *edges)
    rows = _multiples(row_step_m, 0, last // parts)[number // parts]
    deviation = volume_m3(rows) + (number % parts) * mean_m3 - volume_m3(marks)
    deviation = np.where(number % parts == 0, 0.0, deviation)
    worst = int(np.argmax(np.abs(deviation))) if len(number) else None
    return ProportionalParts(
        bottom_m=float(edges[0]),
        top_m=float(edges[1]),
        part_m3=np.arange(1, parts) * mean_m3,
        deviation_m3=0.0 if worst is None else float(deviation[worst]),
        at_m=float(edges[0] if worst is None else marks[worst]),
    )
