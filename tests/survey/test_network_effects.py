"""What an error in an observation does to the points, and other linear functions of a solution."""

from dataclasses import replace

import numpy as np
import pytest
from networks import by_total_station, photographed

import tankcal.survey.network.reliability
from tankcal.camera.model import PARAMETERS
from tankcal.errors import SolutionError
from tankcal.solver.effects import cofactors_within, responses
from tankcal.survey.network import Instrument, Survey, adjust, correlations, snoop
from tankcal.survey.network.datum import depends_on_datum
from tankcal.survey.network.quality import compare_left_out
from tankcal.survey.observations import (
    Azimuths,
    ControlCoordinates,
    Distances,
    HeightDifferences,
    PhotoOrientation,
)

SURVEY, TRUTH = photographed()
CONTROL, TAPES = SURVEY.observations
C_KNOWN = replace(
    SURVEY.cameras[0],
    state=tuple("weighted" if name == "c" else "free" for name in PARAMETERS),
    sd=np.where(np.arange(13) == 0, 0.01, np.nan),
)
WITH_TOOLS = replace(
    SURVEY,
    observations=(CONTROL, replace(TAPES, instrument=np.zeros(8, dtype=int))),
    instruments=(Instrument("tape", scale_sd=1e-4, offset_sd_m=1e-3),),
    cameras=(C_KNOWN,),
)
FREE = replace(WITH_TOOLS, observations=WITH_TOOLS.observations[1:])
CASES = {"control": WITH_TOOLS, "inner": FREE}


def sharply(survey, datum):
    return adjust(survey, datum=datum, tolerance=1e-7)


def biased(survey, source, row, value, by):
    """The survey with an error in one value."""
    if source == "image points":
        xy = survey.image_points.value.copy()
        xy[row, value] += by
        return replace(survey, image_points=replace(survey.image_points, value=xy))
    one = survey.observations[source]
    changed = one.value.copy()
    changed[row] += by
    observations = list(survey.observations)
    observations[source] = replace(one, value=changed)
    return replace(survey, observations=tuple(observations))


