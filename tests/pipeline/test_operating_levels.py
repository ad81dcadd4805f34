"""Volumes of the operating levels: closed form, cancelling errors, refusals, and the papers."""

from dataclasses import replace
from math import pi

import numpy as np
import openpyxl
import pytest
from job_builder import job_parts, write_folder
from paper_cells import paper_blocks

import tankcal
from tankcal.errors import InputError
from tankcal.record import record_of, save
from tankcal.record.schema import to_plain
from tankcal.report.paper import Paper
from tankcal.report.uncertainty.method import remarks
from tankcal.report.uncertainty.stated import limit_rows, stated_rows
from tankcal.report.workbook import write

AREA_M2 = pi * 6.5**2
LEVELS = {"full_m": 9.3, "maximum_m": 9.0, "minimum_m": 1.2, "pump_suction_m": 0.4}
ZERO_5_MM = [
    ["input", "u", "unit", "u_is", "type", "distribution", "dof", "note"],
    ["datum", 5.0, "mm", None, "B", "normal", None, None],
]


def job_with(folder, levels=LEVELS, stated="", **settings):
    """A cylinder of 6.5 m by 9.5 m with the levels, and a zero with u of 5 mm."""
    own = {f"levels.{name}": value for name, value in levels.items()}
    own |= {"survey.side": "inside", "table.step_m": 0.1} | settings
    parts = job_parts(settings=own, sd_mm=0.01)
    parts.tables["uncertainty"] = ZERO_5_MM
    if stated:
        parts.extra_files = {"stated.csv": "high_m,low_m,volume_m3,note\n" + stated}
    return tankcal.load(write_folder(folder / "job", parts))


def limits_of(job):
    """{code: row} of the table of operating levels, and the whole record."""
    record = to_plain(record_of(tankcal.run(job)))
    return {row["tank_limit"]: row for row in limit_rows(record)}, record


@pytest.mark.slow
def test_volumes_are_those_of_the_cylinder(tmp_path):
    """The dip plate is 0.1 m above the bottom, so that each volume below a dip has 0.1 m more."""
    rows, _ = limits_of(job_with(tmp_path, **{"datum.dip_plate_z_m": 0.1}))
    heights_m = {
        "full": 9.4,
        "maximum": 9.1,
        "minimum": 1.3,
        "pump_suction": 0.5,
        "below_table": 0.1,
        "working_capacity": 7.8,
        "pumpable": 8.6,
        "reserve": 0.3,
    }
    assert list(rows) == list(heights_m)
    for code, height_m in heights_m.items():
        assert rows[code]["volume_m3"] == pytest.approx(AREA_M2 * height_m, rel=1e-5)


@pytest.mark.slow
def test_errors_of_the_zero_cancel_between_two_levels(tmp_path):
    """The zero contributes A times 5 mm to a volume below a dip, and nothing to a difference."""
    rows, _ = limits_of(job_with(tmp_path))
    of_zero = 1.96 * AREA_M2 * 0.005
    for code in ("maximum", "minimum", "pump_suction"):
        assert rows[code]["U_m3"] > of_zero
    assert rows["pump_suction"]["U_m3"] == pytest.approx(of_zero, rel=0.25)
    # The rest of U at the maximum is the wall up to 9.0 m, of which the difference has a part.
    of_wall = np.sqrt(rows["maximum"]["U_m3"] ** 2 - of_zero**2)
    assert 0.5 * of_wall < rows["working_capacity"]["U_m3"] < of_wall


@pytest.mark.slow
def test_U_of_a_difference_is_that_of_stated_csv(tmp_path):
    """The same dips in stated.csv have the same U, and are stated once unless they have a note."""
    asked = "9,1.2,,\n9,0.4,,by the terminal\n"
    rows, record = limits_of(job_with(tmp_path / "both", stated=asked))
    alone = to_plain(record_of(tankcal.run(job_with(tmp_path / "alone", {}, asked))))
    by_dips = {(row["low_m"], row["high_m"]): row for row in stated_rows(alone)}
    for code, low_m in (("working_capacity", 1.2), ("pumpable", 0.4)):
        for key in ("volume_m3", "U_m3", "k"):
            assert rows[code][key] == by_dips[low_m, 9.0][key]
    dips = [(row["low_m"], row["high_m"]) for row in stated_rows(record)]
    assert (1.2, 9.0) not in dips
    assert dips.count((0.4, 9.0)) == 1


