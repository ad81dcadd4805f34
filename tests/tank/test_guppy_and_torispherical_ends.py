"""Guppy ends, and torispherical ends by two of three sizes: closed form, mesh, differences."""

from dataclasses import replace

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.errors import SolutionError
from tankcal.tank.heads import STANDARDS, End, depth_of, standard_end, torispherical_radii
from tankcal.tank.meshes.part import Mesh, mesh_part
from tankcal.tank.solids import LyingTank

trimesh = pytest.importorskip("trimesh")

R, H, L = 1.0, 0.6, 5.0
DIPS = np.array([0.07, 0.31, 0.86, 1.13, 1.52])


def test_a_full_guppy_end_is_a_cone_closed_form():
    """An oblique cone holds what a right one does: pi R^2 h / 3."""
    tank = LyingTank(2.0, 2.0, L, End("guppy", H))
    assert tank.capacity_m3 == pytest.approx(np.pi * (L + H / 3), rel=1e-14)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_a_level_guppy_end_closed_form(share):
    """Jones 2001: a R^2/3 acos(1 - h/R) + a/(9R) sqrt(2Rh - h^2) (2h - 3R)(h + R), of one end."""
    h = 2 * share
    cone = H / 3 * np.arccos(1 - h) + H / 9 * np.sqrt(2 * h - h**2) * (2 * h - 3) * (h + 1)
    found = LyingTank(2.0, 2.0, L, End("guppy", H)).volume_m3([h])
    assert found - LyingTank(2.0, 2.0, L).volume_m3([h]) == pytest.approx(cone, rel=1e-12)


def guppy_mesh(tilt, roll, count=720):
    """A prism of `count` sides between two tips on its crown, turned: vertices by rotations."""
    turn = np.arange(count) * 2 * np.pi / count
    ring = np.column_stack([0 * turn, np.sin(turn), np.cos(turn)])
    vertices = np.vstack([ring, ring + (L, 0, 0), [(-H, 0, R), (L + H, 0, R)]])
    one, other = np.arange(count), np.roll(np.arange(count), -1)
    first, last = np.full(count, 2 * count), np.full(count, 2 * count + 1)
    faces = np.vstack([
        np.column_stack([one, other + count, other]),
        np.column_stack([one, one + count, other + count]),
        np.column_stack([first, one, other]),
        np.column_stack([last, other + count, one + count]),
    ])  # fmt: skip
    mesh = trimesh.Trimesh(vertices, faces, process=True)
    if mesh.volume < 0:
        mesh.invert()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(roll, (1, 0, 0)))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.arctan(tilt), (0, 1, 0)))
    assert mesh.is_watertight
    return mesh


def volumes_below(mesh, z):
    """By the divergence theorem over its triangles (`mesh_part`, proved by itself)."""
    part = mesh_part(Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), 1, ()), 0.0)
    return part.volume_m3(z)


@pytest.mark.parametrize(("tilt", "roll"), [(0.0, 0.0), (0.05, 0.0), (-0.12, 0.5), (0.03, 2.0)])
def test_tilted_and_rolled_guppy_ends_against_a_mesh(tilt, roll, figure):
    """Truth: the volume of a mesh of 720 sides; its sections lack 1.3e-5."""
    tank = LyingTank(2.0, 2.0, L, End("guppy", H), End("guppy", H), tilt, roll, 2.0)
    mesh = guppy_mesh(tilt, roll)
    angle = np.arctan(tilt)
    bottom = 2.0 * np.sin(angle) - R * np.cos(angle)
    below = volumes_below(mesh, bottom + DIPS)
    worst = np.abs(tank.volume_m3(DIPS) - below).max() / tank.capacity_m3
    figure(f"guppy, tilt {tilt}, roll {roll}, against a mesh of 720 sides", f"{worst:.1e}")
    assert worst < 1.5e-5
    assert mesh.volume == pytest.approx(tank.capacity_m3, rel=1.5e-5)


@pytest.mark.parametrize("tilt", [0.0, 0.07])
@pytest.mark.parametrize("roll", [0.0, 0.8])
def test_derivatives_with_guppy_ends(tilt, roll):
    names = ["diameter", "end_depth", "length", "tilt", "dip_position"]

    def volume(x):
        wide, deep, long, lean, place = x
        end = End("guppy", H + deep)
        tank = LyingTank(2 + wide, 2 + wide, L + long, end, end, tilt + lean, roll, 1.8 + place)
        return tank.volume_m3(DIPS)

    end = End("guppy", H)
    found = LyingTank(2.0, 2.0, L, end, end, tilt, roll, 1.8).derivatives(DIPS)
    analytic = np.column_stack([found[name] for name in names])
    assert_derivative(volume, np.zeros(5), analytic, step=3e-5)


