"""Bad bottoms, deadwood, roofs, tables and kinds: each mistake gives its line, in both forms.

The truth of these tests is the property itself: what was spoilt, and where, is known.
"""

import numpy as np
import pytest
from job_builder import job_parts, write_folder, write_job
from messages_told import lines
from spoilt import FORMS, places, problems_of, settings_place, table_file, write

from tankcal.job import load
from tankcal.job.contract import bottom
from tankcal.tank.bottoms import FEWEST_POINTS, MOST_POINTS

RINGS = [(0.0, 0.0, -0.1)] + [
    (r * np.sin(a), r * np.cos(a), -0.1 + r / 65)
    for r in (3.0, 6.0)
    for a in np.arange(0, 2 * np.pi, np.pi / 4)
]
LEVELS = [(0.0, 0.5), (0.1, 12.0), (0.2, 25.2)]  # the full cross-section holds 13.27 m3 in 0.1 m
BALL = [
    (f"P{i}", 10 * np.sin(t) * np.cos(a), 10 * np.sin(t) * np.sin(a), 10 * np.cos(t))
    for i, (t, a) in enumerate(zip(np.linspace(0.3, 2.8, 40), np.arange(40) * 2.4, strict=True))
]
LYING = [
    (f"P{i}", 1.2 * np.sin(a), x, 1.2 * np.cos(a))
    for i, (x, a) in enumerate(zip(np.linspace(0, 10, 40), np.arange(40) * 2.4, strict=True))
]
SCAN = {
    "horizontal.diameter_m": None,
    "horizontal.azimuth_deg": 0.0,
    "horizontal.dip_from_a_m": 5.0,
}


# changes of a sound job, key that is told, words that the message must hold
SETTINGS_OF_VERTICAL = [
    ({"table.step_m": None}, "table.step_m", "or height_unit = ft-in-8"),
    ({"table.height_unit": "ft-in-8"}, "table.step_m", "expected a blank"),
    ({"table.height_unit": "feet"}, "table.height_unit", "'ft-in-16'"),
    ({"table.volume_unit": "gal"}, "table.volume_unit", "'bbl'"),
    ({"table.fine_step_m": 0.001}, "table.fine_zones", "expected together with fine_step_m"),
    ({"table.fine_zones": [[0, 0.3]]}, "table.fine_step_m", "expected together with fine_zones"),
    ({"table.max_interpolation_error_l": 0}, "table.max_interpolation_error_l", "above 0"),
    ({"table.height_expansion": "perhaps"}, "table.height_expansion", "true or false"),
    ({"table.liquid_density_kg_m3": 0.85}, "table.liquid_density_kg_m3", "in g/cm3?"),
    ({"table.other_densities_kg_m3": [700, -1]}, "table.other_densities_kg_m3", "numbers above 0"),
    ({"table.other_densities_kg_m3": [0.7]}, "table.other_densities_kg_m3", "in g/cm3?"),
    ({"table.other_densities_kg_m3": [700, 700]}, "table.other_densities_kg_m3", "twice"),
    ({"table.other_densities_kg_m3": "700, 850"}, "table.other_densities_kg_m3", "700; 850"),
    ({"table.other_densities_kg_m3": True}, "table.other_densities_kg_m3", "truth value"),
    (
        {"table.other_densities_kg_m3": [700], "corrections.head": False},
        "table.other_densities_kg_m3",
        "corrections.head",
    ),
    ({"corrections.plate": "off"}, "corrections.plate", "true or false"),
    ({"certificate.date_of_issue": "2024-05-30"}, "certificate.date_of_issue", "before the survey"),
    ({"certificate.survey_end": "2024-05-30"}, "certificate.survey_end", "before the first day"),
    ({"corrections.plates": True}, "corrections.plates", "did you mean plate?"),
    ({"survey.liquid_level_m": 3.0}, "survey.liquid_density_kg_m3", "the density of the liquid"),
    (
        {"survey.liquid_level_m": 3.0, "survey.liquid_density_kg_m3": 0},
        "survey.liquid_density_kg_m3",
        "the density of the liquid",
    ),
    (
        {"survey.liquid_level_m": 9.6, "survey.liquid_density_kg_m3": 850.0},
        "survey.liquid_level_m",
        "at most the top of the shell",
    ),
    ({"bottom.form": "conical"}, "bottom.form", "'cone' or 'dish'"),
    ({"bottom.form": "cone"}, "bottom.centre_z_m", "missing"),
    ({"bottom.form": "dish"}, "bottom.centre_z_m", "missing"),
    ({"bottom.centre_z_m": -0.1}, "bottom.centre_z_m", "only for a cone or another head"),
    ({"bottom.form": "cone", "bottom.centre_z_m": -150.0}, "bottom.centre_z_m", "65 m below"),
    ({"bottom.form": "cone", "bottom.centre_z_m": 9.6}, "bottom.centre_z_m", "9.5 m above"),
    ({"bottom.form": "dish", "bottom.centre_z_m": -7.0}, "bottom.centre_z_m", "6.5 m below"),
    ({"horizontal.length_m": 10.0}, "[horizontal]", "this one is vertical"),
    ({"sphere.diameter_m": 10.0}, "[sphere]", "this one is vertical"),
    ({"mesh.file": "tank.stl"}, "[mesh]", "only for a tank of kind mesh"),
    ({"tank.nominal_volume_m3": 0}, "tank.nominal_volume_m3", "0.01"),
]


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("changes", "key", "words"), SETTINGS_OF_VERTICAL)
def test_settings_of_a_vertical_tank(tmp_path, form, changes, key, words):
    parts = job_parts(settings=changes)
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert words in problem.expected
    if key.startswith("["):
        assert (problem.file, problem.column) == (settings_place(form, parts, "x")[0], key)
    else:
        assert places([problem]) == [settings_place(form, parts, key)]


