"""Volumes of exact shapes, a mesh as second method, and the published variances."""

import numpy as np
import pytest
from jacobians import assert_derivative
from shapes import azimuths, modes, ring, section_of

from tankcal.errors import HeightError
from tankcal.uncertainty import factor_of
from tankcal.volumes import ShellVolume, course_shape, feature_jacobian

HEIGHTS = np.concatenate([[0.001, 0.002, 0.01], np.linspace(0.05, 9.5, 190)])


def shell(joints, levels, radius_at, **options):
    """A shell whose sections are circles of radius_at(height), 24 points each."""
    courses = []
    for bottom, top, heights in zip(joints, joints[1:], levels, strict=False):
        outlines = [
            section_of(ring(radius_at(z), azimuths(24), (3.0 + 0.01 * z, 1.0))).outline
            for z in heights
        ]
        courses.append(course_shape(bottom, top, heights, outlines, **options))
    return ShellVolume(tuple(courses))


def test_a_cylinder_is_exact_at_every_height():
    volume = shell([0, 9.5], [[4.0]], lambda z: 6.5).volume_m3(HEIGHTS)
    assert volume == pytest.approx(np.pi * 6.5**2 * HEIGHTS, rel=1e-12)  # closed form


@pytest.mark.parametrize("levels", [[2.0, 7.5], [1.07, 4.75, 8.43]])
def test_a_frustum_is_exact_at_every_height(levels):
    volume = shell([0, 9.5], [levels], lambda z: 6.5 + 0.004 * z).volume_m3(HEIGHTS)
    low, high = 6.5, 6.5 + 0.004 * HEIGHTS
    exact = np.pi * HEIGHTS * (low**2 + low * high + high**2) / 3  # closed form
    assert volume == pytest.approx(exact, rel=1e-12)


def test_courses_of_stepped_radii_are_exact_at_every_height():
    joints, radii = np.linspace(0, 9.5, 6), np.array([6.51, 6.5, 6.495, 6.49, 6.488])
    middles = (joints[1:] + joints[:-1]) / 2
    stack = shell(joints, middles[:, None], lambda z: radii[int(z / 1.9)])
    below = np.clip(HEIGHTS[:, None] - joints[:-1], 0, 1.9)
    assert stack.volume_m3(HEIGHTS) == pytest.approx(below @ (np.pi * radii**2), rel=1e-12)
    assert stack.area_m2(middles) == pytest.approx(np.pi * radii**2, rel=1e-12)
    assert stack.area_m2([1.9, 9.5]) == pytest.approx(np.pi * radii[[1, 4]] ** 2, rel=1e-12)


def test_plate_and_temperature_are_exact_for_a_cylinder():
    options = {"inset_m": 0.008, "scale": 1.0001}
    stack = shell([0, 9.5], [[4.0]], lambda z: 6.5, **options)
    inside = 1.0001 * (6.5 - 0.008)
    assert stack.volume_m3([9.5])[0] == pytest.approx(np.pi * inside**2 * 9.5, rel=1e-12)


def test_the_loss_by_plate_is_the_derivative_by_the_inset():
    def volume(inset):
        shape = shell(
            [0, 9.5], [[2.0, 7.5]], lambda z: 6.5 + 0.01 * z, inset_m=inset[0], scale=1.01
        )
        return shape.volume_m3([1.0, 9.5])

    stack = shell([0, 9.5], [[2.0, 7.5]], lambda z: 6.5 + 0.01 * z, inset_m=0.008, scale=1.01)
    loss = stack.inset_m2([1.0, 9.5])
    assert_derivative(volume, [0.008], -loss[:, None], step=1e-5)


def test_three_sections_close_together_do_not_extrapolate_a_parabola():
    stack = shell([0, 1.9], [[0.9, 0.95, 1.0]], lambda z: 6.5 + 0.02 * (z - 0.95))
    assert stack.courses[0].degree == 0
    assert stack.volume_m3([1.9])[0] == pytest.approx(np.pi * 6.5**2 * 1.9, rel=1e-6)


def test_features_move_with_the_parameters_as_their_jacobian_says():
    rng = np.random.default_rng(2)
    outlines = []
    for _ in range(2):
        outline, _ = modes(6.5, 2, rng.normal(0, 0.01, 4), rng.normal(0, 0.01, 4))
        outlines.append(section_of(ring(outline, azimuths(12, 0.2, rng))).outline)
    course = course_shape(0, 1.9, [0.4, 1.5], outlines, inset_m=0.006, scale=1.001)
    parameters = np.concatenate([outline.parameters for outline in outlines])

    def features(values):
        moved = [
            _with_parameters(outlines[0], values[:12]),
            _with_parameters(outlines[1], values[12:]),
        ]
        shape = course_shape(0, 1.9, [0.4, 1.5], moved, inset_m=0.006, scale=1.001)
        return ShellVolume((shape,)).features

    assert_derivative(features, parameters, feature_jacobian(course), step=1e-4)


