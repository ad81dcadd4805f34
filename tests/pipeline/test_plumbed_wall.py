"""From a strapped course and reference lines to the table: worked numbers, proofs, slips."""

from dataclasses import replace

import numpy as np
import pytest
from job_builder import plumbed_parts, write_book, write_folder

import tankcal
from tankcal.errors import InputError
from tankcal.geometry.field.sites import free_design
from tankcal.methods.lines.warnings import least_lines
from tankcal.methods.strapping.wall import find_strapped_wall
from tankcal.pipeline.tanks import body_of
from tankcal.units import ARCSEC

HEIGHTS, RADII = (1.2, 1.7, 1.5, 1.7, 1.9), (5.231, 5.2306, 5.2298, 5.2292, 5.2289)
LEAN, KAPPA = (-0.012, 0.016), 20 * ARCSEC


def wall_of(parts, folder):
    return find_strapped_wall(tankcal.load(write_folder(folder, parts)), lambda text: None)


def cones(sd_m=0.0, faces=(1, 2), inside=False, count=12, lean=LEAN, levels=(0.25, 0.75), seed=1):
    """Parts of five leaning round courses, read along rays: two levels a course, both faces."""
    rng = np.random.default_rng(seed)
    parts = plumbed_parts(shell__shape_sd_mm=0.0)
    azimuth = 2 * np.pi * np.arange(count) / count
    ray = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    constants = np.random.default_rng(7).uniform(0.15, 0.25, count)
    plates = [row[2] / 1000 + 0.00025 for row in parts.tables["courses"][1:]]
    rows, foot, zero = [], 0.0, levels[0] * HEIGHTS[0]
    for number, (height, outer, plate) in enumerate(zip(HEIGHTS, RADII, plates, strict=True), 1):
        for part in levels:
            level = foot + part * height
            along = (level - zero) * np.array(lean)
            across = ray[:, 0] * along[1] - ray[:, 1] * along[0]
            radius = outer - plate * inside
            distance = ray @ along + np.sqrt(radius**2 - across**2)
            for face in faces:
                leans = (level - zero) * KAPPA * (1 if face == 1 else -1)
                if inside:
                    read = distance - 5.2 + constants - leans
                else:
                    read = 5.2 + constants - distance + leans
                read = read + sd_m * rng.normal(size=count)
                rows += [
                    [f"L{i}", str(number), round(level, 6), 1000 * float(one), 0.5, face]
                    for i, one in enumerate(read)
                ]
        foot += height
    parts.tables["offsets"][1:] = rows
    side = ["inside" if inside else "outside"]
    parts.tables["lines"] = [["line", "side"], *([f"L{i}", *side] for i in range(count))]
    girth = 2 * np.pi * (RADII[0] + 1e-4)
    parts.tables["circumferences"][1:] = [
        [name, "1", 0.3, girth + by, 0.3, "T-12"] for name, by in (("1a", 1e-5), ("1b", -1e-5))
    ]
    return parts


@pytest.mark.slow
def test_case_b(tmp_path):
    """The page's radii, but for the eccentricity of the levels, which the page leaves out."""
    result = tankcal.run(tankcal.load(write_folder(tmp_path, plumbed_parts())), simulated=False)
    wall = result.strapped
    assert wall.collimations["ZL"] == pytest.approx((9.03 * ARCSEC, 2.62 * ARCSEC), rel=1e-3)
    off = np.array([2.03**2 + 4.64**2, 4.4**2 + 10.07**2, 6.66**2 + 15.2**2, 9.2**2 + 20.95**2])
    expected = np.array([5.23040, 5.22959, 5.22910, 5.22879]) + off * 1e-6 / (4 * 5.23)
    assert wall.radius_m[1:] == pytest.approx(expected, abs=6e-6)
    assert wall.radius_m[0] == pytest.approx(32.8673 / 2 / np.pi, abs=1e-6)
    budget = {one.kind for one in result.table.sources}
    assert budget >= {"straps", "offsets", "instrument_scale", "bulge", "seams", "ovality"}


