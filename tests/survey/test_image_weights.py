"""Residuals weighed in the ideal image, as published results state them."""

from dataclasses import replace

import numpy as np
import pytest
from networks import CONTROL_SD_M, IMAGE_SD_MM, INTERIOR, SCOPE, TAPE_SD_M, photographed
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tankcal.camera.model import CONVENTIONS, Form, correct_image_points
from tankcal.survey.network import adjust

STRONG = INTERIOR.copy()
UNITS = np.array([1, 1, 1, 1e-5, 1e-9, 1, 1, 1e-4, 1e-4, 1, 1, 0.1, 0.1])  # of like effect
STRONG[3] = 4e-6  # mm-2: 0.7 mm at 56 mm from the middle


def differences(function, x, step=1e-3):
    """Derivatives by differences of the fourth order, whose noise is far below scipy's own."""
    columns = []
    for i in range(len(x)):
        move = np.zeros_like(x)
        move[i] = step
        near, far = (function(x + k * move) - function(x - k * move) for k in (1, 2))
        columns.append((8 * near - far) / (12 * step))
    return np.column_stack(columns)


def weighed(survey, weights):
    (camera,) = survey.cameras
    form = replace(camera.form, weights=weights)
    return adjust(replace(survey, cameras=(replace(camera, form=form),)))


def again(survey, found):
    """Adjusted from its own end: the solver stops some 1e-6 sd before it."""
    (camera,) = survey.cameras
    values = np.array(list(found.camera()[0].values()))
    photos = replace(survey.photos, xyz_m=found.photos[0], rotation=found._state.rotation)
    nearer = replace(survey, xyz_m=found.xyz_m, photos=photos)
    return weighed(replace(nearer, cameras=(replace(camera, values=values),)), camera.form.weights)


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("affinity", ["both_y", "before_distortion"])
@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("weights", ["measured", "ideal"])
def test_without_errors_both_give_the_truth(convention, weights, affinity):
    """Simulation: the truth, to far below a standard deviation."""
    survey, truth = photographed(0, form=Form(convention, affinity), noise=0.0, interior=STRONG)
    found = weighed(survey, weights)
    assert_allclose(found.xyz_m, truth.xyz_m, atol=1e-8)
    values = list(found.camera()[0].values())
    assert_allclose(values, truth.interior, rtol=1e-5, atol=1e-11)


@pytest.mark.slow
def test_the_ideal_form_is_that_of_scipy():
    """Second method: scipy's least squares on corrected minus ideal coordinates, no Jacobian."""
    form = Form("correction_added", "both_y", weights="ideal")
    survey, truth = photographed(3, form=form, interior=STRONG, photos=6)
    found = again(survey, again(survey, weighed(survey, "ideal")))
    images, (control, tape) = survey.image_points, survey.observations
    free = np.flatnonzero(np.array(SCOPE) != "off")
    points = len(survey.points)

    def parts(x):
        xyz = x[: 3 * points].reshape(-1, 3)
        rest, interior = x[3 * points : -len(free)].reshape(-1, 6), truth.interior.copy()
        interior[free] = x[-len(free) :] * scale
        turn = Rotation.from_rotvec(rest[:, 3:]).as_matrix() @ truth.rotation
        return xyz, rest[:, :3], turn, interior

    def residuals(x):
        xyz, stations, turn, interior = parts(x)
        away = xyz[images.point] - stations[images.photo]
        u, v, w = np.einsum("nij,nj->in", turn[images.photo], away)
        ideal = -interior[0] * np.column_stack([u / w, v / w])
        of_images = (ideal - correct_image_points(images.value, interior, form)) / IMAGE_SD_MM
        of_control = (xyz[control.point, control.axis] - control.value) / CONTROL_SD_M
        length = np.linalg.norm(xyz[tape.start] - xyz[tape.end], axis=1)
        of_tape = (length - tape.value) / TAPE_SD_M
        return np.concatenate([of_images.ravel(), of_control, of_tape])

    scale = UNITS[free]
    start = np.concatenate([
        truth.xyz_m.ravel(),
        np.hstack([truth.photo_xyz_m, np.zeros((len(truth.rotation), 3))]).ravel(),
        truth.interior[free] / scale,
    ])  # fmt: skip
    other = least_squares(residuals, start, lambda x: differences(residuals, x), x_scale="jac")
    x = other.x
    size = np.linalg.norm(other.jac, axis=0)
    for _ in range(4):  # to the last digit: scipy stops where the cost stands still
        x = x - np.linalg.lstsq(other.jac / size, residuals(x))[0] / size
    xyz, _, _, interior = parts(x)
    sd = np.sqrt(np.einsum("nii->ni", found.point_covariances_m2))
    assert np.abs((found.xyz_m - xyz) / sd).max() < 1e-6
    assert np.sum(residuals(x) ** 2) == pytest.approx(found.test().chi2, rel=1e-9)
    values, names, cofactors = found.camera()
    sd = np.sqrt(np.diag(cofactors))
    ours = np.array([values[name] for name in names])
    assert np.abs((ours - interior[free]) / sd).max() < 1e-6
    measured = weighed(survey, "measured").camera()[0]
    away = np.abs(ours - [measured[name] for name in names]) / sd
    assert away.max() > 0.01, away  # the two forms are not the same estimate
