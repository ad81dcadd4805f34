"""Lying tanks and spheres: published figures, another program, closed forms, second methods."""

import itertools
from dataclasses import replace
from operator import methodcaller

import numpy as np
import pytest
import scipy.integrate
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from jacobians import assert_derivative

from tankcal.errors import HeightError, SolutionError
from tankcal.tank.heads import (
    CHORD,
    CHORD_MOMENT,
    KINDS,
    SEGMENT,
    End,
    depth_of,
    integrate,
    meridian,
)
from tankcal.tank.solids import FLAT, LyingTank, Sphere

INCH = 0.0254
GALLON = 231 * INCH**3

END = {
    "flat": FLAT,
    "conical": End("conical", 0.7),
    "ellipsoidal": End("ellipsoidal", 0.5),
    "spherical": End("spherical", 0.3),
    "torispherical": End("torispherical", dish_radius_m=2.1, knuckle_radius_m=0.2),
    "guppy": End("guppy", 0.6),
}
SYMMETRIC = [kind for kind in KINDS if kind != "guppy"]


def round_tank(end_a="flat", end_b=None, **changes):
    """D 2 m, L 5 m, dip 1.8 m from A, with ends by name (both alike when one is named)."""
    tank = LyingTank(2.0, 2.0, 5.0, END[end_a], END[end_b or end_a], dip_from_a_m=1.8)
    return replace(tank, **changes)


# published figures


def test_filled_fraction_of_a_level_cylinder_published():
    tank = LyingTank(2.4, 2.4, 10.0)
    found = tank.volume_m3(2.4 * np.array([0.05, 0.10, 0.20, 0.50, 0.90])) / tank.capacity_m3
    published = [0.018693, 0.052044, 0.142378, 0.5, 0.947956]
    assert np.round(found, 6) == pytest.approx(published, abs=1e-12)


@pytest.mark.parametrize(
    ("end", "gallons", "rel"),
    [
        (End("conical", 42 * INCH), 2041.1923581273443, 1e-13),
        (End("ellipsoidal", 42 * INCH), 2380.9565415578145, 1e-13),
        (End("spherical", 42 * INCH), 2303.9615116986183, 1e-13),
        (
            End("torispherical", dish_radius_m=108 * INCH, knuckle_radius_m=6.48 * INCH),
            2028.626670842139,
            1e-11,
        ),
    ],
    ids=lambda value: getattr(value, "kind", None),
)
def test_ends_published_jones(end, gallons, rel):
    """Jones 2001: D 108, L 156, a 42, h 36 in; torispherical f = 1, k = 0.06."""
    tank = LyingTank(108 * INCH, 108 * INCH, 156 * INCH, end, end)
    assert tank.volume_m3([36 * INCH])[0] / GALLON == pytest.approx(gallons, rel=rel)


@pytest.mark.parametrize("direction", ["square", "plumb"])
def test_tilted_elliptical_cylinder_published(direction):
    """Width 1.78, height 1.20, length 2.45 m, dip 0.40 m from the low end, tilt 4.1 deg."""
    slope = np.tan(np.radians(4.1))
    tank = LyingTank(1.78, 1.20, 2.45, tilt=slope, dip_from_a_m=0.4, dip_direction=direction)
    shorter = np.cos(np.radians(4.1)) if direction == "plumb" else 1.0
    litres = 1000 * tank.volume_m3(np.array([0.0, 0.5, 1.2]) * shorter)
    assert np.round(litres, 4) == pytest.approx([1.6744, 1371.8812, 4012.7449], abs=1e-9)
    assert round(1000 * tank.capacity_m3, 4) == 4110.1457


def test_sphere_published():
    """D 20 m filled 5 m: 654.498469 m3."""
    assert round(Sphere(20.0).volume_m3([5.0])[0], 6) == 654.498469
    assert Sphere(20.0).volume_m3([20.0])[0] == pytest.approx(4000 * np.pi / 3, rel=1e-15)


# another program

