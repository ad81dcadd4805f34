"""Files of `tankcal inspect`: the inspection as data, PDF and workbook.

All files are written from inspection.json; no number is computed here. No file belongs to a
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
    plain = inspection if isinstance(inspection, dict) else to_plain(inspection)
    paper = InspectionPaper(plain, language, letterhead)
    return _FOLDER.write(out, partial(_write, paper), language, progress)


def rebuild(source, out, language=None, progress=None, letterhead=None):
    """Write the files again from an inspection.json; arguments as in `write_inspection`."""
    return _FOLDER.rebuild(
        source, lambda inspection: write_inspection(inspection, out, language, progress, letterhead)
    )


def _write(paper, folder, progress):
    """Write the files of an InspectionPaper into a folder."""
    from tankcal.report.inspection import workbook
    from tankcal.report.inspection.pages import pages

    progress(message("inspection_tables", "writing the tables of the inspection"))
    save(paper.saved, folder / FILE)
    workbook.write(paper, folder / WORKBOOK)
    progress(message("inspection_papers", "setting the papers of the inspection"))
    write_pages(pages, paper, folder, PDF)
