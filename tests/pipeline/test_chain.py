"""The main job on jobs with known truth, and the propagated covariance against simulation."""

from dataclasses import replace

import numpy as np
import pytest
from job_builder import job_parts, write_folder, write_job

import tankcal
from tankcal.errors import InputError
from tankcal.pipeline.chain import run
from tankcal.pipeline.tanks import insets_of, shell_volume, thermal_scale
from tankcal.pipeline.wall.finding import fit_wall


def result_of(tmp_path, **changes):
    write_job(tmp_path / "job", **changes)
    return run(tankcal.load(tmp_path / "job"))


def inside(radius, plate_mm=8.0):
    return np.pi * (radius - plate_mm / 1000) ** 2


@pytest.mark.slow
def test_a_cylinder_comes_out_exactly(tmp_path):
    found = result_of(tmp_path)
    heights = found.capacity.height_m.to_numpy()
    # closed form; the points are written to 1e-6 m or better
    assert found.capacity.volume_m3.to_numpy() == pytest.approx(inside(6.5) * heights, rel=1e-6)
    assert np.all(found.wall.shell.reason == "")


@pytest.mark.slow
def test_an_inside_survey_keeps_its_radius(tmp_path):
    found = result_of(tmp_path, settings={"survey.side": "inside"})
    assert found.capacity.volume_m3.iloc[-1] == pytest.approx(np.pi * 6.5**2 * 9.5, rel=1e-6)


@pytest.mark.slow
def test_two_rings_in_a_course_give_exact_frustum(tmp_path):
    found = result_of(tmp_path, radius=lambda theta, z: 6.5 + 0.004 * z, rings=2)
    assert len(found.wall.sections) == 10
    low, high, inset = 6.5, 6.5 + 0.004 * 9.5, 0.008
    exact = (
        np.pi
        * 9.5
        * sum(
            a * b
            for a, b in (
                (low - inset, low - inset),
                (low - inset, high - inset),
                (high - inset, high - inset),
            )
        )
        / 3
    )  # closed form
    assert found.capacity.volume_m3.iloc[-1] == pytest.approx(exact, rel=1e-6)


@pytest.mark.slow
def test_tilt_enters_once(tmp_path):
    """A cylinder of radius r and axis length 9.5 m holds pi r^2 9.5, however it leans.

    Its horizontal cut is an ellipse, sqrt(1 + m^2) longer along the tilt, and its height along the
    vertical is less by the same factor (closed form). A factor forgotten or taken twice is
    0.045 %.
    """
    longer = np.hypot(1, 0.03)

    def cut(theta, z):
        return 6.5 * longer / np.hypot(np.sin(theta), longer * np.cos(theta))

    found = result_of(tmp_path, tilt=(0.03, 0.0), radius=cut, settings={"survey.side": "inside"})
    assert found.body.shell.volume.height_m == pytest.approx(9.5 / longer, rel=1e-9)
    assert found.body.shell.volume.volume_m3([9.5 / longer])[0] == pytest.approx(
        np.pi * 6.5**2 * 9.5, rel=1e-6
    )


def leaning_rows(radius_m, slope, along_m, azimuth_rad, *, square):
    """(n, 3) places on a round cylinder whose axis leans by a slope, from (0, 0, 0) on.

    square   True: azimuth and height are those of sections square to the axis; False: of levels
    """
    along, azimuth = np.broadcast_arrays(along_m, azimuth_rad)
    axis = np.append(slope, 1.0) / np.sqrt(1 + np.dot(slope, slope))
    first = np.cross(axis, [0.0, -1.0, 0.0]) / np.hypot(axis[0], axis[2])
    second = np.cross(axis, first)
    round_m = radius_m * (np.outer(np.cos(azimuth), first) + np.outer(np.sin(azimuth), second))
    if square:
        return round_m + np.outer(along, axis)
    return round_m + np.outer((along - round_m[:, 2]) / axis[2], axis)


LEANING = {  # name: (radius, azimuths of a ring, how far they scatter, rings, square to the axis)
    "level": (6.5, 24, 0.4, 1, False),
    "square": (6.5, 24, 0.0, 1, True),
    "square, uneven": (6.5, 24, 0.4, 1, True),
    "square, two rings": (6.5, 12, 0.4, 2, True),
    "square, narrow": (3.0, 8, 0.3, 3, True),
    "square, wide": (20.0, 36, 0.3, 2, True),
    "scattered": (6.5, 40, 0.5, 0, False),
}


