"""The summary of a batch: as data, as CSV, as a workbook and as a web page.

Nothing here computes a number: all of it is made of the rows that `tankcal.batch.summary` has.
"""

import json

from tankcal.report.batch.paper import SummaryPaper
from tankcal.report.batch.tables import FILE_OF_JOBS
from tankcal.report.outputs.csv_files import write_table

FILES = JSON, CSV, WORKBOOK, PAGE = "summary.json", "summary.csv", "summary.xlsx", "summary.html"


def summary_files(found, language, folder):
    """Write the summary into a folder; gives the names of the files.

    Parameters
    ----------
    found : dict
        {"tankcal", "do", "rows", "gone"}.
    language : str
        Of workbook and page, one of languages.LANGUAGES.
    folder : Path
    """
    from tankcal.report.batch import workbook
    from tankcal.report.batch.pages import pages
    from tankcal.report.web import page

    text = json.dumps(found, ensure_ascii=False, allow_nan=False, indent=1)
    data = text.encode("utf-8", "replace")  # names of files may have bytes that are no UTF-8
    (folder / JSON).write_bytes(data + b"\n")
    found = json.loads(data)
    paper = SummaryPaper(found, language)
    write_table(FILE_OF_JOBS, folder / CSV, [paper.plain_row(one) for one in found["rows"]])
    workbook.write(paper, folder / WORKBOOK)
    blocks = [one.data for one in pages(paper)]
    (folder / PAGE).write_text(page(blocks), encoding="utf-8", errors="replace")
    return [*FILES]
