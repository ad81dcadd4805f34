"""Do the 95 % intervals of tables and deliveries hold the truth? Simulated tanks, inputs shared.

Two promises are measured. Over repeated surveys (errors scatter, standard uncertainties are
estimated from few readings) the intervals by the law of propagation are near 95 %, but short of 93
where 2 degrees of freedom carry most of the variance; those by Monte Carlo are 95 % where one input
is all but alone, and hold the truth more often where several count: the solution of Behrens and
Fisher. By what is known (the truth drawn from the inputs' t distributions) Monte Carlo is 95 %, and
the law of propagation falls short. A band fails three standard errors beyond its ends.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from draws import draws
from page_figures import agree, figures_of
from scipy.special import ndtr
from simulated_tanks import (
    Input,
    LyingTanks,
    VerticalTanks,
    believed,
    estimates,
    of_courses,
    redeclared,
    scattered,
    stacked,
)

import tankcal
from tankcal.gum.monte_carlo import QuadraticRows, simulate, verdict
from tankcal.pipeline.simulation import coordinates
from tankcal.tank.deliveries import deliveries

pytestmark = pytest.mark.slow

TANKS = draws(600, 10_000)  # standard error of a coverage 0.89 %, in full 0.22 %
TANKS_OF_COURSES = draws(300, 10_000)
FEW_LYING, FEW_SHELLS = 200, 50
NARROW, WIDE, NOT_SHORT = (0.945, 0.955), (0.93, 0.97), (0.945, 1.0)

SHELL = {
    "scale": Input(3e-4, 30),
    "offset": Input(1e-4, 40),
    "datum": Input(5e-4, 50),
    "course_heights": Input(2e-3),
    "barrel": Input(3e-4),
    "plate_thickness": Input(1.5e-4),
    "paint": Input(5e-5),
    "shell_temperature": Input(2.0),
    "expansion": Input(1e-6),
    "youngs_modulus": Input(6e9),
    "liquid_density": Input(10.0),
    "deadwood": Input(0.02),
}
FEW = {name: replace(SHELL[name], dof=dof) for name, dof in (("scale", 3), ("datum", 4))}
FORM = SHELL | {"scale": Input(5e-5, 30), "datum": Input(3e-4, 50)}


def lying(scale, diameter, length, datum):
    """Inputs of a lying tank; the temperature is a minor one."""
    return {
        "scale": Input(*scale),
        "diameter": Input(*diameter),
        "length": Input(*length),
        "datum": Input(*datum),
        "shell_temperature": Input(1.0),
    }


@dataclass(frozen=True)
class Scenario:
    """Inputs of lying tanks, how their errors come about, and bands; None: told, not judged."""

    name: str
    inputs: dict
    error: object
    gum: tuple | None
    monte_carlo: tuple


MANY = lying((2e-4, 30), (5e-4, 40), (2e-3, 50), (5e-4, 35))
ALONE = lying((1e-3, 2), (1e-4,), (1e-3,), (5e-5,))
BESIDE = lying((3e-4, 2), (3e-4,), (2e-3,), (3e-4,))
FIVE = {"scale": replace(BESIDE["scale"], dof=5)}
TWO = lying((2e-4, 3), (7.2e-4, 3), (1e-3,), (1e-4,))
FOUR = lying((2e-4, 2), (7.2e-4, 3), (6e-3, 4), (5e-4, 5))
SCENARIOS = (
    Scenario("30 to 50 dof", MANY, scattered, NARROW, NARROW),
    Scenario("2 dof alone", ALONE, scattered, WIDE, NARROW),
    Scenario("3 and 3 dof", TWO, scattered, WIDE, NOT_SHORT),
    Scenario("2, 3, 4 and 5 dof", FOUR, scattered, WIDE, NOT_SHORT),
    Scenario("2 dof beside others", BESIDE, scattered, None, NOT_SHORT),
    Scenario("5 dof beside others", BESIDE | FIVE, scattered, WIDE, NOT_SHORT),
    Scenario("what is known, 3 and 3 dof", TWO, believed, None, NARROW),
    Scenario("what is known, 2, 3, 4 and 5 dof", FOUR, believed, None, NARROW),
    Scenario("what is known, 2 dof beside others", BESIDE, believed, None, NARROW),
)


def error_of(tanks):
    """Binomial standard error of a coverage of 95 %."""
    return np.sqrt(0.95 * 0.05 / tanks)


def assert_within(found, band, tanks):
    least, most = band[0] - 3 * error_of(tanks), band[1] + 3 * error_of(tanks)
    assert np.all((found >= least) & (found <= most)), found


def assert_as_expected(one, tanks):
    """The part that holds is what the lengths of the intervals make it, volume by volume."""
    error = np.sqrt(one.expected * (1 - one.expected) / tanks)
    assert np.all(np.abs(one.found - one.expected) < 3.5 * error), one


def told(figure, what, found, tanks):
    parts = " ".join(f"{part:.4f}" for part in found)
    figure(f"coverage, {what}, {tanks} tanks, se {error_of(tanks):.4f}", parts)


@dataclass(frozen=True)
class Held:
    """(volumes,) parts of the tanks whose true volume lies within an interval, and what that part
    is by the interval's length, where errors are normal: the mean of P(low < error < high).
    """

    found: np.ndarray
    expected: np.ndarray


def held(low, high, truth, u):
    """`Held` of (tanks, volumes) ends about the found volumes; u of the errors' true scatter."""
    inside = np.mean((low <= truth) & (truth <= high), axis=0)
    half = (high - low) / 2
    return Held(inside, np.mean(2 * ndtr(half / u) - 1, axis=0))


