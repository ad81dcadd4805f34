"""What `tankcal inspect` leaves behind: the inspection as data, on paper and as a workbook.

Nothing here computes a number: all of it is made from inspection.json. No part of it belongs to a
capacity certificate.
"""

from functools import partial

from tankcal.messages import message
from tankcal.record import manifest, save
from tankcal.record.inspection import INSPECTION
from tankcal.record.schema import to_plain
from tankcal.report.inspection.paper import FILE, WORKBOOK, InspectionPaper
from tankcal.report.saved_folder import SavedFolder, write_pages

__all__ = [
    *("FILES", "InspectionPaper", "inspection_file", "rebuild", "refuse_foreign"),
    "write_inspection",
]

PDF = "inspection.pdf"
FILES = (FILE, WORKBOOK, PDF, manifest.FILE)
_FOLDER = SavedFolder(
    INSPECTION,
    FILES,
    unreadable=lambda error: message(
        "inspection_unreadable", "cannot be read as an inspection: {error}", error=error
    ),
    without_content=lambda what: message(
        "no_inspection", "does not have the content of an inspection ({what})", what=what
    ),
)
refuse_foreign, inspection_file, load = _FOLDER.refuse_foreign, _FOLDER.file_of, _FOLDER.load


def write_inspection(found, out, language=None, progress=None, letterhead=None):
    """Write inspection.json, the workbook and the PDF, all or nothing.

    Parameters
    ----------
    found : record.inspection.InspectionFile or dict
        Of an inspection, or the same as plain data.
    out : path
        Folder, made when missing; an earlier inspection there is replaced, and a folder that holds
        anything else is refused.
    language : str, optional
        Of the papers, one of languages.LANGUAGES; None: English.
    progress : callable, optional
        Called with a line of text as each step begins.
    letterhead : report.letterhead.Letterhead, optional
        Of who inspects.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        For a folder that is not tankcal's to replace, and what is no inspection.
    """
    plain = found if isinstance(found, dict) else to_plain(found)
    paper = InspectionPaper(plain, language, letterhead)
    return _FOLDER.write(out, partial(_write, paper), language, progress)


def rebuild(source, out, language=None, progress=None, letterhead=None):
    """Write the same from an inspection.json alone; arguments as of `write_inspection`."""
    return _FOLDER.rebuild(
        source, lambda found: write_inspection(found, out, language, progress, letterhead)
    )


def _write(paper, folder, progress):
    from tankcal.report.inspection import workbook
    from tankcal.report.inspection.pages import pages

    progress(message("inspection_tables", "writing the tables of the inspection"))
    save(paper.saved, folder / FILE)
    workbook.write(paper, folder / WORKBOOK)
    progress(message("inspection_papers", "setting the papers of the inspection"))
    write_pages(pages, paper, folder, PDF)
