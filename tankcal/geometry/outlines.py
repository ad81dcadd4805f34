"""The irregular outline r(azimuth) of a section: interpolated, or smoothed by harmonics.

Azimuths count clockwise from +y, so a point of the outline is (x + r sin a, y + r cos a). An
outline is linear in its parameters and they are linear in the measured radii.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.interpolate
import scipy.sparse

from tankcal.errors import SolutionError
from tankcal.geometry.form import (
    HARMONICS,
    Form,
    free_columns,
    harmonics,
    mode_variances,
    unit_form,
    whiten,
)
from tankcal.messages import message
from tankcal.quadrature import panels, polar_products

FULL_TURN = 2 * np.pi
MOST_KNOTS = 400  # above this many points an outline is smoothed, not interpolated
WIDEST_GAP, NARROWEST_GAP = 1.5, 0.3  # of the median one, where an outline is interpolated


@dataclass(frozen=True)
class Outline:
    """The irregular section: r(azimuth) = basis(azimuth) @ parameters about (x_m, y_m).

    Attributes
    ----------
    x_m, y_m : float
        Centre, m.
    kind : str
        "interpolated" (periodic cubic through the points) or "smoothed" (harmonics).
    parameters : ndarray, shape (p,)
        Radii at the knots, or coefficients of the harmonics, m.
    from_radii : ndarray, shape (p, n)
        Derivative of the parameters by the n measured radii.
    azimuth_rad : ndarray, shape (n,)
        Azimuths of the measured radii, rad.
    zeta : ndarray, shape (n,)
        Their heights within the course, -1 at its bottom to +1 at its top.
    level_zeta : float
        Height of the outline within the course.
    form : Form
        Form of the shell.
    knots_rad : ndarray, shape (k,)
        Ascending azimuths where the polynomial pieces meet, rad.
    """

    x_m: float
    y_m: float
    kind: str
    parameters: np.ndarray
    from_radii: np.ndarray
    azimuth_rad: np.ndarray
    zeta: np.ndarray
    level_zeta: float
    form: Form
    knots_rad: np.ndarray

    def basis(self, azimuth_rad, derivative=0):
        """(len(azimuth), p) functions that the parameters multiply, or their derivative."""
        if self.kind == "smoothed":
            return harmonics(azimuth_rad, (len(self.parameters) - 1) // 2, derivative)
        return self._splines(_into_turn(azimuth_rad, self.knots_rad[0]), derivative)

    @cached_property
    def _splines(self):
        return _cardinal_splines(self.knots_rad)

    def radius_m(self, azimuth_rad, derivative=0):
        """(len(azimuth),) radius at each azimuth, or its derivative by the azimuth."""
        return self.basis(azimuth_rad, derivative) @ self.parameters

    def nodes(self):
        """Azimuths and weights of a rule that is exact for r^2 of an interpolated outline."""
        return panels(np.append(self.knots_rad, self.knots_rad[0] + FULL_TURN), 4)

    def area_m2(self):
        """A = 1/2 integral of r^2 over the full turn, by Gaussian quadrature."""
        azimuth, weight = self.nodes()
        return float(polar_products(self.radius_m(azimuth), weight)[0, 0])

    def shown_form(self):
        """(2, p, modes) parameters that a form of amplitude one, sd of each mode, makes here.

        First of a form that is the same at all heights, then of one that grows with zeta.
        """
        waves = unit_form(self.azimuth_rad)
        return np.stack([self.from_radii @ waves, self.from_radii @ (waves * self.zeta[:, None])])

    def unseen_form_m(self, azimuth_rad):
        """(len(azimuth), 2 modes) how far the outline misses one sd of each mode of the form.

        The outline of a mode sampled at the points, less the mode itself: first of the form that is
        the same at all heights of the course, then of the rising form.
        """
        shown = self.basis(azimuth_rad) @ self.shown_form()
        there = unit_form(azimuth_rad)
        missed = shown - np.stack([there, self.level_zeta * there])
        return np.hstack(
            [np.sqrt(self.form.level_m2) * missed[0], np.sqrt(self.form.rising_m2) * missed[1]]
        )

    def modes_m(self, highest=6):
        """(highest + 1, 2) cos and sin amplitude of each Fourier mode; row 0 is the mean radius."""
        azimuth = np.arange(720) * FULL_TURN / 720
        spectrum = np.fft.rfft(self.radius_m(azimuth)) / 360
        spectrum[0] /= 2
        return np.column_stack([spectrum.real, -spectrum.imag])[: highest + 1]


def polar(xy_m, x_m, y_m):
    """Azimuths and distances of points about a centre.

    Parameters
    ----------
    xy_m : array_like, shape (n, 2)
        Points, m.
    x_m, y_m : float
        Centre, m.

    Returns
    -------
    azimuth_rad, radius_m : ndarray, shape (n,)
        0 to 2 pi, clockwise from +y, and m.

    Examples
    --------
    >>> polar(np.array([[1.0, 0.0], [0.0, 2.0]]), 0.0, 0.0)
    (array([1.57079633, 0.        ]), array([1., 2.]))
    """
    d = np.asarray(xy_m) - (x_m, y_m)
    return np.arctan2(d[:, 0], d[:, 1]) % FULL_TURN, np.hypot(d[:, 0], d[:, 1])


def evenly_spread(azimuth_rad):
    """Whether an interpolated outline can be trusted through these azimuths.

    No gap over 1.5 times or under 0.3 times the median one, 5 to 400 points: beyond, the spectrum
    of the form bridges a gap better than a spline does.

    Parameters
    ----------
    azimuth_rad : ndarray, shape (n,)
        Azimuths, rad.

    Returns
    -------
    bool

    Examples
    --------
    >>> evenly_spread(np.arange(8) * np.pi / 4), evenly_spread(np.array([0, 1, 2, 3, 3.1]))
    (True, False)
    """
    n = len(azimuth_rad)
    if not 5 <= n <= MOST_KNOTS:
        return False
    ordered = np.sort(azimuth_rad)
    gaps = np.diff(ordered, append=ordered[0] + FULL_TURN)
    middle = np.median(gaps)
    return bool(gaps.max() <= WIDEST_GAP * middle and gaps.min() >= NARROWEST_GAP * middle)


def interpolate_outline(xy_m, x_m, y_m, form, zeta=0.0):
    """Periodic cubic r(azimuth) through every point, about the centre (x_m, y_m).

    The spline has continuous curvature and no end.

    Parameters
    ----------
    xy_m : array_like, shape (n, 2)
        Points, m.
    x_m, y_m : float
        Centre, m.
    form : Form
        Form of the shell.
    zeta : float, optional
        Height of the section within its course, -1 to 1.

    Returns
    -------
    Outline

    Raises
    ------
    SolutionError
        Below 5 points or when two points share an azimuth.

    Examples
    --------
    >>> angle = np.arange(8) * np.pi / 4
    >>> xy_m = 2 * np.column_stack([np.sin(angle), np.cos(angle)])
    >>> interpolate_outline(xy_m, 0.0, 0.0, Form()).parameters.round(9)
    array([2., 2., 2., 2., 2., 2., 2., 2.])
    """
    azimuth, radius = polar(xy_m, x_m, y_m)
    order = np.argsort(azimuth)
    knots = azimuth[order]
    n = len(knots)
    if n < 5:
        raise SolutionError(
            message(
                "outline_short_of_points",
                "an irregular section needs 5 points, {count} were given",
                count=n,
            )
        )
    if np.min(np.diff(knots, append=knots[0] + FULL_TURN)) < 1e-9:
        raise SolutionError(
            message(
                "azimuth_shared",
                "two points of a section share an azimuth: it cannot be interpolated",
            )
        )
    return Outline(
        x_m=x_m,
        y_m=y_m,
        kind="interpolated",
        parameters=radius[order],
        from_radii=np.eye(n)[order],
        azimuth_rad=azimuth,
        zeta=np.full(n, zeta),
        level_zeta=zeta,
        form=form,
        knots_rad=knots,
    )


def smooth_outlines(xy_m, x_m, y_m, noise_m2, form, zeta, levels_zeta, degree):
    """Outlines at some heights of a course, fitted together to points that are not level.

    r(a, zeta) = r0(a) + zeta r1(a) + (3 zeta^2 - 1)/2 c, with harmonics to order 36 in r0 (prior
    variance form.level_m2 k^-3 of mode k >= 2) and in r1 (form.rising_m2 k^-3). Free are radius and
    centre of r0, from degree 1 on those of r1 (taper and lean, so that a frustum and a leaning
    cylinder are exact), and at degree 2 the barrel c. At degree 0 nothing changes with height.

    Parameters
    ----------
    xy_m : array_like, shape (n, 2)
        Points, m.
    x_m, y_m : float
        Centre, m.
    noise_m2 : ndarray, shape (n, n) or (n,)
        Covariance of the measured radii, m2.
    form : Form
        Form of the shell.
    zeta : ndarray, shape (n,)
        Heights of the points within the course, -1 to 1.
    levels_zeta : sequence of float
        Heights of the outlines.
    degree : int
        0, 1 or 2.

    Returns
    -------
    tuple of Outline

    Raises
    ------
    SolutionError
        When the points do not determine what is free.
    """
    azimuth, radius = polar(xy_m, x_m, y_m)
    free = free_columns(azimuth, zeta, degree)
    waves = unit_form(azimuth, HARMONICS)
    random = [np.sqrt(form.level_m2) * waves]
    random += [np.sqrt(form.rising_m2) * waves * zeta[:, None]] * (degree > 0)
    solution = _shrunk(np.hstack([free, *random]), free.shape[1], noise_m2)
    return tuple(
        Outline(
            x_m=x_m,
            y_m=y_m,
            kind="smoothed",
            parameters=from_radii @ radius,
            from_radii=from_radii,
            azimuth_rad=azimuth,
            zeta=zeta,
            level_zeta=level,
            form=form,
            knots_rad=np.arange(4 * HARMONICS) * FULL_TURN / (4 * HARMONICS),
        )
        for level in levels_zeta
        for from_radii in [_at_level(solution, level, form, degree)]
    )


def _shrunk(design, free, noise_m2):
    """(p, n) estimates by the radii: the first `free` columns free, the others of unit variance."""
    white = whiten(design, noise_m2)
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
    return np.linalg.solve(normal, whiten(white, noise_m2, transposed=True).T)


def _at_level(solution, level, form, degree):
    """(2 HARMONICS + 1, n) coefficients of the outline at one height, by the radii."""
    free = len(free_columns(np.zeros(1), np.zeros(1), degree)[0])
    sd = np.sqrt(mode_variances(HARMONICS))[:, None]
    first = free + len(sd)
    coefficients = np.vstack([solution[:3], np.sqrt(form.level_m2) * sd * solution[free:first]])
    if degree >= 1:
        rising = np.sqrt(form.rising_m2) * sd * solution[first:]
        coefficients = coefficients + level * np.vstack([solution[3:6], rising])
    if degree == 2:
        coefficients[0] += (1.5 * level**2 - 0.5) * solution[6]
    return coefficients


def radii_by_coordinates(outline, xy_m):
    """Derivative of the radius at fixed azimuth by the points' x and y.

    A point that moves along the outline changes nothing: dr = n . dp, with n the outline's normal,
    scaled so that its radial part is one: (sin a - r'/r cos a, cos a + r'/r sin a).

    Parameters
    ----------
    outline : Outline
    xy_m : array_like, shape (n, 2)
        Points, m.

    Returns
    -------
    sparse array, shape (n, 2n)
    """
    azimuth, radius = polar(xy_m, outline.x_m, outline.y_m)
    slope = outline.radius_m(azimuth, derivative=1) / radius
    sin, cos = np.sin(azimuth), np.cos(azimuth)
    n = len(azimuth)
    normal = np.column_stack([sin - slope * cos, cos + slope * sin])
    return scipy.sparse.csr_array(
        (normal.ravel(), np.arange(2 * n), np.arange(0, 2 * n + 1, 2)), shape=(n, 2 * n)
    )


def _into_turn(azimuth_rad, start):
    return start + (np.asarray(azimuth_rad) - start) % FULL_TURN


def _cardinal_splines(knots):
    """Periodic cubic splines that are one at their own knot and zero at all others."""
    n = len(knots)
    values = np.vstack([np.eye(n), np.eye(n)[:1]])
    return scipy.interpolate.CubicSpline(
        np.append(knots, knots[0] + FULL_TURN), values, bc_type="periodic"
    )
