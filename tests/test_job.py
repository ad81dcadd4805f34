"""A sound job comes out in SI, the same from a folder and from a workbook."""

import datetime

import numpy as np
import openpyxl
import pytest
from job_builder import (
    assert_same_job,
    job_parts,
    toml_text,
    write_book,
    write_folder,
    write_job,
    write_workbook,
)

import tankcal.job
from tankcal.errors import InputError
from tankcal.job import load

FULL = {
    "sd_mm": (1.0, 2.0, 3.0),
    "paint_mm": [0.3, 0.2, None, 0.0, 0.1],
    "thickness_mm": [12.0, 10.0, 8.0, 8.0, 6.5],
    "uncertainty": [("scale", 5.0, "ppm"), ("datum", 1.5, "mm"), ("shell_temperature", 0.5, "K")],
    "settings": {
        "tank.owner": "Anyone = the owner",
        "tank.year": 1995,
        "survey.shell_temperature_c": 31.5,
        "survey.liquid_level_m": 0.0,
        "datum.dip_plate_z_m": 0.05,
        "datum.dip_x_m": 1.0,
        "datum.dip_y_m": 2.0,
        "datum.reference_height_m": 11.2,
        "table.coverage_probability": 0.99,
        "material.e_gpa": 200.0,
        "adjustment.snooping": False,
        "adjustment.scale": "a_posteriori",
        "certificate.number": 7,
        "certificate.date_of_issue": "2024-06-30",
        "certificate.notice": "RECONSTRUCTION",
    },
}


def test_a_job_in_si(tmp_path):
    job = load(write_job(tmp_path / "job", **FULL))
    assert (job.tank.id, job.tank.kind) == ("T-1", "vertical")
    assert (job.tank.nominal_diameter_m, job.tank.nominal_height_m) == (13.0, 9.5)
    assert job.tank.details == {"owner": "Anyone = the owner", "year": "1995"}
    assert (job.survey.side, job.survey.date) == ("outside", "2024-05-31")
    assert (job.survey.shell_temperature_c, job.survey.liquid_level_m) == (31.5, 0.0)
    assert job.datum == tankcal.job.Datum(0.0, 0.05, 1.0, 2.0, 11.2)
    assert (job.table.step_m, job.table.coverage_probability) == (0.01, 0.99)
    assert job.material == tankcal.job.Material(200e9, 1.1e-5, expansion_given=False)
    assert [course.name for course in job.courses] == ["1", "2", "3", "4", "5"]
    assert [course.thickness_m for course in job.courses] == [0.012, 0.010, 0.008, 0.008, 0.0065]
    assert [course.paint_m for course in job.courses] == [0.0003, 0.0002, 0.0, 0.0, 0.0001]
    assert (job.snooping, job.scale) == (False, "a_posteriori")
    assert job.certificate == {
        "number": "7",
        "date_of_issue": "2024-06-30",
        "notice": "RECONSTRUCTION",
    }
    assert [(declared.name, declared.u) for declared in job.inputs] == [
        ("scale", 5e-6),
        ("datum", 1.5e-3),
        ("shell_temperature", 0.5),
    ]
    assert job.inputs[0].dof == np.inf
    np.testing.assert_allclose(job.points.sd_m, np.tile([0.001, 0.002, 0.003], (120, 1)))
    assert job.points.rows[:2] == (2, 3)
    assert job.points.section[0] is None
    assert [file.file for file in job.files] == [
        "job.toml",
        "points.csv",
        "courses.csv",
        "uncertainty.csv",
    ]
    assert (job.source, job.warnings) == ("job", ())


def test_defaults(tmp_path):
    job = load(write_job(tmp_path / "job"))
    assert job.material == tankcal.job.Material(206e9, 1.1e-5, expansion_given=False)
    assert job.table == tankcal.job.TableSpec(0.01, 20.0)
    assert job.datum == tankcal.job.Datum(0.0)
    assert (job.snooping, job.scale, job.inputs, job.certificate) == (True, "a_priori", (), {})
    assert job.points.sd_m is None
    assert job.points.covariance_m2 is None
    np.testing.assert_allclose(np.hypot(*job.points.xyz_m[:, :2].T), 6.5)  # closed form
    np.testing.assert_allclose(np.unique(job.points.xyz_m[:, 2]), 0.95 + 1.9 * np.arange(5))


@pytest.mark.parametrize("changes", [{}, FULL])
def test_folder_and_workbook_give_the_same_job(tmp_path, changes):
    folder = load(write_job(tmp_path / "job", **changes))
    assert_same_job(folder, load(write_workbook(tmp_path / "job.xlsx", **changes)))


