"""meters.toml, liquid.csv and [liquid]: what is read, and what is told of bad ones.

Truth: the files as they were written; of each slip the one line that names it.
"""

import json

import numpy as np
import openpyxl
import pytest
from conftest import EXAMPLE
from filled_forms import fill_form, place_of
from job_builder import ROOF, assert_same_job, write_book, write_folder
from metered_tanks import METER, column, metered_parts, metered_rows

import tankcal
from tankcal.errors import InputError
from tankcal.job.checks.extent import volume_by_sizes
from tankcal.job.plausibility import TABLE
from tankcal.job.starter import write_input_workbook
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import load_words, say


def spoil(parts, row, name, value):
    """Put a value in a row (1: the start of the run) of a column of liquid.csv."""
    parts.tables["liquid"][row][column(parts, name)] = value


def drop(parts, name):
    """Take a column of liquid.csv away."""
    place = column(parts, name)
    for row in parts.tables["liquid"]:
        del row[place]


def add(parts, name, values):
    """A further column of liquid.csv."""
    for row, value in zip(parts.tables["liquid"], [name, *values], strict=True):
        row.append(value)


def scale(parts, name, factor):
    """Every number of a column times a factor."""
    for row in parts.tables["liquid"][1:]:
        place = column(parts, name)
        row[place] = None if row[place] is None else row[place] * factor


def problems(tmp_path, parts):
    """(place, code) of all problems of a job; [] without one."""
    try:
        tankcal.load(write_folder(tmp_path / "job", parts))
    except InputError as refused:
        return [((one.file, one.row, one.column), one.expected.code) for one in refused.problems]
    return []


def warnings(tmp_path, parts):
    """The same of its warnings."""
    job = tankcal.load(write_folder(tmp_path / "job", parts))
    return [((one.file, one.row, one.column), one.expected.code) for one in job.warnings]


# ---- what is read


def test_liquid_is_read_in_si(tmp_path):
    parts = metered_parts(liquid__table="liquid", liquid__u_temperature_c=0.05)
    add(parts, "s_volume_l", [None, 3.0, *[None] * 6])
    add(parts, "s_dip_mm", [None, None, 0.8, *[None] * 5])
    spoil(parts, 4, "use", "check")
    liquid = tankcal.load(write_folder(tmp_path / "job", parts)).liquid
    assert len(liquid) == 8
    np.testing.assert_array_equal(liquid.row, np.arange(2, 10))
    np.testing.assert_allclose(liquid.dip_m, [np.nan, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3, 1.5])
    np.testing.assert_allclose(liquid.s_dip_m, [0.0, 5e-4, 8e-4, *[5e-4] * 5])
    np.testing.assert_array_equal(liquid.s_volume_m3, [np.nan, 0.003, *[np.nan] * 6])
    np.testing.assert_array_equal(liquid.used, [True, True, True, False, *[True] * 4])
    np.testing.assert_array_equal(liquid.meter_c, [np.nan, *[18.5] * 7])
    assert liquid.time[:2] == ("2026-05-04T08:00:00", "2026-05-04T08:30:00")
    assert (liquid.run[0], set(liquid.meter)) == ("1", {"M"})
    assert (liquid.certified, liquid.run_sd, liquid.u_temperature_c) == ("liquid", 1e-4, 0.05)
    assert (liquid.u_dip_zero_m, liquid.flex_sd_m3_per_m) == (3e-4, 0.0)
    assert liquid.u_expansion_per_k == pytest.approx(0.05 * 2.1e-4)
    assert liquid.u_radius_m == pytest.approx(0.005 * 6.5)
    meter = liquid.meters["M"]
    assert (meter.factor, meter.u_factor, meter.repeatability) == (1.0005, 2e-4, 1e-4)
    assert (meter.fixed_m3, meter.factor_after, meter.flow_max_m3_h) == (0.002, 1.0006, 120.0)
    np.testing.assert_array_equal(liquid.runs["1"], np.arange(8))


