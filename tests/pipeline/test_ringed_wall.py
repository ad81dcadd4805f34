"""From strapped rings of a lying tank to its table: worked numbers, second methods, warnings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT
from job_builder import job_parts, write_folder
from ringed_jobs import reading_of, ringed_parts

import tankcal
from tankcal.geometry.field.components import COMPONENTS
from tankcal.methods.rings.wall import exchanged_rings, find_ringed_wall
from tankcal.pipeline.tanks import body_of
from tankcal.record import record_of

DIPS = (0.0, 0.3, 1.2, 2.2)


def result_of(parts, folder):
    return tankcal.run(tankcal.load(write_folder(folder, parts)), simulated=False)


def codes(result):
    return {one.expected.code for one in result.warnings if one.file == "circumferences.csv"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("radii", "litres", "capacity"),
    [
        ((1.200, 1.192, 1.200), [2.274, 2486.907, 19622.296, 38572.999], 40534.688),
        ((1.192, 1.200, 1.192), [2.266, 2556.518, 19705.508, 38527.731], 40354.336),
        ((1.200, 1.200, 1.200), [2.274, 2525.939, 19711.035, 38717.495], 40715.041),
    ],
)
def test_table_of_three_rings(tmp_path, radii, litres, capacity):
    """Truth: the table of the specification, to 0.01 L; the readings are those of its radii."""
    result = result_of(ringed_parts(radii), tmp_path)
    found = 1000 * result.body.volume_m3(np.array(DIPS))
    assert found == pytest.approx(litres, abs=0.01)
    assert 1000 * result.body.parts[0].capacity_m3 == pytest.approx(capacity, abs=0.01)
    assert codes(result) == set()


@pytest.mark.slow
def test_equal_rings_are_the_cylinder_of_one_diameter(tmp_path):
    """Truth: a job of one diameter, to 1e-9 m3."""
    ends = {
        "horizontal.end_a": "ellipsoidal",
        "horizontal.end_a_depth_m": 0.6,
        "horizontal.end_b": "torispherical",
        "horizontal.end_b_dish_radius_m": 2.4,
        "horizontal.end_b_knuckle_radius_m": 0.25,
        "horizontal.thickness_mm": 8.0,
        "survey.shell_temperature_c": 31.0,
    }
    rings = ringed_parts((1.2,) * 3)
    rings.settings |= ends
    del rings.registers["instruments"]["T-5"]["expansion_per_k"]
    one = job_parts(kind="horizontal", settings=dict(rings.settings))
    one.settings = {k: v for k, v in rings.settings.items() if not k.startswith("shell")}
    one.settings |= {"horizontal.diameter_m": 2.416}
    found, known = result_of(rings, tmp_path / "a"), result_of(one, tmp_path / "b")
    assert np.array_equal(found.table.height_m, known.table.height_m)
    assert np.abs(found.table.volume_m3 - known.table.volume_m3).max() < 1e-9
    assert [one.size_m3 for one in found.corrections] == pytest.approx(
        [one.size_m3 for one in known.corrections], abs=1e-9
    )


@pytest.mark.slow
def test_straps_in_the_budget_are_derivatives_by_readings(tmp_path):
    """Truth: volumes with each reading 0.1 mm longer; the zero goes with the ring of the dip."""
    job = tankcal.load(write_folder(tmp_path, ringed_parts()))
    levels = np.array([0.3, 1.2, 2.2])

    def volumes(straps):
        moved = replace(job, strapping=replace(job.strapping, straps=straps))
        return body_of(moved, find_ringed_wall(moved, str)).volume_m3(levels)

    straps = job.strapping.straps
    body = body_of(job, find_ringed_wall(job, str))
    source = next(one for one in body.sources(levels) if one.kind == "straps")
    sd = find_ringed_wall(job, str).reduced[0].sd_m
    for i, one in enumerate(straps):
        longer = (*straps[:i], replace(one, reading_m=one.reading_m + 1e-4), *straps[i + 1 :])
        by_difference = (volumes(longer) - volumes(straps)) / 1e-4
        assert source.columns_m3[:, i] / sd == pytest.approx(by_difference, rel=2e-3)


@pytest.mark.slow
def test_every_cause_stands_in_the_budget(tmp_path):
    parts = ringed_parts(shell__shape_sd_mm=3.0, strapping__wave_mm=20.0)
    parts.tables["uncertainty"] = [
        ["input", "u", "unit"],
        *(["ring_lengths", 2.0, "mm"], ["ring_axes", 1.0, "mm"], ["tilt", 0.5, "mm/m"]),
        ["dip_position", 10.0, "mm"],
    ]
    parts.tables["obstructions"] = [["circumference", "kind", "span_m"], ["1a", "sag", 3.0]]
    found = {line.name for line in result_of(parts, tmp_path).budget(1.2).lines}
    assert found >= {
        *("straps", "instrument_scale", "tape_weight", "tape_level", "area_term", "bulge"),
        *("ovality", "seams", "ring_lengths", "ring_axes", "tilt", "dip_position"),
        "plate_thickness",
    }


def test_a_ring_is_assumed_to_bulge_less_than_a_course_of_a_large_tank(tmp_path):
    """Truth: the square root of the radius, from R 7.5 m down."""
    found = []
    for radius in (0.8, 1.8):
        parts = ringed_parts((radius,) * 3, horizontal__tilt_mm_per_m=0.0)
        wall = find_ringed_wall(tankcal.load(write_folder(tmp_path / str(radius), parts)), str)
        sizes = wall.field.amplitudes.likely_m2 / [one.median_m**2 for one in COMPONENTS]
        found.append(dict(zip([one.name for one in COMPONENTS], sizes, strict=True)))
        assert found[-1]["common bulge"] == pytest.approx(radius / 7.5, rel=0.3)
        assert found[-1]["drawn-in joints"] == pytest.approx(radius / 7.5, rel=0.3)
    grown = found[1]["common bulge"] / found[0]["common bulge"]
    assert grown == pytest.approx(1.8 / 0.8, rel=0.1)


@pytest.mark.slow
def test_ovality_moves_the_middle_and_hardly_the_top(tmp_path):
    """Property: a wave has no area to the first order; the bottom that dips count from moves."""
    result = result_of(ringed_parts(shell__shape_sd_mm=3.0, horizontal__tilt_mm_per_m=0), tmp_path)
    levels = np.array([1.2, result.body.highest_m])
    oval = next(one for one in result.body.sources(levels) if one.kind == "ovality")
    middle, top = np.sqrt(np.sum(oval.columns_m3**2, axis=1))
    assert middle > 0.02
    assert top < 1e-6


@pytest.mark.slow
def test_a_tape_on_a_warm_shell_nearly_cancels(tmp_path):
    """Truth: the closed form of both expansions, (1 + a_t dT)^2 / (1 + a_s dT)^2 nearly 1."""
    cold = result_of(ringed_parts(), tmp_path / "cold")
    warm = result_of(ringed_parts(survey__shell_temperature_c=35.0), tmp_path / "warm")
    ratio = warm.body.parts[0].capacity_m3 / cold.body.parts[0].capacity_m3
    tape, shell = 1 + 1.15e-5 * 15, 1 - 1.1e-5 * 15
    r, plate = 1.2, 0.008
    outside = (r + plate + 1e-4) * tape - 1e-4
    wide = ((outside - plate) * shell / r) ** 2 * shell
    assert ratio == pytest.approx(wide, abs=2e-7)
    line = next(one for one in warm.budget(1.2).lines if one.name == "shell_temperature")
    assert abs(line.contribution) < 0.4 * 2 / np.sqrt(3) * 3 * 1.1e-5 * warm.at(1.2).value_m3


@pytest.mark.slow
def test_sag_under_the_tank_is_taken_off(tmp_path):
    """Truth: a tape of 0.1 N/m at 50 N over 4 m: w^2 L^3 / (24 F^2) longer."""
    parts = ringed_parts()
    parts.tables["circumferences"][1][3] += 0.1**2 * 4**3 / (24 * 50**2)
    parts.tables["obstructions"] = [["circumference", "kind", "span_m"], ["1a", "sag", 4.0]]
    result = result_of(parts, tmp_path)
    assert result.rings.reduced[0].circumference_m == pytest.approx(2 * np.pi * 1.208, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("apart_mm", "told"), [(2.5, False), (3.5, True)])
def test_repeats_within_3_mm(tmp_path, apart_mm, told):
    parts = ringed_parts()
    again = list(parts.tables["circumferences"][1])
    again[3] += apart_mm / 1000
    parts.tables["circumferences"].append(again)
    assert ("repeats_apart" in codes(result_of(parts, tmp_path))) is told


@pytest.mark.slow
def test_exchanged_rings_are_named(tmp_path):
    """Of five lapped rings the readings of the second and the third are exchanged."""
    result = result_of(ringed_parts((1.2, 1.2, 1.192, 1.192, 1.2), length_m=1.8), tmp_path)
    told = next(one for one in result.warnings if one.expected.code == "rings_exchanged")
    assert "(2 - 3)" in str(told)


@pytest.mark.slow
def test_inner_and_outer_confused_are_told_by_laps(tmp_path):
    laps = ("outer", "inner", "outer")
    assert codes(result_of(ringed_parts(laps=laps), tmp_path / "sound")) == set()
    confused = ringed_parts((1.192, 1.2, 1.192), laps=laps)
    assert codes(result_of(confused, tmp_path / "confused")) == {"laps_reversed"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_exchanges_are_found_and_sound_orders_left_alone(seed):
    """Simulation: radii of sound lapped and flush rings scatter by 0.7 mm; truth: who exchanged."""
    rng, wrong, found, named = np.random.default_rng(seed), 0, 0, 0
    for _ in range(100):
        count = int(rng.integers(3, 9))
        plates = np.full(count, rng.uniform(0.005, 0.012))
        outer = (np.arange(count) + rng.integers(2)) % 2 == 0
        inside = 1.2 + rng.normal(0, 7e-4, count)
        lapped = inside + outer * plates
        none = [None] * count
        wrong += bool(exchanged_rings(lapped + plates, plates, plates, none))
        wrong += bool(exchanged_rings(inside + plates, plates, plates, none))
        one, other = rng.choice(np.flatnonzero(outer)), rng.choice(np.flatnonzero(~outer))
        lapped[[one, other]] = lapped[[other, one]]
        laps = ["outer" if wide else "inner" for wide in outer]
        pairs = [pair[:2] for pair in exchanged_rings(lapped + plates, plates, plates, laps)]
        found += bool(pairs)
        named += tuple(sorted((int(one), int(other)))) in pairs
    assert wrong == 0
    assert found >= 75
    assert named == found


def test_two_pairs_are_named_where_both_fit():
    """Four rings, outer first; the first two exchanged look like the last two, inner first."""
    plates = np.full(4, 0.008)
    inside = np.array([1.192, 1.200, 1.200, 1.192])
    pairs = [pair[:2] for pair in exchanged_rings(inside + plates, plates, plates, [None] * 4)]
    assert pairs == [(0, 1), (2, 3)] or pairs == [(2, 3), (0, 1)]


@pytest.mark.slow
def test_record_states_rings_and_what_no_dip_reads(tmp_path):
    """Truth: the specification's 2.274 L, and the radii that were strapped."""
    record = record_of(result_of(ringed_parts(), tmp_path))
    solid = {one["code"]: one["value"] for one in record["solid"]}
    assert 1000 * solid["below_zero"] == pytest.approx(2.274, abs=0.001)
    assert 1000 * solid["left_at_full"] == pytest.approx(113.675, abs=0.01)
    rings = record["strapping"]["courses"]
    assert [one["inside_radius_m"] for one in rings] == pytest.approx([1.2, 1.192, 1.2], abs=1e-9)
    assert all(0 < one["radius_sd_m"] < 2e-3 for one in rings)


@pytest.mark.slow
def test_a_single_reading_is_told(tmp_path):
    parts = ringed_parts()
    del parts.tables["circumferences"][2]
    assert "rings_controlled_by_nothing" in codes(result_of(parts, tmp_path))


@pytest.mark.slow
def test_nominal_diameter_is_compared(tmp_path):
    parts = ringed_parts(tank__nominal_diameter_m=2.5)
    assert "rings_unlike_nominal" in codes(result_of(parts, tmp_path))
    assert reading_of(1.2) == pytest.approx(7.5908, abs=1e-3)


@pytest.mark.slow
def test_example_holds_its_truth():
    """Truth: polygons of the sections of a simulated tank (examples/rings/truth.json)."""
    truth = json.loads((ROOT / "examples" / "rings" / "truth.json").read_text(encoding="utf-8"))
    result = tankcal.run(tankcal.load(ROOT / "examples" / "rings"), simulated=False)
    for dip, volume in zip(truth["dips_m"], truth["volumes_m3"], strict=True):
        found = result.at(dip)
        assert abs(found.value_m3 - volume) < found.U_m3
    assert result.body.parts[0].capacity_m3 == pytest.approx(truth["capacity_m3"], abs=0.1)
    assert codes(result) == set()
