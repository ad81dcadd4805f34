"""What the papers say of uncertainty: the U that counts, its inputs, deliveries, rule, Monte Carlo.

The cells of the templates run in this process; test_report.py runs them as a notebook, once.
"""

import copy
import gzip
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from kept_records import kept_files
from matplotlib.colors import to_hex
from paper_cells import of_part, paper_blocks, table_of, texts
from uncertain_job import HOSTILE, as_before, write_uncertain_job

import tankcal
from tankcal.gum.distributions import NAMES
from tankcal.job.contract.uncertainty import INPUTS
from tankcal.record import record_of, save
from tankcal.record.covariance_factor import blocks_of
from tankcal.record.schema import to_plain
from tankcal.record.table import budgets_of
from tankcal.report import figures
from tankcal.report.numbers import degrees_of_freedom
from tankcal.report.paper import Paper
from tankcal.report.pdf import pdf
from tankcal.report.plots import style as plot_style
from tankcal.report.uncertainty import budget, method, monte_carlo, rule
from tankcal.report.uncertainty import figures as drawn
from tankcal.report.uncertainty.stated import stated_rows, uneven_rows
from tankcal.tank.rules import (
    DEVIATION_OF,
    GUARDS,
    RELATIVE_TO,
    SIDES,
    TANKS,
    UNCERTAINTY_OF,
    DeviationVerdict,
    RuleVerdict,
    UncertaintyVerdict,
)
from tankcal.text.digits import NOTHING, decimals_of, decimals_of_rows, fixed
from tankcal.text.words import input_name, load_words

SLOW_FIXTURES = {"result", "path"}  # seconds each


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return tankcal.run(tankcal.load(write_uncertain_job(tmp_path_factory.mktemp("uncertain"))))


@pytest.fixture(scope="module")
def path(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("record") / "record.json"
    save(record_of(result), path)
    return path


@pytest.fixture(scope="module")
def record(path):
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def found(path):
    """The blocks of certificate and working papers."""
    return paper_blocks(path)


@pytest.fixture(scope="module")
def example(example_record):
    return json.loads(example_record.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def of_example(example_record):
    return paper_blocks(example_record)


def facts(found):
    """{label: text} of all facts."""
    return {
        label: text
        for block in found
        if block["kind"] == "key_values"
        for label, text in block["items"]
    }


def changed(record, **capacity):
    """A copy of a record with other columns in its capacity table."""
    other = copy.deepcopy(record)
    other["capacity"] |= capacity
    return other


# ---- the table


@pytest.mark.slow
def test_table_prints_stated_U_and_marks_monte_carlo_rows(found, record):
    capacity = record["capacity"]
    stated = capacity["stated_U_m3"]
    assert stated != capacity["U_m3"]
    digits = decimals_of_rows(stated)
    rows = table_of(found, "Capacity at each height")
    assert [row[2] for row in rows] == [fixed(U, d) for U, d in zip(stated, digits, strict=True)]
    marks = ["*" if code == "monte_carlo" else "" for code in capacity["interval"]]
    assert 0 < marks.count("*") < len(marks)
    assert [row[3] for row in rows] == [mark or "–" if mark else "" for mark in marks]


def test_k_is_given_only_where_U_is_k_u(found, of_example, record, example):
    (result,) = (block for block in found if block["kind"] == "result")
    U = record["capacity"]["stated_U_m3"][-1]
    assert f"U = {fixed(U, 2)}\N{NO-BREAK SPACE}m³" in result["text"]
    assert "by Monte Carlo" in result["text"]
    assert "k =" not in result["text"]
    assert example["capacity"]["interval"][-1] == "gum"
    (result,) = (block for block in of_example if block["kind"] == "result")
    assert "k = 1.96" in result["text"]
    several = changed(example, k=[4.3, *example["capacity"]["k"][1:]])
    assert several["capacity"]["interval"][0] == "monte_carlo"  # so its k is not printed
    captions = [block.get("caption", "") for block in of_example]
    assert any("with k = 1.96 in every row without a mark" in caption for caption in captions)


def test_the_sentence_counts_the_rows(found, of_example, record, example):
    for blocks, one in ((found, record), (of_example, example)):
        codes = one["capacity"]["interval"]
        assert codes.count("gum") == one["monte_carlo"]["validated"]
        said = f"within the tolerance in {codes.count('gum')} of {len(codes)} rows"
        assert any(said in text for text in texts(blocks))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "said", "caption"),
    [
        ("gum", "within the tolerance in every row.", "with k = 1.96 in every row"),
        ("monte_carlo", "by more than the tolerance in every row", "by Monte Carlo in every row"),
    ],
)
def test_rows_of_one_kind_have_no_marks(example, tmp_path, code, said, caption):
    count = len(example["capacity"]["interval"])
    alike = changed(example, interval=[code] * count)
    (tmp_path / "record.json").write_text(json.dumps(alike), encoding="utf-8")
    found = paper_blocks(tmp_path / "record.json")
    assert any(said in text for text in texts(found))
    (table,) = (b for b in found if b.get("caption", "").startswith("Capacity at each height"))
    assert caption in table["caption"]
    assert len(table["columns"]) == 3


