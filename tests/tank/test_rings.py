"""Lying cylinders of rings: published figures, today's cylinder, another program, quadrature."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import trimesh
from jacobians import assert_derivative

from tankcal.errors import HeightError, SolutionError
from tankcal.tank.heads import End
from tankcal.tank.lying import WAVES, RingedTank
from tankcal.tank.solids import LyingTank

LAPPED = RingedTank((1.200, 1.192, 1.200), (3.0, 3.0, 3.0), tilt=0.010, dip_from_a_m=1.5)
ENDS = {"end_a": End("torispherical", dish_radius_m=2.4, knuckle_radius_m=0.24),
        "end_b": End("ellipsoidal", 0.6)}  # fmt: skip
UNLIKE = RingedTank(
    (1.2, 1.17, 1.21), (2.0, 3.0, 2.5), **ENDS, tilt=-0.02, dip_from_a_m=5.5
)  # the dip in the last ring


@pytest.mark.parametrize(
    ("tank", "litres", "capacity"),
    [
        (LAPPED, [2.274, 2486.907, 19622.296, 38572.999, 40420.540], 40534.688),
        (
            replace(LAPPED, radii_m=(1.192, 1.200, 1.192)),
            [2.266, 2556.518, 19705.508, 38527.731, 40275.885],
            40354.336,
        ),
        (
            replace(LAPPED, radii_m=(1.2, 1.2, 1.2)),
            [2.274, 2525.939, 19711.035, 38717.495, 40589.121],
            40715.041,
        ),
        (
            replace(LAPPED, tilt=0.0),
            [0.0, 2896.188, 20267.344, 38947.460, 40534.688],
            40534.688,
        ),
    ],
    ids=["lapped", "wrong order", "equal", "level"],
)
def test_volumes_of_three_rings(tank, litres, capacity):
    """Truth: the table of the specification, by quadrature of its own, to 0.01 L."""
    found = 1000 * tank.volume_m3([0.0, 0.3, 1.2, 2.2, 2.4])
    assert found == pytest.approx(litres, abs=0.01)
    assert 1000 * tank.capacity_m3 == pytest.approx(capacity, abs=0.01)


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("direction", ["plumb", "square"])
@pytest.mark.parametrize("tilt", [0.0, 0.013, -0.04])
def test_equal_rings_are_one_cylinder(tilt, direction):
    """Truth: `LyingTank`, proven for itself: volumes, surfaces and derivatives, to 1e-9."""
    one = LyingTank(2.4, 2.4, 8.0, **ENDS, tilt=tilt, dip_from_a_m=3.0, dip_direction=direction)
    rings = RingedTank(
        (1.2,) * 3, (3.0, 1.5, 3.5), **ENDS, tilt=tilt, dip_from_a_m=3.0, dip_direction=direction
    )
    dips = np.linspace(0, one.top_m, 97)
    assert rings.top_m == pytest.approx(one.top_m, rel=1e-12)
    assert rings.capacity_m3 == pytest.approx(one.capacity_m3, rel=1e-12)
    assert np.abs(rings.volume_m3(dips) - one.volume_m3(dips)).max() < 1e-9
    assert np.abs(rings.area_m2(dips) - one.area_m2(dips)).max() < 1e-9
    known, found = one.derivatives(dips), rings.derivatives(dips)
    same = ("end_depth", "tilt", "dip_position", "datum", "scale", "plate_thickness")
    assert all(np.abs(found[name] - known[name]).max() < 1e-9 for name in same)
    assert np.abs(found["ring_radii"].sum(axis=1) - 2 * known["diameter"]).max() < 1e-9
    assert np.abs(found["ring_lengths"][:, -1] - known["length"]).max() < 1e-9
    assert np.abs(found["ring_axes"].sum(axis=1)).max() < 1e-9  # all of them: the tank as a whole


@pytest.mark.slow
def test_tilted_rings_against_meshes_that_trimesh_cuts(figure):
    """Second method: each ring a prism of 1440 sides and of the circle's area, cut by the plane."""
    tilt, corners = np.arctan(LAPPED.tilt), 2 * np.pi / 1440
    up = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    turn = trimesh.geometry.align_vectors(up, (0, 0, 1))
    along = trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0))
    bottom = np.array([LAPPED.dip_from_a_m, 0.0, -LAPPED.radii_m[0]])
    rings = []
    for i, (radius, length) in enumerate(zip(LAPPED.radii_m, LAPPED.lengths_m, strict=True)):
        outer = radius * np.sqrt(corners / np.sin(corners))
        ring = trimesh.creation.cylinder(outer, length, sections=1440).apply_transform(along)
        rings.append(ring.apply_translation(((i + 0.5) * length, 0, 0)).apply_transform(turn))
    dips = np.linspace(0.02, 2.36, 14)
    levels = [(turn[:3, :3] @ (bottom + dip * up))[2] for dip in dips]
    expected = [sum(volume_below(ring, level) for ring in rings) for level in levels]
    off = np.abs(LAPPED.volume_m3(dips) - expected).max() / LAPPED.capacity_m3
    figure("lapped rings tilted, from meshes of 1440 sides, of capacity", off)
    assert off < 1e-6


