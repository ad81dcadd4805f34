"""Conversion of blocks to HTML, for Jupyter and for a web page in a single file.

Conversion of each kind of block to HTML; all texts are escaped.

Long tables are divided and have a search field. SVG images contain their fonts, since other fonts
would change the width of labels.

A content security policy restricts the browser to scripts and styles with given SHA-256 digests.
Texts of users can therefore never run as scripts.
"""

import base64
import hashlib
import io
import json
import re
from functools import cache
from html import escape, unescape
from pathlib import Path

from tankcal.report.plain_formulas import formula_nodes
from tankcal.tank.gauging import ROOMS
from tankcal.text.shipped import DEFAULT, LANGUAGES, shipped_folder
from tankcal.text.words import load_words

_UNSAFE = {sign: f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def pack_numbers(numbers, kind="<f8"):
    """Return numbers as base64 text of little-endian values of a numpy type, such as "<f8"."""
    import numpy as np

    return base64.b64encode(np.ascontiguousarray(numbers, dtype=kind).tobytes()).decode("ascii")


def script_data(data):
    """Return data as JSON for a script element; its characters cannot end the element."""
    compact = {"separators": (",", ":"), "sort_keys": True}  # sorted as in a saved notebook
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, **compact)
    for sign, escaped in _UNSAFE.items():  # twenty times faster than str.translate
        text = text.replace(sign, escaped)
    return text


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


__all__ = ["block_html", "page"]
_SCRIPTS = {  # scripts of each kind of block; "": scripts of every page
    "": ("numbers.js", "look.js"),
    "columns_table": ("finder.js",),
    "calculator": ("deliveries.js", "calculator.js", "quantity.js", "quantity_form.js"),
    "cloud_map": ("ramp.js", "map.js"),
    "wall_map": ("ramp.js", "chosen.js", "wall.js"),
    "tank_view": ("chosen.js", "matrices.js", "meshes.js", "scene.js", "view.js"),
}


def page(blocks, has_contents=True):
    """Return blocks as an HTML page in the language of their document.

    Without `has_contents` the page has no table of contents, which suits a frame in a notebook.
    """
    first = blocks[0]
    language = first["language"] if first["language"] in LANGUAGES else DEFAULT
    words = load_words(language)
    blocks, contents = add_ids(blocks, words["web"])
    style = _template("page.css") + _colours(first.get("letterhead"))
    script = "".join(_template(f"web/{name}") for name in _scripts_for(blocks))
    script = f'"use strict";\n{{\n{script}}}\n'
    spoken = {"words": words["web"], "marks": words["language"]["marks"]}
    if any(block["kind"] == "calculator" for block in blocks):
        spoken["quantity"] = words["quantity"]
        labels = words["ticket"]["labels"]
        spoken["rooms"] = {key: labels[f"ticket_{key}"] for key in ("rooms", *ROOMS)}
        spoken["refused"] = words["calculator"]["texts"]["refused"]
    return "\n".join(
        [
            "<!DOCTYPE html>",
            f'<html lang="{escape(first["language"])}">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_policy(style, script)}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            f"<title>{escape(first['title'])}</title>",
            f"<style>{style}</style>",
            "</head>",
            "<body>",
            *_bar(first, blocks, words["web"]),
            '<div class="columns">',
            contents_html(contents, words["web"]) if has_contents else "",
            '<main id="main">',
            *_blocks_as_html(blocks, words["web"]),
            "</main>",
            "</div>",
            f'<script type="application/json" id="words">{script_data(spoken)}</script>',
            f"<script>{script}</script>",
            "</body>",
            "</html>",
            "",
        ]
    )


def _colours(letterhead):
    """Return the colours of the letterhead as CSS; a dark page keeps its colour of headings."""
    colours = letterhead["colours"] if letterhead else {}
    valid = {name: colour for name, colour in colours.items() if _COLOUR.fullmatch(colour)}
    ink = f"--ink: light-dark({valid['ink']}, #cfdeec); " if "ink" in valid else ""
    line = f"--line: {valid['line']}; " if "line" in valid else ""
    return f":root {{ {ink}{line}}}\n" if valid else ""


_COLOUR = re.compile("#[0-9a-fA-F]{6}")


def _blocks_as_html(blocks, words):
    """Yield the blocks as HTML; the numbers of tables make the ids of their fields unique."""
    for number, block in enumerate(blocks):
        kind = block["kind"]
        if kind == "columns_table" and len(block["rows"]) > PIECE:
            yield searchable_table(block, number, words)
        elif kind in ("table", "columns_table"):
            yield frame_table(block)
        elif kind == "calculator":
            yield calculator_html(block, words)
        elif kind == "tank_view":
            yield view_html(block, words)
        elif kind == "cloud_map":
            yield map_html(block, words)
        elif kind == "wall_map":
            yield wall_html(block, words)
        else:
            yield block_html(block)


