"""Tables and lists as plain HTML, where there are no widgets: the same texts and colours."""

from html import escape

MOST_ROWS = 400  # of a page; the middle of a longer table is left out
STYLE = """<style>
.tankcal-plain { border-collapse: collapse; font-size: 13px; }
.tankcal-plain th, .tankcal-plain td { border: 1px solid #bbb; padding: 2px 6px; text-align: left; }
.tankcal-plain th small { display: block; font-weight: normal; }
.tankcal-plain td.number { text-align: right; font-variant-numeric: tabular-nums; }
.tankcal-plain .bad { background: #f7c6c5; color: #5c0a09; }
.tankcal-plain .doubtful { background: #fbe6b4; color: #4d3800; }
.tankcal-plain td.bad small, .tankcal-plain td.doubtful small, .tankcal-plain .reason {
  display: block; white-space: pre-line; }
ul.tankcal-list { padding-left: 1.2em; }
ul.tankcal-list li.bad { color: #8c1d18; } ul.tankcal-list li.doubtful { color: #6b4e00; }
</style>"""


def table_page(shown, left_out):
    """A ShownTable as HTML; a marked cell says why within it.

    left_out(count)  the text of a row that stands for so many
    """
    head = "".join(
        f"<th{_class_of(shown.marks, None, place)}>{escape(one.heading)}"
        f"<small>{escape(one.name if shown.takes_rows else one.unit)}</small>"
        f"{_reason(shown.marks, None, place)}</th>"
        for place, one in enumerate(shown.columns)
    )
    half = MOST_ROWS // 2
    cut = len(shown.rows) > MOST_ROWS
    marked = {row for row, _ in shown.marks if row is not None}
    body = []
    for row in range(len(shown.rows)):
        if not cut or row < half or row >= len(shown.rows) - half or row in marked:
            body.append(_row(shown, row))
        elif row == half:
            gone = len(shown.rows) - 2 * half
            span = len(shown.columns) + 1
            body.append(f'<tr><td colspan="{span}">{escape(left_out(gone))}</td></tr>')
    reason = _reason(shown.marks, None, None)
    level = shown.marks.get((None, None), ("",))[0]
    above = (
        f'<div class="tankcal-plain"><div class="{level}">{reason}</div></div>' if reason else ""
    )
    return (
        f'{STYLE}{above}<table class="tankcal-plain"><thead><tr><th>#</th>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table>"
    )


def _row(shown, row):
    cells = "".join(
        f"<td{_class_of(shown.marks, row, place, 'number' if column.is_number else '')}>"
        f"{escape(text)}{_reason(shown.marks, row, place)}</td>"
        for place, (column, text) in enumerate(zip(shown.columns, shown.rows[row], strict=True))
    )
    whole = f"{row + 1}{_reason(shown.marks, row, None)}"
    return f"<tr><th{_class_of(shown.marks, row, None)}>{whole}</th>{cells}</tr>"


def _class_of(marks, row, column, also=""):
    level = marks.get((row, column), ("",))[0]
    names = " ".join(one for one in (also, level) if one)
    return f' class="{names}"' if names else ""


def _reason(marks, row, column):
    found = marks.get((row, column))
    return f'<small class="reason">{escape(found[1])}</small>' if found else ""


def list_page(lines, nothing):
    """[(level, text)] as a list; `nothing` is said where there are none."""
    if not lines:
        return f"{STYLE}<p>{escape(nothing)}</p>"
    items = "".join(f'<li class="{level}">{escape(text)}</li>' for level, text in lines)
    return f'{STYLE}<ul class="tankcal-list">{items}</ul>'


def text_page(text):
    """A text of several lines as HTML."""
    return "".join(f"<p>{escape(line)}</p>" for line in text.splitlines())
