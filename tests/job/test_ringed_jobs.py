"""rings.csv with circumferences by ring: what is read, and what is told of bad ones.

Truth: the files as they were written; of each slip the one line that names it.
"""

import numpy as np
import pytest
from filled_forms import fill_form
from fuzzing import spoilt_folder
from job_builder import write_book, write_folder
from ringed_jobs import TAPE, ringed_parts

import tankcal
from tankcal.errors import InputError, TankcalError
from tankcal.job.starter import write_input_workbook
from tankcal.text.shipped import LANGUAGES


def problems(folder, parts):
    with pytest.raises(InputError) as told:
        tankcal.load(write_folder(folder, parts))
    return told.value.problems


def test_rings_are_read_with_their_gauged_plates(tmp_path):
    parts = ringed_parts(laps=("outer", "inner", "outer"))
    parts.tables["rings"][1][2] = None
    parts.tables["thickness"] = [["ring", "thickness_mm"], ["1", 7.9], ["1", 8.1]]
    job = tankcal.load(write_folder(tmp_path, parts))
    first, second, _ = job.rings
    assert (first.name, first.length_m, first.lap) == ("1", 3.0, "outer")
    assert first.thickness_m == pytest.approx(0.008)
    assert second.thickness_m == 0.008
    assert job.strapping.plate_sd_m == {"1": pytest.approx(1e-4)}
    assert [one.course for one in job.strapping.straps] == ["1", "1", "2", "2", "3", "3"]
    assert job.strapping.straps[1].level_m == pytest.approx(2.4)
    assert job.courses == ()
    assert job.horizontal.width_m is None


def test_folder_and_workbook_give_the_same(tmp_path):
    parts = ringed_parts(laps=("outer", "inner", "outer"))
    folder = tankcal.load(write_folder(tmp_path / "folder", parts))
    book = tankcal.load(write_book(tmp_path / "job.xlsx", parts))
    assert folder.rings == book.rings
    assert [one.reading_m for one in folder.strapping.straps] == [
        one.reading_m for one in book.strapping.straps
    ]


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_starter_filled_in_is_the_job(tmp_path, language):
    """The workbook of `tankcal new`, filled in, against the folder of the same job."""
    parts = ringed_parts(laps=("outer", "inner", "outer"))
    book = write_input_workbook(tmp_path / "new", "horizontal", "strapping", language)
    fill_form(book, parts.settings, {name: rows for name, rows in parts.tables.items()})
    _fill_tape(book)
    found = tankcal.load(book)
    parts.settings["table.language"] = language
    known = tankcal.load(write_folder(tmp_path / "known", parts))
    assert found.rings == known.rings
    assert found.horizontal == known.horizontal
    assert found.strapping.tapes == known.strapping.tapes
    assert_same_job_rows(found, known)


def assert_same_job_rows(one, other):
    for first, second in zip(one.strapping.straps, other.strapping.straps, strict=True):
        assert (first.name, first.course, first.level_m, first.reading_m) == (
            *(second.name, second.course, second.level_m, second.reading_m),
        )


def _fill_tape(path):
    import openpyxl
    from filled_forms import place_of

    book = openpyxl.load_workbook(path)
    sheet = book["instruments"]
    for key, value in TAPE.items():
        place_of(sheet, f"NAME.{key}").value = value
    for row in sheet.iter_rows():
        for cell in row:
            if cell.value == "NAME":
                cell.value = "T-5"
    book.save(path)


def _without(parts, table):
    del parts.tables[table]


def _cell(parts, table, row, column, value):
    parts.tables[table][row][parts.tables[table][0].index(column)] = value


