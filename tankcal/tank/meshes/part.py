"""Closed mesh of triangles as a part of a tank with exact volumes, and its checks.

With a_T the plan area of triangle T (positive if its outside faces up), the divergence theorem
gives the volume of the body below the height h as a sum over its triangles,

    V(h) = - sum a_T mean over T of max(h - z, 0),     A(h) = dV/dh = - sum a_T part of T below h.

Both means are divided differences of (h - .)+^p over the three corner heights, that is, cubics and
quadratics in h between them (Hermite-Genocchi; de Boor 2001, A Practical Guide to Splines).
"""

from dataclasses import dataclass
from math import comb

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from tankcal.errors import HeightError, InputError, Problem
from tankcal.messages import message
from tankcal.tank.parts import Part, as_levels
from tankcal.units import FULL_TURN

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


SMALLEST_M, LARGEST_M = 0.05, 1000.0  # range of the largest extent: outside, the unit is wrong
MOST_BODIES = 1000  # largest number of bodies
MOST_PAIRS = 10_000  # largest number of ordered pairs of bodies with overlapping boxes
PROBES = 50  # vertices of a body tested for being inside another body, for few bodies
FEWEST_PROBES = 4  # least number of tested vertices, for many bodies
MOST_WINDINGS = 200_000_000  # solid angles in all these tests: about twenty seconds
AT_ONCE = 100_000  # solid angles in an array operation
ON_SURFACE = 1e-3  # a winding number this far from 0 and 1: the point is on the surface
FLAT = 1e-12  # relative to the size: thickness of a body without volume; distance from a face
COARSE_M = 1e-4  # largest distance of neighbouring float32 numbers without a note
CHECKED_LEVELS = 2000  # levels at which the free surface is checked


def closed_mesh(vertices, faces, *, unit_m=1.0, name="mesh"):
    """Return a `Mesh` from corners and triangles that enclose a definite volume.

    The checks are: finite numbers; a plausible size; every edge used equally often in both
    directions (closed, consistently oriented); no face twice; a volume of every body, with faces
    outwards, or inwards for a hollow in another body; no vertex of a body inside another body that
    does not contain it completely (50 vertices, at least 4 for many bodies); and a free surface
    that is nowhere negative. Repairs with a note: equal vertices are merged, faces without three
    different corners are removed, and a mesh completely inside out is reversed. Not checked: faces
    that intersect without a vertex inside and with a positive free surface. Such a mesh counts a
    volume enclosed twice twice.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        x, y, z, z up, in units of unit_m metres.
    faces : ndarray, shape (m, 3)
        Indices of corners.
    unit_m : float, optional
        Length of the unit, m.
    name : str, optional
        Name of the file, for messages.

    Raises
    ------
    InputError
        With the expected property.
    """
    if not 0 < unit_m < np.inf:
        raise problem(name, f"unit of {unit_m} m; expected a length above 0")
    vertices, faces = _arrays(vertices, faces, name)
    notes = _precision_notes(vertices, unit_m)
    vertices, faces, repairs = _merge_vertices(vertices * unit_m, faces)
    _refuse_size(vertices, unit_m, name)
    notes += repairs + _refuse_open(vertices, faces, name)
    label, bodies = _bodies(vertices, faces, name)
    faces, reversal = _orient_outwards(vertices, faces, label, bodies, name)
    mesh = Mesh(vertices, faces, bodies, (*notes, *reversal))
    _refuse_negative(mesh, name)
    return mesh


def problem(name, expected):
    """Return an `InputError` of a mesh file."""
    return InputError(Problem(name, expected))


def _format_point(xyz):
    """Return coordinates as text."""
    return "({:.4f}, {:.4f}, {:.4f})".format(*xyz)


