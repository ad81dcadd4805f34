"""Checks of a mesh as a tank: it must enclose a definite volume and face outwards."""

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.tank.meshes.part import Mesh, mesh_part, normals_of
from tankcal.units import FULL_TURN

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
