"""The conventions of the publications, each into each other: exact, or with the error stated."""

import csv
import itertools

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.camera.formats.frame import (
    frame_points,
    linearise_fit,
    make_framed_camera,
    pixels_to_mm,
    project_rays,
    trace_rays,
)
from tankcal.camera.formats.published import (
    PUBLISHED,
    USUAL,
    convert_camera,
    propagate_by_differences,
)
from tankcal.camera.model import AFFINITIES, CONVENTIONS, Form
from tankcal.errors import SolutionError

SAME_PX = 1e-9
SIZE, PIXEL = (4608, 3456), 6.17219 / 4608
GIVEN = np.array(
    [4.38, 0.06, 0.04, -1.8e-3, 3e-5, 6e-7, 0, 8e-4, 6e-4, 1e-3, 1e-5, 8e-5, 0.0]
)  # the size of P tables 6-9
PLACES = frame_points(SIZE, (31, 23))


def written_out(xy, q, affinity, balance):
    """Distortion (n, 2): Silva 40-47 and 58, Pessoa 3-6, term by term."""
    (x, y), e = xy.T, balance**2
    r2 = x**2 + y**2
    radial = sum(q[2 + i] * (r2**i - e**i) for i in range(1, 5))
    more = 1 + q[9] * r2 + q[10] * r2**2
    a, b = q[11:]
    dx, dy = {
        "both_y": (a * y, b * y),
        "both_x": (a * x, b * x),
        "b1_b2": (a * x + b * y, 0 * x),
        "before_distortion": (0 * x, 0 * x),
    }[affinity]
    dx = dx + x * radial + (q[7] * (r2 + 2 * x**2) + 2 * q[8] * x * y) * more
    dy = dy + y * radial + (q[8] * (r2 + 2 * y**2) + 2 * q[7] * x * y) * more
    return np.column_stack([dx, dy])


def misclosure_px(seen_px, rays, q, form):
    """(n,) by how much the published equation of a camera fails, as a distance in pixels."""
    measured = pixels_to_mm(seen_px, PIXEL, SIZE) - q[1:3]
    if form.affinity == "before_distortion":
        measured[:, 0] += q[11:] @ measured.T
    ideal = rays * q[0]
    if form.convention == "distortion_of_ideal":
        off = ideal + written_out(ideal, q, form.affinity, form.radial_balance_mm) - measured
    else:
        sign = 1 if form.convention == "correction_added" else -1
        correction = written_out(measured, q, form.affinity, form.radial_balance_mm)
        off = measured + sign * correction - ideal
    return np.hypot(*off.T) / PIXEL


FORMS = [Form(*both) for both in itertools.product(CONVENTIONS, AFFINITIES)]
FORMS += [Form(one, "b1_b2", 2.0) for one in CONVENTIONS]


