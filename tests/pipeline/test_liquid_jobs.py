"""Liquid in a job of any kind: bodies, tables, sizes that liquid tells, warnings, causes.

Kinds of truth: jobs simulated without the package (examples), a published pose (liquid.md 3),
invariance, and the body's own differences.
"""

import datetime
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from job_builder import write_folder
from metered_runs import NOMINAL, Fault, fill, metered_job
from metered_tanks import HEADINGS, metered_parts, metered_rows
from numpy.testing import assert_allclose
from page_figures import figures_of

import tankcal
from tankcal.job.model import DeclaredInput
from tankcal.methods.liquid.warnings import check_liquid
from tankcal.pipeline.liquid import geometry_alone, geometry_beside, join_body
from tankcal.pipeline.liquid.adjustment import adjust_liquid
from tankcal.pipeline.liquid.measuring import is_steady_leak, measure_by_liquid
from tankcal.pipeline.surveying import find_survey
from tankcal.record import record_of
from tankcal.report import certificate
from tankcal.report.paper import Paper
from tankcal.uncertainty import combine

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(job):
    return tankcal.run(job, simulated=False)


@pytest.fixture(scope="module")
def upright(tmp_path_factory):
    """Two runs from empty to 3 m of an upright tank that only liquid tells."""
    dips = [None, *np.round(np.arange(0.3, 3.1, 0.3), 2).tolist()]
    job = metered_job("vertical", tmp_path_factory.mktemp("u") / "job", dips=dips)
    return fill(np.random.default_rng(8), job, NOMINAL["vertical"], 9.5)


@pytest.mark.slow
@pytest.mark.parametrize("example", ["liquid", "liquid-lying"])
def test_examples_hold_what_is_true(example):
    job = tankcal.load(EXAMPLES / example)
    truth = json.loads((EXAMPLES / example / "truth.json").read_text("utf-8"))["table"]
    result = run(job)
    for dip, volume in zip(truth["dip_m"], truth["volume_m3"], strict=True):
        found = result.at(dip)
        assert abs(found.value_m3 - volume) < found.U_m3


@pytest.mark.slow
def test_what_hides_is_what_an_error_of_that_size_does_to_the_table(upright):
    """Second way: the job again with a hundredth of the error, of the meter and by a leak."""

    def tables(job):
        result = run(job)
        table = result.liquid.tables["joint"]
        return result, table.volume_m3, table.U_m3

    result, volume, U = tables(upright)
    told = [one for one in result.liquid.causes if one.undetected_U is not None]
    of = {one.cause.kind: one for one in told if one.cause.of in ("M", None)}
    metering, share = upright.liquid, 0.01
    less = metering.volume_m3 / (1 + share * of["meter"].detectable)
    seconds = [moment(one).timestamp() for one in metering.time]
    hours = np.diff(seconds, prepend=seconds[0]) / 3600
    hours[[rows[0] for rows in metering.runs.values()]] = 0.0
    more = metering.volume_m3 + share * of["leak"].detectable * hours
    for kind, shown in (("meter", less), ("leak", more)):
        _, moved, _ = tables(replace(upright, liquid=replace(metering, volume_m3=shown)))
        change = np.max(np.abs(moved - volume)[1:] / U[1:]) / share
        assert of[kind].undetected_U == pytest.approx(change, rel=0.02)


def moment(text):
    return datetime.datetime.fromisoformat(str(text))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("w", "named", "told"),
    [(3.5, False, True), (-3.5, False, True), (3.2, False, False), (4.5, True, False)],
)
def test_a_drift_with_time_has_a_test_of_its_own(upright, w, named, told):
    """The limit is 3.29, of one test in a thousand; a named cause is told in another warning."""
    found = run(upright).liquid
    leak = replace(next(filter(is_steady_leak, found.causes)), w=w, size=0.05, is_named=named)
    problems = check_liquid(upright, replace(found, causes=(leak,)))
    assert ("liquid_drifts" in [one.expected.code for one in problems]) is told