@pytest.mark.slow
@pytest.mark.parametrize("lean", [0.036, 0.05])
@pytest.mark.parametrize("case", LEANING)
def test_a_leaning_cylinder_comes_out_exactly(tmp_path, lean, case):
    """Closed form: pi r^2 sqrt(1 + m^2) h below a level h, to 0.5 ppm at every dip above 0.1 m.

    The cut of a leaning cylinder is an ellipse, m^2 r / 4 wider and narrower than a circle: 2 mm of
    6.5 m. Rings square to the axis separate that ellipse from a bulge of the courses by little.
    """
    radius, count, scatter, rings, square = LEANING[case]
    slope, rng = lean * np.array([0.6, -0.8]), np.random.default_rng(5)
    heights = (np.arange(5 * max(rings, 1)) + 0.5) * 9.5 / (5 * max(rings, 1))
    if rings:
        azimuth = np.arange(count) + scatter * rng.uniform(-1, 1, (len(heights), count))
        along = np.repeat(heights, count)
    else:
        azimuth, along = rng.uniform(0, count, (5, count)), rng.uniform(0.05, 9.3, 5 * count)
    azimuth = 2 * np.pi / count * azimuth.ravel()
    xyz = leaning_rows(radius, slope, along, azimuth, square=square)
    xyz = xyz[(xyz[:, 2] > 0.01) & (xyz[:, 2] < 9.45)]
    parts = job_parts(settings={"survey.side": "inside", "tank.nominal_diameter_m": 2 * radius})
    rows = [[f"P{i}", *map(float, one)] for i, one in enumerate(xyz)]
    parts.tables["points"] = [parts.tables["points"][0], *rows]
    found = run(tankcal.load(write_folder(tmp_path / "job", parts)), simulated=False)
    assert np.all(found.wall.shell.reason == "")
    height = found.table.height_m[10:]
    closed = np.pi * radius**2 * np.sqrt(1 + lean**2) * height
    np.testing.assert_allclose(found.table.volume_m3[10:], closed, rtol=5e-7)
    np.testing.assert_allclose(found.wall.shell.slope, slope, atol=1e-7)


@pytest.mark.slow
def test_temperature_is_the_square_of_the_length(tmp_path):
    cold = result_of(tmp_path / "a", settings={"survey.shell_temperature_c": 30.0})
    plain = result_of(tmp_path / "b")
    expected = (1 + 1.1e-5 * (20 - 30)) ** 2
    ratio = cold.capacity.volume_m3.iloc[-1] / plain.capacity.volume_m3.iloc[-1]
    assert ratio == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_a_dip_plate_moves_the_zero(tmp_path):
    found = result_of(tmp_path, settings={"datum.dip_plate_z_m": 0.05})
    table = found.capacity
    assert table.volume_m3.iloc[0] == pytest.approx(inside(6.5) * 0.05, rel=1e-6)  # the heel
    assert table.height_m.iloc[-1] == pytest.approx(9.45, abs=1e-6)
    below = result_of(tmp_path / "b", settings={"datum.dip_plate_z_m": -0.05})
    assert below.capacity.volume_m3.iloc[3] == 0.0
    assert below.capacity.volume_m3.iloc[-1] == pytest.approx(inside(6.5) * 9.5, rel=1e-6)


@pytest.mark.slow
def test_rows_do_not_depend_on_the_order_of_points(tmp_path):
    write_job(tmp_path / "job", noise_mm=3.0, sd_mm=3.0)
    job = tankcal.load(tmp_path / "job")
    order = np.random.default_rng(1).permutation(len(job.points.names))
    points = job.points
    shuffled = replace(
        points,
        names=tuple(points.names[i] for i in order),
        xyz_m=points.xyz_m[order],
        sd_m=points.sd_m[order],
        section=tuple(points.section[i] for i in order),
        generatrix=tuple(points.generatrix[i] for i in order),
        rows=tuple(points.rows[i] for i in order),
    )
    one, other = run(job), run(replace(job, points=shuffled))
    assert other.table.volume_m3 == pytest.approx(one.table.volume_m3, rel=1e-11)
    assert other.table.u_m3 == pytest.approx(one.table.u_m3, rel=1e-9)


