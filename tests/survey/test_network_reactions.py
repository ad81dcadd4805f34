"""Held coordinates are tested by what their release says: closed form, second method, a limit."""

from dataclasses import replace

import numpy as np
import pytest
from networks import photographed

from tankcal.adjust import noncentrality
from tankcal.survey.network import Survey, adjust
from tankcal.survey.network.reliability import reactions
from tankcal.survey.observations import ControlCoordinates, Distances, HeightDifferences

HELD = np.array([1, 7, 13, 19, 25, 31, 37, 43])
DELTA0 = noncentrality()


def levels(end_m, sd_m=0.001):
    """A and B held in height at 0 and end_m, P between them: 1 m up from A, 1 m up to B."""
    xyz = np.array([[0.0, 0, 0], [1, 0, end_m], [2, 0, 1]])
    fixed = np.array([[True] * 3, [True] * 3, [True, True, False]])
    lines = HeightDifferences(
        np.ones(2), np.full(2, sd_m), start=np.array([0, 2]), end=np.array([2, 1])
    )
    return Survey(("A", "B", "P"), xyz, fixed, observations=(lines,))


@pytest.fixture(scope="module")
def held():
    """Photographs and distances with eight control points held, one of them 3 mm wrong."""
    survey, truth = photographed()
    fixed = np.zeros((48, 3), dtype=bool)
    fixed[HELD] = True
    fixed[7, 2] = False
    xyz = np.where(fixed, truth.xyz_m, survey.xyz_m)
    xyz[13, 0] += 0.003
    return replace(survey, xyz_m=xyz, fixed=fixed, observations=survey.observations[1:])


def exact_ties(truth):
    """A height difference and a distance from held points that hold exactly themselves."""
    rise = truth[1, 2] - truth[2, 2] + 1e-3
    length = np.linalg.norm(truth[13] - truth[40])
    return (
        HeightDifferences(np.array([rise]), np.zeros(1), np.array([2]), np.array([1])),
        Distances(np.array([length]), np.zeros(1), np.array([13]), np.array([40]),
                  instrument=np.array([-1])),
    )  # fmt: skip


def test_a_line_of_levels_between_held_heights():
    """Closed form: two lines of 1 mm and 10 mm too much: either end would move by 10 mm +- 1.4."""
    found = adjust(levels(2.010))
    one = reactions(found.problem, found.solution, found.survey.fixed)
    place = {int(row): i for i, row in enumerate(one.rows)}
    table = one.residuals(found.problem)
    for row, change in ((2, 0.010), (5, -0.010)):
        w, mdb = table.w[place[row], 0], table.mdb[place[row], 0]
        assert w == pytest.approx(np.sign(change) * 10 / np.sqrt(2))
        assert mdb / DELTA0 == pytest.approx(0.001 * np.sqrt(2))
        assert w * mdb / DELTA0 == pytest.approx(change)
        assert table.effect_m[place[row], 0] == pytest.approx(mdb / 2)
    assert np.isinf(table.mdb[[place[row] for row in (0, 1, 3, 4, 6, 7)]]).all()


@pytest.mark.slow
@pytest.mark.parametrize("tied", [False, True])
def test_reaction_equals_release(held, tied):
    """Second method: each coordinate released in turn, and everything adjusted again."""
    ties = exact_ties(photographed()[1].xyz_m) if tied else ()
    survey = replace(held, observations=(*held.observations, *ties))
    found = adjust(survey, tolerance=1e-8)
    one = reactions(found.problem, found.solution, survey.fixed)
    table = one.residuals(found.problem)
    for i in range(0, len(one.rows), 6):
        point, axis = divmod(int(one.rows[i]), 3)
        fixed = survey.fixed.copy()
        fixed[point, axis] = False
        again = adjust(replace(survey, fixed=fixed), tolerance=1e-8)
        change = again.xyz_m[point, axis] - survey.xyz_m[point, axis]
        sd = again.point_sd_m[point, axis]
        assert table.mdb[i, 0] / DELTA0 == pytest.approx(sd, rel=1e-3)
        assert table.w[i, 0] == pytest.approx(change / sd, abs=2e-3)
        assert found.chi2 - again.chi2 == pytest.approx(table.w[i, 0] ** 2, rel=3e-3, abs=1e-2)
        largest = np.abs(again.xyz_m - found.xyz_m)[~survey.fixed].max()
        effect = table.effect_m[i, 0] / table.mdb[i, 0]
        assert effect * abs(change) == pytest.approx(largest, rel=2e-2, abs=1e-7)
    assert one.rows[np.argmax(table.test_statistic)] == 3 * 13


def test_held_is_the_limit_of_observed_with_a_small_sd(held):
    """Second method: the w-test of the same coordinates as observations of 10 um."""
    found = adjust(held, tolerance=1e-8)
    one = reactions(found.problem, found.solution, held.fixed)
    point, axis = np.divmod(one.rows, 3)
    values = held.xyz_m[point, axis]
    control = ControlCoordinates(values, np.full(len(values), 1e-5), point, axis)
    observed = replace(held, fixed=None, observations=(*held.observations, control))
    other = next(
        t for t in adjust(observed, tolerance=1e-8).residuals if t.kind == "control coordinate"
    )
    assert one.w == pytest.approx(other.w[:, 0], abs=5e-3)
    assert one.residuals(found.problem).mdb == pytest.approx(other.mdb, rel=2e-3)


def test_values_that_only_hold_the_datum_are_untestable():
    """Property: as many coordinates as the defect: nothing pulls, and nothing controls them."""
    survey = photographed()[0]
    fixed = np.zeros((48, 3), dtype=bool)
    fixed[[0, 20]], fixed[40, 2] = True, True
    found = adjust(replace(survey, fixed=fixed, observations=()))
    one = reactions(found.problem, found.solution, fixed)
    assert np.isinf(one.residuals(found.problem).mdb).all()
    assert not one.w.any()


def test_coordinate_held_by_exact_tie_cannot_be_released(held):
    """Closed form: the height between two held points holds exactly, so that neither gives way."""
    rise = held.xyz_m[19, 2] - held.xyz_m[1, 2]
    tie = HeightDifferences(np.array([rise]), np.zeros(1), np.array([1]), np.array([19]))
    found = adjust(replace(held, observations=(*held.observations, tie)))
    one = reactions(found.problem, found.solution, held.fixed)
    place = {int(row): i for i, row in enumerate(one.rows)}
    mdb = one.residuals(found.problem).mdb[:, 0]
    assert np.isinf(mdb[[place[3 * 1 + 2], place[3 * 19 + 2]]]).all()
    assert np.isfinite(mdb[place[3 * 25 + 2]])
