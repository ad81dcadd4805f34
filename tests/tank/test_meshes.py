"""Meshes: closed forms, trimesh as second program, bad files, and the loft of a shell."""

import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jacobians import assert_derivative
from shapes import azimuths, course_of, modes, ring

from tankcal.errors import HeightError, InputError
from tankcal.tank.meshes import (
    Band,
    closed_mesh,
    loft,
    mesh_part,
    parse_mesh,
    read_mesh,
    shell_bands,
    write_mesh,
)
from tankcal.tank.meshes.part import sums_below
from tankcal.tank.volumes import ShellVolume

trimesh = pytest.importorskip("trimesh")

CUBE = trimesh.creation.box((1, 1, 1))
CUBE_VERTICES, CUBE_FACES = np.array(CUBE.vertices) + 0.5, np.array(CUBE.faces)


def cube(low=(0.0, 0.0, 0.0), size=1.0, inverted=False):
    """Vertices and faces of a cube."""
    faces = CUBE_FACES[:, ::-1] if inverted else CUBE_FACES
    return CUBE_VERTICES * size + np.asarray(low), faces


def together(*pieces):
    """Vertices and faces of several pieces in one mesh."""
    vertices, faces, start = [], [], 0
    for own, own_faces in pieces:
        vertices.append(own)
        faces.append(own_faces + start)
        start += len(own)
    return np.vstack(vertices), np.vstack(faces)


def star(seed, subdivisions=3):
    """A sphere with a random radius at every vertex, not convex at all, randomly turned."""
    rng = np.random.default_rng(seed)
    found = trimesh.creation.icosphere(subdivisions=subdivisions)
    found.vertices *= rng.uniform(0.4, 1.0, (len(found.vertices), 1)) * (1.0, 2.0, 0.7)
    found.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    return found


def hull(seed):
    return trimesh.convex.convex_hull(np.random.default_rng(seed).normal(size=(40, 3)))


def torus(seed):
    found = trimesh.creation.torus(2.0, 0.6, major_sections=30, minor_sections=14)
    turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3))
    return found.apply_transform(turn)


def part_of(mesh, **options):
    return mesh_part(closed_mesh(mesh.vertices, mesh.faces), **options)


def below(mesh, z):
    """The part of a mesh below z, open where it was cut, by trimesh."""
    cut = trimesh.intersections.slice_faces_plane(mesh.vertices, mesh.faces, (0, 0, -1), (0, 0, z))
    return trimesh.Trimesh(*cut[:2], process=False)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("shape", [star, hull, torus])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_volumes_below_levels_are_those_of_the_cut_mesh_trimesh(shape, seed):
    """trimesh cuts the mesh open at each level; its x moment needs no lid, which is level."""
    mesh = shape(seed)
    part = part_of(mesh)
    low, high = mesh.bounds[:, 2]
    levels = np.linspace(0, high - low, 24)[1:-1]
    cut = [below(mesh, low + z) for z in levels]
    assert part.volume_m3(levels) == pytest.approx([c.volume for c in cut], abs=1e-12 * mesh.volume)
    assert part.wetted_m2(levels) == pytest.approx([c.area for c in cut], abs=1e-12 * mesh.area)
    lids = [-np.sum(c.area_faces * c.face_normals[:, 2]) for c in cut]  # what the cut left open
    assert part.area_m2(levels) == pytest.approx(lids, abs=1e-12 * mesh.area)
    assert part.volume_m3([high - low])[0] == pytest.approx(mesh.volume, rel=1e-13)
    assert part.wetted_m2([high - low])[0] == pytest.approx(mesh.area, rel=1e-13)


@pytest.mark.parametrize("shape", [star, hull, torus])
def test_area_is_the_derivative_of_the_volume(shape):
    part = part_of(shape(5))
    levels = np.sort(np.random.default_rng(5).uniform(0.01, 0.99, 40)) * part.height_m
    derivatives = part.derivatives(levels)
    assert np.array_equal(derivatives["datum"], part.area_m2(levels))
    assert_derivative(
        lambda rise: part.volume_m3(levels + rise[0]), [0.0], derivatives["datum"][:, None]
    )