SLIPS = {
    "no tape": (lambda p: _without(p, "circumferences"), "rings_without_tape", None),
    "no rings": (lambda p: _without(p, "rings"), "rings_without_tape", None),
    "a ring twice": (lambda p: _cell(p, "rings", 2, "ring", "1"), None, ("rings.csv", "ring")),
    "another ring": (
        lambda p: _cell(p, "circumferences", 1, "ring", "9"),
        "no_such_name",
        ("circumferences.csv", "ring"),
    ),
    "a ring without tape": (
        lambda p: p.tables.update(circumferences=p.tables["circumferences"][:5]),
        "ring_not_strapped",
        ("rings.csv", "ring"),
    ),
    "a place on another ring": (
        lambda p: _cell(p, "circumferences", 1, "from_a_m", 4.0),
        "place_outside_ring",
        ("circumferences.csv", "from_a_m"),
    ),
    "a repeat elsewhere": (
        lambda p: _cell(p, "circumferences", 2, "circumference", "1a"),
        "repeat_elsewhere",
        ("circumferences.csv", "from_a_m"),
    ),
    "no plate": (
        lambda p: _cell(p, "rings", 1, "thickness_mm", None),
        "ring_without_plate",
        ("rings.csv", "thickness_mm"),
    ),
    "a plate in metres": (
        lambda p: _cell(p, "rings", 1, "thickness_mm", 0.008),
        "thin_plate",
        ("rings.csv", "thickness_mm"),
    ),
    "rings too long": (
        lambda p: _cell(p, "rings", 1, "length_m", 3.5),
        "rings_do_not_add_up",
        ("rings.csv", "length_m"),
    ),
    "a diameter too": (
        lambda p: p.settings.update({"horizontal.diameter_m": 2.4}),
        "size_beside_rings",
        ("job.toml", "horizontal.diameter_m"),
    ),
    "a tube off the axis": (
        lambda p: p.settings.update({"horizontal.tube_offset_m": 0.1}),
        "tube_beside_rings",
        ("job.toml", "horizontal.tube_offset_m"),
    ),
    "a dip that leaves the top": (
        lambda p: p.settings.update({"horizontal.dip_from_a_m": 8.99}),
        "dip_leaves_top",
        ("job.toml", "horizontal.dip_from_a_m"),
    ),
    "surveyed inside": (
        lambda p: p.settings.update({"survey.side": "inside"}),
        "strapped_inside",
        ("job.toml", "survey.side"),
    ),
    "no shape": (
        lambda p: p.settings.pop("shell.shape_sd_mm"),
        "shape_not_declared",
        ("job.toml", "shell.shape_sd_mm"),
    ),
    "a torispherical end of no standard": (
        lambda p: p.settings.update(
            {"horizontal.end_a": "torispherical", "horizontal.thickness_mm": 8.0}
        ),
        "end_standard_missing",
        ("job.toml", "horizontal.end_a_standard"),
    ),
    "curved ends of no plate": (
        lambda p: p.settings.update(
            {"horizontal.end_a": "ellipsoidal", "horizontal.end_a_depth_m": 0.5}
        ),
        "end_thickness_missing",
        ("job.toml", "horizontal.thickness_mm"),
    ),
    "columns of an upright tank": (
        lambda p: p.tables["circumferences"].__setitem__(
            0, ["circumference", "course", "from_a_m", "reading_m", "s_mm"]
        ),
        "missing_column",
        ("circumferences.csv", "ring"),
    ),
    "points beside": (
        lambda p: p.tables.update(points=[["point", "x_m", "y_m", "z_m"], ["1", 0.0, 0.0, 1.0]]),
        "rings_beside",
        ("rings.csv", None),
    ),
    "a diameter declared unsure": (
        lambda p: p.tables.update(uncertainty=[["input", "u", "unit"], ["diameter", 1.0, "mm"]]),
        "useless_input",
        ("uncertainty.csv", "input"),
    ),
    "courses of an upright tank": (
        lambda p: p.tables.update(courses=[["course", "height_m", "thickness_mm"], ["1", 2, 8]]),
        "not_for_this_kind",
        ("courses.csv", None),
    ),
    "sag of a tape of no weight": (
        lambda p: (
            p.registers["instruments"]["T-5"].pop("weight_n_per_m"),
            p.tables.update(obstructions=[["circumference", "kind", "span_m"], ["1a", "sag", 3.0]]),
        ),
        None,
        ("instruments.toml", "T-5.weight_n_per_m"),
    ),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_is_told_in_one_line(tmp_path, slip):
    change, code, place = SLIPS[slip]
    parts = ringed_parts()
    change(parts)
    found = problems(tmp_path, parts)
    told = [(one.file, one.column) for one in found]
    if code is not None:
        assert code in [one.expected.code for one in found], found
    if place is not None:
        assert place in told
    assert all("\n" not in str(one) for one in found)


def test_all_slips_are_told_in_one_run(tmp_path):
    parts = ringed_parts()
    for slip in ("another ring", "no plate", "a diameter too", "no shape"):
        SLIPS[slip][0](parts)
    codes = {one.expected.code for one in problems(tmp_path, parts)}
    assert codes >= {"no_such_name", "ring_without_plate", "size_beside_rings"}


def test_rings_that_touch_are_inner_and_outer_in_turn(tmp_path):
    job = tankcal.load(write_folder(tmp_path, ringed_parts(laps=("outer", "outer", "inner"))))
    assert "laps_not_in_turn" in [one.expected.code for one in job.warnings]


def test_upright_tanks_have_no_rings(tmp_path):
    parts = ringed_parts()
    parts.settings["tank.kind"] = "vertical"
    codes = [(one.file, one.expected.code) for one in problems(tmp_path, parts)]
    assert ("rings.csv", "not_for_this_kind") in codes


@pytest.mark.slow
def test_spoilt_jobs_give_a_result_or_lines(tmp_path):
    """Property: whatever stands in the files, a result or problems of one line each."""
    parts = ringed_parts(shell__shape_sd_mm=2.0)
    base = {one.name: one.read_bytes() for one in write_folder(tmp_path / "base", parts).iterdir()}
    told = []
    for seed in range(40):
        folder = tmp_path / str(seed)
        folder.mkdir()
        for name, data in spoilt_folder(base, np.random.default_rng(seed)).items():
            (folder / name).write_bytes(data)
        try:
            tankcal.run(tankcal.load(folder), simulated=False)
        except TankcalError as error:
            told += getattr(error, "problems", error.args)
    assert told
    assert [one for one in told if "\n" in str(one)] == []
