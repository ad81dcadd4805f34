"""Millions of points into rings: exact shapes, and a plain loop with masks as second method."""

import tracemalloc
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import azimuths, modes, ring, section_of

from tankcal.errors import InputError
from tankcal.geometry.circles import fit_circle
from tankcal.geometry.rings import Axis, ring_sections

AXIS = Axis(0.0, 0.0, 6.5)


def wall(rng, count, noise=0.002, height=9.5, centre=(0.0, 0.0)):
    """Points of a noisy cylinder of radius 6.5 m."""
    xyz = ring(6.5 + rng.normal(0, noise, count), rng.uniform(0, 2 * np.pi, count), centre)
    return np.column_stack([xyz[:, :2], rng.uniform(0, height, count)])


def by_masks(xyz, edges, axis, cells):
    """The same by a mask for every ring and cell, Taubin's circle by singular values."""
    rows = []
    for index, (low, high) in enumerate(pairwise(edges)):
        mask = (xyz[:, 2] >= low) & (xyz[:, 2] < high)
        if index == len(edges) - 2:
            mask |= xyz[:, 2] == high
        own = xyz[mask]
        x, y = axis.at(own[:, 2])
        offset = own[:, :2] - np.column_stack([x, y])
        mean = offset.mean(axis=0)
        local = offset - mean
        z = np.sum(local**2, axis=1)
        design = np.column_stack([(z - z.mean()) / (2 * np.sqrt(z.mean())), local])
        values, vectors = np.linalg.svd(design, full_matrices=False)[1:]
        a = vectors[2, 0] / (2 * np.sqrt(z.mean()))
        centre = -vectors[2, 1:] / (2 * a)
        sd = values[2] / np.sqrt(len(own) - 3)
        circle = [*(centre + mean), np.sqrt(centre @ centre + z.mean()), sd]
        turn = np.arctan2(offset[:, 0], offset[:, 1]) % (2 * np.pi) * cells / (2 * np.pi)
        distance, sums = np.hypot(offset[:, 0], offset[:, 1]), []
        for cell in range(cells):
            here = np.floor(turn) == cell
            sums.append([here.sum(), distance[here].mean(), distance[here].std(ddof=1)])
        rows.append((len(own), own[:, 2].mean(), circle, np.array(sums)))
    return rows


def test_agrees_with_a_loop_of_masks_second_method():
    rng = np.random.default_rng(1)
    axis = Axis(0.02, -0.03, 6.51, 4.0, (0.004, -0.003))
    xyz = wall(rng, 40_000, 0.004)
    edges = np.sort(np.append(rng.uniform(0, 9.5, 9), [0.0, 9.5]))
    found = ring_sections(xyz, edges, axis, cells=24)
    for i, (count, z, circle, cells) in enumerate(by_masks(xyz, edges, axis, 24)):
        assert found.count[i] == count
        assert found.z_m[i] == pytest.approx(z, rel=1e-12)
        x, y = axis.at(z)
        own = [found.x_m[i] - x, found.y_m[i] - y, found.radius_m[i], found.residual_sd_m[i]]
        assert own == pytest.approx(circle, abs=1e-11)
        assert np.array_equal(found.cell_count[i], cells[:, 0])
        assert found.cell_radius_m[i] == pytest.approx(cells[:, 1], rel=1e-12)
        assert found.cell_sd_m[i] == pytest.approx(cells[:, 2], rel=1e-9)


def test_exact_circles_of_leaning_wall_with_poor_start():
    """Closed form: radius and centre of every ring, at UTM-size coordinates, axis 0.1 m off."""
    slope, base = np.array([0.01, -0.02]), np.array([300_000.0, 7_400_000.0])
    rng = np.random.default_rng(2)
    z = rng.uniform(0, 10, 50_000)
    xy = ring(6.5, rng.uniform(0, 2 * np.pi, len(z)))[:, :2] + base + z[:, None] * slope
    axis = Axis(base[0] + 0.1, base[1] - 0.1, 6.45, 0.0, tuple(slope))
    found = ring_sections(np.column_stack([xy, z]), np.linspace(0, 10, 11), axis)
    assert found.radius_m == pytest.approx(np.full(10, 6.5), abs=1e-9)
    assert found.x_m - base[0] == pytest.approx(slope[0] * found.z_m, abs=2e-9)
    assert found.y_m - base[1] == pytest.approx(slope[1] * found.z_m, abs=2e-9)
    assert np.all(found.residual_sd_m < 1e-8 * 6.5)  # the root of rounding