@pytest.mark.slow
def test_the_frame_changes_nothing(tmp_path):
    far = {"centre": (500_000.0, 7_500_000.0), "settings": {"datum.bottom_z_m": 850.0}}
    near = result_of(tmp_path / "a", noise_mm=2.0, sd_mm=2.0)
    moved = result_of(tmp_path / "b", noise_mm=2.0, sd_mm=2.0, **far)
    assert moved.table.volume_m3 == pytest.approx(near.table.volume_m3, rel=2e-7, abs=1e-6)


@pytest.mark.slow
def test_covariance_equal_to_sds_gives_same_table(tmp_path):
    by_sd = result_of(tmp_path / "a", noise_mm=2.0, sd_mm=2.0)
    full = result_of(tmp_path / "b", noise_mm=2.0, covariance_m2=4e-6 * np.eye(360))
    assert full.table.u_m3 == pytest.approx(by_sd.table.u_m3, rel=1e-9)
    assert full.table.volume_m3 == pytest.approx(by_sd.table.volume_m3, rel=1e-12)


@pytest.mark.slow
def test_fully_correlated_sections_add_linearly(tmp_path):
    """One common radial error of 1 mm: u of the points = lateral area x 1 mm (closed form)."""
    write_job(tmp_path / "a")
    job = tankcal.load(tmp_path / "a")
    xyz = job.points.xyz_m
    outward = xyz / np.hypot(xyz[:, 0], xyz[:, 1])[:, None] * [1, 1, 0] * 0.001
    common = np.outer(outward.ravel(), outward.ravel()) + 1e-14 * np.eye(360)
    points = replace(job.points, covariance_m2=common)
    found = run(replace(job, points=points, survey=replace(job.survey, side="inside")))
    u = np.linalg.norm(found.table.sources[0].columns_m3[-1])
    assert u == pytest.approx(2 * np.pi * 6.5 * 9.5 * 0.001, rel=1e-4)


@pytest.mark.slow
def test_the_noise_is_estimated_when_no_covariance_is_given(tmp_path):
    """Simulation: 360 points with 3 mm in every coordinate."""
    found = result_of(tmp_path, noise_mm=3.0, points_per_ring=72)
    noise = np.sqrt(found.wall.covariance_m2.diagonal()[0])
    assert noise == pytest.approx(0.003, rel=3 / np.sqrt(2 * found.wall.noise_dof))
    assert found.table.sources[0].dof == found.wall.noise_dof < 360


@pytest.mark.slow
def test_a_posteriori_scaling_corrects_wrong_sds(tmp_path):
    options = {"noise_mm": 3.0, "sd_mm": 1.0, "points_per_ring": 72}
    prior = result_of(tmp_path / "a", **options)
    posterior = result_of(tmp_path / "b", **options, settings={"adjustment.scale": "a_posteriori"})
    by_points = [np.linalg.norm(r.table.sources[0].columns_m3[-1]) for r in (posterior, prior)]
    assert by_points[0] / by_points[1] == pytest.approx(3.0, rel=0.15)
    assert any("are the sds too small" in warning.expected for warning in prior.warnings)


def test_a_course_left_without_wall_points_is_refused(tmp_path):
    write_job(tmp_path / "job")
    job = tankcal.load(tmp_path / "job")
    xyz = job.points.xyz_m.copy()
    xyz[-24:, :2] *= 1.2  # the whole upper ring is off the wall
    with pytest.raises(InputError, match="course 5 has no section"):
        run(replace(job, points=replace(job.points, xyz_m=xyz)))


@pytest.mark.slow
def test_progress_is_reported(tmp_path):
    write_job(tmp_path / "job")
    steps = []
    run(tankcal.load(tmp_path / "job"), steps.append)
    assert len(steps) == 5


