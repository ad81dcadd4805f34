"""Which parameters belong to a camera: tests, predictions, effects, rules, and dropping them."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from photographed_jobs import tank_job
from scipy import stats
from surveyed import by_photographs

import tankcal
from tankcal.calibration.interiors import Frame, collect_interiors, left_shifts, own_shift
from tankcal.calibration.parameters.analysis import (
    Dropping,
    analyse_job,
    analyse_record,
    compare_points,
    read_interior_after,
)
from tankcal.calibration.parameters.judgement import (
    Choices,
    ZeroTest,
    compute_f,
    critical_f,
    drop_parameters,
    group_tests,
    single_tests,
)
from tankcal.calibration.parameters.recommendation import Evidence, Limit, pessoa_rule, recommend
from tankcal.camera.model import PARAMETERS, Form
from tankcal.errors import InputError
from tankcal.record import record_of, record_of_adjustment
from tankcal.record.camera import plain_parameters
from tankcal.record.versions import CAMERA
from tankcal.survey import adjust_survey
from tankcal.survey.measurements import AdjustmentSettings
from tankcal.survey.network.adjustment import global_test

NAMES = ("c", "x0", "y0", "K1", "K2", "K3", "P1", "P2", "A", "B")
DOF = (2470, 2462, 2532)  # published: P, Quadro 4
PESSOA_PIXEL_MM = 6.17219 / 4608
QUIET = AdjustmentSettings(snooping=False)


@pytest.fixture(scope="module")
def calibrations(shared):
    """Values (7, 10) and sds (7, 10) of Pessoa's seven calibrations, tables 6 to 9."""
    with open(shared / "facts" / "pessoa_T06_T09_iop.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    keys = ("f", *NAMES[1:])
    return tuple(
        np.array([[float(row[before + key]) for key in keys] for row in rows])
        for before in ("", "s_")
    )


@pytest.fixture(scope="module")
def silva_job():
    """The shipped simulation of Silva's photographs."""
    return tankcal.load(Path(__file__).parents[2] / "examples" / "silva-1995-photos")


@pytest.fixture(scope="module")
def silva_result(silva_job):
    return tankcal.run(silva_job)


@pytest.fixture(scope="module")
def silva_parameters(silva_job, silva_result):
    return analyse_job(silva_job, adjustment=silva_result.adjustment)[0]


@pytest.fixture(scope="module")
def a_tank(tmp_path_factory):
    """A small tank job without measurements."""
    return tank_job(tmp_path_factory.mktemp("tank"))


def job_of(a_tank, measurements, tank=False):
    """A Job of measurements, without a tank unless asked for one."""
    return replace(a_tank, measurements=measurements, tank=a_tank.tank if tank else None)


def with_cameras(measurements, *cameras):
    """Measurements whose cameras (network.Camera) are others."""
    setups = tuple(replace(measurements.cameras[0], camera=one) for one in cameras)
    return replace(measurements, cameras=setups)


# --- significance -------------------------------------------------------------------------------


def test_published_f_of_single_parameters_and_critical_values(shared, calibrations, figure):
    """Published: P table 10, sets 1 to 3, 1 %; F(0.90; p, dof) 2.71, 2.30, 2.09."""
    values, sds = calibrations
    with open(shared / "facts" / "pessoa_T10_F.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    worst = 0.0
    for number, dof in enumerate(DOF):
        tests = single_tests(NAMES, values[number], np.diag(sds[number] ** 2), dof, 0.10)
        for test, row in zip(tests, rows, strict=True):
            published = float(row[f"set{number + 1}"])
            worst = max(worst, abs(test.f / published - 1))
            assert test.significant == (published > 2.71)
        assert [round(critical_f(p, dof, 0.10), 2) for p in (1, 3)] == [2.71, 2.09]
        assert critical_f(2, dof, 0.10) == pytest.approx(2.30, abs=0.0051)  # 2.305, printed 2.3
    figure("P table 10: F of single parameters off by at most", f"{100 * worst:.2f} %")
    assert worst < 0.01


def test_published_f_of_groups(shared, calibrations):
    """Published: P table 11 set 1 through table 12, 1 %; K1 K2 K3: 1306 to 4698 by the rounding."""
    values, sds = (part[0] for part in calibrations)
    table = json.loads(
        (shared / "facts" / "pessoa_T12_correlation_set1.json").read_text(encoding="utf-8")
    )
    covariance = np.array(table["R"]) * np.outer(sds, sds)
    found = {test.names: test for test in group_tests(NAMES, values, covariance, DOF[0], 0.10)}
    assert found["x0", "y0"].f == pytest.approx(1.96e4, rel=0.01)
    assert found["P1", "P2"].f == pytest.approx(1.11e4, rel=0.01)
    assert found["A", "B"].f == pytest.approx(1.11e1, rel=0.01)
    assert 1306 < found["K1", "K2", "K3"].f < 4698
    assert all(test.significant for test in found.values())


@pytest.mark.parametrize(
    ("number", "s", "chi2", "table"),
    [(0, 0.4894, 591.49, 2560.49), (1, 0.4827, 573.68, 2552.35), (2, 0.5657, 810.32, 2623.61)],
)
def test_published_global_test(number, s, chi2, table):
    """Published: P table 5, chi2 = dof s2 (0.11) and the one-sided quantile of 0.90 (0.01)."""
    found = global_test(DOF[number] * s**2, DOF[number], 0.90, sides=1)
    assert found.chi2 == pytest.approx(chi2, abs=0.11)
    assert found.high == pytest.approx(table, abs=0.01)
    assert found.passed


def test_f_of_a_group_is_that_of_the_inverse_in_any_units():
    """Second method: the explicit inverse; property: units do not matter."""
    rng = np.random.default_rng(0)
    a = rng.normal(size=(3, 9))
    covariance, values = a @ a.T, rng.normal(size=3)
    expected = values @ np.linalg.inv(covariance) @ values / 3
    assert compute_f(values, covariance) == pytest.approx(expected, rel=1e-12)
    unit = np.array([1e-4, 1e-9, 1e-14])
    assert compute_f(unit * values, np.outer(unit, unit) * covariance) == pytest.approx(expected)


@pytest.mark.slow
def test_f_of_groups_rejects_as_often_as_alpha_says(figure):
    """Simulation: 4000 groups of three that are zero, with sigma0 of 12 degrees of freedom."""
    rng, dof, alpha = np.random.default_rng(4), 12, 0.05
    covariance = np.array([[2.0, 0.9, 0.1], [0.9, 1.0, 0.3], [0.1, 0.3, 0.5]])
    x = rng.normal(size=(4000, 3)) @ np.linalg.cholesky(covariance).T
    sigma0 = rng.chisquare(dof, 4000) / dof
    f = [compute_f(one, s * covariance) for one, s in zip(x, sigma0, strict=True)]
    share = np.mean(np.array(f) > critical_f(3, dof, alpha))
    figure("groups of zero called significant at 5 %", f"{100 * share:.2f} %")
    assert share == pytest.approx(alpha, abs=4 * np.sqrt(alpha * (1 - alpha) / 4000))


def test_a_parameter_without_a_sound_group_is_reported():
    """Closed form: two parameters of correlation 1."""
    (found,) = group_tests(("A", "B"), [1.0, 2.0], np.ones((2, 2)), np.inf)
    assert not found.positive_definite
    assert found.significant is None
    assert np.isnan(found.f)


def test_tests_against_a_known_sigma0_are_chi_square():
    """Closed form: normal 1.96^2 and the p-value at the critical value is alpha."""
    assert critical_f(1, np.inf) == pytest.approx(1.959964**2, rel=1e-6)
    for dof in (7.0, np.inf):
        critical = critical_f(1, dof)
        (test,) = single_tests(("K1",), [np.sqrt(critical)], np.eye(1), dof)
        assert test.p_value == pytest.approx(0.05)


def test_c_is_tested_but_decides_nothing():
    c, k1 = single_tests(("c", "K1"), [100.0, 1.0], np.eye(2), 10)
    assert c.significant
    assert (c.decides, k1.decides) == (False, True)


def test_unknown_groups_and_levels_are_refused():
    with pytest.raises(ValueError, match="K4"):
        group_tests(("K1", "K2"), [1, 2], np.eye(2), 10, groups=(("K1", "K4"),))
    with pytest.raises(ValueError, match="alpha"):
        critical_f(1, 10, 1.5)


# --- predictions --------------------------------------------------------------------------------


def test_schur_complement_predicts_dropping_parameters():
    """Second method: a linear least-squares problem solved without the columns."""
    rng = np.random.default_rng(2)
    scale = np.array([1.0, 1e-3, 1e-8, 1e-12, 10.0])
    design, observed = rng.normal(size=(40, 5)) / scale, rng.normal(size=40)
    normal = design.T @ design
    covariance = np.linalg.inv(normal * np.outer(scale, scale)) * np.outer(scale, scale)
    x = covariance @ design.T @ observed
    kept = [0, 2, 4]
    less = design[:, kept] * scale[kept]
    expected = scale[kept] * np.linalg.lstsq(less, observed, rcond=None)[0]
    found = drop_parameters(tuple("abcde"), covariance, ("d", "b"), x)
    assert (found.dropped, found.kept) == (("b", "d"), ("a", "c", "e"))
    np.testing.assert_allclose(found.values, expected, rtol=1e-9)
    sds = scale[kept] * np.sqrt(np.diag(np.linalg.inv(less.T @ less)))
    np.testing.assert_allclose(found.sds, sds, rtol=1e-9)


def test_dropping_inseparable_parameters_predicts_nothing():
    covariance = np.array([[1.0, 0, 0], [0, 1, 1], [0, 1, 1]])
    found = drop_parameters(("c", "A", "B"), covariance, ("A", "B"), [1.0, 2, 3])
    assert not found.positive_definite
    assert np.isnan(found.sds).all()
    with pytest.raises(ValueError, match="K1"):
        drop_parameters(("c", "A"), np.eye(2), ("K1",))


# --- effects ------------------------------------------------------------------------------------


def interior(**values):
    return np.array([values.get(name, 0.0) for name in PARAMETERS])


def test_effect_of_radial_term_is_in_farthest_corner():
    """Closed form: K3 r^7, the corner (90 + 1, 60 + 2) from the principal point."""
    q = interior(c=100.0, x0=1.0, y0=-2.0, K1=3e-8, K3=1e-15)
    frame = Frame(np.array([90.0, 60.0]), 50.0, np.array([0.01, 0.02]))
    found = own_shift("K3", q, Form(), frame)
    x, y = 91.0, 62.0
    shift = 1e-15 * np.hypot(x, y) ** 6 * np.array([x, y])
    assert found.corner_um == pytest.approx(1e3 * np.hypot(*shift))
    assert found.corner_px == pytest.approx(np.hypot(*(shift / [0.01, 0.02])))
    assert found.largest_um == pytest.approx(found.corner_um)
    assert found.rms_um < found.corner_um
    assert found.seen_um <= 1e3 * 1e-15 * (50 + np.hypot(1, 2)) ** 7
    assert own_shift("c", q, Form(), frame) is None
    before = Form("correction_subtracted", "before_distortion")
    linear = np.array([50.0, *[0] * 10, 2e-4, 0])  # closed form: A x, whatever the convention
    assert own_shift("A", linear, before, frame).largest_um == pytest.approx(1e3 * 2e-4 * 90)
    assert own_shift("B", linear, before, frame).largest_um == 0
    assert own_shift("y0", q, Form(), frame).rms_um == pytest.approx(2000)


@pytest.mark.parametrize(
    "convention", ["distortion_of_ideal", "correction_added", "correction_subtracted"]
)
def test_remaining_effect_is_zero_when_others_take_over(convention):
    """Property: the same camera leaves nothing; a shift of x0 is a turn, but for (r/c)^2 of it."""
    q = interior(c=100.0, x0=0.1, K1=2e-8, P1=1e-6)
    frame = Frame(np.array([30.0, 20.0]))
    same, turned = left_shifts(q, q, Form(convention), frame)
    assert same.largest_um == turned.largest_um == 0
    assert np.isnan(same.corner_px)
    moved = interior(c=100.0, x0=0.15, K1=2e-8, P1=1e-6)
    left, turned = left_shifts(q, moved, Form(convention), frame)
    assert left.rms_um == pytest.approx(50, rel=0.01)
    assert turned.largest_um < 4  # of order 50 (r/c)^2: a small turn about y is no plain shift


# --- the authors' rules and ours ----------------------------------------------------------------


def pessoa_evidence(calibrations, number):
    """Tests and own effects of one of Pessoa's sets, in pixels."""
    values, sds = (part[number] for part in calibrations)
    q = interior(**dict(zip(NAMES, values, strict=True)))
    form = Form("correction_subtracted", "both_x")
    frame = Frame(np.array([2304, 1728]) * PESSOA_PIXEL_MM, pixel_mm=np.full(2, PESSOA_PIXEL_MM))
    tests = single_tests(NAMES, values, np.diag(sds**2), DOF[number], 0.10)
    return tests, {name: own_shift(name, q, form, frame) for name in NAMES}


@pytest.mark.parametrize("number", [0, 1, 2])
def test_pessoa_keeps_k3_although_f_rejects_it(calibrations, number, figure):
    """Published: P keeps K3, whose F is below 2.71, because the corner would move by pixels."""
    tests, shifts = pessoa_evidence(calibrations, number)
    rule = pessoa_rule(tests, shifts)
    kept = dict(rule.keep)
    figure(f"K3 of P set {number + 1} in the corner", f"{shifts['K3'].corner_px:.1f} px")
    assert not tests[NAMES.index("K3")].significant
    assert kept["K3"] == "edge"
    assert kept["K1"] == "both"
    assert kept["c"] == "significant"
    assert rule.drop == ("B",)  # 0.04 px, F of 1.3 to 2.1
    told = {one.name: one for one in recommend(
        tuple(Evidence(t, shifts[t.names[0]], None) for t in tests),
        Limit(0.5 * 1e3 * PESSOA_PIXEL_MM, 0.5, "given"), Frame(np.array([3.0, 2.0])),
    )}  # fmt: skip
    codes = [reason["code"] for reason in told["K3"].reasons]
    assert told["K3"].keep
    disagree = ["not_significant", "effect_above", "insignificant_but_large"]
    assert codes == [*disagree, "product_not_tried"]
    assert not told["B"].keep
    assert [reason["code"] for reason in told["B"].reasons] == ["not_significant", "effect_below"]
    tiny = [reason["code"] for reason in told["A"].reasons]
    assert tiny == ["significant", "effect_below", "significant_but_tiny"]
    assert told["A"].keep


def a_case(f=1.0, um=1.0, name="K3", **more):
    """Evidence of a parameter: F against 3.9, a shift of some um."""
    test = ZeroTest((name,), f, 3.9, 0.5)
    q = interior(c=100.0, x0=um / 1e3)
    shift = own_shift("x0", q, Form(), Frame(np.ones(2)))
    return Evidence(test, shift, shift, **more)


def product(sds=0.1, volume=0.0):
    return {
        "largest_sds": sds, "largest_mm": 1.0, "volume_change_m3": volume, "volume_u_m3": 0.3,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("case", "keep", "code"),
    [
        (a_case(), False, "effect_below"),
        (a_case(um=9.0), True, "insignificant_but_large"),
        (a_case(f=5.0), True, "significant_but_tiny"),
        (a_case(um=9.0, product=product()), False, "product_stays"),
        (a_case(product=product(sds=0.5)), True, "product_moves"),
        (a_case(product=product(volume=0.2)), True, "product_moves"),
        (a_case(f=5.0, product=product()), True, "product_stays"),
        (a_case(failed="not determined"), True, "not_determined_without"),
        (a_case(state="weighted"), False, "known_beforehand"),
        (a_case(correlated=(("K2", -0.98),)), False, "correlated"),
        (a_case(groups=(ZeroTest(("K2", "K3"), 9.0, 3.0, 0.0),)), False, "group_significant"),
        (a_case(name="c", f=1e7), True, "principal"),
    ],
)
def test_each_situation_has_its_advice_and_its_reason(case, keep, code):
    """Property: the table of `recommending`, one row each; image accuracy 5 um."""
    (told,) = recommend((case,), Limit(5.0, np.nan, "given"), Frame(np.ones(2)))
    assert told.keep == keep
    assert code in [reason["code"] for reason in told.reasons]


def test_without_an_image_accuracy_nothing_is_called_small():
    (told,) = recommend((a_case(),), Limit(np.nan, np.nan, "residuals"), Frame(np.ones(2)))
    assert told.keep
    codes = [reason["code"] for reason in told.reasons]
    assert codes == ["not_significant", "effect_not_known", "product_not_tried"]


def test_k1_stays_where_k3_does():
    told = recommend(
        (a_case(name="K1"), a_case(name="K3", f=9.0)),
        Limit(5.0, np.nan, "given"),
        Frame(np.ones(2)),
    )
    assert [one.keep for one in told] == [True, True]
    assert told[0].reasons[-1] == {"code": "lower_order", "of": ["K3"]}


# --- dropped for real ---------------------------------------------------------------------------


@pytest.mark.slow
def test_the_prediction_agrees_with_the_survey_adjusted_again(silva_parameters, figure):
    """Second method: each parameter of the shipped simulation dropped and adjusted again."""
    worst = np.zeros(3)
    for trial in silva_parameters.trials:
        names, values, covariance = trial.after
        assert trial.comparable
        assert names == trial.predicted.kept
        sds = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(sds, sds)
        off = (
            np.abs(sds / trial.predicted.sds - 1).max(),
            np.abs((values - trial.predicted.values) / sds).max(),
            np.abs(correlation - trial.predicted.correlation).max(),
        )
        worst = np.maximum(worst, off)
    figure(
        "Schur prediction against adjustments: sds, values, correlations",
        f"{100 * worst[0]:.2f} %, {worst[1]:.3f} sd, {worst[2]:.4f}",
    )
    assert worst[0] < 0.01
    assert worst[1] < 0.1
    assert worst[2] < 0.01


@pytest.mark.slow
def test_volume_and_points_of_a_job(silva_parameters, silva_result):
    """Second method: tankcal.run of the whole job gives the volume that the others differ from."""
    volume, why = silva_parameters.base
    top = silva_result.at(silva_result.table.height_m[-1])
    assert why is None
    assert volume.value_m3 == pytest.approx(top.value_m3, abs=1e-5)  # U is 0.43: search or none
    assert volume.U_m3 == pytest.approx(top.U_m3, rel=1e-6)
    for trial in silva_parameters.trials:
        assert trial.outcome.failed is None
        assert trial.outcome.changes.count == 137
        assert trial.outcome.volume.points == 120
        assert trial.outcome.adjustment.redundancy == 496 + len(trial.names)


@pytest.mark.slow
def test_dropping_equals_adjustment_with_parameter_off(a_tank, figure):
    """Second method: adjust_survey of measurements whose camera lacks the parameters."""
    measured, _ = by_photographs(1, settings=QUIET)
    job = job_of(a_tank, measured, tank=True)
    base = adjust_survey(measured)
    outcome = Dropping(job, base).without("camera", ("P1", "P2"))
    camera = measured.cameras[0].camera
    off = tuple(
        "off" if n in ("P1", "P2") else s for n, s in zip(PARAMETERS, camera.scope, strict=True)
    )
    again = adjust_survey(with_cameras(measured, replace(camera, scope=off)))
    away = np.abs(again.xyz_m - outcome.adjustment.xyz_m).max()
    figure("points without P1 P2, two ways", f"{1e3 * away:.1e} mm")
    assert again.names == outcome.adjustment.names
    assert away < 1e-7
    assert outcome.adjustment.sigma0 == pytest.approx(again.sigma0, rel=1e-6)
    assert outcome.adjustment.redundancy == again.redundancy == base.redundancy + 2
    moved = compare_points(base, again)
    assert moved.rms_m == pytest.approx(outcome.changes.rms_m, rel=1e-3)
    changes = np.linalg.norm(again.xyz_m - base.xyz_m, axis=1)
    assert moved.largest_point == base.names[int(np.argmax(changes))]
    volume = tankcal.run(replace(job, measurements=with_cameras(
        measured, replace(camera, scope=off)))).table.volume_m3[-1]  # fmt: skip
    assert outcome.volume.value_m3 == pytest.approx(volume, abs=1e-5)


@pytest.mark.slow
def test_trials_keep_the_readings_set_aside(a_tank):
    """Property: a blunder does not come back; what missing terms bend shows in sigma0."""
    strong = np.array([100.02, 0.03, -0.04, 2e-6, -1e-12, 0, 0, 3e-7, -2e-7, 0, 0, 1e-4, -8e-5])
    measured, _ = by_photographs(3, interior=strong)
    images = measured.image_points
    xy = images.xy_mm.copy()
    xy[20] += [0.5, -0.4]
    measured = replace(measured, image_points=replace(images, xy_mm=xy))
    base = adjust_survey(measured)
    assert base.removed
    found = analyse_job(job_of(a_tank, measured), adjustment=base)[0]
    trials = {trial.names: trial.outcome for trial in found.trials}
    assert trials["A", "B"].adjustment.redundancy == base.redundancy + 2
    assert trials[("P1",)].adjustment.sigma0 < 1.5
    without_k = trials["K1", "K2"].adjustment
    assert without_k.redundancy == base.redundancy + 2
    assert base.adjusted.test().passed
    assert not without_k.adjusted.test().passed
    told = {one.name: one for one in found.recommendation}["K1"]
    assert told.keep
    assert {"significant", "product_moves"} <= {reason["code"] for reason in told.reasons}


@pytest.mark.slow
@pytest.mark.parametrize("datum", ["inner", "minimal", "fixed_photo"])
def test_any_datum_can_be_kept(a_tank, datum):
    """Property: a parameter that is next to nothing moves next to nothing, in any datum."""
    settings = AdjustmentSettings(datum=datum, snooping=False)
    measured, _ = by_photographs(2, settings=settings)
    base = adjust_survey(measured)
    outcome = Dropping(job_of(a_tank, measured), base).without("camera", ("P2",))
    assert outcome.failed is None
    assert outcome.changes.rms_sds < 1
    assert outcome.adjustment.redundancy == base.redundancy + 1


def two_cameras(scope_of_k1):
    """Measurements by two cameras with four photos each, K1 alone among the distortions."""
    scope = tuple(
        "camera" if n in ("c", "x0", "y0") else scope_of_k1 if n == "K1" else "off"
        for n in PARAMETERS
    )
    measured, _ = by_photographs(5, settings=QUIET)
    camera = replace(measured.cameras[0].camera, scope=scope)
    photos = tuple(replace(p, camera="AB"[i % 2]) for i, p in enumerate(measured.photos))
    both = with_cameras(measured, replace(camera, name="A"), replace(camera, name="B"))
    return replace(both, photos=photos)


@pytest.mark.slow
def test_each_camera_has_its_own_analysis(a_tank):
    measured = two_cameras("camera")
    one, two = analyse_job(job_of(a_tank, measured))
    assert (one.interior.camera, two.interior.camera) == ("A", "B")
    assert one.interior.photos is None
    trial = next(t for t in one.trials if t.names == ("K1",))
    assert trial.comparable
    survey = trial.outcome.adjustment.adjusted.survey
    assert [camera.scope[3] for camera in survey.cameras] == ["off", "camera"]
    _, _, covariance = trial.after
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), trial.predicted.sds, rtol=0.02)


