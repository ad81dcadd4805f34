"""What the page style need not find out of tables: digits to fill up, widths of long columns.

The typesetter asks for the place of a long table several times, and each time it would count the
letters of every cell.
"""

import re
from unicodedata import combining

_ON_ONE_LINE = re.compile(r"[0-9.,+*\N{MINUS SIGN}\N{NARROW NO-BREAK SPACE}]*")  # as wide as it is


def prepared(block):
    """A block as `page.typ` takes it; what is no table as it is.

    A cell whose number lacks digits behind its mark, by which it would stand in line with the
    others of its column, is {"text": its own, "missing": what is set unseen}. A `columns_table` has
    `shares`, the widths of its columns in proportion to their longest text, and says whether it is
    `even`: of numbers alone, each row of which is as high as the others.

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
    """The numbers of a column, each with what it lacks behind its decimal mark."""
    decimals = [len(text.rpartition(mark)[2]) if mark in text else None for text in texts]
    known = [count for count in decimals if count is not None]
    if not known:
        return texts
    longest = max(known)
    return [_cell(text, own, longest, mark) for text, own in zip(texts, decimals, strict=True)]


def _cell(text, own, longest, mark):
    if own == longest:
        return text
    missing = mark + "0" * longest if own is None else "0" * (longest - own)
    return {"text": text, "missing": missing}


def _share(column, cells):
    """The letters of the longest text of a column, its heading and its unit among them."""
    heads = map(_letters, (column["heading"], column["unit"]))
    return 1 + max(*heads, *map(_length, cells))


def _length(cell):
    if isinstance(cell, str):
        return _letters(cell)
    return _letters(cell["text"]) + len(cell["missing"])


def _letters(text):
    return len(text) if text.isascii() else sum(not combining(sign) for sign in text)