def test_a_folder_its_settings_file_and_a_text_path_are_the_same_job(tmp_path):
    folder = write_job(tmp_path / "job")
    one, two = load(str(folder)), load(folder / "job.toml")
    assert_same_job(one, two)
    assert (one.source, two.source) == ("job", "job")


def test_decimal_commas_give_the_same_job(tmp_path):
    changes = {"sd_mm": 1.5, "noise_mm": 3.0}
    commas = {"csv.separator": ";", "csv.decimal": ","}
    tabs = {"csv.separator": "\t"}
    job = load(write_job(tmp_path / "a", **changes))
    for name, settings in (("b", commas), ("c", tabs)):
        assert_same_job(job, load(write_job(tmp_path / name, settings=settings, **changes)))


def test_dates_may_be_dates(tmp_path):
    folder = write_job(tmp_path / "job")
    text = (folder / "job.toml").read_text().replace('"2024-05-31"', "2024-05-31")
    (folder / "job.toml").write_text(text)
    assert load(folder).survey.date == "2024-05-31"
    path = write_workbook(tmp_path / "job.xlsx")
    workbook = openpyxl.load_workbook(path)
    cells = [row for row in workbook["job"].iter_rows() if row[1].value == "date"]
    cells[0][2].value = datetime.date(2024, 5, 31)
    workbook.save(path)
    assert load(path).survey.date == "2024-05-31"


def test_coordinates_as_large_as_utm_lose_nothing(tmp_path):
    # property: the text in the file is the number in the job, to the last bit
    parts = job_parts(centre=(674321.125, 7184321.875), noise_mm=5.0)
    job = load(write_folder(tmp_path / "job", parts))
    assert [tuple(row) for row in job.points.xyz_m] == [
        tuple(row[1:4]) for row in parts.tables["points"][1:]
    ]


def test_order_of_columns_and_names_of_sections(tmp_path):
    parts = job_parts()
    rows = [[z, "S1", y, x, "007", name] for name, x, y, z in parts.tables["points"][1:]]
    parts.tables["points"] = [["z_m", "section", "y_m", "x_m", "generatrix", "point"], *rows]
    job = load(write_folder(tmp_path / "job", parts))
    plain = load(write_job(tmp_path / "plain"))
    np.testing.assert_array_equal(job.points.xyz_m, plain.points.xyz_m)
    assert job.points.names == plain.points.names
    assert set(job.points.section) == {"S1"}
    assert set(job.points.generatrix) == {"007"}


def warnings_of(path):
    return [(row.file, row.row, row.column) for row in load(path).warnings]


def test_warnings_do_not_stop_a_job(tmp_path):
    parts = job_parts(
        settings={"table.language": "pt", "table.step_m": 1.0},
        sd_mm=0.002,
        extra_points=[("twin", *job_parts().tables["points"][1][1:4])],
    )
    rows = parts.tables["points"]
    dropped = {f"C3R1P{number}" for number in range(1, 18)}  # 7 of 24 are left
    parts.tables["points"] = [row for row in rows if row[0] not in dropped]
    path = write_folder(tmp_path / "job", parts)
    lines = toml_text(parts.settings).split("\n")
    assert warnings_of(path) == [
        ("job.toml", lines.index("step_m = 1.0") + 1, "table.step_m"),
        ("job.toml", lines.index('language = "pt"') + 1, "table.language"),
        ("points.csv", len(parts.tables["points"]), "x_m"),
        ("points.csv", None, "sx_mm"),
        ("points.csv", None, "sy_mm"),
        ("points.csv", None, "sz_mm"),
        ("courses.csv", 4, "course"),
    ]
    assert load(path).table.language == "en"


def test_points_in_feet_are_a_warning(tmp_path):
    parts = job_parts()
    for row in parts.tables["points"][1:]:
        row[1:3] = [value / 0.3048 for value in row[1:3]]
    assert warnings_of(write_folder(tmp_path / "job", parts)) == [("points.csv", None, "x_m")]


def test_clutter_far_from_the_tank_is_no_unit_error(tmp_path):
    clutter = [(f"station {i}", 500.0 + i, 300.0, 2.0) for i in range(6)]  # 5 % of the points
    assert warnings_of(write_job(tmp_path / "job", extra_points=clutter)) == []


def test_unreadable_points_are_not_missed_in_their_course(tmp_path):
    parts = job_parts(points_per_ring=12)
    for row in parts.tables["points"][1:9]:
        row[1] = "?"
    with pytest.raises(InputError) as caught:
        load(write_folder(tmp_path / "job", parts))
    assert {problem.column for problem in caught.value.problems} == {"x_m"}


# the full covariance


def covariance(n, seed=3):
    factor = np.random.default_rng(seed).normal(0, 1e-3, (n, n))
    return factor @ factor.T + 1e-6 * np.eye(n)


