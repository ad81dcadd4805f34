"""The laboratory's letterhead: read, refused, and printed from the executed notebook."""

import base64
import io
import json
import struct
import subprocess
import sys

import matplotlib.image
import nbformat
import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook, new_output
from test_report import pages

from tankcal.errors import InputError, TankcalError
from tankcal.report import blocks
from tankcal.report.document import blocks_of
from tankcal.report.laboratory import (
    LETTERHEAD_FILE,
    MAX_LOGO_BYTES,
    contrast_with_white,
    load,
    png_problem,
    read_saved,
    svg_problem,
)
from tankcal.report.papers import build
from tankcal.report.pdf import pdf

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 30 10">{}</svg>'
CIRCLE = '<circle cx="5" cy="5" r="4" fill="#0b3d2e"/>'
NAME = "Instituto <i>#1</i> $x$ & Söhne"


@pytest.fixture
def laboratory(tmp_path):
    """Writes a letterhead beside its logo: laboratory(text, logo_svg=bytes) gives its path."""

    def write(text, **logos):
        for name, content in logos.items():
            (tmp_path / name.replace("_", ".")).write_bytes(content)
        path = tmp_path / "lab.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def problems_of(path):
    with pytest.raises(InputError) as caught:
        load(path)
    return str(caught.value).splitlines()


def png(rows=8, columns=24):
    stream = io.BytesIO()
    matplotlib.image.imsave(stream, np.zeros((rows, columns, 3)), format="png")
    return stream.getvalue()


def test_name_alone_is_a_letterhead(laboratory):
    found = load(laboratory('[laboratory]\nname = "Lab"'))
    assert (found.name, found.address, found.logo) == ("Lab", (), None)
    assert set(found.colours) == {"ink", "line"}


@pytest.mark.parametrize("kind", ["svg", "png"])
def test_a_letterhead_comes_back_as_it_was_saved(laboratory, tmp_path, kind):
    text = f'[laboratory]\nname = "Lab"\naddress = ["A 1", "B 2"]\nlogo = "logo.{kind}"\n'
    content = SVG.format(CIRCLE).encode() if kind == "svg" else png()
    found = load(laboratory(text + '[colours]\nink = "#0B3D2E"', **{f"logo_{kind}": content}))
    assert found.save(tmp_path) == LETTERHEAD_FILE
    data = read_saved(tmp_path / LETTERHEAD_FILE)
    assert data == found.data()
    assert data["colours"]["ink"] == "#0b3d2e"
    assert data["logo"]["alt"] == "Lab"
    kept = data["logo"]["content"]
    assert (kept.encode() if kind == "svg" else base64.b64decode(kept)) == content


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[laboratory]\nnane = "L"', "did you mean name?"),
        ('[laboratorio]\nname = "L"', "[laboratorio]: unknown section; expected [laboratory]"),
        ("", "laboratory.name: missing; expected name of the laboratory"),
        ('[laboratory]\nname = "L"\n[colours]\ninc = "#000000"', "did you mean ink?"),
        ('[laboratory]\nname = "L"\n[colours]\nink = "blue"', "row 4, colours.ink: found 'blue'"),
        ('[laboratory]\nname = "L"\n[colours]\nink = "#ff9900"', "is too light for text"),
        ('[laboratory]\nname = "L"\n[colours]\nline = "#12345"', "colours.line: found '#12345'"),
        ('[laboratory]\nname = "L"\nlogo = "x.svg"', "no file 'x.svg' beside this one"),
        ('[laboratory]\nname = "L"\nlogo = "../x.svg"', "beside this one"),
        ('[laboratory]\nname = "L"\nlogo = "x.jpg"', "expected the name of an .svg or .png file"),
        ("[laboratory", "lab.toml"),
    ],
)
def test_a_mistake_is_one_line(laboratory, text, message):
    lines = problems_of(laboratory(text))
    assert len([line for line in lines if message in line]) == 1
    assert all(line.startswith("lab.toml") for line in lines)