def test_the_scale_is_a_derivative():
    """Differences of meshes scaled about level 0, which lies off the lowest vertex."""
    mesh, levels = star(6), np.array([-0.5, 0.1, 0.3])

    def volumes(scale):
        found = closed_mesh(mesh.vertices * (1 + scale[0]), mesh.faces)
        return mesh_part(found, zero_z_m=0.0).volume_m3(levels)

    by_scale = part_of(mesh, zero_z_m=0.0).derivatives(levels)["scale"]
    assert_derivative(volumes, [0.0], by_scale[:, None], step=1e-6)


def test_the_surface_is_a_derivative():
    """Differences of a sphere of radius r + offset: closed form of the polyhedron's circles.

    A polyhedron about a sphere of radius r (all its faces touch it) is offset by growing r, but for
    edges and corners, whose part is of second order.
    """
    mesh = hull(7)
    touching = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None]  # the polar dual
    dual = trimesh.convex.convex_hull(_dual(touching))
    part = part_of(dual, zero_z_m=0.0)
    levels = np.linspace(*dual.bounds[:, 2], 9)[1:-1]

    def volumes(offset):
        grown = closed_mesh(dual.vertices * (1 + offset[0]), dual.faces)
        return mesh_part(grown, zero_z_m=0.0).volume_m3(levels)

    assert_derivative(volumes, [0.0], part.derivatives(levels)["surface"][:, None], step=1e-6)


def _dual(directions):
    """Corners of the polyhedron whose faces touch the unit sphere at the directions."""
    triangles = trimesh.convex.convex_hull(directions)
    corners = np.array(triangles.vertices)[triangles.faces]
    return np.linalg.solve(corners, np.ones((len(corners), 3, 1)))[:, :, 0]


def test_a_cube_in_closed_form():
    part = mesh_part(closed_mesh(*cube((3, 4, 5), 2.0)))
    levels = np.array([-1.0, 0.0, 0.5, 1.0, 2.0])
    assert part.volume_m3(levels) == pytest.approx([0, 0, 2, 4, 8], abs=1e-15)
    assert part.area_m2(levels) == pytest.approx([0, 4, 4, 4, 4])
    assert part.wetted_m2(levels) == pytest.approx([0, 4, 8, 12, 20])  # the lid is free surface
    assert part.derivatives(levels)["scale"] == pytest.approx([0, 0, 4, 8, 16])
    assert part.sources(levels) == ()


@pytest.mark.slow
def test_a_cone_and_a_ball_in_closed_form(figure):
    """A cone of 720 facets is a pyramid: exact; a ball of 81 920 faces falls a little short."""
    n = 720
    rim = ring(2.0, azimuths(n), z=3.0)
    faces = [[i, (i + 1) % n, n] for i in range(n)] + [[(i + 1) % n, i, n + 1] for i in range(n)]
    mesh = closed_mesh(np.vstack([rim, [[0, 0, 0], [0, 0, 3]]]), np.array(faces))
    levels = np.linspace(0, 3, 31)
    polygon = n / 2 * np.sin(2 * np.pi / n) * 4.0
    part, tiny = mesh_part(mesh), 1e-13 * polygon
    assert part.volume_m3(levels) == pytest.approx(polygon * levels**3 / 27, abs=tiny)
    assert part.area_m2(levels) == pytest.approx(polygon * levels**2 / 9, abs=tiny)

    def short(subdivisions):
        part = part_of(trimesh.creation.icosphere(subdivisions=subdivisions, radius=10.0))
        h = np.array([5.0, 10.0, 15.0]) * part.height_m / 20
        return part.volume_m3(h) / (np.pi * h**2 * (30 - h) / 3) - 1

    coarse, fine = short(5), short(6)
    figure("ball of 81 920 faces short by (ppm)", np.round(1e6 * fine, 1))
    assert coarse / fine == pytest.approx([4, 4, 4], rel=0.01)  # the square of the spacing
    assert (4 * fine - coarse) / 3 == pytest.approx([0, 0, 0], abs=2e-6)


