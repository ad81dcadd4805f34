"""Cameras of OpenCV: camera matrix and distortion coefficients.

With x, y the ray to the right and down, r2 = x2 + y2:

    x'' = x (1 + k1 r2 + k2 r4 + k3 r6)/(1 + k4 r2 + k5 r4 + k6 r6)
          + 2 p1 x y + p2 (r2 + 2 x2) + s1 r2 + s2 r4
    y'' = y (...) + p1 (r2 + 2 y2) + 2 p2 x y + s3 r2 + s4 r4

With tauX or tauY not 0, the image plane is tilted by these angles. The centre of the first pixel is
column 0, line 0. The order of the coefficients is k1, k2, p1, p2[, k3[, k4, k5, k6[, s1..s4[, tauX,
tauY]]]], with 4, 5, 8, 12 or 14 elements.

tankcal writes five coefficients. For a camera with more than five coefficients, the plain form is
fitted over the frame.

Source: OpenCV's documentation, module calib3d.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.brown import Brown, Has, from_brown, to_brown
from tankcal.camera.formats.fitting import fit
from tankcal.camera.formats.frame import (
    differences_px,
    frame_points,
    make_framed_camera,
    pixels_to_mm,
    refuse_folds,
)
from tankcal.camera.model import Form

COUNTS = (0, 4, 5, 8, 12, 14)
NEWTON_ROUNDS = 30
FITTED = ("c", "x0", "y0", "K1", "K2", "K3", "K4", "P1", "P2")


@dataclass(frozen=True)
class OpenCV:
    """Camera of OpenCV.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        Camera matrix, px, without skew.
    coefficients : ndarray, shape (n,)
        Distortion coefficients, n one of COUNTS.
    error_px : float
        Largest error of the conversion over the frame, px; only rounding if OpenCV has all terms.
    """

    matrix: np.ndarray
    coefficients: np.ndarray
    error_px: float = 0.0


def from_opencv(camera, pixel_mm, size_px):
    """Convert to a FramedCamera in the plain Form().

    Parameters
    ----------
    camera : OpenCV
        The camera.
    pixel_mm : float
        Height of a pixel, mm. The width follows from fx and fy, which act after the distortion,
        like pixels that are not square.
    size_px : sequence of two int
        Columns and lines.

    Returns
    -------
    FramedCamera

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.
    """
    k = np.zeros(14)
    k[: len(camera.coefficients)] = np.ravel(camera.coefficients)
    (fx, _, cx), (_, fy, cy) = np.asarray(camera.matrix, dtype=float)[:2]
    # Up to five coefficients: the plain form is exact.
    if not np.any(k[5:]):
        brown = Brown(fx, fy, cx, cy, 0.0, (k[0], k[1], k[4], 0.0), (k[2], k[3], 0.0, 0.0))
        return from_brown(brown, pixel_mm, size_px)
    points = frame_points(size_px)
    rays = _invert_distortion(k, (points - [cx, cy]) / [fx, fy], points, [fx, fy]) * [1, -1]
    pixel = np.array([pixel_mm * (fy / fx), pixel_mm])
    c = fy * pixel_mm
    start = np.zeros(13)
    start[:3] = c, *pixels_to_mm([[cx, cy]], pixel, size_px)[0]
    # First-order terms of the rational polynomial as start values.
    start[[3, 7, 8]] = (k[0] - k[5]) / c**2, k[3] / c, -k[2] / c
    used = FITTED + (("A", "B") if np.any(k[8:]) else ())
    image_mm = pixels_to_mm(points, pixel, size_px)
    interior = fit(rays, image_mm, pixel, Form(), start, used).interior
    framed = make_framed_camera(interior, Form(), pixel, size_px)
    error = differences_px(framed, rays, points).max()
    return make_framed_camera(interior, Form(), pixel, size_px, error)


def to_opencv(camera):
    """Convert a FramedCamera, exactly in its plain form, else by a fit over the frame.

    Parameters
    ----------
    camera : FramedCamera
        The camera.

    Returns
    -------
    OpenCV
    """
    brown, error = to_brown(camera, Has(radial=3, decentring=2, skew=False))
    matrix = np.array([[brown.fx, 0, brown.cx], [0, brown.fy, brown.cy], [0, 0, 1]])
    k1, k2, k3, _ = brown.k
    return OpenCV(matrix, np.array([k1, k2, *brown.p[:2], k3]), error)


def distort_rays(x, y, k):
    """Distorted points x'', y'' of rays.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Rays, to the right and down.
    k : sequence of 14
        Coefficients.

    Returns
    -------
    x, y : ndarray, shape (n,)
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = k
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    radial = radial / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    x_image = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
    y_image = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
    if tau_x == 0 and tau_y == 0:
        return x_image, y_image
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    # Tilt of the image plane: rotation, then central projection onto the plane.
    rotation = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    rotation = rotation @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    projection = np.array(
        [[rotation[2, 2], 0, -rotation[0, 2]], [0, rotation[2, 2], -rotation[1, 2]], [0, 0, 1]]
    )
    u, v, w = (projection @ rotation) @ np.stack([x_image, y_image, np.ones_like(x_image)])
    return u / w, v / w


def _invert_distortion(k, plane, points_px, focal_px):
    """Rays (n, 2), right and down, with distorted points plane (n, 2), by Newton's method."""
    x, y = plane.T
    step = 1e-30j
    with np.errstate(all="ignore"):
        for _ in range(NEWTON_ROUNDS):
            u, v = distort_rays(x, y, k)
            # Derivatives by complex step, for all forms of distortion.
            by_x, by_y = distort_rays(x + step, y + 0j, k), distort_rays(x + 0j, y + step, k)
            (a, c), (b, d) = (np.imag(by_x) / 1e-30, np.imag(by_y) / 1e-30)
            error_x, error_y = u - plane[:, 0], v - plane[:, 1]
            determinant = a * d - b * c
            x = x - (d * error_x - b * error_y) / determinant
            y = y - (a * error_y - c * error_x) / determinant
        errors = (np.column_stack(distort_rays(x, y, k)) - plane) * focal_px
    refuse_folds(points_px, np.hypot(*errors.T))
    return np.column_stack([x, y])
