"""Are two calibrations the same? Figures against closed forms, second methods, published tables."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jacobians import assert_derivative
from job_builder import write_folder
from scipy.optimize import least_squares
from survey_builder import survey_parts

from tankcal.calibration.stability.comparison import METHODS, compare
from tankcal.calibration.stability.fits import (
    DRAWN,
    TERRAINS,
    Grid,
    Terrain,
    default_grid,
    find_nearest_rotation,
    fit_resection,
    fit_rotation,
    ideal_derivatives,
    make_orientation_model,
    parse_grid,
    parse_terrain,
    rays,
)
from tankcal.camera.model import (
    AFFINITIES,
    CONVENTIONS,
    Form,
    balance_about,
    correct_image_points,
    distort_image_points,
)
from tankcal.errors import InputError, SolutionError
from tankcal.geometry.rotations import angles_of, apply_small_rotation, rotation_of_angles
from tankcal.job import load
from tankcal.job.calibrations import choose, read_cameras
from tankcal.record.camera import plain_stability, summary
from tankcal.survey.measurements import CameraSetup
from tankcal.survey.network.survey import Camera

SEVEN = Path(__file__).parents[2] / "examples" / "pessoa-2017" / "cameras.toml"
FRAME = (4608, 3456)
PIXEL_MM = np.array([0.0013, 0.0013])
# published: Pessoa table 13, sets 2 to 7 against sets 1 to row - 1; (2, 1) is printed 4.68
ZROT = [
    *(0.68, 8.20, 7.82, 6.54, 6.52, 5.20, 15.30, 15.12, 8.92, 9.50, 5.51),
    *(5.42, 8.10, 7.63, 13.86, 8.12, 7.63, 2.70, 7.16, 11.31, 9.50),
]
Q = np.array([4.4, 0.03, -0.02, -2e-3, 3e-5, 1e-6, 1e-8, 8e-4, -6e-4, 1e-4, 1e-5, 8e-4, -5e-4])
SMALL_GRID = Grid(12, 9, (100, 100), 380)
SPREAD = ("figure_px", "scatter_px")
FORMS = [Form(one, other, 2.0) for one in CONVENTIONS for other in AFFINITIES]
LENS = np.array([50.0, 0.02, -0.03, 1e-3, -2e-5, 1e-7, 0, 1e-4, -5e-5, 0, 0, 2e-4, 1e-4])


def setup(name, form=None, pixel_mm=PIXEL_MM, sd=None, **values):
    """A CameraSetup of FRAME with some parameters, the rest 0 (c 4.4 mm)."""
    order = ("c", "x0", "y0", "K1", "K2", "K3", "K4", "P1", "P2", "P3", "P4", "A", "B")
    q = np.array([values.get(one, 4.4 if one == "c" else 0.0) for one in order])
    sd = np.full(13, np.nan) if sd is None else np.asarray(sd, dtype=float)
    camera = Camera(q, form or Form("correction_subtracted", "both_x"), sd, name=name)
    return CameraSetup(camera, np.array(FRAME) * pixel_mm, np.asarray(pixel_mm, dtype=float))


def figure_of(first, second, method, **options):
    return compare([first, second], method, **options).pairs[0].figure_px


def image_of(place, rotation, c):
    """Second method: ideal image (n, 2) of (n, 3), written out anew."""
    u, v, w = rotation @ place.T
    return np.column_stack([-c * u / w, -c * v / w])


@pytest.fixture(scope="module")
def seven():
    return read_cameras(SEVEN)


# the published table, and the file it comes from


@pytest.mark.slow
def test_zrot_of_the_seven_calibrations(seven, figure):
    result = compare(seven, "zrot", as_published=True)
    error = np.array([pair.figure_px for pair in result.pairs]) - ZROT
    figure("ZROT of 21 pairs against Pessoa table 13, largest error, px", f"{abs(error).max():.3f}")
    assert np.all(np.abs(error) < 0.025)
    assert [(pair.a, pair.b) for pair in result.pairs[:4]] == [
        *(("set1", "set2"), ("set1", "set3"), ("set2", "set3"), ("set1", "set4"))
    ]
    assert sum(pair.similar for pair in result.pairs) == 0


def test_seven_calibrations_agree_with_shared_facts(shared, seven):
    facts = np.genfromtxt(shared / "facts" / "pessoa_T06_T09_iop.csv", delimiter=",", names=True)
    columns = ["f", "x0", "y0", "K1", "K2", "K3", None, "P1", "P2", None, None, "A", "B"]
    for row, one in zip(facts, seven, strict=True):
        for place, name in enumerate(columns):
            if name is None:
                assert one.camera.values[place] == 0
            elif (name, row["set"]) != ("f", 1):  # mended, see the README beside the file
                assert one.camera.values[place] == row[name]
                assert one.camera.sd[place] == row[f"s_{name}"]
    table = json.loads((shared / "facts" / "pessoa_T13_zrot.json").read_text(encoding="utf-8"))
    assert [one for row in table["T13_ZROT"] for one in row][1:] == ZROT[1:]
    assert table["grid"] == {
        "cols": 46,
        "rows": 35,
        "start": [50, 50],
        "step": 100,
        "image": [*FRAME],
    }


@pytest.mark.slow
def test_more_freedom_makes_the_figure_smaller(seven, figure):
    of = {
        name: np.array([one.figure_px for one in compare(seven, method, terrain=terrain).pairs])
        for name, method, terrain in [
            *(("zrot", "zrot", None), ("rot", "rot", None), ("spr I", "spr", TERRAINS["I"])),
            *(("spr II", "spr", TERRAINS["II"]), ("flat", "spr", Terrain(range_m=0.0))),
        ]
    }
    points = 46 * 35
    of["zrot"] *= np.sqrt(points / (2 * points - 3))  # the same measure as sigma0 of three unknowns
    for less, more in [("rot", "zrot"), ("spr I", "rot"), ("spr II", "spr I"), ("flat", "spr II")]:
        assert np.all(of[less] < 1.01 * of[more]), (less, more)
    for name, figures in of.items():
        figure(f"seven calibrations, {name}, mean figure, px", f"{figures.mean():.2f}")


def test_which_focal_length_both_bundles_get_hardly_matters(seven, figure):
    pixel = seven[0].pixel_mm
    points = default_grid(FRAME).image_points_mm(FRAME, pixel)
    first, second = (
        (correct_image_points(points, one.camera.values, one.camera.form), one.camera.values[0])
        for one in (seven[0], seven[4])
    )
    figures = [
        fit_rotation(first[0], c, second[0], c, pixel).sigma0_px
        for c in (first[1], second[1], 0.5 * (first[1] + second[1]))
    ]
    figure("ROT, both with c of the first, second, their mean: range, px", f"{np.ptp(figures):.4f}")
    assert np.ptp(figures) < 0.01
    assert figures[0] == figure_of(seven[0], seven[4], "rot", as_published=True)


@pytest.mark.slow
def test_the_seed_of_the_terrain_hardly_matters(seven, figure):
    pair = [seven[0], seven[4]]
    figures = [figure_of(*pair, "spr", seed=seed) for seed in range(8)]
    figure("SPR on terrain I by eight seeds: mean and sd, px", f"{np.mean(figures):.3f}")
    assert 0 < np.std(figures) < 0.05
    assert figure_of(*pair, "spr", seed=3) == figures[3]


@pytest.mark.slow
def test_scatter_of_spr_between_terrains(seven):
    """Simulation: means of other terrains lie as far apart as the scatter over ten says."""
    pair = [seven[0], seven[4]]
    found = [compare(pair, "spr", SMALL_GRID, seed=seed).pairs[0] for seed in range(12)]
    means, scatter = (np.array([getattr(one, key) for one in found]) for key in SPREAD)
    assert np.std(means, ddof=1) == pytest.approx(scatter.mean() / np.sqrt(DRAWN), rel=0.75)
    assert scatter.mean() > 3e-3  # three decimals of one terrain say nothing
    flat = compare(pair, "spr", SMALL_GRID, terrain=Terrain(range_m=0.0)).pairs[0]
    assert flat.scatter_px == 0  # all flat ground is the same
    assert compare(pair, "rot", SMALL_GRID).pairs[0].scatter_px is None


# closed forms


def test_a_shift_of_the_principal_point():
    """Closed form: without distortion mis and zrot are the shift itself, in pixels per axis."""
    pixel = (0.002, 0.001)
    first = setup("a", pixel_mm=pixel)
    second = setup("b", pixel_mm=pixel, x0=0.006, y0=0.004)
    for method in ("mis", "zrot"):
        for as_published in (False, True):
            found = figure_of(first, second, method, as_published=as_published)
            assert found == pytest.approx(5.0, abs=1e-9)
    pair = compare([first, second], "mis").pairs[0]
    assert pair.difference_px == pytest.approx(np.tile([-3.0, -4.0], (46 * 35, 1)))


def test_another_focal_length():
    """Closed form: mis does not see it; zrot is |c1/c2 - 1| of the radius, on the mean or rms."""
    first, second = setup("a"), setup("b", c=4.5)
    radius = np.hypot(*(default_grid(FRAME).image_points_mm(FRAME, PIXEL_MM) / PIXEL_MM).T)
    part = abs(4.4 / 4.5 - 1)
    assert figure_of(first, second, "mis") == 0
    rmse = part * np.sqrt(np.mean(radius**2))
    assert figure_of(first, second, "zrot") == pytest.approx(rmse, rel=1e-12)
    mean = part * np.mean(radius)
    assert figure_of(first, second, "zrot", as_published=True) == pytest.approx(mean, rel=1e-12)
    # no rotation helps against a change of scale about the middle
    points = len(radius)
    sigma0 = rmse * np.sqrt(points / (2 * points - 3))
    assert figure_of(first, second, "rot") == pytest.approx(sigma0, rel=1e-3)
    assert figure_of(first, second, "rot", as_published=True) < 1e-9
    pair = compare([first, second], "spr", terrain=Terrain(range_m=0.0)).pairs[0]
    assert pair.figure_px < 1e-7  # the camera is higher by the part
    assert pair.shift_m == pytest.approx([0, 0, 250 * (4.5 / 4.4 - 1)], abs=1e-6)
    assert figure_of(first, second, "spr") > 1.0


@pytest.mark.parametrize(("name", "power"), [("K1", 3), ("K2", 5), ("K3", 7), ("K4", 9)])
def test_one_radial_term(name, power):
    """Closed form: K r^(2i+1) along the radius."""
    radius = np.hypot(*default_grid(FRAME).image_points_mm(FRAME, PIXEL_MM).T)
    k = 0.01 / 3.7**power
    expected = np.sqrt(np.mean((k * radius**power / PIXEL_MM[0]) ** 2))
    second = setup("b", **{name: k})
    assert figure_of(setup("a"), second, "mis") == pytest.approx(expected, rel=1e-12)
    assert figure_of(setup("a"), second, "mis", as_published=True) == pytest.approx(expected)


def test_the_outer_decentring_terms():
    """Closed form: (1 + P3 r2 + P4 r4) multiplies the decentring distortion, Silva 58."""
    x, y = default_grid(FRAME).image_points_mm(FRAME, PIXEL_MM).T
    r2 = x**2 + y**2
    size = np.hypot(r2 + 2 * x**2, 2 * x * y) * 1e-4 * (0.02 * r2 + 0.001 * r2**2)
    first, second = setup("a", P1=1e-4), setup("b", P1=1e-4, P3=0.02, P4=0.001)
    expected = np.sqrt(np.mean((size / PIXEL_MM[0]) ** 2))
    assert figure_of(first, second, "mis") == pytest.approx(expected, rel=1e-9)


# what each figure does not feel


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("as_published", [False, True])
def test_a_calibration_against_itself(seven, method, as_published):
    again = replace(seven[2], camera=replace(seven[2].camera, name="copy"))
    result = compare([seven[2], again], method, as_published=as_published)
    assert result.pairs[0].figure_px < 1e-8
    assert result.pairs[0].similar


def test_the_same_bundle_in_another_dress():
    """Property: balanced about another radius (another c and K) it is the same camera in space."""
    form = Form("correction_added", "both_y")
    q, other = balance_about(Q, form, 2.5)
    assert abs(q[0] - Q[0]) > 0.01
    base = setup("a")
    first = replace(base, camera=replace(base.camera, values=Q, form=form))
    second = replace(base, camera=replace(base.camera, values=q, form=other, name="b"))
    for method in ("zrot", "rot", "spr"):
        assert figure_of(first, second, method) < 1e-7
    assert figure_of(first, second, "mis") > 1.0


def test_conventions_are_compared_by_their_effect():
    """Property: the same lens with the other sign, and in another form of affinity, is the same."""
    values = {"K1": -2e-3, "P1": 8e-4, "A": 1e-4}
    opposite = {name: -value for name, value in values.items()}
    first = setup("a", Form("correction_subtracted", "both_x"), **values)
    second = setup("b", Form("correction_added", "b1_b2"), **opposite)
    assert figure_of(first, second, "mis") < 1e-12
    assert figure_of(first, setup("c", Form("correction_added", "both_x"), **values), "mis") > 1.0


def test_a_turned_bundle_is_the_same_to_a_rotation():
    """Property: rot gives a rotation of any size away and finds it."""
    points = default_grid(FRAME).image_points_mm(FRAME, PIXEL_MM)
    for angles in [(0.01, -0.02, 0.03), (0.2, -0.1, 2.0), (0.0, 0.0, np.pi)]:
        rotation = rotation_of_angles(*angles)
        turned_mm = image_of(rays(points, 4.4), rotation, 4.5)
        fit = fit_rotation(turned_mm, 4.5, points, 4.4, PIXEL_MM)
        assert fit.sigma0_px < 1e-9
        assert fit.rotation == pytest.approx(rotation, abs=1e-12)


def test_a_shift_of_the_principal_point_is_nearly_a_rotation():
    """Property: by a long lens 30 px are a turn; what is left goes with (shift/c) (r/c)."""
    first, second = setup("a", c=60.0), setup("b", c=60.0, x0=0.039)
    assert figure_of(first, second, "mis") == pytest.approx(30.0)
    pair = compare([first, second], "rot").pairs[0]
    assert pair.figure_px < 0.05
    turn = 0.039 / 60
    # the ray of an image point lies to the left in the second set: its camera looks to the right
    assert np.abs(pair.rotation_rad) == pytest.approx([0, turn, 0], rel=1e-3, abs=turn**2)
    seen = rotation_of_angles(*pair.rotation_rad) @ [0.0, 0.0, -60.0]
    assert -60 * seen[0] / seen[2] == pytest.approx(-0.039, rel=1e-3)


def test_a_displaced_camera_is_the_same_to_a_resection():
    """Property: spr gives the whole orientation away and finds it."""
    points = default_grid(FRAME).image_points_mm(FRAME, PIXEL_MM)
    terrain = TERRAINS["II"]
    object_m = terrain.object_points_m(points, 4.4, terrain.depths_m(len(points), 1))
    rotation, position = rotation_of_angles(0.05, -0.1, 0.4), np.array([310.0, 270.0, 480.0])
    image = image_of(object_m - position, rotation, 4.4)
    fit = fit_resection(object_m, image, 4.4, PIXEL_MM, terrain.position_m)
    assert fit.sigma0_px < 1e-8
    assert fit.position_m == pytest.approx(position, abs=1e-7)
    assert angles_of(fit.rotation) == pytest.approx([0.05, -0.1, 0.4], abs=1e-9)


@pytest.mark.slow
def test_the_order_of_a_pair(seven):
    """Property: mis is the same for both orders; the others, to first order, but for their image.

    What is left shrinks with the difference of the calibrations.
    """
    first, other = seven[0], seven[6]

    def asymmetry(method, part):
        values = first.camera.values + part * (other.camera.values - first.camera.values)
        second = replace(other, camera=replace(other.camera, values=values))
        ratio = {"mis": 1.0, "spr": first.camera.values[0] / values[0]}
        there, back = figure_of(first, second, method), figure_of(second, first, method)
        return abs(back / there / ratio.get(method, values[0] / first.camera.values[0]) - 1)

    assert asymmetry("mis", 1.0) == 0
    assert asymmetry("zrot", 1.0) < 1e-12
    for method in ("rot", "spr"):
        assert asymmetry(method, 1.0) < 0.02
        assert asymmetry(method, 0.1) < 0.12 * asymmetry(method, 1.0) + 1e-9


# second methods


def by_least_squares(place, image, c, start, moves):
    """Second method: sigma0 in px by scipy, three angles (and a place) as unknowns."""

    def residuals(x):
        where = x[3:] if moves else np.zeros(3)
        return ((image_of(place - where, rotation_of_angles(*x[:3]), c) - image) / PIXEL_MM).ravel()

    found = least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    return np.sqrt(2 * found.cost / (2 * len(place) - len(start))), found.x


def bundles():
    points = Grid(12, 9, (100, 100), 380).image_points_mm(FRAME, PIXEL_MM)
    form = Form("correction_subtracted", "both_x")
    other = Q + np.array([0.02, 5e-3, -8e-3, 2e-4, -1e-5, 0, 0, 1e-4, 5e-5, 0, 0, 1e-4, -1e-4])
    return [(correct_image_points(points, one, form), one[0]) for one in (Q, other)]


def test_rotation_against_scipy_and_singular_values():
    (first, c1), (second, c2) = bundles()
    fit = fit_rotation(first, c1, second, c2, PIXEL_MM)
    sigma0, angles = by_least_squares(rays(second, c2), first, c1, np.zeros(3), False)
    assert fit.sigma0_px == pytest.approx(sigma0, rel=1e-9)
    assert angles_of(fit.rotation) == pytest.approx(angles, abs=1e-9)
    # Wahba's problem has other weights, so the rotations agree only nearly.
    wahba = find_nearest_rotation(rays(first, c1), rays(second, c2))
    assert angles_of(wahba) == pytest.approx(angles, abs=2e-3)


def test_resection_against_scipy():
    (first, c1), (second, c2) = bundles()
    terrain = TERRAINS["I"]
    object_m = terrain.object_points_m(first, c1, terrain.depths_m(len(first), 1))
    fit = fit_resection(object_m, second, c2, PIXEL_MM, terrain.position_m)
    start = np.array([0, 0, 0, *terrain.position_m])
    sigma0, found = by_least_squares(object_m, second, c2, start, True)
    assert fit.sigma0_px == pytest.approx(sigma0, rel=1e-9)
    assert fit.position_m == pytest.approx(found[3:], abs=1e-5)


@pytest.mark.parametrize("unknowns", [3, 6])
def test_derivatives_of_the_orientation(unknowns):
    (_, _), (second, c) = bundles()
    place = rays(second, c) * np.linspace(50, 60, len(second))[:, None]
    start = rotation_of_angles(0.1, -0.2, 0.5)
    model = make_orientation_model(place, c, start, PIXEL_MM)
    x = np.array([0.03, -0.2, 0.1, 2.0, -3.0, 1.0])[:unknowns]
    design = model(x, np.zeros(2 * len(place)))[1]
    assert_derivative(
        lambda one: model(one, np.zeros(2 * len(place)))[0], x, design, tolerance=1e-6
    )
    assert apply_small_rotation(start[None], x[None, :3]).shape == (1, 3, 3)


@pytest.mark.parametrize("form", FORMS)
def test_derivatives_of_the_ideal_points(form):
    points = Grid(5, 4, (300, 300), 900).image_points_mm(FRAME, PIXEL_MM)
    analytic = ideal_derivatives(correct_image_points(points, Q, form), Q, form).reshape(-1, 13)
    scale = np.array([1, 1, 1, 1e-3, 1e-4, 1e-5, 1e-6, 1e-3, 1e-3, 1e-2, 1e-3, 1e-2, 1e-2])
    assert_derivative(
        lambda move: correct_image_points(points, Q + move * scale, form).ravel(),
        np.zeros(13),
        analytic * scale,
        step=1e-4,
    )


SD = [2e-3, 4e-4, 4e-4, 7e-5, 2e-5, 1e-6, 1e-8, 7e-6, 7e-6, 1e-3, 1e-4, 2e-5, 2e-5]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", [FORMS[0], FORMS[5], FORMS[7], FORMS[10]])
@pytest.mark.parametrize(
    ("method", "as_published"),
    [("mis", False), ("zrot", False), ("rot", False), ("rot", True), ("spr", False)],
)
def test_the_expected_figure_is_that_of_each_error_alone(method, as_published, form):
    """Second method: squares of the figures of one error of one sd at a time add up."""
    grid, sd = Grid(7, 5, (100, 100), 700), 1e-3 * np.array(SD)
    base = replace(setup("a"), camera=Camera(Q, form, sd, name="a"))
    squares = 0.0
    for place in np.flatnonzero(sd):
        values = Q + sd * (np.arange(13) == place)
        other = replace(base, camera=replace(base.camera, values=values, name="b"))
        for pair in ([base, other], [other, base]):
            found = compare(pair, method, grid, as_published=as_published).pairs[0]
            squares += found.figure_px**2
    assert np.sqrt(squares) == pytest.approx(found.expected_px, rel=2e-4)


def test_correlations_make_the_expected_figure_smaller(shared, seven, figure):
    """Published: Pessoa table 12, correlations of set 1; its K1, K2, K3 are correlated by 0.9."""
    facts = json.loads((shared / "facts" / "pessoa_T12_correlation_set1.json").read_text("utf-8"))
    place = [0, 1, 2, 3, 4, 5, 7, 8, 11, 12]
    covariance = np.zeros((13, 13))
    sd = seven[0].camera.sd[place]
    covariance[np.ix_(place, place)] = np.array(facts["R"]) * np.outer(sd, sd)
    pair = [seven[0], replace(seven[0], camera=replace(seven[0].camera, name="again"))]
    alone = compare(pair, "zrot")
    both = compare(pair, "zrot", covariances={"set1": covariance, "again": covariance})
    figure(
        "set 1 against its like: expected px by sds, by covariance",
        f"{alone.pairs[0].expected_px:.2f}, {both.pairs[0].expected_px:.2f}",
    )
    assert both.pairs[0].expected_px < 0.5 * alone.pairs[0].expected_px
    assert alone.conventions[-1].code == "sds_uncorrelated"
    assert both.conventions[-1].values == {"cameras": ["set1", "again"]}


def test_without_standard_deviations_nothing_is_expected(seven):
    assert compare([setup("a", K1=1e-3), seven_like("b")], "zrot").pairs[0].expected_px is None
    lacking = setup("b", K1=1e-3, sd=[np.nan, *SD[1:]])  # c has none, and does not count in mis
    assert compare([lacking, lacking], "mis").pairs[0].expected_px > 0
    assert compare([lacking, lacking], "zrot").pairs[0].expected_px is None


def seven_like(name):
    return setup(name, K1=1.1e-3, sd=SD)


# grids, terrains


@pytest.mark.parametrize(
    ("frame", "grid"),
    [
        ((4608, 3456), Grid(46, 35, (50, 50), 100)),
        ((3456, 4608), Grid(35, 46, (50, 50), 100)),
        ((9216, 6912), Grid(46, 35, (100, 100), 200)),
    ],
)
def test_the_grid_of_a_frame(frame, grid):
    """Published: Pessoa's grid on his frame, and the same in proportion."""
    assert default_grid(frame) == grid
    assert parse_grid(str(grid)) == grid


