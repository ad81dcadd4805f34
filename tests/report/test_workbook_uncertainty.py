"""The sheets of the uncertainty: budgets, deliveries, Monte Carlo, decision rule, as recorded."""

import json

import openpyxl
import pytest
from sheet_links import is_in_index
from uncertain_job import HOSTILE, as_before, write_uncertain_record

from tankcal.report.outputs import write_tables
from tankcal.report.paper import Paper
from tankcal.report.uncertainty import method, monte_carlo, rule
from tankcal.report.uncertainty.stated import stated_rows
from tankcal.report.workbook import write

# openpyxl does not know our data bars, and says so each time
pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")
SAME = 1e-15  # XlsxWriter stores 16 significant digits


SLOW_FIXTURES = {"book", "record"}  # seconds each


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = write_uncertain_record(tmp_path_factory.mktemp("uncertain"))
    return json.loads(path.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def book(record, tmp_path_factory):
    return written(record, tmp_path_factory.mktemp("workbook"))


def written(record, folder):
    write(record, folder / "capacity.xlsx")
    return openpyxl.load_workbook(folder / "capacity.xlsx")


def table_of(book, name):
    """{heading: cells} of an Excel table, wherever it stands."""
    ((sheet, table),) = ((sheet, sheet.tables[name]) for sheet in book if name in sheet.tables)
    heads, *rows = ([cell.value for cell in row] for row in sheet[table.ref])
    return dict(zip(heads, zip(*rows, strict=True), strict=True))


def texts(sheet):
    return [cell.value for row in sheet for cell in row if isinstance(cell.value, str)]


def or_dash(values):
    """As the sheets show what does not exist."""
    return ["–" if value is None else pytest.approx(value, rel=SAME) for value in values]


def test_every_budget_is_on_its_sheet(book, record):
    budgets = {"budget": record["budget"]}
    budgets |= {f"budget_{i}": one["lines"] for i, one in enumerate(record["budgets"], 2)}
    for name, lines in budgets.items():
        table = table_of(book, name)
        for heading, key in (
            ("Estimate", "estimate"),
            ("u of the input", "u"),
            ("Contribution (m³)", "contribution_m3"),
            ("Share of variance", "share"),
            ("U with half of this u", "halved"),
        ):
            assert list(table[heading]) == or_dash(line[key] for line in lines), name
        marked = [text.endswith("(default)") for text in table["Input"]]
        assert marked == [line["is_default"] for line in lines]
        for text, line in zip(table["Note"], lines, strict=True):
            assert text.startswith(line["note"])
            assert all(f"r = {r:g}" in text for _, r in line["correlations"])
    assert table_of(book, "budget")["Note"][0].startswith(HOSTILE)


def test_stated_volumes_and_worst_deliveries_are_the_record(book, record):
    stated, rows = table_of(book, "stated"), stated_rows(record)
    for heading, key in (
        ("From dip (m)", "high_m"),
        ("Down to (m)", "low_m"),
        ("Volume (m³)", "volume_m3"),
        ("U (m³)", "U_m3"),
        ("k", "k"),
    ):
        assert list(stated[heading]) == or_dash(row[key] for row in rows)
    assert "Monte Carlo" in stated["Interval"]
    assert [one or "" for one in stated["Remark"]] == [
        "; ".join(method.remarks(Paper(record), row)) for row in rows
    ]
    worst = table_of(book, "worst_deliveries")
    found = [one["at_minimum"] for one in record["deliveries"]]
    at_minimum = [
        place for place, text in enumerate(worst["Largest"]) if "exactly this height" in text
    ]
    for heading, key in (("U (m³)", "U_m3"), ("U over volume", "relative")):
        assert [worst[heading][place] for place in at_minimum] == or_dash(one[key] for one in found)


def test_every_row_of_the_simulation_is_there(book, record):
    capacity, rows = record["capacity"], record["monte_carlo"]["rows"]
    table = table_of(book, "monte_carlo")
    for heading, values in {
        "Dip height (m)": capacity["height_m"],
        "Mean (m³)": rows["value"],
        "u (m³)": rows["u"],
        "From (m³)": rows["low"],
        "To (m³)": rows["high"],
        "Difference, lower end (m³)": rows["d_low"],
        "Difference, upper end (m³)": rows["d_high"],
        "Tolerance (m³)": rows["tolerance"],
        "Draws": rows["draws"],
    }.items():
        assert list(table[heading]) == or_dash(values), heading
    assert list(table["GUM validated"]) == ["yes" if one else "no" for one in rows["validated"]]
    for heading, sign in (("GUM from (m³)", -1), ("GUM to (m³)", 1)):
        pairs = zip(capacity["volume_m3"], capacity["U_m3"], strict=True)
        assert list(table[heading]) == or_dash(volume + sign * U for volume, U in pairs)
    said = texts(book["Monte Carlo"])
    assert all(text in said for _, text in monte_carlo.facts(Paper(record)))


def test_the_decision_rule_is_the_record(book, record):
    verdict = record["rule"]
    limits = table_of(book, "limits")
    for heading, key in (
        ("At most", "limit"),
        ("Met from (m)", "from_m"),
        ("Met from (m³)", "from_m3"),
        ("Worst: U (m³)", "worst_U_m3"),
    ):
        assert list(limits[heading]) == or_dash(one[key] for one in verdict["uncertainty"])
    assert list(limits["Read in the original text"]) == ["yes", "no", "no"]
    assert list(limits["Verdict"]) == ["met from there upwards", "NOT met", "stated"]
    deviations = table_of(book, "deviations")
    for heading, key in (("Stated (m³)", "stated_m3"), ("Conformity", "probability")):
        assert list(deviations[heading]) == or_dash(one[key] for one in verdict["deviation"])
    accepted = table_of(book, "acceptance")
    for place, letter in enumerate("LU"):
        ends = [one["accepted_m3"][place] for one in verdict["deviation"]]
        assert list(accepted[f"A{letter} (m³)"]) == or_dash(ends)
    for sheet in ("Decision rule", "Certificate"):
        said = texts(book[sheet])
        assert HOSTILE in said
        assert set(rule.sentences(Paper(record))) <= set(said)


def test_the_certificate_tells_method_and_inputs(book, record):
    said = texts(book["Certificate"])
    assert "Monte Carlo" in said  # in place of k
    sentences = method.sentences(Paper(record), '"Monte Carlo"')
    assert len(sentences) == 3  # what U is, the sentence on k, Monte Carlo
    assert set(sentences) <= set(said)
    assert all(text in said for _, text in method.inputs(Paper(record)) if text)


def test_no_text_of_the_job_becomes_a_formula(book):
    for sheet in book:
        for cell in (cell for row in sheet for cell in row):
            assert is_in_index(cell, book) or cell.hyperlink is None
            if cell.data_type == "f":
                assert sheet.title in (
                    "Dip calculator",
                    "Quantity",
                    "Quantity workings",
                    "Workings",
                )
                assert HOSTILE not in cell.value


@pytest.mark.slow
def test_an_earlier_record_has_no_such_sheets(record, tmp_path):
    old = as_before(record)
    book = written(old, tmp_path)
    assert {"Deliveries", "Monte Carlo", "Decision rule"}.isdisjoint(book.sheetnames)
    table = table_of(book, "capacity_table")
    assert list(table["Expanded uncertainty U (m³)"]) == or_dash(old["capacity"]["U_m3"])
    assert not {"From (m³)", "Interval"} & set(table)
    assert "capacity_interval" not in book.defined_names
    assert list(table_of(book, "budget")["Estimate"]) == ["–"] * len(old["budget"])


def test_the_csv_table_has_the_interval_that_counts(record, tmp_path):
    write_tables(record, tmp_path)
    heads, *lines = (tmp_path / "capacity.csv").read_text(encoding="utf-8").splitlines()
    assert heads.split(",")[:8] == [
        "height_m", "volume_m3", "u_m3", "k", "U_m3", "low_m3", "high_m3", "interval"
    ]  # fmt: skip
    capacity = record["capacity"]
    rows = [line.split(",") for line in lines]
    assert [row[7] for row in rows] == capacity["interval"]
    simulated = [one == "monte_carlo" for one in capacity["interval"]]
    assert [row[3] == "" for row in rows] == simulated  # U is not k u there
    for place, key in ((4, "stated_U_m3"), (5, "low_m3"), (6, "high_m3")):
        values = [float(row[place]) for row in rows]
        assert values == pytest.approx(capacity[key], abs=5.0001e-7), key
