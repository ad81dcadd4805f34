"""A wall whose limbs were sighted from a traverse: its table, slips by name, straps beside it.

Truth: exact geometry (sights that touch the wall, by turning them); generalised least squares
written out; the same survey in a workbook; properties.
"""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from fuzzing import spoilt_csv
from generated_hits import Surface, Tool
from generated_tangents import (
    Circle,
    ring_of_stations,
    rows_of,
    take_tangents,
    traverse_tables,
)
from job_builder import tangent_parts, write_book, write_folder
from page_figures import figures_of

import tankcal
from tankcal.covariance import PointCovariance
from tankcal.errors import InputError, SolutionError
from tankcal.geometry.field.sites import free_design
from tankcal.methods.moved_setups import critical_of_setup, judge_tangents
from tankcal.pipeline.wall.shared_unknowns import noise_of_wall
from tankcal.survey.poses import poses_in_network
from tankcal.survey.tangents import touch

FOOT, SLOPE, HEIGHT, PLATE = (0.3, -0.2), (0.002, -0.001), 8.0, 0.008
LEVELS = (0.4, 1.6, 2.4, 3.6, 4.4, 5.6, 6.4, 7.6)
STATIONS, ZEROS = ring_of_stations(8, 13.0), 0.7 * np.arange(8)
NOISY, LIMB = Tool(sd_m=5e-4, sd_rad=1e-5), Circle(2e-5)


def circle(azimuth, z):
    """Radius of a cylinder."""
    return 6.5 + 0 * (azimuth + z)


def oval(azimuth, z):
    """Radius: two waves round, and a little wider above."""
    return 6.5 + 0.006 * np.sin(2 * azimuth) + 0.001 * z + 0 * azimuth


def valley(azimuth, z):
    """Radius: a valley that tangents bridge, 12 mm deep and some 0.4 m wide."""
    arc = 6.5 * np.angle(np.exp(1j * (azimuth - 1.0)))
    return 6.5 - 0.012 * np.exp(-((arc / 0.2) ** 2)) + 0 * z


def inside_of(radius):
    """m3 inside the plates, by quadrature of a shell whose horizontal cuts are stated."""
    z, azimuth = np.linspace(0, HEIGHT, 401), np.linspace(0, 2 * np.pi, 1441)[:-1]
    areas = [np.pi * np.mean((radius(azimuth, one) - PLATE) ** 2) for one in z]
    return np.trapezoid(areas, z)


def sights(
    radius=oval, tool=LIMB, rng=None, levels=LEVELS, disturbed=None, steps=400, stations=STATIONS
):
    """Rows of tangents.csv of all set-ups; disturbed: {set-up: rad that its circle turned}."""
    surface, found = Surface(radius, FOOT, SLOPE), []
    for i, (at, zero) in enumerate(zip(stations, ZEROS[: len(stations)], strict=True)):
        name = f"I{i + 1}"
        turned = replace(tool, turned_rad=(disturbed or {}).get(name, 0.0))
        read = take_tangents(surface, at, levels, 6.5, turned, rng, zero, steps=steps)
        found += rows_of(name, read, lambda level: str(int(level / 2) + 1), 4.0)
    return found


def parts_of(rows=None, seed=1, **settings):
    """Parts of a tank of sights; noise of the traverse from the seed, None: without."""
    rng = None if seed is None else np.random.default_rng(seed)
    rows = rows if rows is not None else sights(rng=np.random.default_rng(seed))
    traverse = traverse_tables(STATIONS, ZEROS, NOISY, rng)
    return tangent_parts(rows, traverse, **settings)


def run(folder, parts):
    """Result of parts, without Monte Carlo."""
    return tankcal.run(tankcal.load(write_folder(folder, parts)), simulated=False)


def problems_of(folder, parts):
    """(file, row, column) of each problem of parts."""
    with pytest.raises(InputError) as error:
        run(folder, parts)
    return [(one.file, one.row, one.column) for one in error.value.problems]


SLOW_FIXTURES = {"noisy"}  # seconds each


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    return run(tmp_path_factory.mktemp("noisy") / "job", parts_of())


