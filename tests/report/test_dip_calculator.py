"""The dip calculator, typed into and recalculated by LibreOffice: the table, as the record has it.

The tank is the shipped example with rows 0.2 m apart; 0.05 m, or with all its rows, as a study.
"""

import random
from bisect import bisect_right
from itertools import pairwise

import numpy as np
import pytest
from calculated_tanks import example_with_rows
from calculator_deliveries import held_against_deliveries
from draws import draws
from recalculation import calculators

from tankcal.report.uncertainty.stated import k_of_rows, stated_U_m3
from tankcal.text.words import load_words

# openpyxl does not know our data bars, and says so each time
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning"),
]
NONE = "–"
RELATIVE = 1e-12  # LibreOffice stores 15 digits
WORDS = load_words("en")


def between_rows(heights, draw):
    """Dips between the rows: the middle of some, and seeded places in others."""
    pairs = list(pairwise(heights))
    return [low + draw.choice([0.5, draw.random()]) * (high - low) for low, high in pairs[::3]]


REFUSED_DIPS = {
    "below": (lambda h: h[0] - 0.01, "below the table, which begins at 0.000 m."),
    "just below": (lambda h: h[0] - 0.0001, "below the table"),
    "negative": (lambda h: -4.75, "below the table"),
    "above": (lambda h: h[-1] + 0.01, "above the table, which ends at"),
    "just above": (lambda h: max(h[-1], round(h[-1], 3)) + 0.0001, "above the table"),
    "far above": (lambda h: 1e9, "above the table"),
    "text": (lambda h: "4.75 m", "not a number."),
    "text like a number": (lambda h: "4.75", "not a number."),
    "NaN": (lambda h: "NaN", "not a number."),
    "an error": (lambda h: "=1/0", "not a number."),
    "not available": (lambda h: "=NA()", "not a number."),
    "truth value": (lambda h: True, "not a number."),
    "spaces": (lambda h: "  ", "not a number."),
    "blank": (lambda h: None, "type a dip in metres."),
}

STEPS_M = [0.2, pytest.param(draws(0.05, 0.01), marks=pytest.mark.study)]


@pytest.fixture(scope="module", params=STEPS_M)
def tank(request, tmp_path_factory):
    return example_with_rows(request.param, tmp_path_factory.mktemp("tank"))


@pytest.fixture(scope="module")
def record(tank):
    return tank[1]


@pytest.fixture(scope="module")
def cases(record):
    """Every row as dip and as volume, beside a delivery; dips between rows; what is refused."""
    draw = random.Random(1995)
    heights, volumes = record["capacity"]["height_m"], record["capacity"]["volume_m3"]
    between = between_rows(heights, draw)
    dips, wanted = [*heights, *between], [*volumes, *np.interp(between, heights, volumes)]
    found = []
    for dip, volume in zip(dips, wanted, strict=True):
        pair = sorted((draw.choice(heights), draw.uniform(heights[0], heights[-1])))
        names = ("dip_m", "wanted_volume", "delivery_low_dip", "delivery_high_dip")
        found.append(dict(zip(names, (dip, float(volume), *pair), strict=True)))
    for case, high in zip(found, (heights[7], between[3]), strict=False):  # the tank is emptied
        case |= {"delivery_low_dip": heights[0], "delivery_high_dip": high}
    return found


WANTED = {
    "below": (lambda volumes: -1.0, "below the table"),
    "above": (lambda volumes: volumes[-1] + 1, "above the table"),
    "text": (lambda volumes: "12", "not a number."),
    "blank": (lambda volumes: None, "type a volume in m³."),
}


@pytest.fixture(scope="module")
def calculated(record, cases, tmp_path_factory):
    """What is typed at rows and between them, what is refused, and the table's end as printed."""
    heights, volumes = record["capacity"]["height_m"], record["capacity"]["volume_m3"]
    dips = ("dip_m", "delivery_low_dip", "delivery_high_dip")
    ends = {"dip_m": round(heights[-1], 3), "delivery_high_dip": round(heights[-1], 3)}
    groups = {
        "typed": cases,
        "refused": [dict.fromkeys(dips, of(heights)) for of, _ in REFUSED_DIPS.values()],
        "wanted": [{"wanted_volume": of(volumes)} for of, _ in WANTED.values()],
        "swapped": [{"delivery_low_dip": 2.0, "delivery_high_dip": high} for high in (1.0, 2.0)],
        "end": [ends | {"wanted_volume": round(volumes[-1], 3)}],
    }
    groups = {name: (record, typed) for name, typed in groups.items()}
    return calculators(groups, WORDS, tmp_path_factory.mktemp("calculated"))


@pytest.fixture
def typed(calculated):
    return calculated["typed"]


