"""A wall that was hit without targets: its table, tied set-ups, straps beside hits, slips.

Truth: exact geometry; the same survey as named points in one network adjustment; generalised least
squares with an offset as an unknown, written out.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from generated_hits import (
    Surface,
    Tool,
    even_aims,
    network_tables,
    observe,
    rows_of,
    take_hits,
)
from job_builder import hit_parts, write_book, write_folder
from page_figures import figures_of

import tankcal
from tankcal.cli.running import describe_rejected
from tankcal.pipeline.wall.finding import take_points
from tankcal.pipeline.wall.shared_unknowns import estimate_causes
from tankcal.survey import adjust_survey, wall_points
from tankcal.survey.wall_hits import sight

FOOT, SLOPE, HEIGHT = (1.0, -0.5), (0.002, -0.001), 8.0
STATION = np.array([0.0, 0.0, 1.5])
LEVELS = (0.4, 1.6, 2.4, 3.6, 4.4, 5.6, 6.4, 7.6)
PLATE, TAPE = 0.008, 2e-4
NOISY = Tool(sd_m=1e-3, sd_rad=2.4e-5)


def oval(azimuth, z):
    """Radius: two waves round, and a little wider above."""
    return 6.5 + 0.006 * np.sin(2 * azimuth) + 0.001 * z + 0 * azimuth


def circle(azimuth, z):
    """Radius of a cylinder."""
    return 6.5 + 0 * (azimuth + z)


def volume_of(radius):
    """m3, by quadrature of a shell whose horizontal cuts are stated."""
    z, azimuth = np.linspace(0, HEIGHT, 401), np.linspace(0, 2 * np.pi, 721)[:-1]
    areas = [np.pi * np.mean(radius(azimuth, one) ** 2) for one in z]
    return np.trapezoid(areas, z)


def girth_of(radius, z):
    """Circumference of the outside of plates at a height."""
    azimuth = np.linspace(0, 2 * np.pi, 20001)
    r = radius(azimuth, z) + PLATE
    return np.sum(np.hypot(*np.diff([r * np.cos(azimuth), r * np.sin(azimuth)], axis=1)))


def parts_of(radius=oval, tool=Tool(), seed=None, levels=LEVELS, **settings):  # noqa: B008
    """Parts of a tank hit from one set-up in it."""
    surface = Surface(radius, FOOT, SLOPE)
    rng = None if seed is None else np.random.default_rng(seed)
    rows = rows_of("I", take_hits(surface, STATION, even_aims(surface, levels, 24), tool, rng))
    return hit_parts(rows, **settings)


def strapped(parts, radius=oval, more=None):
    """The parts with two straps of the first course; more: mm that each reading is too long by."""
    parts.tables["circumferences"] = [
        ["circumference", "course", "level_m", "reading_m", "s_mm", "instrument"],
        *(
            [name, "1", z, girth_of(radius, z) + np.pi * TAPE + (more or 0) / 1000, 0.5, "T"]
            for name, z in (("1a", 0.4), ("1b", 1.6))
        ),
    ]
    tape = {"kind": "tape", "thickness_mm": 0.2, "u_scale_ppm": 10.0}
    parts.registers["instruments"]["T"] = tape
    return parts


def run(folder, parts):
    """Result of parts, without Monte Carlo."""
    return tankcal.run(tankcal.load(write_folder(folder, parts)), simulated=False)


def problems_of(folder, parts):
    """(file, row, column) of each problem of parts."""
    with pytest.raises(tankcal.InputError) as error:
        run(folder, parts)
    return [(one.file, one.row, one.column) for one in error.value.problems]


def codes_of(result):
    """Columns of the warnings that name a column, and their files."""
    return {(one.file, one.column) for one in result.warnings}


@pytest.mark.slow
def test_one_setup_gives_the_table(tmp_path):
    result = run(tmp_path, parts_of())
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=2e-6)
    assert len(result.accepted) == 8 * 24
    noisy = run(tmp_path, parts_of(tool=NOISY, seed=1))
    assert abs(noisy.table.volume_m3[-1] - volume_of(oval)) < noisy.table.U_m3[-1]
    budget = {one.name: one for one in noisy.budget().lines}
    offset = budget["instrument_offset"]
    assert abs(offset.contribution) == pytest.approx(2 * 5e-4 / 6.5 * 1063, rel=0.12)


@pytest.mark.slow
def test_a_turned_circle_of_one_set_up_changes_nothing(tmp_path):
    """Property: the zero of a single set-up's directions is a choice; U to 1e-9."""
    first = run(tmp_path / "first", parts_of(tool=NOISY, seed=1))
    for turn_deg in (0.37, 123.456):
        parts = parts_of(tool=NOISY, seed=1)
        place = parts.tables["wall_hits"][0].index("direction_deg")
        for row in parts.tables["wall_hits"][1:]:
            row[place] = (row[place] + turn_deg) % 360
        turned = run(tmp_path / str(turn_deg), parts)
        np.testing.assert_allclose(turned.table.volume_m3, first.table.volume_m3, rtol=1e-9)
        np.testing.assert_allclose(turned.table.U_m3, first.table.U_m3, rtol=1e-9)


@pytest.mark.slow
def test_a_workbook_is_the_same_job(tmp_path):
    parts = parts_of(tool=NOISY, seed=1)
    book = tankcal.load(write_book(tmp_path / "job.xlsx", parts))
    again = tankcal.run(book, simulated=False)
    result = run(tmp_path / "folder", parts)
    np.testing.assert_allclose(again.table.volume_m3, result.table.volume_m3, rtol=1e-12)