FILLS = np.array([0.003, 0.03, 0.11, 0.2, 0.35, 0.5, 0.62, 0.8, 0.93, 0.999])


@pytest.mark.parametrize("kind", ["conical", "ellipsoidal", "spherical", "guppy"])
@pytest.mark.parametrize("depth", [0.02, 0.3, 0.77, 1.0])
def test_level_tanks_other_program(kind, depth, figure):
    geometry = pytest.importorskip("fluids.geometry")
    other = getattr(geometry, f"V_horiz_{kind}")
    end = End(kind, depth)
    found = LyingTank(2.0, 2.0, 5.0, end, end).volume_m3(2 * FILLS)
    expected = np.array([other(2.0, 5.0, depth, 2 * fill) for fill in FILLS])
    worst = np.abs(found / expected - 1).max()
    figure(f"{kind}, depth {depth:g} of radius 1, against fluids", f"{worst:.1e}")
    assert worst < 1e-9


@pytest.mark.parametrize(("dish", "knuckle"), [(1.0, 0.06), (1.0, 0.1), (0.8, 0.154), (0.9, 0.17)])
def test_level_torispherical_tanks_other_program(dish, knuckle, figure):
    geometry = pytest.importorskip("fluids.geometry")
    end = End("torispherical", dish_radius_m=2 * dish, knuckle_radius_m=2 * knuckle)
    found = LyingTank(2.0, 2.0, 5.0, end, end).volume_m3(2 * FILLS)
    expected = [geometry.V_horiz_torispherical(2.0, 5.0, dish, knuckle, 2 * f) for f in FILLS]
    worst = np.abs(found / np.array(expected) - 1).max()
    figure(f"torispherical, dish {dish:g} D, knuckle {knuckle:g} D, against fluids", f"{worst:.1e}")
    assert worst < 1e-9


# closed forms


def test_depth_of_a_torispherical_end_closed_form():
    """Kloepper: dish D, knuckle D / 10: h = D (1 - sqrt(0.65))."""
    end = End("torispherical", dish_radius_m=2.0, knuckle_radius_m=0.2)
    assert depth_of(end, 1.0) == pytest.approx(2 * (1 - np.sqrt(0.65)), rel=1e-15)


def test_capacities_closed_form():
    """Cone pi R^2 h / 3, ellipsoid 2/3, spherical cap pi h (3 R^2 + h^2) / 6."""
    expected = {
        "flat": 0.0,
        "conical": np.pi * 0.7 / 3,
        "ellipsoidal": 2 * np.pi * 0.5 / 3,
        "spherical": np.pi * 0.3 * (3 + 0.09) / 6,
        "torispherical": torispherical_capacity(END["torispherical"], 1.0),
    }
    for a, b in itertools.product(expected, repeat=2):
        tank = round_tank(a, b, tilt=0.05, dip_from_a_m=4.0)
        total = 5 * np.pi + expected[a] + expected[b]
        assert tank.capacity_m3 == pytest.approx(total, rel=1e-14)


def torispherical_capacity(end, radius):
    """Knuckle: pi int (e + sqrt(k^2 - x^2))^2; dish: a spherical cap (closed form)."""
    f, k = end.dish_radius_m, end.knuckle_radius_m
    e = radius - k
    alpha = np.arcsin(e / (f - k))
    x = k * np.cos(alpha)
    knuckle = e**2 * x + k**2 * x - x**3 / 3
    knuckle += e * (x * k * np.sin(alpha) + k**2 * np.arcsin(x / k))
    cap, rim = f * (1 - np.cos(alpha)), f * np.sin(alpha)
    return np.pi * knuckle + np.pi * cap * (3 * rim**2 + cap**2) / 6


