"""How far a parameter shifts image points, over the frame and at its corners.

Three answers for one parameter:

    own          the shift that its value makes: distortion with it less distortion without
    left         what is left of that when it is dropped and the other parameters of the camera take
                 over: the two bundles of rays, compared at the principal distance of the first,
                 corrected(x) - corrected'(x) c / c'
    left_turned  the same after the second bundle has been turned to fit by three small rotations,
                 as the photos would turn: a shift of the principal point hardly counts then

Frame: the declared format, else the rectangle of the farthest image points; GRID by GRID points.
Source: Pessoa 2017 (14-19) for the comparison of bundles.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.imaging import apply_first_affinity, distort
from tankcal.camera.model import CONVENTIONS, PARAMETERS, correct_image_points

GRID = 21


@dataclass(frozen=True)
class Shift:
    """Size of a shift over the frame.

    In um and in px; px is nan where the size of a pixel is not known.

    Attributes
    ----------
    corner_um, corner_px : float
        At the worst corner.
    largest_um, largest_px : float
        Largest anywhere.
    rms_um, rms_px : float
        Root mean square.
    seen_um, seen_px : float
        Largest within the reach of the image points; what lies beyond is extrapolated.
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
    """The frame of an image.

    Attributes
    ----------
    half_mm : ndarray, shape (2,)
        Half width and height, from its middle, mm.
    reach_mm : float
        Distance of the farthest image point from the middle, mm; inf where it is not known.
    pixel_mm : ndarray, shape (2,), or None
        Sides of a pixel, mm.
    """

    half_mm: np.ndarray
    reach_mm: float = np.inf
    pixel_mm: np.ndarray | None = None

    @property
    def corner_mm(self):
        """Distance of the corners from the middle."""
        return float(np.hypot(*self.half_mm))


def own_shift(name, interior, form, frame):
    """The shift that the value of a parameter makes by itself.

    Parameters
    ----------
    name : str
        Name of the parameter.
    interior : array_like, shape (13,)
        Values of the interior parameters.
    form : tankcal.camera.model.Form
        How the distortion is written.
    frame : Frame
        Frame of the image.

    Returns
    -------
    Shift or None
        None for c, which is scale.
    """
    if name == "c":
        return None
    q, number = np.array(interior, dtype=float), PARAMETERS.index(name)
    points = frame_points(frame.half_mm)
    if name in ("x0", "y0"):
        moved = np.zeros_like(points)
        moved[:, number - 1] = q[number]
        return _shift(moved, points, frame)
    lacking = np.where(np.arange(len(q)) == number, 0.0, q)
    x, y = (points - q[1:3]).T
    side = CONVENTIONS[form.convention] or 1.0

    def shifted(p):
        """(2, n) shift by an affinity before the distortion, and by the distortion after it."""
        at = apply_first_affinity(x, y, p, form.numbers)
        return np.array(at) - (x, y) + side * np.array(distort(*at, p, form.numbers)[:2])

    with_it, without_it = shifted(q), shifted(lacking)
    return _shift((with_it - without_it).T, points, frame)


def left_shifts(interior, others, form, frame):
    """The Shift between two cameras, and the Shift after the second has been turned to fit.

    interior, others  (13,) values with the parameter, and without it
    """
    q, p = np.array(interior, dtype=float), np.array(others, dtype=float)
    points = frame_points(frame.half_mm)
    ideal = correct_image_points(points, q, form)
    moved = correct_image_points(points, p, form) * (q[0] / p[0]) - ideal
    turned = moved.ravel()
    ways = _rotations(ideal, q[0]).reshape(-1, 3)
    turned = turned - ways @ np.linalg.lstsq(ways, turned, rcond=None)[0]
    return _shift(moved, points, frame), _shift(turned.reshape(-1, 2), points, frame)


def frame_points(half_frame_mm):
    """(GRID GRID, 2) points that cover the frame, its four corners among them, mm."""
    axis = np.linspace(-1.0, 1.0, GRID)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return grid * np.asarray(half_frame_mm, dtype=float)


def _rotations(ideal_mm, c_mm):
    """(n, 2, 3) change of ideal points by small rotations of the camera about x, y, z."""
    x, y = (ideal_mm / c_mm).T
    one = np.ones_like(x)
    by_x = np.stack([x * y, one + y * y], axis=1)
    by_y = np.stack([-one - x * x, -x * y], axis=1)
    by_z = np.stack([y, -x], axis=1)
    return c_mm * np.stack([by_x, by_y, by_z], axis=2)


def _shift(moved_mm, points_mm, frame):
    corners = [0, GRID - 1, GRID * (GRID - 1), GRID * GRID - 1]
    seen = np.hypot(*points_mm.T) <= frame.reach_mm
    unknown = np.full(2, np.nan)
    pixel = unknown if frame.pixel_mm is None else np.asarray(frame.pixel_mm, dtype=float)
    um, px = (
        (size[corners].max(), size.max(), np.sqrt(np.mean(size**2)), size[seen].max())
        for size in (np.hypot(*(moved_mm / unit).T) for unit in (np.full(2, 1e-3), pixel))
    )
    return Shift(*(float(value) for pair in zip(um, px, strict=True) for value in pair))
