"""A mesh at trim and list: closed forms of a box, quadrature, trimesh as second program."""

from itertools import pairwise

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.tank.meshes import closed_mesh, mesh_part
from tankcal.tank.ships import (
    Pipe,
    corrections_of,
    in_ship_frame,
    piped_mesh,
    soundings_of_volumes,
)

trimesh = pytest.importorskip("trimesh")

L, B, H = 12.0, 6.0, 5.0  # of the box, centred about the origin of the plan, base at z = 0


def box_mesh(length=L, breadth=B, height=H):
    found = trimesh.creation.box((length, breadth, height))
    return closed_mesh(np.array(found.vertices) + (0, 0, height / 2), np.array(found.faces))


def star(seed, subdivisions=2):
    """A sphere with a random radius at every vertex, not convex at all, randomly turned."""
    rng = np.random.default_rng(seed)
    found = trimesh.creation.icosphere(subdivisions=subdivisions)
    found.vertices *= rng.uniform(0.5, 1.0, (len(found.vertices), 1)) * (4.0, 2.0, 3.0)
    found.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    return closed_mesh(np.array(found.vertices), np.array(found.faces))


def upright(x=0.0, y=0.0, bottom=0.0, top=50.0):
    return Pipe(np.array([x, y, bottom]), np.array([x, y, top]))


def leaning(mesh, seed):
    """A pipe that leans, from a place inside a star-shaped mesh about the origin."""
    rng = np.random.default_rng(seed)
    foot = rng.uniform(-0.3, 0.3, 3) - (0, 0, 0.5)
    return Pipe(foot, foot + (*rng.uniform(-2, 2, 2), 8.0))


@pytest.mark.parametrize(("trim", "list_"), [(0.02, 0.0), (-0.03, 0.05), (0.01, -0.08)])
def test_box_with_a_pipe_in_a_corner(trim, list_):
    """Closed form: while the surface cuts neither base nor top, V = l b h_c with h_c in the middle,
    and the correction of a sounding is x_p tan(trim) + y_p tan(list).
    """
    x, y = -L / 2, -B / 2  # the starboard corner aft
    pipe, mesh = upright(x, y), box_mesh()
    part, even = (piped_mesh(mesh, pipe, *at) for at in ((trim, list_), (0.0, 0.0)))
    middle = np.linspace(0.6, H - 0.6, 41)
    correction = x * trim + y * list_
    assert part.volume_m3(middle - correction) == pytest.approx(L * B * middle, abs=1e-9)
    found = corrections_of([part], even, middle - correction)[0]
    assert set(found.state) == {""}
    assert found.even_m - (middle - correction) == pytest.approx(correction, abs=1e-11)


@pytest.mark.parametrize("seed", range(4))
def test_box_whose_base_and_top_are_cut(seed):
    """Second method: the depth of liquid over each place of the plan, by Gauss quadrature over
    strips between the lines where the surface meets base and top.
    """
    rng = np.random.default_rng(seed)
    trim, list_ = rng.uniform(-0.6, 0.6, 2)
    x, y = rng.uniform(-1, 1, 2) * (L / 2, B / 2)
    part = piped_mesh(box_mesh(), upright(x, y), trim, list_)
    soundings = np.linspace(0.0, part.top_m, 12)[:-1]
    expected = [depth_over_plan(s + trim * x + list_ * y, trim, list_) for s in soundings]
    assert part.volume_m3(soundings) == pytest.approx(expected, abs=1e-9)


def depth_over_plan(level, trim, list_):
    """Integral of min(max(level - trim x - list y, 0), H) over the plan of the box."""
    nodes, weights = np.polynomial.legendre.leggauss(12)

    def pieces(low, high, edges):
        inside = sorted(edge for edge in edges if low < edge < high)
        ends = [low, *inside, high]
        return list(pairwise(ends))

    total = 0.0
    corners = [(level - wall - list_ * y) / trim for wall in (0, H) for y in (-B / 2, B / 2)]
    for low, high in pieces(-L / 2, L / 2, corners):
        for node, weight in zip(nodes, weights, strict=True):
            x = (low + high) / 2 + node * (high - low) / 2
            edges = [(level - wall - trim * x) / list_ for wall in (0, H)]
            for start, end in pieces(-B / 2, B / 2, edges):
                y = (start + end) / 2 + nodes * (end - start) / 2
                depth = np.clip(level - trim * x - list_ * y, 0, H)
                total += weight * (high - low) / 2 * (weights @ depth) * (end - start) / 2
    return total


