"""What `tankcal ticket --out FOLDER` writes: a page to sign, XML, workbook, page; verification."""

import csv
import io
import json
import shutil
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import openpyxl
import pypdf
import pytest
from dcc_schema import DCC, SI, schema

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.quantity.reading import read_tickets
from tankcal.products.quantity.results import document_file, ticket_file
from tankcal.products.quantity.table import TankTable, read_table
from tankcal.record.schema import to_plain
from tankcal.report.laboratory import Letterhead
from tankcal.report.ticket import TicketPaper, write_ticket
from tankcal.report.ticket.pages import BOOKLET, comparison_text
from tankcal.report.verification import verify
from tankcal.tank.fittings import floating_roof
from tankcal.text.shipped import LANGUAGES
from tankcal.text.words import load_words

TOML = """
[ticket]
number = "2026-118"
date = 2026-05-03
by = "M. Souza"
[product]
name = "diesel S10"
correction = "D1250-04"
group = "products"
base = "20C"
density_kg_m3 = 835.2
density_is = "observed"
density_temperature_c = 27.5
hydrometer = "glass 20C"
sw_percent = 0.05
[opening]
dip_m = 2.317
water_dip_m = 0.012
temperature_c = 28.4
ambient_c = 25.0
[closing]
dip_m = 8.642
water_dip_m = 0.012
temperature_c = 31.2
ambient_c = 29.0
[compared]
quantity = "nsv_m3"
value = 824.0
U = 1.2
source = "meter FT-12"
"""
LONG = {  # the fullest ticket: roof, ullage, warnings, long texts
    "ticket": {
        "number": "TRANSFER-2026-000118",
        "date": "2026-05-03",
        "by": "Maria Aparecida de Souza e Silva",
        "customer": "Distribuidora Atlântica de Combustíveis Ltda., terminal de Santos",
        "note": "second opening of the valve at 10:40; gauged again after twelve minutes",
    },
    "product": {
        "name": "gasolina A", "correction": "D1250-04", "group": "products", "base": "20C",
        "density_kg_m3": 738.4, "density_is": "observed", "density_temperature_c": 27.5,
        "hydrometer": "glass 20C", "sw_percent": 0.004,
    },
    "opening": {"ullage_m": 10.2, "water_dip_m": 0.2, "temperature_c": 28.4, "ambient_c": 51.0,
                "reference_height_m": 12.606},
    "closing": {"ullage_m": 3.0, "water_dip_m": 0.2, "temperature_c": 31.2, "ambient_c": 52.0},
    "compared": {"quantity": "weight_kg", "value": 700_000.0, "U": 900.0,
                 "source": "meter of the receiving terminal, line 12"},
}  # fmt: skip


def _cylinder():
    """Table of a cylinder of 131 m3 per metre with a floating roof; 8 degrees of freedom."""
    height = np.linspace(0.0, 12.0, 1201)
    factor = np.column_stack([131.0 * height * 3e-4, np.full(len(height), 0.05)])
    roof = floating_roof(42_000.0, 1.0, 1.5, 850.0, "vacuum")
    certificate = {"number": "C-2026-17", "laboratory": "Laboratório", "notice": "EXAMPLE"}
    return TankTable(
        "TK-1", "vertical", height, 131.0 * height, factor, np.full(len(height), 8.0), 1e-4, 20.0,
        1.116e-5, 0.0, roof, 12.6, "0" * 64, certificate=certificate, date="2026-01-31",
    )  # fmt: skip


@pytest.fixture(scope="module")
def tank(example_record, tmp_path_factory):
    """A folder with results/record.json and ticket.toml, and the written ticket in `out`."""
    folder = tmp_path_factory.mktemp("tank")
    (folder / "results").mkdir()
    shutil.copy(example_record, folder / "results" / "record.json")
    for path in example_record.parent.glob("record_tables.npz"):
        shutil.copy(path, folder / "results")
    (folder / "ticket.toml").write_text(
        TOML.replace("8.642", "8.5").replace("824.0", "804.5"), encoding="utf-8"
    )
    ticket = ["ticket", str(folder / "results" / "record.json"), str(folder / "ticket.toml")]
    assert main([*ticket, "--out", str(folder / "out"), "--language", "pt-BR", "--quiet"]) == 0
    return folder


