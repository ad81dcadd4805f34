"""The field for an electronic signature and the QR code of the record's hash, in the PDF."""

import io
import re

import pytest
from paper_cells import paper_blocks

from tankcal.report import blocks
from tankcal.report.attachments import FIELD_NAME, SIGNATURE_LINK, with_signature_field
from tankcal.report.pdf import pdf

pypdf = pytest.importorskip("pypdf")
DIGEST = "0123456789abcdef" * 4


def page_of(*made, **properties):
    document = blocks.document(title="T", date="2024-05-31", **properties)
    return pdf([one.data for one in (document, blocks.masthead("T"), *made)])


@pytest.fixture(scope="module")
def signed_here():
    return page_of(blocks.signature(["a", "b", "c"], "Campo para assinatura — é ção"))


@pytest.mark.slow
def test_the_field_is_one_unsigned_signature_in_the_tree_of_tags(signed_here):
    """By pypdf: the field, its words, its page, its place in tags and in the parents' tree."""
    reader = pypdf.PdfReader(io.BytesIO(signed_here), strict=True)
    root = reader.trailer["/Root"]
    (field,) = root["/AcroForm"]["/Fields"]
    widget = field.get_object()
    assert (widget["/FT"], widget["/T"], widget["/Subtype"]) == ("/Sig", FIELD_NAME, "/Widget")
    assert widget["/TU"] == "Campo para assinatura — é ção"
    assert not {"/V", "/A", "/AA"} & set(widget)
    assert field in reader.pages[0]["/Annots"]
    assert widget["/P"].get_object() == reader.pages[0]
    assert reader.pages[0]["/Tabs"] == "/S"
    (tag,) = (one for one in tags(root["/StructTreeRoot"]) if one.get("/S") == "/Form")
    assert tag["/K"][0]["/Obj"].get_object() == widget
    numbers = root["/StructTreeRoot"]["/ParentTree"]["/Nums"]
    parents = dict(zip(numbers[::2], numbers[1::2], strict=True))
    assert parents[widget["/StructParent"]].get_object() == tag
    left, bottom, right, top = map(float, widget["/Rect"])
    assert right - left > 100  # points: room for a signature
    assert top - bottom > 40
    assert widget["/AP"]["/N"].get_object()["/BBox"][2:] == pytest.approx(
        [right - left, top - bottom], abs=1e-3
    )


def tags(node):
    node = node.get_object()
    yield node
    kids = node.get("/K", [])
    for kid in kids if isinstance(kids, list) else [kids]:
        kid = kid.get_object()
        if isinstance(kid, dict) and "/S" in kid:
            yield from tags(kid)


@pytest.mark.slow
def test_the_update_leaves_what_typst_made_as_it_was(signed_here):
    ends = [one.end() for one in re.finditer(rb"%%EOF", signed_here)]
    assert len(ends) == 2
    typst = signed_here[: ends[0]]
    assert with_signature_field(typst, "x").startswith(typst)
    first = re.search(rb"/ID\[(\([^)]*\))", typst)[1]
    assert first in signed_here[ends[0] :]  # the file's own half of its identity stays
    assert b"/Prev" in signed_here[ends[0] :]


@pytest.mark.slow
def test_the_same_page_gives_the_same_bytes(signed_here):
    again = page_of(blocks.signature(["a", "b", "c"], "Campo para assinatura — é ção"))
    assert again == signed_here


@pytest.mark.slow
def test_no_field_where_none_is_asked_for():
    made = page_of(blocks.signature(["a", "b"]))
    assert SIGNATURE_LINK not in made
    assert b"/AcroForm" not in made


@pytest.mark.parametrize("spoilt", ["", "%PDF-1.7 nothing", "startxref\n9\n%%EOF", "xref"])
def test_a_file_of_another_form_stays_as_it_is(spoilt):
    content = SIGNATURE_LINK + spoilt.encode()
    assert with_signature_field(content, "x") == content


@pytest.mark.slow
def test_every_certificate_has_one_field_and_says_its_record(example_run):
    """The report contains a copy of the certificate, so it has none."""
    readers = [
        pypdf.PdfReader(example_run / "results" / f"{name}.pdf")
        for name in ("certificate", "report")
    ]
    assert list(readers[0].get_fields()) == [FIELD_NAME]
    assert readers[1].get_fields() is None


def test_the_code_says_the_hash(monkeypatch):
    """Second program: what OpenCV reads in the picture of the code."""
    cv2 = pytest.importorskip("cv2")
    np = pytest.importorskip("numpy")
    block = blocks.hash_code(DIGEST, "what it is", "QR code of {text}").data
    assert block["alt"] == f"QR code of sha256:{DIGEST}"
    picture = np.full((410, 410), 255, np.uint8)
    size = float(re.search(r'viewBox="0 0 (\d+)', block["svg"])[1])
    for x, y, run in dark_runs(block["svg"]):
        scale = 410 / size
        rows = slice(round((y - 0.5) * scale), round((y + 0.5) * scale))
        picture[rows, round(x * scale) : round((x + run) * scale)] = 0
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == f"sha256:{DIGEST}"


def dark_runs(svg):
    """(x, y, length) of the runs of dark modules, as the path of the SVG draws them."""
    x = y = 0.0
    for command, numbers in re.findall(r"([Mmh])([-\d. ]+)", re.search(r' d="([^"]+)"', svg)[1]):
        found = [float(one) for one in numbers.split()]
        if command == "M":
            x, y = found
        elif command == "m":
            x, y = x + found[0], y + found[1]
        else:
            yield x, y, found[0]
            x += found[0]


@pytest.mark.slow
def test_the_code_is_on_the_page_with_its_digits(example_record):
    (block,) = (one for one in paper_blocks(example_record) if one["kind"] == "hash_code")
    from tankcal.report.attachments import sha256

    assert block["code"] == f"sha256:{sha256(example_record.read_bytes())}"
    assert "record.json" in block["text"]
