"""What a certificate must say (ISO/IEC 17025:2017, 7.8.2.1 and 7.8.4.1), and in which words."""

import copy
import json

import pytest
from paper_cells import of_part, paper_blocks, texts
from test_report import pages

from tankcal.job.certificate_entries import MARKED
from tankcal.job.contract import KEYS
from tankcal.report import blocks, certificate, field_table, sketch
from tankcal.report.laboratory import Letterhead
from tankcal.report.numbers import degrees_of_freedom
from tankcal.report.paper import Column, Paper
from tankcal.report.pdf import pdf
from tankcal.report.tables.facts import dip_point, dip_point_text
from tankcal.report.uncertainty.stated import stated_rows
from tankcal.text.digits import fixed
from tankcal.text.words import load_words

HARD = '#2 [west] *A* _b_ $x$ \\input{y} =1+1 <b>&amp; "q" {value}'


@pytest.fixture
def paper(example_record):
    """Make a Paper of the example whose certificate has these fields alone."""
    record = json.loads(example_record.read_text(encoding="utf-8"))

    def make(**fields):
        changed = copy.deepcopy(record)
        changed["job"]["certificate"] = fields
        return Paper(changed)

    return make


def items(block):
    return dict(block.data["items"])


def test_missing_entries_are_lines_to_write_on(paper):
    found = items(certificate.parties(paper()))
    labels = ("Laboratory", "Address", "Customer", "Address of the customer", "Date of issue")
    assert {found[label] for label in labels} == {""}
    assert found["Place of calibration"] == "Fictitious place"  # where the tank stands


def test_entries_without_a_line_are_named_as_missing(paper):
    said = certificate.statements(paper(method="ISO 7507-3")).data["items"]
    assert said[-1].endswith(
        "7.8.4): Certificate No., Laboratory, Address, Customer, Address of the customer, Date of "
        "issue, Traceability, Conditions, Condition of the tank, Authorised by (name, function)."
    )
    given = dict.fromkeys(MARKED, "x")
    assert len(certificate.statements(paper(**given)).data["items"]) == 3


@pytest.mark.slow
def test_results_relate_to_the_tank_alone_and_copies_are_whole(paper):
    said = certificate.statements(paper()).data["items"]
    assert said[0].startswith("The results relate only to the tank named here")
    assert said[1] == "This certificate may be reproduced only in full."


@pytest.mark.slow
def test_every_field_of_the_contract_is_printed(example_record, tmp_path):
    """A key that a job may give stands somewhere on the certificate."""
    record = json.loads(example_record.read_text(encoding="utf-8"))
    given = {field.name: f"value of {field.name}" for field in KEYS["certificate"]}
    dates = dict.fromkeys(("date_of_issue", "survey_end", "next_verification"), "2024-11-21")
    given |= dates
    record["job"]["certificate"] = given | {"permit": "OS 7"}
    rule = {"rule": given["next_verification_rule"], "clause": "1", "years": 10.0}
    record["job"]["next_verification"] = {"date": "2024-11-21"} | rule
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    printed = "\n".join(texts(paper_blocks(path)))
    for name, value in given.items():
        shown = "21 November 2024" if name in dates else value
        assert shown in printed, name
    assert "OS 7" in printed
    assert "value of authorised_by, value of authorised_role" in printed


def test_laboratory_of_letterhead_is_not_missing(paper):
    of_job = paper(laboratory="Lab")
    assert of_job.laboratory() == "Lab"
    assert "Laboratory" not in items(certificate.parties(of_job))
    headed = paper(laboratory="Lab")
    headed.letterhead = Letterhead("Lab", ("Rua 1",), None, {}).data()
    assert headed.laboratory() == ""
    assert {"Laboratory", "Address"}.isdisjoint(items(certificate.parties(headed)))
    other = paper(laboratory="Another")
    other.letterhead = headed.letterhead
    assert other.laboratory() == "Another"  # beside the letterhead: never hidden


def test_instruments_are_listed_with_certificates(paper):
    measured = paper()
    tools = [
        {"instrument": "tape 1", "details": {"certificate": "C-1"}},
        {"instrument": "edm", "details": {}},
    ]
    adjustment = {"instruments": tools, "photos": [], "groups": [], "sigma0": 1.0, "points": []}
    measured.record["adjustment"] = adjustment
    found = items(certificate.calibration(measured))
    assert found["Instruments, as declared"] == "tape 1: C-1; edm: no certificate stated"


@pytest.mark.slow
def test_no_uncertainty_is_said_never_zero(example_record, tmp_path):
    record = json.loads(example_record.read_text(encoding="utf-8"))
    nothing = [0.0] * len(record["capacity"]["U_m3"])
    record["capacity"] |= {"u_m3": nothing, "U_m3": nothing, "stated_U_m3": nothing}
    record["monte_carlo"] = None
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    found = paper_blocks(path)
    (result,) = (block["text"] for block in found if block["kind"] == "result")
    top_m3 = record["capacity"]["volume_m3"][-1]
    assert result.startswith(f"V = {top_m3:.3f}\N{NO-BREAK SPACE}m³   (no uncertainty stated")
    (table,) = (b for b in found if b["kind"] == "columns_table" and len(b["rows"]) > 100)
    assert table["rows"][-1][1] == f"{top_m3:.3f}"
    assert {row[2] for row in table["rows"]} == {"–"}


