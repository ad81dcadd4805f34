"""Uncertainty of the mean radii of courses due to seams that no column of points meets.

The model contains two narrow seams along the whole shell, of depth d, width w and profile cos^2, at
random azimuths. Columns of points at the spacing s measure each seam with the area A = d w / 2
times 1 + q cos phi,

    q = 2 sinc(w / s) / (1 - (w / s)^2),

with phi the position between the columns, so two seams cause an error of standard deviation q A.
For s > w, a seam may be missed completely: q = 1. The readings determine seams that points do meet.

The columns of a course measure that course only. Errors of two courses are equal where their
columns are aligned; otherwise their correlation is that of the responses of both sets of columns to
a seam at a random azimuth.
"""

from math import factorial

import numpy as np

from tankcal.units import FULL_TURN

DEPTH_M, PART, WIDTH_M = 0.035, 0.0046, 0.8  # seam: depth, at most PART of the radius; width
SAME_RAD = 1e-9  # azimuths with a smaller difference are equal up to rounding
SHORTEST = 12.0  # waves shorter than WIDTH_M / 12 have a response to cos^2 below 1e-7
PER_WAVE = 4  # least number of grid places for each shortest wave: k d <= pi / 4
TERMS = 14  # terms of the series of exp(-i k d): truncation error below 1e-12


def hidden_covariance_m2(course, azimuth_rad, radius_m):
    """Return the covariance of mean radii of courses due to seams between their points.

    Parameters
    ----------
    course : ndarray of int, shape (n,)
        Course of each point: 0, 1, ...
    azimuth_rad : ndarray, shape (n,)
        Azimuths; nan for the mean of a full turn, which misses no seam.
    radius_m : float
        Radius of the tank, m.

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
    columns = [_find_columns(azimuth_rad[course == item]) for item in courses]
    size = np.array([_error_sd_m(gaps, radius_m) for _, gaps in columns])
    wave = np.arange(1, int(SHORTEST * FULL_TURN * radius_m / WIDTH_M) + 2)
    ratio = wave * WIDTH_M / (FULL_TURN * radius_m)
    responses = np.array([_spectrum(*item, wave) for item in columns]) * _seam_response(ratio)
    # Unit vectors of responses: their scalar products are the correlations of the errors.
    responses /= np.maximum(np.linalg.norm(responses, axis=1, keepdims=True), 1e-30)
    return np.outer(size, size) * (responses @ responses.conj().T).real


def hidden_seams_m(azimuth_rad, radius_m):
    """Return the standard uncertainty of a mean radius due to seams between the points, m.

    Each gap between columns has a weight equal to its share of the turn.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Azimuths of the points of a course.
    radius_m : float
        Radius of the tank, m.

    Examples
    --------
    >>> round(1e3 * hidden_seams_m(np.arange(72) * FULL_TURN / 72, 7.5), 2)
    0.2
    """
    return _error_sd_m(_find_columns(azimuth_rad)[1], radius_m)


def _find_columns(azimuth_rad):
    """Return ascending azimuths of columns, and the gap after each column, rad."""
    turns = np.unique(azimuth_rad[np.isfinite(azimuth_rad)] % FULL_TURN)
    gaps = np.diff(turns, append=turns[:1] + FULL_TURN)
    distinct = gaps > SAME_RAD  # equal up to rounding, also across the end of the turn
    return turns[distinct], gaps[distinct]


def _error_sd_m(gaps, radius_m):
    """Return the standard deviation of the mean radius due to seams, m."""
    if not len(gaps):
        return 0.0
    parts = 2 * _seam_response(np.maximum(WIDTH_M / (radius_m * gaps), 1.0))
    # A seam of area A changes the mean radius by A / (2 pi R).
    area = min(DEPTH_M, PART * radius_m) * WIDTH_M / 2
    return area / (FULL_TURN * radius_m) * float(np.sqrt(parts**2 @ gaps / FULL_TURN))


def _seam_response(ratio):
    """Return the response of the profile cos^2 of width w to a wave of length w / ratio."""
    # The limit at ratio = 1 is finite, but numerator and denominator vanish.
    ratio = np.where(np.abs(ratio - 1) < 1e-9, 1 + 1e-9, ratio)
    return np.sinc(ratio) / (1 - ratio**2)


def _spectrum(turns, gaps, wave):
    """Return the sum (k,) of share exp(-i wave azimuth) over columns, for waves 1, 2, ... (k,).

    The share of a column is the part of the turn for which it is the nearest column. Its azimuth is
    a grid place plus a remainder d, which enters as the series of exp(-i k d). Without the
    remainder, the correlation of two courses would depend on a rotation of the whole survey.
    """
    count = 1 << int(np.ceil(np.log2(PER_WAVE * len(wave))))
    share = (gaps + np.roll(gaps, 1)) / (2 * FULL_TURN)
    place = np.rint(turns / FULL_TURN * count).astype(int)
    remainder = turns - place * FULL_TURN / count
    spectrum = np.zeros(len(wave), dtype=complex)
    for order in reversed(range(TERMS)):  # Horner: sum of (-i k)^m / m! times the m-th moments
        moments = np.bincount(place % count, share * remainder**order / factorial(order), count)
        spectrum = spectrum * (-1j * wave) + np.fft.rfft(moments)[1 : len(wave) + 1]
    return spectrum