def test_blanks_have_their_meaning(tmp_path):
    parts = metered_parts(liquid__run_ppm=None)
    for key in ("k", "fixed_l", "factor_after", "flow_min_m3_h", "flow_max_m3_h", "certificate"):
        parts.registers["meters"]["M"].pop(key)
    parts.tables["liquid"] += metered_rows([0.3, 0.7], [53.09], run="2")
    drop(parts, "meter")
    liquid = tankcal.load(write_folder(tmp_path / "job", parts)).liquid
    assert liquid.run_sd is None
    assert set(liquid.meter) == {"M"}
    assert [*liquid.runs] == ["1", "2"]
    meter = liquid.meters["M"]
    assert (meter.u_factor, meter.fixed_m3, meter.factor_after) == (4e-4, 0.0, None)


def test_a_start_may_leave_its_meter_blank(tmp_path):
    parts = metered_parts()
    parts.registers["meters"]["B"] = dict(METER)
    parts.tables["liquid"] += metered_rows([0.3, 0.7], [53.09], run="2")
    for row in parts.tables["liquid"][1:]:
        row[1] = None if row[2] == 0 else "M" if row[0] == "1" else "B"
    liquid = tankcal.load(write_folder(tmp_path / "job", parts)).liquid
    assert liquid.meter == (*["M"] * 8, *["B"] * 2)


@pytest.mark.parametrize(
    ("kind", "strapped"),
    [("vertical", False), ("vertical", True), ("horizontal", False), ("sphere", False)],
)
def test_every_kind_of_tank_may_be_told_by_liquid_alone(tmp_path, kind, strapped):
    """Without points; an upright one beside straps, too. Folder and workbook are one job."""
    parts = metered_parts(kind, strapped)
    one = tankcal.load(write_folder(tmp_path / "job", parts))
    other = tankcal.load(write_book(tmp_path / "job.xlsx", parts))
    assert one.points is None
    assert (one.strapping is not None) == strapped
    assert not one.warnings
    assert_same_job(one, other)


def test_a_mesh_may_be_filled(tmp_path):
    parts = metered_parts("sphere")
    drop_keys = ("sphere.diameter_m", "survey.side")
    parts.settings = {key: one for key, one in parts.settings.items() if key not in drop_keys}
    parts.settings |= {"tank.kind": "mesh", "mesh.file": "tank.stl", "mesh.unit": "m"}
    parts.beside["tank.stl"] = b"solid\nendsolid\n"
    assert len(tankcal.load(write_folder(tmp_path / "job", parts)).liquid) == 5


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("kind", ["vertical", "horizontal"])
def test_the_form_filled_in_is_the_job(tmp_path, kind, language):
    """Truth: the same job as text files."""
    spoken = {} if language == DEFAULT else {"table__language": language}
    parts = metered_parts(kind, **spoken)
    book = write_input_workbook(tmp_path / "form", kind, "liquid", language)
    fill_form(book, parts.settings, parts.tables)
    filled = openpyxl.load_workbook(book)
    for key, value in METER.items():
        place_of(filled["meters"], f"NAME.{key}").value = value
    for row in filled["meters"].iter_rows():
        for cell in row:
            if cell.value == "NAME":
                cell.value = "M"
    filled.save(book)
    assert_same_job(tankcal.load(book), tankcal.load(write_folder(tmp_path / "job", parts)))


# ---- what is told: (place, code) of each slip, as the only line

ROWS = "liquid.csv"


def two_runs(parts):
    parts.tables["liquid"] += metered_rows([0.3, 0.7], [53.09], run="2")


def start_alone(parts):
    two_runs(parts)
    parts.tables["liquid"].pop()


def without_meters(parts):
    parts.registers = {}


def second_meter(parts):
    parts.registers["meters"]["B"] = dict(METER)


def blank_meter_of_two(parts):
    second_meter(parts)
    for row in parts.tables["liquid"][2:]:
        row[1] = "B"
    spoil(parts, 4, "meter", None)


def run_again(parts):
    two_runs(parts)
    parts.tables["liquid"].append(metered_rows([0.7, 0.9], [26.55], run="1")[1])


def bottom_by_liquid(parts):
    parts.tables["bottom"] = [["level_m", "volume_m3"], [0.0, 0.0], [0.3, 39.8]]


def form_of_bottom(parts):
    parts.settings["bottom.form"] = "liquid"


def without_rows(parts):
    del parts.tables["liquid"]


