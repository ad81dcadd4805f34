"""Computed rows of a table whose other rows are proportional parts.

Old tables were computed every decimetre; linear interpolation gave the centimetres. Interpolated
rows contain no information on the shell. A seam or deadwood between computed rows looks like
several kinks. So only the computed rows are used.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.recalibration.table_fit import Rows, try_fit

USUAL_STEPS_M = (  # steps of computed rows; longer ones give too few rows per course
    0.2, 0.1524, 0.1, 0.0762, 0.0508, 0.05, 0.0254, 0.02, 0.0127, 0.01, 0.005
)  # fmt: skip
FEWEST_STEPS = 8  # fewest steps between computed rows
LEAST_PART = 0.75  # smallest share of rows; rows of the bottom may be computed row by row
FEWEST_PARTS = 5  # fewest rows of a step; in shorter steps, exact rows look linear
FEWEST_UNEVEN = 30  # fewest uneven steps that prove interpolation
# Largest distance from a chord, in last digits: chords of printed and of exact volumes.
INTERPOLATED, LINEAR = 0.5, 1.0
ROUNDING = 1e-6
LEAST_GAIN = 25.0  # smallest reduction of chi2 by interpolation


@dataclass(frozen=True)
class ComputedRows:
    """Rows of a table that may have been computed, while the other rows are linear between them.

    Attributes
    ----------
    rows : (n,) ndarray of int
        Numbers of the computed rows, from the bottom up.
    lowest : int
        Number of the row above which the other rows are linear.
    step_m : float
        Step between computed rows.
    is_certain : bool
        Whether rounding proves that the other rows were interpolated between printed volumes.
    """

    rows: np.ndarray
    lowest: int
    step_m: float
    is_certain: bool

    def table(self, former):
        """Return the FormerTable of these rows."""
        optional = {
            name: None if getattr(former, name) is None else getattr(former, name)[self.rows]
            for name in ("U_m3", "factor_m3", "height_rounding_m", "row")
        }
        return replace(
            former,
            height_m=former.height_m[self.rows],
            volume_m3=former.volume_m3[self.rows],
            **optional,
        )

    def is_confirmed(self, former, state, sd_m3):
        """Whether interpolation explains the rows better than a `State` at each row does.

        Parameters
        ----------
        former : FormerTable
        state : State
            State estimated from the computed rows.
        sd_m3 : (rows,) ndarray
            Standard deviations of all rows, by rounding.
        """
        if self.is_certain:
            return True
        dips = former.height_m
        lowest = max(state.lowest_m, dips[self.lowest])
        between = (dips >= lowest) & (dips <= dips[self.rows[-1]])
        linear = np.interp(dips, dips[self.rows], state.volume_m3(dips)[self.rows])
        by_parts = float(np.sum(((former.volume_m3 - linear) / sd_m3)[between] ** 2))
        # Computed rows may locate seams and zero poorly, so all rows estimate them again.
        exact = try_fit(Rows(dips, former.volume_m3, sd_m3).select(between), state)
        return exact is not None and exact.chi2 - by_parts > LEAST_GAIN


def find_computed_rows(former):
    """Return the ComputedRows of the longest step with linear rows in between, or None."""
    dips, quantum = former.height_m, former.volume_quantum_m3
    steps = np.diff(dips)
    step = float(np.median(steps))
    count = len(dips) if abs(steps[-1] - step) < ROUNDING else len(dips) - 1  # the top is uneven
    if quantum <= 0 or np.any(np.abs(steps[: count - 1] - step) > ROUNDING):
        return None
    volumes = former.volume_m3[:count] / quantum
    candidates = []
    for long_step in USUAL_STEPS_M:
        parts = round(long_step / step)
        is_multiple = abs(parts * step - long_step) < ROUNDING
        if not is_multiple or not FEWEST_PARTS <= parts <= count // FEWEST_STEPS:
            continue
        first = _first_linear_row(volumes, parts)
        if first is not None:
            rows = np.arange(first % parts, count, parts)
            is_certain = _is_interpolated(volumes, first, parts)
            candidates.append(ComputedRows(rows, first, long_step, is_certain))
    return max(
        candidates, key=lambda candidate: (candidate.is_certain, candidate.step_m), default=None
    )


def _first_linear_row(volumes, parts):
    """Lowest computed row above which the rows in between are linear, or None.

    The middle of each step is first compared with its chord, for all offsets together.
    """
    count, middle = len(volumes), parts // 2
    starts = np.arange(count - parts)
    share = middle / parts
    chord = volumes[:-parts] * (1 - share) + volumes[parts:] * share
    is_bent = np.abs(volumes[middle : middle + len(starts)] - chord) > LINEAR + ROUNDING
    highest_bent = np.full(parts, -1)
    np.maximum.at(highest_bent, starts[is_bent] % parts, starts[is_bent])
    for offset in np.argsort(highest_bent, kind="stable"):
        if highest_bent[offset] > (1 - LEAST_PART) * count:
            return None
        bent = np.any(
            np.abs(_chord_distances(volumes, int(offset), parts)) > LINEAR + ROUNDING, axis=1
        )
        above = int(np.flatnonzero(bent)[-1]) + 1 if bent.any() else 0
        if above * parts + offset <= (1 - LEAST_PART) * count:
            return int(above * parts + offset)
    return None


def _chord_distances(volumes, first, parts):
    """Distances (steps, parts - 1) of the rows between computed rows from their chords."""
    steps = (len(volumes) - 1 - first) // parts
    ends = volumes[first : first + steps * parts + 1 : parts]
    share = np.arange(1, parts) / parts
    inner = volumes[first : first + steps * parts].reshape(steps, parts)[:, 1:]
    return inner - ends[:-1, None] * (1 - share) - ends[1:, None] * share


def _is_interpolated(volumes, first, parts):
    """Whether all rows in between lie within half a digit of the chord of printed volumes.

    Volumes computed at each row deviate by up to a whole digit where steps are uneven.
    """
    steps = (len(volumes) - 1 - first) // parts
    rises = np.diff(volumes[first : first + steps * parts + 1]).reshape(steps, parts)
    uneven = np.count_nonzero(np.ptp(rises, axis=1) > 0.5)
    left = np.abs(_chord_distances(volumes, first, parts))
    return bool(uneven >= FEWEST_UNEVEN and left.max() <= INTERPOLATED + ROUNDING)