ZONES = [
    ([[0.3, 0.1]], "lower dip first"),
    ([[9.0, 9.6]], "dips up to 9.5 m"),
    ([[0, 300]], "from 0 to 200"),
    ([[2.0, 2.4], [0, 0.3], [2.2, 3.0]], "2-2.4 and 2.2-3 overlap"),
    ([[0, 0.3, 0.4]], "found a list"),
    ([0, 0.3], "found a list"),
    ("0-0.3, 2.1-2.4", "pairs such as 0-0.3; 2.1-2.4"),
    ("0,1-0,3", "pairs such as"),
    ("0..1-1", "expected a number"),
    (0.3, "found 0.3"),
]


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("zones", "words"), ZONES)
def test_fine_zones(tmp_path, form, zones, words):
    settings = {"table.fine_step_m": 0.001, "table.fine_zones": zones}
    parts = job_parts(settings=settings)
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [settings_place(form, parts, "table.fine_zones")]
    is_list_of_numbers = words == "found a list" and form == "workbook"  # a text there
    assert ("pairs such as" if is_list_of_numbers else words) in problem.expected


@pytest.mark.parametrize("fine_step", [0.01, 0.02, 0.003])
def test_a_fine_step_is_a_whole_part_of_the_step(tmp_path, fine_step):
    settings = {"table.fine_step_m": fine_step, "table.fine_zones": [[0, 0.3]]}
    parts = job_parts(settings=settings)
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert problem.column == "table.fine_step_m"
    assert "divided by a whole number" in problem.expected


def test_too_many_rows(tmp_path):
    settings = {"table.fine_step_m": 0.0001, "table.fine_zones": [[0, 9.0]]}
    (problem,) = problems_of(write_folder(tmp_path / "a", job_parts(settings=settings)))
    assert "at most 25000 rows in the fine zones" in problem.expected
    tall = {"table.height_unit": "ft-in-16", "table.step_m": None}
    parts = job_parts(settings=tall, height=45.0, courses=20)
    (problem,) = problems_of(write_folder(tmp_path / "b", parts))
    assert (problem.column, problem.expected[:5]) == ("table.height_unit", "28346")  # 45 m / 1/16"