def test_full_covariance(tmp_path):
    matrix = covariance(360)
    job = load(write_job(tmp_path / "job", covariance_m2=matrix))
    np.testing.assert_allclose(job.points.covariance_m2, matrix, rtol=1e-12)
    assert job.files[-1].file == "points_cov.npz"


def test_a_singular_covariance_is_sound(tmp_path):
    # a free network leaves seven combinations without variance: semidefinite, not an error
    factor = np.random.default_rng(4).normal(0, 1e-3, (360, 353))
    job = load(write_job(tmp_path / "job", covariance_m2=factor @ factor.T))
    assert job.points.covariance_m2.shape == (360, 360)


def spoilt(change):
    matrix = covariance(360)
    change(matrix)
    return matrix


def break_symmetry(matrix):
    matrix[0, 1] += 1e-6


def break_definiteness(matrix):
    matrix[0, 1] = matrix[1, 0] = 2 * np.sqrt(matrix[0, 0] * matrix[1, 1])


def put_nan(matrix):
    matrix[5, 5] = np.nan


def in_square_millimetres(matrix):
    matrix *= 1e6


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (covariance(357), "expected floating-point numbers of shape (360, 360)"),
        (np.zeros((360, 360), dtype=int), "expected floating-point numbers"),
        (spoilt(break_symmetry), "not symmetric"),
        (spoilt(break_definiteness), "no negative eigenvalue"),
        (spoilt(put_nan), "NaN"),
        (spoilt(in_square_millimetres), "in mm2?"),
    ],
)
def test_covariances_that_are_refused(tmp_path, matrix, words):
    with pytest.raises(InputError) as caught:
        load(write_job(tmp_path / "job", covariance_m2=matrix))
    (problem,) = caught.value.problems
    assert (problem.file, problem.column) == ("points_cov.npz", "covariance_m2")
    assert words in problem.expected


@pytest.mark.parametrize(
    ("arrays", "column", "words"),
    [
        ({"points": np.array(["x"] * 120)}, "points", "name 1 is 'x'; expected 'C1R1P1'"),
        ({"points": np.array(["x"] * 119)}, "points", "the 120 names"),
        ({"points": np.arange(120)}, "points", "the 120 names"),
        ({"points": None}, "points", "missing array"),
        ({"covariance_m2": None}, "covariance_m2", "missing array"),
        ({"points": np.array([{}] * 120, dtype=object)}, None, "plain arrays"),
        ({"covariance_m2": np.zeros((2000, 2000))}, "covariance_m2", "more than 120 points need"),
    ],
)
def test_archives_that_are_refused(tmp_path, arrays, column, words):
    folder = write_job(tmp_path / "job", covariance_m2=covariance(360))
    names = np.array(load(folder).points.names)
    good = {"covariance_m2": covariance(360), "points": names}
    kept = {key: value for key, value in (good | arrays).items() if value is not None}
    np.savez(folder / "points_cov.npz", **kept)
    with pytest.raises(InputError) as caught:
        load(folder)
    (problem,) = caught.value.problems
    assert (problem.file, problem.column) == ("points_cov.npz", column)
    assert words in problem.expected


def test_either_a_covariance_or_standard_deviations(tmp_path):
    folder = write_job(tmp_path / "job", covariance_m2=covariance(360), sd_mm=2.0)
    with pytest.raises(InputError, match=r"points_cov\.npz: given beside sx_mm"):
        load(folder)


def test_sheets_that_are_not_read(tmp_path):
    parts = job_parts()
    parts.tables |= {"Read me": [["anything"]], "# old points": [["point"], ["x"]]}
    assert_same_job(load(write_book(tmp_path / "a.xlsx", parts)), load(write_job(tmp_path / "a")))


def test_a_section_is_for_all_points_or_for_none(tmp_path):
    job = write_job(tmp_path / "job")
    lines = (job / "points.csv").read_text().splitlines()
    lines = [lines[0] + ",section", *(f"{line},1" for line in lines[1:])]
    lines[7] = lines[7].removesuffix("1")
    (job / "points.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(tankcal.InputError, match=r"points\.csv, row 8, section: blank"):
        load(job)


def test_the_certificate_takes_fields_of_ones_own_but_no_slips(tmp_path):
    own = {"certificate.accreditation_number": "CAL 0815"}
    job = load(write_job(tmp_path / "own", settings=own))
    assert job.certificate["accreditation_number"] == "CAL 0815"
    for slip in ("certificate.notise", "certificate.Number"):
        with pytest.raises(tankcal.InputError, match="unknown key"):
            load(write_job(tmp_path / slip, settings={slip: "x"}))
