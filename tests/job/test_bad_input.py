"""Each kind of bad input gives its line, with file, row and column; nothing ever gives a traceback.

The truth of these tests is the property itself: what was spoilt, and where, is known.
"""

import datetime
import io
import math
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from job_builder import Parts, job_parts, write_book, write_folder
from spoilt import FORMS, places, problems_of, settings_place, table_file, write

from tankcal.errors import InputError
from tankcal.job import Job, load
from tankcal.job.contract import KINDS
from tankcal.job.tables import TANK_TABLES

# key, bad value, words that the message must hold
BAD_SETTINGS = [
    ("tank.id", "../../x", "found '../../x'"),
    ("tank.id", "=cmd()", "found '=cmd()'"),
    ("tank.id", "a..b", "no .."),
    ("tank.id", ".hidden", "found"),
    ("tank.id", "x" * 65, "at most 64"),
    ("tank.id", True, "truth value"),
    ("tank.kind", "vertcal", "expected 'vertical'"),
    ("tank.nominal_diameter_m", 13000.0, "another unit"),
    ("tank.nominal_diameter_m", "13.0", "found the text '13.0'"),
    ("tank.nominal_diameter_m", "13,0", "stored as a number"),
    ("tank.nominal_diameter_m", True, "truth value"),
    ("tank.nominal_height_m", -9.5, "expected a number from 0.1"),
    ("tank.colour", "red", "unknown key"),
    ("tank.ower", "x", "did you mean owner?"),
    ("tank.owner", "one line\nand another", "in one line"),
    ("tank.owner", "x" * 301, "at most 300"),
    ("survey.side", "out", "'outside' or 'inside'"),
    ("survey.date", "31/05/2024", "a date such as"),
    ("survey.date", "2024-02-30", "a date such as"),
    ("survey.liquid_density_kg_m3", 850.0, "without liquid_level_m"),
    ("datum.dip_plate_z_m", 1.5, "above the bottom"),
    ("datum.dip_plate_z_m", -1.5, "below the bottom"),
    ("datum.reference_height_m", 0, "above 0"),
    ("table.step_m", 0, "above 0"),
    ("table.step_m", -0.01, "above 0"),
    ("table.step_m", 10, "millimetres?"),
    ("table.step_m", 1e-5, "a step of 0.00038 m or more"),
    ("table.coverage_probability", 95, "from 0.5 to 0.9999"),
    ("table.liquid_density_kg_m3", 0.85, "in g/cm3?"),
    ("table.minimum_delivery_m", 20.0, "at most the height of the tank, 9.5 m"),
    ("table.minimum_delivery_m", 0, "above 0"),
    ("table.minimum_delivery_m", [1.5, 2, 1.5], "expected it once"),
    ("table.minimum_delivery_m", "1,5", "such as 20; 80"),
    ("table.rule", "API", "or one of eu_71_349, france_2003, france_2003_alcohol"),
    ("table.rule", "oiml_r17", "(did you mean oiml_r71?)"),
    ("table.rule", "house.toml", "no such file beside the job"),
    ("table.rule", "../house.toml", "found '../house.toml'"),
    ("table.rule", True, "truth value"),
    ("table.monte_carlo", "perhaps", "true or false"),
    ("material.e_gpa", 206000, "from 40 to 500"),
    ("material.expansion_per_k", 11, "at most 0.0001"),
    ("adjustment.datum", "iner", "did you mean inner?"),
    ("adjustment.scale", "posterior", "a_posteriori"),
    ("adjustment.snooping", "perhaps", "true or false"),
    ("adjustment.camera.default", "free", "'camera free'"),
    ("certificate.date_of_issue", "soon", "a date such as"),
    ("certificate.numbr", "x", "unknown key"),
]


@pytest.mark.slow(after=8)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("key", "value", "words"), BAD_SETTINGS)
def test_bad_setting_is_reported_with_its_row_and_key(tmp_path, form, key, value, words):
    parts = job_parts(settings={key: value})
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [settings_place(form, parts, key)]
    assert words in problem.expected


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_setting_that_is_no_finite_number(tmp_path, value):
    parts = job_parts(settings={"tank.nominal_height_m": value})  # TOML can write nan and inf
    (problem,) = problems_of(write(tmp_path, parts, "folder"))
    assert problem.column == "tank.nominal_height_m"
    assert "not NaN or infinite" in problem.expected


