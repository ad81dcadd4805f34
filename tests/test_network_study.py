"""Statistics of the network by simulation: coverage, normalised errors, power of the test."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from networks import CONTROL_SD_M, IMAGE_SD_MM, TAPE_SD_M, photographed

from tankcal.network import Instrument, adjust
from tankcal.observations import KnownUnknowns

TAPE_SCALE_SD = 1e-4


def redrawn(exact, rng, scale_sd=TAPE_SCALE_SD):
    """The survey with new errors; its one tape has a scale error of its own."""
    control, tapes = exact.observations
    images = exact.image_points
    scale = rng.normal(0, scale_sd)
    return replace(
        exact,
        image_points=replace(
            images, xy_mm=images.xy_mm + rng.normal(0, IMAGE_SD_MM, images.xy_mm.shape)
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


def coverage(surveys, seed=0):
    """Share of 95 % intervals that hold the truth, and chi-square of normalised errors, of points.

    Also of the mean radius of the lowest ring.
    """
    exact, truth = photographed(noise=0.0)
    exact = replace(exact, xyz_m=truth.xyz_m)
    rng, ring = np.random.default_rng(seed), np.arange(12)
    unit = truth.xyz_m[ring] * [1, 1, 0]
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    inside, radius, chi2, count = 0, 0, 0.0, 0
    for _ in range(surveys):
        found = adjust(redrawn(exact, rng))
        error = found.xyz_m - truth.xyz_m
        normalised = error / found.point_sd_m
        inside += np.count_nonzero(np.abs(normalised) < 1.959964)
        count += normalised.size
        blocks = found.point_covariances_m2
        chi2 += np.einsum("ni,nij,nj->", error, np.linalg.inv(blocks), error)
        a = (unit / 12).ravel()
        sd = np.sqrt(a @ found.covariance_m2(ring) @ a)
        radius += abs(a @ error[ring].ravel()) < 1.959964 * sd
    return inside / count, radius / surveys, chi2 / count


@pytest.mark.study
def test_intervals_cover_at_full_size(figure):
    points, radius, chi2 = coverage(1000)
    figure("1000 surveys: coverage of points, of a mean radius, chi2 per coordinate",
           f"{points:.4f}, {radius:.4f}, {chi2:.4f}")  # fmt: skip
    assert 0.935 < points < 0.965
    assert 0.935 < radius < 0.965
    assert chi2 == pytest.approx(1, abs=0.03)


def test_intervals_cover(figure):
    points, radius, chi2 = coverage(50)
    figure("50 surveys: coverage of points, of a mean radius, chi2 per coordinate",
           f"{points:.4f}, {radius:.4f}, {chi2:.4f}")  # fmt: skip
    assert 0.92 < points < 0.98
    assert 0.84 < radius <= 1.0
    assert chi2 == pytest.approx(1, abs=0.15)


def power(surveys, seed=1):
    """Share of surveys in which a blunder of the minimal detectable size is found."""
    exact, truth = photographed(noise=0.0)
    exact = replace(exact, xyz_m=truth.xyz_m)
    rng = np.random.default_rng(seed)
    tables = adjust(redrawn(exact, rng)).residuals
    table = next(t for t in tables if t.source == "image points")
    found = 0
    rows = rng.choice(np.flatnonzero(table.redundancy[:, 0] > 0.2), surveys)
    for row in rows:
        survey = redrawn(exact, rng)
        images, xy = survey.image_points, survey.image_points.xy_mm.copy()
        xy[table.rows[row], 0] += table.mdb[row, 0]
        bad = replace(survey, image_points=replace(images, xy_mm=xy))
        tested = next(t for t in adjust(bad).residuals if t.source == "image points")
        found += abs(tested.w[row, 0]) > scipy.stats.norm.isf(0.0005)
    return found / surveys


@pytest.mark.study
def test_baarda_power_at_full_size(figure):
    """Closed form: 0.80 at the minimal detectable bias (0.1 %, 80 %)."""
    found = power(2500)
    figure("2500 blunders of the minimal detectable size: found", f"{found:.4f}")
    assert found == pytest.approx(0.80, abs=0.02)


def test_baarda_power():
    assert power(125) == pytest.approx(0.80, abs=0.11)


def test_a_known_scale_is_one_observation():
    """The tape's scale is a weighted unknown: its sd after cannot be larger than before."""
    exact, _ = photographed()
    survey = redrawn(exact, np.random.default_rng(0))
    found = adjust(survey)
    known = [one for one in found.problem.observations if isinstance(one, KnownUnknowns)]
    assert [one.of for one in known] == ["scale"]
    column = found.problem.layout.scale[0]
    assert found.solution.cofactors([column])[0, 0] < TAPE_SCALE_SD**2
