"""Of every volume that is stated: low <= V <= high, and low < high where anything is uncertain."""

import json
from dataclasses import replace

import numpy as np
import openpyxl
import pandas as pd
import pytest
from job_builder import write_job

import tankcal
from tankcal import workbook
from tankcal.errors import ProgramError
from tankcal.job import StatedVolume
from tankcal.monte_carlo import Verdict
from tankcal.outputs.tables import write_tables
from tankcal.record import record_of, save
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


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """A sphere whose lowest rows have Monte Carlo's interval, its job asking for a delivery."""
    folder = tmp_path_factory.mktemp("sphere")
    parts = KINDS["sphere"] | {"uncertainty": [("datum", 4.0, "mm")]}
    job = tankcal.load(write_job(folder / "job", **parts))
    asked = (StatedVolume(1.0, 0.02), StatedVolume(3.0, 1.0))
    return tankcal.run(replace(job, stated=asked), simulated=True)


def test_one_u_in_record_table_files_and_result(sphere, tmp_path):
    """`result.capacity` and `at` had the law's U where the papers have Monte Carlo's."""
    save(record_of(sphere), tmp_path / "record.json")
    record = json.loads((tmp_path / "record.json").read_text(encoding="utf-8"))
    write_tables(record, tmp_path)
    written, table = pd.read_csv(tmp_path / "capacity.csv"), sphere.capacity
    assert list(written.columns) == list(table.columns)
    for key in ("height_m", "volume_m3", "u_m3", "k", "U_m3", "low_m3", "high_m3"):
        ours, theirs = (one[key].to_numpy(float) for one in (table, written))
        assert theirs == pytest.approx(ours, abs=5.1e-7, nan_ok=True), key
    assert list(written.interval) == list(table.interval) == record["capacity"]["interval"]
    assert list(table.U_m3) == record["capacity"]["stated_U_m3"]
    simulated = table.interval == "monte_carlo"
    assert 0 < simulated.sum() < len(table)
    assert np.all(np.isnan(table.k) == simulated)
    off = np.abs(table.U_m3 - sphere.table.U_m3)
    assert np.all(off[~simulated] == 0)
    assert off[simulated].max() > 0
    workbook.write(record, tmp_path / "capacity.xlsx")
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    ((sheet, cells),) = book.defined_names["capacity_U"].destinations
    shown = [cell.value for (cell,) in book[sheet][cells]]
    assert shown == pytest.approx(list(table.U_m3), abs=5.1e-4)


def test_one_u_at_a_dip_and_in_words(sphere):
    table = sphere.capacity
    for row in (1, 2, 100, len(table) - 1):
        found, own = sphere.at(table.height_m[row]), table.iloc[row]
        assert (found.U_m3, found.interval) == (own.U_m3, own.interval)
        assert found.low_m3 == pytest.approx(own.low_m3, abs=1e-12)
        assert found.high_m3 == pytest.approx(own.high_m3, abs=1e-12)
        assert (found.k is None) == np.isnan(own.k)
    between = sphere.at((table.height_m[1] + table.height_m[2]) / 2)
    assert between.U_m3 >= table.U_m3[1:3].max()  # of both, and of the law
    top = sphere.at(table.height_m.iloc[-1])
    assert str(top) in str(sphere)


def test_one_u_of_a_delivery(sphere):
    delivered = sphere.simulation.of_delivered
    to_empty, whole = sphere.delivery(0.02, 1.0), sphere.delivery(1.0, 3.0)
    for place, found in enumerate((to_empty, whole)):
        assert found.U_m3 == delivered.U_m3[place]
        assert (found.interval == "gum") == delivered.by_gum[place]
        assert found.low_m3 == pytest.approx(delivered.low_m3[place], abs=1e-12)
    other = sphere.delivery(1.1, 2.7)
    assert other.interval == "gum_not_simulated"
    assert other.U_m3 == sphere.table.delivery(1.1, 2.7).U_m3


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