@pytest.mark.parametrize("rows", [3, 900])
def test_a_size_next_to_zero(tmp_path, rows):
    """Its square is nothing to a computer, and its weight endless; long columns are read apart."""
    parts = job_parts()
    courses = parts.tables["courses"]
    place = courses[0].index("thickness_mm")
    courses += [list(courses[-1]) for _ in range(rows)]
    courses[2][place] = "1e-308"
    problems = problems_of(write(tmp_path, parts, "folder"))
    (problem,) = [one for one in problems if "0, or a number further from 0" in str(one.expected)]
    assert (problem.file, problem.row, problem.column) == ("courses.csv", 3, "thickness_mm")


@pytest.mark.parametrize("form", FORMS)
def test_missing_key_and_unknown_section(tmp_path, form):
    parts = job_parts(settings={"survey.side": None, "tnak.id": "x"})
    problems = problems_of(write(tmp_path, parts, form))
    file = settings_place(form, parts, "tank.id")[0]
    row = settings_place(form, parts, "tnak.id")[1] - (form == "folder")  # the [section] line
    assert places(problems) == [(file, None, "survey.side"), (file, row, "[tnak]")]
    assert "did you mean tank?" in problems[1].expected


# table, row in the file, column, bad cell, words
BAD_CELLS = [
    ("points", 4, "x_m", "abc", "abc"),
    ("points", 4, "x_m", "nan", "expected a number"),
    ("points", 4, "y_m", "inf", "expected a number"),
    ("points", 4, "y_m", "1_000", "expected a number"),
    ("points", 4, "z_m", "１２", "expected a number"),
    ("points", 4, "z_m", "1.2.3", "expected a number"),
    ("points", 4, "z_m", "0x1F", "expected a number"),
    ("points", 4, "z_m", None, "blank"),
    ("points", 4, "point", None, "blank"),
    ("points", 4, "point", "=cmd()", "a letter, digit or underscore first"),
    ("points", 4, "point", "@SUM(A1)", "a letter, digit or underscore first"),
    ("courses", 3, "height_m", 0.0, "above 0"),
    ("courses", 3, "height_m", -1.9, "above 0"),
    ("courses", 3, "height_m", 1900.0, "another unit"),
    ("courses", 3, "thickness_mm", -8.0, "from 0 to 100"),
    ("courses", 3, "thickness_mm", 0.008, "in metres?"),
    ("courses", 3, "thickness_mm", 8000.0, "from 0 to 100"),
    ("courses", 3, "thickness_mm", None, "blank"),
    ("courses", 3, "paint_mm", 11.0, "from 0 to 10"),
    ("courses", 3, "course", "1", "already in row 2"),
    ("points", 7, "sx_mm", -2.0, "above 0"),
    ("points", 7, "sx_mm", 0.0, "above 0"),
    ("points", 7, "sx_mm", 1001.0, "at most 1000"),
    ("points", 7, "sx_mm", None, "blank"),
    ("uncertainty", 2, "input", "wind", "expected 'scale'"),
    ("uncertainty", 2, "u", -5.0, "or more"),
    ("uncertainty", 2, "u", 5e5, "at most 10000 ppm"),
    ("uncertainty", 2, "unit", "mm", "expected 'ppm' for scale"),
    ("uncertainty", 2, "dof", 0.5, "1 or more"),
    ("uncertainty", 2, "type", "C", "'A' or 'B'"),
    ("uncertainty", 2, "distribution", "flat", "rectangular"),
    ("uncertainty", 3, "input", "scale", "already in row 2"),
    ("uncertainty", 2, "u", "nan", "expected a number"),
    ("uncertainty", 2, "u", "5..5", "expected a number"),
    ("uncertainty", 2, "u", None, "blank"),
    ("uncertainty", 2, "u_is", "half_widht", "did you mean half_width?"),
    ("uncertainty", 3, "u_is", None, "expected scale or sd"),
    ("uncertainty", 3, "u_is", "standard", "expected scale or sd"),
    ("uncertainty", 3, "u_is", "half_width", "expected scale or sd"),
    ("uncertainty", 3, "dof", None, "expected the degrees of freedom"),
    ("uncertainty", 3, "dof", 2.0, "expected above 2"),
    ("uncertainty", 4, "distribution", None, "normal has no half-width"),
    ("uncertainty", 4, "u", 1e3, "a standard uncertainty of 577.35 kg/m3"),
    ("uncertainty", 4, "k", 2.0, "or u_is = expanded with it"),
    ("uncertainty", 5, "k", None, "expected the coverage factor"),
    ("uncertainty", 5, "k", 0.95, "from 1 to 20"),
    ("uncertainty", 5, "k", 95.0, "from 1 to 20"),
    ("uncertainty", 5, "distribution", "rectangular", "expected normal or a blank"),
    ("correlations", 2, "r", 1.2, "a number from -1 to 1"),
    ("correlations", 2, "r", "NaN", "expected a number"),
    ("correlations", 2, "r", "0..5", "expected a number"),
    ("correlations", 2, "r", None, "blank"),
    ("correlations", 2, "input", "wind", "expected 'scale'"),
    ("correlations", 2, "with", "rounding", "expected 'scale'"),
    ("correlations", 2, "with", "scale", "expected another input"),
    ("correlations", 2, "with", "paint", "expected an input of"),
    ("correlations", 3, "with", "scale", "already in row 2"),
    ("stated", 2, "high_m", 95.0, "expected at most 9.5, the top of the tank"),
    ("stated", 2, "high_m", None, "blank"),
    ("stated", 2, "high_m", "9..0", "expected a number"),
    ("stated", 2, "high_m", -1.0, "above 0"),
    ("stated", 2, "low_m", 9.0, "expected a dip below high_m = 9"),
    ("stated", 2, "low_m", 9.2, "expected a dip below high_m = 9"),
    ("stated", 2, "volume_m3", 0.0, "above 0"),
    ("stated", 2, "volume_m3", 929e3, "the tank between low_m and high_m holds about 929.1 m3"),
    ("stated", 3, "volume_m3", 119e3, "the whole tank holds about 1261 m3, expected m3"),
]


