"""Bottoms: published volumes, closed forms, quadrature over the plan as the second method."""

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.errors import SolutionError
from tankcal.quadrature import panels
from tankcal.tank.bottoms import Footprint, leaning_bottom, shaped_bottom, surveyed_bottom

RADIUS, AREA = 6.5, np.pi * 6.5**2
LEVELS = np.array([-0.3, -0.15, -0.149, -0.1, -0.02, 0.0, 0.02, 0.1, 0.149, 0.15, 0.3, 9.5])
BETWEEN = np.array([-0.3, -0.149, -0.1, -0.02, 0.02, 0.1, 0.149, 0.3])
SHAPES = [("flat", 0.0), ("cone", -0.15), ("cone", 0.15), ("dish", -0.15), ("dish", 0.15)]


def over_the_plan(height, levels, breaks=()):
    """Integral of (L - z)+ - L+ over a round plan, by Gauss in the radius broken at the shore."""
    found = []
    for level in levels:
        shore = [rho for rho in breaks(level) if 0 < rho < RADIUS]
        rho, weight = panels(np.sort([0, *shore, RADIUS]), 20)
        depth = np.maximum(level - height(rho), 0) - max(level, 0)
        found.append(np.sum(2 * np.pi * rho * weight * depth))
    return np.array(found)


def profile(form, centre):
    """z(rho) of a bottom, and rho(z)."""
    if form == "cone":
        return lambda rho: centre * (1 - rho / RADIUS), lambda z: [RADIUS * (1 - z / centre)]
    sphere = (RADIUS**2 + centre**2) / (2 * abs(centre))
    sign = np.sign(centre)

    def height(rho):
        return centre - sign * (sphere - np.sqrt(sphere**2 - rho**2))

    def shore(z):
        inner = sphere**2 - (sphere - abs(centre) + sign * z) ** 2
        return [np.sqrt(inner)] if inner > 0 else []

    return height, shore


def test_whole_cone_and_dish_published(figure):
    """Methods, section 11: r 6.5 m, H 0.15 m."""
    cone = shaped_bottom("cone", AREA, -0.15).volume_m3([0.0])[0]
    dish = shaped_bottom("dish", AREA, -0.15).volume_m3([0.0])[0]
    figure("cone and dish of r 6.5, H 0.15 m, m3", f"{cone:.4f}, {dish:.4f}")
    assert [round(cone, 4), round(dish, 4)] == [6.6366, 9.9567]
    up = shaped_bottom("cone", AREA, 0.15).volume_m3([0.15, 5.0])
    assert up == pytest.approx([-cone, -cone], rel=1e-13)