@pytest.mark.slow
def test_a_value_of_the_block_goes_from_all_cameras(a_tank):
    job = job_of(a_tank, two_cameras("block"))
    base = adjust_survey(job.measurements)
    one, _ = analyse_job(job, adjustment=base, dropping=False)
    assert not any(trial.comparable for trial in one.trials)
    survey = Dropping(job, base).without("B", ("K1",)).adjustment.adjusted.survey
    assert [camera.scope[3] for camera in survey.cameras] == ["off", "off"]


@pytest.mark.slow
def test_a_value_of_each_photo_makes_a_set_of_each_photo(a_tank):
    job = job_of(a_tank, two_cameras("photo"))
    base = adjust_survey(job.measurements)
    found = analyse_job(job, adjustment=base, dropping=False)
    assert [len(one.interior.photos) for one in found] == [1] * 8
    assert not found[3].trials[-1].comparable
    outcome = Dropping(job, base).without(found[3].interior.camera, ("K1",))
    _, names, _ = read_interior_after(outcome, found[3].interior)
    assert names == ("c", "x0", "y0")


@pytest.mark.slow
def test_a_weighted_parameter_is_judged_and_dropped(a_tank):
    measured, _ = by_photographs(1, settings=QUIET)
    camera = measured.cameras[0].camera
    number = PARAMETERS.index("P1")
    sd = camera.sd.copy()
    sd[number] = 1e-7
    state = tuple("weighted" if k == number else s for k, s in enumerate(camera.state))
    measured = with_cameras(measured, replace(camera, sd=sd, state=state))
    base, job = adjust_survey(measured), job_of(a_tank, measured)
    (found,) = analyse_job(job, adjustment=base, dropping=False)
    told = {one.name: one for one in found.recommendation}["P1"]
    assert "known_beforehand" in [reason["code"] for reason in told.reasons]
    predicted = next(t.predicted for t in found.trials if t.names == ("P1",))
    outcome = Dropping(job, base).without("camera", ("P1",))
    assert outcome.adjustment.redundancy == base.redundancy  # an unknown and what it was
    sds = base.sigma0 * np.sqrt(np.diag(read_interior_after(outcome, found.interior)[2]))
    np.testing.assert_allclose(sds, predicted.sds, rtol=0.01)


