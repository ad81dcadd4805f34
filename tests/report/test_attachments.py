"""Files held inside a PDF: what pypdf reads of them, and that papers of a run share them."""

import io
import re
import zlib

import pytest

from tankcal.report import attachments, blocks
from tankcal.report.attachments import Packed, beside, hold, objects_of, with_signature_field
from tankcal.report.pdf import pdf

pypdf = pytest.importorskip("pypdf")
deflated = zlib.compress
CONTENTS = {
    "record.json": b'{"a": 1}' * 5000,
    "capacity.xlsx": attachments.ZIP + bytes(range(256)) * 40 + b"\nendstream\nendobj\nxref\n",
    "certificate.xml": b"",
}


@pytest.fixture
def document(tmp_path):
    """A page that holds CONTENTS; its files lie in tmp_path."""
    for name, content in CONTENTS.items():
        (tmp_path / name).write_bytes(content)
    described = beside(tmp_path, {name: f"About {name}" for name in CONTENTS})
    attached = [one.data() for one in described]
    made = (
        blocks.document(title="T", date="2024-05-31", attachments=attached),
        blocks.masthead("T"),
        blocks.signature(["a", "b"], "Signature"),
    )
    return [one.data for one in made]


def held_in(content):
    """{name: (relationship, description, type, size, day, bytes)}."""
    root = pypdf.PdfReader(io.BytesIO(content), strict=True).trailer["/Root"]
    found = {}
    for one in root["/AF"]:
        file = one.get_object()
        stream = file["/EF"]["/F"].get_object()
        size, day = (stream["/Params"][key] for key in ("/Size", "/ModDate"))
        said = (file["/AFRelationship"], file["/Desc"], stream["/Subtype"], size, day)
        found[file["/UF"]] = (*said, stream.get_data())
    return found


@pytest.mark.slow
def test_a_pdf_holds_what_the_typesetter_would(document, tmp_path, monkeypatch):
    """Second way: files that typst itself holds inside."""
    found = held_in(pdf(document, tmp_path))
    monkeypatch.setattr(attachments, "hold", lambda *any_files: None)
    assert found == held_in(pdf(document, tmp_path))
    assert {name: one[-1] for name, one in found.items()} == CONTENTS
    assert {name: one[3] for name, one in found.items()} == {
        name: len(content) for name, content in CONTENTS.items()
    }


@pytest.mark.slow
def test_papers_of_a_run_pack_a_file_once(document, tmp_path, monkeypatch):
    packing = []
    monkeypatch.setattr(
        attachments.zlib, "compress", lambda *given: packing.append(given) or deflated(*given)
    )
    packed = Packed()
    first, second = (pdf(document, tmp_path, packed=packed) for _ in range(2))
    assert first == second
    assert sorted(content for content, _ in packing) == sorted(
        content for name, content in CONTENTS.items() if name != "capacity.xlsx"
    )


@pytest.mark.slow
def test_every_object_is_at_its_place(document, tmp_path):
    """The table of places, of the file before the signature field, against a search for heads."""
    content = pdf(document, tmp_path)
    whole = content[: content.index(b"%%EOF") + 5]
    assert with_signature_field(whole, "Signature") == content
    objects = objects_of(whole)
    found = {int(one[1]): one.start(1) for one in re.finditer(rb"\n(\d+) 0 obj\n", whole)}
    assert found == dict(enumerate(objects.places[1:], 1))
    assert whole[objects.table :].startswith(b"xref\n")


def test_a_pdf_of_another_form_is_not_touched():
    assert hold(b"%PDF-2.0 nothing", {"0" * 64: b"x"}, Packed()) is None


@pytest.mark.slow
def test_a_digest_that_is_not_there_is_told(document, tmp_path):
    content = pdf([one | {"attachments": []} for one in document], tmp_path)
    assert hold(content[: content.index(b"%%EOF") + 5], {"0" * 64: b"x"}, Packed()) is None