def tied_parts(rng=None, offset_m=0.0):
    """Parts of a tank hit from two set-ups in it, which share four targets; places of these."""
    surface = Surface(oval, FOOT, SLOPE)
    stations = {"I": STATION, "II": np.array([2.5, -1.8, 1.7])}
    targets = surface.at(np.arange(4) * 1.7, np.array([1.0, 2.0, 1.5, 5.0]))
    zeros = {"I": 0.4, "II": 2.2}
    tool = replace(NOISY if rng is not None else Tool(), offset_m=offset_m)
    names = ["A", "B", "C", "D"]
    readings = {
        name: (names, observe(at, targets, tool, rng, zeros[name])) for name, at in stations.items()
    }
    rows = []
    for number, (name, at) in enumerate(stations.items()):
        aims = even_aims(surface, LEVELS, 12, turn=number * np.pi / 12)
        rows += rows_of(name, take_hits(surface, at, aims, tool, rng, zeros[name]))
    parts = hit_parts(rows, adjustment__datum="inner")
    parts.tables |= network_tables(readings)
    parts.tables["setups"] = [
        ["setup", "station", "instrument", "instrument_height_m"],
        ["I", "SI", "TS", 0.0],
        ["II", "SII", "TS", 0.0],
    ]
    parts.tables["control"] = [
        ["point", "x_m", "y_m", "z_m"],
        ["SI", 0.0, 0.0, 1.5],
        ["SII", 2.5, -1.8, 1.7],
    ]
    return parts


@pytest.mark.slow
def test_two_setups_tied_by_targets(tmp_path):
    result = run(tmp_path, tied_parts())
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=2e-6)
    noisy = run(tmp_path, tied_parts(np.random.default_rng(4)))
    assert abs(noisy.table.volume_m3[-1] - volume_of(oval)) < noisy.table.U_m3[-1]
    assert noisy.sighting.poses.ties == ("network", "network")


@pytest.mark.slow
def test_targets_of_the_wall_beside_hits(tmp_path):
    """Exact geometry: four targets on the wall count, too, and a slip of one is rejected."""
    parts = tied_parts()
    parts.tables["targets"] = [["point"], *([name] for name in "ABCD")]
    result = run(tmp_path / "sound", parts)
    assert result.job.points.names[-4:] == tuple("ABCD")
    assert len(result.accepted) == len(parts.tables["wall_hits"]) - 1 + 4
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=2e-5)  # one at a joint
    parts.tables["targets"] = [["point", "offset_mm"], *([n, 50.0 * (n == "B")] for n in "ABCD")]
    moved = run(tmp_path / "moved", parts)
    assert np.flatnonzero(moved.wall.shell.reason != "").tolist() == [len(moved.job.hits) + 1]
    from tankcal.record import record_of

    record = record_of(moved)
    (aside,) = record["rejected"]
    assert (aside["point"], aside["row"]) == ("B", 3)  # of targets.csv
    of_hits = record["hits"]
    assert sum(one["hits"] for one in of_hits["setups"]) == len(moved.job.hits)
    assert sum(one["hits"] for one in of_hits["rings"]) == len(moved.job.hits)


def test_targets_that_nothing_observes_are_refused_beside_hits(tmp_path):
    parts = parts_of()
    parts.tables["targets"] = [["point"], ["A"]]
    assert "targets.csv" in {one[0] for one in problems_of(tmp_path, parts)}


@pytest.mark.slow
@pytest.mark.parametrize("beside", [(), ("A", "B", "C", "D")])
def test_hits_after_the_network_are_named_points_in_it(tmp_path, beside):
    """Second method: the same readings as targets of their own, all in one adjustment; targets of
    the network that are on the wall come after the hits.
    """
    parts = tied_parts(np.random.default_rng(5))
    if beside:
        parts.tables["targets"] = [["point"], *([name] for name in beside)]
    parts.registers["instruments"]["TS"] |= {"u_incidence_mm": 0.0, "u_scale_ppm": 20.0}
    job = tankcal.load(write_folder(tmp_path / "hits", parts))
    hits = tankcal.run(job, simulated=False)
    headings, *rows = parts.tables.pop("wall_hits")
    of = {name: headings.index(name) for name in headings}
    parts.tables["targets"] = [["point"]]
    for number, row in enumerate(rows):
        name, setup = f"H{number}", row[of["setup"]]
        parts.tables["targets"].append([name])
        parts.tables["directions"].append([setup, name, row[of["direction_deg"]], 5.0])
        parts.tables["zenith_angles"].append([setup, name, row[of["zenith_deg"]], 5.0])
        parts.tables["slope_distances"].append([setup, name, row[of["distance_m"]], 1.0])
    parts.tables["targets"] += [[name] for name in beside]
    named = tankcal.load(write_folder(tmp_path / "named", parts))
    points = wall_points(adjust_survey(named.measurements), named.measurements, "inside")
    count, found = len(rows) + len(beside), sight(hits.job.hits, hits.sighting.poses).points
    if beside:
        found = hits.sighting.beside.after(found, hits.sighting.by_poses)
    # the frames differ: inner constraints hold all points there, the stations and targets here
    assert len(points.names) == count
    names = hits.job.points.names
    assert names == found.names
    from tankcal.pipeline.wall.surveyed import s_transform

    one, other = s_transform(found), s_transform(points)
    left, right = (p.xyz_m - p.xyz_m.mean(axis=0) for p in (one, other))
    turn = np.eye(3)
    turn[:2, :2] = scipy.linalg.orthogonal_procrustes(left[:, :2], right[:, :2])[0]
    np.testing.assert_allclose(left @ turn, right, atol=2e-9)
    turns = np.kron(np.eye(count), turn.T)
    turned = turns @ one.covariance_m2.dense() @ turns.T
    assert np.abs(turned - other.covariance_m2.dense()).max() < 2e-9 * np.abs(turned).max()
    shares = {one.what for one in found.causes}
    assert shares == {"instrument_offset", "instrument_scale"}
    for cause, twin in zip(one.causes, other.causes, strict=True):
        np.testing.assert_allclose(turns @ cause.column_m, twin.column_m, atol=1e-12)


