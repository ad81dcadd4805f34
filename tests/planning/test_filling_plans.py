"""Plans of runs of liquid: what they add to a geometry, what each change is worth, what is refused.

Truth: a dense model of metered steps that knows nothing of tankcal (checked against a table that
was computed elsewhere); the empty job filled in and run, with simulated readings too; closed form;
monotony.
"""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import EXAMPLE
from draws import draws
from messages_told import lines
from paper_pages import pages_of, sparse_pages
from test_wall_plans import plan_of

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.planning import load_plan, predict, smallest, what_helps
from tankcal.planning.wall.changes import wall_changes_of
from tankcal.planning.wall.prediction import predict_wall_table
from tankcal.record.plan import WALL_PLAN
from tankcal.report.planning import empty_job
from tankcal.report.planning.rows import rows_of_runs
from tankcal.tank.liquid.adjustment import averaged
from tankcal.uncertainty import combine

FILLING = EXAMPLE.parent / "plan-liquid"
EXACT = (  # nothing but the meter, its batches and dips is unsure, and liquid weighs as the table's
    ("u_expansion_per_k = 1e-5", "u_expansion_per_k = 0"),
    ("u_temperature_c = 0.1", "u_temperature_c = 0"),
    ("u_density_kg_m3 = 0.05", "u_density_kg_m3 = 0"),
    ("u_dip_zero_mm = 0.3", "u_dip_zero_mm = 0"),
    ("bottom_flex_m3_per_m = 0.02", "bottom_flex_m3_per_m = 0"),
    ("liquid_density_kg_m3 = 850", "liquid_density_kg_m3 = 998.595"),
    ("density_temperature_c = 18", "density_temperature_c = 20"),
    ("temperature_c = 18\n", "temperature_c = 20\n"),
)
LYING = """
[tank]
id = "H"
kind = "horizontal"
nominal_volume_m3 = 40
[survey]
side = "inside"
date = 2026-06-09
[datum]
[table]
step_m = 0.05
reference_temperature_c = 15
[horizontal]
diameter_m = 2.4
length_m = 9.0
end_a = "flat"
end_b = "flat"
tilt_mm_per_m = 10
dip_from_a_m = 1.5
[liquid]
density_kg_m3 = 999
density_temperature_c = 15
expansion_per_k = 1.5e-4
u_density_kg_m3 = 0.1
s_dip_mm = 0.5
u_dip_zero_mm = 5
run_ppm = 100
[[runs]]
first_dip_m = 0.1
last_dip_m = 2.25
step_m = 0.2
"""


def dense_joint(areas, H, C, runs, *, meter, repeats, fixed, dip, run=0.0, bottom=0.0):
    """sds of volumes by geometry and liquid together: every error a column, one inverse.

    areas  (d,) at the dips of all runs      H  (d, c) columns of geometry there, C (rows, c) at the
    rows; the last row of each is that of `bottom`, its own sd, where it is not 0
    runs   [(places of its dips, volumes between them, whether it starts in the empty tank)]
    """
    steps = []
    for number, (places, volumes, empty) in enumerate(runs):
        ends = list(places) if empty else list(places[1:])
        starts = [None, *places[:-1]] if empty else list(places[:-1])
        for start, end, v in zip(starts, ends, volumes, strict=True):
            steps.append((start, end, v, number, empty and start is None))
    T = np.zeros((len(steps), len(areas)))
    for k, (start, end, *_) in enumerate(steps):
        T[k, end] = 1.0
        if start is not None:
            T[k, start] = -1.0
    v = np.array([one[2] for one in steps])
    of_run = np.array([one[3] for one in steps])[:, None] == np.arange(len(runs))
    first = np.array([one[4] for one in steps], dtype=float)
    geometry = np.hstack([T @ H, bottom * first[:, None]])
    own = [meter * v[:, None], T * areas * dip, run * v[:, None] * of_run]
    own.append(np.diag(np.hypot(repeats * v, fixed)))
    A = np.hstack([geometry, *own])
    C = np.hstack([C, np.full((len(C), 1), bottom)])
    across = C @ geometry.T
    covariance = C @ C.T - across @ np.linalg.solve(A @ A.T, across.T)
    return covariance, A, (geometry, own)


