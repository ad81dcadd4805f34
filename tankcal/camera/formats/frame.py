"""Camera with a frame: images of rays in pixels, and rays of image points.

A ray (X, Y) has the direction (X, Y, -1) in the frame of the camera: x to the right, y up. The
ideal image point is (c X, c Y). Pixel coordinates count from the centre of the first pixel:

    x = (column - (columns - 1)/2) width        y = -(line - (lines - 1)/2) height

Source: Pessoa 2017 (1, 2).
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera.model import Form, correct_image_points, distort_image_points
from tankcal.errors import SolutionError
from tankcal.messages import message

COUNTED_ON_FILM = 4608  # nominal pixels along the longest side of a film
GRID = (46, 35)  # points of the frame, including its edges, at which errors are evaluated
SAME_POINT_PX = 1e-6  # distance below which two image points are equal


@dataclass(frozen=True)
class FramedCamera:
    """Camera of tankcal with its frame.

    Attributes
    ----------
    interior : ndarray, shape (13,)
        Interior parameters in the order of camera.PARAMETERS, mm.
    form : Form
        Form of the distortion.
    pixel_mm : ndarray, shape (2,)
        Width and height of a pixel, mm.
    size_px : tuple of int
        Columns and lines.
    error_px : float
        Largest error of the conversion over the frame: distance of image points of equal rays. Only
        rounding for an exact conversion.
    film_mm : ndarray, shape (2,), or None
        Width and height of a film, mm, whose pixels are nominal; None for a digital camera.
    """

    interior: np.ndarray
    form: Form
    pixel_mm: np.ndarray
    size_px: tuple[int, int]
    error_px: float = 0.0
    film_mm: np.ndarray | None = None

    @property
    def error_um(self):
        """error_px as a length in the image, um, for pixels that are square except for rounding."""
        return self.error_px * float(self.pixel_mm.max()) * 1e3


def make_framed_camera(interior, form, pixel_mm, size_px, error_px=0.0):
    """Create a FramedCamera from arrays or lists.

    Parameters
    ----------
    interior : array_like, shape (13,)
        Interior parameters, mm.
    form : Form
        Form of the distortion.
    pixel_mm : float or array_like, shape (2,)
        Size of a pixel, or width and height, mm.
    size_px : sequence of two int
        Columns and lines.
    error_px : float, optional
        Error of the conversion, px.

    Returns
    -------
    FramedCamera
    """
    return FramedCamera(
        np.array(interior, dtype=float),
        form,
        np.array(np.broadcast_to(pixel_mm, 2), dtype=float),
        (int(size_px[0]), int(size_px[1])),
        float(error_px),
    )


def make_film_camera(interior, form, format_mm):
    """Create a FramedCamera for film, which has no pixels.

    Parameters
    ----------
    interior : array_like, shape (13,)
        Interior parameters, mm.
    form : Form
        Form of the distortion.
    format_mm : array_like, shape (2,)
        Width and height of the film, mm.

    Returns
    -------
    FramedCamera
    """
    film_mm = np.array(format_mm, dtype=float)
    # Film has no pixels; nominal pixels provide a grid for errors and conversions.
    size_px = np.maximum(np.round(film_mm / film_mm.max() * COUNTED_ON_FILM), 2)
    return replace(make_framed_camera(interior, form, film_mm / size_px, size_px), film_mm=film_mm)


def frame_points(size_px, counts=GRID):
    """Columns and lines (n, 2) of grid points over a frame, including its edges, px."""
    axes = (np.linspace(0, n - 1, count) for n, count in zip(size_px, counts, strict=True))
    return np.column_stack([axis.ravel() for axis in np.meshgrid(*axes)])


def pixels_to_mm(points_px, pixel_mm, size_px):
    """Convert columns and lines to coordinates from the middle of the frame.

    Parameters
    ----------
    points_px : array_like, shape (n, 2)
        Columns and lines.
    pixel_mm : array_like, shape (2,)
        Width and height of a pixel, mm.
    size_px : sequence of two int
        Columns and lines of the frame.

    Returns
    -------
    ndarray, shape (n, 2)
        Coordinates, y up, mm.
    """
    # Lines count downwards, y upwards, hence the sign.
    middle = (np.array(size_px, dtype=float) - 1) / 2
    return (np.asarray(points_px, dtype=float) - middle) * pixel_mm * [1, -1]


def mm_to_pixels(points_mm, pixel_mm, size_px):
    """Convert coordinates (n, 2), mm, to columns and lines (n, 2): inverse of `pixels_to_mm`."""
    middle = (np.array(size_px, dtype=float) - 1) / 2
    return np.asarray(points_mm, dtype=float) / pixel_mm * [1, -1] + middle


def project_rays(camera, rays):
    """Columns and lines (n, 2) of the images of rays (n, 2)."""
    image_mm = distort_image_points(
        np.asarray(rays) * camera.interior[0], camera.interior, camera.form
    )
    return mm_to_pixels(image_mm, camera.pixel_mm, camera.size_px)


def trace_rays(camera, points_px):
    """Rays (n, 2) of image points.

    Parameters
    ----------
    camera : FramedCamera
        The camera.
    points_px : ndarray, shape (n, 2)
        Columns and lines.

    Returns
    -------
    ndarray, shape (n, 2)

    Raises
    ------
    SolutionError
        If the distortion folds the image, so that a point has no unique ray.
    """
    image_mm = pixels_to_mm(points_px, camera.pixel_mm, camera.size_px)
    with np.errstate(all="ignore"):
        rays = correct_image_points(image_mm, camera.interior, camera.form) / camera.interior[0]
        # A ray is valid only if its image is the given point.
        distances = np.hypot(*(project_rays(camera, rays) - points_px).T)
    refuse_folds(points_px, distances)
    return rays


def refuse_folds(points_px, off_px):
    """Raise SolutionError if the image of a ray is not its image point.

    Parameters
    ----------
    points_px : array_like, shape (n, 2)
        Columns and lines.
    off_px : ndarray, shape (n,)
        Distances between image and image point, px.
    """
    # The negation also covers nan.
    bad = ~(off_px < SAME_POINT_PX)
    if np.any(bad):
        column, line = np.asarray(points_px)[np.flatnonzero(bad)[0]]
        raise SolutionError(
            message(
                "convert_folds",
                "the distortion folds the image at column {column:.0f}, line {line:.0f}: "
                "{bad} of {all} points of the frame have no unique ray",
                column=column,
                line=line,
                bad=np.count_nonzero(bad),
                all=len(bad),
            )
        )


def differences_px(camera, rays, points_px):
    """Distances (n,) between the images of rays (n, 2) and points_px (n, 2), px."""
    return np.hypot(*(project_rays(camera, rays) - points_px).T)
