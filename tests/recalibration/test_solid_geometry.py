"""Sizes of lying tanks and spheres out of tables integrated numerically, slice by slice."""

import numpy as np
import pytest
from page_figures import figures_of

import tankcal
from tankcal.errors import InputError
from tankcal.products.recalibration.former import FormerTable
from tankcal.products.recalibration.solid_geometry import (
    fit_lying,
    fit_sphere,
    size_sections,
    uncertainty_rows,
)
from tankcal.products.recalibration.table_job import make_solid_job, write_job

SLICES = 4000
PRINTED = (  # recalibration.md, section 3: litres at 0.1, 0.2 ... 2.4 m
    551, 1504, 2708, 4100, 5639, 7299, 9055, 10889, 12785, 14727, 16702, 18695, 20695, 22687, 24660,
    26600, 28493, 30323, 32074, 33727, 35258, 36640, 37831, 38766,
)  # fmt: skip


def segment(radius, level):
    level = np.clip(level, -radius, radius)
    chord = np.sqrt(np.maximum(radius**2 - level**2, 0))
    return radius**2 * np.arccos(np.clip(-level / np.maximum(radius, 1e-12), -1, 1)) + level * chord


def lying(dips, diameter, length, profile=None, depth=0.0, tilt=0.0, place=0.0):
    """Volumes by slices square to the axis; `profile` is an end's radius at x from its edge."""
    s, out = (np.arange(SLICES) + 0.5) / SLICES * length, []
    x = (np.arange(SLICES) + 0.5) / SLICES * depth
    for dip in dips:
        level = -diameter / 2 + dip * np.hypot(1, tilt)
        volume = segment(np.full(SLICES, diameter / 2), level - tilt * (s - place)).sum() * length
        if profile is not None:
            for along in (-x, length + x):
                volume += segment(profile(x), level - tilt * (along - place)).sum() * depth
        out.append(volume / SLICES)
    return np.array(out)


def dished(radius, dish, knuckle):
    """(profile, depth) of a torispherical end, from its centres."""
    reach = np.sqrt((dish - knuckle) ** 2 - (radius - knuckle) ** 2)
    joint = knuckle * reach / (dish - knuckle)

    def profile(x):
        toroid = radius - knuckle + np.sqrt(np.maximum(knuckle**2 - x**2, 0))
        return np.where(x < joint, toroid, np.sqrt(np.maximum(dish**2 - (x + reach) ** 2, 0)))

    return profile, dish - reach


def ellipse(radius, depth):
    return lambda x: radius * np.sqrt(1 - (x / depth) ** 2), depth


def table(dips, volumes, quantum=0.001, **known):
    rounded = np.round(volumes / quantum) * quantum
    return FormerTable("old.csv", dips, rounded, 0.0, quantum, **known)


def within(fit, name, truth, factor=4):
    value, u = fit[name]
    return abs(value - truth) < factor * u


@pytest.mark.slow
def test_the_printed_example():
    found = fit_lying(table(np.arange(1, 25) / 10, np.array(PRINTED) / 1000))
    best = found.best
    (diameter, u_d), (length, u_l), (zero, u_z) = (
        best[name] for name in ("diameter", "length", "zero")
    )
    assert best.ends == "flat"
    assert (round(diameter, 5), round(length, 4), round(1000 * zero, 2)) == (2.49997, 8.0002, 2.99)
    assert [round(1000 * u, 2) for u in (u_d, u_l, u_z)] == [0.04, 0.18, 0.01]
    assert round(1000 * best.rms_m3, 2) == 0.30
    least, largest = found.tilt_size  # hardly determined: level, or 3 mm/m
    assert least == 0
    assert 0.001 < largest < 0.005


ENDS = {
    "flat": (None, 0.0),
    "hemispherical": ellipse(1.3, 1.3),
    "ellipsoidal_2_to_1": ellipse(1.3, 0.65),
    "torispherical_din_28011": dished(1.3, 2.6, 0.26),
    "torispherical_din_28013": dished(1.3, 0.8 * 2.6, 0.154 * 2.6),
    "ellipsoidal": ellipse(1.3, 0.45),
}


@pytest.mark.study
@pytest.mark.parametrize("ends", ENDS)
def test_sizes_and_ends_of_simulated_tables(ends):
    dips = np.arange(0, 128) * 0.02
    volumes = lying(dips + 0.012, 2.6, 9.5, *ENDS[ends])
    found = fit_lying(table(dips, volumes))
    assert found.best.ends == ends
    assert set(found.equally_good_ends) <= {"ellipsoidal"}  # of any depth: it has them in it
    for name, truth in (("diameter", 2.6), ("length", 9.5), ("zero", 0.012)):
        assert within(found.best, name, truth)