# table, its rows, row and column that is told, words
ROWS_OF_VERTICAL = [
    ("deadwood", [("a", 0.5, 0.4, -0.1)], 2, "top_m", "a top above it"),
    ("deadwood", [("a", 0.5, 1.0, -100.0)], 2, "volume_m3", "holds 66.37 m3"),
    ("deadwood", [("a", 0.5, 1.0, -2000.0)], 2, "volume_m3", "in litres?"),
    ("deadwood", [("a", 0.5, 0.5, -200.0)], 2, "volume_m3", "in litres?"),
    ("deadwood", [("a", 0.5, 9.6, -0.1)], 2, "top_m", "the top of the tank"),
    ("deadwood", [("a", -0.5, 0.1, -0.1)], 2, "bottom_m", "the tank's lowest point"),
    ("deadwood", [("a", -2.5, 0.1, 0.1)], 2, "bottom_m", "the tank's lowest point"),
    ("deadwood", [("a", 500, 1000, -0.1)], 2, "top_m", "from -100 to 100"),
    ("deadwood", [("a", 0, 1, -0.1), ("a", 1, 2, -0.1)], 3, "name", "already in row 2"),
    ("deadwood", [("a", 0, 1, None)], 2, "volume_m3", "blank"),
    ("deadwood", [("a", 0, 1, -0.1, -0.01)], 2, "u_m3", "from 0"),
    ("welds", [("9", 10.0)], 2, "course", "found '9'; expected a course of "),
    ("welds", [("1", 370.0)], 2, "azimuth_deg", "from 0 to 360"),
    ("welds", [("1", 0.0), ("2", 0.0), ("1", 359.95)], 4, "azimuth_deg", "already in row 2"),
    ("bottom", RINGS[:2], None, None, "2 points; expected 12 or more"),
    ("bottom", [(1.0, 2.0, 0.0)] * 12, None, "x_m", "in one place or on one line"),
    ("bottom", [(x / 5, x / 3, 0.0) for x in range(12)], None, "x_m", "on one line"),
    ("bottom", [*RINGS, (7.5, 0.0, 0.0)], 19, "x_m", "a radius of 6.5 m"),
    ("bottom", [*RINGS, (0.0, 0.0, -0.1)], 19, "x_m", "x and y of row 2 again"),
    ("bottom", [*RINGS, (1.0, 1.0, 1.5)], 19, "z_m", "1.5 m above datum.bottom_z_m"),
    ("bottom", [*RINGS, (1.0, 1.0, -13.5)], 19, "z_m", "13.5 m below datum.bottom_z_m"),
    ("bottom", [(1e3 * x, 1e3 * y, z) for x, y, z in RINGS], None, "x_m", "in millimetres"),
    ("bottom", [(x + 500, y, z) for x, y, z in RINGS], None, "x_m", "another frame"),
    ("bottom", [(x, y, z + 100) for x, y, z in RINGS], None, "z_m", "another frame"),
    ("bottom", [(x, y, -1e3 * z + 3) for x, y, z in RINGS], None, "z_m", "in millimetres"),
    ("bottom", [*((*one, 2.0) for one in RINGS), (1, 1, 0, None)], 19, "s_mm", "blank"),
    ("bottom", [*((*one, 2.0) for one in RINGS), (1, 1, 0, -1)], 19, "s_mm", "above 0"),
    ("bottom_volumes", LEVELS[:1], None, None, "1 level; expected 2 or more"),
    ("bottom_volumes", [*LEVELS, (0.15, 30.0)], 5, "level_m", "found 0.15 after 0.2"),
    ("bottom_volumes", [*LEVELS, (0.3, 25.2)], 5, "volume_m3", "found 25.2 after 25.2"),
    ("bottom_volumes", [(a, 1000 * v) for a, v in LEVELS[:2]], 3, "volume_m3", "in litres?"),
    ("bottom_volumes", [*LEVELS, (0.3, 50.0)], 5, "volume_m3", "expected about 13.27 m3"),
    ("bottom_volumes", [(1 + a, v) for a, v in LEVELS], 2, "level_m", "a row at dip 0"),
    ("bottom_volumes", [(a - 0.3, v) for a, v in LEVELS], 4, "level_m", "up to the shell, 0 m"),
    ("bottom_volumes", [*LEVELS, (30.0, 2600.0)], 5, "level_m", "in millimetres?"),
    ("bottom_volumes", [(a, 3000 + v) for a, v in LEVELS], 2, "volume_m3", "a heel of at most"),
    ("bottom_volumes", [(a, None) for a, _ in LEVELS], None, "volume_m3", "not given"),
]


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("option", "rows", "row", "column", "words"), ROWS_OF_VERTICAL)
def test_rows_of_a_vertical_tank(tmp_path, form, option, rows, row, column, words):
    parts = job_parts(**{option: rows})
    file = table_file(form, option.removesuffix("_volumes"))
    found = problems_of(write(tmp_path, parts, form))
    here = [problem for problem in found if (problem.row, problem.column) == (row, column)]
    assert [problem.file for problem in here] == [file]
    assert words in here[0].expected
    others = [problem for problem in found if problem not in here]
    assert not others or (option, column) == ("deadwood", "top_m")  # 500 is no dip, either


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_bottom_that_does_not_fit_its_form(tmp_path, form):
    file = table_file(form, "bottom")
    both = [[*one, level, 1.0 + level] for level, one in enumerate(RINGS)]
    cases = [
        (job_parts(bottom=RINGS, settings={"bottom.form": "flat"}), None, "rows are given, but"),
        (job_parts(bottom=RINGS, settings={"bottom.form": "liquid"}), "level_m", "not given"),
        (job_parts(settings={"bottom.form": "points"}), None, "no rows"),
        (job_parts(bottom=[one[:2] for one in RINGS]), "z_m", "not given"),
        (job_parts(bottom=RINGS), "x_m", "not both"),
    ]
    cases[-1][0].tables["bottom"] = [["x_m", "y_m", "z_m", "level_m", "volume_m3"], *both]
    for number, (parts, column, words) in enumerate(cases):
        folder = tmp_path / str(number)
        folder.mkdir()
        problem = problems_of(write(folder, parts, form))[0]
        assert places([problem]) == [(file, None, column)]
        assert words in problem.expected


