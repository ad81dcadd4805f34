"""Summary of a batch as JSON, CSV, workbook and web page.

All values come from the rows of `tankcal.batch.summary`; no number is computed here.
"""

import json

from tankcal.report.batch.paper import SummaryPaper

FILES = JSON, CSV, WORKBOOK, PAGE = "summary.json", "summary.csv", "summary.xlsx", "summary.html"


def summary_files(summary, language, folder):
    """Write the files of a summary into a folder and return their names.

    Parameters
    ----------
    summary : dict
        {"tankcal", "do", "rows", "gone"}, as in summary.json.
    language : str
        Language of workbook and page, one of languages.LANGUAGES.
    folder : Path

    Returns
    -------
    list of str
    """
    from tankcal.report.batch.documents import CSV_COLUMNS, page_blocks, write_summary
    from tankcal.report.outputs.csv_files import write_table
    from tankcal.report.web import page

    text = json.dumps(summary, ensure_ascii=False, allow_nan=False, indent=1)
    data = text.encode("utf-8", "replace")  # names of files may contain bytes that are not UTF-8
    (folder / JSON).write_bytes(data + b"\n")
    paper = SummaryPaper(json.loads(data), language)
    rows = [paper.plain_row(row) for row in paper.summary["rows"]]
    write_table(CSV_COLUMNS, folder / CSV, rows)
    write_summary(paper, folder / WORKBOOK)
    web_page = page([block.data for block in page_blocks(paper)])
    (folder / PAGE).write_text(web_page, encoding="utf-8", errors="replace")
    return [*FILES]
