"""A camera with its frame: images of rays in pixels, and the rays of image points.

A ray is (X, Y) for the direction (X, Y, -1) in the camera's frame: x to the right, y up, so that
the ideal image point is c X, c Y. The pixels of tankcal count from the centre of the first pixel:

    x = (column - (columns - 1)/2) width        y = -(line - (lines - 1)/2) height

Source: Pessoa 2017 (1, 2).
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera.model import Form, correct_image_points, distort_image_points
from tankcal.errors import SolutionError
from tankcal.messages import message

COUNTED_ON_FILM = 4608  # stand-ins for pixels along the longest side of a film
GRID = (46, 35)  # points of the frame, edges included, over which errors are stated
SAME_POINT_PX = 1e-6


@dataclass(frozen=True)
class FramedCamera:
    """A camera of tankcal and its frame.

    interior  (13,) in the order of camera.PARAMETERS, mm
    form      a Form
    pixel_mm  (2,) width and height of a pixel
    size_px   (2,) columns, lines
    error_px  what the conversion that made it could not express: the largest distance of an image
              point over the frame, the rays being the same; 0 but for rounding where it is exact
    film_mm   (2,) width and height of a film, whose pixels are stand-ins to count in; else None
    """

    interior: np.ndarray
    form: Form
    pixel_mm: np.ndarray
    size_px: tuple[int, int]
    error_px: float = 0.0
    film_mm: np.ndarray | None = None

    @property
    def error_um(self):
        """error_px as a length in the image, of pixels that are square but for rounding."""
        return self.error_px * float(self.pixel_mm.max()) * 1e3


def make_framed_camera(interior, form, pixel_mm, size_px, error_px=0.0):
    """FramedCamera of arrays or lists.

    pixel_mm  one number, or width and height
    """
    return FramedCamera(
        np.array(interior, dtype=float),
        form,
        np.array(np.broadcast_to(pixel_mm, 2), dtype=float),
        (int(size_px[0]), int(size_px[1])),
        float(error_px),
    )


def make_film_camera(interior, form, format_mm):
    """FramedCamera of a film, which has no pixels.

    format_mm  (2,) width and height
    """
    film_mm = np.array(format_mm, dtype=float)
    size_px = np.maximum(np.round(film_mm / film_mm.max() * COUNTED_ON_FILM), 2)
    return replace(make_framed_camera(interior, form, film_mm / size_px, size_px), film_mm=film_mm)


def frame_points(size_px, counts=GRID):
    """(n, 2) columns and lines of points all over a frame, px, edges included."""
    axes = (np.linspace(0, n - 1, count) for n, count in zip(size_px, counts, strict=True))
    return np.column_stack([axis.ravel() for axis in np.meshgrid(*axes)])


def pixels_to_mm(points_px, pixel_mm, size_px):
    """(n, 2) mm from the middle of the frame, y up, of columns and lines (n, 2)."""
    middle = (np.array(size_px, dtype=float) - 1) / 2
    return (np.asarray(points_px, dtype=float) - middle) * pixel_mm * [1, -1]


def mm_to_pixels(points_mm, pixel_mm, size_px):
    """(n, 2) columns and lines of points (n, 2) in mm from the middle of the frame, y up."""
    middle = (np.array(size_px, dtype=float) - 1) / 2
    return np.asarray(points_mm, dtype=float) / pixel_mm * [1, -1] + middle


def image_of(camera, rays):
    """(n, 2) columns and lines of the image points of rays (n, 2)."""
    seen = distort_image_points(np.asarray(rays) * camera.interior[0], camera.interior, camera.form)
    return mm_to_pixels(seen, camera.pixel_mm, camera.size_px)


def rays_of(camera, points_px):
    """(n, 2) rays of image points (n, 2).

    Raises SolutionError where the distortion folds the image: a point with no ray of its own.
    """
    seen = pixels_to_mm(points_px, camera.pixel_mm, camera.size_px)
    with np.errstate(all="ignore"):
        rays = correct_image_points(seen, camera.interior, camera.form) / camera.interior[0]
        off = np.hypot(*(image_of(camera, rays) - points_px).T)
    refuse_folds(points_px, off)
    return rays


def refuse_folds(points_px, off_px):
    """Raise SolutionError when a ray does not come back to its image point.

    points_px  (n, 2) columns and lines        off_px  (n,) distances, px
    """
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
    """(n,) distances between the images of rays (n, 2) and points_px (n, 2)."""
    return np.hypot(*(image_of(camera, rays) - points_px).T)
