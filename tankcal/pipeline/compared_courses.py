"""Comparison of courses: pairs that seem exchanged, and a course that differs from all others."""

from itertools import combinations

import numpy as np
from scipy.special import stdtr

# An exchange must leave at most this share of the sum of steps between courses, and reduce the sum
# by at least this length, m.
EXCHANGED_SHARE, EXCHANGED_M = 0.4, 1.5e-3
BY_CHANCE = 0.05  # largest probability of the same finding by chance, for valid courses
DRAWS = 1000  # number of simulated valid shells
FEWEST_COURSES = 4  # smallest number of courses for the test of a single course


def exchanged_courses(outside_m, plates_m, candidates):
    """Find the pair of courses that seem exchanged, by the steps between neighbouring courses.

    Parameters
    ----------
    outside_m, plates_m : ndarray, shape (courses,)
        Radius of the outside, and thickness of plate with paint.
    both : sequence of int
        Courses that may be exchanged.

    Returns
    -------
    (int, int, float, float) or None
        The pair, the sum of the steps after its exchange, and the sum as read, m. None if the
        exchange reduces the sum too little, or if an exchange improves more than one in twenty
        simulated shells with the same scatter as much by chance.

    Examples
    --------
    >>> plates = np.array([10, 9, 8, 7, 6.3, 6.3]) / 1000
    >>> inside = 6.5 + np.array([0.1, -0.2, 0.2, 0.0, -0.1, 0.1]) / 1000
    >>> exchanged_courses((inside + plates)[[0, 4, 2, 3, 1, 5]], plates, range(6))[:2]
    (1, 4)
    """
    if len(candidates) < 2:
        return None
    inside = outside_m - plates_m
    steps = float(_sum_steps(inside))
    sums, pairs = _sum_steps_exchanged(outside_m, plates_m, candidates)
    best = int(np.argmin(sums))
    if sums[best] >= EXCHANGED_SHARE * steps or steps - sums[best] <= EXCHANGED_M:
        return None
    simulated = np.random.default_rng(0).normal(size=(DRAWS, len(inside))) * np.std(inside, ddof=1)
    # Simulated shells have the scatter of the inside radii; their best exchange shows what chance
    # achieves.
    shares = np.min(
        _sum_steps_exchanged(simulated + plates_m, plates_m, candidates)[0], axis=-1
    ) / _sum_steps(simulated)
    if np.mean(shares <= sums[best] / steps) > BY_CHANCE:
        return None
    return *pairs[best], float(sums[best]), steps


def _sum_steps_exchanged(outside_m, plates_m, candidates):
    """Sums of steps (..., k) after the exchange of each of k pairs of courses, and the pairs."""
    pairs, sums = list(combinations(candidates, 2)), []
    for i, k in pairs:
        exchanged = outside_m.copy()
        exchanged[..., [i, k]] = outside_m[..., [k, i]]
        sums.append(_sum_steps(exchanged - plates_m))
    return np.stack(sums, axis=-1), pairs


def _sum_steps(radii_m):
    """Sum (...) of the steps between neighbouring courses, for radii (..., courses)."""
    return np.abs(np.diff(radii_m, axis=-1)).sum(axis=-1)


def course_apart(inside_m, least_m):
    """Find the course whose radius differs from all other courses.

    Parameters
    ----------
    inside_m : ndarray, shape (courses,)
        Inside radii.
    least_m : float
        Smallest difference.

    Returns
    -------
    (int, float) or None
        The course, and its radius less the mean radius of the others, m. None if one in twenty
        valid shells or more would have so large a difference by chance.

    Notes
    -----
    The test is that of Grubbs (1950). With the standard deviation s of the other n - 1 radii and
    the
    difference d from their mean, d / s / sqrt(1 + 1 / (n - 1)) is Student's t with n - 2 degrees of
    freedom.

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
    mean_of_others_m = (inside_m.sum() - inside_m) / (count - 1)
    away = inside_m - mean_of_others_m
    course = int(np.argmax(np.abs(away)))
    sd = np.std(np.delete(inside_m, course), ddof=1) * np.sqrt(1 + 1 / (count - 1))
    # Two-sided probability, times the number of courses because the most deviating course is
    # tested.
    probability = 2 * count * stdtr(count - 2, -abs(away[course]) / max(sd, 1e-9))
    is_apart = abs(away[course]) > least_m and probability < BY_CHANCE
    return (course, float(away[course])) if is_apart else None
