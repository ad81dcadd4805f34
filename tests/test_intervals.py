"""Of every volume that is stated: low <= V <= high, and low < high where anything is uncertain."""

from dataclasses import replace

import numpy as np
import pytest
from job_builder import write_job

import tankcal
from tankcal.errors import ProgramError
from tankcal.monte_carlo import Verdict
from tankcal.record.statements import budgets_of
from tankcal.simulation.intervals import gum_intervals, judged_intervals

LYING = {
    "horizontal.tilt_mm_per_m": 6.0,
    "horizontal.dip_from_a_m": 2.0,
    "table.step_m": 0.04,
}
OF_LYING = [("tilt", 1.0, "mm/m"), ("diameter", 3.0, "mm"), ("length", 5.0, "mm")]
CONE = {"bottom.form": "cone", "table.step_m": 0.05}
KINDS = {
    "lying": {"kind": "horizontal", "settings": LYING, "uncertainty": OF_LYING},
    "sphere": {"kind": "sphere", "settings": {"sphere.diameter_m": 4.0, "table.step_m": 0.04}},
    "cone up": {"settings": CONE | {"bottom.centre_z_m": 0.15}},
    "cone down": {"settings": CONE | {"bottom.centre_z_m": -0.15}},
    "roof": {
        "roof": {},
        "settings": {"table.liquid_density_kg_m3": 850.0, "table.step_m": 0.05},
    },
    "deadwood": {
        "deadwood": [("coil", 0.5, 1.0, -0.2), ("box", 0.0, 0.3, -0.5)],
        "settings": {"table.step_m": 0.05},
    },
}
DATUM = [("datum", 1.0, "mm"), ("scale", 20, "ppm")]


def holds(low, volume, high, u):
    """Which intervals hold their volume and, where it varies, more than it."""
    varies = np.asarray(u) > 0
    return (low <= volume) & (volume <= high) & (~varies | (low < high))


@pytest.mark.parametrize("kind", KINDS)
def test_every_interval_holds_its_volume(kind, tmp_path):
    parts = dict(KINDS[kind])
    parts["uncertainty"] = DATUM + parts.get("uncertainty", [])
    result = tankcal.run(tankcal.load(write_job(tmp_path / "job", **parts)), simulated=True)
    table, found = result.table, result.intervals
    assert np.all(found.by_gum) == (kind == "cone down")  # there dip 0 is far above the empty tank
    assert np.all(holds(found.low_m3, table.volume_m3, found.high_m3, table.u_m3))
    one, delivered = result.simulation.delivered, result.simulation.of_delivered
    assert np.all(holds(delivered.low_m3, one.volume_m3, delivered.high_m3, one.u_m3))
    for stated in budgets_of(result):
        assert holds(*(stated[key] for key in ("low_m3", "volume_m3", "high_m3", "u_m3")))


def judged(low, high, validated=False):
    """A verdict on one volume."""
    one = (np.array([value]) for value in (0.1, 0.1, 0.005, validated, True, low, high))
    return Verdict(*one)


def test_zeros_for_an_interval_are_an_error_of_the_program():
    """The row of 41 litres whose interval was printed as [0.000, 0.000]."""
    volume, u = np.array([0.041]), np.array([0.002])
    with pytest.raises(ProgramError, match=r"from 0\.000000 to 0\.000000"):
        judged_intervals(judged(0.0, 0.0), volume, u, 2 * u)
    with pytest.raises(ProgramError):
        judged_intervals(judged(np.nan, 0.05), volume, u, 2 * u)
    with pytest.raises(ProgramError):
        gum_intervals(volume, u, 0 * u)


def test_an_interval_beside_the_volume_is_made_longer_up_to_it():
    """A square of an input is never below its value at 0: 2.5 % of chi-square is above it."""
    volume, u = np.array([0.041]), np.array([0.002])
    found = judged_intervals(judged(0.0411, 0.046), volume, u, 2 * u)
    assert (found.low_m3[0], found.high_m3[0]) == (0.041, 0.046)
    assert found.U_m3[0] == pytest.approx(0.005)


def test_no_tank_holds_less_than_nothing_and_an_exact_volume_has_no_width():
    none = np.zeros(1)
    found = judged_intervals(judged(-0.001, 0.002), none, none, none, least_m3=0.0)
    assert found.low_m3[0] == 0.0
    exact = gum_intervals(np.array([3.0]), none, none)
    assert exact.low_m3 == exact.high_m3 == 3.0


def test_a_row_that_is_not_in_its_interval_is_never_written(tmp_path):
    """What the simulation says of a row is refused as a whole, not printed."""
    parts = KINDS["sphere"] | {"uncertainty": DATUM}
    result = tankcal.run(tankcal.load(write_job(tmp_path / "job", **parts)), simulated=True)
    spoilt = replace(result.simulation.judged, low=0.0 * result.table.volume_m3)
    spoilt = replace(spoilt, high=spoilt.low, validated=spoilt.low > 0)
    with pytest.raises(ProgramError):
        replace(result.simulation, judged=spoilt).intervals(result.table)
