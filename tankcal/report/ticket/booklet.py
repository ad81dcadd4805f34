"""A PDF with the pages of many tickets, for printing.

The pages are those of the documents, without their signature fields. Each page states that
ticket.json is attached, so the booklet contains the ticket.json of each ticket.
"""

import io

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.report.folders import replace_file

BOOKLET = "tickets.pdf"
FILE, PDF = "ticket.json", "ticket.pdf"  # of each ticket
_CREATOR = "tankcal ticket"  # identifies a booklet, which may be replaced


def refuse_foreign_booklet(path):
    """Refuse to replace a file that `write_booklet` did not write.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
    """
    import pypdf

    if not path.exists():
        return
    try:
        metadata = pypdf.PdfReader(path).metadata or {}
        if metadata.get("/Creator") == _CREATOR:
            return
    except (pypdf.errors.PyPdfError, OSError, ValueError):
        pass  # no PDF
    text = message(
        "ticket_booklet_exists",
        "found a file that tankcal ticket did not write; expected another folder",
    )
    raise InputError(Problem(path.name, text))


def write_booklet(documents, path, title):
    """Write the pages of many tickets as a single PDF, with a bookmark for each ticket.

    Parameters
    ----------
    documents : list of (str, Path)
        Number and folder of each ticket.
    path : Path
    title : str

    Raises
    ------
    InputError
        For an existing file of another origin.
    """
    import pypdf

    refuse_foreign_booklet(path)
    writer = pypdf.PdfWriter()
    for number, folder in documents:
        writer.add_attachment(f"{folder.name}/{FILE}", (folder / FILE).read_bytes())
        reader = pypdf.PdfReader(io.BytesIO((folder / PDF).read_bytes()))
        for place, page in enumerate(reader.pages):
            writer.add_page(page, excluded_keys=["/Annots", "/StructParents", "/Tabs"])
            if place == 0:
                writer.add_outline_item(title=number, page_number=len(writer.pages) - 1)
    writer.compress_identical_objects()  # fonts and letterhead are common to all pages
    writer.add_metadata({"/Title": title, "/Creator": _CREATOR, "/Producer": "pypdf"})
    with replace_file(path) as temporary:
        writer.write(temporary)
