"""Test of set-ups that were disturbed after the network, by the form that the other set-ups show.

A rotated horizontal circle or a displaced station changes all sights of a set-up to a wall
together. No single sight then differs from its neighbours. Let P be the reduced weight matrix of
the wall readings y, with the free parameters eliminated. Let A be the derivative of y by the
rotation and the displacement of a set-up. Then

    s = (A' P A)^-1 A' P y,     w^2 = s' A' P A s,

and w^2 follows a chi-square distribution with three degrees of freedom for an undisturbed set-up.

A set-up that sees few places can show waves of the wall as an apparent displacement: of six hits
round a ring, five or seven waves look like one. If the other set-ups determine these waves, the
test gives them a large prior variance, whatever the estimated spectrum of the field.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import chdtri

from tankcal.adjust import noncentrality
from tankcal.geometry.field.amplitudes import estimate_amplitudes
from tankcal.geometry.field.blunders import restricted_precision
from tankcal.geometry.field.sites import free_design
from tankcal.pipeline.checks import limit_at
from tankcal.pipeline.checks.wall import girth_m
from tankcal.pipeline.wall.shared_unknowns import noise_of_wall

ALPHA = 0.001  # significance of the movement test, divided by the number of set-ups
ALPHA_RANGED = 0.01  # significance of the distance test; mistakes in distances are more common
WAVES = np.arange(2, 9)  # long waves round the wall, the same in all courses
TANGENT_LIMITS = "tangents"
SUSPECT = 2.0  # w of the worst set-up above which it is tested by the other set-ups


def moved_setups(field, whole, names, columns, suspect_from, *, wave_m=0.0):
    """Test whether each set-up was rotated or displaced.

    Parameters
    ----------
    field : WallField
        Field whose first k readings are those of the set-ups.
    whole : ndarray, shape (n, n)
        Covariance of the readings, m2: form of the wall and noise.
    names : ndarray of str, shape (k,)
        Set-up of each of the first k readings.
    columns : ndarray, shape (k, 3)
        Derivatives of these readings by the rotation of the horizontal circle, rad, and by the
        displacement of the set-up in x and y, m.
    suspect_from : float
        Test statistic above which the worst set-up is tested again by the other set-ups alone.
    wave_m : float
        Standard deviation of each long wave of the wall, in addition to the field, m.

    Returns
    -------
    dict
        {set-up: (w, rotation alone in rad, displacement alone (2,) in m)}.
    """
    test = partial(_test_of_movement, columns)
    return _test_setups(field, whole, names, suspect_from, wave_m, test)[0]


def moved_or_ranged(field, whole, names, columns, along, suspect_from, *, wave_m=0.0):
    """Test each set-up for movement, as in `moved_setups`, and for an offset of its distances.

    Parameters
    ----------
    field, whole, names, columns, suspect_from, wave_m
        See `moved_setups`.
    along : ndarray, shape (k,)
        Derivative of the readings by an offset of the distances of their set-up.

    Returns
    -------
    moved : dict
        Result of `moved_setups`.
    ranged : dict
        {set-up: (w, offset of its distances in m)}.
    """
    tests = partial(_test_of_movement, columns), partial(_test_of_distances, along)
    return _test_setups(field, whole, names, suspect_from, wave_m, *tests)


def _test_setups(field, whole, names, suspect_from, wave_m, *tests):
    """Results {set-up: test(mask of its readings, P, P y)} of each test.

    The worst set-up of each test is tested again by the other set-ups alone.
    """
    count, whole = len(names), whole + _waves(field.sites, wave_m)
    by_all, by_others = precision_and_pull(field, whole, count), {}
    tests_by_setup = [
        {name: test(names == name, *by_all) for name in dict.fromkeys(names.tolist())}
        for test in tests
    ]
    for test, statistics in zip(tests, tests_by_setup, strict=True):
        suspect = max(statistics, key=lambda name, statistics=statistics: statistics[name][0])
        if statistics[suspect][0] <= suspect_from:
            continue
        is_of_setup = names == suspect
        if suspect not in by_others:
            covariance = _covariance_by_others(field, whole - field.covariance_m2, is_of_setup)
            by_others[suspect] = (
                None if covariance is None else precision_and_pull(field, covariance, count)
            )
        if by_others[suspect] is not None:
            statistics[suspect] = test(is_of_setup, *by_others[suspect])
    return tests_by_setup


def precision_and_pull(field, covariance, count):
    """P and P y of the first `count` readings of a field (see `field.blunders`)."""
    precision = restricted_precision(covariance, free_design(field.sites)[0])
    pull = precision @ (field.radius_m - field.radius_m.mean())
    return precision[:count, :count], pull[:count]


def _waves(sites, wave_m):
    """Covariance (n, n) of radii by waves of standard deviation `wave_m`, m2.

    Readings without an azimuth, which are means round the wall, have no such waves.
    """
    angles = np.outer(sites.azimuth_rad, WAVES)
    columns = wave_m * np.nan_to_num(np.hstack([np.cos(angles), np.sin(angles)]))
    columns[~np.isfinite(sites.azimuth_rad)] = 0.0
    return columns @ columns.T


def _covariance_by_others(field, extra_m2, is_of_setup):
    """Covariance of the readings, m2, with amplitudes estimated without those of one set-up.

    A disturbed set-up looks like a form of the wall if its own readings determine the amplitudes.
    The result is None if the other readings do not cover all courses.

    Parameters
    ----------
    field : WallField
    extra_m2 : ndarray, shape (n, n)
        Covariance in addition to field and noise: shared causes and long waves, m2.
    is_of_setup : ndarray of bool, shape (k,)
        Readings of the set-up.
    """
    keep = np.ones(len(field.radius_m), dtype=bool)
    keep[: len(is_of_setup)] = ~is_of_setup
    noise = (field.noise_m2 + extra_m2)[np.ix_(keep, keep)]
    if len(np.unique(field.sites.course[keep])) < len(np.unique(field.sites.course)):
        return None
    amplitudes = estimate_amplitudes(
        field.sites.take(keep), field.radius_m[keep], noise, field.nominal_m
    )
    # Of `covariance_m2` only the amplitudes change; the noise of the set-up itself stays.
    return replace(field, amplitudes=amplitudes).covariance_m2 + extra_m2


def _test_of_movement(columns, is_of_setup, precision, pull):
    """Test statistic w, rotation alone and displacement alone of one set-up."""
    columns = columns * is_of_setup[:, None]
    # Equal scales of rotation and displacement: the pseudo-inverse then drops undetermined
    # directions.
    scale = np.maximum(np.abs(columns).max(axis=0), 1e-9)
    columns = columns / scale
    normal, right = columns.T @ precision @ columns, columns.T @ pull
    statistic = float(right @ np.linalg.pinv(normal, rcond=1e-6, hermitian=True) @ right)
    rotation = right[0] / max(normal[0, 0], 1e-300) / scale[0]
    shift = np.linalg.pinv(normal[1:, 1:], rcond=1e-6, hermitian=True) @ right[1:] / scale[1:]
    return np.sqrt(max(statistic, 0.0)), float(rotation), tuple(shift.tolist())


def _test_of_distances(along, is_of_setup, precision, pull):
    """Test statistic w and offset of the distances of one set-up, m."""
    column = along * is_of_setup
    weight = max(column @ precision @ column, 1e-300)
    value = float(column @ pull) / weight
    return float(abs(value) * np.sqrt(weight)), value


def worst_setup(tests):
    """Result of `moved_setups` for the set-up with the largest test statistic.

    Returns
    -------
    dict or None
        Keys setup, w, turn_arcsec and shift_mm; None if no test is significant.
    """
    name = max(tests, key=lambda setup: tests[setup][0])
    w, rotation, shift = tests[name]
    if w <= critical_of_setup(len(tests)):
        return None
    return {
        "setup": name,
        "w": w,
        "turn_arcsec": float(np.degrees(rotation) * 3600),
        "shift_mm": 1000 * float(np.hypot(*shift)),
    }


def critical_of_setup(count):
    """Critical value of w for a disturbed set-up, among `count` set-ups."""
    return float(np.sqrt(chdtri(3, ALPHA / max(count, 1))))


def critical_of_ranging(count):
    """Critical value of w for an offset of distances, among `count` set-ups."""
    return float(np.sqrt(chdtri(1, ALPHA_RANGED / max(count, 1))))


# ---- agreement of tangents with the wall and with each other, of a survey or a plan


@dataclass(frozen=True)
class TangentTests:
    """Tests of n sights, in the order of their file.

    Attributes
    ----------
    used : ndarray of bool, shape (n,)
        Whether the sight determines the wall.
    departure_m : ndarray, shape (n,)
        Outward discrepancy from the wall of the other sights, m; nan for check sights.
    w : ndarray, shape (n,)
        Discrepancy over its standard deviation; nan if not tested.
    redundancy : ndarray, shape (n,)
        Share of an error of the reading that appears in the discrepancy; nan if not tested.
    mdb_m : ndarray, shape (n,)
        Minimal detectable bias of the tangent's distance, m; nan if not tested.
    setups : dict
        {set-up: (w of movement, rotation in rad, displacement (2,) in m)} (`moved_setups`).
    """

    used: np.ndarray
    departure_m: np.ndarray
    w: np.ndarray
    redundancy: np.ndarray
    mdb_m: np.ndarray
    setups: dict


def least_tangents(job):
    """Recommended number of tangents per level for the circumference of the tank."""
    return limit_at(TANGENT_LIMITS, "tangents", "least", girth_m(job))


def judge_tangents(job, wall, touching):
    """`TangentTests` of the tangents of a wall."""
    n = len(job.tangents)
    adjusted = np.flatnonzero(~job.tangents.check)  # in the order of the job's points
    departure, w, redundancy, mdb = np.full((4, n), np.nan)
    departure[adjusted], w[adjusted] = wall.shell.residual_m, wall.shell.w
    used = np.zeros(n, dtype=bool)
    used[adjusted[wall.accepted]] = True
    order = np.concatenate([section.group.members for section in wall.sections])
    sites = len(wall.field.radius_m) - len(wall.readings)
    if sites != len(order):  # several sights share a cell
        return TangentTests(used, departure, w, redundancy, mdb, {})
    sight = adjusted[wall.accepted[order]]  # sight of each reading of the field
    field = wall.field
    # A field of points alone has its noise section by section; the tests include all covariances.
    covariance = field.covariance_m2 + noise_of_wall(wall) - field.noise_m2
    precision, pull = precision_and_pull(field, covariance, sites)
    weight = np.maximum(np.diag(precision), 1e-300)
    # Leave-one-out discrepancy P y / P_ii, and w = P y / sqrt(P_ii), as in data snooping.
    departure[sight], w[sight] = pull / weight, pull / np.sqrt(weight)
    variance_m2 = (job.tangents.sd_rad * touching.length_m) ** 2 + touching.hull.own_sd_m**2
    redundancy[sight] = np.clip(variance_m2[sight] * weight, 0, 1)
    mdb[sight] = noncentrality() / np.sqrt(weight)
    setups = moved_setups(
        field, covariance, np.array(job.tangents.setup)[sight], _columns(touching, sight), SUSPECT
    )
    return TangentTests(used, departure, w, redundancy, mdb, setups)


def _columns(touching, sights):
    """Derivatives (k, 3) of tangents by the rotation of the circle and shift of the station."""
    azimuth = touching.normal_rad[sights]
    length = np.where(touching.seen_right[sights], 1.0, -1.0) * touching.length_m[sights]
    return np.column_stack([length, np.sin(azimuth), np.cos(azimuth)])
