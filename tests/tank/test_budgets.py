"""Budgets of volumes and deliveries, shared and correlated inputs, what reading adds."""

import numpy as np
import pytest
from job_builder import write_job

import tankcal
from tankcal.gum.distributions import standard
from tankcal.tank.budgets import budget, reading_sources
from tankcal.tank.capacity import Capacity
from tankcal.uncertainty import Input, Inputs, Source, group_correlated, propagate, triangular
from tankcal.uncertainty import budget as budget_of_model


def source(kind, *column, u=1.0, **more):
    return Source(kind, np.array(column, dtype=float)[:, None], u=u, unit="mm", **more)


def table(*sources):
    height = np.array([0.0, 1.0, 2.0])
    return Capacity(height, 10 * height, np.full(3, 10.0), sources, 0.95)


@pytest.mark.parametrize("r", [-0.9, 0.0, 0.5, 1.0])
def test_correlated_inputs_are_those_of_the_law_of_propagation(r):
    """The same two inputs through propagate: u, shares and what halving one is worth."""
    alone = {"a": source("a", 0, 3, 5, dof=9.0), "b": source("b", 0, 2, -4, dof=9.0)}
    found = budget(table(*group_correlated(alone, [("a", "b", r)] if r else ())), 2.0)
    inputs = Inputs([Input(n, standard(1.0, dof=9.0), "mm", "A") for n in "ab"], {("a", "b"): r})
    model = propagate(lambda x: 5 * x[0] - 4 * x[1], inputs)
    assert found.u_m3 == pytest.approx(model.u[0], rel=1e-12)
    for line, expected in zip(found.lines, budget_of_model(model), strict=True):
        assert line.share == pytest.approx(expected.share, abs=1e-12)
        assert line.contribution == pytest.approx(expected.contribution)
        if r:
            assert found.dof == pytest.approx(9.0)
            assert line.halved == pytest.approx(expected.halved)
            assert line.correlations == expected.correlations
            assert [value for _, value in line.correlations] == [r]


def run(folder, **parts):
    return tankcal.run(tankcal.load(write_job(folder, **parts)))


@pytest.mark.parametrize("r", [-1.0, 0.0, 0.3, 1.0])
def test_a_triangular_factor_gives_back_its_matrix(r):
    matrix = np.array([[1, r, 0.5 * r], [r, 1, 0.5], [0.5 * r, 0.5, 1]])
    if np.linalg.eigvalsh(matrix)[0] > -1e-12:
        lower = triangular(matrix)
        assert lower @ lower.T == pytest.approx(matrix)
        assert np.array_equal(lower, np.tril(lower))
    pair = triangular(np.array([[1.0, r], [r, 1.0]]))
    assert pair == pytest.approx(np.array([[1, 0], [r, np.sqrt(1 - r**2)]]))


def test_groups_keep_their_order_and_leave_others_alone():
    alone = {name: source(name, 0, i, 2 * i) for i, name in enumerate("abcd", 1)}
    found = group_correlated(alone, [("d", "b", 0.3), ("b", "c", 0.2), ("a", "elsewhere", 0.9)])
    assert [one.kind for one in found] == ["a", "b & c & d"]
    assert np.array_equal(found[1].correlation, [[1, 0.2, 0.3], [0.2, 1, 0], [0.3, 0, 1]])
    contribution = np.array([4.0, 6.0, 8.0])
    expected = contribution @ found[1].correlation @ contribution
    assert np.sum(found[1].columns_m3[-1] ** 2) == pytest.approx(expected)


def test_shares_add_up_and_common_errors_cancel():
    both = table(source("scale", 0, 10, 20), source("zero", 7, 7, 7))
    at_top, delivered = budget(both, 2.0), budget(both, 2.0, 1.0)
    assert sum(line.share for line in at_top.lines) == pytest.approx(1)
    assert at_top.u_m3 == pytest.approx(np.hypot(20, 7))
    assert [line.contribution for line in delivered.lines] == [10.0, 0.0]
    assert delivered.volume_m3 == 10.0
    halved = np.hypot(10, 7) / np.hypot(20, 7)
    assert at_top.lines[0].halved == pytest.approx(halved)


