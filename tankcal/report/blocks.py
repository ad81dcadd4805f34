"""Blocks: results of notebook cells that Jupyter, the PDF and the HTML page can display.

A block is a dict. Jupyter displays its HTML. The exporters read the dict from the output of type
`application/vnd.tankcal.block+json`, so that user text is never interpreted as markup.

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
WEB_ONLY = (  # kinds that the PDF omits (report/web writes them)
    "calculator",
    "tank_view",
    "cloud_map",
    "wall_map",
)


@dataclass(frozen=True)
class Block:
    """A block with its content `data`, {"kind": ..., ...}."""

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
    """Block at the start of a document, with its title and page style.

    Parameters
    ----------
    **properties
        part : "certificate", "working-papers", "field-table", or "" for a notebook of the user.
        title, author, notice : str.
        date : ISO date, or "".
        language : code of the language.
        running : [left, right], texts at the top of every page.
        footer : text with {page} and {pages}.
        letterhead : dict of a letterhead.Letterhead, or None.
        record_sha256 : hexadecimal digits for the keywords of the PDF, or "".
        attachments : embedded files (attachments.Attachment.data).
        dense : whether the PDF has small letters and margins, for a form on a single page.

    Returns
    -------
    Block

    Raises
    ------
    TankcalError
        For an unknown property.
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
        "dense": False,
    }
    unknown = sorted(set(properties) - set(known))
    if unknown:
        raise TankcalError(f"a document has no {', '.join(unknown)}; it has: {', '.join(known)}")
    return Block({"kind": "document", **known, **properties})


def masthead(title, subtitle="", laboratory="", number_label="", number=None):
    """Head of the first page; a labelled number that is None becomes a blank line to fill in.

    Parameters
    ----------
    title, subtitle, laboratory : str
        Texts of the head.
    number_label : str, optional
        Label of the number; "": no number.
    number : str, optional
        Number of the document.

    Returns
    -------
    Block
    """
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
    """Heading of level 1, 2 or 3."""
    if level not in (1, 2, 3):
        raise TankcalError(f"a heading has level 1, 2 or 3, not {level!r}")
    return Block({"kind": "heading", "text": _text(text), "level": level})


def paragraph(text):
    """Paragraph of plain text."""
    return Block({"kind": "paragraph", "text": _text(text)})


def with_next(block):
    """Return the block, to be kept on the page on which the next block begins."""
    return Block({**block.data, "with_next": True})


def whole(block):
    """Return the table, to be kept on one page; it must not be longer than a page."""
    return Block({**block.data, "whole": True})


def repeat_caption(block):
    """Return the table with its caption repeated at the top of each page it runs on over."""
    return Block({**block.data, "captioned": True})


def side_by_side(block):
    """Return the names and values, with their second half beside the first half in the PDF."""
    return Block({**block.data, "side-by-side": True})


def listing(items):
    """List of sentences."""
    return Block({"kind": "list", "items": [_text(item) for item in items]})


def notice(text):
    """Framed line of text that draws attention."""
    return Block({"kind": "notice", "text": _text(text)})


def result(label, text, note=""):
    """Framed main result with its label above and a note below.

    Parameters
    ----------
    label : str
        Label of the result.
    text : str
        The result.
    note : str, optional
        Text below the result.

    Returns
    -------
    Block
    """
    return Block(
        {"kind": "result", "label": _text(label), "text": _text(text), "note": _text(note)}
    )


def signature(labels, field="", copy=()):
    """Empty lines for signatures, side by side, each above its label.

    Parameters
    ----------
    labels : list of str
        Labels of the lines.
    field : str, optional
        Name of the field for an electronic signature above the last line; "": no field.
    copy : sequence of str, optional
        Notice and sentence in place of the lines, for a document of several parts, which is no
        original.

    Returns
    -------
    Block
    """
    data = {"kind": "signature", "labels": [_text(label) for label in labels]}
    data |= {"field": _text(field)} if field else {}
    return Block(data | ({"copy": [_text(text) for text in copy]} if copy else {}))


def hash_code(digest, text, alt):
    """QR code of the SHA-256 of a file, "sha256:...", with the digits and a description beside it.

    Parameters
    ----------
    digest : str
        SHA-256 of the file, hexadecimal digits.
    text : str
        Description of the file.
    alt : str
        Alternative text for readers who cannot see the code; {text} stands for its content.

    Returns
    -------
    Block
    """
    content = f"sha256:{digest}"
    return Block(
        {
            "kind": "hash_code",
            "svg": _qr_svg(content),
            "code": content,
            "text": _text(text),
            "alt": _text(alt.format(text=content)),
        }
    )


def end_mark(text):
    """Mark after the last line of a document."""
    return Block({"kind": "end", "text": _text(text)})


def key_values(items, caption=""):
    """Names and values in two columns; `items` is a list of (name, text)."""
    return Block(
        {
            "kind": "key_values",
            "caption": _text(caption),
            "items": [[_text(name), _text(value)] for name, value in items],
        }
    )


