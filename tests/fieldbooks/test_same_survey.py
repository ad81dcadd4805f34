"""One survey, written in every format and unit by `written_fieldbooks`, is the same job.

Truth: the numbers of the survey itself, to the rounding of each format.
"""

import csv
from dataclasses import replace

import numpy as np
import pytest
from page_figures import figures_of
from simulated_fieldbooks import base_job, one_stand, two_stands
from written_fieldbooks import PROFILE, WRITERS, gsi, jobxml, rw5, sdr

import tankcal
from tankcal.cli import main
from tankcal.products.fieldbooks.importing import Choices, import_fieldbooks

TIES = {"targets_mm": 1.0, "targets_arcsec": 3.0}
ARCSEC = 1 / 3600


def imported(tmp_path, text, name="book.txt", **choices):
    """{table: rows as dicts} of a text of a field book."""
    path, out = tmp_path / name, tmp_path / "job"
    path.write_text(text, encoding="utf-8", newline="")
    if name.endswith(".csv"):
        (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
        choices["profile"] = tmp_path / "profile.toml"
    import_fieldbooks([path], out, Choices(**choices), replace_tables=True)
    return {one.stem: list(csv.DictReader(one.open(encoding="utf-8"))) for one in out.iterdir()}


def numbers(rows, *columns):
    return np.array([[float(row[one]) for one in columns] for row in rows])


def hits_of(survey):
    """(n, 3) direction, zenith angle, distance of the hits."""
    return np.array(
        [[one.direction, one.zenith, one.distance] for stand in survey for one in stand.aims
         if one.code]
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "arcsec", "mm"),
    [("gsi", 0.02, 0.006), ("rw5", 0.006, 0.002), ("jxl", 1e-3, 0.002), ("sdr", 1e-3, 0.002),
     ("csv", 0.001, 0.006)],
)  # fmt: skip
def test_each_format_gives_what_was_measured(tmp_path, name, arcsec, mm):
    survey = two_stands()
    tables = imported(tmp_path, WRITERS[name](survey), f"book.{name}", **TIES)
    found = numbers(tables["wall_hits"], "direction_deg", "zenith_deg", "distance_m")
    truth = hits_of(survey)
    np.testing.assert_allclose(found[:, :2], truth[:, :2], rtol=0, atol=arcsec * ARCSEC)
    np.testing.assert_allclose(found[:, 2], truth[:, 2], rtol=0, atol=mm / 1000)
    assert [one["setup"] for one in tables["wall_hits"]] == ["1"] * 96 + ["2"] * 96
    assert [one["instrument_height_m"] for one in tables["setups"]] == ["1.500", "1.500"]
    assert {one["to"] for one in tables["directions"]} == {"T1", "T2", "T3", "T4"}
    assert {one["target_height_m"] for one in tables["slope_distances"]} == {"0.100"}
    if name != "csv":
        xyz = numbers(tables["control"], "x_m", "y_m", "z_m")
        np.testing.assert_allclose(xyz, [[0.2, 0.1, 0], [-1, 1.2, 0.05]], rtol=0, atol=6e-6)


@pytest.mark.slow(after=8)
@pytest.mark.parametrize("width", [8, 16])
@pytest.mark.parametrize(
    ("length", "mm"), [("0", 0.5), ("1", 0.1524), ("6", 0.05), ("7", 0.01524), ("8", 0.005)]
)
@pytest.mark.parametrize(("angle", "arcsec"), [("2", 0.0162), ("3", 0.018), ("4", 0.05),
                                               ("5", 0.10125)])  # fmt: skip
def test_units_of_gsi(tmp_path, width, length, mm, angle, arcsec):
    """Half of the last digit of each unit is what is lost."""
    survey = one_stand()
    text = gsi(survey, width=width, length=length, angle=angle)
    tables = imported(tmp_path, text)
    found = numbers(tables["wall_hits"], "direction_deg", "zenith_deg", "distance_m")
    apart = np.abs(found - hits_of(survey)).max(axis=0)
    assert apart[:2].max() < 1.001 * arcsec * ARCSEC + 1e-7
    assert apart[2] < 1.001 * mm / 1000 + 1e-6
    assert len(tables["control_readings"]) == 8


