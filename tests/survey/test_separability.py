"""What may be wrong in place of an image point that was rejected: coordinates as pairs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from surveyed import by_photographs

from tankcal.adjust import CRITICAL
from tankcal.survey import adjust_survey
from tankcal.survey.network import adjust, reliability
from tankcal.survey.network.reliability import alternatives
from tankcal.survey.network.snooping import set_use


def quantity(survey, uses, row):
    """Test quantity of an image point in the survey adjusted anew."""
    tables = adjust(set_use(survey, {"image points": uses})).residuals
    table = next(one for one in tables if one.source == "image points")
    return float(table.test_statistic[table.rows == row][0])


def adjusted_with_blunders(seed):
    """A survey of eight photographs of which every fifteenth image point is off, not explained."""
    measurements = by_photographs(seed, photos=8)[0]
    images = measurements.image_points
    xy = images.xy_mm.copy()
    xy[7::15] += 0.04 * np.random.default_rng(1).normal(size=xy[7::15].shape)
    blundered = replace(measurements, image_points=replace(images, xy_mm=xy))
    settings = replace(measurements.settings, explain=False)
    return adjust_survey(replace(blundered, settings=settings)).adjusted


@pytest.mark.slow
def test_image_point_agrees_only_without_the_named_reading():
    """Second method: every ray of the same point in turn is left out, and all adjusted again."""
    found = adjusted_with_blunders(3)
    points, use = found.survey.image_points, found.survey.image_points.use
    named = others = 0
    for row in np.flatnonzero(use == 0):
        likely = {other for _, other in alternatives(found, "image points", int(row))}
        rays = np.flatnonzero((points.point == points.point[row]) & (use > 0))
        for ray in rays:
            uses = np.array(use)
            uses[row], uses[ray] = 1.0, 0.0
            own = quantity(found.survey, uses, row)
            uses[ray] = 1.0
            stands_out = quantity(found.survey, uses, ray) > CRITICAL
            assert (ray in likely) == (own <= CRITICAL and stands_out)
            named, others = named + (ray in likely), others + (ray not in likely)
    assert named
    assert others


@pytest.mark.slow
def test_unknowns_are_solved_once_per_observation_set_aside(monkeypatch):
    """Asked again for every candidate, a block of 26 321 points took two minutes more."""
    measurements = by_photographs(3, photos=8)[0]
    found = adjust_survey(
        replace(measurements, settings=replace(measurements.settings, explain=False))
    ).adjusted
    asked, moves_of = [], reliability.moves_of
    monkeypatch.setattr(
        reliability, "moves_of", lambda *given: asked.append(given) or moves_of(*given)
    )
    monkeypatch.setattr(reliability, "WORTH", 0.0)
    alternatives(found, "image points", 5)
    assert len(asked) == 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_bound_of_the_test_leaves_out_no_alternative(seed, monkeypatch, figure):
    """Second method: without the bound, every reading that stands out is tested in full."""
    found = adjusted_with_blunders(seed)
    monkeypatch.setattr(reliability, "WORTH", 0.0)
    rows = np.flatnonzero(found.survey.image_points.use == 0)
    bounded = [alternatives(found, "image points", int(row)) for row in rows]
    bound, kept = reliability._may_explain, []
    monkeypatch.setattr(
        reliability,
        "_may_explain",
        lambda v, *of: kept.append(bound(v, *of)) or np.ones(len(v), dtype=bool),
    )
    assert bounded == [alternatives(found, "image points", int(row)) for row in rows]
    assert any(bounded)
    figure("alternatives, share of readings that the bound leaves", np.concatenate(kept).mean())


def test_bound_of_the_test_is_never_above_the_test_itself():
    """Second method: pairs of random surveys, one rejected, tested again without another one."""
    rng, limit, left_out, kept = np.random.default_rng(5), reliability.LIMITS[2], 0, 0
    for _ in range(400):
        design, y = rng.normal(size=(30, 3)), rng.normal(size=30)
        own, other, rest = slice(0, 2), slice(2, 4), slice(4, None)

        def solved(rows, design=design, y=y):
            inverse = np.linalg.inv(design[rows].T @ design[rows])
            return inverse, inverse @ design[rows].T @ y[rows]

        y[other] += 5 * rng.normal(size=2)
        inverse, x = solved(slice(2, None))
        cofactors = np.linalg.inv(np.eye(2) + design[own] @ inverse @ design[own].T)
        e = y[own] - design[own] @ x
        e *= rng.uniform(0.8, 1.8) * np.sqrt(limit / (e @ cofactors @ e))
        y[own] = design[own] @ x + e
        aside = SimpleNamespace(e=e, inverse=cofactors, back=cofactors @ e)
        b = design[other] @ inverse @ design[own].T
        v = y[other] - design[other] @ x - b @ aside.back
        redundancy = 1 - np.diag(design[other] @ inverse @ design[other].T)
        shared = np.trace(b @ cofactors @ b.T)
        may = reliability._may_explain(v[None], redundancy[None], np.array([shared]), aside)[0]
        inverse, x = solved(rest)
        e = y[own] - design[own] @ x
        t = e @ np.linalg.solve(np.eye(2) + design[own] @ inverse @ design[own].T, e)
        assert may or t > limit
        left_out, kept = left_out + (not may), kept + (t <= limit)
    assert left_out > 40
    assert kept > 40
