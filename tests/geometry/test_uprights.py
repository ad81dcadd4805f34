"""Columns of accepted readings as one hypothesis: second methods, pipes that go, form that stays.

Truth: `generated_seams` and `generated_walls`, whose shapes hold no criterion of the package.
"""

import numpy as np
import pytest
import scipy.linalg
from generated_seams import Pipe, put_before, wall_of
from generated_walls import FULL_TURN, survey
from test_columns import judged
from test_field import RADIUS_M, sites_of

from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.geometry.field.blunders import (
    _eliminate,
    _jump,
    find_blunders,
    find_uprights,
    restricted_precision,
)
from tankcal.geometry.field.sites import Covariances, free_design
from tankcal.geometry.shell import UNDECIDED

POINTS, NOISE_M = 24, 1e-3


def test_the_jump_is_an_unknown_more_in_the_adjustment():
    """Second method: generalised least squares with the jump as a column of the design."""
    rng, sites = np.random.default_rng(2), sites_of(3, [-0.5, 0.5], 12)
    covariance = Covariances(sites, RADIUS_M).total(assumed_amplitudes().likely_m2)
    covariance.flat[:: len(sites) + 1] += NOISE_M**2
    column = np.flatnonzero(np.isclose(sites.azimuth_rad, FULL_TURN / 4))
    aside, design = np.array([0, 7]), free_design(sites)[0]
    reading = rng.multivariate_normal(np.zeros(len(sites)), covariance)
    precision = restricted_precision(covariance, design)
    found = _jump(*_eliminate(precision, precision @ reading, aside), column)

    kept = np.delete(np.arange(len(sites)), aside)
    more = np.column_stack([design, np.isin(np.arange(len(sites)), column)])[kept].astype(float)
    root = scipy.linalg.cholesky(covariance[np.ix_(kept, kept)], lower=True)
    white, y = (
        scipy.linalg.solve_triangular(root, one, lower=True) for one in (more, reading[kept])
    )
    normal = white.T @ white
    size, sd = np.linalg.solve(normal, white.T @ y)[-1], np.linalg.inv(normal)[-1, -1] ** 0.5
    assert found.size_m == pytest.approx(size, rel=1e-6)
    assert found.w == pytest.approx(size / sd, rel=1e-6)


def marked(off_m, *, sure=False, seed=1, wavy_m=0.0, scatter_m=NOISE_M):
    """Marks of readings of rings of 24, two in each of 6 courses, and off_m(sites) on the wall."""
    rng, sites = np.random.default_rng(seed), sites_of(6, [-0.5, 0.5], POINTS)
    off = off_m(sites)
    radius = RADIUS_M + off + NOISE_M * rng.normal(size=len(sites))
    radius += sum(wavy_m / k * np.cos(k * sites.azimuth_rad + k) for k in range(2, 9))
    given = sites, radius, np.full(len(sites), NOISE_M**2), RADIUS_M
    tested = find_blunders(*given, np.ones(len(sites), dtype=bool))
    return find_uprights(*given, tested, np.full(len(sites), sure), scatter_m), off != 0


def at(*places):
    """Function of sites: whether they stand on one of these columns."""
    return lambda sites: np.isin(np.round(sites.azimuth_rad / FULL_TURN * POINTS), places)


@pytest.mark.slow
@pytest.mark.parametrize("off_m", [-0.08, -0.04, 0.06])
def test_a_column_that_stands_off_alone_is_marked(off_m):
    found, off = marked(lambda sites: off_m * at(5)(sites))
    assert np.array_equal(found, off)


def test_a_column_that_is_known_to_be_wall_is_not():
    assert not np.any(marked(lambda sites: -0.06 * at(5)(sites), sure=True)[0])


def test_a_jump_that_the_scatter_explains_is_not():
    assert not np.any(marked(lambda sites: -0.04 * at(5)(sites), scatter_m=0.01)[0])


FORMS = {
    "a seam of 15 mm": lambda sites: -0.015 * at(5)(sites),
    "a buckle of one course": lambda sites: -0.06 * (at(5)(sites) & (sites.course == 2)),
    "a valley of three columns": lambda sites: -0.03 * (at(4, 6)(sites) + 2.0 * at(5)(sites)),
    "seams on every third column": lambda sites: -0.04 * at(*range(0, POINTS, 3))(sites),
}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", FORMS)
def test_form_is_not_marked(form):
    assert not np.any(marked(FORMS[form])[0])


@pytest.mark.slow
def test_waves_of_a_tenth_of_a_metre_are_not_marked():
    assert not np.any(marked(lambda sites: np.zeros(len(sites)), wavy_m=0.1)[0])


def with_pipes(rng, wall, *, points, rings, off_m, count):
    """A survey whose columns meet pipes in every ring."""
    measured = survey(rng, wall, rings=rings, points=points, noise_m=NOISE_M)
    places = np.unique(measured.azimuth_rad)[5 + 8 * np.arange(count)]
    pipes = [Pipe(one, off_m - 0.03, 0.03) for one in places]
    return put_before(rng, measured, wall, pipes, inside=True)


@pytest.mark.slow
@pytest.mark.parametrize("far", [True, False])
def test_pipes_of_every_ring_are_within_u(far, tmp_path, figure):
    """Before, all were kept: of 100 mm 1338 ppm too small, U 1239; of 60 mm 784 and 785."""
    wall, rng = wall_of([], radius_m=12.0), np.random.default_rng(3)
    off_m = 0.1 if far else 0.06
    measured, hit = with_pipes(rng, wall, points=POINTS, rings=2, off_m=off_m, count=2)
    off, expanded, reason = judged(wall, measured, tmp_path)
    figure(f"two pipes of {1000 * off_m:.0f} mm: ppm off, U", f"{off:.0f} {expanded:.0f}")
    assert np.all(reason[hit] == ("snooping" if far else UNDECIDED))
    assert abs(off) < expanded