def test_an_ungula_closed_form():
    """Tilt m, liquid that ends in mid-bottom; at the low end it stands at the axis: 2/3 R^3/m."""
    slope = np.tan(np.radians(20.0))
    tank = LyingTank(2.0, 2.0, 5.0, tilt=slope, dip_direction="square")
    assert tank.volume_m3([1.0])[0] == pytest.approx(2 / (3 * slope), rel=1e-13)


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 0.02, -0.02, 0.2, 0.6])
def test_tilted_flat_ends_closed_form(tilt):
    """V = (F(c_A) - F(c_B)) / m with F the integral of the segment; first order when small."""

    def total(c):
        c = np.clip(c, -1, 1)
        root = np.sqrt(1 - c**2)
        return c * (np.pi / 2 + np.arcsin(c)) + root - root**3 / 3

    tank = round_tank(tilt=tilt, dip_direction="square")
    dip = np.linspace(0, 2, 41)
    low, high = dip - 1 + tilt * 1.8, dip - 1 - tilt * 3.2
    if abs(tilt) > 1e-3:
        beyond = np.pi * (np.maximum(low, 1) - 1 - np.maximum(high, 1) + 1)
        expected = (total(low) - total(high) + beyond) / tilt
    else:
        root = np.sqrt(dip * (2 - dip))
        expected = 5 * (np.pi / 2 + np.arcsin(dip - 1) + (dip - 1) * root)
        expected -= tilt * 2 * root * 5 * 0.7  # first order: the dip is 0.7 m from the middle
    assert tank.volume_m3(dip) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 0.05, -0.4, 1.0])
def test_two_hemispheres_are_a_sphere_at_any_tilt_closed_form(tilt):
    end = End("spherical", 1.0)
    tank = LyingTank(2.0, 2.0, 1e-13, end, end, tilt=tilt, dip_direction="square")
    dip = np.linspace(0.0, 2.0, 21)
    height = 1 + (dip - 1) / np.hypot(1, tilt)  # above the lowest point of the sphere
    assert tank.volume_m3(dip) == pytest.approx(Sphere(2.0).volume_m3(height), abs=2e-12)


# second methods


def columns_m3(tank, dip):
    """By vertical planes along the axis, round tanks, square dips: adaptive quadrature."""
    radius, length, m = tank.height_m / 2, tank.length_m, tank.tilt

    def profile(end, x):
        if x > depth_of(end, radius):
            return -1.0
        if end.kind == "conical":
            return radius * (1 - x / end.depth_m)
        if end.kind == "ellipsoidal":
            return radius * np.sqrt(1 - (x / end.depth_m) ** 2)
        if end.kind == "spherical":
            ball = (radius**2 + end.depth_m**2) / (2 * end.depth_m)
            return np.sqrt(ball**2 - (x - end.depth_m + ball) ** 2)
        f, k = end.dish_radius_m, end.knuckle_radius_m
        deep = f - np.sqrt((f - k) ** 2 - (radius - k) ** 2)
        joint = k * (f - deep) / (f - k)
        if x < joint:
            return radius - k + np.sqrt(k**2 - x**2)
        return np.sqrt(max(f**2 - (x - deep + f) ** 2, 0.0))

    def section(s):
        r = radius
        if s < 0 or s > length:
            r = profile(tank.end_a if s < 0 else tank.end_b, max(-s, s - length))
        c = dip - radius - m * (s - tank.dip_from_a_m)
        if r <= 0 or c <= -r:
            return 0.0
        half = r * np.sin(np.arccos(np.clip(c / r, 0, 1)))  # beyond it columns reach the roof

        def column(angle):
            y = half * np.sin(angle)
            low = -np.sqrt(r**2 - y**2)
            return max(min(c, -low) - low, 0.0) * half * np.cos(angle)

        if c < 0:
            half = np.sqrt(r**2 - c**2)
            return 2 * scipy.integrate.quad(column, 0, np.pi / 2, epsabs=1e-12)[0]
        outside = r**2 * (np.arcsin(1) - np.arcsin(half / r)) - half * np.sqrt(r**2 - half**2)
        return 2 * scipy.integrate.quad(column, 0, np.pi / 2, epsabs=1e-12)[0] + 2 * outside

    start, stop = -depth_of(tank.end_a, radius), length + depth_of(tank.end_b, radius)
    kinks = [0.0, length] + [
        tank.dip_from_a_m + (dip - radius - side * radius) / m for side in (1, -1)
    ]
    inside = [k for k in kinks if start < k < stop]
    return scipy.integrate.quad(
        section, start, stop, points=inside, limit=300, epsabs=1e-9, epsrel=1e-9
    )[0]