def headings_alone(parts):
    del parts.tables["liquid"][1:]


def setting(key, value):
    def act(parts):
        parts.settings[key] = value
        if value is None:
            del parts.settings[key]

    return act


def cell(row, name, value):
    return lambda parts: spoil(parts, row, name, value)


def meter(key, value):
    return lambda parts: parts.registers["meters"]["M"].update({key: value})


def rest_without_time(parts):
    """A dip at rest whose time, and hence whose duration, is not known."""
    for name, value in {"use": "rest", "volume_m3": 0.0, "time": None}.items():
        spoil(parts, 3, name, value)


SLIPS = [
    (cell(1, "volume_m3", 39.8), (ROWS, 2, "volume_m3"), "run_without_start"),
    (cell(1, "use", "check"), (ROWS, 2, "use"), "start_not_used"),
    (cell(3, "dip_m", None), (ROWS, 4, "dip_m"), "dip_missing_in_run"),
    (lambda parts: drop(parts, "dip_m"), (ROWS, None, "dip_m"), "column_missing_or"),
    (cell(3, "volume_m3", 0.0), (ROWS, 4, "volume_m3"), "batch_of_nothing"),
    (cell(3, "use", "rest"), (ROWS, 4, "volume_m3"), "batch_at_rest"),
    (cell(1, "use", "rest"), (ROWS, 2, "use"), "start_not_used"),
    (rest_without_time, (ROWS, 4, "time"), "rest_without_time"),
    (cell(8, "dip_m", 1.3), (ROWS, 9, "dip_m"), "dip_does_not_rise"),
    (cell(8, "volume_m3", -26.5), (ROWS, 9, "dip_m"), "dip_does_not_fall"),
    (cell(8, "run", "2"), (ROWS, 9, "volume_m3"), "run_without_start"),
    (start_alone, (ROWS, 10, "run"), "run_of_one_row"),
    (cell(3, "meter", "N"), (ROWS, 4, "meter"), "no_such_meter"),
    (run_again, (ROWS, 12, "run"), "run_apart"),
    (without_meters, ("meters.toml", None, None), "no_meter"),
    (blank_meter_of_two, (ROWS, 5, "meter"), "meter_not_named"),
    (meter("flow_min_m3_h", 200.0), ("meters.toml", 8, "M.flow_min_m3_h"), "flows_upside_down"),
    (cell(4, "meter_temperature_c", None), (ROWS, 5, "meter_temperature_c"),
     "temperature_in_some_rows"),
    (cell(4, "tank_temperature_c", None), (ROWS, 5, "tank_temperature_c"),
     "temperature_in_some_rows"),
    (lambda parts: drop(parts, "tank_temperature_c"), (ROWS, None, "tank_temperature_c"),
     "one_temperature_of_liquid"),
    (lambda parts: scale(parts, "volume_m3", 1000.0), (ROWS, None, "volume_m3"),
     "batches_in_other_unit"),
    (cell(8, "dip_m", 15.0), (ROWS, 9, "dip_m"), "dip_above_tank"),
    (cell(2, "dip_m", -0.5), (ROWS, 3, "dip_m"), "dip_below_tank"),
    (setting("liquid.density_kg_m3", None), ("job.toml", None, "liquid.density_kg_m3"),
     "missing_beside"),
    (setting("liquid.density_kg_m3", 0.998), ("job.toml", 20, "liquid.density_kg_m3"),
     "density_in_g_cm3"),
    (setting("liquid.u_dip_zero_mm", None), ("job.toml", None, "liquid.u_dip_zero_mm"),
     "missing_beside"),
    (setting("liquid.s_dip_mm", None), ("job.toml", None, "liquid.s_dip_mm"), "dip_sd_missing"),
    (setting("liquid.run_ppm", None), ("job.toml", None, "liquid.run_ppm"), "run_effect_missing"),
    (setting("liquid.table", "geometry"), ("job.toml", 27, "liquid.table"),
     "no_geometry_beside_liquid"),
    (bottom_by_liquid, ("bottom.csv", None, None), "bottom_beside_liquid"),
    (without_rows, ("points.csv", None, None), "missing_points_file"),
    (headings_alone, (ROWS, None, None), "no_rows_of_liquid"),
    (meter("factor", None), ("meters.toml", 1, "M.factor"), "missing_key"),
    (meter("factor", 100.05), ("meters.toml", 2, "M.factor"), "found_expected"),
]  # fmt: skip


