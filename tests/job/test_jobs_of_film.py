"""Jobs read on a comparator: transformed while they are read, told where they cannot be meant."""

import csv
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import EXAMPLE
from job_builder import write_book, write_folder
from messages_told import lines
from spoilt import problems_of
from survey_builder import read_on_comparator, survey_parts

import tankcal
from tankcal.job import load
from tankcal.record.adjustment import adjustment_of, fiducials_of
from tankcal.record.schema import to_plain
from tankcal.report.survey.results import image_coordinates
from tankcal.survey.network_of_survey import gather
from tankcal.text.words import load_words

PHOTOS = EXAMPLE.parent / "silva-1995-photos"
MARKS = {"1": (-84.012, -59.003), "2": (84.007, -58.995), "3": (83.998, 59.011), "4": (-84.0, 59.0)}
UMK, FILES = "UMK 10/1318", "fiducials.csv"


def film_job(folder, mark_sd_um=2.0, seed=1, readings=1):
    """The shipped photographs as a comparator reads them, each turned and shrunk its own way.

    mark_sd_um  of one reading of a mark; image points stay as they are, to the last digit
    """
    rng = np.random.default_rng(seed)
    shutil.copytree(PHOTOS, folder, ignore=shutil.ignore_patterns("truth"))
    with open(folder / "image_points.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    with open(folder / "photos.csv", newline="", encoding="utf-8") as file:
        photos = [row["photo"] for row in csv.DictReader(file)]
    to_comparator = {}
    for photo in photos:
        angle, shrunk = rng.uniform(-0.05, 0.05), 1 + rng.normal(0, 4e-4, (2, 2))
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        matrix, shift = turn * shrunk, rng.uniform(100, 300, 2)
        to_comparator[photo] = lambda xy, m=matrix, s=shift: m @ np.asarray(xy, dtype=float) + s
    lines = ["photo,point,x_mm,y_mm"]
    for row in rows:
        x, y = to_comparator[row["photo"]]((row["x_mm"], row["y_mm"]))
        lines.append(f"{row['photo']},{row['point']},{x:.9f},{y:.9f}")
    (folder / "image_points.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    lines = ["photo,mark,x_mm,y_mm,s_um"]
    for photo in photos:
        for mark, place in MARKS.items():
            for _ in range(readings):
                x, y = to_comparator[photo](place) + rng.normal(0, mark_sd_um / 1000, 2)
                lines.append(f"{photo},{mark},{x:.9f},{y:.9f},{max(mark_sd_um, 0.1)}")
    (folder / FILES).write_text("\n".join(lines) + "\n", encoding="utf-8")
    with open(folder / "cameras.toml", "a", encoding="utf-8") as file:
        file.write("\n[cameras.UMK.marks]\n")
        file.writelines(f"{mark} = [{x}, {y}]\n" for mark, (x, y) in MARKS.items())
    return folder


@pytest.fixture(scope="module")
def plain():
    return tankcal.adjust_job(load(PHOTOS))


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    job = load(film_job(tmp_path_factory.mktemp("film") / "job", readings=5))
    return job, tankcal.adjust_job(job)


@pytest.mark.slow
def test_exact_marks_give_the_same_points(tmp_path, plain):
    """Property: with marks that are read exactly nothing changes but the declared sds, a little."""
    job = load(film_job(tmp_path / "job", mark_sd_um=0.0))
    with open(PHOTOS / "image_points.csv", newline="", encoding="utf-8") as file:
        xy = [[float(row["x_mm"]), float(row["y_mm"])] for row in csv.DictReader(file)]
    np.testing.assert_allclose(job.measurements.image_points.xy_mm, xy, atol=3e-9)
    found = tankcal.adjust_job(job)
    np.testing.assert_allclose(found.xyz_m, plain.xyz_m, atol=2e-6)
    assert found.sigma0 == pytest.approx(plain.sigma0, rel=1e-3)


@pytest.mark.slow
def test_read_on_a_comparator_the_points_agree_within_their_sds(film, plain, figure):
    """Property: marks read five times with 2 um move the points by less than their sds."""
    job, found = film
    assert found.names == plain.names
    sd = np.sqrt(np.einsum("nii->ni", found.covariance_m2))
    away = np.abs(found.xyz_m - plain.xyz_m) / sd
    assert away.max() < 1.5  # the noise of the marks alone, of the images being the same
    growth = sd.mean() / np.sqrt(np.einsum("nii->ni", plain.covariance_m2)).mean()
    assert 1.0 < growth < 1.1
    fits = job.measurements.fiducials
    assert len(fits) == len(job.measurements.photos) == 11
    assert all(1.0 < fit.growth < 1.1 for fit in fits)
    figure("film: largest change of a point in its sd", f"{away.max():.2f}")
    figure("film: growth of the points' sd", f"{growth:.3f}")
    assert not [one for one in job.warnings if one.file == FILES]


def test_the_sd_of_a_transformed_coordinate(film):
    """Second method: own variance plus that of the transformation, once for an averaged point."""
    job, found = film
    images = job.measurements.image_points
    fit = {one.photo: one.transformation for one in job.measurements.fiducials}[images.photo[0]]
    read = np.linalg.solve(fit.matrix, images.xy_mm[0] - fit.shift_mm)
    added = np.diag(fit.parameter_covariance(read[None])[0])
    used = found.adjusted.survey.image_points
    place = (found.adjusted.survey.photos.names.index(images.photo[0]),
             found.adjusted.survey.points.index(images.point[0]))  # fmt: skip
    row = np.flatnonzero((used.photo == place[0]) & (used.point == place[1]))[0]
    own = fit.propagate_sds(np.full((1, 2), 0.005))[0]
    np.testing.assert_allclose(used.sd[row] ** 2, own**2 + added, rtol=1e-9)


def test_readings_repeated_share_the_error_of_the_marks(film):
    """Closed form: four readings halve their own sd, and leave that of the transformation."""
    job, _ = film
    images = job.measurements.image_points
    twice = replace(
        images,
        **{
            name: tuple(np.repeat(np.array(getattr(images, name), dtype=object), 4))
            for name in ("photo", "point", "rows")
        },
        **{
            name: np.repeat(getattr(images, name), 4, axis=0)
            for name in ("xy_mm", "sd_mm", "shared_sd_mm", "check")
        },
    )
    once, four = (
        gather(replace(job.measurements, image_points=one)).survey.image_points.sd
        for one in (images, twice)
    )
    np.testing.assert_allclose(once**2 - four**2, 0.75 * images.sd_mm**2, rtol=1e-9)


def test_the_record_of_a_film_job(film):
    job, found = film
    record = to_plain(adjustment_of(found, job.measurements))
    photos = [one.name for one in job.measurements.photos]
    assert [row["photo"] for row in record["fiducials"]] == photos
    row = record["fiducials"][0]
    assert row["transformation"] == "affine"
    assert row["parameters"] == ["a1", "a2", "a3", "a4", "a5", "a6"]
    assert [mark["n"] for mark in row["marks"]] == [5, 5, 5, 5]
    assert row["redundancy"] == 2 * 20 - 6
    assert 0.5 < row["sigma0"] < 1.6
    assert record["image_readings"] is None
    assert record["depth_of_field"] is None
    assert fiducials_of(()) == []


# --- rejected readings ----------------------------------------------------------------------------


def repeated(scatter_um, limit):
    """The small survey with the points of F1 read four times each; the first with a scatter."""
    parts = read_on_comparator(survey_parts({"adjustment.reading_limit_um": limit}))
    table = parts.tables["image_points"]
    rows = [row for row in table[1:] if row[0] == "F1"]
    for k in (1, 2, 3):
        for i, row in enumerate(rows):
            new = list(row)
            new[2] += (scatter_um if i == 0 else 1.0) / 1000 * (-1) ** k
            table.append(new)
    marks = parts.tables["fiducials"]
    marks += [["F1", "2", marks[2][2] + 0.004, marks[2][3] - 0.004, None], list(marks[2])]
    return parts


def gathered_from(folder, parts):
    return gather(load(write_folder(folder, parts)).measurements)


@pytest.mark.slow
def test_readings_beyond_the_limit_are_rejected_and_listed(tmp_path):
    """Closed form: 0, -s, s, -s has the sample sd s sqrt(11/12)."""
    found = gathered_from(tmp_path / "a", repeated(20.0, 8.0))
    repeats = found.repeats
    (one,) = repeats.rejected
    assert (one.photo, one.name, one.count) == ("F1", "W1", 4)
    np.testing.assert_allclose(one.sd_mm, [0.020 * np.sqrt(11 / 12), 0], atol=1e-6)
    assert (len(repeats.point), repeats.limit_mm) == (8, 0.008)
    seen = found.survey.image_points
    at = (found.survey.photos.names.index("F1"), found.survey.points.index("W1"))
    assert not np.any((seen.photo == at[0]) & (seen.point == at[1]))
    (told,) = [w for w in found.warnings if "rejected" in w.expected]
    assert "4 readings of point W1 in photo F1" in told.expected
    assert "19.1 um" in told.expected
    assert gathered_from(tmp_path / "b", repeated(20.0, None)).repeats.rejected == ()
    assert gathered_from(tmp_path / "c", repeated(8.0, 8.0)).repeats.rejected == ()


def test_marks_beyond_the_limit_are_rejected_and_listed(tmp_path):
    parts = repeated(1.0, 2.0)
    job = load(write_folder(tmp_path / "job", parts))
    (told,) = [one for one in job.warnings if "rejected" in one.expected]
    assert (told.file, told.row) == (FILES, 3)
    assert "3 readings of mark '2' of photo 'F1'" in told.expected
    fit = job.measurements.fiducials[0]
    assert fit.marks == ("1", "3", "4")
    (one,) = fit.rejected
    np.testing.assert_allclose(one.sd_mm, 0.004 / np.sqrt(3), rtol=1e-9)
    assert any("cannot be detected" in one.expected for one in job.warnings)


# --- film that is not flat, focus -----------------------------------------------------------------


def test_film_moves_image_points_outwards_where_it_rises(tmp_path):
    """Closed form: x' = x c/(c - h) from the principal point."""
    parts = survey_parts()
    before = load(write_folder(tmp_path / "a", parts)).measurements.image_points
    places = [(-90, -65), (90, -65), (90, 65), (-90, 65)]
    parts.tables["film"] = [["camera", "photo", "x_mm", "y_mm", "height_um"]]
    parts.tables["film"] += [[UMK, None, float(x), float(y), 50.0] for x, y in places]
    parts.tables["film"] += [[None, "F2", float(x), float(y), -30.0] for x, y in places]
    after = load(write_folder(tmp_path / "b", parts)).measurements.image_points
    height = np.array([{"F2": -0.03, "D1": 0.0}.get(photo, 0.05) for photo in before.photo])
    factor = (100.12 / (100.12 - height))[:, None]
    middle = np.array([[0.0, 0.0] if photo == "D1" else [0.013, -0.02] for photo in before.photo])
    expected = middle + (before.xy_mm - middle) * factor
    np.testing.assert_allclose(after.xy_mm, expected, atol=1e-12)


FOCUS = {
    "focus_m": 8.0,
    "lens_focal_length_mm": 99.0,
    "focus_calibrations.distance_m": [5.0, 25.0],
    "focus_calibrations.K1_mm-2": [1.1e-7, 1.4e-7],
}


def focused(changes=None, settings=None):
    """The small survey with a camera whose distortion is known at two distances."""
    parts = survey_parts({"adjustment.camera.K1": None} | (settings or {}))
    camera = parts.registers["cameras"][UMK]
    for key in ("K1_mm-2", "s_K1", "radial_balance_mm"):
        del camera[key]
    camera |= FOCUS | (changes or {})
    for key in [key for key, value in camera.items() if value is None]:
        del camera[key]
    return parts


def test_a_camera_with_two_focus_calibrations(tmp_path):
    parts = focused(settings={"adjustment.depth_of_field": True})
    found = load(write_folder(tmp_path / "job", parts)).measurements
    lens = found.cameras[0].lens
    assert (lens.focus_mm, lens.focal_length_mm, lens.distances_mm.tolist()) == (
        8e3,
        99,
        [5e3, 25e3],
    )
    assert found.cameras[0].camera.values[3] == lens.radial_in_focus[0]
    assert 1.1e-7 < lens.radial_in_focus[0] < 1.4e-7
    assert found.cameras[1].lens is None
    assert found.settings.depth_of_field
    same = load(write_book(tmp_path / "job.xlsx", parts)).measurements.cameras[0].lens
    np.testing.assert_array_equal(same.radial, lens.radial)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"focus_m": None}, "focus_m", "missing, but focus_calibrations"),
        ({"lens_focal_length_mm": None}, "lens_focal_length_mm", "missing, but"),
        ({"focus_calibrations.K1_mm-2": None, "focus_calibrations.K2_mm-4": None},
         "focus_calibrations.distance_m", None),
        ({"focus_calibrations.K1_mm-2": [1e-7]}, "focus_calibrations.K1_mm-2", "1 numbers"),
        ({"focus_calibrations.distance_m": [5.0, 5.0]}, "focus_calibrations.distance_m", "twice"),
        ({"focus_m": 0.099}, "focus_m", "expected metres"),
        ({"lens_focal_length_mm": 9.9}, "lens_focal_length_mm", "expected about the same"),
        ({"K1_mm-2": 1e-7}, "K1_mm-2", "given together with focus_calibrations"),
        ({"radial_balance_mm": 60.0}, "radial_balance_mm", "cannot be used with focus_"),
        ({"convention": None}, "convention", "missing, but"),
        ({"focus_calibrations.K9": [1e-7, 2e-7]}, "focus_calibrations.K9", "unknown key"),
        ({"focus_calibrations.distance_m": "near"}, "focus_calibrations.distance_m", "near"),
    ],
)  # fmt: skip
def test_impossible_focus_calibrations(tmp_path, changes, key, words):
    problems = problems_of(write_folder(tmp_path / "job", focused(changes)))
    if words is None:
        key, words = "focus_calibrations.K1_mm-2", "missing; expected K1 at both distances"
    told = [one for one in problems if one.column == f"{UMK}.{key}"]
    assert told, problems
    assert any(words in one.expected for one in told)
    assert {one.file for one in problems} == {"cameras.toml"}