@pytest.mark.slow(after=2)
@pytest.mark.parametrize(
    ("a", "b", "tilt", "dip"),
    [
        ("torispherical", "conical", 0.03, 0.05),
        ("conical", "ellipsoidal", -0.15, 1.3),
        ("spherical", "torispherical", 0.15, 1.85),
        ("ellipsoidal", "spherical", -0.06, 0.9),
    ],
)
def test_tilted_tanks_with_ends_second_method(a, b, tilt, dip, figure):
    tank = round_tank(a, b, tilt=tilt, dip_direction="square")
    expected = columns_m3(tank, dip)
    found = tank.volume_m3([dip])[0]
    figure(
        f"{a}/{b} tilt {tilt} dip {dip}: difference from columns, of capacity",
        f"{abs(found - expected) / tank.capacity_m3:.1e}",
    )
    assert found == pytest.approx(expected, abs=2e-8 * tank.capacity_m3)


def share_below(tank, dip, count):
    """Quasi Monte Carlo in the world's frame: own rotation, own tests of what is inside."""
    w, h = tank.width_m / 2, tank.height_m / 2
    radius = np.sqrt(w * h)
    deep_a, deep_b = depth_of(tank.end_a, radius), depth_of(tank.end_b, radius)
    reach = max(w, h)
    unit = scipy.stats.qmc.Sobol(3, seed=7).random(count)
    size = np.array([deep_a + tank.length_m + deep_b, 2 * reach, 2 * reach])
    s, y, z = (unit * size - (deep_a, reach, reach)).T
    cos, sin = np.cos(tank.roll_rad), np.sin(tank.roll_rad)
    ratio = np.hypot((y * cos + z * sin) / w, (z * cos - y * sin) / h)
    x = np.maximum(np.maximum(-s, s - tank.length_m), 0.0)
    limit = np.where(s < 0, similar(tank.end_a, x, radius), similar(tank.end_b, x, radius))
    inside = ratio <= np.where(x > 0, limit, 1.0)
    angle = np.arctan(tank.tilt)
    height = s * np.sin(angle) + z * np.cos(angle)
    lowest = -np.sqrt((w * sin) ** 2 + (h * cos) ** 2)
    bottom = tank.dip_from_a_m * np.sin(angle) + lowest * np.cos(angle)
    surface = bottom + (dip if tank.dip_direction == "plumb" else dip * np.cos(angle))
    box = size.prod() / count
    return np.count_nonzero(inside & (height <= surface)) * box, np.count_nonzero(inside) * box


def similar(end, x, radius):
    """Size of an end's section at x, of that of the cylinder."""
    h = depth_of(end, radius)
    if end.kind == "conical":
        return 1 - x / h
    if end.kind == "ellipsoidal":
        return np.sqrt(np.maximum(1 - (x / h) ** 2, 0))
    if end.kind == "spherical":
        ball = (radius**2 + h**2) / (2 * h)
        return np.sqrt(np.maximum(ball**2 - (x - h + ball) ** 2, 0)) / radius
    f, k = end.dish_radius_m, end.knuckle_radius_m
    knuckle = radius - k + np.sqrt(np.maximum(k**2 - x**2, 0))
    dish = np.sqrt(np.maximum(f**2 - (x - h + f) ** 2, 0))
    return np.where(x < k * (f - h) / (f - k), knuckle, dish) / radius


