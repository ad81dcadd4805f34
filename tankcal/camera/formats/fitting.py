"""Fit of a camera of a given form to given images of rays, by least squares.

    minimise the sum of squares, in pixels, of   image(ray; q) - image point

The unknowns q are selected interior parameters. Optional unknowns are a scale and a skew after the
distortion, and a rotation of the camera about its axis, which the exterior orientation takes up:

    x = x0 + (1 + scale) X + skew Y      y = y0 + Y      (X, Y) the image of tankcal from (x0, y0)

The method is Gauss-Newton with the analytic derivatives of tankcal.camera.imaging.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.imaging import image_point_derivatives
from tankcal.camera.model import PARAMETERS
from tankcal.errors import SolutionError
from tankcal.messages import message

ROUNDS = 60  # largest number of iterations
SMALL_PX = 1e-12  # root mean square effect of the last step on the image at convergence
SERVES_PX = 1e-9  # accepted effect after all iterations, if rounding prevents convergence
ROUNDING = 1 + 1e-12  # largest growth of a sum of squares by rounding
USUAL = ("c", "x0", "y0", "K1", "K2", "K3", "P1", "P2", "A", "B")
EXTRAS = ("scale", "skew", "turn")


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
    """Misclosures (2 n,) and derivatives (2 n, 16), px; all rows of x precede those of y.

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
