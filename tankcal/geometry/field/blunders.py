"""Blunders among the readings of a wall: each tested against the wall as all others have it.

With V the covariance of readings (field and noise) and X what no prior binds,

    P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1,  e = P y:

a reading without which the others predict y_i - e_i / P_ii, with the variance 1 / P_ii of the
difference, is w_i = e_i / sqrt(P_ii) of its standard deviations off. Readings S that were set aside
are predicted by the rest: P_SS^-1 e_S, of covariance P_SS^-1. Where the rest does not tell what no
prior binds (all points of a course, or of a ring, were set aside) P_SS is singular; its pseudo-
inverse compares them with each other, that much free. What agrees with its neighbours along the
wall is wall, however far both depart.

Source: Cook & Weisberg 1982 (deletion residuals); Baarda 1968.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from tankcal.adjust import CRITICAL, snoop
from tankcal.geometry.field.amplitudes import likely_variances
from tankcal.geometry.field.cells import MOST_SITES
from tankcal.geometry.field.covariances import Covariances
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, invert
from tankcal.geometry.field.precision import Precision
from tankcal.geometry.field.sites import free_design
from tankcal.geometry.outlines import FULL_TURN

MOST_ROUNDS = 4  # of amplitudes from the accepted readings, and tests of all with these
FEW = 0.005  # of the readings: when no more of them change sides, the amplitudes stay
AT_ONCE = 0.9
PIECE = 200  # readings that are tested together, about, where all are more than a field takes
MOST_SD = 30  # of its own before: a reading that the others predict no better is not controlled
NOTHING_LEFT = 1e-9  # of the largest eigenvalue of P_SS: what is smaller is zero but for rounding


@dataclass(frozen=True)
class Tested:
    """Readings accepted or set aside, and how far each is from what the accepted others predict.

    Attributes
    ----------
    accepted : ndarray of bool, shape (n,)
    departure_m : ndarray, shape (n,)
        Outwards, from the wall as the others have it, m.
    w : ndarray, shape (n,)
        Departure over its standard deviation.
    sd_m : ndarray, shape (n,)
        That; vast of a reading that no other one controls.
    sizes_m2 : ndarray, shape (components + 1,), optional
        Variances of the components by which they were tested, and factor of that of the readings.
    """

    accepted: np.ndarray
    departure_m: np.ndarray
    w: np.ndarray
    sd_m: np.ndarray
    sizes_m2: np.ndarray | None = None


def nothing_tested(accepted):
    """`Tested` to be filled."""
    nothing = np.zeros((3, len(accepted)))
    return Tested(accepted.copy(), *nothing)


def find_blunders(sites, radius_m, variance_m2, nominal_m, accepted, barred=None, may_go=True):
    """Test every reading of a wall by all others, with amplitudes that the accepted ones tell.

    Parameters
    ----------
    sites : Sites
        Of n readings.
    radius_m : ndarray, shape (n,)
        Distances from the axis, m.
    variance_m2 : ndarray, shape (n,)
        Of the readings, believed in relation to each other.
    nominal_m : float
        Radius of the tank, m.
    accepted : ndarray of bool, shape (n,)
        What is believed at first.
    barred : ndarray of bool, shape (n,), optional
        Readings that stay aside, whatever the others say; None: none.
    may_go : ndarray of bool, shape (n,), optional
        Readings that may be set aside; the others stay, and the amplitudes are learned from them,
        too: a wall that is as rough as they say is less known between the readings.

    Returns
    -------
    Tested
    """
    barred = np.zeros(len(sites), dtype=bool) if barred is None else barred
    may_go = np.broadcast_to(may_go, len(sites))
    accepted = (accepted | ~may_go) & ~barred
    pieces = [Piece(sites, members, nominal_m) for members in _pieces(sites)]
    left, found, sizes = radius_m - radius_m.mean(), nothing_tested(accepted), None
    for _ in range(MOST_ROUNDS):
        known = sites.take(accepted)
        some = radius_m[accepted], variance_m2[accepted]
        sizes = likely_variances(known, *some, nominal_m, sizes)
        variances, noise = sizes[:-1], sizes[-1]
        for piece in pieces:
            own = piece.members
            own_noise = noise * variance_m2[own] + LEAST_NOISE_M**2
            precision, before_m = piece.precision(variances, own_noise)
            pull, most = precision @ left[own], MOST_SD * before_m
            tested = snoop_wall(precision, pull, accepted[own], may_go[own], most, barred[own])
            for name in ("accepted", "departure_m", "w", "sd_m"):
                getattr(found, name)[own] = getattr(tested, name)
        changed, accepted = np.mean(found.accepted != accepted), found.accepted.copy()
        if changed <= FEW:
            break
    return replace(found, sizes_m2=sizes)


def _pieces(sites):
    """Lists of readings that are tested together: all, or of many those of sectors of courses.

    A piece is about as many courses high as there are pieces around them.
    """
    count = 1 if len(sites) <= MOST_SITES else len(sites) / PIECE
    every = np.argsort(sites.course, kind="stable")
    found = []
    for belt in np.array_split(np.arange(sites.course.max() + 1), _belts(count, sites)):
        members = every[np.isin(sites.course[every], belt)]
        order = members[np.argsort(sites.azimuth_rad[members] % FULL_TURN, kind="stable")]
        found += np.array_split(order, max(round(count * len(order) / len(sites)), 1))
    return found


def _belts(count, sites):
    """Number of belts of courses for that many pieces."""
    return int(np.clip(round(np.sqrt(count)), 1, sites.course.max() + 1))


class Piece:
    """Some of the readings, and their covariance by the wall."""

    def __init__(self, sites, members, nominal_m):
        self.members, chosen = members, sites.take(members)
        self._covariances = Covariances(chosen, nominal_m)
        self._design = free_design(chosen)[0]

    def precision(self, variances_m2, noise_m2):
        """`Precision` with variances (n,) of the noise, and (n,) sds of the readings before, m."""
        whole = self._covariances.total(variances_m2)
        whole.flat[:: len(whole) + 1] += noise_m2
        before = np.sqrt(np.diag(whole))
        return Precision(whole, self._design), before


def restricted_precision(covariance, design):
    """P of the module's heading, written out."""
    inverse = invert(covariance)[1]
    by_design = inverse @ design
    normal = scipy.linalg.pinvh(design.T @ by_design)  # some points may hardly bear on anything
    inverse -= (by_design @ normal) @ by_design.T
    return inverse


