"""Each mistake in the files of a survey gives its line; nothing ever gives a traceback.

The truth of these tests is the property itself: what was spoilt, and where, is known.
"""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from generated_hits import Tool
from generated_tangents import ring_of_stations, traverse_tables
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from job_builder import job_parts, tangent_parts, write_book, write_folder
from messages_told import lines
from spoilt import FORMS, places, problems_of, settings_place, table_file, write
from survey_builder import WALL, read_on_comparator, survey_parts

from tankcal.errors import InputError
from tankcal.job import Job, load
from tankcal.job.checks.survey.readings import plain
from tankcal.job.tables import SURVEY_TABLES

QUICK = settings(max_examples=60, suppress_health_check=[*HealthCheck])
FILM = "UMK 10/1318"


def spoil(parts, table, row, column, value):
    """Change a cell (row as in the file); a column that is not there is added."""
    rows = parts.tables[table]
    if column not in rows[0]:
        rows[0].append(column)
        for cells in rows[1:]:
            cells.append(None)
    rows[row - 1][rows[0].index(column)] = value


# table, row in the file, column, bad cell, words
BAD_CELLS = [
    ("image_points", 2, "x_mm", "nan", "expected a number"),
    ("image_points", 2, "x_mm", "1_000", "expected a number"),
    ("image_points", 3, "y_mm", "\uff11\uff12", "expected a number"),
    ("image_points", 3, "y_mm", None, "blank; expected both coordinates"),
    ("image_points", 3, "x_mm", None, "blank; expected both coordinates"),
    ("image_points", 4, "x_mm", 90.5, "outside the format; expected at most 90 mm"),
    ("image_points", 4, "y_mm", -65.001, "outside the format; expected at most 65 mm"),
    ("image_points", 27, "column_px", 5999.6, "expected -0.5 to 5999.5 pixels"),
    ("image_points", 27, "line_px", -1.0, "expected -0.5 to 3999.5 pixels"),
    ("image_points", 4, "sx_um", None, "expected both sx_um and sy_um, or none"),
    ("image_points", 4, "sx_um", 0.0, "above 0"),
    ("image_points", 4, "s_px", 0.5, "given together with sx_um"),
    ("image_points", 2, "photo", "F9", "expected a name defined in photos.csv"),
    ("image_points", 2, "photo", "=F1", "a letter, digit or underscore first"),
    ("image_points", 2, "use", "maybe", "'adjust' or 'check'"),
    ("photos", 3, "camera", "UMK 10/1381", "did you mean UMK 10/1318?"),
    ("photos", 3, "photo", "F1", "already in row 2"),
    ("photos", 4, "sx_m", 0.01, "given without x_m"),
    ("photos", 2, "omega_gon", 100.0, "in two units"),
    ("photos", 2, "omega_deg", 361.0, "is it in gon?"),
    ("photos", 2, "s_phi_deg", 0.1, "in two units"),
    ("control", 2, "sx_mm", -1.0, "from 0"),
    ("control", 2, "x_m", None, "given without x_m"),
    ("control", 3, "point", "W1", "already given, in row 2"),
    ("setups", 3, "setup", "1", "already in row 2"),
    ("setups", 2, "instrument", "TC", "expected a name defined in instruments.toml"),
    ("setups", 2, "instrument_height_m", 1550.0, "another unit"),
    ("distances", 2, "instrument", "tape 2", "did you mean tape 1?"),
    ("distances", 2, "to", "W1", "between 'W1' and itself"),
    ("distances", 2, "distance_m", 0.0, "above 0"),
    ("distances", 2, "s_mm", None, "blank"),
    ("distances", 2, "kind", "slope", "'spatial' or 'horizontal'"),
    ("slope_distances", 2, "setup", "7", "expected a name defined in setups.csv"),
    ("slope_distances", 2, "to", "S1", "from station 'S1' to itself"),
    ("directions", 5, "direction_deg", 385.0, "is it in gon?"),
    ("directions", 5, "direction_deg", None, "blank; expected direction_deg"),
    ("directions", 5, "direction_gon", 20.0, "in two units"),
    ("zenith_angles", 5, "zenith_gon", 299.0, "in the second face?"),
    ("zenith_angles", 5, "zenith_gon", -1.0, "from 0 to 200"),
    ("azimuths", 2, "azimuth_dms", "181 60 00", "below 60"),
    ("azimuths", 2, "azimuth_dms", "181.5", "such as 123 04 05.6"),
    ("azimuths", 2, "to", "S1", "between 'S1' and itself"),
    ("horizontal_angles", 2, "from", "W2", "between 'W2' and itself"),
    ("horizontal_angles", 2, "at", "W1", "between 'W1' and itself"),
    ("vertical_angles", 2, "angle_deg", 95.0, "is it in gon?"),
    ("height_differences", 2, "to", "W1", "between 'W1' and itself"),
    ("plumb_lines", 2, "to", "W1", "between 'W1' and itself"),
    ("targets", 3, "point", "W1", "already in row 2"),
    ("targets", 3, "offset_mm", 600.0, "from -500 to 500"),
]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("table", "row", "column", "bad", "words"), BAD_CELLS)
def test_bad_cell_is_reported_with_its_row_and_column(
    tmp_path, form, table, row, column, bad, words
):
    parts = survey_parts()
    spoil(parts, table, row, column, bad)
    problems = problems_of(write(tmp_path, parts, form))
    found = [one for one in problems if (one.file, one.row) == (table_file(form, table), row)]
    if (table, column) not in (("setups", "setup"), ("photos", "photo")):  # missed elsewhere, too
        assert len(problems) == len(found)
    if form == "workbook":
        words = words.replace("photos.csv", "sheet photos").replace("setups.csv", "sheet setups")
        words = words.replace("instruments.toml", "sheet instruments")
    assert any(words in one.expected for one in found)