@pytest.mark.slow
@pytest.mark.parametrize("datum", CASES)
def test_effect_of_an_undetected_blunder(datum, figure):
    """Second method: a hundredth of the bias put in, adjusted again."""
    survey, worst = CASES[datum], 0.0
    found = sharply(survey, datum)
    for table in found.residuals:
        if table.source == "known beforehand":
            continue
        for i, j in ((1, 0), (len(table.rows) // 2, -1)):
            j %= table.mdb.shape[1]
            if not np.isfinite(table.mdb[i, j]):
                continue
            other = biased(survey, table.source, table.rows[i], j, table.mdb[i, j] / 100)
            moved = 100 * np.abs(sharply(other, datum).xyz_m - found.xyz_m).max()
            worst = max(worst, abs(moved / table.effect_m[i, j] - 1))
    figure(f"effect of a blunder against adjusting again, datum {datum}", f"{worst:.1e}")
    assert worst < 2e-3


@pytest.mark.parametrize("datum", CASES)
def test_effects_in_large_surveys(datum, monkeypatch, figure):
    """Second method: the exact effects; of the own point they are met, elsewhere bounded."""
    found = sharply(CASES[datum], datum)
    exact = next(t for t in found.residuals if t.source == "image points")
    assert exact.elsewhere_m is None  # worked out here, when first asked for
    monkeypatch.setattr(tankcal.survey.network.reliability, "EXACTLY", 0)
    again = tankcal.survey.network.reliability.residuals_of(found.problem, found.solution)
    large = next(t for t in again if t.source == "image points")
    assert (large.effect_m <= exact.effect_m * (1 + 1e-9)).all()
    assert (np.maximum(large.effect_m, large.elsewhere_m) >= exact.effect_m * (1 - 1e-9)).all()
    share = np.mean(large.effect_m > exact.effect_m * (1 - 1e-9))
    figure(f"a blunder moves its own point most, datum {datum}", f"{100 * share:.0f} % of values")
    assert share > 0.8
    size = (large.elsewhere_m / exact.effect_m).ravel()
    figure(f"bound elsewhere over largest effect, datum {datum}", f"median {np.median(size):.1f}")


def test_effects_between_points_in_large_surveys(monkeypatch):
    """Second method: the response of all points to each reading."""
    survey, truth = by_total_station()
    point, axis = np.repeat(np.arange(0, 24, 5), 3), np.tile(np.arange(3), 5)
    control = ControlCoordinates(truth.xyz_m[point, axis], np.full(15, 1e-4), point, axis)
    found = adjust(replace(survey, observations=(*survey.observations, control)))
    exact = [table.effect_m for table in found.residuals[:3]]
    monkeypatch.setattr(tankcal.survey.network.reliability, "FEW", 0)
    again = tankcal.survey.network.reliability.residuals_of(found.problem, found.solution)
    for table, effect in zip(again, exact, strict=False):
        np.testing.assert_allclose(table.effect_m, effect, rtol=1e-9)


def test_reading_set_aside_has_no_influence():
    use = np.ones(len(SURVEY.image_points.point))
    use[7] = 0
    found = adjust(replace(SURVEY, image_points=replace(SURVEY.image_points, use=use)))
    table = next(t for t in found.residuals if t.source == "image points")
    place = int(np.flatnonzero(table.rows == 7)[0])
    assert (table.effect_m[place] == 0).all()
    assert (np.delete(table.effect_m, place, axis=0) > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("datum", CASES)
def test_effect_of_an_unknown_known_beforehand(datum, figure):
    """Second method: adjusted again with the value known beforehand shifted."""
    survey = CASES[datum]
    found = sharply(survey, datum)
    tool, camera = survey.instruments[0], survey.cameras[0]
    shifted = camera.values + np.where(np.arange(13) == 0, 1e-4, 0.0)
    cases = {
        ("scale", 0): replace(survey, instruments=(replace(tool, scale=1e-6),)),
        ("offset_m", 0): replace(survey, instruments=(replace(tool, offset_m=1e-5),)),
        ("interior", int(found.problem.interior_of[0, 0])): replace(
            survey, cameras=(replace(camera, values=shifted),)
        ),
    }
    whole = found.covariance_m2()
    for (of, index), other in cases.items():
        column = found.effect_of_known_m(of, index)
        moved = 100 * (sharply(other, datum).xyz_m - found.xyz_m).ravel()
        worst = np.abs(column - moved).max() / np.abs(column).max()
        figure(f"one sd of {of}, datum {datum}: largest change, off by", f"{worst:.1e}")
        assert worst < 3e-3
        rest = whole - np.outer(column, column)
        assert np.linalg.eigvalsh(rest).min() > -1e-6 * np.trace(whole) / len(whole)
    assert not found.effect_of_known_m("scale", 5).any()


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("datum", CASES)
def test_thousands_of_check_observations(datum):
    """Second method: the cofactors of each row by themselves."""
    found = adjust(CASES[datum], datum=datum)
    rng = np.random.default_rng(5)
    start = rng.integers(0, 48, 3000)
    end = (start + rng.integers(1, 48, 3000)) % 48
    check = Distances(
        np.ones(3000), np.full(3000, 0.01), start, end, instrument=np.zeros(3000, dtype=int)
    )
    table = compare_left_out(found, check)
    columns = check.columns(found.problem.layout)
    jac = check.computed(found.solution.unknowns, True)[1]
    for i in range(0, 3000, 500):
        q = found.solution.cofactor.among(columns[i])
        assert table.sd[i, 0] ** 2 == pytest.approx(1e-4 + (jac[i] @ q @ jac[i].T)[0, 0], rel=1e-9)
    exact = compare_left_out(found, replace(check, sd=np.zeros(3000)))
    assert exact.sd == pytest.approx(np.sqrt(np.square(table.sd) - 1e-4), rel=1e-6)


@pytest.mark.slow
def test_the_tau_test_does_not_need_the_true_sds(figure):
    """Property: sds declared three times too small: w sets half the survey aside, tau does not."""
    images = SURVEY.image_points
    hopeful = replace(
        SURVEY,
        image_points=replace(images, sd=images.sd / 3),
        observations=tuple(replace(one, sd=one.sd / 3) for one in SURVEY.observations),
    )
    xy = images.value.copy()
    xy[50] += 0.15
    hopeful = replace(hopeful, image_points=replace(hopeful.image_points, value=xy))
    by_w = snoop(hopeful, robust=False)
    by_tau = snoop(hopeful, robust=False, test="tau")
    figure("rejected by w and tau, sds three times too small", f"{len(by_w.removed)}, "
           f"{len(by_tau.removed)}")  # fmt: skip
    assert [(one.source, one.row) for one in by_tau.removed] == [("image points", 50)]
    assert len(by_w.removed) > 10
    with pytest.raises(ValueError, match="w or tau"):
        snoop(SURVEY, test="t")


def test_correlations_of_camera_parameters():
    """Second way: the coefficient times both standard deviations is the covariance."""
    _, names, covariance = adjust(SURVEY).camera(3)
    r, sd = correlations(covariance), np.sqrt(np.diag(covariance))
    assert names[0] == "c"
    assert np.diag(r) == pytest.approx(1)
    assert np.abs(r).max() <= 1 + 1e-12
    assert r * np.outer(sd, sd) == pytest.approx(covariance)


def test_scale_of_the_covariances():
    found = adjust(SURVEY)
    assert found.scale() == 1.0
    assert found.scale("a_posteriori") == pytest.approx(found.sigma0**2)
    with pytest.raises(ValueError, match="a_priori"):
        found.scale("larger")
    point, axis = np.repeat([0, 9], 3), np.tile([0, 1, 2], 2)
    few = ControlCoordinates(np.zeros(6), np.ones(6), point, axis)
    bare = replace(SURVEY, points=SURVEY.points[:1], xyz_m=np.zeros((1, 3)), image_points=None,
                   photos=None, cameras=(), observations=(few.taken(slice(0, 3)),))  # fmt: skip
    with pytest.raises(SolutionError, match="no observation is redundant"):
        adjust(bare).scale("a_posteriori")


@pytest.mark.slow
def test_which_quantities_depend_on_the_datum():
    """Closed form: photos and tapes give the shape, not its place nor its attitude."""
    free = adjust(replace(SURVEY, observations=SURVEY.observations[1:]), datum="inner")
    two, ends = np.ones(2), {"start": np.array([0, 4]), "end": np.array([17, 30])}
    tape = Distances(two, two, **ends, instrument=np.array([-1, -1]))
    for one, depends in (
        (tape, False),
        (ControlCoordinates(two, two, np.array([0, 3]), np.array([0, 2])), True),
        (HeightDifferences(two, two, **ends), True),
        (Azimuths(two, two, **ends), True),
        (PhotoOrientation(two, two, np.array([0, 1]), np.array([0, 4])), True),
    ):
        assert depends_on_datum(free, one).tolist() == [depends] * 2
        assert not depends_on_datum(adjust(SURVEY), one).any()
    without = adjust(replace(SURVEY, observations=()), datum="inner")
    assert depends_on_datum(without, tape).all()


@pytest.mark.parametrize("datum", CASES)
def test_cofactors_of_observation_are_rows_times_responses(datum):
    """Second method: the change of all unknowns, Q J', through the rows once more."""
    found = sharply(CASES[datum], datum)
    solution, model = found.solution, found.problem.model
    for k, (group, jac) in enumerate(zip(model.groups, solution.cofactor.jacobians, strict=True)):
        rows = np.arange(len(jac))[::-3][:7]
        columns, own = group.columns[rows], jac[rows]
        changes = np.hstack([part for _, part in responses(solution.cofactor, columns, own)])
        changes = np.vstack([changes, np.zeros((1, changes.shape[1]))])
        wide = np.einsum("nmk,nkd->nmd", own, changes[columns]).reshape(
            *own.shape[:2], *own.shape[:2]
        )
        expected = np.array([wide[n, :, n, :] for n in range(len(own))])
        np.testing.assert_allclose(
            cofactors_within(solution.cofactor, k, rows), expected, atol=1e-9
        )


@pytest.mark.parametrize("over", [None, np.array([0, 1, 2])])
def test_a_reading_set_aside_is_judged_by_the_covariance_that_is_told(over):
    """Second method: an azimuth that nothing else holds, under inner constraints; by J C J'."""
    rng = np.random.default_rng(3)
    xyz = rng.uniform(-10, 10, (7, 3))
    start, end = np.triu_indices(7, 1)
    length = np.linalg.norm(xyz[end] - xyz[start], axis=1) + 1e-3 * rng.normal(size=len(start))
    tapes = Distances(length, np.full(len(start), 1e-3), start, end, np.full(len(start), -1))
    x, y, _ = xyz[5] - xyz[2]
    ends = np.array([2]), np.array([5])
    aside = Azimuths(np.array([np.arctan2(x, y)]) + 3e-4, np.full(1, 1e-4), *ends, use=np.zeros(1))
    names = tuple(f"P{i}" for i in range(7))
    found = adjust(Survey(names, xyz, observations=(tapes, aside)), datum="inner", over=over)
    x, y, _ = found.xyz_m[5] - found.xyz_m[2]
    by_end = np.array([y, -x, 0.0]) / (x * x + y * y)
    by_both = np.append(-by_end, by_end)
    variance = 1e-8 + by_both @ found.covariance_m2([2, 5]) @ by_both
    told = found.residuals[1]
    assert told.w[0, 0] == pytest.approx(told.residual[0, 0] / np.sqrt(variance), rel=1e-6)
    assert variance > 1.01e-8
