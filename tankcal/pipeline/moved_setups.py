"""Set-ups that were disturbed after the network: tested by the form that all others show.

A circle that was turned, or a station that was moved, changes all sights of a set-up to a wall
together, and no single one departs from its neighbours. With P the precision of the readings y of
the wall, without what is free, and A their derivative by the turn and the shift of a set-up,

    s = (A' P A)^-1 A' P y,     w^2 = s' A' P A s,  a chi-square of three where nothing moved.

A set-up that sees few places takes waves of the wall for a shift of its own: of six hits round a
ring five or seven waves look like one. Where the others see enough to tell them, the waves that
shells and foundations have are all but free, whatever the spectrum of the field says of them.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import chdtri

from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.blunders import restricted_precision
from tankcal.geometry.field.sites import free_design

ALPHA = 0.001  # of the test of a set-up, over the number of set-ups
ALPHA_RANGED = 0.01  # the same of its distances, in which slips are more common
WAVES = np.arange(2, 9)  # round a wall, of every course alike


def moved_setups(field, whole, names, columns, suspect_from, *, wave_m=0.0):
    """How much each set-up looks as if it had moved.

    Parameters
    ----------
    field : WallField
        Its first readings are those of set-ups.
    whole : ndarray, shape (n, n)
        Covariance of its readings, of the wall and their own.
    names : ndarray of str, shape (k,)
        Set-ups of the first k readings.
    columns : ndarray, shape (k, 3)
        Derivative of these by the turn of the set-up's circle, rad, and its shift in x and y, m.
    suspect_from : float
        Test quantity of the worst set-up, from which it is tested by all others alone.
    wave_m : float
        Standard deviation of each long wave of the wall, beside what the field has of it.

    Returns
    -------
    dict
        {set-up: (w, its turn alone rad, its shift alone (2,) m)}.
    """
    test = partial(_as_if_moved, columns)
    return _by_setup(field, whole, names, suspect_from, wave_m, test)[0]


def moved_or_ranged(field, whole, names, columns, along, suspect_from, *, wave_m=0.0):
    """The same, and how much each looks as if all its distances were too long, or too short.

    Parameters
    ----------
    field, whole, names, columns, suspect_from, wave_m
        As of `moved_setups`.
    along : ndarray, shape (k,)
        Derivative of the readings by an offset of the distances of their set-up.

    Returns
    -------
    moved : dict
        What `moved_setups` finds.
    ranged : dict
        {set-up: (w, by how much too long m)}.
    """
    tests = partial(_as_if_moved, columns), partial(_as_if_longer, along)
    return _by_setup(field, whole, names, suspect_from, wave_m, *tests)


def _by_setup(field, whole, names, suspect_from, wave_m, *tests):
    """For each test {set-up: test(which readings are its own, P, P y)}; the worst one of each by
    all other set-ups alone.
    """
    count, whole = len(names), whole + _waves(field.sites, wave_m)
    every, by_others = tested(field, whole, count), {}
    found = [
        {name: test(names == name, *every) for name in dict.fromkeys(names.tolist())}
        for test in tests
    ]
    for test, one in zip(tests, found, strict=True):
        suspect = max(one, key=lambda name, one=one: one[name][0])
        if one[suspect][0] <= suspect_from:
            continue
        mine = names == suspect
        if suspect not in by_others:
            other = _without(field, whole - field.covariance_m2, mine)
            by_others[suspect] = None if other is None else tested(field, other, count)
        if by_others[suspect] is not None:
            one[suspect] = test(mine, *by_others[suspect])
    return found


def tested(field, whole, count):
    """P and P y of the first readings of a field (`field.blunders`)."""
    precision = restricted_precision(whole, free_design(field.sites)[0])
    pull = precision @ (field.radius_m - field.radius_m.mean())
    return precision[:count, :count], pull[:count]


def _waves(sites, wave_m):
    """(n, n) covariance of the radii by waves of that height; none of a whole turn."""
    angles = np.outer(sites.azimuth_rad, WAVES)
    columns = wave_m * np.nan_to_num(np.hstack([np.cos(angles), np.sin(angles)]))
    columns[~np.isfinite(sites.azimuth_rad)] = 0.0
    return columns @ columns.T


def _without(field, more_m2, mine):
    """Covariance of the readings with amplitudes that those of a set-up do not tell; None: the
    others tell nothing.

    A set-up that was moved looks like a form of the wall, if it is asked itself how large that is.

    more_m2  of the readings beside the field and its noise: what shares causes, and waves
    """
    keep = np.ones(len(field.radius_m), dtype=bool)
    keep[: len(mine)] = ~mine
    noise = (field.noise_m2 + more_m2)[np.ix_(keep, keep)]
    if len(np.unique(field.sites.course[keep])) < len(np.unique(field.sites.course)):
        return None
    known = estimate_amplitudes(
        field.sites.take(keep), field.radius_m[keep], noise, field.nominal_m
    )
    return replace(field, amplitudes=known).covariance_m2 + more_m2


def _as_if_moved(columns, mine, precision, pull):
    """(w, turn, shift) of a set-up whose readings are mine: of all that may move at once, and of
    its circle, or its station, alone.
    """
    columns = columns * mine[:, None]
    scale = np.maximum(np.abs(columns).max(axis=0), 1e-9)
    columns = columns / scale
    normal, right = columns.T @ precision @ columns, columns.T @ pull
    statistic = float(right @ np.linalg.pinv(normal, rcond=1e-6, hermitian=True) @ right)
    turn = right[0] / max(normal[0, 0], 1e-300) / scale[0]
    shift = np.linalg.pinv(normal[1:, 1:], rcond=1e-6, hermitian=True) @ right[1:] / scale[1:]
    return np.sqrt(max(statistic, 0.0)), float(turn), tuple(shift.tolist())


def _as_if_longer(along, mine, precision, pull):
    """(w, by how much too long) of a set-up whose readings are mine."""
    column = along * mine
    weight = max(column @ precision @ column, 1e-300)
    value = float(column @ pull) / weight
    return float(abs(value) * np.sqrt(weight)), value


def worst_setup(tests):
    """What `moved_setups` found of the set-up that looks most as if it had moved.

    Returns
    -------
    dict or None
        setup, w, turn_arcsec, shift_mm, as messages have them; None where no test is significant.
    """
    name = max(tests, key=lambda one: tests[one][0])
    w, turn, shift = tests[name]
    if w <= critical_of_setup(len(tests)):
        return None
    return {
        "setup": name,
        "w": w,
        "turn_arcsec": float(np.degrees(turn) * 3600),
        "shift_mm": 1000 * float(np.hypot(*shift)),
    }


def critical_of_setup(count):
    """Test quantity from which one of so many set-ups counts as disturbed."""
    return float(np.sqrt(chdtri(3, ALPHA / max(count, 1))))


def critical_of_ranging(count):
    """Test quantity from which one of so many set-ups counts as one that ranged otherwise."""
    return float(np.sqrt(chdtri(1, ALPHA_RANGED / max(count, 1))))
