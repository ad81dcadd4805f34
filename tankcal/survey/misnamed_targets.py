"""Targets of a scan under names, in a frame or in a unit that cannot be theirs."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message

FEWEST = 3  # targets that tell a pose
FAR_BETTER = 5.0  # times: so much better a wrong name, frame or unit has to fit
LEAST_CHANGE = 0.01  # of a scale that no scanner has: another unit


@dataclass(frozen=True)
class Fit:
    """A rigid motion between two sets of places: its root mean square misfit, m."""

    rotation: np.ndarray
    shift_m: np.ndarray
    scale: float
    rms_m: float


def fit_motion(own_m, there_m, *, scaled=False, mirrored=False):
    """`Fit` that brings places (n, 3) of a scan onto places (n, 3) of the tank.

    Parameters
    ----------
    own_m, there_m : ndarray, shape (n, 3)
    scaled : bool
        Whether a scale is estimated, too.
    mirrored : bool
        Whether the one frame is left-handed.

    Examples
    --------
    >>> places = np.array([[0.0, 0, 0], [3, 0, 0], [0, 2, 0], [1, 1, 4]])
    >>> found = fit_motion(1000 * places, places + [5, 0, 1], scaled=True)
    >>> round(found.scale, 6), round(found.rms_m, 9)
    (0.001, 0.0)
    """
    middle, centre = own_m.mean(axis=0), there_m.mean(axis=0)
    a, b = own_m - middle, there_m - centre
    u, size, v = np.linalg.svd(b.T @ a)
    turn = np.linalg.det(u) * np.linalg.det(v)
    sign = np.array([1.0, 1.0, -turn if mirrored else turn])
    rotation = (u * sign) @ v
    scale = float(sign @ size / max(np.sum(a**2), 1e-30)) if scaled else 1.0
    shift = centre - scale * rotation @ middle
    left = there_m - scale * own_m @ rotation.T - shift
    return Fit(rotation, shift, scale, float(np.sqrt(np.mean(np.sum(left**2, axis=1)))))


def refuse_misnamed(scan, own, there, names, sd_m):
    """Raise SolutionError where targets fit far better mirrored, scaled or under other names.

    own, there  (n, 3) as the scan has them, and in the tank's frame
    names, sd_m  (n,) of the targets
    """
    plain = fit_motion(own, there).rms_m
    far_better = plain / FAR_BETTER
    limit = max(3 * float(np.max(sd_m)), 1e-6)
    if len(own) > FEWEST and fit_motion(own, there, mirrored=True).rms_m < min(far_better, limit):
        text = message(
            "targets_mirrored",
            "the targets of scan {scan!r} fit as their mirror image only; expected a right-handed"
            " frame: was an axis turned round, or x and y exchanged?",
            scan=scan,
        )
        raise SolutionError(text)
    scaled = fit_motion(own, there, scaled=True)
    if abs(scaled.scale - 1) > LEAST_CHANGE and scaled.rms_m < far_better:
        text = message(
            "targets_in_other_unit",
            "the targets of scan {scan!r} are {factor:.4g} times as far apart as those of the"
            " survey; expected the same: is its unit another one?",
            scan=scan,
            factor=1 / scaled.scale,
        )
        raise SolutionError(text)
    swaps = []
    for i in range(len(own)):
        for j in range(i + 1, len(own)):
            order = np.arange(len(own))
            order[[i, j]] = j, i
            swaps.append((fit_motion(own[order], there).rms_m, i, j))
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