def told_codes(result):
    return {one.expected.code for one in result.warnings}


@pytest.mark.slow
def test_an_offset_of_no_bare_wall_is_told(tmp_path):
    """The constant of a reflector: the straps tell it, and the table is right all the same."""
    for offset_m, is_told in ((0.0344, True), (0.002, False)):
        parts = strapped(parts_of(tool=Tool(offset_m=offset_m)))
        del parts.registers["instruments"]["TS"]["u_offset_mm"]
        result = run(tmp_path / str(offset_m), parts)
        assert ("offset_strange" in told_codes(result)) == is_told
        assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=2e-5)


@pytest.mark.slow
def test_a_wall_unlike_the_nominal_one_is_told(tmp_path):
    """Nothing else shows an offset that was declared: 1 in 500 of the radius is 13 mm."""
    for offset_m, is_told in ((0.0344, True), (0.002, False)):
        result = run(tmp_path / str(offset_m), parts_of(tool=Tool(offset_m=offset_m)))
        assert ("wall_unlike_nominal" in told_codes(result)) == is_told


@pytest.mark.slow
@pytest.mark.parametrize("turn_deg", [0.0, 0.5])
def test_a_set_up_whose_circle_was_turned_before_its_hits_is_named(tmp_path, turn_deg):
    """Two set-ups: that one of them moved is told, either may be it."""
    parts = tied_parts(np.random.default_rng(4))
    header, *rows = parts.tables["wall_hits"]
    setup, direction = header.index("setup"), header.index("direction_deg")
    for row in rows:
        row[direction] = (row[direction] + turn_deg * (row[setup] == "II")) % 360
    told = [one for one in run(tmp_path, parts).warnings if one.column == "setup"]
    named = [(one.file, one.expected.code) for one in told]
    assert named == ([("setups.csv", "hits_of_moved_setup")] if turn_deg else [])


def five_and_seven(azimuth, z):
    """Radius: five waves round, and seven, which six hits round a ring take for one."""
    return 6.5 + 0.003 * (np.cos(5 * azimuth - 1.0) + np.cos(7 * azimuth + 0.4)) + 0 * z


@pytest.mark.slow
def test_long_waves_of_a_wall_move_no_set_up(tmp_path):
    """Exact geometry: three sound set-ups that see six places each, between those of the others."""
    surface, tool, rng = Surface(five_and_seven, FOOT, SLOPE), NOISY, np.random.default_rng(4)
    stations = 2.5 * np.array([[0, 1, 0.6], [0.87, -0.5, 0.64], [-0.87, -0.5, 0.68]])
    targets, names = surface.at(np.arange(4) * 1.7, np.array([1.0, 2.0, 1.5, 5.0])), list("ABCD")
    rows, readings = [], {}
    for i, at in enumerate(stations):
        readings[f"E{i}"] = (names, observe(at, targets, tool, rng, i))
        aims = even_aims(surface, LEVELS, 6, turn=0.3 * i)
        rows += rows_of(f"E{i}", take_hits(surface, at, aims, tool, rng, i))
    parts = hit_parts(rows, adjustment__datum="inner")
    parts.tables |= network_tables(readings)
    setups = [[f"E{i}", f"SE{i}", "TS", 0.0] for i in range(3)]
    parts.tables["setups"] = [["setup", "station", "instrument", "instrument_height_m"], *setups]
    parts.tables["control"] = [
        ["point", "x_m", "y_m", "z_m"],
        *([f"SE{i}", *map(float, at)] for i, at in enumerate(stations)),
    ]
    assert "hits_of_moved_setup" not in told_codes(run(tmp_path, parts))


@pytest.mark.slow
def test_straps_tell_an_unknown_offset(tmp_path):
    parts = strapped(parts_of(tool=Tool(offset_m=0.002)))
    del parts.registers["instruments"]["TS"]["u_offset_mm"]
    result = run(tmp_path, parts)
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=2e-5)
    (told,) = estimate_causes(result.job, result.wall)
    assert told.u_before == np.inf
    assert abs(told.value) < 2e-6  # it was taken off, and the wall found once more
    assert result.sighting.estimated_m["TS"] == pytest.approx(0.002, abs=5e-5)
    assert -0.5 < told.correlation < 0
    assert np.abs(result.straps.w).max() < 1


@pytest.mark.slow
def test_straps_and_hits_are_one_least_squares_solution(tmp_path):
    """Second method: the offset as an unknown with its certificate as an observation."""
    parts = strapped(parts_of(tool=replace(NOISY, offset_m=4e-4), seed=2))
    result = run(tmp_path, parts)
    wall, field = result.wall, result.wall.field
    n = len(field.radius_m)
    (offset,) = (one for one in result.job.points.causes if one.what == "instrument_offset")
    column = -(wall.radii_by_points @ offset.column_m)
    from tankcal.geometry.field.sites import free_design

    design, starts = free_design(field.sites)
    without = field.covariance_m2 - np.outer(column, column)
    bare = np.block([[design, column[:, None]], [np.zeros((1, design.shape[1])), np.ones((1, 1))]])
    weight = np.linalg.inv(scipy.linalg.block_diag(without, np.eye(1)))
    y = np.append(field.radius_m, 0.0)
    normal = bare.T @ weight @ bare
    dense = np.linalg.solve(normal, bare.T @ weight @ y)
    means = np.array([field.radius_m[field.sites.course == c].mean() for c in range(4)])
    np.testing.assert_allclose(field._solution[0][starts] + means, dense[starts], atol=1e-9)
    (told,) = estimate_causes(result.job, wall)[:1]
    assert told.value == pytest.approx(offset.u / 1000 * dense[-1], abs=1e-9)
    sd = offset.u / 1000 * np.sqrt(np.linalg.inv(normal)[-1, -1])
    assert told.u_after == pytest.approx(sd, abs=1e-9)
    assert n == 8 * 24 + 2