@pytest.mark.slow(after=5)
@pytest.mark.parametrize("options", [
    {"wide": False}, {"angle": "2"}, {"angle": "4"}, {"length": "2"}, {"order": "2"},
    {"zero": "2"}, {"wide": False, "angle": "2", "length": "2", "order": "2", "zero": "2"},
])  # fmt: skip
def test_headers_of_sdr(tmp_path, options):
    survey = two_stands()
    tables = imported(tmp_path, sdr(survey, **options), **TIES)
    found = numbers(tables["wall_hits"], "direction_deg", "zenith_deg", "distance_m")
    np.testing.assert_allclose(found, hits_of(survey), rtol=0, atol=1e-5)
    xyz = numbers(tables["control"], "x_m", "y_m", "z_m")
    np.testing.assert_allclose(xyz, [[0.2, 0.1, 0], [-1, 1.2, 0.05]], rtol=0, atol=1e-5)


@pytest.mark.parametrize("unit", ["0", "1", "2"])
def test_units_of_rw5(tmp_path, unit):
    survey = one_stand()
    tables = imported(tmp_path, rw5(survey, unit=unit))
    found = numbers(tables["wall_hits"], "direction_deg", "zenith_deg", "distance_m")
    np.testing.assert_allclose(found, hits_of(survey), rtol=0, atol=2e-6)


def test_constant_and_ppm_of_jobxml_are_applied_once(tmp_path):
    survey = one_stand()
    for options in ({}, {"declared": "false"}, {"prism": 0.0, "ppm": 0.0}):
        tables = imported(tmp_path, jobxml(survey, **options))
        read = numbers(tables["control_readings"], "distance_m").ravel()
        truth = [one.distance for stand in survey for one in stand.aims if not one.code]
        np.testing.assert_allclose(read, truth, rtol=0, atol=2e-6)


def test_both_faces_give_their_mean_and_the_errors_of_the_instrument(tmp_path):
    """Closed form: the faces were made with a collimation of 3.6" and an index error of -7.2"."""
    plain = two_stands()
    survey = two_stands(faces=2, collimation=0.001, index=-0.002)
    path = tmp_path / "book.jxl"
    path.write_text(jobxml(survey), encoding="utf-8")
    found = import_fieldbooks([path], tmp_path / "job", Choices(**TIES))
    tables = imported(tmp_path, jobxml(survey), **TIES)
    read = numbers(tables["wall_hits"], "direction_deg", "zenith_deg", "distance_m")
    np.testing.assert_allclose(read, hits_of(plain), rtol=0, atol=2e-6)
    (told,) = (one for one in found.summary if one.code == "import_collimation" and
               one.values["setup"] == "1")  # fmt: skip
    assert told.values["c_arcsec"] == pytest.approx(3.6, abs=1e-3)
    assert told.values["i_arcsec"] == pytest.approx(-7.2, abs=1e-3)


def test_face_2_alone_is_turned_to_face_1(tmp_path):
    survey = one_stand(faces=2)
    (stand,) = survey
    only = [type(stand)(stand.station, stand.height, stand.xyz,
                        tuple(one for one in stand.aims if one.face == 2))]  # fmt: skip
    tables = imported(tmp_path, sdr(only))
    read = numbers(tables["wall_hits"], "direction_deg", "zenith_deg", "distance_m")
    np.testing.assert_allclose(read, hits_of(one_stand()), rtol=0, atol=1e-6)


@pytest.mark.parametrize("left", [1, 2])
def test_one_face_alone_is_freed_of_the_errors_of_the_pairs(tmp_path, left):
    """Closed form: targets read on one face later lie where both faces put them before."""
    (stand,) = one_stand(faces=2, collimation=0.003, index=-0.004)
    aims = stand.aims[:-8] + tuple(one for one in stand.aims[-8:] if one.face == left)
    path = tmp_path / "book.sdr"
    path.write_text(sdr([replace(stand, aims=aims)]), encoding="utf-8")
    found = import_fieldbooks([path], tmp_path / "job", Choices())
    with (tmp_path / "job" / "control_readings.csv").open(encoding="utf-8") as file:
        read = numbers(csv.DictReader(file), "direction_deg", "zenith_deg")
    np.testing.assert_allclose(read[4:], read[:4], rtol=0, atol=1e-6)
    (told,) = (one for one in found.summary if one.code == "import_freed")
    assert told.values["count"] == 4