@pytest.mark.parametrize("seed", range(3))
def test_turned_by_trimesh(seed):
    """Second program: trimesh turns the mesh until the vertical is up, and cuts it level."""
    rng = np.random.default_rng(seed)
    mesh = star(seed)
    trim, list_ = rng.uniform(-0.5, 0.5, 2)
    pipe = leaning(mesh, seed)
    part = piped_mesh(mesh, pipe, trim, list_)
    soundings = np.linspace(0, part.top_m, 9)[1:-1]
    vertical = np.array([trim, list_, 1.0])
    turned = trimesh.Trimesh(mesh.vertices_m, mesh.faces, process=False)
    turn = trimesh.geometry.align_vectors(vertical, (0, 0, 1))
    turned.apply_transform(turn)
    wet_to = pipe.bottom_m + soundings[:, None] * pipe.direction
    expected = [below(turned, z).volume for z in (wet_to @ turn[:3, :3].T)[:, 2]]
    assert part.volume_m3(soundings) == pytest.approx(expected, abs=1e-11 * turned.volume)


def below(mesh, z):
    cut = trimesh.intersections.slice_faces_plane(mesh.vertices, mesh.faces, (0, 0, -1), (0, 0, z))
    return trimesh.Trimesh(*cut[:2], process=False)


@pytest.mark.parametrize("seed", range(3))
def test_even_keel_is_the_table_of_the_mesh(seed):
    """Second method: today's table of a mesh whose zero is the pipe's lower end."""
    mesh = star(seed)
    foot = np.array([0.1, -0.2, -0.6])
    part = piped_mesh(mesh, Pipe(foot, foot + (0, 0, 5.0)))
    today = mesh_part(mesh, foot[2])
    soundings = np.linspace(0, part.top_m, 50)
    assert part.top_m == pytest.approx(today.top_m, rel=1e-14)
    assert part.volume_m3(soundings) == pytest.approx(today.volume_m3(soundings), abs=1e-9)
    ours, theirs = part.derivatives(soundings), today.derivatives(soundings)
    for name in theirs:
        assert ours[name] == pytest.approx(theirs[name], abs=1e-9)


def test_a_leaning_pipe_at_even_keel_reads_longer():
    """Closed form: a pipe that leans by an angle is longer by 1 / cos."""
    mesh, lean = box_mesh(), np.radians(20)
    pipe = Pipe(np.zeros(3), 20 * np.array([np.sin(lean), 0, np.cos(lean)]))
    part = piped_mesh(mesh, pipe)
    assert part.top_m == pytest.approx(H / np.cos(lean), rel=1e-14)
    assert part.volume_m3([2 / np.cos(lean)]) == pytest.approx([2 * L * B], rel=1e-13)


def test_signs():
    """Trim by the stern lifts the surface aft, a list to starboard lifts it there: of the same
    volume a pipe there reads more, and its correction is negative.
    """
    mesh, soundings = box_mesh(), np.array([2.5])
    for x, y, trim, list_ in ((-5.0, 0.0, 0.02, 0.0), (0.0, -2.5, 0.0, 0.02)):
        even = piped_mesh(mesh, upright(x, y))
        for sign in (1, -1):
            for side in (1, -1):
                tilted = piped_mesh(mesh, upright(side * x, side * y), sign * trim, sign * list_)
                found = corrections_of([tilted], even, soundings)[0]
                assert np.sign(found.even_m - soundings)[0] == -sign * side


