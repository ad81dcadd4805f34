"""The sheet Quantity of the workbook, recalculated by LibreOffice, against the tickets.

Truth: `tankcal.products.quantity`, whose volume corrections have tests of published values and a
second implementation. The sheet computes the same steps by formulas, with derivatives in closed
form where the tickets use complex steps.
"""

import numpy as np
import openpyxl
import pytest
from calculated_tanks import afloat, example_with_rows
from quantity_cases import (
    CASES,
    GRID,
    LEVELS,
    LEVELS_OF_ROOF,
    STEPS,
    ULLAGES,
    case,
    save_with_levels,
    ticket_of,
)
from recalculation import recalculated

from tankcal.errors import InputError
from tankcal.products.quantity.chain import QUANTITIES
from tankcal.products.quantity.table import read_table
from tankcal.report.workbook.book import Book
from tankcal.report.workbook.calculator import factor_sheets
from tankcal.report.workbook.capacity import capacity_sheet
from tankcal.report.workbook.quantity import FORM, KEYS, quantity_sheets
from tankcal.report.workbook.quantity.uncertainty import QUANTITIES as OF_SHEET
from tankcal.tank.gauging import FIELDS_OF_U
from tankcal.text.words import load_words, translate_record

# openpyxl does not know our data bars, and says so each time
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:.*extension is not supported:UserWarning"),
]
WORDS = load_words("en")
CHOICES = WORDS["quantity"]["choices"]
SAME = 1e-9
OF_LIST = {"CNP-6-70": "cnp", "CNP-6-70-unrounded": "cnp_unrounded", "coefficient": "constant"}


def cells_of(sections):
    """{name of a cell: what is typed} of the sections of a ticket."""
    product, cells = sections["product"], {}
    group, kind = product.get("group"), product["density_is"]
    correction = product["correction"]
    cells["correction"] = CHOICES[OF_LIST[correction]] if correction in OF_LIST else correction
    cells["group"] = None if group is None else CHOICES[group]
    cells["base"] = product.get("base")
    cells["alpha"] = product.get("alpha_per_k")
    cells["density"], cells["density_is"] = product["density_kg_m3"], CHOICES[kind]
    cells["sample"] = product.get("density_temperature_c")
    hydrometer = product.get("hydrometer")
    cells["hydrometer"] = None if hydrometer is None else hydrometer.removeprefix("glass ")
    cells["sw"] = product.get("sw_percent")
    if sections.get("shell"):
        cells["insulated"] = WORDS["yes_no"]["yes"]
    for state, letter in (("opening", "o"), ("closing", "c")):
        for key, name in (("dip_m", "dip"), ("ullage_m", "ullage"), ("water_dip_m", "water"),
                          ("temperature_c", "liquid"), ("ambient_c", "ambient")):  # fmt: skip
            cells[f"{name}_{letter}"] = sections.get(state, {}).get(key)
    for name, value in sections.get("uncertainty", {}).items():
        cells[FIELDS_OF_U[name]] = value
    return cells


def write_form(record, path, language="en"):
    words = load_words(language)
    record = translate_record(words, record)
    with Book(path, record, words) as book:
        for sheet in (capacity_sheet, quantity_sheets, factor_sheets):
            sheet(book, record)


class Filled:
    """The recalculated sheet of one case."""

    def __init__(self, book, words=WORDS):
        self._book, self._words = book, words
        self._sheet = book[words["workbook"]["sheets"][FORM]]
        # A label of a result occurs below the inputs, where some labels occur as well.
        self._rows = {}
        for row in self._sheet.iter_rows(min_col=1, max_col=6):
            if row[0].value:
                self._rows[row[0].value.rsplit(" (", 1)[0]] = [cell.value for cell in row[1:]]

    def line(self, key):
        """Opening, closing, difference, U and k of a step."""
        return self._rows[self._words["quantity"]["labels"][key].rsplit(" (", 1)[0]]

    def room(self, name):
        """Level, volume, U and k of a room."""
        return self._rows[self._words["ticket"]["labels"][f"ticket_{name}"]][1:]

    def remark(self, key):
        return self._rows[self._words["quantity"]["columns"][key]][0]


def fill(source, out, cells):
    book = openpyxl.load_workbook(source)
    for name, value in cells.items():
        ((sheet, cell),) = book.defined_names[f"quantity_{name}"].destinations
        if value is not None:
            book[sheet][cell.replace("$", "")].value = value
    book.save(out)


def filled(source, cases, folder):
    """{name: Filled} of cases {name: cells}."""
    paths = {}
    for place, (name, cells) in enumerate(cases.items()):
        paths[name] = folder / f"{source.stem}-{place}.xlsx"
        fill(source, paths[name], cells)
    books = recalculated(list(paths.values()), folder)
    return {name: Filled(book) for name, book in zip(paths, books, strict=True)}


