"""A survey predicted before it is measured: the network's own covariance, without observations."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.errors import SolutionError
from tankcal.survey import network
from tankcal.survey.network.snooping import start_from_adjusted

PHOTOS, STATIONS = EXAMPLE.parent / "silva-1995-photos", EXAMPLE.parent / "total-station"


def at_adjusted(folder):
    """The adjustment of an example, and its survey with everything at the adjusted values."""
    adjusted = tankcal.adjust_job(tankcal.load(folder)).adjusted
    survey = start_from_adjusted(adjusted.survey, adjusted)
    cameras = tuple(
        replace(camera, values=np.array(list(adjusted.camera(int(photo))[0].values())))
        for camera, photo in zip(survey.cameras, first_photos(survey), strict=True)
    )
    tools = tuple(
        replace(tool, scale=scale, offset_m=offset)
        for tool, scale, offset in zip(
            survey.instruments,
            adjusted.solution.unknowns.nuisance["scale"],
            adjusted.solution.unknowns.nuisance["offset_m"],
            strict=True,
        )
    )
    return adjusted, replace(survey, cameras=cameras, instruments=tools)


def first_photos(survey):
    """A photo of each camera."""
    cameras = () if survey.photos is None else survey.photos.camera
    return np.unique(cameras, return_index=True)[1]


@pytest.fixture(scope="module", params=[PHOTOS, STATIONS], ids=["photographs", "total station"])
def pair(request):
    adjusted, survey = at_adjusted(request.param)
    return adjusted, network.predict(survey)


@pytest.mark.slow(after=1)
def test_predicted_sds_are_those_of_the_adjustment(pair, figure):
    """Second method: the adjustment itself, linearised at the values that it found."""
    adjusted, predicted = pair
    found, known = predicted.point_sd_m, adjusted.point_sd_m
    uncertain = known > 1e-12  # m; what an azimuth holds exactly is left out of the ratio
    off = np.abs(found[uncertain] / known[uncertain] - 1).max()
    figure("largest relative difference of a predicted sd", off)
    assert found == pytest.approx(known, rel=1e-9, abs=1e-15)


def test_redundancy_needs_no_observed_values(pair):
    """Second method: redundancy numbers and detectable biases of the adjustment."""
    adjusted, predicted = pair
    for found, known in zip(predicted.residuals, adjusted.residuals, strict=True):
        assert found.redundancy == pytest.approx(known.redundancy, abs=1e-9)
        assert found.mdb == pytest.approx(known.mdb, rel=1e-6)


def test_observed_values_do_not_matter(pair):
    """Property: a survey whose every reading is absurd has the same predicted covariance."""
    _, predicted = pair
    absurd = tuple(replace(one, value=one.value + 7.0) for one in predicted.survey.observations)
    other = network.predict(replace(predicted.survey, observations=absurd))
    assert other.point_sd_m == pytest.approx(predicted.point_sd_m, rel=1e-12)


@pytest.mark.slow
def test_missing_datum_is_reported_as_by_adjustment():
    _, survey = at_adjusted(PHOTOS)
    bare = replace(survey, observations=survey.observations[1:])
    with pytest.raises(SolutionError, match="datum defect 6"):
        network.predict(bare)
