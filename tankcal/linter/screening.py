"""Screening of a table: is each volume where its neighbours put it?

A cubic through the rows around row i, without row i, predicts its volume. Rows of a table that are
rounded to a quantum q are off by at most q/2 each, so the prediction differs from the row by at
most q/2 (1 + sum |w|), with w the weights of the prediction: what exceeds that is no rounding. A
table that is rougher than its rounding (accumulated rounding, or rows too far apart for a cubic) is
judged by its own roughness instead, the running median of these differences.
Source of the leave-one-out formula: Allen 1974, Technometrics 16(1) 125-127 (PRESS).
"""

from dataclasses import dataclass

import numpy as np

DEGREE, WINDOW = 3, 13
FEWEST_ROWS = 6  # of a stretch that is screened
LEAST_SPARED = 1e-6  # of a row's own share: below it, the others say nothing about it
ROUGHNESS_ROWS, ROUGHNESS_FACTOR = 25, 6.0


@dataclass
class Rows:
    """The rows under examination; the findings change them as they are made.

    height     (rows,) ascending, in steps of the table
    volume     (rows,) in quanta; corrected where a finding explains what is wrong
    is_sound   (rows,) False for rows whose volume is known to be wrong
    is_settled (rows,) True for rows whose difference has been explained
    joints     rows that begin a new stretch: across them nothing is smooth
    weight     (rows,) 1 where only the volume is rounded, less where the height is rounded, too
    noise      largest rounding error of a row of weight 1, in quanta
    """

    height: np.ndarray
    volume: np.ndarray
    is_sound: np.ndarray
    is_settled: np.ndarray
    joints: list
    weight: np.ndarray
    noise: float

    def window(self, row, width):
        """Rows of the same stretch around a row, itself among them; at most `width`."""
        sound = np.flatnonzero(self.is_sound)
        stretch = np.searchsorted(self.joints, sound, side="right")
        place = int(np.searchsorted(sound, row))
        low, high = np.searchsorted(stretch, [stretch[place], stretch[place] + 1])
        start = int(np.clip(place - width // 2, low, max(low, high - width)))
        return sound[start : min(start + width, high)]


def leave_one_out(rows):
    """((rows,) row minus prediction, (rows,) what rounding allows), in quanta, times the weight.

    The second is infinite for rows that are not screened.
    """
    difference, allowed = np.zeros(len(rows.height)), np.full(len(rows.height), np.inf)
    sound = np.flatnonzero(rows.is_sound)
    stretch = np.searchsorted(rows.joints, sound, side="right")
    low = np.searchsorted(stretch, stretch, side="left")
    high = np.searchsorted(stretch, stretch, side="right")
    own = np.flatnonzero(high - low >= FEWEST_ROWS)
    if len(own) == 0:
        return difference, allowed
    start = np.clip(own - WINDOW // 2, low[own], np.maximum(low[own], high[own] - WINDOW))
    place = start[:, None] + np.arange(WINDOW)
    is_in = place < high[own][:, None]
    others = sound[np.minimum(place, len(sound) - 1)]
    row = sound[own]
    apart = (rows.height[others] - rows.height[row][:, None]) * is_in
    apart /= np.abs(apart).max(axis=1)[:, None]
    weight = rows.weight[others] * is_in
    basis = apart[..., None] ** np.arange(DEGREE + 1) * weight[..., None]
    values = (rows.volume[others] - rows.volume[row][:, None]) * weight
    q, _ = np.linalg.qr(basis)
    number = np.arange(len(own))
    hat = np.einsum("nk,njk->nj", q[number, own - start], q)
    leverage = hat[number, own - start]
    spared = np.maximum(1 - leverage, LEAST_SPARED)
    difference[row] = -np.einsum("nj,nj->n", hat, values) / spared
    weights = (np.abs(hat).sum(axis=1) - leverage) / spared
    is_predicted = 1 - leverage > LEAST_SPARED
    allowed[row] = np.where(is_predicted, rows.noise * (1 + weights) * (1 + 1e-9), np.inf)
    return difference, allowed


def most_suspicious(rows):
    """The row that is furthest from what its neighbours allow, or None when all are explained."""
    difference, allowed = leave_one_out(rows)
    screened = np.flatnonzero(np.isfinite(allowed))
    if len(screened) == 0:
        return None
    size = np.abs(difference[screened])
    candidates = np.flatnonzero((size > allowed[screened]) & ~rows.is_settled[screened])
    around = [size[max(k - ROUGHNESS_ROWS, 0) : k + ROUGHNESS_ROWS + 1] for k in candidates]
    roughness = np.array([ROUGHNESS_FACTOR * np.median(sizes) for sizes in around])
    candidates = candidates[size[candidates] > roughness] if len(candidates) else candidates
    if len(candidates) == 0:
        return None
    excess = size[candidates] / allowed[screened][candidates]
    return int(screened[candidates[np.argmax(excess)]])
