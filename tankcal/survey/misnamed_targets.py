"""Detection of scan targets with wrong names, a wrong frame or a wrong unit."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message

FEWEST = 3  # targets that determine a pose
FAR_BETTER = 5.0  # ratio of misfits that makes a wrong name, frame or unit credible
LEAST_CHANGE = 0.01  # scale error larger than that of any scanner: indicates another unit


@dataclass(frozen=True)
class Fit:
    """Similarity between two sets of places, with its rms misfit in metres."""

    rotation: np.ndarray
    shift_m: np.ndarray
    scale: float
    rms_m: float


def fit_motion(scan_m, tank_m, *, scaled=False, mirrored=False):
    """Fit the rigid motion that maps places of a scan to places of the tank.

    Parameters
    ----------
    own_m, there_m : ndarray, shape (n, 3)
        Places in the frame of the scan and in the frame of the tank.
    scaled : bool
        Whether to estimate a scale.
    mirrored : bool
        Whether one frame is left-handed.

    Returns
    -------
    Fit

    Examples
    --------
    >>> places = np.array([[0.0, 0, 0], [3, 0, 0], [0, 2, 0], [1, 1, 4]])
    >>> found = fit_motion(1000 * places, places + [5, 0, 1], scaled=True)
    >>> round(found.scale, 6), round(found.rms_m, 9)
    (0.001, 0.0)
    """
    # Centring both sets separates the rotation from the translation.
    middle, centre = scan_m.mean(axis=0), tank_m.mean(axis=0)
    a, b = scan_m - middle, tank_m - centre
    u, size, v = np.linalg.svd(b.T @ a)
    turn = np.linalg.det(u) * np.linalg.det(v)
    # Arun et al. 1987: the sign of the smallest singular direction selects rotation or reflection.
    sign = np.array([1.0, 1.0, -turn if mirrored else turn])
    rotation = (u * sign) @ v
    # Least squares scale: trace(S D) over the sum of squared coordinates (Umeyama 1991).
    scale = float(sign @ size / max(np.sum(a**2), 1e-30)) if scaled else 1.0
    shift = centre - scale * rotation @ middle
    residuals = tank_m - scale * scan_m @ rotation.T - shift
    return Fit(rotation, shift, scale, float(np.sqrt(np.mean(np.sum(residuals**2, axis=1)))))


def refuse_misnamed(scan, scan_m, tank_m, names, sd_m):
    """Raise SolutionError if targets fit far better mirrored, scaled or with exchanged names.

    Parameters
    ----------
    scan : str
    own, there : ndarray, shape (n, 3)
        Places of the targets in the frame of the scan and in the frame of the tank, m.
    names : sequence of str, length n
    sd_m : array_like, shape (n,)
        Standard deviations of the targets.
    """
    plain = fit_motion(scan_m, tank_m).rms_m
    far_better = plain / FAR_BETTER
    limit = max(3 * float(np.max(sd_m)), 1e-6)
    # Three points and their mirror image are congruent; only a fourth point shows the difference.
    if len(scan_m) > FEWEST and fit_motion(scan_m, tank_m, mirrored=True).rms_m < min(
        far_better, limit
    ):
        text = message(
            "targets_mirrored",
            "the targets of scan {scan!r} fit as their mirror image only; expected a right-handed"
            " frame: was an axis turned round, or x and y exchanged?",
            scan=scan,
        )
        raise SolutionError(text)
    scaled = fit_motion(scan_m, tank_m, scaled=True)
    if abs(scaled.scale - 1) > LEAST_CHANGE and scaled.rms_m < far_better:
        text = message(
            "targets_in_other_unit",
            "the targets of scan {scan!r} are {factor:.4g} times as far apart as those of the"
            " survey; expected the same: is its unit another one?",
            scan=scan,
            factor=1 / scaled.scale,
        )
        raise SolutionError(text)
    # Try every exchange of two names.
    swaps = []
    for i in range(len(scan_m)):
        for j in range(i + 1, len(scan_m)):
            order = np.arange(len(scan_m))
            order[[i, j]] = j, i
            swaps.append((fit_motion(scan_m[order], tank_m).rms_m, i, j))
    swaps.sort()
    if swaps and swaps[0][0] < min(far_better, limit):
        text = message(
            "targets_exchanged",
            "targets {one!r} and {other!r} of scan {scan!r} fit with their names exchanged;"
            " expected each under its own",
            scan=scan,
            one=names[swaps[0][1]],
            other=names[swaps[0][2]],
        )
        raise SolutionError(text)
