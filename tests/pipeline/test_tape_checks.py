"""What is told of tapes and how they were read: each slip is known, a sound book is quiet."""

import numpy as np
import pytest
from job_builder import S_1, strapped_parts
from test_strapped_wall import result_of, straps_with

from tankcal.methods.strapping.warnings import _find_copies
from tankcal.survey.strapping import Strap


def told(parts, folder):
    """{code: line}"""
    return {one.expected.code: str(one) for one in result_of(parts, folder).warnings}


CERTIFICATES = {  # keys of a tape that are in another unit or misread, and what is told
    "certified_temperature_strange": {"certified_temperature_c": 68.0},
    "tape_thickness_strange": {"thickness_mm": 2.0},
    "tape_stiffness_strange": {"section_mm2": 0.25},
    "tape_correction_strange": {"correction": 335e-6},
    "pull_unlike_certificate": {"tension_n": 5.1},  # kgf
}


@pytest.mark.slow
@pytest.mark.parametrize("code", CERTIFICATES)
def test_a_certificate_of_no_tape_is_named(tmp_path, code):
    parts = strapped_parts()
    parts.registers["instruments"]["T-12"] |= CERTIFICATES[code]
    assert code in told(parts, tmp_path)


def test_a_correction_that_class_ii_allows_is_quiet(tmp_path):
    """OIML R 35-1: 0.3 mm and 0.2 mm a metre, 230 ppm of 10 m."""
    parts = strapped_parts()
    parts.registers["instruments"]["T-12"]["correction"] = 230e-6
    assert "tape_correction_strange" not in told(parts, tmp_path)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("given", "is_told"),
    [
        ({"correction_mm": 35.0, "correction": 35e-6}, True),  # of 45 m; 9.3 mm are allowed
        ({"correction_mm": -35.0, "correction": 35e-6}, True),
        ({"correction_mm": 12.0, "correction": -100e-6}, False),  # together 7.5 mm
        ({"correction_mm": 9.0, "correction": 0.0}, False),
    ],
)
def test_both_corrections_of_a_tape_are_judged_together(tmp_path, given, is_told):
    """OIML R 35-1, class II: 0.3 mm and 0.2 mm a metre, of the length that was read."""
    parts = strapped_parts()
    parts.registers["instruments"]["T-12"] |= given
    assert ("tape_correction_mm_strange" in told(parts, tmp_path)) == is_told


def compared(apart_m):
    """The working tape read at 50 m before and after, so much apart."""
    parts = strapped_parts()
    tapes = parts.registers["instruments"]
    tapes["M-1"] = {**tapes["T-12"]}
    tapes["T-12"]["master"] = "M-1"
    parts.tables["circumferences"][0].append("instrument")
    for row in parts.tables["circumferences"][1:]:
        row.append("T-12")
    parts.tables["tape_checks"] = [
        ["level", "master_m", "working_m", "s_mm", "when"],
        ["2", 50.0, 50.0, 0.3, "before"],
        ["2", 50.001, 50.001 - apart_m, 0.3, "after"],
    ]
    return parts


@pytest.mark.slow
def test_comparisons_with_a_master_that_contradict_each_other_are_named(tmp_path):
    """Closed form: of two with 0.3 mm each, 3.29 sqrt(2) 0.3 mm = 1.4 mm by one chance of 1000."""
    for apart_m, is_told in ((0.020, True), (1.5e-3, True), (1.3e-3, False)):
        found = told(compared(apart_m), tmp_path)
        assert ("comparisons_apart" in found) == is_told
    assert "2 after" in told(compared(0.020), tmp_path)["comparisons_apart"]


@pytest.mark.slow
def test_seams_that_no_plates_have_are_named(tmp_path):
    for count, is_told in ((4.0, False), (30.0, False), (40.0, True)):
        parts = strapped_parts()
        parts.tables["obstructions"][1][2] = count
        assert ("plates_too_short" in told(parts, tmp_path)) == is_told