def test_all_mistakes_are_reported_at_once(laboratory):
    text = '[laboratory]\nlogo = "logo.svg"\n[colours]\nink = "#eeeeee"\nline = "grey"'
    lines = problems_of(laboratory(text, logo_svg=b"no picture"))
    assert len(lines) == 4


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        ("<script>alert(1)</script>", "<script>"),
        ('<rect onload="x()" width="1" height="1"/>', "onload="),
        ('<image href="http://example.org/a.png"/>', "links to 'http://example.org/a.png'"),
        ('<image href="file:///etc/passwd"/>', "links to"),
        ('<image href="data:image/svg+xml;base64,AAAA"/>', "links to"),
        ("<style>@import 'x.css';</style>", "leads out"),
        ("<style>rect {fill: url(http://example.org/x)}</style>", "leads out"),
        ('<rect style="fill:u\\72l(x)" width="1" height="1"/>', "leads out"),
        ("<foreignObject/>", "<foreignObject>"),
        ("<animate/>", "<animate>"),
        ('<g id="a"><use href="#a"/></g>', "or itself"),
        ("<rect", "cannot be read as an SVG"),
    ],
)
def test_a_hostile_or_broken_svg_is_refused(inside, message):
    assert message in svg_problem(SVG.format(inside).encode())


def test_an_svg_that_multiplies_itself_is_refused():
    levels = ['<g id="g0"><rect width="1" height="1"/></g>'] + [
        f'<g id="g{n}">' + f'<use href="#g{n - 1}"/>' * 10 + "</g>" for n in range(1, 8)
    ]
    assert "draws more than" in svg_problem(SVG.format("".join(levels)).encode())


def test_unsafe_or_unsized_svg_is_refused():
    assert "<!DOCTYPE" in svg_problem(b"<!DOCTYPE svg>" + SVG.format("").encode())
    assert "xml-stylesheet" in svg_problem(b'<?xml-stylesheet href="x"?>' + SVG.format("").encode())
    assert "has no size" in svg_problem(b'<svg xmlns="http://www.w3.org/2000/svg"/>')
    assert "expected an SVG" in svg_problem(b"<html/>")
    assert "UTF-8" in svg_problem(b"\xff\xfe<svg/>")


def test_a_sound_svg_is_taken():
    gradient = (
        '<defs><linearGradient id="a"><stop offset="0"/></linearGradient></defs>'
        '<rect fill="url(#a)" width="3" height="3"/><style>.b{fill:#123}</style>'
    )
    assert svg_problem(SVG.format(gradient + CIRCLE).encode()) is None


def test_a_png_is_checked():
    sound = png()
    assert png_problem(sound) is None
    assert png_problem(b"GIF89a") == "is no PNG file"
    assert "cannot be read" in png_problem(sound[:60])
    huge = sound[:16] + struct.pack(">II", 50_000, 10) + sound[24:]
    assert "50000 x 10 pixels" in png_problem(huge)


def test_a_logo_that_is_too_large_is_refused(laboratory):
    text = '[laboratory]\nname = "L"\nlogo = "logo.png"'
    path = laboratory(text, logo_png=bytes(MAX_LOGO_BYTES + 1000))
    assert problems_of(path) == ["logo.png: has 501 kB; expected at most 500 kB"]


@pytest.mark.parametrize(
    ("colour", "contrast"),
    [("#000000", 21.0), ("#ffffff", 1.0), ("#767676", 4.54), ("#0000ff", 8.59)],
)
def test_contrast_is_that_of_wcag(colour, contrast):
    """Published: WCAG 2 contrast ratios of these colours with white."""
    assert contrast_with_white(colour) == pytest.approx(contrast, abs=0.005)


def test_a_saved_letterhead_of_another_make_is_refused(tmp_path):
    path = tmp_path / LETTERHEAD_FILE
    for content in ("[]", '{"name": "L"}', "no json"):
        path.write_text(content, encoding="utf-8")
        with pytest.raises(InputError, match=LETTERHEAD_FILE):
            read_saved(path)