# a course of another height also misses the shell's; the unit of an unlike input is wrong too
CONSEQUENCES = {("height_m", None), ("unit", 3)}


BOTTOM = [(x, y, -0.01 * abs(x), 2.0) for x in (-4, 0, 1, 4) for y in (-4, 0, 1, 4)]


def full_parts(**changes):
    """A vertical job with every table, most of the optional columns and most sections."""
    settings = {
        "table.liquid_density_kg_m3": 850.0,
        "table.other_densities_kg_m3": [700.0, 750.0],
        "table.fine_step_m": 0.001,
        "table.fine_zones": [[0.0, 0.3], [2.1, 2.4]],
        "table.max_interpolation_error_l": 5.0,
        "table.rule": "oiml_r71",
        "table.minimum_delivery_m": [1.0, 2.5],
        "table.monte_carlo": False,
        "corrections.tilt": False,
        "bottom.form": "points",
    } | changes.pop("settings", {})
    parts = job_parts(
        sd_mm=2.0,
        paint_mm=0.3,
        bottom=BOTTOM,
        deadwood=[("coil", 0.5, 1.0, -0.2, 0.01), ("manhole", 0.6, 1.2, 0.05)],
        welds=[("5", 20.0), ("5", 200.0)],
        roof={},
        settings=settings,
        **changes,
    )
    parts.tables["uncertainty"] = [
        ["input", "u", "unit", "u_is", "k", "type", "distribution", "dof", "note"],
        ["scale", 5.0, "ppm", "standard", None, "B", "normal", None, "certificate"],
        ["datum", 1.0, "mm", "sd", None, "A", "t", 9.0, None],
        ["liquid_density", 2.0, "kg/m3", "half_width", None, "B", "rectangular", None, None],
        ["offset", 1.0, "mm", "expanded", 2.0, "B", "normal", 50.0, None],
    ]
    parts.tables["correlations"] = [
        ["input", "with", "r"],
        ["scale", "liquid_density", 0.5],
        ["liquid_density", "offset", -0.25],
    ]
    parts.tables["stated"] = [
        ["high_m", "low_m", "volume_m3", "note"],
        [9.0, 2.0, 928.5, "contract"],
        [9.0, None, 1193.8, None],
        [4.5, 0.0, None, None],
    ]
    return parts


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("table", "row", "column", "cell", "words"), BAD_CELLS)
def test_bad_cell_is_reported_with_its_row_and_column(
    tmp_path, form, table, row, column, cell, words
):
    parts = full_parts()
    rows = parts.tables[table]
    rows[row - 1][rows[0].index(column)] = cell
    found = problems_of(write(tmp_path, parts, form))
    here = [problem for problem in found if problem.row == row and problem.column == column]
    assert [problem.file for problem in here] == [table_file(form, table)]
    assert words in here[0].expected
    others = [problem for problem in found if problem not in here]
    assert {(problem.column, problem.row) for problem in others} <= CONSEQUENCES