@pytest.mark.slow
def test_c_cannot_be_dropped(silva_job, silva_result):
    again = Dropping(replace(silva_job, tank=None), silva_result.adjustment)
    with pytest.raises(ValueError, match="c cannot be dropped"):
        again.without("UMK", ("c",))


@pytest.mark.slow
def test_misfit_grows_as_the_f_test_predicts(silva_parameters, figure):
    """Second method: v'Pv without p parameters is v'Pv + p F sigma0^2, group by group."""
    base = silva_parameters
    chi2, worst = base.sigma0**2 * base.dof, 0.0
    for test in (*base.tests, *base.groups):
        trial = next((t for t in base.trials if t.names == test.names), None)
        if trial is not None:
            grown = trial.outcome.adjustment.adjusted.chi2 - chi2
            worst = max(worst, abs(grown / (len(test.names) * test.f * base.sigma0**2) - 1))
    figure("growth of v'Pv against p F sigma0^2, off by at most", f"{100 * worst:.1f} %")
    assert worst < 0.05


@pytest.mark.slow
def test_droppable_parameters_are_dropped_together(silva_parameters):
    goes = tuple(one.name for one in silva_parameters.recommendation if not one.keep)
    trial = next(t for t in silva_parameters.trials if "advised" in t.because)
    assert trial.names == goes
    assert trial.outcome.changes is not None
    for one in silva_parameters.recommendation:
        codes = [reason["code"] for reason in one.reasons]
        assert (codes[-1] in ("together_stay", "together_move")) == (not one.keep)


