"""From a strapped tank to its table: worked numbers, second methods, and what is told of a crew."""

from dataclasses import replace

import numpy as np
import pytest
from generated_strapping import girth_of, strapped_job
from generated_walls import GeneratedWall, make_wall
from job_builder import S_1, strapped_parts, write_book, write_folder, write_strapped_job
from page_figures import figures_of

import tankcal
from tankcal.errors import InputError, SolutionError
from tankcal.methods.strapping.wall import find_strapped_wall
from tankcal.methods.strapping.warnings import limit_of_repeats
from tankcal.pipeline.wall_straps import exchanged_courses, field_of_readings
from tankcal.record import record_of
from tankcal.survey.strapping import Obstruction

OPEN = {0.9: 146.70404, 1.8: 293.40807, 3.6: 586.81461, 6.0: 978.05449, 8.4: 1369.27879}
HEAD_850 = {0.9: 0.00428, 1.8: 0.01710, 3.6: 0.07056, 6.0: 0.20700, 8.4: 0.43102}


def result_of(parts, folder):
    return tankcal.run(tankcal.load(write_folder(folder, parts)), simulated=False)


def codes(result):
    return {one.expected.code for one in result.warnings if one.file == "circumferences.csv"}


@pytest.mark.slow
@pytest.mark.parametrize("density", [0, 850])
def test_tank_s_1(tmp_path, density):
    """Worked numbers: volumes to 1e-5 m3, with and without the head."""
    result = result_of(strapped_parts(table__liquid_density_kg_m3=density), tmp_path)
    expected = {h: volume + (HEAD_850[h] if density else 0.0) for h, volume in OPEN.items()}
    found = {height: result.at(height).value_m3 for height in OPEN}
    assert found == pytest.approx(expected, abs=1.6e-5)  # of two rounded figures
    assert codes(result) == set()


def test_folder_and_workbook_give_the_same(tmp_path):
    parts = with_span(strapped_parts(), count=2)
    parts.tables["thickness"] = [["course", "thickness_mm", "paint_mm"], ["1", 8.9, 0.2],
                                 ["1", 9.0, 0.3]]  # fmt: skip
    folder = tankcal.load(write_folder(tmp_path / "folder", parts))
    book = tankcal.load(write_book(tmp_path / "job.xlsx", parts))
    assert [replace(one, row=None) for one in folder.strapping.straps] == [
        replace(one, row=None) for one in book.strapping.straps
    ]
    assert folder.strapping.tapes == book.strapping.tapes
    assert folder.strapping.obstructions == book.strapping.obstructions
    assert folder.strapping.obstructions["1a"][-1] == Obstruction("sag", 2, span_m=10.0)
    for job in (folder, book):
        assert job.courses[0].thickness_m == pytest.approx(0.00895)
        assert job.courses[0].paint_m == pytest.approx(0.00025)
        assert job.courses[1].thickness_m == pytest.approx(0.008)
        sd = np.std([8.9e-3, 9e-3], ddof=1) / np.sqrt(2)
        assert job.strapping.plate_sd_m == {"1": pytest.approx(max(sd, 5e-5))}


@pytest.mark.slow
def test_every_cause_stands_in_the_budget(tmp_path):
    parts = strapped_parts(shell__shape_sd_mm=5.0, strapping__wave_mm=50.0)
    parts.tables["thickness"] = [["course", "thickness_mm"], ["1", 8.9], ["1", 9.1]]
    header, *rows = parts.tables["circumferences"]
    rows = [[*row, 29.0 if i % 2 else None] for i, row in enumerate(rows)]
    parts.tables["circumferences"] = [[*header, "temperature_c"], *rows]
    parts.registers["instruments"]["T-12"] |= {"friction": 0.2, "laying_mm": 0.3}
    names = {one.kind for one in result_of(parts, tmp_path).table.sources}
    assert names >= {
        *("straps", "instrument_scale", "tape_tension", "tape_friction", "tape_level"),
        *("tape_temperature", "area_term", "plate_readings", "bulge", "shell_temperature"),
    }


