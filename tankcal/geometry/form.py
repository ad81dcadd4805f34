"""Form of a shell: departures from a circle as Fourier modes of the azimuth.

Mode k >= 2 of the outline has the prior variance amplitude k^-3 (dents, ovality, plates that do not
join to a circle).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

HARMONICS = 36  # highest mode of a smoothed outline: it resolves a dent of 10 deg
FORM_MODES = 100  # highest mode between points; higher modes have 2.5e-4 of the variance


@dataclass(frozen=True)
class Sample:
    """Measured radii of a section, or of a course whose points are not level.

    Attributes
    ----------
    azimuth_rad, radius_m : ndarray, shape (n,)
        Azimuths and radii about the centre, rad and m.
    covariance_m2 : ndarray, shape (n, n) or (n,)
        Covariance, or variances, of the radii, m2.
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    centre_m : ndarray, shape (2,)
        x and y of the centre to which the radii refer, m.
    """

    azimuth_rad: np.ndarray
    radius_m: np.ndarray
    covariance_m2: np.ndarray
    zeta: np.ndarray
    centre_m: np.ndarray


def harmonics(azimuth_rad, highest, derivative=0):
    """Return the columns 1, cos a, sin a, cos 2a, sin 2a, ... or their first derivatives.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        a, rad.
    highest : int
        Highest multiple of a.
    derivative : int, optional
        Order of the derivative, 0 or 1.

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
    """Return cosines and sines of multiples of azimuths.

    Products of exp(i k a) are ten times as fast as calls of cos and sin.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        a, rad.
    highest : int
        Highest multiple of a.

    Returns
    -------
    cos, sin : ndarray, shape (n, highest)

    Examples
    --------
    >>> multiples([np.pi / 3], 3)[0].round(9)
    array([[ 0.5, -0.5, -1. ]])
    """
    powers = np.empty((highest, len(azimuth_rad)), dtype=complex)
    powers[:1] = np.exp(1j * np.asarray(azimuth_rad, dtype=float))
    count = 1
    # Doubling: exp(i (j + known) a) = exp(i j a) exp(i known a), so rounding grows as
    # log2(highest).
    while count < highest:
        added = min(count, highest - count)
        np.multiply(powers[:added], powers[count - 1], out=powers[count : count + added])
        count += added
    return powers.real.T, powers.imag.T


def mode_variances(highest):
    """Return prior variances of the cos and sin amplitudes of modes 2..highest: k^-3.

    Parameters
    ----------
    highest : int
        Highest mode.

    Returns
    -------
    ndarray, shape (2 (highest - 1),)
        Variances for an amplitude of 1.

    Examples
    --------
    >>> mode_variances(3).round(4)
    array([0.125, 0.125, 0.037, 0.037])
    """
    return np.repeat(np.arange(2.0, highest + 1) ** -3, 2)


def unit_form(azimuth_rad, highest=FORM_MODES):
    """Return the standard deviations of each mode at azimuths, for a form of amplitude 1.

    Parameters
    ----------
    azimuth_rad : array_like, shape (n,)
        Azimuths, rad.
    highest : int, optional
        Highest mode.

    Returns
    -------
    ndarray, shape (n, 2 (highest - 1))

    Examples
    --------
    >>> unit_form([0.0], 3).round(4)
    array([[0.3536, 0.    , 0.1925, 0.    ]])
    """
    # The first three columns are radius and centre, which have no prior.
    return harmonics(azimuth_rad, highest)[:, 3:] * np.sqrt(mode_variances(highest))


def free_columns(azimuth_rad, zeta, degree):
    """Return the design columns of the parameters without prior.

    The columns are 1, cos a, sin a (radius and centre); from degree 1 on, also their products with
    zeta (taper and lean); at degree 2 (barrel), also the Legendre polynomial (3 zeta^2 - 1) / 2 of
    the radius.

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
    """Return L^-1 array (or L^-T array) with covariance = L L'.

    Parameters
    ----------
    array : ndarray, shape (n, ...)
    covariance : ndarray, shape (n, n) or (n,)
        Covariance, or variances.
    transposed : bool, optional
        True: L^-T.

    Returns
    -------
    ndarray
        Same shape as `array`.

    Examples
    --------
    >>> whiten(np.array([[2.0], [6.0]]), np.array([4.0, 9.0])).ravel()
    array([1., 2.])
    """
    if np.ndim(covariance) == 1:
        return array / np.sqrt(covariance)[:, None]
    factor = np.linalg.cholesky(covariance)
    return scipy.linalg.solve_triangular(factor, array, lower=True, trans=int(transposed))
