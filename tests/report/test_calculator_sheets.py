"""The calculator's form and the plain sheets beside it, as they are written."""

import re

import numpy as np
import openpyxl
import pandas as pd
import pytest
from calculated_tanks import afloat, example_with_rows

from tankcal.report.workbook import write
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

# openpyxl does not know our data bars, and says so each time
pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")


SLOW_FIXTURES = {"record", "roofed", "path"}  # seconds each


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    return example_with_rows(0.2, tmp_path_factory.mktemp("example"))[1]


@pytest.fixture(scope="module")
def roofed(tmp_path_factory):
    """(record of a tank with a floating roof, path of its workbook)."""
    folder = tmp_path_factory.mktemp("roofed")
    record = afloat(folder)[1]
    write(record, folder / "capacity.xlsx")
    return record, folder / "capacity.xlsx"


@pytest.fixture(scope="module")
def path(record, tmp_path_factory):
    path = tmp_path_factory.mktemp("example") / "capacity.xlsx"
    write(record, path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_input_cells_have_names_and_prompts(record, language, tmp_path):
    """XlsxWriter leaves a validation out whose texts are too long for Excel."""
    write(record, tmp_path / "capacity.xlsx", language)
    book = openpyxl.load_workbook(tmp_path / "capacity.xlsx")
    form = book[load_words(language)["workbook"]["sheets"]["dip_calculator"]]
    named = {}
    for name, defined in book.defined_names.items():
        ((sheet, cell),) = defined.destinations
        if sheet == form.title:
            named[cell.replace("$", "")] = name
    open_cells = [
        (sheet.title, cell.coordinate)
        for sheet in book
        if sheet.title != load_words(language)["workbook"]["sheets"]["quantity"]
        for row in sheet
        for cell in row
        if not cell.protection.locked
    ]
    assert len(open_cells) == 9
    rules = {str(rule.sqref): rule for rule in form.data_validations.dataValidation}
    assert set(rules) == {cell for _, cell in open_cells} <= set(named)
    assert {sheet for sheet, _ in open_cells} == {form.title}
    for rule in rules.values():
        assert rule.promptTitle
        assert rule.prompt
        assert rule.error
        assert rule.showErrorMessage
    by_name = {name: rules[cell] for cell, name in named.items() if cell in rules}
    heights = record["capacity"]["height_m"]
    assert float(by_name["dip_m"].formula1) == heights[0]
    assert heights[-1] <= float(by_name["dip_m"].formula2) <= heights[-1] + 5e-4
    if language == "en":
        assert "not extended" in by_name["dip_m"].error
    assert (by_name["product_chosen"].type, by_name["product_chosen"].formula1) == (
        "list",
        "product_groups",
    )


OLD = {"IF", "AND", "OR", "NOT", "ISBLANK", "ISNUMBER", "ISLOGICAL", "INDEX", "MATCH", "MIN", "MAX",
       "ROWS", "ROUND", "CHOOSE", "SUMSQ", "SQRT", "EXP", "NORMSINV", "BETAINV", "LN", "ABS",
       "SIGN", "INT", "MOD", "COUNT", "SUM", "SUMPRODUCT", "MMULT",
       "ISERROR"}  # fmt: skip


WITHOUT_READING = {
    "en": "without the uncertainty of reading the table",
    "pt-BR": "sem a incerteza da leitura da tabela",
    "es": "sin la incertidumbre de la lectura de la tabla",
}


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_volume_and_delivery_say_that_their_U_is_without_reading(record, language, tmp_path):
    write(record, tmp_path / "words.xlsx", language)
    words = load_words(language)["workbook"]["sheets"]
    sheet = openpyxl.load_workbook(tmp_path / "words.xlsx")[words["dip_calculator"]]
    cells = [str(cell.value) for row in sheet.iter_rows() for cell in row]
    assert sum(WITHOUT_READING[language] in text for text in cells) == 2


@pytest.mark.slow
def test_formulas_use_only_functions_of_excel_2007(roofed):
    book = openpyxl.load_workbook(roofed[1])
    formulas = [
        cell.value for sheet in book for row in sheet for cell in row if cell.data_type == "f"
    ]
    assert len(formulas) > 90
    used = {name for formula in formulas for name in re.findall(r"([A-Z.]+)\(", formula)}
    assert used <= OLD
    assert max(map(len, formulas)) < 8192


@pytest.mark.slow
def test_capacity_mm_is_the_table_at_every_millimetre(record, path):
    table = pd.read_excel(path, sheet_name="Capacity mm")
    capacity = record["capacity"]
    heights, volumes = capacity["height_m"], capacity["volume_m3"]
    assert list(table.columns) == ["Dip (mm)", "Volume (L)"]
    assert list(table["Dip (mm)"]) == list(range(round(1000 * heights[-1]) + 1))
    expected = 1000 * np.interp(table["Dip (mm)"] / 1000, heights, volumes)
    np.testing.assert_allclose(table["Volume (L)"], expected, rtol=1e-13, atol=1e-9)
    assert table["Volume (L)"].iloc[-1] == pytest.approx(1000 * volumes[-1], rel=1e-15)


@pytest.mark.slow
def test_capacity_mm_is_blank_in_a_critical_zone(roofed):
    table = pd.read_excel(roofed[1], sheet_name="Capacity mm").set_index("Dip (mm)")["Volume (L)"]
    assert list(table.index[table.isna()]) == list(range(1001, 1300))


def test_the_factor_gives_the_covariance_of_the_rows(record, path):
    table = pd.read_excel(path, sheet_name="Covariance factor")
    assert len(set(table.columns)) == 1 + len(record["capacity"]["inputs"])
    kept = table.iloc[:, 1:].to_numpy()
    combinations = pd.read_excel(path, sheet_name="Covariance weights")
    assert list(combinations["Dip (m)"]) == record["capacity"]["height_m"]
    weights = combinations.iloc[:, 3:].to_numpy()
    rows = zip(combinations["First kept row"], combinations["Last kept row"], weights, strict=True)
    factor = np.array(
        [row[: last - first + 1] @ kept[first - 1 : last] for first, last, row in rows]
    )
    u = np.sqrt((factor**2).sum(axis=1))
    np.testing.assert_allclose(u, record["capacity"]["u_m3"], rtol=1e-13)
