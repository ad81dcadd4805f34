"""Seams and fittings in a table, where its differences jump, and the zero that all seams share.

Seams of unknown position are sought one after the other (`find_seams`). For seams of known heights,
two parabolas that meet at a dip s are adjusted to the rows about each seam, for each s. This gives
chi2 of each seam as a function of the zero, s minus the height of the seam above the bottom. The
contribution of each seam is capped, so that a fitting near one seam does not decide (`find_zeros`).

Deadwood and floating roofs
---------------------------

A fitting of volume v between the dips b and t changes the volume below h by v clip((h - b)/(t -
b)): two kinks, at b and t. Deadwood has a negative v. All pairs of kinks are tested together for
the pair that best explains the residuals of an adjustment. With ramps R_p = max(h - p, 0) and the
projector P of the adjustment, a fitting between b and t lowers chi2 by

    [(R_b - R_t)' r]^2 / [(R_b - R_t)' P (R_b - R_t)]
"""

from dataclasses import dataclass

import numpy as np

LEAST_APART_M = 0.8  # smallest distance of two seams, and of a seam from the ends of the table
PLACES_APART_M = 0.01  # distance of the places tried for a seam
LEAST_GAIN = 30.0  # smallest reduction of chi2 by a seam
MOST_ROWS_OF_CHECK = 300  # largest number of rows for checking heights of courses
ABOVE_BOTTOM_M = 0.4  # lowest row for checking heights of courses
FROM_ENDS_M = 0.3  # smallest distance of a seam within a course from its ends
# Height of a course, and height over the median; only taller courses are checked.
WIDEST_PLATE_M, TALL = 3.1, 1.4
CLEAR_RATIO = 30.0  # ratio of chi2 with declared seams to chi2 with seams from the table
OPPOSITE = 0.25  # relative sum of two opposite jumps of area that are the ends of a fitting
FARTHEST_M, STEP_M = 0.35, 0.01  # largest distance of a zero from dip 0, and step of the search
MOVED_M = 0.15  # largest distance of a seam from its declared position
WINDOW_M = 0.5  # half width of the window about a seam, beyond the farthest zero
LARGEST_VOTE = 25.0  # cap on the chi2 of a seam
FEWEST_ROWS_OF_WINDOW = 7  # fewest rows of a window
MOST_ROWS_OF_WINDOW = 200  # largest number of rows used in a window
MOST_ZEROS = 3  # largest number of candidates for the zero
APART_M = 0.03  # smallest distance of candidates
ROUNDING = 1e-11  # relative remainder of a ramp that the adjustment absorbs
ADDING_WEIGHT = (
    0.5  # weight of fittings that add volume: rarer, and similar to a gap between two others
)
APART = 3  # smallest distance of candidates, in candidate places
MOST_PLACES = 300  # largest number of places tested for kinks; finer tables are thinned


def find_seams(dips_m, volumes_m3, sd_m3, count):
    """Dips of the seams, rising; fewer than `count` if fewer are significant.

    Each ring is a parabola that meets the next one at the seam. Seams are added in order of their
    reduction of chi2. After each addition the other seams are moved again.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    count : int
    """
    low, high = dips_m[0] + LEAST_APART_M, dips_m[-1] - LEAST_APART_M
    places = dips_m[(dips_m > low) & (dips_m < high)]
    if len(places) > 1:
        step = max(1, round(PLACES_APART_M / float(np.median(np.diff(dips_m)))))
        places = places[::step]
    seams = []
    for _ in range(count):
        gains = _gains(dips_m, volumes_m3, sd_m3, seams, places)
        if len(gains) == 0 or gains.max() < LEAST_GAIN:
            break
        seams.append(float(places[np.argmax(gains)]))
    for _ in range(3):
        for k in range(len(seams)):
            others = seams[:k] + seams[k + 1 :]
            gains = _gains(dips_m, volumes_m3, sd_m3, others, places)
            if len(gains) and gains.max() > 0:
                seams[k] = float(places[np.argmax(gains)])
    return np.array(sorted(seams))


def find_seams_within(dips_m, volumes_m3, sd_m3, heights_m):
    """Dips of the seams that a table shows within each declared course; empty if the courses fit.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    heights_m : (n,) ndarray
        FormerFacts heights of all courses, from the bottom up.

    Returns
    -------
    dict of {int: list of float}
        Courses with two or more seams in them.
    """
    tall = np.flatnonzero((heights_m > WIDEST_PLATE_M) | (heights_m > TALL * np.median(heights_m)))
    some = np.flatnonzero((volumes_m3 > 0) & (dips_m > dips_m[0] + ABOVE_BOTTOM_M))
    if not len(tall) or len(some) < MOST_ROWS_OF_CHECK // 10:
        return {}
    some = some[np.unique(np.linspace(0, len(some) - 1, MOST_ROWS_OF_CHECK).round().astype(int))]
    rows = dips_m[some], volumes_m3[some], sd_m3[some]
    edges = np.append(0.0, np.cumsum(heights_m))
    declared = _chi2(*rows, edges[1:-1][edges[1:-1] < dips_m[-1]])[0]
    if declared < CLEAR_RATIO * len(some):
        return {}
    seams = find_seams(*rows, len(heights_m) - 1)
    shown, jumps = _chi2(*rows, seams)
    if declared < CLEAR_RATIO * max(shown, len(some)):
        return {}
    is_seam = np.ones(len(seams), dtype=bool)
    for k in range(len(seams) - 1):
        if abs(jumps[k] + jumps[k + 1]) < OPPOSITE * max(abs(jumps[k]), abs(jumps[k + 1])):
            is_seam[k : k + 2] = False
    seams = seams[is_seam]
    within = {}
    for k in tall:
        low, high = edges[k : k + 2]
        inside = seams[(seams > low + FROM_ENDS_M) & (seams < high - FROM_ENDS_M)]
        if len(inside) > 1:
            within[int(k)] = inside.tolist()
    return within


