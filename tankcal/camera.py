"""Cameras: interior orientation, distortion in all published forms, the image of a point.

With (u, v, w) = R (X - S) the ideal image point, counted from the principal point, is

    xi = -c u / w,   eta = -c v / w

and the distortion of a point (x, y), with r2 = x2 + y2, is the sum of

    radial      x (K1 r2 + K2 r4 + K3 r6 + K4 r8)      balanced about R0: K1 (r2 - R0^2) + ...
    decentring  (P1 (r2 + 2 x2) + 2 P2 x y) (1 + P3 r2 + P4 r4), y alike with P1 and P2 swapped
    affinity    A y, B y ("both_y", Silva 40-44);  A x, B x ("both_x", Pessoa 6);
                A x + B y, 0 ("b1_b2")              written as (dx, dy)

Three conventions say which point that is, and on which side it stands:

    distortion_of_ideal    x = x0 + xi + d(xi)               OpenCV, AICON
    correction_added       (x - x0) + d(x - x0) = xi         Silva 39
    correction_subtracted  (x - x0) - d(x - x0) = xi         Pessoa 10, DBAT

The last two are solved for the measured coordinate x, so every convention is a function of the
unknowns and the misclosure is always "computed minus measured", in the image as it was measured.

Image coordinates and c, x0, y0, R0 in mm; K1 mm^-2, K2 mm^-4 ...; P1, P2 mm^-1, P3 mm^-2, P4 mm^-4.
Source: Silva 1995 (39-47, 58); Pessoa 2017 (3-6, 9, 10); Brown 1971.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.imaging import distort, image_point, undistorted_by

PARAMETERS = ("c", "x0", "y0", "K1", "K2", "K3", "K4", "P1", "P2", "P3", "P4", "A", "B")
CONVENTIONS = {"distortion_of_ideal": 0.0, "correction_added": 1.0, "correction_subtracted": -1.0}
# (dx by A x, dx by A y, dx by B y, dy by B x, dy by B y)
AFFINITIES = {
    "both_y": (0.0, 1.0, 0.0, 0.0, 1.0),
    "both_x": (1.0, 0.0, 0.0, 1.0, 0.0),
    "b1_b2": (1.0, 0.0, 1.0, 0.0, 0.0),
}


@dataclass(frozen=True)
class Form:
    """How the distortion of a camera is written.

    convention         one of CONVENTIONS
    affinity           one of AFFINITIES
    radial_balance_mm  R0, the radius without radial distortion; 0 where none is named
    """

    convention: str = "distortion_of_ideal"
    affinity: str = "b1_b2"
    radial_balance_mm: float = 0.0

    @property
    def numbers(self):
        """(7,) side (0, +1, -1), the five affinity switches, R0^2: what the formulas take."""
        side = CONVENTIONS[self.convention]
        return np.array([side, *AFFINITIES[self.affinity], self.radial_balance_mm**2])


def corrected(xy_mm, interior, form):
    """Ideal image points (n, 2), from the principal point, of measured ones.

    xy_mm     (n, 2) as measured
    interior  (13,) or (n, 13) in the order of PARAMETERS
    form      a Form
    """
    numbers = form.numbers
    q = tuple(np.asarray(interior, dtype=float).T)
    x, y = xy_mm[:, 0] - q[1], xy_mm[:, 1] - q[2]
    if form.convention != "distortion_of_ideal":
        dx, dy = distort(x, y, q, numbers)[:2]
        return np.column_stack([x + numbers[0] * dx, y + numbers[0] * dy])
    numbers[0] = 1.0
    return np.column_stack(undistorted_by(x, y, q, numbers))


def measured(ideal_mm, interior, form):
    """Measured image points (n, 2) of ideal ones, counted from the principal point (mm)."""
    q = tuple(np.asarray(interior, dtype=float).T)
    of_ideal = form.convention == "distortion_of_ideal"
    return np.column_stack(image_point(*ideal_mm.T, q, form.numbers, of_ideal)[:2])


def from_opencv(fx_px, fy_px, cx_px, cy_px, coefficients, pixel_mm, size_px):
    """Interior parameters (13,), form "distortion_of_ideal", affinity "b1_b2", of OpenCV's camera.

    fx_px, fy_px, cx_px, cy_px  the camera matrix
    coefficients                k1, k2, p1, p2, [k3], in units of the focal length, y downwards
    pixel_mm                    side of a pixel
    size_px                     (columns, lines) of the image

    The image of tankcal has its origin in the middle, y upwards (Pessoa 1, 2).
    """
    k1, k2, p1, p2, k3 = (*coefficients, 0.0)[:5]
    c = fy_px * pixel_mm
    x0 = (cx_px - (size_px[0] - 1) / 2) * pixel_mm
    y0 = -(cy_px - (size_px[1] - 1) / 2) * pixel_mm
    if fx_px != fy_px and (k1, k2, p1, p2, k3) != (0.0,) * 5:
        raise ValueError("fx and fy differ: OpenCV's distortion comes before that affinity")
    affinity = fx_px / fy_px - 1.0
    return np.array(
        [c, x0, y0, k1 / c**2, k2 / c**4, k3 / c**6, 0, p2 / c, -p1 / c, 0, 0, affinity, 0]
    )