def test_rows_with_an_uneven_interval_are_listed_with_its_ends(found, record):
    """Second method: ends as far from the volume as the printed digits of U can tell."""
    capacity = record["capacity"]
    keys = ("height_m", "volume_m3", "low_m3", "high_m3", "stated_U_m3", "interval")
    uneven = []
    for height, volume, low, high, U, code in zip(*(capacity[key] for key in keys), strict=True):
        last_digit = 10 ** -decimals_of(U)
        if code == "monte_carlo" and abs(low + high - 2 * volume) > last_digit:
            digits = max(decimals_of(U), 3)
            uneven.append([f"{height:.3f}", *(fixed(one, digits) for one in (volume, low, high))])
    assert uneven
    assert table_of(found, "Rows with an interval that is not symmetric") == uneven
    even = changed(record, low_m3=[0.0] * 25, high_m3=[2 * v for v in capacity["volume_m3"]])
    assert uneven_rows(even["capacity"]) == []


# ---- stated volumes and deliveries


def of_reading(budget):
    """k u of what reading the table adds."""
    return budget["k"] * np.sqrt(budget["u_m3"] ** 2 - budget["table_u_m3"] ** 2)


def test_a_stated_volume_has_the_U_of_its_row_and_of_its_reading(record):
    capacity = record["capacity"]
    rows = {(row["low_m"], row["high_m"]): row for row in stated_rows(record)}
    assert len(rows) == len(record["budgets"])
    row = rows[None, 1.2]
    (budget,) = (one for one in record["budgets"] if one["high_m"] == 1.2)
    assert of_reading(budget) > 0
    U = np.hypot(capacity["stated_U_m3"][12], of_reading(budget))
    assert row["U_m3"] == pytest.approx(U, rel=1e-12)
    assert (row["simulated"], row["k"]) == (True, None)


def test_validated_stated_volume_has_U_of_its_budget(result, record):
    (row,) = (row for row in _stated(result, by_gum=[True] * 25) if row["high_m"] == 1.2)
    (of_budget,) = (one for one in record["budgets"] if one["high_m"] == 1.2)
    assert (row["U_m3"], row["k"]) == (of_budget["U_m3"], of_budget["k"])


def _stated(result, **intervals):
    """The stated rows of a result with other intervals in the rows of its table."""
    changed = {key: np.array(column) for key, column in intervals.items()}
    other = replace(result, intervals=replace(result.intervals, **changed))
    return stated_rows({"budgets": to_plain(budgets_of(other))})


