"""Files of `tankcal inspect`: the inspection as data, PDF and workbook.

All files are written from inspection.json; no number is computed here. No file belongs to a
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
    from tankcal.report.inspection.pages import pages, write_sheets

    return pages, write_sheets


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


def write_inspection(inspection, out, language=None, progress=None, letterhead=None):
    """Write inspection.json, the workbook and the PDF, all or none of them.

    Parameters
    ----------
    inspection : record.inspection.InspectionFile or dict
        The inspection, or its plain data.
    out : path
        Folder of the files. An earlier inspection is replaced; a folder with other files is
        refused.
    language : str, optional
        Language of the documents, one of languages.LANGUAGES; None: English.
    progress : callable, optional
        Function that receives a line of text at the start of each step.
    letterhead : report.letterhead.Letterhead, optional
        Letterhead of the inspecting organisation.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If the folder has other files, or if the data are no inspection.
    """
    return DOCUMENT.write(inspection, out, language, progress, letterhead)