@pytest.mark.parametrize("frame", [(1, 1), (640, 480), (6000, 4000), (100_000, 7), (4607, 3457)])
def test_a_grid_lies_on_its_frame(frame):
    places = default_grid(frame).places_px
    assert places.min() >= -0.5
    assert np.all(places <= np.array(frame) - 0.5)


def test_image_points_of_a_grid():
    """Closed form, Pessoa 1 and 2: corner and middle; y upwards."""
    grid = Grid(2, 2, (0, 0), 3)
    points = grid.image_points_mm((4, 4), np.array([0.1, 0.2]))
    assert points == pytest.approx(
        np.array([[-0.15, 0.3], [0.15, 0.3], [-0.15, -0.3], [0.15, -0.3]])
    )


@pytest.mark.parametrize(
    "text",
    [
        *("", "46x35", "46x35,50,50", "46x35,50,50,0", "0x35,50,50,100", "46x35,50,50,1e9"),
        *("46x35,nan,50,100", "-46x35,50,50,100", "999999x999999,0,0,1", "x" * 500, "46x35,,,"),
        *("\u0664x3,1,1,1", "4x3,1,1,1\n", "=1x1,0,0,1"),
    ],
)
def test_a_grid_that_is_none(text):
    if text.endswith("\n"):
        text += "!"
    with pytest.raises(InputError, match="--grid: "):
        parse_grid(text)