@pytest.mark.parametrize("direction", ["plumb", "square"])
@pytest.mark.parametrize(
    ("a", "b", "tilt", "roll", "dip"),
    [
        ("torispherical", "ellipsoidal", 0.17, 0.0, 0.15),
        ("conical", "torispherical", -0.17, 0.4, 0.9),
        ("spherical", "conical", 0.05, -1.2, 1.35),
    ],
)
def test_rolled_and_tilted_elliptical_tanks_second_method(a, b, tilt, roll, dip, direction, figure):
    tank = LyingTank(1.8, 1.4, 4.0, END[a], END[b], tilt, roll, 1.5, direction)
    below, full = share_below(tank, dip, 2**18)
    differences = np.array([tank.volume_m3([dip])[0] - below, tank.capacity_m3 - full])
    worst = np.abs(differences).max() / tank.capacity_m3
    figure(f"{a}/{b} {direction}: difference from 2^18 random points, of capacity", f"{worst:.1e}")
    assert worst < 3e-4


# properties


@pytest.mark.parametrize("depth", [0.01, 0.5, 3.0])
def test_level_ellipsoidal_ends_second_method(depth, figure):
    """Closed form of half an ellipsoid against slices of 24 nodes, under a fall of 1e-300."""
    near = 10.0 ** -np.arange(1, 13)
    levels = np.concatenate([np.linspace(-1.3, 1.3, 105), 1 - near, near - 1, 1 + near])
    (arc,) = meridian(End("ellipsoidal", depth), 1.0)
    inputs = [methodcaller("by", name) for name in ("radius", "end_depth", "end_plate")]
    integrands = [SEGMENT, CHORD, CHORD_MOMENT, *inputs]
    closed, sliced = (integrate(arc, levels, slope, integrands) for slope in (0.0, 1e-300))
    worst = np.abs(closed - sliced).max(axis=1) / np.abs(sliced).max(axis=1)
    shown = ", ".join(f"{one:.1e}" for one in worst)
    figure(f"ellipsoidal, depth {depth:g}, closed form against slices, of the end's", shown)
    assert worst.max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS[1:])
def test_more_nodes_change_nothing(kind, figure):
    """24 nodes a panel against 150, surfaces near and far from tangent: volumes and surfaces."""
    near = 10.0 ** -np.arange(1, 13)
    levels = np.concatenate([np.linspace(-1.3, 1.3, 105), 1 - near, near - 1, 1 + near])
    worst = np.zeros(2)
    for end, slope in itertools.product(variants(kind), [0, 1e-6, 1e-4, 0.01, 0.07, -0.18, 1.0]):
        for arc in meridian(end, 1.0):
            few, many = (
                integrate(arc, levels, slope, [SEGMENT, CHORD], nodes) for nodes in (24, 150)
            )
            worst = np.maximum(worst, np.abs(few - many).max(axis=1) / np.abs(many).max(axis=1))
    shown = ", ".join(f"{one:.1e}" for one in worst)
    figure(f"{kind}: quadrature error of volume and surface, of the end's", shown)
    assert worst[0] < 1e-11
    assert worst[1] < 1e-7


def variants(kind):
    if kind == "torispherical":
        radii = [(2.0, 0.2), (1.6, 0.3), (1.001, 0.3), (1.001, 0.99), (20.0, 0.01)]
        return [End(kind, dish_radius_m=f, knuckle_radius_m=k) for f, k in radii]
    return [End(kind, depth) for depth in (0.02, 0.3, 0.7, 1.0)]


@pytest.mark.parametrize("kind", SYMMETRIC)
def test_level_tanks_are_symmetric(kind):
    """V(h) + V(D - h) = capacity."""
    tank = round_tank(kind)
    dip = np.linspace(0, 2, 101)
    assert tank.volume_m3(dip) + tank.volume_m3(2 - dip) == pytest.approx(
        tank.capacity_m3, rel=1e-13
    )


@pytest.mark.parametrize("kind", SYMMETRIC)
def test_tilted_tank_with_equal_ends_is_symmetric(kind):
    tank = round_tank(kind, tilt=0.08, dip_from_a_m=2.5, dip_direction="square")
    dip = np.linspace(0, 2, 101)
    assert tank.volume_m3(dip) + tank.volume_m3(2 - dip) == pytest.approx(
        tank.capacity_m3, rel=1e-12
    )


