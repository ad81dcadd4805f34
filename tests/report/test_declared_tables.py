"""A table is declared once: every medium writes any Table, and shows a column that is added."""

import csv
from dataclasses import replace
from gzip import open as unzipped
from json import load

import openpyxl
import pytest
from kept_records import kept_files
from paper_pages import pages_of

from tankcal.record.versions import RECORD
from tankcal.report import blocks
from tankcal.report.camera import lines_of
from tankcal.report.outputs import write_table
from tankcal.report.paper import Paper
from tankcal.report.pdf import pdf
from tankcal.report.tables import Column, capacity, survey, tank
from tankcal.report.uncertainty import budget, method, monte_carlo, rule, stated
from tankcal.report.web import page
from tankcal.report.workbook.book import Book
from tankcal.report.workbook.sections import columns_of
from tankcal.text.digits import decimals_of
from tankcal.text.words import load_words

ADDED = Column("half_m", "m", decimals=3, heading="tolerance_m3", sheet=True, csv="half_m")
WORDS = load_words("en")
OF_THE_WORKBOOK = (  # alone
    tank.SHELL,
    tank.DEVIATIONS,
    survey.INSTRUMENTS,
    rule.ACCEPTANCE,
    monte_carlo.SIMULATED,
)


def kept(name):
    """A kept record, as it is read today."""
    path = next(path for path in kept_files() if path.name.startswith(name))
    with unzipped(path, "rt", encoding="utf-8") as file:
        return RECORD.migrated(load(file), path.name)


def with_half(record):
    return [row | {"half_m": row["height_m"] / 2} for row in record["courses"]]


@pytest.fixture(scope="module")
def added():
    """The table of courses with a column more, and its rows."""
    record = kept("furnished")
    table = replace(tank.COURSES, columns=(*tank.COURSES.columns, ADDED), rows=with_half)
    return record, table, [f"{row['half_m']:.3f}" for row in with_half(record)]


def test_added_column_is_in_every_output(added, tmp_path):
    record, table, halves = added
    block = Paper(record, WORDS).show(table)
    assert [row[-1] for row in block.data["rows"]] == halves
    found = [blocks.document(title="Courses").data, block.data]
    (tmp_path / "courses.pdf").write_bytes(pdf(found, tmp_path))
    shown = {
        "PDF": " ".join(one.text for lines in pages_of(tmp_path / "courses.pdf") for one in lines),
        "web page": page(found),
        "terminal": "\n".join(lines_of([block])),
    }
    for medium, text in shown.items():
        assert "Tolerance" in text, medium
        assert all(half in text for half in halves), medium


def test_an_added_column_is_in_the_workbook_as_a_number(added, tmp_path):
    record, table, halves = added
    with Book(tmp_path / "courses.xlsx", record, WORDS) as book:
        columns = columns_of(book, table)
        book.table(book.sheet("courses"), 3, "courses", columns)
    rows = list(openpyxl.load_workbook(tmp_path / "courses.xlsx").active.iter_rows(min_row=4))
    assert rows[0][len(columns) - 1].value == "Tolerance, m"
    assert [f"{row[len(columns) - 1].value:.3f}" for row in rows[1:]] == halves


def test_an_added_column_is_in_the_csv_file(added, tmp_path):
    record, table, halves = added
    write_table(replace(table, csv_style="%.3f"), tmp_path / "courses.csv", table.rows(record))
    with open(tmp_path / "courses.csv", encoding="utf-8", newline="") as file:
        assert [row["half_m"] for row in csv.DictReader(file)] == halves


def every_table():
    """{name: declared Table} of all that a record may have."""
    record = kept("uncertain")
    declared = [one for room in (tank, survey, stated, monte_carlo, rule)
                for one in vars(room).values() if hasattr(one, "on_paper")]  # fmt: skip
    made = [
        capacity.capacity_table(record),
        capacity.parts_table(record),
        budget.budget_table(3),
        method.stated_table(record),
        survey.camera_table(["c", "K1"], WORDS),
    ]
    return [one for one in declared + made if not isinstance(one, type)]


@pytest.mark.parametrize("language", ["en", "pt-BR", "es"])
def test_every_declared_column_has_its_heading(language):
    words = load_words(language)
    for table in every_table():
        on_paper = not any(table is one for one in OF_THE_WORKBOOK)
        for column in table.columns:
            place = table.name, column.key
            if on_paper and column.on != "" and column.heading != "by_monte_carlo":
                assert (column.heading or column.key) in words["table_headings"], place
            if isinstance(column.sheet, str):
                assert words["workbook"]["columns"][column.sheet].format(**column.named), place


def test_a_column_follows_its_uncertainty_in_every_medium(tmp_path):
    """Second method: digits found from the record alone."""
    record = kept("furnished")
    words = load_words("en")
    paper = Paper(record, words)
    digits = [decimals_of(row["radius_sd_m"]) for row in record["courses"]]
    radii = next(one for one in tank.COURSES.columns if one.key == "radius_m")
    texts = paper.column_texts(record["courses"], radii)
    assert [len(text.partition(".")[2]) for text in texts] == digits
    with Book(tmp_path / "courses.xlsx", record, words) as book:
        sheet = {column.heading: column for column in columns_of(book, tank.COURSES)}
    assert sheet["Radius (m)"].digits == digits
    assert sheet["Radius (m)"].cells == [row["radius_m"] for row in record["courses"]]


def test_last_keys_belong_to_the_table():
    for table in every_table():
        keys = {column.key for column in table.columns}
        keys |= {column.in_sheet.get("key") for column in table.columns}
        for medium, last in table.last.items():
            assert set(last.split()) <= keys, (table.name, medium)
