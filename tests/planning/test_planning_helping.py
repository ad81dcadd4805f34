"""What helps: every effect against the changed plan predicted anew, and where a search ends."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import EXAMPLE

from tankcal.planning import load_plan, predict
from tankcal.planning.improvements import changes_of, cost_of, greedy, smallest, what_helps
from tankcal.planning.model import Box
from tankcal.text.naming import is_name

PLAN = EXAMPLE.parent / "plan-silva"


@pytest.fixture(scope="module")
def plan():
    return load_plan(PLAN)


@pytest.fixture(scope="module")
def effects(plan):
    return what_helps(plan)


@pytest.mark.slow
def test_each_effect_is_that_of_the_changed_plan(plan, effects):
    """Second method: the plan after the change, predicted from nothing."""
    for item in ("photo_station", "tape", "control_point", "reading"):
        one = next(effect for effect in effects if effect.change.item == item)
        found = predict(one.change.plan)
        assert one.relative_u == pytest.approx(found.relative_u, rel=1e-3)
        assert one.U_m3 == pytest.approx(found.table.U_m3[-1], rel=1e-3)


@pytest.mark.slow
def test_more_never_harms_and_less_never_helps(effects):
    """Property: an observation more cannot make the table worse, one less cannot improve it.

    Rows and stations that are added move or bring targets, and with them weights of outlines.
    """
    for one in effects:
        if one.change.item == "target_row":
            continue
        if one.change.action == "drop":
            assert one.difference > -1e-9
        elif one.change.item != "photo_station":
            assert one.difference < 1e-9


@pytest.mark.slow
def test_best_changes_come_first_with_their_costs(plan, effects):
    assert [one.relative_u for one in effects] == sorted(one.relative_u for one in effects)
    for one in effects:
        assert one.change.cost == pytest.approx(cost_of(one.change.plan) - cost_of(plan))
    station = next(one.change for one in effects if one.change.action == "add")
    assert station.cost > 0
    assert cost_of(plan) == pytest.approx(11 * 35 + 8 * 20 + 11 * 60 + 120 * 2)


@pytest.mark.slow
def test_addition_in_an_obstacle_is_refused(plan):
    """A station half-way between two others, where something is in the way."""
    added = next(one for one in changes_of(plan, ("add",), ("photo_station",)))
    place = next(one.xyz_m for one in added.plan.photos if one.station == added.name)
    sound, hidden = (
        what_helps(plan, (replace(added, plan=replace(added.plan, obstacles=obstacles)),))[0]
        for obstacles in ((), (Box(place - 0.1, place + 0.1, "pump house"),))
    )
    assert not sound.why
    assert hidden.why.endswith(f"station {added.name} stands in the obstacle pump house")


def test_a_plumb_line_costs_no_tape(plan):
    """docs/planning.md: levelled heights and plumb lines are free."""
    for table in ("plumb_lines", "height_differences"):
        tie = replace(plan.ties[0], name="X", table=table)
        assert cost_of(replace(plan, ties=(*plan.ties, tie))) == cost_of(plan)


def test_every_item_has_its_changes(plan):
    found = {(one.action, one.item) for one in changes_of(plan)}
    assert {("add", "photo_station"), ("drop", "photo_station"), ("add", "tape")} <= found
    assert {("drop", "tape"), ("repeat", "tape"), ("drop", "control_point")} <= found
    assert {("add", "control_point"), ("repeat", "reading")} <= found
    two_rows = load_two_rows(plan)
    assert ("drop", "target_row") in {(one.action, one.item) for one in changes_of(two_rows)}


def load_two_rows(plan):
    """The plan with each row of targets a second time, 0.5 m higher."""
    own = plan.targets
    again = replace(
        own,
        names=tuple(f"{name}b" for name in own.names),
        section=tuple(f"{name}b" for name in own.section),
        xyz_m=own.xyz_m + [0, 0, 0.5],
        height_m=own.height_m + 0.5,
    )
    return replace(plan, targets=own.append(again))


def test_a_row_that_is_added_keeps_away_from_the_welds(plan):
    """Property: 24 targets more, and the rows of their course at its Gauss levels."""
    joints = np.cumsum([0.0] + [course.height_m for course in plan.job.courses])
    added = [one for one in changes_of(plan, ("add",), ("target_row",))]
    assert len(added) == 5
    for course, one in enumerate(added):
        targets = one.plan.targets
        rows = np.unique(targets.height_m[targets.course == course]) - joints[course]
        # closed form: the two Gauss levels of 1.9 m, 0.4015 m from its ends
        assert rows == pytest.approx([0.4015, 1.4985], abs=1e-4)
        assert targets.xyz_m[:, 2] == pytest.approx(plan.shell.low_m + targets.height_m)
        assert len(set(targets.names)) == 144
    wide = replace(plan, targets=replace(plan.targets, clearance_m=0.5))
    (first, *_) = changes_of(wide, ("add",), ("target_row",))
    rows = np.unique(first.plan.targets.height_m[first.plan.targets.course == 0])
    assert rows == pytest.approx([0.5, 1.4])


def test_names_of_additions_are_valid_in_a_job(plan):
    for one in changes_of(plan, ("add",)):
        names = [*one.plan.points, *(photo.name for photo in one.plan.photos)]
        assert all(is_name(name) for name in names)


@pytest.mark.slow
def test_greedy_goes_on_until_the_limit_is_met(plan):
    start = predict(plan).relative_u
    limited = replace(plan, limits=replace(plan.limits, relative_u=0.995 * start))
    told = []
    path = greedy(
        limited, steps=5, items=("tape", "reading"), progress=lambda *one: told.append(one)
    )
    assert path.steps
    assert path.start_u == pytest.approx(start)
    assert path.relative_u <= 0.995 * start
    assert all(one.relative_u > 0.995 * start for one in path.steps[:-1])
    assert predict(path.plan).relative_u == pytest.approx(path.relative_u, rel=1e-12)
    assert path.steps[-1].relative_u == path.relative_u
    assert path.relative_u - path.start_u == pytest.approx(
        sum(one.difference for one in path.steps)
    )
    assert told[-1][1] == told[-1][2]


@pytest.mark.slow
def test_smallest_design_meets_limit_and_is_minimal(plan):
    limit = 1.02 * predict(plan).relative_u
    limited = replace(plan, limits=replace(plan.limits, relative_u=limit))
    path = smallest(limited, items=("tape",))
    assert path.cost < path.start_cost
    found = path.prediction
    assert found.meets
    assert not found.undetermined
    left = what_helps(path.plan, changes_of(path.plan, ("drop",), ("tape",)))
    assert len(left) == len(path.plan.ties) > 0
    assert all(predict(one.change.plan).relative_u > limit for one in left if not one.why)


def test_nothing_is_read_more_than_a_hundred_times(plan):
    often = replace(plan, photos=tuple(replace(one, readings=64) for one in plan.photos))
    tape = replace(plan.ties[0], readings=64)
    often = replace(often, ties=(tape, *plan.ties[1:]))
    names = {one.name for one in changes_of(often, ("repeat",))}
    assert names == {one.name for one in plan.ties[1:]}


@pytest.mark.slow
def test_a_search_ends_where_nothing_helps_any_more(plan):
    """A limit that plates and datum forbid: a step gains a thousandth at least, or is not made."""
    hopeless = replace(plan, limits=replace(plan.limits, relative_u=1e-6))
    path = greedy(hopeless, steps=40, items=("reading",))
    assert 0 < len(path.steps) <= 6
    assert path.prediction.meets is False
    assert all(one.difference < -9e-4 * one.relative_u for one in path.steps)


@pytest.mark.slow
def test_the_unit_of_money_does_not_matter(plan):
    """What is free comes first, then the most for its cost, in whatever currency."""
    chosen = []
    for unit in (0.001, 1000.0):
        costs = {"photo_station": 30 * unit, "control_point": 60 * unit}
        one = replace(plan, costs=costs, limits=replace(plan.limits, relative_u=None))
        path = greedy(one, steps=1, items=("photo_station", "control_point", "tape"))
        chosen.append(path.steps[0].change.name)
    assert len(set(chosen)) == 1
    assert path.steps[0].change.cost == 0


def test_a_search_needs_a_limit(plan):
    with pytest.raises(ValueError, match="relative_u"):
        smallest(replace(plan, limits=replace(plan.limits, relative_u=None)))
