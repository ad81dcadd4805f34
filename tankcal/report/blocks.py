"""Blocks: what a notebook cell returns so that Jupyter, the PDF and the HTML page show it well.

A block is plain data. Jupyter shows its HTML; the exporters take the data itself from the output's
`application/vnd.tankcal.block+json`, so that no text of a user is ever read as markup.

    blocks.table([["height", "m"], ["volume", "m³"]], [["0.010", "1.31"]], caption="Capacity")
    blocks.table(data_frame, caption="My own table")
    blocks.figure(matplotlib_figure, caption="Residuals", alt="Residuals against azimuth")
"""

import io
from dataclasses import dataclass

from tankcal.errors import TankcalError
from tankcal.text.digits import NOTHING

MIME = "application/vnd.tankcal.block+json"
ALIGNMENTS = ("left", "center", "right", "decimal")
WEB_ONLY = (
    "calculator",
    "tank_view",
    "cloud_map",
    "wall_map",
)  # kinds that the PDF leaves out (report/web makes them)


@dataclass(frozen=True)
class Block:
    """One block: `data` is its JSON, {"kind": ..., ...}."""

    data: dict

    def _repr_mimebundle_(self, include=None, exclude=None):
        from tankcal.report.web import block_html

        return {
            "text/html": block_html(self.data),
            "text/plain": repr(self),
            MIME: self.data,
        }

    def __repr__(self):
        return f"<tankcal {self.data['kind']}: {self.data.get('caption') or 'no caption'}>"


def document(**properties):
    """The start of a document: part, title, author, date (ISO), language, notice, running lines.

    part      "certificate", "working-papers", "field-table", or "" for a notebook of one's own
    running   [left, right] texts at the top of every page
    footer    text with {page} and {pages}
    letterhead   data of a letterhead.Letterhead, or None
    record_sha256  hexadecimal digits, "" for none: a keyword of the PDF
    attachments  files beside the notebook that its PDF holds inside (attachments.Attachment.data)
    """
    known = {
        "part": "",
        "title": "",
        "author": "",
        "date": "",
        "language": "en",
        "notice": "",
        "running": ["", ""],
        "footer": "{page} / {pages}",
        "letterhead": None,
        "attachments": [],
        "record_sha256": "",
    }
    unknown = sorted(set(properties) - set(known))
    if unknown:
        raise TankcalError(f"a document has no {', '.join(unknown)}; it has: {', '.join(known)}")
    return Block({"kind": "document", **known, **properties})


def masthead(title, subtitle="", laboratory="", number_label="", number=None):
    """The head of the first page; an absent number leaves a line to write on, if it has a label."""
    return Block(
        {
            "kind": "masthead",
            "title": _text(title),
            "subtitle": _text(subtitle),
            "laboratory": _text(laboratory),
            "number_label": _text(number_label),
            "number": _text(number or ""),
        }
    )


def heading(text, level=1):
    """A heading; level 1 to 3."""
    if level not in (1, 2, 3):
        raise TankcalError(f"a heading has level 1, 2 or 3, not {level!r}")
    return Block({"kind": "heading", "text": _text(text), "level": level})


def paragraph(text):
    """One paragraph of plain text."""
    return Block({"kind": "paragraph", "text": _text(text)})


def with_next(block):
    """The same block, on the page on which the next one begins."""
    return Block({**block.data, "with_next": True})


def whole(block):
    """The same table, which is no longer than a page, with all its rows on one."""
    return Block({**block.data, "whole": True})


def listing(items):
    """A list of sentences."""
    return Block({"kind": "list", "items": [_text(item) for item in items]})


def notice(text):
    """A line in a frame that cannot be overlooked."""
    return Block({"kind": "notice", "text": _text(text)})


def result(label, text, note=""):
    """The main result in a frame: what it is, the result itself, and a note below it."""
    return Block(
        {"kind": "result", "label": _text(label), "text": _text(text), "note": _text(note)}
    )


def signature(labels, field=""):
    """Empty lines to sign on, side by side, each over its label.

    field   what the field for an electronic signature over the last line is called; "": none
    """
    made = {"kind": "signature", "labels": [_text(label) for label in labels]}
    return Block(made | ({"field": _text(field)} if field else {}))


def hash_code(digest, text, alt):
    """The SHA-256 of a file as a QR code of "sha256:...", with the digits and what they are beside.

    text   what the file is
    alt    the description for readers who cannot see it; {text} in it is what the code says
    """
    said = f"sha256:{digest}"
    return Block(
        {
            "kind": "hash_code",
            "svg": _qr_svg(said),
            "code": said,
            "text": _text(text),
            "alt": _text(alt.format(text=said)),
        }
    )


def end_mark(text):
    """The mark after the last line of a document."""
    return Block({"kind": "end", "text": _text(text)})


def key_values(items, caption=""):
    """Names and what they are, in two columns; `items` is a list of (name, text)."""
    return Block(
        {
            "kind": "key_values",
            "caption": _text(caption),
            "items": [[_text(name), _text(value)] for name, value in items],
        }
    )


