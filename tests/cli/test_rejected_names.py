"""What was rejected is named on the terminal: planted blunders come out by name and row."""

import csv
import shutil

import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.cli import main
from tankcal.cli.running import describe_rejected

PLANTED = [  # example, table, column, how much more, row, the line that names it
    (
        *("reference-line", "offsets", "offset_mm", 25, 4),
        "offsets rejected: line A at 2.16 m (row 4)",
    ),
    (
        *("total-station", "directions", "direction_gon", 0.3, 2),
        "readings rejected: S1-S5 (directions.csv, row 2)",
    ),
]


def planted(folder, example, table, column, more, rows):
    shutil.copytree(EXAMPLE.parent / example, folder)
    path = folder / f"{table}.csv"
    lines = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    place = next(one for one in lines if not one[0].startswith("#")).index(column)
    for row in rows:
        lines[row - 1][place] = f"{float(lines[row - 1][place]) + more:.5f}"
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(lines)
    return folder


def told(folder):
    result = tankcal.run(tankcal.load(folder))
    return [str(one) for one in describe_rejected(result, result.adjustment)]


@pytest.mark.slow
@pytest.mark.parametrize(("example", "table", "column", "more", "row", "line"), PLANTED)
def test_a_planted_blunder_is_named(tmp_path, example, table, column, more, row, line):
    assert f"  {line}" in told(planted(tmp_path / "job", example, table, column, more, [row]))


@pytest.mark.slow
def test_five_are_named_and_the_others_counted(tmp_path, capsys):
    """Seven offsets; on the terminal, in the language of the job, after the volume."""
    rows = [4, 31, 41, 56, 71, 91, 101]
    folder = planted(tmp_path / "job", "reference-line", "offsets", "offset_mm", 25, rows)
    (line,) = told(folder)
    assert line.count("(row ") == 5
    assert line.endswith(" and 2 more (see the working papers)")
    assert main(["run", str(folder), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert shown.index("U = ") < shown.index(line)


def test_nothing_is_said_where_nothing_was_set_aside():
    assert list(describe_rejected(None, None)) == []
