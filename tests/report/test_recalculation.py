"""Every formula of the workbook, recalculated by LibreOffice, gives what is stored with it."""

import pytest
from calculated_tanks import afloat, example_with_rows
from recalculation import recalculated, without_results

from tankcal.report.workbook import write
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

# openpyxl does not know our data bars, and says so each time
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning"),
]
WORKBOOKS = (*LANGUAGES, "afloat")  # the last: with a roof, other densities, a reference height


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    """{name: ({(sheet, address): stored result}, the workbook as LibreOffice calculates it)}."""
    folder = tmp_path_factory.mktemp("workbooks")
    record, roofed = example_with_rows(0.2, folder)[1], afloat(folder)[1]
    sources, stored = [], []
    for name in WORKBOOKS:
        path, language = folder / f"{name}.xlsx", name if name in LANGUAGES else "en"
        write(record if name in LANGUAGES else roofed, path, language)
        source, results = without_results(path, load_words(language))
        sources.append(source)
        stored.append(results)
    books = recalculated(sources, folder)
    return dict(zip(WORKBOOKS, zip(stored, books, strict=True), strict=True))


def is_same(stored, found):
    if isinstance(stored, str) or stored is None:
        return stored is not None and stored == found
    return found == pytest.approx(stored, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", WORKBOOKS)
def test_every_formula_recalculates_to_its_stored_result(pairs, name, figure):
    stored, book = pairs[name]
    found = {(sheet, cell): book[sheet][cell].value for sheet, cell in stored}
    assert {place for place in stored if not is_same(stored[place], found[place])} == set()
    assert len(stored) > 90
    figure(f"formulas recalculated in LibreOffice ({name})", len(stored))