def table(columns, rows=None, caption="", align=None, decimal_mark=".", formulas=()):
    """A table with one heading row; or, from a pandas DataFrame alone, the same.

    columns   a heading each, or [heading, unit]
    rows      lists of text, as long as `columns`; None is printed as a dash
    align     "left", "center", "right" or "decimal" for each column; default: numbers to the right
    decimal_mark  on which the numbers of a "decimal" column stand in line
    formulas  numbers of the columns, from 0, whose known formulas are set (report/plain_formulas)
    """
    more = {"formulas": list(formulas)} if formulas else {}
    return _table("table", columns, rows, caption, align, decimal_mark, **more)


def form(columns, rows):
    """A table that is filled in by pen.

    columns   (heading, unit, share of the width) of each
    rows      how many empty ones
    """
    heads = [
        {"heading": _text(heading), "unit": _text(unit), "share": share}
        for heading, unit, share in columns
    ]
    return Block({"kind": "form", "columns": heads, "rows": int(rows)})


def columns_table(columns, rows=None, caption="", align=None, across=4, decimal_mark="."):
    """A long narrow table, set in `across` columns on each page, the headings over each of them."""
    across = int(across)
    return _table("columns_table", columns, rows, caption, align, decimal_mark, across=across)


def figure(figure, caption, alt, width=1.0):
    """A matplotlib figure (or the text of an SVG) with its caption and a description in words.

    width   part of the width of the text, 0 < width <= 1
    """
    if not str(alt).strip():
        raise TankcalError("a figure needs `alt`: what it shows, for readers who cannot see it")
    if not 0 < width <= 1:
        raise TankcalError(f"the width of a figure is a part of the page, up to 1, not {width!r}")
    svg = figure if isinstance(figure, str) else _svg_of(figure)
    return Block(
        {
            "kind": "figure",
            "svg": svg,
            "caption": _text(caption),
            "alt": _text(alt),
            "width": width,
        }
    )


def code(text):
    """Text as a program printed it, in a fixed-width font."""
    return Block({"kind": "code", "text": without_controls(text.replace("\t", "    "))})


def without_controls(text):
    """`text` with control characters, which no font has, as spaces; line ends stay."""
    return "".join(c if c.isprintable() or c in "\n\u2007\u2009\u202f\xa0" else " " for c in text)


def _table(kind, columns, rows, caption, align, decimal_mark, **more):
    if rows is None:
        columns, rows, align = _of_data_frame(columns, align)
    heads = [[_text(column), ""] if isinstance(column, str) else list(column) for column in columns]
    cells = [[_text(cell) for cell in row] for row in rows]
    for number, row in enumerate(cells, 1):
        if len(row) != len(heads):
            raise TankcalError(f"row {number} has {len(row)} cells, the table {len(heads)} columns")
    align = list(align or (_natural_alignment(cells, i, decimal_mark) for i in range(len(heads))))
    if len(align) != len(heads) or not set(align) <= set(ALIGNMENTS):
        raise TankcalError(f"{len(heads)} alignments of {', '.join(ALIGNMENTS)} expected: {align}")
    formulas = more.get("formulas", [])
    if not set(formulas) <= set(range(len(heads))):
        raise TankcalError(f"formulas expected in columns 0 to {len(heads) - 1}: {formulas}")
    data = {"kind": kind, "caption": _text(caption), "align": align, "rows": cells, **more}
    data["decimal_mark"] = decimal_mark
    data["columns"] = [{"heading": _text(head), "unit": _text(unit)} for head, unit in heads]
    return Block(data)


def _of_data_frame(frame, align):
    if not hasattr(frame, "itertuples"):
        raise TankcalError("a table needs rows, or a pandas DataFrame alone")
    numeric = [kind.kind in "iuf" for kind in frame.dtypes]
    rows = [
        [NOTHING if value is None or value != value else value for value in row]
        for row in frame.itertuples(index=False)
    ]
    return list(map(str, frame.columns)), rows, align or ["right" if n else "left" for n in numeric]


def _natural_alignment(rows, column, mark):
    """Numbers to the right, anything else to the left."""
    cells = [row[column] for row in rows if row[column] != NOTHING]
    numbers = all(cell.lstrip("\N{MINUS SIGN}-+").replace(mark, "", 1).isdigit() for cell in cells)
    return "right" if cells and numbers else "left"


def _text(value):
    return NOTHING if value is None else without_controls(str(value))


def _qr_svg(text):
    """The QR code of a text as SVG, a module being one unit, with its quiet zone."""
    import segno

    code = segno.make(text, error="m", micro=False, boost_error=False)
    stream = io.BytesIO()
    code.save(stream, kind="svg", xmldecl=False, svgns=True, nl=False, omitsize=True, border=2)
    return stream.getvalue().decode("utf-8")


def _svg_of(figure):
    """The figure as SVG: text stays text, and the same figure gives the same bytes."""
    import matplotlib

    bare = {"Date": None, "Creator": None, "Format": None, "Type": None}
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "tankcal"}):
        stream = io.StringIO()
        figure.savefig(stream, format="svg", dpi=200, metadata=bare)
    return stream.getvalue()
