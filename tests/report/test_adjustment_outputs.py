"""What a user sees of an adjusted survey: record, CSV files, workbook, papers, command line."""

import copy
import csv
import ctypes
import gc
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import openpyxl
import pandas as pd
import pytest
import scipy.stats
from job_builder import write_job
from networks import by_total_station, photographed

import tankcal
from tankcal import record as records
from tankcal.camera.model import PARAMETERS, Form
from tankcal.cli import main
from tankcal.job.covariance import check_covariance, read_covariance
from tankcal.memory import return_freed_memory, without_collection
from tankcal.pipeline.chain import adjust_job
from tankcal.record.adjustment import _edge_effect, _group, point_results_of
from tankcal.record.columns import rows_of
from tankcal.report import attachments, outputs, workbook
from tankcal.report.document import blocks_of
from tankcal.report.notebook import execute, join_templates
from tankcal.report.outputs import write_csv
from tankcal.report.paper import Paper
from tankcal.report.papers import parts_without_content
from tankcal.report.survey import figures, quality, results
from tankcal.report.workbook import papers
from tankcal.survey import observations
from tankcal.survey.results import Adjustment, GroupOfReadings
from tankcal.text.words import load_words, verdict_sentences

HARD_NAME = "_1 #2 (a)/b"
HARD_TEXT = '=HYPERLINK("x") <b>$C$-17'
ONLY = {
    "record.json", "points.csv", "points_cov.npz", "photos.csv", "cameras.csv", "groups.csv",
    "residuals.csv", "adjustment.xlsx", "report.ipynb", "working-papers.pdf", "report.html",
}  # fmt: skip
SLOW_FIXTURES = {"only", "whole", "station"}  # seconds each
BLUNDERS = (5, 40, 77)  # rows of image points that get 0.2 mm