def test_steps_of_the_free_surface_are_separated():
    """Two cubes, one on a taller pedestal: area from above at a step, below at the top."""
    high, faces = cube((5, 0, 1), 1.0)
    part = mesh_part(closed_mesh(*together(cube(size=1.5), (high, faces))))
    assert part.area_m2([0.999, 1.0, 1.25, 1.5, 2.0]) == pytest.approx([2.25, 3.25, 3.25, 1.0, 1.0])


@pytest.mark.slow
@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**31),
    rows=st.integers(1, 40),
    east=st.integers(-(2**20), 2**20),
    north=st.integers(-(2**23), 2**23),
)
def test_translation_and_order_change_nothing(seed, rows, east, north):
    """Property, to 1e-12 of the volume; coordinates in steps of 2^-24 m, none is rounded."""
    rng = np.random.default_rng(seed)
    mesh = star(seed, subdivisions=1)
    vertices, faces = np.round(mesh.vertices * 2**24) / 2**24, np.array(mesh.faces)
    part = mesh_part(closed_mesh(vertices, faces))
    levels = rng.uniform(-0.1, 1.0, rows) * part.height_m
    order, renamed = rng.permutation(len(faces)), rng.permutation(len(vertices))
    other = np.roll(np.argsort(renamed)[faces[order]], rng.integers(3), axis=1)
    moved = mesh_part(closed_mesh(vertices[renamed] + (east, north, 2.0**9), other))
    full = part.volume_m3([part.height_m])[0]
    assert moved.volume_m3(levels) == pytest.approx(part.volume_m3(levels), abs=1e-12 * full)
    area = part.area_m2(levels)
    assert moved.area_m2(levels) == pytest.approx(area, abs=1e-12 * part.surface_m2.sum())


def plain(corners, weights, height, power):
    """Mean depth or part below of each face by its closed form, one by one."""
    total = 0.0
    for (a, b, c), weight in zip(corners, weights, strict=True):
        if height < a:
            continue
        if height >= c:
            share = height - (a + b + c) / 3 if power == 3 else 1.0
        elif height < b:
            share = (height - a) ** power / ((b - a) * (c - a)) / (3 if power == 3 else 1)
        else:
            rest = (c - height) ** power / ((c - a) * (c - b))
            share = height - (a + b + c) / 3 + rest / 3 if power == 3 else 1 - rest
        total += weight * share
    return total


@pytest.mark.slow
@settings(max_examples=100)
@given(
    seed=st.integers(0, 2**31),
    rows=st.integers(1, 70),
    bits=st.sampled_from([2, 5, 40]),
    noise=st.sampled_from([0.0, 1e-9, 1e-90]),
)
def test_tree_sum_equals_plain_loop(seed, rows, bits, noise):
    """Second method; heights on few places make level faces, edges, and rows at corners."""
    rng = np.random.default_rng(seed)
    corners = np.sort(rng.integers(0, 2**bits, (50, 3)) / 2**bits + noise * rng.random((50, 3)))
    heights = rng.choice(np.append(corners.ravel(), rng.uniform(-0.1, 1.1, 30)), rows)
    weights = rng.normal(size=50)
    for power in (2, 3):
        expected = [plain(corners, weights, height, power) for height in heights]
        found = sums_below(corners, weights, heights, power)
        assert found == pytest.approx(expected, abs=1e-13 * 50)


@pytest.mark.slow
def test_ten_thousand_levels_of_a_hundred_thousand_tall_faces(figure):
    """Every face runs up the whole wall; the frustum's volume is a closed form."""
    n = 25_000
    bands = [
        Band(np.array([0.0, 9.5]), np.array([6.0, 7.0])[:, None] * np.ones(n), np.zeros((2, 2)))
    ]
    mesh = loft(bands)
    part, levels = mesh_part(mesh), np.linspace(0, 9.5, 10_001)
    start = time.perf_counter()
    volume = part.volume_m3(levels)
    figure("10 001 levels of 100 000 faces, s", f"{time.perf_counter() - start:.2f}")
    tracemalloc.start()
    part.volume_m3(levels)
    figure("the same, working memory, MB", f"{tracemalloc.get_traced_memory()[1] / 1e6:.0f}")
    assert tracemalloc.get_traced_memory()[1] < 8 * len(levels) * len(mesh.faces) / 100
    tracemalloc.stop()
    assert len(mesh.faces) == 4 * n
    radius = 6 + levels / 9.5
    polygon = n / 2 * np.sin(2 * np.pi / n)
    twisted = polygon * levels * (36 + 6 * radius + radius**2) / 3
    assert volume == pytest.approx(twisted, rel=1e-8)  # the diagonals cut some of the frustum
    assert np.all(np.diff(volume) > 0)