def test_one_reading_is_counted_like_many(paper):
    measured = paper()
    group = {"kind": "azimuth", "name": "", "count": 1}
    adjustment = {"instruments": [], "photos": [], "groups": [group], "sigma0": 1.0, "points": []}
    measured.record["adjustment"] = adjustment
    assert items(certificate.calibration(measured))["Survey method"].startswith("azimuths: 1; ")


@pytest.mark.parametrize(
    ("form", "month", "written"),
    [
        ("{day} {month} {year}", "November", "21 November 2026"),
        ("{day} de {month} de {year}", "novembro", "21 de novembro de 2026"),
        ("{day} de {month} de {year}", "noviembre", "21 de noviembre de 2026"),
    ],
)
def test_a_date_is_written_in_the_language(form, month, written, example_record):
    words = load_words()
    words["language"]["dates"] |= {"form": form, "11": month}
    assert Paper(example_record, words).day("2026-11-21") == written


@pytest.mark.slow
def test_user_text_is_printed_literally(short_record, tmp_path):
    """typst, LaTeX, HTML and spreadsheet markup in every text field of the job."""
    record = json.loads(short_record.read_text(encoding="utf-8"))
    short = {"authorised_by": "#a *b* $c$", "authorised_role": "<i>"}  # in a narrow column
    dates = {"date_of_issue", "survey_end", "next_verification"}
    names = {field.name for field in KEYS["certificate"]} - dates - set(short)
    fields = {name: f"{name} {HARD}" for name in sorted(names - {"notice"})}
    record["job"]["certificate"] = fields | short | {"notice": "#N *x*"}
    rule = {"rule": fields["next_verification_rule"], "clause": "1", "years": 10.0}
    record["job"]["next_verification"] = {"date": "2024-11-21"} | rule
    details = ("owner", "location", "product", "manufacturer", "construction", "remarks")
    record["job"]["tank"]["details"] = {key: f"{key} {HARD}" for key in details}
    for course in record["courses"]:
        course["course"] = "$1$ #a"
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    found = paper_blocks(path)
    (tmp_path / "all.pdf").write_bytes(pdf(found, tmp_path))
    printed = " ".join(pages(tmp_path / "all.pdf")).replace(" ", "")
    for name in (*fields, *details):
        assert f"{name} {HARD}".replace(" ", "") in printed, name
    for words in ("course$1$#a", "#a*b*$c$,<i>", "#N*x*"):  # of sketch, signatures, head
        assert words in printed
    bundle = blocks.paragraph(HARD)._repr_mimebundle_()
    assert "<b>" not in bundle["text/html"]


def test_sketch_shows_zero_reference_height_and_courses(example_record, tmp_path):
    paper = Paper(example_record)
    block = paper.figure(sketch.sketch(paper), "sketch")
    for words in (
        "reference height 9.800 m", "top of the table 9.500 m", "nominal diameter 13.000 m",
        "zero of heights: bottom of the first course", "course 5: 1.900 m, plate 6.30 mm",
    ):  # fmt: skip
        assert words in block.data["svg"].replace("\xa0", " ")
    assert block.data["alt"]


def test_mesh_has_no_sketch(paper):
    drawn = paper()
    assert sketch.has_sketch(drawn.record)
    drawn.record["job"]["tank"]["kind"] = "mesh"
    assert not sketch.has_sketch(drawn.record)


def test_every_page_names_the_record(example_record):
    document = Paper(example_record).document("certificate").data
    assert document["footer"].startswith("Page {page} of {pages} · Record ")
    (held,) = document["attachments"]
    assert held["sha256"].startswith(document["footer"].rpartition(" ")[2])


# ---- the tank and its dip point


def tank_facts(record, tmp_path):
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    return {
        label: text
        for block in paper_blocks(path)
        if block["kind"] == "key_values"
        for label, text in block["items"]
    }


@pytest.mark.slow
def test_nominal_values_are_printed_as_they_were_chosen(example_record, tmp_path):
    record = json.loads(example_record.read_text(encoding="utf-8"))
    record["job"]["tank"]["nominal_volume_m3"] = 60.0
    said = tank_facts(record, tmp_path)
    assert said["Nominal volume"] == "60\xa0m³"
    assert said["Nominal diameter"] == "13.000\xa0m"
    assert said["Dip point"] == "not declared"