def test_a_grid_off_the_frame(seven):
    for grid in (parse_grid("46x35,50,50,101"), Grid(2, 2, (-1, 0), 10), Grid(2, 3, (0, 0), 1728)):
        with pytest.raises(
            InputError, match=r"expected the whole grid on the frame of 4608 x 3456 px"
        ):
            compare(seven, "mis", grid)


def test_terrains_by_name_and_number():
    assert parse_terrain("I") == TERRAINS["I"] == Terrain((300, 300, 450), 200, 100)
    assert parse_terrain(" ii ") == Terrain((300, 300, 450), 200, 20)
    assert parse_terrain("-20, 30.5") == Terrain(low_m=-20.0, range_m=30.5)
    for text in ("", "III", "200", "200,-1", "400,50", "nan,1", "1,2,3", "2e2,1", "9" * 99):
        with pytest.raises(InputError, match=r"--terrain: found .* expected I, II, or LOW,RANGE"):
            parse_terrain(text)
    depth = TERRAINS["II"].depths_m(5000, 1)
    assert depth.min() > 230
    assert depth.max() < 250
    assert depth.mean() == pytest.approx(240, abs=0.3)


# what cannot be compared


def refusal(setups, method="mis", **options):
    with pytest.raises(InputError) as caught:
        compare(setups, method, **options)
    return str(caught.value)


