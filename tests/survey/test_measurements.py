"""A survey comes out in SI, the same from a folder and from a workbook.

The truth is what the test wrote into the files, converted by hand.
"""

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from job_builder import assert_same_job, write_book, write_folder
from survey_builder import PLACES, WALL, dms, length, read_on_comparator, survey_parts

from tankcal.job import load
from tankcal.job.field_values import read_value
from tankcal.job.fields import Field, Refused
from tankcal.job.tables import SURVEY_TABLES

DEGREE = np.pi / 180


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """The Measurements of the full survey."""
    folder = write_folder(tmp_path_factory.mktemp("survey") / "job", survey_parts())
    return load(folder).measurements


def table_of(survey, name):
    """The Readings of one table."""
    return next(readings for readings in survey.readings if readings.table == name)


@pytest.mark.parametrize("tank", [True, False])
def test_folder_and_workbook_give_the_same_survey(tmp_path, tank):
    only = None if tank else "adjustment"
    parts = read_on_comparator(survey_parts(tank=tank))
    base = np.hypot(*np.subtract(PLACES["S2"], PLACES["S1"])[:2])
    parts.registers["instruments"]["bar"] = {"kind": "stadia", "length_m": 2.0, "u_mm": 0.02}
    parts.tables["stadia"] = [
        ["setup", "to", "bar", "angle_deg", "s_arcsec"],
        ["1", "S2", "bar", float(np.degrees(2 * np.arctan(1 / base))), 1.0],
    ]
    folder = load(write_folder(tmp_path / "job", parts), only=only)
    assert_same_job(folder, load(write_book(tmp_path / "job.xlsx", parts), only))
    assert folder.warnings == ()
    read = {file.file for file in folder.files}
    assert {f"{table}.csv" for table in SURVEY_TABLES} <= read
    assert {"cameras.toml", "instruments.toml"} <= read


def test_decimal_commas_give_the_same_survey(tmp_path):
    commas = {"csv.separator": ";", "csv.decimal": ","}
    one = load(write_folder(tmp_path / "a", survey_parts()))
    assert_same_job(one, load(write_folder(tmp_path / "b", survey_parts(commas))))


def test_settings(survey):
    settings = survey.settings
    assert (settings.datum, settings.datum_points, settings.fixed_photo) == ("control", (), None)
    assert (settings.image_sd_mm, settings.refraction) == (0.005, 0.13)
    assert (settings.snooping, settings.scale) == (True, "a_priori")
    assert (survey.nominal.radius_m, survey.nominal.height_m) == (6.5, 9.5)
    assert survey.nominal.bottom_z_m == 0.0


def test_datum_points_with_axes(tmp_path):
    points = {"adjustment.datum": "minimal", "adjustment.datum_points": ["W1", "W2:yx", "W4:x"]}
    job = load(write_folder(tmp_path / "job", survey_parts(points)))
    assert job.measurements.settings.datum_points == (("W1", "xyz"), ("W2", "xy"), ("W4", "x"))
    text = points | {"adjustment.datum_points": "W1; W2:yx; W4:x"}
    assert_same_job(job, load(write_book(tmp_path / "job.xlsx", survey_parts(text))))


def test_a_photo_holds_the_datum(tmp_path):
    photo = {"adjustment.datum": "fixed_photo", "adjustment.fixed_photo": "F1"}
    settings = load(write_folder(tmp_path / "job", survey_parts(photo))).measurements.settings
    assert (settings.datum, settings.fixed_photo) == ("fixed_photo", "F1")


def test_cameras(survey):
    film, digital = survey.cameras
    assert (film.camera.name, digital.camera.name) == ("UMK 10/1318", "D")
    expected = [100.12, 0.013, -0.02, 1.1e-7, 0, 0, 0, -2e-6, 0, 0, 0, 1e-4, 0]
    np.testing.assert_array_equal(film.camera.values, expected)
    assert film.camera.form.convention == "correction_added"
    assert (film.camera.form.affinity, film.camera.form.radial_balance_mm) == ("both_y", 60.0)
    assert digital.camera.form.affinity == "b1_b2"
    np.testing.assert_array_equal(film.format_mm, [180, 130])
    assert film.pixel_mm is None
    np.testing.assert_allclose(digital.format_mm, [24, 16])
    np.testing.assert_allclose(digital.pixel_mm, [0.004, 0.004])


def test_adjusted_parameters_of_a_camera(survey):
    camera = survey.cameras[0].camera
    scope = ["camera"] * 3 + ["block", "camera", "off", "off"] + ["camera"] * 2 + ["off"] * 2
    assert camera.scope == (*scope, "camera", "camera")
    assert camera.state[:4] == ("free", "free", "free", "weighted")
    assert camera.state[11:] == ("fixed", "free")
    assert camera.sd[3] == 1e-9
    assert np.isnan(np.delete(camera.sd, 3)).all()


