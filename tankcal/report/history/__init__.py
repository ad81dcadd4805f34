"""What `tankcal history` leaves behind: a tank over the years, on paper, as a page, in tables.

Nothing here computes a number: all of it is made from history.json.
"""

from functools import partial

from tankcal.messages import message
from tankcal.record import manifest, save
from tankcal.record.history import HISTORY
from tankcal.record.schema import to_plain
from tankcal.report.history.paper import FILE, WORKBOOK, HistoryPaper
from tankcal.report.history.tables import (
    CERTIFICATES,
    CHANGES,
    CHECKS,
    RADII,
    RADIUS_CHANGES,
    VOLUMES,
    check_rows,
    radius_change_rows,
    radius_rows,
    volume_rows,
)
from tankcal.report.saved_folder import SavedFolder, write_pages

__all__ = [
    *("FILES", "HistoryPaper", "history_file", "rebuild", "refuse_foreign"),
    "write_history",
]

PDF, PAGE = "history.pdf", "history.html"
TABLES = {
    "certificates.csv": (CERTIFICATES, lambda found: found["certificates"]),
    "volumes.csv": (VOLUMES, volume_rows),
    "radii.csv": (RADII, radius_rows),
    "changes.csv": (CHANGES, lambda found: found["changes"]),
    "radius_changes.csv": (RADIUS_CHANGES, radius_change_rows),
    "inspections.csv": (CHECKS, check_rows),
}
FILES = (FILE, *TABLES, WORKBOOK, PDF, PAGE, manifest.FILE)
_FOLDER = SavedFolder(
    HISTORY,
    FILES,
    unreadable=lambda error: message(
        "history_unreadable", "cannot be read as a history: {error}", error=error
    ),
    without_content=lambda what: message(
        "no_history", "does not have the content of a history ({what})", what=what
    ),
)
refuse_foreign, history_file, load = _FOLDER.refuse_foreign, _FOLDER.file_of, _FOLDER.load


def write_history(found, folder, language=None, progress=None, letterhead=None):
    """Write history.json, CSV files, workbook, PDF and web page, all or nothing.

    Parameters
    ----------
    found : HistoryFile or dict
        Of `recalibration.history.history_of`, or the same as plain data.
    folder : path
        Made when missing; an earlier history there is replaced, and a folder that holds anything
        else is refused.
    language : str, optional
        Of papers and workbook, one of languages.LANGUAGES; None: English.
    progress : callable, optional
        Called with a line of text as each step begins.
    letterhead : report.letterhead.Letterhead, optional
        Of who made it.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For a folder that is not tankcal's to replace, and what is no history.
    """
    plain = found if isinstance(found, dict) else to_plain(found)
    paper = HistoryPaper(plain, language, letterhead)
    return _FOLDER.write(folder, partial(_write, paper), language, progress)


def rebuild(source, folder, language=None, progress=None, letterhead=None):
    """Write the same from a history.json alone; arguments as of `write_history`."""
    return _FOLDER.rebuild(
        source, lambda found: write_history(found, folder, language, progress, letterhead)
    )


def _write(paper, folder, progress):
    from tankcal.report.history import workbook
    from tankcal.report.history.pages import pages
    from tankcal.report.outputs.csv_files import write_table

    progress(message("history_tables", "writing the tables of the history"))
    save(paper.saved, folder / FILE)
    for name, (table, rows_of) in TABLES.items():
        if rows := rows_of(paper.found):
            write_table(table, folder / name, rows)
    workbook.write(paper, folder / WORKBOOK)
    progress(message("history_papers", "setting the papers of the history"))
    write_pages(pages, paper, folder, PDF, PAGE)