def with_span(parts, span_m=10.0, count=None, **tape):
    """The parts with a free span on circumference 1a, and what is told of their tape."""
    header, *rows = parts.tables["obstructions"]
    span = ["1a", "sag", count, *[None] * (len(header) - 3), span_m]
    parts.tables["obstructions"] = [[*header, "span_m"], *([*row, None] for row in rows), span]
    parts.registers["instruments"]["T-12"] |= {"weight_n_per_m": 0.2} | tape
    return parts


@pytest.mark.slow
def test_a_free_span_reaches_the_table(tmp_path):
    """Differences: two spans of 10 m at 60 N take 2 x 0.463 mm off one of two circumferences."""
    plain = result_of(strapped_parts(), tmp_path / "plain")
    spanned = result_of(with_span(strapped_parts(), count=2), tmp_path / "span")
    sags = [one.steps_m["sag"] for one in spanned.straps.reduced]
    assert sags == pytest.approx([-2 * 0.2**2 * 10**3 / (24 * 60**2), *[0.0] * 9])
    by = spanned.at(1.8).value_m3 / plain.at(1.8).value_m3 - 1
    assert by == pytest.approx(2 * sags[0] / 2 / 45.32, rel=0.02)
    assert {one.kind for one in spanned.table.sources} >= {"tape_weight", "tape_tension"}
    rubbed = result_of(with_span(strapped_parts(), friction=0.2), tmp_path / "rubbed")
    assert {one.kind for one in rubbed.table.sources} >= {"tape_sag", "tape_friction"}


def test_a_span_that_cannot_be_read_is_told_once(tmp_path):
    with pytest.raises(InputError) as refused:
        tankcal.load(write_folder(tmp_path, with_span(strapped_parts(), "wide")))
    assert [(one.row, one.column) for one in refused.value.problems] == [(5, "span_m")]


def test_a_weight_in_kilograms_is_told(tmp_path):
    job = tankcal.load(write_folder(tmp_path, with_span(strapped_parts(), weight_n_per_m=0.02)))
    assert [one.expected.code for one in job.warnings] == ["tape_weight_unlike_steel"]


def test_the_radius_of_a_course_is_the_best_linear_estimate(tmp_path):
    """Second method: generalised least squares with every covariance written out."""
    job = tankcal.load(write_strapped_job(tmp_path, shell__shape_sd_mm=5.0))
    wall = find_strapped_wall(job, lambda text: None)
    sites, size = wall.field.sites, wall.field.amplitudes.variances_m2
    z = sites.zeta
    same = np.equal.outer(sites.course, sites.course)
    node, weight = np.polynomial.legendre.leggauss(400)
    names = ["common bulge", "drawn-in joints", "own bulge", "common taper", "own taper"]
    profiles = {
        "own bulge": (range(2, 7), [k**-2.0 for k in range(2, 7)]),
        "common taper": ((1,), (1.0,)),
        "own taper": ((1,), (1.0,)),
    }
    whole = wall.field.noise_m2 + 1e-12 * np.eye(len(z))
    for place, name in enumerate(names):
        if name == "drawn-in joints":
            drawn = np.exp(-(1 - np.abs(z)) / 0.2) - weight @ np.exp(-(1 - np.abs(node)) / 0.2) / 2
            over = np.exp(-(1 - np.abs(node)) / 0.2)
            square = weight @ (over - weight @ over / 2) ** 2 / 2
            part = np.outer(drawn, drawn) / square
        elif name == "common bulge":  # (1 - z^2)^2, and 0.4 of what parts a parabola from it
            held, free = np.polynomial.Polynomial([1, 0, -1]) ** 2, [1, 0, -1]
            ways = [held, 0.4 * (held - np.polynomial.Polynomial(free))]
            ways = [way - weight @ way(node) / 2 for way in ways]
            norm = sum(weight @ way(node) ** 2 / 2 for way in ways)
            part = sum(np.outer(way(z), way(z)) for way in ways) / norm
        else:
            orders, shares = profiles[name]
            unit = [np.polynomial.legendre.Legendre.basis(k) for k in orders]
            norm = sum(s / (2 * k + 1) for k, s in zip(orders, shares, strict=True))
            part = sum(s * np.outer(p(z), p(z)) for s, p in zip(shares, unit, strict=True)) / norm
        whole += size[place] * (part * same if name.startswith("own") else part)
    design = np.equal.outer(sites.course, range(5)).astype(float)
    inverse = np.linalg.inv(whole)
    found = np.linalg.solve(design.T @ inverse @ design, design.T @ inverse @ wall.field.radius_m)
    assert wall.radius_m == pytest.approx(found, rel=1e-9)