@pytest.mark.parametrize(("act", "place", "code"), SLIPS, ids=[f"{c}-{p[1]}" for _, p, c in SLIPS])
def test_a_slip_is_told_in_one_line(tmp_path, act, place, code):
    parts = metered_parts()
    act(parts)
    parts.registers = {
        name: {
            owner: {key: one for key, one in given.items() if one is not None}
            for owner, given in entries.items()
        }
        for name, entries in parts.registers.items()
    }
    found = problems(tmp_path, parts)
    if code == "missing_points_file":  # [liquid] is told beside it
        place_of_it, beside = found.pop()
        assert (place_of_it[2], beside) == ("liquid.density_kg_m3", "settings_without_liquid")
    if code == "no_rows_of_liquid" or code == "no_meter":
        found = [one for one in found if one[0][0] == place[0]]
    assert found == [(place, code)]


def test_a_form_of_the_bottom_is_refused_once(tmp_path):
    parts = metered_parts()
    form_of_bottom(parts)
    codes = [code for _, code in problems(tmp_path, parts)]
    assert sorted(codes) == ["bottom_beside_liquid", "bottom_rows_missing"]


def test_a_roof_does_not_lie_in_the_liquid(tmp_path):
    parts = metered_parts()
    parts.settings |= {f"roof.{key}": value for key, value in ROOF.items()}
    assert problems(tmp_path, parts) == [((ROWS, 7, "dip_m"), "dip_reaches_roof")]
    parts.settings |= {"roof.critical_bottom_m": 1.8, "roof.critical_top_m": 2.1}
    assert problems(tmp_path, parts) == []


BESIDE_STRAPS = [
    (setting("liquid.u_radius_mm", 20.0), ("job.toml", None, "liquid.u_radius_mm"),
     "radius_beside_survey"),
    (headings_alone, (ROWS, None, None), "meters_without_rows"),
    (without_rows, ("job.toml", None, "liquid.density_kg_m3"), "settings_without_liquid"),
]  # fmt: skip


@pytest.mark.parametrize(("act", "place", "code"), BESIDE_STRAPS)
def test_a_slip_beside_straps(tmp_path, act, place, code):
    parts = metered_parts(strapped=True)
    act(parts)
    ((file, _, name), found), *others = problems(tmp_path, parts)
    assert (file, name, found, others) == (place[0], place[2], code, [])


def test_meters_alone_have_no_effect(tmp_path):
    parts = metered_parts(strapped=True)
    without_rows(parts)
    kept = [key for key in parts.settings if not key.startswith("liquid.")]
    parts.settings = {key: parts.settings[key] for key in kept}
    assert warnings(tmp_path, parts) == [(("meters.toml", None, None), "no_liquid")]


def test_too_many_rows(tmp_path):
    parts = metered_parts()
    start, batch = parts.tables["liquid"][1:3]
    parts.tables["liquid"] = [parts.tables["liquid"][0], start, *[batch] * 3000]
    assert problems(tmp_path, parts) == [((ROWS, None, None), "too_many_batches")]


def test_a_flow_in_litres_per_minute_is_guessed(tmp_path):
    parts = metered_parts()
    scale(parts, "flow_m3_h", 1000 / 60)
    job = tankcal.load(write_folder(tmp_path / "job", parts))
    (one,) = job.warnings
    assert one.expected.values["hint"].code == "flow_in_litres"
    assert one.expected.values["count"] == 7


def test_a_lying_tank_with_a_meter_and_no_rows(tmp_path):
    parts = metered_parts("horizontal")
    headings_alone(parts)
    assert problems(tmp_path, parts) == [((ROWS, None, None), "meters_without_rows")]