def test_comparing_one_calibration_is_refused(seven):
    assert refusal(seven[:1]) == "cameras.toml: 1 calibration; expected two or more to compare"
    assert "no calibration" in refusal([])


def test_other_frames_and_pixels():
    first = setup("a")
    small = replace(setup("b"), format_mm=np.array([4600, 3456]) * PIXEL_MM)
    fine = setup("c", pixel_mm=PIXEL_MM * 1.003)
    words = refusal([first, small, fine])
    assert "b: a frame of 4600 x 3456 px; expected 4608 x 3456, as a has" in words
    assert "c: a pixel of 1.3039 x 1.3039 micrometres; expected that of a, 1.3 x 1.3" in words
    assert "b: the size of a pixel is not known" in refusal([first, replace(small, pixel_mm=None)])


@pytest.mark.parametrize("as_published", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_a_camera_in_another_length_of_pixels_is_the_same(seven, method, as_published):
    """Property: only numbers without a unit of length count, so a longer millimetre is nothing."""
    s, first = 1.001, seven[0].camera
    powers = np.array([1, 1, 1, -2, -4, -6, -8, -1, -1, -2, -4, 0, 0])
    camera = replace(first, name="longer", values=first.values * s**powers)
    longer = replace(
        seven[0], camera=camera, pixel_mm=seven[0].pixel_mm * s, format_mm=seven[0].format_mm * s
    )
    found = compare([seven[0], longer], method, as_published=as_published)
    assert found.pairs[0].figure_px < 1e-9


def test_options_that_are_none(seven):
    words = refusal(seven, "rms", threshold_px=float("nan"), seed=-1)
    assert "--method: found 'rms'; expected mis, zrot, rot, spr" in words
    assert "--threshold: found nan; expected pixels above 0" in words
    assert "--seed: found -1; expected a whole number, 0 or more" in words
    assert "1 points; expected more than 3" in refusal(seven, "spr", grid=Grid(1, 1, (9, 9), 1))
    big = Grid(500, 500, (0, 0), 5)
    assert "pairs of 250000 points; expected fewer" in refusal([setup("a")] * 20, grid=big)


def test_points_that_do_not_determine_an_orientation():
    line = Grid(5, 1, (100, 1727.5), 900)
    with pytest.raises(SolutionError, match=r"a and b: rank 5 of 6: the observations do not"):
        compare([setup("a"), setup("b", c=4.5)], "spr", line, terrain=Terrain(range_m=0.0))


def test_distortion_that_turns_back_within_the_frame():
    lens = setup("wild", Form("distortion_of_ideal"), K1=-0.05)
    with pytest.raises(SolutionError, match="wild: its distortion cannot be removed"):
        compare([setup("a"), lens], "mis")


# what is handed on


def test_everything_of_a_result_is_plain(seven):
    for method in METHODS:
        given = plain_stability(compare(seven[:3], method, Grid(4, 3, (100, 100), 500), seed=7))
        assert json.loads(json.dumps(given, allow_nan=False)) == given
        assert list(given)[:3] == ["format", "kind", "method"]
        pair = given["pairs"][2]
        assert (pair["a"], pair["b"]) == ("set2", "set3")
        assert np.shape(pair["difference_px"]) == (3, 4)
        length = np.hypot(pair["difference_x_px"], pair["difference_y_px"])
        assert pair["difference_px"] == pytest.approx(length, abs=2e-4)
        assert pair["largest_px"] == pytest.approx(length.max(), abs=2e-4)
        assert (pair["scale"] is not None) == (method == "zrot")
        assert (pair["rotation_deg"] is not None) == (method in ("rot", "spr"))
        assert (pair["shift_m"] is not None) == (given["terrain"] is not None) == (method == "spr")
    assert given["terrain"]["seed"] == 7
    camera = given["cameras"][1]
    assert camera["name"] == "set2"
    assert camera["c_mm"] == 4.383
    assert camera["sd"]["K1_mm-2"] == 7.288e-05
    assert camera["format_px"] == [4608, 3456]
    assert camera["pixel_um"] == pytest.approx([1.339451, 1.339450], abs=1e-6)
    assert (
        plain_stability(compare([setup("a"), setup("b")], "mis"))["cameras"][0]["sd"]["c_mm"]
        is None
    )


@pytest.mark.slow
def test_the_summary_of_a_result(seven):
    given = summary(compare(seven[:3], "spr", threshold_px=0.33))
    assert [(one["a"], one["b"], one["similar"]) for one in given] == [
        *(("set1", "set2", True), ("set1", "set3", False), ("set2", "set3", False))
    ]
    assert list(given[0]) == ["a", "b", "method", "figure_px", "scatter_px", "similar"]


@pytest.mark.slow
def test_each_convention_is_named(seven):
    def codes(method, as_published):
        result = compare(seven[:2], method, as_published=as_published)
        return [one.code for one in result.conventions if one.code not in ("direction", "pixel")]

    sds = "sds_uncorrelated"
    for as_published in (False, True):
        assert codes("mis", as_published) == ["figure_rmse", "focal_as_they_are", sds]
        expected = ["figure_sigma0", "focal_own", "terrain_random", sds]
        assert codes("spr", as_published) == expected
    assert codes("zrot", False) == ["figure_rmse", "focal_scaled", sds]
    assert codes("zrot", True) == ["figure_mean_distance", "focal_scaled", sds]
    assert codes("rot", False) == ["figure_sigma0", "focal_own", sds]
    assert codes("rot", True) == ["figure_sigma0", "focal_same", sds]


def test_of_ideal_points_are_undone():
    """Property: points corrected and distorted again are where they were."""
    form = Form("distortion_of_ideal", "b1_b2")
    points = default_grid(FRAME).image_points_mm(FRAME, PIXEL_MM)
    ideal = correct_image_points(points, LENS, form)
    assert distort_image_points(ideal, LENS, form) == pytest.approx(points, abs=1e-12)


# reading calibrations

LONG = """
[cameras.one]
format_px = [4608, 3456]
pixel_um = 1.34
convention = "correction_subtracted"
affinity = "both_x"
c_mm = 4.38
x0_mm = 0.06
K1_mm-2 = -1.7e-3
K4_mm-8 = 1e-9
P1_mm-1 = 8e-4
P3_mm-2 = 1e-3
A = 1e-4
s_c_mm = 1e-3
s_x0_mm = 2e-4
s_K1 = 6e-5
"""
SHORT = (
    LONG.replace("K1_mm-2", "K1")
    .replace("K4_mm-8", "K4")
    .replace("P1_mm-1", "P1")
    .replace("P3_mm-2", "P3")
    .replace("s_c_mm", "s_c")
    .replace("s_x0_mm", "s_x0")
)


def read(tmp_path, text, name="set.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return read_cameras(path)


def complaints(tmp_path, text):
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    return caught.value.problems


PUBLISHED_SET = """[cameras.set1]
format_px = [4608, 3456]
pixel_um = 1.339451
c_mm = 4.3816
x0_mm = 0.0625
y0_mm = 0.0427
K1_mm-2 = -0.00174185
P1_mm-1 = 0.0008448316
P2_mm-1 = 0.0006318956
convention = "correction_subtracted"
s_c_mm = 0.001321
s_x0_mm = 0.0003811
s_y0_mm = 0.0004067
"""  # Pessoa 2017, table 6


def test_both_spellings_of_the_keys(tmp_path):
    assert "_mm-" not in SHORT
    (one,), (other,) = read(tmp_path, LONG), read(tmp_path, SHORT)
    assert one.camera.values == pytest.approx(
        [4.38, 0.06, 0, -1.7e-3, 0, 0, 1e-9, 8e-4, 0, 1e-3, 0, 1e-4, 0]
    )
    assert np.array_equal(one.camera.values, other.camera.values)
    assert np.array_equal(one.camera.sd, other.camera.sd, equal_nan=True)
    assert one.camera.sd[[0, 1, 3]].tolist() == [1e-3, 2e-4, 6e-5]
    assert np.isnan(one.camera.sd[2])


def test_both_spellings_at_once(tmp_path):
    (problem,) = complaints(tmp_path, LONG + "K1 = -1.7e-3\n")
    assert (problem.row, problem.column) == (17, "one.K1")
    assert problem.expected == (
        "given together with K1_mm-2; expected only one of them: they are the same parameter"
    )
    (setup_,) = read(tmp_path, LONG + 'K1 = ""\n')  # blank: not given
    assert setup_.camera.values[3] == -1.7e-3


def test_bad_value_is_reported_by_its_written_key(tmp_path):
    (problem,) = complaints(tmp_path, SHORT.replace("K1 = -1.7e-3", 'K1 = "x"'))
    assert problem.column == "one.K1"
    (problem,) = complaints(tmp_path, SHORT.replace("K1 = -1.7e-3", "K1 = 0.9"))
    assert problem.column == "one.K1"
    assert "is it in another unit than millimetres" in problem.expected


@pytest.mark.parametrize(
    "size",
    [
        "format_px = [4608, 3456]\npixel_um = [1.34, 1.36]",
        "format_px = [4608, 3456]\nformat_mm = [6.17472, 4.70016]",
        "format_mm = [6.17472, 4.70016]\npixel_um = [1.34, 1.36]",
        "format_px = [4608, 3456]\nformat_mm = [6.2, 4.7]\npixel_um = [1.34, 1.36]",
    ],
)
def test_the_size_of_the_frame_in_each_way(tmp_path, size):
    (one,) = read(tmp_path, f"[cameras.a]\n{size}\nc_mm = 4.4\n")
    assert one.pixel_mm == pytest.approx([1.34e-3, 1.36e-3], rel=1e-12)
    assert (one.format_mm / one.pixel_mm).round(9).tolist() == [4608, 3456]


@pytest.mark.parametrize(
    ("size", "key", "words"),
    [
        ("", "format_mm", "missing; expected [width, height], or format_px with pixel_um"),
        ("format_px = [4608, 3456]", "pixel_um", "missing, but format_px"),
        ("pixel_um = 1.34", "format_mm", "missing; expected [width, height]"),
        (
            "format_mm = [6.2, 4.6]",
            "pixel_um",
            "missing, but format_mm is given; expected the size of",
        ),
        ("format_mm = [6.17, 4.7]\npixel_um = 1.34", "format_mm", "4604.4776 x 3507.4627 pixels"),
        ("format_px = [4608, 3456]\npixel_um = 0.00134", "pixel_um", "is it in millimetres?"),
        ("format_px = [4608, 3456]\npixel_um = 340", "pixel_um", "is it in another unit?"),
        ("format_px = [4608, 3456]\npixel_mm = 0.00134", "pixel_mm", "did you mean pixel_um?"),
        ("format_px = [4608.5, 3456]\npixel_um = 1.34", "format_px", "expected whole numbers"),
        ("format_px = [4608]\npixel_um = 1.34", "format_px", "expected two"),
        ("format_px = [0, 0]\npixel_um = 1.34", "format_px", "found 0"),
        (
            "format_px = [4608, 3456]\npixel_um = nan",
            "pixel_um",
            "found nan; expected numbers above 0",
        ),
    ],
)
def test_a_frame_that_is_not_known(tmp_path, size, key, words):
    problems = complaints(tmp_path, f"[cameras.a]\nc_mm = 4.4\n{size}\n")
    assert any(one.column == f"a.{key}" and words in one.expected for one in problems), problems


def test_all_problems_in_one_run(tmp_path):
    text = """
[cameras.a]
format_px = [4608, 3456]
pixel_um = 1.34
c_mm = nan
K1 = 1e-3
y0_mm = "0,4"

[cameras.b]
c_mm = inf
wrong = 1
A = 1e-4
s_K1 = -1

[cameras."=cmd|x"]
format_mm = [36, 24]
pixel_um = 6
convention = "brown"

[camera.c]
c_mm = 1
"""
    found = [(one.row, one.column) for one in complaints(tmp_path, text)]
    assert found == [
        *((None, "camera"), (2, "a.convention"), (5, "a.c_mm"), (7, "a.y0_mm"), (9, "b.format_mm")),
        *((9, "b.affinity"), (10, "b.c_mm"), (11, "b.wrong"), (13, "b.s_K1")),
        *((15, "=cmd|x"), (15, "=cmd|x.c_mm"), (18, "=cmd|x.convention")),
    ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no camera; expected sections"),
        ("[cameras]\n", "no camera; expected sections"),
        ('[cameras.a]\nc_mm = ""\n', "no camera; expected sections"),
        ("[cameras.a]\nc_mm = 1\n[cameras.a]\nc_mm = 2\n", "cannot be read"),
        ("[cameras]\na = 1\n", "is in no section [cameras.NAME]"),
        ("c_mm = 4\n", "is in no section; expected sections such as [cameras.NAME]"),
        ("\0", "a zero byte"),
        ("[[cameras]]\na = 1\n", "is in no section"),
    ],
)
def test_files_that_are_no_calibrations(tmp_path, text, words):
    assert any(words in one.expected for one in complaints(tmp_path, text))


def test_files_that_are_not_there(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"none\.toml: not found; expected a file with"):
        read_cameras(tmp_path / "none.toml")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"^empty.cameras\.toml: not found"):
        read_cameras("empty")
    (tmp_path / "cameras.toml").write_text(LONG, encoding="utf-8")
    assert len(read_cameras(tmp_path)) == 1