def test_a_reading_is_tested_against_all_others(tmp_path):
    """Second method: each reading left out, its course predicted by the others, w by their sds."""
    job = tankcal.load(write_strapped_job(tmp_path))
    wall = find_strapped_wall(job, lambda text: None)
    w, mdb = wall.straps.w, wall.straps.mdb_m
    whole, course = wall.field.covariance_m2, wall.field.sites.course
    design = np.equal.outer(course, range(5)).astype(float)
    for one in (0, 5):
        others = np.arange(len(course)) != one
        system = np.block([[whole[np.ix_(others, others)], design[others]],
                           [design[others].T, np.zeros((5, 5))]])  # fmt: skip
        right = np.concatenate([whole[one, others], design[one]])
        weights = np.linalg.solve(system, right)
        away = wall.field.radius_m[one] - weights[: others.sum()] @ wall.field.radius_m[others]
        sd = np.sqrt(whole[one, one] - weights @ right)
        assert w[one] == pytest.approx(away / sd, rel=1e-6)
        assert mdb[one] == pytest.approx(4.13 * sd * 2 * np.pi, rel=1e-3)
    straps = tuple(strap for strap in job.strapping.straps if strap.name != "3b")
    alone = replace(job, strapping=replace(job.strapping, straps=straps))
    straps = find_strapped_wall(alone, lambda text: None).straps
    w, mdb = straps.w, straps.mdb_m
    assert np.isnan(w[4])
    assert np.isinf(mdb[4])
    assert np.all(np.isfinite(np.delete(w, 4)))


@pytest.mark.slow
def test_a_tape_on_the_shell_expands_with_it(tmp_path):
    """Differences: what a warmer shell does to the volumes, the tape's own expansion in it."""
    jobs = [
        tankcal.load(write_strapped_job(tmp_path / str(warm), survey__shell_temperature_c=warm))
        for warm in (31.0, 32.0)
    ]
    cooler, warmer = (tankcal.run(job, simulated=False) for job in jobs)
    by = cooler.body.derivatives(np.array([8.4]))["shell_temperature"][0]
    change = warmer.at(8.4).value_m3 - cooler.at(8.4).value_m3
    assert by == pytest.approx(change, rel=1e-2)  # of a difference of 340 such changes
    assert abs(by) < 2e-6 * cooler.at(8.4).value_m3  # two expansions that nearly cancel


@pytest.mark.slow
def test_a_wall_of_waves_has_the_area_that_the_tape_is_corrected_to(tmp_path, figure):
    """Simulation: strapped walls with seams; without the area term their areas are too large."""
    rng = np.random.default_rng(5)
    away, uncorrected = [], []
    for _ in range(12):
        wall = make_wall(rng, "coil", radius_m=6.0, courses=5, bulge=False)
        job = strapped_job(rng, wall, straps=2, folder=tmp_path / "job")
        warmer = job.survey.shell_temperature_c - job.table.reference_temperature_c
        for shape, found in ((job.strapping.shape_sd_m, away), (0.0, uncorrected)):
            one = replace(job, strapping=replace(job.strapping, shape_sd_m=shape))
            radius = find_strapped_wall(one, lambda text: None).radius_m - 0.008
            radius = radius * (1 - 1.1e-5 * warmer)
            area = [wall.areas(course, np.array([-0.6, 0.6])).mean() for course in range(5)]
            found.append(np.mean(np.pi * radius**2 / area - 1))
    figure("area of strapped walls of waves, mean ppm off with and without the area term",
           f"{1e6 * np.mean(away):.0f} {1e6 * np.mean(uncorrected):.0f}")  # fmt: skip
    assert abs(np.mean(away)) < 0.6 * np.mean(uncorrected)
    assert np.mean(uncorrected) > 4e-5


