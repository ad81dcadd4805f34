"""How far two bundles of rays differ once a rotation, or a whole orientation, is given away.

With (u, v, w) = R (X - S) the ideal image of a place is -c u / w, -c v / w (tankcal.camera.model).
The rotation R, and with it the projection centre S where that is free, is adjusted to image points:

    rotation_between   X: the rays (x, y, -c) of the second bundle; image: that of the first
    resection          X: object points; image: that of the second bundle

by least squares in pixels, sigma0 = sqrt(v'v / (2n - u)), u = 3 or 6 unknowns. The start of the
rotation is the one that brings the unit vectors of the rays nearest to each other (Wahba's
problem, by singular values), so that it may be of any size.
Source: Pessoa 2017 (17-19); Habib, Pullivelli, Mitishita, Ghanma & Kim 2006; Markley 1988.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import adjust
from tankcal.camera.imaging import ideal_point
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import apply_small_rotation, vector_derivatives
from tankcal.messages import message


@dataclass(frozen=True)
class Fit:
    """An orientation adjusted to n image points with u unknowns.

    rotation      (3, 3) R
    position_m    (3,) S; zeros where it is not adjusted
    residuals_px  (n, 2) computed minus given image points
    sigma0_px     sqrt(v'v / (2n - u))
    design_px     (2n, u) derivatives of the image points, x and y of each in turn
    """

    rotation: np.ndarray
    position_m: np.ndarray
    residuals_px: np.ndarray
    sigma0_px: float
    design_px: np.ndarray


def rays(ideal_mm, c_mm):
    """(n, 3) rays x, y, -c of ideal image points (n, 2)."""
    return np.column_stack([ideal_mm, np.full(len(ideal_mm), -float(c_mm))])


def nearest_rotation(to, of):
    """(3, 3) R with the least sum of squares of `to` - R `of`, both (n, 3) made unit vectors."""
    to, of = (one / np.linalg.norm(one, axis=1)[:, None] for one in (to, of))
    left, _, right = np.linalg.svd(to.T @ of)
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    return left @ np.diag([1.0, 1.0, sign]) @ right


def rotation_between(first_mm, first_c_mm, second_mm, second_c_mm, pixel_mm):
    """Fit of the rotation that turns the second bundle onto the first, in the image of the first.

    first_mm, second_mm      (n, 2) ideal image points of the same n image points
    first_c_mm, second_c_mm  the focal lengths that the bundles have
    pixel_mm                 (2,) sides of a pixel
    Raises SolutionError where n points do not determine it.
    """
    second = rays(second_mm, second_c_mm)
    start = nearest_rotation(rays(first_mm, first_c_mm), second)
    return _fit(second, first_mm, first_c_mm, pixel_mm, start, None)


def resection(object_m, image_mm, c_mm, pixel_mm, position_m):
    """Fit of rotation and projection centre of an image of object points.

    object_m    (n, 3)                     image_mm  (n, 2) ideal image points
    position_m  (3,) start of the centre   pixel_mm  (2,) sides of a pixel
    Raises SolutionError where n points do not determine it.
    """
    start = nearest_rotation(rays(image_mm, c_mm), object_m - position_m)
    return _fit(object_m, image_mm, c_mm, pixel_mm, start, np.asarray(position_m, dtype=float))


def orientation_model(place, c_mm, start, pixel_mm):
    """Model for `adjust`: x = rotation vector d of exp([d]x) start, and the centre where 6 long.

    place  (n, 3)        start  (3, 3)
    Image points in pixels, x and y of each in turn.
    """

    def model(x, image_px):
        turn = x[None, :3]
        rotation = apply_small_rotation(start[None], turn)[0]
        position = x[3:] if len(x) > 3 else np.zeros(3)
        seen = rotation @ (place - position).T
        if np.any(seen[2] >= 0):
            raise SolutionError(
                message(
                    "compare_behind",
                    "points behind the camera; expected bundles of rays of one camera",
                )
            )
        xi, eta, by_x, by_y = ideal_point(*seen, rotation.ravel(), c_mm)
        by = np.stack([np.column_stack(by_x[:6]), np.column_stack(by_y[:6])], axis=1)
        by /= np.asarray(pixel_mm)[:, None]
        by = by.reshape(-1, 6)
        of_turn = by[:, 3:] @ np.linalg.inv(vector_derivatives(turn)[0])
        design = of_turn if len(x) == 3 else np.column_stack([of_turn, -by[:, :3]])
        return (np.column_stack([xi, eta]) / pixel_mm).ravel() - image_px, design, None

    return model


def _fit(place, image_mm, c_mm, pixel_mm, start, position):
    model = orientation_model(place, c_mm, start, pixel_mm)
    unknowns = np.zeros(3) if position is None else np.append(np.zeros(3), position)
    image = (image_mm / pixel_mm).ravel()
    if len(image) <= len(unknowns):
        raise SolutionError(
            message(
                "compare_fit_few",
                "{points} points for {unknowns} unknowns: too few",
                points=len(place),
                unknowns=len(unknowns),
            )
        )
    adjusted = adjust(model, unknowns, image, np.ones(len(image)))
    found = adjusted.unknowns
    misclosure, design, _ = model(found, image)
    return Fit(
        rotation=apply_small_rotation(start[None], found[None, :3])[0],
        position_m=np.zeros(3) if position is None else found[3:],
        residuals_px=misclosure.reshape(-1, 2),
        sigma0_px=float(np.sqrt(misclosure @ misclosure / adjusted.dof)),
        design_px=design,
    )
