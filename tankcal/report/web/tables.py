"""Conversion of tables to HTML; long tables are divided and have a search field."""

from html import escape

from tankcal.report.plain_formulas import formula_nodes

PIECE = 66  # rows of a part: a column of a printed page
SHORT = 20  # largest number of rows of a table that is printed on one page


def table_html(block):
    """Return a table as HTML; a long narrow table is in a scrolling frame."""
    table = _table(block, _rows(block), caption_of(block))
    if block["kind"] == "columns_table":
        return f'<div class="long" tabindex="0">{table}</div>'
    return table


def framed_table(block):
    """Return a table in a frame, so that only the table scrolls on a narrow page."""
    short = " short" if len(block["rows"]) <= SHORT else ""
    return f'<div class="frame{short}">{table_html(block)}</div>'


def searchable_table(block, number, words):
    """Return a long narrow table with a search field.

    The table is divided into parts of PIECE rows, whose layout the browser computes when they
    become visible.

    Parameters
    ----------
    block : dict
        Block of the table.
    number : int
        Number of the table on the page.
    words : dict
        Words of the web page.

    Returns
    -------
    str
        HTML.
    """
    rows = [row.replace('<td class="decimal">', "<td>") for row in _rows(block)]
    pieces = "".join(
        f'<div class="piece">{_table(block, rows[start : start + PIECE], "")}</div>'
        for start in range(0, len(rows), PIECE)
    )
    caption = f'<p class="caption" id="caption-{number}">{escape(block["caption"])}</p>'
    field = (
        f'<p class="finder" hidden><label for="find-{number}">{escape(words["find"])}</label> '
        f'<input type="search" id="find-{number}" inputmode="decimal" autocomplete="off" '
        f'placeholder="{escape(_first_cell(block))}"> '
        f'<output for="find-{number}" aria-live="polite"></output></p>'
    )
    return (
        f'<div class="searchable">{caption}{field}'
        f'<div class="pieces" role="region" tabindex="0" aria-labelledby="caption-{number}">'
        f"{pieces}</div></div>"
    )


def caption_of(block):
    """Return the caption element of a table, or ""."""
    return f"<caption>{escape(block['caption'])}</caption>" if block["caption"] else ""


def decimal_fills(texts, mark="."):
    """Return the spaces after each number that align the decimal marks of a column."""
    tails = [len(text) - 1 - text.rfind(mark) if mark in text else -1 for text in texts]
    longest = max(tails, default=-1)
    return [
        ("\N{PUNCTUATION SPACE}" if tail < 0 <= longest else "")
        + "\N{FIGURE SPACE}" * (longest - max(tail, 0))
        for tail in tails
    ]


def _table(block, rows, caption):
    heads = "".join(
        f'<th scope="col" class="{align}">{escape(column["heading"])}'
        + (f'<br><span class="unit">{escape(column["unit"])}</span>' if column["unit"] else "")
        + "</th>"
        for column, align in zip(block["columns"], block["align"], strict=True)
    )
    return (
        f'<table class="lines">{caption}<thead><tr>{heads}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table>"
    )


def _rows(block):
    """Return the rows as HTML, with decimal marks aligned over the whole table."""
    formulas, unbroken_columns = block.get("formulas", ()), block.get("whole", ())
    links = block.get("links", {})  # {column: address of each cell, "" for none}
    columns = [
        _cells(
            column,
            align,
            block["decimal_mark"],
            _typeset_formulas if i in formulas else escape,
            links=links.get(i),
            look=f"{align} whole" if i in unbroken_columns else align,
        )
        for i, (column, align) in enumerate(
            zip(zip(*block["rows"], strict=True), block["align"], strict=False)
        )
    ]
    return [f"<tr>{''.join(cells)}</tr>" for cells in zip(*columns, strict=True)]


def _cells(texts, align, mark, shown, *, links, look):
    """Return the cells of a column as HTML.

    Cells of a "decimal" column are padded. shown(text) returns the HTML of a text. `links`
    contains an address for each cell, or ""; None: no links.
    """
    fills = decimal_fills(texts, mark) if align == "decimal" else [""] * len(texts)
    return [
        f'<td class="{look}">'
        + (f'<a href="{escape(link)}">{shown(text)}</a>' if link else shown(text))
        + f"{fill}</td>"
        for text, fill, link in zip(texts, fills, links or [""] * len(texts), strict=True)
    ]


def _typeset_formulas(text):
    return "".join(
        f'<math display="inline">{node["mathml"]}</math>'
        if node["t"] == "math"
        else escape(node["s"])
        for node in formula_nodes(text)
    )


def _first_cell(block):
    """Return the first cell of the middle row as an example of a search."""
    return block["rows"][len(block["rows"]) // 2][0] if block["rows"] else ""