def _copy(tank, tmp_path):
    return shutil.copytree(tank, tmp_path / "tank")


@pytest.mark.slow
def test_saved_values_are_those_of_the_computation(tank):
    saved = json.loads((tank / "out" / "ticket.json").read_text(encoding="utf-8"))
    table = read_table(tank / "results" / "record.json")
    tickets = read_tickets(table, tank / "ticket.toml")
    moved = tickets.quantities["moved"]
    (row,) = (row for row in saved["quantities"]
              if (row["state"], row["quantity"]) == ("moved", "nsv_m3"))  # fmt: skip
    assert (row["value"], row["U"]) == (moved.value[0, 3], moved.U[0, 3])
    assert saved["table"]["sha256"] == table.digest
    assert saved["files"][0]["file"] == "ticket.toml"
    with (tank / "out" / "quantities.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(each["U"]) for each in rows] == pytest.approx(
        [each["U"] for each in saved["quantities"]], rel=1e-14
    )


def test_saved_budgets_add_up(tank):
    saved = json.loads((tank / "out" / "ticket.json").read_text(encoding="utf-8"))
    for row in saved["quantities"]:
        of_row = row["state"], row["quantity"]
        parts = [part for part in saved["budget"] if (part["state"], part["quantity"]) == of_row]
        total = sum(part["contribution"] ** 2 for part in parts)
        assert np.sqrt(total) == pytest.approx(row["u"], rel=1e-12)
        assert sum(part["share"] for part in parts) == pytest.approx(1.0, rel=1e-12)


def test_assumed_uncertainties_are_marked(tank):
    saved = json.loads((tank / "out" / "ticket.json").read_text(encoding="utf-8"))
    assert {row["origin"] for row in saved["uncertainties"]} == {"memory", "assumed"}
    text = pypdf.PdfReader(tank / "out" / "ticket.pdf").pages[0].extract_text()
    words = load_words("pt-BR")["ticket"]
    assert words["origins"]["memory"].replace("\xa0", " ") in text.replace("\xa0", " ")


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_fullest_ticket_is_a_single_page(language, tmp_path):
    """With a letterhead, floating roof, warnings and long texts, in each language."""
    letterhead = Letterhead("Laboratório de Metrologia", ("Rua A, 1", "Santos"), None, {
        "ink": "#1a2b3c", "line": "#9aa5b1"}, None)  # fmt: skip
    tickets = read_tickets(_cylinder(), LONG)
    assert len(tickets.warnings) == 4
    write_ticket(document_file(tickets), tmp_path / "out", language, letterhead=letterhead)
    reader = pypdf.PdfReader(tmp_path / "out" / "ticket.pdf")
    assert len(reader.pages) == 1
    text = reader.pages[0].extract_text()
    assert "TRANSFER-2026-000118" in text
    assert "{" not in text
    assert "/AcroForm" in reader.trailer["/Root"]  # the field for the signature
    assert set(reader.attachments) == {"ticket.json", "ticket.xlsx", "ticket.xml"}


@pytest.mark.slow
def test_degrees_of_freedom_of_the_table_reach_the_quantities():
    """Only the table has finite degrees of freedom, 8; other inputs are negligible here."""
    names = ("u_dip_mm", "u_tape_ppm", "u_water_dip_mm", "u_temperature_k", "u_thermometer_k",
             "u_ambient_k", "u_density_kg_m3", "u_sw_percent", "u_vcf_percent",
             "u_expansion_per_k")  # fmt: skip
    tickets = read_tickets(_cylinder(), LONG | {"uncertainty": dict.fromkeys(names, 1e-12)})
    saved = to_plain(ticket_file(tickets))
    assert {row["origin"] for row in saved["uncertainties"]} == {"declared"}
    for row in saved["quantities"]:
        assert row["dof"] == pytest.approx(8.0, rel=1e-3)
        assert row["k"] == pytest.approx(2.306, abs=1e-3)  # Student's t, 97.5 %


