"""Film that is not flat: where an image point would lie on the plane of the photo system.

The film's surface stands h above that plane at the point (x, y), positive towards the lens. The ray
through the projection centre, at the principal distance c, that meets the surface there meets the
plane at

    x' = x c / (c - h),   dx = x h / (c - h),

of which dx = (x/c) h (Silva 60) is the first order; y alike; both from the principal point. So a
film that rises towards the lens has its image points too close to the middle, and they move out.
Millimetres throughout. Source: Silva 1995 (60).
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Surface:
    """Measured heights of a film or plate.

    Attributes
    ----------
    xy_mm : ndarray, shape (n, 2)
        Places in the photo system, mm.
    height_mm : ndarray, shape (n,)
        Heights there, mm, positive towards the lens.
    """

    xy_mm: np.ndarray
    height_mm: np.ndarray


def heights_at(surface, xy_mm):
    """Heights of a film at places, linear within triangles.

    Outside the hull of what was measured the height of the nearest place is taken.

    Parameters
    ----------
    surface : Surface
        At least three places, not on one line.
    xy_mm : array_like, shape (m, 2)
        Places in the photo system, mm; nan stays nan.

    Returns
    -------
    height_mm : ndarray, shape (m,)
        Heights, mm.
    outside : ndarray of bool, shape (m,)
        True outside the hull of what was measured; places that are nan are not outside.

    Examples
    --------
    >>> surface = Surface(np.array([[0, 0], [10, 0], [0, 10]]), np.array([0, 0.1, 0]))
    >>> heights_at(surface, [[5, 0], [20, 0]])
    (array([0.05, 0.1 ]), array([False,  True]))
    """
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import cKDTree

    xy_mm = np.asarray(xy_mm, dtype=float)
    known = np.isfinite(xy_mm).all(axis=1)
    found = np.full(len(xy_mm), np.nan)
    if known.any():
        found[known] = LinearNDInterpolator(surface.xy_mm, surface.height_mm)(xy_mm[known])
    outside = known & np.isnan(found)
    if outside.any():
        nearest = cKDTree(surface.xy_mm).query(xy_mm[outside])[1]
        found[outside] = surface.height_mm[nearest]
    return found, outside


def flatten_film(xy_mm, height_mm, interior):
    """Move image points read on a film that is not flat to the plane of the photo system.

    x' = x + (x - x0) h / (c - h), y alike.

    Parameters
    ----------
    xy_mm : array_like, shape (n, 2)
        Image points as read, mm.
    height_mm : ndarray, shape (n,)
        Height of the film at each point, mm.
    interior : sequence of three
        c, x0, y0, mm, numbers or (n,) each.

    Returns
    -------
    ndarray, shape (n, 2)
        Image points on the plane, mm.

    Examples
    --------
    >>> flatten_film([[50.0, 0.0]], np.array([0.1]), (100.0, 0.0, 0.0))
    array([[50.05005005,  0.        ]])
    """
    c, x0, y0 = (np.asarray(one, dtype=float) for one in interior)
    factor = height_mm / (c - height_mm)
    x, y = np.asarray(xy_mm, dtype=float).T
    return np.column_stack([x + (x - x0) * factor, y + (y - y0) * factor])