@pytest.mark.slow
def test_straps_of_an_outside_survey_by_points(tmp_path):
    """Points and straps see the same outside: plates are taken off once."""
    parts = strapped(parts_of(tool=NOISY, seed=3))
    plates = strapped(parts_of(tool=NOISY, seed=3))
    for one in (parts, plates):
        rows = one.tables.pop("wall_hits")
        del one.tables["setups"], one.registers["instruments"]["TS"]
        surface = Surface(lambda a, z: oval(a, z) + PLATE, FOOT, SLOPE)
        aims = even_aims(surface, LEVELS, 24)
        points = [[f"P{i}", *map(float, xyz), 1.0, 1.0, 1.0] for i, xyz in enumerate(aims)]
        headings = ["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]
        one.tables["points"] = [headings, *points]
        one.settings["survey.side"] = "outside"
        assert rows
    first = run(tmp_path / "a", parts)
    assert first.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=1e-5)
    assert np.abs(first.straps.w).max() < 1
    for row in plates.tables["courses"][1:]:
        row[2] = 7.0
    second = run(tmp_path / "b", plates)
    more = second.table.volume_m3[-1] / first.table.volume_m3[-1] - 1
    assert more == pytest.approx(2 * 0.001 / 6.5, rel=0.01)


@pytest.mark.slow
def test_a_thinner_plate_moves_a_strap_inside_once(tmp_path):
    """The strap is outside, the hits inside: 1 mm less plate is 1 mm more of its inner radius, and
    as much of the offset, of which steep sights take less.
    """
    free = strapped(parts_of())
    del free.registers["instruments"]["TS"]["u_offset_mm"]
    first = run(tmp_path / "a", free)
    for row in free.tables["courses"][1:]:
        row[2] = 7.0
    second = run(tmp_path / "b", free)
    more = second.wall.field.outlines_m.mean(axis=(1, 2)) - first.wall.field.outlines_m.mean(
        axis=(1, 2)
    )
    assert more[0] == pytest.approx(0.001, abs=1e-5)
    assert 0.0007 < more[3] < 0.0009
    lines = {one.name: one for one in first.budget().lines}
    grown = second.table.volume_m3[-1] - first.table.volume_m3[-1]
    assert -lines["plate_thickness"].sensitivity == pytest.approx(grown, rel=5e-3)


@pytest.mark.slow
def test_a_gauge_of_plates_bears_on_the_straps_alone(tmp_path):
    """Inside hits do not see the plate: only that of the strapped course counts, and by its sd."""
    parts = strapped(parts_of())
    del parts.registers["instruments"]["TS"]["u_offset_mm"]
    parts.tables["thickness"] = [
        ["course", "thickness_mm", "s_mm"],
        *([course, 8.0, 0.1] for course in ("1", "2")),
    ]
    lines = run(tmp_path, parts).budget().lines
    (gauge,) = (one for one in lines if one.name == "plate_readings")
    (plate,) = (one for one in lines if one.name == "plate_thickness")
    assert gauge.note == "1"
    assert abs(gauge.contribution) == pytest.approx(0.1 * abs(plate.sensitivity), rel=1e-6)


@pytest.mark.slow
def test_hits_beside_welds_are_left_out(tmp_path):
    parts = parts_of()
    clear = run(tmp_path, parts)
    parts.tables["welds"] = [["course", "azimuth_deg"], ["2", 61.0]]
    result = run(tmp_path, parts)
    gone = np.flatnonzero(result.wall.shell.reason == "weld")
    assert len(gone) == 2
    assert len(result.accepted) == len(clear.accepted) - 2


@pytest.mark.slow
def test_hits_that_are_only_compared(tmp_path):
    parts = parts_of()
    headings, *rows = parts.tables["wall_hits"]
    parts.tables["wall_hits"] = [
        [*headings, "use"],
        *([*row, "check" if i == 5 else None] for i, row in enumerate(rows)),
    ]
    parts.tables["wall_hits"][6][headings.index("distance_m")] += 0.004
    result = run(tmp_path, parts)
    assert len(result.job.points.names) == len(rows) - 1
    from tankcal.record import record_of

    (one,) = record_of(result)["hits"]["compared"]
    assert one["row"] == 7
    assert one["departure_m"] == pytest.approx(0.004, abs=4e-4)


@pytest.mark.slow
def test_points_taken_keep_their_covariance(tmp_path):
    result = run(tmp_path, parts_of(tool=NOISY, seed=1))
    whole = sight(result.job.hits, result.sighting.poses).points
    some = take_points(whole, np.array([3, 0]))
    assert some.names == (whole.names[3], whole.names[0])
    left, right = some.covariance_m2.dense()[:3, 3:], whole.covariance_m2.dense()[9:12, :3]
    np.testing.assert_allclose(left, right, rtol=1e-12, atol=0)
    np.testing.assert_array_equal(some.causes[0].column_m[:3], whole.causes[0].column_m[9:12])


# set-ups that are tied to nothing but the wall

PAGE = {
    0: "9.0755 96.9617 9.1185 81.1682 10.2111 61.9606",
    60: "9.0496 96.9817 9.0885 81.1388 10.1794 61.8657",
    120: "9.1662 96.8925 9.2048 81.2517 10.2840 62.1767",
    180: "9.1073 96.9373 9.1457 81.1946 10.2299 62.0169",
    240: "9.0555 96.9771 9.0999 81.1500 10.1962 61.9162",
    300: "9.1354 96.9158 9.1841 81.2318 10.2775 62.1577",
}


AROUND = np.linspace(0, 2 * np.pi, 90, endpoint=False)