@pytest.mark.parametrize(("a", "b"), [("torispherical", "conical"), ("flat", "spherical")])
@pytest.mark.parametrize("direction", ["plumb", "square"])
def test_ends_swapped_and_tilt_reversed_is_the_same_tank(a, b, direction):
    dip = np.linspace(0, 2, 51)
    here = round_tank(a, b, tilt=0.11, dip_direction=direction)
    there = round_tank(b, a, tilt=-0.11, dip_from_a_m=3.2, dip_direction=direction)
    assert there.volume_m3(dip) == pytest.approx(here.volume_m3(dip), rel=1e-13)
    assert there.area_m2(dip) == pytest.approx(here.area_m2(dip), rel=1e-9)


def test_quarter_turn_swaps_width_and_height():
    dip = np.linspace(0, 1.4, 51)
    lying = LyingTank(1.8, 1.4, 4.0, END["ellipsoidal"], FLAT, 0.05, 0.0, 1.5)
    rolled = replace(lying, width_m=1.4, height_m=1.8, roll_rad=np.pi / 2)
    assert rolled.volume_m3(dip) == pytest.approx(lying.volume_m3(dip), rel=1e-12)
    plain = round_tank("torispherical", tilt=0.05)
    turned = replace(plain, roll_rad=0.7)
    assert turned.volume_m3(dip) == pytest.approx(plain.volume_m3(dip), rel=1e-12)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_inward_end_takes_what_outward_end_adds(kind):
    dip = np.linspace(0, 2, 51)
    inward = replace(END[kind], inward=True)
    tank = replace(round_tank(kind), end_b=inward)
    assert tank.volume_m3(dip) == pytest.approx(round_tank().volume_m3(dip), abs=1e-12)
    assert tank.capacity_m3 == pytest.approx(5 * np.pi, rel=1e-14)


def test_an_inward_end_in_a_tilted_tank_second_method():
    """The bulge at B, on its own: the end at A of a tank that begins where this one stops."""
    bulge = replace(END["torispherical"], inward=True)
    tank = LyingTank(2.0, 2.0, 5.0, FLAT, bulge, 0.1, dip_from_a_m=4.0, dip_direction="square")
    beyond = LyingTank(
        2.0, 2.0, 5.0, END["torispherical"], FLAT, 0.1, dip_from_a_m=0.0, dip_direction="square"
    )
    dip = np.linspace(0.2, 1.8, 17)  # the same surface, 1 m further on
    flat = replace(tank, end_b=FLAT).volume_m3(dip)
    outside = beyond.volume_m3(dip - 0.1) - replace(beyond, end_a=FLAT).volume_m3(dip - 0.1)
    assert tank.volume_m3(dip) == pytest.approx(flat - outside, abs=1e-12)


ends = st.one_of(
    st.just(FLAT),
    st.builds(End, st.sampled_from(["conical", "ellipsoidal"]), st.floats(0.01, 2.0)),
    st.builds(End, st.just("spherical"), st.floats(0.01, 0.6)),
    st.builds(
        End,
        st.just("torispherical"),
        dish_radius_m=st.floats(1.3, 4.0),
        knuckle_radius_m=st.floats(0.02, 0.6),
    ),
)


@pytest.mark.slow
@settings(max_examples=60, derandomize=True)
@given(
    a=ends,
    b=ends,
    tilt=st.floats(-0.18, 0.18),
    roll=st.floats(-3.0, 3.0),
    place=st.floats(0.0, 1.0),
    direction=st.sampled_from(["plumb", "square"]),
)
def test_any_tank_fills_monotonically_to_at_most_its_capacity(a, b, tilt, roll, place, direction):
    tank = LyingTank(2.2, 1.3, 3.0, a, b, tilt, roll, 1.0 + place, direction)
    dip = np.linspace(0, tank.top_m, 301)
    volume = tank.volume_m3(dip)
    assert np.diff(volume).min() > -1e-12 * tank.capacity_m3
    assert volume[0] >= 0
    assert volume[-1] <= tank.capacity_m3 * (1 + 1e-12)
    mean = (tank.area_m2(dip)[1:] + tank.area_m2(dip)[:-1]) / 2 * np.diff(dip)
    assert np.diff(volume) == pytest.approx(mean, abs=2e-3 * tank.capacity_m3)
    if tilt == 0:
        assert volume[-1] == pytest.approx(tank.capacity_m3, rel=1e-12)


