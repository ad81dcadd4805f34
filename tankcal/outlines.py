"""The irregular outline r(azimuth) of a section: interpolated, or smoothed by harmonics.

Azimuths count clockwise from +y, so a point of the outline is (x + r sin a, y + r cos a). An
outline is linear in its parameters and they are linear in the measured radii.
"""

from dataclasses import dataclass

import numpy as np
import scipy.interpolate
import scipy.linalg
import scipy.optimize
import scipy.sparse

from tankcal.errors import SolutionError
from tankcal.quadrature import panels, polar_products

FULL_TURN = 2 * np.pi
HARMONICS = 36  # a dent of 10 deg still shows; the prior decides how much of it is believed
MOST_KNOTS = 400  # above this many points an outline is smoothed, not interpolated


@dataclass(frozen=True)
class Outline:
    """The irregular section: r(azimuth) = basis(azimuth) @ parameters about (x_m, y_m).

    kind              "interpolated" (periodic cubic through the points) or "smoothed" (harmonics)
    parameters        (p,) radii at the knots, or coefficients of the harmonics, m
    from_radii        (p, n) derivative of the parameters by the n measured radii
    form_factor_m     (p, modes) effect of a unit of each prior mode that the points did not see;
                      all zero when interpolated. Modes are common to all sections of a shell.
    knots_rad         (k,) ascending azimuths where the polynomial pieces meet
    """

    x_m: float
    y_m: float
    kind: str
    parameters: np.ndarray
    from_radii: np.ndarray
    form_factor_m: np.ndarray
    knots_rad: np.ndarray

    def basis(self, azimuth_rad, derivative=0):
        """(len(azimuth), p) functions that the parameters multiply, or their derivative."""
        if self.kind == "smoothed":
            return harmonics(azimuth_rad, (len(self.parameters) - 1) // 2, derivative)
        return _cardinal_splines(self.knots_rad)(
            _into_turn(azimuth_rad, self.knots_rad[0]), derivative
        )

    def radius_m(self, azimuth_rad, derivative=0):
        """(len(azimuth),) radius at each azimuth, or its derivative by the azimuth."""
        return self.basis(azimuth_rad, derivative) @ self.parameters

    def nodes(self):
        """Azimuths and weights that integrate r^2 (degree 6 between knots) exactly."""
        return panels(np.append(self.knots_rad, self.knots_rad[0] + FULL_TURN), 4)

    def area_m2(self):
        """A = 1/2 integral of r^2 over the full turn, by Gaussian quadrature."""
        azimuth, weight = self.nodes()
        return float(polar_products(self.radius_m(azimuth), weight)[0, 0])

    def modes_m(self, highest=6):
        """(highest + 1, 2) cos and sin amplitude of each Fourier mode; row 0 is the mean radius."""
        azimuth = np.arange(720) * FULL_TURN / 720
        spectrum = np.fft.rfft(self.radius_m(azimuth)) / 360
        spectrum[0] /= 2
        return np.column_stack([spectrum.real, -spectrum.imag])[: highest + 1]


def polar(xy_m, x_m, y_m):
    """Azimuths (0 to 2 pi) and distances of points about a centre."""
    d = np.asarray(xy_m) - (x_m, y_m)
    return np.arctan2(d[:, 0], d[:, 1]) % FULL_TURN, np.hypot(d[:, 0], d[:, 1])


def evenly_spread(azimuth_rad):
    """Whether an interpolated outline can be trusted through these azimuths.

    No gap over 2.5 times or under 0.3 times the median one, 5 to 400 points.
    """
    n = len(azimuth_rad)
    if not 5 <= n <= MOST_KNOTS:
        return False
    ordered = np.sort(azimuth_rad)
    gaps = np.diff(ordered, append=ordered[0] + FULL_TURN)
    return bool(gaps.max() <= 2.5 * np.median(gaps) and gaps.min() >= 0.3 * np.median(gaps))


def interpolate_outline(xy_m, x_m, y_m):
    """Periodic cubic r(azimuth) through every point, about the centre (x_m, y_m).

    The spline has continuous curvature and no end. Raises SolutionError below 5 points or when two
    points share an azimuth.
    """
    azimuth, radius = polar(xy_m, x_m, y_m)
    order = np.argsort(azimuth)
    knots = azimuth[order]
    n = len(knots)
    if n < 5:
        raise SolutionError(f"an irregular section needs 5 points, {n} were given")
    if np.min(np.diff(knots, append=knots[0] + FULL_TURN)) < 1e-9:
        raise SolutionError("two points of a section share an azimuth: it cannot be interpolated")
    return Outline(
        x_m=x_m,
        y_m=y_m,
        kind="interpolated",
        parameters=radius[order],
        from_radii=np.eye(n)[order],
        form_factor_m=np.zeros((n, 2 * HARMONICS + 1)),
        knots_rad=knots,
    )


def smooth_outline(xy_m, x_m, y_m, noise_m2, form_m2):
    """Harmonics r = c0 + sum a_k cos k a + b_k sin k a, k <= 36, weighted by a prior on the form.

    Mode k >= 2 has the prior variance form_m2 k^-3, so a gap between points is bridged by what the
    shell's own spectrum allows, and the form that was not seen stays in the covariance. Modes 0 and
    1 (radius, centre) are free.

    noise_m2  covariance of the measured radii, (n, n) or (n,)
    form_m2   amplitude of the form, >= 0 (`estimate_components`)
    Raises SolutionError when the points do not determine radius and centre.
    """
    azimuth, radius = polar(xy_m, x_m, y_m)
    scale = _prior_scale(form_m2)
    design = harmonics(azimuth, HARMONICS)
    normal, scaled = _normal_matrix(_whitened(design, noise_m2), scale)
    weighted = _whitened(scaled, noise_m2, transposed=True)
    from_radii = scale[:, None] * np.linalg.solve(normal, weighted.T)
    unseen = from_radii @ design - np.eye(len(scale))
    unseen[:, :3] = 0.0  # the free modes are reproduced, they have no prior
    return Outline(
        x_m=x_m,
        y_m=y_m,
        kind="smoothed",
        parameters=from_radii @ radius,
        from_radii=from_radii,
        form_factor_m=unseen * scale,
        knots_rad=np.arange(4 * HARMONICS) * FULL_TURN / (4 * HARMONICS),
    )


@dataclass(frozen=True)
class Components:
    """Two variance components of sections: the noise of a radius and the amplitude of the form.

    noise multiplies the radii's given covariance (m2 when that was relative to one); form_m2 k^-3
    is the variance of the cos and sin amplitudes of mode k.
    """

    noise: float
    form_m2: float
    dof: float


def estimate_components(sections, noise=None):
    """Noise and form of a set of sections by restricted maximum likelihood.

    sections  list of (azimuth_rad (n,), radius_m (n,), covariance (n,) or (n, n)), one a section
    noise     None: estimated, the covariances being relative; 1.0: they are absolute

    The likelihood is that of radii with free modes 0 and 1 and random modes k >= 2 (Patterson &
    Thompson 1971); dof is the number of radii less the effective number of parameters.
    """
    moments = []
    for azimuth, radius, covariance in sections:
        columns = np.column_stack([harmonics(azimuth, HARMONICS), radius - radius.mean()])
        columns = _whitened(columns, covariance)
        moments.append((columns[:, :-1], columns[:, -1]))
    count = sum(len(radius) - 3 for _, radius in moments)

    def at(log_ratio):
        """Restricted log-likelihood (negative, doubled), noise and parameters, at form/noise."""
        scale = _prior_scale(np.exp(log_ratio))
        squares = logdet = parameters = 0.0
        for design, radius in moments:
            normal, scaled = _normal_matrix(design, scale)
            projected = scaled.T @ radius
            squares += radius @ radius - projected @ np.linalg.solve(normal, projected)
            logdet += np.linalg.slogdet(normal)[1]
            parameters += np.trace(np.linalg.solve(normal, scaled.T @ scaled))
        found = max(squares / count, np.finfo(float).tiny) if noise is None else noise
        return count * np.log(found) + squares / found + logdet, found, parameters

    variance = np.mean([np.mean(np.diag(c) if np.ndim(c) == 2 else c) for *_, c in sections])
    grid = np.log(variance) + np.arange(-12.0, 17.0, 2.0)  # form/noise of 1e-5 to 1e7
    start = grid[np.argmin([at(log_ratio)[0] for log_ratio in grid])]
    best = scipy.optimize.minimize_scalar(
        lambda log_ratio: at(log_ratio)[0], bounds=(start - 2.0, start + 2.0), method="bounded"
    ).x
    _, found, parameters = at(best)
    return Components(
        noise=float(found),
        form_m2=float(np.exp(best) * found),
        dof=float(max(count + 3 * len(moments) - parameters, 1.0)),
    )


def _whitened(array, covariance, transposed=False):
    """L^-1 array (or L^-T array) with covariance = L L', which may be (n,) variances."""
    if np.ndim(covariance) == 1:
        return array / np.sqrt(covariance)[:, None]
    factor = np.linalg.cholesky(covariance)
    return scipy.linalg.solve_triangular(factor, array, lower=True, trans=int(transposed))


def _prior_scale(form_m2):
    """(p,) standard deviations of the parameters: one for the free modes, else the prior's."""
    return np.concatenate([np.ones(3), np.sqrt(form_m2 * mode_variances(HARMONICS))])


def _normal_matrix(design, scale):
    """Normal matrix of parameters scaled to unit prior variance, and the scaled design."""
    scaled = design * scale
    normal = scaled.T @ scaled
    normal[np.arange(3, len(scale)), np.arange(3, len(scale))] += 1.0
    if np.linalg.matrix_rank(normal[:3, :3]) < 3:
        raise SolutionError("the points of a section do not determine its centre and radius")
    return normal, scaled


def mode_variances(highest):
    """Prior variance of the cos and sin amplitudes of modes 2..highest over form_m2: k^-3."""
    return np.repeat(np.arange(2.0, highest + 1) ** -3, 2)


def harmonics(azimuth_rad, highest, derivative=0):
    """(n, 2 highest + 1) columns 1, cos a, sin a, cos 2a, sin 2a, ... or their first derivative."""
    angles = np.outer(azimuth_rad, np.arange(1, highest + 1))
    columns = np.empty((len(angles), 2 * highest + 1))
    if derivative == 0:
        columns[:, 0] = 1.0
        columns[:, 1::2], columns[:, 2::2] = np.cos(angles), np.sin(angles)
    else:
        k = np.arange(1, highest + 1)
        columns[:, 0] = 0.0
        columns[:, 1::2], columns[:, 2::2] = -k * np.sin(angles), k * np.cos(angles)
    return columns


def radii_by_coordinates(outline, xy_m):
    """(n, 2n) sparse derivative of the radius at fixed azimuth by the points' x and y.

    A point that moves along the outline changes nothing: dr = n . dp, with n the outline's normal,
    scaled so that its radial part is one: (sin a - r'/r cos a, cos a + r'/r sin a).
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