def pairs_of(make, cases, folder):
    """{name of a case: (ticket, or the error of its input; filled sheet)} of one tank."""
    record = make(folder)
    table = read_table(folder / "record.json")
    write_form(record, folder / "form.xlsx")
    sheets = filled(
        folder / "form.xlsx", {key: cells_of(own) for key, own in cases.items()}, folder
    )
    pairs = {}
    for key, sections in cases.items():
        try:
            ticket = ticket_of(sections, folder, table)
        except InputError as error:
            ticket = error
        pairs[key] = ticket, sheets[key]
    return pairs


def example(folder):
    return save_with_levels(example_with_rows(0.2, folder)[1], LEVELS, folder)


@pytest.fixture(scope="module")
def upright(tmp_path_factory):
    return pairs_of(example, CASES, tmp_path_factory.mktemp("upright"))


@pytest.fixture(scope="module")
def grid(tmp_path_factory):
    return pairs_of(example, GRID, tmp_path_factory.mktemp("grid"))


@pytest.fixture(scope="module")
def roofed(tmp_path_factory):
    return pairs_of(
        lambda folder: save_with_levels(afloat(folder)[1], LEVELS_OF_ROOF, folder),
        ULLAGES, tmp_path_factory.mktemp("roofed"),
    )  # fmt: skip


@pytest.fixture(scope="module")
def lying(tmp_path_factory, records_of_kinds):
    def make(folder):
        shares = {"maximum_m": 0.93, "minimum_m": 0.21, "pump_suction_m": 0.047}
        levels = {"full_m": None} | {key: round(share * top, 3) for key, share in shares.items()}
        return save_with_levels(records_of_kinds["lying"], levels, folder)

    top = records_of_kinds["lying"]["capacity"]["height_m"][-1]
    gaugings = {
        name: {"dip_m": round(share * top, 3), "temperature_c": celsius, "ambient_c": 30.0}
        for name, share, celsius in (("opening", 0.3, 28.0), ("closing", 0.8, 34.0))
    }
    cases = {"lying": case("D1250-04", 842.0, group="products", base="20C", **gaugings)}
    return pairs_of(make, cases, tmp_path_factory.mktemp("lying"))


def compare(ticket, sheet):
    """Assert that the sheet shows the numbers of a ticket."""
    if isinstance(ticket, InputError):
        assert sheet.line("nsv")[2] == "–", ticket
        assert "Refused" in sheet.remark("closing") + sheet.remark("product")
        return
    assert sheet.remark("closing").startswith("Accepted"), sheet.remark("closing")
    transfer = ticket.transfer
    for place, state in enumerate(("opening", "closing")):
        if state not in transfer.steps:
            assert sheet.line("nsv")[place] == "–"
            continue
        for label, name in STEPS.items():
            expected = float(np.real(getattr(transfer.steps[state], name))[0])
            assert sheet.line(label)[place] == pytest.approx(expected, rel=SAME, abs=1e-9), name
    quantities = transfer.quantities()
    total = quantities.get("moved", quantities["closing"])
    for label, name in zip(OF_SHEET, QUANTITIES, strict=True):
        place = QUANTITIES.index(name)
        _, _, moved, U, k = sheet.line(label)
        assert moved == pytest.approx(total.value[0, place], rel=SAME), name
        assert pytest.approx(total.U[0, place], rel=SAME) == U, name
        assert k == pytest.approx(total.k[0, place], rel=SAME), name
    rooms = transfer.rooms()
    assert len(transfer.room_levels) == 3
    for place, (name, dip) in enumerate(transfer.room_levels.items()):
        level, value, U, k = sheet.room(name)
        assert level == dip
        assert value == pytest.approx(rooms.value[0, place], rel=SAME, abs=1e-9), name
        assert pytest.approx(rooms.U[0, place], rel=SAME) == U, name
        assert k == pytest.approx(rooms.k[0, place], rel=SAME), name


@pytest.mark.parametrize("key", CASES)
def test_the_sheet_shows_the_numbers_of_the_ticket(upright, key):
    compare(*upright[key])


@pytest.mark.study
@pytest.mark.parametrize("key", GRID)
def test_each_group_edition_and_base_agrees_with_the_ticket(grid, key):
    compare(*grid[key])


@pytest.mark.parametrize("key", ULLAGES)
def test_ullages_and_roofs_agree_with_the_ticket(roofed, key):
    compare(*roofed[key])


def test_a_shell_that_expands_in_all_directions_agrees_with_the_ticket(lying):
    ticket, sheet = lying["lying"]
    assert not isinstance(ticket, InputError)
    compare(ticket, sheet)


