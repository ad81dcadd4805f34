"""Shift of image points by a parameter of the camera, over the frame and at its corners.

Three shifts are computed for a parameter:

    own          distortion with the value of the parameter less distortion without it
    left         remaining shift if the parameter is dropped and the other parameters compensate it:
                 difference of the two bundles of rays at the principal distance of the first,
                 corrected(x) - corrected'(x) c / c'
    left_turned  remaining shift after three small rotations of the second bundle; they correspond
                 to rotations of the photos and absorb most of a shift of the principal point

The frame is the declared format, or else the rectangle of the farthest image points, with GRID by
GRID points. Source: Pessoa 2017 (14-19) for the comparison of bundles.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.imaging import apply_first_affinity, distort
from tankcal.camera.model import CONVENTIONS, PARAMETERS, correct_image_points

GRID = 21  # points along each side of the frame


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
