"""Blunders told by the field: second methods, and what is wall beside what is not."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from generated_walls import make_wall, survey
from test_field import RADIUS_M, sites_of

from tankcal.geometry.clutter import find_rings
from tankcal.geometry.field.amplitudes import assumed_amplitudes, likelihood_of
from tankcal.geometry.field.blunders import (
    Precision,
    find_blunders,
    judge_by_others,
    restricted_precision,
)
from tankcal.geometry.field.components import (
    COMPONENTS,
    azimuth_correlations,
    seam_correlation,
)
from tankcal.geometry.field.likelihood import LEAST_NOISE_M, MIRRORED, invert
from tankcal.geometry.field.sites import Covariances, Sites, free_design

STEP = 1e-4  # of a logarithm, in differences


def written_out(sites, variances_m2):
    """The covariance of all components at the sites, component by component."""
    along = azimuth_correlations(sites.azimuth_rad, sites.azimuth_rad, RADIUS_M)
    same = np.equal.outer(sites.course, sites.course)
    whole = np.zeros((len(sites), len(sites)))
    for one, size in zip(COMPONENTS, variances_m2, strict=True):
        if one.shape == "weld":
            peaks = np.array(
                [
                    [
                        seam_correlation(np.array([azimuth - weld]), RADIUS_M, 0.2)[0]
                        * (of == course)
                        for of, welds in enumerate(sites.welds_rad)
                        for weld in welds
                    ]
                    for azimuth, course in zip(sites.azimuth_rad, sites.course, strict=True)
                ]
            ).reshape(len(sites), -1)
            columns = peaks.sum(axis=1, keepdims=True) if one.common else peaks
            whole += size * columns @ columns.T
            continue
        part = size * along[one.shape] * one.height_covariance(sites.heights, sites.heights)
        whole += part if one.common else part * same
    return whole


def some_sites(seed=4, courses=3, points=9):
    sites = sites_of(courses, [-0.6, 0.1, 0.6], points, np.random.default_rng(seed))
    return replace(sites, welds_rad=(np.array([0.5, 3.0]), np.array([1.0]), np.array([2.0])))


def test_covariances_are_the_sum_of_the_components():
    """Second method: each component written out by itself."""
    sites = some_sites()
    variances = assumed_amplitudes().likely_m2
    total = Covariances(sites, RADIUS_M).total(variances)
    assert total == pytest.approx(written_out(sites, variances), rel=1e-9, abs=1e-15)


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("index", range(len(COMPONENTS)), ids=[one.name for one in COMPONENTS])
def test_the_spread_of_functionals_by_one_component(index):
    sites = some_sites()
    weights = np.random.default_rng(1).normal(size=(4, len(sites)))
    unit = np.eye(len(COMPONENTS))[index]
    expected = weights @ written_out(sites, unit) @ weights.T
    found = Covariances(sites, RADIUS_M).spread(weights, index)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("mixed", [False, True])
def test_the_likelihood_is_that_of_the_normal_distribution(mixed):
    """Second method: determinant and square of all readings, in what radii and centres leave free.

    Rings of the same azimuths, or each of its own, 0.6 m apart at least: nothing is approximate.
    """
    sites = replace(sites_of(3, [-0.6, 0.6], 12), welds_rad=3 * (np.array([0.5, 3.0]),))
    if mixed:
        places = np.random.default_rng(6).permutation(len(sites))
        sites = replace(sites, azimuth_rad=2 * np.pi * places / len(sites))
    radius = RADIUS_M + 0.004 * np.random.default_rng(2).normal(size=len(sites))
    evidence = likelihood_of(sites, radius, np.full(len(sites), 1e-6), RADIUS_M, False)
    whole = written_out(sites, np.exp(evidence.middle))
    whole += (1e-6 + LEAST_NOISE_M**2) * np.eye(len(sites))
    order = np.concatenate(sites.members)
    left = scipy.linalg.null_space(free_design(sites)[0][order].T)
    whole, free = left.T @ whole[np.ix_(order, order)] @ left, left.T @ radius[order]
    expected = np.linalg.slogdet(whole)[1] + free @ np.linalg.solve(whole, free)
    assert evidence.misfit(evidence.middle)[0] == pytest.approx(expected, rel=1e-7)


def test_the_likelihood_leaves_out_what_courses_share():
    """Second method: as above, with the constants of twelve lines among the unknowns.

    They are large against the walls, and no prior binds them: by how much the likelihoods of two
    sets of amplitudes differ does not hang on how wide they are taken.
    """
    sites = sites_of(3, [-0.6, 0.6], 12)
    lines = np.equal.outer(np.arange(len(sites)) % 12, range(12)).astype(float)
    ring = np.where(sites.ring == 0, -1, sites.ring)
    sites = replace(sites, ring=ring, shared=lines[:, 1:])  # the first holds the mean of all
    rng = np.random.default_rng(2)
    radius = RADIUS_M + 0.004 * rng.normal(size=len(sites)) + lines @ rng.normal(size=12)
    evidence = likelihood_of(sites, radius, np.full(len(sites), 1e-6), RADIUS_M, False)
    order = np.concatenate(sites.members)
    left = scipy.linalg.null_space(free_design(sites)[0][order].T)
    found, expected = [], []
    for logs in (evidence.middle, evidence.middle + rng.normal(size=len(evidence.middle))):
        whole = written_out(sites, np.exp(logs)) + (1e-6 + LEAST_NOISE_M**2) * np.eye(len(sites))
        whole, free = left.T @ whole[np.ix_(order, order)] @ left, left.T @ radius[order]
        expected.append(np.linalg.slogdet(whole)[1] + free @ np.linalg.solve(whole, free))
        away = logs - evidence.middle
        found.append(evidence.misfit(logs)[0] - away @ evidence.precision @ away)
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0], rel=2e-4)


def test_the_search_finds_the_very_top_and_its_curvature():
    """Second method: another kind of search from elsewhere, and differences of the slope."""
    sites = sites_of(3, [-0.6, 0.6], 12)
    radius = RADIUS_M + 0.004 * np.random.default_rng(2).normal(size=len(sites))
    evidence = likelihood_of(sites, radius, np.full(len(sites), 1e-6), RADIUS_M, True)
    best, covariance = evidence.top()
    options = {"method": "L-BFGS-B", "jac": True, "bounds": evidence.bounds}
    start = evidence.middle + 1.0
    other = scipy.optimize.minimize(evidence.misfit, start, options={"ftol": 1e-15}, **options)
    assert evidence.misfit(best)[0] <= other.fun + 1e-9
    assert best == pytest.approx(other.x, abs=2e-3)
    assert evidence.misfit(best)[1] == pytest.approx(np.zeros(len(best)), abs=1e-5)
    moves = STEP * np.eye(len(best))
    slopes = [[evidence.misfit(best + way * one)[1] for one in moves] for way in (-1, 1)]
    told = np.linalg.inv(np.subtract(*slopes[::-1]) / (4 * STEP))
    assert covariance == pytest.approx(told, rel=1e-4, abs=1e-5)
    near_by = evidence.top(best + 0.1)
    assert near_by[0] == pytest.approx(best, abs=1e-6)
    assert near_by[1] == pytest.approx(covariance, rel=1e-4, abs=1e-5)


@pytest.mark.slow(after=3)
@pytest.mark.parametrize("seed", [36, 37, 55, 58])
def test_the_search_goes_on_to_the_top(seed):
    """Begun beside it: on these walls steps that only became shorter ended on the way up."""
    rng = np.random.default_rng(seed)
    wall = make_wall(rng, "rough", radius_m=6.0, courses=5)
    one = survey(rng, wall, rings=3, points=12, noise_m=1e-3, layout="free")
    count = len(one.zeta)
    ring = np.repeat(np.arange(15), 12)
    sites = Sites(one.course, ring, one.zeta, one.azimuth_rad, np.zeros(count, dtype=bool))
    evidence = likelihood_of(sites, one.radius_m, np.full(count, 1e-6), 6.0, False)
    near_by = evidence.near_top()
    start = np.clip(near_by + rng.normal(size=len(near_by)), *evidence.bounds.T)
    best, _ = evidence.top(start)
    free = (best > evidence.bounds[:, 0]) & (best < evidence.bounds[:, 1])
    assert np.abs(evidence.misfit(best)[1][free]).max() < 1e-4


@pytest.mark.slow
def test_a_matrix_that_is_larger_than_a_piece_is_inverted_whole():
    columns = np.random.default_rng(1).normal(size=(3 * MIRRORED + 5, 300))
    covariance = columns @ columns.T
    root, inverse = invert(covariance)
    assert np.array_equal(inverse, inverse.T)
    assert inverse @ covariance == pytest.approx(np.eye(len(inverse)), abs=1e-9)
    assert root @ root.T == pytest.approx(covariance)


def test_a_course_of_three_points_tells_nothing(capfd):
    """Its radius and centre take them all; nothing is said of it on the screen, either."""
    sites = sites_of(2, [0.0], 3)
    radius = RADIUS_M + 0.004 * np.random.default_rng(2).normal(size=len(sites))
    likelihood = likelihood_of(sites, radius, np.full(len(sites), 1e-6), RADIUS_M, False)
    value, slopes = likelihood.misfit(likelihood.middle)
    assert (value, *slopes) == pytest.approx(np.zeros(1 + len(slopes)), abs=1e-12)
    assert capfd.readouterr() == ("", "")


def test_half_an_inverse_tests_as_the_whole_one():
    """Second method: P written out; of readings that alone tell a centre, too."""
    sites = some_sites()
    design, size = free_design(sites)[0], len(sites)
    whole = written_out(sites, assumed_amplitudes().likely_m2) + 1e-6 * np.eye(size)
    radius = 0.004 * np.random.default_rng(2).normal(size=size)
    other = restricted_precision(whole.copy(), design)
    half = Precision(whole.copy(), design)
    largest = np.abs(other).max()
    for gone in ([3, 40], [40, 2, 3], np.arange(size // 2)):  # columns asked for before, and new
        accepted = ~np.isin(np.arange(size), gone)
        assert half[:, gone] == pytest.approx(other[:, gone], abs=1e-9 * largest)
        assert half[np.ix_(gone, gone)] == pytest.approx(other[np.ix_(gone, gone)], rel=1e-6)
        one, two = (judge_by_others(each, each @ radius, accepted) for each in (half, other))
        assert one.w == pytest.approx(two.w, rel=1e-6, abs=1e-9)


def test_a_departure_is_from_the_wall_that_all_others_show():
    """Second method: each reading left out, and predicted by the others' own normal equations."""
    sites = some_sites()
    radius = RADIUS_M + 0.004 * np.random.default_rng(2).normal(size=len(sites))
    field = written_out(sites, assumed_amplitudes().likely_m2)
    whole = field + 1e-6 * np.eye(len(sites))
    design = free_design(sites)[0]
    accepted = np.ones(len(sites), dtype=bool)
    accepted[[3, 4, 40]] = False
    precision = restricted_precision(whole.copy(), design)
    found = judge_by_others(precision, precision @ (radius - RADIUS_M), accepted)
    for one in (0, 3, 4, 17, 40, 80):
        others = accepted.copy()
        others[one] = False
        system = np.block(
            [
                [whole[np.ix_(others, others)], design[others]],
                [design[others].T, np.zeros((design.shape[1],) * 2)],
            ]
        )
        right = np.concatenate([field[one, others], design[one]])
        weights = np.linalg.solve(system, right)
        departure = radius[one] - weights[: others.sum()] @ radius[others]
        variance = whole[one, one] - weights @ right
        assert found.departure_m[one] == pytest.approx(departure, rel=1e-7)
        assert found.w[one] == pytest.approx(departure / np.sqrt(variance), rel=1e-7)