def test_at_every_row_it_is_the_record(typed, record):
    capacity = record["capacity"]
    rows = len(capacity["height_m"])
    for line, key in (
        ("volume", "volume_m3"),
        ("expanded", "stated_U_m3"),
        ("standard", "u_m3"),
        ("low", "low_m3"),
        ("high", "high_m3"),
    ):
        expected = pytest.approx(capacity[key], rel=RELATIVE, abs=RELATIVE)
        assert typed.line(line)[:rows] == expected, line
    words = [WORDS["intervals"][code] for code in capacity["interval"]]
    assert typed.line("interval")[:rows] == words
    for shown, code, k in zip(typed.line("k"), capacity["interval"], capacity["k"], strict=False):
        assert shown == (NONE if code == "monte_carlo" else pytest.approx(k, rel=RELATIVE))
    assert set(capacity["interval"]) == {"gum", "monte_carlo"}  # the empty tank: no k there


def test_between_rows_it_interpolates_and_takes_the_larger_U(typed, record, cases):
    """Second method: the interpolation written out here, row by row."""
    capacity = record["capacity"]
    heights, volumes, U = (capacity[key] for key in ("height_m", "volume_m3", "stated_U_m3"))
    dips = [case["dip_m"] for case in cases][len(heights) :]
    assert len(dips) > len(heights) / 4
    lines = [typed.line(key)[len(heights) :] for key in ("volume", "expanded", "low", "high")]
    for dip, *found in zip(dips, *lines, strict=True):
        row = bisect_right(heights, dip) - 1
        part = (dip - heights[row]) / (heights[row + 1] - heights[row])
        volume = (1 - part) * volumes[row] + part * volumes[row + 1]
        larger = max(U[row], U[row + 1])
        expected = [volume, larger, volume - larger, volume + larger]
        assert found == pytest.approx(expected, rel=RELATIVE, abs=RELATIVE)


def test_the_dip_of_the_volume_of_a_dip_is_that_dip(typed, cases):
    dips = [case["dip_m"] for case in cases]
    assert typed.line("dip_of_volume") == pytest.approx(dips, abs=1e-9)


def test_ullage_is_the_reference_height_less_the_dip(typed, record, cases):
    reference = record["job"]["datum"]["reference_height_m"]
    expected = [reference - case["dip_m"] for case in cases]
    assert typed.line("ullage") == pytest.approx(expected, abs=1e-9)


def test_deliveries_are_those_of_tankcal(typed, tank, cases, figure):
    held_against_deliveries(typed, tank[0].table, cases, figure)


def test_emptying_the_tank_has_the_U_of_the_volume(typed, record, cases):
    """Volume and delivery of a dip have one U and k; at rows with Monte Carlo no k."""
    heights = record["capacity"]["height_m"]
    U, k = stated_U_m3(record["capacity"]), k_of_rows(record["capacity"])
    emptied = [at for at, case in enumerate(cases) if case["delivery_low_dip"] == heights[0]]
    assert len(emptied) >= 2
    for at in emptied:
        high = cases[at]["delivery_high_dip"]
        row = bisect_right(heights, high) - 1
        larger = row if high == heights[row] or U[row] > U[row + 1] else row + 1
        assert typed.line("delivered_U")[at] == pytest.approx(U[larger], rel=1e-9)
        expected = NONE if k[larger] is None else pytest.approx(k[larger], rel=1e-6)
        assert typed.line("delivered_k")[at] == expected
        assert typed.line("delivered_dof")[at] == NONE


@pytest.mark.parametrize("state", ["dip_state", "low_dip_state", "high_dip_state"])
def test_each_dip_is_refused_in_words(calculated, state):
    said = calculated["refused"].sentences(state)
    for text, (name, (_, words)) in zip(said, REFUSED_DIPS.items(), strict=True):
        assert text.startswith("Refused: "), name
        assert words in text, name


def test_nothing_hangs_on_a_dip_that_is_refused(calculated):
    lines = (
        "volume expanded k standard low high interval ullage in_service delivered delivered_U "
        "delivered_k delivered_u delivered_dof delivered_relative"
    )
    for line in lines.split():
        assert calculated["refused"].line(line) == [NONE] * len(REFUSED_DIPS), line


def test_each_volume_is_refused_in_words(calculated):
    said = calculated["wanted"].sentences("wanted_state")
    for text, (_, words) in zip(said, WANTED.values(), strict=True):
        assert text.startswith("Refused: ")
        assert words in text
    assert calculated["wanted"].line("dip_of_volume") == [NONE] * len(WANTED)


def test_the_lower_dip_must_be_below_the_higher(calculated):
    swapped = "Refused: the lower dip must be below the higher dip."
    assert calculated["swapped"].sentences("delivery_state") == [swapped] * 2
    assert calculated["swapped"].line("delivered") == [NONE] * 2


def test_the_last_height_as_it_is_printed_is_the_last_row(calculated, record):
    capacity, end = record["capacity"], calculated["end"]
    assert end.line("volume") == pytest.approx(capacity["volume_m3"][-1:], rel=RELATIVE)
    assert end.line("dip_of_volume") == pytest.approx(capacity["height_m"][-1:], abs=1e-5)
    first = min(row for row, good in enumerate(capacity["for_use"]) if good)
    whole = capacity["volume_m3"][-1] - capacity["volume_m3"][first]
    assert end.line("delivered") == pytest.approx([whole], rel=RELATIVE)