@pytest.mark.parametrize("largest", ["budget", 17, 18])
def test_between_two_rows_the_largest_U_is_stated(result, record, largest):
    """A dip at 1.75 m, rows at 1.7 and 1.8 m, of which one has Monte Carlo's interval."""
    U = [0.001] * 25
    by_gum = [row != 18 for row in range(25)]
    if largest != "budget":
        U[largest] = 7.0
    (row,) = (row for row in _stated(result, U_m3=U, by_gum=by_gum) if row["high_m"] == 1.75)
    (of_budget,) = (one for one in record["budgets"] if one["high_m"] == 1.75)
    U = of_budget["U_m3"] if largest == "budget" else np.hypot(7.0, of_reading(of_budget))
    assert row["U_m3"] == pytest.approx(U, rel=1e-12)
    assert row["simulated"] == (largest != "budget")  # else it is k u


def test_delivery_has_monte_carlo_interval_if_gum_fails(result, record):
    found, judged = result.simulation.of_deliveries
    lows = [one.low_m for one in result.stated.deliveries]
    place, sound = lows.index(1.0), lows.index(1.4)
    volume = result.stated.deliveries[place].volume_m3
    columns = {key: getattr(judged, key).copy() for key in ("validated", "low", "high")}
    columns["validated"][[place, sound]] = False, True
    columns["low"][place], columns["high"][place] = volume - 0.5, volume + 0.2
    of_deliveries = found, replace(judged, **columns)
    simulation = replace(result.simulation, of_deliveries=of_deliveries)
    other = record | {"budgets": to_plain(budgets_of(replace(result, simulation=simulation)))}
    one, two = (b for b in other["budgets"] if b["low_m"] in (1.0, 1.4))
    rows = {row["low_m"]: row for row in stated_rows(other)}
    down, up = np.hypot([0.5, 0.2], of_reading(one))
    assert rows[1.0]["U_m3"] == pytest.approx(down, rel=1e-12)
    assert rows[1.0]["k"] is None
    assert rows[1.0]["low_m3"] == one["low_m3"]  # uneven: its ends are told
    assert one["low_m3"] == pytest.approx(volume - down, rel=1e-12)
    assert (rows[1.4]["U_m3"], rows[1.4]["k"]) == (two["U_m3"], two["k"])
    (column,) = method.stated_table(other).only("dof").columns
    of_gum, of_monte_carlo = Paper(other).column_texts([rows[1.4], rows[1.0]], column)
    assert of_monte_carlo == NOTHING  # degrees of freedom belong to a k
    assert of_gum == degrees_of_freedom(two["dof"])
    remarks = method.remarks(Paper(other), rows[1.0])
    assert remarks == [
        f"from {one['volume_m3'] - down:.2f}\xa0m³ to {one['volume_m3'] + up:.2f}\xa0m³",
        f"stated {one['stated_m3']:.2f}\xa0m³; difference "
        f"{fixed(one['volume_m3'] - one['stated_m3'], 2)}\xa0m³",
        one["note"],
    ]


def test_the_worst_delivery_of_each_minimum_height_is_reported(found, record):
    rows = table_of(found, "Stated volumes")
    assert len(rows) == len(record["budgets"])
    assert [row[-1] for row in rows[-2:]] == [
        f"the largest U/V of all deliveries of exactly {least}\xa0m"
        for least in ("0.5", "1")
    ]  # fmt: skip
    worst = table_of(found, "Worst deliveries")
    at_minimum = [one["at_minimum"] for one in record["deliveries"]]
    ends = [[f"{one[key]:.3f}" for key in ("high_m", "low_m")] for one in at_minimum]
    assert [row[2:4] for row in worst if row[1] == "U/V, at exactly this height"] == ends
    assert len(worst) == len({tuple(row) for row in worst})


# ---- inputs and budgets


@pytest.mark.slow
def test_inputs_are_separated(of_example, example):
    lines = example["budgets"][0]["lines"]
    words, said = load_words(), facts(of_example)
    defaults = [line["input"] for line in lines if line["is_default"]]
    assert defaults == ["expansion", "interpolation", "rounding"]
    by_default = said["Inputs with a default u (not declared)"]
    assert by_default.startswith("Coefficient of thermal expansion: u\xa0=\xa05.8")
    assert by_default.endswith("rectangular")
    of_reading = "Inputs from reading the table (only in stated volumes and deliveries)"
    assert "(default)" in said[of_reading]
    declared = [line["input"] for line in lines if line["u"] is not None and not line["is_default"]]
    assert said["Inputs declared"].count("u\xa0=\xa0") == len(declared)
    told = said["NOT included in U (u not declared)"]
    assert told == words["texts"]["nothing_missing"]  # the example declares everything