def peaked(rng, alone):
    """Radii of walls with six welds per course that peak by 10 mm, at three rings or at one."""
    sites = sites_of(5, [-0.6, 0.0, 0.6], 24)
    radius = RADIUS_M + 1e-3 * rng.normal(size=len(sites))
    peak = np.zeros(len(sites), dtype=bool)
    for course in range(5):
        for place in rng.choice(24, 1 if alone else 6, replace=False):
            up = (sites.course == course) & np.isclose(
                sites.azimuth_rad, 2 * np.pi * place / 24, atol=1e-9
            )
            peak |= up & (sites.zeta == 0.0) if alone else up
    return sites, radius + 0.010 * peak, peak


@pytest.mark.slow
def test_peaks_at_welds_are_wall_and_a_point_alone_is_none():
    """What three rings agree on stays; the same 10 mm at one point of a smooth wall goes."""
    rng = np.random.default_rng(3)
    for alone in (False, True):
        sites, radius, peak = peaked(rng, alone)
        start = np.ones(len(sites), dtype=bool)
        found = find_blunders(sites, radius, np.full(len(sites), 1e-6), RADIUS_M, start)
        assert np.all(found.accepted[peak] != alone)
        assert np.sum(~found.accepted[~peak]) <= 2


def test_what_was_set_aside_comes_back_where_it_agrees():
    rng = np.random.default_rng(4)
    sites = sites_of(4, [-0.5, 0.5], 24)
    radius = RADIUS_M + 1e-3 * rng.normal(size=len(sites))
    radius[50] += 0.02
    start = np.ones(len(sites), dtype=bool)
    start[[3, 50, 100]] = False
    found = find_blunders(sites, radius, np.full(len(sites), 1e-6), RADIUS_M, start)
    assert list(np.flatnonzero(~found.accepted)) == [50]
    assert found.departure_m[50] == pytest.approx(0.02, abs=0.004)