def drawn(batch):
    """Monte Carlo of all rows of a stack of tables; they are linear in the inputs."""
    of = coordinates(batch.sources)
    n = len(of.distributions)
    straight = np.zeros((1, n, n)), np.zeros((len(batch.volume_m3), 1)), np.zeros(n)
    return simulate(QuadraticRows(batch.volume_m3, of.slopes, *straight), of.distributions)


def study_of_lying(folder, inputs, error, count):
    """`Held` of the law of propagation, of Monte Carlo, and of the one that counts by the verdict.

    error  `scattered`: u is estimated anew in each survey; `believed`: it is what was declared
    """
    rng, tanks = np.random.default_rng(61), LyingTanks(folder, inputs)
    surveys = [tanks.survey(rng, error) for _ in range(count)]
    batch = stacked([tanks.table(job) for job, _ in surveys], tanks.pairs)
    truth = np.array([volumes for _, volumes in surveys])
    truth = np.column_stack([truth, *(truth[:, b] - truth[:, a] for a, b in tanks.pairs)])
    true_u = batch.u_m3.reshape(truth.shape)
    if error is scattered:
        found = estimates(rng, inputs, count)
        each = {n: (np.repeat(ratio, truth.shape[1]), dof) for n, (ratio, dof) in found.items()}
        batch = redeclared(batch, each)
    simulated = drawn(batch)
    judged = verdict(simulated, batch.volume_m3, batch.u_m3, batch.dof)
    by_gum = batch.volume_m3 - batch.U_m3, batch.volume_m3 + batch.U_m3
    return [
        held(low.reshape(truth.shape), high.reshape(truth.shape), truth, true_u)
        for low, high in (by_gum, (simulated.low, simulated.high), (judged.low, judged.high))
    ]


def check_lying(folder, scenario, count, figure):
    found = study_of_lying(folder, scenario.inputs, scenario.error, count)
    bands = scenario.gum, scenario.monte_carlo, scenario.monte_carlo
    methods = "GUM", "Monte Carlo", "the verdict's"
    for method, band, one in zip(methods, bands, found, strict=True):
        told(figure, f"lying, {scenario.name}, rows and deliveries, {method}", one.found, count)
        if band:
            assert_within(one.found, band, count)
        if scenario.error is scattered:
            assert_as_expected(one, count)


