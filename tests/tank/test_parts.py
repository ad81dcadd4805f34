"""Every kind of part fulfils one contract: area, derivatives and sources belong to its volume."""

from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from jacobians import assert_derivative
from shapes import course_of

from tankcal.pipeline.tanks.vertical import widen_bottom
from tankcal.quadrature import panels
from tankcal.tank.body import ShellPart, SolidPart
from tankcal.tank.bottoms import Footprint, leaning_bottom, shaped_bottom, surveyed_bottom
from tankcal.tank.budgets import Factor
from tankcal.tank.fittings import deadwood, floating_roof
from tankcal.tank.heads import End
from tankcal.tank.hydrostatics import liquid_head
from tankcal.tank.meshes import closed_mesh, mesh_part
from tankcal.tank.parts import Part
from tankcal.tank.solids import LyingTank, Sphere
from tankcal.tank.volumes import PartAbove, ShellVolume, measured_bottom

AREA = np.pi * 6.5**2
NAMES = ("plate_thickness", "paint")


@dataclass(frozen=True)
class Example:
    """One kind of part.

    make     takes {input: change} and gives the part with its inputs changed, SI units
    ends_m   levels between which it is checked
    sign     1: its volume does not fall with the level; -1: does not rise; 0: neither
    sources  kinds of its own causes of uncertainty
    steps    {input: step of the differences}
    panels   of the quadrature between two breakpoints, each of 8 nodes
    """

    make: object
    ends_m: tuple
    sign: int
    sources: tuple = ()
    steps: dict = field(default_factory=dict)
    panels: int = 1
    tolerance: float = 1e-9


def shell_volume(scale=1.0, inset=0.01):
    shapes = []
    for bottom, radius in ((0.0, 6.5), (3.0, 6.49)):
        wide = scale * radius
        shapes.append(course_of(bottom, bottom + 3.0, lambda z, wide=wide: wide, inset_m=inset))
    return ShellVolume(tuple(shapes))


def shell(scale=0.0, plate_thickness=0.0, paint=0.0):
    volume = shell_volume(1 + scale, 0.01 + plate_thickness + paint)
    columns = 1e-3 * np.eye(len(volume.features))[:, :2]
    factors = (Factor("points", columns, 8.0), Factor("form", columns))
    return ShellPart(volume, factors, 1.0, 1.1e-5, bearing=NAMES)


def head(youngs_modulus=0.0, liquid_density=0.0, survey_density=0.0, survey_level=0.0):
    return liquid_head(
        shell_volume(),
        [0.008, 0.006],
        206e9 + youngs_modulus,
        850.0 + liquid_density,
        survey_density_kg_m3=1000.0 + survey_density,
        survey_level_m=2.0 + survey_level,
    )


def round_plan(scale=0.0):
    return Footprint(0.0, 0.0, np.full(360, 6.5 * (1 + scale)))


def leaning(scale=0.0):
    return leaning_bottom(round_plan(scale), (0.02, 0.01))


def surveyed(scale=0.0):
    rng = np.random.default_rng(3)
    rho, azimuth = 6.4 * np.sqrt(rng.uniform(0, 1, 30)), rng.uniform(0, 2 * np.pi, 30)
    plan = np.column_stack([rho * np.sin(azimuth), rho * np.cos(azimuth)])
    z = -0.1 * (1 - rho / 6.5) + rng.normal(0, 0.001, 30)
    return surveyed_bottom(round_plan(scale), np.column_stack([(1 + scale) * plan, z]), 0.001)


def items():
    rows = [("column", 0.0, 5.0, -1.0, 0.02), ("coil", 0.5, 1.5, -0.3, np.nan)]
    return deadwood(*zip(*rows, strict=True))


def roof(roof_mass=0.0):
    return floating_roof(9000.0 + roof_mass, 1.2, 1.8, 850.0, "air")