def test_as_many_points_of_a_bottom_as_a_surface_is_made_through(tmp_path):
    assert (bottom.MIN_POINTS, bottom.MAX_POINTS) == (FEWEST_POINTS, MOST_POINTS)
    square = [(x / 5, y / 5, -0.01) for x in range(-11, 12) for y in range(-11, 12)]  # 529
    (problem,) = problems_of(write_folder(tmp_path / "job", job_parts(bottom=square)))
    assert places([problem]) == [("bottom.csv", None, None)]
    assert "at most 500" in problem.expected


ROOFS = [
    ({"mass_kg": None}, "mass_kg", "expected together with critical_bottom_m"),
    ({"weighing": None}, "weighing", "expected together with mass_kg"),
    ({"weighing": "water"}, "weighing", "'air' or 'vacuum'"),
    ({"mass_kg": 9.0}, "mass_kg", "in tonnes?"),
    ({"mass_kg": 9e6}, "mass_kg", "in grams?"),
    ({"mass_kg": 0}, "mass_kg", "above 0"),
    ({"critical_top_m": 0.9}, "critical_top_m", "above critical_bottom_m = 1"),
    ({"critical_top_m": 9.9}, "critical_top_m", "within the shell"),
    ({"critical_top_m": 1.05}, "critical_top_m", "0.0798 m of it"),  # 9000 / (850 pi 6.5^2)
    ({"reference_density_kg_m3": 0.85}, "reference_density_kg_m3", "in g/cm3?"),
]


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("changes", "key", "words"), ROOFS)
def test_floating_roofs(tmp_path, form, changes, key, words):
    settings = {f"roof.{name}": value for name, value in changes.items()}
    parts = job_parts(roof={}, settings=settings)
    found = problems_of(write(tmp_path, parts, form))
    assert places(found[:1]) == [settings_place(form, parts, f"roof.{key}")]
    assert words in found[0].expected
    assert {problem.column for problem in found} <= {f"roof.{key}", "roof.critical_top_m"}


@pytest.mark.parametrize("form", FORMS)
def test_plates_that_the_liquid_head_needs(tmp_path, form):
    plates = [8.0, 8.0, 8.0, 0.0, 8.0]
    head = job_parts(thickness_mm=plates, settings={"table.liquid_density_kg_m3": 850.0})
    (problem,) = problems_of(write(tmp_path, head, form))
    assert places([problem]) == [(table_file(form, "courses"), 5, "thickness_mm")]
    assert "the liquid head" in problem.expected
    filled = {"survey.liquid_density_kg_m3": 850.0, "corrections.head": True}
    for level, is_sound in ((5.69, True), (5.71, False)):  # course 4 begins at 5.7 m
        settings = filled | {"survey.liquid_level_m": level}
        path = write_folder(
            tmp_path / str(level), job_parts(thickness_mm=plates, settings=settings)
        )
        if is_sound:
            assert load(path).survey.liquid_level_m == level
        else:
            assert places(problems_of(path)) == [("courses.csv", 5, "thickness_mm")]
    head.settings["corrections.head"] = False
    assert load(write_folder(tmp_path / "off", head)).switches.head is False


