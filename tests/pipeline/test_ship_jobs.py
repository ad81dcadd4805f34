"""Jobs of tanks of ships: from [ship] to corrections, their uncertainty, and what is refused."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from job_builder import write_job

import tankcal
from tankcal.errors import InputError
from tankcal.tank.meshes import closed_mesh
from tankcal.tank.ships import Pipe, corrections_of, piped_mesh

trimesh = pytest.importorskip("trimesh")

EXAMPLE = Path("examples/ship")
SHIP = {
    "ship.trim_m": [-1.0, 0.0, 2.0],
    "ship.length_between_marks_m": 100.0,
    "ship.list_deg": [0.0, 1.5],
    "ship.pipe_bottom_m": [-5.5, -2.5, 0.0],
    "ship.pipe_top_m": [-5.2, -2.5, 6.0],
    "ship.correction_step_m": 0.5,
    "table.step_m": 0.5,
}
UNCERTAINTY = [
    ("scale", 300, "ppm"),
    ("datum", 3, "mm"),
    ("trim", 20, "mm"),
    ("list", 0.1, "deg"),
    ("pipe_x", 50, "mm"),
    ("pipe_y", 50, "mm"),
    ("pipe_lean", 3, "mm/m"),
]


def box(length=12.0, breadth=6.0, height=5.0, taper=0.0):
    found = trimesh.creation.box((length, breadth, height))
    vertices = np.array(found.vertices) + (0, 0, height / 2)
    vertices[:, 1] *= 1 - taper * (vertices[:, 0] > 0) * (vertices[:, 2] > 0)
    return trimesh.Trimesh(vertices, found.faces, process=False)


def off(mesh):
    return mesh.export(file_type="stl")


def result_of(folder, mesh=None, settings=None, uncertainty=UNCERTAINTY):
    mesh = box() if mesh is None else mesh
    given = SHIP | (settings or {})
    folder = write_job(folder, kind="mesh", mesh=off(mesh), settings=given, uncertainty=uncertainty)
    return tankcal.run(tankcal.load(folder), simulated=False)


@pytest.mark.slow
def test_box_of_a_job(tmp_path):
    """Closed form: x tan(trim) + y tan(list) of an upright pipe, to the micrometre."""
    ship = result_of(tmp_path / "job", settings={"ship.pipe_top_m": [-5.5, -2.5, 6.0]}).ship
    expected = -5.5 * ship.trim_m[:, None] / 100 - 2.5 * np.tan(ship.list_rad)
    middle = (ship.sounding_m > 1) & (ship.sounding_m < 4)
    found = ship.correction_m[:, :, middle]
    assert found == pytest.approx(np.broadcast_to(expected[..., None], found.shape), abs=1e-9)


@pytest.mark.slow
def test_the_table_is_that_of_the_mesh(tmp_path):
    """Second method: the same mesh without [ship] and its zero at the pipe's lower end."""
    upright = {"ship.pipe_top_m": [-5.5, -2.5, 6.0]}
    both = [("scale", 300, "ppm"), ("datum", 3, "mm"), ("surface", 2, "mm")]
    of_ship = result_of(tmp_path / "ship", settings=upright, uncertainty=both).table
    without = write_job(
        tmp_path / "mesh",
        kind="mesh",
        mesh=off(box()),
        settings={"table.step_m": 0.5},
        uncertainty=both,
    )
    today = tankcal.run(tankcal.load(without), simulated=False).table
    for name in ("height_m", "volume_m3", "u_m3", "area_m2"):
        assert getattr(of_ship, name) == pytest.approx(getattr(today, name), abs=1e-9)