@pytest.mark.parametrize(
    ("factor", "hint"),
    [
        (1000.0, "in_litres"),
        (264.17, "in_gallons"),
        (6.2898, "in_barrels"),
        (35.31, "in_cubic_feet"),
        (0.01, None),
    ],
)
def test_the_unit_of_batches_is_guessed(tmp_path, factor, hint):
    parts = metered_parts("horizontal")
    scale(parts, "volume_m3", factor)
    with pytest.raises(InputError) as refused:
        tankcal.load(write_folder(tmp_path / "job", parts))
    (one,) = refused.value.problems
    assert getattr(one.expected.values["hint"], "code", None) == hint


@pytest.mark.parametrize(
    ("factor", "hint"),
    [(3.2808, "dip_in_feet"), (10.0, "dip_in_centimetres")],
)
def test_the_unit_of_dips_is_guessed(tmp_path, factor, hint):
    parts = metered_parts("sphere")
    scale(parts, "dip_m", factor)
    parts.tables["liquid"] = parts.tables["liquid"][:6]
    codes = []
    with pytest.raises(InputError) as refused:
        tankcal.load(write_folder(tmp_path / "job", parts))
    codes = [
        one.expected.values["hint"].code
        for one in refused.value.problems
        if one.expected.code == "dip_above_tank"
    ]
    assert codes[-1] == hint


def other_meter_unread(parts):
    second_meter(parts)


def in_fahrenheit(parts):
    for name in ("meter_temperature_c", "tank_temperature_c", "shell_temperature_c"):
        for row in parts.tables["liquid"][1:]:
            place = column(parts, name)
            row[place] = None if row[place] is None else 32 + 1.8 * row[place]


def no_temperatures(parts):
    for name in ("meter_temperature_c", "tank_temperature_c", "shell_temperature_c"):
        drop(parts, name)