@pytest.mark.slow
def test_xml_has_the_structure_of_the_digital_certificate(tank):
    data = (tank / "out" / "ticket.xml").read_bytes()
    schema().validate(data.decode("utf-8"))
    root = ElementTree.fromstring(data)
    saved = json.loads((tank / "out" / "ticket.json").read_text(encoding="utf-8"))
    stated = [float(each.text) for each in root.iter(f"{{{SI}}}valueExpandedMU")]
    assert stated == [row["U"] for row in saved["quantities"]]
    assert root.find(f".//{{{DCC}}}conformity").text == "pass"


def test_workbook_has_numbers(tank):
    book = openpyxl.load_workbook(tank / "out" / "ticket.xlsx")
    saved = json.loads((tank / "out" / "ticket.json").read_text(encoding="utf-8"))
    numbers = {cell.value for row in book.worksheets[1] for cell in row}
    numbers = np.array([number for number in numbers if isinstance(number, float)])
    for row in saved["quantities"]:
        assert np.min(np.abs(numbers / row["value"] - 1)) < 1e-14


@pytest.mark.slow
def test_verification_computes_the_ticket_again(tank):
    result = verify(tank / "out")
    assert (result.problems, result.papers_again) == ([], True)
    assert [note.code for note in result.notes] == ["verify_values_again"]
    assert result.is_whole


def _write_again(folder, change):
    """Change ticket.json, and make every other file and SHA256SUMS fit."""
    saved = json.loads((folder / "ticket.json").read_text(encoding="utf-8"))
    change(saved)
    shutil.rmtree(folder)
    write_ticket(saved, folder, "pt-BR")


def _enlarge(saved):
    for row in saved["quantities"]:
        row["value"] += 0.5


def _shrink_u(saved):
    for row in saved["quantities"]:
        row["U"] /= 2


def _move_dip(saved):
    saved["inputs"]["closing"]["dip_m"] -= 0.002


def _declare(saved):
    for row in saved["uncertainties"]:
        row["origin"] = "declared"


@pytest.mark.slow
@pytest.mark.parametrize("change", [_enlarge, _shrink_u, _move_dip, _declare])
def test_a_changed_ticket_is_detected_although_all_files_agree(tank, tmp_path, change):
    folder = _copy(tank, tmp_path)
    _write_again(folder / "out", change)
    result = verify(folder / "out")
    assert {problem.expected.code for problem in result.problems} == {"verify_value_apart"}


@pytest.mark.slow
def test_changed_files_are_detected(tank, tmp_path):
    folder = _copy(tank, tmp_path)
    path = folder / "out" / "steps.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("1", "2", 1), encoding="utf-8")
    toml = folder / "ticket.toml"
    toml.write_text(toml.read_text(encoding="utf-8").replace("28.4", "28.5"), encoding="utf-8")
    codes = {problem.expected.code for problem in verify(folder / "out").problems}
    assert codes == {"verify_other_paper", "verify_input_changed"}


@pytest.mark.slow
def test_without_the_record_nothing_is_claimed(tank, tmp_path):
    folder = _copy(tank, tmp_path)
    (folder / "results" / "record.json").unlink()
    result = verify(folder / "out")
    assert [note.code for note in result.notes] == ["verify_record_not_found"]
    assert not result.is_whole
    assert result.by_hash == ["ticket.json"]


@pytest.mark.slow
def test_documents_are_made_again_in_another_language(tank, tmp_path, capsys):
    folder = _copy(tank, tmp_path) / "out"
    assert main(["report", str(folder), "--language", "es", "--quiet"]) == 0
    text = pypdf.PdfReader(folder / "ticket.pdf").pages[0].extract_text()
    assert "Boleta de medición" in text
    assert verify(folder).problems == []
    capsys.readouterr()


@pytest.mark.slow
def test_a_document_needs_number_and_date():
    with pytest.raises(InputError) as refused:
        document_file(read_tickets(_cylinder(), LONG | {"ticket": {}}))
    assert [problem.column for problem in refused.value.problems] == [
        "ticket.number", "ticket.date"]  # fmt: skip


