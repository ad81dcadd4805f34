"""Epochs of a levelling: what each has, its points against what is asked for, and differences."""

import re
from dataclasses import dataclass
from datetime import date

import numpy as np
import scipy

from tankcal.inspection.out_of_plane import arcs_after
from tankcal.messages import list_some, message

LEAST_POINTS = 8
WIDEST_GAP_DEG = 90.0
SHOWN = 5  # names in one line
OTHER_DATUM_M = 1.0  # a tank does not settle by more: the epochs have no bench mark in common
WITHIN_NOISE = 0.05  # level at which elevations are all the same but for their errors


@dataclass(frozen=True)
class Epoch:
    """Elevations of one epoch, or their changes, by azimuth.

    Attributes
    ----------
    name : str
        Of the epoch.
    since : str or None
        The earlier one of a difference.
    points : tuple of str
        Names.
    azimuth_rad, z_m, u_m : ndarray, shape (n,)
        Rising from 0 to 2 pi, clockwise from +y; elevations (means of repeats), and their standard
        uncertainties, nan where none is known.
    """

    name: str
    since: str | None
    points: tuple[str, ...]
    azimuth_rad: np.ndarray
    z_m: np.ndarray
    u_m: np.ndarray


@dataclass(frozen=True)
class Levelling:
    """Every epoch of settlement.csv.

    Attributes
    ----------
    file : str
        Its name.
    epochs : tuple of Epoch
        Dates in their order, other names in the order of the file.
    sd_known : bool
        Whether s_mm was given; else it is of the repeats, if there are any.
    dof : float
        Degrees of freedom of all standard deviations: inf as given, else those of the repeats; 0:
        none is known.
    radius_m : float or None
        Of the circle through the points; None: they came with azimuths.
    """

    file: str
    epochs: tuple[Epoch, ...]
    sd_known: bool
    dof: float
    radius_m: float | None


def is_date(name):
    """Whether a name is a date whose order is that of its letters: 2024, 2024-05, 2024-05-31.

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
    """Whether a name is of numbers and hyphens, as dates are, but is none (31-12-2019)."""
    return re.fullmatch(r"[0-9]+(-[0-9]+){1,2}", name) is not None and not is_date(name)


def in_order(epochs):
    """Epochs by date where all names are dates such as 2024, 2024-05 or 2024-05-31."""
    dated = all(is_date(one.name) for one in epochs)
    return sorted(epochs, key=lambda one: one.name) if dated else epochs


def differences(levelling, log):
    """Epochs of changes: each later one since the first, and the last since the one before it."""
    pairs = [(one, levelling.epochs[0]) for one in levelling.epochs[1:]]
    if len(pairs) > 1:
        pairs.append((levelling.epochs[-1], levelling.epochs[-2]))
    found = [_difference(*pair, levelling.file, log) for pair in pairs]
    return [one for one in found if one is not None]


def _difference(later, earlier, file, log):
    """Epoch of the change at the points of both; None, and a warning, where they are too few."""
    places = {point: i for i, point in enumerate(earlier.points)}
    both = [i for i, point in enumerate(later.points) if point in places]
    others = [places[later.points[i]] for i in both]
    alone = [*dict.fromkeys(point for point in (*later.points, *earlier.points)
                            if point not in places or point not in later.points)]  # fmt: skip
    z = later.z_m[both] - earlier.z_m[others]
    gaps = np.degrees(arcs_after(later.azimuth_rad[both])) if both else np.array([360.0])
    names = {"later": later.name, "earlier": earlier.name}
    if len(both) < LEAST_POINTS or gaps.max() > WIDEST_GAP_DEG:
        text = message("levels_no_difference", "{count} points are in both {later!r} and"
                       " {earlier!r}; {least} all round would be needed: no difference of the two"
                       " is made", count=len(both), least=LEAST_POINTS, **names)  # fmt: skip
        log.warning(file, text, None, "epoch")
        return None
    if alone:
        text = message("levels_alone", "only one of {later!r} and {earlier!r} has {points}: left"
                       " out of their difference", points=list_some(alone, SHOWN),
                       **names)  # fmt: skip
        log.warning(file, text, None, "epoch")
    if abs(np.mean(z)) > OTHER_DATUM_M:
        text = message("levels_other_datum", "{later!r} lies {off:.3g} m from {earlier!r} on the"
                       " whole: without a common bench mark nothing is said of uniform settlement",
                       off=float(np.mean(z)), **names)  # fmt: skip
        log.warning(file, text, None, "elevation_m")
    u = np.hypot(later.u_m[both], earlier.u_m[others])
    points = tuple(later.points[i] for i in both)
    return Epoch(later.name, earlier.name, points, later.azimuth_rad[both], z, u)


def warn_of_points(epoch, file, diameter_m, limits, log):
    """Warnings of too few points for the tank, of an odd number, and of wide gaps."""
    count, per_point = len(epoch.points), limits.diameter_per_point_m
    wanted = 0 if per_point is None else int(np.ceil(diameter_m / per_point - 1e-9))
    wanted += wanted % 2
    if count < wanted:
        text = message("levels_fewer_than_asked", "epoch {epoch!r} has {count} points; a tank of"
                       " {diameter:.4g} m asks for {wanted}", epoch=epoch.name, count=count,
                       diameter=diameter_m, wanted=wanted)  # fmt: skip
        log.warning(file, text)
    if count % 2:
        text = message("levels_odd", "epoch {epoch!r} has {count} points; an even number is"
                       " expected, so that diameters close", epoch=epoch.name,
                       count=count)  # fmt: skip
        log.warning(file, text)
    arcs = arcs_after(epoch.azimuth_rad) * diameter_m / 2
    if limits.largest_arc_m is not None and arcs.max() > limits.largest_arc_m + 1e-6:
        after = [epoch.points[i] for i in np.flatnonzero(arcs > limits.largest_arc_m + 1e-6)]
        text = message("levels_wide_gaps", "epoch {epoch!r} has points up to {arc:.3g} m apart,"
                       " more than {most:.3g} m, after {points}", epoch=epoch.name,
                       arc=float(arcs.max()), most=limits.largest_arc_m,
                       points=list_some(after, SHOWN))  # fmt: skip
        log.warning(file, text)


def is_within_noise(epoch, dof):
    """Whether the elevations of an Epoch are all the same but for their errors (chi2 or F, 5 %)."""
    if not dof:
        return False
    weights = epoch.u_m**-2.0
    off = epoch.z_m - np.average(epoch.z_m, weights=weights)
    weighed, free = float(off**2 @ weights), len(off) - 1
    chance = (
        scipy.stats.chi2.sf(weighed, free)
        if np.isinf(dof)
        else scipy.stats.f.sf(weighed / free, free, dof)
    )
    return bool(chance > WITHIN_NOISE)