def liquid_zone():
    levels = np.array([0.0, 0.1, 0.25, 0.4])
    return measured_bottom(levels, AREA * levels * (1 + levels / 10), [0.0, 0.01, 0.02, 0.02])


def lying(**changes):
    sizes = {"length": 8.0, "dip_position": 2.0, "tilt": 0.01}
    length, place, tilt = (sizes[name] + changes.get(name, 0.0) for name in sizes)
    size = 2.4 + changes.get("diameter", 0.0)
    ends = [End(kind, 0.5 + changes.get("end_depth", 0.0)) for kind in ("ellipsoidal", "conical")]
    return LyingTank(size, size, length, *ends, tilt=tilt, dip_from_a_m=place)


def tetrahedron(scale=0.0):
    corners = np.array([[0.0, 0, 0], [2, 0, 0.5], [0, 2, 1], [0.5, 0.5, 2]]) * (1 + scale)
    return mesh_part(closed_mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]), 0.0)


def warm_sphere(shell_temperature=0.0, expansion=0.0):
    scale = 1 + (1.1e-5 + expansion) * (12.0 - shell_temperature)
    return SolidPart(Sphere(12.0 * scale), scale, 1.1e-5 + expansion, warmed=True)


EXAMPLES = {
    "shell": Example(
        shell, (0.0, 6.0), 1, ("points", "form"), dict.fromkeys(("scale", *NAMES), 1e-4)
    ),
    "liquid head": Example(
        head, (0.0, 6.0), 0, (),
        {"youngs_modulus": 1e6, "liquid_density": 1.0, "survey_density": 1.0, "survey_level": 1e-4},
        panels=3,  # of 1 m: the area has a kink at the level of the survey
    ),
    "flat bottom": Example(lambda: shaped_bottom("flat", AREA), (-0.1, 6.0), 0),
    "conical bottom": Example(lambda: shaped_bottom("cone", AREA, -0.15), (-0.2, -1e-9), 1),
    "dished bottom": Example(lambda: shaped_bottom("dish", AREA, 0.1), (1e-9, 0.2), -1, panels=64),
    "leaning bottom": Example(leaning, (-0.2, -1e-9), 1, (), {"scale": 1e-6}, 256, 1e-4),
    "surveyed bottom": Example(
        surveyed, (-0.2, -0.02), 1, ("bottom_points", "bottom_form"), {"scale": 1e-6}, 256, 1e-4
    ),
    "widened bottom": Example(
        lambda: widen_bottom(shaped_bottom("cone", AREA, -0.15), shell()), (-0.2, -1e-9), 1
    ),
    "deadwood": Example(items, (-1.0, 6.0), -1, ("deadwood",)),
    "floating roof": Example(roof, (0.0, 6.0), -1, (), {"roof_mass": 10.0}),
    "measured by liquid": Example(
        liquid_zone, (0.0, 1.0), 1, ("bottom_liquid", "bottom_curve"), {}, 64, 1e-6
    ),
    "shell above a zone": Example(
        lambda **changes: PartAbove(shell(**changes), 0.4), (0.4, 6.0), 1, ("points", "form"),
        {"scale": 1e-4, "paint": 1e-4},
    ),
    "lying cylinder": Example(
        lying, (0.05, 2.35), 1, (),
        dict.fromkeys(("diameter", "length", "end_depth", "tilt", "dip_position"), 1e-5),
        panels=64, tolerance=1e-6,
    ),
    "sphere": Example(
        lambda diameter=0.0: Sphere(12.0 + diameter), (0.0, 12.0), 1, (), {"diameter": 1e-4}
    ),
    "mesh": Example(tetrahedron, (0.0, 1.99), 1, (), {"scale": 1e-6}, 200, 1e-6),
    "warm solid": Example(
        warm_sphere, (0.0, 12.0), 1, (), {"shell_temperature": 1e-2, "expansion": 1e-8}
    ),
}  # fmt: skip


@cache
def part_of(name):
    return EXAMPLES[name].make()


