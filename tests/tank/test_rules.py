"""Decision rules: their values, and their verdicts on closed forms."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from tankcal.errors import HeightError
from tankcal.gum.conformity import conformity_probability
from tankcal.job.rule_files import shipped_names, shipped_rule
from tankcal.record.schema import to_plain
from tankcal.record.table import rule_of
from tankcal.tank.capacity import Capacity
from tankcal.tank.deliveries import worst_deliveries
from tankcal.tank.rules import (
    TANKS,
    DeviationLimit,
    PrintedU,
    StatedVolume,
    UncertaintyLimit,
    judge,
    judge_deviation,
    judge_uncertainty,
)
from tankcal.uncertainty import Source

K95 = 1.959963984540054  # closed form: the normal quantile of 0.975
HEIGHTS = np.linspace(0, 10, 101)


def table(datum=0.0, scale=0.0, dof=np.inf, critical=None, volume=None):
    """A cylinder of 100 m2: u of every row from a datum (m3) and a common scale (of V)."""
    volume = 100 * HEIGHTS if volume is None else volume
    sources = (
        Source("datum", np.full((101, 1), float(datum)), dof),
        Source("scale", scale * volume[:, None], dof),
    )
    return Capacity(HEIGHTS, volume, np.full(101, 100.0), sources, 0.95, critical)


SHARED = {"name": "one", "tanks": (), "clause": "", "verified": True}


def uncertainty(of="volumes", percent=0.2, relative_to="itself", minimum=None):
    limit = None if percent is None else percent / 100
    return UncertaintyLimit(
        of=of, limit=limit, relative_to=relative_to, minimum_height_m=minimum, **SHARED
    )


def deviation(of="volumes", percent=0.3, limit_m3=None, side="both", guard="none"):
    limit = None if limit_m3 is not None else percent / 100
    return DeviationLimit(of=of, limit=limit, limit_m3=limit_m3, side=side, guard=guard, **SHARED)


# --- the expanded uncertainty


def test_the_limit_holds_from_the_volume_of_the_closed_form_on():
    """U = k 0.5 m3 at every row keeps 0.2 % from V = U/0.002 = 490 m3 on: the row of 4.9 m."""
    found = judge_uncertainty(uncertainty(), table(datum=0.5))
    assert found.code == "holds_from"
    assert found.passed is False
    assert found.from_m == pytest.approx(4.9)
    assert found.from_m3 == pytest.approx(490)
    assert found.from_m3 >= K95 * 0.5 / 0.002 > found.from_m3 - 10
    assert found.worst_m == 0
    assert found.worst_ratio == math.inf
    assert found.worst_U_m3 == pytest.approx(K95 * 0.5)


def test_the_start_of_the_calibrated_zone_may_be_named():
    limit, of_datum = uncertainty(), table(datum=0.5)
    assert judge_uncertainty(limit, of_datum, lowest_m=4.85).code == "holds"
    found = judge_uncertainty(limit, of_datum, lowest_m=4.0)
    assert (found.code, found.from_m) == ("holds_from", pytest.approx(4.9))
    assert found.worst_m == 4.0
    assert found.worst_ratio == pytest.approx(K95 * 0.5 / 400)
    with pytest.raises(HeightError, match="the table ends at 10"):
        judge_uncertainty(limit, of_datum, lowest_m=10.1)


def test_the_empty_tank_without_uncertainty_keeps_the_limit():
    """Row 0: V = 0 and U = 0; a common scale of 0.1 % (k = 1.96) keeps 0.2 %."""
    found = judge_uncertainty(uncertainty(), table(scale=1e-3))
    assert (found.code, found.passed) == ("holds", True)
    assert (found.from_m, found.from_m3) == (0, 0)
    assert found.worst_ratio == pytest.approx(K95 * 1e-3)


def test_a_table_without_uncertainty_keeps_any_limit():
    found = judge_uncertainty(uncertainty(), table())
    assert (found.code, found.worst_ratio, found.worst_U_m3) == ("holds", 0, 0)


def test_where_nothing_meets_the_limit_no_level_is_named():
    found = judge_uncertainty(uncertainty(), table(scale=2e-3))
    assert (found.code, found.passed, found.from_m, found.from_m3) == ("fails", False, None, None)


def test_u_equal_to_the_limit_keeps_it():
    exact = uncertainty(percent=100 * K95 * 1e-3)
    assert judge_uncertainty(exact, table(scale=1e-3)).code == "holds"
    assert judge_uncertainty(uncertainty(percent=0.1959), table(scale=1e-3)).code == "fails"


def test_few_degrees_of_freedom_count():
    """0.08 % is 0.157 % with k = 1.96, and 0.206 % with the t of 5 degrees of freedom, 2.571."""
    assert judge_uncertainty(uncertainty(), table(scale=8e-4)).code == "holds"
    assert judge_uncertainty(uncertainty(), table(scale=8e-4, dof=5.0)).code == "fails"


def test_limit_broken_in_the_middle_holds_above():
    bump = np.where(np.abs(HEIGHTS - 6) < 0.05, 5.0, 0.0)[:, None]
    middle = replace(table(), sources=(Source("bump", bump),))
    assert judge_uncertainty(uncertainty(), middle).from_m == pytest.approx(6.1)


def test_of_the_capacity_only_the_highest_row_is_judged():
    limit = uncertainty("capacity")
    found = judge_uncertainty(limit, table(datum=0.5))
    assert (found.code, found.worst_m, found.worst_m3) == ("holds", 10, 1000)
    assert judge_uncertainty(limit, table(datum=1.1)).code == "fails"
    # 9.5 m to 11 m are not for use: the highest is the row of 9.5 m
    cut = judge_uncertainty(limit, table(datum=0.5, critical=(9.5, 11)))
    assert cut.worst_m == pytest.approx(9.5)


def test_a_limit_may_be_a_part_of_the_capacity():
    limit = uncertainty(relative_to="capacity", percent=0.5)  # 5 m3
    assert judge_uncertainty(limit, table(datum=2.5)).code == "holds"
    found = judge_uncertainty(limit, table(datum=2.6))
    assert (found.code, found.worst_ratio) == ("fails", pytest.approx(K95 * 2.6 / 1000))


def test_rows_in_the_critical_zone_are_not_judged():
    bump = np.where(np.abs(HEIGHTS - 6) < 0.05, 5.0, 0.0)[:, None]
    middle = replace(table(critical=(5.5, 6.5)), sources=(Source("bump", bump),))
    assert judge_uncertainty(uncertainty(), middle).code == "holds"
    nothing = judge_uncertainty(uncertainty(), table(critical=(-1, 11)))
    assert (nothing.code, nothing.passed) == ("nothing_to_judge", None)


@pytest.mark.slow
def test_between_rows_the_limit_holds_where_it_holds_at_rows():
    """The convexity of U at work: 2 000 dips of a table of many columns."""
    rng = np.random.default_rng(5)
    wild = replace(table(), sources=(Source("wild", rng.normal(size=(101, 4)) + HEIGHTS[:, None]),))
    limit = uncertainty(percent=10)
    from_m = judge_uncertainty(limit, wild).from_m
    for dip in rng.uniform(from_m, 10, 2000):
        found = wild.at(dip)
        assert found.U_m3 <= 0.1 * found.value_m3


def test_deliveries_of_a_seam_hold_limit_by_closed_form():
    """U = k 0.5 m3 across the seam at 5 m: 0.2 % of 490 m3, so deliveries of 4.900 m and more."""
    seam = Source("seam", np.where(HEIGHTS < 5, 0, 0.5)[:, None])
    tank = replace(table(), sources=(seam,))
    found = judge_uncertainty(uncertainty("deliveries", minimum=2.0), tank)
    assert found.code == "holds_from"
    assert found.from_m == pytest.approx(math.ceil(K95 * 0.5 / 0.002 / 100 * 1000) / 1000)
    assert found.worst_ratio == pytest.approx(K95 * 0.5 / 200)
    assert found.worst_m - found.worst_low_m == pytest.approx(2)
    assert found.from_m3 is None
    assert judge_uncertainty(uncertainty("deliveries", minimum=4.9), tank).code == "holds"
    assert judge_uncertainty(uncertainty("deliveries", 0.05, minimum=2.0), tank).code == "fails"
    none = judge_uncertainty(uncertainty("deliveries", minimum=10.5), tank)
    assert (none.code, none.passed) == ("nothing_to_judge", None)


def test_deliveries_may_be_limited_by_the_capacity():
    limit = uncertainty("deliveries", 0.5, "capacity", 0.5)  # 5 m3
    assert judge_uncertainty(limit, table(scale=2.5e-3)).code == "holds"  # 4.90 m3 for the largest
    found = judge_uncertainty(limit, table(scale=2.6e-3))
    assert (found.code, found.worst_ratio) == ("fails", pytest.approx(K95 * 2.6e-3))
    assert (found.worst_low_m, found.worst_m) == (0, 10)


def test_a_limit_without_a_value_is_stated():
    tank = table(datum=0.5, scale=1e-3)
    found = judge_uncertainty(uncertainty("deliveries", None, minimum=2.0), tank)
    assert (found.code, found.passed) == ("stated", None)
    assert found.worst_ratio == worst_deliveries(tank, 2.0).relative.relative


def test_deliveries_start_at_the_calibrated_zone():
    seam = Source("seam", np.where(HEIGHTS < 3, 0, 0.5)[:, None])
    tank = replace(table(), sources=(seam,))
    limit = uncertainty("deliveries", minimum=2.0)
    assert judge_uncertainty(limit, tank).worst_ratio > 0
    assert judge_uncertainty(limit, tank, lowest_m=3.0).worst_ratio == 0


# --- deviations


@pytest.mark.parametrize(
    ("value", "u", "lower", "upper", "printed"),
    [
        (-5.47, 0.05, -math.inf, -5.40, 0.92),  # a Zener diode: upper limit, Phi(1.40)
        (509.7, 8.6, 490, math.inf, 0.99),  # a container's bursting strength: lower, Phi(2.29)
    ],
)
def test_the_probability_is_as_published(value, u, lower, upper, printed):
    # closed form: Phi of the z named; the two examples of JCGM 106:2012 7.3
    assert conformity_probability(value, u, lower, upper) == pytest.approx(printed, abs=5e-3)


@pytest.mark.parametrize(
    ("z", "printed"), [(0.84, 0.80), (1.28, 0.90), (1.64, 0.95), (2.33, 0.99), (3.09, 0.999)]
)
def test_the_probability_belongs_to_the_distance_from_one_limit(z, printed):
    # published: JCGM 106:2012 table 1, z printed to two decimals
    low, high = (conformity_probability(10 - z - d, 1.0, -math.inf, 10) for d in (-5e-3, 5e-3))
    assert low <= printed <= high
    assert conformity_probability(10 + z + 5e-3, 1.0, 10.0, math.inf) == pytest.approx(high)


@pytest.mark.parametrize("dof", [1.0, 4.7, 30.0, math.inf])
def test_the_probability_is_that_of_another_program(dof):
    rng = np.random.default_rng(2)
    value, u = rng.normal(size=50), rng.uniform(0.1, 2, 50)
    lower, upper = value - rng.normal(1, 1, 50), value + rng.uniform(2, 3, 50)
    other = stats.t(dof) if math.isfinite(dof) else stats.norm
    expected = other.cdf((upper - value) / u) - other.cdf((lower - value) / u)
    assert conformity_probability(value, u, lower, upper, dof) == pytest.approx(expected, rel=1e-9)


def test_the_probability_is_the_share_of_simulated_values(figure):
    """Simulation, t of 6 degrees of freedom: 200 000 draws, three binomial standard errors."""
    draws = 5.02 + 0.4 * np.random.default_rng(3).standard_t(6, 200_000)
    share = np.mean((draws > 4.5) & (draws < 5.5))
    p = conformity_probability(5.02, 0.4, 4.5, 5.5, 6)
    assert abs(share - p) < 3 * math.sqrt(p * (1 - p) / 200_000)
    figure("probability of conformity, computed and simulated", f"{p:.4f}, {share:.4f}")


def test_small_probabilities_keep_their_digits_on_both_sides():
    far = conformity_probability(0.0, 1.0, 12.0, 13.0)
    assert far == pytest.approx(stats.norm.sf(12) - stats.norm.sf(13), rel=1e-9, abs=0)
    assert conformity_probability(0.0, 1.0, -13.0, -12.0) == far


def test_without_uncertainty_the_probability_is_0_or_1():
    found = conformity_probability([1.0, 2.0, 3.0], 0.0, 1.0, 2.5)
    assert list(found) == [1, 1, 0]
    assert conformity_probability(1.0, 0.0, 1.0, 2.0, 4.0) == 1


def test_risk_at_guarded_limit():
    """w = U, k = 1.96, two limits far apart: a value at A_U conforms with 97.5 %."""
    tank = table(datum=0.5)
    stated = StatedVolume(500.0, 5.0)
    found = judge_deviation(deviation(limit_m3=20.0, guard="U"), tank, stated)
    limit_u = found.accepted_m3[1]
    assert limit_u == pytest.approx(520 - K95 * 0.5)
    at_limit = conformity_probability(limit_u, 0.5, *found.tolerance_m3)
    assert at_limit == pytest.approx(0.975, abs=1e-12)  # closed form


@pytest.mark.parametrize(
    ("stated", "code"),
    [(500, "conforms"), (498.99, "conforms"), (498.97, "guard_band"), (498.01, "guard_band"),
     (497.99, "fails"), (501.01, "conforms"), (501.03, "guard_band"), (501.99, "guard_band"),
     (502.01, "fails")],
)  # fmt: skip
def test_verdicts_on_both_sides_of_the_guard_band(stated, code):
    """Tolerance 2 m3, U = k 0.5 = 0.980 m3: accepted within 1.020 m3 of the stated volume."""
    found = judge_deviation(
        deviation(limit_m3=2.0, guard="U"), table(datum=0.5), StatedVolume(stated, 5.0)
    )
    assert found.code == code
    assert found.passed is (code == "conforms")
    assert found.deviation_m3 == pytest.approx(500 - stated)
    assert found.guard_m3 == found.U_m3 == pytest.approx(K95 * 0.5)
    simple = judge_deviation(deviation(limit_m3=2.0), table(datum=0.5), StatedVolume(stated, 5.0))
    assert simple.code == ("fails" if code == "fails" else "conforms")
    assert simple.guard_m3 == 0


@pytest.mark.parametrize(
    ("side", "stated", "code"),
    [("upper", 490, "fails"), ("upper", 510, "conforms"), ("lower", 510, "fails"),
     ("lower", 490, "conforms")],
)  # fmt: skip
def test_one_sided_limits_look_at_one_side(side, stated, code):
    found = judge_deviation(
        deviation(side=side, guard="U"), table(datum=0.5), StatedVolume(stated, 5.0)
    )
    assert found.code == code
    assert (found.probability > 0.5) is (code == "conforms")
    assert math.isinf(found.tolerance_m3[0 if side == "upper" else 1])


def test_a_guard_band_wider_than_the_tolerance_accepts_nothing():
    found = judge_deviation(
        deviation(limit_m3=0.5, guard="U"), table(datum=0.5), StatedVolume(500, 5.0)
    )
    assert found.accepted_m3[0] > found.accepted_m3[1]
    assert (found.code, found.passed) == ("guard_band", False)


def test_a_delivery_is_held_against_its_stated_volume():
    tank = table(datum=0.5, scale=1e-3)
    found = judge_deviation(deviation("deliveries"), tank, StatedVolume(300.5, 6.0, 3.0))
    assert found.volume_m3 == pytest.approx(300)
    assert found.u_m3 == pytest.approx(0.3)  # the datum cancels
    assert found.code == "conforms"
    assert judge_deviation(deviation("deliveries"), tank, StatedVolume(300.5, 6.0)) is None
    assert judge_deviation(deviation("volumes"), tank, StatedVolume(300.5, 6.0, 3.0)) is None


def test_of_the_capacity_only_the_top_is_held_against_a_volume():
    tank = table(datum=0.5)
    assert judge_deviation(deviation("capacity"), tank, StatedVolume(500, 5.0)) is None
    assert judge_deviation(deviation("capacity"), tank, StatedVolume(1000, 10.0)).passed


def test_a_stated_volume_in_the_critical_zone_is_not_judged():
    found = judge_deviation(deviation(), table(critical=(4, 6)), StatedVolume(500, 5.0))
    assert (found.code, found.passed) == ("not_for_use", None)
    with pytest.raises(HeightError):
        judge_deviation(deviation(), table(), StatedVolume(500, 10.5))


# --- whole rules


def test_shipped_rules_state_what_was_verified():
    verified = {name: shipped_rule(name).verified for name in shipped_names()}
    assert verified == {
        "api_2_2a_period": False,
        "eu_71_349": False,
        "france_2003": True,
        "france_2003_alcohol": True,
        "france_2003_outside": True,
        "france_2003_rail_tankers": True,
        "france_2003_road_tankers": True,
        "france_2020_recalibration": True,
        "germany_2014": False,
        "inmetro_103_2022": False,
        "lithuania_2013_period": False,
        "norway_2007": False,
        "oiml_r71": False,
    }
    for name in shipped_names():
        rule = shipped_rule(name)
        assert rule.source
        assert rule.limits
        assert all(limit.clause for limit in rule.limits if limit.verified)


@pytest.mark.parametrize(
    ("name", "tank", "percent"),
    [
        ("oiml_r71", "vertical_fixed_roof", 0.2),
        ("oiml_r71", "vertical_floating_roof", 0.2),
        ("oiml_r71", "horizontal", 0.3),
        ("oiml_r71", "inclined", 0.3),
        ("oiml_r71", "sphere", 0.5),
        ("inmetro_103_2022", "vertical_fixed_roof", 0.2),
        ("france_2003", "vertical_fixed_roof", 0.3),  # published: arrêté of 8 July 2003, 34.3
        ("france_2003", "sphere", 0.5),
        ("france_2003_alcohol", "other", 0.3),  # published: 35.4
        ("france_2003_outside", "other", 0.4),
        ("france_2003_road_tankers", "horizontal", 0.2),
        ("france_2003_rail_tankers", "other", 0.2),
        ("norway_2007", "horizontal", 0.5),
    ],
)
def test_each_kind_of_tank_has_one_limit_of_its_volumes(name, tank, percent):
    limits = [one for one in shipped_rule(name).uncertainty if one.of == "volumes"]
    (limit,) = [one for one in limits if not one.tanks or tank in one.tanks]
    assert limit.limit == pytest.approx(percent / 100)


@pytest.mark.parametrize(
    ("tank", "height"),
    [("horizontal", 1.5), ("vertical_fixed_roof", 2), ("vertical_floating_roof", 3), ("sphere", 3)],
)
def test_french_rule_states_worst_delivery_without_limit(tank, height):
    # published: arrêté of 8 July 2003, 34.3, hauteurs minimales de livraison
    found = judge(shipped_rule("france_2003"), table(datum=0.5, scale=1e-3), tank)
    (delivery,) = [one for one in found.uncertainty if one.limit.of == "deliveries"]
    assert delivery.limit.minimum_height_m == height
    assert (delivery.code, delivery.passed) == ("stated", None)
    # closed form: in a delivery only the scale is left
    assert delivery.worst_ratio == pytest.approx(K95 * 1e-3, rel=1e-9)


def test_oiml_and_french_rules_cover_every_kind_of_tank():
    for name in ("oiml_r71", "france_2003"):
        for tank in TANKS:
            assert judge(shipped_rule(name), table(), tank).code == "passed"
    assert judge(shipped_rule("inmetro_103_2022"), table(), "sphere").code == "not_for_this_tank"
    with pytest.raises(ValueError, match="kind of tank 'barrel'"):
        judge(shipped_rule("oiml_r71"), table(), "barrel")
    with pytest.raises(ValueError, match=r"expected one of .*france_2003"):
        shipped_rule("atlantis")


@pytest.mark.parametrize(
    ("tank", "code"),
    [(table(scale=5e-4), "passed"), (table(datum=0.5), "passed_in_part"),
     (table(scale=2e-3), "failed"), (table(critical=(-1, 11)), "nothing_to_judge")],
)  # fmt: skip
def test_the_code_of_the_whole_rule(tank, code):
    found = judge(shipped_rule("oiml_r71"), tank, "vertical_fixed_roof")
    assert found.code == code
    assert found.verified is False


def test_norway_is_for_tanks_up_to_20_000_m3():
    rule = shipped_rule("norway_2007")
    large = table(volume=2001 * HEIGHTS)
    assert judge(rule, large, "sphere").code == "not_for_this_tank"
    found = judge(rule, table(volume=1999 * HEIGHTS, scale=2e-3), "sphere")
    assert found.code == "passed"
    assert found.capacity_m3 == pytest.approx(19990)
    assert [one.limit.of for one in found.uncertainty] == ["volumes", "deliveries"]


def test_a_new_table_against_the_former_one():
    # published: arrêté of 14 September 2020, article 3: 0.3 % at the top and of the whole range
    rule = shipped_rule("france_2020_recalibration")
    former = StatedVolume(1002.9, 10.0), StatedVolume(1003.1, 10.0, 0.0)
    found = judge(rule, table(datum=0.5), "vertical_fixed_roof", stated=former)
    assert [one.code for one in found.deviation] == ["conforms", "fails"]
    assert (found.code, found.verified) == ("failed", True)
    assert judge(rule, table(), "sphere").code == "nothing_to_judge"


def test_the_verdict_is_ready_for_json():
    rule = shipped_rule("france_2020_recalibration")
    both = replace(rule, uncertainty=shipped_rule("france_2003").uncertainty)
    former = (StatedVolume(1000.0, 10.0),)
    verdict = judge(both, table(datum=0.5), "vertical_fixed_roof", stated=former)
    found = to_plain(rule_of(verdict))
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert found["code"] == "passed_in_part"
    assert found["uncertainty"][0]["worst_ratio"] is None
    assert found["uncertainty"][0]["verified"] is True
    assert found["deviation"][0]["dof"] is None
    assert found["deviation"][0]["stated_m3"] == 1000
    nothing = to_plain(rule_of(judge(rule, table(critical=(-1, 11)), "sphere")))
    assert nothing["capacity_m3"] is None


def test_a_limit_that_nothing_was_held_against_is_named():
    """A deviation of the capacity without a stated volume at the top: no rule is simply passed."""
    limits = (deviation(), replace(deviation(of="capacity"), name="top"))
    rule = replace(shipped_rule("oiml_r71"), uncertainty=(), deviation=limits)
    middle, top = StatedVolume(500.0, 5.0), StatedVolume(1000.0, 9.9991)
    found = judge(rule, table(scale=1e-5), "sphere", stated=[middle])
    assert (found.code, found.unjudged) == ("not_all_judged", ("top",))
    both = judge(rule, table(scale=1e-5), "sphere", stated=[middle, top])
    assert (both.code, both.unjudged) == ("passed", ())


# --- the U that is printed


def printed(rows=None, pairs=None, factor=1.0):
    """Monte Carlo's U in the rows of {row: U}; of the others that of the table."""
    U, by_gum = table(datum=0.1).U_m3.copy(), np.full(101, True)
    for row, value in (rows or {}).items():
        U[row], by_gum[row] = value, False
    return PrintedU(U, by_gum, pairs or {}, factor)