DOUBTS = [
    (other_meter_unread, ("meters.toml", 13, "B"), "meter_not_read"),
    (no_temperatures, (ROWS, None, None), "volumes_not_reduced"),
    (lambda parts: drop(parts, "shell_temperature_c"), (ROWS, None, None), "volumes_not_reduced"),
    (cell(6, "time", "2026-05-04T07:00"), (ROWS, 7, "time"), "dip_before_its_batch"),
    (cell(6, "flow_m3_h", 1000.0), (ROWS, 7, "flow_m3_h"), "flow_out_of_range"),
    (meter("factor_after", 1.0008), ("meters.toml", 7, "M.factor_after"), "meter_drifted"),
    (meter("factor_after", 1.0012), ("meters.toml", 7, "M.factor_after"), "meter_changed"),
    (meter("fixed_l", 30.0), (ROWS, 4, "volume_m3"), "batch_too_small"),
    (cell(6, "meter_temperature_c", 32.0), (ROWS, 7, "meter_temperature_c"),
     "temperatures_far_apart"),
    (cell(6, "shell_temperature_c", 45.0), (ROWS, 7, "shell_temperature_c"),
     "temperatures_far_apart"),
    (cell(8, "tank_temperature_c", 21.0), (ROWS, 9, "tank_temperature_c"),
     "tank_temperature_jumps"),
    (setting("liquid.expansion_per_k", 1.1e-5), ("job.toml", 22, "liquid.expansion_per_k"),
     "liquid_expands_strangely"),
    (cell(6, "volume_m3", 53.0), (ROWS, 7, "volume_m3"), "batch_unlike_sizes"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("act", "place", "code"), DOUBTS, ids=[f"{c}-{p[2]}" for _, p, c in DOUBTS]
)
def test_a_doubt_is_a_warning(tmp_path, act, place, code):
    parts = metered_parts()
    act(parts)
    assert warnings(tmp_path, parts) == [(place, code)]


def test_fahrenheit_is_asked_for_once_a_column(tmp_path):
    parts = metered_parts()
    in_fahrenheit(parts)
    found = warnings(tmp_path, parts)
    assert {code for _, code in found} == {"metered_temperature_strange"}
    assert [place[1:] for place, _ in found] == [
        (3, "meter_temperature_c"), (3, "tank_temperature_c"), (3, "shell_temperature_c"),
    ]  # fmt: skip
    parts.settings["checks.service"] = "heated"
    assert warnings(tmp_path, parts) == []


def test_drifts_at_their_limits_are_not_told(tmp_path):
    """Closed form: 0.02 % of the factor before, and one part in 1e6 more."""
    parts = metered_parts()
    parts.registers["meters"]["M"] |= {"factor": 1.0, "factor_after": 1.0002}
    assert warnings(tmp_path, parts) == []
    parts.registers["meters"]["M"]["factor_after"] = 1.000201
    assert [code for _, code in warnings(tmp_path, parts)] == ["meter_drifted"]


def test_a_dip_that_is_only_compared_breaks_no_chain(tmp_path):
    """Its batch counts for the next dip: neither sign nor unit of that is told."""
    parts = metered_parts()
    spoil(parts, 5, "use", "check")
    spoil(parts, 5, "dip_m", 0.2)
    assert problems(tmp_path, parts) == []
    assert warnings(tmp_path, parts) == []


def test_every_slip_of_a_run_comes_in_one_go(tmp_path):
    parts = metered_parts(liquid__run_ppm=None, liquid__u_density_kg_m3=None)
    spoil(parts, 1, "volume_m3", 5.0)
    spoil(parts, 4, "dip_m", None)
    spoil(parts, 6, "meter", "Z")
    codes = {code for _, code in problems(tmp_path, parts)}
    assert codes == {"run_effect_missing", "missing_beside", "run_without_start",
                     "dip_missing_in_run", "no_such_meter"}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_slips_are_told_in_every_language(tmp_path, language):
    """No English is left, and each value stands in the sentence."""
    words = load_words(language)
    for act, _, code in (*SLIPS, *DOUBTS):
        parts = metered_parts()
        act(parts)
        try:
            told = tankcal.load(write_folder(tmp_path / "job", parts)).warnings
        except InputError as refused:
            told = refused.problems
        (tmp_path / "job" / "bottom.csv").unlink(missing_ok=True)
        for path in (tmp_path / "job").iterdir():
            path.unlink()
        for one in told:
            said = say(words, one.expected)
            assert said != str(one.expected), code
            assert "{" not in said


# ---- sizes, and the examples


def test_volumes_by_sizes():
    """Closed form: half of a lying cylinder, a sphere at its middle, an upright tank."""

    class Raw:
        def __init__(self, kind):
            self.settings = {"tank": {"kind": type("V", (), {"raw": kind, "row": None})}}

    none = dict.fromkeys(
        ("height_m", "width_m", "end_a_depth_m", "end_b_depth_m", "tilt_mm_per_m"), None
    )
    values = {
        "tank": {"nominal_diameter_m": 13.0},
        "datum": {"bottom_z_m": 0.1, "dip_plate_z_m": 0.2},
        "sphere": {"diameter_m": 10.0},
        "horizontal": none | {"diameter_m": 2.4, "length_m": 9.0},
    }
    assert volume_by_sizes(values, Raw("vertical"))(0.9) == pytest.approx(np.pi * 6.5**2)
    values["datum"]["dip_plate_z_m"] = 0.0
    sphere = volume_by_sizes(values, Raw("sphere"))
    assert sphere(5.0) == pytest.approx(2 / 3 * np.pi * 125)
    lying = volume_by_sizes(values, Raw("horizontal"))
    assert lying(1.2) == pytest.approx(np.pi * 1.2**2 * 9 / 2)
    assert lying(2.4) == pytest.approx(np.pi * 1.2**2 * 9)
    assert volume_by_sizes(values, Raw("mesh")) is None


@pytest.mark.parametrize("name", ["liquid", "liquid-lying"])
def test_the_examples_load(name):
    job = tankcal.load(EXAMPLE.parent / name)
    assert not job.warnings
    truth = json.loads((EXAMPLE.parent / name / "truth.json").read_text(encoding="utf-8"))
    assert set(job.liquid.runs) == set(truth["run_errors"])
    (meter,) = job.liquid.meters.values()
    assert abs(truth["meter_factor"] / meter.factor - 1) < 3 * meter.u_factor
    assert (job.strapping is None) == (name == "liquid-lying")


def test_rules_of_liquid_that_are_not_verified_say_so():
    unverified = {rule.codes[0] for rule in TABLE if not rule.verified}
    of_lines = {"too_small_for_lines"}
    assert unverified - of_lines == {
        "tank_temperature_jumps",
        "meter_drifted",
        "flow_out_of_range",
    }