def write_table(folder, name, headings, rows):
    with open(folder / name, "w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([headings.split(), *rows])


def without_points(folder, settings, **job):
    """A job of a tank without points.csv, with further lines for its job.toml."""
    write_job(folder, radius=6.5, height=9.3, settings={"table.step_m": 0.5}, **job)
    (folder / "points.csv").unlink()
    with open(folder / "job.toml", "a", encoding="utf-8") as file:
        file.write("[adjustment]\n" + settings)
    return folder


def write_photos(folder, image_sd_um=5):
    """Photographs, tape and control of `networks.photographed`, with blunders and a hard name."""
    survey, truth = photographed(0, form=Form("correction_added", "both_y"))
    names = [f"{i // 12 + 1}-{i % 12 + 1}" for i in range(len(survey.points))]
    names[0] = HARD_NAME
    settings = '[adjustment.camera]\ndefault = "block free"\nK3 = "off"\n'
    without_points(folder, settings, courses=4, points_per_ring=12)
    (folder / "cameras.toml").write_text(
        '[cameras.UMK]\nformat_mm = [180.0, 180.0]\nc_mm = 100.0\naffinity = "both_y"\n'
        'convention = "correction_added"\n'
    )
    (folder / "instruments.toml").write_text(
        f"[instruments.'tape 1']\nkind = 'tape'\ncertificate = '{HARD_TEXT}'\nu_scale_ppm = 20.0\n"
    )
    photos = survey.photos.names
    write_table(folder, "photos.csv", "photo camera", [[name, "UMK"] for name in photos])
    images = survey.image_points
    xy = images.value.copy()
    xy[list(BLUNDERS)] += 0.2
    write_table(folder, "image_points.csv", "photo point x_mm y_mm sx_um sy_um", [
        [photos[photo], names[point], *place, image_sd_um, image_sd_um]
        for photo, point, place in zip(images.photo, images.point, xy.round(5), strict=True)
    ])  # fmt: skip
    control, tape = survey.observations
    rows = control.value.reshape(-1, 3).round(5)
    write_table(folder, "control.csv", "point x_m y_m z_m sx_mm sy_mm sz_mm", [
        [names[point], *row, 2, 2, 2] for point, row in zip(control.point[::3], rows, strict=True)
    ])  # fmt: skip
    write_table(folder, "check.csv", "point x_m y_m z_m sx_mm sy_mm sz_mm", [
        [names[i], *truth.xyz_m[i].round(5), 1, 1, 1] for i in (2, 11, 20, 38)
    ])  # fmt: skip
    write_table(folder, "distances.csv", "from to distance_m s_mm instrument use", [
        [names[a], names[b], value, 1, "tape 1", "check" if a == 3 else "adjust"]
        for a, b, value in zip(tape.start, tape.end, tape.value.round(5), strict=True)
    ])  # fmt: skip
    return folder


def write_station(folder):
    """Set-ups around a tank, no control, adjusted as a free network."""
    survey, _ = by_total_station(1)
    names = [f"W{i}" for i in range(24)] + [f"ST{i}" for i in range(4)]
    folder.mkdir(parents=True)
    (folder / "job.toml").write_text('[adjustment]\ndatum = "inner"\n')
    directions, zenith, distances = survey.observations
    setup = [f"set-up {a - 24}" for a in directions.start]
    to = [names[b] for b in directions.end]
    write_table(folder, "setups.csv", "setup station", [[f"set-up {i}", f"ST{i}"]
                                                        for i in range(4)])  # fmt: skip
    for name, column, sd_column, value, sd in (
        ("directions", "direction_deg", "s_arcsec", np.degrees(directions.value) % 360, 3),
        ("zenith_angles", "zenith_deg", "s_arcsec", np.degrees(zenith.value), 3),
        ("slope_distances", "distance_m", "s_mm", distances.value, 1),
    ):
        rows = [[a, b, round(v, 8), sd] for a, b, v in zip(setup, to, value, strict=True)]
        write_table(folder, f"{name}.csv", f"setup to {column} {sd_column}", rows)
    return folder


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return write_photos(tmp_path_factory.mktemp("photos") / "job")


@pytest.fixture(scope="module")
def only(job):
    """(record, folder) of the job run for its adjustment alone, by the command line."""
    out = job.parent / "only"
    assert main(["run", str(job), "--only", "adjustment", "--out", str(out), "--quiet"]) == 0
    return records.load(out / "record.json"), out


@pytest.fixture(scope="module")
def whole(job):
    """(result, folder) of the whole chain; of the papers the blocks of both parts, as JSON."""
    result = tankcal.run(tankcal.load(job))

    def build(record_path, folder, *_):
        lacks = parts_without_content(records.load(record_path))
        notebook = execute(join_templates(record_path.name, lacks), folder)
        for part in ("certificate", "working-papers"):
            text = json.dumps(blocks_of(notebook, part), ensure_ascii=False)
            (folder / f"{part}.pdf").write_text(text, encoding="utf-8")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outputs, "build", build)
        outputs.write(result, job.parent / "whole")
    return result, job.parent / "whole"


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    """(adjustment, record, its path) of the total-station job."""
    folder = write_station(tmp_path_factory.mktemp("station") / "job")
    job = tankcal.load(folder, only="adjustment")
    adjustment = adjust_job(job)
    record = records.record_of_adjustment(job, adjustment)
    records.save(record, folder.parent / "record.json")
    return adjustment, record, folder.parent / "record.json"


def text_of(pdf):
    if not shutil.which("pdftotext"):
        pytest.skip("no pdftotext here (poppler)")
    return subprocess.run(
        ["pdftotext", "-layout", pdf, "-"], capture_output=True, check=True, encoding="utf-8"
    ).stdout


# the record


@pytest.mark.slow
def test_the_statistics_are_those_of_the_adjustment(whole):
    """Second method: chi2 and its bounds from the readings and scipy."""
    found = records.load(whole[1] / "record.json")["adjustment"]
    used = [row for row in rows_of(found["residuals"]) if not row["removed"] and not row["check"]]
    chi2 = sum((row["residual"] / row["sd"]) ** 2 for row in used)
    assert found["chi2"] == pytest.approx(chi2, rel=1e-6)
    assert len(used) == found["observations"]
    assert found["redundancy"] == found["observations"] - found["unknowns"]
    assert found["sigma0"] == pytest.approx(np.sqrt(chi2 / found["redundancy"]), rel=1e-6)
    bounds = scipy.stats.chi2.ppf([0.025, 0.975], found["redundancy"])
    assert found["chi2_bounds"] == pytest.approx(list(bounds))
    assert found["passed"] is True
    assert sum(row["redundancy"] for row in used) == pytest.approx(found["redundancy"], rel=1e-6)


def test_blunders_are_listed_with_file_and_row(only):
    removed = only[0]["adjustment"]["removed"]
    assert {row["row"] for row in removed} >= {row + 2 for row in BLUNDERS}
    assert {row["file"] for row in removed} == {"image_points.csv"}
    assert [abs(row["w"]) for row in removed] == sorted(
        (abs(r["w"]) for r in removed), reverse=True
    )