def _arrays(vertices, faces, name):
    """Return vertices and faces as arrays; raise InputError for other shapes, types or indices."""
    vertices, faces = np.asarray(vertices), np.asarray(faces)
    if faces.size == 0 or vertices.size == 0:
        raise problem(name, message("mesh_empty", "has no triangles; expected a closed mesh"))
    if vertices.ndim != 2 or vertices.shape[1] != 3 or vertices.dtype.kind not in "fiu":
        raise problem(name, f"vertices of shape {vertices.shape}; expected numbers (n, 3)")
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise problem(name, f"faces of shape {faces.shape}; expected triangles (m, 3)")
    if faces.min() < 0 or faces.max() >= len(vertices):
        wrong = faces.min() if faces.min() < 0 else faces.max()
        raise problem(
            name,
            message(
                "mesh_vertex_missing",
                "a face names vertex {wrong}; expected 0 to {largest}",
                wrong=wrong,
                largest=len(vertices) - 1,
            ),
        )
    vertices, faces = vertices.astype(float), faces.astype(np.int64)
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise problem(name, f"vertex {bad[0] + 1} is {vertices[bad[0]]}; expected finite numbers")
    return vertices, faces


def _refuse_size(vertices, unit_m, name):
    """Raise InputError for an implausible size."""
    extent = np.ptp(vertices, axis=0)
    if not SMALLEST_M <= extent.max() <= LARGEST_M:
        x, y, z = extent
        raise problem(
            name,
            message(
                "mesh_size",
                "the mesh is {x:.4g} x {y:.4g} x {z:.4g} m with a unit of {unit_m:g} m; expected "
                "{least_m:g} to {most_m:g} m: is the unit right?",
                x=x,
                y=y,
                z=z,
                unit_m=unit_m,
                least_m=SMALLEST_M,
                most_m=LARGEST_M,
            ),
        )


def _precision_notes(vertices, unit_m):
    """Return a note if coordinates are stored in float32 and too large for this precision."""
    with np.errstate(over="ignore"):
        single = vertices.astype(np.float32)
    largest = np.abs(single).max()
    apart_m = float(np.spacing(largest)) * unit_m
    if not (np.array_equal(vertices, single) and apart_m > COARSE_M):
        return []
    return [
        f"coordinates of {largest * unit_m:.0f} m hold seven digits, {apart_m:.2g} m: write the "
        "mesh from a nearby origin"
    ]


def _merge_vertices(vertices, faces):
    """Merge equal vertices, remove unused vertices and degenerate faces; return also notes."""
    corners = vertices[faces.ravel()] + 0.0  # negative zeros become positive zeros
    order = np.lexsort(corners.T)
    # In lexicographic order, equal vertices are neighbours.
    new = np.append(True, np.any(np.diff(corners[order], axis=0) != 0, axis=1))
    index = np.empty(len(order), dtype=np.int64)
    index[order] = new.cumsum() - 1
    faces = index.reshape(-1, 3)
    proper = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
    notes = []
    if not proper.all():
        notes.append(f"{(~proper).sum()} faces without three different corners were left out")
    return corners[order][new], faces[proper], notes