@pytest.mark.parametrize("gone", [0, 1, 2])
def test_a_course_that_was_set_aside_is_tested_too(gone):
    """What is left tells the amplitudes; the course's own points agree and come back."""
    rng = np.random.default_rng(8)
    welds = tuple(np.array([place]) for place in (0.5, 1.0, 2.0))
    sites = replace(sites_of(3, [-0.5, 0.5], 12, rng), welds_rad=welds)
    radius = RADIUS_M + 1e-3 * rng.normal(size=len(sites))
    start = sites.course != gone
    left = sites.take(start)
    assert set(left.course) == {0, 1}
    assert left.welds_rad == tuple(one for i, one in enumerate(welds) if i != gone)
    found = find_blunders(sites, radius, np.full(len(sites), 1e-6), RADIUS_M, start)
    assert np.all(np.bincount(sites.course[found.accepted]) >= 23)


def test_points_of_a_course_that_was_set_aside_are_compared_with_each_other():
    """Invariance: its radius and the centres of its rings, which nothing tells, change nothing."""
    rng = np.random.default_rng(9)
    sites = sites_of(3, [-0.5, 0.5], 12, rng)
    gone = sites.course == 1
    covariance = Covariances(sites, RADIUS_M).total(assumed_amplitudes().likely_m2)
    covariance.flat[:: len(sites) + 1] += 1e-6
    precision = restricted_precision(covariance, free_design(sites)[0])
    radius = 1e-3 * rng.normal(size=len(sites))
    moved = radius + gone * (0.3 + 0.02 * np.sin(sites.azimuth_rad))
    found, other = (judge_by_others(precision, precision @ one, ~gone) for one in (radius, moved))
    assert other.departure_m == pytest.approx(found.departure_m, abs=1e-8)
    assert np.all(np.abs(found.w[gone]) < 4)
    assert np.all(found.sd_m[gone] < 0.01)


def test_rings_of_points_and_what_stands_between_them():
    even = 2 * np.pi * np.arange(12) / 12
    azimuth = np.concatenate([even, even, [1.0, 2.0]])
    zeta = np.concatenate([np.full(12, -0.5), np.full(12, 0.5), [-0.2, 0.9]])
    ring, leans = find_rings(np.zeros(26, dtype=int), zeta, azimuth)
    assert list(ring) == [0] * 12 + [1] * 12 + [0, 1]
    assert not leans.any()
    scattered = np.random.default_rng(1).uniform(-1, 1, 26)
    ring, leans = find_rings(np.repeat([0, 1], 13), scattered, azimuth)
    assert list(ring) == [0] * 13 + [1] * 13
    assert leans.all()
