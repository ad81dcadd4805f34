"""Cameras and rotations: the published formulas, other programs, singular places."""

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.camera.formats.frame import make_framed_camera
from tankcal.camera.formats.opencv import OpenCV, convert_from_opencv, convert_to_opencv
from tankcal.camera.model import (
    AFFINITIES,
    CONVENTIONS,
    Form,
    balance_about,
    correct_image_points,
    distort_image_points,
)
from tankcal.geometry.rotations import (
    angle_derivatives,
    angles_of,
    apply_small_rotation,
    rotation_of_angles,
    rotation_of_view,
    rotation_vector,
    vector_derivatives,
)

RNG = np.random.default_rng(11)
Q = np.array([100, 0.3, -0.2, 2e-6, 3e-10, -1e-14, 1e-18, 3e-6, -2e-6, 1e-5, 1e-9, 2e-3, -1e-3])
IDEAL = RNG.uniform(-60, 60, (40, 2))
PLACES = RNG.uniform(-1, 1, (2000, 2)) * [1999, 1499]  # px from the middle


def silva(x, y, q, affinity, balance):
    """The published sums, term by term: Silva 40-47 and 58, Pessoa 3-6."""
    _, _, _, k1, k2, k3, k4, p1, p2, p3, p4, a, b = q
    r2, e = x**2 + y**2, balance**2
    radial = k1 * (r2 - e) + k2 * (r2**2 - e**2) + k3 * (r2**3 - e**3) + k4 * (r2**4 - e**4)
    more = 1 + p3 * r2 + p4 * r2**2
    dx = x * radial + (p1 * (r2 + 2 * x**2) + 2 * p2 * x * y) * more
    dy = y * radial + (p2 * (r2 + 2 * y**2) + 2 * p1 * x * y) * more
    ax, ay = {
        "both_y": (a * y, b * y),
        "both_x": (a * x, b * x),
        "b1_b2": (a * x + b * y, 0),
        "before_distortion": (0, 0),
    }[affinity]
    return np.column_stack([dx + ax, dy + ay])


@pytest.mark.parametrize("balance", [0.0, 40.0])
@pytest.mark.parametrize("affinity", AFFINITIES)
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_conventions_agree_with_their_sources(convention, affinity, balance):
    """Published: the equations of Silva 39, Pessoa 10 and the distortion of the ideal point."""
    form = Form(convention, affinity, balance)
    found = distort_image_points(IDEAL, Q, form)
    x, y = (found - Q[1:3]).T
    if affinity == "before_distortion":  # DBAT, res_euler_brown_1
        x = (1 + Q[11]) * x + Q[12] * y
    if convention == "distortion_of_ideal":
        expected = IDEAL + silva(*IDEAL.T, Q, affinity, balance)
        assert np.column_stack([x, y]) == pytest.approx(expected, abs=1e-12)
    else:
        sign = 1 if convention == "correction_added" else -1
        ideal = np.column_stack([x, y]) + sign * silva(x, y, Q, affinity, balance)
        assert ideal == pytest.approx(IDEAL, abs=1e-11)
    assert correct_image_points(found, Q, form) == pytest.approx(IDEAL, abs=1e-11)


def test_an_affinity_before_the_distortion(figure):
    """Published (DBAT): A = [1 + as, sk; 0, 1] times the measured point, then distortion; back."""
    c, x0, y0, k1, aspect, skew = 24.0, 0.15, -0.1, 2e-4, 4e-2, -3e-2
    q = np.array([c, x0, y0, k1, *[0] * 7, aspect, skew])
    u, v = RNG.uniform(-12, 12, (2, 50))
    x, y = np.array([[1 + aspect, skew], [0, 1]]) @ [u - x0, v - y0]
    ideal = np.column_stack([x, y]) * (1 + k1 * (x * x + y * y))[:, None]
    form = Form("correction_added", "before_distortion")
    seen = np.column_stack([u, v])
    assert correct_image_points(seen, q, form) == pytest.approx(ideal, abs=1e-13)
    worst = np.abs(distort_image_points(ideal, q, form) - seen).max()
    figure("affinity before the distortion, back from the ideal point", f"{worst:.1e} mm")
    assert worst < 1e-12
    away = np.abs(distort_image_points(ideal, q, Form("correction_added", "b1_b2")) - seen).max()
    assert away > 1e-3  # of a sum of terms A and B are not the same


