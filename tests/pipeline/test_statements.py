"""What is stated beside the rows: each of its own, however others fare, and with its reading."""

import numpy as np
import pytest
from job_builder import job_parts, write_folder, write_job

import tankcal
from tankcal.errors import InputError
from tankcal.record.schema import to_plain
from tankcal.record.table import budgets_of

RULE = """
[rule]
name = "House rule"
source = "contract 12"

[uncertainty.steps]
of = "deliveries"
minimum_height_m = 1.5
limit_percent = 0.3
"""
INPUTS = [
    ["input", "u", "unit", "u_is", "type", "distribution", "dof", "note"],
    ["scale", 100, "ppm", None, "B", "normal", None, None],
    ["offset", 1.0, "mm", None, "B", "normal", None, None],
    ["datum", 5.0, "mm", None, "B", "normal", None, None],
]


def computed(folder, stated="", settings=None, inputs=INPUTS, rule=RULE, **shape):
    """An upright tank of 6.5 m by 9.5 m, by Monte Carlo."""
    own = {"table.step_m": 0.25, "table.monte_carlo": True, **(settings or {})}
    parts = job_parts(settings={"table.rule": "house.toml", **own} if rule else own, **shape)
    parts.tables["uncertainty"] = inputs
    parts.extra_files = {"stated.csv": "high_m,low_m,volume_m3,note\n" + stated}
    if rule:
        parts.extra_files["house.toml"] = rule
    return tankcal.run(tankcal.load(write_folder(folder / "job", parts)))


@pytest.mark.slow
def test_a_stated_delivery_changes_no_verdict_on_others(tmp_path):
    """One down to the empty tank has many times the U of the law of propagation."""
    (alone,) = computed(tmp_path / "a").rule.uncertainty
    result = computed(tmp_path / "b", "1,0,,\n0.25,0,,\n")
    (beside,) = result.rule.uncertainty
    simulated = result.simulation
    found = simulated.of_deliveries[1].stated(
        simulated.delivered.volume_m3, simulated.delivered.U_m3
    )
    assert np.max(found / simulated.delivered.U_m3) > 3
    numbers = {"worst_U_m3", "worst_ratio"}  # sums over other columns: their last bits
    for name, value in vars(alone).items():
        near = pytest.approx(value, rel=1e-12) if name in numbers else value
        assert getattr(beside, name) == near


@pytest.mark.slow
def test_the_delivery_that_decides_is_simulated(tmp_path, figure):
    """Second method: draws of the closed form, pi (R + o)^2 (1 + s)^2 times the depth, >= 0."""
    result = computed(tmp_path)
    (found,) = result.rule.uncertainty
    assert found.worst_low_m == 0.0  # where the law of propagation has it that the zero cancels
    rng, count = np.random.default_rng(4), 400_000
    scale, offset, zero = (sd * rng.standard_normal(count) for sd in (1e-4, 1e-3, 5e-3))
    area = np.pi * ((6.5 + offset) * (1 + scale)) ** 2
    volume = area * (np.maximum(found.worst_m + zero, 0) - np.maximum(zero, 0))
    ends = np.quantile(volume, [0.025, 0.975])
    U = np.max(np.abs(ends - np.pi * 6.5**2 * found.worst_m))
    figure("U of the delivery that decides, over that of draws", found.worst_U_m3 / U)
    assert found.worst_U_m3 == pytest.approx(U, rel=0.02)


@pytest.mark.slow
def test_least_delivery_is_that_down_to_the_empty_tank(tmp_path):
    (found,) = computed(tmp_path).rule.uncertainty
    assert found.code == "holds_from"
    heights = [found.from_m, *np.linspace(found.from_m, 9.4, 7)]
    stated = "".join(f"{height:.3f},0,,\n" for height in heights[1:])
    result = computed(tmp_path / "more", stated)
    (again,) = result.rule.uncertainty
    assert again.code == "holds_from"
    kept = [
        one
        for one in to_plain(budgets_of(result))
        if one["low_m"] == 0.0 and one["high_m"] >= again.from_m
    ]
    assert kept
    assert all(one["monte_carlo"]["high"] - one["monte_carlo"]["low"] > 0 for one in kept)
    assert all(_table_U(one) <= 0.003 * one["volume_m3"] for one in kept)