def _chi2(dips, volumes, sds, seams):
    """Return chi2 of a parabola for each ring, and the jumps (seams,) of the slope."""
    basis = _parabolas(dips, sds, seams)
    solution = np.linalg.lstsq(basis, volumes / sds, rcond=None)[0]
    left = volumes / sds - basis @ solution
    return float(left @ left), solution[3::2]


def _parabolas(dips, sds, seams):
    """Weighted basis (rows, 3 + 2 seams) of a parabola for each ring, continuous at the seams."""
    x = dips / dips[-1]
    columns = [np.ones_like(x), x, x**2]
    for seam in seams:
        above = np.maximum(x - seam / dips[-1], 0.0)
        columns += [above, above**2]
    return np.column_stack(columns) / sds[:, None]


def _gains(dips, volumes, sds, seams, places):
    """Reduction (places,) of chi2 by another seam; 0 near an existing seam."""
    x = dips / dips[-1]
    q = np.linalg.qr(_parabolas(dips, sds, seams))[0]
    value = volumes / sds
    left = value - q @ (q.T @ value)
    # A further seam adds a ramp and its square. Their part that the parabolas do not explain lowers
    # chi2 by the square of its projection on the residuals.
    gains = np.zeros(len(places))
    for k, place in enumerate(places):
        if any(abs(place - seam) < LEAST_APART_M for seam in seams):
            continue
        above = np.maximum(x - place / dips[-1], 0.0)
        kinks = np.column_stack([above, above**2]) / sds[:, None]
        kinks = np.linalg.qr(kinks - q @ (q.T @ kinks))[0]
        gains[k] = float(np.sum((kinks.T @ left) ** 2))
    return gains


# ---- zero of the table


def find_zeros(dips_m, volumes_m3, sd_m3, seams_m):
    """Dips of possible bottoms of the first ring, most likely first; (0.0,) if undetermined.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    seams_m : (n,) ndarray
        Heights above the bottom of the first ring.

    Returns
    -------
    tuple of float
    """
    zeros = np.arange(-round(FARTHEST_M / STEP_M), round(FARTHEST_M / STEP_M) + 1) * STEP_M
    votes = np.zeros(len(zeros))
    for seam in seams_m:
        votes += _seam_chi2(dips_m, volumes_m3, sd_m3, seam + zeros)
    if np.ptp(votes) < 1.0:
        return (0.0,)
    votes = votes + 0.5 * (zeros / FARTHEST_M) ** 2  # of equal candidates, prefer the one near 0
    candidates = []
    for place in np.argsort(votes):
        if all(abs(zeros[place] - zero) >= APART_M for zero in candidates):
            candidates.append(float(zeros[place]))
        if len(candidates) == MOST_ZEROS:
            break
    return tuple(candidates)


def move_seams(dips_m, volumes_m3, sd_m3, seams_m):
    """Dips (n,) of seams, each estimated separately from the rows about it.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    seams_m : (n,) ndarray
        FormerFacts dips.
    """
    shifts = np.arange(-round(MOVED_M / STEP_M), round(MOVED_M / STEP_M) + 1) * STEP_M
    shifts = shifts[np.argsort(np.abs(shifts), kind="stable")]
    votes = [_seam_chi2(dips_m, volumes_m3, sd_m3, seam + shifts) for seam in seams_m]
    return np.array([s + shifts[np.argmin(v)] for s, v in zip(seams_m, votes, strict=True)])


def _seam_chi2(dips, volumes, sds, seams):
    """chi2 (zeros,) of the rows about one seam, capped, and scaled by its minimum."""
    reach = FARTHEST_M + WINDOW_M
    near = np.flatnonzero(np.abs(dips - seams.mean()) <= reach)
    if len(near) < FEWEST_ROWS_OF_WINDOW:
        return np.zeros(len(seams))
    near = near[np.unique(np.linspace(0, len(near) - 1, MOST_ROWS_OF_WINDOW).astype(int))]
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


