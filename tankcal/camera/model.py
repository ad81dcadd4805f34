"""Model of the camera, and its distortion as a function of distance.

Camera model: interior orientation, all published forms of distortion, and image of a point.

With (u, v, w) = R (X - S), the ideal image point relative to the principal point is

    xi = -c u / w,   eta = -c v / w

The distortion of a point (x, y), with r2 = x2 + y2, is the sum of

    radial      x (K1 r2 + K2 r4 + K3 r6 + K4 r8)      balanced about R0: K1 (r2 - R0^2) + ...
    decentring  (P1 (r2 + 2 x2) + 2 P2 x y) (1 + P3 r2 + P4 r4), y alike with P1 and P2 swapped
    affinity    A y, B y ("both_y", Silva 40-44);  A x, B x ("both_x", Pessoa 6);
                A x + B y, 0 ("b1_b2")              written as (dx, dy)

The affinity "before_distortion" (DBAT) is not part of the sum. In every convention, it first
replaces the measured coordinates, relative to the principal point, by (1 + A) x + B y and y.

Three conventions define the point of evaluation and the sign of the distortion:

    distortion_of_ideal    x = x0 + xi + d(xi)               OpenCV, AICON
    correction_added       (x - x0) + d(x - x0) = xi         Silva 39, DBAT
    correction_subtracted  (x - x0) - d(x - x0) = xi         Pessoa 10

The last two equations are solved for the measured coordinate x. In every convention, x is then a
function of the unknowns. The misclosure is "computed minus measured" in the measured image. With
the weights "ideal", the misclosure refers to the ideal image: xi minus the corrected measured
coordinate.

Image coordinates and c, x0, y0, R0 are in mm; K1 mm^-2, K2 mm^-4 ...; P1, P2 mm^-1, P3 mm^-2, P4
mm^-4.

Source: Silva 1995 (39-47, 58); Pessoa 2017 (3-6, 9, 10); Brown 1971; DBAT, res_euler_brown_1.

Distortion as a function of distance: focus of the lens, and depth of field.

The radial coefficients at two focus distances S1, S2 determine those at S:

    alpha = (S2 - S)/(S2 - S1) (S1 - f)/(S - f)
    Ki(S) = (1 - f/S)^(2i+1) [alpha Ki(S1)/(1 - f/S1)^(2i+1) + (1 - alpha) Ki(S2)/(1 - f/S2)^(2i+1)]

A lens focused at s images a point in the depth s' (along the axis, not the slant range) with

    gamma = (s - f)/(s' - f) s'/s,   Ki(s, s') = gamma^(2i) Ki(s')

Decentring distortion is gamma (1 - f/s') times its value at infinity. This product equals (1 - f/s)
for every s', so that decentring is constant within the depth of field. f is the focal length, which
equals c at infinity, not the principal distance. All lengths are in mm.

Source: Silva 1995 (48-58); Brown 1971; Fryer & Brown 1986.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera.imaging import apply_first_affinity, distort, image_point, invert_correction

NEWTON_ROUNDS = 50
PARAMETERS = ("c", "x0", "y0", "K1", "K2", "K3", "K4", "P1", "P2", "P3", "P4", "A", "B")
_UNITS = ("mm", "mm", "mm", "mm-2", "mm-4", "mm-6", "mm-8", "mm-1", "mm-1", "mm-2", "mm-4", "", "")
UNITS = dict(zip(PARAMETERS, _UNITS, strict=True))
# Keys of the parameters in files: name and unit
KEYS = {name: f"{name}_{unit}" if unit else name for name, unit in UNITS.items()}
CONVENTIONS = {"distortion_of_ideal": 0.0, "correction_added": 1.0, "correction_subtracted": -1.0}
WEIGHTS = ("measured", "ideal")
# Switches: A x in dx, A y in dx, B y in dx, B x in dy, B y in dy, and A x + B y before the
# distortion.
AFFINITIES = {
    "both_y": (0.0, 1.0, 0.0, 0.0, 1.0, 0.0),
    "both_x": (1.0, 0.0, 0.0, 1.0, 0.0, 0.0),
    "b1_b2": (1.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    "before_distortion": (0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
}


@dataclass(frozen=True)
class Form:
    """Form of the distortion of a camera.

    Attributes
    ----------
    convention : str
        One of CONVENTIONS.
    affinity : str
        One of AFFINITIES.
    radial_balance_mm : float
        R0, the radius without radial distortion, mm; 0 without a balance.
    weights : str
        One of WEIGHTS: the image to which residuals and weights refer.
    """

    convention: str = "distortion_of_ideal"
    affinity: str = "b1_b2"
    radial_balance_mm: float = 0.0
    weights: str = "measured"

    @property
    def numbers(self):
        """Form as eight numbers: sign (0, +1, -1), the six affinity switches, and R0^2."""
        side, balance = CONVENTIONS[self.convention], float(self.radial_balance_mm)
        return side, *AFFINITIES[self.affinity], balance**2


def correct_image_points(xy_mm, interior, form):
    """Ideal image points, relative to the principal point, from measured image points.

    Parameters
    ----------
    xy_mm : ndarray, shape (n, 2)
        Measured image points, mm.
    interior : array_like, shape (13,) or (n, 13)
        Interior parameters in the order of PARAMETERS.
    form : Form
        Form of the distortion.

    Returns
    -------
    ndarray, shape (n, 2)
        Ideal image points, mm.

    Examples
    --------
    >>> interior = np.zeros(13)
    >>> interior[[0, 3]] = 50.0, -1e-4
    >>> correct_image_points(np.array([[10.0, 0.0]]), interior, Form("correction_added"))
    array([[9.9, 0. ]])
    """
    numbers = form.numbers
    q = tuple(np.asarray(interior, dtype=float).T)
    x, y = apply_first_affinity(xy_mm[:, 0] - q[1], xy_mm[:, 1] - q[2], q, numbers)
    # A correction is a function of the measured point and is applied directly.
    if form.convention != "distortion_of_ideal":
        dx, dy = distort(x, y, q, numbers)[:2]
        return np.column_stack([x + numbers[0] * dx, y + numbers[0] * dy])
    # A distortion of the ideal point is inverted: p + d(p) = measured, hence the sign +1.
    return np.column_stack(invert_correction(x, y, q, (1.0, *numbers[1:])))


def distort_image_points(ideal_mm, interior, form):
    """Measured image points from ideal image points: the inverse of `correct_image_points`.

    Parameters
    ----------
    ideal_mm : ndarray, shape (n, 2)
        Ideal image points, relative to the principal point, mm.
    interior : array_like, shape (13,) or (n, 13)
        Interior parameters in the order of PARAMETERS.
    form : Form
        Form of the distortion.

    Returns
    -------
    ndarray, shape (n, 2)
        Measured image points, mm.

    Examples
    --------
    >>> interior = np.zeros(13)
    >>> interior[[0, 3]] = 50.0, -1e-4
    >>> distort_image_points(np.array([[9.9, 0.0]]), interior, Form("correction_added"))
    array([[10.,  0.]])
    """
    q = tuple(np.asarray(interior, dtype=float).T)
    of_ideal = form.convention == "distortion_of_ideal"
    return np.column_stack(image_point(*ideal_mm.T, q, form.numbers, of_ideal)[:2])


def balance_about(interior, form, radius_mm):
    """Balance the radial distortion of a camera about another radius R0.

    Parameters
    ----------
    interior : array_like, shape (13,)
        Interior parameters in the order of PARAMETERS.
    form : Form
        Form of the distortion.
    radius_mm : float
        New R0, mm; 0 for the form without a balance.

    Returns
    -------
    interior : ndarray, shape (13,)
        Parameters for the new radius.
    form : Form
        Form with this radius.

    Notes
    -----
    The balance removes a change of scale s = 1 - (K1 R0^2 + ...) from the radial terms. c takes up
    this scale exactly, in every convention. With correction_subtracted, K has the opposite sign.

    Examples
    --------
    >>> interior = np.zeros(13)
    >>> interior[[0, 3]] = 50.0, -1e-4
    >>> balanced, form = balance_about(interior, Form("correction_added"), 10.0)
    >>> round(float(balanced[0]), 6), form.radial_balance_mm
    (50.505051, 10.0)
    """
    side = CONVENTIONS[form.convention]
    # First remove the present balance.
    plain = rescale_interior(
        interior, form, 1 - (side or 1) * _balance_offset(interior, form.radial_balance_mm)
    )
    target = replace(form, radial_balance_mm=float(radius_mm))
    s = 1.0
    # The coefficients in the scale s are those after rescaling: fixed-point iteration.
    for _ in range(NEWTON_ROUNDS):
        balanced = rescale_interior(plain, form, 1 / s)
        next_s = 1 - (side or 1) * _balance_offset(balanced, radius_mm)
        if abs(next_s - s) < 1e-15:
            break
        s = next_s
    return balanced, target


def _balance_offset(interior, radius_mm):
    """K1 R0^2 + K2 R0^4 + ... for interior parameters (13,) and the radius R0."""
    # Horner's scheme in R0^2, from K4 to K1.
    e = radius_mm**2
    return float(np.polyval(np.append(np.asarray(interior)[6:2:-1], 0.0), e))


def rescale_interior(interior, form, s):
    """Interior parameters of the same camera when the scale s is moved to c.

    Parameters
    ----------
    interior : array_like, shape (13,)
        Interior parameters in the order of PARAMETERS.
    form : Form
        Form of the distortion.
    s : float
        Scale.

    Returns
    -------
    ndarray, shape (13,)
        Rescaled parameters.

    Notes
    -----
    With distortion_of_ideal, s xi replaces xi as the ideal point of the same image. With a
    correction, its equation is divided by s. An affinity before the distortion is unchanged.
    """
    q = np.array(interior, dtype=float)
    if CONVENTIONS[form.convention]:
        q[0] /= s
        q[[3, 4, 5, 6, 7, 8, 11, 12]] /= s
    else:
        # Powers of s: c gains one, and each coefficient loses the degree of its term in the
        # coordinates.
        q *= s ** np.array([1, 0, 0, -3, -5, -7, -9, -2, -2, -2, -4, -1, -1], dtype=float)
    if form.affinity == "before_distortion":
        q[11:] = interior[11:]
    return q


RADIAL = ("K1", "K2", "K3")
_FIRST = PARAMETERS.index("K1")
_ODD, _EVEN = np.array([3, 5, 7]), np.array([2, 4, 6])


@dataclass(frozen=True)
class Lens:
    """Lens with radial distortion calibrated at two focus distances.

    Attributes
    ----------
    focal_length_mm : float
        f, mm.
    focus_mm : float
        Distance s of the focus from the lens, mm; np.inf for infinity.
    distances_mm : ndarray, shape (2,)
        S1, S2, mm.
    radial : ndarray, shape (2, 3)
        K1, K2, K3 at each of these distances.
    """

    focal_length_mm: float
    focus_mm: float
    distances_mm: np.ndarray
    radial: np.ndarray

    @property
    def radial_in_focus(self):
        """K1, K2, K3 (3,) for an object in focus."""
        return self.radial_at(self.focus_mm)

    def radial_at(self, distance_mm):
        """Radial coefficients of the lens focused at any distance, from the two calibrations.

        Parameters
        ----------
        distance_mm : array_like, shape (...)
            Focus distances, mm; may be infinite.

        Returns
        -------
        ndarray, shape (..., 3)
            K1 (mm^-2), K2 (mm^-4), K3 (mm^-6).

        Raises
        ------
        ValueError
            If the two calibrated distances are equal.

        Examples
        --------
        >>> radial = np.array([[-1e-4, 0, 0], [-2e-4, 0, 0]])
        >>> lens = Lens(50.0, 2000.0, np.array([1000.0, np.inf]), radial)
        >>> lens.radial_at(2000.0)[0].round(8)
        np.float64(-0.00014773)
        """
        f, s = self.focal_length_mm, np.asarray(distance_mm, dtype=float)
        near, far = np.sort(self.distances_mm)
        if near == far:
            raise ValueError("calibrations at equal distances do not determine another distance")
        first, second = self.radial[np.argsort(self.distances_mm)]
        at_infinity = [
            coefficients / (1 - f / distance) ** _ODD
            for coefficients, distance in ((first, near), (second, far))
        ]
        # alpha in terms of reciprocal distances, so that each distance may be infinite.
        alpha = ((1 / s - 1 / far) / (1 / near - 1 / far) * (1 - f / near) / (1 - f / s))[..., None]
        combined = alpha * at_infinity[0] + (1 - alpha) * at_infinity[1]
        return (1 - f / s)[..., None] ** _ODD * combined

    def radial_in_depth(self, depth_mm):
        """K1, K2, K3 (..., 3) for objects in depths (...), with the lens focused at focus_mm."""
        # Ki(s, s') = gamma^(2i) Ki(s').
        gamma = depth_factor(depth_mm, self.focus_mm, self.focal_length_mm)
        return gamma[..., None] ** _EVEN * self.radial_at(depth_mm)


def depth_factor(depth_mm, focus_mm, focal_length_mm):
    """Factor gamma of objects in depths: image scale in focus over image scale in depth (S 56).

    Parameters
    ----------
    depth_mm : array_like, shape (...)
        Depth s' along the axis, mm.
    focus_mm, focal_length_mm : float
        s and f, mm.

    Returns
    -------
    ndarray, shape (...)
        gamma, without a unit.

    Notes
    -----
    gamma = (1 - f/s) / (1 - f/s')

    Examples
    --------
    >>> round(float(depth_factor(4000.0, 2000.0, 50.0)), 6)
    0.987342
    """
    # (s - f)/(s' - f) s'/s, with both distances as reciprocals, so that they may be infinite.
    f = focal_length_mm
    return (1 - f / focus_mm) / (1 - f / np.asarray(depth_mm, dtype=float))


def refer_to_focus(xy_mm, depth_mm, interior, form, lens):
    """Refer image points to the focus distance: remove the effect of depth on the distortion.

    Parameters
    ----------
    xy_mm : array_like, shape (n, 2)
        Measured image points, mm.
    depth_mm : array_like, shape (n,)
        Depths along the axis, mm; a point with nan is unchanged.
    interior : array_like, shape (13,) or (n, 13)
        Interior parameters for objects in focus.
    form : tankcal.camera.model.Form
        Form of the distortion, without a balance.
    lens : Lens
        The two calibrations.

    Returns
    -------
    ndarray, shape (n, 2)
        Image points, mm.

    Notes
    -----
    The coefficients in the depth of a point are those of `interior` plus the difference derived
    from the two calibrations. The image point is corrected with these coefficients and distorted
    with the coefficients in focus. The method applies to every convention.
    """
    at_focus = np.broadcast_to(np.asarray(interior, dtype=float), (len(xy_mm), len(PARAMETERS)))
    is_finite = np.isfinite(depth_mm)
    depth_interior = at_focus[is_finite].copy()
    # Only the difference of both calibrations counts; `interior` may come from another adjustment.
    depth_interior[:, _FIRST : _FIRST + 3] += (
        lens.radial_in_depth(np.asarray(depth_mm)[is_finite]) - lens.radial_in_focus
    )
    image = np.array(xy_mm, dtype=float)
    # Correct with the distortion in depth, then distort with the distortion in focus.
    image[is_finite] = distort_image_points(
        correct_image_points(image[is_finite], depth_interior, form), at_focus[is_finite], form
    )
    return image
