"""A sound job comes out in SI, the same from a folder and from a workbook."""

import datetime
import hashlib

import numpy as np
import openpyxl
import pytest
from job_builder import (
    ROOF,
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


def declared(job):
    """The inputs of uncertainty.csv, without what is assumed beside them."""
    return [one for one in job.inputs if not one.is_default]


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
    assert [(one.name, one.u) for one in declared(job)] == [
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
    job = load(write_job(tmp_path / "job", settings={"table.monte_carlo": None}))
    assert job.material == tankcal.job.Material(206e9, 1.1e-5, expansion_given=False)
    assert job.table == tankcal.job.TableSpec(0.01, 20.0)
    assert job.table.monte_carlo
    assert job.datum == tankcal.job.Datum(0.0)
    assert (job.snooping, job.scale, declared(job), job.certificate) == (True, "a_priori", [], {})
    assert (job.correlations, job.stated, job.rule) == ((), (), None)
    assert job.points.sd_m is None
    assert job.points.covariance_m2 is None
    np.testing.assert_allclose(np.hypot(*job.points.xyz_m[:, :2].T), 6.5)  # closed form
    np.testing.assert_allclose(np.unique(job.points.xyz_m[:, 2]), 0.95 + 1.9 * np.arange(5))


@pytest.mark.parametrize("changes", [{}, FULL])
def test_folder_and_workbook_give_the_same_job(tmp_path, changes):
    folder = load(write_job(tmp_path / "job", **changes))
    assert_same_job(folder, load(write_workbook(tmp_path / "job.xlsx", **changes)))


def test_folder_settings_file_and_text_path_are_one_job(tmp_path):
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


VERTICAL = {
    "bottom": [(x, y, -0.01 * abs(x), 2.0) for x in (-4, 0, 4) for y in (-4, 0, 1, 4)],
    "deadwood": [("coil", 0.5, 1.0, -0.25, 0.01), ("manhole", 0.6, 1.2, 0.05)],
    "welds": [("2", 200.0), ("2", 20.0), ("4", 0.0)],
    "roof": {},
    "settings": {
        "tank.nominal_volume_m3": 1260.0,
        "survey.liquid_level_m": 2.0,
        "survey.liquid_density_kg_m3": 998.0,
        "table.fine_step_m": 0.001,
        "table.fine_zones": [[2.1, 2.4], [0.0, 0.3]],
        "table.volume_unit": "L",
        "table.max_interpolation_error_l": 5.0,
        "table.liquid_density_kg_m3": 850.0,
        "table.other_densities_kg_m3": [700.0, 1000.0],
        "table.height_expansion": True,
        "corrections.paint": False,
    },
    "uncertainty": [
        ("youngs_modulus", 5.0, "GPa"),
        ("liquid_density", 3.0, "kg/m3"),
        ("survey_level", 2.0, "mm"),
        ("survey_density", 1.0, "kg/m3"),
        ("bottom", 3.0, "mm"),
        ("barrel", 1.0, "mm"),
        ("roof_mass", 50.0, "kg"),
    ],
}
HORIZONTAL = {
    "kind": "horizontal",
    "settings": {
        "survey.side": "outside",
        "datum.dip_plate_z_m": 0.012,
        "table.step_m": None,
        "table.height_unit": "ft-in-16",
        "table.volume_unit": "bbl",
        "horizontal.end_a": "torispherical",
        "horizontal.end_a_dish_radius_m": 2.4,
        "horizontal.end_a_knuckle_radius_m": 0.24,
        "horizontal.end_b": "ellipsoidal",
        "horizontal.end_b_depth_m": 0.6,
        "horizontal.tilt_mm_per_m": -5.0,
        "horizontal.dip_from_a_m": 2.0,
        "horizontal.dip_direction": "square",
        "horizontal.thickness_mm": 8.0,
    },
    "uncertainty": [
        ("diameter", 2.0, "mm"),
        ("length", 5.0, "mm"),
        ("end_depth", 4.0, "mm"),
        ("tilt", 0.5, "mm/m"),
        ("dip_position", 20.0, "mm"),
        ("plate_thickness", 0.2, "mm"),
    ],
}
ELLIPTICAL = {
    "kind": "horizontal",
    "settings": {
        "horizontal.diameter_m": None,
        "horizontal.width_m": 1.78,
        "horizontal.height_m": 1.2,
        "horizontal.length_m": 2.45,
        "horizontal.roll_deg": -90.0,
    },
}
LYING = [(f"P{i}", np.sin(i), i / 4, np.cos(i)) for i in range(40)]
SCAN = {
    "kind": "horizontal",
    "extra_points": LYING,
    "settings": {
        "survey.side": "outside",
        "horizontal.diameter_m": None,
        "horizontal.azimuth_deg": 90.0,
        "horizontal.dip_from_a_m": 1.0,
        "horizontal.thickness_mm": 6.0,
    },
}
BALL = {"kind": "sphere", "uncertainty": [("diameter", 3.0, "mm")]}
MESH = {
    "kind": "mesh",
    "mesh": b"solid tank",
    "settings": {"mesh.unit": "in", "table.step_m": None, "table.max_interpolation_error_l": 1.0},
    "uncertainty": [("surface", 2.0, "mm"), ("scale", 20.0, "ppm")],
}
MEASURED = {"bottom_volumes": [(-0.05, 0.25, 0.01), (0.0, 1.5, 0.02), (0.2, 27.5, 0.05)]}
DRY = {"bottom_volumes": [(0.01, 0.0), (0.02, 0.0), (0.2, 15.5), (0.3, 28.5)]}


def test_parts_of_a_vertical_tank_in_si(tmp_path):
    job = load(write_job(tmp_path / "job", **VERTICAL))
    assert job.tank.nominal_volume_m3 == 1260.0
    welds = [np.degrees(course.welds_rad or []).round(9).tolist() for course in job.courses]
    assert welds == [[], [20.0, 200.0], [], [0.0], []]
    assert (job.survey.liquid_level_m, job.survey.liquid_density_kg_m3) == (2.0, 998.0)
    table = job.table
    assert (table.liquid_density_kg_m3, table.other_densities_kg_m3) == (850.0, (700.0, 1000.0))
    assert (table.fine_step_m, table.fine_zones) == (0.001, ((0.0, 0.3), (2.1, 2.4)))
    assert (table.height_unit, table.volume_unit) == ("m", "L")
    assert (table.max_interpolation_error_m3, table.height_expansion) == (0.005, True)
    assert job.switches == tankcal.job.Switches(paint=False)
    assert (job.bottom.form, job.bottom.rows) == ("points", tuple(range(2, 14)))
    np.testing.assert_array_equal(job.bottom.xyz_m[:2], [[-4, -4, -0.04], [-4, 0, -0.04]])
    np.testing.assert_array_equal(job.bottom.sd_m, [0.002] * 12)
    assert job.deadwood == (
        tankcal.job.Deadwood("coil", 0.5, 1.0, -0.25, 0.01, 2),
        tankcal.job.Deadwood("manhole", 0.6, 1.2, 0.05, None, 3),
    )
    assert job.roof == tankcal.job.Roof(**ROOF)
    assert [one.u for one in declared(job)] == [5e9, 3.0, 2e-3, 1.0, 3e-3, 1e-3, 50.0]
    assert (job.horizontal, job.sphere, job.mesh) == (None, None, None)


def test_a_bottom_measured_with_liquid(tmp_path):
    bottom = load(write_job(tmp_path / "job", **MEASURED)).bottom
    assert bottom.form == "liquid"
    np.testing.assert_array_equal(bottom.level_m, [-0.05, 0.0, 0.2])
    np.testing.assert_array_equal(bottom.volume_m3, [0.25, 1.5, 27.5])
    np.testing.assert_array_equal(bottom.u_m3, [0.01, 0.02, 0.05])


@pytest.mark.parametrize(("form", "z"), [("cone", -0.15), ("dish", 0.15), ("leaning", None)])
def test_bottoms_of_a_form(tmp_path, form, z):
    settings = {"bottom.form": form, "bottom.centre_z_m": z}
    bottom = load(write_job(tmp_path / "job", settings=settings)).bottom
    assert (bottom.form, bottom.centre_z_m, bottom.xyz_m) == (form, z, None)


def test_a_dip_plate_lies_on_the_bottom_however_deep(tmp_path):
    settings = {"bottom.form": "cone", "bottom.centre_z_m": -2.5, "datum.dip_plate_z_m": -2.4}
    job = load(write_job(tmp_path / "job", settings=settings))
    assert (job.bottom.centre_z_m, job.datum.dip_plate_z_m) == (-2.5, -2.4)
    with pytest.raises(InputError, match=r"1\.1 m below the bottom"):
        load(write_job(tmp_path / "deep", settings=settings | {"datum.dip_plate_z_m": -3.6}))


def test_a_horizontal_cylinder_in_si(tmp_path):
    job = load(write_job(tmp_path / "job", **HORIZONTAL))
    assert (job.points, job.courses, job.tank.nominal_diameter_m) == (None, (), None)
    assert job.survey.side == "outside"
    assert (job.datum.bottom_z_m, job.datum.dip_plate_z_m) == (0.0, 0.012)
    assert (job.table.step_m, job.table.height_unit) == (None, "ft-in-16")
    end_a = tankcal.job.End("torispherical", 0.0, 2.4, 0.24)
    end_b = tankcal.job.End("ellipsoidal", 0.6)
    lying = job.horizontal
    assert (lying.width_m, lying.height_m, lying.length_m) == (2.4, 2.4, 10.0)
    assert (lying.end_a, lying.end_b) == (end_a, end_b)
    assert (lying.tilt, lying.roll_rad, lying.azimuth_rad) == (-0.005, 0.0, None)
    assert (lying.dip_from_a_m, lying.dip_direction, lying.thickness_m) == (2.0, "square", 0.008)
    assert [one.u for one in declared(job)] == [2e-3, 5e-3, 4e-3, 5e-4, 0.02, 2e-4]
    assert job.bottom == tankcal.job.Bottom()


def test_an_elliptical_cylinder(tmp_path):
    lying = load(write_job(tmp_path / "job", **ELLIPTICAL)).horizontal
    assert (lying.width_m, lying.height_m, lying.dip_from_a_m) == (1.78, 1.2, 1.225)
    assert (lying.tilt, lying.roll_rad) == (0.0, -np.pi / 2)
    assert (lying.end_a, lying.dip_direction) == (tankcal.job.End("flat"), "plumb")


def test_a_scan_tells_diameter_and_tilt(tmp_path):
    job = load(write_job(tmp_path / "job", **SCAN))
    assert (len(job.points.names), job.datum.bottom_z_m) == (40, None)
    lying = job.horizontal
    assert (lying.width_m, lying.height_m, lying.tilt) == (None, None, None)
    assert (lying.azimuth_rad, lying.thickness_m) == (np.pi / 2, 0.006)


def test_a_sphere_and_a_mesh(tmp_path):
    ball = load(write_job(tmp_path / "ball", **BALL))
    assert (ball.sphere, ball.datum.bottom_z_m) == (tankcal.job.Sphere(20.0), 0.0)
    job = load(write_job(tmp_path / "mesh", **MESH))
    assert (job.mesh.file, job.mesh.unit_m, job.mesh.data) == ("tank.stl", 0.0254, b"solid tank")
    assert (job.survey.side, job.datum.bottom_z_m, job.table.step_m) == ("inside", None, None)
    assert job.table.max_interpolation_error_m3 == 0.001
    assert "solid" not in repr(job)  # a mesh may have millions of bytes
    digest = hashlib.sha256(b"solid tank").hexdigest()
    assert job.files[-1] == tankcal.job.InputFile("tank.stl", digest, 10)


@pytest.mark.slow(after=6)
@pytest.mark.parametrize(
    "changes", [VERTICAL, MEASURED, DRY, HORIZONTAL, ELLIPTICAL, SCAN, BALL, MESH]
)
def test_parts_are_the_same_from_a_folder_and_a_workbook(tmp_path, changes):
    folder = load(write_job(tmp_path / "job", **changes))
    book = load(write_workbook(tmp_path / "job.xlsx", **changes))
    assert_same_job(folder, book)
    assert folder.files[-1].file == ("tank.stl" if changes is MESH else folder.files[-1].file)


def test_lists_may_be_text_or_one_number(tmp_path):
    lists = {"table.other_densities_kg_m3": [700.0], "table.fine_zones": [[0.0, 0.3]]}
    texts = {"table.other_densities_kg_m3": 700.0, "table.fine_zones": " 0 – 0.3 "}
    jobs = [
        load(write_job(tmp_path / name, settings=settings | {"table.fine_step_m": 0.001}))
        for name, settings in (("lists", lists), ("texts", texts))
    ]
    assert_same_job(*jobs)


def test_unused_settings_may_be_blank_zero_or_false(tmp_path):
    nothing = {
        "survey.liquid_level_m": 0,
        "corrections.head": False,
        "roof.mass_kg": "",
        "bottom.form": "",
        "table.other_densities_kg_m3": [],
    }
    job = load(write_job(tmp_path / "job", kind="horizontal", settings=nothing))
    assert_same_job(job, load(write_job(tmp_path / "plain", kind="horizontal")))


def warnings_of(path):
    return [(row.file, row.row, row.column) for row in load(path).warnings]


def test_warnings_do_not_stop_a_job(tmp_path):
    parts = job_parts(
        settings={"table.step_m": 1.0},
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
        ("points.csv", len(parts.tables["points"]), "x_m"),
        ("points.csv", None, "sx_mm"),
        ("points.csv", None, "sy_mm"),
        ("points.csv", None, "sz_mm"),
        ("courses.csv", 4, "course"),
    ]


def test_a_language_without_words_is_refused(tmp_path):
    path = write_job(tmp_path / "job", settings={"table.language": "pt"})
    with pytest.raises(InputError, match="found 'pt'; expected 'en' or 'pt-BR' or 'es'"):
        load(path)


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


@pytest.mark.slow(after=5)
@pytest.mark.parametrize(
    ("arrays", "column", "words"),
    [
        ({"points": np.array(["x"] * 120)}, "points", "name 1 is 'x'; expected 'C1R1P1'"),
        ({"points": np.array(["x"] * 119)}, "points", "the 120 names"),
        ({"points": np.arange(120)}, "points", "the 120 names"),
        ({"points": None}, "points", "missing array"),
        ({"covariance_m2": None}, "covariance_m2", "missing array"),
        ({"points": np.array([{}] * 120, dtype=object)}, None, "plain arrays"),
        (
            {"covariance_m2": np.zeros((2000, 2000))},
            "covariance_m2",
            "more than the covariance of 120 points needs",
        ),
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
    with pytest.raises(InputError, match=r"points_cov\.npz: given together with sx_mm"):
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
    own = {"certificate.permit": "L 0815"}
    job = load(write_job(tmp_path / "own", settings=own))
    assert job.certificate["permit"] == "L 0815"
    for slip in ("certificate.notise", "certificate.Number"):
        with pytest.raises(tankcal.InputError, match="unknown key"):
            load(write_job(tmp_path / slip, settings={slip: "x"}))