@pytest.mark.slow
@pytest.mark.parametrize("proved", [False, True])
def test_a_meter_that_nothing_checks_is_told(tmp_path, proved):
    """One meter, by liquid alone: told in the run and on page 1, unless it was proved again."""
    after = {"factor_after": 1.0006} if proved else {}
    dips = [None, *np.round(np.arange(0.3, 3.1, 0.3), 2).tolist()]
    job = metered_job("vertical", tmp_path / "job", dips=dips, registers=after)
    result = run(fill(np.random.default_rng(8), job, NOMINAL["vertical"], 9.5))
    told = [one for one in result.warnings if one.expected.code == "meter_unchecked"]
    assert [(one.file, one.column) for one in told] == (
        [] if proved else [("meters.toml", "M.factor_after")]
    )
    record = record_of(result)
    controls = {one["kind"]: one for one in record["liquid"]["controls"]}
    assert controls["meter"]["of"] == "M"
    assert controls["meter"]["undetected_U"] > 2
    page_1 = [block.data for block in certificate.doubtful_input(Paper(record))]
    assert page_1[0] == {"kind": "notice", "text": "LIMITS OF THE CHECKS"}
    lines = page_1[1]["items"]
    assert any("factor of meter M" in one for one in lines) is not proved
    assert any("leak below" in one for one in lines)  # no dip was read at rest


@pytest.mark.slow
def test_pose_of_a_lying_tank_from_dips_and_litres(tmp_path):
    """Published: liquid.md 3, from sizes that are 5 cm and 20 cm wrong, without tilt or zero."""
    dips = [0.1, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.5, 1.7, 1.9, 2.1, 2.3, 2.35]
    litres = [2193.1, 3117.9, 3676.1, 4031.5, 4236.6, 4313.2, 4268.3, 4097.9, 3784.8, 3287.5]
    litres += [2491.2, 428.0]
    parts = metered_parts("horizontal", horizontal__dip_from_a_m=1.5, liquid__s_dip_mm=0.001)
    parts.tables["liquid"] = [list(HEADINGS), *metered_rows(dips, np.array(litres) / 1000)]
    parts.settings |= {"horizontal.diameter_m": 2.45, "horizontal.length_m": 8.8}
    parts.settings |= {"liquid.u_dip_zero_mm": 0.0, "liquid.run_ppm": 0.0}
    exact = {"factor": 1.0, "u_factor_ppm": 0.01, "repeatability_ppm": 0.0, "fixed_l": 0.03}
    parts.registers["meters"]["M"] |= exact
    write_folder(tmp_path / "job", parts)
    job = tankcal.load(tmp_path / "job")
    cold = dict.fromkeys(("meter_c", "tank_c", "shell_c"), np.full(len(dips), np.nan))
    job = replace(job, liquid=replace(job.liquid, **cold))
    result = measure_by_liquid(job, None).result(np.array([1.0]))
    sizes = {one.name: one for one in result.sizes}
    for name, expected in (("diameter", -0.05), ("length", 0.2), ("tilt", 0.01), ("datum", 0.004)):
        assert abs(sizes[name].after - expected) < 3 * sizes[name].u_after
    assert_allclose(sizes["datum"].after, 0.00389, atol=2e-5)  # as published, of rounded litres
    assert_allclose(sizes["diameter"].after, -0.05002, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["horizontal", "sphere"])
def test_a_body_is_of_one_piece(tmp_path, kind):
    """The free surface is the derivative of the volume; sources give the table's u."""
    dips = {"horizontal": [0.2, 0.6, 1.0, 1.4, 1.8], "sphere": [1.0, 3.0, 5.0, 7.0]}[kind]
    place = {"horizontal__dip_from_a_m": 1.5} if kind == "horizontal" else {}
    job = metered_job(kind, tmp_path / "job", dips=dips, **place)
    job = fill(np.random.default_rng(1), job, NOMINAL[kind], 2.4 if kind == "horizontal" else 10.0)
    measured = measure_by_liquid(job, None)
    levels = np.linspace(0.2, 2.0, 7)
    up, down = (measured.body.volume_m3(levels + step) for step in (1e-5, -1e-5))
    assert_allclose(measured.body.area_m2(levels), (up - down) / 2e-5, rtol=1e-5)
    volumes, _, sources = measured.body.rows(levels)
    assert np.all(np.abs(volumes - NOMINAL[kind](levels)) < 4 * combine(sources, 7).u)