def test_added_and_subtracted_conventions_differ_in_sign():
    other = np.concatenate([Q[:3], -Q[3:9], Q[9:11], -Q[11:]])
    added = distort_image_points(IDEAL, Q, Form("correction_added"))
    assert distort_image_points(IDEAL, other, Form("correction_subtracted")) == pytest.approx(
        added, abs=1e-12
    )


@pytest.mark.parametrize("ratio", [1.0, 1.003])
def test_opencv_camera(ratio):
    """Closed form: OpenCV's published model, pixels, y downwards, fx and fy alike or not."""
    fx, fy, cx, cy = ratio * 3000.0, 3000.0, 2010.0, 1490.0
    k1, k2, p1, p2, k3 = -0.12, 0.08, 4e-4, -3e-4, 0.02
    x, y = RNG.uniform(-0.5, 0.5, (2, 30))
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
    v = fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy
    pixel, size = 0.005, (4000, 3000)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    camera = convert_from_opencv(OpenCV(matrix, np.array([k1, k2, p1, p2, k3])), pixel, size)
    q, sides = camera.interior, camera.pixel_mm
    found = distort_image_points(q[0] * np.column_stack([x, -y]), q, Form())
    expected = np.column_stack([u - (size[0] - 1) / 2, -(v - (size[1] - 1) / 2)]) * sides
    assert found == pytest.approx(expected, abs=1e-11)
    assert sides == pytest.approx([pixel * fy / fx, pixel])
    back = convert_to_opencv(camera)
    assert back.matrix == pytest.approx(matrix, rel=1e-10)
    assert back.coefficients == pytest.approx([k1, k2, p1, p2, k3], abs=1e-9)
    assert back.error_px < 1e-9


def test_conversion_to_opencv_states_its_error(figure):
    """Second method: OpenCV's published model at the points; the error is the one stated."""
    size, pixel = (4000, 3000), 0.005
    q = np.array([15.0, 0.02, -0.01, -5e-4, 1e-6, 0, 0, 1e-5, -2e-5, 0, 0, 2e-4, 1e-4])
    for convention in CONVENTIONS:
        form = Form(convention, "b1_b2", 6.0)
        found = convert_to_opencv(make_framed_camera(q, form, pixel, size))
        x, y = (correct_image_points(PLACES * pixel, q, form) / q[0] * [1, -1]).T
        k1, k2, p1, p2, k3 = found.coefficients
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        seen = np.column_stack([u, v, np.ones_like(u)]) @ found.matrix.T
        expected = PLACES * [1, -1] + [1999.5, 1499.5]
        worst = np.abs(seen[:, :2] - expected).max()
        figure(f"{convention} as OpenCV's, over the frame", f"{found.error_px:.2e} px")
        assert 0.3 * found.error_px < worst < 1.05 * found.error_px


def test_conventions_round_trip_over_the_frame(figure):
    """Property: measured to ideal and back, all forms, within 1e-9 px of 5 um, 24 x 36 mm."""
    pixel, worst = 0.005, 0.0
    q = np.array([35, 0.1, -0.1, 5e-5, -3e-8, 1e-11, 0, 1e-5, -2e-5, 1e-5, 1e-9, 1e-3, -5e-4])
    grid = np.column_stack([a.ravel() for a in np.meshgrid(np.linspace(-18, 18, 31),
                                                            np.linspace(-12, 12, 21))])  # fmt: skip
    for convention in CONVENTIONS:
        for affinity in AFFINITIES:
            for balance in (0.0, 12.0):
                form = Form(convention, affinity, balance)
                back = distort_image_points(correct_image_points(grid, q, form), q, form)
                worst = max(worst, np.abs(back - grid).max() / pixel)
    figure("round trip through all conventions", f"{worst:.1e} px")
    assert worst < 1e-9


