"""Conversion of markdown cells into nodes {"t": kind, ...} for the PDF and the web page."""

import mistune

from tankcal.errors import TankcalError
from tankcal.report.latex_math import formula

_SCHEMES = ("https:", "http:", "mailto:")  # schemes of links that remain links
_WRAPPERS = {
    "paragraph": "paragraph",
    "block_text": "plain",
    "block_quote": "quote",
    "emphasis": "emph",
    "strong": "strong",
    "list_item": "item",
}


def nodes(source):
    """Return the nodes of a markdown text (list of dict).

    HTML is printed as text. A link with an unusual scheme is reduced to its text. Images and
    unknown mathematics raise TankcalError.
    """
    parse = mistune.create_markdown(renderer=None, plugins=["math", "table"])
    return _children(parse(source))


def _children(tokens):
    converted = (_node(token) for token in tokens if token["type"] != "blank_line")
    return [node for node in converted if node is not None]


def _node(token):
    """Convert a token of mistune into a node."""
    kind, raw = token["type"], token.get("raw", "")
    if kind in _WRAPPERS:
        return {"t": _WRAPPERS[kind], "c": _children(token["children"])}
    if kind in ("text", "inline_html", "block_html"):
        text = {"t": "text", "s": raw}
        return {"t": "paragraph", "c": [text]} if kind == "block_html" else text
    if kind in ("softbreak", "linebreak"):
        return {"t": "text", "s": " "} if kind == "softbreak" else {"t": "break"}
    if kind == "codespan":
        return {"t": "code", "s": raw}
    if kind == "block_code":
        return {"t": "code_block", "s": raw.rstrip("\n")}
    if kind == "thematic_break":
        return {"t": "rule"}
    if kind == "heading":
        level = min(token["attrs"]["level"], 3)
        return {"t": "heading", "level": level, "c": _children(token["children"])}
    if kind == "list":
        ordered = bool(token["attrs"]["ordered"])
        return {"t": "list", "ordered": ordered, "c": _children(token["children"])}
    if kind in ("inline_math", "block_math"):
        return _math(raw, kind == "block_math")
    if kind == "link":
        return _link(token)
    if kind == "table":
        return _table(token)
    raise TankcalError(f"a markdown cell has a part that the report cannot show: {kind}")


def _math(latex, block):
    read = formula(latex)
    return {
        "t": "math",
        "latex": read.latex,
        "typst": read.typst,
        "mathml": read.mathml,
        "block": block,
    }


def _link(token):
    url, children = token["attrs"]["url"], _children(token["children"])
    if url.lower().startswith(_SCHEMES):
        return {"t": "link", "url": url, "c": children}
    return {"t": "plain", "c": children}


def _table(token):
    head, body = token["children"][0], token["children"][1:]
    lines = [head["children"]] + [row["children"] for part in body for row in part["children"]]
    return {
        "t": "table",
        "align": [cell["attrs"]["align"] or "left" for cell in head["children"]],
        "rows": [[_children(cell["children"]) for cell in line] for line in lines],
    }
