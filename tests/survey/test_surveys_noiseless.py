"""Measurements without any noise: nothing is divided by residuals, sigma0 or redundancy of zero."""

from dataclasses import replace

import numpy as np
import pytest
from surveyed import by_instruments, by_photographs, known, table

from tankcal.record.adjustment import adjustment_of
from tankcal.record.schema import to_plain
from tankcal.survey import adjust_survey
from tankcal.survey.measurements import Instrument, Measurements
from tankcal.survey.network import adjust
from tankcal.survey.network.quality import estimate_variance_components


def two_tapes(scale="a_priori"):
    """Closed form: two tapes of 5 m each on a right triangle, a third tape read twice alike."""
    control = known(
        ["P", "Q", "R", "C"], [[0, 0, 0], [6, 0, 0], [3, 9, 0], [3, 3.9, 0]], 0.0
    )  # fmt: skip
    control.sd_m[-1, :2] = np.nan
    tapes = table(
        "distances", [5.0, 5.0, 5.0, 5.0], [0.001, 0.002, 0.001, 0.001], ["P", "Q", "R", "R"],
        ["C"] * 4, horizontal=np.ones(4, dtype=bool), instrument=("A", "A", "B", "B"),
    )  # fmt: skip
    tools = (Instrument("A", "tape"), Instrument("B", "tape"))
    found = Measurements(control=control, readings=(tapes,), instruments=tools)
    return replace(found, settings=replace(found.settings, scale=scale))


def test_groups_whose_residuals_are_zero_keep_their_declared_sds():
    """Closed form: 1 and 2 mm of tape A; tape B's mean of two readings of 1 mm."""
    measurements = two_tapes()
    found = adjust_survey(measurements)
    assert found.sigma0 == 0
    rows = {row["name"]: row for row in to_plain(adjustment_of(found, measurements))["groups"]}
    assert (rows["A"]["sd_smallest"], rows["A"]["sd_largest"]) == (0.001, 0.002)
    assert rows["B"]["sd_smallest"] == pytest.approx(0.001 / np.sqrt(2))
    assert {row["factor"] for row in rows.values()} == {0.0}


def test_residuals_of_zero_do_not_make_coordinates_exact():
    """Property: a posteriori would scale everything to nothing; it is kept, and told."""
    found = adjust_survey(two_tapes("a_posteriori"))
    assert found.cov_scale == 1
    assert "all residuals are zero" in "\n".join(map(str, found.warnings))
    assert np.trace(found.full_covariance_m2(["C"])) > 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("make", [by_photographs, by_instruments])
@pytest.mark.parametrize("scale", ["a_priori", "a_posteriori"])
def test_surveys_without_noise_have_a_record(make, scale):
    measurements = make(noise=0.0)[0]
    measurements = replace(measurements, settings=replace(measurements.settings, scale=scale))
    found = adjust_survey(measurements)
    assert found.removed == ()
    assert found.cov_scale == 1
    record = to_plain(adjustment_of(found, measurements))
    assert all(row["sd_smallest"] > 0 for row in record["groups"])


def test_variance_components_of_nothing_leave_the_declared_ones():
    survey = adjust_survey(two_tapes()).adjusted.survey
    assert estimate_variance_components(survey, adjust)[1] == {}