def _refuse_open(vertices, faces, name):
    """Raise InputError for unbalanced edges or duplicate faces; return notes."""
    if len(faces) == 0:
        raise problem(
            name,
            message(
                "mesh_without_triangles",
                "has no triangle with three different corners; expected a closed mesh",
            ),
        )
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    # A single integer identifies an edge regardless of its direction.
    key = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    # In a closed mesh, faces use each edge an even number of times, equally in both directions.
    keys, edge, uses = np.unique(key, return_inverse=True, return_counts=True)
    balance = np.bincount(edge, weights=np.sign(end - start))
    for is_open, wrong in ((True, uses % 2 == 1), (False, balance != 0)):
        if wrong.any():
            first, last = divmod(int(keys[wrong][0]), len(vertices))
            count, start, end = (
                wrong.sum(),
                _format_point(vertices[first]),
                _format_point(vertices[last]),
            )
            if is_open:
                raise problem(
                    name,
                    message(
                        "mesh_open",
                        "the mesh has {count} open edges, the first from {start} to {end} m; "
                        "expected a closed (watertight) mesh",
                        count=count,
                        start=start,
                        end=end,
                    ),
                )
            raise problem(
                name,
                message(
                    "mesh_opposite",
                    "the mesh has {count} edges between faces of opposite orientation, the first "
                    "from {start} to {end} m; expected all to face outwards",
                    count=count,
                    start=start,
                    end=end,
                ),
            )
    # Rotate each face to start at its smallest index: equal faces become equal rows.
    rotated = np.take_along_axis(faces, (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    _, first, times = np.unique(rotated, axis=0, return_index=True, return_counts=True)
    if (times > 1).any():
        where = _format_point(vertices[faces[first[times > 1][0], 0]])
        raise problem(
            name,
            message(
                "mesh_faces_twice",
                "{count} faces are given twice, the first at {where} m; expected once",
                count=(times > 1).sum(),
                where=where,
            ),
        )
    shared = int((uses > 2).sum())
    return [f"at {shared} edges more than two faces meet"] if shared else []


def _bodies(vertices, faces, name):
    """Return the index (m,) of the body of each face, and the number of bodies."""
    n = len(vertices)
    pairs = (np.ones(2 * len(faces)), (np.repeat(faces[:, 0], 2), faces[:, 1:].ravel()))
    graph = scipy.sparse.coo_array(pairs, shape=(n, n))
    bodies, of_vertex = scipy.sparse.csgraph.connected_components(graph, directed=False)
    if bodies > MOST_BODIES:
        raise problem(
            name,
            message(
                "mesh_bodies",
                "the mesh has {bodies} bodies; expected at most {most}",
                bodies=bodies,
                most=MOST_BODIES,
            ),
        )
    return of_vertex[faces[:, 0]], bodies


def _orient_outwards(vertices, faces, label, bodies, name):
    """Return faces oriented outwards (hollows inwards), with a note if they were reversed."""
    normals = normals_of(vertices, faces)
    # Coordinates about a corner of each body: no cancellation far from the origin.
    origins = vertices[faces[np.unique(label, return_index=True)[1], 0]]
    local = vertices[faces].mean(axis=1) - origins[label]
    volume = np.bincount(label, weights=np.sum(local * normals, axis=1), minlength=bodies) / 6
    surface = np.bincount(label, weights=np.linalg.norm(normals, axis=1), minlength=bodies) / 2
    size = np.zeros(bodies)
    np.maximum.at(size, label, np.abs(local).max(axis=1))
    # Divergence theorem: 6 V is the sum of centroid times twice the area vector.
    empty = np.abs(volume) <= FLAT * surface * size
    if empty.any():
        where = _format_point(origins[np.argmax(empty)])
        raise problem(
            name,
            message(
                "mesh_body_flat",
                "the body at {where} m encloses no volume; expected a closed body",
                where=where,
            ),
        )
    expected = 1 - 2 * (_nesting_depths(vertices, faces, label, bodies, name) % 2)
    wrong = np.sign(volume) != expected
    if wrong.all():
        return faces[:, ::-1].copy(), ["all faces looked inwards and were turned"]
    if wrong.any():
        raise problem(
            name,
            message(
                "mesh_inside_out",
                "{count} of {bodies} bodies are inside out, the first at {place} m; expected "
                "them to face outwards, hollows inwards",
                count=wrong.sum(),
                bodies=bodies,
                place=_format_point(origins[np.argmax(wrong)]),
            ),
        )
    return faces, []


def _nesting_depths(vertices, faces, label, bodies, name):
    """Return the number (bodies,) of other bodies around each body; InputError for an overlap."""
    depth = np.zeros(bodies, dtype=int)
    if bodies == 1:
        return depth
    order = np.argsort(label, kind="stable")
    groups = np.split(faces[order], np.bincount(label).cumsum()[:-1])
    body_vertices = [vertices[np.unique(group)] for group in groups]
    lowest, highest = (
        np.array([v.min(axis=0) for v in body_vertices]),
        np.array([v.max(axis=0) for v in body_vertices]),
    )
    boxes_meet = np.all(
        (lowest[:, None] <= highest[None]) & (lowest[None] <= highest[:, None]), axis=2
    )
    pairs = np.argwhere(boxes_meet & ~np.eye(bodies, dtype=bool))
    probe_count = _count_probes(
        pairs, [len(v) for v in body_vertices], [len(group) for group in groups], name
    )
    for i, j in pairs:
        candidates = np.flatnonzero(
            np.all((body_vertices[i] >= lowest[j]) & (body_vertices[i] <= highest[j]), axis=1)
        )
        if len(candidates) == 0:
            continue
        # Only vertices within the box of the other body can be inside it.
        probes = candidates[
            np.linspace(0, len(candidates) - 1, min(probe_count, len(candidates))).astype(int)
        ]
        winding_numbers = np.abs(windings(body_vertices[i][probes], vertices[groups[j]]))
        inside = np.any(winding_numbers > 1 - ON_SURFACE)
        outside = np.any(winding_numbers < ON_SURFACE) or len(candidates) < len(body_vertices[i])
        if inside and outside:
            where = _format_point(body_vertices[i][probes[np.argmax(winding_numbers)]])
            raise problem(
                name,
                message(
                    "mesh_overlap",
                    "two bodies overlap at {where} m; expected bodies apart",
                    where=where,
                ),
            )
        depth[i] += bool(inside)
    return depth


def _count_probes(pairs, vertices, faces, name):
    """Return the number of tested vertices of a body; InputError for too many faces."""
    if len(pairs) > MOST_PAIRS:
        raise problem(
            name,
            message(
                "mesh_boxes_meet",
                "the boxes of {count} bodies meet one another {times} times; expected at most "
                "{most}: a shell, and what stands in it",
                count=len(vertices),
                times=len(pairs),
                most=MOST_PAIRS,
            ),
        )
    first, second = pairs.T
    most, size = np.array(vertices)[first], np.array(faces, dtype=float)[second]
    for probe_count in (PROBES, 20, 10, FEWEST_PROBES):
        if np.sum(size * np.minimum(probe_count, most)) <= MOST_WINDINGS:
            return probe_count
    raise problem(
        name,
        message(
            "mesh_too_many_faces",
            "{faces} faces of {count} bodies whose boxes meet {times} times are too many to tell "
            "which lies in which; expected fewer bodies, or fewer faces",
            faces=sum(faces),
            count=len(vertices),
            times=len(pairs),
        ),
    )


def holds(mesh, point_m):
    """Whether a point is inside a `Mesh`, or on its surface."""
    corners = mesh.vertices_m[mesh.faces]
    return bool(windings(np.asarray(point_m, dtype=float)[None], corners)[0] > ON_SURFACE)


def windings(points, corners):
    """Return the winding numbers (n,) of a closed surface (m, 3, 3) about points (n, 3).

    Source: van Oosterom & Strackee 1983. A face that contains the point contributes zero: on a
    surface the result is a fraction.
    """
    batch_size = max(1, AT_ONCE // len(corners))
    batches = [points[start : start + batch_size] for start in range(0, len(points), batch_size)]
    return np.concatenate([_solid_angles(batch, corners) for batch in batches]) / FULL_TURN


def _solid_angles(points, corners):
    """Return half the solid angles (n,) of a surface (m, 3, 3), seen from points (n, 3)."""
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.sqrt(np.sum(side**2, axis=2)) for side in (a, b, c))
    triple_product = np.sum(a * np.cross(b, c), axis=2)
    ab, bc, ca = (np.sum(p * q, axis=2) for p, q in ((a, b), (b, c), (c, a)))
    # tan(omega / 2) = a . (b x c) / (abc + (a.b) c + (b.c) a + (c.a) b).
    half = np.arctan2(triple_product, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.sum(half, axis=1, where=np.abs(triple_product) > FLAT * la * lb * lc)


def _refuse_negative(mesh, name):
    """Raise InputError if the free surface is negative somewhere: the mesh intersects itself."""
    part = mesh_part(mesh)
    heights = np.unique(part.corners_m)
    heights = np.sort(np.concatenate([heights, (heights[1:] + heights[:-1]) / 2]))
    sample = np.linspace(0, len(heights) - 1, min(CHECKED_LEVELS, len(heights))).astype(int)
    area = part.area_m2(heights[sample])
    worst = int(np.argmin(area))
    if area[worst] < -1e-9 * area.max():
        # Heights of the part count from the lowest vertex.
        z = heights[sample][worst] + mesh.vertices_m[:, 2].min()
        raise problem(
            name,
            message(
                "mesh_crosses_itself",
                "the cut at z = {z:.4f} m has an area of {area:.4g} m2, the mesh crosses itself; "
                "expected a surface that does not",
                z=z,
                area=area[worst],
            ),
        )