def _bar(first, blocks, words):
    """Return the bar at the top: title, links to calculator and view, print and dark mode."""
    kinds = {block["kind"]: block["id"] for block in blocks if "id" in block}
    links = [
        f'<a href="#{kinds[kind]}">{escape(words[name])}</a>'
        for kind, name in (("calculator", "calculator"), ("tank_view", "view_short"))
        if kind in kinds
    ]
    return [
        f'<a class="skip" href="#main">{escape(words["skip"])}</a>',
        f'<div class="bar"><span class="about">{escape(first["title"])}</span>{"".join(links)}'
        f'<button type="button" id="print" hidden>{escape(words["print"])}</button>'
        f'<button type="button" id="look" hidden aria-pressed="false">{escape(words["dark"])}'
        "</button></div>",
    ]


def _scripts_for(blocks):
    kinds = {"", *(block["kind"] for block in blocks)}
    wanted = [name for kind, names in _SCRIPTS.items() if kind in kinds for name in names]
    return list(dict.fromkeys(wanted))


def _template(name):
    return (shipped_folder("report_templates") / name).read_text(encoding="utf-8")


def _policy(style, script):
    return (
        f"default-src 'none'; img-src data:; style-src '{_sha256(style)}'; "
        f"script-src '{_sha256(script)}'; base-uri 'none'; form-action 'none'"
    )


def _sha256(text):
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"


# ---- table of contents


_WIDGETS = {
    "calculator": ("calculator", 2),
    "tank_view": ("view", 1),
    "cloud_map": ("cloud_map", 2),
    "wall_map": ("wall_map", 2),
}
_DEEPEST = 2  # deepest level of headings in the table of contents


def add_ids(blocks, words):
    """Return blocks with ids of headings, and [(depth, text, id)]; titles of parts: depth 0."""
    contents = []

    def named(item, depth, text):
        """Add a heading to the contents and return it with its id."""
        name = f"s{len(contents) + 1}"
        contents.append((depth, text, name))
        return item | {"id": name}

    blocks_with_ids = []
    for block in blocks:
        kind = block["kind"]
        if kind == "masthead":
            block = named(block, 0, block["title"])
        elif kind == "heading" and block["level"] <= _DEEPEST:
            block = named(block, block["level"], block["text"])
        elif kind in _WIDGETS:
            name, depth = _WIDGETS[kind]
            block = named(block, depth, words[name])
        elif kind == "markdown":
            nodes = [
                named(node, node["level"], _text(node))
                if node["t"] == "heading" and node["level"] <= _DEEPEST
                else node
                for node in block["nodes"]
            ]
            block = block | {"nodes": nodes}
        blocks_with_ids.append(block)
    return blocks_with_ids, contents


def contents_html(contents, words):
    """Return the table of contents as a folding list of links; "" for a page without headings."""
    if len(contents) < 2:
        return ""
    links = "".join(
        f'<li class="depth-{depth}"><a href="#{name}">{escape(text)}</a></li>'
        for depth, text, name in contents
    )
    return (
        f'<nav class="contents" aria-label="{escape(words["contents"])}"><details open>'
        f"<summary>{escape(words['contents'])}</summary><ul>{links}</ul></details></nav>"
    )


def _text(node):
    """Return the text of a markdown node; formulas remain LaTeX."""
    node_text = node.get("s", node.get("latex", ""))
    return node_text + "".join(_text(child) for child in node.get("c", []))


# ---- interactive elements


def calculator_html(block, words):
    """Return the dip calculator: volume of a dip, and volume between two dips."""
    data = {key: block[key] for key in block if key not in ("kind", "text", "id", "note")}
    notes = filter(None, (words["calculator_note"], block.get("note")))
    fields = "".join(
        f'<p><label for="{name}">{escape(words[name])}</label> '
        f'<input id="{name}" inputmode="decimal" autocomplete="off" size="9" '
        f'aria-describedby="{name}-unit"> <span id="{name}-unit">m</span></p>'
        for name in ("dip", "other_dip")
    )
    results = "".join(
        f'<section aria-labelledby="{name}-label"><h4 id="{name}-label">'
        f"{escape(words[f'{name}_heading'])}</h4>"
        f'<p class="answer" id="{name}" role="status"></p><dl id="{name}-more"></dl></section>'
        for name in ("volume", "delivery")
    )
    return (
        f'<section class="widget" id="calculator" hidden>'
        f'<h3 id="{block["id"]}">{escape(words["calculator"])}</h3>'
        f'<div class="fields">{fields}</div><div class="answers">{results}</div>'
        f'<p class="note">{escape(" ".join(notes))}</p>'
        '<details id="quantity" hidden></details>'
        f"{_data('calculator', data)}</section>"
    )