SECTION_3 = [  # scale ppm, dips mm, to; V(0.3), V(2), V(9.6), delivery, scale, meter after
    (108, 0.5, 2.0, (0.030, 0.048, 0.232, 0.195, 94, 221)),
    (400, 0.5, 2.0, (0.031, 0.074, 0.421, 0.354, 174, 282)),
    (400, 0.5, 9.6, (0.020, 0.070, 0.353, 0.285, 142, 281)),
    (108, 0.1, 2.0, (0.009, 0.045, 0.225, 0.184, 89, 187)),
]


@pytest.mark.parametrize(("scale", "dip_mm", "top", "known"), SECTION_3)
def test_the_dense_model_has_the_published_table(scale, dip_mm, top, known):
    """Six courses of 1.6 m, r 6.5 m; radii 0.3 mm each; what is below 0.3 m is known to 0.3 m3, by
    itself (computed elsewhere).
    """
    dips = np.arange(0.3, top + 0.01, 0.1)
    rows = np.array([0.3, 2.0, 9.6])

    def columns(levels):
        inside = np.clip(levels[:, None] - 1.6 * np.arange(6), 0.0, 1.6)
        inside[:, 0] -= 0.3
        radii = 2 * np.pi * 6.5 * 0.0003 * inside
        return np.hstack([2e-6 * scale * np.pi * 6.5**2 * (levels[:, None] - 0.3), radii])

    area = np.full(len(dips), np.pi * 6.5**2)
    volumes = [20.0, *area[1:] * np.diff(dips)]
    covariance, A, (_, own) = dense_joint(
        area, columns(dips), columns(rows), [(range(len(dips)), volumes, True)],
        meter=3e-4, repeats=1e-4, fixed=0.002, dip=dip_mm / 1000, bottom=0.3,
    )  # fmt: skip
    weight = np.linalg.inv(A @ A.T)
    left = [np.sqrt(1 - one @ weight @ one) for one in (A[:, 0], own[0][:, 0])]
    delivery = np.array([0, -1, 1]) @ covariance @ [0, -1, 1]
    found = (*np.sqrt(np.diag(covariance)), np.sqrt(delivery), scale * left[0], 300 * left[1])
    np.testing.assert_allclose(found[:4], known[:4], atol=1e-3)
    np.testing.assert_allclose(found[4:], known[4:], atol=1)


@pytest.mark.slow
def test_the_prediction_is_that_of_the_dense_model(tmp_path):
    """Second method: U at the dips of the plan, of deliveries, of scale and meter after."""
    found = predict(load_plan(plan_of(tmp_path / "plan", FILLING, *EXACT)))
    metering, made = found.plan.job.liquid, found.result.computed_table
    body = found.result.metering.joint.known.geometry.body()
    dips = metering.dip_m[np.isfinite(metering.dip_m)]
    rows = np.array([one.dip_m for one in found.filling.dips])

    def columns(levels):
        sources = body.sources(np.minimum(levels + made.zero_m, body.highest_m))
        return np.hstack([one.columns_m3 for one in sources]), sources

    area = body.area_m2(dips)
    volumes = metering.volume_m3
    runs = [(range(18), volumes[1:19], True), (range(18, 27), volumes[20:], False)]
    (H, sources), (C, _) = columns(dips), columns(rows)
    covariance, A, (_, own) = dense_joint(
        area, H, C, runs,
        meter=2e-4, repeats=1e-4, fixed=0.002, dip=0.0004, run=8e-5, bottom=300.0,
    )  # fmt: skip
    u = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose([one.U_m3 for one in found.filling.dips], 1.96 * u, rtol=2e-3)
    over = np.diff(np.eye(3), axis=0)
    u = np.sqrt(np.diag(over @ covariance @ over.T))
    told = [one.U_m3 for one in found.filling.differences]
    np.testing.assert_allclose(told, 1.96 * u, rtol=2e-3)
    weight = np.linalg.inv(A @ A.T)
    widths = np.cumsum([0] + [one.columns_m3.shape[1] for one in sources])
    place = widths[[one.kind for one in sources].index("instrument_scale")]
    left = [np.sqrt(1 - one @ weight @ one) for one in (own[0][:, 0], A[:, place])]
    causes = {one.kind: one.u_after / one.u_before for one in found.filling.causes}
    told = [causes["meter_factor"], causes["instrument_scale"]]
    np.testing.assert_allclose(told, left, rtol=1e-4)