def test_depth_of_field_without_focus_calibrations(tmp_path):
    parts = survey_parts({"adjustment.depth_of_field": True})
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert problem.column == "adjustment.depth_of_field"


# --- what cannot be meant -------------------------------------------------------------------------


def spoilt(change):
    parts = read_on_comparator(survey_parts())
    change(parts)
    return parts


def _marks(parts):
    return parts.tables["fiducials"]


def _exchanged(parts):
    rows = _marks(parts)
    rows[1][2:4], rows[2][2:4] = rows[2][2:4], rows[1][2:4]


def _column(parts, name, column, value):
    for row in parts.tables[name][1:]:
        row[column] = value(row[column])


CAMERA = "cameras"
PROBLEMS = {
    "unknown photo": (lambda p: _marks(p)[1].__setitem__(0, "F9"), FILES, 2, "found 'F9'"),
    "unknown mark": (lambda p: _marks(p)[1].__setitem__(1, "7"), FILES, 2, "found '7'"),
    "nan": (lambda p: _marks(p)[1].__setitem__(2, "nan"), FILES, 2, "found 'nan'"),
    "micrometres": (lambda p: [_column(p, "fiducials", c, lambda v: 1000 * v) for c in (2, 3)],
                    FILES, 2, "expected"),
    "centimetres": (lambda p: [_column(p, "fiducials", c, lambda v: v / 10) for c in (2, 3)],
                    FILES, 2, "0.1 times as large"),
    "exchanged": (_exchanged, FILES, 2, "fit when '1' and '2' are exchanged"),
    "misread": (lambda p: _marks(p)[1].__setitem__(2, -80.0), FILES, 2, "most of all"),
    "too few": (lambda p: [_marks(p).pop(1) for _ in range(2)], FILES, 2, "has 2 marks"),
    "no marks": (lambda p: [p.registers[CAMERA][UMK].pop(f"marks.{k}") for k in "1234"],
                 FILES, 2, "has none in cameras.toml"),
    "a photo without": (lambda p: [_marks(p).pop(1) for _ in range(4)],
                        "image_points.csv", 2, "has no marks in fiducials.csv"),
    "three numbers": (lambda p: p.registers[CAMERA][UMK].__setitem__("marks.1", [1.0, 2.0, 3.0]),
                      "cameras.toml", None, "3 numbers; expected two"),
    "the same place": (lambda p: p.registers[CAMERA][UMK].__setitem__("marks.2", [-84.0, -59.0]),
                       "cameras.toml", None, "at the same place as mark '1'"),
    "formula": (lambda p: _marks(p)[1].__setitem__(1, "=1+1"), FILES, 2, "=1+1"),
    "film of nobody": (lambda p: _column(p, "film", 0, lambda v: None), "film.csv", None, "camera"),
    "film of both": (lambda p: _column(p, "film", 1, lambda v: "D1"), "film.csv", 2, "both given"),
    "film on a line": (lambda p: _column(p, "film", 3, lambda v: 0.0), "film.csv", 2, "3 or more"),
    "film of few": (lambda p: p.tables["film"].__delitem__(slice(3, 5)), "film.csv", 2, "3 or"),
    "unknown film": (lambda p: _column(p, "film", 0, lambda v: "E"), "film.csv", 2, "found 'E'"),
}  # fmt: skip