@pytest.mark.parametrize(("form", "centre"), SHAPES[1:])
def test_partial_fills_second_method(form, centre):
    height, shore = profile(form, centre)
    expected = over_the_plan(height, LEVELS, shore)
    volume = shaped_bottom(form, AREA, centre).volume_m3(LEVELS)
    assert volume == pytest.approx(expected, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize(("form", "centre"), SHAPES)
def test_the_area_is_the_derivative_by_the_level(form, centre):
    part = shaped_bottom(form, AREA, centre)
    area = part.area_m2(BETWEEN)[:, None]
    moved = [part.volume_m3(BETWEEN + step) for step in (-1e-6, 1e-6)]
    assert area[:, 0] == pytest.approx((moved[1] - moved[0]) / 2e-6, abs=1e-5 * AREA)
    assert part.derivatives(BETWEEN)["datum"] == pytest.approx(area[:, 0])
    assert part.sources(BETWEEN) == ()


@pytest.mark.parametrize(("form", "centre"), SHAPES[1:])
def test_derivatives_of_bottoms_by_scale_and_height(form, centre):
    """Lifting by b: the tank's volume is that at L - b, the level counted from the lifted edge."""
    part = shaped_bottom(form, AREA, centre)
    found = part.derivatives(BETWEEN)
    assert_derivative(
        lambda x: shaped_bottom(form, AREA * (1 + x[0]) ** 2, centre).volume_m3(BETWEEN),
        [0.0],
        found["scale"][:, None],
        tolerance=1e-6,
    )

    def capacity(x):
        level = BETWEEN - x[0]
        return part.volume_m3(level) + AREA * np.maximum(level, 0)

    assert_derivative(capacity, [0.0], found["bottom"][:, None], tolerance=1e-5)


def test_a_flat_bottom_adds_nothing_but_its_height_matters():
    part = shaped_bottom("flat", AREA)
    assert not np.any(part.volume_m3(LEVELS))
    assert not np.any(part.area_m2(LEVELS))
    assert part.derivatives([-0.1, 0.0, 1.0])["bottom"] == pytest.approx([0, -AREA, -AREA])
    assert part.lowest_m == 0


def test_the_level_at_which_a_tank_is_empty():
    assert [shaped_bottom(form, AREA, centre).lowest_m for form, centre in SHAPES] == [
        0,
        -0.15,
        0,
        -0.15,
        0,
    ]


def test_no_depth_is_flat_and_little_depth_is_almost_so():
    """Property: no jump towards zero depth."""
    for form in ("cone", "dish"):
        assert shaped_bottom(form, AREA, 0.0).form == "flat"
        for centre in (-1e-9, 1e-9):
            part = shaped_bottom(form, AREA, centre)
            assert part.volume_m3(LEVELS) == pytest.approx(0.0, abs=1e-7)


def test_an_oval_outline_needs_only_its_area(figure):
    """Ovality of 20 mm: drawn out to the wall, against level lines that stay circles."""
    azimuth, weight = panels(np.linspace(0, 2 * np.pi, 73), 8)
    wall = RADIUS + 0.02 * np.cos(2 * azimuth)
    area = 0.5 * np.sum(weight * wall**2)
    drawn = shaped_bottom("cone", area, -0.15).volume_m3([0.0])[0]
    part, part_weight = panels([0.0, 1.0], 20)
    grid = part[:, None] * wall
    by_grid = np.sum(part_weight[:, None] * weight * grid * wall * 0.15 * (1 - part[:, None]))
    circles = np.sum(part_weight[:, None] * weight * grid * wall * 0.15 * (1 - grid / RADIUS))
    figure(
        "cone over an oval of 20 mm: drawn out less circular, L", f"{1e3 * (drawn - circles):.2f}"
    )
    assert drawn == pytest.approx(by_grid, rel=1e-12)
    assert drawn == pytest.approx(circles, abs=2e-4)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("bowl", AREA, 0.1), "expected one of flat, cone, dish"),
        (("flat", AREA, 0.1), "flat bottom with its centre"),
        (("cone", 0.0, 0.1), "bottom of 0 m2"),
        (("cone", AREA, np.nan), "centre at nan"),
        (("dish", AREA, -6.6), "more than half a sphere"),
    ],
)
def test_shapes_that_cannot_be_are_refused(arguments, words):
    with pytest.raises(SolutionError, match=words):
        shaped_bottom(*arguments)


def leaning(slope, n=720):
    """A round leaning shell: its level cut is an ellipse, longer along the lean."""
    azimuth = np.arange(n) * 2 * np.pi / n
    along = np.arctan2(*slope)
    stretch = 1 + slope[0] ** 2 + slope[1] ** 2
    radius = RADIUS / np.sqrt(np.cos(azimuth - along) ** 2 / stretch + np.sin(azimuth - along) ** 2)
    return leaning_bottom(Footprint(0.0, 0.0, radius), slope)


