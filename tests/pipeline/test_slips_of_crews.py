"""A crew's slip is told in every survey where it can happen, and a sound crew's book is quiet.

Simulation: tanks and crews of `crews`, whose volume is known; each slip is what a crew does by
hand, and moved the table by more than U without a word before its check was made.
"""

import numpy as np
import pytest
from crews import BOOKS, CrewTank
from draws import draws
from job_builder import strapped_parts, write_book, write_folder
from messages_told import lines
from scipy.stats import binom

import tankcal
from tankcal.errors import InputError, SolutionError
from tankcal.pipeline.wall_straps import BY_CHANCE, course_apart
from tankcal.record import record_of

OF_SLIPS = {
    "strap_contradicts", "strapped_course_apart", "lines_turned_about", "hits_ranged_otherwise",
    "large_correction", "strip_upright", "weld_thick", "tangents_of_high_setup",
    "tape_correction_strange", "control_moved", "setup_set_aside", "lines_of_inside", "pasted_rows",
    "plates_too_short", "comparisons_apart", "tape_correction_mm_strange", "many_offsets_set_aside",
}  # fmt: skip
SOUND = draws(2, 30)


def computed(folder, book):
    """(result, {code: line}) of a book."""
    result = tankcal.run(tankcal.load(write_folder(folder, book.parts())))
    assert lines(result.warnings)
    return result, {one.expected.code: str(one) for one in result.warnings}


def book_of(kind, seed):
    rng = np.random.default_rng(seed)
    return BOOKS[kind](CrewTank(rng), rng)


def over_a_manhole(book, courses=("1",), places=("0.2", "0.8")):
    for row in book.tables["circumferences"]:
        if row["course"] in courses and row["circumference"].endswith(places):
            row["reading_m"] += 0.045


def one_strap_over_a_manhole(book):
    over_a_manhole(book, places=("0.2",))


def levels_from_the_top_down(book):
    rows = book.tables["offsets"]
    levels = sorted({row["level_m"] for row in rows})
    turned = dict(zip(levels, levels[::-1], strict=True))
    for row in rows:
        row["level_m"] = turned[row["level_m"]]
        row["course"] = str(int(row["level_m"] / book.tank.course_m) + 1)


def constant_of_a_prism(book):
    for row in book.tables["wall_hits"]:
        if row["setup"] == "E2":
            row["distance_m"] += 0.0175


def millimetres_a_metre(book):
    book.instruments["ET-5"]["correction"] = 1e-3


def correction_of_another_tape(book):
    book.instruments["T-88"]["correction"] += 3e-4


def zenith_angles_drift(book):
    """By two minutes of arc, from the first reading of control targets to the last."""
    rows, again = book.tables["wall_hits"], book.tables["control_readings"]
    drifts = [(row, place / len(rows)) for place, row in enumerate(rows)]
    drifts += [(row, (int(row["time"][11:13]) - 10) / 2) for row in again]
    for row, part in drifts:
        row["zenith_deg"] = round(row["zenith_deg"] + 120 / 3600 * part, 4)


def columns_of_welds_exchanged(book):
    for row in book.tables["obstructions"]:
        row["thickness_mm"], row["width_mm"] = row["width_mm"], row["thickness_mm"]


def plates_for_caps(book):
    for row in book.tables["obstructions"]:
        row["thickness_mm"] = 9.0


def height_of_one_instrument(book):
    book.tables["setups"][3]["instrument_height_m"] += 0.1


def anticlockwise_circle(book):
    for row in of_second_setup(book):
        row["direction_deg"] = round(-row["direction_deg"] % 360, 4)


def circle_turned_about(book):
    for row in of_second_setup(book):
        row["direction_deg"] = round((row["direction_deg"] + 180) % 360, 4)


def hits_of_another_setup(book):
    """Half of the hits of the second under the name of the first."""
    for row in of_second_setup(book)[::2]:
        row["setup"] = "E1"


def of_second_setup(book):
    return [row for row in book.tables["wall_hits"] if row["setup"] == "E2"]


SLIPS = [
    ("three set-ups", anticlockwise_circle, "setup_set_aside"),
    ("three set-ups", circle_turned_about, "setup_set_aside"),
    ("three set-ups", hits_of_another_setup, "setup_set_aside"),
    ("strapping", over_a_manhole, "strapped_course_apart"),
    ("hits", one_strap_over_a_manhole, "strap_contradicts"),
    ("lines", levels_from_the_top_down, "lines_turned_about"),
    ("three set-ups", constant_of_a_prism, "hits_ranged_otherwise"),
    ("three set-ups", millimetres_a_metre, "large_correction"),
    ("hits", millimetres_a_metre, "large_correction"),
    ("hits", zenith_angles_drift, "control_moved"),
    ("strapping", correction_of_another_tape, "tape_correction_strange"),
    ("strapping", columns_of_welds_exchanged, "strip_upright"),
    ("lines", plates_for_caps, "weld_thick"),
    ("tangents", height_of_one_instrument, "tangents_of_high_setup"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "slip", "code"), SLIPS)