def assert_alike(one, other, place):
    """Equal, numbers to the last digits: where arrays begin in memory decides how sums round."""
    assert type(one) is type(other), place
    if isinstance(one, dict):
        assert one.keys() == other.keys(), place
        for key in one:
            assert_alike(one[key], other[key], f"{place}.{key}")
    elif isinstance(one, list):
        for i, pair in enumerate(zip(one, other, strict=True)):
            assert_alike(*pair, f"{place}[{i}]")
    elif isinstance(one, float):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12, nan_ok=True), place
    else:
        assert one == other, place


@pytest.mark.slow
def test_record_of_survey_alone_has_no_tank(only, whole):
    record, full = only[0], records.load(whole[1] / "record.json")
    assert record.keys() == full.keys() - {"wall_shape", "homogeneity"}  # may be left out
    assert all(not record[key] for key in ("shell", "capacity", "sections", "courses", "budget"))
    for key in ("sigma0", "chi2", "observations", "groups", "datum", "photos", "precision"):
        assert_alike(record["adjustment"][key], full["adjustment"][key], key)


@pytest.mark.slow
def test_every_adjusted_point_has_its_covariance(whole):
    result, folder = whole
    record = records.load(folder / "record.json")
    rows = {row["point"]: row for row in record["points"]}
    full = result.adjustment.full_covariance_m2()
    for i, name in enumerate(result.adjustment.names):
        block = full[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        np.testing.assert_allclose(rows[name]["cov_m2"], block, rtol=1e-9, atol=1e-20)
    assert HARD_NAME in rows


def test_the_full_covariance_is_read_as_a_job_reads_it(only):
    """Property: what is written is what points_cov.npz of a job is made of."""
    record, folder = only
    told = []
    log = SimpleNamespace(problem=lambda *problem: told.append(problem))
    names = [row["point"] for row in record["points"]]
    data = (folder / "points_cov.npz").read_bytes()
    check_covariance(data, names, log)
    assert not told
    covariance = read_covariance(data)
    assert covariance.shape == (3 * len(names),) * 2
    own = np.array([row["cov_m2"] for row in record["points"]])
    blocks = covariance.reshape(len(names), 3, len(names), 3)[np.arange(len(names)), :,
                                                              np.arange(len(names))]  # fmt: skip
    np.testing.assert_allclose(blocks, own, rtol=1e-9, atol=1e-20)


def test_instruments_are_in_the_record(only):
    found = only[0]["adjustment"]
    (tape,) = found["instruments"]
    assert tape["details"] == {"certificate": HARD_TEXT}
    assert tape["declared_scale_sd_ppm"] == pytest.approx(20.0)
    assert 0 < tape["scale_sd_ppm"] < 20.0  # the photographs know the scale, too
    (camera,) = found["cameras"]
    assert camera["edge_known"]
    assert camera["parameters"] == ["c", "x0", "y0", "K1", "K2", "P1", "P2", "A", "B"]
    np.testing.assert_allclose(np.diag(camera["correlation"]), 1.0)
    assert len(found["photos"]) == 8
    assert {row["kind"] for row in found["points"]} == {"point", "control", "check"}


def made(covariance_m2, cov_scale=1.0, redundancy=10):
    """Something with the fields of an Adjustment that the points are made of."""
    survey = SimpleNamespace(image_points=None)
    found = SimpleNamespace(
        names=("A",), covariance_m2=np.array([covariance_m2]), fixed=np.zeros((1, 3), dtype=bool),
        adjusted=SimpleNamespace(survey=survey), cov_scale=cov_scale, redundancy=redundancy,
    )  # fmt: skip
    found.dof = Adjustment.dof.fget(found)
    return found


def test_error_ellipsoid_and_ellipse_in_closed_form():
    """Closed form: axes of a diagonal covariance; published factors 2.80 (3-D) and 2.45 (2-D)."""
    (point,) = point_results_of(made(np.diag([1e-6, 9e-6, 4e-6])))
    assert point["ellipsoid_m"] == pytest.approx([0.0083865, 0.0055910, 0.0027955], rel=1e-4)
    assert point["ellipse_m"] == pytest.approx([0.0073432, 0.0024477], rel=1e-4)
    assert point["ellipse_azimuth_deg"] == pytest.approx(0.0)
    assert point["ellipsoid_elevation_deg"] == pytest.approx(0.0)
    assert point["spherical_sd_m"] == pytest.approx(0.002)
    assert point["quadratic_sd_m"] == pytest.approx(np.sqrt(14e-6))
    turned = np.array([[5e-6, 4e-6, 0], [4e-6, 5e-6, 0], [0, 0, 1e-6]])
    assert point_results_of(made(turned))[0]["ellipse_azimuth_deg"] == pytest.approx(45.0)


def test_ellipsoids_with_estimated_variance_factor_use_fisher():
    """Closed form: 3 F(0.95; 3, 10) in place of the chi-square."""
    (point,) = point_results_of(made(np.diag([1e-6] * 3), cov_scale=1.1))
    factor = np.sqrt(3 * scipy.stats.f.ppf(0.95, 3, 10))
    assert point["ellipsoid_m"] == pytest.approx([factor * 1e-3] * 3)


def test_effect_at_the_edge_in_closed_form():
    """Closed form: a corner moves by K1 r^3, by x0 itself, by P1 (r2 + 2 x2) and 2 P1 x y."""
    values = dict.fromkeys(PARAMETERS, 0.0)
    values |= {"c": 100.0, "K1": 2e-8, "P1": 1e-7}
    corner = np.array([90.0, 60.0])
    r2 = 90.0**2 + 60.0**2
    assert _edge_effect("c", values, Form(), corner) is None
    assert _edge_effect("K1", values, Form(), corner) == pytest.approx(1e3 * 2e-8 * r2**1.5)
    shift = np.hypot(1e-7 * (r2 + 2 * 90.0**2), 2 * 1e-7 * 90.0 * 60.0)
    assert _edge_effect("P1", values, Form(), corner) == pytest.approx(1e3 * shift)
    assert _edge_effect("x0", values | {"x0": -0.02}, Form(), corner) == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("factor", "redundancy", "verdict"),
    [
        (1.05, 50.0, "as_declared"),
        (1.5, 50.0, "worse"),
        (0.6, 50.0, "better"),
        (1.5, 2.0, "as_declared"),
        (1.5, 0.5, "hardly_controlled"),
        (np.nan, 0.0, "not_controlled"),
    ],
)
def test_verdict_of_a_group(factor, redundancy, verdict):
    """Closed form: factor sqrt(r / chi2) is 1 at the ends of the interval that just hold it."""
    group = GroupOfReadings("distance", "tape 1", "m", 60, 0, redundancy, factor, 0.1, 0.001)
    row = _group(group)
    assert row.verdict == verdict
    sentences = verdict_sentences(load_words(), {"groups": [vars(row)]})
    assert len(sentences) == (verdict in ("worse", "better"))
    if row.factor_low is not None:
        chi2 = redundancy * (factor / row.factor_low) ** 2
        assert scipy.stats.chi2.cdf(chi2, redundancy) == pytest.approx(0.975)