@pytest.mark.slow
@pytest.mark.parametrize("inside", [False, True])
def test_leaning_courses_come_back(tmp_path, inside):
    """Exact geometry of a shell that leans by 2 %, read by a plummet that leans by 20 arcsec."""
    wall = wall_of(cones(inside=inside), tmp_path)
    assert wall.radius_m == pytest.approx(RADII, abs=3e-6)
    assert wall.collimations["ZL"][0] == pytest.approx(KAPPA, rel=1e-6)


@pytest.mark.slow
def test_one_face_and_a_certificate(tmp_path):
    """The collimation is not known then: it goes into every radius, and into U."""
    parts = cones(faces=(1,))
    parts.registers["instruments"]["ZL"]["u_collimation_arcsec"] = 10.0
    job = tankcal.load(write_folder(tmp_path, parts))
    result = tankcal.run(job, simulated=False)
    away = result.strapped.radius_m - RADII
    assert away[-1] == pytest.approx(-6.75 * KAPPA, rel=0.05)  # a common taper tells a little
    source = next(one for one in result.table.sources if one.kind == "collimation")
    assert source.u == pytest.approx(10.0)
    by_lean = 2 * np.pi * 5.23 * np.array(HEIGHTS) @ away * source.u * ARCSEC / KAPPA
    assert abs(source.columns_m3[-1, 0]) == pytest.approx(-by_lean, rel=0.005)


@pytest.mark.slow
def test_a_plummet_that_nobody_describes(tmp_path):
    parts = cones()
    del parts.registers["instruments"]["ZL"]
    assert wall_of(parts, tmp_path / "both").collimations[""][0] == pytest.approx(KAPPA)
    one_face(parts)
    with pytest.raises(InputError, match=r"instruments\.toml, u_collimation_arcsec: missing"):
        wall_of(parts, tmp_path / "one")


@pytest.mark.slow
def test_a_given_collimation_is_weighted_with_both_faces(tmp_path):
    """Second method: the two estimates, by the certificate and by the faces, in their weights."""
    free = wall_of(cones(), tmp_path / "free").collimations["ZL"]
    parts = cones()
    parts.registers["instruments"]["ZL"]["u_collimation_arcsec"] = 2.0
    kappa, u = wall_of(parts, tmp_path / "given").collimations["ZL"]
    weight = (2 * ARCSEC) ** -2 + free[1] ** -2
    assert u == pytest.approx(weight**-0.5, rel=1e-6)
    assert kappa == pytest.approx(free[0] * free[1] ** -2 / weight, rel=1e-6)


@pytest.mark.slow
def test_two_plummets_and_a_misread_first_offset(tmp_path):
    """Each plummet keeps its own collimation, whichever reading is rejected."""
    parts = cones()
    parts.registers["instruments"]["ZM"] = {"kind": "plummet"}
    parts.tables["lines"][0].append("instrument")
    for place, row in enumerate(parts.tables["lines"][1:]):
        row.append("ZM" if place % 3 == 1 else "ZL")
    rows_of(parts)[0][3] += 40.0
    for row in rows_of(parts):
        if row[0] in ("L1", "L4", "L7", "L10"):
            row[3] += 1000 * (row[2] - 0.3) * KAPPA * (1 if row[5] == 1 else -1)
    wall = wall_of(parts, tmp_path)
    assert not wall.tested.accepted[2]
    assert wall.tested.accepted.sum() == len(wall.readings) - 1
    found = wall.collimations
    assert found["ZL"][0] == pytest.approx(KAPPA, rel=1e-2)
    assert found["ZM"][0] == pytest.approx(2 * KAPPA, rel=1e-2)