@pytest.mark.parametrize(
    ("settings", "camera", "name", "scope", "state", "value"),
    [
        ({}, {}, 0, "camera", "free", 100.12),
        ({"default": "block free"}, {}, 0, "block", "free", 100.12),
        ({"default": "block free"}, {"K4_mm-8": 1e-18}, 6, "camera", "fixed", 1e-18),
        ({"default": "off"}, {}, 0, "camera", "fixed", 100.12),
        ({"c": "photo free"}, {}, 0, "photo", "free", 100.12),
        ({"c": "camera weighted"}, {"s_c_mm": 0.01}, 0, "camera", "weighted", 100.12),
        ({}, {"s_c_mm": 0.0}, 0, "camera", "fixed", 100.12),
        ({"K4": "camera free"}, {}, 6, "camera", "free", 0.0),
        ({"b1": "photo weighted"}, {"s_b1": 1e-5}, 11, "photo", "weighted", 0.0),
        ({}, {"b2": 2e-5}, 12, "camera", "free", 2e-5),
        ({"A": "camera fixed"}, {"A": 2e-5, "affinity": "both_x"}, 11, "camera", "fixed", 2e-5),
    ],
)
def test_scope_and_state(tmp_path, settings, camera, name, scope, state, value):
    given = {f"adjustment.camera.{key}": wanted for key, wanted in settings.items()}
    parts = survey_parts(dict.fromkeys(OWN_KEYS) | given)
    parts.registers["cameras"]["UMK 10/1318"] = {
        "format_mm": [180.0, 130.0],
        "c_mm": 100.12,
        "convention": "correction_subtracted",
    } | camera
    parts.registers["cameras"]["D"]["s_c_mm"] = 0.01
    parts.registers["cameras"]["D"]["s_b1"] = 1e-5
    found = load(write_folder(tmp_path / "job", parts)).measurements.cameras[0].camera
    assert (found.scope[name], found.state[name], found.values[name]) == (scope, state, value)


OWN_KEYS = [f"adjustment.camera.{key}" for key in ("default", "K3", "K1", "A")]


def test_photos(survey):
    first, second, third, digital = survey.photos
    assert [photo.name for photo in survey.photos] == ["F1", "F2", "F3", "D1"]
    assert (first.camera, digital.camera, first.row) == ("UMK 10/1318", "D", 2)
    angles = [90 * DEGREE, 90 * DEGREE, 0.5 * DEGREE]  # phi is given as 100 gon
    np.testing.assert_allclose(first.values, [20.0, 1.0, 1.6, *angles])
    np.testing.assert_allclose(first.sd, [0, np.nan, np.nan, 0.01 * DEGREE, 0, np.nan])
    assert np.isnan(second.values[3:]).all()
    assert second.sd[0] == 0.05
    assert np.isnan(third.values).all()
    assert digital.values[4] == pytest.approx(45 * DEGREE)


def test_image_points(survey):
    images = survey.image_points
    assert (images.photo[0], images.point[0], len(images.rows)) == ("F1", "W1", 32)
    np.testing.assert_allclose(images.sd_mm[0], [0.003, 0.004])
    assert np.isnan(images.sd_mm[24]).all()  # carries none: image_sd_um is for it
    np.testing.assert_allclose(images.sd_mm[25], 0.5 * 0.004)  # pixels
    # closed form: the middle of 6000 x 4000 pixels lies at column 2999.5, line 1999.5
    np.testing.assert_allclose(images.xy_mm[24], [-2999.5 * 0.004, 1999.5 * 0.004])
    np.testing.assert_allclose(images.xy_mm[25], [-2299.5 * 0.004, (1999.5 - 450.25) * 0.004])
    assert [images.point[place] for place in np.flatnonzero(images.check)] == ["W8"] * 3


def test_known_points(survey):
    control, check = survey.control, survey.check
    assert control.point == ("W1", "W2", "W3", "W4", "W1")
    np.testing.assert_allclose(control.xyz_m[0], PLACES["W1"])
    np.testing.assert_allclose(control.sd_m[0], [0.001, 0.001, 0.002])
    np.testing.assert_array_equal(np.isnan(control.xyz_m[3]), [False, True, False])
    np.testing.assert_array_equal(control.sd_m[3], [0, np.nan, np.nan])
    assert control.system == (None, None, None, None, "plant")
    assert (control.check.any(), check.check.all(), check.point) == (False, True, ("W5",))
    assert np.isnan(check.sd_m).all()


