"""Layouts of the capacity table: centimetres with millimetre parts, ullages, units of volume."""

import copy
import shutil

import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.record import record_of
from tankcal.report.paper import Paper
from tankcal.report.tables.capacity import capacity_rows, capacity_table, parts_table
from tankcal.tank.dips import VOLUME_UNITS_M3


@pytest.fixture(scope="module")
def record(example_result):
    return record_of(example_result)


def laid_out(record, **spec):
    changed = copy.copy(record)
    changed["job"] = record["job"] | {"table": record["job"]["table"] | spec}
    return changed


def texts(record, key, name="capacity_k"):
    """Unit and cells of a printed column of the capacity table."""
    paper, rows = Paper(record, language="en"), capacity_rows(record)
    [column] = [c for c in capacity_table(record).on_paper(name, rows) if c.key == key]
    return column.unit, paper.column_texts(rows, column)


def test_whole_centimetres_have_no_decimals(record):
    unit, heights = texts(laid_out(record, heights_in="cm"), "height_m")
    assert unit == "cm"
    assert heights[:3] == ["0", "1", "2"]
    assert heights[-1] == "950"
    parts = laid_out(record, heights_in="cm")
    table = parts_table(parts)
    paper, rows = Paper(parts, language="en"), table.rows(parts)
    assert paper.column_texts(rows, table.columns[0]) == ["0", "190", "380", "570", "760"]


def test_millimetres_keep_their_decimals_in_centimetres(record):
    heights = [0.0, 0.5, 1.035, 9.49996]
    changed = laid_out(record, heights_in="cm")
    changed["capacity"] = {
        key: value[: len(heights)] if isinstance(value, list) else value
        for key, value in record["capacity"].items()
    } | {"height_m": heights}
    assert texts(changed, "height_m")[1] == ["0", "50", "103.5", "949.996"]


def test_ullage_is_the_rest_of_the_reference_height(record):
    """The example has a reference height of 9.800 m."""
    _, dips = texts(laid_out(record, ullage=True), "height_m")
    _, ullages = texts(laid_out(record, ullage=True), "ullage_m")
    assert ullages[0] == "9.800"
    assert ullages[-1] == "0.300"
    assert all(
        float(dip) + float(ullage) == pytest.approx(9.8, abs=1e-9)
        for dip, ullage in zip(dips, ullages, strict=True)
    )
    assert "ullage_m" not in capacity_rows(record)[0]


@pytest.mark.parametrize(
    ("unit", "litres"),
    [("hL", 100.0), ("US gal", 3.785411784), ("imp gal", 4.54609), ("bbl", 158.987294928)],
)
def test_units_have_their_legal_size(unit, litres):
    """By definition: 231 and 9702 cubic inches of 2.54 cm, 4.54609 L and 100 L."""
    assert float(VOLUME_UNITS_M3[unit]) == pytest.approx(litres / 1000, rel=1e-15)


@pytest.mark.parametrize(
    ("keys", "without", "expected"),
    [
        ("ullage = true", "reference_height_m", "table.ullage: .*reference_height_m"),
        ('heights_in = "cm"\nheight_unit = "ft-in-8"', "step_m", "heights_in: .*ft-in-8"),
    ],
)
def test_layouts_that_contradict_the_job(keys, without, expected, tmp_path):
    job = shutil.copytree(EXAMPLE, tmp_path / "job", ignore=shutil.ignore_patterns("results"))
    lines = (job / "job.toml").read_text(encoding="utf-8").splitlines()
    text = "\n".join(line for line in lines if not line.startswith(without))
    (job / "job.toml").write_text(text.replace("[table]", f"[table]\n{keys}"), "utf-8")
    with pytest.raises(InputError, match=expected) as refused:
        tankcal.load(job)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["hL", "US gal", "imp gal"])
def test_all_files_of_a_layout_agree(unit, tmp_path):
    job = shutil.copytree(EXAMPLE, tmp_path / "job", ignore=shutil.ignore_patterns("results"))
    text = (job / "job.toml").read_text(encoding="utf-8").replace("step_m = 0.01", "step_m = 0.1")
    keys = f'[table]\nheights_in = "cm"\nullage = true\nvolume_unit = "{unit}"'
    (job / "job.toml").write_text(text.replace("[table]", keys), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["run", str(job), "--out", str(out), "--quiet"]) == 0
    assert main(["verify", str(out), "--quiet"]) == 0
    assert "tankcal_ullage" in (out / "certificate.xml").read_text(encoding="utf-8")
    head, first, *_ = (out / "capacity.csv").read_text(encoding="utf-8").splitlines()
    assert head.split(",")[:3] == ["height_m", "ullage_m", "volume_m3"]
    assert first.split(",")[1] == "9.800000"
    assert main(["lint", str(out / "capacity.xlsx"), "--sheet", "Capacity"]) == 0