@pytest.mark.parametrize("level", [2.0001, np.nan, np.inf, -np.inf])
def test_a_level_above_the_mesh_is_an_error(level):
    part = mesh_part(closed_mesh(*cube(size=2.0)))
    for method in (part.volume_m3, part.area_m2, part.derivatives):
        with pytest.raises(HeightError, match="outside the mesh, which ends at 2 m"):
            method([1.0, level])


def test_a_hollow_a_heap_and_a_turned_mesh():
    hollow = closed_mesh(*together(cube(size=3), cube((1, 1, 1), 1.0, inverted=True)))
    assert (hollow.bodies, hollow.notes) == (2, ())
    assert mesh_part(hollow).volume_m3([1.5, 3.0]) == pytest.approx([13.0, 26.0])
    grain = together(
        cube(size=5), cube((1, 1, 1), 3.0, inverted=True), cube((2, 2, 2)), cube((6, 0, 0))
    )
    assert mesh_part(closed_mesh(*grain)).volume_m3([5.0])[0] == pytest.approx(125 - 27 + 2)
    turned = closed_mesh(grain[0], grain[1][:, ::-1])
    assert turned.notes == ("all faces looked inwards and were turned",)
    assert mesh_part(turned).volume_m3([5.0])[0] == pytest.approx(125 - 27 + 2)
    side_by_side = closed_mesh(*together(cube(), cube((1, 0, 0))))
    assert side_by_side.notes == ("at 4 edges more than two faces meet",)
    assert mesh_part(side_by_side).volume_m3([0.5])[0] == pytest.approx(1.0)
    touching = closed_mesh(*together(cube(), cube((1, 0.25, 0.25), 0.5)))
    assert mesh_part(touching).volume_m3([1.0])[0] == pytest.approx(1.125)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("many", "bodies"), [(40, 40), (999, None)])
def test_nested_hollows_are_separated_or_refused(many, bodies):
    """Closed form: shells of alternating sign; of a thousand in one another nobody waits."""
    sizes = 1 + np.arange(many) / many
    nested = [
        cube(low=(-size / 2,) * 3, size=size, inverted=bool((many - 1 - k) % 2))
        for k, size in enumerate(sizes)
    ]
    if bodies is None:
        with pytest.raises(InputError, match="boxes of 999 bodies meet one another 997002 times"):
            closed_mesh(*together(*nested))
        return
    signs = (-1.0) ** (many - 1 - np.arange(many))
    found = mesh_part(closed_mesh(*together(*nested)))
    assert found.capacity_m3 == pytest.approx(np.sum(signs * sizes**3), rel=1e-12)


def test_crossing_bars_without_inner_vertex_count_twice():
    """The limit of the checks: two bars of 3 x 1 x 1 that share a unit cube hold 5 m3, not 6."""
    first, faces = cube()
    across = first * (3, 1, 1) - (1.5, 0.5, 0.5), faces
    along = first * (1, 3, 1) - (0.5, 1.5, 0.5), faces
    found = closed_mesh(*together(across, along))
    assert found.bodies == 2
    assert mesh_part(found).volume_m3([1.0])[0] == pytest.approx(6.0)


