"""Outline r(azimuth) of a section, smoothed by harmonics.

Azimuths count clockwise from +y, so a point of the outline is (x + r sin a, y + r cos a). An
outline is linear in its parameters, and the parameters are linear in the measured radii.

The estimator is equal for all sections, regardless of the number and spacing of points. It was
tested on six families of walls that differ from its model. It is at least as close to the wall as a
periodic spline through evenly spaced points, and twice as close for a noise of 10 mm.

Form of a shell
---------------

Mode k >= 2 of the outline has the prior variance amplitude k^-3 (dents, ovality, plates that do not
join to a circle).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import whitener
from tankcal.covariance import PointCovariance
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.quadrature import panels, polar_products
from tankcal.units import FULL_TURN

HARMONICS = 36  # highest mode of a smoothed outline: it resolves a dent of 10 deg
FORM_MODES = 100  # highest mode between points; higher modes have 2.5e-4 of the variance
PANELS = 4 * HARMONICS  # panels around the turn: r^2 has twice the harmonics; four nodes a panel


@dataclass(frozen=True)
class Sample:
    """Measured radii of a section, or of a course whose points are not level.

    Attributes
    ----------
    azimuth_rad, radius_m : ndarray, shape (n,)
        Azimuths and radii about the centre, rad and m.
    covariance_m2 : PointCovariance
        Covariance of the radii, m2.
    zeta : ndarray, shape (n,)
        Height within the course, -1 at its bottom to +1 at its top.
    centre_m : ndarray, shape (2,)
        x and y of the centre to which the radii refer, m.
    """

    azimuth_rad: np.ndarray
    radius_m: np.ndarray
    covariance_m2: PointCovariance
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


@dataclass(frozen=True)
class Outline:
    """Outline of a section: r(azimuth) = basis(azimuth) @ parameters about (x_m, y_m).

    Attributes
    ----------
    x_m, y_m : float
        Centre, m.
    parameters : ndarray, shape (p,)
        Coefficients of the harmonics, m.
    from_radii : ndarray, shape (p, n)
        Derivative of the parameters by the n measured radii.
    azimuth_rad : ndarray, shape (n,)
        Azimuths of the measured radii, rad.
    form_m2 : float
        Amplitude of the form of the shell, m2.
    """

    x_m: float
    y_m: float
    parameters: np.ndarray
    from_radii: np.ndarray
    azimuth_rad: np.ndarray
    form_m2: float

    def basis(self, azimuth_rad, derivative=0):
        """Return the functions (len(azimuth), p) of the parameters, or their derivatives."""
        return harmonics(azimuth_rad, (len(self.parameters) - 1) // 2, derivative)

    def radius_m(self, azimuth_rad, derivative=0):
        """Return the radius (len(azimuth),) at each azimuth, or its derivative by the azimuth."""
        return self.basis(azimuth_rad, derivative) @ self.parameters

    def nodes(self):
        """Return azimuths and weights of a rule that integrates r^2 over the full turn."""
        return panels(np.linspace(0.0, FULL_TURN, PANELS + 1), 4)

    def area_m2(self):
        """Return A = 1/2 integral of r^2 over the full turn, by Gaussian quadrature."""
        azimuth, weight = self.nodes()
        return float(polar_products(self.radius_m(azimuth), weight)[0, 0])

    def unseen_form_m(self, azimuth_rad):
        """Return errors (len(azimuth), modes) of the outline for one sd of each mode of the form.

        The error is the outline fitted to the mode at the points, less the mode.
        """
        fitted_mode = self.basis(azimuth_rad) @ (self.from_radii @ unit_form(self.azimuth_rad))
        return np.sqrt(self.form_m2) * (fitted_mode - unit_form(azimuth_rad))

    def modes_m(self, highest=6):
        """Return cos and sin amplitudes (highest + 1, 2) of modes; row 0 is the mean radius."""
        azimuth = np.arange(720) * FULL_TURN / 720
        spectrum = np.fft.rfft(self.radius_m(azimuth)) / 360
        spectrum[0] /= 2
        return np.column_stack([spectrum.real, -spectrum.imag])[: highest + 1]


def polar(xy_m, x_m, y_m):
    """Return azimuths and distances of points about a centre.

    Parameters
    ----------
    xy_m : array_like, shape (n, 2)
        Points, m.
    x_m, y_m : float
        Centre, m.

    Returns
    -------
    azimuth_rad : ndarray, shape (n,)
        0 to 2 pi, clockwise from +y, rad.
    radius_m : ndarray, shape (n,)
        m.

    Examples
    --------
    >>> polar(np.array([[1.0, 0.0], [0.0, 2.0]]), 0.0, 0.0)
    (array([1.57079633, 0.        ]), array([1., 2.]))
    """
    d = np.asarray(xy_m) - (x_m, y_m)
    return np.arctan2(d[:, 0], d[:, 1]) % FULL_TURN, np.hypot(d[:, 0], d[:, 1])


def radii_square_to_axis(azimuth_rad, radius_m, slope):
    """Return radii of a horizontal cut, corrected for the ellipse due to the lean of the axis.

    A cylinder that leans by m has a horizontal cut of semi-axes r and r sqrt(1 + m^2). The ratio of
    its radius to the distance from the axis is (1 - (n . s)^2 / (1 + m^2))^(-1/2) in the direction
    n. The factor (1 + m^2)^(1/4) preserves the area of the cut, so a cylinder becomes a circle of
    equal area.

    Parameters
    ----------
    azimuth_rad, radius_m : ndarray, shape (n,)
        Azimuths and radii about the axis, rad and m.
    slope : array_like, shape (2,)
        Slope of the axis: metres in x and y per metre of height.

    Returns
    -------
    ndarray, shape (n,)
        Corrected radii, m.

    Examples
    --------
    >>> radii_square_to_axis(np.array([0.0, np.pi / 2]), np.array([1.0, 1.25]), (0.75, 0.0)) ** 2
    array([1.25, 1.25])
    """
    steep = 1 + slope[0] ** 2 + slope[1] ** 2
    lean = slope[0] * np.sin(azimuth_rad) + slope[1] * np.cos(azimuth_rad)
    return radius_m * steep**0.25 * np.sqrt(1 - lean**2 / steep)


def smooth_outline(xy_m, x_m, y_m, noise_m2, form_m2, away, degree):
    """Return an outline smoothed by harmonics, from points that may not be level.

    The model is r(a) with harmonics to order 36 (prior variance form_m2 k^-3 of mode k >= 2).
    Radius and centre have no prior, nor have taper and lean (from degree 1) and the barrel (degree
    2).

    Parameters
    ----------
    xy_m : array_like, shape (n, 2)
        Points, m.
    x_m, y_m : float
        Centre, m.
    noise_m2 : PointCovariance or ndarray, shape (n, n) or (n,)
        Covariance, or variances, of the measured radii, m2.
    form_m2 : float
        Amplitude of the form of the shell, m2.
    away : ndarray, shape (n,)
        Heights of the points above the outline, in halves of the course.
    degree : int
        0, 1 or 2.

    Returns
    -------
    Outline

    Raises
    ------
    SolutionError
        If the points do not determine the parameters without prior.
    """
    azimuth, radius = polar(xy_m, x_m, y_m)
    free = free_columns(azimuth, away, degree)
    # Columns scaled to unit prior variance: the prior adds 1 to the diagonal of the normal matrix.
    waves = np.sqrt(form_m2) * unit_form(azimuth, HARMONICS)
    solution = _solve_regularised(np.hstack([free, waves]), free.shape[1], noise_m2)
    sd = np.sqrt(form_m2 * mode_variances(HARMONICS))[:, None]
    from_radii = np.vstack([solution[:3], sd * solution[free.shape[1] :]])
    if degree == 2:
        from_radii[0] -= 0.5 * solution[6]  # (3 zeta^2 - 1) / 2 at the height of the outline
    return Outline(
        x_m=x_m,
        y_m=y_m,
        parameters=from_radii @ radius,
        from_radii=from_radii,
        azimuth_rad=azimuth,
        form_m2=form_m2,
    )


def _solve_regularised(design, free, noise_m2):
    """Return estimates (p, n) by the radii, with a unit prior on columns from `free` on."""
    whiten = whitener(noise_m2)
    white = whiten(design)
    normal = white.T @ white
    bound = np.arange(free, len(normal))
    normal[bound, bound] += 1.0
    if np.linalg.matrix_rank(normal[:free, :free]) < free:
        raise SolutionError(
            message(
                "section_undetermined",
                "the points of a section do not determine its centre and radius",
            )
        )
    # (A' Q^-1 A + prior)^-1 A' Q^-1, one column for each radius.
    return np.linalg.solve(normal, whiten(white, transposed=True).T)


def radii_by_coordinates(outline, xy_m):
    """Return the derivative of the radius at fixed azimuth by x and y of its point.

    The shift of a point along the outline has no effect: dr = n . dp, with n the normal of the
    outline, scaled to a radial component of one: (sin a - r'/r cos a, cos a + r'/r sin a).

    Parameters
    ----------
    outline : Outline
    xy_m : array_like, shape (n, 2)
        Points, m.

    Returns
    -------
    ndarray, shape (n, 2)
        Derivative of each radius by its point; other points have no effect.
    """
    azimuth, radius = polar(xy_m, outline.x_m, outline.y_m)
    # Slope r'/r of the outline: the tangential shift of a point changes r at a fixed azimuth.
    slope = outline.radius_m(azimuth, derivative=1) / radius
    sin, cos = np.sin(azimuth), np.cos(azimuth)
    return np.column_stack([sin - slope * cos, cos + slope * sin])