def test_the_dip_point_is_stated_and_drawn_where_it_was_declared(paper):
    """A right triangle of 3, 4 and 5 m from the axis, in a tank of 6.5 m radius."""
    drawn, heights = paper(), []
    axis = drawn.record["shell"]
    for share in (1.0, 0.5):
        east, north = axis["x_m"] + 3 * share, axis["y_m"] - 4 * share
        drawn.record["job"]["datum"] |= {"dip_x_m": east, "dip_y_m": north}
        said = dip_point_text(drawn).replace("\xa0", " ")
        assert said.endswith(f"; {5 * share:.3f} m from the axis of the tank, at azimuth 143°")
        heights.append(dip_point(drawn.record).share)
    radius = drawn.record["courses"][0]["inside_radius_m"]
    assert heights == pytest.approx([5 / radius, 2.5 / radius])
    lines = sketch.sketch(drawn).axes[0].lines
    gauges = [
        line for line in lines if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2
    ]
    (x,) = {float(line.get_xdata()[0]) for line in gauges}
    assert x == pytest.approx(3.0 + 2.5 / radius)  # the axis at 3.0 inches, the wall at 4.0


@pytest.mark.parametrize("depth_m", [0.35, 2.0, -0.5])
def test_a_shaped_bottom_is_drawn_and_its_labels_keep_clear(paper, depth_m):
    """The centre of the bottom hangs as deep as its course is scaled; the measure stands below."""
    drawn = paper()
    drawn.record["bottom"] = [{"code": "bottom_depth", "value": depth_m, "unit": "m"}]
    drawn.record["job"]["datum"] |= {
        "dip_x_m": drawn.record["shell"]["x_m"],
        "dip_y_m": drawn.record["shell"]["y_m"],
    }
    (axes,) = sketch.sketch(drawn).axes
    wall = next(line for line in axes.lines if len(line.get_xdata()) == 5)
    top, edge, centre = (float(wall.get_ydata()[i]) for i in (0, 1, 2))
    height = drawn.record["courses"][-1]["top_m"]
    assert (edge - centre) / (top - edge) == pytest.approx(depth_m / height)
    nominal = next(one for one in axes.texts if one.get_text().startswith("nominal"))
    assert axes.get_ylim()[0] < nominal.get_position()[1] < min(centre, edge) - 0.2
    named = next(one for one in axes.texts if one.get_text().startswith("top of"))
    assert named.get_bbox_patch() is not None  # the gauge in the middle does not strike it


def test_no_volume_has_the_uncertainty_of_its_reading_alone(paper):
    """Where nothing of the tank was declared uncertain, the certificate states no U anywhere."""
    shown = paper()
    assert stated_rows(shown.record)
    capacity = shown.record["capacity"]
    nothing = [0.0] * len(capacity["U_m3"])
    capacity |= {key: nothing for key in capacity if key.endswith("U_m3")}
    capacity |= {"low_m3": capacity["volume_m3"], "high_m3": capacity["volume_m3"]}
    assert stated_rows(shown.record) == []


def test_degrees_of_freedom_without_number_are_infinite():
    found = [degrees_of_freedom(value) for value in (None, 5.05e16, 10_001, 2321.4, 7.04)]
    assert found == ["∞", "∞", "∞", "2321", "7.04"]


def test_an_uncertainty_has_two_digits_in_litres_too(paper):
    shown = paper()
    assert shown.number(0.4168, "L", u=0.4168) == "420\xa0L"
    assert shown.number(1249.6438, "L", u=0.4168).replace(",", "") == "1249644\xa0L"
    rows = [{"V": 1.2496438, "U": 0.4168}, {"V": 0.0334, "U": 0.00123}]
    assert shown.column_texts(rows, Column("U", "L", u="U")) == ["420", "1.2"]
    assert shown.column_texts(rows, Column("V", "L", u="U"))[0].replace(",", "") == "1250"


# ---- the field table


@pytest.mark.slow
def test_the_field_table_has_every_row_without_uncertainty(example_record):
    """What a gauger carries: every row of the table, dips and litres alone, and the zero."""
    found = of_part(paper_blocks(example_record, ("field_table.ipynb",)), "field-table")
    capacity = json.loads(example_record.read_text(encoding="utf-8"))["capacity"]
    (table,) = (block for block in found if block["kind"] == "columns_table")
    rows = table["rows"]
    assert [row[1] for row in rows] == [fixed(volume, 3) for volume in capacity["volume_m3"]]
    assert [column["heading"] for column in table["columns"]] == ["Height", "Volume"]
    (parts,) = (block for block in found if block["kind"] == "table")
    assert len(parts["columns"]) == 2 + 9
    said = " ".join(texts(found))
    for words in (
        "bottom of the first course",
        "Dip point",
        "RECONSTRUCTION-1",
        "only the certificate is authoritative",
    ):
        assert words in said


def test_rows_that_are_not_for_use_are_marked_in_the_field_table(paper):
    marked = paper()
    marked.record["capacity"]["for_use"][7] = False
    note, table = (block.data for block in field_table.table(marked))
    assert "†" in note["text"]
    assert [row[2] for row in table["rows"]].index("†") == 7