# --- from a record, and as plain data -----------------------------------------------------------


@pytest.mark.slow
def test_record_gives_the_same_without_trials(silva_result, silva_job):
    """Second method: the record as JSON against the job, nothing adjusted again."""
    record = json.loads(json.dumps(record_of(silva_result)))
    (one,) = analyse_record(record)
    (two,) = analyse_job(silva_job, adjustment=silva_result.adjustment, dropping=False)
    left, right = plain_parameters(one), plain_parameters(two)
    assert (left.pop("from"), right.pop("from")) == ("record", "job")
    assert left == right
    assert left["with_all"] is None
    assert left["without"][0]["points"] is None


@pytest.mark.slow
def test_all_of_it_is_plain_data(silva_parameters):
    found = plain_parameters(silva_parameters)
    assert list(found)[:3] == ["format", "kind", "camera"]
    assert (found["format"], found["kind"]) == (CAMERA.format, "parameters")
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert [one["name"] for one in found["parameters"]] == list(NAMES)
    assert found["parameters"][0]["edge_um"] is None
    assert found["names"] == list(NAMES)
    f = (found["parameters"][3]["value"] / found["parameters"][3]["sd"]) ** 2
    assert found["parameters"][3]["F"] == pytest.approx(f)
    assert found["with_all"]["volume_m3"] > 1200
    assert {why for one in found["without"] for why in one["because"]} == {
        "single", "group", "silva", "pessoa", "advised",
    }  # fmt: skip