@pytest.mark.parametrize("form", FORMS)
def test_missing_unknown_and_repeated_columns(tmp_path, form):
    parts = job_parts()
    parts.tables["points"][0] = ["point", "x_m", "y_m", "hoogte"]
    parts.tables["courses"][0] = ["course", "height_m", "height_m"]
    problems = problems_of(write(tmp_path, parts, form))
    points, courses = table_file(form, "points"), table_file(form, "courses")
    assert places(problems) == [
        (courses, 1, "height_m"),
        (points, 1, "hoogte"),
        (points, 1, "z_m"),
    ]


@pytest.mark.parametrize("form", FORMS)
def test_missing_tables(tmp_path, form):
    parts = job_parts()
    parts.tables.clear()
    problems = problems_of(write(tmp_path, parts, form))
    expected = [(table_file(form, name), None, None) for name in ("points", "courses")]
    assert places(problems) == expected
    words = "missing file" if form == "folder" else "the sheets job, points, courses, welds, bottom"
    assert all(words in problem.expected for problem in problems)


def test_missing_settings(tmp_path):
    folder = write_folder(tmp_path / "job", job_parts())
    (folder / "job.toml").unlink()
    assert places(problems_of(folder)) == [("job.toml", None, None)]


@pytest.mark.parametrize("form", FORMS)
def test_repeated_point_names_both_rows(tmp_path, form):
    parts = job_parts()
    parts.tables["points"][9][0] = parts.tables["points"][2][0]
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [(table_file(form, "points"), 10, "point")]
    assert "row 3" in problem.expected


@pytest.mark.parametrize("form", FORMS)
def test_points_per_course(tmp_path, form):
    parts = job_parts()
    rows = parts.tables["points"]
    keep = [row for row in rows[1:] if row[0].startswith("C1")]
    keep += [row for row in rows[1:] if row[0].startswith("C2")][:4]  # under 5: an error
    keep += [row for row in rows[1:] if row[0][:2] in ("C4", "C5")]  # course 3 has none
    parts.tables["points"] = [rows[0], *keep]
    problems = problems_of(write(tmp_path, parts, form))
    courses = table_file(form, "courses")
    assert places(problems) == [(courses, 3, "course"), (courses, 4, "course")]
    assert [problem.expected[:8] for problem in problems] == ["4 points", "0 points"]


@pytest.mark.parametrize(
    ("nominal", "accepted"), [(9.519, True), (9.521, False), (19.037, True), (19.039, False)]
)
def test_courses_against_shell_height(tmp_path, nominal, accepted):
    # closed form: 20 mm rules up to 10 m of height, 0.2 % above: 38.08 mm at 19.038 m
    courses = 5 if nominal < 10 else 10
    parts = job_parts(
        courses=courses, height=1.9 * courses, settings={"tank.nominal_height_m": nominal}
    )
    path = write_folder(tmp_path / "job", parts)
    if accepted:
        assert load(path).tank.nominal_height_m == nominal
    else:
        assert places(problems_of(path)) == [("courses.csv", None, "height_m")]


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("scale", "column", "words"),
    [
        ((1000, 1000, 1), "x_m", "the points in millimetres?"),
        ((1, 1, 1000), "z_m", "the points in millimetres?"),
        ((100, 100, 1), "x_m", "the points in centimetres?"),
        ((1e-3, 1e-3, 1), "x_m", "tank.nominal_diameter_m in millimetres?"),
    ],
)
def test_points_in_another_unit(tmp_path, form, scale, column, words):
    parts = job_parts()
    for row in parts.tables["points"][1:]:
        row[1:4] = [value * factor for value, factor in zip(row[1:4], scale, strict=True)]
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [(table_file(form, "points"), None, column)]
    assert words in problem.expected


def test_bottom_in_another_frame(tmp_path):
    parts = job_parts()
    parts.settings["datum.bottom_z_m"] = 100.0
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert places([problem]) == [settings_place("folder", parts, "datum.bottom_z_m")]


@pytest.mark.parametrize("form", FORMS)
def test_standard_deviations_for_all_axes_or_none(tmp_path, form):
    parts = job_parts(sd_mm=2.0)
    parts.tables["points"] = [row[:6] for row in parts.tables["points"]]
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [(table_file(form, "points"), None, "sz_mm")]


