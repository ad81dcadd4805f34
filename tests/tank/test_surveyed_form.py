"""The form of a surveyed wall about its solid: volumes, areas and derivatives."""

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.tank.body import SolidPart
from tankcal.tank.budgets import Factor
from tankcal.tank.solids import NODES, End, LyingTank, Sphere, SurveyedForm, node_levels

LYING = LyingTank(2.4, 2.4, 8.0, End("flat"), End("ellipsoidal", 0.5), 0.004, 0.0, 3.0)
SOLIDS = (LYING, LyingTank(2.4, 2.4, 8.0), Sphere(6.0))


def form_of(solid, widening=0.004, higher=0.006):
    """A wall that is an affine image of the solid, to first order: wider and higher."""
    levels = node_levels(solid.top_m)
    volume, area = solid.volume_m3(levels), solid.area_m2(levels)
    added = 2 * widening / solid.top_m * volume + higher / solid.top_m * (volume - area * levels)
    columns = np.linspace(0.0, 1.0, NODES)[:, None] * 1e-3
    return SurveyedForm.of_volumes(
        volume, area, solid.top_m, added, higher, (Factor("points", columns),)
    )


@pytest.mark.parametrize("solid", SOLIDS)
def test_an_affine_image_of_a_solid_is_found(solid):
    """Closed form: V(d T / H) times what it is wider and higher."""
    part = SolidPart(solid, surveyed=("diameter",), form=form_of(solid))
    assert part.top_m == pytest.approx(solid.top_m + 0.006)
    levels = np.linspace(0, 1, 23) * part.top_m
    larger = 1 + (2 * 0.004 + 0.006) / solid.top_m
    expected = larger * solid.volume_m3(levels * solid.top_m / part.top_m)
    assert part.volume_m3(levels) == pytest.approx(expected, rel=1e-9)
    assert part.capacity_m3 == pytest.approx(larger * solid.capacity_m3, rel=1e-9)


def bent(solid):
    """A form with a bend of its own, as a flat bottom and a dent make it."""
    t = np.linspace(0, np.pi, NODES)
    return SurveyedForm(1.002, 0.001, 1e-3 * np.cos(2 * t) + 1e-3 * np.exp(-t), ())


@pytest.mark.parametrize("solid", SOLIDS)
def test_derivatives_of_a_formed_solid(solid):
    part = SolidPart(solid, surveyed=("diameter", "tilt"), form=bent(solid))
    levels = np.linspace(0.05, 0.95, 12) * part.top_m
    found = part.derivatives(levels)
    assert found["datum"] == pytest.approx(part.area_m2(levels), rel=1e-12)
    assert_derivative(
        lambda x: part.volume_m3(levels + x[0]),
        [0.0], part.area_m2(levels)[:, None], step=1e-6, tolerance=1e-5,
    )  # fmt: skip


def test_scale_of_a_formed_sphere():
    def volume(x):
        ball = Sphere(6.0 * (1 + x[0]))
        return SolidPart(ball, form=bent(ball)).volume_m3(levels)

    levels = np.linspace(0.5, 5.5, 9)
    part = SolidPart(Sphere(6.0), form=bent(Sphere(6.0)))
    analytic = part.derivatives(levels)["scale"][:, None]
    assert_derivative(volume, [0.0], analytic, step=1e-6, tolerance=1e-5)


@pytest.mark.parametrize("solid", SOLIDS)
def test_what_is_uncertain_at_the_nodes_is_so_at_their_levels(solid):
    part = SolidPart(solid, surveyed=("diameter",), form=form_of(solid))
    (points,) = part.sources(node_levels(part.top_m))
    assert points.columns_m3[:, 0] == pytest.approx(np.linspace(0.0, 1e-3, NODES), abs=1e-15)


def test_a_groove_deeper_than_the_first_dips_does_not_turn_the_table_round():
    """What is added at the bottom is bounded: no volume falls with rising dips."""
    solid = LyingTank(2.4, 2.4, 8.0)
    levels = node_levels(2.4)
    volume, area = solid.volume_m3(levels), solid.area_m2(levels)
    added = -2.0 * volume * np.exp(-levels / 0.01)
    form = SurveyedForm.of_volumes(volume, area, 2.4, added, 0.0, ())
    dips = np.linspace(0, 2.4, 5001)
    assert np.all(np.diff(SolidPart(solid, form=form).volume_m3(dips)) > -1e-12)