def test_folder_with_other_files_is_left_alone(tank, tmp_path, capsys):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "letter.txt").write_text("mine", encoding="utf-8")
    ticket = ["ticket", str(tank / "results"), str(tank / "ticket.toml"), "--out", str(folder)]
    assert main(ticket) == 2
    assert [path.name for path in folder.iterdir()] == ["letter.txt"]
    assert "letter.txt" in capsys.readouterr().err


@pytest.mark.slow
def test_each_ticket_of_a_file_has_its_document(tank, tmp_path, capsys):
    folder, rows = tmp_path / "out", tmp_path / "rows.csv"
    ticket = ["ticket", str(tank / "results"), str(tank / "ticket.toml"), "--tickets", str(rows)]
    rows.write_text("ticket,date,closing_dip_m\nA/1,2026-05-04,7.5\nB,,8.0\n", encoding="utf-8")
    assert main([*ticket, "--out", str(tmp_path / "quantities.csv"), "--quiet"]) == 0
    assert main([*ticket, "--out", str(folder), "--quiet"]) == 0
    with (tmp_path / "quantities.csv").open(encoding="utf-8", newline="") as file:
        expected = [float(row["moved_U_nsv_m3"]) for row in csv.DictReader(file)]
    files = [folder / name / "ticket.json" for name in ("A_1", "B")]
    saved = [json.loads(file.read_text("utf-8")) for file in files]
    heads = [(one["number"], one["date"], one["gaugings"][1]["level_m"]) for one in saved]
    assert heads == [("A/1", "2026-05-04", 7.5), ("B", "2026-05-03", 8.0)]
    U = [row["U"] for one in saved for row in one["quantities"]
         if (row["state"], row["quantity"]) == ("moved", "nsv_m3")]  # fmt: skip
    assert expected == pytest.approx(U, rel=1e-9)
    assert all(verify(file.parent, tank / "results").problems == [] for file in files)
    capsys.readouterr()
    # Printed together, the pages are those of the documents.
    booklet = pypdf.PdfReader(folder / BOOKLET)
    single = [page.extract_text() for file in files
              for page in pypdf.PdfReader(file.with_suffix(".pdf")).pages]  # fmt: skip
    assert [page.extract_text() for page in booklet.pages] == single
    assert [entry.title for entry in booklet.outline] == ["A/1", "B"]
    attached = {name: content for name, (content,) in booklet.attachments.items()}
    assert attached == {f"{file.parent.name}/ticket.json": file.read_bytes() for file in files}
    assert booklet.get_fields() is None
    before = (folder / BOOKLET).read_bytes()
    assert main([*ticket, "--out", str(folder), "--quiet"]) == 0
    assert (folder / BOOKLET).read_bytes() == before
    capsys.readouterr()


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"%PDF-1.7 mine", b"letter"])
def test_a_pdf_of_the_user_is_not_replaced_by_the_pages(tank, tmp_path, capsys, content):
    folder, rows = tmp_path / "out", tmp_path / "rows.csv"
    folder.mkdir()
    (folder / BOOKLET).write_bytes(content)
    rows.write_text("ticket\nA\n", encoding="utf-8")
    ticket = ["ticket", str(tank / "results"), str(tank / "ticket.toml"), "--tickets", str(rows)]
    assert main([*ticket, "--out", str(folder)]) == 2
    assert "tickets.pdf: found a file that tankcal ticket did not write" in capsys.readouterr().err
    assert [path.name for path in folder.iterdir()] == [BOOKLET]
    assert (folder / BOOKLET).read_bytes() == content


@pytest.mark.slow
def test_folders_of_tickets_are_checked_before_the_first_document(tank, tmp_path, capsys):
    folder, rows = tmp_path / "out", tmp_path / "rows.csv"
    ticket = ["ticket", str(tank / "results"), str(tank / "ticket.toml"), "--tickets", str(rows)]
    rows.write_text("ticket\nA/1\na 1\n", encoding="utf-8")
    assert main([*ticket, "--out", str(folder)]) == 2
    expected = "rows.csv, row 3, ticket: the folder a_1 is also that of ticket A/1"
    assert expected in capsys.readouterr().err
    (folder / "B").mkdir(parents=True)
    (folder / "B" / "letter.txt").write_text("mine", encoding="utf-8")
    rows.write_text("ticket\nA\nB\n", encoding="utf-8")
    assert main([*ticket, "--out", str(folder)]) == 2
    assert [path.name for path in folder.rglob("*")] == ["B", "letter.txt"]