def test_dip_point_needs_both_coordinates(tmp_path):
    parts = job_parts(settings={"datum.dip_x_m": 1.0})
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert problem.column == "datum.dip_y_m"


@pytest.mark.parametrize(
    ("settings", "column"),
    [({"csv.separator": "|"}, "csv.separator"), ({"csv.decimal": ","}, "csv.separator")],
)
def test_csv_marks_that_cannot_be_used_hide_no_other_problem(tmp_path, settings, column):
    parts = job_parts(settings={**settings, "table.step_m": 0})
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert {problem.column for problem in problems} == {"table.step_m", column}


def test_decimal_commas_among_separators(tmp_path):
    folder = write_folder(tmp_path / "job", job_parts())
    (folder / "points.csv").write_text("point,x_m,y_m,z_m\nA,1,25,2,3\n")
    (problem,) = problems_of(folder)
    assert places([problem]) == [("points.csv", 2, None)]
    assert "for decimal commas set [csv] separator" in problem.expected


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("fiducial.csv", "did you mean fiducials.csv?"),
        ("image_pionts.csv", "did you mean image_points.csv?"),
        ("Points.csv", "did you mean points.csv?"),
        (
            "notes.csv",
            "points.csv, courses.csv, welds.csv, bottom.csv, deadwood.csv, uncertainty.csv",
        ),
    ],
)
def test_files_that_do_not_belong(tmp_path, name, words):
    parts = job_parts()
    if name == "Points.csv":  # where names differ by case only, this is points.csv itself
        parts.extra_files["pts.csv"] = "point\n"
        name, words = "pts.csv", "unknown file"
    parts.extra_files |= {name: "x\n", "readme.txt": "ignored", ".hidden.csv": "ignored"}
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert (problem.file, problem.row, problem.column) == (name, None, None)
    assert words in problem.expected


def test_sheets_that_do_not_belong(tmp_path):
    parts = job_parts()
    parts.tables |= {"Sheet1": [["x"]], "points_cov": [["name"]], "# notes": [["kept"]]}
    problems = problems_of(write_book(tmp_path / "job.xlsx", parts))
    assert places(problems) == [("job.xlsx", None, None), ("sheet points_cov", None, None)]
    assert "unknown sheet 'Sheet1'" in problems[0].expected


def test_all_problems_of_a_run_come_together(tmp_path):
    parts = full_parts(settings={"tank.id": "../../x", "table.step_m": 0})
    parts.tables["points"][3][1] = "1,250"
    parts.tables["points"][5][2] = "NaN"
    parts.tables["courses"][2][2] = -8.0
    parts.tables["uncertainty"][1][2] = "m"
    parts.extra_files["fiducial.csv"] = "point\n"
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert sorted(places(problems), key=str) == sorted(
        [
            settings_place("folder", parts, "tank.id"),
            settings_place("folder", parts, "table.step_m"),
            ("points.csv", 4, "x_m"),
            ("points.csv", 6, "y_m"),
            ("courses.csv", 3, "thickness_mm"),
            ("uncertainty.csv", 2, "unit"),
            ("fiducial.csv", None, None),
        ],
        key=str,
    )


BRAZILIAN = {"csv.separator": ";", "csv.decimal": ","}


@pytest.mark.parametrize("lost", [b"[tank\n", b'owner = "Jo\xe3o"\n', None])
def test_tables_ignore_marks_of_unreadable_settings(tmp_path, lost):
    count = len(job_parts().tables["points"]) - 1
    parts = job_parts(
        settings=BRAZILIAN,
        deadwood=[("coil", 0.5, 1.0, -0.2)],
        covariance_m2=np.eye(3 * count) * 4e-6,
    )
    folder = write_folder(tmp_path / "job", parts)
    if lost is None:
        (folder / "job.toml").unlink()
    else:
        (folder / "job.toml").write_bytes(lost + (folder / "job.toml").read_bytes())
    (problem,) = problems_of(folder)
    assert problem.file == "job.toml"


def test_tables_with_commas_and_unreadable_settings(tmp_path):
    parts = job_parts()
    parts.tables["points"][3][1] = "x"
    folder = write_folder(tmp_path / "job", parts)
    (folder / "job.toml").write_text("[tank\n")
    assert places(problems_of(folder)) == [("job.toml", 1, None), ("points.csv", 4, "x_m")]