def test_doubts_are_reported_on_request(tmp_path):
    told = []
    (tmp_path / "a.toml").write_text(LONG.replace("4.38", "0.5"), encoding="utf-8")
    read_cameras(tmp_path / "a.toml", told.append)
    assert [(one.column, one.expected[-16:]) for one in told] == [("one.c_mm", "in another unit?")]


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("x0_mm", 62.5, "outside the format, whose width is 6.172 mm; expected at most 3.086"),
        ("y0_mm", -42.7, "outside the format, whose height is 4.629 mm"),
        ("c_mm", 4381.6, "with a format of 7.715 mm across; expected 0.386 to 1543 mm"),
        ("c_mm", 0.0043816, "expected 0.386 to 1543 mm: is it in another unit?"),
        ("P1_mm-1", 0.8448316, "moves the corner of the image by 806 % of its radius"),
        ("P2_mm-1", -0.6318956, "moves the corner of the image by 480 % of its radius"),
        ("P4_mm-4", 1.0, "moves the corner of the image by"),
        ("s_c_mm", 13.0, "with a format of 7.715 mm across; expected less: is it in another unit?"),
        ("s_x0_mm", 381.1, "expected less: is it in another unit?"),
    ],
)
def test_numbers_a_thousand_times_off(tmp_path, key, value, words):
    """Property: of each length and of P, a thousandth or a thousandfold is refused by its key."""
    lines = dict(line.split(" = ") for line in PUBLISHED_SET.splitlines()[1:])
    lines[key] = str(value)
    text = "[cameras.set1]\n" + "".join(f"{key} = {value}\n" for key, value in lines.items())
    (problem,) = complaints(tmp_path, text)
    assert problem.column == f"set1.{key}"
    assert words in problem.expected


