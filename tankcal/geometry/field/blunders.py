"""Blunders among the readings of a wall: each tested against the wall as all others have it.

With V the covariance of readings (field and noise) and X what no prior binds,

    P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1,  e = P y:

a reading without which the others predict y_i - e_i / P_ii, with the variance 1 / P_ii of the
difference, is w_i = e_i / sqrt(P_ii) of its standard deviations off. Readings S that were set aside
are predicted by the rest: P_SS^-1 e_S, of covariance P_SS^-1. What agrees with its neighbours
along the wall is wall, however far both depart.

Source: Cook & Weisberg 1982 (deletion residuals); Baarda 1968.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from tankcal.adjust import CRITICAL, snoop
from tankcal.geometry.field.amplitudes import likely_variances
from tankcal.geometry.field.covariances import Covariances
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, invert
from tankcal.geometry.field.sites import free_design

MOST_ROUNDS = 4  # of amplitudes from the accepted readings, and tests of all with these
FEW = 0.005  # of the readings: when no more of them change sides, the amplitudes stay
AT_ONCE = 0.9


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
    """

    accepted: np.ndarray
    departure_m: np.ndarray
    w: np.ndarray
    sd_m: np.ndarray


def find_blunders(sites, radius_m, variance_m2, nominal_m, accepted):
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

    Returns
    -------
    Tested
    """
    covariances, design = Covariances(sites, nominal_m), free_design(sites)[0]
    left = radius_m - radius_m.mean()
    for _ in range(MOST_ROUNDS):
        known = sites.take(accepted)
        variances, noise = likely_variances(
            known, radius_m[accepted], variance_m2[accepted], nominal_m
        )
        whole = covariances.total(variances)
        whole.flat[:: len(whole) + 1] += noise * variance_m2 + LEAST_NOISE_M**2
        precision = restricted_precision(whole, design)
        found = snoop_wall(precision, precision @ left, accepted)
        changed, accepted = np.mean(found.accepted != accepted), found.accepted
        if changed <= FEW:
            break
    return found


def restricted_precision(covariance, design):
    """P of the module's heading."""
    inverse = invert(covariance)[1]
    by_design = inverse @ design
    normal = scipy.linalg.pinvh(design.T @ by_design)  # some points may hardly bear on anything
    return inverse - by_design @ normal @ by_design.T


def snoop_wall(precision, pull, accepted, may_go=True, most_sd_m=np.inf):
    """`Tested` after setting aside one reading after another, of those that may go.

    most_sd_m  of a departure, beyond which no other reading controls it: then it stays
    """

    def tests(found):
        return found.accepted, np.abs(found.w) * may_go * (found.sd_m < most_sd_m), CRITICAL

    def again(before, goes, comes):
        return against_others(precision, pull, before.accepted & ~goes | comes)

    start = against_others(precision, pull, accepted)
    return snoop(start, tests, again, at_once=AT_ONCE, returns=1).adjustment


def against_others(precision, pull, accepted):
    """`Tested` with P and P y of the module's heading."""
    aside = np.flatnonzero(~accepted)
    departure, weight = pull.copy(), np.diag(precision).copy()
    if len(aside):
        among = np.linalg.inv(precision[np.ix_(aside, aside)])
        to = precision[:, aside] @ among
        departure -= to @ pull[aside]
        weight -= np.sum(to * precision[:, aside], axis=1)
        departure[aside], weight[aside] = among @ pull[aside], 1.0
        weight[aside] = 1 / np.diag(among)
        departure[aside] *= weight[aside]
    weight = np.maximum(weight, 1e-300)
    return Tested(accepted, departure / weight, departure / np.sqrt(weight), weight**-0.5)