def volume_of(result, moved):
    """Volume of the full tank with points moved by so many of their sds, (points of the wall, 3).

    The wall is fitted anew, with the amplitudes that its components had.
    """
    job, wall = result.job, result.wall
    xyz = job.points.xyz_m.copy()
    xyz[wall.accepted] += moved * job.points.sd_m[wall.accepted]
    job = replace(job, points=replace(job.points, xyz_m=xyz))
    other = fit_wall(job, wall.shell, amplitudes=wall.field.amplitudes)
    insets, scale = insets_of(job, job.switches), thermal_scale(job, job.switches)
    volume = shell_volume(other, insets, scale)
    return volume.volume_m3(volume.height_m)[0]


def simulate(result, moved):
    """Volumes at full height of surveys whose points are moved by so many sds, (surveys, n, 3)."""
    return np.array([volume_of(result, one) for one in moved])


def drawn_surveys(result, surveys):
    """(surveys, points of the wall, 3) standard normal numbers."""
    shape = surveys, *result.job.points.xyz_m[result.wall.accepted].shape
    return np.random.default_rng(20).normal(size=shape)


def predicted_sd(result):
    points = result.table.sources[0]
    assert points.kind == "points"
    return np.linalg.norm(points.columns_m3[-1])


def by_differences(result):
    """(points of the wall, 3) change of the full volume by one sd of each coordinate."""
    found = np.zeros(drawn_surveys(result, 1)[0].shape)
    for index in np.ndindex(found.shape):
        moved, ends = np.zeros(found.shape), []
        for moved[index] in (-1.0, 1.0):
            ends.append(volume_of(result, moved))
        found[index] = (ends[1] - ends[0]) / 2
    return found


@pytest.mark.slow
def test_the_propagated_sd_is_the_scatter_of_simulated_surveys(example_result, figure):
    """100 surveys of the example: the ratio of sds has a standard error of 7 %."""
    found = simulate(example_result, drawn_surveys(example_result, 100))
    ratio = found.std(ddof=1) / predicted_sd(example_result)
    figure("scatter of 100 simulated surveys over the propagated sd", f"{ratio:.4f}")
    assert abs(ratio - 1) < 3 / np.sqrt(2 * 100)


@pytest.mark.study
def test_propagated_sd_by_differences_and_simulation_study(example_result, figure):
    """Differences have no scatter; the surveys beside them say that curvature adds nothing.

    The same draws through the differences take out what 200 surveys scatter by chance: the ratio is
    known to 0.1 %, where that of the sds of 5000 surveys alone is to 1 %, and 2 % was the band.
    """
    slopes, moved = by_differences(example_result), drawn_surveys(example_result, 200)
    by_slopes = np.linalg.norm(slopes) / predicted_sd(example_result)
    straight = np.einsum("spi,pi->s", moved, slopes)
    curved = np.std(simulate(example_result, moved)) / np.std(straight)
    figure("sd of the volume by differences over the propagated one", f"{by_slopes:.6f}")
    figure("scatter of 200 surveys over that of their straight lines", f"{curved:.4f}")
    assert by_slopes == pytest.approx(1.0, abs=0.002)
    assert curved == pytest.approx(1.0, abs=0.01)


def test_a_result_shows_itself_in_a_line_and_a_path_is_no_job(example_result):
    assert repr(example_result).startswith(
        "<tankcal.Result of SILVA-1995: 1249.7 m3, U = 1.5 m3 (k = 1.96) at "
    )
    with pytest.raises(TypeError, match="expected a Job"):
        run("examples/silva-1995")


@pytest.mark.slow
def test_full_covariance_with_fixed_point(tmp_path):
    """A network with a fixed point has a singular covariance.

    Its circle goes through that point, so the outline's origin moves by the noise, and the area of
    the same points by a small part of its uncertainty. Without snooping: a section that loses a
    point is smoothed, and then a point without an error rightly counts for more.
    """
    variances = np.full(360, 4e-6)
    options = {"noise_mm": 2.0, "settings": {"adjustment.snooping": False}}
    plain = result_of(tmp_path / "a", covariance_m2=np.diag(variances), **options)
    variances[30:33] = 0.0
    fixed = result_of(tmp_path / "b", covariance_m2=np.diag(variances), **options)
    moved = np.abs(fixed.table.volume_m3 - plain.table.volume_m3)
    assert np.all(moved[1:] < 0.2 * plain.table.u_m3[1:])
    assert fixed.table.u_m3[-1] == pytest.approx(plain.table.u_m3[-1], rel=0.05)
