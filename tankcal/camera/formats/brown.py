"""Common camera model of computer vision programs, in pixels.

With x, y the ray to the right and down, r2 = x2 + y2:

    x' = x (1 + k1 r2 + k2 r4 + k3 r6 + k4 r8) + (2 p1 x y + p2 (r2 + 2 x2)) (1 + p3 r2 + p4 r4)
    y' = y (1 + k1 r2 + k2 r4 + k3 r6 + k4 r8) + (p1 (r2 + 2 y2) + 2 p2 x y) (1 + p3 r2 + p4 r4)
    column = cx + fx x' + skew y'              line = cy + fy y'

Columns and lines count from the centre of the first pixel. The model equals the plain form of
tankcal, with pixels whose width is fy/fx times their height. The conversion is exact without a
skew. A skew is approximated by A and B.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.frame import (
    differences_px,
    fit,
    frame_points,
    make_framed_camera,
    pixels_to_mm,
    trace_rays,
)
from tankcal.camera.model import CONVENTIONS, PARAMETERS, Form, balance_about

RADIAL = ("K1", "K2", "K3", "K4")
DECENTRING = ("P1", "P2", "P3", "P4")


@dataclass(frozen=True)
class Brown:
    """Camera in pixels.

    Attributes
    ----------
    fx, fy, cx, cy, skew : float
        Focal lengths, principal point and skew, px.
    k : tuple of four
        k1..k4.
    p : tuple of four
        p1..p4, in the order of OpenCV.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    skew: float
    k: tuple
    p: tuple


@dataclass(frozen=True)
class Terms:
    """Terms of a program, in addition to one focal length and the principal point.

    Attributes
    ----------
    radial, decentring : int
        Numbers of coefficients k and p.
    two_focals, skew : bool
        True if the program has fx and fy, and a skew.
    """

    radial: int = 4
    decentring: int = 4
    two_focals: bool = True
    skew: bool = True


def project_brown(brown, rays):
    """Columns and lines (n, 2) of rays (n, 2), which have the axes of tankcal (y up)."""
    x, y = rays[:, 0], -rays[:, 1]
    r2 = x * x + y * y
    k1, k2, k3, k4 = brown.k
    p1, p2, p3, p4 = brown.p
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
    decentring = 1 + r2 * (p3 + r2 * p4)
    x_image = x * radial + (2 * p1 * x * y + p2 * (r2 + 2 * x * x)) * decentring
    y_image = y * radial + (p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) * decentring
    return np.column_stack(
        [brown.cx + brown.fx * x_image + brown.skew * y_image, brown.cy + brown.fy * y_image]
    )


def convert_from_brown(brown, pixel_mm, size_px):
    """Convert to a FramedCamera in the plain Form().

    Parameters
    ----------
    brown : Brown
        The camera.
    pixel_mm : float
        Height of a pixel, mm; the width follows from fx and fy.
    size_px : sequence of two int
        Columns and lines.

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.
    """
    pixel = np.array([pixel_mm * (brown.fy / brown.fx), pixel_mm])
    points = frame_points(size_px)
    without_skew = make_framed_camera(_interior(brown, pixel, size_px), Form(), pixel, size_px)
    # The image without its skew has the rays of the camera without skew.
    unskewed = points - np.outer(points[:, 1] - brown.cy, [brown.skew / brown.fy, 0])
    rays = trace_rays(without_skew, unskewed)
    interior = without_skew.interior
    if brown.skew:
        used = [name for name, value in zip(PARAMETERS, interior, strict=True) if value]
        image_mm = pixels_to_mm(points, pixel, size_px)
        used = ("x0", "y0", "A", "B", *used)
        interior = fit(rays, image_mm, pixel, Form(), interior, used).interior
    framed = make_framed_camera(interior, Form(), pixel, size_px)
    return make_framed_camera(
        interior, Form(), pixel, size_px, differences_px(framed, rays, points).max()
    )