# register, owner, key, bad value (None removes it), words
BAD_KEYS = [
    ("cameras", FILM, "c_mm", None, "missing; expected principal distance"),
    ("cameras", FILM, "c_mm", -100.0, "above 0"),
    ("cameras", FILM, "c_mm", "100", "stored as a number"),
    ("cameras", FILM, "k1_mm-2", 1e-9, "did you mean K1_mm-2?"),
    ("cameras", FILM, "format_mm", None, "expected [width, height]"),
    ("cameras", FILM, "format_mm", [180.0], "expected two"),
    ("cameras", FILM, "convention", None, "sources differ in sign"),
    ("cameras", FILM, "convention", "opencv", "'distortion_of_ideal'"),
    (
        "cameras",
        FILM,
        "affinity",
        None,
        "expected the form: both_y, both_x, b1_b2 or before_distortion",
    ),
    ("cameras", FILM, "b1", 1e-4, "they are the same parameter"),
    ("cameras", FILM, "b2", 1e-4, "given with affinity = both_y"),
    (
        "cameras",
        FILM,
        "s_K1",
        None,
        "expected a value above 0: the parameter is block weighted",
    ),
    ("cameras", FILM, "K1_mm-2", 1e-3, "for normalised coordinates?"),
    ("cameras", FILM, "P1_mm-1", 0.01, "for normalised coordinates?"),
    ("cameras", FILM, "x0_mm", 100.0, "outside the format, whose width is 180 mm"),
    ("cameras", FILM, "c_mm", 0.1, "expected 11.1 to 44407 mm: is it in another unit?"),
    ("cameras", FILM, "s_c_mm", 300.0, "expected less: is it in another unit?"),
    ("cameras", FILM, "K1_mm-2", 1.2e-7, "expected the same"),
    ("cameras", "D", "pixel_um", None, "expected the size of a pixel"),
    ("cameras", "D", "format_mm", [30.0, 20.0], "format_px times pixel_um is 24 x 16 mm"),
    ("cameras", "D", "format_px", [6000.5, 4000.0], "whole numbers"),
    ("instruments", "TS", "kind", None, "missing"),
    ("instruments", "tape 1", "certified_temperature_c", None, "but expansion_per_k is given"),
    ("instruments", "tape 1", "u_scale_ppm", "unknown", "or 'free'"),
    ("instruments", "tape 1", "u_scale", 1e-6, "unknown key (did you mean u_scale_ppm?)"),
    ("instruments", "tape 1", "correction", 20.0, "from -0.1 to 0.1"),
]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("register", "owner", "key", "bad", "words"), BAD_KEYS)
def test_bad_key_of_a_camera_or_an_instrument(tmp_path, form, register, owner, key, bad, words):
    parts = survey_parts()
    parts.registers[register][owner][key] = bad
    if bad is None:
        del parts.registers[register][owner][key]
    problems = problems_of(write(tmp_path, parts, form))
    file = f"{register}.toml" if form == "folder" else f"sheet {register}"
    assert {problem.file for problem in problems} == {file}
    assert any(words in problem.expected for problem in problems)
    assert all(problem.row is not None for problem in problems)


