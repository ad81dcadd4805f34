"""Files that a PDF holds inside, byte for byte: the record, and what was made from it.

The typesetter would pack them anew for each paper. It is given their digests instead, and sets with
them all that says what a file is; the files come into the place of the digests afterwards, packed
once for all papers of a run.
"""

import hashlib
import re
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Lock

from tankcal.errors import TankcalError
from tankcal.report.pdf_objects import objects_of

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
ZIP = b"PK\x03\x04"  # so begins a file that is packed already
LEVEL = 1  # of packing: the typesetter's own, 6, takes five times as long for 6 % less
_TYPE, _DEFLATED = b"/Type/EmbeddedFile", b"/Filter/FlateDecode"
_HELD = re.compile(
    rb"<</Length \d+/Type/EmbeddedFile(/Filter/FlateDecode)?(/Subtype/[^/<>]+/Params<</Size )\d+"
    rb"([^<>]*>>>>\nstream\n)(.+)\nendstream",
    re.DOTALL,
)


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
    """{name: (SHA-256, bytes)} of what the document blocks attach, read in `folder`.

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
        content = path.read_bytes()
        found[one["name"]] = one["sha256"], content
        if sha256(content) != one["sha256"]:
            raise TankcalError(
                f"{one['name']} beside the notebook was changed since the notebook was executed; "
                "execute it again"
            )
    return found


class Packed:
    """Files as PDFs hold them, each packed once however many papers of a run hold it."""

    def __init__(self):
        self._streams, self._alone = {}, Lock()

    def stream(self, digest, content):
        """(entry of the filter, stream) of the file with that SHA-256."""
        with self._alone:  # of two papers that are set at once the second waits for the first
            if digest not in self._streams:
                zipped = content.startswith(ZIP)
                self._streams[digest] = (
                    (b"", content) if zipped else (_DEFLATED, zlib.compress(content, LEVEL))
                )
            return self._streams[digest]


def hold(pdf, files, packed):
    """A PDF that holds files in the place of their digests.

    Parameters
    ----------
    pdf : bytes
        As typst sets it of files that hold the SHA-256 of others.
    files : dict
        The others, {SHA-256: bytes}.
    packed : Packed

    Returns
    -------
    bytes or None
        None where the digests are not found in the PDF, which then has another form.
    """
    objects = objects_of(pdf)
    if objects is None:
        return None
    changed, missing, at = {}, set(files), pdf.find(_TYPE)
    while at >= 0:
        number, stream = objects.around(at) or (None, b"")
        found = _HELD.fullmatch(stream)
        digest = found and _unpacked(*found.group(1, 4))
        if digest in files:
            changed[number] = _stream(found, packed.stream(digest, files[digest]), files[digest])
            missing.discard(digest)
        at = pdf.find(_TYPE, at + len(_TYPE))
    return None if missing else objects.with_contents(changed)


def _unpacked(deflated, content):
    """The text of a stream."""
    return (zlib.decompress(content) if deflated else content).decode("ascii", "replace")


def _stream(found, packed, content):
    """The object of a file: what typst wrote of a digest, with another size and stream."""
    (deflated, stream), (_, kind, rest, _) = packed, found.groups()
    head = b"<</Length %d/Type/EmbeddedFile%s%s%d%s"
    head %= len(stream), deflated, kind, len(content), rest
    return b"%s%s\nendstream" % (head, stream)


def named(blocks):
    """The data of the attachments of all document blocks, each file once."""
    documents = [block for block in blocks if block["kind"] == "document"]
    return list({one["name"]: one for block in documents for one in _of(block)}.values())


def _of(document):
    return document.get("attachments", [])


def sha256(data):
    """The SHA-256 of bytes, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
