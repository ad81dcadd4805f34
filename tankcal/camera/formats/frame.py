"""Camera with a frame: images of rays in pixels, and rays of image points.

A ray (X, Y) has the direction (X, Y, -1) in the frame of the camera: x to the right, y up. The
ideal image point is (c X, c Y). Pixel coordinates count from the centre of the first pixel:

    x = (column - (columns - 1)/2) width        y = -(line - (lines - 1)/2) height

Source: Pessoa 2017 (1, 2).

Fit of a camera
---------------

    minimise the sum of squares, in pixels, of   image(ray; q) - image point

The unknowns q are selected interior parameters. Optional unknowns are a scale and a skew after the
distortion, and a rotation of the camera about its axis, which the exterior orientation takes up:

    x = x0 + (1 + scale) X + skew Y      y = y0 + Y      (X, Y) the image of tankcal from (x0, y0)

The method is Gauss-Newton with the analytic derivatives of tankcal.camera.imaging.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera.imaging import image_point_derivatives
from tankcal.camera.model import PARAMETERS, Form, correct_image_points, distort_image_points
from tankcal.errors import SolutionError
from tankcal.messages import message

COUNTED_ON_FILM = 4608  # nominal pixels along the longest side of a film
GRID = (46, 35)  # points of the frame, including its edges, at which errors are evaluated
SAME_POINT_PX = 1e-6  # distance below which two image points are equal
ROUNDS = 60  # largest number of iterations
SMALL_PX = 1e-12  # root mean square effect of the last step on the image at convergence
SERVES_PX = 1e-9  # accepted effect after all iterations, if rounding prevents convergence
ROUNDING = 1 + 1e-12  # largest growth of a sum of squares by rounding
USUAL = ("c", "x0", "y0", "K1", "K2", "K3", "P1", "P2", "A", "B")
EXTRAS = ("scale", "skew", "turn")


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


@dataclass(frozen=True)
class Fit:
    """Result of a fit.

    Attributes
    ----------
    interior : ndarray, shape (13,)
        Interior parameters.
    scale, skew : float
        Scale and skew after the distortion; 0 if not estimated.
    turn_rad : float
        Rotation of the camera about its axis, with the sign of kappa; 0 if not estimated.
    """

    interior: np.ndarray
    scale: float
    skew: float
    turn_rad: float


def fit(rays, image_mm, pixel_mm, form, start, used, extras=()):
    """Fit a camera to the image points of rays.

    Parameters
    ----------
    rays : ndarray, shape (n, 2)
        Rays, see tankcal.camera.formats.frame.
    image_mm : ndarray, shape (n, 2)
        Image points from the middle of the frame, y up, mm.
    pixel_mm : array_like, shape (2,)
        Width and height of a pixel, mm.
    form : Form
        Form of the fitted camera.
    start : array_like, shape (13,)
        Start values, and values of the parameters that are not estimated.
    used : sequence of str
        Names of the estimated PARAMETERS.
    extras : sequence of str, optional
        Names of the estimated EXTRAS.

    Returns
    -------
    Fit

    Raises
    ------
    SolutionError
        If the parameters cannot be separated, or if the iteration does not converge.
    """
    unknown = [PARAMETERS.index(name) for name in PARAMETERS if name in used]
    unknown += [len(PARAMETERS) + EXTRAS.index(name) for name in EXTRAS if name in extras]
    values = np.concatenate([np.asarray(start, dtype=float), np.zeros(len(EXTRAS))])
    misclosures, jacobian = linearise_fit(values, rays, image_mm, pixel_mm, form)
    for _ in range(ROUNDS):
        columns = jacobian[:, unknown]
        # Columns of length one make the rank independent of the units.
        size = np.linalg.norm(columns, axis=0)
        effective = size > 0  # for example, P3 has no effect with P1 = P2 = 0
        step, _, rank, _ = np.linalg.lstsq(
            columns[:, effective] / size[effective], -misclosures, rcond=None
        )
        if rank < np.count_nonzero(effective):
            raise SolutionError(
                message(
                    "convert_not_told_apart",
                    "the parameters of the camera cannot be separated over the frame",
                )
            )
        step_values = np.zeros_like(values)
        step_values[np.array(unknown)[effective]] = step / size[effective]
        values, misclosures, jacobian, is_reduced = _apply_step(
            values, step_values, misclosures, jacobian, (rays, image_mm, pixel_mm, form)
        )
        # Root mean square change of the image by the step.
        effect_px = np.abs(step).max() / np.sqrt(len(misclosures))
        if effect_px < SMALL_PX or not is_reduced:
            break
    if is_reduced and effect_px > SERVES_PX:
        raise SolutionError(
            message(
                "convert_no_convergence",
                "the conversion did not converge in {rounds} rounds",
                rounds=ROUNDS,
            )
        )
    return Fit(values[: len(PARAMETERS)], *(float(v) for v in values[len(PARAMETERS) :]))


def _apply_step(values, step_values, misclosures, jacobian, arguments):
    """Apply a step, halved until the sum of squares does not grow.

    Returns values, misclosures and derivatives, and whether any step was accepted.
    """
    previous_sum = misclosures @ misclosures
    for halving in range(30):
        trial = values + step_values * 0.5**halving
        with np.errstate(all="ignore"):
            new_misclosures, new_jacobian = linearise_fit(trial, *arguments)
        if (
            np.all(np.isfinite(new_jacobian))
            and new_misclosures @ new_misclosures <= previous_sum * ROUNDING
        ):
            return trial, new_misclosures, new_jacobian, True
    return values, misclosures, jacobian, False


def linearise_fit(values, rays, image_mm, pixel_mm, form):
    """Return misclosures (2 n,) and derivatives (2 n, 16), px: n rows of x, then n rows of y.

    Parameters
    ----------
    values : ndarray, shape (16,)
        Interior parameters, scale, skew and rotation.
    rays, image_mm, pixel_mm, form
        As in `fit`.

    Returns
    -------
    misclosures : ndarray, shape (2 n,)
    jacobian : ndarray, shape (2 n, 16)
    """
    q, (scale, skew, turn) = values[: len(PARAMETERS)], values[len(PARAMETERS) :]
    cos, sin = np.cos(turn), np.sin(turn)
    # Passive rotation of the rays.
    x, y = rays[:, 0] * cos + rays[:, 1] * sin, rays[:, 1] * cos - rays[:, 0] * sin
    of_ideal = form.convention == "distortion_of_ideal"
    u, v, by_x, by_y = image_point_derivatives(
        (x, y, -np.ones_like(x)), np.eye(3).ravel(), tuple(q), form.numbers, of_ideal
    )
    # Scale and skew act on the image relative to the principal point.
    u, v = u - q[1], v - q[2]
    rows = []
    for row in (by_x, by_y):  # by interior parameters without x0 and y0, and by the rotation
        by_interior = [np.zeros_like(x) if i in (7, 8) else row[i] + 0.0 * x for i in range(6, 19)]
        rows.append(np.stack([*by_interior, 0 * x, 0 * x, row[0] * y - row[1] * x], axis=1))
    # Chain rule for scale and skew; x0 and y0 act after them.
    rows_x, rows_y = (1 + scale) * rows[0] + skew * rows[1], rows[1]
    rows_x[:, 1], rows_y[:, 2] = 1.0, 1.0
    rows_x[:, len(PARAMETERS)], rows_x[:, len(PARAMETERS) + 1] = u, v
    misclosures = np.concatenate(
        [
            ((1 + scale) * u + skew * v + q[1] - image_mm[:, 0]) / pixel_mm[0],
            (v + q[2] - image_mm[:, 1]) / pixel_mm[1],
        ]
    )
    return misclosures, np.vstack([rows_x / pixel_mm[0], rows_y / pixel_mm[1]])