def test_girth_of_a_circle():
    wall = GeneratedWall(6.5, 1, 2.0)
    assert girth_of(wall, 0, 0.0, 0.008) == pytest.approx(2 * np.pi * 6.508, rel=1e-9)


# ---- what is told of a crew


def straps_with(change):
    """Parts of tank S-1 whose circumferences were changed by change(rows, columns)."""
    parts = strapped_parts()
    header, *rows = (list(row) for row in parts.tables["circumferences"])
    place = {name: i for i, name in enumerate(header)}
    rows = change(rows, place) or rows
    parts.tables["circumferences"] = [header, *rows]
    return parts


def exchanged(rows, place):
    at = place["reading_m"]
    for low, high in ((0, 8), (1, 9)):  # courses 1 and 5
        rows[low][at], rows[high][at] = rows[high][at], rows[low][at]


def one_off(rows, place):
    rows[5][place["reading_m"]] += 0.010


def copied(rows, place):
    for first in (0, 2, 4):
        rows[first + 1][place["reading_m"]] = rows[first][place["reading_m"]]


def repeat_apart(rows, place):
    again = list(rows[2])
    again[place["reading_m"]] += 0.009
    return [*rows, again]


def single(rows, place):
    return [row for row in rows if row[place["circumference"]] != "3b"]


def of_inside(rows, place):
    for row, plate in zip(rows, np.repeat([course[1] for course in S_1], 2), strict=True):
        row[place["reading_m"]] -= 2 * np.pi * (4 * plate + 0.25) / 1000


PLANTED = {
    "courses_exchanged": exchanged,
    "strap_apart": one_off,
    "reading_copied": copied,
    "repeats_apart": repeat_apart,
    "controlled_by_nothing": single,
    "strapped_unlike_nominal": of_inside,
}


@pytest.mark.slow(after=3)
@pytest.mark.parametrize("code", PLANTED)
def test_planted_errors_are_named(tmp_path, code):
    assert code in codes(result_of(straps_with(PLANTED[code]), tmp_path))


@pytest.mark.slow
def test_sound_courses_are_seldom_asked_whether_they_were_exchanged():
    """Simulation, not from the distribution that is assumed: 1.2 mm to either side, even."""
    rng, plates = np.random.default_rng(7), np.array([10.25, 9.25, 8.25, 7.25, 6.55, 6.55]) / 1000
    told = named = 0
    for _ in range(100):
        inside = 7.2 + rng.uniform(-1.2e-3, 1.2e-3, 6)
        told += exchanged_courses(inside + plates, plates, range(6)) is not None
        outside = 7.2 + rng.uniform(-4e-4, 4e-4, 6) + plates
        outside[[1, 4]] = outside[[4, 1]]
        found = exchanged_courses(outside, plates, range(6))
        named += found is not None and found[:2] in [(1, 4), (1, 5)]
    most, scatter_mm = figures_of(
        "docs/studies/strapping.md",
        "For valid books it asks in at most () % (radii of courses that scatter by up to () mm",
    )
    small_mm, least, first, other = figures_of(
        "docs/studies/strapping.md",
        "Where courses scatter by up to () mm, it finds at least () % of exchanges of plates of () "
        "and () mm",
    )
    assert (float(scatter_mm), float(small_mm)) == (1.2, 0.4)
    assert [float(first), float(other)] == pytest.approx(1000 * plates[[1, 4]])
    assert told <= float(most)
    assert named >= float(least)