# kind, changes, key, words
SETTINGS_OF_KINDS = [
    ("horizontal", {"horizontal.length_m": None}, "horizontal.length_m", "missing"),
    ("horizontal", {"horizontal.length_m": 10000.0}, "horizontal.length_m", "another unit"),
    ("horizontal", {"horizontal.diameter_m": None}, "horizontal.diameter_m", "or points.csv"),
    ("horizontal", {"horizontal.width_m": 2.0}, "horizontal.width_m", "with diameter_m"),
    ("horizontal", {"horizontal.end_a": None}, "horizontal.end_a", "missing"),
    ("horizontal", {"horizontal.end_a": "round"}, "horizontal.end_a", "'ellipsoidal'"),
    ("horizontal", {"horizontal.end_a": "conical"}, "horizontal.end_a_depth_m", "missing"),
    ("horizontal", {"horizontal.end_b_depth_m": 0.5}, "horizontal.end_b_depth_m", "flat end"),
    (
        "horizontal",
        {"horizontal.end_a": "spherical", "horizontal.end_a_depth_m": 1.21},
        "horizontal.end_a_depth_m",
        "at most 1.2 m",
    ),
    (
        "horizontal",
        {"horizontal.end_b": "ellipsoidal", "horizontal.end_b_depth_m": 4.9},
        "horizontal.end_b_depth_m",
        "at most 4.8 m",
    ),
    (
        "horizontal",
        {"horizontal.end_a_dish_radius_m": 2.4},
        "horizontal.end_a_dish_radius_m",
        "only for a torispherical",
    ),
    ("horizontal", {"horizontal.tilt_mm_per_m": 5.0}, "horizontal.dip_from_a_m", "is tilted"),
    ("horizontal", {"horizontal.tilt_mm_per_m": 300.0}, "horizontal.tilt_mm_per_m", "200"),
    ("horizontal", {"horizontal.dip_from_a_m": 10.1}, "horizontal.dip_from_a_m", "0 to 10 m"),
    (
        "horizontal",
        {"horizontal.tilt_mm_per_m": 50.0, "horizontal.dip_from_a_m": 9.9},
        "horizontal.dip_from_a_m",
        "leave the top at 10.020 m",  # 9.9 + 0.05 * 2.4
    ),
    ("horizontal", {"horizontal.azimuth_deg": 10.0}, "horizontal.azimuth_deg", "with points"),
    ("horizontal", {"horizontal.thickness_mm": 8.0}, "horizontal.thickness_mm", "outside"),
    ("horizontal", {"survey.side": "outside"}, "horizontal.thickness_mm", "missing"),
    ("horizontal", {"survey.side": None}, "survey.side", "missing"),
    ("horizontal", {"datum.bottom_z_m": 1.0}, "datum.bottom_z_m", "this one is horizontal"),
    ("horizontal", {"datum.dip_plate_z_m": 1.1}, "datum.dip_plate_z_m", "above the bottom"),
    ("horizontal", {"datum.dip_plate_z_m": -0.1}, "datum.dip_plate_z_m", "below the inside bottom"),
    ("sphere", {"datum.dip_plate_z_m": -0.1}, "datum.dip_plate_z_m", "below the inside bottom"),
    ("horizontal", {"table.step_m": 2.5}, "table.step_m", "the height, 2.4 m"),
    ("horizontal", {"material.e_gpa": 200.0}, "material.e_gpa", "of kind vertical"),
    ("horizontal", {"corrections.head": True}, "corrections.head", "of kind vertical"),
    ("sphere", {"sphere.diameter_m": None}, "sphere.diameter_m", "or points.csv"),
    ("sphere", {"sphere.diameter_m": 20000.0}, "sphere.diameter_m", "another unit"),
    ("sphere", {"survey.side": "outside"}, "sphere.thickness_mm", "missing"),
    ("horizontal", {"table.liquid_density_kg_m3": 500.0}, "table.liquid_density_kg_m3", "vertical"),
    ("sphere", {"table.liquid_density_kg_m3": 500.0}, "sphere.thickness_mm", "the plates"),
    ("sphere", {"table.pressure_bar": 5.0}, "sphere.thickness_mm", "the plates"),
    ("horizontal", {"table.pressure_bar": 5.0}, "table.pressure_bar", "sphere"),
    ("mesh", {"mesh.file": "../tank.stl"}, "mesh.file", "plain name"),
    ("mesh", {"mesh.file": "/etc/tank.stl"}, "mesh.file", "plain name"),
    ("mesh", {"mesh.file": "C:\\tank.stl"}, "mesh.file", "plain name"),
    ("mesh", {"mesh.file": "tank.exe"}, "mesh.file", ".stl, .obj, .ply or .off"),
    ("mesh", {"mesh.file": None}, "mesh.file", "missing"),
    ("mesh", {"mesh.unit": "km"}, "mesh.unit", "'mm'"),
    ("mesh", {"survey.side": "inside"}, "survey.side", "this one is mesh"),
    ("mesh", {"adjustment.snooping": True}, "[adjustment]", "this one is mesh"),
]