@pytest.mark.parametrize("slope", [(0.03, 0.0), (-0.01, 0.01)])
def test_a_leaning_round_tank_closed_form(slope, figure):
    """The cylindrical hoof: liquid in a leaning cylinder on a plate square to its axis.

    Along the axis (L + x sin a) / cos a deep: the integral over the disc of (L + x sin a)+ / cos a.
    """
    part = leaning(slope)
    lean = np.arctan(np.hypot(*slope))
    levels = RADIUS * np.sin(lean) * np.array([-1.1, -0.99, -0.6, -0.1, 0.0, 0.3, 0.9, 1.0, 3.0])
    start = np.clip(-levels / np.sin(lean), -RADIUS, RADIUS)
    chord = np.sqrt(RADIUS**2 - start**2)
    segment = RADIUS**2 * np.arccos(start / RADIUS) - start * chord
    hoof = (levels * segment + np.sin(lean) * 2 / 3 * chord**3) / np.cos(lean)
    exact = hoof - np.pi * RADIUS**2 / np.cos(lean) * np.maximum(levels, 0)
    worst = np.abs(part.volume_m3(levels) - exact).max()
    figure(
        f"leaning {100 * np.tan(lean):.1f} %, 720 triangles: worst error, L", f"{1e3 * worst:.4f}"
    )
    assert worst < 1e-5 * exact.max()
    assert part.lowest_m == pytest.approx(-RADIUS * np.sin(lean), rel=1e-5)
    assert part.sources(levels) == ()


def test_an_upright_tank_does_not_lean():
    part = leaning((0.0, 0.0))
    assert part.volume_m3(LEVELS) == pytest.approx(0.0, abs=1e-13 * 9.5 * AREA)


def test_derivatives_of_a_leaning_bottom():
    azimuth = np.arange(360) * np.pi / 180

    def part(scale=1.0):
        radius = scale * (RADIUS + 0.03 * np.sin(3 * azimuth))
        return leaning_bottom(Footprint(0.0, 0.0, radius), (0.02, 0.01))

    levels = np.array([-0.2, -0.11, -0.031, 0.042, 0.093, 0.2])
    found = part().derivatives(levels)
    assert_derivative(
        lambda x: part(1 + x[0]).volume_m3(levels), [0.0], found["scale"][:, None], tolerance=1e-6
    )
    assert_derivative(
        lambda x: part().volume_m3(levels + x[0]), [0.0], found["datum"][:, None], tolerance=1e-6
    )
    plan = part().surface.areas_m2.sum()
    assert found["bottom"] == pytest.approx(-found["datum"] - plan * (levels >= 0), abs=1e-9)


def survey(scale=1.0, lift=0.0):
    rng = np.random.default_rng(5)
    rho, azimuth = 6.4 * np.sqrt(rng.uniform(0, 1, 40)), rng.uniform(0, 2 * np.pi, 40)
    plan = np.column_stack([rho * np.sin(azimuth), rho * np.cos(azimuth)])
    heights = -0.12 * (1 - rho / RADIUS) + 0.01 * np.sin(plan[:, 0]) + rng.normal(0, 0.001, 40)
    footprint = Footprint(3.0 * scale, 1.0 * scale, np.full(72, RADIUS * scale))
    points = np.column_stack([scale * (plan + (3.0, 1.0)), heights + lift])
    return surveyed_bottom(footprint, points, 0.001)


@pytest.mark.slow
def test_derivatives_of_a_surveyed_bottom():
    """By the level and by what is surveyed: all points lifted, all plan coordinates stretched."""
    part, levels = survey(), np.array([-0.11, -0.06, -0.021, 0.005, 0.3])
    found, step = part.derivatives(levels), 1e-5
    for name, moved in (
        ("datum", lambda x: part.volume_m3(levels + x[0])),
        ("bottom", lambda x: survey(lift=x[0]).volume_m3(levels)),
        ("scale", lambda x: survey(scale=1 + x[0]).volume_m3(levels)),
    ):
        assert_derivative(moved, [0.0], found[name][:, None], step=step, tolerance=1e-5)


def test_u_of_surveyed_bottom_grows_with_wet_area():
    """Property: none below the surface, common to all rows above it, in two sources."""
    part = survey()
    levels = np.array([part.lowest_m - 0.01, -0.09, -0.05, part.surface.highest_m, 0.3, 9.5])
    points, form = part.sources(levels)
    assert (points.kind, form.kind) == ("bottom_points", "bottom_form")
    for source in (points, form):
        u = np.sqrt(np.sum(source.columns_m3**2, axis=1))
        assert u[0] == 0
        assert np.all(np.diff(u[:4]) > 0)
        assert source.columns_m3[4:] == pytest.approx(source.columns_m3[[3, 3]], abs=1e-12)
