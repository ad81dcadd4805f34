"""Monte Carlo against the published cases of JCGM 101, closed forms and a second method."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr

from tankcal.errors import ProgramError
from tankcal.gum.distributions import (
    CurvilinearTrapezoid,
    Normal,
    Rectangular,
    StudentT,
    Triangular,
    UShaped,
    within,
)
from tankcal.gum.monte_carlo import Goal, QuadraticRows, numerical_tolerance, simulate, verdict
from tankcal.gum.monte_carlo.goal import simulation
from tankcal.gum.monte_carlo.inputs import inputs_of
from tankcal.gum.monte_carlo.quadratic import (
    LEAST,
    LONG,
    NEAR,
    POINTS,
    SETS,
    SHORT,
    SHORT_STEP,
    SPACING,
    Shape,
    _normal_between,
    _Roots,
    _scores_near,
    _smooth_between,
    linear_law,
    shapes_of,
)
from tankcal.gum.monte_carlo.quadratic import NEAR as NEAR_LEVEL
from tankcal.uncertainty import coverage_factor

EXACT_RECTANGULAR = 2 * np.sqrt(3) * (2 - (3 / 5) ** 0.25)
SOME = Goal(plain_draws=200_000, fraction=1.0)


def total(x):
    """Sum of the inputs, one row: the additive model of JCGM 101 9.2."""
    return x.sum(axis=1, keepdims=True)


def rectangular(u, mean=0.0):
    """A rectangular input of standard uncertainty u."""
    return Rectangular(np.sqrt(3) * u, mean=mean)


def mass(x):
    """Deviation of a calibrated weight from its nominal 100 g, mg (JCGM 101 equation 34)."""
    reference, added, air, weight, standard = x.T
    return ((reference + added) * (1 + (air - 1.2) * (1 / weight - 1 / standard)) - 1e5)[:, None]


def loss(x):
    """Comparison loss x1^2 + x2^2 (JCGM 101 9.4)."""
    return np.sum(x**2, axis=1, keepdims=True)


def loss_inputs(x1):
    """Both components of the reflection coefficient, u 0.005 (JCGM 101 9.4.2)."""
    return [Normal(0.005, mean=x1), Normal(0.005)]


def law_of(coefficients, inputs, levels):
    """The law of a linear part that the control variate uses."""
    ready = inputs_of(inputs)
    scaled = np.atleast_2d(coefficients) @ ready.transform * ready.coordinate_scale
    return linear_law(scaled, ready.normal, shapes_of(ready), np.asarray(levels))


@pytest.mark.parametrize(
    ("inputs", "u", "end"),
    [
        ([Normal(1.0)] * 4, 2.0, 3.92),  # JCGM 101 9.2.2, table 2
        ([rectangular(1.0)] * 4, 2.0, EXACT_RECTANGULAR),  # 9.2.3, annex E closed form
        ([rectangular(1.0)] * 3 + [rectangular(10.0)], np.sqrt(103), 17.0),  # 9.2.4, table 4
    ],
)
def test_additive_models_of_jcgm_101(inputs, u, end, figure):
    found = simulate(total, inputs, goal=SOME)
    figure("additive model, end", f"{found.high[0]:.5f} +- {found.se_high[0]:.5f} ({end:.5f})")
    published = 0.05 if end == 17.0 else 0.005 if end == 3.92 else 0.0
    assert found.u[0] == pytest.approx(u, abs=1e-9)  # exact: the control carries all of u
    for value, truth in ((found.low[0], -end), (found.high[0], end)):
        assert abs(value - truth) <= published + 4 * found.se_high[0] + 5e-5
    assert found.controlled[0]


def test_gum_fails_with_dominant_rectangular_input():
    """JCGM 101 9.2.4: GUM +-19.9 beside +-17.0 of Monte Carlo, u 10.1."""
    found = simulate(total, [rectangular(1.0)] * 3 + [rectangular(10.0)], goal=SOME)
    judged = verdict(found, [0.0], [np.sqrt(103)])
    assert coverage_factor(0.95, np.inf) * np.sqrt(103) == pytest.approx(19.9, abs=0.05)
    assert judged.d_high[0] == pytest.approx(19.9 - 17.0, abs=0.1)
    assert not judged.validated[0]
    assert judged.sure[0]
    assert judged.high[0] == found.high[0]  # Monte Carlo's is what counts


def test_gum_is_validated_for_four_normals():
    found = simulate(total, [Normal(1.0)] * 4, goal=SOME)
    judged = verdict(found, [0.0], [2.0])
    assert judged.tolerance[0] == pytest.approx(0.05)  # 2.0 = 20e-1 (7.9.2)
    assert judged.validated[0]
    assert judged.sure[0]
    assert judged.high[0] == pytest.approx(2 * 1.959964, abs=1e-6)


@pytest.mark.slow
def test_mass_calibration(figure):
    """JCGM 101 9.3, table 5: 1.2340 mg, u 0.0754, [1.0834, 1.3825]; u 0.0539 of first order."""
    inputs = [
        Normal(0.050, mean=100_000), Normal(0.020, mean=1.234), within(0.10, mean=1.20),
        within(1000, mean=8000), within(50, mean=8000),
    ]  # fmt: skip
    found = simulate(mass, inputs)
    ends = f"[{found.shortest_low[0]:.4f}, {found.shortest_high[0]:.4f}]"
    figure("mass calibration", f"{found.value[0]:.4f} {found.u[0]:.4f} {ends}")
    assert found.value[0] == pytest.approx(1.2340, abs=1e-4)
    assert found.u[0] == pytest.approx(0.0754, abs=1e-4)
    length = found.shortest_high[0] - found.shortest_low[0]
    assert length == pytest.approx(1.3825 - 1.0834, abs=5e-4)
    assert found.shortest_low[0] == pytest.approx(1.0834, abs=2e-3)
    assert found.shortest_high[0] == pytest.approx(1.3825, abs=2e-3)
    judged = verdict(found, [1.2340], [np.hypot(0.050, 0.020)], digits=1)
    assert judged.d_low[0] == pytest.approx(0.045, abs=2e-3)  # table 5: GUM1 [1.1285, 1.3395]
    assert not judged.validated[0]


def block(x):
    """Deviation of a gauge block from 50 mm, nm (JCGM 101 9.5.1), of its nine inputs."""
    standard, read, random, systematic, expansion, mean, cycle, other, colder = x.T
    warm = mean + cycle
    length = standard * (1 + expansion * (warm - colder)) + read + random + systematic
    return (length / (1 + (expansion + other) * warm) - 50_000_000.0)[:, None]


@pytest.mark.slow
def test_gauge_block(figure):
    """JCGM 101 9.5: u 36 nm. Other program (a paper's 1e6 draws of it): 838, 36, [745, 932] nm.

    It does not say which 99 % interval: the symmetric one is compared, with 4 of our errors.
    """
    inputs = [
        StudentT(25.0, dof=18, mean=50_000_623.0), StudentT(6.0, dof=24, mean=215.0),
        StudentT(4.0, dof=5), StudentT(7.0, dof=8), Rectangular(2e-6, mean=11.5e-6),
        Normal(0.2, mean=-0.1), UShaped(0.5), within(1e-6, inexactness=0.1e-6),
        within(0.050, inexactness=0.025),
    ]  # fmt: skip
    found = simulate(block, inputs, goal=Goal(probability=0.99, plain_draws=100_000))
    figure("gauge block, u, low, high", np.round([found.u[0], found.low[0], found.high[0]], 2))
    assert found.value[0] == pytest.approx(838, abs=0.5)
    assert found.u[0] == pytest.approx(36, abs=0.5)
    assert found.low[0] == pytest.approx(745, abs=0.5 + 4 * found.se_low[0])
    assert found.high[0] == pytest.approx(932, abs=0.5 + 4 * found.se_high[0])


@pytest.mark.parametrize("x1", [0.0, 0.010, 0.050])
def test_comparison_loss_uncorrelated(x1, figure):
    """Closed form: u^2 times a non-central chi-square of 2 degrees of freedom (x1/u)^2.

    x1 = 0.010: 150, 112, shortest [0, 367] in 1e-6 (JCGM 101 table 6, from draws: its 367 stands
    1e-6 from the closed form 366.0).
    """
    found = simulate(loss, loss_inputs(x1), goal=SOME)
    law = stats.ncx2(2, (x1 / 0.005) ** 2) if x1 else stats.chi2(2)
    scale = 0.005**2
    assert found.value[0] == pytest.approx(scale * law.mean(), abs=5 * found.se_value[0])
    assert found.u[0] == pytest.approx(scale * law.std(), abs=5 * found.se_u[0])
    assert found.low[0] == pytest.approx(scale * law.ppf(0.025), abs=5 * found.se_low[0])
    assert found.high[0] == pytest.approx(scale * law.ppf(0.975), abs=5 * found.se_high[0])
    if x1 == 0.010:
        figure("comparison loss, shortest, 1e-6", 1e6 * found.shortest_high[0])
        assert 1e6 * found.value[0] == pytest.approx(150, abs=0.5)
        assert 1e6 * found.u[0] == pytest.approx(112, abs=0.5)
        assert 1e6 * found.shortest_low[0] == pytest.approx(0, abs=0.5)
        assert 1e6 * found.shortest_high[0] == pytest.approx(scale * law.ppf(0.95) * 1e6, abs=1)


@pytest.mark.parametrize("x1", [0.0, 0.010, 0.050])
def test_comparison_loss_correlated(x1):
    """r = 0.9: mean x1^2 + 2 u^2; variance 4 x1^2 u^2 + 4 u^4 (1 + r^2), closed forms."""
    found = simulate(loss, loss_inputs(x1), [[1, 0.9], [0.9, 1]], goal=SOME)
    u = 0.005
    expected = np.sqrt(4 * x1**2 * u**2 + 4 * u**4 * (1 + 0.81))
    assert found.value[0] == pytest.approx(x1**2 + 2 * u**2, abs=5 * found.se_value[0])
    assert found.u[0] == pytest.approx(expected, abs=5 * found.se_u[0])


@pytest.mark.parametrize("dof", [3, 4, 5])
def test_law_of_students_t(dof):
    """Closed form: quantiles of one scaled t, to 1e-4 of its sd."""
    law = law_of([2.0], [StudentT(1.0, dof=dof)], [0.025, 0.975])
    assert law.known[0]
    spread = 2 * np.sqrt(dof / (dof - 2))
    assert law.quantile[0] == pytest.approx(2 * stats.t(dof).ppf([0.025, 0.975]), abs=1e-4 * spread)


@pytest.mark.parametrize("step", [0.1 * NEAR, 0.99 * NEAR, 0.5, np.inf])
def test_probability_between_ends_of_a_normal(step):
    """Near ends by Taylor's series, others by the function itself; second method: scipy."""
    first = np.linspace(-4, 4, 201)
    last = first + step * np.where(np.arange(201) % 2, 1, -1)
    expected = stats.norm.cdf(last) - stats.norm.cdf(first)
    np.testing.assert_allclose(_normal_between(first, last.copy()), expected, atol=2e-11)
    np.testing.assert_allclose(_normal_between(first[0], last[:1].copy()), expected[:1], atol=2e-11)


@pytest.mark.parametrize("step", [0.1 * SHORT_STEP, 0.99 * SHORT_STEP, 0.5])
@pytest.mark.parametrize("dof", [1.0, 3.0, 50.0])
def test_probability_between_ends_of_a_smooth_law(step, dof):
    """Near ends by the density of the tables, others by their cdf; second method: scipy."""
    shape = Shape(StudentT(1.0, dof=dof), 1.0)
    first = np.linspace(-6, 6, 201)
    last = first + step * np.where(np.arange(201) % 2, 1, -1)
    expected = stats.t(dof).cdf(last) - stats.t(dof).cdf(first)
    cdf, density = (
        lambda x, of=of: np.interp(x, shape.value, of) for of in (shape.below, shape.density)
    )
    found = _smooth_between(cdf, density, SHORT_STEP, first, last.copy())
    np.testing.assert_allclose(found, expected, atol=1e-4 * step + 6e-8)


def test_which_laws_are_smooth():
    """Steps and kinks of a density: its characteristic function falls by powers of t only."""
    kinds = [Rectangular(1.0), UShaped(1.0), Triangular(1.0), CurvilinearTrapezoid(1.0, 0.3)]
    assert all(Shape(one, one.sd).density is None for one in kinds)
    assert all(Shape(StudentT(2.0, dof=dof), 2.0).density is not None for dof in (1, 2.5, 30, 200))


@pytest.mark.parametrize("reach", [0.99, 3.0])
def test_scores_of_probabilities_near_their_levels(reach):
    """Second method: ndtri itself, which those that are not near are given to."""
    levels = np.array([0.005, 0.025, 0.5, 0.985])
    density = stats.norm.pdf(stats.norm.ppf(levels))
    moved = np.linspace(-reach, reach, 12).reshape(3, 4) * NEAR_LEVEL
    p = np.clip(levels[:, None, None] + density[:, None, None] * moved, 0, 1)
    np.testing.assert_allclose(_scores_near(levels, p), stats.norm.ppf(p), rtol=0, atol=1e-8)


def test_roots_of_parabolas_and_where_there_is_none():
    """Closed form: the parabola at its root is the gap; beyond its turn +-inf by the side."""
    half, bend = np.array([[1.0, 1.0, 1.0, -1.0]]), np.array([0.3, 0.0, -1.0, 0.1])
    gap = np.array([[0.7, -0.7, 2.0, -0.5]])
    t = _Roots(half, bend)(gap.copy())
    near = t[0, :2]
    np.testing.assert_allclose(2 * near + bend[:2] * near**2, gap[0, :2], rtol=1e-15)
    np.testing.assert_array_equal(t[0, 2:], [np.inf, -np.inf])
    np.testing.assert_array_equal(_Roots(half[:, :2], bend[:2])(gap[:, :2].copy()), t[:, :2])


def test_characteristic_function_of_a_table_that_grows():
    """Closed form of a rectangular input: sin(t)/t in units of its half-width; 0 beyond."""
    shape = Shape(Rectangular(2.0), 2.0)
    for end in (SHORT, LONG):
        t = np.linspace(0.1, (end - 2) * SPACING, 7)
        np.testing.assert_allclose(shape.characteristic(t), np.sin(t) / t, atol=3e-7)
    np.testing.assert_array_equal(shape.characteristic(np.array([LONG * SPACING])), 0.0)


@pytest.mark.parametrize("halves", [[1.0, 1.0], [1.0, 0.01]])
def test_law_of_two_rectangular_inputs_and_little_else(halves):
    """Closed form: the trapezoid's tail (a + b - y)^2/(8 a b), else (a - y)/(2 a).

    The second, nearly one rectangle, takes thousands of terms. What they leave out is worth some
    LEAST of probability, where the density is a half.
    """
    levels = np.array([0.015, 0.025, 0.035, 0.965, 0.975, 0.985])
    tail, (a, b) = np.minimum(levels, 1 - levels), halves
    corner = tail < b / (2 * a)
    distance = np.where(corner, a + b - np.sqrt(8 * a * b * tail), a * (1 - 2 * tail))
    law = law_of([1.0, 1.0], [Rectangular(a), Rectangular(b)], levels)
    assert law.known[0]
    np.testing.assert_allclose(
        law.quantile[0], np.where(levels < 0.5, -1, 1) * distance, atol=20 * LEAST
    )


ALONE = [UShaped(1.0), Rectangular(1.0, mean=3.0), Triangular(1.0), StudentT(2.0, dof=3)]


@pytest.mark.parametrize("one", ALONE, ids=lambda one: one.name)
def test_law_of_an_input_that_acts_alone_is_its_own(one):
    """Closed form: quantiles of the input; it had errors of 1e-3 of u where density has no end."""
    levels = np.array([0.001, 0.025, 0.4, 0.975])
    law = law_of([[-2.0, 0.0], [0.5, 0.0]], [one, Normal(1.0)], levels)
    expected = one.quantile(levels) - one.mean
    assert law.known.all()
    assert law.quantile == pytest.approx(np.outer([2.0, 0.5], expected), abs=1e-12)
    steps = (one.quantile(levels + 1e-5) - one.quantile(levels - 1e-5)) / 2e-5
    assert law.density == pytest.approx(1 / np.outer([2.0, 0.5], steps), rel=1e-3)


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("share", [0.001, 0.004, 0.01, 0.1])
@pytest.mark.parametrize("one", ALONE, ids=lambda one: one.name)
def test_law_of_an_input_with_little_beside_it(one, share):
    """Second method: the normal part averaged over quantiles of the input, within a fifth of what a
    million draws leave of a probability of 0.025. What the table of the characteristic function
    cannot tell is not said: of an arc sine and 0.001 the probability was off by 0.0025.
    """
    levels = np.array([0.01, 0.025, 0.975])
    law = law_of([[1.0, share]], [one, Normal(one.sd)], levels)
    parts = one.quantile((np.arange(200_000) + 0.5) / 200_000) - one.mean
    if one.name == "u-shaped" and share < 0.002:
        assert not law.known[0]
        return
    assert law.known[0]
    for level, y in zip(levels, law.quantile[0], strict=True):
        below = ndtr((y - parts) / (share * one.sd)).mean()
        assert below == pytest.approx(level, abs=3e-5)


@pytest.mark.slow
def test_law_of_two_arc_sines_and_a_normal_against_plain_draws():
    """Simulation: the law's quantiles within 4 standard errors of 1e6 plain draws."""
    inputs = [UShaped(1.0), UShaped(2.0), Normal(0.2), Triangular(0.5)]
    law = law_of(np.ones(4), inputs, [0.025, 0.975])
    generator = np.random.default_rng(3)
    draws = sum(one.quantile(generator.random(1_000_000)) for one in inputs)
    error = np.sqrt(0.025 * 0.975 / 1e6) / law.density[0]
    assert np.all(np.abs(law.quantile[0] - np.quantile(draws, [0.025, 0.975])) < 4 * error)


@pytest.mark.slow
def test_linear_rows_with_heavy_tails_u_and_ends(figure):
    """Purely linear, t of 3 to 5 degrees of freedom: u closed form, ends by the law without draws.

    The standard error of 1e6 plain draws in an end is sqrt(p q/1e6)/density.
    """
    inputs = [StudentT(1.0, dof=dof) for dof in (3, 4, 5)]
    slopes = np.array([[1.0, 1.0, 1.0], [0.2, 1.0, 0.5]])
    found = simulate(lambda x: x @ slopes.T, inputs, goal=SOME)
    law = law_of(slopes, inputs, [0.025, 0.975])
    plain = np.sqrt(0.025 * 0.975 / 1e6) / law.density[:, 1]
    figure("linear t rows, se of the end to that of 1e6 plain draws", found.se_high / plain)
    assert found.u == pytest.approx(np.sqrt(slopes**2 @ [3.0, 2.0, 5 / 3]), rel=1e-9)
    assert np.all(found.se_high < plain)
    assert np.all(np.abs(found.high - law.quantile[:, 1]) < plain)


@pytest.mark.slow
def test_two_degrees_of_freedom_have_no_u_but_an_interval():
    """Closed form: t of 2 degrees of freedom, quantile 4.303; its sd does not exist."""
    found = simulate(total, [StudentT(1.0, dof=2), Normal(1e-6)], goal=SOME)
    assert np.isinf(found.u[0])
    assert found.high[0] == pytest.approx(stats.t(2).ppf(0.975), abs=5e-3)


def test_rows_without_second_derivatives_are_those_of_the_linear_law():
    """Closed form: a sum of normal inputs, 1.96 u both ways; no form at all."""
    none = np.zeros((0, 2, 2)), np.zeros((3, 0))
    jacobian = np.array([[3.0, 4.0], [1.0, 0.0], [0.0, 0.0]])
    found = simulate(
        QuadraticRows(np.full(3, 7.0), jacobian, *none, np.zeros(2)), [Normal(1.0)] * 2
    )
    u = np.array([5.0, 1.0, 0.0])
    assert found.u == pytest.approx(u, abs=1e-12)
    assert found.high - 7.0 == pytest.approx(1.959964 * u, abs=1e-6)
    assert 7.0 - found.shortest_low == pytest.approx(1.959964 * u, abs=1e-6)


def test_rows_that_do_not_vary_have_no_uncertainty():
    model = QuadraticRows(
        np.array([0.0, 5.0]), np.array([[0.0], [1.0]]), np.ones((1, 1, 1)), np.zeros((2, 1)),
        np.zeros(1),
    )  # fmt: skip
    found = simulate(model, [Normal(0.1)])
    assert found.u == pytest.approx([0.0, 0.1])
    assert found.low == pytest.approx([0.0, 5 - 0.1959964], abs=1e-6)
    judged = verdict(found, model.value, found.u)
    assert np.all(judged.validated)


def test_numerical_tolerance():
    """JCGM 101 7.9.2, example 1 (0.00035 g, two digits), and by hand."""
    found = numerical_tolerance([0.00035, 2, 0.0996, 0.0, np.inf])
    assert found[:3] == pytest.approx([0.000005, 0.05, 0.005])
    assert np.all(np.isnan(found[3:]))
    assert numerical_tolerance(2.0, digits=1) == pytest.approx([0.5])


def test_same_seed_same_numbers_and_progress_is_reported():
    told = []
    found = [
        simulate(loss, loss_inputs(0.01), goal=SOME, progress=lambda *step: told.append(step))
        for _ in range(2)
    ]
    assert found[0].high[0] == found[1].high[0]
    assert told[0][1] == 1
    assert told[-1][1] <= told[-1][2]


def test_a_model_that_gives_no_rows_is_refused():
    with pytest.raises(ValueError, match=r"the model gives \(1,\) for one draw: expected"):
        simulate(lambda x: x[:, 0], [Normal(1.0)])


def test_inputs_that_cannot_be():
    with pytest.raises(ValueError, match="eigenvalue"):
        inputs_of([Normal(1.0)] * 3, [[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]])
    with pytest.raises(ValueError, match="symmetric 2 x 2"):
        inputs_of([Normal(1.0)] * 2, np.eye(3))
    with pytest.raises(ValueError, match="coverage probability"):
        Goal(probability=1.0)
    with pytest.raises(ValueError, match="above 0"):
        Goal(digits=0)
    one = QuadraticRows(
        np.ones(1), np.ones((1, 1)), np.ones((1, 1, 1)), np.ones((1, 1)), np.ones(1)
    )
    with pytest.raises(ValueError, match="2 inputs"):
        simulate(one, [Normal(1.0)] * 2)


def test_correlated_non_normal_inputs_have_no_control_variate():
    """Sum of two equal rectangulars (scores r = 1): one of twice the width, closed form."""
    found = simulate(total, [Rectangular(1.0)] * 2, [[1, 1], [1, 1]], goal=SOME)
    assert not found.controlled[0]
    assert found.high[0] == pytest.approx(1.9, abs=5 * found.se_high[0] + 1e-6)
    assert found.u[0] == pytest.approx(2 / np.sqrt(3), abs=5 * found.se_u[0] + 1e-6)


@pytest.mark.parametrize("r", [1.0, -1.0])
def test_normals_that_are_one_leave_other_inputs_alone(r):
    """Closed form: the rectangle behind them was drawn as a unit normal, 17 times too wide."""
    inputs, correlation = [Normal(1.0), Normal(1.0), rectangular(0.1)], np.eye(3)
    correlation[0, 1] = correlation[1, 0] = r
    jacobian = np.array([[0.0, 0.0, 1.0], [1.0, -r, 1.0]])
    none = np.zeros((1, 3, 3)), np.zeros((2, 1))
    for model in (
        lambda x: x @ jacobian.T,
        QuadraticRows(np.zeros(2), jacobian, *none, np.zeros(3)),
    ):
        found = simulate(model, inputs, correlation, goal=SOME)
        assert found.u == pytest.approx(0.1, abs=1e-9)
        assert found.high == pytest.approx(0.95 * np.sqrt(3) * 0.1, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dof", "size", "bend", "probability"), [(5, 0.3, 0.02, 0.999), (2, 0.3, 0.003, 0.99)]
)
def test_rare_tails_of_a_curve_are_drawn_for(dof, size, bend, probability):
    """Simulation: R + b t + q t^2 by 4e6 draws; its ends came out with a standard error of 0, up to
    a half off, for no point had reached the tail of t.
    """
    inputs = [Rectangular(1.0), StudentT(size, dof=dof)]
    hessian = np.zeros((1, 2, 2))
    hessian[0, 1, 1] = 1 / size**2
    model = QuadraticRows(np.zeros(1), np.ones((1, 2)), hessian, np.full((1, 1), bend), np.zeros(2))
    found = simulate(model, inputs, goal=Goal(probability=probability))
    generator = np.random.default_rng(7)
    t = generator.standard_t(dof, 4_000_000)
    y = generator.uniform(-1, 1, len(t)) + size * t + bend * t**2
    low, high = np.quantile(y, [(1 - probability) / 2, (1 + probability) / 2])
    assert found.low[0] == pytest.approx(low, abs=0.01 * (high - low))
    assert found.high[0] == pytest.approx(high, abs=0.01 * (high - low))


def products(strengths):
    """Rows of three inputs, each bent the more the greater its strength."""
    hessians = np.zeros((2, 3, 3))
    hessians[0, 0, 0] = hessians[1, 1, 1] = 1.0
    hessians[1, 0, 2] = hessians[1, 2, 0] = 0.3
    slopes = np.tile([1.0, 0.5, 0.2], (len(strengths), 1))
    weights = np.outer(strengths, [0.3, -0.2])
    return QuadraticRows(np.full(len(strengths), 5.0), slopes, hessians, weights, np.zeros(3))


@pytest.mark.slow
def test_a_row_that_more_points_show_to_be_unsteady_is_drawn_for():
    """Property: a row steady with 16 points and not with 64 got an interval of zeros."""
    inputs = [rectangular(1.0), Normal(1.0), Normal(1.0)]
    rows = products(np.linspace(0.088, 0.0955, 40))  # one of them is such a row
    found = simulate(rows, inputs, goal=Goal(plain_draws=20_000))
    assert np.all((found.low < 5.0) & (found.high > 5.0))
    assert np.ptp(found.low) < 0.1  # beside one another
    drawn = simulate(lambda x: rows(x), inputs, goal=Goal(plain_draws=20_000))
    assert np.abs(found.low - drawn.low).max() < 0.05


def test_an_interval_without_ends_is_an_error_of_the_program():
    estimates = np.array([[5.0], [1.0], [3.0], [7.0], [3.0], [np.nan]])
    with pytest.raises(ProgramError, match="contradicts itself"):
        simulation(Goal(), estimates, np.zeros((6, 1)), np.ones(1), np.ones(1, dtype=bool))


def test_rows_that_few_points_cannot_place_are_looked_at_with_more():
    """Property: of 36 rows a first look, with 16 points, cannot place 9; none is left to draws."""
    size, none = np.linspace(0.5, 4, 36), np.zeros(36)
    hessian = np.zeros((1, 3, 3))
    hessian[0, 0, 1] = hessian[0, 1, 0] = 0.03
    jacobian = np.column_stack([size, 0.3 * size, none + 0.2])
    model = QuadraticRows(none, jacobian, hessian, np.ones((36, 1)), np.zeros(3))
    found = simulate(model, [rectangular(1.0), Normal(1.0), Normal(1.0)], goal=SOME)
    assert np.all(found.draws == SETS * POINTS)