@pytest.mark.slow
def test_a_reading_that_nothing_controls_is_named(station):
    """Closed form: a wall point seen from one set-up by three values has none to spare."""
    _, record, path = station
    alone = [row for row in rows_of(record["adjustment"]["residuals"]) if not row["controlled"]]
    assert len(alone) == 3 * 12
    assert {tuple(row["ids"]) for row in alone} >= {("set-up 0", "W1")}
    assert all(row["mdb"] is None for row in alone)
    shown = quality.control(Paper(path))
    assert "36 of 132" in shown[0].data["caption"]
    assert ["zenith angle", "set-up 0 – W1"] in [row[:2] for row in shown[0].data["rows"]]


# CSV


def test_csv_files_are_the_record_in_their_units(only):
    record, folder = only
    found = record["adjustment"]
    assert {path.name for path in folder.iterdir()} == {*ONLY, "SHA256SUMS"}
    table = pd.read_csv(folder / "residuals.csv", keep_default_na=False, na_values=[""])
    assert len(table) == len(found["residuals"]["kind"])
    image = table[table.kind == "image coordinate"]
    rows = [row for row in rows_of(found["residuals"]) if row["kind"] == "image coordinate"]
    assert list(image.residual) == pytest.approx([1000 * row["residual"] for row in rows])
    assert set(image.unit) == {"um"}
    assert set(image.value_unit) == {"mm"}
    assert HARD_NAME in set(image.id_2)
    assert (table.removed == "yes").sum() == len(found["removed"])
    assert (table.check == "yes").sum() == 1
    points = pd.read_csv(folder / "points.csv")
    assert list(points.point) == [row["point"] for row in record["points"]]
    sd = [1000 * np.sqrt(row["cov_m2"][1][1]) for row in record["points"]]
    assert list(points.sy_mm) == pytest.approx(sd, abs=1e-6)
    assert (points.ellipsoid95_a_mm >= points.ellipsoid95_c_mm).all()
    cameras = pd.read_csv(folder / "cameras.csv")
    assert list(cameras.parameter) == found["cameras"][0]["parameters"]
    assert cameras.r_c[0] == 1
    assert len(pd.read_csv(folder / "photos.csv")) == 8
    assert len(pd.read_csv(folder / "groups.csv")) == len(found["groups"])