def test_a_slip_is_told(tmp_path, kind, slip, code):
    book = book_of(kind, 1002)
    slip(book)
    _, told = computed(tmp_path / "slipped", book)
    assert code in told


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hits", "three set-ups"])
def test_horizontal_distances_are_told(tmp_path, kind):
    book = book_of(kind, 1002)
    for row in book.tables["wall_hits"]:
        row["distance_m"] *= np.sin(np.radians(row["zenith_deg"]))
    with pytest.raises(InputError) as told:
        computed(tmp_path, book)
    assert {one.expected.code for one in told.value.problems} == {"hits_horizontal"}
    assert {one.column for one in told.value.problems} == {"distance_m"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "table"), [("tangents", "slope_distances"), ("three set-ups", "wall_hits")]
)
def test_a_constant_in_all_distances_is_told_by_the_drawing(tmp_path, kind, table):
    """Nothing in the readings shows it, so the drawing is asked for."""
    book = book_of(kind, 1002)
    for row in book.tables[table]:
        row["distance_m"] += 0.0344
    _, told = computed(tmp_path / "asked", book)
    assert "checks.diameter_is" in told["size_told_by_distances"]
    book.settings["checks.diameter_is"] = "inside"
    _, told = computed(tmp_path / "drawn", book)
    assert "inside_unlike_drawing" in told
    assert "size_told_by_distances" not in told


@pytest.mark.slow
def test_a_manhole_under_the_only_strapped_course_is_asked_for(tmp_path):
    """Nothing in the readings shows it, 4 to 6 U: the drawing, or a second course, is asked for."""
    book = book_of("lines", 1002)
    over_a_manhole(book)
    _, told = computed(tmp_path / "asked", book)
    assert "checks.diameter_is" in told["size_told_by_one_course"]
    book.settings["checks.diameter_is"] = "inside"
    _, told = computed(tmp_path / "drawn", book)
    assert "size_told_by_one_course" not in told


@pytest.mark.slow
def test_former_radii_say_the_size_beside_lines(tmp_path):
    """A manhole under the one strap contradicts them, and is refused."""
    book = book_of("lines", 1002)
    tank = book.tank
    radius = tank.mean_m + 2 / 3 * tank.bulge_m  # of the mean area, but for its seams
    book.tables["radii"] = [
        {"course": str(c + 1), "radius_m": round(float(one), 5), "u_mm": 0.5}
        for c, one in enumerate(radius)
    ]
    book.settings |= {"radii.source": "table", "radii.u_common_mm": 0.7}
    book.settings |= {"change.common_mm": 0.5, "change.own_mm": 0.3}
    _, told = computed(tmp_path / "sound", book)
    assert "size_told_by_one_course" not in told
    over_a_manhole(book)
    with pytest.raises(SolutionError, match="former radii do not explain"):
        computed(tmp_path / "slipped", book)


@pytest.mark.study
@pytest.mark.parametrize("kind", BOOKS)
def test_sound_books_are_quiet_and_within_u(tmp_path, kind, figure):
    """Simulation: of sound crews no more are out of U than 95 % intervals leave in 99 of 100."""
    ratios, told = [], []
    for seed in range(SOUND):
        book = book_of(kind, 2000 + seed)
        result, found = computed(tmp_path / str(seed), book)
        error = result.table.volume_m3[-1] - book.tank.volume_m3()
        ratios.append(error / result.intervals.U_m3[-1])
        told += OF_SLIPS & set(found)
    figure(f"{kind}: rms of error over U of sound crews", np.sqrt(np.mean(np.square(ratios))))
    assert not told
    assert np.sum(np.abs(ratios) > 1) <= binom.isf(0.01, SOUND, 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("kind", BOOKS)
def test_a_workbook_in_portuguese_is_the_same_job(tmp_path, kind):
    """Property: a crew that writes "trena" and "esquerda" on its sheets gets the same record."""
    words = {"tape": "Trena", "total_station": "estação total", "left": "esquerda",
             "right": "direita", "outside": "fora", "inside": "dentro"}  # fmt: skip
    book = book_of(kind, 1003)
    result, _ = computed(tmp_path / "folder", book)
    for row in (*book.tables.get("tangents", ()), *book.tables.get("lines", ())):
        row["side"] = words[row["side"]]
    for one in book.instruments.values():
        one["kind"] = words[one["kind"]]
    book.settings["survey.side"] = words[book.settings["survey.side"]]
    said = tankcal.run(tankcal.load(write_book(tmp_path / "book.xlsx", book.parts())))
    assert np.array_equal(said.table.volume_m3, result.table.volume_m3)
    assert record_of(said).keys() == record_of(result).keys()


@pytest.mark.slow
def test_sound_courses_seldom_stand_apart():
    """Second method: of normal radii one in twenty shells has one so far off, as it says."""
    rng = np.random.default_rng(4)
    for count in (4, 6, 9):
        told = [course_apart(rng.normal(size=count), 0.0) is not None for _ in range(2000)]
        assert np.mean(told) == pytest.approx(BY_CHANCE, abs=0.015)


def test_one_of_three_courses_is_not_told():
    assert course_apart(np.array([6.5, 6.5, 6.6]), 1e-3) is None


def test_strips_that_stand_upright_are_asked_for(tmp_path):
    parts = strapped_parts()
    parts.tables["obstructions"][1][3:5] = 120.0, 9.0
    parts.tables["obstructions"][2][1:5] = "weld", 4.0, 9.0, 12.0
    job = tankcal.load(write_folder(tmp_path, parts))
    told = [(one.expected.code, one.row) for one in job.warnings if one.file == "obstructions.csv"]
    assert told == [("strip_upright", 2), ("weld_thick", 3)]