def test_targets(survey):
    assert survey.targets.point == tuple(WALL)
    assert (survey.targets.section[0], survey.targets.generatrix[3]) == ("R1", "G3")
    np.testing.assert_allclose(survey.targets.z_m, 1.0 + np.arange(8))
    np.testing.assert_allclose(survey.targets.offset_m, [0.0] + [0.0025] * 7)


def test_instruments_and_setups(survey):
    tape, total = survey.instruments
    assert (tape.name, tape.kind, total.kind) == ("tape 1", "tape", "total_station")
    assert (tape.correction, tape.correction_m) == (2e-5, pytest.approx(-0.0003))
    assert (tape.certified_temperature_c, tape.expansion_per_k) == (20.0, 1.15e-5)
    assert tape.u_scale == pytest.approx(15e-6)
    assert np.isnan(tape.u_offset_m)
    assert (total.u_scale, total.u_offset_m) == (pytest.approx(2e-6), pytest.approx(0.0005))
    assert tape.details == {"certificate": "C-17", "tension_n": 50.0}
    one, two = survey.setups
    assert (one.name, one.station, one.instrument, one.height_m) == ("1", "S1", "TS", 1.55)
    assert (two.instrument, two.height_m) == (None, 0.0)


def test_an_instrument_of_another_kind(tmp_path):
    parts = survey_parts()
    parts.registers["instruments"]["TS"]["kind"] = "laser tracker"
    tool = load(write_folder(tmp_path / "job", parts)).measurements.instruments[1]
    assert (tool.kind, tool.details) == ("other", {"kind": "laser tracker"})


def test_distances(survey):
    distances = table_of(survey, "distances")
    np.testing.assert_allclose(distances.value[:2] - length("W1", "W2"), [0, 1e-4], atol=1e-12)
    np.testing.assert_allclose(distances.sd, [0.001, 0.001, 0.002])
    assert (distances.start, distances.end) == (("W1", "W2", "S1"), ("W2", "W1", "S2"))
    assert distances.horizontal.tolist() == distances.check.tolist() == [False, False, True]
    assert distances.instrument == ("tape 1", "tape 1", None)
    np.testing.assert_array_equal(distances.temperature_c, [24.5, 24.5, np.nan])
    assert (distances.file, distances.rows) == ("distances.csv", (2, 3, 4))


def test_sights_from_setups(survey):
    slopes = table_of(survey, "slope_distances")
    assert (slopes.setup[0], slopes.end[0], slopes.start[0]) == ("1", "W1", None)
    assert slopes.target_height_m[:2].tolist() == [0.02, 0.0]
    directions = table_of(survey, "directions")
    assert (set(directions.set), directions.sd[0]) == ({"a"}, pytest.approx(3 * DEGREE / 3600))
    zeniths = table_of(survey, "zenith_angles")
    dx, dy, dz = np.subtract(PLACES["W1"], PLACES["S1"])
    assert zeniths.value[0] == pytest.approx(np.arctan2(np.hypot(dx, dy), dz), abs=1e-14)


def test_angles_in_every_unit(survey):
    dx, dy, dz = np.subtract(PLACES["W3"], PLACES["S1"])
    vertical = table_of(survey, "vertical_angles")
    assert vertical.value[0] == pytest.approx(np.arctan2(dz, np.hypot(dx, dy)), abs=1e-14)
    dx, dy, _ = np.subtract(PLACES["S2"], PLACES["S1"])
    azimuths = table_of(survey, "azimuths")
    assert azimuths.value[0] == pytest.approx(np.arctan2(dx, dy) % (2 * np.pi), abs=1e-11)
    angle = table_of(survey, "horizontal_angles")
    assert (angle.start, angle.origin, angle.end) == (("S1",), ("W1",), ("W2",))


def test_heights_and_plumb_lines(survey):
    heights = table_of(survey, "height_differences")
    assert (heights.value[0], heights.sd[0]) == (pytest.approx(-0.6), 0.0005)
    plumb = table_of(survey, "plumb_lines")
    assert (plumb.value.tolist(), plumb.sd[0]) == ([0.0], pytest.approx(0.0003))


def test_the_adjustment_alone_needs_no_tank(tmp_path):
    job = load(write_folder(tmp_path / "job", survey_parts(tank=False)), only="adjustment")
    assert (job.tank, job.survey, job.datum, job.table) == (None,) * 4
    assert (job.courses, job.points, job.measurements.nominal) == ((), None, None)
    with pytest.raises(ValueError, match="expected 'adjustment'"):
        load(tmp_path / "job", only="volumes")