ROWS_OF_PAGE = [
    (
        NARROW,
        figures_of("docs/studies/coverage.md", "with 30 to 50 degrees of freedom | () to () | |"),
    ),
    (
        WIDE,
        figures_of("docs/studies/coverage.md", "with 3 and 4 degrees of freedom | () to () | |"),
    ),
    (
        NOT_SHORT,
        figures_of(
            "docs/studies/coverage.md", "smooth random form of 10 mm at 12 points | () to () | |"
        ),
    ),
    (
        NARROW + NARROW,
        figures_of(
            "docs/studies/coverage.md",
            "| lying; 30 to 50 degrees of freedom | () to () | () to () |",
        ),
    ),
    (
        WIDE + NARROW,
        figures_of(
            "docs/studies/coverage.md",
            "| one input of 2 degrees of freedom, which has most of the variance | () to () | () "
            "to () |",
        ),
    ),
    (
        WIDE + NOT_SHORT,
        figures_of("docs/studies/coverage.md", "| two inputs of 3 | () to () | () to () |"),
    ),
    (
        WIDE + NOT_SHORT,
        figures_of(
            "docs/studies/coverage.md", "| four inputs of 2, 3, 4, 5 | () to () | () to () |"
        ),
    ),
    (
        NARROW,
        figures_of("docs/studies/coverage.md", "or four of 2, 3, 4, 5 | too short | () to () |"),
    ),
]


def test_bands_of_the_page():
    """The bands of the page are those that the studies below assert, scenario by scenario."""
    for band, printed in ROWS_OF_PAGE:
        assert agree(band, printed)
    by_name = {one.name: (one.gum, one.monte_carlo) for one in SCENARIOS}
    assert by_name["2 dof alone"] == (WIDE, NARROW)
    assert by_name["3 and 3 dof"] == by_name["2, 3, 4 and 5 dof"] == (WIDE, NOT_SHORT)
    assert by_name["what is known, 3 and 3 dof"] == (None, NARROW)


LYING = pytest.mark.parametrize("scenario", SCENARIOS, ids=[one.name for one in SCENARIOS])


@LYING
def test_intervals_of_lying_tanks(scenario, tmp_path, figure):
    check_lying(tmp_path, scenario, FEW_LYING, figure)


@pytest.mark.study
@LYING
def test_intervals_of_lying_tanks_study(scenario, tmp_path, figure):
    check_lying(tmp_path, scenario, TANKS, figure)


def intervals(table, pairs):
    """(volumes,) volumes, u and U of the rows of a table, then of the deliveries between rows."""
    low, high = table.height_m[np.transpose(pairs)]
    of = deliveries(table, low, high)
    both = [(table.volume_m3, of.volume_m3), (table.u_m3, of.u_m3), (table.U_m3, of.U_m3)]
    return tuple(map(np.concatenate, both))


def without(table, *kinds):
    """The table with some of its causes forgotten."""
    return replace(table, sources=tuple(one for one in table.sources if one.kind not in kinds))


def scale_of_courses(table):
    """The table with an independent scale for each course in place of the common one."""
    joints, kinds = VerticalTanks.joints, [one.kind for one in table.sources]
    sources = list(table.sources)
    place = kinds.index("scale")
    sources[place] = of_courses(sources[place], table.height_m, joints)
    return replace(table, sources=tuple(sources))


def study_of_shells(tanks, ways, count, left_out=()):
    """{way: `Held`} of ways (changed, inputs): changed(table), with u of the inputs estimated.

    left_out  kinds of causes that these tanks do not have
    """
    rng, total = np.random.default_rng(17), dict.fromkeys(ways, 0.0)
    for _ in range(count):
        job, truth = tanks.survey(rng)
        table = without(tanks.table(job), *left_out)
        truth = np.append(truth, [truth[b] - truth[a] for a, b in tanks.pairs])
        volumes, u, _ = intervals(table, tanks.pairs)
        for name, (changed, inputs) in ways.items():
            stated = redeclared(changed(table), estimates(rng, inputs))
            half = intervals(stated, tanks.pairs)[2]
            one = np.stack([np.abs(volumes - truth) <= half, 2 * ndtr(half / u) - 1])
            total[name] = total[name] + one / count
    return {name: Held(*one) for name, one in total.items()}


