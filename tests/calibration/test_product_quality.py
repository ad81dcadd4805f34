"""Bias, precision and classes of a product: printed limits, closed forms, rates of rejection."""

import json
from dataclasses import replace
from itertools import product as combined

import numpy as np
import pytest
from draws import draws
from scipy import stats

from tankcal.calibration.product import (
    Limit,
    LimitTable,
    check_product,
    chi2_limit,
    read_limits,
    shipped_limits,
    t_limit,
)
from tankcal.calibration.product.differences import collect_differences, read_differences
from tankcal.errors import InputError
from tankcal.record.camera import plain_product
from tankcal.record.versions import CAMERA
from tankcal.survey.results import CheckPoints


def scattered(n, mean=0.0, sd=1.0, seed=0):
    """(n,) numbers whose sample mean and sd are exactly these."""
    d = np.random.default_rng(seed).normal(size=n)
    d -= d.mean()
    return mean + sd * d / d.std(ddof=1)


def test_the_limits_are_as_printed(shared):
    # published: P tables 1 and 2
    facts = json.loads((shared / "facts" / "pessoa_T01_T02_pec_pcd.json").read_text())
    limits = {(one.part, one.scale, one.grade): one for one in shipped_limits().limits}
    assert len(limits) == 48
    for part, table in (("plan", "planimetry_T1"), ("height", "altimetry_T2")):
        for scale, classes in facts[table].items():
            for grade, printed in classes.items():
                found = limits[part, scale, grade]
                assert (found.tolerance_m, found.sd_m) == (printed["PEC_m"], printed["EP_m"])


def test_the_source_of_the_limits_is_named():
    table = shipped_limits()
    assert "Pessoa 2017" in table.source
    assert not table.verified
    assert table.share == 0.9


def test_t_is_as_printed(shared):
    # published: P, for nine points; two-sided 5 %
    facts = json.loads((shared / "facts" / "pessoa_eq31_39_planning.json").read_text())
    assert t_limit(9) == pytest.approx(facts["t_table"], abs=5e-4)


@pytest.mark.parametrize(("n", "alpha"), list(combined((2, 9, 30, 500), (0.01, 0.05, 0.1))))
def test_quantiles_are_those_of_another_program(n, alpha):
    assert t_limit(n, alpha) == pytest.approx(stats.t.ppf(1 - alpha / 2, n - 1), rel=1e-9)
    assert chi2_limit(n, alpha) == pytest.approx(stats.chi2.ppf(1 - alpha, n - 1), rel=1e-9)


def test_t_chi2_and_rmse_have_their_closed_forms():
    d = scattered(9, 0.3, 0.4)
    found = check_product(d[:, None], ("z",), expected_sd_m=(0.5,)).checks[0]
    assert found.mean_m == pytest.approx(0.3)
    assert found.t == pytest.approx(0.3 / 0.4 * 3)  # 2.25 < 2.306
    assert not found.biased
    assert found.rmse_m == pytest.approx(np.sqrt(0.3**2 + 0.4**2 * 8 / 9))
    assert found.rmse_unbiased_m == found.rmse_m
    assert found.precision.chi2 == pytest.approx(8 * 0.64)
    assert found.precision.passed


def test_a_significant_mean_is_taken_off():
    d = scattered(9, 0.31, 0.4)
    found = check_product(d[:, None], ("z",)).checks[0]
    assert found.biased  # t = 2.325 > 2.306
    assert found.rmse_unbiased_m == pytest.approx(0.4 * np.sqrt(8 / 9))
    assert found.largest_m == np.abs(d).max()
    assert not check_product(d[:, None], ("z",), alpha=0.01).checks[0].biased


def test_t_is_that_of_another_program():
    d = np.random.default_rng(3).normal(0.2, 1, 17)
    other = stats.ttest_1samp(d, 0)
    found = check_product(d[:, None], ("x",), alpha=0.07).checks[0]
    assert found.t == pytest.approx(other.statistic)
    assert found.biased == (other.pvalue < 0.07)


