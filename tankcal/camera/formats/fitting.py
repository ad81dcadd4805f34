"""The camera of a given form that comes nearest to given images of rays, by least squares.

    minimise the sum of squares, in pixels, of   image(ray; q) - image point

over the chosen interior parameters q and, where asked for, a scale and a skew that act after the
distortion, and a turn of the camera about its axis, which its exterior orientation takes:

    x = x0 + (1 + scale) X + skew Y      y = y0 + Y      (X, Y) the image of tankcal from (x0, y0)

Gauss-Newton with the analytic derivatives of tankcal.camera.imaging.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.imaging import image_point_derivatives
from tankcal.camera.model import PARAMETERS
from tankcal.errors import SolutionError
from tankcal.messages import message

ROUNDS = 60
SMALL_PX = 1e-12  # root mean square effect of the last step on the image
SERVES_PX = 1e-9  # and of the last of all rounds, if none was small: rounding goes on and on
ROUNDING = 1 + 1e-12  # a sum of squares grows by less through rounding alone
USUAL = ("c", "x0", "y0", "K1", "K2", "K3", "P1", "P2", "A", "B")
EXTRAS = ("scale", "skew", "turn")


@dataclass(frozen=True)
class Fit:
    """What was fitted.

    interior     (13,)
    scale, skew  after the distortion, see above; 0 where not asked for
    turn_rad     of the camera about its axis, passive: as kappa; 0 where not asked for
    """

    interior: np.ndarray
    scale: float
    skew: float
    turn_rad: float


def fit(rays, image_mm, pixel_mm, form, start, used, extras=()):
    """Fit of the image points of rays.

    rays      (n, 2), see frame            image_mm  (n, 2) from the middle, y up
    pixel_mm  (2,)                         form      Form of what is sought
    start     (13,) first values, and those of the parameters that are not used
    used      names of PARAMETERS          extras    names of EXTRAS

    Raises SolutionError when the parameters cannot be told apart or nothing converges.
    """
    unknown = [PARAMETERS.index(name) for name in PARAMETERS if name in used]
    unknown += [len(PARAMETERS) + EXTRAS.index(name) for name in EXTRAS if name in extras]
    values = np.concatenate([np.asarray(start, dtype=float), np.zeros(len(EXTRAS))])
    off, jacobian = rows_of_fit(values, rays, image_mm, pixel_mm, form)
    for _ in range(ROUNDS):
        columns = jacobian[:, unknown]
        size = np.linalg.norm(columns, axis=0)
        felt = size > 0  # P3 beside P1 = P2 = 0 has no effect
        step, _, rank, _ = np.linalg.lstsq(columns[:, felt] / size[felt], -off, rcond=None)
        if rank < np.count_nonzero(felt):
            raise SolutionError(
                message(
                    "convert_not_told_apart",
                    "the parameters of the camera cannot be separated over the frame",
                )
            )
        moved = np.zeros_like(values)
        moved[np.array(unknown)[felt]] = step / size[felt]
        values, off, jacobian, shrunk = _shortened(
            values, moved, off, jacobian, (rays, image_mm, pixel_mm, form)
        )
        effect_px = np.abs(step).max() / np.sqrt(len(off))
        if effect_px < SMALL_PX or not shrunk:
            break
    if shrunk and effect_px > SERVES_PX:
        raise SolutionError(
            message(
                "convert_no_convergence",
                "the conversion did not converge in {rounds} rounds",
                rounds=ROUNDS,
            )
        )
    return Fit(values[: len(PARAMETERS)], *(float(v) for v in values[len(PARAMETERS) :]))


def _shortened(values, moved, off, jacobian, given):
    """Values after the step, halved until the sum of squares does not grow; whether any served."""
    before = off @ off
    for halving in range(30):
        trial = values + moved * 0.5**halving
        with np.errstate(all="ignore"):
            new_off, new_jacobian = rows_of_fit(trial, *given)
        if np.all(np.isfinite(new_jacobian)) and new_off @ new_off <= before * ROUNDING:
            return trial, new_off, new_jacobian, True
    return values, off, jacobian, False


def rows_of_fit(values, rays, image_mm, pixel_mm, form):
    """(2 n,) misclosures and (2 n, 16) derivatives, px, x rows before y rows.

    values  (16,) interior parameters, scale, skew, turn; the others as fit takes them
    """
    q, (scale, skew, turn) = values[: len(PARAMETERS)], values[len(PARAMETERS) :]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = rays[:, 0] * cos + rays[:, 1] * sin, rays[:, 1] * cos - rays[:, 0] * sin
    of_ideal = form.convention == "distortion_of_ideal"
    u, v, along, up = image_point_derivatives(
        (x, y, -np.ones_like(x)), np.eye(3).ravel(), tuple(q), form.numbers, of_ideal
    )
    u, v = u - q[1], v - q[2]
    rows = []
    for row in (along, up):  # by the interior parameters without x0 and y0, and by the turn
        own = [np.zeros_like(x) if i in (7, 8) else row[i] + 0.0 * x for i in range(6, 19)]
        rows.append(np.stack([*own, 0 * x, 0 * x, row[0] * y - row[1] * x], axis=1))
    of_x, of_y = (1 + scale) * rows[0] + skew * rows[1], rows[1]
    of_x[:, 1], of_y[:, 2] = 1.0, 1.0
    of_x[:, len(PARAMETERS)], of_x[:, len(PARAMETERS) + 1] = u, v
    off = np.concatenate(
        [
            ((1 + scale) * u + skew * v + q[1] - image_mm[:, 0]) / pixel_mm[0],
            (v + q[2] - image_mm[:, 1]) / pixel_mm[1],
        ]
    )
    return off, np.vstack([of_x / pixel_mm[0], of_y / pixel_mm[1]])
