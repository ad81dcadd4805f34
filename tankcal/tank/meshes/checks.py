"""Is a mesh a tank? It must enclose a volume beyond doubt, and face outwards."""

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from tankcal.errors import InputError, Problem
from tankcal.geometry.outlines import FULL_TURN
from tankcal.messages import message
from tankcal.tank.meshes.part import Mesh, mesh_part, normals_of

SMALLEST_M, LARGEST_M = 0.05, 1000.0  # largest extent of a tank: beyond, the unit is wrong
MOST_BODIES = 1000
MOST_PAIRS = 10_000  # of bodies, each seen from the other, whose boxes meet
PROBES = 50  # vertices of a body that are tested for lying inside another, of few bodies
FEWEST_PROBES = 4
MOST_WINDINGS = 200_000_000  # of a face about a vertex, in all these tests: some twenty seconds
AT_ONCE = 100_000
ON_SURFACE = 1e-3  # a winding number this far from 0 and 1: the point is on the surface
FLAT = 1e-12  # of the size: a body so thin holds nothing, a point so near lies on a face
COARSE_M = 1e-4  # between neighbouring float32 numbers
CHECKED_LEVELS = 2000


def closed_mesh(vertices, faces, *, unit_m=1.0, name="mesh"):
    """A `Mesh` from corners and triangles, when they enclose a volume beyond doubt.

    Checked: finite numbers; a believable size; every edge passed as often in one direction as in
    the other (closed, consistently oriented); no face twice; every body has a volume, and faces
    outwards, or inwards when it is a hollow in another; no vertex (of 50, of 4 at least where there
    are many bodies) of a body inside another that holds not all of it; a free surface that is
    nowhere negative. Repaired and noted: equal vertices are one, faces without three corners go, a
    mesh that is inside out as a whole is turned. Not checked: faces that cross without a vertex
    inside and leave the free surface positive; such a mesh counts the volume that it encloses
    twice, twice.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        x, y, z, z up, in units of unit_m metres.
    faces : ndarray, shape (m, 3)
        Indices of corners.
    name : optional
        Of the file, for messages.

    Raises
    ------
    InputError
        With what was expected.
    """
    if not 0 < unit_m < np.inf:
        raise problem(name, f"unit of {unit_m} m; expected a length above 0")
    vertices, faces = _arrays(vertices, faces, name)
    notes = _coarse(vertices, unit_m)
    vertices, faces, more = _joined(vertices * unit_m, faces)
    _refuse_size(vertices, unit_m, name)
    notes += more + _refuse_open(vertices, faces, name)
    label, bodies = _bodies(vertices, faces, name)
    faces, turned = _turned_outwards(vertices, faces, label, bodies, name)
    mesh = Mesh(vertices, faces, bodies, (*notes, *turned))
    _refuse_negative(mesh, name)
    return mesh


def problem(name, expected):
    return InputError(Problem(name, expected))


def _place(xyz):
    return "({:.4f}, {:.4f}, {:.4f})".format(*xyz)


def _arrays(vertices, faces, name):
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


def _coarse(vertices, unit_m):
    """A note when the coordinates were held in float32 and are too large for it."""
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


def _joined(vertices, faces):
    """Equal vertices made one, unused ones and faces without three corners left out; notes."""
    corners = vertices[faces.ravel()] + 0.0  # no negative zeros
    order = np.lexsort(corners.T)
    new = np.append(True, np.any(np.diff(corners[order], axis=0) != 0, axis=1))
    index = np.empty(len(order), dtype=np.int64)
    index[order] = new.cumsum() - 1
    faces = index.reshape(-1, 3)
    whole = np.all(faces != np.roll(faces, 1, axis=1), axis=1)
    notes = []
    if not whole.all():
        notes.append(f"{(~whole).sum()} faces without three different corners were left out")
    return corners[order][new], faces[whole], notes