@pytest.mark.slow
@pytest.mark.twentieth
@pytest.mark.parametrize("alpha", [0.05, 0.2])
def test_good_products_are_rejected_at_the_nominal_rate(alpha, figure):
    trials = 2000
    _rates(trials, alpha, figure)


@pytest.mark.study
@pytest.mark.parametrize("alpha", [0.01, 0.05, 0.1])
def test_good_products_are_rejected_at_the_nominal_rate_in_full(alpha, figure):
    """Band at alpha 5 %: 0.49 % of 10 000 products, 0.25 % of 40 000; the slow test has 1.1 %."""
    _rates(draws(10_000, 40_000), alpha, figure)


def _rates(trials, alpha, figure):
    # simulation: band of 3.9 sds of the binomial distribution (1 in 10 000)
    rng, biased, imprecise = np.random.default_rng(11), 0, 0
    for _ in range(trials):
        d = rng.normal(0, [0.3, 0.2, 0.7], (9, 3))
        checks = check_product(d, alpha=alpha, expected_sd_m=(0.3, 0.2, 0.7)).checks
        biased += sum(one.biased for one in checks)
        imprecise += sum(not one.precision.passed for one in checks)
    band = 3.9 * np.sqrt(alpha * (1 - alpha) / (3 * trials))
    figure(f"rate of the bias test at alpha {alpha}", round(biased / (3 * trials), 4))
    figure(f"rate of the precision test at alpha {alpha}", round(imprecise / (3 * trials), 4))
    assert abs(biased / (3 * trials) - alpha) < band
    assert abs(imprecise / (3 * trials) - alpha) < band


def test_precision_of_a_class_is_that_of_one_coordinate():
    # closed form: sigma_E = sigma_N = EP / sqrt(2), in height EP
    d = np.column_stack([scattered(20, 0, 0.1, k) for k in range(3)])
    found = check_product(d, limits=shipped_limits())
    plan, height = (
        next(one for one in found.verdicts if (one.part, one.scale, one.grade) == (p, "1000", "A"))
        for p in ("plan", "height")
    )
    assert [one.sigma_m for one in plan.precision] == pytest.approx([0.17 / np.sqrt(2)] * 2)
    assert [one.chi2 for one in plan.precision] == pytest.approx([19 * 2 * (0.1 / 0.17) ** 2] * 2)
    assert [one.sigma_m for one in height.precision] == [0.33]
    assert plan.precise
    assert height.precise


def at_distance(*size_m):
    """Differences (n, 2) with these magnitudes in plan."""
    turn = np.linspace(0, 2 * np.pi, len(size_m), endpoint=False)
    return np.array(size_m)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])


def verdict(d, grade="A", scale="1000"):
    found = check_product(d, ("x", "y"), limits=shipped_limits())
    return next(one for one in found.verdicts if (one.scale, one.grade) == (scale, grade))


def test_ninety_percent_are_counted():
    # closed form: 18 of 20 within 0.28 m is 90 %, 17 is not
    exactly = verdict(at_distance(*[0.1] * 18, 0.29, 0.29))
    assert (exactly.as_is.within, exactly.as_is.reached) == (18, True)
    fewer = verdict(at_distance(*[0.1] * 17, 0.29, 0.29, 0.29))
    assert (fewer.as_is.within, fewer.as_is.why) == (17, ("share_too_small",))


def test_rmse_counts_in_addition_to_the_share():
    found = verdict(at_distance(*[0.2] * 20))
    assert found.as_is.share == 1
    assert found.as_is.why == ("rmse_too_large",)
    assert found.as_is.rmse_m == pytest.approx(0.2)


def test_rmse_in_plan_is_that_of_both_coordinates():
    d = np.column_stack([scattered(12, 0, 0.3), scattered(12, 0, 0.4, 1)])
    found = check_product(d, ("x", "y"))
    assert found.parts[0].rmse_m == pytest.approx(np.hypot(*(c.rmse_m for c in found.checks)))


