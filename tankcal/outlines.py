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
HARMONICS = 36  # of a smoothed outline: a dent of 10 deg still shows, if the prior believes it
LEAST_FORM_M2 = 1e-12  # a micrometre
FORM_MODES = 100  # of the form that may lie between points; the others hold 2.5e-4 of its variance
MOST_KNOTS = 400  # above this many points an outline is smoothed, not interpolated


@dataclass(frozen=True)
class Outline:
    """The irregular section: r(azimuth) = basis(azimuth) @ parameters about (x_m, y_m).

    kind              "interpolated" (periodic cubic through the points) or "smoothed" (harmonics)
    parameters        (p,) radii at the knots, or coefficients of the harmonics, m
    from_radii        (p, n) derivative of the parameters by the n measured radii
    azimuth_rad       (n,) azimuths of the measured radii
    form_m2           amplitude of the form: variance form_m2 k^-3 of each mode k >= 2
    knots_rad         (k,) ascending azimuths where the polynomial pieces meet
    """

    x_m: float
    y_m: float
    kind: str
    parameters: np.ndarray
    from_radii: np.ndarray
    azimuth_rad: np.ndarray
    form_m2: float
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
        """Azimuths and weights of a rule that is exact for r^2 of an interpolated outline."""
        return panels(np.append(self.knots_rad, self.knots_rad[0] + FULL_TURN), 4)

    def area_m2(self):
        """A = 1/2 integral of r^2 over the full turn, by Gaussian quadrature."""
        azimuth, weight = self.nodes()
        return float(polar_products(self.radius_m(azimuth), weight)[0, 0])

    def unseen_form_m(self, azimuth_rad):
        """(len(azimuth), modes) how far the outline misses one sd of each mode of the form.

        The outline of a mode sampled at the points, less the mode itself. The modes are common to
        all sections of a shell: dents and ovality run up the wall.
        """
        shown = self.basis(azimuth_rad) @ (self.from_radii @ _form(self.azimuth_rad))
        sd = np.sqrt(self.form_m2 * mode_variances(FORM_MODES))
        return (shown - _form(azimuth_rad)) * sd

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


def interpolate_outline(xy_m, x_m, y_m, form_m2=0.0):
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
        azimuth_rad=azimuth,
        form_m2=form_m2,
        knots_rad=knots,
    )


def smooth_outline(xy_m, x_m, y_m, noise_m2, form_m2):
    """Harmonics r = c0 + sum a_k cos k a + b_k sin k a, k <= 36, weighted by a prior on the form.

    Mode k >= 2 has the prior variance form_m2 k^-3, so a gap between points is bridged by what the
    shell's own spectrum allows, and the form that was not seen stays in the covariance. Modes 0 and
    1 (radius, centre) are free.

    noise_m2  covariance of the measured radii, (n, n) or (n,)
    form_m2   amplitude of the form, >= 0 (`estimate_form`)
    Raises SolutionError when the points do not determine radius and centre.
    """
    azimuth, radius = polar(xy_m, x_m, y_m)
    scale = _prior_scale(form_m2)
    design = harmonics(azimuth, HARMONICS)
    normal, scaled = _normal_matrix(_whitened(design, noise_m2), scale)
    weighted = _whitened(scaled, noise_m2, transposed=True)
    from_radii = scale[:, None] * np.linalg.solve(normal, weighted.T)
    return Outline(
        x_m=x_m,
        y_m=y_m,
        kind="smoothed",
        parameters=from_radii @ radius,
        from_radii=from_radii,
        azimuth_rad=azimuth,
        form_m2=form_m2,
        knots_rad=np.arange(4 * HARMONICS) * FULL_TURN / (4 * HARMONICS),
    )


def estimate_form(sections, noise=1.0):
    """Amplitude of the form of a set of sections by restricted maximum likelihood, m2.

    sections  list of (azimuth_rad (n,), radius_m (n,), covariance (n,) or (n, n)), one a section
    noise     factor of the covariances

    The likelihood is that of radii with free modes 0 and 1 and random modes k >= 2 of variance
    form_m2 k^-3 (Patterson & Thompson 1971). The noise is never estimated here: in one section it
    cannot be told from the form.
    """
    moments = []
    for azimuth, radius, covariance in sections:
        columns = np.column_stack([harmonics(azimuth, HARMONICS), radius - radius.mean()])
        columns = _whitened(columns, noise * covariance)
        moments.append((columns[:, :-1], columns[:, -1]))

    def misfit(log_form):
        """Doubled negative log-likelihood, but for a constant."""
        scale = _prior_scale(np.exp(log_form))
        total = 0.0
        for design, radius in moments:
            normal, scaled = _normal_matrix(design, scale)
            projected = scaled.T @ radius
            total += np.linalg.slogdet(normal)[1] - projected @ np.linalg.solve(normal, projected)
        return total

    grid = np.log(LEAST_FORM_M2) + np.arange(0.0, 29.0, 2.0)  # to a form of 1.2 m
    start = grid[np.argmin([misfit(log_form) for log_form in grid])]
    best = scipy.optimize.minimize_scalar(
        misfit, bounds=(start - 2.0, start + 2.0), method="bounded"
    ).x
    return float(np.exp(best))


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


def _form(azimuth_rad):
    """(n, modes) cos and sin of the modes 2 to FORM_MODES."""
    return harmonics(azimuth_rad, FORM_MODES)[:, 3:]


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
