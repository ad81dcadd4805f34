"""The model that programs of computer vision have in common, in pixels.

With x, y the ray to the right and down, r2 = x2 + y2,

    x' = x (1 + k1 r2 + k2 r4 + k3 r6 + k4 r8) + (2 p1 x y + p2 (r2 + 2 x2)) (1 + p3 r2 + p4 r4)
    y' = y (1 + k1 r2 + k2 r4 + k3 r6 + k4 r8) + (p1 (r2 + 2 y2) + 2 p2 x y) (1 + p3 r2 + p4 r4)
    column = cx + fx x' + skew y'              line = cy + fy y'

counted from the centre of the first pixel. It is the plain form of tankcal with pixels of width
fy/fx times their height: exactly so without a skew, which is fitted by A and B.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.fitting import fit
from tankcal.camera.formats.frame import (
    FramedCamera,
    differences_px,
    frame_points,
    make_framed_camera,
    pixels_to_mm,
    rays_of,
)
from tankcal.camera.model import CONVENTIONS, PARAMETERS, Form, balanced_about

RADIAL = ("K1", "K2", "K3", "K4")
DECENTRING = ("P1", "P2", "P3", "P4")


@dataclass(frozen=True)
class Brown:
    """A camera in pixels, see above.

    fx, fy, cx, cy, skew  px          k  (4,) k1..k4          p  (4,) p1..p4 in OpenCV's order
    """

    fx: float
    fy: float
    cx: float
    cy: float
    skew: float
    k: tuple
    p: tuple


@dataclass(frozen=True)
class Has:
    """Which terms a program has beside one focal length and the principal point.

    radial      how many k           decentring  how many p
    two_focals  fx and fy            skew        a skew
    """

    radial: int = 4
    decentring: int = 4
    two_focals: bool = True
    skew: bool = True


def image_of_brown(brown, rays):
    """(n, 2) columns and lines of rays (n, 2), which are counted as in tankcal, y up."""
    x, y = rays[:, 0], -rays[:, 1]
    r2 = x * x + y * y
    k1, k2, k3, k4 = brown.k
    p1, p2, p3, p4 = brown.p
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
    more = 1 + r2 * (p3 + r2 * p4)
    along = x * radial + (2 * p1 * x * y + p2 * (r2 + 2 * x * x)) * more
    down = y * radial + (p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) * more
    return np.column_stack(
        [brown.cx + brown.fx * along + brown.skew * down, brown.cy + brown.fy * down]
    )


def from_brown(brown, pixel_mm, size_px):
    """FramedCamera, of the plain Form().

    pixel_mm  height of a pixel; the width follows from fx and fy

    Raises SolutionError where the distortion folds the image within the frame.
    """
    pixel = np.array([pixel_mm * (brown.fy / brown.fx), pixel_mm])
    points = frame_points(size_px)
    straight = make_framed_camera(_interior(brown, pixel, size_px), Form(), pixel, size_px)
    upright = points - np.outer(points[:, 1] - brown.cy, [brown.skew / brown.fy, 0])
    rays = rays_of(straight, upright)
    interior = straight.interior
    if brown.skew:
        used = [name for name, value in zip(PARAMETERS, interior, strict=True) if value]
        seen = pixels_to_mm(points, pixel, size_px)
        used = ("x0", "y0", "A", "B", *used)
        interior = fit(rays, seen, pixel, Form(), interior, used).interior
    found = make_framed_camera(interior, Form(), pixel, size_px)
    return make_framed_camera(
        interior, Form(), pixel, size_px, differences_px(found, rays, points).max()
    )


def _interior(brown, pixel_mm, size_px):
    c = brown.fy * pixel_mm[1]
    x0, y0 = pixels_to_mm([[brown.cx, brown.cy]], pixel_mm, size_px)[0]
    p1, p2, p3, p4 = brown.p
    radial = [k / c ** (2 * i) for i, k in enumerate(brown.k, 1)]
    return np.array([c, x0, y0, *radial, p2 / c, -p1 / c, p3 / c**2, p4 / c**4, 0, 0])


def to_brown(camera, has=None):
    """(Brown, largest error over the frame, px) of a FramedCamera: exact where `has` allows it.

    Else fitted over the frame, in pixels.
    """
    has = has or Has()
    points = frame_points(camera.size_px)
    rays = rays_of(camera, points)
    brown = _by_formula(camera, has)
    if brown is None:
        brown = _fitted(camera, has, rays, points)
    off = np.hypot(*(image_of_brown(brown, rays) - points).T)
    return brown, float(off.max())


def _by_formula(camera: FramedCamera, has):
    """Brown by formula, or None."""
    if CONVENTIONS[camera.form.convention]:
        return None
    q = balanced_about(camera.interior, camera.form, 0.0)[0]
    missing = [*q[3 + has.radial : 7], *q[7 + has.decentring : 11], *q[11:]]
    width, height = camera.pixel_mm
    if np.any(missing) or (width != height and not has.two_focals):
        return None
    return _brown(q, 0.0, 0.0, camera)


def _fitted(camera, has, rays, points):
    """Brown by a fit in pixels that are square, of the height of the camera's."""
    side = camera.pixel_mm[1]
    start = balanced_about(camera.interior, camera.form, 0.0)[0]
    if CONVENTIONS[camera.form.convention] > 0:
        start[3:9] *= -1
    used = ("c", "x0", "y0", *RADIAL[: has.radial], *DECENTRING[: has.decentring])
    start[[i for i, name in enumerate(PARAMETERS) if name not in used]] = 0.0
    usual = {"K1", "K2", "K3", "P1", "P2"}
    lens = [
        name
        for name, value in zip(PARAMETERS, camera.interior, strict=True)
        if name in used and (value or name in usual or name[0] in "cxy")
    ]
    extras = [name for name, there in (("scale", has.two_focals), ("skew", has.skew)) if there]
    square = np.array([side, side])
    seen = pixels_to_mm(points, square, camera.size_px)
    found = fit(rays, seen, square, Form(), start, lens, extras)
    return _brown(found.interior, found.scale, found.skew, camera, square)


def _brown(q, scale, skew, camera, pixel_mm=None):
    """Brown of interior parameters (13,) of the plain form, and of what acts after it."""
    width, height = camera.pixel_mm if pixel_mm is None else pixel_mm
    columns, lines = camera.size_px
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
        tuple(float(one) + 0.0 for one in p),
    )