def view_html(block, words):
    """Return the three-dimensional view of the tank, or the reason why it is missing."""
    heading = f'<h2 id="{block["id"]}">{escape(words["view"])}</h2>'
    if block["reason"]:
        return f'<section class="widget">{heading}<p>{escape(block["reason"])}</p></section>'
    has_shell = block["shell"] is not None
    data = {key: block[key] for key in ("shell", "solid")}
    return (
        f'<section class="widget" id="view" hidden>{heading}'
        f"<p>{escape(words['view_shell' if has_shell else 'view_solid'])}</p>"
        f"{_view_controls(words) if has_shell else ''}"
        '<div class="stage"><canvas tabindex="0" role="img" '
        f'aria-label="{escape(words["view_alt"])}"></canvas><div class="marks" aria-hidden="true">'
        f'</div></div><p class="fallback" hidden>{escape(words["no_webgl"])}</p>'
        f'<p class="camera">{_buttons(words)}</p>'
        f'<p class="note">{escape(words["view_keys"])}</p>'
        f"{_data('tank', data)}</section>"
    )


def map_html(block, words):
    """Return the map of the unrolled wall, whose cells show their deviation."""
    data = {key: block[key] for key in block if key not in ("kind", "text", "id")}
    return (
        f'<section class="widget" id="map" hidden><h3 id="{block["id"]}">'
        f"{escape(words['cloud_map'])}</h3><p>{escape(words['cloud_map_text'])}</p>"
        '<div class="fields"><p>'
        f'<label for="map-limit">{escape(words["cloud_limit"])}</label> '
        '<input type="range" id="map-limit" min="0" max="100" value="50"> '
        '<output for="map-limit" id="map-full"></output></p></div>'
        '<canvas class="map" tabindex="0" role="img" '
        f'aria-label="{escape(words["cloud_map_alt"])}"></canvas>'
        '<p class="answer" id="map-told" role="status">\u00a0</p>'
        f"{_data('map', data)}</section>"
    )


def wall_html(block, words):
    """Return the unrolled wall with used and rejected points, and details of a selected point."""
    data = {key: block[key] for key in block if key not in ("kind", "text", "id")}
    return (
        f'<section class="widget" id="wall" hidden><h3 id="{block["id"]}">'
        f"{escape(words['wall_map'])}</h3><p>{escape(words['wall_map_text'])}</p>"
        '<canvas class="map" tabindex="0" role="img" '
        f'aria-label="{escape(words["wall_map_alt"])}"></canvas>'
        '<p class="answer" id="wall-told" role="status">\u00a0</p>'
        f"{_data('wall', data)}</section>"
    )


def _view_controls(words):
    choices = "".join(
        f'<option value="{value}">{escape(words[f"from_{value}"])}</option>'
        for value in ("circles", "cylinder")
    )
    return (
        '<div class="fields">'
        f'<p><label for="deviations">{escape(words["deviations"])}</label> '
        f'<select id="deviations">{choices}</select></p>'
        f'<p><label for="exaggeration">{escape(words["exaggeration"])}</label> '
        '<input type="range" id="exaggeration" min="0" max="100"> '
        '<output for="exaggeration" id="factor"></output></p>'
        f'<p><label><input type="checkbox" id="show-points" checked> '
        f"{escape(words['show_points'])}</label></p>"
        f'<p><label><input type="checkbox" id="show-names"> {escape(words["show_names"])}</label>'
        '</p></div><div class="legend"><span id="least"></span><span class="ramp"></span>'
        f'<span id="most"></span> <span>{escape(words["legend"])}</span></div>'
    )


def _buttons(words):
    signs = {"left": "◀", "right": "▶", "up": "▲", "down": "▼", "nearer": "+", "farther": "−"}
    buttons = [
        f'<button type="button" data-move="{move}" aria-label="{escape(words[move])}" '
        f'title="{escape(words[move])}">{sign}</button>'
        for move, sign in signs.items()
    ]
    buttons.append(f'<button type="button" data-move="reset">{escape(words["reset"])}</button>')
    return " ".join(buttons)


def _data(name, data):
    return f'<script type="application/json" id="{name}-data">{script_data(data)}</script>'
