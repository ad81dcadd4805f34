"""Principal components of a camera's parameters (ANALISE), and Silva's rule for dropping some."""

import itertools
import json

import numpy as np
import pytest

from tankcal.calibration.parameters.judgement import components, drop_parameters
from tankcal.calibration.parameters.recommendation import silva_rule

# the labels printed with the tables are one place off from the fourth on; this is the true order
NAMES = ("c", "x0", "y0", "A", "K1", "K2", "K3", "P1", "P2", "B")
OF_TABLE_3 = ("c", "x0", "y0", "A", "K1", "K2", "P2", "B")
NAMES_OF = {"T2": NAMES, "T3": OF_TABLE_3}


@pytest.fixture(scope="module")
def published(shared):
    """Silva's tables 2 and 3: correlations of two decimals and what ANALISE made of them."""
    return json.loads((shared / "facts" / "silva_T02_T03_pca.json").read_text(encoding="utf-8"))


def random_covariance(seed, n=6):
    """A covariance (n, n) of parameters whose units differ by many powers of ten."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, 2 * n))
    return np.outer(*2 * [10.0 ** -np.arange(0, 3 * n, 3)]) * (a @ a.T)


@pytest.mark.parametrize("table", ["T2", "T3"])
def test_published_eigenvalues_shares_and_loadings(published, table, figure):
    """Published: S tables 2 and 3, from correlations of two decimals: 0.01; loadings 0.06."""
    given = published[table]
    found = components(NAMES_OF[table], np.array(given["R"]))
    assert found.positive_definite
    off = np.abs(found.eigenvalues - given["variance"]).max()
    loadings = np.array(given["MCCP"])
    if table == "T2":
        loadings[0, 5] = -0.66  # printed -0.61: loadings of a row are of length 1
    away = np.abs(np.abs(found.loadings) - np.abs(loadings)).max()
    same = found.loadings * np.sign(np.sum(found.loadings * loadings, axis=0)) - loadings
    figure(f"S {table}: eigenvalues, loadings off by at most", f"{off:.4f}, {away:.3f}")
    assert off < 0.01
    assert np.abs(same).max() < 0.06
    assert np.abs(found.share_percent / 100 - np.array(given["percent"]) / 100).max() < 0.01
    assert np.abs(found.cumulative_percent - given["cumulative"]).max() / 100 < 0.01


@pytest.mark.parametrize("table", ["T2", "T3"])
def test_published_shares_follow_from_the_published_eigenvalues(published, table):
    """Published: S tables 2 and 3, percentages and their sums to the printed digit."""
    given = published[table]
    n = len(given["variance"])
    found = components([f"p{i}" for i in range(n)], np.diag(given["variance"]), of="covariance")
    np.testing.assert_allclose(found.share_percent, given["percent"], atol=0.0101)
    np.testing.assert_allclose(found.cumulative_percent, given["cumulative"], atol=0.0101)


def test_components_of_any_matrix_satisfy_their_definition():
    """Property: C orthonormal, C'SC diagonal, loadings the correlations of parameters with C'x."""
    covariance = random_covariance(1)
    names = tuple("abcdef")
    sd = np.sqrt(np.diag(covariance))
    for of in ("correlation", "covariance"):
        found = components(names, covariance, of=of)
        matrix = covariance if of == "covariance" else covariance / np.outer(sd, sd)
        size = 1.0 if of == "correlation" else sd
        c, variance = found.vectors, found.eigenvalues
        np.testing.assert_allclose(c.T @ c, np.eye(6), atol=1e-12)
        assert (np.diff(variance) <= 0).all()
        np.testing.assert_allclose(variance.sum(), np.trace(matrix), rtol=1e-12)
        np.testing.assert_allclose(found.cumulative_percent[-1], 100)
        top = slice(0, 6 if of == "correlation" else 1)  # the others drown in rounding
        expected = (matrix @ c / np.sqrt(variance) / np.reshape(size, (-1, 1)))[:, top]
        np.testing.assert_allclose(found.loadings[:, top], expected, atol=1e-9)
        largest = np.argmax(np.abs(found.loadings), axis=0)[top]
        assert (found.loadings[largest, range(len(largest))] > 0).all()
    found = components(names, covariance)
    np.testing.assert_allclose(np.sum(found.loadings**2, axis=1), 1.0)


def test_components_use_standardised_parameters():
    """Closed form: two correlated parameters; y = (x1/s1 + x2/s2) / sqrt 2 and so on."""
    covariance = np.array([[4.0, 3.0], [3.0, 9.0]])
    values = np.array([2.0, 12.0])
    found = components(("a", "b"), covariance, values)
    np.testing.assert_allclose(found.eigenvalues, [1.5, 0.5])
    np.testing.assert_allclose(np.abs(found.values), [5 / np.sqrt(2), 3 / np.sqrt(2)])
    as_silva = components(("a", "b"), covariance, values, unscaled=True)
    np.testing.assert_allclose(np.abs(as_silva.values), [14 / np.sqrt(2), 10 / np.sqrt(2)])
    assert as_silva.unscaled


def test_components_of_correlations_do_not_depend_on_units():
    """Property: metres or millimetres, the loadings are the same; of covariances they are not."""
    covariance = random_covariance(2)
    units = np.outer(*2 * [[1e3, 1, 1e-3, 1, 1e6, 1]])
    one, two = (components("abcdef", matrix) for matrix in (covariance, covariance * units))
    np.testing.assert_allclose(one.loadings, two.loadings, atol=1e-9)
    assert one.share_percent[0] != pytest.approx(
        components("abcdef", covariance, of="covariance").share_percent[0]
    )


def test_indefinite_matrix_reports_smallest_eigenvalue():
    """Closed form: three correlations of -0.9 have the eigenvalue 1 - 2 * 0.9."""
    matrix = np.full((3, 3), -0.9) + 1.9 * np.eye(3)
    found = components(("a", "b", "c"), matrix)
    assert not found.positive_definite
    assert found.smallest_eigenvalue == pytest.approx(-0.8)
    assert np.isnan(found.loadings[:, 2]).all()
    assert np.isfinite(found.loadings[:, :2]).all()


@pytest.mark.parametrize(
    "matrix",
    [np.zeros((2, 2)), [[1.0, np.nan], [np.nan, 1.0]], [[1.0, 0.5], [0.1, 1.0]], np.eye(3)],
    ids=["no variance", "not finite", "not symmetric", "too large"],
)
def test_matrix_that_is_not_a_covariance_is_refused(matrix):
    with pytest.raises(ValueError, match="matrix"):
        components(("a", "b"), matrix)


def test_an_unknown_matrix_is_refused():
    with pytest.raises(ValueError, match="expected one of"):
        components(("a",), np.eye(1), of="cofactors")


def test_silva_table_3_follows_from_table_2(published, figure):
    """Published: S table 3, within what two decimals of table 2 leave open; no other pair does it.

    Correlations of 0.98 in two decimals leave a conditional variance between 0.03 and 0.05.
    """
    given, wanted = np.array(published["T2"]["R"]), np.array(published["T3"]["R"])
    away = {
        pair: np.abs(drop_parameters(NAMES, given, pair).correlation - wanted).max()
        for pair in itertools.combinations(NAMES, 2)
    }
    best, second = sorted(away, key=away.get)[:2]
    figure("S table 3 from table 2, largest difference", f"{away[best]:.3f} without {best}")
    assert best == ("K3", "P1")
    assert away[second] > 2 * away[best]
    rng, found = np.random.default_rng(3), []
    for _ in range(300):
        noise = np.triu(rng.uniform(-0.005, 0.005, given.shape), 1)
        found.append(drop_parameters(NAMES, given + noise + noise.T, best).correlation)
    low, high = np.min(found, axis=0) - 0.005, np.max(found, axis=0) + 0.005
    assert ((low <= wanted) & (wanted <= high)).all()


def test_silvas_rule_drops_k2_and_k3_from_table_2(published):
    """Published: S drops K2 and K3: two components have 0.7 % or less, K1 K2 K3 load alike."""
    rule = silva_rule(components(NAMES, np.array(published["T2"]["R"])))
    assert rule.may_go == 2
    assert set(rule.drop) == {"K2", "K3"}
    number, share, high = rule.high[0]
    assert (number, round(share, 1)) == (0, 29.4)
    assert [name for name, _ in high] == ["K1", "K2", "K3"]


def test_silvas_rule_to_the_letter_drops_the_smallest_loading():
    """Closed form: a component of three parameters, loadings all different, no tolerance."""
    load = np.array([0.99, 0.9, 0.85])
    matrix = np.outer(load, load)
    np.fill_diagonal(matrix, 1.0)
    found = components(("K3", "K1", "K2"), matrix)
    rule = silva_rule(found, negligible_percent=5.0, alike=0.0)
    assert (rule.may_go, rule.drop) == (1, ("K2",))
    assert silva_rule(found, negligible_percent=0.1).drop == ()


def test_silvas_rule_never_drops_the_principal_point():
    matrix = np.array([[1.0, 0.999], [0.999, 1.0]])
    assert silva_rule(components(("x0", "P1"), matrix)).drop == ("P1",)
    assert silva_rule(components(("x0", "y0"), matrix)).drop == ()


@pytest.mark.parametrize("of", ["correlation", "covariance"])
def test_loadings_of_a_parameter_explain_it_whatever_its_unit(of):
    """Property: the squares of a row of loadings sum to 1, over thirty powers of ten."""
    rng = np.random.default_rng(3)
    half = rng.normal(size=(6, 6)) + 3 * rng.normal(size=(6, 1))
    sd = np.array([2e-2, 1e-2, 1e-7, 5e-11, 9e-15, 8e-7])
    matrix = half @ half.T
    size = np.sqrt(np.diag(matrix))
    covariance = matrix / np.outer(size, size) * np.outer(sd, sd)
    found = components(("c", "x0", "K1", "K2", "K3", "P1"), covariance, of=of)
    assert found.positive_definite
    assert (found.eigenvalues > 0).all()
    np.testing.assert_allclose(np.sum(found.loadings**2, axis=1), 1.0, atol=1e-8)
