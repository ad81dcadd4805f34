"""A bottom through surveyed points: what it reproduces, and whether its uncertainty holds."""

import numpy as np
import pytest
from draws import draws
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial.distance import cdist

from tankcal.errors import SolutionError
from tankcal.tank.bottoms import (
    COVARIANCE_MESH,
    Footprint,
    surface,
    surveyed_bottom,
    surveyed_surface,
)
from tankcal.uncertainty import coverage_factor, effective_dof

FORMS = ("cone", "flat", "buckled")
WET = (0.05, 0.2, 0.5, 0.8)  # part of the plan that is wet in the rows that are looked at


def waves(rng, sd, length):
    """A random field of Gaussian covariance: 300 plane waves, to 1e-7 m."""
    wave, phase = rng.normal(size=(300, 2)) / length, rng.uniform(0, 2 * np.pi, 300)

    def height(plan):
        angles = (plan @ wave.T + phase).astype(np.float32)  # cosines in a fifth of the time
        return sd * np.sqrt(2 / 300) * np.cos(angles).sum(axis=1, dtype=float)

    return height


def true_bottom(rng, radius, form):
    """z(plan): cone of 1 in 50 to 1 in 120, settled edge, undulation 12 mm, buckles 6 mm."""
    cone = 0.0 if form == "flat" else rng.choice([-1, 1]) * radius / rng.uniform(50, 120)
    edge, power = rng.uniform(0, 0.02), rng.uniform(4, 10)
    settled = waves(rng, 0.012, rng.uniform(0.4, 0.8) * radius)
    buckled = waves(rng, 0.006, 0.8) if form == "buckled" else lambda plan: 0.0

    def height(plan):
        rho = np.hypot(*plan.T) / radius
        return cone * (1 - rho) - edge * rho**power + settled(plan) + buckled(plan)

    return height


def scattered(rng, radius, count):
    rho, azimuth = 0.97 * radius * np.sqrt(rng.uniform(0, 1, count)), rng.uniform(0, 7, count)
    return np.column_stack([rho * np.sin(azimuth), rho * np.cos(azimuth)])


def on_rays(radius, count):
    rings = round(np.sqrt(count / 2))
    rays = (count - 1) // rings
    rho = np.append(0.0, np.repeat(np.arange(1, rings + 1) / rings, rays)) * 0.97 * radius
    azimuth = np.append(0.0, np.tile(np.arange(rays) * 2 * np.pi / rays, rings))
    return np.column_stack([rho * np.sin(azimuth), rho * np.cos(azimuth)])


def triangles(plan, heights, grid):
    """Linear between the points; beyond them the height of the nearest."""
    found = LinearNDInterpolator(plan, heights)(grid)
    beyond = np.isnan(found)
    found[beyond] = NearestNDInterpolator(plan, heights)(grid[beyond])
    return found