def test_reading_counts_once_for_a_dip_and_twice_for_a_delivery():
    one = table(source("scale", 0, 0, 0))
    reading = reading_sources((), 0.003)
    u_line, u_litre = 0.003 / 3**0.5, 0.0005 / 3**0.5
    assert budget(one, 1.0, reading=reading).u_m3 == pytest.approx(u_litre)
    assert budget(one, 1.5, reading=reading).u_m3 == pytest.approx(np.hypot(u_line, u_litre))
    delivered = budget(one, 1.5, 0.5, reading=reading)
    assert delivered.u_m3 == pytest.approx(2**0.5 * np.hypot(u_line, u_litre))
    assert delivered.table_u_m3 == 0.0
    assert all(line.is_default for line in delivered.lines[1:])


def test_declared_reading_replaces_the_default(tmp_path):
    rows = [("interpolation", 0.02, "m3"), ("rounding", 0.0, "m3")]
    settings = {"table.step_m": 0.5, "survey.side": "inside"}
    job = tankcal.load(write_job(tmp_path / "job", uncertainty=rows, settings=settings))
    reading = reading_sources(job.inputs, 1.0)
    assert [float(one.columns_m3[0, 0]) for one in reading] == [0.02, 0.0]
    assert not any(one.is_default for one in reading)


@pytest.mark.slow
def test_a_course_height_moves_the_joints_above_it(tmp_path):
    """Courses of other radii: the area below a joint less that above it, against a moved joint."""
    radii = [6.50, 6.49, 6.47]
    settings = {"table.step_m": 0.25, "survey.side": "inside", "tank.nominal_height_m": 6.0}
    rows = [("course_heights", 3.0, "mm")]
    parts = {"radius": radii, "height": 6.0, "settings": settings, "sd_mm": 0.1, "rings": 2}
    result = tankcal.run(
        tankcal.load(write_job(tmp_path / "a", courses=3, uncertainty=rows, **parts))
    )
    found = result.body.derivatives(np.array([1.0, 3.0, 6.0]))["course_heights"]
    steps = np.pi * np.array([6.50**2 - 6.49**2, 6.49**2 - 6.47**2])
    expected = [[0, 0, 0], [steps[0], 0, 0], [steps.sum(), steps[1], 0]]
    assert found == pytest.approx(np.array(expected), abs=2e-3)
    own = next(one for one in result.table.sources if one.kind == "course_heights")
    assert np.sum(own.columns_m3[-1] ** 2) == pytest.approx(np.sum((found[-1] * 0.003) ** 2))


@pytest.mark.slow
def test_an_offset_widens_every_radius(tmp_path):
    settings = {"table.step_m": 0.5, "survey.side": "inside"}
    volumes = [
        run(tmp_path / name, radius=r, settings=settings)
        for name, r in (("a", 6.5), ("b", 6.501), ("c", 6.499))
    ]
    slope = (volumes[1].table.volume_m3 - volumes[2].table.volume_m3) / 0.002
    found = volumes[0].body.derivatives(volumes[0].table.height_m)["offset"]
    assert found == pytest.approx(slope, rel=1e-6)


@pytest.mark.slow
def test_deadwood_of_unknown_uncertainty_shares_one_error(tmp_path):
    items = [("coil", 0.5, 1.0, -0.4), ("pipe", 1.0, 3.0, -0.2), ("box", 0.0, 1.0, -1.0, 0.05)]
    settings = {"table.step_m": 0.5, "survey.side": "inside"}
    result = tankcal.run(
        tankcal.load(write_job(tmp_path / "job", deadwood=items, settings=settings))
    )
    shared = next(s for s in result.table.sources if s.kind == "deadwood" and s.is_default)
    assert abs(shared.columns_m3[-1, 0]) == pytest.approx(0.6 * 0.05 / 3**0.5)
    own = [s for s in result.table.sources if s.kind == "deadwood" and not s.is_default]
    assert [abs(s.columns_m3[-1, 0]) for s in own] == [pytest.approx(0.05)]


