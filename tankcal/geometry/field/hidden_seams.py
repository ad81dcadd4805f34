"""What seams that no column of points meets leave uncertain of the mean radii of the courses.

Two narrow seams run up the whole shell, of the depth d and the width w, cos^2 across, at random
places. Columns of points s apart take each for its area A = d w / 2 times 1 + q cos phi,

    q = 2 sinc(w / s) / (1 - (w / s)^2),

phi by its place between them, so two make an error of the standard deviation q A. Where s > w a
seam may be missed altogether: q = 1. Of seams that points do meet the readings tell.

A course is seen by its own columns. Where those of two courses stand one above another, both err
alike; elsewhere as far as the columns, passed through a seam, vary alike with its place.
"""

from math import factorial

import numpy as np

from tankcal.geometry.outlines import FULL_TURN

DEPTH_M, PART, WIDTH_M = 0.035, 0.0046, 0.8  # of a seam; depth as a part of the radius at most
SAME_RAD = 1e-9  # azimuths that differ by rounding alone
SHORTEST = 12.0  # part of WIDTH_M: shorter waves are 1e-7 of what passes through cos^2
PER_WAVE = 4  # places of the grid for each of the shortest waves, at least: k d <= pi / 4
TERMS = 14  # of the series of exp(-i k d): its error is below 1e-12


def hidden_covariance_m2(course, azimuth_rad, radius_m):
    """Covariance of the mean radii of courses by seams that their points need not meet.

    Parameters
    ----------
    course : ndarray of int, shape (n,)
        Of each point: 0, 1, ...
    azimuth_rad : ndarray, shape (n,)
        nan: a whole turn, which misses nothing.
    radius_m : float
        Of the tank, m.

    Returns
    -------
    ndarray, shape (courses, courses)
        m2.

    Examples
    --------
    >>> around = np.arange(24) * FULL_TURN / 24
    >>> course = np.repeat([0, 1, 2], 24)
    >>> turned = np.concatenate([around, around, around + FULL_TURN / 48])
    >>> covariance = hidden_covariance_m2(course, turned, 7.5)
    >>> np.round(covariance / covariance[0, 0], 3)
    array([[ 1.   ,  1.   , -0.373],
           [ 1.   ,  1.   , -0.373],
           [-0.373, -0.373,  1.   ]])
    """
    courses = range(int(course.max(initial=-1)) + 1)
    columns = [_columns(azimuth_rad[course == one]) for one in courses]
    size = np.array([_size_m(apart, radius_m) for _, apart in columns])
    wave = np.arange(1, int(SHORTEST * FULL_TURN * radius_m / WIDTH_M) + 2)
    ratio = wave * WIDTH_M / (FULL_TURN * radius_m)
    passed = np.array([_spectrum(*one, wave) for one in columns]) * _seam(ratio)
    passed /= np.maximum(np.linalg.norm(passed, axis=1, keepdims=True), 1e-30)
    return np.outer(size, size) * (passed @ passed.conj().T).real


def hidden_seams_m(azimuth_rad, radius_m):
    """Standard uncertainty of the mean radius of a course by seams its points need not meet, m.

    Gaps count by their share of the turn.

    Examples
    --------
    >>> round(1e3 * hidden_seams_m(np.arange(72) * FULL_TURN / 72, 7.5), 2)
    0.2
    """
    return _size_m(_columns(azimuth_rad)[1], radius_m)


def _columns(azimuth_rad):
    """Azimuths of columns, ascending, and what parts each from the next."""
    around = np.unique(azimuth_rad[np.isfinite(azimuth_rad)] % FULL_TURN)
    apart = np.diff(around, append=around[:1] + FULL_TURN)
    once = apart > SAME_RAD  # the end of a turn may stand beside its start
    return around[once], apart[once]


def _size_m(apart, radius_m):
    if not len(apart):
        return 0.0
    parts = 2 * _seam(np.maximum(WIDTH_M / (radius_m * apart), 1.0))
    area = min(DEPTH_M, PART * radius_m) * WIDTH_M / 2
    return area / (FULL_TURN * radius_m) * float(np.sqrt(parts**2 @ apart / FULL_TURN))


def _seam(ratio):
    """What passes through cos^2 of the width w, of a wave that is w / ratio long."""
    ratio = np.where(np.abs(ratio - 1) < 1e-9, 1 + 1e-9, ratio)
    return np.sinc(ratio) / (1 - ratio**2)


def _spectrum(around, apart, wave):
    """(k,) sum of share exp(-i wave azimuth) over columns; waves are 1, 2, ... (k,).

    A column has the share of the turn for which it is the nearest. Its azimuth is a place of the
    grid and a rest d. The rest enters by the series of exp(-i k d): without it the correlation of
    two courses would change when the whole survey is turned.
    """
    count = 1 << int(np.ceil(np.log2(PER_WAVE * len(wave))))
    share = (apart + np.roll(apart, 1)) / (2 * FULL_TURN)
    place = np.rint(around / FULL_TURN * count).astype(int)
    rest = around - place * FULL_TURN / count
    found = np.zeros(len(wave), dtype=complex)
    for order in reversed(range(TERMS)):  # Horner: sum of (-i k)^m / m! times the m-th moments
        moments = np.bincount(place % count, share * rest**order / factorial(order), count)
        found = found * (-1j * wave) + np.fft.rfft(moments)[1 : len(wave) + 1]
    return found
