"""Keep, recompute or recalibrate: by limits, E_n, age and basis."""

from dataclasses import replace

import numpy as np
import pytest
from tables_of_s1 import HEIGHTS, PLATES, RADII, former_s1, new_s1

from tankcal.job.rule_files import named_rule, parse_rule, shipped_rule
from tankcal.job.tables import Log
from tankcal.products.recalibration.comparison import compare

COURSES = HEIGHTS, PLATES
YOUNG = {"date": "2020-05-20"}


def scaled(table, factor, **more):
    """A table whose volumes are so many times larger."""
    U = None if table.U_m3 is None else factor * table.U_m3
    return replace(table, volume_m3=factor * table.volume_m3, U_m3=U, **more)


def codes(found):
    return [one.code for one in found.reasons]


def legal(found):
    return {one.code: one for one in found.legal}


def test_what_did_not_change_is_kept():
    former = new_s1(common=0.0, **YOUNG)
    found = compare(former, new_s1(), courses=COURSES)
    assert (found.verdict, found.verified) == ("keep", True)
    assert codes(found) == ["tank_agrees", "limits_kept"]


def test_another_basis_is_computed_again():
    found = compare(former_s1(**YOUNG), new_s1(), courses=COURSES)
    assert found.verdict == "recompute"
    assert found.reasons[0].values == {"steps": ["zero", "temperature", "head"]}


def test_an_old_table_is_measured_again():
    """Published: at most 10 years (France, fixed tanks); 2014-05-20 to 2026-03-02 are 11.78."""
    found = compare(former_s1(), new_s1(), courses=COURSES)
    assert found.verdict == "recalibrate"
    assert codes(found)[0] == "age_exceeded"
    assert found.reasons[0].values["age"] == pytest.approx(11.78, abs=0.01)


@pytest.mark.slow(after=6)
@pytest.mark.parametrize(
    ("name", "date", "verdicts"),
    [
        ("lithuania_2013_period", "2020-03-01", ["fails"]),
        ("lithuania_2013_period", "2021-03-03", ["conforms"]),
        ("api_2_2a_period", "2020-03-01", ["fails", "conforms"]),
        ("api_2_2a_period", "2011-03-01", ["fails", "fails"]),
        ("api_2_2a_period", "2022-03-01", ["conforms", "conforms"]),
        ("france_2020_recalibration", None, ["not_judged"]),
        ("france_2020_recalibration", "May 2020", ["not_judged"]),
        ("france_2020_recalibration", "2027-01-01", ["not_judged"]),
    ],
)
def test_how_old_a_table_may_become(name, date, verdicts):
    former = new_s1(common=0.0, date=date)
    found = compare(former, new_s1(), rule=named_rule(name, Log()), courses=COURSES)
    assert [one.verdict for one in found.ages] == verdicts
    assert (found.verdict == "recalibrate") == ("fails" in verdicts)
    assert found.rule.is_default is False
    if "fails" in verdicts:
        assert found.verified is False  # neither was read in its text


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.00299, "conforms"), (1.00301, "fails"), (1 / 1.0031, "fails")]
)
def test_three_parts_in_a_thousand(factor, verdict):
    """Published: arrêté of 14 September 2020, 0.3 %, at the top and of the range; no guard band."""
    former = new_s1(U_m3=None, **YOUNG)
    found = compare(former, scaled(former, factor, date="2026-03-02"), courses=COURSES)
    numbers = legal(found)
    assert numbers["top"].verdict == numbers["range"].verdict == verdict
    assert numbers["top"].value == pytest.approx(100 * (factor - 1), abs=1e-9)
    assert (found.verdict == "recalibrate") == (verdict == "fails")
    assert found.legal[0].verified


@pytest.mark.parametrize(("mm", "verdict"), [(5.0, "conforms"), (5.1, "fails"), (-5.1, "fails")])
def test_five_millimetres_of_the_reference_height(mm, verdict):
    new = new_s1(reference_height_m=9.118 + mm / 1000)
    found = compare(new_s1(common=0.0, **YOUNG), new, courses=COURSES)
    assert legal(found)["reference_height"].verdict == verdict
    assert legal(found)["reference_height"].value == pytest.approx(mm)