def test_a_bias_taken_off_improves_the_class():
    d = np.column_stack([scattered(20, 0.4, 0.05), scattered(20, 0, 0.05, 1)])
    found = check_product(d, ("x", "y"), limits=shipped_limits())
    assert [one.biased for one in found.checks] == [True, False]
    assert found.best("plan", "1000") == "C"  # 0.4 m within PEC 0.8 and EP 0.5, not 0.3
    assert found.best("plan", "1000", unbiased=True) == "A"
    assert found.best("height", "1000") is None


def test_every_class_of_a_scale_after_the_best_is_reached():
    # property: limits grow from class to class and from scale to scale
    for seed in range(20):
        d = np.random.default_rng(seed).normal(0, 0.2 * (1 + seed), (25, 3))
        found = check_product(d, limits=shipped_limits()).verdicts
        for part in ("plan", "height"):
            reached = [one.as_is.reached for one in found if one.part == part]
            for scale in range(0, 24, 4):
                assert sorted(reached[scale : scale + 4]) == reached[scale : scale + 4]


def test_axes_that_are_not_known_are_reported():
    d = np.full((12, 3), np.nan)
    d[:, 2] = scattered(12)
    found = check_product(d, limits=shipped_limits())
    assert [one.n for one in found.checks] == [0, 0, 12]
    assert ("no_plan", 0) in found.notes
    assert {one.part for one in found.verdicts} == {"height"}
    assert (
        json.loads(json.dumps(plain_product(found), allow_nan=False))["axes"][0]["mean_m"] is None
    )


def test_points_of_one_part_only_still_count_there():
    d = np.full((30, 3), np.nan)
    d[:12, :2], d[12:, 2] = 0.1, scattered(18)
    found = check_product(d, limits=shipped_limits())
    assert [part.n for part in found.parts] == [12, 18]


@pytest.mark.parametrize(
    ("n", "codes"),
    [
        (1, {"no_tests", "few_points", "share_means_all"}),
        (2, {"few_points", "share_means_all"}),
        (9, {"few_points", "share_means_all"}),
        (10, {"few_points"}),
        (19, {"few_points"}),
        (20, set()),
    ],
)
def test_too_few_points_are_reported(n, codes):
    d = np.random.default_rng(1).normal(0, 0.1, (n, 3))
    found = check_product(d, limits=shipped_limits())
    assert {code for code, _ in found.notes} == codes
    json.dumps(plain_product(found), allow_nan=False)


def test_one_point_cannot_be_tested():
    found = check_product([[0.1, 0.2, 0.3]], limits=shipped_limits(), expected_sd_m=(1, 1, 1))
    assert [one.biased for one in found.checks] == [None] * 3
    assert found.checks[0].precision.passed is None
    assert found.verdicts[0].precise is None


def test_differences_without_scatter_are_a_bias():
    found = check_product(np.full((5, 1), 0.2), ("z",)).checks[0]
    assert found.biased
    assert found.t is None
    assert found.rmse_unbiased_m == pytest.approx(0, abs=1e-15)
    assert not check_product(np.zeros((5, 1)), ("z",)).checks[0].biased


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: check_product([[1.0]], ("w",)), "axes"),
        (lambda: check_product([[1.0, 2.0]], ("x", "x")), "axes"),
        (lambda: check_product([[np.inf]], ("x",)), "infinite"),
        (lambda: check_product([[1.0]], ("x",), alpha=1.0), "alpha"),
        (lambda: check_product([[1.0]], ("x",), names=("a", "b")), "names"),
        (lambda: check_product([[1.0]], ("x",), expected_sd_m=(0,)), "above 0"),
        (lambda: check_product([[1.0]], ("x",), expected_sd_m=(np.nan,)), "above 0"),
    ],
)
def test_nonsense_is_refused(call, match):
    with pytest.raises(ValueError, match=match):
        call()


def test_no_points_at_all():
    found = check_product(np.zeros((0, 3)), limits=shipped_limits())
    assert found.verdicts == ()
    json.dumps(plain_product(found), allow_nan=False)


# limit tables of one's own