@pytest.mark.slow(after=14)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("kind", "changes", "key", "words"), SETTINGS_OF_KINDS)
def test_settings_of_other_kinds(tmp_path, form, kind, changes, key, words):
    parts = job_parts(kind=kind, settings=changes, mesh=b"solid" if kind == "mesh" else None)
    (problem,) = problems_of(write(tmp_path, parts, form))
    if key.startswith("["):
        assert (problem.file, problem.column) == (settings_place(form, parts, "x")[0], key)
    else:
        assert places([problem]) == [settings_place(form, parts, key)]
    assert words in problem.expected


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"height_m": None}, "height_m", "expected together with width_m"),
        ({"end_a": "torispherical"}, "end_a", "round cylinders only"),
        ({"end_a": "spherical", "end_a_depth_m": 0.3}, "end_a", "round cylinders only"),
    ],
)
def test_elliptical_cylinders(tmp_path, changes, key, words):
    changes = {"diameter_m": None, "width_m": 2.4, "height_m": 1.8, **changes}
    if changes["end_a"] == "torispherical" if "end_a" in changes else False:
        changes |= {"end_a_dish_radius_m": 2.4, "end_a_knuckle_radius_m": 0.2}
    settings = {f"horizontal.{name}": value for name, value in changes.items()}
    parts = job_parts(kind="horizontal", settings=settings)
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert problem.column == f"horizontal.{key}"
    assert words in problem.expected


@pytest.mark.parametrize(
    ("dish", "knuckle", "key", "words"),
    [
        (None, 0.2, "dish_radius_m", "missing"),
        (2.4, None, "knuckle_radius_m", "missing"),
        (1.2, 0.2, "dish_radius_m", "more than half the diameter"),
        (2.4, 1.3, "knuckle_radius_m", "at most half the diameter"),
    ],
)
def test_torispherical_ends(tmp_path, dish, knuckle, key, words):
    settings = {
        "horizontal.end_b": "torispherical",
        "horizontal.end_b_dish_radius_m": dish,
        "horizontal.end_b_knuckle_radius_m": knuckle,
    }
    parts = job_parts(kind="horizontal", settings=settings)
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert problem.column == f"horizontal.end_b_{key}"
    assert words in problem.expected