@pytest.mark.slow
@pytest.mark.parametrize("radius", [circle, oval])
def test_exact_tangents_give_the_table(tmp_path, radius, figure):
    """Exact geometry: a circle to its rounding, ovality within what is said of the hull."""
    result = run(tmp_path, parts_of(sights(radius, Circle(), steps=2000), seed=None))
    off = result.table.volume_m3[-1] / inside_of(radius) - 1
    figure(f"volume by exact tangents, {radius.__name__}", f"{1e6 * off:+.2f} ppm")
    mean, common = result.touching.hull.excess_m.mean(), result.touching.hull.common_sd_m.mean()
    radius_m, ppm, _, ppm_of_oval = figures_of(
        "docs/studies/tangents.md",
        "a leaning circle of () m is reproduced within () ppm of its volume, an oval of () mm "
        "within () ppm",
    )
    assert float(radius_m) == 6.5
    assert abs(off) < 1e-6 * float(ppm if radius is circle else ppm_of_oval)
    assert abs(off) < 5e-7 + 2 * (2 * common) / 6.5
    assert mean < 5e-5
    assert len(result.accepted) == 128


def test_noise_is_within_U(noisy):
    assert abs(noisy.table.volume_m3[-1] - inside_of(oval)) < noisy.table.U_m3[-1]
    budget = {one.name for one in noisy.budget().lines}
    assert {"instrument_scale", "tangent_excess", "points"} <= budget


@pytest.mark.slow
def test_blocks_and_shared_columns_equal_a_dense_matrix(tmp_path, noisy, monkeypatch):
    """Second method: the table from the dense covariance of the tangents."""

    def touch_dense(*arguments, **options):
        touching = touch(*arguments, **options)
        dense = PointCovariance.convert(touching.points.covariance_m2.dense(), 3)
        return replace(touching, points=replace(touching.points, covariance_m2=dense))

    monkeypatch.setattr("tankcal.methods.tangents.wall.touch", touch_dense)
    table = run(tmp_path, parts_of()).table
    np.testing.assert_allclose(noisy.table.volume_m3, table.volume_m3, rtol=1e-12)
    np.testing.assert_allclose(noisy.table.U_m3, table.U_m3, rtol=1e-9)


@pytest.mark.slow
def test_too_many_levels_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("tankcal.methods.tangents.readings.MOST_LEVELS", len(LEVELS) - 1)
    assert problems_of(tmp_path, parts_of()) == [("tangents.csv", None, None)]


def test_the_field_knows_of_limbs(noisy):
    """So that no size of a component is told by another (`test_field`)."""
    assert noisy.wall.field.sites.smoothed


@pytest.mark.slow
def test_valleys_are_within_U(tmp_path):
    result = run(tmp_path, parts_of(sights(valley, rng=np.random.default_rng(2)), seed=2))
    error = result.table.volume_m3[-1] - inside_of(valley)
    assert 0 < error < result.table.U_m3[-1]  # no tangent sees it


def waves(azimuth, z):
    """Radius: six waves round, highest where six stations at twice the radius see the wall."""
    return 6.5 + 0.003 * np.cos(6 * azimuth) + 0 * z


@pytest.mark.slow
@pytest.mark.parametrize(("distance_m", "is_told"), [(13.0, True), (6.5 * 2**0.5, False)])
def test_limbs_on_the_same_places_are_told(tmp_path, distance_m, is_told):
    """Closed form: six waves go into the radius where the limbs of two and two coincide, and not
    where these lie evenly.
    """
    stations = ring_of_stations(6, distance_m)
    rows = sights(waves, Circle(), stations=stations, steps=2000)
    parts = tangent_parts(rows, traverse_tables(stations, ZEROS[:6], Tool()))
    result = run(tmp_path, parts)
    told = {one.expected.code for one in result.warnings}
    assert ("limbs_coincide" in told) == is_told
    off = result.table.volume_m3[-1] / inside_of(waves) - 1
    assert off == pytest.approx(2 * 0.003 / 6.5 * is_told, abs=1.5e-4)  # the foot is 0.36 m off


@pytest.mark.slow
def test_a_workbook_is_the_same_job(tmp_path, noisy):
    book = tankcal.load(write_book(tmp_path / "job.xlsx", parts_of()))
    again = tankcal.run(book, simulated=False)
    np.testing.assert_allclose(again.table.volume_m3, noisy.table.volume_m3, rtol=1e-12)