def table(columns, rows=None, caption="", align=None, decimal_mark=".", formulas=()):
    """Table with one row of headings.

    Parameters
    ----------
    columns : list of str or [str, str], or pandas DataFrame
        Heading, or [heading, unit], of each column. A DataFrame needs no `rows`.
    rows : list of list of str, optional
        Texts of the cells; None is printed as a dash.
    caption : str, optional
        Caption of the table.
    align : list of str, optional
        "left", "center", "right" or "decimal" for each column. By default, numbers are aligned
        right and texts left.
    decimal_mark : str, optional
        Mark at which the numbers of a "decimal" column are aligned.
    formulas : sequence of int, optional
        Indices, from 0, of the columns with formulas to typeset (report/plain_formulas).

    Returns
    -------
    Block

    Raises
    ------
    TankcalError
        If the numbers of cells, alignments and columns disagree.
    """
    more = {"formulas": list(formulas)} if formulas else {}
    return _table("table", columns, rows, caption, align, decimal_mark, **more)


def form(columns, rows):
    """Empty table to fill in by hand.

    Parameters
    ----------
    columns : list of (str, str, float)
        Heading, unit and relative width of each column.
    rows : int
        Number of empty rows.

    Returns
    -------
    Block
    """
    heads = [
        {"heading": _text(heading), "unit": _text(unit), "share": share}
        for heading, unit, share in columns
    ]
    return Block({"kind": "form", "columns": heads, "rows": int(rows)})


def chart(title, facts, heads, rows, *, across, size_pt, note="", marked=()):
    """Chart for the wall: a title and facts in large letters, and pairs side by side.

    Parameters
    ----------
    title : str
        Title in large letters.
    facts : list of (str, str)
        Labels and values.
    heads : list of (str, str)
        Headings of the two columns of a pair.
    rows : list of [str, str]
        Pairs, down each column.
    across : int
        Number of columns of pairs.
    size_pt : float
        Type size of the pairs, points.
    note : str, optional
        Text below the pairs.
    marked : sequence of int, optional
        Indices, from 0, of hatched rows.

    Returns
    -------
    Block
    """
    facts = [[_text(name), _text(value)] for name, value in facts]
    return Block({
        "kind": "chart", "title": _text(title), "facts": facts, "heads": list(heads[0]),
        "rows": [list(row) for row in rows], "across": across, "size_pt": size_pt,
        "note": _text(note), "marked": list(marked),
    })  # fmt: skip


def columns_table(columns, rows=None, caption="", align=None, across=4, decimal_mark="."):
    """Long narrow table, with several parts side by side on each page.

    Parameters
    ----------
    columns, rows, caption, align, decimal_mark
        As in `table`.
    across : int, optional
        Number of parts side by side; each part has the headings.

    Returns
    -------
    Block
    """
    across = int(across)
    return _table("columns_table", columns, rows, caption, align, decimal_mark, across=across)


def figure(figure, caption, alt, width=1.0):
    """Figure with its caption and alternative text.

    Parameters
    ----------
    figure : matplotlib Figure or str
        Figure, or the text of an SVG.
    caption : str
        Caption of the figure.
    alt : str
        Description for readers who cannot see the figure.
    width : float, optional
        Width relative to the width of the text, 0 < width <= 1.

    Returns
    -------
    Block

    Raises
    ------
    TankcalError
        For an empty `alt` or a width outside this range.
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
    """Output of a program in a fixed-width font."""
    return Block({"kind": "code", "text": without_controls(text.replace("\t", "    "))})


def without_controls(text):
    """Replace control characters, which no font contains, by spaces; keep line ends."""
    return "".join(c if c.isprintable() or c in "\n\u2007\u2009\u202f\xa0" else " " for c in text)


def _table(kind, columns, rows, caption, align, decimal_mark, **more):
    """Return the Block of a table after checks of its dimensions."""
    if rows is None:  # `columns` is a DataFrame
        columns, rows, align = _read_data_frame(columns, align)
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


def _read_data_frame(frame, align):
    """Return headings, rows and alignments of a DataFrame; NaN becomes a dash."""
    if not hasattr(frame, "itertuples"):
        raise TankcalError("a table needs rows, or a pandas DataFrame alone")
    numeric = [kind.kind in "iuf" for kind in frame.dtypes]
    rows = [
        [NOTHING if value is None or value != value else value for value in row]
        for row in frame.itertuples(index=False)
    ]
    return list(map(str, frame.columns)), rows, align or ["right" if n else "left" for n in numeric]


def _natural_alignment(rows, column, mark):
    """Return "right" for a column of numbers and "left" for any other column."""
    cells = [row[column] for row in rows if row[column] != NOTHING]
    numbers = all(cell.lstrip("\N{MINUS SIGN}-+").replace(mark, "", 1).isdigit() for cell in cells)
    return "right" if cells and numbers else "left"


def _text(value):
    return NOTHING if value is None else without_controls(str(value))


def _qr_svg(text):
    """Return the QR code of a text as SVG, with its quiet zone; a module has the side 1."""
    import segno

    code = segno.make(text, error="m", micro=False, boost_error=False)
    stream = io.BytesIO()
    code.save(stream, kind="svg", xmldecl=False, svgns=True, nl=False, omitsize=True, border=2)
    return stream.getvalue().decode("utf-8")


def _svg_of(figure):
    """Return a figure as reproducible SVG, in which text remains text."""
    import matplotlib

    bare = {"Date": None, "Creator": None, "Format": None, "Type": None}
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "tankcal"}):
        stream = io.StringIO()
        figure.savefig(stream, format="svg", dpi=200, metadata=bare)
    return stream.getvalue()
