"""Depth of field, diffraction, size of targets: closed forms and rays through a thin lens."""

import numpy as np
import pytest

from tankcal.planning import formulas


def blur_mm(focal_mm, f_number, focus_m, distance_m):
    """Second method: width of the cone of light of a thin lens where the sensor is."""
    f = focal_mm
    sensor, image = (1 / (1 / f - 1 / (1000 * s)) for s in (focus_m, distance_m))
    return f / f_number * abs(image - sensor) / image


@pytest.mark.parametrize("f_number", [5.6, 11, 22])
def test_at_the_limits_the_blur_is_the_one_allowed(f_number):
    near, far = formulas.depth_of_field_m(35.0, f_number, 0.02, 6.0)
    assert blur_mm(35.0, f_number, 6.0, near) == pytest.approx(0.02, rel=1e-9)
    if np.isfinite(far):
        assert blur_mm(35.0, f_number, 6.0, far) == pytest.approx(0.02, rel=1e-9)
    assert near < 6.0 < far


def test_hyperfocal_distance_is_sharp_from_its_half():
    # closed form: 35 mm, f/8, 0.02 mm: 35^2 / 0.16 + 35 mm
    h = formulas.hyperfocal_m(35.0, 8, 0.02)
    assert h == pytest.approx(7.69125)
    near, far = formulas.depth_of_field_m(35.0, 8, 0.02, h)
    assert near == pytest.approx(h / 2, rel=1e-12)
    assert np.isinf(far)


def test_the_f_number_that_a_tank_needs():
    """Closed form: with it, and the focus between, the limits are the ones asked for."""
    n = formulas.f_number_for(35.0, 0.01, 8.0, 17.0)
    s = formulas.focus_for_m(8.0, 17.0)
    assert s == pytest.approx(2 * 8 * 17 / 25)
    assert formulas.depth_of_field_m(35.0, n, 0.01, s) == pytest.approx((8.0, 17.0), rel=1e-9)


def test_silva_stopped_down_to_22():
    """Published: f = 100 mm, f/22, focus 8 and 10 m. With 0.05 mm everything from 5 m on is sharp
    when it is focused at 8 m, and diffraction is 30 um wide."""
    near, far = formulas.depth_of_field_m(100.0, 22, 0.05, 8.0)
    assert near == pytest.approx(blur_limit(100.0, 22, 8.0, 0.05), rel=1e-6)
    assert 4.0 < near < 5.0
    assert far > 50.0
    assert formulas.diffraction_mm(22, 100.0, 8.0) == pytest.approx(
        2.44 * 550e-6 * 22 * (1 + 0.1 / 7.9)
    )


def blur_limit(focal_mm, f_number, focus_m, sharp_mm):
    """The nearer distance at which the blur is the one allowed, by bisection."""
    low, high = 2 * focal_mm / 1000, focus_m
    for _ in range(200):
        middle = (low + high) / 2
        worse = blur_mm(focal_mm, f_number, focus_m, middle) > sharp_mm
        low, high = (middle, high) if worse else (low, middle)
    return low


def test_diffraction_far_away():
    assert formulas.diffraction_mm(8) == pytest.approx(0.0107360)  # closed form: 2.44 x 550 nm x 8


def test_size_of_targets():
    # closed form: 10 m, c = 24 mm, pixel 4 um: 1.667 mm a pixel; 8 of them, half as wide at 60 deg
    scale = 10 / 0.024
    assert formulas.target_diameter_m(scale, 0.004) == pytest.approx(0.0133333, abs=1e-6)
    assert formulas.target_diameter_m(scale, 0.004, slant_rad=np.pi / 3) == pytest.approx(
        0.0266667, abs=1e-6
    )
    assert formulas.coded_target_m(scale, 0.004, 6) == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: formulas.hyperfocal_m(0, 8, 0.02), "focal_mm"),
        (lambda: formulas.depth_of_field_m(35, 8, 0.02, 0.03), "focus_m"),
        (lambda: formulas.f_number_for(35, 0.02, 9, 8), "nearer distance first"),
        (lambda: formulas.f_number_for(35, 0.02, 8, 8), "two distances"),
        (lambda: formulas.focus_for_m(9, float("nan")), "nearer distance first"),
        (lambda: formulas.diffraction_mm(22, 100, 0.05), "focus_m"),
        (lambda: formulas.target_diameter_m(400, 0.004, slant_rad=1.6), "slant_rad"),
        (lambda: formulas.target_diameter_m(400, 0.004, slant_rad=float("nan")), "slant_rad"),
        (lambda: formulas.target_diameter_m(400, -1), "pixel_mm"),
    ],
)
def test_nonsense_is_refused_by_name(call, name):
    with pytest.raises(ValueError, match=name):
        call()
