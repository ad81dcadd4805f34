"""Cameras of other programs: each against its documented equations, and there and back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tankcal.camera.formats import balanced, opencv, photogrammetry
from tankcal.camera.formats.frame import frame_points, make_framed_camera, project_rays, trace_rays
from tankcal.camera.formats.opencv import (
    OpenCV,
    convert_from_opencv,
    convert_to_opencv,
    distort_rays,
)
from tankcal.camera.model import Form
from tankcal.errors import SolutionError

SAME_PX = 1e-9
SIZE, PIXEL = (4608, 3456), 0.00134
QUICK = settings(max_examples=25)


def parts(low, high, count):
    """Numbers that scale a term by its effect at the corner of the frame."""
    return st.lists(st.floats(low, high), min_size=count, max_size=count)


@st.composite
def documented(draw):
    """(size, f, cx, cy, k (4,), p (2,)): px, the effect of each term at the corner bounded."""
    size = draw(st.integers(640, 9000)), draw(st.integers(480, 7000))
    f = draw(st.floats(0.6, 3.0)) * max(size)
    corner = np.hypot(*size) / 2 / f
    cx, cy = (n / 2 * (1 + draw(st.floats(-0.03, 0.03))) for n in size)
    k = np.array(draw(parts(-0.05, 0.05, 4))) / corner ** (2 * np.arange(1, 5)) * [1, 0.5, 0.2, 0.1]
    p = np.array(draw(parts(-2e-3, 2e-3, 2))) / corner
    return size, f, cx, cy, k, p


def brown(rays, k, p1, p2):
    """x', y' of the published model (OpenCV's order), y downwards: written out term by term."""
    x, y = rays[:, 0], -rays[:, 1]
    r2 = x**2 + y**2
    radial = 1 + sum(one * r2**i for i, one in enumerate(k, 1))
    along = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    return along, y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y


def off_px(u, v, size):
    """Largest distance from the points of the grid, columns and lines."""
    return np.hypot(*(np.column_stack([u, v]) - frame_points(size)).T).max()


@pytest.mark.slow
@QUICK
@given(documented(), st.floats(0.9, 1.1))
def test_opencv_as_documented(camera, ratio):
    """Published: OpenCV's equations over 46 x 35 points; there and back within 1e-9 px."""
    size, f, cx, cy, k, p = camera
    matrix = np.array([[f * ratio, 0, cx], [0, f, cy], [0, 0, 1]])
    own = convert_from_opencv(OpenCV(matrix, np.array([k[0], k[1], *p, k[2]])), 0.004, size)
    rays = trace_rays(own, frame_points(size))
    along, down = brown(rays, k[:3], *p)
    assert off_px(f * ratio * along + cx, f * down + cy, size) < SAME_PX
    again = convert_from_opencv(convert_to_opencv(own), 0.004, size)
    assert np.abs(project_rays(again, rays) - frame_points(size)).max() < SAME_PX
    assert own.error_px < SAME_PX
    assert convert_to_opencv(own).error_px < SAME_PX


RATIONAL = [-0.31, 0.12, 4e-4, -3e-4, -0.01, -0.02, 0.03, 0.004]
LONG = {
    8: RATIONAL,
    12: [*RATIONAL, 3e-4, -1e-4, 2e-4, 1e-4],
    14: [*RATIONAL, 3e-4, -1e-4, 2e-4, 1e-4, 0.01, -0.02],
}


@pytest.mark.parametrize("count", [4, 5, *LONG])
def test_opencv_projects_the_same(count, figure):
    """Second method: cv2.projectPoints, of all lengths of the coefficients."""
    cv2 = pytest.importorskip("cv2")
    matrix = np.array([[3300.0, 0, 2290], [0, 3320, 1750], [0, 0, 1]])
    k = np.array(LONG.get(count, [-0.03, 0.02, 5e-4, -4e-4, 0.01][:count]))
    own = convert_from_opencv(OpenCV(matrix, k), PIXEL, SIZE)
    x, y = np.random.default_rng(2).uniform(-0.6, 0.6, (2, 400)) * [[1], [0.75]]
    points = np.column_stack([x, y, np.ones_like(x)])
    seen = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, k)[0][:, 0]
    full = np.zeros(14)
    full[:count] = k
    plane = np.column_stack(distort_rays(x, y, full)) * [3300, 3320] + [2290, 1750]
    assert np.abs(plane - seen).max() < SAME_PX
    off = np.hypot(*(project_rays(own, np.column_stack([x, -y])) - seen).T)
    inside = np.all((seen >= 0) & (seen <= np.array(SIZE) - 1), axis=1)
    figure(f"OpenCV's {count} coefficients as tankcal's, over the frame", f"{own.error_px:.1e} px")
    assert off[inside].max() <= max(1.02 * own.error_px, SAME_PX)
    assert (own.error_px < SAME_PX) == (count <= 5)