def volume_below(mesh, z):
    """What trimesh leaves below z; the lid is level, so that its height is taken off."""
    at = (0, 0, z)
    vertices, faces, _ = trimesh.intersections.slice_faces_plane(
        mesh.vertices, mesh.faces, (0, 0, -1), at
    )
    return trimesh.Trimesh(vertices - at, faces, process=False).volume


def test_level_rings_against_another_program():
    """Truth: fluids, each ring a tank of its own, at its own depth of liquid."""
    fluids = pytest.importorskip("fluids.geometry")
    tank, dips = replace(LAPPED, tilt=0.0), np.linspace(0.01, 2.39, 24)
    own = [
        sum(
            fluids.V_from_h(np.clip(h + r - 1.2, 0, 2 * r), 2 * r, length, horizontal=True)
            for r, length in zip(tank.radii_m, tank.lengths_m, strict=True)
        )
        for h in dips
    ]
    assert np.abs(tank.volume_m3(dips) - own).max() < 1e-9


@pytest.mark.parametrize("dip", [0.0, 0.02, 0.7, 1.9, 2.37, 2.41])
def test_unlike_rings_against_quadrature(dip):
    """Truth: segments of each ring by the specification's formula, integrated adaptively."""
    tank = replace(UNLIKE, end_a=End("flat"), end_b=End("flat"))
    assert tank.volume_m3([dip])[0] == pytest.approx(_by_quadrature(tank, dip), abs=1e-8)


def _by_quadrature(tank, dip):
    """Volume below a plumb dip of a tank with flat ends, and of a wavy or shifted one the same."""
    tilt, whole = tank.tilt, 0.0
    cos = 1 / np.hypot(1, tilt)
    ends = np.concatenate([[0], np.cumsum(tank.lengths_m)])
    zero = np.searchsorted(ends, tank.dip_from_a_m, side="right") - 1

    def segment(s, radius):
        depth = (tank.dip_from_a_m - s) * tilt + dip / cos + radius - tank.radii_m[zero]
        d = np.clip(depth, 0, 2 * radius)
        return radius**2 * np.arccos(1 - d / radius) - (radius - d) * np.sqrt(2 * radius * d - d**2)

    for radius, start, stop in zip(tank.radii_m, ends, ends[1:], strict=False):
        meets = [
            tank.dip_from_a_m + (dip / cos - tank.radii_m[zero] + side * radius) / tilt
            for side in (-1, 1)
        ]
        inner = sorted({start, stop, *(s for s in meets if start < s < stop)})
        for low, high in itertools.pairwise(inner):
            whole += scipy.integrate.quad(
                segment, low, high, args=(radius,), epsabs=1e-12, epsrel=1e-12, limit=200
            )[0]
    return whole


@pytest.mark.slow(after=4)
@pytest.mark.parametrize(
    ("name", "field"), [("ring_radii", "radii_m"), ("ring_lengths", "lengths_m")]
)
@pytest.mark.parametrize("place", [1.0, 3.5, 5.5])
def test_derivatives_by_each_ring(name, field, place):
    """Truth: differences of volumes."""
    tank, dips = replace(UNLIKE, dip_from_a_m=place), np.array([0.03, 0.4, 1.3, 2.2])

    def volumes(x):
        return replace(tank, **{field: tuple(x)}).volume_m3(dips)

    assert_derivative(volumes, getattr(tank, field), tank.derivatives(dips)[name], tolerance=1e-6)


@pytest.mark.parametrize(
    "ends",
    [
        (End("torispherical", 0.5, knuckle_radius_m=0.24), End("guppy", 0.9)),
        (End("torispherical", dish_radius_m=2.4, knuckle_radius_m=0.24), End("conical", 0.5)),
    ],
)
def test_rings_have_every_end(ends):
    """Truth: the cylinder of equal rings; differences of volumes by radii and by sizes of ends."""
    tank, dips = replace(UNLIKE, end_a=ends[0], end_b=ends[1]), np.array([0.03, 0.4, 1.3, 2.2])
    equal = replace(tank, radii_m=(1.2,) * 3)
    one = LyingTank(2.4, 2.4, 7.5, *ends, tilt=tank.tilt, dip_from_a_m=tank.dip_from_a_m)
    assert equal.volume_m3(dips) == pytest.approx(one.volume_m3(dips), abs=1e-12)
    assert equal.capacity_m3 == pytest.approx(one.capacity_m3, abs=1e-12)
    by_equal, by_one = equal.derivatives(dips), one.derivatives(dips)
    for name in ("end_depth", "dish", "knuckle", "tilt"):
        assert by_equal[name] == pytest.approx(by_one[name], abs=1e-12)

    def by_radii(x):
        return replace(tank, radii_m=tuple(x)).volume_m3(dips)

    def by_knuckle(x):
        return replace(tank, end_a=replace(ends[0], knuckle_radius_m=x[0])).volume_m3(dips)

    found = tank.derivatives(dips)
    assert_derivative(by_radii, tank.radii_m, found["ring_radii"], tolerance=1e-6)
    assert_derivative(by_knuckle, (0.24,), found["knuckle"][:, None], tolerance=1e-6)


