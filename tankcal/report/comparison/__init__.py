"""What `tankcal compare` leaves behind: the comparison on paper, as a page, a workbook and CSV.

Nothing here computes a number: all of it is made from comparison.json.
"""

from functools import partial

from tankcal.messages import message
from tankcal.record import manifest, save
from tankcal.record.comparison import COMPARISON
from tankcal.record.schema import to_plain
from tankcal.report.comparison.paper import FILE, WORKBOOK, ComparisonPaper
from tankcal.report.comparison.tables import COURSES, DELIVERIES, ROWS, WATERFALL
from tankcal.report.saved_folder import SavedFolder, write_pages

__all__ = [
    *("FILES", "ComparisonPaper", "comparison_file", "rebuild", "refuse_foreign"),
    "write_comparison",
]

PDF, PAGE = "comparison.pdf", "comparison.html"
TABLES = {
    "rows.csv": ROWS,
    "waterfall.csv": WATERFALL,
    "deliveries.csv": DELIVERIES,
    "courses.csv": COURSES,
}
FILES = (FILE, *TABLES, WORKBOOK, PDF, PAGE, manifest.FILE)
_FOLDER = SavedFolder(
    COMPARISON,
    FILES,
    unreadable=lambda error: message(
        "comparison_unreadable", "cannot be read as a comparison: {error}", error=error
    ),
    without_content=lambda what: message(
        "no_comparison", "does not have the content of a comparison ({what})", what=what
    ),
)
refuse_foreign, comparison_file, load = _FOLDER.refuse_foreign, _FOLDER.file_of, _FOLDER.load


def write_comparison(found, folder, language=None, progress=None, letterhead=None):
    """Write comparison.json, CSV files, workbook, PDF and web page, all or nothing.

    Parameters
    ----------
    found : ComparisonFile or dict
        Of `recalibration.comparison.compare`, or the same as plain data.
    folder : path
        Made when missing; an earlier comparison there is replaced, and a folder that holds
        anything else is refused.
    language : str, optional
        Of papers and workbook, one of languages.LANGUAGES; None: English.
    progress : callable, optional
        Called with a line of text as each step begins.
    letterhead : report.letterhead.Letterhead, optional
        Of who compares.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For a folder that is not tankcal's to replace, and what is no comparison.
    """
    plain = found if isinstance(found, dict) else to_plain(found)
    paper = ComparisonPaper(plain, language, letterhead)
    return _FOLDER.write(folder, partial(_write, paper), language, progress)


def rebuild(source, folder, language=None, progress=None, letterhead=None):
    """Write the same from a comparison.json alone; arguments as of `write_comparison`."""
    return _FOLDER.rebuild(
        source, lambda found: write_comparison(found, folder, language, progress, letterhead)
    )


def _write(paper, folder, progress):
    from tankcal.report.comparison import workbook
    from tankcal.report.comparison.pages import pages
    from tankcal.report.outputs.csv_files import write_table

    progress(message("comparison_tables", "writing the tables"))
    save(paper.saved, folder / FILE)
    for name, table in TABLES.items():
        if rows := table.rows(paper.found):
            write_table(table, folder / name, rows)
    workbook.write(paper, folder / WORKBOOK)
    progress(message("comparison_papers", "setting the papers"))
    write_pages(pages, paper, folder, PDF, PAGE)