def test_the_scale_of_the_traverse_is_that_of_the_radius(noisy):
    """A property: one u of the scale, 5 ppm, less what is told of it, moves a volume by 10 ppm."""
    line = next(one for one in noisy.budget().lines if one.name == "instrument_scale")
    volume = noisy.table.volume_m3[-1]
    assert abs(line.contribution) / volume == pytest.approx(10e-6, rel=0.02)


def test_poses_have_the_covariance_of_the_network(noisy):
    """Second method: a pose by the adjusted points and nuisances of the network itself."""
    poses, tools = poses_in_network(noisy.job.tangents, noisy.adjustment)
    adjusted = noisy.adjustment.adjusted
    for i, name in enumerate(noisy.adjustment.names):
        place = [key for key, _ in poses.keys].index("I" + name[1:])
        np.testing.assert_allclose(poses.xyz_m[place], noisy.adjustment.xyz_m[i], atol=1e-12)
        number = noisy.adjustment.there[i]
        own = adjusted.covariance_m2([number])
        at = 4 * place + np.arange(3)
        np.testing.assert_allclose(poses.covariance[np.ix_(at, at)], own, atol=1e-16)
    assert tools == ((5e-6, 0.0),)


def test_statistics_are_those_of_leaving_one_out(noisy):
    """Second method: dense generalised least squares, written out, without one tangent."""
    tests = judge_tangents(noisy.job, noisy.wall, noisy.touching)
    wall, field = noisy.wall, noisy.wall.field
    order = np.concatenate([one.group.members for one in wall.sections])
    at = wall.accepted[order]
    whole = field.covariance_m2 + noise_of_wall(wall) - field.noise_m2
    design = free_design(field.sites)[0]
    for one in (0, 17, 90):
        rest = np.delete(np.arange(len(at)), one)
        inverse = np.linalg.inv(whole[np.ix_(rest, rest)])
        x, y, k = design[rest], field.radius_m[rest], whole[one, rest]
        cofactor = np.linalg.inv(x.T @ inverse @ x)
        beta = cofactor @ x.T @ inverse @ y
        short = design[one] - k @ inverse @ x
        predicted = design[one] @ beta + k @ inverse @ (y - x @ beta)
        variance = whole[one, one] - k @ inverse @ k + short @ cofactor @ short
        departure = field.radius_m[one] - predicted
        assert tests.departure_m[at[one]] == pytest.approx(departure, abs=1e-9)
        assert tests.w[at[one]] == pytest.approx(departure / np.sqrt(variance), abs=1e-5)
        assert tests.mdb_m[at[one]] == pytest.approx(4.13 * np.sqrt(variance), rel=1e-2)
    assert np.all((tests.redundancy > 0) & (tests.redundancy < 1))


@pytest.mark.slow
def test_a_tangent_to_a_rail_is_set_aside_by_name(tmp_path):
    rows = sights(rng=np.random.default_rng(1))
    rows[37]["direction_deg"] += 0.2
    result = run(tmp_path, parts_of(rows))
    tests = judge_tangents(result.job, result.wall, result.touching)
    assert np.flatnonzero(~tests.used).tolist() == [37]
    assert tests.departure_m[37] > 0.02
    assert abs(result.table.volume_m3[-1] - inside_of(oval)) < result.table.U_m3[-1]


@pytest.mark.slow
def test_compared_tangents_are_not_adjusted(tmp_path):
    rows = sights(rng=np.random.default_rng(1))
    for row in rows:
        row["use"] = "check" if row["setup"] == "I3" else ""
    result = run(tmp_path, parts_of(rows))
    assert len(result.accepted) == 112


@pytest.mark.slow
def test_exchanged_limbs_are_told(tmp_path):
    rows = sights(levels=(1.0, 3.0, 5.0, 7.0))
    rows[5]["side"] = "right" if rows[5]["side"] == "left" else "left"
    assert problems_of(tmp_path / "one", parts_of(rows)) == [("tangents.csv", 7, "side")]
    for row in rows:
        row["side"] = "right" if row["side"] == "left" else "left"
    assert problems_of(tmp_path / "all", parts_of(rows)) == [("tangents.csv", 2, "side")]