def test_undeclared_inputs_are_named(found, record):
    (missing,) = (one["value"] for one in record["choices"] if one["code"] == "not_in_budget")
    names = facts(found)["NOT included in U (u not declared)"].split("; ")
    assert names == [load_words()["inputs"][name] for name in missing]
    assert names


def test_a_budget_is_the_record_with_its_defaults_marked(found, of_example, example):
    rows = table_of(of_example, "Uncertainty budget of the capacity")
    assert len(rows) == len(example["budget"])
    digits = decimals_of(example["capacity"]["U_m3"][-1]) + 1
    for row, line in zip(rows, example["budget"], strict=True):
        assert row[0].endswith(" (default)") == line["is_default"]
        assert row[7] == fixed(line["contribution_m3"], digits)
        assert row[8] == fixed(100 * line["share"], 1)
        assert row[1] == "–" if line["estimate"] is None else row[1] != "–"
    assert [HOSTILE in text for text in texts(found)].count(True) >= 2  # note, name of the rule
    assert any(text == f"Diameter: {HOSTILE}" for text in texts(found))
    pair = "Diameter is correlated with Length of the cylinder, r = 0.5"
    assert any(text == pair for text in texts(found))


def test_contributions_of_every_stated_volume_are_the_record(found, record):
    rows = table_of(found, "Contribution of each input")
    for place, one in enumerate(record["budgets"], 1):
        digits = decimals_of(one["u_m3"])
        expected = [fixed(line["contribution_m3"], digits + 1) for line in one["lines"]]
        expected += [fixed(one["u_m3"], digits), fixed(one["k"], 2), fixed(one["U_m3"], digits)]
        assert [row[place] for row in rows] == expected


def test_many_stated_volumes_are_set_in_even_tables(record):
    many = copy.deepcopy(record)
    many["budgets"] = [*record["budgets"], *record["budgets"][:3]]
    widths = [len(block.data["columns"]) for block in budget.others(Paper(many))]
    assert widths == [1 + 5, 1 + 4]


def test_most_useful_input_comes_first(found, record):
    rows = table_of(found, "U, in percent of its present value")
    other = copy.deepcopy(record)
    other["budget"].reverse()
    assert budget.improvements(Paper(other))[0].data["rows"] == rows
    least = [min(float(cell) for cell in row[1:]) for row in rows]
    assert least == sorted(least)
    top = {input_name(load_words(), line): line["halved"] for line in record["budget"]}
    assert all(float(row[1]) == pytest.approx(100 * top[row[0]], abs=0.05) for row in rows)
    assert max(least) < 99.5


def test_bars_of_defaults_are_pale(record):
    other = copy.deepcopy(record)
    other["budget"][1]["is_default"] = True
    (ax,) = figures.budget_bars(Paper(other)).axes
    names = [label.get_text() for label in ax.get_yticklabels()]
    pale = [to_hex(bar.get_facecolor()) == plot_style.PALE for bar in ax.patches]
    assert pale == [name.endswith("(default)") for name in names]
    assert pale.count(True) == 1
    shares = [bar.get_width() for bar in ax.patches]
    assert shares == sorted(shares, reverse=True)


def test_every_name_has_words():
    words = load_words()
    assert set(INPUTS) <= set(words["inputs"])
    assert set(NAMES) <= set(words["distributions"])
    line = {"input": "diameter & length", "unit": "m3", "note": "", "is_default": True}
    assert input_name(words, line) == "Diameter & Length of the cylinder (default)"
    shared = {"input": "deadwood", "unit": "%", "note": "my note", "is_default": False}
    assert input_name(words, shared) == "Deadwood volumes without a declared u"
    item = shared | {"unit": "m3", "note": "coil {x}"}
    assert input_name(words, item) == "Volume of the deadwood: coil {x}"


