"""Differences between two bundles of rays after the fit of a rotation or of an orientation.

With (u, v, w) = R (X - S) the ideal image of a point X is -c u / w, -c v / w (see
tankcal.camera.model). The rotation R, and optionally the projection centre S, are adjusted to image
points:

    rotation_between   X: the rays (x, y, -c) of the second bundle; image: that of the first
    resection          X: object points; image: that of the second bundle

by least squares in pixels, sigma0 = sqrt(v'v / (2n - u)), u = 3 or 6 unknowns. The initial rotation
minimises the distances between the unit vectors of the rays (Wahba's problem, solved by singular
values), so that the rotation may have any size.

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
    """Orientation adjusted to n image points with u unknowns.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        Rotation R.
    position_m : ndarray, shape (3,)
        Projection centre S, m; zeros if it is not adjusted.
    residuals_px : ndarray, shape (n, 2)
        Computed minus given image points, px.
    sigma0_px : float
        sqrt(v'v / (2n - u)), px.
    design_px : ndarray, shape (2n, u)
        Derivatives of the image points, with x and y of each point in turn.
    """

    rotation: np.ndarray
    position_m: np.ndarray
    residuals_px: np.ndarray
    sigma0_px: float
    design_px: np.ndarray


def rays(ideal_mm, c_mm):
    """Rays (x, y, -c), shape (n, 3), of ideal image points (n, 2)."""
    return np.column_stack([ideal_mm, np.full(len(ideal_mm), -float(c_mm))])


def nearest_rotation(to, of):
    """Rotation R (3, 3) that minimises |to - R of|^2, with `to` and `of` (n, 3) as unit vectors."""
    to, of = (vectors / np.linalg.norm(vectors, axis=1)[:, None] for vectors in (to, of))
    # The sign makes the determinant +1, a rotation without reflection.
    left, _, right = np.linalg.svd(to.T @ of)
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    return left @ np.diag([1.0, 1.0, sign]) @ right


def rotation_between(first_mm, first_c_mm, second_mm, second_c_mm, pixel_mm):
    """Fit the rotation of the second bundle onto the first, in the image of the first.

    Parameters
    ----------
    first_mm, second_mm : ndarray, shape (n, 2)
        Ideal image points of the same n measured points, mm.
    first_c_mm, second_c_mm : float
        Focal lengths of the bundles, mm.
    pixel_mm : ndarray, shape (2,)
        Sides of a pixel, mm.

    Returns
    -------
    Fit

    Raises
    ------
    SolutionError
        If the points do not determine the rotation.
    """
    second = rays(second_mm, second_c_mm)
    start = nearest_rotation(rays(first_mm, first_c_mm), second)
    return _fit(second, first_mm, first_c_mm, pixel_mm, start, None)


def resection(object_m, image_mm, c_mm, pixel_mm, position_m):
    """Fit rotation and projection centre of an image of object points.

    Parameters
    ----------
    object_m : ndarray, shape (n, 3)
        Object points, m.
    image_mm : ndarray, shape (n, 2)
        Ideal image points, mm.
    c_mm : float
        Focal length, mm.
    pixel_mm : ndarray, shape (2,)
        Sides of a pixel, mm.
    position_m : array_like, shape (3,)
        Initial projection centre, m.

    Returns
    -------
    Fit

    Raises
    ------
    SolutionError
        If the points do not determine the orientation.
    """
    start = nearest_rotation(rays(image_mm, c_mm), object_m - position_m)
    return _fit(object_m, image_mm, c_mm, pixel_mm, start, np.asarray(position_m, dtype=float))


def orientation_model(place, c_mm, start, pixel_mm):
    """Create the model of an orientation for `adjust`.

    The unknowns are the rotation vector d of exp([d]x) start and, if there are six, the projection
    centre. The observations are image points in pixels, with x and y of each point in turn.

    Parameters
    ----------
    place : ndarray, shape (n, 3)
        Points X.
    c_mm : float
        Focal length, mm.
    start : ndarray, shape (3, 3)
        Initial rotation.
    pixel_mm : array_like, shape (2,)
        Sides of a pixel, mm.

    Returns
    -------
    callable
        model(x, image_px) returns misclosures, design matrix and None.
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
        # Chain rule: from small rotations to the rotation vector
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
    x = adjusted.unknowns
    misclosure, design, _ = model(x, image)
    return Fit(
        rotation=apply_small_rotation(start[None], x[None, :3])[0],
        position_m=np.zeros(3) if position is None else x[3:],
        residuals_px=misclosure.reshape(-1, 2),
        sigma0_px=float(np.sqrt(misclosure @ misclosure / adjusted.dof)),
        design_px=design,
    )