GOOD = cells_of(case("D1250-04", 842.0, group="products", base="20C"))
REFUSED = {
    "no edition": ({"correction": None}, "product", "choose the volume correction"),
    "no group": ({"group": None}, "product", "choose the group"),
    "no base": ({"base": None}, "product", "choose the base"),
    "own text": ({"base": "25C"}, "product", "choose an entry"),
    "relative density": ({"density": 0.842}, "product", "relative density"),
    "light": ({"density": 400.0}, "product", "density at the base is outside the range"),
    "kind of density": ({"density_is": None}, "product", "observed or at the base"),
    "no sample": ({"density_is": CHOICES["observed"]}, "product", "temperature of the sample"),
    "S&W": ({"sw": "much"}, "product", "S&W in percent"),
    "negative u": ({"u_dip": -1.0}, "product", "standard uncertainty"),
    "base of CNP": ({"correction": CHOICES["cnp"], "group": None, "base": "15C"}, "product",
                    "fixed base"),
    "decimals of CNP": ({"correction": CHOICES["cnp"], "group": None, "base": None,
                         "density": 700.0}, "product", "number of decimals"),
    "hot": ({"liquid_c": 160.0}, "closing", "outside the range of the volume correction"),
    "dip and ullage": ({"ullage_c": 1.0}, "closing", "either the dip or the ullage"),
    "dip as text": ({"dip_c": "8,642"}, "closing", "not a number"),
    "above the table": ({"dip_c": 12.0}, "closing", "outside the table"),
    "water": ({"water_c": 9.0}, "closing", "not below the dip"),
    "no temperature": ({"liquid_o": None}, "opening", "temperature of the liquid"),
    "no air": ({"ambient_o": None}, "opening", "temperature of the air"),
    "typed in vain": ({"factor_c": 0.99}, "closing", "VCF is computed"),
}  # fmt: skip
TYPED = GOOD | {
    "correction": CHOICES["typed"], "group": None, "base": None, "name": "OIML R 22, 20 °C",
    "density": 809.75, "factor_o": 1.0021, "factor_c": 0.9879,
}  # fmt: skip


@pytest.fixture(scope="module")
def typed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("typed")
    write_form(example(folder), folder / "form.xlsx")
    cases = {key: GOOD | changes for key, (changes, _, _) in REFUSED.items()}
    return filled(folder / "form.xlsx", cases | {"typed": TYPED}, folder)


@pytest.mark.parametrize("key", REFUSED)
def test_input_outside_a_range_is_refused_in_the_cell(typed, key):
    _, place, text = REFUSED[key]
    remark = typed[key].remark(place)
    assert remark.startswith("Refused:")
    assert text in remark
    assert typed[key].line("nsv")[2:] == ["–", "–", "–"]


def test_an_allowed_range_is_never_wider_than_that_of_the_correction(upright):
    # 0 degF is -17.777... degC, 250 degF is 121.111... degC
    _, sheet = upright["D1250-80 crude"]
    assert sheet.line("t_range")[:2] == [-17.77, 148.88]
    _, sheet = upright["D1250-80 products"]
    assert sheet.line("t_range")[:2] == [-17.77, 93.33]
    assert sheet.line("rho_range")[:2] == [652.94, 1074.98]


def test_a_typed_factor_has_a_U_of_observed_volumes_only(typed):
    sheet = typed["typed"]
    assert sheet.remark("closing") == "Accepted."
    for key in ("gsv", "nsv", "mass", "weight"):
        opening, closing, moved, *rest = sheet.line(key)
        assert moved == pytest.approx(closing - opening, rel=1e-12)
        assert rest == ["–", "–"]
    gov = sheet.line("gov")
    assert gov[3] > 0
    assert sheet.line("gsv")[1] == pytest.approx(gov[1] * 0.9879, rel=1e-12)


def test_each_input_of_the_form_is_open_and_everything_else_is_locked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("locked")
    write_form(example(folder), folder / "form.xlsx")
    book = openpyxl.load_workbook(folder / "form.xlsx")
    sheet = book[WORDS["workbook"]["sheets"][FORM]]
    assert sheet.protection.sheet
    assert book[WORDS["workbook"]["sheets"]["quantity_workings"]].protection.sheet
    opened = {cell.coordinate for row in sheet for cell in row if not cell.protection.locked}
    named = {
        place[1].replace("$", "")
        for defined in book.defined_names.values()
        for place in defined.destinations
        if place[0] == sheet.title
    }
    assert opened == named
    assert len(opened) == 33
    for key in KEYS:
        assert WORDS["quantity"]["sentences"][key]