def smooth_pieces(name):
    """Neighbouring levels between which the area of the part does not jump."""
    example, part = EXAMPLES[name], part_of(name)
    low, high = example.ends_m
    edges = sorted({low, high, *(e for e in part.breakpoints_m if low < e < high)})
    return np.unique([np.linspace(*ends, example.panels + 1) for ends in pairwise(edges)])


def levels_of(name):
    """Levels beside the breakpoints, for differences."""
    low, high = EXAMPLES[name].ends_m
    levels = low + (high - low) * (np.arange(9) + 0.37) / 9
    edges = np.array([*part_of(name).breakpoints_m, np.inf])
    return levels[np.abs(levels[:, None] - edges).min(axis=1) > 1e-3]


def quadratures_of_area(name):
    edges = smooth_pieces(name)
    nodes, weights = panels(edges, 8)
    return edges, (weights * part_of(name).area_m2(nodes)).reshape(-1, 8).sum(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_volume_is_the_integral_of_the_area(name):
    """Second method: Gauss quadrature of the area, between levels where it jumps."""
    part, example = part_of(name), EXAMPLES[name]
    edges, found = quadratures_of_area(name)
    rise = np.array([part.volume_m3([e])[0] for e in edges])
    steps = np.concatenate([[0.0], np.cumsum(found)])
    largest = max(np.abs(rise - rise[0]).max(), 1e-3)
    assert np.abs(rise - rise[0] - steps).max() < example.tolerance * largest


@pytest.mark.parametrize("name", EXAMPLES)
def test_volume_rises_or_falls_with_the_level(name):
    volume = part_of(name).volume_m3(np.linspace(*EXAMPLES[name].ends_m, 200))
    slack = 1e-9 * max(np.abs(volume).max(), 1.0)
    sign = EXAMPLES[name].sign
    assert sign == 0 or np.all(sign * np.diff(volume) >= -slack)


@pytest.mark.parametrize("name", EXAMPLES)
def test_derivative_by_the_datum_is_that_by_the_level(name):
    part, levels = part_of(name), levels_of(name)
    by_level = part.area_by(part.derivatives(levels), levels)
    assert by_level == pytest.approx(part.area_m2(levels), rel=1e-12, abs=1e-12)
    assert part.moves_with_zero == ("datum" not in part.derivatives(levels))
    if np.any(by_level):
        assert_derivative(
            lambda x: part.volume_m3(levels + x[0]), [0.0], by_level[:, None], step=1e-6,
            tolerance=1e-5,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "by"), [(name, by) for name, example in EXAMPLES.items() for by in example.steps]
)
def test_derivative_by_each_input(name, by):
    example, levels = EXAMPLES[name], levels_of(name)
    analytic = np.asarray(part_of(name).derivatives(levels)[by])[:, None]
    assert_derivative(
        lambda x: example.make(**{by: x[0]}).volume_m3(levels), [0.0], analytic,
        step=example.steps[by], tolerance=2e-5,
    )  # fmt: skip


@pytest.mark.parametrize("name", EXAMPLES)
def test_sources_have_a_row_for_each_level(name):
    part, levels = part_of(name), levels_of(name)
    sources = part.sources(levels)
    assert tuple(dict.fromkeys(one.kind for one in sources)) == EXAMPLES[name].sources
    assert all(one.columns_m3.shape[0] == len(levels) for one in sources)


@pytest.mark.parametrize("name", EXAMPLES)
def test_parts_fulfil_the_contract_and_name_their_kind(name):
    assert Part in type(part_of(name)).__mro__
    assert part_of(name).kind in ("wall", "bottom", "deadwood", "roof")


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_step_of_zero_moves_no_volume(name):
    part, levels = part_of(name), levels_of(name)
    low, high = EXAMPLES[name].ends_m
    moved = part.moved_m3(levels, np.zeros(len(levels)), low, high)
    assert moved == pytest.approx(part.volume_m3(levels), abs=1e-12)