def test_adjustment_alone_reads_an_incomplete_tank(tmp_path):
    parts = survey_parts({"tank.id": "T-9", "tank.kind": "vertical"}, tank=False)
    job = load(write_folder(tmp_path / "job", parts), only="adjustment")
    assert (job.tank.id, job.survey, job.datum.bottom_z_m) == ("T-9", None, None)
    assert job.measurements.nominal is None
    full = load(write_folder(tmp_path / "full", survey_parts()), only="adjustment")
    whole = load(tmp_path / "full")
    assert all(one.is_default for one in whole.inputs)  # assumed of a whole tank only
    assert_same_job(full, replace(whole, inputs=()))


@pytest.mark.parametrize(
    "settings",
    [
        {"tank.kind": "vertical", "bottom.form": "points", "roof.mass_kg": 1e4},
        {"tank.kind": "horizontal", "horizontal.end_a": "conical"},
        {"tank.kind": "sphere", "datum.dip_plate_z_m": 0.1, "table.fine_step_m": 0.1},
    ],
)
def test_the_adjustment_alone_of_a_tank_that_is_not_whole(tmp_path, settings):
    job = load(write_folder(tmp_path / "job", survey_parts(settings, tank=False)), "adjustment")
    assert (job.table, job.bottom.form, job.roof, job.mesh) == (None, "flat", None, None)
    assert len(job.measurements.readings) == 10


def test_a_sphere_may_be_surveyed(tmp_path):
    parts = survey_parts(tank=False)
    parts.settings |= {
        "tank.id": "B-1",
        "tank.kind": "sphere",
        "survey.side": "inside",
        "survey.date": "2024-05-31",
        "table.step_m": 0.1,
        "table.reference_temperature_c": 20.0,
    }
    job = load(write_folder(tmp_path / "job", parts))
    assert (job.tank.kind, job.datum.bottom_z_m, job.sphere.diameter_m) == ("sphere", None, None)


def test_files_of_headings_alone_count_as_not_there(tmp_path):
    parts = survey_parts()
    parts.tables = {
        name: rows[:1] if name in SURVEY_TABLES else rows for name, rows in parts.tables.items()
    }
    parts.tables["distances"] = survey_parts().tables["distances"]
    measured = load(write_folder(tmp_path / "job", parts)).measurements
    assert [readings.table for readings in measured.readings] == ["distances"]
    assert (measured.photos, measured.image_points, measured.control) == ((), None, None)


DMS = Field("a_dms", "dms", "an angle", low=-360, high=360)


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("123 04 05.6", 123 + 4 / 60 + 5.6 / 3600),
        ("123-04-05.6", 123 + 4 / 60 + 5.6 / 3600),
        ("123°04'05.6\"", 123 + 4 / 60 + 5.6 / 3600),
        ("123° 04′ 05.6″", 123 + 4 / 60 + 5.6 / 3600),
        ("123º04’05.6''", 123 + 4 / 60 + 5.6 / 3600),
        ("-0 30 00", -0.5),
        ("+7 30", 7.5),
        ("7°30'", 7.5),
        ("7 30 36,5", 7.5 + 36.5 / 3600),
        ("359 59 59.999", 360 - 0.001 / 3600),
    ],
)
def test_degrees_minutes_seconds(text, degrees):
    assert read_value(DMS, text, ".") == pytest.approx(degrees, abs=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "123.5",
        "123",
        "1 60 00",
        "1 00 60",
        "1:02:03",
        "１ 02 03",
        "1 2 3 4",
        "-400 00 00",
        "1_0 2 3",
        "1 -2 3",
        "nan",
        "1.5 2 3",
        123.0405,
    ],
)
def test_values_that_are_not_angles(text):
    with pytest.raises(Refused, match="such as 123 04 05"):
        read_value(DMS, text, ".")


@pytest.mark.slow
@given(st.floats(-359.9, 359.9))
def test_an_angle_survives_being_written(degrees):
    # property: written to 1e-6 seconds and read again, to half of that
    assert read_value(DMS, dms(degrees), ".") == pytest.approx(degrees, abs=2e-10)


@pytest.mark.study
def test_55_000_image_points_are_read(tmp_path, figure):
    parts = survey_parts()
    rng = np.random.default_rng(3)
    xy = rng.uniform(-60, 60, (55_000, 2)).round(5).tolist()
    rows = [["F1", f"P{i % 3000}x", x, y, 3.0, 3.0] for i, (x, y) in enumerate(xy)]
    parts.tables["image_points"] = [["photo", "point", "x_mm", "y_mm", "sx_um", "sy_um"], *rows]
    folder = write_folder(tmp_path / "job", parts)
    start = time.perf_counter()
    job = load(folder)
    seconds = time.perf_counter() - start
    figure("55 000 image points read and checked, s", f"{seconds:.2f}")
    np.testing.assert_array_equal(job.measurements.image_points.xy_mm, xy)