@pytest.mark.slow(after=12)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("kind", "points", "changes", "key", "words"),
    [
        ("horizontal", LYING, {"horizontal.diameter_m": 2.4}, "horizontal.diameter_m", "one of"),
        ("horizontal", LYING, {"horizontal.tilt_mm_per_m": 1}, "horizontal.tilt_mm_per_m", "one"),
        ("horizontal", LYING, {"horizontal.azimuth_deg": None}, "horizontal.azimuth_deg", "A to B"),
        ("horizontal", LYING, {"horizontal.dip_from_a_m": None}, "horizontal.dip_from_a_m", "dip"),
        ("horizontal", LYING, {"survey.side": "outside"}, "horizontal.thickness_mm", "missing"),
        ("horizontal", LYING, {"datum.dip_plate_z_m": 50}, "datum.dip_plate_z_m", "close to them"),
        ("sphere", BALL, {"sphere.diameter_m": 20.0}, "sphere.diameter_m", "one of them"),
    ],
)
def test_settings_with_points(tmp_path, form, kind, points, changes, key, words):
    scan = SCAN if kind == "horizontal" else {"sphere.diameter_m": None}
    parts = job_parts(kind=kind, extra_points=points, settings=scan | changes)
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [settings_place(form, parts, key)]
    assert words in problem.expected


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("kind", "points", "column", "words"),
    [
        ("horizontal", LYING[:19], None, "19 points; expected 20 or more"),
        ("sphere", BALL[:11], None, "11 points; expected 12 or more"),
        ("horizontal", [(n, 1e3 * x, 1e3 * y, z) for n, x, y, z in LYING], "x_m", "millimetres?"),
        ("sphere", [(n, 1e3 * x, 1e3 * y, z) for n, x, y, z in BALL], "x_m", "millimetres?"),
        ("sphere", [*BALL, BALL[0]], "point", "already in row 2"),
    ],
)
def test_scans(tmp_path, form, kind, points, column, words):
    scan = SCAN if kind == "horizontal" else {"sphere.diameter_m": None}
    parts = job_parts(kind=kind, extra_points=points, settings=scan)
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert (problem.file, problem.column) == (table_file(form, "points"), column)
    assert words in problem.expected


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("kind", "table"),
    [("horizontal", "courses"), ("sphere", "bottom"), ("mesh", "points"), ("mesh", "courses")],
)
def test_tables_of_another_kind(tmp_path, form, kind, table):
    parts = job_parts(kind=kind, mesh=b"solid" if kind == "mesh" else None)
    parts.tables[table] = job_parts(bottom=RINGS).tables[table]
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [(table_file(form, table), None, None)]
    assert f"not for a tank of kind {kind}" in problem.expected
    parts.tables[table] = parts.tables[table][:1]  # headings alone say nothing
    other = tmp_path / "empty"
    other.mkdir()
    assert load(write(other, parts, form)).tank.kind == kind


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("content", "words"), [(None, "missing file"), (b"", "empty"), (b" \n", "empty")]
)
def test_the_file_of_a_mesh(tmp_path, form, content, words):
    (problem,) = problems_of(write(tmp_path, job_parts(kind="mesh", mesh=content), form))
    assert places([problem]) == [("tank.stl", None, None)]
    assert words in problem.expected


def test_a_mesh_that_is_no_file(tmp_path):
    folder = write_folder(tmp_path / "job", job_parts(kind="mesh"))
    (folder / "tank.stl").mkdir()
    (problem,) = problems_of(folder)
    assert "expected a file" in problem.expected


# kind, changes of the job, input and its unit, words
USELESS = [
    ("vertical", {}, ("youngs_modulus", "GPa"), "only with a liquid head"),
    ("vertical", {}, ("liquid_density", "kg/m3"), "only with a liquid head"),
    ("vertical", {}, ("survey_level", "mm"), "survey.liquid_level_m above 0"),
    ("vertical", {}, ("survey_density", "kg/m3"), "survey.liquid_level_m above 0"),
    ("vertical", {}, ("roof_mass", "kg"), "only with a floating roof"),
    ("vertical", {}, ("expansion", "1/K"), "only with a temperature correction"),
    ("vertical", {}, ("diameter", "mm"), "a tank of kind vertical"),
    ("vertical", {}, ("surface", "mm"), "a tank of kind vertical"),
    ("vertical", {"survey.side": "inside"}, ("plate_thickness", "mm"), "nothing is subtracted"),
    ("vertical", {"survey.side": "inside"}, ("paint", "mm"), "nothing is subtracted"),
    ("vertical", {"corrections.plate": False}, ("plate_thickness", "mm"), "nothing is subtract"),
    ("vertical", {"corrections.paint": False}, ("paint", "mm"), "nothing is subtracted"),
    ("vertical", {"bottom.form": "liquid"}, ("bottom", "mm"), "u_m3 in bottom.csv"),
    ("horizontal", {}, ("plate_thickness", "mm"), "nothing is subtracted"),
    ("horizontal", {}, ("end_depth", "mm"), "an end that is not flat"),
    ("horizontal", {}, ("dip_position", "mm"), "a tank that leans"),
    ("horizontal", {"corrections.tilt": False}, ("tilt", "mm/m"), "corrections.tilt"),
    ("horizontal", {}, ("barrel", "mm"), "a tank of kind horizontal"),
    ("sphere", {}, ("length", "mm"), "a tank of kind sphere"),
    ("mesh", {}, ("diameter", "mm"), "a tank of kind mesh"),
    ("mesh", {}, ("plate_thickness", "mm"), "a tank of kind mesh"),
]