@pytest.mark.parametrize("affinity", AFFINITIES)
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_balanced_form_both_ways(convention, affinity):
    """Property: the same image points, from plain to balanced (Zeiss, AICON), to another, back."""
    points = np.column_stack([IDEAL, np.full(len(IDEAL), 100.0)]) / 100
    q, form = Q, Form(convention, affinity, 0.0)
    expected = distort_image_points(q[0] * points[:, :2], q, form)
    for radius in (40.0, 25.0, 0.0):
        q, form = balance_about(q, form, radius)
        assert form.radial_balance_mm == radius
        assert distort_image_points(q[0] * points[:, :2], q, form) == pytest.approx(
            expected, abs=1e-11
        )
    assert q == pytest.approx(Q, rel=1e-12)


def test_pixels_that_are_not_square():
    """Closed form: no distortion: fx over fy is the ratio of the pixel's sides."""
    size, matrix = (4001, 3001), np.array([[3000, 0, 2000], [0, 3030, 1500], [0, 0, 1]])
    camera = convert_from_opencv(OpenCV(matrix, np.zeros(4)), 0.004, size)
    assert camera.interior[:3] == pytest.approx([12.12, 0, 0])
    assert camera.pixel_mm == pytest.approx([12.12 / 3000, 0.004])
    plain = convert_to_opencv(
        make_framed_camera([12.12, 0, 0, *[0] * 8, 1e-3, 0], Form(), 0.004, size)
    )
    assert plain.matrix[0, 0] == pytest.approx(3030 * 1.001)
    assert plain.error_px < 1e-9


def test_rotations_and_their_angles():
    """Property: R3 R2 R1; angles come back; the tangent step is the exponential (scipy)."""
    from scipy.spatial.transform import Rotation

    angles = RNG.uniform(-1.5, 1.5, (20, 3))
    r = rotation_of_angles(*angles.T)
    for one, (omega, phi, kappa) in zip(r, angles, strict=True):
        passive = Rotation.from_euler("xyz", [-omega, -phi, -kappa]).as_matrix()
        assert one == pytest.approx(passive, abs=1e-14)
    assert angles_of(r) == pytest.approx(angles, abs=1e-13)
    small = RNG.normal(0, 0.5, (20, 3))
    exponential = Rotation.from_rotvec(small).as_matrix()
    assert apply_small_rotation(r, small) == pytest.approx(exponential @ r, abs=1e-14)
    assert apply_small_rotation(r, 0 * small) == pytest.approx(r, abs=1e-15)
    assert rotation_vector(exponential) == pytest.approx(small, abs=1e-13)


def test_derivatives_of_angles_and_vectors():
    r = rotation_of_angles(*RNG.uniform(-1.3, 1.3, (3, 4)))
    small = RNG.normal(0, 0.6, (4, 3))
    exponential = apply_small_rotation(np.tile(np.eye(3), (4, 1, 1)), small)
    for i in range(4):
        one = slice(i, i + 1)
        assert_derivative(
            lambda d, one=one: angles_of(apply_small_rotation(r[one], d[None]))[0],
            np.zeros(3),
            angle_derivatives(r[one])[0],
        )
        assert_derivative(
            lambda d, one=one: rotation_vector(apply_small_rotation(exponential[one], d[None]))[0],
            np.zeros(3),
            vector_derivatives(small[one])[0],
        )


def test_angles_at_the_singular_place():
    """phi = +-90 deg: omega is reported as 0, and the angles still give the same rotation."""
    for sign in (1, -1):
        r = rotation_of_angles(np.array([0.4]), np.array([sign * np.pi / 2]), np.array([0.9]))
        assert rotation_of_angles(*angles_of(r).T) == pytest.approx(r, abs=1e-12)


def test_a_camera_that_looks_north():
    """Closed form: axis along +y, x of the image to the east, y up; roll turns the image."""
    assert rotation_of_view(0.0, 0.0, 0.0) == pytest.approx(
        np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    )
    east = rotation_of_view(np.pi / 2, 0.0, np.pi / 2)
    assert east == pytest.approx(np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]), abs=1e-15)
