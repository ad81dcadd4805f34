"""Deadwood and floating roofs in a table: heights where the area of the cross section jumps.

A fitting of volume v between the dips b and t changes the volume below h by v clip((h - b)/(t -
b)): two kinks, at b and t. Deadwood has a negative v. All pairs of kinks are tested together for
the pair that best explains the residuals of an adjustment. With ramps R_p = max(h - p, 0) and the
projector P of the adjustment, a fitting between b and t lowers chi2 by

    [(R_b - R_t)' r]^2 / [(R_b - R_t)' P (R_b - R_t)]
"""

from dataclasses import dataclass

import numpy as np

ROUNDING = 1e-11  # relative remainder of a ramp that the adjustment absorbs
ADDING_WEIGHT = (
    0.5  # weight of fittings that add volume: rarer, and similar to a gap between two others
)
APART = 3  # smallest distance of candidates, in candidate places
MOST_PLACES = 300  # largest number of places tested for kinks; finer tables are thinned


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