def simulate(count, seed, sd=0.0015, declared=True):
    """Errors and u of rows and total (count, 5), and the total's error by triangles (count,)."""
    rng = np.random.default_rng(seed)
    errors, u, noise_only, k, by_triangles = [], [], [], [], []
    for run in range(count):
        radius = (6.5, 20.0)[run % 2]
        footprint = Footprint(0.0, 0.0, np.full(72, radius))
        grid, faces = footprint.mesh(36, 108)
        height = true_bottom(rng, radius, FORMS[run % 3])
        number = (30, 60, 100)[run // 6 % 3]
        plan = scattered(rng, radius, number) if run // 3 % 2 else on_rays(radius, number)
        heights = height(plan) + rng.normal(0, sd, len(plan))
        part = surveyed_bottom(
            footprint, np.column_stack([plan, heights]), sd if declared else None
        )
        true = surface(grid, faces, height(grid))
        levels = np.append(np.quantile(true.heights_m, WET), 10.0)
        volume, _ = true.volume_and_area(levels)
        errors.append(part.volume_m3(levels) + footprint.area_m2 * np.maximum(levels, 0) - volume)
        sources = part.sources(levels)
        each = np.column_stack([np.sqrt(np.sum(s.columns_m3**2, axis=1)) for s in sources])
        u.append(np.sqrt(np.sum(each**2, axis=1)))
        noise_only.append(each[:, 0])
        k.append(coverage_factor(0.95, effective_dof(each, [s.dof for s in sources])))
        weights = true.wet_weights(10.0)[0]
        by_triangles.append(weights @ (triangles(plan, heights, grid) - true.heights_m))
    return [np.array(one) for one in (errors, u, noise_only, k, by_triangles)]


def judge(figure, count, declared, tolerance):
    """Coverage of rows and total; tolerance in %, of so many simulated bottoms."""
    errors, u, noise_only, k, by_triangles = simulate(count, 11, declared=declared)
    covered = 100 * np.mean(np.abs(errors) <= k * u, axis=0)
    alone = 100 * np.mean(np.abs(errors) <= 1.96 * noise_only, axis=0)
    what = f"{count} surveyed bottoms, sd {'given' if declared else 'not given'}"
    rows = ", ".join(f"{100 * wet:.0f} %" for wet in WET)
    figure(f"{what}: covered at {rows} wet, total", np.array2string(covered, precision=1))
    figure(f"{what}: noise of the points alone covers", np.array2string(alone, precision=1))
    ratio = np.median(np.abs(by_triangles)) / np.median(np.abs(errors[:, -1]))
    figure(f"{what}: error of triangles over this", f"{ratio:.1f}")
    assert np.all(np.abs(covered[1:] - 95) < tolerance)
    assert covered[0] > 88 - tolerance  # the lowest puddles
    assert ratio > 2


@pytest.mark.slow
@pytest.mark.twentieth
def test_the_uncertainty_of_simulated_bottoms_holds(figure):
    judge(figure, 72, declared=True, tolerance=7)


@pytest.mark.study
@pytest.mark.parametrize("declared", [True, False])
def test_the_uncertainty_of_many_simulated_bottoms_holds(figure, declared):
    """Binomial standard error 1.5 % of 216 bottoms (of each sort the same number), 0.8 % of 720."""
    judge(figure, draws(216, 720), declared, tolerance=3)


ROUND = Footprint(3.0, 1.0, np.full(72, 6.5))


def points(height, count=40, seed=1):
    plan = scattered(np.random.default_rng(seed), 6.5, count)
    return np.column_stack([plan + (3.0, 1.0), height(plan)])


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    "height",
    [
        lambda plan: np.full(len(plan), 0.03),
        lambda plan: 0.02 + 0.004 * plan[:, 0] - 0.003 * plan[:, 1],
        lambda plan: -0.15 * (1 - np.hypot(*plan.T) / 6.5),
        lambda plan: 0.1 - 0.002 * (plan**2).sum(axis=1),
    ],
    ids=["level plate", "leaning plate", "cone", "dish"],
)
def test_simple_forms_are_reproduced_to_the_wall(height):
    """Property: they are in the trend. The dish is left to the chords of the mesh."""
    found = surveyed_surface(ROUND, points(height), 0.001)
    grid, _ = ROUND.mesh(48, 144)
    assert found.surface.heights_m == pytest.approx(height(grid), abs=1e-9)
    mean = found.surface.wet_weights(10.0)[0] @ height(grid) / ROUND.area_m2
    assert found.surface.volume_and_area([10.0])[0][0] == pytest.approx(
        (10 - mean) * ROUND.area_m2, rel=1e-12
    )


