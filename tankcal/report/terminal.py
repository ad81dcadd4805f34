"""Blocks as lines of a terminal: the tables of the papers, aligned, without their figures."""

from textwrap import wrap

WIDTH = 100  # characters of a line of text; a table is as wide as it is
_GAP = "  "
_BLANKS = dict.fromkeys(
    map(ord, "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{FIGURE SPACE}"), " "
)


def lines_of(found):
    """Lines of text of a list of blocks (`report.blocks.Block`); figures are left out.

    Spaces that hold words together do so here, too, and come out as plain ones.
    """
    lines = []
    for block in found:
        written = _WRITERS.get(block.data["kind"], _nothing)(block.data)
        if written:
            lines += [*([""] if lines else []), *written]
    return [line.translate(_BLANKS).rstrip() for line in lines]


def _nothing(block):
    return []


def _heading(block):
    return [block["text"], "-" * len(block["text"])]


def _paragraph(block):
    return _wrapped(block["text"])


def _listing(block):
    return [line for item in block["items"] for line in _wrapped(item, "- ", "  ")]


def _wrapped(text, first="", then=""):
    return wrap(
        text,
        WIDTH,
        initial_indent=first,
        subsequent_indent=then,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _result(block):
    note = _wrapped(block["note"], _GAP, _GAP) if block["note"] else []
    return [*_wrapped(f"{block['label']}: {block['text']}"), *note]


def _key_values(block):
    width = max((len(name) for name, _ in block["items"]), default=0)
    written = [block["caption"]] if block["caption"] else []
    for name, value in block["items"]:
        written += _wrapped(value or " ", f"{name:<{width}}{_GAP}", " " * (width + len(_GAP)))
    return written


def _table(block):
    heads = [column["heading"] for column in block["columns"]]
    units = [column["unit"] for column in block["columns"]]
    columns = [
        _filled(texts, align, block["decimal_mark"])
        for texts, align in zip(zip(*block["rows"], strict=True), block["align"], strict=False)
    ] or [()] * len(heads)
    rows = [heads, *([units] if any(units) else []), *zip(*columns, strict=True)]
    widths = [max(map(len, texts)) for texts in zip(*rows, strict=True)]
    placed = [
        _GAP.join(
            text.ljust(width) if align == "left" else text.rjust(width)
            for text, width, align in zip(row, widths, block["align"], strict=True)
        ).rstrip()
        for row in rows
    ]
    below_head = 2 if any(units) else 1
    rule = "-" * (sum(widths) + len(_GAP) * (len(widths) - 1))
    caption = _wrapped(block["caption"]) if block["caption"] else []
    return [*caption, *placed[:below_head], rule, *placed[below_head:]]


def _filled(texts, align, mark):
    """Numbers of a column with spaces behind them, so that their decimal marks line up."""
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