@pytest.mark.slow
def test_record_without_photographs_or_sound_camera_is_refused(silva_result):
    record = json.loads(json.dumps(record_of(silva_result)))
    for spoilt in ({}, {"adjustment": None}, {"adjustment": {"cameras": []}}, []):
        with pytest.raises(InputError, match="record"):
            analyse_record(spoilt)
    camera = record["adjustment"]["cameras"][0]
    bad = [
        {**camera, "values": [None, *camera["values"][1:]]},
        {**camera, "covariance": camera["covariance"][:3]},
        {key: value for key, value in camera.items() if key != "free"},
        {**camera, "pixel_mm": [0.0, 0.01]},
        {**camera, "convention": "of somebody"},
        {**camera, "values": [-1.0, *camera["values"][1:]]},
        {**camera, "covariance": (-np.array(camera["covariance"])).tolist()},
        "camera",
    ]
    record["adjustment"]["cameras"] = bad
    with pytest.raises(InputError) as error:
        analyse_record(record)
    assert len(error.value.problems) == len(bad)
    record["adjustment"]["cameras"] = [camera]
    for key, value in (("sigma0", "one"), ("redundancy", None), ("cov_scale", 0.0), ("groups", 3)):
        with pytest.raises(InputError, match="adjustment"):
            analyse_record({**record, "adjustment": {**record["adjustment"], key: value}})