# settings, key of the problem, words
BAD_SETTINGS = [
    (
        {"adjustment.image_sd_um": None},
        "image_sd_um",
        "without one: 1, the first of them row 26",
    ),
    ({"adjustment.image_sd_um": 0.0}, "image_sd_um", "above 0"),
    ({"adjustment.datum": "free"}, "datum", "'inner'"),
    ({"adjustment.fixed_photo": "F1"}, "fixed_photo", "expected only with datum = fixed_photo"),
    ({"adjustment.datum": "fixed_photo"}, "fixed_photo", "missing"),
    (
        {"adjustment.datum": "fixed_photo", "adjustment.fixed_photo": "F11"},
        "fixed_photo",
        "did you mean F1?",
    ),
    ({"adjustment.datum_points": ["W1"]}, "datum_points", "only with minimal or inner"),
    (
        {"adjustment.datum": "inner", "adjustment.datum_points": ["W1", "W9"]},
        "datum_points",
        "found 'W9'; expected a point of the survey",
    ),
    (
        {"adjustment.datum": "inner", "adjustment.datum_points": ["W1:xx"]},
        "datum_points",
        "expected axes such as W1:xy",
    ),
    (
        {"adjustment.datum": "inner", "adjustment.datum_points": ["W1", "W1:x"]},
        "datum_points",
        "twice",
    ),
    (
        {"adjustment.datum": "minimal", "adjustment.datum_points": ["W4:xy"]},
        "datum_points",
        "no y in control.csv",
    ),
    (
        {"adjustment.datum": "minimal", "adjustment.datum_points": ["W7"]},
        "datum_points",
        "no x, y and z in control.csv",
    ),
    ({"adjustment.camera.K3": "weighted"}, "camera.K3", "'camera weighted'"),
    ({"adjustment.camera.k3": "off"}, "camera.k3", "did you mean K3?"),
    ({"adjustment.camera.b1": "camera free"}, "camera.b1", "same parameter"),
    ({"adjustment.refraction": "air"}, "refraction", "expected a number"),
]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("given_settings", "key", "words"), BAD_SETTINGS)
def test_bad_setting_of_the_adjustment(tmp_path, form, given_settings, key, words):
    (problem,) = problems_of(write(tmp_path, survey_parts(given_settings), form))
    assert problem.file == ("job.toml" if form == "folder" else "sheet job")
    assert problem.column == f"adjustment.{key}"
    assert words in problem.expected


def problem_of(tmp_path, parts, **load_options):
    """The only problem of a folder."""
    with pytest.raises(InputError) as caught:
        load(write_folder(tmp_path / "job", parts), **load_options)
    (problem,) = caught.value.problems
    return problem


def warnings_of(tmp_path, parts):
    """The warnings of a folder that loads, as lines."""
    return lines(load(write_folder(tmp_path / "job", parts)).warnings)


def test_points_and_a_survey_are_one_too_many(tmp_path):
    parts = survey_parts()
    parts.tables["points"] = [["point", "x_m", "y_m", "z_m"]]
    parts.tables["points"] += [[name, *map(float, place)] for name, place in WALL.items()] * 1
    with pytest.raises(InputError) as caught:
        load(write_folder(tmp_path / "job", parts))
    told = [problem for problem in caught.value.problems if problem.file == "points.csv"]
    assert ["given together with a survey" in problem.expected for problem in told] == [True]


def test_nothing_to_adjust(tmp_path):
    parts = survey_parts(tank=False)
    parts.tables = {"control": parts.tables["control"]}
    parts.registers = {}
    problem = problem_of(tmp_path, parts, only="adjustment")
    assert (problem.file, problem.row) == ("job.toml", None)
    assert "nothing to adjust" in problem.expected


def test_a_survey_without_observations_is_reported(tmp_path):
    parts = survey_parts()
    kept = ("courses", "control", "targets")
    parts.tables = {name: rows for name, rows in parts.tables.items() if name in kept}
    parts.registers = {}
    problem = problem_of(tmp_path, parts)
    assert str(problem).startswith("points.csv: missing file; expected one with the columns point")
    assert "or the files of a survey" in problem.expected


def test_survey_settings_have_no_effect_with_points(tmp_path):
    parts = job_parts(settings={"adjustment.datum": "inner", "adjustment.camera.c": "off"})
    parts.tables["control"] = survey_parts().tables["control"]
    warnings = warnings_of(tmp_path, parts)
    keys = ("adjustment.datum", "adjustment.camera.c")
    rows = [settings_place("folder", parts, key)[1] for key in keys]
    assert [warning.split(":")[0] for warning in warnings] == [
        "control.csv",
        *(f"job.toml, row {row}, {key}" for row, key in zip(rows, keys, strict=True)),
    ]


