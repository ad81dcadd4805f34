"""Closed mesh of triangles as a part of a tank, with exact volumes.

With a_T the plan area of triangle T (positive if its outside faces up), the divergence theorem
gives the volume of the body below the height h as a sum over its triangles,

    V(h) = - sum a_T mean over T of max(h - z, 0),     A(h) = dV/dh = - sum a_T part of T below h.

Both means are divided differences of (h - .)+^p over the three corner heights, that is, cubics and
quadratics in h between them (Hermite-Genocchi; de Boor 2001, A Practical Guide to Splines).
"""

from dataclasses import dataclass
from math import comb

import numpy as np

from tankcal.errors import HeightError
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels

BLOCK = 1 << 16  # faces in an array operation


@dataclass(frozen=True)
class Mesh:
    """Closed surface of triangles whose corners run anticlockwise seen from outside.

    Attributes
    ----------
    vertices_m : ndarray, shape (n, 3)
        x, y, z.
    faces : ndarray, shape (m, 3)
        Indices of the corners.
    bodies : int
        Number of pieces without common vertices; a hollow counts as a piece.
    notes : tuple of str
        Repairs and remarks, one line each.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    bodies: int
    notes: tuple[str, ...]
    surveyed_as = "mesh"


@dataclass(frozen=True)
class MeshPart(Part):
    """Mesh as a part of a tank; see `mesh_part`.

    Attributes
    ----------
    zero_m : float
        Height of level 0 above the lowest vertex, m.
    height_m : float
        Height of the highest vertex above the lowest vertex, m.
    corners_m : ndarray, shape (m, 3)
        Heights of the corners above the lowest vertex, ascending in each row.
    plan_m2 : ndarray, shape (m,)
        Plan area of each face, positive if the outside faces up.
    surface_m2 : ndarray, shape (m,)
        Area of each face.
    """

    zero_m: float
    height_m: float
    corners_m: np.ndarray
    plan_m2: np.ndarray
    surface_m2: np.ndarray

    @property
    def face_count(self):
        """Number of triangles."""
        return len(self.plan_m2)

    @property
    def top_m(self):
        """Highest level, m."""
        return self.height_m - self.zero_m

    @property
    def capacity_m3(self):
        """Volume of the full tank."""
        return float(self.volume_m3([self.top_m])[0])

    def volume_m3(self, levels_m):
        """Return the volume (rows,) below each level, zero below the mesh; HeightError above it."""
        heights = self._heights(levels_m)
        return sums_below(self.corners_m, -self.plan_m2, heights, 3) * (heights > 0)

    def area_m2(self, levels_m):
        """Return the free surface (rows,) at each level.

        It is the surface above a level face; at the very top, the surface below it.
        """
        heights = self._heights(levels_m)
        area = sums_below(self.corners_m, -self.plan_m2, heights, 2)
        full = heights >= self.height_m
        if full.any():
            area[full] = sums_below(self.corners_m, -self.plan_m2, [self.height_m], 2, side="right")
        return area

    def wetted_m2(self, levels_m):
        """Return the wetted surface (rows,) of the mesh, without the free surface."""
        heights = self._heights(levels_m)
        lid = self.plan_m2 > 0
        return sums_below(self.corners_m[~lid], self.surface_m2[~lid], heights, 2) + sums_below(
            self.corners_m[lid], self.surface_m2[lid], heights, 2, side="right"
        )

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volumes, m3 per unit of the input}.

        scale    scale of all coordinates, with level 0 fixed: 3 V - h A
        surface  outward offset of the surface along its normal, m: the wetted area
        datum    rise of level 0, m: the free surface
        """
        levels = as_levels(levels_m)
        area = self.area_m2(levels)
        return {
            "scale": 3 * self.volume_m3(levels) - levels * area,
            "surface": self.wetted_m2(levels),
            "datum": area,
        }

    def _heights(self, levels_m):
        """Return heights (rows,) above the lowest vertex; raise HeightError above the mesh."""
        heights = as_levels(levels_m) + self.zero_m
        outside = ~(np.isfinite(heights) & (heights <= self.height_m * (1 + 1e-12)))
        if outside.any():
            raise HeightError(
                message(
                    "level_outside_mesh",
                    "level {level_m:g} m is outside the mesh, which ends at {top_m:g} m",
                    level_m=heights[outside][0] - self.zero_m,
                    top_m=self.height_m - self.zero_m,
                )
            )
        return np.minimum(heights, self.height_m)


