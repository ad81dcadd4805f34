"""Courses compared with each other: a pair that looks exchanged, and one that stands apart."""

from itertools import combinations

import numpy as np
from scipy.special import stdtr

EXCHANGED_SHARE, EXCHANGED_M = 0.4, 1.5e-3  # of the steps between courses: left, and saved
BY_CHANCE = 0.05  # of sound courses that scatter as much so many look so, at most
DRAWS = 1000  # of sound shells
FEWEST_COURSES = 4  # of which one is told from the others


def exchanged_courses(outside_m, plates_m, both):
    """The pair of courses that look exchanged, by the steps between neighbouring courses.

    Parameters
    ----------
    outside_m, plates_m : ndarray, shape (courses,)
        Radius of the outside, and plate with paint.
    both : sequence of int
        Courses that may be exchanged.

    Returns
    -------
    (int, int, float, float) or None
        The pair, the sum of the steps with it exchanged, and as it is, m; None: too little is
        saved, or courses whose inside radii scatter as much look so much better exchanged by
        chance in over one of twenty shells.

    Examples
    --------
    >>> plates = np.array([10, 9, 8, 7, 6.3, 6.3]) / 1000
    >>> inside = 6.5 + np.array([0.1, -0.2, 0.2, 0.0, -0.1, 0.1]) / 1000
    >>> exchanged_courses((inside + plates)[[0, 4, 2, 3, 1, 5]], plates, range(6))[:2]
    (1, 4)
    """
    if len(both) < 2:
        return None
    inside = outside_m - plates_m
    steps = float(_steps(inside))
    left, pairs = _steps_exchanged(outside_m, plates_m, both)
    best = int(np.argmin(left))
    if left[best] >= EXCHANGED_SHARE * steps or steps - left[best] <= EXCHANGED_M:
        return None
    sound = np.random.default_rng(0).normal(size=(DRAWS, len(inside))) * np.std(inside, ddof=1)
    shares = np.min(_steps_exchanged(sound + plates_m, plates_m, both)[0], axis=-1) / _steps(sound)
    if np.mean(shares <= left[best] / steps) > BY_CHANCE:
        return None
    return *pairs[best], float(left[best]), steps


def _steps_exchanged(outside_m, plates_m, both):
    """(..., k) steps between courses with each pair of them exchanged, and the pairs."""
    pairs, left = list(combinations(both, 2)), []
    for i, k in pairs:
        turned = outside_m.copy()
        turned[..., [i, k]] = outside_m[..., [k, i]]
        left.append(_steps(turned - plates_m))
    return np.stack(left, axis=-1), pairs


def _steps(radii_m):
    """(...) sum of the steps between neighbouring courses, of radii (..., courses)."""
    return np.abs(np.diff(radii_m, axis=-1)).sum(axis=-1)


def course_apart(inside_m, least_m):
    """The course that stands apart from all others, which scatter less; None: none does.

    Parameters
    ----------
    inside_m : ndarray, shape (courses,)
        Inside radii.
    least_m : float
        By how much at least.

    Returns
    -------
    (int, float) or None
        The course, and its radius over the mean of the others, m; None: of courses that scatter as
        the others do one in twenty shells or more has one so far off (Grubbs 1950, as a test of
        the radius by the mean and the standard deviation s of the other n - 1: d / s / sqrt(1 +
        1 / (n - 1)) is Student's t of n - 2 degrees of freedom).

    Examples
    --------
    >>> inside = 6.5 + np.array([7.2, -0.2, 0.2, 0.0, -0.1, 0.1]) / 1000
    >>> place, away = course_apart(inside, 2e-3)
    >>> place, round(1000 * away, 1)
    (0, 7.2)
    >>> course_apart(inside, 8e-3)
    """
    count = len(inside_m)
    if count < FEWEST_COURSES:
        return None
    others = (inside_m.sum() - inside_m) / (count - 1)
    away = inside_m - others
    place = int(np.argmax(np.abs(away)))
    sd = np.std(np.delete(inside_m, place), ddof=1) * np.sqrt(1 + 1 / (count - 1))
    by_chance = 2 * count * stdtr(count - 2, -abs(away[place]) / max(sd, 1e-9))
    is_apart = abs(away[place]) > least_m and by_chance < BY_CHANCE
    return (place, float(away[place])) if is_apart else None