def _table_U(one):
    """U of a delivery by Monte Carlo of the table alone."""
    judged = one["monte_carlo"]
    return max(one["volume_m3"] - judged["low"], judged["high"] - one["volume_m3"])


READING = [*INPUTS, ["interpolation", 0.3, "m3"], ["rounding", 0.4, "m3"]]
READING[-2:] = [[*row, None, "B", "normal", None, None] for row in READING[-2:]]


@pytest.mark.slow
def test_reading_is_in_u_by_either_method(tmp_path):
    """Two readings between rows: 0.3 and 0.4 m3 twice each, 0.707 m3 in squares."""
    result = computed(tmp_path, "1.13,0,,\n5.13,4.02,,\n1,,,\n0.13,,,\n", inputs=READING, rule="")
    by_dips = {(one["low_m"], one["high_m"]): one for one in to_plain(budgets_of(result))}
    to_empty, between = by_dips[0.0, 1.13], by_dips[4.02, 5.13]
    assert (to_empty["interval"], between["interval"]) == ("monte_carlo", "gum")
    assert between["stated_U_m3"] == between["U_m3"]
    of_reading = 1.96 * np.sqrt(0.3**2 + 2 * 0.4**2)  # dip 0 is a row
    assert to_empty["stated_U_m3"] == pytest.approx(
        np.hypot(_table_U(to_empty), of_reading), rel=1e-4
    )
    assert to_empty["stated_U_m3"] > to_empty["U_m3"]
    low = by_dips[None, 0.13]
    assert low["stated_U_m3"] >= low["U_m3"]
    assert (low["interval"] == "gum") == (low["stated_U_m3"] == low["U_m3"])


@pytest.mark.slow
def test_with_its_reading_no_tank_holds_less_than_nothing(tmp_path):
    """At a dip of 5 mm with a zero known to 5 mm: 0.66 m3, u of 0.66 and 0.4 m3 of reading."""
    result = computed(tmp_path, "0.005,,,\n", {"table.step_m": 0.005}, inputs=READING, rule="")
    (low,) = (one for one in to_plain(budgets_of(result)) if one["high_m"] == 0.005)
    assert (low["interval"], low["low_m3"]) == ("monte_carlo", 0.0)
    assert low["stated_U_m3"] > low["volume_m3"]


LEANING = {"tilt": (0.003, 0.0)}  # its top is 0.04 mm lower than its courses are long


@pytest.mark.slow
def test_a_delivery_from_the_nominal_top_is_one_from_the_top(tmp_path):
    settings = {"table.minimum_delivery_m": [1.5, 9.5]}
    result = computed(tmp_path, "9.5,0.5,,\n", settings, rule="", **LEANING)
    table = result.table
    assert table.height_m[-1] == 9.5
    found = result.simulation.delivered
    assert found.high_m[0] == 9.5
    above = table.volume_m3[-1] - table.at(0.5).value_m3
    assert found.volume_m3[0] == pytest.approx(above, abs=1e-9)
    assert result.stated.worst[1].absolute.volume_m3 == table.volume_m3[-1]


def test_a_least_delivery_that_does_not_fit_is_refused(tmp_path):
    """A lying tank of 2.4 m with its plates, which the check of the job does not take off."""
    settings = {"survey.side": "outside", "horizontal.thickness_mm": 8.0, "table.step_m": 0.1}
    settings["table.minimum_delivery_m"] = [0.5, 2.4]
    folder = write_job(tmp_path / "job", kind="horizontal", settings=settings)
    with pytest.raises(InputError) as refused:
        tankcal.run(tankcal.load(folder))
    (problem,) = refused.value.problems
    assert (problem.file, problem.column) == ("job.toml", "table.minimum_delivery_m")
    assert "found 2.4; expected at most 2.384 m" in str(problem)