def test_a_notebook_whose_logo_was_spoilt_is_refused(laboratory):
    text = '[laboratory]\nname = "L"\nlogo = "logo.svg"'
    data = load(laboratory(text, logo_svg=SVG.format(CIRCLE).encode())).data()
    data["logo"]["content"] = SVG.format("<script/>")
    document = blocks.document(title="t", letterhead=data).data
    output = new_output("display_data", data={blocks.MIME: document})
    with pytest.raises(TankcalError, match="<script>"):
        blocks_of(new_notebook(cells=[new_code_cell("x", outputs=[output])]))


@pytest.fixture(scope="module")
def headed(short_record, tmp_path_factory):
    """The folder of a report with a letterhead whose name could be read as markup."""
    folder = tmp_path_factory.mktemp("headed")
    (folder / "logo.png").write_bytes(png())
    text = f'[laboratory]\nname = "{NAME}"\naddress = ["Rua 1", "#b *c*"]\nlogo = "logo.png"'
    (folder / "lab.toml").write_text(text + '\n[colours]\nink = "#7a1f3d"', encoding="utf-8")
    out = folder / "out"
    out.mkdir()
    build(short_record, out, letterhead=load(folder / "lab.toml"))
    return out


@pytest.mark.slow
def test_name_and_address_are_printed_literally(headed):
    for name in ("certificate.pdf", "working-papers.pdf"):
        first = pages(headed / name)[0]
        assert NAME in first
        assert "#b *c*" in first
    assert "Instituto &lt;i&gt;#1&lt;/i&gt;" in (headed / "report.html").read_text(encoding="utf-8")


@pytest.mark.study
def test_the_notebook_alone_gives_the_same_paper(headed, tmp_path):
    """nbconvert needs no TOML file: the letterhead is in the document block."""
    command = [sys.executable, "-m", "nbconvert", "--to", "tankcal-pdf", "--output-dir"]
    subprocess.run(
        [*command, str(tmp_path), str(headed / "report.ipynb")], check=True, capture_output=True
    )
    assert (tmp_path / "report.pdf").read_bytes() == (headed / "report.pdf").read_bytes()


@pytest.mark.slow
def test_the_colours_are_those_of_the_letterhead(headed):
    notebook = nbformat.read(headed / "report.ipynb", as_version=4)
    found = blocks_of(notebook, "certificate")
    assert found[0]["letterhead"]["colours"]["ink"] == "#7a1f3d"
    plain = [found[0] | {"letterhead": None}, *found[1:4]]
    assert pdf(plain, headed) != pdf(found[:4], headed)
    assert json.loads((headed / LETTERHEAD_FILE).read_text(encoding="utf-8"))["name"] == NAME


# ---- the accreditation mark


def test_mark_is_read_as_file_or_place(laboratory):
    text = '[laboratory]\nname = "Lab"\naccreditation_mark = "m.svg"\naccreditation_text = "Mark"'
    found = load(laboratory(text, m_svg=SVG.format(CIRCLE).encode()))
    assert (found.logo, found.mark.kind, found.mark.alt) == (None, "svg", "Mark")
    empty = load(laboratory('[laboratory]\nname = "Lab"\naccreditation_place = true'))
    assert empty.mark == "place"
    (line,) = problems_of(laboratory(text.replace("m.svg", "no.svg")))
    assert "laboratory.accreditation_mark" in line


@pytest.mark.parametrize("is_certificate", [True, False])
def test_mark_is_on_the_certificate_only(laboratory, tmp_path, is_certificate):
    """A letterhead that was saved before there were marks is read, too."""
    text = '[laboratory]\nname = "Lab"\naccreditation_mark = "m.svg"'
    letterhead = load(laboratory(text, m_svg=SVG.format(CIRCLE).encode()))
    letterhead.save(tmp_path)
    part = "certificate" if is_certificate else "working-papers"
    data = read_saved(tmp_path / LETTERHEAD_FILE)
    document = blocks.document(title="T", part=part, letterhead=data)
    head = blocks.masthead("T", number_label="No." if is_certificate else "", number="1")
    assert pdf([document.data, head.data])
    assert ("<img" in document._repr_mimebundle_()["text/html"]) is is_certificate
    del data["mark"]
    (tmp_path / LETTERHEAD_FILE).write_text(json.dumps(data), encoding="utf-8")
    assert read_saved(tmp_path / LETTERHEAD_FILE)["mark"] is None