# ---- deliveries and Monte Carlo, drawn


def test_delivery_curve_ends_at_the_whole_tank(record):
    """From the factor of the rows; the record's own u of that delivery is a second method."""
    left, right = drawn.delivery_curve(Paper(record)).axes
    below, delivered, worst = left.lines
    (whole,) = {one["absolute"]["u_m3"] for one in record["deliveries"]}
    assert record["deliveries"][0]["absolute"]["low_m"] == 0
    assert delivered.get_ydata()[0] == pytest.approx(whole, rel=1e-9)
    assert list(below.get_ydata()) == record["capacity"]["u_m3"][1:]
    assert list(worst.get_xdata()) == pytest.approx([0.5, 1.0])
    relative = [one["at_minimum"] for one in record["deliveries"]]
    expected = [100 * one["u_m3"] / one["volume_m3"] for one in relative]
    assert list(right.lines[2].get_ydata()) == pytest.approx(expected)


def test_numbers_between_powers_of_ten_have_decimal_mark(record):
    other = copy.deepcopy(record)
    capacity = other["capacity"]
    capacity["volume_m3"] = list(np.linspace(1000, 1001, len(capacity["volume_m3"])))
    capacity["u_m3"] = list(np.linspace(1, 3, len(capacity["u_m3"])))
    capacity["inputs"] = capacity["inputs"][:1]
    capacity["factor"] = to_plain(blocks_of([[one / 1e3] for one in capacity["volume_m3"]]))
    other["deliveries"] = []
    spanish = Paper(other, language="es")
    svg = spanish.figure(drawn.delivery_curve(spanish), "delivery_curve").data["svg"]
    numbers = re.findall(r">([^<>]*\d[^<>]*)</text>", svg)
    assert {"0,10", "0,20", "0,30"} < set(numbers)  # per cent
    assert not [one for one in numbers if "." in one]


def test_ranges_are_all_rows_with_their_largest_difference(found, record):
    ranges = monte_carlo.ranges(record)
    rows = record["monte_carlo"]["rows"]
    assert sum(one["count"] for one in ranges) == len(rows["validated"])
    validated = [one["validated"] for one in ranges for _ in range(one["count"])]
    assert validated == rows["validated"]
    start = 0
    for one in ranges:
        of_range = slice(start, start + one["count"])
        largest = max(*rows["d_low"][of_range], *rows["d_high"][of_range])
        assert max(one["d_low"], one["d_high"]) == largest
        start += one["count"]
    assert [row[3] for row in table_of(found, "Consecutive rows")] == [
        "validated" if one["validated"] else "NOT validated" for one in ranges
    ]


def test_the_differences_of_the_ends_are_drawn(record):
    (ax,) = drawn.interval_differences(Paper(record)).axes
    lower, upper = ax.lines[2:]
    capacity, rows = record["capacity"], record["monte_carlo"]["rows"]
    U = capacity["U_m3"]
    assert U[0] == 0  # the empty tank: no percentage
    for line, sign, ends, key in ((lower, -1, "low", "d_low"), (upper, 1, "high", "d_high")):
        drawn_m3 = [y * u / 100 for y, u in zip(line.get_ydata(), U[1:], strict=True)]
        gum = [v + sign * u for v, u in zip(capacity["volume_m3"], U, strict=True)]
        signed = [one - other for one, other in zip(rows[ends], gum, strict=True)]
        assert drawn_m3 == pytest.approx(signed[1:], abs=1e-9)
        assert [abs(one) for one in signed] == pytest.approx(rows[key], abs=1e-9)


# ---- the sentence on k