@pytest.mark.slow
def test_linear_u_against_monte_carlo(tmp_path, figure):
    """Simulation: every input drawn, volumes and corrections of each draw computed anew. The offset
    of the surface is not among them; it has its own closed form in tests/tank/ships.
    """
    mesh = box(taper=0.3)
    ship = result_of(tmp_path / "job", mesh).ship
    rows, draws = np.array([2, 5, 8]), 500
    rng = np.random.default_rng(22)
    closed = closed_mesh(np.array(mesh.vertices, dtype=np.float32).astype(float), mesh.faces)
    bottom, top = (np.array(SHIP[f"ship.pipe_{end}_m"]) for end in ("bottom", "top"))
    volumes, corrections = [], []
    for _ in range(draws):
        scale, trim, x, y = rng.normal(size=4) * (300e-6, 0.020, 0.050, 0.050)
        zero, list_, *lean = rng.normal(size=4) * (0.003, np.radians(0.1), 0.003, 0.003)
        length = np.linalg.norm(top - bottom)
        u = (top - bottom) / length
        end = u + (lean[0] * (np.eye(3)[0] - u * u[0])) + (lean[1] * (np.eye(3)[1] - u * u[1]))
        place = bottom + (x, y, 0)
        pipe = Pipe(place, place + length * end / np.linalg.norm(end))
        tilted = (2.0 + trim) / 100, np.tan(np.radians(1.5) + list_)
        tank, even = (piped_mesh(closed, pipe, *at, scale=1 + scale) for at in (tilted, (0.0, 0.0)))
        read = np.append(0.0, ship.sounding_m[rows] + zero)
        found = corrections_of([tank], even, read)[0]
        volumes.append(found.volume_m3[1:])
        corrections.append(found.even_m[1:] - read[1:])
    for name, drawn, linear in (
        ("volumes", volumes, ship.u_m3[2, 1, rows]),
        ("corrections", corrections, ship.u_correction_m[2, 1, rows]),
    ):
        ratio = np.std(drawn, axis=0) / linear
        figure(
            f"u of {name} by Monte Carlo over the linear one", " ".join(f"{r:.3f}" for r in ratio)
        )
        assert ratio == pytest.approx(1.0, abs=0.1)  # 500 draws: 0.032 standard


@pytest.mark.slow
def test_what_both_tables_share_cancels_in_a_correction(tmp_path):
    """Property: a scale moves a volume and hardly its correction; trim moves both."""
    by_scale = result_of(tmp_path / "scale", uncertainty=[("scale", 1000, "ppm")]).ship
    by_trim = result_of(tmp_path / "trim", uncertainty=[("trim", 20, "mm")]).ship
    place = 2, 1, 6
    assert by_scale.u_m3[place] == pytest.approx(3e-3 * by_scale.volume_m3[place], rel=0.5)
    assert by_scale.u_correction_m[place] < 1e-3
    assert by_trim.u_correction_m[place] == pytest.approx(5.35 * 0.020 / 100, rel=0.05)


@pytest.mark.slow
def test_contraction_shrinks_the_tank(tmp_path):
    """Closed form: of a uniform contraction by c the full tank holds (1 - c)^3 as much."""
    plain = result_of(tmp_path / "plain")
    settings = {"ship.contraction_percent": 0.4}
    found = result_of(tmp_path / "cold", None, settings, [("contraction", 0.02, "%")])
    assert found.body.parts[0].capacity_m3 == pytest.approx(
        plain.body.parts[0].capacity_m3 * 0.996**3, rel=1e-12
    )
    u = found.table.u_m3[5] / found.table.volume_m3[5]
    assert u == pytest.approx(2 * 0.0002, rel=0.02)  # at a fixed sounding: 3 V - s A, here 2 V


@pytest.mark.slow
def test_inputs_that_only_corrections_have_are_named(tmp_path):
    warnings = [str(one) for one in result_of(tmp_path / "job", uncertainty=()).warnings]
    (undeclared,) = [one for one in warnings if "not declared" in one]
    for name in ("trim", "list", "pipe_x", "pipe_y", "pipe_lean"):
        assert name in undeclared


@pytest.mark.slow
def test_the_soundings_end_with_the_full_tank_or_the_pipe(tmp_path):
    settings = {"ship.pipe_top_m": [-5.5, -2.5, 5.0], "ship.correction_step_m": 0.2}
    ship = result_of(tmp_path / "job", settings=settings).ship
    assert ship.sounding_m[-1] == pytest.approx(5.0)
    settings["ship.pipe_top_m"] = [-5.5, -2.5, 5.13]
    between = result_of(tmp_path / "between", settings=settings).ship
    assert between.sounding_m[-2:].tolist() == pytest.approx([5.0, 5.13])
    settings["ship.pipe_top_m"] = [-5.5, -2.5, 9.0]
    longer = result_of(tmp_path / "longer", settings=settings).ship
    assert longer.sounding_m[-1] >= longer.full_m.max() > longer.sounding_m[-2]
    assert np.all(longer.state[..., -1] == "full")
    assert np.array_equal(np.isnan(longer.correction_m), longer.state != "")


@pytest.mark.slow
def test_no_sounding_has_a_correction(tmp_path):
    """A step beyond the tank, where a dry pipe hides less than at even keel."""
    settings = {
        "ship.pipe_bottom_m": [-5.5, -2.5, 1.0],
        "ship.pipe_top_m": [-5.2, -2.5, 12.0],
        "ship.trim_m": [5.0],
        "ship.list_deg": [10.0],
        "ship.correction_step_m": 8.0,
    }
    ship = result_of(tmp_path / "job", settings=settings).ship
    assert set(ship.state.ravel()) <= {"below", "full"}
    assert np.all(np.isnan(ship.correction_m))
    assert np.isfinite(ship.u_m3[ship.state == "below"]).all()


