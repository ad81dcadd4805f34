"""Conversion of each kind of block to HTML; all texts are escaped.

Long tables are divided and have a search field. SVG images contain their fonts, since other fonts
would change the width of labels.
"""

import base64
import io
import re
from functools import cache
from html import escape, unescape
from pathlib import Path

from tankcal.report.plain_formulas import formula_nodes


def block_html(block):
    """Return a block as HTML for Jupyter."""
    return _WRITERS[block["kind"]](block)


def _document(block):
    running = "".join(f"<span>{escape(text)}</span>" for text in block["running"])
    notice = _notice({"text": block["notice"]}) if block["notice"] else ""
    head = _letterhead(block["letterhead"], block["part"]) if block.get("letterhead") else ""
    return f'<header class="running">{running}</header>{head}{notice}'


def _letterhead(letterhead, part):
    """Return logo, name and address of the laboratory; logo and mark are embedded as images."""
    picture = _picture(letterhead["logo"])
    mark = letterhead.get("mark")
    if part == "certificate" and isinstance(mark, dict):
        picture += _picture(mark)
    address = "".join(f"<br>{escape(line)}" for line in letterhead["address"])
    name = escape(letterhead["name"])
    return f'<div class="letterhead">{picture}<p><strong>{name}</strong>{address}</p></div>'


def _picture(logo):
    if not logo:
        return ""
    return f'<img alt="{escape(logo["alt"])}" src="{_data_url(logo["kind"], logo["content"])}">'


def _masthead(block):
    lines = (
        [f'<p class="laboratory">{escape(block["laboratory"])}</p>'] if block["laboratory"] else []
    )
    lines.append(f"<h1{id_of(block)}>{escape(block['title'])}</h1>")
    lines.append(f'<p class="subtitle">{escape(block["subtitle"])}</p>')
    if block["number_label"]:
        number = escape(block["number"]) or '<span class="blank"></span>'
        lines.append(f'<p class="number">{escape(block["number_label"])} {number}</p>')
    return f'<div class="masthead">{"".join(lines)}</div>'


def id_of(block):
    """Return the id attribute of a heading, to which the table of contents links."""
    return f' id="{block["id"]}"' if "id" in block else ""


def _heading(block):
    level = block["level"] + 1
    return f"<h{level}{id_of(block)}>{escape(block['text'])}</h{level}>"


def _list(block):
    return "<ul>" + "".join(f"<li>{escape(item)}</li>" for item in block["items"]) + "</ul>"


def _notice(block):
    return f'<p class="notice" role="note">{escape(block["text"])}</p>'


def _result(block):
    note = f'<p class="note">{escape(block["note"])}</p>' if block["note"] else ""
    return (
        f'<div class="result"><p>{escape(block["label"])}</p>'
        f"<p><strong>{escape(block['text'])}</strong></p>{note}</div>"
    )


def _signature(block):
    lines = "".join(f"<div>{escape(label)}</div>" for label in block["labels"])
    return f'<div class="signature">{lines}</div>'


def _hash_code(block):
    """Return the QR code and its digits as text, which `tankcal verify` searches for."""
    picture = (
        f'<img class="svg" alt="{escape(block["alt"])}" src="{_data_url("svg", block["svg"])}">'
    )
    return (
        f'<div class="hash-code">{picture}<p>{escape(block["text"])}<br>'
        f"<code>{escape(block['code'])}</code></p></div>"
    )


def _key_values(block):
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>'
        for name, value in block["items"]
    )
    return f'<table class="key-values">{caption_of(block)}<tbody>{rows}</tbody></table>'


def _figure(block):
    kind = "svg" if "svg" in block else "png"
    caption = f"<figcaption>{escape(block['caption'])}</figcaption>" if block["caption"] else ""
    return (
        f'<figure><img class="{kind}" width="{100 * block["width"]:.0f}%" '
        f'alt="{escape(block["alt"])}" src="{_data_url(kind, block[kind])}">{caption}</figure>'
    )


def _data_url(kind, content):
    """Return an image (text of an SVG, or a PNG in base64) as a data URL."""
    if kind == "svg":
        content = embed_fonts(content)
        content = base64.b64encode(content.encode("utf-8")).decode("ascii")
    return f"data:{_MIME[kind]};base64,{escape(content)}"


_MIME = {"svg": "image/svg+xml", "png": "image/png"}


def _markdown(block):
    return "".join(_node(node) for node in block["nodes"])


_SPANS = {"paragraph": "p", "quote": "blockquote", "emph": "em", "strong": "strong", "item": "li"}