@pytest.mark.slow
def test_correlated_sizes(tmp_path):
    """Closed form: the columns of inputs that are correlated make the variance of their parts."""
    job = metered_job("horizontal", tmp_path / "job", dips=[0.2, 0.6, 1.0, 1.4, 1.8],
                      horizontal__dip_from_a_m=1.5)  # fmt: skip
    job = fill(np.random.default_rng(1), job, NOMINAL["horizontal"], 2.4)
    sizes = (("diameter", 0.01), ("length", 0.03), ("datum", 0.003))
    inputs = tuple(DeclaredInput(name, u, "mm", 1000 * u) for name, u in sizes)
    job = replace(job, inputs=inputs, correlations=(("diameter", "length", 0.7),))
    measured, levels = measure_by_liquid(job, None), np.array([0.5, 1.2, 2.0])
    both = next(one for one in measured.body.sources(levels) if one.parts)
    parts = np.stack([one.columns_m3[:, 0] for one in both.parts], axis=1)
    variance = np.einsum("ri,ij,rj->r", parts, both.correlation, parts)
    assert_allclose(np.sum(both.columns_m3**2, axis=1), variance, rtol=1e-9)
    volumes = measured.body.volume_m3(levels)
    assert np.all(np.abs(volumes - NOMINAL["horizontal"](levels)) < 0.05)


@pytest.mark.slow
def test_joint_body_of_a_shell(upright):
    survey = find_survey(upright, lambda text: None).survey
    measured = measure_by_liquid(upright, survey)
    levels = np.array([0.1, 0.7, 1.0, 2.5, 4.0, 8.0])
    up, down = (measured.body.volume_m3(levels + step) for step in (1e-5, -1e-5))
    assert_allclose(measured.body.area_m2(levels), (up - down) / 2e-5, rtol=1e-6)
    known = measured.joint.known
    slow = known.geometry.body().volume_m3(levels)
    columns = [one.columns_m3 for one in known.geometry.body().sources_by(levels, ())]
    slow = slow + np.hstack(columns) @ known.z + known.bottom_m3 * known.share(levels)
    assert_allclose(measured.body.volume_m3(levels), slow, rtol=1e-12)