@pytest.mark.slow
@QUICK
@given(documented(), st.sampled_from(list(opencv.COLMAP_MODELS)))
def test_colmap_as_documented(camera, model):
    """Published: COLMAP's models over the frame; the centre of the first pixel is 0.5, 0.5."""
    size, f, cx, cy, k, p = camera
    values = {"f": f, "fx": 1.01 * f, "fy": f, "cx": cx, "cy": cy, "p1": p[0], "p2": p[1]}
    values |= {"k1": k[0], "k2": k[1], "k3": k[2], "k4": 0.0, "k5": 0.0, "k6": 0.0}
    names = opencv.COLMAP_MODELS[model]
    given_ = opencv.Colmap(model, size, tuple(float(values[name]) for name in names))
    own = opencv.convert_from_colmap(given_, 0.005)
    rays = trace_rays(own, frame_points(size))
    has = {name: values[name] if name in names else 0.0 for name in values}
    along, down = brown(rays, (has["k1"], has["k2"], has["k3"]), has["p1"], has["p2"])
    u, v = (has["fx"] or f) * along + cx, f * down + cy
    assert off_px(u - 0.5, v - 0.5, size) < SAME_PX
    back = opencv.convert_to_colmap(own, model)
    assert back.error_px < SAME_PX
    again = opencv.convert_from_colmap(back, 0.005)
    assert np.abs(project_rays(again, rays) - frame_points(size)).max() < SAME_PX
    simplest = opencv.convert_to_colmap(own)
    assert simplest.error_px < SAME_PX
    assert len(simplest.params) <= len(names)


def test_colmap_rational():
    """Second method: the rational model of FULL_OPENCV is that of OpenCV, half a pixel apart."""
    k = LONG[8]
    params = (3300.0, 3320.0, 2290.5, 1750.5, *k)
    of_colmap = opencv.convert_from_colmap(opencv.Colmap("FULL_OPENCV", SIZE, params), PIXEL)
    matrix = np.array([[3300.0, 0, 2290], [0, 3320, 1750], [0, 0, 1]])
    of_opencv = convert_from_opencv(OpenCV(matrix, np.array(k)), PIXEL, SIZE)
    assert of_colmap.interior == pytest.approx(of_opencv.interior, rel=1e-12)


def metashape_image(rays, camera):
    """u, v of the manual's appendix, term by term."""
    x, y = rays[:, 0], -rays[:, 1]
    r2 = x**2 + y**2
    k1, k2, k3, k4 = camera.k
    p1, p2, p3, p4 = camera.p
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3 + k4 * r2**4
    more = 1 + p3 * r2 + p4 * r2**2
    xs = x * radial + (p1 * (r2 + 2 * x**2) + 2 * p2 * x * y) * more
    ys = y * radial + (p2 * (r2 + 2 * y**2) + 2 * p1 * x * y) * more
    width, height = camera.size_px
    u = width * 0.5 + camera.cx + xs * camera.f + xs * camera.b1 + ys * camera.b2
    return u, height * 0.5 + camera.cy + ys * camera.f


@pytest.mark.slow
@QUICK
@given(documented(), st.floats(-0.003, 0.003), parts(-0.5, 0.5, 2))
def test_metashape_as_documented(camera, affinity, more):
    """Published: Metashape's equations over the frame, exact with B1; corner of a pixel is 0."""
    size, f, cx, cy, k, p = camera
    corner2 = (np.hypot(*size) / 2 / f) ** 2
    p34 = np.array(more) / [corner2, corner2**2]
    offset = (cx - size[0] / 2, cy - size[1] / 2)
    given_ = photogrammetry.Metashape(size, f, *offset, affinity * f, 0.0, tuple(k), (*p, *p34))
    own = photogrammetry.convert_from_metashape(given_, 0.003)
    rays = trace_rays(own, frame_points(size))
    u, v = metashape_image(rays, given_)
    assert off_px(u - 0.5, v - 0.5, size) < SAME_PX
    back = photogrammetry.convert_to_metashape(own)
    assert back.error_px < SAME_PX
    u, v = metashape_image(rays, back)
    assert off_px(u - 0.5, v - 0.5, size) < SAME_PX
    assert back.p[:2] == pytest.approx(given_.p[:2], rel=1e-9)


