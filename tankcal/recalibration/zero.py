"""Where a table's zero is: all seams move with it.

About each seam two parabolas that meet at a dip s are adjusted to the rows, for each s. Each seam
so has a vote on the zero, s less its height above the bottom. A vote counts for so much at most: a
thing in the tank near one seam must not decide for all.
"""

import numpy as np

FARTHEST_M, STEP_M = 0.35, 0.01
MOVED_M = 0.15  # that a seam is looked for from where it was declared
WINDOW_M = 0.5  # of rows about a seam, beyond the farthest zero
LARGEST_VOTE = 25.0  # of chi2
FEWEST_ROWS = 7  # of a window
MOST_ROWS = 200  # of a window that are looked at
APART_M = 0.03  # of candidates


def find_zeros(dips_m, volumes_m3, sd_m3, seams_m, most=3):
    """Dips where the first ring may begin, the likeliest first; (0.0,) where nothing tells.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    seams_m : (n,) ndarray
        Heights above the bottom of the first ring.
    most : int

    Returns
    -------
    tuple of float
    """
    zeros = np.arange(-round(FARTHEST_M / STEP_M), round(FARTHEST_M / STEP_M) + 1) * STEP_M
    votes = np.zeros(len(zeros))
    for seam in seams_m:
        votes += _vote(dips_m, volumes_m3, sd_m3, seam + zeros)
    if np.ptp(votes) < 1.0:
        return (0.0,)
    votes = votes + 0.5 * (zeros / FARTHEST_M) ** 2  # of equals the one near 0
    found = []
    for place in np.argsort(votes):
        if all(abs(zeros[place] - zero) >= APART_M for zero in found):
            found.append(float(zeros[place]))
        if len(found) == most:
            break
    return tuple(found)


def move_seams(dips_m, volumes_m3, sd_m3, seams_m):
    """(n,) dips of seams, each where the rows about it show a kink by themselves.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    seams_m : (n,) ndarray
        Dips that they were declared to be at.
    """
    shifts = np.arange(-round(MOVED_M / STEP_M), round(MOVED_M / STEP_M) + 1) * STEP_M
    shifts = shifts[np.argsort(np.abs(shifts), kind="stable")]
    votes = [_vote(dips_m, volumes_m3, sd_m3, seam + shifts) for seam in seams_m]
    return np.array([s + shifts[np.argmin(v)] for s, v in zip(seams_m, votes, strict=True)])


def _vote(dips, volumes, sds, seams):
    """(zeros,) chi2 of the rows about one seam, capped and scaled to what it leaves at best."""
    reach = FARTHEST_M + WINDOW_M
    near = np.flatnonzero(np.abs(dips - seams.mean()) <= reach)
    if len(near) < FEWEST_ROWS:
        return np.zeros(len(seams))
    near = near[np.unique(np.linspace(0, len(near) - 1, MOST_ROWS).astype(int))]
    middle = float(seams.mean())
    x = (dips[near] - middle) / reach
    weight = 1 / sds[near]
    value = (volumes[near] - volumes[near].mean()) * weight
    q = np.linalg.qr(np.vander(x, 3) * weight[:, None])[0]
    value = value - q @ (q.T @ value)
    chi2 = np.empty(len(seams))
    for k, seam in enumerate((seams - middle) / reach):
        above = np.maximum(x - seam, 0.0)
        kinks = np.column_stack([above, above**2]) * weight[:, None]
        kinks = kinks - q @ (q.T @ kinks)
        left = value - kinks @ np.linalg.lstsq(kinks, value, rcond=None)[0]
        chi2[k] = left @ left
    least = chi2.min()
    scale = max(least / max(len(near) - 5, 1), 1.0)
    return np.minimum((chi2 - least) / scale, LARGEST_VOTE)
