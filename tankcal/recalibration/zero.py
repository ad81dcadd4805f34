"""Zero of a table from its seams, which all move with it.

Two parabolas that meet at a dip s are adjusted to the rows about each seam, for each s. This gives
chi2 of each seam as a function of the zero, s minus the height of the seam above the bottom. The
contribution of each seam is capped, so that a fitting near one seam does not decide.
"""

import numpy as np

FARTHEST_M, STEP_M = 0.35, 0.01
MOVED_M = 0.15  # largest distance of a seam from its declared position
WINDOW_M = 0.5  # half width of the window about a seam, beyond the farthest zero
LARGEST_VOTE = 25.0  # cap on the chi2 of a seam
FEWEST_ROWS = 7  # fewest rows of a window
MOST_ROWS = 200  # largest number of rows used in a window
APART_M = 0.03  # smallest distance of candidates


def find_zeros(dips_m, volumes_m3, sd_m3, seams_m, most=3):
    """Dips of possible bottoms of the first ring, most likely first; (0.0,) if undetermined.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    seams_m : (n,) ndarray
        Heights above the bottom of the first ring.
    most : int
        Largest number of candidates.

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
    votes = votes + 0.5 * (zeros / FARTHEST_M) ** 2  # of equal candidates, prefer the one near 0
    candidates = []
    for place in np.argsort(votes):
        if all(abs(zeros[place] - zero) >= APART_M for zero in candidates):
            candidates.append(float(zeros[place]))
        if len(candidates) == most:
            break
    return tuple(candidates)


def move_seams(dips_m, volumes_m3, sd_m3, seams_m):
    """Dips (n,) of seams, each estimated separately from the rows about it.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    seams_m : (n,) ndarray
        Declared dips.
    """
    shifts = np.arange(-round(MOVED_M / STEP_M), round(MOVED_M / STEP_M) + 1) * STEP_M
    shifts = shifts[np.argsort(np.abs(shifts), kind="stable")]
    votes = [_vote(dips_m, volumes_m3, sd_m3, seam + shifts) for seam in seams_m]
    return np.array([s + shifts[np.argmin(v)] for s, v in zip(seams_m, votes, strict=True)])


def _vote(dips, volumes, sds, seams):
    """chi2 (zeros,) of the rows about one seam, capped, and scaled by its minimum."""
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