@pytest.mark.slow(after=11)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("kind", "changes", "declared", "words"), USELESS)
def test_inputs_without_effect(tmp_path, form, kind, changes, declared, words):
    name, unit = declared
    small = {"1/K": 1e-6}.get(unit, 1.0)
    volumes = LEVELS if changes.get("bottom.form") == "liquid" else ()
    parts = job_parts(
        kind=kind,
        settings=changes,
        uncertainty=[(name, small, unit)],
        bottom_volumes=volumes,
        mesh=b"solid" if kind == "mesh" else None,
    )
    (problem,) = problems_of(write(tmp_path, parts, form))
    assert places([problem]) == [(table_file(form, "uncertainty"), 2, "input")]
    assert words in problem.expected


def test_inputs_of_points_are_theirs(tmp_path):
    for name, kind, points, changes in (
        ("diameter", "sphere", BALL, {"sphere.diameter_m": None}),
        ("diameter", "horizontal", LYING, SCAN),
        ("tilt", "horizontal", LYING, SCAN),
    ):
        unit = "mm/m" if name == "tilt" else "mm"
        parts = job_parts(
            kind=kind, extra_points=points, settings=changes, uncertainty=[(name, 1.0, unit)]
        )
        (problem,) = problems_of(write_folder(tmp_path / f"{name} {kind}", parts))
        assert "its uncertainty comes from the points" in problem.expected


# what does not stop a job: changes of a sound vertical job, place of the warning
WARNINGS = [
    ({"settings": {"table.liquid_density_kg_m3": 300.0}}, "table.liquid_density_kg_m3"),
    ({"settings": {"table.other_densities_kg_m3": [2500]}}, "table.other_densities_kg_m3"),
    (
        {"settings": {"bottom.form": "cone", "bottom.centre_z_m": -2.0}},
        "bottom.centre_z_m",
    ),
    ({"settings": {"bottom.form": "dish", "bottom.centre_z_m": 0.0}}, "bottom.centre_z_m"),
    ({"bottom": [(x / 10, y / 10, z) for x, y, z in RINGS]}, "x_m"),
    ({"bottom": [(x, y, 15 * z) for x, y, z in RINGS]}, "z_m"),
    ({"bottom_volumes": [(0.0, 0.5), (0.1, 2.0)]}, "volume_m3"),
    ({"deadwood": [("a", 0.5, 1.0, -0.1, 0.2)]}, "u_m3"),
    ({"deadwood": [("a", 0.5, 1.0, 0.0)]}, "volume_m3"),
    ({"deadwood": [("a", 0.5, 1.0, -7.0)]}, "volume_m3"),  # of 66.37 m3
]


@pytest.mark.parametrize(("changes", "column"), WARNINGS)
def test_doubtful_values(tmp_path, changes, column):
    job = load(write_folder(tmp_path / "job", job_parts(**changes)))
    assert [warning.column for warning in job.warnings] == [column]
    assert len(lines(job.warnings)) == 1


@pytest.mark.parametrize("changes", [{"tilt_mm_per_m": 60.0, "dip_from_a_m": 5.0}, {"roll_deg": 5}])
def test_doubtful_values_of_horizontal_cylinder(tmp_path, changes):
    settings = {f"horizontal.{name}": value for name, value in changes.items()}
    job = load(write_folder(tmp_path / "job", job_parts(kind="horizontal", settings=settings)))
    assert [warning.column for warning in job.warnings] == [f"horizontal.{next(iter(changes))}"]
    assert len(lines(job.warnings)) == 1


def test_all_problems_of_the_parts_come_together(tmp_path):
    parts = job_parts(
        deadwood=[("a", 2.0, 1.0, -0.1)],
        bottom=RINGS[:2],
        roof={"mass_kg": 9.0},
        settings={"table.fine_step_m": 0.001, "survey.liquid_level_m": 50.0},
        uncertainty=[("surface", 1.0, "mm")],
    )
    assert {problem.column for problem in problems_of(write_folder(tmp_path / "job", parts))} == {
        "table.fine_zones",
        "survey.liquid_level_m",
        "survey.liquid_density_kg_m3",
        "roof.mass_kg",
        None,
        "top_m",
        "input",
    }


def test_a_bottom_does_not_rise_above_the_shell(tmp_path):
    settings = {"bottom.form": "cone", "bottom.centre_z_m": 3.2}  # of 13 m: less than a quarter
    low = {"height": 2.0, "courses": 1}
    (problem,) = problems_of(write_job(tmp_path / "job", settings=settings, **low))
    assert problem.column == "bottom.centre_z_m"
    assert "at most 2 m above" in problem.expected
