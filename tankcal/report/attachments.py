"""Files that a PDF holds inside, byte for byte: the record, and what was made from it."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path

from tankcal.errors import TankcalError

_WORKBOOK = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"
KINDS = {  # name of the file: MIME type, what it is to the paper (PDF 2.0, 7.11.3)
    "record.json": ("application/json", "source"),
    "record_tables.npz": ("application/zip", "source"),
    "capacity.xlsx": (_WORKBOOK, "data"),
    "adjustment.xlsx": (_WORKBOOK, "data"),
    "certificate.xml": ("text/xml", "alternative"),
    "comparison.json": ("application/json", "source"),
    "comparison.xlsx": (_WORKBOOK, "data"),
    "inspection.json": ("application/json", "source"),
    "inspection.xlsx": (_WORKBOOK, "data"),
    "history.json": ("application/json", "source"),
    "history.xlsx": (_WORKBOOK, "data"),
}
OF_RECORD = (
    *("record.json", "record_tables.npz"),
    *("capacity.xlsx", "adjustment.xlsx", "certificate.xml"),
)
LARGEST = 20_000_000  # bytes: a larger file stays beside the PDF, which names its digest
LARGEST_PACKED = 5_000_000  # of long tables: the size that such a record.json has by them


@dataclass(frozen=True)
class Attachment:
    """A file beside the notebook: its name, type, relationship, description and SHA-256."""

    name: str
    mime: str
    relationship: str
    description: str
    sha256: str

    def data(self):
        """The attachment as plain data: what a document block holds."""
        return asdict(self)


def beside(folder, described):
    """Attachments of the files in `folder` that are known and not too large for a PDF.

    described  {name: description}
    """
    paths = [Path(folder) / name for name in described]
    return [
        Attachment(path.name, *KINDS[path.name], described[path.name], sha256(path.read_bytes()))
        for path in paths
        if path.is_file() and path.stat().st_size <= _largest(path)
    ]


def _largest(path):
    return LARGEST_PACKED if path.suffix == ".npz" else LARGEST


def contents(blocks, folder):
    """{name: bytes} of the attachments that the document blocks name, read in `folder`.

    Raises TankcalError for one that is absent, or is not the one that the notebook found.
    """
    found = {}
    for one in named(blocks):
        path = Path(folder) / one["name"]
        if Path(one["name"]).name != one["name"] or not path.is_file():
            raise TankcalError(
                f"the PDF holds {one['name']!r} inside, and there is no such file beside the "
                "notebook; expected it there"
            )
        found[one["name"]] = path.read_bytes()
        if sha256(found[one["name"]]) != one["sha256"]:
            raise TankcalError(
                f"{one['name']} beside the notebook was changed since the notebook was executed; "
                "execute it again"
            )
    return found


def named(blocks):
    """The data of the attachments of all document blocks, each file once."""
    documents = [block for block in blocks if block["kind"] == "document"]
    return list({one["name"]: one for block in documents for one in _of(block)}.values())


def _of(document):
    return document.get("attachments", [])


def sha256(data):
    """The SHA-256 of bytes, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