def line_parts(longer_m=0.0, scale=0.0):
    """Parts of the page of worked numbers, section 2: six lines by total station, and a strap."""
    rows = []
    for azimuth, text in PAGE.items():
        distance, zenith = np.array(text.split(), dtype=float).reshape(3, 2).T
        read = distance * (1 + scale) + longer_m
        rows += [
            {"setup": f"L{azimuth}", "direction_deg": 0.0, "zenith_deg": z, "distance_m": d}
            for z, d in zip(zenith.tolist(), read.tolist(), strict=True)
        ]
    parts = hit_parts(
        rows,
        survey__side="outside",
        tank__nominal_diameter_m=12.4,
        tank__nominal_height_m=8.1,
        shell__shape_sd_mm=0.0,
    )
    heights = [["1", 2.0, 0.0], ["2", 3.0, 0.0], ["3", 3.1, 0.0]]
    setups = [[f"L{azimuth}", f"S{azimuth}", 1.6] for azimuth in PAGE]
    parts.tables |= {
        "courses": [["course", "height_m", "thickness_mm"], *heights],
        "setups": [["setup", "station", "instrument_height_m"], *setups],
        "circumferences": [
            ["circumference", "course", "level_m", "reading_m", "s_mm", "instrument"],
            ["1", "1", 0.5, 38.9809 + np.pi * TAPE, 0.3, "T"],
        ],
    }
    tape = {"kind": "tape", "thickness_mm": 0.2, "u_scale_ppm": 10.0}
    parts.registers["instruments"]["T"] = tape
    return parts


def radii_of(result):
    """(sections,) mean radius at the height of each, as the field has it."""
    return [
        result.wall.field.outlines_at([one.group.zeta(one.group.height_m)])[i, 0].mean()
        for i, one in enumerate(result.wall.sections)
    ]


@pytest.mark.slow
def test_lines_by_total_station(tmp_path):
    """The page's radii and lean; it leaves out the eccentricity, 0.006 mm at the top."""
    result = run(tmp_path, line_parts())
    assert radii_of(result) == pytest.approx([38.9809 / 2 / np.pi, 6.20312, 6.20191], abs=1.2e-5)
    assert result.wall.shell.slope == pytest.approx((0.0018, -0.0009), abs=1e-5)
    assert np.isnan(result.straps.w).all()
    longer = radii_of(run(tmp_path, line_parts(longer_m=0.0015)))
    moved = np.subtract(longer, radii_of(result))
    assert moved == pytest.approx([0.0, 7e-6, 164e-6], abs=1e-6)
    scaled = np.subtract(radii_of(run(tmp_path, line_parts(scale=1e-4))), radii_of(result))
    assert np.abs(scaled).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("longer_mm", [0.3, 0.7, 1.2, 1.4, 3.0])
def test_what_nothing_controls_is_not_set_aside(tmp_path, longer_mm):
    """Property: where a line alone tells its own place, rounding rejects none of its readings."""
    result = run(tmp_path, line_parts(longer_m=1e-3 * longer_mm))
    assert len(result.accepted) == 18


def test_lines_tell_no_radius_without_a_strap(tmp_path):
    parts = line_parts()
    del parts.tables["circumferences"]
    with pytest.raises(tankcal.SolutionError, match="lines of it"):
        run(tmp_path, parts)


def arc_parts(setups=4, seed=None, wide=1.7, control=True):
    """Parts of a tank hit from outside, each set-up seeing an arc; stations are known roughly."""
    surface = Surface(lambda a, z: oval(a, z) + PLATE, FOOT, SLOPE)
    rng = None if seed is None else np.random.default_rng(seed)
    rows, known = [], [["point", "x_m", "y_m", "z_m"]]
    places = [["setup", "station", "instrument_height_m"]]
    tool = Tool() if rng is None else NOISY
    for number in range(setups):
        azimuth = 2 * np.pi * number / setups
        away = 13.5 * np.array([np.sin(azimuth), np.cos(azimuth)])
        station = np.array([*(away + FOOT), 1.6])
        arc = azimuth + np.linspace(-wide / 2, wide / 2, 9)
        aims = np.vstack([surface.at(arc, np.full(9, z)) for z in LEVELS])
        read = take_hits(surface, station, aims, tool, rng, zero=0.3 * number + 0.1)
        rows += rows_of(f"S{number}", read)
        places.append([f"S{number}", f"P{number}", 0.0 if control else 1.6])
        rough = station + [0.4 * np.sin(3 * number), -0.3, 0.0]
        known.append([f"P{number}", *rough.tolist()])
    parts = hit_parts(rows, survey__side="outside")
    parts.tables["setups"] = places
    if control:
        parts.tables["control"] = known
    return parts


@pytest.mark.slow
@pytest.mark.parametrize("control", [True, False])
def test_set_ups_that_the_wall_alone_ties(tmp_path, control):
    result = run(tmp_path, arc_parts(control=control))
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=1e-4)
    assert set(result.sighting.poses.ties) == {"wall"}
    assert result.wall.shell.slope == pytest.approx(SLOPE, abs=1e-5)
    noisy = run(tmp_path, arc_parts(seed=1, control=control))
    assert abs(noisy.table.volume_m3[-1] - volume_of(oval)) < noisy.table.U_m3[-1]


@pytest.mark.slow
def test_untied_set_ups_walked_anticlockwise(tmp_path):
    """Property: nobody said where they stood; the lean says which way round they follow."""
    clockwise = run(tmp_path / "a", arc_parts(setups=5, seed=2, control=False))
    parts = arc_parts(setups=5, seed=2, control=False)
    heading, *rows = parts.tables["wall_hits"]
    parts.tables["wall_hits"] = [heading, *sorted(rows, key=lambda row: row[0], reverse=True)]
    other = run(tmp_path / "b", parts)
    assert other.table.volume_m3[-1] == pytest.approx(clockwise.table.volume_m3[-1], rel=1e-5)
    assert np.hypot(*other.wall.shell.slope) == pytest.approx(
        np.hypot(*clockwise.wall.shell.slope), abs=2e-6
    )