# derivatives


def sized(tank, inputs):
    """The tank with diameter, length, end depth, tilt, place of the dip, and plates changed."""
    diameter, length, depth, tilt, place, plate = inputs

    def end(one):
        if one.kind == "flat":
            return one
        thicker = -plate if one.inward else plate
        if one.kind == "torispherical":
            return replace(
                one,
                dish_radius_m=one.dish_radius_m - thicker,
                knuckle_radius_m=one.knuckle_radius_m - thicker,
            )
        return replace(one, depth_m=one.depth_m + depth - thicker)

    return replace(
        tank,
        width_m=tank.width_m + diameter - 2 * plate,
        height_m=tank.height_m + diameter - 2 * plate,
        length_m=tank.length_m + length,
        end_a=end(tank.end_a),
        end_b=end(tank.end_b),
        tilt=tank.tilt + tilt,
        dip_from_a_m=tank.dip_from_a_m + place,
    )


NAMES = ["diameter", "length", "end_depth", "tilt", "dip_position", "plate_thickness"]


@pytest.mark.slow(after=5)
@pytest.mark.parametrize("direction", ["plumb", "square"])
@pytest.mark.parametrize(("a", "b"), [("conical", "flat"), ("spherical", "ellipsoidal")])
@pytest.mark.parametrize("tilt", [0.0, 0.07, -0.16])
@pytest.mark.parametrize(("width", "height", "roll"), [(2.0, 2.0, 0.0), (2.4, 1.6, 0.5)])
def test_derivatives_by_every_input(a, b, tilt, direction, width, height, roll):
    tank = LyingTank(width, height, 5.0, END[a], END[b], tilt, roll, 1.8, direction)
    check_derivatives(tank, NAMES)


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("tilt", [0.0, 0.07])
@pytest.mark.parametrize("inward", [False, True])
def test_derivatives_with_torispherical_and_inward_ends(tilt, inward):
    bulge = replace(END["torispherical"], inward=inward)
    tank = LyingTank(2.2, 1.8, 5.0, bulge, END["torispherical"], tilt, 0.3, 1.8)
    check_derivatives(tank, [name for name in NAMES if name != "end_depth"])
    check_derivatives(replace(tank, end_b=replace(END["conical"], inward=inward)), NAMES[:2])
    cones = replace(END["conical"], inward=inward)
    check_derivatives(replace(tank, end_a=cones, end_b=cones), NAMES)


def check_derivatives(tank, names):
    dip = np.array([0.07, 0.31, 0.86, 1.13, 1.52])
    found = tank.derivatives(dip)

    def volume(inputs):
        every = np.zeros(len(NAMES))
        every[[NAMES.index(name) for name in names]] = inputs
        return sized(tank, every).volume_m3(dip)

    analytic = np.column_stack([found[name] for name in names])
    assert_derivative(volume, np.zeros(len(names)), analytic, step=3e-5)


@pytest.mark.parametrize("tilt", [0.0, 0.07, -0.16])
def test_stretching_the_whole_tank_along_its_axis(tilt):
    """L, depths and p times 1 + e, tilt by 1 + e: V times 1 + e; holds the stretched ends."""
    tank = round_tank("torispherical", tilt=tilt, dip_direction="square")
    dip = np.array([0.07, 0.31, 0.86, 1.13, 1.9])
    d = tank.derivatives(dip)
    total = 5 * d["length"] + 1.8 * d["dip_position"] - tilt * d["tilt"]
    total += depth_of(END["torispherical"], 1.0) * d["end_depth"]
    assert total == pytest.approx(tank.volume_m3(dip), rel=1e-7)