OWN = """
[table]
name = "House rules"
source = "drawing 17"
verified = true
share = 0.95
[height.shop]
good = {tolerance_m = 0.002, sd_m = 0.001}
fair = {tolerance_m = 0.004, sd_m = 0.002}
"""


def test_a_table_of_ones_own(tmp_path):
    (tmp_path / "own.toml").write_text(OWN)
    table = read_limits(tmp_path / "own.toml")
    assert table == LimitTable(
        "House rules",
        "drawing 17",
        (
            Limit("height", "shop", "good", 0.002, 0.001),
            Limit("height", "shop", "fair", 0.004, 0.002),
        ),
        0.95,
        True,
    )
    d = scattered(40, 0, 0.0015)[:, None]
    assert check_product(d, ("z",), limits=table).best("height", "shop") == "fair"


def test_all_problems_of_a_table_in_one_run(tmp_path):
    (tmp_path / "bad.toml").write_text(
        '[table]\nname = "x"\nshare = 1.5\nsourse = "y"\n[plan.1000]\nA = {tolerance_m = -1}\n'
        "B = 3\n[hight.1000]\nA = {tolerance_m = 1, sd_m = 1}\n"
        '[height.5]\nA = {tolerance_m = 2, sd_m = 1, note = "z"}\n'
        "B = {tolerance_m = 1, sd_m = nan}\n"
    )
    with pytest.raises(InputError) as caught:
        read_limits(tmp_path / "bad.toml")
    text = str(caught.value)
    for part in (
        "table.source: missing",
        "table.sourse: unknown key",
        "did you mean source?",
        "table.share: found 1.5",
        "row 6, plan.1000.A.tolerance_m: found -1",
        "plan.1000.A.sd_m: missing",
        "expected classes such as",
        "did you mean height?",
        "height.5.A.note: unknown key",
        "height.5.B.sd_m: found nan",
    ):
        assert part in text
    assert all("bad.toml" in line for line in text.splitlines())


def test_classes_are_listed_best_first(tmp_path):
    (tmp_path / "own.toml").write_text(
        OWN.replace("good", "x").replace("fair", "good").replace("0.004", "0.001")
    )
    with pytest.raises(InputError, match=r"height\.shop\.good: smaller than the class before"):
        read_limits(tmp_path / "own.toml")


@pytest.mark.parametrize("text", ["", "[table]\n", "= 3", "\0", "[table]\nname=1\nsource=2\n"])
def test_a_file_that_is_no_table(tmp_path, text):
    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(InputError):
        read_limits(tmp_path / "own.toml")
    with pytest.raises(InputError, match="expected a file"):
        read_limits(tmp_path)


# differences


def test_differences_are_read_both_ways(tmp_path):
    (tmp_path / "a.csv").write_text("point,dx_m,dz_m\nP1,0.01,\nP2,-0.02,0.5\n")
    (tmp_path / "b.csv").write_text(
        "point;x_m;x_ref_m;z_m;z_ref_m\nP1;10,01;10;;\nP2;9,98;10;1,5;1\n"
    )
    one = read_differences(tmp_path / "a.csv")
    other = read_differences(tmp_path / "b.csv", ";", ",")
    expected = [[0.01, np.nan, np.nan], [-0.02, np.nan, 0.5]]
    for found in (one, other):
        assert found.names == ("P1", "P2")
        assert found.difference_m == pytest.approx(np.array(expected), nan_ok=True)
    axes, d = one.select_known_axes()
    assert axes == ("x", "z")
    assert d.shape == (2, 2)


def test_all_problems_of_differences_in_one_run(tmp_path):
    (tmp_path / "d.csv").write_text(
        "point,x_m,x_ref_m,y_m,hight\n"
        "=cmd(),1,2,3,4\nP1,nan,2,,\nP1,1,,,\n,1,2,,\nP5,,,,\nP6,1,2\nP7,1e400,2,,\n"
    )
    with pytest.raises(InputError) as caught:
        read_differences(tmp_path / "d.csv")
    text = str(caught.value)
    for part in (
        "hight: unknown column",
        "y_ref_m: missing column; the other one of its pair is given, expected both",
        "row 2, point: found '=cmd()'",
        "row 3, x_m: found 'nan'",
        "row 4, x_ref_m: missing",
        "row 4, point: point P1 is already in row 3",
        "row 5, point: missing",
        "row 6: no difference in this row",
        "row 7: 3 cells, expected 5",
        "row 8, x_m: found",
    ):
        assert part in text