@pytest.mark.slow
def test_a_shell_of_no_temperature_is_told_where_the_tape_was_warm(tmp_path):
    """Closed form: 2 a (T - T_table) of volume, 11 K: 242 ppm."""
    for celsius, is_told in ((31.0, True), (24.0, False)):
        parts = strapped_parts(survey__shell_temperature_c=None)
        parts.tables["circumferences"][0].append("temperature_c")
        for row in parts.tables["circumferences"][1:]:
            row.append(celsius)
        found = told(parts, tmp_path)
        assert ("shell_temperature_of_tapes" in found) == is_told
        assert not is_told or "-242 ppm" in found["shell_temperature_of_tapes"]
    assert "shell_temperature_of_tapes" not in told(strapped_parts(), tmp_path)


@pytest.mark.slow
def test_the_unit_of_a_pull_is_named(tmp_path):
    """60 N written as 6.1 kgf, and as 13.5 lbf."""
    for pull, unit in ((6.1, "kgf"), (13.5, "lbf")):
        parts = straps_with(lambda rows, place, pull=pull: [[*row[:-1], pull] for row in rows])
        assert unit in told(parts, tmp_path)["pull_unlike_certificate"]


def plates_off(rows, place):
    for row, plate in zip(rows, np.repeat([course[1] for course in S_1], 2), strict=True):
        row[place["reading_m"]] -= 2 * np.pi * (plate + 0.25) / 1000


@pytest.mark.slow
def test_circumferences_of_the_inside_are_named_by_steps_of_plates(tmp_path):
    """A build that is as drawn: 14.408 m inside; its plates step outside, not inside."""
    of_inside = straps_with(plates_off)
    for parts, is_told in ((of_inside, True), (strapped_parts(), False)):
        parts.settings["tank.nominal_diameter_m"] = 14.408
        assert ("circumference_of_inside" in told(parts, tmp_path)) == is_told


def book(rng, copied=0, digits=4, pairs=12):
    """Straps that were read twice, 0.5 mm; the second readings of some were copied."""
    found = []
    for i in range(pairs):
        girth = 45.3 + 0.01 * rng.normal()
        read = np.round(girth + 5e-4 * rng.normal(size=2), digits)
        read[1] = read[0] if i < copied else read[1]
        found += [Strap(f"{i}", str(i // 2), 1.0 * i, float(one), 5e-4, "T") for one in read]
    return found


@pytest.mark.slow
def test_repeats_are_equal_by_chance_now_and_then(figure):
    """Simulation: books of a sound crew, to 0.1 mm and to 1 mm, are told in less than 2 %."""
    rng = np.random.default_rng(3)
    for digits in (4, 3):
        share = np.mean([bool(list(_find_copies(book(rng, digits=digits)))) for _ in range(400)])
        figure(f"books told of copied repeats, {digits} decimals", f"{share:.3f}")
        assert share < 0.02 + 3 * np.sqrt(0.02 * 0.98 / 400)
        assert len(list(_find_copies(book(rng, copied=12, digits=digits)))) >= 12


def courses_read_once(rng, digits, copied=False):
    """Two circumferences a course, alike within 1.5 mm, each read once."""
    found = []
    for course in range(6):
        girth = 40.8 + 0.02 * rng.normal() + 1.5e-3 * rng.normal(size=2)
        read = np.round(girth[[0, 0]] if copied else girth, digits)
        found += [
            Strap(f"{course}{side}", str(course), course + 0.4 * place, float(one), 1e-3, "T")
            for place, (side, one) in enumerate(zip("ab", read, strict=True))
        ]
    return found


@pytest.mark.slow
def test_circumferences_of_one_course_are_equal_by_chance_now_and_then(figure):
    """Simulation: sound books of courses that are round alike are told in less than 2 %."""
    rng = np.random.default_rng(4)
    for digits in (4, 3):
        books = [courses_read_once(rng, digits) for _ in range(400)]
        share = np.mean([bool(list(_find_copies(one))) for one in books])
        figure(f"books told of copied circumferences, {digits} decimals", f"{share:.3f}")
        assert share < 0.02 + 3 * np.sqrt(0.02 * 0.98 / 400)
        assert len(list(_find_copies(courses_read_once(rng, digits, copied=True)))) >= 6