def test_bow_azimuth():
    """Property: where the bow of the mesh's frame lies changes nothing once it is said."""
    mesh, seed = star(4), 4
    pipe = leaning(mesh, seed)
    expected = piped_mesh(mesh, pipe, 0.1, -0.2)
    soundings = np.linspace(0, expected.top_m, 7)
    for azimuth in (0.0, 1.0, 4.0):  # of the bow; port is a quarter turn before it
        bow = np.array([np.sin(azimuth), np.cos(azimuth)])
        port = np.array([-np.cos(azimuth), np.sin(azimuth)])

        def as_surveyed(xyz, bow=bow, port=port):
            return np.column_stack([xyz[:, :2] @ np.array([bow, port]), xyz[:, 2]])

        vertices = in_ship_frame(as_surveyed(mesh.vertices_m), azimuth)
        ends = in_ship_frame(as_surveyed(np.array([pipe.bottom_m, pipe.top_m])), azimuth)
        assert vertices == pytest.approx(mesh.vertices_m, abs=1e-14)
        found = piped_mesh(closed_mesh(vertices, mesh.faces), Pipe(*ends), 0.1, -0.2)
        assert found.volume_m3(soundings) == pytest.approx(expected.volume_m3(soundings), abs=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_derivatives(seed):
    """Against differences of the exact volumes of moved, turned and scaled tanks."""
    mesh = star(seed)
    pipe, trim, list_ = leaning(mesh, seed), 0.07, -0.11
    part = piped_mesh(mesh, pipe, trim, list_)
    soundings = np.sort(np.random.default_rng(seed).uniform(0.05, 0.95, 12)) * part.top_m
    analytic = part.derivatives(soundings)
    u = pipe.direction

    def volumes(name, step):
        moved, at = pipe, [trim, list_]
        if name == "trim":
            at[0] += step
        elif name == "list":
            at[1] = np.tan(np.arctan(list_) + step)
        elif name.startswith("pipe_"):
            shift = np.eye(3)[int(name in ("pipe_y", "lean_y"))] * step
            moved = Pipe(pipe.bottom_m + shift, pipe.top_m + shift)
        elif name.startswith("lean_"):
            turned = u + step * np.eye(3)[int(name == "lean_y")]
            moved = Pipe(pipe.bottom_m, pipe.bottom_m + 9 * turned / np.linalg.norm(turned))
        scale = 1 + step if name == "scale" else 1.0
        zero = step if name == "datum" else 0.0
        return piped_mesh(mesh, moved, *at, scale=scale).volume_m3(soundings + zero)

    analytic |= {f"lean_{axis}": analytic["pipe_lean"][:, i] for i, axis in enumerate("xy")}
    for name in ("trim", "list", "pipe_x", "pipe_y", "lean_x", "lean_y", "scale", "datum"):
        assert_derivative(
            lambda step, name=name: volumes(name, step[0]), [0.0], analytic[name][:, None]
        )
    assert part.area_m2(soundings) == pytest.approx(analytic["datum"], rel=1e-14)


def test_the_wetted_area_of_a_trimmed_tank():
    """Closed form: the surface of a box below a leaning plane that cuts its four sides alone."""
    part = piped_mesh(box_mesh(), upright(), 0.1, 0.05)
    wetted = part.derivatives([2.5])["surface"]
    assert wetted == pytest.approx([L * B + 2 * (L + B) * 2.5], rel=1e-13)


def test_contraction_is_a_derivative():
    """Differences by the share that all lengths are contracted by."""
    mesh = star(9)
    pipe = leaning(mesh, 9)

    def tank(share):
        left = 1 - share
        return piped_mesh(mesh, pipe, 0.02, 0.03, scale=left, contracted=left)

    soundings = np.linspace(0.1, 0.9, 5) * tank(0.004).top_m
    by = tank(0.004).derivatives(soundings)["contraction"]
    assert_derivative(
        lambda share: tank(share[0]).volume_m3(soundings), [0.004], by[:, None], step=1e-6
    )


@pytest.mark.parametrize("seed", range(6))
def test_round_trip_on_random_tanks(seed):
    """Property: sounding + correction, read at even keel, is the volume at trim and list."""
    rng = np.random.default_rng(seed)
    mesh = star(seed, subdivisions=1)
    pipe = leaning(mesh, seed)
    trim, list_ = rng.uniform(-0.05, 0.05, 2)
    part, even = piped_mesh(mesh, pipe, trim, list_), piped_mesh(mesh, pipe)
    soundings = np.linspace(0, 1.1 * part.top_m, 60)
    found = corrections_of([part], even, soundings)[0]
    state = found.state
    some = state == ""
    assert some.sum() > 40
    assert even.volume_m3(found.even_m[some]) == pytest.approx(
        part.volume_m3(soundings[some]), abs=1e-12 * part.capacity_m3
    )
    assert np.array_equal(state == "full", soundings >= part.top_m)
    assert np.all(found.volume_m3[state == "below"] < even.dry_m3)


def test_volumes_of_a_tank_in_two_parts():
    """Property: a volume at which the tank has no surface, between two bodies, is met as well."""
    low, high = box_mesh(1, 1, 1), box_mesh(1, 1, 1)
    vertices = np.vstack([low.vertices_m, high.vertices_m + (3, 0, 4)])
    mesh = closed_mesh(vertices, np.vstack([low.faces, high.faces + len(low.vertices_m)]))
    part = piped_mesh(mesh, upright())
    soundings = soundings_of_volumes(part, np.array([0.0, 0.5, 1.0, 1.5, 2.0]))
    assert part.volume_m3(soundings) == pytest.approx([0, 0.5, 1.0, 1.5, 2.0], abs=1e-12)
