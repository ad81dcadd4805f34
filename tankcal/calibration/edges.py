"""Effect of the parameters of a camera over its frame: shifts of image points, curves.

Three shifts are computed for a parameter:

    own          distortion with the value of the parameter less distortion without it
    left         remaining shift if the parameter is dropped and the other parameters compensate it:
                 difference of the two bundles of rays at the principal distance of the first,
                 corrected(x) - corrected'(x) c / c'
    left_turned  remaining shift after three small rotations of the second bundle; they correspond
                 to rotations of the photos and absorb most of a shift of the principal point

The frame is the declared format, or else the rectangle of the farthest image points, with GRID by
GRID points. Source: Pessoa 2017 (14-19) for the comparison of bundles.

Distortion curves
-----------------

The radial curve is the measured radius less the radius corrected by the radial terms alone. This
definition holds in every convention. The decentring profile is
sqrt(P1^2 + P2^2) r^2 (1 + P3 r^2 + P4 r^4). On the circle of radius r the largest shift is three
times the profile in the radial direction, and once the profile in the tangential direction.

Source: Brown 1971.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.imaging import apply_first_affinity, distort, distortion_derivatives
from tankcal.camera.model import CONVENTIONS, PARAMETERS, correct_image_points

GRID = 21  # points along each side of the frame
RADIAL = slice(PARAMETERS.index("K1"), PARAMETERS.index("K4") + 1)
DECENTRING = slice(PARAMETERS.index("P1"), PARAMETERS.index("P4") + 1)


@dataclass(frozen=True)
class Shift:
    """Size of a shift over the frame, in um and px; px is nan if the pixel size is not known.

    Attributes
    ----------
    corner_um, corner_px : float
        Largest shift at a corner.
    largest_um, largest_px : float
        Largest shift in the frame.
    rms_um, rms_px : float
        Root mean square over the frame.
    seen_um, seen_px : float
        Largest shift within the radius of the farthest image point; shifts beyond this radius are
        extrapolated.
    """

    corner_um: float
    corner_px: float
    largest_um: float
    largest_px: float
    rms_um: float
    rms_px: float
    seen_um: float
    seen_px: float


@dataclass(frozen=True)
class Frame:
    """Frame of an image.

    Attributes
    ----------
    half_mm : ndarray, shape (2,)
        Half the width and half the height, mm.
    reach_mm : float
        Distance of the farthest image point from the centre, mm; inf if it is not known.
    pixel_mm : ndarray, shape (2,), or None
        Sides of a pixel, mm; None if they are not known.
    """

    half_mm: np.ndarray
    reach_mm: float = np.inf
    pixel_mm: np.ndarray | None = None

    @property
    def corner_mm(self):
        """Distance of the corners from the centre, mm."""
        return float(np.hypot(*self.half_mm))


def own_shift(name, interior, form, frame):
    """Shift of image points by the value of one parameter.

    Parameters
    ----------
    name : str
        Name of the parameter.
    interior : array_like, shape (13,)
        Values of the interior parameters.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    frame : Frame
        Frame of the image.

    Returns
    -------
    Shift or None
        None for the principal distance c, which changes only the scale.
    """
    if name == "c":
        return None
    q, number = np.array(interior, dtype=float), PARAMETERS.index(name)
    points = frame_points(frame.half_mm)
    if name in ("x0", "y0"):
        moved = np.zeros_like(points)
        moved[:, number - 1] = q[number]
        return _size_of_shift(moved, points, frame)
    # Difference of the distortion with the parameter and with the parameter set to zero
    q_without = np.where(np.arange(len(q)) == number, 0.0, q)
    x, y = (points - q[1:3]).T
    side = CONVENTIONS[form.convention] or 1.0

    def shifted(p):
        """Shift (2, n) by the affinity and then the distortion, with interior parameters p."""
        transformed = apply_first_affinity(x, y, p, form.numbers)
        return (
            np.array(transformed)
            - (x, y)
            + side * np.array(distort(*transformed, p, form.numbers)[:2])
        )

    shift_with, shift_without = shifted(q), shifted(q_without)
    return _size_of_shift((shift_with - shift_without).T, points, frame)


def left_shifts(interior, others, form, frame):
    """Shift between two cameras, before and after rotating the second to the best fit.

    Parameters
    ----------
    interior, others : array_like, shape (13,)
        Values of the interior parameters with and without the dropped parameter.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    frame : Frame
        Frame of the image.

    Returns
    -------
    tuple of Shift
        Shift before and after the rotation.
    """
    q, p = np.array(interior, dtype=float), np.array(others, dtype=float)
    points = frame_points(frame.half_mm)
    ideal = correct_image_points(points, q, form)
    # Compare both bundles at the principal distance of the first camera.
    difference = correct_image_points(points, p, form) * (q[0] / p[0]) - ideal
    rotated = difference.ravel()
    rotations = _rotation_derivatives(ideal, q[0]).reshape(-1, 3)
    rotated = rotated - rotations @ np.linalg.lstsq(rotations, rotated, rcond=None)[0]
    return _size_of_shift(difference, points, frame), _size_of_shift(
        rotated.reshape(-1, 2), points, frame
    )


def frame_points(half_frame_mm):
    """Regular points of the frame including its four corners, shape (GRID GRID, 2), mm."""
    axis = np.linspace(-1.0, 1.0, GRID)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return grid * np.asarray(half_frame_mm, dtype=float)


def _rotation_derivatives(ideal_mm, c_mm):
    """Derivatives (n, 2, 3) of ideal image points by rotations of the camera about x, y, z."""
    x, y = (ideal_mm / c_mm).T
    ones = np.ones_like(x)
    by_x = np.stack([x * y, ones + y * y], axis=1)
    by_y = np.stack([-ones - x * x, -x * y], axis=1)
    by_z = np.stack([y, -x], axis=1)
    return c_mm * np.stack([by_x, by_y, by_z], axis=2)


def _size_of_shift(moved_mm, points_mm, frame):
    corners = [0, GRID - 1, GRID * (GRID - 1), GRID * GRID - 1]
    is_in_reach = np.hypot(*points_mm.T) <= frame.reach_mm
    unknown = np.full(2, np.nan)
    pixel = unknown if frame.pixel_mm is None else np.asarray(frame.pixel_mm, dtype=float)
    um, px = (
        (size[corners].max(), size.max(), np.sqrt(np.mean(size**2)), size[is_in_reach].max())
        for size in (np.hypot(*(moved_mm / unit).T) for unit in (np.full(2, 1e-3), pixel))
    )
    return Shift(*(float(value) for pair in zip(um, px, strict=True) for value in pair))


def radial_curve(radius_mm, interior, form, covariance=None):
    """Radial distortion at measured radii, and its standard deviation.

    The standard deviation follows from the law of propagation of uncertainty.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii in the image as measured, mm.
    interior : array_like, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.
    form : tankcal.camera.model.Form
        Form of the distortion model.
    covariance : ndarray, shape (4, 4), optional
        Covariance matrix of K1, K2, K3, K4.

    Returns
    -------
    curve_mm : ndarray, shape (n,)
        Radial distortion, mm.
    sd_mm : ndarray, shape (n,), or None
        Standard deviation of the radial distortion, mm; None without a covariance.
    """
    radius = np.asarray(radius_mm, dtype=float)
    radial = np.zeros(len(PARAMETERS))
    radial[RADIAL] = np.asarray(interior, dtype=float)[RADIAL]
    corrected = correct_image_points(
        np.column_stack([radius, np.zeros_like(radius)]), radial, form
    )[:, 0]
    if covariance is None:
        return radius - corrected, None
    # The polynomial is a function of the corrected or of the measured radius, by convention.
    is_of_ideal = form.convention == "distortion_of_ideal"
    radius_of_polynomial = corrected if is_of_ideal else radius
    slope = distort(radius_of_polynomial, 0.0 * radius_of_polynomial, radial, form.numbers)[2]
    by_k = np.array(
        distortion_derivatives(
            radius_of_polynomial, 0.0 * radius_of_polynomial, radial, form.numbers
        )[0][:4]
    )
    if is_of_ideal:  # derivative at a fixed measured radius, by implicit differentiation
        by_k = by_k / (1.0 + slope)
    variance = np.einsum("in,ij,jn->n", by_k, np.asarray(covariance, dtype=float), by_k)
    return radius - corrected, np.sqrt(variance)


def decentring_profile(radius_mm, interior):
    """Magnitude of the decentring profile, a third of the largest radial shift.

    Parameters
    ----------
    radius_mm : ndarray, shape (n,)
        Radii, mm.
    interior : ndarray, shape (13,)
        Interior parameters in the order of tankcal.camera.model.PARAMETERS.

    Returns
    -------
    ndarray, shape (n,)
        Decentring profile, mm.

    Examples
    --------
    >>> import numpy as np
    >>> interior = np.zeros(13)
    >>> interior[7] = 1e-5  # P1
    >>> decentring_profile(np.array([10.0]), interior)
    array([0.001])
    """
    r2 = np.asarray(radius_mm, dtype=float) ** 2
    p1, p2, p3, p4 = np.asarray(interior, dtype=float)[DECENTRING]
    return np.hypot(p1, p2) * r2 * np.abs(1.0 + p3 * r2 + p4 * r2**2)