def _refuse_open(vertices, faces, name):
    """InputError for edges that are not passed as often each way, and faces twice; notes."""
    if len(faces) == 0:
        raise problem(
            name,
            message(
                "mesh_without_triangles",
                "has no triangle with three different corners; expected a closed mesh",
            ),
        )
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    key = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    keys, edge, uses = np.unique(key, return_inverse=True, return_counts=True)
    balance = np.bincount(edge, weights=np.sign(end - start))
    for is_open, wrong in ((True, uses % 2 == 1), (False, balance != 0)):
        if wrong.any():
            first, last = divmod(int(keys[wrong][0]), len(vertices))
            count, start, end = wrong.sum(), _place(vertices[first]), _place(vertices[last])
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
    turned = np.take_along_axis(faces, (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    _, first, times = np.unique(turned, axis=0, return_index=True, return_counts=True)
    if (times > 1).any():
        where = _place(vertices[faces[first[times > 1][0], 0]])
        raise problem(
            name,
            message(
                "mesh_faces_twice",
                "{count} faces are given twice, the first at {where} m; expected once",
                count=(times > 1).sum(),
                where=where,
            ),
        )
    many = int((uses > 2).sum())
    return [f"at {many} edges more than two faces meet"] if many else []


def _bodies(vertices, faces, name):
    """(m,) index of the body of each face, and the number of bodies."""
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


def _turned_outwards(vertices, faces, label, bodies, name):
    """Faces that look outwards (hollows inwards), and a note when they did not."""
    normals = normals_of(vertices, faces)
    # each about a corner of its own body: nothing cancels far from the origin
    home = vertices[faces[np.unique(label, return_index=True)[1], 0]]
    local = vertices[faces].mean(axis=1) - home[label]
    volume = np.bincount(label, weights=np.sum(local * normals, axis=1), minlength=bodies) / 6
    surface = np.bincount(label, weights=np.linalg.norm(normals, axis=1), minlength=bodies) / 2
    size = np.zeros(bodies)
    np.maximum.at(size, label, np.abs(local).max(axis=1))
    empty = np.abs(volume) <= FLAT * surface * size
    if empty.any():
        where = _place(home[np.argmax(empty)])
        raise problem(
            name,
            message(
                "mesh_body_flat",
                "the body at {where} m encloses no volume; expected a closed body",
                where=where,
            ),
        )
    expected = 1 - 2 * (_depths(vertices, faces, label, bodies, name) % 2)
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
                place=_place(home[np.argmax(wrong)]),
            ),
        )
    return faces, []


def _depths(vertices, faces, label, bodies, name):
    """(bodies,) how many other bodies each one lies in; InputError when two overlap."""
    depth = np.zeros(bodies, dtype=int)
    if bodies == 1:
        return depth
    order = np.argsort(label, kind="stable")
    groups = np.split(faces[order], np.bincount(label).cumsum()[:-1])
    own = [vertices[np.unique(group)] for group in groups]
    low, high = np.array([v.min(axis=0) for v in own]), np.array([v.max(axis=0) for v in own])
    meet = np.all((low[:, None] <= high[None]) & (low[None] <= high[:, None]), axis=2)
    pairs = np.argwhere(meet & ~np.eye(bodies, dtype=bool))
    some = _probes(pairs, [len(v) for v in own], [len(group) for group in groups], name)
    for i, j in pairs:
        near = np.flatnonzero(np.all((own[i] >= low[j]) & (own[i] <= high[j]), axis=1))
        if len(near) == 0:
            continue
        probes = near[np.linspace(0, len(near) - 1, min(some, len(near))).astype(int)]
        turns = np.abs(windings(own[i][probes], vertices[groups[j]]))
        inside = np.any(turns > 1 - ON_SURFACE)
        outside = np.any(turns < ON_SURFACE) or len(near) < len(own[i])
        if inside and outside:
            where = _place(own[i][probes[np.argmax(turns)]])
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


def _probes(pairs, vertices, faces, name):
    """How many vertices of a body are tested; InputError where even the fewest take too long."""
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
    for some in (PROBES, 20, 10, FEWEST_PROBES):
        if np.sum(size * np.minimum(some, most)) <= MOST_WINDINGS:
            return some
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
    """Whether a point lies inside a `Mesh`, or on its surface."""
    corners = mesh.vertices_m[mesh.faces]
    return bool(windings(np.asarray(point_m, dtype=float)[None], corners)[0] > ON_SURFACE)


def windings(points, corners):
    """(n,) how often a closed surface (m, 3, 3) goes round points (n, 3).

    Source: van Oosterom & Strackee 1983. A face that the point lies on counts nothing: on a surface
    the result is a fraction.
    """
    some = max(1, AT_ONCE // len(corners))
    batches = [points[start : start + some] for start in range(0, len(points), some)]
    return np.concatenate([_solid_angles(batch, corners) for batch in batches]) / FULL_TURN


def _solid_angles(points, corners):
    """(n,) halves of the solid angles of a surface (m, 3, 3), seen from points (n, 3)."""
    a, b, c = np.moveaxis(corners[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.sqrt(np.sum(side**2, axis=2)) for side in (a, b, c))
    above = np.sum(a * np.cross(b, c), axis=2)
    ab, bc, ca = (np.sum(p * q, axis=2) for p, q in ((a, b), (b, c), (c, a)))
    half = np.arctan2(above, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.sum(half, axis=1, where=np.abs(above) > FLAT * la * lb * lc)


def _refuse_negative(mesh, name):
    """InputError when the free surface is negative somewhere: the mesh crosses itself."""
    part = mesh_part(mesh)
    heights = np.unique(part.corners_m)
    heights = np.sort(np.concatenate([heights, (heights[1:] + heights[:-1]) / 2]))
    some = np.linspace(0, len(heights) - 1, min(CHECKED_LEVELS, len(heights))).astype(int)
    area = part.area_m2(heights[some])
    worst = int(np.argmin(area))
    if area[worst] < -1e-9 * area.max():
        z = heights[some][worst] + mesh.vertices_m[:, 2].min()
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