def test_harmless_defects_are_repaired_and_noted():
    vertices, faces = cube()
    unused = np.vstack([vertices, [[0, 0, -9]]])
    needle = np.vstack([faces, [[0, 1, 1], [3, 3, 3]]])
    apart = unused[needle.ravel()]  # as STL has it: three own vertices a face
    found = closed_mesh(apart, np.arange(len(apart)).reshape(-1, 3))
    assert found.notes == ("2 faces without three different corners were left out",)
    assert found.vertices_m.shape == (8, 3)
    assert mesh_part(found).volume_m3([1.0])[0] == pytest.approx(1.0, rel=1e-15)
    far = (vertices * 8 + (0, 7.4e6, 0)).astype(np.float32)
    assert closed_mesh(far, faces).notes == (
        "coordinates of 7400008 m hold seven digits, 0.5 m: write the mesh from a nearby origin",
    )


def crossed():
    """A bow tie standing upright: the two loops of its outline run in opposite directions."""
    outline = np.array([[0, 0], [1, 0], [-1, 2], [2, 2]], dtype=float)
    front = np.column_stack([outline[:, 0], np.zeros(4), outline[:, 1]])
    back = front + (0, 1, 0)
    faces = [[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]]
    for i in range(4):
        j = (i + 1) % 4
        faces += [[j, i, i + 4], [j, i + 4, j + 4]]
    return np.vstack([front, back]), np.array(faces)


def broken(change):
    vertices, faces = cube()
    return change(vertices.copy(), faces.copy())


def _one_turned(vertices, faces):
    faces[0] = faces[0][::-1]
    return vertices, faces