@pytest.mark.slow
def test_unknowns_that_nothing_binds_are_as_wide_ones(tmp_path):
    """Second method: constants of lines and collimation as inputs of a vast uncertainty."""
    field = wall_of(cones(sd_m=5e-4), tmp_path).field
    shared = field.sites.shared
    without = replace(field.sites, shared=None)
    wide = replace(
        field,
        sites=without,
        radius_m=field.radius_m - shared @ field.shared[0],
        noise_m2=field.noise_m2 + shared @ shared.T,
    )
    assert wide.outlines_m == pytest.approx(field.outlines_m, abs=1e-8)
    assert wide.means.weights == pytest.approx(field.means.weights, abs=1e-6)
    design, whole = free_design(field.sites)[0], field.covariance_m2
    inverse = np.linalg.inv(whole)
    normal = np.linalg.inv(design.T @ inverse @ design)
    found = normal @ design.T @ inverse @ (field.radius_m - 5)
    assert field.shared[0] == pytest.approx(found[-shared.shape[1] :], abs=1e-9)
    assert field.shared[1] == pytest.approx(normal[-shared.shape[1] :, -shared.shape[1] :])


@pytest.mark.slow
def test_plates_are_taken_off_once(tmp_path):
    """Lines outside: a thinner plate is a larger inside. Lines inside do not see it at all."""
    for inside, expected in ((False, (0, 1, 0)), (True, (0, 0, 0))):
        found = []
        for thinner in (0.0, 0.5):
            parts = cones(inside=inside)
            parts.tables["courses"][2][2] -= thinner
            folder = tmp_path / f"{inside}{thinner}"
            job = tankcal.load(write_folder(folder, parts))
            body = body_of(job, find_strapped_wall(job, lambda text: None), uncertain=False)
            found.append(np.sqrt(body.area_m2(np.array([0.6, 2.0, 3.6])) / np.pi))
        assert found[1] - found[0] == pytest.approx(5e-4 * np.array(expected), abs=2e-7)


@pytest.mark.slow
def test_lines_inside_share_the_plate_of_the_strapped_course(tmp_path):
    """Differences: all plates thicker by 0.1 mm, with the readings as they are."""
    jobs = []
    for thicker in (0.0, 0.1):
        parts = cones(inside=True)
        for row in parts.tables["courses"][1:]:
            row[2] += thicker
        jobs.append(tankcal.load(write_folder(tmp_path / str(thicker), parts)))
    bodies = [body_of(job, find_strapped_wall(job, lambda text: None)) for job in jobs]
    by = bodies[0].derivatives(np.array([8.0]))["plate_thickness"][0]
    low, high = (body.volume_m3(np.array([8.0]))[0] for body in bodies)
    assert by == pytest.approx((high - low) / 1e-4, rel=1e-3)


def test_folder_and_workbook_give_the_same(tmp_path):
    parts = cones()
    parts.tables["offsets"][0].append("reference")
    for row in parts.tables["offsets"][1:]:
        row.append(row[2] == 0.3)
    folder = tankcal.load(write_folder(tmp_path / "folder", parts))
    book = tankcal.load(write_book(tmp_path / "job.xlsx", parts))
    for one, other in zip(folder.lines.offsets, book.lines.offsets, strict=True):
        assert other.offset_m == pytest.approx(one.offset_m, rel=1e-12)
        assert replace(one, row=None) == replace(other, row=None, offset_m=one.offset_m)
    assert folder.lines.plummets == book.lines.plummets
    assert folder.lines.reference_m == pytest.approx(0.3)


def test_how_many_lines_a_tank_needs():
    assert [least_lines(girth) for girth in (40, 80, 140, 180, 240, 290, 400)] == [
        10, 12, 16, 20, 24, 30, 36,
    ]  # fmt: skip


# ---- what is told of a crew


def rows_of(parts):
    return parts.tables["offsets"][1:]


def misread(parts):
    rows_of(parts)[40][3] += 15.0


def moved(parts):
    again = list(rows_of(parts)[3])
    again[3] += 2.5
    parts.tables["offsets"].append(again)


def copied(parts):
    rows = rows_of(parts)
    for row in rows:
        if row[0] == "L3":
            row[3] = next(one[3] for one in rows if one[0] == "L2" and one[1:3] == row[1:3]
                          and one[5] == row[5])  # fmt: skip


def exchanged(parts):
    """The readings of the levels at 25 % of courses 3 and 5."""
    rows = rows_of(parts)
    low, high = ([row for row in rows if row[2] == level] for level in (3.275, 6.575))
    for one, other in zip(low, high, strict=True):
        one[3], other[3] = other[3], one[3]


