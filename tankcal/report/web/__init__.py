"""Conversion of blocks to HTML, for Jupyter and for a web page: a single file without network.

A content security policy restricts the browser to scripts and styles with given SHA-256 digests.
Texts of users can therefore never run as scripts.
"""

import base64
import hashlib
import re
from html import escape

from tankcal.report.web.elements import PIECE, block_html, frame_table, searchable_table
from tankcal.report.web.packing import script_data
from tankcal.tank.gauging import ROOMS
from tankcal.text.shipped import DEFAULT, LANGUAGES, shipped_folder
from tankcal.text.words import load_words

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