@pytest.mark.slow
def test_angles_are_degrees_with_residuals_in_seconds(station, tmp_path):
    _, record, _ = station
    outputs.write_tables(record, tmp_path)
    table = pd.read_csv(tmp_path / "residuals.csv")
    angles = table[table.kind == "direction"]
    assert set(angles.value_unit) == {"deg"}
    assert angles.value.between(0, 360).all()
    assert list(angles.sd) == pytest.approx([3.0] * len(angles))  # as declared, arc seconds
    assert not (tmp_path / "photos.csv").exists()


# the workbook


def test_the_workbook_of_a_survey_alone(only):
    record, folder = only
    book = openpyxl.load_workbook(folder / "adjustment.xlsx")
    assert book.sheetnames == [
        "Adjustment", "Adjusted points", "Observations", "Cameras and photos",
        "Choices and provenance",
    ]  # fmt: skip
    sheet = book["Observations"]
    assert sheet.max_row == 4 + len(record["adjustment"]["residuals"]["kind"])
    (table,) = sheet.tables.values()
    assert table.autoFilter is not None
    use = [row[13].value for row in sheet.iter_rows(min_row=5)]
    assert use.count("rejected") == len(record["adjustment"]["removed"])
    assert use.count("compared") == 1
    faint = next(row for row in sheet.iter_rows(min_row=5) if row[13].value == "rejected")
    assert faint[0].font.italic
    cells = [cell for name in book.sheetnames for row in book[name] for cell in row]
    assert not [cell for cell in cells if cell.data_type == "f"]
    assert {HARD_NAME, HARD_TEXT} <= {cell.value for cell in cells}


@pytest.mark.parametrize(("language", "said"), [("en", "sheet"), ("pt-BR", "aba")])
def test_sheets_that_readings_stand_in_are_named_in_words(station, tmp_path, language, said):
    record = copy.deepcopy(station[1])
    residuals = record["adjustment"]["residuals"]
    residuals["file"] = [f"sheet {one.removesuffix('.csv')}" for one in residuals["file"]]
    paper = Paper(record, language=language)
    named = set(paper.record["adjustment"]["residuals"]["file"])
    tables = ("directions", "zenith_angles", "slope_distances")
    assert named == {f"{said} {one}" for one in tables}
    workbook.write(record, tmp_path / "a.xlsx", language)
    book = openpyxl.load_workbook(tmp_path / "a.xlsx")
    cells = {str(cell.value) for sheet in book for row in sheet for cell in row}
    assert named <= cells
    assert language == "en" or not [one for one in cells if one.startswith("sheet ")]


@pytest.mark.slow
def test_the_workbook_of_a_tank_has_the_sheets_beside_its_own(whole):
    book = openpyxl.load_workbook(whole[1] / "capacity.xlsx")
    assert {"Adjustment", "Observations", "Cameras and photos", "Capacity"} <= {*book.sheetnames}
    certificate = [cell.value for row in book["Certificate"] for cell in row]
    assert any("photographs (UMK): 8" in str(value) for value in certificate)


def test_very_many_readings_are_cut_to_the_worst(only, tmp_path, monkeypatch):
    monkeypatch.setattr(papers, "MOST_READINGS", 20)
    workbook.write(only[0], tmp_path / "adjustment.xlsx")
    sheet = openpyxl.load_workbook(tmp_path / "adjustment.xlsx")["Observations"]
    assert sheet.max_row == 4 + 20
    assert "20 of " in sheet["A2"].value
    use = [row[13].value for row in sheet.iter_rows(min_row=5)]
    assert use.count("rejected") == len(only[0]["adjustment"]["removed"])


# the papers