@pytest.mark.slow
def test_all_formats_run_to_the_same_table(tmp_path):
    """Second method: the same hits handed in as CSV; the formats round to 0.1 mm or finer."""
    volumes = {}
    for name, write in WRITERS.items():
        job = base_job(tmp_path / name)
        path = tmp_path / f"book.{name}"
        path.write_text(write(one_stand()), encoding="utf-8", newline="")
        (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
        profile = ["--profile", str(tmp_path / "profile.toml")] if name == "csv" else []
        assert main(["import", str(path), "--out", str(job), *profile]) == 0
        volumes[name] = tankcal.run(tankcal.load(job)).at(8.0).value_m3
    assert len(volumes) == 5
    assert np.ptp(list(volumes.values())) < 2e-5 * volumes["gsi"]


@pytest.mark.slow
def test_tied_set_ups_run_to_the_table_of_one(tmp_path):
    """Both see the same wall: the table of two set-ups that targets tie is that of one."""
    one = base_job(tmp_path / "one")
    two = base_job(tmp_path / "two", adjustment__datum="minimal")
    for job, survey in ((one, one_stand()), (two, two_stands())):
        path = tmp_path / f"{job.name}.gsi"
        path.write_text(gsi(survey), encoding="ascii", newline="")
        assert main(["import", str(path), "--out", str(job), "--targets-mm", "1",
                     "--targets-arcsec", "3"]) == 0  # fmt: skip
    volumes = [tankcal.run(tankcal.load(job)).at(8.0).value_m3 for job in (one, two)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-4)


@pytest.mark.slow
def test_the_example_comes_back(tmp_path):
    """The example of wall hits as GSI-16, imported: its own table within the rounding."""
    from conftest import EXAMPLE
    from fieldbook_of_example import survey_of

    source = EXAMPLE.parent / "wall-hits"
    truth = tankcal.run(tankcal.load(source)).at(9.0).value_m3
    for name in ("gsi", "jxl", "sdr", "rw5"):
        job = tmp_path / name
        job.mkdir()
        for path in source.iterdir():
            if path.stem not in ("setups", "wall_hits", "control_readings"):
                (job / path.name).write_bytes(path.read_bytes())
        book = tmp_path / f"book.{name}"
        book.write_text(WRITERS[name](survey_of(source)), encoding="utf-8", newline="")
        assert main(["import", str(book), "--out", str(job), "--check", "CHECK",
                     "--instrument", "TS-4"]) == 0  # fmt: skip
        volume = tankcal.run(tankcal.load(job)).at(9.0).value_m3
        ppm, finer_mm = figures_of(
            "docs/studies/import.md",
            "gives its table within () ppm with readings of () mm or finer",
        )
        assert finer_mm == "0.1"
        assert volume == pytest.approx(truth, rel=1e-6 * float(ppm))


def test_the_field_book_of_the_example(tmp_path):
    """What the example has as CSV files, its field book has too."""
    from conftest import EXAMPLE

    source = EXAMPLE.parent / "wall-hits"
    import_fieldbooks([source / "field-book.gsi"], tmp_path / "job", Choices(check=("CHECK",)))
    for table in ("wall_hits", "control_readings"):
        both = [
            list(csv.DictReader((folder / f"{table}.csv").open(encoding="utf-8")))
            for folder in (source, tmp_path / "job")
        ]
        read, found = (numbers(one, "direction_deg", "zenith_deg", "distance_m") for one in both)
        np.testing.assert_allclose(found, read, rtol=0, atol=6e-6)
        read, found = ([(row.get("use"), row["time"][:16]) for row in rows] for rows in both)
        assert found == read