@dataclass(frozen=True)
class Fitting:
    """A fitting that reduces or increases the volume.

    Attributes
    ----------
    bottom_m, top_m : float
        Dips.
    volume_m3 : float
        Negative: deadwood.
    """

    bottom_m: float
    top_m: float
    volume_m3: float

    def volume_below_m3(self, dips_m):
        """Change of the volume below each dip, shape (rows,), m3."""
        return self.volume_m3 * self.share(dips_m)

    def share(self, dips_m):
        """Share of the fitting below each dip, shape (rows,)."""
        height = max(self.top_m - self.bottom_m, 1e-9)
        return np.clip((np.asarray(dips_m) - self.bottom_m) / height, 0.0, 1.0)

    def derivatives(self, dips_m):
        """Derivatives (rows, 3) of `volume_below_m3` by bottom, top and volume."""
        dips = np.asarray(dips_m)
        height = max(self.top_m - self.bottom_m, 1e-9)
        share = self.share(dips)
        is_beside = (dips > self.bottom_m) & (dips < self.top_m)
        slope = self.volume_m3 / height * is_beside
        return np.column_stack([slope * (share - 1), -slope * share, share])


def find_fittings(dips_m, left_m3, design, sd_m3, longest_m=np.inf, most=4):
    """Return each `Fitting` that explains residuals of an adjustment, with its reduction of chi2.

    Parameters
    ----------
    dips_m : (rows,) ndarray
        Rising dips.
    left_m3 : (rows,) ndarray
        Residuals: volume of the table minus that of the adjustment.
    design : (rows, u) ndarray
        Derivatives of the adjustment by its unknowns.
    sd_m3 : (rows,) ndarray
        Standard deviations of the rows.
    longest_m : float, optional
        Largest height of a fitting.
    most : int
        Largest number of fittings, best first, well apart from each other.

    Returns
    -------
    list of (Fitting, float)
    """
    places = dips_m[np.unique(np.linspace(0, len(dips_m) - 1, MOST_PLACES).astype(int))]
    # Ramps without the part that the unknowns of the adjustment absorb: P R, P = 1 - q q'.
    q = np.linalg.qr(design / sd_m3[:, None])[0]
    ramps = np.maximum(dips_m[:, None] - places, 0.0) / sd_m3[:, None]
    left = ramps - q @ (q.T @ ramps)
    reach = np.maximum(np.einsum("np,np->p", ramps, ramps), 1e-300)
    gram, of_left = left.T @ left, left.T @ (left_m3 / sd_m3)
    # (R_b - R_t)' P (R_b - R_t) of all pairs; too small values are rounding errors
    apart = np.diag(gram)[:, None] + np.diag(gram) - 2 * gram
    is_told = apart > ROUNDING * np.maximum(reach[:, None], reach)
    height = places - places[:, None]
    is_told &= (height > 0) & (height <= longest_m)
    # numerator, reduction of chi2, and slope of the ramp: area of the fitting
    along = of_left[:, None] - of_left
    gain = np.where(is_told, along**2 / np.where(is_told, apart, 1.0), 0.0)
    slopes = along / np.where(is_told, apart, 1.0)
    likely = np.where(slopes > 0, ADDING_WEIGHT * gain, gain)
    fittings = []
    for _ in range(most):
        low, high = (int(k) for k in np.unravel_index(np.argmax(likely), gain.shape))
        if likely[low, high] <= 0:
            break
        best = float(gain[low, high])
        near = (
            slice(max(low - APART, 0), low + APART + 1),
            slice(max(high - APART, 0), high + APART + 1),
        )
        likely[near] = 0.0  # the next fitting is well apart
        low, high = _reducing_alternative(gain, low, high, slopes[low, high])
        volume = float(slopes[low, high] * height[low, high])
        fittings.append((Fitting(float(places[low]), float(places[high]), volume), best))
    return fittings


def _reducing_alternative(gain, low, high, slope):
    """Of the two fittings that may end at one kink, return the one that reduces the volume."""
    last = len(gain) - 1
    if slope > 0:
        for pair in ((0, low), (high, last)):
            is_one_kink = (pair[0] == 0 and high == last) or (pair[1] == last and low == 0)
            if pair[0] < pair[1] and is_one_kink and gain[pair] > 0.99 * gain[low, high]:
                return pair
    return low, high


def pair_kinks_again(fittings, near_m, least_share):
    """Pair the kinks differently: fittings one above the other instead of overlapping ones.

    Parameters
    ----------
    fittings : sequence of Fitting
    near_m : float
        Kinks nearer than this are merged.
    least_share : float
        Kinks below this share of the largest change of slope are ignored.

    Returns
    -------
    tuple of Fitting
    """
    kinks = []
    for fitting in fittings:
        slope = fitting.volume_m3 / max(fitting.top_m - fitting.bottom_m, 1e-9)
        kinks += [(fitting.bottom_m, slope), (fitting.top_m, -slope)]
    largest = max((abs(slope) for _, slope in kinks), default=0.0)
    joined = []
    for dip, slope in sorted(kinks):
        if joined and dip - joined[-1][0] < near_m:
            joined[-1] = (joined[-1][0], joined[-1][1] + slope)
        else:
            joined.append((dip, slope))
    real = [(dip, slope) for dip, slope in joined if abs(slope) > least_share * largest]
    pairs = zip(real[::2], real[1::2], strict=False)
    return tuple(
        Fitting(low, high, (slope - high_slope) / 2 * (high - low))
        for (low, slope), (high, high_slope) in pairs
    )