def test_of_very_many_points_the_sheet_has_the_weakest(only, tmp_path, monkeypatch):
    record = records.load(only[1] / "record.json")
    monkeypatch.setattr(papers, "MOST_POINTS", 10)
    workbook.write(record, tmp_path / "cut.xlsx")
    sheet = openpyxl.load_workbook(tmp_path / "cut.xlsx")["Adjusted points"]
    names = [sheet.cell(row, 1).value for row in range(5, sheet.max_row + 1)]
    trace = {row["point"]: np.trace(row["cov_m2"]) for row in record["points"]}
    assert set(names) == set(sorted(trace, key=lambda name: -trace[name])[:10])
    assert names == [row["point"] for row in record["points"] if row["point"] in names]


def test_papers_send_nobody_to_a_sheet_that_is_cut(monkeypatch):
    paper = SimpleNamespace(paragraph=lambda name, **_: name)
    monkeypatch.setattr(quality, "MOST_IN_SHEET", 10)
    named = [quality.with_note(paper, "table", [1], range(rows))[1] for rows in (10, 11)]
    assert named == ["only_worst", "only_worst_of_many"]


@pytest.mark.slow
def test_without_papers_record_and_tables_are_written(job, only, tmp_path, capsys):
    out = tmp_path / "out"
    command = ["run", str(job), "--only", "adjustment", "--out", str(out), "--quiet"]
    assert main([*command, "--no-papers"]) == 0
    names = {name for name in ONLY if name.endswith((".csv", ".json", ".npz"))}
    assert {path.name for path in out.iterdir()} == {*names, "SHA256SUMS"}
    for name in names:
        if not name.endswith(".npz"):
            assert (out / name).read_bytes() == (only[1] / name).read_bytes(), name
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--no-papers", "--letterhead", "letterhead.toml"])


def test_csv_files_are_those_of_pandas(tmp_path):
    """Second method: pandas' own writer, which is slow."""
    table = pd.DataFrame(
        {
            "point": ["a,b", 'c"d', "", "e\nf"],
            "x": [1 / 3, -1e-9, np.nan, 2e12],
            "n": [1, 2, 3, 4],
            "row": pd.Series([7, None, 8, 9], dtype="Int64"),
            "on": [True, False, True, False],
        }
    )
    for style in ("%.6f", "%.12g"):
        cells = {
            name: [None if one is pd.NA else one for one in table[name].tolist()] for name in table
        }
        write_csv(cells, tmp_path / "own.csv", style)
        table.to_csv(tmp_path / "pandas.csv", index=False, float_format=style, lineterminator="\n")
        own, other = (tmp_path / f"{name}.csv" for name in ("own", "pandas"))
        assert own.read_bytes() == other.read_bytes()


def test_large_attachments_stay_outside_the_pdf(tmp_path, monkeypatch):
    (tmp_path / "record.json").write_bytes(b"12345")
    assert [one.name for one in attachments.beside(tmp_path, {"record.json": ""})] == [
        "record.json"
    ]
    monkeypatch.setattr(attachments, "LARGEST", 4)
    assert attachments.beside(tmp_path, {"record.json": ""}) == []


def test_the_papers_of_a_survey_alone(only):
    record, folder = only
    text = " ".join(text_of(folder / "working-papers.pdf").split())
    found = record["adjustment"]
    for words in (
        "The adjustment", "Rejected observations", "Datum", "Instruments", "Cameras",
        "Photographs", "Adjusted points", "Check points", "passed: v′Pv", "tape 1", HARD_TEXT,
        "The network from above", HARD_NAME, f"{found['sigma0']:.3f}",
        f"{1000 * found['check_points']['r_xyz_m']:.3g} mm",
    ):  # fmt: skip
        assert words in text, words
    assert "Capacity" not in text
    for row in found["removed"][:3]:
        assert f"image_points.csv {row['row']}" in text
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "The adjustment" in page
    assert "Calibration certificate" not in page


@pytest.mark.slow
def test_the_papers_of_a_tank_begin_with_the_adjustment(whole):
    _, folder = whole
    text = (folder / "working-papers.pdf").read_text(encoding="utf-8")
    assert text.index("The adjustment") < text.index("The shell")
    certificate = (folder / "certificate.pdf").read_text(encoding="utf-8")
    assert "photographs (UMK): 8" in certificate
    assert "points adjusted, σ₀ =" in certificate
    assert "The points were determined from photographs" in certificate
    assert "their full covariance matrix from the adjustment" in certificate
    assert "Scale of the instrument: tape 1" in certificate
    assert {"points_cov.npz", "residuals.csv", "capacity.csv"} <= {p.name for p in folder.iterdir()}


