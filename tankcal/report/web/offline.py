"""The page: one file that asks the network for nothing, with its own scripts and no others.

A policy in its head lets the browser run only scripts and styles of the given SHA-256, so nothing
that a user wrote can run, whatever it says.
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

_SCRIPTS = {
    "": ("numbers.js", "look.js"),
    "columns_table": ("finder.js",),
    "calculator": ("deliveries.js", "calculator.js"),
    "cloud_map": ("ramp.js", "map.js"),
    "wall_map": ("ramp.js", "chosen.js", "wall.js"),
    "tank_view": ("chosen.js", "matrices.js", "meshes.js", "scene.js", "view.js"),
}


def page(blocks, has_contents=True):
    """The blocks as one HTML page, in the words of their document's language.

    has_contents  False: without the list of its headings, as a notebook frames it
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
            *_written(blocks, words["web"]),
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
    """The letterhead's colours as style: on a dark page headings keep the colour of the page."""
    colours = letterhead["colours"] if letterhead else {}
    sound = {name: one for name, one in colours.items() if _COLOUR.fullmatch(one)}
    ink = f"--ink: light-dark({sound['ink']}, #cfdeec); " if "ink" in sound else ""
    line = f"--line: {sound['line']}; " if "line" in sound else ""
    return f":root {{ {ink}{line}}}\n" if sound else ""


_COLOUR = re.compile("#[0-9a-fA-F]{6}")


def _written(blocks, words):
    """The blocks as HTML; tables are numbered, for their fields have names."""
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
    """The bar at the top: what the page is about, ways to what is used most, light or dark."""
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