@pytest.mark.parametrize(
    ("k", "dof", "simulated", "said"),
    [
        ([2.0, 2.0, 2.0], [None] * 3, [False] * 3, "k = 2.00, which for a normal distribution"),
        ([2.0, 2.26, 2.26], [None, 9.0, 9.0], [True, False, False], "k = 2.26, which for a t-"),
        (
            [2.0, 2.26, 2.01],
            [None, 9.0, 4e3],
            [False] * 3,
            "with 9 to ∞ effective",
        ),
        ([2.0, 2.26, 2.01], [1.0, 9.0, 4e3], [True] * 3, None),
    ],
)
def test_the_usual_sentence_on_k_is_of_the_rows_whose_U_is_k_u(record, k, dof, simulated, said):
    interval = ["monte_carlo" if one else "gum" for one in simulated]
    columns = {"k": k, "dof": dof, "U_m3": [0.1, 0.2, 0.3], "interval": interval}
    found = method.k_sentences(Paper(changed(record, **columns)))
    assert len(found) == (said is not None)
    for sentence in found:
        assert said in sentence
        assert "coverage probability of approximately 95\xa0%." in sentence


def test_note_on_validation_is_below_deliveries(record):
    paper = Paper(record)
    plain = [one for one in paper.record["budgets"] if one["monte_carlo"] is not None]
    for one in plain:
        one["monte_carlo"] |= {"validated": False, "d_low": 0.014, "d_high": 0.002}
        one["U_m3"] = 0.5
    _, why = monte_carlo.delivery_blocks(paper)
    assert "the difference is at most 0.014\xa0m³, 2.8\xa0% of U" in why.data["text"]
    for one in plain:
        one["monte_carlo"]["validated"] = True
    assert len(monte_carlo.delivery_blocks(paper)) == 1


# ---- the decision rule


def test_the_verdict_of_the_rule_in_words(found, record):
    said = facts(found)
    assert said["Rule"] == HOSTILE
    assert said["Verdict"] == "DOES NOT CONFORM."
    assert said["Its values"] == "NOT read in the original text"
    holds_from = record["rule"]["uncertainty"][0]
    assert holds_from["code"] == "holds_from"
    whole = " ".join(texts(found)).replace("\xa0", " ")
    level, volume = f"{holds_from['from_m']:.3f} m", f"{holds_from['from_m3']:.3f} m³"
    assert f"at most 1 % of the volume. Met from a level of {level} ({volume}) upwards" in whole
    assert "U of deliveries of 0.5 m or more: at most 0.25 % of the volume. NOT met" in whole
    assert "U of deliveries of 1 m or more: to be stated, not limited. Largest value" in whole
    assert "at most 1 % of the volume: B.2 (read in the original text)." in whole
    assert "± 0.3 % of the stated volume: B.4 (NOT read in the original text)." in whole
    top, steps = record["rule"]["deviation"]
    assert (top["code"], steps["code"]) == ("fails", "guard_band")
    in_guard = "limit ± 0.9 m³, guard band U: NOT accepted: in the guard band."
    assert f"{in_guard} Probability of conformity {100 * steps['probability']:.2f} %." in whole
    assert "Probability of conformity below 0.01 %." in whole
    simulated = (
        "this delivery and some deliveries down to the lowest dip are simulated by Monte Carlo."
    )
    assert f"The worst delivery is determined by the law of propagation; {simulated}" in whole


def test_verdict_of_unread_rule_is_not_on_certificate(found, record):
    """Its name, its verdict and its limits are in the working papers alone."""
    assert record["rule"]["verified"] is False
    certificate = " ".join(texts(of_part(found, "certificate")))
    papers = " ".join(texts(of_part(found, "working-papers")))
    for words in ("DOES NOT CONFORM", "Probability of conformity", "at most 1\xa0% of the volume"):
        assert words not in certificate
        assert words in papers
    assert "not a statement of conformity, and it is not on the certificate" in papers


def test_verdict_of_verified_rule_is_on_certificate(record):
    other = copy.deepcopy(record)
    other["rule"]["verified"] = True
    shown = [block.data for block in rule.blocks_of_verdict(Paper(other))]
    assert shown[0] == {"kind": "heading", "text": "Decision rule", "level": 1}
    assert "DOES NOT CONFORM." in texts(shown)
    assert [block.data["kind"] for block in rule.blocks_of_unread(Paper(other))] == ["key_values"]