def test_the_geometric_circle_second_method(figure):
    """Gauss-Helmert; the radii differ by s^2 / (2 R), 0.0094 sds of the radius here."""
    rng = np.random.default_rng(3)
    xyz = wall(rng, 600, 0.005, centre=(0.05, 0.02))
    found = ring_sections(xyz, [0.0, 9.5], AXIS)
    circle = fit_circle(xyz[:, :2], np.eye(2 * len(xyz)))
    sd = 0.005 / np.sqrt(len(xyz))
    differences = np.array([found.x_m[0], found.y_m[0], found.radius_m[0]]) - (
        circle.x_m,
        circle.y_m,
        circle.radius_m,
    )
    figure("Taubin against geometric circle, in sds of the radius", f"{differences / sd}")
    assert np.all(np.abs(differences[:2]) < 0.01 * sd)
    assert differences[2] == pytest.approx(0.005**2 / (2 * 6.5), rel=0.1)
    assert found.residual_sd_m[0] == pytest.approx(np.sqrt(circle.variance_factor), rel=1e-4)


def test_an_arc_with_noise_has_no_bias_of_kasas_kind(figure):
    """Simulation: 60 deg of the turn, noise 10 mm; Kasa's mean radius is 9 mm too short."""
    rng = np.random.default_rng(4)
    rings, each = 400, 200
    azimuth = rng.uniform(0, np.pi / 3, rings * each)
    xyz = ring(6.5 + rng.normal(0, 0.01, rings * each), azimuth)
    xyz[:, 2] = np.repeat(np.arange(rings), each) + 0.5
    found = ring_sections(xyz, np.arange(rings + 1.0), AXIS)
    kasa = []
    for part in xyz[:, :2].reshape(rings, each, 2):
        design = np.column_stack([2 * part, np.ones(each)])
        x, y, c = np.linalg.lstsq(design, np.sum(part**2, axis=1), rcond=None)[0]
        kasa.append(np.sqrt(c + x * x + y * y))
    standard_error = found.radius_m.std() / np.sqrt(rings)
    bias, of_kasa = found.radius_m.mean() - 6.5, np.mean(kasa) - 6.5
    figure(
        "bias of the radius on an arc of 60 deg, mm", f"{1e3 * bias:.3f}, Kasa {1e3 * of_kasa:.3f}"
    )
    assert abs(bias) < 3 * standard_error
    assert abs(of_kasa) > 5 * standard_error


def test_radius_bias_by_coarse_noise():
    """Simulation: isotropic noise of R/20 on a whole turn, s^2 / R = 2.5e-3 (the docstring)."""
    rng = np.random.default_rng(5)
    xyz = ring(1.0, rng.uniform(0, 2 * np.pi, 400_000))
    xyz[:, :2] += rng.normal(0, 0.05, (400_000, 2))
    found = ring_sections(xyz, [-1.0, 1.0], Axis(0.0, 0.0, 1.0))
    assert found.radius_m[0] - 1.0 == pytest.approx(0.05**2, abs=4 * 0.05 / np.sqrt(400_000))


@pytest.mark.parametrize("chunk", [1, 7, 1000, 1 << 20])
def test_the_size_of_the_chunks_does_not_matter(chunk):
    xyz = wall(np.random.default_rng(6), 3000)
    edges = np.linspace(0, 9.5, 6)
    whole = ring_sections(xyz, edges, AXIS, cells=12)
    _assert_same(ring_sections(xyz, edges, AXIS, cells=12, chunk=chunk), whole)


