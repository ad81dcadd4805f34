"""The field chart of `tankcal chart`: its numbers, and a single page of readable type."""

import io
import json
import re

import numpy as np
import pypdf
import pytest
from calculated_tanks import afloat, example_with_rows

from tankcal.cli import main
from tankcal.report.pdf import pdf
from tankcal.report.station_chart import MOST_ROWS, chart_rows, layout, pages, water_rows
from tankcal.text.shipped import LANGUAGES

READABLE_PT = 7.0  # smallest type of a chart with the most rows


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    """(record, path of record.json)."""
    folder = tmp_path_factory.mktemp("tank")
    return example_with_rows(0.2, folder)[1], folder / "record.json"


def test_volumes_are_those_of_the_table_between_its_rows(tank):
    record, _ = tank
    capacity = record["capacity"]
    rows = chart_rows(record)
    assert [cm for cm, _ in rows] == list(range(951))
    assert dict(rows)[20] == pytest.approx(1000 * capacity["volume_m3"][1], rel=1e-12)
    low, high = 1000 * capacity["volume_m3"][1], 1000 * capacity["volume_m3"][2]
    assert dict(rows)[25] == pytest.approx(low + 0.25 * (high - low), rel=1e-12)


@pytest.mark.slow
def test_a_critical_zone_has_no_volumes(tmp_path):
    record = afloat(tmp_path)[1]
    rows = dict(chart_rows(record))
    roof = {line["code"]: line["value"] for line in record["roof"]}
    low, high = roof["roof_critical_bottom"], roof["roof_critical_top"]
    blank = [cm for cm, litres in rows.items() if litres is None]
    assert blank == [cm for cm in rows if low < cm / 100 < high]
    assert blank


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_most_rows_are_readable_on_a_page(tank, language):
    record, _ = tank
    rows = [(cm, 123456.0) for cm in range(MOST_ROWS)]
    shown = pages(record, rows, language, product="Diesel B S10 com um nome bastante comprido")
    content = pdf([block.data for block in shown])
    assert len(pypdf.PdfReader(io.BytesIO(content)).pages) == 1
    assert layout(MOST_ROWS, 6)[1] >= READABLE_PT
    assert layout(250, 6)[1] >= 10.0  # a tank of 2.5 m diameter


@pytest.mark.parametrize("count", [1, 7, 60, 150, 250, 333])
def test_every_number_of_rows_is_a_page(tank, count):
    rows = [(cm, 12345.0) for cm in range(count)]
    content = pdf([block.data for block in pages(tank[0], rows, "en")])
    assert len(pypdf.PdfReader(io.BytesIO(content)).pages) == 1


@pytest.mark.slow
def test_the_command_writes_each_row_and_the_facts(tank, tmp_path, capsys):
    record, source = tank
    out = tmp_path / "chart.pdf"
    assert main(["chart", str(source), "--step-cm", "5", "--product", "Diesel", "--out", str(out),
                 "--language", "en"]) == 0  # fmt: skip
    (page,) = pypdf.PdfReader(out).pages
    text = page.extract_text()
    printed = set(re.findall(r"\d+", text))
    litres = np.array([value for _, value in chart_rows(record, 5)])
    assert {f"{value:.0f}" for value in litres} <= printed
    for fact in ("Diesel", record["job"]["tank"]["id"], record["job"]["certificate"]["number"]):
        assert fact in text
    assert "191 rows" in capsys.readouterr().out