def test_exchanged_directions_are_told_as_limbs(tmp_path):
    rows = sights(levels=(1.0, 3.0, 5.0, 7.0))
    rows[2]["direction_deg"], rows[3]["direction_deg"] = (
        rows[3]["direction_deg"],
        rows[2]["direction_deg"],
    )
    expected = [("tangents.csv", row, "side") for row in (4, 5)]
    assert problems_of(tmp_path, parts_of(rows)) == expected


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1 / 0.9, 0.9, -1.0])
@pytest.mark.parametrize("names", [None, ("I4",)])
def test_angles_of_another_kind_are_told(tmp_path, factor, names):
    rows = sights(levels=(1.0, 3.0, 5.0, 7.0))
    for row in rows:
        if names is None or row["setup"] in names:
            row["direction_deg"] = row["direction_deg"] * factor % (360 if factor > 0 else -360)
    (found,) = problems_of(tmp_path, parts_of(rows))
    assert found[::2] == ("tangents.csv", "direction")


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1 / 0.9, 0.9])
@pytest.mark.parametrize("names", [None, ("I4",)])
def test_zenith_angles_in_another_unit_are_told(tmp_path, factor, names):
    rows = sights(levels=(1.0, 3.0, 5.0, 7.0))
    for row in rows:
        if names is None or row["setup"] in names:
            row["zenith_deg"] = row["zenith_deg"] * factor
    told = problems_of(tmp_path, parts_of(rows))
    assert {one[::2] for one in told} == {("tangents.csv", "zenith")}
    assert len(told) == (len(STATIONS) if names is None else 1)


@pytest.mark.slow
def test_a_disturbed_set_up_is_named(tmp_path):
    """A turn of 5 minutes; a tenth of that looks like the form of the wall, and is in U."""
    rng = np.random.default_rng(3)
    rows = sights(rng=rng, disturbed={"I5": np.radians(300 / 3600)})
    result = run(tmp_path, parts_of(rows))
    named = [one for one in result.warnings if one.column == "setup"]
    assert [(one.file, one.row) for one in named] == [("setups.csv", 6)]
    tests = judge_tangents(result.job, result.wall, result.touching)
    assert max(tests.setups, key=lambda one: tests.setups[one][0]) == "I5"
    assert np.degrees(tests.setups["I5"][1]) * 3600 == pytest.approx(300, abs=60)


def test_a_sound_set_up_is_not_named(noisy):
    assert not [one for one in noisy.warnings if one.column == "setup"]
    tests = judge_tangents(noisy.job, noisy.wall, noisy.touching)
    assert all(w < critical_of_setup(8) for w, _, _ in tests.setups.values())


@pytest.mark.slow
def test_exchanged_courses_and_levels_are_told(tmp_path):
    rows = sights(levels=(1.0, 3.0, 5.0, 7.0))
    for row in rows:
        row["course"] = {"1": "2", "2": "1"}.get(row["course"], row["course"])
    told = problems_of(tmp_path / "courses", parts_of(rows))
    assert {one[::2] for one in told} == {("tangents.csv", "level_m")}
    rows = sights(levels=(1.0, 3.0, 5.0, 7.0))
    for row in rows:
        if row["level_m"] in (1.0, 3.0):
            row["level_m"] = 4.0 - row["level_m"]
            row["course"] = str(int(row["level_m"] / 2) + 1)
    result = run(tmp_path / "levels", parts_of(rows))
    assert len([one for one in result.warnings if one.column == "level_m"]) == 2


@pytest.mark.slow
def test_straps_beside_tangents_are_readings_of_the_wall(tmp_path, noisy):
    parts = parts_of()
    parts.tables["circumferences"] = [
        ["circumference", "course", "level_m", "reading_m", "s_mm", "instrument"],
        *(
            [name, "1", z, 2 * np.pi * (6.5 + 0.001 * z) + np.pi * 2e-4, 0.5, "T"]
            for name, z in (("a", 0.4), ("b", 1.6))
        ),
    ]
    tape = {"kind": "tape", "thickness_mm": 0.2, "u_scale_ppm": 10.0}
    parts.registers["instruments"]["T"] = tape
    result = run(tmp_path, parts)
    assert result.straps.accepted.all()
    assert result.table.U_m3[-1] < noisy.table.U_m3[-1]
    assert abs(result.table.volume_m3[-1] - inside_of(oval)) < result.table.U_m3[-1]