@pytest.mark.parametrize("tank", [round_tank("conical", tilt=0.07), Sphere(2.0)], ids=type)
def test_datum_and_scale(tank):
    """A zero that lies 1 mm lower is a dip 1 mm longer; scale leaves the dips alone."""
    dip = np.array([0.07, 0.31, 0.86, 1.13, 1.9])
    found = tank.derivatives(dip)
    assert found["datum"] == pytest.approx(tank.area_m2(dip), rel=1e-14)
    assert_derivative(
        lambda x: tank.volume_m3(dip + x[0]), [0.0], found["datum"][:, None], step=3e-5
    )
    assert_derivative(
        lambda x: (1 + x[0]) ** 3 * tank.volume_m3(dip / (1 + x[0])),
        [0.0],
        found["scale"][:, None],
        step=3e-5,
    )


def test_derivatives_of_a_sphere():
    dip = np.array([0.3, 5.0, 14.0])
    found = Sphere(20.0).derivatives(dip)
    analytic = np.column_stack([found["diameter"]])
    assert_derivative(lambda x: Sphere(20 + x[0]).volume_m3(dip), [0.0], analytic)
    assert found["plate_thickness"] == pytest.approx(-2 * found["diameter"])


def test_no_sources_of_their_own():
    assert round_tank().sources([0.5]) == ()
    assert Sphere(2.0).sources([0.5]) == ()


# errors and time


def test_dips_outside_are_errors():
    slope = np.tan(np.radians(5.0))
    tank = round_tank(tilt=slope)
    assert tank.top_m == pytest.approx(2 / np.cos(np.radians(5.0)))
    for part in (tank, Sphere(2.0)):
        for dip in (-1e-6, part.top_m + 1e-6, np.nan):
            with pytest.raises(HeightError, match="outside the tank"):
                part.volume_m3([0.5, dip])
            with pytest.raises(HeightError, match="outside the tank"):
                part.derivatives([0.5, dip])
        assert part.volume_m3([part.top_m * (1 + 1e-15)])[0] <= part.capacity_m3 * (1 + 1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LyingTank(0.0, 2.0, 5.0), "width 0 m"),
        (lambda: LyingTank(2.0, np.nan, 5.0), "height nan m"),
        (lambda: LyingTank(2.0, 2.0, -5.0), "length -5 m"),
        (lambda: Sphere(-1.0), "diameter -1 m"),
        (lambda: LyingTank(2.0, 2.0, 5.0, dip_direction="slant"), "'slant'"),
        (lambda: LyingTank(2.0, 2.0, 5.0, tilt=np.inf), "tilt inf"),
        (lambda: LyingTank(2.0, 2.0, 5.0, dip_from_a_m=5.1), "between 0 and 5 m"),
        (lambda: LyingTank(2.0, 2.0, 5.0, tilt=0.1, dip_from_a_m=4.9), "leaves the top 5.1 m"),
        (lambda: LyingTank(2.0, 2.0, 5.0, End("dished", 0.3)), "'dished'"),
        (lambda: LyingTank(2.0, 2.0, 5.0, End("flat", 0.3)), "has no depth"),
        (lambda: LyingTank(2.0, 2.0, 5.0, End("conical")), "depth 0 m"),
        (lambda: LyingTank(2.0, 2.0, 5.0, End("spherical", 1.2)), "1.2 m deep on a radius of 1 m"),
        (lambda: LyingTank(2.0, 2.0, 5.0, End("torispherical", 0.3)), "two of three sizes"),
        (
            lambda: LyingTank(2.0, 2.0, 5.0, End("torispherical", 0.0, 0.9, 0.1)),
            "dish of 0.9 m on a radius of 1 m",
        ),
        (
            lambda: LyingTank(2.0, 2.0, 0.5, End("conical", 0.6, inward=True)),
            "bulge 0.6 m inwards",
        ),
    ],
)
def test_sizes_that_make_no_tank_are_refused(make, message):
    with pytest.raises(SolutionError, match=message):
        make()
