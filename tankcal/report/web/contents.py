"""Table of contents of the web page, with links to the headings."""

from html import escape

_WIDGETS = {
    "calculator": ("calculator", 2),
    "tank_view": ("view", 1),
    "cloud_map": ("cloud_map", 2),
    "wall_map": ("wall_map", 2),
}
_DEEPEST = 2  # deepest level of headings in the table of contents


def with_ids(blocks, words):
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
