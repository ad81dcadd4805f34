"""The contents of the page: its headings get names that links lead to."""

from html import escape

_WIDGETS = {
    "calculator": ("calculator", 2),
    "tank_view": ("view", 1),
    "cloud_map": ("cloud_map", 2),
    "wall_map": ("wall_map", 2),
}
_DEEPEST = 2  # level of a heading that stands in the contents


def with_ids(blocks, words):
    """(blocks whose headings have an id, [(depth, text, id)]): titles of parts are of depth 0."""
    contents = []

    def named(item, depth, text):
        name = f"s{len(contents) + 1}"
        contents.append((depth, text, name))
        return item | {"id": name}

    found = []
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
        found.append(block)
    return found, contents


def contents_html(contents, words):
    """The contents as a list of links that can be folded; nothing for a page without headings."""
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
    """The words of a markdown node, formulas as they are written."""
    own = node.get("s", node.get("latex", ""))
    return own + "".join(_text(child) for child in node.get("c", []))