def test_metashape_skew_states_its_error(figure):
    """Second method: B2 acts after the distortion; the error of A and B for it is as stated."""
    given_ = photogrammetry.Metashape(
        SIZE, 3300.0, -20, 15, 1.5, 4.0, (-0.1, 0.05, 0, 0), (1e-3, 0, 0, 0)
    )
    own = photogrammetry.convert_from_metashape(given_, PIXEL)
    finer = frame_points(SIZE, (93, 71))
    u, v = metashape_image(trace_rays(own, finer), given_)
    off = np.hypot(u - 0.5 - finer[:, 0], v - 0.5 - finer[:, 1]).max()
    figure("Metashape's B2 of 4 px as A and B, over the frame", f"{own.error_px:.1e} px")
    assert 1e-3 < own.error_px < 0.2
    assert off == pytest.approx(own.error_px, rel=0.05)
    straight = photogrammetry.convert_from_metashape(
        replace(given_, k=(0, 0, 0, 0), p=(0, 0, 0, 0)), PIXEL
    )
    assert straight.error_px < SAME_PX  # without distortion B2 is an affinity like any other
    back = photogrammetry.convert_to_metashape(straight)
    assert (back.b1, back.b2, back.error_px) == pytest.approx((1.5, 4.0, 0), abs=1e-7)


@pytest.mark.slow
@QUICK
@given(documented())
def test_pix4d_as_documented(camera):
    """Published: Pix4D's equations over the frame, mm from the upper left corner."""
    size, f, cx, cy, k, p = camera
    pixel = 0.0024
    sensor = (size[0] * pixel, size[1] * pixel)
    given_ = photogrammetry.Pix4D(sensor, f * pixel, cx * pixel, cy * pixel, tuple(k[:3]), tuple(p))
    own = photogrammetry.convert_from_pix4d(given_, size)
    rays = trace_rays(own, frame_points(size))
    along, down = brown(rays, k[:3], *p)
    u, v = cx + f * along, cy + f * down
    assert off_px(u - 0.5, v - 0.5, size) < SAME_PX
    back = photogrammetry.convert_to_pix4d(own)
    assert back.error_px < SAME_PX
    assert back.t == pytest.approx(given_.t, rel=1e-9, abs=1e-15)
    assert (back.px_mm, back.py_mm) == pytest.approx((given_.px_mm, given_.py_mm), rel=1e-12)


# published: P frame 1 (the manufacturer's calibration, Pix4D's form), P table 6 set 2 (his own)
FRAME_1 = photogrammetry.Pix4D(
    (6.17219, 4.62914),
    4.38311,
    3.15437,
    2.27623,
    (-0.0409479, 0.038169, -0.0188473),
    (-0.0024411, 0.0038236),
)
SET_2 = [4.383, 0.0625, 0.0434, -0.001776504, 3.448238e-05, 5.623659e-07, 0]
SET_2 += [0.0008462448, 0.0006382, 0, 0, 7.933755e-05, 2.264641e-05]


def test_published_pix4d_camera_agrees_with_pessoa(figure):
    """Published: P frame 1 and table 6 are one camera: only these signs of T1, T2 and y agree."""
    points, pixel = frame_points(SIZE), 6.17219 / SIZE[0]
    own = make_framed_camera(SET_2, Form("correction_subtracted", "both_x"), pixel, SIZE)
    rms = {}
    for s1 in (1, -1):
        for s2 in (1, -1):
            t1, t2 = FRAME_1.t
            other = photogrammetry.convert_from_pix4d(replace(FRAME_1, t=(s1 * t1, s2 * t2)), SIZE)
            apart = (trace_rays(own, points) - trace_rays(other, points)) * own.interior[0] / pixel
            rms[s1, s2] = np.sqrt(np.mean(np.sum(apart**2, axis=1)))
    figure("P frame 1 against P table 6 set 2, rms", f"{rms[1, 1]:.1f} px")
    assert rms[1, 1] < 10
    assert min(value for signs, value in rms.items() if signs != (1, 1)) > 2 * rms[1, 1]
    found = photogrammetry.convert_from_pix4d(FRAME_1, SIZE).interior
    assert found[1:3] == pytest.approx([0.0683, 0.0383], abs=5e-5)
    assert found[7:9] == pytest.approx(SET_2[7:9], rel=0.15)