@pytest.mark.slow
def test_tables_for_two_densities_differ_by_the_head_of_the_shell(upright):
    """Nothing but the head depends on the liquid of the table: to a millilitre."""
    dense, light = replace(upright.table, liquid_density_kg_m3=850.0), upright.table
    levels = np.array([1.0, 3.0, 6.0, 9.0])
    survey = find_survey(upright, lambda text: None).survey
    measured = measure_by_liquid(upright, survey)
    by_liquid = measured.body_for(850.0).volume_m3(levels) - measured.body.volume_m3(levels)
    shell = measured.joint.known.geometry
    heads = [replace(shell, job=replace(upright, table=one)).body() for one in (dense, light)]
    expected = heads[0].volume_m3(levels) - heads[1].volume_m3(levels)
    assert_allclose(by_liquid, expected, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_liquid_makes_a_shell_certain_where_it_was_filled(upright):
    result = run(upright)
    tables, heights, (low, high) = (
        result.liquid.tables,
        result.table.height_m,
        result.liquid.filled_m,
    )
    filled = (heights >= low) & (heights <= high)
    assert np.all(tables["joint"].u_m3[filled] < 0.2 * tables["geometry"].u_m3[filled])
    assert np.all(np.isfinite(tables["liquid"].u_m3) == filled)
    assert_allclose(
        tables["liquid"].volume_m3[filled], tables["joint"].volume_m3[filled], rtol=1e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("certified", ["joint", "liquid", "geometry"])
def test_the_table_that_is_printed(certified):
    job = tankcal.load(EXAMPLES / "liquid")
    result = run(replace(job, liquid=replace(job.liquid, certified=certified)))
    printed, beside = result.table, result.liquid.tables[certified]
    known = np.isfinite(beside.volume_m3)
    assert_allclose(printed.volume_m3[known], beside.volume_m3[known], atol=1e-9)
    assert_allclose(printed.u_m3[known], beside.u_m3[known], rtol=1e-9)


@pytest.mark.slow
def test_corrections_add_up_to_the_table():
    result = run(tankcal.load(EXAMPLES / "liquid"))
    made = sum(one.size_m3 for one in result.corrections if one.code != "tilt")
    gross = result.gross.volume_m3(np.array([result.gross.height_m]))[0]
    assert_allclose(gross + made, result.table.volume_m3[-1], atol=1e-6)
    assert result.corrections[-1].code == "liquid"


@pytest.mark.slow
def test_a_geometry_of_one_adjustment_is_linear():
    """Invariance: the joint table does not change when geometry starts elsewhere."""
    job = tankcal.load(EXAMPLES / "liquid-lying")
    other = replace(job.horizontal, width_m=job.horizontal.width_m + 0.001)
    other = replace(other, height_m=other.width_m)
    first, second = (adjust_liquid(geometry_alone(one, None)) for one in
                     (job, replace(job, horizontal=other)))  # fmt: skip
    levels = np.linspace(0.3, 2.2, 9)
    volumes = [join_body(one.known).volume_m3(levels) for one in (first, second)]
    assert_allclose(volumes[0], volumes[1], atol=2e-3)


@pytest.mark.slow
def test_a_dip_that_is_only_compared(upright):
    """A dip 20 mm off changes nothing, and its difference is told."""
    metering, survey = upright.liquid, find_survey(upright, lambda text: None).survey
    used = np.arange(len(metering)) != 5
    results = []
    for off in (0.0, 0.020):
        dips = metering.dip_m + off * ~used
        job = replace(upright, liquid=replace(metering, used=used, dip_m=dips))
        results.append(measure_by_liquid(job, survey).result(np.array([2.0])))
    first, second = results
    assert_allclose(first.tables["joint"].volume_m3, second.tables["joint"].volume_m3, rtol=1e-12)
    assert first.checks.row.tolist() == [metering.row[5]]
    assert abs(first.checks.difference_m[0]) < 4 * first.checks.sd_m[0]
    assert_allclose(second.checks.difference_m - first.checks.difference_m, 0.020, atol=1e-4)


FAULTS = {
    "meter": Fault("meter", 0.002),
    "dip": Fault("dip", 0.010, 5),
    "batch": Fault("batch", 0.0, 6),
    "swapped": Fault("swapped"),
}


def named_causes(job):
    survey = find_survey(job, lambda text: None).survey
    result = measure_by_liquid(job, survey).result(np.array([1.0]))
    return [one for one in result.causes if one.is_named]


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["dip", "batch"])
def test_a_planted_fault_is_named(tmp_path, fault):
    dips = [None, *np.round(np.arange(0.3, 2.2, 0.3), 2).tolist()]
    job = metered_job("vertical", tmp_path / "job", dips=dips, liquid__u_radius_mm=0.5)
    filled = fill(np.random.default_rng(2), job, NOMINAL["vertical"], 9.5, FAULTS[fault])
    (first, *others), place = named_causes(filled), FAULTS[fault].place
    assert not others
    assert (first.cause.kind, first.cause.of) == (fault, int(filled.liquid.row[place]))
    lacking = {"dip": -0.010, "batch": filled.liquid.volume_m3[place]}[fault]  # true less read
    assert abs(first.size - lacking) < 4 * first.sd


@pytest.mark.slow
def test_no_run_from_empty_is_told(tmp_path):
    job = metered_job("vertical", tmp_path / "job", dips=[0.3, 0.6, 0.9, 1.2])
    job = fill(np.random.default_rng(2), job, NOMINAL["vertical"], 9.5)
    assert "bottom_not_filled" in [one.expected.code for one in run(job).warnings]


def test_sizes_that_nobody_declares_are_told_by_liquid(tmp_path):
    job = metered_job("sphere", tmp_path / "job", dips=[1.0, 3.0, 5.0, 7.0])
    job = fill(np.random.default_rng(2), job, NOMINAL["sphere"], 10.0)
    assert {one.name for one in geometry_beside(job, None).job.inputs} >= {"diameter", "datum"}


@pytest.mark.slow
def test_three_hundred_increments_take_less_than_two_seconds(tmp_path):
    import time

    dips = [None, *np.round(np.arange(0.3, 9.25, 0.09), 2).tolist()]
    job = metered_job("vertical", tmp_path / "job", dips=dips, runs=3)
    job = fill(np.random.default_rng(1), job, NOMINAL["vertical"], 9.5)
    assert len(job.liquid) > 300
    run(job)  # what loads once
    start = time.process_time()
    run(job)
    (most_s,) = figures_of("docs/studies/liquid.md", "| processor time | less than () s |")
    assert time.process_time() - start < float(most_s)
