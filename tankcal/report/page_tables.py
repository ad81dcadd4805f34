"""Preparation of tables for the page style: alignment of decimal marks and widths of columns.

The typesetter lays out a long table several times. Without this preparation, it would count the
letters of every cell each time.
"""

import re
from unicodedata import combining

_ON_ONE_LINE = re.compile(r"[0-9.,+*\N{MINUS SIGN}\N{NARROW NO-BREAK SPACE}]*")  # cells of numbers


def prepared(block):
    """Return a block in the form that `page.typ` requires; only tables change.

    A number with fewer decimals than its column becomes {"text": number, "missing": digits}. The
    page style sets the missing digits invisibly, so that the decimal marks are aligned. A
    `columns_table` also has `shares`, relative widths of its columns, and `even`. `even` is True if
    the table consists of numbers only, so that all rows have equal height.

    Examples
    --------
    >>> table = {"kind": "columns_table", "align": ["decimal"], "rows": [["1.25"], ["10"]]}
    >>> table |= {"decimal_mark": ".", "columns": [{"heading": "V", "unit": "L"}]}
    >>> made = prepared(table)
    >>> made["rows"], made["shares"], made["even"]
    ([['1.25'], [{'text': '10', 'missing': '.00'}]], [6], True)
    """
    if block["kind"] not in ("table", "columns_table"):
        return block
    columns = [[row[i] for row in block["rows"]] for i in range(len(block["align"]))]
    mark, formulas = block["decimal_mark"], block.get("formulas", ())
    filled = [
        _filled(texts, mark) if align == "decimal" and i not in formulas else texts
        for i, (texts, align) in enumerate(zip(columns, block["align"], strict=True))
    ]
    block = block | {"rows": [list(row) for row in zip(*filled, strict=True)]}
    if block["kind"] == "table":
        return block
    shares = [_share(*column) for column in zip(block["columns"], filled, strict=True)]
    even = all(_ON_ONE_LINE.fullmatch(text) for texts in columns for text in texts)
    return block | {"shares": shares, "even": even}


def _filled(texts, mark):
    """Return the numbers of a column, with the decimals that each lacks to the longest."""
    decimals = [len(text.rpartition(mark)[2]) if mark in text else None for text in texts]
    known = [count for count in decimals if count is not None]
    if not known:
        return texts
    longest = max(known)
    return [_cell(text, count, longest, mark) for text, count in zip(texts, decimals, strict=True)]


def _cell(text, decimals, longest, mark):
    if decimals == longest:
        return text
    missing = mark + "0" * longest if decimals is None else "0" * (longest - decimals)
    return {"text": text, "missing": missing}


def _share(column, cells):
    """Number of letters of the longest cell, heading or unit of a column, plus a margin of 1."""
    heads = map(_letters, (column["heading"], column["unit"]))
    return 1 + max(*heads, *map(_length, cells))


def _length(cell):
    if isinstance(cell, str):
        return _letters(cell)
    return _letters(cell["text"]) + len(cell["missing"])


def _letters(text):
    return len(text) if text.isascii() else sum(not combining(sign) for sign in text)