@pytest.mark.slow(after=6)
@pytest.mark.parametrize("name", PROBLEMS)
def test_impossible_values_are_reported(tmp_path, name):
    change, file, row, words = PROBLEMS[name]
    problems = problems_of(write_folder(tmp_path / "job", spoilt(change)))
    told = [one for one in problems if words in one.expected]
    assert told, [str(one) for one in problems]
    assert told[0].file == file
    assert row is None or told[0].row == row
    if name not in ("micrometres", "a photo without", "three numbers", "film of few"):
        assert len(problems) <= 4


def test_pixels_in_a_photo_with_marks(tmp_path):
    parts = read_on_comparator(survey_parts())
    parts.registers["cameras"]["D"] |= {"marks.1": [-11.0, -7.0], "marks.2": [11.0, -7.0],
                                        "marks.3": [11.0, 7.0]}  # fmt: skip
    marks = ((-11.0, -7.0), (11.0, -7.0), (11.0, 7.0))
    parts.tables["fiducials"] += [["D1", str(i + 1), *xy, None] for i, xy in enumerate(marks)]
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert all("in pixels, in a photo whose marks are read" in one.expected for one in problems)


def test_an_sd_is_needed(tmp_path):
    parts = read_on_comparator(survey_parts({"adjustment.image_sd_um": None}))
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert any("rows of fiducials.csv without s_um" in one.expected for one in problems)


