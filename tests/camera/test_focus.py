"""Distortion by distance: the checks of the formulas, geometry, and the outer iteration."""

from dataclasses import replace

import numpy as np
import pytest
from networks import INTERIOR
from surveyed import by_photographs, places

from tankcal.camera.model import (
    CONVENTIONS,
    Form,
    Lens,
    correct_image_points,
    depth_factor,
    distort_image_points,
    refer_to_focus,
)
from tankcal.survey import adjust_survey

F = 100.0
NEAR, FAR = 4000.0, 25000.0
RADIAL = np.array([[1.1e-7, -2e-12, 3e-17], [1.6e-7, -3e-12, 1e-17]])
LENS = Lens(F, 8000.0, np.array([NEAR, FAR]), RADIAL)


def radial_at(distance_mm, distances_mm, radial):
    """K1, K2, K3 at a distance, from two calibrations of a lens with the focal length F."""
    return Lens(F, np.inf, np.array(distances_mm), np.array(radial)).radial_at(distance_mm)


def test_the_calibrations_come_back():
    """Property (methods, S 48-51): S = S1 gives K(S1), S = S2 gives K(S2)."""
    np.testing.assert_allclose(LENS.radial_at([NEAR, FAR]), RADIAL, rtol=1e-14)
    turned = radial_at(8000.0, [FAR, NEAR], RADIAL[::-1])
    np.testing.assert_allclose(turned, LENS.radial_in_focus, rtol=1e-14)


def test_the_formula_as_it_is_printed():
    """Second method: alpha and K as S 48-51 print them."""
    s = 8000.0
    alpha = (FAR - s) / (FAR - NEAR) * (NEAR - F) / (s - F)
    i = np.array([1, 2, 3])

    def unscaled(k, at):
        return k / (1 - F / at) ** (2 * i + 1)

    near, far = unscaled(RADIAL[0], NEAR), unscaled(RADIAL[1], FAR)
    expected = (1 - F / s) ** (2 * i + 1) * (alpha * near + (1 - alpha) * far)
    np.testing.assert_allclose(LENS.radial_in_focus, expected, rtol=1e-13)


def test_the_second_distance_may_be_infinite():
    """Limit (S 52-55): the formula at S2 = infinity is that for a very large S2, and at s too."""
    at = [NEAR, np.inf]
    np.testing.assert_allclose(
        radial_at(8000.0, at, RADIAL), radial_at(8000.0, [NEAR, 1e15], RADIAL), rtol=1e-11
    )
    np.testing.assert_allclose(radial_at(np.inf, at, RADIAL), RADIAL[1], rtol=1e-14)
    alpha = (NEAR - F) / (8000.0 - F)  # S 52
    k = (1 - F / 8000.0) ** 3 * (alpha * RADIAL[0, 0] / (1 - F / NEAR) ** 3
                                + (1 - alpha) * RADIAL[1, 0])  # fmt: skip
    assert radial_at(8000.0, at, RADIAL)[0] == pytest.approx(k, rel=1e-13)


def test_two_calibrations_at_one_distance_are_refused():
    with pytest.raises(ValueError, match="equal distances"):
        radial_at(5000.0, [NEAR, NEAR], RADIAL)


def test_depth_factor():
    """S 56 as printed; 1 in focus; a nearer object is imaged larger."""
    depth = np.array([5000.0, 8000.0, 20000.0])
    expected = (8000.0 - F) / (depth - F) * depth / 8000.0
    np.testing.assert_allclose(depth_factor(depth, 8000.0, F), expected, rtol=1e-14)
    assert depth_factor(8000.0, 8000.0, F) == 1


def test_decentring_does_not_change_within_the_depth_of_field():
    """Closed form: gamma (1 - f/s') = 1 - f/s for every s' (S 58, s mended to s')."""
    depth = np.array([3000.0, 8000.0, 90000.0])
    found = depth_factor(depth, 8000.0, F) * (1 - F / depth)
    np.testing.assert_allclose(found, 1 - F / 8000.0, rtol=1e-14)


def test_in_depth_by_similar_triangles():
    """Second method (S 57): dr(r) = dr_s'(gamma r) / gamma, at some radii."""
    r, depth = np.linspace(5, 90, 7), 6000.0
    gamma = depth_factor(depth, LENS.focus_mm, F)
    powers = np.array([3, 5, 7])
    there = ((gamma * r)[:, None] ** powers) @ LENS.radial_at(depth) / gamma
    np.testing.assert_allclose(
        r[:, None] ** powers @ LENS.radial_in_depth(depth), there, rtol=1e-13
    )
    np.testing.assert_allclose(
        LENS.radial_in_depth(np.array([8000.0]))[0], LENS.radial_in_focus, rtol=1e-14
    )


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_images_as_in_focus(convention):
    """Closed form: what was imaged with the distortion of its depth becomes that of the focus."""
    rng = np.random.default_rng(3)
    form = Form(convention, "both_y")
    ideal, depth = rng.uniform(-70, 70, (40, 2)), rng.uniform(3000, 30000, 40)
    interior = np.zeros(13)
    interior[[0, 1, 2, 3, 4, 5, 7, 8, 11]] = 101, 0.1, -0.2, *LENS.radial_in_focus, 1e-6, 2e-6, 1e-4
    own = np.tile(interior, (40, 1))
    own[:, 3:6] = LENS.radial_in_depth(depth)
    images = distort_image_points(ideal, own, form)
    depth[7], images[7] = np.nan, distort_image_points(ideal[7:8], interior, form)[0]
    found = refer_to_focus(images, depth, interior, form, LENS)
    np.testing.assert_allclose(correct_image_points(found, interior, form), ideal, atol=1e-11)
    assert np.abs(found - images).max() > 1e-3


