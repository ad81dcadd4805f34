"""Correlated observations, held against a dense adjustment with the full covariance matrix.

Second method: least squares in numpy with P = Q^-1, tests by Baarda's general form
w = e'Pv / sqrt(e'P Qvv P e), and the equivalent adjustment with a bias unknown for what is tested.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from tankcal.adjust import CRITICAL, noncentrality
from tankcal.survey.network import Survey, adjust
from tankcal.survey.network.reliability import alternatives
from tankcal.survey.observations import (
    Block,
    ControlCoordinates,
    Distances,
    HeightDifferences,
    Vectors,
)

PLACES = np.array([[0, 0, 0], [900, 100, 20], [400, 800, -10], [1300, 900, 5.0]])
LINES = np.array([(0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (0, 3)])


def covariance_of(rng, n, sd):
    """A covariance (n, n) with correlations of about 0.5 between all."""
    root = rng.normal(size=(n, n)) + 1.5
    found = root @ root.T + n * np.eye(n)
    size = np.sqrt(np.diag(found))
    return sd**2 * found / np.outer(size, size)


@pytest.fixture(scope="module")
def network():
    """A Survey with correlated vectors, control, and a distance that goes with two levels."""
    rng = np.random.default_rng(5)
    start, end = LINES.T
    control = np.repeat([0, 3], 3), np.tile([0, 1, 2], 2)
    sizes = 18, 6, 3
    covariances = [
        covariance_of(rng, n, sd) for n, sd in zip(sizes, (4e-3, 6e-3, 2e-3), strict=True)
    ]
    noise = [np.linalg.cholesky(q) @ rng.normal(size=len(q)) for q in covariances]
    vectors = (PLACES[end] - PLACES[start]) + noise[0].reshape(-1, 3)
    sds = [np.sqrt(np.diag(q)) for q in covariances]
    levels = np.array([[0, 2], [1, 3]])
    rise = PLACES[levels[:, 1], 2] - PLACES[levels[:, 0], 2] + noise[2][:2]
    length = np.linalg.norm(PLACES[3] - PLACES[2]) + noise[2][2:]
    observations = (
        Vectors(vectors, sds[0].reshape(-1, 3), start, end),
        ControlCoordinates(PLACES[control] + noise[1], sds[1], *control),
        HeightDifferences(rise, sds[2][:2], *levels.T),
        Distances(length, sds[2][2:], np.array([2]), np.array([3]), instrument=np.array([-1])),
    )
    blocks = (
        Block(np.zeros(18, int), np.repeat(np.arange(6), 3), np.tile([0, 1, 2], 6), covariances[0]),
        Block(np.ones(6, int), np.arange(6), np.zeros(6, int), covariances[1]),
        Block(np.array([2, 2, 3]), np.array([0, 1, 0]), np.zeros(3, int), covariances[2]),
    )
    survey = Survey(("A", "B", "C", "D"), PLACES + 0.05, observations=observations,
                    correlated=blocks)  # fmt: skip
    return survey, covariances


def dense(survey, covariances, bias=None):
    """x (12,), its cofactors, residuals, P and design of all rows, by Gauss-Newton in numpy.

    bias  (rows, q) further columns: unknown biases of some rows
    """
    q = np.zeros((27, 27))
    first = 0
    for one in covariances:
        q[first : first + len(one), first : first + len(one)] = one
        first += len(one)
    p = np.linalg.inv(q)
    vectors, control, levels, distance = survey.observations
    x = survey.xyz_m.ravel().copy()
    extra = np.zeros((27, 0)) if bias is None else bias
    biases = np.zeros(extra.shape[1])
    for _ in range(10):
        xyz = x.reshape(4, 3)
        a = np.zeros((27, 12))
        for i, (s, e) in enumerate(LINES):
            for k in range(3):
                a[3 * i + k, 3 * e + k], a[3 * i + k, 3 * s + k] = 1, -1
        for i, (point, axis) in enumerate(zip(control.point, control.axis, strict=True)):
            a[18 + i, 3 * point + axis] = 1
        for i, (s, e) in enumerate(zip(levels.start, levels.end, strict=True)):
            a[24 + i, 3 * e + 2], a[24 + i, 3 * s + 2] = 1, -1
        d = xyz[3] - xyz[2]
        a[26, 9:12], a[26, 6:9] = d / np.linalg.norm(d), -d / np.linalg.norm(d)
        computed = np.concatenate([
            (xyz[LINES[:, 1]] - xyz[LINES[:, 0]]).ravel(), xyz[control.point, control.axis],
            xyz[levels.end, 2] - xyz[levels.start, 2], [np.linalg.norm(d)],
        ])  # fmt: skip
        observed = np.concatenate([vectors.value.ravel(), control.value, levels.value,
                                   distance.value])  # fmt: skip
        v = computed + extra @ biases - observed
        both = np.hstack([a, extra])
        cofactors = np.linalg.inv(both.T @ p @ both)
        step = -cofactors @ both.T @ p @ v
        x, biases = x + step[:12], biases + step[12:]
    return x, cofactors, v, p, both, biases


def values_of(adjusted, name):
    """(27,) of a field of the residuals, in the order of `dense`."""
    found = {table.source: getattr(table, name) for table in adjusted.residuals}
    return np.concatenate([found[source].ravel() for source in range(4)])


def test_unknowns_and_cofactors(network):
    survey, covariances = network
    adjusted = adjust(survey, tolerance=1e-6)
    x, cofactors, v, p, _, _ = dense(survey, covariances)
    np.testing.assert_allclose(adjusted.xyz_m.ravel(), x, atol=1e-9)
    np.testing.assert_allclose(adjusted.covariance_m2(), cofactors, rtol=1e-7, atol=1e-14)
    assert adjusted.chi2 == pytest.approx(v @ p @ v, rel=1e-8)
    assert adjusted.dof == 27 - 12


def test_reliability_in_the_general_form(network):
    """w and MDB by P, redundancy numbers by Qvv P, effects of an MDB on the coordinates."""
    survey, covariances = network
    adjusted = adjust(survey, tolerance=1e-6)
    _, cofactors, v, p, a, _ = dense(survey, covariances)
    qvv = np.linalg.inv(p) - a @ cofactors @ a.T
    free = np.diag(p @ qvv @ p)
    np.testing.assert_allclose(values_of(adjusted, "residual"), v, atol=1e-9)
    np.testing.assert_allclose(values_of(adjusted, "w"), p @ v / np.sqrt(free), rtol=1e-5)
    np.testing.assert_allclose(values_of(adjusted, "redundancy"), np.diag(qvv @ p), rtol=1e-6)
    np.testing.assert_allclose(values_of(adjusted, "part_of_chi2"), v * (p @ v), atol=1e-7)
    mdb = noncentrality() / np.sqrt(free)
    np.testing.assert_allclose(values_of(adjusted, "mdb"), mdb, rtol=1e-6)
    moves = np.abs(cofactors @ a.T @ p * mdb).max(axis=0)
    np.testing.assert_allclose(values_of(adjusted, "effect_m"), moves, rtol=1e-6)


def test_setting_aside_equals_a_bias_unknown(network):
    """A whole vector rejected: the result of an adjustment with three biases, and their test."""
    survey, covariances = network
    use = np.ones(6)
    use[4] = 0.0
    thinner = (survey.observations[0].using(use), *survey.observations[1:])
    adjusted = adjust(replace(survey, observations=thinner), tolerance=1e-6)
    bias = np.zeros((27, 3))
    bias[12:15] = np.eye(3)
    x, cofactors, v, p, _, biases = dense(survey, covariances, bias)
    np.testing.assert_allclose(adjusted.xyz_m.ravel(), x, atol=1e-9)
    assert adjusted.chi2 == pytest.approx(v @ p @ v, rel=1e-8)
    table = next(one for one in adjusted.residuals if one.source == 0 and len(one.rows))
    sds = np.sqrt(np.diag(cofactors)[12:])
    np.testing.assert_allclose(table.w[4], -biases / sds, rtol=1e-5)
    assert not table.used[4]
    square = biases @ np.linalg.inv(cofactors[12:, 12:]) @ biases
    assert table.test_statistic[4] == pytest.approx(
        np.sqrt(square) * 3.2905267 / np.sqrt(16.26624), rel=1e-5
    )


def test_without_correlations_nothing_changes(network):
    """A block whose covariance is diagonal gives what the same values give one by one."""
    survey, _ = network
    blocks = tuple(replace(one, covariance=np.diag(np.diag(one.covariance)))
                   for one in survey.correlated)  # fmt: skip
    one, other = (adjust(replace(survey, correlated=b), tolerance=1e-6) for b in (blocks, ()))
    np.testing.assert_allclose(one.xyz_m, other.xyz_m, atol=1e-9)
    for name in ("residual", "sd", "redundancy", "w", "mdb", "external", "effect_m"):
        np.testing.assert_allclose(
            values_of(one, name), values_of(other, name), rtol=1e-5, atol=1e-9
        )


ROWS = {
    **{(0, i): range(3 * i, 3 * i + 3) for i in range(6)},
    **{(1, i): range(18 + i, 19 + i) for i in range(6)},
    **{(2, i): range(24 + i, 25 + i) for i in range(2)},
    (3, 0): range(26, 27),
}


def test_single_vector_of_a_block_is_tested_when_set_aside(network):
    """Nothing of its block takes part; what the others say of it is told all the same."""
    survey, covariances = network
    q = covariances[0].copy()
    q[12:15, :12] = q[12:15, 15:] = q[:12, 12:15] = q[15:, 12:15] = 0.0
    rest = np.r_[:12, 15:18]
    first = survey.correlated[0]
    blocks = (
        Block(*(part[rest] for part in (first.source, first.row, first.component)),
              q[np.ix_(rest, rest)]),
        Block(*(part[12:15] for part in (first.source, first.row, first.component)),
              q[12:15, 12:15]),
        *survey.correlated[1:],
    )  # fmt: skip
    use = np.ones(6)
    use[4] = 0.0
    thinner = (survey.observations[0].using(use), *survey.observations[1:])
    adjusted = adjust(replace(survey, observations=thinner, correlated=blocks), tolerance=1e-6)
    bias = np.zeros((27, 3))
    bias[12:15] = np.eye(3)
    _, cofactors, _, _, _, biases = dense(survey, (q, *covariances[1:]), bias)
    table = next(one for one in adjusted.residuals if one.source == 0 and 4 in one.rows)
    sds = np.sqrt(np.diag(cofactors)[12:])
    np.testing.assert_allclose(table.w[0], -biases / sds, rtol=1e-5)
    np.testing.assert_allclose(table.residual[0], -biases, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True], ids=["all correlated", "levels are not"])
@pytest.mark.parametrize(("wrong", "size"), [((0, 4), 0.04), ((1, 2), 0.08), ((2, 1), 0.02)])
def test_readings_that_may_be_wrong_instead(network, single, wrong, size):
    """Second method: of an observation and of another one biases are estimated, in all pairs.

    The other one may be wrong instead where its own biases are significant, and those of the first
    one are not beside them. Counts of values are differences of ranks.
    """
    survey, covariances = network
    covariances = [one.copy() for one in covariances]
    blocks = survey.correlated
    if single:
        covariances[2], blocks = np.diag(np.diag(covariances[2])), blocks[:2]
    observations = list(survey.observations)
    value = observations[wrong[0]].value.copy()
    value[wrong[1]] += size
    observations[wrong[0]] = replace(observations[wrong[0]], value=value)
    survey = replace(survey, observations=tuple(observations), correlated=blocks)
    _, _, v, p, a, _ = dense(survey, covariances)
    root = np.linalg.cholesky(p).T

    def chi2(*biases):
        both = np.hstack([a, *(np.eye(27)[:, ROWS[one]] for one in biases)])
        rest = v - both @ np.linalg.lstsq(root @ both, root @ v, rcond=1e-9)[0]
        return rest @ p @ rest, np.linalg.matrix_rank(root @ both, tol=1e-6)

    def significant(one, *beside):
        (before, less), (after, more) = chi2(*beside), chi2(*beside, one)
        limit = 0.0 if more == less else CRITICAL**2 if more == less + 1 else chdtri(
            more - less, 0.001)  # fmt: skip
        return before - after > limit + 1e-6

    named = others = 0
    for source, row in ROWS:
        use = np.ones(len(observations[source]))
        use[row] = 0.0
        thinner = list(observations)
        thinner[source] = thinner[source].using(use)
        adjusted = adjust(replace(survey, observations=tuple(thinner)), tolerance=1e-6)
        found = set(alternatives(adjusted, source, row))
        expected = {
            one
            for one in ROWS
            if one != (source, row) and significant(one) and not significant((source, row), one)
        }
        assert found == expected, (source, row)
        named, others = named + len(found), others + len(ROWS) - 1 - len(found)
    assert named
    assert others
