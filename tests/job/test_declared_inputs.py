"""What a job declares about uncertainty, what is assumed beside it, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from job_builder import assert_same_job, job_parts, write_folder, write_job
from spoilt import FORMS, places, problems_of, settings_place, table_file, write
from survey_builder import survey_parts

import tankcal
from tankcal.errors import InputError
from tankcal.job import StatedVolume, load
from tankcal.job.contract import INPUTS

INPUT_COLUMNS = ["input", "u", "unit", "u_is", "k", "distribution", "dof"]
SCAN = [(f"P{i}", np.sin(i), i / 4, np.cos(i)) for i in range(40)]
OF_SCAN = {
    "horizontal.diameter_m": None,
    "horizontal.azimuth_deg": 90.0,
    "horizontal.dip_from_a_m": 1.0,
}
LOADED = {
    "survey.shell_temperature_c": 31.5,
    "survey.liquid_level_m": 2.0,
    "survey.liquid_density_kg_m3": 998.0,
    "table.liquid_density_kg_m3": 850.0,
}
FULL = {
    "settings": LOADED,
    "paint_mm": 0.3,
    "roof": {"mass_kg": 9000.0},
    "deadwood": [("coil", 0.5, 1.0, -0.25, 0.01), ("manhole", 0.6, 1.2, 0.05)],
}


def with_rows(rows, **changes):
    """Parts of a job whose uncertainty.csv has rows of INPUT_COLUMNS, blank where they end."""
    parts = job_parts(**changes)
    padded = [[*row, *[None] * (len(INPUT_COLUMNS) - len(row))] for row in rows]
    parts.tables["uncertainty"] = [INPUT_COLUMNS, *padded]
    return parts


def with_tables(**tables):
    """Parts of a job with three declared inputs, and tables as lists of rows."""
    parts = with_rows([("scale", 5.0, "ppm"), ("datum", 1.0, "mm"), ("offset", 1.0, "mm")])
    parts.tables |= tables
    return parts


def assumed(job):
    return [one.name for one in job.inputs if one.is_default]


# --- what is assumed


def test_default_inputs_of_a_complete_tank(tmp_path):
    job = load(write_job(tmp_path / "job", **FULL))
    # closed form: half-width over the square root of three, in SI
    half_widths = {
        "plate_thickness": 0.2e-3,
        "paint": 0.05e-3,
        "shell_temperature": 2.0,
        "expansion": 1e-6,
        "youngs_modulus": 6e9,
        "survey_level": 5e-3,
        "survey_density": 5.0,
        "roof_mass": 90.0,
        "deadwood": 0.05,
    }
    assert assumed(job) == list(half_widths)
    for one in job.inputs:
        assert one.u == pytest.approx(half_widths[one.name] / math.sqrt(3), rel=1e-14)
        assert one.u_as_read == pytest.approx(one.u * INPUTS[one.name].per_si, rel=1e-14)
        assert (one.unit, one.type) == (INPUTS[one.name].unit, "B")
        assert (one.distribution, one.dof, one.note) == ("rectangular", math.inf, "")


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({}, ["plate_thickness"]),
        ({"thickness_mm": 0.0}, []),
        ({"paint_mm": 0.0}, ["plate_thickness"]),
        ({"paint_mm": [0.3, None, None, 0.0, None]}, ["plate_thickness", "paint"]),
        ({"paint_mm": 0.3, "settings": {"survey.side": "inside"}}, []),
        ({"paint_mm": 0.3, "settings": {"corrections.plate": False}}, ["paint"]),
        ({"paint_mm": 0.3, "settings": {"corrections.paint": False}}, ["plate_thickness"]),
        (
            {"settings": {"survey.side": "inside", "table.liquid_density_kg_m3": 850.0}},
            ["plate_thickness", "youngs_modulus"],
        ),
        (
            {"settings": LOADED | {"corrections.head": False}},
            ["plate_thickness", "shell_temperature", "expansion"],
        ),
        ({"settings": LOADED | {"corrections.temperature": False, "table.liquid_density_kg_m3": 0}},
         ["plate_thickness", "youngs_modulus", "survey_level", "survey_density"]),
        ({"roof": {}, "settings": {"corrections.roof": False}}, ["plate_thickness"]),
        ({"deadwood": [("coil", 0.5, 1.0, -0.25, 0.01)]}, ["plate_thickness"]),
        ({"deadwood": [("coil", 0.5, 1.0, 0.0)]}, ["plate_thickness"]),
        (
            {"deadwood": FULL["deadwood"], "settings": {"corrections.deadwood": False}},
            ["plate_thickness"],
        ),
        ({"kind": "horizontal"}, []),
        (
            {
                "kind": "horizontal",
                "settings": {"survey.side": "outside", "horizontal.thickness_mm": 6.0},
                "deadwood": [("pipe", 0.5, 1.0, -0.02)],
            },
            ["plate_thickness", "deadwood"],
        ),
        (
            {"kind": "sphere", "settings": {"survey.shell_temperature_c": 25.0}},
            ["shell_temperature", "expansion"],
        ),
        (
            {
                "kind": "mesh",
                "mesh": b"solid",
                "settings": {"survey.shell_temperature_c": 25.0},
                "deadwood": [("pipe", 0.5, 1.0, -0.02)],
            },
            ["shell_temperature", "expansion", "deadwood"],
        ),
    ],
)  # fmt: skip
def test_only_relevant_defaults_are_assumed(tmp_path, changes, names):
    assert assumed(load(write_job(tmp_path / "job", **changes))) == names


def test_declared_inputs_replace_defaults_and_come_first(tmp_path):
    rows = [("survey_density", 2.0, "kg/m3"), ("expansion", 0.0, "1/K"), ("scale", 5.0, "ppm")]
    job = load(write_folder(tmp_path / "job", with_rows(rows, **FULL)))
    assert [one.name for one in job.inputs[:3]] == ["survey_density", "expansion", "scale"]
    assert assumed(job) == [
        *("plate_thickness", "paint", "shell_temperature", "youngs_modulus"),
        *("survey_level", "roof_mass", "deadwood"),
    ]
    assert job.inputs[1].u == 0  # declared as exact, not assumed


def test_an_input_that_would_be_refused_is_never_assumed(tmp_path):
    """Property: whatever is assumed of a job may stand in its uncertainty.csv."""
    for number, changes in enumerate([{}, FULL, {"kind": "sphere"}, {"settings": LOADED}]):
        job = load(write_job(tmp_path / f"{number}", **changes))
        rows = [(one.name, one.u_as_read, one.unit) for one in job.inputs]
        again = load(write_folder(tmp_path / f"{number} again", with_rows(rows, **changes)))
        assert [one.name for one in again.inputs] == assumed(job)
        assert assumed(again) == []


def test_an_adjustment_alone_assumes_nothing(tmp_path):
    job = load(write_folder(tmp_path / "job", survey_parts()), only="adjustment")
    assert job.inputs == ()


# --- what u is


@pytest.mark.slow(after=8)
@pytest.mark.parametrize(
    ("row", "u"),
    [
        # closed form: JCGM 100 4.3.3, 4.3.7, 4.3.9; arc sine a/sqrt(2); t: what is declared
        ((3.0,), 3.0),
        ((3.0, "standard", None, "rectangular"), 3.0),
        ((3.0, "half_width", None, "rectangular"), 3 / math.sqrt(3)),
        ((3.0, "half_width", None, "triangular"), 3 / math.sqrt(6)),
        ((3.0, "half_width", None, "u-shaped"), 3 / math.sqrt(2)),
        ((3.0, "expanded", 2.0), 1.5),
        ((3.0, "expanded", 2.0, "normal", 50.0), 1.5),
        ((3.0, "expanded", 1.0), 3.0),
        ((3.0, "scale", None, "t", 1.0), 3.0),
        ((3.0, "sd", None, "t", 4.0), 3.0),
        ((0.0, "sd", None, "t", 4.0), 0.0),
    ],
)
@pytest.mark.parametrize("form", FORMS)
def test_what_u_is(tmp_path, form, row, u):
    declared = ("datum", row[0], "mm", *row[1:])
    one = load(write(tmp_path, with_rows([declared]), form)).inputs[0]
    assert one.u_as_read == pytest.approx(u, rel=1e-14)
    assert one.u == pytest.approx(u / 1000, rel=1e-14)
    assert (one.unit, one.is_default) == ("mm", False)
    told = (*row[3:], *(None, None))[:2]
    assert (one.distribution, one.dof) == (told[0] or "normal", told[1] or math.inf)


CONTRADICTIONS = [
    (("half_width",), [("distribution", "normal has no half-width")]),
    (("half_width", None, "normal"), [("distribution", "expected rectangular, triangular")]),
    (("half_width", 2.0, "triangular"), [("k", "expected a blank, or u_is = expanded")]),
    (("expanded", 2.0, "u-shaped"), [("distribution", "found u-shaped; expected normal")]),
    (
        ("expanded", None, "rectangular"),
        [("distribution", "expected normal"), ("k", "expected the coverage factor")],
    ),
    ((None, 2.0), [("k", "found 2; expected a blank")]),
    ((None, None, "t"), [("u_is", "expected scale or sd"), ("dof", "degrees of freedom")]),
    (("scale", None, "t"), [("dof", "blank; expected the degrees of freedom")]),
    (("sd", None, "t", 2.0), [("dof", "found 2; expected above 2")]),
    (("standard", None, "t", 9.0), [("u_is", "found standard; expected scale or sd")]),
    (("expanded", 2.0, "t", 9.0), [("u_is", "found expanded; expected scale or sd")]),
    (("scale",), [("u_is", "the distribution is normal")]),
    (("sd", None, "rectangular", 9.0), [("u_is", "the distribution is rectangular")]),
]


@pytest.mark.slow(after=7)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("cells", "told"), CONTRADICTIONS)
def test_cells_that_contradict_one_another(tmp_path, form, cells, told):
    parts = with_rows([("scale", 5.0, "ppm"), ("datum", 3.0, "mm", *cells)])
    problems = problems_of(write(tmp_path, parts, form))
    file = table_file(form, "uncertainty")
    assert sorted(places(problems)) == sorted((file, 3, column) for column, _ in told)
    for column, words in told:
        (problem,) = [one for one in problems if one.column == column]
        assert words in problem.expected


def test_the_largest_u_is_a_standard_uncertainty(tmp_path):
    # 150 mm expanded with k = 2 is 75 mm, a half-width of 150 mm is 86.6 mm: 100 mm are allowed
    rows = [("datum", 150.0, "mm", "expanded", 2.0)]
    assert load(write_folder(tmp_path / "a", with_rows(rows))).inputs[0].u_as_read == 75
    rows = [("datum", 150.0, "mm", "half_width", None, "rectangular"), ("offset", 150.0, "mm")]
    (problem,) = problems_of(write_folder(tmp_path / "b", with_rows(rows)))
    assert places([problem]) == [("uncertainty.csv", 3, "u")]


def test_a_bad_cell_makes_no_second_problem_in_its_row(tmp_path):
    rows = [("datum", 3.0, "mm", "sd", None, "t", "many"), ("scale", "x", "ppm", None, 2.0)]
    problems = problems_of(write_folder(tmp_path / "job", with_rows(rows)))
    assert places(problems) == [("uncertainty.csv", 2, "dof"), ("uncertainty.csv", 3, "u")]


# --- inputs that are new to a kind

USELESS = [
    ({}, ("shell_temperature", 1.0, "K"), "a temperature correction"),
    ({}, ("bottom", 1.0, "mm"), "a bottom that is not flat"),
    (
        {"settings": {"bottom.form": "leaning", "corrections.bottom": False}},
        ("bottom", 1.0, "mm"),
        "corrections.bottom is false",
    ),
    (
        {"settings": {"table.other_densities_kg_m3": [700.0]}},  # which have no U
        ("youngs_modulus", 1.0, "GPa"),
        "table.liquid_density_kg_m3",
    ),
    ({}, ("paint", 0.1, "mm"), "paint_mm above 0"),
    ({"thickness_mm": 0.0}, ("plate_thickness", 0.1, "mm"), "thickness_mm above 0"),
    ({}, ("deadwood", 5.0, "%"), "no u_m3 of its own"),
    (
        {"deadwood": [("coil", 0.5, 1.0, -0.25, 0.01)]},
        ("deadwood", 5.0, "%"),
        "no u_m3 of its own",
    ),
    (
        {"deadwood": [("coil", 0.5, 1.0, -0.25)], "settings": {"corrections.deadwood": False}},
        ("deadwood", 5.0, "%"),
        "corrections.deadwood is false",
    ),
    ({"settings": {"corrections.tilt": False}}, ("tilt", 1.0, "mm/m"), "corrections.tilt"),
    ({"courses": 1, "height": 1.9}, ("course_heights", 1.0, "mm"), "two courses or more"),
    ({"kind": "sphere"}, ("offset", 1.0, "mm"), "expected only with points"),
    ({"kind": "horizontal"}, ("offset", 1.0, "mm"), "expected only with points"),
    ({"kind": "horizontal"}, ("course_heights", 1.0, "mm"), "a tank of kind horizontal"),
    ({"kind": "sphere"}, ("tilt", 1.0, "mm/m"), "a tank of kind sphere"),
    ({"kind": "mesh", "mesh": b"solid"}, ("offset", 1.0, "mm"), "a tank of kind mesh"),
]


@pytest.mark.slow(after=8)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("changes", "row", "words"), USELESS)
def test_inputs_without_effect(tmp_path, form, changes, row, words):
    (problem,) = problems_of(write(tmp_path, with_rows([row], **changes), form))
    assert places([problem]) == [(table_file(form, "uncertainty"), 2, "input")]
    assert words in problem.expected


def test_inputs_with_an_effect(tmp_path):
    rows = [
        *[("offset", 1.0, "mm"), ("course_heights", 2.0, "mm"), ("tilt", 0.5, "mm/m")],
        *[("deadwood", 10.0, "%"), ("interpolation", 1e-3, "m3"), ("rounding", 5e-4, "m3")],
    ]
    job = load(write_folder(tmp_path / "job", with_rows(rows, deadwood=FULL["deadwood"])))
    assert [one.u for one in job.inputs[:6]] == [1e-3, 2e-3, 5e-4, 0.1, 1e-3, 5e-4]
    scan = {"kind": "horizontal", "extra_points": SCAN, "settings": OF_SCAN}
    job = load(write_folder(tmp_path / "scan", with_rows([rows[0]], **scan)))
    assert job.inputs[0].name == "offset"


# --- correlations


def correlated(*rows):
    return with_tables(correlations=[["input", "with", "r"], *map(list, rows)])


@pytest.mark.parametrize("form", FORMS)
def test_correlations_are_read(tmp_path, form):
    rows = [("scale", "offset", 1.0), ("datum", "offset", -0.5), ("datum", "scale", -0.5)]
    job = load(write(tmp_path, correlated(*rows), form))
    assert job.correlations == tuple(rows)


@pytest.mark.parametrize("form", FORMS)
def test_impossible_correlations_are_one_problem(tmp_path, form):
    # closed form: r = -0.9 of all pairs of three has the eigenvalue 1 - 2 * 0.9 = -0.8
    pairs = [("scale", "offset", -0.9), ("datum", "offset", -0.9), ("datum", "scale", -0.9)]
    (problem,) = problems_of(write(tmp_path, correlated(*pairs), form))
    assert places([problem]) == [(table_file(form, "correlations"), None, "r")]
    assert "contradict one another: eigenvalue -0.8;" in problem.expected


@pytest.mark.parametrize(
    ("row", "column", "words"),
    [
        (("datum", "datum", 0.5), "with", "found datum again; expected another input"),
        (("plate_thickness", "datum", 0.5), "input", "an input of uncertainty.csv"),  # assumed
        (("datum", "wind", 0.5), "with", "expected 'scale'"),
        (("datum", "course_heights", 0.5), "with", "expected 'scale'"),
        (("interpolation", "datum", 0.5), "input", "expected 'scale'"),
        (("offset", "scale", 0.5), "with", "already in row 2"),
        (("datum", "offset", 1.2), "r", "a number from -1 to 1"),
        (("datum", "offset", "1,500"), "r", "with a decimal point"),
        (("datum", "offset", "nan"), "r", "a number from -1 to 1"),
        (("datum", "offset", None), "r", "blank"),
    ],
)
def test_a_correlation_that_is_refused(tmp_path, row, column, words):
    parts = correlated(("scale", "offset", 0.5), row)
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert places([problem]) == [("correlations.csv", 3, column)]
    assert words in problem.expected


def test_correlations_without_declared_inputs(tmp_path):
    parts = correlated(("scale", "offset", 0.5))
    del parts.tables["uncertainty"]
    problems = problems_of(write_folder(tmp_path / "a", parts))
    file = "correlations.csv"
    assert places(problems) == [(file, 2, "input"), (file, 2, "with")]


def test_an_input_that_cannot_be_read_may_be_the_correlated_one(tmp_path):
    parts = correlated(("scale", "barrel", 0.5))
    parts.tables["uncertainty"][1][0] = "barel"
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert places([problem]) == [("uncertainty.csv", 2, "input")]


# --- stated volumes


def stated(*rows):
    return with_tables(stated=[["high_m", "low_m", "volume_m3", "note"], *map(list, rows)])


@pytest.mark.parametrize("form", FORMS)
def test_stated_volumes_are_read(tmp_path, form):
    rows = [(9.5, None, 1260.9, "table of 1998"), (4.0, 0.0, None, None), (4.0, 1.5, 331.8, None)]
    job = load(write(tmp_path, stated(*rows), form))
    assert job.stated == (
        StatedVolume(9.5, None, 1260.9, "table of 1998", 2),
        StatedVolume(4.0, 0.0, None, "", 3),
        StatedVolume(4.0, 1.5, 331.8, "", 4),
    )


@pytest.mark.parametrize(
    ("row", "column", "words"),
    [
        ((9.6,), "high_m", "expected at most 9.5, the top of the tank"),
        ((9500.0,), "high_m", "another unit?"),
        ((4.0, 4.0), "low_m", "expected a dip below high_m = 4"),
        ((4.0, 5.0), "low_m", "expected a dip below high_m = 4"),
        ((9.0, 2.0), "high_m", "already in row 2"),
        (("4,000",), "high_m", "with a decimal point"),
        (("NaN",), "high_m", "expected a number"),
        ((4.0, -1.0), "low_m", "from 0 to 100"),
        ((4.0, None, 530900.0), "volume_m3", "in litres?"),
        ((4.0, 3.9, 13270.0), "volume_m3", "the tank between low_m and high_m holds about 13.27"),
    ],
)
def test_a_stated_volume_that_is_refused(tmp_path, row, column, words):
    padded = [*row, *[None] * (4 - len(row))]
    parts = stated((9.0, 2.0, None, None), padded)
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert places([problem]) == [("stated.csv", 3, column)]
    assert words in problem.expected


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_stated_dip_outside_table_is_reported(tmp_path, form):
    job = load(write(tmp_path, stated((9.0, 2.0, None, None)), form))
    far = replace(job, stated=(replace(job.stated[0], high_m=11.0),))
    with pytest.raises(InputError) as caught:
        tankcal.run(far)
    assert places(caught.value.problems) == [(table_file(form, "stated"), 2, "high_m")]


def test_dips_count_from_the_dip_plate(tmp_path):
    parts = stated((9.45, None, None, None))
    parts.settings["datum.dip_plate_z_m"] = 0.05
    assert load(write_folder(tmp_path / "a", parts)).stated[0].high_m == 9.45
    parts.tables["stated"][1][0] = 9.46
    assert places(problems_of(write_folder(tmp_path / "b", parts))) == [("stated.csv", 2, "high_m")]


# --- the keys of [table], and everything at once


def test_least_deliveries_and_monte_carlo(tmp_path):
    settings = {"table.minimum_delivery_m": [0.5, 9.5], "table.monte_carlo": False}
    lists = load(write_job(tmp_path / "a", settings=settings))
    assert (lists.table.minimum_delivery_m, lists.table.monte_carlo) == ((0.5, 9.5), False)
    settings = {"table.minimum_delivery_m": "0.5; 9.5", "table.monte_carlo": False}
    assert_same_job(lists, load(write_job(tmp_path / "b", settings=settings)))
    one = load(write_job(tmp_path / "c", settings={"table.minimum_delivery_m": 2}))
    assert one.table.minimum_delivery_m == (2.0,)
    blank = load(write_job(tmp_path / "d", settings={"table.monte_carlo": ""}))
    assert (blank.table.minimum_delivery_m, blank.table.monte_carlo) == (None, True)


@pytest.mark.parametrize("kind", ["horizontal", "sphere", "mesh"])
def test_other_kinds_take_the_same_tables(tmp_path, kind):
    parts = with_rows(
        [("scale", 5.0, "ppm"), ("datum", 1.0, "mm")],
        kind=kind,
        mesh=b"solid" if kind == "mesh" else None,
        settings={"table.rule": "oiml_r71"},
    )
    parts.tables["correlations"] = [["input", "with", "r"], ["scale", "datum", 0.5]]
    parts.tables["stated"] = [["high_m"], [2.0]]
    jobs = [load(write(tmp_path, parts, form)) for form in FORMS]
    assert_same_job(*jobs)
    assert (len(jobs[0].correlations), len(jobs[0].stated)) == (1, 1)
    assert jobs[0].rule.name == "OIML R 71"


@pytest.mark.parametrize("form", FORMS)
def test_all_problems_come_in_one_run(tmp_path, form):
    parts = with_rows(
        [
            ("datum", 1.0, "mm", "half_width"),
            ("scale", "NaN", "ppm"),
            ("offset", 1.0, "mm", "sd", None, "t", 2.0),
        ],
        settings={"table.rule": "atlantis", "table.minimum_delivery_m": 12.0},
    )
    parts.tables["correlations"] = [["input", "with", "r"], ["datum", "paint", 1.2]]
    parts.tables["stated"] = [["high_m", "low_m"], [2.0, 3.0]]
    cells = [
        *[("uncertainty", 2, "distribution"), ("uncertainty", 3, "u"), ("uncertainty", 4, "dof")],
        *[("correlations", 2, "with"), ("correlations", 2, "r"), ("stated", 2, "low_m")],
    ]
    keys = ["table.rule", "table.minimum_delivery_m"]
    assert set(places(problems_of(write(tmp_path, parts, form)))) == {
        *((table_file(form, table), row, column) for table, row, column in cells),
        *(settings_place(form, parts, key) for key in keys),
    }
