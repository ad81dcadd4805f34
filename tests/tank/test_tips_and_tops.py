"""Heads of upright tanks: closed forms, another program, meshes, differences; tops on a shell."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from jacobians import assert_derivative
from shapes import course_of

from tankcal.errors import HeightError, SolutionError
from tankcal.tank.body import ShellPart
from tankcal.tank.bottoms import shaped_bottom
from tankcal.tank.budgets import Factor
from tankcal.tank.heads import End, standard_end
from tankcal.tank.hydrostatics import liquid_head
from tankcal.tank.meshes.part import Mesh, mesh_part
from tankcal.tank.tips import FORMS, HeadedShell, tip_of
from tankcal.tank.volumes import ShellVolume

R, D = 1.5, 3.0
PLAN = np.pi * R**2
HEADS = {  # (depth, dish, knuckle)
    "cone": (2.6, None, None),
    "dish": (0.4, None, None),
    "ellipsoidal": (0.75, None, None),
    "torispherical": (0.0, D, 0.3),
}
LEVELS = np.array([-2.7, -0.5, -0.33, -0.1, 0.0, 0.2, 0.45, 3.0])
FILLS = np.array([0.02, 0.2, 0.45, 0.6, 0.9, 1.0, 1.7, 4.0])


def test_full_heads_closed_form():
    """A h / 3; pi h (3 R^2 + h^2) / 6; 2 A h / 3; rule of thumb of DIN 28011: 0.1 D^3."""
    full = {form: float(tip_of(form, PLAN, *HEADS[form]).beyond_m3(0.0)) for form in HEADS}
    assert full["cone"] == pytest.approx(PLAN * 2.6 / 3, rel=1e-14)
    assert full["dish"] == pytest.approx(np.pi * 0.4 * (3 * R**2 + 0.16) / 6, rel=1e-14)
    assert full["ellipsoidal"] == pytest.approx(PLAN * 0.5, rel=1e-14)
    assert full["torispherical"] / D**3 == pytest.approx(0.1, rel=0.015)


def test_a_torispherical_head_near_a_hemisphere_closed_form():
    """Dish and knuckle of nearly R: half a sphere."""
    tip = tip_of("torispherical", PLAN, 0.0, R * (1 + 1e-9), R * (1 - 1e-9))
    assert tip.beyond_m3(0.0) == pytest.approx(2 * np.pi * R**3 / 3, rel=1e-8)


@pytest.mark.parametrize("form", ["cone", "dish", "ellipsoidal"])
@pytest.mark.parametrize("depth", [0.1, 0.8, 1.5])
@pytest.mark.parametrize("way", ["down", "up"])
def test_bottoms_other_program(form, depth, way, figure):
    """Truth: fluids. Above the edge its tank is a cylinder; a bottom up takes from it."""
    geometry = pytest.importorskip("fluids.geometry")
    name = f"V_vertical_{FORMS[form]}" + ("_concave" if way == "up" else "")
    levels = FILLS - depth if way == "down" else FILLS
    bottom = shaped_bottom(form, PLAN, depth if way == "up" else -depth)
    found = bottom.volume_m3(levels) + PLAN * np.maximum(levels, 0)
    sign = -1 if way == "up" else 1  # it counts the depth of a concave one below 0
    expected = [getattr(geometry, name)(D, sign * depth, fill) for fill in FILLS]
    assert np.abs(found / expected - 1).max() < 1e-9


@pytest.mark.parametrize(("f", "k"), [(1.0, 0.1), (1.0, 0.06), (0.8, 0.154), (0.9, 0.17)])
@pytest.mark.parametrize("way", ["down", "up"])
def test_torispherical_bottoms_other_program(f, k, way, figure):
    geometry = pytest.importorskip("fluids.geometry")
    other = geometry.V_vertical_torispherical
    tip = tip_of("torispherical", PLAN, 0.0, f * D, k * D)
    bottom = shaped_bottom("torispherical", PLAN, 0.0, f * D, k * D)
    levels = FILLS - tip.depth_m
    if way == "up":
        other, levels = geometry.V_vertical_torispherical_concave, FILLS
        bottom = shaped_bottom("torispherical", PLAN, tip.depth_m, f * D)
    found = bottom.volume_m3(levels) + PLAN * np.maximum(levels, 0)
    worst = np.abs(found / [other(D, f, k, fill) for fill in FILLS] - 1).max()
    figure(f"upright torispherical {way}, f {f}, k {k}, against fluids", f"{worst:.1e}")
    assert worst < 1e-9


def head_mesh(form, count=360, rings=400):
    """A head turned about z, its tip down at -h: many rings, from its own profile."""
    trimesh = pytest.importorskip("trimesh")
    tip = tip_of(form, PLAN, *HEADS[form])
    share = np.sin(np.linspace(0, np.pi / 2, rings))
    z = -tip.depth_m * share[::-1]
    profile = np.column_stack([profile_of(form, -z, tip.depth_m), z])
    profile[0, 0] = 0.0
    closed = np.vstack([profile, [(0.0, 0.0)]])
    mesh = trimesh.creation.revolve(closed, sections=count)
    return tip, mesh


def profile_of(form, x, h):
    """r(x) by the equation of each form."""
    if form == "cone":
        return R * (1 - x / h)
    if form == "ellipsoidal":
        return R * np.sqrt(np.maximum(1 - (x / h) ** 2, 0))
    if form == "dish":
        ball = (R**2 + h**2) / (2 * h)
        return np.sqrt(np.maximum(ball**2 - (x - h + ball) ** 2, 0))
    f, k = D, 0.3
    knuckle = R - k + np.sqrt(np.maximum(k**2 - x**2, 0))
    dish = np.sqrt(np.maximum(f**2 - (x - h + f) ** 2, 0))
    return np.where(x < k * (f - h) / (f - k), knuckle, dish)


@pytest.mark.slow
@pytest.mark.parametrize("form", HEADS)
def test_heads_against_a_mesh(form, figure):
    """Truth: a mesh of 360 sides; these lack 5.1e-5 of the areas, and its rings a little."""
    tip, mesh = head_mesh(form)
    part = mesh_part(Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), 1, ()), 0.0)
    levels = -tip.depth_m * np.array([0.9, 0.5, 0.2, 0.0])
    bottom = shaped_bottom(form, PLAN, -HEADS[form][0], *HEADS[form][1:])
    found, expected = bottom.volume_m3(levels), part.volume_m3(levels)
    worst = np.abs(found - expected).max() / found[-1]
    figure(f"{form} against a mesh of 360 x 400 faces", f"{worst:.1e}")
    assert worst < 7e-5
    assert abs(mesh.volume) == pytest.approx(found[-1], rel=7e-5)


GIVEN = {
    **HEADS,
    "torispherical by depth and dish": (0.6, D, None),
    "torispherical by depth and knuckle": (0.6, None, 0.3),
}


@pytest.mark.parametrize("given", GIVEN)
@pytest.mark.parametrize("way", [-1, 1])
def test_derivatives_of_bottoms_by_their_sizes(given, way):
    """Levels held; what was not given follows in the differences."""
    form, sizes = given.split()[0], GIVEN[given]
    if way > 0 and not sizes[0]:
        pytest.skip("a torispherical bottom of given radii bulges down")
    inputs = [("bottom_depth", 0), ("dish", 1), ("knuckle", 2)]
    inputs = [(name, place) for name, place in inputs if sizes[place]]
    between = LEVELS[np.abs(LEVELS) > 0.05]

    def volume(x):
        scale, *changes = x
        moved = list(sizes)
        for (_, place), change in zip(inputs, changes, strict=True):
            moved[place] += change
        return shaped_bottom(form, PLAN * (1 + scale) ** 2, way * moved[0], *moved[1:]).volume_m3(
            between
        )

    found = shaped_bottom(form, PLAN, way * sizes[0], *sizes[1:]).derivatives(between)
    analytic = np.column_stack([found[name] for name in ("scale", *(name for name, _ in inputs))])
    start = np.zeros(1 + len(inputs))
    assert_derivative(volume, start, analytic, step=1e-6, tolerance=1e-6)


def test_stretching_a_head_of_given_radii():
    """The same cuts, h / h0 times as far: V(x) = t V0(x / t), at x = 0 the derivative is V0 / h."""
    tip = tip_of("torispherical", PLAN, *HEADS["torispherical"])
    found = tip.derivatives(0.0)["depth"] * tip.depth_m
    assert found == pytest.approx(tip.beyond_m3(0.0), rel=1e-12)


def test_sizes_of_no_head_are_refused():
    with pytest.raises(SolutionError, match="more than half a sphere"):
        tip_of("dish", PLAN, 1.6)
    with pytest.raises(SolutionError, match="two of three"):
        tip_of("torispherical", PLAN, 0.5)
    with pytest.raises(SolutionError, match="less than the radius"):
        tip_of("torispherical", PLAN, 1.6, D)


# heads on a shell

H = 4.0


def shell_of(radius=R, scale=1.0, stretch=1.0, bearing=(), heights=(2.5, 1.5), inset=0.0):
    edges = stretch * np.concatenate([[0.0], np.cumsum(heights)])
    courses = tuple(
        course_of(low, high, lambda z: radius, inset_m=inset, scale=scale)
        for low, high in pairwise(edges)
    )
    volume = ShellVolume(courses)
    factor = Factor("points", 1e-3 * np.eye(len(volume.features)))
    return ShellPart(volume, (factor,), scale, 1.1e-5, stretch, bearing)


def headed(form="ellipsoidal", sizes=None, **shell):
    shell = shell_of(**shell)
    plan = float(shell.volume.top_weights @ shell.volume.features)
    sizes = [one and shell.stretch * one for one in sizes or HEADS[form]]
    return HeadedShell(shell, tip_of(form, plan, *sizes))


@pytest.mark.parametrize("form", HEADS)
def test_a_shell_with_a_head_closed_form(form):
    """The shell below its top, all of it with the head's share above: fluids' tanks upside down."""
    part = headed(form)
    tip = part.tip
    assert part.volume_m3([1.0, H])[0] == pytest.approx(PLAN, rel=1e-12)
    assert part.volume_m3([H]) == pytest.approx(PLAN * H, rel=1e-12)
    full = PLAN * H + tip.beyond_m3(0.0)
    assert part.volume_m3([part.highest_m]) == pytest.approx(full, rel=1e-12)
    upside_down = shaped_bottom(form, PLAN, -HEADS[form][0], *HEADS[form][1:])
    x = 0.3
    expected = PLAN * H + upside_down.volume_m3([0.0]) - upside_down.volume_m3([-x])
    assert part.volume_m3([H + x]) == pytest.approx(expected, rel=1e-12)


ABOVE = np.array([1.0, 3.9, 4.05, 4.2, 4.35])


@pytest.mark.parametrize("form", HEADS)
def test_derivatives_of_a_headed_shell(form):
    """By level, plan, course heights and sizes; stretch and scale by temperature."""
    sizes = HEADS[form]
    inputs = [("top_depth", 0), ("dish", 1), ("knuckle", 2)]
    inputs = [(name, place) for name, place in inputs if sizes[place]]

    def volume(x):
        level, offset, plate, first, second, *changes = x
        moved = list(sizes)
        for (_, place), change in zip(inputs, changes, strict=True):
            moved[place] += change
        part = headed(form, moved, radius=R + offset, inset=0.01 + plate,
                      heights=(2.5 + first, 1.5 + second))  # fmt: skip
        return part.volume_m3(ABOVE + level)

    part = headed(form, inset=0.01, bearing=("plate_thickness",))
    found = part.derivatives(ABOVE)
    columns = [found[name] for name in ("datum", "offset", "plate_thickness")]
    columns += [found["course_heights"], *(found[name] for name, _ in inputs)]
    analytic = np.column_stack(columns)
    assert_derivative(volume, np.zeros(5 + len(inputs)), analytic, step=1e-6, tolerance=1e-6)
    assert part.area_m2(ABOVE) == pytest.approx(found["datum"])


@pytest.mark.parametrize("form", HEADS)
@pytest.mark.parametrize("with_heights", [False, True])
def test_temperature_of_a_headed_shell(form, with_heights):
    """Scale 1 + a (T0 - T), of heights, too, where they expand."""
    alpha = 1.1e-5

    def volume(x):
        scale = 1 + alpha * (20 - 30 - x[0])
        return headed(form, scale=scale, stretch=scale if with_heights else 1.0).volume_m3(ABOVE)

    scale = 1 - 10 * alpha
    stretch = scale if with_heights else 1.0
    part = headed(form, scale=scale, stretch=stretch, bearing=("shell_temperature", "expansion"))
    found = part.derivatives(ABOVE)["shell_temperature"]
    assert_derivative(volume, [0.0], found[:, None], step=1.0, tolerance=1e-5)
    by_alpha = part.derivatives(ABOVE)["expansion"]
    assert by_alpha == pytest.approx(found * -10 / -alpha, rel=1e-3)


@pytest.mark.parametrize("form", HEADS)
def test_the_plan_of_the_head_goes_with_the_survey(form):
    """The columns of the points, against differences by the features of the shell."""
    part = headed(form)
    features = part.shell.volume.features
    found = part.sources(ABOVE)[0].columns_m3 / 1e-3

    def volume(x):
        courses = tuple(
            replace(one, outlines_m=np.sqrt((features + x)[i * n : (i + 1) * n, None] / np.pi)
                    * np.ones((1, 72)))
            for i, one in enumerate(part.shell.volume.courses)
        )  # fmt: skip
        changed = replace(part.shell, volume=ShellVolume(courses))
        plan = float(changed.volume.top_weights @ changed.volume.features)
        return HeadedShell(changed, tip_of(form, plan, *HEADS[form])).volume_m3(ABOVE)

    n = len(features) // 2
    assert_derivative(volume, np.zeros(len(features)), found, step=1e-5, tolerance=1e-6)


def test_a_level_above_the_head_is_refused():
    with pytest.raises(HeightError, match="above the head"):
        headed().volume_m3([H + 0.76])


def test_liquid_in_the_head_loads_the_shell_closed_form():
    """Empty survey, one plate: V = integral over the shell of girth K rho (h - z) + pi d^2."""
    volume = shell_of().volume
    head = liquid_head(volume, [0.006, 0.006], 206e9, 900.0, headroom_m=0.75)
    h, k = 4.6, 9.80665 * 900.0 * R**2 / (206e9 * 0.006)
    z, w = np.polynomial.legendre.leggauss(20)
    z, w = H / 2 * (1 + z), H / 2 * w
    widening = k * (h - z)
    expected = w @ (2 * np.pi * R * widening + np.pi * widening**2)
    assert head.volume_m3([h]) == pytest.approx(expected, rel=1e-10)
    slope = (head.volume_m3([h + 1e-4]) - head.volume_m3([h - 1e-4])) / 2e-4
    assert head.area_m2([h]) == pytest.approx(slope, rel=1e-6)
    plain = liquid_head(volume, [0.006, 0.006], 206e9, 900.0)
    assert head.volume_m3([3.0]) == pytest.approx(plain.volume_m3([3.0]), rel=1e-15)


def test_a_standard_head_of_a_measured_depth():
    end = standard_end(End("torispherical", 0.59), "din_28011", D)
    tip = tip_of("torispherical", PLAN, end.depth_m, end.dish_radius_m, end.knuckle_radius_m)
    assert tip.depth_m == 0.59
    assert tip.sizes_m == {"depth": 0.59, "knuckle": pytest.approx(0.3)}