def _node(node):
    """Return a markdown node as HTML."""
    kind = node["t"]
    inner = "".join(_node(child) for child in node.get("c", []))
    if kind in _SPANS:
        return f"<{_SPANS[kind]}>{inner}</{_SPANS[kind]}>"
    if kind == "heading":
        return f"<h{node['level'] + 1}{id_of(node)}>{inner}</h{node['level'] + 1}>"
    if kind == "list":
        tag = "ol" if node["ordered"] else "ul"
        return f"<{tag}>{inner}</{tag}>"
    if kind == "link":
        return f'<a href="{escape(node["url"])}" rel="noreferrer">{inner}</a>'
    if kind == "math":
        display = "block" if node["block"] else "inline"
        return f'<math display="{display}">{node["mathml"]}</math>'
    if kind == "table":
        return _markdown_table(node)
    leaves = {
        "plain": lambda: inner,
        "text": lambda: escape(node["s"]),
        "break": lambda: "<br>",
        "code": lambda: f"<code>{escape(node['s'])}</code>",
        "code_block": lambda: f"<pre>{escape(node['s'])}</pre>",
        "rule": lambda: "<hr>",
    }
    return leaves[kind]()


def _markdown_table(node):
    rows = []
    for number, row in enumerate(node["rows"]):
        tag = "th" if number == 0 else "td"
        cells = (
            f'<{tag} class="{align}">{"".join(map(_node, cell))}</{tag}>'
            for align, cell in zip(node["align"], row, strict=True)
        )
        rows.append(f"<tr>{''.join(cells)}</tr>")
    return (
        f'<table class="lines"><thead>{rows[0]}</thead><tbody>{"".join(rows[1:])}</tbody></table>'
    )


def _paragraph(block):
    return f"<p>{escape(block['text'])}</p>"


# ---- tables


PIECE = 66  # rows of a part: a column of a printed page
SHORT = 20  # largest number of rows of a table that is printed on one page


def table_html(block):
    """Return a table as HTML; a long narrow table is in a scrolling frame."""
    table = _table(block, _rows(block), caption_of(block))
    if block["kind"] == "columns_table":
        return f'<div class="long" tabindex="0">{table}</div>'
    return table


def frame_table(block):
    """Return a table in a frame, so that only the table scrolls on a narrow page."""
    short = " short" if len(block["rows"]) <= SHORT else ""
    return f'<div class="frame{short}">{table_html(block)}</div>'


def searchable_table(block, number, words):
    """Return a long narrow table with a search field.

    The table is divided into parts of PIECE rows, whose layout the browser computes when they
    become visible.

    Parameters
    ----------
    block : dict
        Block of the table.
    number : int
        Number of the table on the page.
    words : dict
        Words of the web page.

    Returns
    -------
    str
        HTML.
    """
    rows = [row.replace('<td class="decimal">', "<td>") for row in _rows(block)]
    pieces = "".join(
        f'<div class="piece">{_table(block, rows[start : start + PIECE], "")}</div>'
        for start in range(0, len(rows), PIECE)
    )
    caption = f'<p class="caption" id="caption-{number}">{escape(block["caption"])}</p>'
    field = (
        f'<p class="finder" hidden><label for="find-{number}">{escape(words["find"])}</label> '
        f'<input type="search" id="find-{number}" inputmode="decimal" autocomplete="off" '
        f'placeholder="{escape(_first_cell(block))}"> '
        f'<output for="find-{number}" aria-live="polite"></output></p>'
    )
    return (
        f'<div class="searchable">{caption}{field}'
        f'<div class="pieces" role="region" tabindex="0" aria-labelledby="caption-{number}">'
        f"{pieces}</div></div>"
    )


def caption_of(block):
    """Return the caption element of a table, or ""."""
    return f"<caption>{escape(block['caption'])}</caption>" if block["caption"] else ""


def decimal_fills(texts, mark="."):
    """Return the spaces after each number that align the decimal marks of a column."""
    tails = [len(text) - 1 - text.rfind(mark) if mark in text else -1 for text in texts]
    longest = max(tails, default=-1)
    return [
        ("\N{PUNCTUATION SPACE}" if tail < 0 <= longest else "")
        + "\N{FIGURE SPACE}" * (longest - max(tail, 0))
        for tail in tails
    ]