def test_the_chapter_vanishes_without_an_adjustment():
    lacks = [part for part in ("adjustment", "corrections")]
    sources = "".join(cell["source"] for cell in join_templates("record.json", lacks)["cells"])
    assert "adjusted_groups" not in sources
    assert "capacity_curves" in sources


def test_long_tables_are_cut_with_a_note(only):
    paper = Paper(only[1] / "record.json")
    rows = 30 * quality.list_rejected(paper)
    table, note = quality.readings_table(paper, "removed_readings", rows)
    assert len(table.data["rows"]) == 50
    assert note.data["text"].startswith(f"50 of {len(rows)} rows")


def test_writing_lets_the_garbage_collector_rest_and_wakes_it():
    """With it the record of 180 000 readings took twice as long to make."""
    with without_collection():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ZeroDivisionError), without_collection():
        print(1 / 0)
    assert gc.isenabled()


def resident_mb():
    """What this process holds in memory, MB (Linux)."""
    text = Path("/proc/self/status").read_text(encoding="ascii")
    return int(re.search(r"VmRSS:\s+(\d+)", text)[1]) / 1000


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no malloc_trim")
def test_freed_memory_is_given_back(figure):
    """Property: pieces between others that are kept leave the process, too."""
    if not hasattr(ctypes.CDLL(None), "malloc_trim"):
        pytest.skip("this C library has no malloc_trim")
    pieces = [bytes(1000) for _ in range(60_000)]
    kept = pieces[::100]
    del pieces
    before = resident_mb()
    return_freed_memory()
    figure("freed memory given back, MB", before - resident_mb())
    assert len(kept) == 600
    assert before - resident_mb() > 30


def test_network_plan_computes_its_extent_twice(only, monkeypatch):
    """Asked for each of 26 321 points it took more than ten minutes."""
    asked = []
    extent = figures._extent
    monkeypatch.setattr(figures, "_extent", lambda paper: asked.append(1) or extent(paper))
    figures.plan(Paper(only[1] / "record.json"))
    assert len(asked) == 2


@pytest.mark.slow
def test_figures_are_drawn_of_every_kind_of_survey(only, station):
    for path in (only[1] / "record.json", station[2]):
        paper = Paper(path)
        svg = paper.figure(figures.plan(paper), "plan", factor=1, probability="95 %").data["svg"]
        assert "station" in svg or "photograph" in svg
        figures.distributions(paper)
    paper = Paper(only[1] / "record.json")
    assert figures.vectors_factor(paper) in {k * 10**n for k in (1, 2, 5) for n in range(5)}
    svg = paper.figure(figures.photo_residuals(paper), "photo_residuals", factor=1).data["svg"]
    assert "Photo S7" in svg


def test_plan_of_many_points_draws_weakest_ellipses(only, monkeypatch):
    paper = Paper(only[1] / "record.json")
    assert figures.plan_name(paper) == "plan"
    monkeypatch.setattr(figures, "MANY", 10)
    assert figures.plan_name(paper) == "plan_many"
    (ellipses,) = figures.plan(paper).axes[0].collections
    places = {tuple(place) for place in ellipses.get_offsets().tolist()}
    points = paper.record["adjustment"]["points"]
    weakest = {one["point"] for one in sorted(points, key=lambda one: -one["ellipse_m"][0])[:10]}
    rows = paper.record["points"]
    assert places == {(row["x_m"], row["y_m"]) for row in rows if row["point"] in weakest}


def test_marks_of_many_points_are_one_picture(only, monkeypatch):
    """Words stay text, and what was rejected is no exception."""
    paper = Paper(only[1] / "record.json")
    found = paper.record["adjustment"]["residuals"]
    found["removed"] = [
        kind == "image coordinate" and ids[0] == "S7"
        for kind, ids in zip(found["kind"], found["ids"], strict=True)
    ]

    def counted():
        figure = figures.photo_residuals(paper)
        svg = paper.figure(figure, "photo_residuals", factor=1).data["svg"]
        return svg.count("<use"), svg.count("<image"), svg.count("<text")

    marks, pictures, words = counted()
    assert marks > 20
    assert pictures == 0
    monkeypatch.setattr("tankcal.report.plots.style.MANY", 2)
    assert counted() == (0, len(figures.select_photos(paper)), words)