@pytest.mark.slow
def test_a_leaning_shell_slides_the_points_along_its_axis():
    """Property: the same points slid beforehand, upright."""
    sounded = points(lambda plan: 0.5 - 0.15 * np.hypot(*plan.T) / 6.5)
    slope = np.array([0.03, -0.02])
    slid = sounded - np.column_stack([np.outer(sounded[:, 2], slope), np.zeros(40)])
    one = surveyed_surface(ROUND, sounded, 0.001, slope)
    two = surveyed_surface(ROUND, slid, 0.001)
    assert one.surface.heights_m == pytest.approx(two.surface.heights_m, abs=1e-9)


def test_the_uncertainty_of_the_whole_second_method():
    """Universal kriging with an exponential covariance so long that it falls linearly."""
    rng = np.random.default_rng(2)
    sounded = points(true_bottom(rng, 6.5, "cone"))
    sounded[:, 2] += rng.normal(0, 0.002, 40)
    found = surveyed_surface(ROUND, sounded, 0.002)
    plan = sounded[:, :2] - (3.0, 1.0)
    grid, faces = ROUND.mesh(*COVARIANCE_MESH)
    weights = surface(grid, faces, np.zeros(len(grid))).wet_weights(1.0)[0]

    def covariance(a, b, length=1e5):
        return found.form_m2_per_m * length * np.exp(-cdist(a, b) / length)

    def trend(a):
        rho = np.hypot(*a.T)
        return np.column_stack([np.ones(len(a)), a, rho, rho**2])

    own = np.diag(np.full(40, 0.002**2 + found.waves_sd_m**2))
    cross = covariance(plan, grid) @ weights
    both = np.block(
        [[covariance(plan, plan) + own, trend(plan)], [trend(plan).T, np.zeros((5, 5))]]
    )
    right = np.append(cross, trend(grid).T @ weights)
    variance = weights @ covariance(grid, grid) @ weights - right @ np.linalg.solve(both, right)
    computed = np.sum(found.noise_m3[-1] ** 2) + np.sum(found.form_m3[-1] ** 2)
    assert np.sqrt(computed) == pytest.approx(np.sqrt(variance), rel=2e-3)


@pytest.mark.slow
def test_the_noise_is_estimated_where_none_is_given():
    """Simulation: noise of 4 mm on a cone, nothing else."""
    rng = np.random.default_rng(3)
    sounded = points(lambda plan: -0.15 * (1 - np.hypot(*plan.T) / 6.5), count=100)
    sounded[:, 2] += rng.normal(0, 0.004, 100)
    found = surveyed_surface(ROUND, sounded)
    assert found.waves_sd_m == pytest.approx(0.004, rel=0.25)
    assert (found.noise_dof, found.form_dof) == (95, 95)
    assert surveyed_surface(ROUND, sounded, 0.004).noise_dof == np.inf


def test_a_blunder_is_separated(figure):
    sounded = points(true_bottom(np.random.default_rng(4), 6.5, "cone"), count=60)
    sounded[17, 2] += 0.1
    w = np.abs(surveyed_surface(ROUND, sounded, 0.0015).w)
    figure("w of a point of the bottom that is 100 mm off", f"{w[17]:.1f}")
    assert np.argmax(w) == 17
    assert w[17] > 3.29 > np.sort(w)[-2]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda xyz: xyz[:11], "11 surveyed points of the bottom; expected 12 to 500"),
        (lambda xyz: xyz + [[8, 0, 0]], "outside the wall"),
        (lambda xyz: ring_of(xyz), "do not spread"),
        (lambda xyz: [*xyz[:39], [3.0, 1.0, np.nan]], "not finite"),
    ],
)
def test_points_that_cannot_tell_are_refused(change, words):
    with pytest.raises(SolutionError, match=words):
        surveyed_surface(ROUND, change(points(lambda plan: 0.01 * plan[:, 0])), 0.001)


def ring_of(xyz):
    """The same number of points on one circle."""
    azimuth = np.arange(len(xyz))
    return np.column_stack([3 + 5 * np.sin(azimuth), 1 + 5 * np.cos(azimuth), xyz[:, 2]])