@pytest.mark.slow
def test_the_decision_of_a_comparison():
    saved = to_plain(ticket_file(read_tickets(_cylinder(), LONG)))
    assert saved["comparison"]["agrees"] is (abs(saved["comparison"]["e_n"]) <= 1)
    del saved["inputs"]["compared"]["U"]
    again = to_plain(ticket_file(read_tickets(_cylinder(), saved["inputs"])))
    assert again["comparison"]["agrees"] is None
    assert "not decided" in comparison_text(TicketPaper(again))


@pytest.mark.slow
def test_hostile_texts_stay_texts(tmp_path):
    hostile = {**LONG, "ticket": LONG["ticket"] | {"by": "=HYPERLINK(1)", "note": "<script>x" * 9}}
    write_ticket(document_file(read_tickets(_cylinder(), hostile)), tmp_path / "out")
    cells = [cell for sheet in openpyxl.load_workbook(tmp_path / "out" / "ticket.xlsx")
             for row in sheet for cell in row]  # fmt: skip
    assert not [cell for cell in cells if cell.data_type == "f"]
    assert "<script>x" not in (tmp_path / "out" / "ticket.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_stock_has_no_column_of_an_opening(tmp_path):
    stock = {section: values for section, values in LONG.items()
             if section not in ("opening", "compared")}  # fmt: skip
    write_ticket(document_file(read_tickets(_cylinder(), stock)), tmp_path / "out", "en")
    text = pypdf.PdfReader(tmp_path / "out" / "ticket.pdf").pages[0].extract_text()
    words = load_words("en")["ticket"]
    assert words["table_headings"]["opening"] not in text.replace(stock["ticket"]["note"], "")
    assert words["table_headings"]["closing"] in text
    saved = json.loads((tmp_path / "out" / "ticket.json").read_text(encoding="utf-8"))
    assert {row["state"] for row in saved["quantities"]} == {"closing"}


@pytest.mark.slow
def test_rooms_are_on_the_page_and_in_the_xml(tmp_path):
    table = replace(_cylinder(), levels={"maximum_m": 11.0, "pump_suction_m": 0.5})
    tickets = read_tickets(table, LONG)
    write_ticket(document_file(tickets), tmp_path / "out", "pt-BR")
    content = (tmp_path / "out" / "ticket.xml").read_bytes()
    assert list(schema().iter_errors(io.BytesIO(content))) == []
    result = ElementTree.fromstring(content).find(
        f".//{{{DCC}}}result[@refType='tankcal_roomResult']"
    )
    values = [float(found.text) for found in result.findall(f".//{{{SI}}}real/{{{SI}}}value")]
    expanded = [float(found.text) for found in result.findall(f".//{{{SI}}}valueExpandedMU")]
    rooms = tickets.transfer.rooms()
    assert (values, expanded) == (rooms.value[0].tolist(), rooms.U[0].tolist())
    reader = pypdf.PdfReader(tmp_path / "out" / "ticket.pdf")
    assert len(reader.pages) == 1
    assert "Espaço disponível" in reader.pages[0].extract_text()


@pytest.mark.slow
def test_a_document_is_of_a_single_ticket(tmp_path):
    rows = tmp_path / "rows.csv"
    rows.write_text("ticket;sw_percent\nA;0,1\nB;0,2\n", encoding="utf-8")
    tickets = read_tickets(_cylinder(), LONG, rows)
    with pytest.raises(ValueError, match="found 2 tickets; expected a single ticket"):
        tickets.write(tmp_path / "out")
    tickets.single(1).write(tmp_path / "out")
    saved = json.loads((tmp_path / "out" / "ticket.json").read_text(encoding="utf-8"))
    assert (saved["number"], saved["sw_percent"]) == ("B", 0.2)
