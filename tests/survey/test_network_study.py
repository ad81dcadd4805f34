"""Statistics of whole surveys by simulation: do intervals and covariances hold the truth?

Each simulated survey has its own scale error of its tape or distance meter, drawn from the sd that
is declared for it. Truth: the probabilities that the intervals and tests are made for.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.stats
from draws import draws
from networks import CONTROL_SD_M, IMAGE_SD_MM, TAPE_SD_M, by_total_station, photographed

from tankcal.survey.network import Instrument, adjust
from tankcal.survey.observations import KnownUnknowns

TAPE_SCALE_SD, METER_SCALE_SD = 1e-4, 2e-5
INSIDE = scipy.stats.norm.isf(0.025)


def redrawn(exact, rng, scale_sd=TAPE_SCALE_SD):
    """The survey by photographs with new errors; its one tape has a scale error of its own."""
    control, tapes = exact.observations
    images = exact.image_points
    scale = rng.normal(0, scale_sd)
    return replace(
        exact,
        image_points=replace(
            images, value=images.value + rng.normal(0, IMAGE_SD_MM, images.value.shape)
        ),
        observations=(
            replace(control, value=control.value + rng.normal(0, CONTROL_SD_M, 24)),
            replace(
                tapes,
                value=tapes.value * (1 + scale) + rng.normal(0, TAPE_SD_M, 8),
                instrument=np.zeros(8, dtype=int),
            ),
        ),
        instruments=(Instrument("tape", scale_sd=scale_sd),),
    )


def redrawn_station(exact, rng, scale_sd=METER_SCALE_SD):
    """The survey by total station with new errors and a scale error of its distance meter."""
    found = []
    for one in exact.observations:
        value = one.value + rng.normal(size=len(one)) * one.sd
        if one.kind == "distance":
            value = value + one.value * rng.normal(0, scale_sd)
            one = replace(one, instrument=np.zeros(len(one), dtype=int))
        found.append(replace(one, value=value))
    return replace(
        exact, observations=tuple(found), instruments=(Instrument("meter", scale_sd=scale_sd),)
    )


@dataclass(frozen=True)
class Kind:
    """A kind of survey: an exact one that starts at the truth, how to draw errors, how to adjust.

    rings  (rings, points) of the wall, for mean radii
    """

    exact: object
    draw: object
    datum: str
    rings: np.ndarray

    def drawn(self, rng):
        """A Survey with errors."""
        return self.draw(self.exact, rng)

    def adjusted(self, survey):
        """Its adjustment."""
        return adjust(survey, datum=self.datum)


def kinds(name):
    """The Kind "photographs" (tape, control) or "total station" (free network)."""
    if name == "photographs":
        exact, truth = photographed(noise=0.0)
        exact = replace(exact, xyz_m=truth.xyz_m)
        return Kind(exact, redrawn, "control", np.arange(48).reshape(4, 12))
    exact, truth = by_total_station(noise=0.0)
    exact = replace(exact, xyz_m=truth.xyz_m)
    return Kind(exact, redrawn_station, "inner", np.arange(24).reshape(3, 8))


@dataclass(frozen=True)
class Study:
    """Shares of 95 % intervals that hold the truth, and quantities with known distributions.

    points, radii  share of coordinates, of mean radii of rings
    whole          (surveys,) e' Q^-1 e of all coordinates, chi-square of `rank`
    sums           (surveys,) v'Pv, chi-square of dof
    """

    points: float
    radii: float
    whole: np.ndarray
    rank: int
    sums: np.ndarray
    dof: int


def study(name, surveys, seed=0):
    """The Study of so many surveys."""
    kind, rng = kinds(name), np.random.default_rng(seed)
    true = kind.exact.xyz_m
    to_radius = _radii(true, kind.rings)
    inside, radii, whole, sums = [], [], [], []
    for _ in range(surveys):
        found = kind.adjusted(kind.drawn(rng))
        error, covariance = (found.xyz_m - true).ravel(), found.covariance_m2()
        sd = np.sqrt(np.diag(covariance))
        inside.append(np.mean(np.abs(error) < INSIDE * sd))
        sd = np.sqrt(np.einsum("ri,ij,rj->r", to_radius, covariance, to_radius))
        radii.append(np.mean(np.abs(to_radius @ error) < INSIDE * sd))
        size = np.sqrt(np.diag(covariance))
        values, axes = np.linalg.eigh(covariance / np.outer(size, size))
        felt = values > 1e-9 * values[-1]
        whole.append(np.sum((axes.T @ (error / size))[felt] ** 2 / values[felt]))
        sums.append(found.solution.chi2)
    return Study(
        float(np.mean(inside)), float(np.mean(radii)), np.array(whole), int(felt.sum()),
        np.array(sums), found.dof,
    )  # fmt: skip


def _radii(xyz, rings):
    """(rings, 3 points) derivatives of the mean radius of each ring by all coordinates."""
    away = xyz * [1, 1, 0]
    unit = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    found = np.zeros((len(rings), *xyz.shape))
    for row, ring in zip(found, rings, strict=True):
        row[ring] = unit[ring] / len(ring)
    return found.reshape(len(rings), -1)


def told(figure, name, done):
    """Show what a study found, and how likely its chi-squares are."""
    surveys = len(done.whole)
    likely = [
        scipy.stats.kstest(values, scipy.stats.chi2(dof).cdf).pvalue
        for values, dof in ((done.whole, done.rank), (done.sums, done.dof))
    ]
    figure(
        f"{surveys} surveys, {name}",
        f"coverage of coordinates {done.points:.4f}, of radii {done.radii:.4f}; mean e'Q^-1 e /"
        f" rank {done.whole.mean() / done.rank:.4f} (p {likely[0]:.2f}), mean v'Pv / dof"
        f" {done.sums.mean() / done.dof:.4f} (p {likely[1]:.2f})",
    )
    return likely


def within(values, dof, sds=3.5):
    """Is the mean of chi-squares as it should be, within so many of its sds?"""
    return abs(values.mean() - dof) < sds * np.sqrt(2 * dof / len(values))


NAMES = ("photographs", "total station")


@pytest.mark.study
@pytest.mark.parametrize("name", NAMES)
def test_intervals_cover_at_full_size(name, figure):
    """Standard error of a mean chi-square over its dof: that of 500 surveys, in full of 1000."""
    done = study(name, draws(250, 1000))
    likely = told(figure, name, done)
    assert 0.935 < done.points < 0.965
    assert 0.935 < done.radii < 0.965
    assert within(done.whole, done.rank)
    assert within(done.sums, done.dof)
    assert min(likely) > 1e-3


@pytest.mark.slow
@pytest.mark.twentieth
@pytest.mark.parametrize("name", NAMES)
def test_intervals_cover(name, figure):
    done = study(name, 50)
    likely = told(figure, name, done)
    assert 0.92 < done.points < 0.98
    assert 0.88 < done.radii <= 1.0
    assert within(done.whole, done.rank)
    assert within(done.sums, done.dof)
    assert min(likely) > 1e-3


@pytest.mark.slow
def test_a_scale_error_that_is_not_declared_is_not_covered(figure):
    """Property: the study has teeth. With the tape's u_scale left out the radii miss the truth."""
    kind, rng = kinds("photographs"), np.random.default_rng(0)
    to_radius, missed = _radii(kind.exact.xyz_m, kind.rings), []
    for _ in range(20):
        survey = redrawn(kind.exact, rng, scale_sd=5e-3)
        blind = replace(survey, instruments=(Instrument("tape"),))
        found = adjust(blind)
        error = to_radius @ (found.xyz_m - kind.exact.xyz_m).ravel()
        sd = np.sqrt(np.einsum("ri,ij,rj->r", to_radius, found.covariance_m2(), to_radius))
        missed.append(np.mean(np.abs(error) > INSIDE * sd))
    figure("radii missed when a scale error is not declared", f"{np.mean(missed):.2f}")
    assert np.mean(missed) > 0.3


def test_a_known_scale_is_one_observation():
    """The tape's scale is a weighted unknown: its sd after cannot be larger than before."""
    exact, _ = photographed()
    survey = redrawn(exact, np.random.default_rng(0))
    found = adjust(survey)
    known = [one for one in found.problem.observations if isinstance(one, KnownUnknowns)]
    assert [one.of for one in known] == ["scale"]
    column = found.problem.layout.nuisance["scale"][0]
    assert found.solution.cofactor.among([column])[0, 0] < TAPE_SCALE_SD**2