def few(parts):
    gone = {f"L{i}" for i in range(12) if i % 2}
    for table in ("lines", "offsets"):
        header, *rows = parts.tables[table]
        parts.tables[table] = [header, *(row for row in rows if row[0] not in gone)]


def one_level(parts):
    header, *rows = parts.tables["offsets"]
    parts.tables["offsets"] = [header, *(row for row in rows if row[2] != 7.525)]


def certified(parts):
    parts.registers["instruments"]["ZL"]["u_collimation_arcsec"] = 1.0


def strapped_above(parts):
    girth = 2 * np.pi * (RADII[-1] - 0.012)
    parts.tables["circumferences"].append(["5a", "5", 7.0, girth, 0.3, "T-12"])


def other_side(parts):
    """Two courses are strapped, and the lines are said to stand inside."""
    girth = 2 * np.pi * (RADII[-1] + 1e-4)
    parts.tables["circumferences"].append(["5a", "5", 7.0, girth, 0.3, "T-12"])
    for row in parts.tables["lines"][1:]:
        row[1] = "inside"


def other_sign(parts):
    """Plates as thick as the outside steps: the inside is a cylinder."""
    for row, outer in zip(parts.tables["courses"][1:], RADII, strict=True):
        row[2] = 1000 * (outer - RADII[-1]) + 5.0
    for row in rows_of(parts):
        row[3] = -row[3]


def from_inside(parts):
    """Lines in the tank, to the same inside, that are said to stand outside."""
    other_sign(parts)
    plate_mm = {row[0]: row[2] for row in parts.tables["courses"][1:]}
    for row in rows_of(parts):
        row[3] -= plate_mm[row[1]]


def other_end_of_one(parts):
    for row in rows_of(parts):
        row[3] = 500 - row[3] if row[0] == "L4" else row[3]


def centimetres(parts):
    for row in rows_of(parts):
        row[3] /= 10


def misread_by_a_decimetre(parts):
    """All readings of the strap at the other level of the strapped course."""
    parts.tables["circumferences"].append(["1c", "1", 0.9, 2 * np.pi * RADII[0] + 0.1, 0.3, "T-12"])


def nothing(parts):
    pass


PLANTED = {
    "offset_set_aside": misread,
    "line_moved": moved,
    "line_copied": copied,
    "level_off_axis": exchanged,
    "few_lines": few,
    "few_levels": one_level,
    "collimation_unlike_certificate": certified,
    "strap_against_lines": strapped_above,
    "strap_against_lines by side": other_side,
    "lines_turned_about": other_sign,
    "lines_of_inside": from_inside,
    "line_apart": other_end_of_one,
    "offsets_small": centimetres,
    "straps_apart_by_lines": misread_by_a_decimetre,
}


def told_of(parts, folder):
    result = tankcal.run(tankcal.load(write_folder(folder, parts)), simulated=False)
    return {one.expected.code for one in result.warnings if one.file not in ("job.toml",)}


@pytest.mark.slow
@pytest.mark.parametrize("code", PLANTED)
def test_planted_errors_are_named(tmp_path, code):
    parts = cones(sd_m=3e-4)
    PLANTED[code](parts)
    assert code.split()[0] in told_of(parts, tmp_path)


@pytest.mark.slow
def test_a_nominal_tank_of_another_size_is_refused(tmp_path):
    """Planted: 7.9 m on the drawing of a tank of 10.5 m."""
    parts = cones(sd_m=3e-4)
    parts.settings["tank.nominal_diameter_m"] = 7.9
    with pytest.raises(InputError, match=r"1\.32 to 1"):
        told_of(parts, tmp_path)


@pytest.mark.slow
def test_a_sound_survey_is_not_doubted(tmp_path):
    assert told_of(cones(sd_m=3e-4), tmp_path) <= {"undeclared"}


