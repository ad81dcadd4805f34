"""What `tankcal inspect` leaves behind: the inspection as data, on paper and as a workbook.

Nothing here computes a number: all of it is made from inspection.json. No part of it belongs to a
capacity certificate.
"""

import json
from pathlib import Path

from tankcal.errors import InputError, Problem, TankcalError, VocabularyError
from tankcal.messages import message
from tankcal.record import save
from tankcal.record.inspection import INSPECTION, plain_of_inspection
from tankcal.report import folders
from tankcal.report.inspection.paper import FILE, WORKBOOK, InspectionPaper

__all__ = [
    *("FILES", "InspectionPaper", "inspection_file", "rebuild", "refuse_foreign"),
    "write_inspection",
]

PDF = "inspection.pdf"
FILES = (FILE, WORKBOOK, PDF)


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
    refuse_foreign(out)
    progress = progress or (lambda text: None)
    plain = found if isinstance(found, dict) else plain_of_inspection(found)
    paper = InspectionPaper(plain, language, letterhead)
    with folders.replaced(out) as temporary:
        _write(paper, temporary, progress)
    return [Path(out) / name for name in FILES]


def rebuild(source, out, language=None, progress=None, letterhead=None):
    """Write the same from an inspection.json alone; arguments as of `write_inspection`."""
    found = load(source)
    try:
        return write_inspection(found, out, language, progress, letterhead)
    except VocabularyError as error:
        what = str(error)
    except TankcalError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        what = f"{type(error).__name__}: {error}"
    expected = message(
        "no_inspection", "does not have the content of an inspection ({what})", what=what
    )
    raise InputError(Problem(Path(source).name, expected))


def inspection_file(path):
    """The inspection that a path names, the file or its folder; None where it names none."""
    path = Path(path)
    if path.is_dir():
        path = path / FILE
        return path if path.is_file() else None
    return path if path.name == FILE else None


def load(path):
    """Read an inspection.json; raises InputError when it is none."""
    name = Path(path).name
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        expected = message(
            "inspection_unreadable", "cannot be read as an inspection: {error}", error=str(error)
        )
        raise InputError(Problem(name, expected)) from error
    return INSPECTION.migrated(found, name)


def refuse_foreign(out):
    """Raise InputError when `out` exists and holds anything but results of an inspection."""
    folders.refuse_foreign(out, FILES)


def _write(paper, folder, progress):
    from tankcal.report.inspection import workbook
    from tankcal.report.inspection.pages import pages
    from tankcal.report.pdf import pdf

    progress(message("inspection_tables", "writing the tables of the inspection"))
    save(paper.saved, folder / FILE)
    workbook.write(paper, folder / WORKBOOK)
    progress(message("inspection_papers", "setting the papers of the inspection"))
    blocks = [block.data for block in pages(paper, folder)]
    (folder / PDF).write_bytes(pdf(blocks, folder))