@pytest.mark.slow
def test_survey_without_free_camera_parameters_is_refused(a_tank):
    measured, _ = by_photographs(1, settings=QUIET)
    camera = measured.cameras[0].camera
    fixed = with_cameras(measured, replace(camera, values=camera.values, state=("fixed",) * 13))
    with pytest.raises(InputError, match="no parameter of any camera is adjusted"):
        analyse_job(job_of(a_tank, fixed))
    with pytest.raises(InputError, match="no adjusted parameter K4"):
        analyse_job(job_of(a_tank, measured), Choices(groups=(("K4",),)), dropping=False)


@pytest.mark.slow
def test_an_older_record_that_does_not_know_the_pixel_will_do(silva_result, silva_job):
    record = json.loads(json.dumps(record_of_adjustment(silva_job, silva_result.adjustment)))
    for key in ("format_mm", "pixel_mm", "reach_mm"):
        del record["adjustment"]["cameras"][0][key]
    (found,) = analyse_record(record, Choices(limit_um=3.0))
    assert found.interior.frame.reach_mm == np.inf
    assert plain_parameters(found)["image_accuracy"] == {"um": 3.0, "px": None, "from": "given"}


@pytest.mark.slow
def test_effects_in_pixels_follow_the_declared_pixel(a_tank):
    """Closed form: 10 um pixels, 100 px to the millimetre."""
    measured, _ = by_photographs(1, settings=QUIET)
    setup = replace(measured.cameras[0], pixel_mm=np.array([0.01, 0.01]))
    job = job_of(a_tank, replace(measured, cameras=(setup,)))
    base = adjust_survey(measured)
    (found,) = analyse_job(job, Choices(limit_px=0.5), adjustment=base, dropping=False)
    shift = found.own["K1"]
    assert shift.corner_px == pytest.approx(shift.corner_um / 10)
    assert (found.limit.um, found.limit.px) == (5.0, 0.5)
    interiors = collect_interiors(base, job.measurements)
    assert interiors[0].frame.pixel_mm.tolist() == [0.01, 0.01]


@pytest.mark.slow
def test_values_after_are_those_of_the_photos_of_the_set(silva_parameters):
    trial = next(t for t in silva_parameters.trials if t.names == ("K3",))
    values, names, _ = read_interior_after(trial.outcome, silva_parameters.interior)
    assert names == tuple(name for name in NAMES if name != "K3")
    assert values[0] == pytest.approx(100.0, abs=0.1)


@pytest.mark.parametrize("p", [1, 2, 3])
def test_groups_with_a_known_sigma0_are_chi_square(p):
    """Other program: quantile and tail of chi-square, from scipy.stats."""
    names, values = ("K1", "K2", "K3")[:p], np.array([1.0, -0.7, 2.0])[:p]
    covariance = np.diag([0.5, 0.2, 1.5])[:p, :p] + 0.1
    (found,) = group_tests(names, values, covariance, np.inf, groups=(names,))
    squares = values @ np.linalg.solve(covariance, values)
    assert found.critical == pytest.approx(stats.chi2.ppf(0.95, p) / p, rel=1e-9)
    assert found.p_value == pytest.approx(stats.chi2.sf(squares, p), rel=1e-9)