def _interior(brown, pixel_mm, size_px):
    """Interior parameters (13,) of the plain form, without the skew."""
    c = brown.fy * pixel_mm[1]
    x0, y0 = pixels_to_mm([[brown.cx, brown.cy]], pixel_mm, size_px)[0]
    p1, p2, p3, p4 = brown.p
    radial = [k / c ** (2 * i) for i, k in enumerate(brown.k, 1)]
    # Coefficients of rays become coefficients of image points in mm; y changes its sign.
    return np.array([c, x0, y0, *radial, p2 / c, -p1 / c, p3 / c**2, p4 / c**4, 0, 0])


def convert_to_brown(camera, terms=None):
    """Convert a FramedCamera, exactly if the terms allow it, else by a fit over the frame.

    Parameters
    ----------
    camera : FramedCamera
        The camera.
    terms : Terms, optional
        Available terms; None: all.

    Returns
    -------
    brown : Brown
    error : float
        Largest error over the frame, px.
    """
    terms = terms or Terms()
    points = frame_points(camera.size_px)
    rays = trace_rays(camera, points)
    # The error is evaluated in the same way for both methods.
    brown = _convert_exactly(camera, terms)
    if brown is None:
        brown = _fit_brown(camera, terms, rays, points)
    distances = np.hypot(*(project_brown(brown, rays) - points).T)
    return brown, float(distances.max())


def _convert_exactly(camera, terms):
    """Brown by formula, or None if a required term is not available."""
    if CONVENTIONS[camera.form.convention]:
        return None
    q = balance_about(camera.interior, camera.form, 0.0)[0]
    # Parameters without a counterpart must be zero.
    missing = [*q[3 + terms.radial : 7], *q[7 + terms.decentring : 11], *q[11:]]
    width, height = camera.pixel_mm
    if np.any(missing) or (width != height and not terms.two_focals):
        return None
    return _create_brown(q, 0.0, 0.0, camera)


def _fit_brown(camera, terms, rays, points):
    """Brown by a fit with square pixels of the height of the camera's pixels."""
    side = camera.pixel_mm[1]
    start = balance_about(camera.interior, camera.form, 0.0)[0]
    if CONVENTIONS[camera.form.convention] > 0:
        # A correction added to the measured point has the opposite sign of a distortion.
        start[3:9] *= -1
    used = ("c", "x0", "y0", *RADIAL[: terms.radial], *DECENTRING[: terms.decentring])
    start[[i for i, name in enumerate(PARAMETERS) if name not in used]] = 0.0
    usual_names = {"K1", "K2", "K3", "P1", "P2"}
    lens = [
        name
        for name, value in zip(PARAMETERS, camera.interior, strict=True)
        if name in used and (value or name in usual_names or name[0] in "cxy")
    ]
    extras = [
        name
        for name, is_available in (("scale", terms.two_focals), ("skew", terms.skew))
        if is_available
    ]
    square = np.array([side, side])
    image_mm = pixels_to_mm(points, square, camera.size_px)
    result = fit(rays, image_mm, square, Form(), start, lens, extras)
    return _create_brown(result.interior, result.scale, result.skew, camera, square)


def _create_brown(q, scale, skew, camera, pixel_mm=None):
    """Brown from interior parameters (13,) of the plain form, scale and skew."""
    width, height = camera.pixel_mm if pixel_mm is None else pixel_mm
    columns, lines = camera.size_px
    # Inverse of _interior: coefficients in mm become coefficients of rays.
    fx, fy = q[0] * (1 + scale) / width, q[0] / height
    middle = ((columns - 1) / 2 + q[1] / width, (lines - 1) / 2 - q[2] / height)
    k = tuple(float(q[2 + i] * q[0] ** (2 * i)) for i in range(1, 5))
    p = (-q[8] * q[0], q[7] * q[0], q[9] * q[0] ** 2, q[10] * q[0] ** 4)
    return Brown(
        float(fx),
        float(fy),
        float(middle[0]),
        float(middle[1]),
        float(-skew * fy) + 0.0,
        k,
        tuple(float(value) + 0.0 for value in p),
    )