def test_arrays_memmaps_and_iterables_are_the_same(tmp_path):
    xyz = wall(np.random.default_rng(7), 5000)
    edges = np.linspace(0, 9.5, 6)
    whole = ring_sections(xyz, edges, AXIS)
    np.save(tmp_path / "points.npy", xyz)
    memmap = np.load(tmp_path / "points.npy", mmap_mode="r")
    for points in (memmap, iter(np.array_split(xyz, 7)), np.asfortranarray(xyz)):
        _assert_same(ring_sections(points, edges, AXIS), whole)
    single = xyz.astype(np.float32)
    exact = ring_sections(single.astype(float), edges, AXIS)
    _assert_same(ring_sections(single, edges, AXIS), exact)
    assert exact.radius_m == pytest.approx(whole.radius_m, abs=1e-6)


def _assert_same(found, expected):
    for name in ("count", "cell_count", "beyond", "outside", "edges_m"):
        assert np.array_equal(getattr(found, name), getattr(expected, name))
    for name in ("x_m", "y_m", "z_m", "radius_m", "residual_sd_m", "cell_azimuth_rad"):
        assert getattr(found, name) == pytest.approx(
            getattr(expected, name), abs=1e-12, nan_ok=True
        )
    for name in ("cell_radius_m", "cell_sd_m"):
        assert getattr(found, name) == pytest.approx(
            getattr(expected, name), abs=1e-12, nan_ok=True
        )


@pytest.mark.slow
@settings(max_examples=200)
@given(
    edges=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=12, unique=True),
    heights=st.lists(st.floats(-1.1e3, 1.1e3), min_size=1, max_size=40),
    picks=st.lists(st.integers(0, 11), max_size=12),
)
def test_every_height_falls_in_the_ring_of_numpys_histogram(edges, heights, picks):
    """Second method: numpy.histogram, whose last bin holds its upper edge too."""
    edges = np.sort(edges)
    z = np.array(heights + [edges[i % len(edges)] for i in picks])
    xyz = ring(6.5, np.linspace(0, 6, len(z)))
    xyz[:, 2] = z
    found = ring_sections(xyz, edges, AXIS, cells=3)
    assert np.array_equal(found.count, np.histogram(z, edges)[0])
    assert found.count.sum() + found.outside == len(z)


def test_a_cell_begins_at_its_lower_azimuth():
    """Closed form: 8 points on the borders of 8 cells, clockwise from +y."""
    xyz = ring(6.5, azimuths(8) + 1e-12)
    found = ring_sections(xyz, [-1.0, 1.0], AXIS, cells=8)
    assert np.array_equal(found.cell_count[0], np.ones(8))
    assert found.cell_azimuth_rad[0] == pytest.approx(azimuths(8), abs=1e-11)
    assert np.all(np.isnan(found.cell_sd_m))
    before_north = ring_sections([[[-1e-300, 6.5, 0.0]]], [-1.0, 1.0], AXIS, cells=8)
    assert before_north.cell_count[0].sum() == 1


def test_clutter_is_counted_and_left_out():
    rng = np.random.default_rng(8)
    sound = wall(rng, 20_000)
    pipe = ring(7.0, rng.uniform(0, 0.1, 500), z=3.5)
    above = ring(6.5, rng.uniform(0, 6, 100), z=9.6)
    edges = np.linspace(0, 9.5, 11)
    found = ring_sections(np.vstack([sound, pipe, above]), edges, AXIS, band_m=0.05)
    _assert_same(
        found,
        replace(ring_sections(sound, edges, AXIS), outside=100, beyond=500 * (np.arange(10) == 3)),
    )


def test_rings_without_enough_points_are_reported():
    line = np.column_stack([np.linspace(-1, 1, 9), np.full(9, 3.0), np.full(9, 2.5)])
    twice = np.repeat(ring(6.5, azimuths(2), z=3.5), 4, axis=0)
    one = np.repeat(ring(6.5, azimuths(1), z=4.5), 5, axis=0)
    pair, three = ring(6.5, azimuths(2), z=1.5), ring(6.5, azimuths(3), (0.1, 0), z=5.5)
    points = np.vstack([line, twice, one, pair, three])
    found = ring_sections(points, np.arange(7.0), AXIS)
    assert found.empty.tolist() == [0]
    assert found.undetermined.tolist() == [0, 1, 2, 3, 4]
    assert found.count.tolist() == [0, 2, 9, 8, 5, 3]
    assert np.isnan(found.z_m[0])
    assert np.isnan(found.residual_sd_m[5])
    assert (found.x_m[5], found.radius_m[5]) == pytest.approx((0.1, 6.5), abs=1e-12)
    no_points = ring_sections(np.empty((0, 3)), [0.0, 1.0], AXIS)
    assert no_points.empty.tolist() == [0]
    assert no_points.section_points(0)[0].shape == (0, 3)


