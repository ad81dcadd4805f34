"""A slip in all readings of a kind is refused, or asked about, by its name; sound books are quiet.

Simulation: the tanks and crews of `crews`, whose readings are spoilt as a crew does by hand.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from job_builder import job_parts, write_folder
from test_slips_of_crews import book_of, computed

import tankcal
from tankcal.errors import InputError
from tankcal.job.checks.survey.doubtful import chance_of_packed
from tankcal.methods.hits.wall import (
    _refuse_stations_outside,
    refuse_misread_lines,
    refuse_other_units,
)

IN_METRES = [
    ("strapping", "circumferences", "s_mm"),
    ("lines", "offsets", "s_mm"),
]


def problems_of(folder, book):
    with pytest.raises(InputError) as told:
        computed(folder, book)
    return [(one.expected.code, one.row, one.column) for one in told.value.problems]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "table", "column"), IN_METRES)
def test_standard_deviations_in_metres_are_refused(tmp_path, kind, table, column):
    book = book_of(kind, 1002)
    for row in book.tables[table]:
        row[column] /= 1000
    assert problems_of(tmp_path, book) == [("sd_below_any_mm", 2, column)]


@pytest.mark.slow
def test_standard_deviations_that_nobody_reads_are_asked_about(tmp_path):
    """Readings may be made up without errors, to check a formula."""
    book = book_of("strapping", 1002)
    for row in book.tables["circumferences"]:
        row["s_mm"] = 0.01
    job = tankcal.load(write_folder(tmp_path, book.parts()))
    assert "sd_below_any_mm" in {one.expected.code for one in job.warnings}


@pytest.mark.slow
def test_standard_deviations_of_an_instrument_in_other_units_are_refused(tmp_path):
    book = book_of("hits", 1002)
    name = "ET-5"
    book.instruments[name] |= {"s_mm": 0.001, "s_arcsec": 0.001}
    codes = ["sd_below_any_mm", "sd_below_any_arcsec"]
    found = problems_of(tmp_path, book)
    assert [one[0] for one in found] == codes
    assert [one[2] for one in found] == [f"{name}.s_mm", f"{name}.s_arcsec"]


@pytest.mark.slow
def test_many_offsets_set_aside_are_one_question(tmp_path):
    """A twentieth of a millimetre where readings scatter by half a millimetre."""
    book = book_of("lines", 1002)
    for row in book.tables["offsets"]:
        row["s_mm"] = 0.05
    _, told = computed(tmp_path, book)
    assert "many_offsets_set_aside" in told
    assert "offset_set_aside" not in told


def packed(degrees):
    """12.5125 for 12.5125 degrees, which are 12 30 45: 12.3045."""
    seconds = round(degrees * 3600)
    return seconds // 3600 + seconds // 60 % 60 / 100 + seconds % 60 / 10000


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "table"), [("hits", "wall_hits"), ("tangents", "tangents")])
def test_packed_degrees_minutes_and_seconds_are_refused(tmp_path, kind, table):
    book = book_of(kind, 1002)
    for row in book.tables[table]:
        row["direction_deg"] = packed(row["direction_deg"] % 360)
    assert problems_of(tmp_path, book) == [("packed_dms", 2, "direction_deg")]


def test_decimal_degrees_are_rarely_as_packed_ones():
    """Closed form: of n independent readings 0.6^n have no second pair of decimals over 59, and
    fewer none of both pairs.
    """
    rng = np.random.default_rng(5)
    decimal = np.round(rng.uniform(0, 360, (2000, 6)), 4)
    found = np.array([chance_of_packed(each) for each in decimal])
    share = np.mean(found < 1)
    assert abs(share - 0.36**6) < 4 * np.sqrt(0.36**6 / 2000)
    assert found.min() >= 0.6**6 - 1e-12
    assert chance_of_packed(np.arange(0, 360, 22.5)) == 1.0
    assert chance_of_packed(np.arange(0.5, 40)) == 1.0  # says nothing


@pytest.mark.slow
@pytest.mark.parametrize("half", [(0, 180), (90, 270), (180, 360)])
def test_hits_over_half_a_circle_are_in_the_unit_that_they_are_in(tmp_path, half):
    book = book_of("hits", 1002)
    rows = book.tables["wall_hits"]
    book.tables["wall_hits"] = [one for one in rows if half[0] <= one["direction_deg"] < half[1]]
    assert 0.4 < len(book.tables["wall_hits"]) / len(rows) < 0.6
    refuse_other_units(tankcal.load(write_folder(tmp_path, book.parts())).hits)


@pytest.mark.slow
def test_degrees_in_a_column_of_gon_are_refused_by_name(tmp_path):
    book = book_of("hits", 1002)
    for row in book.tables["wall_hits"]:
        row["direction_gon"] = row.pop("direction_deg")
    hits = tankcal.load(write_folder(tmp_path, book.parts())).hits
    with pytest.raises(InputError) as told:
        refuse_other_units(hits)
    assert [one.expected.code for one in told.value.problems] == ["hits_in_degrees"]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "table"), [("hits", "wall_hits"), ("tangents", "tangents")])
def test_a_file_that_was_pasted_twice_is_told(tmp_path, kind, table):
    book = book_of(kind, 1002)
    for times in (1, 2):
        parts = book.parts()
        parts.tables[table] = [*parts.tables[table][:1], *times * parts.tables[table][1:]]
        job = tankcal.load(write_folder(tmp_path, parts))
        told = {one.expected.code for one in job.warnings}
        assert ("pasted_rows" in told) == (times == 2)


def line_of_hits(spoil):
    """Twelve hits up a wall that leans by 3 mm a metre and bulges by 5 mm, 14 m away."""
    height = np.linspace(-1, 11, 12)
    away = 14 + 3e-3 * height + 5e-3 * np.sin(3 * height)
    zenith, distance = spoil(np.arctan2(away, height), np.hypot(away, height))
    direction = np.full(12, 2.0)
    each = {"zenith_rad": zenith, "distance_m": distance, "direction_rad": direction}
    return SimpleNamespace(
        setup=("G1",) * 12, rows=tuple(range(2, 14)), file="wall_hits.csv", **each
    )


LINES = {
    "lines_of_hits_in_gon": lambda zenith, distance: (zenith / 0.9, distance),
    "lines_of_hits_in_degrees": lambda zenith, distance: (zenith * 0.9, distance),
    "lines_of_hits_horizontal": lambda zenith, distance: (zenith, distance * np.sin(zenith)),
}


@pytest.mark.parametrize("code", LINES)
def test_a_line_of_hits_in_another_unit_is_refused(code):
    """Closed form: hits of an upright line, read so."""
    with pytest.raises(InputError) as told:
        refuse_misread_lines(line_of_hits(LINES[code]))
    assert [(one.expected.code, one.row) for one in told.value.problems] == [(code, 2)]


def test_a_sound_line_of_hits_is_taken():
    refuse_misread_lines(line_of_hits(lambda zenith, distance: (zenith, distance)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hits", "three set-ups"])
def test_hits_in_feet_are_refused_by_the_heights_of_their_courses(tmp_path, kind):
    book = book_of(kind, 1002)
    rows = [row for row in book.tables["wall_hits"] if row["setup"] == "E1"]
    for row in rows:
        row["distance_m"] /= 0.3048
    found = problems_of(tmp_path, book)
    assert [one[0] for one in found] == ["hits_of_other_length"]


@pytest.mark.slow
def test_a_correction_in_parts_in_a_million_is_mended_to_what_it_is(tmp_path):
    book = book_of("strapping", 1002)
    book.instruments["T-88"]["correction"] = "35 ppm"
    with pytest.raises(InputError) as told:
        computed(tmp_path, book)
    assert "write 3.5e-05 without" in str(told.value)


@pytest.mark.slow
def test_a_negative_length_is_asked_for_its_sign(tmp_path):
    book = book_of("strapping", 1002)
    book.tables["circumferences"][1]["reading_m"] *= -1
    with pytest.raises(InputError) as told:
        computed(tmp_path, book)
    assert "is the sign wrong?" in str(told.value)
    assert len(told.value.problems) == 1


@pytest.mark.slow
def test_a_row_that_is_short_gives_one_line(tmp_path):
    """The obstructions of its circumference are not told, too."""
    folder = write_folder(tmp_path, book_of("strapping", 1002).parts())
    file = folder / "circumferences.csv"
    rows = file.read_text().splitlines()
    name = rows[1].split(",")[0]
    cut = [row.rpartition(",")[0] if row.split(",")[0] == name else row for row in rows]
    file.write_text("\n".join(cut))
    with pytest.raises(InputError) as told:
        tankcal.load(folder)
    assert {one.file for one in told.value.problems} == {"circumferences.csv"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sd_mm", "is_refused"),
    [(1e-7, True), (0.0005, False)],  # that of 0.5 mm in metres is asked
)
def test_standard_deviations_of_nothing_are_refused(tmp_path, sd_mm, is_refused):
    """Of a network the adjustment would end without naming a file, and so of points."""
    book = book_of("tangents", 1002)
    for row in book.tables["slope_distances"]:
        row["s_mm"] = sd_mm
    for place, parts in enumerate((book.parts(), job_parts(sd_mm=sd_mm))):
        folder = write_folder(tmp_path / str(place), parts)
        if is_refused:
            with pytest.raises(InputError) as told:
                tankcal.load(folder)
            assert {one.expected.code for one in told.value.problems} == {"tiny_sd_mm"}
        else:
            assert "tiny_sd_mm" in {one.expected.code for one in tankcal.load(folder).warnings}


@pytest.mark.slow
def test_a_section_of_tangents_is_named_by_its_level(tmp_path):
    book = book_of("tangents", 1002)
    table = book.tables["tangents"]
    level = table[0]["level_m"]
    seen = sorted({row["setup"] for row in table})[:4]
    book.tables["tangents"] = [
        row for row in table if row["level_m"] != level or row["setup"] in seen
    ]
    _, told = computed(tmp_path, book)
    assert f"section at {level:.3f} m (course 1)" in told["section_gap"]


def stations_round(radius_m, side):
    """A job of 12 m radius with eight stations round it, by what is asked of it."""
    angle = np.arange(8) * np.pi / 4
    places = radius_m * np.column_stack([np.sin(angle), np.cos(angle), 0 * angle])
    names = [f"Q{i}" for i in range(8)]
    setups = {name: SimpleNamespace(station=name) for name in names}
    stations = dict(zip(names, places + [100, 50, 0], strict=True))
    return SimpleNamespace(
        hits=SimpleNamespace(setup=names, setups=setups, stations=stations),
        survey=SimpleNamespace(side=side),
        tank=SimpleNamespace(nominal_diameter_m=24.0),
    )


def test_stations_outside_are_told_where_the_side_is_inside():
    """Closed form: a circle of stations, wider or narrower than the tank."""
    _refuse_stations_outside(stations_round(26.0, "outside"))
    _refuse_stations_outside(stations_round(11.0, "inside"))
    with pytest.raises(InputError) as told:
        _refuse_stations_outside(stations_round(26.0, "inside"))
    assert told.value.problems[0].expected.code == "hits_on_other_side"
