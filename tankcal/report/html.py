"""Blocks as HTML: inside Jupyter, and as one offline page without any script."""

import base64
from html import escape

from tankcal.shipped import shipped

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


def page(blocks):
    """The blocks as one HTML page that asks the network for nothing; the style is page.css."""
    first = blocks[0]
    style = (shipped("report_templates") / "page.css").read_text(encoding="utf-8")
    return "\n".join(
        [
            "<!DOCTYPE html>",
            f'<html lang="{escape(first["language"])}">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(first['title'])}</title>",
            f"<style>\n{style}</style>",
            "</head>",
            "<body>",
            "<main>",
            *(block_html(block) for block in blocks),
            "</main>",
            "</body>",
            "</html>",
            "",
        ]
    )


def block_html(block):
    """One block as HTML; every text of the block is escaped."""
    return _WRITERS[block["kind"]](block)


def _document(block):
    running = "".join(f"<span>{escape(text)}</span>" for text in block["running"])
    notice = _notice({"text": block["notice"]}) if block["notice"] else ""
    return f'<header class="running">{running}</header>{notice}'


def _masthead(block):
    lines = (
        [f'<p class="laboratory">{escape(block["laboratory"])}</p>'] if block["laboratory"] else []
    )
    lines.append(f"<h1>{escape(block['title'])}</h1>")
    lines.append(f'<p class="subtitle">{escape(block["subtitle"])}</p>')
    if block["number_label"]:
        number = escape(block["number"]) or '<span class="blank"></span>'
        lines.append(f'<p class="number">{escape(block["number_label"])} {number}</p>')
    return f'<div class="masthead">{"".join(lines)}</div>'


def _heading(block):
    level = block["level"] + 1
    return f"<h{level}>{escape(block['text'])}</h{level}>"


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


def _key_values(block):
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{escape(value)}</td></tr>'
        for name, value in block["items"]
    )
    return f'<table class="key-values">{_caption(block)}<tbody>{rows}</tbody></table>'


def _table(block):
    heads = "".join(
        f'<th scope="col" class="{align}">{escape(column["heading"])}'
        + (f'<br><span class="unit">{escape(column["unit"])}</span>' if column["unit"] else "")
        + "</th>"
        for column, align in zip(block["columns"], block["align"], strict=True)
    )
    columns = [
        _cells(column, align)
        for column, align in zip(zip(*block["rows"], strict=True), block["align"], strict=False)
    ]
    rows = "".join(f"<tr>{''.join(cells)}</tr>" for cells in zip(*columns, strict=True))
    table = (
        f'<table class="lines">{_caption(block)}<thead><tr>{heads}</tr></thead>'
        f"<tbody>{rows}</tbody></table>"
    )
    return (
        f'<div class="long" tabindex="0">{table}</div>'
        if block["kind"] == "columns_table"
        else table
    )


def _cells(texts, align):
    """The cells of one column; under "decimal", filled up so that the decimal marks line up."""
    fills = decimal_fills(texts) if align == "decimal" else [""] * len(texts)
    return [
        f'<td class="{align}">{escape(text)}{fill}</td>'
        for text, fill in zip(texts, fills, strict=True)
    ]


def decimal_fills(texts):
    """For each number what is missing behind it, as spaces as wide as a digit and as a mark."""
    tails = [len(text) - 1 - max(text.rfind("."), text.rfind(",")) for text in texts]
    tails = [
        tail if "." in text or "," in text else -1 for tail, text in zip(tails, texts, strict=True)
    ]
    longest = max(tails, default=-1)
    return [
        ("\N{PUNCTUATION SPACE}" if tail < 0 <= longest else "")
        + "\N{FIGURE SPACE}" * (longest - max(tail, 0))
        for tail in tails
    ]


def _figure(block):
    kind = "svg" if "svg" in block else "png"
    mime = {"svg": "image/svg+xml", "png": "image/png"}[kind]
    content = block[kind]
    if kind == "svg":
        content = base64.b64encode(content.encode("utf-8")).decode("ascii")
    width = f"{100 * block['width']:.0f}%"
    caption = f"<figcaption>{escape(block['caption'])}</figcaption>" if block["caption"] else ""
    return (
        f'<figure><img style="width:{width}" alt="{escape(block["alt"])}" '
        f'src="data:{mime};base64,{content}">{caption}</figure>'
    )


def _caption(block):
    return f"<caption>{escape(block['caption'])}</caption>" if block["caption"] else ""


def _markdown(block):
    return "".join(_node(node) for node in block["nodes"])


_SPANS = {"paragraph": "p", "quote": "blockquote", "emph": "em", "strong": "strong", "item": "li"}


def _node(node):
    kind = node["t"]
    inner = "".join(_node(child) for child in node.get("c", []))
    if kind in _SPANS:
        return f"<{_SPANS[kind]}>{inner}</{_SPANS[kind]}>"
    if kind == "heading":
        return f"<h{node['level'] + 1}>{inner}</h{node['level'] + 1}>"
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


_WRITERS = {
    "document": _document,
    "masthead": _masthead,
    "heading": _heading,
    "paragraph": lambda block: f"<p>{escape(block['text'])}</p>",
    "list": _list,
    "notice": _notice,
    "result": _result,
    "signature": _signature,
    "end": lambda block: f'<p class="end">{escape(block["text"])}</p>',
    "code": lambda block: f"<pre>{escape(block['text'])}</pre>",
    "key_values": _key_values,
    "table": _table,
    "columns_table": _table,
    "figure": _figure,
    "markdown": _markdown,
}