def fill(folder, job):
    """Fill an empty job in with the straps and the runs of a Job, temperatures and all."""
    values = {"circumferences": [], "liquid": []}
    if job.strapping is not None:
        values["circumferences"] = [{"reading_m": one.reading_m} for one in job.strapping.straps]
    metering = job.liquid
    for k in range(len(metering)):
        row = {"volume_m3": metering.volume_m3[k], "dip_m": metering.dip_m[k]}
        row |= {
            "meter_temperature_c": metering.meter_c[k],
            "tank_temperature_c": metering.tank_c[k],
            "shell_temperature_c": metering.shell_c[k],
        }
        values["liquid"].append({key: one for key, one in row.items() if np.isfinite(one)})
    for name, read in values.items():
        path = folder / f"{name}.csv"
        if not read:
            continue
        text = path.read_text(encoding="utf-8").splitlines()
        headings, *rows = csv.reader([one for one in text if not one.startswith("#")])
        assert len(rows) == len(read)
        for row, one in zip(rows, read, strict=True):
            for key, value in one.items():
                row[headings.index(key)] = repr(float(value))
        with open(path, "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([headings, *rows])
    text = (folder / "job.toml").read_text(encoding="utf-8").splitlines()
    day = {"date": '"2026-05-05"'}
    if job.strapping is not None:
        day |= {"bottom_z_m": "0.0", "shell_temperature_c": "27"}
    text = [next((f"{k} = {v}" for k, v in day.items() if one.startswith(f"{k} =")), one)
            for one in text]  # fmt: skip
    (folder / "job.toml").write_text("\n".join(text), encoding="utf-8")


def read_with_errors(job, rng):
    """The job with errors of tape, meter, runs, batches and dips drawn from what it declares."""
    metering = job.liquid
    runs = dict(zip(dict.fromkeys(metering.run), rng.normal(size=9), strict=False))
    run = np.array([runs[name] for name in metering.run]) * (metering.run_sd or 0.0)
    meter = metering.meters[metering.meter[-1]]
    n = len(metering)
    sd = np.hypot(meter.repeatability * metering.volume_m3, meter.fixed_m3)
    shown = metering.volume_m3 * (1 - run - meter.u_factor * rng.normal()) + sd * rng.normal(size=n)
    shown = np.where(metering.volume_m3 == 0, 0.0, shown)
    dips = metering.dip_m + metering.s_dip_m * rng.normal(size=n)
    dips = dips + metering.u_dip_zero_m * rng.normal()
    strapping = job.strapping and replace(
        job.strapping,
        straps=tuple(
            replace(one, reading_m=one.reading_m + one.sd_m * rng.normal())
            for one in job.strapping.straps
        ),
    )
    return replace(job, strapping=strapping, liquid=replace(metering, volume_m3=shown, dip_m=dips))


@pytest.mark.slow
def test_the_empty_job_filled_in_is_the_plan(tmp_path):
    """With the readings foreseen U is the prediction's in every row; with readings that have errors
    it is so, too, but for what depends on them; the straps tell their wall in a job.
    """
    prediction = predict(load_plan(FILLING))
    plan, rng = prediction.plan, np.random.default_rng(4)
    empty_job.write_wall(prediction, tmp_path / "job")
    with pytest.raises(InputError):  # nothing is read yet
        tankcal.load(tmp_path / "job")
    fill(tmp_path / "job", plan.job)
    found = predict_wall_table(tankcal.load(tmp_path / "job"), plan.amplitudes).computed_table.table
    np.testing.assert_allclose(found.U_m3, prediction.table.U_m3, rtol=1e-8)
    np.testing.assert_allclose(found.volume_m3, prediction.table.volume_m3, rtol=1e-9)
    empty_job.write_wall(prediction, tmp_path / "other")
    fill(tmp_path / "other", read_with_errors(plan.job, rng))
    job = tankcal.load(tmp_path / "other")
    found = predict_wall_table(job, plan.amplitudes).computed_table.table
    rows = slice(30, None)
    np.testing.assert_allclose(found.U_m3[rows], prediction.table.U_m3[rows], rtol=5e-3)
    learned = tankcal.run(job, simulated=False).table
    assert 0.7 < learned.U_m3[-1] / prediction.table.U_m3[-1] < 1.1


@pytest.mark.slow
def test_liquid_alone_is_the_job_that_is_run(tmp_path):
    """A lying tank of which there is a drawing: `tankcal.run` of simulated readings has the U of
    the plan, but for the sizes that they tell, and volumes scatter by as much.
    """
    folder = tmp_path / "plan"
    folder.mkdir()
    (folder / "plan.toml").write_text(LYING, encoding="utf-8")
    (folder / "meters.toml").write_text((FILLING / "meters.toml").read_text(), encoding="utf-8")
    plan = load_plan(folder)
    prediction, rng = predict(plan), np.random.default_rng(1)
    empty_job.write_wall(prediction, tmp_path / "job")
    fill(tmp_path / "job", plan.job)
    job = tankcal.load(tmp_path / "job")
    table = tankcal.run(job, simulated=False).table
    np.testing.assert_allclose(table.U_m3[1:], prediction.table.U_m3[1:], rtol=1e-7)
    off, dips = [], np.arange(0.15, 2.2, 0.05)
    U, volume = (np.interp(dips, prediction.table.height_m, one)
                 for one in (prediction.table.U_m3, prediction.table.volume_m3))  # fmt: skip
    for _ in range(8):
        found = tankcal.run(read_with_errors(job, rng), simulated=False).table
        ours = np.interp(dips, found.height_m, found.U_m3) / U
        assert 0.9 < np.mean(ours) < 1.12
        off.append((np.interp(dips, found.height_m, found.volume_m3) - volume) / U)
    assert 0.25 < np.sqrt(np.mean(np.square(off))) < 0.9  # of U, which is two of them


@pytest.mark.slow
def test_an_expected_run_effect_is_shown_by_the_runs(tmp_path):
    """What a job would find of runs that differ as expected, with its few degrees of freedom."""
    more = "[filling]\nexpected_run_ppm = 300"
    pairs = (("run_ppm = 80 ", "# run_ppm "), ("[filling]", more))
    plan = load_plan(plan_of(tmp_path / "plan", FILLING, *pairs))
    found = predict(plan)
    declared = predict(
        load_plan(plan_of(tmp_path / "b", FILLING, ("run_ppm = 80", "run_ppm = 300")))
    )
    assert plan.job.liquid.run_sd is None
    assert 2e-4 < found.filling.run_sd < 6e-4
    assert 0.2 < found.filling.run_dof < 2
    assert found.relative_u > declared.relative_u
    drawn, rng = [], np.random.default_rng(2)
    for _ in range(400):  # of two runs of noise 50 ppm, one difference tells
        noise = np.array([5e-5**2])
        drawn.append(averaged(rng.normal(size=1) * np.sqrt(3e-4**2 + noise), noise).sd)
    assert np.quantile(drawn, 0.2) < found.filling.run_sd < np.quantile(drawn, 0.95)


@pytest.mark.slow
def test_what_helps_is_ranked_and_says_what_it_costs(tmp_path):
    plan = load_plan(plan_of(tmp_path / "plan", FILLING, ("step_m = 0.01", "step_m = 0.2")))
    before = predict(plan)
    runs = [one for one in changes_of_everything(plan) if one.change.item in OF_RUNS]
    effects = {(one.change.action, one.change.item, one.change.name): one for one in runs}
    assert len(effects) == len(runs) == 18
    adds = [one for one in runs if one.change.action in ("add", "repeat")]
    assert all(one.difference < 0 and not one.why for one in adds)
    assert all(one.difference > 0 for one in runs if one.change.action == "drop")
    assert effects["add", "step", "1"].change.cost == 12
    assert effects["add", "top_of_run", "1"].change.cost == 12 * 76
    assert effects["add", "run", "2"].change.cost == 200 + 8 * 12
    finer, halved = effects["repeat", "accuracy", "dips"], effects["add", "half_steps", "1"]
    assert finer.relative_u < halved.relative_u < before.relative_u
    full = effects["add", "top_of_run", "1"].change.plan
    assert full.design.runs[0].dips_m[-1] == 9.6


OF_RUNS = {"step", "top_of_run", "half_steps", "empty_start", "run", "accuracy", "meter", "batches"}


def changes_of_everything(plan):
    from tankcal.planning.improvements import changes_of

    return what_helps(plan, tuple(
        one for one in changes_of(plan) if one.item in OF_RUNS and one.name != "straps"
    ))  # fmt: skip


@pytest.mark.slow
def test_the_smallest_design_meets_its_limit(tmp_path):
    pairs = (("relative_u = 0.0004", "relative_u = 0.00036"), ("step_m = 0.01", "step_m = 0.4"))
    path = smallest(load_plan(plan_of(tmp_path / "plan", FILLING, *pairs)), items=("step", "run"))
    assert path.prediction.meets
    assert path.steps


def test_dips_of_runs_are_those_that_are_asked(tmp_path):
    """Closed form: steps by size, the last one shorter; by number; down; from the empty tank."""
    pairs = (
        ("last_dip_m = 2.00\nstep_m = 0.10", "last_dip_m = 0.75\nstep_m = 0.2"),
        ("first_dip_m = 0.32\nlast_dip_m = 1.92", "first_dip_m = 1.2\nlast_dip_m = 0.3"),
        ("step_m = 0.20", "steps = 3"),
    )
    plan = load_plan(plan_of(tmp_path / "plan", FILLING, *pairs))
    up, down = plan.design.runs
    assert up.dips_m == (0.3, 0.5, 0.7, 0.75)
    assert up.batches == 4
    assert down.dips_m == (1.2, 0.9, 0.6, 0.3)
    assert down.batches == 3
    volume = plan.job.liquid.volume_m3
    assert (volume[1:5] > 0).all()
    assert (volume[6:] < 0).all()
    steps = [one for one in wall_changes_of(plan)
             if one[1] in ("step", "top_of_run") and one[2] == "2"]  # fmt: skip
    assert [one[0] for one in steps] == ["drop"]  # nobody goes on below the bottom


BAD = {
    "none": ("first_dip_m = 0.30\n", "", "runs[1].first_dip_m"),
    "both": ("step_m = 0.10", "step_m = 0.10\nsteps = 3", "runs[1].step_m"),
    "neither": ("step_m = 0.10\n", "", "runs[1].step_m"),
    "stands": ("last_dip_m = 1.92", "last_dip_m = 0.32", "runs[2].last_dip_m"),
    "small": ("step_m = 0.10", "step_m = 0.0001", "runs[1].step_m"),
    "many": ("last_dip_m = 2.00\nstep_m = 0.10", "last_dip_m = 9.0\nstep_m = 0.002", "runs"),
    "above": ("last_dip_m = 2.00", "last_dip_m = 12.00", "runs"),
    "meter": ("from_empty = true", 'from_empty = true\nmeter = "M-9"', "runs"),
    "effect": ("run_ppm = 80", "# ", "filling.expected_run_ppm"),
    "twice": ("[filling]", "[filling]\nexpected_run_ppm = 90", "filling.expected_run_ppm"),
    "density": ("density_kg_m3 = 998.595 ", "# ", "liquid.density_kg_m3"),
    "targets": ("[limits]", "[pattern]\ngeneratrices = 8\n[limits]", "pattern"),
    "key": ("from_empty", "empty", "runs[1].empty"),
    "flag": ("from_empty = true", "from_empty = 3", "runs[1].from_empty"),
    "list": ("[0.3, 2.0, 9.6]", '"all"', "filling.dips_m"),
    "sphere": ('kind = "vertical"', 'kind = "sphere"', "straps"),
    "mesh": ('kind = "vertical"', 'kind = "mesh"', "tank.kind"),
}


@pytest.mark.slow(after=5)
@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line_each(tmp_path, name, capsys):
    old, new, place = BAD[name]
    folder = plan_of(tmp_path / "plan", FILLING, (old, new))
    with pytest.raises(InputError) as error:
        load_plan(folder)
    assert place in {one.column for one in error.value.problems}
    assert len(lines(error.value.problems)) == len(set(lines(error.value.problems)))
    assert main(["plan", str(folder), "--quiet", "--language", "pt-BR"]) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.slow
def test_dips_that_the_table_does_not_have_are_refused(tmp_path):
    plan = load_plan(plan_of(tmp_path / "plan", FILLING, ("2.0, 9.6]", "2.0, 9.7]")))
    with pytest.raises(InputError, match=r"filling\.dips_m: found 9\.7; expected 0 to 9\.6 m"):
        predict(plan)


def test_runs_without_meters_and_a_filling_without_runs_are_told(tmp_path):
    folder = plan_of(tmp_path / "plan", FILLING)
    (folder / "meters.toml").unlink()
    with pytest.raises(InputError, match=r"meters\.toml"):
        load_plan(folder)
    text = (folder / "plan.toml").read_text(encoding="utf-8")
    start, end = text.index("[[runs]]"), text.index("[filling]")
    (folder / "plan.toml").write_text(text[:start] + text[end:], encoding="utf-8")
    with pytest.raises(InputError, match="filling: given without"):
        load_plan(folder)


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "es", "pt-BR"])
def test_files_of_a_plan(tmp_path, language, capsys):
    """Papers without a page that is nearly empty; plan.json by its schema; rows for the crew."""
    out = tmp_path / "out"
    assert main(["plan", str(FILLING), "--out", str(out), "--language", language, "--quiet"]) == 0
    assert "M-3: u 200 ppm" in capsys.readouterr().out
    saved = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    found = WALL_PLAN.migrated(saved, "plan.json")
    assert (found["survey"]["runs"], found["survey"]["batches"]) == (2, 26)
    (full,) = (one for one in found["filling"]["dips"] if one["dip_m"] == 9.6)
    assert full["U_m3"] < full["U_geometry_m3"]
    assert full["U_m3"] == pytest.approx(found["table"]["U_m3"][-1], rel=1e-6)
    for name in ("prediction.pdf", "field-sheets.pdf"):
        assert sparse_pages(pages_of(out / name)) == []
    rows = rows_of_runs(load_plan(FILLING))
    assert [one["dip_m"] for one in rows[:3]] == [None, 0.3, 0.4]
    assert [one["batch_m3"] for one in rows].count(None) == 2
    text = (out / "job" / "liquid.csv").read_text(encoding="utf-8").splitlines()
    assert text[-9].startswith("2,")
    assert text[-9].endswith("0.32 m")
    assert ",,," in text[-9]  # neither its dip nor its volume: without them it is no dry tank