def test_a_mesh_takes_no_survey(tmp_path):
    parts = read_on_comparator(survey_parts(tank=False))
    parts.settings = {"tank.id": "M", "tank.kind": "mesh", "mesh.file": "a.stl", "mesh.unit": "m"}
    parts.settings |= {"survey.date": "2024-05-31", "table.reference_temperature_c": 20.0}
    parts.settings["table.step_m"] = 0.1
    parts.beside["a.stl"] = b"solid"
    parts.tables["stadia"] = [["setup", "to", "angle_deg", "s_arcsec"], ["S", "P1", 10.0, 1.0]]
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert {problem.file for problem in problems} == {f"{name}.csv" for name in SURVEY_TABLES}
    assert all("not for a tank of kind mesh" in problem.expected for problem in problems)


@pytest.mark.parametrize(
    ("missing", "file", "column"),
    [
        ("photos", "image_points.csv", "photo"),
        ("setups", "slope_distances.csv", "setup"),
        ("cameras", "photos.csv", "camera"),
        ("instruments", "setups.csv", "instrument"),
    ],
)
def test_a_file_that_others_need_is_told_once(tmp_path, missing, file, column):
    parts = survey_parts()
    is_table = missing in parts.tables
    (parts.tables if is_table else parts.registers).pop(missing)
    problems = problems_of(write_folder(tmp_path / "job", parts))
    name = f"{missing}.{'csv' if is_table else 'toml'}"
    (problem,) = [problem for problem in problems if problem.file == name]
    assert f"the column {column} of {file} refers to its entries" in problem.expected
    assert not [one for one in problems if name in str(one.expected)]


@pytest.mark.parametrize("is_missing", [True, False])
def test_photographs_without_any_image_point(tmp_path, is_missing):
    parts = survey_parts()
    if is_missing:
        del parts.tables["image_points"]
    else:
        del parts.tables["image_points"][1:]
    problem = problem_of(tmp_path, parts)
    assert str(problem) == (
        "image_points.csv: no rows; expected the image points of photo 'F1' and 3 more photos"
    )


def test_unknown_name_is_reported_once(tmp_path):
    parts = survey_parts()
    for row in parts.tables["image_points"][1:9]:
        row[0] = "F4"
    del parts.tables["photos"][1]
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row, problem.column) == ("image_points.csv", 2, "photo")
    assert problem.expected.endswith("8 rows refer to it")


@pytest.mark.parametrize("count", [1, 2])
def test_a_photo_with_too_few_points(tmp_path, count):
    parts = survey_parts()
    del parts.tables["image_points"][1 + count : 9]
    parts.tables["image_points"] += [parts.tables["image_points"][1][:]]  # a repeated reading
    parts.tables["image_points"][-1][2] += 0.001
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row, problem.column) == ("photos.csv", 2, "photo")
    assert f"has {count} image point" in problem.expected


def test_photo_with_known_orientation_needs_no_points(tmp_path):
    parts = survey_parts()
    del parts.tables["image_points"][2:9]
    for column in ("sx_m", "sy_m", "sz_m", "s_omega_deg", "s_phi_gon", "s_kappa_deg"):
        spoil(parts, "photos", 2, column, 0.0)
    assert warnings_of(tmp_path, parts) == []


def test_a_photo_without_points_is_left_out(tmp_path):
    parts = survey_parts()
    parts.tables["photos"].append(["F9", "D", *[None] * 9])
    job = load(write_folder(tmp_path / "job", parts))
    assert [photo.name for photo in job.measurements.photos] == ["F1", "F2", "F3", "D1"]
    assert [str(warning) for warning in job.warnings] == [
        "photos.csv, row 6, photo: photo 'F9' has no image points; it is left out"
    ]


def test_a_photo_without_points_holds_no_datum(tmp_path):
    parts = survey_parts({"adjustment.datum": "fixed_photo", "adjustment.fixed_photo": "F9"})
    parts.tables["photos"].append(["F9", "D", *[None] * 9])
    problem = problem_of(tmp_path, parts)
    assert problem.column == "adjustment.fixed_photo"
    assert "expected a photo with image points" in problem.expected


def test_image_coordinates_from_a_corner(tmp_path):
    parts = survey_parts()
    del parts.tables["image_points"][25:]
    for row in parts.tables["image_points"][1:]:
        row[2:4] = [row[2] + 90, row[3] + 65]
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert all("from a corner instead of the middle?" in one.expected for one in problems)


def test_pixels_without_a_size(tmp_path):
    parts = survey_parts()
    parts.registers["cameras"]["D"] |= {"format_mm": [24.0, 16.0]}
    del parts.registers["cameras"]["D"]["format_px"], parts.registers["cameras"]["D"]["pixel_um"]
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.column) == ("cameras.toml", "D.pixel_um")
    assert "image points of this camera are in pixels" in problem.expected


