"""The parts of a tank together: shared inputs move all of them at once."""

from dataclasses import dataclass

import numpy as np
import pytest
from jacobians import assert_derivative
from shapes import course_of

from tankcal.tank.body import Body, ShellPart, SolidPart
from tankcal.tank.budgets import Factor
from tankcal.tank.parts import Part
from tankcal.tank.solids import Sphere
from tankcal.tank.volumes import ShellVolume
from tankcal.uncertainty import Source


class Declared:
    u_as_read, unit, note = 1.0, "x", ""
    type, distribution, dof, is_default, u_is = "B", "normal", np.inf, False, "scale"

    def __init__(self, name, u=1.0):
        self.name, self.u = name, u


@dataclass(frozen=True)
class Slab(Part):
    """A part of constant area whose volume grows with a shared input."""

    area: float
    gain: float

    def volume_m3(self, levels_m):
        return self.area * np.asarray(levels_m)

    def area_m2(self, levels_m):
        return np.full(len(levels_m), self.area)

    def derivatives(self, levels_m):
        return {"scale": self.gain * np.asarray(levels_m), "datum": self.area_m2(levels_m)}

    def sources(self, levels_m):
        return (Source("points", np.ones((len(levels_m), 1))),)


LEVELS = np.array([1.0, 2.0, 4.0])


def test_a_shared_input_is_one_column_and_moves_all_parts():
    body = Body((Slab(10.0, 3.0), Slab(-1.0, 4.0)), (Declared("scale", 0.5),), 0.0, 4.0)
    sources = body.sources(LEVELS)
    scale = [source for source in sources if source.kind == "scale"]
    assert len(scale) == 1
    assert scale[0].columns_m3[:, 0] == pytest.approx(0.5 * (3.0 + 4.0) * LEVELS)  # not in squares
    assert body.volume_m3(LEVELS) == pytest.approx(9.0 * LEVELS)
    assert body.area_m2(LEVELS) == pytest.approx([9.0] * 3)


def test_rows_are_volumes_areas_and_sources_at_one_go():
    body = Body((Slab(10.0, 3.0), shell()), (Declared("scale", 0.5),), 0.0, 4.0)
    volume, area, sources = body.rows(LEVELS)
    assert np.array_equal(volume, body.volume_m3(LEVELS))
    assert np.array_equal(area, body.area_m2(LEVELS))
    for one, other in zip(sources, body.sources(LEVELS), strict=True):
        assert np.array_equal(one.columns_m3, other.columns_m3)


def test_relevant_undeclared_inputs_are_named():
    body = Body((Slab(10.0, 3.0),), (Declared("scale"),), 0.0, 4.0)
    assert body.undeclared() == ("datum",)
    assert Body((Slab(10.0, 0.0),), (), 0.0, 4.0).undeclared() == ("datum",)  # scale moves nothing


@pytest.mark.parametrize(("courses", "named"), [(1, False), (2, True)])
def test_course_heights_affect_even_a_perfect_shell(courses, named):
    shapes = [course_of(i, i + 1, lambda z: 6.5) for i in range(courses)]
    perfect = ShellPart(ShellVolume(tuple(shapes)), (), 1.0, 1.1e-5)
    assert not perfect.derivatives(LEVELS / 4)["course_heights"].any()
    body = Body((perfect,), (), 0.0, float(courses))
    assert ("course_heights" in body.undeclared()) == named


def test_irrelevant_declared_input_changes_nothing():
    body = Body((Slab(10.0, 3.0),), (Declared("roof_mass"),), 0.0, 4.0)
    assert [source.kind for source in body.sources(LEVELS)] == ["points"]


def shell(inset=0.008, temperature=12.0, expansion=1.1e-5, radius=6.5, heights=False):
    scale = 1 + expansion * temperature
    stretch = scale if heights else 1.0
    course = course_of(0, 9.5 * stretch, lambda z: radius, inset_m=inset, scale=scale)
    names = ("plate_thickness", "paint", "shell_temperature", "expansion")
    return ShellPart(ShellVolume((course,)), (), scale, expansion, stretch, names)


@pytest.mark.parametrize("heights", [False, True], ids=["2a", "3a"])
@pytest.mark.parametrize(
    ("name", "vary", "at", "step"),
    [
        ("plate_thickness", lambda x, h: shell(inset=x, heights=h), 0.008, 1e-5),
        ("paint", lambda x, h: shell(inset=x, heights=h), 0.008, 1e-5),
        ("expansion", lambda x, h: shell(expansion=x, heights=h), 1.1e-5, 1e-7),
        ("shell_temperature", lambda x, h: shell(temperature=12.0 - x, heights=h), 0.0, 1e-2),
    ],
)
def test_derivatives_by_corrections_of_the_shell(name, vary, at, step, heights):
    """Against differences of the volume itself."""
    levels = np.array([0.5, 9.4])
    analytic = shell(heights=heights).derivatives(levels)[name][:, None]
    assert_derivative(
        lambda x: vary(x[0], heights).volume_m3(levels), [at], analytic, step=step, tolerance=2e-5
    )


def test_derivatives_by_scale_and_datum_closed_form():
    level = np.array([4.0])
    found = shell(inset=0.0)
    volume, area = found.volume_m3(level)[0], found.area_m2(level)[0]
    assert found.derivatives(level)["scale"][0] == pytest.approx(2 * volume)
    assert found.derivatives(level)["datum"][0] == pytest.approx(area)
    stretched = shell(inset=0.0, radius=6.5 * (1 + 1e-6)).volume_m3(level)[0]
    by_difference = (stretched - volume) / 1e-6
    assert found.derivatives(level)["scale"][0] == pytest.approx(by_difference, rel=1e-5)


def test_below_the_bottom_a_shell_has_nothing_and_no_uncertainty():
    levels = np.array([-0.02, 0.0, 1.0])
    found = shell()
    assert found.volume_m3(levels)[0] == found.area_m2(levels)[0] == 0.0
    assert found.derivatives(levels)["datum"][0] == 0.0
    assert found.derivatives(levels)["datum"][2] > 100


def sphere(diameter=20.0, temperature=0.0):
    scale = 1 + 1.1e-5 * temperature
    return SolidPart(Sphere(diameter * scale), scale, 1.1e-5, warmed=True)


def test_a_solid_grows_with_its_temperature_in_all_directions():
    levels = np.array([5.0, 19.0])
    analytic = sphere(temperature=12.0).derivatives(levels)["shell_temperature"][:, None]
    assert_derivative(
        lambda x: sphere(temperature=12.0 - x[0]).volume_m3(levels),
        [0.0], analytic, step=1e-2, tolerance=1e-5,
    )  # fmt: skip


def test_surveyed_sizes_of_solid_are_sources_not_inputs():
    levels = np.array([5.0, 19.0])
    plain = sphere()
    found = SolidPart(
        Sphere(20.0), surveyed=("diameter",), factors=(Factor("points", np.array([[0.001]]), 8.0),)
    )
    assert "diameter" not in found.derivatives(levels)
    (points,) = found.sources(levels)
    assert points.dof == 8.0
    assert points.columns_m3[:, 0] == pytest.approx(0.001 * plain.derivatives(levels)["diameter"])