@pytest.mark.study
def test_a_tilt_is_found_where_nothing_else_explains_the_rows():
    dips = np.arange(1, 95) * 0.025  # liquid.md, section 3, the pose
    volumes = lying(dips + 0.004, 2.4, 9.0, tilt=0.010, place=1.5)
    found = fit_lying(table(dips, volumes), dip_from_a_m=1.5)
    assert found.best is found.tilted
    for name, truth in (("diameter", 2.4), ("length", 9.0), ("zero", 0.004), ("tilt", 0.010)):
        assert within(found.best, name, truth)
    other = found.best.mirror_image  # the same volumes from a tilt the other way
    assert other == pytest.approx((-0.010, 0.004 - 2 * 0.010 * 3.0), abs=1e-3)
    again = lying(dips[::10] + other[1], 2.4, 9.0, tilt=other[0], place=1.5)
    assert again == pytest.approx(volumes[::10], abs=2e-3)


def sphere_volumes(dips, radius):
    """By slices on the level."""
    out = []
    for dip in dips:
        z = (np.arange(SLICES) + 0.5) / SLICES * dip
        out.append(np.pi * (z * (2 * radius - z)).sum() * dip / SLICES)
    return np.array(out)


def test_a_sphere():
    dips = np.arange(0, 98) / 10
    fit = fit_sphere(table(dips, sphere_volumes(dips + 0.03, 5.0)))
    assert within(fit, "diameter", 10.0)
    assert within(fit, "zero", 0.03)
    assert fit.variance_factor == 1
    assert fit.u[0] < 1e-4


@pytest.mark.slow
def test_u_holds_for_simulated_spheres():
    """Rounding alone: 200 spheres, (D - truth) / u of a standard deviation of 1."""
    rng, dips = np.random.default_rng(3), np.arange(0, 60) / 10
    scores = []
    for _ in range(200):
        radius, zero = rng.uniform(3, 8), rng.uniform(0, 0.05)
        h = dips[dips < 2 * radius - 0.1] + zero
        fit = fit_sphere(table(h - zero, np.pi * h**2 * (3 * radius - h) / 3))
        scores.append((fit["diameter"][0] - 2 * radius) / fit["diameter"][1])
    assert np.std(scores) == pytest.approx(1, abs=0.2)
    assert abs(np.mean(scores)) < 0.25


def test_too_few_rows_are_one_line():
    with pytest.raises(InputError, match="5 rows with liquid; expected 8 or more"):
        fit_sphere(table(np.arange(6) / 10, np.arange(6.0)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["horizontal", "sphere"])
def test_the_job_gives_the_table_back(kind, tmp_path):
    dips, zero = np.arange(0, 120) / 50, 0.02
    known = {"reference_temperature_c": 15.0, "date": "2014-05-03"}
    if kind == "sphere":
        former = table(dips, sphere_volumes(dips + zero, 2.0), **known)
        fit = fit_sphere(former)
    else:
        former = table(
            dips, lying(dips + zero, 2.6, 8.0, *ENDS["torispherical_din_28011"]), **known
        )
        fit = fit_lying(former).best
    write_job(make_solid_job(former, fit, tank_id="T-1"), tmp_path / "job")
    result = tankcal.run(tankcal.load(tmp_path / "job"))
    new = result.table.volume_m3[: len(dips)]
    assert result.table.height_m[: len(dips)] == pytest.approx(dips, abs=1e-9)
    (most_l, quantum_l) = figures_of(
        "docs/read-table.md", "within its rounding (tests: () L where rows are rounded to () L)"
    )
    assert float(quantum_l) == 1000 * former.volume_quantum_m3
    assert 1000 * np.abs(new - former.volume_m3).max() < float(most_l)
    by_rounding = 2 * np.hypot(fit["diameter"][1] * 2 * new / fit["diameter"][0], 0.001)
    assert np.all(result.table.U_m3[: len(dips)] < by_rounding + 0.001)
    text = (tmp_path / "job" / "job.toml").read_text()
    changed = text.replace("reference_temperature_c = 15.0", "reference_temperature_c = 35.0")
    (tmp_path / "job" / "job.toml").write_text(changed)
    warmer = tankcal.run(tankcal.load(tmp_path / "job")).table.volume_m3
    scale, dip = 1 + 1.1e-5 * 20, dips[90:91] + zero  # all lengths but the dips expand
    expected = sphere_volumes(dip, 2.0 * scale)
    if kind == "horizontal":
        profile = dished(1.3 * scale, 2.6 * scale, 0.26 * scale)
        expected = lying(dip, 2.6 * scale, 8.0 * scale, *profile)
    assert warmer[90] == pytest.approx(expected[0], abs=0.001)
    assert warmer[90] - new[90] > 0.003


def test_a_zero_below_the_bottom_is_told():
    dips = np.arange(0, 98) / 10
    fit = fit_sphere(table(dips, sphere_volumes(np.maximum(dips - 0.015, 0), 5.0)))
    assert fit.zero_depth_m == pytest.approx(0.015, abs=1e-4)
    assert size_sections(fit)["datum"]["dip_plate_z_m"] == 0


def test_U_of_the_former_table_becomes_one_of_the_diameter():
    dips = np.arange(1, 98) / 10
    volumes = sphere_volumes(dips, 5.0)
    former = table(dips, volumes, U_m3=0.003 * volumes, k=2.0)
    rows = {row["input"]: row["u"] for row in uncertainty_rows(fit_sphere(former), former)}
    assert rows["diameter"] == pytest.approx(1e4 * 0.0015 / 3, rel=0.01)  # mm, V as D cubed