def test_image_points_are_checked_in_the_photo_system(tmp_path):
    """A comparator whose zero is far away: nothing is outside the format but what is."""
    parts = read_on_comparator(survey_parts())
    for name, of in (("fiducials", ("F1", "F2", "F3")), ("image_points", ("F1", "F2", "F3"))):
        for row in parts.tables[name][1:]:
            if row[0] in of:
                row[2], row[3] = row[2] + 300.0, row[3] - 200.0
    job = load(write_folder(tmp_path / "a", parts))
    plain = load(write_folder(tmp_path / "b", survey_parts())).measurements.image_points
    np.testing.assert_allclose(job.measurements.image_points.xy_mm, plain.xy_mm, atol=1e-10)
    parts.tables["image_points"][1][2] = 300.0 + 95.0
    (problem,) = problems_of(write_folder(tmp_path / "c", parts))
    assert (problem.row, problem.column) == (2, "x_mm")
    assert "found 95, outside the format" in problem.expected
    assert "after the transformation" in problem.expected


def warnings_of(folder, parts, file=FILES):
    warnings = load(write_folder(folder, parts)).warnings
    return lines([one for one in warnings if one.file == file])


@pytest.mark.slow
def test_warnings_about_marks(tmp_path):
    assert warnings_of(tmp_path / "sound", read_on_comparator(survey_parts())) == []
    parts = read_on_comparator(survey_parts())
    _column(parts, "fiducials", 2, lambda v: -v)
    _column(parts, "image_points", 2, lambda v: None if v is None else -v)
    (mirrored,) = warnings_of(tmp_path / "a", parts)
    assert "photos F1, F2, F3 were read mirrored" in mirrored
    parts = read_on_comparator(survey_parts())
    _marks(parts)[1][2] += 0.1
    (poor,) = warnings_of(tmp_path / "b", parts)
    assert "which mark it is cannot be told" in poor  # four marks of an affine: all alike
    assert "times worse than their standard deviations say" in poor
    parts = read_on_comparator(survey_parts())
    _column(parts, "fiducials", 4, lambda v: 25.0)
    (grown,) = warnings_of(tmp_path / "c", parts)
    assert "the sd of image coordinates up to" in grown
    parts = survey_parts()
    parts.registers["cameras"][UMK]["marks.1"] = [1.0, 2.0]
    (unused,) = warnings_of(tmp_path / "d", parts, "cameras.toml")
    assert "without effect" in unused


