"""Focus, diffraction, size of targets: closed forms and rays through a thin lens."""

import numpy as np
import pytest

from tankcal.planning import formulas


def blur_mm(focal_mm, f_number, focus_m, distance_m):
    """Second method: width of the cone of light of a thin lens where the sensor is."""
    f = focal_mm
    sensor, image = (1 / (1 / f - 1 / (1000 * s)) for s in (focus_m, distance_m))
    return f / f_number * abs(image - sensor) / image


def test_the_f_number_that_a_tank_needs():
    # second method: with it, and the focus between, the blur at both limits is the largest allowed
    n = formulas.f_number_for(35.0, 0.01, 8.0, 17.0)
    s = formulas.focus_for_m(8.0, 17.0)
    assert s == pytest.approx(2 * 8 * 17 / 25)  # closed form
    assert blur_mm(35.0, n, s, 8.0) == pytest.approx(0.01, rel=1e-9)
    assert blur_mm(35.0, n, s, 17.0) == pytest.approx(0.01, rel=1e-9)


def test_focus_for_a_distance_without_end():
    assert formulas.focus_for_m(4.0, float("inf")) == 8.0  # closed form: hyperfocal distance


def test_diffraction_of_silva():
    # published: f = 100 mm, f/22, focus 8 m: 30 um wide
    assert formulas.diffraction_mm(22, 100.0, 8.0) == pytest.approx(
        2.44 * 550e-6 * 22 * (1 + 0.1 / 7.9)
    )


def test_diffraction_far_away():
    assert formulas.diffraction_mm(8) == pytest.approx(0.0107360)  # closed form: 2.44 x 550 nm x 8


def test_size_of_targets():
    # closed form: 10 m, c = 24 mm, pixel 4 um: 1.667 mm a pixel; 8 of them, half as wide at 60 deg
    scale = 10 / 0.024
    assert formulas.target_diameter_m(scale, 0.004) == pytest.approx(0.0133333, abs=1e-6)
    assert formulas.target_diameter_m(scale, 0.004, slant_rad=np.pi / 3) == pytest.approx(
        0.0266667, abs=1e-6
    )


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: formulas.f_number_for(0, 0.02, 8, 9), "focal_mm"),
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
