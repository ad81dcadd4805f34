"""Sequential estimation against generalised least squares with the full covariance.

Kind of truth: a second method, and closed forms of section 16 of the specification.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from tankcal.products.upkeep.filtering import (
    Drift,
    add_rows,
    smooth_steps,
    start_triangle,
    total_innovations,
    whiten_steps,
)
from tankcal.tank.liquid import Effect, adjust_steps

DAY_S, YEAR_S = 86400.0, 365.25 * 86400


def random_drift(rng, steps, meters=3):
    return Drift(
        seconds=rng.uniform(3600, 4e4, steps),
        area_m2=rng.uniform(5, 15, steps + 1),
        by_degree_m3=0.01 * rng.normal(size=steps + 1),
        metered_m3=rng.uniform(0, 1, (steps, meters)),
        level_sd_m=rng.uniform(1e-4, 3e-4, steps + 1),
        layer_sd_k=np.where(rng.random(steps) < 0.2, 0.4, 0.0),
        noise_m3=np.full(steps, 1e-4),
        is_used=rng.random(steps) < 0.95,
        wander_sd_m=3e-4,
        wander_s=5 * DAY_S,
        layer_s=0.5 * DAY_S,
        walk_per_s=np.full(meters, (5e-4) ** 2 / YEAR_S),
    )


def marks_to_steps(values, sign):
    """(n, m) matrix of the values at both marks of each step."""
    steps = len(values) - 1
    matrix = np.zeros((steps, steps + 1))
    rows = np.arange(steps)
    matrix[rows, rows], matrix[rows, rows + 1] = -sign * values[:-1], sign * values[1:]
    return matrix


def written_out(drift):
    """Covariance of the steps and of (levels, wander, layers) with them, from their definition."""
    time = np.append(0.0, np.cumsum(drift.seconds))
    lag = np.abs(time[:, None] - time)
    wander = drift.wander_sd_m**2 * np.exp(-lag / drift.wander_s)
    begins = (time[:, None] >= time[1:]) * drift.layer_sd_k
    layers = begins * np.exp(-np.abs(time[:, None] - time[1:]) / drift.layer_s)
    by_level = marks_to_steps(drift.area_m2, -1.0)
    by_degree = marks_to_steps(drift.by_degree_m3, 1.0)
    own = np.diag(drift.level_sd_m**2)
    covariance = by_level @ (wander + own) @ by_level.T + np.diag(drift.noise_m3**2)
    covariance += by_degree @ layers @ layers.T @ by_degree.T
    for metered, walk in zip(drift.metered_m3.T, drift.walk_per_s, strict=True):
        covariance += walk * np.outer(metered, metered) * np.minimum.outer(time[1:], time[1:])
    states = own @ by_level.T, wander @ by_level.T, layers @ layers.T @ by_degree.T
    return covariance, states


@pytest.fixture(scope="module")
def case():
    rng = np.random.default_rng(1)
    drift = random_drift(rng, 500)
    data = 1e-3 * rng.normal(size=(500, 13))
    return drift, data


@pytest.mark.slow
def test_filter_equals_least_squares(case):
    """Whitened rows, estimates, covariance, chi-square and innovations, 500 steps."""
    drift, data = case
    used = drift.is_used
    covariance, _ = written_out(drift)
    covariance, y, columns = covariance[np.ix_(used, used)], data[used, 0], data[used, 1:]
    lower = np.linalg.cholesky(covariance)
    white = whiten_steps(drift, data).rows
    assert_allclose(white[used], scipy.linalg.solve_triangular(lower, data[used], lower=True),
                    atol=1e-9)  # fmt: skip
    triangle = add_rows(start_triangle(12), white, used)
    information = columns.T @ np.linalg.solve(covariance, columns) + np.eye(12)
    x = np.linalg.solve(information, columns.T @ np.linalg.solve(covariance, y))
    assert_allclose(triangle.estimate, x, atol=1e-9)
    assert_allclose(triangle.root @ triangle.root.T, np.linalg.inv(information), atol=1e-9)
    chi2 = y @ np.linalg.solve(covariance, y) - x @ information @ x
    assert triangle.chi2 == pytest.approx(chi2, abs=1e-9)
    total = np.linalg.cholesky(covariance + columns @ columns.T)
    for block in (7, 100):
        innovations = total_innovations(white, used, block=block)[used, 0]
        assert_allclose(innovations, scipy.linalg.solve_triangular(total, y, lower=True), atol=1e-9)


@pytest.mark.slow
def test_filter_equals_adjusted_steps(case):
    """The adjustment of metered runs, with the same columns."""
    drift, data = case
    drift = replace(drift, is_used=np.full(500, True))
    covariance, _ = written_out(drift)
    lower = np.linalg.cholesky(covariance)
    adjusted = adjust_steps(data[:, 0], [Effect("own", lower)], [Effect("geometry", data[:, 1:])])
    triangle = add_rows(start_triangle(12), whiten_steps(drift, data).rows, drift.is_used)
    assert_allclose(triangle.estimate, adjusted.estimate, atol=1e-9)
    assert_allclose(np.linalg.norm(triangle.root, axis=1), adjusted.sd, atol=1e-9)
    assert triangle.chi2 == pytest.approx(adjusted.chi2, rel=1e-9)


def test_smoothed_marks_are_those_of_all_steps(case):
    drift, data = case
    used = drift.is_used
    covariance, states = written_out(drift)
    pull = np.linalg.solve(covariance[np.ix_(used, used)], data[used, 0])
    smoothed = smooth_steps(drift, data[:, 0], whiten_steps(drift, data))
    for found, by_step in zip(smoothed.T, states, strict=True):
        assert_allclose(found, by_step[:, used] @ pull, atol=1e-12)


@pytest.mark.parametrize("cuts", [[100], [1, 2, 250, 499]])
def test_months_add_to_the_whole(case, cuts):
    """Saved state and triangle of each part, in any division, to 1e-12."""
    drift, data = case
    whole = add_rows(start_triangle(12), whiten_steps(drift, data).rows, drift.is_used)
    state, triangle = None, start_triangle(12)
    for first, last in zip([0, *cuts], [*cuts, 500], strict=True):
        part = whiten_steps(drift.part(first, last), data[first:last], state)
        state = part.end
        triangle = add_rows(triangle, part.rows, drift.is_used[first:last])
    assert_allclose(triangle.estimate, whole.estimate, atol=1e-12)
    assert_allclose(triangle.chi2, whole.chi2, rtol=1e-12)


def plain_drift(steps, **values):
    """Drift of steps without any cause but those given."""
    zeros, marks = np.zeros(steps), np.zeros(steps + 1)
    base = {
        "seconds": np.full(steps, 3600.0), "area_m2": marks, "by_degree_m3": marks,
        "metered_m3": np.zeros((steps, 1)), "level_sd_m": marks, "layer_sd_k": zeros,
        "noise_m3": zeros, "is_used": np.full(steps, True), "wander_sd_m": 0.0,
        "wander_s": DAY_S, "layer_s": DAY_S, "walk_per_s": np.zeros(1),
    }  # fmt: skip
    return Drift(**(base | values))


def estimate_scale(meter, noise):
    """u of the scale (200 ppm before) and of a meter in ppm, and their correlation; 100 steps."""
    columns = np.tile([200e-6, -meter * 1e-6], (100, 1))
    drift = plain_drift(100, noise_m3=np.full(100, noise))
    rows = whiten_steps(drift, np.column_stack([np.zeros(100), columns])).rows
    root = np.array([[200], [meter]]) * add_rows(start_triangle(2), rows, drift.is_used).root
    u = np.linalg.norm(root, axis=1)
    return *u, root[0] @ root[1] / u[0] / u[1], np.linalg.norm(root[0] - root[1])


def test_scale_and_meter():
    """Closed form: scale 200, meter 300 ppm, 100 steps of 1 m3 with 500 ppm, and without end."""
    scale, meter, correlation, difference = estimate_scale(300, 500e-6)
    assert (scale, meter) == (pytest.approx(167.11, abs=5e-3), pytest.approx(169.91, abs=5e-3))
    assert correlation == pytest.approx(0.9569, abs=5e-5)
    assert difference == pytest.approx(49.53, abs=5e-3)
    assert estimate_scale(300, 1e-9)[0] == pytest.approx(166.41, abs=5e-3)
    assert estimate_scale(30, 1e-9)[0] == pytest.approx(29.67, abs=5e-3)


@pytest.mark.parametrize(("nights", "expected"), [(1, 0.484), (10, 0.153), (30, 0.088)])
def test_leak_by_nights(nights, expected):
    """Closed form: nights of 5 h with dips of their own, 14.25 m2, 0.12 mm."""
    steps = 2 * nights - 1
    seconds = np.full(steps, 5 * 3600.0)
    is_used = np.arange(steps) % 2 == 0
    drift = plain_drift(
        steps, seconds=seconds, area_m2=np.full(steps + 1, 14.25),
        level_sd_m=np.full(steps + 1, 0.12e-3), is_used=is_used,
    )  # fmt: skip
    rows = whiten_steps(drift, np.column_stack([np.zeros(steps), seconds / 3.6e6])).rows
    assert 1 / np.linalg.norm(rows[is_used, 1]) == pytest.approx(expected, abs=5e-4)


def test_leak_in_a_chain_of_shared_dips():
    """Thirty steps of a chain weigh as one of 150 h: 0.0069 L/h is their leak, not 0.088."""
    seconds = np.full(30, 5 * 3600.0)
    drift = plain_drift(
        30, seconds=seconds, area_m2=np.full(31, 14.25), level_sd_m=np.full(31, 0.12e-3)
    )
    rows = whiten_steps(drift, np.column_stack([np.zeros(30), seconds / 3.6e6])).rows
    # Linear trend of 31 independent dips: sd = s sqrt(12 / (m (m^2 - 1))) per 5 h.
    expected = 0.12e-3 * 14.25 * np.sqrt(12 / (31 * (31**2 - 1))) / 5 * 1000
    assert 1 / np.linalg.norm(rows[:, 1]) == pytest.approx(expected, rel=1e-9)
    assert expected == pytest.approx(0.0069, abs=5e-5)


@pytest.mark.parametrize(("days", "mean", "end"), [(30, 82.8, 143.3), (365, 288.7, 500.0)])
def test_walk_of_a_meter(days, mean, end):
    """Closed form: a walk of 500 ppm per root of a year, its mean and its end."""
    steps = (24 if days == 30 else 2) * days
    seconds = np.full(steps, days * DAY_S / steps)
    walk = np.array([(500e-6) ** 2 / (365 * DAY_S)])
    drift = plain_drift(steps, seconds=seconds, metered_m3=np.ones((steps, 1)), walk_per_s=walk,
                        noise_m3=np.full(steps, 1e-12))  # fmt: skip
    state = whiten_steps(replace(drift, is_used=np.zeros(steps, dtype=bool)),
                         np.zeros((steps, 1))).end  # fmt: skip
    assert 1e6 * np.sqrt(state.covariance[-1, -1]) == pytest.approx(end, abs=0.1)
    # The variance of the sum follows from the whitened rows: 1' L L' 1 with L^-1 the rows.
    white = whiten_steps(drift, np.column_stack([np.zeros(steps), np.eye(steps)])).rows[:, 1:]
    total = scipy.linalg.solve_triangular(white, np.eye(steps), lower=True).sum(axis=0)
    # Steps of half a day are 0.1 % longer in the mean than a continuous walk.
    assert 1e6 * np.linalg.norm(total) / steps == pytest.approx(mean, rel=2e-3)