def test_no_image_coordinates_at_all(tmp_path):
    parts = survey_parts()
    parts.tables["image_points"] = [row[:2] for row in parts.tables["image_points"]]
    problem = problem_of(tmp_path, parts)
    assert problem.expected.startswith("missing columns; expected x_mm and y_mm, or column_px")


@pytest.mark.parametrize("table", ["directions", "zenith_angles", "azimuths", "vertical_angles"])
def test_no_column_of_angles(tmp_path, table):
    parts = survey_parts()
    rows = parts.tables[table]
    place = next(i for i, name in enumerate(rows[0]) if name.endswith(("_deg", "_gon", "_dms")))
    parts.tables[table] = [row[:place] + row[place + 1 :] for row in rows]
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row) == (f"{table}.csv", None)
    assert problem.expected.startswith("missing column; expected ")


@pytest.mark.parametrize("other", ["w3", "W 3", "W-3", "W03", "W_003"])
@pytest.mark.parametrize("count", [1, 2])
def test_a_point_in_two_spellings(tmp_path, other, count):
    parts = survey_parts()
    rows = [row for row in parts.tables["image_points"] if row[1] == "W3"]
    for row in rows[:count]:
        row[1] = other
    parts.tables["targets"] = parts.tables["targets"][:1]
    words = f"{other!r} is in {count} row"
    if count == 1:
        problem = problem_of(tmp_path, parts)
        assert (problem.file, problem.row, problem.column) == ("image_points.csv", 4, "point")
        assert words in problem.expected
    else:
        (warning,) = warnings_of(tmp_path, parts)
        assert words in warning
        assert "one point in two spellings?" in warning


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("P1", "p 01", True),
        ("R1-G7", "r1 g07", True),
        ("1-1", "1.1", True),
        ("1-1", "11", False),
        ("P1", "P10", False),
        ("101", "0101", True),
        ("1A", "1-a", True),
        ("A", "B", False),
    ],
)
def test_spellings_of_one_name(one, other, same):
    assert (plain(one) == plain(other)) is same


@pytest.mark.parametrize(
    ("table", "rows", "words"),
    [
        ("distances", [["W1", "W2", 5.0, 0.0]], "'W1' and 'W2' are already held (xyz"),
        ("height_differences", [["W1", "W2", 0.9, 0.0]], "are already held (z in"),
        ("plumb_lines", [["W1", "W2", 0.0]], "are already held (xy in"),
        ("distances", [["W5", "W6", 5.0, 0.0], ["W6", "W5", 5.1, 0.0]], "not the value at which"),
        (
            "height_differences",
            [["W5", "W6", 0.9, 0.0], ["W5", "W6", 0.8, 0.0]],
            "not the value at which row",
        ),
    ],
)
def test_values_held_twice(tmp_path, table, rows, words):
    parts = survey_parts()
    parts.tables["check"] = parts.tables["check"][:1]
    for row in parts.tables["control"][1:3]:
        row[4:7] = [0.0, 0.0, 0.0]
    width = len(parts.tables[table][0])
    parts.tables[table] += [row + [None] * (width - len(row)) for row in rows]
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row) == (f"{table}.csv", len(parts.tables[table]))
    assert words in problem.expected


def test_a_held_azimuth_between_held_points(tmp_path):
    parts = survey_parts()
    parts.tables["azimuths"].append(["W1", "W2", "112 30 00", 0.0])
    for row in parts.tables["control"][1:3]:
        row[4:6] = [0.0, 0.0]
    assert "are already held (xy in control.csv)" in problem_of(tmp_path, parts).expected


@pytest.mark.parametrize(
    ("table", "column", "value", "words"),
    [
        ("control", "sx_mm", 0.001, "is it in metres?"),
        ("distances", "s_mm", 0.001, "is it in metres?"),
        ("image_points", "sx_um", 0.003, "is it in millimetres?"),
        ("directions", "s_arcsec", 0.001, "is it in degrees or gon?"),
    ],
)
def test_standard_deviations_in_another_unit(tmp_path, table, column, value, words):
    parts = survey_parts()
    for row in range(2, len(parts.tables[table]) + 1):
        if parts.tables[table][row - 1][parts.tables[table][0].index(column)] is not None:
            spoil(parts, table, row, column, value)
    (warning,) = warnings_of(tmp_path, parts)
    assert warning.startswith(f"{table}.csv, {column}: at most ")
    assert words in warning


