"""What may be wrong in place of an image point that was set aside: coordinates as pairs."""

from dataclasses import replace

import numpy as np
import pytest
from surveyed import by_photographs

from tankcal.adjust import CRITICAL
from tankcal.survey import adjust_survey
from tankcal.survey.network import adjust, separability
from tankcal.survey.network.separability import alternatives
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


def test_unknowns_are_solved_once_per_observation_set_aside(monkeypatch):
    """Asked again for every candidate, a block of 26 321 points took two minutes more."""
    measurements = by_photographs(3, photos=8)[0]
    found = adjust_survey(
        replace(measurements, settings=replace(measurements.settings, explain=False))
    ).adjusted
    asked, moves_of = [], separability.moves_of
    monkeypatch.setattr(
        separability, "moves_of", lambda *given: asked.append(given) or moves_of(*given)
    )
    monkeypatch.setattr(separability, "WORTH", 0.0)
    alternatives(found, "image points", 5)
    assert len(asked) == 1


@pytest.mark.parametrize("seed", [3, 4])
def test_bound_of_the_test_leaves_out_no_alternative(seed, monkeypatch, figure):
    """Second method: without the bound, every reading that stands out is tested in full."""
    found = adjusted_with_blunders(seed)
    monkeypatch.setattr(separability, "WORTH", 0.0)
    rows = np.flatnonzero(found.survey.image_points.use == 0)
    bounded = [alternatives(found, "image points", int(row)) for row in rows]
    bound, kept = separability._may_explain, []
    monkeypatch.setattr(
        separability,
        "_may_explain",
        lambda v, *of: kept.append(bound(v, *of)) or np.ones(len(v), dtype=bool),
    )
    assert bounded == [alternatives(found, "image points", int(row)) for row in rows]
    assert any(bounded)
    figure("alternatives, share of readings that the bound leaves", np.concatenate(kept).mean())