def test_too_many_rows_and_a_wrong_ending_are_refused(tank, tmp_path, capsys):
    chart = ["chart", str(tank[1]), "--language", "en", "--out"]
    assert main([*chart, str(tmp_path / "chart.pdf")]) == 2
    assert "951 rows" in capsys.readouterr().err
    assert main([*chart, str(tmp_path / "chart.csv")]) == 2
    assert ".pdf" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_ullages_are_the_reference_height_less_the_dip(tmp_path, capsys):
    record = afloat(tmp_path)[1]
    capacity, reference = record["capacity"], record["job"]["datum"]["reference_height_m"]
    rows = dict(chart_rows(record, by_ullage=True))
    assert list(rows) == list(range(70, 1021))  # 10.2 m less 9.5 m, to 10.2 m
    assert rows[round(100 * (reference - capacity["height_m"][20]))] == pytest.approx(
        1000 * capacity["volume_m3"][20], rel=1e-9
    )
    out = tmp_path / "ullage.pdf"
    assert main(["chart", str(tmp_path / "record.json"), "--ullage", "--step-cm", "5", "--out",
                 str(out), "--language", "en"]) == 0  # fmt: skip
    text = pypdf.PdfReader(out).pages[0].extract_text()
    assert "Ullage chart" in text
    assert "10.200 m" in text


def test_ullages_need_a_reference_height(tank, tmp_path, capsys):
    record = json.loads(tank[1].read_text(encoding="utf-8"))
    record["job"]["datum"]["reference_height_m"] = None
    source = tmp_path / "record.json"
    source.write_text(json.dumps(record), encoding="utf-8")
    assert main(["chart", str(source), "--ullage", "--step-cm", "5", "--language", "en", "--out",
                 str(tmp_path / "chart.pdf")]) == 2  # fmt: skip
    assert "reference height" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_critical_zone_is_hatched_and_explained(tmp_path, language):
    record = afloat(tmp_path)[1]
    rows = chart_rows(record, 4)
    *_, chart = pages(record, rows, language)
    low, high = (line["value"] for line in record["roof"] if line["code"].startswith("roof_crit"))
    expected = [place for place, (cm, _) in enumerate(rows) if low < cm / 100 < high]
    assert chart.data["marked"] == expected
    assert expected
    word = {"en": "hatched", "es": "rayado", "pt-BR": "hachurado"}[language]
    assert word in chart.data["note"]
    # The hatching is a pattern of lines, which a print in black and white shows.
    (page,) = pypdf.PdfReader(
        io.BytesIO(pdf([block.data for block in pages(record, rows, language)]))
    ).pages
    assert "/Pattern" in page["/Resources"]


def test_a_water_table_has_the_volumes_of_the_table_at_each_millimetre(tank):
    record, _ = tank
    capacity = record["capacity"]
    rows = water_rows(record)
    assert [mm for mm, _ in rows] == list(range(MOST_ROWS))
    slope = 1000 * (capacity["volume_m3"][1] - capacity["volume_m3"][0]) / 200  # rows of 0.2 m
    first = 1000 * capacity["volume_m3"][0]
    assert dict(rows)[137] == pytest.approx(first + 137 * slope, rel=1e-12)
    assert [mm for mm, _ in water_rows(record, 5)][:3] == [0, 5, 10]


@pytest.mark.slow
def test_a_water_table_ends_below_the_roof(tmp_path):
    record = afloat(tmp_path)[1]
    assert water_rows(record, 5)[-1][0] == 1000  # the critical zone begins at 1 m


@pytest.mark.slow
def test_the_command_writes_a_water_table_with_the_U_of_its_rows(tank, tmp_path, capsys):
    record, source = tank
    out = tmp_path / "water.pdf"
    chart = ["chart", str(source), "--language", "en", "--out", str(out)]
    assert main([*chart, "--water"]) == 0
    assert "400 rows" in capsys.readouterr().out
    (page,) = pypdf.PdfReader(out).pages
    text = page.extract_text()
    assert "Table of free water" in text
    U = 1000 * max(record["capacity"]["U_m3"][:3])  # rows at 0, 0.2 and 0.4 m
    assert f"U = {U:.2g} L at most" in text or f"U = {U:.0f} L at most" in text
    for options, named in ((["--water", "--ullage", "--step-cm", "5"], "--step-cm"),
                           (["--step-mm", "2"], "--step-mm")):  # fmt: skip
        assert main([*chart, *options]) == 2
        assert f"{named}: " in capsys.readouterr().err