@pytest.mark.slow
def test_levels_leave_the_default_statements(tmp_path):
    _, record = limits_of(job_with(tmp_path / "with"))
    without = to_plain(record_of(tankcal.run(job_with(tmp_path / "without", {}))))
    assert stated_rows(record) == stated_rows(without)
    assert "limits" not in without
    assert "levels" not in without["job"]


@pytest.mark.slow
def test_only_given_levels_are_stated(tmp_path):
    levels = {"maximum_m": 9.0, "full_m": 9.0, "pump_suction_m": 0.4}
    rows, _ = limits_of(job_with(tmp_path, levels))
    assert list(rows) == ["full", "maximum", "pump_suction", "pumpable"]


@pytest.mark.parametrize(
    ("levels", "column", "words"),
    [
        ({"maximum_m": 9.6}, "maximum_m", "found 9.6; expected at most 9.5, the top of the tank"),
        ({"maximum_m": 9.0, "full_m": 8.0}, "full_m", "expected a dip above maximum_m = 9"),
        ({"maximum_m": 1.0, "minimum_m": 1.0}, "maximum_m", "expected a dip above minimum_m = 1"),
        ({"minimum_m": 0.3, "pump_suction_m": 0.4}, "minimum_m", "above pump_suction_m = 0.4"),
        ({"maximum_m": 9000}, "maximum_m", "above 0, at most 100"),
    ],
)
def test_a_level_that_is_refused(tmp_path, levels, column, words):
    with pytest.raises(InputError) as caught:
        job_with(tmp_path, levels)
    (problem,) = caught.value.problems
    assert (problem.file, problem.column) == ("job.toml", f"levels.{column}")
    assert words in problem.expected


@pytest.mark.slow
def test_a_level_above_the_computed_table_is_refused(tmp_path):
    """As for a scan, whose top is not known before the calculation."""
    job = job_with(tmp_path)
    with pytest.raises(InputError) as caught:
        tankcal.run(replace(job, levels=replace(job.levels, full_m=9.7)))
    (problem,) = caught.value.problems
    assert (problem.file, problem.column) == ("job.toml", "levels.full_m")
    assert "found 9.7; expected 0 to 9.5, the dips of the table" in problem.expected


@pytest.mark.slow
def test_a_level_in_the_critical_zone_is_marked(tmp_path):
    roof = {
        "roof.mass_kg": 9000.0,
        "roof.critical_bottom_m": 1.0,
        "roof.critical_top_m": 1.6,
        "roof.reference_density_kg_m3": 850.0,
        "roof.weighing": "air",
    }
    rows, record = limits_of(job_with(tmp_path, **roof))
    assert [code for code, row in rows.items() if not row["for_use"]] == [
        "minimum",
        "working_capacity",
    ]
    save(record, tmp_path / "record.json")
    remark = remarks(Paper(tmp_path / "record.json"), rows["minimum"])
    assert remark == ["not for use"]


@pytest.mark.slow
def test_a_record_without_levels_has_no_such_heading(tmp_path):
    _, with_levels = limits_of(job_with(tmp_path / "with"))
    without = to_plain(record_of(tankcal.run(job_with(tmp_path / "without", {}))))
    for record, count in ((with_levels, 1), (without, 0)):
        save(record, tmp_path / "record.json")
        texts = [block.get("text") for block in paper_blocks(tmp_path / "record.json")]
        assert texts.count("Operating levels") == count


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")
def test_sheet_and_certificate_state_the_levels(tmp_path):
    rows, record = limits_of(job_with(tmp_path, **{"table.language": "pt-BR"}))
    write(record, tmp_path / "capacity.xlsx")
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    (sheet,) = (sheet for sheet in book if "limits_of_tank" in sheet.tables)
    area = sheet[sheet.tables["limits_of_tank"].ref]
    head, *cells = ([cell.value for cell in row] for row in area)
    assert head[:2] == ["Nível", "Da altura (m)"]
    assert [row[3] for row in cells] == pytest.approx([row["volume_m3"] for row in rows.values()])
    assert cells[4][0] == "Capacidade útil: do máximo ao mínimo"
    save(record, tmp_path / "record.json")
    tables = [block for block in paper_blocks(tmp_path / "record.json") if block["kind"] == "table"]
    (rows_on_paper,) = (block["rows"] for block in tables if "Nível" in str(block["columns"]))
    assert [row[0] for row in rows_on_paper] == [row[0] for row in cells]
    assert rows_on_paper[4][1:5] == ["9,000", "1,200", "1.035,312", "0,60"]