def test_a_temperature_in_fahrenheit_is_named(tmp_path):
    parts = strapped_parts()
    header, *rows = parts.tables["circumferences"]
    parts.tables["circumferences"] = [[*header, "temperature_c"], *([*row, 88.0] for row in rows)]
    assert codes(result_of(parts, tmp_path)) == {"tape_in_fahrenheit"}


def test_what_was_declared_of_the_first_course_is_compared(tmp_path):
    """The drawing's diameter to the plate, and a circumference under [checks]."""
    given = {"checks__circumference_m": 45.40, "checks__diameter_is": "outside"}
    result = result_of(strapped_parts(**given), tmp_path)
    found = {one.expected.code for one in result.warnings if one.file == "job.toml"}
    assert found >= {"strapped_unlike_declared", "inside_unlike_drawing"}


def test_limits_of_repeats():
    assert [limit_of_repeats(girth) for girth in (20, 40, 80, 150, 300)] == [
        0.002, 0.003, 0.005, 0.006, 0.008,
    ]  # fmt: skip


# ---- bad input


def test_an_empty_file_is_told_once(tmp_path):
    write_strapped_job(tmp_path)
    (tmp_path / "circumferences.csv").write_text("")
    with pytest.raises(InputError) as refused:
        tankcal.load(tmp_path)
    assert [one.file for one in refused.value.problems] == ["circumferences.csv"]


def bad_course(parts):
    parts.tables["circumferences"][1][1] = "9"


def bad_level(parts):
    parts.tables["circumferences"][1][2] = 7.0


def inside(parts):
    parts.settings["survey.side"] = "inside"


def no_thickness(parts):
    del parts.registers["instruments"]["T-12"]["thickness_mm"]


def half_stretch(parts):
    del parts.registers["instruments"]["T-12"]["e_gpa"]


def no_course(parts):
    parts.tables["circumferences"] = parts.tables["circumferences"][:-2]


def other_place(parts):
    parts.tables["circumferences"][2][0] = "1a"


def no_excess(parts):
    parts.tables["obstructions"][3][5] = None


def no_circumference(parts):
    parts.tables["obstructions"][1][0] = "7z"


def no_master(parts):
    parts.registers["instruments"]["T-12"]["master"] = "M"


def no_comparison(parts):
    parts.registers["instruments"]["M"] = parts.registers["instruments"]["T-12"] | {}
    parts.registers["instruments"]["T-12"] |= {"master": "M"}


def leaning(parts):
    parts.settings["bottom.form"] = "leaning"


def no_tape(parts):
    parts.registers["instruments"]["T-12"]["kind"] = "edm"


def free_scale(parts):
    parts.registers["instruments"]["T-12"]["u_scale_ppm"] = "free"


def too_many(parts):
    header, *rows = parts.tables["circumferences"]
    parts.tables["circumferences"] = [header, *(rows * 101)]


def no_temperature(parts):
    del parts.settings["survey.shell_temperature_c"]


def test_a_tape_that_is_hardly_known_makes_a_wide_table(tmp_path):
    """A scale that is unsure by 10 %, an offset by 10 m, beside readings of 0.02 mm."""
    parts = strapped_parts()
    parts.registers["instruments"]["T-12"] |= {"u_scale_ppm": 1e5, "u_offset_mm": 1e4}
    header, *rows = parts.tables["circumferences"]
    parts.tables["circumferences"] = [header, *([*row[:4], 0.02, row[5]] for row in rows)]
    result = result_of(parts, tmp_path)
    assert result.table.U_m3[-1] > 0.5 * result.table.volume_m3[-1]


def test_readings_that_tell_nothing_are_refused(tmp_path):
    """A covariance that rounding has spoilt is told in words."""
    wall = find_strapped_wall(tankcal.load(write_strapped_job(tmp_path)), lambda text: None)
    field = wall.field
    spoilt = field.noise_m2 - 1e-3 * np.ones_like(field.noise_m2)
    with pytest.raises(SolutionError, match="tell nothing"):
        field_of_readings(field.sites, wall.readings, spoilt, field.nominal_m)