def check_shells(folder, count, figure):
    """A common scale in play; then the same surveys with it declared otherwise, or not at all.

    The walls are circles: what walls have between the points is left out of U.
    """
    ways = {
        "30 to 50 dof": (lambda table: table, SHELL),
        "scale of 3, datum of 4 dof": (lambda table: table, SHELL | FEW),
        "scale of each course": (scale_of_courses, SHELL),
        "scale dropped": (lambda table: without(table, "scale"), SHELL),
    }
    found = study_of_shells(VerticalTanks(folder, SHELL), ways, count, OF_WALL)
    for name, one in found.items():
        told(figure, f"shells, {name}, rows and deliveries", one.found, count)
        assert_as_expected(one, count)
    many, few, of_each, dropped = found.values()
    assert_within(many.found, NARROW, count)
    assert_within(few.found, WIDE, count)
    most = figures_of(
        "docs/studies/coverage.md",
        "| the scale as if each course had its own | total below () | |",
    )
    assert of_each.expected[TOTAL] < float(*most)
    most = figures_of("docs/studies/coverage.md", "| **the scale left out** | total below () | |")
    assert dropped.expected[TOTAL] < float(*most)


def check_forms(folder, count, figure):
    """Walls of random form seen at twelve points a course, with the same inputs in common.

    They are smooth and have no seams, which U assumes: it is too wide for them, never short.
    """
    ways = {
        "form in U": (lambda table: table, FORM),
        "form left out": (lambda table: without(table, *OF_WALL), FORM),
    }
    found = study_of_shells(VerticalTanks(folder, FORM, form_m=0.010), ways, count)
    for name, one in found.items():
        told(figure, f"shells of random form, {name}, rows and deliveries", one.found, count)
    with_form, left_out = found.values()
    assert_within(with_form.found, NOT_SHORT, count)
    assert left_out.found[TOTAL] < 0.9


TOTAL, OF_WALL = len(VerticalTanks.dips) - 1, ("bulge", "ovality", "seams")
SHELLS = pytest.mark.parametrize("check", [check_shells, check_forms])


@SHELLS
def test_intervals_of_shells(check, tmp_path, figure):
    check(tmp_path, FEW_SHELLS, figure)


@pytest.mark.study
@SHELLS
def test_intervals_of_shells_study(check, tmp_path, figure):
    check(tmp_path, TANKS_OF_COURSES, figure)


@pytest.mark.parametrize("form_m", [0.0, 0.010])
def test_the_simulated_way_is_that_of_the_chain(form_m, tmp_path):
    """The same survey by `tankcal.run`, which looks for clutter and the axis, too."""
    tanks = VerticalTanks(tmp_path, FORM, form_m=form_m)
    job, _ = tanks.survey(np.random.default_rng(3))
    table, whole = tanks.table(job), tankcal.run(job, simulated=False).table
    rows = np.searchsorted(whole.height_m, np.array(tanks.dips) - 1e-9)
    assert np.all(np.abs(table.volume_m3 - whole.volume_m3[rows]) < 0.02 * table.u_m3)
    assert table.u_m3 == pytest.approx(whole.u_m3[rows], rel=0.02)


def test_the_simulated_ends_are_those_of_the_table(tmp_path):
    """Monte Carlo of one table by `tankcal.run`, which also knows that volumes are not linear."""
    tanks = LyingTanks(tmp_path, FOUR)
    job, _ = tanks.survey(np.random.default_rng(3))
    table = tanks.table(job)
    table = redeclared(table, {n: (np.ones(1), one.dof) for n, one in FOUR.items()})
    own = tankcal.run(job, simulated=True).simulation.found
    ends, below_top = drawn(stacked([table], tanks.pairs)), len(tanks.dips) - 1
    for mine, its in ((ends.low, own.low), (ends.high, own.high)):
        off = np.abs(mine[:below_top] - its[1 : below_top + 1])
        assert np.all(off < 0.01 * table.u_m3[:below_top])