def test_a_mirrored_plate_with_a_similarity(tmp_path):
    parts = read_on_comparator(survey_parts())
    parts.registers["cameras"][UMK]["fiducial_transformation"] = "similarity"
    _column(parts, "fiducials", 2, lambda v: -v)
    problems = problems_of(write_folder(tmp_path / "job", parts))
    assert len(problems) == 3
    assert all("fit mirrored" in one.expected for one in problems)


def test_the_workbook_gives_the_same(tmp_path):
    parts = read_on_comparator(survey_parts())
    folder, book = write_folder(tmp_path / "job", parts), write_book(tmp_path / "job.xlsx", parts)
    one, other = (load(path).measurements for path in (folder, book))
    np.testing.assert_array_equal(one.image_points.xy_mm, other.image_points.xy_mm)
    np.testing.assert_array_equal(one.image_points.shared_sd_mm, other.image_points.shared_sd_mm)
    assert [fit.marks for fit in one.fiducials] == [fit.marks for fit in other.fiducials]


def test_the_working_papers_show_readings_and_marks(tmp_path):
    """What the report says stands in the record: marks, rejected readings, depth of field."""
    record = {
        "adjustment": {
            "image_readings": {
                "points": 2,
                "readings": 8,
                "mean_sd_x_um": 2.04,
                "mean_sd_y_um": 3.0,
                "limit_um": 8.0,
                "rejected": [
                    {"photo": "F1", "point": "W1", "n": 4, "sd_x_um": 9.1, "sd_y_um": 1.0, "row": 7}
                ],
            },
            "fiducials": [],
            "depth_of_field": {
                "rounds": 3, "last_change_um": 1e-4, "largest_um": 16.3, "rms_um": 4.6, "left": 0
            },
        }
    }  # fmt: skip
    folder = film_job(tmp_path / "job", readings=2)
    job = load(folder)
    record["adjustment"]["fiducials"] = to_plain(fiducials_of(job.measurements.fiducials))
    paper = SimpleNamespace(
        record=record,
        paragraph=lambda name, **values: (name, values),
        number=lambda value, *_, **__: f"{value:.3g}",
        table=lambda name, rows, columns, **values: (
            name,
            rows,
            [one.heading or one.key for one in columns],
        ),
    )
    found = {block[0]: block for block in image_coordinates(paper)}
    assert list(found) == ["repeated_readings", "rejected_readings", "fiducials", "depth_of_field"]
    assert len(found["fiducials"][1]) == 11
    worst = [row["largest_um"] for row in found["fiducials"][1]]
    assert worst == sorted(worst, reverse=True)
    words = load_words("en")
    for name, _, columns in (found["rejected_readings"], found["fiducials"]):
        assert name in words["captions"]
        assert words["table_headings"].keys() >= set(columns)
    for name in ("repeated_readings", "no_reading_limit", "no_rejected_readings", "depth_of_field"):
        assert name in words["texts"]
