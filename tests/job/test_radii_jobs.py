"""radii.csv, radii_cov.npz, [radii] and [change]: what is read, and what is told of bad ones.

Truth: the files as they were written; of each slip the one line that names it.
"""

import numpy as np
import pytest
from job_builder import assert_same_job, write_book, write_folder
from numpy.testing import assert_allclose
from radii_jobs import RADII_M, partial_parts, radii_parts

import tankcal
from tankcal.errors import InputError

RADII, SETTINGS = "radii.csv", "job.toml"


def problems(tmp_path, parts):
    """(place, code) of all problems of a job; [] without one."""
    return told(lambda: tankcal.load(write_folder(tmp_path / "job", parts)))


def told(load):
    try:
        load()
    except InputError as refused:
        return [((one.file, one.column), one.expected.code) for one in refused.problems]
    return []


def test_what_is_read(tmp_path):
    given = {"radii__reference_temperature_c": 15.0, "radii__note": "certificate 7"}
    job = tankcal.load(write_folder(tmp_path / "job", radii_parts(**given)))
    assert_allclose(job.radii.radius_m, RADII_M)
    assert_allclose(job.radii.covariance_m2, 9e-8 * np.eye(5))
    assert (job.radii.u_common_m, job.radii.temperature_c) == (0.7e-3, 15.0)
    assert (job.radii.source, job.radii.note, job.radii.change) == ("table", "certificate 7", None)


def test_change_beside_a_survey(tmp_path):
    job = tankcal.load(write_folder(tmp_path / "job", partial_parts(change__shared_mm=0.1)))
    assert (job.radii.change.common_m, job.radii.change.own_m, job.radii.change.shared_m) == (
        0.8e-3,
        0.3e-3,
        1e-4,
    )


@pytest.mark.slow
def test_folder_and_workbook_give_the_same_job(tmp_path):
    for number, parts in enumerate((radii_parts(), partial_parts())):
        folder = tankcal.load(write_folder(tmp_path / f"job{number}", parts))
        book = tankcal.load(write_book(tmp_path / f"job{number}.xlsx", parts))
        assert_same_job(folder, book)


def test_rows_in_another_order(tmp_path):
    parts = radii_parts()
    heading, *rows = parts.tables["radii"]
    parts.tables["radii"] = [heading, *rows[::-1]]
    assert_allclose(tankcal.load(write_folder(tmp_path / "job", parts)).radii.radius_m, RADII_M)


SLIPS = {
    "course_without_radius": (lambda t: t.pop(), "course"),
    "radius_missing": (lambda t: t[2].__setitem__(1, None), "radius_m"),
    "name_twice": (lambda t: t.append(["1", 7.2, 0.3]), "course"),
    "no_such_name": (lambda t: t.append(["9", 7.2, 0.3]), "course"),
    "radius_is_diameter": (lambda t: t[1].__setitem__(1, 14.4), "radius_m"),
    "radius_impossible": (lambda t: t[1].__setitem__(1, 23.6), "radius_m"),
}


@pytest.mark.parametrize("code", SLIPS)
def test_a_slip_in_the_table(tmp_path, code):
    slip, column = SLIPS[code]
    parts = radii_parts()
    slip(parts.tables["radii"])
    assert problems(tmp_path, parts) == [((RADII, column), code)]


def test_negative_numbers(tmp_path):
    parts = radii_parts()
    parts.tables["radii"][1][1:] = [-7.2, -0.3]
    found = problems(tmp_path, parts)
    assert [place for place, _ in found] == [(RADII, "radius_m"), (RADII, "u_mm")]


@pytest.mark.parametrize("key", ["radii.source", "radii.u_common_mm"])
def test_a_setting_that_is_needed(tmp_path, key):
    parts = radii_parts()
    del parts.settings[key]
    assert problems(tmp_path, parts) == [((SETTINGS, key), "missing_beside")]


def test_settings_without_radii(tmp_path):
    parts = radii_parts()
    del parts.tables["radii"]
    codes = [code for _, code in problems(tmp_path, parts)]
    assert sorted(codes) == ["missing_points_file", "settings_without_radii"]