@pytest.mark.parametrize("known", [True, False])
def test_distances_in_millimetres(tmp_path, known):
    parts = survey_parts()
    if not known:  # nothing but the tank tells the size
        for name in ("control", "check", "photos", "image_points"):
            del parts.tables[name]
        del parts.settings["adjustment.datum"]
    for row in parts.tables["distances"][1:]:
        row[2] *= 1000
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row, problem.column) == ("distances.csv", None, "distance_m")
    assert "in millimetres?" in problem.expected


def test_control_far_away_unless_swapped(tmp_path):
    parts = survey_parts()
    for name in ("control", "check", "photos"):
        for row in parts.tables[name][1:]:
            at = parts.tables[name][0].index("x_m")
            if row[at] is not None and "plant" not in row:
                row[at] += 674_000.0
                row[at + 1] = None if row[at + 1] is None else row[at + 1] + 7_184_000.0
    assert warnings_of(tmp_path / "sound", parts) == []
    row = parts.tables["control"][2]
    row[1:3] = row[1:3][::-1]
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row, problem.column) == ("control.csv", 3, "x_m")
    assert problem.expected.startswith("'W2' is ")
    assert problem.expected.endswith("x and y swapped?")


def test_control_that_fits_its_distances_when_swapped(tmp_path):
    parts = survey_parts()
    places = {"A": (0, 0, 0), "B": (30, 5, 1), "C": (3, 40, 2), "D": (25, 31, 0)}
    parts.tables["control"][1:] = [
        [name, *map(float, place), 1.0, 1.0, 1.0, None] for name, place in places.items()
    ]
    for one, other in (("A", "B"), ("B", "C"), ("C", "A"), ("D", "C"), ("D", "B")):
        distance = float(np.linalg.norm(np.subtract(places[one], places[other])))
        parts.tables["distances"].append([one, other, distance, 1.0, *[None] * 4])
    assert warnings_of(tmp_path / "sound", parts) == []
    parts.tables["control"][2][1:3] = [5.0, 30.0]
    (warning,) = warnings_of(tmp_path, parts)
    assert "control.csv, row 3, x_m: 'B' misses the measured distances" in warning


def test_reciprocal_azimuths_in_gon(tmp_path):
    parts = survey_parts()
    parts.tables["azimuths"] = [
        ["from", "to", "azimuth_deg", "s_arcsec"],
        ["S1", "W7", 20.0, 5.0],
        ["W7", "S1", 220.001, 5.0],
    ]
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row, problem.column) == ("azimuths.csv", None, "azimuth_deg")
    assert "half a circle as 200.00, so they are in gon; expected degrees" in problem.expected


def test_reciprocal_zenith_angles_in_degrees_given_as_gon(tmp_path):
    parts = survey_parts()
    parts.tables["zenith_angles"] += [
        ["1", "S2", 88.0, 5.0, 1.55, None],
        ["2", "S1", 92.01, 5.0, None, None],
    ]
    problem = problem_of(tmp_path, parts)
    assert "half a circle as 180.01, so they are in degrees" in problem.expected


def test_zenith_angles_to_marks_on_the_ground_are_no_evidence(tmp_path):
    parts = survey_parts()
    parts.tables["setups"][2][3] = 1.5
    parts.tables["zenith_angles"] += [  # both look down: they add up to 200 degrees, rightly
        ["1", "S2", 100.0 / 0.9, 5.0, None, None],
        ["2", "S1", 100.0 / 0.9, 5.0, None, None],
    ]
    assert warnings_of(tmp_path, parts) == []


@pytest.mark.parametrize("factor", [1.0, 1 / 0.9])
def test_directions_between_known_points(tmp_path, factor):
    parts = survey_parts()
    parts.tables["control"] = [["point", "x_m", "y_m", "z_m"], ["S1", 12.0, 9.0, 0.4]]
    parts.tables["control"] += [[n, *map(float, place)] for n, place in WALL.items()]
    parts.tables["check"] = parts.tables["check"][:1]
    for row in parts.tables["directions"][1:]:
        row[3] = row[3] * factor % 360
    for row in parts.tables["directions"][1:]:
        row[3] = row[3] if factor == 1 or row[0] == "1" else row[3] % 300
    if factor == 1.0:
        assert warnings_of(tmp_path, parts) == []
    else:
        parts.tables["directions"][1:] = [
            row for row in parts.tables["directions"][1:] if row[0] == "1"
        ]
        problem = problem_of(tmp_path, parts)
        assert problem.column == "direction_deg"
        assert "if they are in gon" in problem.expected