# torispherical ends by two of three sizes

FULL = End("torispherical", dish_radius_m=2.0, knuckle_radius_m=0.2)
DEPTH = 2 * (1 - np.sqrt(0.65))  # closed form of dish D and knuckle D / 10
BY = {
    "radii": FULL,
    "dish": End("torispherical", DEPTH, dish_radius_m=2.0),
    "knuckle": End("torispherical", DEPTH, knuckle_radius_m=0.2),
}


@pytest.mark.parametrize("given", BY)
def test_two_of_three_sizes_give_the_same_end(given):
    end = BY[given]
    assert torispherical_radii(1.0, end.depth_m, end.dish_radius_m, end.knuckle_radius_m) == (
        pytest.approx((2.0, 0.2), rel=1e-13)
    )
    assert depth_of(end, 1.0) == pytest.approx(DEPTH, rel=1e-14)
    tank = LyingTank(2.0, 2.0, L, end, end, 0.03, dip_from_a_m=2.0)
    expected = replace(tank, end_a=FULL, end_b=FULL).volume_m3(DIPS)
    assert tank.volume_m3(DIPS) == pytest.approx(expected, rel=1e-13)


def test_standard_ends_have_the_depths_of_their_standards():
    """DIN 28011: 0.1935 D; DIN 28013: 0.2545 D; ASME 6 %: 0.1693 D (f - sqrt(...))."""
    depths = {
        name: depth_of(standard_end(End("torispherical"), name, 2.0), 1.0) / 2 for name in STANDARDS
    }
    expected = {"asme": 0.1693, "din_28011": 0.1938, "din_28013": 0.2545}
    assert depths == pytest.approx(expected, abs=5e-5)


def test_a_standard_end_of_a_measured_depth_keeps_its_knuckle():
    end = standard_end(End("torispherical", 0.40), "din_28011", 2.0)
    assert (end.dish_radius_m, end.knuckle_radius_m) == (None, 0.2)
    assert depth_of(end, 1.0) == pytest.approx(0.40, rel=1e-13)


GIVEN = {
    "radii": ("dish", "knuckle"),
    "dish": ("end_depth", "dish"),
    "knuckle": ("end_depth", "knuckle"),
}
FIELDS = {
    "dish": "dish_radius_m",
    "knuckle": "knuckle_radius_m",
    "end_depth": "depth_m",
}


@pytest.mark.parametrize("given", GIVEN)
@pytest.mark.parametrize("tilt", [0.0, 0.06])
def test_derivatives_by_the_sizes_that_were_given(given, tilt):
    """The third size follows in the differences: they hold what was given, nothing else."""
    names = ["diameter", *GIVEN[given], "plate_thickness"]

    def volume(x):
        wide, *sizes, plate = x
        end = BY[given]
        for name, size in zip(GIVEN[given], sizes, strict=True):
            key = FIELDS[name]
            end = replace(end, **{key: getattr(end, key) + size - plate})
        across = 2.0 + wide - 2 * plate
        return LyingTank(across, across, L, end, end, tilt, 0.0, 1.8).volume_m3(DIPS)

    end = BY[given]
    found = LyingTank(2.0, 2.0, L, end, end, tilt, 0.0, 1.8).derivatives(DIPS)
    analytic = np.column_stack([found[name] for name in names])
    assert_derivative(volume, np.zeros(len(names)), analytic, step=1e-5, tolerance=1e-6)


@pytest.mark.parametrize(
    ("sizes", "words"),
    [
        ((0.39, 2.0, 0.2), "two of three sizes"),
        ((0.39,), "two of three sizes"),
        ((0.0, 2.0), "two of three sizes"),
        ((0.26, 2.0), "more than 0.267949 m"),
        ((1.0, 2.0), "less than the radius"),
        ((0.19, None, 0.2), "more than 0.2 m"),
        ((1.1, None, 0.2), "less than the radius"),
        ((np.nan, None, 0.2), "torispherical end nan m deep"),
        ((0.3, -2.0), "torispherical end 0.3 m deep"),
        ((0.3, None, -0.2), "torispherical end 0.3 m deep"),
    ],
)
def test_sizes_of_no_torispherical_end_are_refused(sizes, words):
    with pytest.raises(SolutionError, match=words):
        depth_of(End("torispherical", *sizes), 1.0)