@pytest.mark.study
def test_u_of_jobs_by_liquid_over_that_of_their_plan_study(figure):
    """How far U of the full tank of a strapped and filled job is from its plan's, by what it learns
    of a wall that is round: the wall of the plan's own readings.
    """
    plan = load_plan(FILLING)
    foreseen, rng, ratios = predict(plan).table.U_m3[-1], np.random.default_rng(5), []
    for _ in range(draws(10, 40)):
        found = tankcal.run(read_with_errors(plan.job, rng), simulated=False).table
        ratios.append(found.U_m3[-1] / foreseen)
    figure(
        "U of strapped and filled jobs over that of their plan",
        np.quantile(ratios, [0.05, 0.5, 0.95]).round(3),
    )
    assert 0.75 < np.median(ratios) < 1.1


@pytest.mark.slow
def test_geometry_alone_is_the_plan_without_runs(tmp_path):
    """Invariance: what stands as geometry alone is the prediction of the same straps alone."""
    found = predict(load_plan(FILLING)).filling
    folder = plan_of(tmp_path / "plan", FILLING)
    text = (folder / "plan.toml").read_text(encoding="utf-8")
    liquid = text.index("[liquid]"), text.index("[[straps]]")
    runs = text.index("[[runs]]"), text.index("[limits]")
    text = text[: liquid[0]] + text[liquid[1] : runs[0]] + text[runs[1] :]
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    (folder / "meters.toml").unlink()
    table = predict(load_plan(folder)).table
    last = combine([one.mapped(lambda c: c[-1:]) for one in table.sources], 1)
    assert found.dips[-1].U_geometry_m3 == pytest.approx(last.expanded(0.95)[0], rel=1e-6)
