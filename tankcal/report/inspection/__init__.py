"""What `tankcal inspect` leaves behind: the inspection as data, on paper and as a workbook.

Nothing here computes a number: all of it is made from inspection.json. No part of it belongs to a
capacity certificate.
"""

from tankcal.messages import message
from tankcal.record.inspection import INSPECTION
from tankcal.report.inspection.paper import InspectionPaper
from tankcal.report.saved_document import SavedDocument

__all__ = [
    *("DOCUMENT", "FILES", "InspectionPaper", "rebuild", "refuse_foreign"),
    "write_inspection",
]


def _load_renderers():
    from tankcal.report.inspection.pages import pages
    from tankcal.report.inspection.workbook import write

    return pages, write


DOCUMENT = SavedDocument(
    INSPECTION,
    InspectionPaper,
    _load_renderers,
    steps=(
        message("inspection_tables", "writing the tables of the inspection"),
        message("inspection_papers", "setting the papers of the inspection"),
    ),
    unreadable=lambda error: message(
        "inspection_unreadable", "cannot be read as an inspection: {error}", error=error
    ),
    without_content=lambda what: message(
        "no_inspection", "does not have the content of an inspection ({what})", what=what
    ),
    has_page=False,
)
FILES, refuse_foreign, rebuild = DOCUMENT.files, DOCUMENT.refuse_foreign, DOCUMENT.rebuild


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
    return DOCUMENT.write(found, out, language, progress, letterhead)