def test_published_calibrations_and_all_lenses_are_accepted(tmp_path):
    told = []
    (tmp_path / "a.toml").write_text(PUBLISHED_SET, encoding="utf-8")
    read_cameras(tmp_path / "a.toml", told.append)
    for c_mm in (8.0, 35.0, 1200.0):  # a full frame with a fisheye, a usual and the longest lens
        text = f"[cameras.a]\nformat_mm = [36, 24]\npixel_um = 6\nc_mm = {c_mm}\n"
        (tmp_path / "a.toml").write_text(text, encoding="utf-8")
        read_cameras(tmp_path / "a.toml", told.append)
    assert told == []


def test_choosing_by_name(seven):
    assert choose(seven, []) == seven
    chosen = choose(seven, ["set5", "set2"])
    assert [one.camera.name for one in chosen] == ["set5", "set2"]  # in the order asked for
    with pytest.raises(InputError) as caught:
        choose(seven, ["set1", "sett7", "set1", "=evil\n"], "seven.toml")
    lines = [str(one) for one in caught.value.problems]
    assert lines[0].startswith(
        "seven.toml: found 'sett7'; expected a camera of this file (did you mean set7?): "
        "set1, set2, set3"
    )
    assert lines[1] == "seven.toml: 'set1' was named twice; expected once"
    assert "found '=evil?'" in lines[2]


