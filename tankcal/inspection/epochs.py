"""Epochs of a levelling, the checks of their points, and the differences between epochs."""

import re
from dataclasses import dataclass
from datetime import date

import numpy as np
import scipy

from tankcal.inspection.out_of_plane import arcs_to_next
from tankcal.messages import list_some, message

LEAST_POINTS = 8  # least number of points of an epoch
WIDEST_GAP_DEG = 90.0  # largest gap between neighbouring points of an epoch
SHOWN = 5  # largest number of names listed in a message
OTHER_DATUM_M = 1.0  # largest mean settlement; more shows epochs without a common bench mark
WITHIN_NOISE = 0.05  # significance level of the test that all elevations are equal


@dataclass(frozen=True)
class Epoch:
    """Elevations of one epoch, or their changes, by azimuth.

    Attributes
    ----------
    name : str
        Name of the epoch.
    since : str or None
        Name of the earlier epoch of a difference; None for an epoch itself.
    points : tuple of str
        Names of the points.
    azimuth_rad : ndarray, shape (n,)
        Azimuths, ascending from 0 to 2 pi, clockwise from +y.
    z_m, u_m : ndarray, shape (n,)
        Elevations (means of repeated readings) and their standard uncertainties, nan if unknown.
    """

    name: str
    since: str | None
    points: tuple[str, ...]
    azimuth_rad: np.ndarray
    z_m: np.ndarray
    u_m: np.ndarray


@dataclass(frozen=True)
class Levelling:
    """All epochs of settlement.csv.

    Attributes
    ----------
    file : str
        Name of the file.
    epochs : tuple of Epoch
        Epochs in the order of their dates; epochs with other names in the order of the file.
    sd_known : bool
        Whether s_mm was given. If not, the standard deviation is estimated from repeated readings.
    dof : float
        Degrees of freedom of all standard deviations: inf if given, the degrees of freedom of the
        repeated readings if estimated, and 0 if unknown.
    radius_m : float or None
        Radius of the circle through the points, m; None if azimuths were given.
    """

    file: str
    epochs: tuple[Epoch, ...]
    sd_known: bool
    dof: float
    radius_m: float | None


def is_date(name):
    """Whether a name is a date that sorts as text, such as 2024, 2024-05 or 2024-05-31.

    >>> [is_date(name) for name in ("2024", "2024-05", "2024-02-30", "31-12-2019", "2024-5-31")]
    [True, True, False, False, False]
    """
    if not re.fullmatch(r"[0-9]{4}(-[0-9]{2}){0,2}", name):
        return False
    try:
        date.fromisoformat((name + "-01-01")[:10])
    except ValueError:
        return False
    return True


def is_like_a_date(name):
    """Whether a name has numbers and hyphens as a date, but is no such date (31-12-2019)."""
    return re.fullmatch(r"[0-9]+(-[0-9]+){1,2}", name) is not None and not is_date(name)


def sort_epochs(epochs):
    """Epochs sorted by date if all names are dates such as 2024, 2024-05 or 2024-05-31."""
    dated = all(is_date(epoch.name) for epoch in epochs)
    return sorted(epochs, key=lambda epoch: epoch.name) if dated else epochs


def find_differences(levelling, log):
    """Differences of each later epoch to the first, and of the last epoch to the previous one."""
    pairs = [(epoch, levelling.epochs[0]) for epoch in levelling.epochs[1:]]
    if len(pairs) > 1:
        pairs.append((levelling.epochs[-1], levelling.epochs[-2]))
    changes = [_difference(*pair, levelling.file, log) for pair in pairs]
    return [epoch for epoch in changes if epoch is not None]