def mirrored(parts):
    for row in parts.tables["control"][1:]:
        row[1] *= -1.0


def exchanged(parts):
    rows = parts.tables["setups"]
    rows[2][1], rows[4][1] = rows[4][1], rows[2][1]


@pytest.mark.slow
@pytest.mark.parametrize(("slip", "told"), [(mirrored, "control.csv"), (exchanged, "setups.csv")])
def test_stations_in_another_order_are_refused(tmp_path, slip, told):
    parts = arc_parts(setups=6, seed=2)
    slip(parts)
    with pytest.raises(tankcal.InputError) as refused:
        run(tmp_path, parts)
    (problem,) = refused.value.problems
    assert problem.file == told
    assert slip.__name__ in problem.expected.code
    assert told == "control.csv" or {"'S1'", "'S3'"} <= set(str(problem).split())


@pytest.mark.slow
def test_sections_of_untied_set_ups_are_those_of_the_wall(tmp_path):
    """Property: a strap moves set-ups that see a line each, and so what is said of their hits."""
    result = run(tmp_path, line_parts(longer_m=0.004))
    of_outlines = [one.outline.radius_m(AROUND).mean() for one in result.wall.sections]
    assert of_outlines == pytest.approx(radii_of(result), abs=2e-4)


@pytest.mark.slow
def test_untied_set_ups_start_from_certified_distances(tmp_path):
    """A constant of the certificate, such as that of a reflector that was set: the same tank."""
    first = run(tmp_path / "a", arc_parts(seed=3))
    parts = arc_parts(seed=3)
    place = parts.tables["wall_hits"][0].index("distance_m")
    for row in parts.tables["wall_hits"][1:]:
        row[place] -= 0.030
    parts.registers["instruments"]["TS"]["correction_mm"] = 30.0
    second = run(tmp_path / "b", parts)
    assert second.table.volume_m3[-1] == pytest.approx(first.table.volume_m3[-1], rel=1e-7)
    assert second.table.U_m3[-1] == pytest.approx(first.table.U_m3[-1], rel=1e-5)


@pytest.mark.slow
def test_the_frame_of_untied_set_ups_is_a_choice(tmp_path):
    """Stations given elsewhere, turned: the same volume and U."""
    parts = arc_parts(seed=3)
    first = run(tmp_path / "a", parts)
    for row in parts.tables["control"][1:]:
        x, y = row[1:3]
        row[1:3] = [100.0 + 0.8 * x - 0.6 * y, -50.0 + 0.6 * x + 0.8 * y]
    second = run(tmp_path / "b", parts)
    (ppm,) = figures_of(
        "docs/studies/wall-hits.md",
        "Turning the frame of untied set-ups changes volumes by less than () ppm",
    )
    volume_m3 = first.table.volume_m3[-1]
    assert second.table.volume_m3[-1] == pytest.approx(volume_m3, rel=1e-6 * float(ppm))
    assert second.table.U_m3[-1] == pytest.approx(first.table.U_m3[-1], rel=1e-3)


# both sides of the wall


def both_parts(seed=None, offset_m=0.0):
    """Parts of a tank hit from one set-up in it and four round it, of one instrument; all read
    three targets whose places are known.
    """
    rng = None if seed is None else np.random.default_rng(seed)
    reader, tool = Tool() if rng is None else NOISY, replace(NOISY, offset_m=offset_m)
    tool = replace(Tool(), offset_m=offset_m) if rng is None else tool
    rough = np.array([[20.0, 3.0, 1.0], [-15.0, 12.0, 2.0], [2.0, -19.0, 4.0]])
    targets, names = rough, ["A", "B", "C"]
    stations = {"I": STATION}
    for number in range(4):
        away = 13.5 * np.array([np.sin(np.pi / 2 * number), np.cos(np.pi / 2 * number)])
        stations[f"S{number}"] = np.array([*(away + FOOT), 1.6])
    rows, readings, known = [], {}, [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    for number, (name, at) in enumerate(stations.items()):
        zero, inside = 0.3 * number, name == "I"
        surface = Surface(lambda a, z, more=0 if inside else PLATE: oval(a, z) + more, FOOT, SLOPE)
        aims = even_aims(surface, LEVELS, 24)
        if not inside:
            arc = np.pi / 2 * (number - 1) + np.linspace(-0.8, 0.8, 8)
            aims = np.vstack([surface.at(arc, np.full(8, z)) for z in LEVELS])
        rows += rows_of(name, take_hits(surface, at, aims, tool, rng, zero))
        readings[name] = names, observe(at, targets, reader, rng, zero)
        known.append([f"P{name}", *at.tolist(), None, None, None])
    known += [[name, *at.tolist(), 0.0, 0.0, 0.0] for name, at in zip(names, targets, strict=True)]
    parts = hit_parts(rows)
    reflector = {"kind": "total_station", "s_mm": 1.0, "s_arcsec": 5.0}
    parts.registers["instruments"]["TS"] |= {"u_scale_ppm": 1.0}
    parts.registers["instruments"]["prism"] = reflector
    parts.tables |= network_tables(readings)
    ranges = parts.tables.pop("slope_distances")
    distances = [["from", "to", "distance_m", "s_mm", "instrument"]]
    parts.tables["distances"] = distances + [
        [f"P{a}", b, d, s, "prism"] for a, b, d, s in ranges[1:]
    ]
    parts.tables["control"] = known
    setups = [[name, f"P{name}", "TS", 0.0] for name in stations]
    parts.tables["setups"] = [["setup", "station", "instrument", "instrument_height_m"], *setups]
    return parts


@pytest.mark.slow
@pytest.mark.parametrize("side", ["inside", "outside"])
def test_one_offset_inside_and_outside(tmp_path, side):
    """Nobody knows the offset, no tape: inside it makes the tank smaller, outside larger."""
    parts = both_parts(offset_m=0.002)
    parts.settings["survey.side"] = side
    del parts.registers["instruments"]["TS"]["u_offset_mm"]
    result = run(tmp_path, parts)
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=1e-5)
    assert result.sighting.estimated_m["TS"] == pytest.approx(0.002, abs=1e-5)
    noisy = both_parts(seed=6, offset_m=0.002)
    del noisy.registers["instruments"]["TS"]["u_offset_mm"]
    found = run(tmp_path / "noisy", noisy)
    assert abs(found.table.volume_m3[-1] - volume_of(oval)) < found.table.U_m3[-1]