def half_a_pull(parts):
    header, *rows = parts.tables["circumferences"]
    parts.tables["circumferences"] = [[*header, "pulls"], *([*row, 2.5] for row in rows)]


def no_weight(parts):
    del with_span(parts).registers["instruments"]["T-12"]["weight_n_per_m"]


def no_pull(parts):
    with_span(parts)
    for key in ("tension_n", "section_mm2", "e_gpa"):
        del parts.registers["instruments"]["T-12"][key]
    for row in parts.tables["circumferences"][1:]:
        row[5] = None


def long_spans(parts):
    with_span(parts, count=5)


def deep_span(parts):
    with_span(parts, 12.0, weight_n_per_m=4.0)


def no_span(parts):
    with_span(parts, None)


BAD = {
    "span_weight_missing": no_weight,
    "span_pull_missing": no_pull,
    "span_longer_than_round": long_spans,
    "span_hangs_deep": deep_span,
    "obstruction_incomplete of a span": no_span,
    "part_of_a_pull": half_a_pull,
    "tape_of_no_temperature": no_temperature,
    "tape_scale_free": free_scale,
    "too_many_straps": too_many,
    "no_such_name": bad_course,
    "level_outside_course": bad_level,
    "strapped_inside": inside,
    "tape_thickness_missing": no_thickness,
    "stretch_incomplete": half_stretch,
    "course_not_strapped": no_course,
    "repeat_elsewhere": other_place,
    "obstruction_incomplete": no_excess,
    "no_such_name in obstructions": no_circumference,
    "no_such_master": no_master,
    "master_not_compared": no_comparison,
    "bottom_needs_axis": leaning,
    "tape_not_named": no_tape,
}


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("code", BAD)
def test_bad_input_is_told(tmp_path, code):
    parts = strapped_parts()
    BAD[code](parts)
    with pytest.raises(InputError) as refused:
        tankcal.load(write_folder(tmp_path, parts))
    found = {one.expected.code for one in refused.value.problems}
    assert code.split()[0] in found, refused.value
    assert all("\n" not in str(one) for one in refused.value.problems)


def test_what_a_master_lacks_is_told_of_the_master(tmp_path):
    """Its certificate counts: the working tape's own temperature stands there, and is no help."""
    parts = strapped_parts()
    tape = parts.registers["instruments"]["T-12"] | {"expansion_per_k": 1.15e-5}
    master = tape | {"certified_temperature_c": None, "expansion_per_k": None}
    master = {key: value for key, value in master.items() if value is not None}
    working = tape | {"master": "M"}
    parts.registers["instruments"] |= {"T-12": working, "T-13": working, "M": master}
    header, *rows = parts.tables["circumferences"]
    named = [[*row, ("T-12", "T-13")[i % 2]] for i, row in enumerate(rows)]
    parts.tables["circumferences"] = [[*header, "instrument"], *named]
    with pytest.raises(InputError) as refused:
        tankcal.load(write_folder(tmp_path, parts))
    places = [one.column for one in refused.value.problems]
    assert places.count("M.certified_temperature_c") == 1
    assert "T-12.certified_temperature_c" not in places


@pytest.mark.slow
def test_a_shape_that_nobody_declares_is_typical_and_as_uncertain_as_it_is_large(tmp_path):
    job = tankcal.load(write_strapped_job(tmp_path, shell__shape_sd_mm=None))
    wall = find_strapped_wall(job, lambda text: None)
    assert wall.shape_sd_m == pytest.approx(0.0061, abs=5e-5)
    assert 0 < wall.area_term.mean < wall.area_term.sd
    record = record_of(tankcal.run(job))
    assert ("area_term", "assumed") in [(one["code"], one["value"]) for one in record["choices"]]
    smaller = replace(job, strapping=replace(job.strapping, shape_sd_m=0.002))
    assert find_strapped_wall(smaller, lambda text: None).area_term.sd < wall.area_term.sd