def lines_of(r=0.0, dof=(9.0, 4.0, np.inf)):
    """A budget of three causes, the first two correlated."""
    alone = {
        "a": source("a", 0, 3, 5, dof=dof[0]),
        "b": source("b", 0, 2, -4, dof=dof[1]),
        "c": source("c", 0, 1, 2, dof=dof[2]),
    }
    return table(*group_correlated(alone, [("a", "b", r)] if r else ()))


@pytest.mark.parametrize("r", [-0.9, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("low", [None, 0.4])
def test_factors_of_one_change_nothing(r, low):
    # property: to 1e-12
    capacity = lines_of(r)
    as_it_is, supposed = (budget(capacity, 1.7, low, factors=f) for f in (None, [1.0] * 3))
    for name in ("u_m3", "U_m3", "k", "dof", "table_u_m3"):
        assert getattr(supposed, name) == pytest.approx(getattr(as_it_is, name), rel=1e-12)
    for name in ("share", "contribution", "halved", "u"):
        before, after = ([getattr(one, name) for one in b.lines] for b in (as_it_is, supposed))
        assert after == pytest.approx(before, rel=1e-12)


@pytest.mark.parametrize("r", [-0.9, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("line", [0, 1, 2])
def test_half_of_a_u_is_what_the_line_says_of_it(r, line):
    """Second method: `halved` of the line is computed from variances, not from columns."""
    capacity, factors = lines_of(r), [1.0, 1.0, 1.0]
    factors[line] = 0.5
    now, then = budget(capacity, 2.0), budget(capacity, 2.0, factors=factors)
    assert then.U_m3 / now.U_m3 == pytest.approx(now.lines[line].halved, rel=1e-12)
    assert then.lines[line].u == pytest.approx(0.5 * now.lines[line].u)
    assert then.lines[line].dof == now.lines[line].dof


@pytest.mark.parametrize("factors", [(0.0, 2.0, 3.0), (0.5, 0.5, 0.5), (3.0, 0.0, 0.1)])
def test_factors_of_correlated_inputs_are_those_of_propagation(factors):
    """Second method: the same inputs with other u through `propagate`."""
    found = budget(lines_of(0.5, (9.0, 9.0, 9.0)), 2.0, factors=factors)
    given = [Input(n, standard(f, dof=9.0)) for n, f in zip("abc", factors, strict=True) if f]
    slopes = [s for s, f in zip((5.0, -4.0, 2.0), factors, strict=True) if f]
    pairs = {("a", "b"): 0.5} if factors[0] and factors[1] else {}
    model = propagate(lambda x: sum(s * one for s, one in zip(slopes, x, strict=True)),
                      Inputs(given, pairs))  # fmt: skip
    assert found.u_m3 == pytest.approx(model.u[0], rel=1e-9)
    assert found.dof == pytest.approx(model.dof[0], rel=1e-9)


@pytest.mark.parametrize("factors", [[1.0], [1.0] * 4, [1.0, 1.0, -0.1], [1, 1, np.nan]])
def test_factors_that_fit_no_budget_are_refused(factors):
    with pytest.raises(ValueError, match="expected 3 factors"):
        budget(lines_of(), 2.0, factors=factors)


@pytest.mark.slow
def test_a_supposed_u_is_that_of_a_run_with_it(tmp_path):
    """Second method: the job once more with that u halved in uncertainty.csv, line by line."""
    given = [("scale", 40.0, "ppm"), ("datum", 1.0, "mm"), ("offset", 2.0, "mm")]
    result = run(tmp_path / "as-it-is", uncertainty=given)
    names = [one.name for one in result.budget().lines]
    for number, (name, u, unit) in enumerate(given):
        rows = [*given[:number], (name, u / 2, unit), *given[number + 1 :]]
        halved = run(tmp_path / name, uncertainty=rows).budget()
        factors = [0.5 if one == name else 1.0 for one in names]
        supposed = result.budget(factors=factors)
        assert supposed.U_m3 == pytest.approx(halved.U_m3, rel=1e-12)
        assert supposed.dof == pytest.approx(halved.dof, rel=1e-9) or np.isinf(supposed.dof)
        assert [one.share for one in supposed.lines] == pytest.approx(
            [one.share for one in halved.lines], abs=1e-12
        )
