"""Surface of the bottom of a tank over the plan of the shell, and the volume above it.

Plan coordinates are those of the survey, shifted along the axis of the shell to the bottom of the
first course. This shear preserves volumes and makes a leaning shell upright. Heights count from
there, in metres; azimuths clockwise from +y.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.units import FULL_TURN


@dataclass(frozen=True)
class Footprint:
    """Inside outline of the first course at its bottom.

    Attributes
    ----------
    x_m, y_m : float
        Centre, on the axis of the shell, m.
    radius_m : ndarray, shape (n,)
        Radii about the centre, at n evenly spaced azimuths from +y on, m.

    Examples
    --------
    >>> round(Footprint(0.0, 0.0, np.full(36, 2.0)).area_m2, 3)
    12.566
    """

    x_m: float
    y_m: float
    radius_m: np.ndarray

    @property
    def area_m2(self):
        """Area 1/2 integral of r^2: a mean over even azimuths, best for a smooth closed outline."""
        return float(np.pi * np.mean(self.radius_m**2))

    def radius_at(self, azimuth_rad):
        """Return the radius (len(azimuth),), linear between the azimuths."""
        azimuths = np.arange(len(self.radius_m)) * FULL_TURN / len(self.radius_m)
        return np.interp(azimuth_rad, azimuths, self.radius_m, period=FULL_TURN)

    def mesh(self, rings, azimuths):
        """Return plan coordinates (v, 2) about the centre and triangles (t, 3) of a polar mesh.

        The sides are straight, so the radii are scaled to the area of the footprint.
        """
        azimuth = np.arange(azimuths) * FULL_TURN / azimuths
        radius = self.radius_at(azimuth)
        sides = 0.5 * np.sin(FULL_TURN / azimuths) * radius @ np.roll(radius, 1)
        radius = radius * np.sqrt(self.area_m2 / sides)
        outline = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth)])
        parts = np.arange(1, rings + 1)[:, None, None] / rings
        plan = np.vstack([np.zeros((1, 2)), (parts * outline).reshape(-1, 2)])
        index, next_index = np.arange(azimuths), np.roll(np.arange(azimuths), -1)
        faces = [np.column_stack([np.zeros(azimuths, dtype=int), 1 + index, 1 + next_index])]
        for inner in 1 + azimuths * np.arange(rings - 1):
            outer = inner + azimuths
            faces.append(np.column_stack([inner + index, outer + index, outer + next_index]))
            faces.append(np.column_stack([inner + index, outer + next_index, inner + next_index]))
        return plan, np.vstack(faces)


@dataclass(frozen=True)
class Surface:
    """Surface of triangles over a plan, linear in each triangle; see `surface`.

    heights_m  (v,) heights of the vertices
    faces      (t, 3) corners of each triangle, the lowest first
    areas_m2   (t,) plan areas
    """

    heights_m: np.ndarray
    faces: np.ndarray
    areas_m2: np.ndarray

    @property
    def lowest_m(self):
        """Height of the lowest point."""
        return float(self.heights_m.min())

    @property
    def highest_m(self):
        """Height of the highest point."""
        return float(self.heights_m.max())

    def below(self, levels_m, fields):
        """Return integrals (rows, c) of fields over the plan up to levels of the surface.

        A place counts if the surface there is at or below the level. The integral is exact.

        fields  (v, c) values at the vertices, linear in each triangle
        """
        levels = np.atleast_1d(np.asarray(levels_m, dtype=float))
        fields = np.asarray(fields, dtype=float)
        by_top = np.argsort(self.heights_m[self.faces[:, 2]])
        tops = self.heights_m[self.faces[by_top, 2]]
        cumulative = (self.areas_m2[:, None] * fields[self.faces].mean(axis=1))[by_top]
        cumulative = np.vstack([np.zeros((1, fields.shape[1])), np.cumsum(cumulative, axis=0)])
        # Triangles completely below a level by a cumulative sum, triangles cut by the level one by
        # one.
        result = cumulative[np.searchsorted(tops, levels, side="right")]
        rows, faces, weights = self._cut(levels)
        for column, field in zip(result.T, fields.T, strict=True):
            part = np.einsum("pc,pc->p", weights, field[self.faces[faces]])
            column += np.bincount(rows, part, minlength=len(levels))
        return result

    def volume_and_area(self, levels_m):
        """Return the integral (rows,) of (level - z)+ over the plan, and the wet plan area."""
        area, moment = self.below(
            levels_m, np.column_stack([np.ones_like(self.heights_m), self.heights_m])
        ).T
        return np.atleast_1d(levels_m) * area - moment, area

    def wet_weights(self, levels_m):
        """Return derivatives (rows, v) of `volume_and_area` by lower vertices, m2."""
        levels, count = np.atleast_1d(levels_m), len(self.heights_m)
        rows, faces = np.nonzero(self.heights_m[self.faces[:, 2]] <= levels[:, None])
        whole_weights = np.broadcast_to(self.areas_m2[faces, None] / 3, (len(faces), 3))
        cut_rows, cut_faces, cut_weights = self._cut(levels)
        rows, faces = np.append(rows, cut_rows), np.append(faces, cut_faces)
        place = (rows[:, None] * count + self.faces[faces]).ravel()
        weights = np.vstack([whole_weights, cut_weights]).ravel()
        return np.bincount(place, weights, len(levels) * count).reshape(len(levels), count)

    def _cut(self, levels):
        """Return rows, faces and weights (pairs, 3) of the corners, for triangles cut by a level.

        The wet part is a corner of the triangle, or the whole less its dry corner. A corner
        triangle with the fractions p and q of two edges has the relative area p q and the means 1 -
        (p + q) / 3, p / 3, q / 3.
        """
        order = np.argsort(levels)
        low, middle, high = self.heights_m[self.faces].T
        first = np.searchsorted(levels[order], low, side="right")
        count = np.searchsorted(levels[order], high, side="left") - first
        count = np.maximum(count, 0)
        faces = np.repeat(np.arange(len(count)), count)
        # All pairs of a triangle and a level between its lowest and highest corner.
        offset = np.arange(len(faces)) - np.repeat(np.cumsum(count) - count, count)
        rows = order[first[faces] + offset]
        level, low, middle, high = levels[rows], low[faces], middle[faces], high[faces]
        wet = level <= middle  # only the lowest corner is wet
        p = np.where(wet, level - low, high - level) / (high - low)
        q = np.where(wet, level - low, high - level)
        q = q / np.where(wet, middle - low, high - middle)
        corner = p * q
        apex = corner * (1 - (p + q) / 3)
        far_corner, near_corner = corner * p / 3, corner * q / 3
        weights = np.where(
            wet[:, None],
            np.column_stack([apex, near_corner, far_corner]),
            1 / 3 - np.column_stack([far_corner, near_corner, apex]),
        )
        return rows, faces, weights * self.areas_m2[faces, None]


def surface(plan_m, faces, heights_m):
    """Return the `Surface` over a mesh.

    Parameters
    ----------
    plan_m : ndarray, shape (v, 2)
        Plan coordinates of the vertices, m.
    faces : ndarray of int, shape (t, 3)
    heights_m : array_like, shape (v,)
        Heights of the vertices, m.
    """
    heights = np.asarray(heights_m, dtype=float)
    a, b, c = np.moveaxis(plan_m[faces], 1, 0)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    order = np.argsort(heights[faces], axis=1, kind="stable")
    return Surface(heights, np.take_along_axis(faces, order, axis=1), np.abs(ux * vy - uy * vx) / 2)