def snoop_wall(precision, pull, accepted, may_go=True, most_sd_m=np.inf, barred=False):
    """`Tested` after setting aside one reading after another, of those that may go.

    most_sd_m  of a departure, beyond which no other reading controls it: then it stays
    barred     of readings that stay aside
    """

    def tests(found):
        statistic = np.abs(found.w) * may_go * (found.sd_m < most_sd_m)
        return found.accepted, np.where(barred, np.nan, statistic), CRITICAL

    def again(before, goes, comes):
        return against_others(precision, pull, before.accepted & ~goes | comes)

    start = against_others(precision, pull, accepted)
    return snoop(start, tests, again, at_once=AT_ONCE, returns=1).adjustment


def carried_over(precision, aside):
    """(P_SS^-1, P_.S P_SS^-1) of readings S that are set aside: what takes them out of P."""
    among = scipy.linalg.pinvh(precision[np.ix_(aside, aside)], rtol=NOTHING_LEFT)
    return among, precision[:, aside] @ among


def against_others(precision, pull, accepted):
    """`Tested` with P and P y of the module's heading."""
    aside = np.flatnonzero(~accepted)
    departure, weight = pull.copy(), precision.diagonal().copy()
    if len(aside):
        among, to = carried_over(precision, aside)
        departure -= to @ pull[aside]
        weight -= np.sum(to * precision[:, aside], axis=1)
        departure[aside], weight[aside] = among @ pull[aside], 1.0
        weight[aside] = 1 / np.diag(among)
        departure[aside] *= weight[aside]
    weight = np.maximum(weight, 1e-300)
    return Tested(accepted, departure / weight, departure / np.sqrt(weight), weight**-0.5)