BAD = [
    ({"ship.pipe_bottom_m": [-5.5, -3.5, 0.0]}, "ship.pipe_bottom_m", "outside the mesh"),
    ({"ship.pipe_bottom_m": [-5.5, -2.5, -0.2]}, "ship.pipe_bottom_m", "outside the mesh"),
    ({"ship.pipe_top_m": [-5.5, -2.5, 4.0]}, "ship.pipe_top_m", "1.000 m below the top"),
    ({"ship.correction_step_m": 1e-6}, "ship.correction_step_m", "a longer step"),
]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("changes", "place", "words"), BAD)
def test_a_pipe_that_does_not_fit_the_mesh(tmp_path, changes, place, words):
    with pytest.raises(InputError) as caught:
        result_of(tmp_path / "job", settings=changes)
    (problem,) = caught.value.problems
    assert place in str(problem)
    assert words in str(problem)


def test_hostile_meshes_are_told_in_one_line(tmp_path):
    """An open mesh, and two shells that overlap."""
    whole = box()
    holed = trimesh.Trimesh(whole.vertices, whole.faces[1:], process=False)
    two = trimesh.util.concatenate([box(), box().apply_translation((1, 1, 1))])
    for name, mesh, words in (("open", holed, "open edges"), ("two", two, "bodies overlap")):
        with pytest.raises(InputError) as caught:
            result_of(tmp_path / name, mesh)
        (problem,) = caught.value.problems
        assert words in str(problem)


@pytest.fixture(scope="module")
def example():
    return tankcal.run(tankcal.load(EXAMPLE), simulated=False)


def test_the_mesh_of_the_example_is_that_of_its_script(tmp_path):
    found = importlib.util.spec_from_file_location("make_mesh", EXAMPLE / "make_mesh.py")
    script = importlib.util.module_from_spec(found)
    found.loader.exec_module(script)
    script.write(tmp_path / "tank.off")
    assert (tmp_path / "tank.off").read_bytes() == (EXAMPLE / "tank.off").read_bytes()


@pytest.mark.slow
def test_the_example_against_trimesh(example):
    """Second program: the mesh, warmed by hand, turned and cut level by trimesh."""
    ship, job = example.ship, example.job
    warm = 1 + job.material.expansion_per_k * (15.0 - 22.0)
    mesh = trimesh.load_mesh(EXAMPLE / "tank.off")
    mesh.apply_scale(warm)
    bottom, top = (warm * np.array(one) for one in (job.ship.pipe_bottom_m, job.ship.pipe_top_m))
    along = (top - bottom) / np.linalg.norm(top - bottom)
    for trim, list_, row in ((5, 3, 8), (0, 0, 20), (6, 4, 30)):
        up = np.array([ship.trim_m[trim] / 96, np.tan(ship.list_rad[list_]), 1.0])
        wet_to = bottom + ship.sounding_m[row] * along
        turn = trimesh.geometry.align_vectors(up, (0, 0, 1))
        turned = mesh.copy().apply_transform(turn)
        at = turn[:3, :3] @ wet_to
        cut = trimesh.intersections.slice_faces_plane(turned.vertices, turned.faces, (0, 0, -1), at)
        below = trimesh.Trimesh(*cut[:2], process=False)
        assert ship.volume_m3[trim, list_, row] == pytest.approx(below.volume, rel=1e-9)


def test_the_numbers_of_the_example(example):
    """Those of its README, and that sounding + correction, read in the table, gives the volume."""
    ship, table = example.ship, example.table
    place = 5, 3, 8
    assert (ship.trim_m[5], np.degrees(ship.list_rad[3]), ship.sounding_m[8]) == pytest.approx(
        (2.0, 1.0, 2.0)
    )
    found = (1000 * ship.correction_m[place], ship.volume_m3[place], ship.U_m3[place])
    assert found == pytest.approx((-188.0, 241.4, 1.9), abs=0.05)
    assert table.at(2.0).value_m3 == pytest.approx(272.3, abs=0.05)
    readable = ship.state == ""
    soundings = np.broadcast_to(ship.sounding_m, readable.shape)[readable]
    read = table.weights(soundings + ship.correction_m[readable]) @ table.volume_m3
    assert read == pytest.approx(
        ship.volume_m3[readable], abs=2 * example.straightness.largest_m3 + 1e-9
    )
