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
    """Heights of a film or plate: places (n, 2) in the photo system and heights (n,), mm."""

    xy_mm: np.ndarray
    height_mm: np.ndarray


def heights_at(surface, xy_mm):
    """Heights (m,) at places (m, 2), linear within triangles, and (m,) True for those outside.

    Outside the hull of what was measured the height of the nearest place is taken. Places of
    `xy_mm` that are nan stay nan, and are not outside. Needs three places, not on one line.
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


def flattened(xy_mm, height_mm, interior):
    """Image points (n, 2) on the plane, of points read on a film (n,) mm above it.

    interior  c, x0, y0 (mm), numbers or (n,) each
    """
    c, x0, y0 = (np.asarray(one, dtype=float) for one in interior)
    factor = height_mm / (c - height_mm)
    x, y = np.asarray(xy_mm, dtype=float).T
    return np.column_stack([x + (x - x0) * factor, y + (y - y0) * factor])