@pytest.mark.slow(after=10)
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda parts: parts.tables["distances"].append(parts.tables["distances"][1][:]),
            "distances.csv, row 5: 1 rows are the same as another one to the last digit (rows 5",
        ),
        (
            lambda parts: parts.tables["directions"].append(["2", "b", "W1", 10.0, 3.0]),
            "set-up 2, set b has directions to one point only",
        ),
        (
            lambda parts: parts.tables["check"].append(["W1", 0.0, 6.5, 1.0]),
            "'W1' is also a control point",
        ),
        (
            lambda parts: parts.tables["check"].append(["Z9", 0.0, 6.5, 1.0]),
            "not observed by anything, so they have no effect: Z9",
        ),
        (
            lambda parts: parts.tables["targets"].extend(
                [["Z8"] + [None] * 4, ["Z9"] + [None] * 4]
            ),
            "not observed by anything, left out: Z8, Z9",
        ),
        (
            lambda parts: spoil(parts, "distances", 4, "temperature_c", 20.0),
            "without effect in 1 rows: the instrument has no expansion_per_k",
        ),
        (
            lambda parts: spoil(parts, "distances", 3, "temperature_c", None),
            "blank in 1 rows of a tape with expansion_per_k",
        ),
        (
            lambda parts: parts.registers["cameras"][FILM].update({"s_c_mm": 0.01}),
            "without effect: the parameter is not weighted (s_c_mm); [adjustment.camera] c =",
        ),
        (
            lambda parts: parts.registers["cameras"][FILM].update({"K3_mm-6": 1e-14}),
            "adjustment.camera.K3 is off: the parameter is held at this value",
        ),
        (
            lambda parts: parts.registers["cameras"][FILM].update({"c_mm": 15.0}),
            "in another unit?",
        ),
        (
            lambda parts: parts.registers["cameras"][FILM].update({"K2_mm-4": 1e-9}),
            "moves the corner of the image by",
        ),
        (
            lambda parts: parts.registers["instruments"]["TS"].update({"correction": 0.05}),
            "50000 ppm",
        ),
    ],
)
def test_warnings(tmp_path, change, words):
    parts = survey_parts()
    change(parts)
    (warning,) = warnings_of(tmp_path, parts)
    assert words in warning


def test_a_convention_that_is_assumed_is_named(tmp_path):
    parts = survey_parts({"adjustment.camera.K1": None})
    camera = parts.registers["cameras"]["D"]
    for key in ("convention", "K1_mm-2", "s_K1"):
        del camera[key]
    del parts.registers["cameras"][FILM]["s_K1"]
    assert warnings_of(tmp_path, parts) == [
        "cameras.toml, row 13, D.convention: missing; K, P and the affinity are taken as"
        " distortion_of_ideal"
    ]
    parts.settings |= {"adjustment.camera.default": "off", "adjustment.camera.c": "camera free"}
    assert warnings_of(tmp_path / "off", parts) == []


def test_free_and_held_contradict(tmp_path):
    parts = survey_parts({"adjustment.camera.c": "photo free"})
    parts.registers["cameras"]["D"]["s_c_mm"] = 0.0
    problem = problem_of(tmp_path, parts)
    assert problem.column == "D.s_c_mm"
    assert "adjustment.camera.c has it free" in problem.expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[camera.D]\nc_mm = 1.0\n", "expected sections such as [cameras.NAME]"),
        ("[cameras]\nc_mm = 1.0\n", "is in no section [cameras.NAME]"),
        ("c_mm = 1.0\n", "expected sections such as [cameras.NAME]"),
        ("[cameras.D\n", "cannot be read"),
        ('[cameras." D"]\nc_mm = 1.0\n', "found ' D'; expected 'D', without extra spaces"),
        ('[cameras."=cmd()"]\nc_mm = 1.0\n', "a letter, digit or underscore first"),
    ],
)
def test_cameras_toml_of_another_form(tmp_path, text, words):
    folder = write_folder(tmp_path / "job", survey_parts())
    (folder / "cameras.toml").write_text(text, encoding="utf-8")
    problems = [one for one in problems_of(folder) if one.file == "cameras.toml"]
    assert any(words in problem.expected for problem in problems)


def test_a_sheet_of_cameras_of_another_form(tmp_path):
    parts = survey_parts()
    parts.tables["cameras"] = [["name", "key", "value"], ["D", "c_mm", 1.0]]
    parts.registers = {"instruments": parts.registers["instruments"]}
    problems = problems_of(write_book(tmp_path / "job.xlsx", parts))
    assert ("sheet cameras", 1, "camera") in places(problems)
    assert {problem.file for problem in problems} == {"sheet cameras"}


def test_a_table_of_which_no_row_can_be_read(tmp_path):
    parts = survey_parts()
    parts.extra_files["azimuths.csv"] = "from,to,azimuth_deg,s_arcsec\nS1,S2\n"
    del parts.tables["azimuths"]
    problem = problem_of(tmp_path, parts)
    assert (problem.file, problem.row) == ("azimuths.csv", 2)


