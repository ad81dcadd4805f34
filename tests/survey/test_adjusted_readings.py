"""`Readings`: columns that are looked at as a sequence of `Reading`."""

import numpy as np
import pytest

from tankcal.survey.results import Reading, Readings


def reading(row, *, sd=0.001, removed=False, check=False):
    kind, ids = ("distance", ("A", f"P{row}")) if row % 2 else ("plumb line", ("A", "B"))
    numbers = (8.5 + row, 0.002, sd, 0.5, 1.0, np.inf, 0.01, 0.003)
    return Reading(kind, ids, "", "a.csv", row or None, 1, "m", *numbers, removed, check)


ROWS = [reading(0), reading(1, removed=True), reading(2, check=True), reading(3, sd=0.0)]


def test_readings_are_those_of_a_list():
    """Second method: the list that they are made of."""
    found = Readings.of(ROWS)
    assert list(found) == ROWS
    assert (len(found), found[1], found[-1], list(found[1:3])) == (4, ROWS[1], ROWS[3], ROWS[1:3])
    assert type(found[1].w) is float
    assert type(found[1].removed) is bool
    assert list(Readings.joined([found, Readings.of([])])) == ROWS
    with pytest.raises(IndexError):
        found[4]


def test_readings_are_chosen_by_masks():
    found = Readings.of(ROWS)
    assert list(found.where(found.are("distance") & ~found.removed)) == [ROWS[3]]
    assert found.hold.tolist() == [False, False, False, True]
    assert list(found.where(found.check)) == [ROWS[2]]
    assert not found.are("direction").any()