@pytest.mark.parametrize(("name", "field"), [("tilt", "tilt"), ("dip_position", "dip_from_a_m")])
def test_derivatives_by_place(name, field):
    """Truth: differences of volumes."""
    dips = np.array([0.03, 0.4, 1.3, 2.2])

    def volumes(x):
        return replace(UNLIKE, **{field: x[0]}).volume_m3(dips)

    assert_derivative(
        volumes, [getattr(UNLIKE, field)], UNLIKE.derivatives(dips)[name][:, None], tolerance=1e-6
    )


@pytest.mark.parametrize("order", [2, 3, 7])
@pytest.mark.parametrize("ring", [0, 1])
def test_derivatives_by_waves_of_a_ring(order, ring):
    """Truth: polygons of 20 000 corners, whose bottom at the dip is the zero."""
    tank, dips, wave_m = replace(LAPPED, tilt=0.0), np.array([0.2, 1.0, 2.0]), 1e-5
    at = ring * len(WAVES) + WAVES.index(order)
    found = tank.derivatives(dips)["ring_waves"][:, at]
    moved = [
        [_below(tank, dip, ring, lambda a, size=size: size * np.cos(order * a)) for dip in dips]
        for size in (-wave_m, wave_m)
    ]
    by_difference = (np.array(moved[1]) - moved[0]) / (2 * wave_m)
    assert found == pytest.approx(by_difference, abs=2e-3)


@pytest.mark.parametrize("ring", [0, 2])
def test_derivatives_by_axes_of_rings(ring):
    """Truth: the same polygons, lifted."""
    tank, dips, up = replace(LAPPED, tilt=0.0), np.array([0.2, 1.0, 2.0]), 1e-5
    found = tank.derivatives(dips)["ring_axes"][:, ring]
    moved = [[_below(tank, dip, ring, lift_m=size) for dip in dips] for size in (-up, up)]
    assert found == pytest.approx((np.array(moved[1]) - moved[0]) / (2 * up), abs=2e-3)


def _below(tank, dip, ring, wave=None, lift_m=0.0):
    """Volume of a level tank of which one ring has a wave, or stands higher."""
    turn = (np.arange(20_000) + 0.5) * 2 * np.pi / 20_000
    zero = -tank.radii_m[tank.zero_ring]
    if ring == tank.zero_ring:
        zero += lift_m - (0.0 if wave is None else float(wave(np.zeros(1))[0]))
    whole = 0.0
    for i, (radius, length) in enumerate(zip(tank.radii_m, tank.lengths_m, strict=True)):
        outline = radius + (wave(turn) if wave is not None and i == ring else 0.0)
        y = -outline * np.cos(turn) + lift_m * (i == ring)
        x = outline * np.sin(turn)
        y = np.minimum(y, zero + dip)  # what stands above the liquid lies on it
        whole += length * 0.5 * np.abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return whole


def test_what_the_dip_does_not_read():
    """Truth: the specification's table: 2.274 L below the dip point, and the rest above 2.4 m."""
    assert 1000 * LAPPED.volume_m3([0.0])[0] == pytest.approx(2.274, abs=0.001)
    assert LAPPED.top_m == pytest.approx(2.4 * np.hypot(1, 0.01))
    left = LAPPED.capacity_m3 - _by_quadrature(LAPPED, LAPPED.top_m)
    assert LAPPED.left_m3 == pytest.approx(left, abs=1e-8)
    assert replace(LAPPED, tilt=0.0).left_m3 == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    "changes",
    [
        {"radii_m": (1.2, 1.2)},
        {"radii_m": (1.2, -1.0, 1.2)},
        {"lengths_m": (3.0, 0.0, 3.0)},
        {"dip_from_a_m": 9.5},
        {"dip_direction": "sideways"},
        {"tilt": np.nan},
        {"end_a": End("conical", 7.0, inward=True), "end_b": End("conical", 3.0, inward=True)},
    ],
)
def test_sizes_of_no_tank_are_refused(changes):
    with pytest.raises(SolutionError):
        replace(LAPPED, **changes)


def test_dips_outside_are_refused():
    with pytest.raises(HeightError):
        LAPPED.volume_m3([-0.01])
    with pytest.raises(HeightError):
        LAPPED.volume_m3([2.6])