@pytest.mark.slow
@pytest.mark.parametrize("to_form", FORMS, ids=str)
def test_every_form_into_every_other(to_form):
    """Published equations, written out: exact within 1e-9 px, else the error is the one stated."""
    for form in FORMS:
        q = np.array(GIVEN)
        if form.affinity != "both_x" and to_form.affinity != "both_x":
            q[12] = -2e-4
        rays = trace_rays(make_framed_camera(q, form, PIXEL, SIZE), PLACES)
        assert misclosure_px(PLACES, rays, q, form).max() < SAME_PX
        found = convert_camera(q, form, to_form, SIZE, PIXEL)
        off = misclosure_px(PLACES, rays, found.interior, to_form)
        assert found.form == to_form
        is_side = [CONVENTIONS[one.convention] != 0 for one in (form, to_form)]
        needs_turn = to_form.affinity == "both_x" and form.affinity == "both_y"
        moves = {one.affinity == "before_distortion" for one in (form, to_form)}
        is_same = is_side[0] == is_side[1] and len(moves) == 1
        assert found.is_exact == (is_same and not needs_turn)
        if found.is_exact:
            assert off.max() < SAME_PX
            back = convert_camera(found.interior, to_form, form, SIZE, PIXEL)
            seen = project_rays(make_framed_camera(back.interior, form, PIXEL, SIZE), rays)
            assert np.abs(seen - PLACES).max() < SAME_PX
        else:
            assert 0.7 * found.error_px < off.max() < 1.3 * found.error_px + SAME_PX
            assert found.rms_px < found.error_px


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("form", FORMS, ids=str)
def test_derivatives_of_the_fit(form):
    """Finite differences: by 13 parameters, scale and skew after the distortion, and a turn."""
    rays = np.random.default_rng(1).uniform(-0.6, 0.6, (4, 2))
    values = np.array([*GIVEN[:12], 2e-4, 1e-3, -2e-3, 3e-3])
    size = np.array([1, 1, 1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-1, 1e-1, 10, 1, 1, 1, 1, 1, 1])
    pixel = np.array([PIXEL, 1.1 * PIXEL])

    def off(scaled):
        return linearise_fit(scaled * size, rays, np.zeros((4, 2)), pixel, form)[0]

    jacobian = linearise_fit(values, rays, np.zeros((4, 2)), pixel, form)[1]
    assert_derivative(off, values / size, jacobian * size)


def test_silva_and_pessoa_differ_by_a_sign_and_the_affinity():
    """Closed form: without affinity the one is the other with K and P turned round."""
    q = np.array([*GIVEN[:11], 0, 0])
    found = convert_camera(q, PUBLISHED["silva"], PUBLISHED["pessoa"], SIZE, PIXEL)
    assert found.is_exact
    assert found.interior == pytest.approx([*q[:3], *-q[3:9], *q[9:11], 0, 0], rel=1e-14)


def test_a_linear_camera_is_inverted_exactly():
    """Property: with an affinity alone the fit finds the inverse matrix, in every convention."""
    q = np.array([100, 0.3, -0.2, *[0] * 8, 2e-3, -1e-3])
    for one in CONVENTIONS:
        for other in CONVENTIONS:
            found = convert_camera(
                q, Form(one, "both_y"), Form(other, "b1_b2"), (9000, 6500), 0.02, may_turn=True
            )
            assert found.error_px < SAME_PX
            assert found.interior[3:11] == pytest.approx(np.zeros(8), abs=1e-12)