def test_more_photos_than_fit_are_those_that_fit_worst(only):
    paper = Paper(only[1] / "record.json")
    photos = paper.record["adjustment"]["photos"]
    paper.record["adjustment"]["photos"] = [
        row | {"photo": f"{row['photo']}/{k}", "rms_mm": 0.001 * k} for k in range(3)
        for row in photos
    ]  # fmt: skip
    shown = figures.select_photos(paper)
    assert len(shown) == figures.MOST_PHOTOS
    assert {row["photo"][-2:] for row in shown} == {"/1", "/2"}


def test_coordinates_of_a_large_frame_stay_readable(only):
    """A plan in UTM says what was taken off its axes."""
    paper = Paper(only[1] / "record.json")
    for row in paper.record["points"]:
        row["x_m"], row["y_m"] = row["x_m"] + 683_000.0, row["y_m"] + 7_460_000.0
    paper.record["adjustment"]["photos"] = []
    assert (
        "− 7459000\N{NO-BREAK SPACE}m"
        in paper.figure(figures.plan(paper), "plan", factor=1, probability="95 %").data["svg"]
    )


def test_nothing_redundant_is_said(only):
    paper = Paper(only[1] / "record.json")
    paper.record["adjustment"] |= {"chi2_bounds": None, "passed": None, "sigma0": None}
    facts = dict(quality.facts(paper).data["items"])
    assert facts["Global test"].startswith("none: no observation is redundant")
    assert facts["σ₀ a posteriori"] == "–"


@pytest.mark.parametrize(("chi2", "words"), [(1e6, "lies above"), (1.0, "lies below")])
def test_failed_global_test_names_its_side(chi2, words, only):
    paper = Paper(only[1] / "record.json")
    paper.record["adjustment"] |= {"chi2": chi2, "passed": False}
    facts = dict(quality.facts(paper).data["items"])
    assert facts["Global test"].startswith("FAILED")
    assert words in facts["Global test"]


def test_a_fixed_survey_has_no_precision(only):
    paper = Paper(only[1] / "record.json")
    paper.record["adjustment"]["precision"] = None
    (block,) = results.precision(paper)
    assert block.data["text"] == "Every point was held fixed."


def test_every_kind_of_observation_has_words():
    words = load_words()
    classes = [getattr(observations, name) for name in dir(observations)]
    kinds = {one.kind for one in classes if isinstance(one, type) and hasattr(one, "kind")}
    for kind in kinds - {"observation"}:
        assert kind in words["observed"], kind
        assert kind in words["observations"], kind


# the command line


@pytest.mark.slow
def test_summary_states_the_quality(job, only, capsys, monkeypatch):
    monkeypatch.setattr(outputs, "write_adjustment", lambda *rest: [Path("record.json")])
    assert main(["run", str(job), "--only", "adjustment", "--strict"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("adjustment: sigma0 = ")
    for words in ("global test passed", "3 observations rejected", "48 points", "deviation 1."):
        assert words in out


@pytest.fixture(scope="module")
def doubtful(tmp_path_factory):
    """A job whose image sds are declared ten times too large."""
    return write_photos(tmp_path_factory.mktemp("doubtful") / "job", image_sd_um=50)


@pytest.mark.slow
def test_strict_writes_nothing_when_the_global_test_fails(doubtful, capsys):
    assert main(["run", str(doubtful), "--strict", "--quiet", "--only", "adjustment"]) == 3
    error = capsys.readouterr().err
    assert "the global test of the adjustment failed: v'Pv = " in error
    assert "no file was written (--strict)" in error
    assert not (doubtful / "results").exists()


@pytest.mark.slow
def test_strict_holds_for_the_whole_run(doubtful, monkeypatch, capsys):
    adjustment = adjust_job(tankcal.load(doubtful))
    monkeypatch.setattr(tankcal, "run", lambda *job, **told: SimpleNamespace(adjustment=adjustment))
    assert main(["run", str(doubtful), "--strict", "--quiet", "--no-papers"]) == 3
    assert "the global test of the adjustment failed" in capsys.readouterr().err
    assert not (doubtful / "results").exists()


def test_a_job_without_a_survey_has_nothing_to_adjust(tmp_path, capsys):
    write_job(tmp_path / "job")
    assert main(["run", str(tmp_path / "job"), "--only", "adjustment", "--quiet"]) == 2
    assert "job.toml" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("survey", ["photos", "total-station"])
def test_new_writes_the_files_of_a_survey(survey, tmp_path):
    assert main(["new", str(tmp_path / "mine"), "--survey", survey]) == 0
    names = {path.name for path in (tmp_path / "mine").iterdir()}
    assert ("photos.csv" if survey == "photos" else "setups.csv") in names