def _table(block, rows, caption):
    heads = "".join(
        f'<th scope="col" class="{align}">{escape(column["heading"])}'
        + (f'<br><span class="unit">{escape(column["unit"])}</span>' if column["unit"] else "")
        + "</th>"
        for column, align in zip(block["columns"], block["align"], strict=True)
    )
    return (
        f'<table class="lines">{caption}<thead><tr>{heads}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _rows(block):
    """Return the rows as HTML, with decimal marks aligned over the whole table."""
    formulas, unbroken_columns = block.get("formulas", ()), block.get("whole", ())
    links = block.get("links", {})  # {column: address of each cell, "" for none}
    columns = [
        _cells(
            column,
            align,
            block["decimal_mark"],
            _typeset_formulas if i in formulas else escape,
            links=links.get(i),
            look=f"{align} whole" if i in unbroken_columns else align,
        )
        for i, (column, align) in enumerate(
            zip(zip(*block["rows"], strict=True), block["align"], strict=False)
        )
    ]
    return [f"<tr>{''.join(cells)}</tr>" for cells in zip(*columns, strict=True)]


def _cells(texts, align, mark, shown, *, links, look):
    """Return the cells of a column as HTML.

    Cells of a "decimal" column are padded. shown(text) returns the HTML of a text. `links`
    contains an address for each cell, or ""; None: no links.
    """
    fills = decimal_fills(texts, mark) if align == "decimal" else [""] * len(texts)
    return [
        f'<td class="{look}">'
        + (f'<a href="{escape(link)}">{shown(text)}</a>' if link else shown(text))
        + f"{fill}</td>"
        for text, fill, link in zip(texts, fills, links or [""] * len(texts), strict=True)
    ]


def _typeset_formulas(text):
    return "".join(
        f'<math display="inline">{node["mathml"]}</math>'
        if node["t"] == "math"
        else escape(node["s"])
        for node in formula_nodes(text)
    )


def _first_cell(block):
    """Return the first cell of the middle row as an example of a search."""
    return block["rows"][len(block["rows"]) // 2][0] if block["rows"] else ""


# ---- fonts of SVG images


_FAMILY = "STIXGeneral"  # font of tankcal.report.plots.style, part of matplotlib
_TEXT = re.compile(r"<(?:text|tspan)\b[^>]*>([^<]*)")
_ROOT = re.compile(r"<svg\b[^>]*>")
_STYLES = {"": "STIXGeneral", "italic": "STIXGeneralItalic", "bold": "STIXGeneralBol"}


def embed_fonts(svg):
    """Embed the letters of the font into an SVG; return SVGs with other fonts unchanged."""
    if _FAMILY not in svg:
        return svg
    letters = "".join(sorted(set(unescape("".join(_TEXT.findall(svg))))))
    used = [style for style in _STYLES if not style or re.search(rf"font[^;\"]*{style}", svg)]
    faces = "".join(_face(style, letters) for style in used)
    root = _ROOT.search(svg)
    return f"{svg[: root.end()]}<style>{faces}</style>{svg[root.end() :]}"


@cache
def _face(style, letters):
    """Return a CSS rule @font-face with the given letters in a style of the font."""
    from fontTools import subset  # a dependency of matplotlib
    from fontTools.ttLib import TTFont
    from matplotlib import get_data_path

    path = Path(get_data_path()) / "fonts/ttf" / f"{_STYLES[style]}.ttf"
    font = TTFont(path, recalcTimestamp=False, lazy=True)  # parses only the letters that remain
    options = subset.Options(notdef_outline=True, hinting=False, name_IDs=[])
    options.drop_tables += ["FFTM"]  # contains dates, which would change the bytes
    cut = subset.Subsetter(options)
    cut.populate(text=letters)
    cut.subset(font)
    stream = io.BytesIO()
    font.save(stream)
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    look = {"": "", "italic": "font-style:italic;", "bold": "font-weight:bold;"}[style]
    return f"@font-face{{font-family:{_FAMILY};{look}src:url(data:font/ttf;base64,{data})}}"


# ---- the writer of each kind of block

_WRITERS = {
    "document": _document,
    "masthead": _masthead,
    "heading": _heading,
    "paragraph": _paragraph,
    "list": _list,
    "notice": _notice,
    "result": _result,
    "signature": _signature,
    "hash_code": _hash_code,
    "end": lambda block: f'<p class="end">{escape(block["text"])}</p>',
    "code": lambda block: f"<pre>{escape(block['text'])}</pre>",
    "key_values": _key_values,
    "table": table_html,
    "columns_table": table_html,
    "figure": _figure,
    "markdown": _markdown,
    "calculator": _paragraph,
    "tank_view": _paragraph,
    "cloud_map": _paragraph,
    "wall_map": _paragraph,
}
