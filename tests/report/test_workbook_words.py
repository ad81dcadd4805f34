"""Every text of the workbook is of the words; all else is the same in each language."""

import re
import xml.etree.ElementTree as ET
import zipfile

import openpyxl
import pytest
from invented_language import bracketed, without_brackets
from workbook_records import KINDS

from tankcal.report import workbook
from tankcal.text.shipped import shipped_folder
from tankcal.text.words import load_words

# openpyxl does not know our data bars, and says so each time
pytestmark = pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning")
SHIPPED = sorted(
    path.stem for path in (shipped_folder("report_templates") / "words").glob("*.toml")
)
WORD = re.compile(r"[^\W\d_]{4,}")  # letters: more than a unit or a symbol has
UNITS = {"ppm", "arcsec", "CTSh"}


@pytest.fixture(scope="module")
def records(records_of_kinds):
    return records_of_kinds


def texts_in(value):
    """Every text of a record, the keys of its tables too."""
    if isinstance(value, dict):
        return set(value) | {text for one in value.values() for text in texts_in(one)}
    if isinstance(value, list):
        return {text for one in value for text in texts_in(one)}
    return {value} if isinstance(value, str) else set()


@pytest.fixture(scope="module")
def invented(records, tmp_path_factory):
    """{kind: path of its workbook in the invented language}."""
    folder = tmp_path_factory.mktemp("invented")
    english = load_words("en")
    words = bracketed(english) | {"language": english["language"]}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workbook, "load_words", lambda _: words)
        for kind, record in records.items():
            workbook.write(record, folder / f"{kind}.xlsx")
    return {kind: folder / f"{kind}.xlsx" for kind in records}


@pytest.fixture(scope="module")
def opened(invented):
    """{kind: that workbook as openpyxl reads it}."""
    return {kind: openpyxl.load_workbook(path) for kind, path in invented.items()}


def parts_of(path, beginning):
    """The XML parts of a workbook whose names begin so."""
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.startswith(beginning)]
        return {name: ET.fromstring(archive.read(name)) for name in names if ".rels" not in name}


def values_in(part, *tags):
    """Texts of the elements with these names, and of the attributes "element@attribute"."""
    for element in part.iter():
        tag = element.tag.rpartition("}")[2]
        if tag in tags and element.text:
            yield element.text
        for name, value in element.attrib.items():
            if f"{tag}@{name}" in tags:
                yield value


def texts_of_cells(book):
    """(sheet, cell, text) of texts in cells, and of those in quotation marks of formulas."""
    for sheet in book:
        for cell in (cell for row in sheet for cell in row if isinstance(cell.value, str)):
            is_formula = cell.data_type == "f"
            texts = re.findall(r'"([^"]*)"', cell.value) if is_formula else [cell.value]
            yield from ((sheet.title, cell.coordinate, text) for text in texts)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_cell_has_a_text_that_is_not_of_the_words(opened, records, kind):
    """In a language of brackets no word stands outside of them but what the record says."""
    known = {word for text in texts_in(records[kind]) for word in WORD.findall(text)} | UNITS
    texts = [*texts_of_cells(opened[kind])]
    strange = {one for one in texts if set(WORD.findall(without_brackets(one[2]))) - known}
    assert not strange
    assert any("⟦" in text for _, _, text in texts)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_headings_charts_and_messages_are_of_the_words(invented, records, kind):
    parts = {}
    for beginning, tags in {
        "xl/charts/": ("t",),
        "xl/drawings/": ("cNvPr@descr",),
        "xl/tables/": ("tableColumn@name",),
        "xl/workbook.xml": ("sheet@name",),
        "xl/worksheets/": (
            "dataValidation@promptTitle", "dataValidation@prompt",
            "dataValidation@errorTitle", "dataValidation@error",
        ),
        "docProps/core.xml": ("title", "description"),
    }.items():  # fmt: skip
        found = [
            text
            for part in parts_of(invented[kind], beginning).values()
            for text in values_in(part, *tags)
        ]
        parts[beginning] = found
        assert [text for text in found if "⟦" not in text] == [] or beginning == "xl/tables/"
    known = {word for text in texts_in(records[kind]) for word in WORD.findall(text)} | UNITS
    for heading in parts["xl/tables/"]:
        assert set(WORD.findall(without_brackets(heading))) <= known, heading
    for beginning in ("xl/tables/", "xl/workbook.xml", "docProps/core.xml"):
        assert parts[beginning], beginning
    if kind != "survey":
        assert parts["xl/charts/"]
        assert parts["xl/drawings/"]
        assert parts["xl/worksheets/"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_page_headers_and_footers_are_of_the_words(opened, kind):
    for sheet in opened[kind]:
        left, _, right = (
            getattr(sheet.oddHeader, side).text for side in ("left", "center", "right")
        )
        assert "⟦" in left
        assert sheet.title in right
        assert sheet.oddFooter.right.text == "⟦Page &P of &N⟧"


@pytest.mark.parametrize("language", SHIPPED)
def test_names_of_sheets_are_names_in_every_language(language):
    names = load_words(language)["workbook"]["sheets"].values()
    assert len({name.lower() for name in names}) == len(names)
    for name in names:
        assert 0 < len(name) <= 31, name
        assert not re.search(r"[\[\]:*?/\\]", name), name
        assert not name.startswith("'"), name
        assert not name.endswith("'"), name


def names_in(path):
    """(names of ranges, {name of a table: where it stands}, headings of each table)."""
    with zipfile.ZipFile(path) as archive:
        book = ET.fromstring(archive.read("xl/workbook.xml"))
    ranges = {one.get("name") for one in book.iter() if one.tag.endswith("}definedName")}
    tables = [part for name, part in parts_of(path, "xl/tables/").items()]
    headings = [[one.lower() for one in values_in(table, "tableColumn@name")] for table in tables]
    return ranges, {table.get("name"): table.get("ref") for table in tables}, headings


@pytest.fixture(scope="module")
def english(records, tmp_path_factory):
    """{kind: (names of ranges, names of tables)} of the workbooks in English."""
    folder, found = tmp_path_factory.mktemp("english"), {}
    for kind, record in records.items():
        workbook.write(record, folder / f"{kind}.xlsx", "en")
        ranges, tables, _ = names_in(folder / f"{kind}.xlsx")
        found[kind] = ranges, set(tables)
    return found


@pytest.mark.slow
@pytest.mark.filterwarnings("error:Duplicate header name")
@pytest.mark.parametrize("language", [code for code in SHIPPED if code != "en"])
@pytest.mark.parametrize("kind", KINDS)
def test_range_and_table_names_are_equal_in_all_languages(
    records, english, kind, language, tmp_path
):
    path = tmp_path / "capacity.xlsx"
    workbook.write(records[kind], path, language)
    ranges, tables, headings = names_in(path)
    assert (ranges, set(tables)) == english[kind]
    for of_table in headings:
        assert len(set(of_table)) == len(of_table)
    (properties,) = parts_of(path, "docProps/custom.xml").values()
    assert language in values_in(properties, "lpwstr")
