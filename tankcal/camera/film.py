"""Unflatness of film: projection of image points onto the plane of the photo system.

The surface of the film has the height h above this plane at the point (x, y), positive towards the
lens. The ray through the projection centre, at the principal distance c, that meets the surface at
this point meets the plane at

    x' = x c / (c - h),   dx = x h / (c - h)

with coordinates from the principal point, and likewise for y. dx = (x/c) h (Silva 60) is the
first-order term. On a film that rises towards the lens, image points are too close to the middle,
and the correction moves them outwards. All lengths are in mm.

Source: Silva 1995 (60).
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Surface:
    """Measured heights of a film or plate.

    Attributes
    ----------
    xy_mm : ndarray, shape (n, 2)
        Positions in the photo system, mm.
    height_mm : ndarray, shape (n,)
        Heights at these positions, mm, positive towards the lens.
    """

    xy_mm: np.ndarray
    height_mm: np.ndarray


def heights_at(surface, xy_mm):
    """Heights of a film, interpolated linearly within triangles.

    Outside the convex hull of the measured positions, the height of the nearest position is used.

    Parameters
    ----------
    surface : Surface
        At least three positions, not on a line.
    xy_mm : array_like, shape (m, 2)
        Positions in the photo system, mm; nan gives nan.

    Returns
    -------
    height_mm : ndarray, shape (m,)
        Heights, mm.
    outside : ndarray of bool, shape (m,)
        True outside the convex hull; False for nan.

    Examples
    --------
    >>> surface = Surface(np.array([[0, 0], [10, 0], [0, 10]]), np.array([0, 0.1, 0]))
    >>> heights_at(surface, [[5, 0], [20, 0]])
    (array([0.05, 0.1 ]), array([False,  True]))
    """
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import cKDTree

    xy_mm = np.asarray(xy_mm, dtype=float)
    # Points without a measurement stay nan.
    is_finite = np.isfinite(xy_mm).all(axis=1)
    heights = np.full(len(xy_mm), np.nan)
    if is_finite.any():
        heights[is_finite] = LinearNDInterpolator(surface.xy_mm, surface.height_mm)(
            xy_mm[is_finite]
        )
    # The interpolator returns nan outside the convex hull.
    outside = is_finite & np.isnan(heights)
    if outside.any():
        nearest = cKDTree(surface.xy_mm).query(xy_mm[outside])[1]
        heights[outside] = surface.height_mm[nearest]
    return heights, outside


def flatten_film(xy_mm, height_mm, interior):
    """Project image points on an uneven film onto the plane of the photo system.

    Parameters
    ----------
    xy_mm : array_like, shape (n, 2)
        Measured image points, mm.
    height_mm : ndarray, shape (n,)
        Height of the film at each point, mm.
    interior : sequence of three
        c, x0, y0, mm, each a number or an array (n,).

    Returns
    -------
    ndarray, shape (n, 2)
        Image points in the plane, mm.

    Notes
    -----
    x' = x + (x - x0) h / (c - h), and likewise for y.

    Examples
    --------
    >>> flatten_film([[50.0, 0.0]], np.array([0.1]), (100.0, 0.0, 0.0))
    array([[50.05005005,  0.        ]])
    """
    c, x0, y0 = (np.asarray(value, dtype=float) for value in interior)
    # Similar triangles with the projection centre at the distance c.
    factor = height_mm / (c - height_mm)
    x, y = np.asarray(xy_mm, dtype=float).T
    return np.column_stack([x + (x - x0) * factor, y + (y - y0) * factor])
