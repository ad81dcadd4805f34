"""One report has one unit of volume, whatever part of it shows a volume."""

import json
import re

import openpyxl
import pytest

from tankcal.cli import main
from tankcal.report import workbook
from tankcal.report.paper import Paper
from tankcal.report.tables.tank import CORRECTIONS
from tankcal.report.uncertainty import budget


def paper_in(record, unit):
    changed = json.loads(record.read_text(encoding="utf-8"))
    changed["job"]["table"]["volume_unit"] = unit
    return Paper(changed)


@pytest.mark.parametrize(("unit", "factor"), [("m3", 1.0), ("L", 1e3), ("bbl", 1 / 0.158987294928)])
def test_a_volume_is_shown_in_the_unit_of_the_job(example_record, unit, factor):
    paper = paper_in(example_record, unit)
    top, U = (paper.record["capacity"][key][-1] for key in ("volume_m3", "U_m3"))
    shown = paper.number(top, "m3", u=U)
    assert shown.endswith(paper.volume_symbol)
    number = float(re.sub(r"[^\d.]", "", shown.removesuffix(paper.volume_symbol)))
    assert number == pytest.approx(factor * top, abs=factor * U / 10)
    assert paper.number(850, "kg/m3", decimals=0).endswith("kg/m³")


def test_no_table_of_a_report_in_litres_has_cubic_metres(example_record):
    paper = paper_in(example_record, "L")
    found = [paper.show(CORRECTIONS), *budget.top(paper), *budget.others(paper)]
    units = [one["unit"] for block in found for one in block.data.get("columns", [])]
    assert "L" in units
    assert not [one for one in units if one in ("m³", "m³/unit")]


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "factor"), [("m3", 1.0), ("L", 1e3), ("bbl", 1 / 0.158987294928)])
def test_the_first_sheet_has_volume_and_u_in_the_unit_of_the_job(
    example_record, tmp_path, unit, factor
):
    record = paper_in(example_record, unit).record
    workbook.write(record, tmp_path / "capacity.xlsx")
    first = openpyxl.load_workbook(tmp_path / "capacity.xlsx").worksheets[0]
    [(volume, U)] = [
        (row[1], row[2]) for row in first.iter_rows() if str(row[2].number_format).startswith('"±')
    ]
    capacity, symbol = record["capacity"], {"m3": "m³"}.get(unit, unit)
    assert volume.value == pytest.approx(factor * capacity["volume_m3"][-1], rel=1e-12)
    assert U.value == pytest.approx(factor * capacity["U_m3"][-1], rel=1e-12)
    assert volume.number_format.endswith(f'"{symbol}"')
    assert U.number_format.endswith(f'"{symbol}"')
    nominal = record["job"]["tank"]["nominal_volume_m3"]  # as declared, in m3 on every paper
    sizes = [one["size_m3"] for one in record["corrections"] if one["applied"]]
    shown = [
        row[1].value
        for row in first.iter_rows(min_row=volume.row + 1)
        if "³" in row[1].number_format or row[1].number_format.endswith(f'"{symbol}"')
    ]
    assert shown == pytest.approx([nominal, *(factor * one for one in sizes)], rel=1e-12)


@pytest.mark.slow
def test_the_terminal_names_the_unit(tmp_path, capsys):
    from conftest import EXAMPLE

    text = (EXAMPLE / "job.toml").read_text(encoding="utf-8")
    folder = tmp_path / "job"
    folder.mkdir()
    for path in EXAMPLE.glob("*.csv"):
        (folder / path.name).write_bytes(path.read_bytes())
    changed = text.replace("[table]\n", '[table]\nvolume_unit = "L"\n', 1)
    (folder / "job.toml").write_text(changed, encoding="utf-8")
    assert main(["run", str(folder), "--no-papers", "--quiet"]) == 0
    line = capsys.readouterr().out.splitlines()[0]
    assert re.match(r"SILVA-1995: 12\d{5} L at 9\.500 m, U = 1\d00 L ", line)
