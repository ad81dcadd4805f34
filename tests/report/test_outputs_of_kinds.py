"""Record, workbook and papers of tanks with everything in them, and of tanks without courses."""

import json
import shutil
import subprocess

import numpy as np
import openpyxl
import pandas as pd
import pytest
from job_builder import write_job

import tankcal
from tankcal.report import outputs
from tankcal.report.certificate import calibration
from tankcal.report.paper import Paper
from tankcal.report.uncertainty.capacity import NOT_FOR_USE, density_blocks
from tankcal.report.workbook.look import CRITICAL

pytestmark = pytest.mark.slow

SETTINGS = {
    "table.step_m": 0.5,
    "table.liquid_density_kg_m3": 850.0,
    "table.other_densities_kg_m3": [700.0, 1000.0],
    "bottom.form": "cone",
    "bottom.centre_z_m": -0.15,
    "survey.shell_temperature_c": 31.0,
    "material.expansion_per_k": 1.15e-5,
}
ITEMS = [("coil #1", 0.2, 0.6, -0.35, 0.02), ("hatch", 0.5, 1.1, 0.12, 0.0)]


def written(folder, **changes):
    """(result, folder of its results) of a job."""
    result = tankcal.run(tankcal.load(write_job(folder / "job", **changes)))
    outputs.write(result, folder / "results")
    return result, folder / "results"


@pytest.fixture(scope="module")
def furnished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("furnished")
    return written(folder, settings=SETTINGS, deadwood=ITEMS, roof={"critical_top_m": 1.6})


@pytest.fixture(scope="module")
def lying(tmp_path_factory):
    settings = {
        "survey.side": "inside",
        "table.step_m": None,
        "table.height_unit": "ft-in-8",
        "table.volume_unit": "bbl",
        "horizontal.end_a": "ellipsoidal",
        "horizontal.end_a_depth_m": 0.6,
    }
    uncertainty = [("diameter", 2.0, "mm")]
    folder = tmp_path_factory.mktemp("lying")
    return written(folder, kind="horizontal", settings=settings, uncertainty=uncertainty)


def record_in(folder):
    return json.loads((folder / "record.json").read_text(encoding="utf-8"))


def cells(sheet):
    return [[cell.value for cell in row] for row in sheet.iter_rows()]


def text_of(pdf):
    if not shutil.which("pdftotext"):
        pytest.skip("no pdftotext here (poppler)")
    return subprocess.run(
        ["pdftotext", "-layout", pdf, "-"], capture_output=True, check=True, text=True
    ).stdout


def test_record_has_bottom_deadwood_and_roof(furnished):
    result, folder = furnished
    record = record_in(folder)
    roof = {line["code"]: line["value"] for line in record["roof"]}
    assert roof["roof_displacement"] == pytest.approx(9000 * (1 - 1.2 / 8000) / 848.8)
    assert [item["name"] for item in record["deadwood"]] == ["coil #1", "hatch"]
    assert {line["code"]: line["value"] for line in record["bottom"]}["bottom_depth"] == 0.15
    assert [other["density_kg_m3"] for other in record["densities"]] == [700.0, 1000.0]
    critical = [height for height, use in zip(*_rows(record), strict=True) if not use]
    assert critical == [1.5]
    assert len(record["corrections"]) == len(result.corrections) == 7
    assert record["interpolation"]["largest_m3"] == result.straightness.largest_m3


def _rows(record):
    return record["capacity"]["height_m"], record["capacity"]["for_use"]