# --- the outer iteration, by simulation ----------------------------------------------------------

FOCUS = Lens(F, 11000.0, np.array([6000.0, 25000.0]),
             np.array([[-3.0e-7, 1e-11, 0], [4.0e-7, -2e-11, 0]]))  # fmt: skip


def simulated(seed=0, noise=1.0, lens=FOCUS):
    """Measurements whose images have the distortion of their depths; and the Truth."""
    interior = INTERIOR.copy()
    interior[3:6] = lens.radial_in_focus
    found, truth = by_photographs(seed, noise=noise, interior=interior)
    images = found.image_points
    photo = np.array([int(name[1:]) for name in images.photo])
    point = np.array([int(name[1:]) for name in images.point])
    away = truth.xyz_m[point] - truth.photo_xyz_m[photo]
    depth = -1000 * np.sum(truth.rotation[photo, 2] * away, axis=1)
    own = np.tile(interior, (len(depth), 1))
    own[:, 3:6] = lens.radial_in_depth(depth)
    ideal = correct_image_points(images.xy_mm, interior, Form())
    setup = replace(found.cameras[0], lens=lens)
    return (
        replace(
            found,
            cameras=(setup,),
            settings=replace(found.settings, snooping=False, depth_of_field=True),
            image_points=replace(images, xy_mm=distort_image_points(ideal, own, Form())),
        ),
        truth,
    )


def uncorrected(measurements):
    return replace(measurements, settings=replace(measurements.settings, depth_of_field=False))


def rms_mm(adjustment, truth):
    return 1000 * np.sqrt(np.mean(places(adjustment, truth) ** 2))


@pytest.mark.slow
def test_the_outer_iteration_finds_the_truth_without_noise(figure):
    """Simulation, exact: without the correction the points are biased, with it they are not."""
    measurements, truth = simulated(noise=0.0)
    without = adjust_survey(uncorrected(measurements))
    lines = []
    found = adjust_survey(measurements, lines.append)
    assert rms_mm(without, truth) > 0.05
    assert rms_mm(found, truth) < 1e-4
    assert without.depth is None
    assert found.depth.last_change_mm < 1e-6
    assert 2 <= found.depth.rounds <= 8
    assert sum("for their depth" in line for line in lines) == found.depth.rounds - 1
    values = found.adjusted.camera(0)[0]
    assert values["K1"] == pytest.approx(FOCUS.radial_in_focus[0], rel=1e-4)
    figure("depth of field, rms of points, mm, left alone", f"{rms_mm(without, truth):.3f}")
    figure("depth of field, rms of points, mm, corrected", f"{rms_mm(found, truth):.1e}")
    figure("depth of field, rounds; largest correction, um",
           f"{found.depth.rounds}; {1e3 * found.depth.largest_mm:.1f}")  # fmt: skip


def weighed(seeds, figure):
    """Errors of the points along the bias that the noise-free survey has, in their sd: (seeds, 2).

    The best test there is for that bias: normal with mean 0 once it is gone, else with its size.
    """
    quiet, truth = simulated(noise=0.0)
    bias = places(adjust_survey(uncorrected(quiet)), truth).ravel()
    found = []
    for seed in seeds:
        measurements, truth = simulated(seed)
        both = [adjust_survey(one) for one in (measurements, uncorrected(measurements))]
        weight = np.linalg.solve(both[0].full_covariance_m2(), bias)
        scale = np.sqrt(bias @ weight)
        found.append([weight @ places(one, truth).ravel() / scale for one in both])
    corrected_, left = np.mean(found, axis=0)
    figure(f"depth of field, bias of {len(found)} surveys in its sd, left alone", f"{left:.2f}")
    figure(f"depth of field, bias of {len(found)} surveys in its sd, corrected",
           f"{corrected_:.2f}")  # fmt: skip
    return np.array(found)


@pytest.mark.slow
@pytest.mark.twentieth
def test_the_outer_iteration_with_noise(figure):
    """Simulation: the bias is gone, whatever the noise."""
    found = weighed(range(2), figure)
    assert abs(found[:, 0].mean()) < 3.3 / np.sqrt(2)


@pytest.mark.study
def test_the_outer_iteration_with_noise_in_full(figure):
    found = weighed(range(40), figure)
    assert abs(found[:, 0].mean()) < 3.3 / np.sqrt(40)
    assert found[:, 1].mean() > 3.3 / np.sqrt(40)
    assert abs(found[:, 0].std(ddof=1) - 1) < 4 / np.sqrt(2 * 39)


@pytest.mark.slow
def test_a_lens_that_hardly_changes_gains_nothing(figure):
    """Published (S, conclusions): no significant gain; so it is where K changes by 3 % only."""
    same = replace(FOCUS, radial=np.array([[5.0e-8, -2e-12, 0], [5.15e-8, -2e-12, 0]]))
    measurements, _ = simulated(seed=4, lens=same)
    found, without = adjust_survey(measurements), adjust_survey(uncorrected(measurements))
    size = np.abs(found.xyz_m - without.xyz_m).max()
    sd = np.sqrt(np.einsum("nii->ni", found.covariance_m2))
    assert size < 0.5 * sd.min()
    figure("depth of field, K within 3 %: largest change of a point, mm", f"{1e3 * size:.3f}")


@pytest.mark.slow
def test_points_without_a_depth_are_left():
    """What is not adjusted, or lies behind the lens, keeps its image; it is counted."""
    measurements, _ = simulated(seed=1)
    lens = replace(FOCUS, focal_length_mm=5000.0)  # so that near points lie within two of them
    cameras = (replace(measurements.cameras[0], lens=lens),)
    found = adjust_survey(replace(measurements, cameras=cameras))
    assert found.depth.left > 0