@pytest.mark.parametrize("key", ["change.common_mm", "change.own_mm"])
def test_a_survey_needs_a_change(tmp_path, key):
    parts = partial_parts()
    del parts.settings[key]
    assert problems(tmp_path, parts) == [((SETTINGS, key), "change_missing")]


def test_a_change_needs_a_survey(tmp_path):
    parts = radii_parts(change__common_mm=1.0, change__own_mm=1.0)
    assert [code for _, code in problems(tmp_path, parts)] == 2 * ["change_without_survey"]


def test_more_shared_than_the_radii_have(tmp_path):
    parts = partial_parts(change__shared_mm=0.8)
    assert problems(tmp_path, parts) == [((SETTINGS, "change.shared_mm"), "shared_too_large")]


def test_inputs_of_a_survey_have_no_effect_without_one(tmp_path):
    parts = radii_parts()
    parts.tables["uncertainty"] = [["input", "u", "unit"], ["scale", 10.0, "ppm"]]
    ((place, _),) = problems(tmp_path, parts)
    assert place == ("uncertainty.csv", "input")


def archive(**changes):
    """Arrays of radii_cov.npz, some of them other ones."""
    return {"covariance_m2": 9e-8 * np.eye(5), "courses": np.array([*"12345"])} | changes


ARCHIVES = {
    "covariance_shape_of_radii": archive(covariance_m2=9e-8 * np.eye(4)),
    "covariance_not_definite": archive(covariance_m2=9e-8 * (2 * np.ones((5, 5)) - np.eye(5))),
    "covariance_not_symmetric": archive(covariance_m2=9e-8 * np.triu(np.ones((5, 5)))),
    "covariance_variances": archive(covariance_m2=9.0 * np.eye(5)),
    "covariance_infinite": archive(covariance_m2=np.nan * np.eye(5)),
    "covariance_other_name": archive(courses=np.array([*"12354"])),
    "covariance_names": archive(courses=np.arange(5)),
}


def without_u(parts):
    for row in parts.tables["radii"]:
        del row[2:]
    return parts


@pytest.mark.parametrize("code", ARCHIVES)
def test_a_bad_covariance(tmp_path, code):
    folder = write_folder(tmp_path / "job", without_u(radii_parts()))
    np.savez(folder / "radii_cov.npz", **ARCHIVES[code])
    found = told(lambda: tankcal.load(folder))
    assert {one for _, one in found} == {code}


def test_a_covariance_beside_u(tmp_path):
    folder = write_folder(tmp_path / "job", radii_parts())
    np.savez(folder / "radii_cov.npz", **archive())
    assert [code for _, code in told(lambda: tankcal.load(folder))] == ["covariance_beside_u"]


def test_a_covariance_without_radii(tmp_path):
    folder = write_folder(tmp_path / "job", radii_parts())
    (folder / "radii.csv").unlink()
    np.savez(folder / "radii_cov.npz", **archive())
    codes = [code for _, code in told(lambda: tankcal.load(folder))]
    assert "covariance_without_radii" in codes


def test_no_archive_at_all(tmp_path):
    folder = write_folder(tmp_path / "job", without_u(radii_parts()))
    (folder / "radii_cov.npz").write_bytes(b"no archive")
    assert [code for _, code in told(lambda: tankcal.load(folder))] == ["covariance_damaged"]


def test_radii_of_another_kind_of_tank(tmp_path):
    parts = radii_parts(tank__kind="sphere")
    codes = [code for _, code in problems(tmp_path, parts)]
    assert "not_for_this_kind" in codes


def test_radii_beside_liquid(tmp_path):
    from metered_tanks import metered_parts

    parts, liquid = radii_parts(), metered_parts()
    parts.tables["liquid"] = liquid.tables["liquid"]
    parts.registers |= {"meters": liquid.registers["meters"]}
    parts.settings |= {k: v for k, v in liquid.settings.items() if k.startswith("liquid.")}
    assert "radii_beside_liquid" in [code for _, code in problems(tmp_path, parts)]