def _with_parameters(outline, parameters):
    from dataclasses import replace

    return replace(outline, parameters=parameters)


def test_a_height_outside_the_shell_is_an_error():
    stack = shell([0, 9.5], [[4.0]], lambda z: 6.5)
    for height in (-0.001, 9.501, np.nan, np.inf):
        with pytest.raises(HeightError):
            stack.volume_m3([1.0, height])


def test_a_mesh_lofted_from_the_outlines_second_method():
    """trimesh's volume of 2 x 7200 vertices; its chords leave out 0.13 ppm of the area."""
    trimesh = pytest.importorskip("trimesh")
    rng = np.random.default_rng(3)
    outlines = []
    for _ in range(2):
        outline, _ = modes(6.5, 2, rng.normal(0, 0.02, 4), rng.normal(0, 0.02, 4))
        outlines.append(section_of(ring(outline, azimuths(24))).outline)
    course = course_shape(0.0, 1.9, [0.0, 1.9], outlines)
    n = 7200
    azimuth = np.arange(n) * 2 * np.pi / n
    rings = [
        ring(o.radius_m(azimuth), azimuth, z=z) for o, z in zip(outlines, (0, 1.9), strict=True)
    ]
    i, j = np.arange(n), (np.arange(n) + 1) % n
    side = np.vstack([np.column_stack([i, i + n, j]), np.column_stack([j, i + n, j + n])])
    caps = np.vstack(
        [np.column_stack([i, j, 0 * i + 2 * n]), np.column_stack([j + n, i + n, 0 * i + 2 * n + 1])]
    )
    vertices = np.vstack([*rings, [[0, 0, 0], [0, 0, 1.9]]])
    mesh = trimesh.Trimesh(vertices, np.vstack([side, caps]), process=False)
    assert mesh.is_watertight
    volume = ShellVolume((course,)).volume_m3([1.9])[0]
    assert abs(mesh.volume) == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize(
    ("correlated", "published"),
    [(True, 1.27), (False, 0.74)],
    ids=["sections fully correlated (S equation 64)", "five independent sections"],
)
def test_variance_of_the_volume_published_s_equation_64(correlated, published, figure):
    """R 6.479 m, H 9.5 m, sd of the radius 3 mm, of the height 4 mm."""
    joints = np.linspace(0, 9.5, 6)
    stack = shell(joints, ((joints[1:] + joints[:-1]) / 2)[:, None], lambda z: 6.479)
    by_radius = np.diag(2 * stack.features / 6.479)  # dA/dR of each section
    radii = 0.003**2 * (np.ones((5, 5)) if correlated else np.eye(5))
    factor = stack.weights_m([9.5]) @ factor_of(by_radius @ radii @ by_radius.T)
    variance = np.sum(factor**2) + (stack.area_m2([9.5])[0] * 0.004) ** 2
    figure(f"sd of the volume, correlated={correlated}, m3", f"{np.sqrt(variance):.4f}")
    assert np.sqrt(variance) == pytest.approx(published, abs=0.005)
    if correlated:
        assert variance == pytest.approx(1.624, abs=0.005)
        assert stack.volume_m3([9.5])[0] == pytest.approx(1252.82, abs=0.005)


def test_one_ring_surveyed_twice_amplifies_no_noise():
    """Levels 0.4, 0.4002 and 1.8 m of a 2 m course carry a line, not a parabola (property)."""
    stack = shell([0, 2.0], [[0.4, 0.4002, 1.8]], lambda z: 6.5)
    assert stack.courses[0].degree == 1
    evenly = shell([0, 2.0], [[0.2254, 1.0, 1.7746]], lambda z: 6.5)
    assert evenly.courses[0].degree == 2


def test_a_wrong_scale_of_the_survey_leaves_the_plates_alone():
    """dV/ds = integral of 2 r (r - t), closed form for a cylinder."""
    stack = shell([0, 9.5], [[4.0]], lambda z: 6.5, inset_m=0.008)
    expected = 2 * np.pi * 6.5 * (6.5 - 0.008) * 9.5
    assert stack.by_scale_m3([9.5])[0] == pytest.approx(expected, rel=1e-12)