def _no_traverse(parts):
    for name in ("directions", "zenith_angles", "slope_distances"):
        del parts.tables[name]
    return [("tangents.csv", None)]


def _inside(parts):
    parts.settings["survey.side"] = "inside"
    return [("job.toml", "survey.side")]


def _unknown_setup(parts):
    parts.tables["tangents"][3][0] = "I9"
    return [("tangents.csv", "setup")]


def _unknown_course(parts):
    column = parts.tables["tangents"][0].index("course")
    parts.tables["tangents"][3][column] = "9"
    return [("tangents.csv", "course")]


def _no_side(parts):
    column = parts.tables["tangents"][0].index("side")
    parts.tables["tangents"][3][column] = ""
    return [("tangents.csv", "side")]


def _few_setups(parts):
    rows = parts.tables["tangents"]
    parts.tables["tangents"] = [one for one in rows if one[0] in ("setup", "I1", "I2")]
    return [("tangents.csv", "level_m")] * 4


def _beside_targets(parts):
    parts.tables["targets"] = [["point", "section"], ["S1", "1"]]
    return [("targets.csv", None)]


def _not_in_network(parts):
    for name in ("directions", "zenith_angles", "slope_distances"):
        rows = parts.tables[name]
        parts.tables[name] = [one for one in rows if one[0] != "I8" and one[1] != "S8"]
    return [("setups.csv", "setup")]


BAD = [one for name, one in list(globals().items()) if name.startswith("_") and callable(one)]


@pytest.mark.slow
@pytest.mark.parametrize("spoil", BAD, ids=lambda one: one.__name__.strip("_"))
def test_bad_input_is_one_line_each(tmp_path, spoil):
    parts = parts_of(sights(levels=(1.0, 3.0, 5.0, 7.0)))
    wanted = spoil(parts)
    found = problems_of(tmp_path, parts)
    assert sorted((file, column or "") for file, _, column in found) == sorted(
        (file, column or "") for file, column in wanted
    )


@pytest.mark.slow
def test_spoilt_tables_give_lines_and_no_traceback(tmp_path):
    """Property: each spoilt job is computed or refused in plain lines."""
    parts = parts_of(sights(levels=(1.0, 3.0, 5.0, 7.0)))
    write_folder(tmp_path / "base", parts)
    rng = np.random.default_rng(5)
    for number in range(40):
        name = rng.choice(["tangents", "setups", "directions"])
        folder = write_folder(tmp_path / str(number), parts)
        file = folder / f"{name}.csv"
        text = spoilt_csv(file.read_text("utf-8"), rng)
        file.write_bytes(text.encode(errors="surrogatepass"))
        with contextlib.suppress(InputError, SolutionError):
            tankcal.run(tankcal.load(folder), simulated=False)


@pytest.mark.slow
def test_the_table_of_tangents_may_come_in_gon(tmp_path, noisy):
    parts = parts_of()
    columns, *rows = parts.tables["tangents"]
    at = columns.index("direction_deg")
    columns[at] = "direction_gon"
    for row in rows:
        row[at] = row[at] / 0.9
    result = run(tmp_path, parts)
    np.testing.assert_allclose(result.table.volume_m3, noisy.table.volume_m3, rtol=1e-9)


@pytest.mark.slow
def test_a_traverse_in_feet_is_told(tmp_path):
    """Where its tangents alone show it: a minimal datum takes any scale."""
    traverse = traverse_tables(STATIONS, ZEROS, NOISY, np.random.default_rng(1))
    heads, *rows = traverse["slope_distances"]
    at = heads.index("distance_m")
    times = [[c / 0.3048 if i == at else c for i, c in enumerate(row)] for row in rows]
    parts = tangent_parts(sights(), traverse | {"slope_distances": [heads, *times]})
    with pytest.raises(InputError, match="its bar, are in feet"):
        run(tmp_path / "job", parts)
