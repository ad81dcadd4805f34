"""Types of evaluation and the effect of defaults, in the records and certificates of examples."""

import shutil
from collections import defaultdict

import pytest
from example_certificates import EXAMPLES, record_of_example

import tankcal
from tankcal.record import record_of
from tankcal.report.paper import Paper
from tankcal.report.uncertainty import method
from tankcal.text.shipped import LANGUAGES


def budget_lines_of(record):
    return [line for budget in record["budgets"] for line in budget["lines"]]


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_type_A_has_finite_degrees_of_freedom(name):
    """JCGM 100:2008, 4.2: a statistic of n observations has n - 1 degrees of freedom."""
    lines = budget_lines_of(record_of_example(name))
    assert lines
    assert [line["input"] for line in lines if line["type"] == "A" and line["dof"] is None] == []


@pytest.mark.slow
def test_an_input_has_a_single_type_in_all_examples():
    types = defaultdict(set)
    for name in EXAMPLES:
        for line in budget_lines_of(record_of_example(name)):
            types[line["input"]].add(line["type"])
    assert len(types) > 30
    assert {name: found for name, found in types.items() if len(found) > 1} == {}


ROOF = """
[roof]
mass_kg = 14000
critical_bottom_m = 1.6
critical_top_m = 1.8
reference_density_kg_m3 = 850
weighing = "air"
"""


@pytest.fixture(scope="module")
def roofed(tmp_path_factory):
    """Record of the strapping example with a floating roof of undeclared uncertainty."""
    folder = tmp_path_factory.mktemp("roofed") / "job"
    shutil.copytree("examples/strapping", folder)
    with open(folder / "job.toml", "a", encoding="utf-8") as file:
        file.write(ROOF)
    return record_of(tankcal.run(tankcal.load(folder)))


@pytest.mark.slow
def test_a_default_that_removes_k_is_named(roofed):
    paper = Paper(roofed, language="en")
    (sentence,) = method.default_effects(paper)
    # Second way: shares of the budgets, and the rows counted one by one.
    simulated = [row for row, of in enumerate(roofed["capacity"]["interval"]) if of != "gum"]
    budgets = [budget for budget in roofed["budgets"] if budget["interval"] == "monte_carlo"]
    shares = [
        line["share"]
        for budget in budgets
        for line in budget["lines"]
        if line["input"] == "roof_mass"
    ]
    assert len(simulated) < 5
    assert min(shares) > 0.6
    assert "Mass of the floating roof" in sentence
    # 1 % of 14 000 kg is the half-width of a rectangular distribution: 140 / sqrt(3) kg.
    assert "u = 81" in sentence
    assert f"{len(shares)} of {len(roofed['budgets'])} stated volumes" in sentence


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_effect_is_told_in_each_language(roofed, language):
    (sentence,) = method.default_effects(Paper(roofed, language=language))
    assert "{" not in sentence
    assert "81" in sentence


@pytest.mark.slow
def test_no_sentence_without_such_a_default():
    paper = Paper(record_of_example("strapping"), language="en")
    assert method.default_effects(paper) == []


@pytest.mark.slow
@pytest.mark.parametrize("dip", [0.5, 1.234, 8.4])
def test_a_delivery_down_to_the_empty_tank_has_the_U_of_its_volume(dip):
    """Both are one quantity, whichever method determined its U."""
    result = tankcal.run(tankcal.load("examples/strapping"))
    volume, delivery = result.at(dip), result.delivery(0.0, dip)
    assert (delivery.value_m3, delivery.U_m3) == (volume.value_m3, volume.U_m3)
    assert delivery.interval == volume.interval
    # The law of propagation lets the error of the zero cancel, so its U would be smaller.
    assert result.table.delivery(0.0, dip).U_m3 < 0.99 * volume.U_m3