BAD = {
    "open": (
        broken(lambda v, f: (v, f[1:])),
        r"has 3 open edges, the first from \(0.0000, 0.0000, 0.0000\)",
    ),
    "one face turned": (broken(_one_turned), "3 edges between faces of opposite orientation"),
    "empty": (broken(lambda v, f: (v, f[:0])), "has no triangles; expected a closed mesh"),
    "only needles": (
        broken(lambda v, f: (v, f[:, [0, 0, 1]])),
        "no triangle with three different corners",
    ),
    "nan": (broken(lambda v, f: (np.where(v > 0, v, np.nan), f)), "expected finite numbers"),
    "squares": (broken(lambda v, f: (v, f[:, [0, 1, 2, 0]])), r"expected triangles \(m, 3\)"),
    "flat points": (broken(lambda v, f: (v[:, :2], f)), r"expected numbers \(n, 3\)"),
    "index": (broken(lambda v, f: (v, f + 1)), "names vertex 8; expected 0 to 7"),
    "negative index": (broken(lambda v, f: (v, f - 1)), "names vertex -1; expected 0 to 7"),
    "twice": (together(cube(), cube()), "12 faces are given twice"),
    "both sides": (
        broken(lambda v, f: (v, np.vstack([f[:1], f[:1, ::-1]]))),
        "encloses no volume; expected a closed body",
    ),
    "flat": (broken(lambda v, f: (v * (1, 1, 0), f)), "encloses no volume|given twice"),
    "overlap": (together(cube(size=2), cube((1, 1, 1), 2.0)), "two bodies overlap at"),
    "one in another": (together(cube(size=3), cube((1, 1, 1))), "1 of 2 bodies are inside out"),
    "inside out beside": (together(cube(), cube((3, 0, 0), inverted=True)), "1 of 2 bodies"),
    "crossed": (crossed(), "the mesh crosses itself"),
    "millimetres": (cube(size=13_000.0), "is the unit right"),
    "kilometres": (cube(size=0.013), "is the unit right"),
    "dust": (
        together(*(cube((2 * (i % 40), 2 * (i // 40), 0)) for i in range(1001))),
        "the mesh has 1001 bodies; expected at most 1000",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_mesh_without_volume_is_reported(name):
    (vertices, faces), expected = BAD[name]
    with pytest.raises(InputError, match=expected) as error:
        closed_mesh(vertices, faces, name="tank.stl")
    assert str(error.value).startswith("tank.stl: ")
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "off", "STL"])
def test_files_in_millimetres_are_read(kind, tmp_path):
    mesh = star(8)
    mesh.vertices = np.round(mesh.vertices * 2**10) / 2**10 * 1000
    path = tmp_path / f"tank.{kind}"
    mesh.export(path, file_type=kind.lower())
    found = read_mesh(path, unit_m=1e-3)
    volume = mesh_part(found).volume_m3([np.ptp(found.vertices_m[:, 2])])[0]
    assert volume == pytest.approx(mesh.volume * 1e-9, rel=1e-6)
    write_mesh(found, tmp_path / f"again.{kind.lower()}")
    again = read_mesh(tmp_path / f"again.{kind.lower()}")
    assert len(again.faces) == len(mesh.faces)


def test_mesh_at_utm_coordinates_has_nearby_origin(tmp_path):
    """Property: STL from an origin within the tank holds the volume to its seven digits."""
    mesh, origin = hull(9), np.array([3e5, 7.4e6, 12.0])
    found = closed_mesh(mesh.vertices + origin, mesh.faces)
    write_mesh(found, tmp_path / "near.stl", origin_m=origin)
    near = read_mesh(tmp_path / "near.stl")
    assert near.notes == ()
    volume = mesh_part(near).volume_m3([np.ptp(near.vertices_m[:, 2])])[0]
    assert volume == pytest.approx(mesh.volume, rel=1e-6)


@pytest.mark.parametrize("unit_m", [0.0, -0.001, np.nan, np.inf])
def test_impossible_unit_is_reported(unit_m):
    with pytest.raises(InputError, match="expected a length above 0"):
        closed_mesh(*cube(), unit_m=unit_m)


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("tank.step", b"ISO-10303-21;", "expected one of .stl, .obj, .ply, .off"),
        ("tank.stl", b"", "is not a readable STL file|has no triangles"),
        (
            "tank.stl",
            b"solid nothing\nendsolid nothing\n",
            "is not a readable STL file|has no triangles",
        ),
        (
            "tank.stl",
            b"\x00" * 80 + b"\xff\xff\xff\xff" + b"1" * 50,
            "not a readable STL file|no triangles",
        ),
        (
            "tank.ply",
            b"ply\nformat ascii 1.0\nend_header\n",
            "is not a readable PLY file|has no triangles",
        ),
        ("tank.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "is not a readable OBJ file|has no triangles"),
        ("tank.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "3 open edges"),
        ("tank.off", b"not a mesh", "is not a readable OFF file"),
        ("gone.stl", None, "cannot be read: No such file"),
    ],
)
def test_bad_mesh_files_are_reported_in_one_line(name, content, expected, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=expected) as error:
        read_mesh(tmp_path / name)
    assert str(error.value).startswith(f"{name}: ")
    assert len(str(error.value).splitlines()) == 1


def _text_of(kind):
    """A cube as text of a mesh file, and the row at which its corners begin."""
    corners = [" ".join(map(str, xyz)) for xyz in CUBE_VERTICES.tolist()]
    if kind == "off":
        faces = ["3 {} {} {}".format(*face) for face in CUBE_FACES.tolist()]
        return ["OFF", "8 12 0", *corners, *faces], 2
    if kind == "obj":
        faces = ["f {} {} {}".format(*(face + 1)) for face in CUBE_FACES]
        return ["o tank", *(f"v {corner}" for corner in corners), *faces], 1
    head = [
        "ply", "format ascii 1.0", "element vertex 8",
        *(f"property float {axis}" for axis in "xyz"),
        "element face 12", "property list uchar int vertex_indices", "end_header",
    ]  # fmt: skip
    faces = ["3 {} {} {}".format(*face) for face in CUBE_FACES.tolist()]
    return [*head, *corners, *faces], len(head)


@pytest.mark.parametrize("kind", ["off", "obj", "ply"])
def test_unused_lines_of_mesh_file_change_nothing(kind):
    """Property: blank rows, comments, names in quotation marks, tabs and any line end."""
    lines, start = _text_of(kind)
    comment = {"off": "# x", "obj": "# x", "ply": "comment x"}[kind]
    changes = {
        "as it is": lines,
        "blank rows": [*lines[:1], "", *lines[1 : start + 2], "  ", *lines[start + 2 :], "", ""],
        "blank first": ["", *lines],
        "comments": [*lines[:1], comment, *lines[1 : start + 2], comment, *lines[start + 2 :]],
        "spaces": [f" {line}  " for line in lines],
    }
    if kind == "obj":
        named = ['g "shell, 5" pipe"', 'usemtl "st eel"', "mtllib 'a b.mtl'"]
        changes["names"] = ['o "my tank"', *lines[1:4], *named, *lines[4:]]
        changes["beside"] = [*lines[:2], lines[2] + " # corner", *lines[3:-1], lines[-1] + " # end"]
        changes["broken"] = [*lines[:-1], lines[-1].replace(" ", " \\\n", 1)]
    if kind == "off":
        changes["beside"] = ["# made by hand", "off", "8 12 0 # all", *lines[2:]]
    for name, rows in changes.items():
        for end in ("\n", "\r\n", "\r"):
            found = parse_mesh(f"tank.{kind}", end.join(rows).encode())
            assert (len(found.faces), found.bodies) == (12, 1), (name, end)
    found = parse_mesh(f"tank.{kind}", "\n".join(lines).replace(" ", "\t").encode())
    assert len(found.faces) == 12


def dented_shell(seed=3, inset=0.008, scale=1.0004):
    """Three courses with ovality that turns with the height, and steps."""
    rng, joints, courses = np.random.default_rng(seed), [0.0, 1.9, 3.8, 5.7], []
    for index, low in enumerate(joints[:-1]):
        ends = [modes(0.0, 2, *rng.normal(0, 0.02, (2, 4)))[0] for _ in range(2)]

        def radius_at(z, low=low, ends=ends, index=index):
            t = (z - low) / 1.9
            return lambda a: 6.5 - 0.01 * index + (1 - t) * ends[0](a) + t**2 * ends[1](a)

        own = {"inset_m": inset * (index + 1), "scale": scale}
        courses.append(course_of(low, joints[index + 1], radius_at, **own))
    return ShellVolume(tuple(courses))


@pytest.mark.slow
def test_loft_of_shell_agrees_with_quadrature(figure):
    """Every row; the error falls with the square of the spacing, to the quadrature."""
    volume = dented_shell()
    rows = np.array([0.95, 1.9, 2.85, 3.8, 4.75, 5.7])
    exact, errors = volume.volume_m3(rows), []
    for slices, count in ((8, 180), (16, 360), (32, 720)):
        mesh = loft(shell_bands(volume, slices=slices, azimuths=count))
        assert mesh.bodies == 1
        errors.append(mesh_part(mesh).volume_m3(rows) / exact - 1)
    limit = (4 * errors[2] - errors[1]) / 3
    figure(
        "loft of 720 x 96 less quadrature, worst row (ppm)", f"{1e6 * np.abs(errors[2]).max():.2f}"
    )
    figure("its limit less quadrature, worst row (ppb)", f"{1e9 * np.abs(limit).max():.2f}")
    assert errors[0] / errors[1] == pytest.approx(np.full(6, 4.0), rel=0.02)
    assert errors[1] / errors[2] == pytest.approx(np.full(6, 4.0), rel=0.02)
    assert np.abs(limit).max() < 1e-8


def test_the_loft_is_watertight_where_courses_step_trimesh():
    volume = dented_shell()
    mesh = loft(shell_bands(volume, slices=2, azimuths=90))
    local = mesh.vertices_m - mesh.vertices_m.mean(axis=0)
    found = trimesh.Trimesh(local, mesh.faces, process=False)
    assert found.is_watertight
    assert found.is_winding_consistent
    assert found.body_count == 1
    part = mesh_part(mesh)
    assert found.volume == pytest.approx(part.volume_m3([5.7])[0], rel=1e-9)
    for level in (1.9 - 1e-6, 1.9 + 1e-6):
        cut = below(found, found.bounds[0, 2] + level)
        lid = -np.sum(cut.area_faces * cut.face_normals[:, 2])
        assert part.area_m2([level])[0] == pytest.approx(lid, rel=1e-9)
    assert part.area_m2([1.9])[0] == pytest.approx(part.area_m2([1.9 + 1e-9])[0], rel=1e-9)


def test_bands_that_do_not_fit_are_refused():
    band = Band(np.array([0.0, 1.0]), np.ones((2, 12)), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="begin where the last one ends"):
        loft([band, Band(band.heights_m + 1.5, band.radii_m, band.centre_m)])