def test_cells_are_points_of_a_section(figure):
    """Area of 6.5 m with modes 2 and 3, closed form; the cells damp mode k by 1 - (k d)^2 / 24."""
    outline, area = modes(6.5, 2, np.array([0.02, 0.005]), np.array([-0.01, 0.01]))
    rng = np.random.default_rng(9)
    azimuth = np.concatenate([rng.uniform(0, 2 * np.pi, 15_000), rng.uniform(0, 1, 15_000)])
    xyz = ring(lambda a: outline(a) + rng.normal(0, 0.002, len(a)), azimuth, z=1.2)
    found = ring_sections(xyz, [1.0, 1.4], Axis(0.01, -0.01, 6.5), cells=72)
    points, sd = found.section_points(0)
    assert len(points) == 72
    assert np.median(sd) == pytest.approx(0.002 / np.sqrt(15_000 / 72), rel=0.1)
    section = section_of(points, z=1.2)
    assert section.outline.kind == "interpolated"
    sd_of_area = 6.5 * 2 * np.pi / 72 * np.sqrt(np.sum(sd**2))
    figure("area from cells, off by (ppm)", f"{1e6 * (section.outline.area_m2() / area - 1):.2f}")
    assert section.outline.area_m2() == pytest.approx(area, abs=3 * sd_of_area)
    few, _ = found.section_points(0, fewest=1000)
    assert len(few) < 15


def test_memory_does_not_grow_with_the_points():
    """Property: two million points in chunks keep the sums of 950 rings, not the points."""
    rng = np.random.default_rng(10)
    block = wall(rng, 100_000)

    def peak(blocks):
        tracemalloc.start()
        ring_sections((block for _ in range(blocks)), np.linspace(0, 9.5, 951), AXIS)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    assert peak(20) < 1.02 * peak(2)


@pytest.mark.parametrize(
    ("points", "edges", "axis", "options", "expected"),
    [
        ([[0, 6.5, 1], [np.nan, 1, 2]], [0, 5], AXIS, {}, r"point 2 is \(nan, 1.0, 2.0\)"),
        ([[0, 6.5, 1], [1, np.inf, 2]], [0, 5], AXIS, {}, "point 2 is"),
        ([[0, 6.5, np.nan]], [0, 5], AXIS, {}, "expected finite numbers"),
        ([[np.inf, -np.inf, 1]], [0, 5], AXIS, {}, "expected finite numbers"),
        ([[0, 6.5]], [0, 5], AXIS, {}, r"expected numbers of shape \(n, 3\)"),
        ([["a", "b", "c"]], [0, 5], AXIS, {}, "expected numbers"),
        ([[0, 6.5, 1]], [0, 5, 5], AXIS, {}, "expected ascending heights"),
        ([[0, 6.5, 1]], [0], AXIS, {}, "expected two heights"),
        ([[0, 6.5, 1]], [0, np.nan], AXIS, {}, "expected two heights"),
        ([[0, 6.5, 1]], [0, 5], Axis(0, 0, 0), {}, "expected finite numbers and a radius above 0"),
        ([[0, 6.5, 1]], [0, 5], Axis(np.nan, 0, 6), {}, "expected finite numbers"),
        ([[0, 6.5, 1]], [0, 5], AXIS, {"cells": 0}, "expected 1 or more"),
        ([[0, 6.5, 1]], [0, 5], AXIS, {"band_m": np.nan}, "expected a width above 0"),
        (np.float32([[3e5, 7.4e6, 1]]), [0, 5], AXIS, {}, "float32 holds 7400000 m to 0.5 m only"),
    ],
)
def test_unusable_input_is_reported(points, edges, axis, options, expected):
    with pytest.raises(InputError, match=expected) as error:
        ring_sections(np.asarray(points), edges, axis, **options)
    assert len(str(error.value).splitlines()) == 1