def seven(shared):
    """{set: (13,)} of P tables 6-9; f of set 1 as mended (facts/README)."""
    with (shared / "facts" / "pessoa_T06_T09_iop.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    keys = ("f", "x0", "y0", "K1", "K2", "K3", "", "P1", "P2", "", "", "A", "B")
    sets = {row["set"]: np.array([float(row[k]) if k else 0.0 for k in keys]) for row in rows}
    sets["1"][0] = 4.3816
    return sets


@pytest.mark.slow
def test_the_published_calibrations_as_the_plain_form(shared, figure):
    """Published: P tables 6-9; what the inverse of a polynomial leaves, and what a turn takes."""
    for name, q in seven(shared).items():
        form = PUBLISHED["pessoa"]
        rays = trace_rays(make_framed_camera(q, form, PIXEL, SIZE), PLACES)
        for to_name, bound in (("plain", 2.0), ("silva", 0.8)):
            kept = convert_camera(q, form, PUBLISHED[to_name], SIZE, PIXEL)
            turned = convert_camera(q, form, PUBLISHED[to_name], SIZE, PIXEL, may_turn=True)
            figure(
                f"P set {name} as {to_name}: largest, rms, largest after a turn",
                f"{kept.error_px:.3f} px, {kept.rms_px:.3f} px, {turned.error_px:.3f} px",
            )
            assert kept.turn_rad == 0
            assert turned.rms_px < kept.rms_px
            assert kept.error_px < bound
            off = misclosure_px(PLACES, rays, kept.interior, kept.form)
            assert off.max() < 1.1 * kept.error_px
            assert abs(turned.turn_rad) < 5e-4
        assert turned.error_px < 0.02  # as Silva's: B turns the image, the exterior takes it
        usual = convert_camera(q, form, Form(), SIZE, PIXEL)
        finer = convert_camera(q, form, Form(), SIZE, PIXEL, used=(*USUAL, "K4", "P3", "P4"))
        assert finer.rms_px <= usual.rms_px


def test_only_used_parameters_differ_from_zero():
    """Property: `used` names what may differ from 0, in a formula and in a fit."""
    few = ("c", "x0", "y0", "K1", "P1", "P2")
    for convention in CONVENTIONS:
        found = convert_camera(
            GIVEN, Form("correction_added", "both_y"), Form(convention), SIZE, PIXEL, few
        )
        assert not np.any(found.interior[[4, 5, 6, 9, 10, 11, 12]])
        assert np.all(found.interior[[3, 7, 8]])
        assert not found.is_exact


def test_covariance_of_a_change_of_sign_and_of_balance():
    """Closed form: a sign changes correlations only; c' = c (1 - K1 R0^2) of one K alone."""
    rng = np.random.default_rng(3)
    sd = np.array([1e-3, 4e-4, 4e-4, 7e-5, 1.5e-5, 1e-6, 0, 7e-6, 7e-6, 0, 0, 2e-5, 2e-5])
    root = rng.normal(size=(13, 13)) * sd[:, None]
    covariance = root @ root.T
    q = np.array([*GIVEN[:9], 0, 0, *GIVEN[11:]])
    found = convert_camera(
        q, Form("correction_added"), Form("correction_subtracted"), SIZE, PIXEL, None, covariance
    )
    signs = np.array([1, 1, 1, -1, -1, -1, -1, -1, -1, 1, 1, -1, -1])
    assert found.covariance == pytest.approx(
        covariance * np.outer(signs, signs), rel=1e-6, abs=1e-30
    )
    simple, radius = np.array([4.38, 0, 0, -1.8e-3, *[0] * 9]), 2.0
    variance = np.zeros((13, 13))
    variance[:4, :4] = covariance[:4, :4]
    found = convert_camera(
        simple, Form(), Form(radial_balance_mm=radius), SIZE, PIXEL, None, variance
    )
    c, k1 = simple[[0, 3]]
    e = radius**2
    # x = c X (1 + K1 c2 X2) = c' X (1 + K1' (c'2 X2 - e)): with s = 1 - K1' e, c' s = c,
    # K1' c'^3 = K1 c^3; so K1' = K1 s^3, which is solved for s and differentiated
    s = 1.0
    for _ in range(60):
        s = 1 - k1 * s**3 * e
    slope = -(s**3) * e / (1 + 3 * k1 * s**2 * e)
    jacobian = np.array([[1 / s, -c / s**2 * slope], [0, s**3 + 3 * k1 * s**2 * slope]])
    assert found.interior[[0, 3]] == pytest.approx([c / s, k1 * s**3], rel=1e-12)
    block = covariance[np.ix_([0, 3], [0, 3])]
    assert found.covariance[np.ix_([0, 3], [0, 3])] == pytest.approx(
        jacobian @ block @ jacobian.T, rel=1e-5
    )


@pytest.mark.slow
def test_covariance_of_a_fit_is_that_of_drawn_cameras():
    """Simulation: 100 drawn cameras, each converted; sds within four of their own."""
    rng = np.random.default_rng(5)
    q = np.array([4.38, 0.06, 0.04, -1.8e-3, 3e-5, 0, 0, 8e-4, 6e-4, 0, 0, 0, 0])
    sd = np.array([1e-3, 4e-4, 4e-4, 7e-5, 1.5e-5, 0, 0, 7e-6, 7e-6, 0, 0, 0, 0])
    used = ("c", "x0", "y0", "K1", "K2", "P1", "P2")
    form = Form("correction_subtracted")
    found = convert_camera(q, form, Form(), (900, 700), 0.007, used, np.diag(sd**2))
    drawn = [
        convert_camera(q + sd * rng.normal(size=13), form, Form(), (900, 700), 0.007, used).interior
        for _ in range(100)
    ]
    ratio = np.std(drawn, axis=0)[sd > 0] / np.sqrt(np.diag(found.covariance))[sd > 0]
    assert np.abs(ratio - 1).max() < 4 / np.sqrt(200)


def test_impossible_covariance_is_reported():
    for bad in (
        np.zeros((3, 3)),
        np.full((13, 13), np.nan),
        -np.eye(13),
        np.triu(np.ones((13, 13))),
    ):
        with pytest.raises(SolutionError, match="covariance"):
            propagate_by_differences(lambda values: values, GIVEN, bad)


AS_DBAT = {  # px, py from the corner, mm; sds; reports of 14 January 2020, see below
    3: [7.457, 3.61546, 2.61329, 0.00458861, -4.51351e-5, -2.05253e-6, -6.12803e-5, -4.41172e-5],
    4: [7.45702, 3.61547, 2.61338, 0.00458999, -4.49945e-5, -2.06309e-6, -6.12476e-5, -4.42232e-5],
}
AS_ASPECT, SD_OF_ASPECT = {3: 0.000389598, 4: 0.000399377}, 2.09e-5
DBAT_SIZE, DBAT_PIXEL = (2272, 1704), 0.0031911


def of_dbat(number):
    """(13,) of a report: y upwards, from the middle."""
    c, px, py, k1, k2, k3, p1, p2 = AS_DBAT[number]
    middle = np.array(DBAT_SIZE) / 2 * DBAT_PIXEL
    x0, y0 = px - middle[0], middle[1] - py
    return np.array([c, x0, y0, k1, k2, k3, 0, p1, -p2, 0, 0, AS_ASPECT[number], 0])


def test_published_affinity_before_and_after_the_distortion(figure):
    """Published: DBAT adjusted one calibration with as before the distortion (its model 3) and
    after it (4). The first converted is the second, within a small part of its sd.

    N. Boerlin & P. Grussenmeyer, Damped Bundle Adjustment Toolbox (copyright 2013-2019 the
    authors), data/dbat/dbatexports, camcal-dbatreport-model3.txt and -model4.txt.
    """
    after = Form("correction_added", "b1_b2")
    found = convert_camera(of_dbat(3), PUBLISHED["dbat"], after, DBAT_SIZE, DBAT_PIXEL)
    as_after = found.interior[11]
    told = f"{as_after:.6e} for {AS_ASPECT[4]:.6e}, {found.error_px:.4f} px"
    figure("as of DBAT's model 3 after the distortion", told)
    assert abs(as_after - AS_ASPECT[4]) < SD_OF_ASPECT
    back = convert_camera(found.interior, after, PUBLISHED["dbat"], DBAT_SIZE, DBAT_PIXEL)
    assert back.interior[11] == pytest.approx(AS_ASPECT[3], abs=0.1 * SD_OF_ASPECT)


@pytest.mark.parametrize("convention", ["correction_added", "correction_subtracted"])
def test_as_dbat_and_back_is_the_same_camera(convention):
    """Closed form: signs turn round, A and B stay; a camera without affinity has none after it."""
    given = Form(convention, "before_distortion", 2.0)
    there = convert_camera(of_dbat(3), given, PUBLISHED["dbat"], DBAT_SIZE, DBAT_PIXEL)
    assert there.is_exact
    assert there.interior[11] == AS_ASPECT[3]
    back = convert_camera(there.interior, PUBLISHED["dbat"], given, DBAT_SIZE, DBAT_PIXEL)
    assert back.interior == pytest.approx(of_dbat(3), rel=1e-12, abs=1e-20)
    plain = np.where(np.arange(13) < 11, of_dbat(3), 0.0)
    there = convert_camera(
        plain, Form(convention, "both_y"), PUBLISHED["dbat"], DBAT_SIZE, DBAT_PIXEL
    )
    assert there.is_exact
    assert not there.interior[11:].any()
