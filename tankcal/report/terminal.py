"""Conversion of blocks to lines of a terminal, with aligned tables and without figures."""

from textwrap import wrap

WIDTH = 100  # characters of a line of text; tables may be wider
_GAP = "  "
_BLANKS = dict.fromkeys(
    map(ord, "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{FIGURE SPACE}"), " "
)


def lines_of(shown):
    """Return the lines of text of blocks (list of `report.blocks.Block`), without figures.

    Lines are not broken at no-break spaces, which are replaced by normal spaces.
    """
    lines = []
    for block in shown:
        block_lines = _WRITERS.get(block.data["kind"], _skip)(block.data)
        if block_lines:
            lines += [*([""] if lines else []), *block_lines]
    return [line.translate(_BLANKS).rstrip() for line in lines]


def _skip(block):
    return []


def _heading(block):
    return [block["text"], "-" * len(block["text"])]


def _paragraph(block):
    return _wrapped(block["text"])


def _listing(block):
    return [line for item in block["items"] for line in _wrapped(item, "- ", "  ")]


def _wrapped(text, first="", later=""):
    return wrap(
        text,
        WIDTH,
        initial_indent=first,
        subsequent_indent=later,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _result(block):
    note = _wrapped(block["note"], _GAP, _GAP) if block["note"] else []
    return [*_wrapped(f"{block['label']}: {block['text']}"), *note]


def _key_values(block):
    width = max((len(name) for name, _ in block["items"]), default=0)
    lines = [block["caption"]] if block["caption"] else []
    for name, value in block["items"]:
        lines += _wrapped(value or " ", f"{name:<{width}}{_GAP}", " " * (width + len(_GAP)))
    return lines


def _table(block):
    """Return the lines of a table with aligned columns."""
    heads = [column["heading"] for column in block["columns"]]
    units = [column["unit"] for column in block["columns"]]
    columns = [
        _filled(texts, align, block["decimal_mark"])
        for texts, align in zip(zip(*block["rows"], strict=True), block["align"], strict=False)
    ] or [()] * len(heads)
    rows = [heads, *([units] if any(units) else []), *zip(*columns, strict=True)]
    widths = [max(map(len, texts)) for texts in zip(*rows, strict=True)]
    lines = [
        _GAP.join(
            text.ljust(width) if align == "left" else text.rjust(width)
            for text, width, align in zip(row, widths, block["align"], strict=True)
        ).rstrip()
        for row in rows
    ]
    below_head = 2 if any(units) else 1
    rule = "-" * (sum(widths) + len(_GAP) * (len(widths) - 1))
    caption = _wrapped(block["caption"]) if block["caption"] else []
    return [*caption, *lines[:below_head], rule, *lines[below_head:]]


def _filled(texts, align, mark):
    """Pad the numbers of a column so that their decimal marks are aligned."""
    if align != "decimal":
        return texts
    tails = [len(text) - text.rfind(mark) if mark in text else 0 for text in texts]
    longest = max(tails, default=0)
    return [text + " " * (longest - tail) for text, tail in zip(texts, tails, strict=True)]


_WRITERS = {
    "heading": _heading,
    "paragraph": _paragraph,
    "notice": _paragraph,
    "list": _listing,
    "result": _result,
    "key_values": _key_values,
    "table": _table,
}