@pytest.mark.parametrize(
    "text",
    ["", "point\nP1\n", "dx_m\n1\n", "point,dx_m\n", "point,dx_m,x_m,x_ref_m\nP1,1,2,3\n"],
)
def test_a_file_that_holds_no_differences(tmp_path, text):
    (tmp_path / "d.csv").write_text(text)
    with pytest.raises(InputError):
        read_differences(tmp_path / "d.csv")


def test_differences_of_adjustment_and_record_agree():
    points = CheckPoints(
        ("A", "B"), np.array([[1.0, 2, np.nan], [3, 4, 5]]), np.ones((2, 3)), 1.0, 2.0, 1.0
    )
    adjustment = type("Stub", (), {"check_points": points})
    rows = [
        {"point": "A", "dx_m": 1.0, "dy_m": 2.0, "dz_m": None},
        {"point": "B", "dx_m": 3.0, "dy_m": 4.0, "dz_m": 5.0},
    ]
    part = {"check_points": {"points": rows}}
    for source in (adjustment, part, {"adjustment": part, "tank": {}}):
        found = collect_differences(source)
        assert found.names == ("A", "B")
        assert found.difference_m == pytest.approx(points.difference_m, nan_ok=True)
    for none in ({}, {"adjustment": None}, type("Stub", (), {"check_points": None})):
        with pytest.raises(InputError, match="no check points"):
            collect_differences(none)


def test_json_agrees_with_the_check():
    d = np.column_stack([scattered(20, 0.4, 0.05), scattered(20, 0, 0.05, 1)])
    found = plain_product(check_product(d, ("x", "y"), limits=shipped_limits()))
    assert (found["format"], found["kind"]) == (CAMERA.format, "product")
    first = next(one for one in found["best"] if one["scale"] == "1000")
    assert (first["grade"], first["grade_unbiased"]) == ("C", "A")
    assert found["verdicts"][0]["as_is"]["why"] == ["share_too_small", "rmse_too_large"]
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_only_a_significant_mean_is_taken_out_of_the_plan():
    """Closed form: x is biased, y is not; each point's size is that of (dx - mean x, dy)."""
    dx, dy = scattered(12, 0.9, 0.3, 1), scattered(12, 0.05, 0.4, 2)
    (part,) = check_product(np.column_stack([dx, dy]), ("x", "y")).parts
    expected = np.sqrt(np.mean((dx - 0.9) ** 2 + dy**2))
    assert part.rmse_unbiased_m == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("share", "n", "within"), [(0.07, 100, 7), (0.9, 10, 9), (0.29, 100, 29)])
def test_a_share_and_a_tolerance_that_are_just_kept(share, n, within):
    """Property: differences on the tolerance are within it; 0.07 of 100 are 7, whatever 0.07 is."""
    d = np.where(np.arange(n) < within, 0.5, 0.5000001)
    table = LimitTable("t", "s", (Limit("height", "1", "A", 0.5, 10.0),), share)
    (verdict,) = check_product(d[:, None], ("z",), limits=table).verdicts
    assert verdict.as_is.within == within
    assert verdict.as_is.reached
    less = replace(table, share=share + 1e-6)
    assert not check_product(d[:, None], ("z",), limits=less).verdicts[0].as_is.reached


@pytest.mark.parametrize("n", [1, 2])
def test_one_or_two_points_make_no_class(n):
    found = check_product(np.zeros((n, 1)), ("z",), limits=shipped_limits())
    assert not any(one.as_is.reached for one in found.verdicts)
    assert found.verdicts[0].as_is.why == ("too_few_points",)