def test_decimal_comma_in_settings_is_the_only_problem(tmp_path):
    parts = job_parts(settings=BRAZILIAN | {"table.step_m": 0.25})
    folder = write_folder(tmp_path / "job", parts)
    text = (folder / "job.toml").read_text(encoding="utf-8")
    assert text.count("step_m = 0.25") == 1
    (folder / "job.toml").write_text(text.replace("0.25", "0,25"), encoding="utf-8")
    (problem,) = problems_of(folder)
    place = settings_place("folder", parts, "table.step_m")
    assert (problem.file, problem.row) == place[:2]
    assert "found 'step_m = 0,25'; expected a decimal point" in problem.expected


def test_a_long_list_of_problems_is_cut_and_counted(tmp_path):
    parts = job_parts()
    for row in parts.tables["points"][1:]:
        row[1] = "x"
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert len(problems) == 51
    assert problems[-1].expected == "and 70 more problems; correct these first"  # of 120


@pytest.mark.parametrize("name", ["", "nowhere", "nul\0l", "job.xlsx", "job.xls"])
def test_a_path_that_is_no_job(tmp_path, name):
    (tmp_path / "job.xls").write_bytes(b"x")
    (problem,) = problems_of(tmp_path / name if name else tmp_path)[:1]
    assert problem.expected


# What is handed in may be anything: a job, or an InputError of one-line problems.

NASTY_TEXT = st.sampled_from(
    ["", " ", "nan", "-inf", "1,25", "1_000", "=1+1", "../..", "é\u2028x", "a\nb", "'", '"', "#N/A"]
    + ["1e999", "0", "-1", "2024-13-01", "\u202egnp", "[tank]", "\ud7ff", "#"]
)
NASTY = st.one_of(
    NASTY_TEXT,
    st.text(max_size=10),
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(10**20), 10**20),
    st.booleans(),
    st.none(),
)
LISTS = st.lists(st.one_of(st.floats(0, 1000), st.lists(st.floats(0, 10), max_size=3)), max_size=3)
QUICK = settings(
    max_examples=150,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)


def assert_job_or_problems(path):
    job, problems = None, ()
    try:
        job = load(path)
    except InputError as error:
        problems = error.problems
    if job is not None:
        assert job.points is None or np.all(np.isfinite(job.points.xyz_m))
        return
    assert problems
    for problem in problems:
        assert len(str(problem).splitlines()) == 1
        assert problem.file
        assert problem.expected


def parts_of_kind(kind):
    """A small job of a kind, with most of what it may have."""
    if kind == "vertical":
        return full_parts(points_per_ring=10)
    scan = [(f"P{i}", np.cos(2.4 * i), i / 5, np.sin(2.4 * i)) for i in range(30)]
    parts = job_parts(
        kind=kind,
        extra_points=scan if kind == "sphere" else (),
        deadwood=[("pipe", 0.5, 1.0, -0.02, 0.001)],
        uncertainty=[("datum", 1.0, "mm"), ("scale", 5.0, "ppm")],
        mesh=b"solid" if kind == "mesh" else None,
    )
    if kind == "sphere":
        del parts.settings["sphere.diameter_m"]
    elif kind == "horizontal":
        parts.settings |= {
            "horizontal.end_a": "torispherical",
            "horizontal.end_a_dish_radius_m": 2.4,
            "horizontal.end_a_knuckle_radius_m": 0.24,
            "horizontal.end_b": "ellipsoidal",
            "horizontal.end_b_depth_m": 0.6,
            "horizontal.tilt_mm_per_m": 5.0,
            "horizontal.dip_from_a_m": 5.0,
            "horizontal.dip_direction": "square",
        }
    return parts


@st.composite
def spoilt_parts(draw):
    """A small job of any kind with one to four things changed to anything."""
    parts = parts_of_kind(draw(st.sampled_from(["vertical", "vertical", *KINDS])))
    for _ in range(draw(st.integers(1, 4))):
        name = draw(st.sampled_from(["settings", *parts.tables]))
        if name == "settings":
            key = draw(st.sampled_from([*parts.settings, *MORE_KEYS]))
            parts.settings[key] = draw(NASTY | LISTS)
            continue
        rows = parts.tables[name]
        row = rows[draw(st.integers(0, min(len(rows) - 1, 12)))]
        column = draw(st.integers(0, len(row)))
        if column < len(row):
            row[column] = draw(NASTY)
        else:
            row.append(draw(NASTY))
    return parts