def _difference(later, earlier, file, log):
    """Difference of two epochs at their common points, or None if these are too few."""
    earlier_place = {point: i for i, point in enumerate(earlier.points)}
    common = [i for i, point in enumerate(later.points) if point in earlier_place]
    earlier_rows = [earlier_place[later.points[i]] for i in common]
    unmatched = [*dict.fromkeys(point for point in (*later.points, *earlier.points)
                      if point not in earlier_place or point not in later.points)]  # fmt: skip
    z = later.z_m[common] - earlier.z_m[earlier_rows]
    gaps = np.degrees(arcs_to_next(later.azimuth_rad[common])) if common else np.array([360.0])
    names = {"later": later.name, "earlier": earlier.name}
    if len(common) < LEAST_POINTS or gaps.max() > WIDEST_GAP_DEG:
        text = message("levels_no_difference", "{count} points are in both {later!r} and"
                       " {earlier!r}; {least} all round would be needed: no difference of the two"
                       " is made", count=len(common), least=LEAST_POINTS, **names)  # fmt: skip
        log.warning(file, text, None, "epoch")
        return None
    if unmatched:
        text = message("levels_alone", "only one of {later!r} and {earlier!r} has {points}: left"
                       " out of their difference", points=list_some(unmatched, SHOWN),
                       **names)  # fmt: skip
        log.warning(file, text, None, "epoch")
    if abs(np.mean(z)) > OTHER_DATUM_M:
        text = message("levels_other_datum", "{later!r} lies {off:.3g} m from {earlier!r} on the"
                       " whole: without a common bench mark nothing is said of uniform settlement",
                       off=float(np.mean(z)), **names)  # fmt: skip
        log.warning(file, text, None, "elevation_m")
    u = np.hypot(later.u_m[common], earlier.u_m[earlier_rows])
    points = tuple(later.points[i] for i in common)
    return Epoch(later.name, earlier.name, points, later.azimuth_rad[common], z, u)


def warn_about_points(epoch, file, diameter_m, limits, log):
    """Warn of too few points for the tank, of an odd number of points, and of wide gaps.

    Parameters
    ----------
    epoch : Epoch
    file : str
        Name of settlement.csv.
    diameter_m : float
        Diameter of the tank, m.
    limits : SettlementLimits
        Limits of the number and the distance of points; None in a field for no limit.
    log : Log
        Receives the warnings.
    """
    count, per_point = len(epoch.points), limits.diameter_per_point_m
    required = 0 if per_point is None else int(np.ceil(diameter_m / per_point - 1e-9))
    required += required % 2
    if count < required:
        text = message("levels_fewer_than_asked", "epoch {epoch!r} has {count} points; a tank of"
                       " {diameter:.4g} m asks for {wanted}", epoch=epoch.name, count=count,
                       diameter=diameter_m, wanted=required)  # fmt: skip
        log.warning(file, text)
    if count % 2:
        text = message("levels_odd", "epoch {epoch!r} has {count} points; an even number is"
                       " expected, so that diameters close", epoch=epoch.name,
                       count=count)  # fmt: skip
        log.warning(file, text)
    arcs = arcs_to_next(epoch.azimuth_rad) * diameter_m / 2
    if limits.largest_arc_m is not None and arcs.max() > limits.largest_arc_m + 1e-6:
        after = [epoch.points[i] for i in np.flatnonzero(arcs > limits.largest_arc_m + 1e-6)]
        text = message("levels_wide_gaps", "epoch {epoch!r} has points up to {arc:.3g} m apart,"
                       " more than {most:.3g} m, after {points}", epoch=epoch.name,
                       arc=float(arcs.max()), most=limits.largest_arc_m,
                       points=list_some(after, SHOWN))  # fmt: skip
        log.warning(file, text)


def is_within_noise(epoch, dof):
    """Whether the elevations of an epoch agree within their uncertainties (5 %).

    The test is the chi-squared test, or the F test if the standard deviations were estimated with
    `dof` degrees of freedom. Without a standard deviation (dof = 0) the result is False.
    """
    if not dof:
        return False
    weights = epoch.u_m**-2.0
    deviations = epoch.z_m - np.average(epoch.z_m, weights=weights)
    chi2, count = float(deviations**2 @ weights), len(deviations) - 1
    significance = (
        scipy.stats.chi2.sf(chi2, count)
        if np.isinf(dof)
        else scipy.stats.f.sf(chi2 / count, count, dof)
    )
    return bool(significance > WITHIN_NOISE)
