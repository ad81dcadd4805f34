"""The form of a shell: what departs from a circle, by its modes around the turn.

Mode k >= 2 of the outline has the variance amplitude k^-3 (dents, ovality, plates that do not meet
in a circle).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

HARMONICS = 36  # of a smoothed outline: a dent of 10 deg still shows, if the prior believes it
FORM_MODES = 100  # of the form that may lie between points; the others hold 2.5e-4 of its variance


@dataclass(frozen=True)
class Sample:
    """Measured radii of one section, or of one course whose points are not level.

    Attributes
    ----------
    azimuth_rad, radius_m : ndarray, shape (n,)
        About the centre of its circle, rad and m.
    covariance_m2 : ndarray, shape (n, n) or (n,)
        Covariance, or variances, of the radii, m2.
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    centre_m : ndarray, shape (2,)
        x and y that the radii are taken about, m.
    """

    azimuth_rad: np.ndarray
    radius_m: np.ndarray
    covariance_m2: np.ndarray
    zeta: np.ndarray
    centre_m: np.ndarray


def harmonics(azimuth_rad, highest, derivative=0):
    """Columns 1, cos a, sin a, cos 2a, sin 2a, ... or their first derivative.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        a, rad.
    highest : int
        The last multiple of a.
    derivative : int, optional
        0 or 1.

    Returns
    -------
    ndarray, shape (n, 2 highest + 1)

    Examples
    --------
    >>> harmonics([0.0], 2)
    array([[1., 1., 0., 1., 0.]])
    """
    cos, sin = multiples(azimuth_rad, highest)
    columns = np.empty((len(cos), 2 * highest + 1))
    if derivative == 0:
        columns[:, 0] = 1.0
        columns[:, 1::2], columns[:, 2::2] = cos, sin
    else:
        k = np.arange(1, highest + 1)
        columns[:, 0] = 0.0
        columns[:, 1::2], columns[:, 2::2] = -k * sin, k * cos
    return columns


def multiples(azimuth_rad, highest):
    """Cosines and sines of multiples of azimuths, by products of exp(i k a): ten times as fast.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        a, rad.
    highest : int
        The last multiple of a.

    Returns
    -------
    cos, sin : ndarray, shape (n, highest)

    Examples
    --------
    >>> multiples([np.pi / 3], 3)[0].round(9)
    array([[ 0.5, -0.5, -1. ]])
    """
    turned = np.empty((highest, len(azimuth_rad)), dtype=complex)
    turned[:1] = np.exp(1j * np.asarray(azimuth_rad, dtype=float))
    known = 1
    while known < highest:
        more = min(known, highest - known)
        np.multiply(turned[:more], turned[known - 1], out=turned[known : known + more])
        known += more
    return turned.real.T, turned.imag.T


def mode_variances(highest):
    """Prior variance of the cos and sin amplitudes of modes 2..highest over the amplitude: k^-3.

    Parameters
    ----------
    highest : int
        The last mode.

    Returns
    -------
    ndarray, shape (2 (highest - 1),)

    Examples
    --------
    >>> mode_variances(3).round(4)
    array([0.125, 0.125, 0.037, 0.037])
    """
    return np.repeat(np.arange(2.0, highest + 1) ** -3, 2)


def unit_form(azimuth_rad, highest=FORM_MODES):
    """One standard deviation of each mode of a form of amplitude one.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        Azimuths, rad.
    highest : int, optional
        The last mode.

    Returns
    -------
    ndarray, shape (n, 2 (highest - 1))

    Examples
    --------
    >>> unit_form([0.0], 3).round(4)
    array([[0.3536, 0.    , 0.1925, 0.    ]])
    """
    return harmonics(azimuth_rad, highest)[:, 3:] * np.sqrt(mode_variances(highest))


def free_columns(azimuth_rad, zeta, degree):
    """Columns of what no prior binds: radius and centre, taper and lean, barrel.

    1, cos a, sin a; from degree 1 on the same times zeta; at degree 2 the Legendre polynomial
    (3 zeta^2 - 1) / 2 of the radius alone.

    Parameters
    ----------
    azimuth_rad, zeta : ndarray, shape (n,)
        a, rad, and height within the course, -1 to 1.
    degree : int
        0, 1 or 2.

    Returns
    -------
    ndarray, shape (n, 3), (n, 6) or (n, 7)

    Examples
    --------
    >>> free_columns(np.array([0.0]), np.array([1.0]), 2)
    array([[1., 1., 0., 1., 1., 0., 1.]])
    """
    level = harmonics(azimuth_rad, 1)
    columns = [level, level * zeta[:, None], (1.5 * zeta**2 - 0.5)[:, None]]
    return np.hstack(columns[: degree + 1])


def whiten(array, covariance, transposed=False):
    """L^-1 array (or L^-T array) with covariance = L L'.

    Parameters
    ----------
    array : ndarray, shape (n, ...)
    covariance : ndarray, shape (n, n) or (n,)
        Covariance, or variances.
    transposed : bool, optional
        True: L^-T.

    Returns
    -------
    ndarray, as `array`

    Examples
    --------
    >>> whiten(np.array([[2.0], [6.0]]), np.array([4.0, 9.0])).ravel()
    array([1., 2.])
    """
    if np.ndim(covariance) == 1:
        return array / np.sqrt(covariance)[:, None]
    factor = np.linalg.cholesky(covariance)
    return scipy.linalg.solve_triangular(factor, array, lower=True, trans=int(transposed))
