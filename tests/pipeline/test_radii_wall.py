"""A wall of declared radii: its volumes and their U.

Truth: the closed form of courses with head; the published volumes of tank S-1
(shell-numbers, section 1); U by hand; invariance.
"""

from dataclasses import replace

import numpy as np
import pytest
from job_builder import write_folder
from numpy.testing import assert_allclose
from radii_jobs import HEIGHTS_M, RADII_M, closed_volume_m3, radii_parts

import tankcal
from tankcal.geometry.field.estimate import MeanField

JOINTS_M = np.cumsum(HEIGHTS_M)


def computed(folder, parts):
    return tankcal.run(tankcal.load(write_folder(folder, parts)), simulated=False)


@pytest.mark.slow
@pytest.mark.parametrize("rho", [850.0, 0.0, 1000.0])
def test_volumes_are_the_closed_form(tmp_path, rho):
    table = computed(tmp_path / "job", radii_parts(table__liquid_density_kg_m3=rho)).table
    expected = [closed_volume_m3(dip, rho=rho) for dip in table.height_m]
    assert_allclose(table.volume_m3, expected, rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rho", "published"), [(0.0, 1369.27879), (850.0, 1369.70981), (1000.0, 1369.78588)]
)
def test_published_volumes_of_s_1(tmp_path, rho, published):
    found = computed(tmp_path / "job", radii_parts(table__liquid_density_kg_m3=rho))
    assert abs(found.at(8.4).value_m3 - published) < 1.5e-4  # radii are printed to a micrometre


def test_u_at_the_joints_is_that_of_the_radii(tmp_path):
    """Bulge and taper are in the radii already: they move no volume there."""
    table = computed(tmp_path / "job", radii_parts()).table
    rows = np.searchsorted(table.height_m, JOINTS_M - 1e-6)
    girths = 2 * np.pi * np.array(RADII_M) * HEIGHTS_M
    own = np.sqrt(np.cumsum((0.3e-3 * girths) ** 2))
    assert_allclose(table.u_m3[rows], np.hypot(0.7e-3 * np.cumsum(girths), own), rtol=1e-9)
    assert table.u_m3[rows[0] // 2] > 1.1 * np.hypot(0.7e-3, 0.3e-3) * girths[0] / 2  # between


def test_declared_departures_stand_in_place_of_the_assumed(tmp_path):
    parts = radii_parts()
    parts.tables["uncertainty"] = [
        ["input", "u", "unit"], ["barrel", 1e-6, "mm"], ["taper", 1e-6, "mm"],
    ]  # fmt: skip
    table = computed(tmp_path / "job", parts).table
    half = np.argmin(np.abs(table.height_m - 0.9))
    girth = 2 * np.pi * RADII_M[0] * 0.9
    assert_allclose(table.u_m3[half], np.hypot(0.7e-3, 0.3e-3) * girth, rtol=1e-6)


def test_a_barrel_moves_no_volume_at_a_joint(tmp_path):
    """Closed form: of 1 - z^2, mean 2/3, a rise to half a course has none, to a third -0.0494 h."""
    field = MeanField(np.array(RADII_M))
    lacking = (1 - field.sites.zeta**2) - field.seen(1 - field.sites.zeta**2).ravel()
    weights = np.polynomial.legendre.leggauss(7)[1] / 2
    assert_allclose(lacking.reshape(5, 7) @ weights, 0, atol=1e-15)


@pytest.mark.slow
def test_radii_of_another_temperature(tmp_path):
    warm = computed(tmp_path / "job", radii_parts(radii__reference_temperature_c=15.0))
    cold = computed(tmp_path / "other", radii_parts())
    larger = (1 + 1.1e-5 * 5) ** 2
    assert_allclose(warm.table.volume_m3, larger * cold.table.volume_m3, rtol=1e-12)


@pytest.mark.slow
def test_side_plates_and_liquid_of_the_survey_take_nothing_off(tmp_path):
    empty = computed(tmp_path / "job", radii_parts()).table.volume_m3
    job = tankcal.load(tmp_path / "job")
    filled = replace(job.survey, side="inside", liquid_level_m=8.0, liquid_density_kg_m3=1000.0)
    again = tankcal.run(replace(job, survey=filled), simulated=False)
    assert_allclose(again.table.volume_m3, empty, rtol=1e-14)


def test_a_full_covariance_is_that_of_the_table(tmp_path):
    parts = radii_parts(radii__u_common_mm=0.0)
    for row in parts.tables["radii"]:
        del row[2]
    matrix = (0.4e-3) ** 2 * (0.5 * np.ones((5, 5)) + 0.5 * np.eye(5))
    folder = write_folder(tmp_path / "job", parts)
    np.savez(folder / "radii_cov.npz", covariance_m2=matrix, courses=np.array([*"12345"]))
    found = tankcal.run(tankcal.load(folder), simulated=False)
    girths = 2 * np.pi * np.array(RADII_M) * HEIGHTS_M
    assert_allclose(found.table.u_m3[-1], np.sqrt(girths @ matrix @ girths), rtol=1e-9)


@pytest.mark.slow
def test_the_record_names_where_radii_come_from(tmp_path):
    result = computed(tmp_path / "job", radii_parts(radii__note="certificate 1234/2009"))
    record = tankcal.record.record_of(result)
    assert record["radii"]["source"] == "table"
    assert record["radii"]["note"] == "certificate 1234/2009"
    choices = {one["code"]: one["value"] for one in record["choices"]}
    assert (choices["radii"], choices["radii_beside"]) == ("table", "none")
    assert [line["input"] for line in record["budget"]][:2] == [
        "course_radii_common",
        "course_radii",
    ]
