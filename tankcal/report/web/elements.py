"""Conversion of each kind of block to HTML; all texts are escaped."""

import base64
from html import escape

from tankcal.report.web.svg_fonts import with_fonts
from tankcal.report.web.tables import caption_of, table_html


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
        content = with_fonts(content)
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