def test_workbook_has_sheet_of_bottom_deadwood_and_roof(furnished):
    _, folder = furnished
    record = record_in(folder)
    book = openpyxl.load_workbook(folder / "capacity.xlsx")
    assert {"Other densities", "Deadwood, bottom, roof"} <= set(book.sheetnames)
    others = cells(book["Other densities"])
    assert others[3][1:4] == ["850 kg/m³", "700 kg/m³", "1000 kg/m³"]
    by_density = np.array([row[2:4] for row in others[4:]], dtype=float)
    expected = np.array([other["volume_m3"] for other in record["densities"]])
    assert np.allclose(by_density.T, expected, rtol=1e-12)
    assert [row[0] for row in others[4:] if row[4] == "not for use"] == [1.5]
    parts = [value for row in cells(book["Deadwood, bottom, roof"]) for value in row]
    assert {"coil #1", "cone", "in air"} <= set(parts)
    capacity = cells(book["Capacity"])
    use = capacity[3].index("Use")
    assert [row[0] for row in capacity[4:] if row[use] == "not for use"] == [1.5]
    for name in ("Capacity", "Other densities"):
        filled = [
            row[0].value
            for row in book[name].iter_rows(min_row=5)
            if row[0].fill.fgColor.rgb.endswith(CRITICAL.removeprefix("#"))
        ]
        assert filled == [1.5]


def test_csv_table_has_other_densities_and_not_for_use(furnished):
    _, folder = furnished
    record = record_in(folder)
    table = pd.read_csv(folder / "capacity.csv")
    assert table.loc[table.for_use == "no", "height_m"].tolist() == [1.5]
    assert table["volume_m3_at_700_kg_m3"].to_numpy() == pytest.approx(
        np.array(record["densities"][0]["volume_m3"]), abs=1e-6
    )


def test_the_certificate_prints_every_part(furnished):
    text = text_of(furnished[1] / "certificate.pdf")
    parts = ("coil #1", "Floating roof", "cone", "not for use", "1000 kg/m³", "Internal pressure")
    for words in (*parts, "1.15 × 10⁻⁵"):
        assert words in text


def test_tables_of_other_densities_mark_critical_zone(furnished):
    found = density_blocks(Paper(record_in(furnished[1])))
    assert len(found) == 2
    for block in found:
        rows = block.data["rows"]
        assert [row[0] for row in rows if NOT_FOR_USE in row] == ["1.500"]
        assert len(rows) == len(record_in(furnished[1])["capacity"]["height_m"])


def test_tank_without_courses_has_no_course_outputs(lying):
    _, folder = lying
    record = record_in(folder)
    assert record["shell"] is record["gross"] is None
    assert record["courses"] == record["points"] == record["sections"] == []
    assert not (folder / "points.csv").exists()
    book = openpyxl.load_workbook(folder / "capacity.xlsx")
    assert not {"Courses and sections", "Points and residuals"} & set(book.sheetnames)


def test_declared_dimensions_are_no_survey(lying):
    result, folder = lying
    paper = Paper(record_in(folder))
    assert "scale" not in result.body.undeclared()  # the diameter is declared
    sentences = " ".join(paper.choices())
    assert "dimensions are inside dimensions" in sentences
    assert "survey was made from inside" not in sentences
    assert "Surveyed from" not in dict(calibration(paper).data["items"])


def test_table_in_feet_and_barrels_also_has_metres(lying):
    result, folder = lying
    capacity = cells(openpyxl.load_workbook(folder / "capacity.xlsx")["Capacity"])
    assert capacity[3][:4] == [
        "Dip (ft-in)", "Volume (bbl)", "Dip height (m)", "Volume (m³)",
    ]  # fmt: skip
    row = capacity[4 + 8 * 13]  # thirteen inches
    assert row[0] == "1' 1\""
    assert row[2] == pytest.approx(13 * 0.0254, abs=1e-12)
    assert row[1] == pytest.approx(result.at(13 * 0.0254).value_m3 / 0.158987294928, rel=1e-12)


def test_papers_of_tank_without_courses_show_dimensions(lying):
    text = text_of(lying[1] / "report.pdf")
    for words in ("ellipsoidal", "0.6000 m", "bbl", "1' 1\"", "Volume of the full tank"):
        assert words in text
    assert "Points surveyed" not in text