def aicon_image(rays, values):
    """x, y in mm as the balanced form has them, term by term; Ck is negative."""
    x, y = -values["Ck"] * rays.T
    r2, e = x**2 + y**2, values["R0"] ** 2
    radial = sum(values[f"A{i}"] * (r2**i - e**i) for i in (1, 2, 3))
    b1, b2, c1, c2 = (values[key] for key in ("B1", "B2", "C1", "C2"))
    dx = x * radial + b1 * (r2 + 2 * x**2) + 2 * b2 * x * y + c1 * x + c2 * y
    dy = y * radial + b2 * (r2 + 2 * y**2) + 2 * b1 * x * y
    return values["Xh"] + x + dx, values["Yh"] + y + dy


@pytest.mark.slow
def test_balanced_form_of_aicon():
    """Published: the balanced form, from plain and back, another R0, the sign of Ck."""
    plain = np.array([24.1, 0.1, -0.05, -1e-4, 1.2e-7, -3e-11, 0, 4e-6, -3e-6, 0, 0, 1e-4, -5e-5])
    own = make_framed_camera(plain, Form(), 0.006, (6000, 4000))
    points = frame_points(own.size_px)
    rays = trace_rays(own, points)
    for radius in (0.0, 12.0, 14.5):
        found = balanced.convert_to_balanced(own, radius)
        assert found.values["Ck"] < 0
        assert found.error_px < SAME_PX
        x, y = aicon_image(rays, found.values)
        assert off_px(x / 0.006 + 2999.5, -y / 0.006 + 1999.5, own.size_px) < SAME_PX
        back = balanced.convert_from_balanced(found, 0.006, own.size_px)
        assert np.abs(project_rays(back, rays) - points).max() < SAME_PX
        again = balanced.convert_to_balanced(back, 0.0)
        assert [again.values[key] for key in balanced.KEYS] == pytest.approx(
            [balanced.convert_to_balanced(own, 0.0).values[key] for key in balanced.KEYS], rel=1e-11
        )


def test_balanced_form_leaves_out_k4_and_carries_sds():
    """Property: K4 is fitted by A1..A3; Ck and Xh keep sds that nothing else is in."""
    own = make_framed_camera(
        [24.1, 0, 0, -1e-4, 0, 0, 1e-12, 0, 0, 0, 0, 0, 0], Form(), 0.006, (6000, 4000)
    )
    assert 0.01 < balanced.convert_to_balanced(own, 12.0).error_px < 30
    variance = np.zeros(13)
    variance[:4] = np.array([3e-3, 1e-3, 2e-3, 1e-7]) ** 2
    simple = make_framed_camera([*own.interior[:6], *np.zeros(7)], Form(), 0.006, (6000, 4000))
    found = balanced.convert_to_balanced(simple, 12.0, covariance=np.diag(variance))
    s = 1 - 1e-4 * 144  # c K1 of the plain form at R0, to the first order
    assert np.sqrt(found.covariance[1, 1]) == pytest.approx(1e-3)
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(3e-3 * s, rel=0.02)


def test_a_distortion_that_folds_is_reported():
    """Property: barrel distortion that turns back within the frame has no rays there."""
    matrix = np.array([[2000.0, 0, 2000], [0, 2000, 1500], [0, 0, 1]])
    with pytest.raises(SolutionError, match="folds the image at column"):
        convert_from_opencv(OpenCV(matrix, np.array([-0.4, 0, 0, 0, 0])), 0.005, (4001, 3001))
    with pytest.raises(SolutionError, match="folds the image at column"):
        convert_from_opencv(
            OpenCV(matrix, np.array([-0.4, 0, 0, 0, 0, 0.1, 0, 0])), 0.005, (4001, 3001)
        )