CELLS = st.one_of(
    st.none(),
    st.text(max_size=8),
    st.sampled_from(
        ["W1", "F1", "1", "tape 1", "0", "-1", "nan", "1e999", "360", "1 2 3", "check"]
    ),
    st.floats(allow_nan=False, allow_infinity=False),
)
PLACE = st.tuples(st.sampled_from(SURVEY_TABLES), st.integers(1, 40), st.integers(0, 12), CELLS)


@pytest.mark.slow
@QUICK
@given(st.lists(PLACE, min_size=1, max_size=4), st.booleans())
def test_any_cells_in_a_survey(changes, tank):
    parts = read_on_comparator(survey_parts(tank=tank))
    for table, row, column, value in changes:
        rows = parts.tables[table]
        cells = rows[1 + row % (len(rows) - 1)]
        cells[column % len(cells)] = value
    with tempfile.TemporaryDirectory() as place:
        folder = write_folder(Path(place) / "job", parts)
        assert_job_or_problems(folder, None if tank else "adjustment")


@pytest.mark.slow
@QUICK
@given(
    st.sampled_from(["cameras.toml", "instruments.toml", "image_points.csv", "photos.csv"]),
    st.floats(0, 1),
    st.integers(0, 20),
    st.sampled_from([b"\0", b'"', b"\n", b"\xff", b",", b"[", b"]", b"=", b"nan", b"[]", b"{}"]),
)
def test_any_bytes_in_a_survey(name, start, length, put):
    with tempfile.TemporaryDirectory() as place:
        folder = write_folder(Path(place) / "job", survey_parts())
        data = (folder / name).read_bytes()
        at = int(start * len(data))
        (folder / name).write_bytes(data[:at] + put + data[at + length :])
        assert_job_or_problems(folder)


def assert_job_or_problems(path, only=None):
    problems = ()
    try:
        assert isinstance(load(path, only=only), Job)
    except InputError as error:
        problems = error.problems
    assert all(len(str(problem).splitlines()) == 1 for problem in problems)


def test_one_distance_in_millimetres(tmp_path):
    parts = survey_parts()
    row = parts.tables["distances"][1]
    parts.tables["distances"] += [list(row) for _ in range(3)]
    parts.tables["distances"][-1][2] *= 1000
    told = problems_of(write_folder(tmp_path / "job", parts))
    (problem,) = (one for one in told if one.row == 7)
    assert (problem.file, problem.column) == ("distances.csv", "distance_m")
    assert "half of the distances are below" in problem.expected


def test_column_missing_in_all_rows_is_reported_once(tmp_path):
    parts = survey_parts()
    at = parts.tables["image_points"][0].index("y_mm")
    for row in parts.tables["image_points"]:
        del row[at]
    told = problems_of(write_folder(tmp_path / "job", parts))
    (problem,) = (one for one in told if one.column == "y_mm")
    assert (problem.file, problem.row) == ("image_points.csv", None)
    assert problem.expected.startswith("the column is missing or blank")


@pytest.mark.parametrize(
    ("name", "words"),
    [("tangents", "a sight to a limb in each"), ("wall_hits", "a sight to the wall in each")],
)
@pytest.mark.parametrize("in_book", [False, True])
def test_headings_alone_beside_a_traverse_are_told(tmp_path, name, words, in_book):
    """A survey of set-ups alone has no wall; with targets.csv an empty table says nothing."""
    stations = ring_of_stations(4, 13.0)
    parts = tangent_parts(
        [{"setup": f"I{i}", "course": "1"} for i in range(1, 5)],
        traverse_tables(stations, np.zeros(4), Tool()),
    )
    del parts.tables["tangents"]
    columns = ["setup", "course", "level_m", "side", "direction_deg", "zenith_deg", "s_arcsec"]
    hits = ["setup", "course", "direction_deg", "zenith_deg", "distance_m"]
    parts.tables[name] = [columns if name == "tangents" else hits]
    parts.tables["control"] = [["point", "x_m", "y_m", "z_m", "sx_mm"], ["S1", 0, 13, 1.5, 1]]
    path = tmp_path / ("job.xlsx" if in_book else "job")
    where = f"job.xlsx, sheet {name}" if in_book else f"{name}.csv"
    told = f"{where}: no rows; expected {words}"
    (write_book if in_book else write_folder)(path, parts)
    assert told in lines(problems_of(path))
    parts.tables["targets"] = [["point"], ["S2"]]
    (write_book if in_book else write_folder)(path, parts)
    assert load(path).measurements is not None