def test_a_job_takes_both_spellings(tmp_path):
    parts = survey_parts()
    camera = parts.registers["cameras"]["UMK 10/1318"]
    k1 = camera["K1_mm-2"]
    before = load(write_folder(tmp_path / "long", parts)).measurements.cameras
    camera["K1"] = camera.pop("K1_mm-2")
    camera["P1"] = camera.pop("P1_mm-1")
    after = load(write_folder(tmp_path / "short", parts)).measurements.cameras
    for one, other in zip(before, after, strict=True):
        assert np.array_equal(one.camera.values, other.camera.values)
    camera["K1_mm-2"] = k1
    with pytest.raises(
        InputError, match=r"K1: given together with K1_mm-2; expected only one of them"
    ):
        load(write_folder(tmp_path / "both", parts))


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_correlations_count_with_their_sign(method):
    """Second method: an uncertainty along one direction gives the figure of a step along it."""
    for sign in (1.0, -1.0):
        step = np.zeros(13)
        step[[0, 3, 4]] = [2e-4, sign * 3e-6, -2e-7]
        first, second = setup("a", K1=-1e-3, sd=SD), setup("b", K1=-1e-3, sd=SD)
        moved = replace(second, camera=replace(second.camera, values=second.camera.values + step))
        known = {"a": np.zeros((13, 13)), "b": np.outer(step, step)}
        expected = compare([first, second], method, covariances=known).pairs[0].expected_px
        assert compare([first, moved], method).pairs[0].figure_px == pytest.approx(
            expected, rel=2e-3
        )


def test_differences_keep_their_sign_after_resection():
    first, second = setup("a"), setup("b", K2=4e-5)
    raw, left = (compare([first, second], method).pairs[0] for method in ("mis", "spr"))
    corner = np.argmax(np.linalg.norm(raw.difference_px, axis=1))
    assert raw.difference_px[corner] @ left.difference_px[corner] > 0


def test_an_affinity_by_the_name_of_its_author(tmp_path):
    text = "[cameras.{0}]\nformat_px = [4608, 3456]\npixel_um = 1.34\nc_mm = 4.4\nA = 1e-4\n"
    text += 'B = 2e-4\naffinity = "{0}"\nconvention = "correction_added"\n'
    (tmp_path / "cameras.toml").write_text(text.format("silva") + text.format("pessoa"))
    found = {one.camera.name: one.camera.form.affinity for one in read_cameras(tmp_path)}
    assert found == {"silva": "both_y", "pessoa": "both_x"}