def test_rows_are_judged_by_the_U_that_is_printed():
    """U of 0.196 m3 everywhere keeps 0.2 % from 98 m3 on; 1.5 m3 in the row of 500 m3 does not."""
    alone = judge_uncertainty(uncertainty(), table(datum=0.1))
    assert alone.from_m == pytest.approx(1.0)
    found = judge_uncertainty(uncertainty(), table(datum=0.1), printed=printed({50: 1.5}))
    assert found.from_m == pytest.approx(5.1)


@pytest.mark.parametrize(
    ("dip", "expected"), [(5.0, 1.5), (5.04, 1.5), (4.96, 1.5), (6.04, None), (6.0, None)]
)
def test_a_guard_band_is_the_U_that_is_printed_at_the_dip(dip, expected):
    """At a row its own; between two rows the largest; elsewhere that of the table."""
    one, limit = table(datum=0.1), deviation(guard="U")
    stated = StatedVolume(100 * dip, dip)
    found = judge_deviation(limit, one, stated, printed({50: 1.5}))
    own = one.at(dip).U_m3
    assert found.guard_m3 == found.U_m3 == (expected or own)
    assert found.u_m3 == pytest.approx(one.at(dip).u_m3 * found.U_m3 / own)


def test_deviation_in_guard_band_of_printed_U_is_refused():
    """9.37 m3 off, limit 10 m3: accepted with U 0.61, not with 0.64."""
    rule = replace(
        shipped_rule("oiml_r71"), uncertainty=(), deviation=(deviation(limit_m3=10.0, guard="U"),)
    )
    one = table(datum=0.61 / K95)
    stated = [StatedVolume(500.0 + 9.37, 5.0)]
    assert judge(rule, one, "sphere", stated=stated).code == "passed"
    U = np.where(np.arange(101) == 50, 0.64, one.U_m3)
    larger = PrintedU(U, one.U_m3 == U)
    assert judge(rule, one, "sphere", stated=stated, printed=larger).code == "not_accepted"


def test_deliveries_are_judged_with_factor_of_simulated_ones():
    one, limit = table(scale=1e-3), uncertainty("deliveries", 0.2, minimum=1.0)
    assert judge_uncertainty(limit, one).code == "holds"  # U/V = 0.196 %
    found = judge_uncertainty(limit, one, printed=printed(factor=1.1))
    assert found.code == "fails"
    assert found.worst_ratio == pytest.approx(1.1 * K95 * 1e-3)
    stated = StatedVolume(200.0, 5.0, 3.0)
    delivered = deviation("deliveries", 1.0, guard="U")
    simulated = judge_deviation(delivered, one, stated, printed(pairs={(3.0, 5.0): 0.5}))
    assert simulated.U_m3 == 0.5
    other = judge_deviation(delivered, one, stated, printed(factor=1.1))
    assert other.U_m3 == pytest.approx(1.1 * one.delivery(3.0, 5.0).U_m3)
