"""Planning formulas against printed numbers, closed forms and an adjusted stereo pair."""

import json

import numpy as np
import pytest

from tankcal.planning import formulas


@pytest.fixture
def printed(shared):
    return json.loads((shared / "facts" / "pessoa_eq31_39_planning.json").read_text())


def test_the_flight_is_as_printed(printed):
    # published: P equations 31 to 33
    scale = formulas.scale_denominator(printed["GSD_m"], printed["pixel_mm"])
    assert scale == pytest.approx(printed["def"], abs=0.05)
    assert formulas.flying_height_m(printed["f_mm"], scale) == pytest.approx(
        printed["Z_m"], abs=0.005
    )


def test_the_accuracy_is_as_printed(printed):
    # published: P equations 34 to 39, with the printed base
    sd = formulas.object_sds_m(
        [printed["x_mm"], printed["y_mm"]],
        printed["f_mm"], printed["Z_m"], printed["B_m"], printed["sigma_x_mm"],
    )  # fmt: skip
    assert sd == pytest.approx([printed["sX_m"], printed["sY_m"], printed["sZ_m"]], abs=1e-3)
    assert np.hypot(*sd[:2]) == pytest.approx(printed["splan_m"], abs=1e-3)


def test_each_stage_has_a_third(printed):
    # published: P's budget in plan, whose digits are cut off, not rounded
    found = formulas.thirds_m(printed["budget_plan_m"][0])
    assert np.floor(found * 1000) / 1000 == pytest.approx(printed["budget_plan_m"])
    assert formulas.thirds_m(0.9, 4) == pytest.approx([0.9, 0.3, 0.1, 1 / 30])  # closed form


def test_height_is_the_variance_of_a_simulated_parallax():
    # simulation: Z = f B / (x1 - x2) of two noisy coordinates, and X = x1 Z / f
    rng = np.random.default_rng(2)
    f, z, b, sd, x = 50.0, 300.0, 120.0, 0.002, 9.0
    first = x + rng.normal(0, sd, 200_000)
    second = x - f * b / z + rng.normal(0, sd, 200_000)
    height = f * b / (first - second)
    found = formulas.object_sds_m([x, x], f, z, b, sd)
    assert found[2] == pytest.approx(height.std(), rel=0.01)
    # P takes the image coordinate in X = x Z / f for independent of the parallax
    centred = x / f * height + z / f * rng.normal(0, sd, 200_000)
    assert found[0] == pytest.approx(centred.std(), rel=0.01)


def test_close_range_is_q_m_s():
    # closed form: 0.7 * 150 * 5 um
    assert formulas.close_range_sd_m(0.7, 150, 0.005) == pytest.approx(5.25e-4)


def test_many_points_at_once():
    corners = np.array([[2.7, -2.0], [0.0, 0.0], [1.0, 1.0]])
    found = formulas.object_sds_m(corners, 4.38, 262.0, 73.2, 0.0007)
    assert found.shape == (3, 3)
    assert found[1, 0] == pytest.approx(262.0 / 4.38 * 0.0007)  # closed form: in the middle
    assert len(set(found[:, 2])) == 1


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: formulas.scale_denominator(0, 0.001), "gsd_m"),
        (lambda: formulas.flying_height_m(float("nan"), 1000), "focal_mm"),
        (lambda: formulas.object_sds_m([0, 0], 4, 100, 0, 0.001), "base_m"),
        (lambda: formulas.object_sds_m([1], 4, 100, 60, 0.001), "xy_mm"),
        (lambda: formulas.thirds_m(1, -2), "stages"),
        (lambda: formulas.close_range_sd_m(1, float("inf"), 0.1), "scale"),
    ],
)
def test_nonsense_is_refused_by_name(call, name):
    with pytest.raises(ValueError, match=name):
        call()


def test_control_factor_restores_the_true_error():
    # simulation: lines through control points with known errors
    rng = np.random.default_rng(4)
    x = np.linspace(0, 1, 6)
    design = np.column_stack([np.ones(6), x])
    errors = rng.normal(0, 2.0, (6, 40_000))
    residuals = errors - design @ np.linalg.lstsq(design, errors, rcond=None)[0]
    at_control = np.sqrt(np.mean(residuals**2))
    factor = formulas.control_factor(points=6, unknowns=2, equations=1)
    assert factor * at_control == pytest.approx(2.0, rel=0.01)
    with pytest.raises(ValueError, match="expected 0 to 5"):
        formulas.control_factor(points=6, unknowns=6, equations=1)


def test_volume_of_a_cylinder_is_as_published():
    # published: S 61 to 65, 0.10 % of 1252.8 m3; with five independent sections 0.74 m3
    sd = formulas.cylinder_volume_sd_m3(6.479, 9.5, 0.003, 0.004)
    assert sd**2 == pytest.approx(1.624, abs=5e-4)
    assert sd / (np.pi * 6.479**2 * 9.5) == pytest.approx(1.0e-3, abs=5e-5)
    five = formulas.cylinder_volume_sd_m3(6.479, 9.5, 0.003, 0.004, sections=5)
    assert five == pytest.approx(0.74, abs=5e-3)
