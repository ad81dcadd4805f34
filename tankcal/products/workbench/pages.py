"""Tables, lists and results of a desk as plain HTML, with the texts and colours of the widgets."""

from html import escape

from tankcal.products.desk.findings import DOUBTFUL

MOST_ROWS = 400  # largest number of rows of a page; the middle of a longer table is omitted
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
    """HTML of a ShownTable, with the problem in each marked cell.

    `left_out(count)` returns the text of the row that replaces omitted rows.
    """
    head = "".join(
        f"<th{_class_of(shown.marks, None, place)}>{escape(column.heading)}"
        f"<small>{escape(column.name if shown.takes_rows else column.unit)}</small>"
        f"{_reason(shown.marks, None, place)}</th>"
        for place, column in enumerate(shown.columns)
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
    """HTML of a row."""
    cells = "".join(
        f"<td{_class_of(shown.marks, row, place, 'number' if column.is_number else '')}>"
        f"{escape(text)}{_reason(shown.marks, row, place)}</td>"
        for place, (column, text) in enumerate(zip(shown.columns, shown.rows[row], strict=True))
    )
    whole = f"{row + 1}{_reason(shown.marks, row, None)}"
    return f"<tr><th{_class_of(shown.marks, row, None)}>{whole}</th>{cells}</tr>"


def _class_of(marks, row, column, also=""):
    """HTML attribute with the classes of a cell."""
    level = marks.get((row, column), ("",))[0]
    names = " ".join(name for name in (also, level) if name)
    return f' class="{names}"' if names else ""


def _reason(marks, row, column):
    """HTML of the problem of a cell, or ""."""
    mark = marks.get((row, column))
    return f'<small class="reason">{escape(mark[1])}</small>' if mark else ""


def list_page(lines, nothing):
    """HTML of a list [(level, text)], or the text `nothing` if the list is empty."""
    if not lines:
        return f"{STYLE}<p>{escape(nothing)}</p>"
    items = "".join(f'<li class="{level}">{escape(text)}</li>' for level, text in lines)
    return f'{STYLE}<ul class="tankcal-list">{items}</ul>'


def text_page(text):
    """HTML of a text with a paragraph for each line."""
    return "".join(f"<p>{escape(line)}</p>" for line in text.splitlines())


# ---- results of the last computation


def warnings_page(desk):
    """HTML of warnings of the last computation that the check did not give, or ""."""
    result = desk.last_run.result
    known = {warning.text for warning in result.job.warnings}
    warnings = [warning for warning in result.warnings if warning.text not in known]
    if not warnings:
        return ""
    return list_page([(DOUBTFUL, desk.reader.line(warning)) for warning in warnings], "")


def results_page(desk):
    """HTML of the last computation, without buttons, below the list of written files."""
    from tankcal.products.workbench.views.page import SavedView
    from tankcal.record import record_of
    from tankcal.report.paper import Paper

    paper = Paper(record_of(desk.last_run.result), language=desk.reader.language)
    names = ", ".join(path.name for path in desk.last_run.files)
    written = desk.reader.word("written", folder=str(desk.out.resolve()), files=names)
    above = f"<p>{escape(written)}</p>{warnings_page(desk)}"
    return f"{above}{SavedView(paper)._repr_html_()}"
