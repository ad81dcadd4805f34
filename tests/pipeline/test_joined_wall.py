"""A wall by points or hits, straps and reference lines in one job.

Truth: exact geometry of a leaning oval tank; all readings in one dense adjustment, in which the
wall, the lines and what readings share are unknowns of their own.
"""

from dataclasses import replace

import numpy as np
import pytest
import test_tangent_wall as of_tangents
from generated_hits import Surface, even_aims
from job_builder import write_folder
from test_hit_wall import (
    FOOT,
    LEVELS,
    NOISY,
    SLOPE,
    TAPE,
    circle,
    girth_of,
    oval,
    parts_of,
    problems_of,
    run,
    strapped,
    volume_of,
)

import tankcal
from tankcal.geometry.field.likelihood import LEAST_NOISE_M
from tankcal.geometry.field.sites import Covariances
from tankcal.methods.lines.warnings import check_leans, compare_leans, levels_and_lean
from tankcal.units import ARCSEC

KAPPA, COUNT = 15 * ARCSEC, 12


def plumbed(parts, radius=oval, sd_m=0.0, seed=2, *, inside=False, levels=LEVELS, outer=None):
    """The parts with offsets from lines that stand upright, read on both faces along rays.

    outer  `Surface` outside; None: plates outside of the radius about the foot
    """
    rng = np.random.default_rng(seed)
    surface = outer or Surface(radius, FOOT, SLOPE)
    turn = 2 * np.pi * np.arange(COUNT) / COUNT
    ray = np.column_stack([np.sin(turn), np.cos(turn)])
    start = np.array(surface.foot_m) + levels[0] * np.array(surface.slope)
    constants = rng.uniform(0.1, 0.3, COUNT)
    rows = [["line", "course", "level_m", "offset_mm", "s_mm", "face"]]
    for z in levels:
        plate = parts.tables["courses"][int(z // 2) + 1][2] / 1000
        more = plate * (not inside and outer is None)
        away = [_distance(surface, start, one, z) + more for one in ray]
        for face, lean in ((1, KAPPA), (2, -KAPPA)):
            size = np.array(away) - 6.5 - (z - levels[0]) * lean
            read = constants + size * (1 if inside else -1) + sd_m * rng.normal(size=COUNT)
            rows += [
                [f"L{i}", str(int(z // 2) + 1), z, 1000 * float(one), 0.5, face]
                for i, one in enumerate(read)
            ]
    parts.tables["offsets"] = rows
    side = "inside" if inside else "outside"
    parts.tables["lines"] = [["line", "instrument", "side"]] + [
        [f"L{i}", "ZL", side] for i in range(COUNT)
    ]
    parts.registers["instruments"]["ZL"] = {"kind": "plummet", "u_scale_ppm": 100.0}
    return parts


def _distance(surface, start, ray, z):
    """From a place along a ray to the wall at a height, by bisection."""
    low, high = 5.0, 8.0
    for _ in range(60):
        middle = (low + high) / 2
        out = surface.beyond(np.array([[*(start + middle * ray), z]]))[0] > 0
        low, high = (low, middle) if out else (middle, high)
    return (low + high) / 2


def as_points(parts, sd_mm=(1.0, 0.7, 0.5), seed=4):
    """The parts with named points of the same inside wall in place of its hits."""
    del parts.tables["wall_hits"], parts.tables["setups"], parts.registers["instruments"]["TS"]
    aims = even_aims(Surface(oval, FOOT, SLOPE), LEVELS, 12, turn=0.1)
    aims = aims + np.array(sd_mm) / 1000 * np.random.default_rng(seed).normal(size=aims.shape)
    points = [[f"P{i}", *map(float, xyz), *sd_mm] for i, xyz in enumerate(aims)]
    headings = ["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]
    parts.tables["points"] = [headings, *points]
    return parts


@pytest.mark.slow
@pytest.mark.parametrize("inside", [False, True])
def test_lines_beside_hits_agree_on_an_exact_wall(tmp_path, inside):
    """Exact geometry, on either side: nothing is rejected, and the plummet's lean comes out."""
    parts = parts_of()
    for row, plate in zip(parts.tables["courses"][1:], (8.0, 7.0, 5.0, 4.0), strict=True):
        row[2] = plate
    result = run(tmp_path, plumbed(parts, inside=inside))
    assert result.straps is None  # hits tell the radius that the lines carry
    assert "offsets" in {one.kind for one in result.table.sources}
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=3e-6)
    assert result.read.tested.accepted.all()
    assert np.abs(result.read.tested.departure_m).max() < 2e-4
    assert result.read.collimations["ZL"][0] == pytest.approx(KAPPA, rel=1e-3)


@pytest.mark.slow
def test_lines_show_a_course_that_hits_saw_at_one_level(tmp_path):
    """U is less with them, and a taper that no hit saw comes out: courses narrow and widen in turn,
    so none tells of another.
    """

    def cone(azimuth, z):
        return 6.5 + 0.002 * (np.abs(z % 4 - 2) - 1) + 0 * azimuth

    levels = tuple(one for i, one in enumerate(LEVELS) if i != 7)
    bare = run(tmp_path / "bare", parts_of(cone, tool=NOISY, seed=1, levels=levels))
    both = run(
        tmp_path / "both",
        plumbed(parts_of(cone, tool=NOISY, seed=1, levels=levels), cone, sd_m=5e-4),
    )
    assert both.delivery(6.0, 8.0).u_m3 < 0.8 * bare.delivery(6.0, 8.0).u_m3
    assert abs(both.table.volume_m3[-1] - volume_of(cone)) < both.table.U_m3[-1]


@pytest.mark.slow
def test_a_misread_offset_beside_hits_is_named(tmp_path):
    parts = plumbed(parts_of(tool=NOISY, seed=1), sd_m=5e-4)
    parts.tables["offsets"][40][3] += 30.0
    result = run(tmp_path, parts)
    assert np.flatnonzero(~result.read.tested.accepted).tolist() == [39]
    assert ("offsets.csv", "offset_mm") in {(one.file, one.column) for one in result.warnings}


@pytest.mark.slow
def test_a_line_read_once_is_controlled_by_nothing(tmp_path):
    """Its constant takes the reading up: it is neither tested nor rejected."""
    parts = plumbed(parts_of(circle, tool=NOISY, seed=1), circle, levels=LEVELS[:1])
    parts.tables["offsets"] = [
        row for row in parts.tables["offsets"] if row[0] == "line" or row[5] == 1
    ]
    parts.registers["instruments"]["ZL"]["u_collimation_arcsec"] = 5.0
    read = run(tmp_path, parts).read
    assert read.tested.accepted.all()
    assert np.isinf(read.tested.sd_m).all()


def one_ring(parts, level=LEVELS[0]):
    """The parts with points of one level alone."""
    points = parts.tables["points"]
    parts.tables["points"] = [points[0], *(row for row in points[1:] if abs(row[3] - level) < 0.1)]
    return parts


def strapped_above(parts, radius=oval):
    """The parts with two straps of each course but the first."""
    rows = [
        [f"{z}", str(int(z // 2) + 1), z, girth_of(radius, z) + np.pi * TAPE, 0.5, "T"]
        for z in LEVELS[2:]
    ]
    parts = strapped(parts, radius)
    parts.tables["circumferences"][1:] = rows
    return parts


@pytest.mark.slow
@pytest.mark.parametrize("tell", [plumbed, strapped_above])
def test_one_ring_of_points_serves_where_lines_or_straps_tell_the_rest(tmp_path, tell):
    """Exact geometry: the ring tells the radius, lines or straps all other courses."""
    result = run(tmp_path, one_ring(as_points(tell(parts_of()), sd_mm=(1e-3, 1e-3, 1e-3))))
    assert len(result.wall.sections) == 1
    assert abs(result.table.volume_m3[-1] - volume_of(oval)) < result.table.U_m3[-1]
    rel = 2e-5 if tell is plumbed else 2e-4  # the area term of waves between 12 points
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=rel)


@pytest.mark.slow
def test_a_lean_that_lines_show_is_no_part_of_an_outline(tmp_path, monkeypatch):
    """Exact geometry: a shell that leans by 2 % has horizontal cuts as large as an upright one."""
    monkeypatch.setitem(globals(), "SLOPE", (0.02, 0.0))
    result = run(tmp_path, one_ring(as_points(plumbed(parts_of()), sd_mm=(1e-3, 1e-3, 1e-3))))
    assert result.table.volume_m3[-1] == pytest.approx(volume_of(oval), rel=2e-5)


def test_courses_that_no_line_carries_a_radius_to_are_refused(tmp_path):
    """Lines on courses of which no points and no tape tell one carry nothing."""
    parts = one_ring(as_points(plumbed(parts_of(), levels=LEVELS[2:])))
    assert {one[0] for one in problems_of(tmp_path, parts)} == {"courses.csv"}


@pytest.mark.slow
def test_the_lean_of_lines_is_that_of_the_points(tmp_path):
    """Exact geometry: both are the slope of the shell."""
    result = run(tmp_path, plumbed(parts_of()))
    test = compare_leans(levels_and_lean(result.job, result.read)[1], result.wall.shell)
    np.testing.assert_allclose([test.of_lines, test.of_points], [SLOPE, SLOPE], atol=5e-5)
    assert test.w < 1
    assert not list(check_leans(result.job, result.wall))


@pytest.mark.slow
@pytest.mark.parametrize(("azimuth", "cause"), [
    (lambda i: -30 * i % 360, "leans_mirrored"), (lambda i: 30 * (i + 2) % 360, "leans_turned"),
])  # fmt: skip
def test_azimuths_of_lines_in_another_frame_are_named(tmp_path, azimuth, cause):
    """Planted: lines numbered anticlockwise, or counted from another zero."""
    parts = plumbed(as_points(parts_of()), sd_m=3e-4)
    lines = parts.tables["lines"]
    parts.tables["lines"] = [
        [*lines[0], "azimuth_deg"], *([*row, azimuth(i)] for i, row in enumerate(lines[1:]))
    ]  # fmt: skip
    result = run(tmp_path, parts)
    (told,) = check_leans(result.job, result.wall)
    assert told.text.values["text"].values["cause"].code == cause
    assert str(told) in map(str, result.warnings)


@pytest.mark.slow
def test_lines_beside_tangents_agree_on_an_exact_wall(tmp_path):
    """Exact geometry: sights that touch, offsets along rays; a level that tangents alone saw, and
    courses that lines alone saw.
    """
    outer = Surface(of_tangents.oval, of_tangents.FOOT, of_tangents.SLOPE)
    rows = of_tangents.sights(of_tangents.oval, of_tangents.Circle(), levels=LEVELS[:4])
    parts = plumbed(of_tangents.parts_of(rows, seed=None), outer=outer)
    result = run(tmp_path, parts)
    assert result.read.tested.accepted.all()
    assert result.read.collimations["ZL"][0] == pytest.approx(KAPPA, rel=2e-2)
    assert {one.group.course for one in result.wall.sections} == {0, 1}
    truth = of_tangents.inside_of(of_tangents.oval)
    assert result.table.volume_m3[-1] == pytest.approx(truth, rel=3e-5)
    assert abs(result.table.volume_m3[-1] - truth) < result.table.U_m3[-1]


def dense(result):
    """(values, covariance, size) of a joined wall by one adjustment of everything.

    Unknowns: radii of courses, centres of rings and levels, constants of lines, collimation; then,
    with a prior, the departures of the wall at every site and what readings share.
    """
    wall, job = result.wall, result.job
    n, field = len(wall.field.radius_m) - len(wall.readings), wall.field
    jacobian = wall.radii_by_points[:n]
    of_points = wall.covariance_m2.propagate(jacobian)
    sites, offsets = field.sites, job.lines.offsets
    straps = [one for one in wall.readings if one.of == "straps"]
    k = len(straps)
    levels = sorted({one.level_m for one in offsets})
    courses, rings = 4, int(sites.ring[:n].max()) + 1
    names = sorted({one.line for one in offsets})
    columns = courses + 2 * rings + 2 * (len(levels) - 1) + len(names) + 1
    total = n + k + len(offsets)
    design = np.zeros((total, columns))
    design[np.arange(total), sites.course] = 1.0
    turn = np.stack([np.sin(sites.azimuth_rad), np.cos(sites.azimuth_rad)], axis=1)
    for i in range(n):
        design[i, courses + 2 * sites.ring[i] : courses + 2 * sites.ring[i] + 2] = turn[i]
    first = courses + 2 * rings
    y = np.concatenate(
        [field.radius_m[:n], [one.radius_m for one in straps], np.zeros(len(offsets))]
    )
    shared = {}
    for i, one in enumerate(straps):
        for key, (_, _, by_m) in one.effects.items():
            shared.setdefault(key, np.zeros(total))[n + i] = by_m
    shared["scale"] = np.zeros(total)
    at_level = {level: place - 1 for place, level in enumerate(levels)}
    inner = np.array([one.thickness_m + one.paint_m for one in job.courses])
    for i, one in enumerate(offsets, start=n + k):
        y[i] = -one.offset_m - inner[sites.course[i]]
        place = at_level[one.level_m]
        if place >= 0:
            design[i, first + 2 * place : first + 2 * place + 2] = turn[i]
        design[i, first + 2 * (len(levels) - 1) + names.index(one.line)] = 1.0
        rise = one.level_m - levels[0]
        design[i, -1] = -rise if one.face == 1 else rise
        shared["scale"][i] = -one.offset_m * 1e-4
    for name in ("plate_thickness", "paint"):
        u = next((one.u for one in job.inputs if one.name == name), 0.0)
        shared[name] = np.concatenate([np.zeros(n), np.full(total - n, -u)])
    own = np.concatenate([[one.sd_m for one in straps], [one.sd_m for one in offsets]])
    noise = np.zeros((total, total))
    noise[:n, :n], noise[n:, n:] = of_points, np.diag(own**2)
    noise += LEAST_NOISE_M**2 * np.eye(total)
    values, vectors = np.linalg.eigh(
        Covariances(sites, field.nominal_m).total(field.amplitudes.variances_m2)
    )
    wavy = vectors * np.sqrt(np.maximum(values, 0.0))
    weighted = np.column_stack([wavy, *shared.values()])
    left = np.linalg.inv(np.linalg.cholesky(noise))
    whole = np.block(
        [
            [left @ design, left @ weighted],
            [np.zeros((weighted.shape[1], columns)), np.eye(weighted.shape[1])],
        ]
    )
    zeros = np.zeros(weighted.shape[1])
    found = np.linalg.lstsq(whole, np.append(left @ (y - 6.5), zeros), rcond=None)[0]
    for i, one in enumerate(offsets, start=n + k):  # read along rays from the first level's centre
        place = at_level[one.level_m]
        if place >= 0:
            x, north = found[first + 2 * place : first + 2 * place + 2]
            y[i] += (x * turn[i, 1] - north * turn[i, 0]) ** 2 / 2 / field.nominal_m
    found = np.linalg.lstsq(whole, np.append(left @ (y - 6.5), zeros), rcond=None)[0]
    root = np.linalg.inv(np.linalg.qr(whole)[1])
    return found, root @ root.T, columns


@pytest.mark.slow
@pytest.mark.parametrize("seen", [lambda parts: parts, one_ring])
def test_points_straps_and_offsets_are_one_dense_adjustment(tmp_path, seen):
    """Second method: estimates and covariances to 1e-9, linearised at the same place."""
    parts = plumbed(seen(as_points(strapped(parts_of()))), sd_m=5e-4)
    job = tankcal.load(write_folder(tmp_path, parts))
    job = replace(job, snooping=False)
    result = tankcal.run(job, simulated=False)
    found, covariance, columns = dense(result)
    field = result.wall.field
    means = np.array([field.radius_m[field.sites.course == c].mean() for c in range(4)])
    starts = field._columns[1]
    radii = field._solution[0][starts] + means
    np.testing.assert_allclose(radii, 6.5 + found[:4], rtol=1e-9)
    normal = field._columns[0].T @ np.linalg.solve(field.covariance_m2, field._columns[0])
    ours = np.linalg.inv(normal)[np.ix_(starts, starts)]
    np.testing.assert_allclose(ours, covariance[:4, :4], rtol=1e-9)
    kappa, u = result.read.collimations["ZL"]
    assert kappa == pytest.approx(found[columns - 1], rel=1e-7)
    assert u == pytest.approx(np.sqrt(covariance[columns - 1, columns - 1]), rel=1e-9)
    assert kappa == pytest.approx(KAPPA, abs=3 * u)