def test_a_tank_that_grew_more_than_its_uncertainties():
    """Closed form: 0.15 % more, U of 0.1 and 0.06 %: E_n 1.29 for c = 0; 1.72 for c = 0.5."""
    former = new_s1(common=0.5, U_m3=0.001 * new_s1().volume_m3, **YOUNG)
    new = scaled(new_s1(), 1.0015)
    found = compare(former, new, courses=COURSES)
    assert (found.verdict, codes(found)[0]) == ("recalibrate", "tank_differs")
    by_hand = 0.15 / np.sqrt(0.1**2 + 0.06**2 - 2 * 0.5 * 0.1 * 0.06)
    assert found.reasons[0].values["E_n"] == pytest.approx(by_hand, rel=2e-3)
    undeclared = compare(replace(former, common=None), new, courses=COURSES)
    assert undeclared.correlation.worst_E_n == pytest.approx(1.29, abs=0.01)
    assert undeclared.correlation.worst_E_n_at_half == pytest.approx(by_hand, rel=2e-3)
    assert "c_not_declared" in codes(undeclared)


def test_a_zero_that_nobody_declared_and_that_is_large():
    """A bottom that sank by 8 mm looks like it: not for a new computation alone."""
    dips = np.round(np.arange(0.10, 8.395, 0.01), 3)
    former = new_s1(dips, common=0.0, reference_height_m=None, **YOUNG)
    for mm, verdict in ((3.0, "recompute"), (8.0, "recalibrate")):
        area = np.pi * RADII[0] ** 2
        new = new_s1(dips, reference_height_m=None)
        new = replace(new, volume_m3=new.volume_m3 + area * mm / 1000)
        found = compare(former, new, courses=COURSES)
        assert found.zero.height_m == pytest.approx(mm / 1000, abs=2e-5)
        assert found.verdict == verdict
        assert [one.code for one in found.warnings] == ["compare_zero_or_bottom"]
        assert ("zero_not_explained" in codes(found)) == (mm > 5)


def test_nothing_to_judge_by():
    rule = named_rule("api_2_2a_period", Log())
    former = new_s1(U_m3=None, **YOUNG)
    found = compare(former, new_s1(date="2023-01-01"), rule=rule, courses=COURSES)
    assert (found.verdict, codes(found)[0]) == (None, "nothing_to_judge")


def test_U_that_is_not_known_is_said():
    found = compare(former_s1(U_m3=None, **YOUNG), new_s1(), courses=COURSES)
    assert found.verdict == "recompute"
    assert "E_n_not_known" in codes(found)
    assert np.isnan(found.rows.E_n).all()
    assert found.correlation.worst_E_n is None


def test_a_guard_band_of_a_house_rule():
    """U of 0.06 % leaves 0.24 % of 0.3 %; a rule of another kind of tank is not asked."""
    text = b"""
    [rule]
    name = "House rule"
    source = "contract 12"
    verified = true
    [deviation.top]
    of = "volumes"
    limit_percent = 0.3
    guard = "U"
    clause = "3"
    [period.sphere]
    of = "all"
    years = 1
    tanks = ["sphere"]
    clause = "4"
    """
    log = Log()
    rule = parse_rule("house.toml", text, log), "house.toml"
    log.stop_if_problems()
    former = new_s1(U_m3=None, **YOUNG)
    found = compare(former, scaled(new_s1(), 1.0025), rule=rule, courses=COURSES)
    assert (found.legal[0].code, found.legal[0].verdict) == ("row", "guard_band")
    assert (found.verdict, codes(found)[0]) == ("recalibrate", "in_guard_band")
    assert found.ages == []
    unknown = compare(former, scaled(former, 1.0025, date="2026-01-01"), rule=rule, courses=COURSES)
    assert unknown.legal[0].verdict == "not_judged"


def test_the_french_rule_has_three_numbers_and_a_period():
    rule = shipped_rule("france_2020_recalibration")
    assert [one.limit for one in rule.deviation] == [0.003, 0.003]
    assert [one.limit_m for one in rule.reference_height] == [0.005]
    assert [(one.of, one.years) for one in rule.periods] == [("all", 10)]
