"""Covariance of points that share causes: the same results as the written matrix."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

from tankcal.adjust import whitener
from tankcal.covariance import PointCovariance
from tankcal.errors import SolutionError
from tankcal.geometry.primitives import fit_cylinder, fit_sphere
from tankcal.pipeline.wall.surveyed import s_transform
from tankcal.sections import Group, circle_by_coordinates, fit_section, sample_of
from tankcal.survey.points import Points

COUNT, MANY, SHARED = 60, 500, 12


def points_of_wall(count):
    """Points of a wall, and their covariance: a block for each, and twelve shared errors."""
    rng = np.random.default_rng(52)
    azimuth, z = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 2, count)
    radius = 6.5 + 0.01 * np.cos(2 * azimuth) + rng.normal(0, 0.001, count)
    xyz = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z])
    roots = rng.normal(0, 0.001, (count, 3, 3))
    own = roots @ roots.transpose(0, 2, 1) + 1e-8 * np.eye(3)
    columns, root = rng.normal(0, 1, (3 * count, SHARED)), rng.normal(0, 3e-3, (SHARED, SHARED))
    return xyz, PointCovariance(own, columns, root @ root.T)


@pytest.fixture(scope="module")
def points():
    return points_of_wall(COUNT)


def sparse(covariance):
    """The same with sparse columns, and with more unknowns than a few points have coordinates."""
    empty = np.zeros((3 * COUNT, 40))
    more = covariance.add_columns(empty, np.eye(40))
    columns = scipy.sparse.csr_array(more.columns)
    return PointCovariance(more.independent, columns, more.cofactor)


@pytest.mark.parametrize("form", [lambda given: given, sparse])
def test_parts_and_functions_are_those_of_the_matrix(points, form):
    """Second method: the matrix, written out."""
    covariance, rng = form(points[1]), np.random.default_rng(1)
    whole = points[1].dense()
    size = np.abs(whole).max()
    np.testing.assert_allclose(covariance.dense(), whole, rtol=0, atol=1e-15 * size)
    np.testing.assert_allclose(covariance.diagonal(), np.diag(whole), rtol=1e-12)
    index = (3 * np.array([7, 3])[:, None] + np.arange(3)).ravel()
    some = covariance.take([7, 3])
    assert some.dense() == pytest.approx(whole[np.ix_(index, index)], rel=1e-12)
    by = rng.normal(0, 1, (4, 3 * COUNT))
    for given in (by, scipy.sparse.csr_array(by)):
        assert covariance.propagate(given) == pytest.approx(by @ whole @ by.T, rel=1e-11)
    np.testing.assert_allclose(covariance @ by.T, whole @ by.T, rtol=0, atol=1e-12 * size)
    rows = rng.normal(0, 1, (COUNT, 2, 3))
    of_rows = scipy.linalg.block_diag(*rows)
    expected = of_rows @ whole @ of_rows.T
    np.testing.assert_allclose(covariance.mapped(rows).dense(), expected, atol=1e-13 * size)
    assert covariance.point_blocks[5] == pytest.approx(whole[15:18, 15:18], rel=1e-12)


@pytest.mark.parametrize("form", [lambda given: given, sparse])
def test_whitened_rows_have_the_products_of_the_matrix(points, form):
    """Second method: x' C^-1 y by the Cholesky factor of the matrix; both directions."""
    unit = points[0] / np.linalg.norm(points[0], axis=1, keepdims=True)
    radial = form(points[1]).mapped(unit[:, None])
    x = np.random.default_rng(2).normal(0, 1, (COUNT, 3))
    found = whitener(radial)
    expected = x.T @ np.linalg.solve(radial.dense(), x)
    assert found(x).T @ found(x) == pytest.approx(expected, rel=1e-9)
    solved = found(found(x[:, 0]), transposed=True)
    assert x.T @ solved == pytest.approx(expected[:, 0], rel=1e-9)


@pytest.mark.slow
def test_a_wall_is_that_of_the_matrix():
    """Circle, outline, their derivatives and noise of 500 points to 1e-9, after S-transformation.

    Second method: the same fits with the matrix.
    """
    xyz, covariance = points_of_wall(MANY)
    fields = dict.fromkeys(("names", "section", "generatrix", "rows"), (None,) * MANY)
    surveyed = s_transform(Points(xyz_m=xyz, sd_m=None, covariance_m2=covariance, **fields))
    covariance = surveyed.covariance_m2
    group = Group("1", 0, 1.0, np.arange(MANY))
    answers = []
    for given in (covariance, covariance.dense()):
        arguments = group, xyz, given, (0.002, -0.001), 1.0
        section, sample = fit_section(*arguments, 1e-6), sample_of(*arguments)
        by = circle_by_coordinates(section, *arguments[1:])
        noise = sample.covariance_m2.dense()
        answers.append((section.circle.cofactor_m2, section.outline.parameters, by, noise,
                        section.outline.from_radii, section.circle.residuals_m))  # fmt: skip
    for left, right in zip(*answers, strict=True):
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-9 * np.abs(right).max())


@pytest.mark.slow
def test_solids_are_those_of_the_matrix():
    """Second method: sphere and cylinder by the same adjustment with the matrix."""
    xyz, covariance = points_of_wall(MANY)
    on_sphere = 5 * xyz / np.linalg.norm(xyz, axis=1, keepdims=True)
    for fit, places, name in (
        (fit_sphere, on_sphere, "cofactor_m2"),
        (fit_cylinder, xyz, "cofactor"),
    ):
        one, other = fit(places, covariance), fit(places, covariance.dense())
        assert one.radius_m == pytest.approx(other.radius_m, rel=1e-11)
        left, right = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-9 * np.abs(right).max())


def test_singular_covariances_get_a_micrometre_and_indefinite_ones_are_refused():
    """A point without errors of its own, and one whose shared part exceeds its own."""
    own = np.array([np.eye(3), np.zeros((3, 3))])
    singular = PointCovariance(own, np.ones((6, 1)), np.eye(1))
    added = singular.definite(1e-6).dense() - singular.dense()
    assert added == pytest.approx(1e-12 * np.eye(6), abs=1e-15)
    sound = PointCovariance(own + np.eye(3), np.ones((6, 1)), np.eye(1))
    assert sound.definite(1e-6) is sound
    with pytest.raises(SolutionError, match="not positive definite"):
        whitener(PointCovariance(np.ones((4, 1, 1)), np.ones((4, 1)), -np.eye(1)))