def mesh_part(mesh, zero_z_m=None):
    """Return the part of a tank enclosed by a `Mesh`.

    Parameters
    ----------
    mesh : Mesh
    zero_z_m : float, optional
        z of level 0; None: the lowest vertex.

    Returns
    -------
    MeshPart
    """
    z = mesh.vertices_m[:, 2]
    low = float(z.min())
    normals = normals_of(mesh.vertices_m, mesh.faces)
    return MeshPart(
        zero_m=0.0 if zero_z_m is None else float(zero_z_m) - low,
        height_m=float(z.max()) - low,
        corners_m=np.sort(z[mesh.faces] - low, axis=1),
        plan_m2=normals[:, 2] / 2,
        surface_m2=np.sqrt(np.sum(normals**2, axis=1)) / 2,
    )


def normals_of(vertices, faces):
    """Return normals (m, 3) with a length of twice the area of their face."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def sums_below(corners, weights, heights, power, side="left"):
    """Return sums (rows,) over faces of weight times mean depth or part below each height.

    Each face is a cubic (quadratic) on the heights between its corners. A tree over the ascending
    heights stores it in the few nodes that cover these heights, as a polynomial about the middle of
    the node. This avoids an evaluation for each face and height, and avoids cancellation.

    Parameters
    ----------
    corners : ndarray, shape (m, 3)
        Heights of the corners, ascending.
    weights : ndarray, shape (m,)
    heights : array_like, shape (rows,)
    power : int
        3: mean depth; 2: part of the face.
    side : {"left", "right"}
        A level face counts at its own height ("left") or only above it.

    Returns
    -------
    ndarray, shape (rows,)
    """
    rows, inverse = np.unique(heights, return_inverse=True)
    tree = _Tree(rows, power)
    slope, offset = np.zeros(len(rows) + 1), np.zeros(len(rows) + 1)
    for start in range(0, len(weights), BLOCK):
        z = corners[start : start + BLOCK].T
        weight = weights[start : start + BLOCK]
        # Three ranges of heights: up to the middle corner, up to the highest corner, and above.
        first, second, third = (np.searchsorted(rows, z[i], side=side) for i in range(3))
        slope += np.bincount(second, weights=weight, minlength=len(slope))
        offset += np.bincount(second, weights=weight * z.sum(axis=0) / 3, minlength=len(slope))
        extent = np.where(z[2] > z[0], z[2] - z[0], 1.0)
        share = weight / extent / (3.0 if power == 3 else 1.0)
        low, high = z[1] - z[0], z[1] - z[2]
        # Between the two upper corners, the value is that of the whole face less the dry tip.
        tree.add(first, second, z[0], low, {power: share * low ** (power - 1)})
        tree.add(second, third, z[2], high, {power: share * high ** (power - 1)})
    below = slope.cumsum()[:-1]
    if power == 3:
        below = rows * below - offset.cumsum()[:-1]
    return (below + tree.values()[0])[inverse]


def moments_below(corners, values, weights, heights, side="left"):
    """Return sums (rows, c) over faces of weight times integral means of linear functions.

    The mean is over the part of the face below each height; a dry face contributes zero. With f0,
    f1, f2 the values at the ascending corners, T their height, r = z1 - z0 and u = (h - z0) / r,
    the mean up to the middle corner is

        r / T u^2 (f0 + u ((f1 - f0) + r / T (f2 - f0)) / 3).

    Beyond the middle corner, it is the mean of the whole face less the corresponding term of the
    part above, from the other end.

    Parameters
    ----------
    corners, weights, heights, side
        As for `sums_below`.
    values : ndarray, shape (m, 3, c)
        Values of the functions at the corners.

    Returns
    -------
    ndarray, shape (rows, c)
    """
    rows, inverse = np.unique(heights, return_inverse=True)
    columns = values.shape[2]
    tree, whole = _Tree(rows, 3, columns), np.zeros((len(rows) + 1, columns))
    for start in range(0, len(weights), BLOCK):
        z = corners[start : start + BLOCK].T
        f = np.moveaxis(values[start : start + BLOCK], 0, 2)
        weight = weights[start : start + BLOCK]
        first, second, third = (np.searchsorted(rows, z[i], side=side) for i in range(3))
        # Above the middle corner: mean of the whole face, less the part cut off at the top.
        for column, mean in enumerate(f.mean(axis=0)):
            whole[:, column] += np.bincount(second, weights=weight * mean, minlength=len(whole))
        extent = np.where(z[2] > z[0], z[2] - z[0], 1.0)
        tree.add(first, second, z[0], z[1] - z[0], _cut_corner(f, weight, (z[1] - z[0]) / extent))
        of_top = _cut_corner(f[::-1], -weight, (z[2] - z[1]) / extent)
        tree.add(second, third, z[2], z[1] - z[2], of_top)
    return (whole.cumsum(axis=0)[:-1] + tree.values().T)[inverse]


def _cut_corner(f, weight, share):
    """Return {power of u: (c, m)} of the part cut off at corner 0.

    share is the fraction of the height up to corner 1.
    """
    return {
        2: weight * share * f[0],
        3: weight * share * ((f[1] - f[0]) + share * (f[2] - f[0])) / 3,
    }


class _Tree:
    """Sums of polynomials, each over a range of ascending heights, for all heights at once.

    Node 1 contains all heights, nodes 2 i and 2 i + 1 the halves of node i, the last row one height
    each.
    """

    def __init__(self, heights, power, columns=1):
        self.heights = heights
        self.depth = max(int(np.ceil(np.log2(max(len(heights), 1)))), 0)
        self.leaves = 1 << self.depth
        padded = np.concatenate([heights, np.full(self.leaves - len(heights), heights[-1:].sum())])
        low, high = np.empty(2 * self.leaves), np.empty(2 * self.leaves)
        for level in range(self.depth + 1):
            blocks = padded.reshape(1 << level, -1)
            nodes = slice(1 << level, 2 << level)
            low[nodes], high[nodes] = blocks[:, 0], blocks[:, -1]
        low[0], high[0] = 0.0, 0.0
        self.middle, self.half = (low + high) / 2, (high - low) / 2
        self.coefficients = np.zeros((power + 1, columns, 2 * self.leaves))

    def add(self, start, stop, foot, reach, amounts):
        """Add the sum of amounts[p] ((h - foot) / reach)^p to heights[start:stop].

        Parameters
        ----------
        start, stop : ndarray of int, shape (m,)
            Ranges of heights.
        foot, reach : ndarray, shape (m,)
            Origin and scale of each polynomial, m.
        amounts : dict of int to ndarray, shape (m,) or (columns, m)
            Coefficients of each power.
        """
        chosen = np.flatnonzero(start < stop)
        left, right = start[chosen] + self.leaves, stop[chosen] + self.leaves
        # Segment tree: a range is the union of at most two nodes in each row.
        while len(left):
            odd = (left & 1).astype(bool)
            self._store(left[odd], chosen[odd], foot, reach, amounts)
            left = left + odd
            odd = (right & 1).astype(bool)
            right = right - odd
            self._store(right[odd], chosen[odd], foot, reach, amounts)
            left, right = left >> 1, right >> 1
            is_open = left < right
            left, right, chosen = left[is_open], right[is_open], chosen[is_open]

    def _store(self, nodes, chosen, foot, reach, amounts):
        """Add polynomials to the coefficients of nodes, shifted to the middle of each node."""
        at_middle = (self.middle[nodes] - foot[chosen]) / reach[chosen]
        step = self.half[nodes] / reach[chosen]
        middle_powers, step_powers = [np.ones_like(step)], [np.ones_like(step)]
        for _ in range(max(amounts)):  # products are faster than powers of arrays
            middle_powers.append(middle_powers[-1] * at_middle)
            step_powers.append(step_powers[-1] * step)
        for power, amount in amounts.items():
            chosen_amounts = np.atleast_2d(amount)[:, chosen]
            for k in range(power + 1):
                # Binomial theorem: ((h - foot) / reach)^p in powers of (h - middle) / half.
                terms = chosen_amounts * (
                    comb(power, k) * middle_powers[power - k] * step_powers[k]
                )
                for column, term in enumerate(terms):
                    self.coefficients[k, column] += np.bincount(
                        nodes, weights=term, minlength=2 * self.leaves
                    )

    def values(self):
        """Return the sum (columns, len(heights)) of all polynomials at each height."""
        total = np.zeros((self.coefficients.shape[1], len(self.heights)))
        leaves = np.arange(len(self.heights)) + self.leaves
        for level in range(self.depth + 1):
            nodes = leaves >> level
            half = self.half[nodes]
            t = np.divide(
                self.heights - self.middle[nodes], half, out=np.zeros_like(half), where=half > 0
            )
            part = np.zeros_like(total)
            for row in self.coefficients[::-1]:
                part = part * t + row[:, nodes]
            total += part
        return total
