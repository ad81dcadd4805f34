"""The web page: a single file that needs no network.

A content security policy restricts the browser to scripts and styles with given SHA-256 digests.
Texts of users can therefore never run as scripts.
"""

import base64
import hashlib
import re
from html import escape

from tankcal.report.web.contents import contents_html, with_ids
from tankcal.report.web.elements import block_html
from tankcal.report.web.packing import script_data
from tankcal.report.web.tables import PIECE, framed_table, searchable_table
from tankcal.report.web.widgets import calculator_html, map_html, view_html, wall_html
from tankcal.text.languages import DEFAULT, LANGUAGES
from tankcal.text.shipped import shipped_folder
from tankcal.text.words import load_words

_SCRIPTS = {  # scripts of each kind of block; "": scripts of every page
    "": ("numbers.js", "look.js"),
    "columns_table": ("finder.js",),
    "calculator": ("deliveries.js", "calculator.js"),
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
    blocks, contents = with_ids(blocks, words["web"])
    style = _template("page.css") + _colours(first.get("letterhead"))
    script = "".join(_template(f"web/{name}") for name in _scripts_for(blocks))
    script = f'"use strict";\n{{\n{script}}}\n'
    spoken = {"words": words["web"], "marks": words["language"]["marks"]}
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
            yield framed_table(block)
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