@pytest.mark.slow
def test_plates_between_the_sides(tmp_path):
    """1 mm less plate goes into the radius as far as the hits outside tell it, and U knows it."""
    parts = both_parts(seed=5)
    parts.registers["instruments"]["TS"]["u_offset_mm"] = 0.5
    first = run(tmp_path / "a", parts)
    assert abs(first.table.volume_m3[-1] - volume_of(oval)) < first.table.U_m3[-1]
    for row in parts.tables["courses"][1:]:
        row[2] = 7.0
    second = run(tmp_path / "b", parts)
    grown = second.table.volume_m3[-1] - first.table.volume_m3[-1]
    lines = {one.name: one for one in first.budget().lines}
    assert 0.1 < grown / (2 * 0.001 / 6.5 * first.table.volume_m3[-1]) < 0.9
    assert -lines["plate_thickness"].sensitivity == pytest.approx(grown, rel=0.02)


@pytest.mark.slow
def test_an_offset_that_both_sides_deny_is_named(tmp_path):
    parts = both_parts(seed=7, offset_m=0.004)
    result = run(tmp_path, parts)
    assert ("instruments.toml", "TS.u_offset_mm") in codes_of(result)
    assert ("instruments.toml", "TS.u_offset_mm") not in codes_of(run(tmp_path, both_parts(seed=7)))


def test_an_offset_that_one_side_cannot_tell_is_refused(tmp_path):
    parts = arc_parts()
    del parts.registers["instruments"]["TS"]["u_offset_mm"]
    assert problems_of(tmp_path, parts) == [("instruments.toml", None, "TS.u_offset_mm")]


# slips of a crew, each named


def slip_side(parts):
    parts.settings["survey.side"] = "outside"
    return ("job.toml", "survey.side")


def test_hits_from_the_other_side_are_refused(tmp_path):
    parts = parts_of()
    file, column = slip_side(parts)
    assert problems_of(tmp_path, parts) == [(file, None, column)]


@pytest.mark.slow
def test_a_wrong_strap_is_set_aside(tmp_path):
    parts = strapped(parts_of(tool=NOISY, seed=4))
    parts.registers["instruments"]["TS"]["u_offset_mm"] = 0.3
    parts.tables["circumferences"][2][3] += 0.025
    result = run(tmp_path, parts)
    assert result.straps.accepted.tolist() == [True, False]
    assert ("circumferences.csv", "reading_m") in codes_of(result)
    name, row = parts.tables["circumferences"][2][0], result.straps.reduced[1].strap.row
    line = f"  circumferences rejected: {name} (row {row})"
    assert line in [str(one) for one in describe_rejected(result, None)]


@pytest.mark.slow
def test_an_offset_of_another_reflector_is_named(tmp_path):
    parts = strapped(parts_of(tool=replace(NOISY, offset_m=0.003), seed=4))
    parts.registers["instruments"]["TS"]["u_offset_mm"] = 0.4
    result = run(tmp_path, parts)
    assert ("instruments.toml", "TS.u_offset_mm") in codes_of(result)


@pytest.mark.slow
def test_control_targets_that_moved_are_named(tmp_path):
    parts = parts_of()
    first = ["I", "K", 10.0, 80.0, 5.0, "2026-01-05T10:00"]
    parts.tables["control_readings"] = [
        ["setup", "target", "direction_deg", "zenith_deg", "distance_m", "time"],
        first,
        ["I", "K", 10.0002, 80.0, 5.0015, "2026-01-05T10:30"],
        ["I", "K", 10.0012, 80.0, 5.0028, "2026-01-05T10:40"],  # 4.3", and 2 sd of a difference
    ]
    quiet = run(tmp_path, parts)
    assert not {file for file, _ in codes_of(quiet)} & {"control_readings.csv"}
    parts.tables["control_readings"].append(["I", "K", 10.0082, 80.0, 5.006, "2026-01-05T11:00"])
    moved = codes_of(run(tmp_path, parts))
    assert ("control_readings.csv", "direction") in moved
    assert ("control_readings.csv", "distance_m") in moved


@pytest.mark.slow
def test_hits_of_another_course_are_named(tmp_path):
    parts = parts_of()
    headings, *rows = parts.tables["wall_hits"]
    names = ["2"] * 48 + ["1"] * 48 + ["3"] * 48 + ["4"] * 48
    parts.tables["wall_hits"] = [
        [*headings, "course"],
        *([*row, name] for row, name in zip(rows, names, strict=True)),
    ]
    said = [one for one in run(tmp_path, parts).warnings if one.column == "course"]
    assert [(one.file, one.row) for one in said] == [("wall_hits.csv", 2), ("wall_hits.csv", 50)]