@pytest.mark.slow
def test_reference_levels_that_are_read_again_are_not_doubted(tmp_path):
    """Readings of 0.5 mm differ by more than 1 mm in one of six pairs, and no instrument moved."""
    parts, rng = cones(sd_m=5e-4), np.random.default_rng(3)
    lowest = min(row[2] for row in rows_of(parts))
    first = [row for row in rows_of(parts) if row[2] == lowest]
    parts.tables["offsets"] += [
        [*row[:3], row[3] + np.sqrt(2) * 0.5 * rng.normal(), *row[4:]] for row in first
    ]
    assert "line_moved" not in told_of(parts, tmp_path)


@pytest.mark.slow
def test_a_shell_that_leans_too_much_is_told(tmp_path):
    assert "leans_too_much" in told_of(cones(lean=(0.03, 0.02)), tmp_path)


# ---- bad input


def no_lines(parts):
    del parts.tables["lines"]


def no_offsets(parts):
    del parts.tables["offsets"]


def no_strap(parts):
    del parts.tables["circumferences"]


def half_a_face(parts):
    rows_of(parts)[0][5] = 1.5


def some_azimuths(parts):
    parts.tables["lines"][0].append("azimuth_deg")
    for place, row in enumerate(parts.tables["lines"][1:]):
        row.append(30.0 * place if place else None)


def same_azimuth(parts):
    parts.tables["lines"][0].append("azimuth_deg")
    for place, row in enumerate(parts.tables["lines"][1:]):
        row.append(30.0 * max(place, 1))


def no_plummet(parts):
    parts.tables["lines"][0].append("instrument")
    for row in parts.tables["lines"][1:]:
        row.append("T-12")


def one_face(parts):
    header, *rows = parts.tables["offsets"]
    parts.tables["offsets"] = [header, *(row for row in rows if row[5] == 1)]


def no_common_level(parts):
    for row in rows_of(parts):
        if row[0] == "L1":
            row[2] += 0.05


def two_references(parts):
    parts.tables["offsets"][0].append("reference")
    for row in rows_of(parts):
        row.append(row[2] in (0.3, 0.9))


def not_at_reference(parts):
    parts.tables["offsets"][0].append("reference")
    for row in rows_of(parts):
        row.append(row[2] == 0.3)
    header, *rows = parts.tables["offsets"]
    gone = [row for row in rows if row[0] != "L2" or row[2] != 0.3]
    parts.tables["offsets"] = [header, *gone]


def on_few_lines(parts):
    header, *rows = parts.tables["offsets"]
    few = ("L1", "L2", "L3")
    parts.tables["offsets"] = [header, *(row for row in rows if row[2] != 7.525 or row[0] in few)]


def strapped_elsewhere(parts):
    header, *rows = parts.tables["offsets"]
    parts.tables["offsets"] = [header, *(row for row in rows if row[1] != "1")]


def other_line(parts):
    rows_of(parts)[3][0] = "L77"


def too_many(parts):
    parts.tables["offsets"] = [*parts.tables["offsets"], *(rows_of(parts) * 9)]


def free_scale(parts):
    parts.registers["instruments"]["ZL"]["u_scale_ppm"] = "free"


BAD = {
    "lines_incomplete": no_lines,
    "lines_incomplete of offsets": no_offsets,
    "lines_without_strap": no_strap,
    "part_of_a_face": half_a_face,
    "line_azimuth_missing": some_azimuths,
    "line_at_same_place": same_azimuth,
    "no_such_plummet": no_plummet,
    "collimation_unknown": one_face,
    "no_reference_level": no_common_level,
    "two_reference_levels": two_references,
    "line_without_reference": not_at_reference,
    "level_of_few_lines": on_few_lines,
    "reference_not_strapped": strapped_elsewhere,
    "no_such_name": other_line,
    "too_many_offsets": too_many,
    "tape_scale_free": free_scale,
}


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("code", BAD)
def test_bad_input_is_told(tmp_path, code):
    parts = cones()
    BAD[code](parts)
    with pytest.raises(InputError) as refused:
        tankcal.load(write_folder(tmp_path, parts))
    found = {one.expected.code for one in refused.value.problems}
    assert code.split()[0] in found, refused.value
    assert all("\n" not in str(one) and "np." not in str(one) for one in refused.value.problems)