def test_limits_that_nothing_was_held_against_are_named(record):
    other = copy.deepcopy(record)
    other["rule"] |= {"code": "not_all_judged", "unjudged": ["top", "=range"]}
    said = dict(rule.facts(Paper(other)))
    assert said["rule_unjudged"] == "top, =range"
    assert "NOT every limit" in said["rule_verdict"]
    assert dict(rule.facts(Paper(record)))["rule_unjudged"] == ""


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.5, "50.00 %"), (0.99995, "above 99.99 %"), (1e-5, "below 0.01 %"), (0.0002, "0.02 %")],
)
def test_a_probability_is_never_certain(example_record, share, text):
    assert rule.probability(Paper(example_record), share).replace("\xa0", " ") == text


def codes_of(verdict):
    """The codes that the docstring of a verdict promises, in quotes."""
    promised = verdict.__doc__.split("code ")[1].split("    passed ")[0].split("    verified ")[0]
    return set(promised.split('"')[1::2])


@pytest.mark.parametrize(
    ("group", "codes"),
    [
        ("rule_codes", codes_of(RuleVerdict)),
        ("limit_codes", codes_of(UncertaintyVerdict)),
        ("deviation_codes", codes_of(DeviationVerdict)),
        ("rule_tanks", TANKS),
        ("limited", UNCERTAINTY_OF),
        ("limited_deviation", DEVIATION_OF),
        ("relative_to", RELATIVE_TO),
        ("limit_sides", SIDES),
        ("guards", GUARDS),
        ("intervals", ("gum", "monte_carlo")),
        ("verified", ("True", "False")),
        ("validated", ("True", "False")),
    ],
)
def test_every_code_of_a_rule_has_words(group, codes):
    words = load_words()
    assert len(codes) > 1
    assert set(codes) == set(words[group])
    if group == "limit_codes":
        assert all(f"rule_{code}" in words["texts"] for code in codes)


# ---- earlier records


@pytest.mark.study
def test_an_earlier_record_is_printed_with_what_it_has(tmp_path):
    (kept,) = (one for one in kept_files(1) if one.name == "uncertain.json.gz")
    old = as_before(json.loads(gzip.decompress(kept.read_bytes())))
    path = tmp_path / "record.json"
    path.write_text(json.dumps(old), encoding="utf-8")
    found = paper_blocks(path)
    headings = {block["text"] for block in found if block["kind"] == "heading"}
    assert {"Uncertainty budget", "Statement of uncertainty"} <= headings
    assert headings.isdisjoint({"Monte Carlo", "Deliveries", "Decision rule"})
    U = old["capacity"]["U_m3"]
    (table,) = (b for b in found if b.get("caption", "").startswith("Capacity at each height"))
    assert [row[2] for row in table["rows"]] == [
        fixed(one, digits) if one else NOTHING
        for one, digits in zip(U, decimals_of_rows(U), strict=True)
    ]
    assert U[0] == 0.0  # the row of the empty tank
    assert [column["heading"] for column in table["columns"]] == ["Height", "Volume", "U", "k"]
    said = [text for text in texts(found) if "Monte Carlo" in text]
    assert said == ["No Monte Carlo simulation was made."]
    assert pdf(found, path.parent).startswith(b"%PDF")


def test_certificate_without_monte_carlo_states_it(record, tmp_path):
    off = changed(record, interval=["gum"] * 25, stated_U_m3=record["capacity"]["U_m3"])
    off["monte_carlo"] = None
    off["job"]["table"]["monte_carlo"] = False
    for one in off["budgets"]:
        one["monte_carlo"] = None
    path = tmp_path / "record.json"
    path.write_text(json.dumps(off), encoding="utf-8")
    said = texts(paper_blocks(path))
    assert "No Monte Carlo simulation was made." in said
    assert not any("this budget is by the law of propagation" in text for text in said)