@pytest.mark.parametrize(("column", "factor"), [("direction", 0.9), ("zenith", 1 / 0.9)])
def test_angles_in_another_unit_are_named(tmp_path, column, factor):
    """Degrees that stand as gon would be 0.9 of them, and the other way round."""
    parts = parts_of(tool=NOISY, seed=1)
    place = parts.tables["wall_hits"][0].index(f"{column}_deg")
    for row in parts.tables["wall_hits"][1:]:
        row[place] *= factor
    assert problems_of(tmp_path, parts) == [("wall_hits.csv", 2, column)]


@pytest.mark.slow
def test_straps_that_are_only_compared(tmp_path):
    parts = strapped(parts_of(tool=NOISY, seed=1))
    headings, *rows = parts.tables["circumferences"]
    checks = [[*row, "check"] for row in rows]
    parts.tables["circumferences"] = [[*headings, "use"], *checks]
    result = run(tmp_path / "a", parts)
    del parts.tables["circumferences"]
    alone = run(tmp_path / "b", parts)
    assert result.table.volume_m3[-1] == pytest.approx(alone.table.volume_m3[-1], rel=1e-5)
    from tankcal.record import record_of

    read = record_of(result)["strapping"]["readings"]
    assert [one["used"] for one in read] == [False, False]
    assert max(abs(one["difference_m"]) for one in read) < 0.01
    parts.tables["circumferences"] = [[*headings, "use"], *checks]
    del parts.registers["instruments"]["TS"]["u_offset_mm"]
    assert problems_of(tmp_path / "a", parts) == [("instruments.toml", 1, "TS.u_offset_mm")]


@pytest.mark.slow
def test_few_hits_and_levels_are_named(tmp_path):
    surface = Surface(circle, FOOT, SLOPE)
    rows = rows_of("I", take_hits(surface, STATION, even_aims(surface, (1.0, 3.0, 5.0, 7.0), 8)))
    result = run(tmp_path, hit_parts(rows))
    assert sum(one.file == "wall_hits.csv" for one in result.warnings) >= 2


# bad input: one line for each problem


def _without_offset(parts):
    del parts.registers["instruments"]["TS"]["u_offset_mm"]
    return [("instruments.toml", "TS.u_offset_mm")]


def _free_offset(parts):
    parts.registers["instruments"]["TS"]["u_offset_mm"] = "free"
    return [("instruments.toml", "TS.u_offset_mm")]


def _free_scale(parts):
    parts.registers["instruments"]["TS"]["u_scale_ppm"] = "free"
    return [("instruments.toml", "TS.u_scale_ppm")]


def _without_sds(parts):
    del parts.registers["instruments"]["TS"]["s_mm"]
    del parts.registers["instruments"]["TS"]["s_arcsec"]
    return [("instruments.toml", "TS.s_arcsec"), ("instruments.toml", "TS.s_mm")]


def _unknown_setup(parts):
    parts.tables["wall_hits"][4][0] = "X"
    return [("wall_hits.csv", "setup")]


def _no_setups(parts):
    del parts.tables["setups"]
    return [("setups.csv", None)]


def _no_instruments(parts):
    parts.registers = {}
    return [("instruments.toml", None)]


def _tape_as_instrument(parts):
    parts.registers["instruments"]["TS"]["kind"] = "tape"
    return [("setups.csv", "instrument")]


def _unknown_course(parts):
    headings, *rows = parts.tables["wall_hits"]
    rows = [[*row, "9" if i == 3 else None] for i, row in enumerate(rows)]
    parts.tables["wall_hits"] = [[*headings, "course"], *rows]
    return [("wall_hits.csv", "course")]


def _no_direction(parts):
    parts.tables["wall_hits"][5][1] = None
    return [("wall_hits.csv", "direction_deg")]


def _all_compared(parts):
    headings, *rows = parts.tables["wall_hits"]
    parts.tables["wall_hits"] = [[*headings, "use"], *([*row, "check"] for row in rows)]
    return [("wall_hits.csv", None)]


def _second_face(parts):
    parts.tables["wall_hits"][5][2] = 268.0
    return [("wall_hits.csv", "zenith_deg")]


def _no_angle_column(parts):
    parts.tables["wall_hits"] = [
        [cell for i, cell in enumerate(row) if i != 2] for row in parts.tables["wall_hits"]
    ]
    return [("wall_hits.csv", "zenith_deg")]


def _points_too(parts):
    aims = even_aims(Surface(oval, FOOT, SLOPE), LEVELS, 12)
    points = [[f"P{i}", *map(float, xyz)] for i, xyz in enumerate(aims)]
    parts.tables["points"] = [["point", "x_m", "y_m", "z_m"], *points]
    return [("points.csv", None)]


def _untied_in_sets(parts):
    headings, *rows = parts.tables["wall_hits"]
    parts.tables["setups"].append(["II", "SII", 1.5])
    rows = [["II" if i < 50 else "I", *row[1:], "ab"[i % 2]] for i, row in enumerate(rows)]
    parts.tables["wall_hits"] = [[*headings, "set"], *rows]
    return [("setups.csv", "setup"), ("setups.csv", "setup")]


def _strap_without_thickness(parts):
    strapped(parts)
    del parts.registers["instruments"]["T"]["thickness_mm"]
    return [("instruments.toml", "T.thickness_mm")]


def _empty_beside_straps(parts):
    strapped(parts)
    parts.tables["wall_hits"] = []
    return [("wall_hits.csv", None)]


BAD = [one for name, one in list(globals().items()) if name.startswith("_") and callable(one)]


@pytest.mark.parametrize("spoil", BAD, ids=lambda one: one.__name__.strip("_"))
def test_bad_input_is_one_line_each(tmp_path, spoil):
    parts = parts_of(levels=(1.0, 3.0, 5.0, 7.0))
    wanted = spoil(parts)
    found = problems_of(tmp_path, parts)
    assert sorted((file, column or "") for file, _, column in found) == sorted(
        (file, column or "") for file, column in wanted
    )