@pytest.mark.slow
@QUICK
@given(spoilt_parts())
def test_any_cell_in_a_folder(parts):
    with tempfile.TemporaryDirectory() as place:
        assert_job_or_problems(write_folder(Path(place) / "job", parts))


@pytest.mark.slow
@settings(QUICK, max_examples=60)
@given(spoilt_parts(), st.booleans())
def test_any_cell_in_a_workbook(parts, with_date):
    if with_date and "points" in parts.tables:
        parts.tables["points"][2][2] = datetime.date(2024, 5, 31).isoformat()
    with tempfile.TemporaryDirectory() as place:
        assert_job_or_problems(write_book(Path(place) / "job.xlsx", parts))


MORE_KEYS = ["tank.owner", "roof.x", "a.b.c", "x", "tank.kind", "bottom.centre_z_m", "sphere.x"]
MORE_KEYS += ["table.height_unit", "horizontal.diameter_m", "mesh.file", "survey.liquid_level_m"]


@st.composite
def byte_changes(draw):
    """A function that changes some bytes: cut, insert, overwrite, double."""
    place, length = draw(st.floats(0, 1)), draw(st.integers(0, 40))
    put = draw(st.one_of(st.binary(max_size=8), st.sampled_from(BITS)))
    repeat = draw(st.sampled_from([1, 1, 1, 50]))

    def change(data):
        start = int(place * len(data))
        return data[:start] + put * repeat + data[start + length :]

    return change


BITS = [b"\0", b'"', b"\n", b"\r", b"\xff", b",", b";", b"[", b"]", b"=", b"nan", b"\xef\xbb\xbf"]
BITS += [b"<", b">", b"<c/>", b' r="-1"', b"&#0;", b"<f/>", b"{", b"'''", b"#", b"\xe2\x80\xa8"]


@pytest.mark.slow
@QUICK
@given(
    st.sampled_from(["job.toml", *(f"{table}.csv" for table in TANK_TABLES), "points_cov.npz"]),
    byte_changes(),
)
def test_any_bytes_in_a_folder(name, change):
    parts = full_parts(points_per_ring=10)
    if name == "points_cov.npz":
        parts = job_parts(points_per_ring=10)
        parts.covariance_m2 = np.eye(3 * 50) * 4e-6
    with tempfile.TemporaryDirectory() as place:
        folder = write_folder(Path(place) / "job", parts)
        (folder / name).write_bytes(change((folder / name).read_bytes()))
        assert_job_or_problems(folder)


def workbook_bytes():
    with tempfile.TemporaryDirectory() as place:
        parts = full_parts(points_per_ring=10)
        return write_book(Path(place) / "job.xlsx", parts).read_bytes()


WORKBOOK = workbook_bytes()


def load_bytes(data):
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "job.xlsx"
        path.write_bytes(data)
        assert_job_or_problems(path)


@pytest.mark.slow
@settings(QUICK, max_examples=60)
@given(byte_changes())
def test_any_bytes_of_a_workbook(change):
    load_bytes(change(WORKBOOK))


MEMBERS = ["[Content_Types].xml", "xl/workbook.xml", "xl/_rels/workbook.xml.rels"]
MEMBERS += ["xl/worksheets/sheet1.xml", "xl/worksheets/sheet2.xml", "xl/styles.xml"]
MEMBERS += ["xl/sharedStrings.xml"]


@pytest.mark.slow
@settings(QUICK, max_examples=120)
@given(st.sampled_from(MEMBERS), byte_changes())
def test_any_bytes_inside_a_workbook(name, change):
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(WORKBOOK)) as old,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for member in old.namelist():
            data = old.read(member)
            new.writestr(member, change(data) if member == name else data)
    load_bytes(packed.getvalue())


def test_the_unspoilt_jobs_of_these_tests_are_sound(tmp_path):
    load_bytes(WORKBOOK)
    for kind in KINDS:
        job = load(write_folder(tmp_path / kind, parts_of_kind(kind)))
        assert isinstance(job, Job)
        assert job.warnings == ()
    assert isinstance(full_parts(), Parts)


def test_courses_without_rows_are_one_problem(tmp_path):
    parts = job_parts()
    parts.tables["courses"] = parts.tables["courses"][:1]
    assert places(problems_of(write_folder(tmp_path / "job", parts))) == [
        ("courses.csv", None, None)
    ]
